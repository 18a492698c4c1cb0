// Geometry of closed polylines in the plane: (n, 2) points in order, the first not repeated.
#pragma once
#include "../core/arrays.hpp"

namespace fg {

// Boxes by their low and high corners (n, 2), others (m, 2), and those around each 32 of the others in a row (b, 2).
struct Boxes {
    Matrix low, high, other_low, other_high, blocks_low, blocks_high;
};

// Return the number of pairs of boxes that overlap, and write as many of them as there is room for.
std::int64_t overlaps(const Boxes& boxes, Row<std::int64_t> found_first, Row<std::int64_t> found_second);

}  // namespace fg
