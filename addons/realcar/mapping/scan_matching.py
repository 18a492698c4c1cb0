"""Poses that drift, corrected by what the LiDAR saw: each scan is laid on the walls that were seen before.

    numbers, corrected, left_out = match_scans(sweeps)

The poses move from scan to scan as the source says. From there the ends of the beams are moved on to the walls at the
nearest ends seen before, by least squares; those that have none near by, as what comes into view for the first time, do
not count. A step away from what the source says costs a little, so that a corridor, in which all places along it look
alike, straight or round, keeps that. So scans alone, without any odometry, would not do. Nothing closes a loop here:
where a lap does not end where it began, walls are double there. `pose_graph` closes loops.

Source: A. Censi, An ICP variant using a point-to-line metric, ICRA 2008.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.messages import FloatArray

from .sweeps import Sweeps

_REACH = 20.0  # [m] of beams that are matched
_MOST_BEAMS = 360  # of a scan
_MOVED, _TURNED = 0.1, 0.05  # [m], [rad] after which the next scan is matched
_KEPT_MOVED, _KEPT_TURNED = 0.4, 0.25  # [m], [rad] after which a matched scan is laid down for those that follow
_GATES = (0.5, 0.3, 0.2, 0.12, 0.1, 0.1, 0.1)  # [m] to the nearest end, in each of the steps
_AROUND, _STEP, _BENT = 0.3, 0.25, 0.03  # [m] of a wall round an end, between its neighbours, and off it in the mean
_RANGE_ERROR = 0.02  # [m] standard deviation
_STEP_ERROR, _TURN_ERROR = 0.01, 0.005  # [m], [rad] standard deviation of a step of the source, and
_STEP_SHARE = 0.1  # of its length and its turn besides
_CHAIN = 40  # scans laid down that others are laid on, of a chain
_SCALE_ERROR, _SCALE_WALK = 0.06, 0.0003  # standard deviations of the constant error of the way, and of a step of it
_MATCH_ERROR = 0.015  # [m] of a step that was corrected, along the car
_UNSEEN = 0.5  # share of a step's error that the scan leaves, above which it says nothing of the way


FEW = "with too few readings to match"
"""Why a scan is not matched; the other reason is that the LiDAR has not moved on."""


def standing(moved: float, turned: float) -> str:
    """Return why a scan does not count that was taken where the last one was: within so many m and rad."""
    return f"taken within {moved:g} m and {math.degrees(turned):.1f} degrees of the one before"


def match_scans(sweeps: Sweeps, *, chain: bool = False) -> tuple[list[int], FloatArray, dict[str, int]]:
    """Return the scans that were matched, by number, and the corrected pose of the LiDAR at each, shape (n, 3).

    The third is how many were not matched, by the reason.

    Args:
      sweeps: the scans.
      chain: whether loops are closed afterwards: scans are laid on what was seen shortly before only, so that each step
        is as true as the others, and the constant error of the source's way is found and taken out.
    """
    left_out = {standing(_MOVED, _TURNED): 0, FEW: 0}
    numbers: list[int] = []
    poses: list[FloatArray] = []
    laid, scale = Walls(_CHAIN if chain else None), _WayScale()
    kept = np.full(3, math.inf)
    for number in range(len(sweeps.scans)):
        ends, walls = walls_seen(sweeps, number)
        if not len(ends):
            left_out[FEW] += 1
            continue
        if not poses:
            pose = sweeps.poses[number].copy()
        else:
            step = step_between(sweeps.poses[numbers[-1]], sweeps.poses[number])
            if math.hypot(step[0], step[1]) < _MOVED and abs(step[2]) < _TURNED:
                left_out[standing(_MOVED, _TURNED)] += 1
                continue
            far = _STEP_ERROR + _STEP_SHARE * math.hypot(step[0], step[1])
            prior = (_RANGE_ERROR / np.array((far, far, _TURN_ERROR + _STEP_SHARE * abs(step[2])))) ** 2
            if chain:
                step[:2] *= 1.0 + scale.error
            guess = stepped(poses[-1], step)
            pose = laid.fitted(guess, ends, prior)
            if chain:
                scale.see(step, guess, pose, laid.information + np.diag(prior))
        numbers.append(number)
        poses.append(pose)
        away = step_between(kept, pose) if len(numbers) > 1 else np.full(3, math.inf)
        if math.hypot(away[0], away[1]) > _KEPT_MOVED or abs(away[2]) > _KEPT_TURNED:
            laid.add(pose, walls)
            kept = pose
    return numbers, np.array(poses).reshape(-1, 3), left_out


def key_scans(poses: FloatArray) -> list[int]:
    """Return those of poses (n, 3), by number, that are so far apart that others can be laid on what they saw."""
    keys: list[int] = []
    for number, pose in enumerate(poses):
        away = step_between(poses[keys[-1]], pose) if keys else np.full(3, math.inf)
        if math.hypot(away[0], away[1]) > _KEPT_MOVED or abs(away[2]) > _KEPT_TURNED:
            keys.append(number)
    return keys


class _WayScale:
    """The constant error of a source's way, by a Kalman filter: scans correct the steps along the car."""

    def __init__(self) -> None:
        self.error, self._variance = 0.0, _SCALE_ERROR**2

    def see(self, step: FloatArray, guess: FloatArray, pose: FloatArray, information: FloatArray) -> None:
        """Learn from a step, from the pose that it led to and the one that the scan made of it.

        `information` is that of the pose, the step's own included, over that of a beam.
        """
        way = math.hypot(step[0], step[1])
        if not information.any() or way < 0.5 * _MOVED:
            return
        ahead = np.array((math.cos(guess[2]), math.sin(guess[2]), 0.0))
        own = (_RANGE_ERROR / (_STEP_ERROR + _STEP_SHARE * way)) ** 2
        left = float(ahead @ np.linalg.solve(information, ahead)) * own  # share of the step's error that is left
        if left > _UNSEEN:
            return
        off = float((pose - guess) @ ahead) / (1.0 - left)
        variance = _MATCH_ERROR**2 / (1.0 - left) ** 2
        gain = self._variance * way / (way * way * self._variance + variance)
        self.error += gain * off
        self._variance += _SCALE_WALK**2 - gain * way * self._variance


class Walls:
    """The ends of beams, and the directions across the walls there.

    Args:
      newest: so many of the scans that were laid down count; None: all.
    """

    def __init__(self, newest: int | None = None) -> None:
        self._ends, self._normals = np.empty((0, 2)), np.empty((0, 2))
        self._newest, self._counts = newest, list[int]()
        self.information = np.zeros((3, 3))  # of the last pose that was fitted, by the scan alone, over that of a beam

    def __bool__(self) -> bool:
        return len(self._ends) > 0

    def add(self, pose: FloatArray, walls: FloatArray) -> None:
        """Lay down the walls that a scan saw at its pose; those that are NaN do not count."""
        from scipy.spatial import cKDTree

        known = walls[np.isfinite(walls[:, 0])]
        if not len(known):
            return
        turn = _turn(pose[2])
        self._ends = np.concatenate((self._ends, known[:, :2] @ turn.T + pose[:2]))
        self._normals = np.concatenate((self._normals, known[:, 2:] @ turn.T))
        self._counts.append(len(known))
        if self._newest is not None and len(self._counts) > self._newest:
            old = self._counts.pop(0)
            self._ends, self._normals = self._ends[old:], self._normals[old:]
        self._tree = cKDTree(self._ends)

    def share(self, pose: FloatArray, ends: FloatArray) -> float:
        """Return the share of the ends of a scan at a pose that lie near the walls."""
        distances, _ = self._tree.query(ends @ _turn(pose[2]).T + pose[:2], distance_upper_bound=_GATES[-1])
        return float(np.mean(np.isfinite(distances)))

    def fitted(self, guess: FloatArray, ends: FloatArray, prior: FloatArray) -> FloatArray:
        """Return the pose at which the ends of a scan lie on the walls, near to a guess.

        Args:
          guess: pose (3,).
          ends: of beams as seen from the pose (n, 2) [m].
          prior: information of the guess over that of a beam, of x, y and heading (3,).
        """
        pose = guess.copy()
        self.information = np.zeros((3, 3))
        if not len(self._ends):
            return pose
        for gate in _GATES:
            turned = ends @ _turn(pose[2]).T
            distances, nearest = self._tree.query(turned + pose[:2], distance_upper_bound=gate)
            found = np.isfinite(distances)
            if np.count_nonzero(found) < 10:
                continue
            across, arm = self._normals[nearest[found]], turned[found]
            off = np.sum(across * (arm + pose[:2] - self._ends[nearest[found]]), axis=1)
            slopes = np.column_stack((across, across[:, 1] * arm[:, 0] - across[:, 0] * arm[:, 1]))
            weights = 1.0 / np.maximum(np.abs(off) / _RANGE_ERROR, 1.0)  # Huber's
            self.information = (slopes * weights[:, None]).T @ slopes
            matrix = self.information + np.diag(prior)
            pose = pose + np.linalg.solve(matrix, -slopes.T @ (weights * off) + prior * (guess - pose))
        return pose


def walls_seen(sweeps: Sweeps, number: int) -> tuple[FloatArray, FloatArray]:
    """Return the ends of a scan's beams as seen from its pose, (n, 2) [m], and the wall at each, (n, 4).

    Each beam is taken at its own time. A wall is as of `_walls_at`.
    """
    scan = sweeps.scans[number]
    seen = np.flatnonzero((scan.ranges > 0.0) & (scan.ranges < _REACH))
    if len(seen) < 10:
        return np.empty((0, 2)), np.empty((0, 4))
    placed = sweeps.beam_poses(number)[seen]
    angles = placed[:, 2] + scan.bearings[seen]
    ends = placed[:, :2] + scan.ranges[seen, None] * np.column_stack((np.cos(angles), np.sin(angles)))
    x, y, heading = sweeps.poses[number]
    ends = (ends - (x, y)) @ _turn(heading)
    some = np.arange(0, len(seen), max(1, math.ceil(len(seen) / _MOST_BEAMS)))
    return ends[some], _walls_at(ends, some, _AROUND, _STEP, _BENT)


@kernel
def _walls_at(ends: FloatArray, some: NDArray[np.int64], around: float, step: float, bent: float) -> FloatArray:
    """Return the wall at some of the ends of neighbouring beams: x, y [m] and the direction across it, (k, 4).

    A parabola is laid through the ends within `around` [m] to either side: a line would be off where a wall bends, and
    always to the same side. NaN where they have a step, or lie off the parabola.
    """
    count = len(ends)
    found = np.full((len(some), 4), math.nan)
    for k in range(len(some)):
        i = some[k]
        first, last = i, i
        while first > 0 and math.hypot(ends[first - 1, 0] - ends[first, 0], ends[first - 1, 1] - ends[first, 1]) < step:
            if math.hypot(ends[first - 1, 0] - ends[i, 0], ends[first - 1, 1] - ends[i, 1]) > around:
                break
            first -= 1
        while (
            last < count - 1 and math.hypot(ends[last + 1, 0] - ends[last, 0], ends[last + 1, 1] - ends[last, 1]) < step
        ):
            if math.hypot(ends[last + 1, 0] - ends[i, 0], ends[last + 1, 1] - ends[i, 1]) > around:
                break
            last += 1
        if i - first < 2 or last - i < 2:
            continue
        x, y = ends[last, 0] - ends[first, 0], ends[last, 1] - ends[first, 1]
        length = math.hypot(x, y)
        if length < 0.4 * around:
            continue
        x, y = x / length, y / length
        matrix, right = np.zeros((3, 3)), np.zeros(3)
        power = np.ones(3)
        for j in range(first, last + 1):
            along = x * (ends[j, 0] - ends[i, 0]) + y * (ends[j, 1] - ends[i, 1])
            across = x * (ends[j, 1] - ends[i, 1]) - y * (ends[j, 0] - ends[i, 0])
            power[1], power[2] = along, along * along
            for m in range(3):
                right[m] += power[m] * across
                for n in range(3):
                    matrix[m, n] += power[m] * power[n]
        matrix[2, 2] += 1e-9
        fit = np.linalg.solve(matrix, right)
        off = 0.0
        for j in range(first, last + 1):
            along = x * (ends[j, 0] - ends[i, 0]) + y * (ends[j, 1] - ends[i, 1])
            across = x * (ends[j, 1] - ends[i, 1]) - y * (ends[j, 0] - ends[i, 0])
            off += (across - fit[0] - fit[1] * along - fit[2] * along * along) ** 2
        if off > bent * bent * (last - first + 1):
            continue
        slope = math.sqrt(1.0 + fit[1] ** 2)
        found[k, 0], found[k, 1] = ends[i, 0] - y * fit[0], ends[i, 1] + x * fit[0]
        found[k, 2], found[k, 3] = (-y - x * fit[1]) / slope, (x - y * fit[1]) / slope
    return found


def _turn(angle: float) -> FloatArray:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s], [s, c]])


def step_between(start: FloatArray, end: FloatArray) -> FloatArray:
    """Return the step from a pose to another, in the first one's frame."""
    x, y = (end[:2] - start[:2]) @ _turn(start[2])
    return np.array((x, y, math.remainder(end[2] - start[2], math.tau)))


def stepped(pose: FloatArray, step: FloatArray) -> FloatArray:
    """Return the pose that is a step away from another."""
    x, y = pose[:2] + _turn(pose[2]) @ step[:2]
    return np.array((x, y, pose[2] + step[2]))
