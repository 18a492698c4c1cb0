// Tracking: the steering angle that keeps a car on a motion.
#pragma once
#include <array>
#include <cstdint>

#include "../../core/arrays.hpp"

namespace fg {

// Columns of a motion: of the rear axle after each arc, the arc's curvature, and the speed [m/s] there, if it has one.
inline constexpr int motion_x = 0, motion_y = 1, motion_heading = 2, motion_curvature = 3, motion_speed = 4;

inline constexpr double steering_lag = 0.08;  // [s] until a new steering angle is reached, of the F1TENTH car

// Return the index of the first point of a motion from `index` on that lies ahead of the car; the last, if none.
std::int64_t next_point(Matrix points, std::int64_t index, double x, double y, double heading);

// Return the position of a car on the arc that ends at a point of a motion.
std::array<double, 3> errors(Numbers point, double x, double y, double heading);

// Return the steering angle [rad] that keeps a car on a motion.
double steer_along(Matrix points, std::int64_t index, std::array<double, 3> pose, double speed, double wheelbase,
                   double late, double path_late);

}  // namespace fg
