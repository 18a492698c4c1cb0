// The curvature of the motion is steered ahead of time, by as much as the steering takes, and the distance from the
// motion and the angle to it fall over a length that grows with the speed, as a critically damped oscillator does.
#include "tracking.hpp"

#include "../../core/numbers.hpp"
#include "../../core/transcendental.hpp"

namespace fg {
namespace {

constexpr double length_at_rest = 0.3, length_time = 0.1;  // [m] and [s]: over which errors fall

}  // namespace

std::int64_t next_point(Matrix points, std::int64_t index, double x, double y, double heading) {
    const double cos = fg::cos(heading), sin = fg::sin(heading);
    while (index + 1 < points.rows &&
           cos * (points[index][motion_x] - x) + sin * (points[index][motion_y] - y) <= 0.0)
        ++index;
    return index;
}

std::array<double, 3> errors(Numbers point, double x, double y, double heading) {
    const double cos = fg::cos(point[motion_heading]), sin = fg::sin(point[motion_heading]);
    const double ahead = cos * (point[motion_x] - x) + sin * (point[motion_y] - y);
    const double aside = cos * (y - point[motion_y]) - sin * (x - point[motion_x]) -
                         0.5 * point[motion_curvature] * ahead * ahead;
    return {ahead, aside, within_turn(heading - (point[motion_heading] - point[motion_curvature] * ahead))};
}

double steer_along(Matrix points, std::int64_t index, std::array<double, 3> pose, double speed, double wheelbase,
                   double late, double path_late) {
    const double length = length_at_rest + (length_time + path_late) * max(speed, 0.0);
    const auto [ahead, aside, angle] = errors(points[index], pose[0], pose[1], pose[2]);
    double along = ahead;
    std::int64_t at = index;
    while (along < (steering_lag + late) * speed && at + 1 < points.rows) {
        const Numbers here = points[at], after = points[at + 1];
        along += fg::hypot(after[motion_x] - here[motion_x], after[motion_y] - here[motion_y]);
        ++at;
    }
    const double curvature =
        points[at][motion_curvature] - aside / (length * length) - 2.0 * fg::sin(angle) / length;
    return fg::atan(wheelbase * curvature);
}

}  // namespace fg
