// Recovery: a car that stands although its frontier is known, or without one, reverses along its path and tries again.
#pragma once
#include <cstdint>

#include "../../core/arrays.hpp"
#include "../../core/records.hpp"
#include "../control/planner_settings.hpp"
#include "../perception/local_map.hpp"

namespace fg {

// When a car reverses, how far and how fast.
struct RecoverySettings {
    double patience;        // [s] the car stands before the first attempt; an obstacle may move on
    double patience_known;  // [s] the same if a frontier is known and nothing moves, and later
    double distance;        // [m] of the first attempt; twice as far the second time, and so on
    double speed;           // [m/s] back, and on again
    std::int64_t tries;     // attempts
    double come_on;         // [m] forward from where it stood: then the attempts are reset
    double reach;           // [m] from the rear axle to the point of the path that it steers for
};
FG_RECORD(RecoverySettings, patience, patience_known, distance, speed, tries, come_on, reach);

// Type of what is kept from tick to tick; zero at the beginning.
struct Recovery {
    double stood;     // [s]
    double stood_at;  // [m] along the path, when an attempt last began
    double back;      // [m] still to be reversed
    std::int64_t tried;
};
FG_RECORD(Recovery, stood, stood_at, back, tried);

// Return whether the car is to reverse now, with the steering angle of `angle_back`.
// Arguments: present speed [m/s]; whether the car does not move; whether there is a way to a frontier; whether no
// frontier is known, or something moves; period of the tick [s].
bool reverses(Recovery& memory, const RecoverySettings& settings, const LocalMap& world, double speed, bool stands,
              bool found, bool waits, double period);

// Return the steering angle [rad] back along the path of a local map; NaN: it is no longer than the reach.
double angle_back(const LocalMap& world, const RecoverySettings& settings, const CarParameters& car);

}  // namespace fg
