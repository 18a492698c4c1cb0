"""The last step of a planner: the steering angle and the speed that it wishes for, made safe for a real car.

The car stops within what it sees (stopping_paths), and its tires hold what is commanded (friction_guard). A planner
that believes in no friction limit, mu = inf, gets what it wishes for.
"""

from __future__ import annotations

import math
from dataclasses import astuple
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.kernels import kernel
from fg_mujoco.messages import CarParameters, FloatArray, LaserScan, ScanGeometry

from .friction_guard import GUARD, FrictionGuard, guarded
from .records import CAR, Record
from .scan_filters import widen_all
from .steering import saturate
from .stopping_paths import safe_speed

_PERIOD = 0.025  # [s] of the field's LiDARs, for scans that do not tell theirs

SCAN = np.dtype([(name, np.float64) for name in ("angle_min", "angle_increment", "range_max", "scan_time")])
"""What a kernel is told of the geometry of the scans; units as in LaserScan."""

DRIVER = np.dtype(
    [
        ("car", CAR),
        ("max_speed", np.float64),  # [m/s]
        ("limited", np.bool_),  # whether the planner believes in a friction limit; without one the rest is not used
        ("guard", GUARD),
        ("paths", np.int64),  # which table of stopping paths is its own
    ]
)
"""What these kernels are told of a planner."""

scan_values = attrgetter(*SCAN.names or ())
"""Takes the values of a SCAN from a LaserScan or a ScanGeometry."""


def scan_record(scan: LaserScan | ScanGeometry) -> NDArray[np.void]:
    """Return a row of type SCAN, shape (1,)."""
    return np.array([scan_values(scan)], SCAN)


def driver_record(car: CarParameters, max_speed: float, guard: FrictionGuard | None) -> NDArray[np.void]:
    """Return a row of type DRIVER, shape (1,); without a guard, of a planner that believes in no friction limit."""
    row = np.zeros(1, DRIVER)
    row["car"], row["max_speed"] = astuple(car), max_speed
    if guard is not None:
        row["limited"], row["guard"] = True, guard.record
    return row


@kernel
def drive(
    scan: Record,
    valid: FloatArray,
    odometry: Record,
    driver: Record,
    memory: Record,
    paths: NDArray[np.void],
    steering_angle: float,
    speed: float,
) -> tuple[float, float]:
    """Return the command for a wish: steering angle [rad] and speed [m/s]; without odometry, 0 and 0.

    Args:
      scan: of type SCAN.
      valid: its readings (n,) [m], without NaN or inf.
      odometry: of type ODOMETRY.
      driver: of type DRIVER.
      memory: of the planner's guard, of type GUARD_MEMORY, written to.
      paths: tables of type PATHS; `driver.paths` is the place of the planner's own.
      steering_angle: wished [rad].
      speed: wished [m/s].
    """
    if not math.isfinite(odometry.speed + odometry.steering_angle):
        return brake(scan, odometry, driver, memory)
    if not driver.limited:
        return saturate(steering_angle, driver.car.max_steering_angle), speed
    table = paths[driver.paths]
    widened = widen_all(valid, scan.angle_increment, table.radius)
    in_sight = safe_speed(table, widened, scan.angle_min, scan.angle_increment, odometry.speed, odometry.steering_angle)
    return _hold(scan, odometry, driver, memory, steering_angle, min(speed, in_sight))


@kernel
def brake(scan: Record, odometry: Record, driver: Record, memory: Record) -> tuple[float, float]:
    """Return the command to stop as hard as the tires hold, the wheels kept as they are; arguments as in `drive`.

    Without a friction limit, and without odometry, that is 0 and 0.
    """
    if not driver.limited:
        return 0.0, 0.0
    return _hold(scan, odometry, driver, memory, odometry.steering_angle, 0.0)


@kernel
def _hold(
    scan: Record, odometry: Record, driver: Record, memory: Record, steering_angle: float, speed: float
) -> tuple[float, float]:
    period = scan.scan_time if scan.scan_time > 0.0 else _PERIOD
    return guarded(driver.guard, memory, steering_angle, speed, odometry.steering_angle, odometry.speed, period)
