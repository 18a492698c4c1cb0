"""Footprints of the walls and obstacles of a world, read off the compiled model.

So a run folder is enough, wherever its track came from.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from fg_mujoco.course.moving_obstacles import moving_obstacles
from fg_mujoco.messages import FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class MapShapes:
    """Convex outlines, each counterclockwise and (k, 2) [m]."""

    walls: list[FloatArray]
    obstacles: list[FloatArray]
    moving: list[FloatArray]  # where they are at the end

    @property
    def bounds(self) -> FloatArray:
        """Least and greatest x and y of all that does not move, (2, 2) [m]; zeros where there is nothing."""
        points = np.concatenate([*self.walls, *self.obstacles]) if self.walls or self.obstacles else np.zeros((1, 2))
        return np.stack((points.min(axis=0), points.max(axis=0)))


def map_shapes(model: mujoco.MjModel, end: float) -> MapShapes:
    """Return the footprints in a world's model; what moves is where it is at the time `end` [s]."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    walls: list[FloatArray] = []
    obstacles: list[FloatArray] = []
    for geom in range(model.ngeom):
        name = model.geom(geom).name
        if name.startswith(("wall_", "obstacle_")) and model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_MESH:
            (walls if name.startswith("wall_") else obstacles).append(_footprint(model, data, geom))
    return MapShapes(
        walls=walls, obstacles=obstacles, moving=[obstacle.corners(end) for obstacle in moving_obstacles(model)]
    )


def _footprint(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> FloatArray:
    """Return the outline of an upright prism: its lower corners, by their bearing from the middle of them."""
    mesh = model.geom_dataid[geom]
    first = model.mesh_vertadr[mesh]
    corners = np.asarray(model.mesh_vert[first : first + model.mesh_vertnum[mesh]], dtype=np.float64)
    corners = data.geom_xpos[geom] + corners @ data.geom_xmat[geom].reshape(3, 3).T
    low = corners[corners[:, 2] <= 0.5 * (corners[:, 2].min() + corners[:, 2].max()), :2]
    away = low - low.mean(axis=0)
    outline: FloatArray = low[np.argsort(np.arctan2(away[:, 1], away[:, 0]))]
    return outline
