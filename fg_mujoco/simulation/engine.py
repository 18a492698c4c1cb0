"""The engine: n worlds of m cars, stepped together in lockstep.

    engine = Engine(World("oval"), 64, laps=1)
    engine.place(starts=[Start(s=0.5 * i) for i in range(64)])
    while engine.running.any():
        engine.sense()
        engine.decide()
        engine.drive()
        engine.judge()

Arrays have one row a car: the m cars of world 0, then those of world 1. A race is an engine of one world; rollouts and
environments are engines of many. Each world's result is the same, bit for bit, whatever the others are.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..course.moving_obstacles import make_mover
from ..errors import ModelError
from ..lidar.beams import Beams
from ..lidar.effects import LidarEffects, ScanPipeline
from ..lidar.lidar import Lidar, RaycastLidar
from ..messages import ODOMETRY, FloatArray, LaserScan
from ..vehicle.car import WHEELS, Car
from ..vehicle.changes import CarChanges, change_worlds, six_digits
from ..vehicle.motion import ground_speed
from ..vehicle.tire_slip import TireSlipMeter
from .array_table import ArrayTable
from .compiled_tick import NAMES, course_numbers, drive, judge, read, sense, whole_places
from .physics import STATE, Batch, StateLayout
from .planner_adapter import Planners
from .settings import Start
from .telemetry import STATISTICS, TELEMETRY
from .termination import RaceMonitor
from .tick import book_cars, hold_commands, motion_table, place_obstacles
from .world import CAR_PREFIX, World

Mask = NDArray[np.bool_]
Hook = Callable[["Engine", NDArray[np.int32]], None]
"""Called with the engine and the worlds that are being stepped."""

_ROWS_A_THREAD = 4  # fewer are sensed sooner than a thread is woken


@dataclass(frozen=True, kw_only=True)
class _Part:
    """Consecutive worlds that one thread drives."""

    worlds: slice
    cars: slice
    batch: Batch
    scratch: Any  # of the LiDAR
    slip: FloatArray  # (4, substeps, 4)
    ids: NDArray[np.int32]
    controls: FloatArray  # (worlds, substeps, controls and positions of obstacles)


class Engine:
    """n worlds of m cars. m is 1 for now.

    Args:
      world: that all share.
      count: how many worlds, n.
      changes: what differs in the car of each world, (n,); None: nothing.
      laps: to be driven.
      time_limit: of simulated time [s]; None: that of the course.
      period: of a tick [s]; None: the LiDAR's.
      threads: that drive the worlds.
      own_model: step `world.model` itself, so that changes to it take effect; else a copy.

    Attributes:
      world: as given.
      period: time that a tick takes [s].
      substeps: physics steps of a tick.
      odometry: (r,) of ODOMETRY, last sensed; r is n m.
      ranges: (r, beams) [m] as in LaserScan, last sensed.
      scans: of the cars whose LiDAR has effects, last sensed, by row.
      commands: (r, 2) [rad, m/s] that `drive` holds.
      crashed: (r,) whether the chassis has touched anything since it was placed.
      failed: (r,) whether the planner or the engine failed.
      telemetry: of the last tick, (r, len(TELEMETRY)).
      statistics: since the cars were placed, (r,) of STATISTICS.
      monitor: RaceMonitor of the races.
      planners: whose `decide` is called; None: somebody else writes the commands.
      before_substep: hooks that act before each physics step.
      after_substep: hooks that act after each.

    Raises:
      ModelError: a timestep that does not divide the period.
    """

    def __init__(
        self,
        world: World,
        count: int = 1,
        *,
        changes: Sequence[CarChanges] | None = None,
        laps: int = 1,
        time_limit: float | None = None,
        period: float | None = None,
        threads: int = 1,
        own_model: bool = False,
    ) -> None:
        model = world.model
        self.world, self.count, self.cars_per_world = world, count, 1
        self.beams = world.lidar.beams
        self.period = self.beams.period if period is None else period
        self.substeps = whole_steps(self.period, model.opt.timestep)
        self._timestep = float(model.opt.timestep)
        self._layout = StateLayout.of(model)
        self._motions = motion_table(world.moving)
        self._mover = make_mover(model)

        cars = count * self.cars_per_world
        meter = TireSlipMeter(model, CAR_PREFIX)
        self._tires, self._chassis_contact = meter.readings.start, world.car.chassis_contact
        self._mu = np.tile(meter.mu, (cars, 1))
        self._parts = self._make_parts(min(threads, count))
        self._pool = ThreadPoolExecutor(threads) if threads > 1 and count >= 2 * _ROWS_A_THREAD else None
        self.cars = [world.car] * cars
        if own_model:
            for part in self._parts:
                part.batch.set_models([model] * len(part.batch.states))
        elif changes is not None:
            self._change(changes)
        self._constants = np.concatenate([car.constants for car in self.cars])

        self.odometry = np.zeros(cars, ODOMETRY)
        self.ranges = np.empty((cars, len(self.beams.bearings)))
        self.scans: dict[int, LaserScan] = {}
        self.commands = np.zeros((cars, 2))
        self.crashed, self.failed = np.zeros(cars, np.bool_), np.zeros(cars, np.bool_)
        self.telemetry = np.full((cars, len(TELEMETRY)), np.nan)
        self.statistics = np.zeros(cars, STATISTICS)
        self.planners: Planners | None = None
        self.before_substep: list[Hook] = []
        self.after_substep: list[Hook] = []
        self._pipelines: dict[int, ScanPipeline] = {}
        self._data: dict[int, mujoco.MjData] = {}
        self.monitor = RaceMonitor(
            world.track, self._constants, self.cars_per_world, self._layout, laps=laps, time_limit=time_limit,
            period=self.period,
        )  # fmt: skip
        self._arrays = self._tables()

    def _make_parts(self, threads: int) -> list[_Part]:
        parts, m = [], self.cars_per_world
        nu, moving = self.world.model.nu, len(self._motions)
        for k in range(threads):
            first, end = self.count * k // threads, self.count * (k + 1) // threads
            scene = self._drawn.scene if self._drawn is not None else None
            parts.append(
                _Part(
                    worlds=slice(first, end),
                    cars=slice(first * m, end * m),
                    batch=Batch(self.world.model, end - first, self.substeps),
                    scratch=None if scene is None else scene.scratch(),
                    slip=np.full((4, self.substeps, len(WHEELS)), np.nan),
                    ids=np.empty(end - first, np.int32),
                    controls=np.zeros((end - first if moving else 0, self.substeps, nu + 3 * moving)),
                )
            )
        return parts

    def _change(self, changes: Sequence[CarChanges]) -> None:
        """Change the cars of the worlds; one whose parameters no planner can tell from the plain one's is that one."""
        scratch = copy(self.world.model)
        for part in self._parts:
            own = changes[part.worlds]
            change_worlds(part.batch, own, self.world.vehicle.compile(), CAR_PREFIX)
            for i, change in enumerate(own):
                row = part.cars.start + i
                if change.mu is not None:
                    self._mu[row] = six_digits(change.mu)
                if replace(change, mu=None, command_delay=None) != CarChanges():
                    self.cars[row] = Car(part.batch.model_of(i, scratch), CAR_PREFIX)

    def _tables(self) -> list[ArrayTable]:
        """Return the arrays of each part as one table, which kernels are called with."""
        drawn, monitor = self._drawn, self.monitor
        mount = drawn.mount if drawn is not None else None
        course = monitor.course
        tables = []
        for part in self._parts:
            rows, batch = part.cars, part.batch
            arrays: dict[str, Any] = {
                "places": whole_places(
                    self.cars_per_world, self._tires, self._chassis_contact, batch, monitor.laps, mount, self._layout
                ),
                "times": course_numbers(self._timestep, monitor),
                "states": batch.states, "sensors": batch.sensors, "records": batch.records, "status": batch.status,
                "warnings": batch.warnings, "slip": part.slip, "ids": part.ids, "controls": part.controls,
                "motions": self._motions, "cars": self._constants[rows], "mu": self._mu[rows],
                "commands": self.commands[rows], "odometry": self.odometry[rows], "ranges": self.ranges[rows],
                "telemetry": self.telemetry[rows], "statistics": self.statistics[rows],
                "crashed": self.crashed[rows], "failed": self.failed[rows], "running": monitor.running[rows],
                "reasons": monitor.reasons[rows], "timers": monitor.timers[rows],
                "lap_times": monitor.lap_times[rows], "standing_since": monitor.standing_since[rows],
            }  # fmt: skip
            if course is not None:
                arrays["table"] = np.ascontiguousarray(course.table)
            if drawn is not None and mount is not None:
                arrays |= drawn.scene.arrays._asdict() | part.scratch._asdict()
                arrays |= {"offset_position": mount.offset_position, "offset_rotation": mount.offset_rotation}
            tables.append(ArrayTable(NAMES, arrays))
        return tables

    @cached_property
    def lidar(self) -> Lidar:
        """Measures without effects, in data of the world's model."""
        return self.world.make_lidar()

    @cached_property
    def _drawn(self) -> RaycastLidar | None:
        """The LiDAR whose scans are drawn by `scan_cars`; None: each scan is measured in Python, by `lidar`."""
        lidar = self.world.lidar
        draws = isinstance(lidar, RaycastLidar) and lidar.draws and lidar.mount is not None
        return lidar if draws and isinstance(lidar, RaycastLidar) else None

    @property
    def running(self) -> Mask:
        """Which cars still race. Shape (r,)."""
        return self.monitor.running

    @property
    def times(self) -> FloatArray:
        """Simulated in each world since its cars were placed, a copy. Shape (n,) [s]."""
        return np.concatenate([part.batch.states[:, self._layout.time] for part in self._parts])

    def time(self, i: int) -> float:
        """Return the time simulated in world i since its cars were placed [s]."""
        return float(self.state(i)[self._layout.time])

    def unstable(self, i: int) -> bool:
        """Return whether MuJoCo has met a bad state in world i since it was placed, and so reset it by itself."""
        part, place = self._place_of(i)
        return bool(part.batch.warned[place])

    def state(self, i: int) -> FloatArray:
        """Return the complete state of world i (mjSTATE_INTEGRATION). Live: what is written there is driven from."""
        part, place = self._place_of(i)
        row: FloatArray = part.batch.states[place]
        return row

    def qpos(self, i: int) -> FloatArray:
        """Return the positions of world i, (nq,) as in mujoco.MjData. Live."""
        first, end = self._layout.qpos
        return self.state(i)[first:end]

    def ctrl(self, i: int) -> FloatArray:
        """Return what the actuators of world i get. Live."""
        first, end = self._layout.ctrl
        return self.state(i)[first:end]

    def free_joint(self, row: int) -> tuple[FloatArray, FloatArray]:
        """Return position and quaternion (7,) of a car's base_link [m], and its velocity (2,) [m/s], in the world."""
        state, car = self.state(row // self.cars_per_world), self._constants[row]
        qpos, qvel = self._layout.qpos[0] + int(car["free_qpos"]), self._layout.qvel[0] + int(car["free_dof"])
        return state[qpos : qpos + 7].copy(), state[qvel : qvel + 2].copy()

    def speed(self, row: int) -> float:
        """Return the true speed of a car along its heading [m/s], forward positive."""
        state, (first, end) = self.state(row // self.cars_per_world), self._layout.qvel
        return ground_speed(self.qpos(row // self.cars_per_world), state[first:end], self._constants[row : row + 1])

    def slip(self, part: int = 0) -> FloatArray:
        """Return what the tires of the car that was driven last did, (4, substeps, 4), as TireSlip.values. Live."""
        return self._parts[part].slip

    def read(self, i: int, data: mujoco.MjData) -> None:
        """Write world i into a mujoco.MjData of `world.model`, poses current."""
        part, place = self._place_of(i)
        part.batch.read(place, data)
        mujoco.mj_kinematics(self.world.model, data)  # a step leaves poses one timestep behind the state

    def place(
        self,
        starts: Sequence[Start],
        which: Mask | None = None,
        *,
        effects: Sequence[LidarEffects] | None = None,
        seeds: Sequence[int] | None = None,
    ) -> None:
        """Place cars at their starts and begin their races.

        Args:
          starts: one for each of the cars.
          which: (r,) the cars, whole worlds; None: all.
          effects: what the LiDAR of each does to a scan; None: nothing.
          seeds: of the LiDAR's noise of each; needed with effects.
        """
        chosen = np.ones(len(self.commands), np.bool_) if which is None else which
        rows = np.flatnonzero(chosen)
        for part in self._parts:
            worlds = np.flatnonzero(chosen[part.cars][:: self.cars_per_world]).astype(np.int32)
            if len(worlds):
                part.batch.reset(worlds)  # warnings and all else that no state holds
        data = mujoco.MjData(self.world.model)
        for place, (row, start) in enumerate(zip(rows.tolist(), starts, strict=True)):
            self._write_start(row // self.cars_per_world, start, data)
            self._pipelines.pop(row, None)
            if effects is not None and effects[place] != LidarEffects():
                assert seeds is not None
                self._pipelines[row] = self._pipeline(row, effects[place], seeds[place])
        for part in self._parts:
            worlds = np.flatnonzero(chosen[part.cars][:: self.cars_per_world]).astype(np.int32)
            if len(worlds):
                part.batch.forward(worlds)
            touched = np.repeat(part.batch.sensors[:, self._chassis_contact] > 0.0, self.cars_per_world)
            self.crashed[part.cars] = np.where(chosen[part.cars], touched, self.crashed[part.cars])
        self.failed[chosen] = False
        self.statistics[chosen] = np.zeros(1, STATISTICS)
        self.telemetry[chosen] = np.nan
        for part in self._parts:
            self.monitor.begin(chosen, part.cars, part.batch.states, part.batch.warnings, self.crashed[part.cars])

    def sense(self, which: Mask | None = None) -> None:
        """Take the scans and odometry of cars, (r,); None: of all that race. Once for each moment: noise is drawn."""
        chosen = self.running if which is None else which

        take = read if self._drawn is None else sense
        self._share(lambda k: take(self._arrays[k].rows, chosen[self._parts[k].cars]))
        if self._drawn is None:
            for row in map(int, np.flatnonzero(chosen)):
                self.ranges[row] = self.lidar.ranges(self._data_of(row // self.cars_per_world))
        if self._pipelines:
            self.scans = {
                row: pipeline.scan(self._data_of(row // self.cars_per_world, pipeline))
                for row, pipeline in self._pipelines.items()
                if chosen[row]
            }
            for row, scan in self.scans.items():
                self.ranges[row] = scan.ranges

    def decide(self) -> None:
        """Have the planners command the cars that race; those whose planner fails race no longer."""
        assert self.planners is not None
        failed = self.planners(self)
        if failed is not None:
            self.failed |= failed
            self.monitor.end(failed, "failed")

    def load(self, state: FloatArray, i: int = 0, *, effects: LidarEffects | None = None, seed: int = 0) -> None:
        """Go on in world i from a recorded state (k,); no race is timed there.

        Args:
          state: complete, as `state` returns it.
          i: the world.
          effects: what its LiDARs do to a scan; None: nothing.
          seed: of their noise.
        """
        part, place = self._place_of(i)
        part.batch.states[place] = state
        part.batch.forward(np.array([place], np.int32))
        part.batch.states[place] = state  # a forward pass leaves another start for the solver
        rows = range(i * self.cars_per_world, (i + 1) * self.cars_per_world)
        for row in rows:
            self._pipelines.pop(row, None)
            if effects is not None and effects != LidarEffects():
                self._pipelines[row] = self._pipeline(row, effects, seed)
        self.running[rows.start : rows.stop] = True

    def drive(self, *, controls: FloatArray | None = None) -> None:
        """Hold the commands for a tick in the worlds whose cars race.

        Args:
          controls: of the actuators, as recorded, (n, controls), instead of the commands; None: the commands are held.
        """
        if self.before_substep or self.after_substep or self._swept or controls is not None:
            self._drive_in_steps(controls)
        else:
            self._share(lambda k: drive(self._arrays[k].rows))
        if self.failed.any():
            self.monitor.end(self.failed & self.running, "failed")

    def judge(self) -> None:
        """Time the laps of the cars that race and end what is over."""
        if self.monitor.course is not None:
            for table in self._arrays:
                judge(table.rows)

    def tick(self) -> None:
        """Sense, decide, drive and judge."""
        self.sense()
        self.decide()
        self.drive()
        self.judge()

    def interrupt(self) -> None:
        """End the races that still run."""
        self.monitor.end(self.running.copy(), "interrupted")

    def close(self) -> None:
        """Let go of the threads."""
        if self._pool is not None:
            self._pool.shutdown()
            self._pool = None

    def _place_of(self, i: int) -> tuple[_Part, int]:
        """Return the part that has world i, and its place there."""
        part = self._parts[0]
        if i >= part.worlds.stop:
            part = next(part for part in self._parts if i < part.worlds.stop)
        return part, i - part.worlds.start

    def _write_start(self, row: int, start: Start, data: mujoco.MjData) -> None:
        """Put a car at its start: at rest on its springs, everything else as in a new world."""
        model = self.world.model
        mujoco.mj_resetData(model, data)
        if self._mover is not None:
            self._mover.place(data)
        x, y, along = self.world.track.start_pose(start.s, start.offset)
        self.world.car.write_pose(data, x, y, along + start.heading, start.speed)
        mujoco.mj_getState(model, data, self.state(row // self.cars_per_world), int(STATE))

    def _pipeline(self, row: int, effects: LidarEffects, seed: int) -> ScanPipeline:
        lidar = self.lidar if effects.motion_distortion else RangesRow(self.beams, self.ranges[row])
        return ScanPipeline(lidar, effects, np.random.default_rng(seed))

    def _data_of(self, i: int, pipeline: ScanPipeline | None = None) -> Any:
        """Return what a LiDAR in Python reads world i from; a pipeline that does not look at bodies wants the time."""
        if pipeline is not None and not pipeline.needs_every_step:
            return SimpleNamespace(time=float(self.state(i)[self._layout.time]))
        data = self._data.setdefault(i, mujoco.MjData(self.world.model))
        self.read(i, data)
        return data

    @property
    def _swept(self) -> bool:
        """Whether any LiDAR moves during its sweep."""
        return any(pipeline.needs_every_step for pipeline in self._pipelines.values())

    def _drive_in_steps(self, controls: FloatArray | None) -> None:
        """Drive as `drive_cars` does, one physics step after the other, hooks in between."""
        m, layout = self.cars_per_world, self._layout
        for part in self._parts:
            batch, running = part.batch, self.running[part.cars].reshape(-1, m)
            ids = np.flatnonzero(running.any(axis=1)).astype(np.int32)
            worlds = ids + part.worlds.start
            part.ids[: len(ids)] = ids
            rows = part.cars
            if controls is not None:
                batch.states[:, slice(*layout.ctrl)] = controls[part.worlds]
            else:
                hold_commands(
                    part.ids, len(ids), m, batch.states, layout, self.commands[rows], self._constants[rows],
                    self.telemetry[rows],
                )  # fmt: skip
            for step in range(self.substeps):
                for hook in self.before_substep:
                    hook(self, worlds)
                batch.step(ids, step)
                for i in ids.tolist():
                    place_obstacles(self._motions, batch.states[i], layout)
                for hook in self.after_substep:
                    hook(self, worlds)
                for row, pipeline in self._pipelines.items():
                    if pipeline.needs_every_step and row // m in worlds:
                        pipeline.record(self._data_of(row // m, pipeline))
            book_cars(
                part.ids, len(ids), m, batch.records, batch.status, self.failed[rows], self._tires,
                self._chassis_contact, self._mu[rows], part.slip, self.crashed[rows], self.telemetry[rows],
                self.statistics[rows],
            )  # fmt: skip

    def _share(self, work: Callable[[int], None]) -> None:
        """Do some work on each part, each in a thread; kernels run without the GIL."""
        if self._pool is None:
            for k in range(len(self._parts)):
                work(k)
        else:
            list(self._pool.map(work, range(len(self._parts))))


class RangesRow:
    """A car's row of ranges, as the LiDAR that its ScanPipeline measures with."""

    def __init__(self, beams: Beams, row: FloatArray) -> None:
        self.beams = beams
        self._row = row

    def ranges(self, data: Any) -> FloatArray:
        """Return a copy of the row [m]. Shape (beams,)."""
        return self._row.copy()


def whole_steps(period: float, timestep: float) -> int:
    """Return how many physics steps make one period.

    Raises:
      ModelError: not a whole number of them.
    """
    steps = round(period / timestep)
    if steps < 1 or abs(steps * timestep - period) > 1e-9:
        raise ModelError(f"timestep is {timestep} s; accepted: a whole fraction of the LiDAR's period of {period} s")
    return steps
