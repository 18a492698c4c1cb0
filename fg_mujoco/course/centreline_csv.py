"""Centreline files: a track as a closed line with a width to either side.

    track = read_centreline("aut.csv")
    track = read_centreline("aut_raceline.csv", width=2.0)        # or load_track("aut_raceline.csv[width=2]")
    track = read_centreline("left.csv", boundary="right.csv")
    track = read_centreline("aut.csv", direction="clockwise")

The columns are `x_m, y_m, w_tr_right_m, w_tr_left_m`, or what a header names (line_file). A file without widths needs a
width, or is one boundary of the course and needs the other; these are the walls. Speeds are not used.

The line is closed: it ends about where it begins, and may repeat its first point at the end. A point that repeats the
one before is dropped.

A line whose steps are all at most `DENSE` is kept as it is, square corners included. A sparser line is resampled every
`SPACING` on the periodic cubic spline through its points, so that its walls are smooth. Its widths are interpolated
linearly.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from .. import from_addons
from ..errors import TrackError, accepted_names, nearest
from ..messages import FloatArray
from .documents import comment
from .files import foreign_kind, is_file, read_text
from .line_file import LineFile, read_line_file, require_closed
from .line_names import COLUMNS
from .polyline import enclosed_area, spline, step_lengths
from .track import MIN_POINTS, MapTrack, Track, check_size

DENSE = 0.5  # [m] longest step of a line that is kept as it is
SPACING = 0.2  # [m] step that a sparser line is resampled to

MOST_COURSE_POINTS = 20_000

Direction = Literal["clockwise", "counterclockwise"]
DIRECTIONS: tuple[Direction, ...] = ("clockwise", "counterclockwise")

WIDEST_ROAD = 30.0
"""[m] No road is wider, of those that are driven from wall to wall."""

_MILLIMETRES = 600.0  # a number of so many, or more, is a width of this kind of course in millimetres
_SPECIFICATION = re.compile(r"(?is)(?P<path>.*\.(?:csv|txt|json|npy|ya?ml))(\[(?P<settings>.*)\])?")
_ANY = re.compile(r"(?s)(?P<path>.+)\[(?P<settings>.*)\]")
_REPEATED = 1e-3  # [m] points nearer than this are one
_APART, _MOST_PAIRS = 0.1, 2.5e6  # [m], and pairs of points within a width of each other: 4 s
_GREATEST_SCALE = 1e6  # of a course, and a width in metres: numbers in messages stay short
_JUMP = 5.0  # times the usual width: a width that is no longer that of a wall beside the line


def write_centreline(track: Track, path: str | Path, header_lines: Sequence[str] = ()) -> None:
    """Write the centreline and widths of a track; `read_centreline` gives the same numbers back.

    `header_lines` are comments above the column names. Raises TrackError for a path that cannot be written.
    """
    try:
        from .writing import write_file

        write_file(path, centreline_text(track, header_lines).encode())
    except OSError as error:
        raise TrackError(f"{path}: cannot be written: {error.strerror or error}") from error


def centreline_text(track: Track, header_lines: Sequence[str] = ()) -> str:
    """Return the text of the file that `write_centreline` writes."""
    rows = np.column_stack((track.centreline, track.width_right, track.width_left)).tolist()
    lines = [f"# {comment(line)}" for line in (*header_lines, ", ".join(COLUMNS))]
    lines += [", ".join(repr(value) for value in row) for row in rows]
    return "\n".join(lines) + "\n"


def read_centreline(
    path: str | Path,
    *,
    width: float | None = None,
    boundary: str | Path | None = None,
    scale: float = 1.0,
    line: str | None = None,
    direction: Direction | None = None,
    said: bool = False,
) -> Track:
    """Read a centreline file; the track is named after it.

    Args:
      path: the file.
      width: of the track [m], half of it to either side of the line, in place of what the file has.
      boundary: the file of the other boundary of the course, of which `path` has one.
      scale: by which the course is larger than its file says.
      line: which of the lines of a file of several; None: its centreline.
      direction: in which the track is driven; None: in the order of the points.
      said: whether a `Note` says what was understood.

    Raises:
      TrackError: with the file, and the line where there is one: a file that cannot be read or is empty, too few
        points, a wrong number of columns, a cell that is no finite number, a width that is not positive or is missing,
        an unknown direction, or what `Track` refuses.
    """
    path = Path(path)
    if not 1.0 / _GREATEST_SCALE <= scale <= _GREATEST_SCALE:
        raise TrackError(f"{path}: scale is {scale!r}; accepted: {1.0 / _GREATEST_SCALE:g} to {_GREATEST_SCALE:g}")
    points, widths, file = _read(path, boundary, scale, line, said=said)
    if width is not None:
        if file.walls is not None:
            raise TrackError(f"{path}: width is {width!r}, but the two boundaries are the walls; accepted: none")
        if widths is not None:
            file = replace(file, said=f"{file.said}; width={width:g} in place of its widths")
        if not 0.0 < width <= _GREATEST_SCALE:
            accepted = f"a positive number of metres, {WIDEST_ROAD:g} at most"
            raise TrackError(f"{path}: width is {width!r}; accepted: {accepted}")
        widths = np.full((2, len(points)), 0.5 * width)
        try:
            _require_metres(points, widths)
        except TrackError as error:
            raise TrackError(f"{path}: {error}") from error
    if widths is None:
        raise TrackError(
            f"{path}: has no widths, but {file.columns}; accepted: {path.name}[width=W], the width of the track in "
            f"metres, or, of a boundary, {path.name}[boundary=FILE], the other one"
        )
    if direction is not None and direction not in DIRECTIONS:
        raise TrackError(f"{path}: direction is {direction!r}; {accepted_names(direction, DIRECTIONS)}")
    _require_apart(path, points, widths)
    (right, left), walls = widths, tuple(scale * wall for wall in file.walls or ())
    if direction is not None and (enclosed_area(points) > 0.0) != (direction == "counterclockwise"):
        points, right, left = (np.roll(column[::-1], 1, axis=0) for column in (points, left, right))
        walls = tuple(wall[::-1] for wall in reversed(walls))
    hint, widest, usual = "", float(widths.max()), float(np.sort(widths, None)[widths.size // 2])
    if widest > _JUMP * usual:  # as of rays that look along a corridor
        hint = f"; a width is {widest:.3g} m, most are {usual:.3g}: {path.name}[width=W] sets one for all"
    try:
        name = path.parent.name if path.suffix in (".yaml", ".yml") else path.stem  # of a track.yaml
        values = {"centreline": points, "width_right": right, "width_left": left}
        if walls:
            values |= {"wall_right": walls[0], "wall_left": walls[1]}
        track = (MapTrack if walls else Track)(name=name or path.stem, **values)
        _ = track.left_wall  # drawn here, so that a refusal names the file
    except TrackError as error:
        raise TrackError(f"{path}: {error}{hint}") from error
    if said:
        replace(file, said=file.said + hint).note()
    return track


def read_points(path: str | Path) -> FloatArray:
    """Return the points of a centreline file, whose widths are not used, (n, 2) [m]; raise as `read_centreline`."""
    return _read(Path(path))[0]


def is_centreline(name: str) -> bool:
    """Return whether a name of a track, as load_track takes it, is that of a centreline file, and not of a map."""
    match = _specified(name)
    if match is None or not match["path"].lower().endswith(("yaml", "yml")):
        return match is not None
    try:
        text = read_text(match["path"])
    except (OSError, UnicodeDecodeError):
        return False
    return bool(re.search(r"(?m)^cent(re|er)line\s*:", text)) and not re.search(r"(?m)^image\s*:", text)


def _specified(name: str) -> re.Match[str] | None:
    """Return the parts of a name that is that of a table by its suffix, or that of any text file with settings."""
    match = _ANY.fullmatch(name)
    other = match is not None and foreign_kind(match["path"]) is None and is_file(match["path"])
    return _SPECIFICATION.fullmatch(name) or (match if other else None)


def load_centreline(name: str) -> Track:
    """Load a track by `FILE.csv` or `FILE.csv[SETTING=VALUE,...]`, with settings and errors of `read_centreline`."""
    match = _specified(name)
    if match is None:
        return read_centreline(name, said=True)
    return read_centreline(match["path"], said=True, **read_settings(name, match["settings"] or "", _SETTINGS))


_SETTINGS: dict[str, tuple[str, Callable[[str], Any]]] = {
    "width": ("METRES", float),
    "boundary": ("FILE", str),
    "scale": ("NUMBER", float),
    "line": ("NAME", str),
    "direction": ("clockwise or counterclockwise", str),
}
"""Settings of a file's name: what is accepted, and what reads it."""


def read_settings(name: str, text: str, known: Mapping[str, tuple[str, Callable[[str], Any]]]) -> dict[str, Any]:
    """Return the values of `SETTING=VALUE,...`, the text in the brackets of a name.

    `known` has of each setting what is accepted, and what reads it, which raises ValueError or KeyError.

    Raises:
      TrackError: a setting that is unknown, or there twice, or has a value that cannot be read.
    """
    settings: dict[str, Any] = {}
    for setting in filter(None, text.split(",")):
        key, _, value = setting.partition("=")
        if key not in known or not value or key in settings:
            forms = ", ".join(f"{each}={form}" for each, (form, _) in known.items())
            meant = nearest(key, known) if key not in known else None
            hint = f"; did you mean {meant!r}?" if meant else ""
            raise TrackError(f"{name!r}: setting {setting!r}; accepted: each once, of {forms}{hint}")
        accepted, read = known[key]
        try:
            settings[key] = read(value)
        except (ValueError, KeyError):
            raise TrackError(f"{name!r}: {key} is {value!r}; accepted: {accepted}") from None
    return settings


def _read(
    path: Path,
    boundary: str | Path | None = None,
    scale: float = 1.0,
    name: str | None = None,
    *,
    said: bool = False,
) -> tuple[FloatArray, FloatArray | None, LineFile]:
    """Return the line (n, 2), the widths to the right and left (2, n) [m], None without, and the file."""
    file = read_line_file(path, course=boundary is None, line=name)
    _require_course(path, file)
    line, widths = file.points, np.empty((0, len(file.points)))
    if boundary is not None:
        other = read_line_file(boundary, course=False)
        _require_course(boundary, other)
        if said:
            other.note()
        line, right, left, walls = from_addons.between_boundaries(path, line, other.points)
        widths, file = np.array([right, left]), replace(file, walls=walls)
    elif "right" in file.values:
        widths = np.array([file.values["right"], file.values["left"]])
    line, widths = scale * line, scale * widths
    kept = step_lengths(line) > _REPEATED  # the last of those that repeat each other stays
    if np.count_nonzero(kept) < MIN_POINTS:
        raise TrackError(
            f"{path}: {np.count_nonzero(kept)} points; accepted: at least {MIN_POINTS} different ones in a closed loop"
        )
    try:
        require_closed(line)
        line, widths = line[kept], widths[:, kept]
        _require_metres(line, widths)
        check_size(line)  # before it is resampled
    except TrackError as error:
        raise TrackError(f"{path}: {error}") from error
    if step_lengths(line).max() > DENSE:
        line, *resampled = spline(line, SPACING, *widths)
        widths = np.array(resampled)
    return line, widths if len(widths) else None, file


def _require_course(path: str | Path, file: LineFile) -> None:
    """Raise TrackError for more points than a course needs."""
    if len(file.points) > MOST_COURSE_POINTS:
        said = f"{len(file.points)} points"
        raise TrackError(f"{path}: {said}; accepted: {MOST_COURSE_POINTS} at most of a course, {_APART} m apart")


def _require_apart(path: Path, points: FloatArray, widths: FloatArray) -> None:
    """Raise TrackError for points that are so close that walls of these widths (2, n) [m] would take minutes."""
    apart, width = float(step_lengths(points).mean()), float(widths.sum(axis=0).mean())
    if apart < _APART and len(points) * width / apart > _MOST_PAIRS:
        said = f"{len(points)} points, {apart:.2g} m apart, and {width:.3g} m wide"
        raise TrackError(f"{path}: {said}; accepted: points {_APART} m apart")


def _require_metres(line: FloatArray, widths: FloatArray) -> None:
    """Raise TrackError where a course is wider than any, most likely in another unit. The walls would take minutes."""
    width = float(np.sort(widths.sum(axis=0))[widths.shape[1] // 2]) if len(widths) else 0.0
    if width > WIDEST_ROAD:
        unit, name = (0.001, "millimetres") if width > _MILLIMETRES else (0.01, "centimetres")
        length = float(step_lengths(line).sum())
        raise TrackError(
            f"the course is {length:.0f} m long and {width:.0f} m wide: {name}? Then it is {unit * length:.1f} m long "
            f"and {unit * width:.2f} m wide; accepted: metres, {WIDEST_ROAD:.0f} m wide at most, or a header with the "
            "unit, as x_cm, y_cm, w_tr_right_cm, w_tr_left_cm"
        )
