"""Motions: arcs that lead a car of its turning circle through the local map to the frontier, and how it follows them.

The shortest way to the frontier (perception.frontiers) is a way for a point. A car at speed can turn only so sharply,
and has to slow down first. So motions are put together from short arcs: each arc is turned at a share of what the tires
hold at the speed there, the steering changes by one share at a time, and the car brakes with what cornering leaves,
down to the speed at which full lock is held. The search goes on from the motion of the least length so far and way to
go (A*; P. Hart, N. Nilsson and B. Raphael, IEEE Transactions on Systems Science and Cybernetics 4(2), 1968), over
places, headings and directions (hybrid A*; D. Dolgov et al., Path Planning for Autonomous Vehicles in Unknown Semi-
structured Environments, IJRR 29(5), 2010). In reverse an arc counts twice, and a change of direction .6 m.

What has to be free: three discs on the car's axis keep a cell, or two, from walls. Where the car stands nearer to a
wall than that, and in gaps that are hardly wider than the car, its outline is compared with the ends of the beams
themselves.

Limits: the simulated car does not slip, and what stands in its way stands still. Ground that nobody has seen counts
as free for the car's corners.

Following: the curvature of the motion is steered ahead of time, by as much as the steering takes, and the distance from
the motion and the angle to it fall over a length that grows with the speed, as a critically damped oscillator does.
Source: the linear feedback of the kinematic car in Frenet coordinates, with feed-forward of the curvature: C. Samson,
Path Following and Time-Varying Feedback Stabilization of a Wheeled Mobile Robot, ICARCV 1992.

Turning in several moves: a slow car in a place that is tighter than its turning circle turns as in a parking lot. Where
the car has been slow for .35 s, or for as long as the tires take to start it, and there is a frontier, a motion is
searched for that may reverse. It is followed move by move: the car stops before it changes its direction, turns its
wheels, and drives on. A motion that is no longer free, or on which the car stands still for a second, is given up.
Where turns begin again and again at one place, as where two of them undo each other, recovery backs the car instead.

The work is done in native/controllers/safety/motion_search.cpp and turning.cpp, and in control/tracking.cpp there.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fg_mujoco.native import core, record

X, Y, HEADING, CURVATURE = range(4)  # columns of a motion: of the rear axle after each arc, and the arc's curvature
SPEED = 4  # [m/s] column of a motion that says how fast the car drives there

LAG = 0.08  # [s] until a new steering angle is reached, of the F1TENTH car
_LENGTH, _LENGTH_TIME = 0.3, 0.1  # [m] and [s]: over which errors fall

next_point = core.next_point
"""Return the index of the first point of a motion from `index` on that lies ahead of the car; the last, if none."""

errors = core.errors
"""Return the position of a car on the arc that ends at a point of a motion.

That is how far ahead the end of the arc is [m], how far to the left of the arc the car is [m], and its angle to the
arc [rad], positive to the left. The car's rear axle is at (x, y) [m], its heading in [rad].
"""

steer_along = core.steer_along
"""Return the steering angle [rad] that keeps a car on a motion.

It takes, in this order:
  points: of the motion (n, 4 or more), see X; in the same frame as the car.
  index: index of the next one, see `next_point`.
  pose: of the rear axle: x [m], y [m], heading [rad].
  speed: of the car [m/s].
  wheelbase: of the car [m].
  late: by how much its wheels turn later than the F1TENTH car's [s], see `late_by`.
  path_late: by how much its path follows its commands later than the F1TENTH car's [s]. Errors fall over a length
    that is greater by the way of this time: a car that answers late would swing about the motion else.
"""


DIRECTION = 4  # column of a motion that may reverse
MOST_NODES = 6400  # of all searches in a tick: they take 2 ms

_POINTS = 64

MOTION = record(
    "Motion",
    [
        ("found", np.bool_),  # it leads to the horizon or to the frontier
        ("count", np.int64),
        ("points", np.float64, (_POINTS, 5)),  # x, y [m], heading [rad], curvature [1/m] up to there, 1 or -1: reverse
    ],
)
"""Type of a motion: where the rear axle is after each arc."""


class Query(NamedTuple):
    """The motion that is searched for."""

    curvature: float  # present [1/m]
    speed: float  # present [m/s]
    lag: float  # [s] for which the car drives on as it does
    grip: float  # share of the cornering acceleration that may be used
    lock: float  # share of the curvature at full lock that may be used
    horizon: float  # [m] by which the motion shortens the way to go
    nearest: int  # NEARNESS of walls from which on it is too near, WALL_IN_2 or WALL_IN_1
    reverses: bool  # the car may drive in reverse, too
    most_nodes: int  # after which the search ends; all searches of a tick have MOST_NODES


search_motion = core.search_motion
"""Write the motion from where the car is that shortens the way to go by the horizon; return whether there is one.

Where there is none, the motion leads to where the way to go is shortest.

It takes, in this order:
  frontier: of type FRONTIER_SEARCH; its `nodes` counts those of all searches of a tick.
  limiter: of type LIMITER.
  motion: of type MOTION, written to.
  query: see Query.
"""

sorted_ends = core.sorted_ends
"""Return the first ends of beams of a map by the squares in which they lie, for `touches`."""

touches = core.touches
"""Return whether an end of a beam lies in the outline of a car at a place, wider by a margin [m]."""


TURNING = record(
    "Turning",
    [
        ("active", np.bool_),
        ("slow", np.float64),  # [s] for which the car has been slow; while turning, for which it has stood
        ("failed", np.int64),  # times that no motion was found
        ("begun", np.int64),  # turns that began near a place of the path,
        ("begun_at", np.float64),  # [m] along it
        ("motion", MOTION),
        ("next_point", np.int64),  # index of the motion's point that is next
        ("in_walls", np.int64),  # points of the outline in cells of walls at the beginning
        ("steering_angle", np.float64),  # [rad] of the command
        ("speed", np.float64),  # [m/s] of the command, negative in reverse
    ],
)
"""Type of what is kept from tick to tick; zero at the beginning."""

turn_in_moves = core.turn_in_moves
