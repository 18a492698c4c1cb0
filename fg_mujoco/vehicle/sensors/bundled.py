"""The sensors that every car can have: odometry, IMU, wheel encoders, localisation, LiDAR, and the others' odometry.

A planner gets the same quantities once a tick in its scan and odometry, without a rate, noise or dropouts of their own.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...arguments import explain_class
from ...errors import SettingsError
from ...messages import MOST_OTHERS, OF_OTHER_CAR, FloatArray, columns_of_others, require, require_whole, shown
from ..car import WHEELS
from ..motion import point_motion
from .sensor import SENSORS, CarState, Sensor, as_sensors

_MOST_JUMPS = 1000.0


@explain_class
@dataclass(frozen=True, kw_only=True)
class WheelOdometry(Sensor):
    """Speed of the wheels' surfaces in the mean, steering angle, and yaw rate of the gyro."""

    columns = ("speed_m_s", "steering_angle_rad", "yaw_rate_rad_s")

    def measure(self, car: CarState) -> ArrayLike:
        """See Sensor."""
        row = car.odometry
        return row["speed"], row["steering_angle"], row["angular_velocity"][2]


@explain_class
@dataclass(frozen=True, kw_only=True)
class Imu(Sensor):
    """Gyro, and accelerometer with gravity: where the site `imu` is on the car, and as it is turned there.

    An accelerometer measures what holds the car: a level car at rest has 9.81 m/s^2 up; roll and pitch turn it.

    Raises:
      SettingsError: a value out of its range.
    """

    columns = (
        *(f"angular_velocity_{axis}_rad_s" for axis in "xyz"), *(f"linear_acceleration_{axis}_m_s2" for axis in "xyz")
    )  # fmt: skip
    frame = "imu"

    bias_std: float | tuple[float, ...] = 0.0  # standard deviation of an error that stays, drawn once for each run
    vibration: float | tuple[float, ...] = 0.0  # standard deviation of noise, for each m/s of the wheels' surfaces

    def __post_init__(self) -> None:
        super().__post_init__()
        self._require_spread("bias_std")
        self._require_spread("vibration")

    def begin(self, car: CarState, rng: np.random.Generator) -> Callable[[CarState], ArrayLike]:
        """See Sensor."""
        bias, vibration = rng.normal(0.0, self.bias_std, len(self.columns)), np.asarray(self.vibration)

        def measure(car: CarState) -> ArrayLike:
            shaken = vibration * float(np.abs(car.odometry["wheel_speeds"]).mean())
            return np.asarray(self.measure(car)) + bias + rng.normal(0.0, shaken, len(self.columns))

        return measure if np.any(bias) or np.any(vibration) else self.measure

    def measure(self, car: CarState) -> ArrayLike:
        """See Sensor."""
        turning = np.array(car.odometry["angular_velocity"])
        mount = mujoco.mj_name2id(car.model, mujoco.mjtObj.mjOBJ_SITE, f"{car.prefix}imu")
        if mount >= 0:
            mujoco.mju_rotVecQuat(turning, turning.copy(), car.model.site_quat[mount] * (1.0, -1.0, -1.0, -1.0))
        return np.concatenate((turning, car.odometry["linear_acceleration"]))


@explain_class
@dataclass(frozen=True, kw_only=True)
class WheelSpeeds(Sensor):
    """Surface speed of each wheel, by its encoder."""

    columns = tuple(f"{wheel}_m_s" for wheel in WHEELS)

    def measure(self, car: CarState) -> ArrayLike:
        """See Sensor."""
        speeds: ArrayLike = car.odometry["wheel_speeds"]
        return speeds


@explain_class
@dataclass(frozen=True, kw_only=True)
class Pose(Sensor):
    """Pose of base_link in the map frame, as from a localisation: the true one, with the errors that are set.

    `drift` is a random walk: over a time t each value errs by a normal number of standard deviation drift sqrt(t) more.
    `jumps` come at random times: the position is off by `jump_size` in a drawn direction, and with the next one back.

    Raises:
      SettingsError: a value out of its range.
    """

    columns = ("x_m", "y_m", "heading_rad")
    frame = "map"

    drift: float | tuple[float, ...] = 0.0  # standard deviation after 1 s [m, m, rad], of all values or of each
    jumps: float = 0.0  # a second, in the mean
    jump_size: float = 0.0  # [m]
    as_odometry: bool = False  # whether the pose in the car's odometry, too, is what it tells

    def __post_init__(self) -> None:
        super().__post_init__()
        self._require_spread("drift")
        accepted = f"0 to {_MOST_JUMPS:g} a second"
        require(self, lambda value: 0.0 <= value <= _MOST_JUMPS, accepted, ("jumps",), SettingsError)
        require(self, lambda value: 0.0 <= value < math.inf, "a number from 0 [m]", ("jump_size",), SettingsError)
        if bool(self.jumps) != bool(self.jump_size):
            said = f"Pose.jumps is {self.jumps:g} and jump_size {self.jump_size:g}"
            raise SettingsError(f"{said}; accepted: both above 0, or neither")

    @classmethod
    def told(cls, given: Any) -> Sensor:
        """Return what tells the pose of a car's odometry: of a Pose, of its settings by name, or `rate=10,drift=.01`.

        Raises:
          SettingsError: it is none of these, or a value is out of its range.
        """
        said = f"pose is {shown(given)}"
        try:
            if isinstance(given, str):
                parts = [part.split("=") for part in given.split(",")]
                own: dict[str, Any] = {name.strip(): float(value) for name, value in parts}
            else:
                own = given.described() if isinstance(given, Pose) else dict(given)
        except (TypeError, ValueError):
            accepted = "accepted: settings of the sensor pose, such as 'rate=10,delay=.05,drift=.01'"
            raise SettingsError(f"{said}; {accepted}") from None
        try:
            (found,) = as_sensors([{"sensor": "pose", **own, "as_odometry": True}], "pose")
        except SettingsError as error:
            raise SettingsError(f"{said}: {error}") from error
        return found

    def begin(self, car: CarState, rng: np.random.Generator) -> Callable[[CarState], ArrayLike]:
        """See Sensor."""
        walked, jump, before = np.zeros(3), np.zeros(3), car.time

        def measure(car: CarState) -> ArrayLike:
            nonlocal walked, jump, before
            passed, before = car.time - before, car.time
            walked = walked + rng.normal(0.0, 1.0, 3) * self.drift * math.sqrt(passed)
            if rng.poisson(self.jumps * passed) % 2:  # an even number of them leads back
                angle = rng.uniform(0.0, math.tau)
                there = self.jump_size * np.array((math.cos(angle), math.sin(angle), 0.0))
                jump = np.zeros(3) if jump.any() else there
            return np.asarray(self.measure(car)) + walked + jump

        return measure if np.any(self.drift) or self.jumps else self.measure

    def tell(self, values: FloatArray, odometry: NDArray[np.void]) -> None:
        """See Sensor."""
        if self.as_odometry:
            odometry["pose"] = values

    def measure(self, car: CarState) -> ArrayLike:
        """See Sensor."""
        pose: ArrayLike = car.odometry["pose"]
        return pose


@explain_class
@dataclass(frozen=True, kw_only=True)
class LidarRanges(Sensor):
    """Ranges of the last sweep [m], without the LiDAR's effects, rightmost beam first. They change once a tick."""

    frame = "laser"

    def measure(self, car: CarState) -> ArrayLike:
        """See Sensor."""
        return car.ranges

    def size(self, beams: int) -> int:
        """See Sensor."""
        return beams


@explain_class
@dataclass(frozen=True, kw_only=True)
class OtherCars(Sensor):
    """Pose of base_link of each other car in the map frame, its speed over the ground and its yaw rate.

    So it is as if the cars sent each other their odometry. The others are in the order of the race: those of car 0 are
    cars 1, 2 and so on. The columns of the first are `other_1_x_m`, `other_1_y_m` and so on. The rest of them is NaN
    where a race has fewer cars.

    Raises:
      SettingsError: a value out of its range.
    """

    frame = "map"

    cars: int = MOST_OTHERS  # how many are told, the first ones

    def __post_init__(self) -> None:
        require_whole(f"{type(self).__name__}.cars", self.cars, 1, MOST_OTHERS)
        super().__post_init__()

    @property
    def columns(self) -> tuple[str, ...]:  # type: ignore[override]
        """Names of the measured values."""
        return columns_of_others(self.cars)

    def measure(self, car: CarState) -> ArrayLike:
        """See Sensor."""
        values = np.full((self.cars, len(OF_OTHER_CAR)), np.nan)
        for k, row in enumerate(values[: len(car.others)]):
            x, y, heading, speed, _, yaw_rate = point_motion(car.qpos, car.qvel, 0.0, car.others[k : k + 1])
            row[:] = x, y, heading, speed, yaw_rate
        return values.ravel()


SENSORS["odometry"], SENSORS["imu"], SENSORS["wheel_speeds"] = WheelOdometry, Imu, WheelSpeeds
SENSORS["pose"], SENSORS["lidar"], SENSORS["opponents"] = Pose, LidarRanges, OtherCars
