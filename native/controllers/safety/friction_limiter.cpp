// The friction limiter; the limits 1 to 7 are those of controllers/safety/friction_limiter.py.
#include "friction_limiter.hpp"

#include "../../core/transcendental.hpp"
#include "../control/speed.hpp"
#include "../control/steering.hpp"

namespace fg {
namespace {

constexpr double slowest_growth = 0.7;  // [-] of braking, see 5: slower, and stops get longer than the car sees
constexpr double slow = 0.6;            // [m/s] a faster car brakes as its stops are planned
constexpr double least_stable = 0.2;    // share of braking, whatever the critical speed
constexpr double rolls = 1.0;           // [rad/s] of a wheel: below it rolling takes in proportion to its turning
constexpr double most_held = 4.0;       // [-] acceleration over g that is looked at
constexpr double felt_time = 0.05;      // [s] constant of the filter of what the IMU says
constexpr double twist_length = 8.0;    // [m] share of its load that a wheel loses for a twist of 1 rad/m
constexpr double crawls = 1.0;          // [m/s] a roll rate is over this speed at least
constexpr double least_felt = 0.3, most_cornering = 1.5, most_load = 1.2, most_twisted = 0.8;  // [-] of level ground

// Return a steering angle [rad] with which the path is no tighter than 1 allows, although the car turns in more.
//
// The path has a curvature [1/m] now. Where it is tighter than the arc of the wheels, the rear axle needs a greater
// slip angle than the one in front: that much less of an arc is left to them.
double held_on_path(const Limiter& limiter, double curvature, double target, double angle_now, double now) {
    const CarParameters& car = limiter.car;
    const double more = fg::atan(car.wheelbase * curvature) - angle_now;
    if (!(more * curvature > 0.0 && curvature * target > 0.0)) return target;
    const double most = friction_steering(now, limiter.mu * limiter.settings.lateral_use, car.wheelbase, car.gravity);
    return saturate(target, max(most - std::abs(more), 0.0));
}

// Return the greatest steering angle [rad] for now, which is smaller while the car has to slow down.
//
// The car may have the speed `allowed` [m/s] by the scan and by the reference steering angle, and `speed` by the scan
// alone; it drives at `now`. `least_lateral_use` is the share when it is too fast by `overspeed`.
double steering_limit(const Limiter& limiter, double allowed, double speed, double now, double least_lateral_use) {
    const CarParameters& car = limiter.car;
    const FrictionLimiterSettings& settings = limiter.settings;
    const double too_fast = min(max((now - speed) / settings.overspeed, 0.0), 1.0);
    double use = 1.0 - too_fast * (1.0 - least_lateral_use);
    if (now > allowed) use = min(use, settings.lateral_use_in_braking);
    const double mu = limiter.mu * settings.lateral_use * use;
    return min(friction_steering(now, mu, car.wheelbase, car.gravity), car.max_steering_angle);
}

// Return the greatest steering rate [rad/s] in the direction of `turn` that the front tires can carry; `slope` is the
// tangent of the present steering angle.
double steering_rate(const Limiter& limiter, double slope, double now, double turn) {
    const double cornering = now * now * slope / limiter.car.wheelbase;
    double unused = max(limiter.lateral - std::copysign(cornering, turn * cornering), 0.0);
    unused = min(unused, limiter.settings.most_left * limiter.lateral);
    const double curvature_rate = limiter.settings.turn_in_use * unused / (limiter.yaw_lag * max(now, 1e-3));
    return min(curvature_rate * limiter.car.wheelbase / (1.0 + slope * slope), limiter.car.max_steering_rate);
}

// Return the acceleration [m/s^2] with which to take up `missing_speed` [m/s], after that of the last tick. The slopes
// are the tangents of the steering angle, now and as commanded; `memory.lateral_use` is written to.
double approach(const Limiter& limiter, LimiterMemory& memory, double missing_speed, double slope, double next_slope,
                double speed_now, double period, bool planned) {
    const CarParameters& car = limiter.car;
    const FrictionLimiterSettings& settings = limiter.settings;
    const double growth = period / settings.load_transfer_time, grip = limiter.mu * car.gravity;
    const double reference = missing_speed / settings.speed_response;
    const bool braking = missing_speed < 0.0;
    const double cornering = speed_now * speed_now * slope / car.wheelbase;
    const double turning =
        speed_now * (next_slope - slope) / car.wheelbase / settings.steering_response;  // [1/s^2] v dk/dt
    const double front = cornering + limiter.yaw_lag * turning;  // turning in takes more of the front tires
    double used = max(max(std::abs(cornering), std::abs(speed_now * speed_now * next_slope / car.wheelbase)),
                      std::abs(front));
    double most = limiter.accelerating;
    if (braking) {
        // Turning out takes more of the rear tires: twice as much by the slides measured in braking, in which the rear
        // tires slide first. Accelerating loads them.
        const double rear_lag = car.yaw_inertia / (car.mass * car.front_axle_distance);
        used = max(used, std::abs(cornering - 2.0 * rear_lag * turning));
        most = -limiter.braking;
    }
    used /= grip;
    if (limiter.slip.needs_slip_angle) used = max(used, std::abs(speed_now * speed_now * memory.curvature) / grip);
    if (!planned) {
        double estimate = most * max(1.0 - used, 0.0);
        if (std::abs(reference) < std::abs(estimate)) estimate = reference;
        const double moved =
            std::abs(front + car.rear_axle_distance * estimate * slope / car.wheelbase) / grip;
        if (reference * speed_now >= 0.0 || std::abs(speed_now) < slow)
            used = max(max(used, moved), memory.lateral_use);
        memory.lateral_use = moved;
    }
    double share = longitudinal_share(limiter, used, braking);
    const bool brakes = reference * speed_now < 0.0;
    if (limiter.slip.needs_slip_angle && (car.shaft || !brakes)) {
        const double lateral = min(used, 1.0) * limiter.mu;
        const double held = car.gravity * held_on_arc(limiter.slip, car, fg::atan(slope), lateral, braking, brakes,
                                                      settings.accelerating_use);
        if (brakes)
            share = min(share, held * std::sqrt(max(1.0 - used * used, 0.0)) / std::abs(most));
        else
            most = std::copysign(min(std::abs(most), held), most);
    }
    const double before = memory.acceleration;
    if (braking) {
        if (limiter.slip.needs_slip_angle) share = stable_share(limiter, share, used, std::abs(speed_now));
        const double grown = min(before, 0.0) + most * max(share, slowest_growth) * growth;
        return max(max(reference, min(most * share, -drag(car, speed_now))), grown);
    }
    return min(min(reference, most * share), max(before, 0.0) + most * growth);
}

}  // namespace

void feel_ground(Limiter& limiter, FeltGround& felt, const Odometry& odometry, double period) {
    const double gravity = limiter.car.gravity, speed = odometry.speed, turn = odometry.angular_velocity[2];
    const double share = share_of_way(period, felt_time);
    const auto feel = [share](double& kept, double reading) {
        if (std::isfinite(reading)) kept += share * (reading - kept);
    };
    feel(felt.load, odometry.linear_acceleration[2] / gravity - 1.0);
    feel(felt.bank, (speed * turn - odometry.linear_acceleration[1]) / gravity);
    feel(felt.twist, odometry.angular_velocity[0] / max(std::abs(speed), crawls));
    const auto [mu, lateral, braking, accelerating] = limiter.level;
    const double cornering = 1.0 + felt.load + std::copysign(1.0, turn) * felt.bank / mu;
    const double across = min(max(cornering, least_felt), most_cornering);
    const double along = min(max(1.0 + felt.load, least_felt), most_load) *
                         (1.0 - min(twist_length * std::abs(felt.twist), most_twisted));
    limiter.mu = across * mu, limiter.lateral = across * lateral;
    limiter.braking = along * braking, limiter.accelerating = along * accelerating;
}

void find_held(Matrix axles, double mu, double moved, bool soft, bool shaft, Row<double> found) {
    const Numbers levers = axles[0], pitch = axles[1], peaks = axles[2], forces = axles[3];
    const Numbers locks = axles[4], driven = axles[5];
    for (int index = 0; index < limiter_shares; ++index) {
        const double root = static_cast<double>(index) / (limiter_shares - 1), use = 1.0 - root * root;
        double low = 0.0, high = most_held;
        for (int i = 0; i < 40; ++i) {
            const double middle = 0.5 * (low + high);
            double least = 1.0, together = 0.0, weakest = inf;
            for (int axle = 0; axle < 2; ++axle) {
                const double load = max(levers[axle] + pitch[axle] * middle, 1e-9);
                const double used = use * levers[axle] / load;
                const double inner = min(max(1.0 - moved * used, 0.0) / max(1.0 - locks[axle], 1e-9), 1.0);
                const double across = min(used * mu / peaks[axle], 1.0);
                const double kept = inner * std::sqrt(1.0 - across * across);
                least = min(least, kept);
                together += forces[axle] * load * (soft ? 1.0 : kept);
                if (driven[axle] > 0.0) weakest = min(weakest, (driven[0] + driven[1]) * peaks[axle] * load * kept);
            }
            double held = weakest;
            if (shaft) held = soft ? together * least : together;
            if (middle <= held)
                low = middle;
            else
                high = middle;
        }
        found[index] = low;
    }
}

double stable_share(const Limiter& limiter, double share, double lateral_use, double speed) {
    const double stable = stable_braking(limiter.slip, lateral_use, speed) * limiter.car.gravity / limiter.braking;
    return min(share, max(stable, least_stable * share));
}

std::array<double, 2> limited(const Limiter& limiter, LimiterMemory& memory, std::array<double, 2> reference,
                              double least_lateral_use, std::array<double, 2> present, double period, bool planned) {
    const auto [angle_now, speed_now] = present;
    const CarParameters& car = limiter.car;
    const double now = std::abs(speed_now);
    auto [target, allowed] = held_on_circle(limiter, reference[0], reference[1], now, least_lateral_use);
    if (limiter.slip.needs_slip_angle) target = held_on_path(limiter, memory.curvature, target, angle_now, now);
    const double slope = fg::tan(angle_now);
    const double step = steering_rate(limiter, slope, now, target - angle_now) * limiter.settings.steering_response;
    const double command = angle_now + saturate(target - angle_now, step);
    const double acceleration =
        approach(limiter, memory, allowed - speed_now, slope, fg::tan(command), speed_now, period, planned);
    // The servo's acceleration falls while the command is held: the mean over the period is what was asked for.
    double reached = speed_now + acceleration * period / share_of_way(period, car.speed_time_constant);
    if (!planned) {
        double overcome = car.speed_time_constant * drag(car, speed_now);
        if (allowed <= 0.0) overcome *= min(now / (rolls * car.wheel_radius), 1.0);  // one to stand does not creep on
        reached += overcome;
    }
    if (!std::isfinite(command + reached)) {
        memory.acceleration = memory.lateral_use = 0.0;
        return {0.0, 0.0};
    }
    memory.acceleration = acceleration;
    return {command, reached};
}

std::array<double, 2> held_on_circle(const Limiter& limiter, double steering_angle, double speed, double now,
                                     double least_lateral_use) {
    const CarParameters& car = limiter.car;
    double allowed = speed;
    if (!(speed <= 0.0)) {
        const double mu = limiter.mu * limiter.settings.lateral_use;
        allowed = min(speed, friction_speed(steering_angle, mu, car.wheelbase, car.gravity));
    }
    double limit = steering_limit(limiter, allowed, speed, now, least_lateral_use);
    if (limiter.slip.needs_slip_angle) {
        if (!(speed <= 0.0)) {
            const double angle = saturate(steering_angle, car.max_steering_angle);
            allowed = min(allowed, fastest_on(limiter.slip, angle, limiter.slip.least_speed));
        }
        limit = min(limit, tightest_arc(limiter.slip, now));
    }
    return {saturate(steering_angle, limit), allowed};
}

}  // namespace fg
