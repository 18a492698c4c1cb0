#include "friction_patches.hpp"

#include "../core/numbers.hpp"
#include "../core/transcendental.hpp"

namespace fg {

void look_at_floor(double x, double y, double heading, Matrix wheels, Matrix patches, Numbers mu, Row<double> under) {
    const double cos = fg::cos(heading), sin = fg::sin(heading);
    const double greatest = max(max(max(mu[0], mu[1]), mu[2]), mu[3]);
    for (int tire = 0; tire < 4; ++tire) {
        const double at_x = cos * wheels[tire][0] - sin * wheels[tire][1] + x;
        const double at_y = sin * wheels[tire][0] + cos * wheels[tire][1] + y;
        under[tire] = mu[tire];
        for (int k = 0; k < patches.rows; ++k) {
            const Numbers patch = patches[k];
            const double away_x = at_x - patch[0], away_y = at_y - patch[1];
            const double along = patch[4] * away_x + patch[5] * away_y;
            const double across = patch[4] * away_y - patch[5] * away_x;
            if (std::abs(along) <= patch[2] && std::abs(across) <= patch[3])
                under[tire] = mu[tire] == greatest ? patch[6] : patch[6] * (mu[tire] / greatest);
        }
    }
}

}  // namespace fg
