"""From a goal to a steering angle."""

from __future__ import annotations

import math

from fg_mujoco.messages import CarParameters


def saturate(value: float, limit: float) -> float:
    """Return `value` held within +-`limit`: beyond the limit, turn as sharply as possible."""
    return max(-limit, min(limit, value))


def pursue(bearing: float, distance: float, car: CarParameters) -> float:
    """Return the steering angle [rad] whose arc leads the rear axle through a goal seen by the LiDAR.

    The goal lies at `bearing` [rad] and `distance` [m] from the LiDAR, which sits `car.lidar_offset` ahead of
    the rear axle. The arc through the axle, tangent to the car, has the curvature 2 y / (x^2 + y^2) (R. Coulter,
    Implementation of the Pure Pursuit Path Tracking Algorithm, CMU-RI-TR-92-01). Not saturated.
    """
    x = car.lidar_offset + distance * math.cos(bearing)
    y = distance * math.sin(bearing)
    return math.atan2(2.0 * y * car.wheelbase, x * x + y * y)
