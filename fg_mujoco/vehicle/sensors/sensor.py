"""The base of all sensors, what they can measure, and their registry.

    @dataclass(frozen=True, kw_only=True)
    class GroundSpeed(Sensor):
        columns = ("vx_m_s", "vy_m_s")

        def measure(self, car):
            return body_velocity(car.qpos, car.qvel, car.constants)

    SENSORS["ground_speed"] = GroundSpeed
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass, fields
from functools import cached_property
from traceback import extract_tb
from typing import Any, ClassVar

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...arguments import explain_class
from ...errors import FgMujocoError, SettingsError, accepted_names
from ...messages import ODOMETRY, FloatArray, require, shown
from ...registry import Registry
from ..car import sensor_slice
from ..motion import drift_odometry, read_odometry

LONGEST_DELAY = 10.0
"""[s] Longest delay of a sensor that is accepted."""

NOTHING_YET: ArrayLike = np.empty(0)
"""What a sensor that gathers a reading over several measurements returns until it is complete."""

_LONGEST_NAME = 40
_ANY_RATE = 1e6  # [Hz]; the physics steps say which rates there are


@dataclass(frozen=True, kw_only=True, eq=False)
class CarState:
    """State of a car at one moment, for a sensor to measure. The arrays are the engine's own: do not change them.

    The functions of `fg_mujoco.vehicle.motion` take `qpos`, `qvel` and `constants`.
    """

    time: float  # [s] since the start
    qpos: FloatArray  # positions and velocities of the world, as in mujoco.MjData
    qvel: FloatArray
    ctrl: FloatArray  # of the last tick
    sensordata: FloatArray  # of the last physics step, as in mujoco.MjData
    ranges: FloatArray  # (beams,) [m] of the last sweep of the LiDAR, without its effects
    constants: NDArray[np.void]  # (1,) of vehicle.motion.CAR: where the car is in these arrays, and its limits
    others: NDArray[np.void]  # (m - 1,) of the other cars of its world, in their order
    odometry_drift: float  # relative error of the wheels' speeds and of the yaw rate
    model: mujoco.MjModel  # of the world
    prefix: str  # of the names in the model that belong to the car

    def sensor(self, name: str) -> FloatArray:
        """Return the readings of a sensor of the vehicle's MJCF by its name there.

        Raises:
          ModelError: it has none of that name.
        """
        return self.sensordata[sensor_slice(self.model, self.prefix + name)]

    @cached_property
    def odometry(self) -> np.void:
        """Readings of encoders, steering sensor and IMU now, as a row of messages.ODOMETRY."""
        rows = np.zeros(1, ODOMETRY)
        read_odometry(self.time, self.qpos, self.qvel, self.sensordata, self.constants, rows)
        if self.odometry_drift:
            drift_odometry(rows, np.array((1.0 + self.odometry_drift,)))
        row: np.void = rows[0]
        return row


@explain_class
@dataclass(frozen=True, kw_only=True)
class Sensor:
    """Settings of a sensor on a car. A subclass says what it measures.

    Noise and dropouts are drawn from a random stream of their own, which follows from the seed of the car and the name
    of the sensor. A reading that drops out is missing: the last one before it stays the latest.

    Attributes:
      columns: names of the measured values, with their units at the end.
      frame: that the values are in.

    Raises:
      SettingsError: a value out of its range, or a class that is not in SENSORS.
    """

    columns: ClassVar[tuple[str, ...]] = ()
    frame: ClassVar[str] = "base_link"

    name: str = ""  # of its readings; "": its name in SENSORS
    rate: float | None = None  # [Hz] one in a whole number of physics steps; None: that of its class, or once a tick
    delay: float = 0.0  # [s] from measurement to delivery; delivered are readings of at least this age
    noise_std: float | tuple[float, ...] = 0.0  # standard deviation of Gaussian noise, of all values or of each
    dropout_probability: float = 0.0  # of each reading to be missing

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", self.name or self.kind)
        if not (isinstance(self.name, str) and self.name.isidentifier() and len(self.name) <= _LONGEST_NAME):
            accepted = f"letters, digits and underscores, up to {_LONGEST_NAME}, the first no digit"
            raise SettingsError(f"{type(self).__name__}.name is {shown(self.name)}; accepted: {accepted}")
        if self.rate is None:
            object.__setattr__(self, "rate", type(self).rate)
        if self.rate is not None:
            accepted = f"a number above 0, up to {_ANY_RATE:g} [Hz]"
            require(self, lambda value: 0.0 < value <= _ANY_RATE, accepted, ("rate",), SettingsError)
        accepted = f"0 to {LONGEST_DELAY:g} s"
        require(self, lambda value: 0.0 <= value <= LONGEST_DELAY, accepted, ("delay",), SettingsError)
        require(self, lambda value: 0.0 <= value <= 1.0, "0 to 1", ("dropout_probability",), SettingsError)
        self._require_spread("noise_std")
        told = getattr(self, "as_odometry", False)
        if not isinstance(told, bool):
            raise SettingsError(f"{type(self).__name__}.as_odometry is {shown(told)}; accepted: True or False")

    def _require_spread(self, name: str) -> None:
        """Refuse a standard deviation that is neither a number from 0 nor one for each column."""
        value = getattr(self, name)
        if isinstance(value, list):
            object.__setattr__(self, name, value := tuple(value))
        each = value if isinstance(value, tuple) else (value,)
        numbers = all(isinstance(number, (int, float)) and 0.0 <= number < math.inf for number in each)
        if not numbers or (isinstance(value, tuple) and len(each) != len(self.columns)):
            accepted = "a number from 0" + (f", or one for each of {', '.join(self.columns)}" if self.columns else "")
            raise SettingsError(f"{type(self).__name__}.{name} is {shown(value)}; accepted: {accepted}")

    def begin(self, car: CarState, rng: np.random.Generator) -> Callable[[CarState], ArrayLike]:
        """Return what measures on a car from its start on, in place of `measure`, for a sensor that remembers.

        `rng` is for what it draws, of the car's seed and the sensor's name; ModelError: the car lacks what it measures.
        """
        return self.measure

    def tell(self, values: FloatArray, odometry: NDArray[np.void]) -> None:
        """Write the latest reading into the car's odometry, (1,) of ODOMETRY, for a sensor that it is made of.

        Before the first reading its values are NaN.
        """

    def measure(self, car: CarState) -> ArrayLike:
        """Return what is measured, without noise: a number for each of `columns`."""
        raise NotImplementedError

    def size(self, beams: int) -> int:
        """Return how many values a reading has, on a car whose LiDAR has so many beams."""
        return len(self.columns)

    @property
    def kind(self) -> str:
        """The name of its class in SENSORS.

        Raises:
          SettingsError: it is not there.
        """
        own, said = type(self), type(self).__name__
        for name in SENSORS:
            if SENSORS.find(name) is own:
                return name
        for point in SENSORS.entry_points():
            if point.value == f"{own.__module__}:{own.__qualname__}":
                return point.name
        raise SettingsError(f"sensor {said} is not registered; accepted: SENSORS['a_name'] = {said} before it is made")

    def steps(self, timestep: float, substeps: int) -> int:
        """Return how many physics steps, of `timestep` [s] and `substeps` a tick, pass from one reading to the next.

        Raises:
          SettingsError: no whole number.
        """
        if self.rate is None:
            return substeps
        steps = 1.0 / (self.rate * timestep)
        whole = max(round(steps), 1)
        if abs(steps - whole) > 1e-3:  # 33.3333 Hz is meant to be 1/30 ms
            fastest = 1.0 / timestep
            near = sorted({fastest / max(math.floor(steps), 1), fastest / math.ceil(steps)}, reverse=True)
            such = " or ".join(f"{rate:.6g} Hz" for rate in near)
            said = f"sensor {self.name!r} has a rate of {self.rate:g} Hz"
            raise SettingsError(f"{said}; accepted: {fastest:g} Hz over a whole number, nearest {such}")
        return whole

    def described(self) -> dict[str, Any]:
        """Return its name in SENSORS and its settings as they can stand in JSON; `as_sensors` reads them back."""
        return {"sensor": self.kind, **{name: value for name, value in asdict(self).items() if value is not None}}


SENSORS: Registry[type[Sensor]] = Registry("sensor", SettingsError, "fg_mujoco.sensors", instance_of=type)
"""Sensors by name. A module that defines one adds it; other packages register theirs as entry points."""


def as_sensors(values: Any, name: str = "sensors") -> tuple[Sensor, ...]:
    """Return the sensors of a car, such as ["imu", {"sensor": "pose", "rate": 10}, WheelSpeeds(noise_std=0.1)].

    Raises:
      SettingsError: one is none of these, or two have the same name.
    """
    if isinstance(values, (str, Mapping, Sensor)) or not isinstance(values, Iterable):
        raise SettingsError(f"{name} is {shown(values)}; accepted: a sequence of sensors, such as ['imu']")
    found = tuple(_as_sensor(value, f"{name}[{index}]") for index, value in enumerate(values))
    names = [sensor.name for sensor in found]
    for each in names:
        if names.count(each) > 1:
            raise SettingsError(f"{name} has two of the name {each!r}; accepted: a `name` of its own for each")
    return found


def _as_sensor(value: Any, where: str) -> Sensor:
    if isinstance(value, Sensor):
        return value
    settings = dict(value) if isinstance(value, Mapping) else {"sensor": value}
    chosen = settings.pop("sensor", None)
    if not isinstance(chosen, str):
        accepted = "a Sensor, its name, or {'sensor': NAME} with settings; names are " + ", ".join(SENSORS.names())
        raise SettingsError(f"{where} is {shown(value)}; accepted: {accepted}")
    if chosen not in SENSORS.names():
        raise SettingsError(f"{where} is {chosen!r}; {accepted_names(chosen, SENSORS.names())}")
    kind = SENSORS.find(chosen)
    known = [field.name for field in fields(kind)]
    for name in settings:
        if name not in known:
            raise SettingsError(f"sensor {chosen!r} has no setting {name!r}; {accepted_names(name, known)}")
    try:
        return kind(**settings)
    except FgMujocoError:
        raise
    except Exception as error:
        at = extract_tb(error.__traceback__)[-1]
        said = f"{where}, {chosen!r}, cannot be made: {type(error).__name__}: {error} ({at.filename}, line {at.lineno})"
        raise SettingsError(said) from error
