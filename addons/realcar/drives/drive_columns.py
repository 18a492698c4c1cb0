"""Says which column of a CSV file is what, in which unit, and by what it is corrected.

A mapping is a TOML file, or one of LAYOUTS, which are recognised by their columns:

    time = {column = "t", unit = "ms", scale = "measured"}     # the clock's scale, as the poses say
    speed = {column = "erpm", scale = 0.0002167}
    yaw_rate = {column = "gyro_z", unit = "deg/s", scale = 1.03, delay = 0.02}
    steering = "steer_rad"                                     # a column that needs nothing else
    steering_is = "command"                                    # or "angle", as measured
    speed_command = "target_speed"                             # from here on optional
    acceleration_command = {column = "a", unit = "m/s^2"}      # in place of it: of a car that is sent accelerations
    x = "x"
    y = "y"
    yaw = {column = "theta", unit = "deg"}
    pose_ahead = 0.0                                           # [m] of the pose's point ahead of the rear axle
    forward_acceleration = "ax"
    lateral_acceleration = "ay"
    beams = {columns = "beam_{}_m", count = 1080, field_of_view = 270.0, nothing = 65.5}

A value is `scale * (number in its unit) + offset`. A delay is that of the sensor [s]. "measured" takes scale or delay
from `check_drive`, that is from the poses; only time, speed and yaw_rate have it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, fields
from functools import cache
from pathlib import Path
from typing import Any

from fg_mujoco.course.documents import read_toml
from fg_mujoco.display import brief
from fg_mujoco.errors import SettingsError, accepted_names
from fg_mujoco.messages import require, require_whole, shown

MEASURED = "measured"
LONGEST_DELAY, FURTHEST, MOST_BEAMS = 10.0, 10.0, 100_000
"""[s] of a sensor, [m] of a pose's point from the rear axle, and of a LiDAR."""

UNITS: dict[str, dict[str, float]] = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
    "length": {"m": 1.0, "cm": 1e-2, "mm": 1e-3},
    "angle": {"rad": 1.0, "deg": math.pi / 180.0},
    "speed": {"m/s": 1.0, "km/h": 1.0 / 3.6, "mm/s": 1e-3},
    "yaw rate": {"rad/s": 1.0, "deg/s": math.pi / 180.0},
    "acceleration": {"m/s^2": 1.0, "g": 9.80665},
}
"""Quantity -> unit -> its size in SI units."""

QUANTITIES = {
    "time": "time", "speed": "speed", "yaw_rate": "yaw rate", "steering": "angle", "speed_command": "speed",
    "acceleration_command": "acceleration",
    "x": "length", "y": "length", "yaw": "angle", "forward_acceleration": "acceleration",
    "lateral_acceleration": "acceleration",
}  # fmt: skip
"""Name in a mapping -> its quantity."""

REQUIRED = ("time", "speed", "yaw_rate", "steering")
_MEASURABLE = {"time": ("scale",), "speed": ("delay",), "yaw_rate": ("scale", "delay")}
_TOGETHER = (("x", "y", "yaw"), ("forward_acceleration", "lateral_acceleration"))


@dataclass(frozen=True, kw_only=True)
class Column:
    """A column of a file, and how its numbers become SI units; SettingsError: a value outside of what is accepted."""

    column: str
    unit: str = ""  # of UNITS; empty: the SI unit
    scale: float | str = 1.0  # or "measured"
    offset: float = 0.0  # [SI unit], added after the scale
    delay: float | str = 0.0  # [s] of the sensor, or "measured"

    def __post_init__(self) -> None:
        if not isinstance(self.column, str) or not self.column:
            raise SettingsError(f"column is {shown(self.column)}; accepted: the name of a column")
        for name, most in (("scale", 1e12), ("offset", 1e10), ("delay", LONGEST_DELAY)):
            value = getattr(self, name)
            number = _is_number(value) and (1.0 / most if name == "scale" else 0.0) <= abs(value) <= most
            if not number and (name == "offset" or value != MEASURED):
                accepted = f"a number of at most {most:g}" + ("" if name == "offset" else f", or {MEASURED!r}")
                raise SettingsError(f"{name} is {shown(value)}; accepted: {accepted}")

    @property
    def factor(self) -> float:
        """The scale, 1 where it is measured."""
        return 1.0 if self.scale == MEASURED else float(self.scale)

    @property
    def late(self) -> float:
        """The delay [s], 0 where it is measured."""
        return 0.0 if self.delay == MEASURED else float(self.delay)


@dataclass(frozen=True, kw_only=True)
class BeamColumns:
    """The columns of a LiDAR's beams, numbered from the right; SettingsError: a value outside of what is accepted."""

    columns: str  # with {} in place of the number of the beam
    count: int  # of the LiDAR's beams, recorded or not
    field_of_view: float = 270.0  # [deg] from the first to the last
    nothing: float = 65.0  # [m] from here on nothing was seen: a Hokuyo says 65.533 of a beam without return
    unit: str = "m"
    delay: float = 0.0  # [s] of the scan after the row

    def __post_init__(self) -> None:
        if not isinstance(self.columns, str) or self.columns.count("{}") != 1:
            raise SettingsError(f"beams: columns is {shown(self.columns)}; accepted: a name with one {{}} in it")
        require_whole("beams: count", self.count, 2, MOST_BEAMS)
        for name, least, most in (
            ("field_of_view", 1.0, 360.0), ("nothing", 1e-3, math.inf), ("delay", -LONGEST_DELAY, LONGEST_DELAY)
        ):  # fmt: skip
            value = getattr(self, name)
            if not (_is_number(value) and least <= value <= most):
                raise SettingsError(f"beams: {name} is {shown(value)}; accepted: a number from {least:g} to {most:g}")
        _require_unit("beams", "length", self.unit)

    def bearing(self, number: int) -> float:
        """Return where a beam looks [rad], to the left of straight ahead."""
        whole = math.radians(self.field_of_view)
        return -0.5 * whole + whole * number / (self.count - 1)

    def numbers(self, columns: Collection[str]) -> dict[int, str]:
        """Return the columns of beams among those of a file, by the number of the beam, from the right."""
        before, _, after = self.columns.partition("{}")
        pattern = re.compile(re.escape(before) + r"(\d{1,9})" + re.escape(after))
        found = {int(match[1]): name for name in columns if (match := pattern.fullmatch(name)) is not None}
        return dict(sorted((number, name) for number, name in found.items() if number < self.count))


@dataclass(frozen=True, kw_only=True, repr=False)
class DriveColumns:
    """Which columns of a CSV file a drive is read from; SettingsError: one is missing, or what is not accepted."""

    time: Column
    speed: Column
    yaw_rate: Column
    steering: Column
    steering_is: str = "command"  # which holds until the next one; or "angle", as measured
    speed_command: Column | None = None
    acceleration_command: Column | None = None
    x: Column | None = None
    y: Column | None = None
    yaw: Column | None = None
    pose_ahead: float = 0.0  # [m] of the pose's point ahead of the rear axle
    forward_acceleration: Column | None = None
    lateral_acceleration: Column | None = None
    beams: BeamColumns | None = None
    name: str = field(default="a mapping", compare=False)  # of the layout or the file, for messages

    def __post_init__(self) -> None:
        for name, quantity in QUANTITIES.items():
            value = getattr(self, name)
            if isinstance(value, str):
                value = Column(column=value)
                object.__setattr__(self, name, value)
            if value is None:
                continue
            _require_unit(name, quantity, value.unit)
            for part in ("scale", "delay"):
                if getattr(value, part) == MEASURED and part not in _MEASURABLE.get(name, ()):
                    raise SettingsError(f"{name}: {part} is {MEASURED!r}; accepted: a number; {_measurable()}")
        if self.steering_is not in ("command", "angle"):
            raise SettingsError(
                f"steering_is is {shown(self.steering_is)}; {accepted_names(self.steering_is, ('command', 'angle'))}"
            )
        require(self, lambda value: abs(value) <= FURTHEST, f"{FURTHEST:g} m at most", ("pose_ahead",), SettingsError)
        if self.speed_command is not None and self.acceleration_command is not None:
            raise SettingsError("speed_command and acceleration_command are given; accepted: the one that the car gets")
        for group in _TOGETHER:
            there = [name for name in group if getattr(self, name) is not None]
            if there and len(there) < len(group):
                lacks = next(name for name in group if name not in there)
                raise SettingsError(f"{there[0]} is given without {lacks}; accepted: {', '.join(group)} together")
        if self.x is None and any(
            MEASURED in (column.scale, column.delay) for column in (self.time, self.speed, self.yaw_rate)
        ):
            raise SettingsError(f"{MEASURED!r} needs poses; accepted: x, y and yaw besides, or numbers")

    def __repr__(self) -> str:
        return brief(self, self.name, *(column.column for column in self.plain.values()))

    @property
    def plain(self) -> dict[str, Column]:
        """The columns with one number a row, by their names here."""
        found = {name: getattr(self, name) for name in QUANTITIES}
        return {name: column for name, column in found.items() if column is not None}

    @classmethod
    def of(cls, columns: DriveColumns | Mapping[str, Any] | str | Path) -> DriveColumns:
        """Return a mapping as it is, of keys and values, of a name of LAYOUTS or of a TOML file; else SettingsError."""
        if isinstance(columns, DriveColumns):
            return columns
        if isinstance(columns, Mapping):
            return cls._of_values(columns, "the mapping")
        if str(columns) in LAYOUTS:
            return layout(str(columns))
        if Path(columns).suffix.lower() != ".toml":
            others = ", or the path of a TOML file"
            raise SettingsError(f"columns is {shown(str(columns))}; {accepted_names(str(columns), LAYOUTS, others)}")
        content = read_toml(columns)
        try:
            return cls._of_values(content.values, str(columns))
        except SettingsError as error:
            raise SettingsError(content.located(str(error))) from error

    @classmethod
    def _of_values(cls, values: Mapping[str, Any], name: str) -> DriveColumns:
        known = [each.name for each in fields(cls) if each.name != "name"]
        made: dict[str, Any] = {}
        for key, value in values.items():
            if key not in known:
                raise SettingsError(f"{key} is no part of a drive; {accepted_names(key, known)}")
            kind: type[Any] | None = BeamColumns if key == "beams" else Column if key in QUANTITIES else None
            made[key] = value
            if kind is None:
                continue
            if kind is Column and isinstance(value, str):
                value = {"column": value}
            if not isinstance(value, Mapping):
                raise SettingsError(f"{key} is {shown(value)}; accepted: a column's name, or a table")
            parts = [each.name for each in fields(kind)]
            for part in value:
                if part not in parts:
                    raise SettingsError(f"{key}: {part} is not known; {accepted_names(part, parts)}")
            for part in ("column", "columns", "count"):
                if part in parts and part not in value:
                    raise SettingsError(f"{key}: has no {part}; accepted: with {part}")
            try:
                made[key] = kind(**value)
            except SettingsError as error:
                raise SettingsError(f"{key}: {error}" if kind is Column else str(error)) from error
        lacks = next((each for each in REQUIRED if each not in made), None)
        if lacks is not None:
            raise SettingsError(f"{name}: has no {lacks}; accepted: with {', '.join(REQUIRED)}")
        return cls(**made, name=name)


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and value == value


def _require_unit(name: str, quantity: str, unit: str) -> None:
    if not isinstance(unit, str) or (unit and unit not in UNITS[quantity]):
        raise SettingsError(f"{name}: unit is {shown(unit)}; {accepted_names(unit, UNITS[quantity])}")


def _measurable() -> str:
    return ", ".join(f"{part} of {name}" for name, parts in _MEASURABLE.items() for part in parts) + " can be measured"


LAYOUTS: dict[str, dict[str, Any]] = {
    "real_drives": {
        # F1Tenth-INI/f1tenth_development_gym, cut down: ../shared/data/real_drives/README.md. Its clock is nominal, and
        # its gyro and its motor's speed come after its poses. What it calls a speed is an acceleration: its owners
        # name the column ACCELERATION_CONTROL_COLUMN, and the drives say so (docs/addons/realcar/validation.md).
        "time": {"column": "time_s", "scale": MEASURED},
        "speed": {"column": "vx_m_s", "delay": MEASURED},
        "yaw_rate": {"column": "yaw_rate_rad_s", "scale": MEASURED, "delay": MEASURED},
        "steering": "steering_executed_rad",
        "acceleration_command": {"column": "speed_executed_m_s", "unit": "m/s^2"},
        "x": "x_m", "y": "y_m", "yaw": "yaw_rad",
        "beams": {"columns": "beam_{}_m", "count": 1080},
    },
    "ini": {
        # The same drives as their owners write them, below comments.
        "time": {"column": "time", "scale": MEASURED},
        "speed": {"column": "linear_vel_x", "delay": MEASURED},
        "yaw_rate": {"column": "angular_vel_z", "scale": MEASURED, "delay": MEASURED},
        "steering": "angular_control_executed",
        "acceleration_command": {"column": "translational_control_executed", "unit": "m/s^2"},
        "x": "pose_x", "y": "pose_y", "yaw": "pose_theta",
        "beams": {"columns": "LIDAR_{}", "count": 1080},
    },
    "ini_2024": {  # without what the car was sent; whether the translational control is a speed is not said
        "time": "time", "speed": "linear_vel_x", "yaw_rate": "angular_vel_z", "steering": "angular_control_calculated",
        "x": "pose_x", "y": "pose_y", "yaw": "pose_theta",
        "beams": {"columns": "LIDAR_{}", "count": 1080},
    },
    "plain": {
        "time": "time_s", "speed": "speed_m_s", "yaw_rate": "yaw_rate_rad_s", "steering": "steering_rad",
        "speed_command": "speed_command_m_s", "x": "x_m", "y": "y_m", "yaw": "yaw_rad",
        "forward_acceleration": "forward_acceleration_m_s2", "lateral_acceleration": "lateral_acceleration_m_s2",
    },
}  # fmt: skip
"""Layouts of files that are known, by name. "plain" has our names. Optional columns that a file lacks are left out."""


@cache
def layout(name: str) -> DriveColumns:
    """Return one of LAYOUTS."""
    return DriveColumns._of_values(LAYOUTS[name], name)


def recognised(header: Collection[str]) -> DriveColumns | None:
    """Return the layout whose required columns a file has, without the optional ones that it lacks."""
    for name, values in LAYOUTS.items():
        columns = layout(name).plain
        there = {key for key, column in columns.items() if column.column in header}
        if not set(REQUIRED) <= there:
            continue
        for group in _TOGETHER:
            if not set(group) <= there:
                there -= set(group)
        kept = {key: value for key, value in values.items() if key in there or key not in QUANTITIES}
        if "x" not in there:
            measured = {"time": 1, "speed": 1, "yaw_rate": 1}
            kept |= {key: columns[key].column for key in measured if MEASURED in str(kept[key])}
        return DriveColumns._of_values(kept, name)
    return None
