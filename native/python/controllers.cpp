// Binds native/controllers/control: the steps of a tick by their addresses, and functions of records.
#include "../controllers/control/actuation.hpp"
#include "../controllers/control/band_program.hpp"
#include "../controllers/control/decision.hpp"
#include "../controllers/control/driving.hpp"
#include "../controllers/control/slip.hpp"
#include "../controllers/control/speed.hpp"
#include "../controllers/control/steering.hpp"
#include "../controllers/control/tracking.hpp"
#include "bindings.hpp"
#include "callable.hpp"
#include "tables.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using WithoutGil = nb::call_guard<nb::gil_scoped_release>;

namespace fg {
namespace {

// Arrays of a program of n points on a ring.
void check_ring(Matrix bands, std::initializer_list<Numbers> rows) {
    require(bands.rows == 3 && bands.columns >= 6, "bands are not (3, n) with n at least 6");
    for (const Numbers& row : rows) require(row.length == bands.columns, "an array is not (n,) where bands are (3, n)");
}

bool checked_least(Matrix bands, Numbers gradient, Numbers low, Numbers high, Row<double> x) {
    check_ring(bands, {gradient, low, high, x});
    return least_on_ring(bands, gradient, low, high, x);
}

void checked_solve(Matrix bands, Numbers right, Row<double> x) {
    check_ring(bands, {right, x});
    solve_ring(bands, right, x);
}

bool checked_propose(TickRecord& tick, const Trajectories& trajectories, Row<double> ranges,
                     Row<double> ranges_without_movers, Row<double> command, Matrix path, double speed) {
    require(ranges_without_movers.length == ranges.length && command.length == 2,
            "the scans have not as many beams, or a command is not (2,)");
    return propose({tick.geometry, tick.odometry, ranges, ranges, ranges_without_movers, tick.driver, {}, trajectories,
                    tick.reference, tick.memory, {}, command, tick},
                   path, speed);
}

void check_motion(Matrix points, std::int64_t index) {
    require(points.columns >= 4 && 0 <= index && index < points.rows,
            "a motion is not (n, 4 or more), or has no such point");
}

std::int64_t checked_next(Matrix points, std::int64_t index, double x, double y, double heading) {
    check_motion(points, index);
    return next_point(points, index, x, y, heading);
}

std::array<double, 3> checked_errors(Numbers point, double x, double y, double heading) {
    require(point.length >= 4, "a point is not (4 or more,)");
    return errors(point, x, y, heading);
}

double checked_steer(Matrix points, std::int64_t index, std::tuple<double, double, double> pose, double speed,
                     double wheelbase, double late, double path_late) {
    check_motion(points, index);
    const auto [x, y, heading] = pose;
    return steer_along(points, index, {x, y, heading}, speed, wheelbase, late, path_late);
}

void checked_tightest(Slip& slip, Numbers speeds, Numbers forces, double lock, double wheelbase, double gravity) {
    require(speeds.length == slip_speeds && forces.length == slip_speeds, "speeds and forces are not (128,)");
    find_tightest(slip, speeds, forces, lock, wheelbase, gravity);
}

void bind_slip(nb::module_& module) {
    module.def("slip_angle", callable(slip_angle), "axle"_a, "force"_a);
    module.def("held_on_arc", callable(held_on_arc), "slip"_a, "car"_a, "angle"_a, "lateral"_a, "back"_a, "brakes"_a,
               "use"_a);
    module.def("steered", callable(steered), "slip"_a, "car"_a, "angle"_a, "speed"_a);
    module.def("arc_angle", callable(arc_angle), "slip"_a, "car"_a, "steering_angle"_a, "speed"_a);
    module.def("find_tightest", callable(checked_tightest), "slip"_a, "speeds"_a, "forces"_a, "lock"_a, "wheelbase"_a,
               "gravity"_a);
    module.def("tightest_arc", callable(tightest_arc), "slip"_a, "speed"_a);
    module.def("lock_arc", callable(lock_arc), "slip"_a, "car"_a);
    module.def("stable_braking", callable(stable_braking), "slip"_a, "use"_a, "speed"_a);
    module.def("held_arc", callable(held_arc), "slip"_a, "car"_a, "angle"_a, "curvature"_a);
    module.def("path_lag", callable(path_lag), "slip"_a, "speed"_a);
    module.def("drag", callable(drag), "car"_a, "speed"_a);
    module.def("ground_speed", callable(ground_speed), "slip"_a, "car"_a, "wheels"_a, "angle"_a, "command"_a);
}

void bind_laws(nb::module_& module) {
    module.def("friction_speed", callable(friction_speed), "steering_angle"_a, "mu"_a, "wheelbase"_a, "gravity"_a);
    module.def("friction_steering", callable(friction_steering), "speed"_a, "mu"_a, "wheelbase"_a, "gravity"_a);
    module.def("distance_ahead_speed", callable(distance_ahead_speed), "distance"_a, "safe"_a, "full_speed"_a,
               "top_speed"_a);
    module.def("mean_range_speed", callable(mean_range_speed), "ranges"_a, "lookahead"_a, "gain"_a, "top_speed"_a);
    module.def("saturate", callable(saturate), "value"_a, "limit"_a);
    module.def("pursue", callable(pursue), "bearing"_a, "distance"_a, "lidar_offset"_a, "wheelbase"_a);
    module.def("arc_through", callable(arc_through), "x"_a, "y"_a, "wheelbase"_a);
    module.def("bearing_of_arc", callable(bearing_of_arc), "steering_angle"_a, "distance"_a, "lidar_offset"_a,
               "wheelbase"_a);
    module.def("late_by", callable(late_by), "car"_a);
}

void bind_driving(nb::module_& module) {
    module.def("next_point", callable(checked_next), "points"_a, "index"_a, "x"_a, "y"_a, "heading"_a);
    module.def("errors", callable(checked_errors), "point"_a, "x"_a, "y"_a, "heading"_a);
    module.def("steer_along", callable(checked_steer), "points"_a, "index"_a, "pose"_a, "speed"_a, "wheelbase"_a,
               "late"_a, "path_late"_a);
    module.def("refer_to_goal", callable(refer_to_goal), "tick"_a, "filtered"_a, "bearing"_a, "distance"_a);
    module.def("refer", callable(refer), "tick"_a, "filtered"_a, "steering_angle"_a, "speed"_a, "bearing"_a,
               "distance"_a);
    module.def("propose", callable(checked_propose), "tick"_a, "trajectories"_a, "ranges"_a, "ranges_without_movers"_a,
               "command"_a, "path"_a, "speed"_a);
    module.def("read_speedometer", callable(read_speedometer), "memory"_a, "speed"_a, "car"_a, "period"_a);
    module.def("command_speed", callable(command_speed), "memory"_a, "speed"_a, "car"_a, "max_speed"_a, "period"_a,
               "left_alone"_a);
    module.def("least_on_ring", callable(checked_least), "bands"_a, "gradient"_a, "low"_a, "high"_a, "x"_a,
               WithoutGil());
    module.def("solve_ring", callable(checked_solve), "bands"_a, "right"_a, "x"_a);
}

}  // namespace

void bind_controllers(nb::module_& module) {
    module.attr("STEPS") = nb::dict();
    add_steps(module, steps());
    bind_slip(module);
    bind_laws(module);
    bind_driving(module);
}

}  // namespace fg
