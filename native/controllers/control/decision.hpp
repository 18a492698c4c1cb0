// From a reference command to a safe one: speed laws, guidance, sight, safety filter, recovery, friction limiter.
#pragma once
#include "../../core/arrays.hpp"
#include "../safety/judge.hpp"
#include "../safety/rollout.hpp"
#include "stages.hpp"

namespace fg {

// Track what moves, and take it out of the scan.
void predict(const Tick& tick);

// Set the friction limiter to the ground that the IMU feels.
void feel_ground(const Tick& tick, FeltGround& felt);

// Begin a decision: its reasons, the velocity frame, and the speedometer.
void begin(const Tick& tick);

// Replace a reference that does not lead on, and decide while the car turns in moves.
void guide_reference(const Tick& tick);

// Write the reference as the command, as far as the wheels can be turned.
void drive(const Tick& tick);

// Write the command nearest to the reference that the friction limiter allows.
void drive_held(const Tick& tick);

// Write the command of a car that can stop within what it sees.
void drive_in_sight(const Tick& tick);

// Write the command of the proposal that the judge takes, or of the plan in time.
void drive_filtered(const Tick& tick);

// Propose a motion to the judge in place of the planner's; return whether the car drives it: it can stop on it.
//
// A stage calls it at `after_guidance`. What no car can follow is left out, and so is more than eight in a tick.
//   path   motion (n, 4) in the frame of the rear axle, from where it is on: x, y [m], heading [rad], curvature [1/m]
//   speed  that is commanded [m/s]; the friction limiter slows the car for bends
bool propose(const Tick& tick, Matrix path, double speed);

// A situation, and the arrays of its own.
struct Surroundings {
    OwnTable<double> movers;
    OwnRow<double> widened;
    Situation here;

    operator const Situation&() const { return here; }
};

// Return the situation in which proposals are judged; `known`: what the scan hides counts as free.
Surroundings look_round(const Tick& tick, bool known);

// Write the command on the remembered line, where the limiter turns the wheels faster.
void drive_line(const Tick& tick, const Best& best);

}  // namespace fg
