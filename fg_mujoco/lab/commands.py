"""Commands over time: what a drive without a planner follows, read from a CSV file or made by a manoeuvre.

The file has the columns `time_s, steering_angle_rad, speed_m_s` in any order, and rows whose times rise. Blank lines
and lines starting with `#` are skipped.
"""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..arguments import explain_class
from ..course.files import read_text
from ..display import brief, quoted
from ..errors import SettingsError, nearest
from ..messages import DriveCommand, FloatArray, LaserScan, Odometry, read_only
from ..simulation.settings import LONGEST_RACE

COLUMNS = ("time_s", "steering_angle_rad", "speed_m_s")
SUFFIX = ".csv"


@explain_class
@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Commands:
    """A table of commands, linear between its rows. Time is counted from the first row.

    Raises:
      SettingsError: less than two rows, columns of different lengths, a value that is not finite, times that do not
        rise, or more than a day.
    """

    time: FloatArray  # (n,) [s]
    steering_angle: FloatArray  # (n,) [rad], left positive
    speed: FloatArray  # (n,) [m/s]
    name: str = "commands"  # of the drive, and of the file in messages

    def __post_init__(self) -> None:
        for field in ("time", "steering_angle", "speed"):
            try:
                object.__setattr__(self, field, read_only(getattr(self, field)))
            except (TypeError, ValueError) as error:
                said = f"{field} is no row of numbers: {error}"
                raise SettingsError(f"{self.name}: {said}; accepted: a number for each row") from error
        shapes = (self.time.shape, self.steering_angle.shape, self.speed.shape)
        if len(set(shapes)) > 1 or self.time.ndim != 1 or len(self.time) < 2:
            found = f"{len(self.time)} row" if shapes == ((1,),) * 3 else f"columns of shapes {shapes}"
            raise SettingsError(f"{self.name}: {found}; accepted: two rows or more of {', '.join(COLUMNS)}")
        table = np.column_stack((self.time, self.steering_angle, self.speed))
        for row, column in np.argwhere(~np.isfinite(table)):
            said = f"{COLUMNS[column]} in row {row + 1} is {table[row, column]}"
            raise SettingsError(f"{self.name}: {said}; accepted: finite numbers")
        for row in np.flatnonzero(np.diff(self.time) <= 0.0):
            before, after = self.time[row : row + 2].tolist()
            said = f"time_s in row {row + 2} is {after:g}, after {before:g} in the row before"
            raise SettingsError(f"{self.name}: {said}; accepted: times that rise")
        if self.seconds > LONGEST_RACE:
            raise SettingsError(f"{self.name}: lasts {self.seconds:g} s; accepted: up to {LONGEST_RACE:g} s, a day")

    def __repr__(self) -> str:
        return brief(self, quoted(self.name), f"{len(self.time)} rows, {self.seconds:g} s")

    @property
    def seconds(self) -> float:
        """Time from the first row to the last [s]."""
        return float(self.time[-1] - self.time[0])

    def at(self, time: float) -> tuple[float, float]:
        """Return the steering angle [rad] and the speed [m/s] so long after the first row; beyond the last, its own."""
        now = self.time[0] + time
        return float(np.interp(now, self.time, self.steering_angle)), float(np.interp(now, self.time, self.speed))

    @classmethod
    def read(cls, path: str | Path) -> Commands:
        """Read a CSV file.

        Raises:
          SettingsError: it cannot be read, lacks a column or has an unknown one, or a row is not of numbers; and as of
            the class.
        """
        try:
            text = read_text(path)
        except (OSError, UnicodeDecodeError) as error:
            reason = (error.strerror if isinstance(error, OSError) else "is not UTF-8") or str(error)
            raise SettingsError(f"{path}: {reason}; accepted: a CSV file with {', '.join(COLUMNS)}") from error
        lines = [(number, line) for number, line in enumerate(text.splitlines(), start=1) if line.strip()]
        lines = [(number, line) for number, line in lines if not line.lstrip().startswith("#")]
        rows = list(csv.reader((line for _, line in lines), skipinitialspace=True))
        header = [name.strip() for name in rows[0]] if rows else []
        _check_header(path, header)
        values = np.empty((len(rows) - 1, len(COLUMNS)))
        for place, ((number, line), row) in enumerate(zip(lines[1:], rows[1:], strict=True)):
            values[place] = _numbers(f"{path}: line {number} is {line.strip()[:60]!r}", row)
        columns = {name: values[:, header.index(name)] for name in COLUMNS}
        return cls(
            time=columns["time_s"], steering_angle=columns["steering_angle_rad"], speed=columns["speed_m_s"],
            name=str(path),
        )  # fmt: skip


def _check_header(path: str | Path, header: list[str]) -> None:
    accepted = f"accepted: {', '.join(COLUMNS)}, in any order"
    for name in header:
        if name not in COLUMNS or header.count(name) > 1:
            meant = nearest(name, COLUMNS)
            hint = "" if meant is None or name in COLUMNS else f"; did you mean {meant!r}?"
            what = "twice" if name in COLUMNS else "which is unknown"
            raise SettingsError(f"{path}: has column {name[:60]!r}, {what}; {accepted}{hint}")
    missing = [name for name in COLUMNS if name not in header]
    if missing:
        raise SettingsError(f"{path}: has no column {', '.join(missing)}; {accepted}")


def _numbers(where: str, row: list[str]) -> list[float]:
    try:
        values = [float(text) for text in row]
    except ValueError:
        values = []
    if len(values) != len(COLUMNS) or not all(map(math.isfinite, values)):
        raise SettingsError(f"{where}; accepted: {len(COLUMNS)} finite numbers, separated by commas")
    return values


class CommandPlayer:
    """Follows commands over time, whatever the scan: a controller that reads nothing but the clock, each tick."""

    def __init__(self, commands: Commands) -> None:
        self._commands = commands

    def reset(self) -> None:
        """Do nothing: there is no memory."""

    def __call__(self, scan: LaserScan, odometry: Odometry) -> DriveCommand:
        """Return the command of this time."""
        steering_angle, speed = self._commands.at(odometry.stamp)
        return DriveCommand(steering_angle=steering_angle, speed=speed)
