"""Bearings of a scan's beams: every world of a batch has the same geometry.

    geometry = geometry_record(message)[0]
    first, end = beams_between(geometry, len(message.ranges), -0.5, 0.5)

What a planner makes of the readings is in scan_filters.
"""

from __future__ import annotations

from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.messages import LaserScan, ScanGeometry
from fg_mujoco.native import core, record

_PERIOD = LaserScan.scan_time  # [s] for scans that do not tell theirs
_LEAST_INCREMENT = 1e-9  # [rad] below it, counts of beams overflow

SCAN_GEOMETRY = record(
    "ScanGeometry", [(name, np.float64) for name in ("angle_min", "angle_increment", "range_max", "scan_time")]
)
"""Type of a row with the geometry of the scans; units as in LaserScan."""

geometry_values = attrgetter(*SCAN_GEOMETRY.names or ())
"""Takes the values of a SCAN_GEOMETRY from a LaserScan or a ScanGeometry."""

nearest_beam = core.nearest_beam


def geometry_record(scan: LaserScan | ScanGeometry) -> NDArray[np.void]:
    """Return a row of type SCAN_GEOMETRY, shape (1,)."""
    return np.array([geometry_values(scan)], SCAN_GEOMETRY)


sees = core.sees
"""Return whether there is a scan to plan with: two beams or more, not all zero, a sensible angle between them."""

bearing_of = core.bearing_of
"""Return the bearing of a beam [rad]; a fraction is a position between two beams."""

bearings_of = core.bearings_of
"""Return the bearings [rad] of the beams from `first` to before `end`. Shape (end - first,)."""

beams_between = core.beams_between
"""Return the beams with bearings from `right` to `left` [rad], of so many: first, and last + 1."""
