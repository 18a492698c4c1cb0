// Copies what the engine knows of its cars, and what follows from it.
#include "tick_state.hpp"

#include "../core/array_table.hpp"
#include "../core/numbers.hpp"
#include "../core/transcendental.hpp"
#include "../course/projection.hpp"
#include "../simulation/telemetry.hpp"
#include "../simulation/termination.hpp"

namespace fg {
namespace {

// The rows of a table, in the order of Python's names.
enum {
    TIME, PROGRESS, PLACE, OFFSET, LAPS, COMMAND, ACTION, SLIP_SPEED, SLIDING, CRASHED, ROLLED_OVER, FINISHED, TOUCHES,
    TIMERS, COMMANDS, ACTIONS, TELEMETRY, CRASHES, REASONS, STATISTICS, WHEELBASES, ARRAYS
};

Row<const TelemetryRow> telemetry_of(const ArrayPlace& place) { return place.row<const TelemetryRow>(); }

}  // namespace

void note_judged(std::int64_t address, Row<const bool> driven, std::int64_t substeps) {
    const Row<const ArrayPlace> table = table_at(address, ARRAYS);
    const auto numbers = [&](int name) { return table[name].row<double>(); };
    const auto whole = [&](int name) { return table[name].row<std::int64_t>(); };
    const auto flags = [&](int name) { return table[name].row<bool>(); };
    for (std::int64_t row = 0; row < driven.length; ++row) {
        if (!driven[row]) continue;
        const LapTimer& timer = table[TIMERS].row<const LapTimer>()[row];
        const std::int64_t why = whole(REASONS)[row];
        numbers(TIME)[row] = timer.time, numbers(PROGRESS)[row] = timer.progress;
        numbers(PLACE)[row] = timer.place, numbers(OFFSET)[row] = timer.offset;
        whole(LAPS)[row] = timer.laps_completed;
        for (int part = 0; part < 2; ++part) {
            table[COMMAND].table<double>()[row][part] = table[COMMANDS].table<const double>()[row][part];
            table[ACTION].table<double>()[row][part] = table[ACTIONS].table<const double>()[row][part];
        }
        numbers(SLIDING)[row] = telemetry_of(table[TELEMETRY])[row].sliding_steps / static_cast<double>(substeps);
        flags(CRASHED)[row] = flags(CRASHES)[row], flags(FINISHED)[row] = why == reason::finished;
        flags(ROLLED_OVER)[row] = why == reason::rolled_over;
        whole(TOUCHES)[row] = table[STATISTICS].row<const Statistics>()[row].touches;
    }
}

void note_slips(std::int64_t address, Row<const bool> driven) {
    const Row<const ArrayPlace> table = table_at(address, ARRAYS);
    const Numbers wheelbases = table[WHEELBASES].row<const double>();
    const Row<double> slips = table[SLIP_SPEED].row<double>();
    for (std::int64_t row = 0; row < driven.length; ++row) {
        if (!driven[row]) continue;
        const TelemetryRow& tick = telemetry_of(table[TELEMETRY])[row];
        const double turned = tick.vy + wheelbases[row] * tick.yaw_rate;
        const double front = turned * fg::cos(tick.steering_angle) - tick.vx * fg::sin(tick.steering_angle);
        slips[row] = 0.5 * (std::abs(front) + std::abs(tick.vy));
    }
}

void heading_errors(Matrix poses, Numbers places, Matrix table, Row<double> errors) {
    for (std::int64_t i = 0; i < poses.rows; ++i) {
        const std::int64_t segment = segment_at(table[0], places[i]);
        const double error = poses[i][2] - fg::atan2(table[4][segment], table[3][segment]);
        errors[i] = error - 2.0 * pi * std::floor(error / (2.0 * pi) + 0.5);
    }
}

}  // namespace fg
