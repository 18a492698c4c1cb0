"""Worlds of one compiled model, stepped together: the tick of `race`, its loops over the worlds compiled.

Each world's result is the same, bit for bit, whatever the others are, and that of the same world driven alone by
`race`: both read the car, scan, plan, meter the slip and time the laps by the same kernels, and mujoco.batch steps the
physics as mj_step does.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
from mujoco.batch import Batch, SimulationError
from numpy.typing import NDArray

from ..course.moving_obstacles import make_mover
from ..errors import ControllerError
from ..lidar.beams import Beams
from ..lidar.effects import LidarEffects, ScanPipeline
from ..lidar.lidar import RaycastLidar
from ..messages import ODOMETRY, Controller, ControllerBatch, FloatArray, LaserScan, MapLine, Odometry
from ..racing.planner_loading import build_controller, find_controller
from ..vehicle.car import Car
from ..vehicle.changes import CarChanges, change_worlds, six_digits
from ..vehicle.tire_slip import TireSlipMeter
from .batch_kernels import book_worlds, command_worlds, not_finite, sense_worlds
from .planner_adapter import plan, start
from .scenario import Scenario
from .simulation import BAD_STATE, STATE, whole_steps
from .telemetry import TALLY, TELEMETRY
from .termination import END_REASONS, Referee
from .world import CAR_PREFIX, World

_FAILED, _INTERRUPTED = END_REASONS.index("failed"), END_REASONS.index("interrupted")
_CTRL_AND_MOCAP = int(mujoco.mjtState.mjSTATE_CTRL) | int(mujoco.mjtState.mjSTATE_MOCAP_POS)
_NUMBER = 1  # of the fields of mjWarningStat
_ODOMETRY = ODOMETRY.names or ()


class WorldGroup:
    """Worlds that differ in what a compiled model can change: the car's constants, the start, LiDAR noise, the planner.

    Args:
      world: what they share; where any scenario has a `command_delay`, its car must have one.
      scenarios: one for each world.
      controller: as `race` takes it by name.
      laps: to be driven.
      time_limit: of simulated time [s].

    Attributes:
      referee: of the races: laps, and which worlds still run.
      times: simulated in each world [s], (n,).
      tallies: figures, (n,) of TALLY.
      telemetry: of the last tick of each world, (n, len(TELEMETRY)).
      ctrl: what the actuators got in it, (n, 2).
      crashed: whether the chassis has touched anything, (n,).
      failed: whether the planner or the engine raised, (n,).
      states: complete state of each world's physics, (n, k), as Simulation.state.
      period: time that a tick takes [s].
    """

    def __init__(
        self, world: World, scenarios: Sequence[Scenario], controller: str, *, laps: int, time_limit: float
    ) -> None:
        count = len(scenarios)
        self._world = world
        self._batch = Batch(world.model, count, nthread=1, persistent=True)
        self.states = self._batch.state
        change_worlds(self._batch, [scenario.car for scenario in scenarios], world.vehicle.compile(), CAR_PREFIX)
        cars = self._cars_of([scenario.car for scenario in scenarios])
        self._cars = np.concatenate([car.constants for car in cars])
        meter = TireSlipMeter(world.model, CAR_PREFIX)
        self._mu = np.tile(meter.mu, (count, 1))
        for mu, scenario in zip(self._mu, scenarios, strict=True):
            if scenario.car.mu is not None:
                mu[:] = six_digits(scenario.car.mu)
        self._tires, self._chassis_contact = meter.readings.start, world.car.chassis_contact

        lidar = world.make_lidar()
        assert isinstance(lidar, RaycastLidar) and lidar.mount is not None
        self.period, self._mount, self._scene = lidar.beams.period, lidar.mount, lidar.scene
        self._scratch = self._scene.scratch()
        self._ranges = np.empty((count, len(lidar.beams.bearings)))
        self._pipelines = {
            i: ScanPipeline(
                RangesRow(lidar.beams, self._ranges[i]), scenario.effects, np.random.default_rng(scenario.seed)
            )
            for i, scenario in enumerate(scenarios)
            if scenario.effects != LidarEffects()
        }
        self._mover = make_mover(world.model)
        # of the moving obstacles, as the scans want them; all worlds that run are at the same time
        self._moving, self._turned = np.zeros((len(world.moving), 3)), np.tile(np.eye(3), (len(world.moving), 1, 1))
        kind = find_controller(controller)  # once: what is in a file becomes a new class each time
        planners = [
            _planner(kind, controller, world.track.map_line, world.vehicle.nominal_mu, *pair)
            for pair in zip(scenarios, cars, strict=True)
        ]
        self._decide = _together(planners, lidar.beams)

        substeps = whole_steps(lidar.beams.period, world.model.opt.timestep)
        self._records = np.empty((count, substeps, world.model.nsensordata))
        self._slip = np.empty((4, substeps, 4))
        self._odometry = np.zeros(count, ODOMETRY)
        self._commands = np.zeros((count, 2))
        self.crashed = np.zeros(count, np.bool_)
        self.failed = np.zeros(count, np.bool_)
        self.tallies = np.zeros(count, TALLY)
        self.telemetry = np.full((count, len(TELEMETRY)), np.nan)
        self._place(scenarios)
        self.referee = Referee(
            world.track, self._cars, laps=laps, time_limit=time_limit, period=self.period, qpos=self._qpos
        )
        self._judge()

    @property
    def running(self) -> NDArray[np.bool_]:
        """Which worlds still run. Shape (n,)."""
        return self.referee.running

    def tick(self) -> None:
        """Drive all worlds that run for one period of the LiDAR, and judge which of them go on."""
        if self._mover is not None and self.running.any():
            self._mover.write_positions(float(self.times[self.running][0]), self._moving)
        sense_worlds(
            self.running, self.times, self._qpos, self._qvel, self._sensors, self._cars, self.referee.timers,
            self._mount, self._moving, self._turned, self._scene.arrays, self._scratch, self._odometry, self._ranges,
            self.telemetry,
        )  # fmt: skip
        scans = {
            i: pipeline.scan(SimpleNamespace(time=float(self.times[i])))
            for i, pipeline in self._pipelines.items()
            if self.running[i]
        }
        for i, scan in scans.items():
            self._ranges[i] = scan.ranges
        self._end(self._decide(scans, self._ranges, self._odometry, self.running, self._commands))
        command_worlds(self.running, self._qvel, self._commands, self._cars, self.ctrl, self.telemetry)
        stepped = np.flatnonzero(self.running).astype(np.int32)
        self._step(stepped)
        book_worlds(
            stepped, self._records, self._tires, self._chassis_contact, self._mu, self._slip, self._sensors,
            self.crashed, self.telemetry, self.tallies,
        )  # fmt: skip
        self._judge()

    def _cars_of(self, changes: Sequence[CarChanges]) -> list[Car]:
        """Return the car of each world; one whose parameters no planner can tell from the plain one's is that one."""
        cars, model = [self._world.car] * len(changes), copy(self._world.model)
        for i, change in enumerate(changes):
            if replace(change, mu=None, command_delay=None) != CarChanges():
                cars[i] = Car(self._batch.get_model(i, model), CAR_PREFIX)
        return cars

    def _place(self, scenarios: Sequence[Scenario]) -> None:
        """Put each car at its start, as Simulation.reset does."""
        world, batch = self._world, self._batch
        data = mujoco.MjData(world.model)
        for state, scenario in zip(self.states, scenarios, strict=True):
            mujoco.mj_resetData(world.model, data)
            if self._mover is not None:
                self._mover.place(data)
            x, y, along = world.track.start_pose(scenario.start.s, scenario.start.offset)
            world.car.write_pose(data, x, y, along + scenario.start.heading, scenario.start.speed)
            mujoco.mj_getState(world.model, data, state, STATE)
        sensors = batch.bind("sensordata")
        batch.forward()
        self._sensors = sensors.copy()
        self.crashed[:] = sensors[:, self._chassis_contact] > 0.0
        # kernels want rows side by side, and those of the batch's state are not
        self._qpos, self._qvel = batch.bind("qpos").copy(), batch.bind("qvel").copy()
        self.ctrl, self.times = batch.bind("ctrl").copy(), batch.bind("time").copy()

    def _step(self, worlds: NDArray[np.int32]) -> None:
        """Step the physics of some worlds for a tick, and record their sensors at each step."""
        batch = self._batch
        if len(worlds) == 0:
            return
        batch.bind("ctrl")[...] = self.ctrl
        records, steps = {"sensordata": self._records[: len(worlds)]}, self._records.shape[1]
        moved: dict[str, Any] = {}
        if self._mover is not None:  # before each step, as hold_controls does
            time, timestep = float(self.times[worlds[0]]), self._world.model.opt.timestep
            path = self._mover.positions(time, timestep, steps).reshape(steps + 1, -1)
            ctrl = np.repeat(self.ctrl[worlds, None], steps, axis=1)
            along = np.broadcast_to(path[:-1], (len(worlds), *path[:-1].shape))
            moved = {"control": np.concatenate((ctrl, along), axis=2), "control_spec": _CTRL_AND_MOCAP}
        try:
            batch.rollout(steps, record=tuple(records), ids=worlds, out=records, **moved)
        except SimulationError as error:
            failed = np.zeros_like(self.running)
            failed[error.ids] = True
            self._end(failed)
        if self._mover is not None:
            batch.bind("mocap_pos")[worlds] = path[-1].reshape(-1, 3)
        self._qpos[...], self._qvel[...], self.times[...] = batch.bind("qpos"), batch.bind("qvel"), batch.bind("time")

    def _judge(self) -> None:
        unstable = self._batch.warning[:, BAD_STATE, _NUMBER].any(axis=1)
        self.referee.judge(self.times, self._qpos, self._qvel, unstable, self.crashed)

    def interrupt(self) -> None:
        """End the worlds that still run."""
        self.referee.end(self.running.copy(), _INTERRUPTED)

    def _end(self, failed: NDArray[np.bool_]) -> None:
        self.failed |= failed
        self.referee.end(failed, _FAILED)


class RangesRow:
    """A world's row of ranges, as the LiDAR that its ScanPipeline measures with."""

    def __init__(self, beams: Beams, row: FloatArray) -> None:
        self.beams = beams
        self._row = row

    def ranges(self, data: Any) -> FloatArray:
        """Return a copy of the row [m]. Shape (beams,)."""
        return self._row.copy()


class _OneByOne:
    """Planners that do not decide together: each is called with messages, as in a race."""

    def __init__(self, planners: Sequence[Controller], beams: Beams) -> None:
        self._planners, self._beams = planners, beams

    def __call__(
        self,
        scans: dict[int, LaserScan],
        ranges: FloatArray,
        odometry: NDArray[np.void],
        running: NDArray[np.bool_],
        commands: FloatArray,
    ) -> NDArray[np.bool_]:
        failed = np.zeros_like(running)
        for i in map(int, np.flatnonzero(running)):
            row = odometry[i]
            values: dict[str, Any] = {name: row[name] if row[name].ndim else float(row[name]) for name in _ODOMETRY}
            sensed = Odometry(**values)
            scan = scans[i] if i in scans else self._beams.to_scan(ranges[i], sensed.stamp)
            try:
                command = plan(self._planners[i], scan, sensed)
            except ControllerError:
                failed[i] = True
            else:
                commands[i] = command.steering_angle, command.speed
        return failed


class _Together:
    """Planners of a class that decides for many worlds at once."""

    def __init__(self, planners: ControllerBatch, beams: Beams) -> None:
        self._planners, self._geometry = planners, beams.geometry

    def __call__(
        self,
        scans: dict[int, LaserScan],
        ranges: FloatArray,
        odometry: NDArray[np.void],
        running: NDArray[np.bool_],
        commands: FloatArray,
    ) -> NDArray[np.bool_]:
        self._planners(self._geometry, ranges, odometry, running, commands)
        return not_finite(running, commands)


def _together(planners: list[Controller], beams: Beams) -> _OneByOne | _Together:
    kind = type(planners[0])
    batch = getattr(kind, "batch", None)
    if batch is None or any(type(planner) is not kind for planner in planners):
        return _OneByOne(planners, beams)
    return _Together(batch(planners), beams)


def _planner(kind: Any, source: str, map_line: MapLine, nominal_mu: float, scenario: Scenario, car: Car) -> Controller:
    believed_mu = nominal_mu if scenario.planner_mu is None else float(scenario.planner_mu)
    planner = build_controller(
        kind, source, car=car.parameters, mu=believed_mu, max_speed=scenario.max_speed, settings=scenario.planner,
        map_line=map_line,
    )  # fmt: skip
    start(planner)
    return planner
