// Trackers: the steering angle that keeps a car on a line through the map, by its error now and the curvature ahead.
#pragma once
#include <cmath>
#include <cstdint>

#include "../../controllers/control/driving.hpp"
#include "../../controllers/control/stages.hpp"
#include "../../core/arrays.hpp"
#include "../../core/numbers.hpp"

namespace fg {

inline constexpr double off_line = 0.4;  // [m] from the line, beyond which the car joins it by pure pursuit

// Return the direction [rad] of the line at a point.
double direction_at(Matrix line, std::int64_t point);

// Return the curvature [1/m] of the line at a point: of the circle through it and one to either side.
double curvature_at(Matrix line, std::int64_t point);

// Return the curvature [1/m] to steer more than the line's by the regulator, for the length L [m].
double lqr_feedback(double aside, double angle, double length);

// Return whether the car has a goal on its line, and does not turn round for it.
inline bool is_ahead(const Reference& reference) { return std::abs(reference.bearing) <= 0.5 * pi; }

// Steer by Stanley's law, and by the regulator, near the line; and by model- and acceleration-based pursuit.
void track_by_stanley(const Tick& tick);
void track_by_lqr(const Tick& tick);
void track_by_map(const Tick& tick);

}  // namespace fg
