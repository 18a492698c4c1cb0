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
from numpy.typing import NDArray

from ..compiled.kernels import kernel
from ..messages import FloatArray
from ..vehicle.bodywork import HULL
from ..vehicle.car import element_id
from ..vehicle.motion import CarArray

REACH = 1.0
"""[m] Greatest distance that is measured, which is further than any car of this scale reaches from its middle."""

_CELL = 0.25  # [m]
MOST_CELLS = 4_000_000  # of a course 500 m long and wide; on a greater one nothing is left out
_SAME = 1e-10  # [m^2] square of the distance of two corners that are one
_UPRIGHT = 0.8  # [-] cosine of a car's tilt, up to which the corners of its hull are its lowest points


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
    solid &= model.geom_type != mujoco.mjtGeom.mjGEOM_PLANE
    if model.nmocap or not (model.geom_type[solid & (model.body_weldid[model.geom_bodyid] == 0)] == _MESH).all():
        return nothing
    standing = np.flatnonzero(solid & (model.geom_bodyid == 0))
    if len(standing) == 0:
        return np.full((1, 1), REACH), np.zeros(2)
    meshes = model.geom_dataid[standing]
    ends = np.cumsum(model.mesh_vertnum[meshes]).astype(np.int64)
    points = np.empty((ends[-1], 2))
    _outline(
        model.mesh_vert, model.mesh_vertadr[meshes], ends, model.geom_pos[standing], model.geom_quat[standing], points
    )  # fmt: skip
    corner = points.min(axis=0) - REACH
    columns, rows = (np.ceil((points.max(axis=0) + REACH - corner) / _CELL)).astype(int) + 1
    if rows * columns > MOST_CELLS:
        return nothing
    distances = np.full((rows, columns), REACH)
    _fill(points, ends, corner, distances)
    return distances, corner


_MESH = mujoco.mjtGeom.mjGEOM_MESH


@kernel
def _outline(
    vertices: NDArray[np.float32],
    starts: NDArray[np.int32],
    ends: NDArray[np.int64],
    places: FloatArray,
    turns: FloatArray,
    points: FloatArray,
) -> None:
    """Write the corners of prisms from above into `points` (k, 2) [m], counterclockwise about each one's middle."""
    first = 0
    for prism in range(len(ends)):
        end = ends[prism]
        w, x, y, z = turns[prism, 0], turns[prism, 1], turns[prism, 2], turns[prism, 3]
        middle_x = middle_y = 0.0
        for k in range(first, end):
            vertex = vertices[starts[prism] + k - first]
            a, b, c = float(vertex[0]), float(vertex[1]), float(vertex[2])
            points[k, 0] = (
                places[prism, 0] + a * (1.0 - 2.0 * (y * y + z * z)) + 2.0 * (b * (x * y - w * z) + c * (x * z + w * y))
            )
            points[k, 1] = (
                places[prism, 1] + b * (1.0 - 2.0 * (x * x + z * z)) + 2.0 * (a * (x * y + w * z) + c * (y * z - w * x))
            )
            middle_x += points[k, 0] / (end - first)
            middle_y += points[k, 1] / (end - first)
        for k in range(first + 1, end):
            own_x, own_y = points[k, 0], points[k, 1]
            angle, at = math.atan2(own_y - middle_y, own_x - middle_x), k
            while at > first and math.atan2(points[at - 1, 1] - middle_y, points[at - 1, 0] - middle_x) > angle:
                points[at, 0], points[at, 1] = points[at - 1, 0], points[at - 1, 1]
                at -= 1
            points[at, 0], points[at, 1] = own_x, own_y
        first = end


@kernel
def _fill(points: FloatArray, ends: NDArray[np.int64], corner: FloatArray, distances: FloatArray) -> None:
    """Lower the distances from cells to the convex outlines of `points` (k, 2) that end before `ends`."""
    rows, columns = distances.shape
    first = 0
    for end in ends:
        low_x = high_x = points[first, 0]
        low_y = high_y = points[first, 1]
        for k in range(first, end):
            low_x, high_x = min(low_x, points[k, 0]), max(high_x, points[k, 0])
            low_y, high_y = min(low_y, points[k, 1]), max(high_y, points[k, 1])
        lowest, highest = _cells(low_y - REACH - corner[1], high_y + REACH - corner[1], rows)
        leftmost, rightmost = _cells(low_x - REACH - corner[0], high_x + REACH - corner[0], columns)
        for row in range(lowest, highest):
            y = corner[1] + row * _CELL
            for column in range(leftmost, rightmost):
                x = corner[0] + column * _CELL
                nearest, inside = distances[row, column] ** 2, True
                for k in range(first, end):
                    following = k + 1 if k + 1 < end else first
                    ax, ay = points[k, 0], points[k, 1]
                    along_x, along_y = points[following, 0] - ax, points[following, 1] - ay
                    square = along_x * along_x + along_y * along_y
                    if square < _SAME:  # two corners, one above the other
                        continue
                    inside = inside and along_x * (y - ay) - along_y * (x - ax) >= 0.0
                    share = min(max((along_x * (x - ax) + along_y * (y - ay)) / square, 0.0), 1.0)
                    off_x, off_y = x - ax - share * along_x, y - ay - share * along_y
                    nearest = min(nearest, off_x * off_x + off_y * off_y)
                distances[row, column] = 0.0 if inside else math.sqrt(nearest)
        first = end


@kernel
def _cells(low: float, high: float, count: int) -> tuple[int, int]:
    """Return the first of `count` cells in a row that reaches from `low` to `high` [m], and the one behind the last."""
    return max(int(low / _CELL), 0), min(int(high / _CELL) + 2, count)


@kernel
def touches_nothing(qpos: FloatArray, cars: CarArray, clear: ClearGround) -> bool:
    """Return whether the `cars` (m,) of a world are clear of all that is solid, as they are now."""
    if clear.distances.size == 0:
        return False
    for car in range(len(cars)):
        q, body = cars[car].free_qpos, clear.bodies[car]
        w, x, y, z = qpos[q + 3], qpos[q + 4], qpos[q + 5], qpos[q + 6]
        up_x, up_y, up_z = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)
        middle = qpos[q + 2] + body[0] * up_x + body[1] * up_y + body[2] * up_z
        lowest = middle - body[3] * abs(up_x) - body[4] * abs(up_y) - body[5] * abs(up_z)
        if not (up_z > _UPRIGHT and lowest > 0.0):  # nor is NaN
            return False
        here_x, here_y = _place(qpos, q, body, 0.0)
        away = _distance(clear, here_x, here_y)
        if not away > body[6]:
            if not away > body[8]:
                return False
            for along in (-body[7], body[7]):
                end_x, end_y = _place(qpos, q, body, along)
                if not _distance(clear, end_x, end_y) > body[8]:
                    return False
        for other in range(car):
            there_x, there_y = _place(qpos, cars[other].free_qpos, clear.bodies[other], 0.0)
            reach = body[6] + clear.bodies[other, 6]
            if not (here_x - there_x) ** 2 + (here_y - there_y) ** 2 > reach * reach:
                return False
    return True


@kernel
def _place(qpos: FloatArray, q: int, body: FloatArray, along: float) -> tuple[float, float]:
    """Return the position from above of a point so far ahead of the middle of a car's hull [m]."""
    w, x, y, z = qpos[q + 3], qpos[q + 4], qpos[q + 5], qpos[q + 6]
    a, b, c = body[0] + along, body[1], body[2]
    forward = a * (1.0 - 2.0 * (y * y + z * z)) + 2.0 * (b * (x * y - w * z) + c * (x * z + w * y))
    left = b * (1.0 - 2.0 * (x * x + z * z)) + 2.0 * (a * (x * y + w * z) + c * (y * z - w * x))
    return qpos[q] + forward, qpos[q + 1] + left


@kernel
def _distance(clear: ClearGround, x: float, y: float) -> float:
    """Return at least how far a point is from what stands [m], by the best of four cells around it; NaN: no point."""
    rows, columns = clear.distances.shape
    across, up = (x - clear.corner[0]) / _CELL, (y - clear.corner[1]) / _CELL
    if not (abs(across) < 1e9 and abs(up) < 1e9):
        return math.nan
    column, row = math.floor(across), math.floor(up)
    nearest = 0.0
    for i in range(row, row + 2):
        for j in range(column, column + 2):
            within = 0 <= i < rows and 0 <= j < columns
            cell = clear.distances[i, j] if within else REACH
            nearest = max(nearest, cell - _CELL * math.sqrt((across - j) * (across - j) + (up - i) * (up - i)))
    return nearest
