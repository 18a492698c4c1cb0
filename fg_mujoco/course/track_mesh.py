"""The walls of a track in 3D: convex pieces for contact, and one mesh of the same pieces for rays and pictures.

Each segment of a wall's polyline becomes one prism that stands on the ground. Its inner face is the segment itself.
Its ends lean along the bisectors at the segment's ends, so that neighbours meet without gap or overlap. Its back is
parallel to its face. A piece is thinner where there is no room for the full thickness, as at a sharp tip. The mesh
that is seen and the solids that are hit both come from `wall_prisms`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from .. import portable
from ..messages import FloatArray
from .polyline import crossings, segments, step_lengths, steps, turns

Surface = tuple[FloatArray, NDArray[np.intp]]
"""Vertices (v, 3) [m] and triangles (t, 3) of a mesh, normals outward."""

WALL_HEIGHT = 0.3  # [m] over the LiDAR's beams; the air ducts of RoboRacer tracks are 0.2 to 0.33 m
WALL_THICKNESS = 0.05  # [m] 2.5 times what a car at 8 m/s moves in a physics step of 2.5 ms

_MAX_LEAN = portable.tan(np.deg2rad(60.0))  # of an end that leans out, behind a corner: a longer spike serves nobody
_TAPER = 0.8  # share of the height at which leaning ends would meet that a piece may have
_HALVINGS = 40  # of a piece's thickness, from 5 cm to less than a float can tell apart

# Corners of a prism: the inner face's bottom edge 0-1, the back's 2-3, counterclockwise from above; 4-7 above 0-3.
_FRONT, _BACK, _TOP = ((0, 1, 5), (0, 5, 4)), ((2, 3, 7), (2, 7, 6)), ((4, 5, 6), (4, 6, 7))
_ENDS = (((1, 2, 6), (1, 6, 5)), ((3, 0, 4), (3, 4, 7)))


def wall_prisms(edges: Sequence[FloatArray]) -> FloatArray:
    """Return convex pieces of the walls of a circuit, one for each segment of its `Course.edges`.

    Returns:
      Corners of each piece, shape (m, 8, 3) [m]: 0 and 1 the bottom edge of the inner face, 2 and 3 that of the back,
      counterclockwise from above; 4 to 7 above 0 to 3.
    """
    return prisms_on(wall_feet(edges), WALL_HEIGHT)


def wall_feet(edges: Sequence[FloatArray], thickness: float = WALL_THICKNESS) -> FloatArray:
    """Return the footprints of the walls of a circuit of a thickness [m], as `wall_footprints` does. (m, 4, 2) [m]."""
    mirror = np.array([1.0, -1.0])  # the right wall is the left wall of the mirrored track, and turns the other way
    left, *islands = (wall_footprints(edge, thickness) for edge in (edges[0], *edges[2:]))
    right = wall_footprints(edges[1] * mirror, thickness)[:, [1, 0, 3, 2]] * mirror
    return np.concatenate((left, right, *islands))


def prisms_on(feet: FloatArray, height: float) -> FloatArray:
    """Return upright prisms of a height [m] on footprints (m, 4, 2) [m]. Shape (m, 8, 3) [m], as `wall_prisms`."""
    ground = np.zeros((*feet.shape[:2], 1))
    return np.concatenate((np.dstack((feet, ground)), np.dstack((feet, ground + height))), axis=1)


def wall_surface(edges: Sequence[FloatArray]) -> Surface:
    """Return vertices (v, 3) [m] and triangles (t, 3) of the faces of `wall_prisms` that can be seen, normals outward.

    The undersides are left out, and so are the ends where two pieces meet.
    """
    return prism_surface(wall_prisms(edges))


def prism_surface(prisms: FloatArray) -> Surface:
    """Return the same of any such prisms (m, 8, 3) [m]."""
    first = 8 * np.arange(len(prisms))[:, None, None]
    faces = [(first + np.array(face)).reshape(-1, 3) for face in (_FRONT, _BACK, _TOP)]
    bare_ends = open_ends(prisms[:, :4, :2])
    faces += [(first[bare] + np.array(end)).reshape(-1, 3) for bare, end in zip(bare_ends, _ENDS, strict=True)]
    return prisms.reshape(-1, 3), np.concatenate(faces)


def joined(surfaces: Iterable[Surface]) -> Surface:
    """Return several meshes as one."""
    vertices, faces = zip(*surfaces, strict=True)
    firsts = np.cumsum([0, *map(len, vertices[:-1])])
    return np.concatenate(vertices), np.concatenate([own + at for own, at in zip(faces, firsts, strict=True)])


def open_ends(feet: FloatArray) -> NDArray[np.bool_]:
    """Return whether no other footprint (m, 4, 2) [m] meets the end of each, and its start. Shape (2, m)."""
    seams = np.concatenate((feet[:, [1, 2]], feet[:, [0, 3]])).reshape(-1, 4)
    order = np.lexsort(np.round(seams, 9).T)
    ordered = np.round(seams, 9)[order]
    alike = (ordered[1:] == ordered[:-1]).all(axis=1)
    alone = np.empty(len(seams), bool)
    alone[order] = ~(np.append(alike, False) | np.append(False, alike))
    return alone.reshape(2, -1)


def wall_footprints(wall: FloatArray, thickness: float = WALL_THICKNESS) -> FloatArray:
    """Return the footprint of each piece of a closed wall (m, 2) [m] whose solid is to its left: segment, then back.

    Shape (m, 4, 2) [m], counterclockwise.
    """
    lengths = step_lengths(wall)
    ahead = steps(wall) / lengths[:, None]
    lean = np.minimum(-portable.tan(0.5 * turns(wall)), _MAX_LEAN)  # of the ends at each point, out positive
    lean_end = np.roll(lean, -1)
    depth = np.full(len(wall), thickness)
    narrowing = -(lean + lean_end)
    tapers = narrowing > 0.0
    depth[tapers] = np.minimum(thickness, _TAPER * lengths[tapers] / narrowing[tapers])
    left, end = np.column_stack((-ahead[:, 1], ahead[:, 0])), np.roll(wall, -1, axis=0)
    for _ in range(_HALVINGS):
        back_end = end + depth[:, None] * (left + lean_end[:, None] * ahead)
        back_start = wall + depth[:, None] * (left - lean[:, None] * ahead)
        feet = np.stack((wall, end, back_end, back_start), axis=1)
        blocked = _reach_another(feet, wall)
        if len(blocked) == 0:
            break
        depth[blocked] *= 0.5
    return feet


def _reach_another(feet: FloatArray, wall: FloatArray) -> np.ndarray:
    """Find the pieces whose back or ends cross a segment of the wall other than their own and its neighbours."""
    count = len(wall)
    edges = np.concatenate((feet[:, [1, 2]], feet[:, [2, 3]], feet[:, [3, 0]]))
    i, j = crossings(edges, segments(wall))
    apart = (j - i + 1) % count > 2
    return np.flatnonzero(np.bincount(i[apart] % count, minlength=count))
