// The reference of a planner, from the goal or the reference that its own function finds in a scan.
#pragma once
#include <array>
#include <cstdint>

#include "../../core/arrays.hpp"
#include "../../core/numbers.hpp"
#include "../../messages.hpp"
#include "../perception/intermediate_scans.hpp"
#include "../perception/scan_geometry.hpp"
#include "driving.hpp"
#include "planner_settings.hpp"
#include "stages.hpp"

namespace fg {

// What a planner keeps of one world.
template <class Settings, class Memory = NoMemory> struct PlannerState {
    Settings settings;
    Memory memory;  // from tick to tick
};

// Finds a goal: its bearing [rad] (NaN: there is none, and the car brakes) and its distance from the LiDAR [m]. The
// ranges (n,) [m] are without NaN or inf, of two beams or more, and not all 0; the scans are for pictures.
template <class Settings>
using FindGoal = std::array<double, 2> (*)(const ScanGeometry& geometry, Numbers ranges, const CarParameters& car,
                                           const Settings& settings, const IntermediateScans& scans);

// Returns steering angle [rad] (NaN: brake), greatest speed [m/s], and the bearing [rad] that the car looks towards.
// The ranges are as for FindGoal; the line through the map is (points, columns).
template <class Settings, class Memory>
using FindReference = std::array<double, 3> (*)(const ScanGeometry& geometry, Numbers ranges, const Odometry& odometry,
                                                const CarParameters& car, const Settings& settings, Memory& memory,
                                                Matrix line);

// Write the reference to the goal that a function finds.
template <class Settings> void refer_to(const Tick& tick, const Settings& settings, FindGoal<Settings> find_goal) {
    const IntermediateScans scans{tick.debug[0], tick.debug[1], tick.debug[2], tick.debug[3]};
    double bearing = nan, distance = 0.0;
    if (sees(tick.geometry, tick.ranges)) {
        write_debug(scans.filtered, tick.ranges);
        const std::array<double, 2> goal = find_goal(tick.geometry, tick.ranges, tick.driver.car, settings, scans);
        bearing = goal[0], distance = goal[1];
    }
    refer_to_goal(tick.record, scans.filtered, bearing, distance);
}

// Write the reference that a function returns.
template <class Settings, class Memory>
void refer_by(const Tick& tick, PlannerState<Settings, Memory>& state, FindReference<Settings, Memory> find) {
    std::array<double, 3> found{nan, 0.0, nan};
    if (sees(tick.geometry, tick.ranges))
        found = find(tick.geometry, tick.ranges, tick.odometry, tick.driver.car, state.settings, state.memory,
                     tick.line);
    refer(tick.record, tick.ranges, found[0], found[1], found[2], nan);
}

}  // namespace fg
