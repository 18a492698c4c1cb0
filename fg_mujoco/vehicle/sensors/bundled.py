"""The sensors that every car can have: odometry, IMU, wheel encoders, localisation, and LiDAR.

A planner gets the same quantities once a tick in its scan and odometry, without a rate, noise or dropouts of their own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ...arguments import explain_class
from ..car import WHEELS
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
    """Gyro, and accelerometer with gravity; car frame."""

    columns = (
        *(f"angular_velocity_{axis}_rad_s" for axis in "xyz"), *(f"linear_acceleration_{axis}_m_s2" for axis in "xyz")
    )  # fmt: skip
    frame = "imu"

    def measure(self, car: CarState) -> ArrayLike:
        """See Sensor."""
        return np.concatenate((car.odometry["angular_velocity"], car.odometry["linear_acceleration"]))


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
    """Where base_link is in the map frame, as a localisation would say it."""

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


SENSORS["odometry"], SENSORS["imu"], SENSORS["wheel_speeds"] = WheelOdometry, Imu, WheelSpeeds
SENSORS["pose"], SENSORS["lidar"] = Pose, LidarRanges
