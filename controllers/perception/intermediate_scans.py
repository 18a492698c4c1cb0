"""Intermediate scans: what a goal kernel makes of a scan on its way to the goal, kept for pictures.

    extended = extend_disparities(ranges, scan.angle_increment, threshold, radius)
    keep(shown.extended, extended)

A kernel keeps them in every decision, so a picture shows what was decided by. (`shown.extended[:] = extended` does the
same; numba takes two seconds longer to compile it.)
"""

from __future__ import annotations

import math
from typing import NamedTuple

from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.messages import FloatArray


class IntermediateScans(NamedTuple):
    """Scans of all beams, each (n,) [m], to be written to by a goal kernel that has them."""

    filtered: FloatArray  # readings as the speed law range_ratio averages them; unless kept, those of the LiDAR
    extended: FloatArray  # after edges were widened
    bubble: FloatArray  # after the surroundings of the nearest point were set to 0
    gap: FloatArray  # the beams of the gap that was chosen; NaN elsewhere


@kernel
def keep(kept: FloatArray, ranges: FloatArray) -> None:
    """Write ranges (n,) [m] into an intermediate scan of as many beams."""
    for beam in range(len(ranges)):
        kept[beam] = ranges[beam]


@kernel
def keep_run(kept: FloatArray, ranges: FloatArray, first: int, end: int) -> None:
    """Write `ranges[first:end]` into an intermediate scan (n,) [m], and NaN elsewhere."""
    for beam in range(len(ranges)):
        kept[beam] = ranges[beam] if first <= beam < end else math.nan
