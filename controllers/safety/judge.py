"""The judge: of all that is proposed for the next tick, the first proposal after which the car can stop is driven.

Each proposal is simulated with several shares of the grip for cornering, in the order of WHY. The first that
meets nothing wins. Where each meets something, the one that does so slowest wins, and the first of those that are as
slow. So a planner's reference is driven as long as the car could stop afterwards, and all below it is there for when it
could not:

of a stage    a motion of a stage of the user's (decision.propose)
line          the remembered line (lap_raceline)
reference     what the planner or guidance wants, at its speed: along an arc, or along a motion
stop          the same, braking: the stop of the last tick, which needs half of the margins
aside         in another direction, no faster than the crawl speed; those with the longest view first
beside        the same next to the reference's, at the speed of the reference
motion        braking along the motion of guidance: a car that leaves it before a hairpin does not get round
last stop     braking along the motion on which the car could last stop
as it stands  braking with the wheels as they are: to steer to and fro between directions as bad takes from braking

The nearest direction to the reference often ends in the corner between a box and a wall; the one with the longest view
does not. Stops in other directions have a margin besides, so that they are not lost at once.

A simulation has the friction limiter, the servos and the slip of soft tires in the loop. A plan commands its speed for
a tick, and then brakes to a stop; along a path that says how fast the car drives, it goes on to its end. It steers
along a path, or to a goal. The car meets something where one of its discs comes near what stands (the widened scan, and
ground of the local map that a corner hides) or near where something that moves may be at that time: `occupied`, which
all proposals share. Of ground that the car knows, only ends of beams count: the widened scan has a wall beside the way
in it.

    here = Situation(...)
    met = simulate(here, plan, use, speed)  # of a Plan, with a share of the grip for cornering

These stops are as hard as the tires hold. Limits: braking does not turn the simulated car in. What the scan does not
show counts as free.

Sources: D. Fox, W. Burgard and S. Thrun, The Dynamic Window Approach to Collision Avoidance, IEEE Robotics & Automation
Magazine 4(1), 1997, for simulated stops, directions and shares of grip; S. Petti and T. Fraichard, Safe Motion Planning
in Dynamic Environments, IEEE/RSJ IROS 2005, for the stop of the last tick and ends that stay free.

The work is done in native/controllers/safety/judge.cpp and rollout.cpp.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fg_mujoco.messages import FloatArray
from fg_mujoco.native import core, record

from ..control.planner_settings import FROM_ZERO, POSITIVE, SHARE, Record, Settings, setting, setting_of_car
from ..control.reasons import PROPOSALS

BEST = record(
    "Best",
    [
        ("why", np.int64),
        ("steering_angle", np.float64),  # [rad] of the command
        ("speed", np.float64),  # [m/s]
        ("use", np.float64),  # share of the grip for cornering
        ("contact", np.float64),  # [m/s] at which the car meets something; 0: nothing; inf: none was simulated
    ],
)
"""Type of the best proposal."""

JUDGE = record(
    "Judge",
    [
        ("passed", np.bool_),  # whether the reference passed in the last tick
        ("best", BEST),  # of this tick
        ("second", BEST),  # that it is compared with
        ("line", BEST),  # on the remembered line, or beside it
        ("own", np.int64),  # how many motions stages of the user's proposed in this tick
        ("proposals", *PROPOSALS),  # of the last decision; written, and never read
    ],
)
"""Type of what the judge keeps from tick to tick; zero at the beginning."""


@dataclass(frozen=True, kw_only=True)
class JudgeSettings(Settings):
    """Clearances of simulated stops, and the directions in which stops are simulated.

    Raises:
      SettingsError: a margin or angle that is negative or not finite; a step, speed or distance that is not a positive
        number.
    """

    margin: float = setting_of_car(0.12, "m", "ahead of the bumper, in the direction of the reference", FROM_ZERO)
    margin_aside: float = setting_of_car(
        0.08, "m", "in other directions, which are then not lost at once when the car brakes a little less", FROM_ZERO
    )
    margin_kept: float = setting(
        0.5, "", "share of these for a reference that passed at the last scan: millimetres do not end a turn", SHARE
    )
    fan: float = setting(math.radians(90.0), "rad", "directions to either side of the reference", FROM_ZERO)
    fan_step: float = setting(math.radians(5.0), "rad", "between them", POSITIVE)
    crawl_speed: float = setting_of_car(
        0.5, "m/s", "slowest speed of a car with a free direction, so that it does not stand for good", POSITIVE
    )
    standing_speed: float = setting_of_car(0.05, "m/s", "a car that is slower counts as standing", POSITIVE)
    pursuit_distance: float = setting_of_car(
        1.0, "m", "a steering angle is read as the arc to a point at this distance from the LiDAR", POSITIVE
    )
    arrived: float = setting_of_car(
        0.2, "m", "nearer to its goal than this, the simulated car keeps its steering angle", FROM_ZERO
    )
    nearest_goal: float = setting_of_car(0.5, "m", "goals are no nearer", POSITIVE)


class Wanted(NamedTuple):
    """What the planner or guidance wants, and what the judge needs besides."""

    steering_angle: float  # [rad]
    speed: float  # [m/s]
    path: FloatArray  # motion (m, 4) in the frame of the rear axle, along which it leads; m may be 0
    guided: bool  # whether that is a motion of guidance
    last_stop: FloatArray  # motion (m, 4) along which the car could last stop; m may be 0
    passed: bool  # whether the reference passed in the last tick


judge = core.judge
"""Write the best of all proposals to a memory of type JUDGE."""


class Situation(NamedTuple):
    """What a proposal is judged by: the car, and all that may be in its way."""

    limiter: Record  # of type LIMITER
    memory: Record  # of type LIMITER_MEMORY, unchanged after a simulation
    settings: Record  # fields of JudgeSettings
    geometry: Record  # of type SCAN_GEOMETRY
    ranges: FloatArray  # readings (n,) [m]
    widened: FloatArray  # the same, each widened by a disc over the car's front
    radius: float  # [m] of that disc
    movers: FloatArray  # (k, 12) predictions of what moves, which is not in the scan
    ground: Record  # of type FRONTIER_SEARCH
    angle: float  # [rad] present steering angle
    speed: float  # [m/s] present
    period: float  # [s] of a tick
    known: bool  # whether what the scan hides counts as free: the car has driven there


FREE, STANDS, MOVES = range(3)
"""What a car meets: nothing, something that stands, or something that moves."""


class Met(NamedTuple):
    """What a simulated car meets on its way to a stop."""

    speed: float  # [m/s] then; 0: it meets nothing
    time: float  # [s] until then, or until it stands
    what: int  # FREE, STANDS or MOVES


class Plan(NamedTuple):
    """How a proposal is followed: the frame is that of the rear axle; `path` has no points where it leads to a goal."""

    bearing: float  # [rad] of the goal from the LiDAR
    distance: float  # [m] of that goal
    path: FloatArray  # (m, 4) motion, as in motions, or (m, 5) with the speeds at which the car goes on
    speed: float  # [m/s] that is commanded for a tick, before the car brakes
    margin: float  # [m] ahead of the bumper


def simulate(here: Situation, plan: Plan, use: float, speed: float) -> Met:
    """Return what a car of a speed [m/s] meets on its way to a stop, with a share of the grip for cornering."""
    return Met(*core.simulate(here, plan, use, speed))


reading = core.reading
"""Return the widened reading [m] of a Situation at a bearing [rad]."""
