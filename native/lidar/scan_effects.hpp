// The effects of real LiDARs on the rows of their ranges: noise, dropout, latency and measured errors.
#pragma once
#include "random_numbers.hpp"

namespace fg {

// Settings and memory of r LiDARs of n beams each; fg_mujoco/lidar/scan_pipeline.py describes them.
struct Effects {
    Table<std::int64_t> states;  // (r, 4) of the generator of each
    Ziggurat ziggurat;
    Numbers deviations, dropouts, no_returns;  // (r,) [m], [-], [m]
    Row<double> noise, shares;                 // (n,) room for the numbers of one row
    Row<const std::int64_t> lates;             // (r,) by how many sweeps each is late
    Row<std::int64_t> sweeps;                  // (r,) how many sweeps each has measured
    Cube<double> held;                         // (r, at least the greatest of lates, n) the last sweeps, in a ring
    Row<const std::int64_t> table_of;          // (r,) place of its table of errors; -1: it has none
    Matrix knots;                              // (t, k) [m] distances of each table, inf behind the last
    Table<const double> values;                // (t n k, 3) noise, bias and dropout of each beam at them
    double range_min, range_max;               // [m]
};

// Apply the effects to some rows of ranges (r, n) [m], in place.
void apply_effects(const Effects& effects, Row<const std::int64_t> rows, Table<double> ranges);

// Turn standard normal `noise` (n,) into `ranges` (n,) [m] with noise of a deviation [m], within 0 and range_max [m].
void add_noise(Numbers ranges, double deviation, double range_max, Row<double> noise);

// Noise, bias or dropout (`which`) of `values` (k, 3) at a distance [m] among `knots` (k,), which are inf behind the last.
double error_at(Numbers knots, Matrix values, int which, double distance);

}  // namespace fg
