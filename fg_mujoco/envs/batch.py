"""Many worlds of one compiled model under an environment, each in its own time: mujoco.batch in C threads, and kernels.

They are those of `rollout` (world_group), and a world gives the bits of the same world alone, whatever the others do
and however many threads there are. Worlds begin anew one by one while the others go on.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
from mujoco.batch import Batch, SimulationError

from ..course.moving_obstacles import make_mover
from ..lidar.effects import LidarEffects, ScanPipeline
from ..lidar.lidar import RaycastLidar
from ..messages import ODOMETRY, FloatArray
from ..simulation.batch_kernels import book_worlds, command_worlds, sense_worlds
from ..simulation.scenario import Start
from ..simulation.simulation import BAD_STATE, STATE, whole_steps
from ..simulation.telemetry import TALLY, TELEMETRY
from ..simulation.termination import END_REASONS
from ..simulation.world import CAR_PREFIX
from ..simulation.world_group import RangesRow
from ..vehicle.tire_slip import TireSlipMeter
from .settings import EnvironmentSettings
from .worlds import Mask, make_referee

_FAILED = END_REASONS.index("failed")
_CTRL_AND_MOCAP = int(mujoco.mjtState.mjSTATE_CTRL) | int(mujoco.mjtState.mjSTATE_MOCAP_POS)
_NUMBER = 1  # of the fields of mjWarningStat
_WORLDS_A_THREAD = 4  # fewer are sensed sooner than a thread is woken


class ManyWorlds:
    """Worlds that are driven together.

    Args:
      settings: of the environment.
      count: how many worlds, n.
      threads: that step and sense them.

    Attributes:
      Those of `environment_worlds.Worlds`.
    """

    def __init__(self, settings: EnvironmentSettings, count: int, threads: int = 1) -> None:
        world = settings.make_world()
        self.world = world
        self._batch = Batch(world.model, count, nthread=threads, persistent=True)
        self._threads = threads
        self._pool = ThreadPoolExecutor(threads) if threads > 1 and count >= 2 * _WORLDS_A_THREAD else None
        lidar = world.make_lidar()
        assert isinstance(lidar, RaycastLidar) and lidar.mount is not None
        self._beams, self._mount, self._scene = lidar.beams, lidar.mount, lidar.scene
        self.period = lidar.beams.period
        self._effects = settings.effects
        self._pipelines: dict[int, ScanPipeline] = {}
        self._mover = make_mover(world.model)
        self._moving, self._turned = np.zeros((len(world.moving), 3)), np.tile(np.eye(3), (len(world.moving), 1, 1))

        model, meter = world.model, TireSlipMeter(world.model, CAR_PREFIX)
        self._substeps = whole_steps(self.period, model.opt.timestep)
        self._mu, self._tires = np.tile(meter.mu, (count, 1)), meter.readings.start
        self._cars = np.tile(world.car.constants, count)
        self._scratches = [self._scene.scratch() for _ in range(threads)]
        self._slips = [np.empty((4, self._substeps, 4)) for _ in range(threads)]
        self._records = np.empty((count, self._substeps, model.nsensordata))
        self._telemetry, self._tallies = np.zeros((count, len(TELEMETRY))), np.zeros(count, TALLY)
        self._sliding_steps = self._telemetry[:, TELEMETRY.index("sliding_steps")]
        self._start = mujoco.MjData(model)  # where starts are worked out
        # kernels want rows side by side, and those of the batch's state are not
        self._live = {name: self._batch.bind(name) for name in ("time", "qpos", "qvel", "ctrl", "sensordata")}
        self.times, self._qpos, self._qvel, self._ctrl, self._sensors = (live.copy() for live in self._live.values())
        self._warned = self._batch.warning[:, BAD_STATE, _NUMBER]
        self._unstable = np.zeros(count, np.bool_)

        self.crashed, self.sliding = np.zeros(count, np.bool_), np.zeros(count)
        self.ranges = np.empty((count, len(lidar.beams.bearings)))
        self.odometry = np.zeros(count, ODOMETRY)
        self.referee = make_referee(self, settings, self._cars, self._qpos)

    def begin(self, which: Mask, starts: Sequence[Start], seeds: Sequence[int]) -> None:
        """Place the cars of the worlds `which`, as Simulation.reset does."""
        batch, model, data, car = self._batch, self.world.model, self._start, self.world.car
        ids = np.flatnonzero(which).astype(np.int32)
        if len(ids) == 0:
            return
        batch.reset(ids, stage=int(mujoco.mjtStage.mjSTAGE_NONE))  # warnings and all else that no state holds
        for i, start, seed in zip(ids.tolist(), starts, seeds, strict=True):
            mujoco.mj_resetData(model, data)
            if self._mover is not None:
                self._mover.place(data)
            x, y, along = self.world.track.start_pose(start.s, start.offset)
            car.write_pose(data, x, y, along + start.heading, start.speed)
            mujoco.mj_getState(model, data, batch.state[i], STATE)
            if self._effects != LidarEffects():
                rng = np.random.default_rng(seed)
                self._pipelines[i] = ScanPipeline(RangesRow(self._beams, self.ranges[i]), self._effects, rng)
        batch.forward(ids)
        self._sensors[ids] = self._live["sensordata"][ids]
        self.crashed[ids] = self._sensors[ids, car.chassis_contact] > 0.0
        self.sliding[ids] = self._sliding_steps[ids] = 0.0
        self._copy_state()
        self.referee.begin(which, self.times, self._qpos, self._qvel, self.crashed)

    def drive(self, commands: FloatArray) -> None:
        """Hold the commands for a tick in the worlds that run, and judge their races."""
        running = self.referee.running
        ids = np.flatnonzero(running).astype(np.int32)
        if len(ids) == 0:
            return
        command_worlds(running, self._qvel, commands, self._cars, self._ctrl, self._telemetry)
        self._step(ids)

        def book(part: slice, thread: int) -> None:
            book_worlds(
                ids[part], self._records[part], self._tires, self.world.car.chassis_contact, self._mu,
                self._slips[thread], self._sensors, self.crashed, self._telemetry, self._tallies,
            )  # fmt: skip

        self._share(book, len(ids))
        np.divide(self._sliding_steps, self._substeps, out=self.sliding)
        np.any(self._warned, axis=1, out=self._unstable)
        self.referee.judge(self.times, self._qpos, self._qvel, self._unstable, self.crashed)

    def sense(self, which: Mask) -> None:
        """Take the scans and odometry of the worlds `which`."""
        if self._mover is None:
            self._share(lambda part, thread: self._sense(which, part, thread), len(which))
        else:  # what moves is elsewhere in each
            for i in map(int, np.flatnonzero(which)):
                self._mover.write_positions(float(self.times[i]), self._moving)
                self._sense(which, slice(i, i + 1), 0)
        for i, pipeline in self._pipelines.items():
            if which[i]:
                self.ranges[i] = pipeline.scan(SimpleNamespace(time=float(self.times[i]))).ranges

    def state(self, i: int) -> FloatArray:
        """Return the complete state of world i."""
        state: FloatArray = self._batch.state[i].copy()
        return state

    def close(self) -> None:
        """Let go of the threads."""
        if self._pool is not None:
            self._pool.shutdown()

    def _sense(self, which: Mask, part: slice, thread: int) -> None:
        sense_worlds(
            which[part], self.times[part], self._qpos[part], self._qvel[part], self._sensors[part], self._cars[part],
            self.referee.timers[part], self._mount, self._moving, self._turned, self._scene.arrays,
            self._scratches[thread], self.odometry[part], self.ranges[part], self._telemetry[part],
        )  # fmt: skip

    def _step(self, ids: Any) -> None:
        """Step the physics of some worlds for a tick, and record their sensors at each step."""
        batch, steps = self._batch, self._substeps
        self._live["ctrl"][...] = self._ctrl
        moved: dict[str, Any] = {}
        if self._mover is not None:  # before each step, as hold_controls does
            timestep = self.world.model.opt.timestep
            paths = np.array([self._mover.positions(time, timestep, steps) for time in self.times[ids].tolist()])
            ctrl = np.repeat(self._ctrl[ids, None], steps, axis=1)
            along = paths[:, :-1].reshape(len(ids), steps, -1)
            moved = {"control": np.concatenate((ctrl, along), axis=2), "control_spec": _CTRL_AND_MOCAP}
        try:
            batch.rollout(
                steps, record=("sensordata",), ids=ids, out={"sensordata": self._records[: len(ids)]}, **moved
            )  # fmt: skip
        except SimulationError as error:
            failed = np.zeros(len(self.times), np.bool_)
            failed[error.ids] = True
            self.referee.end(failed, _FAILED)
        if self._mover is not None:
            batch.bind("mocap_pos")[ids] = paths[:, -1]
        self._copy_state()

    def _copy_state(self) -> None:
        live = self._live
        self.times[...], self._qpos[...], self._qvel[...] = live["time"], live["qpos"], live["qvel"]

    def _share(self, work: Callable[[slice, int], None], count: int) -> None:
        """Do some work on slices of `count` rows, each in a thread; kernels run without the GIL."""
        if self._pool is None or count < 2 * _WORLDS_A_THREAD:
            work(slice(0, count), 0)
            return
        threads = self._threads
        parts = [slice(count * k // threads, count * (k + 1) // threads) for k in range(threads)]
        list(self._pool.map(work, parts, range(threads)))
