// The ground along which a course leads from a place that the LiDAR sees, and how much room is to both sides.
#pragma once
#include <array>
#include <cstdint>

#include "../../controllers/perception/scan_geometry.hpp"
#include "../../core/arrays.hpp"

namespace fg {

inline constexpr double walk_step = 0.25;          // [m]
inline constexpr std::int64_t most_points = 768;  // on the ground

// A place of a walk.
struct WalkPlace {
    double x, y;         // [m] ahead and left of the LiDAR
    double heading;      // [rad]
    double left, right;  // [m] room to both sides
};

// Write where beams end, ahead and left of the LiDAR, and points between those apart, (k, 2) [m]; return how many.
//
// ranges: readings (n,) [m], without NaN or inf.
std::int64_t ground_points(const ScanGeometry& geometry, Numbers ranges, Table<double> points);

// Return how far it is from a place [m] to what stands to the left and to the right of a heading [rad].
std::array<double, 2> room_beside(Matrix points, double x, double y, double heading);

// Write a walk from a place (x, y) [m] in the direction of a heading [rad] seen from the LiDAR; return its places.
//
// path: (k,) at least one; the first is where it begins.
std::int64_t walk(Matrix points, double x, double y, double heading, Row<WalkPlace> path);

}  // namespace fg
