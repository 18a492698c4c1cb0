// Slip angles: how a car is steered whose tires need them, and where it goes.
#pragma once
#include "../../core/arrays.hpp"
#include "../../core/numbers.hpp"
#include "../../core/transcendental.hpp"
#include "../../core/records.hpp"
#include "../../messages.hpp"
#include "../perception/scan_geometry.hpp"
#include "planner_settings.hpp"
#include "steering.hpp"

namespace fg {

struct Axle {
    double B;
    double C;
    double D;
};
FG_RECORD(Axle, B, C, D);

inline constexpr int slip_speeds = 128, slip_forces = 64;  // of the tables
inline constexpr int slip_uses = 17, slip_stops = 33;      // of the table of braking

// Type of a row of a car.
struct Slip {
    bool needs_slip_angle;  // the tires need slip angles; the rest is zero where not
    Axle front;
    Axle rear;
    double most;  // [-] greatest lateral acceleration over g that is looked at
    double lead[slip_forces];  // [rad] by which to steer more than the arc's angle, from 0 to `most`
    double top_speed;  // [m/s] last of the speeds of `tightest`
    double tightest[slip_speeds];  // [rad] greatest angle of an arc, by speed
    double stable[slip_uses][slip_stops];  // [-] see `stable_braking`, by share of the grip and by speed
    double least_speed;  // [m/s] to which the lock slows the car at most
    double wound_up;  // [-] the front axle's part of the slip of a wound-up shaft; 0: there is none
    double lag;  // [s^2/m] of the path's way
    double relaxation_length;  // [m]
};
FG_RECORD(Slip, needs_slip_angle, front, rear, most, lead, top_speed, tightest, stable, least_speed, wound_up, lag,
          relaxation_length);

// Type of what `to_velocity_frame` keeps from tick to tick; zero at the beginning.
struct VelocityFrame {
    double angle;  // [rad] from the heading to where the rear axle moves, positive to the left
    double excess;  // [m/s] by which the wheels are faster than the ground
    ScanGeometry geometry;  // in the velocity frame
    Odometry odometry;  // with the frame's own yaw rate, and the steering angle of the arc
};
FG_RECORD(VelocityFrame, angle, excess, geometry, odometry);

// Return the slip angle [rad] at which an axle has a lateral force over its load, both without sign.
double slip_angle(const Axle& axle, double force);

// Return the acceleration over g at which an inner tire has a share of its peak, as the car is on an arc.
double held_on_arc(const Slip& slip, const CarParameters& car, double angle, double lateral, bool back, bool brakes,
                   double use);

// Return the steering angle [rad] with which a car at `speed` [m/s] runs on the arc of `angle` [rad].
double steered(const Slip& slip, const CarParameters& car, double angle, double speed);

// Return the angle [rad] of the arc on which a car at `speed` [m/s] runs in the end with a steering angle [rad].
double arc_angle(const Slip& slip, const CarParameters& car, double steering_angle, double speed);

// Write `tightest`: the arc at the lock, at each speed up to a lateral acceleration over g.
void find_tightest(Slip& slip, Numbers speeds, Numbers forces, double lock, double wheelbase, double gravity);

// Return the greatest angle [rad] of an arc that lock and critical speed leave at `speed` [m/s].
inline double tightest_arc(const Slip& slip, double speed) {
    const double position = min(std::abs(speed) / slip.top_speed, 1.0) * (slip_speeds - 1);
    const int at = max(min(whole(position), slip_speeds - 2), 0);
    return slip.tightest[at] + (position - at) * (slip.tightest[at + 1] - slip.tightest[at]);
}

// Return the angle [rad] of the tightest arc of a slow car: the lock, less what a wound-up shaft takes of it.
inline double lock_arc(const Slip& slip, const CarParameters& car) {
    return slip.needs_slip_angle ? slip.tightest[0] : car.max_steering_angle;
}

// Return the greatest speed [m/s] at which lock and critical speed leave the arc of `angle` [rad], or `least`.
double fastest_on(const Slip& slip, double angle, double least);

// Return the braking over g up to which a car that corners with a share of the grip does not turn in by itself.
double stable_braking(const Slip& slip, double use, double speed);

// Return the angle [rad] of the arc to command so that the car keeps its path; `angle` of tires that are not soft.
inline double held_arc(const Slip& slip, const CarParameters& car, double angle, double curvature) {
    if (!slip.needs_slip_angle) return angle;
    const double more = curvature - fg::tan(angle) / car.wheelbase;
    if (!(more * curvature > 0.0)) return angle;
    return fg::atan(fg::tan(angle) - car.wheelbase * more);
}

// Return the way [m] over which the path of a car follows its steering: v^2 s / a for a slip angle s at a.
inline double path_lag(const Slip& slip, double speed) { return slip.lag * speed * speed + slip.relaxation_length; }

// Return by how much later the path of a car follows its commands than the F1TENTH car's [s], see `path_lag`.
double late_on_path(const Slip& slip, const CarParameters& car, double speed);

// Return the direction in which the rear axle moves, from the car's heading [rad]; 0 of tires that are not soft.
double velocity_angle(const Slip& slip, const CarParameters& car, double speed, double yaw_rate);

// Return the yaw rate [rad/s] of an odometry, or that of the car's arc in place of one computed from the steering.
double yaw_rate_on_arc(const Slip& slip, const CarParameters& car, const Odometry& odometry);

// Return by how much friction of gears and of rolling slows a car [m/s^2] that drives forward at `speed` [m/s].
inline double drag(const CarParameters& car, double speed) {
    return speed > 0.0 ? car.rolling_resistance + car.rolling_damping * speed : 0.0;
}

// Return how fast a car moves [m/s] whose wheels, by a command of `command` [m/s], roll at `wheels` [m/s].
double ground_speed(const Slip& slip, const CarParameters& car, double wheels, double angle, double command);

// Write a scan's geometry and a motion in the velocity frame; return the curvature [1/m] of the car's path.
double to_velocity_frame(const Slip& slip, const CarParameters& car, const ScanGeometry& geometry,
                         const Odometry& odometry, double command, VelocityFrame& frame);

}  // namespace fg
