// Decides whether a car can drive a lap by a search over its forward motions; see addons/arena/tight_courses/drivable.py.
#pragma once
#include <array>
#include <vector>

#include "../../core/arrays.hpp"

namespace fg {

inline constexpr double drivable_margin = 0.05;  // [m] all round the footprint
inline constexpr double drivable_step = 0.1;     // [m] that the rear axle drives between two poses

struct DrivablePose {
    double x, y, heading;  // [m] of the rear axle, [rad]
};

// Return the poses of a lap of a length [m] from a start, none where there is none.
// `walls` (m, 4) are from x, y to x, y [m], not empty; `table` is that of the course.
std::vector<DrivablePose> drivable_lap(Matrix walls, const DrivablePose& start, Matrix table, double length);

}  // namespace fg
