// Laps, counted by progress along the centreline. Driving backward subtracts from the progress.
#pragma once
#include <cstdint>

#include "../core/arrays.hpp"
#include "../core/records.hpp"

namespace fg {

// Memory of a lap timer for one car.
struct LapTimer {
    double place;  // [m] where on the line the car was last; NaN before the first update
    double progress;  // [m] along the line from where the car was first seen, or from a scene's start
    double offset;  // [m] from the centreline, left positive
    double time;  // [s] of the last update
    double lap_start;  // [s]
    double mark;  // [m] greatest progress at `last_progress_time`
    double last_progress_time;  // [s] when the greatest progress last grew by STANDSTILL
    std::int64_t laps_completed;
    double passed;  // [m] greatest progress where the line has no sections; -inf before the first update
    double furthest;  // [m] greatest progress; -inf before the first update
    double furthest_time;  // [s] when and where the car first had it
    double furthest_x;  // [m]
    double furthest_y;  // [m]
};
FG_RECORD(LapTimer, place, progress, offset, time, lap_start, mark, last_progress_time, laps_completed, passed,
          furthest, furthest_time, furthest_x, furthest_y);

// Give timer i of (n,) of LAP_TIMER after `first_seen` the place x, y [m] of its car at a time [s].
// The times of its laps are written to `lap_times`, (n, at least one more than completed) [s]. `table`, `length` and
// `modulus` are those of the Course.
void time_lap(Row<LapTimer> timers, std::int64_t i, Table<double> lap_times, double time, double x, double y,
              Matrix table, double length, double modulus);

}  // namespace fg
