"""One heat of a league: cars of several planners on a track, from places of a grid, with race control.

A car that finishes beats each car that finishes later or does not finish. A car that does not finish beats nobody: of
two such cars neither beats the other. For each car that it beats, a car has a point.

A planner that raises, takes longer for a decision than its limit, or ends the process does not finish. If it ends the
process, nobody drives on: all others have won then.
"""

from __future__ import annotations

import re
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from fg_mujoco.errors import ControllerError
from fg_mujoco.racing.decision_times import decision_limit_text
from fg_mujoco.racing.entries import Entry
from fg_mujoco.racing.opponents import opponent_seed
from fg_mujoco.racing.race import race_setup
from fg_mujoco.racing.result import CarResult, RaceResult
from fg_mujoco.racing.run_folder import write_run
from fg_mujoco.racing.setup import Setup
from fg_mujoco.rollouts.store import of_kind

from ..grid_study import GridKey, GridRow, why_failed
from ..turn import Turn, read_turn, stuck
from .incidents import Incident, incidents_of

BETWEEN = " | "
"""Stands between planners in one text."""


@dataclass(frozen=True, kw_only=True)
class LeagueSettings:
    """The settings that all heats of a league have in common."""

    base: Setup  # of one car: the track and the cars are the heat's
    grid: str
    rules: str

    def manifest(self) -> dict[str, Any]:
        """Return them as they can stand in JSON."""
        own = {name: value for name, value in self.base.described().items() if name not in ("track", "controller")}
        return own | {"grid": self.grid, "rules": self.rules}


@dataclass(frozen=True)
class HeatKey(GridKey):
    """What a heat depends on, but for the settings that all heats have in common and the versions."""

    track: str
    track_sha256: str  # of its definition
    cars: str  # planners in the order of the grid, BETWEEN two
    cars_sha256: str  # of their entries, and of the planners' code
    seed: int | None  # None: nothing depends on one
    planner_files_sha256: str | None = None  # of the files that the planners read; None: they read none

    @property
    def planners(self) -> tuple[str, ...]:
        """The planners in the order of the grid."""
        return tuple(self.cars.split(BETWEEN))

    @property
    def name(self) -> str:
        """Names the files of the heat."""
        words = "-".join((self.track, *self.planners, *([] if self.seed is None else [str(self.seed)])))
        return f"{re.sub(r'[^A-Za-z0-9._-]+', '_', words)[:90]}-{self.sha256[:8]}"


@dataclass(frozen=True, kw_only=True)
class HeatFigures:
    """How a heat went. None: there is no such figure, as of a heat that was not driven to its end."""

    winner: str | None  # None: nobody
    message: str | None  # why it was not driven to its end
    sim_time_s: float | None
    overtakes: int
    contacts: int
    warnings: int
    trajectory_sha256: str | None


@dataclass(frozen=True, kw_only=True)
class CarFigures:
    """How a car fared in a heat."""

    planner: str
    place: int  # on the grid, from 1
    position: int | None  # from 1, of those that finished; None: it did not
    points: int  # cars that it beat
    end_reason: str  # of END_REASONS; empty: the heat ended before its race was over
    message: str | None  # why it did not finish
    laps_completed: int
    best_lap_s: float | None
    time_s: float | None  # when its race was over
    overtakes: int
    contacts: int
    at_fault: int  # contacts that were its fault, alone or with the other car
    warnings: int


@dataclass(frozen=True)
class HeatRow(GridRow):
    """A heat and its figures: one line of heats.jsonl, one row of heats.csv, and a row of results.csv for each car."""

    key: HeatKey
    figures: HeatFigures
    cars: tuple[CarFigures, ...] = ()
    incidents: tuple[Incident, ...] = ()

    def line(self) -> dict[str, Any]:
        """Return all of it, as JSON has it."""
        parts = {name: [asdict(each) for each in getattr(self, name)] for name in ("cars", "incidents")}
        return self.as_dict() | {"of_cars": parts["cars"], "incidents": parts["incidents"]}

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> HeatRow:
        """Return the row that `line` made the values of; errors as `of_kind`."""
        cars = tuple(of_kind(CarFigures, each) for each in values["of_cars"])
        incidents = tuple(Incident.read(each) for each in values["incidents"])
        return replace(super().of(values), cars=cars, incidents=incidents)


@dataclass(frozen=True)
class Heat:
    """A heat to be driven. It travels to a worker process."""

    key: HeatKey
    entries: tuple[Entry, ...]  # in the order of the grid; each name is the planner's
    numbers: tuple[int, ...]  # of the entries in the league: seeds follow from them, wherever a car starts
    settings: LeagueSettings
    mark: str = ""  # path of a file that says whose turn it is
    keep: str = ""  # folder for its run folder; empty: none is kept

    def __str__(self) -> str:
        seed = "" if self.key.seed is None else f", seed {self.key.seed}"
        return f"{' against '.join(self.key.planners)} on {self.key.track}{seed}"

    def setup(self) -> Setup:
        """Return what is raced."""
        entries = tuple(
            replace(entry, seed=opponent_seed(self.key.seed or 0, number, entry.seed))
            for entry, number in zip(self.entries, self.numbers, strict=True)
        )
        settings = self.settings
        return replace(
            settings.base, track=self.key.track, entries=entries, grid=settings.grid, rules=settings.rules
        )  # fmt: skip

    def drive(self) -> HeatRow:
        """Drive it, and return its row. What raises on the way is a heat that failed.

        Raises:
          KeyboardInterrupt: Ctrl-C.
        """
        with Turn(self.mark, self.settings.base.decision_limit) as turn:
            try:
                result = race_setup(self.setup(), turn=turn)
                if any(car.end_reason == "interrupted" for car in result.cars):
                    raise KeyboardInterrupt
                if self.keep:
                    folder = Path(self.keep) / self.key.name
                    shutil.rmtree(folder, ignore_errors=True)  # of a call that ended before it kept the row
                    write_run(result, folder)
            except ControllerError as error:
                return self._ended_by(turn.car, "planner_failed", why_failed(error))
            except Exception as error:
                return self._ended_by(None, "", why_failed(error))
        return HeatRow(self.key, *_figures(result, self.settings.base.decision_limit))

    def died(self, how: str) -> HeatRow:
        """Return the result of a heat whose worker process ended, with how it did in words."""
        said = stuck(how, self.settings.base.decision_limit)
        return self._ended_by(read_turn(self.mark), "worker_died" if said is None else "decision_limit", said or how)

    def _ended_by(self, culprit: int | None, reason: str, message: str) -> HeatRow:
        """Return the result of a heat that a car's planner has ended for all; None: it is not known whose."""
        others = len(self.entries) - 1
        cars = tuple(
            CarFigures(
                planner=planner, place=place + 1,
                position=None if culprit in (None, place) else 1, points=0 if culprit in (None, place) else 1,
                end_reason=reason if place == culprit else "", message=message if place == culprit else None,
                laps_completed=0, best_lap_s=None, time_s=None, overtakes=0, contacts=0, at_fault=0, warnings=0,
            )
            for place, planner in enumerate(self.key.planners)
        )  # fmt: skip
        winner = next((car.planner for car in cars if car.position == 1), None) if others == 1 else None
        said = message if culprit is None else f"{self.key.planners[culprit]}: {message}"
        figures = HeatFigures(
            winner=winner, message=said, sim_time_s=None, overtakes=0, contacts=0, warnings=0, trajectory_sha256=None
        )  # fmt: skip
        return HeatRow(self.key, figures, cars)


def _figures(
    result: RaceResult, limit: float | None
) -> tuple[HeatFigures, tuple[CarFigures, ...], tuple[Incident, ...]]:
    """Return the figures of a heat, of its cars, and its incidents."""
    finished = sum(car.finished for car in result.cars)
    figures = HeatFigures(
        winner=result.winner, message=None, sim_time_s=result.sim_time_s, overtakes=len(result.overtakes),
        contacts=len(result.contacts), warnings=len(result.warnings), trajectory_sha256=result.trajectory_sha256,
    )  # fmt: skip
    cars = tuple(
        CarFigures(
            planner=car.name, place=place, position=car.position if car.finished else None,
            points=len(result.cars) - car.position if car.finished else 0, end_reason=car.end_reason,
            message=_why(car, limit), laps_completed=car.laps_completed,
            best_lap_s=min(car.lap_times_s, default=None), time_s=car.end_time_s,
            overtakes=sum(each.by == car.name for each in result.overtakes), contacts=car.collisions_car,
            at_fault=sum(each.blames(car.name) for each in result.contacts),
            warnings=sum(each.car == car.name for each in result.warnings),
        )
        for place, car in enumerate(result.cars, start=1)
    )  # fmt: skip
    assert all(car.position is None or car.position <= finished for car in cars)  # those that finished come first
    return figures, cars, incidents_of(result)


def _why(car: CarResult, limit: float | None) -> str | None:
    """Return why a car did not finish, in words; None: it did, or its reason says all."""
    if car.end_reason == "decision_limit":
        return decision_limit_text(limit, car.end_time_s)
    found = car.planner_failure or car.crash or car.wrong_way or car.rollover
    return None if found is None else " ".join(str(found).split())


def beaten(cars: Sequence[CarFigures]) -> list[tuple[str, str]]:
    """Return each pair of planners of a heat of which the first beat the second."""
    return [
        (one.planner, other.planner)
        for one in cars
        for other in cars
        if one.position is not None and (other.position is None or other.position > one.position)
    ]
