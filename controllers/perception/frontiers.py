"""Selects the frontier to drive to, and computes each free cell's distance to it.

0. Where the car was a lap ago where it is now, its frontier is on the path of that lap, 10 m ahead, or 3 m behind the
   car on a shorter lap. All of the ground is known there, and nothing else would lead on.
1. Else the path driven is closed like a wall, across the corridor, over its last 15 m.
2. From the car, distances spread over the free ground of the local map. Where they reach ground that nobody has
   seen is a frontier, unless that ground is only the shadow of a box or lies behind a crack in a wall. The frontier
   that is far and wide is selected. A pocket that was seen to its end has none.
3. Where there is no frontier, the car may go round a course as short as its memory: then the goal is the far side
   of the closed path, which the car reaches from behind. Else it is in a pocket, and the end of its path is opened
   again, 2, 4 and 6 m of it.
4. From the frontier, distances spread back over the free ground. Ground near a wall counts as longer, so that the
   shortest way goes round the end of a barrier on a circle and not along it. Of each block of two by two cells the
   least distance is kept.

Source: B. Yamauchi, A Frontier-Based Approach for Autonomous Exploration, IEEE CIRA 1997. Cells are marked, and
distances spread, by cells.

Limits: a wide opening into a pocket whose end the car does not see yet is taken for a frontier.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.messages import FloatArray

from ..control.planner_settings import Record
from .cells import (
    AT_WALL,
    BLOCKS,
    FAR,
    HOLE,
    LAST,
    NEAR_WALL,
    OPEN,
    UNIT,
    UNSEEN,
    WAY_BACK,
    cell_at,
    dijkstra,
    flood,
    indices_of,
    mark_cells,
    neighbours,
)
from .local_map import (
    ALONG,
    BEFORE,
    CELL,
    COS,
    KIND,
    LEFT,
    LOCAL_MAP,
    PATH,
    PER_METRE,
    RIGHT,
    RING,
    SIGHT,
    SIN,
    SIZE,
    WALL,
    cut_path,
    enter_scan,
    extend_path,
    in_window,
    move,
)
from .scan_geometry import period_of

_MOVED = 0.2  # [m] after which a scan is entered
_TURNED = 0.1  # [rad] the same
_ENTER_EVERY = 3  # ticks, the same
_LASTS = 0.25  # of the distance to the frontier, after which it is searched again
_LASTS_AT_MOST = 2.0  # [m] the same, at most,
_LASTS_LED = 0.3  # [m] while the car is not driven by its planner alone,
_LASTS_SEEN = 0.8  # [m] and before a motion is searched for
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
_SAME = 1.0  # [m] from the last frontier: another one counts as the same, and as 1 m farther
_AHEAD_ON_LAP = 10.0  # [m] at most ahead on the path of a lap ago, to which the car goes,
_LEFT_OF_LAP = (3.0, 5.0, 7.0)  # [m] from behind the car at least
_APART = 1.0  # [m] of the path that stay open behind it
_SAME_PLACE = 0.8  # [m] within which the car is where it was a lap ago
_LEAST_LOOP = 3.0  # [m] to the far side of a closed path
_LEAST_AGE = 5.0  # [m] of the part of the path that the car comes upon there

FRONTIER_SEARCH = np.dtype(
    [
        ("map", LOCAL_MAP),
        ("ticks", np.int64),
        ("entered", np.int64),  # tick in which a scan was last entered,
        ("entered_driven", np.float64),  # [m] how far the car had driven then,
        ("entered_heading", np.float64),  # [rad] and its heading
        ("searched", np.int64),  # tick of the last search,
        ("searched_driven", np.float64),  # [m] and how far the car had driven then
        ("marked", np.int64),  # tick in which walls were last marked
        ("found", np.bool_),
        ("on_lap", np.bool_),  # the car drives where it drove a lap ago, which is its frontier
        ("hidden", np.bool_),  # the frontier is nearer than the sight, so something hides what is behind it
        ("x", np.float64),  # [m] of the middle of the frontier
        ("y", np.float64),
        # [UNIT] of blocks of two by two cells, by half the column and the row in the ring; FAR: not known
        ("distance_to_goal", np.uint16, (BLOCKS, BLOCKS)),
        ("nodes", np.int64),  # of all searches for a motion in this tick
    ]
)
"""Type of the memory; zero at the beginning."""


@kernel
def search_frontier(
    geometry: Record,
    ranges: FloatArray,
    odometry: Record,
    lidar_offset: float,
    memory: Record,
    every: int,
    every_plain: int,
    led: bool,
) -> None:
    """Take a scan and odometry into the memory, in every tick.

    A scan is entered once the car has moved on by _MOVED or turned by _TURNED since the last one, after _ENTER_EVERY
    ticks, and before a search. The frontier is searched `every` ticks after the last time, or later, once the car has
    driven a share _LASTS of the distance to it, and at the latest after `every_plain` ticks.

    Args:
      geometry: of type SCAN_GEOMETRY.
      ranges: its readings (n,) [m], without NaN or inf.
      odometry: of type ODOMETRY.
      lidar_offset: of the LiDAR ahead of the rear axle [m].
      memory: of type FRONTIER_SEARCH, written to.
      every: ticks.
      every_plain: ticks.
      led: the car is not driven by its planner alone.
    """
    world = memory.map
    move(world, odometry.speed, odometry.angular_velocity[2], period_of(geometry))
    extend_path(world, geometry, ranges)
    since, driven = memory.ticks - memory.searched, world.driven - memory.searched_driven
    due = memory.ticks == 0 or since >= (every_plain if memory.found else every)
    if since >= every and not due:
        apart = math.hypot(memory.x - world.x, memory.y - world.y)
        due = driven >= min(_LASTS * apart, _LASTS_LED if led else _LASTS_AT_MOST)
    moved, turned = world.driven - memory.entered_driven, abs(world.heading - memory.entered_heading)
    memory.nodes = 0
    memory.ticks += 1
    if due:
        _search(geometry, ranges, lidar_offset, memory)
    elif moved >= _MOVED or turned >= _TURNED or memory.ticks - memory.entered > _ENTER_EVERY:
        _enter(geometry, ranges, lidar_offset, memory)


@kernel
def look_again(geometry: Record, ranges: FloatArray, lidar_offset: float, memory: Record, every: int) -> None:
    """Enter the scan and mark how near its walls are, `every` ticks after the last time.

    Once the car has driven _LASTS_SEEN the frontier is searched, too. Other arguments as of `search_frontier`.
    """
    if memory.ticks - memory.marked < every:
        return
    if memory.map.driven - memory.searched_driven >= _LASTS_SEEN:
        _search(geometry, ranges, lidar_offset, memory)
        return
    if memory.entered != memory.ticks:
        _enter(geometry, ranges, lidar_offset, memory)
    memory.marked = memory.ticks
    mark_cells(memory.map, np.empty((SIZE, SIZE), np.uint8))


@kernel
def _search(geometry: Record, ranges: FloatArray, lidar_offset: float, memory: Record) -> None:
    """Enter the scan and search the frontier; arguments as of `search_frontier`."""
    if memory.entered != memory.ticks:
        _enter(geometry, ranges, lidar_offset, memory)
    memory.searched = memory.marked = memory.ticks
    memory.searched_driven = memory.map.driven
    _find_frontier(memory, lidar_offset)


@kernel
def _enter(geometry: Record, ranges: FloatArray, lidar_offset: float, memory: Record) -> None:
    """Enter a scan; arguments as of `search_frontier`."""
    world = memory.map
    memory.entered, memory.entered_driven, memory.entered_heading = memory.ticks, world.driven, world.heading
    enter_scan(world, geometry, ranges, lidar_offset)


@kernel
def distance_to_goal_at(memory: Record, x: float, y: float) -> float:
    """Return the way to go [m] from a place, interpolated between the middles of blocks; inf where it is not known."""
    if not in_window(memory.map, math.floor(x * PER_METRE), math.floor(y * PER_METRE)):
        return math.inf
    distances, last = memory.distance_to_goal, BLOCKS - 1
    u, v = 0.5 * PER_METRE * x, 0.5 * PER_METRE * y
    here = distances[math.floor(u) & last, math.floor(v) & last]
    i, j = math.floor(u - 0.5), math.floor(v - 0.5)
    u, v = u - 0.5 - i, v - 0.5 - j
    a, b = distances[i & last, j & last], distances[i & last, (j + 1) & last]
    c, d = distances[(i + 1) & last, j & last], distances[(i + 1) & last, (j + 1) & last]
    if here == FAR:
        return math.inf
    if a == FAR or b == FAR or c == FAR or d == FAR:
        return float(UNIT * here)
    return float(UNIT * ((1.0 - u) * ((1.0 - v) * a + v * b) + u * ((1.0 - v) * c + v * d)))


@kernel
def distance_to_goal_around(memory: Record, x: float, y: float) -> float:
    """Return the way to go [m] from a place, or from the nearest known place within 0.6 m; else inf."""
    for reach in range(7):
        least = math.inf
        for i in range(-reach, reach + 1):
            for j in range(-reach, reach + 1):
                if max(abs(i), abs(j)) == reach:
                    distance = distance_to_goal_at(memory, x + i * CELL, y + j * CELL)
                    least = min(least, distance + reach * CELL)
        if least < math.inf:
            return least
    return math.inf


@kernel
def least_distance_along(memory: Record, x: float, y: float, heading: float, distance: float) -> tuple[float, float]:
    """Return the least way to go [m] along a line from a place (inf: none is known), and how far along it is [m]."""
    return least_distance_towards(memory, x, y, math.cos(heading), math.sin(heading), distance)


@kernel
def least_distance_towards(
    memory: Record, x: float, y: float, cos: float, sin: float, distance: float
) -> tuple[float, float]:
    """Return the same as `least_distance_along`, for the cosine and the sine of the line's heading."""
    step_x, step_y = 0.2 * PER_METRE * cos, 0.2 * PER_METRE * sin
    x, y = x * PER_METRE, y * PER_METRE
    least, at = FAR, 0
    for step in range(1, int(min(distance, SIGHT) / 0.2) + 1):  # all of these are in the window
        i, j = math.floor(x + step * step_x), math.floor(y + step * step_y)
        cells = int(memory.distance_to_goal[(i & RING) >> 1, (j & RING) >> 1])
        if cells < least:
            least, at = cells, step
    return (least * UNIT, 0.2 * at) if least != FAR else (math.inf, 0.0)


class _Ground(NamedTuple):
    """The cells of the map in one search: each is a number, its column in the ring times SIZE, and its row.

    Arrays of cells are unsigned: else numba asks of each index if it is negative.
    """

    bits: NDArray[np.uint8]  # of each cell, see cells
    distance: NDArray[np.uint16]  # of each cell from the car, in cells
    queue: NDArray[np.uint16]  # cells in the order of that distance; the first is that of the LiDAR
    edge: NDArray[np.uint16]  # those of them at ground that nobody has seen
    goal: NDArray[np.uint16]  # cells of the frontier
    free: int  # how many cells may be free


@kernel
def _find_frontier(memory: Record, lidar_offset: float) -> None:
    """Search the frontier, and write the distance to it."""
    world, bits = memory.map, np.empty(SIZE * SIZE, np.uint8)
    free = mark_cells(world, bits.reshape(SIZE, SIZE))
    ground = _Ground(
        bits, np.empty(SIZE * SIZE, np.uint16), np.empty(free + 1, np.uint16), np.empty(free + 1, np.uint16),
        np.empty(free + 1, np.uint16), free,
    )  # fmt: skip
    ground.queue[0] = cell_at(
        world.x + lidar_offset * math.cos(world.heading), world.y + lidar_offset * math.sin(world.heading)
    )
    count, loop, impassable = _find_on_lap(memory, ground), True, AT_WALL | HOLE
    memory.on_lap = count > 0
    if count == 0:
        count, loop, impassable = _find_ahead(memory, ground)
    memory.found = count > 0
    memory.hidden = memory.found and not loop and math.hypot(memory.x - world.x, memory.y - world.y) < SIGHT - 1.0
    ground.distance[:], memory.distance_to_goal[:] = FAR, FAR
    impassable = AT_WALL | impassable & HOLE
    dijkstra(bits, ground.distance, memory.distance_to_goal, ground.goal[:count], free, impassable)


@kernel
def _find_on_lap(memory: Record, ground: _Ground) -> int:
    """Write the cell of the path of a lap ago to which the car goes, see 0.; return 1, or 0: there is none."""
    world = memory.map
    a_lap_ago = _lap_ago(world)
    lap = world.along - world.path[a_lap_ago, ALONG]
    for left in _LEFT_OF_LAP:
        ahead = min(lap - left, _AHEAD_ON_LAP)
        if ahead <= 0.0:
            break
        _spread(world, ground, _OPENED, lap - ahead - _APART, False, AT_WALL | HOLE)
        index = a_lap_ago
        while index != world.newest and world.path[index, ALONG] < world.path[a_lap_ago, ALONG] + ahead:
            index = (index + 1) % PATH
        cell = cell_at(world.path[index, 0], world.path[index, 1])
        if index != world.newest and ground.distance[cell] != FAR:
            ground.goal[0] = cell
            memory.x, memory.y = world.path[index, 0], world.path[index, 1]
            return 1
    return 0


@kernel
def _find_ahead(memory: Record, ground: _Ground) -> tuple[int, bool, int]:
    """Write the cells of the frontier ahead, see 1. to 3.

    Returns:
      How many cells; whether they are the far side of the closed path; and the bits of cells that are impassable.
    """
    world, impassable, open_ground = memory.map, AT_WALL | HOLE, False
    for attempt in range(len(_ATTEMPTS)):
        opened, closed, impassable = _ATTEMPTS[attempt]
        if closed < _CLOSED and open_ground:
            continue
        reached, edges = _spread(world, ground, opened, closed, open_ground, impassable)
        if attempt == 0 and _is_open_ground(world, ground.distance):
            open_ground = True
            reached, edges = _spread(world, ground, opened, closed, open_ground, impassable)
        if closed < _CLOSED:
            if _find_behind(memory, ground, reached):
                return 1, True, impassable
            continue
        least = _LEAST_FRONTIER if opened == _OPENED else _LEAST_FRONTIER_BACK
        count = _choose_frontier(memory, ground, edges, least)
        if count > 0:
            if opened > _OPENED:
                cut_path(world, max(world.along - opened, world.furthest - _POCKET))
            return count, False, impassable
    return 0, False, impassable


@kernel
def _spread(
    world: Record, ground: _Ground, opened: float, closed: float, open_ground: bool, impassable: int
) -> tuple[int, int]:
    """Close the path from `opened` to `closed` [m], and spread distances from the car (`flood`)."""
    _open_path(ground.bits)
    _close_path(world, ground.bits, opened, closed, open_ground)
    ground.distance[:] = FAR
    ground.distance[ground.queue[0]] = 0
    return flood(world, ground.bits, ground.distance, ground.queue, ground.edge, impassable)


@kernel
def _find_behind(memory: Record, ground: _Ground, reached: int) -> bool:
    """Return whether the car, going on, comes upon its closed path from behind; that cell is the goal then."""
    world, bits, distance, index = memory.map, ground.bits, ground.distance, reached - 1
    while index > 0:
        cell = ground.queue[index]
        if _is_next_to_path(world, bits, cell) and _comes_from_behind(world, distance, cell):
            break
        index -= 1
    cell = ground.queue[index]
    if not distance[cell] * CELL > _LEAST_LOOP:
        return False
    ground.goal[0] = cell
    i, j = indices_of(world, cell)
    memory.x, memory.y = i * CELL, j * CELL
    return True


@kernel
def _lap_ago(world: Record) -> int:
    """Return the path's point at which the car was a lap ago; the newest: it has driven no lap, or a longer one.

    It was where it is now, and has turned once round since then. So it has not, where it has driven back and forth.
    """
    found: int = world.newest
    nearest = _SAME_PLACE
    for back in range(world.known):
        index = (world.newest - back) % PATH
        point = world.path[index]
        dx, dy = point[0] - world.x, point[1] - world.y
        apart = math.sqrt(dx * dx + dy * dy)
        if point[ALONG] < BEFORE or (nearest < _SAME_PLACE < apart):  # two laps ago it was there, too
            break
        if world.along - point[ALONG] > _LEAST_AGE and apart < nearest and _is_a_turn(world.heading - point[2]):
            found, nearest = index, apart
    return found


@kernel
def _is_a_turn(angle: float) -> bool:
    return bool(abs(abs(angle) - 2.0 * math.pi) < 0.65)


@kernel
def _open_path(bits: NDArray[np.uint8]) -> None:
    """Remove all lines across the path."""
    for cell in range(len(bits)):
        bits[cell] &= np.uint8(255 - WAY_BACK)


@kernel
def _close_path(world: Record, bits: NDArray[np.uint8], opened: float, closed: float, open_ground: bool) -> None:
    """Block a line across the corridor at each point of the path from `opened` to `closed` [m] before its end.

    On open ground the lines go on up to a wall, or _WIDEST to either side.
    """
    until = world.along - opened
    if opened > _OPENED:
        until = max(until, world.furthest - _POCKET)
    for back in range(world.known):
        index = (world.newest - back) % PATH
        x, y, sin, cos = _path_point(world, index)
        if world.along - world.path[index, ALONG] > closed:
            break
        if world.path[index, ALONG] > until:
            continue
        for side in (1, -1):
            room = world.path[index, LEFT if side == 1 else RIGHT]
            steps = int((_WIDEST if open_ground else room) / (0.5 * CELL)) + 1
            first, last = _aside(x, y, sin, cos, 0.0), _aside(x, y, sin, cos, side * 0.5 * CELL * (steps - 1))
            whole = in_window(world, first[0], first[1]) and in_window(world, last[0], last[1])
            for step in range(steps):
                i, j = _aside(x, y, sin, cos, side * 0.5 * CELL * step)
                if not (whole or in_window(world, i, j)):
                    break
                cell = (i & RING) * SIZE | j & RING
                if open_ground and 0.5 * CELL * step > room and bits[cell] & (OPEN | UNSEEN) == 0:
                    break
                bits[cell] |= np.uint8(WAY_BACK)
                bits[(cell + SIZE) & LAST] |= np.uint8(WAY_BACK)  # two cells, or a diagonal step passes it


@kernel
def _path_point(world: Record, index: int) -> tuple[float, float, float, float]:
    """Return x [m], y [m], and the sine and cosine of the heading, of a point of the path."""
    return world.path[index, 0], world.path[index, 1], world.path[index, SIN], world.path[index, COS]


@kernel
def _aside(x: float, y: float, sin: float, cos: float, aside: float) -> tuple[int, int]:
    """Return column and row of the cell at a distance to the left of a point of the path [m]; see `_path_point`."""
    return math.floor((x - aside * sin) * PER_METRE), math.floor((y + aside * cos) * PER_METRE)


@kernel
def _is_open_ground(world: Record, distance: NDArray[np.uint16]) -> bool:
    """Return whether the ground along the closed path is reached from the car at a third of its points, or more."""
    points, passed = 0, 0
    for back in range(world.known):
        index = (world.newest - back) % PATH
        age = world.along - world.path[index, ALONG]
        if age > _CLOSED:
            break
        if age > 2.0:
            points += 1
            x, y, sin, cos = _path_point(world, index)
            for side in (1, -1):
                room = world.path[index, LEFT if side == 1 else RIGHT]
                walled = False  # the ground behind a thin barrier is another lane
                for cells in range(-1, 3):
                    i, j = _aside(x, y, sin, cos, side * (room + cells * CELL))
                    walled = walled or not in_window(world, i, j) or world.cells[i & RING, j & RING] & KIND == WALL
                if not walled and distance[(i & RING) * SIZE | j & RING] != FAR:
                    passed += 1
                    break
    return 3 * passed > points > 10


@kernel
def _choose_frontier(memory: Record, ground: _Ground, edges: int, least: int) -> int:
    """Write the cells of the best frontier of at least so many, and its middle; return how many; 0: there is none."""
    world, distance, edge = memory.map, ground.distance, ground.edge[:edges]
    label = np.zeros(SIZE * SIZE, np.uint8)  # 1: at unknown ground, 2: in a frontier that was looked at
    for cell in edge:
        label[cell] = 1
    group, behind = np.empty(len(edge), np.uint16), np.empty(_ROOM + 8, np.uint16)
    best, best_count, last_x, last_y = 0.0, 0, memory.x, memory.y
    for start in edge:
        if label[start] != 1:
            continue
        label[start] = 2
        group[0] = start
        count, at = 1, 0
        far, x, y = 0.0, 0.0, 0.0
        while at < count:
            i, j = indices_of(world, group[at])
            far += distance[group[at]] * CELL
            x += i * CELL
            y += j * CELL
            at += 1
            for a in range(i - 1, i + 2):
                for b in range(j - 1, j + 2):
                    cell = (a & RING) * SIZE | b & RING
                    if label[cell] == 1:
                        label[cell] = 2
                        group[count] = cell
                        count += 1
        if count < least:
            continue
        far, x, y = far / count, x / count, y / count
        score = far + 2.0 * min(count * CELL, _WIDE)
        if memory.found and math.hypot(x - last_x, y - last_y) < _SAME:
            score += 1.0
        if score > best and _has_room_behind(world, ground, label, group[:count], behind):
            best, best_count, memory.x, memory.y = score, count, x, y
            ground.goal[:count] = group[:count]
    return best_count


@kernel
def _has_room_behind(
    world: Record, ground: _Ground, label: NDArray[np.uint8], group: NDArray[np.uint16], behind: NDArray[np.uint16]
) -> bool:
    """Return whether a frontier may lead on: to room behind it, or to ground that the car does not reach otherwise."""
    count, reached, at, leads_on = len(group), 0, 0, False
    while at < count + reached and not leads_on:
        index = group[at] if at < count else behind[at - count]
        for cell in neighbours(index):
            i, j = indices_of(world, cell)
            if not in_window(world, i, j) or label[cell] == 4:
                leads_on = True
            elif ground.bits[cell] & (UNSEEN | NEAR_WALL | WAY_BACK) == UNSEEN and label[cell] == 0:
                label[cell] = 3
                behind[reached] = cell
                reached += 1
            elif at >= count and ground.bits[cell] & (OPEN | NEAR_WALL) == OPEN and ground.distance[cell] == FAR:
                leads_on = True
        leads_on = leads_on or reached >= _ROOM
        at += 1
    for k in range(reached if leads_on else 0):
        label[behind[k]] = 4
    return leads_on


@kernel
def _is_next_to_path(world: Record, bits: NDArray[np.uint8], cell: int) -> bool:
    """Return whether a cell is within two cells of the closed way back."""
    i, j = indices_of(world, cell)
    for a in range(i - 2, i + 3):
        for b in range(j - 2, j + 3):
            if bits[(a & RING) * SIZE | b & RING] & WAY_BACK != 0:
                return True
    return False


@kernel
def _comes_from_behind(world: Record, distance: NDArray[np.uint16], cell: int) -> bool:
    """Return whether distances grow, at a cell along the path, in the direction in which the car came by there."""
    x, y, here = 0.0, 0.0, distance[cell]
    i, j = indices_of(world, cell)
    for di in range(-2, 3):
        for dj in range(-2, 3):
            there = distance[((i + di) & RING) * SIZE | (j + dj) & RING]
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
