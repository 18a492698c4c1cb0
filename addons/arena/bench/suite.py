"""A suite of a card: groups of runs, each with courses and with settings of a Setup, read from a TOML file."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, fields
from itertools import product
from pathlib import Path
from typing import Any

from fg_mujoco.controllers.control.assist import names_in
from fg_mujoco.course.documents import read_toml
from fg_mujoco.errors import SettingsError, accepted_names
from fg_mujoco.racing.setup import Setup

REACTIVE = Path(__file__).parent / "reactive.toml"
"""The bundled suite."""

AXES = ("track", "obstacle_seed")
"""Settings of which a group may have several values: each with each of the others is a run."""

_NOT_OF_A_GROUP = ("controller", "planner_settings", "assist", "entries", "opponents")


@dataclass(frozen=True, kw_only=True)
class Group:
    """Runs in one condition.

    Raises:
      SettingsError: no name, no track, or a setting that a Setup does not have or cannot have.
    """

    name: str
    settings: Mapping[str, Any]  # of a Setup; `track` and `obstacle_seed` may be lists

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name:
            raise SettingsError(f"a group has the name {self.name!r}; accepted: a text")
        if "track" not in self.settings:
            raise SettingsError(f"group {self.name!r} has no track; accepted: a track, or a list of them")
        try:
            for settings in self.runs():
                Setup.of(controller="gap_finder", **settings)
        except SettingsError as error:
            raise SettingsError(f"group {self.name!r}: {error}") from error

    def runs(self) -> list[dict[str, Any]]:
        """Return the settings of each of its runs."""
        wrong = [name for name in _NOT_OF_A_GROUP if name in self.settings]
        if wrong:
            raise SettingsError(f"{wrong[0]} is of the planner; accepted: what all planners of a suite are driven in")
        axes = {name: self.settings[name] for name in AXES if isinstance(self.settings.get(name), list)}
        fixed = {name: value for name, value in self.settings.items() if name not in axes}
        return [fixed | dict(zip(axes, values, strict=True)) for values in product(*axes.values())]


@dataclass(frozen=True, kw_only=True)
class Suite:
    """Groups of runs, each driven with each of the assists.

    Raises:
      SettingsError: no group, a group twice, or an assist that is not known.
    """

    name: str
    version: int
    assists: tuple[str, ...]
    groups: tuple[Group, ...]
    sha256: str  # of its file

    def __post_init__(self) -> None:
        for assist in self.assists:
            names_in(assist, f"suite {self.name}: assists")
        names = [group.name for group in self.groups]
        twice = [name for name in names if names.count(name) > 1]
        if twice or not names:
            said = f"has the group {twice[0]!r} twice" if twice else "has no groups"
            raise SettingsError(f"suite {self.name} {said}; accepted: one or more groups, each with a name of its own")

    def runs(self) -> list[tuple[str, dict[str, Any]]]:
        """Return the name of the group and the settings of each run, in their order."""
        return [(group.name, settings) for group in self.groups for settings in group.runs()]


def read_suite(path: str | Path = REACTIVE) -> Suite:
    """Return the suite of a file.

    Raises:
      SettingsError: the file cannot be read, or an unknown or missing key; the message has its line.
    """
    file = read_toml(path)
    values = dict(file.values)
    own = [field.name for field in fields(Suite) if field.name != "sha256"]
    shared = {name: values.pop(name) for name in list(values) if name not in own}
    missing = [name for name in own if name not in values]
    try:
        if missing:
            raise SettingsError(f"there is no {missing[0]}; {accepted_names(missing[0], own)}")
        groups = [dict(group) for group in values.pop("groups")]
        made = tuple(Group(name=group.pop("name", ""), settings=shared | group) for group in groups)
        sha256 = hashlib.sha256(file.text.encode()).hexdigest()
        return Suite(**values | {"assists": tuple(values["assists"])}, groups=made, sha256=sha256)
    except (SettingsError, TypeError, ValueError) as error:
        raise SettingsError(file.located(str(error))) from error
