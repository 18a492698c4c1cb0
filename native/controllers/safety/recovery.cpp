// Reversing along the path of the local map, by pure pursuit.
#include "recovery.hpp"

#include "../../core/numbers.hpp"
#include "../../core/transcendental.hpp"
#include "../control/steering.hpp"

namespace fg {

bool reverses(Recovery& memory, const RecoverySettings& settings, const LocalMap& world, double speed, bool stands,
              bool found, bool waits, double period) {
    const bool reversing = memory.back > 0.0;
    memory.back -= max(-speed * period, 0.0);
    if (world.along > memory.stood_at + settings.come_on) memory.tried = 0;
    memory.stood = stands && (reversing || !found) ? memory.stood + period : 0.0;
    waits = reversing || (waits && memory.tried == 0);
    if (memory.stood + 0.5 * period >= (waits ? settings.patience : settings.patience_known)) {
        memory.back = memory.stood = 0.0;  // if it was reversing, something behind it holds it
        if (!reversing && memory.tried < settings.tries) {
            ++memory.tried;
            memory.back = settings.distance * static_cast<double>(memory.tried), memory.stood_at = world.along;
        }
    }
    return memory.back > 0.0;
}

double angle_back(const LocalMap& world, const RecoverySettings& settings, const CarParameters& car) {
    const double cos = fg::cos(world.heading), sin = fg::sin(world.heading);
    for (std::int64_t back = 0; back < world.known; ++back) {
        const Numbers point = table(world.path)[(world.newest + path_points - back) % path_points];
        const double x = point[0] - world.x, y = point[1] - world.y;
        if (fg::hypot(x, y) >= settings.reach) {
            const double angle = arc_through(cos * x + sin * y, cos * y - sin * x, car.wheelbase);
            return saturate(angle, car.max_steering_angle);
        }
    }
    return nan;
}

}  // namespace fg
