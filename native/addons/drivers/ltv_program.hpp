// A quadratic program along a horizon: the inputs of least cost for a linear time-varying system with bounds.
#pragma once
#include <cstdint>

#include "../../core/arrays.hpp"

namespace fg {

// Columns of what is bounded: the input, the input and a multiple of the last entry of the state before it, and the
// last and the first entry of the state after it.
inline constexpr int bounds_input = 0, bounds_coupled = 1, bounds_last = 2, bounds_first = 3, bounded = 4;

// Rows of `limits`: the bounds, and one over the weight of the squared distance beyond them; 0: they are hard.
inline constexpr int limits_low = 0, limits_high = 1, limits_softness = 2;

inline constexpr int most_iterations = 30;

// A program of n steps.
struct Program {
    Cube<const double> a;       // (n, states, states) the system,
    Matrix b;                   // (n, states) for its input,
    Matrix c;                   // (n, states) and the known disturbance
    Matrix weights;             // (n + 1, states) of the squared states, from 0
    Numbers effort;             // (n,) of the squared inputs, above 0
    Numbers coupling;           // (n,) times it the last entry is added to the input
    Cube<const double> limits;  // (3, n, 4), see above; finite, and apart
    Numbers start;              // (states,)
};

// Write the solution, inputs (n,) and states (n + 1, states), and return after how many of at most `most` steps it
// converged; 0: not, or it is not finite.
int solve_program(const Program& program, Row<double> inputs, Table<double> states, int most);

}  // namespace fg
