// Clearance: the distance from the footprint of a car to walls and obstacles.
#pragma once
#include "../core/arrays.hpp"

namespace fg {

// Return the distance from a segment to a rectangle about the origin, its length along x; 0 where they overlap.
double rectangle_distance(double ax, double ay, double bx, double by, double half_length, double half_width);

// Return the least distance to segments, (1 or n, m, 4), of the rectangle whose middle is `ahead` of each pose (n, 3).
double least_clearance(Matrix poses, Cube<const double> segments, double ahead, double half_length, double half_width);

// Write to `found` (n,) the least distance at each pose.
void clearances(Matrix poses, Cube<const double> segments, double ahead, double half_length, double half_width,
                Row<double> found);

}  // namespace fg
