// Walks along a course.
#include "corridor.hpp"

#include "../../controllers/control/steering.hpp"
#include "../../core/numbers.hpp"
#include "../../core/transcendental.hpp"

namespace fg {
namespace {

constexpr int every = 4;            // beams
constexpr double farthest = 8.0;    // [m]
constexpr double apart = 0.3;       // [m] between the points of a jump
constexpr double reach = 0.3;       // [m] along a heading, to which points are to the side of a place
constexpr double widest = 3.0;      // [m] to a side; what is farther away counts as this far
constexpr double narrowest = 0.35;  // [m] in all, where a walk ends
constexpr double clear = 0.25;      // [m] between a car's middle and a wall
constexpr double follows = 0.6;     // share of the turn towards its place across, which a walk takes in a step
constexpr double slope = 0.6;       // of a step: greatest motion across it

}  // namespace

std::int64_t ground_points(const ScanGeometry& geometry, Numbers ranges, Table<double> points) {
    std::int64_t count = 0;
    double last_x = nan, last_y = nan;
    for (int beam = 0; beam < ranges.size(); beam += every) {
        const double bearing = bearing_of(geometry, beam), distance = min(ranges[beam], farthest);
        const double x = distance * fg::cos(bearing), y = distance * fg::sin(bearing);
        const double jump = fg::hypot(x - last_x, y - last_y);
        const int between = jump > apart ? whole(jump / apart) : 0;
        for (int k = 1; k <= between && count < points.rows; ++k) {
            const double share = k / (between + 1.0);
            points[count][0] = last_x + share * (x - last_x), points[count][1] = last_y + share * (y - last_y);
            ++count;
        }
        if (count < points.rows) {
            points[count][0] = x, points[count][1] = y;
            ++count;
        }
        last_x = x, last_y = y;
    }
    return count;
}

std::array<double, 2> room_beside(Matrix points, double x, double y, double heading) {
    const double cos = fg::cos(heading), sin = fg::sin(heading);
    double left = widest, right = widest;
    for (std::int64_t k = 0; k < points.rows; ++k) {
        const double dx = points[k][0] - x, dy = points[k][1] - y;
        if (std::abs(cos * dx + sin * dy) < reach) {
            const double across = cos * dy - sin * dx;
            if (across >= 0.0)
                left = min(left, across);
            else
                right = min(right, -across);
        }
    }
    return {left, right};
}

std::int64_t walk(Matrix points, double x, double y, double heading, Row<WalkPlace> path) {
    const auto [left_now, right_now] = room_beside(points, x, y, heading);
    const double share = left_now / max(left_now + right_now, 1e-6);
    path[0] = {x, y, heading, left_now, right_now};
    for (std::int64_t k = 1; k < path.length; ++k) {
        x += walk_step * fg::cos(heading);
        y += walk_step * fg::sin(heading);
        const auto [left, right] = room_beside(points, x, y, heading);
        const double wide = left + right;
        if (wide < narrowest) return k;
        const double wanted = min(max(share * wide, min(clear, 0.5 * wide)), max(wide - clear, 0.5 * wide));
        const double across = saturate(left - wanted, slope * walk_step);
        x -= across * fg::sin(heading);
        y += across * fg::cos(heading);
        heading += follows * fg::atan(across / walk_step);
        path[k] = {x, y, heading, left - across, right + across};
    }
    return path.length;
}

}  // namespace fg
