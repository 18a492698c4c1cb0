"""Simple shapes that are added to a single picture, not to a model. Lengths in metres, colours RGBA from 0 to 1."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import mujoco
import numpy as np

from ...messages import FloatArray

Colour = Sequence[float]

_NO_MATRIX = np.eye(3).ravel()
_GLOW = 0.7  # of its own colour that a shape shows whatever the light
_ZERO = np.zeros(3)


def _new(scene: mujoco.MjvScene, kind: mujoco.mjtGeom, colour: Colour) -> mujoco.MjvGeom | None:
    """Return the next free geom of the scene; None where it is full: shapes added later are left out."""
    if scene.ngeom >= scene.maxgeom:
        return None
    geom = scene.geoms[scene.ngeom]
    mujoco.mjv_initGeom(geom, kind, _ZERO, _ZERO, _NO_MATRIX, np.asarray(colour, dtype=np.float32))
    geom.category = mujoco.mjtCatBit.mjCAT_DECOR
    geom.emission, geom.specular, geom.shininess = _GLOW, 0.0, 0.0
    scene.ngeom += 1
    return geom


def line(scene: mujoco.MjvScene, pixels: float, start: FloatArray, end: FloatArray, colour: Colour) -> None:
    """Add a line so many pixels wide between two points (3,)."""
    geom = _new(scene, mujoco.mjtGeom.mjGEOM_LINE, colour)
    if geom is not None:
        mujoco.mjv_connector(geom, mujoco.mjtGeom.mjGEOM_LINE, pixels, start, end)


def triangle(scene: mujoco.MjvScene, a: FloatArray, b: FloatArray, c: FloatArray, colour: Colour) -> None:
    """Add a triangle with corners (3,), seen from above."""
    geom = _new(scene, mujoco.mjtGeom.mjGEOM_TRIANGLE, colour)
    if geom is not None:
        geom.pos, geom.size = a, (1.0, 1.0, 1.0)
        geom.mat = np.column_stack((b - a, c - a, (0.0, 0.0, 1.0)))


def disc(scene: mujoco.MjvScene, centre: FloatArray, radius: float, colour: Colour, pieces: int = 28) -> None:
    """Add a flat disc of some sectors."""
    rim = _circle(centre, radius, pieces)
    for start, end in pairwise(rim):
        triangle(scene, centre, start, end, colour)


def ring(
    scene: mujoco.MjvScene, centre: FloatArray, radius: float, width: float, colour: Colour, pieces: int = 28
) -> None:
    """Add a circle of flat pieces of some width."""
    for start, end in pairwise(_circle(centre, radius, pieces)):
        slat(scene, start, end, width, colour)


def _circle(centre: FloatArray, radius: float, pieces: int) -> FloatArray:
    """Return the corners of a circle, the first once more at the end. Shape (pieces + 1, 3) [m]."""
    angles = np.arange(pieces + 1) * 2.0 * np.pi / pieces
    points: FloatArray = centre + radius * np.column_stack((np.cos(angles), np.sin(angles), np.zeros(pieces + 1)))
    return points


def slat(scene: mujoco.MjvScene, start: FloatArray, end: FloatArray, width: float, colour: Colour) -> None:
    """Add a flat piece on the ground from one point to another."""
    along = end - start
    length = float(np.hypot(along[0], along[1]))
    if length < 1e-9:
        return
    geom = _new(scene, mujoco.mjtGeom.mjGEOM_BOX, colour)
    if geom is not None:
        cos, sin = along[0] / length, along[1] / length
        geom.pos, geom.size = 0.5 * (start + end), (0.5 * length + 0.25 * width, 0.5 * width, 0.0005)
        geom.mat = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])


def sphere(scene: mujoco.MjvScene, centre: FloatArray, radius: float, colour: Colour) -> None:
    """Add a sphere."""
    geom = _new(scene, mujoco.mjtGeom.mjGEOM_SPHERE, colour)
    if geom is not None:
        geom.pos, geom.size = centre, (radius, radius, radius)
