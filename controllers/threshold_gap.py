"""Threshold gap: a gap is at least n consecutive readings beyond a threshold t.

1. Find the gaps within the field of view (gaps.runs_beyond); no return is a reading beyond any t.
2. Take the widest, or the deepest:
   - widest: that of most readings, so of the widest angle; of several as wide, the deeper one;
   - deepest: that of the furthest reading; of several as deep, the wider one.
   If they are alike in both, the rightmost.
3. Drive to the middle of it. Without a gap, brake: the definition leaves nothing to drive to.

Source: the F1TENTH course slides on reactive methods. Their array, for n = 3 and t = 5.0,

    [0.5, 5.1, 6.0, 7.0, inf, 3.0, inf, 3.0, inf, 8.0, 1.0, 3.0]

is shown with two gaps. The definition as written, "at least n consecutive hits that pass t", finds one: 5.1 to inf, the
second reading to the fifth. The others beyond t are one and two readings; with n = 2 the latter is the second gap. The
definition is what is taken. Refined:

- t is 2 m: with the slides' 5 m no gap shows where the car has to turn in.
- Field of view and steering are those of `follow_the_gap`, with its reasons.

Limits: t is hard to decide. The greater it is, the later a gap shows, and the faster the lap, until none shows. The
gap's width counts as an angle, n as readings of this LiDAR: neither knows the car's width, and only driving through the
middle keeps the car off the gap's edges.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.messages import FloatArray

from .control.driving import DrivingSettings
from .control.planner import GoalPlanner
from .control.planner_settings import FROM_ZERO, POSITIVE, Accepted, Record, setting, setting_of_method
from .perception.gaps import middle_of, range_at, runs_beyond
from .perception.scan_filters import IntermediateScans, write_debug_run
from .perception.scan_geometry import beams_between, bearing_of


@dataclass(frozen=True, kw_only=True)
class ThresholdGapSettings(DrivingSettings):
    """Parameters of the gaps."""

    gap: Literal["widest", "deepest"] = setting("widest", text="which gap is taken")
    threshold: float = setting_of_method(5.0, 2.0, "m", "t", FROM_ZERO)
    least_readings: int = setting(
        3, "", "n", Accepted("a whole number from 1 to 1e9", lambda n: 1.0 <= n <= 1e9 and n.is_integer())
    )
    field_of_view: float = setting_of_method(2.0 * math.pi, math.pi, "rad", "in which gaps are searched", POSITIVE)


def choose_gap(ranges: FloatArray, gaps: NDArray[np.int64], settings: ThresholdGapSettings) -> int:
    """Return the index in `gaps` (gaps, 2), of `ranges` (n,) [m], that step 2 selects; -1 where there is none."""
    best, best_width, best_depth = -1, 0.0, 0.0
    for gap, (first, end) in enumerate(gaps.tolist()):
        width, depth = float(end - first), float(np.max(ranges[first:end]))
        wider, deeper = width > best_width, depth > best_depth
        if settings.gap == "widest":
            better = wider or (width == best_width and deeper)
        else:
            better = deeper or (depth == best_depth and wider)
        if better:
            best, best_width, best_depth = gap, width, depth
    return best


class ThresholdGap(GoalPlanner):
    """The planner of the slides' definition. Without a gap it brakes and keeps its steering angle."""

    Settings = ThresholdGapSettings
    source_laws = ("distance_ahead",)

    @staticmethod
    def goal(
        geometry: Record, ranges: FloatArray, car: Record, settings: ThresholdGapSettings, debug: IntermediateScans
    ) -> tuple[float, float]:
        """Return the bearing [rad] of the gap's middle and the distance [m] seen there; NaN without a gap."""
        half = 0.5 * settings.field_of_view
        first, end = beams_between(geometry, len(ranges), -half, half)
        seen = ranges[first:end]
        gaps = runs_beyond(seen, min(settings.threshold, 0.999 * geometry.range_max), settings.least_readings)
        chosen = choose_gap(seen, gaps, settings)
        if chosen < 0:
            return math.nan, 0.0
        gap_first, gap_end = gaps[chosen].tolist()
        write_debug_run(debug.gap, ranges, first + gap_first, first + gap_end)
        position = middle_of(gap_first, gap_end)
        return bearing_of(geometry, first + position), range_at(seen, position)
