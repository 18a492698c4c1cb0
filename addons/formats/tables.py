"""Tables of lines in JSON, NumPy's .npy and a track.yaml, for `fg_mujoco.course.line_file`, which reads their columns.

    JSON         rows with names, [{"x_m": 0.0, ...}, ...], as in ForzaETH's global_waypoints.json; or columns with
                 names, {"X": [...], "Y": [...], "X_i": ...}, as in MPCC's track.json; or rows of numbers. Of several
                 lines, a course takes the centreline, and a planner the first that is none
    .npy         (n, k) numbers, of which the number of columns says what they are; or an array with named fields
    track.yaml   of SlipX: `centreline` names a CSV beside it, and `closed` has to be true
"""

from __future__ import annotations

import importlib.util
import io
from collections.abc import Iterator, Sequence
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from fg_mujoco.course.documents import parse_json
from fg_mujoco.course.files import read_text
from fg_mujoco.course.line_file import Table, read_text_table, require_few, unnamed
from fg_mujoco.course.line_file import read_line_bytes as read_bytes
from fg_mujoco.course.line_names import name_a_line
from fg_mujoco.course.maps.map_server import plain_yaml
from fg_mujoco.course.polyline import MOST_POINTS
from fg_mujoco.errors import TrackError, missing_extra

_DEEPEST = 6  # levels of JSON that are searched for lines
_MOST_VALUES = 10 * MOST_POINTS  # of a file in JSON
_MOST_OBJECTS = 2000  # of JSON that are searched for lines
_MOST_COLUMNS = 7  # of an array that lies on its side


def line_table(path: Path, *, course: bool, line: str | None) -> Table:
    """Return the table of a line in a file.

    Of several lines `course` wants the centreline, else one to drive, and `line` is part of its name. Raises
    TrackError: no line, several of which none is chosen, or none of the name.
    """
    suffix = path.suffix.lower()
    if suffix != ".json" and line is not None:
        raise TrackError(f"{path}: line is {line!r}, but the file has one line only; accepted: no line=")
    if suffix == ".npy":
        return _array(path)
    return _json(path, course, line) if suffix == ".json" else _track_yaml(path)


def _json(path: Path, course: bool, line: str | None) -> Table:
    text = read_bytes(path)
    try:
        if text.count(b",") > _MOST_VALUES:
            raise ValueError(f"it has more than {_MOST_VALUES} values")
        content = parse_json(text)
    except (ValueError, RecursionError) as error:
        raise TrackError(f"{path}: is no JSON: {error}; accepted: rows or columns with the names x and y") from error
    found = dict(_lines(path, content, path.stem, 0, count(1)))
    named = ", ".join(found)
    if not found:
        raise TrackError(f"{path}: has no line; accepted: rows or columns with the names x and y, or rows of numbers")
    if line is not None:
        fitting = [name for name in found if line.casefold() in name.casefold()]
        if len(fitting) != 1 and line not in found:
            raise TrackError(f"{path}: line is {line!r}; accepted: one of {named}, or a part of its name")
        name = line if line in found else fitting[0]
    else:
        centre = [name for name in found if "cent" in name.casefold()]
        fitting = centre if course else [name for name in found if name not in centre]
        name = (fitting or list(found))[0]
    if len(found) == 1:
        return found[name]
    others = ", ".join(each for each in found if each != name)
    table = found[name]
    return Table(
        names=table.names, header=table.header, rows=table.rows, places=table.places, row=table.row,
        said=f"of its lines {name}, others are {others}",
    )  # fmt: skip


def _lines(path: Path, value: Any, name: str, depth: int, objects: Iterator[int]) -> Iterator[tuple[str, Table]]:
    """Yield the lines of a JSON value, with the names under which they stand; `objects` counts what is searched."""
    if depth > _DEEPEST or not isinstance(value, (list, dict)):
        return
    if next(objects) > _MOST_OBJECTS:
        raise TrackError(f"{path}: more than {_MOST_OBJECTS} objects; accepted: a file of lines")
    if isinstance(value, list) and len(value) > 1:
        require_few(path, len(value), "point")
        if all(isinstance(row, dict) for row in value):
            names = tuple(key for key, cell in value[0].items() if not isinstance(cell, (dict, list)))
            require_few(path, len(names), "column")
            if name_a_line(names):
                yield name, _named(names, [[row.get(key) for key in names] for row in value])
        elif all(isinstance(row, list) and row and _are_numbers(row) for row in value):
            if len({len(row) for row in value}) > 1:
                raise TrackError(f"{path}: rows of {name} differ in length; accepted: one number of columns")
            yield name, unnamed(path, value)
    elif isinstance(value, dict):
        columns = {key: cells for key, cells in value.items() if isinstance(cells, list) and _are_numbers(cells)}
        require_few(path, len(columns), "column")
        if name_a_line(tuple(columns)):
            lengths = {key: len(cells) for key, cells in columns.items()}
            require_few(path, max(lengths.values()), "point")
            if len(set(lengths.values())) > 1:
                said = ", ".join(f"{key} {length}" for key, length in lengths.items())
                raise TrackError(f"{path}: columns of different lengths, {said}; accepted: one length")
            yield name, _named(tuple(columns), list(zip(*columns.values(), strict=True)))
            return
        for key, each in value.items():
            if not key.endswith("markers"):
                yield from _lines(path, each, name if key == "wpnts" else key, depth + 1, objects)


def _named(names: tuple[str, ...], rows: Sequence[Sequence[Any]]) -> Table:
    return Table(names=names, header="its columns", rows=rows, places=range(1, len(rows) + 1), row="point")


def _are_numbers(cells: list[Any]) -> bool:
    return len(cells) > 1 and all(isinstance(cell, (int, float)) or cell is None for cell in cells)


def _array(path: Path) -> Table:
    """Return the table of an array of NumPy; pickled objects are not read."""
    content = read_bytes(path)
    try:
        array = np.load(io.BytesIO(content), allow_pickle=False)
    except Exception as error:  # of NumPy, and of Python's parser, which reads its header
        said = " ".join(str(error).split())[:200]
        raise TrackError(f"{path}: is no array of NumPy: {said}; accepted: numbers (n, k)") from error
    names, said = getattr(array.dtype, "names", None), ""
    if names is not None and array.ndim == 1:
        require_few(path, len(names), "column")
        require_few(path, len(array), "point")
        return _named(names, [list(row) for row in array.tolist()])
    if array.ndim != 2 or array.dtype.kind not in "fiu":
        raise TrackError(f"{path}: has {array.dtype} of shape {array.shape}; accepted: numbers (n, k), a row a point")
    if array.shape[0] <= _MOST_COLUMNS < array.shape[1]:
        array, said = array.T, f"shape {array.shape} was turned"
    require_few(path, len(array), "point")
    return unnamed(path, array.tolist(), said)


def _track_yaml(path: Path) -> Table:
    if importlib.util.find_spec("yaml") is None:
        raise missing_extra("a track.yaml needs PyYAML", "maps")
    try:
        keys = plain_yaml(read_text(path, 2**20))
    except Exception as error:  # of YAML
        said = " ".join(str(getattr(error, "strerror", None) or error).split())
        raise TrackError(f"{path}: cannot be read: {said}; accepted: a track.yaml with centreline: FILE.csv") from error
    keys = keys if isinstance(keys, dict) else {}
    name = keys.get("centreline", keys.get("centerline"))
    if not isinstance(name, str) or Path(name).is_absolute() or ".." in Path(name).parts:
        raise TrackError(f"{path}: centreline is {name!r}; accepted: a CSV in its folder")
    if keys.get("closed", True) is not True:
        raise TrackError(f"{path}: closed is {keys['closed']!r}; accepted: true, a course that is driven for laps")
    surface = keys.get("surface")
    said = "" if surface is None else f"surface {surface!r} is not used: --mu or --floor says how it grips"
    return read_text_table(path.parent / name, said)
