"""Finds gaps: runs of beams, given as the first beam and the one behind the last, `ranges[first:end]`.

    ranges = valid_ranges(scan.ranges, scan.range_max)
    first, end = longest_run(mask_nearest(ranges, scan.angle_increment, radius=0.4))

The field has two answers, both of the F1TENTH course slides on reactive methods: the longest run of beams that no
bubble has set to 0 (`longest_run`), and at least n consecutive readings beyond a threshold t (`runs_beyond`).

Positions are in beams: the middle of two beams is at the first + 0.5. All are kernels, to be called from Python and
from other kernels alike; none changes its input.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.messages import FloatArray


@kernel
def chord(a: float, b: float, angle: float) -> float:
    """Return the distance [m] between the ends of two readings `a` and `b` [m] with `angle` [rad] between them.

    This is the cosine law, sqrt(a^2 + b^2 - 2 a b cos(angle)), as sqrt((a - b)^2 + 4 a b sin(angle / 2)^2): where the
    angle is small, the first subtracts nearly all that it has.
    """
    return math.hypot(a - b, 2.0 * math.sqrt(a) * math.sqrt(b) * math.sin(0.5 * angle))


@kernel
def longest_run(ranges: FloatArray) -> tuple[int, int]:
    """Return the longest run of readings (n,) that are not 0; of several, the rightmost; 0 and 0 where all are 0."""
    best_first, best_end = 0, 0
    first = 0  # of the run that has not ended
    for beam in range(len(ranges)):
        if ranges[beam] == 0.0:
            first = beam + 1
        elif beam + 1 - first > best_end - best_first:
            best_first, best_end = first, beam + 1
    return best_first, best_end


@kernel
def runs_beyond(ranges: FloatArray, threshold: float, least: int) -> NDArray[np.int64]:
    """Return all runs of at least `least` consecutive readings (n,) beyond `threshold` [m], rightmost first.

    Shape (gaps, 2): the first beam of each, and the one behind its last. inf is beyond any threshold, NaN beyond none.
    """
    least = max(least, 1)
    runs = np.empty((len(ranges) // least + 1, 2), np.int64)
    count, first = 0, 0
    for beam in range(len(ranges) + 1):
        if beam < len(ranges) and (ranges[beam] > threshold or ranges[beam] == math.inf):
            continue
        if beam - first >= least:
            runs[count, 0], runs[count, 1] = first, beam
            count += 1
        first = beam + 1
    return runs[:count]


@kernel
def deepest_run(ranges: FloatArray, first: int, end: int, tolerance: float) -> tuple[int, int]:
    """Return the longest run within `ranges[first:end]` of readings at most `tolerance` [m] short of the greatest.

    Of several, the rightmost; `first` and `first` where there are no readings.
    """
    greatest = -math.inf
    for beam in range(first, end):
        greatest = max(greatest, ranges[beam])
    best_first, best_end = first, first
    start = first  # of the run that has not ended
    for beam in range(first, end):
        if ranges[beam] < greatest - tolerance:
            start = beam + 1
        elif beam + 1 - start > best_end - best_first:
            best_first, best_end = start, beam + 1
    return best_first, best_end


@kernel
def furthest_beam(ranges: FloatArray, first: int, end: int) -> int:
    """Return the beam of the greatest of `ranges[first:end]`; -1 where there are none.

    Of several, the middle one of their longest run: beams without return are all as far, and the first of them would be
    the right edge of an opening.
    """
    run_first, run_end = deepest_run(ranges, first, end, 0.0)
    return (run_first + run_end - 1) // 2 if run_end > run_first else -1


@kernel
def middle_of(first: int, end: int) -> float:
    """Return the position of the middle of a run, in beams: with an even number of them, between two."""
    return 0.5 * (first + end - 1)


@kernel
def range_at(ranges: FloatArray, position: float) -> float:
    """Return the reading [m] at a position between two beams: the nearer of the two."""
    return float(min(ranges[math.floor(position)], ranges[math.ceil(position)]))


@kernel
def run_around(ranges: FloatArray, beam: int, first: int, end: int) -> tuple[int, int]:
    """Return the run of readings above 0 that a beam is in, within `ranges[first:end]`."""
    start, stop = beam, beam
    while start > first and ranges[start - 1] > 0.0:
        start -= 1
    while stop < end and ranges[stop] > 0.0:
        stop += 1
    return start, stop
