// Binds what native/controllers/safety does about things that move, about turning and going back, and planned stops.
// Shapes that do not fit together are refused with a ValueError.
#include <nanobind/stl/array.h>

#include "../controllers/safety/braking_trajectories.hpp"
#include "../controllers/safety/plan_in_time.hpp"
#include "../controllers/safety/predictions.hpp"
#include "../controllers/safety/recovery.hpp"
#include "../controllers/safety/turning.hpp"
#include "bindings.hpp"
#include "callable.hpp"
#include "situation_casters.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using WithoutGil = nb::call_guard<nb::gil_scoped_release>;

NAMESPACE_BEGIN(NB_NAMESPACE)
NAMESPACE_BEGIN(detail)

template <>
struct type_caster<fg::Among> : tuple_caster<fg::Among, fg::Situation, std::array<double, 2>, double, double, double,
                                             fg::Matrix, fg::Numbers, double> {};

NAMESPACE_END(detail)
NAMESPACE_END(NB_NAMESPACE)

namespace fg {
namespace {

constexpr std::int64_t columns = sizeof(Prediction) / sizeof(double);

void check_rows(Matrix rows) { require(rows.rows == 0 || rows.columns == columns, "predictions are not (k, 12)"); }

void check_row(Numbers row) { require(row.length == columns, "a prediction is not (12,)"); }

std::array<double, 2> checked_interval(Numbers row, double time) {
    check_row(row);
    return interval(row, time);
}

std::array<double, 2> checked_occupied(Numbers row, double time, double bold) {
    check_row(row);
    return occupied(row, time, bold);
}

bool checked_meets(Matrix rows, double ahead, double left, double radius, double time) {
    check_rows(rows);
    return meets(rows, ahead, left, radius, time);
}

void checked_separate(const ScanGeometry& geometry, Row<double> seen, Row<double> ranges_without_movers,
                      Predictions& memory) {
    require(seen.length == ranges_without_movers.length, "the two scans have not as many beams");
    separate(geometry, seen, ranges_without_movers, memory);
}

std::tuple<std::int64_t, double, double> checked_plan(const Situation& here, PlanInTime& plan,
                                                      std::array<double, 3> pose, std::array<double, 2> goal,
                                                      double onwards, bool may_back_off) {
    check_situation(here);
    return plan_in_time(here, plan, pose, goal, onwards, may_back_off);
}

OwnRow<double> checked_reaches(const CarParameters& car, Matrix rows, double bold) {
    check_rows(rows);
    return reaches_of(car, rows, bold);
}

OwnTable<double> checked_spans(Matrix rows, double bold) {
    check_rows(rows);
    return spans_of(rows, bold);
}

Row<PathPoint> path_of(const Among& among, Table<double> path) {
    check_situation(among.here);
    const std::int64_t count = among.here.movers.rows;
    require(among.reaches.length == count && among.spans.columns == 3 * count && among.spans.rows == span_steps,
            "spans and reaches are not those of the targets");
    require(path.rows == path_length && path.columns == 6, "a path is not (56, 6)");
    return {reinterpret_cast<PathPoint*>(path.data), path_length};
}

int checked_lay(const Among& among, double x, double y, Table<double> path) {
    return lay_path(among, x, y, path_of(among, path));
}

std::array<double, 2> checked_try(const Among& among, Table<double> path, int free, std::array<double, 4> profile,
                                  bool turns_now) {
    return try_profile(among, path_of(among, path), free, {profile[0], profile[1], profile[2], profile[3]}, turns_now);
}

void checked_judge(const Among& among, Table<double> path, int free, double cost, Row<double> scores) {
    require(scores.length == profile_count, "the scores are not those of the profiles");
    judge_path(among, path_of(among, path), free, cost, scores);
}

void checked_trajectories(const Limiter& limiter, const BrakingSettings& settings, Numbers speeds,
                          Row<double> bearings, Row<double> distances) {
    constexpr std::int64_t count = braking_presents * most_braking_speeds * braking_turnings;
    require(speeds.length <= most_braking_speeds && bearings.length == count * braking_points &&
                distances.length == bearings.length,
            "the arrays are not those of all trajectories");
    all_trajectories(limiter, settings, speeds, {bearings.data, count, braking_points},
                     {distances.data, count, braking_points});
}

void bind_plan_in_time(nb::module_& module) {
    module.def("plan_in_time", callable(checked_plan), "here"_a, "plan"_a, "pose"_a, "goal"_a, "onwards"_a,
               "may_back_off"_a, WithoutGil());
    module.def("reaches_of", callable(checked_reaches), "car"_a, "rows"_a, "bold"_a);
    module.def("spans_of", callable(checked_spans), "rows"_a, "bold"_a);
    module.def("lay_path", callable(checked_lay), "among"_a, "x"_a, "y"_a, "path"_a);
    module.def("try_profile", callable(checked_try), "among"_a, "path"_a, "free"_a, "profile"_a, "turns_now"_a);
    module.def("judge_path", callable(checked_judge), "among"_a, "path"_a, "free"_a, "cost"_a, "scores"_a);
    nb::list all;
    for (const Profile& each : profiles)
        all.append(nb::make_tuple(each.share, each.time, each.next_share, each.next_time));
    module.attr("PROFILES") = all;
}

}  // namespace

void bind_predictions(nb::module_& module) {
    module.def("interval", callable(checked_interval), "row"_a, "time"_a);
    module.def("occupied", callable(checked_occupied), "row"_a, "time"_a, "bold"_a);
    module.def("meets", callable(checked_meets), "rows"_a, "ahead"_a, "left"_a, "radius"_a, "time"_a);
    module.def("write_predictions", callable(write_predictions), "memory"_a);
    module.def("separate", callable(checked_separate), "geometry"_a, "seen"_a, "ranges_without_movers"_a, "memory"_a);
    module.def("turned", callable(turned), "memory"_a, "angle"_a);
    bind_plan_in_time(module);
    module.def("turn_in_moves", callable(turn_in_moves), "frontier"_a, "limiter"_a, "memory"_a, "steering_angle"_a,
               "speed"_a, "period"_a, WithoutGil());
    module.def("reverses", callable(reverses), "memory"_a, "settings"_a, "world"_a, "speed"_a, "stands"_a, "found"_a,
               "waits"_a, "period"_a);
    module.def("angle_back", callable(angle_back), "world"_a, "settings"_a, "car"_a);
    module.def("safe_speed", callable(safe_speed), "trajectories"_a, "widened"_a, "angle_min"_a, "angle_increment"_a,
               "speed"_a, "steering_angle"_a);
    module.def("all_trajectories", callable(checked_trajectories), "limiter"_a, "settings"_a, "speeds"_a, "bearings"_a,
               "distances"_a, WithoutGil());
}

}  // namespace fg
