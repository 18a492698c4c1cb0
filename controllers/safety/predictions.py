"""Predicted paths of moving targets: where they may be when the car is there, and in the car's simulated stops.

A target is a disc that goes on along the line of its velocity. At a time t it is somewhere between two places on this
line: as far as it comes if it holds its speed, and where it is if it begins to brake now. Both grow apart by the
uncertainty of its speed. Where the line meets what stands, or where the target was seen to turn back, it stays there or
turns back at the same speed. One that was seen to turn at both ends goes to and fro between them.

The beams that end on targets are lengthened to what is next to them (`foresee`, `separate`): the planner, guidance, the
speed laws and the stops of the safety filter have a scan of what stands. These stops are compared with each target at
the time when the car is there, and near a target the car drives by a plan in time (plan_in_time). Without a target that
moves the scan is that of the LiDAR, to the last bit.

Source: for the two ends of the interval, S. Shalev-Shwartz, S. Shammah and A. Shashua, On a Formal Model of Safe and
Scalable Self-driving Cars, arXiv 1708.06374; for stops among moving things, D. Fox, W. Burgard and S. Thrun, as in
safety_filter.

Limits: targets do not turn, except back. One that speeds up comes sooner than predicted.

The work is done in native/controllers/safety/predictions.cpp.
"""

from __future__ import annotations

import numpy as np

from fg_mujoco.messages import ODOMETRY
from fg_mujoco.native import core, record

from ..perception.targets import MOST_TARGETS, TARGETS

MOST_CARS = 6
"""Cars that a planner follows by rules of its own."""

MOST_ROWS = MOST_TARGETS + 3 * MOST_CARS
"""Predictions: targets, and for each car that a planner follows by rules of its own three discs."""

MOST_LATE = 16
"""Ticks from which on scans are too late to be compared with."""

# columns of a prediction
X, Y, COS, SIN, SPEED, RADIUS, TO_WALL, BRAKING, SPREAD, CURVATURE, FROM_WALL, TURNS = range(12)

PREDICTIONS = record(
    "Predictions",
    [
        ("targets", TARGETS),
        ("odometry", ODOMETRY),  # of the time of the scan
        ("speeds", np.float64, (MOST_LATE,)),  # [m/s] of the last ticks
        ("yaw_rates", np.float64, (MOST_LATE,)),  # [rad/s]
        ("tick", np.int64),
        ("count", np.int64),
        ("cars", np.int64),  # how many of them, at the end, are of cars that a planner follows by its own rules
        # middle, ahead and left of the LiDAR [m], cosine and sine of its course, speed [m/s], radius [m], way to what
        # stands [m], braking [m/s^2], uncertainty of the speed [m/s], curvature of its path [1/m], way back to what
        # stands [m], and at how many ends of its way it was seen to turn
        ("rows", np.float64, (MOST_ROWS, 12)),
    ],
)
"""Type of what is kept from tick to tick; zero at the beginning."""

interval, occupied, meets, turned = core.interval, core.occupied, core.meets, core.turned
write_predictions, separate = core.write_predictions, core.separate
