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
from numpy.typing import NDArray

from ..course.moving_obstacles import Mover, make_mover
from ..errors import ModelError
from ..kernels import kernel
from ..lidar.effects import LidarEffects, ScanPipeline
from ..messages import DriveCommand, FloatArray, LaserScan, Odometry
from ..vehicle import motion as car_motion
from ..vehicle.car import WHEELS
from ..vehicle.tire_slip import TireSlip, TireSlipMeter, measure_slip
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
      slip_values: what the tires did in the last step, (4, substeps, 4) as TireSlip.values; `slip` is a copy.
      crashed: whether the chassis has touched a wall or an obstacle since the last reset.
      unstable: whether MuJoCo has met a bad position, velocity or acceleration, and so reset the state by itself.

    Raises:
      ModelError: a timestep that does not divide the LiDAR's period.
    """

    def __init__(self, world: World, *, effects: LidarEffects | None = None, seed: int = 0) -> None:
        self.world = world
        self.data = mujoco.MjData(world.model)
        self._bad_state = self.data.warning.number[BAD_STATE]  # a view: MuJoCo counts there
        self.lidar = world.make_lidar()
        self.period = self.lidar.beams.period
        self.substeps = whole_steps(self.period, world.model.opt.timestep)
        self._mover = make_mover(world.model)
        self._slip_meter = TireSlipMeter(world.model, world.car.prefix)
        self._records = np.empty((self.substeps, world.model.nsensordata))  # the sensors at each step of a tick
        self.slip_values = np.empty((4, self.substeps, len(WHEELS)))
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
        if self._mover is not None:
            self._mover.place(self.data)
        car.set_pose(self.data, x, y, along + heading, speed)
        self.crashed = car.crashed(self.data)
        self.unstable = False
        self._pipeline = ScanPipeline(self.lidar, self._effects, np.random.default_rng(self._seed))
        self._after_step = self._pipeline.record if self._pipeline.needs_every_step else None
        return self.sense()

    def step(self, command: DriveCommand) -> tuple[LaserScan, Odometry]:
        """Hold a command for one period and return what the car then senses."""
        self.drive(command.steering_angle, command.speed)
        return self.sense()

    def drive(self, steering_angle: float, speed: float) -> None:
        """Hold a command [rad, m/s] for one period; `sense` then tells what it led to."""
        data = self.data
        car_motion.drive(data.qvel, steering_angle, speed, self.world.car.constants, data.ctrl)
        hold_controls(self.world.model, data, self._records, self._mover, self._after_step)
        measure_slip(self._records, self._slip_meter.readings.start, self._slip_meter.mu, self.slip_values)
        touched, self.unstable = look_over(self._records, self.world.car.chassis_contact, self._bad_state)
        self.crashed = self.crashed or touched

    @property
    def slip(self) -> TireSlip:
        """What the tires did in the last step; no rows before the first."""
        return TireSlip(values=self.slip_values.copy() if self.data.time > 0.0 else self.slip_values[:, :0].copy())

    def sense(self) -> tuple[LaserScan, Odometry]:
        """Return what the car senses at the end of a period. Once for each: noise is drawn, late scans move up."""
        return self._pipeline.scan(self.data), self.world.car.odometry(self.data)

    @property
    def has_effects(self) -> bool:
        """Whether the LiDAR does anything to a scan beyond measuring it."""
        return self._effects != LidarEffects()

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
    def pose(self) -> tuple[float, float, float]:
        """Where the rear axle is: x [m], y [m], heading [rad], world frame."""
        return self.world.car.pose(self.data)


@kernel
def any_touch(records: FloatArray, sensor: int) -> bool:
    """Say whether a contact sensor found anything in any of the rows of `records` (steps, nsensordata)."""
    touched = False
    for step in range(len(records)):
        touched = touched or records[step, sensor] > 0.0
    return touched


@kernel
def look_over(records: FloatArray, sensor: int, warnings: NDArray[np.int32]) -> tuple[bool, bool]:
    """Return `any_touch`, and whether MuJoCo has counted any of `warnings`: one call a tick, not two."""
    warned = False
    for kind in range(len(warnings)):
        warned = warned or warnings[kind] > 0
    return any_touch(records, sensor), warned


def hold_controls(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    records: FloatArray,
    mover: Mover | None = None,
    after_step: Callable[[mujoco.MjData], None] | None = None,
) -> None:
    """Hold `data.ctrl` for one tick of physics steps. A replay makes the very calls of the race.

    Args:
      model: the compiled model.
      data: at the start of the tick; left at its end, with poses that are current.
      records: (steps, nsensordata) written to: the sensors at each step, each of the state at its start.
      mover: of the moving obstacles, which are where they are to be at the start of the tick; None: there are none.
      after_step: called after each.
    """
    step, sensors = mujoco.mj_step, data.sensordata
    for row in records:
        step(model, data)
        row[:] = sensors
        if mover is not None:
            mover.place(data)
        if after_step is not None:
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
