"""A suite: what planners are driven through, read from a TOML file.

    name = "wet floor"              # and `version`, `passing` of a lab
    assists = ["none"]              # each planner is driven with each; none, where nothing is said
    laps = 2                        # what stands here is of all groups

    [[groups]]
    name = "circuits"
    track = ["oval", "hairpins"]    # of a list each value is a run, with each of the other lists'
    mu = [0.5, 0.8]

    [[groups]]
    name = "duels"                  # behind a slower car: see `duels`
    track = "oval"
    opponent = ["raceline", "blocking"]
    seeds = [0, 1, 2]

    [[checks]]                      # a suite with checks is a lab: each is of a drive, and gives points
    check = "lap_time"
    most_s = 9.5
    points = 40

All settings of a Setup can stand at the top, in a group or in a check, but those of the planner. `seeds` draw all that
is drawn: a scene, obstacles, what moves, and noise. A suite has groups of one kind: runs alone, duels or checks.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields, replace
from itertools import product
from pathlib import Path
from typing import Any

from fg_mujoco.arguments import with_underscores
from fg_mujoco.controllers.control.stages import names_in
from fg_mujoco.course.documents import read_toml
from fg_mujoco.course.scenes import PREFIX
from fg_mujoco.errors import FgMujocoError, SettingsError, accepted_names
from fg_mujoco.messages import require_whole, shown
from fg_mujoco.racing.entries import Entry
from fg_mujoco.racing.opponents import opponent_seed
from fg_mujoco.racing.setup import CAR_KEYWORDS, SETUP_KEYWORDS, Setup

from ..runs.checks import CHECKS, SuiteCheck
from ..runs.duels import Duels

NOT_OF_A_SUITE = ("controller", "planner_settings", "assist", "name")
"""Settings of the planner, which a suite does not have."""

KEYWORDS = tuple(name for name in SETUP_KEYWORDS if name not in (*NOT_OF_A_SUITE, "entries"))
DECISION_LIMIT = 1.0
"""[s] that a planner of a lab may take for a decision unless the suite says otherwise."""

ASSIST = "none"
"""Assist of a study that says no other, so that planners are compared, and not the stages around them."""

_LISTS = ("opponents", "patches", "sensors")  # settings that are lists by themselves
_OF_SUITE = ("name", "version", "assists", "passing", "groups", "checks")
_OF_GROUP = ("name", "seeds", *(each.name for each in fields(Duels) if each.init))
_OF_CHECK = ("check", "name", "points")
_NOT_OF_DUELS = ("start", "start_s", "start_offset", "start_heading", "start_speed", "grid", "rules")


@dataclass(frozen=True, kw_only=True)
class Group:
    """Runs of which every value of every list is combined with every other.

    Raises:
      SettingsError: a list without values or with a value twice, or a seed that is not accepted.
    """

    name: str
    base: Setup  # of a planner and, where there are any, its opponents
    axes: Mapping[str, Sequence[Any]] = field(default_factory=dict)  # by keyword
    seeds: Sequence[int] = ()  # each draws all that is drawn; none: `base` says what is
    duels: Duels | None = None
    checks: tuple[SuiteCheck, ...] = ()

    def __post_init__(self) -> None:
        for name, values in (*self.axes.items(), *([("seed", self.seeds)] if self.seeds else [])):
            require_axis(name, values)
        for seed in self.seeds:
            require_whole("seed", seed, 0)
        if self.duels is not None and self.duels.speed:
            given = {name: value for name, value in (("seeds", self.seeds), ("laps", self.base.laps)) if value}
            _require_unset(given, tuple(given), "duels from given places")

    def setups(self) -> Iterator[tuple[dict[str, Any], Setup]]:
        """Yield each combination with its values by keyword, `course` in place of `track`, and the seed."""
        alone = replace(self.base, entries=self.base.entries[:1], grid="staggered", rules="none")
        for values in product(*self.axes.values()):
            chosen = dict(zip(self.axes, values, strict=True))
            of_car = {name: value for name, value in chosen.items() if name in CAR_KEYWORDS}
            of_race = {name: value for name, value in chosen.items() if name not in of_car}
            first = alone.replace(**of_car).first
            setup = replace(self.base.replace(**of_race), entries=(first, *self.base.entries[1:]))
            if is_scene(setup) and isinstance(setup.obstacles, int):  # it has its own
                setup = replace(setup, obstacles=())
            place = {"course": setup.track} | {name: value for name, value in chosen.items() if name != "track"}
            if not self.seeds:
                yield place, setup
                continue
            for seed in self.seeds if is_drawn(setup) else (None,):
                yield place | {"seed": seed}, seeded(setup, seed or 0)


@dataclass(frozen=True, kw_only=True)
class Suite:
    """What planners are driven through.

    Raises:
      SettingsError: no group, a group or check twice, groups of several kinds, or an assist that is not known.
    """

    name: str
    groups: tuple[Group, ...]
    version: int = 1
    assists: tuple[str, ...] = (ASSIST,)  # each planner is driven with each, but for those that have their own
    passing: float = 0.0  # points that are needed
    sha256: str = ""  # of its file

    def __post_init__(self) -> None:
        require_axis("assist", self.assists)
        for assist in self.assists:
            names_in(assist, f"suite {self.name}: assists")
        for what, names in (
            ("group", [each.name for each in self.groups]),
            ("check", [check.name for each in self.groups for check in each.checks]),
        ):
            twice = next((name for name in names if names.count(name) > 1), None)
            if twice is not None:
                raise SettingsError(f"suite {self.name} has the {what} {twice!r} twice; accepted: a `name` for each")
        kinds = {_kind_of(group) for group in self.groups}
        if len(kinds) != 1:
            said = f"has groups of several kinds: {', '.join(sorted(kinds))}" if kinds else "has no groups"
            raise SettingsError(f"suite {self.name} {said}; accepted: one or more groups, of one kind")

    @property
    def kind(self) -> str:
        """Of its runs: "alone", "duels", "checks"."""
        return _kind_of(self.groups[0])


def _kind_of(group: Group) -> str:
    return "duels" if group.duels else "checks" if group.checks else "alone"


def read_suite(path: str | Path) -> Suite:
    """Return the suite of a TOML file.

    Raises:
      SettingsError: it cannot be read, has an unknown key or check, or a value outside of what is accepted.
      FgMujocoError: a course or an opponent that cannot be loaded.
    """
    file = read_toml(path)
    try:
        return _suite(file.values, Path(path).stem, hashlib.sha256(file.text.encode()).hexdigest())
    except FgMujocoError as error:
        raise type(error)(file.located(str(error))) from error
    except (TypeError, ValueError) as error:
        raise SettingsError(file.located(str(error))) from error


def _suite(given: Mapping[str, Any], stem: str, sha256: str) -> Suite:
    values = with_underscores(given)
    shared = {name: value for name, value in values.items() if name not in _OF_SUITE}
    _require_known(shared, KEYWORDS, _OF_SUITE, "a suite")
    groups, checks = (_tables(values, name) for name in ("groups", "checks"))
    made = [_group(each, shared, f"groups[{place}]") for place, each in enumerate(groups)]
    found = [_check(each, shared, place) for place, each in enumerate(checks)]
    for drive in dict.fromkeys(setup for setup, _ in found):
        own = tuple(check for setup, check in found if setup == drive)
        made.append(Group(name=f"drive {len(made)}", base=drive, checks=own))
    total = sum(check.points for _, check in found)
    assists, number = values.get("assists", [ASSIST]), values.get("version", 1)
    require_whole("version", number, 1)
    for key, value, kind, accepted in (
        ("assists", assists, list, "a list of names"), ("name", values.get("name", stem), str, "a text"),
    ):  # fmt: skip
        if not isinstance(value, kind):
            raise SettingsError(f"{key} is {shown(value)}; accepted: {accepted}")
    if "passing" in values and not found:
        raise SettingsError(f"passing is {shown(values['passing'])} without checks; accepted: with [[checks]]")
    return Suite(
        name=values.get("name", stem), groups=tuple(made), assists=tuple(assists), sha256=sha256, version=number,
        passing=_number(values.get("passing", total), "passing", most=total) if found else 0.0,
    )  # fmt: skip


def _group(given: Mapping[str, Any], shared: Mapping[str, Any], where: str) -> Group:
    values = with_underscores(given)
    name = values.get("name", where)
    settings = dict(shared) | {key: value for key, value in values.items() if key not in _OF_GROUP}
    try:
        if not isinstance(name, str) or not name:
            raise SettingsError(f"its name is {shown(name)}; accepted: a text")
        _require_known(settings, KEYWORDS, _OF_GROUP, "a group")
        if "track" not in settings:
            raise SettingsError("it has no track; accepted: a track, or a list of them")
        of_duels = {key: values[key] for key in values if key in _OF_GROUP[2:]}
        if of_duels:
            _require_unset(settings, ("opponents", *_NOT_OF_DUELS), "duels")
        axes = {key: value for key, value in settings.items() if key not in _LISTS and _is_axis(value)}
        fixed = {key: value for key, value in settings.items() if key not in axes}
        if not isinstance(fixed.get("track", ""), str) or not all(isinstance(t, str) for t in axes.get("track", ())):
            raise SettingsError(f"track is {shown(settings['track'])}; accepted: one or more names or paths")
        seeds = values.get("seeds", [])
        group = Group(
            name=name, base=Setup.read(fixed), axes=axes, seeds=tuple(seeds) if isinstance(seeds, list) else (seeds,),
            duels=Duels(**of_duels) if of_duels else None,
        )  # fmt: skip
        for _ in group.setups():  # refuses what no setup can be
            pass
    except FgMujocoError as error:
        raise SettingsError(f"group {name!r}: {error}") from error
    return group


def _check(given: Mapping[str, Any], shared: Mapping[str, Any], place: int) -> tuple[Setup, SuiteCheck]:
    own, where = with_underscores(given), f"checks[{place}]"
    kind = own.get("check")
    if not isinstance(kind, str) or kind not in CHECKS:
        raise SettingsError(f"{where}: check is {shown(kind)}; {accepted_names(kind, CHECKS)}")
    known = [each.name for each in fields(CHECKS[kind])]
    for name in own:
        if name not in (*_OF_CHECK, *known, *KEYWORDS):
            raise SettingsError(f"{where}: {kind} has no {name!r}; {accepted_names(name, (*known, *_OF_CHECK))}")
    lacking = [each.name for each in fields(CHECKS[kind]) if each.default is MISSING and each.name not in own]
    if lacking:
        raise SettingsError(f"{where}: {kind} lacks {', '.join(lacking)}; accepted: a value for each")
    try:
        check = CHECKS[kind](**{name: own[name] for name in known if name in own})
        of_drive = {name: value for name, value in own.items() if name in KEYWORDS}
        setup = Setup.read({"decision_limit": DECISION_LIMIT} | dict(shared) | of_drive)
    except FgMujocoError as error:
        raise SettingsError(f"{where}: {error}") from error
    name = own.get("name", kind)
    if not isinstance(name, str) or not name:
        raise SettingsError(f"{where}: name is {shown(name)}; accepted: a text")
    points = _number(own.get("points", 1), f"{where}: points")
    return setup, SuiteCheck(number=place, name=name, points=points, check=check)


def _tables(values: Mapping[str, Any], name: str) -> list[Mapping[str, Any]]:
    found = values.get(name, [])
    if not isinstance(found, list) or not all(isinstance(each, Mapping) for each in found):
        raise SettingsError(f"{name} is {shown(found)}; accepted: one or more [[{name}]]")
    return found


def _require_known(values: Mapping[str, Any], keywords: Sequence[str], others: Sequence[str], what: str) -> None:
    for name in values:
        if name in NOT_OF_A_SUITE:
            raise SettingsError(f"{name} is of the planner; accepted: settings for all planners")
        if name not in keywords:
            raise SettingsError(f"{name} is no setting of {what}; {accepted_names(name, (*others, *keywords))}")


def _require_unset(values: Mapping[str, Any], names: Sequence[str], what: str) -> None:
    wrong = next((name for name in names if name in values), None)
    if wrong is not None:
        raise SettingsError(f"{wrong} is {shown(values[wrong])} in a group of {what}; accepted: without it")


def _is_axis(value: Any) -> bool:
    return isinstance(value, list) and not any(isinstance(each, Mapping) for each in value)


def _number(value: Any, what: str, most: float = math.inf) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0.0 < value <= most or value == math.inf:
        accepted = "a positive number" + ("" if most == math.inf else f" up to {most:g}, all points")
        raise SettingsError(f"{what} is {shown(value)}; accepted: {accepted}")
    return float(value)


def require_axis(name: str, values: Sequence[Any]) -> None:
    """Refuse an axis that is empty or has a value twice.

    Raises:
      SettingsError: it does.
    """
    twice = next((value for i, value in enumerate(values) if value in values[:i]), None)
    if not len(values) or twice is not None:
        said = f"no {name} is given" if not len(values) else f"{name} {twice} is given twice"
        raise SettingsError(f"{said}; accepted: one or more, each once")


def is_drawn(setup: Setup) -> bool:
    """Return whether anything of a setup is drawn from a seed."""
    placed, moving = setup.obstacles, setup.moving
    on_course = (isinstance(placed, int) and placed > 0) or (isinstance(moving, str) and moving != "")
    return on_course or is_scene(setup) or any(map(draws, setup.entries))


def is_scene(setup: Setup) -> bool:
    """Return whether a setup is raced through a scene."""
    return isinstance(setup.track, str) and setup.track.startswith(PREFIX)


def draws(entry: Entry) -> bool:
    """Return whether a car's sensors draw anything from a seed."""
    effects = entry.effects
    noisy = effects.range_noise_std > 0.0 or effects.dropout_probability > 0.0
    return noisy or bool(entry.sensed) or effects.measured is not None


def seeded(setup: Setup, seed: int) -> Setup:
    """Return a setup in which all that is drawn is drawn from a seed."""
    track = f"{setup.track}:{seed}" if is_scene(setup) and str(setup.track).count(":") == 1 else setup.track
    first, *others = setup.entries
    cars = [replace(entry, seed=opponent_seed(seed, place, entry.seed)) for place, entry in enumerate(others, start=1)]
    return replace(setup, track=track, obstacle_seed=seed, entries=(replace(first, seed=seed), *cars))
