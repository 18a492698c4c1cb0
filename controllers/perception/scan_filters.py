"""Filters of scans, applied before the search for a gap: one named function for each.

    ranges = valid_ranges(scan.ranges, scan.range_max)
    ranges = extend_disparities(ranges, scan.angle_increment, threshold=0.3, radius=0.3)

All take ranges of shape (n,) [m], rightmost beam first, and answer a new array of the same shape; none changes
its input. A range of 0 is a beam that must not be driven along. Ranges are contiguous arrays of float64; the work is
done in native/controllers/perception/scan_filters.cpp.

Intermediate scans are what a planner makes of a scan on its way to the goal, kept for pictures; no command depends on
them. A planner writes them in every decision:

    extended = extend_disparities(ranges, geometry.angle_increment, threshold, radius)
    debug.extended[:] = extended

Sources: the F1TENTH course's slides and notes on reactive methods (clip, bubble around the nearest point), N.
Otterness' disparity extender (2019), and the notes of the field's gap_finder_base (bubble width by the arc, rolling
mean, centre priority).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.messages import FloatArray
from fg_mujoco.native import core

valid_ranges = core.valid_ranges


def noise_of(ranges: FloatArray, range_max: float) -> float:
    """Return the standard deviation of the readings (n,) [m] of a scan, at most 0.15 m.

    It is by the median of how far beams end from the straight line through the ends of their neighbours: along a flat
    surface 1 / range is nearly linear in the bearing. Beams at edges are too few to change the median.
    """
    return core.noise_of(ranges, range_max)


def clip_to_lookahead(ranges: FloatArray, lookahead: float) -> FloatArray:
    """Return ranges cut off at `lookahead` [m]: all that lies beyond is equally far, so the goal does not jitter."""
    return core.clip_to_lookahead(ranges, lookahead)


def bubble_beams(ranges: FloatArray, radius: float, angle_increment: float) -> NDArray[np.int32]:
    """Return the number of beams to either side of each one that pass its end within `radius` [m]. Shape (n,).

    The arc between neighbouring beams, angle_increment * range, is taken as straight and in line with the bubble's
    diameter, so the count is radius / (angle_increment * range), rounded up; half a turn at most.
    """
    return core.bubble_beams(ranges, radius, angle_increment)


def safety_bubbles(ranges: FloatArray, beams: NDArray[np.int64], angle_increment: float, radius: float) -> FloatArray:
    """Return ranges with a bubble of `radius` [m] round the end of each of `beams`.

    Within a bubble no beam is longer than the one in its middle; a closer reading is never overwritten by a farther
    one. Bubbles end at the ends of the scan, they do not wrap round.
    """
    return core.safety_bubbles(ranges, beams, angle_increment, radius)


def extend_disparities(ranges: FloatArray, angle_increment: float, threshold: float, radius: float) -> FloatArray:
    """Return ranges with every edge widened by `radius` [m], about half the car's width.

    Where neighbouring ranges differ by more than `threshold` [m], the nearer of them is an edge that the car's side
    must clear: it gets a safety bubble.
    """
    return core.extend_disparities(ranges, angle_increment, threshold, radius)


def widen_all(ranges: FloatArray, angle_increment: float, radius: float) -> FloatArray:
    """Return ranges with every reading widened by `radius` [m]: where a car of that half width fits, as a point.

    These are the safety bubbles of all beams, in a time in proportion to n.
    """
    return core.widen_all(ranges, angle_increment, radius)


def greatest_beam(ranges: FloatArray) -> int:
    """Return the beam of the greatest of ranges (n,), the rightmost of several; 0 of none: in parts as `least_of`."""
    return core.greatest_beam(ranges)


def mask_nearest(ranges: FloatArray, angle_increment: float, radius: float) -> FloatArray:
    """Return ranges with the bubble of `radius` [m] round the nearest point set to 0: not to be driven along.

    Of several that are as near, as within an edge that was widened, the middle one; where all are, there is no nearest.
    """
    return core.mask_nearest(ranges, angle_increment, radius)


def mask_bubble(ranges: FloatArray, angle_increment: float, radius: float) -> FloatArray:
    """Return ranges with int(atan(radius / distance) / angle_increment) beams to either side of the nearest set to 0.

    Of several that are as near, the rightmost; where it is at 0, nothing is masked. Source: the notes of the field on
    obstacle masking. `mask_nearest` is wider: the arc of a bubble near by is longer than its tangent.
    """
    return core.mask_bubble(ranges, angle_increment, radius)


def mask_points(ranges: FloatArray, angle_increment: float, radius: float) -> FloatArray:
    """Return ranges with all readings that end within `radius` [m] of the nearest point set to 0."""
    return core.mask_points(ranges, angle_increment, radius)


def rolling_mean(ranges: FloatArray, angle_increment: float, radius: float) -> FloatArray:
    """Return the mean of each range over the bubble of `radius` [m] at its own end; a part window at the ends.

    What is 0 stays 0.

    A bubble's edge next to a long stretch becomes a slope, which holds the goal off the edge.
    """
    return core.rolling_mean(ranges, angle_increment, radius)


def prioritise_centre(ranges: FloatArray, bearings: FloatArray, edge_weight: float = 0.999) -> FloatArray:
    """Return ranges weighted from `edge_weight` at the widest bearing to 1 straight ahead: equal ranges go straight."""
    return core.prioritise_centre(ranges, bearings, edge_weight)


class IntermediateScans(NamedTuple):
    """Scans of all beams, each (n,) [m], to be written to by a planner that has them."""

    filtered: FloatArray  # readings as the speed law range_ratio averages them; unless kept, those of the LiDAR
    extended: FloatArray  # after edges were widened
    bubble: FloatArray  # after the surroundings of the nearest point were set to 0
    gap: FloatArray  # the beams of the gap that was chosen; NaN elsewhere


write_debug_run = core.write_debug_run
"""Write `ranges[first:end]` into an intermediate scan (n,) [m], and NaN elsewhere."""
