// A motion is followed move by move: the car stops before it changes its direction, turns its wheels, and drives on.
#include "turning.hpp"

#include "../../core/numbers.hpp"
#include "../../core/transcendental.hpp"
#include "../control/steering.hpp"
#include "../control/tracking.hpp"
#include "../perception/local_map.hpp"

namespace fg {
namespace {

constexpr double slow = 0.7;            // [m/s]
constexpr double patience = 0.35;       // [s]
constexpr double apart = 1.0;           // [m] along the path, of turns at different places
constexpr int most_begun = 4;           // turns at one place; then recovery has the car
constexpr double give_up = 1.0;         // [s] without moving
constexpr double speed_of_moves = 0.8;  // [m/s]
constexpr double braking = 1.5;         // [m/s^2] before a change of direction
constexpr double reach = 0.3;           // [m] to the point that the car steers for
constexpr double horizon = 1.5;         // [m] by which the way to go is shorter at the end
constexpr double grip = 0.85;           // of the cornering acceleration; the search takes the car to be standing

// Return whether the car begins to turn now.
bool begins(FrontierSearch& frontier, const Limiter& limiter, Turning& memory, double steering_angle, double speed,
            double period) {
    memory.slow = std::abs(speed) < slow ? memory.slow + period : 0.0;
    const CarParameters& car = limiter.car;
    // [s] of a standing start to a speed that is not slow, and until the car answers a command
    const double start = slow / limiter.accelerating + 0.5 * limiter.settings.load_transfer_time;
    const double waits = max(patience, start + period) + car.command_delay;
    if (memory.slow < waits - 0.5 * period || !frontier.found) return false;
    const LocalMap& world = frontier.map;
    if (memory.begun == 0 || std::abs(world.along - memory.begun_at) > apart) {
        memory.begun = 0, memory.begun_at = world.along;
    }
    if (memory.begun >= most_begun) return false;
    memory.slow = 0.0;
    const double curvature = fg::tan(steering_angle) / car.wheelbase;
    // The second attempt has what the first leaves of the nodes, so next time the other one begins.
    for (int attempt = 0; attempt < 2; ++attempt) {
        const int nearest = (attempt + memory.failed) % 2 == 0 ? wall_in_2 : wall_in_1;
        const Query query{curvature, 0.0, 0.0, grip, most_lock, horizon, nearest, true, most_nodes};
        if (search_motion(frontier, limiter, memory.motion, query)) {
            memory.active = true, memory.next_point = 0;
            ++memory.begun;
            const double cos = fg::cos(world.heading), sin = fg::sin(world.heading);
            memory.in_walls = outline_in_walls(world, car, world.x, world.y, cos, sin);
            return true;
        }
    }
    ++memory.failed;
    return false;
}

// Return whether what is left of the motion is free.
bool is_free(const FrontierSearch& frontier, const CarParameters& car, const Turning& memory) {
    const LocalMap& world = frontier.map;
    const auto most = max(memory.in_walls, most_in_walls);
    const auto ends = sorted_ends(world, world.ends_known);
    for (std::int64_t k = memory.next_point; k < memory.motion.count; ++k) {
        const Numbers point = table(memory.motion.points)[k];
        const double x = point[motion_x], y = point[motion_y], heading = point[motion_heading];
        const double cos = fg::cos(heading), sin = fg::sin(heading);
        if (outline_in_walls(world, car, x, y, cos, sin) > most) return false;
        if (touches(ends, car, x, y, cos, sin, 0.0)) return false;
    }
    return true;
}

}  // namespace

void turn_in_moves(FrontierSearch& frontier, const Limiter& limiter, Turning& memory, double steering_angle,
                   double speed, double period) {
    if (!memory.active && !begins(frontier, limiter, memory, steering_angle, speed, period)) return;
    const CarParameters& car = limiter.car;
    const LocalMap& world = frontier.map;
    const std::int64_t count = memory.motion.count;
    const Matrix points = table(memory.motion.points);
    const double cos = fg::cos(world.heading), sin = fg::sin(world.heading);
    for (; memory.next_point < count; ++memory.next_point) {
        const Numbers point = points[memory.next_point];
        const double ahead =
            (cos * (point[motion_x] - world.x) + sin * (point[motion_y] - world.y)) * point[motion_direction];
        const std::int64_t after = memory.next_point + 1;
        const bool last = after == count || points[after][motion_direction] != point[motion_direction];
        if (ahead > (last ? 0.03 : 0.12)) break;
    }
    const bool stands = memory.slow > give_up + 0.5 * period;
    if (memory.next_point >= count || stands || !is_free(frontier, car, memory)) {
        memory.active = false, memory.slow = 0.0;
        return;
    }
    memory.slow = std::abs(speed) < 0.05 ? memory.slow + period : 0.0;
    const double direction = points[memory.next_point][motion_direction];
    double left = 0.0, x = world.x, y = world.y;  // left: [m] until the direction changes
    std::int64_t target = -1, end = memory.next_point;
    for (; end < count && points[end][motion_direction] == direction; ++end) {
        left += fg::hypot(points[end][motion_x] - x, points[end][motion_y] - y);
        x = points[end][motion_x], y = points[end][motion_y];
        if (target < 0 && left >= reach) target = end;
    }
    const Numbers point = points[target >= 0 ? target : end - 1];
    const double ahead = cos * (point[motion_x] - world.x) + sin * (point[motion_y] - world.y);
    const double aside = cos * (point[motion_y] - world.y) - sin * (point[motion_x] - world.x);
    double angle = fg::atan(points[memory.next_point][motion_curvature] * car.wheelbase);
    if (std::abs(ahead) > 0.15) angle = arc_through(ahead, aside, car.wheelbase);
    memory.steering_angle = saturate(angle, car.max_steering_angle);
    memory.speed = min(speed_of_moves, std::sqrt(2.0 * braking * left) + 0.1) * direction;
    const bool turns_wheels = std::abs(memory.steering_angle - steering_angle) > 0.05 && std::abs(speed) < 0.3;
    if (speed * direction < -0.1 || turns_wheels) memory.speed = memory.slow = 0.0;
}

}  // namespace fg
