#include "line_trackers.hpp"

#include <array>

#include "../../core/transcendental.hpp"
#include "../../controllers/control/slip.hpp"
#include "../../controllers/control/steering.hpp"
#include "../../controllers/control/tracking.hpp"
#include "line_profile.hpp"

namespace fg {
namespace {

constexpr double span = 0.2;       // [m] to either side of a point, for the direction of the line
constexpr double bend_span = 0.4;  // [m] the same for its curvature
constexpr double stanley_gain = 2.5, stanley_slowest = 1.0;  // [1/s] and [m/s]
constexpr double length_at_rest = 0.4, length_time = 0.1;    // [m] and [s]: of the regulator's L

// Return how far to the left of the line (x, y) is [m], and the angle of a heading to the line [rad].
std::array<double, 2> errors_at(Matrix line, std::int64_t point, double x, double y, double heading) {
    const double along = direction_at(line, point);
    const double aside =
        fg::cos(along) * (y - line[point][line_y]) - fg::sin(along) * (x - line[point][line_x]);
    return {aside, within_turn(heading - along)};
}

// Return the speed [m/s] of a car, from 0.
double speed_of(const Tick& tick) { return min(std::abs(tick.odometry.speed), tick.driver.car.max_speed); }

// Return the steering angle [rad] of Stanley's law; `nearest` is the line's point nearest to the rear axle.
double stanley_steering(Matrix line, std::int64_t nearest, Numbers pose, double speed, const CarParameters& car) {
    const double x = pose[0], y = pose[1], heading = pose[2];
    const std::int64_t front = moved_along(line, nearest, car.wheelbase);
    const double front_x = x + car.wheelbase * fg::cos(heading), front_y = y + car.wheelbase * fg::sin(heading);
    const auto [aside, angle] = errors_at(line, front, front_x, front_y, heading);
    return -angle - fg::atan2(stanley_gain * aside, max(speed, stanley_slowest));
}

// Return the steering angle [rad] of the regulator, with the line's curvature ahead of its nearest point.
double lqr_steering(Matrix line, std::int64_t nearest, Numbers pose, double speed, const CarParameters& car) {
    const auto [aside, angle] = errors_at(line, nearest, pose[0], pose[1], pose[2]);
    const double late = steering_lag + late_by(car);
    const double ahead = curvature_at(line, moved_along(line, nearest, late * speed));
    const double length = length_at_rest + (length_time + late_by(car)) * speed;
    return fg::atan(car.wheelbase * (ahead + lqr_feedback(aside, angle, length)));
}

// Return the direction [rad] from the car's heading in which its rear axle moves along the line, at a speed [m/s].
double direction_of_path(Matrix line, std::int64_t nearest, double speed, const Driver& driver) {
    const Slip& slip = driver.limiter.slip;
    if (!slip.needs_slip_angle) return 0.0;
    return velocity_angle(slip, driver.car, speed, speed * curvature_at(line, nearest));
}

}  // namespace

double direction_at(Matrix line, std::int64_t point) {
    const Numbers before = line[moved_along(line, point, -span)], after = line[moved_along(line, point, span)];
    return fg::atan2(after[line_y] - before[line_y], after[line_x] - before[line_x]);
}

double curvature_at(Matrix line, std::int64_t point) {
    const Numbers before = line[moved_along(line, point, -bend_span)], here = line[point];
    const Numbers after = line[moved_along(line, point, bend_span)];
    const double ux = here[line_x] - before[line_x], uy = here[line_y] - before[line_y];
    const double vx = after[line_x] - here[line_x], vy = after[line_y] - here[line_y];
    const double sides = fg::hypot(ux, uy) * fg::hypot(vx, vy) * fg::hypot(ux + vx, uy + vy);
    return sides > 0.0 ? 2.0 * (ux * vy - uy * vx) / sides : 0.0;
}

double lqr_feedback(double aside, double angle, double length) {
    return -aside / (length * length) - std::sqrt(2.0) * angle / length;
}

void track_by_stanley(const Tick& tick) {
    Reference& reference = tick.reference;
    if (is_ahead(reference) && reference.off_line < off_line)
        reference.steering_angle = stanley_steering(tick.line, reference.point, row(tick.odometry.pose),
                                                    speed_of(tick), tick.driver.car);
}

void track_by_lqr(const Tick& tick) {
    Reference& reference = tick.reference;
    if (is_ahead(reference) && reference.off_line < off_line)
        reference.steering_angle =
            lqr_steering(tick.line, reference.point, row(tick.odometry.pose), speed_of(tick), tick.driver.car);
}

void track_by_map(const Tick& tick) {
    Reference& reference = tick.reference;
    if (!is_ahead(reference)) return;
    const double direction = direction_of_path(tick.line, reference.point, speed_of(tick), tick.driver);
    reference.steering_angle =
        pursue(reference.bearing - direction, reference.distance, 0.0, tick.driver.car.wheelbase);
}

}  // namespace fg
