"""Follow the gap, as the F1TENTH course teaches it: away from the nearest point, towards the furthest.

0. Preprocess: only the field of view, and no reading beyond the lookahead (the course's lab: "reject high values,
   e.g. > 3 m"). The lab's mean over a window is left out: nothing here needs it.
1. Find the nearest point and put a safety bubble round it.
2. Set what is inside the bubble to 0; all else is free space.
3. The longest run of non-zeros is the gap (gaps.longest_run).
4. Drive to the best `point` in it:
   - furthest: the naive choice, and the one that the slides end with. Of several as far, as all are beyond the
     lookahead, the middle of their longest run;
   - middle: of the gap;
   - deepest: the same as furthest, of the readings that are at most `depth_tolerance` short of it (gaps.deepest_run).

Sources: the F1TENTH course slides on reactive methods and the notes of the field on obstacle masking. They mean two
things by a `bubble`, and their examples agree with one each:

- beams (the notes): all beams that pass within its radius, however far they go. It is as wide as the arc says
  (scan_filters.mask_nearest), which near by is more than the notes' atan(radius / distance); it ends at the ends of the
  scan, where an index below 0 would wrap round, and it leaves what it is given as it is;
- points (the slides): all readings that end within its radius; past its rim and beyond there is free space.

Limits: it knows one obstacle, the nearest. The gap's far side, and the inner corner that it turns round, get no bubble
until they are nearer than all else: the lookahead and the bubble have to make up for the car's width. Without the
first (30 m) `furthest` aims along the inner wall, and its laps are half as long again. `middle` goes where much is
open, not where the road goes on: as slow, and it comes to stand in `l_corridor`. The longest run may be the way back: a
U-turn. It has no memory; in a dead end it stops, backs out (backing_out) and comes again.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.errors import SettingsError
from fg_mujoco.kernels import kernel
from fg_mujoco.messages import FloatArray, LaserScan, require

from .control.compiled_planner import CompiledPlanner
from .control.driving import DrivingSettings, brake, drive_to
from .control.records import Record
from .perception.gaps import chord, deepest_run, longest_run, middle_of, range_at
from .perception.scan_filters import clip_to_lookahead, mask_nearest, valid_ranges
from .perception.scan_geometry import beams_between, bearing_of, sees

_MIDDLE, _DEEPEST = 1, 2  # places of the words of `point`
_POINTS = 1  # and of the word of `bubble`


@dataclass(frozen=True, kw_only=True)
class FollowTheGapSettings(DrivingSettings):
    """Parameters of the steps; the lookahead clips the ranges too.

    Raises:
      SettingsError: an unknown point or bubble; a radius or field of view that is not positive; a negative tolerance.
    """

    point: Literal["furthest", "middle", "deepest"] = "furthest"
    bubble: Literal["beams", "points"] = "beams"
    bubble_radius: float = 0.4  # [m] the middle of the notes' 0.3 to 0.5
    lookahead: float = 3.0  # [m]
    field_of_view: float = math.pi  # [rad]
    depth_tolerance: float = 0.5  # [m]

    def __post_init__(self) -> None:
        super().__post_init__()
        positive = ("bubble_radius", "field_of_view")
        require(self, lambda value: 0.0 < value < math.inf, "a positive number", positive, SettingsError)
        from_zero = ("depth_tolerance",)
        require(self, lambda value: 0.0 <= value < math.inf, "a number from 0", from_zero, SettingsError)


@kernel
def mask_points(ranges: FloatArray, angle_increment: float, radius: float) -> FloatArray:
    """Return ranges (n,) [m] with all readings that end within `radius` [m] of the nearest point set to 0."""
    result = ranges.copy()
    if len(ranges) > 0:
        nearest = np.argmin(ranges)
        for beam in range(len(ranges)):
            if chord(ranges[nearest], ranges[beam], abs(beam - nearest) * angle_increment) <= radius:
                result[beam] = 0.0
    return result


@kernel
def free_space(ranges: FloatArray, angle_increment: float, settings: Record) -> FloatArray:
    """Return ranges (n,) [m] after steps 1 and 2: 0 is what is not free."""
    if settings.bubble == _POINTS:
        return mask_points(ranges, angle_increment, settings.bubble_radius)
    return mask_nearest(ranges, angle_increment, settings.bubble_radius)


@kernel
def best_place(free: FloatArray, settings: Record) -> float:
    """Return the place of the best point, in beams, by steps 3 and 4; NaN where nothing is free."""
    first, end = longest_run(free)
    if first == end:
        return math.nan
    if settings.point != _MIDDLE:
        tolerance = settings.depth_tolerance if settings.point == _DEEPEST else 0.0
        first, end = deepest_run(free, first, end, tolerance)
    return middle_of(first, end)


@kernel
def find_goal(scan: Record, ranges: FloatArray, settings: Record) -> tuple[float, float]:
    """Return the goal's bearing [rad] and distance [m] for clipped ranges (n,) [m]; NaN where there is none."""
    half = 0.5 * settings.field_of_view
    first, end = beams_between(scan, len(ranges), -half, half)
    free = free_space(ranges[first:end], scan.angle_increment, settings)
    place = best_place(free, settings)
    if math.isnan(place):
        return math.nan, 0.0
    return bearing_of(scan, first + place), range_at(free, place)


@kernel
def decide(
    scan: Record, ranges: FloatArray, odometry: Record, planner: Record, memory: Record, paths: NDArray[np.void]
) -> tuple[float, float]:
    """Return the command for one scan: steering angle [rad] and speed [m/s]. Types as in `driving`."""
    valid = valid_ranges(ranges, scan.range_max)
    if not sees(scan, valid):
        return brake(scan, odometry, planner.driver, memory.driving)
    clipped = clip_to_lookahead(valid, planner.settings.lookahead)
    bearing, distance = find_goal(scan, clipped, planner.settings)
    return drive_to(scan, valid, clipped, odometry, planner, memory.driving, paths, bearing, distance)


class FollowTheGap(CompiledPlanner):
    """The planner of the course. Where nothing is free it brakes and keeps the wheels as they are."""

    Settings = FollowTheGapSettings
    decide = staticmethod(decide)

    def find_goal(self, scan: LaserScan) -> tuple[float, float] | None:
        """Return the goal's bearing [rad] and distance [m]; None where nothing is free."""
        lookahead = self.settings.lookahead
        return self._goal_by(
            lambda row, valid, own: find_goal(row, clip_to_lookahead(valid, lookahead), own["settings"]), scan
        )
