"""The single-track model with linear tires that 2D gyms drive: a side force that grows with the slip angle for ever.

    model = SingleTrack.of(car.parameters, mu=car.mu)
    motion = model.follow(steering, speed, timestep=0.001)
    motion.yaw_rate, motion.slip_angle

Written from the equations of M. Althoff, M. Koschi and S. Manzinger, "CommonRoad: Composable benchmarks for motion
planning on roads", IV 2017, and its vehicle models, the single-track model with load transfer by acceleration. Angles
are small there: steering and slip angles stand where their tangents would, and nothing turns a force.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...errors import SettingsError
from ...messages import CarParameters, FloatArray

FRONT_STIFFNESS, REAR_STIFFNESS = 4.718, 5.4562
"""[1/rad] C_Sf and C_Sr: side force over (mu times load times slip angle), of each axle; f1tenth_gym's."""

SLOWEST = 0.1
"""[m/s] Below it the published model switches to a kinematic one, because slip angles are over the speed."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Motion:
    """What the model did, one value a step, each of shape (n,). Of the centre of gravity."""

    x: FloatArray  # [m]
    y: FloatArray  # [m]
    heading: FloatArray  # [rad]
    yaw_rate: FloatArray  # [rad/s]
    slip_angle: FloatArray  # [rad] from the heading to the velocity, left positive


@dataclass(frozen=True, kw_only=True)
class SingleTrack:
    """A car on two linear tires, one for each axle.

    Raises:
      SettingsError: a cornering stiffness or friction that is not positive.
    """

    mu: float  # [-]
    front_stiffness: float  # [1/rad]
    rear_stiffness: float  # [1/rad]
    front_axle_distance: float  # [m] centre of gravity to front axle
    rear_axle_distance: float  # [m]
    center_of_gravity_height: float  # [m]
    mass: float  # [kg]
    yaw_inertia: float  # [kg m^2]
    gravity: float  # [m/s^2]

    def __post_init__(self) -> None:
        for name in ("mu", "front_stiffness", "rear_stiffness"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise SettingsError(f"SingleTrack.{name} is {getattr(self, name)!r}; accepted: a positive number")

    @classmethod
    def of(
        cls,
        car: CarParameters,
        *,
        mu: float,
        front_stiffness: float = FRONT_STIFFNESS,
        rear_stiffness: float = REAR_STIFFNESS,
    ) -> SingleTrack:
        """Return the model of a car; nothing but the two stiffnesses is not the car's own."""
        return cls(
            mu=mu, front_stiffness=front_stiffness, rear_stiffness=rear_stiffness,
            front_axle_distance=car.front_axle_distance, rear_axle_distance=car.rear_axle_distance,
            center_of_gravity_height=car.center_of_gravity_height, mass=car.mass, yaw_inertia=car.yaw_inertia,
            gravity=car.gravity,
        )  # fmt: skip

    @property
    def wheelbase(self) -> float:
        """[m]."""
        return self.front_axle_distance + self.rear_axle_distance

    def rates(
        self, yaw_rate: float, slip_angle: float, steering: float, speed: float, acceleration: float
    ) -> tuple[float, float]:
        """Return how fast yaw rate [rad/s^2] and slip angle [rad/s] change.

        Args:
          yaw_rate: [rad/s].
          slip_angle: [rad].
          steering: [rad].
          speed: of the centre of gravity [m/s].
          acceleration: along the velocity [m/s^2]; it moves load between the axles.
        """
        lf, lr = self.front_axle_distance, self.rear_axle_distance
        moved = acceleration * self.center_of_gravity_height
        front_load = self.mass * (self.gravity * lr - moved) / self.wheelbase
        rear_load = self.mass * (self.gravity * lf + moved) / self.wheelbase
        front = self.mu * self.front_stiffness * front_load * (steering - slip_angle - lf * yaw_rate / speed)
        rear = self.mu * self.rear_stiffness * rear_load * (lr * yaw_rate / speed - slip_angle)
        return (lf * front - lr * rear) / self.yaw_inertia, (front + rear) / (self.mass * speed) - yaw_rate

    def steady_yaw_rate(self, steering: float, speed: float) -> float:
        """Return the yaw rate that a held steering angle and speed lead to, v d / (b + K v^2) [rad/s].

        K is the understeer gradient of the two stiffnesses, (1 / C_Sf - 1 / C_Sr) / (mu g).
        """
        gradient = (1.0 / self.front_stiffness - 1.0 / self.rear_stiffness) / (self.mu * self.gravity)
        return speed * steering / (self.wheelbase + gradient * speed**2)

    def follow(self, steering: FloatArray, speed: FloatArray, *, timestep: float) -> Motion:
        """Drive from the origin, along x, by steering angles and speeds that are given, by Runge and Kutta.

        Args:
          steering: (n,) [rad]; linear from one step to the next.
          speed: (n,) [m/s] of the centre of gravity.
          timestep: between two of them [s].

        Raises:
          SettingsError: a speed below SLOWEST.
        """
        slowest = float(np.min(speed))
        if not slowest >= SLOWEST:
            raise SettingsError(f"the speed is {slowest!r} m/s; accepted: {SLOWEST} m/s and above")
        acceleration = np.gradient(speed, timestep)
        inputs = np.column_stack((steering, speed, acceleration))
        middles = 0.5 * (inputs[:-1] + inputs[1:])
        states = np.zeros((len(inputs), 5))
        state = [0.0] * 5
        rows, between = inputs.tolist(), middles.tolist()
        for step in range(1, len(rows)):
            state = self._step(state, rows[step - 1], between[step - 1], rows[step], timestep)
            states[step] = state
        x, y, heading, yaw_rate, slip_angle = np.ascontiguousarray(states.T)
        return Motion(x=x, y=y, heading=heading, yaw_rate=yaw_rate, slip_angle=slip_angle)

    def _step(
        self, state: list[float], start: list[float], middle: list[float], end: list[float], timestep: float
    ) -> list[float]:
        first = self._derivative(state, start)
        second = self._derivative([a + 0.5 * timestep * b for a, b in zip(state, first, strict=True)], middle)
        third = self._derivative([a + 0.5 * timestep * b for a, b in zip(state, second, strict=True)], middle)
        fourth = self._derivative([a + timestep * b for a, b in zip(state, third, strict=True)], end)
        slopes = zip(state, first, second, third, fourth, strict=True)
        return [a + timestep / 6.0 * (b + 2.0 * c + 2.0 * d + e) for a, b, c, d, e in slopes]

    def _derivative(self, state: list[float], inputs: list[float]) -> list[float]:
        _, _, heading, yaw_rate, slip_angle = state
        steering, speed, acceleration = inputs
        course = heading + slip_angle
        rates = self.rates(yaw_rate, slip_angle, steering, speed, acceleration)
        return [speed * math.cos(course), speed * math.sin(course), yaw_rate, *rates]
