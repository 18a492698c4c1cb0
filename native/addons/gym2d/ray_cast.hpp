// How f1tenth_gym puts other cars into a scan; see addons/gym2d/gym_functions.py.
#pragma once
#include <array>

#include "../../core/arrays.hpp"

namespace fg {

// Write what a scan reads with a convex shape of corners (4, 2) [m] in it, from a pose x, y [m], heading [rad].
void ray_cast(const std::array<double, 3>& pose, Row<double> scan, Numbers scan_angles, Matrix vertices);

}  // namespace fg
