// Finds gaps: runs of beams, given as the first beam and the one behind the last, `ranges[first:end]`.
#include "gaps.hpp"

#include <algorithm>
#include <cmath>

#include "../../core/numbers.hpp"
#include "../../core/transcendental.hpp"

namespace fg {
namespace {

// Return a reading; -1 is the last beam, and beyond the scan is the first one.
double reading(Numbers ranges, std::int64_t beam) {
    const std::int64_t index = beam < 0 ? beam + ranges.length : beam;
    if (ranges.length == 0) return 0.0;
    return ranges[0 <= index && index < ranges.length ? index : 0];
}

}  // namespace

// This is the cosine law, sqrt(a^2 + b^2 - 2 a b cos(angle)), as sqrt((a - b)^2 + 4 a b sin(angle / 2)^2): where the
// angle is small, the first subtracts nearly all that it has.
double chord(double a, double b, double angle) {
    return fg::hypot(a - b, 2.0 * std::sqrt(a) * std::sqrt(b) * fg::sin(0.5 * angle));
}

std::array<std::int64_t, 2> longest_run(Numbers ranges) {
    std::int64_t best_first = 0, best_end = 0;
    std::int64_t first = 0;  // of the run that has not ended
    for (std::int64_t beam = 0; beam < ranges.length; ++beam) {
        if (ranges[beam] == 0.0)
            first = beam + 1;
        else if (beam + 1 - first > best_end - best_first)
            best_first = first, best_end = beam + 1;
    }
    return {best_first, best_end};
}

// inf is beyond any threshold, NaN beyond none.
OwnTable<std::int64_t> runs_beyond(Numbers ranges, double threshold, std::int64_t least) {
    least = max(least, std::int64_t{1});
    const OwnTable<std::int64_t> runs(ranges.length / least + 1, 2);
    std::int64_t count = 0, first = 0;
    for (std::int64_t beam = 0; beam <= ranges.length; ++beam) {
        if (beam < ranges.length && (ranges[beam] > threshold || ranges[beam] == inf)) continue;
        if (beam - first >= least) {
            runs[count][0] = first, runs[count][1] = beam;
            ++count;
        }
        first = beam + 1;
    }
    OwnTable<std::int64_t> found(count, 2);
    std::copy_n(Table<std::int64_t>(runs).data, 2 * count, Table<std::int64_t>(found).data);
    return found;
}

// Of several, the rightmost; `first` and `first` where there are no readings.
std::array<std::int64_t, 2> deepest_run(Numbers ranges, std::int64_t first, std::int64_t end, double tolerance) {
    double greatest = -inf;
    for (std::int64_t beam = first; beam < end; ++beam) greatest = max(greatest, ranges[beam]);
    std::int64_t best_first = first, best_end = first;
    std::int64_t start = first;  // of the run that has not ended
    for (std::int64_t beam = first; beam < end; ++beam) {
        if (ranges[beam] < greatest - tolerance)
            start = beam + 1;
        else if (beam + 1 - start > best_end - best_first)
            best_first = start, best_end = beam + 1;
    }
    return {best_first, best_end};
}

// Of several, the middle one of their longest run: beams without return are all as far, and the first of them would be
// the right edge of an opening.
std::int64_t furthest_beam(Numbers ranges, std::int64_t first, std::int64_t end) {
    const auto [run_first, run_end] = deepest_run(ranges, first, end, 0.0);
    return run_end > run_first ? (run_first + run_end - 1) / 2 : -1;
}

double range_at(Numbers ranges, double position) {
    return min(reading(ranges, whole(std::floor(position))), reading(ranges, whole(std::ceil(position))));
}

std::array<std::int64_t, 2> run_around(Numbers ranges, std::int64_t beam, std::int64_t first, std::int64_t end) {
    std::int64_t start = beam, stop = beam;
    while (start > first && ranges[start - 1] > 0.0) --start;
    while (stop < end && ranges[stop] > 0.0) ++stop;
    return {start, stop};
}

OwnRow<std::int64_t> disparities(Numbers ranges, std::int64_t first, std::int64_t end, double threshold) {
    const auto jumps = [&](std::int64_t beam) { return std::abs(ranges[beam + 1] - ranges[beam]) > threshold; };
    std::int64_t count = 0;
    for (std::int64_t beam = first; beam < end - 1; ++beam) count += jumps(beam);
    OwnRow<std::int64_t> found = OwnRow<std::int64_t>::unset(count);
    for (std::int64_t beam = first, at = 0; at < count; ++beam)
        if (jumps(beam)) found[at++] = beam;
    return found;
}

}  // namespace fg
