"""Weighted gap: the nearer the nearest obstacle is, the more the gap's bearing counts.

"If you are 3-4 m away from your closest obstacle, should you immediately make a sharp turn to avoid it?" (the F1TENTH
course slides on reactive methods.) Sezer and Gokasan's follow the gap method says how sharp:

1. All obstacles are enlarged by the robot's radius: half the car's width and a clearance (scan_filters.widen_all).
2. An obstacle is what is nearer than the `horizon`; the widest angle without one is the gap.
3. Its centre is the middle of the line between the two obstacles at its ends, d1 away at phi1 and d2 at phi2:

       phi_gap = arccos((d1 + d2 cos(phi1 + phi2)) / sqrt(d1^2 + d2^2 + 2 d1 d2 cos(phi1 + phi2))) - phi1

   which is the direction of the sum of the two vectors, and is computed as that: it has no quotient of 0 by 0.
4. The heading is the mean of the gap's and of straight ahead, weighted by the nearest obstacle of all, at d_min:
   phi = (alpha / d_min phi_gap) / (alpha / d_min + 1). At d_min = alpha both weigh the same.

Source: V. Sezer and M. Gokasan, A novel obstacle avoidance algorithm: "Follow the Gap Method", Robotics and
Autonomous Systems 60(9), 2012. Differences: their obstacles are circles, and all that are seen count; these are
readings, with walls all round, so there is a horizon. Where the gap reaches the edge of the field of view, an
obstacle is assumed there at the horizon. d_min is measured from the LiDAR. Refined: the car steers along an arc to a
point `pursuit_distance` along the heading, as `gap_finder` does.

Limits: between walls d_min is hardly more than half the road's width, so the weight hardly changes, and what is left
is a threshold gap that steers less than it should. The median leans to the farther of the two obstacles, in a corner
to the inner edge's horizon or to the outer wall. Without a gap the car brakes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from fg_mujoco.messages import FloatArray

from .control.driving import DrivingSettings
from .control.planner import GoalPlanner
from .control.planner_settings import FROM_ZERO, POSITIVE, Accepted, Record, setting
from .perception.gaps import runs_beyond
from .perception.scan_filters import IntermediateScans, widen_all, write_debug_run
from .perception.scan_geometry import beams_between, bearing_of


@dataclass(frozen=True, kw_only=True)
class WeightedGapSettings(DrivingSettings):
    """Parameters of the method. The middle of a gap wider than half a turn would lie behind the car."""

    alpha: float = setting(2.0, "m", "of the nearest obstacle, at which the gap weighs as much as the goal", POSITIVE)
    horizon: float = setting(2.75, "m", "nearer readings are obstacles", POSITIVE)
    clearance: float = setting(0.05, "m", "to the side of the car", FROM_ZERO)
    field_of_view: float = setting(
        math.pi, "rad", "in which gaps are searched",
        Accepted("a number above 0, at most pi", lambda value: 0.0 < value <= math.pi),
    )  # fmt: skip


def gap_centre(right: float, right_distance: float, left: float, left_distance: float) -> float:
    """Return the bearing [rad] of the middle between two obstacles, by their bearings [rad] and distances [m]."""
    x = right_distance * math.cos(right) + left_distance * math.cos(left)
    y = right_distance * math.sin(right) + left_distance * math.sin(left)
    return math.atan2(y, x)


def blended(gap: float, goal: float, nearest: float, alpha: float) -> float:
    """Return the heading [rad] between those of gap and goal [rad]; `nearest` is d_min [m], `alpha` is in [m].

    Both weights are multiplied by d_min, so that it may be 0: then the gap alone counts.
    """
    return (alpha * gap + nearest * goal) / (alpha + nearest)


class WeightedGap(GoalPlanner):
    """The follow the gap method. Without a gap it brakes and keeps its steering angle."""

    Settings = WeightedGapSettings
    source_laws = ("distance_ahead",)

    @staticmethod
    def goal(
        geometry: Record, ranges: FloatArray, car: Record, settings: WeightedGapSettings, debug: IntermediateScans
    ) -> tuple[float, float]:
        """Return the heading [rad] and how far along it the goal lies [m]; NaN without a gap."""
        extended = widen_all(ranges, geometry.angle_increment, 0.5 * car.width + settings.clearance)
        debug.extended[:] = extended
        half = 0.5 * settings.field_of_view
        first, end = beams_between(geometry, len(ranges), -half, half)
        seen = extended[first:end]
        gaps = runs_beyond(seen, min(settings.horizon, 0.999 * geometry.range_max), 1)
        if len(gaps) == 0:
            return math.nan, 0.0
        gap_first, gap_end = max(gaps.tolist(), key=lambda gap: gap[1] - gap[0])
        write_debug_run(debug.gap, extended, first + gap_first, first + gap_end)
        right, left = max(gap_first - 1, 0), min(gap_end, len(seen) - 1)
        right_distance, left_distance = min(seen[right], settings.horizon), min(seen[left], settings.horizon)
        right_bearing, left_bearing = bearing_of(geometry, first + right), bearing_of(geometry, first + left)
        centre = gap_centre(right_bearing, right_distance, left_bearing, left_distance)
        return blended(centre, 0.0, seen.min(), settings.alpha), settings.pursuit_distance
