// Lap map: the places of the first lap and what the LiDAR saw from them, and where the car is among them later.
#pragma once
#include <cstdint>
#include <tuple>

#include "../../core/arrays.hpp"
#include "../../core/records.hpp"
#include "../../messages.hpp"
#include "scan_geometry.hpp"

namespace fg {

inline constexpr int lap_places = 1024;  // at most
inline constexpr int lap_beams = 64;     // of a scan that are kept of each place, evenly spread

// Type of what is kept from tick to tick; zero at the beginning.
struct LapMap {
    bool closed;
    bool drifts;  // dead reckoning was off by more than a lap may be: none closes any more
    double x;  // [m] of the rear axle, from where recording began
    double y;  // [m]
    double heading;  // [rad]
    double driven;  // [m] since recording began
    std::int64_t count;  // of places
    std::int64_t nearest;  // place
    double fits;  // share of the beams that fit, the mean of the last ticks
    float places[1024][3];  // x, y [m] and heading [rad]
    std::uint8_t ranges[1024][64];  // square root of the share of 8 m, of 255
};
FG_RECORD(LapMap, closed, drifts, x, y, heading, driven, count, nearest, fits, places, ranges);

// Where the beams kept at each place of a lap ended, x and y [m], and on which side: (places, lap_beams, 3).
struct LapWalls {
    OwnRow<double> numbers;
    std::int64_t places;

    explicit LapWalls(std::int64_t count) : numbers(count * lap_beams * 3), places(count) {}
    operator Cube<double>() const { return {Row<double>(numbers).data, places, lap_beams, 3}; }
    operator Cube<const double>() const { return Cube<double>(*this); }
};

// Take the car on by one tick, and record or match a scan; one that shows nothing ahead is not used.
//   ranges        readings (n,) [m], without NaN or inf
//   lidar_offset  of the LiDAR ahead of the rear axle [m]
void see_lap(LapMap& lap, const ScanGeometry& geometry, Numbers ranges, const Odometry& odometry, double lidar_offset);

// Begin to record anew.
void forget_lap(LapMap& lap);

// Return the place nearest to a pose, and how far away it is; near the `last` one. NaN: any heading.
std::tuple<std::int64_t, double> nearest_place(const LapMap& lap, std::int64_t last, double x, double y,
                                               double heading);

// Return where the beams kept at each place ended, as `walls_of`, but without the side.
LapWalls ends_of(const LapMap& lap, const ScanGeometry& geometry, std::int64_t count, double lidar_offset);

// Return where the beams kept at each place ended, and 1 to the left of the lap's path or -1 to the right.
//
// NaN for those that ended beyond 8 m. A scan has `count` beams.
LapWalls walls_of(const LapMap& lap, const ScanGeometry& geometry, std::int64_t count, double lidar_offset);

}  // namespace fg
