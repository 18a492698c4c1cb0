// The nine components of the gap finder, in their order.
#include "gap_finder.hpp"

#include <algorithm>

#include "../core/numbers.hpp"
#include "perception/gaps.hpp"
#include "perception/scan_filters.hpp"

namespace fg {

std::array<double, 2> gap_finder_goal(const ScanGeometry& geometry, Numbers ranges, const CarParameters& car,
                                      const GapFinderSettings& settings, const IntermediateScans& debug) {
    const double increment = geometry.angle_increment, reach = 0.5 * car.width + settings.clearance;
    const OwnRow<double> clipped = clip_to_lookahead(ranges, settings.driving.lookahead);
    write_debug(debug.extended, extend_disparities(clipped, increment, settings.disparity_threshold, reach));
    const Numbers extended = debug.extended;
    if (settings.driving.method == method_source) {
        const double* const first = extended.data;
        const std::int64_t nearest[] = {std::min_element(first, first + extended.length) - first};
        write_debug(debug.bubble, safety_bubbles(extended, row(nearest), increment, reach));
        write_debug(debug.filtered, rolling_mean(debug.bubble, increment, reach));
    } else {
        write_debug(debug.bubble, mask_nearest(extended, increment, settings.nearest_bubble));
        write_debug(debug.filtered, rolling_mean(debug.bubble, increment, settings.mean_radius));
    }
    const Numbers filtered = debug.filtered;
    const double half = 0.5 * settings.field_of_view;
    const auto [first, end] = beams_between(geometry, ranges.length, -half, half);
    if (first == end) return {nan, 0.0};
    const OwnRow<double> bearings = OwnRow<double>::unset(end - first);
    for (std::int64_t beam = first; beam < end; ++beam)
        bearings[beam - first] = bearing_of(geometry, static_cast<double>(beam));
    const OwnRow<double> preferred = prioritise_centre(filtered.part(first, end), bearings, settings.edge_weight);
    const std::int64_t goal = greatest_beam(preferred);
    if (preferred[goal] <= 0.0) return {nan, 0.0};
    const auto [gap_first, gap_end] = run_around(filtered, first + goal, first, end);
    write_debug_run(debug.gap, filtered, gap_first, gap_end);
    return {bearings[goal], filtered[first + goal]};
}

void refer_by_gap_finder(const Tick& tick, PlannerState<GapFinderSettings>& state) {
    refer_to<GapFinderSettings>(tick, state.settings, gap_finder_goal);
}

}  // namespace fg
