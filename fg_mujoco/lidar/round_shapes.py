"""Spheres, capsules, ellipsoids and cylinders as beams meet them: where a ray enters each, in closed form.

A wall is made of triangles and a box of twelve of them, which `scanline` draws. The round parts of a car, its wheels,
axles and the LiDAR that it carries, are asked of each beam that may meet them. The equations are those of MuJoCo's own
rays (`mj_ray`), so that both agree to rounding: the nearest point ahead of the ray on the surface, from inside, too.
"""

from __future__ import annotations

import math

import mujoco
import numpy as np

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

def is_shape(kind: int) -> bool:
    """Return whether a geom of this mjtGeom is one of these shapes."""
    return kind in _KINDS


def shape_row(kind: int, size: FloatArray, position: FloatArray, rotation: FloatArray) -> FloatArray:
    """Return the numbers of a shape (SHAPE,): size (3,) [m]; position (3,) [m], rotation (3, 3) in its body's frame."""
    around = {0: size[0], 1: size[0] + size[1], 2: size.max(), 3: math.hypot(size[0], size[1])}[int(_KINDS[kind])]
    return np.concatenate(([_KINDS[kind]], size, position, rotation.ravel(), [around]))
