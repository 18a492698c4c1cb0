"""Gap finder: the disparity extender with more filters, as the field's gap_finder_base describes it, made safe.

The nine components, in the order of that text:

1. disparity extender      scan_filters.extend_disparities
2. safety bubble           scan_filters.safety_bubbles, as wide as the arc says
3. lookahead               scan_filters.clip_to_lookahead
4. field of view           scan_geometry.beams_between
5. nearest-point bubble    scan_filters.mask_nearest
6. mean filter             scan_filters.rolling_mean, its window that of a bubble
7. centre priority         scan_filters.prioritise_centre, 0.999 to 1.000
8. greatest range          the goal
9. speed                   speed.range_ratio_speed by the mean range in front; speed.friction_speed by the steering

To these comes what a real car needs, in `driving`: stopping_paths (it stops within what it sees), friction_guard
(the friction law as a limit in transients), and the law by the distance ahead that all planners have. Where this
differs from the known implementation of the text: the friction limit is the last word on speed, no gain follows it; g
is the model's, not 10; bubbles reach to the ends of the scan; no filter changes its input; the car steers along the arc
to the goal, not by the goal's bearing.

Limits: it sees no further than the next corner and has no memory, so it takes the longer of two ways, wherever that
leads. In a dead end it stops, backs out (backing_out) and comes again.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.errors import SettingsError
from fg_mujoco.kernels import kernel
from fg_mujoco.messages import FloatArray, LaserScan, require

from .compiled_planner import CompiledPlanner
from .driving import DrivingSettings, brake, drive_to
from .records import Record
from .scan_filters import (
    clip_to_lookahead,
    extend_disparities,
    mask_nearest,
    prioritise_centre,
    rolling_mean,
    valid_ranges,
)
from .scan_geometry import beams_between, bearing_of, sees


@dataclass(frozen=True, kw_only=True)
class GapFinderSettings(DrivingSettings):
    """Parameters of the components; the lookahead clips the ranges too.

    Raises:
      SettingsError: a value that is not a positive number; a clearance or weight below 0, a weight above 1.
    """

    field_of_view: float = math.pi  # [rad]
    disparity_threshold: float = 0.3  # [m]
    clearance: float = 0.15  # [m] beside the car, past a disparity
    nearest_bubble: float = 0.2  # [m] radius
    mean_radius: float = 0.1  # [m] of the mean filter's bubble
    edge_weight: float = 0.999  # centre priority at the edges of the field of view

    def __post_init__(self) -> None:
        super().__post_init__()
        positive = ("field_of_view", "nearest_bubble", "mean_radius")
        from_zero = ("disparity_threshold", "clearance")
        require(self, lambda value: 0.0 < value < math.inf, "a positive number", positive, SettingsError)
        require(self, lambda value: 0.0 <= value < math.inf, "a number from 0", from_zero, SettingsError)
        require(self, lambda value: 0.0 <= value <= 1.0, "a number from 0 to 1", ("edge_weight",), SettingsError)


@kernel
def filtered(scan: Record, valid: FloatArray, planner: Record) -> FloatArray:
    """Return the readings (n,) [m] after components 1 to 6, but for the field of view."""
    settings, increment = planner.settings, scan.angle_increment
    ranges = clip_to_lookahead(valid, settings.lookahead)
    reach = 0.5 * planner.driver.car.width + settings.clearance
    ranges = extend_disparities(ranges, increment, settings.disparity_threshold, reach)
    ranges = mask_nearest(ranges, increment, settings.nearest_bubble)
    return rolling_mean(ranges, increment, settings.mean_radius)


@kernel
def find_goal(scan: Record, ranges: FloatArray, planner: Record) -> tuple[float, float]:
    """Return the goal's bearing [rad] and distance [m] for filtered ranges (n,) [m]; NaN where there is none."""
    half = 0.5 * planner.settings.field_of_view
    first, end = beams_between(scan, len(ranges), -half, half)
    bearings = np.empty(end - first)
    for beam in range(first, end):
        bearings[beam - first] = bearing_of(scan, beam)
    preferred = prioritise_centre(ranges[first:end], bearings, planner.settings.edge_weight)
    if len(preferred) == 0:
        return math.nan, 0.0
    goal = np.argmax(preferred)
    if preferred[goal] <= 0.0:
        return math.nan, 0.0
    return bearings[goal], ranges[first + goal]


@kernel
def decide(
    scan: Record, ranges: FloatArray, odometry: Record, planner: Record, memory: Record, paths: NDArray[np.void]
) -> tuple[float, float]:
    """Return the command for one scan: steering angle [rad] and speed [m/s]. Types as in `driving`."""
    valid = valid_ranges(ranges, scan.range_max)
    if not sees(scan, valid):
        return brake(scan, odometry, planner.driver, memory.driving)
    shaped = filtered(scan, valid, planner)
    bearing, distance = find_goal(scan, shaped, planner)
    return drive_to(scan, valid, shaped, odometry, planner, memory.driving, paths, bearing, distance)


class GapFinder(CompiledPlanner):
    """The planner of the package. Where there is no way, or nothing to see, it brakes and keeps the wheels as they are.

    Its brakes are as hard as the tires hold; at rest, and without odometry, it answers STOP.
    """

    Settings = GapFinderSettings
    decide = staticmethod(decide)

    def find_goal(self, scan: LaserScan) -> tuple[float, float] | None:
        """Return the goal's bearing [rad] and distance [m].

        None where no beam can be driven along: fewer than two, all zero, or no sensible angle between them.
        """
        return self._goal_by(lambda row, valid, own: find_goal(row, filtered(row, valid, own), own), scan)
