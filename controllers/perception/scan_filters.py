"""Filters of scans, applied before the search for a gap: one named function for each.

    ranges = valid_ranges(scan.ranges, scan.range_max)
    ranges = extend_disparities(ranges, scan.angle_increment, threshold=0.3, radius=0.3)

All take ranges of shape (n,) [m], rightmost beam first, and answer a new array of the same shape; none changes
its input. A range of 0 is a beam that must not be driven along. All are kernels, to be called from Python and from
other kernels alike.

Sources: the F1TENTH course's slides and notes on reactive methods (clip, bubble around the nearest point), N.
Otterness' disparity extender (2019), and the notes of the field's gap_finder_base (bubble width by the arc, rolling
mean, centre priority).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.messages import FloatArray

_MOST_NOISE, _NOISE_BINS = 0.15, 128  # [m] that is measured, and in so many steps
_NOISE_EVERY = 4  # beams, of which one is compared with its neighbours
_OFF_LINE = 0.6745 * math.sqrt(6.0)  # median of how far a beam is off the line through its neighbours, over the noise
_MOST_BEAMS = 1e9  # to either side; a bubble of more beams than a number can count has this many


@kernel
def copy_ranges(into: FloatArray, ranges: FloatArray) -> None:
    """Copy ranges (n,) into an array of as many."""
    for beam in range(len(ranges)):
        into[beam] = ranges[beam]


@kernel
def valid_ranges(ranges: FloatArray, range_max: float) -> FloatArray:
    """Return ranges with every beam a distance in [0, range_max].

    No return (+inf) is `range_max`; too close (-inf, or negative) is 0; a failed reading (NaN) takes the nearer
    of its next valid neighbours on either side, so that a dropout is neither an obstacle nor a gap. Without any
    valid reading all are 0.
    """
    count = len(ranges)
    result = np.empty(count)
    failed = 0
    for beam in range(count):
        failed += math.isnan(ranges[beam])
        result[beam] = min(max(ranges[beam], 0.0), range_max)
    if failed == count:
        return np.zeros(count)
    if failed > 0:
        neighbour = math.inf  # the last valid one to the right
        for beam in range(count):
            if math.isnan(ranges[beam]):
                result[beam] = neighbour
            neighbour = result[beam]
        neighbour = math.inf  # the last valid one to the left
        for beam in range(count - 1, -1, -1):
            if not math.isnan(ranges[beam]):
                neighbour = result[beam]
            result[beam] = min(result[beam], neighbour)
    return result


@kernel
def noise_of(ranges: FloatArray, range_max: float) -> float:
    """Return the standard deviation of the readings (n,) [m] of a scan, at most _MOST_NOISE.

    It is by the median of how far beams end from the straight line through the ends of their neighbours: along a flat
    surface 1 / range is nearly linear in the bearing. Beams at edges are too few to change the median.
    """
    counts, total = np.zeros(_NOISE_BINS, np.int64), 0
    for beam in range(1, len(ranges) - 1, _NOISE_EVERY):
        right, middle, left = ranges[beam - 1], ranges[beam], ranges[beam + 1]
        if 0.0 < middle < range_max and right > 0.0 and left > 0.0:
            off = middle * abs(middle * (right + left) / (right * left) - 2.0) / (_OFF_LINE * _MOST_NOISE)
            counts[int(min(off * _NOISE_BINS + 0.5, _NOISE_BINS - 1.0))] += 1
            total += 1
    level, below = 0, counts[0]
    while 2 * below < total:
        level += 1
        below += counts[level]
    return _MOST_NOISE * level / _NOISE_BINS


@kernel
def clip_to_lookahead(ranges: FloatArray, lookahead: float) -> FloatArray:
    """Return ranges cut off at `lookahead` [m]: all that lies beyond is equally far, so the goal does not jitter."""
    result = np.empty(len(ranges))
    for beam in range(len(ranges)):
        result[beam] = min(ranges[beam], lookahead)
    return result


@kernel
def _bubble_width(distance: float, radius: float, angle_increment: float) -> int:
    """Return the number of beams to either side of one, `distance` [m] long, that pass its end within `radius` [m]."""
    nearest = radius / math.pi  # from here on the bubble spans half a turn
    width = np.ceil(radius / (angle_increment * (nearest if distance < nearest else distance)))
    width = width if width > 0.0 else 0.0  # NaN, which no width should be, is 0
    return int(np.int32(width if width < _MOST_BEAMS else _MOST_BEAMS))  # 32 bits: eight at a time


@kernel
def bubble_beams(ranges: FloatArray, radius: float, angle_increment: float) -> NDArray[np.int32]:
    """Return the number of beams to either side of each one that pass its end within `radius` [m]. Shape (n,).

    The arc between neighbouring beams, angle_increment * range, is taken as straight and in line with the bubble's
    diameter, so the count is radius / (angle_increment * range), rounded up; half a turn at most.
    """
    result = np.empty(len(ranges), np.int32)
    for beam in range(len(ranges)):
        result[beam] = _bubble_width(ranges[beam], radius, angle_increment)
    return result


@kernel
def _add_bubble(result: FloatArray, beam: int, distance: float, angle_increment: float, radius: float) -> None:
    """Shorten what is longer than `distance` [m] within `radius` [m] of the end of a beam of that length."""
    width = _bubble_width(distance, radius, angle_increment)
    for other in range(max(beam - width, 0), min(beam + width + 1, len(result))):
        result[other] = min(result[other], distance)


@kernel
def safety_bubbles(ranges: FloatArray, beams: NDArray[np.int64], angle_increment: float, radius: float) -> FloatArray:
    """Return ranges with a bubble of `radius` [m] round the end of each of `beams`.

    Within a bubble no beam is longer than the one in its middle; a closer reading is never overwritten by a farther
    one. Bubbles end at the ends of the scan, they do not wrap round.
    """
    result = ranges.copy()
    for beam in beams:
        _add_bubble(result, beam, ranges[beam], angle_increment, radius)
    return result


@kernel
def extend_disparities(ranges: FloatArray, angle_increment: float, threshold: float, radius: float) -> FloatArray:
    """Return ranges with every edge widened by `radius` [m], about half the car's width.

    Where neighbouring ranges differ by more than `threshold` [m], the nearer of them is an edge that the car's side
    must clear: it gets a safety bubble.
    """
    result = ranges.copy()
    for beam in range(1, len(ranges)):
        step = ranges[beam] - ranges[beam - 1]
        if abs(step) > threshold:
            edge = beam if step < 0.0 else beam - 1
            _add_bubble(result, edge, ranges[edge], angle_increment, radius)
    return result


@kernel
def widen_all(ranges: FloatArray, angle_increment: float, radius: float) -> FloatArray:
    """Return ranges with every reading widened by `radius` [m]: where a car of that half width fits, as a point.

    These are the safety bubbles of all beams, in a time in proportion to n.
    """
    count = len(ranges)
    result = ranges.copy()
    widths = bubble_beams(ranges, radius, angle_increment)
    line = np.empty(count, np.int32)
    for to_left in (True, False):
        _shorten_onwards(result, ranges, widths, line, to_left)
    return result


@kernel
def _shorten_onwards(
    result: FloatArray, ranges: FloatArray, widths: NDArray[np.int32], line: NDArray[np.int32], to_left: bool
) -> None:
    """Shorten each beam of `result` to the nearest of the bubbles that reach it from beams before it.

    The nearer a reading, the wider its bubble. So one that is nearer than those before it replaces them for good; one
    that is not waits in line, nearest first, until the bubble that holds has come to its end.
    """
    one, last = np.uintp(1), len(ranges) - 1  # unsigned: else numba asks of each index if it is negative
    nearest, until = math.inf, -1  # the bubble that holds: its range, and the step at which it ends
    first, after = np.uintp(0), np.uintp(0)  # who waits: those from `first` to before `after`
    for step in range(len(ranges)):
        beam = np.uintp(step if to_left else last - step)
        distance = ranges[beam]
        if distance <= nearest:
            nearest, until = distance, step + widths[beam]
            first, after = np.uintp(0), np.uintp(0)
            continue
        while after > first and ranges[np.uintp(line[after - one])] >= distance:
            after -= one
        line[after] = beam
        after += one
        while until < step and first < after:
            waited = np.uintp(line[first])
            nearest, until = ranges[waited], (line[first] if to_left else last - line[first]) + widths[waited]
            first += one
        result[beam] = min(result[beam], nearest)


@kernel
def least_of(ranges: FloatArray) -> float:
    """Return the least of ranges (n,), inf of none: of four parts, which a processor looks through at the same time."""
    a, b, c, d = math.inf, math.inf, math.inf, math.inf
    whole = len(ranges) // 4 * 4
    for beam in range(0, whole, 4):
        a, b = min(a, ranges[beam]), min(b, ranges[beam + 1])
        c, d = min(c, ranges[beam + 2]), min(d, ranges[beam + 3])
    for beam in range(whole, len(ranges)):
        a = min(a, ranges[beam])
    return float(min(min(a, b), min(c, d)))


@kernel
def greatest_beam(ranges: FloatArray) -> int:
    """Return the beam of the greatest of ranges (n,), the rightmost of several; 0 of none: in parts as `least_of`."""
    a, b, c, d = -math.inf, -math.inf, -math.inf, -math.inf
    whole = len(ranges) // 4 * 4
    for beam in range(0, whole, 4):
        a, b = max(a, ranges[beam]), max(b, ranges[beam + 1])
        c, d = max(c, ranges[beam + 2]), max(d, ranges[beam + 3])
    for beam in range(whole, len(ranges)):
        a = max(a, ranges[beam])
    greatest = max(max(a, b), max(c, d))
    for beam in range(len(ranges)):
        if ranges[beam] == greatest:
            return beam
    return 0


@kernel
def mask_nearest(ranges: FloatArray, angle_increment: float, radius: float) -> FloatArray:
    """Return ranges with the bubble of `radius` [m] round the nearest point set to 0: not to be driven along.

    Of several that are as near, as within an edge that was widened, the middle one; where all are, there is no nearest.
    """
    nearest, as_near = least_of(ranges), 0
    for distance in ranges:
        as_near += distance == nearest
    result = ranges.copy()
    if 0 < as_near < len(ranges):
        middle = -1
        for _ in range((as_near + 1) // 2):
            middle += 1
            while ranges[middle] != nearest:
                middle += 1
        width = _bubble_width(nearest, radius, angle_increment)
        for beam in range(max(middle - width, 0), min(middle + width + 1, len(ranges))):
            result[beam] = 0.0
    return result


@kernel
def mask_bubble(ranges: FloatArray, angle_increment: float, radius: float) -> FloatArray:
    """Return ranges with int(atan(radius / distance) / angle_increment) beams to either side of the nearest set to 0.

    Of several that are as near, the rightmost; where it is at 0, nothing is masked. Source: the notes of the field on
    obstacle masking. `mask_nearest` is wider: the arc of a bubble near by is longer than its tangent.
    """
    result = ranges.copy()
    nearest = np.argmin(ranges) if len(ranges) > 0 else -1
    if nearest >= 0 and ranges[nearest] > 0.0:
        width = math.atan(radius / ranges[nearest]) / angle_increment if angle_increment > 0.0 else 0.0
        width = width if width > 0.0 else 0.0  # NaN is 0
        points = int(min(width, _MOST_BEAMS))
        for beam in range(max(nearest - points, 0), min(nearest + points + 1, len(ranges))):
            result[beam] = 0.0
    return result


@kernel
def rolling_mean(ranges: FloatArray, angle_increment: float, radius: float) -> FloatArray:
    """Return the mean of each range over the bubble of `radius` [m] at its own end; a part window at the ends.

    What is 0 stays 0.

    A bubble's edge next to a long stretch becomes a slope, which holds the goal off the edge.
    """
    count = len(ranges)
    total, quarter = np.empty(count + 1), count // 4  # of all beams before each
    total[0] = a = b = c = d = 0.0
    for beam in range(quarter):  # four sums go on at a time
        a, b, c = a + ranges[beam], b + ranges[quarter + beam], c + ranges[2 * quarter + beam]
        d += ranges[3 * quarter + beam]
        total[beam + 1], total[quarter + beam + 1] = a, b
        total[2 * quarter + beam + 1], total[3 * quarter + beam + 1] = c, d
    for beam in range(4 * quarter, count):
        d += ranges[beam]
        total[beam + 1] = d
    b, c = a + b, a + b + c
    for beam in range(quarter):
        total[quarter + beam + 1] += a
        total[2 * quarter + beam + 1] += b
    for beam in range(3 * quarter, count):
        total[beam + 1] += c
    widths = bubble_beams(ranges, radius, angle_increment)
    result = np.empty(count)
    for beam in range(count):  # several at a time: no beam is left out
        first = np.uintp(max(beam - widths[beam], 0))
        end = np.uintp(min(beam + widths[beam] + 1, count))
        mean = (total[end] - total[first]) / np.int32(end - first)
        result[beam] = mean if ranges[beam] > 0.0 else 0.0
    return result


@kernel
def prioritise_centre(ranges: FloatArray, bearings: FloatArray, edge_weight: float = 0.999) -> FloatArray:
    """Return ranges weighted from `edge_weight` at the widest bearing to 1 straight ahead: equal ranges go straight."""
    result = ranges.copy()
    widest = max(abs(bearings[0]), abs(bearings[-1])) if len(bearings) > 0 else 0.0
    if widest > 0.0:
        for beam in range(len(ranges)):
            result[beam] *= 1.0 - (1.0 - edge_weight) * abs(bearings[beam]) / widest
    return result
