// Intermediate scans: what a planner makes of a scan on its way to the goal, kept for pictures.
#pragma once
#include <cstdint>

#include "../../core/arrays.hpp"
#include "scan_filters.hpp"

namespace fg {

// Scans of all beams, each (n,) [m], to be written to by a planner that has them.
struct IntermediateScans {
    Row<double> filtered;  // readings as the speed law range_ratio averages them; unless kept, those of the LiDAR
    Row<double> extended;  // after edges were widened
    Row<double> bubble;  // after the surroundings of the nearest point were set to 0
    Row<double> gap;  // the beams of the gap that was chosen; NaN elsewhere
};

// Write ranges (n,) [m] into an intermediate scan of as many beams.
inline void write_debug(Row<double> kept, Numbers ranges) { copy_ranges(kept, ranges); }

// Write `ranges[first:end]` into an intermediate scan (n,) [m], and NaN elsewhere.
void write_debug_run(Row<double> kept, Numbers ranges, std::int64_t first, std::int64_t end);

}  // namespace fg
