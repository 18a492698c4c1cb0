"""Clearance: the distance from the footprint of a car to walls and obstacles.

    nearest = least_clearance(poses, outline(box.corners()), car)    # [m]

The footprint is the rectangle of the chassis seen from above. The clearance is 0 where the two touch or overlap.
"""

from __future__ import annotations

import math

import numpy as np

from ..compiled.kernels import kernel
from ..messages import CarParameters, FloatArray


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
    return float(
        _least_clearance(
            np.ascontiguousarray(poses, np.float64), np.ascontiguousarray(placed, np.float64),
            0.5 * car.length - car.rear_overhang, 0.5 * car.length, 0.5 * car.width,
        )
    )  # fmt: skip


def clearances(poses: FloatArray, segments: FloatArray, car: CarParameters) -> FloatArray:
    """Return the same as `least_clearance`, but at each pose. Shape (n,) [m]."""
    found = np.empty(len(poses))
    _clearances(
        poses, segments if segments.ndim == 3 else segments[np.newaxis], 0.5 * car.length - car.rear_overhang,
        0.5 * car.length, 0.5 * car.width, found,
    )  # fmt: skip
    return found


@kernel
def rectangle_distance(ax: float, ay: float, bx: float, by: float, half_length: float, half_width: float) -> float:
    """Return the distance from a segment to a rectangle about the origin, its length along x; 0 where they overlap.

    Both are convex: where they are apart, the nearest two points are an end of the segment and a point of the
    rectangle, or a corner of the rectangle and a point of the segment.
    """
    along_x, along_y = bx - ax, by - ay
    # the part of the segment, from share `first` to share `last`, that is inside both strips (Liang and Barsky)
    first, last = 0.0, 1.0
    for start, step, half in ((ax, along_x, half_length), (ay, along_y, half_width)):
        if step == 0.0:
            if abs(start) > half:
                last = -1.0
        else:
            enter, leave = (-half - start) / step, (half - start) / step
            first, last = max(first, min(enter, leave)), min(last, max(enter, leave))
    if first <= last:
        return 0.0
    squared = math.inf
    for x, y in ((ax, ay), (bx, by)):
        away_x, away_y = max(abs(x) - half_length, 0.0), max(abs(y) - half_width, 0.0)
        squared = min(squared, away_x * away_x + away_y * away_y)
    length_squared = along_x * along_x + along_y * along_y
    if length_squared > 0.0:
        for x, y in (
            (half_length, half_width), (-half_length, half_width), (-half_length, -half_width),
            (half_length, -half_width),
        ):  # fmt: skip
            share = min(max(((x - ax) * along_x + (y - ay) * along_y) / length_squared, 0.0), 1.0)
            away_x, away_y = ax + share * along_x - x, ay + share * along_y - y
            squared = min(squared, away_x * away_x + away_y * away_y)
    return math.sqrt(squared)


@kernel
def _least_clearance(
    poses: FloatArray, segments: FloatArray, ahead: float, half_length: float, half_width: float
) -> float:
    """Return the least distance to segments, (1 or n, m, 4), of the rectangle whose middle is `ahead` of each pose."""
    least = math.inf
    reach = math.hypot(half_length, half_width)
    for i in range(len(poses)):
        cos, sin = math.cos(poses[i, 2]), math.sin(poses[i, 2])
        x, y = poses[i, 0] + ahead * cos, poses[i, 1] + ahead * sin
        placed = segments[i % len(segments)]
        for j in range(len(placed)):
            from_x, from_y, to_x, to_y = placed[j, 0] - x, placed[j, 1] - y, placed[j, 2] - x, placed[j, 3] - y
            # circles round both that are further apart than the nearest so far: most segments end here
            far = least + reach + 0.5 * math.hypot(to_x - from_x, to_y - from_y)
            middle_x, middle_y = 0.5 * (from_x + to_x), 0.5 * (from_y + to_y)
            if middle_x * middle_x + middle_y * middle_y > far * far:
                continue
            distance = rectangle_distance(
                from_x * cos + from_y * sin, from_y * cos - from_x * sin,
                to_x * cos + to_y * sin, to_y * cos - to_x * sin, half_length, half_width,
            )  # fmt: skip
            least = min(least, distance)
    return least


@kernel
def _clearances(
    poses: FloatArray, segments: FloatArray, ahead: float, half_length: float, half_width: float, found: FloatArray
) -> None:
    """Write to `found` (n,) the least distance at each pose."""
    for i in range(len(poses)):
        near = i % len(segments)
        found[i] = _least_clearance(poses[i : i + 1], segments[near : near + 1], ahead, half_length, half_width)
