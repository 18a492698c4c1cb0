// Lap trial: on tires that need slip angles, the planner simulates its own lap on a line before it follows the line.
#pragma once
#include <cstdint>

#include "../../core/arrays.hpp"
#include "../../core/records.hpp"
#include "../perception/lap_map.hpp"
#include "friction_limiter.hpp"

namespace fg {

struct Line;

// State of a trial: it goes on, the line holds, or it does not.
inline constexpr std::int64_t trial_goes_on = 0, trial_holds = 1, trial_fails = 2;

// Type of a trial; zero at the beginning.
struct Trial {
    std::int64_t state;  // trial_goes_on, trial_holds or trial_fails
    bool begun;
    double way;  // [m] driven
    double x;  // [m] of the rear axle
    double y;  // [m]
    double heading;  // [rad]
    double speed;  // [m/s] forward
    double sideways;  // [m/s] of the centre of gravity, to the left
    double yaw_rate;  // [rad/s]
    double steering;  // [rad]
    double slip[2];  // [rad] of the front and the rear tires, behind the slip angles
    std::int64_t next;  // point of the line
    std::int64_t place;  // of the lap, the nearest
    double commands[8][2];  // the last ones, the newest first
    LimiterMemory memory;
};
FG_RECORD(Trial, state, begun, way, x, y, heading, speed, sideways, yaw_rate, steering, slip, next, place, commands,
          memory);

// Simulate a part of the laps on a line that is ready, whose `trial` is written to; return the state of the trial.
// `walls` are where the beams of the first lap, which is closed, ended. The period is that of a tick [s].
std::int64_t try_lap(Line& line, const LapMap& lap, Cube<const double> walls, const Limiter& limiter, double max_speed,
                     double period);

// Move the car by a step of the model, which begins some time [s] after the last command.
void move_car(Trial& trial, const Limiter& limiter, double since, double period);

}  // namespace fg
