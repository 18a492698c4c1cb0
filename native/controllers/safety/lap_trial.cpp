#include "lap_trial.hpp"

#include "../../core/numbers.hpp"
#include "../../core/transcendental.hpp"
#include "../control/slip.hpp"
#include "../control/steering.hpp"
#include "../control/tracking.hpp"
#include "lap_raceline.hpp"
#include "line_following.hpp"

namespace fg {
namespace {

constexpr double laps = 2.0;
constexpr int ticks_at_once = 40;    // that are simulated in a tick
constexpr int steps_of_a_tick = 10;  // of the model
constexpr double clear_of_walls = 0.07;  // [m] between the car and what was seen: the line does not barely hold
constexpr int places_behind = 3, places_ahead = 5;  // whose beams are looked at
constexpr double start_speed = 1.0;                 // [m/s]
constexpr int delayed = 8;                          // commands that are kept

void begin_trial(Line& line, const Limiter& limiter) {
    Trial& trial = line.trial;
    const auto window = line_ahead(line, 1, 0.0, 0.0, 0.0, limiter);
    const Row<double> start = window[0];
    trial.begun = true, trial.way = 0.0, trial.next = 1, trial.place = 0;
    trial.x = start[motion_x], trial.y = start[motion_y], trial.heading = start[motion_heading];
    trial.speed = start_speed, trial.sideways = trial.yaw_rate = trial.steering = 0.0;
    trial.slip[0] = trial.slip[1] = 0.0;
    for (auto& command : trial.commands) command[0] = 0.0, command[1] = start_speed;
    trial.memory.acceleration = trial.memory.lateral_use = trial.memory.curvature = 0.0;
}

// Keep the command of a tick, as on the line; return whether the car is still on it.
bool command_on_line(Line& line, const Limiter& limiter, double max_speed, double period) {
    Trial& trial = line.trial;
    const Slip& slip = limiter.slip;
    const CarParameters& car = limiter.car;
    const double now = trial.speed, spacing = line.spacing;
    const double heading = trial.heading + velocity_angle(slip, car, now, trial.yaw_rate);
    const auto window = line_ahead(line, trial.next, trial.x, trial.y, heading, limiter);
    const std::int64_t point = next_point(window, 1, 0.0, 0.0, 0.0);
    trial.next = (trial.next + point - 1) % line.count;
    const auto [position, aside, turned] = position_on(window, point, spacing);
    if (!(std::abs(aside) < leaves_line)) return false;  // nor is NaN
    const auto [wanted, speed, most] = reference_on(window, position, aside, turned, spacing, limiter, now, true);
    const double angle = arc_angle(slip, car, trial.steering, now);
    trial.memory.curvature = trial.yaw_rate / max(now, start_speed);
    const auto command =
        limited(limiter, trial.memory, {wanted, min(speed, max_speed)}, 1.0, {angle, now}, period, false);
    for (int k = delayed - 1; k > 0; --k)
        trial.commands[k][0] = trial.commands[k - 1][0], trial.commands[k][1] = trial.commands[k - 1][1];
    trial.commands[0][0] = steered(slip, car, command[0], now), trial.commands[0][1] = command[1];
    return true;
}

// Return the lateral force of an axle over the car's mass [m/s^2]; load and drive are over it, too.
double force_of(const Axle& axle, double slip, double load, double drive) {
    if (axle.C == 0.0) return load * saturate(axle.B * slip, axle.D);
    const double used = min(0.5 * std::abs(drive) / (axle.D * max(load, 1e-3)), 0.99);
    return load * std::sqrt(1.0 - used * used) * axle.D * fg::sin(axle.C * fg::atan(axle.B * slip));
}

// Return whether the end of a beam of the first lap lies within the car's outline, or near to it.
bool touches(Trial& trial, const LapMap& lap, Cube<const double> walls, const CarParameters& car) {
    trial.place = std::get<0>(nearest_place(lap, trial.place, trial.x, trial.y, nan));
    const double cos = fg::cos(trial.heading), sin = fg::sin(trial.heading);
    const double half = 0.5 * car.width + clear_of_walls, tail = car.rear_overhang + clear_of_walls;
    const double nose = car.length - car.rear_overhang + clear_of_walls;
    for (int more = -places_behind; more <= places_ahead; ++more) {
        const Matrix ends = walls[(trial.place + more + lap.count) % lap.count];
        for (int beam = 0; beam < lap_beams; ++beam) {
            const double dx = ends[beam][0] - trial.x, dy = ends[beam][1] - trial.y, ahead = cos * dx + sin * dy;
            if (-tail < ahead && ahead < nose && std::abs(cos * dy - sin * dx) < half) return true;  // nor is NaN
        }
    }
    return false;
}

}  // namespace

std::int64_t try_lap(Line& line, const LapMap& lap, Cube<const double> walls, const Limiter& limiter, double max_speed,
                     double period) {
    Trial& trial = line.trial;
    if (!trial.begun) begin_trial(line, limiter);
    for (int tick = 0; tick < ticks_at_once && trial.state == trial_goes_on; ++tick) {
        if (!command_on_line(line, limiter, max_speed, period)) {
            trial.state = trial_fails;
            break;
        }
        for (int step = 0; step < steps_of_a_tick; ++step)
            move_car(trial, limiter, step * period / steps_of_a_tick, period);
        if (touches(trial, lap, walls, limiter.car)) {
            trial.state = trial_fails;
        } else if (trial.way > laps * line.spacing * static_cast<double>(line.count)) {
            trial.state = trial_holds;
        }
    }
    return trial.state;
}

void move_car(Trial& trial, const Limiter& limiter, double since, double period) {
    const CarParameters& car = limiter.car;
    const Slip& slip = limiter.slip;
    const double step = period / steps_of_a_tick;
    const int late = whole(std::ceil((car.command_delay - since) / period - 1e-9));
    const double* const command = trial.commands[min(max(late, 0), delayed - 1)];
    const double turn = saturate((command[0] - trial.steering) / car.steering_time_constant, car.max_steering_rate);
    trial.steering = saturate(trial.steering + turn * step, car.max_steering_angle);
    const double v = max(trial.speed, 0.3), most = car.max_acceleration * min(car.power_limit_speed / v, 1.0);
    const double drive =
        saturate((command[1] - trial.speed) / car.speed_time_constant, most) - drag(car, trial.speed);
    const double lf = car.front_axle_distance, lr = car.rear_axle_distance, b = car.wheelbase;
    const double height = car.center_of_gravity_height;
    const double front_angle = trial.steering - fg::atan2(trial.sideways + lf * trial.yaw_rate, v);
    const double rear_angle = -fg::atan2(trial.sideways - lr * trial.yaw_rate, v);
    const double ahead = v * step / slip.relaxation_length;
    trial.slip[0] = (trial.slip[0] + ahead * front_angle) / (1.0 + ahead);
    trial.slip[1] = (trial.slip[1] + ahead * rear_angle) / (1.0 + ahead);
    const double front = force_of(slip.front, trial.slip[0], (car.gravity * lr - drive * height) / b, drive);
    const double rear = force_of(slip.rear, trial.slip[1], (car.gravity * lf + drive * height) / b, drive);
    const double cos_steering = fg::cos(trial.steering), sin_steering = fg::sin(trial.steering);
    trial.sideways += step * (front * cos_steering + rear - trial.speed * trial.yaw_rate);
    trial.yaw_rate += step * car.mass * (lf * front * cos_steering - lr * rear) / car.yaw_inertia;
    trial.speed += step * (drive - front * sin_steering + trial.sideways * trial.yaw_rate);
    const double aside = trial.sideways - lr * trial.yaw_rate;
    trial.heading += step * trial.yaw_rate;
    const double cos = fg::cos(trial.heading), sin = fg::sin(trial.heading);
    trial.x += step * (trial.speed * cos - aside * sin);
    trial.y += step * (trial.speed * sin + aside * cos);
    trial.way += step * trial.speed;
}

}  // namespace fg
