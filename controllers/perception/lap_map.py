"""Lap map: the places of the first lap and what the LiDAR saw from them, and where the car is among them later.

    see_lap(lap, geometry, ranges, odometry, lidar_offset)  # in every tick

1. Recording. By dead reckoning, a place is added every .5 m of way, with the readings of 64 beams. Places
   that the car reverses over are dropped.
2. Closing. When the car comes by one of the first places in the same direction, the scan is matched with the readings
   there. Where it fits, the lap is closed: the error of the dead reckoning is spread evenly over the places of the lap.
3. Localisation. From then on dead reckoning is corrected in every tick by matching the scan with the readings at the
   nearest place. Where the scan fits no longer, everything is forgotten, and recording begins anew.

`walls_of` returns where all recorded beams ended, and on which side of the lap's path.

A scan is matched by one step of Gauss and Newton: each recorded point of a straight piece of wall is looked up in the
scan by its bearing, and the distance between the two, square to the wall, is to vanish. Distances beyond a gate do not
count: there something hides the wall, or has moved. Dead reckoning is the prior.

A reading is kept in a byte, as the square root of its share of 8 m: within 8 mm at .5 m, and 22 mm at 4 m.

Source: F. Lu and E. Milios, Robot Pose Estimation in Unknown Environments by Matching 2D Range Scans, Journal of
Intelligent and Robotic Systems 18, 1997, and Globally Consistent Range Scan Alignment for Environment Mapping,
Autonomous Robots 4, 1997, in which a closed loop corrects all poses.

Limits: a lap has at most 512 m. Dead reckoning may be off by 1 m, 2 % of the way, and .15 rad when the lap closes. Two
places that look the same, lie as near to each other as that, and are driven through in the same direction count as one.

The work is done in native/controllers/perception/lap_map.cpp.
"""

from __future__ import annotations

import numpy as np

from fg_mujoco.native import core, record

BEAMS = 64  # of a scan that are kept of each place, evenly spread
_PLACES = 1024  # at most

LAP_MAP = record(
    "LapMap",
    [
        ("closed", np.bool_),
        ("drifts", np.bool_),  # dead reckoning was off by more than a lap may be: none closes any more
        ("x", np.float64),  # [m] of the rear axle, from where recording began
        ("y", np.float64),  # [m]
        ("heading", np.float64),  # [rad]
        ("driven", np.float64),  # [m] since recording began
        ("count", np.int64),  # of places
        ("nearest", np.int64),  # place
        ("fits", np.float64),  # share of the beams that fit, the mean of the last ticks
        ("places", np.float32, (_PLACES, 3)),  # x, y [m] and heading [rad]
        ("ranges", np.uint8, (_PLACES, BEAMS)),  # square root of the share of 8 m, of 255
    ],
)
"""Type of what is kept from tick to tick; zero at the beginning."""

see_lap, walls_of = core.see_lap, core.walls_of
