"""The widest gap: the centre of the widest jump between neighbouring readings, on the map too.

1. Within 45 degrees to either side, neighbouring readings a and b that differ by more than half a metre are a gap.
2. Its width is the distance of the two points, by the cosine law: sqrt(a^2 + b^2 - 2 a b cos t), t the angle between
   neighbouring beams (gaps.chord). The widest gap is taken; of several as wide, the rightmost.
3. The centre is the middle of the two points, C = (A + B) / 2.
4. The car heads for C, turned aside so far that it goes past the nearer of the two points at `passing_distance`, on the
   side where it is open. The source does not say how to drive to C. With 0 it is C itself.
5. Where no gap is seen (a smooth corridor has no jump) it heads for the furthest reading within 45 degrees, of several
   as far the middle one. The source does not say that either; its class answers a width of -1 there.

The source leaves a question open: where C is on the map, "simply C + X_car", if X_car were known. X_car is what a
localisation answers (here Odometry.pose: x, y and heading of base_link in the map frame), and the sum is not enough: C
is seen from the LiDAR, which sits `lidar_offset` ahead of base_link, in a frame that is turned with the car. So

    C_map = R(heading) (C + (lidar_offset, 0)) + (x, y)

and a car that drives past a gap at heading 90 degrees has it at its side on the map, where the sum would have it ahead.

Source: the code and notes of the field's gap finder in C++. Its faults, put right here: it compares the squared width
of a pair with the unsquared width of the widest, so that a narrower one may win; the centre is that of the last pair
that jumps, not of the widest, as a and b are overwritten by every one; and it reads range[i + 1] for every i of a loop
that is written for 1080 beams, whatever comes: here a beam has a neighbour only if the scan has one. No return is a
reading at range_max, not inf, whose jump would be wider than any other, and its centre nowhere.

Limits: with neighbouring beams the width is hardly more than the jump of the range, so the widest gap is where most is
hidden, not where the car fits: a post in the open is two wide gaps. Its centre lies right behind the nearer point, on
the line of sight that grazes it, so a car that drives to C itself meets the corner. Past that point it keeps its
distance; what else stands beside its way it does not consider: with `way_out=false` it crashes in `tight`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.errors import SettingsError
from fg_mujoco.kernels import kernel
from fg_mujoco.messages import FloatArray, LaserScan, Odometry, require

from .control.compiled_planner import CompiledPlanner
from .control.driving import DrivingSettings, brake, drive_to
from .control.records import Record
from .perception.gaps import chord, furthest_beam
from .perception.scan_filters import valid_ranges
from .perception.scan_geometry import beams_between, bearing_of, scan_record, sees


@dataclass(frozen=True, kw_only=True)
class WidestGapSettings(DrivingSettings):
    """Parameters of the gaps.

    Raises:
      SettingsError: a field of view that is not positive; a length that is negative or not finite.
    """

    field_of_view: float = math.radians(90.0)  # [rad]
    least_jump: float = 0.5  # [m]
    pursuit_distance: float = 2.0  # [m]
    passing_distance: float = 0.6  # [m] from the gap's nearer point to the line on which the car goes past it

    def __post_init__(self) -> None:
        super().__post_init__()
        require(self, lambda value: 0.0 < value < math.inf, "a positive number", ("field_of_view",), SettingsError)
        from_zero = ("least_jump", "passing_distance")
        require(self, lambda value: 0.0 <= value < math.inf, "a number from 0", from_zero, SettingsError)


@kernel
def widest_gap(valid: FloatArray, first: int, end: int, angle_increment: float, least_jump: float) -> int:
    """Return the right one of the two beams of the widest gap between `valid[first:end]`; -1 where there is none."""
    widest, place = -1.0, -1
    for beam in range(first, end - 1):
        a, b = valid[beam], valid[beam + 1]
        if abs(b - a) > least_jump:
            width = chord(a, b, angle_increment)
            if width > widest:
                widest, place = width, beam
    return place


@kernel
def find_gap(scan: Record, valid: FloatArray, settings: Record) -> tuple[int, int, int]:
    """Return the right one of the two beams of the widest gap, or -1; and the beams looked at: first, and last + 1."""
    half = 0.5 * settings.field_of_view
    first, end = beams_between(scan, len(valid), -half, half)
    return widest_gap(valid, first, end, scan.angle_increment, settings.least_jump), first, end


@kernel
def centre_of(scan: Record, valid: FloatArray, gap: int) -> tuple[float, float]:
    """Return the middle of the two points of a gap as the LiDAR sees it: x and y [m] in the car's directions."""
    a, b, alpha, beta = valid[gap], valid[gap + 1], bearing_of(scan, gap), bearing_of(scan, gap + 1)
    x = 0.5 * (a * math.cos(alpha) + b * math.cos(beta))
    return x, 0.5 * (a * math.sin(alpha) + b * math.sin(beta))


@kernel
def find_goal(scan: Record, valid: FloatArray, settings: Record) -> tuple[float, float]:
    """Return the bearing [rad] and distance [m] to drive to; NaN where there is none."""
    gap, first, end = find_gap(scan, valid, settings)
    if gap < 0:
        furthest = furthest_beam(valid, first, end)
        if furthest < 0 or valid[furthest] <= 0.0:
            return math.nan, 0.0
        return bearing_of(scan, furthest), valid[furthest]
    x, y = centre_of(scan, valid, gap)
    a, b = valid[gap], valid[gap + 1]
    aside = math.asin(min(settings.passing_distance / max(min(a, b), 1e-9), 1.0))
    return math.atan2(y, x) + math.copysign(aside, b - a), math.hypot(x, y)


@kernel
def decide(
    scan: Record, ranges: FloatArray, odometry: Record, planner: Record, memory: Record, paths: NDArray[np.void]
) -> tuple[float, float]:
    """Return the command for one scan: steering angle [rad] and speed [m/s]. Types as in `driving`."""
    valid = valid_ranges(ranges, scan.range_max)
    if not sees(scan, valid):
        return brake(scan, odometry, planner.driver, memory.driving)
    bearing, distance = find_goal(scan, valid, planner.settings)
    return drive_to(scan, valid, valid, odometry, planner, memory.driving, paths, bearing, distance)


class WidestGap(CompiledPlanner):
    """The planner of the jumps. Where there is nothing to see it brakes and keeps the wheels as they are."""

    Settings = WidestGapSettings
    decide = staticmethod(decide)

    def find_goal(self, scan: LaserScan) -> tuple[float, float] | None:
        """Return the bearing [rad] and distance [m] that it drives to; None where there is none."""
        return self._goal_by(lambda row, valid, own: find_goal(row, valid, own["settings"]), scan)

    def find_centre(self, scan: LaserScan) -> tuple[float, float] | None:
        """Return the centre of the widest gap in the car frame, of base_link: x and y [m]; None without a gap."""
        record, valid = scan_record(scan)[0], valid_ranges(scan.ranges, scan.range_max)
        gap = find_gap(record, valid, self.record[0]["settings"])[0] if sees(record, valid) else -1
        if gap < 0:
            return None
        x, y = centre_of(record, valid, gap)
        return x + float(self.record["driver"]["car"]["lidar_offset"][0]), y

    def goal_in_map(self, scan: LaserScan, odometry: Odometry) -> tuple[float, float] | None:
        """Return the centre of the widest gap in the map frame: x and y [m]; None without a gap or without a pose."""
        centre = self.find_centre(scan)
        x, y, heading = odometry.pose.tolist()
        if centre is None or not math.isfinite(x + y + heading):
            return None
        cos, sin = math.cos(heading), math.sin(heading)
        return x + cos * centre[0] - sin * centre[1], y + sin * centre[0] + cos * centre[1]
