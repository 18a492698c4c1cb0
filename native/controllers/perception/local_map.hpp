// Local map: what the scans of the last metres showed, on a grid that moves with the car, and the path behind it.
#pragma once
#include <cmath>
#include <cstdint>
#include <cstdlib>

#include "../../core/arrays.hpp"
#include "../../core/records.hpp"
#include "scan_geometry.hpp"

namespace fg {

inline constexpr int map_size = 256;  // cells to a side; a power of two: `place & map_ring` is the place in the ring
inline constexpr int map_ring = map_size - 1;
inline constexpr double cell_width = 0.1;          // [m]
inline constexpr double cells_per_metre = 10.0;    // a product takes a quarter of the time of a quotient
inline constexpr int map_edge = map_size / 2 - 2;  // cells from the car's own that are kept
inline constexpr double sight = 9.8;               // [m] along a beam that is entered
inline constexpr int cell_kind = 3, unknown_cell = 0, free_cell = 1, wall_cell = 2;
// Bits of a cell, see `mark_cells`: how near a wall was when they were last marked: within four cells, two or one.
inline constexpr int cell_nearness = 12, wall_in_4 = 4, wall_in_2 = 8, wall_in_1 = 12;
inline constexpr int path_points = 160;  // of the path that are kept
// Columns of the path, after x, y and heading; the last two are of that.
inline constexpr int path_right = 3, path_left = 4, path_along = 5, path_sin = 6, path_cos = 7;

// The greatest whole number up to a place [cells]; one far out of the map, whose place in the ring is 0, where that is
// none, as of NaN.
inline std::int64_t floored(double place) {
    if (!(std::abs(place) < 9e18)) return -9'000'000'000'000'000'000;
    const auto cut = static_cast<std::int64_t>(place);
    return static_cast<double>(cut) > place ? cut - 1 : cut;
}

// Type of the memory; zero at the beginning.
struct LocalMap {
    bool begun;
    double x;  // [m] of the rear axle, by dead reckoning from where it began
    double y;  // [m]
    double heading;  // [rad]
    double driven;  // [m]
    double along;  // [m] along the path, of which pockets are cut off that the car has to leave again
    double furthest;  // [m] greatest `along`
    std::int64_t column;  // of the cell of the rear axle
    std::int64_t row;
    std::int64_t swept;  // row that was last searched for old cells
    // By column and row in the ring; bits, from the lowest: 2 of `cell_kind`, 2 of `cell_nearness`, and 4 of when the
    // cell was seen: `driven` then, in 2 m modulo 16.
    std::uint8_t cells[256][256];
    // Ring buffer: x, y [m], heading [rad], room to the right and left, along [m], sine and cosine of the heading.
    double path[160][8];
    std::int64_t newest;  // index of the last point of the path
    std::int64_t known;  // how many of them there are
    double ends[720][2];  // [m] of beams that are close: the last scan's, after those it passed
    std::int64_t ends_known;
};
FG_RECORD(LocalMap, begun, x, y, heading, driven, along, furthest, column, row, swept, cells, path, newest, known, ends,
          ends_known);

// Take the car on by one tick, and make the cells unknown that come into the window.
//   speed     [m/s]
//   yaw_rate  [rad/s]
//   period    of the tick [s]
void move(LocalMap& memory, double speed, double yaw_rate, double period);

// Forget what was seen far from the car, and the path; what is near is kept, so that the car can reverse there.
void forget(LocalMap& memory);

// Enter a scan.
//   ranges        readings (n,) [m], without NaN or inf
//   lidar_offset  of the LiDAR ahead of the rear axle [m]
void enter_scan(LocalMap& memory, const ScanGeometry& geometry, Numbers ranges, double lidar_offset);

// Add the car's place to its path, with the room to its sides, if the last point is far enough behind.
//
// At first, the way before the start is taken to end where the car is. The room is not much wider than at the last
// point.
void extend_path(LocalMap& memory, const ScanGeometry& geometry, Numbers ranges);

// Cut the path off beyond a place [m] along it: the car has driven into a pocket from there.
void cut_path(LocalMap& memory, double along);

// Return whether the map has a cell, by its column and row.
inline bool in_window(const LocalMap& memory, std::int64_t i, std::int64_t j) {
    return std::abs(i - memory.column) <= map_edge && std::abs(j - memory.row) <= map_edge;
}

}  // namespace fg
