// From a goal to a steering angle.
#pragma once
#include "../../core/numbers.hpp"
#include "../../core/transcendental.hpp"
#include "planner_settings.hpp"

namespace fg {

inline constexpr double f1tenth_steering = 0.02;  // [s] time constant of the steering servo of the F1TENTH car

// Return `value` held within +-`limit`: beyond the limit, turn as sharply as possible.
inline double saturate(double value, double limit) { return max(-limit, min(limit, value)); }

// Return the steering angle [rad] whose arc leads the rear axle through a place, forward or back.
inline double arc_through(double x, double y, double wheelbase) {
    return fg::atan2(2.0 * y * wheelbase, x * x + y * y);
}

// Return the steering angle [rad] whose arc leads the rear axle through a goal seen by the LiDAR.
inline double pursue(double bearing, double distance, double lidar_offset, double wheelbase) {
    return arc_through(lidar_offset + distance * fg::cos(bearing), distance * fg::sin(bearing), wheelbase);
}

// Return the position, seen from the LiDAR, of the point at `distance` [m] on the arc of a steering angle [rad].
inline double bearing_of_arc(double steering_angle, double distance, double lidar_offset, double wheelbase) {
    const double curvature = fg::tan(steering_angle) / wheelbase;
    // curvature = 2 y / (x^2 + y^2), with x = o + d cos(bearing) and y = d sin(bearing), o the LiDAR's offset
    const double sine = curvature * (lidar_offset * lidar_offset + distance * distance) /
                        (2.0 * distance * fg::hypot(1.0, curvature * lidar_offset));
    return fg::atan(curvature * lidar_offset) + fg::asin(min(1.0, max(-1.0, sine)));
}

// Return by how much later than on the F1TENTH car the wheels turn [s]: lag of the servo and delay of commands.
inline double late_by(const CarParameters& car) {
    return car.steering_time_constant - f1tenth_steering + car.command_delay;
}

}  // namespace fg
