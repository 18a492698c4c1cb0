"""Checks the files of a run folder before anything reads them, so that a damaged one is told in one line.

    check_summary(summary)
    xml = checked_scene(xml)

Each raises a ValueError that says what is wrong and what is accepted.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import MISSING, fields, is_dataclass
from functools import partial
from pathlib import PurePath
from types import UnionType
from typing import Any, get_args, get_origin, get_type_hints

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
from .off_the_wheels import Jump, Stuck
from .rules import RULES, Contact, Overtake, Restart, Warned

_GREATEST = 1e9  # of the numbers in a summary
_GREATEST_COUNT = 2**63  # and of whole ones, which seeds are
_WRITTEN = "as a race wrote it"


def _fits(value: Any, kind: Any) -> bool:
    """Return whether a value of JSON is as a race writes one of a type, a dataclass, or values by name of such."""
    if is_dataclass(kind):
        kinds, required = get_type_hints(kind), {f.name for f in fields(kind) if f.default is MISSING}
        return isinstance(value, dict) and required <= set(value) <= set(kinds) and _fits(value, kinds)
    if isinstance(kind, dict):
        return isinstance(value, dict) and all(
            name not in value or (value[name] is None and name.startswith("slid_")) or _fits(value[name], own)
            for name, own in kind.items()  # how long tires without a peak had slid is null
        )
    if get_origin(kind) is tuple:
        of, *others = get_args(kind)
        count = others == [...] or (isinstance(value, list) and len(value) == 1 + len(others))
        return isinstance(value, list) and count and all(_fits(each, of) for each in value)
    if kind is Any:
        return True
    if get_origin(kind) is dict:
        return isinstance(value, dict) and all(_fits(each, get_args(kind)[1]) for each in value.values())
    if isinstance(kind, UnionType):
        return any(_fits(value, each) for each in get_args(kind))
    if kind in (int, float):
        limits = (0, _GREATEST_COUNT) if kind is int else (-_GREATEST, _GREATEST)
        accepted = (int,) if kind is int else (int, float)
        return isinstance(value, accepted) and not isinstance(value, bool) and limits[0] <= value <= limits[1]
    return isinstance(value, kind)


_OF_A_CAR: dict[str, Any] = {
    **dict.fromkeys(("vehicle", "controller", "end_reason"), str), "finished": bool,
    **dict.fromkeys(("laps_completed", "position", "collisions_wall", "collisions_car"), int),
    **dict.fromkeys(("end_time_s", "max_speed_m_s"), float), "lap_times_s": tuple[float, ...],
}  # fmt: skip
"""Values of each of several cars that a replay and a report of them need."""


def _are_cars(value: Any) -> bool:
    """Return whether a value is rows of cars; of several, with what a replay of them needs."""
    if not isinstance(value, list) or len(value) > GREATEST_CARS:
        return False
    if not all(_fits(row, {"end_time_s": float, "max_slide_m_s": float | None}) for row in value):
        return False
    names = [row.get("name") for row in value]
    return len(value) < 2 or (
        all(isinstance(name, str) for name in names)
        and len(set(names)) == len(names)
        and all(set(_OF_A_CAR) <= set(row) and _fits(row, _OF_A_CAR) for row in value)
        and all(row.get("lidar_effects") is None or _is_effects(row["lidar_effects"]) for row in value)
    )


def _is_effects(value: Any) -> bool:
    """Return whether a value is LidarEffects with all numbers inside: no file is read."""
    if not isinstance(value, dict) or isinstance(value.get("measured"), str):
        return False
    try:
        LidarEffects(**value)
    except (TypeError, SettingsError):
        return False
    return True


def _is_origin(value: Any) -> bool:
    """Return whether this is where a planner comes from: texts by name, and the hashes of its files by theirs."""
    text_or_none = dict[str, str | None]
    own = isinstance(value, dict) and {name: each for name, each in value.items() if name != "files"}
    return _fits(own, text_or_none) and _fits(value.get("files") or {}, text_or_none)


def _is_above_0(value: Any) -> bool:
    return _fits(value, float) and value > 0.0


def _is_settings(value: Any) -> bool:
    limit = value.get("time_limit") if isinstance(value, dict) else 0
    return limit is None or _is_above_0(limit)


_KINDS: dict[str, Any] = {
    **dict.fromkeys(
        ("track", "vehicle", "vehicle_sha256", "tires", "tires_model", "controller", "assist", "end_reason",
         "trajectory_sha256", "fg_mujoco_version", "mujoco_version", "platform", "winner", "floor"), str,
    ),
    **dict.fromkeys(
        ("laps_completed", "collisions", "obstacles", "clamped_commands", "seed", "obstacle_seed"), int
    ),
    **dict.fromkeys(
        ("max_slide_m_s", "max_lateral_slide_m_s", "slide_time_fraction", "mean_speed_m_s", "max_speed_m_s",
         "sim_time_s", "wall_time_s", "realtime_factor", "odometry_drift"), float,
    ),
    "finished": bool, "planner_settings": dict, "lap_times_s": tuple[float, ...],
    "overtakes": tuple[Overtake, ...], "contacts": tuple[Contact, ...], "warnings": tuple[Warned, ...],
    "restarts": tuple[Restart, ...], "decision_times": DecisionTimes, "wrong_way": WrongWay, "crash": Crash,
    "jumps": tuple[Jump, ...], "stuck": Stuck,
}  # fmt: skip
"""Entries of a summary by name: the type whose values a race writes. Each may be null or missing."""

_WORDS = {
    str: "a text", int: "a whole number from 0", float: f"a number within {_GREATEST:.0e}", bool: "true or false",
    dict: "values by name",
}  # fmt: skip
_STEP = {"name": str, "steering_angle_rad": float | None, "speed_m_s": float | None, "text": str}
_FAILURE = {
    "error": str, "time_s": float, "file": str | None, "line": int | None, "traceback": str | None, "scan": str | None
}  # fmt: skip
_TESTS: Mapping[str, tuple[str, Callable[[Any], bool]]] = {
    **dict.fromkeys(
        ("mu", "planner_mu", "speed_limit_m_s", "decision_limit_s"),
        (f"a number above 0, up to {_GREATEST:.0e}", _is_above_0),
    ),
    "laps_requested": (
        f"a whole number from 0 to {GREATEST_LAPS}", lambda value: _fits(value, int) and value <= GREATEST_LAPS
    ),
    "lidar": (" or ".join(LIDAR_BACKENDS), lambda value: value in LIDAR_BACKENDS),
    "grid": (" or ".join(GRIDS), lambda value: value in GRIDS),
    "rules": (" or ".join(RULES), lambda value: isinstance(value, str) and value in RULES),
    "controller_origin": ("texts by name, and files as texts by name", _is_origin),
    "lidar_effects": ("the fields of LidarEffects, and no file's name", _is_effects),
    "settings": ("settings by name, time_limit above 0", _is_settings),
    "cars": (f"a row of values for each of up to {GREATEST_CARS} cars", _are_cars),
    "last_decision": (_WRITTEN, lambda value: isinstance(value, list) and all(_fits(each, _STEP) for each in value)),
    "planner_failure": (_WRITTEN, lambda value: _fits(value, _FAILURE) and {*_FAILURE} - {"scan"} <= set(value)),
    "sensors": (
        _WRITTEN, lambda value: _fits(value, tuple[dict[str, Any], ...]) and all("sensor" in each for each in value)
    ),
} | {
    name: (_WORDS.get(kind, _WRITTEN), partial(_fits, kind=kind)) for name, kind in _KINDS.items()
}  # fmt: skip
"""Entries of a summary by name: the accepted values in words, and a test of a value."""


def check_summary(summary: Mapping[str, Any]) -> None:
    """Raise ValueError for a value that is of another kind than a race writes."""
    for name, (accepted, accepts) in _TESTS.items():
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
