// Finds poses in which a car touches nothing, so that MuJoCo need not look for contacts there, a fifth of its step.
#pragma once
#include "../core/arrays.hpp"
#include "../vehicle/motion.hpp"
#include "../vehicle/terrain.hpp"

namespace fg {

// Distances that show where the cars of a world touch nothing; empty `distances`: no place is known to be clear.
struct ClearGround {
    Matrix distances;  // (rows, columns) [m] from the middles of cells to what stands, REACH at most
    Numbers corner;    // (2,) x and y of the middle of cell (0, 0) [m]
    Matrix bodies;     // (m, 9) of the cars, see `_write_body`
};

// Write the corners of prisms from above into `points` (k, 2) [m], counterclockwise about each one's middle.
//   vertices: (v, 3) of all prisms, in their own frames [m].
//   starts, ends: (n,) where in `vertices` those of a prism begin, and where in `points` they end.
//   places, turns: (n, 3) [m] and (n, 4) wxyz of the prisms.
void outline(Table<const float> vertices, Row<const std::int32_t> starts, Row<const std::int64_t> ends, Matrix places,
             Matrix turns, Table<double> points);

// Lower the distances from cells to the convex outlines of `points` (k, 2) that end before `ends`.
void fill(Matrix points, Row<const std::int64_t> ends, Numbers corner, Table<double> distances);

// Return whether the `cars` (m,) of a world are clear of all that is solid, as they are now.
bool touches_nothing(Numbers qpos, Row<const Car> cars, const ClearGround& clear, const Terrain& terrain = {});

}  // namespace fg
