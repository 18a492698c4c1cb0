"""Gap finder: the disparity extender with more filters, as the field's gap_finder_base describes it.

The nine components, in the order of that text:

1. disparity extender      scan_filters.extend_disparities
2. safety bubble           scan_filters.safety_bubbles, as wide as the arc says
3. lookahead               scan_filters.clip_to_lookahead
4. field of view           scan_geometry.beams_between
5. nearest-point bubble    scan_filters.safety_bubbles; refined: scan_filters.mask_nearest
6. mean filter             scan_filters.rolling_mean, over the width of a bubble
7. centre priority         scan_filters.prioritise_centre, 0.999 to 1.000
8. greatest range          the goal
9. speed                   by the mean range over the lookahead, and by the steering angle (speed)

With `method=source` all bubbles have one radius, half the car's width and `clearance`, and the speed law takes the mean
of all readings with a gain of 1. In a bubble a closer reading stays, as the slides say of disparities. Refined:

- Component 5 masks its beams, where the text sets them to the nearest range: the mean filter would lift those again.
- The mean filter and component 5 have bubbles of their own: a mean over the car's width blurs ways that it fits in.
- The mean range is that in front of the goal, with a gain of 3: most readings are of the walls at the car's side.
- The car steers along an arc: by the goal's bearing a longer car turns less than it should, and a shorter one more.

Limits: a scan shows no more than the next corner, and the goal is the longer of two ways, wherever that leads. The
planner has no memory: without guidance it may turn back in a hairpin. In a dead end it stops.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fg_mujoco.messages import FloatArray

from .control.driving import DrivingSettings
from .control.planner import GoalPlanner
from .control.planner_settings import FROM_ZERO, POSITIVE, Accepted, Record, setting
from .control.stages import NativeStep
from .perception.gaps import run_around
from .perception.scan_filters import (
    IntermediateScans,
    clip_to_lookahead,
    extend_disparities,
    greatest_beam,
    mask_nearest,
    prioritise_centre,
    rolling_mean,
    safety_bubbles,
    write_debug_run,
)
from .perception.scan_geometry import beams_between, bearings_of


@dataclass(frozen=True, kw_only=True)
class GapFinderSettings(DrivingSettings):
    """Parameters of the components; the lookahead clips the ranges too."""

    field_of_view: float = setting(math.pi, "rad", "component 4", POSITIVE)
    disparity_threshold: float = setting(0.3, "m", "between neighbouring readings, for an edge", FROM_ZERO)
    clearance: float = setting(0.15, "m", "to the side of the car, past a disparity", FROM_ZERO)
    nearest_bubble: float = setting(0.2, "m", "refined: radius of component 5", POSITIVE)
    mean_radius: float = setting(0.1, "m", "refined: of the mean filter's bubble", POSITIVE)
    edge_weight: float = setting(
        0.999, "", "centre priority at the edges of the field of view",
        Accepted("a number from 0 to 1", lambda value: 0.0 <= value <= 1.0),
    )  # fmt: skip


class GapFinder(GoalPlanner):
    """The default planner. Where there is no way, or nothing to see, it brakes and keeps its steering angle.

    Its brakes are as hard as the tires hold; at rest, and without odometry, it answers STOP.
    """

    Settings = GapFinderSettings
    source_laws = ("mean_range", "friction_law")
    refer = NativeStep("refer_by_gap_finder")  # does what `goal` says, in a fifth of the time; a test compares them

    @staticmethod
    def goal(
        geometry: Record, ranges: FloatArray, car: Record, settings: GapFinderSettings, debug: IntermediateScans
    ) -> tuple[float, float]:
        """Return the goal's bearing [rad] and distance [m]; NaN where no beam can be driven along."""
        increment = geometry.angle_increment
        clipped = clip_to_lookahead(ranges, settings.lookahead)
        reach = 0.5 * car.width + settings.clearance
        extended = extend_disparities(clipped, increment, settings.disparity_threshold, reach)
        if settings.method == "source":
            bubble = safety_bubbles(extended, np.array([np.argmin(extended)]), increment, reach)
            filtered = rolling_mean(bubble, increment, reach)
        else:
            bubble = mask_nearest(extended, increment, settings.nearest_bubble)
            filtered = rolling_mean(bubble, increment, settings.mean_radius)
        debug.extended[:], debug.bubble[:], debug.filtered[:] = extended, bubble, filtered
        half = 0.5 * settings.field_of_view
        first, end = beams_between(geometry, len(ranges), -half, half)
        bearings = bearings_of(geometry, first, end)
        preferred = prioritise_centre(filtered[first:end], bearings, settings.edge_weight)
        if len(preferred) == 0:
            return math.nan, 0.0
        goal = greatest_beam(preferred)
        if preferred[goal] <= 0.0:
            return math.nan, 0.0
        gap_first, gap_end = run_around(filtered, first + goal, first, end)
        write_debug_run(debug.gap, filtered, gap_first, gap_end)
        return bearings[goal], filtered[first + goal]
