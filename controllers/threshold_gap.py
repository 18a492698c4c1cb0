"""Threshold gap: a gap is at least n consecutive readings beyond a threshold t.

1. Find the gaps within the field of view (gaps.runs_beyond); no return is a reading beyond any t.
2. Take the widest, or the deepest:
   - widest: that of most readings, so of the widest angle; of several as wide, the deeper one;
   - deepest: that of the furthest reading; of several as deep, the wider one.
   If they are alike in both, the rightmost.
3. Drive to the middle of it. Without a gap, brake: the definition leaves nothing to drive to.

Source: the F1TENTH course slides on reactive methods. Their array,

    [0.5, 5.1, 6.0, 7.0, inf, 3.0, inf, 3.0, inf, 8.0, 1.0, 3.0]    n = 3, t = 5.0

is shown with two gaps. Read as it is written, "at least n consecutive hits that pass t", the definition finds one: 5.1
to inf, the second reading to the fifth. The others beyond t, inf alone and inf with 8.0, are one and two; with n = 2
the latter is the second gap. The definition is what is taken.

Limits: t is hard to decide. The greater it is, the later a gap shows, and the faster the lap, until none shows where
the car has to turn in: with 2 and 3 m it drives all bundled circuits, with 4 m it is faster in three and gets stuck in
`tight`, and with the course's 5 m it finishes three of six. The gap's width counts as an angle, n as
readings of this LiDAR: neither knows the car's width, and nothing is kept clear of the gap's edges but by going through
its middle. What is a gap for a robot that can turn on the spot may be none for a car.
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

from .compiled_planner import CompiledPlanner
from .driving import DrivingSettings, brake, drive_to
from .gaps import middle_of, range_at, runs_beyond
from .records import Record
from .scan_filters import valid_ranges
from .scan_geometry import beams_between, bearing_of, sees

_WIDEST = 0  # the place of the word in `gap`


@dataclass(frozen=True, kw_only=True)
class ThresholdGapSettings(DrivingSettings):
    """Parameters of the gaps.

    Raises:
      SettingsError: an unknown gap; a threshold that is negative or not finite; less than one reading; a field of view
        that is not positive.
    """

    gap: Literal["widest", "deepest"] = "widest"
    threshold: float = 2.0  # [m] t
    least_readings: int = 3  # n
    field_of_view: float = math.pi  # [rad]

    def __post_init__(self) -> None:
        super().__post_init__()
        require(self, lambda value: 0.0 <= value < math.inf, "a number from 0", ("threshold",), SettingsError)
        accepted = "a whole number from 1 to 1e9"
        require(self, lambda n: 1.0 <= n <= 1e9 and n.is_integer(), accepted, ("least_readings",), SettingsError)
        positive = ("field_of_view",)
        require(self, lambda value: 0.0 < value < math.inf, "a positive number", positive, SettingsError)


@kernel
def choose_gap(ranges: FloatArray, gaps: NDArray[np.int64], settings: Record) -> int:
    """Return which of the `gaps` (gaps, 2) in `ranges` (n,) [m] is taken by step 2; -1 where there is none."""
    best, best_width, best_depth = -1, 0.0, 0.0
    for gap in range(len(gaps)):
        width, depth = float(gaps[gap, 1] - gaps[gap, 0]), -math.inf
        for beam in range(gaps[gap, 0], gaps[gap, 1]):
            if ranges[beam] > depth:
                depth = ranges[beam]
        wider, deeper = width > best_width, depth > best_depth
        if settings.gap == _WIDEST:
            better = wider or (width == best_width and deeper)
        else:
            better = deeper or (depth == best_depth and wider)
        if better:
            best, best_width, best_depth = gap, width, depth
    return best


@kernel
def find_goal(scan: Record, ranges: FloatArray, settings: Record) -> tuple[float, float]:
    """Return the goal's bearing [rad] and distance [m] for valid ranges (n,) [m]; NaN where there is none."""
    half = 0.5 * settings.field_of_view
    first, end = beams_between(scan, len(ranges), -half, half)
    seen = ranges[first:end]
    gaps = runs_beyond(seen, min(settings.threshold, 0.999 * scan.range_max), settings.least_readings)
    gap = choose_gap(seen, gaps, settings)
    if gap < 0:
        return math.nan, 0.0
    place = middle_of(gaps[gap, 0], gaps[gap, 1])
    return bearing_of(scan, first + place), range_at(seen, place)


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


class ThresholdGap(CompiledPlanner):
    """The planner of the slides' definition. Without a gap it brakes and keeps the wheels as they are."""

    Settings = ThresholdGapSettings
    decide = staticmethod(decide)

    def find_goal(self, scan: LaserScan) -> tuple[float, float] | None:
        """Return the bearing [rad] of the gap's middle and the distance [m] seen there; None without a gap."""
        return self._goal_by(lambda row, valid, own: find_goal(row, valid, own["settings"]), scan)
