"""The region of a map that is raced on: free pixels with a way round, or, without one, from end to end.

A map usually has several free regions: the course, the infield, the outside of a drawing, rooms that a laser saw
through a window. The course is, of the regions that do not reach the image's border, the one with the longest lap.
Where no region has a lap, it is the largest one, driven as an open way. `start` names the region outright.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import TrackError
from ...messages import FloatArray
from ..polyline import enclosed_area, step_lengths
from .centreline import medial_axis
from .map_server import OccupancyMap
from .walls import outlines

SHORTEST_LAP = 9.0
"""[m] A shorter loop is no course but the way round an obstacle: the car at full lock goes round in 4.7 m."""

ROOM = 0.35
"""[m] Least distance from the walls of an open way: the car's length and a bit, over two."""

_LARGEST_HOLES = 5  # that a lap round is looked for

BoolArray = NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True, eq=False)
class MapCourse:
    """A region of a map, and the line that is driven in it. Lengths in pixels."""

    outlines: list[FloatArray]  # the outer edge, counterclockwise, and the holes, clockwise, the largest first
    line: FloatArray  # (n, 2) on the medial axis, counterclockwise where it is closed
    closed: bool


def find_course(occupancy: OccupancyMap, start: FloatArray | None = None) -> MapCourse:
    """Find the course of a map.

    Args:
      occupancy: the map.
      start: a point (2,) [m] of the region that is meant; None: as the module says.

    Raises:
      TrackError: a start that is not free; no free region; one that leaks out of the image, with the place of the hole;
        neither a lap nor an open way.
    """
    regions = _Regions(occupancy)
    if start is not None:
        number = regions.at(start)
        candidates = [number]
        if number in regions.leaking:
            raise _leak(regions, number, occupancy.to_pixels(start))
    else:
        candidates = [number for number in regions.by_size if number not in regions.leaking]
    laps = [lap for number in candidates if (lap := _lap(regions, number)) is not None]
    if laps:
        return max(laps, key=lambda lap: float(step_lengths(lap.line).sum()))
    for number in [] if start is not None else regions.by_size:
        if number in regions.leaking and _lap(regions, number) is not None:
            raise _leak(regions, number)
    if candidates:
        edges = _outlines(regions.mask(candidates[0]))
        line = medial_axis(regions.mask(candidates[0]), edges).longest_way(ROOM / occupancy.resolution)
        return MapCourse(outlines=edges, line=line, closed=False)
    if regions.by_size:
        raise _leak(regions, regions.by_size[0])
    raise TrackError(f"{occupancy.path}: no pixel is free; accepted: a map with free ground between walls")


def course_of(occupancy: OccupancyMap, line: FloatArray) -> list[FloatArray]:
    """Return the outlines, as in MapCourse, of the region in which a given line (n, 2) [m] lies.

    Raises:
      TrackError: a point of the line that is not free, or in another region than the first.
    """
    regions = _Regions(occupancy)
    numbers = [regions.at(point) for point in line]
    other = np.flatnonzero(np.array(numbers) != numbers[0])
    if len(other):
        where = ", ".join(f"{value:.2f}" for value in line[other[0]])
        raise TrackError(f"{occupancy.path}: a wall is between the centreline's first point and ({where})")
    if numbers[0] in regions.leaking:
        raise _leak(regions, numbers[0], occupancy.to_pixels(line[0]))
    return _outlines(regions.mask(numbers[0]))


def encloses(loop: FloatArray, point: FloatArray) -> bool:
    """Say whether a closed polyline (n, 2) goes round a point (2,): a ray from it crosses an odd number of times."""
    a, b = loop, np.roll(loop, -1, axis=0)
    x, y = point
    straddles = (a[:, 1] > y) != (b[:, 1] > y)
    a, b = a[straddles], b[straddles]
    return bool(np.count_nonzero(a[:, 0] + (y - a[:, 1]) / (b[:, 1] - a[:, 1]) * (b[:, 0] - a[:, 0]) > x) % 2)


class _Regions:
    """The free regions of a map, by number from 1.

    Attributes:
      occupancy: the map.
      by_size: numbers of those that are long enough to be a course, the largest first.
      leaking: numbers of those that reach the image's border.
    """

    def __init__(self, occupancy: OccupancyMap) -> None:
        from scipy import ndimage

        self.occupancy = occupancy
        self._labels, count = ndimage.label(occupancy.free)  # pixels that meet at a corner are not connected
        sizes = np.bincount(self._labels.ravel(), minlength=count + 1)
        sizes[0] = 0
        enough = SHORTEST_LAP * ROOM / occupancy.resolution**2
        self.by_size = [int(k) for k in np.argsort(-sizes, kind="stable") if sizes[k] > enough]
        labels = self._labels
        self.leaking = set(np.unique(np.concatenate((labels[0], labels[-1], labels[:, 0], labels[:, -1])))) - {0}

    def at(self, point: FloatArray) -> int:
        """Return the number of the region at a point (2,) of the world [m]."""
        column, row = np.floor(self.occupancy.to_pixels(point)).astype(int)
        rows, columns = self._labels.shape
        if not (0 <= row < rows and 0 <= column < columns):
            raise TrackError(f"{self.occupancy.path}: ({point[0]:.2f}, {point[1]:.2f}) is outside of the image")
        number = int(self._labels[row, column])
        if number == 0:
            raise TrackError(
                f"{self.occupancy.path}: ({point[0]:.2f}, {point[1]:.2f}) is not free; accepted: a point on the course"
            )
        return number

    def mask(self, number: int) -> BoolArray:
        """Return which pixels are of a region."""
        return np.asarray(self._labels == number)


def _outlines(region: BoolArray) -> list[FloatArray]:
    """Return the outlines of one region, the outer edge first, then the holes by size."""
    edges = sorted(outlines(region), key=enclosed_area)
    return [edges.pop(), *edges]


def _lap(regions: _Regions, number: int) -> MapCourse | None:
    """Return the course round the largest hole of a region, if it has one that a lap goes round."""
    mask = regions.mask(number)
    edges = _outlines(mask)
    if len(edges) < 2:
        return None
    axis = medial_axis(mask, edges)
    for hole in edges[1 : 1 + _LARGEST_HOLES]:
        loop = axis.loop_around(hole)
        if loop is not None and step_lengths(loop).sum() * regions.occupancy.resolution >= SHORTEST_LAP:
            return MapCourse(outlines=edges, line=loop, closed=True)
    return None


def _leak(regions: _Regions, number: int, inside: FloatArray | None = None) -> TrackError:
    """Return the error for a region that reaches the image's border, with the narrowest place on the way there.

    Of all ways from the course to the border the widest is looked at: where that is narrowest, a wall is missing.
    """
    from scipy import ndimage

    occupancy, mask = regions.occupancy, regions.mask(number)
    border = np.ones_like(mask)
    border[1:-1, 1:-1] = False
    clearance, nearest = ndimage.distance_transform_edt(mask, return_indices=True)
    holes = _outlines(mask)[1:]
    if inside is not None:
        seed: Any = tuple(np.floor(inside[::-1]).astype(int))
    elif holes:
        seed = _widest_beside(holes[0], mask, clearance, nearest)
    else:
        row, column = np.argwhere(mask & border)[0]
        return TrackError(
            f"{occupancy.path}: no closed course: free ground runs out of the image at "
            f"{occupancy.place((column + 0.5, row + 0.5))}; accepted: a course with walls all round"
        )
    levels = np.unique(clearance[mask])
    low, high = 0, len(levels)  # joined at levels[low], not at levels[high]
    while high - low > 1:
        middle = (low + high) // 2
        joined = _part(clearance >= levels[middle], seed)
        low, high = (middle, high) if (joined & border).any() else (low, middle)
    wide = _part(clearance > levels[low], seed)
    if wide[seed]:
        beyond, _ = ndimage.label((clearance >= levels[low]) & ~wide, np.ones((3, 3)))
        outside = np.unique(beyond[border & (beyond > 0)])
        gates = np.argwhere(np.isin(beyond, outside) & ndimage.binary_dilation(wide, np.ones((3, 3))))
    else:  # the course itself is nowhere wider
        gates = np.argwhere(mask & border)
    row, column = gates[len(gates) // 2]
    return TrackError(
        f"{occupancy.path}: the wall has a hole, {2.0 * levels[low] * occupancy.resolution:.2f} m wide, at "
        f"{occupancy.place((column + 0.5, row + 0.5))}: free ground runs on from the course out of the image; "
        "accepted: a course with walls all round, or a start=X:Y inside another one"
    )


def _widest_beside(hole: FloatArray, mask: BoolArray, clearance: FloatArray, nearest: Any) -> Any:
    """Return row and column of the pixel that is furthest from walls of all that have a hole as their nearest."""
    from scipy import ndimage

    solid, _ = ndimage.label(~mask, np.ones((3, 3)))
    x, y = hole[0]  # the middle of an edge between a free pixel and one of the hole
    beside = [(int(np.floor(y + dy)), int(np.floor(x + dx))) for dx in (-0.25, 0.25) for dy in (-0.25, 0.25)]
    number = max(int(solid[place]) for place in beside)
    own = solid[tuple(nearest)] == number
    return np.unravel_index(int(np.argmax(np.where(own & mask, clearance, -1.0))), mask.shape)


def _part(mask: BoolArray, seed: Any) -> BoolArray:
    """Return the connected part of a mask in which a pixel lies; nothing, if it is not in the mask."""
    from scipy import ndimage

    labels, _ = ndimage.label(mask, np.ones((3, 3)))
    return np.asarray((labels == labels[seed]) & mask & bool(mask[seed]))
