"""The effects of a real LiDAR, applied to scans; `effects` has their settings. Same calls, same seed: the same bits."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from .. import portable
from ..errors import SettingsError
from ..messages import FloatArray, LaserScan
from ..native import core
from .beams import Beams
from .effects import LidarEffects
from .lidar import Lidar, RaycastLidar
from .random_numbers import generator_state, ziggurat

_FASTEST = 200.0  # [m/s] that anything moves; what is elsewhere sooner was put there
_PARTS = 8  # of a sweep that is distorted: 99.6 % of the beams are within 1e-3 m then, the others at edges
_MOST_TURN = 0.5  # [rad] of a LiDAR in one of them; what turns more was put there
_STEEP = 4.0  # times what has moved, a reading of one surface may change: so at a wall 15 deg from its beam
_LEAST_EDGE = 0.01  # [m] that it may change besides, as by a body's turning


class ScanPipeline:
    """From the state of the simulation to the scan that a planner gets.

    Latency holds back whole scans; a scan's stamp stays the time it was measured at. Until the first one is old
    enough, the first one is what is delivered. `needs_every_step` says whether `record` must follow each physics step.

    Raises:
      SettingsError: motion distortion on the back end `rangefinder`, whose sensors MuJoCo fires all at once.
    """

    def __init__(self, lidar: Lidar, effects: LidarEffects, seed: int) -> None:
        self._lidar, self._effects = lidar, effects
        self._rows = EffectsOfRows(lidar.beams, 1)
        self._rows.begin(0, replace(effects, latency=0.0), seed)
        self._held: deque[LaserScan] = deque(maxlen=effects.sweeps_late(lidar.beams.period) + 1)
        self._sweep: _Sweep | None = None
        if effects.motion_distortion:
            if not isinstance(lidar, RaycastLidar):
                raise SettingsError(
                    f"LidarEffects.motion_distortion is True on {type(lidar).__name__}, whose beams are all taken at "
                    "once; accepted: the back end 'raycast'"
                )
            self._sweep = _Sweep(lidar)
        self.needs_every_step = self._sweep is not None

    def record(self, data: Any) -> None:
        """Remember where the LiDAR is. Call it after each physics step, if `needs_every_step`."""
        if self._sweep is not None:
            self._sweep.record(data)

    def scan(self, data: Any) -> LaserScan:
        """Measure at the present state of `data`, whose body poses must be current, and return the scan due now."""
        beams, swept = self._lidar.beams, self._sweep is not None
        ranges = self._lidar.ranges(data) if self._sweep is None else self._sweep.ranges(data)
        self._rows.apply(np.ones(1, np.bool_), ranges[np.newaxis])
        self._held.append(beams.to_scan(ranges, data.time, no_return=self._effects.no_return, swept=swept))
        return self._held[0]


class EffectsOfRows:
    """The effects of many LiDARs on the rows of their ranges, in place; without motion distortion."""

    def __init__(self, beams: Beams, rows: int) -> None:
        self._beams, count = beams, len(beams.bearings)
        self._begun = np.zeros(rows, np.bool_)
        self._states = np.zeros((rows, 4), np.int64)  # of the generator of each
        self._deviations, self._dropouts, self._no_returns = np.zeros(rows), np.zeros(rows), np.full(rows, math.inf)
        self._lates, self._sweeps = np.zeros(rows, np.int64), np.zeros(rows, np.int64)
        self._noise, self._shares = np.zeros(count), np.zeros(count)  # room for those of one row
        self._held = np.zeros((rows, 0, count))  # the last sweeps of each that is late, in a ring
        self._measured: list[Any] = []  # of which the tables are
        self._table_of = np.full(rows, -1)  # of each row among them; -1: it has none
        self._knots, self._values = np.zeros((0, 1)), np.zeros((0, count, 1, 3))

    def __bool__(self) -> bool:
        return bool(self._begun.any())

    def begin(self, row: int, effects: LidarEffects, seed: int) -> None:
        """Have effects on a row from now on."""
        count = len(self._beams.bearings)
        self._begun[row], self._states[row] = True, generator_state(seed)
        self._deviations[row], self._dropouts[row] = effects.range_noise_std, effects.dropout_probability
        self._no_returns[row] = math.inf if effects.no_return == "inf" else self._beams.range_max
        self._lates[row], self._sweeps[row] = effects.sweeps_late(self._beams.period), 0
        self._table_of[row] = -1 if effects.errors is None else self._table(effects.errors)
        if self._lates[row] > self._held.shape[1]:
            held = np.zeros((len(self._held), int(self._lates[row]), count))
            held[:, : self._held.shape[1]] = self._held
            self._held = held

    def _table(self, errors: Any) -> int:
        """Return the place of the tables of measured errors."""
        if errors not in self._measured:
            self._measured.append(errors)
            all_of = [_tables(each, self._beams) for each in self._measured]
            most = max(len(knots) for knots, _ in all_of)
            self._knots = np.full((len(all_of), most), math.inf)
            self._values = np.zeros((len(all_of), len(self._beams.bearings), most, 3))
            for place, (knots, values) in enumerate(all_of):
                self._knots[place, : len(knots)], self._values[place, :, : len(knots)] = knots, values
        return self._measured.index(errors)

    def end(self, row: int) -> None:
        """Have none on it."""
        self._begun[row] = False

    def apply(self, which: NDArray[np.bool_], ranges: FloatArray) -> None:
        """Turn what was measured into what is delivered now, in the rows `which` (r,) of ranges (r, beams) [m]."""
        core.apply_effects(
            np.flatnonzero(self._begun & which), ranges, self._states, *ziggurat(), self._deviations, self._noise,
            self._dropouts, self._shares, self._no_returns, self._lates, self._sweeps, self._held, self._table_of,
            self._knots, self._values.reshape(-1, 3), self._beams.range_min, self._beams.range_max,
        )  # fmt: skip


def _tables(errors: Any, beams: Beams) -> tuple[FloatArray, FloatArray]:
    """Return the ranges (k,) [m] of measured errors, and noise, bias and dropout of each beam at them (n, k, 3)."""
    return np.array(errors.ranges), np.ascontiguousarray(errors.at(beams.bearings))


class PoseHistory:
    """Poses of a body at the last physics steps, `span` [s] back."""

    def __init__(self, span: float) -> None:
        self._span = span
        self._poses: deque[tuple[float, FloatArray, FloatArray]] = deque()

    def record(self, time: float, position: FloatArray, quaternion: FloatArray) -> None:
        """Add a pose: time [s], later than the last or the same one again, position (3,) [m], quaternion (4,) wxyz."""
        while self._poses and self._poses[-1][0] >= time:
            self._poses.pop()
        self._poses.append((time, position.copy(), quaternion.copy()))
        while len(self._poses) > 2 and self._poses[1][0] <= time - self._span:
            self._poses.popleft()

    def at(self, times: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return positions (n, 3) [m] and quaternions (n, 4) wxyz at `times` (n,) [s]; outside, the first and the last.

        A body that was put elsewhere from one step to the next is nowhere in between.
        Source: Shoemake, Animating rotation with quaternion curves, SIGGRAPH 1985.
        """
        known = np.array([pose[0] for pose in self._poses])
        positions = np.array([pose[1] for pose in self._poses])
        quaternions = np.array([pose[2] for pose in self._poses])
        place = np.interp(times, known, np.arange(len(known)))
        before = np.minimum(place.astype(np.intp), max(len(known) - 2, 0))
        after = np.minimum(before + 1, len(known) - 1)
        share = (place - before)[:, np.newaxis]
        moved = np.abs(positions[after] - positions[before]).max(axis=1)
        put = moved > _FASTEST * (known[after] - known[before])
        share = np.where(put[:, np.newaxis] & (share < 1.0), 0.0, share)
        position = (1.0 - share) * positions[before] + share * positions[after]
        first, second = quaternions[before], quaternions[after]
        cosine = np.einsum("ij,ij->i", first, second)[:, np.newaxis]
        second = np.where(cosine < 0.0, -second, second)  # the short way round
        angle = portable.arccos(np.minimum(np.abs(cosine), 1.0))
        # np.sinc(x / pi) is sin(x) / x, and 1 at 0.
        weights = [part * np.sinc(part * angle / math.pi) / np.sinc(angle / math.pi) for part in (1.0 - share, share)]
        return position, weights[0] * first + weights[1] * second


class _Sweep:
    """A scan whose beams are taken one after the other, the last one at the present state, by parts: see `_part`."""

    def __init__(self, lidar: RaycastLidar) -> None:
        self._lidar, count = lidar, len(lidar.beams.bearings)
        self._parts = np.array_split(np.arange(count), min(_PARTS, count))
        ends = np.array([(part[0], part[-1]) for part in self._parts])
        self._ages = lidar.beams.time_increment * (count - 1 - ends)  # (parts, 2) [s]
        self._histories = [PoseHistory(float(self._ages.max())) for _ in lidar.poses.positions]
        # Poses in `data` are one step behind after mj_step; here they are worked out at the present state.
        self._present = mujoco.MjData(lidar.model)

    def record(self, data: Any) -> None:
        present, poses, quaternion = self._present, self._lidar.poses, np.empty(4)
        present.qpos[:], present.mocap_pos[:], present.mocap_quat[:] = data.qpos, data.mocap_pos, data.mocap_quat
        mujoco.mj_kinematics(self._lidar.model, present)
        poses.read(present)
        for history, position, rotation in zip(self._histories, poses.positions, poses.rotations, strict=True):
            mujoco.mju_mat2Quat(quaternion, rotation.ravel())
            history.record(data.time, position, quaternion)

    def ranges(self, data: Any) -> FloatArray:
        self.record(data)
        found = [history.at(data.time - self._ages.ravel()) for history in self._histories]
        positions = np.stack([each.reshape(-1, 2, 3) for each, _ in found], axis=2)  # (parts, 2, bodies, 3)
        rotations = np.stack([_matrices(each).reshape(-1, 2, 3, 3) for _, each in found], axis=2)
        parts = zip(self._parts, self._ages, positions, rotations, strict=True)
        return np.concatenate([self._part(*part) for part in parts])

    def _part(
        self, part: NDArray[np.intp], ages: FloatArray, positions: FloatArray, rotations: FloatArray
    ) -> FloatArray:
        """Return the readings of some beams (k,), with the poses when the first and when the last was taken.

        The part is drawn from where all was at either time, with beams turned to where they point in its course. A
        reading goes evenly from the one to the other, as that of a flat wall does, and is the nearer one in time where
        the two differ by more than what has moved, as at an edge.
        """
        beams = self._lidar.beams
        between = rotations[0, 0].T @ rotations[1, 0]
        turn, apart = math.atan2(between[1, 0], between[0, 0]), np.linalg.norm(positions[1] - positions[0], axis=1)
        moved = apart[0] + apart[1:].max(initial=0.0)
        if abs(turn) > _MOST_TURN or moved > _FASTEST * (ages[0] - ages[1]):  # it was put elsewhere
            turn = moved = 0.0
        share = np.linspace(0.0, 1.0, len(part))
        middle = 0.5 * (beams.bearings[part[0]] + beams.bearings[part[-1]])
        bearings = beams.bearings[part] - middle + (share - 0.5) * turn
        readings = []
        for end in (0, 1):
            ahead = middle + (0.5 - end) * turn  # of the LiDAR as it is then
            cosine, sine = math.cos(ahead), math.sin(ahead)
            turned = np.array(((cosine, -sine, 0.0), (sine, cosine, 0.0), (0.0, 0.0, 1.0)))
            seen_from = np.concatenate(((rotations[end, 0] @ turned)[np.newaxis], rotations[end, 1:]))
            readings.append(self._lidar.ranges_along(bearings, positions[end].copy(), seen_from))
        first, last = readings
        with np.errstate(invalid="ignore"):
            near = np.abs(last - first) <= _STEEP * moved + _LEAST_EDGE
            return np.where(near, first + share * (last - first), np.where(share < 0.5, first, last))


def _matrices(quaternions: FloatArray) -> FloatArray:
    """Return the rotation matrices (n, 9) of unit quaternions (n, 4) wxyz."""
    found = np.empty((len(quaternions), 9))
    for matrix, quaternion in zip(found, quaternions, strict=True):
        mujoco.mju_quat2Mat(matrix, quaternion)
    return found


def add_noise(ranges: FloatArray, deviation: float, range_max: float, noise: FloatArray) -> None:
    """Turn standard normal `noise` (n,) into `ranges` (n,) [m] with noise of a deviation [m], 0 to `range_max` [m]."""
    core.add_noise(ranges, deviation, range_max, noise)


def error_at(knots: FloatArray, values: FloatArray, which: int, distance: float) -> float:
    """Return noise, bias or dropout (`which`) of `values` (k, 3) at a distance [m] among `knots` (k,), inf behind."""
    return core.error_at(knots, values, which, distance)
