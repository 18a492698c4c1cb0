"""Centreline CSV files: a track as a closed line with a width to either side.

The format is the community's: one point a line, `x_m, y_m, w_tr_right_m, w_tr_left_m`, closed without repeating the
first point. The reader also takes files without the header, files separated by semicolons or spaces, and files that
repeat the first point at the end. Lines starting with `#` are comments. A point that repeats the one before is dropped.

A line whose steps are all at most `DENSE` is kept as it is, square corners included. A sparser line is resampled every
`SPACING` on the periodic cubic spline through its points, so that its walls are smooth. Its widths are interpolated
linearly.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..errors import TrackError
from ..messages import FloatArray
from .polyline import spline, step_lengths
from .track import MIN_POINTS, Track

COLUMNS = ("x_m", "y_m", "w_tr_right_m", "w_tr_left_m")
DENSE = 0.5  # [m] longest step of a line that is kept as it is
SPACING = 0.2  # [m] step that a sparser line is resampled to

_REPEATED = 1e-3  # [m] points nearer than this are one


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
