// The last step to a command: one that the tires can follow, and whose speed the car reaches.
#pragma once
#include <array>

#include "../../core/arrays.hpp"
#include "../../core/records.hpp"
#include "../safety/friction_limiter.hpp"
#include "planner_settings.hpp"

namespace fg {

struct TickRecord;

// Type of what is kept from tick to tick; zero at the beginning.
struct Speedometer {
    double command;  // [m/s] that was last given; 0: none
    double speed;  // [m/s] that was measured then
    double error;  // of the measured speed, as a share of the motor's
};
FG_RECORD(Speedometer, command, speed, error);

inline constexpr double left_alone = 0.01;  // error of the measured speed, as a share, that is left alone

// Take a measured speed [m/s] into the memory, in every tick; `period` [s] is the time since the last command.
void read_speedometer(Speedometer& memory, double speed, const CarParameters& car, double period);

// Return the speed to command so that the measured one becomes `speed` [m/s], and keep it. `max_speed` [m/s] is the
// planner's, `period` [s] the time until the next command, `alone` the share of an error that is not corrected.
double command_speed(Speedometer& memory, double speed, const CarParameters& car, double max_speed, double period,
                     double alone);

// Return the command nearest to a reference that the friction limiter allows.
std::array<double, 2> apply_limits(TickRecord& tick, double steering_angle, double speed, double least_use);

// Return the command nearest to a reference that a friction limiter allows; `alone` as of `command_speed`.
std::array<double, 2> apply_limits_of(const Limiter& limiter, TickRecord& tick, double steering_angle, double speed,
                                      double least_use, double alone);

}  // namespace fg
