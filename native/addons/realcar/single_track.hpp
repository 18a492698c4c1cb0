// The single-track model of a car on Magic Formula axles, and its forward simulation.
// Its equations are in addons/realcar/single_track.py.
#pragma once
#include <cstdint>

#include "../../core/arrays.hpp"

namespace fg {

// The constants of a car, as `car_array` of Python returns them.
struct SingleTrackCar {
    double mass;               // [kg]
    double inertia;            // [kg m^2] about the vertical axis
    double front, rear;        // [m] from the centre of gravity to the axles
    double height;             // [m] of the centre of gravity
    double gravity;            // [m/s^2]
    double front_share;        // [-] of the drive
    double half_width, shaft;  // [m] half of the track width, 0 for a single track; not 0: both axles turn alike
};

// Parameters of an axle's tires: stiffness B C D [1/rad], C, D, E [-].
struct AxleTires {
    double stiffness, c, d, e;
};

struct CarTires {
    AxleTires front, rear;
};

// What a drive is simulated by. Slip angles follow over `relaxation_length` [m], 0 at once; `gain` is the reading of an
// accelerometer over the lateral acceleration in a steady turn. Steering of the front wheels [rad], measured forward
// speed [m/s] and acceleration [m/s^2] are (n,), `step` [s] is of their grid.
struct SimulatedDrive {
    const CarTires& tires;
    const SingleTrackCar& car;
    double relaxation_length, gain;
    Numbers steering, forward_speed, forward_acceleration;
    double step;
};

// Return F_y / F_z [-] at slip angles [rad].
OwnRow<double> friction_curve(Numbers slip, const AxleTires& tire);

// Simulate segments of a drive on its grid, each from its own state, by Heun's method in two parts of each step.
// `segments` (m, 2) are the first node and the one behind the last, `starts` (m, 5) the states: v_y [m/s], r [rad/s],
// x [m], y [m], heading [rad] of the centre of gravity. Written are into `out` (n, 6) the states and what the
// accelerometer reads across the car [m/s^2].
// A car that rolls by phi reads g phi, too, and its wheels move out from under its centre of gravity by h phi', as if
// its tires relaxed over a longer way. In a steady turn phi is a_y (gain - 1) / g. It follows with a time constant,
// the damping over the stiffness of a suspension that is damped by half of critical, as that of our cars is. Where
// slip angles follow at once, the car does not roll.
void simulate_segments(const SimulatedDrive& drive, Table<const std::int64_t> segments, Matrix starts,
                       Table<double> out);

}  // namespace fg
