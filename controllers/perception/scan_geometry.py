"""Bearings of a scan's beams, as kernels read them: every world of a batch has the same geometry.

    geometry = geometry_record(message)[0]
    first, end = beams_between(geometry, len(message.ranges), -0.5, 0.5)

What a planner makes of the readings is in scan_filters.
"""

from __future__ import annotations

import math
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.messages import FloatArray, LaserScan, ScanGeometry

from ..control.planner_settings import Record

_PERIOD = LaserScan.scan_time  # [s] for scans that do not tell theirs
_LEAST_INCREMENT = 1e-9  # [rad] below it, counts of beams overflow

SCAN_GEOMETRY = np.dtype([(name, np.float64) for name in ("angle_min", "angle_increment", "range_max", "scan_time")])
"""Type of a row with the geometry of the scans; units as in LaserScan."""

geometry_values = attrgetter(*SCAN_GEOMETRY.names or ())
"""Takes the values of a SCAN_GEOMETRY from a LaserScan or a ScanGeometry."""


def geometry_record(scan: LaserScan | ScanGeometry) -> NDArray[np.void]:
    """Return a row of type SCAN_GEOMETRY, shape (1,)."""
    return np.array([geometry_values(scan)], SCAN_GEOMETRY)


@kernel
def sees(geometry: Record, ranges: FloatArray) -> bool:
    """Return whether there is a scan to plan with: two beams or more, not all zero, a sensible angle between them."""
    if len(ranges) < 2 or not _LEAST_INCREMENT < geometry.angle_increment < 2.0 * math.pi:
        return False
    for distance in ranges:  # noqa: SIM110  # numba compiles a loop sooner than a generator
        if distance > 0.0:
            return True
    return False


@kernel
def looks_ahead(geometry: Record, count: int) -> bool:
    """Return whether a scan of so many beams has some to both sides of straight ahead."""
    return bool(geometry.angle_min < 0.0 < geometry.angle_min + geometry.angle_increment * (count - 1))


@kernel
def bearing_of(geometry: Record, beam: float) -> float:
    """Return the bearing of a beam [rad]; a fraction is a position between two beams."""
    return float(geometry.angle_min + geometry.angle_increment * beam)


@kernel
def nearest_beam(angle_min: float, angle_increment: float, ahead: float, left: float) -> float:
    """Return the number of the beam whose bearing is nearest to that of a point; below 0 or beyond the last: no beam.

    That is the arctangent, rounded, to the bit, in a quarter of the time. A polynomial gives the bearing to 2e-6 rad
    (C. Hastings, Approximations for Digital Computers, 1955), which is enough except halfway between two beams.
    """
    low, high = min(abs(ahead), abs(left)), max(abs(ahead), abs(left))
    q = low / (high + 1e-300)
    s = q * q
    bearing = q * (
        0.99997726 + s * (-0.33262347 + s * (0.19354346 + s * (-0.11643287 + s * (0.05265332 + s * -0.01172120))))
    )
    bearing = 0.5 * math.pi - bearing if abs(left) > abs(ahead) else bearing
    bearing = math.pi - bearing if ahead < 0.0 else bearing
    beam = (math.copysign(bearing, left) - angle_min) / angle_increment
    nearest = np.rint(beam)
    if abs(beam - nearest) < 0.5 - 3e-6 / angle_increment:
        return float(nearest)
    return float(np.rint((math.atan2(left, ahead) - angle_min) / angle_increment))


@kernel
def beams_between(geometry: Record, count: int, right: float, left: float) -> tuple[int, int]:
    """Return the beams with bearings from `right` to `left` [rad], of so many: first, and last + 1."""
    first = math.ceil((right - geometry.angle_min) / geometry.angle_increment - 1e-6)
    end = math.floor((left - geometry.angle_min) / geometry.angle_increment + 1e-6) + 1
    first = min(max(first, 0), count)
    return first, min(max(end, first), count)


@kernel
def period_of(geometry: Record) -> float:
    """Return the time between commands [s]."""
    return geometry.scan_time if geometry.scan_time > 0.0 else _PERIOD
