"""Checks the files of a run folder: a folder can come from anybody, and is checked before anything reads it.

    check_summary(summary)
    xml = checked_scene(xml)

Each raises a ValueError that says what is wrong and what is accepted.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import MISSING, fields
from pathlib import PurePath
from typing import Any

from ..course.mjcf import checked_mjcf
from ..errors import SettingsError
from ..lidar.effects import LidarEffects
from ..lidar.lidar import LIDAR_BACKENDS
from ..simulation.cars import GREATEST_CARS
from ..simulation.planner_adapter import short
from ..simulation.settings import GREATEST_LAPS
from ..simulation.termination import WrongWay
from .crash import Crash
from .decision_times import DecisionTimes
from .entries import GRIDS
from .rules import RULES, Contact, Overtake, Restart, Warned

GREATEST = 1e9
"""Of the numbers in a summary."""

Accepts = Callable[[Any], bool]


def is_figure(value: Any) -> bool:
    """Return whether a value of a summary is a number within GREATEST."""
    return isinstance(value, (int, float)) and not isinstance(value, bool) and -GREATEST <= value <= GREATEST


def _is_count(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0


def _is_mapping(value: Any, names: set[str], texts: tuple[str, ...] = ()) -> bool:
    """Return whether a value has these names, and numbers but for the `texts`."""
    return (
        isinstance(value, dict)
        and set(value) == names
        and all(isinstance(value[name], str) if name in texts else is_figure(value[name]) for name in value)
    )


def _is_failure(value: Any) -> bool:
    numbers = ("time_s", "line")
    return (
        isinstance(value, dict)
        and {"error", "time_s", "file", "line", "traceback"} <= set(value)
        and is_figure(value["time_s"])
        and (value["line"] is None or is_figure(value["line"]))
        and all(each is None or isinstance(each, str) for name, each in value.items() if name not in numbers)
    )


def _are(kind: type) -> Accepts:
    """Return a test of whether a value is a list of the fields of a dataclass: numbers, texts and pairs of texts."""
    of_type: dict[str, Accepts] = {"float": is_figure, "int": is_figure, "str": lambda value: isinstance(value, str)}
    checks = {field.name: of_type.get(str(field.type), _are_texts) for field in fields(kind)}
    required = {field.name for field in fields(kind) if field.default is MISSING}  # older runs have only these

    def accepts(value: Any) -> bool:
        return isinstance(value, list) and all(
            isinstance(row, dict)
            and required <= set(row) <= set(checks)
            and all(checks[name](value) for name, value in row.items())
            for row in value
        )

    return accepts


def _are_texts(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 2 and all(isinstance(each, str) for each in value)


def _are_cars(value: Any) -> bool:
    """Return whether a value is rows of cars; of several, with what a replay of them needs."""
    if not isinstance(value, list) or len(value) > GREATEST_CARS or not all(isinstance(row, dict) for row in value):
        return False
    if not all(is_figure(row.get("end_time_s", 0.0)) for row in value):
        return False
    names = [row.get("name") for row in value]
    return len(value) < 2 or (
        all(isinstance(name, str) for name in names)
        and len(set(names)) == len(names)
        and all(_is_row(row) for row in value)
    )


def _is_row(row: dict[str, Any]) -> bool:
    """Return whether the row of one of several cars has what a replay and a report of them need."""
    return (
        all(isinstance(row.get(name), str) for name in ("end_reason", "controller", "vehicle"))
        and all(is_figure(row.get(name)) for name in ("end_time_s", "max_speed_m_s"))
        and (row.get("max_slide_m_s") is None or is_figure(row["max_slide_m_s"]))
        and all(_is_count(row.get(name)) for name in ("position", "laps_completed", "collisions_car"))
        and isinstance(row.get("finished"), bool)
        and _is_count(row.get("collisions_wall"))
        and isinstance(row.get("lap_times_s"), list)
        and all(map(is_figure, row["lap_times_s"]))
        and (row.get("lidar_effects") is None or _is_effects(row["lidar_effects"]))
    )


def _is_times(value: Any) -> bool:
    return isinstance(value, dict) and _is_mapping({k: 0 if v is None else v for k, v in value.items()}, _TIMES)


def _is_crash(value: Any) -> bool:
    """Return whether a value is a Crash; how long tires without a peak had slid is null."""
    if not isinstance(value, dict):
        return False
    known = {k: 0.0 if v is None and k.startswith("slid_") else v for k, v in value.items()}
    return _is_mapping(known, _CRASH, ("into", "geom"))


def _is_settings(value: Any) -> bool:
    limit = value.get("time_limit") if isinstance(value, dict) else 0
    return limit is None or (is_figure(limit) and limit > 0.0)


def _is_effects(value: Any) -> bool:
    """Return whether a value is LidarEffects with all numbers inside: no file is read."""
    if not isinstance(value, dict) or isinstance(value.get("measured"), str):
        return False
    try:
        LidarEffects(**value)
    except (TypeError, SettingsError):
        return False
    return True


_WRONG_WAY, _CRASH, _TIMES = ({field.name for field in fields(kind)} for kind in (WrongWay, Crash, DecisionTimes))
_TEXT: tuple[str, Accepts] = ("a text", lambda value: isinstance(value, str))
_TRUTH: tuple[str, Accepts] = ("true or false", lambda value: isinstance(value, bool))
_COUNT: tuple[str, Accepts] = (
    f"a whole number from 0 to {GREATEST:.0e}", lambda value: _is_count(value) and value <= GREATEST
)  # fmt: skip
_SEED: tuple[str, Accepts] = ("a whole number from 0", _is_count)
_NUMBER: tuple[str, Accepts] = (f"a number within {GREATEST:.0e}", is_figure)
_POSITIVE: tuple[str, Accepts] = (
    f"a number above 0, up to {GREATEST:.0e}", lambda value: is_figure(value) and value > 0.0
)  # fmt: skip
_NUMBERS: tuple[str, Accepts] = (
    "a list of numbers", lambda value: isinstance(value, list) and all(map(is_figure, value))
)  # fmt: skip


def _are_sensors(value: Any) -> bool:
    """Say whether a value may be sensors; whether there are such, whoever measures with them says."""
    return isinstance(value, list) and all(isinstance(each, dict) and "sensor" in each for each in value)


def _are_texts_by_name(value: Any) -> bool:
    return isinstance(value, dict) and all(each is None or isinstance(each, str) for each in value.values())


def _is_origin(value: Any) -> bool:
    """Return whether this is where a planner comes from; older versions have no `files`."""
    texts = {name: each for name, each in value.items() if name != "files"} if isinstance(value, dict) else value
    return _are_texts_by_name(texts) and (value.get("files") is None or _are_texts_by_name(value["files"]))


_BY_NAME: tuple[str, Accepts] = ("values by name", lambda value: isinstance(value, dict))
_SUMMARY: dict[str, tuple[str, Accepts]] = {
    "track": _TEXT, "vehicle": _TEXT, "vehicle_sha256": _TEXT, "tires": _TEXT, "tires_model": _TEXT,
    "controller": _TEXT, "assist": _TEXT, "end_reason": _TEXT, "trajectory_sha256": _TEXT,
    "fg_mujoco_version": _TEXT, "mujoco_version": _TEXT,
    "platform": _TEXT, "finished": _TRUTH, "laps_completed": _COUNT, "collisions": _COUNT, "obstacles": _COUNT,
    "clamped_commands": _COUNT, "seed": _SEED, "obstacle_seed": _SEED, "lap_times_s": _NUMBERS,
    **dict.fromkeys(("mu", "planner_mu", "speed_limit_m_s", "decision_limit_s"), _POSITIVE),
    **dict.fromkeys(
        ("max_slide_m_s", "max_lateral_slide_m_s", "slide_time_fraction", "mean_speed_m_s", "max_speed_m_s",
         "sim_time_s", "wall_time_s", "realtime_factor", "odometry_drift"), _NUMBER,
    ),
    "lidar": (" or ".join(LIDAR_BACKENDS), lambda value: value in LIDAR_BACKENDS),
    "laps_requested": (
        f"a whole number from 0 to {GREATEST_LAPS}", lambda value: _is_count(value) and value <= GREATEST_LAPS
    ),
    "controller_origin": ("texts by name, and files as texts by name", _is_origin),
    "decision_times": (
        "the fields of DecisionTimes",
        _is_times,
    ),
    "lidar_effects": ("the fields of LidarEffects, and no file's name", _is_effects),
    "planner_settings": _BY_NAME,
    "settings": (
        "settings by name, time_limit above 0",
        _is_settings,
    ),
    "cars": (f"a row of values for each of up to {GREATEST_CARS} cars", _are_cars),
    "grid": (" or ".join(GRIDS), lambda value: value in GRIDS),
    "rules": (" or ".join(RULES), lambda value: isinstance(value, str) and value in RULES),
    "winner": _TEXT,
    "floor": _TEXT,
    **{
        name: (f"a list of {kind.__name__}, as a race wrote it", _are(kind))
        for name, kind in (("overtakes", Overtake), ("contacts", Contact), ("warnings", Warned), ("restarts", Restart))
    },
    "wrong_way": (f"wrong_way, of {', '.join(sorted(_WRONG_WAY))}", lambda value: _is_mapping(value, _WRONG_WAY)),
    "crash": (f"crash, of {', '.join(sorted(_CRASH))}", _is_crash),
    "planner_failure": ("planner_failure, as a race wrote it", _is_failure),
    "sensors": ("a list of sensors, as a race wrote it", _are_sensors),
}  # fmt: skip
"""Entries of a summary by name: the accepted values in words, and a test of a value. Each may be null or missing."""


def check_summary(summary: Mapping[str, Any]) -> None:
    """Raise ValueError for a value that is of another kind than a race writes."""
    for name, (accepted, accepts) in _SUMMARY.items():
        value = summary.get(name)
        if value is not None and not accepts(value):
            raise ValueError(f"{name} is {short(value)}; accepted: {accepted}")


def checked_scene(xml: str) -> str:
    """Return the text of a scene, written anew from what was checked of it.

    Raises:
      ValueError: it names other files, or MuJoCo would make far more of it than it lists.
    """
    scene = checked_mjcf(xml)
    for name, data in scene.texts:
        path = PurePath(data)
        if name.endswith(_NAMING) and not path.is_absolute() and path.name != str(path):
            raise ValueError(f"text {short(name)} is {short(data)}; accepted: a bundled file, or an absolute path")
    return scene.text


_NAMING = ("look", "file")  # ends of the names of texts that name a look, or a LiDAR
