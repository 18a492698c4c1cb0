"""Lap raceline: a line of short lap time through the ground of the first lap.

    keep_lap(remembered, geometry, ranges, odometry, driver)           # in every tick
    proposal = propose_line(remembered, odometry, limiter, 0.0)        # whose `state` is AWAY, NEAR or ON

1. Shaping. The line begins as the path of the first lap. In each tick the room to both sides of its points is read off
   the recorded ends of beams, and the points are moved once within that room (line_optimizer).
2. Trial. On tires that need slip angles, the line is followed only if the car's own simulated lap holds (lap_trial).
   Else it is shaped again, farther from the walls, twice at most.
3. Joining. NEAR the line the car is led towards a point of it further on, with all the protections of the planner.
4. Following. ON the line the car steers along it (line_following), if the judge's simulation finds it free: either the
   car could stop on it, or it could drive on, without coming near the end of a beam. What the scan hides counts as
   free, as the first lap has been there. Where a wall is nearer than the first lap saw it, .1 m beside the line is
   tried, then braking on it. The limiter turns the wheels faster there, and braking takes nothing of the cornering.
5. Something new. The car brakes on the line; from 2 m/s on the planner drives, for 5 m. If nothing on the line is free,
   the judge may take any other proposal that is; if none is, the slowest contact on the line.
6. Something that moves. The planner drives until the car has driven two laps without seeing anything that moves: it may
   be behind any corner.

Source of the rounds of the line's shaping: A. Heilmeier et al., Minimum curvature trajectory planning and control for
an autonomous race car, Vehicle System Dynamics 58(10), 2020.

Limits: what stands on the line behind a corner, and was not there in the first lap, is seen late: the car comes faster
than it could stop within what it sees. A line that is sharper somewhere than 1.08 times the curvature at full lock is
not followed at all: the next lap is recorded, and gives another.

The work is done in native/controllers/safety/lap_raceline.cpp.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fg_mujoco.messages import FloatArray
from fg_mujoco.native import core, record

from ..control.planner_settings import Record
from ..control.stages import NativeStep, Stage
from ..perception.lap_map import LAP_MAP
from .lap_trial import TRIAL

if TYPE_CHECKING:
    from ..control.planner import Planner

POINTS = 2048  # of a line, at most

AWAY, NEAR, ON = range(3)
"""Where the car is: the planner drives, the car is led to the line, or it follows the line."""

LINE = record(
    "Line",
    [
        ("step", np.int64),  # of line_optimizer.STEPS
        ("weight", np.float64),  # of that step
        ("failed", np.int64),  # trials that failed
        ("ready", np.bool_),
        ("refused", np.bool_),  # it is too sharp, or there is none
        ("follows", np.bool_),  # the reference is that of the line
        ("next", np.int64),  # index of the point that is next
        ("until", np.float64),  # `driven` until which the planner drives
        ("count", np.int64),  # of points
        ("spacing", np.float64),  # [m]
        ("points", np.float32, (POINTS, 2)),  # [m] evenly apart, once the line is ready
        ("described", np.float32, (POINTS, 4)),  # heading [rad], curvature [1/m], RADIUS and DEMAND of line_following
        ("trial", TRIAL),  # of a lap on it, on soft tires
    ],
)
"""Type of a line, and of what is kept of it from tick to tick; zero at the beginning."""

REMEMBERED = record("Remembered", [("lap", LAP_MAP), ("line", LINE), ("moved", np.bool_), ("still", np.float64)])
"""Type of all that is remembered: of the first lap, whether anything has moved, and the way [m] since."""


class LineProposal(NamedTuple):
    """How to follow the line."""

    state: int  # AWAY: there is no proposal; NEAR or ON
    points: FloatArray  # (n, 5) of the line ahead, in the frame of the car, see control.tracking
    steering_angle: float  # [rad] for now
    speed: float  # [m/s] for now


keep_lap = core.keep_lap
"""Record the lap or find the car in it, and do a tick's part of the work on the line.

Args:
  remembered: of type REMEMBERED, written to.
  geometry: of type SCAN_GEOMETRY.
  ranges: readings (n,) [m], without NaN or inf.
  odometry: of type ODOMETRY.
  driver: of type driving.DRIVER.
"""

shape_line = core.shape_line
"""Move the points of a line, of type LINE, once, within `lap_map.walls_of` a closed lap, of type LAP_MAP."""


def propose_line(remembered: Record, odometry: Record, limiter: Record, shift: float) -> LineProposal:
    """Return how to follow the line from here, or to come to it; AWAY: the car is not near it, or may not follow it.

    Args:
      remembered: of type REMEMBERED, written to.
      odometry: of type ODOMETRY.
      limiter: of type LIMITER.
      shift: how far to the left of the line the car is to be [m].
    """
    return LineProposal(*core.propose_line(remembered, odometry, limiter, shift))


REMEMBER = Stage(
    text="from the second lap on the car follows a line through the ground of the first",
    needs=("guidance", "safety_filter"), needs_friction=True, after_guidance=NativeStep("remember"),
    state_type=REMEMBERED,
)  # fmt: skip
"""The stage `remember`: from the second lap on the car follows a line through the ground of the first."""


def line_of(planner: Planner) -> FloatArray:
    """Return the closed line of a planner that remembers, in the frame in which its first lap began.

    Shape (n, 2) [m]; no points while there is no line.
    """
    line = planner.stage_state("remember")["line"]
    return np.array(line["points"][: line["count"] if line["ready"] else 0], dtype=float)
