#include "ray_cast.hpp"

#include <cmath>

#include "../../core/numbers.hpp"
#include "../../core/transcendental.hpp"

namespace fg {

void ray_cast(const std::array<double, 3>& pose, Row<double> scan, Numbers scan_angles, Matrix vertices) {
    const auto [x, y, heading] = pose;
    for (std::int64_t beam = 0; beam < scan.length; ++beam) {
        const double dx = fg::cos(heading + scan_angles[beam]), dy = fg::sin(heading + scan_angles[beam]);
        for (int corner = 0; corner < 4; ++corner) {
            const Numbers a = vertices[corner], b = vertices[(corner + 1) % 4];
            const double across = dx * (b[1] - a[1]) - dy * (b[0] - a[0]);
            if (across == 0.0) continue;
            const double distance = ((a[0] - x) * (b[1] - a[1]) - (a[1] - y) * (b[0] - a[0])) / across;
            const double share = ((a[0] - x) * dy - (a[1] - y) * dx) / across;
            if (distance >= 0.0 && 0.0 <= share && share <= 1.0) scan[beam] = min(scan[beam], distance);
        }
    }
}

}  // namespace fg
