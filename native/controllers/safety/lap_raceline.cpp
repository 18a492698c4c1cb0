#include "lap_raceline.hpp"

#include "../../core/numbers.hpp"
#include "../../core/transcendental.hpp"
#include "../control/decision.hpp"
#include "../control/driving.hpp"
#include "../control/reasons.hpp"
#include "../control/slip.hpp"
#include "../control/stages.hpp"
#include "../control/steering.hpp"
#include "../control/tracking.hpp"
#include "judge.hpp"
#include "line_following.hpp"
#include "line_optimizer.hpp"
#include "rollout.hpp"

namespace fg {
namespace {

constexpr double least_spacing = 0.25;   // [m] of points; greater where they would be more than line_points
constexpr int steps_at_once = 4;         // of shaping, in a tick
constexpr int times_smoothed = 6;        // the path, before the first step
constexpr double least_margin = 0.16;    // [m] between the car's outline and walls,
constexpr double more_margin = 0.05;     // [m] and as much more after a failed trial
constexpr std::int64_t most_trials = 3;  // that a lap on the line may have
constexpr int places_behind = 3, places_ahead = 5;  // whose beams are read for the room at a point
constexpr double through = 0.6;     // [m] by which the line may lead through a wall, before its points are moved
constexpr double cusp = 1.6;        // spacings from the point before to the one after, below which the line turns back
constexpr double too_sharp = 1.08;  // share of the curvature at full lock: a line that is sharper somewhere is refused
constexpr double near_aside = 1.5, near_turned = 0.7;  // [m] and [rad] from the line, within which the car is led to it
// Within which the car begins to follow the line: [m] to its side, [rad] from it, and share of the cornering
// acceleration from its curvature.
constexpr double joins_aside = off_the_line, joins_turned = 0.2, joins_bending = 0.3;
constexpr double reach = 0.8, reach_time = 0.3;  // [m] and [s] to the point of the line to which the car is led
constexpr double uses[] = {1.0, 0.75, 0.5};      // shares of the grip for cornering
constexpr double beside_line[] = {0.1, -0.1};    // [m] to its left: driven if a wall is nearer the line than was seen
constexpr double planner_speed = 2.0;            // [m/s] from which on the planner drives past something new
constexpr double still_laps = 2.0;               // without anything that moves, after which the line is followed again
constexpr double planner_drives = 5.0;           // [m] after something new was within twice that

// Lower the room of each point to where the walls leave the car's rectangle and a margin [m].
void read_room(const LapMap& lap, Cube<const double> walls, Matrix points, Matrix normals, const CarParameters& car,
               double margin, Row<double> low, Row<double> high) {
    const double half = 0.5 * car.width + margin, tail = -car.rear_overhang - margin;
    const double nose = car.length - car.rear_overhang + margin;
    std::int64_t at = 0;
    for (int k = 0; k < low.size(); ++k) {
        const double x = points[k][0], y = points[k][1], normal_x = normals[k][0], normal_y = normals[k][1];
        at = std::get<0>(nearest_place(lap, at, x, y, nan));
        for (int more = -places_behind; more <= places_ahead; ++more) {
            const Matrix ends = walls[(at + more + lap.count) % lap.count];
            for (int beam = 0; beam < lap_beams; ++beam) {
                const double dx = ends[beam][0] - x, dy = ends[beam][1] - y, side = ends[beam][2];
                const double behind = normal_y * dx - normal_x * dy;
                if (!(tail < behind && behind < nose)) continue;  // nor is NaN
                const double to_left = normal_x * dx + normal_y * dy;
                if (side > 0.0 && to_left > -through) {
                    high[k] = min(high[k], to_left - half);
                } else if (side < 0.0 && to_left < through) {
                    low[k] = max(low[k], to_left + half);
                }
            }
        }
    }
}

// Return the points of the line; for the first step those of the lap's path, smoothed.
OwnTable<double> begin_shape(const Line& line, const LapMap& lap) {
    const bool first = line.step == 0;
    const int count = static_cast<int>(first ? lap.count : line.count);
    OwnTable<double> places(count, 2);
    const OwnRow<double> column(count);
    for (int axis = 0; axis < 2; ++axis) {
        for (int k = 0; k < count; ++k) column[k] = first ? lap.places[k][axis] : line.points[k][axis];
        for (int i = 0; first && i < times_smoothed; ++i) average(column);
        for (int k = 0; k < count; ++k) places[k][axis] = column[k];
    }
    return places;
}

// Take the line as ready, and refuse one on which the car turned in moves, or that is too sharp for it.
void finish(Line& line, const Limiter& limiter) {
    const int count = static_cast<int>(line.count);
    const auto x = [&](int k) -> double { return line.points[k < 0 ? count - 1 : k < count ? k : 0][0]; };
    const auto y = [&](int k) -> double { return line.points[k < 0 ? count - 1 : k < count ? k : 0][1]; };
    double length = 0.0;
    for (int k = 0; k < count; ++k) length += fg::hypot(x(k) - x(k - 1), y(k) - y(k - 1));
    line.spacing = length / count, line.ready = true, line.next = 0;
    describe_line(line, limiter);
    if (std::isnan(line.weight)) line.refused = true;
    const double tightest = too_sharp * fg::tan(lock_arc(limiter.slip, limiter.car)) / limiter.car.wheelbase;
    for (int k = 0; k < count; ++k) {
        const bool turns_back = fg::hypot(x(k + 1) - x(k - 1), y(k + 1) - y(k - 1)) < cusp * line.spacing;
        if (turns_back || std::abs(line.described[k][1]) > tightest) line.refused = true;
    }
}

// Return to which of the points ahead the car is led.
int target_of(Matrix points, double spacing, double now) {
    const int wanted = whole((reach + reach_time * max(now, 0.0)) / spacing);
    return max(min(wanted, static_cast<int>(points.rows) - 1), 0);
}

// Return the index of the point that is nearest to a place [m].
std::int64_t nearest_point(const Line& line, double x, double y) {
    std::int64_t best = 0;
    double least = inf;
    for (std::int64_t k = 0; k < line.count; ++k) {
        const double dx = line.points[k][0] - x, dy = line.points[k][1] - y, square = dx * dx + dy * dy;
        if (square < least) best = k, least = square;
    }
    return best;
}

// Return whether the car may follow the line, wherever it is.
bool may_follow(const Remembered& remembered, const Limiter& limiter, double now) {
    const LapMap& lap = remembered.lap;
    const Line& line = remembered.line;
    if (!(lap.closed && line.ready) || line.refused || lap.driven < line.until) return false;
    const double still = still_laps * static_cast<double>(line.count) * line.spacing;
    if (remembered.moved && remembered.still < still) return false;
    return !(limiter.slip.needs_slip_angle && line.trial.state != trial_holds) && std::isfinite(now);
}

// Return whether a car that does not yet follow the line begins to.
bool joins(const Odometry& odometry, const Limiter& limiter, Matrix window, std::array<double, 3> position,
           double spacing) {
    const auto [along, aside, turned] = position;
    const double now = odometry.speed, held = limiter.lateral / max(now * now, 0.5);
    const double bending = fg::tan(odometry.steering_angle) / limiter.car.wheelbase;
    const double off = std::abs(bending - curvature_at(window, along));
    const bool near = std::abs(aside) < joins_aside && std::abs(turned) < joins_turned && off < joins_bending * held;
    return near && now < speed_on(window, along, spacing, now);
}

// Return the points of a window from `first` on, shifted to the left [m].
OwnTable<double> points_beside(Matrix window, std::int64_t first, double shift) {
    OwnTable<double> points(window.rows - first, motion_speed + 1);
    for (std::int64_t k = first; k < window.rows; ++k) {
        const Numbers from = window[k];
        const Row<double> to = points[k - first];
        for (int column = 0; column <= motion_speed; ++column) to[column] = from[column];
        to[motion_x] = from[motion_x] - shift * fg::sin(from[motion_heading]);
        to[motion_y] = from[motion_y] + shift * fg::cos(from[motion_heading]);
    }
    return points;
}

// Lead the reference to the line, unless a wall is between, as on the inside of a hairpin.
void come_to_it(const Tick& tick, double spacing, const LineProposal& proposal) {
    Reference& reference = tick.reference;
    const auto seen = look_round(tick, true);
    const Situation& here = seen;
    const Matrix points = proposal.points;
    const Numbers target = points[target_of(points, spacing, here.speed)];
    const double ahead = target[motion_x] - tick.driver.car.lidar_offset, left = target[motion_y];
    if (!(reading_towards(here, ahead, left) > fg::hypot(ahead, left))) return;
    reference.steering_angle = proposal.steering_angle, reference.speed = min(reference.speed, proposal.speed);
    reference.bearing = fg::atan2(left, ahead), reference.distance = fg::hypot(ahead, left);
    log_step(table(tick.memory.reasons), step_remembered_line, reference.steering_angle, reference.speed);
}

// Simulate a drive along points at a speed [m/s] for a tick, in which the car brakes after that, or goes on.
bool consider_line(const Tick& tick, const Situation& here, Matrix points, double steering_angle, double speed,
                   bool goes_on) {
    Judge& judge = tick.memory.judge;
    const OwnTable<double> motion(points.rows, motion_speed);  // without the speeds: the car brakes
    for (std::int64_t k = 0; k < points.rows; ++k)
        for (int column = 0; column < motion_speed; ++column) motion[k][column] = points[k][column];
    const Plan plan{0.0, 0.0, goes_on ? points : Matrix(motion), speed, 0.0};
    const Numbers shares{uses, goes_on ? 1 : 3};
    return consider(here, proposal_on_line, steering_angle, plan, shares, table(judge.proposals), judge.line);
}

// Return whether the car can drive on a line: it could stop there after this tick, or go on.
bool is_free(const Tick& tick, const Situation& here, const LineProposal& proposal) {
    const double speed = min(min(proposal.speed, tick.reference.limit), tick.driver.max_speed);
    return consider_line(tick, here, proposal.points, proposal.steering_angle, speed, false) ||
           consider_line(tick, here, proposal.points, proposal.steering_angle, speed, true);
}

// Drive the line, or beside it, or brake on it, if the judge finds one of these free; else it may choose others.
void follow(const Tick& tick, Remembered& remembered, const LineProposal& proposal) {
    Limiter& limiter = tick.driver.limiter;
    FrictionLimiterSettings& settings = limiter.settings;
    Best& best = tick.memory.judge.line;
    const auto seen = look_round(tick, true);
    const Situation& here = seen;
    const double own_turn_in = settings.turn_in_use, own_in_braking = settings.lateral_use_in_braking;
    const auto [turn_in, in_braking] = on_line(limiter);
    settings.turn_in_use = turn_in, settings.lateral_use_in_braking = in_braking;
    log_step(table(tick.memory.reasons), step_remembered_line, proposal.steering_angle, proposal.speed);
    bool free = is_free(tick, here, proposal);
    for (const double shift : beside_line) {
        if (!free) free = is_free(tick, here, propose_line(remembered, tick.odometry, limiter, shift));
    }
    if (!free) {
        free = consider_line(tick, here, proposal.points, proposal.steering_angle, 0.0, false);
        free = free && here.speed > planner_speed;
        if (!free) best.steering_angle = proposal.steering_angle, best.speed = 0.0, best.use = 1.0;
    }
    settings.turn_in_use = own_turn_in, settings.lateral_use_in_braking = own_in_braking;
    if (free) {
        tick.memory.judge.best.why = proposal_on_line, tick.record.decided = true;
        drive_line(tick, best);
    }
}

}  // namespace

void keep_lap(Remembered& remembered, const ScanGeometry& geometry, Numbers ranges, const Odometry& odometry,
              const Driver& driver) {
    LapMap& lap = remembered.lap;
    Line& line = remembered.line;
    const Limiter& limiter = driver.limiter;
    const double lidar_offset = driver.car.lidar_offset;
    if (line.refused) forget_lap(lap);  // the car stood or turned in moves on that lap: the next one may give a line
    see_lap(lap, geometry, ranges, odometry, lidar_offset);
    if (!lap.closed) {
        line.step = line.failed = 0, line.ready = line.refused = line.follows = false, line.until = 0.0;
        line.trial.begun = false, line.trial.state = trial_goes_on;
    } else if (!line.ready) {
        const auto walls = walls_of(lap, geometry, ranges.length, lidar_offset);
        for (int i = 0; i < steps_at_once && !line.ready; ++i) shape_line(line, lap, walls, limiter, driver.max_speed);
    } else if (limiter.slip.needs_slip_angle && line.trial.state == trial_goes_on && !line.refused) {
        const auto walls = ends_of(lap, geometry, ranges.length, lidar_offset);
        const auto state = try_lap(line, lap, walls, limiter, driver.max_speed, period_of(geometry));
        if (state == trial_fails && line.failed < most_trials - 1) {  // once more, farther from the walls
            line.failed += 1;
            line.step = 0, line.ready = line.trial.begun = false, line.trial.state = trial_goes_on;
        }
    }
}

void shape_line(Line& line, const LapMap& lap, Cube<const double> walls, const Limiter& limiter, double max_speed) {
    const auto places = begin_shape(line, lap);
    const auto [own_points, most] = begin_step(places, line.step, max(least_spacing, length_of(places) / line_points));
    const Table<double> points = own_points;
    const auto normals = normals_of(points);
    const OwnRow<double> low(points.rows), high(points.rows);
    for (std::int64_t k = 0; k < points.rows; ++k) low[k] = -most, high[k] = most;
    const double margin = least_margin + more_margin * static_cast<double>(line.failed);
    read_room(lap, walls, points, normals, limiter.car, margin, low, high);
    const auto [cornering, braking] = uses_on(limiter);
    const OwnTable<double> left(2, grip_entries);
    const Grip grip =
        limited_grip(limiter, max_speed, {cornering, braking, 1.0}, turning_use(limiter), left[0], left[1]);
    std::tie(line.step, line.weight) = improve(points, normals, {low, high}, line.step, line.weight, grip);
    line.count = points.rows;
    for (std::int64_t k = 0; k < points.rows; ++k)
        for (int axis = 0; axis < 2; ++axis) line.points[k][axis] = static_cast<float>(points[k][axis]);
    if (line.step >= steps_of_a_line) finish(line, limiter);
}

LineProposal propose_line(Remembered& remembered, const Odometry& odometry, const Limiter& limiter, double shift) {
    const LapMap& lap = remembered.lap;
    Line& line = remembered.line;
    const double now = odometry.speed, spacing = line.spacing;
    const bool followed = line.follows;
    line.follows = false;
    if (!may_follow(remembered, limiter, now)) return {line_away, OwnTable<double>(0, motion_speed), 0.0, 0.0};
    if (!followed) line.next = nearest_point(line, lap.x, lap.y);
    const auto window = line_ahead(line, line.next, lap.x, lap.y, lap.heading, limiter);
    const std::int64_t point = next_point(window, 1, 0.0, 0.0, 0.0);
    line.next = (line.next + point - 1) % line.count;
    const auto position = position_on(window, point, spacing);
    const auto [along, aside, turned] = position;
    if (std::abs(aside) > near_aside || std::abs(turned) > near_turned)
        return {line_away, OwnTable<double>(0, motion_speed), 0.0, 0.0};
    line.follows = followed ? std::abs(aside) <= leaves_line : joins(odometry, limiter, window, position, spacing);
    const auto [steering_on, speed, most] =
        reference_on(window, along, aside - shift, turned, spacing, limiter, now, line.follows);
    OwnTable<double> points = points_beside(window, point, shift);
    double steering = steering_on;
    if (!line.follows) {  // towards a point further on: to lead the car there needs no sharp turns
        const Row<double> target = points[target_of(points, spacing, now)];
        steering = saturate(arc_through(target[motion_x], target[motion_y], limiter.car.wheelbase), most);
    }
    return {line.follows ? line_on : line_near, std::move(points), steering, speed};
}

void remember(const Tick& tick, Remembered& remembered) {
    Line& line = remembered.line;
    const Odometry& odometry = tick.odometry;
    if (std::isfinite(odometry.speed)) remembered.still += std::abs(odometry.speed) * period_of(tick.geometry);
    if (tick.memory.predictions.count > 0) remembered.moved = true, remembered.still = 0.0;
    keep_lap(remembered, tick.geometry, tick.ranges_without_cars, odometry, tick.driver);
    if (tick.record.decided || (tick.memory.guidance.follows && !line.follows)) return;
    if (line.follows && tick.memory.judge.best.why != proposal_on_line)  // the judge took another proposal
        line.follows = false, line.until = remembered.lap.driven + planner_drives;
    const LineProposal proposal = propose_line(remembered, odometry, tick.driver.limiter, 0.0);
    if (proposal.state == line_on) {
        follow(tick, remembered, proposal);
    } else if (proposal.state == line_near) {
        come_to_it(tick, line.spacing, proposal);
    }
}

}  // namespace fg
