#include "line_mpc.hpp"

#include "../../core/transcendental.hpp"
#include "../../controllers/control/slip.hpp"
#include "../../controllers/control/speed.hpp"
#include "../../controllers/control/steering.hpp"
#include "line_profile.hpp"
#include "line_trackers.hpp"
#include "ltv_program.hpp"

namespace fg {
namespace {

constexpr int steps = mpc_steps, most_size = 5;  // of the horizon, and of a state
constexpr double dt = mpc_time;
constexpr double slowest = 1.0;  // [m/s] the car is planned no slower: one that stands cannot be steered
constexpr double length_at_rest = 0.3, length_time = 0.05;  // [m] and [s]: of the regulator's L
constexpr double rate_time = 0.1;  // [s] a change of the curvature in this time costs as much as the curvature
// Times the weight of what is bounded: that of the distance beyond a soft bound.
constexpr double beyond_bound = 1e3, beyond_rate = 1e5;
constexpr double touch = 0.01;                     // [m] by which a plan may leave the room
constexpr double slower = 10.0, most_slower = 0.2;  // [1/s] and [m/s]: by how much the car slows where its plan
                                                    // leaves the room
constexpr double nudge = 0.01;                     // [rad] for the slope of the lead

// The program of one tick.
struct Horizon {
    std::int64_t size;  // of a state
    Ahead ahead[steps + 1];
    double start[most_size];
    double a[steps * most_size * most_size], b[steps * most_size], c[steps * most_size];
    double weights[(steps + 1) * most_size], effort[steps], coupling[steps], limits[3][steps][bounded];

    Row<const Ahead> places() { return row(ahead); }
    System system() { return {{a, steps, size, size}, {b, steps, size}, {c, steps, size}}; }
    Table<double> all_weights() { return {weights, steps + 1, size}; }
    Program program() {
        const System all = system();
        return {all.a, all.b, all.c, all_weights(), row(effort), row(coupling), {&limits[0][0][0], 3, steps, bounded},
                {start, size}};
    }
};

// Return the steering angle of the last plan [rad] at a time [s] after it was made; the last one beyond its end.
double planned_angle(const Mpc& mpc, double time) {
    const double place = min(max(time / dt, 0.0), static_cast<double>(steps));
    const int at = max(min(whole(place), steps - 1), 0);
    return mpc.angles[at] + (place - at) * (mpc.angles[at + 1] - mpc.angles[at]);
}

// Return by how much a plan leaves the room beside the line, and further than the car now does [m].
double outside(Row<const Ahead> ahead, Matrix states) {
    const double now = max(max(states[0][0] - ahead[0].left, ahead[0].right - states[0][0]), 0.0);
    double most = now;
    for (int k = 1; k <= steps; ++k)
        most = max(max(most, states[k][0] - ahead[k].left), ahead[k].right - states[k][0]);
    return max(most - now - touch, 0.0);
}

// A place along the line between a point and the next one.
struct Place {
    std::int64_t point;
    double beyond;  // [m] the point
};

// Return a place with less than a step beyond its point.
Place moved_on(Matrix line, Place place) {
    const double step = line[0][line_step];
    while (place.beyond < 0.0) place = {next_point(line, place.point, -1), place.beyond + step};
    while (place.beyond >= step) place = {next_point(line, place.point, 1), place.beyond - step};
    return place;
}

// Return the direction of the line at a place [rad], and write what is there but for speed and turn.
double describe(Matrix line, Place place, const CarParameters& car, Ahead& ahead) {
    const std::int64_t point = place.point, after = next_point(line, point, 1);
    const double share = place.beyond / line[0][line_step], here = direction_at(line, point);
    const double bend = (1.0 - share) * curvature_at(line, point) + share * curvature_at(line, after);
    ahead.angle = saturate(fg::atan(car.wheelbase * bend), car.max_steering_angle);
    ahead.curvature = fg::tan(ahead.angle) / car.wheelbase;
    ahead.right = max(line[point][line_right], line[after][line_right]);
    ahead.left = min(line[point][line_left], line[after][line_left]);
    return here + share * within_turn(direction_at(line, after) - here);
}

// Return the car's distance from the line [m] and angle to it [rad], and write what is ahead, (steps + 1,).
std::array<double, 2> look_ahead(Matrix line, std::int64_t nearest, const std::array<double, 4>& begin, double now,
                                 const Driver& driver, Row<Ahead> ahead) {
    const CarParameters& car = driver.car;
    const double x = begin[0], y = begin[1], heading = begin[2];
    const double along = direction_at(line, nearest), cos = fg::cos(along), sin = fg::sin(along);
    const double aside = cos * (y - line[nearest][line_y]) - sin * (x - line[nearest][line_x]);
    const double braking = driver.has_limiter ? driver.limiter.braking : car.max_acceleration;
    const double accelerating = driver.has_limiter ? driver.limiter.accelerating : car.max_acceleration;
    Place place{nearest, cos * (x - line[nearest][line_x]) + sin * (y - line[nearest][line_y])};
    double speed = max(now, slowest), last = along, turned = 0.0;
    for (int k = 0; k <= steps; ++k) {
        place = moved_on(line, place);
        const double here = describe(line, place, car, ahead[k]);
        if (k == 0)
            turned = within_turn(heading - here);
        else
            ahead[k - 1].turn = within_turn(here - last);
        last = here;
        ahead[k].speed = speed;
        const double target = line[next_point(line, place.point, 1)][line_speed];
        const double reached = max(slowest, min(max(target, speed - braking * dt), speed + accelerating * dt));
        place.beyond += 0.5 * (speed + reached) * dt;
        speed = reached;
    }
    ahead[steps].turn = 0.0;
    return {aside, turned};
}

// Return the exponential of a matrix of two rows, in closed form.
std::array<double, 4> exponential(double m00, double m01, double m10, double m11) {
    const double mean = 0.5 * (m00 + m11), half = 0.5 * (m00 - m11);
    const double square = half * half + m01 * m10;
    const double root = std::sqrt(std::abs(square));
    const double even = square > 0.0 ? std::cosh(root) : fg::cos(root);
    const double odd = root > 1e-9 ? (square > 0.0 ? std::sinh(root) : fg::sin(root)) / root : 1.0;
    const double scale = fg::exp(mean);
    return {scale * (even + odd * half), scale * odd * m01, scale * odd * m10, scale * (even - odd * half)};
}

// What a step of the single-track car does to its lateral speed and its yaw rate: these themselves, row by row, and a
// wheel's angle [rad] to either.
struct Sway {
    double e00, e01, e10, e11, by_angle0, by_angle1;
};

// Return it at a speed [m/s] on a curvature [1/m].
Sway sway_of(const Driver& driver, double speed, double bend) {
    const CarParameters& car = driver.car;
    const Slip& slip = driver.limiter.slip;
    const double front = car.front_axle_distance, rear = car.rear_axle_distance, gravity = car.gravity;
    const double heavy = car.mass / car.yaw_inertia;
    const double force = min(max(speed * speed * std::abs(bend) / gravity, 0.1 * slip.most), slip.most);
    // [m/s^2 / rad]
    const double ahead_force = force / slip_angle(slip.front, force) * gravity * rear / car.wheelbase;
    const double behind_force = force / slip_angle(slip.rear, force) * gravity * front / car.wheelbase;
    const double unequal = front * ahead_force - rear * behind_force;
    const double m00 = -(ahead_force + behind_force) / speed, m01 = -unequal / speed - speed;
    const double m10 = -heavy * unequal / speed;
    const double m11 = -heavy * (front * front * ahead_force + rear * rear * behind_force) / speed;
    const auto [h00, h01, h10, h11] = exponential(0.5 * dt * m00, 0.5 * dt * m01, 0.5 * dt * m10, 0.5 * dt * m11);
    const double e00 = h00 * h00 + h01 * h10, e01 = h00 * h01 + h01 * h11;
    const double e10 = h10 * h00 + h11 * h10, e11 = h10 * h01 + h11 * h11;
    const double push = ahead_force, twist = heavy * front * ahead_force;
    // Simpson's rule for the integral of the exponential
    return {e00, e01, e10, e11, dt / 6.0 * ((1.0 + 4.0 * h00 + e00) * push + (4.0 * h01 + e01) * twist),
            dt / 6.0 * ((4.0 * h10 + e10) * push + (1.0 + 4.0 * h11 + e11) * twist)};
}

// Write the weights of the cost; at the end that of the regulator, whose horizon has no end.
void weigh(const CarParameters& car, Horizon& horizon) {
    const Table<double> weights = horizon.all_weights();
    for (int k = 0; k <= steps; ++k) {
        const double speed = horizon.ahead[k].speed;
        const double way = speed * dt, length = length_at_rest + (length_time + late_by(car)) * speed;
        const double cos = fg::cos(horizon.ahead[k].angle), gain = 1.0 / (car.wheelbase * (cos * cos));
        const double square = length * length;
        weights[k][0] = way / (square * square), weights[k][horizon.size - 1] = way * gain * gain;
        if (k < steps) {
            horizon.effort[k] = way * (gain * rate_time * (gain * rate_time));
        } else {
            weights[k][0] += std::sqrt(2.0) / (length * square);
            weights[k][1] += std::sqrt(2.0) / length;
        }
    }
}

// The bounds of a step: of the steering angle [rad] and of its rate, and those that are linear in both [rad/s].
struct Bounds {
    double lock, fastest, least, most, coupling;
};

// Return the bounds of a step by lock and servo, and by the friction limiter, whose steering rate is linear in the
// steering angle, u + coupling d (friction_limiter.steering_rate). `per_angle` is the rate of the wheels over the angle
// from them to the command, in the mean of a tick [1/s].
Bounds bounds_of(const Ahead& here, const Ahead& after, const Driver& driver, double per_angle) {
    const CarParameters& car = driver.car;
    const Limiter& limiter = driver.limiter;
    double fastest = car.max_steering_rate, lock = car.max_steering_angle;
    if (!driver.has_limiter) return {lock, fastest, -(2.0 * fastest), 2.0 * fastest, 0.0};
    const FrictionLimiterSettings& settings = limiter.settings;
    const double speed = here.speed, angle = here.angle;
    const double response = settings.steering_response * per_angle;
    fastest *= min(response, 1.0);
    const double use = settings.lateral_use * (after.speed < speed ? settings.lateral_use_in_braking : 1.0);
    lock = min(lock, friction_steering(after.speed, limiter.mu * use, car.wheelbase, car.gravity));
    if (limiter.slip.needs_slip_angle) lock = min(lock, tightest_arc(limiter.slip, after.speed));
    const double cos = fg::cos(angle), bent = fg::tan(angle), slope = 1.0 / (cos * cos);
    const double by_left = settings.turn_in_use * response * car.wheelbase / (limiter.yaw_lag * speed);
    const double coupling = by_left * speed * speed / car.wheelbase, middle = coupling * (angle - bent / slope);
    const double most = by_left * limiter.lateral / slope, least = -by_left * limiter.lateral / slope;
    return {lock, fastest, least + middle, most + middle, coupling};
}

// Write the bounds, less what the line has; `per_angle` as of `bounds_of`.
void bound(const Driver& driver, double per_angle, Horizon& horizon) {
    const Table<double> weights = horizon.all_weights();
    for (int k = 0; k < steps; ++k) {
        const Ahead &here = horizon.ahead[k], &after = horizon.ahead[k + 1];
        const Bounds bounds = bounds_of(here, after, driver, per_angle);
        const double lines = (after.angle - here.angle) / dt;
        const double known = lines + bounds.coupling * here.angle;
        horizon.coupling[k] = bounds.coupling;
        double *const low = horizon.limits[limits_low][k], *const high = horizon.limits[limits_high][k];
        double* const softness = horizon.limits[limits_softness][k];
        low[bounds_input] = -bounds.fastest - lines, high[bounds_input] = bounds.fastest - lines;
        low[bounds_coupled] = bounds.least - known, high[bounds_coupled] = bounds.most - known;
        low[bounds_last] = -bounds.lock - after.angle, high[bounds_last] = bounds.lock - after.angle;
        low[bounds_first] = after.right, high[bounds_first] = after.left;
        softness[bounds_coupled] = 1.0 / (beyond_rate * horizon.effort[k]);
        softness[bounds_last] = 1.0 / (beyond_bound * weights[k + 1][horizon.size - 1]);
        softness[bounds_first] = 1.0 / (beyond_bound * weights[k + 1][0]);
    }
}

// Write the program of a tick; `begin` is where the car is when it is commanded, `now` its speed [m/s], `yaw_rate` its
// own [rad/s], and `per_angle` as of `bounds_of`.
void pose_program(Matrix line, std::int64_t nearest, const std::array<double, 4>& begin, double now, double yaw_rate,
                  const Driver& driver, double per_angle, Horizon& horizon) {
    const CarParameters& car = driver.car;
    const Slip& slip = driver.limiter.slip;
    double* const start = horizon.start;
    horizon.size = slip.needs_slip_angle ? most_size : 3;
    const auto [aside, turned] = look_ahead(line, nearest, begin, now, driver, row(horizon.ahead));
    start[0] = aside, start[1] = turned, start[horizon.size - 1] = begin[3] - horizon.ahead[0].angle;
    if (slip.needs_slip_angle) {
        start[3] = yaw_rate;
        start[2] = now * velocity_angle(slip, car, now, start[3]) + car.rear_axle_distance * start[3];
        single_track(horizon.places(), driver, horizon.system());
    } else {
        kinematic(horizon.places(), car, horizon.system());
    }
    weigh(car, horizon);
    bound(driver, per_angle, horizon);
}

}  // namespace

std::tuple<double, double, std::int64_t> plan_steering(Matrix line, std::int64_t nearest, const Odometry& odometry,
                                                       const Driver& driver, double period, Mpc& mpc) {
    const CarParameters& car = driver.car;
    const Slip& slip = driver.limiter.slip;
    const double now = min(std::abs(odometry.speed), car.max_speed);
    const double angle =
        slip.needs_slip_angle ? arc_angle(slip, car, odometry.steering_angle, now) : odometry.steering_angle;
    const double share = share_of_way(period, car.steering_time_constant + car.command_delay);
    const std::array<double, 4> begin = place_at_command(odometry, car, angle, mpc);
    Horizon horizon{};
    pose_program(line, nearest, begin, now, odometry.angular_velocity[2], driver, share / period, horizon);
    mpc.age += period;
    double inputs[steps], reached[(steps + 1) * most_size];
    const Table<double> states{reached, steps + 1, horizon.size};
    mpc.iterations = solve_program(horizon.program(), row(inputs), states, most_iterations);
    std::int64_t state = mpc_solved;
    double out = 0.0;
    if (mpc.iterations > 0) {
        mpc.planned = true, mpc.age = 0.0;
        for (int k = 0; k <= steps; ++k) mpc.angles[k] = horizon.ahead[k].angle + states[k][horizon.size - 1];
        out = outside(horizon.places(), states);
    } else {
        state = mpc.planned && mpc.age + 0.5 * period < steps * dt ? mpc_last_plan : mpc_no_plan;
    }
    mpc.command = angle;
    if (mpc.planned && std::isfinite(begin[3])) {
        const double wanted = planned_angle(mpc, mpc.age + period);
        mpc.command = saturate(begin[3] + (wanted - begin[3]) / share, car.max_steering_angle);
    }
    const double fastest = out > 0.0 ? max(now - min(slower * out, most_slower), slowest) : inf;
    return {mpc.command, state == mpc_no_plan ? 0.0 : fastest, state};
}

std::array<double, 4> place_at_command(const Odometry& odometry, const CarParameters& car, double angle,
                                       const Mpc& mpc) {
    const double x = odometry.pose[0], y = odometry.pose[1], heading = odometry.pose[2], delay = car.command_delay;
    if (delay == 0.0 || !mpc.planned) return {x, y, heading, angle};
    const double then = mpc.command + (angle - mpc.command) * fg::exp(-delay / car.steering_time_constant);
    const double way = odometry.speed * delay;
    const double turn = way * fg::tan(0.5 * (angle + then)) / car.wheelbase;
    return {x + way * fg::cos(heading + 0.5 * turn), y + way * fg::sin(heading + 0.5 * turn), heading + turn, then};
}

void kinematic(Row<const Ahead> ahead, const CarParameters& car, const System& system) {
    for (int k = 0; k < steps; ++k) {
        const Table<double> a = system.a[k];
        const Row<double> b = system.b[k], c = system.c[k];
        const double way = 0.5 * (ahead[k].speed + ahead[k + 1].speed) * dt;
        const double cos = fg::cos(ahead[k].angle), gain = 1.0 / (car.wheelbase * (cos * cos));
        const double bend = 0.5 * (ahead[k].curvature + ahead[k + 1].curvature);
        a[0][0] = a[1][1] = a[2][2] = 1.0;
        a[0][1] = way, a[0][2] = 0.5 * way * way * gain, b[0] = way * way * gain * dt / 6.0;
        a[1][0] = -way * bend * bend, a[1][2] = way * gain, b[1] = 0.5 * way * gain * dt;
        b[2] = dt;
        c[1] = way * bend - ahead[k].turn;
        c[0] = 0.5 * way * c[1];
    }
}

void single_track(Row<const Ahead> ahead, const Driver& driver, const System& system) {
    const CarParameters& car = driver.car;
    const Slip& slip = driver.limiter.slip;
    const double rear = car.rear_axle_distance;
    for (int k = 0; k < steps; ++k) {
        const Table<double> a = system.a[k];
        const Row<double> b = system.b[k], c = system.c[k];
        const double speed = 0.5 * (ahead[k].speed + ahead[k + 1].speed);
        const Sway sway = sway_of(driver, speed, 0.5 * (ahead[k].curvature + ahead[k + 1].curvature));
        const double arc = ahead[k].angle, next_arc = ahead[k + 1].angle;
        const double wheels = 0.5 * (steered(slip, car, arc, speed) + steered(slip, car, next_arc, speed));
        const double middle = 0.5 * (arc + next_arc);
        const double gain =
            (steered(slip, car, middle + nudge, speed) - steered(slip, car, middle - nudge, speed)) / (2.0 * nudge);
        a[2][2] = sway.e00, a[2][3] = sway.e01, a[2][4] = sway.by_angle0 * gain;
        a[3][2] = sway.e10, a[3][3] = sway.e11, a[3][4] = sway.by_angle1 * gain;
        b[2] = 0.5 * dt * a[2][4], b[3] = 0.5 * dt * a[3][4];
        c[2] = sway.by_angle0 * wheels, c[3] = sway.by_angle1 * wheels;
        a[4][4] = 1.0, b[4] = dt;
        a[1][1] = 1.0, a[1][3] = 0.5 * dt;
        for (int j = 2; j < 5; ++j) a[1][j] += 0.5 * dt * a[3][j];
        b[1] = 0.5 * dt * b[3], c[1] = 0.5 * dt * c[3] - ahead[k].turn;
        a[0][0] = 1.0, a[0][1] = 0.5 * dt * speed;
        a[0][2] = 0.5 * dt, a[0][3] = -0.5 * dt * rear;
        for (int j = 1; j < 5; ++j) a[0][j] += 0.5 * dt * (speed * a[1][j] + a[2][j] - rear * a[3][j]);
        b[0] = 0.5 * dt * (speed * b[1] + b[2] - rear * b[3]);
        c[0] = 0.5 * dt * (speed * c[1] + c[2] - rear * c[3]);
    }
}

void track_by_mpc(const Tick& tick, Mpc& mpc) {
    Reference& reference = tick.reference;
    const bool planned = mpc.planned;
    mpc.planned = false;
    if (!(is_ahead(reference) && reference.off_line < (planned ? line_room : off_line))) return;
    mpc.planned = planned;
    const auto [steering_angle, speed, plan] = plan_steering(tick.line, reference.point, tick.odometry, tick.driver,
                                                             period_of(tick.geometry), mpc);
    reference.steering_angle = steering_angle, reference.plan = plan;
    reference.speed = min(reference.speed, speed), reference.own_speed = min(reference.own_speed, speed);
}

}  // namespace fg
