"""Reads a drive from a CSV file, by the columns that a mapping names."""

from __future__ import annotations

import csv
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from fg_mujoco.course.files import file_sha256, read_bytes
from fg_mujoco.errors import SettingsError, accepted_names
from fg_mujoco.messages import FloatArray, shown

from .channels import LONGEST_PAUSE, MOST, PAUSE, Beams, Channel
from .drive_checks import DriveChecks, check_drive
from .drive_columns import LAYOUTS, MEASURED, QUANTITIES, REQUIRED, UNITS, Column, DriveColumns, recognised
from .drive_recording import RecordedDrive
from .wrong_units import disagreement, wrong_unit

_LARGEST, _MOST_ROWS = 2**28, 2**20  # bytes and rows of a file, the latter of 7 h at 40 Hz
_FEWEST = 3  # rows
_FARTHEST = 1e4  # [m] of a pose from the median of its drive
_SEEN_NOTHING = 1e4  # [m] of a beam, whatever the mapping says
_PERIODS = 5.0  # of a row that comes late
_MOVES = 0.5  # [m/s] of a car whose poses tell how much time has passed
_PLACE, _SHARE = 0.05, 0.2  # [m], [-] by which a pose may be off the one that is expected


def read_csv_drive(path: Path, columns: DriveColumns | None = None) -> RecordedDrive:
    """Return the drive of a CSV file, without `columns` of a layout that is recognised; SettingsError: its fault."""
    header, table, numbers = _read(path)
    if columns is None:
        columns = recognised(header)
        if columns is None:
            needed = {name: LAYOUTS["plain"][name] for name in REQUIRED}
            raise SettingsError(
                f"{path}: its columns are of no known layout: {_some(header)}; accepted: {_some(needed.values())}, the "
                f"layouts {', '.join(LAYOUTS)}, or columns, a TOML file that names them ({', '.join(REQUIRED)}, ...)"
            )
    for name, column in columns.plain.items():
        if header.count(column.column) != 1:
            has = "several columns" if column.column in header else "no column"
            raise SettingsError(
                f"{path}: has {has} {shown(column.column)}, which is {name} in {columns.name}; "
                f"{accepted_names(column.column, header)}"
            )
    places = {name: place for place, name in enumerate(header)}
    with np.errstate(over="ignore"):
        raw = {name: _in_si(table[:, places[column.column]], name, column) for name, column in columns.plain.items()}
    _check_clock(path, raw["time"], columns.time, numbers)
    _check_values(path, raw, columns, numbers)
    _check_jumps(path, raw, columns.time, numbers)
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

    scaled_commands: dict[str, Any] = {name: found and scaled(found) for name, found in commands.items()}
    beams = _beams(columns, header, table[kept], time)
    return RecordedDrive(
        name=str(path), sha256=file_sha256(path), layout=columns.name, commanded=commanded, checks=checks,
        steering=scaled(steering), speed=scaled(speed), **scaled_commands,
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


def header_of(lines: Iterable[str]) -> tuple[list[str], str, int]:
    """Return a CSV file's columns, what separates them, and how many lines stand before its first row.

    The header is the first line without #; where that has numbers only, it is the comment before it.
    """
    comment = ""
    for count, line in enumerate(lines):
        text = line.strip().lstrip("\ufeff")
        if text.startswith("#"):
            comment = text.lstrip("# ")
        elif text:
            names, separator = _names(text)
            if comment and not any(np.isnan(_number(name)) for name in names):
                return *_names(comment), count
            return names, separator, count + 1
    return [], ",", 0


def _names(text: str) -> tuple[list[str], str]:
    separator = max(",;\t", key=text.count)
    try:
        cells = next(csv.reader([text], delimiter=separator, skipinitialspace=True))
    except csv.Error:  # a cell of too many characters
        cells = text.split(separator)
    return [cell.strip() for cell in cells], separator


def _read(path: Path) -> tuple[list[str], FloatArray, list[int]]:
    """Return the columns of a file, its numbers, NaN where a cell is empty, and the line of each row."""
    try:
        content = read_bytes(path, _LARGEST)
    except OSError as error:
        cut = f"a CSV file with a header, of up to {_LARGEST} bytes"
        raise SettingsError(f"{path}: cannot be read: {error.strerror or error}; accepted: {cut}") from error
    if b"\0" in content:
        raise SettingsError(f"{path}: is not a text file; accepted: a CSV file with a header")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:  # of older programs
        text = content.decode("latin-1")
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    header, separator, before = header_of(lines)
    rows = [(number, line) for number, line in enumerate(lines[before:], start=before + 1) if line.strip()]
    rows = [(number, line) for number, line in rows if not line.lstrip().startswith("#")]
    if not _FEWEST <= len(rows) <= _MOST_ROWS:
        cut = "" if len(rows) < _FEWEST else ": cut it into several, each with the header"
        raise SettingsError(f"{path}: has {len(rows)} rows; accepted: a header and {_FEWEST} to {_MOST_ROWS} rows{cut}")
    numbers, cells = [number for number, _ in rows], [line for _, line in rows]
    try:
        table = np.loadtxt(cells, delimiter=separator, ndmin=2, dtype=np.float64)
    except ValueError:
        table = _cells(path, cells, numbers, separator, len(header))
    if table.shape[1] != len(header):
        raise SettingsError(f"{path}: rows have {table.shape[1]} cells, the header {len(header)}; accepted: as many")
    return header, table, numbers


def _cells(path: Path, lines: list[str], numbers: list[int], separator: str, width: int) -> FloatArray:
    """Return the numbers of rows of which some cells are empty, or no numbers."""
    rows = []
    for number, line in zip(numbers, lines, strict=True):
        try:
            row = next(csv.reader([line], delimiter=separator))
        except csv.Error as error:
            raise SettingsError(f"{path}, line {number}: {error}; accepted: cells with numbers") from error
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


def _check_clock(path: Path, time: FloatArray, column: Column, numbers: list[int]) -> None:
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
            f"{path}, line {numbers[row]}: {column.column}: the clock {how} at {time[row]:.9g} s{more}; accepted: "
            "times that increase"
        )


def _check_jumps(path: Path, raw: dict[str, FloatArray], column: Column, numbers: list[int]) -> None:
    """Refuse a clock that goes forth by more than a pause, or by less, while the poses of a car go on as before."""
    rows = np.flatnonzero(np.isfinite(raw["time"]))
    time, speed = raw["time"][rows], raw["speed"][rows]
    steps = np.diff(time)
    period = float(np.median(steps))
    late = np.flatnonzero(steps > _PERIODS * period)
    jumps = steps[late] > LONGEST_PAUSE
    if "x" in raw:
        x, y, yaw = (raw[name][rows] for name in ("x", "y", "yaw"))
        ahead = period * speed[late]
        dx, dy = x[late + 1] - x[late], y[late + 1] - y[late]
        off = np.hypot(dx - ahead * np.cos(yaw[late]), dy - ahead * np.sin(yaw[late]))
        moves = np.minimum(speed[late], speed[late + 1]) > _MOVES
        jumps |= (steps[late] <= PAUSE) & moves & (off < _PLACE + _SHARE * ahead)
    if jumps.any():
        row = late[np.flatnonzero(jumps)[0]]
        raise SettingsError(
            f"{path}, line {numbers[rows[row + 1]]}: {column.column}: the clock jumps by {steps[row]:.4g} s at "
            f"{time[row + 1]:.12g} s; accepted: pauses of up to {LONGEST_PAUSE:g} s, and the time of the poses"
        )


def _check_values(path: Path, raw: dict[str, FloatArray], columns: DriveColumns, numbers: list[int]) -> None:
    """Refuse a column whose numbers are in another unit than is said, and a number that is no measurement."""

    def check_bounds(name: str, least: float, greatest: float) -> None:
        values = raw[name]
        bad = np.flatnonzero(~np.isnan(values) & ~((values >= least) & (values <= greatest)))
        if len(bad):
            unit = next(iter(UNITS[QUANTITIES[name]]))
            raise SettingsError(
                f"{path}, line {numbers[bad[0]]}: {columns.plain[name].column}: {name} is {values[bad[0]]:.6g} {unit}; "
                f"accepted: {least:.6g} to {greatest:.6g}"
            )

    with np.errstate(over="ignore", invalid="ignore"):
        found = next(((name, said) for name in raw if (said := wrong_unit(name, raw[name])) is not None), None)
    if found is None:
        for name in raw:
            most = MOST.get(name) or MOST["place" if name in ("x", "y") else "acceleration"]
            check_bounds(name, -most, most)
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
    for name in ("x", "y") if "x" in raw else ():
        there = raw[name][~np.isnan(raw[name])]
        middle = float(np.median(there)) if len(there) else 0.0
        check_bounds(name, middle - _FARTHEST, middle + _FARTHEST)


def _beams(columns: DriveColumns, header: list[str], table: FloatArray, time: FloatArray) -> Beams | None:
    numbers = {} if columns.beams is None else columns.beams.numbers(header)
    if columns.beams is None or not numbers:
        return None
    ranges = table[:, [header.index(name) for name in numbers.values()]] * UNITS["length"].get(columns.beams.unit, 1.0)
    nothing = min(columns.beams.nothing, _SEEN_NOTHING)
    ranges = np.where(ranges >= nothing, np.inf, np.where(ranges > 0.0, ranges, np.nan))
    bearings = np.array([columns.beams.bearing(number) for number in numbers])
    return Beams(time=time - columns.beams.delay, ranges=ranges, bearings=bearings)


def _some(names: Any) -> str:
    names = list(names)
    return ", ".join(names[:12]) + (f" and {len(names) - 12} more" if len(names) > 12 else "")
