// Telemetry: one row a tick for each car, and the running statistics of a drive.
#pragma once
#include <cstdint>

#include "../core/arrays.hpp"
#include "../core/records.hpp"
#include "../course/lap_timer.hpp"
#include "../vehicle/motion.hpp"

namespace fg {

// A row of the telemetry; TELEMETRY in fg_mujoco/simulation/telemetry.py says what its numbers are.
struct TelemetryRow {
    double time, lap, progress, offset, x, y, heading;
    double speed, yaw_rate, steering_angle, command[2];
    double slide[4], friction_utilisation[4];
    double sliding_steps, steps;
    double vx, vy, sideslip, ax, ay;
    double load[4], force_x[4], force_y[4], slip_angle[4], slip_ratio[4];
};
static_assert(sizeof(TelemetryRow) == 47 * sizeof(double));

constexpr double greatest_command = 1000.0;  // [rad], [m/s] in the telemetry

// Running statistics of a drive, one row a car.
struct Statistics {
    std::int64_t ticks;
    std::int64_t steps;
    std::int64_t sliding_steps;
    double max_slide;  // [m/s]; this and the next are NaN of tires without a peak
    double max_lateral_slide;  // [m/s]
    double speed_sum;  // [m/s] of all ticks, without sign
    double max_speed;  // [m/s]
    std::int64_t touches;  // of other cars, each at least half a second after the last of the same car
};
FG_RECORD(Statistics, ticks, steps, sliding_steps, max_slide, max_lateral_slide, speed_sum, max_speed, touches);

// Write the state at the start of a tick, at `time` [s], with timers (n,) of LAP_TIMER, to its `row`.
void begin_row(double time, Numbers qpos, Numbers qvel, Row<const Car> car, Row<const LapTimer> timers, std::int64_t i,
               TelemetryRow& row);

// Write the mean acceleration over a tick, which ends at `time` [s], to its `row`.
void end_motion(double time, Numbers qpos, Numbers qvel, Row<const Car> car, TelemetryRow& row);

// Write to a tick's `row` what the tires did: `slip` (QUANTITIES, steps, 4) of `measure_slip`.
void end_row(TelemetryRow& row, Cube<const double> slip);

// Add a tick's `row` to the running statistics (n,) of STATISTICS at `i`; arguments as in `end_row`.
void add_row(Row<Statistics> statistics, std::int64_t i, const TelemetryRow& row, Cube<const double> slip);

}  // namespace fg
