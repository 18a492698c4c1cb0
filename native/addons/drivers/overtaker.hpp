// Overtaker: the gap finder among other cars, from the scan and odometry alone.
#pragma once
#include "../../controllers/control/planner.hpp"
#include "passing.hpp"

namespace fg {

using OvertakerState = PlannerState<OvertakerSettings, Racing>;

// Write the reference, the scan with cars as drawn, that without, and that without anything that moves.
void overtake(const Tick& tick, OvertakerState& state);

// Take cars out of a scan (n,) [m].
void hide_cars(const Racing& memory, const ScanGeometry& geometry, Row<double> ranges);

}  // namespace fg
