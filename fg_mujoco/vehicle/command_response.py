"""How a car answers the commands that it is sent: what the wheels turn to, and how it accelerates.

The servo of a real car turns the wheels to `steering_gain` times the angle that it is sent, plus `steering_offset`, as
the numeric `steering_map` of its MJCF says; `acceleration_map` says likewise what its motor makes of accelerations.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import mujoco
import numpy as np

from ..arguments import explain_class
from ..errors import ModelError
from ..messages import FloatArray, require
from .car import steering_of
from .steering_servo import response

STEERING_MAP, ACCELERATION_MAP = "steering_map", "acceleration_map"
_PARTS = {STEERING_MAP: "gain, offset [rad]", ACCELERATION_MAP: "gain, gain of negative ones, delay [s]"}


@explain_class
@dataclass(frozen=True, kw_only=True)
class CommandResponse:
    """How a car answers commands. The defaults are those of a car that does what it is sent, at once.

    Raises:
      ModelError: a value out of its range.
    """

    steering_gain: float = 1.0  # [-] of the wheels' angle over the command
    steering_offset: float = 0.0  # [rad] of the wheels at a command of 0
    steering_lag: float = 0.0  # [s] time constant of the servo
    steering_delay: float = 0.0  # [s] until it begins to move
    acceleration_gain: float = 1.0  # [-] of the motor's acceleration over a commanded one
    braking_gain: float = 1.0  # [-] likewise of a negative one; 0: the car coasts
    acceleration_delay: float = 0.0  # [s]

    def __post_init__(self) -> None:
        gains, times = ("steering_gain", "acceleration_gain"), ("steering_lag", "steering_delay", "acceleration_delay")
        require(self, lambda value: 0.0 < value < math.inf, "a positive number", gains, ModelError)
        require(self, math.isfinite, "a finite number", ("steering_offset",), ModelError)
        require(self, lambda value: 0.0 <= value < math.inf, "a number from 0", ("braking_gain", *times), ModelError)

    def wheel_angle(self, command: FloatArray) -> FloatArray:
        """Return the angle of the road wheels [rad] that the servo turns to when it is sent a command [rad]."""
        return np.asarray(self.steering_gain * command + self.steering_offset)

    def steering_command(self, angle: FloatArray) -> FloatArray:
        """Return the command [rad] that turns the road wheels to an angle [rad]."""
        return np.asarray((angle - self.steering_offset) / self.steering_gain)

    def acceleration(self, command: FloatArray) -> FloatArray:
        """Return the acceleration by the motor [m/s^2] that the car makes of a commanded one, without the delay."""
        return np.where(command < 0.0, self.braking_gain, self.acceleration_gain) * command


def command_response(model: mujoco.MjModel) -> CommandResponse:
    """Return how the car of a model, alone and without a prefix, answers commands; ModelError: a wrong numeric."""
    found = {name: _values(model, name) for name in _PARTS}
    steering, acceleration = found[STEERING_MAP] or (1.0, 0.0), found[ACCELERATION_MAP] or (1.0, 1.0, 0.0)
    gain, braking, late = acceleration
    servo, joints = steering_of(model)
    return CommandResponse(
        steering_gain=steering[0], steering_offset=steering[1], steering_lag=response(model, servo, joints)[2],
        steering_delay=float(model.actuator_delay[servo]), acceleration_gain=gain, braking_gain=braking,
        acceleration_delay=late,
    )  # fmt: skip


def _values(model: mujoco.MjModel, name: str) -> tuple[float, ...] | None:
    number = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, name)
    if number < 0:
        return None
    first, size = int(model.numeric_adr[number]), int(model.numeric_size[number])
    wanted = _PARTS[name].count(",") + 1
    if size != wanted:
        raise ModelError(f"numeric {name!r} has {size} values; accepted: {wanted}, {_PARTS[name]}")
    return tuple(model.numeric_data[first : first + size].tolist())
