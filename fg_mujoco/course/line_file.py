"""Files of lines: the centreline of a course, and the line that a planner follows. One reader for both.

    file = read_line_file("aut.csv", course=True)
    file.points, file.values["right"], file.values["left"]      # (n, 2), (n,) and (n,) [m]

Columns are read by their names: those of a header, with or without `#`, in any order and among others.

    x, y                 x_m, y_m; also x_ref, center_x, pos_x and the like
    right, left          w_tr_right_m, w_tr_left_m; also width_right, w_left, d_right and the like; or one, width
    two boundaries       left_x, left_y, right_x, right_y, or X_i, Y_i, X_o, Y_o, which are the walls
    s, psi, kappa        distance, heading and curvature; also yaw, theta, curvature and the like
    speed, ax            vx_mps, ax_mps2; also v, speed, velocity, acc and the like

Names may end in a unit: m, cm or mm, m/s or km/h, rad or deg, as in x_cm or "speed [km/h]". Without a header, columns
are what their number says:

    x_m, y_m                                                 a line
    x_m, y_m, vx_mps                                         a line with speeds
    x_m, y_m, w_tr_right_m, w_tr_left_m                      a centreline
    x_m, y_m, psi_rad, vx_mps                                a log: the third is a heading, or often not above 0; or
                                                             x_m, y_m, vx_mps, psi_rad
    s_m; x_m; y_m; psi_rad; kappa_radpm; vx_mps; ax_mps2     a raceline of TUM's optimiser, also without s_m

Headings in degrees and speeds in km/h that are named otherwise are found by the shape of the line, and refused. Text
files have cells separated by commas, semicolons, tabs or spaces; lines starting with `#` are comments, and so is text
above a header that names a line. Other files (JSON, NumPy, a folder's track.yaml) are made a table of columns by an
add-on.
"""

from __future__ import annotations

import io
import math
import re
import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from .. import from_addons, portable
from ..errors import Note, TrackError
from ..messages import FloatArray
from .documents import comment
from .files import read_bytes
from .line_names import COLUMNS, RACELINE, SHOWN, lines_of, name_a_line, places_of, plain_name, unit_of
from .polyline import MOST_POINTS

MOST_COLUMNS = 200
_MOST_CELLS, _MOST_ABOVE, _MOST_CHARACTERS = 3_000_000, 1000, 20_000  # in all, lines above the first point, in a line

FOREIGN = (".json", ".npy", ".yaml", ".yml")
"""Suffixes of files that the add-on `formats` makes tables of."""

_LOG = (*COLUMNS[:2], "psi_rad", "vx_mps")
_WITHOUT_HEADER = {2: COLUMNS[:2], 3: (*COLUMNS[:2], "vx_mps"), 4: COLUMNS, 6: RACELINE[1:], 7: RACELINE}
_NAME = re.compile(r"[^\W\d]\w*( ?[\[(].*)?")  # of a column, with its unit in brackets
_GREATEST = 1e9  # [m] or [m/s]: squares of it are still numbers
_FEW = 0.1  # share of widths that are not above 0, beyond which a column is something else
_HEADING, _ROUND = 0.9, 0.7  # mean length of unit vectors that agree in direction, and of those of a line that bends
_LEAST_GAP, _WIDEST_GAP = 1.0, 1.5  # [m], and times the longest step: that a closed line may leave to its first point
_HARDEST = 35.0  # [m/s^2] in a corner that no car of this kind holds: speeds that ask for more are in km/h
_BENT = 0.1  # [1/m] least curvature at which speeds are looked at
_CORNER = 0.4  # [m] to either side of a point, over which its curvature is taken


@dataclass(frozen=True, kw_only=True)
class Table:
    """Columns as a file has them."""

    names: tuple[str, ...]  # of the columns; without a header, what their number says
    header: str  # where the names stand, as "line 3"; nothing: the file does not name them
    rows: Sequence[Sequence[str | float]]
    places: Sequence[int]  # of the rows in the file
    row: str = "line"  # what a row is called
    said: str = ""  # what else is to be said of the file
    path: Path | None = None  # that the table is read from, if it is another


@dataclass(frozen=True, kw_only=True, eq=False)
class LineFile:
    """A line and what its file says of each point."""

    points: FloatArray  # (n, 2) [m]
    values: Mapping[str, FloatArray]
    """What the file has of right and left [m], speed [m/s], s [m], psi [rad], kappa [1/m] and ax [m/s^2], (n,) each."""

    columns: str  # what the columns are, in words
    said: str  # what was understood, in a line
    walls: tuple[FloatArray, FloatArray] | None = None  # to the right and left, (k, 2) [m] each, of two boundaries

    def note(self) -> LineFile:
        """Say what was understood, and return this."""
        warnings.warn(self.said, Note, stacklevel=3)
        return self


def read_line_file(path: str | Path, *, course: bool, line: str | None = None) -> LineFile:
    """Read a file of a line.

    Args:
      path: the file.
      course: whether it is read as the centreline of a course, which needs widths, or as a line to drive, of which
        speeds are used. It decides between the lines of a file of several, and what has to be in order.
      line: which of the lines of a file of several; None: as `course` says.

    Raises:
      TrackError: with the file, and the line where there is one: what cannot be understood, or is too much.
    """
    path = Path(path)
    if path.suffix.lower() in FOREIGN:
        table = from_addons.line_table(path, course=course, line=line)
    elif line is not None:
        raise TrackError(f"{path}: line is {line!r}, but the file has one line only; accepted: no line=")
    else:
        table = read_text_table(path)
    path = table.path or path
    require_few(path, len(table.rows), "point")
    return _understood(path, table, course)


def _understood(path: Path, table: Table, course: bool) -> LineFile:
    """Return the line of a table."""
    if not table.header:
        table = _named_by_rows(path, table)
    names = table.names
    said = f"columns {', '.join(names[:SHOWN])}{', ...' if len(names) > SHOWN else ''}"
    said += "" if table.header else ", by their number"
    line, found, bounds = places_of(f"{path}: {table.header}", names)
    wanted = ("right", "left", "width") if course else ("speed",)
    used = {quantity: place for quantity, place in found.items() if quantity in wanted}
    notes = [table.said] if table.said else []
    if not course and used and not any(_cell(row[used["speed"]]) for row in table.rows):
        used, notes = {}, [*notes, f"{names[found['speed']]} is 0 everywhere and not used"]
    points = _numbers(path, table, [(place, unit_of(names[place], "x")) for place in line])
    values = {
        quantity: _numbers(path, table, [(place, unit_of(names[place], quantity))], least=0.0)[:, 0]
        for quantity, place in used.items()
    }
    others = {quantity: place for quantity, place in found.items() if quantity not in used}
    for quantity, place in others.items():  # what nobody needs may be anything
        unit = unit_of(names[place], quantity)
        column = np.array([unit * _cell(row[place]) for row in table.rows])
        if np.isfinite(column).all():
            values[quantity] = column
    walls = None
    if line and (used or not course):
        bounds = ()
    if bounds:
        one, other = (_numbers(path, table, [(k, unit_of(names[k], "x")) for k in bounds[i : i + 2]]) for i in (0, 2))
        points, right, left, walls = from_addons.between_boundaries(path, one, other, points if line else None)
        values, notes = {"right": right, "left": left}, [*notes, "the two boundaries are the walls"]
    elif not course and (shifted := _shifted(table, points)) is not None:
        points, notes = shifted, [*notes, "the line is the reference moved by alpha along its normals"]
    notes += _odd(path, table, points, values, found)
    if "width" in values:  # one width, half of it to either side
        values["right"] = values["left"] = 0.5 * values.pop("width")
    read = {*line, *used.values(), *bounds}
    note = f"{path}: {len(points)} points of {', '.join(names[place] for place in sorted(read))}"
    if not table.header:
        note += ", by their number"
    if left_out := [name for place, name in enumerate(names) if place not in read and name]:
        note += f"; not used: {', '.join(left_out[:SHOWN])}{', ...' if len(left_out) > SHOWN else ''}"
    return LineFile(points=points, values=values, columns=said, said="; ".join([note, *notes]), walls=walls)


def _named_by_rows(path: Path, table: Table) -> Table:
    """Return a table without a header with the names that its rows agree with; raise TrackError for none."""
    names = table.names
    rows = np.array([[_cell(cell) for cell in row] for row in table.rows])
    at = names.index(COLUMNS[0])
    points = rows[:, at : at + 2]
    if not np.isfinite(points).all():
        return table  # which is refused where it is read
    turns = [len(names) > 2 and _is_heading(points, column) for column in rows.T[at + 2 :]]
    if names == COLUMNS and (turns[0] or float((rows[:, 2] <= 0.0).mean()) > _FEW):
        return replace(table, names=_LOG)
    if names == COLUMNS and turns[1]:
        return replace(table, names=(*_LOG[:2], *_LOG[:1:-1]))
    if len(names) == 3 and turns[0]:
        return replace(table, names=_LOG[:3])
    wrong = ""
    if names == RACELINE and not _is_distance(rows[:, 0], points):
        wrong = "the first is no distance along the line"
    elif len(names) > 4 and _bends(points) and not turns[0] and rows[:, at + 2].max() > rows[:, at + 2].min():
        wrong = f"column {at + 3} is not its heading"
    elif len(names) > 2 and len(flat := np.flatnonzero(np.ptp(points, axis=0) == 0.0)) == 1:
        wrong = f"column {at + int(flat[0]) + 1} is {points[0, flat[0]]:g} everywhere"
    if wrong:
        raise TrackError(
            f"{path}: has {len(names)} columns without names, of which {wrong}; accepted: {', '.join(names)}, or a "
            "header that names the columns"
        )
    return table


def raceline_text(columns: Mapping[str, FloatArray], comments: Iterable[str] = ()) -> str:
    """Return the text of a file of columns (n,) by their names, those of RACELINE, with comments above."""
    lines = [f"# {comment(line)}" for line in (*comments, "; ".join(columns))]
    lines += ["; ".join(f"{value:.7f}" for value in row) for row in zip(*columns.values(), strict=True)]
    return "\n".join(lines) + "\n"


def raceline_columns(points: FloatArray, speeds: FloatArray | None) -> dict[str, FloatArray]:
    """Return the columns of a line (n, 2) [m] by their names; those of speeds (n,) [m/s] only where it has any."""
    try:
        require_closed(points)
        beyond = max(len(points) // 4, 1)
    except TrackError:
        beyond = 0
    rows = np.arange(-beyond, len(points) + beyond) % len(points)  # round the ends of a closed line
    here = slice(beyond, beyond + len(points))
    round_line = points[rows]
    ahead = np.gradient(round_line, axis=0)
    along = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(round_line, axis=0).T))))
    columns = [along - along[beyond], *round_line.T, portable.arctan2(ahead[:, 1], ahead[:, 0]), _curvature(round_line)]
    columns[3] %= 2.0 * math.pi
    if speeds is not None:
        apart = np.append(np.diff(along), 0.0)
        gained = 0.5 * np.append(np.diff(speeds[rows] ** 2), 0.0)
        columns += [speeds[rows], np.divide(gained, apart, out=np.zeros(len(rows)), where=apart > 0.0)]
    return {name: column[here] for name, column in zip(RACELINE, columns, strict=False)}


def require_closed(points: FloatArray) -> None:
    """Raise TrackError for a line (n, 2) [m] that does not end about where it begins; the message says by how much."""
    steps = np.hypot(*np.diff(points, axis=0).T)
    gap, longest = float(np.hypot(*(points[0] - points[-1]))), float(steps.max(initial=0.0))
    closed = max(_LEAST_GAP, _WIDEST_GAP * longest)
    if gap > closed:
        away = np.hypot(*(points - points[0]).T)
        left = int(np.argmax(away > closed))  # the first point that is no longer near the first
        lap = left + int(np.argmin(away[left:]))
        hint = "one that repeats its first point at the end is closed by a straight"
        if away[lap] <= closed:
            hint = f"it comes by its first point again, so that its first {lap} points may be a lap"
        raise TrackError(
            f"the line ends {gap:.2f} m from its first point, in steps of {longest:.2f} m at most: it is not closed; "
            f"accepted: a closed line; {hint}"
        )


def read_text_table(path: Path, said: str = "") -> Table:
    """Return the table of a text file in UTF-8, or in Latin-1, in which older programs write; raise TrackError."""
    content = read_line_bytes(path)
    if b"\0" in content:
        raise TrackError(f"{path}: is not a text file; accepted: a .csv of {', '.join(COLUMNS)}")
    try:
        return _split(path, content.decode("utf-8-sig"), said)
    except UnicodeDecodeError:
        return _split(path, content.decode("latin-1"), said)


def read_line_bytes(path: Path) -> bytes:
    """Return the content of a file of a line; raise TrackError for one that cannot be read."""
    accepted = f"accepted: a .csv of {', '.join(COLUMNS)}"
    try:
        return read_bytes(path)
    except FileNotFoundError:
        raise TrackError(f"{path}: no such file; {accepted}") from None
    except IsADirectoryError:
        raise TrackError(f"{path}: is a folder; {accepted}") from None
    except OSError as error:
        raise TrackError(f"{path}: cannot be read: {error.strerror or error}; {accepted}") from error


def require_few(where: object, number: int, what: str) -> None:
    """Raise TrackError for a file of more points or columns than a line has."""
    most = MOST_POINTS if what == "point" else MOST_COLUMNS
    if number > most:
        raise TrackError(f"{where}: more than {most} {what}s; accepted: {most} at most")


def _split(path: Path, text: str, said: str) -> Table:
    """Return the table of a text."""
    columns: tuple[str, ...] = ()
    header, is_bare = 0, False
    above, above_line = "", 0  # the last comment, which may be a header
    rows: list[list[str]] = []
    places: list[int] = []
    for number, line in enumerate(io.StringIO(text, newline=None), start=1):
        if len(line) > _MOST_CHARACTERS:
            said = f"line {number} has {len(line)} characters"
            raise TrackError(f"{path}: {said}; accepted: {_MOST_CHARACTERS} at most in a line")
        if number - len(rows) > (MOST_POINTS if rows else _MOST_ABOVE):
            said = f"{number - len(rows)} lines without a point"
            raise TrackError(f"{path}: {said}; accepted: {_MOST_ABOVE} above the first, {MOST_POINTS} in all")
        content = line.strip()
        if not content or (content.startswith("#") and (rows or is_bare)):
            continue
        cells = _cells(content)
        require_few(f"{path}: line {number}", len(cells), "column")
        if content.startswith("#"):
            above, above_line = content.lstrip("#").rpartition(":")[2].strip(), number
            if lines_of(_cells(above)):
                columns, header = tuple(_cells(above)), number
            continue
        if not rows and not (is_bare and name_a_line(columns)) and not any(map(_is_number, cells)):
            columns, header, is_bare = tuple(cells), number, True
            continue
        if not rows and not header:
            names = _cells(above) if re.search("[;,\t]", above) else []
            if len(names) == len(cells) and all(map(_NAME.fullmatch, names)):
                columns, header = tuple(names), above_line
            else:
                columns = _WITHOUT_HEADER.get(len(cells), ())
        while len(cells) > len(columns) and not cells[-1]:
            cells.pop()  # behind a separator that ends the line
        if len(cells) != len(columns):
            accepted = f"{len(columns)}, {', '.join(columns[:SHOWN])}" if columns else NUMBERS
            raise TrackError(f"{path}: line {number} has {len(cells)} columns; accepted: {accepted}")
        rows.append(cells)
        places.append(number)
        require_few(f"{path}: line {number}", len(rows), "point")
        if len(rows) * len(cells) > _MOST_CELLS:
            raise TrackError(f"{path}: more than {_MOST_CELLS} cells; accepted: {_MOST_CELLS} at most")
    if not rows:
        raise TrackError(f"{path}: is empty; accepted: one point a line, {', '.join(COLUMNS)}")
    header_line = f"line {header}" if header else ""
    return Table(names=columns, header=header_line, rows=rows, places=places, said=said, path=path)


NUMBERS = f"4, {', '.join(COLUMNS)}; or, without widths, 2, 3, 4, 6 or 7; or a header that names them"
"""Numbers of columns that are accepted without names."""


def unnamed(path: Path, rows: Sequence[Sequence[float]], said: str = "") -> Table:
    """Return the table of rows whose columns have no names; raise TrackError where their number says nothing."""
    columns = _WITHOUT_HEADER.get(len(rows[0]) if len(rows) else 0, ())
    if not columns:
        raise TrackError(f"{path}: has {len(rows[0]) if len(rows) else 0} columns; accepted: {NUMBERS}")
    return Table(names=columns, header="", rows=rows, places=range(1, len(rows) + 1), row="point", said=said)


def _cells(content: str) -> list[str]:
    separator = next((mark for mark in (";", ",", "\t") if mark in content), None)
    return [cell.strip().strip("\"'").strip() for cell in content.split(separator)]


def _numbers(path: Path, table: Table, places: Sequence[tuple[int, float]], least: float = -math.inf) -> FloatArray:
    """Return the numbers of some columns times their units, above a least one. (n, k)."""
    numbers = np.empty((len(table.rows), len(places)))
    for k, row in enumerate(table.rows):
        for j, (place, unit) in enumerate(places):
            numbers[k, j] = unit * _cell(row[place])
            if not abs(numbers[k, j]) <= _GREATEST or not numbers[k, j] > least:
                accepted = f"a finite number, {_GREATEST:.0e} at most"
                where, cell = f"{path}: {table.row} {table.places[k]}: {table.names[place]}", row[place]
                if abs(numbers[k, j]) <= _GREATEST:
                    raise TrackError(f"{where} is {cell}; accepted: a number above {least:g}")
                raise TrackError(f"{where} is {str(cell)[:60]!r}; accepted: {accepted}")
    return numbers


def _shifted(table: Table, points: FloatArray) -> FloatArray | None:
    """Return the line of a reference, its normals and offsets from it, as TUM's optimiser has them for planners."""
    plain = [plain_name(name)[0] for name in table.names]
    if not {"x_normvec", "y_normvec", "alpha"} <= set(plain):
        return None
    x, y, alpha = (
        np.array([_cell(row[plain.index(name)]) for row in table.rows]) for name in ("x_normvec", "y_normvec", "alpha")
    )
    moved = points + alpha[:, None] * np.column_stack((x, y))
    return moved if np.isfinite(moved).all() else None


def _odd(
    path: Path, table: Table, points: FloatArray, values: Mapping[str, FloatArray], places: Mapping[str, int]
) -> list[str]:
    """Refuse units that cannot be; return notes on columns that do not belong to the line."""
    notes = []
    named = {quantity: table.names[place] for quantity, place in places.items()}
    psi, kappa, speed = (values.get(quantity) for quantity in ("psi", "kappa", "speed"))
    if len(points) > 2 and psi is not None and np.ptp(psi) > 0.0 and (wrong := _heading_fault(points, psi)) is not None:
        if wrong and table.header and unit_of(named["psi"], "psi") == 1.0:
            raise TrackError(
                f"{path}: {table.header}: {named['psi']} turns with the line in degrees; accepted: radians, or a name "
                "that ends in _deg"
            )
        notes.append(f"{named['psi']} is not the heading of the line")
    bend = _curvature(points)
    if kappa is not None and np.sum(kappa * bend) < -0.5 * math.sqrt(np.sum(kappa**2) * np.sum(bend**2)) < 0.0:
        notes.append(f"{named['kappa']} has the other sign than the line")
    if speed is not None and np.ptp(speed) > 0.2 * speed.max() and (np.abs(bend) > _BENT).any():
        hardest = float(np.quantile(speed[np.abs(bend) > _BENT] ** 2 * np.abs(bend[np.abs(bend) > _BENT]), 0.9))
        if hardest > _HARDEST and unit_of(named["speed"], "speed") == 1.0:
            is_kmh = hardest < 3.6**2 * _HARDEST
            raise TrackError(
                f"{path}: {table.header or 'by their number'}: {named['speed']} asks for {hardest:.0f} m/s^2 in corners"
                f"{f', in km/h for {hardest / 3.6**2:.0f}' if is_kmh else ''}; accepted: m/s"
                f"{', or a name that ends in _kmh' if is_kmh else ''}"
            )
    return notes


def _curvature(points: FloatArray) -> FloatArray:
    """Return the curvature at each point of a line, over _CORNER to either side or a step [1/m]. (n,)."""
    if len(points) < 3:
        return np.zeros(len(points))
    along = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))))
    before = np.minimum(along - _CORNER, np.append(0.0, along[:-1]))
    after = np.maximum(along + _CORNER, np.append(along[1:], along[-1]))
    a, c = (np.column_stack([np.interp(side, along, axis) for axis in points.T]) for side in (before, after))
    u, v, w = points - a, c - points, c - a
    sides = np.hypot(*u.T) * np.hypot(*v.T) * np.hypot(*w.T)
    area = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    return np.asarray(np.divide(2.0 * area, sides, out=np.zeros(len(points)), where=sides > 1e-12))


def _agrees(points: FloatArray, angles: FloatArray) -> float:
    """Return how well angles [rad] turn with a line, whatever they are counted from: 1 as it does."""
    ahead = np.gradient(points @ (1.0, 1.0j))  # a point where the car stands has no weight
    return float(abs(np.exp(1j * angles) @ ahead.conj()) / max(np.abs(ahead).sum(), 1e-12))


def _heading_fault(points: FloatArray, psi: FloatArray) -> bool | None:
    """Return None for the heading [rad] of a line; True for one in degrees; False for another column."""
    if _agrees(points, psi) > _HEADING:
        return None
    return _agrees(points, np.radians(psi)) > _HEADING and float(np.abs(psi).max()) > 4.0 * math.pi


def _bends(points: FloatArray) -> bool:
    """Return whether a line goes so far round that a heading is told from other columns."""
    return len(points) > 2 and _agrees(points, np.zeros(len(points))) <= _ROUND


def _is_heading(points: FloatArray, column: FloatArray) -> bool:
    """Return whether a column [rad or deg] turns with a line that bends, whatever it is counted from."""
    if not (np.isfinite(column).all() and _bends(points)):
        return False
    return any(_agrees(points, angles) > _HEADING for angles in (column, np.radians(column)))


def _is_distance(column: FloatArray, points: FloatArray) -> bool:
    """Return whether a column is about the distance along a line: it grows, by half to twice the line's length."""
    if not np.isfinite(column).all():
        return False
    length = float(np.hypot(*np.diff(points, axis=0).T).sum())
    return bool((np.diff(column) >= 0.0).all()) and 0.5 * length <= column[-1] - column[0] <= 2.0 * length


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _cell(cell: str | float) -> float:
    """Return the number of a cell; NaN where it is none, as JSON's true."""
    try:
        return math.nan if isinstance(cell, bool) else float(cell)
    except OverflowError:  # a whole number of hundreds of digits
        return math.inf
    except (TypeError, ValueError):
        return math.nan
