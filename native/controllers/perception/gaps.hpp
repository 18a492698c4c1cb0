// Finds gaps: runs of beams, given as the first beam and the one behind the last, `ranges[first:end]`.
#pragma once
#include <array>
#include <cstdint>

#include "../../core/arrays.hpp"

namespace fg {

// Return the distance [m] between the ends of two readings `a` and `b` [m] with `angle` [rad] between them.
double chord(double a, double b, double angle);

// Return the longest run of readings (n,) that are not 0; of several, the rightmost; 0 and 0 where all are 0.
std::array<std::int64_t, 2> longest_run(Numbers ranges);

// Return all runs of at least `least` consecutive readings (n,) beyond `threshold` [m], rightmost first: (gaps, 2).
OwnTable<std::int64_t> runs_beyond(Numbers ranges, double threshold, std::int64_t least);

// Return the longest run within `ranges[first:end]` of readings at most `tolerance` [m] short of the greatest.
std::array<std::int64_t, 2> deepest_run(Numbers ranges, std::int64_t first, std::int64_t end, double tolerance);

// Return the beam of the greatest of `ranges[first:end]`; -1 where there are none.
std::int64_t furthest_beam(Numbers ranges, std::int64_t first, std::int64_t end);

// Return the position of the middle of a run, in beams: with an even number of them, between two.
inline double middle_of(std::int64_t first, std::int64_t end) { return 0.5 * static_cast<double>(first + end - 1); }

// Return the reading [m] at a position between two beams: the nearer of the two.
double range_at(Numbers ranges, double position);

// Return the run of readings above 0 that a beam is in, within `ranges[first:end]`.
std::array<std::int64_t, 2> run_around(Numbers ranges, std::int64_t beam, std::int64_t first, std::int64_t end);

// Return the beams within `ranges[first:end]` whose next one to the left differs by more than a threshold [m].
OwnRow<std::int64_t> disparities(Numbers ranges, std::int64_t first, std::int64_t end, double threshold);

}  // namespace fg
