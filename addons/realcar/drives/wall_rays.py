"""Ranges along horizontal rays to the walls of a map, in 2D and without a course.

    walls = MapWalls.of("IPZ20.yaml")
    hits = walls.hits(origins, angles)       # (n, 2) [m], (n,) [rad]
    hits.ranges                              # [m], inf where there is no wall

The walls are the polylines that a course of the map is made of (`course.maps.walls.trace`), so a ray ends where a beam
of the LiDAR ends in the compiled course. Any map will do, also one without a way round.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.course.maps.map_server import read_map_file
from fg_mujoco.course.maps.walls import outlines, trace
from fg_mujoco.errors import TrackError
from fg_mujoco.messages import FloatArray

_STEEPEST = 0.1  # least cosine of the angle of incidence by which a derivative divides


@dataclass(frozen=True, kw_only=True, eq=False)
class RayHits:
    """Where rays meet walls first. Arrays have the shape (...) of the rays."""

    ranges: FloatArray  # [m]; inf: no wall
    cosines: FloatArray  # of the angle of incidence, 0 to 1; 0 without a wall
    along: FloatArray  # [m] arc length of the place along all walls
    derivatives: FloatArray  # (..., 3) of the range by x, y [-] and angle [m/rad] of the ray


@dataclass(frozen=True, kw_only=True, eq=False)
class MapWalls:
    """The walls of a map as segments from `starts` (k, 2) to `ends` (k, 2) [m]."""

    starts: FloatArray
    ends: FloatArray
    resolution: float  # [m] of a pixel of the map

    @classmethod
    def of(cls, path: str | Path) -> MapWalls:
        """Return the walls of a map_server YAML: the edges of its free ground.

        Raises:
          MissingExtraError: the extra `maps` is not installed.
          TrackError: a YAML or an image that cannot be read, or no wall in it.
        """
        occupancy = read_map_file(path)
        # the image's border is no wall: what is beyond it is free here, and ends no ray
        padded = replace(occupancy, free=np.pad(occupancy.free, 1, constant_values=True))
        loops = [trace(outline) - 1.0 for outline in outlines(~padded.free)]
        if not loops:
            raise TrackError(f"{path}: no wall in the map; accepted: a map with occupied pixels")
        walls = [occupancy.to_world(loop) for loop in loops]
        ends = np.concatenate([np.roll(wall, -1, axis=0) for wall in walls])
        return cls(starts=np.concatenate(walls), ends=ends, resolution=occupancy.resolution)

    def hits(self, origins: FloatArray, angles: FloatArray, *, reach: float = 30.0) -> RayHits:
        """Return where rays from `origins` (..., 2) [m] at `angles` (...) [rad] first meet walls, up to `reach` [m]."""
        flat = np.ascontiguousarray(angles, np.float64).ravel()
        places = np.ascontiguousarray(origins, np.float64).reshape(-1, 2)
        ranges, which = _first_hits(self.starts, self.ends, places, flat, reach)
        tangents = self.ends - self.starts
        lengths = np.hypot(*tangents.T)
        normals = np.stack((tangents[:, 1], -tangents[:, 0]), axis=1) / lengths[:, None]
        ahead = np.stack((np.cos(flat), np.sin(flat)), axis=1)
        hit = which >= 0
        normal = np.where(hit[:, None], normals[which], 0.0)
        cosine = np.sum(ahead * normal, axis=1)
        divisor = np.where(np.abs(cosine) < _STEEPEST, np.copysign(_STEEPEST, cosine), cosine)
        leftward = np.stack((-ahead[:, 1], ahead[:, 0]), axis=1)
        turned = -np.where(hit, ranges, 0.0) * np.sum(leftward * normal, axis=1) / divisor
        derivatives = np.column_stack((-normal / divisor[:, None], turned))
        ends = places + np.where(hit, ranges, 0.0)[:, None] * ahead
        begins = np.concatenate(([0.0], np.cumsum(lengths)))
        along = begins[which] + np.hypot(*(ends - self.starts[which]).T)
        shape = np.shape(angles)
        return RayHits(
            ranges=ranges.reshape(shape), cosines=np.abs(cosine).reshape(shape),
            along=np.where(hit, along, 0.0).reshape(shape), derivatives=derivatives.reshape(*shape, 3),
        )  # fmt: skip

    @property
    def length(self) -> float:
        """Length of all walls together [m]."""
        return float(np.hypot(*(self.ends - self.starts).T).sum())


@kernel
def _first_hits(
    starts: FloatArray, ends: FloatArray, origins: FloatArray, angles: FloatArray, reach: float
) -> tuple[FloatArray, NDArray[np.int64]]:
    """Return range [m] and segment of the first wall along each ray; inf and -1 where there is none within `reach`."""
    ranges, which = np.full(len(angles), np.inf), np.full(len(angles), -1)
    for ray in range(len(angles)):
        x, y = math.cos(angles[ray]), math.sin(angles[ray])
        nearest = reach
        for segment in range(len(starts)):
            from_x, from_y = starts[segment, 0] - origins[ray, 0], starts[segment, 1] - origins[ray, 1]
            along_x, along_y = ends[segment, 0] - starts[segment, 0], ends[segment, 1] - starts[segment, 1]
            before = x * from_y - y * from_x  # to which side of the ray the segment begins, and ends
            after = before + x * along_y - y * along_x
            if (before > 0.0) == (after > 0.0):
                continue
            distance = (from_x * along_y - from_y * along_x) / (after - before)
            if 0.0 < distance < nearest:
                nearest = distance
                ranges[ray], which[ray] = distance, segment
    return ranges, which
