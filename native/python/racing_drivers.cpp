// Binds the drivers among other cars of native/addons/drivers: their records, and functions for tests.
#include "../addons/drivers/overtaker.hpp"
#include "bindings.hpp"
#include "callable.hpp"
#include "tables.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace fg {
namespace {

Matrix counted(Matrix points, std::int64_t count) {
    require(points.columns == 2 && 0 <= count && count <= points.rows, "points are not (n, 2), or not so many");
    return {points.data, count, points.columns};
}

std::int64_t checked_points(const ScanGeometry& geometry, Numbers ranges, Table<double> points) {
    counted(points, 0);
    return ground_points(geometry, ranges, points);
}

std::array<double, 2> checked_room(Matrix points, std::int64_t count, double x, double y, double heading) {
    return room_beside(counted(points, count), x, y, heading);
}

std::int64_t checked_walk(Matrix points, std::int64_t count, double x, double y, double heading, Table<double> path) {
    require(path.rows > 0 && path.columns == 5, "a path is not (k, 5)");
    return walk(counted(points, count), x, y, heading, {reinterpret_cast<WalkPlace*>(path.data), path.rows});
}

std::int64_t checked_boxes(const ScanGeometry& geometry, Numbers ranges, double noise, Table<double> found) {
    counted(found, 0);
    return find_boxes(geometry, ranges, noise, found);
}

}  // namespace

void bind_racing_drivers(nb::module_& module) {
    FG_ADD(CarSeen);
    FG_ADD(OtherCars);
    FG_ADD(OvertakerSettings);
    FG_ADD(Passing);
    FG_ADD(Racing);
    FG_ADD(Told);
    module.def("ground_points", callable(checked_points), "geometry"_a, "ranges"_a, "points"_a);
    module.def("room_beside", callable(checked_room), "points"_a, "count"_a, "x"_a, "y"_a, "heading"_a);
    module.def("walk", callable(checked_walk), "points"_a, "count"_a, "x"_a, "y"_a, "heading"_a, "path"_a);
    module.def("find_boxes", callable(checked_boxes), "geometry"_a, "ranges"_a, "noise"_a, "found"_a);
    module.def("watch_cars", callable(watch_cars), "memory"_a, "geometry"_a, "ranges"_a, "odometry"_a,
               "lidar_offset"_a);
    module.def("follow_told", callable(follow_told), "memory"_a, "told"_a, "geometry"_a, "ranges"_a, "odometry"_a,
               "car"_a);
    module.def("hide_cars", callable(hide_cars), "memory"_a, "geometry"_a, "ranges"_a);
    module.def("choose", callable(choose), "memory"_a, "geometry"_a, "without"_a, "car"_a, "settings"_a);
    module.def("predict_cars", callable(predict_cars), "memory"_a, "car"_a, "braking"_a, "predictions"_a);
    module.def("take_lane", callable(take_lane), "memory"_a, "own_speed"_a, "driver"_a, "settings"_a, "reference"_a);
}

}  // namespace fg
