"""Surfaces for pictures: walls with texture coordinates, the road between them, and the box of a car.

A world's mesh `walls` is a list of prisms of eight corners (track_mesh.wall_prisms): the left wall's, then the right
wall's. From their inner edges follow both outlines of the road.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...course.polyline import enclosed_area, step_lengths
from ...messages import FloatArray

_MISFIT = 0.002  # of a road's area, that its triangles may cover too much or too little
_ROUND = np.cos(np.radians(40.0))  # walls that turn less at a joint are shaded as round


@dataclass(frozen=True, kw_only=True, eq=False)
class Surface:
    """Triangles with a texture coordinate and a normal at each vertex."""

    vertices: FloatArray  # (v, 3) [m]
    normals: FloatArray  # (v, 3)
    texture: FloatArray  # (v, 2) in tiles
    faces: NDArray[np.intp]  # (t, 3)


def wall_chains(prisms: FloatArray) -> list[FloatArray]:
    """Return the walls one by one, their prisms (m, 8, 3) turned to lie one behind the other: 0 to 1 is ahead."""
    ahead = _ends_meet(prisms[:, 1], prisms[:, 0])
    back = _ends_meet(prisms[:, 0], prisms[:, 1])
    chains, first = [], 0
    for i in range(len(prisms)):
        if i + 1 == len(prisms) or not (ahead[i] or back[i]):
            chain = prisms[first : i + 1]
            chains.append(chain if ahead[first] or len(chain) == 1 else chain[:, [1, 0, 3, 2, 5, 4, 7, 6]])
            first = i + 1
    return chains


def _ends_meet(ends: FloatArray, starts: FloatArray) -> NDArray[np.bool_]:
    """Say of each prism whether its end is the start of the next. Shape (m,)."""
    apart = np.abs(ends - np.roll(starts, -1, axis=0)).max(axis=1)
    return np.asarray(apart < 1e-9)


def wall_faces(chain: FloatArray) -> Surface:
    """Return both faces of a wall (m, 8, 3); tiles are 1 m long and as high as the wall."""
    along = _along(chain)
    pieces = []
    for low_start, low_end in ((0, 1), (3, 2)):
        quads = chain[:, [low_start, low_end, low_end + 4, low_start + 4]]
        normals = _facing(quads, quads.mean(axis=1) - chain.mean(axis=1))
        pieces.append((quads, _softened(normals), _tiles(along)))
    return _quads(pieces)


def wall_tops(chain: FloatArray) -> Surface:
    """Return the top of a wall (m, 8, 3); tiles are 1 m long."""
    quads = chain[:, 4:]
    normals = np.broadcast_to(np.array([0.0, 0.0, 1.0]), (*quads.shape[:2], 3))
    return _quads([(quads, normals, _tiles(_along(chain)))])


def road(left: FloatArray, right: FloatArray, tile: float = 2.0) -> Surface | None:
    """Return the road between two closed outlines (n, 2), (m, 2) [m] that run the same way.

    The two are joined like a zip fastener: of the two next triangles, that with the shorter cross edge. None where that
    does not cover what is between them: walls of a drawn map may be no ribbon at all.
    """
    start = int(np.linalg.norm(right - left[0], axis=1).argmin())
    right = np.roll(right, -start, axis=0)
    a, b = np.vstack((left, left[:1])), np.vstack((right, right[:1]))
    faces, i, j = [], 0, 0
    while i < len(left) or j < len(right):
        step_left = j == len(right) or (
            i < len(left) and np.sum((a[i + 1] - b[j]) ** 2) <= np.sum((a[i] - b[j + 1]) ** 2)
        )
        faces.append((i, len(a) + j, i + 1) if step_left else (i, len(a) + j, len(a) + j + 1))
        i, j = (i + 1, j) if step_left else (i, j + 1)
    points = np.vstack((a, b))
    vertices = np.column_stack((points, np.zeros(len(points))))
    up = np.broadcast_to(np.array([0.0, 0.0, 1.0]), vertices.shape)
    triangles = _upwards(vertices, np.array(faces))
    covered = sum(enclosed_area(points[triangle]) for triangle in triangles)
    between = abs(abs(enclosed_area(left)) - abs(enclosed_area(right)))
    if abs(covered - between) > _MISFIT * between:
        return None
    return Surface(vertices=vertices, normals=up, texture=points / tile, faces=triangles)


def strip_across(start: FloatArray, end: FloatArray, width: float, field: float) -> Surface:
    """Return a strip on the ground from one point to another (2,) [m], in square fields, two to a tile."""
    ahead = (end - start) / np.linalg.norm(end - start)
    aside = 0.5 * width * np.array([-ahead[1], ahead[0]])
    corners = np.array([start - aside, end - aside, end + aside, start + aside])
    length = max(round(np.linalg.norm(end - start) / field), 1) / 2.0
    across = max(round(width / field), 1) / 2.0
    texture = np.array([[0.0, 0.0], [length, 0.0], [length, across], [0.0, across]])
    vertices = np.column_stack((corners, np.zeros(4)))
    up = np.broadcast_to(np.array([0.0, 0.0, 1.0]), vertices.shape)
    return Surface(vertices=vertices, normals=up, texture=texture, faces=np.array([[0, 1, 2], [0, 2, 3]]))


def box_faces(side: float, height: float) -> Surface:
    """Return the sides of an upright box round the origin, and its top, square to the axes [m].

    Each side shows the whole texture, upright. The top shows the square in its middle, upright as seen from behind.
    """
    half, up = 0.5 * side, np.array([0.0, 0.0, 0.5 * height])
    normals = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]])
    whole = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    quads = []
    for normal in normals[:4]:
        right = half * np.cross((0.0, 0.0, 1.0), normal)  # as seen from outside
        quads.append(half * normal + np.array([-right - up, right - up, right + up, up - right]))
    quads.append(half * np.array([[-1.0, 1.0, 0.0], [-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0]]) + up)
    edge = 0.5 - 0.5 * side / height
    texture = [whole] * 4 + [np.column_stack((whole[:, 0], edge + (1.0 - 2.0 * edge) * whole[:, 1]))]
    return _quads([(np.array(quads), np.repeat(normals[:, None], 4, axis=1), np.array(texture))])


def nearest_on(line: FloatArray, point: FloatArray) -> FloatArray:
    """Return the point of a closed polyline (n, 2) that is nearest to a point (2,) [m]."""
    ends = np.roll(line, -1, axis=0)
    share = ((point - line) * (ends - line)).sum(axis=1) / np.maximum(step_lengths(line) ** 2, 1e-12)
    feet = line + share.clip(0.0, 1.0)[:, None] * (ends - line)
    nearest: FloatArray = feet[((feet - point) ** 2).sum(axis=1).argmin()]
    return nearest


def _along(chain: FloatArray) -> FloatArray:
    """Return the distance of each joint along a wall (m, 8, 3), stretched to whole tiles of 1 m. Shape (m + 1,)."""
    lengths = np.linalg.norm(chain[:, 1, :2] - chain[:, 0, :2], axis=1)
    along = np.concatenate(([0.0], np.cumsum(lengths)))
    stretched: FloatArray = along * max(round(along[-1]), 1) / along[-1]
    return stretched


def _tiles(along: FloatArray) -> FloatArray:
    """Return the texture's coordinates at the corners of quads in a row: start, end, end, start. Shape (m, 4, 2)."""
    texture = np.empty((len(along) - 1, 4, 2))
    texture[:, [0, 3], 0], texture[:, [1, 2], 0] = along[:-1, None], along[1:, None]
    texture[:, [0, 1], 1], texture[:, [2, 3], 1] = 0.0, 1.0
    return texture


def _facing(quads: FloatArray, outwards: FloatArray) -> FloatArray:
    """Return the unit normals of quads (m, 4, 3) on the side of `outwards` (m, 3)."""
    normals = np.cross(quads[:, 1] - quads[:, 0], quads[:, 3] - quads[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    facing: FloatArray = normals * np.sign((normals * outwards).sum(axis=1, keepdims=True))
    return facing


def _softened(normals: FloatArray) -> FloatArray:
    """Return the normals at the corners of a closed row of quads (m, 4, 3): means over joints that turn little."""
    before, after = np.roll(normals, 1, axis=0), np.roll(normals, -1, axis=0)
    result = np.repeat(normals[:, None], 4, axis=1)
    for other, corners in ((before, [0, 3]), (after, [1, 2])):
        mean = normals + other
        mean /= np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-12)
        soft = (normals * other).sum(axis=1) > _ROUND
        for corner in corners:
            result[soft, corner] = mean[soft]
    return result


def _quads(pieces: list[tuple[FloatArray, FloatArray, FloatArray]]) -> Surface:
    vertices, normals, texture = (
        np.concatenate(parts).reshape(-1, parts[0].shape[-1]) for parts in zip(*pieces, strict=True)
    )
    first = 4 * np.arange(len(vertices) // 4)[:, None]
    faces = np.concatenate((first + np.array([0, 1, 2]), first + np.array([0, 2, 3])))
    turned = np.cross(vertices[faces[:, 1]] - vertices[faces[:, 0]], vertices[faces[:, 2]] - vertices[faces[:, 0]])
    wrong = (turned * normals[faces[:, 0]]).sum(axis=1) < 0.0
    faces[wrong] = faces[wrong][:, ::-1]
    return Surface(vertices=vertices, normals=normals, texture=texture, faces=faces)


def _upwards(vertices: FloatArray, faces: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return triangles with their front to the sky."""
    a, b, c = (vertices[faces[:, k], :2] for k in range(3))
    down = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0]) < 0.0
    faces[down] = faces[down][:, ::-1]
    return faces
