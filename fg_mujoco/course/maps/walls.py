"""The walls of a map: the edge of a region of pixels, as closed polylines, and the holes in them.

    outer, *holes = outlines(region)         # through the middle of each pixel's edge
    wall = trace(outer)                      # of few points, within TOLERANCE of it
    hole = find_hole(clearance, inside, border)

The polylines are contours by marching squares (W. Lorensen, H. Cline, 1987): through the middles of the edges between
pixels of the region and other pixels, so that a slanted wall is a line and not stairs. The region is to the left of
each. Pixels that meet at a corner only are not connected.

Corners are fitted to the outline: scikit-image's approximate_polygon leaves two to three times as many.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ... import portable
from ...messages import FloatArray
from ..polyline import IndexArray, distance_to_segment, enclosed_area, self_crossings, simplify
from .map_server import BoolArray

TOLERANCE = 0.5
"""Greatest distance of a wall from the middle of a pixel's edge that it represents, in pixels."""

_SMOOTHING = 3.0  # [points] of an outline, standard deviation: evens out the stairs of a slanted wall
_MOST_MOVED = 0.4  # [pixel] by it; less than TOLERANCE, so that corners stay
_STAY = 1e-3  # weight of a corner's place relative to that of a point of the outline, so that all are defined
_SLACK = 1e-6  # [pixel] in comparisons with the tolerance
_HALVINGS = 6  # of the tolerance, for what is smaller than it
MOST_DENSE = 2000  # corners of a wall at most, whose equations are solved as a full matrix: of more it takes minutes
_KEPT_AREA = 0.95  # of what an outline encloses, at least: obstacles of a few pixels stay as large as they are
_TILT = 1e-4  # [pixel] less than clearances differ by: between two doors of one width, the room is not divided


def outlines(region: BoolArray) -> list[FloatArray]:
    """Return the edges of a region of pixels (rows, columns), row 0 below, the longest first.

    Closed polylines (n, 2), columns and rows in pixels from the lower left corner: the region's outer edge is
    counterclockwise, its holes are clockwise.
    """
    from skimage.measure import find_contours

    found = find_contours(np.pad(region, 1).astype(np.float64), 0.5)  # rows and columns of the pixels' middles
    loops = [_from_lowest(loop[:-1, ::-1] - 0.5) for loop in found]
    return sorted(loops, key=lambda loop: (-len(loop), *loop[0, ::-1]))


def _from_lowest(loop: FloatArray) -> FloatArray:
    """Return a loop from the lowest of the lower edges of pixels of the region on: walls depend on where it begins."""
    x, y = loop.T
    is_lower = (y % 1.0 == 0.0) & (np.roll(x, -1) > np.roll(x, 1))
    return np.roll(loop, -np.lexsort((x, y, ~is_lower))[0], axis=0)


def trace(outline: FloatArray, tolerance: float = TOLERANCE) -> FloatArray:
    """Return a closed polyline of fewer points, at most a tolerance [pixel] from each point of an outline (n, 2).

    What is so small or thin that it would vanish or cross itself is traced more finely.
    """
    area = enclosed_area(outline)
    for _ in range(_HALVINGS):
        start, wall = simplify(_smoothed(outline, tolerance * _MOST_MOVED / TOLERANCE), tolerance, outline)
        wall = _fitted(np.roll(outline, -start[0], axis=0), start - start[0], wall, tolerance)
        if len(wall) >= 3 and enclosed_area(wall) / area >= _KEPT_AREA and len(self_crossings(wall)[0]) == 0:
            return wall
        tolerance *= 0.5
    return outline


def _smoothed(outline: FloatArray, most: float) -> FloatArray:
    """Return the points of an outline, averaged with their neighbours, but none moved by more than `most` [pixel]."""
    waves = np.fft.rfftfreq(len(outline))
    gaussian = portable.exp(-2.0 * (np.pi * _SMOOTHING * waves) ** 2)
    move = np.fft.irfft(np.fft.rfft(outline, axis=0) * gaussian[:, None], n=len(outline), axis=0) - outline
    length = np.hypot(*move.T)[:, None]
    return np.asarray(outline + move * np.minimum(1.0, most / np.maximum(length, 1e-12)))


def _fitted(outline: FloatArray, chosen: IndexArray, wall: FloatArray, tolerance: float) -> FloatArray:
    """Fit the corners of a wall to the outline in the least squares; those beyond `tolerance` go back by halves."""
    count = len(chosen)
    if count < 3:
        return wall
    sizes = np.diff(np.append(chosen, len(outline)))
    side = np.repeat(np.arange(count), sizes)
    share = (np.arange(len(outline)) - chosen[side]) / sizes[side]
    following = (side + 1) % count
    # each point of the outline is at its share of the way from one corner to the next: the normal equations of that
    right, corners = _STAY * wall, np.arange(count)
    entries = [(corners, corners, np.full(count, _STAY))]
    for i, a in ((side, 1.0 - share), (following, share)):
        entries += [(i, j, a * b) for j, b in ((side, 1.0 - share), (following, share))]
        np.add.at(right, i, a[:, None] * outline)
    row, column, value = map(np.concatenate, zip(*entries, strict=True))
    moved = _solved(row, column, value, right)
    while True:
        away = distance_to_segment(outline, moved[side], moved[following])
        before = distance_to_segment(outline[chosen], np.roll(moved, 1, axis=0), moved)
        away[chosen] = np.minimum(away[chosen], before)  # a corner's own point is between two sides
        far = np.unique(side[away > tolerance + _SLACK])
        if len(far) == 0:
            return moved
        back = np.union1d(far, (far + 1) % count)
        moved[back] = 0.5 * (moved[back] + wall[back])


def _solved(row: IndexArray, column: IndexArray, value: FloatArray, right: FloatArray) -> FloatArray:
    """Return the vector that a sparse matrix, the sum of entries (k,), maps to `right` (m, 2)."""
    count = len(right)
    if count <= MOST_DENSE:
        matrix = np.zeros((count, count))
        np.add.at(matrix, (row, column), value)
        return np.asarray(np.linalg.solve(matrix, right), np.float64)
    from scipy.sparse import csc_array
    from scipy.sparse.linalg import splu

    return np.asarray(splu(csc_array((value, (row, column)), shape=(count, count))).solve(right), np.float64)


@dataclass(frozen=True, kw_only=True, eq=False)
class Hole:
    """The narrowest place of the widest way out of an image. Lengths in pixels."""

    width: float
    row: int
    column: int
    closed: BoolArray  # (rows, columns) what stays free with a wall across each way out, where that is narrowest


def find_hole(clearance: FloatArray, inside: BoolArray, border: BoolArray) -> Hole:
    """Return the hole through which a course reaches the image's border.

    The ground is divided between the inside and the border by the watershed of the clearance: each pixel goes to the
    one of the two that it has the widest way to. The walls stand where they meet, and where that is widest is the hole.

    Args:
      clearance: distance to the nearest wall, 0 in walls, shape (rows, columns), row 0 below [pixel].
      inside: which pixels are of the course for sure.
      border: which are at the image's border, none of them inside.
    """
    from scipy import ndimage
    from skimage.segmentation import watershed

    room = np.where(inside, clearance.max(), clearance).astype(np.float64)
    tilt = np.linspace(0.0, _TILT, room.size).reshape(room.shape)
    parts = watershed(tilt - room, np.where(inside, 1, np.where(border, 2, 0)), mask=clearance > 0.0, connectivity=2)
    within = parts == 1
    gates = np.minimum(np.where(within, room, 0.0), ndimage.maximum_filter(np.where(parts == 2, room, 0.0), 3))
    row, column = np.unravel_index(np.argmax(gates), gates.shape)
    closed = (clearance > 0.0) & (within | ~ndimage.binary_dilation(within))
    return Hole(width=2.0 * float(gates.max()), row=int(row), column=int(column), closed=closed)
