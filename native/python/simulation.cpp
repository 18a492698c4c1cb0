// Binds native/simulation. Tables of the arrays of worlds come by their addresses: nobody checks what lies there.
#include <nanobind/stl/pair.h>

#include "../simulation/clear_ground.hpp"
#include "../simulation/compiled_tick.hpp"
#include "../simulation/telemetry.hpp"
#include "../vehicle/mujoco_library.hpp"
#include "../vehicle/tire_slip.hpp"
#include "bindings.hpp"
#include "record_casters.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using WithoutGil = nb::call_guard<nb::gil_scoped_release>;

namespace fg {
namespace {

void check_slip(const Cube<const double>& slip) {
    require(slip.length == quantity::slides + 1 && slip.rows > 0 && slip.columns == 4, "slip is not (10, steps, 4)");
}

void bind_tables(nb::module_& module) {
    module.def("read_all", &read_all, "tables"_a, "firsts"_a, "which"_a, WithoutGil());
    module.def("sense_all", &sense_all, "tables"_a, "firsts"_a, "which"_a, WithoutGil());
    module.def("drive_all", &drive_all, "tables"_a, WithoutGil());
    module.def("judge_all", &judge_all, "tables"_a, WithoutGil());
    module.def("read_times", &read_times, "tables"_a, "firsts"_a, "times"_a, WithoutGil());
    module.def("read_motions_all", &read_motions_all, "tables"_a, "firsts"_a, "which"_a, "poses"_a, "velocities"_a,
               WithoutGil());
    module.def("hold", [](std::int64_t table, std::int64_t count) { hold(WorldArrays(table), count); }, "table"_a,
               "count"_a, WithoutGil());
    module.def("step",
               [](std::int64_t table, std::int64_t count, std::int64_t first, std::int64_t end, bool advance) {
                   const WorldArrays worlds(table);
                   begin_steps(worlds, count, first, end, advance);
                   step(worlds);
               },
               "table"_a, "count"_a, "first"_a, "end"_a, "advance"_a, WithoutGil());
    module.def("book", [](std::int64_t table, std::int64_t count) { book(WorldArrays(table), count); }, "table"_a,
               "count"_a, WithoutGil());
    module.def("ticks",
               [](std::int64_t table, Table<const std::int64_t> calls, double limit, std::int64_t kept,
                  Row<double> took, Row<bool> waiting) {
                   const WorldArrays worlds(table);
                   require(calls.columns == 2 && waiting.length == cars_of(worlds),
                           "calls are not (k, 2), or not as many wait as there are cars");
                   const auto [how, count] = ticks(worlds, calls, limit, kept, took, waiting);
                   return std::pair(static_cast<std::int64_t>(how), count);
               },
               "table"_a, "calls"_a, "limit"_a, "kept"_a, "took"_a, "waiting"_a, WithoutGil());
}

}  // namespace

void bind_simulation(nb::module_& module) {
    bind_tables(module);
    module.def("load_mujoco", &load_mujoco, "path"_a);
    module.def("end_row",
               [](Held<TelemetryRow> row, Cube<const double> slip) {
                   check_slip(slip);
                   end_row(row, slip);
               },
               "row"_a, "slip"_a);
    module.def("add_row",
               [](Row<Statistics> statistics, std::int64_t i, Held<const TelemetryRow> row, Cube<const double> slip) {
                   check_slip(slip);
                   require(0 <= i && i < statistics.length, "row i of the statistics is not there");
                   add_row(statistics, i, row, slip);
               },
               "statistics"_a, "i"_a, "row"_a, "slip"_a);
    module.def("outline",
               [](Table<const float> vertices, Row<const std::int32_t> starts, Row<const std::int64_t> ends,
                  Matrix places, Matrix turns, Table<double> points) {
                   require(vertices.columns == 3 && starts.length == ends.length && places.rows == ends.length &&
                               places.columns == 3 && turns.rows == ends.length && turns.columns == 4 &&
                               points.columns == 2,
                           "the arrays of prisms are not (v, 3), (n,), (n,), (n, 3), (n, 4) and (k, 2)");
                   std::int64_t first = 0;
                   for (std::int64_t prism = 0; prism < ends.length; first = ends[prism++])
                       require(first < ends[prism] && ends[prism] <= points.rows && 0 <= starts[prism] &&
                                   starts[prism] + ends[prism] - first <= vertices.rows,
                               "a prism has corners that are not there");
                   outline(vertices, starts, ends, places, turns, points);
               },
               "vertices"_a, "starts"_a, "ends"_a, "places"_a, "turns"_a, "points"_a, WithoutGil());
    module.def("fill",
               [](Matrix points, Row<const std::int64_t> ends, Numbers corner, Table<double> distances) {
                   require(points.columns == 2 && corner.length == 2, "points are not (k, 2), or corner is not (2,)");
                   std::int64_t first = 0;
                   for (std::int64_t outline = 0; outline < ends.length; first = ends[outline++])
                       require(first < ends[outline] && ends[outline] <= points.rows, "an outline has no points");
                   fill(points, ends, corner, distances);
               },
               "points"_a, "ends"_a, "corner"_a, "distances"_a, WithoutGil());
    module.def("touches_nothing",
               [](Numbers qpos, Row<const Car> cars, Matrix distances, Numbers corner, Matrix bodies) {
                   require(corner.length == 2 && bodies.columns == 9 && bodies.rows == cars.length,
                           "corner is not (2,), or bodies are not (m, 9)");
                   for (std::int64_t car = 0; car < cars.length; ++car)
                       require(0 <= cars[car].free_qpos && cars[car].free_qpos + 7 <= qpos.length,
                               "qpos has not the pose of a car");
                   return touches_nothing(qpos, cars, {distances, corner, bodies});
               },
               "qpos"_a, "cars"_a, "distances"_a, "corner"_a, "bodies"_a);
}

}  // namespace fg
