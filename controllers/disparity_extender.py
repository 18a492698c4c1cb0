"""The disparity extender: the furthest point that the car, as wide as it is, can reach.

1. Disparities: neighbouring readings that differ by more than a threshold are the edge of something.
2. Each edge is extended to its farther side by half the car's width and a tolerance, at the nearer of its two ranges; a
   closer reading is never overwritten with a farther one. What is left is what a point could reach.
3. The goal is the furthest of these readings within 90 degrees to either side.
4. No turning into what is at the car's side: a reading beyond 90 degrees on the side of the goal, nearer than
   `side_distance`, and the car goes straight on instead. The readings are those of the LiDAR, before any extension. A
   scan of 180 degrees or less shows nothing there, and the rule does not apply.
5. The speed is by the distance straight ahead.

Source: N. Otterness, The "Disparity Extender" Algorithm, and F1/Tenth, 2019; the F1TENTH course slides on reactive
methods. Refined:

- An edge is extended to both of its sides, by the same length of arc: its nearer side may be round.
- Of several furthest readings it takes the middle one: the first is the right edge of an opening.
- The car steers along an arc towards its goal, shorter when slow: by its bearing a fast car swerves from edge to edge.

Limits: a goal one beam past an edge is as good as any other, so the tolerance is all the room that is left at a
corner, and a smooth corner, which has no disparity, is not extended at all. The planner takes the longer of two ways,
wherever that leads. Going straight on because of its side, it may come to stand before a wall.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fg_mujoco.messages import FloatArray

from .control.driving import DrivingSettings
from .control.planner import GoalPlanner
from .control.planner_settings import FROM_ZERO, Record, setting, setting_of_car
from .perception.gaps import disparities, furthest_beam
from .perception.scan_filters import IntermediateScans, bubble_beams, extend_disparities, greatest_beam
from .perception.scan_geometry import beams_between, bearing_of

_ABEAM = 0.5 * math.pi  # [rad] goals are ahead of it, and the car's side behind


@dataclass(frozen=True, kw_only=True)
class DisparityExtenderSettings(DrivingSettings):
    """Parameters of the extension and of the side's rule."""

    pursuit_time: float = setting(
        0.45, "s", "the arc's point is at least the way of this time ahead, or the car swerves from edge to edge",
        FROM_ZERO,
    )  # fmt: skip
    disparity_threshold: float = setting(0.3, "m", "between neighbouring readings, for an edge", FROM_ZERO)
    tolerance: float = setting(0.15, "m", "to the side of the car, past a disparity", FROM_ZERO)
    side_distance: float = setting_of_car(0.2, "m", "from the LiDAR: half the car's width, and 45 mm", FROM_ZERO)


def cover_farther(ranges: FloatArray, angle_increment: float, threshold: float, radius: float) -> FloatArray:
    """Return ranges with every edge extended by `radius` [m] to its farther side only, as the source has it."""
    result, widths = ranges.copy(), bubble_beams(ranges, radius, angle_increment)
    for beam in disparities(ranges, 0, len(ranges), threshold).tolist():
        if ranges[beam + 1] > ranges[beam]:
            covered, near = result[beam + 1 : beam + 1 + widths[beam]], ranges[beam]
        else:
            covered, near = result[max(beam + 1 - widths[beam + 1], 0) : beam + 1], ranges[beam + 1]
        np.minimum(covered, near, out=covered)
    return result


def is_too_close(geometry: Record, ranges: FloatArray, side: float, limit: float) -> bool:
    """Return whether a reading beyond 90 degrees on a side (positive: left) is nearer than `limit` [m]."""
    right, left = beams_between(geometry, len(ranges), -_ABEAM, _ABEAM)
    first, end = (left, len(ranges)) if side > 0.0 else (0, right)
    return bool(np.min(ranges[first:end], initial=math.inf) < limit)


class DisparityExtender(GoalPlanner):
    """Otterness' planner. Where there is no way, or nothing to see, it brakes and keeps its steering angle."""

    Settings = DisparityExtenderSettings
    source_laws = ("distance_ahead",)

    @staticmethod
    def goal(
        geometry: Record, ranges: FloatArray, car: Record, settings: DisparityExtenderSettings, debug: IntermediateScans
    ) -> tuple[float, float]:
        """Return the goal's bearing [rad] and distance [m]; NaN where nothing is reachable."""
        radius = 0.5 * car.width + settings.tolerance
        source, threshold = settings.method == "source", settings.disparity_threshold
        if source:
            reachable = cover_farther(ranges, geometry.angle_increment, threshold, radius)
        else:
            reachable = extend_disparities(ranges, geometry.angle_increment, threshold, radius)
        debug.extended[:] = debug.filtered[:] = reachable
        first, end = beams_between(geometry, len(ranges), -_ABEAM, _ABEAM)
        goal = furthest_beam(reachable, first, end)
        if source and goal >= 0:
            goal = first + greatest_beam(reachable[first:end])
        if goal < 0 or reachable[goal] <= 0.0:
            return math.nan, 0.0
        bearing = bearing_of(geometry, goal)
        if bearing != 0.0 and is_too_close(geometry, ranges, bearing, settings.side_distance):
            bearing = 0.0
        return bearing, reachable[goal]
