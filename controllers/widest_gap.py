"""The widest gap: the centre of the widest jump between neighbouring readings, on the map too.

1. Within 45 degrees to either side, neighbouring readings a and b that differ by more than half a metre are a gap.
2. Its width is the distance of the two points (gaps.chord). Of several as wide, the rightmost is taken.
3. The centre is the middle of the two points, C = (A + B) / 2, and the car heads for it.
4. Where no gap is seen (a smooth corridor has no jump) the car heads for the furthest reading within 45 degrees, of
   several as far the middle one. The source does not say that; its class answers a width of -1 there.

On the map C is at R(heading) (C + (lidar_offset, 0)) + (x, y), with the pose of Odometry: C is seen from the LiDAR,
in a frame that is turned with the car. The source's sum, "simply C + X_car", leaves out both.

Source: the code and notes of the field's gap finder in C++. Its text and formulas mean the widest pair and its centre.
Its code does not: it compares the squared width of a pair with the unsquared width of the widest, and a, b and alpha
are those of the last pair that jumps. `method=source` is what the text means. Neither says how to drive to C, nor how
fast: without stages the car drives at its greatest speed. Refined:

- The car passes the nearer of the two points at `passing_distance`: C lies right behind it.
- It steers along an arc, as `gap_finder` does.

Limits: with neighbouring beams the width is hardly more than the jump of the range, so the widest gap is where most is
hidden, not where the car fits: a post in the open is two wide gaps. The planner considers nothing else that stands
along its way.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from fg_mujoco.messages import FloatArray, LaserScan, Odometry
from fg_mujoco.native_arrays import views

from .control.driving import DrivingSettings
from .control.planner import GoalPlanner
from .control.planner_settings import FROM_ZERO, POSITIVE, Record, setting, setting_of_car
from .perception.gaps import chord, disparities, furthest_beam
from .perception.scan_filters import IntermediateScans, valid_ranges
from .perception.scan_geometry import beams_between, bearing_of, geometry_record, sees


@dataclass(frozen=True, kw_only=True)
class WidestGapSettings(DrivingSettings):
    """Parameters of the gaps."""

    field_of_view: float = setting(math.radians(90.0), "rad", "in which gaps are searched", POSITIVE)
    least_jump: float = setting(0.5, "m", "between neighbouring readings, for a gap", FROM_ZERO)
    pursuit_distance: float = setting_of_car(
        2.0, "m", "the arc leads through the point this far along the goal's direction", POSITIVE
    )
    passing_distance: float = setting_of_car(
        0.6, "m", "refined: from the gap's nearer point to the line on which the car passes it", FROM_ZERO
    )


def widest_gap(ranges: FloatArray, first: int, end: int, angle_increment: float, least_jump: float) -> int:
    """Return the right one of the two beams of the widest gap between `ranges[first:end]`; -1 where there is none."""
    widest, gap = -1.0, -1
    for beam in disparities(ranges, first, end, least_jump).tolist():
        width = chord(ranges[beam], ranges[beam + 1], angle_increment)
        if width > widest:
            widest, gap = width, beam
    return gap


def find_gap(geometry: Record, ranges: FloatArray, settings: WidestGapSettings) -> tuple[int, int, int]:
    """Return the right one of the two beams of the widest gap, or -1; and the beams looked at: first, and last + 1."""
    half = 0.5 * settings.field_of_view
    first, end = beams_between(geometry, len(ranges), -half, half)
    return widest_gap(ranges, first, end, geometry.angle_increment, settings.least_jump), first, end


def centre_of(geometry: Record, ranges: FloatArray, gap: int) -> tuple[float, float]:
    """Return the middle of the two points of a gap as the LiDAR sees it: x and y [m] in the car's directions."""
    a, b, alpha, beta = ranges[gap], ranges[gap + 1], bearing_of(geometry, gap), bearing_of(geometry, gap + 1)
    x = 0.5 * (a * math.cos(alpha) + b * math.cos(beta))
    return x, 0.5 * (a * math.sin(alpha) + b * math.sin(beta))


class WidestGap(GoalPlanner):
    """The planner of the jumps. Where there is nothing to see it brakes and keeps its steering angle."""

    Settings = WidestGapSettings
    source_laws = ()

    @staticmethod
    def goal(
        geometry: Record, ranges: FloatArray, car: Record, settings: WidestGapSettings, debug: IntermediateScans
    ) -> tuple[float, float]:
        """Return the bearing [rad] and distance [m] to drive to; NaN where there is none."""
        gap, first, end = find_gap(geometry, ranges, settings)
        if gap < 0:
            furthest = furthest_beam(ranges, first, end)
            if furthest < 0 or ranges[furthest] <= 0.0:
                return math.nan, 0.0
            return bearing_of(geometry, furthest), ranges[furthest]
        x, y = centre_of(geometry, ranges, gap)
        if settings.method == "source":
            return math.atan2(y, x), math.hypot(x, y)
        a, b = ranges[gap], ranges[gap + 1]
        aside = math.asin(min(settings.passing_distance / max(min(a, b), 1e-9), 1.0))
        return math.atan2(y, x) + math.copysign(aside, b - a), math.hypot(x, y)

    def find_centre(self, scan: LaserScan) -> tuple[float, float] | None:
        """Return the centre of the widest gap in the car frame, of base_link: x and y [m]; None without a gap."""
        geometry, ranges = views(geometry_record(scan))[0], valid_ranges(scan.ranges, scan.range_max)
        gap = find_gap(geometry, ranges, self.settings)[0] if sees(geometry, ranges) else -1
        if gap < 0:
            return None
        x, y = centre_of(geometry, ranges, gap)
        return x + float(self.driver["car"]["lidar_offset"][0]), y

    def goal_in_map(self, scan: LaserScan, odometry: Odometry) -> tuple[float, float] | None:
        """Return the centre of the widest gap in the map frame: x and y [m]; None without a gap or without a pose."""
        centre = self.find_centre(scan)
        x, y, heading = odometry.pose.tolist()
        if centre is None or not math.isfinite(x + y + heading):
            return None
        cos, sin = math.cos(heading), math.sin(heading)
        return x + cos * centre[0] - sin * centre[1], y + sin * centre[0] + cos * centre[1]
