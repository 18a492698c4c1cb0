// Gap finder: the disparity extender with more filters, as controllers/gap_finder.py describes it.
#pragma once
#include <array>

#include "../core/arrays.hpp"
#include "../core/records.hpp"
#include "control/planner.hpp"

namespace fg {

// Parameters of the components; the lookahead clips the ranges too.
struct GapFinderSettings {
    DrivingSettings driving;
    double field_of_view;        // [rad] component 4
    double disparity_threshold;  // [m] between neighbouring readings, for an edge
    double clearance;            // [m] to the side of the car, past a disparity
    double nearest_bubble;       // [m] refined: radius of component 5
    double mean_radius;          // [m] refined: of the mean filter's bubble
    double edge_weight;          // centre priority at the edges of the field of view
};
FG_RECORD_AFTER(GapFinderSettings, driving, field_of_view, disparity_threshold, clearance, nearest_bubble, mean_radius,
                edge_weight);

// Return the goal's bearing [rad] and distance [m]; NaN where no beam can be driven along.
std::array<double, 2> gap_finder_goal(const ScanGeometry& geometry, Numbers ranges, const CarParameters& car,
                                      const GapFinderSettings& settings, const IntermediateScans& debug);

// Write the reference to that goal.
void refer_by_gap_finder(const Tick& tick, PlannerState<GapFinderSettings>& state);

}  // namespace fg
