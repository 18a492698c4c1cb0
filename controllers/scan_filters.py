"""What a planner does to a scan before it looks for a gap: one named function for each filter.

All take ranges of shape (n,) [m], rightmost beam first, and answer a new array of the same shape; none changes
its input. A range of 0 is a beam that must not be driven along. Sources: the F1TENTH course slides on reactive
methods (clip, bubble around the nearest point), N. Otterness' disparity extender (2019), and the notes of the
field's gap_finder_base (bubble width by the arc, rolling mean, centre priority).
"""

from __future__ import annotations

import math

import numpy as np

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


def bubble_beams(ranges: FloatArray, radius: float, angle_increment: float) -> FloatArray:
    """Return how many beams to either side of each one pass within `radius` [m] of its end. Shape (n,), whole.

    The arc between neighbouring beams, angle_increment * range, is taken as straight, so the count is
    radius / (angle_increment * range), rounded up; half a turn at most.
    """
    half_turn = math.pi / angle_increment
    arcs = angle_increment * np.maximum(ranges, radius / math.pi)
    return np.minimum(np.ceil(radius / arcs), half_turn)


def extend_disparities(ranges: FloatArray, angle_increment: float, threshold: float, radius: float) -> FloatArray:
    """Return ranges with every edge widened by `radius` [m] over the free space beside it.

    Where neighbouring ranges differ by more than `threshold` [m], the nearer one is an edge that the car's side
    must clear: the beams beyond it that `radius` spans at its range are cut to that range. A closer reading is
    never overwritten by a farther one.
    """
    extended = ranges.copy()
    steps = np.diff(ranges)
    rising = np.flatnonzero(steps > threshold)  # free space to the left of the edge
    falling = np.flatnonzero(steps < -threshold) + 1  # free space to its right
    for edges, side in ((rising, 1), (falling, -1)):
        widths = bubble_beams(ranges[edges], radius, angle_increment)
        for edge, width in zip(edges.tolist(), widths.astype(int).tolist(), strict=True):
            free = slice(edge, edge + width + 1) if side > 0 else slice(max(edge - width, 0), edge + 1)
            np.minimum(extended[free], ranges[edge], out=extended[free])
    return extended


def safety_bubble(ranges: FloatArray, beam: int, angle_increment: float, radius: float) -> FloatArray:
    """Return ranges in which all beams within `radius` [m] of the end of `beam` are no longer than that one.

    The bubble ends at the ends of the scan; it does not wrap round them. A closer reading is kept.
    """
    width = int(bubble_beams(ranges[beam : beam + 1], radius, angle_increment)[0])
    inside = slice(max(beam - width, 0), beam + width + 1)
    result = ranges.copy()
    np.minimum(result[inside], ranges[beam], out=result[inside])
    return result


def mask_nearest(ranges: FloatArray, angle_increment: float, radius: float) -> FloatArray:
    """Return ranges with the bubble of `radius` [m] around the nearest point set to 0: not to be driven along."""
    if len(ranges) == 0:
        return ranges.copy()
    nearest = int(np.argmin(ranges))
    width = int(bubble_beams(ranges[nearest : nearest + 1], radius, angle_increment)[0])
    result = ranges.copy()
    result[max(nearest - width, 0) : nearest + width + 1] = 0.0
    return result


def rolling_mean(ranges: FloatArray, angle_increment: float, radius: float) -> FloatArray:
    """Return the mean of each range over the bubble of `radius` [m] at its own end; a part window at the ends.

    A bubble edge next to a long stretch becomes a slope, which holds the goal off the edge.
    """
    count = len(ranges)
    beams = np.arange(count)
    width = bubble_beams(ranges, radius, angle_increment).astype(np.intp)
    first = np.maximum(beams - width, 0)
    last = np.minimum(beams + width + 1, count)
    total = np.concatenate(([0.0], np.cumsum(ranges)))
    return (total[last] - total[first]) / (last - first)


def prioritise_centre(ranges: FloatArray, bearings: FloatArray, edge_weight: float = 0.999) -> FloatArray:
    """Return ranges weighted from `edge_weight` at the widest bearing to 1 straight ahead: equal ranges go straight."""
    widest = np.max(np.abs(bearings), initial=0.0)
    if widest == 0.0:
        return ranges.copy()
    return ranges * (1.0 - (1.0 - edge_weight) * np.abs(bearings) / widest)


def field_of_view(bearings: FloatArray, width: float) -> slice:
    """Return the beams whose bearing is within half of `width` [rad] to either side of straight ahead."""
    first, last = np.searchsorted(bearings, (-0.5 * width, 0.5 * width + 1e-12))
    return slice(int(first), int(last))
