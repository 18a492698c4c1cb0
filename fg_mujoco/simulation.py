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

from .errors import ModelError
from .lidar_effects import LidarEffects, ScanPipeline
from .messages import DriveCommand, FloatArray, LaserScan, Odometry
from .tire_slip import TireSlip, TireSlipMeter
from .world import World

STATE = mujoco.mjtState.mjSTATE_INTEGRATION
"""What a state holds: all that the next step depends on."""

_BAD_STATE = (mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL, mujoco.mjtWarning.mjWARN_BADQACC)


class Simulation:
    """A car in a world, placed on the start of the track.

    Args:
      world: the compiled world.
      effects: what the LiDAR does to a scan beyond measuring it; nothing by default.
      seed: of the LiDAR's noise and dropouts.

    Attributes:
      world: the World.
      data: the mujoco.MjData; poses and sensors are those of the present state.
      period: time that a step takes [s].
      slip: what the tires did in the last step; no rows before the first.
      crashed: whether the chassis has touched a wall or an obstacle since the last reset.

    Raises:
      ModelError: a timestep that does not divide the LiDAR's period.
    """

    def __init__(self, world: World, *, effects: LidarEffects | None = None, seed: int = 0) -> None:
        self.world = world
        self.data = mujoco.MjData(world.model)
        self._lidar = world.make_lidar()
        self.period = self._lidar.beams.period
        self.substeps = whole_steps(self.period, world.model.opt.timestep)
        self._slip_meter = TireSlipMeter(world.model, world.car.prefix)
        self._effects = effects or LidarEffects()
        self._seed = seed
        self.reset()

    def reset(self, *, s: float = 0.0, offset: float = 0.0, speed: float = 0.0) -> tuple[LaserScan, Odometry]:
        """Place the car along the centreline and return what it senses there.

        Args:
          s: progress along the centreline [m].
          offset: from the centreline, left positive [m].
          speed: forward [m/s], wheels rolling.
        """
        model, car = self.world.model, self.world.car
        mujoco.mj_resetData(model, self.data)
        x, y, heading = self.world.track.start_pose(s, offset)
        car.set_pose(self.data, x, y, heading, speed)
        self.slip: TireSlip = self._slip_meter.read()
        self.crashed = car.crashed(self.data)
        self._pipeline = ScanPipeline(self._lidar, self._effects, np.random.default_rng(self._seed))
        return self._sense()

    def step(self, command: DriveCommand) -> tuple[LaserScan, Odometry]:
        """Hold a command for one period and return what the car then senses."""
        self.world.car.apply(self.data, command)
        hold_controls(self.world.model, self.data, self.substeps, self._record)
        self.crashed = self.crashed or self.world.car.crashed(self.data)  # at the end; each step senses its start
        self.slip = self._slip_meter.read()
        return self._sense()

    def _record(self, data: mujoco.MjData) -> None:
        self._slip_meter.record(data)
        self._pipeline.record(data)
        self.crashed = self.crashed or self.world.car.crashed(data)

    @property
    def state(self) -> FloatArray:
        """The complete state of the physics (mjSTATE_INTEGRATION), a copy."""
        return complete_state(self.world.model, self.data)

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
        return any(self.data.warning[kind].number > 0 for kind in _BAD_STATE)

    @property
    def pose(self) -> tuple[float, float, float]:
        """Where the rear axle is: x [m], y [m], heading [rad], world frame."""
        return self.world.car.pose(self.data)

    def _sense(self) -> tuple[LaserScan, Odometry]:
        return self._pipeline.scan(self.data), self.world.car.odometry(self.data)


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
    mujoco.mj_forward(model, data)  # mj_step leaves poses and sensors one timestep behind the state


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
