"""The fastest closed line within a band: of least curvature, or of least lap time.

    step, weight = 0, 0.0
    while step < STEPS:
        line, most = begin_step(line, step, spacing)                       # points evenly apart
        normals = normals_of(line)
        low, high = ...                                                    # room to move along them [m], within `most`
        step, weight = improve(line, normals, (low, high), step, weight, grip)    # one move of all points

Who calls this knows the room beside the line: of the map's walls, or of the walls that the LiDAR saw in the first lap.

1. Least curvature is a quadratic program on the ring of points (control.band_program), as second differences of the
   places are linear in the moves. As steps count as unchanged, this rewards a shorter line, too. The first steps have
   few points, so that the whole line moves.
2. Least time: the lap is that of the fastest speeds that the grip allows, by one pass along the line and one against
   it. Going through both passes backwards gives the derivative of the lap time by all curvatures and steps. A move is
   least for it and a multiple of the squared change of curvature. The move, or a half or a quarter of it, is made where
   the lap gets shorter. The multiple grows where none is made, and where only a part is; else it falls.
3. Where the wheels turn in or out, tires hold less: this counts as a greater curvature.

Sources: A. Heilmeier et al., Minimum curvature trajectory planning and control for an autonomous race car, Vehicle
System Dynamics 58(10), 2020; D. Brayshaw and M. Harrison, A quasi steady state approach to race car lap simulation,
Proc. IMechE D 219, 2005, for the lap time; the sequence of quadratic programs is that of Levenberg and Marquardt.

Limits: the line found is the best near the one that it began with.

The work is done in native/controllers/safety/line_optimizer.cpp.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fg_mujoco.messages import FloatArray
from fg_mujoco.native import core

from ..control.planner_settings import Record

FLATTENED = 7
"""Steps of least curvature, which are the first ones."""

STEPS = FLATTENED + 4 * 8
"""Steps until a line is finished: after 8 of least time the points are spread evenly again."""


class Grip(NamedTuple):
    """What tires, motor and steering give: greatest acceleration and braking by lateral acceleration, and top speed."""

    lateral: float  # [m/s^2] greatest
    accelerating: FloatArray  # (k,) [m/s^2] at k lateral accelerations, evenly from 0 to `lateral`
    braking: FloatArray  # (k,) [m/s^2] positive
    power: float  # [m^2/s^3] of the motor over the mass, that accelerates
    max_speed: float  # [m/s]
    lock: float  # [1/m] greatest curvature without a price
    use: float  # share of the cornering acceleration that `lateral` is
    turning: float  # [m] times the change of curvature is what turning in takes of the grip; 0: nothing,
    turning_out: float  # and the same for turning out


def limited_grip(limiter: Record, max_speed: float, uses: tuple[float, float, float], turning_use: float) -> Grip:
    """Return shares of what a friction limiter, of type LIMITER, allows up to a speed [m/s].

    `uses` are those of cornering, braking and accelerating. `turning_use` is that of what cornering leaves for turning
    the wheels; inf: they turn at once.
    """
    return Grip(*core.limited_grip(limiter, max_speed, uses, turning_use))


def normals_of(line: FloatArray) -> FloatArray:
    """Return the directions to the left of the points of a closed line (n, 2). Shape (n, 2)."""
    return core.normals_of(np.ascontiguousarray(line))


measure = core.measure
"""Write the curvatures [1/m] of a closed line (n, 2), and the steps to each point and from it [m]; all (n,)."""


def begin_step(line: FloatArray, step: int, spacing: float) -> tuple[FloatArray, float]:
    """Return the points for a step, evenly apart where a round begins, and how far each may move then [m].

    `spacing` [m] is that of the finished line.
    """
    return core.begin_step(np.ascontiguousarray(line), step, spacing)


improve = core.improve
"""Move all points of a closed line once, and return the next step and its weight; NaN: there is no such line.

Args:
  line: (n, 2) [m], about evenly apart, n at least 6; written to.
  normals: to the left of each (n, 2).
  room: how far each may move along its normal, from and to, two arrays (n,) [m]; written to, where there is none.
  step: of STEPS.
  weight: multiple of the squared change of curvature, in a step of least time.
  grip: of the car.
"""


def spread(line: FloatArray, count: int) -> FloatArray:
    """Return so many points at even steps on the closed curve through points (n, 2); the first stays. (count, 2).

    The points have to be about evenly apart. The curve is a cubic between two, with the slopes of the parabolas through
    five points.
    """
    return core.spread(np.ascontiguousarray(line), count)


fastest_lap = core.fastest_lap
"""Return the time of a lap [s] and the price of curvature beyond the lock, and write speeds and derivatives.

Args:
  bends: curvatures (n,) [1/m].
  steps: from each point to the next (n,) [m].
  grip: of the car.
  speeds: (n,) [m/s], written to.
  by_bend: derivative by each curvature (n,) [s m], written to.
  by_step: derivative by each step (n,) [s/m], written to.
"""
