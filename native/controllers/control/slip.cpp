// Slip angles in a steady curve: of an axle, of a car whose axles differ or whose shaft is wound up, and back to arcs.
#include "slip.hpp"

#include "../../core/transcendental.hpp"

namespace fg {
namespace {

constexpr double most_use = 0.97;   // of an axle's peak: a greater force has the slip angle of this
constexpr double most_ratio = 0.5;  // [-] of slip along the heading
constexpr double slow = 0.5;        // [m/s] below it the path is the arc's, and the ground's speed that of the wheels
constexpr int halvings = 24;
constexpr double computed = 1e-9;   // share of a yaw rate: one as near to v tan(d) / b as this was computed by it

// Return by how much more than the arc's angle the car is steered [rad], at a lateral acceleration over g.
double lead(const Slip& slip, double force) {
    const double position = min(force / slip.most, 1.0) * (slip_forces - 1);
    const int at = max(min(whole(position), slip_forces - 2), 0);
    return slip.lead[at] + (position - at) * (slip.lead[at + 1] - slip.lead[at]);
}

// Return by how much more than the angle of an arc [rad] a car is steered whose shaft is wound up there.
//
// The front axle has the longer way, by 1 / cos(d), and a shaft lets it turn no faster than the other one. So the front
// wheels slip along their heading by a part of 1 - cos(d), and their drag pulls sideways by sin(d).
double wound_up(const Slip& slip, double angle) {
    return slip.wound_up * (1.0 - fg::cos(angle)) * fg::tan(angle);
}

// Return the force of an axle over its load at a slip angle [rad], or at a slip ratio: `slip_angle` read back.
double axle_force(const Axle& axle, double angle) {
    if (axle.C == 0.0) return axle.B * angle;
    return axle.D * fg::sin(axle.C * fg::atan(axle.B * angle));
}

// Return the angle of an arc as `arc_angle`, without sign and up to a lateral acceleration over g.
double arc_within(const Slip& slip, double steering_angle, double speed, double lock, double wheelbase, double gravity,
                  double most) {
    double low = 0.0, high = min(lock, fg::atan2(wheelbase * gravity * most, speed * speed));
    const double over = speed * speed / (wheelbase * gravity);
    if (high + lead(slip, over * fg::tan(high)) + wound_up(slip, high) <= steering_angle) return high;
    for (int i = 0; i < halvings; ++i) {
        const double middle = 0.5 * (low + high);
        if (middle + lead(slip, over * fg::tan(middle)) + wound_up(slip, middle) <= steering_angle)
            low = middle;
        else
            high = middle;
    }
    return low;
}

// Return the slip ratio of the driven wheels, without sign, at an acceleration over g; it moves load to the rear axle.
double drive_slip(const Slip& slip, const CarParameters& car, double pull) {
    const double force = std::abs(pull), moved = car.center_of_gravity_height * pull;
    if (car.drives_front && car.drives_rear)
        return 0.5 * (slip_angle(slip.front, force) + slip_angle(slip.rear, force));
    const double lever = car.drives_front ? car.rear_axle_distance - moved : car.front_axle_distance + moved;
    return slip_angle(car.drives_front ? slip.front : slip.rear, force * car.wheelbase / max(lever, 1e-3));
}

}  // namespace

double slip_angle(const Axle& axle, double force) {
    if (axle.C == 0.0) return force / axle.B;
    return fg::tan(fg::asin(min(force / axle.D, most_use)) / axle.C) / axle.B;
}

// On the arc of `angle` a wound-up shaft drags the front axle along: of the slip of driving the rear axle has the more,
// and of that of braking the front one. Load moves to the rear axle, of an acceleration `back` off it, and off the
// inner wheel by the lateral acceleration over g; an open axle pulls alike with both, at a mean slip.
double held_on_arc(const Slip& slip, const CarParameters& car, double angle, double lateral, bool back, bool brakes,
                   double use) {
    const double inner = max(1.0 - 2.0 * car.center_of_gravity_height / car.track_width * lateral, 0.0);
    const double wound = slip.wound_up > 0.0 ? 1.0 - fg::cos(angle) : 0.0;
    const double most = use * slip.front.D;
    double of_rear = slip_angle(slip.rear, use * inner * slip.rear.D), of_front = of_rear - wound;
    if (brakes) {
        of_front = 0.5 * (slip_angle(slip.front, most) + slip_angle(slip.front, most * inner / (2.0 - inner)));
        of_rear = of_front - wound;
    }
    const double front = axle_force(slip.front, of_front) * car.rear_axle_distance / car.wheelbase;
    const double rear = axle_force(slip.rear, of_rear) * car.front_axle_distance / car.wheelbase;
    const double moved =
        car.center_of_gravity_height * (rear / car.front_axle_distance - front / car.rear_axle_distance);
    return max(front + rear, 0.0) / (back ? 1.0 + moved : 1.0 - moved);
}

double steered(const Slip& slip, const CarParameters& car, double angle, double speed) {
    if (angle == 0.0 || !std::isfinite(angle + speed)) return angle;
    const double force = speed * speed * fg::tan(std::abs(angle)) / (car.wheelbase * car.gravity);
    const double more = lead(slip, force) + wound_up(slip, std::abs(angle));
    return saturate(angle + std::copysign(more, angle), car.max_steering_angle);
}

double arc_angle(const Slip& slip, const CarParameters& car, double steering_angle, double speed) {
    if (steering_angle == 0.0 || !std::isfinite(steering_angle + speed)) return steering_angle;
    const double lock = min(tightest_arc(slip, speed), car.max_steering_angle);
    const double size = arc_within(slip, std::abs(steering_angle), speed, lock, car.wheelbase, car.gravity, slip.most);
    return std::copysign(size, steering_angle);
}

void find_tightest(Slip& slip, Numbers speeds, Numbers forces, double lock, double wheelbase, double gravity) {
    for (int i = 0; i < slip_speeds; ++i)
        slip.tightest[i] = arc_within(slip, lock, speeds[i], lock, wheelbase, gravity, forces[i]);
}

double fastest_on(const Slip& slip, double angle, double least) {
    const double size = std::abs(angle);
    for (int at = slip_speeds - 1; at > 0; --at) {
        const double before = slip.tightest[at - 1], here = slip.tightest[at];
        if (before >= size) {
            if (here >= size) return at == slip_speeds - 1 ? inf : slip.top_speed * at / (slip_speeds - 1);
            const double speed = slip.top_speed * (at - 1 + (before - size) / (before - here)) / (slip_speeds - 1);
            return max(speed, least);
        }
    }
    return least;
}

double stable_braking(const Slip& slip, double use, double speed) {
    const double row = min(max(use, 0.0), 1.0) * (slip_uses - 1);
    const double column = min(speed / slip.top_speed, 1.0) * (slip_stops - 1);
    const int i = max(min(whole(row), slip_uses - 2), 0), j = max(min(whole(column), slip_stops - 2), 0);
    const double down = row - i, right = column - j;
    const double *const here = slip.stable[i], *const next = slip.stable[i + 1];
    const double above = here[j] + right * (here[j + 1] - here[j]);
    const double below = next[j] + right * (next[j + 1] - next[j]);
    return above + down * (below - above);
}

double late_on_path(const Slip& slip, const CarParameters& car, double speed) {
    if (!slip.needs_slip_angle) return late_by(car);
    return late_by(car) + path_lag(slip, speed) / max(speed, slow);
}

double velocity_angle(const Slip& slip, const CarParameters& car, double speed, double yaw_rate) {
    if (!(slip.needs_slip_angle && speed > 0.0 && std::isfinite(speed * yaw_rate))) return 0.0;
    const double force = min(std::abs(speed * yaw_rate) / car.gravity, slip.most);
    return -std::copysign(slip_angle(slip.rear, force), yaw_rate);
}

double yaw_rate_on_arc(const Slip& slip, const CarParameters& car, const Odometry& odometry) {
    const double yaw_rate = odometry.angular_velocity[2], speed = odometry.speed, angle = odometry.steering_angle;
    const double error = yaw_rate - speed * fg::tan(angle) / car.wheelbase;
    if (!(slip.needs_slip_angle && std::abs(error) < computed * std::abs(yaw_rate))) return yaw_rate;
    return speed * fg::tan(arc_angle(slip, car, angle, speed)) / car.wheelbase;
}

// The motor's servo pulls with a = (command - wheels) / its time constant, less what rolling takes. For this the wheels
// are faster than the ground by a slip ratio s, or slower: v = wheels / (1 + s). A shaft that is wound up on the arc of
// `angle` makes the rear wheels faster. A command of 0: none.
double ground_speed(const Slip& slip, const CarParameters& car, double wheels, double angle, double command) {
    if (slip.wound_up > 0.0) wheels /= 1.0 + (1.0 - slip.wound_up) * (1.0 - fg::cos(angle));
    if (!(std::abs(wheels) > slow && command != 0.0)) return wheels;
    double pull = saturate((command - wheels) / car.speed_time_constant, car.max_acceleration);
    pull = (pull - drag(car, wheels)) / car.gravity;
    const double ratio = drive_slip(slip, car, pull);
    return wheels / (1.0 + std::copysign(min(ratio, most_ratio), pull * wheels));
}

double to_velocity_frame(const Slip& slip, const CarParameters& car, const ScanGeometry& geometry,
                         const Odometry& odometry, double command, VelocityFrame& frame) {
    const double yaw_rate = odometry.angular_velocity[2], last = frame.angle;
    const bool fast = std::abs(odometry.speed) > slow;
    const double turn = fast ? fg::atan(car.wheelbase * yaw_rate / odometry.speed) : odometry.steering_angle;
    const double speed = ground_speed(slip, car, odometry.speed, turn, command);
    const double excess = odometry.speed - speed;
    frame.excess = std::isfinite(excess) ? excess : 0.0;  // what is not finite is not added to a command
    frame.angle = velocity_angle(slip, car, speed, yaw_rate);
    frame.geometry = geometry;
    frame.geometry.angle_min = geometry.angle_min - frame.angle;
    frame.odometry = odometry;
    Odometry& seen = frame.odometry;
    seen.speed = speed;
    seen.steering_angle = arc_angle(slip, car, odometry.steering_angle, speed);
    seen.angular_velocity[2] += (frame.angle - last) / period_of(geometry);
    if (speed > slow) return yaw_rate / speed;
    return fg::tan(seen.steering_angle) / car.wheelbase;
}

}  // namespace fg
