"""Errors of a real LiDAR by range and bearing: its noise, its bias and its dropouts, as measured on drives.

A file is TOML with the keys of MeasuredErrors. The bundled files are those of models/lidar_effects/.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import lru_cache
from importlib.resources import files
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from fg_mujoco.arguments import explain_class
from fg_mujoco.course.documents import read_toml_table
from fg_mujoco.course.files import read_setting
from fg_mujoco.display import brief
from fg_mujoco.errors import SettingsError, accepted_names
from fg_mujoco.messages import FloatArray

MOST_KNOTS = 32
"""Ranges or bearings of a table at most."""

_MOST_BYTES = 2**18  # of a file
_TABLES = {"noise": (0.0, 10.0, "0 to 10 m"), "bias": (-10.0, 10.0, "-10 to 10 m"), "dropout": (0.0, 1.0, "0 to 1")}


@explain_class
@dataclass(frozen=True, kw_only=True, repr=False)
class MeasuredErrors:
    """Errors of a LiDAR's beams, linear between ranges and bearings, constant beyond; SettingsError: another shape."""

    ranges: tuple[float, ...]  # (k,) [m] true distances, increasing
    bearings: tuple[float, ...]  # (m,) [rad] from straight ahead, left positive, increasing
    noise: tuple[tuple[float, ...], ...]  # (m, k) [m] standard deviation of a range, Gaussian, each beam on its own
    bias: tuple[tuple[float, ...], ...]  # (m, k) [m] mean of measured less true range
    dropout: tuple[tuple[float, ...], ...]  # (m, k) probability that a beam fails
    source: str = ""  # where and how they were measured

    def __post_init__(self) -> None:
        for name in ("ranges", "bearings"):
            values = _numbers(name, getattr(self, name))
            if not 1 <= len(values) <= MOST_KNOTS or any(b <= a for a, b in pairwise(values)):
                said = f"MeasuredErrors.{name} is {list(values)}"
                raise SettingsError(f"{said}; accepted: 1 to {MOST_KNOTS} increasing numbers")
            object.__setattr__(self, name, values)
        for name, (least, most, accepted) in _TABLES.items():
            given = getattr(self, name)
            rows = given if isinstance(given, (list, tuple)) else ()
            table = tuple(_numbers(name, row) for row in rows)
            if [len(row) for row in table] != [len(self.ranges)] * len(self.bearings):
                shape = f"{len(self.bearings)} rows, one for each bearing, of {len(self.ranges)} numbers"
                lengths = f"{len(table)} rows of {sorted({len(row) for row in table})} numbers"
                raise SettingsError(f"MeasuredErrors.{name} has {lengths}; accepted: {shape}")
            for value in (value for row in table for value in row):
                if not least <= value <= most:
                    raise SettingsError(f"MeasuredErrors.{name} has {value!r}; accepted: {accepted}")
            object.__setattr__(self, name, table)
        if not isinstance(self.source, str):
            raise SettingsError(f"MeasuredErrors.source is {self.source!r}; accepted: a text")

    def __repr__(self) -> str:
        noise = [value for row in self.noise for value in row]
        spread = f"noise {min(noise):.3g} to {max(noise):.3g} m"
        return brief(self, f"{len(self.bearings)} bearings x {len(self.ranges)} ranges", spread)

    @classmethod
    def load(cls, source: MeasuredErrors | str | Path | Mapping[str, Any]) -> MeasuredErrors:
        """Return the errors of a LiDAR of a bundled name, a TOML file, its content or itself; else SettingsError."""
        if isinstance(source, MeasuredErrors):
            return source
        if isinstance(source, Mapping):
            return _of(source, "LidarEffects.measured")
        if not isinstance(source, (str, Path)):
            accepted = "a bundled name, the path of a TOML file, or MeasuredErrors"
            raise SettingsError(f"LidarEffects.measured is {source!r}; accepted: {accepted}")
        if isinstance(source, str) and not source.endswith(".toml") and "/" not in source:
            return _bundled(source)
        said = f"LiDAR effects {source}"
        return _parsed(read_setting(Path(source).expanduser(), said, "a TOML file", _MOST_BYTES), said)

    @property
    def toml(self) -> str:
        """The text of its file, which `load` reads."""
        lines = [f"source = {_quoted(self.source)}"] if self.source else []
        lines += [f"ranges = {list(self.ranges)}  # [m]", f"bearings = {list(self.bearings)}  # [rad] left positive"]
        units = {"noise": "[m] standard deviation", "bias": "[m] measured less true", "dropout": "probability"}
        for name in _TABLES:
            rows = [f"  {list(row)}," for row in getattr(self, name)]
            said = f"# {units[name]}; a row for each bearing, a column for each range"
            lines += ["", said, f"{name} = [", *rows, "]"]
        return "\n".join(lines) + "\n"

    def at(self, bearings: FloatArray) -> FloatArray:
        """Return noise, bias and dropout at `bearings` (n,) and at each of `ranges`. Shape (n, k, 3)."""
        tables = [np.array(getattr(self, name)) for name in _TABLES]
        return np.stack(
            [
                np.column_stack([np.interp(bearings, self.bearings, column) for column in table.T])
                for table in tables
            ],
            axis=-1,
        )


def effect_names() -> tuple[str, ...]:
    """Return the names of the bundled files."""
    folder = files("fg_mujoco.models") / "lidar_effects"
    return tuple(sorted(file.name.removesuffix(".toml") for file in folder.iterdir() if file.name.endswith(".toml")))


def _numbers(name: str, values: Any) -> tuple[float, ...]:
    if not isinstance(values, (list, tuple)):
        raise SettingsError(f"MeasuredErrors.{name} is {values!r}; accepted: a list of numbers")
    for value in values:
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not abs(value) <= 1e6:
            raise SettingsError(f"MeasuredErrors.{name} has {value!r}; accepted: numbers")
    return tuple(map(float, values))


def _quoted(text: str) -> str:
    inside = text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
    return f'"{inside}"'


@lru_cache(maxsize=8)
def _bundled(name: str) -> MeasuredErrors:
    if name not in effect_names():
        names = accepted_names(name, effect_names(), ", or path/to/file.toml")
        raise SettingsError(f"LidarEffects.measured is {name!r}; {names}")
    file = files("fg_mujoco.models") / "lidar_effects" / f"{name}.toml"
    return _parsed(file.read_text("utf-8"), f"models/lidar_effects/{name}.toml")


def _parsed(text: str, where: str) -> MeasuredErrors:
    table = read_toml_table(text, where, "as models/lidar_effects/ipz20.toml has it")
    return _of(table, where)


def _of(table: Mapping[str, Any], where: str) -> MeasuredErrors:
    names = [f.name for f in fields(MeasuredErrors)]
    for name in table:
        if name not in names:
            raise SettingsError(f"{where}: has {name!r}; {accepted_names(name, names)}")
    lacking = [name for name in names if name not in table and name != "source"]
    if lacking:
        raise SettingsError(f"{where}: has no {lacking[0]}; accepted: {', '.join(names)}")
    try:
        return MeasuredErrors(**table)
    except SettingsError as error:
        raise SettingsError(f"{where}: {str(error).removeprefix('MeasuredErrors.')}") from error
