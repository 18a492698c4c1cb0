"""The runs of a suite with some planners. What cannot be driven is refused here, before anything is."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from fg_mujoco.course.course import Course
from fg_mujoco.course.definitions import course_sha256
from fg_mujoco.course.scenes import PREFIX
from fg_mujoco.errors import ControllerError, FgMujocoError, SettingsError
from fg_mujoco.messages import require_whole, shown
from fg_mujoco.racing.entries import Entry, check_starts, grid_starts
from fg_mujoco.racing.planner_origin import by_name, check_planner
from fg_mujoco.racing.planners import ControllerChoice, only_planner, with_settings
from fg_mujoco.racing.resolved import Resolved, ground_of
from fg_mujoco.racing.setup import Setup
from fg_mujoco.simulation.course_loading import load_track

from ..runs.duels import Duel, require_circuit
from ..runs.graded_drive import GradedDrive
from ..runs.run import Origin, Run
from .suite import ASSIST, Group, Suite, require_axis


def plan(suite: Suite, planners: Sequence[str], *, every: int = 1, scored: bool = False) -> list[Run]:
    """Return the runs of a suite.

    Args:
      suite: what is driven.
      planners: each as `race` takes it, of a file with one planner the file is enough.
      every: only one in so many runs of each planner, drawn by lot, always the same.
      scored: whether rows have the bound of a lap, of which scores are made.

    Raises:
      SettingsError: a planner that is given twice, or is an object; a course with too little room; scores of duels or
        checks.
      TrackError, ControllerError: what cannot be loaded.
    """
    require_whole("every", every, 1)
    if scored and suite.kind != "alone":
        raise SettingsError(f"suite {suite.name} is of {suite.kind}; accepted: one of planners alone, for scores")
    texts, loaded = [_text(each) for each in planners], Loaded()
    if suite.kind == "checks":
        if every > 1:
            raise SettingsError(f"every is {every} of checks; accepted: 1, for all of them give points")
        require_axis("planner", texts)
        _check_drives(suite)
        return [each for planner in texts for each in _graded(suite, planner, loaded)]
    choices = [ControllerChoice.of(only_planner(each)) for each in texts]
    require_axis("planner", [with_settings(os.path.relpath(each.source), dict(each.settings)) for each in choices])
    labels = [choice.label for choice in choices]  # a file without its folder; files of one name with it
    find = _duels if suite.kind == "duels" else _alone
    runs: list[Run] = []
    for choice in choices:
        label = choice.label if labels.count(choice.label) == 1 else with_settings(choice.source, dict(choice.settings))
        for name, given in _assists(suite, choice):
            own: list[Run] = []
            for group in suite.groups:
                place = {"planner": label, "assist": name}
                place |= {"group": group.name} if len(suite.groups) > 1 else {}
                own += find(group, choice, place, given, loaded)
            own = list({run.key: run for run in own}.values())
            if every > 1:  # drawn by lot, since axes have a rhythm; the same lots for each assist
                drawn = np.random.default_rng(0).permutation(len(own))[: math.ceil(len(own) / every)]
                own = [own[i] for i in sorted(drawn.tolist())]
            runs += own
    return [replace(run, scored=True) for run in runs] if scored else runs


def _text(planner: Any) -> str:
    if not isinstance(planner, str):
        raise SettingsError(f"a planner is {shown(planner)}, an object; accepted: a name, or path/to/file.py:ClassName")
    return planner


def _assists(suite: Suite, choice: ControllerChoice) -> list[tuple[str, str]]:
    """Return the assists of a planner, each as tables have it and as its entry does.

    A planner whose settings name an assist keeps that one, and one that decides by itself has no stages: `none`.
    """
    own = next((str(value) for name, value in choice.settings if name == "assist"), "")
    if own:
        return [(own, ASSIST)]
    if not hasattr(choice.load(), "source_laws"):
        return [("none", "none")]
    return [(assist, assist) for assist in suite.assists]


def _alone(group: Group, choice: ControllerChoice, place: dict[str, Any], assist: str, loaded: Loaded) -> Iterator[Run]:
    """Yield the runs of a planner in a group, alone or against the group's opponents."""
    for values, setup in group.setups():
        first = replace(setup.first, controller=choice.source, planner_settings=dict(choice.settings), assist=assist)
        setup = replace(setup, entries=(first, *setup.entries[1:]))
        course = loaded.course(setup)
        if setup.laps is not None and course.most_laps is not None:  # a scene is driven once
            setup = replace(setup, laps=min(setup.laps, course.most_laps))
        if len(setup.entries) > 1:
            cars, names = [entry.car.parameters for entry in setup.entries], [str(each.name) for each in setup.named]
            places = grid_starts(course, cars, setup.grid)
            starts = [entry.start or own for entry, own in zip(setup.entries, places, strict=True)]
            check_starts(course, starts, cars, names, ground_of(setup, course).boxes)
        yield Run(
            place=place | values | loaded.name(values["course"], course), setup=setup,
            course_sha256=course_sha256(course),
            origins=tuple(loaded.origin(entry, course, place) for place, entry in enumerate(setup.entries)),
        )  # fmt: skip


def _duels(group: Group, choice: ControllerChoice, place: dict[str, Any], assist: str, loaded: Loaded) -> Iterator[Run]:
    """Yield the duels of a planner in a group."""
    assert group.duels is not None
    for values, setup in replace(group, seeds=()).setups():
        first = replace(setup.first, controller=choice.source, planner_settings=dict(choice.settings), assist=assist)
        setup = replace(setup, entries=(first,))
        course, origin = require_circuit(loaded.course(setup)), loaded.origin(first, loaded.course(setup))
        for found in group.duels.places(course.length):
            for seed in [{}] if group.duels.speed else [{"seed": seed} for seed in group.seeds or (0,)]:
                yield Duel(
                    place=place | values | loaded.name(values["course"], course) | found | seed, setup=setup,
                    duels=group.duels, course_sha256=course_sha256(course), origins=(origin,),
                )  # fmt: skip


def _graded(suite: Suite, planner: str, loaded: Loaded) -> Iterator[Run]:
    """Yield the drives of a planner through the checks of a suite. No code of it is run for that."""
    own, sha256 = "", None
    try:
        text = planner if re.search(r":\w+$", planner) or not planner.endswith(".py") else f"{planner}:"
        choice = ControllerChoice.of(text)
        sha256, own = choice.sha256, str(dict(choice.settings).get("assist", ""))
    except Exception:  # it has none, or it cannot be read: the drive says why
        pass
    for assist in [own] if own else suite.assists:
        for number, group in enumerate(suite.groups):
            first = replace(group.base.first, assist=ASSIST if own else assist)
            yield GradedDrive(
                place={"planner": planner, "assist": assist, "drive": number},
                setup=replace(group.base, entries=(first, *group.base.entries[1:])), checks=group.checks,
                course_sha256=course_sha256(loaded.course(group.base)), origins=(Origin(sha256=sha256),),
            )  # fmt: skip


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
        self._names: dict[str, Any] = {}
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

    def name(self, track: str, course: Course) -> dict[str, str]:
        """Return what a course is called in tables: of a file as races do; of a second file of that name the path."""
        name = course.name if Path(track.partition("[")[0]).suffix else track
        return {"course": name if self._names.setdefault(name, track) == track else track}

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
