"""A course of its two boundaries, which are its walls: the line in the middle, or one that is given."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from fg_mujoco.course.line_file import require_closed
from fg_mujoco.course.polyline import IndexArray, cross, crossings, enclosed_area, resample, segments, step_lengths
from fg_mujoco.course.track import MIN_POINTS
from fg_mujoco.errors import TrackError
from fg_mujoco.messages import FloatArray

_SPACING, _LINE = 0.05, 0.2  # [m] of points on the boundaries, and on the line
_MOST = 20_000  # points on a boundary
_ROUNDS = 6  # in which the line is moved to the middle
_ALONG = 2  # points to either side over which the line is smoothed
_RIGHT_SIDE = 0.9  # least share of the line with one boundary on its left and the other on its right
_BLOCK = 256  # points whose distances are taken at once, to bound the memory


def between_boundaries(
    path: Path, first: FloatArray, second: FloatArray, centre: FloatArray | None = None
) -> tuple[FloatArray, FloatArray, FloatArray, tuple[FloatArray, FloatArray]]:
    """Return the line of a course, its widths and its walls.

    Args:
      path: of the file, for messages.
      first: a boundary, (n, 2) [m], in driving order.
      second: the other, (m, 2) [m], either way round.
      centre: the line, (k, 2) [m]; None: it is made, in the middle.

    Returns:
      The line (k, 2), how far it is to the right and to the left boundary, (k,) each [m], and these, in its direction.

    Raises:
      TrackError: a boundary that is not closed, or boundaries that cross or are not to either side of a line.
    """
    walls, sides = [], []
    for name, points in (("first", first), ("second", second)):
        different = points[step_lengths(points) > 0.0]
        if len(different) < MIN_POINTS:
            said = f"the {name} boundary has {len(different)} different points"
            raise TrackError(f"{path}: {said}; accepted: at least {MIN_POINTS}")
        try:
            require_closed(points)
        except TrackError as error:
            raise TrackError(f"{path}: of the {name} boundary {error}") from error
        points = different
        length = float(step_lengths(points).sum())
        if (enclosed_area(points) > 0.0) != (enclosed_area(first if centre is None else centre) > 0.0):
            points = points[::-1]
        walls.append(points)
        sides.append(resample(points, max(_SPACING, length / _MOST))[0])
    if len(crossed := crossings(segments(walls[0]), segments(walls[1]))[0]):
        x, y = walls[0][crossed[0]].tolist()
        raise TrackError(f"{path}: the boundaries cross near x {x:.2f}, y {y:.2f} m; accepted: two that are apart")
    line = centre if centre is not None else _middle(*sides)
    near = [side[_nearest(line, side)] for side in sides]
    ahead = np.roll(line, -1, axis=0) - np.roll(line, 1, axis=0)
    is_left = [float((cross(ahead, each - line) > 0.0).mean()) for each in near]
    left = int(is_left[1] > is_left[0])
    if is_left[left] < _RIGHT_SIDE or is_left[1 - left] > 1.0 - _RIGHT_SIDE:
        raise TrackError(
            f"{path}: the boundaries are not to either side of a line: one is to the left of "
            f"{is_left[left]:.0%} of it, the other to the right of {1.0 - is_left[1 - left]:.0%}; "
            "accepted: the two of one course"
        )
    widths = [np.hypot(*(each - line).T) for each in near]
    return line, widths[1 - left], widths[left], (walls[1 - left], walls[left])


def _middle(first: FloatArray, second: FloatArray) -> FloatArray:
    """Return the line in the middle between two boundaries, in the order of the first."""
    outer, inner = (first, second) if step_lengths(first).sum() > step_lengths(second).sum() else (second, first)
    line = 0.5 * (outer + inner[_nearest(outer, inner)])
    for _ in range(_ROUNDS):
        line = resample(line[step_lengths(line) > 1e-6], _LINE)[0]
        line = _smoothed(line)
        to = [side[_nearest(line, side)] - line for side in (outer, inner)]
        apart = [np.maximum(np.hypot(*each.T), 1e-9)[:, None] for each in to]
        line = line + 0.5 * (apart[0] - apart[1]) * (to[0] / apart[0] - to[1] / apart[1]) / 2.0
    return _smoothed(_smoothed(line))  # of the steps between the points of the boundaries


def _smoothed(line: FloatArray) -> FloatArray:
    return np.asarray(np.mean([np.roll(line, k, axis=0) for k in range(-_ALONG, _ALONG + 1)], axis=0))


def _nearest(points: FloatArray, others: FloatArray) -> IndexArray:
    """Return which of others (m, 2) is nearest to each point (n, 2). Shape (n,)."""
    found = np.empty(len(points), dtype=np.int64)
    for k in range(0, len(points), _BLOCK):
        block = points[k : k + _BLOCK, None]
        found[k : k + _BLOCK] = np.argmin(((block - others) ** 2).sum(axis=2), axis=1)
    return found
