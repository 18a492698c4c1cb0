"""The surfaces of a compiled model for a LiDAR's rays: triangles, planes and round shapes, for each moving body.

The round ones among them are kept as they are (round_shapes.py).

The geoms are those that MuJoCo's rays see: not the transparent ones (alpha 0 of the material, or of the geom where it
has no material; `show_as_drawn` makes that what pictures show), any group, both sides of a mesh or box, the front of a
plane. Nothing of the kinematic tree that carries the LiDAR is seen.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..errors import ModelError
from ..messages import FloatArray
from .round_shapes import SHAPE, is_shape, shape_row

# Corners of the box of half-sizes 1, and its sides as triangles.
_BOX_CORNERS = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
_BOX_SIDES = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
_BOX_TRIANGLES = np.concatenate((_BOX_SIDES[:, [0, 1, 2]], _BOX_SIDES[:, [0, 2, 3]])).astype(np.int32)


@dataclass(frozen=True, kw_only=True, eq=False)
class Plane:
    """A plane geom, seen from its front only; a rectangle where `half_sizes` are positive. In its body's frame."""

    position: FloatArray  # (3,) [m]
    rotation: FloatArray  # (3, 3), columns x, y, normal
    half_sizes: FloatArray  # (2,) [m], 0 for no end


@dataclass(frozen=True, kw_only=True, eq=False)
class Surfaces:
    """Surfaces that keep their places in the frame of one body."""

    body: int  # id of the body; 0, the world, for all that never moves
    vertices: FloatArray  # (v, 3) [m]
    triangles: NDArray[np.int32]  # (t, 3) indices of vertices
    planes: tuple[Plane, ...]
    shapes: FloatArray  # (k, SHAPE)


def visible_surfaces(model: Any, carrier: int | None) -> tuple[Surfaces, ...]:
    """Return the surfaces that rays meet, by body: the world's first, where they are now, then each body's that moves.

    Args:
      carrier: id of the body that the rays start from; no geom of its kinematic tree is seen. None: all are.

    Raises:
      ModelError: a visible geom of a kind that cannot be seen, as a height field.
    """
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    parts: dict[int, list[tuple[FloatArray, NDArray[np.int32]]]] = {0: []}
    planes: dict[int, list[Plane]] = {0: []}
    shapes: dict[int, list[FloatArray]] = {0: []}
    for geom in _visible_geoms(model, carrier):
        body = int(model.body_weldid[model.geom_bodyid[geom]])  # 0 for all that never moves
        to_body = data.xmat[body].reshape(3, 3).T
        position = to_body @ (data.geom_xpos[geom] - data.xpos[body])
        rotation = to_body @ data.geom_xmat[geom].reshape(3, 3)
        if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_PLANE:
            half_sizes = np.maximum(model.geom_size[geom, :2], 0.0)
            planes.setdefault(body, []).append(Plane(position=position, rotation=rotation, half_sizes=half_sizes))
        elif is_shape(int(model.geom_type[geom])):
            row = shape_row(int(model.geom_type[geom]), model.geom_size[geom], position, rotation)
            shapes.setdefault(body, []).append(row)
        else:
            vertices, triangles = _geom_triangles(model, geom)
            parts.setdefault(body, []).append((position + vertices @ rotation.T, triangles))
    return tuple(
        _gathered(body, parts.get(body, []), planes.get(body, []), shapes.get(body, []))
        for body in sorted(parts.keys() | planes.keys() | shapes.keys())
    )


def _gathered(
    body: int, parts: list[tuple[FloatArray, NDArray[np.int32]]], planes: list[Plane], shapes: list[FloatArray]
) -> Surfaces:
    first = np.cumsum([0] + [len(vertices) for vertices, _ in parts])
    triangles = [triangles + start for (_, triangles), start in zip(parts, first, strict=False)]
    return Surfaces(
        body=body,
        vertices=np.concatenate([np.empty((0, 3)), *(vertices for vertices, _ in parts)]),
        triangles=np.concatenate([np.empty((0, 3), np.int32), *triangles]).astype(np.int32),
        planes=tuple(planes),
        shapes=np.concatenate(shapes).reshape(-1, SHAPE) if shapes else np.empty((0, SHAPE)),
    )


def _visible_geoms(model: Any, carrier: int | None) -> list[int]:
    if model.nflex:
        raise ModelError(
            f"the model has {model.nflex} flex objects, which the LiDAR back end 'raycast' cannot see; accepted: none, "
            "or the back end 'rangefinder'"
        )
    roots = model.body_rootid[model.geom_bodyid]
    own = np.zeros(len(roots), np.bool_) if carrier is None else roots == model.body_rootid[carrier]
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
        "end 'raycast' cannot see; accepted: mesh, box, plane, sphere, capsule, ellipsoid, cylinder, alpha 0, or the "
        "back end 'rangefinder'"
    )
