"""Disparity selection: within the largest gap, halfway between the two disparities of an opening.

1. Mask the nearest obstacle and take the largest gap, as `follow_the_gap` does.
2. In it, neighbouring readings that differ by more than a threshold are a disparity: an obstacle's edge. Its index is
   that of the reading before the jump.
3. The goal is halfway between the first two disparities, rounded down; without two, the furthest reading of the gap.

Source: the notes of the field on disparity selection, which are a chapter of follow the gap: bubble and speed law are
that one's. Refined:

- The two disparities are those of an opening, from near to far and back: between the first two may be a box.
- Of several openings the widest is taken, by the metres between its edges (gaps.chord): the first may be too narrow.
- The goal is the middle of the free readings: the source's index is off to the right. Of [0.4, 0.5, 2.5, 2.5, 2.5, 0.6,
  0.5] it takes the third, where the middle of the free space is the fourth.
- Bubble, lookahead, field of view, furthest point and steering are those of `follow_the_gap`, with its reasons.

Limits: between walls a corner shows one disparity, its inner edge, or none, and the planner is then the naive follow
the gap, with its limits: refined, it drives on the bundled circuits as that does, to the bit. A gap's end is no
disparity: an opening next to the masked obstacle is not seen as one. Noise over the threshold makes openings. The
planner measures an opening, but does not ask whether the car fits through.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from fg_mujoco.messages import FloatArray

from .control.driving import DrivingSettings
from .control.planner import GoalPlanner
from .control.planner_settings import FROM_ZERO, POSITIVE, Record, setting, setting_of_car, setting_of_method
from .perception.gaps import chord, deepest_run, disparities, longest_run, middle_of, range_at
from .perception.scan_filters import (
    IntermediateScans,
    clip_to_lookahead,
    greatest_beam,
    mask_bubble,
    mask_nearest,
    write_debug_run,
)
from .perception.scan_geometry import beams_between, bearing_of


@dataclass(frozen=True, kw_only=True)
class DisparitySelectionSettings(DrivingSettings):
    """Parameters of the steps; the lookahead clips the ranges too."""

    disparity_threshold: float = setting(0.5, "m", "between neighbouring readings, for an edge", FROM_ZERO)
    bubble_radius: float = setting_of_car(0.4, "m", "round the nearest point", POSITIVE)
    lookahead: float = setting(3.0, "m", "refined: longer readings count as this", POSITIVE)
    field_of_view: float = setting_of_method(2.0 * math.pi, math.pi, "rad", "in which gaps are searched", POSITIVE)


def widest_opening(
    ranges: FloatArray, first: int, end: int, angle_increment: float, threshold: float
) -> tuple[int, int]:
    """Return the widest opening within `ranges[first:end]`: first beam, last + 1; `first` and `first` without one."""
    best_first, best_end, widest = first, first, -1.0
    rise = -1  # the first beam behind the last disparity, if that was from near to far
    for before in disparities(ranges, first, end, threshold).tolist():
        beam = before + 1
        step = ranges[beam] - ranges[before]
        if step < 0.0 and rise >= 0:
            width = chord(ranges[rise - 1], ranges[beam], (beam - rise + 1) * angle_increment)
            if width > widest:
                best_first, best_end, widest = rise, beam, width
        rise = beam if step > 0.0 else -1
    return best_first, best_end


def source_beam(ranges: FloatArray, first: int, end: int, threshold: float) -> int:
    """Return the beam of the source's code: halfway between the first two disparities of the gap `ranges[first:end]`.

    A disparity has the index of the reading before its jump. Without two the goal is the furthest reading of the gap.
    """
    found = disparities(ranges, first, end, threshold)
    if len(found) >= 2:
        return int(first + (found[0] + found[1] - 2 * first) // 2)
    return first + greatest_beam(ranges[first:end])


def best_opening(free: FloatArray, angle_increment: float, threshold: float) -> tuple[int, int]:
    """Return the first beam, and the last + 1, whose middle is the goal in masked ranges (n,) [m]: 0, 0 without one."""
    first, end = longest_run(free)
    best = widest_opening(free, first, end, angle_increment, threshold)
    return best if best[0] != best[1] else deepest_run(free, first, end, 0.0)


class DisparitySelection(GoalPlanner):
    """The planner of the openings. Where nothing is free it brakes and keeps its steering angle."""

    Settings = DisparitySelectionSettings
    source_laws = ("distance_ahead",)

    @staticmethod
    def goal(
        geometry: Record,
        ranges: FloatArray,
        car: Record,
        settings: DisparitySelectionSettings,
        debug: IntermediateScans,
    ) -> tuple[float, float]:
        """Return the goal's bearing [rad] and distance [m]; NaN where nothing is free."""
        half = 0.5 * settings.field_of_view
        first, end = beams_between(geometry, len(ranges), -half, half)
        increment, threshold = geometry.angle_increment, settings.disparity_threshold
        source = settings.method == "source"
        seen = ranges if source else clip_to_lookahead(ranges, settings.lookahead)
        mask = mask_bubble if source else mask_nearest
        free = mask(seen[first:end], increment, settings.bubble_radius)
        debug.bubble[:], debug.bubble[first:end] = seen, free
        gap_first, gap_end = longest_run(free) if source else best_opening(free, increment, threshold)
        if gap_first == gap_end:
            return math.nan, 0.0
        write_debug_run(debug.gap, debug.bubble, first + gap_first, first + gap_end)
        position = middle_of(gap_first, gap_end)
        if source:
            position = float(source_beam(free, gap_first, gap_end, threshold))
        return bearing_of(geometry, first + position), range_at(free, position)
