"""Disparity selection: within the largest gap, halfway between the two disparities of an opening.

1. Preprocess, mask the nearest obstacle and take the largest gap, as `follow_the_gap` does.
2. In it, neighbouring readings that differ by more than a threshold are a disparity: an obstacle's edge.
3. An opening is what lies between two disparities that follow each other, the first from near to far and the
   second from far to near. Of several openings the widest is taken: the distance in metres between the two
   edges that it lies between (gaps.chord); of several as wide, the rightmost.
4. The goal is the middle of the opening; without one, the furthest reading of the gap (of several as far, as all are
   beyond the lookahead, the middle of their longest run).

Source: the notes of the field on disparity selection. Their code takes the middle of the first two disparities,
whatever lies between: a box before a far wall has two, and the car would aim at the box. Its index is that of the
reading before a jump, so its middle is off to the right: of [0.4, 0.5, 2.5, 2.5, 2.5, 0.6, 0.5] it takes the third,
where the middle of the free space is the fourth.

Limits: between walls a corner shows one disparity, its inner edge, or none, and the planner is then the naive follow
the gap, with its limits: on the bundled circuits it drives as that does, to the bit. A gap's end is no disparity:
an opening beside the masked obstacle is not seen as one. Noise over the threshold makes openings. It measures an
opening, but does not ask whether the car fits through.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

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


@dataclass(frozen=True, kw_only=True)
class DisparitySelectionSettings(DrivingSettings):
    """Parameters of the steps; the lookahead clips the ranges too.

    Raises:
      SettingsError: a radius or field of view that is not positive; a threshold that is negative or not finite.
    """

    disparity_threshold: float = 0.5  # [m]
    bubble_radius: float = 0.4  # [m]
    lookahead: float = 3.0  # [m]
    field_of_view: float = math.pi  # [rad]

    def __post_init__(self) -> None:
        super().__post_init__()
        positive = ("bubble_radius", "field_of_view")
        require(self, lambda value: 0.0 < value < math.inf, "a positive number", positive, SettingsError)
        from_zero = ("disparity_threshold",)
        require(self, lambda value: 0.0 <= value < math.inf, "a number from 0", from_zero, SettingsError)


@kernel
def widest_opening(
    ranges: FloatArray, first: int, end: int, angle_increment: float, threshold: float
) -> tuple[int, int]:
    """Return the widest opening within `ranges[first:end]`: first beam, last + 1; `first` and `first` without one."""
    best_first, best_end, widest = first, first, -1.0
    rise = -1  # the first beam behind the last disparity, if that was from near to far
    for beam in range(first + 1, end):
        step = ranges[beam] - ranges[beam - 1]
        if abs(step) <= threshold:
            continue
        if step < 0.0 and rise >= 0:
            width = chord(ranges[rise - 1], ranges[beam], (beam - rise + 1) * angle_increment)
            if width > widest:
                best_first, best_end, widest = rise, beam, width
        rise = beam if step > 0.0 else -1
    return best_first, best_end


@kernel
def best_place(free: FloatArray, angle_increment: float, threshold: float) -> float:
    """Return the place of the goal, in beams, in masked ranges (n,) [m]; NaN where nothing is free."""
    first, end = longest_run(free)
    if first == end:
        return math.nan
    goal_first, goal_end = widest_opening(free, first, end, angle_increment, threshold)
    if goal_first == goal_end:
        goal_first, goal_end = deepest_run(free, first, end, 0.0)
    return middle_of(goal_first, goal_end)


@kernel
def find_goal(scan: Record, ranges: FloatArray, settings: Record) -> tuple[float, float]:
    """Return the goal's bearing [rad] and distance [m] for clipped ranges (n,) [m]; NaN where there is none."""
    half = 0.5 * settings.field_of_view
    first, end = beams_between(scan, len(ranges), -half, half)
    free = mask_nearest(ranges[first:end], scan.angle_increment, settings.bubble_radius)
    place = best_place(free, scan.angle_increment, settings.disparity_threshold)
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


class DisparitySelection(CompiledPlanner):
    """The planner of the openings. Where nothing is free it brakes and keeps the wheels as they are."""

    Settings = DisparitySelectionSettings
    decide = staticmethod(decide)

    def find_goal(self, scan: LaserScan) -> tuple[float, float] | None:
        """Return the goal's bearing [rad] and distance [m]; None where nothing is free."""
        lookahead = self.settings.lookahead
        return self._goal_by(
            lambda row, valid, own: find_goal(row, clip_to_lookahead(valid, lookahead), own["settings"]), scan
        )
