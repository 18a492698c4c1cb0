// Binds native/addons/drivers: the steps of all, profiles of lines, and functions for tests.
// Shapes that do not fit together are refused with a ValueError.
#include "../addons/drivers/line_mpc.hpp"
#include "../addons/drivers/line_profile.hpp"
#include "../addons/drivers/line_trackers.hpp"
#include "../addons/drivers/ltv_program.hpp"
#include "../addons/drivers/map_raceline.hpp"
#include "../addons/drivers/pure_pursuit.hpp"
#include "../addons/drivers/steps.hpp"
#include "bindings.hpp"
#include "callable.hpp"
#include "tables.hpp"
#include "tuple_casters.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using WithoutGil = nb::call_guard<nb::gil_scoped_release>;

NAMESPACE_BEGIN(NB_NAMESPACE)
NAMESPACE_BEGIN(detail)

template <>
struct type_caster<fg::Program> : tuple_caster<fg::Program, fg::Cube<const double>, fg::Matrix, fg::Matrix, fg::Matrix,
                                               fg::Numbers, fg::Numbers, fg::Cube<const double>, fg::Numbers> {};
template <>
struct type_caster<fg::Walls> : tuple_caster<fg::Walls, fg::Matrix, fg::Matrix, fg::Numbers,
                                             fg::Table<const std::int64_t>> {};

NAMESPACE_END(detail)
NAMESPACE_END(NB_NAMESPACE)

namespace fg {
namespace {

void check_line(Matrix line) {
    require(line.rows >= 2 && line.columns == line_columns && line[0][line_step] > 0.0,
            "a line is not (n, 6) with n at least 2, and steps");
}

void checked_limit(Table<double> table, Numbers bend, const Limiter& limiter, double cornering_use,
                   double braking_use) {
    check_line(table);
    require(bend.length == table.rows, "there is not one curvature for each point");
    limit_speeds(table, bend, limiter, cornering_use, braking_use);
}

int checked_program(const Program& program, Row<double> inputs, Table<double> states, int most) {
    const std::int64_t count = program.b.rows, size = program.b.columns;
    const auto fits = [&](Matrix table, std::int64_t rows) { return table.rows == rows && table.columns == size; };
    require(count > 0 && size > 0 && program.a.length == count && program.a.rows == size && program.a.columns == size &&
                fits(program.c, count) && fits(program.weights, count + 1) && program.effort.length == count &&
                program.coupling.length == count && program.start.length == size && inputs.length == count &&
                fits(states, count + 1),
            "the arrays of a program do not fit together");
    const Cube<const double>& limits = program.limits;
    require(limits.length == 3 && limits.rows == count && limits.columns == bounded, "limits are not (3, n, 4)");
    return solve_program(program, inputs, states, most);
}

std::tuple<double, double, std::int64_t> checked_plan(Matrix line, std::int64_t nearest, const Odometry& odometry,
                                                      const Driver& driver, double period, Mpc& mpc) {
    check_line(line);
    require(nearest >= 0 && nearest < line.rows, "there is no such point of the line");
    return plan_steering(line, nearest, odometry, driver, period, mpc);
}

// Return the rows of what is ahead (21, 6), for a system of so many entries of a state.
Row<const Ahead> ahead_of(Matrix ahead, const System& system, std::int64_t size) {
    require(ahead.rows == mpc_steps + 1 && ahead.columns * sizeof(double) == sizeof(Ahead),
            "what is ahead is not (21, 6)");
    require(system.a.length == mpc_steps && system.a.rows == size && system.a.columns == size, "a does not fit");
    for (const Matrix table : {Matrix(system.b), Matrix(system.c)})
        require(table.rows == mpc_steps && table.columns == size, "b or c does not fit");
    return {reinterpret_cast<const Ahead*>(ahead.data), ahead.rows};
}

void checked_kinematic(Matrix ahead, const CarParameters& car, Cube<double> a, Table<double> b, Table<double> c) {
    kinematic(ahead_of(ahead, {a, b, c}, 3), car, {a, b, c});
}

void checked_single_track(Matrix ahead, const Driver& driver, Cube<double> a, Table<double> b, Table<double> c) {
    single_track(ahead_of(ahead, {a, b, c}, 5), driver, {a, b, c});
}

std::array<double, 2> checked_goal(Matrix line, const PurePursuitSettings& settings, const Driver& driver, double x,
                                   double y, double speed) {
    check_line(line);
    return goal_on_line(line, settings, driver, x, y, speed);
}

void checked_room(Matrix line, Matrix normals, const Walls& walls, std::tuple<double, double, double> outline,
                  double most, Row<double> low, Row<double> high) {
    for (const Matrix table : {line, normals})
        require(table.rows == line.rows && table.columns == 2, "line and normals are not (n, 2)");
    require(low.length == line.rows && high.length == line.rows, "low and high are not (n,)");
    require(walls.points.columns == 2 && walls.sides.rows == walls.points.rows && walls.sides.columns == 2 &&
                walls.origin.length == 2 && walls.starts.rows > 0 && walls.starts.columns > 1,
            "the arrays of the walls do not fit together");
    for (std::int64_t column = 0; column < walls.starts.rows; ++column)
        for (std::int64_t row = 0; row < walls.starts.columns; ++row)
            require(walls.starts[column][row] >= 0 && walls.starts[column][row] <= walls.points.rows,
                    "a cell begins beyond the points");
    const auto [half, tail, nose] = outline;
    find_room(line, normals, walls, {half, tail, nose}, most, low, high);
}

}  // namespace

void bind_drivers(nb::module_& module) {
    add_steps(module, driver_steps());
    FG_ADD(Mpc);
    FG_ADD(OnLine);
    FG_ADD(PurePursuitSettings);
    module.attr("LINE_ROOM") = line_room;
    module.attr("WALL_CELL") = walls_cell;
    module.attr("MPC_STEPS") = mpc_steps;
    module.attr("MPC_TIME") = mpc_time;
    module.def("limit_speeds", callable(checked_limit), "table"_a, "bend"_a, "limiter"_a, "cornering_use"_a,
               "braking_use"_a, WithoutGil());
    module.def("lqr_feedback", callable(lqr_feedback), "aside"_a, "angle"_a, "length"_a);
    module.def("solve_program", callable(checked_program), "program"_a, "inputs"_a, "states"_a, "most"_a,
               WithoutGil());
    module.def("plan_steering", callable(checked_plan), "line"_a, "nearest"_a, "odometry"_a, "driver"_a, "period"_a,
               "mpc"_a, WithoutGil());
    module.def("place_at_command", callable(place_at_command), "odometry"_a, "car"_a, "angle"_a, "mpc"_a);
    module.def("kinematic", callable(checked_kinematic), "ahead"_a, "car"_a, "a"_a, "b"_a, "c"_a);
    module.def("single_track", callable(checked_single_track), "ahead"_a, "driver"_a, "a"_a, "b"_a, "c"_a);
    module.def("goal_on_line", callable(checked_goal), "line"_a, "settings"_a, "driver"_a, "x"_a, "y"_a, "speed"_a);
    module.def("find_room", callable(checked_room), "line"_a, "normals"_a, "walls"_a, "outline"_a, "most"_a, "low"_a,
               "high"_a, WithoutGil());
}

}  // namespace fg
