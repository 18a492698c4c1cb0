"""Speed laws: how fast the car may go, by what the scan shows and by what the tires hold.

Kernels: to be called from Python and from other kernels alike. The law that needs more than a line is in
`stopping_paths`.
"""

from __future__ import annotations

import math

from fg_mujoco.kernels import kernel
from fg_mujoco.messages import FloatArray


@kernel
def friction_speed(steering_angle: float, mu: float, wheelbase: float, gravity: float) -> float:
    """Return the greatest speed [m/s] at which the tires hold the car on the circle of `steering_angle` [rad].

    A car of wheelbase b steering by d runs, at its rear axle, on a circle of radius R = b / tan|d|. Holding it
    there takes the force m v^2 / R, and the tires have mu m g: v = sqrt(g mu b / tan|d|). Straight ahead: inf.
    Source: the notes of the field's gap_finder_base, for the kinematic bicycle.
    """
    slope = math.tan(abs(steering_angle))
    return math.sqrt(gravity * mu * wheelbase / slope) if slope > 0.0 else math.inf


@kernel
def friction_steering(speed: float, mu: float, wheelbase: float, gravity: float) -> float:
    """Return the greatest steering angle [rad] that the tires hold at `speed` [m/s]: `friction_speed` read back."""
    return math.atan2(gravity * mu * wheelbase, speed * speed)


@kernel
def range_ratio_speed(ranges: FloatArray, lookahead: float, top_speed: float) -> float:
    """Return a speed [m/s] in proportion to the mean of `ranges` (n,) over the lookahead: slow where it is tight."""
    if len(ranges) == 0:
        return 0.0
    total = 0.0
    for distance in ranges:
        total += distance
    return top_speed * min(1.0, total / len(ranges) / lookahead)
