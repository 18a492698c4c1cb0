// Patches of floor on which the tires have another friction: ice, sand, paint.
#pragma once
#include "../core/arrays.hpp"

namespace fg {

// Write what each tire has on the floor `under` it (4,) [-], of a car at x, y [m] and heading [rad] in the world.
//   wheels: (4, 2) of `wheel_positions`.
//   patches: (n, 7) of `patch_table`.
//   mu: (4,) of the tires on the ground [-].
void look_at_floor(double x, double y, double heading, Matrix wheels, Matrix patches, Numbers mu, Row<double> under);

}  // namespace fg
