"""Decides whether a car can drive a lap by a search over its forward motions.

    poses = drivable_lap(track)    # (n, 3), or None where there is no way

The search is over the states of hybrid A*, but depth first (Dolgov et al. 2010). From the start pose the car drives
arcs of length `STEP`, each with one of five curvatures up to full lock. Of all free poses in one cell of position and
heading the first is kept. A pose is free if the footprint, grown by a margin all round, touches no wall. A way that
falls back along the centreline by 0.8 m is given up, so that the car drives neither in circles nor the wrong way round.
A lap is found when the progress reaches the length of the track.

A way that is returned is a proof. A search that ends without one has tried every cell: it may miss a way that needs
poses finer than the cells.
"""

from __future__ import annotations

import math

import numpy as np

from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.course.course import outline
from fg_mujoco.course.projection import follow
from fg_mujoco.course.track import Track
from fg_mujoco.messages import FloatArray

MARGIN = 0.05  # [m] all round the footprint
STEP = 0.1  # [m] that the rear axle drives between two poses

# of the bundled vehicle `f1tenth` [m]: over all, rear axle to rear bumper, and of the rear axle at full steering
_LENGTH, _WIDTH, _REAR_OVERHANG, _TURNING_RADIUS = 0.58, 0.31, 0.11855, 0.7416

_CURVATURES = 5  # from full lock to the right to full lock to the left
_CELL = 0.05  # [m] of the cells of position; a step always leaves one
_HEADINGS = 72  # cells of heading in a turn
_FIELD = 0.02  # [m] of the grid of distances
_CIRCLES = 6  # that cover the footprint, in a row along it
_BEHIND = 0.8  # [m] that the car may fall behind its greatest progress: less than on a full circle
_ALIGNED = math.cos(math.radians(45.0))  # of the angle between the last heading and the centreline


def drivable_lap(track: Track) -> FloatArray | None:
    """Return poses of a lap that `f1tenth` can drive forward, from the start of a track and over its line again.

    Returns:
      x [m], y [m] of the rear axle and heading [rad], every `STEP`, shape (n, 3); None where no lap was found.
    """
    along = _LENGTH / _CIRCLES
    middles = np.array([along * (circle + 0.5) - _REAR_OVERHANG for circle in range(_CIRCLES)])
    radius = math.hypot(0.5 * along, 0.5 * _WIDTH) + MARGIN + math.sqrt(0.5) * _FIELD  # the last: the grid's error
    walls = np.concatenate([outline(edge) for edge in track.edges])
    low = walls.reshape(-1, 2).min(axis=0) - 1.0
    columns, rows = np.ceil((walls.reshape(-1, 2).max(axis=0) + 1.0 - low) / _FIELD).astype(int).tolist()
    field = _distances(walls, low, columns, rows, radius + 2.0 * _FIELD)
    poses = _search(
        field, low, radius, middles, np.array(track.start_pose()), 1.0 / _TURNING_RADIUS, track.table, track.length
    )
    return poses if len(poses) else None


@kernel
def _distances(walls: FloatArray, low: FloatArray, columns: int, rows: int, reach: float) -> FloatArray:
    """Return the distance of each node of a grid to the nearest wall, where it is within reach; else inf. [m]"""
    field = np.full((columns, rows), math.inf)
    for k in range(len(walls)):
        ax, ay, bx, by = walls[k, 0] - low[0], walls[k, 1] - low[1], walls[k, 2] - low[0], walls[k, 3] - low[1]
        along_x, along_y = bx - ax, by - ay
        squared = along_x * along_x + along_y * along_y
        for i in range(int((min(ax, bx) - reach) / _FIELD), int((max(ax, bx) + reach) / _FIELD) + 2):
            for j in range(int((min(ay, by) - reach) / _FIELD), int((max(ay, by) + reach) / _FIELD) + 2):
                x, y = i * _FIELD - ax, j * _FIELD - ay
                share = min(max((x * along_x + y * along_y) / squared, 0.0), 1.0)
                away = math.hypot(x - share * along_x, y - share * along_y)
                field[i, j] = min(field[i, j], away)
    return field


@kernel
def _is_free(
    field: FloatArray, low: FloatArray, radius: float, middles: FloatArray, x: float, y: float, heading: float
) -> bool:
    """Tell whether all circles of the footprint are clear of the walls at a pose."""
    cos, sin = math.cos(heading), math.sin(heading)
    for middle in middles:
        i, j = round((x + middle * cos - low[0]) / _FIELD), round((y + middle * sin - low[1]) / _FIELD)
        if field[i, j] < radius:
            return False
    return True


@kernel
def _search(
    field: FloatArray, low: FloatArray, radius: float, middles: FloatArray, start: FloatArray, lock: float,
    table: FloatArray, length: float,
) -> FloatArray:  # fmt: skip
    """Return the poses of a lap, (n, 3), none where there is none. Depth first, and straight on before all else."""
    if not _is_free(field, low, radius, middles, start[0], start[1], start[2]):
        return np.empty((0, 3))
    columns, rows = int(field.shape[0] * _FIELD / _CELL) + 1, int(field.shape[1] * _FIELD / _CELL) + 1
    seen = np.zeros((columns, rows, _HEADINGS), np.bool_)
    nodes = np.zeros((1 << 16, 6))  # x, y, heading, the node before, progress, and the greatest so far
    stack = np.empty(1 << 16, np.int64)
    nodes[0, :3], nodes[0, 3] = start, -1.0
    stack[0] = 0
    count, waiting = 1, 1
    while waiting > 0:
        waiting -= 1
        node = stack[waiting]
        x, y, heading, progress, greatest = (
            nodes[node, 0],
            nodes[node, 1],
            nodes[node, 2],
            nodes[node, 4],
            nodes[node, 5],
        )
        # full lock is put on the stack first, and straight on last, so that it is taken first
        for choice in range(_CURVATURES):
            share = 1.0 - (choice // 2) * 2.0 / (_CURVATURES - 1)
            curvature = lock * (share if choice % 2 == 0 else -share)
            half_turn = 0.5 * curvature * STEP
            chord = STEP if half_turn == 0.0 else STEP * math.sin(half_turn) / half_turn
            new_x = x + chord * math.cos(heading + half_turn)
            new_y = y + chord * math.sin(heading + half_turn)
            new_heading = heading + 2.0 * half_turn
            i, j = int((new_x - low[0]) / _CELL), int((new_y - low[1]) / _CELL)
            k = round(new_heading / (2.0 * math.pi) * _HEADINGS) % _HEADINGS
            if seen[i, j, k]:
                continue
            if not _is_free(field, low, radius, middles, new_x, new_y, new_heading):
                continue
            place, _ = follow(new_x, new_y, progress % length, table, length)
            gone = (place - progress + 0.5 * length) % length - 0.5 * length
            if progress + gone < greatest - _BEHIND:
                continue
            seen[i, j, k] = True
            if count == len(nodes):
                more = np.empty((2 * count, 6))
                more[:count] = nodes
                nodes = more
            nodes[count, 0], nodes[count, 1], nodes[count, 2] = new_x, new_y, new_heading
            nodes[count, 3], nodes[count, 4] = float(node), progress + gone
            nodes[count, 5] = max(greatest, progress + gone)
            count += 1
            if progress + gone >= length and math.cos(new_heading - start[2]) > _ALIGNED:
                return _way(nodes, count - 1)
            if waiting == len(stack):
                longer = np.empty(2 * waiting, np.int64)
                longer[:waiting] = stack
                stack = longer
            stack[waiting] = count - 1
            waiting += 1
    return np.empty((0, 3))


@kernel
def _way(nodes: FloatArray, last: int) -> FloatArray:
    """Return the poses from the first node to the last, (n, 3)."""
    count, node = 0, last
    while node >= 0:
        count, node = count + 1, int(nodes[node, 3])
    way = np.empty((count, 3))
    node = last
    for place in range(count - 1, -1, -1):
        way[place] = nodes[node, :3]
        node = int(nodes[node, 3])
    return way
