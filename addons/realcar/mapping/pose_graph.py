"""Poses and the steps between them, laid out by least squares: odometry's chain, and places that were seen again.

    graph = close_loops(sweeps, numbers, poses)
    graph.poses                             # of the scans `numbers`, corrected

1. Key poses are those of scans some way apart. Neighbours are tied by the step that scan matching found.
2. Where the car comes back to a place, its scan is laid on the walls that were seen from there, from the guess on or,
   where it does not fit then, from places round it, as far away as the chain may have drifted. Where it fits, a step
   ties the two poses. Its errors are those of the fit: along a corridor it ties them loosely.
3. All poses are laid out anew by Gauss and Newton's method, with the weight of a step that does not fit reduced.

Sources: G. Grisetti et al., A Tutorial on Graph-Based SLAM, IEEE Intelligent Transportation Systems Magazine 2(4),
2010.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fg_mujoco.messages import FloatArray

from .scan_matching import Walls, key_scans, step_between, stepped, walls_seen
from .sweeps import Sweeps

_CHAIN_ERROR = (0.004, 0.02, 0.0015, 0.02)  # [m] and share of the way, [rad] and share of the turn
_LOOP_ERROR, _LOOSEST = (0.02, 0.004), 1.0  # [m], [rad] at least; [m], [rad] at most
_MATCH_ERROR = 0.1  # [m] of a beam: those of a scan err together, and with the walls that they are laid on
_HUBER = 2.0  # standard deviations of a step, beyond which it counts less
_APART = 8.0  # [m] of way, at least, between a place and coming back to it
_NEAR, _DRIFT = 1.0, 0.02  # [m] from a place, at most, and more by this share of the way before a loop is closed
_TURNED = 0.6  # [rad] from the heading there
_AROUND = 10  # key poses to either side, whose walls a scan is laid on
_SPREAD = 0.4  # [m] between the guesses that a scan is laid down from
_FITS = 0.8  # share of a scan's ends that lie on the walls, from which on a loop closes
_EVERY = 8  # loops, after which all poses are laid out anew
_ROUNDS, _STEP = 20, 1e-6  # of Gauss and Newton, and the greatest change that ends them [m], [rad]


@dataclass(frozen=True, kw_only=True, eq=False)
class PoseGraph:
    """Poses of the LiDAR, and the steps between them."""

    poses: FloatArray  # (n, 3) x [m], y [m], heading [rad]
    ends: FloatArray  # (k, 2) the poses that a step ties, by number, as whole numbers
    steps: FloatArray  # (k, 3) from the first pose to the second, in the frame of the first
    errors: FloatArray  # (k, 3) standard deviations
    loops: int  # steps that close a loop
    corrected: FloatArray  # (m, 3) all poses that were given, the key poses among them


def laid_out(poses: FloatArray, ends: FloatArray, steps: FloatArray, errors: FloatArray) -> FloatArray:
    """Return the poses (n, 3) that agree best with the steps between them; the first stays.

    Args:
      poses: a guess.
      ends: (k, 2) the poses that each step ties, by number.
      steps: (k, 3) in the frame of the first.
      errors: (k, 3) standard deviations of the steps.
    """
    from scipy import sparse
    from scipy.sparse.linalg import spsolve

    found, count = poses.copy(), len(poses)
    first, second = ends.astype(int).T
    rows = np.repeat(3 * np.arange(len(ends)), 9).reshape(-1, 3, 3) + np.arange(3)[:, None]
    for _ in range(_ROUNDS):
        cos, sin = np.cos(found[first, 2]), np.sin(found[first, 2])
        dx, dy = (found[second, :2] - found[first, :2]).T
        ahead, left = cos * dx + sin * dy, cos * dy - sin * dx
        off = np.column_stack((ahead, left, found[second, 2] - found[first, 2])) - steps
        off[:, 2] -= 2.0 * np.pi * np.round(off[:, 2] / (2.0 * np.pi))
        length = np.sqrt(np.sum((off / errors) ** 2, axis=1))
        scale = np.sqrt(np.minimum(1.0, _HUBER / np.maximum(length, 1e-12)))[:, None] / errors
        by_first, by_second = np.zeros((2, len(ends), 3, 3))
        by_second[:, 0, 0], by_second[:, 0, 1] = cos, sin
        by_second[:, 1, 0], by_second[:, 1, 1], by_second[:, 2, 2] = -sin, cos, 1.0
        by_first[:] = -by_second
        by_first[:, 0, 2], by_first[:, 1, 2] = left, -ahead
        blocks = [(scale[:, :, None] * block) for block in (by_first, by_second)]
        across = np.arange(3)[None, None, :] + np.zeros((1, 3, 1), int)
        columns = [3 * which[:, None, None] + across for which in (first, second)]
        jacobian = sparse.csr_matrix(
            (
                np.concatenate([block.ravel() for block in blocks]),
                (np.tile(rows.ravel(), 2), np.concatenate([column.ravel() for column in columns])),
            ),
            shape=(3 * len(ends), 3 * count),
        )[:, 3:]
        change = spsolve((jacobian.T @ jacobian).tocsc(), -jacobian.T @ (scale * off).ravel()).reshape(-1, 3)
        found[1:] += change
        if np.abs(change).max(initial=0.0) < _STEP:
            break
    return found


def close_loops(sweeps: Sweeps, numbers: list[int], poses: FloatArray) -> PoseGraph:
    """Return the graph of matched scans, with loops closed.

    Args:
      sweeps: the scans.
      numbers: of those that were matched.
      poses: of the LiDAR at each, (m, 3), from a chain of steps that closes no loop.
    """
    keys = key_scans(poses)
    given = poses[keys]
    seen = [walls_seen(sweeps, numbers[key]) for key in keys]
    ways = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(poses[:, :2], axis=0).T))))[keys]
    ends = [(k, k + 1) for k in range(len(keys) - 1)]
    steps = [step_between(given[k], given[k + 1]) for k in range(len(keys) - 1)]
    errors = [_chain_errors(step) for step in steps]
    found, loops, fresh = given.copy(), 0, 0
    for k in range(1, len(keys)):
        found[k] = stepped(found[k - 1], steps[k - 1])
        again = _place_again(found, ways, k, loops > 0)
        if again is None:
            continue
        tie = _laid_on(found, seen, again, k, _reach(ways[k] - ways[again], loops > 0))
        if tie is None:
            continue
        ends.append((again, k))
        steps.append(tie[0])
        errors.append(tie[1])
        loops, fresh = loops + 1, fresh + 1
        if loops == 1 or fresh == _EVERY or k == len(keys) - 1:
            known = np.array([j for j in range(len(ends)) if max(ends[j]) <= k])
            tied = [np.asarray(part, np.float64)[known] for part in (ends, steps, errors)]
            found[: k + 1], fresh = laid_out(found[: k + 1], *tied), 0
    arrays = [np.asarray(part, np.float64).reshape(-1, width) for part, width in ((ends, 2), (steps, 3), (errors, 3))]
    if loops:
        found = laid_out(found, *arrays)
    corrected = poses.copy()
    for k, key in enumerate(keys):
        until = keys[k + 1] if k + 1 < len(keys) else len(poses)
        for number in range(key, until):
            corrected[number] = stepped(found[k], step_between(given[k], poses[number]))
    ends_, steps_, errors_ = arrays
    return PoseGraph(poses=found, ends=ends_, steps=steps_, errors=errors_, loops=loops, corrected=corrected)


def _chain_errors(step: FloatArray) -> FloatArray:
    place = _CHAIN_ERROR[0] + _CHAIN_ERROR[1] * math.hypot(step[0], step[1])
    return np.array((place, place, _CHAIN_ERROR[2] + _CHAIN_ERROR[3] * abs(step[2])))


def _reach(way: float, closed: bool) -> float:
    """Return how far a pose may be off from a place that was seen so much way before [m]."""
    return _NEAR + (0.0 if closed else _DRIFT * way)


def _place_again(found: FloatArray, ways: FloatArray, k: int, closed: bool) -> int | None:
    """Return the key pose that the car has come back to; None: none is near."""
    before = np.flatnonzero(ways[k] - ways[:k] > _APART)
    if not len(before):
        return None
    apart = np.hypot(*(found[before, :2] - found[k, :2]).T)
    turned = np.abs(np.remainder(found[before, 2] - found[k, 2] + math.pi, math.tau) - math.pi)
    reach = _NEAR + (0.0 if closed else 1.0) * _DRIFT * (ways[k] - ways[before])
    near = (apart < reach) & (turned < _TURNED)
    return int(before[near][np.argmin(apart[near])]) if near.any() else None


def _laid_on(
    found: FloatArray, seen: list[tuple[FloatArray, FloatArray]], again: int, k: int, reach: float
) -> tuple[FloatArray, FloatArray] | None:
    """Return the step from a key pose to another one, whose scan lies on the walls seen from there, and its errors.

    None: the scan does not lie on them.

    Args:
      found: key poses.
      seen: ends and walls of their scans.
      again: the first pose.
      k: the other one.
      reach: how far it may be from where it is taken to be [m].
    """
    walls = Walls()
    for other in range(max(again - _AROUND, 0), min(again + _AROUND + 1, k - 2 * _AROUND)):
        walls.add(step_between(found[again], found[other]), seen[other][1])
    guess, ends = step_between(found[again], found[k]), seen[k][0]
    if not len(ends) or not walls:
        return None
    free = np.full(3, 1e-6)
    count = math.ceil(reach / _SPREAD) if reach > _NEAR else 0
    around = [(i, j) for i in range(-count, count + 1) for j in range(-count, count + 1) if math.hypot(i, j) <= count]
    for ahead, aside in sorted(around, key=lambda place: math.hypot(*place)):
        pose = walls.fitted(guess + np.array((_SPREAD * ahead, _SPREAD * aside, 0.0)), ends, free)
        if walls.share(pose, ends) > _FITS:
            variance = np.diag(np.linalg.inv(walls.information / _MATCH_ERROR**2 + np.eye(3) / _LOOSEST**2))
            least = np.array((_LOOP_ERROR[0], _LOOP_ERROR[0], _LOOP_ERROR[1]))
            return pose, np.maximum(np.sqrt(variance), least)
    return None
