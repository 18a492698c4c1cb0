"""The input of a report: a run folder, a Run or a RaceResult, read into the same fields."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import mujoco

from ...errors import RunFolderError
from ...messages import CarParameters, FloatArray
from ...racing.crash import Crash
from ...racing.resimulation import load_world
from ...racing.result import RaceResult, tires_model
from ...racing.rollover import Rollover
from ...racing.run_folder import RECORDED, SUMMARY, Run, read_run, summary_json
from ...simulation.cars import CAR_PREFIX
from ...simulation.telemetry import TELEMETRY
from ...simulation.termination import WrongWay
from ...vehicle.car import car_parameters


@dataclass(frozen=True, kw_only=True, eq=False)
class RecordedRun:
    """A race as it was recorded."""

    source: str  # a folder, or what else it was read from
    summary: dict[str, Any] = field(repr=False)  # as in summary.json
    telemetry: FloatArray = field(repr=False)  # (ticks, len(TELEMETRY))
    model: mujoco.MjModel = field(repr=False)  # of its world
    others: tuple[FloatArray, ...] = field(default=(), repr=False)  # telemetry of the other cars; all else is of car 0

    def column(self, name: str) -> FloatArray:
        """Return one column of the telemetry, shape (ticks,)."""
        return self.telemetry[:, TELEMETRY.index(name)]

    @property
    def mu(self) -> float:
        """Friction coefficient of the tires [-]."""
        return float(self.summary["mu"])

    @property
    def tires_model(self) -> str:
        """Model of the tires."""
        return tires_model(self.summary)

    @property
    def lap_times(self) -> tuple[float, ...]:
        """Of the laps that were completed [s]."""
        return tuple(float(time) for time in self.summary["lap_times_s"])

    @property
    def end(self) -> float:
        """Simulated time at the end [s]."""
        return float(self.summary["sim_time_s"])

    @property
    def wrong_way(self) -> WrongWay | None:
        """Where the car turned; None: the race did not end by going the wrong way."""
        told = self.summary.get("wrong_way")  # older runs lack it
        return None if told is None else WrongWay(**told)

    @property
    def planner_failure(self) -> dict[str, Any] | None:
        """How the planner failed, as in summary.json; None: it did not."""
        told: dict[str, Any] | None = self.summary.get("planner_failure")  # older runs lack it
        return told

    @property
    def crash(self) -> Crash | None:
        """What the car hit; None: the race did not end in a crash."""
        told = self.summary.get("crash")  # older runs lack it
        return None if told is None else Crash(**told)

    @property
    def rollover(self) -> Rollover | None:
        """Where the car rolled over; None: the race did not end so, or was one of several cars."""
        return None if self.others else Rollover.of(self.summary["end_reason"], self.telemetry)

    @cached_property
    def car(self) -> CarParameters:
        """Of the car that was raced."""
        return car_parameters(self.model, CAR_PREFIX)


_NEEDED = (
    "track", "controller", "laps_requested", "laps_completed", "finished", "end_reason", "lap_times_s", "collisions",
    "max_slide_m_s", "slide_time_fraction", "mean_speed_m_s", "max_speed_m_s", "sim_time_s", "mu", "speed_limit_m_s",
    "trajectory_sha256",
)  # fmt: skip
"""What a report is made of."""
_OF_TIRES = ("max_slide_m_s", "slide_time_fraction")  # of a run that a car recorded, not known


def read_recorded(source: RaceResult | Run | str | Path) -> RecordedRun:
    """Return a race to be reported.

    Raises:
      RunFolderError: a folder that is none of `race --out`, lacks a file, or is of another version.
    """
    if isinstance(source, RaceResult):
        return RecordedRun(
            source=f"{source.track}, {source.car.controller}", summary=json.loads(summary_json(source)),
            telemetry=source.car.telemetry, model=source.world.model,
            others=tuple(car.telemetry for car in source.cars[1:]),
        )  # fmt: skip
    run = source if isinstance(source, Run) else read_run(source)
    unknown = _OF_TIRES if run.summary.get("end_reason") == RECORDED else ()
    missing = [name for name in _NEEDED if run.summary.get(name) is None and name not in unknown]
    if missing:
        raise RunFolderError(
            f"{run.folder / SUMMARY}: has no {', '.join(missing)}; accepted: as this version's `race --out` wrote it"
        )
    model = load_world(run).model
    return RecordedRun(
        source=str(run.folder), summary=run.summary, telemetry=run.telemetry, model=model, others=run.others
    )  # fmt: skip
