#include "pure_pursuit.hpp"

#include "../../core/transcendental.hpp"
#include "../../controllers/control/slip.hpp"
#include "../../controllers/control/steering.hpp"
#include "line_profile.hpp"

namespace fg {
namespace {

constexpr double short_joining = 1.0;  // m/m: the other trackers join the line further on by no more, so as not to cut
                                       // a bend on the way
constexpr double search = 2.0;         // [m] along the line, to either side of the last nearest point

// Return the distance [m] of a point of the line from (x, y) [m].
double distance_to(Matrix line, std::int64_t point, double x, double y) {
    return fg::hypot(line[point][line_x] - x, line[point][line_y] - y);
}

// Return the point of the line that is nearest to (x, y) [m].
std::int64_t nearest_of_all(Matrix line, double x, double y) {
    std::int64_t best = 0;
    double least = distance_to(line, best, x, y);
    for (std::int64_t point = 1; point < line.rows; ++point) {
        const double distance = distance_to(line, point, x, y);
        if (distance < least) best = point, least = distance;
    }
    return best;
}

// Return the point nearest to (x, y) [m] of the stretch of line round the last one.
std::int64_t nearest_from(Matrix line, std::int64_t last, double x, double y) {
    std::int64_t best = last;
    double least = distance_to(line, best, x, y);
    const int points = whole(std::ceil(search / line[0][line_step]));
    for (const int direction : {1, -1}) {
        std::int64_t point = last;
        for (int i = 0; i < points; ++i) {
            point = next_point(line, point, direction);
            const double distance = distance_to(line, point, x, y);
            if (distance < least) best = point, least = distance;
        }
    }
    return best;
}

// Return the point nearest to (x, y) [m], and remember it.
std::int64_t nearest_point(Matrix line, OnLine& memory, double lost_distance, double x, double y) {
    if (memory.on_line) memory.point = nearest_from(line, memory.point, x, y);
    if (!memory.on_line || distance_to(line, memory.point, x, y) > lost_distance)
        memory.point = nearest_of_all(line, x, y);
    memory.on_line = true;
    return memory.point;
}

// Return the lookahead [m] of a car at a speed [m/s] and a distance to the line [m].
double lookahead_at(const PurePursuitSettings& settings, const Slip& slip, const CarParameters& car, double speed,
                    double offset) {
    const double late = settings.tracker == tracker_map ? late_on_path(slip, car, speed) : late_by(car);
    const double on_line = max(settings.least_lookahead, settings.lookahead_time * speed) + late * speed;
    double joining = settings.joining_lookahead;
    if (settings.tracker > tracker_pure_pursuit) joining = min(joining, short_joining);
    return on_line + joining * offset;
}

// Return the first place of the line from a point on that is `lookahead` [m] from (x, y) [m]: x and y [m].
//
// It is no further along than the lookahead and as much again; beyond the end of an open line it is straight on.
std::array<double, 2> goal_ahead(Matrix line, std::int64_t nearest, double lookahead, double x, double y) {
    const double step = line[0][line_step];
    const int points = whole(std::ceil(2.0 * lookahead / step));
    std::int64_t point = nearest;
    for (int i = 0; i < points; ++i) {
        const double distance = distance_to(line, point, x, y);
        if (distance >= lookahead) break;
        const std::int64_t ahead = next_point(line, point, 1);
        if (ahead == point) {
            const Numbers here = line[point], before = line[next_point(line, point, -1)];
            const double beyond = (lookahead - distance) / step;
            return {here[line_x] + beyond * (here[line_x] - before[line_x]),
                    here[line_y] + beyond * (here[line_y] - before[line_y])};
        }
        point = ahead;
    }
    return {line[point][line_x], line[point][line_y]};
}

// Return the speed [m/s] of the profile at a point or `ahead` [m] further on, the slower of the two.
double profile_speed(Matrix line, std::int64_t nearest, double ahead) {
    return min(line[nearest][line_speed], line[moved_along(line, nearest, ahead)][line_speed]);
}

// Return the steering angle [rad], the speed of the profile [m/s], the goal's bearing [rad] and distance [m].
//
// NaN: brake. The nearest point of the line is written into the reference, for other trackers.
std::array<double, 4> follow(const Tick& tick, const PurePursuitSettings& settings, OnLine& memory) {
    constexpr std::array<double, 4> braking{nan, 0.0, nan, nan};
    const CarParameters& car = tick.driver.car;
    const Odometry& odometry = tick.odometry;
    const Matrix line = tick.line;
    const double x = odometry.pose[0], y = odometry.pose[1], heading = odometry.pose[2];
    if (!(std::isfinite(x + y + heading) && std::isfinite(odometry.speed))) return braking;
    const double now = min(std::abs(odometry.speed), car.max_speed);
    const std::int64_t nearest = nearest_point(line, memory, settings.lost_distance, x, y);
    if (line[nearest][line_speed] == 0.0) return braking;
    const double offset = distance_to(line, nearest, x, y);
    tick.reference.point = nearest, tick.reference.off_line = offset;
    const double lookahead = lookahead_at(settings, tick.driver.limiter.slip, car, now, offset);
    const auto [goal_x, goal_y] = goal_ahead(line, nearest, lookahead, x, y);
    double bearing = fg::atan2(goal_y - y, goal_x - x) - heading;
    const double distance = fg::hypot(goal_x - x, goal_y - y);
    bearing = fg::atan2(fg::sin(bearing), fg::cos(bearing));
    const double speed = profile_speed(line, nearest, (settings.reaction + late_by(car)) * now);
    const double steering_angle = std::abs(bearing) > 0.5 * pi ? std::copysign(car.max_steering_angle, bearing)
                                                               : pursue(bearing, distance, 0.0, car.wheelbase);
    return {steering_angle, speed, bearing, distance};
}

}  // namespace

void refer_along_line(const Tick& tick, PlannerState<PurePursuitSettings, OnLine>& state) {
    std::array<double, 4> found{nan, 0.0, nan, nan};
    if (sees(tick.geometry, tick.ranges)) found = follow(tick, state.settings, state.memory);
    refer(tick.record, tick.ranges, found[0], found[1], found[2], found[3]);
}

std::array<double, 2> goal_on_line(Matrix line, const PurePursuitSettings& settings, const Driver& driver, double x,
                                   double y, double speed) {
    const std::int64_t nearest = nearest_of_all(line, x, y);
    const double offset = distance_to(line, nearest, x, y);
    const double lookahead = lookahead_at(settings, driver.limiter.slip, driver.car, std::abs(speed), offset);
    return goal_ahead(line, nearest, lookahead, x, y);
}

}  // namespace fg
