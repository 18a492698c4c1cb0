"""What the files of a run folder may hold: a folder can come from anybody, and is checked before anything reads it.

    check_summary(summary)
    check_scene(xml)

Each raises a ValueError that says what is wrong and what is accepted. A scene that `race --out` writes names no file
and lists all that it has, so that what MuJoCo makes of it is about as large as its text.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import fields
from pathlib import PurePath
from typing import Any
from xml.parsers import expat

from ..errors import SettingsError
from ..lidar.effects import LidarEffects
from ..lidar.lidar import LIDAR_BACKENDS
from ..simulation.cars import GREATEST_CARS
from ..simulation.planner_adapter import short, short_text
from ..simulation.settings import GREATEST_LAPS
from ..simulation.termination import WrongWay
from .crash import Crash
from .decisions import DecisionTimes
from .entries import GRIDS
from .race_control import RULES, Contact, Overtake, Restart, Warned

GREATEST = 1e9
"""Of the numbers in a summary."""

Accepts = Callable[[Any], bool]


def is_figure(value: Any) -> bool:
    """Say whether a value of a summary is a number within GREATEST."""
    return isinstance(value, (int, float)) and not isinstance(value, bool) and -GREATEST <= value <= GREATEST


def _is_count(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0


def _is_mapping(value: Any, names: set[str], texts: tuple[str, ...] = ()) -> bool:
    """Say whether a value has these names, and numbers but for the `texts`."""
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
    """Return what says whether a value is a list of the fields of a dataclass: numbers, texts and pairs of texts."""
    of_type: dict[str, Accepts] = {"float": is_figure, "int": is_figure, "str": lambda value: isinstance(value, str)}
    checks = {field.name: of_type.get(str(field.type), _are_texts) for field in fields(kind)}

    def accepts(value: Any) -> bool:
        return isinstance(value, list) and all(
            isinstance(row, dict)
            and set(row) == set(checks)
            and all(check(row[name]) for name, check in checks.items())
            for row in value
        )

    return accepts


def _are_texts(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 2 and all(isinstance(each, str) for each in value)


def _are_cars(value: Any) -> bool:
    """Say whether a value is rows of cars; of several, with what a replay of them needs."""
    if not isinstance(value, list) or len(value) > GREATEST_CARS or not all(isinstance(row, dict) for row in value):
        return False
    names = [row.get("name") for row in value]
    return len(value) < 2 or (
        all(isinstance(name, str) for name in names)
        and len(set(names)) == len(names)
        and all(_is_row(row) for row in value)
    )


def _is_row(row: dict[str, Any]) -> bool:
    """Say whether the row of one of several cars has what a replay and a report of them need."""
    return (
        all(isinstance(row.get(name), str) for name in ("end_reason", "controller", "vehicle"))
        and all(is_figure(row.get(name)) for name in ("end_time_s", "max_slide_m_s", "max_speed_m_s"))
        and all(_is_count(row.get(name)) for name in ("position", "laps_completed", "collisions_car"))
        and isinstance(row.get("finished"), bool)
        and _is_count(row.get("collisions_wall"))
        and isinstance(row.get("lap_times_s"), list)
        and all(map(is_figure, row["lap_times_s"]))
    )


def _is_times(value: Any) -> bool:
    return isinstance(value, dict) and _is_mapping({k: 0 if v is None else v for k, v in value.items()}, _TIMES)


def _is_settings(value: Any) -> bool:
    limit = value.get("time_limit") if isinstance(value, dict) else 0
    return limit is None or (is_figure(limit) and limit > 0.0)


def _is_effects(value: Any) -> bool:
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


def _are_texts_by_name(value: Any) -> bool:
    return isinstance(value, dict) and all(each is None or isinstance(each, str) for each in value.values())


def _is_origin(value: Any) -> bool:
    """Say whether this is where a planner comes from; older versions have no `files`."""
    texts = {name: each for name, each in value.items() if name != "files"} if isinstance(value, dict) else value
    return _are_texts_by_name(texts) and (value.get("files") is None or _are_texts_by_name(value["files"]))


_BY_NAME: tuple[str, Accepts] = ("values by name", lambda value: isinstance(value, dict))
_SUMMARY: dict[str, tuple[str, Accepts]] = {
    "track": _TEXT, "vehicle": _TEXT, "vehicle_sha256": _TEXT, "controller": _TEXT, "end_reason": _TEXT,
    "trajectory_sha256": _TEXT, "fg_mujoco_version": _TEXT, "mujoco_version": _TEXT,
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
    "lidar_effects": ("the fields of LidarEffects", lambda value: isinstance(value, dict) and _is_effects(value)),
    "planner_settings": _BY_NAME,
    "settings": (
        "settings by name, time_limit above 0",
        _is_settings,
    ),
    "cars": (f"a row of values for each of up to {GREATEST_CARS} cars", _are_cars),
    "grid": (" or ".join(GRIDS), lambda value: value in GRIDS),
    "rules": (" or ".join(RULES), lambda value: value in RULES), "winner": _TEXT,
    **{
        name: (f"a list of {kind.__name__}, as a race wrote it", _are(kind))
        for name, kind in (("overtakes", Overtake), ("contacts", Contact), ("warnings", Warned), ("restarts", Restart))
    },
    "wrong_way": (f"wrong_way, of {', '.join(sorted(_WRONG_WAY))}", lambda value: _is_mapping(value, _WRONG_WAY)),
    "crash": (f"crash, of {', '.join(sorted(_CRASH))}", lambda value: _is_mapping(value, _CRASH, ("into", "geom"))),
    "planner_failure": ("planner_failure, as a race wrote it", _is_failure),
}  # fmt: skip
"""What a summary may have, by name: what is accepted, and what says whether a value is. Each may be null or missing."""


def check_summary(summary: Mapping[str, Any]) -> None:
    """Raise ValueError for a value that is of another kind than a race writes."""
    for name, (accepted, accepts) in _SUMMARY.items():
        value = summary.get(name)
        if value is not None and not accepts(value):
            raise ValueError(f"{name} is {short(value)}; accepted: {accepted}")


MOST_ELEMENTS = 100_000
_MOST_LEVELS = 100
_REFUSED = ("include", "replicate", "composite", "flexcomp", "attach", "model", "plugin", "extension")
_FOLDERS = ("assetdir", "meshdir", "texturedir")
_RANGES: dict[str, tuple[float, float]] = {
    "timestep": (1e-4, 0.1),  # [s]
    **dict.fromkeys(("iterations", "ls_iterations", "noslip_iterations", "ccd_iterations"), (0.0, 1000.0)),
    **dict.fromkeys(("sdf_iterations", "sdf_initpoints"), (0.0, 1000.0)),
    **dict.fromkeys(("width", "height", "nrow", "ncol", "resolution", "offwidth", "offheight"), (0.0, 4096.0)),
    **dict.fromkeys(("shadowsize", "numslices", "numstacks", "numquads"), (0.0, 8192.0)),
    **dict.fromkeys(("offsamples", "octree_maxdepth"), (0.0, 16.0)),
    **dict.fromkeys(("nuserdata", "njmax", "nconmax", "nkey", "dim", "num", "nsample"), (-1.0, 10_000.0)),
    **{
        f"nuser_{part}": (-1.0, 100.0)
        for part in ("body", "jnt", "geom", "site", "cam", "tendon", "actuator", "sensor")
    },
}
"""Within what attributes have to be that say how much MuJoCo makes or does."""

_MEMORY = re.compile(r"-1|\d{1,9}K?|\d{1,4}M|1G")
_NO_NUMBER = re.compile(r"(?i)(?<!\S)(?:[+-]?(?:nan|inf|infinity)|[+-]?[\d.]+e[+-]?\d{3,})(?!\S)")


def check_scene(xml: str) -> None:
    """Raise ValueError for the text of a scene that names other files, or of which MuJoCo would make far more."""
    counts = {"elements": 0, "levels": 0}

    def refuse_document_type(*_: Any) -> None:
        raise ValueError("it declares a document type; accepted: MJCF alone")

    def begin(tag: str, attributes: dict[str, str]) -> None:
        counts["elements"] += 1
        counts["levels"] += 1
        if counts["elements"] > MOST_ELEMENTS or counts["levels"] > _MOST_LEVELS:
            raise ValueError(f"more than {MOST_ELEMENTS} elements or {_MOST_LEVELS} levels")
        if (tag == "mujoco") != (counts["levels"] == 1):
            raise ValueError(f"<{short_text(tag)}> in level {counts['levels']}; accepted: one <mujoco> with all else")
        if tag in _REFUSED or (tag == "mesh" and "builtin" in attributes):
            raise ValueError(f"<{tag}> makes parts that it does not list; accepted: all parts by themselves")
        for name, value in attributes.items():
            _check_attribute(tag, name, value)
        if tag == "text" and attributes.get("name", "").endswith("look"):
            look = PurePath(attributes.get("data", ""))
            if not look.is_absolute() and look.name != str(look):
                raise ValueError(f"the look is {short(str(look))}; accepted: a bundled one, or an absolute path")

    def end(_: str) -> None:
        counts["levels"] -= 1

    parser = expat.ParserCreate("utf-8")
    parser.StartDoctypeDeclHandler = refuse_document_type
    parser.StartElementHandler, parser.EndElementHandler = begin, end
    try:
        parser.Parse(xml.encode(), True)
    except expat.ExpatError as error:
        raise ValueError(f"no XML: {error}") from error


def _check_attribute(tag: str, name: str, value: str) -> None:
    """Raise ValueError for an attribute that names a file, or asks for too much."""
    called = f"<{short_text(tag)} {short_text(name)}={short(value)}>"
    if name.startswith("file") or name in _FOLDERS:
        raise ValueError(f"{called} names a file; accepted: a scene that refers to no other file")
    if name == "memory" and not _MEMORY.fullmatch(value):
        raise ValueError(f"{called}; accepted: at most 1G")
    found = None if name in ("name", "data") and tag == "text" else _NO_NUMBER.search(value)
    if found is not None:
        raise ValueError(f"<{short_text(tag)} {short_text(name)}> has {found[0]}; accepted: numbers up to 1e99")
    if name in _RANGES:
        low, high = _RANGES[name]
        for number in value.split():
            if not low <= _number(number) <= high:
                raise ValueError(f"{called}; accepted: {low:g} to {high:g}")


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan
