"""The region of a map that is raced on: free pixels with a way round, or, without one, from end to end.

A map usually has several free regions: the course, the infield, the outside of a drawing, rooms that a laser saw
through a window. The course is the loop round the largest obstacle, in any region that does not reach the image's
border. Obstacles with less than DOOR between them are one where a loop goes round them all. So a building is one
obstacle although its doors are open, and a stool in its lobby is a smaller one. A region that reaches the border is the
outside of a drawing if the course is within one of its holes. If it is not, and has a larger obstacle to go round, it
is the course, and its wall has a hole. Where no region has a loop, the largest is driven as an open way. `start` names
the region, and `loop` another loop.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import TrackError
from ...messages import FloatArray
from ..polyline import enclosed_area, is_inside, step_lengths
from ..scene import BEHIND, BEYOND
from .centreline import MedialAxis, medial_axis
from .map_server import SPECK, BoolArray, OccupancyMap
from .walls import Hole, find_hole, outlines

SHORTEST_LAP = 9.0
"""[m] A shorter loop is no course but the way round an obstacle: the car at full lock goes round in 4.7 m."""

SHORTEST_RACE = 3.0
"""[m] From the start to the goal of an open way: five cars' lengths."""

SHORTEST_WAY = BEHIND + SHORTEST_RACE + BEYOND
"""[m] Of an open way, with what is before its start and beyond its goal."""

ROOM = 0.35
"""[m] Least distance from the walls of an open way: the car's length and a bit, over two."""

DOOR = 1.2
"""[m] Obstacles nearer to each other than this are gone round together, if that is possible. A door is 1 m wide."""

GREY_GROUND = "grey 205, which map savers write for unknown ground, counts as free by free_thresh"
"""Said where it does."""

_MOST_LOOPS = 10**6  # no map has so many; a greater number of a loop is refused as this one is
_LARGEST = 5  # obstacles that a loop round is looked for, in each region, with doors open and with doors shut
MOST_SIDES = 300_000  # of pixels along the walls of a region: some 3 s
MOST_SIDES_IN_ALL = 2 * MOST_SIDES  # along those of all regions together
MOST_SPECKS = 1000  # of a map that is looked through for a setting that helps; one of more is noise
_DOUBLE_DOOR = 2.0  # [m] a hole no wider is one in a wall, however narrow the course is
_WIDEST_HOLE = 2.0  # times the width of the course at its widest place; where more of a wall is missing, it has none
_CORRIDOR = 4.0  # an open way is longer than wide by this at least; a shorter one is a room
_ROUNDING = 1e-6  # [m]
_NEIGHBOURS = np.ones((3, 3))
_NEXT = ((np.s_[:, 1:], np.s_[:, :-1]), (np.s_[1:], np.s_[:-1]))  # pixels, and those to their left and below
_BESIDE = np.array([(dx, dy) for dx in (-0.25, 0.25) for dy in (-0.25, 0.25)])  # from an outline to a pixel


@dataclass(frozen=True, kw_only=True, eq=False)
class Obstacle:
    """Holes of a region that a loop may go round. Lengths in pixels."""

    outlines: list[FloatArray]
    box: FloatArray  # (2, 2) least and greatest column and row
    least_clearance: float  # of the loop

    @cached_property
    def extent(self) -> float:
        """The diagonal of its box."""
        return float(np.hypot(*np.ptp(self.box, axis=0)))

    @property
    def rank(self) -> tuple[float, float]:
        """By which obstacles are sorted: the largest first, and with doors shut before with doors open."""
        return -self.extent, -self.least_clearance


@dataclass(frozen=True, kw_only=True, eq=False)
class MapCourse:
    """A region of a map, and the line that is driven in it. Lengths in pixels."""

    outlines: list[FloatArray]  # the outer edge, counterclockwise, and the holes, clockwise, the largest first
    line: FloatArray  # (n, 2) on the medial axis, counterclockwise where it is closed
    closed: bool
    goes_round: Obstacle | None = None  # None: an open way

    @property
    def extent(self) -> float:
        """Extent of the obstacle that the line goes round."""
        return 0.0 if self.goes_round is None else self.goes_round.extent

    @property
    def middle(self) -> FloatArray:
        """Column and row of the middle of what the line goes round, of the line itself if it is open. Shape (2,)."""
        return np.asarray(self.line.mean(axis=0) if self.goes_round is None else self.goes_round.box.mean(axis=0))


def find_course(
    occupancy: OccupancyMap, start: FloatArray | None = None, *, loop: int = 1, close: float = 0.0
) -> MapCourse:
    """Find the course of a map.

    Args:
      occupancy: the map.
      start: a point (2,) [m] of the region that is meant; None: as the module says.
      loop: which of the loops, as `find_loops` counts them from 1.
      close: holes of up to this width [m] in the walls of the course are closed.

    Raises:
      TrackError: a start that is not free; no free region; one that leaks out of the image, with the place of the hole
        and the option that closes it; fewer loops than `loop`; neither a lap nor an open way.
    """
    regions = _closed_regions(occupancy, start, close)
    loops = list(islice(_loops(regions), min(max(loop, 1), _MOST_LOOPS)))
    if 1 <= loop <= len(loops):
        return loops[-1]
    if loop != 1:
        most = max(sum(1 for _ in _loops(regions)), 1)
        raise TrackError(f"{occupancy.path}: loop is {loop}; accepted: 1 to {most}, as track show counts them")
    region = regions[0]
    return MapCourse(outlines=region.outlines, line=region.axis.longest_way(ROOM / occupancy.resolution), closed=False)


def find_loops(occupancy: OccupancyMap, start: FloatArray | None = None, *, close: float = 0.0) -> list[MapCourse]:
    """Return the loops of a map, that round the largest obstacle first. Arguments and errors as of `find_course`."""
    return list(_loops(_closed_regions(occupancy, start, close)))


def course_of(occupancy: OccupancyMap, line: FloatArray, *, close: float = 0.0) -> list[FloatArray]:
    """Return the outlines, as in MapCourse, of the region in which a given line (n, 2) [m] lies.

    Raises:
      TrackError: a point of the line that is not free, or in another region than the first; a hole as in `find_course`.
    """
    (region,) = _closed_regions(occupancy, line[0], close)
    column, row = np.floor(occupancy.to_pixels(line)).astype(int).T
    for point in np.flatnonzero(~region.has(row, column)):
        _require_free(occupancy, line[point])
        where = ", ".join(f"{value:.2f}" for value in line[point])
        raise TrackError(f"{occupancy.path}: a wall is between the centreline's first point and ({where})")
    return region.outlines


def pixels_within(free: BoolArray, holes: list[FloatArray]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return row and column of a pixel of each hole: its outline is half way to one that is free. Shapes (k,)."""
    first = np.array([hole[0] for hole in holes]).reshape(-1, 1, 2)
    columns, rows = np.moveaxis(np.floor(first + _BESIDE).astype(np.intp), -1, 0)
    each = np.arange(len(first)), np.argmax(~free[rows, columns], axis=1)
    return rows[each], columns[each]


def encloses(loop: FloatArray, point: FloatArray) -> bool:
    """Return whether a closed polyline (n, 2) goes round a point (2,)."""
    return bool(is_inside(point[None], [loop])[0])


class _Region:
    """A connected part of the free ground of a map.

    Attributes:
      corner: row and column of the lower left pixel of `mask` in the image.
      mask: its pixels, in a window of the image with a row and a column to spare on each side.
      border: those of them that are at the image's border.
    """

    def __init__(self, occupancy: OccupancyMap, mask: BoolArray, corner: tuple[int, int]) -> None:
        self.occupancy, self.corner, self.mask = occupancy, np.array(corner) - 1, np.pad(mask, 1)
        rows, columns = np.ogrid[: self.mask.shape[0], : self.mask.shape[1]]
        (low, left), (high, right) = -self.corner, np.array(occupancy.free.shape) - 1 - self.corner
        self.border = self.mask & ((rows == low) | (rows == high) | (columns == left) | (columns == right))
        self._beyond = (rows < low) | (rows > high) | (columns < left) | (columns > right)
        self.leaks = bool(self.border.any())
        self._loops: dict[int, FloatArray | None] = {}  # by the obstacle's id

    @cached_property
    def sides(self) -> int:
        """Number of pixel sides in the walls."""
        return _sides(self.mask)

    @cached_property
    def outlines(self) -> list[FloatArray]:
        """The outer edge, then the holes by area, in pixels of the image; raise TrackError for noise."""
        if self.sides > MOST_SIDES:
            raise _too_noisy(self.occupancy, self.sides, MOST_SIDES)
        edges = sorted(outlines(self.mask), key=enclosed_area)
        return [edge + self.corner[::-1] for edge in (edges.pop(), *edges)]

    @cached_property
    def boxes(self) -> FloatArray:
        """Least and greatest column and row of each hole. Shape (holes, 2, 2)."""
        holes = self.outlines[1:]
        if not holes:
            return np.empty((0, 2, 2))
        points, first = np.concatenate(holes), np.cumsum([0, *map(len, holes[:-1])])
        return np.stack((np.minimum.reduceat(points, first), np.maximum.reduceat(points, first)), axis=1)

    @cached_property
    def clearance(self) -> FloatArray:
        """Distance of each pixel to the nearest that is not of the region; the image's border is no wall. In pixels."""
        from scipy import ndimage

        clearance = ndimage.distance_transform_edt(self.mask | self._beyond)
        return np.where(self.mask, clearance, 0.0).astype(np.float32)

    @cached_property
    def axis(self) -> MedialAxis:
        """The medial axis, in pixels of the image."""
        axis = medial_axis(self.mask, [edge - self.corner[::-1] for edge in self.outlines])
        return replace(axis, points=axis.points + self.corner[::-1])

    def has(self, row: Any, column: Any) -> Any:
        """Say which pixels of the image are of the region."""
        row, column = row - self.corner[0], column - self.corner[1]
        rows, columns = self.mask.shape
        inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        return inside & self.mask[np.where(inside, row, 0), np.where(inside, column, 0)]

    @cached_property
    def obstacles(self) -> list[Obstacle]:
        """The largest holes, and the largest groups of holes that are together where doors are shut."""
        from scipy import ndimage

        holes = self.outlines[1:]
        if len(holes) < 2:
            return [self._obstacle([k], 0.0) for k in range(len(holes))]
        least = 0.5 * DOOR / self.occupancy.resolution
        solid, _ = ndimage.label(self.clearance < least, _NEIGHBOURS)
        groups: dict[int, list[int]] = {}
        for k, number in enumerate(solid[self._pixels_within(holes)].tolist()):
            groups.setdefault(number, []).append(k)
        groups.pop(int(solid[0, 0]), None)  # together with what is round the region
        largest = np.argsort(-np.hypot(*np.ptp(self.boxes, axis=1).T), kind="stable")[:_LARGEST]
        joined = sorted((self._obstacle(group, least) for group in groups.values()), key=lambda one: one.rank)
        return [*(self._obstacle([k], 0.0) for k in largest.tolist()), *joined[:_LARGEST]]

    def _obstacle(self, holes: list[int], least_clearance: float) -> Obstacle:
        """Return the obstacle that has these holes."""
        low, high = self.boxes[holes, 0].min(axis=0), self.boxes[holes, 1].max(axis=0)
        outlines = [self.outlines[1 + k] for k in holes]
        return Obstacle(outlines=outlines, box=np.stack((low, high)), least_clearance=least_clearance)

    def loop_round(self, obstacle: Obstacle) -> FloatArray | None:
        """Return the loop round an obstacle, (n, 2) in pixels of the image; None where there is none that is a lap."""
        if id(obstacle) not in self._loops:
            line = self.axis.loop_around(obstacle.outlines[0], obstacle.least_clearance)
            is_lap = line is not None and step_lengths(line).sum() * self.occupancy.resolution >= SHORTEST_LAP
            self._loops[id(obstacle)] = line if is_lap else None
        return self._loops[id(obstacle)]

    def pixel(self, pixel: tuple[int, int]) -> tuple[int, int]:
        """Return row and column in the window of a pixel of the image."""
        row, column = (np.array(pixel) - self.corner).tolist()
        return row, column

    def replaced(self, mask: BoolArray) -> OccupancyMap:
        """Return the map with fewer pixels of this region free: those of a mask of its window."""
        free = self.occupancy.free.copy()
        row, column = np.argwhere(self.mask & ~mask).T + self.corner[:, None]
        free[row, column] = False
        return replace(self.occupancy, free=free)

    def _pixels_within(self, holes: list[FloatArray]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return row and column, in the window, of a pixel of each hole."""
        return pixels_within(self.mask, [hole[:1] - self.corner[::-1] for hole in holes])

    def ring(self) -> BoolArray:
        """Return which pixels have the largest hole as their nearest wall: a ring round it; none without a hole."""
        from scipy import ndimage

        if len(self.outlines) < 2:
            return np.zeros_like(self.mask)
        solid, _ = ndimage.label(~self.mask, _NEIGHBOURS)
        row, column = ndimage.distance_transform_edt(
            self.mask | self._beyond, return_distances=False, return_indices=True
        )
        return np.asarray(self.mask & (solid[row, column] == solid[self._pixels_within(self.outlines[1:2])]))

    @property
    def extent(self) -> float:
        """The diagonal of the box of its largest hole, 0 without, in pixels."""
        return float(np.hypot(*np.ptp(self.boxes, axis=1).T).max(initial=0.0))


def _regions(occupancy: OccupancyMap, at: FloatArray | None) -> list[_Region]:
    """Return the free regions that are large enough for a course, the largest first; or the one at a point (2,) [m]."""
    from scipy import ndimage

    labels, count = ndimage.label(occupancy.free)  # pixels that meet at a corner are not connected
    if at is not None:
        numbers = np.array([labels[_require_free(occupancy, at)]])
    else:
        sizes = np.bincount(labels.ravel(), minlength=count + 1)[1:]
        enough = np.flatnonzero(sizes > SHORTEST_LAP * ROOM / occupancy.resolution**2)
        numbers = enough[np.argsort(-sizes[enough], kind="stable")] + 1
    kept = np.zeros(count + 1, np.int32)  # of millions of specks few are looked at
    kept[numbers] = np.arange(1, len(numbers) + 1)
    labels = kept[labels]
    return [
        _Region(occupancy, labels[window] == number, (window[0].start, window[1].start))
        for number, window in enumerate(ndimage.find_objects(labels), start=1)
    ]


def _require_free(occupancy: OccupancyMap, point: FloatArray) -> tuple[int, int]:
    """Return row and column of a point (2,) of the world [m]; raise TrackError where it is not free."""
    column, row = np.floor(occupancy.to_pixels(point)).astype(int).tolist()
    rows, columns = occupancy.free.shape
    where = f"{occupancy.path}: ({point[0]:.2f}, {point[1]:.2f})"
    if not (0 <= row < rows and 0 <= column < columns):
        (x, y), (end_x, end_y) = occupancy.to_world([(0, 0), (columns, rows)])
        raise TrackError(
            f"{where} is outside of the image; accepted: a point on the course; the image is from ({x:.2f}, {y:.2f}) "
            f"to ({end_x:.2f}, {end_y:.2f})"
        )
    if not occupancy.is_free(point):
        raise TrackError(f"{where} is not free; accepted: a point on the course")
    return row, column


def _loops(regions: list[_Region]) -> Iterator[MapCourse]:
    """Yield the loops of regions, that round the largest obstacle first, each once."""
    ranked = [(region, obstacle) for region in regions for obstacle in region.obstacles]
    seen: set[tuple[int, frozenset[int]]] = set()
    for region, obstacle in sorted(ranked, key=lambda pair: pair[1].rank):
        line = region.loop_round(obstacle)
        if line is None:
            continue
        inside = frozenset(k for k, hole in enumerate(region.outlines[1:]) if encloses(line, hole[0]))
        if (id(region), inside) not in seen:
            seen.add((id(region), inside))
            yield MapCourse(outlines=region.outlines, line=line, closed=True, goes_round=obstacle)


@dataclass(frozen=True, kw_only=True)
class _Tight:
    """The regions that may be the course, and the width of the widest hole that was closed to make them so [m]."""

    regions: list[_Region]
    closed: float = 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class _Leak:
    """A course that reaches the image's border, and through which hole."""

    region: _Region
    hole: Hole | None  # the widest; None: it is not known what is inside
    closed: float = 0.0  # [m] width of the widest hole that was closed before

    @property
    def width(self) -> float:
        """Width of the hole [m]; infinity if none is known."""
        return math.inf if self.hole is None else self.hole.width * self.region.occupancy.resolution

    def walled(self) -> OccupancyMap:
        """Return the map with a wall across each way out, where it is narrowest."""
        assert self.hole is not None
        return self.region.replaced(self.hole.closed)


def _look(occupancy: OccupancyMap, at: FloatArray | None) -> _Tight | _Leak:
    """Return the regions that may be the course, or how the course leaks."""
    regions = _regions(occupancy, at)
    sides = sum(region.sides for region in regions if region.sides <= MOST_SIDES)  # the others are refused alone
    if sides > MOST_SIDES_IN_ALL:
        raise _too_noisy(occupancy, sides, MOST_SIDES_IN_ALL)
    region = _leaking_course(regions)
    if region is None:
        return _Tight(regions=[region for region in regions if not region.leaks])
    inside = region.ring()
    if at is not None:
        inside[region.pixel(_require_free(occupancy, at))] = True
    known = inside.any() and not (inside & region.border).any()
    return _Leak(region=region, hole=find_hole(region.clearance, inside, region.border) if known else None)


def _close(found: _Tight | _Leak, at: FloatArray | None, close: float) -> _Tight | _Leak:
    """Return the result of `_look` after holes of up to `close` [m] have been closed. Errors as there."""
    while isinstance(found, _Leak) and found.hole is not None and found.width <= close + _ROUNDING:
        found = replace(_look(found.walled(), at), closed=max(found.closed, found.width))
    return found


def _leaking_course(regions: list[_Region]) -> _Region | None:
    """Return the region that is the course but reaches the image's border, if there is such a one."""
    tight = [region for region in regions if not region.leaks]
    leaking = [region for region in regions if region.leaks]
    course = next(_loops(tight), None) if leaking else None
    if course is None:
        least = 0.5 * SHORTEST_LAP if tight else 0.0  # [m] there and back
        return next((one for one in leaking if one.extent * one.occupancy.resolution >= least), None)
    larger = [
        region
        for region in leaking
        if region.extent > course.extent and not any(encloses(hole, course.line[0]) for hole in region.outlines[1:])
    ]
    return max(larger, key=lambda region: region.extent, default=None)


def _closed_regions(occupancy: OccupancyMap, at: FloatArray | None, close: float) -> list[_Region]:
    """Return the regions that may be the course, after holes of up to `close` [m] have been closed."""
    found = _close(_look(occupancy, at), at, close)
    if isinstance(found, _Leak):
        raise _refusal(occupancy, found, at)
    if not found.regions:
        raise TrackError(
            f"{occupancy.path}: no free ground is large enough for a course of {SHORTEST_LAP:.0f} m: of the pixels "
            f"{occupancy.shares}; accepted: a map with free ground between walls"
        )
    return found.regions


def _refusal(occupancy: OccupancyMap, leak: _Leak, at: FloatArray | None) -> TrackError:
    """Return the error for a course that reaches the image's border, with an option that helps where there is one."""
    region, hole = leak.region, leak.hole
    if hole is None:
        row, column = np.argwhere(region.border)[0] + region.corner
        what = f"no closed course: free ground runs out of the image at {occupancy.place((column + 0.5, row + 0.5))}"
    else:
        row, column = np.array((hole.row, hole.column)) + region.corner
        what = (
            f"the wall has a hole, {leak.width:.2f} m wide, at {occupancy.place((column + 0.5, row + 0.5))}: free "
            "ground runs on from the course out of the image"
        )
    options = _options(occupancy, leak, at)
    if occupancy.grey is not None:
        what += f"; {GREY_GROUND} ({100.0 * occupancy.grey.mean():.0f} % of the image)"
    accepted = "a course with walls all round" + (f", or {occupancy.named(**options)}" if options else "")
    return TrackError(f"{occupancy.path}: {what}; accepted: {accepted}")


def _options(occupancy: OccupancyMap, leak: _Leak, at: FloatArray | None) -> dict[str, str]:
    """Return the settings of a map's name with which a map that leaks has a course; none where none give it one.

    A hole is closed if it is at most twice as wide as the course is at its widest place. Where more of the wall is
    missing, the course is open ground there, and the image's border has to be the wall. A map of noise is looked at
    without its specks first. Unknown ground that counts as free is tried as unknown before all else.
    """
    if occupancy.grey is not None:
        known, options = occupancy.without_grey()
        closed, width = _course(lambda: _close(_look(known, at), at, math.inf))
        if closed <= max(_DOUBLE_DOOR, _WIDEST_HOLE * width):
            return options | ({"close": _rounded_up(closed)} if closed else {})
    bordered = occupancy.with_walled_border()
    if np.count_nonzero(occupancy.sizes()[1] < SPECK) <= MOST_SPECKS:
        closed, width = _course(lambda: _close(leak, at, math.inf))
        if closed <= max(_DOUBLE_DOOR, _WIDEST_HOLE * width):
            return {"close": _rounded_up(closed)}
    else:
        clean = occupancy.without_specks(SPECK)
        closed, width = _course(lambda: _close(_look(clean, at), at, math.inf))
        if closed <= max(_DOUBLE_DOOR, _WIDEST_HOLE * width):
            return {"specks": f"{SPECK}"} | ({"close": _rounded_up(closed)} if closed else {})
        if _course(lambda: _look(clean.with_walled_border(), at), room=False)[1]:
            return {"specks": f"{SPECK}", "border": "wall"}
        if leak.width <= _DOUBLE_DOOR:  # without a try: in so much noise one takes long
            return {"close": _rounded_up(leak.width)}
    return {"border": "wall"} if _course(lambda: _look(bordered, at), room=False)[1] else {}


def _rounded_up(width: float) -> str:
    """Return a setting that closes a hole of a width [m]."""
    return f"{math.floor(10.0 * width + _ROUNDING) / 10.0 + 0.1:.1f}"


def _course(find: Callable[[], _Tight | _Leak], *, room: bool = True) -> tuple[float, float]:
    """Return the width of the holes closed for the course that is found, and the greatest width of the course [m]."""
    from scipy.spatial import cKDTree

    none = math.inf, 0.0
    try:
        found = find()
        if isinstance(found, _Leak) or not found.regions:
            return none
        region, loop = found.regions[0], next(_loops(found.regions), None)
        resolution = region.occupancy.resolution
        line = region.axis.longest_way(ROOM / resolution) if loop is None else loop.line
    except TrackError:  # too much noise; or the point of the course is in the border, which is a wall
        return none
    if len(line) == 0:
        return none
    walls = region.outlines if loop is None else loop.outlines
    width = 2.0 * float(cKDTree(np.concatenate(walls)).query(line)[0].max()) * resolution
    length = float(np.hypot(*np.diff(line, axis=0).T).sum()) * resolution
    if loop is None and length < (SHORTEST_WAY if room else max(SHORTEST_WAY, _CORRIDOR * width)):
        return none
    return found.closed, width


def _sides(free: BoolArray) -> int:
    """Return the number of pixel sides between free and other pixels."""
    return sum(int(np.count_nonzero(free[one] != free[other])) for one, other in _NEXT)


def _too_noisy(occupancy: OccupancyMap, sides: int, most: int) -> TrackError:
    """Return the error for so many sides of pixels, with the setting that helps if they are those of specks."""
    helps = _sides(occupancy.without_specks(SPECK).free) <= MOST_SIDES
    option = f", or {occupancy.named(specks=f'{SPECK}')}" if helps else ""
    return TrackError(
        f"{occupancy.path}: walls of {sides} sides of pixels; accepted: {most} at most, a map without noise{option}"
    )
