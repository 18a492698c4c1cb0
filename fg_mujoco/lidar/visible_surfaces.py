"""The visible surfaces of a model as flat arrays, prepared for the beams of one LiDAR: what `scanline.scan` draws."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..messages import FloatArray
from .beams import Beams
from .clusters import make_clusters
from .surfaces import Plane, Surfaces, visible_surfaces

BINS = 64  # of distance, into which a scan sorts the clusters
NO_END = 1e300  # [m] half-size of a plane without end
_LEAST_STEP = 1e-4  # [rad] between beams, so that culling.bearing tells which two a point is between
_IN_PLANE = 1e-12  # of directions [-] and origins [m]


class SceneArrays(NamedTuple):
    """Input of a scan: one LiDAR's beams and the surfaces of one model. Read-only; all worlds of a model share it.

    Frame 0 is the world's, the others are those of ScanlineScene.moving. Clusters, planes and shapes lie frame after
    frame. The tree of a frame is the id of the body at the root of its kinematic tree.
    """

    beams: FloatArray  # (2, n) cosine and sine of each beam's bearing
    limits: FloatArray  # (4,) angle_min [rad], angle_increment [rad], range_min [m], range_max [m]
    edges: FloatArray  # (6, e) [m] as in clusters.Clusters, and so the next three
    triangles: NDArray[np.uint16]  # (t, 3)
    boxes: FloatArray  # (7, b) [m]
    spans: NDArray[np.int32]  # (b, 5) the fifth is the frame
    planes: FloatArray  # (p, 14) position, rotation row by row, half-sizes [m]
    frames: NDArray[np.int32]  # (f, 7) first cluster, behind the last; first plane, behind; first shape, behind; tree
    shapes: FloatArray  # (k, SHAPE) see round_shapes.py
    spheres: FloatArray  # (f, 4) centre and radius of a sphere around what moves [m]; a radius without end for planes


class Scratch(NamedTuple):
    """Working arrays of a scan: one set for each thread."""

    cuts: FloatArray  # (2, k) [m] where the scan plane cuts each edge of a cluster, in the LiDAR's frame
    columns: NDArray[np.int32]  # (k,) the first beam at or to the left of each cut
    nearest: FloatArray  # (b,) [m] to the box around each cluster
    views: NDArray[np.int32]  # (3, b) of each cluster, first beam and the one behind the last that may meet it; order
    bins: NDArray[np.int32]  # (BINS + 1,) how many clusters lie nearer than each bin
    poses: FloatArray  # (f, 12) of the LiDAR in each frame: position [m], then the rotation into the LiDAR's frame


class ScanlineScene:
    """The visible surfaces of a model, prepared for the beams of one LiDAR, a scanline: `arrays` for `scanline.scan`.

    Static geoms are taken where the model has them now; the bodies `moving` are followed, mocap bodies included.

    Args:
      carrier: id of the body that the beams start from; no geom of its kinematic tree is seen. None: all are in the
        scene, and each scan says whose tree it leaves out.

    Raises:
      ModelError: a visible geom of a kind that cannot be seen, as a height field.
    """

    def __init__(self, model: Any, beams: Beams, carrier: int | None) -> None:
        surfaces = visible_surfaces(model, carrier)
        self.moving = tuple(part.body for part in surfaces[1:])
        clusters = [make_clusters(part.vertices, part.triangles) for part in surfaces]
        planes = [_plane_row(plane) for part in surfaces for plane in part.planes]
        spans, frames = [], []
        edge = triangle = cluster = plane = shape = 0
        for frame, (part, own) in enumerate(zip(surfaces, clusters, strict=True)):
            spans.append(np.insert(own.spans + np.array((edge, edge, triangle, triangle)), 4, frame, axis=1))
            behind = (cluster + len(own.spans), plane + len(part.planes), shape + len(part.shapes))
            tree = int(model.body_rootid[part.body])
            frames.append((cluster, behind[0], plane, behind[1], shape, behind[2], tree))
            edge, triangle = edge + own.edges.shape[1], triangle + len(own.triangles)
            cluster, plane, shape = behind
        self.arrays = SceneArrays(
            beams=beams.in_plane,
            limits=_fixed([beams.angle_min, beams.angle_increment, beams.range_min, beams.range_max]),
            edges=_fixed(np.concatenate([own.edges for own in clusters], axis=1)),
            triangles=_fixed(np.concatenate([own.triangles for own in clusters]), np.uint16),
            boxes=_fixed(np.concatenate([own.boxes for own in clusters], axis=1)),
            spans=_fixed(np.concatenate(spans), np.int32),
            planes=_fixed(np.reshape(planes, (-1, 14))),
            frames=_fixed(frames, np.int32),
            shapes=_fixed(np.concatenate([part.shapes for part in surfaces])),
            spheres=_fixed([_sphere_around(part) for part in surfaces]),
        )

    def scratch(self) -> Scratch:
        """Return room for the scans of one thread."""
        spans = self.arrays.spans
        longest = int((spans[:, 1] - spans[:, 0]).max(initial=0))
        return Scratch(
            cuts=np.empty((2, longest)),
            columns=np.empty(longest, np.int32),
            nearest=np.empty(len(spans)),
            views=np.empty((3, len(spans)), np.int32),
            bins=np.empty(BINS + 1, np.int32),
            poses=np.empty((len(self.arrays.frames), 12)),
        )


def is_scanline(beams: Beams) -> bool:
    """Return whether all beams start at the LiDAR's origin in its x-y plane, evenly spaced to the left, in one turn."""
    even = beams.angle_min + beams.angle_increment * np.arange(len(beams.bearings))
    return bool(
        np.abs(beams.origins).max() < _IN_PLANE
        and np.abs(beams.directions[:, 2]).max() < _IN_PLANE
        and np.abs(beams.bearings).max() <= math.pi
        and _LEAST_STEP < beams.angle_increment < 1.0
        and np.abs(beams.bearings - even).max() < 1e-3 * beams.angle_increment
    )


def _sphere_around(part: Surfaces) -> FloatArray:
    """Return centre and radius of a sphere around the surfaces of a body [m]. Shape (4,)."""
    if part.body == 0 or part.planes:
        return np.array((0.0, 0.0, 0.0, NO_END))
    centres = np.concatenate((part.vertices, part.shapes[:, 4:7]))
    radii = np.concatenate((np.zeros(len(part.vertices)), part.shapes[:, -1]))
    centre = 0.5 * ((centres - radii[:, None]).min(axis=0) + (centres + radii[:, None]).max(axis=0))
    radius = float((np.linalg.norm(centres - centre, axis=1) + radii).max())
    return np.append(centre, radius * (1.0 + 1e-9) + 1e-9)


def _plane_row(plane: Plane) -> FloatArray:
    half_sizes = np.where(plane.half_sizes > 0.0, plane.half_sizes, NO_END)
    return np.concatenate((plane.position, plane.rotation.ravel(), half_sizes))


def _fixed(values: Any, kind: Any = np.float64) -> Any:
    array = np.array(values, dtype=kind, order="C")
    array.flags.writeable = False
    return array
