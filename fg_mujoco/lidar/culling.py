"""The clusters that a scan skips: off the scan plane, out of range, behind the LiDAR, or hidden by nearer surfaces."""

from __future__ import annotations

import math

import numpy as np

from ..compiled.kernels import kernel
from ..messages import FloatArray
from .visible_surfaces import BINS, SceneArrays, Scratch

TINY = 1e-300
_BLOCK = 64  # beams
_FAR = 1e9  # [m] of a cluster that is not to be drawn

Pose = tuple[float, ...]
"""Of the LiDAR in a frame: 3 of position [m], 9 of the rotation into the LiDAR's frame, row by row."""


@kernel
def bearing(x: float, y: float) -> float:
    """Return the bearing of a point to 2e-6 rad. Source: Hastings, Approximations for digital computers, 1955."""
    low, high = min(abs(x), abs(y)), max(abs(x), abs(y))
    q = low / (high + TINY)
    s = q * q
    angle = q * (
        0.99997726 + s * (-0.33262347 + s * (0.19354346 + s * (-0.11643287 + s * (0.05265332 + s * -0.01172120))))
    )
    angle = 0.5 * math.pi - angle if abs(y) > abs(x) else angle
    angle = math.pi - angle if x < 0.0 else angle
    return angle if y >= 0.0 else -angle


@kernel
def survey(scene: SceneArrays, pose: Pose, first: int, behind: int, scratch: Scratch) -> None:
    """Write how far the box around each cluster is, _FAR where the scan plane misses it, and which beams may meet it.

    The plane cuts the box inside the circle of the box's half diagonal about the centre's place in the plane; it is
    seen under asin(radius / distance) to either side, at most ratio + (pi/2 - 1) ratio^3.
    """
    ox, oy, oz, xx, xy, xz, yx, yy, yz, zx, zy, zz = pose
    per_radian = 1.0 / scene.limits[1]
    angle_min = scene.limits[0]
    boxes = scene.boxes
    centre_x, centre_y, centre_z = boxes[0, first:behind], boxes[1, first:behind], boxes[2, first:behind]
    half_x, half_y, half_z = boxes[3, first:behind], boxes[4, first:behind], boxes[5, first:behind]
    radius = boxes[6, first:behind]
    nearest = scratch.nearest[first:behind]
    rightmost, behind_leftmost = scratch.views[0, first:behind], scratch.views[1, first:behind]
    for i in range(len(radius)):
        cx, cy, cz = centre_x[i] - ox, centre_y[i] - oy, centre_z[i] - oz
        x = xx * cx + xy * cy + xz * cz
        y = yx * cx + yy * cy + yz * cz
        z = zx * cx + zy * cy + zz * cz
        thickness = abs(zx) * half_x[i] + abs(zy) * half_y[i] + abs(zz) * half_z[i]
        gap_x, gap_y, gap_z = abs(cx) - half_x[i], abs(cy) - half_y[i], abs(cz) - half_z[i]
        gap_x = gap_x if gap_x > 0.0 else 0.0
        gap_y = gap_y if gap_y > 0.0 else 0.0
        gap_z = gap_z if gap_z > 0.0 else 0.0
        distance = math.sqrt(gap_x * gap_x + gap_y * gap_y + gap_z * gap_z)
        ratio = radius[i] / (math.sqrt(x * x + y * y) + TINY)
        spread = (ratio + 0.5708 * ratio * ratio * ratio) * per_radian
        spread = spread if ratio < 1.0 else 1e6
        middle = (bearing(x, y) - angle_min) * per_radian
        nearest[i] = distance if abs(z) <= thickness + 1e-9 else _FAR
        rightmost[i] = np.int32(middle - spread - 2.0)
        behind_leftmost[i] = np.int32(middle + spread + 3.0)


@kernel
def skip(first: int, behind: int, scratch: Scratch) -> None:
    """Leave some clusters out of a scan."""
    for cluster in range(first, behind):
        scratch.nearest[cluster] = _FAR
        scratch.views[0, cluster] = scratch.views[1, cluster] = 0


@kernel
def sort_by_distance(scene: SceneArrays, scratch: Scratch) -> int:
    """Write the clusters in range and in view, near ones first, to views[2]; return how many they are."""
    nearest, views, bins = scratch.nearest, scratch.views, scratch.bins
    beams, turn, range_max = scene.beams.shape[1], whole_turn(scene), scene.limits[3]
    for bin_ in range(len(bins)):
        bins[bin_] = 0
    for cluster in range(len(nearest)):
        right, left = views[0, cluster], views[1, cluster]
        in_view = (right < beams and left > 0) or right + turn < beams or left - turn > 0
        if nearest[cluster] < range_max and in_view:
            bins[min(int(nearest[cluster] * (BINS / range_max)), BINS - 1) + 1] += 1
        else:
            nearest[cluster] = _FAR
    for bin_ in range(BINS):
        bins[bin_ + 1] += bins[bin_]
    count = int(bins[BINS])
    for cluster in range(len(nearest)):
        if nearest[cluster] < range_max:
            bin_ = min(int(nearest[cluster] * (BINS / range_max)), BINS - 1)
            views[2, bins[bin_]] = cluster
            bins[bin_] += 1
    return count


@kernel
def whole_turn(scene: SceneArrays) -> int:
    """Return the greatest number of beams of a full turn."""
    return int(math.tau / scene.limits[1])


@kernel
def is_hidden(right: int, left: int, nearest: float, turn: int, out: FloatArray) -> bool:
    """Return whether `out` (beams,) [1/m] is nearer than `nearest` [m] in all views `right` to `left` of a cluster."""
    beams, inverse = len(out), (1.0 + 1e-9) / (nearest + TINY)
    return (
        _all_above(out, max(right, 0), min(left, beams), inverse)
        and _all_above(out, max(right + turn, 0), beams, inverse)  # what goes on beyond straight behind
        and _all_above(out, 0, min(left - turn, beams), inverse)
    )


@kernel
def _all_above(values: FloatArray, first: int, behind: int, limit: float) -> bool:
    """Return whether none of some values is below a limit: by blocks, whose values are compared eight at a time."""
    start, end = np.uintp(first), np.uintp(max(first, behind))
    while start < end:
        below, block_end = 0, min(start + np.uintp(_BLOCK), end)
        for i in range(start, block_end):
            below += values[i] < limit
        if below > 0:
            return False
        start = block_end
    return True
