"""CSV files of lines: the centreline of a course, and the line that a planner follows.

    line = read_line_csv("aut.csv", ("right", "left"))
    line.points, line.values                      # (n, 2) and (2, n) [m]

A header names the columns: the first row, or a comment above it. Its names are obeyed, in any order and among others:

    x, y                 x_m, y_m; also x_ref, center_x, pos_x and the like
    right, left          w_tr_right_m, w_tr_left_m; also width_right, w_left, d_right and the like; or one, width
    speed                vx_mps; also v, speed, velocity and the like

Names may end in a unit: m, cm or mm, and m/s or km/h, as in x_cm or "speed [km/h]". Without a header, columns are what
their number says:

    x_m, y_m                                                 a line
    x_m, y_m, vx_mps                                         a line with speeds
    x_m, y_m, w_tr_right_m, w_tr_left_m                      a centreline
    s_m; x_m; y_m; psi_rad; kappa_radpm; vx_mps; ax_mps2     a raceline of TUM's optimiser

A column that turns with the line is a heading, and neither a width nor a speed. Cells are separated by commas,
semicolons, tabs or spaces. Lines starting with `#` are comments.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import TrackError
from ..messages import FloatArray
from .files import read_bytes

COLUMNS = ("x_m", "y_m", "w_tr_right_m", "w_tr_left_m")
RACELINE = ("s_m", *COLUMNS[:2], "psi_rad", "kappa_radpm", "vx_mps", "ax_mps2")
MOST_POINTS = 200_000
"""Work on a line grows with its points."""

_WITHOUT_HEADER = {2: COLUMNS[:2], 3: (*COLUMNS[:2], "vx_mps"), 4: COLUMNS, 7: RACELINE}
_LINES: tuple[str, ...] = (
    "{}",
    "{}_ref",
    "ref_{}",
    "{}_center",
    "center_{}",
    "{}_centre",
    "centre_{}",
    "centerline_{}",
)
_LINES += ("centreline_{}", "{}_pos", "pos_{}", "position_{}", "pose_{}", "{}_position")
_SIDES: tuple[str, ...] = (
    "w_tr_{}",
    "w_{}",
    "width_{}",
    "{}_width",
    "width_tr_{}",
    "track_width_{}",
    "d_{}",
    "dist_{}",
    "{}_dist",
)
_SIDES += ("distance_{}", "{}_distance", "dist_to_{}", "{}")
_NAMES = {side: tuple(form.format(side) for form in _SIDES) for side in ("right", "left")} | {
    "width": ("width", "track_width"),
    "speed": ("vx", "v", "speed", "velocity", "vel", "v_x", "v_ref", "vx_ref", "ref_speed", "target_speed"),
}
_LENGTHS = {"": 1.0, "m": 1.0, "meter": 1.0, "meters": 1.0, "metre": 1.0, "metres": 1.0, "cm": 0.01, "mm": 0.001}
_SPEEDS = {"": 1.0, "mps": 1.0, "m_s": 1.0, "ms": 1.0, "kmh": 1.0 / 3.6, "km_h": 1.0 / 3.6, "kph": 1.0 / 3.6}
_NAME = re.compile(r"[^\W\d]\w*( ?[\[(].*)?")  # of a column, with its unit in brackets
_GREATEST = 1e9  # [m] or [m/s]: squares of it are still numbers
_SHOWN = 8  # names of a header in a message
_HEADING, _ROUND = 0.9, 0.7  # mean length of unit vectors that agree in direction, and of those of a line that bends
_LEAST_GAP, _WIDEST_GAP = 1.0, 1.5  # [m], and times the longest step: that a closed line may leave to its first point


@dataclass(frozen=True, kw_only=True, eq=False)
class LineFile:
    """A line and what its file says of each point."""

    points: FloatArray  # (n, 2) [m]
    values: FloatArray | None  # (k, n) [m] or [m/s], as was asked for; None: the file has no such columns
    columns: str  # what the columns are, in words


def read_line_csv(path: str | Path, wanted: tuple[str, ...]) -> LineFile:
    """Read a CSV of a line.

    Args:
      path: the file.
      wanted: ("right", "left"): the widths; ("speed",): the speeds. Other columns are not looked at.

    Raises:
      TrackError: with the file, and the line where there is one: a file that cannot be read or is empty, a header that
        names no x and y, a wrong number of columns, a cell that is no finite number, a width or a speed that is not
        positive, more than MOST_POINTS points.
    """
    columns, header, rows = _split(path, _read_text(Path(path)))
    places = _places(path, columns, header, wanted)
    table = _numbers(path, rows, columns, places)
    points, values = table[:, :2], table[:, 2:].T if len(places) > 2 else None
    said = f"columns {', '.join(columns[:_SHOWN])}{', ...' if len(columns) > _SHOWN else ''}"
    if not header and columns == RACELINE and not _is_distance(_numbers(path, rows, columns, {0: 1.0})[:, 0], points):
        raise TrackError(
            f"{path}: has {len(columns)} columns without names, of which the first is no distance along the line; "
            f"accepted: {', '.join(RACELINE)}, or a header that names the columns"
        )
    if not header and values is not None and any(_is_heading(points, column) for column in values):
        said, values = f"{len(columns)} columns without names, of which one is the heading of the line", None
    if values is not None and len(values) < len(wanted):  # one width, half of it to either side
        values = np.repeat(0.5 * values, 2, axis=0)
    return LineFile(points=points, values=values, columns=said)


def require_closed(points: FloatArray) -> None:
    """Make sure that a line (n, 2) [m] ends about where it begins.

    Raises:
      TrackError: it does not; the message says by how much.
    """
    steps = np.hypot(*np.diff(points, axis=0).T)
    gap, longest = float(np.hypot(*(points[0] - points[-1]))), float(steps.max(initial=0.0))
    if gap > max(_LEAST_GAP, _WIDEST_GAP * longest):
        raise TrackError(
            f"the line ends {gap:.2f} m from its first point, in steps of {longest:.2f} m at most: it is not closed; "
            "accepted: a closed line; one that repeats its first point at the end is closed by a straight"
        )


def _read_text(path: Path) -> str:
    """Return the text of a file in UTF-8, or in Latin-1, in which older programs write."""
    accepted = f"accepted: a .csv of {', '.join(COLUMNS)}"
    try:
        content = read_bytes(path)
    except FileNotFoundError:
        raise TrackError(f"{path}: no such file; {accepted}") from None
    except IsADirectoryError:
        raise TrackError(f"{path}: is a folder; {accepted}") from None
    except OSError as error:
        raise TrackError(f"{path}: cannot be read: {error.strerror or error}; {accepted}") from error
    if b"\0" in content:
        raise TrackError(f"{path}: is not a text file; {accepted}")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("latin-1")


def _split(path: str | Path, text: str) -> tuple[tuple[str, ...], int, list[tuple[int, list[str]]]]:
    """Return the names of the columns, the line of the header, 0 without one, and line and cells of each row."""
    columns: tuple[str, ...] = ()
    header, is_bare = 0, False
    above, above_line = "", 0  # the last comment, which may be a header
    rows: list[tuple[int, list[str]]] = []
    for number, line in enumerate(re.split("\r\n|\r|\n", text), start=1):
        content = line.strip()
        cells = _cells(content)
        if not content or (content.startswith("#") and (rows or is_bare)):
            continue
        if content.startswith("#"):
            above, above_line = content.lstrip("#").rpartition(":")[2].strip(), number
            if _lines_of(_cells(above)):
                columns, header = tuple(_cells(above)), number
            continue
        if not rows and not is_bare and not any(map(_is_number, cells)):
            columns, header, is_bare = tuple(cells), number, True
            continue
        if not rows and not header:
            names = _cells(above) if re.search("[;,\t]", above) else []
            if len(names) == len(cells) and all(map(_NAME.fullmatch, names)):
                columns, header = tuple(names), above_line
            else:
                columns = _WITHOUT_HEADER.get(len(cells), ())
        if len(cells) != len(columns):
            accepted = f"{len(columns)}, {', '.join(columns[:_SHOWN])}"
            if not columns:
                accepted = f"4, {', '.join(COLUMNS)}; or, without widths, 2 or 3 or 7; or a header that names them"
            raise TrackError(f"{path}: line {number} has {len(cells)} columns; accepted: {accepted}")
        rows.append((number, cells))
        if len(rows) > MOST_POINTS:
            raise TrackError(f"{path}: line {number}: more than {MOST_POINTS} points; accepted: {MOST_POINTS} at most")
    if not rows:
        raise TrackError(f"{path}: is empty; accepted: one point a line, {', '.join(COLUMNS)}")
    return columns, header, rows


def _cells(content: str) -> list[str]:
    separator = next((mark for mark in (";", ",", "\t") if mark in content), None)
    return [cell.strip().strip("\"'").strip() for cell in content.split(separator)]


def _plain(name: str, units: Iterable[str]) -> tuple[str, str]:
    """Return a name in small letters without its unit, and the unit, one of some."""
    name = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name.strip()).casefold()
    words = [word for word in re.split(r"[\s_\-\[\](){}/]+", name) if word]
    for count in (2, 1):
        unit = "_".join(words[-count:])
        if len(words) > count and unit in units:
            return "_".join(words[:-count]), unit
    return "_".join(words), ""


def _lines_of(names: Iterable[str]) -> list[tuple[int, int]]:
    """Return the places of x and y of each line that columns name."""
    plain = [_plain(name, _LENGTHS)[0] for name in names]
    pairs = (
        tuple([k for k, name in enumerate(plain) if name == form.format(axis)] for axis in "xy") for form in _LINES
    )
    return [pair for xs, ys in pairs for pair in zip(xs, ys, strict=False)]


def _places(path: str | Path, columns: tuple[str, ...], header: int, wanted: tuple[str, ...]) -> dict[int, float]:
    """Return the columns that are read, x and y first, and their units in metres or metres a second.

    Of what is wanted there is either all, or one width for both sides, or nothing.
    """
    where, named = f"{path}: line {header}", ", ".join(columns[:_SHOWN])
    lines = _lines_of(columns)
    if len(lines) != 1:
        found = "no x and y" if not lines else f"several lines, {', '.join(columns[x] for x, _ in lines)}"
        raise TrackError(f"{where} names {found}, in {named}; accepted: one x and one y, as {', '.join(COLUMNS)}")
    units = _SPEEDS if wanted == ("speed",) else _LENGTHS
    plain = [_plain(name, units) for name in columns]
    read = {
        quantity: next((k for form in _NAMES[quantity] for k, (name, _) in enumerate(plain) if name == form), None)
        for quantity in (*wanted, "width")
    }
    values = [place for quantity in wanted if (place := read[quantity]) is not None]
    if 0 < len(values) < len(wanted):
        raise TrackError(f"{where} names one side's width only, {columns[values[0]]}; accepted: one to either side")
    if not values and len(wanted) > 1 and read["width"] is not None:
        values = [read["width"]]
    return {place: _LENGTHS[_plain(columns[place], _LENGTHS)[1]] for place in lines[0]} | {
        place: units[plain[place][1]] for place in values
    }


def _numbers(
    path: str | Path, rows: list[tuple[int, list[str]]], columns: tuple[str, ...], places: dict[int, float]
) -> FloatArray:
    """Return the numbers of some columns in metres and metres a second, of which x and y may be negative. (n, k)."""
    table = np.empty((len(rows), len(places)))
    for k, (number, cells) in enumerate(rows):
        for j, (place, unit) in enumerate(places.items()):
            cell = cells[place]
            table[k, j] = unit * float(cell) if _is_number(cell) else math.nan
            if not abs(table[k, j]) <= _GREATEST:
                accepted = f"a finite number, {_GREATEST:.0e} at most"
                raise TrackError(f"{path}: line {number}: {columns[place]} is {cell[:60]!r}; accepted: {accepted}")
            if j > 1 and table[k, j] <= 0.0:
                raise TrackError(f"{path}: line {number}: {columns[place]} is {cell}; accepted: a number above 0")
    return table


def _is_heading(points: FloatArray, column: FloatArray) -> bool:
    """Return whether a column [rad or deg] turns with a line that bends, whatever it is counted from."""
    ahead = np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0)
    heading = np.arctan2(ahead[:, 1], ahead[:, 0])
    if abs(np.exp(1j * heading).mean()) > _ROUND:
        return False
    return any(abs(np.exp(1j * (angle - heading)).mean()) > _HEADING for angle in (column, np.radians(column)))


def _is_distance(column: FloatArray, points: FloatArray) -> bool:
    """Return whether a column is about the distance along a line: it grows, by half to twice the line's length."""
    length = float(np.hypot(*np.diff(points, axis=0).T).sum())
    return bool((np.diff(column) >= 0.0).all()) and 0.5 * length <= column[-1] - column[0] <= 2.0 * length


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True
