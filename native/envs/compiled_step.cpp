// The order of a step, and where its arrays are.
#include "compiled_step.hpp"

#include <algorithm>

#include "../core/numbers.hpp"
#include "../core/transcendental.hpp"
#include "../simulation/termination.hpp"

namespace fg {
namespace {

// The rows of a table, in the order of NAMES.
enum {
    RUNNING, TIMERS, CRASHED, REASONS, TELEMETRY, HELD, ODOMETRY, RANGES,
    DRIVEN, COMMANDS, CLIPPED, LIMITS, PLANNED, TARGETS, PREVIOUS,
    PROGRESS, WRECKED, IMPACTS, BEFORE, SLIDING, WEIGHTS, REWARDS, TERMS,
    CONTACTS, TOUCHED_AT, BEGAN, BEAMS, COLUMNS, LOW, HIGH, NUMBERS, ARRAYS
};

}  // namespace

StepArrays::StepArrays(std::int64_t address) : StepArrays(table_at(address, ARRAYS)) {}

StepArrays::StepArrays(Row<const ArrayPlace> table)
    : numbers(*reinterpret_cast<const StepNumbers*>(table[NUMBERS].address)),
      running(table[RUNNING].row<const bool>()),
      timers(table[TIMERS].row<const LapTimer>()),
      crashed(table[CRASHED].row<bool>()),
      reasons(table[REASONS].row<const std::int64_t>()),
      telemetry(table[TELEMETRY].row<const TelemetryRow>()),
      held(table[HELD].table<double>()),
      driven(table[DRIVEN].row<bool>()),
      commands(table[COMMANDS].table<double>()),
      clipped(table[CLIPPED].row<std::int64_t>()),
      limits(table[LIMITS].table<const double>()),
      targets(table[TARGETS].cube<double>()),
      previous(table[PREVIOUS].table<double>()),
      progress(table[PROGRESS].row<double>()),
      wrecked(table[WRECKED].row<bool>()),
      impacts(table[IMPACTS].row<double>()),
      before(table[BEFORE].row<double>()),
      sliding(table[SLIDING].row<double>()),
      weights(table[WEIGHTS].row<const double>()),
      rewards(table[REWARDS].row<double>()),
      terms(table[TERMS].cube<double>()),
      touches{table[CONTACTS].row<std::int64_t>(), table[TOUCHED_AT].row<double>(), table[BEGAN].row<bool>()},
      readings{static_cast<std::int64_t>(numbers.stride), table[RANGES].table<const double>(),
               table[ODOMETRY].table<const double>(), previous, table[PLANNED].table<const double>()},
      parts{table[BEAMS].row<const std::int64_t>(), numbers.range_max, table[COLUMNS].row<const std::int64_t>(),
            table[LOW].row<const float>(), table[HIGH].row<const float>()} {}

std::int64_t act(const StepArrays& arrays, Matrix actions) {
    for (std::int64_t i = 0; i < arrays.driven.length; ++i)
        arrays.driven[i] = arrays.running[i * arrays.readings.stride];
    return read_actions(actions, arrays.driven, arrays.limits, arrays.numbers.share, arrays.readings.planned,
                        arrays.numbers.slow, arrays.targets, arrays.previous, arrays.commands, arrays.clipped);
}

void note(const StepArrays& arrays, std::int64_t first, std::int64_t behind) {
    for (std::int64_t i = first; i < behind; ++i) {
        const std::int64_t row = i * arrays.readings.stride;
        arrays.progress[i] = arrays.timers[row].progress;
        arrays.wrecked[i] = arrays.crashed[row] || arrays.reasons[row] == reason::rolled_over;
    }
}

void reward(const StepArrays& arrays) {
    reward_ticks(arrays.driven, arrays.progress, arrays.before, arrays.wrecked, arrays.sliding, arrays.impacts,
                 arrays.weights, arrays.numbers.reward_share, arrays.numbers.alone != 0.0, arrays.rewards,
                 arrays.terms);
}

void drive_worlds(const StepArrays& arrays, Row<const std::int64_t> tables, Row<const std::int64_t> firsts) {
    const auto on_contact = static_cast<OnContact>(static_cast<std::int64_t>(arrays.numbers.on_contact));
    const bool goes_on = on_contact != OnContact::end;
    for (std::int64_t k = 0; k < tables.length; ++k) {
        const WorldArrays worlds(tables[k]);
        const std::int64_t first = firsts[k], behind = first + cars_of(worlds);
        for (std::int64_t row = first; row < behind; ++row)
            for (int part = 0; part < 2; ++part) arrays.held[row][part] = arrays.commands[row][part];
        const Row<bool> crashed = arrays.crashed.part(first, behind);
        if (goes_on) std::fill_n(crashed.data, crashed.length, false);
        drive(worlds);
        end_failed(worlds);
        for (std::int64_t row = first; row < behind; ++row) {
            const TelemetryRow& tick = arrays.telemetry[row];
            arrays.impacts[row] = fg::hypot(tick.vx, tick.vy);
            if (arrays.running[row]) arrays.sliding[row] = tick.sliding_steps / arrays.numbers.substeps;
        }
        if (goes_on) take_contacts(worlds, first, on_contact, arrays.touches);
        judge(worlds);
        if (goes_on) std::copy_n(arrays.touches.began.part(first, behind).data, crashed.length, crashed.data);
        note(arrays, first, behind);
    }
}

std::int64_t step(const StepArrays& arrays, Row<const std::int64_t> tables, Row<const std::int64_t> firsts,
                  Matrix actions) {
    const std::int64_t bad = act(arrays, actions);
    if (bad < 0) {
        drive_worlds(arrays, tables, firsts);
        reward(arrays);
    }
    return bad;
}

void read(const StepArrays& arrays, Table<float> scan, Table<float> values) {
    read_sensors(arrays.readings, arrays.parts, scan, values);
}

void observe(const StepArrays& arrays, Row<const std::int64_t> tables, Row<const std::int64_t> firsts,
             Row<const bool> which, Table<float> scan, Table<float> values) {
    sense_all(tables, firsts, which);
    read(arrays, scan, values);
}

}  // namespace fg
