"""The shapes of a world for a browser: one mesh for each body and colour, where its body moves it."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from fg_mujoco.messages import FloatArray
from fg_mujoco.simulation.world import World

_FLOOR_MARGIN = 4.0  # [m] of floor round the course
_LEVELS = 24  # of each colour: number of shades


@dataclass(frozen=True, kw_only=True, eq=False)
class Shape:
    """A mesh of one colour, in the frame of its body."""

    body: int  # in the model; 0: the world, which does not move
    colour: tuple[int, int, int]
    opacity: float
    vertices: FloatArray  # (n, 3) [m]
    faces: NDArray[np.int64]  # (m, 3)


def world_shapes(world: World) -> tuple[mujoco.MjModel, tuple[Shape, ...]]:
    """Return the model of a world for pictures, which takes its states, and its shapes."""
    from fg_mujoco.pictures.rendering.scenery import compile_scenery

    x, y, _ = world.track.start_pose()
    model = compile_scenery(world.xml, (x, y))
    return model, model_shapes(model)


def model_shapes(model: mujoco.MjModel) -> tuple[Shape, ...]:
    """Return the shapes of all that can be seen in a model."""
    parts: dict[tuple[int, tuple[int, int, int], float], list[tuple[FloatArray, NDArray[np.int64]]]] = {}
    floor = _floor_bounds(model)
    for geom in range(model.ngeom):
        colour, opacity = _colour(model, geom)
        if opacity < 0.02 or model.geom_group[geom] > 2:
            continue
        mesh = _mesh(model, geom, floor)
        if mesh is not None:
            parts.setdefault((int(model.geom_bodyid[geom]), colour, opacity), []).append(mesh)
    return tuple(
        Shape(body=body, colour=colour, opacity=opacity, vertices=vertices, faces=faces)
        for (body, colour, opacity), meshes in parts.items()
        for vertices, faces in [_joined(meshes)]
    )


def _joined(meshes: list[tuple[FloatArray, NDArray[np.int64]]]) -> tuple[FloatArray, NDArray[np.int64]]:
    counts = np.cumsum([0, *(len(vertices) for vertices, _ in meshes[:-1])])
    vertices = np.concatenate([vertices for vertices, _ in meshes])
    return vertices, np.concatenate([faces + first for (_, faces), first in zip(meshes, counts, strict=True)])


def _mesh(model: mujoco.MjModel, geom: int, floor: FloatArray) -> tuple[FloatArray, NDArray[np.int64]] | None:
    """Return vertices and faces of a geom in the frame of its body."""
    import trimesh

    kinds, size = mujoco.mjtGeom, model.geom_size[geom]
    kind = model.geom_type[geom]
    if kind == kinds.mjGEOM_MESH:
        mesh = model.geom_dataid[geom]
        vertices = model.mesh_vert[model.mesh_vertadr[mesh] :][: model.mesh_vertnum[mesh]].astype(np.float64)
        faces = model.mesh_face[model.mesh_faceadr[mesh] :][: model.mesh_facenum[mesh]].astype(np.int64)
    elif kind == kinds.mjGEOM_PLANE:
        (left, bottom), (right, top) = floor
        vertices = np.array([[left, bottom, 0.0], [right, bottom, 0.0], [right, top, 0.0], [left, top, 0.0]])
        faces = np.array([[0, 1, 2], [0, 2, 3]])
    else:
        if kind == kinds.mjGEOM_BOX:
            made = trimesh.creation.box(extents=2.0 * size)
        elif kind == kinds.mjGEOM_CYLINDER:
            made = trimesh.creation.cylinder(radius=size[0], height=2.0 * size[1], sections=32)
        elif kind == kinds.mjGEOM_CAPSULE:
            made = trimesh.creation.capsule(radius=size[0], height=2.0 * size[1], count=[16, 16])
        elif kind in (kinds.mjGEOM_SPHERE, kinds.mjGEOM_ELLIPSOID):
            made = trimesh.creation.icosphere(subdivisions=2)
            made.apply_scale(size if kind == kinds.mjGEOM_ELLIPSOID else size[[0, 0, 0]])
        else:
            return None
        vertices, faces = np.asarray(made.vertices, np.float64), np.asarray(made.faces, np.int64)
    rotation = np.empty(9)
    mujoco.mju_quat2Mat(rotation, model.geom_quat[geom])
    return model.geom_pos[geom] + vertices @ rotation.reshape(3, 3).T, faces


def _colour(model: mujoco.MjModel, geom: int) -> tuple[tuple[int, int, int], float]:
    """Return the colour of a geom as red, green and blue in 0..255, that of its texture on the whole, and opacity."""
    rgba = np.array(model.geom_rgba[geom], dtype=np.float64)
    material = int(model.geom_matid[geom])
    if material >= 0:
        rgba = np.array(model.mat_rgba[material], dtype=np.float64)
        texture = int(model.mat_texid[material, mujoco.mjtTextureRole.mjTEXROLE_RGB])
        if texture >= 0:
            count = int(model.tex_height[texture] * model.tex_width[texture] * model.tex_nchannel[texture])
            pixels = model.tex_data[model.tex_adr[texture] :][:count].reshape(-1, model.tex_nchannel[texture])
            rgba[:3] *= pixels[:, :3].mean(axis=0) / 255.0
    red, green, blue = (np.round(rgba[:3] * _LEVELS) / _LEVELS * 255.0).astype(int).tolist()
    return (red, green, blue), float(rgba[3])


def _floor_bounds(model: mujoco.MjModel) -> FloatArray:
    """Return least and greatest x and y of the floor that is drawn. Shape (2, 2) [m]."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    static = model.geom_bodyid == 0
    finite = static & (model.geom_type != mujoco.mjtGeom.mjGEOM_PLANE)
    if not finite.any():
        return np.array([[-10.0, -10.0], [10.0, 10.0]])
    reach = model.geom_rbound[finite, None] + _FLOOR_MARGIN
    places = data.geom_xpos[finite, :2]
    # a mesh as large as the course has the course's radius: its centre is enough of it
    reach = np.minimum(reach, 2.0 * _FLOOR_MARGIN)
    bounds: FloatArray = np.stack(((places - reach).min(axis=0), (places + reach).max(axis=0)))
    return bounds
