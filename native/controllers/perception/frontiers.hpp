// Selects the frontier to drive to, and computes each free cell's distance to it.
#pragma once
#include <array>
#include <cstdint>

#include "../../core/arrays.hpp"
#include "../../core/records.hpp"
#include "../../messages.hpp"
#include "local_map.hpp"
#include "scan_geometry.hpp"

namespace fg {

// Type of the memory; zero at the beginning.
struct FrontierSearch {
    LocalMap map;
    std::int64_t ticks;
    std::int64_t entered;  // tick in which a scan was last entered,
    double entered_driven;  // [m] how far the car had driven then,
    double entered_heading;  // [rad] and its heading
    std::int64_t searched;  // tick of the last search,
    double searched_driven;  // [m] and how far the car had driven then
    std::int64_t marked;  // tick in which walls were last marked
    bool found;
    bool hidden;  // the frontier is nearer than the sight, so something hides what is behind it
    double x;  // [m] of the middle of the frontier
    double y;
    // [way_unit] of blocks of two by two cells, by half the column and the row in the ring; `no_way`: not known.
    std::uint16_t distance_to_goal[128][128];
    std::int64_t nodes;  // of all searches for a motion in this tick
};
FG_RECORD(FrontierSearch, map, ticks, entered, entered_driven, entered_heading, searched, searched_driven, marked,
          found, hidden, x, y, distance_to_goal, nodes);

// Take a scan and odometry into the memory, in every tick.
//
// A scan is entered once the car has moved or turned a little since the last one, after a few ticks, and before a
// search. The frontier is searched `every` ticks after the last time, or later, once the car has driven a share of the
// distance to it, and at the latest after `every_plain` ticks.
//   ranges        readings (n,) [m], without NaN or inf
//   lidar_offset  of the LiDAR ahead of the rear axle [m]
//   led           the car is not driven by its planner alone
void search_frontier(const ScanGeometry& geometry, Numbers ranges, const Odometry& odometry, double lidar_offset,
                     FrontierSearch& memory, std::int64_t every, std::int64_t every_plain, bool led);

// Take the car on by one tick along its path, and enter no scan; arguments as of `search_frontier`.
void only_move(const ScanGeometry& geometry, Numbers ranges, const Odometry& odometry, FrontierSearch& memory);

// Enter the scan and mark how near its walls are, `every` ticks after the last time.
//
// Once the car has driven a little the frontier is searched, too. Other arguments as of `search_frontier`.
void look_again(const ScanGeometry& geometry, Numbers ranges, double lidar_offset, FrontierSearch& memory,
                std::int64_t every);

// Return the way to go [m] from a place, interpolated between the middles of blocks; inf where it is not known.
double distance_to_goal_at(const FrontierSearch& memory, double x, double y);

// Return the way to go [m] from a place, or from the nearest known place within 0.6 m; else inf.
double distance_to_goal_around(const FrontierSearch& memory, double x, double y);

// Return the least way to go [m] along a line from a place, and how far along it is [m]; inf: none is known.
//
// The line is given by the cosine and the sine of its heading.
std::array<double, 2> least_distance_towards(const FrontierSearch& memory, double x, double y, double cos, double sin,
                                             double distance);

}  // namespace fg
