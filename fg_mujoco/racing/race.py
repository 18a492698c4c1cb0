"""The closed loop: scan, plan, command, physics, every 25 ms, until the laps are done or the race is over.

    result = race("oval", controller="gap_finder", laps=5)
    print(result.lap_times_s, result.max_slide_m_s)

A scene is raced once, to its goal, which counts as its one lap.
"""

from __future__ import annotations

import inspect
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..arguments import explain_class
from ..course.course import USUAL_LAPS, Course, laps_to_drive
from ..course.obstacles import Obstacle
from ..course.random_obstacles import random_boxes
from ..errors import PlannerError, SettingsError
from ..lidar.effects import LidarEffects
from ..messages import Controller, require
from ..simulation.course_loading import load_track
from ..simulation.engine import Engine
from ..simulation.planner_adapter import adapt
from ..simulation.planner_adapter import start as start_planner
from ..simulation.planner_failure import DecisionLimitReached, without_exit
from ..simulation.settings import DriveSettings, Start, renamed, require_laps, require_time_limit
from ..vehicle.changes import CarChanges
from ..vehicle.friction_patches import Patch
from ..vehicle.tires import Tires
from ..vehicle.vehicle import DEFAULT_VEHICLE, Vehicle
from .decision_times import DecisionClock, DecisionTimes
from .entries import Entry, check_starts, require_entries
from .field import race_field
from .figures import course_figures, driven_figures
from .planner_choice import split_controller
from .planner_files import planner_files
from .planner_loading import make_controller
from .planner_origin import origin, source_code
from .result import History, RaceResult


@dataclass(frozen=True, kw_only=True, repr=False)
class RaceSettings(DriveSettings):
    """What a race is run with.

    Raises:
      SettingsError: a value outside what is accepted.
    """

    laps: int = USUAL_LAPS
    lidar: str = "raycast"
    time_limit: float | None = None  # [s]; None: as long as a car of 0.5 m/s needs, or the scene's
    decision_limit: float | None = None  # [s] of wall time that the planner may take for a decision; None: any

    def __post_init__(self) -> None:
        super().__post_init__()
        require_laps(self.laps)
        require_time_limit(self)
        require_decision_limit(self)


def require_decision_limit(settings: Any) -> None:
    """Refuse a `decision_limit` among some settings that is neither None nor a positive number of seconds.

    Raises:
      SettingsError: it is not.
    """
    if settings.decision_limit is not None:
        require(settings, lambda value: 0.0 < value < math.inf, "a positive number", ("decision_limit",), SettingsError)


@explain_class
@dataclass(frozen=True, kw_only=True)
class RaceProgress:
    """What a race tells whoever watches it, once a tick."""

    time: float  # [s] simulated
    laps_completed: int
    laps_requested: int
    speed: float  # [m/s]


@renamed(car="changes", begin="start")
@without_exit()
def race(
    track: Course | str,
    controller: str | Controller = "gap_finder",
    *,
    laps: int | None = None,
    vehicle: Vehicle | str | Path = DEFAULT_VEHICLE,
    tires: Tires | str | Path | None = None,
    mu: float | None = None,
    changes: CarChanges | None = None,
    planner_mu: float | None = None,
    max_speed: float = 8.0,
    lidar: str = "raycast",
    seed: int = 0,
    time_limit: float | None = None,
    decision_limit: float | None = None,
    obstacles: tuple[Obstacle, ...] | int = (),
    obstacle_seed: int = 0,
    patches: Sequence[Patch] = (),
    effects: LidarEffects | None = None,
    odometry_drift: float = 0.0,
    start: Start | None = None,
    planner_settings: Mapping[str, Any] | None = None,
    entries: Sequence[Entry] | None = None,
    grid: str = "staggered",
    rules: str = "none",
    watch: Callable[[Any], None] | None = None,
) -> RaceResult:
    """Race a controller round a track, or through a scene, and return how it went.

    Args:
      track: a course, or what `load_track` makes one of: a bundled name, `random:SEED`, `random:SEED:tight`,
        `scene:NAME:SEED`, or
        a path to a centreline CSV.
      controller: a bundled name or `path/to/file.py:ClassName`, with settings in brackets where wanted, as
        `gap_finder[lookahead=8]`; or a controller object, or a function `f(scan, odometry)` that answers a command.
      laps: to be driven; None: 5, and of a scene 1, which is all it has.
      vehicle: a bundled name, the path of a vehicle's MJCF file, or a Vehicle.
      tires: a bundled set, the path of a TOML file, or Tires; None: the vehicle's.
      mu: friction coefficient of the tires, or the greatest peak of those with a curve; None: as in their file.
      changes: what else differs from the vehicle's MJCF.
      planner_mu: friction coefficient that the planner assumes; None: the least peak of the tires, as `mu` sets it;
        inf: no limits.
      max_speed: fastest that the planner may command [m/s].
      lidar: back end, "raycast" or "rangefinder".
      seed: of the LiDAR's noise and dropouts.
      time_limit: of simulated time [s]; None: as long as a car of 0.5 m/s needs, or the scene's own.
      decision_limit: of wall time that the planner may take for one decision [s]; None: any. A race whose planner takes
        longer, or never answers, ends with the end reason "decision_limit"; `racing.decision_times` says what cannot be
        interrupted.
      obstacles: what stands on the track, besides what a scene has; or of how many boxes, at random places of a track
        that leave a way past each (`random_obstacles`).
      obstacle_seed: of the random places.
      patches: of the floor, on which the tires have another friction.
      effects: what the LiDAR does to a scan; nothing by default.
      odometry_drift: relative error of the speeds and the yaw rate that the planner is told: 0.05 is 5 % too much. What
        the car does is the same, and the pose is the true one.
      start: where and how the race starts, clear of walls and obstacles; None: standing on the start of the centreline.
      planner_settings: settings of the controller that differ from its own.
      entries: the cars of a race of several, in the order of the grid. The settings of one car, from `controller` to
        `planner_settings`, are then theirs: of each Entry. A planner that fails ends its own car's race only.
      grid: "staggered" or "side_by_side": where entries without a start stand, see `entries.grid_starts`.
      rules: of race control, "none" or "roboracer_2026", see `race_control.RULES`.
      watch: called once a tick, with a RaceProgress, or a FieldProgress of several cars.

    Raises:
      TrackError, ControllerError, SettingsError: input that cannot be raced with.
      PlannerError: the controller raises while it drives, or answers something else than a command. Its `result` is
        that of the race up to there, which can be written as a run folder; its `failure` has the line and the scan.
    """
    if entries is not None:
        given = {
            "controller": controller, "vehicle": vehicle, "tires": tires, "mu": mu, "changes": changes,
            "planner_mu": planner_mu, "max_speed": max_speed, "seed": seed, "effects": effects,
            "odometry_drift": odometry_drift, "start": start, "planner_settings": planner_settings,
        }  # fmt: skip
        return _race_of_entries(
            track, require_entries(entries), given, laps=laps, lidar=lidar, time_limit=time_limit,
            decision_limit=decision_limit, obstacles=obstacles, obstacle_seed=obstacle_seed, patches=patches,
            grid=grid, rules=rules, watch=watch,
        )  # fmt: skip
    controller, own = split_controller(controller, planner_settings)
    settings = RaceSettings(
        laps=USUAL_LAPS if laps is None else laps, vehicle=vehicle, tires=tires, mu=mu,
        changes=changes or CarChanges(), planner_mu=planner_mu, max_speed=max_speed, planner_settings=own,
        patches=patches, start=start or Start(), effects=effects or LidarEffects(),
        odometry_drift=odometry_drift, seed=seed, lidar=lidar, time_limit=time_limit, decision_limit=decision_limit,
    )  # fmt: skip
    course = load_track(track, car=settings.car.parameters)
    laps = laps_to_drive(course, laps)
    drawn = None
    if isinstance(obstacles, int):
        drawn = obstacle_seed if obstacles else None
        obstacles = random_boxes(course, obstacles, obstacle_seed, car=settings.car.parameters, start=settings.start.s)
    world = settings.world(course, lidar=lidar, obstacles=obstacles)
    context = settings.context(world.parameters, world.track.map_line)
    planner = make_controller(controller, context, settings=settings.planner_settings)
    start_planner(planner)
    files = planner_files(planner, settings.planner_settings, warn=True)  # before the race: what it has read
    engine = Engine(world, laps=laps, time_limit=settings.time_limit)
    engine.planners = adapt([planner], arrays=isinstance(controller, str), raises=True)
    engine.place(
        [settings.start], effects=[settings.effects], seeds=[seed], odometry_drifts=[settings.odometry_drift]
    )  # fmt: skip
    if engine.crashed[0]:
        check_starts(course, [settings.start], [world.parameters], [""], obstacles)  # says what is in the way
        raise SettingsError(f"the car touches something at {settings.start}; accepted: a start where it does not")
    history, clock = History(engine), DecisionClock(settings.decision_limit)

    failed: PlannerError | None = None
    started = time.perf_counter()
    try:
        with clock:
            _drive(engine, history, clock, laps, watch)
    except KeyboardInterrupt:  # what was driven is kept
        _end_tick(engine, history)
        engine.interrupt()
    except PlannerError as error:
        failed = error
        engine.monitor.end(engine.running.copy(), "planner_failed")
    except DecisionLimitReached:
        engine.monitor.end(engine.running.copy(), "decision_limit")
    ended = time.perf_counter()
    later_time = ended - (history.first_end or ended)  # [s] without the first tick

    arrays = history.arrays()
    driven = driven_figures(engine, arrays)
    result = RaceResult(
        vehicle=settings.car.name,
        vehicle_sha256=settings.car.sha256,
        tires=settings.tire_set.name,
        tires_model=settings.tire_set.model,
        tires_sha256=settings.tire_set.sha256,
        controller=controller if isinstance(controller, str) else type(planner).__name__,
        controller_origin=origin(controller, type(planner)) | {"files": files},
        controller_source=source_code(type(planner)),
        laps_requested=laps,
        planner_failure=None if failed is None else failed.failure,
        wall_time_s=ended - started,
        decision_times=DecisionTimes.of(clock.seconds, engine.beams.period),
        decision_limit_s=None if settings.decision_limit is None else float(settings.decision_limit),
        realtime_factor=(driven["sim_time_s"] - engine.period) / later_time if later_time > 0.0 else 0.0,
        **driven,
        **course_figures(engine, arrays),
        seed=seed,
        planner_mu=settings.assumed_mu,
        speed_limit_m_s=float(max_speed),
        lidar=lidar,
        lidar_effects=settings.effects,
        odometry_drift=float(settings.odometry_drift),
        obstacle_seed=drawn,
        planner_settings=dict(settings.planner_settings),
        world=world,
        **arrays,
    )
    if failed is not None:
        failed.result = result
        try:
            raise failed
        finally:
            del failed  # its traceback has this frame, which would hold the error and its world
    return result


def _race_of_entries(
    track: Course | str,
    entries: tuple[Entry, ...],
    given: Mapping[str, Any],
    *,
    laps: int | None,
    lidar: str,
    time_limit: float | None,
    decision_limit: float | None,
    obstacles: tuple[Obstacle, ...] | int,
    obstacle_seed: int,
    patches: Sequence[Patch],
    grid: str,
    rules: str,
    watch: Callable[[Any], None] | None,
) -> RaceResult:
    """Race several cars, see `race`; `given` are the settings of one car, which must be the defaults.

    Raises:
      SettingsError: one is not.
    """
    usual = inspect.signature(race).parameters
    for name, value in given.items():
        if value != usual[name].default:
            raise SettingsError(f"{name} is {value!r} beside entries; accepted: {name} of each Entry")
    checked = RaceSettings(
        laps=USUAL_LAPS if laps is None else laps,
        lidar=lidar,
        time_limit=time_limit,
        decision_limit=decision_limit,
        patches=patches,
    )
    first = entries[0].car.parameters
    course = load_track(track, car=first)
    drawn = None
    if isinstance(obstacles, int):
        drawn = obstacle_seed if obstacles else None
        obstacles = random_boxes(course, obstacles, obstacle_seed, car=first, start=0.0)
    return race_field(
        course, entries, laps=laps_to_drive(course, laps), grid=grid, rules=rules, lidar=lidar,
        time_limit=checked.time_limit, decision_limit=checked.decision_limit, obstacles=obstacles,
        obstacle_seed=drawn, patches=tuple(checked.patches), watch=watch,
    )  # fmt: skip


def _end_tick(engine: Engine, history: History) -> None:
    """Keep and judge a tick that was driven, and then interrupted."""
    if int(engine.statistics["ticks"][0]) > history.ticks:
        history.append()
    if engine.running[0] and engine.monitor.timers["time"][0] < engine.time(0):
        engine.judge()


def _drive(
    engine: Engine,
    history: History,
    clock: DecisionClock,
    laps: int,
    watch: Callable[[RaceProgress], None] | None,
) -> None:
    """Run the loop until the race is over."""
    running, timers = engine.running, engine.monitor.timers
    while running[0]:
        engine.tick(clock=clock, history=history)
        if watch is not None:
            watch(
                RaceProgress(
                    time=engine.time(0),
                    laps_completed=int(timers["laps_completed"][0]),
                    laps_requested=laps,
                    speed=engine.speed(0),
                )
            )
