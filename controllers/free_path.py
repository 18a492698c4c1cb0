"""How far the car can go before it touches what the scan shows."""

from __future__ import annotations

import math

import numpy as np

from fg_mujoco.messages import CarParameters, FloatArray


def free_arc(
    ranges: FloatArray, bearings: FloatArray, steering_angle: float, car: CarParameters, clearance: float
) -> float:
    """Return the length [m] that the rear axle can travel at a fixed steering angle before the car meets a reading."""
    x = car.lidar_offset + ranges * np.cos(bearings)
    y = ranges * np.sin(bearings)
    front = car.length - car.rear_overhang
    side = 0.5 * car.width + clearance
    curvature = math.tan(steering_angle) / car.wheelbase
    if abs(curvature) < 1e-3:
        ahead = x[(np.abs(y) < side) & (x > 0)]
        return max(float(np.min(ahead, initial=math.inf)) - front, 0.0)
    radius = 1.0 / abs(curvature)
    y = radius - math.copysign(1.0, curvature) * y  # from the centre of the circle outwards
    reach = np.hypot(x, y)
    inside = (reach > radius - side) & (reach < math.hypot(radius + side, front))
    x, y, reach = x[inside], y[inside], reach[inside]
    # the part of the car that meets a point of this radius: its front, or its inner side
    angles = np.arctan2(x, y) % (2 * math.pi)
    lead = np.arcsin(np.minimum(front / reach, 1.0))
    return max(float(np.min(angles - lead, initial=2 * math.pi)) * radius, 0.0)
