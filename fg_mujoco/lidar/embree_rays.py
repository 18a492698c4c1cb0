"""Distances along any rays through the visible geoms of a compiled model, by Embree.

Embree (through `embreex`) works in float32: it says which triangle a ray meets first. The distance to that triangle's
plane is then computed in float64, so that it agrees with MuJoCo's own rays to rounding.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..messages import FloatArray
from .body_poses import BodyPoses, rotated
from .round_shapes import bring_nearer
from .surfaces import Plane, Surfaces, visible_surfaces

Poses = tuple[FloatArray, FloatArray]
"""Of a body, one for each ray: positions (n, 3) [m] and unit quaternions wxyz (n, 4), world frame."""

_PARALLEL = 1e-15  # mjMINVAL: MuJoCo's rays miss a plane that they approach more slowly


class RayScene:
    """The surfaces of a model for rays: static geoms as one set of triangles, and one set for each body that moves.

    Static geoms are taken where the model has them now; what moves, mocap bodies included, is followed.

    Args:
      model: the compiled mujoco.MjModel.
      carrier: id of the body that the rays start from; no geom of its kinematic tree is seen.
      reach: how far surfaces are to be seen [m]; those beyond it may read inf.

    Raises:
      ModelError: a visible geom of a kind that cannot be seen, as a height field.

    Attributes:
      moving: ids of the bodies that move, in the order in which `distances` wants their poses.
    """

    def __init__(self, model: Any, *, carrier: int, reach: float) -> None:
        static, *moving = visible_surfaces(model, carrier)
        self._static = _Part(static, reach)
        self._moving = [_Part(surfaces, reach) for surfaces in moving]
        self.moving = tuple(surfaces.body for surfaces in moving)
        self._poses = BodyPoses(model, self.moving)

    def distances(
        self, data: Any, origins: FloatArray, directions: FloatArray, poses: Sequence[Poses] | None = None
    ) -> FloatArray:
        """Return the distance along each ray to the first surface, inf where there is none. Shape (n,) [m].

        Args:
          data: where the moving bodies are.
          origins: (n, 3) [m], world frame.
          directions: (n, 3) unit vectors, world frame.
          poses: of each moving body, where each ray finds it; None: all where `data` has them.
        """
        nearest = np.full(len(directions), np.inf)
        self._static.bring_nearer(nearest, origins, directions)
        if poses is not None:
            for part, (positions, quaternions) in zip(self._moving, poses, strict=True):
                back = quaternions * (1.0, -1.0, -1.0, -1.0)  # the other way round
                part.bring_nearer(nearest, rotated(origins - positions, back), rotated(directions, back))
            return nearest
        self._poses.read(data)
        for part, position, rotation in zip(self._moving, self._poses.positions, self._poses.rotations, strict=True):
            part.bring_nearer(nearest, (origins - position) @ rotation, directions @ rotation)
        return nearest


class _Part:
    """The surfaces of one body; rays in its frame."""

    def __init__(self, surfaces: Surfaces, reach: float) -> None:
        self._planes, self._shapes = surfaces.planes, surfaces.shapes
        self._triangles = _Triangles(surfaces, reach) if len(surfaces.triangles) else None

    def bring_nearer(self, nearest: FloatArray, origins: FloatArray, directions: FloatArray) -> None:
        """Lower `nearest` (n,) [m] to the distance of these surfaces, where they are nearer."""
        if self._triangles is not None:
            towards = self._triangles.ball_hits(origins, directions)
            if towards.size:
                found = self._triangles.distances(origins[towards], directions[towards])
                nearest[towards] = np.minimum(nearest[towards], found)
        for plane in self._planes:
            np.minimum(nearest, _plane_distances(plane, origins, directions), out=nearest)
        if len(self._shapes):
            bring_nearer(self._shapes, np.ascontiguousarray(origins), np.ascontiguousarray(directions), nearest)


class _Triangles:
    def __init__(self, surfaces: Surfaces, reach: float) -> None:
        from embreex.mesh_construction import TriangleMesh  # heavy, and only motion distortion wants it
        from embreex.rtcore_scene import EmbreeScene

        # Float32 is precise near 0, and tracks may lie hundreds of metres from the world's origin.
        vertices, triangles = surfaces.vertices, surfaces.triangles
        self._centre = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
        vertices = vertices - self._centre
        self._radius = float(np.linalg.norm(vertices, axis=1).max())
        corner, second, third = (vertices[triangles[:, i]] for i in range(3))
        self._normals = np.cross(second - corner, third - corner)
        self._offsets = np.einsum("ij,ij->i", self._normals, corner)
        self._scene = EmbreeScene(robust=True)  # watertight along shared edges
        self._mesh = TriangleMesh(self._scene, vertices.astype(np.float32), triangles)
        self._reach = 1.001 * reach  # so that float32 loses nothing; the caller cuts in float64

    def distances(self, origins: FloatArray, directions: FloatArray) -> FloatArray:
        origins = origins - self._centre
        hits = self._scene.run(origins.astype(np.float32), directions.astype(np.float32), dists=self._reach)
        normals = self._normals.take(hits, axis=0, mode="clip")
        distances: FloatArray = self._offsets.take(hits, mode="clip") - np.einsum("ij,ij->i", normals, origins)
        with np.errstate(divide="ignore", invalid="ignore"):
            distances /= np.einsum("ij,ij->i", normals, directions)
        np.fmax(distances, 0.0, out=distances)  # a ray may start on the surface, to rounding
        distances[hits < 0] = np.inf
        return distances

    def ball_hits(self, origins: FloatArray, directions: FloatArray) -> NDArray[np.intp]:
        """Indices of the rays that meet the ball around the triangles within reach."""
        to_centre = self._centre - origins
        along = np.einsum("ij,ij->i", to_centre, directions)
        across = np.einsum("ij,ij->i", to_centre, to_centre) - along * along
        half = 0.5 * self._reach
        return np.flatnonzero((np.abs(along - half) < half + self._radius) & (across <= self._radius**2))


def _plane_distances(plane: Plane, origins: FloatArray, directions: FloatArray) -> FloatArray:
    normal = plane.rotation[:, 2]
    approach = directions @ normal
    with np.errstate(all="ignore"):  # of rays along the plane, which `seen` leaves out
        distances = (plane.position @ normal - origins @ normal) / approach
    seen = (approach < -_PARALLEL) & (distances >= 0.0)
    for axis, half_size in enumerate(plane.half_sizes):
        if half_size > 0.0:
            across = plane.rotation[:, axis]
            place = (origins - plane.position) @ across + distances * (directions @ across)
            seen &= np.abs(place) <= half_size
    return np.where(seen, distances, np.inf)
