"""Geometry of closed polylines in the plane: (n, 2) points in order, the first not repeated.

Segment i runs from point i to point i + 1.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from .. import portable
from ..messages import FloatArray
from ..native import core

MOST_POINTS = 200_000
"""Of a line: work on it grows with its points."""

IndexArray = NDArray[np.intp]

_BLOCK = 32  # consecutive segments that share one bounding box in `nearby`: neighbours along a line are near in space


def steps(points: FloatArray) -> FloatArray:
    """Vectors from each point to the next, round the loop. Shape (n, 2) [m]."""
    return np.roll(points, -1, axis=0) - points


def step_lengths(points: FloatArray) -> FloatArray:
    """Length of each segment. Shape (n,) [m]."""
    return np.asarray(np.hypot(*steps(points).T))


def segments(points: FloatArray) -> FloatArray:
    """Both ends of each segment. Shape (n, 2, 2) [m]."""
    return np.stack((points, np.roll(points, -1, axis=0)), axis=1)


def turns(points: FloatArray) -> FloatArray:
    """Change of heading at each point, left positive, within +-pi. Shape (n,) [rad]."""
    after = steps(points)
    before = np.roll(after, 1, axis=0)
    return np.asarray(portable.arctan2(cross(before, after), np.sum(before * after, axis=1)))


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the z component of the cross product: positive where `b` is to the left of `a`. Shape (...,)."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def enclosed_area(points: FloatArray) -> float:
    """Area inside, counterclockwise positive [m^2] (the shoelace formula)."""
    return 0.5 * float(np.sum(cross(points, np.roll(points, -1, axis=0))))


def is_inside(points: FloatArray, loops: Iterable[FloatArray]) -> NDArray[np.bool_]:
    """Return which points (n, 2) lie inside an odd number of closed polylines, as between the walls of a course."""
    px, py = points.T[:, :, None]
    inside = np.zeros(len(points), dtype=np.bool_)
    for loop in loops:
        (x, y), (next_x, next_y) = np.moveaxis(segments(loop), 0, -1)
        passes = (y > py) != (next_y > py)  # a ray along x from a point crosses the line of this segment
        with np.errstate(divide="ignore", invalid="ignore"):
            beyond = x + (py - y) * (next_x - x) / (next_y - y) > px
        inside ^= np.count_nonzero(passes & beyond, axis=1) % 2 == 1
    return inside


def nearby(first: FloatArray, second: FloatArray, reach: float = 0.0) -> tuple[IndexArray, IndexArray]:
    """Find which segments (n, 2, 2), best in order along a line, and (m, 2, 2) have bounding boxes within `reach` [m].

    These are the candidates of any pairwise test, without all n x m of them: indices into both, shape (k,) each.
    """
    first, second = np.ascontiguousarray(first, np.float64), np.ascontiguousarray(second, np.float64)
    low, high = first.min(axis=1) - reach, first.max(axis=1) + reach
    other_low, other_high = second.min(axis=1), second.max(axis=1)
    starts = np.arange(0, len(second), _BLOCK)
    if len(first) == 0 or len(second) == 0:
        return np.empty(0, dtype=np.intp), np.empty(0, dtype=np.intp)
    blocks_low, blocks_high = np.minimum.reduceat(other_low, starts), np.maximum.reduceat(other_high, starts)
    boxes = low, high, other_low, other_high, blocks_low, blocks_high
    none = np.empty(0, dtype=np.intp)
    count = core.overlaps(*boxes, none, none)
    found_first, found_second = np.empty(count, dtype=np.intp), np.empty(count, dtype=np.intp)
    core.overlaps(*boxes, found_first, found_second)
    return found_first, found_second


def crossings(first: FloatArray, second: FloatArray) -> tuple[IndexArray, IndexArray]:
    """Find which of `first` (n, 2, 2) cross or touch which of `second` (m, 2, 2): indices into both, (k,) each."""
    i, j = nearby(first, second)
    (a, b), (c, d) = np.moveaxis(first[i], 1, 0), np.moveaxis(second[j], 1, 0)
    straddles = cross(b - a, c - a) * cross(b - a, d - a) <= 0.0
    straddled = cross(d - c, a - c) * cross(d - c, b - c) <= 0.0
    return i[straddles & straddled], j[straddles & straddled]


def self_crossings(points: FloatArray) -> tuple[IndexArray, IndexArray]:
    """Find the pairs of segments i < j that cross or touch, other than neighbours at their common point."""
    own = segments(points)
    i, j = crossings(own, own)
    apart = (j - i > 1) & (j - i < len(points) - 1)
    return i[apart], j[apart]


def meeting_point(first: FloatArray, second: FloatArray) -> FloatArray | None:
    """Return the point (2,) [m] where two segments (2, 2) cross or touch; None where they do not, or are parallel."""
    along, other = first[1] - first[0], second[1] - second[0]
    scale = float(cross(along, other))
    if scale == 0.0:
        return None
    share = float(cross(second[0] - first[0], other)) / scale
    other_share = float(cross(second[0] - first[0], along)) / scale
    return first[0] + share * along if 0.0 <= share <= 1.0 and 0.0 <= other_share <= 1.0 else None


def runs(marked: NDArray[np.bool_]) -> tuple[IndexArray, IndexArray]:
    """First point and number of points of each run of marked ones, round the loop. Shape (k,) each."""
    if marked.all():
        return np.zeros(1, dtype=np.intp), np.full(1, len(marked))
    first = np.flatnonzero(marked & ~np.roll(marked, 1))
    after = np.flatnonzero(~marked & np.roll(marked, 1))
    if len(first) and after[0] < first[0]:
        after = np.roll(after, -1)
    return first, (after - first) % len(marked)


def resample(points: FloatArray, spacing: float, *columns: FloatArray) -> tuple[FloatArray, ...]:
    """Resample at even steps of arc length, nearest to `spacing` [m] that divide the loop; the first point stays.

    The columns are values at the points (n,), and are interpolated linearly. Returns points (m, 2) and columns (m,).
    """
    at = np.concatenate(([0.0], np.cumsum(step_lengths(points))))
    count = max(3, round(at[-1] / spacing))
    wanted = np.arange(count) * (at[-1] / count)
    x, y, *others = (np.interp(wanted, at, np.append(v, v[0])) for v in (points[:, 0], points[:, 1], *columns))
    return np.column_stack((x, y)), *others


def subdivide(points: FloatArray, spacing: float, *columns: FloatArray) -> tuple[FloatArray, ...]:
    """Split segments longer than `spacing` [m] evenly; every point stays. Arguments and result as `resample`."""
    parts = np.maximum(1, np.ceil(step_lengths(points) / spacing - 1e-9)).astype(int)
    first = np.repeat(np.arange(len(points)), parts)
    share = (np.arange(len(first)) - np.repeat(np.cumsum(parts) - parts, parts)) / np.repeat(parts, parts)
    second = (first + 1) % len(points)
    divided = (v[first] * (1.0 - share) + v[second] * share for v in (points[:, 0], points[:, 1], *columns))
    x, y, *others = divided
    return np.column_stack((x, y)), *others


def simplify(points: FloatArray, tolerance: float, outline: FloatArray | None = None) -> tuple[IndexArray, FloatArray]:
    """Choose so many points of a closed polyline that all of `outline`, one for each point, are within `tolerance` [m].

    Method: Douglas and Peucker 1973, on the two halves between two far corners; the first point may go, too. Returns
    the places of the chosen, which go on beyond the last, (k,), and the chosen (k, 2). Without an outline it is itself.
    """
    first = int(np.argmax(np.hypot(*(points - points.mean(axis=0)).T)))
    outline, points = (np.roll(each, -first, axis=0) for each in (points if outline is None else outline, points))
    count, opposite = len(points), int(np.argmax(np.hypot(*(points - points[0]).T)))
    outline, points = (np.vstack((each, each[:1])) for each in (outline, points))
    kept = {0, opposite}
    pending = [(0, opposite), (opposite, count)]
    while pending:
        low, high = pending.pop()
        away = distance_to_segment(outline[low + 1 : high], points[low], points[high])
        if len(away) and away.max() > tolerance:
            middle = low + 1 + int(np.argmax(away))
            kept.add(middle)
            pending += [(low, middle), (middle, high)]
    chosen = np.array(sorted(kept))
    return chosen + first, points[chosen]


def distance_to_segment(points: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    """Distance of each point to its segment, `start` to `end` of shape (2,) or (n, 2). Shape (n,) [m]."""
    along = end - start
    squared = np.maximum(np.sum(along * along, axis=-1), 1e-300)
    share = np.clip(np.sum((points - start) * along, axis=-1) / squared, 0.0, 1.0)
    return np.asarray(np.hypot(*(points - start - share[..., None] * along).T))


def rounded_polygon(corners: FloatArray, radii: FloatArray, spacing: float = 0.05) -> FloatArray:
    """Polygon whose corners (n, 2) are replaced by tangent arcs of `radii` (n,), 0 for none [m].

    Shape (m, 2) [m], from the end of the first corner's arc on, in steps of `spacing` [m] along the arcs.
    """
    angle = turns(corners)
    after = steps(corners) / step_lengths(corners)[:, None]
    before = np.roll(after, 1, axis=0)
    reach = radii * portable.tan(np.abs(angle) / 2.0)  # from the corner to where its arc begins and ends
    if np.any(reach + np.roll(reach, -1) > step_lengths(corners) + 1e-9):
        raise ValueError("the arcs of two corners overlap")
    pieces = []
    for corner, turn, radius, inward, start in zip(corners, angle, radii, before, reach, strict=True):
        count = max(1, math.ceil(radius * abs(turn) / spacing))
        swept = turn * np.arange(count + 1) / count if radius > 0.0 else np.zeros(1)
        left = math.copysign(1.0, turn) * np.array([-inward[1], inward[0]])
        arc = radius * (portable.sin(np.abs(swept))[:, None] * inward + (1.0 - portable.cos(swept))[:, None] * left)
        pieces.append(corner - start * inward + arc)
    points = np.roll(np.concatenate(pieces), 1 - len(pieces[0]), axis=0)
    return points[step_lengths(points) > 1e-9]


def smooth(points: FloatArray, sigma: float, spacing: float) -> FloatArray:
    """Even out curvature: the loop at even steps near `spacing` [m], averaged over a Gaussian of `sigma` [m].

    Arcs and straights come out joined by easements; a straight longer than a few sigma stays straight.
    """
    (even,) = resample(points, spacing)
    length = float(step_lengths(even).sum())
    waves = np.fft.rfftfreq(len(even), d=length / len(even))  # [1/m]
    kernel = portable.exp(-2.0 * (np.pi * sigma * waves) ** 2)  # the transform of a Gaussian
    return np.fft.irfft(np.fft.rfft(even, axis=0) * kernel[:, None], n=len(even), axis=0)


def spline(points: FloatArray, spacing: float, *columns: FloatArray) -> tuple[FloatArray, ...]:
    """Resample on the periodic cubic spline through the points, over chord length.

    Arguments and result as `resample`; the columns are interpolated linearly, so that they keep their bounds.
    """
    chords = step_lengths(points)
    curvature = _spline_second_derivatives(points, chords)
    fine = 0.1 * spacing  # the linear interpolation that follows is then true to a hundredth of the spline's own bend
    parts = np.maximum(1, np.ceil(chords / fine)).astype(int)
    i = np.repeat(np.arange(len(points)), parts)
    share = (np.arange(len(i)) - np.repeat(np.cumsum(parts) - parts, parts)) / np.repeat(parts, parts)
    j, h = (i + 1) % len(points), chords[i]
    low, high = 1.0 - share, share
    bend_low, bend_high = (low**3 - low) * h * h / 6.0, (high**3 - high) * h * h / 6.0
    dense = low[:, None] * points[i] + high[:, None] * points[j]
    dense += bend_low[:, None] * curvature[i] + bend_high[:, None] * curvature[j]
    return resample(dense, spacing, *(low * column[i] + high * column[j] for column in columns))


def _spline_second_derivatives(points: FloatArray, chords: FloatArray) -> FloatArray:
    """Second derivatives that make the cubic spline smooth: a cyclic tridiagonal system, by Sherman and Morrison."""
    before = np.roll(chords, 1)
    diagonal = 2.0 * (before + chords)
    slopes = steps(points) / chords[:, None]
    right = 6.0 * (slopes - np.roll(slopes, 1, axis=0))
    corner, gamma = before[0], -diagonal[0]  # what couples the last point and the first
    diagonal[0] -= gamma
    diagonal[-1] -= corner * corner / gamma
    rank_one = np.zeros((len(points), 1))
    rank_one[0, 0], rank_one[-1, 0] = gamma, corner
    solved = _solve_tridiagonal(before, diagonal, chords, np.hstack((right, rank_one)))
    solution, response = solved[:, :2], solved[:, 2]
    tied = solution[0] + solution[-1] * corner / gamma
    solution -= response[:, None] * (tied / (1.0 + response[0] + response[-1] * corner / gamma))
    return solution


def _solve_tridiagonal(below: FloatArray, diagonal: FloatArray, above: FloatArray, right: FloatArray) -> FloatArray:
    """Thomas' algorithm; `below[0]` and `above[-1]` are not used. Shapes (n,), (n,), (n,), (n, k) -> (n, k)."""
    pivot, result = diagonal.copy(), right.copy()
    for k in range(1, len(pivot)):
        factor = below[k] / pivot[k - 1]
        pivot[k] -= factor * above[k - 1]
        result[k] -= factor * result[k - 1]
    result[-1] /= pivot[-1]
    for k in range(len(pivot) - 2, -1, -1):
        result[k] = (result[k] - above[k] * result[k + 1]) / pivot[k]
    return result
