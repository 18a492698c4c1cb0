"""The sensors that every car can have: odometry, IMU, wheel encoders, localisation, LiDAR, and the others' odometry.

A planner gets the same quantities once a tick in its scan and odometry, without a rate, noise or dropouts of their own.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from ...arguments import explain_class
from ...messages import MOST_OTHERS, OF_OTHER_CAR, columns_of_others, require_whole
from ..car import WHEELS
from ..motion import point_motion
from .sensor import SENSORS, CarState, Sensor


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
    """Pose of base_link in the map frame, as from a localisation."""

    columns = ("x_m", "y_m", "heading_rad")
    frame = "map"

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
