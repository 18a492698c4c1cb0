"""The way on: where the course goes that the car has not come from, and how far it is to there from everywhere.

1. The way back is closed like a wall: across the path of the last metres, as wide as the corridor was there.
2. From the car, distances spread over the free ground of the local map. Where they reach ground that nobody has
   seen is a frontier, unless that ground is only the shadow of a box or lies behind a crack in a wall. The way on is
   the frontier that is far and wide: a pocket that was seen to its end has none.
3. Where there is no frontier, the car may go round a course as short as its memory: then the way on is the far side
   of the closed path, to which it comes from behind. Else it is in a pocket, and the end of its path is opened again,
   2, 4 and 6 m of it.
4. From the way on, distances spread back over the free ground. Ground near a wall counts as longer, so that the
   shortest way goes round the end of a barrier on a circle and not along it.

Source: B. Yamauchi, A Frontier-Based Approach for Autonomous Exploration, IEEE CIRA 1997, for frontiers. E.
Dijkstra, A Note on Two Problems in Connexion with Graphs, Numerische Mathematik 1, 1959, with a ring of buckets (R.
Dial, Algorithm 360, CACM 12, 1969), for the distances.

Limits: a wide opening into a pocket whose end the car does not see yet looks like a way on.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.kernels import kernel
from fg_mujoco.messages import FloatArray

from ..control.settings import Record
from .local_map import (
    ALONG,
    CELL,
    EDGE,
    FREE,
    LEFT,
    LOCAL_MAP,
    PATH,
    RIGHT,
    RING,
    SIGHT,
    SIZE,
    UNKNOWN,
    WALL,
    cut_path,
    enter_scan,
    extend_path,
    in_window,
    move,
)
from .scan_geometry import period_of

FAR = 65535  # to_go of cells from which no way on is known
UNIT = 0.01  # [m] of to_go
NEAR_WALL, WAY_BACK, AT_WALL, HOLE = 1, 2, 4, 8
# bits of a blocked cell: within two cells of a wall; closed; within one cell; in the middle of a hole of three cells

_OPENED = 0.6  # [m] before the end of the path that stay open
_CLOSED = 15.0  # [m] of the path that are closed
_CLOSED_LOOP = 8.0  # [m] the same, on a course that is shorter
_ATTEMPTS = (
    (_OPENED, _CLOSED, AT_WALL | HOLE),
    (_OPENED, _CLOSED_LOOP, AT_WALL | HOLE),
    (_OPENED, _CLOSED, AT_WALL),
    (2.0, _CLOSED, NEAR_WALL),
    (4.0, _CLOSED, NEAR_WALL),
    (6.0, _CLOSED, NEAR_WALL),
)  # [m] from the end of the path: where it begins to be closed, and where it ends; bits of cells that are impassable
_WIDEST = 3.0  # [m] of a line across open ground, to either side
_POCKET = 6.0  # [m] deepest pocket that the car leaves again
_LEAST_FRONTIER = 5  # cells
_LEAST_FRONTIER_BACK = 10  # cells, where the car has to leave a pocket for it
_WIDE = 3.0  # [m] of a frontier; more counts as this
_ROOM = 150  # cells that nobody has seen behind a frontier, or it is a shadow or a crack in a wall
_SAME = 1.0  # [m] from the last way on: a frontier counts as the same, and as 1 m farther
_LEAST_LOOP = 3.0  # [m] to the far side of a closed path
_LEAST_AGE = 5.0  # [m] of the part of the path that the car comes upon there
_FREE_START = 4  # cells from the car that may be near a wall
_BUCKETS = 64  # above the greatest cost of a step
_LAST = SIZE * SIZE - 1

WAY_ON = np.dtype(
    [
        ("map", LOCAL_MAP),
        ("ticks", np.int64),
        ("found", np.bool_),
        ("hidden", np.bool_),  # the frontier is nearer than the sight, so something hides what is behind it
        ("x", np.float64),  # [m] of the middle of the way on
        ("y", np.float64),
        ("edge_x", np.float64),  # [m] of the nearest of its cells that is not near a wall
        ("edge_y", np.float64),
        ("to_go", np.uint16, (SIZE, SIZE)),  # to the way on [UNIT], by column and row in the ring; FAR: not known
        ("blocked", np.uint8, (SIZE, SIZE)),  # bits, see NEAR_WALL
    ]
)
"""Type of the memory; zero at the beginning."""


@kernel
def look_for_way_on(
    scan: Record, ranges: FloatArray, odometry: Record, lidar_offset: float, memory: Record, every: int
) -> None:
    """Take a scan and odometry into the memory, in every tick.

    The way on is looked for in every `every`-th tick.

    Args:
      scan: of type SCAN.
      ranges: its readings (n,) [m], without NaN or inf.
      odometry: of type ODOMETRY.
      lidar_offset: of the LiDAR ahead of the rear axle [m].
      memory: of type WAY_ON, written to.
      every: ticks.
    """
    world = memory.map
    move(world, odometry.speed, odometry.angular_velocity[2], period_of(scan))
    extend_path(world, scan, ranges)
    enter_scan(world, scan, ranges, lidar_offset)
    if memory.ticks % every == 0:
        _find(memory, lidar_offset)
    memory.ticks += 1


@kernel
def to_go_at(memory: Record, x: float, y: float) -> int:
    """Return the way to go [UNIT] from a place [m], FAR where it is not known."""
    i, j = math.floor(x / CELL), math.floor(y / CELL)
    return memory.to_go[i & RING, j & RING] if in_window(memory.map, i, j) else FAR


@kernel
def to_go_around(memory: Record, x: float, y: float) -> float:
    """Return the way to go [m] from a place, or from the nearest one within .6 m from where it is known; else inf."""
    for reach in range(7):
        least = math.inf
        for i in range(-reach, reach + 1):
            for j in range(-reach, reach + 1):
                if max(abs(i), abs(j)) == reach:
                    cells = to_go_at(memory, x + i * CELL, y + j * CELL)
                    if cells != FAR:
                        least = min(least, cells * UNIT + reach * CELL)
        if least < math.inf:
            return least
    return math.inf


@kernel
def least_to_go_along(memory: Record, x: float, y: float, heading: float, distance: float) -> tuple[float, float]:
    """Return the least way to go [m] on a line from a place, inf if none is known, and how far along that is [m]."""
    step_x, step_y = 0.2 * math.cos(heading), 0.2 * math.sin(heading)
    least, at = math.inf, 0.0
    for step in range(1, int(min(distance, SIGHT) / 0.2) + 1):
        cells = to_go_at(memory, x + step * step_x, y + step * step_y)
        if cells != FAR and cells * UNIT < least:
            least, at = cells * UNIT, 0.2 * step
    return least, at


@kernel
def _find(memory: Record, lidar_offset: float) -> None:
    """Look for the way on, and write how far it is to there."""
    world, blocked = memory.map, memory.blocked
    walls, near = np.zeros((SIZE, SIZE), np.uint8), np.zeros((SIZE, SIZE), np.uint8)
    _mark_walls(world, walls, near)
    distance = np.empty((SIZE, SIZE), np.uint16)
    queue, goal = np.empty((SIZE * SIZE, 2), np.int32), np.empty((SIZE * SIZE, 2), np.int32)
    i = math.floor((world.x + lidar_offset * math.cos(world.heading)) / CELL)
    j = math.floor((world.y + lidar_offset * math.sin(world.heading)) / CELL)
    loop, count = False, 0
    open_ground = False
    for attempt in range(len(_ATTEMPTS)):
        opened, closed, impassable = _ATTEMPTS[attempt]
        for _ in range(2):
            blocked[:] = walls
            _close_way_back(world, blocked, opened, closed, open_ground)
            distance[:] = FAR
            queue[0, 0], queue[0, 1] = i, j
            distance[i & RING, j & RING] = 0
            reached = _flood(world, blocked, distance, queue, impassable)
            if attempt > 0 or open_ground or not _is_open_ground(world, distance):
                break
            open_ground = True
        if closed < _CLOSED and open_ground:
            continue
        least = _LEAST_FRONTIER if opened == _OPENED else _LEAST_FRONTIER_BACK
        if closed == _CLOSED:
            count = _choose_frontier(memory, blocked, distance, queue, reached, least, goal)
        if count > 0:
            if opened > _OPENED:
                cut_path(world, max(world.along - opened, world.furthest - _POCKET))
            break
        if closed < _CLOSED:
            place = reached - 1
            while place > 0:
                a, b = queue[place, 0], queue[place, 1]
                if _beside_way_back(blocked, a, b) and _comes_from_behind(world, distance, a, b):
                    break
                place -= 1
            a, b = queue[place, 0], queue[place, 1]
            loop = distance[a & RING, b & RING] * CELL > _LEAST_LOOP
            if loop:
                goal[0, 0], goal[0, 1], count = a, b, 1
                memory.x, memory.y = a * CELL, b * CELL
                break
    memory.found = count > 0
    memory.hidden = memory.found and not loop and math.hypot(memory.x - world.x, memory.y - world.y) < SIGHT - 1.0
    memory.edge_x, memory.edge_y = memory.x, memory.y
    if not loop:
        _find_edge(memory, goal, count)
    memory.to_go[:] = FAR
    _spread(world, blocked, near, memory.to_go, goal, count, AT_WALL | impassable & HOLE)


@kernel
def _mark_walls(world: Record, walls: NDArray[np.uint8], near: NDArray[np.uint8]) -> None:
    """Write the bits of cells near walls, and near how far they are: 3 within 4 cells, 1 within 6, else 0."""
    padded = np.zeros(SIZE + 12, np.uint8)
    one, two = np.zeros((SIZE, SIZE), np.uint8), np.zeros((SIZE, SIZE), np.uint8)
    four, six = np.zeros((SIZE, SIZE), np.uint8), np.zeros((SIZE, SIZE), np.uint8)
    holes = np.zeros((SIZE, SIZE), np.uint8)
    for i in range(SIZE):
        cells = world.cells[i]
        some = 0
        for j in range(SIZE):
            padded[j + 6] = cells[j] == WALL
            some |= padded[j + 6]
        if some == 0:
            continue
        padded[:6], padded[SIZE + 6 :] = padded[SIZE : SIZE + 6].copy(), padded[6:12].copy()
        for j in range(SIZE):
            holes[i, j] = padded[j + 4] & padded[j + 8]
            one[i, j] = padded[j + 5] | padded[j + 6] | padded[j + 7]
            two[i, j] = one[i, j] | padded[j + 4] | padded[j + 8]
            four[i, j] = two[i, j] | padded[j + 2] | padded[j + 3] | padded[j + 9] | padded[j + 10]
            six[i, j] = four[i, j] | padded[j] | padded[j + 1] | padded[j + 11] | padded[j + 12]
    for i in range(SIZE):
        a, b, c, d = (i - 2) & RING, (i - 1) & RING, (i + 1) & RING, (i + 2) & RING
        for j in range(SIZE):
            octagon = one[a, j] | two[b, j] | two[i, j] | two[c, j] | one[d, j]
            at_wall = one[i, j] | (world.cells[b, j] == WALL) | (world.cells[c, j] == WALL)
            hole = holes[i, j] | ((world.cells[a, j] == WALL) & (world.cells[d, j] == WALL))
            walls[i, j] = octagon * NEAR_WALL | at_wall * AT_WALL | hole * HOLE
    _mark_distances(four, six, near)


@kernel
def _mark_distances(four: NDArray[np.uint8], six: NDArray[np.uint8], near: NDArray[np.uint8]) -> None:
    """Write 3 to `near` where a wall is within 4 cells, 1 where it is within 6, else 0.

    A row of `four` or `six` says where a wall is so near within the same row. Rows are joined in steps of 2 and 4, so
    that each is read a few times instead of thirteen.

    Args:
      four: (SIZE, SIZE), 1 where a wall is within 4 cells in the same row; overwritten.
      six: the same within 6 cells; overwritten.
      near: written to.
    """
    both = four  # bits: 2, within 4 cells; 1, within 6
    for i in range(SIZE):
        for j in range(SIZE):
            both[i, j] = four[i, j] << np.uint8(1) | six[i, j]
    two_rows, four_rows = np.empty((SIZE, SIZE), np.uint8), six  # of this row and the next one or three
    for i in range(SIZE):
        k = (i + 1) & RING
        for j in range(SIZE):
            two_rows[i, j] = both[i, j] | both[k, j]
    for i in range(SIZE):
        k = (i + 2) & RING
        for j in range(SIZE):
            four_rows[i, j] = two_rows[i, j] | two_rows[k, j]
    for i in range(SIZE):
        a, b, c, d = (i - 6) & RING, (i - 4) & RING, (i + 4) & RING, (i + 5) & RING
        for j in range(SIZE):
            outer = (two_rows[a, j] | two_rows[d, j]) & np.uint8(1)
            near[i, j] = four_rows[b, j] | four_rows[i, j] | both[c, j] | outer


@kernel
def _close_way_back(world: Record, blocked: NDArray[np.uint8], opened: float, closed: float, open_ground: bool) -> None:
    """Block a line across the corridor at each point of the path from `opened` to `closed` [m] before its end.

    On open ground the lines go on up to a wall, or _WIDEST to either side.
    """
    until = world.along - opened
    if opened > _OPENED:
        until = max(until, world.furthest - _POCKET)
    for back in range(world.known):
        point = world.path[(world.newest - back) % PATH]
        if world.along - point[ALONG] > closed:
            break
        if point[ALONG] > until:
            continue
        sin, cos = math.sin(point[2]), math.cos(point[2])
        for side in (1, -1):
            room = point[LEFT] if side == 1 else point[RIGHT]
            for step in range(int((_WIDEST if open_ground else room) / (0.5 * CELL)) + 1):
                i, j = _aside(point, sin, cos, side * 0.5 * CELL * step)
                if not in_window(world, i, j):
                    break
                if open_ground and 0.5 * CELL * step > room and world.cells[i & RING, j & RING] == WALL:
                    break
                blocked[i & RING, j & RING] |= WAY_BACK
                blocked[(i + 1) & RING, j & RING] |= WAY_BACK  # two cells, or a diagonal step passes it


@kernel
def _aside(point: FloatArray, sin: float, cos: float, aside: float) -> tuple[int, int]:
    """Return the column and row of the cell beside a point of the path [m], left positive.

    The caller computes the sine and cosine of the point's heading once for all cells of a line.
    """
    return math.floor((point[0] - aside * sin) / CELL), math.floor((point[1] + aside * cos) / CELL)


@kernel
def _is_open_ground(world: Record, distance: NDArray[np.uint16]) -> bool:
    """Say whether the ground beside the closed path is reached from the car at a third of its points, or more."""
    points, passed = 0, 0
    for back in range(world.known):
        point = world.path[(world.newest - back) % PATH]
        age = world.along - point[ALONG]
        if age > _CLOSED:
            break
        if age > 2.0:
            points += 1
            sin, cos = math.sin(point[2]), math.cos(point[2])
            for side in (1, -1):
                room = point[LEFT] if side == 1 else point[RIGHT]
                walled = False  # the ground behind a thin barrier is another lane
                for cells in range(-1, 3):
                    i, j = _aside(point, sin, cos, side * (room + cells * CELL))
                    walled = walled or not in_window(world, i, j) or world.cells[i & RING, j & RING] == WALL
                if not walled and distance[i & RING, j & RING] != FAR:
                    passed += 1
                    break
    return 3 * passed > points > 10


@kernel
def _neighbour(k: int) -> tuple[int, int]:
    """Return the offset of a neighbour: the first four share a side."""
    if k < 4:
        return (1, 0) if k == 0 else ((-1, 0) if k == 1 else ((0, 1) if k == 2 else (0, -1)))
    return 1 if k < 6 else -1, 1 if k % 2 == 0 else -1


@kernel
def _flood(
    world: Record, blocked: NDArray[np.uint8], distance: NDArray[np.uint16], queue: NDArray[np.int32], impassable: int
) -> int:
    """Spread distances [cells] from the first cell of the queue; return how many cells were reached.

    Steps to four neighbours and to eight take turns, which makes circles octagons. No step leaves the window: the cells
    around it are unknown.
    """
    first, count, level = 0, 1, 0
    while first < count:
        end = count
        for place in range(first, end):
            i, j = queue[place, 0], queue[place, 1]
            for k in range(8 if level % 2 == 1 else 4):
                di, dj = _neighbour(k)
                a, b = i + di, j + dj
                p, q = a & RING, b & RING
                if distance[p, q] != FAR or world.cells[p, q] != FREE:
                    continue
                bits = blocked[p, q]
                if bits & WAY_BACK != 0 or (bits & impassable != 0 and level >= _FREE_START):
                    continue
                distance[p, q] = level + 1
                queue[count, 0], queue[count, 1] = a, b
                count += 1
        first = end
        level += 1
    return count


@kernel
def _choose_frontier(
    memory: Record,
    blocked: NDArray[np.uint8],
    distance: NDArray[np.uint16],
    queue: NDArray[np.int32],
    reached: int,
    least: int,
    goal: NDArray[np.int32],
) -> int:
    """Write the cells of the best frontier to `goal`, and where its middle is; return how many cells, 0: none.

    Args:
      memory: of type WAY_ON, written to.
      blocked: bits of each cell.
      distance: of each cell from the car [cells].
      queue: the cells that were reached.
      reached: how many.
      least: cells of a frontier.
      goal: written to.
    """
    world, cells = memory.map, memory.map.cells
    label = np.zeros((SIZE, SIZE), np.uint8)  # 1: at unknown ground, 2: in a frontier that was looked at
    for place in range(reached):
        i, j = queue[place, 0], queue[place, 1]
        if abs(i - world.column) < EDGE and abs(j - world.row) < EDGE:
            for k in range(4):
                di, dj = _neighbour(k)
                if cells[(i + di) & RING, (j + dj) & RING] == UNKNOWN:
                    label[i & RING, j & RING] = 1
    group, behind = np.empty((reached, 2), np.int32), np.empty((_ROOM + 8, 2), np.int32)
    best, best_count, last_x, last_y = 0.0, 0, memory.x, memory.y
    for place in range(reached):
        i, j = queue[place, 0], queue[place, 1]
        if label[i & RING, j & RING] != 1:
            continue
        label[i & RING, j & RING] = 2
        group[0, 0], group[0, 1] = i, j
        count, at = 1, 0
        far, x, y = 0.0, 0.0, 0.0
        while at < count:
            i, j = group[at, 0], group[at, 1]
            at += 1
            far += distance[i & RING, j & RING] * CELL
            x += i * CELL
            y += j * CELL
            for a in range(i - 1, i + 2):
                for b in range(j - 1, j + 2):
                    if label[a & RING, b & RING] == 1:
                        label[a & RING, b & RING] = 2
                        group[count, 0], group[count, 1] = a, b
                        count += 1
        if count < least:
            continue
        far, x, y = far / count, x / count, y / count
        score = far + 2.0 * min(count * CELL, _WIDE)
        if memory.found and math.hypot(x - last_x, y - last_y) < _SAME:
            score += 1.0
        if score > best and _has_room_behind(world, blocked, distance, label, group, count, behind):
            best, best_count, memory.x, memory.y = score, count, x, y
            for k in range(count):
                goal[k, 0], goal[k, 1] = group[k, 0], group[k, 1]
    return best_count


@kernel
def _has_room_behind(
    world: Record,
    blocked: NDArray[np.uint8],
    distance: NDArray[np.uint16],
    label: NDArray[np.uint8],
    group: NDArray[np.int32],
    count: int,
    behind: NDArray[np.int32],
) -> bool:
    """Say whether a frontier may lead on: there is room behind it, or ground that the car does not reach otherwise.

    Args:
      world: of type LOCAL_MAP.
      blocked: bits of each cell.
      distance: of each cell from the car [cells].
      label: of each cell that nobody has seen, written to: 3: behind a frontier that does not lead on, 4: that does.
      group: cells of the frontier.
      count: how many.
      behind: written to.
    """
    reached, at, leads_on = 0, 0, False
    while at < count + reached and not leads_on:
        place = group[at] if at < count else behind[at - count]
        for k in range(4):
            di, dj = _neighbour(k)
            i, j = place[0] + di, place[1] + dj
            p, q = i & RING, j & RING
            if not in_window(world, i, j) or label[p, q] == 4:
                leads_on = True
            elif world.cells[p, q] == UNKNOWN and label[p, q] == 0 and blocked[p, q] & (NEAR_WALL | WAY_BACK) == 0:
                label[p, q] = 3
                behind[reached, 0], behind[reached, 1] = i, j
                reached += 1
            elif at >= count and world.cells[p, q] == FREE and distance[p, q] == FAR and blocked[p, q] & NEAR_WALL == 0:
                leads_on = True
        leads_on = leads_on or reached >= _ROOM
        at += 1
    for k in range(reached if leads_on else 0):
        label[behind[k, 0] & RING, behind[k, 1] & RING] = 4
    return leads_on


@kernel
def _find_edge(memory: Record, goal: NDArray[np.int32], count: int) -> None:
    """Write where the nearest cell of a frontier is that is not near a wall."""
    world, least = memory.map, math.inf
    for k in range(count):
        i, j = goal[k, 0], goal[k, 1]
        distance = math.hypot((i + 0.5) * CELL - world.x, (j + 0.5) * CELL - world.y)
        if distance < least and memory.blocked[i & RING, j & RING] & NEAR_WALL == 0:
            least, memory.edge_x, memory.edge_y = distance, (i + 0.5) * CELL, (j + 0.5) * CELL


@kernel
def _beside_way_back(blocked: NDArray[np.uint8], i: int, j: int) -> bool:
    """Say whether a cell is within two cells of the closed way back."""
    for a in range(i - 2, i + 3):
        for b in range(j - 2, j + 3):
            if blocked[a & RING, b & RING] & WAY_BACK != 0:
                return True
    return False


@kernel
def _comes_from_behind(world: Record, distance: NDArray[np.uint16], i: int, j: int) -> bool:
    """Say whether distances grow, at a cell beside the path, in the direction in which the car came by there."""
    x, y, here = 0.0, 0.0, distance[i & RING, j & RING]
    for di in range(-2, 3):
        for dj in range(-2, 3):
            there = distance[(i + di) & RING, (j + dj) & RING]
            if there != FAR:
                x += di * (float(there) - here)
                y += dj * (float(there) - here)
    nearest, along, age = math.inf, 0.0, 0.0
    for back in range(world.known):
        point = world.path[(world.newest - back) % PATH]
        apart = math.hypot(point[0] - i * CELL, point[1] - j * CELL)
        if apart < nearest:
            nearest, age = apart, world.along - point[ALONG]
            along = math.cos(point[2]) * x + math.sin(point[2]) * y
    return along > 0.5 * math.hypot(x, y) and age > _LEAST_AGE


@kernel
def _spread(
    world: Record,
    blocked: NDArray[np.uint8],
    near: NDArray[np.uint8],
    to_go: NDArray[np.uint16],
    goal: NDArray[np.int32],
    count: int,
    impassable: int,
) -> None:
    """Write the way to go [UNIT] from all free cells to the nearest of `count` cells of `goal`."""
    heads = np.full(_BUCKETS, -1, np.int32)  # of the lists of cells that wait, by their way to go modulo _BUCKETS
    cells, links = np.empty(4 * SIZE * SIZE, np.int32), np.empty(4 * SIZE * SIZE, np.int32)
    kinds, straight, diagonal = _kinds(world, blocked, near, WAY_BACK | impassable)
    flat = to_go.reshape(SIZE * SIZE)  # a cell is a number: its column in the ring times SIZE, and its row
    made = 0
    for k in range(count):
        cell = (goal[k, 0] & RING) * SIZE + (goal[k, 1] & RING)
        flat[cell] = 0
        cells[made], links[made] = cell, heads[0]
        heads[0] = made
        made += 1
    level, empty = 0, 0
    while empty < _BUCKETS and made < len(links) - 8:
        place = heads[level % _BUCKETS]
        if place < 0:
            level, empty = level + 1, empty + 1
            continue
        empty = 0
        heads[level % _BUCKETS] = links[place]
        cell = cells[place]
        if flat[cell] != level:
            continue  # it was reached by a shorter way meanwhile
        column, row = cell & ~RING, cell & RING
        left, right = (column - SIZE) & _LAST, (column + SIZE) & _LAST
        up, down = (row + 1) & RING, (row - 1) & RING
        beside = (left | row, right | row, column | up, column | down)
        across = (left | up, left | down, right | up, right | down)
        for k, neighbour in enumerate(beside + across):
            kind = kinds[neighbour]
            if kind == 0:
                continue
            cost = level + (straight[kind] if k < 4 else diagonal[kind])
            if cost < flat[neighbour]:
                flat[neighbour] = cost
                cells[made], links[made] = neighbour, heads[cost % _BUCKETS]
                heads[cost % _BUCKETS] = made
                made += 1


@kernel
def _kinds(
    world: Record, blocked: NDArray[np.uint8], near: NDArray[np.uint8], impassable: int
) -> tuple[NDArray[np.uint8], NDArray[np.int64], NDArray[np.int64]]:
    """Return the kind of each cell (SIZE * SIZE,), and what a straight and a diagonal step onto each kind cost.

    Kind 0 cannot be driven on. The others are 1 plus `near` (0, 1 or 3), plus 4 within two cells of a wall. Distances
    spread faster over one byte for each cell than over the three arrays.
    """
    kinds = np.empty(SIZE * SIZE, np.uint8)
    shut = np.uint8(impassable)
    for i in range(SIZE):
        for j in range(SIZE):
            free = world.cells[i, j] == FREE and blocked[i, j] & shut == 0
            kind = 1 + near[i, j] + 4 * (blocked[i, j] & NEAR_WALL)
            kinds[i * SIZE + j] = kind if free else 0
    straight, diagonal = np.zeros(9, np.int64), np.zeros(9, np.int64)
    for kind in range(1, 9):
        straight[kind] = _cost(10, (kind - 1) & 3, NEAR_WALL * ((kind - 1) >> 2))
        diagonal[kind] = _cost(14, (kind - 1) & 3, NEAR_WALL * ((kind - 1) >> 2))
    return kinds, straight, diagonal


@kernel
def _cost(length: int, near: int, bits: int) -> int:
    """Return what a step costs, in units of to_go: up to 4.5 times its length near a wall."""
    if near > 0:
        length += length // 2
    if near > 1:
        length += length // 2
    return 2 * length if bits & NEAR_WALL != 0 else length
