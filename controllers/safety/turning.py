"""Turning in several moves: a slow car in a place that is tighter than its turning circle turns as in a parking lot.

Where the car has been slow for .35 s, or for as long as the tires take to start it, and there is a frontier, a
motion is searched for that may reverse (motion_search). It is followed move by move: the car stops before it changes
its direction, turns its wheels, and drives on. A motion that is no longer free, or on which the car stands still for a
second, is given up. Where turns begin again and again at one place, as where two of them undo each other, recovery
backs the car instead.

The work is done in native/controllers/safety/turning.cpp.
"""

from __future__ import annotations

import numpy as np

from fg_mujoco.native import core, record

from .motion_search import MOTION

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
