"""A run of a study: a race of planners, what it depends on, and the figures of its cars.

The same key and the same versions give the same figures, to the last bit, in any process, but for decision times.
"""

from __future__ import annotations

import math
import re
import shutil
import statistics
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from fg_mujoco.errors import ControllerError
from fg_mujoco.messages import FloatArray
from fg_mujoco.racing.decision_times import decision_limit_text
from fg_mujoco.racing.planners import ControllerChoice
from fg_mujoco.racing.race import race_setup
from fg_mujoco.racing.resolved import Ground
from fg_mujoco.racing.result import CarResult, RaceResult
from fg_mujoco.racing.run_folder import write_run
from fg_mujoco.racing.setup import Setup
from fg_mujoco.rollouts.store import digest, of_kind
from fg_mujoco.simulation.physics import STATE
from fg_mujoco.simulation.planner_failure import one_line

from .incidents import Incident, incidents_of
from .turn import Turn, read_turn, stuck

FAILURES = ("planner_failed", "decision_limit", "worker_died")
"""Ends of races that are the planner's failure, not the driving's."""

WRONG_WAY_SPEED = 0.1  # [m/s] back along the line; slower is the jitter of a car that stands
TRACE_STEP = 2  # ticks from one pose of a trace to the next
_MILLIMETRES = 1000.0


@dataclass(frozen=True, kw_only=True)
class Origin:
    """Where the planner of a car comes from."""

    sha256: str | None  # of the user's code; None: it is bundled
    files: dict = field(default_factory=dict)  # type: ignore[type-arg]  # that it reads: their SHA-256 by name


@dataclass(frozen=True, kw_only=True)
class CarFigures:
    """How a car fared. None: there is no such figure, as of a lap time without a lap."""

    planner: str
    end_reason: str  # of END_REASONS, or "failed", "worker_died"; empty: the run ended before the car's race
    message: str | None = None  # why it failed, or ended
    success: bool = False  # finished, and touched nothing but, where there are any, cars
    finished: bool = False
    completion: float = 0.0  # 1 of a success, else the share of the way that the car drove
    laps_completed: int = 0
    laps_requested: int = 0
    first_lap_s: float | None = None
    best_lap_s: float | None = None
    mean_lap_s: float | None = None
    collisions: int = 0  # with walls and obstacles
    max_slide_m_s: float | None = None
    slide_time_fraction: float | None = None
    least_clearance_m: float | None = None  # of the footprint to anything, at any tick; 0 where it touched; of one car
    wrong_way_time_s: float | None = None  # in ticks over which the progress fell faster than WRONG_WAY_SPEED
    distance_m: float | None = None  # that the rear axle drove
    mean_speed_m_s: float | None = None
    time_s: float | None = None  # when its race was over
    decision_ms: float | None = None  # of wall time, 99 % of the decisions are quicker; where it is asked for
    started: int | None = None  # place on the grid, from 1; this and the next are None of a car that drives alone
    position: int | None = None  # from 1: by when the cars finished, then by how far they came
    points: int | None = None  # cars that it beat
    overtakes: int | None = None
    overtaken: int | None = None  # how often it was
    contacts: int | None = None  # with cars
    at_fault: int | None = None  # of these, by its own fault, alone or with the other car
    warnings: int | None = None


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
    """A run and its figures: one line of runs.jsonl, and a row of runs.csv for each car that is judged."""

    key: str  # SHA-256 of all that it depends on, but for the versions
    place: Mapping[str, Any]  # what tells it from the others of its study, by the names of columns
    setup: Mapping[str, Any]  # what was raced, as `Setup.read` takes it
    course_sha256: str  # of the course's numbers
    origins: tuple[Origin, ...]  # of the planners of all cars
    cars: tuple[CarFigures, ...]  # that are judged
    message: str | None = None  # why it was not driven to its end
    sim_time_s: float | None = None
    trajectory_sha256: str | None = None
    winner: str | None = None
    figures: Mapping[str, Any] = field(default_factory=dict)  # others, as of a duel
    incidents: tuple[Incident, ...] = ()
    checks: tuple[Checked, ...] = ()
    picture: str = ""  # SVG
    trace: list = field(default_factory=list)  # type: ignore[type-arg]  # x [mm], y [mm], heading [mrad] of each pose

    @property
    def car(self) -> CarFigures:
        """The first car."""
        return self.cars[0]

    @property
    def poses(self) -> FloatArray:
        """The trace: x [m], y [m], heading [rad] of the rear axle, (n, 3)."""
        return np.array(self.trace, np.float64).reshape(-1, 3) / _MILLIMETRES

    @property
    def name(self) -> str:
        """Names the files of the run."""
        words = "-".join(str(value) for value in self.place.values() if value is not None)
        return f"{re.sub(r'[^A-Za-z0-9._-]+', '_', words)[:90]}-{self.key[:8]}"

    def lines(self) -> list[dict[str, Any]]:
        """Return what tables are made of: for each car the place, and all figures by name."""
        of_run = {name: getattr(self, name) for name in ("sim_time_s", "trajectory_sha256", "winner")}
        if len(self.cars) > 1:
            of_run["run"] = self.name
        return [{**self.place, **vars(car), **of_run, **self.figures} for car in self.cars]

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> RunRow:
        """Return the row of a line; errors as `of_kind`."""
        kinds = {"origins": Origin, "cars": CarFigures, "incidents": Incident, "checks": Checked}
        parts: dict[str, Any] = {
            name: tuple(of_kind(kind, each) for each in values[name]) for name, kind in kinds.items()
        }
        row = cls(**{**values, **parts})
        if not row.cars or not all(isinstance(each, Mapping) for each in (row.place, row.setup, row.figures)):
            raise TypeError("no place, setup, cars and figures")
        for value in (*row.place.values(), *row.figures.values()):
            if not isinstance(value, (str, int, float, type(None))):
                raise TypeError(f"place or figures has {type(value).__name__}")
        texts = (row.key, row.course_sha256, row.picture, row.message, row.trajectory_sha256, row.winner)
        if not all(isinstance(text, (str, type(None))) for text in texts):
            raise TypeError("key, picture, message, trajectory_sha256 or winner is no text")
        assert row.poses is not None  # numbers, three by three
        return row


@dataclass(frozen=True, kw_only=True, eq=False)
class Run:
    """A run to be driven. It travels to a worker process."""

    place: Mapping[str, Any]
    setup: Setup  # what is raced; its first cars are judged
    planners: tuple[str, ...]  # what those of these cars are called
    course_sha256: str
    origins: tuple[Origin, ...]  # of all cars
    traced: bool = False  # whether its row has a trace
    timed: bool = False  # whether its row has decision times
    mark: str = ""  # path of a file that says whose turn it is
    keep: str = ""  # folder for its run folder; empty: none is kept

    def __str__(self) -> str:
        others = {name: value for name, value in self.place.items() if name not in ("planner", "course")}
        said = "".join(f", {name} {value}" for name, value in others.items() if value is not None)
        return f"{' against '.join(self.planners)} on {self.place.get('course', self.setup.track)}{said}"

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
        with Turn(self.mark, self.setup.decision_limit) as turn:
            try:
                result = race_setup(self.setup, turn=turn)
                if any(car.end_reason == "interrupted" for car in result.cars):
                    raise KeyboardInterrupt
                if self.keep:
                    folder = Path(self.keep) / self._row(cars=()).name
                    shutil.rmtree(folder, ignore_errors=True)  # of a call that ended before it kept the row
                    write_run(result, folder)
                return self.row(result)
            except Exception as error:
                of_planner = isinstance(error, ControllerError)
                return self.failed("planner_failed" if of_planner else "failed", why_failed(error), turn.car)

    def died(self, how: str) -> RunRow:
        """Return the row of a run whose worker process ended, with how it did in words."""
        said = stuck(how, self.setup.decision_limit)
        return self.failed("worker_died" if said is None else "decision_limit", said or how, read_turn(self.mark))

    def row(self, result: RaceResult, **others: Any) -> RunRow:
        """Return the row of a race that was driven; `others` are fields of it."""
        poses = driven_poses(result)
        of_way = poses if len(self.planners) == 1 else None
        cars = tuple(
            car_figures(result, place, planner, of_way, timed=self.timed) for place, planner in enumerate(self.planners)
        )
        trace = np.concatenate((poses[:-1:TRACE_STEP], poses[-1:])) if self.traced else np.empty((0, 3))
        return self._row(
            cars=cars, sim_time_s=result.sim_time_s, trajectory_sha256=result.trajectory_sha256, winner=result.winner,
            incidents=incidents_of(result) if len(self.planners) > 1 else (),
            trace=np.rint(_MILLIMETRES * trace).astype(int).ravel().tolist(), **others,
        )  # fmt: skip

    def failed(self, reason: str, message: str, culprit: int | None = 0, **others: Any) -> RunRow:
        """Return the row of a run that a car's planner has ended for all; culprit None: it is not known whose."""
        several = len(self.planners) > 1
        culprit = culprit if several else 0
        cars = []
        for place, planner in enumerate(self.planners):
            won = several and culprit not in (None, place)
            among: dict[str, Any] = {
                "started": place + 1, "position": 1 if won else len(self.planners), "points": int(won), "overtakes": 0,
                "contacts": 0, "at_fault": 0, "warnings": 0,
            }  # fmt: skip
            ended, why = (reason, message) if place == culprit else ("", None)
            own = among if several else {}
            cars.append(CarFigures(planner=planner, end_reason=ended, message=why, finished=won, **own))
        winner = next((car.planner for car in cars if car.finished), None) if len(cars) == 2 else None
        said = message if culprit is None or not several else f"{self.planners[culprit]}: {message}"
        return self._row(cars=tuple(cars), message=said, winner=winner, **others)

    def _row(self, **others: Any) -> RunRow:
        return RunRow(
            key=self.key, place=self.place, setup=self.setup.described(), course_sha256=self.course_sha256,
            origins=self.origins, **others,
        )  # fmt: skip


def why_failed(error: Exception) -> str:
    """Return the message of a run that failed with an error, in one line."""
    return " ".join(str(error).split()) if isinstance(error, ControllerError) else one_line(error)


def car_figures(
    result: RaceResult, index: int, planner: str, poses: FloatArray | None, *, timed: bool = False
) -> CarFigures:
    """Return the figures of a car in a race.

    Args:
      result: of the race.
      index: of the car.
      planner: what its planner is called.
      poses: as of `driven_poses`, if the clearance and the way are to be worked out.
      timed: whether to tell the times of decisions.
    """
    car, world, course = result.cars[index], result.world, result.world.track
    assert course is not None
    laps, progress = car.lap_times_s, car.column("progress_m")
    success = car.finished and car.collisions_wall == 0
    share = float(progress[-1]) / (course.length * result.laps_requested) if len(progress) else 0.0
    slowest = car.decision_times.percentile_99_s
    driven: dict[str, Any] = {}
    if poses is not None:
        times = np.append(car.column("time_s"), result.sim_time_s)[: len(poses)]
        ground = Ground(course, world.obstacles[len(course.obstacles) :])
        driven = {
            "least_clearance_m": 0.0 if car.collisions_wall else ground.least_clearance(times, poses, world.parameters),
            "wrong_way_time_s": wrong_way_time(times, np.append(progress, np.nan)[: len(poses)]),
            "distance_m": float(np.hypot(*np.diff(poses[:, :2], axis=0).T).sum()),
        }
    if len(result.cars) > 1:
        driven |= {
            "started": index + 1, "position": car.position,
            "points": len(result.cars) - car.position if car.finished else 0,
            "overtakes": sum(each.by == car.name for each in result.overtakes),
            "overtaken": sum(each.of == car.name for each in result.overtakes), "contacts": car.collisions_car,
            "at_fault": sum(each.blames(car.name) for each in result.contacts),
            "warnings": sum(each.car == car.name for each in result.warnings),
        }  # fmt: skip
    return CarFigures(
        planner=planner, end_reason=car.end_reason, message=_why(car, result.setup.decision_limit), success=success,
        finished=car.finished, completion=1.0 if success else min(max(share, 0.0), 1.0),
        laps_completed=car.laps_completed, laps_requested=result.laps_requested,
        first_lap_s=laps[0] if laps else None, best_lap_s=min(laps, default=None),
        mean_lap_s=statistics.fmean(laps) if laps else None, collisions=car.collisions_wall,
        max_slide_m_s=_known(car.max_slide_m_s), slide_time_fraction=_known(car.slide_time_fraction),
        mean_speed_m_s=car.mean_speed_m_s, time_s=car.end_time_s,
        decision_ms=None if slowest is None or not timed else 1e3 * slowest, **driven,
    )  # fmt: skip


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
