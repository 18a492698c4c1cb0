"""What a policy sees: the scan and the car's own sensors by default, and terms that are chosen by name.

    env = F1TenthEnv(observations=["scan", "speed", "command", "heading_error"])

| name | shape | value |
| --- | --- | --- |
| scan | (beams,) | distances [m], rightmost beam first; no return reads `range_max`, too close or failed reads 0 |
| speed | (1,) | mean speed of the wheels' surfaces, forward positive [m/s] |
| yaw_rate | (1,) | left positive [rad/s] |
| steering_angle | (1,) | of the servo, left positive [rad] |
| acceleration | (2,) | ahead and to the left, of the accelerometer in the centre of gravity [m/s^2] |
| wheel_speeds | (4,) | speed of each wheel's surface, forward positive [m/s]; not among the default ones |

These are sensors' readings; none of them knows the course or the pose. Further terms are functions of a `SensedState`,
made with `@observation`. All are float32 within bounds; a value beyond them reads the bound.

Each of the settings' `sensors` is one more, by its name: its latest values, NaN before the first are delivered.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import SettingsError
from ..lidar.beams import Beams
from ..messages import ODOMETRY, CarParameters, FloatArray, Reading, shown
from ..registry import Registry
from ..vehicle.sensors import Sensor
from .reward_kernels import read_sensors
from .tick_state import SensedState

Observation = dict[str, NDArray[np.float32]]
ObservationFunction = Callable[[SensedState], ArrayLike]
Ends = tuple[ArrayLike, ArrayLike]
"""Least and greatest value: numbers, or arrays (k,)."""

ACCELEROMETER_RANGE = 4.0
"""[g] The narrowest range that IMUs on such cars are commonly set to; the tires give little more than 1."""

_OVERSHOOT = 1.25  # of spinning wheels over the greatest speed that can be commanded

DEFAULT_OBSERVATIONS = ("scan", "speed", "yaw_rate", "steering_angle", "acceleration")

_MADE = "or an ObservationTerm, as @observation makes it"

SENSED = (*DEFAULT_OBSERVATIONS, "wheel_speeds")
"""The parts that are read off the scan and the odometry; see the table above."""


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
                f"an observation is called {shown(self.name)}; accepted: one word besides {', '.join(SENSED)}"
            )
        if not callable(self.function):
            raise SettingsError(f"observation {self.name!r} is {shown(self.function)}; accepted: a function")

    def bounds_of(self, car: CarParameters) -> Bounds:
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
    """A part of an observation that a compiled loop reads off the scan or the odometry."""

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


def as_observations(given: Any) -> tuple[Term, ...]:
    """Return the parts of a list of names and ObservationTerms.

    Raises:
      SettingsError: no such list, an empty one, an unknown name, or the same name twice.
    """
    if isinstance(given, str) or not isinstance(given, Sequence) or len(given) == 0:
        raise SettingsError(f"observations is {shown(given)}; accepted: a list of names and ObservationTerms")
    found: list[Term] = []
    for each in given:
        term = OBSERVATIONS.find(each, f", {_MADE}") if isinstance(each, str) else each
        if not isinstance(term, Term):
            raise SettingsError(f"an observation is {shown(each)}; accepted: a name, {_MADE}")
        if any(term.name == other.name for other in found):
            raise SettingsError(f"observation {term.name!r} stands twice in observations; accepted: once")
        found.append(term)
    return tuple(found)


def _column(name: str) -> int:
    """Return where a field of ODOMETRY begins in a row of its numbers, all of which are float64."""
    assert ODOMETRY.fields is not None
    return int(ODOMETRY.fields[name][1]) // np.dtype(np.float64).itemsize


_AHEAD, _WHEELS = _column("linear_acceleration"), _column("wheel_speeds")
_COLUMNS = {
    "speed": [_column("speed")],
    "yaw_rate": [_column("angular_velocity") + 2],  # about the z axis
    "steering_angle": [_column("steering_angle")],
    "acceleration": [_AHEAD, _AHEAD + 1],
    "wheel_speeds": list(range(_WHEELS, _WHEELS + 4)),
}
"""Where the numbers of each sensor are in a row of ODOMETRY."""


class ObservationLayout:
    """Makes observations from scans, odometry and the state of the cars.

    Args:
      car: of the compiled model.
      beams: of its LiDAR.
      beam_step: every how many-th beam is seen, counted from the one straight ahead to both sides.
      parts: names and ObservationTerms.
      sensors: that the car has besides; what each delivered last is a part of its name.

    Attributes:
      bounds: name -> Bounds, in the order of the parts and the sensors.
      bearings: of the beams that are seen (beams,) [rad].

    Raises:
      SettingsError: a step that leaves the beam straight ahead alone, a term with other bounds than it may have, or a
        sensor with the name of another part.
    """

    def __init__(
        self,
        car: CarParameters,
        beams: Beams,
        beam_step: int = 1,
        parts: Sequence[str | Term] = DEFAULT_OBSERVATIONS,
        sensors: Sequence[Sensor] = (),
    ) -> None:
        middle = len(beams.bearings) // 2
        if not 1 <= beam_step <= middle:
            raise SettingsError(f"beam_step is {beam_step!r}; accepted: a whole number from 1 to {middle}")
        self._first, self._step = middle % beam_step, beam_step
        self.bearings = beams.bearings[self._first :: beam_step]
        self._range_max = beams.range_max
        fastest = max(abs(car.min_speed), car.max_speed) * _OVERSHOOT
        limits = {
            "speed": fastest,
            "yaw_rate": fastest * math.tan(car.max_steering_angle) / car.wheelbase,
            "steering_angle": car.max_steering_angle,
            "acceleration": ACCELEROMETER_RANGE * car.gravity,
            "wheel_speeds": fastest,
        }
        self.bounds: dict[str, Bounds] = {}
        self._parts: dict[str, slice | ObservationTerm | Sensor | None] = {}
        columns: list[int] = []
        for term in as_observations(parts):
            name, first = term.name, len(columns)
            if isinstance(term, ObservationTerm):
                self.bounds[name], self._parts[name] = term.bounds_of(car), term
            elif name == "scan":
                self.bounds[name], self._parts[name] = _bounds(0.0, beams.range_max, len(self.bearings)), None
            else:
                columns += _COLUMNS[name]
                self.bounds[name] = _bounds(-limits[name], limits[name], len(_COLUMNS[name]))
                self._parts[name] = slice(first, len(columns))
        for sensor in sensors:
            if sensor.name in self._parts:
                said = f"sensor {sensor.name!r} has the name of another observation"
                raise SettingsError(f"{said}; accepted: a `name` of its own, not {', '.join(self._parts)}")
            size = sensor.size(len(beams.bearings))
            self.bounds[sensor.name], self._parts[sensor.name] = _bounds(-math.inf, math.inf, size), sensor
        self._columns, self._beams_seen = np.array(columns, np.int64), len(self.bearings) * ("scan" in self.bounds)
        read = [self.bounds[name].high for name, part in self._parts.items() if isinstance(part, slice)]
        self._high = np.concatenate([np.empty(0, np.float32), *read])

    def read(
        self,
        ranges: FloatArray,
        odometry: NDArray[np.void],
        state: SensedState | None = None,
        readings: Sequence[Mapping[str, Reading]] = (),
    ) -> Observation:
        """Return the observations of n cars, new arrays (n, ...) by name.

        Args:
          ranges: of all beams (n, 1081) [m], as in LaserScan.
          odometry: (n,) of ODOMETRY.
          state: of the cars; needed where there are ObservationTerms.
          readings: of each car's sensors, by name; needed where there are sensors.
        """
        count = len(ranges)
        scan = np.empty((count, self._beams_seen), np.float32)
        values = np.empty((count, len(self._columns)), np.float32)
        read_sensors(
            ranges, odometry.view(np.float64).reshape(count, -1), self._first, self._step, self._range_max,
            self._columns, self._high, scan, values,
        )  # fmt: skip
        found: Observation = {}
        for name, part in self._parts.items():
            if isinstance(part, slice):
                found[name] = values[:, part]
            elif part is None:
                found[name] = scan
            elif isinstance(part, Sensor):
                found[name] = np.array([each[name].values for each in readings], np.float32)
            else:
                assert state is not None
                found[name] = part.read(state, self.bounds[name])
        return found


def _bounds(low: float, high: float, size: int) -> Bounds:
    return Bounds(low=np.full(size, low, np.float32), high=np.full(size, high, np.float32))
