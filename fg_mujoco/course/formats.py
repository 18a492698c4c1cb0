"""Centreline CSV files, and the circuits that have a name.

The format is the community's: one point a line, `x_m, y_m, w_tr_right_m, w_tr_left_m`, closed without repeating the
first. Read are also files without the header, separated by semicolons or spaces, with the first point repeated at the
end, in either direction. Lines starting with `#` are comments. A point that repeats the one before is dropped.

A line with all steps up to `DENSE` is kept as it is, square corners included. A sparser one is resampled every
`SPACING` on the periodic cubic spline through its points, so that its walls are smooth; its widths are interpolated
linearly.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from importlib import resources
from pathlib import Path
from typing import overload

import numpy as np

from ..errors import TrackError
from ..messages import FloatArray
from .generator import generate_track
from .maps.map_track import is_map, load_map
from .polyline import spline, step_lengths
from .scene import Scene
from .scenes.catalogue import load_scene
from .track import MIN_POINTS, Track

COLUMNS = ("x_m", "y_m", "w_tr_right_m", "w_tr_left_m")
DENSE = 0.5  # [m] longest step of a line that is kept as it is
SPACING = 0.2  # [m] step that a sparser line is resampled to

_REPEATED = 1e-3  # [m] points nearer than this are one


def track_names() -> tuple[str, ...]:
    """Names of the bundled circuits, sorted."""
    files = resources.files("fg_mujoco.tracks").iterdir()
    return tuple(sorted(file.name.removesuffix(".csv") for file in files if file.name.endswith(".csv")))


@overload
def load_track(name_or_path: Track, *, minimum_width: float = 0.0) -> Track: ...
@overload
def load_track(name_or_path: Scene, *, minimum_width: float = 0.0) -> Scene: ...
@overload
def load_track(name_or_path: str | Path | Track | Scene, *, minimum_width: float = 0.0) -> Track | Scene: ...
def load_track(name_or_path: str | Path | Track | Scene, *, minimum_width: float = 0.0) -> Track | Scene:
    """Load a circuit, or a scene.

    Args:
      name_or_path: a bundled name, `random:SEED`, `scene:NAME`, `scene:NAME:SEED`, a path to a centreline `.csv` or to
        a map's `.yaml` (map_track.load_map), or a Track or Scene, which is returned.
      minimum_width: width over all of the car that is to fit [m]; a scene may be as narrow as it likes.

    Raises:
      TrackError: an unknown name, a file that cannot be read, or a corridor not wider than `minimum_width`.
    """
    track = name_or_path if isinstance(name_or_path, (Track, Scene)) else _load(name_or_path)
    if isinstance(track, Scene):
        return track
    width = track.corridor_right + track.corridor_left
    narrowest = int(np.argmin(width))
    if width[narrowest] <= minimum_width:
        x, y = track.centreline[narrowest]
        raise TrackError(
            f"track {track.name!r} is {width[narrowest]:.2f} m wide at ({x:.2f}, {y:.2f}), point {narrowest}; "
            f"accepted: wider than the car, {minimum_width:.2f} m"
        )
    return track


def require_track(course: Track | Scene, where: str) -> Track:
    """Return a track as it is.

    Raises:
      TrackError: it is a scene, which `where` cannot take.
    """
    if isinstance(course, Scene):
        raise TrackError(f"{course.name!r} is a scene, in {where}; accepted: a track")
    return course


def _load(name_or_path: str | Path) -> Track | Scene:
    name = str(name_or_path)
    if name in track_names():
        with resources.as_file(resources.files("fg_mujoco.tracks") / f"{name}.csv") as path:
            return read_centreline(path)
    kind, _, seed = name.partition(":")
    if kind == "random":
        if not re.fullmatch("[0-9]{1,18}", seed):
            raise TrackError(f"{name!r} has no seed; accepted: random:SEED with SEED an integer from 0, as random:7")
        return generate_track(int(seed))
    if kind == "scene":
        return load_scene(name)
    if is_map(name):
        return load_map(name)
    path = Path(name_or_path)
    if path.suffix.lower() == ".csv" or path.is_file():
        return read_centreline(path)
    known = ", ".join(track_names())
    raise TrackError(
        f"unknown track {name!r}; accepted: {known}, random:SEED, scene:NAME:SEED, or a path to a centreline .csv or a "
        "map .yaml"
    )


def write_centreline(track: Track, path: str | Path, header_lines: Sequence[str] = ()) -> None:
    """Write the centreline and widths of a track; `read_centreline` gives the same numbers back.

    Args:
      track: what to write.
      path: the file; replaced if it exists.
      header_lines: comments to put before the column names, without their `# `.

    Raises:
      TrackError: a path that cannot be written.
    """
    rows = np.column_stack((track.centreline, track.width_right, track.width_left)).tolist()
    lines = [f"# {line}" for line in (*header_lines, ", ".join(COLUMNS))]
    lines += [", ".join(repr(value) for value in row) for row in rows]
    try:
        Path(path).write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")
    except OSError as error:
        raise TrackError(f"{path}: cannot be written: {error.strerror or error}") from error


def read_centreline(path: str | Path) -> Track:
    """Read a centreline CSV; the track is named after the file.

    Raises:
      TrackError: with the file, and the line where there is one: a file that cannot be read or is empty, too few
        points, a wrong number of columns, a cell that is no finite number, a width that is not positive, or what
        `Track` refuses.
    """
    path = Path(path)
    rows = _parse(path, _read_text(path))
    rows = rows[step_lengths(rows[:, :2]) > _REPEATED]  # the last of those that repeat each other stays
    if len(rows) < MIN_POINTS:
        raise TrackError(f"{path}: {len(rows)} points; accepted: at least {MIN_POINTS} different ones in a closed loop")
    line, right, left = rows[:, :2], rows[:, 2], rows[:, 3]
    if step_lengths(line).max() > DENSE:
        line, right, left = spline(line, SPACING, right, left)
    try:
        track = Track(name=path.stem, centreline=line, width_right=right, width_left=left)
        _ = track.left_wall  # drawn here, so that a refusal names the file
    except TrackError as error:
        raise TrackError(f"{path}: {error}") from error
    return track


def _read_text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8-sig")  # the signature is what Windows editors put first
    except FileNotFoundError:
        raise TrackError(f"{path}: no such file; accepted: a centreline .csv of {', '.join(COLUMNS)}") from None
    except IsADirectoryError:
        raise TrackError(f"{path}: is a folder; accepted: a centreline .csv of {', '.join(COLUMNS)}") from None
    except UnicodeDecodeError:
        raise TrackError(f"{path}: is not a text file; accepted: a centreline .csv of {', '.join(COLUMNS)}") from None
    except OSError as error:
        raise TrackError(f"{path}: cannot be read: {error.strerror or error}") from error


def _parse(path: Path, text: str) -> FloatArray:
    """Read the numbers of all lines. Shape (n, 4) [m]."""
    rows: list[list[float]] = []
    seen_any = False
    for number, line in enumerate(text.splitlines(), start=1):
        content = line.strip()
        if not content or content.startswith("#"):
            continue
        separator = next((mark for mark in (";", ",") if mark in content), None)
        cells = [cell.strip() for cell in content.split(separator)]
        first, seen_any = not seen_any, True
        if first and not any(_is_number(cell) for cell in cells):
            continue  # column names without a `#`
        if len(cells) != len(COLUMNS):
            raise TrackError(f"{path}: line {number} has {len(cells)} columns; accepted: 4, {', '.join(COLUMNS)}")
        for cell, column in zip(cells, COLUMNS, strict=True):
            if not _is_number(cell) or not np.isfinite(float(cell)):
                raise TrackError(f"{path}: line {number}: {column} is {cell!r}; accepted: a finite number")
            if column.startswith("w_") and float(cell) <= 0.0:
                raise TrackError(f"{path}: line {number}: {column} is {cell}; accepted: a width above 0 m")
        rows.append([float(cell) for cell in cells])
    if not seen_any:
        raise TrackError(f"{path}: is empty; accepted: one point a line, {', '.join(COLUMNS)}")
    return np.array(rows).reshape(-1, len(COLUMNS))


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True
