"""The card of a planner: what it does in each group of a suite, with each assist, as numbers that others can reproduce.

A run's completion is 1 if the car finished without a touch, else the share of its way that it drove. The score of a
group is the mean completion of its runs, and that of a card the mean of its groups, in percent. The same planner,
suite and versions give the same numbers, but for the times of decisions.
"""

from __future__ import annotations

import statistics
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from fg_mujoco.course.documents import read_json
from fg_mujoco.course.files import file_sha256
from fg_mujoco.errors import SettingsError
from fg_mujoco.racing.planners import ControllerChoice, file_in, only_planner
from fg_mujoco.racing.race import race_setup
from fg_mujoco.racing.resolved import Ground, Resolved
from fg_mujoco.racing.result import RaceResult
from fg_mujoco.racing.setup import Setup
from fg_mujoco.rollouts.workers import work_through

from ..grid_study import StudyProgress, why_failed
from .suite import Suite

RECORDED = Path(__file__).parent / "cards.json"
"""Cards of the bundled planners and baselines by the bundled suite: made by `make cards`."""


@dataclass(frozen=True, kw_only=True)
class BenchRun:
    """A run of a card. It travels to a worker process."""

    place: int  # among the runs of its assist
    planner: str
    assist: str
    group: str
    settings: dict[str, Any]

    def __str__(self) -> str:
        return f"{self.planner}, assist {self.assist}, {self.group}, {self.settings['track']}"

    def drive(self) -> BenchRow:
        """Drive it; what raises on the way is a run that failed."""
        try:
            setup = Setup.of(controller=self.planner, assist=self.assist, **self.settings)
            return row_of(self, race_setup(setup))
        except Exception as error:
            return self.failed(why_failed(error))

    def failed(self, why: str) -> BenchRow:
        """Return the row of a run that could not be driven."""
        return BenchRow(
            group=self.group, track=str(self.settings["track"]), seed=self.settings.get("obstacle_seed", 0), end=why,
            completion=0.0, finished=False, touches=0, bound_s=recorded()["bounds"].get(bound_key(self.settings)),
        )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class BenchRow:
    """How a run went. None: there is no such figure."""

    group: str
    track: str
    seed: int  # of obstacles
    end: str
    completion: float  # share of the way, 1 if it finished without a touch
    finished: bool  # without a touch
    touches: int
    lap_s: float | None = None  # the best
    bound_s: float | None = None  # of a lap, by the raceline; None: not recorded
    slide_share: float | None = None  # of the time in which a tire slid
    clearance_m: float | None = None  # the least, to anything
    decision_ms: float | None = None  # of wall time, 99 % of the decisions are quicker
    trajectory_sha256: str | None = None


@dataclass(frozen=True, kw_only=True)
class Card:
    """The rows of a planner by assist, and their scores."""

    planner: str
    planner_sha256: str | None  # of a user's file
    suite: str  # its name and version
    suite_sha256: str
    version: str  # of fg_mujoco
    rows: dict[str, tuple[BenchRow, ...]]  # by assist

    def groups(self, assist: str) -> list[str]:
        """Return the names of the groups, in their order."""
        return list(dict.fromkeys(row.group for row in self.rows[assist]))

    def of(self, assist: str, group: str) -> list[BenchRow]:
        """Return the rows of a group."""
        return [row for row in self.rows[assist] if row.group == group]

    def score(self, assist: str, group: str | None = None) -> float:
        """Return the mean completion of a group, or of all groups, in percent."""
        groups = self.groups(assist) if group is None else [group]
        return 100.0 * statistics.fmean(
            statistics.fmean(row.completion for row in self.of(assist, each)) for each in groups
        )

    def figures(self, assist: str, group: str) -> dict[str, Any]:
        """Return the figures of a group: score, finished runs, lap times, touches, sliding, clearance, decisions."""
        rows = self.of(assist, group)
        slides = [row.slide_share for row in rows if row.slide_share is not None]
        clear = [row.clearance_m for row in rows if row.clearance_m is not None]
        laps = [row.lap_s for row in rows if row.finished and row.lap_s is not None]
        bounds = [row.bound_s for row in rows if row.bound_s is not None]
        return {
            "score": round(self.score(assist, group), 1),
            "finished": f"{sum(row.finished for row in rows)} of {len(rows)}",
            "lap_s": round(statistics.fmean(laps), 2) if len(laps) == len(rows) else None,  # else of easier ones
            "bound_s": round(statistics.fmean(bounds), 2) if len(bounds) == len(rows) else None,
            "touches": sum(row.touches for row in rows),
            "sliding_percent": round(100.0 * statistics.fmean(slides), 2) if slides else None,
            "least_clearance_m": round(min(clear), 3) if clear else None,
        }

    def decision_ms(self, assist: str) -> float | None:
        """Return the slowest of the runs' decision times at 99 % [ms], which is of the machine."""
        return max((row.decision_ms for row in self.rows[assist] if row.decision_ms is not None), default=None)

    def described(self) -> dict[str, Any]:
        """Return the card as JSON has it."""
        scores = {
            assist: {
                "score": round(self.score(assist), 1),
                "groups": {group: self.figures(assist, group) for group in self.groups(assist)},
            }
            for assist in self.rows
        }
        own = {name: value for name, value in asdict(self).items() if name != "rows"}
        rows = {assist: [asdict(row) for row in driven] for assist, driven in self.rows.items()}
        return own | {"scores": scores, "rows": rows}


def row_of(run: BenchRun, result: RaceResult) -> BenchRow:
    """Return the figures of a race."""
    car, world, course = result.car, result.world, result.world.track
    assert course is not None
    finished = car.finished and car.collisions_wall == 0
    poses = np.column_stack([car.column(name) for name in ("x_m", "y_m", "heading_rad")])
    way = float(car.column("progress_m")[-1]) if len(poses) else 0.0
    share = min(max(way / (course.length * result.laps_requested), 0.0), 1.0)
    clearance = 0.0 if car.collisions_wall else None
    if clearance is None and len(poses):
        ground = Ground(course, world.obstacles[len(course.obstacles) :])
        clearance = ground.least_clearance(car.column("time_s"), poses, world.parameters)
    slowest, failure = car.decision_times.percentile_99_s, car.planner_failure
    return BenchRow(
        group=run.group, track=str(run.settings["track"]), seed=result.setup.obstacle_seed,
        end=car.end_reason if failure is None else f"{car.end_reason}: {failure}",
        completion=1.0 if finished else share, finished=finished, touches=car.collisions_wall,
        lap_s=min(car.lap_times_s, default=None), bound_s=recorded()["bounds"].get(bound_key(run.settings)),
        slide_share=car.slide_time_fraction, clearance_m=clearance,
        decision_ms=None if slowest is None else 1e3 * slowest, trajectory_sha256=result.trajectory_sha256,
    )  # fmt: skip


def bench(
    planner: str,
    suite: Suite,
    *,
    workers: int | None = None,
    watch: Callable[[StudyProgress], None] = lambda progress: None,
) -> Card:
    """Drive a planner through a suite and return its card.

    A planner that decides by itself has no stages: it is driven once, with the assist `none`.

    Args:
      planner: as `race` takes it; of a file with one planner the file is enough.
      suite: what is driven.
      workers: processes; None: as many as there are cores.
      watch: called several times a second.

    Raises:
      ControllerError: there is no such planner, or it cannot be built.
      EngineError: a worker could not start.
    """
    source = only_planner(planner)
    choice = ControllerChoice.of(source)
    if any(name == "assist" for name, _ in choice.settings):
        raise SettingsError(f"planner {planner!r} has an assist; accepted: without one, as the suite says it")
    staged = hasattr(choice.load(), "source_laws")
    assists = suite.assists if staged else ("none",)
    for assist in assists:  # one that cannot be built is refused before anything is driven
        Resolved.of(Setup.of(controller=source, assist=assist)).build_planners()
    items = [
        BenchRun(place=place, planner=source, assist=assist, group=group, settings=settings)
        for assist in assists for place, (group, settings) in enumerate(suite.runs())
    ]  # fmt: skip
    found: dict[str, dict[int, BenchRow]] = {assist: {} for assist in assists}

    def keep(run: BenchRun, row: BenchRow) -> None:
        found[run.assist][run.place] = row

    def show(done: int, elapsed: float) -> None:
        watch(StudyProgress(runs=len(items), runs_found=0, runs_driven=done, wall_time_s=elapsed))

    work_through(BenchRun.drive, items, keep, workers=workers, watch=show, died=BenchRun.failed)
    file = file_in(choice.source)
    return Card(
        planner=choice.label, planner_sha256=None if file is None else file_sha256(file),
        suite=f"{suite.name} {suite.version}", suite_sha256=suite.sha256, version=version("fg-mujoco"),
        rows={assist: tuple(row for _, row in sorted(rows.items())) for assist, rows in found.items()},
    )  # fmt: skip


def bound_key(settings: Mapping[str, Any]) -> str:
    """Return the name of the bound of a run's lap time: its track, friction and greatest speed."""
    return f"{settings['track']}, mu {settings.get('mu', 'as published')}, {settings['max_speed']:g} m/s"


@cache
def recorded() -> Mapping[str, Any]:
    """Return what is recorded by the bundled suite, by `make cards`.

    `cards` has the scores of the bundled planners by assist, `score` and each group's; `bounds` the lap times of the
    racelines [s], by `bound_key`.
    """
    if not RECORDED.exists():
        return {"cards": {}, "bounds": {}}
    return dict(read_json(RECORDED.read_bytes(), "recorded cards"))
