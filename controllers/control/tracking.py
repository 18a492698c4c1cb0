"""Tracking: the steering angle that keeps a car on a motion.

The curvature of the motion is steered ahead of time, by as much as the steering takes, and the distance from the
motion and the angle to it fall over a length that grows with the speed, as a critically damped oscillator does.

Source: the linear feedback of the kinematic car in Frenet coordinates, with feed-forward of the curvature: C. Samson,
Path Following and Time-Varying Feedback Stabilization of a Wheeled Mobile Robot, ICARCV 1992.
"""

from __future__ import annotations

import math

from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.messages import FloatArray

X, Y, HEADING, CURVATURE = range(4)  # columns of a motion: of the rear axle after each arc, and the arc's curvature
SPEED = 4  # [m/s] column of a motion that says how fast the car drives there

LAG = 0.08  # [s] until a new steering angle is reached, of the F1TENTH car
_LENGTH, _LENGTH_TIME = 0.3, 0.1  # [m] and [s]: over which errors fall


@kernel
def next_point(points: FloatArray, index: int, x: float, y: float, heading: float) -> int:
    """Return the index of the first point of a motion from `index` on that lies ahead of the car; the last, if none."""
    cos, sin = math.cos(heading), math.sin(heading)
    while index + 1 < len(points) and cos * (points[index, X] - x) + sin * (points[index, Y] - y) <= 0.0:
        index += 1
    return index


@kernel
def errors(point: FloatArray, x: float, y: float, heading: float) -> tuple[float, float, float]:
    """Return the position of a car on the arc that ends at a point of a motion.

    That is how far ahead the end of the arc is [m], how far to the left of the arc the car is [m], and its angle to the
    arc [rad], positive to the left. The car's rear axle is at (x, y) [m], its heading in [rad].
    """
    cos, sin = math.cos(point[HEADING]), math.sin(point[HEADING])
    ahead = cos * (point[X] - x) + sin * (point[Y] - y)
    aside = cos * (y - point[Y]) - sin * (x - point[X]) - 0.5 * point[CURVATURE] * ahead * ahead
    angle = heading - (point[HEADING] - point[CURVATURE] * ahead)
    return ahead, aside, angle - 2.0 * math.pi * round(angle / (2.0 * math.pi))


@kernel
def steer_along(
    points: FloatArray,
    index: int,
    pose: tuple[float, float, float],
    speed: float,
    wheelbase: float,
    late: float,
    path_late: float,
) -> float:
    """Return the steering angle [rad] that keeps a car on a motion.

    Args:
      points: of the motion (n, 4 or more), see X; in the same frame as the car.
      index: index of the next one, see `next_point`.
      pose: of the rear axle: x [m], y [m], heading [rad].
      speed: of the car [m/s].
      wheelbase: of the car [m].
      late: by how much its wheels turn later than the F1TENTH car's [s], see `late_by`.
      path_late: by how much its path follows its commands later than the F1TENTH car's [s]. Errors fall over a length
        that is greater by the way of this time: a car that answers late would swing about the motion else.
    """
    length = _LENGTH + (_LENGTH_TIME + path_late) * max(speed, 0.0)
    ahead, aside, angle = errors(points[index], pose[0], pose[1], pose[2])
    along, at = ahead, index
    while along < (LAG + late) * speed and at + 1 < len(points):
        along += math.hypot(points[at + 1, X] - points[at, X], points[at + 1, Y] - points[at, Y])
        at += 1
    curvature = points[at, CURVATURE] - aside / (length * length) - 2.0 * math.sin(angle) / length
    return math.atan(wheelbase * curvature)
