"""A course of its two boundaries, which are its walls: the line in the middle, or one that is given."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from fg_mujoco.course.line_file import require_closed
from fg_mujoco.course.maps.map_server import OccupancyMap, require_maps_extra
from fg_mujoco.course.maps.map_track import clear_line
from fg_mujoco.course.maps.region import find_course
from fg_mujoco.course.polyline import IndexArray, cross, crossings, enclosed_area, resample, segments, step_lengths
from fg_mujoco.course.track import MIN_POINTS
from fg_mujoco.errors import TrackError
from fg_mujoco.messages import FloatArray

_SPACING = 0.05  # [m] of points on the boundaries
_MOST = 20_000  # points on a boundary
_PIXEL, _MOST_PIXELS = 0.05, 3000  # [m] and number of the map that the line is found in, along the longer side
_BORDER = 1.0  # [m] of the map round the course
_BLOCK = 256  # points whose distances are taken at once, to bound the memory


def between_boundaries(
    path: Path, first: FloatArray, second: FloatArray, centre: FloatArray | None = None
) -> tuple[FloatArray, FloatArray, FloatArray, tuple[FloatArray, FloatArray]]:
    """Return a course's line (k, 2), how far it is to the right and the left boundary (k,), and these in its direction.

    `first` (n, 2) is in driving order, `second` (m, 2) either way round; without `centre` the line is made, in the
    middle; all in [m]. Raises TrackError: a boundary that is not closed, or boundaries that cross or are not to either
    side of a line.
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
    _require_apart(path, walls[0], walls[1], "the boundaries cross")
    line = centre if centre is not None else _middle(path, walls)
    for wall in walls:
        _require_apart(path, line, wall, "the line crosses a boundary")
    near = [side[_nearest(line, side)] for side in sides]
    ahead = np.roll(line, -1, axis=0) - np.roll(line, 1, axis=0)
    is_left = [float((cross(ahead, each - line) > 0.0).mean()) > 0.5 for each in near]
    if is_left[0] == is_left[1]:
        raise TrackError(f"{path}: both boundaries are on one side of the line; accepted: the two of one course")
    left = int(is_left[1])
    widths = [np.hypot(*(each - line).T) for each in near]
    return line, widths[1 - left], widths[left], (walls[1 - left], walls[left])


def _require_apart(path: Path, one: FloatArray, other: FloatArray, said: str) -> None:
    if len(crossed := crossings(segments(one), segments(other))[0]):
        x, y = one[crossed[0]].tolist()
        raise TrackError(f"{path}: {said} near x {x:.2f}, y {y:.2f} m; accepted: the two boundaries of one course")


def _middle(path: Path, walls: list[FloatArray]) -> FloatArray:
    """Return the line in the middle between two boundaries, as that of a map of them, in the direction of the first."""
    require_maps_extra()
    from PIL import Image, ImageDraw

    low = np.min([wall.min(axis=0) for wall in walls], axis=0) - _BORDER
    high = np.max([wall.max(axis=0) for wall in walls], axis=0) + _BORDER
    pixel = max(_PIXEL, float((high - low).max()) / _MOST_PIXELS)
    columns, rows = np.ceil((high - low) / pixel).astype(int).tolist()
    image = Image.new("1", (columns, rows), 0)
    draw = ImageDraw.Draw(image)
    for wall, free in zip(sorted(walls, key=lambda wall: -abs(enclosed_area(wall))), (1, 0), strict=True):
        draw.polygon([tuple(point) for point in ((wall - low) / pixel - 0.5).tolist()], fill=free, outline=0)
    grid = np.asarray(image, dtype=np.bool_)  # its first row is the lowest here
    occupancy = OccupancyMap(path=path, free=grid, resolution=pixel, origin=(float(low[0]), float(low[1]), 0.0))
    line = clear_line(occupancy, find_course(occupancy))
    if (enclosed_area(line) > 0.0) != (enclosed_area(walls[0]) > 0.0):
        line = line[::-1]
    return np.roll(line, -int(_nearest(walls[0][:1], line)[0]), axis=0)


def _nearest(points: FloatArray, others: FloatArray) -> IndexArray:
    """Return which of others (m, 2) is nearest to each point (n, 2). Shape (n,)."""
    found = np.empty(len(points), dtype=np.int64)
    for k in range(0, len(points), _BLOCK):
        block = points[k : k + _BLOCK, None]
        found[k : k + _BLOCK] = np.argmin(((block - others) ** 2).sum(axis=2), axis=1)
    return found
