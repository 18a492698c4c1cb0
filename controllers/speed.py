"""Speed laws: how fast may the car go, by what the scan shows and by what the tires hold."""

from __future__ import annotations

import math

GRAVITY = 9.81  # [m/s^2] MuJoCo's default, which models/f1tenth.xml keeps


def friction_speed(steering_angle: float, mu: float, wheelbase: float) -> float:
    """Return the greatest speed [m/s] at which the tires hold the car on the circle of `steering_angle` [rad].

    A car of wheelbase b steering by d runs, at its rear axle, on a circle of radius R = b / tan|d|. Holding it
    there takes the force m v^2 / R, and the tires have mu m g: v = sqrt(g mu b / tan|d|). Straight ahead: inf.
    Source: the notes of the field's gap_finder_base; kinematic bicycle model.
    """
    slope = math.tan(abs(steering_angle))
    return math.sqrt(GRAVITY * mu * wheelbase / slope) if slope > 0.0 else math.inf


def friction_steering(speed: float, mu: float, wheelbase: float) -> float:
    """Return the greatest steering angle [rad] that the tires hold at `speed` [m/s]: `friction_speed` read back."""
    return math.atan2(GRAVITY * mu * wheelbase, speed * speed)


def range_ratio_speed(mean_range: float, lookahead: float, max_speed: float) -> float:
    """Return a speed [m/s] in proportion to the mean range over the lookahead: slow where it is tight."""
    return max_speed * min(1.0, mean_range / lookahead)


def braking_speed(distance: float, deceleration: float, final_speed: float = 0.0) -> float:
    """Return the greatest speed [m/s] from which `final_speed` is reached within `distance` [m].

    Constant deceleration [m/s^2]: v^2 = final_speed^2 + 2 deceleration distance.
    """
    return math.sqrt(final_speed * final_speed + 2.0 * deceleration * max(distance, 0.0))
