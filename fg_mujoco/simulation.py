"""One world, stepped at the LiDAR's rate: a command in, the next scan and odometry out.

    simulation = Simulation(World("oval"))
    scan, odometry = simulation.reset()
    scan, odometry = simulation.step(DriveCommand(steering_angle=0.1, speed=2.0))

Each step holds the command for one period of the LiDAR (25 ms). Same world, same seed, same commands: same bits.
"""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np

from . import car_motion
from .errors import ModelError
from .kernels import kernel
from .lidar_effects import LidarEffects, ScanPipeline
from .messages import DriveCommand, FloatArray, LaserScan, Odometry
from .tire_slip import TireSlip, TireSlipMeter
from .world import World

STATE = mujoco.mjtState.mjSTATE_INTEGRATION
"""What a state holds: all that the next step depends on."""

BAD_STATE = slice(int(mujoco.mjtWarning.mjWARN_BADQPOS), int(mujoco.mjtWarning.mjWARN_BADQACC) + 1)
"""Warnings after which MuJoCo resets a state by itself."""


class Simulation:
    """A car in a world, placed on the start of the track.

    Args:
      world: the compiled world.
      effects: what the LiDAR does to a scan beyond measuring it; nothing by default.
      seed: of the LiDAR's noise and dropouts.

    Attributes:
      world: the World.
      data: the mujoco.MjData; poses are those of the present state, sensors those of the last physics step.
      lidar: measures without effects.
      period: time that a step takes [s].
      slip: what the tires did in the last step; no rows before the first.
      crashed: whether the chassis has touched a wall or an obstacle since the last reset.

    Raises:
      ModelError: a timestep that does not divide the LiDAR's period.
    """

    def __init__(self, world: World, *, effects: LidarEffects | None = None, seed: int = 0) -> None:
        self.world = world
        self.data = mujoco.MjData(world.model)
        self._bad_state = self.data.warning.number[BAD_STATE]  # this and the next see what MuJoCo writes
        self._sensors = self.data.sensordata
        self.lidar = world.make_lidar()
        self.period = self.lidar.beams.period
        self.substeps = whole_steps(self.period, world.model.opt.timestep)
        self._slip_meter = TireSlipMeter(world.model, world.car.prefix)
        self._records = np.empty((self.substeps, world.model.nsensordata))  # the sensors at each step of a tick
        self._effects = effects or LidarEffects()
        self._seed = seed
        self.reset()

    def reset(
        self, *, s: float = 0.0, offset: float = 0.0, heading: float = 0.0, speed: float = 0.0
    ) -> tuple[LaserScan, Odometry]:
        """Place the car along the centreline and return what it senses there.

        Args:
          s: progress along the centreline [m].
          offset: from the centreline, left positive [m].
          heading: from that of the centreline, left positive [rad].
          speed: forward [m/s], wheels rolling.
        """
        model, car = self.world.model, self.world.car
        mujoco.mj_resetData(model, self.data)
        x, y, along = self.world.track.start_pose(s, offset)
        car.set_pose(self.data, x, y, along + heading, speed)
        self.slip: TireSlip = self._slip_meter.measure(self._records[:0])
        self.crashed = car.crashed(self.data)
        self._pipeline = ScanPipeline(self.lidar, self._effects, np.random.default_rng(self._seed))
        return self.sense()

    def step(self, command: DriveCommand) -> tuple[LaserScan, Odometry]:
        """Hold a command for one period and return what the car then senses."""
        self.drive(command.steering_angle, command.speed)
        return self.sense()

    def drive(self, steering_angle: float, speed: float) -> None:
        """Hold a command [rad, m/s] for one period; `sense` then tells what it led to."""
        data = self.data
        car_motion.drive(data.qvel, steering_angle, speed, self.world.car.constants, data.ctrl)
        self._step = 0
        hold_controls(self.world.model, self.data, self.substeps, self._record)
        self.slip = self._slip_meter.measure(self._records)
        self.crashed = self.crashed or any_touch(self._records, self.world.car.chassis_contact)

    def sense(self) -> tuple[LaserScan, Odometry]:
        """Return what the car senses at the end of a period. Once for each: noise is drawn, late scans move up."""
        return self._pipeline.scan(self.data), self.world.car.odometry(self.data)

    @property
    def has_effects(self) -> bool:
        """Whether the LiDAR does anything to a scan beyond measuring it."""
        return self._effects != LidarEffects()

    def _record(self, data: mujoco.MjData) -> None:
        self._records[self._step] = self._sensors
        self._step += 1
        if self._pipeline.needs_every_step:
            self._pipeline.record(data)

    @property
    def state(self) -> FloatArray:
        """The complete state of the physics (mjSTATE_INTEGRATION), a copy."""
        return complete_state(self.world.model, self.data)

    def write_state(self, out: FloatArray) -> None:
        """Write the complete state of the physics into `out`, as long as `state`."""
        mujoco.mj_getState(self.world.model, self.data, out, STATE)

    @property
    def time(self) -> float:
        """Simulated since the last reset [s]."""
        return float(self.data.time)

    @property
    def speed(self) -> float:
        """True forward speed of the rear axle [m/s]."""
        return self.world.car.ground_speed(self.data)

    @property
    def unstable(self) -> bool:
        """Whether MuJoCo has met a bad position, velocity or acceleration, and so reset the state by itself."""
        return bool(self._bad_state.any())

    @property
    def pose(self) -> tuple[float, float, float]:
        """Where the rear axle is: x [m], y [m], heading [rad], world frame."""
        return self.world.car.pose(self.data)


@kernel
def any_touch(records: FloatArray, sensor: int) -> bool:
    """Say whether a contact sensor found anything in any of the rows of `records` (steps, nsensordata)."""
    for step in range(len(records)):  # noqa: SIM110, numba has no any()
        if records[step, sensor] > 0.0:
            return True
    return False


def hold_controls(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    steps: int,
    after_step: Callable[[mujoco.MjData], None] = lambda data: None,
) -> None:
    """Hold `data.ctrl` for one tick of so many physics steps. A replay makes the very calls of the race."""
    for _ in range(steps):
        mujoco.mj_step(model, data)
        after_step(data)
    mujoco.mj_kinematics(model, data)  # mj_step leaves poses one timestep behind the state


def complete_state(model: mujoco.MjModel, data: mujoco.MjData) -> FloatArray:
    """Return a copy of the complete state of the physics (mjSTATE_INTEGRATION)."""
    state = np.empty(mujoco.mj_stateSize(model, STATE))
    mujoco.mj_getState(model, data, state, STATE)
    return state


def whole_steps(period: float, timestep: float) -> int:
    """Return how many physics steps make one period.

    Raises:
      ModelError: not a whole number of them.
    """
    steps = round(period / timestep)
    if steps < 1 or abs(steps * timestep - period) > 1e-9:
        raise ModelError(f"timestep is {timestep} s; accepted: a whole fraction of the LiDAR's period of {period} s")
    return steps
