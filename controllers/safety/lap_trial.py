"""Lap trial: on tires that need slip angles, the planner simulates its own lap on a line before it follows the line.

A car on soft tires answers late: on less than 20 /rad of cornering stiffness it can swing off a line that its friction
allows. So two laps are simulated, 40 ticks in each tick: the steering and the friction limiter as they drive on the
line, the servos, and a single-track model. Its axles have the tires that the planner is told of, with their relaxation
length; what drives or brakes an axle leaves it less lateral force. The line holds where the outline of the car stays
clear of all that the first lap saw.

Source: the single-track model with relaxation of H. Pacejka, Tire and Vehicle Dynamics, 2012, chapters 1 and 7.

Limits: the two wheels of an axle have one load, the axles share drive and brakes alike, as without a shaft, and the
LiDAR is not late. Of 60 lines that cars without a shaft followed whatever the trial said, on nine sets of tires, it
refused all 19 that ended in a crash or a turn, and 13 of the 41 others, with 2 cm to what was seen.

The work is done in native/controllers/safety/lap_trial.cpp.
"""

from __future__ import annotations

import numpy as np

from fg_mujoco.native import core, record

from .friction_limiter import LIMITER_MEMORY

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
