"""Many worlds driven in one thread, whatever they differ in.

    results = drive_worlds([Scenario(seed=seed) for seed in range(64)], "gap_finder", laps=1)
    print(results.rows["first_lap_s"])

Worlds that can share a compiled model are stepped together by one engine. Each world's result is the same, bit for bit,
whatever the others are, and that of the same world driven alone by `race`. Most of the time is spent without the GIL:
several threads that drive worlds each use several cores.

With opponents a world goes on until each of its cars has finished or cannot go on, as a race of several cars does. The
results are those of car 0.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from functools import lru_cache
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..course.course import Course, laps_to_drive
from ..course.files import kept_folder
from ..course.obstacles import Obstacle
from ..errors import ControllerError, SettingsError
from ..messages import DriveCommand, FloatArray
from ..racing.decision_times import DecisionClock
from ..racing.entries import entry_planner
from ..racing.opponents import AMONG_CARS, AmongCars, Opponents, entry_of
from ..racing.planners import build_controller, find_controller, split_controller
from ..racing.rules import RaceRecord, race_control
from ..simulation.cars import WorldCar
from ..simulation.engine import Engine
from ..simulation.planner_adapter import Decide, Planners, PlannersOfEach, adapt, start
from ..simulation.settings import Scenario, Start
from ..simulation.telemetry import statistics_figures
from ..simulation.termination import END_REASONS
from ..simulation.world import World
from ..vehicle.changes import CarChanges
from ..vehicle.friction_patches import Patch
from ..vehicle.tires import Tires
from ..vehicle.vehicle import Vehicle
from .recording import Record, ScanLayout, ScanRecorder

RESULT = np.dtype(
    [
        ("seed", np.int64),
        ("end_reason", "U14"),
        ("laps_completed", np.int64),
        ("sim_time_s", np.float64),
        ("distance_m", np.float64),
        ("first_lap_s", np.float64),  # NaN where none was completed
        ("best_lap_s", np.float64),
        ("collisions", np.int64),
        ("max_slide_m_s", np.float64),
        ("max_lateral_slide_m_s", np.float64),
        ("slide_time_fraction", np.float64),
        ("mean_speed_m_s", np.float64),
        ("max_speed_m_s", np.float64),
    ]
)
"""Result of one world; fields as in RaceResult."""

AMONG = np.dtype(
    [
        ("position", np.int64),
        ("overtakes", np.int64),
        ("overtaken", np.int64),
        ("contacts", np.int64),
        ("contacts_at_fault", np.int64),
        ("winner", "U60"),
    ]
)
"""Result of car 0 among its opponents, behind RESULT where it has any; fields as in AmongCars."""

_FAILED = END_REASONS.index("failed")
_WORLD_TICKS = 4096  # at once, of all worlds: .4 s
_NO_SCANS = np.empty(0, np.void)  # of a world that was not driven, whatever LiDAR it has
_FASTEST = 20.0  # [m/s] where only the time_limit is given, it makes room for the laps of a car as fast as this


@dataclass(frozen=True, kw_only=True, eq=False)
class WorldResults:
    """Results in the order of the scenarios."""

    rows: NDArray[np.void]  # (n,) of RESULT, with opponents of RESULT and AMONG
    lap_times_s: FloatArray  # (n, k), NaN where fewer laps were driven
    telemetry: tuple[FloatArray, ...] = ()  # (ticks, len(TELEMETRY)) of each world, if recorded
    states: tuple[FloatArray, ...] = ()  # (ticks + 1, k), as in RaceResult, if recorded
    ctrl: tuple[FloatArray, ...] = ()  # (ticks, 2) of each car, if states are
    scans: tuple[NDArray[np.void], ...] = ()  # (ticks,) rows of ScanLayout.dtype of car 0 of each world, if recorded


@kept_folder()
def drive_worlds(
    scenarios: Sequence[Scenario],
    controller: str,
    *,
    laps: int | None = None,
    time_limit: float | None = None,
    record: str = "summary",
    decision_limit: float | None = None,
    opponents: Opponents | None = None,
    stop: Callable[[], bool] | None = None,
    watch: Callable[[float], None] | None = None,
) -> WorldResults:
    """Drive each scenario to its end, in the calling thread.

    A world whose planner fails ends as "planner_failed". Where planners that decide together raise, or one cannot be
    built, each of their worlds is driven alone, which changes no bit of the others. An opponent whose planner fails
    brakes and stays where it is, and the other cars of its world race on.

    Args:
      scenarios: the worlds.
      controller: a bundled name or `path/to/file.py:ClassName`; each world gets a controller of its own.
      laps: to be driven, of a scene 1; None: as many as fit the time_limit.
      time_limit: of simulated time at most [s]; None: what a car of 0.5 m/s needs for the laps, or the scene's own.
      record: "summary", "telemetry" (every tick's row too), "states" (and its state and controls), or "scans", what
        the planner was given and what it commanded; "scans:10" keeps every tenth beam.
      decision_limit: of wall time that a planner may take for one decision [s], as of `race`; None: any.
      opponents: that car 0 of each world, which the scenario is about, races against; None: it drives alone.
      stop: asked every few ticks; once it says True, all worlds that still run end as "interrupted".
      watch: called every few ticks with the world-seconds that were simulated since the last call.

    Raises:
      SettingsError: neither laps nor time_limit, more laps than a scene has, or an unknown record.
      TrackError, ControllerError: input that cannot be driven.
    """
    if laps is None and time_limit is None:
        raise SettingsError("neither laps nor time_limit is given; accepted: either or both")
    for name, value in (("laps", laps), ("time_limit", time_limit)):
        if value is not None and not 0 < value < math.inf:
            raise SettingsError(f"{name} is {value!r}; accepted: a positive number")
    recorded = Record.of(record)
    for scenario in scenarios:
        if scenario.effects.motion_distortion:
            raise SettingsError("motion distortion of the LiDAR, in a batch; accepted: in `race` only")
    opponents = opponents or Opponents()
    results = _Results(len(scenarios), recorded, among=bool(opponents.entries))
    groups: dict[tuple[Course | str, Vehicle, Tires, tuple[Patch, ...], tuple[Obstacle, ...], bool], list[int]] = {}
    for i, scenario in enumerate(scenarios):
        delayed = scenario.changes.command_delay is not None
        key = (scenario.track, scenario.car, scenario.tire_set, tuple(scenario.patches), scenario.obstacles, delayed)
        groups.setdefault(key, []).append(i)
    find_controller(controller)  # refuses what is none

    def drive(world: World, members: Sequence[int]) -> None:
        limit = time_limit if time_limit is not None else world.track.longest_race(laps or 1)
        room = laps_within(world.track, laps, limit)
        engine = make_engine(
            world, [scenarios[i] for i in members], controller, laps=room, time_limit=limit,
            timed=None if clock is None else clock.time, opponents=opponents,
        )  # fmt: skip
        controls = [
            race_control(engine, names=opponents.names, rules="none", world=place)
            for place in range(len(members) if opponents.entries else 0)
        ]
        results.begin(members, engine)
        plain = recorded.what == "summary" and not controls and clock is None
        most = max(_WORLD_TICKS // len(members), 1) if plain else 1
        told = 0.0  # [s] of all worlds
        while engine.running.any():
            if stop is not None and stop():
                engine.interrupt()
                break
            cars = engine.tick(most=most)
            driven = _worlds(cars, engine)
            for place in map(int, np.flatnonzero(driven) if controls else ()):
                controls[place].after_tick()
            results.add(members, engine, cars, driven & ~_worlds(engine.monitor.reasons == _FAILED, engine))
            if clock is not None:
                clock.seconds.clear()
            if watch is not None:
                simulated = float(engine.times.sum())
                watch(simulated - told)
                told = simulated
        results.end(members, engine, scenarios, controls)

    clock = None if decision_limit is None else DecisionClock(decision_limit)
    with clock or nullcontext():
        todo = deque(groups.items())
        while todo:
            key, members = todo.popleft()
            with _BUILDING:
                world = _shared_world(*key, tuple(entry.world_car() for entry in opponents.entries))
            laps_to_drive(world.track, laps)  # refuses more than a scene has
            try:
                drive(world, members)
            except ControllerError:
                if len(members) > 1:
                    todo.extendleft((key, [i]) for i in reversed(members))
                else:
                    results.fail(members[0], scenarios[members[0]].seed, "planner_failed")
    return results.gathered()


def laps_within(course: Course, laps: int | None, time_limit: float) -> int:
    """Return the number of laps that a world has room for; None: those of a car of 20 m/s in the time limit [s]."""
    return course.most_laps or laps or int(time_limit * _FASTEST / course.length) + 2


def result_dtype(*, among: bool) -> np.dtype[Any]:
    """Return the type of a world's row: RESULT, and where car 0 is `among` opponents AMONG behind it."""
    return np.dtype([*RESULT.descr, *AMONG.descr]) if among else RESULT


def undriven_world(seed: int, reason: str, record: str, *, among: bool = False) -> WorldResults:
    """Return the results of one world that was not driven: its figures are NaN, and nothing is recorded of it.

    Args:
      seed: of the world.
      reason: why, one of END_REASONS.
      record: as `drive_worlds` takes it.
      among: whether there are opponents.
    """
    results = _Results(1, Record.of(record), among=among)
    results.fail(0, seed, reason)
    return results.gathered()


def make_engine(
    world: World,
    scenarios: Sequence[Scenario],
    controller: str,
    *,
    laps: int,
    time_limit: float,
    timed: Callable[[Decide], DriveCommand] | None = None,
    opponents: Opponents | None = None,
) -> Engine:
    """Return an engine of worlds that share a compiled model, their cars at the start, each with a planner of its own.

    Args:
      world: what they share; where any scenario has a `command_delay`, its car must have one.
      scenarios: one for each world.
      controller: as `race` takes it by name.
      laps: to be driven.
      time_limit: of simulated time [s].
      timed: as `adapt` takes it.
      opponents: that the world has cars for; None: none.
    """
    if opponents is not None and opponents.entries:
        return _make_field(world, scenarios, controller, opponents, laps=laps, time_limit=time_limit, timed=timed)
    changes = [scenario.all_changes for scenario in scenarios]
    engine = Engine(world, len(scenarios), changes=changes, laps=laps, time_limit=time_limit)
    kind = find_controller(controller)  # once: what is in a file becomes a new class each time
    planners = []
    for scenario, car in zip(scenarios, engine.cars, strict=True):
        context = scenario.context(car.parameters, world.track.map_line)
        planner = build_controller(kind, controller, context, scenario.planner_settings)
        start(planner)
        planners.append(planner)
    engine.planners = adapt(planners, timed=timed)
    engine.place(
        [scenario.start for scenario in scenarios], effects=[scenario.effects for scenario in scenarios],
        seeds=[scenario.seed for scenario in scenarios],
        odometry_drifts=[scenario.odometry_drift for scenario in scenarios],
        sensors=[scenario.sensed for scenario in scenarios],
    )  # fmt: skip
    return engine


def _make_field(
    world: World,
    scenarios: Sequence[Scenario],
    controller: str,
    opponents: Opponents,
    *,
    laps: int,
    time_limit: float,
    timed: Callable[[Decide], DriveCommand] | None,
) -> Engine:
    """Return an engine as `make_engine` does, of worlds of several cars."""
    count, cars = len(scenarios), len(opponents.names)
    entries = [
        entry
        for scenario in scenarios
        for entry in opponents.line_up(world.track, entry_of(scenario, controller), scenario.obstacles, drawn=True)
    ]
    plain = [CarChanges()] * (cars - 1)  # what differs in the opponents is compiled into the world
    changes = [change for scenario in scenarios for change in (scenario.all_changes, *plain)]
    engine = Engine(world, count, changes=changes, laps=laps, time_limit=time_limit)
    groups: list[tuple[NDArray[np.int64], Planners]] = []
    for own in entries[:cars]:
        source, _ = split_controller(own.controller, None)
        kind = find_controller(str(source))  # once: what is in a file becomes a new class each time
        rows = np.arange(len(groups), count * cars, cars)
        planners = [
            entry_planner(entries[row], car=engine.cars[row].parameters, map_line=world.track.map_line, kind=kind)
            for row in rows.tolist()
        ]
        groups.append((rows, adapt(planners, timed=timed)))
    engine.planners = PlannersOfEach(groups)
    engine.place(
        [entry.start or Start() for entry in entries], effects=[entry.effects for entry in entries],
        seeds=[entry.seed for entry in entries], odometry_drifts=[entry.odometry_drift for entry in entries],
        sensors=[entry.sensed for entry in entries],
    )  # fmt: skip
    return engine


def _worlds(cars: NDArray[np.bool_], engine: Engine) -> NDArray[np.bool_]:
    """Return whether each world has any of some cars (r,). Shape (n,)."""
    found: NDArray[np.bool_] = np.any(cars.reshape(engine.count, -1), axis=1)
    return found


_BUILDING = Lock()  # threads that want the same world build it once


@lru_cache(maxsize=8)
def _shared_world(
    track: Course | str,
    car: Vehicle,
    tires: Tires,
    patches: tuple[Patch, ...],
    obstacles: tuple[Obstacle, ...],
    delayed: bool,
    others: tuple[WorldCar, ...],
) -> World:
    """Return a world to be read by any thread; a delay is one of 0 s, for each world's own to be put in its place."""
    changes = CarChanges(command_delay=0.0) if delayed else None
    return World(track, car, tires=tires, patches=patches, obstacles=obstacles, changes=changes, others=others)


class _Results:
    """Gathers what the groups leave."""

    def __init__(self, count: int, record: Record, *, among: bool) -> None:
        self._rows = np.zeros(count, result_dtype(among=among))
        self._lap_times: list[FloatArray] = [np.empty(0)] * count  # [s] of each world
        self._record = record.what
        self._step = record.step
        self._recorder: ScanRecorder | None = None  # of the worlds that are being driven
        self._scans: list[NDArray[np.void]] = [_NO_SCANS] * count
        self._telemetry: list[list[FloatArray]] = [[] for _ in range(count)]
        self._states: list[list[FloatArray]] = [[] for _ in range(count)]
        self._ctrl: list[list[FloatArray]] = [[] for _ in range(count)]

    def begin(self, members: Sequence[int], engine: Engine) -> None:
        for i in members:
            self._telemetry[i], self._states[i], self._ctrl[i] = [], [], []
        if self._record == "states":
            for place, i in enumerate(members):
                self._states[i].append(engine.state(place).copy())
        if self._record == "scans":
            self._recorder = ScanRecorder(ScanLayout.of(engine.beams, self._step), engine.count)

    def add(
        self, members: Sequence[int], engine: Engine, driven: NDArray[np.bool_], ran: NDArray[np.bool_]
    ) -> None:
        """Keep the tick of the worlds that ran it (n,): of car 0 the telemetry, or if it was driven (r,) the scan."""
        if self._record == "summary":
            return
        if self._recorder is not None:
            self._recorder.add(engine, ran & driven[:: engine.cars_per_world])
            return
        for place in map(int, np.flatnonzero(ran)):
            i = members[place]
            self._telemetry[i].append(engine.telemetry[place * engine.cars_per_world].copy())
            if self._record == "states":
                self._states[i].append(engine.state(place).copy())
                self._ctrl[i].append(engine.ctrl(place).copy())

    def end(
        self,
        members: Sequence[int],
        engine: Engine,
        scenarios: Sequence[Scenario],
        controls: Sequence[RaceRecord],
    ) -> None:
        """Take how it went for car 0 of each world; `controls` watched the worlds with opponents."""
        if self._recorder is not None:
            for i, rows in zip(members, self._recorder.rows(), strict=True):
                self._scans[i] = rows
        times = engine.times
        for place, i in enumerate(members):
            first = place * engine.cars_per_world
            row, statistics = self._rows[i], engine.statistics[first]
            driven = engine.monitor.lap_times[first, : engine.monitor.timers["laps_completed"][first]]
            self._lap_times[i] = driven.copy()
            row["seed"] = scenarios[i].seed
            row["end_reason"] = END_REASONS[engine.monitor.reasons[first]]
            row["laps_completed"] = len(driven)
            row["sim_time_s"] = times[place]
            row["distance_m"] = engine.monitor.timers["progress"][first]
            row["first_lap_s"] = driven[0] if len(driven) else np.nan
            row["best_lap_s"] = driven.min() if len(driven) else np.nan
            row["collisions"] = engine.crashed[first]
            for name, value in statistics_figures(statistics).items():
                row[name] = value
        for i, control in zip(members if controls else (), controls, strict=True):
            control.finish()
            among = AmongCars.of(
                position=control.order().index(0) + 1, overtakes=control.overtakes, contacts=control.contacts,
                winner=control.winner,
            )  # fmt: skip
            for name in AMONG_CARS:
                self._rows[i][name] = getattr(among, name)

    def fail(self, i: int, seed: int, reason: str) -> None:
        """Note a world that was not driven."""
        self._telemetry[i], self._states[i], self._ctrl[i], self._scans[i] = [], [], [], _NO_SCANS
        row = self._rows[i]
        for name in row.dtype.names:
            kind = row.dtype[name].kind
            row[name] = math.nan if kind == "f" else "" if kind == "U" else 0
        row["seed"], row["end_reason"], row["sim_time_s"], row["distance_m"] = seed, reason, 0.0, 0.0

    def gathered(self) -> WorldResults:
        def stacked(rows: list[list[FloatArray]], *wanted: str) -> tuple[FloatArray, ...]:
            arrays = (np.array(ticks) if ticks else np.empty((0, 0)) for ticks in rows)
            return tuple(arrays) if self._record in wanted else ()

        lap_times = np.full((len(self._rows), max(map(len, self._lap_times), default=1) or 1), np.nan)
        for row, driven in zip(lap_times, self._lap_times, strict=True):
            row[: len(driven)] = driven
        return WorldResults(
            rows=self._rows,
            lap_times_s=lap_times,
            telemetry=stacked(self._telemetry, "telemetry", "states"),
            states=stacked(self._states, "states"),
            ctrl=stacked(self._ctrl, "states"),
            scans=tuple(self._scans) if self._record == "scans" else (),
        )
