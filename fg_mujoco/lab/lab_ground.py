"""The car on its endless level ground, where the lab drives without walls, its motion read off its own sensors."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import TypeAlias

import mujoco
import numpy as np

from ..messages import DriveCommand, FloatArray, Odometry
from ..simulation.physics import STATE, whole_steps
from ..simulation.simulation import complete_state
from ..vehicle.car import Car
from ..vehicle.changes import CarChanges
from ..vehicle.tire_forces import TireForces
from ..vehicle.tire_slip import add_axle_sensors
from ..vehicle.tires import Tires
from ..vehicle.vehicle import DEFAULT_VEHICLE, Vehicle
from .trace import CarSensors, Trace, join

TICK = 0.025
"""[s] A command is held this long: the period of the LiDAR."""

Driver: TypeAlias = Callable[[Odometry], DriveCommand]
"""What decides, once a period, from the present motion."""


class LabGround:
    """A car on endless level ground, with its `model`, `data`, `car` and the `forces` of its tires.

    Args:
      mu: friction coefficient of the tires, or the greatest peak of those with a curve [-]; None: as in the MJCF.
      timestep: of the physics [s]; None: at which the tires are right when they slide.
      tires: that the car stands on; None: its own.

    Raises:
      SettingsError: a friction coefficient that is no number above 0 and up to GREATEST_MU.
    """

    def __init__(
        self,
        mu: float | None = None,
        timestep: float | None = None,
        tires: Tires | None = None,
        vehicle: str | Vehicle = DEFAULT_VEHICLE,
        changes: CarChanges | None = None,
    ) -> None:
        built = Vehicle.load(vehicle)
        tires = tires or built.tires
        spec = built.spec(mu, changes, tires)
        add_axle_sensors(spec)
        self.model = spec.compile()
        self.model.opt.timestep = timestep or tires.sliding_timestep or self.model.opt.timestep
        self.data = mujoco.MjData(self.model)
        self.car = Car(self.model)
        self.forces = TireForces(self.model)
        self._sensors = CarSensors(self.model)

    def place(self, speed: float = 0.0) -> None:
        """Place the car at the origin, heading along x, rolling at `speed` [m/s]."""
        mujoco.mj_resetData(self.model, self.data)
        self.car.set_pose(self.data, 0.0, 0.0, 0.0, speed)
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
