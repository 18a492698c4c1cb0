// Of several reasons the first counts, in the order of `end_reason`.
#include "termination.hpp"

#include <mujoco/mujoco.h>

#include "../core/numbers.hpp"
#include "../core/transcendental.hpp"

namespace fg {
namespace {

constexpr double wrong_way_limit = 5.0;     // [m]
constexpr double no_progress_limit = 10.0;  // [s] a race ends when the car has not come further for this long
constexpr double standing_speed = 0.05;     // [m/s] a car slower than this stands still, where the goal is to stop

// Return whether MuJoCo has met a bad state. Of each kind of warning: what the last was about, how many there were.
bool is_unstable(Row<const std::int32_t> warnings) {
    bool unstable = false;
    for (int kind = mjWARN_BADQPOS; kind <= mjWARN_BADQACC; ++kind) unstable = unstable || warnings[2 * kind + 1] > 0;
    return unstable;
}

// Return the same on a course without end, where a car may stand or turn, and is finished when its time is over.
std::int64_t end_of_endless(bool unstable, bool crashed, bool rolled_over, double time, double last_time) {
    if (unstable) return reason::unstable;
    if (crashed) return reason::crash;
    if (rolled_over) return reason::rolled_over;
    return time >= last_time ? reason::finished : reason::goes_on;
}

// Return the number of why a race is over; `last_time` [s] is half a tick early.
std::int64_t end_reason(bool unstable, bool crashed, bool rolled_over, std::int64_t laps_completed, std::int64_t laps,
                        double back, double time, double last_progress_time, double last_time) {
    if (unstable) return reason::unstable;
    if (crashed) return reason::crash;
    if (rolled_over) return reason::rolled_over;
    if (laps_completed >= laps) return reason::finished;
    if (back >= wrong_way_limit) return reason::wrong_way;
    if (time - last_progress_time >= no_progress_limit) return reason::no_progress;
    if (time >= last_time) return reason::time_limit;
    return reason::goes_on;
}

}  // namespace

void judge_cars(Row<bool> running, Row<std::int64_t> reasons, std::int64_t cars_per_world, Matrix states,
                const StateLayout& layout, Row<const Car> cars, Table<const std::int32_t> warnings,
                Row<const bool> crashed, Row<LapTimer> timers, Table<double> lap_times, Row<double> standing_since,
                Matrix table, double length, double modulus, double stop_time, std::int64_t laps, double last_time) {
    for (std::int64_t row = 0; row < running.length; ++row) {
        if (!running[row]) continue;
        const std::int64_t world = row / cars_per_world;
        const Numbers state = states[world], qpos = state.part(layout.qpos[0], layout.qpos[1]);
        const Row<const Car> car = cars.part(row, row + 1);
        const double time = state[layout.time];
        const auto [x, y, heading] = planar_pose(qpos, car);
        time_lap(timers, row, lap_times, time, x, y, table, length, modulus);
        const LapTimer& timer = timers[row];
        std::int64_t done = timer.laps_completed;
        if (stop_time > 0.0) {  // the goal counts once the car has stood behind it
            const std::int64_t dof = layout.qvel[0] + cars[row].free_dof;
            const double speed = fg::hypot(state[dof], state[dof + 1]);
            if (!(speed < standing_speed && timer.progress >= length))
                standing_since[row] = nan;
            else if (std::isnan(standing_since[row]))
                standing_since[row] = time;
            if (!(time - standing_since[row] >= stop_time)) done = 0;  // nor is NaN
        }
        const bool unstable = is_unstable(warnings[world]), rolled_over = is_rolled_over(qpos, car);
        const double back = timer.passed - timer.progress;
        reasons[row] = length < inf ? end_reason(unstable, crashed[row], rolled_over, done, laps, back, time,
                                                 timer.last_progress_time, last_time)
                                    : end_of_endless(unstable, crashed[row], rolled_over, time, last_time);
        running[row] = reasons[row] == reason::goes_on;
    }
}

}  // namespace fg
