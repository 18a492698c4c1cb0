// Runs of beams that stand out, followed from scan to scan.
#include "other_cars.hpp"

#include "../../controllers/control/steering.hpp"
#include "../../controllers/perception/scan_filters.hpp"
#include "../../core/numbers.hpp"
#include "../../core/transcendental.hpp"

namespace fg {
namespace {

constexpr double behind = 0.06;            // [m] from the middle of what is seen of a box to its own middle
constexpr double farthest = 9.0;           // [m] at which beams are looked at
constexpr double least_edge = 0.12;        // [m] by which a run ends nearer than the neighbouring beams, at least
constexpr double least_width = 0.085;      // [m] of a run: a wheel, seen when the planner's car pitches, is less wide
constexpr double next = 0.45;              // [m] by which the neighbour may be nearer: another part of the same car
constexpr double gate = 0.35;              // [m] from where a thing is expected to where it is seen
constexpr std::int64_t least_age = 5;      // sightings
constexpr double least_speed = 0.5;        // [m/s]
constexpr double moved = 0.2;              // [m]
constexpr double forgotten = 0.8;          // [s]
constexpr double forgotten_in_view = 0.1;  // [s] the same, of one that would be seen there
constexpr double near_by = 1.2;            // [m]: of a car that is nearer, parts are seen, and its box may be missed;
constexpr double forgotten_near = 0.4;     // [s] the same of such a car
constexpr double rim = 0.25;     // [rad] from the end of the view: a car that is expected there may still be behind it
constexpr double slowing = 0.93;           // of its speed, in each tick
constexpr double part = 0.5;               // [m] from the middle of a car: what is found there is a part of it
constexpr double least_alpha = 0.5, least_beta = 0.13;  // gains
constexpr double most_jump = 0.05;     // [m] from where it is expected: what is further counts as this far
constexpr double turning = 0.12;       // gain of the turn rate
constexpr std::int64_t steady = 8;     // sightings after which it is known where a thing goes
constexpr double fastest_turn = 3.0;   // [rad/s]
constexpr double oldest = 0.5;         // [s] of odometry that was told
constexpr double reached = 0.4;        // [m] from the middle of a car: a beam that ends there ends on it
constexpr int most_found = 16;         // runs of a scan that are kept
constexpr double least_noise = 0.005;  // [m] standard deviation of a range
constexpr double cut = 4.0, certain = 5.0;    // standard deviations: of a run's end, and of an edge there
constexpr double faster = 3.0, farther = 6.0;  // the same: of the speed and of the way of what moves

// A scan, and the runs that were found in it.
struct Scan {
    const ScanGeometry& geometry;
    Numbers ranges;
    double noise;         // [m]
    Table<double> found;  // (k, 2) places [m]; one that something has taken is NaN
};

double fourth_power(double value) { return value * value * (value * value); }

void forget(OtherCars& memory) {
    for (CarSeen& car : memory.cars) car.age = 0;
}

// Go on by dead reckoning; return false, and forget all cars, where it is no odometry.
bool move(OtherCars& memory, const Odometry& odometry, double period, double lidar_offset) {
    const double way = odometry.speed * period, turn = odometry.angular_velocity[2] * period;
    if (!(std::abs(way) + std::abs(turn) < 10.0)) {
        forget(memory);
        return false;
    }
    const double x =
        memory.x - lidar_offset * fg::cos(memory.heading) + way * fg::cos(memory.heading + 0.5 * turn);
    const double y =
        memory.y - lidar_offset * fg::sin(memory.heading) + way * fg::sin(memory.heading + 0.5 * turn);
    memory.heading += turn;
    memory.x = x + lidar_offset * fg::cos(memory.heading), memory.y = y + lidar_offset * fg::sin(memory.heading);
    return true;
}

// Return a place for one more car; -1: there is none.
std::int64_t free_place(const OtherCars& memory) {
    for (int index = 0; index < most_cars; ++index)
        if (memory.cars[index].age == 0) return index;
    return -1;
}

// Return whether neither neighbour of a run of beams ends on the straight line through the run.
//
// Where a wall is seen at a small angle, noise cuts short runs off it, which go along with the car. The line is that
// of least squares; of a single beam, the one that is as steep as that through its neighbours.
bool ends_at_edges(Numbers ranges, std::int64_t first, std::int64_t last, double noise) {
    const std::int64_t count = last - first + 1;
    const double off = 0.5 * (count + 1);
    const double spread = count > 1 ? count * (count * count - 1) / 12.0 : 2.0;  // sum of squared distances [beams^2]
    double mean = 0.0, slope = 0.0;                                             // of 1 / range
    for (std::int64_t beam = first; beam <= last; ++beam) {
        mean += 1.0 / max(ranges[beam], least_range) / count;
        slope += (beam - 0.5 * (first + last)) / max(ranges[beam], least_range) / spread;
    }
    if (count == 1)
        slope = (1.0 / max(ranges[last + 1], least_range) - 1.0 / max(ranges[first - 1], least_range)) / spread;
    const double of_line = (1.0 / count + off * off / spread) * fourth_power(mean);
    for (const int side : {-1, 1}) {
        const double inverse = 1.0 / max(ranges[side > 0 ? last + 1 : first - 1], least_range);
        const double apart = inverse - mean - side * off * slope;
        if (apart * apart < certain * certain * noise * noise * (of_line + fourth_power(inverse))) return false;
    }
    return true;
}

// Return the bearing of a car [rad].
double bearing_to(const OtherCars& memory, const CarSeen& car) {
    return within_turn(fg::atan2(car.y - memory.y, car.x - memory.x) - memory.heading);
}

// Return whether there is a beam at a bearing [rad], and it ends beyond a distance [m].
bool ends_beyond(const ScanGeometry& geometry, Numbers ranges, double bearing, double distance) {
    const double place = std::nearbyint((bearing - geometry.angle_min) / geometry.angle_increment);
    return 0.0 <= place && place < ranges.size() && ranges[static_cast<int>(place)] > distance;
}

// Keep a thing that is not seen for a while.
void miss(const OtherCars& memory, CarSeen& car, const Scan& scan, double period) {
    car.unseen += period;
    double patience = car.moves ? forgotten : forgotten_in_view;
    const double far = fg::hypot(car.x - memory.x, car.y - memory.y), bearing = bearing_to(memory, car);
    if (car.moves && ends_beyond(scan.geometry, scan.ranges, bearing, far)) {  // it would be seen
        const double last = bearing_of(scan.geometry, scan.ranges.size() - 1);
        if (std::abs(bearing) > min(-scan.geometry.angle_min, last) - rim) {
            car.x -= car.vx * period;  // it has not come into view yet, and so is slower
            car.y -= car.vy * period;
            car.vx *= slowing;
            car.vy *= slowing;
        } else {
            patience = far < near_by ? forgotten_near : forgotten_in_view;
        }
    }
    if (car.unseen > patience) car.age = 0;
}

// Take a thing on to where it is seen, `apart` [m] from where it was expected, and find out whether it moves.
void sight(CarSeen& car, Row<double> place, double apart, double noise, double period) {
    ++car.age;
    car.unseen = 0.0;
    const double sightings = static_cast<double>(car.age);
    const double alpha = max(2.0 * (2.0 * sightings - 1.0) / (sightings * (sightings + 1.0)), least_alpha);
    const double beta = max(6.0 / (sightings * (sightings + 1.0)), least_beta);
    double dx = place[0] - car.x, dy = place[1] - car.y;
    place[0] = nan;
    if (car.age > steady && apart > most_jump)  // another part of it is seen
        dx = dx * most_jump / apart, dy = dy * most_jump / apart;
    car.x += alpha * dx;
    car.y += alpha * dy;
    car.vx += beta * dx / period;
    car.vy += beta * dy / period;
    const double speed = fg::hypot(car.vx, car.vy);
    if (!(speed > least_speed)) return;
    const double heading = fg::atan2(car.vy, car.vx), turn = within_turn(heading - car.heading);
    if (car.age > steady) car.turn_rate += turning * (saturate(turn / period, fastest_turn) - car.turn_rate);
    car.heading = heading;
    const double way = fg::hypot(car.x - car.first_x, car.y - car.first_y);
    const double of_speed = noise / period * beta * std::sqrt(2.0 / (alpha * (4.0 - 2.0 * alpha - beta)));  // noise
    const bool surely = speed > least_speed + faster * of_speed && way > max(moved, farther * noise);
    car.moves = car.moves || (car.age >= least_age && surely);
}

// Take a thing on by one tick, and to the nearest place that was found; what it may have is taken from there.
void follow(OtherCars& memory, CarSeen& car, const Scan& scan, double period) {
    car.x += car.vx * period;
    car.y += car.vy * period;
    std::int64_t nearest = -1;
    double least = gate;
    for (std::int64_t k = 0; k < scan.found.rows; ++k) {
        const double apart = fg::hypot(scan.found[k][0] - car.x, scan.found[k][1] - car.y);
        if (apart < least) nearest = k, least = apart;
    }
    if (nearest < 0) {
        miss(memory, car, scan, period);
        return;
    }
    sight(car, scan.found[nearest], least, scan.noise, period);
    if (!car.moves) return;
    for (std::int64_t k = 0; k < scan.found.rows; ++k)
        if (fg::hypot(scan.found[k][0] - car.x, scan.found[k][1] - car.y) < part) scan.found[k][0] = nan;
    for (CarSeen& other : memory.cars)
        if (other.age > 0 && other.age < car.age && fg::hypot(other.x - car.x, other.y - car.y) < part) other.age = 0;
}

// Follow a thing at a place [m] that is new, if there is room for one.
void begin(OtherCars& memory, double x, double y) {
    const std::int64_t place = free_place(memory);
    if (place >= 0) memory.cars[place] = {.age = 1, .x = x, .y = y, .first_x = x, .first_y = y};
}

// Write a car as it was told.
void write_told(const OtherCars& memory, CarSeen& other, std::array<double, 2> place, double towards,
                const ToldCar& told) {
    const auto [ahead, left] = place;
    other.age = steady + 1, other.moves = true, other.unseen = 0.0;
    other.x = memory.x + fg::cos(memory.heading) * ahead - fg::sin(memory.heading) * left;
    other.y = memory.y + fg::sin(memory.heading) * ahead + fg::cos(memory.heading) * left;
    other.first_x = other.x, other.first_y = other.y;
    other.vx = told.speed * fg::cos(towards), other.vy = told.speed * fg::sin(towards);
    other.heading = towards, other.turn_rate = told.yaw_rate;
}

}  // namespace

bool watch_cars(OtherCars& memory, const ScanGeometry& geometry, Numbers ranges, const Odometry& odometry,
                double lidar_offset) {
    const double period = period_of(geometry);
    if (!move(memory, odometry, period, lidar_offset)) return false;
    double places[most_found][2];
    Scan scan{geometry, ranges, noise_of(ranges, geometry.range_max), table(places)};
    scan.found.rows = find_boxes(geometry, ranges, max(scan.noise, least_noise), scan.found);
    const double cos = fg::cos(memory.heading), sin = fg::sin(memory.heading);
    for (std::int64_t k = 0; k < scan.found.rows; ++k) {
        const double ahead = places[k][0], left = places[k][1];
        places[k][0] = memory.x + cos * ahead - sin * left, places[k][1] = memory.y + sin * ahead + cos * left;
    }
    bool any_moves = false;
    for (const bool moves : {true, false})  // cars first: what is seen near one is a part of it
        for (CarSeen& car : memory.cars)
            if (car.age > 0 && car.moves == moves) {
                follow(memory, car, scan, period);
                any_moves = any_moves || (car.moves && car.age > 0);
            }
    for (std::int64_t k = 0; k < scan.found.rows; ++k)
        if (!std::isnan(places[k][0])) begin(memory, places[k][0], places[k][1]);
    return any_moves;
}

bool is_told(const Told& told, const Odometry& odometry) {
    const double age = odometry.stamp - told.stamp, own = odometry.pose[0] + odometry.pose[1] + odometry.pose[2];
    return told.stamp > 0.0 && 0.0 <= age && age < oldest && std::isfinite(own);
}

bool follow_told(OtherCars& memory, Told& told, const ScanGeometry& geometry, Numbers ranges, const Odometry& odometry,
                 const CarParameters& car) {
    const double period = period_of(geometry), age = odometry.stamp - told.stamp;
    if (!move(memory, odometry, period, car.lidar_offset)) {
        told.follows = false;
        return false;
    }
    if (!told.follows) {
        forget(memory);
        for (std::int64_t& place : told.places) place = 0;
        told.follows = true;
    }
    const auto [own_x, own_y, own_heading] = odometry.pose;
    const double cos = fg::cos(own_heading), sin = fg::sin(own_heading);
    const double to_middle = 0.5 * car.length - car.rear_overhang;
    bool any_there = false;
    for (int k = 0; k < most_others; ++k) {
        const auto& [x, y, heading, speed, yaw_rate] = told.cars[k];
        const double way = speed * age, turn = yaw_rate * age;
        const double dx =
            x + way * fg::cos(heading + 0.5 * turn) + to_middle * fg::cos(heading + turn) - own_x;
        const double dy =
            y + way * fg::sin(heading + 0.5 * turn) + to_middle * fg::sin(heading + turn) - own_y;
        const double ahead = cos * dx + sin * dy - car.lidar_offset, left = cos * dy - sin * dx;
        const double far = fg::hypot(ahead, left), bearing = fg::atan2(left, ahead);
        const bool in_sight = far < farthest && ends_beyond(geometry, ranges, bearing, far - reached);
        told.unseen[k] = in_sight ? 0.0 : told.unseen[k] + period;
        const bool near = far < near_by && !ends_beyond(geometry, ranges, bearing, -inf);
        std::int64_t place = told.places[k] - 1;
        const bool stays = told.unseen[k] == 0.0 || (place >= 0 && (told.unseen[k] <= forgotten || near));
        if (!(stays && std::isfinite(ahead + left + speed + yaw_rate))) {
            if (place >= 0) memory.cars[place].age = 0;
            told.places[k] = 0;
            continue;
        }
        if (place < 0) {
            place = free_place(memory);
            if (place < 0) continue;
            told.places[k] = place + 1;
        }
        const double towards = heading + turn - own_heading + memory.heading;
        write_told(memory, memory.cars[place], {ahead, left}, towards, told.cars[k]);
        any_there = true;
    }
    return any_there;
}

std::int64_t find_boxes(const ScanGeometry& geometry, Numbers ranges, double noise, Table<double> found) {
    const double edge = max(least_edge, cut * std::sqrt(2.0) * noise);
    std::int64_t count = 0, first = 0;  // of the run that has not ended,
    double before = -inf;               // and the step that it began with
    for (std::int64_t beam = 1; beam < ranges.length; ++beam) {
        const double step = ranges[beam] - ranges[beam - 1];
        if (std::abs(step) <= edge) continue;
        const std::int64_t last = beam - 1;
        const double width = (last - first + 1) * geometry.angle_increment * 0.5 * (ranges[first] + ranges[last]);
        const bool stands_out = first > 0 && before < next && step > -next && (before < 0.0 || step > 0.0);
        const bool is_box = stands_out && ranges[first] < farthest && least_width < width && width < widest_box &&
                            count < found.rows;
        if (is_box && ends_at_edges(ranges, first, last, noise)) {
            const double bearing = bearing_of(geometry, 0.5 * (first + last));
            const double distance = ranges[(first + last) / 2] + behind;
            found[count][0] = distance * fg::cos(bearing), found[count][1] = distance * fg::sin(bearing);
            ++count;
        }
        first = beam, before = step;
    }
    return count;
}

std::array<double, 2> seen_from(const OtherCars& memory, double x, double y) {
    const double cos = fg::cos(memory.heading), sin = fg::sin(memory.heading);
    const double dx = x - memory.x, dy = y - memory.y;
    return {cos * dx + sin * dy, cos * dy - sin * dx};
}

}  // namespace fg
