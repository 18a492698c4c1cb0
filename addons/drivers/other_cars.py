"""Other cars in the scan: which small things there move, where they are, and how fast.

A car that races others carries a box of 12 x 12 cm at the height of the LiDAR: a short run of beams that end nearer
than those to both sides, or to one side where a wheel of the same car is to the other. Noise cuts such runs out of
walls, too, where neighbouring beams end about 12 cm apart. So the noise of the beams is estimated in each scan, and a
run counts only if neither neighbour lies on the straight line through it, within that noise. Runs are followed by dead
reckoning: position and velocity by an alpha-beta filter. One that has moved by 0.2 m at 0.5 m/s or faster,
beyond what noise makes of it, is a car, and stays one when it stops, as long as it is followed. A planner that is told
the odometry of the other cars follows these instead (`follow_told`), also where a car stands.
Source: P. Kalata, The Tracking Index: A Generalized Parameter for alpha-beta and alpha-beta-gamma Target Trackers, IEEE
Transactions on Aerospace and Electronic Systems, 1984, for the filter; its gains at first are those of a least-squares
line through all sightings.
Limits: a car that is partly hidden, or nearer to a wall behind it than 12 cm, may be taken for the wall. One that is
hidden or behind the LiDAR's field of view is taken to go on as it did, for 0.8 s.

The work is done in native/addons/drivers/other_cars.cpp.
"""

from __future__ import annotations

import math

import numpy as np

from fg_mujoco.controllers.safety.predictions import MOST_CARS
from fg_mujoco.messages import MOST_OTHERS, OF_OTHER_CAR, Reading, columns_of_others
from fg_mujoco.native import core, record

CAR_SEEN = record(
    "CarSeen",
    [
        ("age", np.int64),  # sightings; 0: there is none
        ("x", np.float64),  # [m] middle of its box, where the planner's car began
        ("y", np.float64),  # [m]
        ("vx", np.float64),  # [m/s]
        ("vy", np.float64),  # [m/s]
        ("heading", np.float64),  # [rad] in which it last moved
        ("turn_rate", np.float64),  # [rad/s] of its heading
        ("first_x", np.float64),  # [m] where it was first seen
        ("first_y", np.float64),  # [m]
        ("unseen", np.float64),  # [s]
        ("moves", np.bool_),  # it has moved
    ],
)
TOLD = record(
    "Told",
    [
        ("stamp", np.float64),  # [s] of the odometry; 0: none has been told
        ("cars", np.float64, (MOST_OTHERS, len(OF_OTHER_CAR))),  # as OtherCars measures them, NaN: there is none
        ("follows", np.bool_),  # they are followed now
        ("places", np.int64, (MOST_OTHERS,)),  # of each in `cars` of OTHER_CARS, from 1; 0: it has none
        ("unseen", np.float64, (MOST_OTHERS,)),  # [s]
    ],
)
"""Type of what a planner is told of other cars, and where it keeps each; zero at the beginning."""
OTHER_CARS = record(
    "OtherCars",
    [
        ("x", np.float64),  # [m] of the LiDAR, by dead reckoning from where it began
        ("y", np.float64),  # [m]
        ("heading", np.float64),  # [rad]
        ("cars", CAR_SEEN, (MOST_CARS,)),
    ],
)
"""Type of what is kept from tick to tick; zero at the beginning."""

watch_cars, follow_told, find_boxes = core.watch_cars, core.follow_told, core.find_boxes


def read_told(told: np.void, reading: Reading) -> None:
    """Keep what the sensor `opponents` has delivered; `told` of type TOLD is written to. Another one's is left out."""
    count = len(reading.values) // len(OF_OTHER_CAR)
    if 0 < count <= MOST_OTHERS and reading.columns == columns_of_others(count):
        told["stamp"] = reading.stamp
        told["cars"][:] = math.nan
        told["cars"][:count] = reading.values.reshape(count, -1)
