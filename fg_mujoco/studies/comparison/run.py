"""One run of a comparison: a controller, a course and a seed; what it depends on, and its figures.

A run is a row of text and numbers. The same key and the same versions give the same figures, to the last bit, in any
process.
"""

from __future__ import annotations

import hashlib
import math
import statistics
from collections.abc import Mapping
from dataclasses import asdict, astuple, dataclass, field, fields, replace
from typing import Any

import mujoco
import numpy as np

from ...errors import ControllerError, PlannerError
from ...lidar.effects import LidarEffects
from ...messages import FloatArray, require_whole
from ...racing.entries import Entry
from ...racing.opponents import AMONG_CARS, AmongCars, Opponents, entry_of
from ...racing.planner_choice import ControllerChoice
from ...racing.race import race, require_decision_limit
from ...racing.result import RaceResult
from ...simulation.physics import STATE
from ...simulation.planner_failure import one_line
from ...simulation.settings import FASTEST, CarSettings, DriveSettings, require_laps, require_time_limit
from ..store import of_kind
from .ground import Ground, course_ground, laps_of

_OF_THE_CAR = ("vehicle", "vehicle_sha256", "tires", "mu", "changes", "planner_mu")  # in a manifest

WRONG_WAY_SPEED = 0.1  # [m/s] back along the line; slower is the jitter of a car that stands
TRACE_STEP = 2  # ticks from one pose of a trace to the next


@dataclass(frozen=True, kw_only=True, repr=False)
class ComparisonSettings(CarSettings):
    """What all runs of a comparison have in common.

    Raises:
      SettingsError: a value outside what is accepted.
      ModelError: a file that is not that of a vehicle.
    """

    laps: int = 5  # on tracks; a scene is driven once
    obstacles: int = 0  # boxes on each track, at places drawn from the seed
    lidar_noise: float = 0.0  # [m] standard deviation of each range, drawn from the seed
    planner_mu: float | None = None  # that planners assume; None: that of the tires; inf: no friction limits
    time_limit: float | None = None  # [s] of a run; None: as `race` has it
    decision_limit: float | None = None  # [s] of wall time for a decision; None: any
    opponents: Opponents = field(default_factory=Opponents)  # that the car of each run races against

    def __post_init__(self) -> None:
        super().__post_init__()
        require_laps(self.laps)
        require_whole("obstacles", self.obstacles, 0)
        require_time_limit(self)
        require_decision_limit(self)
        self.drive()  # refuses the others

    def drive(self, *, max_speed: float = FASTEST, seed: int = 0) -> DriveSettings:
        """Return the settings of a run, without those of its planner."""
        return DriveSettings(
            vehicle=self.vehicle, tires=self.tires, patches=self.patches, mu=self.mu, changes=self.changes,
            planner_mu=self.planner_mu, max_speed=max_speed, seed=seed,
            effects=LidarEffects(range_noise_std=self.lidar_noise),
        )  # fmt: skip

    def manifest(self) -> dict[str, Any]:
        """Return them as they can stand in JSON; `of` reads them back."""
        always = ("laps", "obstacles", "lidar_noise", "mu", "planner_mu", "time_limit", "decision_limit")
        alone = replace(self, opponents=Opponents())
        told = {} if self.all_changes.mu is None else {"planner_mu": self.drive().described()["planner_mu"]}
        own = {name: getattr(self, name) for name in always} | alone.described() | told
        return own | self.opponents.described()

    @classmethod
    def of(cls, description: Mapping[str, Any]) -> ComparisonSettings:
        """Return the settings that `manifest` told of; errors as of CarSettings."""
        alone = {name: value for name, value in description.items() if name not in ("opponents", "grid")}
        settings = super().of(alone)
        drive = {name: value for name, value in alone.items() if name in _OF_THE_CAR and value is not None}
        told = DriveSettings.of(drive).planner_mu
        return replace(settings, planner_mu=told, opponents=Opponents.read(description))


@dataclass(frozen=True)
class RunKey:
    """What a run depends on, but for the settings that all runs have in common and the versions."""

    controller: str
    controller_sha256: str | None  # of a user's file
    course: str
    course_sha256: str | None  # of the course's definition
    max_speed_m_s: float
    seed: int | None  # None: nothing depends on one
    controller_files_sha256: str | None = None  # of the files that the planner reads; None: it reads none

    @property
    def sha256(self) -> str:
        """Names the files of the run; of a planner that reads none as in versions that did not ask for them."""
        values = astuple(self)
        return hashlib.sha256(repr(values if values[-1] is not None else values[:-1]).encode()).hexdigest()


@dataclass(frozen=True, kw_only=True)
class RunFigures:
    """How a run went. None: there is no such figure, as of a lap time without a lap, or of a planner that failed."""

    success: bool  # finished, and touched nothing but, where there are any, cars
    end_reason: str  # of END_REASONS
    message: str | None  # why it failed
    laps_completed: int
    laps_requested: int
    first_lap_s: float | None
    best_lap_s: float | None
    mean_lap_s: float | None
    collisions: int
    max_slide_m_s: float | None
    slide_time_fraction: float | None
    least_clearance_m: float | None  # of the footprint to anything, at any tick; 0 where it touched
    wrong_way_time_s: float | None  # in ticks over which the progress fell faster than WRONG_WAY_SPEED
    distance_m: float | None  # that the rear axle drove
    mean_speed_m_s: float | None
    sim_time_s: float | None
    trajectory_sha256: str | None


@dataclass(frozen=True)
class RunRow:
    """A run and its figures: one line of runs.jsonl, one row of runs.csv."""

    key: RunKey
    figures: RunFigures
    among: AmongCars | None = None  # None: there were no opponents, or the run failed

    def as_dict(self) -> dict[str, Any]:
        """Return key and figures in one, as JSON has them."""
        return asdict(self.key) | asdict(self.figures) | (asdict(self.among) if self.among is not None else {})

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> RunRow:
        """Return the row that `as_dict` made the values of.

        Raises:
          KeyError: a value is missing.
          TypeError: a value is of another kind than its field.
        """
        among = of_kind(AmongCars, values) if AMONG_CARS[0] in values else None
        return cls(of_kind(RunKey, values), of_kind(RunFigures, values), among)


@dataclass(frozen=True)
class Run:
    """A run to be driven. It travels to a worker process."""

    key: RunKey
    controller: ControllerChoice
    course: str  # as `course_ground` takes it
    settings: ComparisonSettings

    def __str__(self) -> str:
        seed = "" if self.key.seed is None else f", seed {self.key.seed}"
        return f"{self.key.controller} on {self.key.course}{seed}"

    def drive(self) -> tuple[RunRow, FloatArray]:
        """Drive it and return its row and its trace: x [m], y [m], heading [rad] of the rear axle, shape (n, 3).

        What raises on the way is a run that failed.

        Raises:
          KeyboardInterrupt: Ctrl-C.
        """
        try:
            result = self.race()
        except Exception as error:
            text = " ".join(str(error).split()) if isinstance(error, ControllerError) else one_line(error)
            return self._failed(text, "planner_failed" if isinstance(error, PlannerError) else "failed")
        if result.end_reason == "interrupted":
            raise KeyboardInterrupt
        poses = driven_poses(result)
        trace = np.concatenate((poses[:-1:TRACE_STEP], poses[-1:]))
        return RunRow(self.key, run_figures(result, poses, self.ground()), _among(result)), trace

    def died(self, how: str) -> tuple[RunRow, FloatArray]:
        """Return what `drive` would, of a run whose worker process ended, with how it did in words."""
        return self._failed(how, "worker_died")

    def _failed(self, message: str, reason: str) -> tuple[RunRow, FloatArray]:
        laps = laps_of(self.ground().course, self.settings.laps)
        return RunRow(self.key, _failed(message, reason, laps)), np.empty((0, 3))

    def ground(self) -> Ground:
        """Return what it is driven on."""
        return course_ground(self.course, self.key.seed, self.settings.obstacles, car=self.settings.car.parameters)

    def line_up(self) -> tuple[Entry, ...]:
        """Return the cars of a run with opponents, each with its start.

        Raises:
          SettingsError: a car that stands in a wall, in an obstacle or in another car.
        """
        drive = self.settings.drive(max_speed=self.key.max_speed_m_s, seed=self.key.seed or 0)
        own = replace(drive, planner_settings=dict(self.controller.settings))
        ground = self.ground()
        return self.settings.opponents.line_up(ground.course, entry_of(own, self.controller.source), ground.boxes)

    def race(self) -> RaceResult:
        """Drive it, and return the whole result."""
        shared, ground = self.settings, self.ground()
        drive = shared.drive(max_speed=self.key.max_speed_m_s, seed=self.key.seed or 0)
        if shared.opponents.entries:
            return race(
                ground.course,
                laps=laps_of(ground.course, shared.laps),
                patches=drive.patches,
                time_limit=shared.time_limit,
                decision_limit=shared.decision_limit,
                obstacles=ground.boxes,
                entries=self.line_up(),
            )
        return race(
            ground.course,
            self.controller.source,
            laps=laps_of(ground.course, shared.laps),
            vehicle=drive.car,
            tires=drive.tires,
            patches=drive.patches,
            mu=drive.mu,
            changes=drive.changes,
            planner_mu=drive.planner_mu,
            max_speed=drive.max_speed,
            seed=drive.seed,
            time_limit=shared.time_limit,
            decision_limit=shared.decision_limit,
            obstacles=ground.boxes,
            effects=drive.effects,
            planner_settings=dict(self.controller.settings),
        )


def _among(result: RaceResult) -> AmongCars | None:
    """Return how car 0 of a race fared among the others; None: it drove alone."""
    if not result.car_results:
        return None
    return AmongCars.of(
        position=result.car_results[0].position, overtakes=result.overtakes, contacts=result.contacts,
        winner=result.winner,
    )  # fmt: skip


def run_figures(result: RaceResult, poses: FloatArray, ground: Ground) -> RunFigures:
    """Return the figures of car 0 in a race, with its `driven_poses` and what it was driven on."""
    laps = result.lap_times_s
    times = np.append(result.column("time_s"), result.sim_time_s)[: len(poses)]
    return RunFigures(
        success=result.finished and result.collisions == 0,
        end_reason=result.end_reason,
        message=None,
        laps_completed=result.laps_completed,
        laps_requested=result.laps_requested,
        first_lap_s=laps[0] if laps else None,
        best_lap_s=min(laps, default=None),
        mean_lap_s=statistics.fmean(laps) if laps else None,
        collisions=result.collisions,
        max_slide_m_s=result.max_slide_m_s,
        slide_time_fraction=result.slide_time_fraction,
        least_clearance_m=0.0 if result.collisions else ground.least_clearance(times, poses, result.world.parameters),
        wrong_way_time_s=wrong_way_time(times, np.append(result.column("progress_m"), math.nan)[: len(poses)]),
        distance_m=float(np.hypot(*np.diff(poses[:, :2], axis=0).T).sum()),
        mean_speed_m_s=result.mean_speed_m_s,
        sim_time_s=result.sim_time_s,
        trajectory_sha256=result.trajectory_sha256,
    )


def driven_poses(result: RaceResult) -> FloatArray:
    """Return x [m], y [m], heading [rad] of the rear axle at the start of each tick and at the end, (ticks + 1, 3).

    Of several cars they are car 0's, to the start of its last tick: a car that has finished is taken off the course.
    """
    rows = np.column_stack([result.column(name) for name in ("x_m", "y_m", "heading_rad")])
    if result.car_results:
        return rows[result.column("time_s") < result.car_results[0].end_time_s - 0.5 * result.world.lidar.beams.period]
    data = mujoco.MjData(result.world.model)
    mujoco.mj_setState(result.world.model, data, result.states[-1], STATE)
    return np.concatenate((rows, [result.world.car.pose(data)]))


def wrong_way_time(time: FloatArray, progress: FloatArray) -> float:
    """Return how long a car drove the wrong way [s]: the ticks over which its progress fell by WRONG_WAY_SPEED or more.

    Args:
      time: of the starts of the ticks (n,) [s].
      progress: along the course's line at these times (n,) [m].
    """
    ticks = np.diff(time)
    return float(ticks[np.diff(progress) < -WRONG_WAY_SPEED * ticks].sum())


def _failed(message: str, reason: str, laps: int) -> RunFigures:
    none = {field.name: None for field in fields(RunFigures)}
    given = {"success": False, "end_reason": reason, "message": message}
    return RunFigures(**none | given | {"laps_completed": 0, "laps_requested": laps, "collisions": 0})  # type: ignore[arg-type]
