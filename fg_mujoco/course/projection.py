"""Progress of a point along the line of a course, and its offset: where on the line a car is.

Progress is that of the nearest place, from a hint on. This fails on the inside of a bend whose radius is smaller than
the distance to the inner wall: the nearest place leaps there from one arm of the bend to the other, or stays behind on
the arm that the car came by. Such a stretch has sections: lines from each of its places to the nearest point of the
inner wall. The progress of a point is that of the section on which it lies. Two sections never cross, as both are
shortest ways to the same wall, so that progress is continuous. At the tip of a wall they form a fan.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import portable
from ..messages import FloatArray
from ..native import core
from .polyline import IndexArray, cross, nearby, runs

_STEP = 0.1  # [m] between sections, at most
_AROUND = 4.0  # distances to the wall: so far round a bend its sections may begin and end
_SINGULAR = 0.1  # [m] by which the line is nearer to a section's end than its foot is, where a stretch has sections
_ORDINARY = 1e-3  # [m] the same, where such a stretch begins and ends
_LEAP = 0.2  # [m] half of what the nearest place may leap at a corner of the line; smaller leaps are found all the same

follow = core.follow
"""Project a point x, y [m] from a hint: the nearest in a window, which moves on while the nearest is at its edge.

Its arguments are x, y, the progress shortly before [m], and `table` and `modulus` of the Course. Returns the progress
in [0, modulus) [m], and the offset [m], left positive: the distance to the nearest place."""


def progress_by_sections(
    points: FloatArray, s: FloatArray, offset: FloatArray, table: FloatArray, modulus: float
) -> FloatArray:
    """Return the progress of points (k, 2) whose nearest places `s` (k,) and offsets from there (k,) are known [m]."""
    if len(table) == 6:
        return s
    segment = np.searchsorted(table[0], s, side="right") - 1
    given = zip(points.tolist(), s.tolist(), segment.tolist(), (offset > 0.0).tolist(), strict=True)
    return np.array([core.by_sections(x, y, at, i, table, on_left) for (x, y), at, i, on_left in given]) % modulus


def project_near(
    points: FloatArray, near: ArrayLike, table: FloatArray, modulus: float
) -> tuple[FloatArray, FloatArray]:
    """Return progress and offset of points (k, 2) from hints, a number or shape (k,) [m]. Shape (k,) [m] each."""
    hints = np.broadcast_to(np.asarray(near, float), len(points)).tolist()
    rows = [follow(x, y, hint, table, modulus) for (x, y), hint in zip(points.tolist(), hints, strict=True)]
    found = np.array(rows, dtype=np.float64).reshape(-1, 2)
    return found[:, 0], found[:, 1]


def with_sections(
    lap: FloatArray, period: float | None, walls: Callable[[], Sequence[FloatArray]], reach: ArrayLike
) -> FloatArray:
    """Return the segments of a line for `follow`, with sections where the inside of a bend needs them.

    Args:
      lap: s, x, y, dx, dy, length^2 of each segment, of one lap of a loop. Shape (6, k).
      period: length of a lap [m]; None: the line is open.
      walls: returns the segments of the walls on the left and on the right, (m, 2, 2) [m]; called only where a bend is
        tight.
      reach: distance to the walls at the start of each segment, at most, a number or shape (k,) [m].

    Returns:
      The same, where no bend needs sections. Else shape (10, n): there the segments are finer, and the last rows are x
      and y of the section's end on the left, and on the right, at the start of each segment; NaN where there is none.
    """
    reach = np.broadcast_to(np.asarray(reach, np.float64), lap.shape[1])
    is_bend = [_is_tight(lap, period, reach, side) for side in (1.0, -1.0)]
    bends = np.flatnonzero(is_bend[0] | is_bend[1])
    if not len(bends):
        return lap
    apart = _apart(lap[0][:, None], lap[0, bends], period)
    farthest = float(reach[bends].max())
    parts = np.maximum(np.ceil(np.sqrt(lap[5]) / _STEP), 1.0).astype(int)
    parts[(apart > _AROUND * farthest).all(axis=1)] = 1
    fine = _divided(lap, parts)
    ends = np.vstack(
        [_section_ends(fine, period, wall, side, farthest) for wall, side in zip(walls(), (1.0, -1.0), strict=True)]
    )
    segment = np.repeat(np.arange(len(parts)), parts)
    used = np.zeros(len(parts), np.bool_)
    used[segment[~np.isnan(ends).all(axis=0)]] = True
    if not used.any():
        return lap
    kept = used[segment] | (np.diff(segment, prepend=-1) > 0)
    return np.vstack((_divided(lap, np.where(used, parts, 1)), ends[:, kept]))


def _divided(lap: FloatArray, parts: IndexArray) -> FloatArray:
    """Return segments (6, k), each cut in so many equal parts (k,)."""
    s, x, y, dx, dy, squared = np.repeat(lap, parts, axis=1)
    count = np.repeat(parts, parts)
    share = (np.arange(len(count)) - np.repeat(np.cumsum(parts) - parts, parts)) / count
    return np.vstack(
        (s + share * np.sqrt(squared), x + share * dx, y + share * dy, dx / count, dy / count, squared / count**2)
    )


def _apart(s: FloatArray, other: FloatArray, period: float | None) -> FloatArray:
    """Return how far places are apart along the line [m]."""
    apart = np.abs(s - other)
    return apart if period is None else np.minimum(apart, period - apart)


def _is_tight(lap: FloatArray, period: float | None, reach: FloatArray, side: float) -> NDArray[np.bool_]:
    """Return at which starts of segments the line turns to a side so that a line there, `reach` away, would fold."""
    ahead, lengths = lap[3:5].T, np.sqrt(lap[5])
    before = np.roll(ahead, 1, axis=0)
    turn = side * portable.arctan2(cross(before, ahead), np.sum(before * ahead, axis=1))
    if period is None:
        turn[0] = 0.0
    step = 0.5 * (lengths + np.roll(lengths, 1))
    return np.asarray(reach * portable.tan(0.5 * turn) > np.minimum(0.5 * step, _LEAP))


def _section_ends(fine: FloatArray, period: float | None, wall: FloatArray, side: float, reach: float) -> FloatArray:
    """Return the ends (2, k) of the sections on a side at the starts of segments (6, k), NaN where none is needed."""
    s, points = fine[0], fine[1:3].T
    line = np.stack((points, points + fine[3:5].T), axis=1)
    distance, ends = _nearest(points, wall, reach)
    to_line, _ = _nearest(ends, line, reach, lambda i, j: _apart(s[i], s[j], period) < 2.0 * _AROUND * reach)
    distance = np.where(np.isfinite(distance), distance, 0.0)
    excess = distance - to_line  # of an end that is not known -inf
    is_tight = _is_tight(fine, period, distance, side)
    needed = excess > _ORDINARY
    for first, size in zip(*runs(needed), strict=True):
        run = (first + np.arange(size)) % len(points)
        needed[run] = excess[run].max() > _SINGULAR and is_tight[run].any()
    return np.where(needed, ends.T, np.nan)


def _nearest(
    points: FloatArray,
    lines: FloatArray,
    reach: float,
    belongs: Callable[[IndexArray, IndexArray], NDArray[np.bool_]] | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Return the distances (n,) of points (n, 2) to the nearest of lines (m, 2, 2), and where that is (n, 2) [m].

    It is looked for within `reach` [m], then up to _AROUND times as far; else inf and NaN. `belongs` says who counts.
    """
    least, found = np.full(len(points), np.inf), np.full((len(points), 2), np.nan)
    pending = np.arange(len(points))
    for within in (reach, 2.0 * reach, _AROUND * reach):
        i, j = nearby(np.stack((points[pending],) * 2, axis=1), lines, within)
        i = pending[i]
        if belongs is not None:
            counts = belongs(i, j)
            i, j = i[counts], j[counts]
        start, along = lines[j, 0], lines[j, 1] - lines[j, 0]
        squared = np.maximum(np.sum(along * along, axis=1), 1e-300)
        share = np.clip(np.sum((points[i] - start) * along, axis=1) / squared, 0.0, 1.0)
        feet = start + share[:, None] * along
        distances = np.hypot(*(feet - points[i]).T)
        order = np.lexsort((distances, i))
        first = order[np.diff(i[order], prepend=-1) > 0]
        least[i[first]], found[i[first]] = distances[first], feet[first]
        pending = pending[~(least[pending] <= within)]
    return least, found
