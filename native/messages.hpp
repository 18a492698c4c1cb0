// Messages between the car and a planner: a scan and odometry in, a command out.
#pragma once
#include "core/arrays.hpp"
#include "core/records.hpp"

namespace fg {

// One row of the odometry of many cars; fields and units as in Odometry.
struct Odometry {
    double stamp;
    double speed;
    double steering_angle;
    double angular_velocity[3];
    double linear_acceleration[3];
    double wheel_speeds[4];
    double pose[3];
};
FG_RECORD(Odometry, stamp, speed, steering_angle, angular_velocity, linear_acceleration, wheel_speeds, pose);

}  // namespace fg
