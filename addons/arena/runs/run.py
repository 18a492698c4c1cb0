"""A run of a study: a race of a planner, what it depends on, and the figures of its car.

The same key and the same versions give the same figures, to the last bit, in any process.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from functools import cached_property, lru_cache
from typing import Any

import mujoco
import numpy as np

from fg_mujoco import from_addons
from fg_mujoco.course.track import Track
from fg_mujoco.errors import ControllerError, SettingsError, TrackError
from fg_mujoco.messages import FloatArray
from fg_mujoco.racing.decision_times import decision_limit_text
from fg_mujoco.racing.entries import Entry
from fg_mujoco.racing.planners import ControllerChoice
from fg_mujoco.racing.race import race_setup
from fg_mujoco.racing.resolved import Ground, ground_of
from fg_mujoco.racing.result import CarResult, RaceResult
from fg_mujoco.racing.setup import OF_A_CAR, Setup
from fg_mujoco.rollouts.store import digest, of_kind
from fg_mujoco.simulation.physics import STATE
from fg_mujoco.simulation.planner_failure import one_line

FAILURES = ("planner_failed", "decision_limit", "interrupted", "worker_died", "not_judged")
"""Ends of runs that are the planner's failure, not the driving's."""

WRONG_WAY_SPEED = 0.1  # [m/s] back along the line; slower is the jitter of a car that stands
TRACE_STEP = 4  # ticks from one point of a trace to the next
_CENTIMETRES = 100.0


@dataclass(frozen=True, kw_only=True)
class Origin:
    """Where the planner of a car comes from."""

    sha256: str | None  # of the user's code; None: it is bundled
    files: dict = field(default_factory=dict)  # type: ignore[type-arg]  # that it reads: their SHA-256 by name


@dataclass(frozen=True, kw_only=True)
class CarFigures:
    """How a car fared. None: there is no such figure, as of a lap time without a lap."""

    end_reason: str  # of END_REASONS, or "failed", "worker_died"
    message: str | None = None  # why it failed, or ended
    success: bool = False  # finished, and touched nothing but, where there are any, cars; of a duel: overtaken
    finished: bool = False
    completion: float = 0.0  # 1 of a car that finished without a touch, else the share of the way that it drove
    laps_completed: int = 0
    laps_requested: int = 0
    first_lap_s: float | None = None
    best_lap_s: float | None = None
    mean_lap_s: float | None = None
    collisions: int = 0  # with walls and obstacles
    max_slide_m_s: float | None = None
    slide_time_fraction: float | None = None
    least_clearance_m: float | None = None  # of the footprint to anything, at any tick; 0 where it touched
    wrong_way_time_s: float | None = None  # in ticks over which the progress fell faster than WRONG_WAY_SPEED
    distance_m: float | None = None  # that the rear axle drove
    mean_speed_m_s: float | None = None
    time_s: float | None = None  # when its race was over
    bound_s: float | None = None  # of a lap, where it is scored, see `lap_bound`
    position: int | None = None  # from 1: by when the cars finished, then by how far they came; None: it drove alone
    overtakes: int | None = None
    overtaken: int | None = None  # how often it was
    contacts: int | None = None  # with cars
    at_fault: int | None = None  # of these, by its own fault, alone or with the other car

    @property
    def score(self) -> float | None:
        """The completion times the bound of a lap over the car's own lap [%], its best, or else one at its pace."""
        if self.bound_s is None:
            return None
        laps = self.completion * self.laps_requested
        own = self.best_lap_s or ((self.time_s or 0.0) / laps if laps else math.inf)
        return 100.0 * self.completion * min(self.bound_s / own, 1.0)


@dataclass(frozen=True, kw_only=True)
class Checked:
    """A check of a planner."""

    number: int  # in the suite, from 0
    name: str
    asked: str
    measured: str
    passed: bool
    of: float  # points that there are

    @property
    def points(self) -> float:
        """That the planner has for it."""
        return self.of if self.passed else 0.0


@dataclass(frozen=True, kw_only=True)
class RunRow:
    """A run and its figures: one line of runs.jsonl, and a row of runs.csv."""

    key: str  # SHA-256 of all that it depends on, but for the versions
    place: Mapping[str, Any]  # what tells it from the others of its study, by the names of columns
    setup: Mapping[str, Any]  # what was raced, as `Setup.read` takes it
    course_sha256: str  # of the course's numbers
    origins: tuple[Origin, ...]  # of the planners of all cars
    car: CarFigures  # the first
    sim_time_s: float | None = None
    trajectory_sha256: str | None = None  # None: it was not driven to its end
    figures: Mapping[str, Any] = field(default_factory=dict)  # others, as of a duel
    checks: tuple[Checked, ...] = ()
    trace: list = field(default_factory=list)  # type: ignore[type-arg]  # x, y [cm] of the rear axle, point by point

    @property
    def planner(self) -> str:
        """What it is called."""
        return str(self.place["planner"])

    @property
    def points(self) -> FloatArray:
        """The trace, (n, 2) [m]."""
        return np.array(self.trace, np.float64).reshape(-1, 2) / _CENTIMETRES

    @property
    def line(self) -> dict[str, Any]:
        """What tables are made of: the place, and all figures by name."""
        of_run = {"score": self.car.score, "sim_time_s": self.sim_time_s, "trajectory_sha256": self.trajectory_sha256}
        return {**self.place, **vars(self.car), **of_run, **self.figures}

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> RunRow:
        """Return the row of a line; errors as `of_kind`."""
        parts: dict[str, Any] = {
            name: tuple(of_kind(kind, each) for each in values[name])
            for name, kind in (("origins", Origin), ("checks", Checked))
        }
        row = cls(**{**values, **parts, "car": of_kind(CarFigures, values["car"])})
        if not all(isinstance(each, Mapping) for each in (row.place, row.setup, row.figures)):
            raise TypeError("no place, setup and figures")
        for value in (*row.place.values(), *row.figures.values()):
            if not isinstance(value, (str, int, float, type(None))):
                raise TypeError(f"place or figures has {type(value).__name__}")
        texts = (row.key, row.course_sha256, row.trajectory_sha256)
        if not all(isinstance(text, (str, type(None))) for text in texts) or "planner" not in row.place:
            raise TypeError("key, trajectory_sha256 or planner is no text")
        assert row.points is not None  # numbers, two by two
        return row


@dataclass(frozen=True, kw_only=True, eq=False)
class Run:
    """A run to be driven. It travels to a worker process."""

    place: Mapping[str, Any]
    setup: Setup  # what is raced; its first car is judged
    course_sha256: str
    origins: tuple[Origin, ...]  # of all cars
    scored: bool = False  # whether its row has the bound of a lap

    def __str__(self) -> str:
        others = {name: value for name, value in self.place.items() if name not in ("planner", "course", "assist")}
        said = "".join(f", {name} {value}" for name, value in others.items() if value is not None)
        return f"{self.place['planner']} on {self.place.get('course', self.setup.track)}{said}"

    @cached_property
    def key(self) -> str:
        """SHA-256 of all that it depends on; the same wherever the planners' files lie."""
        raced = self.setup.described()
        for car in raced.get("entries", [raced]):
            car["controller"] = ControllerChoice.of(car.get("controller", "gap_finder")).label
        return digest(dict(self.place), raced, self.course_sha256, [asdict(each) for each in self.origins])

    def drive(self) -> RunRow:
        """Drive it, and return its row. What raises on the way is a run that failed.

        Raises:
          KeyboardInterrupt: Ctrl-C.
        """
        try:
            result = race_setup(self.setup)
            if any(car.end_reason == "interrupted" for car in result.cars):
                raise KeyboardInterrupt
            return self.row(result)
        except Exception as error:
            return self.failed("planner_failed" if isinstance(error, ControllerError) else "failed", why_failed(error))

    def died(self, how: str) -> RunRow:
        """Return the row of a run whose worker process ended, with how it did in words."""
        return self.failed("worker_died", how)

    def row(self, result: RaceResult, **others: Any) -> RunRow:
        """Return the row of a race that was driven; `others` are fields of it."""
        poses, bound = driven_poses(result), lap_bound(self.setup) if self.scored else None
        return self._row(
            car=car_figures(result, poses, bound), sim_time_s=result.sim_time_s,
            trajectory_sha256=result.trajectory_sha256, trace=_trace(poses), **others,
        )  # fmt: skip

    def failed(self, reason: str, message: str, **others: Any) -> RunRow:
        """Return the row of a run that was not driven to its end."""
        bound = 0.0 if self.scored else None
        return self._row(car=CarFigures(end_reason=reason, message=message, bound_s=bound), **others)

    def _row(self, **others: Any) -> RunRow:
        return RunRow(
            key=self.key, place=self.place, setup=self.setup.described(), course_sha256=self.course_sha256,
            origins=self.origins, **others,
        )  # fmt: skip


def why_failed(error: Exception) -> str:
    """Return the message of a run that failed with an error, in one line."""
    return " ".join(str(error).split()) if isinstance(error, ControllerError) else one_line(error)


def lap_bound(setup: Setup) -> float:
    """Return the bound of a lap's time [s] of the first car on a setup's course, with its friction and greatest speed.

    It is the lap of the raceline. Where there is none, as of a scene, it is the time of the straight way at the
    greatest speed, after a start from rest at the greatest acceleration: L / v + v / (2 a).
    """
    own = {name: getattr(setup.first, name) for name in (*OF_A_CAR, "max_speed")}
    return _lap_bound(Setup(track=setup.track, entries=(Entry(**own),)))


@lru_cache(maxsize=256)
def _lap_bound(setup: Setup) -> float:
    course, car = ground_of(setup).course, setup.first.car.parameters
    if isinstance(course, Track) and course.closed:
        try:
            return from_addons.make_raceline(setup).lap_time
        except (SettingsError, TrackError):  # too narrow, too long, or the solver does not converge
            pass
    speed = min(setup.first.max_speed, car.max_speed)
    return course.length / speed + 0.5 * speed / car.max_acceleration


def car_figures(result: RaceResult, poses: FloatArray, bound: float | None) -> CarFigures:
    """Return the figures of the first car of a race.

    Args:
      result: of the race.
      poses: as of `driven_poses`.
      bound: of its lap time [s], if it is to be scored.
    """
    car, world, course = result.car, result.world, result.world.track
    assert course is not None
    laps, progress = car.lap_times_s, car.column("progress_m")
    success = car.finished and car.collisions_wall == 0
    share = float(progress[-1]) / (course.length * result.laps_requested) if len(progress) else 0.0
    times = np.append(car.column("time_s"), result.sim_time_s)[: len(poses)]
    ground, among = Ground(course, world.obstacles[len(course.obstacles) :]), dict[str, Any]()
    if len(result.cars) > 1:
        among = {
            "position": car.position, "overtakes": sum(each.by == car.name for each in result.overtakes),
            "overtaken": sum(each.of == car.name for each in result.overtakes), "contacts": car.collisions_car,
            "at_fault": sum(each.blames(car.name) for each in result.contacts),
        }  # fmt: skip
    return CarFigures(
        end_reason=car.end_reason, message=_why(car, result.setup.decision_limit), success=success,
        finished=car.finished, completion=1.0 if success else min(max(share, 0.0), 1.0),
        laps_completed=car.laps_completed, laps_requested=result.laps_requested,
        first_lap_s=laps[0] if laps else None, best_lap_s=min(laps, default=None),
        mean_lap_s=statistics.fmean(laps) if laps else None, collisions=car.collisions_wall,
        max_slide_m_s=_known(car.max_slide_m_s), slide_time_fraction=_known(car.slide_time_fraction),
        mean_speed_m_s=car.mean_speed_m_s, time_s=car.end_time_s, bound_s=bound,
        least_clearance_m=0.0 if car.collisions_wall else ground.least_clearance(times, poses, world.parameters),
        wrong_way_time_s=wrong_way_time(times, np.append(progress, np.nan)[: len(poses)]),
        distance_m=float(np.hypot(*np.diff(poses[:, :2], axis=0).T).sum()), **among,
    )  # fmt: skip


def _trace(poses: FloatArray) -> list[int]:
    """Return the trace of a row."""
    points = np.concatenate((poses[:-1:TRACE_STEP, :2], poses[-1:, :2]))
    found: list[int] = np.rint(_CENTIMETRES * points).astype(int).ravel().tolist()
    return found


def _known(value: float) -> float | None:
    """Return a figure, or None where it is NaN."""
    return None if math.isnan(value) else value


def _why(car: CarResult, limit: float | None) -> str | None:
    """Return why a car did not finish, in words; None: it did, or its reason says all."""
    if car.end_reason == "decision_limit":
        return decision_limit_text(limit, car.end_time_s)
    found = car.planner_failure or car.crash or car.wrong_way or car.rollover
    return None if found is None else " ".join(str(found).split())


def driven_poses(result: RaceResult) -> FloatArray:
    """Return x [m], y [m], heading [rad] of car 0's rear axle at the start of each tick and at the end, (ticks + 1, 3).

    Of several cars they end with the start of its last tick: a car that has finished is taken off the course.
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
