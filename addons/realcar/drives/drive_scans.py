"""The scans of a drive that was recorded in a CSV file, as those of a bag: each with the odometry at its time."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fg_mujoco.addons.ros.bag_reader import Delivery
from fg_mujoco.errors import SettingsError
from fg_mujoco.messages import CarParameters, LaserScan, Odometry

from .drive_recording import RecordedDrive

_RANGE_MIN, _RANGE_MAX = 0.02, 30.0
"""[m] of a UST-10LX (source: Hokuyo, UST-10LX specification): CSV files say nothing of their LiDAR's limits."""

_UNEVEN = 0.01  # of the mean increment, by which one of a LaserScan may differ


def deliveries(drive: RecordedDrive, car: CarParameters) -> Iterator[Delivery]:
    """Yield the scans of a drive, each with the odometry then; SettingsError: no beams, or at uneven bearings."""
    if drive.beams is None:
        raise SettingsError(f"{drive.name}: has no beams; accepted: a drive with a LiDAR's, by `beams` of the columns")
    bearings, steps = drive.beams.bearings, np.diff(drive.beams.bearings)
    if len(steps) == 0 or np.ptp(steps) > _UNEVEN * float(steps.mean()):
        raise SettingsError(f"{drive.name}: {len(bearings)} beams at uneven bearings; accepted: at even ones")
    inside = (drive.beams.time >= drive.start) & (drive.beams.time <= drive.end)
    times = drive.beams.time[inside]
    rows = drive.rows_at(times)
    for place, (time, ranges) in enumerate(zip(times.tolist(), drive.beams.ranges[inside], strict=True)):
        speed, yaw_rate, at = float(rows.speed[place]), float(rows.yaw_rate[place]), round(1e9 * time)
        scan = LaserScan(
            stamp=time, angle_min=float(bearings[0]), angle_max=float(bearings[-1]),
            angle_increment=float(steps.mean()), range_min=_RANGE_MIN, range_max=_RANGE_MAX, ranges=ranges,
        )  # fmt: skip
        sideways = (0.0, 0.0) if rows.acceleration is None else rows.acceleration[place].tolist()
        odometry = Odometry(
            stamp=time, speed=speed, steering_angle=float(rows.steering[place]),
            angular_velocity=np.array((0.0, 0.0, yaw_rate)), linear_acceleration=np.array((*sideways, car.gravity)),
            wheel_speeds=np.full(4, speed),
            pose=np.full(3, np.nan) if rows.pose is None else rows.pose[place],
        )  # fmt: skip
        yield Delivery(received=at, measured=at, scan=scan, odometry=odometry)
