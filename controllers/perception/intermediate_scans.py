"""Intermediate scans: what a goal kernel makes of a scan on its way to the goal, kept for pictures.

    extended = extend_disparities(ranges, geometry.angle_increment, threshold, radius)
    write_debug(debug.extended, extended)

A kernel writes them in every decision. Pictures show them; no command depends on them. (`debug.extended[:] = extended`
does the same; numba takes two seconds longer to compile it.)
"""

from __future__ import annotations

import math
from typing import NamedTuple

from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.messages import FloatArray

from .scan_filters import copy_ranges


class IntermediateScans(NamedTuple):
    """Scans of all beams, each (n,) [m], to be written to by a goal kernel that has them."""

    filtered: FloatArray  # readings as the speed law range_ratio averages them; unless kept, those of the LiDAR
    extended: FloatArray  # after edges were widened
    bubble: FloatArray  # after the surroundings of the nearest point were set to 0
    gap: FloatArray  # the beams of the gap that was chosen; NaN elsewhere


write_debug = copy_ranges
"""Kernel that writes ranges (n,) [m] into an intermediate scan of as many beams."""


@kernel
def write_debug_run(kept: FloatArray, ranges: FloatArray, first: int, end: int) -> None:
    """Write `ranges[first:end]` into an intermediate scan (n,) [m], and NaN elsewhere."""
    for beam in range(len(ranges)):
        kept[beam] = ranges[beam] if first <= beam < end else math.nan
