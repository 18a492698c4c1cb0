"""Clearance: the distance from the footprint of a car to walls and obstacles.

    nearest = least_clearance(poses, outline(box.corners()), car)    # [m]

The footprint is the rectangle of the chassis seen from above. The clearance is 0 where the two touch or overlap.
"""

from __future__ import annotations

import numpy as np

from ..messages import CarParameters, FloatArray
from ..native import core

rectangle_distance = core.rectangle_distance
"""Of a segment and a rectangle about the origin."""


def least_clearance(poses: FloatArray, segments: FloatArray, car: CarParameters) -> float:
    """Return the least distance from the car's footprint to any segment at any pose [m], inf where there is none.

    Args:
      poses: of the rear axle, x [m], y [m], heading [rad]. Shape (n, 3).
      segments: x, y of one end and x, y of the other [m]: shape (m, 4) of what stands, or (n, m, 4) of what moves, as
        it is at each pose.
      car: whose footprint it is.
    """
    placed = segments if segments.ndim == 3 else segments[np.newaxis]
    if segments.ndim == 3 and len(segments) != len(poses):
        raise ValueError(f"segments at {len(segments)} poses; accepted: at each of the {len(poses)}")
    return core.least_clearance(
        np.ascontiguousarray(poses, np.float64), np.ascontiguousarray(placed, np.float64),
        0.5 * car.length - car.rear_overhang, 0.5 * car.length, 0.5 * car.width,
    )  # fmt: skip


def clearances(poses: FloatArray, segments: FloatArray, car: CarParameters) -> FloatArray:
    """Return the same as `least_clearance`, but at each pose. Shape (n,) [m]."""
    found = np.empty(len(poses))
    placed = segments if segments.ndim == 3 else segments[np.newaxis]
    core.clearances(
        np.ascontiguousarray(poses, np.float64), np.ascontiguousarray(placed, np.float64),
        0.5 * car.length - car.rear_overhang, 0.5 * car.length, 0.5 * car.width, found,
    )  # fmt: skip
    return found
