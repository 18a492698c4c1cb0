"""Actions and their bounds: an action is [steering angle, speed], as the array of a DriveCommand.

A value out of bounds is clipped and counted. A NaN is refused.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import MessageError, SettingsError
from ..messages import CarParameters, FloatArray, shown
from .reward_kernels import read_actions

ACTION = ("steering_angle", "speed")
"""The parts of an action [rad, m/s]."""


class ActionBounds:
    """The bounds of actions, read off the car.

    Args:
      car: of the compiled model.
      speed_range: least and greatest speed [m/s], within the car's; None: the car's.
      normalised: both parts are from -1 to 1, and mean from the least to the greatest.

    Attributes:
      low: (2,) float32, least.
      high: (2,) float32, greatest.

    Raises:
      SettingsError: a speed range beyond the car's.
    """

    def __init__(
        self, car: CarParameters, speed_range: tuple[float, float] | None = None, *, normalised: bool = False
    ) -> None:
        slowest, fastest = _checked(car, speed_range)
        least = np.array((-car.max_steering_angle, slowest))
        greatest = np.array((car.max_steering_angle, fastest))
        low, high = (-np.ones(2), np.ones(2)) if normalised else (least, greatest)
        at_0, more_at_1 = (0.5 * (least + greatest), 0.5 * (greatest - least)) if normalised else (low * 0.0, high**0)
        self.low, self.high = low.astype(np.float32), high.astype(np.float32)
        # who goes to the bound is within it, as float32 and as float64; the car's own limits are the last word
        self._limits = np.stack((np.minimum(low, self.low), np.maximum(high, self.high), at_0, more_at_1))

    def read(
        self, actions: ArrayLike, taken: NDArray[np.bool_], commands: FloatArray, clipped: NDArray[np.int64]
    ) -> None:
        """Convert the actions of n cars to commands, and count the clipped ones.

        Args:
          actions: (n, 2).
          taken: (n,) whose actions count; the others may be anything.
          commands: (n, 2) [rad, m/s] written to.
          clipped: (n,) counts, added to.

        Raises:
          MessageError: a NaN, or an array of another shape.
        """
        try:
            given = np.asarray(actions, dtype=np.float64)
        except (TypeError, ValueError, OverflowError) as error:
            raise MessageError(f"actions are {shown(actions)}; accepted: numbers, {ACTION} of each car") from error
        if given.shape != (len(taken), 2):
            raise MessageError(f"actions have shape {given.shape}; accepted: ({len(taken)}, 2), {ACTION} of each car")
        bad = read_actions(given, taken, self._limits, commands, clipped)
        if bad >= 0:
            world, part = divmod(bad, 2)
            raise MessageError(
                f"the action's {ACTION[part]} is nan in world {world} of {len(taken)}; accepted: numbers (what is out "
                "of bounds is held within them)"
            )


def one_action(action: Any, said: str) -> FloatArray:
    """Return one action as an array (2,).

    Raises:
      MessageError: it is not two numbers; the message begins with `said`.
    """
    try:
        given = np.asarray(action, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        given = np.empty(0)
    if given.shape != (2,):
        raise MessageError(f"{said} {shown(action)}; accepted: an action, two numbers, {ACTION}")
    return given


def _checked(car: CarParameters, speed_range: Any) -> tuple[float, float]:
    if speed_range is None:
        return car.min_speed, car.max_speed
    try:
        slowest, fastest = map(float, speed_range)
    except (TypeError, ValueError):
        slowest = fastest = math.nan
    if not car.min_speed <= slowest < fastest <= car.max_speed:
        raise SettingsError(
            f"speed_range is {speed_range!r}; accepted: least and greatest speed, within {car.min_speed} to "
            f"{car.max_speed} m/s"
        )
    return slowest, fastest
