// Progress of a point along the line of a course, and its offset: where on the line a car is.
#pragma once
#include <array>
#include <cstdint>

#include "../core/arrays.hpp"

namespace fg {

// Project a point x, y [m] from a hint: the nearest in a window, which moves on while the nearest is at its edge.
// `near` is its progress shortly before [m]; `table` and `modulus` are those of the Course. Returns the progress in
// [0, modulus) [m], and the offset [m], left positive: the distance to the nearest place.
std::array<double, 2> follow(double x, double y, double near, Matrix table, double modulus);

// Return the number of the last segment that starts at `s` or before; 0 where none does. `starts` is sorted.
std::int64_t segment_at(Numbers starts, double s);

// Return whether the line has sections at a place in [0, modulus), on either side.
bool has_sections(double s, Matrix table);

// Return the progress of a point by the sections of the stretch of its nearest segment; without any, `s`.
double by_sections(double x, double y, double s, std::int64_t segment, Matrix table, bool on_left);

}  // namespace fg
