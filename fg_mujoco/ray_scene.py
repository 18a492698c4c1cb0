"""Distances along rays through the visible geoms of a compiled model, by Embree.

Embree (through `embreex`) works in float32: it says which triangle a ray meets first. The distance to that triangle's
plane is then computed in float64, so that it agrees with MuJoCo's own rays to rounding.

The geoms are those that MuJoCo's rays see: not the transparent ones (alpha 0 of the material, or of the geom where it
has no material), any group, both sides of a mesh, the front of a plane.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from .errors import ModelError
from .messages import FloatArray

_PARALLEL = 1e-15  # mjMINVAL: MuJoCo's rays miss a plane that they approach more slowly

# Corners of the box of half-sizes 1, and its sides as triangles.
_BOX_CORNERS = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
_BOX_SIDES = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
_BOX_TRIANGLES = np.concatenate((_BOX_SIDES[:, [0, 1, 2]], _BOX_SIDES[:, [0, 2, 3]])).astype(np.int32)


class RayScene:
    """What rays meet in a model: static geoms as one set of triangles, and one set for each body that moves.

    Static geoms are taken where the model has them now; what moves, mocap bodies included, is followed.

    Args:
      model: the compiled mujoco.MjModel.
      carrier: id of the body that the rays start from; no geom of its kinematic tree is seen.
      reach: how far surfaces are to be seen [m]; those beyond it may read inf.

    Raises:
      ModelError: a visible geom that is neither mesh, box nor plane.
    """

    def __init__(self, model: Any, *, carrier: int, reach: float) -> None:
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        shapes: dict[int, list[tuple[FloatArray, NDArray[np.int32]]]] = {}
        self._planes: list[_Plane] = []
        for geom in _visible_geoms(model, carrier):
            body = int(model.body_weldid[model.geom_bodyid[geom]])  # 0 for all that never moves
            position, rotation = data.geom_xpos[geom], data.geom_xmat[geom].reshape(3, 3)
            if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_PLANE:
                self._planes.append(_Plane(position.copy(), rotation.copy(), model.geom_size[geom, :2].copy()))
                continue
            vertices, triangles = _geom_triangles(model, geom)
            from_body = position + vertices @ rotation.T - data.xpos[body]
            shapes.setdefault(body, []).append((from_body @ data.xmat[body].reshape(3, 3), triangles))
        self._reach = reach
        self._static = _Triangles(shapes.pop(0), reach) if 0 in shapes else None
        self._moving = {body: _Triangles(parts, reach) for body, parts in shapes.items()}

    def distances(self, data: Any, origins: FloatArray, directions: FloatArray) -> FloatArray:
        """Return the distance along each ray to the first surface, inf where there is none. Shape (n,) [m].

        Args:
          data: where the moving bodies are.
          origins: (n, 3) [m], world frame.
          directions: (n, 3) unit vectors, world frame.
        """
        if self._static is None:
            nearest = np.full(len(directions), np.inf)
        else:
            nearest = self._static.distances(origins, directions)
        for plane in self._planes:
            np.minimum(nearest, plane.distances(origins, directions), out=nearest)
        for body, triangles in self._moving.items():
            rotation = data.xmat[body].reshape(3, 3)
            local_origins, local_directions = (origins - data.xpos[body]) @ rotation, directions @ rotation
            towards = triangles.ball_hits(local_origins, local_directions, self._reach)
            if towards.size:
                found = triangles.distances(local_origins[towards], local_directions[towards])
                nearest[towards] = np.minimum(nearest[towards], found)
        return nearest


class _Triangles:
    """Triangles that stand still in one frame."""

    def __init__(self, parts: list[tuple[FloatArray, NDArray[np.int32]]], reach: float) -> None:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        vertices = np.concatenate([part for part, _ in parts])
        first = np.cumsum([0] + [len(part) for part, _ in parts])
        triangles = np.concatenate([part + start for (_, part), start in zip(parts, first, strict=False)])
        # Float32 is precise near 0, and tracks may lie hundreds of metres from the world's origin.
        self._centre = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
        vertices = vertices - self._centre
        self._radius = float(np.linalg.norm(vertices, axis=1).max())
        corner, second, third = (vertices[triangles[:, i]] for i in range(3))
        self._normals = np.cross(second - corner, third - corner)
        self._offsets = np.einsum("ij,ij->i", self._normals, corner)
        self._scene = EmbreeScene(robust=True)  # watertight along shared edges
        self._mesh = TriangleMesh(self._scene, vertices.astype(np.float32), triangles.astype(np.int32))
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

    def ball_hits(self, origins: FloatArray, directions: FloatArray, reach: float) -> NDArray[np.intp]:
        """Indices of the rays that meet the ball around the triangles within `reach`."""
        to_centre = self._centre - origins
        along = np.einsum("ij,ij->i", to_centre, directions)
        across = np.einsum("ij,ij->i", to_centre, to_centre) - along * along
        return np.flatnonzero((np.abs(along - 0.5 * reach) < 0.5 * reach + self._radius) & (across <= self._radius**2))


@dataclass(frozen=True)
class _Plane:
    """A plane geom, seen from its front only; a rectangle where `half_sizes` are positive."""

    position: FloatArray  # (3,) [m]
    rotation: FloatArray  # (3, 3), columns x, y, normal
    half_sizes: FloatArray  # (2,) [m], 0 for no end

    def distances(self, origins: FloatArray, directions: FloatArray) -> FloatArray:
        normal = self.rotation[:, 2]
        approach = directions @ normal
        with np.errstate(all="ignore"):  # of rays along the plane, which `seen` leaves out
            distances = (self.position @ normal - origins @ normal) / approach
        seen = (approach < -_PARALLEL) & (distances >= 0.0)
        for axis, half_size in enumerate(self.half_sizes):
            if half_size > 0.0:
                across = self.rotation[:, axis]
                place = (origins - self.position) @ across + distances * (directions @ across)
                seen &= np.abs(place) <= half_size
        return np.where(seen, distances, np.inf)


def _visible_geoms(model: Any, carrier: int) -> list[int]:
    if model.nflex:
        raise ModelError(
            f"the model has {model.nflex} flex objects, which the LiDAR back end 'raycast' cannot see; accepted: none, "
            "or the back end 'rangefinder'"
        )
    own = model.body_rootid[model.geom_bodyid] == model.body_rootid[carrier]
    alpha = model.geom_rgba[:, 3].copy()
    with_material = model.geom_matid >= 0
    alpha[with_material] = model.mat_rgba[model.geom_matid[with_material], 3]
    return [int(geom) for geom in np.flatnonzero((alpha != 0.0) & ~own)]


def _geom_triangles(model: Any, geom: int) -> tuple[FloatArray, NDArray[np.int32]]:
    """Vertices (v, 3) [m] in the geom's frame, and triangles (t, 3) of them."""
    kind = mujoco.mjtGeom(model.geom_type[geom])
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        return _BOX_CORNERS * model.geom_size[geom], _BOX_TRIANGLES
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        mesh = model.geom_dataid[geom]
        vertices = slice(model.mesh_vertadr[mesh], model.mesh_vertadr[mesh] + model.mesh_vertnum[mesh])
        faces = slice(model.mesh_faceadr[mesh], model.mesh_faceadr[mesh] + model.mesh_facenum[mesh])
        return model.mesh_vert[vertices].astype(np.float64), model.mesh_face[faces]
    name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_GEOM, geom)
    body = model.body(int(model.geom_bodyid[geom])).name
    raise ModelError(
        f"geom {name or geom} of body {body!r} is a {kind.name.removeprefix('mjGEOM_').lower()}, which the LiDAR back "
        "end 'raycast' cannot see; accepted: mesh, box, plane, alpha 0, or the back end 'rangefinder'"
    )
