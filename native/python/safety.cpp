// Binds native/controllers/safety for Python, and for tests: the friction limiter, lines, motions and the judge.
#include "../controllers/control/driving.hpp"
#include "../controllers/safety/friction_limiter.hpp"
#include "../controllers/safety/guidance.hpp"
#include "../controllers/safety/judge.hpp"
#include "../controllers/safety/lap_raceline.hpp"
#include "../controllers/safety/lap_trial.hpp"
#include "../controllers/safety/line_following.hpp"
#include "../controllers/safety/line_optimizer.hpp"
#include "../controllers/safety/motion_search.hpp"
#include "bindings.hpp"
#include "callable.hpp"
#include "situation_casters.hpp"

namespace nb = nanobind;
using namespace nb::literals;

NAMESPACE_BEGIN(NB_NAMESPACE)
NAMESPACE_BEGIN(detail)

template <>
struct type_caster<fg::Wanted> : tuple_caster<fg::Wanted, double, double, fg::Matrix, bool, fg::Matrix, bool> {};
template <>
struct type_caster<fg::Query>
    : tuple_caster<fg::Query, double, double, double, double, double, double, std::int64_t, bool, std::int64_t> {};
template <>
struct type_caster<fg::Grip>
    : tuple_caster<fg::Grip, double, fg::Numbers, fg::Numbers, double, double, double, double, double, double> {};

NAMESPACE_END(detail)
NAMESPACE_END(NB_NAMESPACE)

namespace fg {
namespace {

using Two = std::tuple<double, double>;
using WithoutGil = nb::call_guard<nb::gil_scoped_release>;

void checked_held(Matrix axles, double mu, double moved, bool soft, bool shaft, Row<double> found) {
    require(axles.rows == 6 && axles.columns == 2 && found.length == limiter_shares,
            "axles are not (6, 2), or found is not (257,)");
    find_held(axles, mu, moved, soft, shaft, found);
}

std::array<double, 2> limited_of(const Limiter& limiter, LimiterMemory& memory, Two reference, double least_lateral_use,
                                 Two present, double period, bool planned) {
    return limited(limiter, memory, {std::get<0>(reference), std::get<1>(reference)}, least_lateral_use,
                   {std::get<0>(present), std::get<1>(present)}, period, planned);
}

void check_path(Matrix path) {
    require(path.rows == 0 || path.columns == 4 || path.columns == 5, "a path is not (n, 4) or (n, 5)");
}

std::tuple<double, double, std::int64_t> checked_simulate(Situation here, Plan plan, double use, double speed) {
    check_situation(here);
    check_path(plan.path);
    const Met met = simulate(here, plan, use, speed);
    return {met.speed, met.time, met.what};
}

double checked_reading(Situation here, double bearing) {
    check_situation(here);
    return reading(here, bearing);
}

void checked_judge(Situation here, Wanted wanted, Judge& memory) {
    check_situation(here);
    check_path(wanted.path);
    check_path(wanted.last_stop);
    judge(here, wanted, memory);
}

bool search_of(FrontierSearch& frontier, const Limiter& limiter, Motion& motion, Query query) {
    return search_motion(frontier, limiter, motion, query);
}

Ends checked_ends(const LocalMap& world, std::int64_t count) {
    require(0 <= count && count <= table(world.ends).rows, "the map has not so many ends");
    return sorted_ends(world, count);
}

bool touches_of(const Ends& ends, Held<const CarParameters> car, double x, double y, double cos, double sin,
                double margin) {
    return touches(ends, car, x, y, cos, sin, margin);
}

void checked_shape(Line& line, const LapMap& lap, Cube<const double> walls, const Limiter& limiter, double max_speed) {
    require(lap.closed && 0 < lap.count && walls.length == lap.count && walls.rows == lap_beams && walls.columns == 3,
            "the lap is not closed, or walls are not of it");
    shape_line(line, lap, walls, limiter, max_speed);
}

auto proposal_of(Held<Remembered> remembered, Held<const Odometry> odometry, Held<const Limiter> limiter,
                 double shift) {
    LineProposal found = propose_line(remembered, odometry, limiter, shift);
    return std::tuple(found.state, to_numpy(std::move(found.points)), found.steering_angle, found.speed);
}

void check_line(const Line& line) {
    require(0 < line.count && line.count <= line_points, "a line has no points, or too many");
}

void checked_describe(Line& line, const Limiter& limiter) {
    check_line(line);
    describe_line(line, limiter);
}

OwnTable<double> checked_ahead(const Line& line, std::int64_t first, double x, double y, double heading,
                               const Limiter& limiter) {
    check_line(line);
    require(0 <= first && first <= line.count, "a line has no such point");
    return line_ahead(line, first, x, y, heading, limiter);
}

void check_window(Matrix window) {
    require(window.rows >= 2 && window.columns == window_columns, "a window is not (n, 7) with n at least 2");
}

void checked_speeds(Table<double> window, double spacing, const Limiter& limiter) {
    check_window(window);
    write_speeds(window, spacing, limiter);
}

std::array<double, 3> checked_position(Matrix window, std::int64_t point, double spacing) {
    check_window(window);
    require(0 < point && point < window.rows, "a window has no such point");
    return position_on(window, point, spacing);
}

double checked_speed(Matrix window, double position, double spacing, double now) {
    check_window(window);
    return speed_on(window, position, spacing, now);
}

auto grip_of(Held<const Limiter> limiter, double max_speed, std::tuple<double, double, double> uses,
             double turning_use) {
    const auto [cornering, braking, accelerating] = uses;
    OwnRow<double> ahead(grip_entries), back(grip_entries);
    const Grip grip = limited_grip(limiter, max_speed, {cornering, braking, accelerating}, turning_use, ahead, back);
    return std::tuple(grip.lateral, to_numpy(std::move(ahead)), to_numpy(std::move(back)), grip.power, grip.max_speed,
                      grip.lock, grip.use, grip.turning, grip.turning_out);
}

void check_closed(Matrix line) {
    require(line.rows >= 3 && line.columns == 2, "a closed line is not (n, 2) with n at least 3");
}

OwnTable<double> checked_normals(Matrix line) {
    check_closed(line);
    return normals_of(line);
}

void checked_measure(Matrix line, Row<double> bends, Row<double> to, Row<double> on) {
    check_closed(line);
    for (const Row<double>& row : {bends, to, on})
        require(row.length == line.rows, "bends, to and on are not as long as the line");
    measure(line, bends, to, on);
}

auto checked_begin(Matrix line, std::int64_t step, double spacing) {
    check_closed(line);
    require(step >= 0 && spacing > 0.0, "there is no such step, or no spacing");
    auto [points, most] = begin_step(line, step, spacing);
    return std::tuple(to_numpy(std::move(points)), most);
}

OwnTable<double> checked_spread(Matrix line, std::int64_t count) {
    check_closed(line);
    require(count >= 0, "count is below 0");
    return spread(line, count);
}

void check_grip(const Grip& grip) {
    require(grip.accelerating.length >= 2 && grip.braking.length >= 2, "the tables of a grip have not two entries");
}

std::tuple<std::int64_t, double> checked_improve(Table<double> line, Matrix normals,
                                                 std::tuple<Row<double>, Row<double>> room, std::int64_t step,
                                                 double weight, Grip grip) {
    const auto [low, high] = room;
    require(line.rows >= 6 && line.columns == 2 && normals.rows == line.rows && normals.columns == 2 &&
                low.length == line.rows && high.length == line.rows && step >= 0,
            "line, normals and room are not (n, 2), (n, 2) and (n,) with n at least 6");
    check_grip(grip);
    return improve(line, normals, {low, high}, step, weight, grip);
}

double checked_lap(Numbers bends, Numbers steps, Grip grip, Row<double> speeds, Row<double> by_bend,
                   Row<double> by_step) {
    for (const Numbers& row : {steps, Numbers(speeds), Numbers(by_bend), Numbers(by_step)})
        require(row.length == bends.length && row.length >= 3, "the arrays are not (n,) with n at least 3");
    check_grip(grip);
    return fastest_lap(bends, steps, grip, speeds, by_bend, by_step);
}

void bind_limiter(nb::module_& module) {
    module.def("find_held", callable(checked_held), "axles"_a, "mu"_a, "moved"_a, "soft"_a, "shaft"_a, "found"_a);
    module.def("limited", callable(limited_of), "limiter"_a, "memory"_a, "reference"_a, "least_lateral_use"_a,
               "present"_a, "period"_a, "planned"_a);
    module.def("held_on_circle", callable(held_on_circle), "limiter"_a, "steering_angle"_a, "speed"_a, "now"_a,
               "least_lateral_use"_a);
    module.def("longitudinal_share", callable(longitudinal_share), "limiter"_a, "lateral_use"_a, "braking"_a);
}

void bind_motions(nb::module_& module) {
    module.def("simulate", callable(checked_simulate), "here"_a, "plan"_a, "use"_a, "speed"_a, WithoutGil());
    module.def("reading", callable(checked_reading), "here"_a, "bearing"_a);
    module.def("judge", callable(checked_judge), "here"_a, "wanted"_a, "memory"_a, WithoutGil());
    module.def("search_motion", callable(search_of), "frontier"_a, "limiter"_a, "motion"_a, "query"_a, WithoutGil());
    nb::class_<Ends>(module, "Ends");
    module.def("sorted_ends", callable(checked_ends), "world"_a, "count"_a);
    module.def("touches", touches_of, "ends"_a, "car"_a, "x"_a, "y"_a, "cos"_a, "sin"_a, "margin"_a);
    module.def("speed_to_stop", callable(speed_to_stop), "geometry"_a, "ranges"_a, "limiter"_a, "settings"_a);
}

void bind_lap(nb::module_& module) {
    module.def("keep_lap", callable(keep_lap), "remembered"_a, "geometry"_a, "ranges"_a, "odometry"_a, "driver"_a,
               WithoutGil());
    module.def("shape_line", callable(checked_shape), "line"_a, "lap"_a, "walls"_a, "limiter"_a, "max_speed"_a,
               WithoutGil());
    module.def("propose_line", proposal_of, "remembered"_a, "odometry"_a, "limiter"_a, "shift"_a);
    module.def("move_car", callable(move_car), "trial"_a, "limiter"_a, "since"_a, "period"_a);
    module.def("on_line", callable(on_line), "limiter"_a);
    module.def("describe_line", callable(checked_describe), "line"_a, "limiter"_a);
    module.def("line_ahead", callable(checked_ahead), "line"_a, "first"_a, "x"_a, "y"_a, "heading"_a, "limiter"_a);
    module.def("write_speeds", callable(checked_speeds), "window"_a, "spacing"_a, "limiter"_a);
    module.def("position_on", callable(checked_position), "window"_a, "point"_a, "spacing"_a);
    module.def("speed_on", callable(checked_speed), "window"_a, "position"_a, "spacing"_a, "now"_a);
}

void bind_lines(nb::module_& module) {
    module.def("limited_grip", grip_of, "limiter"_a, "max_speed"_a, "uses"_a, "turning_use"_a);
    module.def("normals_of", callable(checked_normals), "line"_a);
    module.def("measure", callable(checked_measure), "line"_a, "bends"_a, "to"_a, "on"_a);
    module.def("begin_step", checked_begin, "line"_a, "step"_a, "spacing"_a);
    module.def("improve", callable(checked_improve), "line"_a, "normals"_a, "room"_a, "step"_a, "weight"_a, "grip"_a,
               WithoutGil());
    module.def("spread", callable(checked_spread), "line"_a, "count"_a);
    module.def("fastest_lap", callable(checked_lap), "bends"_a, "steps"_a, "grip"_a, "speeds"_a, "by_bend"_a,
               "by_step"_a, WithoutGil());
}

}  // namespace

void bind_safety(nb::module_& module) {
    bind_limiter(module);
    bind_motions(module);
    bind_lap(module);
    bind_lines(module);
}

}  // namespace fg
