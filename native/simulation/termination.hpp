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

}  // namespace fg
