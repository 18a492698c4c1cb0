#include "lap_map.hpp"

#include <algorithm>
#include <cmath>

#include "../../core/numbers.hpp"
#include "../../core/transcendental.hpp"

namespace fg {
namespace {

constexpr double spacing = 0.5;  // [m] of places
constexpr double too_far = 8.0;  // [m] readings from here on are not used
constexpr int most = 255;        // of a byte: a reading from `too_far` on

constexpr int first_place = 2, last_place = 20;  // at which the lap may close
constexpr int least_lap = 16;                    // places of a lap
// [m] and share of the way: how far dead reckoning may be off when the lap closes.
constexpr double most_off = 1.0, most_off_share = 0.02;
constexpr double most_turned = 0.6;   // [rad] of the car from a place, within which a scan is matched with it
constexpr double heading_off = 0.15;  // [rad] by which dead reckoning may have turned too far
// [m] beside each of the first places, from the second to the first time: later ones may be further off.
constexpr double most_beside = 0.1;
constexpr int closing_steps = 20;  // of matching when the lap closes
// Share of the beams that fit: from which on a lap closes; below which the car is lost.
constexpr double closes = 0.7, least_fits = 0.4;
constexpr double newest_share = 0.1;  // of the newest tick in the mean of the beams that fit
constexpr double lost = 4.0;          // [m] from the nearest place, beyond which the car is lost
constexpr double longest_piece = 0.8;  // [m] of wall at most between a point's neighbours
constexpr double straight = 0.04;      // [m] of a point from the line through its neighbours
constexpr int places_behind = 3, places_ahead = 8;  // round the last nearest one
constexpr int side_behind = 4, side_ahead = 20;  // places round one, to whose path the ends of its beams are compared
constexpr double turn_counts = 0.7;  // [m/rad] so that the nearest place goes round a hairpin with the car

// A match: distance beyond which a point does not fit [m], and weights of the dead reckoning, in points and points
// times m^2: readings err by 0.03 m, its shift in a tick by 0.02 m and its turn by 0.005 rad; when a lap closes, by far
// more.
struct Match {
    double gate, shift, turn;
};
constexpr Match tick_match{0.25, 2.0, 40.0}, first_match{0.6, 0.1, 0.5}, closing_match{0.25, 0.1, 0.5};

struct Pose {
    double x, y, heading;  // [m], [m], [rad]
};

struct Direction {
    double x, y;
};

// Cosine and sine of the bearings of the beams that are kept of a scan.
using Directions = std::array<Direction, lap_beams>;

// Return which of the beams of a scan is kept as one of `lap_beams`.
std::int64_t beam_of(std::int64_t beam, std::int64_t count) {
    const std::int64_t whole = beam * (count - 1);
    return (whole < 0 ? whole - (lap_beams - 2) : whole) / (lap_beams - 1);
}

// Return the turn from one heading to another, the short way round [rad].
double turn_between(double heading, double other) {
    const double turn = other - heading, whole_turns = std::nearbyint(turn / (2.0 * pi)) + 0.0;  // not -0.0
    return turn - 2.0 * pi * (std::abs(whole_turns) < inf ? whole_turns : 0.0);
}

// Return the number of a place, by that of another one and how many after it.
std::int64_t place_after(const LapMap& lap, std::int64_t place, int more) {
    if (lap.count == 0) return 0;
    const std::int64_t index = (place + more) % lap.count;
    return index < 0 ? index + lap.count : index;
}

// Add the car's place where it is far enough from the last one, and return whether it was added.
bool record(LapMap& lap, Numbers ranges, double speed) {
    const double cos = fg::cos(lap.heading), sin = fg::sin(lap.heading);
    while (speed < 0.0 && lap.count > 0) {
        const Row<float> last = row(lap.places[lap.count - 1]);
        if (cos * (last[0] - lap.x) + sin * (last[1] - lap.y) <= 0.0) break;
        --lap.count;
    }
    if (lap.count > 0) {
        const Row<float> last = row(lap.places[lap.count - 1]);
        if (fg::hypot(lap.x - last[0], lap.y - last[1]) < spacing) return false;
    }
    if (lap.count == lap_places || speed < 0.0 || lap.drifts) return false;
    const Row<float> place = row(lap.places[lap.count]);
    place[0] = static_cast<float>(lap.x), place[1] = static_cast<float>(lap.y);
    place[2] = static_cast<float>(lap.heading);
    for (int beam = 0; beam < lap_beams; ++beam) {
        const double share = min(max(ranges[beam_of(beam, ranges.length)], 0.0) / too_far, 1.0);
        lap.ranges[lap.count][beam] = static_cast<std::uint8_t>(whole(std::nearbyint(std::sqrt(share) * most)));
    }
    ++lap.count;
    return true;
}

Directions directions_of(const ScanGeometry& geometry, std::int64_t count) {
    Directions directions;
    for (int beam = 0; beam < lap_beams; ++beam) {
        const double bearing = bearing_of(geometry, static_cast<double>(beam_of(beam, count)));
        directions[beam] = {fg::cos(bearing), fg::sin(bearing)};
    }
    return directions;
}

// Write where the beams kept at a place ended, (lap_beams, 2 or 3); NaN beyond `too_far`.
void write_ends(const LapMap& lap, std::int64_t index, const Directions& directions, double lidar_offset,
                Table<double> ends) {
    const float heading = lap.places[index][2], cos = fg::cos(heading), sin = fg::sin(heading);
    const double x = lap.places[index][0] + lidar_offset * cos, y = lap.places[index][1] + lidar_offset * sin;
    for (int beam = 0; beam < lap_beams; ++beam) {
        const double kept = static_cast<double>(lap.ranges[index][beam]) / most;
        const double distance = kept < 1.0 ? too_far * kept * kept : nan;
        const double ahead = distance * directions[beam].x, left = distance * directions[beam].y;
        ends[beam][0] = x + cos * ahead - sin * left, ends[beam][1] = y + sin * ahead + cos * left;
    }
}

// Return the direction square to the wall at the end of a beam; NaN where that is no straight piece of wall.
Direction across_wall(Matrix ends, int beam) {
    const double along_x = ends[beam + 1][0] - ends[beam - 1][0], along_y = ends[beam + 1][1] - ends[beam - 1][1];
    const double piece = fg::hypot(along_x, along_y);
    if (!(1e-3 < piece && piece < longest_piece)) return {nan, nan};  // nor is NaN
    const double normal_x = -along_y / piece, normal_y = along_x / piece;
    const double off = normal_x * (ends[beam][0] - ends[beam - 1][0]) + normal_y * (ends[beam][1] - ends[beam - 1][1]);
    if (!(std::abs(off) < straight)) return {nan, nan};
    return {normal_x, normal_y};
}

// Solve three normal equations, by elimination; the dead reckoning makes them definite. `right` becomes the solution.
void solve(Table<double> normal, Row<double> right) {
    for (int i = 0; i < 3; ++i)
        for (int j = i + 1; j < 3; ++j) {
            const double factor = normal[j][i] / normal[i][i];
            for (int k = 0; k < 3; ++k) normal[j][k] -= factor * normal[i][k];
            right[j] -= factor * right[i];
        }
    for (int i = 2; i >= 0; --i) {
        for (int j = i + 1; j < 3; ++j) right[i] -= normal[i][j] * right[j];
        right[i] /= normal[i][i];
    }
}

// Return where the car is by the readings at a place, and the share of them that fits. `pose` is where it was taken to
// be.
std::tuple<Pose, double> matched(const LapMap& lap, std::int64_t index, const ScanGeometry& geometry, Numbers ranges,
                                 double lidar_offset, const Pose& pose, const Match& match) {
    double ends_room[lap_beams][2];
    const Table<double> ends = table(ends_room);
    write_ends(lap, index, directions_of(geometry, ranges.length), lidar_offset, ends);
    const auto [x, y, heading] = pose;
    const double cos = fg::cos(heading), sin = fg::sin(heading);
    const double lidar_x = x + lidar_offset * cos, lidar_y = y + lidar_offset * sin;
    double normal[3][3] = {{match.shift, 0.0, 0.0}, {0.0, match.shift, 0.0}, {0.0, 0.0, match.turn}}, right[3] = {};
    int seen = 0, fitting = 0;
    for (int beam = 1; beam < lap_beams - 1; ++beam) {
        const auto [normal_x, normal_y] = across_wall(ends, beam);
        if (std::isnan(normal_x)) continue;
        const double dx = ends[beam][0] - lidar_x, dy = ends[beam][1] - lidar_y;
        const double at = nearest_beam(geometry.angle_min, geometry.angle_increment, cos * dx + sin * dy,
                                       cos * dy - sin * dx);
        if (!(0.0 <= at && at <= static_cast<double>(ranges.length) - 1.0)) continue;
        ++seen;
        const double distance = ranges[static_cast<std::int64_t>(at)], bearing = heading + bearing_of(geometry, at);
        const double from_x = lidar_x - x + distance * fg::cos(bearing);
        const double from_y = lidar_y - y + distance * fg::sin(bearing);
        const double error = normal_x * (x + from_x - ends[beam][0]) + normal_y * (y + from_y - ends[beam][1]);
        if (!(std::abs(error) < match.gate)) continue;
        ++fitting;
        const double slope[3] = {normal_x, normal_y, normal_y * from_x - normal_x * from_y};
        for (int i = 0; i < 3; ++i) {
            right[i] -= slope[i] * error;
            for (int j = 0; j < 3; ++j) normal[i][j] += slope[i] * slope[j];
        }
    }
    solve(table(normal), row(right));
    return {{x + right[0], y + right[1], heading + right[2]}, static_cast<double>(fitting) / max(seen, 1)};
}

// Begin the lap at its `first` place, and spread the error of dead reckoning: to `pose`, and by a turn [rad].
void bend(LapMap& lap, std::int64_t first, double turn, const Pose& pose) {
    lap.count -= first;
    const double count = static_cast<double>(lap.count);
    float before_x = lap.places[first][0], before_y = lap.places[first][1];
    double here_x = before_x, here_y = before_y;
    for (std::int64_t k = 0; k < lap.count; ++k) {  // turn the ways between places
        const auto [x, y, heading] = lap.places[first + k];
        const double part = turn * static_cast<double>(k) / count, cos = fg::cos(part), sin = fg::sin(part);
        const float dx = x - before_x, dy = y - before_y;
        before_x = x, before_y = y;
        here_x += cos * dx - sin * dy;
        here_y += sin * dx + cos * dy;
        float* const place = lap.places[k];
        place[0] = static_cast<float>(here_x), place[1] = static_cast<float>(here_y);
        place[2] = static_cast<float>(heading + part);
        std::copy_n(lap.ranges[first + k], lap_beams, lap.ranges[k]);
    }
    const double shift_x = pose.x - here_x, shift_y = pose.y - here_y;
    for (std::int64_t k = 0; k < lap.count; ++k) {
        float* const place = lap.places[k];
        place[0] = static_cast<float>(place[0] + shift_x * static_cast<double>(k) / count);
        place[1] = static_cast<float>(place[1] + shift_y * static_cast<double>(k) / count);
    }
}

// Drop the last places as long as they lie beside the first.
void drop_last(LapMap& lap) {
    const float cos = fg::cos(lap.places[0][2]), sin = fg::sin(lap.places[0][2]);
    while (lap.count > least_lap / 2) {
        const float dx = lap.places[lap.count - 1][0] - lap.places[0][0];
        const float dy = lap.places[lap.count - 1][1] - lap.places[0][1];
        if (cos * dx + sin * dy < -0.5 * spacing) break;
        --lap.count;
    }
}

// Close the lap where the car is at one of its first places again, and the scan fits there.
void close(LapMap& lap, const ScanGeometry& geometry, Numbers ranges, double lidar_offset) {
    std::int64_t first = -1;
    double least = most_off + most_off_share * lap.driven;
    for (std::int64_t index = first_place; index < min(std::int64_t{last_place}, lap.count - least_lap); ++index) {
        const double apart = fg::hypot(lap.x - lap.places[index][0], lap.y - lap.places[index][1]);
        if (apart < least && std::abs(turn_between(lap.places[index][2], lap.heading)) < most_turned)
            first = index, least = apart;
    }
    if (first < 0) return;
    Pose pose{lap.x, lap.y, lap.heading};
    double fits = 0.0;
    for (int step = 0; step < closing_steps; ++step) {
        const Match& match = step < closing_steps / 2 ? first_match : closing_match;
        std::tie(pose, fits) = matched(lap, first, geometry, ranges, lidar_offset, pose, match);
    }
    const double beside = fg::hypot(pose.x - lap.places[first][0], pose.y - lap.places[first][1]);
    if (fits < closes || beside > most_beside * static_cast<double>(first)) return;
    const double turn = turn_between(lap.heading, pose.heading);  // a lap turns by 2 pi, which is no error
    if (std::abs(turn) > heading_off) {  // its odometry drifts; at a later place the scan might fit without that turn
        lap.drifts = true;
        return;
    }
    bend(lap, first, turn, pose);
    drop_last(lap);
    lap.closed = true, lap.nearest = 0, lap.fits = 1.0;
    lap.x = pose.x, lap.y = pose.y, lap.heading = pose.heading;
}

// Correct where the car is by the readings at the nearest place.
void localise(LapMap& lap, const ScanGeometry& geometry, Numbers ranges, double lidar_offset) {
    double apart, fits;
    Pose pose{lap.x, lap.y, lap.heading};
    std::tie(lap.nearest, apart) = nearest_place(lap, lap.nearest, lap.x, lap.y, lap.heading);
    std::tie(pose, fits) = matched(lap, lap.nearest, geometry, ranges, lidar_offset, pose, tick_match);
    lap.x = pose.x, lap.y = pose.y, lap.heading = pose.heading;
    lap.fits += newest_share * (fits - lap.fits);
    if (lap.fits < least_fits || apart > lost) forget_lap(lap);
}

// Return 1 if the end of a beam kept at a place is to the left of the lap's path, -1 to the right, 0 if it is NaN.
double side_of(const LapMap& lap, std::int64_t place, double x, double y) {
    double least = inf, nearest_x = 0.0, nearest_y = 0.0;
    float heading = 0.0f;
    for (int more = -side_behind; more <= side_ahead; ++more) {
        const Row<const float> other = row(lap.places[place_after(lap, place, more)]);
        const double dx = x - other[0], dy = y - other[1];
        const double apart = dx * dx + dy * dy;
        if (apart < least) least = apart, nearest_x = dx, nearest_y = dy, heading = other[2];  // nor is NaN
    }
    if (!(least < inf)) return 0.0;
    return fg::cos(heading) * nearest_y >= fg::sin(heading) * nearest_x ? 1.0 : -1.0;
}

}  // namespace

void see_lap(LapMap& lap, const ScanGeometry& geometry, Numbers ranges, const Odometry& odometry, double lidar_offset) {
    const double way = odometry.speed * period_of(geometry);
    const double turn = odometry.angular_velocity[2] * period_of(geometry);
    if (!(std::abs(way) < 1.0 && std::abs(turn) < pi)) {  // nor is NaN
        forget_lap(lap);
        return;
    }
    lap.x += way * fg::cos(lap.heading + 0.5 * turn);
    lap.y += way * fg::sin(lap.heading + 0.5 * turn);
    lap.heading += turn;
    lap.driven += std::abs(way);
    if (!(sees(geometry, ranges) && looks_ahead(geometry, ranges.length))) return;
    if (lap.closed)
        localise(lap, geometry, ranges, lidar_offset);
    else if (record(lap, ranges, odometry.speed))
        close(lap, geometry, ranges, lidar_offset);
}

void forget_lap(LapMap& lap) {
    lap.closed = false, lap.count = 0, lap.x = 0.0, lap.y = 0.0, lap.heading = 0.0, lap.driven = 0.0;
}

std::tuple<std::int64_t, double> nearest_place(const LapMap& lap, std::int64_t last, double x, double y,
                                               double heading) {
    std::int64_t best = last;
    double least = inf;
    for (int more = -places_behind; more <= places_ahead; ++more) {
        const std::int64_t place = place_after(lap, last, more);
        double apart = fg::hypot(x - lap.places[place][0], y - lap.places[place][1]);
        if (!std::isnan(heading)) apart += turn_counts * std::abs(turn_between(lap.places[place][2], heading));
        if (apart < least) best = place, least = apart;
    }
    return {best, least};
}

LapWalls ends_of(const LapMap& lap, const ScanGeometry& geometry, std::int64_t count, double lidar_offset) {
    LapWalls walls(lap.count);
    const Cube<double> ends = walls;
    const Directions directions = directions_of(geometry, count);
    for (std::int64_t place = 0; place < lap.count; ++place)
        write_ends(lap, place, directions, lidar_offset, ends[place]);
    return walls;
}

LapWalls walls_of(const LapMap& lap, const ScanGeometry& geometry, std::int64_t count, double lidar_offset) {
    LapWalls walls = ends_of(lap, geometry, count, lidar_offset);
    for (std::int64_t place = 0; place < lap.count; ++place) {
        const Table<double> ends = Cube<double>(walls)[place];
        for (int beam = 0; beam < lap_beams; ++beam)
            ends[beam][2] = side_of(lap, place, ends[beam][0], ends[beam][1]);
    }
    return walls;
}

}  // namespace fg
