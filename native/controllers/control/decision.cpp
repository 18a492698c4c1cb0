// From a reference command to a safe one; the order of the steps is that of controllers/control/decision.py.
#include "decision.hpp"

#include <array>
#include <utility>

#include "../../core/numbers.hpp"
#include "../../core/transcendental.hpp"
#include "../perception/frontiers.hpp"
#include "../perception/scan_filters.hpp"
#include "../safety/braking_trajectories.hpp"
#include "../safety/guidance.hpp"
#include "../safety/line_following.hpp"
#include "../safety/plan_in_time.hpp"
#include "../safety/predictions.hpp"
#include "../safety/recovery.hpp"
#include "actuation.hpp"
#include "reasons.hpp"
#include "slip.hpp"
#include "speed.hpp"
#include "steering.hpp"
#include "tracking.hpp"

namespace fg {
namespace {

constexpr double onwards_speed = 3.0;  // [m/s] with which the car may go on among targets where its reference is slower
constexpr std::int64_t most_own = 8;   // motions of stages of the user's that are simulated in a tick
constexpr int columns = motion_curvature + 1;  // of a motion
constexpr double ahead_angle = 2.0 * (pi / 180.0);  // [rad] to either side: beams that count as straight ahead

void command(const Tick& tick, std::array<double, 2> given) { tick.command[0] = given[0], tick.command[1] = given[1]; }

// Return whether there is no reference, or no odometry: the car brakes.
bool sees_no_way(const Tick& tick) {
    return std::isnan(tick.reference.steering_angle) ||
           !std::isfinite(tick.odometry.speed + tick.odometry.steering_angle);
}

// Write the command of a car without a friction limiter that sees no way: it stops.
void stand(const Tick& tick) {
    log_step(table(tick.memory.reasons), step_no_reference, 0.0, 0.0);
    command(tick, {0.0, 0.0});
}

// Return the command of the hardest stop that the tires hold on the present path; without odometry 0 and 0.
std::array<double, 2> brake(TickRecord& tick) {
    const Limiter& limiter = tick.driver.limiter;
    const double angle = tick.odometry.steering_angle;
    log_step(table(tick.memory.reasons), step_no_reference, angle, 0.0);
    const double held = held_arc(limiter.slip, tick.driver.car, angle, tick.memory.limiter.curvature);
    return apply_limits(tick, held, 0.0, limiter.settings.least_lateral_use);
}

// Return whether there is a command: another stage has decided, or the car brakes, as there is no way.
bool is_decided(const Tick& tick) {
    if (tick.record.decided) return true;
    if (!sees_no_way(tick)) return false;
    if (tick.driver.has_limiter)
        command(tick, brake(tick.record));
    else
        stand(tick);
    return true;
}

// Write the reference's steering angle, as far as the wheels can be turned, and a speed [m/s] as the command.
void steer(const Tick& tick, double speed) {
    const double angle = saturate(tick.reference.steering_angle, tick.driver.car.max_steering_angle);
    command(tick, {angle, speed});
    log_step(table(tick.memory.reasons), step_lock, angle, speed);
}

// Write the command that follows the reference at a speed [m/s], as far as the car has a friction limiter.
void follow(const Tick& tick, double speed) {
    if (!tick.driver.has_limiter) {
        steer(tick, speed);
        return;
    }
    const double least = tick.driver.limiter.settings.least_lateral_use;
    command(tick, apply_limits(tick.record, tick.reference.steering_angle, speed, least));
}

// Return the speed [m/s] by the law of the distance straight ahead; inf where the scan does not look ahead.
double speed_by_what_is_ahead(const ScanGeometry& geometry, Numbers ranges, const Driver& driver) {
    const auto [first, end] = beams_between(geometry, ranges.length, -ahead_angle, ahead_angle);
    double ahead = inf;
    for (std::int64_t beam = first; beam < end; ++beam) ahead = min(ahead, ranges[beam]);
    const DrivingSettings& settings = driver.settings;
    return distance_ahead_speed(ahead, settings.safe_distance, settings.full_speed_distance, driver.max_speed);
}

// Return the reference's speed [m/s] by the laws of the distance ahead and of friction, as far as they apply.
double by_laws(const Tick& tick) {
    const Driver& driver = tick.driver;
    const Reference& reference = tick.reference;
    const Table<double> reasons = table(tick.memory.reasons);
    double speed = min(reference.speed, reference.limit);
    if (driver.distance_ahead) {
        speed = min(speed, speed_by_what_is_ahead(tick.geometry, tick.ranges, driver));
        log_step(reasons, step_ahead, reference.steering_angle, speed);
    }
    if (driver.friction_law) {
        const CarParameters& car = driver.car;
        const double steering = saturate(reference.steering_angle, car.max_steering_angle);
        speed = min(speed, friction_speed(steering, driver.limiter.mu, car.wheelbase, car.gravity));
        log_step(reasons, step_law, steering, speed);
    }
    return speed;
}

// Return the speed [m/s] from which the car stops within what it sees.
double speed_in_sight(const Tick& tick, Numbers widened) {
    const ScanGeometry& geometry = tick.geometry;
    const Odometry& odometry = tick.odometry;
    return safe_speed(tick.trajectories, widened, geometry.angle_min, geometry.angle_increment, odometry.speed,
                      odometry.steering_angle);
}

// Write the command of the best proposal.
void actuate(const Tick& tick, std::int64_t step, const Best& best) {
    log_step(table(tick.memory.reasons), step, best.steering_angle, best.speed);
    command(tick, apply_limits(tick.record, best.steering_angle, best.speed, best.use));
}

// Write how the car reverses along its path, if it does; `found`: there is a proposal that meets nothing.
bool recovers(const Situation& here, const Tick& tick, bool found, Best& best) {
    const Driver& driver = tick.driver;
    DrivingMemory& memory = tick.memory;
    const bool stands = std::abs(here.speed) < here.settings.standing_speed;
    const bool waits = memory.predictions.count > 0 || !memory.guidance.frontier.found;
    const bool leads_on = found && memory.lead != Lead::by_nobody;
    const RecoverySettings& settings = driver.recovery_settings;
    const LocalMap& world = memory.guidance.frontier.map;
    const double back = angle_back(world, settings, driver.car);
    Recovery& recovery = memory.recovery;
    if (!reverses(recovery, settings, world, here.speed, stands, leads_on, waits, here.period) || std::isnan(back)) {
        recovery.back = 0.0;
        return false;
    }
    best.steering_angle = back, best.speed = -settings.speed;
    return true;
}

// Write what the plan in time drives, or how it backs off; return whether it does either.
bool plans_in_time(const Situation& here, const Tick& tick, double speed, Best& best) {
    const Driver& driver = tick.driver;
    DrivingMemory& memory = tick.memory;
    const double now = here.speed;
    const auto& seen = memory.predictions.targets;
    const double back = angle_back(memory.guidance.frontier.map, driver.recovery_settings, driver.car);
    const double turn = driver.limiter.slip.needs_slip_angle ? memory.velocity_frame.angle : 0.0;
    const bool may_back_off = driver.recovery && std::abs(now) < 1.2 && now < 0.3 && !std::isnan(back);
    const double onwards = max(speed, min(onwards_speed, driver.max_speed));
    const auto [what, angle, planned] =
        plan_in_time(here, memory.plan, {seen.x, seen.y, seen.heading + turn},
                     {tick.reference.bearing, tick.reference.distance}, onwards, may_back_off);
    memory.judge.passed = false, best.use = 1.0;
    if (what == plan_backs_off) {
        memory.recovery.stood = 0.0;
        best.steering_angle = back, best.speed = -backing_speed;
    } else if (what == plan_drives) {
        memory.recovery.back = 0.0;  // an attempt to reverse is over
        best.steering_angle = angle, best.speed = planned;
    }
    return what == plan_drives || what == plan_backs_off;
}

// Return why a motion is left out, as in `reasons`; -1: it is not.
std::int64_t fault_in(const Tick& tick, Matrix path, double speed) {
    const Odometry& odometry = tick.odometry;
    const CarParameters& car = tick.driver.car;
    if (!(tick.driver.safety_filter && sees(tick.geometry, tick.ranges))) return fault_no_judge;
    if (!std::isfinite(odometry.speed + odometry.steering_angle)) return fault_no_judge;
    if (tick.record.decided) return fault_decided;
    if (tick.memory.judge.own >= most_own) return fault_too_many;
    if (path.rows == 0 || path.columns != columns) return fault_no_points;
    if (!std::isfinite(speed)) return fault_not_finite;
    double sharpest = 0.0;
    for (std::int64_t k = 0; k < path.rows; ++k) {
        const Numbers point = path[k];
        for (int column = 0; column < columns; ++column)
            if (!std::isfinite(point[column])) return fault_not_finite;
        sharpest = max(sharpest, std::abs(point[motion_curvature]));
    }
    if (speed < 0.0) return fault_reverses;
    const double most = 1.001 * fg::tan(car.max_steering_angle) / car.wheelbase;
    return sharpest > most ? static_cast<std::int64_t>(fault_too_sharp) : -1;
}

// Return the part of the first rows of a matrix.
Matrix first_rows(Matrix from, std::int64_t count) { return {from.data, min(count, from.rows), from.columns}; }

}  // namespace

void predict(const Tick& tick) {
    foresee(tick.geometry, tick.ranges, tick.ranges_without_movers, tick.odometry, tick.driver,
            tick.memory.predictions);
}

void feel_ground(const Tick& tick, FeltGround& felt) {
    feel_ground(tick.driver.limiter, felt, tick.odometry, period_of(tick.geometry));
}

void begin(const Tick& tick) {
    const Driver& driver = tick.driver;
    Reference& reference = tick.reference;
    DrivingMemory& memory = tick.memory;
    const Slip& slip = driver.limiter.slip;
    const Table<double> reasons = table(memory.reasons);
    VelocityFrame& frame = memory.velocity_frame;
    forget_reasons(reasons, table(memory.judge.proposals));
    memory.judge.line.contact = inf, memory.judge.own = 0;
    if (slip.needs_slip_angle) {
        double last = memory.speedometer.command * (1.0 + memory.speedometer.error);
        last += last != 0.0 ? frame.excess : 0.0;
        memory.limiter.curvature = to_velocity_frame(slip, driver.car, tick.geometry, tick.odometry, last, frame);
        tick.record.geometry = frame.geometry, tick.record.odometry = frame.odometry;
        reference.bearing -= frame.angle;
    }
    log_step(reasons, step_maximum, nan, driver.max_speed);
    log_step(reasons, step_planner, reference.steering_angle, reference.own_speed);
    if (reference.plan > 0) {
        const std::int64_t step = reference.plan == 1 ? step_last_plan : step_no_plan;
        log_step(reasons, step, reference.steering_angle, reference.own_speed);
    }
    if (driver.mean_range) log_step(reasons, step_mean_range, reference.steering_angle, reference.speed);
    if (driver.has_limiter)
        read_speedometer(memory.speedometer, tick.odometry.speed, driver.car, period_of(tick.geometry));
    if (driver.recovery && !driver.guidance && sees(tick.geometry, tick.ranges))  // guidance keeps the path itself
        only_move(tick.geometry, tick.ranges, tick.odometry, memory.guidance.frontier);
}

void guide_reference(const Tick& tick) {
    const Driver& driver = tick.driver;
    Reference& reference = tick.reference;
    DrivingMemory& memory = tick.memory;
    if (memory.predictions.count > 0) memory.guidance.turning.slow = 0.0;  // what is in the way moves on
    const Numbers ranges = tick.ranges_without_cars;
    if (memory.judge.best.why == proposal_on_line && memory.predictions.count == 0) {
        only_move(tick.geometry, ranges, tick.odometry, memory.guidance.frontier);
        memory.lead = Lead::by_planner, memory.knows_speed = false, memory.guidance.follows = false;
        return;
    }
    const Seen seen{tick.geometry, ranges, tick.odometry, driver.limiter, driver.guidance_settings, reference};
    const Lead lead = follow_frontier(seen, memory.guidance);
    memory.lead = lead.who, memory.knows_speed = lead.knows_speed;
    const bool on_lane = reference.lane_points > 0;
    if (lead.who == Lead::by_planner && !on_lane) {
        reference.speed = min(reference.speed, lead.speed);
    } else if (lead.who != Lead::by_turn && !on_lane) {
        reference.steering_angle = lead.steering_angle, reference.speed = lead.speed;
        reference.bearing = lead.bearing, reference.distance = lead.distance;
    }
    log_step(table(memory.reasons), step_guidance, reference.steering_angle, reference.speed);
    if (lead.who == Lead::by_turn && !on_lane) {
        log_step(table(memory.reasons), step_moves, lead.steering_angle, lead.speed);
        const double least = driver.limiter.settings.least_lateral_use;
        command(tick, apply_limits(tick.record, lead.steering_angle, lead.speed, least));
        tick.record.decided = true;
    }
}

void drive(const Tick& tick) {
    if (tick.record.decided) return;
    if (sees_no_way(tick))
        stand(tick);
    else
        steer(tick, by_laws(tick));
}

void drive_held(const Tick& tick) {
    if (!is_decided(tick)) follow(tick, by_laws(tick));
}

void drive_in_sight(const Tick& tick) {
    if (is_decided(tick)) return;
    const OwnRow<double> widened = widen_all(tick.ranges, tick.geometry.angle_increment, tick.trajectories.radius);
    const double speed = min(by_laws(tick), speed_in_sight(tick, widened));
    log_step(table(tick.memory.reasons), step_sight, tick.reference.steering_angle, speed);
    follow(tick, speed);
}

void drive_filtered(const Tick& tick) {
    if (is_decided(tick)) return;
    const Driver& driver = tick.driver;
    DrivingMemory& memory = tick.memory;
    Guidance& guidance = memory.guidance;
    const Reference& reference = tick.reference;
    const Table<double> reasons = table(memory.reasons);
    double speed = by_laws(tick);
    const double steering = saturate(reference.steering_angle, driver.car.max_steering_angle);
    const Surroundings seen = look_round(tick, false);
    if (memory.recovery.tried > 0) {
        speed = min(speed, driver.recovery_settings.speed);
        log_step(reasons, step_after_recovery, steering, speed);
    }
    const bool on_lane = reference.lane_points > 0, guided = !on_lane && memory.lead == Lead::by_motion;
    const OwnTable<double> led = path_ahead(guidance);
    const Matrix path = on_lane ? first_rows(table(reference.lane), reference.lane_points) : Matrix(led);
    const double in_sight = speed_in_sight(tick, seen.widened);
    if (on_lane || !memory.knows_speed) {
        speed = min(speed, max(in_sight, driver.judge_settings.crawl_speed));
        log_step(reasons, step_sight, steering, speed);
    }
    Best& best = memory.judge.best;
    const bool among = memory.predictions.cars == 0 && is_among(seen.here.movers);
    if (among) {
        if (plans_in_time(seen, tick, speed, best)) {
            actuate(tick, step_plan_in_time, best);
            return;
        }
        speed = 0.0;
    }
    const Situation here = among ? without_movers(seen) : seen.here;
    const OwnTable<double> last_stop = stop_ahead(guidance);
    judge(here, {steering, speed, path, guided, last_stop, memory.judge.passed}, memory.judge);
    const bool found = best.contact == 0.0;
    if (!found && memory.judge.line.contact < inf) take(best, memory.judge.line);
    memory.judge.passed = found && best.why <= proposal_stop;
    if (found && best.why == proposal_reference && guided) keep_stop(guidance);
    if (driver.recovery && recovers(here, tick, found, best)) {
        actuate(tick, step_recovery, best);
        return;
    }
    if (!found && best.why != proposal_on_line) {
        const bool slow = here.speed <= here.settings.crawl_speed && here.movers.rows == 0;
        best.speed = slow ? min(speed, in_sight) : 0.0;
    }
    if (best.why == proposal_reference || best.why == proposal_stop || best.why == proposal_motion)
        best.steering_angle = reference.steering_angle;  // beyond the lock, the limiter slows the car for it
    if (best.why == proposal_on_line)
        drive_line(tick, best);
    else
        actuate(tick, step_safety_filter, best);
}

bool propose(const Tick& tick, Matrix path, double speed) {
    DrivingMemory& memory = tick.memory;
    const std::int64_t fault = fault_in(tick, path, speed);
    if (fault >= 0) {
        log_left_out(table(memory.judge.proposals), fault);
        return false;
    }
    ++memory.judge.own;
    speed = min(min(speed, tick.reference.limit), tick.driver.max_speed);
    if (!judge_own(look_round(tick, false), path, speed, memory.judge)) return false;
    actuate(tick, step_safety_filter, memory.judge.best);
    tick.record.decided = true;
    return true;
}

Surroundings look_round(const Tick& tick, bool known) {
    const Driver& driver = tick.driver;
    DrivingMemory& memory = tick.memory;
    const double angle = driver.limiter.slip.needs_slip_angle ? memory.velocity_frame.angle : 0.0;
    OwnTable<double> movers = turned(memory.predictions, angle);
    const Matrix moving = movers;
    const Numbers ranges = moving.rows > 0 ? tick.ranges_without_movers : tick.ranges;
    const double radius = tick.trajectories.radius;
    OwnRow<double> widened = widen_all(ranges, tick.geometry.angle_increment, radius);
    const Numbers wide = widened;
    return {std::move(movers),
            std::move(widened),
            {driver.limiter, memory.limiter, driver.judge_settings, tick.geometry, ranges, wide, radius, moving,
             memory.guidance.frontier, tick.odometry.steering_angle, tick.odometry.speed, period_of(tick.geometry),
             known}};
}

void drive_line(const Tick& tick, const Best& best) {
    Limiter& limiter = tick.driver.limiter;
    FrictionLimiterSettings& settings = limiter.settings;
    const double turn_in_use = settings.turn_in_use, in_braking = settings.lateral_use_in_braking;
    const auto [faster, braking] = on_line(limiter);
    settings.turn_in_use = faster, settings.lateral_use_in_braking = braking;
    command(tick, apply_limits_of(limiter, tick.record, best.steering_angle, best.speed, best.use, 0.0));
    settings.turn_in_use = turn_in_use, settings.lateral_use_in_braking = in_braking;
}

}  // namespace fg
