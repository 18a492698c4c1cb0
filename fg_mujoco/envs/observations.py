"""Parts of an observation: the scan and the car's own sensors by default, and terms that are chosen by name.

    env = F1TenthEnv(observation="scan,speed,command,heading_error")

| name | shape | value |
| --- | --- | --- |
| scan | (beams,) | distances [m], rightmost beam first; no return reads `range_max`, too close or failed reads 0 |
| speed | (1,) | mean speed of the driven wheels' surfaces, forward positive [m/s] |
| yaw_rate | (1,) | left positive [rad/s] |
| steering_angle | (1,) | of the servo, left positive [rad] |
| acceleration | (2,) | ahead and to the left, of the accelerometer in the centre of gravity [m/s^2] |
| wheel_speeds | (4,) | speed of each wheel's surface, forward positive [m/s]; not among the default ones |
| previous_action | (2,) | last action of the policy, within its bounds; 0 (or the bound next to it) at the beginning |
| planner_command | (2,) | steering angle [rad] and speed [m/s] of the planner that the policy corrects |

These are known on board; none of them knows the course or the pose. Further terms are functions of a `SensedState`,
made with `@observation`. All are float32 within bounds; a value beyond them reads the bound.

Each of the settings' `sensors` is one more, by its name: its latest values, and `NAME_received` (1,), which is 0 before
the first are delivered and 1 from then on. A value that is no number, or not there yet, reads 0; inf reads the
`range_max` of the LiDAR.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import portable
from ..errors import SettingsError
from ..messages import CarParameters, FloatArray, shown
from ..registry import Registry
from .tick_state import SensedState

Observed = dict[str, NDArray[np.float32]]
ObservationFunction = Callable[[SensedState], ArrayLike]
Ends = tuple[ArrayLike, ArrayLike]
"""Least and greatest value: numbers, or arrays (k,)."""

ACCELEROMETER_RANGE = 4.0
"""[g] The narrowest range that IMUs on such cars are commonly set to; the tires give little more than 1."""

DEFAULT_OBSERVATIONS = ("scan", "speed", "yaw_rate", "steering_angle", "acceleration")

_MADE = "or an ObservationTerm, as @observation makes it"

SENSED = (*DEFAULT_OBSERVATIONS, "wheel_speeds", "previous_action", "planner_command")
"""The parts that are read off the scan, the odometry and the policy's own actions; see the table above."""

ON_BOARD = (*SENSED, "command")
"""The parts that a car knows by itself."""

SCALES: Mapping[str, float | tuple[float, ...]] = {
    "speed": 10.0,  # [m/s]
    "yaw_rate": 5.0,  # [rad/s] of 10 m/s^2 at 2 m/s
    "acceleration": 10.0,  # [m/s^2]
    "wheel_speeds": 10.0,  # [m/s]
    "pose": (10.0, 10.0, math.pi),  # [m, m, rad]
    "cross_track_error": 1.0,  # [m]
    "wall_distance": 1.0,  # [m]
    "lateral_speed": 1.0,  # [m/s]
    "slip": 1.0,  # [m/s]
    "curvature": 1.0,  # [1/m]
    "lead": 10.0,  # [m]
    "mu": 1.0,
}
"""What a part is divided by where it is normalised. Other parts: the greatest magnitude of their bounds. An action that
is not normalised is divided likewise. A distance d of the scan becomes d / (1 m + d), which tells near ones apart best.
The readings of a car's `sensors` stay as they are."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Bounds:
    """Least and greatest values of one part of an observation; both have its shape, float32."""

    low: NDArray[np.float32]
    high: NDArray[np.float32]


@dataclass(frozen=True, kw_only=True, eq=False)
class ObservationTerm:
    """A part of an observation that is a function of the state of the cars.

    Raises:
      SettingsError: a name that is no word or is that of a sensor, or no function.
    """

    name: str
    function: ObservationFunction  # of a SensedState: (n,), or (n, k) where the bounds have k numbers
    bounds: Ends | Callable[[CarParameters], Ends]  # least and greatest, or a function of the car that returns them

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name.isidentifier() or self.name in SENSED:
            raise SettingsError(
                f"an observation is called {shown(self.name)}; accepted: one word other than {', '.join(SENSED)}"
            )
        if not callable(self.function):
            raise SettingsError(f"observation {self.name!r} is {shown(self.function)}; accepted: a function")

    def bounds_of(self, car: Any) -> Bounds:
        """Return the bounds, of the shape (k,) of the part, or (1,).

        Raises:
          SettingsError: they are not two numbers or arrays of one shape (k,), the first below the second and finite.
        """
        given = self.bounds(car) if callable(self.bounds) else self.bounds
        try:
            low, high = (np.atleast_1d(np.asarray(end, np.float32)) for end in given)
        except (TypeError, ValueError):
            low = high = np.zeros(0, np.float32)
        fit = low.shape == high.shape and low.ndim == 1 and len(low) > 0
        if not fit or not (np.isfinite(low).all() and np.isfinite(high).all() and (low < high).all()):
            raise SettingsError(
                f"the bounds of observation {self.name!r} are {shown(given)}; accepted: least and greatest, two finite "
                "numbers or two arrays (k,)"
            )
        return Bounds(low=low, high=high)

    def read(self, state: SensedState, bounds: Bounds) -> NDArray[np.float32]:
        """Return the values within their bounds. Shape (n, k).

        Raises:
          SettingsError: the function returned another shape, or no numbers.
        """
        values, shape = np.asarray(self.function(state)), (len(state.time), len(bounds.low))
        if values.shape not in (shape, shape[:1] if shape[1] == 1 else shape) or values.dtype.kind not in "biuf":
            raise SettingsError(
                f"observation {self.name!r} returned {values.dtype} of shape {values.shape}; accepted: numbers of "
                f"shape {shape}"
            )
        found: NDArray[np.float32] = np.clip(values.reshape(shape).astype(np.float32), bounds.low, bounds.high)
        return found


@dataclass(frozen=True, kw_only=True)
class SensedTerm:
    """A part of an observation that compiled loops make of the scan or the odometry, or the policy's own action."""

    name: str  # one of SENSED


Term = SensedTerm | ObservationTerm

OBSERVATIONS: Registry[Term] = Registry("observation", SettingsError, "fg_mujoco.observations")
"""The parts that are known by name."""
for _name in SENSED:
    OBSERVATIONS[_name] = SensedTerm(name=_name)


def observation(
    bounds: Ends | Callable[[CarParameters], Ends],
) -> Callable[[ObservationFunction], ObservationTerm]:
    """Make an observation term of a function and register it by the function's name, for use as a decorator.

    Args:
      bounds: as in ObservationTerm.

    Raises:
      SettingsError: as ObservationTerm, or a bundled term has that name.
    """

    def register(function: ObservationFunction) -> ObservationTerm:
        made = ObservationTerm(name=function.__name__, function=function, bounds=bounds)
        known = OBSERVATIONS.find(made.name) if made.name in OBSERVATIONS else None
        if isinstance(known, ObservationTerm) and known.function.__module__ == __name__:
            raise SettingsError(f"observation {made.name!r} is a bundled one; accepted: another name")
        OBSERVATIONS[made.name] = made
        return made

    return register


def _commands_of(car: CarParameters) -> Ends:
    return (-car.max_steering_angle, car.min_speed), (car.max_steering_angle, car.max_speed)


@observation(_commands_of)
def command(state: SensedState) -> FloatArray:
    """The last command: steering angle [rad] and speed [m/s]; 0 at the beginning of an episode."""
    return state.command


@observation((-math.pi, math.pi))
def heading_error(state: SensedState) -> FloatArray:
    """Angle from the direction of the course to the heading, left positive [rad]. A car does not know it."""
    return state.heading_error


@observation((-5.0, 5.0))
def cross_track_error(state: SensedState) -> FloatArray:
    """Distance of the rear axle from the line of the course, left positive [m]. A car does not know it."""
    return state.offset


@observation((0.0, 5.0))
def wall_distance(state: SensedState) -> FloatArray:
    """Distance from the footprint to the nearest wall or obstacle [m]. A car does not know it."""
    return state.wall_distance


@observation(lambda car: (2.0 * min(car.min_speed, -car.max_speed), 2.0 * car.max_speed))
def lateral_speed(state: SensedState) -> FloatArray:
    """True speed of the rear axle to the left [m/s]. A car does not know it."""
    return state.lateral_speed


@observation((-30.0, 30.0))
def lead(state: SensedState) -> FloatArray:
    """Lead on the foremost other car along the course, negative behind it [m]; 30 alone. A car does not know it."""
    return state.lead


@observation(((-1e4, -1e4, -math.pi), (1e4, 1e4, math.pi)))
def pose(state: SensedState) -> FloatArray:
    """True x [m], y [m] and heading [rad] in the map's frame. A car does not know it."""
    turned = state.pose.copy()
    turned[:, 2] -= 2.0 * math.pi * np.round(turned[:, 2] / (2.0 * math.pi))
    return turned


@observation((np.full(3, -5.0), np.full(3, 5.0)))
def curvature(state: SensedState) -> FloatArray:
    """Mean curvature of the course over the next 1, 2 and 4 m, left positive [1/m]. A car does not know it."""
    return state.curvature


@observation(lambda car: (np.full(2, -2.0 * car.max_speed), np.full(2, 2.0 * car.max_speed)))
def slip(state: SensedState) -> FloatArray:
    """Speed of the front and of the rear axle across their wheels, left positive [m/s]. A car does not know it."""
    angle, rear = state.odometry["steering_angle"], state.lateral_speed
    front = (rear + state.car.wheelbase * state.yaw_rate) * portable.cos(angle) - state.speed * portable.sin(angle)
    return np.stack((front, rear), axis=1)


@observation((0.0, 10.0))
def mu(state: SensedState) -> FloatArray:
    """Coefficient of friction of the floor, besides patches. A car does not know it."""
    return state.mu
