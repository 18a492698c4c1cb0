"""What a planner does to a scan before it looks for a gap: one named function for each filter.

All take ranges of shape (n,) [m], rightmost beam first, and answer a new array of the same shape; none changes
its input. A range of 0 is a beam that must not be driven along. Sources: the F1TENTH course slides on reactive
methods (clip, bubble around the nearest point), N. Otterness' disparity extender (2019), and the notes of the
field's gap_finder_base (bubble width by the arc, rolling mean, centre priority).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.messages import FloatArray


def valid_ranges(ranges: FloatArray, range_max: float) -> FloatArray:
    """Return ranges with every beam a distance in [0, range_max].

    No return (+inf) is `range_max`; too close (-inf, or negative) is 0; a failed reading (NaN) takes the nearer
    of its next valid neighbours on either side, so that a dropout is neither an obstacle nor a gap. Without any
    valid reading all are 0.
    """
    failed = np.isnan(ranges)
    clipped = np.clip(ranges, 0.0, range_max)
    if not failed.any():
        return clipped
    valid = np.flatnonzero(~failed)
    if len(valid) == 0:
        return np.zeros_like(clipped)
    beams = np.arange(len(ranges))
    right = valid[np.maximum(np.searchsorted(valid, beams, side="right") - 1, 0)]
    left = valid[np.minimum(np.searchsorted(valid, beams), len(valid) - 1)]
    return np.minimum(clipped[right], clipped[left])


def clip_to_lookahead(ranges: FloatArray, lookahead: float) -> FloatArray:
    """Return ranges cut off at `lookahead` [m]: all that lies beyond is equally far, so the goal does not jitter."""
    return np.minimum(ranges, lookahead)


def bubble_beams(ranges: FloatArray, radius: float, angle_increment: float) -> NDArray[np.intp]:
    """Return how many beams to either side of each one pass within `radius` [m] of its end. Shape (n,).

    The arc between neighbouring beams, angle_increment * range, is taken as straight and in line with the bubble's
    diameter, so the count is radius / (angle_increment * range), rounded up; half a turn at most.
    """
    nearest = radius / math.pi  # from here on the bubble spans half a turn
    return np.ceil(radius / (angle_increment * np.maximum(ranges, nearest))).astype(np.intp)


def safety_bubbles(
    ranges: FloatArray, beams: NDArray[np.intp], angle_increment: float, radius: float
) -> FloatArray:
    """Return ranges with a bubble of `radius` [m] round the end of each of `beams`.

    Within a bubble no beam is longer than the one in its middle; a closer reading is never overwritten by a farther
    one. Bubbles end at the ends of the scan, they do not wrap round.
    """
    result = ranges.copy()
    if len(beams) == 0:
        return result
    count = len(ranges)
    width = bubble_beams(ranges[beams], radius, angle_increment)
    first = np.maximum(beams - width, 0)
    last = np.minimum(beams + width, count - 1)
    # Each span is covered by two of length 2^k, which then hand their minimum down to their halves.
    levels = np.frexp(last - first + 1)[1] - 1
    spans = np.full((int(levels.max()) + 1, count), math.inf)
    for start in (first, last + 1 - (1 << levels)):
        np.minimum.at(spans.reshape(-1), levels * count + start, ranges[beams])
    for level in range(len(spans) - 1, 0, -1):
        half = 1 << (level - 1)
        np.minimum(spans[level - 1], spans[level], out=spans[level - 1])
        np.minimum(spans[level - 1, half:], spans[level, :-half], out=spans[level - 1, half:])
    np.minimum(result, spans[0], out=result)
    return result


def extend_disparities(ranges: FloatArray, angle_increment: float, threshold: float, radius: float) -> FloatArray:
    """Return ranges with every edge widened by `radius` [m], about half the car's width.

    Where neighbouring ranges differ by more than `threshold` [m], the nearer of them is an edge that the car's side
    must clear: it gets a safety bubble.
    """
    steps = np.diff(ranges)
    disparities = np.flatnonzero(np.abs(steps) > threshold)
    edges = disparities + (steps[disparities] < 0.0)
    return safety_bubbles(ranges, edges, angle_increment, radius)


def widen_all(ranges: FloatArray, angle_increment: float, radius: float) -> FloatArray:
    """Return ranges with every reading widened by `radius` [m]: where a car of that half width fits, as a point."""
    return safety_bubbles(ranges, np.arange(len(ranges)), angle_increment, radius)


def mask_nearest(ranges: FloatArray, angle_increment: float, radius: float) -> FloatArray:
    """Return ranges with the bubble of `radius` [m] round the nearest point set to 0: not to be driven along.

    Of several that are as near, as within an edge that was widened, the middle one; where all are, there is no nearest.
    """
    result = ranges.copy()
    as_near = np.flatnonzero(ranges == np.min(ranges, initial=math.inf))
    if len(as_near) < len(ranges):
        nearest = int(as_near[(len(as_near) - 1) // 2])
        width = int(bubble_beams(ranges[nearest : nearest + 1], radius, angle_increment)[0])
        result[max(nearest - width, 0) : nearest + width + 1] = 0.0
    return result


def rolling_mean(ranges: FloatArray, angle_increment: float, radius: float) -> FloatArray:
    """Return the mean of each range over the bubble of `radius` [m] at its own end; a part window at the ends.

    What is 0 stays 0.

    A bubble's edge next to a long stretch becomes a slope, which holds the goal off the edge.
    """
    count = len(ranges)
    beams = np.arange(count)
    width = bubble_beams(ranges, radius, angle_increment)
    first = np.maximum(beams - width, 0)
    last = np.minimum(beams + width + 1, count)
    total = np.concatenate(([0.0], np.cumsum(ranges)))
    means = (total[last] - total[first]) / (last - first)
    return np.where(ranges > 0.0, means, 0.0)


def prioritise_centre(ranges: FloatArray, bearings: FloatArray, edge_weight: float = 0.999) -> FloatArray:
    """Return ranges weighted from `edge_weight` at the widest bearing to 1 straight ahead: equal ranges go straight."""
    widest = float(np.max(np.abs(bearings), initial=0.0))
    if widest == 0.0:
        return ranges.copy()
    return ranges * (1.0 - (1.0 - edge_weight) * np.abs(bearings) / widest)


def field_of_view(bearings: FloatArray, width: float) -> slice:
    """Return the beams within half of `width` [rad] to either side of straight ahead."""
    first, last = np.searchsorted(bearings, (-0.5 * width - 1e-9, 0.5 * width + 1e-9))
    return slice(int(first), int(last))
