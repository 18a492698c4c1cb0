// Filters of scans, applied before the search for a gap: one named function for each.
#pragma once
#include <cstdint>

#include "../../core/arrays.hpp"

namespace fg {

// Copy ranges (n,) into an array of as many.
void copy_ranges(Row<double> into, Numbers ranges);

// Return ranges with every beam a distance in [0, range_max].
//
// No return (+inf) is `range_max`; too close (-inf, or negative) is 0; a failed reading (NaN) takes the nearer of its
// next valid neighbours on either side. Without any valid reading all are 0.
OwnRow<double> valid_ranges(Numbers ranges, double range_max);

// Write the same into another array of as many.
void write_valid_ranges(Row<double> into, Numbers ranges, double range_max);

// Return the standard deviation of the readings (n,) [m] of a scan, at most 0.15 m.
double noise_of(Numbers ranges, double range_max);

// Return ranges cut off at `lookahead` [m]: all that lies beyond is equally far, so the goal does not jitter.
OwnRow<double> clip_to_lookahead(Numbers ranges, double lookahead);

// Return the number of beams to either side of each one that pass its end within `radius` [m]. Shape (n,).
OwnRow<std::int32_t> bubble_beams(Numbers ranges, double radius, double angle_increment);

// Return ranges with a bubble of `radius` [m] round the end of each of `beams`.
OwnRow<double> safety_bubbles(Numbers ranges, Row<const std::int64_t> beams, double angle_increment, double radius);

// Return ranges with every edge widened by `radius` [m], about half the car's width.
OwnRow<double> extend_disparities(Numbers ranges, double angle_increment, double threshold, double radius);

// Return ranges with every reading widened by `radius` [m]: where a car of that half width fits, as a point.
OwnRow<double> widen_all(Numbers ranges, double angle_increment, double radius);

// Return the beam of the greatest of ranges (n,), the rightmost of several; 0 of none: in parts as `least_of`.
std::int64_t greatest_beam(Numbers ranges);

// Return ranges with the bubble of `radius` [m] round the nearest point set to 0: not to be driven along.
OwnRow<double> mask_nearest(Numbers ranges, double angle_increment, double radius);

// Return ranges with all readings that end within `radius` [m] of the nearest point set to 0.
OwnRow<double> mask_points(Numbers ranges, double angle_increment, double radius);

// Return ranges with int(atan(radius / distance) / angle_increment) beams to either side of the nearest set to 0.
OwnRow<double> mask_bubble(Numbers ranges, double angle_increment, double radius);

// Return the mean of each range over the bubble of `radius` [m] at its own end; a part window at the ends.
OwnRow<double> rolling_mean(Numbers ranges, double angle_increment, double radius);

// Return ranges weighted from `edge_weight` at the widest bearing to 1 straight ahead: equal ranges go straight.
OwnRow<double> prioritise_centre(Numbers ranges, Numbers bearings, double edge_weight = 0.999);

}  // namespace fg
