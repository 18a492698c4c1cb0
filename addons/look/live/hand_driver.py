"""Driving by keys. A browser says when a key is pressed, and again while it is held, but not when it is let go.

So a key is a step: of speed, which stays, or of steering, which goes back to straight on soon after the last press.
"""

from __future__ import annotations

import math

from fg_mujoco.errors import SettingsError, accepted_names
from fg_mujoco.messages import CarParameters, DriveCommand

KEYS = {"faster": "I", "slower": "K", "left": "J", "right": "L", "stop": "B"}
"""Actions of keys -> the key, in a browser and on the desktop."""
ARROWS = {"faster": "arrowup", "slower": "arrowdown", "left": "arrowleft", "right": "arrowright", "stop": "space"}
"""The same by the arrows and the space bar, in a browser."""
WASD = {"faster": "W", "slower": "S", "left": "A", "right": "D"}
"""The same by WASD, in a browser: MuJoCo's viewer has other uses for these."""

_SPEED_STEP = 0.5  # [m/s]
_MOST_BACKWARD = -2.0  # [m/s]
_STEERING_STEP = 0.25  # of the car's greatest angle
_HELD = 0.6  # [s] that a press lasts: a little longer than keyboards wait before they repeat a key
_RETURN = 0.15  # [s] time constant of going back to straight on


class HandDriver:
    """Answers commands to keys: the `speed` [m/s] and `steering` [rad], left positive, within a car's limits."""

    def __init__(self, car: CarParameters) -> None:
        self._car = car
        self.release()

    def release(self) -> None:
        """Let go of everything: the car is to stand."""
        self.speed = self.steering = 0.0
        self._last_turn = -math.inf

    def press(self, name: str, time: float) -> None:
        """Press a key at a time [s]; SettingsError: there is no such key."""
        if name not in KEYS:
            raise SettingsError(f"key {name!r}; {accepted_names(name, KEYS)}")
        if name == "stop":
            self.speed = 0.0
        elif name in ("faster", "slower"):
            step = _SPEED_STEP if name == "faster" else -_SPEED_STEP
            self.speed = min(max(self.speed + step, _MOST_BACKWARD), self._car.max_speed)
        else:
            greatest = self._car.max_steering_angle
            turn = _STEERING_STEP * greatest * (1.0 if name == "left" else -1.0)
            if turn * self.steering < 0.0:  # the other way: not first back to the middle
                self.steering = 0.0
            self.steering = min(max(self.steering + turn, -greatest), greatest)
            self._last_turn = time

    def command(self, time: float, period: float, max_speed: float) -> DriveCommand:
        """Return the command for the tick that begins at a time [s] and lasts `period` [s]."""
        if time - self._last_turn > _HELD:
            self.steering *= math.exp(-period / _RETURN)
        return DriveCommand(steering_angle=self.steering, speed=min(self.speed, max_speed))
