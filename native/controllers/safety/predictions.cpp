// What a target may do, and what the scan shows of its way.
#include "predictions.hpp"

#include <algorithm>

#include "../../core/numbers.hpp"
#include "../../core/transcendental.hpp"
#include "../control/driving.hpp"
#include "../control/slip.hpp"

namespace fg {
namespace {

constexpr int most_late = 16;          // ticks from which on scans are too late to be compared with
constexpr double braking_ahead = 6.0;  // [m/s^2] of a target that drives in the car's direction
constexpr double slowing = 0.3;        // [1/s] share of its speed that a target which crosses loses in a second
constexpr double margin = 0.06;        // [m] round a target
constexpr double least_radius = 0.1;   // [m]
constexpr double farthest_wall = 4.0;  // [m] along its line, to which what stands there is looked for
constexpr double between = 0.1;        // [m] between the places where that is done
constexpr double on_line = 0.3;        // [m] from a target's line, at which a place where it turned lies on it
constexpr double sigmas = 2.0;         // of a target's speed,
constexpr double most_spread = 0.1;    // and [m/s]
constexpr double slows = 0.3;          // [1/s] of its speed,
constexpr double most_slowing = 1.0;   // and [m/s^2]: by how much one may become slower
constexpr double drives_at = 1.5;      // [m/s] ahead: it is a car,
constexpr double length_ahead = 0.4;   // and [m] of it are ahead of what is seen

bool is_mover(const Target& target) { return target.age > 0 && target.moves; }

// Write the odometry of `late` ticks ago, when the scan was measured: by a newer one standing things move.
void keep_odometry(Predictions& memory, const Odometry& odometry, std::int64_t late) {
    const std::int64_t column = memory.tick % most_late;
    memory.speeds[column] = odometry.speed, memory.yaw_rates[column] = odometry.angular_velocity[2];
    const std::int64_t then = max(memory.tick - late, std::int64_t{0}) % most_late;
    ++memory.tick;
    memory.odometry.speed = memory.speeds[then], memory.odometry.angular_velocity[2] = memory.yaw_rates[then];
}

// Return the direction in which a target goes: along the line through the two places where it turned, if it did.
std::array<double, 2> course(const Target& target, double speed) {
    const double x = target.vx / speed, y = target.vy / speed;
    const double dx = target.turned[0][0] - target.turned[1][0], dy = target.turned[0][1] - target.turned[1][1];
    const double way = std::copysign(fg::hypot(dx, dy), dx * x + dy * y);
    if (target.turns >= 2 && std::abs(way) > on_line && std::abs(dx * y - dy * x) < 0.5 * std::abs(way))
        return {dx / way, dy / way};
    return {x, y};
}

// Return an interval of ways [m] as an interval of places of a target that turns at both ends of its line.
std::array<double, 2> to_and_fro(double near, double far, const Prediction& target) {
    const double back = target.from_wall, length = max(target.from_wall + target.to_wall, 1e-3);
    const double turns = std::floor((near + back) / length), more = std::floor((far + back) / length);
    if (more - turns >= 2.0) return {-back, target.to_wall};
    const bool forth = std::fmod(turns, 2.0) == 0.0;
    const double first = near + back - turns * length, last = far + back - more * length;
    if (more > turns) {  // it turns in between
        if (forth) return {min(first, length - last) - back, length - back};
        return {-back, max(length - first, last) - back};
    }
    if (forth) return {first - back, last - back};
    return {length - last - back, length - first - back};
}

// Return whether a target drives ahead as a car does, which follows the walls, and does not turn back.
bool drives_as_car(const Prediction& target) { return target.speed * target.cos > drives_at; }

// Return how far a target can go before its rim touches a standing thing [m]; inf: there is none.
// It goes on along its line where `sign` is 1, and back where it is -1.
double way_to_wall(const ScanGeometry& geometry, Numbers ranges_without_movers, const Prediction& target, double sign) {
    for (int step = 0; step < static_cast<int>(farthest_wall / between) + 1; ++step) {
        const double way = target.radius - margin + step * between;
        const double ahead = target.x + sign * way * target.cos, left = target.y + sign * way * target.sin;
        const double beam = nearest_beam(geometry.angle_min, geometry.angle_increment, ahead, left);
        if (!(0.0 <= beam && beam < ranges_without_movers.size())) return inf;
        if (ranges_without_movers[static_cast<int>(beam)] < fg::hypot(ahead, left)) return max(step - 1, 0) * between;
    }
    return inf;
}

// Shorten the ways of a target to where it was seen to turn back, and write at how many ends it was.
void end_where_it_turned(const Targets& seen, const Target& target, Prediction& row) {
    const double cos = fg::cos(seen.heading), sin = fg::sin(seen.heading);
    row.turns = 0.0;
    for (int index = 0; index < min(target.turns, std::int64_t{2}); ++index) {
        const double dx = target.turned[index][0] - seen.x, dy = target.turned[index][1] - seen.y;
        const double ahead = cos * dx + sin * dy - row.x, left = cos * dy - sin * dx - row.y;
        const double along = row.cos * ahead + row.sin * left, across = row.cos * left - row.sin * ahead;
        if (std::abs(across) < on_line) {
            row.turns += 1.0;
            const bool behind = std::abs(along) > on_line ? along < 0.0 : index == (target.turns - 1) % 2;
            (behind ? row.from_wall : row.to_wall) = max(behind ? -along : along, 0.0);
        }
    }
}

// Return a place along and across an arc that begins in the direction of `along` [m]; curvature [1/m], not 0.
std::array<double, 2> along_arc(double along, double across, double curvature) {
    const double turned = curvature * along, off = 1.0 - curvature * across;
    const double beyond = 2.0 * across - curvature * (along * along + across * across);
    return {fg::atan2(turned, off) / curvature, beyond / (1.0 + fg::hypot(turned, off))};
}

}  // namespace

bool foresee(const ScanGeometry& geometry, Row<double> seen, Row<double> ranges_without_movers,
             const Odometry& odometry, const Driver& driver, Predictions& memory) {
    const bool moves = predict(geometry, seen, odometry, driver, memory);
    if (moves) separate(geometry, seen, ranges_without_movers, memory);
    return moves;
}

bool predict(const ScanGeometry& geometry, Numbers ranges, const Odometry& odometry, const Driver& driver,
             Predictions& memory) {
    return track(geometry, ranges, odometry, driver, memory) && write_predictions(memory);
}

bool track(const ScanGeometry& geometry, Numbers ranges, const Odometry& odometry, const Driver& driver,
           Predictions& memory) {
    memory.count = memory.cars = 0;
    if (!(driver.prediction && sees(geometry, ranges))) return false;
    keep_odometry(memory, odometry, driver.late);
    const Odometry& then = memory.odometry;
    const double angle = velocity_angle(driver.limiter.slip, driver.car, then.speed, then.angular_velocity[2]);
    return track_targets(memory.targets, geometry, ranges, then, driver.car.lidar_offset, angle) > 0;
}

std::array<double, 2> position_of(const Targets& seen, const Target& target) {
    const double cos = fg::cos(seen.heading), sin = fg::sin(seen.heading);
    const double dx = 0.5 * (target.ends[0][0] + target.ends[1][0]) - seen.x;
    const double dy = 0.5 * (target.ends[0][1] + target.ends[1][1]) - seen.y;
    return {cos * dx + sin * dy, cos * dy - sin * dx};
}

bool write_predictions(Predictions& memory) {
    memory.count = 0;
    const Targets& seen = memory.targets;
    const double cos = fg::cos(seen.heading), sin = fg::sin(seen.heading);
    for (const Target& target : seen.targets) {
        if (!is_mover(target)) continue;
        Prediction& row = prediction(table(memory.rows)[memory.count++]);
        const auto [x, y] = position_of(seen, target);
        row.x = x, row.y = y;
        row.speed = fg::hypot(target.vx, target.vy), row.radius = max(target.size, least_radius) + margin;
        row.cos = 1.0, row.sin = 0.0;
        if (row.speed > 0.0) {
            const auto [course_x, course_y] = course(target, row.speed);
            row.cos = cos * course_x + sin * course_y, row.sin = cos * course_y - sin * course_x;
        }
        row.braking = braking_ahead * row.cos * row.cos + slowing * row.speed;
        row.spread = std::sqrt(target.p_speed), row.curvature = 0.0;
    }
    return memory.count > 0;
}

void separate(const ScanGeometry& geometry, Row<double> seen, Row<double> ranges_without_movers, Predictions& memory) {
    hide_targets(memory.targets, seen);
    for (int beam = 0; beam < seen.size(); ++beam) ranges_without_movers[beam] = seen[beam];
    int k = 0;
    for (const Target& target : memory.targets.targets) {
        if (!is_mover(target)) continue;
        Prediction& row = prediction(table(memory.rows)[k++]);
        row.to_wall = way_to_wall(geometry, ranges_without_movers, row, 1.0);
        row.from_wall = way_to_wall(geometry, ranges_without_movers, row, -1.0);
        end_where_it_turned(memory.targets, target, row);
    }
}

void hide_targets(const Targets& targets, Row<double> ranges) {
    for (const Target& target : targets.targets) {
        if (target.age == 0 || !target.moves || target.unseen > 0.0) continue;
        double beyond = inf;
        if (target.own[0] && target.first > 0) beyond = ranges[target.first - 1];
        if (target.own[1] && target.end < ranges.length) beyond = min(beyond, ranges[target.end]);
        if (!std::isfinite(beyond)) continue;
        for (std::int64_t beam = target.first; beam < target.end; ++beam)
            if (ranges[beam] > 0.9 * target.distance)  // not on something that was drawn before it
                ranges[beam] = max(ranges[beam], beyond);
    }
}

std::array<double, 2> interval(Numbers row, double time) {
    const Prediction& target = prediction(row);
    const double speed = target.speed, braking = max(target.braking, 1e-6);
    double far = (speed + target.spread) * time;
    const double stops = min(time, speed / braking);
    double near = (speed - 0.5 * braking * stops) * stops - target.spread * time;
    if (far > target.to_wall) {
        near = min(near, 2.0 * target.to_wall - far);
        far = max(target.to_wall, near);
    }
    return {near, far};
}

std::array<double, 2> occupied(Numbers row, double time, double bold) {
    const Prediction& target = prediction(row);
    const bool known = target.turns >= 2.0;
    const double speed = target.speed;
    const double spread = (known ? 1.0 - 0.5 * bold : sigmas) * min(target.spread, most_spread);
    const double slower = known ? 0.0 : 0.5 * min(slows * speed, most_slowing) * time * time;
    double near = max((speed - spread) * time - slower, -spread * time), far = (speed + spread) * time;
    if (drives_as_car(target)) return {min(near, target.to_wall) - 0.1, min(far, target.to_wall) + length_ahead};
    if (known && std::isfinite(target.from_wall + target.to_wall)) return to_and_fro(near, far, target);
    if (far > target.to_wall) {
        near = min(near, 2.0 * target.to_wall - far);
        far = max(target.to_wall, near);
    }
    return {near, far};
}

bool meets(Matrix rows, double ahead, double left, double radius, double time) {
    for (std::int64_t k = 0; k < rows.rows; ++k) {
        const Prediction& target = prediction(rows[k]);
        const double dx = ahead - target.x, dy = left - target.y;
        double along = target.cos * dx + target.sin * dy, across = target.cos * dy - target.sin * dx;
        if (target.curvature != 0.0) {
            const auto place = along_arc(along, across, target.curvature);
            along = place[0], across = place[1];
        }
        const double reach = radius + target.radius;
        if (std::abs(across) < reach) {
            const auto [near, far] = interval(rows[k], time);
            const double off = max(max(near - along, along - far), 0.0);
            if (off * off + across * across < reach * reach) return true;
        }
    }
    return false;
}

OwnTable<double> turned(const Predictions& memory, double angle) {
    const Matrix rows = table(memory.rows);
    OwnTable<double> copy(memory.count, rows.columns);
    for (std::int64_t k = 0; k < memory.count; ++k) std::copy_n(rows[k].data, rows.columns, copy[k].data);
    if (angle != 0.0) {
        const double cos = fg::cos(angle), sin = fg::sin(angle);
        for (std::int64_t k = 0; k < memory.count; ++k) {
            Prediction& row = prediction(copy[k]);
            const double x = row.x, y = row.y, course_x = row.cos, course_y = row.sin;
            row.x = cos * x + sin * y, row.y = cos * y - sin * x;
            row.cos = cos * course_x + sin * course_y, row.sin = cos * course_y - sin * course_x;
        }
    }
    return copy;
}

}  // namespace fg
