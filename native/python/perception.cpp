// Binds native/controllers/perception. Shapes that do not fit together are refused with a ValueError.
#include "../controllers/perception/cells.hpp"
#include "../controllers/perception/frontiers.hpp"
#include "../controllers/perception/gaps.hpp"
#include "../controllers/perception/intermediate_scans.hpp"
#include "../controllers/perception/lap_map.hpp"
#include "../controllers/perception/local_map.hpp"
#include "../controllers/perception/scan_filters.hpp"
#include "../controllers/perception/scan_geometry.hpp"
#include "../controllers/perception/targets.hpp"
#include "bindings.hpp"
#include "callable.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using WithoutGil = nb::call_guard<nb::gil_scoped_release>;

namespace fg {
namespace {

constexpr std::int64_t all_cells = map_size * map_size;

std::int64_t checked_mark_cells(LocalMap& world, Table<std::uint8_t> bits) {
    require(bits.rows == map_size && bits.columns == map_size, "the bits are not those of the map's cells");
    return mark_cells(world, bits);
}

void checked_dijkstra(Row<const std::uint8_t> bits, Row<std::uint16_t> distance, Table<std::uint16_t> to_goal,
                      Row<const std::uint16_t> goal, std::int64_t free) {
    require(bits.length == all_cells && distance.length == all_cells && to_goal.rows == map_blocks &&
                to_goal.columns == map_blocks,
            "the arrays are not those of the map's cells and blocks");
    require(0 <= free && free <= all_cells, "the map has not so many cells");
    dijkstra(bits, distance, to_goal, goal, free);
}

OwnRow<double> checked_bubbles(Numbers ranges, Row<const std::int64_t> beams, double angle_increment, double radius) {
    for (std::int64_t i = 0; i < beams.length; ++i)
        require(0 <= beams[i] && beams[i] < ranges.length, "a beam is not there");
    return safety_bubbles(ranges, beams, angle_increment, radius);
}

OwnRow<double> checked_prioritise(Numbers ranges, Numbers bearings, double edge_weight) {
    require(ranges.length == bearings.length, "ranges and bearings are not as many");
    return prioritise_centre(ranges, bearings, edge_weight);
}

void check_run(Numbers ranges, std::int64_t first, std::int64_t end) {
    require(0 <= first && end <= ranges.length, "the run is not within the scan");
}

std::array<std::int64_t, 2> checked_deepest(Numbers ranges, std::int64_t first, std::int64_t end, double tolerance) {
    check_run(ranges, first, end);
    return deepest_run(ranges, first, end, tolerance);
}

std::int64_t checked_furthest(Numbers ranges, std::int64_t first, std::int64_t end) {
    check_run(ranges, first, end);
    return furthest_beam(ranges, first, end);
}

std::array<std::int64_t, 2> checked_around(Numbers ranges, std::int64_t beam, std::int64_t first, std::int64_t end) {
    check_run(ranges, first, end);
    require(0 <= beam && beam <= ranges.length, "a beam is not there");
    return run_around(ranges, beam, first, end);
}

OwnRow<std::int64_t> checked_disparities(Numbers ranges, std::int64_t first, std::int64_t end, double threshold) {
    check_run(ranges, first, end);
    return disparities(ranges, first, end, threshold);
}

void checked_debug_run(Row<double> kept, Numbers ranges, std::int64_t first, std::int64_t end) {
    require(kept.length == ranges.length, "the intermediate scan has not as many beams");
    write_debug_run(kept, ranges, first, end);
}

OwnRow<double> checked_bearings(const ScanGeometry& geometry, std::int64_t first, std::int64_t end) {
    require(first <= end, "the beams end before they begin");
    return bearings_of(geometry, first, end);
}

auto walls(Held<const LapMap> lap, Held<const ScanGeometry> geometry, std::int64_t count, double lidar_offset) {
    require(count > 0, "a scan has beams");
    LapWalls found = walls_of(lap, geometry, count, lidar_offset);
    const Cube<double> cube = found;
    return owned(std::move(found), cube.data, std::array{cube.length, cube.rows, cube.columns});
}

void bind_maps(nb::module_& module) {
    module.def("mark_cells", callable(checked_mark_cells), "world"_a, "bits"_a, WithoutGil());
    module.def("cell_at", callable(cell_at), "x"_a, "y"_a);
    module.def("dijkstra", callable(checked_dijkstra), "bits"_a, "distance"_a, "distance_to_goal"_a, "goal"_a, "free"_a,
               WithoutGil());
    module.def("search_frontier", callable(search_frontier), "geometry"_a, "ranges"_a, "odometry"_a, "lidar_offset"_a,
               "memory"_a, "every"_a, "every_plain"_a, "led"_a, WithoutGil());
    module.def("move", callable(move), "memory"_a, "speed"_a, "yaw_rate"_a, "period"_a);
    module.def("enter_scan", callable(enter_scan), "memory"_a, "geometry"_a, "ranges"_a, "lidar_offset"_a,
               WithoutGil());
    module.def("extend_path", callable(extend_path), "memory"_a, "geometry"_a, "ranges"_a);
    module.def("cut_path", callable(cut_path), "memory"_a, "along"_a);
    module.def("in_window", callable(in_window), "memory"_a, "i"_a, "j"_a);
    module.def("see_lap", callable(see_lap), "lap"_a, "geometry"_a, "ranges"_a, "odometry"_a, "lidar_offset"_a,
               WithoutGil());
    module.def("walls_of", walls, "lap"_a, "geometry"_a, "count"_a, "lidar_offset"_a);
    module.def("track_targets", callable(track_targets), "memory"_a, "geometry"_a, "ranges"_a, "odometry"_a,
               "lidar_offset"_a, "course"_a, WithoutGil());
}

void bind_scans(nb::module_& module) {
    module.def("valid_ranges", callable(valid_ranges), "ranges"_a, "range_max"_a);
    module.def("noise_of", callable(noise_of), "ranges"_a, "range_max"_a);
    module.def("clip_to_lookahead", callable(clip_to_lookahead), "ranges"_a, "lookahead"_a);
    module.def("bubble_beams", callable(bubble_beams), "ranges"_a, "radius"_a, "angle_increment"_a);
    module.def("safety_bubbles", callable(checked_bubbles), "ranges"_a, "beams"_a, "angle_increment"_a, "radius"_a);
    module.def("extend_disparities", callable(extend_disparities), "ranges"_a, "angle_increment"_a, "threshold"_a,
               "radius"_a);
    module.def("widen_all", callable(widen_all), "ranges"_a, "angle_increment"_a, "radius"_a);
    module.def("greatest_beam", callable(greatest_beam), "ranges"_a);
    module.def("mask_nearest", callable(mask_nearest), "ranges"_a, "angle_increment"_a, "radius"_a);
    module.def("mask_bubble", callable(mask_bubble), "ranges"_a, "angle_increment"_a, "radius"_a);
    module.def("mask_points", callable(mask_points), "ranges"_a, "angle_increment"_a, "radius"_a);
    module.def("rolling_mean", callable(rolling_mean), "ranges"_a, "angle_increment"_a, "radius"_a);
    module.def("prioritise_centre", callable(checked_prioritise), "ranges"_a, "bearings"_a, "edge_weight"_a = 0.999);
    module.def("write_debug_run", callable(checked_debug_run), "kept"_a, "ranges"_a, "first"_a, "end"_a);
}

void bind_gaps(nb::module_& module) {
    module.def("chord", callable(chord), "a"_a, "b"_a, "angle"_a);
    module.def("longest_run", callable(longest_run), "ranges"_a);
    module.def("runs_beyond", callable(runs_beyond), "ranges"_a, "threshold"_a, "least"_a);
    module.def("deepest_run", callable(checked_deepest), "ranges"_a, "first"_a, "end"_a, "tolerance"_a);
    module.def("furthest_beam", callable(checked_furthest), "ranges"_a, "first"_a, "end"_a);
    module.def("disparities", callable(checked_disparities), "ranges"_a, "first"_a, "end"_a, "threshold"_a);
    module.def("middle_of", callable(middle_of), "first"_a, "end"_a);
    module.def("range_at", callable(range_at), "ranges"_a, "position"_a);
    module.def("run_around", callable(checked_around), "ranges"_a, "beam"_a, "first"_a, "end"_a);
}

void bind_geometry(nb::module_& module) {
    module.def("sees", callable(sees), "geometry"_a, "ranges"_a);
    module.def("bearing_of", callable(bearing_of), "geometry"_a, "beam"_a);
    module.def("bearings_of", callable(checked_bearings), "geometry"_a, "first"_a, "end"_a);
    module.def("nearest_beam", callable(nearest_beam), "angle_min"_a, "angle_increment"_a, "ahead"_a, "left"_a);
    module.def("beams_between", callable(beams_between), "geometry"_a, "count"_a, "right"_a, "left"_a);
}

}  // namespace

void bind_perception(nb::module_& module) {
    bind_maps(module);
    bind_scans(module);
    bind_gaps(module);
    bind_geometry(module);
}

}  // namespace fg
