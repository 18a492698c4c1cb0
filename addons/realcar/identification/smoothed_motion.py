"""The motion of a car, smoothed from what its sensors measured, with the lateral velocity that none of them measures.

Heading and planar velocity each follow from a linear model, whose most probable path is what a Rauch-Tung-Striebel
smoother gives. Here it is found at once, as one sparse least-squares problem:

    heading   psi' = r, r' = s, s' white noise           measured: heading, r + bias
    velocity  p' = v, v' = a, a' white noise, in the world's frame, which makes it linear once the heading is known
              measured: position, R(psi)^T a + bias (accelerometer), the forward part of v (wheels)

The lateral velocity of the car is then that of v across its heading. The accelerometer carries it through what the
poses are too coarse for, and the poses keep it from drifting.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fg_mujoco.messages import FloatArray

from .drive_log import Drive

STEP = .00625
"""[s] of the grid that drives are smoothed and simulated on."""

NOISE = {"gyro": 0.01, "accelerometer": 0.2, "position": 0.02, "heading": 0.01, "wheel speed": 0.2, "sideways": 0.5}
"""Standard deviations that the smoother assumes [rad/s, m/s^2, m, rad, m/s, m/s]. That of the wheels has room for slip;
`sideways` is of the rear axle where there are no poses."""

_YAW_JERK = 100.0  # [rad/s^2 per sqrt(s)] of s; a step of the steering at the limit gives some 50 rad/s^2 in .1 s
_JERK = 20.0  # [m/s^2 per sqrt(s)] of a
_EXACT = 1e-5  # of what the model says without noise, per step


@dataclass(frozen=True, kw_only=True, eq=False)
class Motion:
    """A smoothed drive on a grid of STEP; arrays (n,). Velocity and accelerations are the centre of gravity's."""

    time: FloatArray  # [s]
    x: FloatArray  # [m] of the centre of gravity
    y: FloatArray  # [m]
    heading: FloatArray  # [rad], without jumps
    forward_speed: FloatArray  # [m/s]
    lateral_speed: FloatArray  # [m/s] left positive
    yaw_rate: FloatArray  # [rad/s]
    yaw_acceleration: FloatArray  # [rad/s^2]
    forward_acceleration: FloatArray  # [m/s^2]
    lateral_acceleration: FloatArray  # [m/s^2]


def smooth(drive: Drive) -> Motion:
    """Return the motion of a drive."""
    time = np.asarray(drive.start + STEP * np.arange(int((drive.end - drive.start) / STEP + 1e-9) + 1), np.float64)
    one = np.ones(len(time))

    turning = _Path(time, orders=3, axes=1, noise=_YAW_JERK, biases=1)  # heading, yaw rate, yaw acceleration
    turning.measure(drive.yaw_rate.time, drive.yaw_rate.values[:, 0], {1: one}, NOISE["gyro"], bias=0)
    if drive.pose is not None:
        turning.measure(drive.pose.time, np.unwrap(drive.pose.values[:, 2]), {0: one}, NOISE["heading"])
    else:
        turning.assume(0, 0.0, 1e-3)
        turning.assume(turning.bias(0), 0.0, 1e-3)
    heading, yaw_rate, yaw_acceleration = turning.solve().T

    cos, sin = np.cos(heading), np.sin(heading)
    ahead = drive.car.rear_axle_distance
    moving = _Path(time, orders=3, axes=2, noise=_JERK, biases=2)  # x, y, their velocities, their accelerations
    speed = drive.speed
    moving.measure(speed.time, speed.values[:, 0], {2: cos, 3: sin}, NOISE["wheel speed"])
    if drive.acceleration is not None:
        for axis, (x, y) in enumerate(((cos, sin), (-sin, cos))):
            values = drive.acceleration.values[:, axis]
            moving.measure(drive.acceleration.time, values, {4: x, 5: y}, NOISE["accelerometer"], bias=axis)
    else:
        for axis in (0, 1):  # nothing measures them, and they must not leave the problem singular
            moving.assume(moving.bias(axis), 0.0, 0.1)
    if drive.pose is not None:
        for axis, turn in enumerate((cos, sin)):
            shift = ahead * np.interp(drive.pose.time, time, turn)
            moving.measure(drive.pose.time, drive.pose.values[:, axis] + shift, {axis: one}, NOISE["position"])
    else:  # without poses the rear axle is taken to have no lateral velocity in the mean
        for column, noise in ((0, 1e-3), (1, 1e-3), (moving.bias(0), 0.1), (moving.bias(1), 0.1)):
            moving.assume(column, 0.0, noise)
        sideways = ahead * np.interp(speed.time, time, yaw_rate)
        moving.measure(speed.time, sideways, {2: -sin, 3: cos}, NOISE["sideways"])
    x, y, vx, vy, ax, ay = moving.solve().T
    return Motion(
        time=time, x=x, y=y, heading=heading, yaw_rate=yaw_rate, yaw_acceleration=yaw_acceleration,
        forward_speed=cos * vx + sin * vy, lateral_speed=cos * vy - sin * vx,
        forward_acceleration=cos * ax + sin * ay, lateral_acceleration=cos * ay - sin * ax,
    )  # fmt: skip


class _Path:
    """The most probable path of a linear system of integrators, as rows of a sparse least-squares problem."""

    def __init__(self, time: FloatArray, *, orders: int, axes: int, noise: float, biases: int) -> None:
        self._time, self._states = time, orders * axes
        self._biases = biases
        self._rows = 0
        self._entries: list[tuple[Any, Any, Any]] = []
        self._wanted: list[FloatArray] = []
        steps = np.arange(len(time) - 1)
        for state in range(self._states):
            weight = 1.0 / (noise * np.sqrt(STEP) if state >= self._states - axes else _EXACT)
            terms = {state: 1.0, state + axes: STEP, state + 2 * axes: 0.5 * STEP**2}
            entries = [(steps * self._states + to, value) for to, value in terms.items() if to < self._states]
            entries.append(((steps + 1) * self._states + state, -1.0))
            self._add([(column, np.full(len(steps), value)) for column, value in entries], np.zeros(len(steps)), weight)

    def bias(self, number: int) -> int:
        """Return the column of a bias."""
        return len(self._time) * self._states + number

    def assume(self, column: int, value: float, noise: float) -> None:
        """Say what a column of the first time, or a bias, is about."""
        self._add([(np.array([column]), np.ones(1))], np.array([value]), 1.0 / noise)

    def measure(
        self, times: FloatArray, values: FloatArray, terms: dict[int, FloatArray], noise: float, bias: int | None = None
    ) -> None:
        """Say what was measured: the sum of states, each times its coefficient (n,) on the grid."""
        within = (times >= self._time[0]) & (times <= self._time[-1])
        times, values = times[within], values[within]
        place = np.clip(((times - self._time[0]) / STEP).astype(int), 0, len(self._time) - 2)
        part = (times - self._time[place]) / STEP
        entries = []
        for state, factors in terms.items():
            entries.append((place * self._states + state, factors[place] * (1.0 - part)))
            entries.append(((place + 1) * self._states + state, factors[place + 1] * part))
        if bias is not None:
            entries.append((np.full(len(times), self.bias(bias)), np.ones(len(times))))
        self._add(entries, values, 1.0 / noise)

    def solve(self) -> FloatArray:
        """Return the states (n, orders * axes)."""
        from scipy.linalg import solveh_banded
        from scipy.sparse import csr_array

        rows, columns, values = (np.concatenate(part) for part in zip(*self._entries, strict=True))
        count = self.bias(0)
        matrix = csr_array((values, (rows, columns)), shape=(self._rows, self.bias(self._biases)))
        normal = (matrix.T @ matrix).tocoo()
        wanted = matrix.T @ np.concatenate(self._wanted)
        # the states are a band, because each is tied to its neighbours alone; the biases, tied to all, are its border
        width = 2 * self._states - 1
        row, column = normal.coords
        band = np.zeros((width + 1, count))
        inside = (row <= column) & (column < count)
        band[width + row[inside] - column[inside], column[inside]] = normal.data[inside]
        border = (matrix[:, :count].T @ matrix[:, count:]).toarray()
        solved = solveh_banded(band, np.column_stack((wanted[:count], border)))
        path, through = solved[:, 0], solved[:, 1:]
        corner = (matrix[:, count:].T @ matrix[:, count:]).toarray() - border.T @ through
        path = path - through @ np.linalg.solve(corner, wanted[count:] - border.T @ path)
        return np.asarray(path).reshape(len(self._time), self._states)

    def _add(self, entries: list[tuple[Any, FloatArray]], values: FloatArray, weight: float) -> None:
        rows = self._rows + np.arange(len(values))
        self._entries += [(rows, columns, factors * weight) for columns, factors in entries]
        self._wanted.append(values * weight)
        self._rows += len(values)
