"""The drive as a least-squares problem: what the single-track model says that each sensor measures, segment by segment.

A drive is cut into segments, and each is simulated from a state of its own (multiple shooting). So a car past its peak,
whose motion no open simulation follows for long, still says all that it knows of its tires. The states at the starts
are unknowns beside the parameters, and are eliminated segment by segment (variable projection).
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.messages import FloatArray

from ..single_track import STATES, TIRE, SimulatedDrive, car_array, simulate
from .drive_log import SLOWEST, Drive
from .smoothed_motion import NOISE, STEP, Motion, smooth
from .steering_response import Steering

SEGMENT = 1.0
"""[s] of a segment; every third one is held back."""

PARAMETERS = (
    *(f"front_{name}" for name in TIRE), *(f"rear_{name}" for name in TIRE),
    "steering_gain", "steering_offset", "steering_lag", "steering_delay", "relaxation_length",
    "gyro_bias", "lateral_bias", "lateral_gain", "heading_offset", "pose_delay", "inertia_ratio",
    "limit_ratio",
)  # fmt: skip
"""What is found: stiffness [1/rad], C, D, E [-] of both axles; gain [-], offset [rad], lag [s] and delay [s] of the
steering; the relaxation length of the tires [m]; and of the sensors the gyro's bias [rad/s], the accelerometer's bias
[m/s^2] and gain [-] (a car that rolls measures a part of gravity, and by that part the two-track model rolls), the
angle between the pose's heading and the car's [rad], and the delay of the pose [s]; last, over those of the vehicle
that is assumed [-], the yaw inertia at its mass (motion tells their ratio), and the greatest angle of the wheels."""

SIMULATED = 13
"""The first of PARAMETERS, which change the motion; the others but ROLL change what the sensors say of it."""

ROLL, INERTIA, GAIN, LIMIT = map(PARAMETERS.index, ("lateral_gain", "inertia_ratio", "steering_gain", "limit_ratio"))
"""Of how far a car rolls, which moves its wheels, too, and of the factors of the yaw inertia, the steering's commands
and the greatest angle of the front wheels."""

DIFFERENCE = 1e-6
"""By which a parameter, or a state, is moved for a derivative; of a parameter above 1, times it."""

_SHORTEST_SEGMENT = 0.5  # [s]
_SPIN = 0.5  # [rad] of sideslip, beyond which a car spins: far behind the peak, where tires are not what a formula says
_AROUND_SPIN = 0.2  # [s] before and after it that are left out, too: wheels spin and lock there
_START_NOISE = np.array((0.3, 0.1, 0.05, 0.05, 0.03))  # of the smoothed states that segments start at, as STATES
_PLACE, _HEADING = 2, 4  # of the states: x, y and heading, with which the motion only moves and turns
_CHANNELS = ("gyro", "accelerometer", "position", "heading")
_HUBER = 2.0  # standard deviations beyond which a residual counts linearly


@dataclass(frozen=True, kw_only=True, eq=False)
class Rows:
    """The measurements of one channel in the segments of a drive."""

    channel: int  # of _CHANNELS
    node: NDArray[np.int64]  # (n,) before the measurement
    part: FloatArray  # (n,) of the way to the next node
    segment: NDArray[np.int64]  # (n,)
    values: FloatArray  # (n, k)
    time: FloatArray  # (n,)


@dataclass(frozen=True, kw_only=True, eq=False)
class Linearised:
    """Residuals of the segments at some parameters, and their derivatives, all over the noise."""

    residuals: list[FloatArray]  # of each segment (n,), the last STATES rows those of the start
    parameters: list[FloatArray]  # (n, len(PARAMETERS))
    starts: list[FloatArray]  # (n, STATES)


class DriveProblem:
    """One drive, smoothed and cut into segments.

    `segments` (m, 2) are the first node and the one behind the last, `held_back` (m,) those for validation alone,
    `smoothed` (m, STATES) the states at the starts, and `step` [s] is the grid's.
    """

    def __init__(self, drive: Drive, *, single_track: bool = False) -> None:
        self.drive = drive
        self.motion = smooth(drive)
        self.car = car_array(drive.car, single_track=single_track)
        self.single_track = single_track
        self.segments = _cut(self.motion)
        self.held_back = np.arange(len(self.segments)) % 3 == 2
        motion = self.motion
        states = (motion.lateral_speed, motion.yaw_rate, motion.x, motion.y, motion.heading)
        self.smoothed = np.column_stack([state[self.segments[:, 0]] for state in states])
        self.steering = Steering(
            drive.steering,
            motion.time,
            limit=drive.car.max_steering_angle,
            rate=drive.car.max_steering_rate if drive.commanded else np.inf,
            held=drive.commanded,
        )
        self.step = STEP
        self._sort_rows()

    def only(self, chosen: NDArray[np.bool_] | NDArray[np.int64]) -> DriveProblem:
        """Return the problem of some of its segments, in their order."""
        part = copy(self)
        part.segments, part.held_back = self.segments[chosen], self.held_back[chosen]
        part.smoothed = self.smoothed[chosen]
        part._sort_rows()
        return part

    def _sort_rows(self) -> None:
        self._rows = [self._of(channel) for channel in range(len(_CHANNELS))]
        self._channels = np.concatenate([np.full(len(rows.node), rows.channel) for rows in self._rows])
        self._segment_of = np.concatenate([rows.segment for rows in self._rows])
        self._order = np.argsort(self._segment_of, kind="stable")
        self._counts = np.bincount(self._segment_of, minlength=len(self.segments))

    def _of(self, channel: int) -> Rows:
        drive, motion = self.drive, self.motion
        source = (drive.yaw_rate, drive.acceleration, drive.pose, drive.pose)[channel]
        time = source.time if source is not None else np.empty(0)
        node = np.floor((time - motion.time[0]) / STEP + 1e-9).astype(np.int64)
        segment = np.searchsorted(self.segments[:, 0], node, side="right") - 1
        inside = segment >= 0
        if len(self.segments):
            inside &= node < self.segments[np.maximum(segment, 0), 1] - 1
        node, segment, time = node[inside], segment[inside], time[inside]
        values = source.values[inside] if source is not None else np.empty((0, 3))
        if channel == 3:  # the turn that is nearest to the smoothed heading
            near = motion.heading[node]
            values = (near + np.remainder(values[:, 2] - near + np.pi, 2.0 * np.pi) - np.pi)[:, np.newaxis]
        part = (time - motion.time[node]) / STEP
        return Rows(channel=channel, node=node, part=part, segment=segment, values=values, time=time)

    def angles(self, parameters: FloatArray) -> FloatArray:
        """Return the angle of the front wheels on the grid (n,) [rad]."""
        return self.steering.angles(*parameters[8:12], limit=parameters[LIMIT] * self.drive.car.max_steering_angle)

    def run(self, parameters: FloatArray, starts: FloatArray) -> FloatArray:
        """Return the simulated nodes (n, STATES + 1) of all segments, each from its start."""
        motion = self.motion
        out = np.full((len(motion.time), STATES + 1), np.nan)
        angles = self.angles(parameters)
        car = self.car.copy()
        car[1] *= parameters[INERTIA]
        drive = SimulatedDrive(
            parameters[:8], car, parameters[12], parameters[ROLL], angles, motion.forward_speed,
            motion.forward_acceleration, STEP,
        )  # fmt: skip
        simulate(drive, self.segments, np.ascontiguousarray(starts), out)
        return out

    def measured(self, parameters: FloatArray, nodes: FloatArray) -> FloatArray:
        """Return what the sensors would measure, less what they did, in the channels' order."""
        gyro_bias, lateral_bias, _, heading_offset, pose_delay = parameters[SIMULATED:INERTIA]
        ahead = self.drive.car.rear_axle_distance
        found = []
        for rows in self._rows:
            part = rows.part[:, np.newaxis]
            states = nodes[rows.node] * (1.0 - part) + nodes[rows.node + 1] * part
            vy, r, x, y, heading, reading = states.T
            if rows.channel == 0:
                found.append(r + gyro_bias - rows.values[:, 0])
            elif rows.channel == 1:
                found.append(reading + lateral_bias - rows.values[:, 1])
            elif rows.channel == 2:  # across the heading: along it, the position says nothing of the tires
                smoothed = self.motion.heading[rows.node]
                behind_x = x - ahead * np.cos(heading) - rows.values[:, 0]
                behind_y = y - ahead * np.sin(heading) - rows.values[:, 1]
                across = np.cos(smoothed) * behind_y - np.sin(smoothed) * behind_x
                found.append(across - pose_delay * (vy - ahead * r))
            else:
                found.append(heading - pose_delay * r + heading_offset - rows.values[:, 0])
        return np.concatenate(found)

    def costs(self, parameters: FloatArray, starts: FloatArray, noise: FloatArray) -> FloatArray:
        """Return Huber's cost of each segment (m,)."""
        residuals = self.measured(parameters, self.run(parameters, starts)) / noise[self.channels()]
        begun: FloatArray = huber((starts - self.smoothed) / _START_NOISE)[0].sum(axis=1)
        return begun + np.bincount(self.segment_of(), huber(residuals)[0], minlength=len(self.segments))

    def channels(self) -> NDArray[np.int64]:
        """Return the channel of each residual of `measured`."""
        return self._channels

    def segment_of(self) -> NDArray[np.int64]:
        """Return the segment of each residual of `measured`."""
        return self._segment_of

    @property
    def gyro(self) -> Rows:
        """The measurements of the gyro."""
        return self._rows[0]

    def _moved(self, nodes: FloatArray, starts: FloatArray, state: int) -> FloatArray:
        """Return simulated nodes after a small change of where the segments start; the motion stays the same."""
        moved = nodes.copy()
        moved[:, state] += DIFFERENCE
        if state == _HEADING:
            for (first, end), start in zip(self.segments, starts, strict=True):
                moved[first:end, _PLACE] -= DIFFERENCE * (nodes[first:end, _PLACE + 1] - start[_PLACE + 1])
                moved[first:end, _PLACE + 1] += DIFFERENCE * (nodes[first:end, _PLACE] - start[_PLACE])
        return moved

    def linearise(
        self, parameters: FloatArray, starts: FloatArray, noise: FloatArray, free: NDArray[np.bool_]
    ) -> Linearised:
        """Return residuals and their derivatives by the free parameters and starts (m, STATES), over the noise (4,)."""
        weights = 1.0 / noise[self.channels()]
        nodes = self.run(parameters, starts)
        here = self.measured(parameters, nodes)

        columns = np.zeros((len(here), len(PARAMETERS)))
        for index in np.flatnonzero(free):
            moved = parameters.copy()
            step = DIFFERENCE * max(1.0, abs(moved[index]))
            moved[index] += step
            again = self.run(moved, starts) if index < SIMULATED or index in (ROLL, INERTIA, LIMIT) else nodes
            columns[:, index] = (self.measured(moved, again) - here) / step
        begun = np.empty((len(here), STATES))
        for state in range(STATES):
            if state < _PLACE:
                shifted = starts.copy()
                shifted[:, state] += DIFFERENCE
                again = self.run(parameters, shifted)
            else:
                again = self._moved(nodes, starts, state)
            begun[:, state] = (self.measured(parameters, again) - here) / DIFFERENCE
        ends = np.cumsum(self._counts)[:-1]
        order = self._order
        start_rows = (starts - self.smoothed) / _START_NOISE

        def split(rows: FloatArray) -> list[FloatArray]:
            return np.split((rows.T * weights).T[order], ends)

        nothing = np.zeros((STATES, len(PARAMETERS)))
        return Linearised(
            residuals=[np.append(rows, start) for rows, start in zip(split(here), start_rows, strict=True)],
            parameters=[np.vstack((rows, nothing)) for rows in split(columns)],
            starts=[np.vstack((rows, np.diag(1.0 / _START_NOISE))) for rows in split(begun)],
        )


def huber(residuals: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return Huber's costs of residuals over their noise, and the square roots of their weights."""
    size = np.abs(residuals)
    large = size > _HUBER
    costs = np.where(large, 2.0 * _HUBER * size - _HUBER**2, size**2)
    return costs, np.sqrt(np.where(large, _HUBER / np.maximum(size, 1e-300), 1.0))


def assumed_noise() -> FloatArray:
    """Return the standard deviation of each channel, as it is assumed at first."""
    return np.array([NOISE[name] for name in _CHANNELS])


def measured_noise(
    problems: Sequence[DriveProblem], parameters: FloatArray, starts: Sequence[FloatArray]
) -> FloatArray:
    """Return the standard deviation of each channel by the residuals' median; a tenth of the assumed one at least."""
    residuals, channels = [], []
    for problem, begun in zip(problems, starts, strict=True):
        residuals.append(problem.measured(parameters, problem.run(parameters, begun)))
        channels.append(problem.channels())
    values, kinds = np.concatenate(residuals), np.concatenate(channels)
    noise = assumed_noise()
    for channel in range(len(noise)):
        if (kinds == channel).any():
            spread = 1.4826 * float(np.median(np.abs(values[kinds == channel])))
            noise[channel] = max(spread, 0.1 * noise[channel])
    return noise


def _cut(motion: Motion) -> NDArray[np.int64]:
    """Return the segments of a drive in which the car moves forward and does not spin, (m, 2)."""
    spins = np.abs(np.arctan2(motion.lateral_speed, motion.forward_speed)) > _SPIN
    around = np.ones(2 * round(_AROUND_SPIN / STEP) + 1)
    spins = np.convolve(spins, around, "same") > 0.5 if spins.any() else spins
    moving = np.concatenate(([False], (motion.forward_speed > SLOWEST) & ~spins, [False]))
    edges = np.flatnonzero(np.diff(moving.astype(int)))
    length, least = round(SEGMENT / STEP), round(_SHORTEST_SEGMENT / STEP)
    found = []
    for first, end in zip(edges[::2], edges[1::2], strict=True):
        for begin in range(first, end, length):
            if min(begin + length, end) - begin >= least:
                found.append((begin, min(begin + length, end)))
    return np.array(found, np.int64).reshape(-1, 2)
