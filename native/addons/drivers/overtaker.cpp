// Scans in which cars are hidden, and drawn where the planner's car could meet them.
#include "overtaker.hpp"

#include <tuple>

#include "../../core/numbers.hpp"
#include "../../core/transcendental.hpp"

namespace fg {
namespace {

constexpr double hidden = 0.45;  // [m] round the middle of a car: beams that end there end on it
constexpr int stop_steps = 24;
constexpr std::int64_t stands = 4;        // sightings of what may be a car that stands,
constexpr double standing_radius = 0.26;  // and its radius [m]
constexpr double of_car_radius = 0.6;     // [m] from the middle of what may be a car: what moves there is a part of it
constexpr double mostly_along = 0.7;      // of a thing's velocity is along the car's heading: it drives, as cars do

// Draw a disc into a scan (n,) [m], by its radius and its place ahead and to the left of the LiDAR [m].
void draw_disc(const ScanGeometry& geometry, Row<double> ranges, double ahead, double left, double radius) {
    const double far = fg::hypot(ahead, left), bearing = fg::atan2(left, ahead);
    const double half = fg::asin(min(radius / max(far, 1.0001 * radius), 1.0));
    const double increment = geometry.angle_increment;
    const int first = whole(std::ceil((bearing - half - geometry.angle_min) / increment));
    const int end = whole(std::floor((bearing + half - geometry.angle_min) / increment)) + 1;
    for (int beam = max(first, 0); beam < min(end, ranges.size()); ++beam) {
        const double away = bearing_of(geometry, beam) - bearing;
        const double side = far * fg::sin(away);
        const double near = far * fg::cos(away) - std::sqrt(max(radius * radius - side * side, 0.0));
        ranges[beam] = min(ranges[beam], max(near, least_range));
    }
}

// Shorten beams to a car at a place [m] with a heading [rad]: three discs, as wide as it is.
void draw_car(const ScanGeometry& geometry, Row<double> ranges, std::array<double, 3> pose, const CarParameters& car,
              double margin) {
    const auto [ahead, left, heading] = pose;
    const double radius = 0.5 * car.width + margin, reach = 0.5 * car.length - 0.5 * car.width;
    for (int index = -1; index < 2; ++index)
        draw_disc(geometry, ranges, ahead + index * reach * fg::cos(heading), left + index * reach * fg::sin(heading),
                  radius);
}

// Shorten beams (n,) [m] to what stands and may be a car, once cars have been `met`: a box is less than all of it.
// `margin` [m] is round a car whose heading is known.
void draw_standing(Racing& memory, const ScanGeometry& geometry, Row<double> ranges, const CarParameters& parameters,
                   double margin) {
    const OtherCars& seen = memory.seen;
    for (const CarSeen& car : seen.cars) memory.met = memory.met || (car.age > 0 && car.moves);
    if (!memory.met) return;
    for (int k = 0; k < most_cars; ++k) {
        const CarSeen& car = seen.cars[k];
        const auto [ahead, left] = seen_from(seen, car.x, car.y);
        if (car.age >= stands && !car.moves)
            draw_disc(geometry, ranges, ahead, left, standing_radius);
        else if (car.age > 0 && car.moves && memory.passing[k].stood > stands_for)
            draw_car(geometry, ranges, {ahead, left, car.heading - seen.heading}, parameters, margin);
    }
}

// Shorten beams (n,) [m] to the cars that are passed, where the planner's car, at its speed, could meet them.
void draw_cars(const Racing& memory, const ScanGeometry& geometry, Row<double> ranges, double own_speed,
               const CarParameters& car, const OvertakerSettings& settings) {
    for (int k = 0; k < most_cars; ++k) {
        const CarSeen& other = memory.seen.cars[k];
        const Passing& passing = memory.passing[k];
        if (passing.places == 0 || passing.what == Passing::follows) continue;
        double speed = fg::hypot(other.vx, other.vy), time = 0.0, way = 0.0;
        const double step = (speed / settings.braking + settings.least_lead) / stop_steps;
        const bool is_ahead = passing.along > 0.5 * car.length;
        for (int index = 0; index <= stop_steps; ++index) {
            const std::array<double, 3> pose = pose_on(passing, way);
            const double off = fg::hypot(pose[0], pose[1]) - own_speed * time;
            if ((index == stop_steps && is_ahead) || std::abs(off) < car.length)
                draw_car(geometry, ranges, pose, car, settings.car_margin);
            way += step * speed;
            time += step;
            if (time > settings.least_lead) speed = max(speed - step * settings.braking, 0.0);
        }
    }
}

// Predict what crosses the car's way and is no part of what may be a car; return whether there is something.
bool leave_cars_out(const OtherCars& memory, Predictions& predictions) {
    Targets& seen = predictions.targets;
    const double cos = fg::cos(seen.heading), sin = fg::sin(seen.heading);
    for (Target& target : seen.targets) {
        if (target.age == 0 || !target.moves) continue;
        const double along = std::abs(cos * target.vx + sin * target.vy);
        bool of_car =
            target.size < 0.5 * widest_box || along > mostly_along * fg::hypot(target.vx, target.vy);
        const auto [x, y] = position_of(seen, target);
        for (const CarSeen& car : memory.cars) {
            const auto [ahead, left] = seen_from(memory, car.x, car.y);
            of_car = of_car || (car.age > 0 && fg::hypot(ahead - x, left - y) < of_car_radius);
        }
        if (of_car) target.moves = false;
    }
    return write_predictions(predictions);
}

// Lengthen beams (n,) [m], `increment` [rad] apart, to the straight line between the ends of their neighbours.
void lengthen(Row<double> ranges, int first, int last, double increment) {
    int before = max(first - 1, 0), after = min(last + 1, ranges.size() - 1);
    if (before == first)  // at the end of the scan: as far as the one to the other side
        before = after;
    else if (last == after)
        after = before;
    for (int beam = first; beam <= last; ++beam) {
        const double left = (after - beam) * increment, right = (beam - before) * increment;
        const double inverse = fg::sin(left) / max(ranges[before], least_range) +
                               fg::sin(right) / max(ranges[after], least_range);
        const double between = after > before ? fg::sin(left + right) / inverse : ranges[after];
        ranges[beam] = max(ranges[beam], between);
    }
}

// Return whether a beam ends round a place ahead and to the left of the LiDAR [m] where it ends on a car.
bool ends_near(const ScanGeometry& geometry, Numbers ranges, int beam, double ahead, double left) {
    const double bearing = bearing_of(geometry, beam), distance = ranges[beam];
    return fg::hypot(distance * fg::cos(bearing) - ahead, distance * fg::sin(bearing) - left) < hidden;
}

// Write the scans of a tick in which the planner sees, and return the greatest speed [m/s], and whether there is a car.
std::tuple<double, bool> look_out(const Tick& tick, OvertakerState& state) {
    const ScanGeometry& geometry = tick.geometry;
    const Odometry& odometry = tick.odometry;
    const CarParameters& car = tick.driver.car;
    const OvertakerSettings& settings = state.settings;
    Racing& memory = state.memory;
    Predictions& predictions = tick.memory.predictions;
    const Row<double> drawn = tick.ranges, without = tick.ranges_without_cars;
    double limit = inf;
    bool among;
    if (is_told(memory.told, odometry)) {
        among = follow_told(memory.seen, memory.told, geometry, drawn, odometry, car);
    } else {
        memory.told.follows = false;
        among = watch_cars(memory.seen, geometry, drawn, odometry, car.lidar_offset);
    }
    draw_standing(memory, geometry, drawn, car, settings.car_margin);
    copy_ranges(without, drawn);
    if (among) {
        hide_cars(memory, geometry, without);
        copy_ranges(drawn, without);
        limit = choose(memory, geometry, without, car, settings);
        draw_cars(memory, geometry, drawn, odometry.speed, car, settings);
    }
    const bool moves = track(geometry, without, odometry, tick.driver, predictions);
    if (among) copy_ranges(tick.ranges_without_movers, without);
    if (moves && leave_cars_out(memory.seen, predictions)) {
        separate(geometry, without, tick.ranges_without_movers, predictions);
        hide_targets(predictions.targets, drawn);
    }
    if (among && tick.driver.prediction) predict_cars(memory, car, settings.braking, predictions);
    return {limit, among};
}

}  // namespace

void overtake(const Tick& tick, OvertakerState& state) {
    const Row<double> drawn = tick.ranges, without = tick.ranges_without_cars;
    const OvertakerSettings& settings = state.settings;
    copy_ranges(without, drawn);
    const auto [limit, among] = sees(tick.geometry, drawn) ? look_out(tick, state) : std::tuple(inf, false);
    refer_to<GapFinderSettings>(tick, settings.gap_finder, gap_finder_goal);
    tick.reference.limit = limit;
    if (among) {
        take_lane(state.memory, tick.odometry.speed, tick.driver, settings, tick.reference);
        if (tick.reference.lane_points > 0) copy_ranges(drawn, without);
    }
}

void hide_cars(const Racing& memory, const ScanGeometry& geometry, Row<double> ranges) {
    const OtherCars& seen = memory.seen;
    for (int index = 0; index < most_cars; ++index) {
        const CarSeen& car = seen.cars[index];
        if (car.age == 0 || !car.moves || memory.passing[index].stood > stands_for) continue;
        const auto [ahead, left] = seen_from(seen, car.x, car.y);
        const double far = fg::hypot(ahead, left), increment = geometry.angle_increment;
        const int middle = whole(std::nearbyint((fg::atan2(left, ahead) - geometry.angle_min) / increment));
        const int half = whole(std::ceil(fg::asin(min(hidden / max(far, hidden), 1.0)) / increment));
        const int first = max(middle - half, 0), end = min(middle + half + 1, ranges.size());
        for (int beam = first; beam < end; ++beam) {
            if (!ends_near(geometry, ranges, beam, ahead, left)) continue;
            int last = beam;
            while (last + 1 < end && ends_near(geometry, ranges, last + 1, ahead, left)) ++last;
            lengthen(ranges, beam, last, increment);
            beam = last;
        }
    }
}

}  // namespace fg
