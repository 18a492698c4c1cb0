// A lap is complete when the progress reaches a whole number of lengths for the first time.
#include "lap_timer.hpp"

#include "../core/numbers.hpp"
#include "modulo.hpp"
#include "projection.hpp"

namespace fg {
namespace {

constexpr double standstill = 0.1;  // [m] progress below this is standing still: against a wall a car creeps

}  // namespace

void time_lap(Row<LapTimer> timers, std::int64_t i, Table<double> lap_times, double time, double x, double y,
              Matrix table, double length, double modulus) {
    LapTimer& timer = timers[i];
    const double before = timer.progress;
    const auto [place, offset] = follow(x, y, timer.place, table, modulus);
    timer.offset = offset;
    if (std::isnan(timer.time)) {
        timer.lap_start = timer.last_progress_time = time;
        timer.passed = timer.progress;
    } else {
        const double distance = modulo(place - timer.place + 0.5 * modulus, modulus) - 0.5 * modulus;
        timer.progress = before + distance;
        while (timer.laps_completed < lap_times.columns) {
            const double line = static_cast<double>(timer.laps_completed + 1) * length;
            if (!(timer.progress >= line)) break;
            const double crossed = timer.time + (time - timer.time) * (line - before) / distance;
            lap_times[i][timer.laps_completed] = crossed - timer.lap_start;
            timer.lap_start = crossed;
            timer.laps_completed += 1;
        }
        if (timer.progress >= timer.mark + standstill) timer.mark = timer.progress, timer.last_progress_time = time;
    }
    if (timer.progress > timer.passed && !has_sections(place, table)) timer.passed = timer.progress;
    if (timer.progress > timer.furthest) {
        timer.furthest = timer.progress;
        timer.furthest_time = time, timer.furthest_x = x, timer.furthest_y = y;
    }
    timer.place = place, timer.time = time;
}

}  // namespace fg
