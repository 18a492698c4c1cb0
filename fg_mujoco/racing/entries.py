"""Entries of a race: the settings of each car, and its place on the grid.

entries = [Entry(controller="gap_finder"), Entry(controller="pure_pursuit", max_speed=4.0)]
result = fg_mujoco.race("oval", entries=entries, grid="staggered")
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..arguments import explain_class, setting
from ..course.course import Course
from ..course.obstacles import Obstacle
from ..course.standing import off_course, stands_in_something
from ..display import quoted
from ..errors import ControllerError, SettingsError, accepted_names
from ..messages import CarParameters, Controller, FloatArray, MapLine, shown
from ..simulation.cars import GREATEST_CARS, WorldCar, first_overlap
from ..simulation.planner_adapter import start as start_planner
from ..simulation.settings import DriveSettings, Start
from .planners import build_controller, make_controller, split_controller, usual_vehicle

GRIDS = ("staggered", "side_by_side", "behind")

BOTH, NO_FAULT = "both", "no fault"
"""Stand in results where the name of the car at fault would."""

_BEHIND = 0.80  # [m] RoboRacer rules 3.2026: staggered, the next car stands 80 cm behind
_ASIDE = 0.30  # [m] and 30 cm aside
_BETWEEN = 0.30  # [m] side by side: 30 cm apart
_LONGEST_NAME = 60


@explain_class
@dataclass(frozen=True, kw_only=True, repr=False)
class Entry(DriveSettings):
    """A car of a race, its planner, and what both are set to.

    Raises:
      SettingsError: a value outside of what is accepted.
      ModelError: a file that is not that of a vehicle.
    """

    controller: str | Controller = setting(
        "gap_finder", "NAME, path/to/file.py:ClassName, a policy's file or folder, or ros:path/to/node.py, with "
        "settings NAME[SETTING=VALUE,...]; default: gap_finder", "CONTROLLER", "course and planner",
    )  # fmt: skip
    name: str | None = None  # in the results; None: `car_0`, `car_1` and so on
    start: Start | None = None  # type: ignore[assignment]  # None: its place on the grid

    def __post_init__(self) -> None:
        start = self.start
        if start is None:
            object.__setattr__(self, "start", Start())
        super().__post_init__()
        if start is None:
            object.__setattr__(self, "start", None)
        settings, name = self.planner_settings, self.name
        if settings is not None and not isinstance(settings, Mapping):
            raise SettingsError(f"Entry.planner_settings is {shown(settings)}; accepted: settings by name")
        if name is not None and not (isinstance(name, str) and 0 < len(name) <= _LONGEST_NAME and name.isprintable()):
            raise SettingsError(f"Entry.name is {shown(name)}; accepted: a text of 1 to {_LONGEST_NAME} characters")
        if name in (BOTH, NO_FAULT):
            raise SettingsError(f"Entry.name is {shown(name)}, a verdict of race control; accepted: another name")
        if self.patches:
            raise SettingsError("Entry.patches is set; accepted: `patches` of the race, whose floor it is")

    def _usual_vehicle(self) -> str:
        """Return the vehicle that the planner is for, or else the default one."""
        return usual_vehicle(self.controller) or super()._usual_vehicle()

    def like(self, controller: str, *, max_speed: float | None = None) -> Entry:
        """Return the entry of another planner in a car that is set as this one; `max_speed` None: its own [m/s]."""
        fastest = self.max_speed if max_speed is None else max_speed
        return replace(
            self, controller=controller, max_speed=fastest, name=None, start=None, planner_settings={}, seed=0
        )

    def world_car(self) -> WorldCar:
        """Return the car as World takes it."""
        return WorldCar(vehicle=self.car, mu=self.set_mu, changes=self.changes, tires=self.tire_set)


def require_entries(entries: Sequence[Entry]) -> tuple[Entry, ...]:
    """Return entries with a name each.

    Raises:
      SettingsError: none, more than a world takes, something else, or two of one name.
    """
    if isinstance(entries, (str, Entry, Mapping)) or not isinstance(entries, Iterable):
        raise SettingsError(f"entries is {shown(entries)}; accepted: a sequence of Entry, such as [Entry(), Entry()]")
    for entry in entries:
        if not isinstance(entry, Entry):
            raise SettingsError(f"an entry is {entry!r}; accepted: an Entry, such as Entry(controller='gap_finder')")
    if not 1 <= len(entries) <= GREATEST_CARS:
        raise SettingsError(f"{len(entries)} entries; accepted: 1 to {GREATEST_CARS}")
    named = tuple(replace(entry, name=entry.name or f"car_{index}") for index, entry in enumerate(entries))
    names = [str(entry.name) for entry in named]
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise SettingsError(f"two entries are called {quoted(twice[0])}; accepted: a name for each")
    return named


def entry_planner(
    entry: Entry, *, car: CarParameters, map_line: MapLine | None, kind: type | None = None, alone: bool = False
) -> Controller:
    """Return the planner of an entry, ready for a race.

    Args:
      entry: the car's.
      car: what the planner is told of it.
      map_line: the line through the course.
      kind: the planner's class, where it is found already; None: it is looked for.
      alone: whether it is the only entry, whose name a message need not say.

    Raises:
      ControllerError: it cannot be built; the message says whose it is.
    """
    source, settings = split_controller(entry.controller, entry.planner_settings)
    context = entry.context(car, map_line)
    try:
        if kind is None or not isinstance(source, str):
            planner = make_controller(source, context, settings=settings)
        else:
            planner = build_controller(kind, source, context, settings)
        start_planner(planner)
    except ControllerError as error:
        if alone:
            raise
        raise type(error)(f"{entry.name}: {error}") from error
    return planner


def require_grid(kind: str) -> None:
    """Refuse what is no grid.

    Raises:
      SettingsError: it is none.
    """
    if not isinstance(kind, str) or kind not in GRIDS:
        raise SettingsError(f"grid is {shown(kind)}; {accepted_names(kind, GRIDS)}")


def grid_starts(course: Course, cars: Sequence[CarParameters], kind: str = "staggered") -> tuple[Start, ...]:
    """Return where cars stand before the start, the first of them in front and at s = 0 of a closed course.

    "staggered": each 80 cm behind the one before, 15 cm to the left or to the right of the line by turns, 30 cm aside.
    "behind": the same, but the first car is behind all others. "side_by_side": in rows of two, 30 cm between their
    sides, the next row a car's length and 80 cm behind. On an open course the last stands at its start. Source:
    RoboRacer rules 3.2026 for two cars; more of them go on alike.

    Raises:
      SettingsError: an unknown kind.
    """
    require_grid(kind)
    if len(cars) == 1:
        return (Start(),)
    if kind != "side_by_side":
        places = [(-_BEHIND * i, (0.5 if i % 2 == 0 else -0.5) * _ASIDE) for i in range(len(cars))]
        if kind == "behind":
            places.insert(0, places.pop())
    else:
        length, width = (max(getattr(car, name) for car in cars) for name in ("length", "width"))
        aside = 0.5 * (width + _BETWEEN)
        places = [(-(length + _BEHIND) * (i // 2), aside if i % 2 == 0 else -aside) for i in range(len(cars))]
    origin = places[0][0] if course.closed else min(s for s, _ in places)
    return tuple(Start(s=s - origin, offset=offset) for s, offset in places)


def check_starts(
    course: Course,
    starts: Sequence[Start],
    cars: Sequence[CarParameters],
    names: Sequence[str],
    obstacles: Sequence[Obstacle] = (),
    *,
    drawn: bool = False,
) -> None:
    """Refuse starts at which a car is outside the walls, or stands in a wall, in an obstacle or in another car.

    Args:
      course: of the race.
      starts: one for each car.
      cars: parameters of each.
      names: of each; of one car, that of the car alone may be empty.
      obstacles: that were put on the course.
      drawn: whether the starts were drawn: then those outside the walls, in one or in an obstacle are no mistake, and
        the engine says that such a car has crashed.

    Raises:
      SettingsError: one does; the message has which.
    """
    poses: list[FloatArray] = []
    for start, car, name in zip(starts, cars, names, strict=True):
        who = quoted(name) if name else "the car"
        if not course.closed and math.isfinite(course.length) and not 0.0 <= start.s <= course.length:
            raise SettingsError(
                f"{who} starts at s = {start.s:g} m of {course.name!r}; accepted: 0 to {course.length:g} m"
            )
        x, y, along = course.start_pose(start.s, start.offset)
        pose, on_line = np.array([x, y, along + start.heading]), course.start_pose(start.s)
        where = f"on {course.name!r} at s = {start.s:g} m, {start.offset:g} m to the left"
        more = "" if len(cars) == 1 else ", another grid, or fewer cars"
        accepted = f"accepted: a start clear of walls and obstacles{more}"
        if not drawn and stands_in_something(course, pose, car, obstacles):
            raise SettingsError(f"{who} does not fit {where}, in a wall or an obstacle; {accepted}")
        if not drawn and off_course(course, pose, on_line, lane=len(cars) > 1):
            raise SettingsError(f"{who} does not fit {where}, beyond the walls; {accepted}")
        for other_pose, other_car, other in zip(poses, cars, names, strict=False):
            if first_overlap((other_pose, pose), (other_car, car)) is not None:
                raise SettingsError(
                    f"{who} and {quoted(other)} start in one place, ({x:.2f}, {y:.2f}) m; accepted: starts "
                    "apart by a car's length or width"
                )
        poses.append(pose)
