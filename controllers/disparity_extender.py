"""The disparity extender: the furthest point that the car, as wide as it is, can reach.

1. Disparities: neighbouring readings that differ by more than a threshold are the edge of something.
2. Each edge is extended by half the car's width and a tolerance, at the nearer of its two ranges; a closer reading is
   never overwritten with a farther one (scan_filters.extend_disparities). What is left is what a point could reach.
3. The goal is the furthest of these readings within 90 degrees to either side; of several as far, the middle one.
4. No turning into what is beside the car: a reading beyond 90 degrees on the side to which it would steer, nearer than
   `side_distance`, and it goes straight on instead. The readings are those of the LiDAR, before any extension; what a
   scan does not show (one of 180 degrees or less) does not hold it back.
5. The speed is by the distance straight ahead in the source; here it is that of the planner's speed law.

Source: N. Otterness, The "Disparity Extender" Algorithm, and F1/Tenth, 2019; the F1TENTH course slides on reactive
methods. Where this differs: an edge is extended to both of its sides, by the same length of arc, as the farther side is
the only one with anything to shorten but for round things; the car steers along an arc towards its goal, shorter when
slow, not in proportion to the goal's bearing. The side's rule is read as "the side to which the goal lies".

Limits: a goal one beam beside an edge is as good as any other, so the tolerance is all the way that it leaves at a
corner, and a smooth corner, which has no disparity, is extended by nothing. It takes the longer of two ways, wherever
that leads. Going straight on because of its side it may come to stand before a wall.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.errors import SettingsError
from fg_mujoco.kernels import kernel
from fg_mujoco.messages import FloatArray, LaserScan, require

from .control.compiled_planner import CompiledPlanner
from .control.driving import DrivingSettings, brake, drive, speed_towards
from .control.records import Record
from .control.steering import pursue
from .perception.gaps import furthest_beam
from .perception.scan_filters import extend_disparities, valid_ranges
from .perception.scan_geometry import beams_between, bearing_of, sees

_ABEAM = 0.5 * math.pi  # [rad] goals are ahead of it, and the car's side behind


@dataclass(frozen=True, kw_only=True)
class DisparityExtenderSettings(DrivingSettings):
    """Parameters of the extension and of the side's rule.

    Raises:
      SettingsError: a length or time that is negative or not finite.
    """

    pursuit_distance: float = 1.0  # [m] where it is slow
    pursuit_time: float = 0.45  # [s] where it is fast: the way of this time, or it swerves from edge to edge
    disparity_threshold: float = 0.3  # [m]
    tolerance: float = 0.15  # [m] beside the car, past a disparity
    side_distance: float = 0.2  # [m] from the LiDAR: half the car's width, and a hand

    def __post_init__(self) -> None:
        super().__post_init__()
        from_zero = ("disparity_threshold", "tolerance", "side_distance", "pursuit_time")
        require(self, lambda value: 0.0 <= value < math.inf, "a number from 0", from_zero, SettingsError)


@kernel
def reachable(scan: Record, valid: FloatArray, planner: Record) -> FloatArray:
    """Return how far a point could go along each beam (n,) [m], for readings `valid` (n,) [m]."""
    radius = 0.5 * planner.driver.car.width + planner.settings.tolerance
    return extend_disparities(valid, scan.angle_increment, planner.settings.disparity_threshold, radius)


@kernel
def find_goal(scan: Record, ranges: FloatArray) -> tuple[float, float]:
    """Return the bearing [rad] and distance [m] of the furthest of what is reachable; NaN where nothing is."""
    first, end = beams_between(scan, len(ranges), -_ABEAM, _ABEAM)
    goal = furthest_beam(ranges, first, end)
    if goal < 0 or ranges[goal] <= 0.0:
        return math.nan, 0.0
    return bearing_of(scan, goal), ranges[goal]


@kernel
def is_too_close(scan: Record, valid: FloatArray, side: float, limit: float) -> bool:
    """Return whether a reading beyond 90 degrees on a side (positive: left) is nearer than `limit` [m]."""
    right, left = beams_between(scan, len(valid), -_ABEAM, _ABEAM)
    first, end = (left, len(valid)) if side > 0.0 else (0, right)
    nearest = math.inf
    for beam in range(first, end):
        nearest = min(nearest, valid[beam])
    return nearest < limit


@kernel
def decide(
    scan: Record, ranges: FloatArray, odometry: Record, planner: Record, memory: Record, paths: NDArray[np.void]
) -> tuple[float, float]:
    """Return the command for one scan: steering angle [rad] and speed [m/s]. Types as in `driving`."""
    driver, settings = planner.driver, planner.settings
    valid = valid_ranges(ranges, scan.range_max)
    if not sees(scan, valid):
        return brake(scan, odometry, driver, memory.driving)
    shaped = reachable(scan, valid, planner)
    bearing, distance = find_goal(scan, shaped)
    if math.isnan(bearing):
        return brake(scan, odometry, driver, memory.driving)
    if bearing != 0.0 and is_too_close(scan, valid, bearing, settings.side_distance):
        bearing = 0.0
    reach = min(distance, max(settings.pursuit_distance, settings.pursuit_time * odometry.speed))
    steering_angle = pursue(bearing, reach, driver.car.lidar_offset, driver.car.wheelbase)
    speed = speed_towards(scan, valid, shaped, planner, bearing)
    return drive(scan, valid, odometry, driver, memory.driving, paths, steering_angle, speed)


class DisparityExtender(CompiledPlanner):
    """Otterness' planner. Where there is no way, or nothing to see, it brakes and keeps the wheels as they are."""

    Settings = DisparityExtenderSettings
    decide = staticmethod(decide)

    def find_goal(self, scan: LaserScan) -> tuple[float, float] | None:
        """Return the goal's bearing [rad] and distance [m], whatever is beside the car; None where there is none."""
        return self._goal_by(lambda row, valid, own: find_goal(row, reachable(row, valid, own)), scan)
