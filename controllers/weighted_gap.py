"""Weighted gap: the gap's bearing counts the more, the nearer the nearest obstacle is.

"If you are 3-4 m away from your closest obstacle, should you immediately make a sharp turn to avoid it?" (the F1TENTH
course slides on reactive methods.) Sezer and Gokasan's follow the gap method says how sharp:

1. The robot is a point, and all obstacles are enlarged by its radius: half the car's width and a clearance
   (scan_filters.widen_all).
2. An obstacle is what is nearer than the `horizon`; the widest angle without one is the gap.
3. Its centre is the middle of the line between the two obstacles beside it, d1 away at phi1 to the one side and d2 at
   phi2 to the other (with d3 the median, by Apollonius' theorem):

       phi_gap = arccos((d1 + d2 cos(phi1 + phi2)) / sqrt(d1^2 + d2^2 + 2 d1 d2 cos(phi1 + phi2))) - phi1

   which is the direction of the sum of the two vectors, and is worked out as that: it has no quotient of 0 by 0.
4. The heading is the mean of the gap's and the goal's, weighted by the nearest obstacle of all, at d_min:

       phi = (alpha / d_min phi_gap + phi_goal) / (alpha / d_min + 1)

   The goal is straight ahead, phi_goal = 0: there is none but to go on. At d_min = alpha both weigh the same.

Source: V. Sezer and M. Gokasan, A novel obstacle avoidance algorithm: "Follow the Gap Method", Robotics and Autonomous
Systems 60(9), 2012. Where this differs: their obstacles are circles, and all that are seen count, these are readings,
and walls are all round, so there is a horizon; where the gap reaches the edge of the field of view, an
obstacle is taken to stand there at the horizon; d_min is measured from the LiDAR. They steer to the heading, here the
car drives the arc to a point `pursuit_distance` along it.

Limits: between walls d_min is hardly more than half the road's width, so the weight hardly changes, and what is left is
a threshold gap that steers less than it should. The median leans to the farther of the two obstacles, in a corner
to the inner edge's horizon or to the outer wall: at 2.25 m the car is lost in the square one. With nothing beyond the
horizon there is no gap, and it brakes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.errors import SettingsError
from fg_mujoco.kernels import kernel
from fg_mujoco.messages import FloatArray, LaserScan, require

from .compiled_planner import CompiledPlanner
from .driving import DrivingSettings, brake, drive_to
from .gaps import runs_beyond
from .records import Record
from .scan_filters import valid_ranges, widen_all
from .scan_geometry import beams_between, bearing_of, sees


@dataclass(frozen=True, kw_only=True)
class WeightedGapSettings(DrivingSettings):
    """Parameters of the method.

    Raises:
      SettingsError: an alpha or a horizon that is not positive; a negative clearance; a field of view that is not
        positive or more than half a turn, as the middle of a wider gap's ends lies behind.
    """

    alpha: float = 2.0  # [m] of the nearest obstacle, at which the gap weighs as much as the goal
    horizon: float = 2.75  # [m]
    clearance: float = 0.05  # [m] beside the car
    field_of_view: float = math.pi  # [rad]

    def __post_init__(self) -> None:
        super().__post_init__()
        positive = ("alpha", "horizon")
        require(self, lambda value: 0.0 < value < math.inf, "a positive number", positive, SettingsError)
        require(self, lambda value: 0.0 <= value < math.inf, "a number from 0", ("clearance",), SettingsError)
        accepted = "a number above 0, at most pi"
        require(self, lambda value: 0.0 < value <= math.pi, accepted, ("field_of_view",), SettingsError)


@kernel
def gap_centre(right: float, right_distance: float, left: float, left_distance: float) -> float:
    """Return the bearing [rad] of the middle between two obstacles, by their bearings [rad] and distances [m]."""
    x = right_distance * math.cos(right) + left_distance * math.cos(left)
    y = right_distance * math.sin(right) + left_distance * math.sin(left)
    return math.atan2(y, x)


@kernel
def blended(gap: float, goal: float, nearest: float, alpha: float) -> float:
    """Return the heading [rad] between those of gap and goal [rad]; `nearest` is d_min [m], `alpha` is in [m].

    Both weights are taken times d_min, so that it may be 0: then the gap alone counts.
    """
    return (alpha * gap + nearest * goal) / (alpha + nearest)


@kernel
def find_gap(scan: Record, widened: FloatArray, settings: Record) -> tuple[float, float]:
    """Return the bearing of the gap's centre [rad] and d_min [m] for widened ranges (n,); NaN where there is none."""
    half = 0.5 * settings.field_of_view
    first, end = beams_between(scan, len(widened), -half, half)
    seen = widened[first:end]
    gaps = runs_beyond(seen, min(settings.horizon, 0.999 * scan.range_max), 1)
    if len(gaps) == 0:
        return math.nan, 0.0
    widest = 0
    for gap in range(1, len(gaps)):
        if gaps[gap, 1] - gaps[gap, 0] > gaps[widest, 1] - gaps[widest, 0]:
            widest = gap
    right, left = max(gaps[widest, 0] - 1, 0), min(gaps[widest, 1], len(seen) - 1)
    right_distance, left_distance = min(seen[right], settings.horizon), min(seen[left], settings.horizon)
    centre = gap_centre(bearing_of(scan, first + right), right_distance, bearing_of(scan, first + left), left_distance)
    nearest = math.inf
    for distance in seen:
        if distance < nearest:
            nearest = distance
    return centre, nearest


@kernel
def find_heading(scan: Record, widened: FloatArray, settings: Record) -> float:
    """Return the heading [rad] for widened ranges (n,) [m]; NaN where there is no gap."""
    gap, nearest = find_gap(scan, widened, settings)
    return blended(gap, 0.0, nearest, settings.alpha)


@kernel
def decide(
    scan: Record, ranges: FloatArray, odometry: Record, planner: Record, memory: Record, paths: NDArray[np.void]
) -> tuple[float, float]:
    """Return the command for one scan: steering angle [rad] and speed [m/s]. Types as in `driving`."""
    valid = valid_ranges(ranges, scan.range_max)
    if not sees(scan, valid):
        return brake(scan, odometry, planner.driver, memory.driving)
    radius = 0.5 * planner.driver.car.width + planner.settings.clearance
    heading = find_heading(scan, widen_all(valid, scan.angle_increment, radius), planner.settings)
    distance = planner.settings.pursuit_distance
    return drive_to(scan, valid, valid, odometry, planner, memory.driving, paths, heading, distance)


class WeightedGap(CompiledPlanner):
    """The follow the gap method. Without a gap it brakes and keeps the wheels as they are."""

    Settings = WeightedGapSettings
    decide = staticmethod(decide)

    def find_goal(self, scan: LaserScan) -> tuple[float, float] | None:
        """Return the heading [rad] and how far along it the goal lies [m]; None without a gap."""
        radius = 0.5 * self.record[0]["driver"]["car"]["width"] + self.settings.clearance

        def find(row: Record, valid: FloatArray, own: Record) -> tuple[float, float]:
            widened = widen_all(valid, scan.angle_increment, radius)
            return find_heading(row, widened, own["settings"]), self.settings.pursuit_distance

        return self._goal_by(find, scan)
