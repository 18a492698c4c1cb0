"""Finds gaps: runs of beams, given as the first beam and the one behind the last, `ranges[first:end]`.

    ranges = valid_ranges(scan.ranges, scan.range_max)
    first, end = longest_run(mask_nearest(ranges, scan.angle_increment, radius=0.4))

The field has two answers, both of the F1TENTH course slides on reactive methods: the longest run of beams that no
bubble has set to 0 (`longest_run`), and at least n consecutive readings beyond a threshold t (`runs_beyond`).

Positions are in beams: the middle of two beams is at the first + 0.5. None changes its input.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.messages import FloatArray
from fg_mujoco.native import core


def chord(a: float, b: float, angle: float) -> float:
    """Return the distance [m] between the ends of two readings `a` and `b` [m] with `angle` [rad] between them.

    This is the cosine law, sqrt(a^2 + b^2 - 2 a b cos(angle)), as sqrt((a - b)^2 + 4 a b sin(angle / 2)^2): where the
    angle is small, the first subtracts nearly all that it has.
    """
    return core.chord(a, b, angle)


def longest_run(ranges: FloatArray) -> tuple[int, int]:
    """Return the longest run of readings (n,) that are not 0; of several, the rightmost; 0 and 0 where all are 0."""
    return core.longest_run(ranges)


def runs_beyond(ranges: FloatArray, threshold: float, least: int) -> NDArray[np.int64]:
    """Return all runs of at least `least` consecutive readings (n,) beyond `threshold` [m], rightmost first.

    Shape (gaps, 2): the first beam of each, and the one behind its last. inf is beyond any threshold, NaN beyond none.
    """
    return core.runs_beyond(ranges, threshold, least)


def deepest_run(ranges: FloatArray, first: int, end: int, tolerance: float) -> tuple[int, int]:
    """Return the longest run within `ranges[first:end]` of readings at most `tolerance` [m] short of the greatest.

    Of several, the rightmost; `first` and `first` where there are no readings.
    """
    return core.deepest_run(ranges, first, end, tolerance)


def furthest_beam(ranges: FloatArray, first: int, end: int) -> int:
    """Return the beam of the greatest of `ranges[first:end]`; -1 where there are none.

    Of several, the middle one of their longest run: beams without return are all as far, and the first of them would be
    the right edge of an opening.
    """
    return core.furthest_beam(ranges, first, end)


def disparities(ranges: FloatArray, first: int, end: int, threshold: float) -> NDArray[np.int64]:
    """Return the beams within `ranges[first:end]` whose next one to the left differs by more than a threshold [m]."""
    return core.disparities(ranges, first, end, threshold)


def middle_of(first: int, end: int) -> float:
    """Return the position of the middle of a run, in beams: with an even number of them, between two."""
    return core.middle_of(first, end)


def range_at(ranges: FloatArray, position: float) -> float:
    """Return the reading [m] at a position between two beams: the nearer of the two."""
    return core.range_at(ranges, position)


def run_around(ranges: FloatArray, beam: int, first: int, end: int) -> tuple[int, int]:
    """Return the run of readings above 0 that a beam is in, within `ranges[first:end]`."""
    return core.run_around(ranges, beam, first, end)
