// Paths and profiles of speed are tried together, and of the free motions the one that comes farthest is driven for a
// tick: see controllers/safety/plan_in_time.py.
#include "plan_in_time.hpp"

#include "../../core/numbers.hpp"
#include "../../core/transcendental.hpp"
#include "../control/planner_settings.hpp"
#include "../control/slip.hpp"
#include "../control/speed.hpp"
#include "../control/steering.hpp"
#include "judge.hpp"
#include "predictions.hpp"

namespace fg {
namespace {

// Targets among which the car plans are as near as that [m].
constexpr double near_ahead = 8.0, near_anywhere = 1.0;

// Motions and paths.
constexpr int steps = 40;
constexpr double step_time = 0.1;     // [s]
constexpr double point_apart = 0.15;  // [m] between them
constexpr double looks = 1.3;         // [m] to the point on the way to a place for which the car steers
constexpr double arrived = 0.5;       // [m]

// Places across the way to the nearest target, through which paths lead.
constexpr int places_across = 19;
constexpr double place_apart = 0.15;                         // [m] between them
constexpr double farthest_place = 4.0, nearest_place = 1.0;  // [m] to them
constexpr int parts_in_turn = 3, parts_among_many = 4;       // ticks in which all are tried; among many targets
constexpr int path_count = places_across + 3;

// Room beside targets [m].
constexpr double margin_round = 0.02, widened_by = 0.02;  // besides the margins of targets, and round the car
constexpr double may_use_up = 0.08;                       // of all margins that a motion may use up where none is free
constexpr double bold_after = 3.0;                        // [s] of waiting, and of that again until margins of what
constexpr double bolder = 0.06;                           // is known to turn are less by so much

// Speed past targets, which is greater past one that drives ahead.
constexpr double passing_speed = 3.0;  // [m/s]
constexpr double slowing = 0.5;        // of the greatest braking, on the way to a target

// Stops: where none comes by.
constexpr double beside_lane = 0.3;            // [m] beside the lane of one that crosses
constexpr double crosses = 0.7;                // greatest cosine of its course
constexpr int wait_steps = 4, wait_times = 3;  // in which a car that has stopped should not be met, so many times

// Scores [m].
constexpr double scored_time = 2.0;                    // [s] in which the way counts
constexpr double goes_on = 4.0;                        // for 1 m of room
constexpr double passed_after = 2.0;                   // of way from which on a motion passes
constexpr double most_room = 0.6, room_waiting = 0.1;  // that counts, of motions that pass and of others
constexpr double worth_of_kept = 0.3;                  // for the last plan
constexpr double steers = 3.0;                         // [m/rad] cost of turning the wheels
constexpr double goes_aside = 0.2;                     // [-] cost of a place's way aside
constexpr double touches_at = -1000.0;                 // of motions that touch something
constexpr double tight = -20.0, per_metre = 100.0;     // of those that use up margins
constexpr double may_turn_back = 5.0;                  // for touching nothing that turns back at once,
constexpr int soon = 10;                               // in so many steps
constexpr double free_from = -10.0;                    // a motion with a better score is free

// Simulated stops.
constexpr int tried = 8;                        // motions
constexpr double stop_margins[] = {0.1, 0.05};  // [m] with which they are tried
constexpr double most_turn = 0.03;              // [rad] that the wheels turn in a tick

// Backing off.
constexpr int backing_steps = 15;
constexpr double backs_by = 0.8;           // [m] that are looked at
constexpr int walled_below = 3;            // points of the longest free path, with less of which a wall is ahead
constexpr double waits_before_wall = 2.0;  // [s]
constexpr double farthest_back = 1.0;      // [m] until the car drives again,
constexpr double drove = 0.5;              // and [m/s] at which it does

// Scores [m] of all motions: by their paths and profiles.
using Scores = std::array<std::array<double, profile_count>, path_count>;

// Where a target may be on its line at a time [m], and the near end if it turns back now.
struct Span {
    double near, far, turned;
};

const Span& span_of(const Among& among, int step, std::int64_t k) {
    return reinterpret_cast<const Span*>(among.spans[step].data)[k];
}

// A car's place x, y [m], and the cosine and the sine of its heading.
struct Pose {
    double x, y, cos, sin;
};

// Return how far the middle of the disc over a car's front is ahead of its rear axle [m].
double front_of(const CarParameters& car) { return car.length - car.rear_overhang - 0.25 * car.width; }

}  // namespace

OwnRow<double> reaches_of(const CarParameters& car, Matrix rows, double bold) {
    OwnRow<double> reaches(rows.rows);
    const double front = front_of(car) - car.lidar_offset;
    for (std::int64_t k = 0; k < rows.rows; ++k) {
        const Prediction& target = prediction(rows[k]);
        double now = inf;
        for (const double offset : {front, 0.0, -car.lidar_offset})
            now = min(now, fg::hypot(target.x - offset, target.y));
        double reach = 0.5 * car.width + widened_by + margin_round + target.radius;
        if (target.turns >= 2.0) reach -= bolder * bold;
        reaches[k] = max(min(reach, now - 0.02), 0.7 * reach);
    }
    return reaches;
}

OwnTable<double> spans_of(Matrix rows, double bold) {
    static_assert(span_steps == steps + wait_steps * wait_times + 1);
    OwnTable<double> spans(span_steps, 3 * rows.rows);
    for (int step = 0; step < span_steps; ++step)
        for (std::int64_t k = 0; k < rows.rows; ++k) {
            const Prediction& target = prediction(rows[k]);
            const auto [near, far] = occupied(rows[k], step * step_time, bold);
            double turned = near;
            if (target.turns < 2.0 && step <= soon) {
                const double back = target.speed * step * step_time;
                turned = min(near, target.turns > 0.0 ? -min(back, target.from_wall) : -back);
            }
            reinterpret_cast<Span*>(spans[step].data)[k] = {near, far, turned};
        }
    return spans;
}

namespace {

// Return what the motions have in common, and the distance [m] of the places across the way.
std::tuple<Among, double> look_among(const Situation& here, std::array<double, 2> goal, double onwards, double bold,
                                     Matrix spans, Numbers reaches) {
    const Limiter& limiter = here.limiter;
    double far = farthest_place, passing = inf;
    for (std::int64_t k = 0; k < here.movers.rows; ++k) {
        const Prediction& target = prediction(here.movers[k]);
        if (target.x > -0.2) {
            far = min(far, fg::hypot(target.x, target.y));
            passing = min(passing, passing_speed + max(target.speed * target.cos, 0.0));
        }
    }
    far = max(far, nearest_place);
    const double room = far - nearest_place +
                        (passing * passing - passing_speed * passing_speed) / (2.0 * slowing * limiter.braking);
    const double response = limiter.settings.steering_response;
    const double servo = share_of_way(here.period, response) * response / here.period;  // in the mean of a tick
    const std::array<double, 2> place{goal[1] * fg::cos(goal[0]), goal[1] * fg::sin(goal[0])};
    return {Among{here, place, onwards, room, servo, spans, reaches, may_turn_back * (1.0 - bold)}, far};
}

// A place through which a path leads, if there is one.
struct Place {
    bool found;
    double x, y;   // [m] ahead and left
    double aside;  // [m]
};

// Return the place of one of the paths; `bearing` is that of the goal, and `far` the places' distance.
Place place_of(const Among& among, const PlanInTime& plan, std::array<double, 3> pose, double bearing, double far,
               int number) {
    const Situation& here = among.here;
    const CarParameters& car = here.limiter.car;
    if (number == 0) return {true, among.goal[0], among.goal[1], 0.0};
    if (number < places_across) {
        const double aside = (number / 2) * place_apart * (number % 2 == 0 ? 1.0 : -1.0);
        const double towards = bearing + fg::atan(aside / far);
        const double cos = fg::cos(towards), sin = fg::sin(towards);
        const double reach = min(far, reading_towards(here, cos, sin) - 0.1);
        return {reach >= arrived, reach * cos, reach * sin, std::abs(fg::atan(aside / far) * far)};
    }
    if (number == places_across) {
        const double way = 1.2 + car.lidar_offset;
        return {true, 1.2, 0.5 * fg::tan(here.angle) / car.wheelbase * (way * way), 0.0};
    }
    const double dx = plan.x - pose[0], dy = plan.y - pose[1], cos = fg::cos(pose[2]), sin = fg::sin(pose[2]);
    const double x = cos * dx + sin * dy, y = cos * dy - sin * dx;
    return {plan.kept == plan.tick - 1 && x >= 0.4, x, y, 0.0};
}

// Return the speed [m/s] with which a profile begins.
double first_speed(const Profile& profile, double onwards, double cap) {
    return profile.time > 0.0 ? min(profile.share * onwards, cap) : 0.0;
}

// Return the steering angle [rad] towards a place in the frame of the LiDAR [m], by a point on the way to it.
double steering_to(const CarParameters& car, double x, double y) {
    const double nearer = min(1.0, looks / fg::hypot(x + car.lidar_offset, y));
    return arc_through(nearer * (x + car.lidar_offset), nearer * y, car.wheelbase);
}

// Return the greatest speed [m/s] at a way [m] ahead of where the car may only pass.
double cap_at(const Limiter& limiter, double room) {
    return std::sqrt(passing_speed * passing_speed + 2.0 * slowing * limiter.braking * max(room, 0.0));
}

// Return whether the car's discs keep clear of what stands, at a place in the frame of the LiDAR.
bool is_free(const Situation& here, double x, double y, double cos, double sin) {
    const CarParameters& car = here.limiter.car;
    const double front = front_of(car);
    for (const double offset : {front, car.lidar_offset, 0.0}) {
        const double at_x = x + offset * cos, at_y = y + offset * sin;
        const double more = offset == front ? 0.25 * car.width + margin_round : 0.0;
        if (offset == front || at_x > 0.0) {
            const double beyond = reading_towards(here, at_x, at_y);
            if (!(beyond > std::sqrt(at_x * at_x + at_y * at_y) + more)) return false;
        }
    }
    return true;
}

}  // namespace

int lay_path(const Among& among, double to_x, double to_y, Row<PathPoint> path) {
    const Situation& here = among.here;
    const Limiter& limiter = here.limiter;
    const CarParameters& car = limiter.car;
    const double lock = fg::tan(lock_arc(limiter.slip, car)) / car.wheelbase;
    double speed = here.speed, x = -car.lidar_offset, y = 0.0, heading = 0.0;
    double curvature = fg::tan(here.angle) / car.wheelbase, cos = 1.0, sin = 0.0;
    bool last = false;
    for (int point = 0; point < path_length; ++point) {
        path[point] = {x, y, cos, sin, curvature, path[point].turning};
        if (point > 0 && !is_free(here, x, y, cos, sin)) return point;
        double ahead = cos * (to_x - x) + sin * (to_y - y), left = cos * (to_y - y) - sin * (to_x - x);
        if (ahead < arrived && !last) {
            last = true;
            to_x = among.goal[0], to_y = among.goal[1];
            ahead = cos * (to_x - x) + sin * (to_y - y), left = cos * (to_y - y) - sin * (to_x - x);
        }
        if (ahead < arrived) ahead = 1.0, left = 0.0;
        const double nearer = min(1.0, looks / std::sqrt(ahead * ahead + left * left));
        const double wanted = 2.0 * left / ((ahead * ahead + left * left) * nearer);
        const double most = min(lock, 0.9 * limiter.lateral / max(speed * speed, 0.1));
        const double time = point_apart / max(speed, 0.7);
        double change = max(min(wanted, most), -most) - curvature;
        const double cornering = speed * speed * curvature;
        double unused = max(limiter.lateral - std::copysign(cornering, change * cornering), 0.0);
        unused = min(unused, limiter.settings.most_left * limiter.lateral);
        double rate = limiter.settings.turn_in_use * unused / (limiter.yaw_lag * max(speed, 0.5));
        rate = among.servo * min(rate, car.max_steering_rate / car.wheelbase);
        change = max(min(change, rate * time), -rate * time);
        path[point].turning = limiter.yaw_lag * speed * std::abs(change) / (time * limiter.lateral);
        curvature += change;
        const double aim = min(among.onwards, cap_at(limiter, among.room - point * point_apart));
        speed = max(min(aim, speed + 0.8 * limiter.accelerating * time), speed - 0.7 * limiter.braking * time);
        x += point_apart * fg::cos(heading + 0.5 * curvature * point_apart);
        y += point_apart * fg::sin(heading + 0.5 * curvature * point_apart);
        heading += curvature * point_apart;
        cos = fg::cos(heading), sin = fg::sin(heading);
    }
    return 2 * path_length;
}

namespace {

// Return the square of the distance [m^2] of a place from an interval on a target's line.
double apart(double near, double far, double along, double across) {
    const double off = max(max(near - along, along - far), 0.0);
    return off * off + across * across;
}

// Where a car is in the frame of a target's line, and which way it heads there.
struct BesideLine {
    double along, across;  // [m]
    double on, aside;      // cosine and sine
};

BesideLine beside_line(const Prediction& target, const Pose& pose) {
    const double dx = pose.x - target.x, dy = pose.y - target.y;
    return {target.cos * dx + target.sin * dy, target.cos * dy - target.sin * dx,
            target.cos * pose.cos + target.sin * pose.sin, target.cos * pose.sin - target.sin * pose.cos};
}

double near_of(const Span& span, bool turns_now) { return turns_now ? span.turned : span.near; }

// Return the least room [m] beside targets at a step, at most `gap`; `turns_now`: if they turn back now.
double room_beside(const Among& among, int step, const Pose& pose, double gap, bool turns_now) {
    const CarParameters& car = among.here.limiter.car;
    const Matrix rows = among.here.movers;
    const double front = front_of(car);
    for (std::int64_t k = 0; k < rows.rows; ++k) {
        const Span& span = span_of(among, step, k);
        const double reach = among.reaches[k], near = near_of(span, turns_now), far = span.far;
        const auto [along, across, on, aside] = beside_line(prediction(rows[k]), pose);
        // None of the car's discs is near its line, or near the target.
        if (std::abs(across) > reach + most_room + front * std::abs(aside)) continue;
        if (along + front + reach + most_room < near || along - front - reach - most_room > far) continue;
        for (const double offset : {front, car.lidar_offset, 0.0}) {
            const double square = apart(near, far, along + offset * on, across + offset * aside);
            if (square < (reach + gap) * (reach + gap)) gap = std::sqrt(square) - reach;
        }
    }
    return gap;
}

// Return when a car that has stopped at a step is met [s], 0 in the lane of what crosses; inf: it is not.
double is_met(const Among& among, int step, const Pose& pose, bool turns_now) {
    const CarParameters& car = among.here.limiter.car;
    const Matrix rows = among.here.movers;
    for (std::int64_t k = 0; k < rows.rows; ++k) {
        const Prediction& target = prediction(rows[k]);
        const double reach = among.reaches[k];
        const auto [along, across, on, aside] = beside_line(target, pose);
        const double lane = reach + (std::abs(target.cos) < crosses ? beside_lane : 0.0);
        for (const double offset : {front_of(car), car.lidar_offset, 0.0}) {
            const double at = along + offset * on, off = across + offset * aside;
            if (std::abs(off) < lane && -target.from_wall - 0.2 < at && at < target.to_wall + 0.2) return 0.0;
            for (int wait = 1; wait <= wait_times; ++wait) {
                const Span& later = span_of(among, step + wait_steps * wait, k);
                if (apart(near_of(later, turns_now), later.far, at, off) < reach * reach) return 0.1 * wait;
            }
        }
    }
    return inf;
}

// Return the index of a point on a path that a car of some way [m] has come to or passed; of one that still rolls back,
// Python's: from the end.
int point_at(double way) {
    const int point = min(whole(way / point_apart), path_length - 2);
    return max(point < 0 ? point + path_length : point, 0);
}

}  // namespace

std::array<double, 2> try_profile(const Among& among, Row<const PathPoint> path, int free, const Profile& profile,
                                  bool turns_now) {
    const Limiter& limiter = among.here.limiter;
    double speed = among.here.speed, way = 0.0, scored = 0.0, gap = most_room;
    double slows = min(max(-among.here.memory.acceleration, 0.0), limiter.braking);
    for (int step = 1; step <= (turns_now ? soon : steps); ++step) {
        const double time = step * step_time;
        const PathPoint& here = path[point_at(way)];
        const double share = max(1.0 - speed * speed * std::abs(here.curvature) / limiter.lateral - here.turning, 0.1);
        double aim = 0.0;
        if (time - 0.5 * step_time < profile.time)
            aim = profile.share * among.onwards;
        else if (time - 0.5 * step_time < profile.time + profile.next_time)
            aim = profile.next_share * among.onwards;
        aim = min(aim, cap_at(limiter, among.room - way));
        slows = aim < speed ? min(slows + 3.0 * limiter.braking * step_time, 0.9 * share * limiter.braking) : 0.0;
        const double after =
            max(min(aim, speed + 0.8 * share * limiter.accelerating * step_time), speed - slows * step_time);
        way += 0.5 * (speed + after) * step_time;
        speed = after;
        if (time <= scored_time) scored = way;
        const double part = way / point_apart;
        if (part > path_length - 2) break;
        const double touched = touches_at + time - 0.5 * speed;
        if (part + 0.5 > free) return {touched, scored};
        const int at = point_at(way);
        const PathPoint &point = path[at], &next = path[(at + 1) % path_length];
        const double past = part - std::trunc(part);
        const Pose pose{point.x + past * (next.x - point.x), point.y + past * (next.y - point.y), point.cos, point.sin};
        gap = room_beside(among, step, pose, gap, turns_now);
        if (gap < -may_use_up) return {touched, scored};
        if (speed < 0.05 && !(profile.next_share > 0.0 && time < profile.time + profile.next_time)) {
            const double met = is_met(among, step, pose, turns_now);
            return {met == inf ? gap : touches_at + time + met, scored};
        }
    }
    return {gap, scored};
}

void judge_path(const Among& among, Row<const PathPoint> path, int free, double cost, Row<double> scores) {
    for (int k = 0; k < profile_count; ++k) {
        const auto [gap, way] = try_profile(among, path, free, profiles[k], false);
        scores[k] = gap;
        if (gap >= 0.0) {
            scores[k] = way - cost + goes_on * min(gap, way > passed_after ? most_room : room_waiting);
            if (try_profile(among, path, free, profiles[k], true)[0] < -may_use_up) scores[k] -= among.may_turn;
        } else if (gap > 0.1 * touches_at) {
            scores[k] = way - cost + per_metre * gap + tight;
        }
    }
}

namespace {

// Return whether a car that reverses keeps away from what would touch it where it stands; `walled`: or from all.
bool is_out_of_the_way_behind(const CarParameters& car, Matrix rows, Numbers reaches, bool walled) {
    const double front = front_of(car) - car.lidar_offset;
    double stands = 0.0, backs = 0.0;
    for (int step = 1; step <= backing_steps; ++step) {
        const double back = min(max(step * step_time - seen_after, 0.0), 1.0) * backs_by;
        for (std::int64_t k = 0; k < rows.rows; ++k) {
            const Prediction& target = prediction(rows[k]);
            const auto [near, far] = occupied(rows[k], step * step_time, 0.0);
            for (const double offset : {front, 0.0, -car.lidar_offset}) {
                const double dx = offset - target.x, dy = -target.y;
                const double along = target.cos * dx + target.sin * dy, across = target.cos * dy - target.sin * dx;
                stands = min(stands, std::sqrt(apart(near, far, along, across)) - reaches[k]);
                const double square = apart(near, far, along - back * target.cos, across + back * target.sin);
                backs = min(backs, std::sqrt(square) - reaches[k]);
            }
        }
    }
    return backs > max(stands + 0.02, -may_use_up) || (walled && backs == 0.0);
}

// Return whether the car can stop before what stands, after a tick towards a place x, y at a speed `first` [m/s].
// It stops towards the goal, towards that place, or as its wheels then stand. `margin` is ahead of the bumper [m].
bool can_stop(const Situation& here, std::array<double, 2> goal, double x, double y, double first, double margin) {
    const CarParameters& car = here.limiter.car;
    const double turn = max(min(0.7 * (steering_to(car, x, y) - here.angle), most_turn), -most_turn);
    const double angle = here.angle + turn;
    const double along = bearing_of_arc(angle, here.settings.pursuit_distance, car.lidar_offset, car.wheelbase);
    const double view = reading_towards(here, fg::cos(along), fg::sin(along));
    const Situation alone = among_standing(here, angle);
    const std::array<double, 2> ways[] = {goal, {fg::atan2(y, x), fg::hypot(x, y)}, {along, max(view, arrived)}};
    for (const auto [bearing, distance] : ways)
        for (const double use : {1.0, 0.5}) {
            const Plan stop{bearing, distance, Matrix{nullptr, 0, 4}, first, margin};
            if (simulate(alone, stop, use, here.speed).what == Met::free) return true;
        }
    return false;
}

// Return the path and the profile with the greatest score, the first of equals; NaN counts as the greatest.
std::array<int, 2> best_of(const Scores& scores) {
    int number = 0, k = 0;
    for (int i = 0; i < path_count; ++i)
        for (int j = 0; j < profile_count; ++j) {
            if (std::isnan(scores[i][j])) return {i, j};
            if (scores[i][j] > scores[number][k]) number = i, k = j;
        }
    return {number, k};
}

// Return the best of the motions after whose next tick the car can stop before what stands.
std::tuple<std::int64_t, double, double> choose(const Among& among, PlanInTime& plan, std::array<double, 3> pose,
                                                std::array<double, 2> goal, const Scores& scores,
                                                const std::array<Place, path_count>& places) {
    const Situation& here = among.here;
    const double cap = cap_at(here.limiter, among.room);
    for (const double margin : stop_margins) {
        Scores left = scores;
        for (int attempt = 0; attempt < tried; ++attempt) {
            const auto [number, k] = best_of(left);
            if (left[number][k] == -inf) break;
            const double x = places[number].x, y = places[number].y;
            const double first = first_speed(profiles[k], among.onwards, cap);
            if (can_stop(here, goal, x, y, first, margin)) {
                const double cos = fg::cos(pose[2]), sin = fg::sin(pose[2]);
                plan.kept = plan.tick;
                plan.x = pose[0] + cos * x - sin * y, plan.y = pose[1] + sin * x + cos * y;
                return {plan_drives, steering_to(here.limiter.car, x, y), first};
            }
            for (int other = 0; other < profile_count; ++other)  // their next command is the same
                if (first_speed(profiles[other], among.onwards, cap) == first) left[number][other] = -inf;
        }
    }
    return {no_plan, 0.0, 0.0};
}

}  // namespace

bool is_among(Matrix rows) {
    for (std::int64_t k = 0; k < rows.rows; ++k) {
        const Prediction& target = prediction(rows[k]);
        const double away = fg::hypot(target.x, target.y);
        if (away < near_anywhere || (away < near_ahead && target.x > 0.0)) return true;
    }
    return false;
}

std::tuple<std::int64_t, double, double> plan_in_time(const Situation& here, PlanInTime& plan,
                                                      std::array<double, 3> pose, std::array<double, 2> goal,
                                                      double onwards, bool may_back_off) {
    const Matrix rows = here.movers;
    const CarParameters& car = here.limiter.car;
    const int parts = rows.rows < 3 ? parts_in_turn : parts_among_many;
    ++plan.tick;
    plan.waited = here.speed < 1.0 ? plan.waited + here.period : 0.0;
    if (here.speed > drove) plan.backed = 0.0;
    const double bold = min(max(plan.waited - bold_after, 0.0) / bold_after, 1.0);
    const OwnTable<double> spans = spans_of(rows, bold);
    const OwnRow<double> reaches = reaches_of(car, rows, bold);
    const auto [among, far] = look_among(here, goal, onwards, bold, spans, reaches);
    Scores scores;
    for (auto& of_path : scores) of_path.fill(-inf);
    std::array<Place, path_count> places{};
    std::array<PathPoint, path_length> points{};
    const Row<PathPoint> path{points.data(), path_length};
    int longest = 0;
    for (int number = 0; number < path_count; ++number) {
        if (0 < number && number < places_across && (number + plan.tick) % parts != 0) continue;
        const Place place = places[number] = place_of(among, plan, pose, goal[0], far, number);
        if (!place.found) continue;
        const double cost =
            steers * std::abs(steering_to(car, place.x, place.y) - here.angle) + goes_aside * place.aside;
        const int free = lay_path(among, place.x, place.y, path);
        longest = max(longest, free);
        judge_path(among, path, free, cost, {scores[number].data(), profile_count});
        if (number == path_count - 1)
            for (double& score : scores[number]) score += worth_of_kept;
    }
    const bool walled = longest < walled_below && plan.waited > waits_before_wall;
    const auto [number, k] = best_of(scores);
    may_back_off = may_back_off && plan.backed < farthest_back && (walled || scores[number][k] < free_from);
    if (may_back_off && is_out_of_the_way_behind(car, rows, among.reaches, walled)) {
        plan.backed += max(-here.speed, 0.0) * here.period;
        return {plan_backs_off, 0.0, 0.0};
    }
    return choose(among, plan, pose, goal, scores, places);
}

}  // namespace fg
