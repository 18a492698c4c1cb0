"""A lab: checks with points, each of a drive, read from a TOML file.

    title = "Wall following"
    track = "oval"
    laps = 2

    [[checks]]
    check = "finishes"
    points = 40

    [[checks]]
    check = "follows_wall"
    side = "left"
    distance_m = 1.0
    within_m = 0.2
    points = 60

The keys at the top are those of a Setup, without its planner. A check may have others of them: `track`, `laps`,
`obstacles` and so on. Checks with the same settings are of the same drive.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields
from pathlib import Path
from typing import Any

from fg_mujoco.course.documents import read_toml
from fg_mujoco.errors import ArgumentError, FgMujocoError, SettingsError, accepted_names
from fg_mujoco.messages import shown
from fg_mujoco.racing.planners import ControllerChoice
from fg_mujoco.racing.resolved import Resolved
from fg_mujoco.racing.setup import SETUP_KEYWORDS, Setup
from fg_mujoco.racing.trust import check_planner

from .checks import CHECKS, Check

DECISION_LIMIT = 1.0
"""[s] that a planner may take for a decision unless the lab says otherwise."""

_OF_LAB = ("title", "passing", "checks")
_OF_CHECK = ("check", "name", "points")
_NOT_HERE = ("controller", "planner_settings", "entries", "name")
_KEYWORDS = tuple(name for name in SETUP_KEYWORDS if name not in _NOT_HERE)


@dataclass(frozen=True, kw_only=True)
class LabCheck:
    """A check of a lab, with its points and its drive."""

    name: str
    points: float
    check: Check
    setup: Setup


@dataclass(frozen=True, kw_only=True)
class Lab:
    """A lab, as `read_lab` reads it."""

    title: str
    checks: tuple[LabCheck, ...]
    passing: float  # points that are needed to pass

    @property
    def points(self) -> float:
        """All points."""
        return sum(each.points for each in self.checks)


def read_lab(path: str | Path) -> Lab:
    """Return the lab of a TOML file.

    Raises:
      SettingsError: a file that cannot be read, an unknown key or check, or a value outside of what is accepted.
      FgMujocoError: a course or an opponent that cannot be loaded.
    """
    file = read_toml(path)
    values = {name.replace("-", "_"): value for name, value in file.values.items()}
    try:
        return _lab(values, Path(path).stem)
    except FgMujocoError as error:
        raise type(error)(file.located(str(error))) from error


def _lab(values: Mapping[str, Any], stem: str) -> Lab:
    common = {name: value for name, value in values.items() if name not in _OF_LAB}
    for name in common:
        if name not in _KEYWORDS:
            raise SettingsError(f"{name} is no setting of a lab; {accepted_names(name, (*_OF_LAB, *_KEYWORDS))}")
    title, listed = values.get("title", stem), values.get("checks")
    if not isinstance(title, str):
        raise SettingsError(f"title is {shown(title)}; accepted: a text")
    if not isinstance(listed, list) or not listed or not all(isinstance(each, Mapping) for each in listed):
        raise SettingsError(f"checks is {shown(listed)}; accepted: one or more [[checks]]")
    checks = tuple(_check(each, common, f"checks[{place}]") for place, each in enumerate(listed))
    names = [each.name for each in checks]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise SettingsError(f"checks has {twice!r} twice; accepted: a `name` for each")
    for place, each in enumerate(checks):
        _require_drive(each, f"checks[{place}]")
    total = sum(each.points for each in checks)
    passing = _number(values.get("passing", total), "passing", most=total)
    return Lab(title=title, checks=checks, passing=passing)


def _check(values: Mapping[str, Any], common: Mapping[str, Any], where: str) -> LabCheck:
    own = {name.replace("-", "_"): value for name, value in values.items()}
    kind = own.get("check")
    if not isinstance(kind, str) or kind not in CHECKS:
        raise SettingsError(f"{where}: check is {shown(kind)}; {accepted_names(kind, CHECKS)}")
    known = [field.name for field in fields(CHECKS[kind])]
    for name in own:
        if name not in (*_OF_CHECK, *known, *_KEYWORDS):
            raise SettingsError(f"{where}: {kind} has no {name!r}; {accepted_names(name, (*known, *_OF_CHECK))}")
    lacking = [f.name for f in fields(CHECKS[kind]) if f.default is MISSING and f.name not in own]
    if lacking:
        raise SettingsError(f"{where}: {kind} lacks {', '.join(lacking)}; accepted: a value for each")
    try:
        check = CHECKS[kind](**{name: own[name] for name in known if name in own})
        settings = {"decision_limit": DECISION_LIMIT} | {**common, **{k: v for k, v in own.items() if k in _KEYWORDS}}
        setup = Setup.read(settings)
    except (ArgumentError, SettingsError) as error:
        raise SettingsError(f"{where}: {error}") from error
    name = own.get("name", kind)
    if not isinstance(name, str) or not name:
        raise SettingsError(f"{where}: name is {shown(name)}; accepted: a text")
    return LabCheck(name=name, points=_number(own.get("points", 1), f"{where}: points"), check=check, setup=setup)


def _number(value: Any, what: str, most: float = math.inf) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0.0 < value <= most or value == math.inf:
        accepted = "a positive number" + ("" if most == math.inf else f" up to {most:g}, all points")
        raise SettingsError(f"{what} is {shown(value)}; accepted: {accepted}")
    return float(value)


def _require_drive(asked: LabCheck, where: str) -> None:
    """Refuse a drive that nobody can drive, or that lacks what its check needs."""
    try:
        raced = Resolved.of(asked.setup)
        for entry in raced.entries[1:]:
            check_planner(ControllerChoice.of(str(entry.controller)), raced.ground.course, entry)
        raced.check_starts()
    except FgMujocoError as error:
        raise type(error)(f"{where}: {error}") from error
    lacking = asked.check.lacks(raced.ground, len(raced.entries))
    if lacking:
        raise SettingsError(f"{where}: {asked.name} lacks {lacking}; accepted: a drive that has it")
