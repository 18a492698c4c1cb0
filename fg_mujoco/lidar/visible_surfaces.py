"""The visible surfaces of a model as flat arrays, prepared for the beams of one LiDAR: what `scanline.scan` draws.

A porous geom lets a share of the beams through: the first of its `user` numbers. Where its holes are follows from the
place on it alone, by cells of 2 cm.

The geoms are those that MuJoCo's rays see: not the transparent ones (alpha 0 of the material, or of the geom where it
has no material; `show_as_drawn` makes that what pictures show), any group, both sides of a mesh or box, the front of a
plane. Nothing of the kinematic tree that carries the LiDAR is seen.

A wall is made of triangles and a box of twelve of them, which `scanline` draws. The round parts of a car, its wheels,
axles and the LiDAR that it carries, are spheres, capsules, ellipsoids and cylinders, and are asked of each beam that
may meet them, in closed form. The equations are those of MuJoCo's own rays (`mj_ray`), so that both agree to rounding:
the nearest point ahead of the ray on the surface, from inside, too.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..errors import ModelError
from ..messages import FloatArray
from .beams import Beams
from .clusters import Clusters, make_clusters

_KINDS = {
    int(mujoco.mjtGeom.mjGEOM_SPHERE): 0.0,
    int(mujoco.mjtGeom.mjGEOM_CAPSULE): 1.0,
    int(mujoco.mjtGeom.mjGEOM_ELLIPSOID): 2.0,
    int(mujoco.mjtGeom.mjGEOM_CYLINDER): 3.0,
}
SHAPE = 18
"""Numbers of a shape: kind, sizes as of its geom [m], position [m], rotation row by row, radius of the sphere around it
[m], and the share of the beams that pass through; position and rotation in the frame of its body."""


def is_shape(kind: int) -> bool:
    """Return whether a geom of this mjtGeom is one of these shapes."""
    return kind in _KINDS


def shape_row(
    kind: int, size: FloatArray, position: FloatArray, rotation: FloatArray, porosity: float = 0.0
) -> FloatArray:
    """Return the numbers of a shape (SHAPE,): size (3,) [m]; position (3,) [m], rotation (3, 3) in its body's frame."""
    around = {0: size[0], 1: size[0] + size[1], 2: size.max(), 3: math.hypot(size[0], size[1])}[int(_KINDS[kind])]
    return np.concatenate(([_KINDS[kind]], size, position, rotation.ravel(), [around, porosity]))


BINS = 64  # of distance, into which a scan sorts the clusters, as in native/lidar/scene.hpp
NO_END = 1e300  # [m] half-size of a plane without end, as there
AS_OPTICS_SAY = -1.0
"""The porosity of a geom of a car, which follows from LidarEffects.through_cars."""
_LEAST_STEP = 1e-4  # [rad] between beams, so that `bearing` in culling.hpp tells which two a point is between
_LARGE = 2000  # triangles of a mesh that shares no cluster with others: ground would be as high as the walls on it
_IN_PLANE = 1e-12  # of directions [-] and origins [m]

# Corners of the box of half-sizes 1, and its sides as triangles.
_BOX_CORNERS = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
_BOX_SIDES = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
_BOX_TRIANGLES = np.concatenate((_BOX_SIDES[:, [0, 1, 2]], _BOX_SIDES[:, [0, 2, 3]])).astype(np.int32)


class SceneArrays(NamedTuple):
    """Input of a scan: one LiDAR's beams and the surfaces of one model. Read-only; all worlds of a model share it.

    Frame 0 is the world's, the others are those of the bodies that move. Clusters, planes and shapes lie frame after
    frame. The tree of a frame is the id of the body at the root of its kinematic tree.
    """

    beams: FloatArray  # (2, n) cosine and sine of each beam's bearing
    limits: FloatArray  # (4,) angle_min [rad], angle_increment [rad], range_min [m], range_max [m]
    edges: FloatArray  # (6, e) [m] as in clusters.Clusters, and so the next three
    triangles: NDArray[np.uint16]  # (t, 3)
    boxes: FloatArray  # (9, b) [m]; the eighth is the share of the beams that pass through [-]; the material
    spans: NDArray[np.int32]  # (b, 5) the fifth is the frame
    planes: FloatArray  # (p, 15) position, rotation row by row, half-sizes [m]; the material
    frames: NDArray[np.int32]  # (f, 7) first cluster, behind the last; first plane, behind; first shape, behind; tree
    shapes: FloatArray  # (k, SHAPE + 1) the last is the material
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
        surfaces = surfaces_of(model, carrier, np.zeros(model.ngeom))
        self.moving = tuple(part.body for part in surfaces[1:])
        limits = (beams.angle_min, beams.angle_increment, beams.range_min, beams.range_max)
        self.arrays = assembled(model, surfaces, make_clusters, beams.in_plane, limits)

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
    if part.body == 0 or len(part.planes):
        return np.array((0.0, 0.0, 0.0, NO_END))
    vertices = np.concatenate([own for _, own, _ in part.meshes])
    centres = np.concatenate((vertices, part.shapes[:, 4:7]))
    radii = np.concatenate((np.zeros(len(vertices)), part.shapes[:, 16]))
    centre = 0.5 * ((centres - radii[:, None]).min(axis=0) + (centres + radii[:, None]).max(axis=0))
    radius = float((np.linalg.norm(centres - centre, axis=1) + radii).max())
    return np.append(centre, radius * (1.0 + 1e-9) + 1e-9)


def let_through(spec: Any, geom: Any, share: float) -> None:
    """Let a share of the beams through a geom of a spec, or AS_OPTICS_SAY, in place."""
    spec.nuser_geom = max(spec.nuser_geom, 1)
    geom.userdata = [share]


class Surfaces(NamedTuple):
    """Surfaces that keep their places in the frame of one body."""

    body: int  # id of the body; 0, the world, for all that never moves
    meshes: tuple[tuple[tuple[float, float], FloatArray, NDArray[np.int32]], ...]  # of each porosity and material,
    # and of what is large: these, vertices (v, 3) [m], and triangles (t, 3), indices of vertices
    planes: FloatArray  # (p, 15) as of SceneArrays
    shapes: FloatArray  # (k, SHAPE + 1)


def surfaces_of(model: Any, carrier: int | None, materials: FloatArray) -> list[Surfaces]:
    """Return the surfaces that rays meet, by body: the world's first, as it is now, then those that move.

    `materials` (geoms,) are numbers that are told with them.
    """
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    none = (0.0, 0.0), -1
    found: dict[int, tuple[dict[tuple[tuple[float, float], int], list[Any]], list[Any], list[Any]]] = {}
    found[0] = ({none: []}, [], [])
    for geom in _visible_geoms(model, carrier):
        body = int(model.body_weldid[model.geom_bodyid[geom]])  # 0 for all that never moves
        meshes, planes, shapes = found.setdefault(body, ({none: []}, [], []))
        to_body, kind = data.xmat[body].reshape(3, 3).T, int(model.geom_type[geom])
        position = to_body @ (data.geom_xpos[geom] - data.xpos[body])
        rotation = to_body @ data.geom_xmat[geom].reshape(3, 3)
        material = float(materials[geom])
        porosity = float(model.geom_user[geom, 0]) if model.nuser_geom else 0.0
        if kind == mujoco.mjtGeom.mjGEOM_PLANE:
            half_sizes = np.where(model.geom_size[geom, :2] > 0.0, model.geom_size[geom, :2], NO_END)
            planes.append(np.concatenate((position, rotation.ravel(), half_sizes, (material,))))
        elif is_shape(kind):
            shapes.append(np.append(shape_row(kind, model.geom_size[geom], position, rotation, porosity), material))
        else:
            own, corners = _geom_triangles(model, geom)
            alone = geom if len(corners) >= _LARGE else -1
            meshes.setdefault(((porosity, material), alone), []).append((position + own @ rotation.T, corners))
    return [
        Surfaces(body, tuple((key, *_joined(own)) for (key, _), own in sorted(meshes.items())),
                  np.reshape(planes, (-1, 15)), np.reshape(shapes, (-1, SHAPE + 1)))
        for body, (meshes, planes, shapes) in sorted(found.items())
    ]  # fmt: skip


def assembled(
    model: Any, surfaces: Sequence[Surfaces], make: Callable[[FloatArray, NDArray[np.int32]], Clusters],
    beams: FloatArray, limits: Sequence[float],
) -> SceneArrays:  # fmt: skip
    """Return the arrays of surfaces, of each mesh of which `make` makes clusters, for beams."""
    clusters, boxes, spans, frames = [], [], [], []
    corner = triangle = cluster = plane = shape = 0  # so many edges, or vertices
    for frame, part in enumerate(surfaces):
        first = cluster
        for key, vertices, triangles in part.meshes:
            own = make(vertices, triangles)
            clusters.append(own)
            boxes.append(np.vstack((own.boxes, np.tile(np.array(key)[:, None], len(own.spans)))))
            spans.append(np.insert(own.spans + np.array((corner, corner, triangle, triangle)), 4, frame, axis=1))
            corner, triangle = corner + own.edges.shape[1], triangle + len(own.triangles)
            cluster += len(own.spans)
        behind = (cluster, plane + len(part.planes), shape + len(part.shapes))
        tree = int(model.body_rootid[part.body])
        frames.append((first, behind[0], plane, behind[1], shape, behind[2], tree))
        plane, shape = behind[1:]
    return SceneArrays(
        beams=beams,
        limits=fixed(limits),
        edges=fixed(np.concatenate([own.edges for own in clusters], axis=1)),
        triangles=fixed(np.concatenate([own.triangles for own in clusters]), np.uint16),
        boxes=fixed(np.concatenate(boxes, axis=1)),
        spans=fixed(np.concatenate(spans), np.int32),
        planes=fixed(np.concatenate([part.planes for part in surfaces])),
        frames=fixed(frames, np.int32),
        shapes=fixed(np.concatenate([part.shapes for part in surfaces])),
        spheres=fixed([_sphere_around(part) for part in surfaces]),
    )


def _joined(meshes: list[tuple[FloatArray, NDArray[np.int32]]]) -> tuple[FloatArray, NDArray[np.int32]]:
    """Return the vertices (v, 3) and triangles (t, 3) of several meshes as one."""
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in meshes)])
    corners = [own + start for (_, own), start in zip(meshes, starts, strict=False)]
    return (
        np.concatenate([np.empty((0, 3)), *(vertices for vertices, _ in meshes)]),
        np.concatenate([np.empty((0, 3), np.int32), *corners]).astype(np.int32),
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


def fixed(values: Any, kind: Any = np.float64) -> Any:
    """Return a new array of them, read-only."""
    array = np.array(values, dtype=kind, order="C")
    array.flags.writeable = False
    return array
