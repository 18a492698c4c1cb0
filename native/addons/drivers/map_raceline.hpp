// The fastest closed line between the walls of a map: the room in which its points move.
#pragma once
#include <array>
#include <cstdint>

#include "../../core/arrays.hpp"

namespace fg {

inline constexpr double walls_cell = 0.5;  // [m] of the grid in which walls are looked up

// Points of walls and obstacles, sorted by the cells of a grid.
struct Walls {
    Matrix points;                     // (m, 2) [m]
    Matrix sides;                      // (m, 2): 1 to the left of the line, -1 to the right; and how far it may lie on
                                       // the other side [m]
    Numbers origin;                    // (2,) [m] of the grid
    Table<const std::int64_t> starts;  // (columns, rows + 1): index of each cell's first point
};

// Write the room of each point: between the wall points beside the car's rectangle, from its tail to its nose.
//   line     points (n, 2) [m]
//   normals  directions to the left of the points (n, 2)
//   outline  half of the width, the tail and the nose, with the margin [m]
//   most     how far a point may move at all [m]
//   low      (n,) [m] from where each point may move, and `high` to where
void find_room(Matrix line, Matrix normals, const Walls& walls, std::array<double, 3> outline, double most,
               Row<double> low, Row<double> high);

}  // namespace fg
