"""The signed distance to the walls of a map, on a grid, with the ground that a car can be on.

    field = DistanceField.of(map_line)      # made once for each map, and shared
    distance_at(field.distances, column, row)

The walls are closed polylines. A node of the grid has the distance to the nearest point of a wall: positive on the free
ground, negative beyond a wall. Between nodes the distance is interpolated linearly, so that it changes its sign on a
straight wall itself, wherever the wall runs through the cell.

Sources: P. Danielsson, Euclidean Distance Mapping, Computer Graphics and Image Processing 14, 1980, whose sweeps carry
the nearest wall from node to node; S. Kohlbrecher et al., A Flexible and Scalable SLAM System with Full 3D Motion
Estimation, SSRR 2011, for interpolation between cells.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.errors import SettingsError
from fg_mujoco.messages import FloatArray, MapLine

RESOLUTION = 0.05
"""[m] Between nodes, unless the map is so large that it would have more than `MOST_NODES`."""
MOST_NODES = 6_000_000

_MARGIN = 1.0  # [m] round the walls
_ROUNDS = 2  # of sweeps; after the second, distances no longer change

Distances = NDArray[np.float32]


@dataclass(frozen=True, kw_only=True, eq=False)
class DistanceField:
    """Signed distances on the nodes of a grid, row 0 at the least y.

    Attributes:
      distances: (rows, columns) [m], positive on the free ground.
      origin: (2,) x and y [m] of node (0, 0).
      resolution: [m] between nodes.
      free: (k, 2) x and y [m] of the nodes on the free ground.
    """

    distances: Distances
    origin: FloatArray
    resolution: float
    free: FloatArray

    @classmethod
    def of(cls, map_line: MapLine) -> DistanceField:
        """Return the field of a map; maps of the same walls share it.

        Raises:
          SettingsError: the map has no walls, or no free ground.
        """
        if not map_line.walls:
            raise SettingsError("the map has a line and no walls; accepted: a map with walls, to localise in it")
        lengths = tuple(len(wall) for wall in map_line.walls)
        return _made(np.concatenate(map_line.walls).tobytes(), lengths, map_line.points[0].tobytes())


@lru_cache(maxsize=8)
def _made(points: bytes, lengths: tuple[int, ...], inside: bytes) -> DistanceField:
    """Return the field of walls whose points come one after the other; `inside` is a point of the free ground."""
    joined = np.frombuffer(points).reshape(-1, 2)
    walls = np.split(joined, np.cumsum(lengths)[:-1])
    segments = np.concatenate([np.hstack((wall, np.roll(wall, -1, axis=0))) for wall in walls])
    low, high = joined.min(axis=0) - _MARGIN, joined.max(axis=0) + _MARGIN
    resolution = max(RESOLUTION, math.sqrt(float(np.prod(high - low)) / MOST_NODES))
    columns, rows = (np.ceil((high - low) / resolution).astype(int) + 1).tolist()
    distances = wall_distances(segments, low, resolution, rows, columns)
    free = _free_nodes(walls, low, resolution, rows, columns, np.frombuffer(inside))
    np.negative(distances, out=distances, where=~free)
    row, column = np.nonzero(free)
    if not len(row):
        raise SettingsError("the map has no free ground between its walls; accepted: a map with some")
    places = low + resolution * np.column_stack((column, row))
    for array in (distances, places, low):
        array.flags.writeable = False
    return DistanceField(distances=distances, origin=low, resolution=resolution, free=places)


def _free_nodes(
    walls: Sequence[FloatArray], origin: FloatArray, resolution: float, rows: int, columns: int, inside: FloatArray
) -> NDArray[np.bool_]:
    """Return which nodes are on the free ground: they lie in as many walls as a point there, odd or none."""
    around = np.zeros((rows, columns), np.int64)
    place = (inside - origin) / resolution
    count = 0
    for wall in walls:
        corners = (wall - origin) / resolution
        filled = np.zeros((rows, columns + 1), np.bool_)
        _fill(corners, filled)
        around += filled[:, :-1]
        count += _is_in(corners, place)
    return np.asarray(around % 2 == 1) if count % 2 else around == 0


@kernel
def _is_in(corners: FloatArray, place: FloatArray) -> bool:
    """Return whether a place is inside a closed polyline (k, 2)."""
    inside = False
    for k in range(len(corners)):
        x, y = corners[k]
        end_x, end_y = corners[(k + 1) % len(corners)]
        if (y > place[1]) != (end_y > place[1]) and place[0] < x + (place[1] - y) / (end_y - y) * (end_x - x):
            inside = not inside
    return inside


@kernel
def _fill(corners: FloatArray, filled: NDArray[np.bool_]) -> None:
    """Mark the nodes inside a closed polyline (k, 2), in nodes; the last column of `filled` is room."""
    rows, columns = filled.shape
    for k in range(len(corners)):
        x, y = corners[k]
        end_x, end_y = corners[(k + 1) % len(corners)]
        for row in range(max(math.ceil(min(y, end_y)), 0), min(math.ceil(max(y, end_y)), rows)):
            at = math.ceil(x + (row - y) / (end_y - y) * (end_x - x))
            at = min(max(at, 0), columns - 1)
            filled[row, at] = not filled[row, at]
    for row in range(rows):
        inside = False
        for column in range(columns):
            inside = inside != filled[row, column]
            filled[row, column] = inside


@kernel
def _to_segment(segments: FloatArray, k: int, x: float, y: float) -> float:
    """Return the squared distance of a point from a segment [m^2]."""
    along_x, along_y = segments[k, 2] - segments[k, 0], segments[k, 3] - segments[k, 1]
    dx, dy = x - segments[k, 0], y - segments[k, 1]
    squared = along_x * along_x + along_y * along_y
    share = min(max((dx * along_x + dy * along_y) / squared, 0.0), 1.0) if squared > 0.0 else 0.0
    dx, dy = dx - share * along_x, dy - share * along_y
    return float(dx * dx + dy * dy)


@kernel
def wall_distances(segments: FloatArray, origin: FloatArray, resolution: float, rows: int, columns: int) -> Distances:
    """Return the distance of each node from the nearest segment, unsigned (rows, columns) [m].

    Args:
      segments: x, y of the start and of the end (k, 4) [m].
      origin: of node (0, 0) (2,) [m].
      resolution: [m].
      rows: of nodes.
      columns: of nodes.
    """
    nearest = np.full((rows, columns), -1, np.int32)
    least = np.full((rows, columns), np.inf, np.float32)  # squared
    for k in range(len(segments)):
        along_x, along_y = segments[k, 2] - segments[k, 0], segments[k, 3] - segments[k, 1]
        count = max(1, math.ceil(math.hypot(along_x, along_y) / resolution))
        for step in range(count + 1):
            column = round((segments[k, 0] + step / count * along_x - origin[0]) / resolution)
            row = round((segments[k, 1] + step / count * along_y - origin[1]) / resolution)
            for i in range(max(row - 1, 0), min(row + 2, rows)):
                for j in range(max(column - 1, 0), min(column + 2, columns)):
                    squared = _to_segment(segments, k, origin[0] + j * resolution, origin[1] + i * resolution)
                    if squared < least[i, j]:
                        least[i, j], nearest[i, j] = squared, k
    for _ in range(_ROUNDS):
        for direction in range(4):
            down, left = direction % 2, direction // 2
            step_row, step_column = -1 if down else 1, -1 if left else 1
            for i in range(rows):
                row = rows - 1 - i if down else i
                for j in range(columns):
                    column = columns - 1 - j if left else j
                    _take(segments, nearest, least, origin, resolution, row, column, row - step_row, column)
                    _take(segments, nearest, least, origin, resolution, row, column, row, column - step_column)
                    _take(
                        segments, nearest, least, origin, resolution, row, column, row - step_row, column - step_column
                    )  # fmt: skip
    return np.sqrt(least)


@kernel
def _take(
    segments: FloatArray,
    nearest: NDArray[np.int32],
    least: Distances,
    origin: FloatArray,
    resolution: float,
    row: int,
    column: int,
    from_row: int,
    from_column: int,
) -> None:
    """Take over the nearest segment of another node, where it is nearer than the one that a node has."""
    if not (0 <= from_row < len(nearest) and 0 <= from_column < nearest.shape[1]):
        return
    other = nearest[from_row, from_column]
    if other < 0 or other == nearest[row, column]:
        return
    squared = _to_segment(segments, other, origin[0] + column * resolution, origin[1] + row * resolution)
    if squared < least[row, column]:
        least[row, column], nearest[row, column] = squared, other


@kernel
def distance_at(distances: Distances, column: float, row: float) -> float:
    """Return the distance between the nodes [m], at a place in nodes; at the border's outside that of the border."""
    rows, columns = distances.shape
    column, row = min(max(column, 0.0), columns - 1.001), min(max(row, 0.0), rows - 1.001)
    j, i = int(column), int(row)
    u, v = column - j, row - i
    below = distances[i, j] + u * (distances[i, j + 1] - distances[i, j])
    above = distances[i + 1, j] + u * (distances[i + 1, j + 1] - distances[i + 1, j])
    return float(below + v * (above - below))
