"""The plan in time: among things that move, motions of the car are judged by where everything is when.

A stop is no safe end where something will come by, and a way that is blocked now may be free when the car is there. So
near a target motions of some 3 s are tried, and the best one is driven for one tick:

1. Paths: towards the reference's goal, as the wheels stand, towards the place of the last plan, and through places
   across the way at the distance of the nearest target, of which every third is tried in each tick. The wheels turn on
   them as fast as the friction limiter lets them; walls end them.
2. Profiles: on each path the car goes on, creeps or waits for some time, and then brakes to a stop.
3. At each time a target is within an interval of its line, which ends where it is expected to turn: at a wall, or where
   it was seen to turn back twice. A motion is free if it touches none of them, and ends where none comes by: a stop in
   the lane of something that crosses is no end. Motions that only use up the margins come next, then those that touch
   something latest and slowest. What is not known to turn elsewhere may turn back now: motions are worth less that
   would then touch it, the less so the longer the car has waited.
4. A car that has waited for 3 s and more takes less of the margins of what is known to turn.
5. Of free motions the one wins that comes farthest in 2 s, with room beside targets and without turning the wheels to
   and fro. As it is chosen from few, the car has to be able to stop before what stands after the next tick, by the
   simulated stops of the safety filter. If no motion passes, the car brakes as that filter does.
6. Where no motion is free, and the car stands and is out of the way behind itself, it backs off, by 1 m at most; so it
   does where it stands before a wall, and nothing comes by behind.

Near a target the car goes at most 3 m/s, and faster farther away: what turns is known some .2 s later. What drives
ahead as fast as a car does is one, and may not turn back.

Sources: D. Fox, W. Burgard and S. Thrun, The Dynamic Window Approach to Collision Avoidance, IEEE Robotics & Automation
Magazine 4(1), 1997, for sampled motions; K. Kant and S. Zucker, Toward Efficient Trajectory Planning: The Path-Velocity
Decomposition, International Journal of Robotics Research 5(3), 1986, for paths first and profiles then; S. Petti and
T. Fraichard, Safe Motion Planning in Dynamic Environments, IEEE/RSJ IROS 2005, for ends that stay free.

The work is done in native/controllers/safety/plan_in_time.cpp.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fg_mujoco.messages import FloatArray
from fg_mujoco.native import core, record

from .judge import Situation

NO_PLAN, DRIVES, BACKS_OFF = range(3)
"""What a plan says: no motion passed, a steering angle and a speed, or that the car backs off."""

PLAN_IN_TIME = record(
    "PlanInTime",
    [
        ("tick", np.int64),
        ("kept", np.int64),  # tick of the last plan, through this place in the frame of the targets:
        ("x", np.float64),  # [m]
        ("y", np.float64),  # [m]
        ("waited", np.float64),  # [s] for which the car has been slow
        ("backed", np.float64),  # [m] that it has backed off since it last drove
    ],
)
"""Type of what is kept from tick to tick; zero at the beginning."""


class Among(NamedTuple):
    """What the motions of a tick have in common."""

    here: Situation
    goal: tuple[float, float]  # ahead of the LiDAR and to its left [m]
    onwards: float  # [m/s] at which the car would go on
    room: float  # [m] of way to where the car may only pass
    servo: float  # share of the limiter's rate of turning with which the wheels turn
    spans: FloatArray  # of targets (m, 3 k) [m]
    reaches: FloatArray  # of targets (k,) [m]: how near a disc of the car may come
    may_turn: float  # worth [m] that a motion touches nothing that turns back at once


plan_in_time = core.plan_in_time
