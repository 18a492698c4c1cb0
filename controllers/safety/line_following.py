"""A car on a line: where it is there, how it is steered, and how fast it may go.

    points = ahead_on(line, first)
    position, aside, turned = position_on(points, point, spacing, x, y, heading)
    steering_angle, speed, _ = reference_on(points, position, aside, turned, spacing, limiter, now, True)

The car steers along the line as in control.tracking. Its place on the line and the curvature there are read between
the points: steps of the steering angle would take from braking. Its speed is the greatest from which the tires hold the
car through what comes: cornering, turning the wheels, and braking before with what cornering leaves.
"""

from __future__ import annotations

import math

import numpy as np

from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.messages import FloatArray

from ..control.planner_settings import Record
from ..control.steering import late_by, saturate
from ..control.tracking import CURVATURE, HEADING, LAG, X, Y
from .friction_limiter import longitudinal_share, stable_share

RADIUS = 4  # column of the line after those of control.tracking: the greatest speed squared over `lateral` [m]
DEMAND = 5  # column: the acceleration that the tires hold while the car brakes, over the speed squared [1/m]
OFF = 0.1  # [m] to the side of the line, from which on the car corners less than it could
LEAVES = 0.6  # [m] to the side of the line, beyond which the car no longer follows it
CORRECTION_USE = 0.9
"""Share of the limiter's cornering acceleration for coming back to the line."""

_POINTS = 64  # that the car looks ahead
# shares of the limiter's cornering acceleration and of its braking; of tires that need slip angles, and so answer late
_USES, _USES_WHEN_LATE = (0.93, 0.85), (0.9, 0.7)
_LOOKAHEAD = 0.1  # [s] for which the speed is read ahead
_LENGTH, _LENGTH_TIME = 0.35, 0.15  # [m] and [s]: over which the distance from the line falls
_ON_IT = 0.06  # [m] to the side of the line from which on the car is slower,
_SLOWER_OFF = 1.5  # [1/m] by this share for each metre


@kernel
def uses_on(limiter: Record) -> tuple[float, float]:
    """Return the shares of a limiter's cornering acceleration and of its braking that speed on the line counts on."""
    return _USES_WHEN_LATE if limiter.slip.needs_slip_angle else _USES


@kernel
def ahead_on(points: FloatArray, first: int) -> FloatArray:
    """Return the points of a closed line (n, 6) from the one before `first` on (_POINTS, 6)."""
    window = np.empty((_POINTS, 6))
    for k in range(_POINTS):
        window[k] = points[(first + k - 1) % len(points)]
    return window


@kernel
def position_on(
    points: FloatArray, point: int, spacing: float, x: float, y: float, heading: float
) -> tuple[float, float, float]:
    """Return the position of a car between two points of a line: their arc leads from one to the other.

    That is the position along the line in points, how far to the left of the line the car is [m], and its angle to the
    line [rad], positive to the left.

    Args:
      points: of a line (n, 6).
      point: index of the one ahead of the car, from 1.
      spacing: of the points [m].
      x: of the rear axle [m].
      y: of the rear axle [m].
      heading: of the car [rad].
    """
    before, after = points[point - 1], points[point]
    left = math.cos(after[HEADING]) * (after[X] - x) + math.sin(after[HEADING]) * (after[Y] - y)
    share = min(max(1.0 - left / spacing, 0.0), 1.0)
    turn = after[HEADING] - before[HEADING]
    turn -= 2.0 * math.pi * round(turn / (2.0 * math.pi))
    direction = before[HEADING] + share * turn
    dx = x - before[X] - share * (after[X] - before[X])
    dy = y - before[Y] - share * (after[Y] - before[Y])
    aside = math.cos(direction) * dy - math.sin(direction) * dx
    aside += 0.5 * share * (1.0 - share) * spacing * turn  # from the chord to the arc
    angle = heading - direction
    return point - 1 + share, aside, angle - 2.0 * math.pi * round(angle / (2.0 * math.pi))


@kernel
def curvature_at(points: FloatArray, position: float) -> float:
    """Return the curvature [1/m] of a line at a position between its points; at the last one, if it is beyond."""
    at = int(position)
    if at + 1 >= len(points):
        return float(points[len(points) - 1, CURVATURE])
    share = position - at
    return float((1.0 - share) * points[at, CURVATURE] + share * points[at + 1, CURVATURE])


@kernel
def speed_on(points: FloatArray, position: float, spacing: float, limiter: Record, now: float) -> float:
    """Return the greatest speed [m/s] from which the tires hold the car through all that comes.

    Args:
      points: of a line (n, 6).
      position: of the car, in points.
      spacing: of the points [m].
      limiter: of type LIMITER.
      now: present speed [m/s].
    """
    grip, braking = limiter.mu * limiter.car.gravity, uses_on(limiter)[1] * limiter.braking
    squares = np.empty(len(points))
    square, demand = math.inf, 0.0
    for k in range(len(points) - 1, -1, -1):
        corner = limiter.lateral * points[k, RADIUS]
        if square < corner:
            used = square * demand / grip
            share = longitudinal_share(limiter, used, True)
            if limiter.slip.needs_slip_angle:
                share = stable_share(limiter, share, used, math.sqrt(square))
            square += 2.0 * braking * share * spacing
        squares[k] = square = min(square, corner)
        demand = points[k, DEMAND]
    best = math.inf
    for each in (position, position + _LOOKAHEAD * max(now, 0.0) / spacing):
        at = min(int(each), len(points) - 2)
        share = min(each - at, 1.0)
        best = min(best, (1.0 - share) * squares[at] + share * squares[at + 1])
    return math.sqrt(best)


@kernel
def reference_on(
    points: FloatArray, position: float, aside: float, turned: float, spacing: float, limiter: Record, now: float,
    follows: bool,
) -> tuple[float, float, float]:
    """Return steering angle [rad] and speed [m/s] for a car on a line, and the greatest steering angle there [rad].

    Args:
      points: of a line (n, 6).
      position: of the car, in points.
      aside: how far to the left of the line it is [m].
      turned: its angle to the line [rad].
      spacing: of the points [m].
      limiter: of type LIMITER.
      now: present speed [m/s].
      follows: whether it follows the line; else it comes to the line by another steering angle.
    """
    car, speed = limiter.car, speed_on(points, position, spacing, limiter, now)
    length = _LENGTH + _LENGTH_TIME * max(now, 0.0)
    ahead = curvature_at(points, position + (LAG + late_by(car)) * max(now, 0.0) / spacing)
    steering = math.atan(car.wheelbase * (ahead - aside / (length * length) - 2.0 * math.sin(turned) / length))
    wanted = abs(math.tan(steering)) / car.wheelbase
    if follows and abs(aside) > OFF:
        speed = min(speed, math.sqrt(CORRECTION_USE * limiter.lateral / max(wanted, 1e-3)))
    speed *= 1.0 - _SLOWER_OFF * min(max(abs(aside) - _ON_IT, 0.0), LEAVES)
    most = max(abs(curvature_at(points, position)), CORRECTION_USE * (limiter.lateral / max(now * now, 0.5)))
    most = math.atan(car.wheelbase * most)
    return saturate(steering, most), speed, most
