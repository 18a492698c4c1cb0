// A step of an environment, of a table of arrays: actions in, rewards and observations out. The rows of the episodes are
// those of the cars that learn: every `stride`-th row of the engine's arrays.
#pragma once
#include <cstdint>

#include "contacts.hpp"
#include "rewards.hpp"

namespace fg {

// The array `numbers`.
struct StepNumbers {
    double stride, share, slow, reward_share, alone, range_max, substeps, on_contact;
};

// The arrays of a step: those of Python's NAMES.
struct StepArrays {
    // Take the views from a table of the arrays of NAMES.
    explicit StepArrays(std::int64_t address);

    const StepNumbers& numbers;
    Row<const bool> running;
    Row<const LapTimer> timers;
    Row<bool> crashed;
    Row<const std::int64_t> reasons;
    Row<const TelemetryRow> telemetry;
    Table<double> held;
    Row<bool> driven;
    Table<double> commands;
    Row<std::int64_t> clipped;
    Matrix limits;
    Cube<double> targets;
    Table<double> previous;
    Row<double> progress;
    Row<bool> wrecked;
    Row<double> impacts, before, sliding;
    Numbers weights;
    Row<double> rewards;
    Cube<double> terms;
    Touches touches;
    SensorReadings readings;
    SensorParts parts;

private:
    explicit StepArrays(Row<const ArrayPlace> table);
};

// Note whose episodes go on, and convert their actions (n, 2) to commands; return what `read_actions` does.
std::int64_t act(const StepArrays& arrays, Matrix actions);

// Note by what races the tick of the agents from `first` up to `behind` is rewarded, after they were judged.
void note(const StepArrays& arrays, std::int64_t first, std::int64_t behind);

// Reward the tick by what was noted, see `reward_ticks`.
void reward(const StepArrays& arrays);

// Hold the commands for a tick and judge the races of one car each; `tables` and `firsts` as of `read_all`.
void drive_worlds(const StepArrays& arrays, Row<const std::int64_t> tables, Row<const std::int64_t> firsts);

// Do a step of worlds of one car; return what `read_actions` does, before anything is written.
std::int64_t step(const StepArrays& arrays, Row<const std::int64_t> tables, Row<const std::int64_t> firsts,
                  Matrix actions);

// Write what the agents have sensed, see `read_sensors`.
void read(const StepArrays& arrays, Table<float> scan, Table<float> values);

// Take the scans and odometry of the cars `which` (n,) of worlds of one car, and write what they are.
void observe(const StepArrays& arrays, Row<const std::int64_t> tables, Row<const std::int64_t> firsts,
             Row<const bool> which, Table<float> scan, Table<float> values);

}  // namespace fg
