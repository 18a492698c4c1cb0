// Boxes that move. Each is a mocap body: the LiDAR sees it, the car can hit it, and nothing stops it.
#pragma once
#include <array>

#include "../core/arrays.hpp"

namespace fg {

// Return x and y [m] of a moving obstacle at a time [s], as MovingObstacle.position does; `motion` is its row.
std::array<double, 2> obstacle_position(Numbers motion, double time);

}  // namespace fg
