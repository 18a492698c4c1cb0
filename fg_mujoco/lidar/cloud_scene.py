"""The visible surfaces of a model as flat arrays for the points of a 3D LiDAR: what native/lidar/point_cloud.cpp draws.

They are those of `visible_surfaces`, and each has a material: how much of the light it reflects, of which follows how
far it is seen. The share is the mean of a geom's red, green and blue, or of its texture's.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arguments import Uncopied
from ..course.moving_obstacles import moving_obstacles
from ..messages import FloatArray
from ..native import core
from .body_poses import make_links
from .clusters import make_vertex_clusters
from .visible_surfaces import assembled, fixed, surfaces_of


class CloudArrays(NamedTuple):
    """Frames, clusters, planes and shapes lie as in SceneArrays."""

    vertices: FloatArray  # (3, v) [m] as in clusters.VertexClusters, and so the next
    triangles: NDArray[np.uint16]  # (t, 3)
    boxes: FloatArray  # (9, b) as in SceneArrays, and the material
    spans: NDArray[np.int32]  # (b, 5)
    planes: FloatArray  # (p, 15) and the material
    frames: NDArray[np.int32]  # (f, 7)
    shapes: FloatArray  # (k, 19) and the material
    spheres: FloatArray  # (f, 4)
    materials: FloatArray  # (m, 2) intensity of a return, and distance within which there is one [m]


class CloudScene(Uncopied):
    """The visible surfaces of a model, all cars included; all worlds and threads of the model share it.

    Attributes:
      materials: intensity of a return, and distance within which there is one [m], of each surface (m, 2).
      moving: the moving obstacles, whose bodies are the first that move.
      links: those that the poses of the other bodies that move follow from, as LINK.

    Args:
      ranges: share of light that a surface reflects and how far it is seen [m], for two; between and beyond them the
        distance is a power of the share. Shape (4,).
      intensity: of a surface that reflects all light.

    Raises:
      ModelError: a visible geom of a kind that cannot be seen, as a height field.
    """

    def __init__(self, model: Any, ranges: FloatArray, intensity: float) -> None:
        shares, materials = np.unique(np.round(_reflected(model), 3), return_inverse=True)
        dark, near, bright, far = ranges.tolist()
        power = math.log(far / near) / math.log(bright / dark)
        surfaces = surfaces_of(model, None, materials.astype(np.float64))
        clusters, parts = assembled(model, surfaces, make_vertex_clusters)
        arrays = CloudArrays(
            vertices=fixed(np.concatenate([own.vertices for own in clusters], axis=1)),
            materials=fixed([(intensity * share, far * math.pow(share / bright, power)) for share in shares.tolist()]),
            **parts,
        )
        self.materials = arrays.materials
        self.moving = moving_obstacles(model)
        self.links = make_links(model, tuple(part.body for part in surfaces[1 + len(self.moving) :]))
        self.native = core.CloudScene(*arrays)


def _reflected(model: Any) -> FloatArray:
    """Return the share of light that each geom reflects. Shape (geoms,)."""
    colours = model.geom_rgba[:, :3].astype(np.float64)
    for geom in np.flatnonzero(model.geom_matid >= 0):
        material = model.geom_matid[geom]
        colours[geom] = model.mat_rgba[material, :3]
        for texture in model.mat_texid[material][model.mat_texid[material] >= 0]:
            start = model.tex_adr[texture]
            size = model.tex_height[texture] * model.tex_width[texture] * model.tex_nchannel[texture]
            colours[geom] *= model.tex_data[start : start + size].mean() / 255.0
    shares: FloatArray = colours.mean(axis=1)
    return shares
