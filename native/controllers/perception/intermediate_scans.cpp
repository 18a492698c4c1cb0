// Intermediate scans: what a planner makes of a scan on its way to the goal, kept for pictures.
#include "intermediate_scans.hpp"

#include "../../core/numbers.hpp"

namespace fg {

void write_debug_run(Row<double> kept, Numbers ranges, std::int64_t first, std::int64_t end) {
    for (int beam = 0; beam < ranges.size(); ++beam) kept[beam] = first <= beam && beam < end ? ranges[beam] : nan;
}

}  // namespace fg
