// The loops of an environment over its worlds: actions in, rewards and observations out.
#pragma once
#include <cstdint>

#include "../core/arrays.hpp"

namespace fg {

// Convert actions (n, 2) to commands (n, 2) of a tick, and count the clipped ones (n,) of the cars `taken` (n,).
// Returns where the first part of an action that is NaN is, counted through the rows; -1: none is, and all is written.
//   limits: (7, 2) least and greatest action; what is asked for at 0, and more at 1; the time for which it is integrated
//     [s], 0: it is the command itself; least and greatest command.
//   share: by which a command comes nearer to what is asked for in a tick; 1: all of it.
//   planned: (n, 2) commands of planners that the actions correct; (0, 2): they correct none.
//   slow: planned speed below which corrections are smaller in proportion [m/s]; 0: nowhere.
//   targets: (2, n, 2) what is asked for, and the command; of the last tick, brought up to date.
//   held_before: (n, 2) written to: the actions, within their bounds; it may be `actions`.
std::int64_t read_actions(Matrix actions, Row<const bool> taken, Matrix limits, double share, Matrix planned,
                          double slow, Cube<double> targets, Table<double> held_before, Table<double> commands,
                          Row<std::int64_t> clipped);

// Write the four default terms of a tick; and its rewards (n,), where there are no other terms.
//   driven: (n,) the worlds in which it was driven; the others' rows are left as they are.
//   progress, before: (n,) [m] now, and at the start of the tick, brought up to date.
//   crashed, sliding, impacts: (n,) whether it crashed, share of the tick in which a tire slid, speed of it [m/s].
//   weights: (4,) of a metre, of a crash, of a tick in which a tire slides all the while, and of 1 m/s of an impact.
//   share: of what a tick gains, the most that its running costs take; inf: they are not bounded.
//   alone: whether there are no other terms; else `sum_terms` bounds and sums them.
//   terms: (2, k, n) written to: of each term the tick's value, and the sum of the episode, which it is added to.
void reward_ticks(Row<const bool> driven, Numbers progress, Row<double> before, Row<const bool> crashed,
                  Numbers sliding, Numbers impacts, Numbers weights, double share, bool alone, Row<double> rewards,
                  Cube<double> terms);

// Bound the costs of a tick that are `running` (k,), and write the rewards (n,); arguments as of `reward_ticks`.
// Of terms that `reward_ticks` has not written, the values of worlds that were not driven become 0. Returns where the
// first value that is not finite is, counted through the rows of the terms; -1: all is written.
std::int64_t sum_terms(Row<const bool> driven, Row<const bool> running, double share, Row<double> rewards,
                       Cube<double> terms);

// What the parts of an observation are read off: `stride` rows of `ranges` [m] and `odometry` a car.
struct SensorReadings {
    std::int64_t stride;
    Matrix ranges, odometry, actions, planned;
};

// Which parts: the beams of a scan and the greatest distance in it [m], and (k,) numbers within bounds. These are of the
// odometry; from its number on, of the actions, and of planners, which are needed where a column is of them.
struct SensorParts {
    Row<const std::int64_t> beams;
    double range_max;
    Row<const std::int64_t> columns;
    Row<const float> low, high;
};

// Write them. In the `scan` (n, beams seen) [m] no return reads `range_max`, too close or failed 0; `values` are (n, k).
void read_sensors(const SensorReadings& readings, const SensorParts& parts, Table<float> scan, Table<float> values);

}  // namespace fg
