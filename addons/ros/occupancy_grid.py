"""The map of a run as cells: walls, standing obstacles, and the free ground that can be reached.

A cell is occupied if a wall or a standing obstacle touches it, so that walls have no holes. It is free if the car can
reach it from its start, and unknown beyond the walls.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from fg_mujoco.course.maps.map_server import FREE, OCCUPIED, RESOLUTION, UNKNOWN
from fg_mujoco.course.track import LONGEST
from fg_mujoco.errors import ModelError
from fg_mujoco.messages import FloatArray

_MARGIN = 5  # [cells] round the walls
_OPEN = 10.0  # [m] round the start that is mapped as free where there are no walls
_MOST_CELLS = 25_000_000
_AT_ONCE = 2_000_000  # cells, or points, that are worked out at once
_FLAT = 1e-12  # [m^2] a triangle seen from its edge


@dataclass(frozen=True, kw_only=True, eq=False)
class Grid:
    """Cells seen from above: row 0 is the lowest, column 0 the leftmost."""

    cells: NDArray[np.int8]  # (rows, columns) FREE, OCCUPIED or UNKNOWN
    resolution: float  # [m]
    origin: FloatArray  # (2,) [m] lower left corner of the first cell


def grid_of(model: mujoco.MjModel, start: FloatArray, resolution: float = RESOLUTION) -> Grid:
    """Return the map of a world's model, seen from a place (2,) [m] that is free.

    The side of a cell [m] is doubled until there are no more than 25 million. Raises ModelError: walls that are further
    apart than those of any course.
    """
    from scipy import ndimage  # heavy, and only a map needs it

    footprints = _footprints(model)
    open_ground = np.asarray(start) + np.array([[-_OPEN, -_OPEN], [_OPEN, _OPEN]])
    corners = np.concatenate([triangles.reshape(-1, 2) for triangles in footprints] or [open_ground])
    low, high = corners.min(axis=0), corners.max(axis=0)
    width = float((high - low).max())
    if width > LONGEST:
        raise ModelError(f"the world is {width:g} m wide; accepted for a map: {LONGEST:g} m at most")
    while np.prod(np.ceil((high - low) / resolution) + 2 * _MARGIN) > _MOST_CELLS:
        resolution *= 2.0
    origin = resolution * (np.floor(low / resolution) - _MARGIN)
    columns, rows = np.ceil((high - origin) / resolution).astype(int) + _MARGIN
    occupied = np.zeros((rows, columns), np.bool_)
    for triangles in footprints:
        _draw(occupied, (triangles - origin) / resolution)
    regions, _ = ndimage.label(~occupied)  # neighbours share an edge: no way between two walls that touch at a corner
    place = np.floor((np.asarray(start) - origin) / resolution)
    column, row = np.clip(place, 0, (columns - 1, rows - 1)).astype(int)  # what is outside is free up to the border
    free = (regions == regions[row, column]) & ~occupied
    cells = np.where(occupied, OCCUPIED, np.where(free, FREE, UNKNOWN)).astype(np.int8)
    return Grid(cells=cells, resolution=resolution, origin=origin)


def _footprints(model: mujoco.MjModel) -> list[FloatArray]:
    """Return each solid that stands still as triangles seen from above, shapes (k, 3, 2) [m]."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    still = (model.geom_bodyid == 0) & (model.geom_type == mujoco.mjtGeom.mjGEOM_MESH) & (model.geom_contype != 0)
    footprints = []
    for geom in np.flatnonzero(still):
        mesh = model.geom_dataid[geom]
        vertices = model.mesh_vert[model.mesh_vertadr[mesh] :][: model.mesh_vertnum[mesh]]
        faces = model.mesh_face[model.mesh_faceadr[mesh] :][: model.mesh_facenum[mesh]]
        corners = vertices @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
        footprints.append(np.asarray(corners[faces][:, :, :2], np.float64))
    return footprints


def _draw(occupied: NDArray[np.bool_], triangles: FloatArray) -> None:
    """Mark the cells that triangles (k, 3, 2), in cells, touch: their middle lies in one, or an edge runs through."""
    edges = np.roll(triangles, -1, axis=1) - triangles
    count = int(np.ceil(4.0 * np.abs(edges).max())) + 2  # four points a cell at least
    share = np.linspace(0.0, 1.0, count)[:, np.newaxis]
    few = max(1, _AT_ONCE // count)
    for first in range(0, len(triangles), few):
        part = slice(first, first + few)
        along = triangles[part, :, np.newaxis] + edges[part, :, np.newaxis] * share
        column, row = np.floor(along.reshape(-1, 2)).astype(int).T
        occupied[row, column] = True

    area = edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]
    up = triangles[area > _FLAT], edges[area > _FLAT]
    (left, below), (right, above) = (
        np.floor(end(triangles.reshape(-1, 2), axis=0)).astype(int) for end in (np.min, np.max)
    )
    few = max(1, _AT_ONCE // (3 * len(triangles) * (right - left + 1)))
    for lowest in range(below, above + 1, few):
        rows, columns = np.mgrid[lowest : min(lowest + few, above + 1), left : right + 1]
        middles = np.stack((columns + 0.5, rows + 0.5), axis=-1).reshape(-1, 1, 1, 2)
        away = middles - up[0]
        left_of_edges = up[1][..., 0] * away[..., 1] - up[1][..., 1] * away[..., 0] >= 0.0
        inside = np.any(np.all(left_of_edges, axis=2), axis=1)
        occupied[rows.ravel()[inside], columns.ravel()[inside]] = True
