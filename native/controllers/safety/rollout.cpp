// One simulation of the car along a proposal: the car steers and brakes as the friction limiter lets it, and one of its
// discs may come near something on the way.
#include "rollout.hpp"

#include "../../core/transcendental.hpp"
#include "../control/slip.hpp"
#include "../control/speed.hpp"
#include "../control/steering.hpp"
#include "../control/tracking.hpp"
#include "judge.hpp"
#include "predictions.hpp"

namespace fg {
namespace {

constexpr int fine_ticks = 8;    // later ones are simulated two at a time
constexpr int most_ticks = 64;   // of the longest stop: 3 s
constexpr int beams_aside = 16;  // to each side of a disc on known ground, that are looked at
constexpr double longer = 1.02;  // [-] way of a stop over that of wheels that do not slip; tires that brake do

// Where the rear axle of the simulated car is, in the frame of the rear axle now.
struct Place {
    double x = 0.0, y = 0.0, heading = 0.0;  // [m], [rad]
    double cos = 1.0, sin = 0.0;             // of the heading
};

// How the car is steered along a plan.
class Follower {
public:
    Follower(const Situation& here, const Plan& plan)
        : here_(here),
          plan_(plan),
          late_(late_by(here.limiter.car)),
          goal_x_(here.limiter.car.lidar_offset + plan.distance * fg::cos(plan.bearing)),
          goal_y_(plan.distance * fg::sin(plan.bearing)) {}

    // Return the steering angle [rad] along the plan from a place.
    double steer(const Place& at, double angle, double speed) {
        const CarParameters& car = here_.limiter.car;
        if (plan_.path.rows > 0) {
            next_ = next_point(plan_.path, next_, at.x, at.y, at.heading);
            return steer_along(plan_.path, next_, {at.x, at.y, at.heading}, speed, car.wheelbase, late_,
                               late_on_path(here_.limiter.slip, car, speed));
        }
        const double lidar = car.lidar_offset, dx = goal_x_ - at.x, dy = goal_y_ - at.y;
        const double ahead = at.cos * dx + at.sin * dy - lidar, left = at.cos * dy - at.sin * dx;
        const double distance = std::sqrt(ahead * ahead + left * left);
        if (distance <= here_.settings.arrived) return angle;
        const double lag = path_lag(here_.limiter.slip, speed);
        const double nearer = min(1.0, (here_.settings.pursuit_distance + lag) / distance);
        return arc_through(lidar + nearer * ahead, nearer * left, car.wheelbase);
    }

    // Whether the path says how fast the car goes on.
    bool goes_on() const { return plan_.path.columns > motion_speed; }

    // Whether the car is on the last arc of the path.
    bool is_at_end() const { return next_ + 1 == plan_.path.rows; }

    // The speed [m/s] that the path has where the car is.
    double speed() const { return plan_.path[next_][motion_speed]; }

private:
    const Situation& here_;
    const Plan& plan_;
    double late_;             // [s]
    double goal_x_, goal_y_;  // [m] in the frame of the rear axle now
    std::int64_t next_ = 0;   // index of the path's next point
};

// Return whether a beam ends in the disc of the bare car round a place in the frame of the LiDAR, `away` [m].
bool ends_in(const Situation& here, double ahead, double left, double away) {
    const double increment = here.geometry.angle_increment, width = here.limiter.car.width;
    const double radius = fg::hypot(0.5 * width, 0.25 * width);  // it covers the corners of the front
    const double middle = nearest_beam(here.geometry.angle_min, increment, ahead, left);
    double half = inf;
    int step = 1;
    if (away > radius) {
        half = fg::asin(radius / away) / increment;
        step = max(whole(half / beams_aside), 1);
    }
    const int last = whole(min(static_cast<double>(here.ranges.length - 1), middle + half));
    for (int beam = whole(max(0.0, middle - half)); beam <= last; beam += step) {
        const double end = here.ranges[beam], off = (beam - middle) * increment;
        if (end - away < radius && end * end + away * away - 2.0 * end * away * fg::cos(off) < radius * radius)
            return true;
    }
    return false;
}

// Return whether the ground at a place ahead of a rear axle is free on the local map, .4 m and more from walls.
bool was_seen(const Situation& here, const Place& at, double ahead) {
    const LocalMap& world = here.ground.map;
    const double x = at.x + ahead * at.cos, y = at.y + ahead * at.sin;
    const double cos = fg::cos(world.heading), sin = fg::sin(world.heading);
    const std::int64_t i = floored((world.x + cos * x - sin * y) * cells_per_metre);
    const std::int64_t j = floored((world.y + sin * x + cos * y) * cells_per_metre);
    return in_window(world, i, j) &&
           (world.cells[i & map_ring][j & map_ring] & (cell_kind | cell_nearness)) == free_cell;
}

// Return what a car meets whose rear axle is at a place at a time [s].
//
// What has to stay clear: the disc over the car's front, its centre a quarter of the width behind the bumper, and the
// plan's margin ahead of it; and discs of the same size round the LiDAR and the rear axle, which cut the corner, once
// they are ahead of where the LiDAR is now. Along a path, ground that the local map has free counts as free where a
// corner hides it. On known ground all that is hidden does, and only ends of beams within the bare car's discs count.
// Where the car `stands`, nothing that moves may come by for a while.
std::int64_t occupied(const Situation& here, const Plan& plan, const Place& at, double time, bool stands) {
    const CarParameters& car = here.limiter.car;
    const double lidar = car.lidar_offset, front = car.length - car.rear_overhang - 0.25 * car.width;
    for (const double offset : {front, 0.0, lidar}) {
        const double ahead = at.x + offset * at.cos - lidar, left = at.y + offset * at.sin;
        if (!(offset == front || ahead > 0.0)) continue;
        // Widening does not shorten a reading, so what is in front of the disc has to stay clear, too.
        const double more = offset == front ? 0.25 * car.width + plan.margin : 0.0;
        const double away = std::sqrt(ahead * ahead + left * left), seen = reading_towards(here, ahead, left);
        if (seen > away + more) continue;
        if (here.known) {
            if (ends_in(here, ahead, left, away)) return Met::stands;
        } else {
            const bool hidden = plan.path.rows > 0 && away > seen + here.radius;  // what stands there is before it
            if (!(hidden && was_seen(here, at, offset) && was_seen(here, at, offset + more))) return Met::stands;
        }
    }
    if (here.movers.rows > 0) {
        const double apart = here.radius + here.settings.margin_aside;
        for (const double offset : {0.0, lidar, front}) {
            const double ahead = at.x + offset * at.cos - lidar, left = at.y + offset * at.sin;
            for (int wait = 0; wait <= (stands ? waits : 0); ++wait)
                if (meets(here.movers, ahead, left, apart, time + wait_time * wait)) return Met::moves;
        }
    }
    return Met::free;
}

}  // namespace

Met simulate(const Situation& here, const Plan& plan, double use, double speed) {
    const Limiter& limiter = here.limiter;
    const CarParameters& car = limiter.car;
    LimiterMemory& memory = here.memory;
    const double acceleration_now = memory.acceleration, curvature_now = memory.curvature;
    const double turned = share_of_way(here.period, limiter.settings.steering_response);  // that a tick carries out
    const double slowed_once = share_of_way(here.period, car.speed_time_constant);
    const double slowed_twice = share_of_way(2.0 * here.period, car.speed_time_constant);
    const double standing = here.settings.standing_speed;
    Follower follower(here, plan);
    Place at;
    double angle = here.angle, time = 0.0;
    Met met{0.0, 0.0, Met::free};
    for (int tick = 0; tick < most_ticks; ++tick) {
        const double ticks = tick < fine_ticks ? 1.0 : 2.0, slowed = tick < fine_ticks ? slowed_once : slowed_twice;
        const double reference = follower.steer(at, angle, speed);
        double aim = tick == 0 ? plan.speed : 0.0;
        if (follower.goes_on()) {
            if (follower.is_at_end()) break;
            aim = min(plan.speed, follower.speed());
        }
        const auto command =
            limited(limiter, memory, {reference, aim}, use, {angle, speed}, ticks * here.period, true);
        const double next_angle = angle + ticks * turned * (command[0] - angle);
        const double next_speed = speed + slowed * (command[1] - speed);
        const double way = longer * 0.5 * (speed + next_speed) * ticks * here.period;
        double curvature = fg::tan(0.5 * (angle + next_angle)) / car.wheelbase;
        if (limiter.slip.needs_slip_angle) {
            const double lag = path_lag(limiter.slip, 0.5 * (speed + next_speed));
            memory.curvature += (curvature - memory.curvature) * (1.0 - fg::exp(-way / lag));
            curvature = memory.curvature;
        }
        const double middle = at.heading + 0.5 * curvature * way;
        at.x += way * fg::cos(middle);
        at.y += way * fg::sin(middle);
        at.heading += curvature * way;
        at.cos = fg::cos(at.heading);
        at.sin = fg::sin(at.heading);
        angle = next_angle;
        speed = next_speed;
        time += ticks * here.period;
        const std::int64_t what = occupied(here, plan, at, time, speed < standing);
        met = {what != Met::free ? max(speed, standing) : 0.0, time, what};
        if (what != Met::free || speed < standing) break;
    }
    memory.acceleration = acceleration_now;
    memory.curvature = curvature_now;
    return met;
}

}  // namespace fg
