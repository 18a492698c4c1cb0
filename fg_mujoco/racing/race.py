"""The closed loop: scan, plan, command, physics, every 25 ms, until all cars have finished or cannot go on.

    result = race("oval", controller="gap_finder", laps=5)
    print(result.car.lap_times_s, result.car.max_slide_m_s)

    result = race("oval", entries=[Entry(controller="gap_finder"), Entry(controller="pure_pursuit")])
    print(result.winner, [car.position for car in result.cars])

A car whose planner fails or takes too long, that crashes into a wall or turns round, brakes and stays where it is, an
obstacle to the others, which race on. A car that has finished is taken off the course, as at the end of a heat. The
race of one car ends with it. A scene is raced once, to its goal, which counts as its one lap.
"""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..arguments import explain_class
from ..course.course import Course
from ..course.files import kept_folder
from ..errors import DecisionLimitReached, SettingsError
from ..messages import Controller
from ..simulation.engine import Engine
from ..simulation.planner_adapter import Cars, Planners, PlannersOfEach, Reasons, adapt
from ..simulation.settings import Start
from ..simulation.termination import END_REASONS
from .decision_times import DecisionClock, DecisionTimes
from .entries import Entry
from .planner_origin import Files, origin, planner_files, source_code
from .planners import split_controller
from .resolved import Resolved
from .result import (
    CarResult,
    History,
    RaceResult,
    course_figures,
    driven_figures,
    track_figures,
    world_figures,
)
from .rules import RaceRecord, race_control
from .setup import Setup, SetupKeywords

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from ..simulation.planner_adapter import DecisionStep
    from ..simulation.planner_failure import PlannerFailure

_LATE = END_REASONS.index("decision_limit")
_AT_ONCE = 40  # ticks of a call at most, if they are quick
_QUICK = 0.01  # [s] of wall time for a call
_WATCHED_EVERY = 0.05  # [s] of wall time


@explain_class
@dataclass(frozen=True, kw_only=True)
class RaceProgress:
    """Progress of a race, once a tick."""

    time: float  # [s] simulated
    laps_completed: int  # of the car in front
    laps_requested: int
    speed: float  # [m/s] of car 0
    running: tuple[bool, ...]  # of each car, whether its race goes on
    progress_m: tuple[float, ...]  # of each car, along the course's line
    last_touch_s: float = -math.inf  # when two cars last touched; -inf: not yet
    wall_contacts: tuple[int, ...] = ()  # of each car, after which it was put back


def race(
    track: Setup | Course | str,
    controller: str | Controller | None = None,
    *,
    watch: Callable[[RaceProgress], None] | None = None,
    **keywords: Unpack[SetupKeywords],
) -> RaceResult:
    """Race one car or several round a track, or through a scene, and return how it went.

    A planner that raises, or answers something else than a command, ends the race of its car as "planner_failed", and
    a warning names its line. The car's `planner_failure` has the traceback and the scan.

    Args:
      track: a course, or what `load_track` makes one of: a bundled name, `random:SEED`, `random:SEED:tight`,
        `scene:NAME:SEED`, or a path to a centreline CSV or a map; or a whole Setup.
      controller: a bundled name or `path/to/file.py:ClassName`, with settings in brackets where wanted, as
        `gap_finder[lookahead=8]`; or a controller object, or a function `f(scan, odometry)` that answers a command.
      watch: called between ticks, at most 20 times a second of wall time, and after the last one.
      keywords: of a Setup, which has their types. Those of a car are car 0's; of several cars they stand in each Entry.

        What is driven: laps [5]; obstacles, how many boxes or a list, and obstacle_seed; moving, as "pedestrian:2";
        assist; max_speed [m/s]; start_s [m], start_offset [m], start_heading [rad], start_speed [m/s], or start; seed;
        time_limit [s] simulated, decision_limit [s] of wall time; planner_settings, by name; name.
        Car: vehicle; tires; changes, or mass [kg], cog_height [m], command_delay [s], steering_gain and speed_gain as
        factors.
        Floor: mu; floor, one that was measured; planner_mu, which the planner assumes, "off": no friction limits;
        patches with another mu.
        Sensors: effects, or lidar_effects by name or file, lidar_noise [m], lidar_dropout as a probability,
        lidar_latency [s], motion_distortion, floor_angle [rad], through_cars; lidar, the back end; odometry_drift,
        relative; sensors; knows; odometry; pose.
        Other cars: opponents, or entries of all cars; grid; rules.

    Raises:
      TrackError, ControllerError, SettingsError: input that cannot be raced with.
    """
    given: dict[str, Any] = dict(keywords)
    if controller is not None:
        given["controller"] = controller
    result = race_setup(Setup.of(track, caller="race", **given), watch=watch)
    for car in result.cars:
        if car.planner_failure is not None:
            who = car.controller if len(result.cars) == 1 else f"{car.name}, {car.controller},"
            warnings.warn(f"controller {who} failed: {car.planner_failure}", UserWarning, stacklevel=3)
    return result


@kept_folder()
def race_setup(
    setup: Setup, *, watch: Callable[[RaceProgress], None] | None = None, each_tick: bool = False
) -> RaceResult:
    """Race what a setup says; arguments and errors are those of `race`.

    Args:
      setup: what is raced.
      watch: called between ticks, at most 20 times a second of wall time, and after the last one.
      each_tick: `watch` is called after every tick.
    """
    return _race(setup, watch, 0.0 if each_tick else _WATCHED_EVERY)


def _race(setup: Setup, watch: Callable[[RaceProgress], None] | None, every: float) -> RaceResult:
    """Race what a setup says and call `watch` `every` so often [s]; arguments and errors are those of `race_setup`."""
    raced = Resolved.of(setup)
    world, entries, names, alone = raced.world, raced.entries, raced.names, len(raced.entries) == 1
    if not alone:
        raced.check_starts()
    planners = raced.build_planners()
    files = [  # before the race: what the planners have read
        planner_files(planner, split_controller(entry.controller, entry.planner_settings)[1], warn=True)
        for planner, entry in zip(planners, entries, strict=True)
    ]
    engine = Engine(world, laps=raced.laps, time_limit=setup.time_limit)
    clock = DecisionClock(setup.decision_limit)
    adapted = [
        adapt([planner], arrays=isinstance(entry.controller, str))
        for planner, entry in zip(planners, entries, strict=True)
    ]
    timed = [_Timed(each, clock) for each in adapted]
    engine.planners = (
        adapted[0] if alone else PlannersOfEach([(np.array([row]), each) for row, each in enumerate(timed)])
    )
    raced.place(engine)
    if alone and engine.crashed[0]:
        raced.check_starts()  # says what is in the way
        raise SettingsError(f"the car touches something at {raced.starts[0]}; accepted: another start")
    history, control = History(engine), race_control(engine, names=names, rules=setup.rules)

    started = time.perf_counter()
    ended = _drive(engine, history, control, clock, watch, every)
    wall_time = time.perf_counter() - started
    control.finish()

    order, trajectory, failures = control.order(), history.arrays(), engine.planners.failures
    results = []
    for row, planner in enumerate(planners):
        failure = failures.get(row)
        results.append(
            _car_result(
                engine, history, entries[row], row, planner, files[row], start=raced.starts[row],
                position=order.index(row) + 1, ticks=int(ended[row]),
                failure=None if failure is None else failure.failure,
                seconds=clock.seconds if alone else timed[row].seconds,
                decided=adapted[row].last_decision(0),
                touched=sum(names[row] in contact.cars for contact in control.contacts),
                put_back=control.wall_contacts[row],
            )
        )  # fmt: skip
    of_all = world_figures(trajectory)
    return RaceResult(
        setup=setup,
        laps_requested=raced.laps,
        cars=tuple(results),
        winner=control.winner,
        overtakes=tuple(control.overtakes),
        contacts=tuple(control.contacts),
        warnings=tuple(control.warnings),
        restarts=tuple(control.restarts),
        wall_time_s=wall_time,
        realtime_factor=of_all["sim_time_s"] / wall_time if wall_time > 0.0 else 0.0,
        **of_all,
        **track_figures(engine),
        world=world,
        states=trajectory["states"],
        ctrl=trajectory["ctrl"],
    )


def _drive(
    engine: Engine,
    history: History,
    control: RaceRecord,
    clock: DecisionClock,
    watch: Callable[[RaceProgress], None] | None,
    every: float,
) -> NDArray[np.int64]:
    """Run the loop until the race is over; return after how many ticks that of each car was."""
    running, timers = engine.running, engine.monitor.timers
    one = engine.cars_per_world == 1
    alone = one and not control.puts_back_at_walls
    ended = np.full(engine.cars_per_world, -1)  # -1: it goes on
    watched, at_once, now = -math.inf, 1, time.perf_counter()  # when that was [s]; ticks of a call
    try:
        with clock:
            while running.any():
                if alone:
                    engine.tick(clock=clock, history=history, most=at_once)
                else:
                    driven = engine.tick(clock=clock if one else None)
                    ended[(ended < 0) & ~driven] = history.ticks
                    if driven.any():
                        control.after_tick()
                        history.append()
                    ended[(ended < 0) & ~running] = history.ticks
                began, now = now, time.perf_counter()
                at_once = min(2 * at_once, _AT_ONCE) if every > 0.0 and now - began < _QUICK else 1
                if watch is not None and (now - watched >= every or not running.any()):
                    watched = now
                    watch(
                        RaceProgress(
                            time=engine.time(0), laps_completed=int(timers["laps_completed"].max()),
                            laps_requested=engine.monitor.laps, speed=engine.speed(0),
                            running=tuple(running.tolist()), progress_m=tuple(timers["progress"].tolist()),
                            last_touch_s=float(engine.touched_at.max()),
                            wall_contacts=tuple(control.wall_contacts),
                        )
                    )  # fmt: skip
    except KeyboardInterrupt:  # what was driven is kept
        if int(engine.statistics["ticks"][0]) > history.ticks and alone:
            history.append()
        if alone and running[0] and timers["time"][0] < engine.time(0):
            engine.judge()
        engine.interrupt()
    except DecisionLimitReached:  # of the only car; each of several has its own
        engine.monitor.end(running.copy(), "decision_limit")
    ended[ended < 0] = history.ticks
    return ended


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
    entry: Entry,
    row: int,
    planner: Controller,
    files: Files,
    *,
    start: Start,
    position: int,
    ticks: int,
    failure: PlannerFailure | None,
    seconds: Sequence[float],
    decided: tuple[DecisionStep, ...],
    touched: int,
    put_back: int,
) -> CarResult:
    """Return how a car fared, whose race was over after so many ticks."""
    arrays = history.arrays(row)
    own: Any = {
        "telemetry": arrays["telemetry"][:ticks], "states": arrays["states"][: ticks + 1],
        "ctrl": arrays["ctrl"][:ticks],
    }  # fmt: skip
    source, settings = split_controller(entry.controller, entry.planner_settings)
    return CarResult(
        name=str(entry.name), position=position, entry=entry, start=start,
        controller=source if isinstance(source, str) else type(planner).__name__,
        controller_origin=origin(source, type(planner)) | {"files": files},
        controller_source=source_code(type(planner)),
        planner_failure=failure, last_decision=decided, collisions_car=touched,
        decision_times=DecisionTimes.of(seconds, engine.beams.period), planner_settings=settings,
        assist=getattr(planner, "assist", "none"),
        end_time_s=float(own["states"][-1, 0]), telemetry=arrays["telemetry"],
        **driven_figures(engine, arrays["telemetry"], row, put_back), **course_figures(engine, own, row),
    )  # fmt: skip
