"""From a goal to a steering angle. Kernels: to be called from Python and from other kernels alike."""

from __future__ import annotations

import math

from fg_mujoco.compiled.kernels import kernel

from .planner_settings import F1TENTH_STEERING, Record


@kernel
def saturate(value: float, limit: float) -> float:
    """Return `value` held within +-`limit`: beyond the limit, turn as sharply as possible."""
    return max(-limit, min(limit, value))


@kernel
def pursue(bearing: float, distance: float, lidar_offset: float, wheelbase: float) -> float:
    """Return the steering angle [rad] whose arc leads the rear axle through a goal seen by the LiDAR.

    The goal lies at `bearing` [rad] and `distance` [m] from the LiDAR, which sits `lidar_offset` [m] ahead of
    the rear axle. The arc through the axle, tangent to the car, has the curvature 2 y / (x^2 + y^2) (R. Coulter,
    Implementation of the Pure Pursuit Path Tracking Algorithm, CMU-RI-TR-92-01). Not saturated.
    """
    return arc_through(lidar_offset + distance * math.cos(bearing), distance * math.sin(bearing), wheelbase)


@kernel
def arc_through(x: float, y: float, wheelbase: float) -> float:
    """Return the steering angle [rad] whose arc leads the rear axle through a place, forward or back.

    The place is `x` [m] ahead of it and `y` [m] to the left. Not saturated.
    """
    return math.atan2(2.0 * y * wheelbase, x * x + y * y)


@kernel
def bearing_of_arc(steering_angle: float, distance: float, lidar_offset: float, wheelbase: float) -> float:
    """Return the position, seen from the LiDAR, of the point at `distance` [m] on the arc of a steering angle [rad].

    This is the inverse of `pursue`. Of an arc that does not reach so far: where it comes nearest to it.
    """
    curvature = math.tan(steering_angle) / wheelbase
    # curvature = 2 y / (x^2 + y^2), with x = o + d cos(bearing) and y = d sin(bearing), o the LiDAR's offset
    sine = curvature * (lidar_offset**2 + distance**2) / (2.0 * distance * math.hypot(1.0, curvature * lidar_offset))
    return math.atan(curvature * lidar_offset) + math.asin(min(1.0, max(-1.0, sine)))


@kernel
def late_by(car: Record) -> float:
    """Return by how much later than on the F1TENTH car the wheels turn [s]: lag of the servo and delay of commands."""
    return float(car.steering_time_constant - F1TENTH_STEERING + car.command_delay)
