// A quadratic program on a ring of points, each of which moves within its bounds.
#pragma once
#include "../../core/arrays.hpp"

namespace fg {

// Write where the program is least to x (n,), and return whether the method converges.
bool least_on_ring(Matrix bands, Numbers gradient, Numbers low, Numbers high, Row<double> x);

// Write x of H x = right (n,): the band without the last two points first, for the right side and for these two.
void solve_ring(Matrix bands, Numbers right, Row<double> x);

}  // namespace fg
