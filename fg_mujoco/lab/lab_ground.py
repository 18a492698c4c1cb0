"""The car on its endless level ground, where the lab drives without walls, its motion read off its own sensors."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import mujoco
import numpy as np

from ..course.ground import Ground
from ..errors import SettingsError
from ..messages import DriveCommand, FloatArray, Odometry
from ..simulation.cars import CAR_PREFIX
from ..simulation.physics import STATE, whole_steps
from ..simulation.simulation import complete_state
from ..simulation.terrain import on_terrain
from ..vehicle.car import WHEELS, Car, car_parameters, sensor_slice
from ..vehicle.changes import CarChanges
from ..vehicle.tire_forces import TireForces
from ..vehicle.tire_slip import TireSlip, TireSlipMeter, add_axle_sensors
from ..vehicle.tires import Tires
from ..vehicle.vehicle import DEFAULT_VEHICLE, Vehicle

TICK = 0.025
"""[s] A command is held this long: the period of the LiDAR."""

Driver: TypeAlias = Callable[[Odometry], DriveCommand]
"""What decides, once a period, from the present motion."""


class CarSensors:
    """Indices of a car's sensors in a row of `sensordata`; ModelError: the model lacks what `add_axle_sensors` adds."""

    def __init__(self, model: mujoco.MjModel, prefix: str = "") -> None:
        self.meter = TireSlipMeter(model, prefix)
        self.parameters = car_parameters(model, prefix)
        for name in ("orientation", "accelerometer", "gyro"):
            setattr(self, name, sensor_slice(model, prefix + name))
        self.wheel_speeds = [sensor_slice(model, f"{prefix}{wheel}_wheel_speed").start for wheel in WHEELS]
        self.velocities = [sensor_slice(model, f"{prefix}{wheel}_wheel_velocity") for wheel in WHEELS]

    orientation: slice
    accelerometer: slice
    gyro: slice


@dataclass(frozen=True, kw_only=True, eq=False)
class Trace:
    """A car's motion over some physics steps, n of them. The rear axle's where nothing else is said."""

    records: FloatArray  # (n, nsensordata) sensors at each step, of the state at its start
    states: FloatArray  # (n, nuserdata) user data at each step: of tires with a law of ours
    sensors: CarSensors
    timestep: float  # [s]

    def __getitem__(self, steps: slice) -> Trace:
        """Return the trace of some of the steps."""
        return Trace(
            records=self.records[steps], states=self.states[steps], sensors=self.sensors, timestep=self.timestep
        )

    def last(self, seconds: float) -> Trace:
        """Return the trace of the last so many seconds."""
        return self[-round(seconds / self.timestep) :]

    @cached_property
    def slip(self) -> TireSlip:
        """Slip of the tires, (n, 4)."""
        return self.sensors.meter.measure(np.ascontiguousarray(self.records), np.ascontiguousarray(self.states))

    @cached_property
    def heading(self) -> FloatArray:
        """Shape (n,) [rad], without jumps."""
        w, x, y, z = self.records[:, self.sensors.orientation].T
        heading: FloatArray = np.unwrap(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))
        return heading

    @cached_property
    def velocity(self) -> FloatArray:
        """Shape (n, 2) [m/s], world frame: the mean of the rear wheels'."""
        left, right = (self.records[:, wheel][:, :2] for wheel in self.sensors.velocities[2:])
        velocity: FloatArray = 0.5 * (left + right)
        return velocity

    @property
    def speed(self) -> FloatArray:
        """Over the ground, in any direction. Shape (n,) [m/s]."""
        speed: FloatArray = np.hypot(self.velocity[:, 0], self.velocity[:, 1])
        return speed

    @property
    def wheel_speeds(self) -> FloatArray:
        """Of the tires' surface, in the order of WHEELS. Shape (n, 4) [m/s]; negative: backwards."""
        return self.records[:, self.sensors.wheel_speeds] * self.sensors.parameters.wheel_radius

    @property
    def yaw_rate(self) -> FloatArray:
        """Shape (n,) [rad/s]."""
        return self.records[:, self.sensors.gyro][:, 2]

    @cached_property
    def acceleration(self) -> FloatArray:
        """Acceleration of the centre of gravity, forward and to the left. Shape (n, 2) [m/s^2].

        What the accelerometer reads, turned into the world by roll and pitch too, is level: gravity is vertical.
        """
        w, x, y, z = self.records[:, self.sensors.orientation].T
        ax, ay, az = self.records[:, self.sensors.accelerometer].T
        world_x = (1 - 2 * (y * y + z * z)) * ax + 2 * (x * y - w * z) * ay + 2 * (x * z + w * y) * az
        world_y = 2 * (x * y + w * z) * ax + (1 - 2 * (x * x + z * z)) * ay + 2 * (y * z - w * x) * az
        return self._along_heading(world_x, world_y)

    def _along_heading(self, x: FloatArray, y: FloatArray) -> FloatArray:
        cos, sin = np.cos(self.heading), np.sin(self.heading)
        return np.column_stack((cos * x + sin * y, cos * y - sin * x))


def join(traces: Sequence[Trace]) -> Trace:
    """Return one trace of several of the same car, one after another."""
    records = np.concatenate([trace.records for trace in traces])
    states = np.concatenate([trace.states for trace in traces])
    return Trace(records=records, states=states, sensors=traces[0].sensors, timestep=traces[0].timestep)


class LabGround:
    """A car on open ground, with its `model`, `data`, `car` and the `forces` of its tires.

    Args:
      mu: friction coefficient of the tires, or the greatest peak of those with a curve [-]; None: as in the MJCF.
      timestep: of the physics [s]; None: at which the tires are right when they slide.
      tires: that the car stands on; None: its own.
      surface: of the ground; None: it is level and endless.

    Raises:
      SettingsError: a friction coefficient that is no number above 0 and up to GREATEST_MU; tires of the model
        `contact` on a surface.
    """

    def __init__(
        self,
        mu: float | None = None,
        timestep: float | None = None,
        tires: Tires | None = None,
        vehicle: str | Vehicle = DEFAULT_VEHICLE,
        changes: CarChanges | None = None,
        surface: Ground | None = None,
    ) -> None:
        built = Vehicle.load(vehicle)
        tires = tires or built.tires
        spec = built.spec(mu, changes, tires)
        add_axle_sensors(spec)
        prefix = "" if surface is None else CAR_PREFIX
        self.model = (spec if surface is None else on_terrain(spec, surface, prefix)).compile()
        self.model.opt.timestep = timestep or tires.sliding_timestep or self.model.opt.timestep
        self.data = mujoco.MjData(self.model)
        self.car = Car(self.model, prefix)
        self.forces = TireForces(self.model, prefix)
        if surface is not None and not len(self.forces.rows):
            raise SettingsError("tires of the model 'contact' on ground that is not level; accepted: any other set")
        self._sensors = CarSensors(self.model, prefix)

    def place(self, speed: float = 0.0, y: float = 0.0) -> None:
        """Place the car at x = 0 and `y` [m], heading along x, rolling at `speed` [m/s]."""
        mujoco.mj_resetData(self.model, self.data)
        self.car.set_pose(self.data, 0.0, y, 0.0, speed)
        self.forces.begin(self.data)

    def hold(self, command: DriveCommand, seconds: float = TICK) -> Trace:
        """Hold a command and return what happened, at each physics step."""
        records = np.empty((whole_steps(seconds, self.model.opt.timestep), self.model.nsensordata))
        states = np.empty((len(records), self.model.nuserdata))
        self.car.apply(self.data, command)
        self.forces.run(self.data, records, states)
        return Trace(records=records, states=states, sensors=self._sensors, timestep=self.model.opt.timestep)

    def run(self, commands: Iterable[DriveCommand], seconds: float = TICK) -> Trace:
        """Hold one command after another, each for so many seconds."""
        return join([self.hold(command, seconds) for command in commands])

    def drive(
        self, driver: Driver, seconds: float, period: float = TICK, until: Callable[[Odometry], bool] | None = None
    ) -> Trace:
        """Drive by what a driver makes of the odometry, once a period [s], for so long or until something holds."""
        return self.run(self._decisions(driver, round(seconds / period), until), period)

    def _decisions(
        self, driver: Driver, ticks: int, until: Callable[[Odometry], bool] | None
    ) -> Iterator[DriveCommand]:
        for tick in range(ticks):
            odometry = self.car.odometry(self.data)
            if tick and until is not None and until(odometry):
                return
            yield driver(odometry)

    @property
    def state(self) -> FloatArray:
        """The complete state of the physics, a copy."""
        return complete_state(self.model, self.data)

    @state.setter
    def state(self, state: FloatArray) -> None:
        mujoco.mj_setState(self.model, self.data, state, STATE)
        mujoco.mj_forward(self.model, self.data)
