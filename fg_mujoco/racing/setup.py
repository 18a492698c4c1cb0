"""A race's setup: the course, the cars with their planners, the rules and the limits.

    setup = Setup.of("oval", controller="gap_finder[lookahead=8]", mu=0.7, laps=2)
    result = race(setup)
    again = race(setup.replace(mu=0.5))
    setup.write("race.toml")

All functions take a Setup, or its keywords, and build one: a race, a rollout, a comparison, an environment. The
keywords are the fields of Setup, and those of Entry for its first car. A file has the same names as keys.
"""

from __future__ import annotations

import hashlib
import json
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

from ..arguments import explain_class, setting, unknown_argument, with_underscores
from ..course.course import Course, require_course
from ..course.moving_obstacles import MovingObstacle, described_moving, moving_or_text
from ..course.obstacles import Obstacle, described_obstacles, obstacles_or_count
from ..display import brief, changed
from ..errors import ArgumentError, SettingsError, accepted_names
from ..lidar.effects import LidarEffects
from ..lidar.lidar import LIDARS, MID360
from ..messages import require, require_whole, shown
from ..simulation.settings import (
    PLANNER_OPTIONS,
    CarKeywords,
    CarSettings,
    DriveSettings,
    Start,
    as_parts,
    require_laps,
    require_time_limit,
)
from ..vehicle.changes import CarChanges
from ..vehicle.friction_patches import Patch
from .entries import Entry, require_entries, require_grid
from .rules import find_rules

FIELD_OF = {
    "lidar_noise": ("effects", "range_noise_std"), "lidar_dropout": ("effects", "dropout_probability"),
    "lidar_effects": ("effects", "measured"), "lidar_latency": ("effects", "latency"),
    "motion_distortion": ("effects", "motion_distortion"), "floor_angle": ("effects", "floor_angle"),
    "through_cars": ("effects", "through_cars"),
    "start_s": ("start", "s"), "start_offset": ("start", "offset"), "start_heading": ("start", "heading"),
    "start_speed": ("start", "speed"), "mass": ("changes", "mass"),
    "cog_height": ("changes", "center_of_gravity_height"), "steering_gain": ("changes", "steering_gain"),
    "speed_gain": ("changes", "speed_gain"), "command_delay": ("changes", "command_delay"),
}  # fmt: skip
"""Keyword -> the setting of a car whose field it is, and the field. A rollout draws them by these names, too."""

_KINDS = {"effects": LidarEffects, "start": Start, "changes": CarChanges}


class StudyKeywords(CarKeywords, total=False):
    """The keywords of a Setup that are no axes of a study: its fields, and those of car 0."""

    entries: Sequence[Entry]
    opponents: Sequence[Entry | str]
    laps: int | None
    time_limit: float | None
    obstacles: Sequence[Obstacle] | int
    obstacle_seed: int
    moving: str | Sequence[MovingObstacle]
    patches: Sequence[Patch]
    lidar: str
    grid: str
    rules: str
    decision_limit: float | None
    name: str | None


class SetupKeywords(StudyKeywords, total=False):
    """The keywords of a Setup, as all functions take them, besides `track` and `controller`, which are arguments."""

    max_speed: float
    seed: int


@explain_class
@dataclass(frozen=True, kw_only=True, repr=False, eq=False)
class Setup:
    """The setup of a race. Two setups are equal if their `sha256` are.

    Raises:
      SettingsError: a value outside of what is accepted.
      ModelError: a file that is not that of a vehicle.
    """

    track: Course | str = setting(
        "oval", "NAME, random:SEED[:tight], scene:NAME:SEED, file.csv or map.yaml; default: oval; names: track list, "
        "track scenes", "TRACK", "course and planner",
    )  # fmt: skip
    entries: Sequence[Entry] = field(default_factory=lambda: (Entry(),))  # the cars, in the order of the grid
    laps: int | None = setting(  # of a world of a rollout 1
        None, "default: 5; a scene is driven once", "N", "course and planner"
    )
    time_limit: float | None = setting(
        None, "of simulated time [s]; default: what a car of 0.5 m/s needs, or the scene's", "S", "course and planner"
    )
    obstacles: Sequence[Obstacle] | int = setting(  # or the solids themselves, besides a scene's own
        (), "boxes on the track, with a way past each; default: 0", "N", "course and planner"
    )
    obstacle_seed: int = setting(
        0, "seed of the places of --obstacles and --moving; default: 0", "K", "course and planner"
    )
    moving: str | Sequence[MovingObstacle] = setting(
        "", "things that move on the track, at places drawn from --obstacle-seed: {names}; default: nothing",
        "KIND[:N],...", "course and planner",
    )  # fmt: skip
    patches: Sequence[Patch] = setting(
        (), "a patch of the floor with another friction, x=1,y=2,length=3,width=1,mu=.4; again for each", "x=X,...",
        "floor",
    )  # fmt: skip
    lidar: str = setting(  # mid360: raycast, and the first entry has the sensor of that name
        "raycast", "back end: {names}, which is raycast with a Livox MID-360 besides; default: raycast", "NAME",
        "sensors",
    )
    grid: str = setting(  # where entries without a start stand, see `entries.grid_starts`
        "staggered", "order at the start: {names}; default: staggered", "NAME", "other cars"
    )
    rules: str = setting("none", "of race control: {names}; default: none", "NAME", "other cars")
    decision_limit: float | None = setting(
        None, "limit of wall time for each decision [s]; a slower planner ends its race", "S",
        "course and planner",
    )  # fmt: skip

    def __post_init__(self) -> None:
        if isinstance(self.track, Path):
            self._set("track", str(self.track))
        elif not isinstance(self.track, str):
            require_course(self.track, "the track")
        named = tuple(self.entries) if isinstance(self.entries, Iterable) else self.entries
        require_entries(named)
        self._set("entries", named)
        require_laps(self.laps)
        require_time_limit(self)
        require_decision_limit(self)
        self._set("patches", as_parts(self.patches, Patch, "patches"))
        self._set("obstacles", obstacles_or_count(self.obstacles))
        require_whole("obstacle_seed", self.obstacle_seed, 0)
        self._set("moving", moving_or_text(self.moving))
        if not isinstance(self.lidar, str) or self.lidar not in LIDARS:
            raise SettingsError(f"lidar is {shown(self.lidar)}; {accepted_names(self.lidar, LIDARS)}")
        if self.lidar == MID360:
            self._set("lidar", "raycast")
            first, *others = self.entries
            if not any(sensor.kind == MID360 for sensor in first.sensed):
                first = replace(first, sensors=(*first.sensors, MID360))
            self._set("entries", (first, *others))
        require_grid(self.grid)
        of_several = [("grid", "staggered"), *([] if find_rules(self.rules).checkpoints else [("rules", "none")])]
        for name, usual in of_several:
            if len(named) == 1 and getattr(self, name) != usual:
                raise SettingsError(
                    f"{name} is {getattr(self, name)!r} without opponents; accepted: with one or more, or {usual!r}"
                )

    def _set(self, name: str, value: Any) -> None:
        object.__setattr__(self, name, value)

    @classmethod
    def of(cls, track: Setup | Course | str | None = None, /, *, caller: str = "Setup", **keywords: Any) -> Setup:
        """Return the setup of a track and keywords; of a Setup and keywords that one with these in it.

        Args:
          track: or the setup that the keywords change.
          caller: name of the function that got the keywords, for messages.
          keywords: of SetupKeywords.

        Raises:
          ArgumentError: a keyword that there is not.
          SettingsError: a value outside of what is accepted; settings of a car beside `entries` of several.
        """
        base = track if isinstance(track, Setup) else cls()
        if track is not None and not isinstance(track, Setup):
            keywords = {"track": track, **keywords}
        _require_known(caller, keywords)
        return base.replace(**keywords)

    def replace(self, **keywords: Any) -> Setup:
        """Return this setup with other values; arguments and errors are those of `of`."""
        _require_known("replace", keywords)
        of_race = {name: keywords.pop(name) for name in _OF_RACE if name in keywords}
        opponents = keywords.pop("opponents", None)
        if keywords:
            if "entries" in of_race or len(self.entries) > 1:
                name, value = next(iter(keywords.items()))
                raise SettingsError(f"{name} is {shown(value)} together with entries; accepted: {name} of each Entry")
            of_race["entries"] = (_changed_entry(self.first, keywords),)
        if opponents is not None:
            first, *others = of_race.get("entries", self.entries)
            if ("entries" in of_race and others) or not _is_sequence(opponents):
                said = f"opponents is {shown(opponents)}"
                raise SettingsError(f"{said}; accepted: a list, without other entries")
            of_race["entries"] = (first, *(as_opponent(each, first, index) for index, each in enumerate(opponents, 1)))
        for name in ("obstacles", "patches"):
            if name in of_race and of_race[name] is None:
                of_race[name] = ()
        return replace(self, **of_race)

    def with_cars(self, **keywords: Any) -> Setup:
        """Return this setup with other settings of all its cars; the planner is that of the first car.

        Raises:
          SettingsError: a value outside of what is accepted.
        """
        others = {name: value for name, value in keywords.items() if name not in ("controller", "planner_settings")}
        cars = (_changed_entry(self.first, keywords), *(_changed_entry(each, others) for each in self.entries[1:]))
        return replace(self, entries=cars)

    @property
    def first(self) -> Entry:
        """The entry of car 0."""
        return self.entries[0]

    @property
    def named(self) -> tuple[Entry, ...]:
        """The entries, each with a name."""
        return require_entries(self.entries)

    @property
    def drive_settings(self) -> DriveSettings:
        """The settings of car 0 and of the floor, without its planner."""
        own = {f.name: getattr(self.first, f.name) for f in fields(DriveSettings)}
        return DriveSettings(**own | {"patches": self.patches, "start": self.first.start or Start()})

    def require_usable(self, caller: str, *usable: str, alone: bool = False) -> None:
        """Refuse settings that the caller does not use and that are not the default.

        Args:
          caller: its name, for messages.
          usable: names of the fields of a Setup and of an Entry that it uses; those of OF_A_CAR and so on.
          alone: whether it has one car only.

        Raises:
          SettingsError: one is set.
        """
        if alone and len(self.entries) > 1:
            raise SettingsError(f"{len(self.entries)} entries in {caller}; accepted: one car")
        for name in (*_OF_RACE, *_OF_CAR):
            if name in usable or name == "entries":
                continue
            of_race = name in _OF_RACE
            value, usual = (getattr(each if of_race else each.first, name) for each in (self, _usual()))
            if value != usual and (name != "start" or value != Start()):
                said = f"{name} is {shown(value)} in {caller}, which cannot use it"
                raise SettingsError(f"{said}; accepted: {shown(usual)}")

    def described(self) -> dict[str, Any]:
        """Return what differs from the defaults as it can stand in JSON and in TOML; `read` reads it back.

        Raises:
          SettingsError: a course or a planner that is an object.
        """
        found = self._content(_refuse_object)
        cars = found.pop("entries")
        return found | (cars[0] if len(cars) == 1 else {"entries": cars})

    @property
    def toml(self) -> str:
        """The text of a TOML file, which `read` reads back; errors as of `described`."""
        from ..course.documents import toml_text

        return toml_text(self.described())

    def write(self, path: str | Path) -> Path:
        """Write a TOML file and return its path; errors as of `described`, and RunFolderError."""
        from ..course.writing import write_file

        write_file(Path(path), self.toml.encode())
        return Path(path)

    @classmethod
    def read(cls, source: str | Path | Mapping[str, Any]) -> Setup:
        """Return the setup of a TOML file, or of what `described` returned.

        Raises:
          SettingsError: a file that cannot be read, an unknown key, or a value outside of what is accepted.
        """
        if isinstance(source, Mapping):
            return _read(source)
        from ..course.documents import read_toml

        content = read_toml(source)
        try:
            return _read(content.values)
        except (ArgumentError, SettingsError) as error:
            raise SettingsError(content.located(str(error))) from error

    @cached_property
    def sha256(self) -> str:
        """SHA-256 of what differs from the defaults; a course that is an object counts by its numbers."""
        content = json.dumps(_as_hashed(self._content(_name_object)), sort_keys=True, default=str)
        return hashlib.sha256(content.encode()).hexdigest()

    def __eq__(self, other: object) -> bool:
        return self.sha256 == other.sha256 if isinstance(other, Setup) else NotImplemented

    def __hash__(self) -> int:
        return hash(self.sha256)

    def __repr__(self) -> str:
        own = {name: value for name, value in self._content(_name_object).items() if name not in ("track", "entries")}
        name = self.track if isinstance(self.track, str) else self.track.name
        cars = [brief_entry(entry) for entry in self.entries]
        return brief(self, repr(name), *cars, *(f"{key}={shown(value)}" for key, value in own.items()))

    def _content(self, of_object: Any) -> dict[str, Any]:
        """Return what differs from the defaults, the cars as a list; `of_object` says what stands for an object."""
        found: dict[str, Any] = {"track": self.track if isinstance(self.track, str) else of_object("track", self.track)}
        for name in _OF_RACE:
            value = getattr(self, name)
            if name in ("track", "entries") or value == getattr(_usual(), name):
                continue
            if name == "obstacles" and not isinstance(value, int):
                value = described_obstacles(value)
            elif name == "moving":
                value = described_moving(value)
            elif name == "patches":
                value = [asdict(patch) for patch in value]
            found[name] = value
        found["entries"] = [_described_entry(entry, of_object) for entry in self.entries]
        return found


OF_A_CAR = ("vehicle", "tires", "mu", "floor", "changes")
OF_A_CONTEXT = ("planner_mu", "max_speed", "sensors", "effects", "odometry_drift", *PLANNER_OPTIONS)
OF_A_DRIVER = ("controller", "planner_settings", *OF_A_CONTEXT)
OF_A_COURSE = ("track", "obstacles", "obstacle_seed", "moving", "patches")
"""Fields that `require_usable` is told of: of a car, what its planner is told and senses, who drives it, and where."""

_OF_RACE = tuple(f.name for f in fields(Setup))
_OF_CAR = tuple(f.name for f in fields(Entry) if f.name not in _OF_RACE)
CAR_KEYWORDS = (*_OF_CAR, *FIELD_OF)
"""Names of the keywords that are a car's."""

SETUP_KEYWORDS = (*_OF_RACE, *CAR_KEYWORDS, "opponents")
"""Names of all keywords, which are the keys of a file, too."""



@lru_cache(maxsize=1)
def _usual() -> Setup:
    return Setup()


def require_decision_limit(settings: Any) -> None:
    """Refuse a `decision_limit` among some settings that is neither None nor a positive number of seconds.

    Raises:
      SettingsError: it is not.
    """
    if settings.decision_limit is not None:
        require(settings, lambda value: 0.0 < value < math.inf, "a positive number", ("decision_limit",), SettingsError)


def _is_sequence(value: Any) -> bool:
    return isinstance(value, Iterable) and not isinstance(value, (str, Entry, Mapping))


def as_opponent(opponent: Entry | str | Mapping[str, Any], first: Entry, index: int) -> Entry:
    """Return the entry of an opponent: itself, or of the name of a planner in a car that is set as that of `first`.

    By `index`, from 1, such a car draws other noise than the first.

    Raises:
      SettingsError: it is neither.
    """
    if isinstance(opponent, str):
        return replace(first.like(opponent), seed=(first.seed + index) % 2**63)
    if isinstance(opponent, Mapping):
        return _entry(opponent, "opponents")
    if not isinstance(opponent, Entry):
        said = f"one of opponents is {shown(opponent)}"
        raise SettingsError(f"{said}; accepted: the name of a planner, or fg_mujoco.Entry")
    return opponent


def brief_entry(entry: Entry) -> str:
    """Return an entry in a few words: its planner, and what of it differs from the defaults."""
    name = entry.controller if isinstance(entry.controller, str) else type(entry.controller).__name__
    set_ = changed(replace(entry, controller=Entry.controller), Entry())
    return name + (f"({', '.join(set_)})" if set_ else "")


def _require_known(caller: str, keywords: Mapping[str, Any]) -> None:
    """Refuse a keyword that there is not, with the one that was probably meant."""
    for name in keywords:
        if name not in SETUP_KEYWORDS:
            raise ArgumentError(unknown_argument(caller, name, SETUP_KEYWORDS))


def _read(values: Mapping[str, Any]) -> Setup:
    """Return the setup of some values by name, as `described` returns them; keys may have hyphens."""
    own = with_underscores(values)
    if "entries" in own:
        cars = as_list(own["entries"], "entries")
        own["entries"] = tuple(_entry(each, f"entries[{index}]") for index, each in enumerate(cars))
    for name in ("opponents", "patches"):
        if name in own:
            own[name] = as_list(own[name], name)
    sha256 = own.pop("vehicle_sha256", None)
    setup = Setup.of(**{name: _value(value) for name, value in own.items()})
    _require_vehicle(setup.first, sha256)
    return setup


def _changed_entry(entry: Entry, keywords: Mapping[str, Any]) -> Entry:
    """Return an entry with other values; None of a part of it is that part as it is without settings."""
    if isinstance(keywords.get("lidar_effects"), LidarEffects) and "effects" not in keywords:  # all of them
        keywords = {"effects" if name == "lidar_effects" else name: value for name, value in keywords.items()}
    own = {name: value for name, value in keywords.items() if name not in FIELD_OF}
    for name in ("changes", "effects", "planner_settings"):
        if name in own and own[name] is None:
            own[name] = _KINDS.get(name, dict)()
    for part, kind in _KINDS.items():
        inside = {name: FIELD_OF[name][1] for name in keywords if name in FIELD_OF and FIELD_OF[name][0] == part}
        if inside and own.get(part) is not None:
            both = f"{next(iter(inside))} and {part}"
            raise SettingsError(f"{both} are given; accepted: one of them")
        if inside:
            before = getattr(entry, part) or kind()
            try:
                own[part] = replace(before, **{field: keywords[name] for name, field in inside.items()})
            except SettingsError as error:
                raise SettingsError(_by_keyword(str(error), inside)) from error
    return replace(entry, **own)


def _by_keyword(message: str, inside: Mapping[str, str]) -> str:
    """Return a message that begins with a field of a part, as "LidarEffects.latency", with the keyword that sets it."""
    for name, inner in inside.items():
        message = re.sub(rf"^[A-Z]\w*\.{inner}(?= )", name, message)
    return message


def as_list(value: Any, name: str) -> list[Any]:
    """Return a list as it is.

    Raises:
      SettingsError: it is none.
    """
    if not isinstance(value, list):
        raise SettingsError(f"{name} is {shown(value)}; accepted: a list")
    return value


def _entry(values: Any, name: str) -> Entry:
    """Return the entry of some values by name."""
    if isinstance(values, Entry):
        return values
    if not isinstance(values, Mapping):
        raise SettingsError(f"{name} is {shown(values)}; accepted: settings of a car by name")
    own = {key: _value(value) for key, value in with_underscores(values).items()}
    sha256 = own.pop("vehicle_sha256", None)
    for key in own:
        if key not in CAR_KEYWORDS:
            raise ArgumentError(unknown_argument(name, key, CAR_KEYWORDS))
    entry = _changed_entry(Entry(), own)
    _require_vehicle(entry, sha256)
    return entry


def _value(value: Any) -> Any:
    return math.inf if isinstance(value, str) and value == "off" else value


def _require_vehicle(entry: Entry, sha256: Any) -> None:
    """Refuse a vehicle's file that is another one than was described."""
    if sha256 is not None and entry.car.sha256 != sha256:
        raise SettingsError(f"vehicle {entry.car.source!r} is another one now; accepted: the file as it was")


def _described_entry(entry: Entry, of_object: Any) -> dict[str, Any]:
    if isinstance(entry.controller, str):
        found = CarSettings.described(entry)
    else:
        found = CarSettings.described(replace(entry, controller="gap_finder"))
        found["controller"] = of_object("controller", entry.controller)
    for part, kind in _KINDS.items():
        if part in found:
            plain, value = kind(), getattr(entry, part)
            found[part] = {each: got for each, got in asdict(value).items() if got != getattr(plain, each)}
    return {name: value for name, value in found.items() if value is not None}


def _as_hashed(value: Any) -> Any:
    """Return a value in which equal numbers are written alike: 4.0 as 4."""
    if isinstance(value, Mapping):
        return {name: _as_hashed(each) for name, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [_as_hashed(each) for each in value]
    return int(value) if isinstance(value, float) and value.is_integer() else value


def _refuse_object(name: str, value: Any) -> str:
    raise SettingsError(f"{name} is {shown(value)}, an object, in a file; accepted: a name, or the path of a file")


def _name_object(name: str, value: Any) -> str:
    if name == "track":
        from ..course.definitions import course_sha256

        return f"{value.name} {course_sha256(value)}"
    return f"{type(value).__name__} {id(value)}"
