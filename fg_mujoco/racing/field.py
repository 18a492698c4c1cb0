"""A race of several cars: all sense, all decide, all drive, until each has finished or cannot go on.

A car whose planner fails or takes too long, that crashes into a wall or turns round, brakes and stays where it is, an
obstacle to the others, which race on. A car that has finished is taken off the course, as at the end of a heat.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..course.course import Course
from ..course.obstacles import Obstacle
from ..messages import Controller
from ..simulation.engine import Engine
from ..simulation.planner_adapter import Cars, Planners, PlannersOfEach, Reasons, adapt
from ..simulation.planner_failure import DecisionLimitReached, PlannerFailure
from ..simulation.termination import END_REASONS
from ..simulation.world import World
from ..vehicle.friction_patches import Patch
from .decision_times import DecisionClock, DecisionTimes
from .entries import Entry, check_starts, entry_planner, grid_starts
from .figures import course_figures, driven_figures
from .planner_choice import split_controller
from .planner_files import Files, planner_files
from .planner_origin import origin, source_code
from .race_control import RaceControl, find_rules
from .result import CarResult, History, RaceResult

_LATE = END_REASONS.index("decision_limit")


@dataclass(frozen=True, kw_only=True)
class FieldProgress:
    """What a race of several cars tells whoever watches it, once a tick."""

    time: float  # [s] simulated
    laps_completed: int  # of the car in front
    laps_requested: int
    speed: float  # [m/s] of car 0
    racing: int  # cars that race


def race_field(
    course: Course,
    entries: Sequence[Entry],
    *,
    laps: int,
    grid: str,
    rules: str,
    lidar: str,
    time_limit: float | None,
    decision_limit: float | None,
    obstacles: tuple[Obstacle, ...],
    obstacle_seed: int | None,
    patches: tuple[Patch, ...],
    watch: Callable[[Any], None] | None,
) -> RaceResult:
    """Race several cars; arguments and errors are those of `race`, which checks them.

    Raises:
      SettingsError: starts in a wall, in an obstacle or in another car; unknown rules.
      ControllerError: a planner that cannot be built.
    """
    chosen = find_rules(rules)
    first = entries[0]
    world = World(
        course, first.car, mu=first.mu, lidar=lidar, obstacles=obstacles, changes=first.changes, tires=first.tire_set,
        patches=patches, others=[entry.world_car() for entry in entries[1:]],
    )  # fmt: skip
    cars, names = [car.parameters for car in world.cars], [str(entry.name) for entry in entries]
    places = grid_starts(course, cars, grid)
    starts = [entry.start or place for entry, place in zip(entries, places, strict=True)]
    check_starts(course, starts, cars, names, obstacles)
    planners = [
        entry_planner(entry, car=car, map_line=course.map_line) for entry, car in zip(entries, cars, strict=True)
    ]
    files = [
        planner_files(planner, split_controller(entry.controller, entry.planner_settings)[1], warn=True)
        for planner, entry in zip(planners, entries, strict=True)
    ]
    engine = Engine(world, laps=laps, time_limit=time_limit)
    clock = DecisionClock(decision_limit)
    timed = [
        _Timed(adapt([planner], arrays=isinstance(entry.controller, str)), clock)
        for planner, entry in zip(planners, entries, strict=True)
    ]
    engine.planners = planners_of_each = PlannersOfEach([(np.array([row]), each) for row, each in enumerate(timed)])
    engine.place(
        starts, effects=[entry.effects for entry in entries], seeds=[entry.seed for entry in entries],
        odometry_drifts=[entry.odometry_drift for entry in entries],
    )  # fmt: skip
    history, control = History(engine), RaceControl(engine, names=names, rules=chosen)
    ended = np.full(len(entries), -1)  # after how many ticks each race was over; -1: it goes on

    started = time.perf_counter()
    try:
        with clock:
            while engine.running.any():
                engine.sense()
                engine.decide()
                ended[(ended < 0) & ~engine.running] = history.ticks
                if not engine.running.any():  # no planner is left: nothing is driven any more
                    break
                engine.drive()
                engine.judge()
                control.after_tick()
                history.append()
                ended[(ended < 0) & ~engine.running] = history.ticks
                if watch is not None:
                    watch(
                        FieldProgress(
                            time=engine.time(0), laps_completed=int(engine.monitor.timers["laps_completed"].max()),
                            laps_requested=laps, speed=engine.speed(0), racing=int(engine.running.sum()),
                        )
                    )  # fmt: skip
    except KeyboardInterrupt:  # what was driven is kept
        engine.interrupt()
    ended[ended < 0] = history.ticks
    control.finish()
    wall_time = time.perf_counter() - started
    later_time = started + wall_time - (history.first_end or started + wall_time)  # [s] without the first tick

    arrays = history.arrays()
    order = control.order()
    results = []
    for row, entry in enumerate(entries):
        failure = planners_of_each.failures.get(row)
        results.append(
            _car_result(
                engine, history, row, entry, planners[row], files[row], start=starts[row],
                position=order.index(row) + 1, ticks=int(ended[row]),
                failure=None if failure is None else failure.failure,
                decision_times=DecisionTimes.of(timed[row].seconds, engine.beams.period),
                touched=sum(str(entry.name) in contact.cars for contact in control.contacts),
            )
        )  # fmt: skip
    own, sim_time = results[0], engine.time(0)
    driven = driven_figures(engine, arrays)
    return RaceResult(
        **{
            name: getattr(own, name)
            for name in (
                "vehicle", "vehicle_sha256", "tires", "tires_model", "tires_sha256", "controller",
                "controller_origin", "controller_source", "planner_failure", "decision_times", "planner_mu",
                "speed_limit_m_s", "odometry_drift", "lidar_effects", "planner_settings", "seed",
                "laps_completed", "lap_times_s", "finished", "end_reason", "wrong_way", "crash",
            )
        },
        **driven,
        track=course.name,
        obstacles=len(obstacles),
        laps_requested=laps,
        wall_time_s=wall_time,
        decision_limit_s=None if decision_limit is None else float(decision_limit),
        realtime_factor=(sim_time - engine.period) / later_time if later_time > 0.0 else 0.0,
        lidar=lidar,
        obstacle_seed=obstacle_seed,
        world=world,
        **arrays,
        car_results=tuple(results),
        grid=grid,
        rules=rules,
        winner=control.winner,
        overtakes=tuple(control.overtakes),
        contacts=tuple(control.contacts),
        warnings=tuple(control.warnings),
        restarts=tuple(control.restarts),
    )  # fmt: skip


class _Timed:
    """Times the decisions of one car's planner, and ends its race where one takes too long.

    Args:
      planners: of this one car.
      clock: of the race.

    Attributes:
      seconds: that each decision took.
    """

    def __init__(self, planners: Planners, clock: DecisionClock) -> None:
        self.seconds: list[float] = []
        self._planners, self._clock = planners, clock
        self.failures = planners.failures

    def __call__(self, cars: Cars) -> Reasons | None:
        """See Planners."""
        try:
            return self._clock.time(lambda: self._planners(cars))
        except DecisionLimitReached:
            return np.array([_LATE])
        finally:
            self.seconds.append(self._clock.seconds[-1])


def _car_result(
    engine: Engine,
    history: History,
    row: int,
    entry: Entry,
    planner: Controller,
    files: Files,
    *,
    start: Any,
    position: int,
    ticks: int,
    failure: PlannerFailure | None,
    decision_times: DecisionTimes,
    touched: int,
) -> CarResult:
    """Return how a car fared, whose race was over after so many ticks."""
    arrays = history.arrays(row)
    own = {"telemetry": arrays["telemetry"], "states": arrays["states"][: ticks + 1], "ctrl": arrays["ctrl"][:ticks]}
    driven: Any = dict(driven_figures(engine, arrays, row))
    on_course: Any = dict(course_figures(engine, own, row))  # type: ignore[arg-type]
    for name in ("sim_time_s", "trajectory_sha256", "collisions"):
        driven.pop(name)
    for name in ("track", "obstacles"):
        on_course.pop(name)
    source, settings = split_controller(entry.controller, entry.planner_settings)
    return CarResult(
        name=str(entry.name), position=position, vehicle=entry.car.name, vehicle_sha256=entry.car.sha256,
        tires=entry.tire_set.name, tires_model=entry.tire_set.model, tires_sha256=entry.tire_set.sha256,
        controller=source if isinstance(source, str) else type(planner).__name__,
        controller_origin=origin(source, type(planner)) | {"files": files},
        controller_source=source_code(type(planner)),
        planner_failure=failure, collisions_wall=int(engine.crashed[row]), collisions_car=touched,
        decision_times=decision_times, planner_mu=float(entry.assumed_mu), speed_limit_m_s=float(entry.max_speed),
        seed=entry.seed, lidar_effects=entry.effects, odometry_drift=float(entry.odometry_drift),
        planner_settings=settings, start=start, end_time_s=float(own["states"][-1, 0]),
        telemetry=arrays["telemetry"], **driven, **on_course,
    )  # fmt: skip
