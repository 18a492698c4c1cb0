// Filters of scans, applied before the search for a gap: one named function for each.
#include "scan_filters.hpp"

#include <algorithm>
#include <cmath>
#include <memory>

#include "../../core/numbers.hpp"
#include "../../core/transcendental.hpp"
#include "../../core/versions.hpp"
#include "gaps.hpp"

namespace fg {
namespace {

constexpr double most_noise = 0.15;  // [m] that is measured,
constexpr int noise_bins = 128;      // and in so many steps
constexpr int noise_every = 4;       // beams, of which one is compared with its neighbours
// Median of how far a beam is off the line through its neighbours, over the noise.
const double off_line = 0.6745 * std::sqrt(6.0);
constexpr double most_beams = 1e9;  // to either side; a bubble of more beams than a number can count has this many

OwnRow<double> copy_of(Numbers ranges) {
    OwnRow<double> result = OwnRow<double>::unset(ranges.length);
    copy_ranges(result, ranges);
    return result;
}

// Take for each failed reading the nearer of its next valid neighbours on either side.
void bridge_failed(Numbers ranges, Row<double> result) {
    double neighbour = inf;  // the last valid one to the right
    for (int beam = 0; beam < ranges.size(); ++beam) {
        if (std::isnan(ranges[beam])) result[beam] = neighbour;
        neighbour = result[beam];
    }
    neighbour = inf;  // the last valid one to the left
    for (int beam = ranges.size() - 1; beam >= 0; --beam) {
        if (!std::isnan(ranges[beam])) neighbour = result[beam];
        result[beam] = min(result[beam], neighbour);
    }
}

// Write each reading as a distance in [0, range_max], or NaN; return how many are NaN.
FG_VERSIONS std::int64_t clip_readings(const double* ranges, int count, double range_max, double* result) {
    std::int64_t failed = 0;
    FG_INDEPENDENT
    for (int beam = 0; beam < count; ++beam) {
        failed += ranges[beam] != ranges[beam];
        result[beam] = min(max(ranges[beam], 0.0), range_max);
    }
    return failed;
}

// Return the number of beams to either side of one, `distance` [m] long, that pass its end within `radius` [m].
inline std::int32_t bubble_width(double distance, double radius, double angle_increment) {
    const double nearest = radius / pi;  // from here on the bubble spans half a turn
    double width = std::ceil(radius / (angle_increment * (distance < nearest ? nearest : distance)));
    width = width > 0.0 ? width : 0.0;  // NaN, which no width should be, is 0
    return static_cast<std::int32_t>(width < most_beams ? width : most_beams);
}

FG_VERSIONS void write_widths(const double* ranges, int count, double radius, double angle_increment,
                              std::int32_t* widths) {
    FG_INDEPENDENT
    for (int beam = 0; beam < count; ++beam) widths[beam] = bubble_width(ranges[beam], radius, angle_increment);
}

// Shorten what is longer than `distance` [m] within `radius` [m] of the end of a beam of that length.
void add_bubble(Row<double> result, int beam, double distance, double angle_increment, double radius) {
    const int width = bubble_width(distance, radius, angle_increment);
    const int first = max(beam - width, 0), end = min(beam + width + 1, result.size());
    for (int other = first; other < end; ++other) result[other] = min(result[other], distance);
}

// Set the beams to 0 that are at most `width` from one.
void mask_around(Row<double> result, int beam, int width) {
    const int first = max(beam - width, 0), end = min(beam + width + 1, result.size());
    for (int other = first; other < end; ++other) result[other] = 0.0;
}

struct Waiting {
    double distance;     // [m] of a bubble,
    std::int64_t until;  // and the step at which it ends
};

// Shorten each beam of `result` to the nearest of the bubbles that reach it from beams before it, on the `way` from
// right to left (1) or back (-1).
//
// The nearer a reading, the wider its bubble. So one that is nearer than those before it replaces them for good; one
// that is not waits in line, nearest first, until the bubble that holds has come to its end.
void shorten_onwards(Row<double> result, Numbers ranges, Row<const std::int32_t> widths, Row<Waiting> line, int way) {
    const std::int64_t count = ranges.length;
    double nearest = inf;     // the bubble that holds: its distance,
    std::int64_t until = -1;  // and the step at which it ends
    Waiting *first = line.data, *behind = line.data;  // who waits
    for (std::int64_t step = 0, beam = way > 0 ? 0 : count - 1; step < count; ++step, beam += way) {
        const double distance = ranges[beam];
        if (distance <= nearest) {
            nearest = distance, until = step + widths[beam];
            first = behind = line.data;
        } else {
            while (behind > first && behind[-1].distance >= distance) --behind;
            behind->distance = distance, behind->until = step + widths[beam];
            ++behind;
            while (until < step && first < behind) {
                nearest = first->distance, until = first->until;
                ++first;
            }
            result[beam] = min(result[beam], nearest);
        }
    }
}

// Write the sums (n + 1,) of all beams before each: the beams are in four parts, whose sums go on at a time.
void write_sums(Numbers ranges, Row<double> total) {
    const int count = ranges.size(), quarter = count / 4;
    double a = 0.0, b = 0.0, c = 0.0, d = 0.0;
    for (int beam = 0; beam < quarter; ++beam) {
        a += ranges[beam], b += ranges[quarter + beam];
        c += ranges[2 * quarter + beam], d += ranges[3 * quarter + beam];
        total[beam + 1] = a, total[quarter + beam + 1] = b;
        total[2 * quarter + beam + 1] = c, total[3 * quarter + beam + 1] = d;
    }
    for (int beam = 4 * quarter; beam < count; ++beam) {
        d += ranges[beam];
        total[beam + 1] = d;
    }
    const double two = a + b, three = a + b + c;
    for (int beam = 0; beam < quarter; ++beam) {
        total[quarter + beam + 1] += a;
        total[2 * quarter + beam + 1] += two;
    }
    for (int beam = 3 * quarter; beam < count; ++beam) total[beam + 1] += three;
}

// Return the beam of the least of ranges, the rightmost of several, or the first that is NaN; -1 of none.
int nearest_of(Numbers ranges) {
    int nearest = ranges.length > 0 ? 0 : -1;
    for (int beam = 1; beam < ranges.size() && !std::isnan(ranges[nearest]); ++beam)
        if (!(ranges[beam] >= ranges[nearest])) nearest = beam;
    return nearest;
}

// Return the least of ranges (n,), inf of none: of four parts, which a processor looks through at the same time.
double least_of(Numbers ranges) {
    double a = inf, b = inf, c = inf, d = inf;
    const int whole_parts = ranges.size() / 4 * 4;
    for (int beam = 0; beam < whole_parts; beam += 4) {
        a = min(a, ranges[beam]), b = min(b, ranges[beam + 1]);
        c = min(c, ranges[beam + 2]), d = min(d, ranges[beam + 3]);
    }
    for (int beam = whole_parts; beam < ranges.size(); ++beam) a = min(a, ranges[beam]);
    return min(min(a, b), min(c, d));
}

}  // namespace

void copy_ranges(Row<double> into, Numbers ranges) { std::copy_n(ranges.data, ranges.length, into.data); }

OwnRow<double> valid_ranges(Numbers ranges, double range_max) {
    OwnRow<double> result = OwnRow<double>::unset(ranges.length);
    write_valid_ranges(result, ranges, range_max);
    return result;
}

void write_valid_ranges(Row<double> into, Numbers ranges, double range_max) {
    const std::int64_t failed = clip_readings(ranges.data, ranges.size(), range_max, into.data);
    if (failed == ranges.length)
        std::fill_n(into.data, into.length, 0.0);
    else if (failed > 0)
        bridge_failed(ranges, into);
}

double noise_of(Numbers ranges, double range_max) {
    int counts[noise_bins] = {}, total = 0;
    for (int beam = 1; beam < ranges.size() - 1; beam += noise_every) {
        const double right = ranges[beam - 1], middle = ranges[beam], left = ranges[beam + 1];
        if (0.0 < middle && middle < range_max && right > 0.0 && left > 0.0) {
            const double off =
                middle * std::abs(middle * (right + left) / (right * left) - 2.0) / (off_line * most_noise);
            ++counts[max(whole(min(off * noise_bins + 0.5, noise_bins - 1.0)), 0)];
            ++total;
        }
    }
    int level = 0, below = counts[0];
    while (2 * below < total) below += counts[++level];
    return most_noise * level / noise_bins;
}

OwnRow<double> clip_to_lookahead(Numbers ranges, double lookahead) {
    OwnRow<double> result = OwnRow<double>::unset(ranges.length);
    for (int beam = 0; beam < ranges.size(); ++beam) result[beam] = min(ranges[beam], lookahead);
    return result;
}

OwnRow<std::int32_t> bubble_beams(Numbers ranges, double radius, double angle_increment) {
    OwnRow<std::int32_t> result = OwnRow<std::int32_t>::unset(ranges.length);
    write_widths(ranges.data, ranges.size(), radius, angle_increment, Row<std::int32_t>(result).data);
    return result;
}

OwnRow<double> safety_bubbles(Numbers ranges, Row<const std::int64_t> beams, double angle_increment, double radius) {
    OwnRow<double> result = copy_of(ranges);
    for (int i = 0; i < beams.size(); ++i) {
        const int beam = static_cast<int>(beams[i]);
        add_bubble(result, beam, ranges[beam], angle_increment, radius);
    }
    return result;
}

OwnRow<double> extend_disparities(Numbers ranges, double angle_increment, double threshold, double radius) {
    OwnRow<double> result = copy_of(ranges);
    for (int beam = 1; beam < ranges.size(); ++beam) {
        const double step = ranges[beam] - ranges[beam - 1];
        if (std::abs(step) > threshold) {
            const int edge = step < 0.0 ? beam : beam - 1;
            add_bubble(result, edge, ranges[edge], angle_increment, radius);
        }
    }
    return result;
}

// These are the safety bubbles of all beams, in a time in proportion to n.
OwnRow<double> widen_all(Numbers ranges, double angle_increment, double radius) {
    OwnRow<double> result = copy_of(ranges);
    const OwnRow<std::int32_t> widths = bubble_beams(ranges, radius, angle_increment);
    const auto line = std::make_unique_for_overwrite<Waiting[]>(ranges.length);
    shorten_onwards(result, ranges, widths, {line.get(), ranges.length}, 1);
    shorten_onwards(result, ranges, widths, {line.get(), ranges.length}, -1);
    return result;
}

std::int64_t greatest_beam(Numbers ranges) {
    double a = -inf, b = -inf, c = -inf, d = -inf;
    const int whole_parts = ranges.size() / 4 * 4;
    for (int beam = 0; beam < whole_parts; beam += 4) {
        a = max(a, ranges[beam]), b = max(b, ranges[beam + 1]);
        c = max(c, ranges[beam + 2]), d = max(d, ranges[beam + 3]);
    }
    for (int beam = whole_parts; beam < ranges.size(); ++beam) a = max(a, ranges[beam]);
    const double greatest = max(max(a, b), max(c, d));
    for (int beam = 0; beam < ranges.size(); ++beam)
        if (ranges[beam] == greatest) return beam;
    return 0;
}

// Of several that are as near, as within an edge that was widened, the middle one; where all are, there is no nearest.
OwnRow<double> mask_nearest(Numbers ranges, double angle_increment, double radius) {
    const double nearest = least_of(ranges);
    int as_near = 0;
    for (int beam = 0; beam < ranges.size(); ++beam) as_near += ranges[beam] == nearest;
    OwnRow<double> result = copy_of(ranges);
    if (0 < as_near && as_near < ranges.size()) {
        int middle = -1;
        for (int found = 0; found < (as_near + 1) / 2; ++found) {
            ++middle;
            while (ranges[middle] != nearest) ++middle;
        }
        mask_around(result, middle, bubble_width(nearest, radius, angle_increment));
    }
    return result;
}

// Of several that are as near, the rightmost; where it is at 0, nothing is masked. Source: the notes of the field on
// obstacle masking. `mask_nearest` is wider: the arc of a bubble near by is longer than its tangent.
OwnRow<double> mask_points(Numbers ranges, double angle_increment, double radius) {
    OwnRow<double> result = copy_of(ranges);
    const int nearest = nearest_of(ranges);
    for (int beam = 0; beam < ranges.size(); ++beam)
        if (chord(ranges[nearest], ranges[beam], std::abs(beam - nearest) * angle_increment) <= radius)
            result[beam] = 0.0;
    return result;
}

OwnRow<double> mask_bubble(Numbers ranges, double angle_increment, double radius) {
    OwnRow<double> result = copy_of(ranges);
    const int nearest = nearest_of(ranges);
    if (nearest >= 0 && ranges[nearest] > 0.0) {
        double width = angle_increment > 0.0 ? fg::atan(radius / ranges[nearest]) / angle_increment : 0.0;
        width = width > 0.0 ? width : 0.0;  // NaN is 0
        mask_around(result, nearest, static_cast<int>(min(width, most_beams)));
    }
    return result;
}

// What is 0 stays 0. A bubble's edge next to a long stretch becomes a slope, which holds the goal off the edge.
OwnRow<double> rolling_mean(Numbers ranges, double angle_increment, double radius) {
    const int count = ranges.size();
    OwnRow<double> total = OwnRow<double>::unset(count + 1);  // of all beams before each
    total[0] = 0.0;
    write_sums(ranges, total);
    const OwnRow<std::int32_t> widths = bubble_beams(ranges, radius, angle_increment);
    OwnRow<double> result = OwnRow<double>::unset(count);
    for (int beam = 0; beam < count; ++beam) {
        const int first = max(beam - widths[beam], 0), end = min(beam + widths[beam] + 1, count);
        const double mean = (total[end] - total[first]) / (end - first);
        result[beam] = ranges[beam] > 0.0 ? mean : 0.0;
    }
    return result;
}

OwnRow<double> prioritise_centre(Numbers ranges, Numbers bearings, double edge_weight) {
    OwnRow<double> result = copy_of(ranges);
    if (bearings.length == 0) return result;
    const double widest = max(std::abs(bearings[0]), std::abs(bearings[bearings.length - 1]));
    if (widest > 0.0)
        for (int beam = 0; beam < ranges.size(); ++beam)
            result[beam] *= 1.0 - (1.0 - edge_weight) * std::abs(bearings[beam]) / widest;
    return result;
}

}  // namespace fg
