"""Tracks from ROS maps. The walls are those of the image, the centreline is given or found, and islands are kept.

    track = read_map("aut.yaml")                                  # or load_track("aut.yaml")
    track = read_map("aut.yaml", start=(3.0, 0.5), direction="clockwise")
    track = load_track("aut.yaml[start=3.0:0.5,direction=clockwise]")

The start is the place of the centreline that is nearest to the world's origin, and the direction is the one that is
nearer to the world's x axis there: the robot stood at the origin and looked along x when it began to map. A map of a
corridor has no way round. It becomes a Scene that is driven once, from the end that is nearer to the origin to the
other end.
"""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ... import portable
from ...errors import TrackError, accepted_names
from ...messages import FloatArray, read_only
from ..centreline_csv import DIRECTIONS, Direction, read_points, read_settings
from ..course import default_time_limit
from ..obstacles import Prism
from ..polyline import enclosed_area, resample, segments, smooth, step_lengths, steps, subdivide
from ..scene import BEHIND, BEYOND, Scene
from ..track import MapTrack
from ..track_mesh import wall_footprints
from .map_server import MARK_REACH, SPECK, OccupancyMap, read_map_file
from .region import GREY_GROUND, SHORTEST_WAY, MapCourse, course_of, encloses, find_course, find_loops, pixels_within
from .walls import trace

SPACING = 0.2
"""[m] Of the points of a centreline that is found."""

_SMOOTHING = 0.3  # of the median distance to the walls, standard deviation: the medial axis has corners
_REPEATED = 1e-6  # [m] points nearer than this are one
_MUCH_GREY = 0.05  # share of a course's line that leads over unknown ground
_HALVINGS = 5  # of the smoothing, until the line is clear of the walls
_WALL_SPACING = 0.02  # [m] of the points of walls that the line's distance is measured to: true to 0.1 mm
_SPECIFICATION = re.compile(r"(?P<path>.*\.ya?ml)(\[(?P<settings>.*)\])?", re.IGNORECASE | re.DOTALL)


def is_map(name: str) -> bool:
    """Return whether a name of a track, as load_track takes it, is that of a map."""
    return _SPECIFICATION.fullmatch(name) is not None


def load_map(name: str) -> MapTrack | Scene:
    """Load a map by `FILE.yaml` or `FILE.yaml[SETTING=VALUE,...]`.

    Settings and errors are those of `read_map`, with `start` as X:Y and `border=wall` for `border_wall`.
    """
    path, settings = _parsed(name)
    return read_map(path, **settings)


@dataclass(frozen=True, kw_only=True)
class MapLoop:
    """One of the loops of a map."""

    number: int  # as the setting `loop` takes it
    length: float  # [m] about: of the medial axis
    middle: tuple[float, float]  # x and y [m] of the middle of what it goes round
    driven: bool  # whether it is the course


def map_loops(name: str) -> list[MapLoop]:
    """Return the loops of a map, by a name as of `load_map`, that round the largest obstacle first; raise as that.

    There is none where a centreline is given.
    """
    path, settings = _parsed(name)
    if "centreline" in settings:
        return []
    occupancy, place = _occupancy(path, **settings)
    loops = find_loops(occupancy, place, close=settings.get("close", 0.0))
    return [
        MapLoop(
            number=number,
            length=float(step_lengths(loop.line).sum()) * occupancy.resolution,
            middle=tuple(occupancy.to_world(loop.middle).tolist()),
            driven=number == settings.get("loop", 1),
        )
        for number, loop in enumerate(loops, start=1)
    ]


def _parsed(name: str) -> tuple[str, dict[str, Any]]:
    """Return the path and the settings, as `read_map` takes them, that a name of a map has."""
    match = _SPECIFICATION.fullmatch(name)
    if match is None:
        raise TrackError(f"{name!r} is no map; accepted: FILE.yaml, or FILE.yaml[SETTING=VALUE,...]")
    settings = read_settings(name, match["settings"] or "", _SETTINGS)
    if "border" in settings:
        settings["border_wall"] = settings.pop("border")
    return match["path"], settings


def _point(text: str) -> tuple[float, float]:
    x, y = map(float, text.split(":"))
    return x, y


_SETTINGS: dict[str, tuple[str, Callable[[str], Any]]] = {
    "centreline": ("FILE.csv", str),
    "start": ("X:Y", _point),
    "direction": ("clockwise or counterclockwise", str),
    "loop": ("NUMBER", int),
    "close": ("METRES", float),
    "specks": ("PIXELS", int),
    "free_thresh": ("NUMBER", float),
    "border": ("wall", {"wall": True}.__getitem__),
    "outside_folder": ("yes or no", {"yes": True, "no": False}.__getitem__),
}
"""Settings of a map's name: what is accepted, and what reads it."""


def read_map(
    path: str | Path,
    *,
    centreline: str | Path | None = None,
    start: tuple[float, float] | None = None,
    direction: Direction | None = None,
    loop: int = 1,
    close: float = 0.0,
    specks: int = 0,
    free_thresh: float | None = None,
    border_wall: bool = False,
    image: str | Path | None = None,
    outside_folder: bool = False,
) -> MapTrack | Scene:
    """Read a map_server YAML as a track, or as a scene where there is no way round; it is named after the file.

    Args:
      path: the YAML.
      centreline: a centreline CSV in the map's frame; its widths are not used. None: the medial axis.
      start: x and y [m] of a point; the start is the place of the centreline that is nearest to it, and the course is
        the one on which the point is. None: as the module says; a given centreline starts with its first point.
      direction: None: as the module says; a given centreline is driven in the order of its points.
      loop: which loop is driven, as `map_loops` and `fg-mujoco track show` count them.
      close: holes in the course's wall of up to this width [m] are closed, where free ground runs out of the image.
      specks: islands of fewer pixels than this are taken for noise, and are free ground.
      free_thresh: in place of the one of the YAML; 0.196 makes the grey of unknown ground, 205, a wall.
      border_wall: whether the image's border is a wall.
      image: in place of the one that the YAML names.
      outside_folder: whether the YAML may name an image outside of its own folder.

    Raises:
      MissingExtraError: the extra `maps` is not installed.
      TrackError: a YAML or an image that cannot be read; a map whose walls have a hole, or in which there is neither a
        lap nor an open way; a start that is not free; a centreline that is not in free ground; an unknown direction.
    """
    if direction is not None and direction not in DIRECTIONS:
        raise TrackError(f"{path}: direction is {direction!r}; {accepted_names(direction, DIRECTIONS)}")
    occupancy, place = _occupancy(
        path, start=start, close=close, specks=specks, free_thresh=free_thresh, border_wall=border_wall, image=image,
        outside_folder=outside_folder,
    )  # fmt: skip
    if centreline is not None:
        line = read_points(centreline)
        outlines = course_of(occupancy, line, close=close)
        _warn_of_specks(occupancy, outlines)
        _warn_of_grey(occupancy, occupancy.to_pixels(line))
        if start is not None or direction is not None:
            line = _oriented(line, line[0] if start is None else np.array(start), direction, _heading(line))
        return _map_track(occupancy, outlines, line)
    course = find_course(occupancy, place, loop=loop, close=close)
    _warn_of_specks(occupancy, course.outlines)
    _warn_of_grey(occupancy, course.line)
    near = np.zeros(2) if place is None else place
    if not course.closed:
        if direction is not None:
            raise TrackError(f"{path}: direction is {direction!r}, but there is no way round; accepted: none")
        return _map_scene(occupancy, course, near)
    line = clear_line(occupancy, course)
    heading = 0.0 if occupancy.heading is None else occupancy.heading
    return _map_track(occupancy, course.outlines, _oriented(line, near, direction, heading))


def _occupancy(
    path: str | Path,
    *,
    start: tuple[float, float] | None = None,
    close: float = 0.0,
    specks: int = 0,
    free_thresh: float | None = None,
    border_wall: bool = False,
    image: str | Path | None = None,
    outside_folder: bool = False,
    **_: Any,
) -> tuple[OccupancyMap, FloatArray | None]:
    """Return the free ground of a map, and the point of the course (2,) [m] that is given, or is in the file."""
    if start is not None and not all(map(math.isfinite, start)):
        raise TrackError(f"{path}: start is {start!r}; accepted: x and y in metres")
    if not 0.0 <= close < math.inf:
        raise TrackError(f"{path}: close is {close!r}; accepted: a width in metres, as 1.5")
    if specks < 0:
        raise TrackError(f"{path}: specks is {specks!r}; accepted: a number of pixels, as {SPECK}")
    given = {
        "start": start and f"{start[0]:g}:{start[1]:g}", "close": close, "specks": specks,
        "free_thresh": free_thresh, "border": border_wall and "wall", "outside_folder": outside_folder and "yes",
    }  # fmt: skip
    occupancy = read_map_file(path, free_thresh=free_thresh, image=image, outside_folder=outside_folder)
    occupancy = replace(occupancy, given={name: str(value) for name, value in given.items() if value})
    if specks:
        occupancy = occupancy.without_specks(specks)
    if border_wall:
        occupancy = occupancy.with_walled_border()
    if start is None and occupancy.start is not None:
        if occupancy.is_free(occupancy.start):
            start = occupancy.start
        else:
            warnings.warn(f"{path}: ignored: the starting position {occupancy.start} is not free", stacklevel=3)
    return occupancy, None if start is None else np.array(start)


def _warn_of_specks(occupancy: OccupancyMap, outlines: list[FloatArray]) -> None:
    """Say how many islands of a course are so small that they may be noise."""
    if len(outlines) == 1:
        return
    labels, sizes = occupancy.sizes()
    found = sizes[labels[pixels_within(occupancy.free, outlines[1:])]]
    small = found[found < SPECK]
    if len(small):
        below = f"{len(small)} island{'s' if len(small) > 1 else ''} of fewer than {small.max() + 1} pixels"
        kept = "is kept as an obstacle" if len(small) == 1 else "are kept as obstacles"
        option = occupancy.named(specks=f"{small.max() + 1}")
        warnings.warn(f"{occupancy.path}: {below} {kept}; {option} drops what is so small", stacklevel=3)


def _warn_of_grey(occupancy: OccupancyMap, line: FloatArray) -> None:
    """Say that a line (n, 2) [pixel] leads over the grey that map savers write for unknown ground."""
    if occupancy.grey is None or len(line) == 0:
        return
    column, row = np.floor(line).astype(int).T
    if occupancy.grey[row, column].mean() > _MUCH_GREY:
        option = occupancy.named(**occupancy.without_grey()[1])
        warnings.warn(
            f"{occupancy.path}: {GREY_GROUND}, and the course leads over it; {option} makes it a wall", stacklevel=3
        )


def _map_track(occupancy: OccupancyMap, outlines: list[FloatArray], line: FloatArray) -> MapTrack:
    """Return the track of a centreline (n, 2) [m] in a region with these outlines [pixel]."""
    walls = [occupancy.to_world(trace(outline)) for outline in outlines]
    outer, holes = walls[0], walls[1:]  # counterclockwise, clockwise
    within = [encloses(line, wall[0]) for wall in holes]
    if not any(within):
        raise TrackError(f"{occupancy.path}: the centreline goes round nothing; accepted: a line round an infield")
    infield = holes.pop(within.index(True))  # the largest
    within.remove(True)
    inner = [infield, *(wall for wall, is_within in zip(holes, within, strict=True) if is_within)]
    outside = [outer, *(wall for wall, is_within in zip(holes, within, strict=True) if not is_within)]
    counterclockwise = enclosed_area(line) > 0.0
    left, right = (inner, outside) if counterclockwise else (outside, inner)
    ahead = slice(None, None, -1 if counterclockwise else 1)  # holes are clockwise
    wall_left, wall_right = (infield[ahead], outer) if counterclockwise else (outer[::-1], infield)
    edges, marks = _marked(occupancy, [wall_left, wall_right, *(wall[::-1] for wall in holes)])
    try:
        return MapTrack(
            name=occupancy.path.stem,
            centreline=line,
            width_right=_distances(line, right),
            width_left=_distances(line, left),
            wall_left=edges[0],
            wall_right=edges[1],
            outlines=tuple(map(read_only, edges[2:])),
            kinds=occupancy.kinds,
            marks=marks,
        )
    except TrackError as error:
        raise TrackError(f"{occupancy.path}: {error}") from error


def _marked(occupancy: OccupancyMap, edges: list[FloatArray]) -> tuple[list[FloatArray], FloatArray | None]:
    """Return edges [m] with points where the kind of wall changes, and that of each segment, as MapTrack.marks."""
    if occupancy.marks is None:
        return edges, None
    cut, marks = [], []
    for edge in edges:
        (fine,) = subdivide(edge, occupancy.resolution)
        at = np.floor(occupancy.to_pixels(segments(fine).mean(axis=1))).astype(int)
        column, row = np.clip(at, 0, np.array(occupancy.marks.shape)[::-1] - 1).T
        own = occupancy.marks[row, column]
        begins = np.flatnonzero(own != np.roll(own, 1))
        for first, behind in zip(begins, np.append(begins[1:], begins[:1] + len(own)), strict=True):
            if behind - first <= MARK_REACH:  # of a speck
                own[np.arange(first, behind) % len(own)] = own[first - 1]
        corner = np.isin(fine @ (1.0, 1.0j), edge @ (1.0, 1.0j))
        kept = corner | (own != np.roll(own, 1))
        cut.append(fine[kept])
        marks.append(own[kept].astype(np.float64))
    return cut, read_only(np.concatenate(marks))


def _map_scene(occupancy: OccupancyMap, course: MapCourse, start: FloatArray) -> Scene:
    """Return the scene of an open way, from the end that is nearer to `start` (2,) [m]."""
    if occupancy.kinds:
        raise TrackError(f"{occupancy.path}: walls, but there is no way round; accepted: none, as of a scene")
    lengths = np.hypot(*np.diff(course.line, axis=0).T) * occupancy.resolution
    if lengths.sum() < SHORTEST_WAY:
        raise TrackError(
            f"{occupancy.path}: no closed course, and the longest open way is of {lengths.sum():.1f} m; accepted: "
            f"walls with a way round, or a way of {SHORTEST_WAY:.1f} m, {BEHIND:.0f} m of it behind the start and "
            f"{BEYOND:.0f} m beyond the goal"
        )
    way = clear_line(occupancy, course)
    if np.hypot(*(way[-1] - start)) < np.hypot(*(way[0] - start)):
        way = way[::-1]
    length = float(np.hypot(*np.diff(way, axis=0).T).sum())
    walls = [occupancy.to_world(trace(outline))[::-1] for outline in course.outlines]
    return Scene(
        name=occupancy.path.stem,
        way=way,
        start=BEHIND,
        goal=length - BEYOND,
        walls=tuple(Prism(footprint=feet) for wall in walls for feet in wall_footprints(wall).tolist()),
        time_limit=default_time_limit(1, length),
    )


def clear_line(occupancy: OccupancyMap, course: MapCourse) -> FloatArray:
    """Return the line of a course in the world, even and smooth, and still clear of the walls. Shape (n, 2) [m]."""
    from scipy.spatial import cKDTree

    line = occupancy.to_world(course.line)
    walls = cKDTree(occupancy.to_world(np.concatenate(course.outlines)))
    clearance = walls.query(line)[0]
    sigma = _SMOOTHING * float(np.median(clearance))
    for _ in range(_HALVINGS):
        smoother = smooth(line, sigma, SPACING) if course.closed else _smooth_way(line, sigma)
        if walls.query(smoother)[0].min() > 0.8 * clearance.min():
            break
        sigma *= 0.5
    return smoother


def _smooth_way(way: FloatArray, sigma: float) -> FloatArray:
    """Do for an open line what polyline.smooth does for a loop: its ends stay. Shape (n, 2) [m]."""
    loop = np.concatenate((way, 2.0 * way[-1] - way[-2:0:-1]))  # there and, turned about its end, back
    length = float(np.hypot(*np.diff(way, axis=0).T).sum())
    at = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(loop, axis=0).T))))
    count = max(3, round(length / SPACING))
    ahead = way[-1] - way[0]
    share = np.arange(2 * count) / count  # in ways; the line less its mean advance is periodic
    even = np.column_stack([np.interp(share * length, at, loop[:, axis]) for axis in range(2)]) - share[:, None] * ahead
    waves = np.fft.rfftfreq(len(even), d=length / count)
    gaussian = portable.exp(-2.0 * (np.pi * sigma * waves) ** 2)[:, None]
    smoothed = np.fft.irfft(np.fft.rfft(even, axis=0) * gaussian, n=len(even), axis=0) + share[:, None] * ahead
    return np.asarray(smoothed[: count + 1])


def _oriented(line: FloatArray, start: FloatArray, direction: Direction | None, heading: float) -> FloatArray:
    """Return a loop (n, 2) [m] from its place nearest to `start`; without a direction, the one nearer to `heading`."""
    ahead = steps(line)
    share = np.clip(np.sum((start - line) * ahead, axis=1) / np.sum(ahead * ahead, axis=1), 0.0, 1.0)
    feet = line + share[:, None] * ahead
    first = int(np.argmin(np.hypot(*(feet - start).T)))
    loop = np.concatenate((feet[first : first + 1], np.roll(line, -first - 1, axis=0)))
    loop = loop[step_lengths(loop) > _REPEATED]
    if direction is None:
        turn = math.cos(_heading(loop) - heading) < 0.0
    else:
        turn = (enclosed_area(loop) > 0.0) != (direction == "counterclockwise")
    (even,) = resample(np.roll(loop[::-1], 1, axis=0) if turn else loop, SPACING)
    return even


def _heading(line: FloatArray) -> float:
    """Return the heading of a loop at its first point [rad]."""
    x, y = line[1] - line[-1]
    return math.atan2(y, x)


def _distances(line: FloatArray, walls: list[FloatArray]) -> FloatArray:
    """Return the distance from each point of a line (n, 2) to the nearest wall. Shape (n,) [m]."""
    from scipy.spatial import cKDTree

    points = np.concatenate([subdivide(wall, _WALL_SPACING)[0] for wall in walls])
    return np.asarray(cKDTree(points).query(line)[0])
