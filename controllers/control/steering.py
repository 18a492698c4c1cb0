"""From a goal to a steering angle; the work is done in native/controllers/control/steering.hpp."""

from __future__ import annotations

from fg_mujoco.native import core

saturate = core.saturate
"""Return `value` held within +-`limit`: beyond the limit, turn as sharply as possible."""

pursue = core.pursue
"""Return the steering angle [rad] whose arc leads the rear axle through a goal seen by the LiDAR.

The goal lies at `bearing` [rad] and `distance` [m] from the LiDAR, which sits `lidar_offset` [m] ahead of
the rear axle. The arc through the axle, tangent to the car, has the curvature 2 y / (x^2 + y^2) (R. Coulter,
Implementation of the Pure Pursuit Path Tracking Algorithm, CMU-RI-TR-92-01). Not saturated.
"""

arc_through = core.arc_through
"""Return the steering angle [rad] whose arc leads the rear axle through a place, forward or back.

The place is `x` [m] ahead of it and `y` [m] to the left. Not saturated.
"""

bearing_of_arc = core.bearing_of_arc
"""Return the position, seen from the LiDAR, of the point at `distance` [m] on the arc of a steering angle [rad].

This is the inverse of `pursue`. Of an arc that does not reach so far: where it comes nearest to it.
"""

late_by = core.late_by
"""Return by how much later than on the F1TENTH car the wheels turn [s]: lag of the servo and delay of commands."""
