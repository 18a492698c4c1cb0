"""Finds poses in which a car touches nothing, so that MuJoCo need not look for contacts there, a fifth of its step.

Nothing is to be found where all cars are further from what is solid, and from each other, than they reach, and stand
over the ground. The states have the same bits.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from ..messages import FloatArray
from ..native import core
from ..vehicle.bodywork import HULL
from ..vehicle.car import element_id
from ..vehicle.motion import CarArray

REACH = 1.0
"""[m] Greatest distance that is measured, which is further than any car of this scale reaches from its middle."""

_CELL = 0.25  # [m]
MOST_CELLS = 4_000_000  # of a course 500 m long and wide; on a greater one nothing is left out


class ClearGround(NamedTuple):
    """Distances that show where the cars of a world touch nothing; empty `distances`: no place is known to be clear."""

    distances: FloatArray  # (rows, columns) [m] from the middles of cells to what stands, REACH at most
    corner: FloatArray  # (2,) x and y of the middle of cell (0, 0) [m]
    bodies: FloatArray  # (m, 9) of the cars, see `_write_body`


def find_clear_ground(
    grid: tuple[FloatArray, FloatArray], model: mujoco.MjModel, prefixes: Sequence[str]
) -> ClearGround:
    """Return the distances that show where the cars of a world are clear."""
    bodies, known = np.zeros((len(prefixes), 9)), grid[0].size > 0
    for row, prefix in zip(bodies, prefixes, strict=True):
        hull = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, f"{prefix}{HULL}")
        if hull < 0 or model.geom_type[hull] != mujoco.mjtGeom.mjGEOM_BOX or model.geom_quat[hull, 0] != 1.0:
            known = False
            continue
        base = element_id(model, mujoco.mjtObj.mjOBJ_BODY, f"{prefix}base_link")
        own = np.flatnonzero(model.body_rootid[model.geom_bodyid] == model.body_rootid[base])
        touching = own[(model.geom_contype[own] | model.geom_conaffinity[own]) != 0]
        known = known and bool((model.geom_bodyid[touching] == base).all())
        _write_body(model, hull, {hull, *touching.tolist()}, row)
    if not known or model.ntree != len(prefixes):  # something else moves
        return ClearGround(np.zeros((0, 0)), np.zeros(2), bodies)
    return ClearGround(grid[0], grid[1], bodies)


def _write_body(model: mujoco.MjModel, hull: int, geoms: set[int], row: FloatArray) -> None:
    """Write of a car (9,) [m]: its hull's middle and half sides, a ball's radius, three balls' distance and radius."""
    row[:3], row[3:6] = model.geom_pos[hull], model.geom_size[hull]
    sides = np.zeros(3)
    for geom in geoms:
        away, around = model.geom_pos[geom] - row[:3], model.geom_rbound[geom]
        margin = model.geom_margin[geom]
        straight = model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_BOX and model.geom_quat[geom, 0] == 1.0
        row[6] = max(row[6], float(np.linalg.norm(away)) + around + margin)
        sides = np.maximum(sides, np.abs(away) + (model.geom_size[geom] if straight else around) + margin)
    row[7], row[8] = 2.0 * sides[0] / 3.0, math.hypot(sides[0] / 3.0, sides[1], sides[2])


def distances_of(model: mujoco.MjModel) -> tuple[FloatArray, FloatArray]:
    """Return the distances from what stands in a world's model, and their corner, as in ClearGround.

    Both are empty where something moves that cars can hit or that is no solid of a World, and on a course too large.
    """
    nothing = np.zeros((0, 0)), np.zeros(2)
    solid = (model.geom_contype | model.geom_conaffinity) != 0
    solid &= ~np.isin(model.geom_type, (mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_HFIELD))
    if model.nmocap or not (model.geom_type[solid & (model.body_weldid[model.geom_bodyid] == 0)] == _MESH).all():
        return nothing
    standing = np.flatnonzero(solid & (model.geom_bodyid == 0))
    if len(standing) == 0:
        return np.full((1, 1), REACH), np.zeros(2)
    meshes = model.geom_dataid[standing]
    ends = np.cumsum(model.mesh_vertnum[meshes]).astype(np.int64)
    points = np.empty((ends[-1], 2))
    core.outline(
        model.mesh_vert, model.mesh_vertadr[meshes], ends, model.geom_pos[standing], model.geom_quat[standing], points
    )  # fmt: skip
    corner = points.min(axis=0) - REACH
    columns, rows = (np.ceil((points.max(axis=0) + REACH - corner) / _CELL)).astype(int) + 1
    if rows * columns > MOST_CELLS:
        return nothing
    distances = np.full((rows, columns), REACH)
    core.fill(points, ends, corner, distances)
    return distances, corner


_MESH = mujoco.mjtGeom.mjGEOM_MESH


def touches_nothing(qpos: FloatArray, cars: CarArray, clear: ClearGround) -> bool:
    """Return whether the `cars` (m,) of a world are clear of all that is solid, as they are now."""
    return core.touches_nothing(qpos, cars, *clear)
