"""Solids from cross-sections: a loft joins rings of points, a plate is a loft along z, a lathe one round an axis.

Lengths in metres; all return a trimesh.Trimesh, with its normals outwards where it is closed.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from fg_mujoco.messages import FloatArray

Outline = Sequence[tuple[float, float]]


def loft(rings: Any, *, around: bool = False, ends: tuple[bool, bool] = (True, True)) -> Any:
    """Return the trimesh of closed rings (k, n, 3) joined one to the next.

    Args:
      rings: points [m], each ring counterclockwise as seen from the last one.
      around: the last is joined to the first.
      ends: whether the first and the last are closed, unless joined.
    """
    import trimesh

    rings = np.asarray(rings, dtype=np.float64)
    k, n = rings.shape[:2]
    index = np.arange(k * n).reshape(k, n)
    low, high = (index, np.roll(index, -1, axis=0)) if around else (index[:-1], index[1:])
    a, b, c, d = low, np.roll(low, -1, axis=1), np.roll(high, -1, axis=1), high
    faces = [np.stack((a, b, c), axis=-1).reshape(-1, 3), np.stack((a, c, d), axis=-1).reshape(-1, 3)]
    for end, closed in zip((index[0][::-1], index[-1]), ends, strict=True):
        if closed and not around:
            fan = np.repeat(end[:1], n - 2)
            faces.append(np.column_stack((fan, end[1:-1], end[2:])))
    mesh = trimesh.Trimesh(rings.reshape(-1, 3), np.concatenate(faces), process=True)
    if mesh.is_watertight:
        mesh.fix_normals()
    return mesh


def rounded(corners: Outline, radius: float, steps: int = 3) -> FloatArray:
    """Return a polygon (n, 2) with its corners rounded by quadratic curves that begin `radius` [m] from each."""
    points = np.asarray(corners, dtype=np.float64)
    t = np.linspace(0.0, 1.0, steps)[:, None]
    result = []
    for before, corner, after in zip(np.roll(points, 1, axis=0), points, np.roll(points, -1, axis=0), strict=True):
        start, end = (
            corner + (other - corner) * min(radius / np.linalg.norm(other - corner), 0.49) for other in (before, after)
        )
        result.append((1 - t) ** 2 * start + 2 * t * (1 - t) * corner + t**2 * end)
    return np.concatenate(result)


def inset(outline: FloatArray, distance: float) -> FloatArray:
    """Return a counterclockwise polygon (n, 2) whose edges have moved inwards by `distance` [m]."""
    ahead = np.roll(outline, -1, axis=0) - outline
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    inwards = np.column_stack((-ahead[:, 1], ahead[:, 0]))
    both = inwards + np.roll(inwards, 1, axis=0)
    moved: FloatArray = outline + distance * 2.0 * both / (both**2).sum(axis=1, keepdims=True)
    return moved


def plate(outline: FloatArray, low: float, high: float, chamfer: float = 0.001) -> Any:
    """Return a plate between two heights [m]; the outline (n, 2) is seen from its middle, counterclockwise."""
    small = inset(outline, chamfer)
    levels = ((small, low), (outline, low + chamfer), (outline, high - chamfer), (small, high))
    return loft([np.column_stack((points, np.full(len(points), z))) for points, z in levels])


def block(x: float, y: float, low: float, high: float, length: float, width: float, radius: float = 0.003) -> Any:
    """Return an upright block with its middle at x, y, between two heights; all [m]."""
    a, b = 0.5 * length, 0.5 * width
    outline = rounded([(x - a, y - b), (x + a, y - b), (x + a, y + b), (x - a, y + b)], radius, 3)
    return plate(outline, low, high, min(0.001, 0.4 * (high - low)))


def cuboid(x: float, y: float, low: float, high: float, length: float, width: float) -> Any:
    """Return a block with sharp edges."""
    a, b = 0.5 * length, 0.5 * width
    outline = np.array([(x - a, y - b), (x + a, y - b), (x + a, y + b), (x - a, y + b)])
    return loft([np.column_stack((outline, np.full(4, z))) for z in (low, high)])


def lathe(profile: Outline, sections: int, *, closed: bool = False) -> Any:
    """Return the mesh of a profile of (radius, y) [m] turned round the y axis; a `closed` one is a ring."""
    angles = np.arange(sections) * 2.0 * np.pi / sections
    radius, y = np.array(profile).T
    rings = np.stack(
        [radius[:, None] * np.sin(angles), np.repeat(y[:, None], sections, 1), radius[:, None] * np.cos(angles)],
        axis=-1,
    )
    return loft(rings, around=closed)


def joined(*meshes: Any) -> Any:
    """Return several meshes as one."""
    import trimesh

    return trimesh.util.concatenate(list(meshes))


def mirrored(outline: Outline) -> list[tuple[float, float]]:
    """Return the closed outline of a right half (x, y <= 0), tail to nose, and its mirror image."""
    return [*outline, *((x, -y) for x, y in reversed(outline))]


def upright_lathe(profile: Outline, sections: int) -> Any:
    """Return a lathe round the z axis, of (radius, z)."""
    mesh = lathe(profile, sections)
    mesh.vertices = mesh.vertices[:, [0, 2, 1]]
    mesh.fix_normals()
    return mesh
