// Model-predictive control along a line: the plan of least cost for the next second, of which a tick is driven.
#pragma once
#include <array>
#include <cstdint>
#include <tuple>

#include "../../controllers/control/driving.hpp"
#include "../../controllers/control/stages.hpp"
#include "../../core/arrays.hpp"
#include "../../core/records.hpp"
#include "../../messages.hpp"

namespace fg {

inline constexpr int mpc_steps = 20;      // of the horizon,
inline constexpr double mpc_time = 0.05;  // and [s] of each

// What the steering angle is by: this plan, the last one, or none, and the car has to brake.
inline constexpr std::int64_t mpc_solved = 0, mpc_last_plan = 1, mpc_no_plan = 2;

// Type of what is kept of the last plan; zero at the beginning.
struct Mpc {
    bool planned;
    double age;               // [s] since the plan was made
    double command;           // [rad] steering angle that was last commanded
    std::int64_t iterations;  // of the last tick
    double angles[mpc_steps + 1];  // [rad] of the plan
};
FG_RECORD(Mpc, planned, age, command, iterations, angles);

// What is ahead at a step of the horizon.
struct Ahead {
    double speed;        // [m/s]
    double turn;         // [rad] by how much the line turns until the next step
    double curvature;    // [1/m] of the line, and the steering angle [rad] for it; both within the lock
    double angle;
    double right, left;  // [m] how far the car may be to the right (negative) and to the left
};

// The program's system, see ltv_program.
struct System {
    Cube<double> a;
    Table<double> b, c;
};

// Return the steering angle [rad] for the next tick, the greatest speed [m/s], and what they are by, see mpc_solved.
//
// The speed is inf where the plan stays in the room beside the line. Else the car slows: its wheels then turn in less
// distance, and its tires hold a sharper curve. It slows by at most 0.2 m/s at a time, as the friction limiter takes
// grip from the cornering of a car that is far too fast. Without a plan the speed is 0. `nearest` is the line's point
// that is nearest to the rear axle, `mpc` is written to.
std::tuple<double, double, std::int64_t> plan_steering(Matrix line, std::int64_t nearest, const Odometry& odometry,
                                                       const Driver& driver, double period, Mpc& mpc);

// Return where the car is once a command reaches its servos: x and y [m], heading and steering angle [rad].
std::array<double, 4> place_at_command(const Odometry& odometry, const CarParameters& car, double angle,
                                       const Mpc& mpc);

// Write the system for the kinematic car: distance, angle, steering angle; its steering rate is held.
void kinematic(Row<const Ahead> ahead, const CarParameters& car, const System& system);

// Write the system for the single-track car.
void single_track(Row<const Ahead> ahead, const Driver& driver, const System& system);

// Steer by a plan near the line, and slow where it leaves the room there.
void track_by_mpc(const Tick& tick, Mpc& mpc);

}  // namespace fg
