"""The runs of a suite with some planners. What cannot be driven is refused here, before anything is."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np

from fg_mujoco.course.course import Course
from fg_mujoco.course.definitions import course_sha256
from fg_mujoco.course.scenes import PREFIX
from fg_mujoco.display import quoted
from fg_mujoco.errors import ControllerError, FgMujocoError, SettingsError
from fg_mujoco.messages import require_whole, shown
from fg_mujoco.racing.entries import Entry, check_starts, grid_starts
from fg_mujoco.racing.opponents import opponent_seed
from fg_mujoco.racing.planners import ControllerChoice, only_planner
from fg_mujoco.racing.resolved import Resolved, ground_of
from fg_mujoco.racing.setup import Setup
from fg_mujoco.racing.trust import by_name, check_planner
from fg_mujoco.simulation.cars import GREATEST_CARS
from fg_mujoco.simulation.course_loading import load_track
from fg_mujoco.simulation.settings import Start

from ..runs.duels import Duel, require_circuit
from ..runs.graded_drive import GradedDrive
from ..runs.run import Origin, Run
from .suite import DECISION_LIMIT, Group, Suite, draws, require_axis

BETWEEN = " | "
"""Stands between the planners of a heat in one text."""

_LONGEST_LABEL = 60
Planner = str | Entry


def plan(
    suite: Suite,
    planners: Sequence[Planner],
    *,
    every: int = 1,
    marks: str = "",
    keep: str = "",
    timed: bool = False,
    traced: bool = False,
) -> list[Run]:
    """Return the runs of a suite.

    Args:
      suite: what is driven.
      planners: each as `race` takes it, of a file with one planner the file is enough; of heats also an Entry with a
        car of its own.
      every: only one in so many runs of each planner, drawn by lot, always the same.
      marks: folder for files that say whose turn it is.
      keep: folder for run folders; empty: none are kept.
      timed, traced: see Run.

    Raises:
      SettingsError: a planner that is given twice, or is an object; too few of them for a heat; a course with too
        little room.
      TrackError, ControllerError: what cannot be loaded.
    """
    require_whole("every", every, 1)
    loaded = Loaded()
    if every > 1 and suite.kind in ("heats", "checks"):
        raise SettingsError(f"every is {every} of {suite.kind}; accepted: 1, for planners meet in all of them")
    if suite.kind == "checks":
        require_axis("planner", [_text(each) for each in planners])
        _check_drives(suite)
        return [each for planner in planners for each in _graded(suite, str(planner), loaded)]
    if suite.kind == "heats":
        heats = [heat for group in suite.groups for heat in _heats(group, planners, keep, loaded)]
        return [replace(heat, mark=f"{marks}/{heat.key[:24]}" if marks else "") for heat in heats]
    choices = [ControllerChoice.of(only_planner(_text(each))) for each in planners]
    require_axis("planner", [choice.label for choice in choices])
    find = _duels if suite.kind == "duels" else _alone
    runs: list[Run] = []
    for choice in choices:
        own: list[Run] = []
        for assist in suite.assists or (None,):
            for group in suite.groups:
                place = {"planner": choice.label} | ({"assist": assist} if assist is not None else {})
                place |= {"group": group.name} if len(suite.groups) > 1 or suite.assists else {}
                own += find(group, choice, place, assist, loaded)
        own = list({run.key: run for run in own}.values())
        if every > 1:  # drawn by lot: axes have a rhythm
            drawn = np.random.default_rng(0).permutation(len(own))[: math.ceil(len(own) / every)]
            own = [own[i] for i in sorted(drawn.tolist())]
        runs += own
    return [replace(run, timed=timed, traced=traced) for run in runs]


def _text(planner: Any) -> str:
    if not isinstance(planner, str):
        raise SettingsError(f"a planner is {shown(planner)}, an object; accepted: a name, or path/to/file.py:ClassName")
    return planner


def _alone(
    group: Group, choice: ControllerChoice, place: dict[str, Any], assist: str | None, loaded: Loaded
) -> list[Run]:
    """Return the runs of a planner in a group, alone or against the group's opponents."""
    runs = []
    for values, setup in group.setups():
        first = replace(setup.first, controller=choice.source, planner_settings=dict(choice.settings))
        first = first if assist is None else replace(first, assist=assist)
        setup = replace(setup, entries=(first, *setup.entries[1:]))
        course = loaded.course(setup)
        if setup.laps is not None and course.most_laps is not None:  # a scene is driven once
            setup = replace(setup, laps=min(setup.laps, course.most_laps))
        if len(setup.entries) > 1:
            cars, names = [entry.car.parameters for entry in setup.entries], [str(each.name) for each in setup.named]
            places = grid_starts(course, cars, setup.grid)
            starts = [entry.start or own for entry, own in zip(setup.entries, places, strict=True)]
            check_starts(course, starts, cars, names, ground_of(setup, course).boxes)
        runs.append(
            Run(
                place=place | values, setup=setup, planners=(choice.label,), course_sha256=course_sha256(course),
                origins=tuple(loaded.origin(entry, course, place) for place, entry in enumerate(setup.entries)),
            )
        )  # fmt: skip
    return runs


def _duels(
    group: Group, choice: ControllerChoice, place: dict[str, Any], assist: str | None, loaded: Loaded
) -> list[Run]:
    assert group.duels is not None
    runs: list[Run] = []
    for values, setup in replace(group, seeds=()).setups():
        first = replace(setup.first, controller=choice.source, planner_settings=dict(choice.settings))
        setup = replace(setup, entries=(first if assist is None else replace(first, assist=assist),))
        course = require_circuit(loaded.course(setup))
        for found in group.duels.places(course.length):
            for seed in [{}] if group.duels.speed else [{"seed": seed} for seed in group.seeds or (0,)]:
                runs.append(
                    Duel(
                        place=place | values | found | seed, setup=setup, planners=(choice.label,), duels=group.duels,
                        course_sha256=course_sha256(course), origins=(loaded.origin(first, course),),
                    )
                )  # fmt: skip
    return runs


def _heats(group: Group, planners: Sequence[Planner], keep: str, loaded: Loaded) -> list[Run]:
    """Return the heats of a group: course by course, heat by heat, and each planner of a heat in front once."""
    if len(planners) < 2:
        raise SettingsError(f"planners of a league: {len(planners)}; accepted: two or more")
    if group.heats > min(len(planners), GREATEST_CARS):
        said = f"cars is {group.heats} for {len(planners)} planners"
        raise SettingsError(f"{said}; accepted: 2 to {min(len(planners), GREATEST_CARS)}")
    base = replace(group.base, decision_limit=group.base.decision_limit or DECISION_LIMIT)
    heats = []
    for values, setup in replace(group, base=base, seeds=()).setups():
        entries = _named([_entry(each, setup.first) for each in planners])
        require_axis("planner", [str(entry.name) for entry in entries])
        seeds = (group.seeds or (0,)) if any(map(draws, entries)) else (None,)
        course, boxes = loaded.course(setup), ground_of(setup).boxes
        origins = [loaded.origin(entry, course) for entry in entries]
        for members in combinations(range(len(entries)), group.heats):
            for first in range(group.heats):
                numbers = members[first:] + members[:first]
                lined_up = [entries[number] for number in numbers]
                own = [entry.car.parameters for entry in lined_up]
                names = [str(entry.name) for entry in lined_up]
                check_starts(course, grid_starts(course, own, setup.grid), own, names, boxes)
                code = tuple(origins[number] for number in numbers)
                for seed in seeds:
                    cars = tuple(
                        replace(entry, seed=opponent_seed(seed or 0, number, entry.seed))
                        for entry, number in zip(lined_up, numbers, strict=True)
                    )
                    place = {"planner": BETWEEN.join(names)} | values | {"seed": seed}
                    heats.append(
                        Run(
                            place=place, setup=replace(setup, entries=cars), planners=tuple(names), keep=keep,
                            course_sha256=course_sha256(course), origins=code,
                        )
                    )  # fmt: skip
    return heats


def _entry(planner: Planner, first: Entry) -> Entry:
    return planner if isinstance(planner, Entry) else first.like(only_planner(_text(planner)))


def _named(entries: Sequence[Entry]) -> tuple[Entry, ...]:
    """Return entries whose names are what their planners are called: files of one name by their whole paths."""
    short = [_label(entry) for entry in entries]
    whole = [entry.name or str(entry.controller)[-_LONGEST_LABEL:] for entry in entries]
    labels = [own if short.count(own) == 1 else longer for own, longer in zip(short, whole, strict=True)]
    return tuple(replace(entry, name=label, start=None) for entry, label in zip(entries, labels, strict=True))


def _label(entry: Entry) -> str:
    """Return what the planner of an entry is called if no other is called so."""
    if not isinstance(entry.controller, str):
        said = f"the planner of {shown(entry)} is an object"
        raise ControllerError(f"{said}; accepted: a name or path/to/file.py:ClassName, for each heat to have its own")
    if entry.start not in (None, Start()):
        raise SettingsError(f"start is {shown(entry.start)} of {entry.controller}; accepted: none, it is the grid's")
    label = entry.name or ControllerChoice.of(entry.controller).label[:_LONGEST_LABEL]
    if BETWEEN in label:
        raise SettingsError(f"a planner is called {quoted(label)}; accepted: a name without {BETWEEN.strip()!r}")
    return label


def _graded(suite: Suite, planner: str, loaded: Loaded) -> list[Run]:
    """Return the drives of a planner through the checks of a suite. No code of it is run for that."""
    try:
        text = planner if re.search(r":\w+$", planner) or not planner.endswith(".py") else f"{planner}:"
        sha256 = ControllerChoice.of(text).sha256
    except Exception:  # it has none, or it cannot be read: the drive says why
        sha256 = None
    return [
        GradedDrive(
            place={"planner": planner, "drive": number}, setup=group.base, planners=(planner,), checks=group.checks,
            course_sha256=course_sha256(loaded.course(group.base)), origins=(Origin(sha256=sha256),),
        )
        for number, group in enumerate(suite.groups)
    ]  # fmt: skip


def _check_drives(suite: Suite) -> None:
    """Refuse a drive that nobody can drive, or that lacks what its checks need."""
    for group in suite.groups:
        where = f"checks[{group.checks[0].number}]"
        try:
            raced = Resolved.of(group.base)
            for entry in raced.entries[1:]:
                check_planner(ControllerChoice.of(str(entry.controller)), raced.ground.course, entry)
            raced.check_starts()
        except FgMujocoError as error:
            raise type(error)(f"{where}: {error}") from error
        for each in group.checks:
            lacking = each.check.lacks(raced.ground, len(raced.entries))
            if lacking:
                said = f"checks[{each.number}]: {each.name} lacks {lacking}"
                raise SettingsError(f"{said}; accepted: a drive that has it")


class Loaded:
    """The courses and planners of a plan, each loaded once."""

    def __init__(self) -> None:
        self._courses: dict[Any, Course] = {}
        self._origins: dict[Any, Origin] = {}

    def course(self, setup: Setup) -> Course:
        """Return the course of a setup.

        Raises:
          TrackError: it cannot be loaded, or is narrower than a car.
          SettingsError: it has too little room for so many obstacles.
        """
        car, placed = setup.first.car.parameters, setup.obstacles
        if (setup.track, car) not in self._courses:
            self._courses[setup.track, car] = load_track(setup.track, car=car)
        course = self._courses[setup.track, car]
        for entry in setup.entries:
            course.check_car(entry.car.parameters)
        if isinstance(placed, int) and placed and not course.name.startswith(PREFIX):
            most = course.obstacle_sites(car).most
            if placed > most:
                raise SettingsError(f"{placed} obstacles on track {course.name!r}; accepted: at most {most}")
        return course

    def origin(self, entry: Entry, course: Course, place: int = 0) -> Origin:
        """Return where the planner of an entry, on a place of the grid, comes from; it is built once for that.

        Raises:
          ControllerError: it is an object, or cannot be built.
        """
        if not isinstance(entry.controller, str):
            raise ControllerError(
                f"controller {type(entry.controller).__name__} is an object; accepted: a name or "
                "path/to/file.py:ClassName, for each run to have one of its own"
            )
        key = Setup(entries=(replace(entry, seed=0, start=None),)), course.name
        if key not in self._origins:
            choice = ControllerChoice.of(entry.controller)
            try:
                files = by_name(check_planner(choice, course, entry))
                self._origins[key] = Origin(sha256=choice.sha256, files=files)
            except ControllerError as error:
                if place == 0:
                    raise
                raise ControllerError(f"{entry.name or f'car_{place}'}: {error}") from error
        return self._origins[key]
