// Settings of planners: what each field says of itself, what is accepted, and rows that the core reads.
#pragma once
#include "../../core/arrays.hpp"
#include "../../core/records.hpp"

namespace fg {

// Type of a row with the parameters of a car.
struct CarParameters {
    double wheelbase;
    double track_width;
    double length;
    double width;
    double rear_overhang;
    double mass;
    double front_axle_distance;
    double rear_axle_distance;
    double center_of_gravity_height;
    double yaw_inertia;
    double wheel_radius;
    double wheel_inertia;
    double max_steering_angle;
    double max_steering_rate;
    double min_speed;
    double max_speed;
    double max_acceleration;
    double power_limit_speed;
    double speed_time_constant;
    double lidar_offset;
    double gravity;
    double front_cornering_stiffness;
    double rear_cornering_stiffness;
    double front_peak;
    double rear_peak;
    double front_peak_slip;
    double rear_peak_slip;
    double relaxation_length;
    double steering_time_constant;
    double command_delay;
    bool drives_front;
    bool drives_rear;
    bool shaft;
    double front_lock;
    double rear_lock;
    double rolling_resistance;
    double rolling_damping;
};
FG_RECORD(CarParameters, wheelbase, track_width, length, width, rear_overhang, mass, front_axle_distance,
          rear_axle_distance, center_of_gravity_height, yaw_inertia, wheel_radius, wheel_inertia, max_steering_angle,
          max_steering_rate, min_speed, max_speed, max_acceleration, power_limit_speed, speed_time_constant,
          lidar_offset, gravity, front_cornering_stiffness, rear_cornering_stiffness, front_peak, rear_peak,
          front_peak_slip, rear_peak_slip, relaxation_length, steering_time_constant, command_delay, drives_front,
          drives_rear, shaft, front_lock, rear_lock, rolling_resistance, rolling_damping);

}  // namespace fg
