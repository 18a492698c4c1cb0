// Pure pursuit: the car has a map, and follows a line through it. The reference for what a map is worth.
#pragma once
#include <array>
#include <cstdint>

#include "../../controllers/control/planner.hpp"
#include "../../core/arrays.hpp"
#include "../../core/records.hpp"

namespace fg {

// Indices of the words of the setting `tracker`.
inline constexpr std::int64_t tracker_pure_pursuit = 1, tracker_map = 4;

// The lookahead and the speed; the rest is of the line.
struct PurePursuitSettings {
    DrivingSettings driving;
    std::int64_t tracker;      // how it steers along the line
    double margin;             // [m] raceline: between the car and the walls
    double least_lookahead;    // [m] from the rear axle
    double lookahead_time;     // [s] the lookahead is at least the way of this time
    double joining_lookahead;  // [m/m] as much more for each metre off the line
    double lost_distance;      // [m] from the line, beyond which the whole line is searched
    double reaction;           // [s] the speed servo's lag
    double curvature_span;     // [m] to either side of a point, for the profile
    double cornering_use;      // share of the cornering that the friction limiter allows
    double braking_use;        // share of the braking and accelerating that it allows
};
FG_RECORD_AFTER(PurePursuitSettings, driving, tracker, margin, least_lookahead, lookahead_time, joining_lookahead,
                lost_distance, reaction, curvature_span, cornering_use, braking_use);

// Type of what it keeps from tick to tick; zero at the beginning.
struct OnLine {
    std::int64_t point;  // of the line, which was nearest
    bool on_line;        // and whether there is one
};
FG_RECORD(OnLine, point, on_line);

// Write the reference.
void refer_along_line(const Tick& tick, PlannerState<PurePursuitSettings, OnLine>& state);

// Return the place on the line that a car at a place and a speed would steer to, seen for the first time: x and y [m].
std::array<double, 2> goal_on_line(Matrix line, const PurePursuitSettings& settings, const Driver& driver, double x,
                                   double y, double speed);

}  // namespace fg
