"""Motion search: arcs that lead a car of its turning circle and speed through the local map to the frontier.

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

The work is done in native/controllers/safety/motion_search.cpp.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fg_mujoco.native import core, record

DIRECTION = 4  # column of a motion, after those of control.tracking
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


"""Ends of beams, see `sorted_ends`."""


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
