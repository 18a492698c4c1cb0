"""Ground that is not level, in a world: a height field for the tires, one for bodies, and a mesh that is seen.

MuJoCo's contacts with a height field shake a wheel, and cost more the finer it is. So tires read the surface by
themselves (native/vehicle/terrain.hpp), of the field that is geom 0. Bodies that fall on it meet a coarse one. A ray
tests each cell of a field that it crosses, and of a mesh few triangles: so beams see a mesh of the same heights.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from ..course.ground import Ground

TERRAIN = "terrain"
"""Name of the geom that tires stand on, the first of its model, as in native/vehicle/terrain.hpp."""

SEEN = "terrain_seen"
"""Name of the geom that beams and pictures see."""

BODIES = "terrain_for_bodies"
"""Name of the geom that bodies meet."""

_COARSE = 0.1  # [m] of a cell that bodies meet; on finer ones a box on level ground turns over
_SEEN_CELL = 0.2  # [m] at least, of the mesh
_BASE = 0.5  # [m] of ground below the lowest place
_COLOUR = (0.45, 0.45, 0.46, 1.0)
_INVISIBLE = (0.0, 0.0, 0.0, 0.0)
_HIDDEN_GROUP = 3
_NOBODY = 2**20  # of contacts: nothing has it; a geom with no bit is only seen, and cars alone have none of these


def add_terrain(spec: Any, ground: Ground) -> None:
    """Add a ground to the spec of a world, in place, before any other geom; if flat, only what tires stand on."""
    _add_field(spec, TERRAIN, ground)
    if ground.flat:
        return
    coarse = _coarser(ground, _COARSE)
    _add_field(spec, BODIES, coarse, TERRAIN if coarse.cell == ground.cell else "")
    vertices, faces = _mesh(_coarser(ground, _SEEN_CELL))
    mesh = spec.add_mesh(name=SEEN, uservert=vertices.ravel(), userface=faces.ravel())
    mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL  # it has no volume
    spec.worldbody.add_geom(
        name=SEEN, type=mujoco.mjtGeom.mjGEOM_MESH, meshname=SEEN, rgba=_COLOUR, contype=0, conaffinity=0
    )


def stand_on_terrain(spec: Any) -> None:
    """Let what the level ground of a world's cars stops stand on its terrain, and hide the level ground, in place."""
    for pair in spec.pairs:
        if pair.geomname2.endswith("ground") and not pair.name.endswith("_tire"):
            pair.geomname2 = BODIES
    for geom in spec.geoms:
        if geom.name.endswith("/ground"):
            geom.material, geom.rgba, geom.group, geom.contype, geom.conaffinity = "", _INVISIBLE, _HIDDEN_GROUP, 0, 0


def on_terrain(car: Any, ground: Ground, prefix: str) -> Any:
    """Return the spec of a car alone on a ground, which puts a prefix before the names of the car."""
    spec = mujoco.MjSpec()
    spec.option, spec.memory, spec.nuserdata, spec.nuser_geom = car.option, car.memory, car.nuserdata, car.nuser_geom
    add_terrain(spec, ground)
    spec.attach(car, frame=spec.worldbody.add_frame(), prefix=prefix)
    stand_on_terrain(spec)
    return spec


def _add_field(spec: Any, name: str, ground: Ground, like: str = "") -> None:
    """Add a height field that is not seen, or another geom `like` one; heights are kept as shares of their range."""
    heights = ground.heights
    (rows, columns), least, most = heights.shape, float(heights.min()), float(heights.max())
    half = 0.5 * ground.cell * (np.array((columns, rows)) - 1)
    if not like:
        spec.add_hfield(
            name=name, nrow=rows, ncol=columns, size=(*half, most - least or 1.0, _BASE),
            userdata=((heights - least) / (most - least or 1.0)).ravel(),
        )  # fmt: skip
    spec.worldbody.add_geom(
        name=name, type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname=like or name,
        pos=(*(np.array(ground.corner) + half), least), rgba=_INVISIBLE, group=_HIDDEN_GROUP, contype=_NOBODY,
        conaffinity=0,
    )  # fmt: skip


def _coarser(ground: Ground, cell: float) -> Ground:
    """Return a ground with nodes as far apart, or as it is if they are."""
    step = max(round(cell / ground.cell), 1)
    return Ground(heights=ground.heights[::step, ::step], corner=ground.corner, cell=step * ground.cell)


def _mesh(ground: Ground) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices (v, 3) [m] and triangles (t, 3), seen from above, of a ground."""
    rows, columns = ground.heights.shape
    x, y = np.meshgrid(*(ground.corner[axis] + ground.cell * np.arange(n) for axis, n in ((0, columns), (1, rows))))
    first = (columns * np.arange(rows - 1)[:, None] + np.arange(columns - 1)).ravel()
    right, above, across = first + 1, first + columns, first + columns + 1
    faces = np.concatenate((np.column_stack((first, right, across)), np.column_stack((first, across, above))))
    return np.column_stack((x.ravel(), y.ravel(), ground.heights.ravel())), faces
