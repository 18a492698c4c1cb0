"""Reads a car's motion off its state and writes its actuators: by native/vehicle/motion.cpp."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..messages import FloatArray
from ..native import core, record

CAR = record(
    "Car",
    [
        ("free_qpos", np.int64),  # where in qpos the free joint of base_link is
        ("free_dof", np.int64),  # and in qvel
        ("steering_qpos", np.int64),
        ("wheel_dofs", np.int64, (4,)),
        ("driven", np.int64, (2,)),  # which wheels are driven: the first, and the one behind the last
        ("accelerometer", np.int64),  # where in sensordata
        ("steering_ctrl", np.int64),
        ("speed_ctrl", np.int64),
        ("wheel_radius", np.float64),  # [m]; from here on as in CarParameters
        ("max_steering_angle", np.float64),
        ("min_speed", np.float64),
        ("max_speed", np.float64),
        ("rear_axle_distance", np.float64),
    ],
)
"""The indices of a car in its model, and its limits. Functions take an array (1,) of it."""

CarArray = NDArray[np.void]

ROLLED_OVER = math.radians(80.0)
"""[rad] Tilt of base_link from which a car has rolled over. One that lies on its side is at 90 degrees, a little less
if it leans on its wheels; from 74 on the default car tips over the edge of its chassis and does not come back."""

SIDESLIP_SPEED = 0.1
"""[m/s] Below this speed of the centre of gravity there is no sideslip angle: a car that stands sways on its springs by
some mm/s, in any direction."""


planar_pose, uprightness, is_rolled_over = core.planar_pose, core.uprightness, core.is_rolled_over
ground_speed, surface_speed, body_velocity = core.speed_ahead, core.surface_speed, core.body_velocity
point_motion, sideslip_angle = core.point_motion, core.sideslip_angle
read_odometry, drive = core.read_odometry, core.drive_car


def drift_odometry(rows: NDArray[np.void], factors: FloatArray) -> None:
    """Multiply the speeds and the yaw rate of rows (n,) of ODOMETRY by factors (n,), in place."""
    rows["speed"] *= factors
    rows["wheel_speeds"] *= factors[:, np.newaxis]
    rows["angular_velocity"][:, 2] *= factors
