"""Reads a drive from a CSV file, by the columns that a mapping names."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ...course.files import file_sha256, read_text
from ...errors import SettingsError, accepted_names
from ...messages import FloatArray
from .channels import Beams, Channel
from .drive_checks import DriveChecks, check_drive
from .drive_columns import LAYOUTS, MEASURED, QUANTITIES, REQUIRED, UNITS, Column, DriveColumns, recognised
from .drive_recording import RecordedDrive
from .wrong_units import disagreement, wrong_unit

_LARGEST = 2**30  # bytes of a file
_FEWEST = 3  # rows


def read_csv_drive(path: Path, columns: DriveColumns | None = None) -> RecordedDrive:
    """Return the drive of a CSV file; None of `columns`: of a layout that is recognised by its columns.

    Raises:
      SettingsError: a file that cannot be read, that lacks a column, whose clock runs backwards, or in which a column
        has another unit than is said.
    """
    header, table = _read(path)
    if columns is None:
        columns = recognised(header)
        if columns is None:
            needed = {name: LAYOUTS["plain"][name] for name in REQUIRED}
            raise SettingsError(
                f"{path}: its columns are of no known layout: {_some(header)}; accepted: {_some(needed.values())}, the "
                f"layouts {', '.join(LAYOUTS)}, or columns, a TOML file that names them ({', '.join(REQUIRED)}, ...)"
            )
    places = {name: place for place, name in enumerate(header)}
    for name, column in columns.plain.items():
        if column.column not in places:
            raise SettingsError(
                f"{path}: has no column {column.column!r}, which is {name} in {columns.name}; "
                f"{accepted_names(column.column, header)}"
            )
    raw = {name: _in_si(table[:, places[column.column]], name, column) for name, column in columns.plain.items()}
    _check_clock(path, raw["time"], columns.time)
    _check_units(path, raw, columns)
    kept = np.isfinite(raw["time"])
    raw = {name: values[kept] for name, values in raw.items()}
    time = raw["time"]

    def channel(*names: str, late: float = 0.0, scale: float = 1.0) -> Channel:
        values = np.column_stack([raw[name] for name in names]) * scale
        there = np.isfinite(values).all(axis=1)
        if np.count_nonzero(there) < _FEWEST:
            said = ", ".join(columns.plain[name].column for name in names)
            raise SettingsError(f"{path}: {said}: {np.count_nonzero(there)} rows with numbers; accepted: 3 or more")
        return Channel(name=f"{path}: {names[0]}", time=time[there] - late, values=values[there])

    pose = None
    if columns.x is not None:
        raw["yaw"] = _unwrapped(raw["yaw"])
        raw["x"] = raw["x"] - columns.pose_ahead * np.cos(raw["yaw"])
        raw["y"] = raw["y"] - columns.pose_ahead * np.sin(raw["yaw"])
        pose = channel("x", "y", "yaw", late=columns.plain["x"].late)
    steering = channel("steering", late=columns.steering.late)
    commanded = columns.steering_is == "command"
    checks = check_drive(
        speed=channel("speed", late=columns.speed.late), yaw_rate=channel("yaw_rate", late=columns.yaw_rate.late),
        steering=steering, commanded=commanded, pose=pose,
    )  # fmt: skip
    clock, gyro, speed_late, gyro_late, checks = _corrections(columns, checks)
    speed = channel("speed", late=columns.speed.late + speed_late)
    yaw_rate = channel("yaw_rate", late=columns.yaw_rate.late + gyro_late, scale=gyro)
    acceleration = None
    if columns.forward_acceleration is not None:
        late = columns.forward_acceleration.late
        acceleration = channel("forward_acceleration", "lateral_acceleration", late=late)
    commands = {}
    for name in ("speed_command", "acceleration_command"):
        found = columns.plain.get(name)
        commands[name] = None if found is None else channel(name, late=found.late)
    first = float(time[0])

    def scaled(found: Channel) -> Channel:
        return Channel(name=found.name, time=first + clock * (found.time - first), values=found.values)

    beams = _beams(columns, header, table[kept], time)
    return RecordedDrive(
        name=str(path), sha256=file_sha256(path), layout=columns.name, commanded=commanded, checks=checks,
        steering=scaled(steering), **{name: found and scaled(found) for name, found in commands.items()},
        speed=scaled(speed),
        yaw_rate=scaled(yaw_rate), acceleration=acceleration and scaled(acceleration), pose=pose and scaled(pose),
        beams=beams and replace(beams, time=first + clock * (beams.time - first)),
    )  # fmt: skip


def _corrections(columns: DriveColumns, checks: DriveChecks) -> tuple[float, float, float, float, DriveChecks]:
    """Return clock scale, gyro scale, and the delays of speed and yaw rate that are used, in recorded seconds."""
    used, values = [], []
    for name, part, column, neutral in (
        ("clock_scale", "scale", columns.time, 1.0), ("gyro_scale", "scale", columns.yaw_rate, 1.0),
        ("speed_delay", "delay", columns.speed, 0.0), ("yaw_rate_delay", "delay", columns.yaw_rate, 0.0),
    ):  # fmt: skip
        found = getattr(checks, name)
        wanted = getattr(column, part) == MEASURED and bool(found)
        values.append(found.value if wanted else neutral)
        used += [name] if wanted else []
    clock, gyro, speed_late, gyro_late = values
    return clock, gyro, speed_late, gyro_late, replace(checks, used=tuple(used))


def _read(path: Path) -> tuple[list[str], FloatArray]:
    """Return the columns of a file and its numbers, NaN where a cell is empty."""
    try:
        text = read_text(path, _LARGEST)
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or error
        raise SettingsError(f"{path}: cannot be read: {reason}; accepted: a CSV file with a header") from error
    lines = [line for line in text.splitlines() if line.strip()]
    if len(lines) <= _FEWEST:
        raise SettingsError(f"{path}: has {len(lines)} lines; accepted: a header and {_FEWEST} rows or more")
    first = lines[0].lstrip("#\ufeff ")
    separator = max(",;\t", key=first.count)
    header = [name.strip().strip('"') for name in first.split(separator)]
    try:
        table = np.loadtxt(lines[1:], delimiter=separator, ndmin=2, dtype=np.float64)
    except ValueError:
        table = _cells(path, lines[1:], separator, len(header))
    if table.shape[1] != len(header):
        raise SettingsError(f"{path}: rows have {table.shape[1]} cells, the header {len(header)}; accepted: as many")
    return header, table


def _cells(path: Path, lines: list[str], separator: str, width: int) -> FloatArray:
    """Return the numbers of rows of which some cells are empty, or no numbers."""
    rows = []
    for number, row in enumerate(csv.reader(lines, delimiter=separator), start=2):
        if len(row) != width:
            raise SettingsError(f"{path}, line {number}: {len(row)} cells; accepted: {width}, as the header has")
        rows.append([_number(cell) for cell in row])
    return np.array(rows, np.float64)


def _number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return float("nan")


def _in_si(values: FloatArray, name: str, column: Column) -> FloatArray:
    size = UNITS[QUANTITIES[name]].get(column.unit, 1.0)
    return np.asarray(column.factor * size * values + column.offset)


def _unwrapped(yaw: FloatArray) -> FloatArray:
    """Return headings without jumps, NaN where there is none."""
    found = yaw.copy()
    there = np.isfinite(yaw)
    found[there] = np.unwrap(yaw[there])
    return found


def _check_clock(path: Path, time: FloatArray, column: Column) -> None:
    rows = np.flatnonzero(np.isfinite(time))
    if len(rows) < _FEWEST:
        raise SettingsError(f"{path}: {column.column}: {len(rows)} times; accepted: {_FEWEST} or more")
    steps = np.diff(time[rows])
    back = np.flatnonzero(steps <= 0.0)
    if len(back):
        row = int(rows[back[0] + 1])
        how = f"runs backwards by {-steps[back[0]]:.4g} s" if steps[back[0]] < 0.0 else "stands still"
        more = f", and {len(back) - 1} times more" if len(back) > 1 else ""
        raise SettingsError(
            f"{path}, line {row + 2}: {column.column}: the clock {how} at {time[row]:.9g} s{more}; accepted: times "
            "that increase"
        )


def _check_units(path: Path, raw: dict[str, FloatArray], columns: DriveColumns) -> None:
    """Refuse a column whose numbers are in another unit than is said."""
    found = next(((name, said) for name in raw if (said := wrong_unit(name, raw[name])) is not None), None)
    if found is None:
        pose = np.column_stack([raw[name] for name in ("x", "y", "yaw")]) if "x" in raw else None
        found = disagreement(raw["time"], raw["speed"], raw["yaw_rate"], raw["steering"], pose)
    if found is not None:
        name, said = found
        column = columns.plain[name]
        units = ", ".join(UNITS[QUANTITIES[name]])
        raise SettingsError(
            f"{path}: {column.column}: {name} {said}; accepted: {name} = {{column = {column.column!r}, unit = ...}} in "
            f"the columns, one of {units}, or a scale"
        )


def _beams(columns: DriveColumns, header: list[str], table: FloatArray, time: FloatArray) -> Beams | None:
    numbers = {} if columns.beams is None else columns.beams.numbers(header)
    if columns.beams is None or not numbers:
        return None
    ranges = table[:, [header.index(name) for name in numbers.values()]] * UNITS["length"][columns.beams.unit]
    ranges = np.where(ranges >= columns.beams.nothing, np.inf, np.where(ranges > 0.0, ranges, np.nan))
    bearings = np.array([columns.beams.bearing(number) for number in numbers])
    return Beams(time=time - columns.beams.delay, ranges=ranges, bearings=bearings)


def _some(names: Any) -> str:
    names = list(names)
    return ", ".join(names[:12]) + (f" and {len(names) - 12} more" if len(names) > 12 else "")
