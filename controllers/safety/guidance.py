"""Guidance: leads a planner that would drive into a pocket, or back, to the frontier.

A gap planner goes where the scan shows most room. In a hairpin that is the pocket at its end, and then the way back.
Guidance knows the frontier (perception.frontiers), and lets the planner drive as long as it is in reach:

1. Where the planner's goal leads on about as well as any beam, and nothing hides the frontier nearby, the planner
   drives.
2. Else its reference is simulated for `viable_time`. While a motion of the car leads on from there (motions),
   the planner still drives. What 1 and 2 found holds for one more tick, unless its reference turns meanwhile, or the
   frontier is hidden and nearby.
3. Else the car follows a motion from where it is now, which is searched for anew in every second
   tick, and kept while it is free and none is found. Its speed is that of its curvature, with braking before it. In
   a sharp bend a careful car (4) stays on its motions until the bend is over.
4. Where there is no motion, the car brakes. Where it has been slow for .35 s, it turns in several moves, forward
   and in reverse. From then on it is careful: it comes to the edge of what it sees no faster than that it
   could turn there at full lock.

Where there is no frontier, as in a dead end, it is no faster than it can stop ahead of what it sees. Where it has
stood there for 4 s it forgets its path, which on a course as short as its memory may have been wrong.

Limits: as of frontiers and motions. Without a friction limit nothing says how sharply the car can turn, and
guidance is off. The work is done in native/controllers/safety/guidance.cpp.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fg_mujoco.messages import FloatArray
from fg_mujoco.native import core, record

from ..control.planner_settings import FROM_ZERO, POSITIVE, SHARE, Record, Settings, setting, setting_of_car
from ..perception.frontiers import FRONTIER_SEARCH
from .motions import MOTION, TURNING, X, Y


@dataclass(frozen=True, kw_only=True)
class GuidanceSettings(Settings):
    """When the planner drives, and how fast a motion is driven.

    Raises:
      SettingsError: a share that is not above 0 and at most 1; another value that is negative or not finite.
    """

    every: int = setting(4, "", "ticks between two searches for the frontier, at least", POSITIVE)
    every_plain: int = setting(16, "", "the same, at most", POSITIVE)
    as_good: float = setting(0.6, "", "of the best beam's gain of way: the planner's goal leads on", SHARE)
    worth_simulating: float = setting(0.3, "", "of the best beam's gain: its reference is simulated", SHARE)
    tight_distance: float = setting_of_car(4.5, "m", "way to go to a hidden frontier that counts as nearby", POSITIVE)
    viable_time: float = setting(0.4, "s", "for which the planner's reference is simulated", POSITIVE)
    lock: float = setting(0.87, "", "of the curvature at full lock, for motions; the rest keeps the car on them", SHARE)
    grip: float = setting(0.85, "", "of the cornering acceleration, for motions", SHARE)
    profile_grip: float = setting(0.76, "", "of the cornering acceleration, for the speed on a motion", SHARE)
    profile_braking: float = setting(0.4, "", "of the greatest braking, ahead of a motion's curve", SHARE)
    stop_braking: float = setting(0.52, "", "of the greatest braking, ahead of a motion's end", SHARE)
    hidden_braking: float = setting(0.7, "", "of the greatest braking, ahead of a hidden frontier", SHARE)
    horizon: float = setting_of_car(3.0, "m", "of a motion, and .1 s^2/m v^2 more", POSITIVE)
    narrow_speed: float = setting_of_car(1.0, "m/s", "in gaps that are hardly wider than the car", POSITIVE)
    trusted_speed: float = setting_of_car(3.5, "m/s", "below it a simulated motion gives the speed", POSITIVE)
    lost_after: int = setting(
        12, "", "ticks without a frontier, after which the car stops ahead of what it sees", POSITIVE
    )
    start_again_after: int = setting(30, "", "ticks, after which a car that stands forgets its path", POSITIVE)
    stop_margin: float = setting_of_car(0.3, "m", "ahead of the bumper, where there is no frontier", FROM_ZERO)


GUIDANCE = record(
    "Guidance",
    [
        ("frontier", FRONTIER_SEARCH),
        ("motion", MOTION),  # that the car follows
        ("trial", MOTION),  # that was last searched for
        ("stop", MOTION),  # along which the safety filter last found a stop; without points: none yet
        ("stop_progress", np.int64),  # index of its point that is next
        ("follows", np.bool_),  # there is a motion to follow
        ("progress", np.int64),  # index of the motion's point that is next
        ("narrow", np.bool_),  # the motion leads through a gap that is hardly wider than the car
        ("led_on", np.int64),  # tick in which the planner was last found to lead on, by this reference:
        ("steering_angle", np.float64),  # [rad]
        ("bearing", np.float64),  # [rad]
        ("speed", np.float64),  # [m/s] that a simulated motion gave; inf: none did
        ("lost", np.int64),  # ticks without a frontier
        ("careful", np.bool_),  # the car has had to turn in several moves: there are bends tighter than they look
        ("turning", TURNING),
    ],
)
"""Type of what guidance keeps of its car from tick to tick; zero at the beginning."""


speed_to_stop = core.speed_to_stop
"""Return the speed [m/s] from which the car stops ahead of what is in front of it."""


def motion_ahead(memory: Record) -> FloatArray:
    """Return the rest of a motion, or of a turn in moves, in the frame of the rear axle.

    Args:
      memory: of type GUIDANCE.

    Returns:
      (m, 2) [m]; no points where the planner drives.
    """
    turning, world = memory["turning"], memory["frontier"]["map"]
    motion, first = memory["motion"], int(memory["progress"])
    if turning["active"]:
        motion, first = turning["motion"], int(turning["next_point"])
    elif not memory["follows"]:
        return np.empty((0, 2))
    points = motion["points"][first : int(motion["count"]), [X, Y]] - (world["x"], world["y"])
    cos, sin = math.cos(world["heading"]), math.sin(world["heading"])
    ahead: FloatArray = points @ np.array([[cos, -sin], [sin, cos]])
    return ahead
