// A car on a line: what lies ahead, where the car is there, how it is steered, and how fast it may go.
#pragma once
#include <array>
#include <cstdint>

#include "../../core/arrays.hpp"
#include "friction_limiter.hpp"
#include "lap_raceline.hpp"

namespace fg {

// Columns of a window after those of a motion: the greatest speed squared over the limiter's cornering acceleration
// [m], and the acceleration that the tires hold while the car brakes, over the speed squared [1/m].
inline constexpr int window_radius = 5, window_demand = 6, window_columns = 7;
inline constexpr int window_points = 64;  // that the car looks ahead

inline constexpr double off_the_line = 0.1;  // [m] to its side, from which on the car corners less than it could
inline constexpr double leaves_line = 0.6;   // [m] to its side, beyond which the car no longer follows it

// Return the shares of a limiter's cornering acceleration and of its braking that speed on the line counts on.
std::array<double, 2> uses_on(const Limiter& limiter);

// Return the limiter's settings turn_in_use and lateral_use_in_braking for a car on the line.
std::array<double, 2> on_line(const Limiter& limiter);

// Return the share of what cornering leaves with which the wheels of a car on the line turn in the mean.
double turning_use(const Limiter& limiter);

// Write heading, curvature, window_radius and window_demand of each point of a closed line.
void describe_line(Line& line, const Limiter& limiter);

// Return the points of a closed line from the one before `first` on, in the frame of a car at x, y [m] with a heading
// [rad] in the frame of the points. Shape (64, 7): x and y [m], heading [rad], curvature [1/m], the greatest speed from
// which the tires hold the car through all that comes [m/s], window_radius and window_demand.
OwnTable<double> line_ahead(const Line& line, std::int64_t first, double x, double y, double heading,
                            const Limiter& limiter);

// Write the greatest speed at each point of a window (n, 7), whose points are `spacing` apart [m].
void write_speeds(Table<double> window, double spacing, const Limiter& limiter);

// Return the position of the car between two points of a window, of which `point` is the one ahead: their arc leads
// from one to the other. That is the position along the line in points, how far to the left of the line the car is [m],
// and its angle to the line [rad], positive to the left.
std::array<double, 3> position_on(Matrix window, std::int64_t point, double spacing);

// Return the curvature [1/m] of a line at a position between its points; at the last one, if it is beyond.
double curvature_at(Matrix window, double position);

// Return the greatest speed [m/s] at a position in points, and as far ahead as the car answers late.
double speed_on(Matrix window, double position, double spacing, double now);

// Return steering angle [rad] and speed [m/s] for a car on a line, and the greatest steering angle there [rad]; the car
// follows the line, or else comes to it by another steering angle.
std::array<double, 3> reference_on(Matrix window, double position, double aside, double turned, double spacing,
                                   const Limiter& limiter, double now, bool follows);

}  // namespace fg
