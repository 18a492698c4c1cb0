"""One run of a comparison: a controller, a course and a seed; what it depends on, and its figures.

A run is a row of text and numbers. The same key and the same versions give the same figures, to the last bit, in any
process.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import mujoco
import numpy as np

from fg_mujoco.course.course import USUAL_LAPS
from fg_mujoco.messages import FloatArray
from fg_mujoco.racing.entries import Entry
from fg_mujoco.racing.opponents import AMONG_CARS, AmongCars, Opponents
from fg_mujoco.racing.planners import ControllerChoice
from fg_mujoco.racing.race import race_setup
from fg_mujoco.racing.resolved import Ground
from fg_mujoco.racing.result import RaceResult
from fg_mujoco.racing.setup import Setup
from fg_mujoco.rollouts.store import of_kind
from fg_mujoco.simulation.physics import STATE
from fg_mujoco.simulation.settings import FASTEST, DriveSettings, Start
from fg_mujoco.vehicle.vehicle import Vehicle

from ..grid_study import GridKey, GridRow, figures_of, why_failed
from .ground import course_ground, laps_of

WRONG_WAY_SPEED = 0.1  # [m/s] back along the line; slower is the jitter of a car that stands
TRACE_STEP = 2  # ticks from one pose of a trace to the next


@dataclass(frozen=True, kw_only=True)
class ComparisonSettings:
    """What all runs of a comparison have in common."""

    base: Setup  # of one car, with its number of laps; planner, course, speed and seed are the run's
    opponents: Opponents = field(default_factory=Opponents)  # that the car of each run races against
    rules: str = "none"  # of race control among them

    @property
    def car(self) -> Vehicle:
        """The vehicle of each run."""
        return self.base.first.car

    @property
    def laps(self) -> int:
        """Laps on tracks; a scene is driven once."""
        return USUAL_LAPS if self.base.laps is None else self.base.laps

    def drive(self, *, max_speed: float = FASTEST) -> DriveSettings:
        """Return the settings of a run, without those of its planner."""
        return replace(self.base.drive_settings, max_speed=max_speed)

    def manifest(self) -> dict[str, Any]:
        """Return them as they can stand in JSON; `of` reads them back."""
        own = {name: value for name, value in self.base.described().items() if name not in ("track", "controller")}
        rules = {} if self.rules == "none" else {"rules": self.rules}
        return own | {"laps": self.laps} | self.opponents.described() | rules

    @classmethod
    def of(cls, description: Mapping[str, Any]) -> ComparisonSettings:
        """Return the settings that `manifest` described; errors are those of `Setup.read`."""
        own = {name: value for name, value in description.items() if name not in ("opponents", "grid", "rules")}
        base = Setup.read({name: value for name, value in own.items() if value is not None})
        return cls(base=base, opponents=Opponents.read(description), rules=description.get("rules", "none"))


@dataclass(frozen=True)
class RunKey(GridKey):
    """What a run depends on, but for the settings that all runs have in common and the versions."""

    controller: str
    controller_sha256: str | None  # of a user's file
    course: str
    course_sha256: str | None  # of the course's definition
    max_speed_m_s: float
    seed: int | None  # None: nothing depends on one
    controller_files_sha256: str | None = None  # of the files that the planner reads; None: it reads none


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
class RunRow(GridRow):
    """A run and its figures: one line of runs.jsonl, one row of runs.csv."""

    key: RunKey
    figures: RunFigures
    among: AmongCars | None = None  # None: there were no opponents, or the run failed

    def as_dict(self) -> dict[str, Any]:
        """Return key and figures in one, as JSON has them."""
        return super().as_dict() | (asdict(self.among) if self.among is not None else {})

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> RunRow:
        """Return the row that `as_dict` made the values of; errors as `of_kind`."""
        among = of_kind(AmongCars, values) if AMONG_CARS[0] in values else None
        return replace(super().of(values), among=among)


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
            return self._failed(why_failed(error), "failed")
        if result.car.end_reason == "interrupted":
            raise KeyboardInterrupt
        poses = driven_poses(result)
        trace = np.concatenate((poses[:-1:TRACE_STEP], poses[-1:]))
        return RunRow(self.key, run_figures(result, poses, self.ground()), _among(result)), trace

    def died(self, how: str) -> tuple[RunRow, FloatArray]:
        """Return what `drive` would, of a run whose worker process ended, with how it did in words."""
        return self._failed(how, "worker_died")

    def _failed(self, message: str, reason: str) -> tuple[RunRow, FloatArray]:
        laps = laps_of(self.ground().course, self.settings.laps)
        figures = figures_of(
            RunFigures, success=False, end_reason=reason, message=message, laps_completed=0, laps_requested=laps,
            collisions=0,
        )  # fmt: skip
        return RunRow(self.key, figures), np.empty((0, 3))

    def ground(self) -> Ground:
        """Return what it is driven on."""
        base, car = self.settings.base, self.settings.car.parameters
        start = (base.first.start or Start()).s
        return course_ground(self.course, self.key.seed, base.obstacles, car=car, moving=base.moving, start=start)

    def setup(self) -> Setup:
        """Return what is raced.

        Raises:
          SettingsError: a car that stands in a wall, in an obstacle or in another car.
        """
        ground, base, opponents = self.ground(), self.settings.base, self.settings.opponents
        first = replace(
            base.first, controller=self.controller.source, planner_settings=dict(self.controller.settings),
            max_speed=self.key.max_speed_m_s, seed=self.key.seed or 0,
        )  # fmt: skip
        entries: tuple[Entry, ...] = (first,)
        if opponents.entries:
            entries = opponents.line_up(ground.course, first, ground.boxes)
        return replace(
            base, track=ground.course, entries=entries, laps=laps_of(ground.course, self.settings.laps),
            obstacles=ground.boxes, moving="", grid=opponents.grid, rules=self.settings.rules,
        )  # fmt: skip

    def race(self) -> RaceResult:
        """Drive it, and return the whole result."""
        return race_setup(self.setup())


def _among(result: RaceResult) -> AmongCars | None:
    """Return how car 0 of a race fared among the others; None: it drove alone."""
    if len(result.cars) == 1:
        return None
    return AmongCars.of(
        position=result.car.position, overtakes=result.overtakes, contacts=result.contacts, winner=result.winner
    )


def run_figures(result: RaceResult, poses: FloatArray, ground: Ground) -> RunFigures:
    """Return the figures of car 0 in a race, with its `driven_poses` and what it was driven on."""
    car = result.car
    laps = car.lap_times_s
    times = np.append(car.column("time_s"), result.sim_time_s)[: len(poses)]
    return RunFigures(
        success=car.finished and car.collisions_wall == 0,
        end_reason=car.end_reason,
        message=None if car.planner_failure is None else str(car.planner_failure),
        laps_completed=car.laps_completed,
        laps_requested=result.laps_requested,
        first_lap_s=laps[0] if laps else None,
        best_lap_s=min(laps, default=None),
        mean_lap_s=statistics.fmean(laps) if laps else None,
        collisions=car.collisions_wall,
        max_slide_m_s=car.max_slide_m_s,
        slide_time_fraction=car.slide_time_fraction,
        least_clearance_m=0.0 if car.collisions_wall else ground.least_clearance(times, poses, result.world.parameters),
        wrong_way_time_s=wrong_way_time(times, np.append(car.column("progress_m"), math.nan)[: len(poses)]),
        distance_m=float(np.hypot(*np.diff(poses[:, :2], axis=0).T).sum()),
        mean_speed_m_s=car.mean_speed_m_s,
        sim_time_s=result.sim_time_s,
        trajectory_sha256=result.trajectory_sha256,
    )


def driven_poses(result: RaceResult) -> FloatArray:
    """Return x [m], y [m], heading [rad] of the rear axle at the start of each tick and at the end, (ticks + 1, 3).

    Of several cars they are car 0's, to the start of its last tick: a car that has finished is taken off the course.
    """
    rows = np.column_stack([result.car.column(name) for name in ("x_m", "y_m", "heading_rad")])
    if len(result.cars) > 1:
        return rows[result.car.column("time_s") < result.car.end_time_s - 0.5 * result.world.lidar.beams.period]
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
