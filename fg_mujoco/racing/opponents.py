"""The cars that car 0 races against in each run of a study, and what a row of its table says of them.

opponents = Opponents.of(Setup.of(opponents=["pure_pursuit", Entry(max_speed=4.0)]))
entries = opponents.line_up(course, Entry())  # as `race` takes them, each with its start
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any
from zlib import crc32

import numpy as np

from ..course.course import Course
from ..course.obstacles import Obstacle
from ..display import quoted
from ..errors import ControllerError, SettingsError
from ..simulation.settings import DriveSettings, Start
from .entries import Entry, check_starts, entry_planner, grid_starts
from .planner_origin import Files, by_name, planner_files
from .planners import ControllerChoice, split_controller
from .rules import Contact, Overtake
from .setup import Setup

FIRST = "car_0"
"""Name of car 0 in studies."""


@dataclass(frozen=True, kw_only=True)
class AmongCars:
    """How car 0 fared among the others. Fields are as in the JSON."""

    position: int  # from 1: by when the cars finished, then by how far they came
    overtakes: int  # by car 0
    overtaken: int  # how often car 0 was overtaken
    contacts: int  # of car 0 with other cars
    contacts_at_fault: int  # those that were its fault, alone or with the other car
    winner: str  # name of the car that finished first; empty: none has

    @classmethod
    def of(
        cls, *, position: int, overtakes: Sequence[Overtake], contacts: Sequence[Contact], winner: str | None
    ) -> AmongCars:
        """Return them of what race control kept of a race."""
        return cls(
            position=position,
            overtakes=sum(overtake.by == FIRST for overtake in overtakes),
            overtaken=sum(overtake.of == FIRST for overtake in overtakes),
            contacts=sum(FIRST in contact.cars for contact in contacts),
            contacts_at_fault=sum(contact.blames(FIRST) for contact in contacts),
            winner=winner or "",
        )


AMONG_CARS = tuple(field.name for field in fields(AmongCars))
"""Names of the figures that runs with opponents have besides the others."""


@dataclass(frozen=True, kw_only=True)
class Opponents:
    """The other cars, the same ones in each run, and the grid of all. No cars: car 0 drives alone."""

    entries: tuple[Entry, ...] = ()
    grid: str = "staggered"
    recorded: tuple[str | None, ...] = ()  # of those that were read: hash of each planner's file, None of a bundled one
    files: tuple[Files, ...] = ()  # that each planner reads, by name; none before `checked`

    @classmethod
    def of(cls, setup: Setup) -> Opponents:
        """Return the other cars of a setup.

        Raises:
          SettingsError: a LiDAR that no study can simulate.
          ControllerError: a planner that is an object.
        """
        if len(setup.entries) == 1:
            return cls()
        _, *named = setup.named
        for entry in named:
            said = f"of opponent {quoted(str(entry.name))}"
            if not isinstance(entry.controller, str):
                raise ControllerError(
                    f"controller {type(entry.controller).__name__} {said} is an object; accepted: a name or "
                    "path/to/file.py:ClassName, for each run to have one of its own"
                )
            if entry.effects.motion_distortion:
                raise SettingsError(f"motion distortion of the LiDAR {said}; accepted: in `race` only")
        return cls(entries=tuple(named), grid=setup.grid)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all cars, car 0's first."""
        return (FIRST, *(str(entry.name) for entry in self.entries))

    @property
    def noisy(self) -> bool:
        """Whether what they sense depends on a seed."""
        return any(
            entry.effects.range_noise_std > 0.0 or entry.effects.dropout_probability > 0.0 or bool(entry.sensed)
            for entry in self.entries
        )

    def checked(self, course: Course) -> Opponents:
        """Build each planner once, for a race on a course, and return the opponents with the files that these read.

        Raises:
          ControllerError: one cannot be built, or a file of it cannot be read; the message says whose it is.
          TrackError: a car that the course is too narrow for.
        """
        files = []
        for entry in self.entries:
            course.check_car(entry.car.parameters)
            planner = entry_planner(entry, car=entry.car.parameters, map_line=course.map_line)
            files.append(by_name(planner_files(planner, split_controller(entry.controller, entry.planner_settings)[1])))
        return replace(self, files=tuple(files))

    def line_up(
        self, course: Course, first: Entry, obstacles: Sequence[Obstacle] = (), *, drawn: bool = False
    ) -> tuple[Entry, ...]:
        """Return the entries of a run as `race` takes them: car 0's and the others', each with its start and its seed.

        The start of `first` counts from its place on the grid, and the whole grid moves along the line with its `s`. An
        opponent that has a start of its own stands there. Its seed is drawn from that of the run, by its number and the
        seed that it was entered with. `drawn` is as of `check_starts`.

        Raises:
          SettingsError: a car that stands in a wall, in an obstacle or in another car.
        """
        entries = (replace(first, name=FIRST), *self.entries)
        cars = [entry.car.parameters for entry in entries]
        own = first.start or Start()
        places = [replace(place, s=place.s + own.s) for place in grid_starts(course, cars, self.grid)]
        places[0] = replace(own, s=places[0].s, offset=places[0].offset + own.offset)
        starts = [places[0], *(entry.start or place for entry, place in zip(self.entries, places[1:], strict=True))]
        check_starts(course, starts, cars, self.names, obstacles, drawn=drawn)
        return tuple(
            replace(entry, start=start, seed=opponent_seed(first.seed, index, entry.seed) if index else first.seed)
            for index, (entry, start) in enumerate(zip(entries, starts, strict=True))
        )

    def described(self) -> dict[str, Any]:
        """Return what they are as it can stand in JSON, nothing where there are none; `read` reads it back."""
        if not self.entries:
            return {}
        choices = [ControllerChoice.of(str(entry.controller)) for entry in self.entries]
        hashes = self.recorded or [choice.sha256 for choice in choices]
        rows = [
            entry.described()
            | {"controller": choice.label, "controller_sha256": sha256}
            | ({"controller_files": files} if files else {})
            for entry, choice, sha256, files in zip(
                self.entries, choices, hashes, self.files or [{}] * len(self.entries), strict=True
            )
        ]
        return {"opponents": rows, "grid": self.grid}

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of their planners in tables."""
        return tuple(ControllerChoice.of(str(entry.controller)).label for entry in self.entries)

    @classmethod
    def read(cls, described: Mapping[str, Any]) -> Opponents:
        """Return what `described` told of, among other settings; a planner's file is then its name only.

        Raises:
          SettingsError: what cannot be.
        """
        rows = [dict(row) for row in described.get("opponents", ())]
        recorded = tuple(row.pop("controller_sha256") for row in rows)
        files = tuple(dict(row.pop("controller_files", {})) for row in rows)
        grid = described.get("grid", cls.grid)
        return cls(entries=tuple(Entry.of(row) for row in rows), grid=grid, recorded=recorded, files=files)


def entry_of(settings: DriveSettings, controller: str) -> Entry:
    """Return the entry of car 0 of a run: a planner, and what it is driven with but for the floor."""
    own = {field.name: getattr(settings, field.name) for field in fields(DriveSettings) if field.name != "patches"}
    return Entry(controller=controller, name=FIRST, **own)


def opponent_seed(seed: int, index: int, own: int) -> int:
    """Return the seed of an opponent in a run with a seed, by its number and the seed that it was entered with."""
    sequence = np.random.SeedSequence(seed, spawn_key=(crc32(b"opponent"), index, own))
    return int(sequence.generate_state(1, np.uint64)[0] >> np.uint64(11))
