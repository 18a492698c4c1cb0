// The judge: of all that is proposed for the next tick, the first proposal after which the car can stop is driven.
#pragma once
#include <cstdint>

#include "../../core/arrays.hpp"
#include "../../core/records.hpp"
#include "rollout.hpp"

namespace fg {

// Type of the best proposal.
struct Best {
    std::int64_t why;
    double steering_angle;  // [rad] of the command
    double speed;  // [m/s]
    double use;  // share of the grip for cornering
    double contact;  // [m/s] at which the car meets something; 0: nothing; inf: none was simulated
};
FG_RECORD(Best, why, steering_angle, speed, use, contact);

// Type of what the judge keeps from tick to tick; zero at the beginning.
struct Judge {
    bool passed;  // whether the reference passed in the last tick
    Best best;  // of this tick
    Best second;  // that it is compared with
    Best line;  // on the remembered line, or beside it
    std::int64_t own;  // how many motions stages of the user's proposed in this tick
    double proposals[10][5];  // of the last decision; written, and never read
};
FG_RECORD(Judge, passed, best, second, line, own, proposals);

// Clearances of simulated stops, and the directions in which stops are simulated.
struct JudgeSettings {
    double margin;  // [m] ahead of the bumper, in the direction of the reference
    double margin_aside;  // [m] in other directions, which are then not lost at once when the car brakes a little less
    double margin_kept;  // share of these for a reference that passed at the last scan: millimetres do not end a turn
    double fan;  // [rad] directions to either side of the reference
    double fan_step;  // [rad] between them
    double crawl_speed;  // [m/s] slowest speed of a car with a free direction, so that it does not stand for good
    double standing_speed;  // [m/s] a car that is slower counts as standing
    double pursuit_distance;  // [m] a steering angle is read as the arc to a point at this distance from the LiDAR
    double arrived;  // [m] nearer to its goal than this, the simulated car keeps its steering angle
    double nearest_goal;  // [m] goals are no nearer
};
FG_RECORD(JudgeSettings, margin, margin_aside, margin_kept, fan, fan_step, crawl_speed, standing_speed,
          pursuit_distance, arrived, nearest_goal);

// What the planner or guidance wants, and what the judge needs besides.
struct Wanted {
    double steering_angle;  // [rad]
    double speed;           // [m/s]
    Matrix path;            // motion (m, 4) in the frame of the rear axle, along which it leads; m may be 0
    bool guided;            // whether that is a motion of guidance
    Matrix last_stop;       // motion (m, 4) along which the car could last stop; m may be 0
    bool passed;            // whether the reference passed in the last tick
};

// Write the best of all proposals to `memory`.
void judge(const Situation& here, const Wanted& wanted, Judge& memory);

// Take a motion (m, 4 or 5) that a stage of the user's proposed, if the car can stop on it.
bool judge_own(const Situation& here, Matrix path, double speed, Judge& memory);

// Take another proposal for the best one.
inline void take(Best& best, const Best& found) { best = found; }

// Simulate a proposal, keep it if it is better than the best one, and return whether it meets nothing.
bool consider(const Situation& here, std::int64_t why, double steering_angle, const Plan& plan, Numbers uses,
              Table<double> proposals, Best& best);

}  // namespace fg
