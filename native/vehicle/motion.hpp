// Reads a car's motion off its state and writes its actuators: for one car and for many.
#pragma once
#include <array>
#include <cstdint>

#include "../core/arrays.hpp"
#include "../core/records.hpp"
#include "../messages.hpp"

namespace fg {

// The indices of a car in its model, and its limits. Functions take an array (1,) of it.
struct Car {
    std::int64_t free_qpos;  // where in qpos the free joint of base_link is
    std::int64_t free_dof;  // and in qvel
    std::int64_t steering_qpos;
    std::int64_t wheel_dofs[4];
    std::int64_t driven[2];  // which wheels are driven: the first, and the one behind the last
    std::int64_t accelerometer;  // where in sensordata
    std::int64_t steering_ctrl;
    std::int64_t speed_ctrl;
    double wheel_radius;  // [m]; from here on as in CarParameters
    double max_steering_angle;
    double min_speed;
    double max_speed;
    double rear_axle_distance;
};
FG_RECORD(Car, free_qpos, free_dof, steering_qpos, wheel_dofs, driven, accelerometer, steering_ctrl, speed_ctrl,
          wheel_radius, max_steering_angle, min_speed, max_speed, rear_axle_distance);

// Return x [m], y [m] and heading [rad] of base_link in the world.
std::array<double, 3> planar_pose(Numbers qpos, Row<const Car> car);

// Return the cosine of base_link's tilt: 1 on its wheels, 0 on its side, -1 on its roof.
double uprightness(Numbers qpos, Row<const Car> car);

// Return whether a car is tilted by more than 80 degrees. See ROLLED_OVER in motion.py.
bool is_rolled_over(Numbers qpos, Row<const Car> car);

// Return the true speed of base_link along its heading [m/s], forward positive.
double ground_speed(Numbers qpos, Numbers qvel, Row<const Car> car);

// Return the mean surface speed of the driven wheels [m/s].
double surface_speed(Numbers qvel, Row<const Car> car);

// Write what the car's own sensors say into `odometry`, an array (1,), and the true pose.
// Encoders, steering sensor, gyro and pose are of the present state; the accelerometer is that of `sensordata`.
void read_odometry(double time, Numbers qpos, Numbers qvel, Numbers sensordata, Row<const Car> car,
                   Row<Odometry> odometry);

// Return the velocity of base_link over the ground, forward and to the left of its heading [m/s].
std::array<double, 2> body_velocity(Numbers qpos, Numbers qvel, Row<const Car> car);

// Write true poses and velocities of the cars `which` (r,) of worlds with states (r / m, k), as base_link moves.
//   poses: x [m], y [m], heading [rad], (r, 3), written to.
//   velocities: ahead and to the left [m/s], and the yaw rate [rad/s], (r, 3), written to.
void read_motions(Row<const bool> which, std::int64_t cars_per_world, Matrix states, std::int64_t first_qpos,
                  std::int64_t first_qvel, Row<const Car> cars, Table<double> poses, Table<double> velocities);

// Return the motion of a point `ahead` [m] of base_link: x, y [m], heading [rad], velocity, yaw rate [rad/s].
// Its velocity over the ground is that forward and to the left of the heading [m/s].
std::array<double, 6> point_motion(Numbers qpos, Numbers qvel, double ahead, Row<const Car> car);

// Return the angle from the heading to the velocity of the centre of gravity [rad], left positive, as in ISO 8855.
// It is pi where a car goes straight back, NaN below 0.1 m/s. `vx` and `vy` [m/s] are of `body_velocity`.
double sideslip_angle(double vx, double vy, double yaw_rate, Row<const Car> car);

// Write a command [rad, m/s] to the actuators, held within their limits.
void drive(double steering_angle, double speed, Row<const Car> car, Row<double> ctrl);

}  // namespace fg
