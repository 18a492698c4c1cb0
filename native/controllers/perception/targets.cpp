// Moving targets in the scan: which things move, where they are and how fast, from the LiDAR and odometry alone.
#include "targets.hpp"

#include <cmath>
#include <iterator>
#include <tuple>
#include <type_traits>

#include "../../core/numbers.hpp"
#include "../../core/transcendental.hpp"
#include "scan_filters.hpp"

namespace fg {
namespace {

enum { RIGHT, LEFT };  // ends of a cluster

constexpr double farthest = 12.0;    // [m] at which clusters are looked at
constexpr double least_edge = 0.15;  // [m] between neighbouring ranges,
constexpr double cut = 4.0;          // and in standard deviations, whichever is more
constexpr double steep = 4.0;        // times the mean step within a cluster, the same
constexpr int least_beams = 2;
constexpr double widest = 1.2;        // [m] from the first to the last beam of a cluster
constexpr double near = 0.08;         // of its distance is half of a thing, from which on its size is not measured
constexpr int most_found = 48;        // clusters of a scan that are kept
constexpr double gate = 0.3;          // [m] from where an end is expected to where it is seen
constexpr double range_noise = 0.02;  // [m] besides that of the beams
constexpr std::int64_t parts = 8;     // at least, of a cluster, of whose means the least is its distance;
constexpr double mean_noise = 0.005;  // [m] noise of a mean
// [m] by which an end may err, for each metre of distance and squared radian of the cluster
constexpr double outline_error = 0.3;
constexpr double acceleration = 1.5;  // [m/s^2] standard deviation of what a target does between two scans
constexpr double first_speed = 2.0;   // [m/s] the same, of the velocity of a new one
constexpr double misfit = 9.0;  // squared innovation over its variance; at the second the velocity is uncertain again
// Standard deviations: sum of innovations against the velocity, from which on it has turned,
constexpr double turned_back = 3.0;
constexpr double allowed = 0.5;    // and of each innovation, that is not counted
constexpr double uncertain = 0.3;  // of its speed is the standard deviation of one that has turned back,
constexpr double expected = 0.1;   // and as expected
constexpr double certain = 4.0;    // standard deviations
constexpr double least_speed = 0.25;  // [m/s]
constexpr double drift = 0.07;        // share by which odometry may err: of the way,
constexpr double turn_drift = 0.06;   // and of the turn
constexpr double slip = 0.01;  // [s^2/m] share of the way by which wheels slip for each m/s^2 of acceleration
constexpr int least_age = 5;   // sightings
constexpr double no_return = 65.0;  // [m] as which a beam without a return is kept
constexpr double level = 7.0;  // [m] up to which such a beam has not passed above a thing of 0.3 m, as the car rolls
constexpr double sigmas = 3.0;              // of the noise by which what is seen may be elsewhere
constexpr double free_way = 0.08;           // [m] past a place that a beam has to reach, for the place to be free
constexpr double forgotten = 0.6;           // [s]
constexpr double forgotten_in_view = 0.15;  // [s] the same, where it would be seen
constexpr double stands = 1.0;  // [s] without motion after which a target is a standing thing again
constexpr int every = 6;        // scans, of which one is kept besides the last one
constexpr std::int64_t bins = std::extent_v<decltype(Snapshot::ranges)>;  // of a scan that is kept, at most

// Return how many beams of a scan are kept together as one.
std::int64_t beams_together(std::int64_t count) { return max((count + bins - 1) / bins, std::int64_t{1}); }

struct Place {
    double x, y;  // [m]
};

// Return the middle of the two ends of a target.
Place middle_of(const Target& target) {
    return {0.5 * (target.ends[0][0] + target.ends[1][0]), 0.5 * (target.ends[0][1] + target.ends[1][1])};
}

// Return how far a beam of a kept scan of `count` beams reaches [m].
inline double reach_of(const Snapshot& view, std::int64_t count, std::int64_t beam) {
    return view.ranges[beam / beams_together(count)] / 1000.0;
}

// Return the beam of a kept scan that points to a place, below 0 or beyond the last if none does; and how far.
std::tuple<std::int64_t, double> beam_towards(const Snapshot& view, const ScanGeometry& geometry, double x, double y) {
    const double cos = fg::cos(view.heading), sin = fg::sin(view.heading), dx = x - view.x, dy = y - view.y;
    const double beam =
        nearest_beam(geometry.angle_min, geometry.angle_increment, cos * dx + sin * dy, cos * dy - sin * dx);
    return {whole(beam), fg::hypot(dx, dy)};
}

// Return whether a kept scan of `count` beams sees past a place where another one saw a thing.
//
// If all stands, a beam towards that place ends there or before. Odometry that errs puts the place elsewhere: so all
// beams have to reach past it that may point there.
bool sees_past(const Snapshot& view, const Snapshot& other, const ScanGeometry& geometry, std::int64_t count, double x,
               double y) {
    const auto [beam, straight] = beam_towards(view, geometry, x, y);
    const double distance = max(straight, free_way);
    const double cos = (x - view.x) / distance, sin = (y - view.y) / distance;
    const double way_x = other.x - view.x, way_y = other.y - view.y;
    const double turn = turn_drift * std::abs(other.turned - view.turned);
    const double way = max(fg::hypot(way_x, way_y), 1e-6);
    const double doubt = std::abs(other.doubt - view.doubt) / way;
    const double off = 0.5 * turn * way + sigmas * other.noise;  // an error of the turn bends the way
    const double aside = (doubt * std::abs(way_x * sin - way_y * cos) + off) / distance + turn;
    // What lies between two beams is seen by neither.
    const double beside = 1.0 + fg::hypot(x - other.x, y - other.y) / distance;
    const std::int64_t beams =
        whole(min(aside / geometry.angle_increment + beside + 0.5, static_cast<double>(count)));
    if (beam < beams || beam + beams >= count) return false;
    const double past = distance + free_way + doubt * std::abs(way_x * cos + way_y * sin) + off;
    for (std::int64_t k = beam - beams; k <= beam + beams; ++k) {
        const double reach = reach_of(view, count, k);
        if (reach < past || (distance > level && reach == no_return)) return false;
    }
    return true;
}

// Return whether a target would be seen where it is expected: the beams there end beyond it.
bool is_in_view(const Targets& memory, const Target& target, const ScanGeometry& geometry, std::int64_t count) {
    const auto [x, y] = middle_of(target);
    const Snapshot& now = memory.snapshots[0];
    return sees_past(now, now, geometry, count, x, y);
}

// Return whether a target covers ground that a kept scan saw free, or has left ground that it covered there.
bool has_moved(const Targets& memory, const Target& target, const ScanGeometry& geometry, Numbers ranges) {
    const Snapshot& now = memory.snapshots[0];
    const std::int64_t count = ranges.length;
    const auto [x, y] = middle_of(target);
    const double part = target.radius / max(fg::hypot(x - now.x, y - now.y), target.radius + free_way);
    const double face_x = x - part * (x - now.x), face_y = y - part * (y - now.y);
    for (std::size_t k = 1; k < std::size(memory.snapshots); ++k) {
        const Snapshot& then = memory.snapshots[k];
        if (then.tick == 0) continue;
        int covered = 0;
        for (std::int64_t beam = target.first; beam < target.end; ++beam) {
            const double bearing = now.heading + bearing_of(geometry, static_cast<double>(beam));
            const double seen_x = now.x + ranges[beam] * fg::cos(bearing);
            const double seen_y = now.y + ranges[beam] * fg::sin(bearing);
            covered += sees_past(then, now, geometry, count, seen_x, seen_y);
        }
        if (covered > 1) return true;
        const double since = static_cast<double>(now.tick - then.tick) * period_of(geometry);
        double old_x = face_x - target.vx * since, old_y = face_y - target.vy * since;
        const auto [beam, distance] = beam_towards(then, geometry, old_x, old_y);
        if (beam < 0 || beam >= count) continue;
        const double reach = reach_of(then, count, beam);
        if (std::abs(reach - distance) < least_edge) {
            const double share = reach / max(distance, free_way);  // to what was seen there
            old_x = then.x + share * (old_x - then.x), old_y = then.y + share * (old_y - then.y);
            if (sees_past(now, then, geometry, count, old_x, old_y)) return true;
        }
    }
    return false;
}

// Decide whether a target moves.
void judge(const Targets& memory, Target& target, const ScanGeometry& geometry, Numbers ranges) {
    const double square = target.vx * target.vx + target.vy * target.vy;
    if (!target.moves) {
        const double least = max(certain * certain * target.p_speed, least_speed * least_speed);
        target.moves = square > least && has_moved(memory, target, geometry, ranges);
        target.still = 0.0;
        return;
    }
    target.still = square < 0.25 * least_speed * least_speed ? target.still + period_of(geometry) : 0.0;
    target.moves = target.still <= stands;
}

// Return whether as much of a cluster is seen as of a target at its last sighting: both ends of its own, or one.
bool is_like(const Target& target, const Cluster& cluster) { return (target.radius > 0.0) == (cluster.radius > 0.0); }

struct Innovation {
    double dx, dy;  // [m] by which the ends of a cluster are off those that are expected
    int ends;       // that say so
};

Innovation innovation(const Target& target, const Cluster& cluster) {
    double dx = 0.0, dy = 0.0;
    int ends = 0;
    const bool compared = is_like(target, cluster);
    for (int end = 0; end < 2; ++end) {
        if (compared && target.own[end] && cluster.own[end]) {
            dx += cluster.ends[end][0] - target.ends[end][0];
            dy += cluster.ends[end][1] - target.ends[end][1];
            ++ends;
        }
    }
    if (ends > 0) return {dx / ends, dy / ends, ends};
    dx = 0.5 * (cluster.ends[0][0] + cluster.ends[1][0] - target.ends[0][0] - target.ends[1][0]);
    dy = 0.5 * (cluster.ends[0][1] + cluster.ends[1][1] - target.ends[0][1] - target.ends[1][1]);
    return {dx, dy, 0};
}

// Return by how much a target may have changed its velocity [m/s], and whether it has turned back.
//
// The first is 0 where its innovations do not say that it has.
std::tuple<double, bool> change_of_speed(Target& target, double dx, double dy, int ends, double variance) {
    const double speed = fg::hypot(target.vx, target.vy);
    if (speed < least_speed || target.age <= least_age) {
        target.against = 0.0;
    } else if (ends > 0) {
        const double against = -(dx * target.vx + dy * target.vy) / (speed * std::sqrt(variance));
        target.against = max(target.against + against - allowed, 0.0);
    }
    target.misfits = dx * dx + dy * dy > 2.0 * misfit * variance ? target.misfits + 1 : 0;
    const bool turned = target.against > turned_back;
    double change = 0.0;
    if (turned)
        change = uncertain * speed;
    else if (target.misfits >= 2)
        change = 0.5 * first_speed;
    if (change > 0.0) target.misfits = 0, target.against = 0.0;
    return {change, turned};
}

// Turn the velocity of a target round where it is seen now, which is dx, dy [m] from where it was expected.
void turn_back(Target& target, double dx, double dy) {
    target.vx = -target.vx, target.vy = -target.vy;
    const double x = target.farthest[0], y = target.farthest[1];
    double(&other)[2] = target.turned[target.turns & 1], (&last)[2] = target.turned[(target.turns - 1) & 1];
    const double from_last = fg::hypot(last[0] - x, last[1] - y);
    if (target.turns >= 2 && from_last < fg::hypot(other[0] - x, other[1] - y)) {
        target.turns = 0;  // it goes on, beyond where it was expected to turn
    } else {
        other[0] = x, other[1] = y;
        ++target.turns;
    }
    for (double(&end)[2] : target.ends) end[0] += dx, end[1] += dy;
}

// Turn a target round that has come to where it turned before last.
void turn_at_end(Target& target) {
    const double(&end)[2] = target.turned[target.turns & 1], (&other)[2] = target.turned[(target.turns - 1) & 1];
    const double vx = target.vx, vy = target.vy;
    const auto [x, y] = middle_of(target);
    const double dx = x - end[0], dy = y - end[1];
    const double over = dx * vx + dy * vy, square = vx * vx + vy * vy;
    if (over < 0.0 || (end[0] - other[0]) * vx + (end[1] - other[1]) * vy < 0.5 * gate * std::sqrt(square)) return;
    for (double(&side)[2] : target.ends) {
        side[0] -= 2.0 * over * vx / square;
        side[1] -= 2.0 * over * vy / square;
    }
    target.vx = -vx, target.vy = -vy;
    target.farthest[0] = end[0], target.farthest[1] = end[1];
    ++target.turns;
    target.against = 0.0;
    target.p_speed += expected * expected * square;
}

// Take a target on by one tick.
void predict(Target& target, double period) {
    for (double(&end)[2] : target.ends) {
        end[0] += target.vx * period;
        end[1] += target.vy * period;
    }
    if (target.moves && target.turns >= 2) turn_at_end(target);
    const double change = acceleration * period;
    target.p_place += period * (2.0 * target.p_mixed + period * target.p_speed);
    target.p_mixed += period * target.p_speed;
    target.p_speed += change * change;
}

// Write what was seen of a target at its last sighting.
void take(Target& target, const Cluster& cluster) {
    target.radius = cluster.radius, target.distance = cluster.distance;
    target.first = cluster.first, target.end = cluster.end;
    const double dx = cluster.ends[LEFT][0] - cluster.ends[RIGHT][0];
    const double dy = cluster.ends[LEFT][1] - cluster.ends[RIGHT][1];
    const double half = 0.5 * fg::hypot(dx, dy);
    if (target.age < least_age || half < near * cluster.distance) target.size = max(target.size, half);
}

// Keep a target that is not in the scan, for a while.
void miss(const Targets& memory, Target& target, const ScanGeometry& geometry, std::int64_t count) {
    target.unseen += period_of(geometry);
    double patience = target.moves ? forgotten : forgotten_in_view;
    if (target.moves && is_in_view(memory, target, geometry, count)) patience = forgotten_in_view;
    if (target.unseen > patience) target.age = 0, target.moves = false;
}

// Take what was found nearest to a target for it.
void follow(const Targets& memory, Target& target, Row<Cluster> found, const ScanGeometry& geometry, Numbers ranges) {
    int nearest = -1;
    double least = gate;
    for (int k = 0; k < found.size(); ++k) {
        if (found[k].taken) continue;
        const auto [dx, dy, ends] = innovation(target, found[k]);
        const double apart = fg::hypot(dx, dy);
        if (apart < least) nearest = k, least = apart;
    }
    if (nearest < 0) {
        miss(memory, target, geometry, ranges.length);
        return;
    }
    Cluster& cluster = found[nearest];
    cluster.taken = true;
    auto [dx, dy, ends] = innovation(target, cluster);
    double noise = cluster.variance / max(ends, 1);
    const auto [middle_x, middle_y] = middle_of(target);
    const double x = middle_x + dx, y = middle_y + dy;  // where it is seen
    if (ends == 0) noise *= 100.0;  // only edges of shadows: it is there, and its motion is not seen
    double sum_of_both = target.p_place + noise;
    const auto [change, turned] = change_of_speed(target, dx, dy, ends, sum_of_both);
    if (turned) {
        turn_back(target, dx, dy);
        dx = dy = 0.0;
    }
    if (change > 0.0) {
        target.p_place += 0.5 * (dx * dx + dy * dy);
        target.p_speed += change * change;
        sum_of_both = target.p_place + noise;
    }
    const double gain = target.p_place / sum_of_both, gain_speed = target.p_mixed / sum_of_both;
    target.vx += gain_speed * dx;
    target.vy += gain_speed * dy;
    target.p_speed -= gain_speed * target.p_mixed;
    target.p_place *= 1.0 - gain;
    target.p_mixed *= 1.0 - gain;
    const bool compared = is_like(target, cluster);
    for (int end = 0; end < 2; ++end) {
        double(&place)[2] = target.ends[end];
        const double(&seen)[2] = cluster.ends[end];
        if (compared && target.own[end] && cluster.own[end]) {
            // The outline may change: an end goes on from where it is seen by as much as it errs from the mean.
            place[0] += gain * dx + 0.3 * (seen[0] - place[0] - dx);
            place[1] += gain * dy + 0.3 * (seen[1] - place[1] - dy);
        } else {
            place[0] = seen[0], place[1] = seen[1];
        }
        target.own[end] = cluster.own[end];
    }
    take(target, cluster);
    if (turned || (x - target.farthest[0]) * target.vx + (y - target.farthest[1]) * target.vy > 0.0)
        target.farthest[0] = x, target.farthest[1] = y;
    ++target.age;
    target.unseen = 0.0;
    judge(memory, target, geometry, ranges);
}

// Follow a cluster that is new, if there is room for one.
void begin(Row<Target> targets, const Cluster& cluster) {
    for (int i = 0; i < targets.size(); ++i) {
        Target& target = targets[i];
        if (target.age != 0) continue;
        target.age = 1;
        for (int end = 0; end < 2; ++end) {
            target.ends[end][0] = cluster.ends[end][0], target.ends[end][1] = cluster.ends[end][1];
            target.own[end] = cluster.own[end];
        }
        target.size = 0.0;
        take(target, cluster);
        target.farthest[0] = cluster.ends[RIGHT][0], target.farthest[1] = cluster.ends[RIGHT][1];
        target.vx = target.vy = target.unseen = target.still = 0.0;
        target.p_place = cluster.variance, target.p_mixed = 0.0;
        target.p_speed = first_speed * first_speed;
        target.misfits = target.turns = 0;
        target.against = 0.0;
        target.moves = false;
        return;
    }
}

// Keep a scan as the newest one, and sometimes that before it in place of the oldest.
//
// A beam without a return may have passed above a thing beyond `level`, as the car rolls.
void keep_scan(Targets& memory, const ScanGeometry& geometry, Numbers ranges) {
    Snapshot& now = memory.snapshots[0];
    constexpr std::int64_t kept = std::extent_v<decltype(Targets::snapshots)> - 1;
    if (memory.tick % every == 1) memory.snapshots[1 + (memory.tick / every) % kept] = now;
    now.x = memory.x, now.y = memory.y, now.heading = memory.heading, now.tick = memory.tick;
    now.turned = memory.turned, now.doubt = memory.doubt, now.noise = memory.noise;
    const std::int64_t count = ranges.length, together = beams_together(count);
    for (std::int64_t first = 0, index = 0; first < count; first += together, ++index) {
        double least = no_return;
        for (std::int64_t beam = first; beam < min(first + together, count); ++beam)
            least = min(least, ranges[beam] < geometry.range_max ? ranges[beam] : no_return);
        now.ranges[index] = static_cast<std::uint16_t>(whole(1000.0 * least + 0.5));
    }
}

// Return the distance of a cluster [m]: the least of the means of its parts.
double distance_of(Numbers ranges, std::int64_t first, std::int64_t end, double noise) {
    const std::int64_t wanted = whole(std::ceil(noise * noise / (mean_noise * mean_noise)));
    const std::int64_t together = max(min(wanted, (end - first) / parts), std::int64_t{1});
    double least = inf;
    for (std::int64_t beam = first; beam < end;) {
        const std::int64_t behind = beam + 2 * together <= end ? beam + together : end;
        double total = 0.0;
        for (std::int64_t k = beam; k < behind; ++k) total += ranges[k];
        least = min(least, total / static_cast<double>(behind - beam));
        beam = behind;
    }
    return least;
}

// Write a cluster of the beams from `first` to before `end`; return false if it is too wide, or part of a wall.
//
// The variance of an end is of the range, of where between two beams the thing ends, and of its outline: near the car
// another part of the outline is outermost in each scan.
bool is_cluster(const Targets& memory, const ScanGeometry& geometry, Numbers ranges, std::int64_t first,
                std::int64_t end, double edge, Cluster& found) {
    const double noise = memory.noise, right = ranges[first], left = ranges[end - 1];
    const double steps = static_cast<double>(end - 1 - first);
    edge = max(edge, steep * std::abs(left - right) / steps);  // beams on a wall that is seen at a small angle
    const bool own_right = ranges[first - 1] - right > edge, own_left = ranges[end] - left > edge;
    if (!(own_right || own_left)) return false;
    const double turn = steps * geometry.angle_increment;
    if (right * right + left * left - 2.0 * right * left * fg::cos(turn) > widest * widest || turn > 2.0) return false;
    const double least = distance_of(ranges, first, end, noise);
    const bool both = own_right && own_left;
    const double half = fg::sin(0.5 * turn);
    const double radius = both ? least * half / (1.0 - half) : 0.0, of_range = both ? noise / (1.0 - half) : noise;
    const double away_right = both ? least + radius : right, away_left = both ? least + radius : left;
    const double bearing = memory.heading + bearing_of(geometry, static_cast<double>(first));
    const double between = least * geometry.angle_increment;
    const double outline = both ? outline_error * least * turn * turn : std::abs(left - right) / steps;
    found.variance = range_noise * range_noise + of_range * of_range + between * between / 12.0 + outline * outline;
    found.ends[RIGHT][0] = memory.x + away_right * fg::cos(bearing);
    found.ends[RIGHT][1] = memory.y + away_right * fg::sin(bearing);
    found.ends[LEFT][0] = memory.x + away_left * fg::cos(bearing + turn);
    found.ends[LEFT][1] = memory.y + away_left * fg::sin(bearing + turn);
    found.own[RIGHT] = own_right, found.own[LEFT] = own_left;
    found.radius = radius, found.distance = least, found.first = first, found.end = end, found.taken = false;
    return true;
}

// Write the clusters of a scan that may be things; return how many.
std::int64_t find_clusters(const Targets& memory, const ScanGeometry& geometry, Numbers ranges, Row<Cluster> found) {
    const double edge = max(least_edge, cut * std::sqrt(2.0) * memory.noise);
    std::int64_t count = 0, first = 0;  // clusters; the first beam of the one that has not ended
    bool nearer = true;                 // whether what is right of it is nearer
    for (std::int64_t beam = 1; beam < ranges.length; ++beam) {
        const double step = ranges[beam] - ranges[beam - 1];
        if (std::abs(step) <= edge) continue;
        const bool is_whole = first > 0 && beam - first >= least_beams;  // what the field of view cuts off may be wall
        if (is_whole && ranges[first] < farthest && (!nearer || step > 0.0)) {
            count += is_cluster(memory, geometry, ranges, first, beam, edge, found[count]);
            if (count == found.length) return count;
        }
        first = beam, nearer = step > 0.0;
    }
    return count;
}

// Forget all targets and scans.
void forget_targets(Targets& memory) {
    for (Target& target : memory.targets) target.age = 0, target.moves = false;
    for (Snapshot& snapshot : memory.snapshots) snapshot.tick = 0;
}

}  // namespace

std::int64_t track_targets(Targets& memory, const ScanGeometry& geometry, Numbers ranges, const Odometry& odometry,
                           double lidar_offset, double course) {
    const double period = period_of(geometry), speed = odometry.speed, yaw_rate = odometry.angular_velocity[2];
    const double way = 0.5 * period * (memory.speed + speed), turn = 0.5 * period * (memory.yaw_rate + yaw_rate);
    const double change = std::abs(speed - memory.speed);
    memory.count = 0, memory.speed = speed, memory.yaw_rate = yaw_rate;
    if (!(std::abs(way) + std::abs(turn) < 10.0) || ranges.length != memory.beams) {  // no odometry, or another LiDAR
        memory.beams = ranges.length;
        forget_targets(memory);
        return 0;
    }
    const double towards = memory.heading + 0.5 * turn + course;
    const double x = memory.x - lidar_offset * fg::cos(memory.heading) + way * fg::cos(towards);
    const double y = memory.y - lidar_offset * fg::sin(memory.heading) + way * fg::sin(towards);
    memory.heading += turn;
    memory.x = x + lidar_offset * fg::cos(memory.heading);
    memory.y = y + lidar_offset * fg::sin(memory.heading);
    memory.doubt += std::abs(way) * (drift + slip * change / period);
    memory.turned += std::abs(turn);
    ++memory.tick;
    memory.noise = noise_of(ranges, geometry.range_max);
    keep_scan(memory, geometry, ranges);
    Cluster clusters[most_found];
    const Row<Cluster> found = row(clusters).part(0, find_clusters(memory, geometry, ranges, row(clusters)));
    for (const bool moves : {true, false}) {
        for (Target& target : memory.targets) {
            if (target.age > 0 && target.moves == moves) {
                predict(target, period);
                follow(memory, target, found, geometry, ranges);
                memory.count += target.age > 0 && target.moves;
            }
        }
    }
    for (int k = 0; k < found.size(); ++k)
        if (!found[k].taken) begin(row(memory.targets), found[k]);
    return memory.count;
}

}  // namespace fg
