"""One simulation of the car along a proposal: the friction limiter, the servos and the slip of soft tires in the loop.

    here = Situation(...)
    met = simulate(here, plan, use, speed)  # of a Plan, with a share of the grip for cornering

A plan commands its speed for a tick, and then brakes to a stop; along a path that says how fast the car drives, it goes
on to its end. It steers along a path, or to a goal. The car meets something where one of its discs comes near what
stands (the widened scan, and ground of the local map that a corner hides) or near where something that moves may be at
that time: `occupied`, which all proposals share. Of ground that the car knows, only ends of beams count: the widened
scan has a wall beside the way in it.

These stops are as hard as the tires hold. Limits: braking does not turn the simulated car in. What the scan does not
show counts as free.

Sources: D. Fox, W. Burgard and S. Thrun, The Dynamic Window Approach to Collision Avoidance, IEEE Robotics & Automation
Magazine 4(1), 1997, for simulated stops; S. Petti and T. Fraichard, Safe Motion Planning in Dynamic Environments,
IEEE/RSJ IROS 2005, for ends that stay free.

The work is done in native/controllers/safety/rollout.cpp.
"""

from __future__ import annotations

from typing import NamedTuple

from fg_mujoco.messages import FloatArray
from fg_mujoco.native import core

from ..control.planner_settings import Record


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
    path: FloatArray  # (m, 4) motion, as in control.tracking, or (m, 5) with the speeds at which the car goes on
    speed: float  # [m/s] that is commanded for a tick, before the car brakes
    margin: float  # [m] ahead of the bumper


def simulate(here: Situation, plan: Plan, use: float, speed: float) -> Met:
    """Return what a car of a speed [m/s] meets on its way to a stop, with a share of the grip for cornering."""
    return Met(*core.simulate(here, plan, use, speed))


reading = core.reading
"""Return the widened reading [m] of a Situation at a bearing [rad]."""
