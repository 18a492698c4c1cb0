"""Follow the gap, as the F1TENTH course teaches it: away from the nearest point, towards the furthest.

1. Find the nearest point and put a safety bubble round it.
2. Set what is inside the bubble to 0; all else is free space.
3. The longest run of non-zeros is the gap (gaps.longest_run).
4. Drive to the best `point` in it: the furthest, the middle of the gap, or the deepest, which is the middle of those
   that are at most `depth_tolerance` short of the furthest.

Sources: the F1TENTH course slides on reactive methods and the notes of the field on obstacle masking. They mean two
things by a `bubble`: in the notes beams, int(atan(radius / distance) / angle_increment) to either side
(scan_filters.mask_bubble), in the slides all readings that end within it. The slides' furthest point is the naive one;
for a better one they ask whether to turn sharply for something 3 to 4 m away, which `weighted_gap` answers. Refined:

- The bubble is as wide as its arc (scan_filters.mask_nearest): near by the arctangent leaves beams that pass within it.
- No reading counts beyond the `lookahead`, as in the course's lab: else `furthest` aims along the inner wall.
- Of several furthest points it is the middle of their longest run: the first would be the right edge of an opening.
- Only the field of view counts: what is furthest behind the car would be a U-turn.
- The car steers along an arc, as `gap_finder` does.

Limits: the planner knows one obstacle, the nearest. The gap's far side, and the inner corner that the car turns round,
get no bubble until they are nearer than all else: the lookahead and the bubble have to make up for the car's width.
`middle` goes where much is open, not where the road goes on. The longest run may be the way back: a U-turn, from which
only guidance keeps the car.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from fg_mujoco.messages import FloatArray

from .control.driving import DrivingSettings
from .control.planner import GoalPlanner
from .control.planner_settings import FROM_ZERO, POSITIVE, Record, setting, setting_of_car, setting_of_method
from .perception.gaps import deepest_run, longest_run, middle_of, range_at
from .perception.scan_filters import (
    IntermediateScans,
    clip_to_lookahead,
    greatest_beam,
    mask_bubble,
    mask_nearest,
    mask_points,
    write_debug_run,
)
from .perception.scan_geometry import beams_between, bearing_of


@dataclass(frozen=True, kw_only=True)
class FollowTheGapSettings(DrivingSettings):
    """Parameters of the steps; the lookahead clips the ranges too."""

    point: Literal["furthest", "middle", "deepest"] = setting("furthest", text="of the gap, that the car drives to")
    bubble: Literal["beams", "points"] = setting("beams", text="what is inside the bubble")
    bubble_radius: float = setting_of_car(0.4, "m", "the middle of the notes' 0.3 to 0.5", POSITIVE)
    lookahead: float = setting(3.0, "m", "refined: longer readings count as this", POSITIVE)
    field_of_view: float = setting_of_method(2.0 * math.pi, math.pi, "rad", "in which gaps are searched", POSITIVE)
    depth_tolerance: float = setting(0.5, "m", "point=deepest, step 4", FROM_ZERO)


def free_space(ranges: FloatArray, angle_increment: float, settings: FollowTheGapSettings) -> FloatArray:
    """Return ranges (n,) [m] after steps 1 and 2: 0 is what is not free."""
    if settings.bubble == "points":
        return mask_points(ranges, angle_increment, settings.bubble_radius)
    if settings.method == "source":
        return mask_bubble(ranges, angle_increment, settings.bubble_radius)
    return mask_nearest(ranges, angle_increment, settings.bubble_radius)


def best_position(free: FloatArray, first: int, end: int, settings: FollowTheGapSettings) -> float:
    """Return the position of the best point, in beams, in the gap `free[first:end]` by step 4."""
    if settings.method == "source" and settings.point == "furthest":
        return float(first + greatest_beam(free[first:end]))
    if settings.point != "middle":
        tolerance = settings.depth_tolerance if settings.point == "deepest" else 0.0
        first, end = deepest_run(free, first, end, tolerance)
    return middle_of(first, end)


class FollowTheGap(GoalPlanner):
    """The planner of the course. Where nothing is free it brakes and keeps its steering angle."""

    Settings = FollowTheGapSettings
    source_laws = ("distance_ahead",)

    @staticmethod
    def goal(
        geometry: Record, ranges: FloatArray, car: Record, settings: FollowTheGapSettings, debug: IntermediateScans
    ) -> tuple[float, float]:
        """Return the goal's bearing [rad] and distance [m]; NaN where nothing is free."""
        half = 0.5 * settings.field_of_view
        first, end = beams_between(geometry, len(ranges), -half, half)
        seen = ranges if settings.method == "source" else clip_to_lookahead(ranges, settings.lookahead)
        free = free_space(seen[first:end], geometry.angle_increment, settings)
        debug.bubble[:], debug.bubble[first:end] = seen, free
        gap_first, gap_end = longest_run(free)
        if gap_first == gap_end:
            return math.nan, 0.0
        write_debug_run(debug.gap, debug.bubble, first + gap_first, first + gap_end)
        position = best_position(free, gap_first, gap_end, settings)
        return bearing_of(geometry, first + position), range_at(free, position)
