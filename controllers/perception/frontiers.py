"""Selects the frontier to drive to, and computes each free cell's distance to it.

1. The path driven is closed like a wall, across the corridor, over its last 15 m.
2. From the car, distances spread over the free ground of the local map. Where they reach ground that nobody has
   seen is a frontier. The frontier that is far and wide is selected. A pocket that was seen to its end has none.
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
)
from .local_map import (
    ALONG,
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
_OPENED_MORE = 2.0  # [m] at a time, before the end of a path into a pocket
_POCKET = 6.0  # [m] deepest pocket that the car leaves again
_WIDEST = 3.0  # [m] of a line across open ground, to either side
_LEAST_FRONTIER = 5  # cells
_LEAST_FRONTIER_BACK = 10  # cells, where the car has to leave a pocket for it
_WIDE = 3.0  # [m] of a frontier; more counts as this
_SAME = 1.0  # [m] from the last frontier: another one counts as the same, and as 1 m farther

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
def only_move(geometry: Record, ranges: FloatArray, odometry: Record, memory: Record) -> None:
    """Take the car on by one tick along its path, and enter no scan; arguments as of `search_frontier`."""
    move(memory.map, odometry.speed, odometry.angular_velocity[2], period_of(geometry))
    extend_path(memory.map, geometry, ranges)
    memory.ticks += 1


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
def least_distance_towards(
    memory: Record, x: float, y: float, cos: float, sin: float, distance: float
) -> tuple[float, float]:
    """Return the least way to go [m] along a line from a place, and how far along it is [m]; inf: none is known.

    The line is given by the cosine and the sine of its heading.
    """
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
    count, loop = _find_ahead(memory, ground)
    memory.found = count > 0
    memory.hidden = memory.found and not loop and math.hypot(memory.x - world.x, memory.y - world.y) < SIGHT - 1.0
    ground.distance[:], memory.distance_to_goal[:] = FAR, FAR
    dijkstra(bits, ground.distance, memory.distance_to_goal, ground.goal[:count], free)


@kernel
def _find_ahead(memory: Record, ground: _Ground) -> tuple[int, bool]:
    """Write the cells of the frontier ahead, see 1. to 3.; return how many, and if they are the path's far side."""
    world, opened = memory.map, 0.0
    edges = _spread(world, ground, _OPENED, _CLOSED, False, AT_WALL)
    open_ground = _is_open_ground(world, ground.distance)
    if open_ground:
        edges = _spread(world, ground, _OPENED, _CLOSED, True, AT_WALL)
    count = _choose_frontier(memory, ground, edges, _LEAST_FRONTIER)
    if count == 0 and not open_ground:
        _spread(world, ground, _OPENED, _CLOSED_LOOP, False, AT_WALL)
        if _find_behind(memory, ground):
            return 1, True
    while count == 0 and opened < _POCKET:
        opened += _OPENED_MORE
        edges = _spread(world, ground, opened, _CLOSED, open_ground, NEAR_WALL)
        count = _choose_frontier(memory, ground, edges, _LEAST_FRONTIER_BACK)
    if count > 0 and opened > 0.0:
        cut_path(world, max(world.along - opened, world.furthest - _POCKET))
    return count, False


@kernel
def _spread(
    world: Record, ground: _Ground, opened: float, closed: float, open_ground: bool, impassable: int
) -> int:
    """Close the path from `opened` to `closed` [m], and spread distances from the car; return what `flood` does."""
    _open_path(ground.bits)
    _close_path(world, ground.bits, opened, closed, open_ground)
    ground.distance[:] = FAR
    ground.distance[ground.queue[0]] = 0
    return flood(world, ground.bits, ground.distance, ground.queue, ground.edge, impassable)


@kernel
def _find_behind(memory: Record, ground: _Ground) -> bool:
    """Return whether the car, going on, reaches its path behind the part that is closed; that cell is the goal then."""
    world = memory.map
    for back in range(world.known):
        point = world.path[(world.newest - back) % PATH]
        cell = cell_at(point[0], point[1])
        behind = world.along - point[ALONG] > _CLOSED_LOOP + 2.0 * CELL
        if behind and ground.distance[cell] != FAR:
            ground.goal[0] = cell
            memory.x, memory.y = point[0], point[1]
            return True
    return False


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
    group = np.empty(len(edge), np.uint16)
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
        if score > best:
            best, best_count, memory.x, memory.y = score, count, x, y
            ground.goal[:count] = group[:count]
    return best_count
