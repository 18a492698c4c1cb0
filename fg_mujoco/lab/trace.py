"""The motion of a car on level ground, step by step, read off the sensors of its MJCF."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np

from ..messages import FloatArray
from ..vehicle.car import WHEELS, car_parameters, sensor_slice
from ..vehicle.tire_slip import TireSlip, TireSlipMeter


class CarSensors:
    """Indices of a car's sensors in a row of `sensordata`; ModelError: the model lacks what `add_axle_sensors` adds."""

    def __init__(self, model: mujoco.MjModel) -> None:
        self.meter = TireSlipMeter(model)
        self.parameters = car_parameters(model)
        for name in ("orientation", "accelerometer", "gyro"):
            setattr(self, name, sensor_slice(model, name))
        self.wheel_speeds = [sensor_slice(model, f"{wheel}_wheel_speed").start for wheel in WHEELS]
        self.velocities = [sensor_slice(model, f"{wheel}_wheel_velocity") for wheel in WHEELS]

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
