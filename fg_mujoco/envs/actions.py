"""Actions: what a policy answers, their bounds, and the commands that they become.

    env = F1TenthEnv(action="steering_rate,acceleration", normalised_actions=True, smoothing=0.05)

An action has two parts. The first is `steering`, an angle [rad], or `steering_rate` [rad/s]; the second is `speed`
[m/s], or `acceleration` [m/s^2]. Angle and speed are the command. A rate is integrated: in each tick the target changes
by the rate times the period, within the car's limits. An episode's target begins with what the odometry reads then, so
that a car that starts rolling rolls on. `smoothing` is the time constant [s] of a first-order filter from the target to
the command, which in a tick comes nearer by the share 1 - exp(-period / smoothing).

With a `residual` (see there) the two parts are corrections of what a planner commands, the angle [rad] and the speed
[m/s].

A value out of bounds is clipped and counted. A NaN is refused.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import MessageError, SettingsError
from ..messages import CarParameters, FloatArray, shown
from ..native import core

ACTIONS = (("steering", "steering_rate"), ("speed", "acceleration"))
"""What the two parts of an action may be [rad or rad/s, m/s or m/s^2]."""

DEFAULT_ACTION = "steering,speed"

LONGEST_SMOOTHING = 1.0
"""[s] Longest time constant that is accepted."""


@dataclass(frozen=True, kw_only=True)
class CarLimits:
    """The limits of a car that bound actions and observations: fields of CarParameters."""

    max_steering_angle: float  # [rad]
    max_steering_rate: float  # [rad/s]
    min_speed: float  # [m/s] negative
    max_speed: float  # [m/s]
    max_acceleration: float  # [m/s^2]
    wheelbase: float  # [m]
    gravity: float  # [m/s^2]


def as_action(given: Any) -> str:
    """Return the name of what an action is, "steering,speed" by default; SettingsError: it is no such name."""
    parts = [part.strip() for part in given.split(",")] if isinstance(given, str) else []
    if len(parts) != len(ACTIONS) or any(part not in known for part, known in zip(parts, ACTIONS, strict=True)):
        accepted = " or ".join(ACTIONS[0]) + ", a comma, " + " or ".join(ACTIONS[1])
        raise SettingsError(f"action is {shown(given)}; accepted: {accepted}, such as '{DEFAULT_ACTION}'")
    return ",".join(parts)


class ActionBounds:
    """The bounds of actions, read off the car.

    Args:
      speed_range: least and greatest speed [m/s] that is commanded, within the car's; None: the car's.
      normalised: both parts are from -1 to 1, and mean from the least to the greatest.
      smoothing: time constant of the filter [s]; 0: there is none.
      period: of a tick [s].
      residual: a Residual, whose planner the actions correct; None: they are the commands.

    Attributes:
      low, high: (2,) float32, least and greatest.
      limits, share, slow: as `read_actions` takes them.
      ends, span: (2,) sum of least and greatest, and greatest less least.
      remembers: whether a command depends on the one before it.

    Raises:
      SettingsError: a speed range beyond the car's, or no such action.
    """

    def __init__(
        self,
        car: CarParameters | CarLimits,
        speed_range: tuple[float, float] | None = None,
        *,
        normalised: bool = False,
        action: str = DEFAULT_ACTION,
        smoothing: float = 0.0,
        period: float = 0.025,
        residual: Any = None,
    ) -> None:
        self.parts = as_action(action).split(",")
        slowest, fastest = checked_speeds(car, speed_range)
        commands = np.array(((-car.max_steering_angle, slowest), (car.max_steering_angle, fastest)))
        rates = np.array((car.max_steering_rate, car.max_acceleration))
        integrated = np.array([part in ("steering_rate", "acceleration") for part in self.parts])
        least, greatest = np.where(integrated, -rates, commands[0]), np.where(integrated, rates, commands[1])
        self.slow = 0.0
        if residual is not None:
            greatest, self.slow = np.array((residual.steering, residual.speed)), residual.slow
            least = -greatest
        low, high = (-np.ones(2), np.ones(2)) if normalised else (least, greatest)
        at_0, more_at_1 = (0.5 * (least + greatest), 0.5 * (greatest - least)) if normalised else (low * 0.0, high**0)
        self.low, self.high = low.astype(np.float32), high.astype(np.float32)
        # who goes to the bound is within it, as float32 and as float64; the car's own limits are the last word
        bounds = np.minimum(low, self.low), np.maximum(high, self.high)
        self.limits = np.stack((*bounds, at_0, more_at_1, integrated * period, *commands))
        self.ends, self.span = bounds[0] + bounds[1], bounds[1] - bounds[0]
        self.share = 1.0 - math.exp(-period / smoothing) if smoothing > 0.0 else 1.0
        self.remembers = bool(integrated.any()) or smoothing > 0.0


class ActionReader:
    """Converts the actions of n cars to commands, from tick to tick.

    `previous` (n, 2) are the last actions within their bounds, `planned` (n, 2) or (0, 2) the commands they correct.
    """

    def __init__(self, bounds: ActionBounds, count: int) -> None:
        self.bounds, self.planned = bounds, np.zeros((0, 2))
        self._targets = np.zeros((2, count, 2))
        self._unknown = np.ones(count, np.bool_)  # cars whose target is not known yet
        self.previous = np.zeros((count, 2))
        self._at_first = np.clip(np.zeros(2), bounds.low, bounds.high)
        self.begin(np.ones(count, np.bool_))

    def begin(self, which: NDArray[np.bool_]) -> None:
        """Forget the actions of the cars `which` (n,), whose episodes begin."""
        self.previous[which] = self._at_first
        self._unknown[which] = True

    def sense(self, odometry: NDArray[np.void], which: NDArray[np.bool_]) -> None:
        """Take the first targets of the cars `which` (n,) from the odometry (n,), where they are not known."""
        if self.bounds.remembers:
            rows = which & self._unknown
            if rows.any():
                least, greatest = self.bounds.limits[5:]
                now = np.stack((odometry["steering_angle"][rows], odometry["speed"][rows]), axis=1)
                self._targets[:, rows] = np.clip(now, least, greatest)
                self._unknown[rows] = False

    def given(self, actions: ArrayLike) -> FloatArray:
        """Return the actions of n cars as an array (n, 2); MessageError: no numbers, or another shape."""
        try:
            given = np.ascontiguousarray(actions, np.float64)
        except (TypeError, ValueError, OverflowError) as error:
            said = f"actions are {shown(actions)}; accepted: numbers"
            raise MessageError(f"{said}, {action_names(self.bounds)} of each car") from error
        if given.shape != self.previous.shape:
            said = f"actions have shape {given.shape}; accepted: {self.previous.shape}"
            raise MessageError(f"{said}, {action_names(self.bounds)} of each car")
        return given

    def refuse(self, bad: int) -> None:
        """Raise MessageError if `read_actions` has found an action that is NaN, at `bad`."""
        if bad >= 0:
            world, part = divmod(bad, 2)
            raise MessageError(
                f"the action's {action_names(self.bounds)[part]} is nan in world {world} of {len(self.previous)}; "
                "accepted: numbers (they are clipped to the bounds)"
            )

    def read(
        self, actions: ArrayLike, taken: NDArray[np.bool_], commands: FloatArray, clipped: NDArray[np.int64]
    ) -> None:
        """Convert actions (n, 2) of cars `taken` to commands of a tick (n, 2) [rad, m/s]; count the clipped ones (n,).

        MessageError: a NaN, or another shape.
        """
        bounds = self.bounds
        self.refuse(core.read_actions(
            self.given(actions), taken, bounds.limits, bounds.share, self.planned, bounds.slow, self._targets,
            self.previous, commands, clipped,
        ))  # fmt: skip

    @property
    def arrays(self) -> dict[str, NDArray[Any]]:
        """The arrays that `read_actions` takes, by its names, which stay the same."""
        bounds = self.bounds
        return {"limits": bounds.limits, "planned": self.planned, "targets": self._targets, "previous": self.previous}

    @property
    def from_minus_1_to_1(self) -> FloatArray:
        """The last actions, from -1 at the least to 1 at the greatest (n, 2)."""
        found: FloatArray = (2.0 * self.previous - self.bounds.ends) / self.bounds.span
        return found

    def again(self, taken: NDArray[np.bool_], commands: FloatArray) -> None:
        """Write the commands (n, 2) of a further tick of the same actions."""
        bounds = self.bounds
        core.read_actions(
            self.previous, taken, bounds.limits, bounds.share, self.planned, bounds.slow, self._targets,
            self.previous, commands, np.zeros(len(taken), np.int64),
        )  # fmt: skip


def one_action(action: Any, said: str, bounds: ActionBounds) -> FloatArray:
    """Return one action as an array (2,); MessageError, that begins with `said`: it is not two numbers."""
    try:
        given = np.asarray(action, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        given = np.empty(0)
    if given.shape != (2,):
        raise MessageError(f"{said} {shown(action)}; accepted: an action, two numbers, {action_names(bounds)}")
    return given


def checked_speeds(car: CarParameters | CarLimits, speed_range: Any) -> tuple[float, float]:
    """Return the least and the greatest speed that may be commanded [m/s]; SettingsError: a range beyond the car's."""
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


def action_names(bounds: ActionBounds) -> tuple[str, ...]:
    """Return the names of the parts of an action, for messages."""
    return tuple("steering_angle" if part == "steering" else part for part in bounds.parts)
