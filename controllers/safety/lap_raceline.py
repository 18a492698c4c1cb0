"""Lap raceline: a line of short lap time through the ground of the first lap.

    keep_lap(remembered, geometry, ranges, odometry, driver)           # in every tick
    proposal = propose_line(remembered, odometry, limiter, 0.0)        # whose `state` is AWAY, NEAR or ON

1. Shaping. The line begins as the path of the first lap. In each tick the room to both sides of its points is read off
   the recorded ends of beams, and the points are moved once within that room (line_optimizer).
2. Trial. On tires that need slip angles, the line is followed only if the car's own simulated lap holds.
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

Lap map: the places of the first lap and what the LiDAR saw from them, and where the car is among them later.

    see_lap(lap, geometry, ranges, odometry, lidar_offset)  # in every tick

1. Recording. By dead reckoning, a place is added every .5 m of way, with the readings of 64 beams. Places
   that the car reverses over are dropped.
2. Closing. When the car comes by one of the first places in the same direction, the scan is matched with the readings
   there. Where it fits, the lap is closed: the error of the dead reckoning is spread evenly over the places of the lap.
3. Localisation. From then on dead reckoning is corrected in every tick by matching the scan with the readings at the
   nearest place. Where the scan fits no longer, everything is forgotten, and recording begins anew.

`walls_of` returns where all recorded beams ended, and on which side of the lap's path.

A scan is matched by one step of Gauss and Newton: each recorded point of a straight piece of wall is looked up in the
scan by its bearing, and the distance between the two, square to the wall, is to vanish. Distances beyond a gate do not
count: there something hides the wall, or has moved. Dead reckoning is the prior.

A reading is kept in a byte, as the square root of its share of 8 m: within 8 mm at .5 m, and 22 mm at 4 m.

Source: F. Lu and E. Milios, Robot Pose Estimation in Unknown Environments by Matching 2D Range Scans, Journal of
Intelligent and Robotic Systems 18, 1997, and Globally Consistent Range Scan Alignment for Environment Mapping,
Autonomous Robots 4, 1997, in which a closed loop corrects all poses.

Limits: a lap has at most 512 m. Dead reckoning may be off by 1 m, 2 % of the way, and .15 rad when the lap closes. Two
places that look the same, lie as near to each other as that, and are driven through in the same direction count as one.

Lap trial: on tires that need slip angles, the planner simulates its own lap on a line before it follows the line.

A car on soft tires answers late: on less than 20 /rad of cornering stiffness it can swing off a line that its friction
allows. So two laps are simulated, 40 ticks in each tick: the steering and the friction limiter as they drive on the
line, the servos, and a single-track model. Its axles have the tires that the planner is told of, with their relaxation
length; what drives or brakes an axle leaves it less lateral force. The line holds where the outline of the car stays
clear of all that the first lap saw.

Source: the single-track model with relaxation of H. Pacejka, Tire and Vehicle Dynamics, 2012, chapters 1 and 7.

Limits: the two wheels of an axle have one load, the axles share drive and brakes alike, as without a shaft, and the
LiDAR is not late. Of 60 lines that cars without a shaft followed whatever the trial said, on nine sets of tires, it
refused all 19 that ended in a crash or a turn, and 13 of the 41 others, with 2 cm to what was seen.

The work is done in native/controllers/safety/lap_raceline.cpp and lap_trial.cpp, and in perception/lap_map.cpp there.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fg_mujoco.messages import FloatArray
from fg_mujoco.native import core, record

from ..control.planner_settings import Record
from ..control.stages import NativeStep, Stage
from .friction_limiter import LIMITER_MEMORY

if TYPE_CHECKING:
    from ..control.planner import Planner

BEAMS = 64  # of a scan that are kept of each place, evenly spread
_PLACES = 1024  # at most

LAP_MAP = record(
    "LapMap",
    [
        ("closed", np.bool_),
        ("drifts", np.bool_),  # dead reckoning was off by more than a lap may be: none closes any more
        ("x", np.float64),  # [m] of the rear axle, from where recording began
        ("y", np.float64),  # [m]
        ("heading", np.float64),  # [rad]
        ("driven", np.float64),  # [m] since recording began
        ("count", np.int64),  # of places
        ("nearest", np.int64),  # place
        ("fits", np.float64),  # share of the beams that fit, the mean of the last ticks
        ("places", np.float32, (_PLACES, 3)),  # x, y [m] and heading [rad]
        ("ranges", np.uint8, (_PLACES, BEAMS)),  # square root of the share of 8 m, of 255
    ],
)
"""Type of what is kept from tick to tick; zero at the beginning."""

see_lap, walls_of = core.see_lap, core.walls_of


_DELAYED = 8  # commands that are kept

TRIAL = record(
    "Trial",
    [
        ("state", np.int64),  # 0: it goes on; 1: the line holds; 2: it does not
        ("begun", np.bool_),
        ("way", np.float64),  # [m] driven
        ("x", np.float64),  # [m] of the rear axle
        ("y", np.float64),  # [m]
        ("heading", np.float64),  # [rad]
        ("speed", np.float64),  # [m/s] forward
        ("sideways", np.float64),  # [m/s] of the centre of gravity, to the left
        ("yaw_rate", np.float64),  # [rad/s]
        ("steering", np.float64),  # [rad]
        ("slip", np.float64, (2,)),  # [rad] of the front and the rear tires, behind the slip angles
        ("next", np.int64),  # point of the line
        ("place", np.int64),  # of the lap, the nearest
        ("commands", np.float64, (_DELAYED, 2)),  # the last ones, the newest first
        ("memory", LIMITER_MEMORY),
    ],
)
"""Type of a trial; zero at the beginning."""

move_car = core.move_car
"""Move the car of a trial by a step of the model, which begins some time [s] after the last command."""


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
    points: FloatArray  # (n, 5) of the line ahead, in the frame of the car, see motions
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
"""Move the points of a line, of type LINE, once, within `walls_of` a closed lap, of type LAP_MAP."""


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
