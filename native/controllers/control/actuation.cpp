// 1. The friction limiter turns the reference into a command that the tires can follow (friction_limiter).
// 2. The wheels are turned by the slip angles that soft tires need more, and roll faster or slower than the ground.
// 3. The speed is corrected for the error of the odometry, which is measured while driving.
#include "actuation.hpp"

#include "../../core/numbers.hpp"
#include "driving.hpp"
#include "reasons.hpp"
#include "slip.hpp"
#include "speed.hpp"
#include "steering.hpp"

namespace fg {
namespace {

constexpr double least_speed = 1.0;  // [m/s] of a command that is measured by
constexpr double most_use = 0.9;     // of what the motor can do: its limits show above it
constexpr double gain = 0.1;         // of a measurement
constexpr double most_error = 0.15;  // of one

}  // namespace

void read_speedometer(Speedometer& memory, double speed, const CarParameters& car, double period) {
    const double asked = (memory.command * (1.0 + memory.error) - memory.speed) / car.speed_time_constant;
    const double most =
        most_use * car.max_acceleration * min(car.power_limit_speed / max(std::abs(memory.speed), 1e-3), 1.0);
    if (least_speed < memory.command && memory.command < car.max_speed && std::abs(asked) < most &&
        std::isfinite(speed)) {
        const double share = share_of_way(period, car.speed_time_constant);
        const double given =
            memory.speed + (speed - memory.speed) / share + car.speed_time_constant * drag(car, memory.speed);
        memory.error += gain * (saturate(given / memory.command - 1.0, most_error) - memory.error);
    }
    memory.command = 0.0, memory.speed = speed;
}

// Forward, the measured speed stays within 0 and the greatest one until the next command, as it would by the command of
// `speed` itself on a car without an error.
double command_speed(Speedometer& memory, double speed, const CarParameters& car, double max_speed, double period,
                     double alone) {
    double command = speed;
    if (speed > 0.0) {
        const double now = memory.speed, share = share_of_way(period, car.speed_time_constant);
        const double lowest = now - max(now, 0.0) / share, highest = now + max(max_speed - now, 0.0) / share;
        command = speed / (1.0 + memory.error - saturate(memory.error, alone));
        command = max(min(command, max(highest, speed)), min(lowest, speed));
    }
    memory.command = command;
    return command;
}

std::array<double, 2> apply_limits(TickRecord& tick, double steering_angle, double speed, double least_use) {
    return apply_limits_of(tick.driver.limiter, tick, steering_angle, speed, least_use, left_alone);
}

std::array<double, 2> apply_limits_of(const Limiter& limiter, TickRecord& tick, double steering_angle, double speed,
                                      double least_use, double alone) {
    const CarParameters& car = tick.driver.car;
    DrivingMemory& memory = tick.memory;
    const double angle = tick.odometry.steering_angle, now = tick.odometry.speed, period = period_of(tick.geometry);
    const Table<double> reasons = table(memory.reasons);
    log_step(reasons, step_lock, saturate(steering_angle, car.max_steering_angle), speed);
    const auto [target, allowed] = held_on_circle(limiter, steering_angle, speed, std::abs(now), least_use);
    log_step(reasons, step_grip, target, allowed);
    auto [steering, reached] =
        limited(limiter, memory.limiter, {steering_angle, speed}, least_use, {angle, now}, period, false);
    log_step(reasons, step_transients, steering, reached);
    if (limiter.slip.needs_slip_angle) steering = steered(limiter.slip, car, steering, now);
    double command = command_speed(memory.speedometer, reached, car, tick.driver.max_speed, period, alone);
    command += memory.velocity_frame.excess;  // 0 of tires that are not soft
    log_step(reasons, step_speedometer, steering, command);
    return {steering, command};
}

}  // namespace fg
