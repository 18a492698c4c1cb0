// Guidance: who leads the car on in a tick, and the speeds of motions.
#include "guidance.hpp"

#include <cmath>
#include <cstring>

#include "../../core/numbers.hpp"
#include "../../core/transcendental.hpp"
#include "../control/driving.hpp"
#include "../control/slip.hpp"
#include "../control/steering.hpp"
#include "../control/tracking.hpp"

namespace fg {
namespace {

constexpr int beams_apart = 16;         // every so many are compared with the planner's goal
constexpr double bends = 0.37;          // of the curvature at full lock: the planner's goal alone does not end a motion
constexpr double bends_sharply = 0.75;  // the same: its simulated reference does not end one of a careful car
constexpr std::int64_t nodes = 2000;    // of a search while the car drives
constexpr double ahead = 15.0 * (pi / 180.0);  // [rad] to either side: what a car without a frontier stops ahead of
constexpr double as_before = 0.1;              // [rad] by which a planner's reference has turned since the last look
constexpr double on_motion_aside = 0.15, on_motion_turned = 0.4;  // [m] and [rad], within which a car is on a motion

// Where the LiDAR is, and how the way to go changes around it.
struct Place {
    double x, y;     // [m]
    double to_go;    // [m]
    double gain;     // [m] by which the best beam shortens the way to go
    double reach;    // [m] along that beam
    double bearing;  // [rad] of that beam
};

// Where a point is that the car is led to.
struct Steering {
    double steering_angle;     // [rad]
    double bearing, distance;  // [rad], [m] of a point
};

// The points of a motion.
Matrix points_of(const Motion& motion) { return {&motion.points[0][0], motion.count, motion_direction + 1}; }

// Write the points of a motion to another.
void copy_points(const Motion& from, Motion& to) {
    to.count = from.count;
    std::memcpy(to.points, from.points, sizeof(to.points));
}

// Return that the planner leads on, no faster than a speed [m/s].
Lead planner_leads(double speed, bool knows_speed) { return {Lead::by_planner, nan, nan, nan, speed, knows_speed}; }

// Return whether the planner led on in the tick before by this reference.
bool leads_on_as_before(const Guidance& memory, const Reference& reference) {
    const FrontierSearch& frontier = memory.frontier;
    const double turned =
        std::abs(reference.steering_angle - memory.steering_angle) + std::abs(reference.bearing - memory.bearing);
    return frontier.ticks == memory.led_on + 1 && frontier.searched != frontier.ticks && turned < as_before;
}

// Return the speed [m/s] from which the car slows in time for a motion's curves, and stops at its end.
double speed_on(const Seen& seen, const Guidance& memory, const Motion& motion, std::int64_t first) {
    const Limiter& limiter = seen.limiter;
    const GuidanceSettings& settings = seen.settings;
    const double speed = seen.odometry.speed, lateral = settings.profile_grip * limiter.lateral;
    const double braking = settings.profile_braking * limiter.braking;
    double square = inf, along = 0.0, tightest = 0.0, x = memory.frontier.map.x, y = memory.frontier.map.y;
    for (std::int64_t k = first; k < motion.count; ++k) {
        const auto& point = motion.points[k];
        const double curvature = std::abs(point[motion_curvature]);
        if (curvature > 0.0) {
            double there = lateral / curvature;
            if (limiter.slip.needs_slip_angle && curvature > tightest) {
                const double arc = fg::atan(curvature * limiter.car.wheelbase);
                const double fastest = fastest_on(limiter.slip, arc, settings.narrow_speed);
                there = min(there, fastest * fastest);
                tightest = curvature;
            }
            square = min(square, there + 2.0 * braking * max(along - 0.15 * speed, 0.0));
        }
        along += fg::hypot(point[motion_x] - x, point[motion_y] - y);
        x = point[motion_x];
        y = point[motion_y];
    }
    square = min(square, 2.0 * settings.stop_braking * limiter.braking * (along + 0.3));
    return memory.narrow ? min(std::sqrt(square), settings.narrow_speed) : std::sqrt(square);
}

// Return the speed [m/s] from which the car can turn at full lock behind a hidden frontier; inf: it is not hidden.
double speed_around_edge(const Seen& seen, const FrontierSearch& frontier, double x, double y) {
    const Limiter& limiter = seen.limiter;
    const GuidanceSettings& settings = seen.settings;
    if (!frontier.hidden) return inf;
    const double away = fg::hypot(frontier.x - x, frontier.y - y);
    const double tightest = fg::tan(lock_arc(limiter.slip, limiter.car)) / limiter.car.wheelbase;
    const double turning = settings.grip * limiter.lateral / tightest;
    return std::sqrt(turning + 2.0 * settings.hidden_braking * limiter.braking * away);
}

// Return the speed [m/s] of a car whose way to go is not known, and forget its path once it has stood for long.
double speed_without_frontier(const Seen& seen, Guidance& memory) {
    const GuidanceSettings& settings = seen.settings;
    memory.lost = memory.frontier.found ? 0 : memory.lost + 1;
    const bool stops = memory.lost > settings.lost_after;
    if (memory.lost > settings.start_again_after && std::abs(seen.odometry.speed) < 0.1) {
        memory.lost = 0;
        forget(memory.frontier.map);  // the path or the map may be wrong
    }
    return stops ? speed_to_stop(seen.geometry, seen.ranges, seen.limiter, settings) : inf;
}

// Return the place of the LiDAR [m], whose way to go is known, with the beam that shortens it most.
Place look_around(const Seen& seen, const FrontierSearch& frontier, double x, double y, double to_go) {
    const ScanGeometry& geometry = seen.geometry;
    const double turn = geometry.angle_increment * beams_apart, first = frontier.map.heading + geometry.angle_min;
    const double turn_cos = fg::cos(turn), turn_sin = fg::sin(turn);
    double gain = -inf, at = 0.0, cos = fg::cos(first), sin = fg::sin(first);
    int best = 0;
    for (int beam = 0; beam < seen.ranges.size(); beam += beams_apart) {
        const auto [least, reach] = least_distance_towards(frontier, x, y, cos, sin, seen.ranges[beam]);
        if (to_go - least > gain) {
            gain = to_go - least;
            at = reach;
            best = beam;
        }
        const double before = cos;
        cos = cos * turn_cos - sin * turn_sin;
        sin = sin * turn_cos + before * turn_sin;
    }
    return {x, y, to_go, gain, at, bearing_of(geometry, best)};
}

// Return the greatest curvature of what is left of the motion, as a share of that at full lock.
//
// NaN: there is no motion, it is not free, or the car is not on it.
double bend_ahead(Guidance& memory, const CarParameters& car) {
    const LocalMap& world = memory.frontier.map;
    const Motion& motion = memory.motion;
    if (!memory.follows) return nan;
    memory.progress = next_point(points_of(motion), memory.progress, world.x, world.y, world.heading);
    const auto [along, aside, angle] =
        errors(table(motion.points)[memory.progress], world.x, world.y, world.heading);
    if (memory.progress + 2 >= motion.count || std::abs(aside) > on_motion_aside || std::abs(angle) > on_motion_turned)
        return nan;
    double most = 0.0;
    for (std::int64_t k = memory.progress; k < motion.count; ++k) {
        const auto& point = motion.points[k];
        const double cos = fg::cos(point[motion_heading]), sin = fg::sin(point[motion_heading]);
        if (!is_clear(memory.frontier, car, point[motion_x], point[motion_y], cos, sin, wall_in_1)) return nan;
        most = max(most, std::abs(point[motion_curvature]));
    }
    return most * car.wheelbase / fg::tan(car.max_steering_angle);
}

// Return whether the planner's own reference leads on, and write the speed that a simulated motion gave.
//
// `bend`: see `bend_ahead`; `tight`: the frontier is hidden and nearby; `most`: speed that is allowed [m/s].
bool planner_leads_on(const Seen& seen, Guidance& memory, const Place& place, double bend, bool tight, double most) {
    const ScanGeometry& geometry = seen.geometry;
    const Reference& reference = seen.reference;
    const Limiter& limiter = seen.limiter;
    const GuidanceSettings& settings = seen.settings;
    memory.speed = inf;
    if (std::isnan(reference.bearing) || std::isnan(reference.steering_angle)) return false;
    FrontierSearch& frontier = memory.frontier;
    const CarParameters& car = limiter.car;
    const double speed = seen.odometry.speed;
    const double aim = std::rint((reference.bearing - geometry.angle_min) / geometry.angle_increment);
    const std::int64_t beam = min(max(floored(aim), std::int64_t{0}), seen.ranges.length - 1);
    const double heading = frontier.map.heading + reference.bearing;
    const double least = least_distance_towards(frontier, place.x, place.y, fg::cos(heading), fg::sin(heading),
                                                seen.ranges[beam])[0];
    const double gain = place.to_go - least;
    if (gain >= settings.as_good * place.gain && gain > -0.5 && !(bend > bends || tight)) return true;
    if ((memory.careful && bend > bends_sharply) || !(gain > settings.worth_simulating * place.gain)) return false;
    const double curved = 0.8 * limiter.lateral / max(speed * speed, 0.5);
    const double present = fg::tan(seen.odometry.steering_angle) / car.wheelbase;
    const double arc = saturate(reference.steering_angle, car.max_steering_angle);
    const double wanted = saturate(fg::tan(arc) / car.wheelbase, curved);
    memory.narrow = false;
    // Else it drives into walls that are not marked.
    look_again(geometry, seen.ranges, car.lidar_offset, frontier, settings.every);
    const Query query{0.5 * (present + wanted), speed, settings.viable_time, 1.0, most_lock,
                      settings.horizon + 0.1 * speed * speed, wall_in_2, false, nodes};
    if (!search_motion(frontier, limiter, memory.trial, query)) return false;
    if (speed < settings.trusted_speed)
        memory.speed = min(speed_on(seen, memory, memory.trial, 0), min(reference.speed, most));
    return true;
}

// Search for a motion in every second tick, or in each while the car has none; return whether one was found.
bool renew_motion(const Seen& seen, Guidance& memory) {
    if (memory.follows && memory.frontier.ticks % 2 == 1) return false;
    const Limiter& limiter = seen.limiter;
    const GuidanceSettings& settings = seen.settings;
    const double speed = seen.odometry.speed, lag = steering_lag + late_by(limiter.car);
    const double present = fg::tan(seen.odometry.steering_angle) / limiter.car.wheelbase;
    const double horizon = settings.horizon + 0.1 * speed * speed;
    bool narrow = false;
    Query query{present, speed, lag, settings.grip, settings.lock, horizon, wall_in_2, false, nodes};
    bool found = search_motion(memory.frontier, limiter, memory.trial, query);
    if (!found) {
        query.grip = 1.0;
        query.lock = most_lock;
        found = search_motion(memory.frontier, limiter, memory.trial, query);
    }
    if (!found && speed < 2.0) {
        query.horizon = 2.0;
        query.nearest = wall_in_1;
        found = narrow = search_motion(memory.frontier, limiter, memory.trial, query);
    }
    if (found) {
        copy_points(memory.trial, memory.motion);
        memory.follows = true;
        memory.progress = 0;
        memory.narrow = narrow;
    }
    return found;
}

// Return the steering angle that keeps the car on a motion, and where a point of it is from the rear axle.
Steering steer(const Seen& seen, const LocalMap& world, const Motion& motion, std::int64_t first) {
    const CarParameters& car = seen.limiter.car;
    const double speed = seen.odometry.speed;
    const double steering_angle =
        steer_along(points_of(motion), first, {world.x, world.y, world.heading}, speed, car.wheelbase, late_by(car),
                    late_on_path(seen.limiter.slip, car, speed));
    const auto& point = motion.points[first];
    const double dx = point[motion_x] - world.x, dy = point[motion_y] - world.y;
    const double cos = fg::cos(world.heading), sin = fg::sin(world.heading);
    return {steering_angle, fg::atan2(cos * dy - sin * dx, cos * dx + sin * dy), fg::hypot(dx, dy)};
}

// Return what keeps the car on a motion, which is searched for anew; or that there is none, and it brakes.
//
// `bend` as of `planner_leads_on`; `around_edge`: speed from which the car can turn behind a hidden frontier [m/s].
Lead follow_motion(const Seen& seen, Guidance& memory, const Place& place, double bend, double around_edge) {
    const LocalMap& world = memory.frontier.map;
    look_again(seen.geometry, seen.ranges, seen.limiter.car.lidar_offset, memory.frontier, seen.settings.every);
    if (!renew_motion(seen, memory)) memory.follows = !std::isnan(bend);
    if (memory.follows) {
        const auto [steering_angle, bearing, distance] = steer(seen, world, memory.motion, memory.progress);
        const double speed = min(speed_on(seen, memory, memory.motion, memory.progress), around_edge);
        return {Lead::by_motion, steering_angle, bearing, distance, speed, true};
    }
    if (memory.trial.count > 0) {
        const auto [steering_angle, bearing, distance] = steer(seen, world, memory.trial, 0);
        return {Lead::by_nobody, steering_angle, bearing, distance, 0.0, false};
    }
    return {Lead::by_nobody, seen.odometry.steering_angle, place.bearing, place.reach, 0.0, false};
}

// Return the points (m, 4) of a motion from a place on; no points if there is only one left.
OwnTable<double> in_frame_of_car(const LocalMap& world, const Motion& motion, std::int64_t first) {
    OwnTable<double> path(first + 1 >= motion.count ? 0 : motion.count - first, motion_curvature + 1);
    const double cos = fg::cos(world.heading), sin = fg::sin(world.heading);
    for (std::int64_t k = 0; k < Matrix(path).rows; ++k) {
        const auto& point = motion.points[first + k];
        const double dx = point[motion_x] - world.x, dy = point[motion_y] - world.y;
        path[k][motion_x] = cos * dx + sin * dy;
        path[k][motion_y] = cos * dy - sin * dx;
        path[k][motion_heading] = point[motion_heading] - world.heading;
        path[k][motion_curvature] = point[motion_curvature];
    }
    return path;
}

}  // namespace

Lead follow_frontier(const Seen& seen, Guidance& memory) {
    const ScanGeometry& geometry = seen.geometry;
    const Odometry& odometry = seen.odometry;
    const GuidanceSettings& settings = seen.settings;
    FrontierSearch& frontier = memory.frontier;
    Turning& turning = memory.turning;
    const double speed = odometry.speed, yaw_rate = odometry.angular_velocity[2], period = period_of(geometry);
    const bool looks = sees(geometry, seen.ranges) && looks_ahead(geometry, seen.ranges.length);
    if (!looks) move(frontier.map, speed, yaw_rate, period);
    if (!(looks && std::isfinite(speed + fg::tan(odometry.steering_angle) + yaw_rate))) {
        memory.follows = turning.active = false;
        return planner_leads(inf, false);
    }
    const bool led = memory.follows || turning.active || memory.careful;
    const double offset = seen.limiter.car.lidar_offset;
    search_frontier(geometry, seen.ranges, odometry, offset, frontier, settings.every, settings.every_plain, led);
    turn_in_moves(frontier, seen.limiter, turning, odometry.steering_angle, speed, period);
    if (turning.active) {
        memory.careful = true;
        return {Lead::by_turn, turning.steering_angle, nan, nan, turning.speed, false};
    }
    const double x = frontier.map.x + offset * fg::cos(frontier.map.heading);
    const double y = frontier.map.y + offset * fg::sin(frontier.map.heading);
    const double to_go = frontier.found ? distance_to_goal_around(frontier, x, y) : inf;
    if (!std::isfinite(to_go)) {
        memory.follows = false;
        return planner_leads(speed_without_frontier(seen, memory), false);
    }
    memory.lost = 0;
    const double around_edge = speed_around_edge(seen, frontier, x, y);
    const double most = memory.careful ? around_edge : inf;
    const bool tight = frontier.hidden && to_go < settings.tight_distance;
    if (!tight && leads_on_as_before(memory, seen.reference))
        return planner_leads(min(most, memory.speed), std::isfinite(memory.speed));
    const Place place = look_around(seen, frontier, x, y, to_go);
    const double bend = bend_ahead(memory, seen.limiter.car);
    if (planner_leads_on(seen, memory, place, bend, tight, most)) {
        memory.follows = false;
        memory.led_on = frontier.ticks;
        memory.bearing = seen.reference.bearing;
        memory.steering_angle = seen.reference.steering_angle;
        return planner_leads(min(most, memory.speed), std::isfinite(memory.speed));
    }
    return follow_motion(seen, memory, place, bend, around_edge);
}

OwnTable<double> path_ahead(const Guidance& memory) {
    if (!memory.follows) return {0, motion_curvature + 1};
    return in_frame_of_car(memory.frontier.map, memory.motion, memory.progress);
}

void keep_stop(Guidance& memory) {
    copy_points(memory.motion, memory.stop);
    memory.stop_progress = memory.progress;
}

OwnTable<double> stop_ahead(Guidance& memory) {
    const LocalMap& world = memory.frontier.map;
    if (memory.stop.count > 0)
        memory.stop_progress =
            next_point(points_of(memory.stop), memory.stop_progress, world.x, world.y, world.heading);
    return in_frame_of_car(world, memory.stop, memory.stop_progress);
}

double speed_to_stop(const ScanGeometry& geometry, Numbers ranges, const Limiter& limiter,
                     const GuidanceSettings& settings) {
    const auto [first, behind] = beams_between(geometry, ranges.length, -ahead, ahead);
    double free = sight;
    for (std::int64_t beam = first; beam < behind; ++beam) free = min(free, ranges[beam]);
    const double to_bumper = limiter.car.length - limiter.car.rear_overhang - limiter.car.lidar_offset;
    const double room = max(free - to_bumper - settings.stop_margin, 0.0);
    return std::sqrt(2.0 * settings.profile_braking * limiter.braking * room);
}

}  // namespace fg
