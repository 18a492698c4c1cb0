"""Motion search: arcs that lead a car of its turning circle and speed through the local map to the frontier.

The shortest way to the frontier (perception.frontiers) is a way for a point. A car at speed can turn only so sharply,
and has to slow down first. So motions are put together from short arcs: each arc is turned at a share of what the tires
hold at the speed there, the steering changes by one share at a time, and the car brakes with what cornering leaves,
down to the speed at which full lock is held. The search goes on from the motion of the least length so far and way to
go (A*; P. Hart, N. Nilsson and B. Raphael, IEEE Transactions on Systems Science and Cybernetics 4(2), 1968), over
places, headings and directions (hybrid A*; D. Dolgov et al., Path Planning for Autonomous Vehicles in Unknown Semi-
structured Environments, IJRR 29(5), 2010). In reverse an arc counts twice, and a change of direction .6 m.

What has to be free: three discs on the car's axis keep a cell, or two, from walls. Where the car stands nearer to a
wall than that, and in gaps that are hardly wider than the car, its outline is compared with the ends of the beams
themselves.

Limits: the simulated car does not slip, and what stands in its way stands still. Ground that nobody has seen counts
as free for the car's corners.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.compiled.kernels import kernel

from ..control.planner_settings import Record
from ..control.slip import lock_arc
from ..perception.frontiers import distance_to_goal_around, distance_to_goal_at
from ..perception.local_map import FREE, KIND, NEARNESS, PER_METRE, RING, SIZE, WALL, WALL_IN_1, in_window
from .friction_limiter import longitudinal_share

DIRECTION = 4  # column of a motion, after those of control.tracking

_POINTS = 64
_SHARES = 5  # of the grip for turning: all to the right, half, none, half to the left, all
_LENGTH = 0.2  # [m] of an arc of a standing car
_LENGTH_TIME = 0.05  # [s] and as much more as the car drives in this time
_HEADINGS = 48
_MOST_TURN = 3.7  # [rad] from the heading at the start: no loops
_BRAKING = 0.65  # share of the greatest braking
_TURN_COST = 0.2  # [m^2] times the squared curvature, for each metre: the wider of two ways that are as long
_STEER_COST = 0.02  # [m] for each change of the share
_REVERSE_COST = 0.6  # [m] for each change of the direction
_ARRIVED = 0.35  # [m] of way to go
_UNKNOWN_LENGTH = 1.5  # [m] from the start on which the way to go may be unknown
_TOUCHING_LENGTH = 0.8  # [m] from the start on which the car may be nearer to walls than it plans
_EXACT = 1.4  # [m] from the car within which its outline is compared with the ends of beams
_MARGIN = 0.03  # [m] round the outline
_PARTS = (0.2, 0.4, 0.5, 0.6, 0.8, 1.0)  # of an arc, at which the car has to be free
_HALF, _WHOLE = 2, 5  # where nothing is near, half of the arc and its end; near walls, all but half of it
_SQUARE, _SQUARES = 0.25, 20  # [m] and how many to each side: ends of beams are looked up by them
MOST_NODES = 6400  # of all searches in a tick: they take 2 ms
MOST_LOCK = 0.97  # share of the curvature at full lock, where less leads nowhere
MOST_IN_WALLS = 7  # points of the outline that may lie in cells of walls, whose cells are thicker than they are

MOTION = np.dtype(
    [
        ("found", np.bool_),  # it leads to the horizon or to the frontier
        ("count", np.int64),
        ("points", np.float64, (_POINTS, 5)),  # x, y [m], heading [rad], curvature [1/m] up to there, 1 or -1: reverse
    ]
)
"""Type of a motion: where the rear axle is after each arc."""


@kernel
def search_motion(
    frontier: Record,
    limiter: Record,
    motion: Record,
    curvature: float,
    speed: float,
    lag: float,
    grip: float,
    lock: float,
    horizon: float,
    nearest: int,
    reverses: bool,
    most_nodes: int,
) -> bool:
    """Write the motion from where the car is that shortens the way to go by `horizon`; return whether there is one.

    Where there is none, the motion leads to where the way to go is shortest.

    Args:
      frontier: of type FRONTIER_SEARCH.
      limiter: of type LIMITER.
      motion: of type MOTION, written to.
      curvature: present [1/m].
      speed: present [m/s].
      lag: time for which the car drives on as it does [s].
      grip: share of the cornering acceleration that may be used.
      lock: share of the curvature at full lock that may be used.
      horizon: [m].
      nearest: NEARNESS of walls from which on it is too near, WALL_IN_2 or WALL_IN_1.
      reverses: the car may drive in reverse, too.
      most_nodes: after which the search ends. `frontier.nodes` counts them; all searches of a tick have MOST_NODES.
    """
    car, world = limiter.car, frontier.map
    lateral = grip * limiter.lateral
    tightest = lock * math.tan(lock_arc(limiter.slip, car)) / car.wheelbase
    slowest = lateral / tightest  # [m^2/s^2] square of the speed at which full lock is held
    motion.found, motion.count = False, 0
    if most_nodes <= 2 * _SHARES:
        return False
    state = np.empty((most_nodes, 8))  # x, y, heading, curvature, square of the speed, length so far, cosine, sine
    value = np.empty(most_nodes)
    share, direction = np.empty(most_nodes, np.int8), np.empty(most_nodes, np.int8)
    parent, heap = np.empty(most_nodes, np.int32), np.empty(most_nodes, np.int32)
    slots = 1024
    while slots < 2 * most_nodes:
        slots *= 2
    table = np.zeros(slots, np.int32)
    turned, driven = curvature * lag * max(speed, 0.0), lag * max(speed, 0.0)
    start = state[0]
    start[0] = world.x + driven * math.cos(world.heading + 0.5 * turned)
    start[1] = world.y + driven * math.sin(world.heading + 0.5 * turned)
    start[2], start[3], start[4], start[5] = world.heading + turned, curvature, max(speed, 0.0) ** 2, 0.0
    start[6], start[7] = math.cos(start[2]), math.sin(start[2])
    offset = car.lidar_offset
    whole = distance_to_goal_around(frontier, start[0] + offset * start[6], start[1] + offset * start[7])
    if not math.isfinite(whole):
        return False
    middle = _SHARES // 2
    most = min(tightest, lateral / max(start[4], 1e-3))
    share[0] = round(min(max(curvature / most, -1.0), 1.0) * middle) + middle
    direction[0], parent[0], value[0], heap[0] = 1, -1, whole, 0
    clear = _discs_are_clear(frontier, car, start[0], start[1], start[6], start[7], nearest)
    compares = reverses or nearest == WALL_IN_1 or not clear  # the outline with the ends of beams
    ends, hits, margin = _sorted_ends(world, world.ends_known if compares else 0), 0, _MARGIN
    if compares:
        hits = outline_in_walls(world, car, start[0], start[1], start[6], start[7])
        while margin > 0.0 and _touches(ends, car, start[0], start[1], start[6], start[7], margin):
            margin -= 0.01
    braking = np.empty(_SHARES)  # [m/s^2] by the share of the grip for turning
    for k in range(_SHARES):
        used = abs(k - middle) / middle
        braking[k] = _BRAKING * limiter.braking * longitudinal_share(limiter, min(grip, 0.97) * used, True)
    arcs = np.full((_SHARES, len(_PARTS), 5), math.nan)  # of a car along x: key, see _arc; x, y, cosine and sine
    count, waiting, best, least = 1, 1, 0, whole
    after = np.empty(8)
    while waiting > 0 and count < most_nodes - 2 * _SHARES:
        node = _pop(heap, value, waiting)
        waiting -= 1
        here = state[node]
        rest = value[node] - here[5]
        if node > 0 and direction[node] == 1 and (rest <= _ARRIVED or rest <= whole - horizon):
            motion.found, best = True, node
            break
        limit = min(tightest, lateral / max(here[4], 1e-3))
        length = _LENGTH + _LENGTH_TIME * math.sqrt(here[4])
        for choice in range(2 * _SHARES if reverses else _SHARES):
            to_share, to = choice % _SHARES, 1 if choice < _SHARES else -1
            if direction[node] == to and abs(to_share - share[node]) > 1:
                continue
            turn_rate = (to_share - middle) / middle * limit
            if abs(here[2] + turn_rate * to * length - start[2]) > _MOST_TURN:
                continue
            touching = not clear and here[5] < _TOUCHING_LENGTH
            cos, sin = _arc(arcs, to_share, _WHOLE, turn_rate, length, to, here, after)
            distance_to_goal = distance_to_goal_at(frontier, after[0] + offset * cos, after[1] + offset * sin)
            if distance_to_goal == math.inf and to == 1 and not touching and here[5] > _UNKNOWN_LENGTH:
                continue
            if distance_to_goal == math.inf:
                distance_to_goal = rest + length
            key = _key(after, 2 if nearest == WALL_IN_1 else 1, to)
            slot = _slot(table, key)
            if table[slot] == key:  # a motion has come there
                continue
            if to == -1 and not _tail_is_seen(world, car, after[0], after[1], cos, sin):
                continue
            _arc(arcs, to_share, _HALF, turn_rate, length, to, here, after)
            dx, dy = after[0] - world.x, after[1] - world.y
            close = dx * dx + dy * dy < _EXACT * _EXACT
            exact, corners = close and nearest == WALL_IN_1, close and reverses  # three discs leave the corners out
            compared, passes = touching or exact, True
            for part in range(len(_PARTS)):
                if compared == (part == _HALF) and part < _WHOLE:
                    continue  # half of the arc, or the other parts
                cos, sin = _arc(arcs, to_share, part, turn_rate, length, to, here, after)
                x, y = after[0], after[1]
                if compared:
                    most_hits = hits if touching else MOST_IN_WALLS
                    passes = outline_in_walls(world, car, x, y, cos, sin) <= most_hits
                else:
                    passes = _discs_are_clear(frontier, car, x, y, cos, sin, nearest)
                if passes and (compared or corners):
                    passes = not _touches(ends, car, x, y, cos, sin, margin)
                if not passes:
                    break
            if not passes:
                continue
            table[slot] = key
            after[4] = max(here[4] - 2.0 * braking[to_share] * length, min(here[4], slowest))
            after[5] = here[5] + length * (1.5 - 0.5 * to + _TURN_COST * after[3] ** 2)
            after[5] += _STEER_COST * abs(to_share - share[node]) + _REVERSE_COST * (to != direction[node])
            after[6], after[7] = cos, sin
            state[count] = after
            share[count], direction[count], parent[count] = to_share, to, node
            value[count] = after[5] + distance_to_goal
            if distance_to_goal < least:
                best, least = count, distance_to_goal
            _push(heap, value, waiting, count)
            waiting += 1
            count += 1
    frontier.nodes += count
    _write(motion, best, parent, state, direction)
    return bool(motion.found)


@kernel
def is_clear(frontier: Record, car: Record, x: float, y: float, heading: float, nearest: int) -> bool:
    """Return whether three discs on the axis of a car at a place keep clear of walls."""
    return _discs_are_clear(frontier, car, x, y, math.cos(heading), math.sin(heading), nearest)


@kernel
def _discs_are_clear(frontier: Record, car: Record, x: float, y: float, cos: float, sin: float, nearest: int) -> bool:
    """Return the same as `is_clear`, by the cosine and the sine of the heading."""
    back, front = 0.5 * car.width - car.rear_overhang, car.length - car.rear_overhang - 0.5 * car.width
    for k in range(3):
        offset = back + 0.5 * k * (front - back)
        i, j = math.floor((x + offset * cos) * PER_METRE), math.floor((y + offset * sin) * PER_METRE)
        if not in_window(frontier.map, i, j) or frontier.map.cells[i & RING, j & RING] & NEARNESS >= nearest:
            return False
    return True


@kernel
def outline_in_walls(world: Record, car: Record, x: float, y: float, cos: float, sin: float) -> int:
    """Return how many of 14 points of a car's outline lie in cells of walls, by its heading's cosine and sine."""
    hits = 0
    for k in range(7):
        index = k * car.length / 6.0 - car.rear_overhang
        for side in (-0.5 * car.width, 0.5 * car.width):
            i = math.floor((x + index * cos - side * sin) * PER_METRE)
            j = math.floor((y + index * sin + side * cos) * PER_METRE)
            hits += world.cells[i & RING, j & RING] & KIND == WALL
    return hits


@kernel
def touches(world: Record, car: Record, x: float, y: float, heading: float, margin: float) -> bool:
    """Return whether an end of a beam lies in the outline of a car at a place, wider by a margin [m]."""
    cos, sin = math.cos(heading), math.sin(heading)
    tail, nose = -car.rear_overhang - margin, car.length - car.rear_overhang + margin
    for k in range(world.ends_known):
        dx, dy = world.ends[k, 0] - x, world.ends[k, 1] - y
        if tail < cos * dx + sin * dy < nose and abs(cos * dy - sin * dx) < 0.5 * car.width + margin:
            return True
    return False


@kernel
def _sorted_ends(world: Record, count: int) -> tuple[NDArray[np.float64], NDArray[np.int64], float, float]:
    """Return the first ends of beams by the squares in which they lie, for `_touches`.

    Returns:
      The ends (n, 2) [m]; the first of each square and of the one after the last; where the squares begin [m]. Squares
      have sides of _SQUARE; they are numbered along y first, _SQUARES in a line.
    """
    left, low = math.inf, math.inf
    for k in range(count):
        left, low = min(left, world.ends[k, 0]), min(low, world.ends[k, 1])
    ends, first = np.empty((count, 2)), np.zeros(_SQUARES * _SQUARES + 1, np.int64)
    for k in range(count):
        first[_square(world.ends[k, 0] - left) * _SQUARES + _square(world.ends[k, 1] - low) + 1] += 1
    for k in range(_SQUARES * _SQUARES):
        first[k + 1] += first[k]
    for k in range(count - 1, -1, -1):  # the first of a square is that of the next until all are in their places
        square = _square(world.ends[k, 0] - left) * _SQUARES + _square(world.ends[k, 1] - low) + 1
        first[square] -= 1
        ends[first[square]] = world.ends[k]
    for k in range(_SQUARES * _SQUARES):
        first[k] = first[k + 1]
    first[_SQUARES * _SQUARES] = count
    return ends, first, left, low


@kernel
def _square(along: float) -> int:
    """Return in which line of squares a place is; those beyond the last count as in it, and before the first as -1."""
    return int(min(max(math.floor(along * (1.0 / _SQUARE)), -1), _SQUARES - 1))


@kernel
def _touches(
    sorted_ends: tuple[NDArray[np.float64], NDArray[np.int64], float, float],
    car: Record,
    x: float,
    y: float,
    cos: float,
    sin: float,
    margin: float,
) -> bool:
    """Return the same as `touches`; only the ends in the squares under the car's outline are compared."""
    ends, first, left, low = sorted_ends
    tail, nose, half = -car.rear_overhang - margin, car.length - car.rear_overhang + margin, 0.5 * car.width + margin
    middle, reach = 0.5 * (tail + nose), 0.5 * (nose - tail)
    across, along = abs(cos) * reach + abs(sin) * half + 1e-9, abs(sin) * reach + abs(cos) * half + 1e-9
    at_x, at_y = x + middle * cos - left, y + middle * sin - low
    low_j, high_j = max(_square(at_y - along), 0), _square(at_y + along)
    for i in range(max(_square(at_x - across), 0), _square(at_x + across) + 1):
        if high_j < low_j:
            break
        for k in range(first[i * _SQUARES + low_j], first[i * _SQUARES + high_j + 1]):
            dx, dy = ends[k, 0] - x, ends[k, 1] - y
            if tail < cos * dx + sin * dy < nose and abs(cos * dy - sin * dx) < half:
                return True
    return False


@kernel
def _tail_is_seen(world: Record, car: Record, x: float, y: float, cos: float, sin: float) -> bool:
    """Return whether the ground under the car's tail was seen; the LiDAR does not look backwards."""
    i = math.floor((x - car.rear_overhang * cos) * PER_METRE)
    j = math.floor((y - car.rear_overhang * sin) * PER_METRE)
    return bool(in_window(world, i, j) and world.cells[i & RING, j & RING] & KIND == FREE)


@kernel
def _arc(
    arcs: NDArray[np.float64],
    share: int,
    part: int,
    curvature: float,
    length: float,
    direction: int,
    index: NDArray[np.float64],
    after: NDArray[np.float64],
) -> tuple[float, float]:
    """Write the end of a part of an arc: x, y, heading, curvature; return the cosine and the sine of its heading.

    Args:
      arcs: (shares, parts, 5) the arcs of the last node with each share, which most others have, too; written to.
      share: index of the share.
      part: index in _PARTS.
      curvature: [1/m].
      length: of the whole arc [m].
      direction: 1 or -1: reverse.
      index: row of `state`.
      after: written to.
    """
    turned, cos, sin = curvature * _PARTS[part] * length, index[6], index[7]
    if arcs[share, part, 0] != length:  # the length tells the speed, and so the curvature
        chord, half = _PARTS[part] * length, 0.5 * turned
        arcs[share, part, 0], arcs[share, part, 3], arcs[share, part, 4] = length, math.cos(turned), math.sin(turned)
        arcs[share, part, 1], arcs[share, part, 2] = chord * math.cos(half), chord * math.sin(half)
    ahead, aside = arcs[share, part, 1] * direction, arcs[share, part, 2]
    turn_cos, turn_sin = arcs[share, part, 3], arcs[share, part, 4] * direction
    after[0], after[1] = index[0] + cos * ahead - sin * aside, index[1] + sin * ahead + cos * aside
    after[2], after[3] = index[2] + turned * direction, curvature
    return cos * turn_cos - sin * turn_sin, sin * turn_cos + cos * turn_sin


@kernel
def _key(pose: NDArray[np.float64], fine: int, direction: int) -> int:
    """Return the number of the cell, heading and direction of a place, above 0; `fine` times as fine as cells are."""
    i = math.floor(pose[0] * PER_METRE * fine) & (fine * SIZE - 1)
    j = math.floor(pose[1] * PER_METRE * fine) & (fine * SIZE - 1)
    turn = math.floor(pose[2] * (_HEADINGS / (2.0 * math.pi)) * fine) % (_HEADINGS * fine)
    return int(((i * SIZE * fine + j) * _HEADINGS * fine + turn) * 2 + (direction == 1) + 1)


@kernel
def _slot(table: NDArray[np.int32], key: int) -> int:
    """Return the index at which a table of keys has a key, or at which it is to be put; 0 marks an empty place."""
    slot = (key * 2654435761) & (len(table) - 1)
    while table[slot] != 0 and table[slot] != key:
        slot = (slot + 1) & (len(table) - 1)
    return int(slot)


@kernel
def _push(heap: NDArray[np.int32], value: NDArray[np.float64], waiting: int, node: int) -> None:
    """Add a node to a heap of so many, the least value first."""
    index = waiting
    while index > 0 and value[heap[(index - 1) // 2]] > value[node]:
        heap[index] = heap[(index - 1) // 2]
        index = (index - 1) // 2
    heap[index] = node


@kernel
def _pop(heap: NDArray[np.int32], value: NDArray[np.float64], waiting: int) -> int:
    """Take the node of the least value from a heap of so many."""
    least, last, size, index = heap[0], heap[waiting - 1], waiting - 1, 0
    while 2 * index + 1 < size:
        child = 2 * index + 1
        if child + 1 < size and value[heap[child + 1]] < value[heap[child]]:
            child += 1
        if value[heap[child]] >= value[last]:
            break
        heap[index] = heap[child]
        index = child
    heap[index] = last
    return int(least)


@kernel
def _write(
    motion: Record,
    node: int,
    parent: NDArray[np.int32],
    state: NDArray[np.float64],
    direction: NDArray[np.int8],
) -> None:
    """Write the motion that leads to a node, cut off if it has too many points."""
    count, walk = 0, node
    while walk > 0:
        count, walk = count + 1, parent[walk]
    motion.count = min(count, _POINTS)
    while node > 0:
        count -= 1
        if count < _POINTS:
            point = motion.points[count]
            for k in range(4):
                point[k] = state[node, k]
            point[DIRECTION] = direction[node]
        node = parent[node]
