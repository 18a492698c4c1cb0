// Binds native/course. Shapes that do not fit together are refused with a ValueError.
#include <nanobind/stl/pair.h>

#include "../course/clearance.hpp"
#include "../course/lap_timer.hpp"
#include "../course/moving_obstacles.hpp"
#include "../course/polyline.hpp"
#include "../course/projection.hpp"
#include "bindings.hpp"
#include "record_casters.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using WithoutGil = nb::call_guard<nb::gil_scoped_release>;

namespace fg {
namespace {

void check_table(const Matrix& table) {
    require((table.rows == 6 || table.rows == 10) && table.columns > 0,
            "the table of the course is neither (6, n) nor (10, n)");
}

void check_segments(const Matrix& poses, const Cube<const double>& segments) {
    require(poses.columns == 3 && segments.columns == 4 && (segments.length == 1 || segments.length == poses.rows),
            "poses are not (n, 3), or segments neither (1, m, 4) nor (n, m, 4)");
}

bool are_corners(const Matrix& low, const Matrix& high) {
    return low.columns == 2 && high.columns == 2 && low.rows == high.rows;
}

}  // namespace

void bind_course(nb::module_& module) {
    module.def("rectangle_distance", &rectangle_distance, "ax"_a, "ay"_a, "bx"_a, "by"_a, "half_length"_a,
               "half_width"_a);
    module.def("least_clearance",
               [](Matrix poses, Cube<const double> segments, double ahead, double half_length, double half_width) {
                   check_segments(poses, segments);
                   return least_clearance(poses, segments, ahead, half_length, half_width);
               },
               "poses"_a, "segments"_a, "ahead"_a, "half_length"_a, "half_width"_a, WithoutGil());
    module.def("clearances",
               [](Matrix poses, Cube<const double> segments, double ahead, double half_length, double half_width,
                  Row<double> found) {
                   check_segments(poses, segments);
                   require(found.length == poses.rows, "found has not as many numbers as there are poses");
                   clearances(poses, segments, ahead, half_length, half_width, found);
               },
               "poses"_a, "segments"_a, "ahead"_a, "half_length"_a, "half_width"_a, "found"_a, WithoutGil());
    module.def("time_lap",
               [](Row<LapTimer> timers, std::int64_t i, Table<double> lap_times, double time, double x, double y,
                  Matrix table, double length, double modulus) {
                   check_table(table);
                   require(0 <= i && i < timers.length && i < lap_times.rows, "timer i is not there");
                   time_lap(timers, i, lap_times, time, x, y, table, length, modulus);
               },
               "timers"_a, "i"_a, "lap_times"_a, "time"_a, "x"_a, "y"_a, "table"_a, "length"_a, "modulus"_a);
    module.def("overlaps",
               [](Matrix low, Matrix high, Matrix other_low, Matrix other_high, Matrix blocks_low, Matrix blocks_high,
                  Row<std::int64_t> found_first, Row<std::int64_t> found_second) {
                   require(are_corners(low, high) && are_corners(other_low, other_high) &&
                               are_corners(blocks_low, blocks_high) && found_first.length == found_second.length,
                           "corners are not (n, 2) of as many boxes, or what is found has not as much room twice");
                   return overlaps({low, high, other_low, other_high, blocks_low, blocks_high}, found_first,
                                   found_second);
               },
               "low"_a, "high"_a, "other_low"_a, "other_high"_a, "blocks_low"_a, "blocks_high"_a, "found_first"_a,
               "found_second"_a, WithoutGil());
    module.def("follow",
               [](double x, double y, double near, Matrix table, double modulus) {
                   check_table(table);
                   const auto [s, offset] = follow(x, y, near, table, modulus);
                   return std::pair(s, offset);
               },
               "x"_a, "y"_a, "near"_a, "table"_a, "modulus"_a);
    module.def("by_sections",
               [](double x, double y, double s, std::int64_t segment, Matrix table, bool on_left) {
                   require(table.rows == 10 && 0 <= segment && segment < table.columns,
                           "the table is not (10, n), or the segment is none of it");
                   return by_sections(x, y, s, segment, table, on_left);
               },
               "x"_a, "y"_a, "s"_a, "segment"_a, "table"_a, "on_left"_a);
}

}  // namespace fg
