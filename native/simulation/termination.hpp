// Race monitor: times the laps of the cars of some worlds, and says when each race is over and why.
#pragma once
#include <cstdint>

#include "../core/arrays.hpp"
#include "../course/lap_timer.hpp"
#include "../vehicle/motion.hpp"
#include "physics.hpp"

namespace fg {

// Why a race is over: numbers in END_REASONS of fg_mujoco/simulation/termination.py, which says more of each.
namespace reason {
enum : std::int64_t {
    goes_on, unstable, crash, finished, wrong_way, no_progress, time_limit, interrupted, failed, planner_failed,
    decision_limit, worker_died, disqualified, rolled_over
};
}  // namespace reason

// Time the laps of each car that runs, and end the races that are over, with the number of their reason.
void judge_cars(Row<bool> running, Row<std::int64_t> reasons, std::int64_t cars_per_world, Matrix states,
                const StateLayout& layout, Row<const Car> cars, Table<const std::int32_t> warnings,
                Row<const bool> crashed, Row<LapTimer> timers, Table<double> lap_times, Row<double> standing_since,
                Matrix table, double length, double modulus, double stop_time, std::int64_t laps, double last_time);

// Return the number of why a race is over; `last_time` [s] is half a tick early.
std::int64_t end_reason(bool unstable, bool crashed, bool rolled_over, std::int64_t laps_completed, std::int64_t laps,
                        double back, double time, double last_progress_time, double last_time);

// Return the same on a course without end, where a car may stand or turn, and is finished when its time is over.
std::int64_t end_of_endless(bool unstable, bool crashed, bool rolled_over, double time, double last_time);

}  // namespace fg
