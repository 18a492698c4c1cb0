"""Intermediate scans: what a planner makes of a scan on its way to the goal, kept for pictures.

    extended = extend_disparities(ranges, geometry.angle_increment, threshold, radius)
    debug.extended[:] = extended

A planner writes them in every decision. Pictures show them; no command depends on them.
"""

from __future__ import annotations

from typing import NamedTuple

from fg_mujoco.messages import FloatArray
from fg_mujoco.native import core


class IntermediateScans(NamedTuple):
    """Scans of all beams, each (n,) [m], to be written to by a planner that has them."""

    filtered: FloatArray  # readings as the speed law range_ratio averages them; unless kept, those of the LiDAR
    extended: FloatArray  # after edges were widened
    bubble: FloatArray  # after the surroundings of the nearest point were set to 0
    gap: FloatArray  # the beams of the gap that was chosen; NaN elsewhere


write_debug_run = core.write_debug_run
"""Write `ranges[first:end]` into an intermediate scan (n,) [m], and NaN elsewhere."""
