"""Randomization of worlds: for each parameter a range, and from a world's seed a value for each.

    randomization = Randomization.of({"mu": (0.6, 1.2), "planner.lookahead": [8, 10], "obstacles": "0:4"})
    scenario = randomization.scenario(load_track("oval"), seed=7)

A world depends on its seed alone. Its one generator draws one share of a range for each of PARAMETERS, in their order,
whether they are randomised or not; a setting of the planner has a generator of its own, by its name. So one more
randomised parameter never changes what another is.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from ..arguments import explain_class
from ..course.course import Course, Sites
from ..display import brief
from ..errors import SettingsError, accepted_names
from ..lidar.effects import LidarEffects
from ..messages import shown
from ..simulation.cars import GREATEST_CARS
from ..simulation.settings import CarSettings, DriveSettings, Scenario, Start
from ..vehicle.changes import CarChanges
from ..vehicle.vehicle import Vehicle
from .planners import Value, read_value

PARAMETERS: dict[str, tuple[Any, str]] = {
    "mu": (CarChanges, "mu"),
    "mass": (CarChanges, "mass"),
    "cog_height": (CarChanges, "center_of_gravity_height"),
    "steering_gain": (CarChanges, "steering_gain"),
    "speed_gain": (CarChanges, "speed_gain"),
    "command_delay": (CarChanges, "command_delay"),
    "lidar_noise": (LidarEffects, "range_noise_std"),
    "lidar_dropout": (LidarEffects, "dropout_probability"),
    "start_s": (Start, "s"),
    "start_offset": (Start, "offset"),
    "start_heading": (Start, "heading"),
    "start_speed": (Start, "speed"),
    "planner_mu": (Scenario, "planner_mu"),
    "max_speed": (Scenario, "max_speed"),
    "obstacles": (Scenario, "obstacles"),  # how many
    "odometry_drift": (Scenario, "odometry_drift"),
    "lidar_latency": (LidarEffects, "latency"),
    "tires": (Scenario, "tires"),
    "vehicle": (Scenario, "vehicle"),
    "track": (None, ""),
    "patches": (None, ""),  # how many
    "patch_mu": (None, ""),
    "opponents": (None, ""),  # how many
    "opponent": (None, ""),  # who drives each
    "opponent_speed": (Scenario, "max_speed"),  # the fastest that each commands
    "opponent_ahead": (None, ""),  # [m] how far ahead of their places on the grid they start
    "floor_angle": (LidarEffects, "floor_angle"),
    "through_cars": (LidarEffects, "through_cars"),
}
"""Name -> whose field it is, in the order in which their shares are drawn: a new one goes to the end."""

OF_OPPONENTS = ("opponent", "opponent_speed", "opponent_ahead")
"""Parameters of the other cars, where there are any."""

OF_ENVIRONMENTS = ("track", "patches", "patch_mu", "opponents", *OF_OPPONENTS)
"""Parameters that only environments draw."""

OF_PLANNERS = ("planner_mu", "max_speed")
"""Parameters of the planner, in whose place a policy drives in an environment."""

PLANNER = "planner."
"""Prefix of the names of the planner's settings."""

_OBSTACLES = "obstacles"
_MOST = {_OBSTACLES: 1000, "patches": 100, "opponents": GREATEST_CARS - 1}
_MOST_COURSES = 100_000
_SEEDS = re.compile(r"random:([0-9]{1,18}):([0-9]{1,18})(:tight)?")


@explain_class
@dataclass(frozen=True)
class Uniform:
    """Any number from `low` to `high`, each as likely.

    Raises:
      SettingsError: an end that is not a finite number, or a low one above the high one.
    """

    low: float
    high: float

    def __post_init__(self) -> None:
        ends = (self.low, self.high)
        if not all(_is_number(end) for end in ends) or not math.isfinite(self.high - self.low) or self.low > self.high:
            raise SettingsError(f"range {self.low}:{self.high}; accepted: finite LOW:HIGH, LOW first")
        object.__setattr__(self, "low", float(self.low))
        object.__setattr__(self, "high", float(self.high))

    @property
    def extremes(self) -> tuple[Value, ...]:
        """Values that are refused if any is."""
        return self.low, self.high, self.at(0.618)  # where a whole number is needed, the last one is refused

    def at(self, share: float) -> float:
        """Return the value at a share of the range from 0 to 1."""
        return min(self.low + share * (self.high - self.low), self.high)

    def __str__(self) -> str:
        return f"{_text(self.low)}:{_text(self.high)}"


@explain_class
@dataclass(frozen=True, repr=False)
class Choice:
    """One of some values, each as likely; where there is one, that one.

    Raises:
      SettingsError: no value, or one that is no number, True, False or word.
    """

    values: tuple[Value, ...]

    def __post_init__(self) -> None:
        bad = [v for v in self.values if not (_is_number(v) or isinstance(v, (bool, str))) or v != v]
        if bad or not self.values:
            said = f"value {bad[0]!r}" if bad else "no values"
            raise SettingsError(f"{said}; accepted: numbers, true, false or words")

    @property
    def extremes(self) -> tuple[Value, ...]:
        """Values that are refused if any is."""
        return self.values

    def at(self, share: float) -> Value:
        """Return the value at a share of the list from 0 to 1, which counts as just below."""
        return self.values[min(int(share * len(self.values)), len(self.values) - 1)]

    def __repr__(self) -> str:
        return brief(self, str(self))

    def __str__(self) -> str:
        return "|".join(map(_text, self.values))


Range = Uniform | Choice


def as_range(value: Any) -> Range:
    """Return the range that is meant: `(low, high)`, a list of values, one value, text, or a range.

    Text is as `str` of a range has it: `0.6:1.2`, `a|b|c`, or one value.

    Raises:
      SettingsError: none is.
    """
    if isinstance(value, (Uniform, Choice)):
        return value
    if isinstance(value, str):
        ends = value.split(":")
        return Uniform(*map(_number, ends)) if len(ends) == 2 else Choice(tuple(map(read_value, value.split("|"))))
    if isinstance(value, tuple) and len(value) == 2:
        return Uniform(*map(_plain, value))
    if isinstance(value, (Sequence, np.ndarray)):
        return Choice(tuple(read_value(v) if isinstance(v, str) else _plain(v) for v in value))
    return Choice((_plain(value),))


@explain_class
@dataclass(frozen=True, repr=False)
class Randomization:
    """The range of each randomised parameter, by its name: one of PARAMETERS, or `planner.` and one of its settings.

    Raises:
      SettingsError: a name that is not known, or a range with a value that its parameter cannot have.
    """

    ranges: Mapping[str, Range]

    @classmethod
    def of(cls, ranges: Mapping[str, Any] | None) -> Randomization:
        """Return the randomisation of what `as_range` takes, by name.

        Raises:
          SettingsError: as the class, or what is no range.
        """
        read = {}
        for name, value in (ranges or {}).items():
            try:
                read[name] = course_range(value) if name == "track" else as_range(value)
            except SettingsError as error:
                raise SettingsError(f"randomize {name}: {error}") from error
        return cls(read)

    def __repr__(self) -> str:
        return brief(self, *(f"{name} {values}" for name, values in self.ranges.items()))

    def __hash__(self) -> int:
        return hash(tuple(self.ranges.items()))

    def __post_init__(self) -> None:
        for name in self.ranges:
            if name not in PARAMETERS and not (name.startswith(PLANNER) and name.removeprefix(PLANNER)):
                known = accepted_names(name, PARAMETERS, f", {PLANNER}SETTING")
                raise SettingsError(f"randomize {name}: no parameter; {known}")
        # sorted, so that the same ranges in another order are the same randomisation
        order = (*PARAMETERS, *sorted(self.ranges))
        sorted_ranges = {name: self.ranges[name] for name in sorted(self.ranges, key=order.index)}
        for name in _MOST.keys() & sorted_ranges.keys():
            sorted_ranges[name] = _counts(name, sorted_ranges[name])
        object.__setattr__(self, "ranges", sorted_ranges)
        for name, values in self.ranges.items():
            for value in values.extremes:
                try:
                    _check_value(name, value)
                except SettingsError as error:
                    raise SettingsError(f"randomize {name}={values}: {error}") from error

    @property
    def most_obstacles(self) -> int:
        """The greatest number of obstacles that may be drawn."""
        return max((int(v) for v in self.ranges[_OBSTACLES].extremes), default=0) if _OBSTACLES in self.ranges else 0

    @property
    def planner_extremes(self) -> list[dict[str, Value]]:
        """Settings of the planner, one at a time, that are refused if any is."""
        planner = {name: values for name, values in self.ranges.items() if name.startswith(PLANNER)}
        return [{name.removeprefix(PLANNER): v} for name, values in planner.items() for v in values.extremes]

    def texts(self) -> dict[str, str]:
        """Return each range as text that `as_range` reads back, by name."""
        return {name: str(values) for name, values in self.ranges.items()}

    def dtypes(self) -> list[tuple[str, np.dtype[Any]]]:
        """Return the names, and what holds their values in a structured array."""
        return [(name, np.asarray(values.extremes).dtype) for name, values in self.ranges.items()]

    def draw(self, seed: int) -> dict[str, Value]:
        """Return the values of a world by name, in the order of `dtypes`."""
        shares = dict(zip(PARAMETERS, generator(seed, "").random(len(PARAMETERS)).tolist(), strict=True))
        return {
            name: values.at(shares[name] if name in shares else float(generator(seed, name).random()))
            for name, values in self.ranges.items()
        }

    def require_usable(self, what: str, unusable: Sequence[str], why: str) -> None:
        """Refuse names that something cannot draw.

        Args:
          what: it is.
          unusable: the names; `planner.` stands for all settings of the planner.
          why: it cannot, as a whole sentence.

        Raises:
          SettingsError: one is drawn.
        """
        for name in self.ranges:
            if name in unusable or (name.startswith(PLANNER) and PLANNER in unusable):
                known = accepted_names(name, [own for own in PARAMETERS if own not in unusable])
                raise SettingsError(f"randomize {name}, in {what}: {why}; {known}")

    def scenario(
        self,
        track: Course,
        seed: int,
        values: Mapping[str, Value] | None = None,
        sites: Sites | None = None,
        base: DriveSettings | None = None,
    ) -> Scenario:
        """Return a world.

        Args:
          track: of the world.
          seed: of the world.
          values: that `draw(seed)` returned; None: it is called.
          sites: of obstacles on the track; None: they are worked out.
          base: what is not drawn; None: the defaults.

        Raises:
          SettingsError: more obstacles than there is room for.
        """
        values = self.draw(seed) if values is None else values
        base = base or DriveSettings()
        of: dict[type, dict[str, Any]] = {CarChanges: {}, LidarEffects: {}, Start: {}, Scenario: {}}
        for name, value in values.items():
            if name in PARAMETERS:
                owner, field = PARAMETERS[name]
                of[owner][field] = value
        start = replace(base.start, **of[Start])
        if _OBSTACLES in values:
            sites = sites or track.obstacle_sites(base.car.parameters)
            of[Scenario][_OBSTACLES] = sites.place(int(values[_OBSTACLES]), start.s, generator(seed, _OBSTACLES))
        own = {name.removeprefix(PLANNER): v for name, v in values.items() if name.startswith(PLANNER)}
        drawn: dict[str, Any] = {
            "changes": replace(base.changes, **of[CarChanges]),
            "start": start,
            "effects": replace(base.effects, **of[LidarEffects]),
            "planner_settings": {**base.planner_settings, **own},
            "seed": seed,
        } | of[Scenario]
        if values.keys() & {"mu", "tires", "vehicle"} and drawn.get("planner_mu", base.planner_mu) is None:
            drawn["planner_mu"] = base.assumed_mu  # a planner does not know what is drawn
        kept = {f.name: getattr(base, f.name) for f in fields(DriveSettings)}
        return Scenario(**(kept | drawn), track=track)

    def check_base(self, base: CarSettings, besides: Sequence[str] = ()) -> None:
        """Refuse a setting of all worlds that is also drawn for each, and changes that their vehicle cannot have.

        Args:
          base: the settings of all worlds.
          besides: names of settings that may be both.

        Raises:
          SettingsError: there is one.
        """
        plain = type(base)()
        given = {f.name for f in fields(base) if getattr(base, f.name) != getattr(plain, f.name)}
        vehicles = self.ranges["vehicle"].extremes if "vehicle" in self.ranges else (base.car,)
        for name, values in self.ranges.items():
            owner, field = PARAMETERS.get(name, (Scenario, name))
            group = {CarChanges: "changes", LidarEffects: "effects", Start: "start"}.get(owner, "")
            part = getattr(base, group, None)
            of_group = isinstance(part, owner or ()) and getattr(part, field) != getattr(owner(), field)
            own_settings = getattr(base, "planner_settings", ())
            of_planner = name.startswith(PLANNER) and name.removeprefix(PLANNER) in own_settings
            if (name in given and name not in besides) or of_group or of_planner:
                raise SettingsError(f"{name} is given for all worlds and in randomize; accepted: one of them")
            for value in values.extremes if owner is CarChanges else ():
                changed: dict[str, Any] = {field: value}
                try:
                    for vehicle in vehicles:
                        Vehicle.load(vehicle).spec(changes=replace(base.all_changes, **changed))  # type: ignore[arg-type]
                except SettingsError as error:
                    raise SettingsError(f"randomize {name}={values}: {error}") from error


def world_seeds(seed: int, count: int) -> NDArray[np.int64]:
    """Return the seeds of the first `count` worlds of a rollout: each depends on `seed` and its own place only.

    They are below 2^53, so that any reader of JSON keeps them.
    """
    return np.random.default_rng(seed).integers(2**53, size=count)


def generator(seed: int, name: str) -> np.random.Generator:
    """Return the generator that a world has for one name; none of them is that of its LiDAR's noise."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(crc32(name.encode()),)))


def _check_value(name: str, value: Value) -> None:
    """Raise SettingsError where a parameter cannot have a value. What the planner's settings can have, it says."""
    owner, field = PARAMETERS.get(name, (None, ""))
    if owner is not None and name != _OBSTACLES:
        owner(**{field: value})
    elif name == "patch_mu":
        CarChanges(mu=value)  # type: ignore[arg-type]


def course_range(value: Any) -> Choice:
    """Return the courses that are meant: names as `load_track` takes them, in a list or in a text with | between them.

    `random:A:B` stands for the random circuits of the seeds A to B - 1, and `random:A:B:tight` for the tight ones.

    Raises:
      SettingsError: no list of names, seeds without any between them, or too many courses.
    """
    if isinstance(value, Choice):
        return value
    names = value.split("|") if isinstance(value, str) else value
    if not isinstance(names, Sequence) or not all(isinstance(name, (str, Path)) for name in names):
        raise SettingsError(f"{shown(value)}; accepted: a list of courses, such as ['oval', 'random:0:200']")
    courses: list[str] = []
    for name in map(str, names):
        seeds = _SEEDS.fullmatch(name)
        if seeds is None:
            courses.append(name)
            continue
        first, end, tight = int(seeds[1]), int(seeds[2]), seeds[3] or ""
        if not 0 < end - first <= _MOST_COURSES:
            raise SettingsError(f"{name!r}; accepted: random:A:B with A below B, {_MOST_COURSES} seeds at most")
        courses += [f"random:{seed}{tight}" for seed in range(first, end)]
    if len(courses) > _MOST_COURSES:
        raise SettingsError(f"{len(courses)} courses; accepted: {_MOST_COURSES} at most")
    return Choice(tuple(courses))


def _counts(name: str, values: Range) -> Choice:
    """Return the numbers of a range of how many there are: of one of numbers, all whole numbers in it."""
    accepted = f"whole numbers from 0 to {_MOST[name]}"
    if not all(isinstance(v, (int, float)) and v in range(_MOST[name] + 1) for v in _ends(values)):
        raise SettingsError(f"randomize {name}={values}; accepted: {accepted}")
    if isinstance(values, Uniform):
        return Choice(tuple(range(int(values.low), int(values.high) + 1)))
    return Choice(tuple(int(v) for v in values.values))


def _ends(values: Range) -> tuple[Value, ...]:
    return (values.low, values.high) if isinstance(values, Uniform) else values.values


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _plain(value: Any) -> Any:
    """Return numpy's numbers as Python's."""
    return value.item() if isinstance(value, np.generic) else value


def _text(value: Value) -> str:
    """Return the shortest text that is read back as the value."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise SettingsError(f"{text.strip()!r}; accepted: a number, as in LOW:HIGH") from None
