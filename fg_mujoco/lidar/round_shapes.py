"""Spheres, capsules, ellipsoids and cylinders as beams meet them: where a ray enters each, in closed form.

A wall is made of triangles and a box of twelve of them, which `scanline` draws. The round parts of a car, its wheels,
axles and the LiDAR that it carries, are asked of each beam that may meet them. The equations are those of MuJoCo's own
rays (`mj_ray`), so that both agree to rounding: the nearest point ahead of the ray on the surface, from inside, too.
"""

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np

from ..compiled.kernels import kernel
from ..messages import FloatArray

_KINDS = {
    int(mujoco.mjtGeom.mjGEOM_SPHERE): 0.0,
    int(mujoco.mjtGeom.mjGEOM_CAPSULE): 1.0,
    int(mujoco.mjtGeom.mjGEOM_ELLIPSOID): 2.0,
    int(mujoco.mjtGeom.mjGEOM_CYLINDER): 3.0,
}
SHAPE = 17
"""Numbers of a shape: kind, sizes as of its geom [m], position [m], rotation row by row, radius of the sphere around it
[m]; position and rotation in the frame of its body."""

_NUMERICALLY_NONE = 1e-15  # mjMINVAL: of a ray that only grazes, or runs along a flat side


def is_shape(kind: int) -> bool:
    """Return whether a geom of this mjtGeom is one of these shapes."""
    return kind in _KINDS


def shape_row(kind: int, size: FloatArray, position: FloatArray, rotation: FloatArray) -> FloatArray:
    """Return the numbers of a shape (SHAPE,): size (3,) [m]; position (3,) [m], rotation (3, 3) in its body's frame."""
    around = {0: size[0], 1: size[0] + size[1], 2: size.max(), 3: math.hypot(size[0], size[1])}[int(_KINDS[kind])]
    return np.concatenate(([_KINDS[kind]], size, position, rotation.ravel(), [around]))


@kernel
def ray_distance(
    kind: float, a: float, b: float, c: float, px: float, py: float, pz: float, vx: float, vy: float, vz: float
) -> float:
    """Return how far a ray from p [m] along v goes, in the frame of a shape of sizes a, b, c [m]; -1: it misses."""
    if kind == 0.0:
        first, second = _roots(1.0, px * vx + py * vy + pz * vz, px * px + py * py + pz * pz - a * a)
        return first if first >= 0.0 else second
    if kind == 2.0:
        sx, sy, sz = 1.0 / (a * a), 1.0 / (b * b), 1.0 / (c * c)
        first, second = _roots(
            sx * vx * vx + sy * vy * vy + sz * vz * vz,
            sx * px * vx + sy * py * vy + sz * pz * vz,
            sx * px * px + sy * py * py + sz * pz * pz - 1.0,
        )
        return first if first >= 0.0 else second
    nearest = math.inf
    first, second = _roots(vx * vx + vy * vy, px * vx + py * vy, px * px + py * py - a * a)
    side = first if first >= 0.0 else second
    if side >= 0.0 and abs(pz + side * vz) <= b:
        nearest = side
    for end in (-1.0, 1.0):
        away = pz - end * b
        if kind == 1.0:  # half a sphere
            first, second = _roots(1.0, px * vx + py * vy + away * vz, px * px + py * py + away * away - a * a)
            if first >= 0.0 and end * (away + first * vz) >= 0.0:
                nearest = min(nearest, first)
            if second >= 0.0 and end * (away + second * vz) >= 0.0:
                nearest = min(nearest, second)
        elif abs(vz) > _NUMERICALLY_NONE:
            flat = -away / vz
            x, y = px + flat * vx, py + flat * vy
            if flat >= 0.0 and x * x + y * y <= a * a:
                nearest = min(nearest, flat)
    return nearest if nearest < math.inf else -1.0


@kernel
def _roots(a: float, b: float, c: float) -> tuple[float, float]:
    """Return both solutions of a t^2 + 2 b t + c = 0, the lesser first; -1 where there are none."""
    under = b * b - a * c
    if under < _NUMERICALLY_NONE or a < _NUMERICALLY_NONE:
        return -1.0, -1.0
    root = math.sqrt(under)
    return (-b - root) / a, (-b + root) / a


@kernel
def into_shape(row: Any, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Turn a vector of the body's frame into a shape's."""
    return (
        row[7] * x + row[10] * y + row[13] * z,
        row[8] * x + row[11] * y + row[14] * z,
        row[9] * x + row[12] * y + row[15] * z,
    )
