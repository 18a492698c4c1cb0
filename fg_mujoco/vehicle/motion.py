"""Kernels that read a car's motion off its state and write its actuators: for one car and for many."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..compiled.kernels import kernel
from ..messages import FloatArray

CAR = np.dtype(
    [
        ("free_qpos", np.int64),  # where in qpos the free joint of base_link is
        ("free_dof", np.int64),  # and in qvel
        ("steering_qpos", np.int64),
        ("wheel_dofs", np.int64, (4,)),
        ("accelerometer", np.int64),  # where in sensordata
        ("steering_ctrl", np.int64),
        ("speed_ctrl", np.int64),
        ("wheel_radius", np.float64),  # [m]; from here on as in CarParameters
        ("max_steering_angle", np.float64),
        ("min_speed", np.float64),
        ("max_speed", np.float64),
        ("rear_axle_distance", np.float64),
    ]
)
"""The indices of a car in its model, and its limits. Kernels take an array (1,) of it."""

CarArray = NDArray[np.void]

ROLLED_OVER = math.radians(80.0)
"""[rad] Tilt of base_link from which a car has rolled over. One that lies on its side is at 90 degrees, a little less
if it leans on its wheels; from 74 on the default car tips over the edge of its chassis and does not come back."""

_LEAST_UPRIGHT = math.cos(ROLLED_OVER)

SIDESLIP_SPEED = 0.1
"""[m/s] Below this speed of the centre of gravity there is no sideslip angle: a car that stands sways on its springs by
some mm/s, in any direction."""


@kernel
def planar_pose(qpos: FloatArray, car: CarArray) -> tuple[float, float, float]:
    """Return x [m], y [m] and heading [rad] of base_link in the world."""
    i = car[0].free_qpos
    qw, qx, qy, qz = qpos[i + 3], qpos[i + 4], qpos[i + 5], qpos[i + 6]
    return qpos[i], qpos[i + 1], math.atan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz))


@kernel
def uprightness(qpos: FloatArray, car: CarArray) -> float:
    """Return the cosine of base_link's tilt: 1 on its wheels, 0 on its side, -1 on its roof."""
    i = car[0].free_qpos
    upright: float = 1.0 - 2.0 * (qpos[i + 4] * qpos[i + 4] + qpos[i + 5] * qpos[i + 5])
    return upright


@kernel
def is_rolled_over(qpos: FloatArray, car: CarArray) -> bool:
    """Return whether a car is tilted by more than ROLLED_OVER."""
    return uprightness(qpos, car) < _LEAST_UPRIGHT


@kernel
def ground_speed(qpos: FloatArray, qvel: FloatArray, car: CarArray) -> float:
    """Return the true speed of base_link along its heading [m/s], forward positive."""
    _, _, heading = planar_pose(qpos, car)
    i = car[0].free_dof
    speed: float = qvel[i] * math.cos(heading) + qvel[i + 1] * math.sin(heading)
    return speed


@kernel
def surface_speed(qvel: FloatArray, car: CarArray) -> float:
    """Return the mean surface speed of the wheels [m/s]."""
    total = 0.0
    for dof in car[0].wheel_dofs:
        total += qvel[dof]
    speed: float = 0.25 * total * car[0].wheel_radius
    return speed


@kernel
def read_odometry(
    time: float, qpos: FloatArray, qvel: FloatArray, sensordata: FloatArray, car: CarArray, odometry: NDArray[np.void]
) -> None:
    """Write what the car's own sensors say into `odometry`, an array (1,) of messages.ODOMETRY, and the true pose.

    Encoders, steering sensor, gyro and pose are of the present state; the accelerometer is that of `sensordata`.
    """
    constants, row = car[0], odometry[0]
    row.stamp = time
    row.speed = surface_speed(qvel, car)
    row.steering_angle = qpos[constants.steering_qpos]
    for axis in range(3):
        row.angular_velocity[axis] = qvel[constants.free_dof + 3 + axis]
        row.linear_acceleration[axis] = sensordata[constants.accelerometer + axis]
    for wheel in range(4):
        row.wheel_speeds[wheel] = qvel[constants.wheel_dofs[wheel]] * constants.wheel_radius
    row.pose[0], row.pose[1], row.pose[2] = planar_pose(qpos, car)


@kernel
def body_velocity(qpos: FloatArray, qvel: FloatArray, car: CarArray) -> tuple[float, float]:
    """Return the velocity of base_link over the ground, forward and to the left of its heading [m/s]."""
    _, _, heading = planar_pose(qpos, car)
    i = car[0].free_dof
    ahead, left = math.cos(heading), math.sin(heading)
    return qvel[i] * ahead + qvel[i + 1] * left, qvel[i + 1] * ahead - qvel[i] * left


@kernel
def read_motions(
    which: NDArray[np.bool_],
    cars_per_world: int,
    states: FloatArray,
    first_qpos: int,
    first_qvel: int,
    cars: CarArray,
    poses: FloatArray,
    velocities: FloatArray,
) -> None:
    """Write true poses and velocities of the cars `which` (r,) of worlds with states (r / m, k), as base_link moves.

    Args:
      poses: x [m], y [m], heading [rad], (r, 3), written to.
      velocities: ahead and to the left [m/s], and the yaw rate [rad/s], (r, 3), written to.
    """
    for row in range(len(which)):
        if which[row]:
            state, car = states[row // cars_per_world], cars[row : row + 1]
            qpos, qvel = state[first_qpos:], state[first_qvel:]
            poses[row, 0], poses[row, 1], poses[row, 2] = planar_pose(qpos, car)
            velocities[row, 0], velocities[row, 1] = body_velocity(qpos, qvel, car)
            velocities[row, 2] = qvel[cars[row].free_dof + 5]


@kernel
def point_motion(
    qpos: FloatArray, qvel: FloatArray, ahead: float, car: CarArray
) -> tuple[float, float, float, float, float, float]:
    """Return the motion of a point `ahead` [m] of base_link: x, y [m], heading [rad], velocity, yaw rate [rad/s].

    Its velocity over the ground is that forward and to the left of the heading [m/s].
    """
    x, y, heading = planar_pose(qpos, car)
    i, cos, sin = car[0].free_dof, math.cos(heading), math.sin(heading)
    east, north, yaw_rate = qvel[i], qvel[i + 1], qvel[i + 5]
    left = north * cos - east * sin + ahead * yaw_rate
    return x + ahead * cos, y + ahead * sin, heading, east * cos + north * sin, left, yaw_rate


@kernel
def sideslip_angle(vx: float, vy: float, yaw_rate: float, car: CarArray) -> float:
    """Return the angle from the heading to the velocity of the centre of gravity [rad], left positive, as in ISO 8855.

    It is pi where a car goes straight back, NaN below SIDESLIP_SPEED. `vx` and `vy` [m/s] are of `body_velocity`.
    """
    left = vy + yaw_rate * car[0].rear_axle_distance
    if math.hypot(vx, left) < SIDESLIP_SPEED:
        return math.nan
    return math.atan2(left, vx)


@kernel
def drive(steering_angle: float, speed: float, car: CarArray, ctrl: FloatArray) -> None:
    """Write a command [rad, m/s] to the actuators, held within their limits."""
    limits = car[0]
    ctrl[limits.steering_ctrl] = min(max(steering_angle, -limits.max_steering_angle), limits.max_steering_angle)
    ctrl[limits.speed_ctrl] = min(max(speed, limits.min_speed), limits.max_speed)


def drift_odometry(rows: NDArray[np.void], factors: FloatArray) -> None:
    """Multiply the speeds and the yaw rate of rows (n,) of ODOMETRY by factors (n,), in place."""
    rows["speed"] *= factors
    rows["wheel_speeds"] *= factors[:, np.newaxis]
    rows["angular_velocity"][:, 2] *= factors
