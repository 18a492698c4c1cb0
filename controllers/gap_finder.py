"""Gap finder: the disparity extender with more filters, as the field's gap_finder_base describes it.

The nine components, in the order of that text:

1. disparity extender      scan_filters.extend_disparities
2. safety bubble           scan_filters.safety_bubbles, as wide as the arc says
3. lookahead               scan_filters.clip_to_lookahead
4. field of view           scan_geometry.beams_between
5. nearest-point bubble    scan_filters.mask_nearest
6. mean filter             scan_filters.rolling_mean, over the width of a bubble
7. centre priority         scan_filters.prioritise_centre, 0.999 to 1.000
8. greatest range          the goal
9. speed                   speed.mean_range_speed by the mean range in front; speed.friction_speed by the steering

Differences from the known implementation of the text: the friction limit is the last word on speed, and no gain
follows it; g is the model's, not 10; bubbles reach to the ends of the scan; no filter changes its input; the car
steers along the arc to the goal, not by the goal's bearing.

Limits: a scan shows no more than the next corner, and the goal is the longer of two ways, wherever that leads. What was
seen before is remembered by guidance, which leads the car on where the goal does not; with `guidance=false` the planner
has no memory, and may turn back in a hairpin. In a dead end it stops.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.messages import FloatArray

from .control.driving import DrivingSettings
from .control.planner import GoalPlanner
from .control.planner_settings import FROM_ZERO, POSITIVE, Accepted, Record, setting
from .perception.gaps import run_around
from .perception.intermediate_scans import IntermediateScans, keep, keep_run
from .perception.scan_filters import (
    clip_to_lookahead,
    extend_disparities,
    greatest_beam,
    mask_nearest,
    prioritise_centre,
    rolling_mean,
)
from .perception.scan_geometry import beams_between, bearing_of


@dataclass(frozen=True, kw_only=True)
class GapFinderSettings(DrivingSettings):
    """Parameters of the components; the lookahead clips the ranges too."""

    field_of_view: float = setting(math.pi, "rad", "component 4", POSITIVE)
    disparity_threshold: float = setting(0.3, "m", "between neighbouring readings, for an edge", FROM_ZERO)
    clearance: float = setting(0.15, "m", "to the side of the car, past a disparity", FROM_ZERO)
    nearest_bubble: float = setting(0.2, "m", "radius of component 5", POSITIVE)
    mean_radius: float = setting(0.1, "m", "of the mean filter's bubble", POSITIVE)
    edge_weight: float = setting(
        0.999, "", "centre priority at the edges of the field of view",
        Accepted("a number from 0 to 1", lambda value: 0.0 <= value <= 1.0),
    )  # fmt: skip


class GapFinder(GoalPlanner):
    """The default planner. Where there is no way, or nothing to see, it brakes and keeps its steering angle.

    Its brakes are as hard as the tires hold; at rest, and without odometry, it answers STOP.
    """

    Settings = GapFinderSettings

    @staticmethod
    @kernel
    def goal(
        scan: Record, ranges: FloatArray, car: Record, settings: Record, shown: IntermediateScans
    ) -> tuple[float, float]:
        """Return the goal's bearing [rad] and distance [m]; NaN where no beam can be driven along."""
        increment = scan.angle_increment
        clipped = clip_to_lookahead(ranges, settings.lookahead)
        reach = 0.5 * car.width + settings.clearance
        keep(shown.extended, extend_disparities(clipped, increment, settings.disparity_threshold, reach))
        keep(shown.bubble, mask_nearest(shown.extended, increment, settings.nearest_bubble))
        keep(shown.filtered, rolling_mean(shown.bubble, increment, settings.mean_radius))
        half = 0.5 * settings.field_of_view
        first, end = beams_between(scan, len(ranges), -half, half)
        bearings = np.empty(end - first)
        for beam in range(first, end):
            bearings[beam - first] = bearing_of(scan, beam)
        preferred = prioritise_centre(shown.filtered[first:end], bearings, settings.edge_weight)
        if len(preferred) == 0:
            return math.nan, 0.0
        goal = greatest_beam(preferred)
        if preferred[goal] <= 0.0:
            return math.nan, 0.0
        gap_first, gap_end = run_around(shown.filtered, first + goal, first, end)
        keep_run(shown.gap, shown.filtered, gap_first, gap_end)
        return bearings[goal], shown.filtered[first + goal]
