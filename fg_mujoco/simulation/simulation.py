"""One world, stepped by hand at the LiDAR's rate: a command in, the next scan and odometry out.

    simulation = Simulation(World("oval"))
    scan, odometry = simulation.reset()
    scan, odometry = simulation.step(DriveCommand(steering_angle=0.1, speed=2.0))

Each step holds the command for one period of the LiDAR (25 ms). Same world, same seed, same commands: same bits.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import mujoco
import numpy as np

from ..arguments import Suggesting, Uncopied, explain_class
from ..display import brief
from ..errors import MessageError, SettingsError
from ..lidar.effects import LidarEffects
from ..lidar.lidar import Lidar
from ..messages import A_COMMAND, DriveCommand, FloatArray, LaserScan, Odometry, shown
from ..vehicle.motion import is_rolled_over
from ..vehicle.sensors import Sensor, as_sensors
from ..vehicle.tire_slip import TireSlip
from .engine import Engine
from .physics import STATE
from .planner_adapter import odometry_message
from .settings import DriveSettings, Start
from .world import World


@explain_class
class Simulation(Suggesting, Uncopied):
    """A car in a world, placed on the start of the track.

    Args:
      effects: what the LiDAR does to a scan beyond measuring it; nothing by default.
      odometry_drift: relative error of the speeds and the yaw rate in the odometry, as in DriveSettings.
      engine: of this one world, whose model is the world's own; None: a new one.
      data: to be used as `data`, of the world's model; None: a new one.
      others: settings of each car besides car 0: its start, effects, seed and drift. These cars do what stands in
        `engine.commands`, which whoever steps writes.

    Attributes:
      data: the mujoco.MjData: what is written to its state is driven from; poses are those of the present state,
        sensors those of the last physics step.
      period, substeps: time that a step takes [s], and its physics steps.

    Raises:
      ModelError: a timestep that does not divide the period.
      SettingsError: no World, or other cars than it has.
    """

    def __init__(
        self,
        world: World,
        *,
        effects: LidarEffects | None = None,
        seed: int = 0,
        odometry_drift: float = 0.0,
        sensors: Sequence[Sensor | str | Mapping[str, Any]] = (),
        engine: Engine | None = None,
        data: mujoco.MjData | None = None,
        others: Sequence[DriveSettings] = (),
    ) -> None:
        if not isinstance(world, World):
            raise SettingsError(f"Simulation is given {shown(world)}; accepted: a World, such as World('oval')")
        if len(others) != len(world.cars) - 1:
            said = f"settings of {len(others)} other cars for a world of {len(world.cars)} cars"
            raise SettingsError(f"{said}; accepted: one for each car but car 0")
        self.world, self._others = world, tuple(others)
        self.engine = engine or Engine(world, own_model=True)
        self.data = mujoco.MjData(world.model) if data is None else data
        self.period, self.substeps = self.engine.period, self.engine.substeps
        self._effects, self._seed, self._odometry_drift = effects or LidarEffects(), seed, odometry_drift
        self._sensors = as_sensors(sensors)
        self._all = np.ones(len(world.cars), np.bool_)
        self.reset()

    def __repr__(self) -> str:
        x, y, _ = self.pose
        return brief(self, repr(self.world), f"t = {self.time:.3f} s, ({x:.2f}, {y:.2f}) m, {self.speed:.2f} m/s")

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
        start = Start(s=s, offset=offset, heading=heading, speed=speed)
        others = self._others
        self.engine.place(
            [start, *(other.start for other in others)],
            effects=[self._effects, *(other.effects for other in others)],
            seeds=[self._seed, *(other.seed for other in others)],
            odometry_drifts=[self._odometry_drift, *(other.odometry_drift for other in others)],
            sensors=[self._sensors, *(other.sensed for other in others)],
        )
        self.engine.read(0, self.data)
        return self._sense()

    def step(self, command: DriveCommand) -> tuple[LaserScan, Odometry]:
        """Hold a command for one period and return what the car then senses.

        Raises:
          MessageError: it is no DriveCommand.
        """
        if not isinstance(command, DriveCommand):
            raise MessageError(f"the command is {shown(command)}; accepted: {A_COMMAND}")
        self.drive(command.steering_angle, command.speed)
        return self._sense()

    def drive(self, steering_angle: float, speed: float) -> None:
        """Hold a command [rad, m/s] for one period; `sense` then tells what it led to."""
        engine = self.engine
        mujoco.mj_getState(self.world.model, self.data, engine.state(0), int(STATE))
        engine.monitor.running[0] = True  # whoever steps by hand decides when it is over
        engine.commands[0] = steering_angle, speed
        engine.drive()
        engine.read(0, self.data)

    def sense(self) -> tuple[LaserScan, Odometry]:
        """Return scan and odometry at the end of a period. Call it once each: noise is drawn, late scans move up."""
        mujoco.mj_getState(self.world.model, self.data, self.engine.state(0), int(STATE))
        return self._sense()

    def _sense(self) -> tuple[LaserScan, Odometry]:
        """Sense in the engine's state, which nobody has changed since."""
        engine = self.engine
        engine.sense(self._all)
        odometry = odometry_message(engine.odometry[0], engine.readings(0))
        return engine.scans.get(0) or engine.beams.to_scan(engine.ranges[0], odometry.stamp), odometry

    @property
    def lidar(self) -> Lidar:
        """The LiDAR, which measures without effects."""
        return self.engine.lidar

    @property
    def crashed(self) -> bool:
        """Whether the chassis has touched a wall or an obstacle since the last reset."""
        return bool(self.engine.crashed[0])

    @crashed.setter
    def crashed(self, crashed: bool) -> None:
        self.engine.crashed[0] = crashed

    @property
    def rolled_over(self) -> bool:
        """Whether the car lies on its side or its roof: it is tilted by more than motion.ROLLED_OVER."""
        return bool(is_rolled_over(self.engine.qpos(0), self.world.car.constants))

    @property
    def unstable(self) -> bool:
        """Whether MuJoCo has met a bad position, velocity or acceleration, and so reset the state by itself."""
        return self.engine.unstable(0)

    @property
    def slip(self) -> TireSlip:
        """The tire slip of the last step; no rows before the first."""
        values = self.engine.slip()
        return TireSlip(values=values.copy() if self.data.time > 0.0 else values[:, :0].copy())

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
    def pose(self) -> tuple[float, float, float]:
        """Pose of the rear axle: x [m], y [m], heading [rad], world frame."""
        return self.world.car.pose(self.data)


def complete_state(model: mujoco.MjModel, data: mujoco.MjData) -> FloatArray:
    """Return a copy of the complete state of the physics (mjSTATE_INTEGRATION)."""
    state = np.empty(mujoco.mj_stateSize(model, int(STATE)))
    mujoco.mj_getState(model, data, state, int(STATE))
    return state
