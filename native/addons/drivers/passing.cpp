// Decisions about cars, one at a time, and the lane beside one.
#include "passing.hpp"

#include <tuple>

#include "../../controllers/control/slip.hpp"
#include "../../controllers/control/steering.hpp"
#include "../../controllers/control/tracking.hpp"
#include "../../core/numbers.hpp"
#include "../../core/transcendental.hpp"

namespace fg {
namespace {

constexpr double braking_time = 0.1;  // [s] until the car brakes after another
constexpr double standing = 0.35;     // [m/s] of a car that may stand for good
constexpr double passed_by = 0.4;     // [m] from bumper to bumper behind the car, up to which another matters
constexpr double predicted = 0.8;     // [s] for which the curvature of the other car's way is its mean
constexpr double least_sight = 0.9, sight_time = 0.25;  // [m] and [s] of the way at its speed: how far a lane is seen
constexpr double lane_step = 0.2;                       // [m] between places of the motion,
constexpr int least_lane = 3;                           // and the fewest of them
constexpr double grip = 0.8, slowing = 0.4;  // shares of the grip for cornering on the motion, and for braking before
constexpr double longest = 5.0;              // [s] of a pass before the car is beside the other one
constexpr double held = 0.85;  // of its speed is left when another car begins to brake before the car has passed
constexpr double spread = 0.15;  // [m/s] uncertainty of its speed

// Return the least room to the left and to the right of the other car on its way [m]; 0: it is not seen so far.
std::array<double, 2> rooms_on(const Passing& passing, double way, const CarParameters& car) {
    const int last = whole(std::ceil(way / walk_step));
    if (last >= passing.places) return {0.0, 0.0};
    double left = inf, right = inf;
    for (int k = 0; k <= last; ++k) left = min(left, passing.way[k].left), right = min(right, passing.way[k].right);
    return {left - 0.5 * car.width, right - 0.5 * car.width};
}

// Decide what to do about a car.
void choose_one(Passing& passing, double gap, const CarParameters& car, const OvertakerSettings& settings) {
    const double along = passing.along, across = passing.across;
    if (along < -car.length - passed_by) {
        passing.what = Passing::follows;
        return;
    }
    const bool is_beside = std::abs(along) < car.length;
    if (passing.what == Passing::follows && is_beside && std::abs(across) > car.width)
        passing.what = Passing::passes, passing.side = across > 0.0 ? 1 : -1;
    const double meanwhile = passing.speed * max(along + car.length, 0.0) / settings.closing;
    const std::array<double, 2> rooms = rooms_on(passing, min(meanwhile, (most_places - 1) * walk_step), car);
    if (passing.what != Passing::follows && is_beside && std::abs(across) > 0.5 * car.width)
        passing.side = across > 0.0 ? 1 : -1;
    const double need = settings.room_to_pass + settings.room_by_speed * passing.speed;
    if (passing.what == Passing::follows) {
        const int side =
            rooms[0] + (across > 0.0 ? 0.1 : 0.0) >= rooms[1] + (across < 0.0 ? 0.1 : 0.0) ? 0 : 1;
        if (gap < settings.look_at && rooms[side] >= need && passing.waits == 0.0)
            passing.what = Passing::passes, passing.side = 1 - 2 * side;
        return;
    }
    if (passing.what == Passing::passes) {
        const double room = passing.side > 0 ? rooms[0] : rooms[1];
        const bool too_narrow = along > 0.5 * car.length && room < settings.room_to_go_on;
        const bool too_near = is_beside && std::abs(across) < car.width + settings.car_margin && along > 0.0;
        const bool too_long = passing.lasts > longest;  // on the other side there may be more room
        if (too_narrow || too_near || too_long) passing.what = Passing::drops_back, passing.waits = settings.patience;
    }
    if (passing.what == Passing::drops_back && along > 1.1 * car.length) passing.what = Passing::follows;
}

// Return the greatest speed next to a car, or behind it [m/s].
double speed_beside(const Passing& passing, double gap, const CarParameters& car, const OvertakerSettings& settings) {
    if (passing.along < -0.5 * car.length) return inf;
    const double clear = settings.clear + settings.clear_by_speed * passing.speed;
    if (passing.what == Passing::passes && std::abs(passing.across) > car.width + clear) {
        if (passing.along < car.length) return passing.speed + settings.closing;
        const double room = max(gap - settings.behind, 0.0);
        return held * passing.speed + max(settings.closing, std::sqrt(2.0 * settings.slowing * room));
    }
    if (passing.what == Passing::drops_back)
        gap = passing.along - car.length;
    else if (passing.along < 0.0)
        return inf;
    const double slowed = settings.slowing * braking_time;
    const double stop = settings.slowing / settings.braking * passing.speed * passing.speed;
    const double square = slowed * slowed + 2.0 * settings.slowing * (gap - settings.behind) + stop;
    return max(std::sqrt(max(square, 0.0)) - slowed, 0.0);
}

// Return the nearest car that is passed; null: none is.
const Passing* nearest_passed(const Racing& memory) {
    const Passing* nearest = nullptr;
    double least = inf;
    for (const Passing& passing : memory.passing)
        if (passing.places > 0 && passing.what != Passing::follows && std::abs(passing.along) < least)
            nearest = &passing, least = std::abs(passing.along);
    return nearest;
}

// Write the places (k, 2) of the lane beside a car, in the frame of the rear axle.
void write_lane(const Passing& passing, const CarParameters& car, const OvertakerSettings& settings,
                Table<double> points) {
    const double widest =
        max(settings.aside + 0.5 * car.width, std::abs(passing.across) - 0.5 * car.width);
    for (std::int64_t k = 0; k < points.rows; ++k) {
        const WalkPlace& place = passing.way[k];
        const double room = (passing.side > 0 ? place.left : place.right) - 0.5 * car.width;
        const double away = max(0.5 * room, room - settings.beside_wall - 0.5 * car.width);
        const double off = passing.side * (0.5 * car.width + min(away, widest));
        points[k][0] = place.x - off * fg::sin(place.heading) + car.lidar_offset;
        points[k][1] = place.y + off * fg::cos(place.heading);
    }
}

// Write the motion (n, 4) to a lane; return its places, and the greatest square of the speed on it [m^2/s^2].
std::tuple<std::int64_t, double> write_motion(Matrix points, double own_speed, const Driver& driver,
                                              Table<double> motion) {
    double sharpest = fg::tan(driver.car.max_steering_angle) / driver.car.wheelbase;
    const double lateral = grip * driver.limiter.lateral;
    if (driver.has_limiter) sharpest = min(sharpest, lateral / max(own_speed * own_speed, 0.01));
    const double sight = max(least_sight, sight_time * own_speed);
    double x = 0.0, y = 0.0, heading = 0.0, square = inf;
    std::int64_t first = 0, count = 0;
    for (; count < motion.rows; ++count) {
        const double cos = fg::cos(heading), sin = fg::sin(heading);
        double ahead = 0.0, left = 0.0;
        for (; first < points.rows; ++first) {
            const double dx = points[first][0] - x, dy = points[first][1] - y;
            ahead = cos * dx + sin * dy, left = cos * dy - sin * dx;
            if (ahead > 0.0 && ahead * ahead + left * left >= sight * sight) break;
        }
        if (first == points.rows) break;
        const double wanted = 2.0 * left / (ahead * ahead + left * left), curvature = saturate(wanted, sharpest);
        x += lane_step * fg::cos(heading + 0.5 * curvature * lane_step);
        y += lane_step * fg::sin(heading + 0.5 * curvature * lane_step);
        heading += curvature * lane_step;
        if (driver.has_limiter && wanted != 0.0) {
            const double before = 2.0 * slowing * driver.limiter.braking * count * lane_step;
            square = min(square, lateral / std::abs(wanted) + before);
        }
        const Row<double> place = motion[count];
        place[motion_x] = x, place[motion_y] = y, place[motion_heading] = heading;
        place[motion_curvature] = curvature;
    }
    return {count, square};
}

}  // namespace

double choose(Racing& memory, const ScanGeometry& geometry, Numbers without, const CarParameters& car,
              const OvertakerSettings& settings) {
    double places[most_points][2], limit = inf;
    Table<double> points = table(places);
    points.rows = ground_points(geometry, without, points);
    OtherCars& seen = memory.seen;
    const double to_middle = car.lidar_offset - (0.5 * car.length - car.rear_overhang), period = period_of(geometry);
    for (int k = 0; k < most_cars; ++k) {
        CarSeen& other = seen.cars[k];
        Passing& passing = memory.passing[k];
        const bool slow = other.age > 0 && fg::hypot(other.vx, other.vy) < standing;
        passing.stood = slow ? passing.stood + period : 0.0;
        if (other.age == 0 || !other.moves || passing.stood > stands_for) {
            passing.what = Passing::follows;
            passing.places = 0;
            passing.waits = 0.0;
            continue;
        }
        const auto [x, y] = seen_from(seen, other.x, other.y);
        const double heading = within_turn(other.heading - seen.heading);
        passing.places = walk(points, x, y, heading, row(passing.way));
        if (other.unseen > 0.0 && passing.places > 2) {  // it follows the course
            const double towards = seen.heading + passing.way[1].heading, fast = fg::hypot(other.vx, other.vy);
            other.vx = fast * fg::cos(towards), other.vy = fast * fg::sin(towards), other.heading = towards;
        }
        const double between = 0.5 * heading;  // a car that has turned into the next corner is ahead
        const double dx = x + to_middle;
        passing.along = fg::cos(between) * dx + fg::sin(between) * y;
        passing.across = fg::sin(between) * dx - fg::cos(between) * y;
        passing.speed = max(fg::hypot(other.vx, other.vy) * fg::cos(between), 0.0);
        const double gap = fg::hypot(dx, y) - car.length;
        passing.waits = max(passing.waits - period, 0.0);
        const bool still_behind = passing.what == Passing::passes && passing.along > car.length;
        passing.lasts = still_behind ? passing.lasts + period : 0.0;
        choose_one(passing, gap, car, settings);
        limit = min(limit, speed_beside(passing, gap, car, settings));
    }
    return limit;
}

void predict_cars(const Racing& memory, const CarParameters& car, double braking, Predictions& predictions) {
    for (int k = 0; k < most_cars; ++k) {
        const CarSeen& other = memory.seen.cars[k];
        const Passing& passing = memory.passing[k];
        if (passing.places == 0 || passing.along < -0.25 * car.length) continue;
        const double speed = fg::hypot(other.vx, other.vy);
        const std::int64_t last =
            min(passing.places - 1, static_cast<std::int64_t>(max(whole(predicted * speed / walk_step), 2)));
        const WalkPlace& here = passing.way[0];
        double curvature = 0.0;
        if (last > 0) curvature = (passing.way[last].heading - here.heading) / (last * walk_step);
        const double reach = 0.5 * car.length - 0.5 * car.width;
        for (int index = -1; index < 2; ++index) {
            Prediction& disc = prediction(table(predictions.rows)[predictions.count++]);
            ++predictions.cars;
            disc.x = here.x + index * reach * fg::cos(here.heading);
            disc.y = here.y + index * reach * fg::sin(here.heading);
            disc.cos = fg::cos(here.heading), disc.sin = fg::sin(here.heading);
            disc.speed = speed, disc.radius = 0.5 * car.width;
            disc.to_wall = inf, disc.braking = braking;
            disc.spread = speed > standing ? spread : 0.0;
            disc.curvature = curvature;
        }
    }
}

std::array<double, 3> pose_on(const Passing& passing, double way) {
    const std::int64_t first = min(static_cast<std::int64_t>(whole(way / walk_step)), passing.places - 1);
    const WalkPlace& place = passing.way[first];
    const double beyond = way - first * walk_step;
    return {place.x + beyond * fg::cos(place.heading), place.y + beyond * fg::sin(place.heading), place.heading};
}

void take_lane(const Racing& memory, double own_speed, const Driver& driver, const OvertakerSettings& settings,
               Reference& reference) {
    const Passing* const passing = nearest_passed(memory);
    if (passing == nullptr) return;
    const CarParameters& car = driver.car;
    double places[most_places][2];
    const Table<double> points{&places[0][0], passing->places, 2};
    write_lane(*passing, car, settings, points);
    Table<double> lane = table(reference.lane);
    const auto [count, square] = write_motion(points, own_speed, driver, lane);
    if (count < least_lane) return;
    reference.lane_points = lane.rows = count;
    const double path_late = late_on_path(driver.limiter.slip, car, own_speed);
    reference.steering_angle =
        steer_along(lane, 0, {0.0, 0.0, 0.0}, own_speed, car.wheelbase, late_by(car), path_late);
    const double ahead = lane[count - 1][motion_x] - car.lidar_offset, left = lane[count - 1][motion_y];
    reference.bearing = fg::atan2(left, ahead);
    reference.distance = fg::hypot(left, ahead);
    reference.speed = min(std::sqrt(square), driver.max_speed);
}

}  // namespace fg
