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
from typing import NamedTuple

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
_SHARES, _MIDDLE = 5, 2  # of the grip for turning: all to the right, half, none, half to the left, all
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


Ends = tuple[NDArray[np.float64], NDArray[np.int64], float, float]
"""Ends of beams, see `sorted_ends`."""


class Query(NamedTuple):
    """The motion that is searched for."""

    curvature: float  # present [1/m]
    speed: float  # present [m/s]
    lag: float  # [s] for which the car drives on as it does
    grip: float  # share of the cornering acceleration that may be used
    lock: float  # share of the curvature at full lock that may be used
    horizon: float  # [m] by which the motion shortens the way to go
    nearest: int  # NEARNESS of walls from which on it is too near, WALL_IN_2 or WALL_IN_1
    reverses: bool  # the car may drive in reverse, too
    most_nodes: int  # after which the search ends; all searches of a tick have MOST_NODES


class _Tree(NamedTuple):
    """The nodes of a search: each is an arc's end. Node 0 is the start."""

    state: NDArray[np.float64]  # x, y, heading, curvature, square of the speed, length so far, cosine, sine
    value: NDArray[np.float64]  # length so far, and way to go [m]
    share: NDArray[np.int8]
    direction: NDArray[np.int8]
    parent: NDArray[np.int32]
    heap: NDArray[np.int32]
    table: NDArray[np.int32]  # keys of the places that were come to, see _slot
    arcs: NDArray[np.float64]  # (shares, parts, 5): those of the last node with each share, see _arc


class _Limits(NamedTuple):
    """What the car can do, and how far it has to keep from walls."""

    tightest: float  # [1/m] curvature
    lateral: float  # [m/s^2]
    braking: NDArray[np.float64]  # [m/s^2] by the share of the grip for turning
    nearest: int  # as of Query
    reverses: bool
    clear: bool  # the car stands clear of walls
    ends: Ends
    hits: int  # points of the outline that lie in cells of walls where the car stands
    margin: float  # [m] round the outline


class _Arc(NamedTuple):
    """An arc from a node."""

    share: int  # of the grip for turning, its index
    curvature: float  # [1/m]
    length: float  # [m]
    direction: int  # 1, or -1 in reverse


@kernel
def search_motion(frontier: Record, limiter: Record, motion: Record, query: Query) -> bool:
    """Write the motion from where the car is that shortens the way to go by the horizon; return whether there is one.

    Where there is none, the motion leads to where the way to go is shortest.

    Args:
      frontier: of type FRONTIER_SEARCH; its `nodes` counts those of all searches of a tick.
      limiter: of type LIMITER.
      motion: of type MOTION, written to.
      query: see Query.
    """
    motion.found, motion.count = False, 0
    most = min(query.most_nodes, MOST_NODES - frontier.nodes)
    if most <= 2 * _SHARES:
        return False
    tree = _plant(frontier.map, query, most)
    start, offset = tree.state[0], limiter.car.lidar_offset
    whole = distance_to_goal_around(frontier, start[0] + offset * start[6], start[1] + offset * start[7])
    if not math.isfinite(whole):
        return False
    limits = _limits_at(frontier, limiter, query, start)
    most_curved = min(limits.tightest, limits.lateral / max(start[4], 1e-3))
    tree.share[0] = round(min(max(query.curvature / most_curved, -1.0), 1.0) * _MIDDLE) + _MIDDLE
    tree.value[0] = whole
    count, waiting, best, least = 1, 1, 0, whole
    while waiting > 0 and count < most - 2 * _SHARES:
        node = _pop(tree.heap, tree.value, waiting)
        waiting -= 1
        rest = tree.value[node] - tree.state[node, 5]
        if node > 0 and tree.direction[node] == 1 and (rest <= _ARRIVED or rest <= whole - query.horizon):
            motion.found, best = True, node
            break
        for choice in range(2 * _SHARES if query.reverses else _SHARES):
            distance_to_goal = _grow(tree, node, count, choice, rest, frontier, limiter.car, limits)
            if distance_to_goal == math.inf:
                continue
            if distance_to_goal < least:
                best, least = count, distance_to_goal
            _push(tree.heap, tree.value, waiting, count)
            waiting += 1
            count += 1
    frontier.nodes += count
    _write(motion, best, tree)
    return bool(motion.found)


@kernel
def _plant(world: Record, query: Query, most: int) -> _Tree:
    """Return a tree for so many nodes, with the place at its start to which the car drives on as it does."""
    slots = 1024
    while slots < 2 * most:
        slots *= 2
    tree = _Tree(
        np.empty((most, 8)), np.empty(most), np.empty(most, np.int8), np.empty(most, np.int8),
        np.empty(most, np.int32), np.empty(most, np.int32), np.zeros(slots, np.int32),
        np.full((_SHARES, len(_PARTS), 5), math.nan),
    )  # fmt: skip
    speed = max(query.speed, 0.0)
    start, driven = tree.state[0], query.lag * speed
    turned = query.curvature * query.lag * speed
    start[0] = world.x + driven * math.cos(world.heading + 0.5 * turned)
    start[1] = world.y + driven * math.sin(world.heading + 0.5 * turned)
    start[2], start[3], start[4], start[5] = world.heading + turned, query.curvature, speed**2, 0.0
    start[6], start[7] = math.cos(start[2]), math.sin(start[2])
    tree.direction[0], tree.parent[0], tree.heap[0] = 1, -1, 0
    return tree


@kernel
def _limits_at(frontier: Record, limiter: Record, query: Query, start: NDArray[np.float64]) -> _Limits:
    """Return what the car can do, and how near to walls it stands at the start."""
    car, world, x, y, cos, sin = limiter.car, frontier.map, start[0], start[1], start[6], start[7]
    clear = is_clear(frontier, car, x, y, cos, sin, query.nearest)
    compares = query.reverses or query.nearest == WALL_IN_1 or not clear  # the outline with the ends of beams
    ends, hits, margin = sorted_ends(world, world.ends_known if compares else 0), 0, _MARGIN
    if compares:
        hits = outline_in_walls(world, car, x, y, cos, sin)
        while margin > 0.0 and touches(ends, car, x, y, cos, sin, margin):
            margin -= 0.01
    braking = np.empty(_SHARES)
    for k in range(_SHARES):
        used = min(query.grip, 0.97) * (abs(k - _MIDDLE) / _MIDDLE)
        braking[k] = _BRAKING * limiter.braking * longitudinal_share(limiter, used, True)
    return _Limits(
        query.lock * math.tan(lock_arc(limiter.slip, car)) / car.wheelbase,
        query.grip * limiter.lateral, braking, query.nearest, query.reverses, clear, ends, hits, margin,
    )  # fmt: skip


@kernel
def _grow(
    tree: _Tree, node: int, new: int, choice: int, rest: float, frontier: Record, car: Record, limits: _Limits
) -> float:
    """Write a new node at the end of an arc from a node; return the way to go there [m], or inf: it cannot be driven.

    `rest` is the way to go from the node.
    """
    here, after = tree.state[node], tree.state[new]
    share, direction = choice % _SHARES, 1 if choice < _SHARES else -1
    turns_round = direction != tree.direction[node]
    if not turns_round and abs(share - tree.share[node]) > 1:
        return math.inf
    length = _LENGTH + _LENGTH_TIME * math.sqrt(here[4])
    curvature = (share - _MIDDLE) / _MIDDLE * min(limits.tightest, limits.lateral / max(here[4], 1e-3))
    if abs(here[2] + curvature * direction * length - tree.state[0, 2]) > _MOST_TURN:
        return math.inf
    arc, touching = _Arc(share, curvature, length, direction), not limits.clear and here[5] < _TOUCHING_LENGTH
    cos, sin = _drive(tree.arcs, arc, _WHOLE, here, after)
    x, y, offset = after[0], after[1], car.lidar_offset
    distance_to_goal = distance_to_goal_at(frontier, x + offset * cos, y + offset * sin)
    known = distance_to_goal < math.inf
    if not known and direction == 1 and not touching and here[5] > _UNKNOWN_LENGTH:
        return math.inf
    key = _key(after, 2 if limits.nearest == WALL_IN_1 else 1, direction)
    slot = _slot(tree.table, key)
    if tree.table[slot] == key:  # a motion has come there
        return math.inf
    if direction == -1 and not _tail_is_seen(frontier.map, car, x, y, cos, sin):
        return math.inf
    if not _is_free(tree, arc, node, new, touching, frontier, car, limits):
        return math.inf
    tree.table[slot] = key
    slowest = limits.lateral / limits.tightest  # [m^2/s^2] square of the speed at which full lock is held
    after[4] = max(here[4] - 2.0 * limits.braking[share] * length, min(here[4], slowest))
    after[5] = here[5] + length * (1.5 - 0.5 * direction + _TURN_COST * after[3] ** 2)
    after[5] += _STEER_COST * abs(share - tree.share[node]) + _REVERSE_COST * turns_round
    after[6], after[7] = cos, sin
    tree.share[new], tree.direction[new], tree.parent[new] = share, direction, node
    distance_to_goal = distance_to_goal if known else rest + length
    tree.value[new] = after[5] + distance_to_goal
    return distance_to_goal


@kernel
def _is_free(
    tree: _Tree, arc: _Arc, node: int, new: int, touching: bool, frontier: Record, car: Record, limits: _Limits
) -> bool:
    """Return whether the car is free along an arc to a new node; `touching`: it may still be nearer to walls."""
    world, here, after = frontier.map, tree.state[node], tree.state[new]
    _drive(tree.arcs, arc, _HALF, here, after)
    dx, dy = after[0] - world.x, after[1] - world.y
    close = dx * dx + dy * dy < _EXACT * _EXACT
    compared, corners = touching or (close and limits.nearest == WALL_IN_1), close and limits.reverses
    for part in range(len(_PARTS)):
        if compared == (part == _HALF) and part < _WHOLE:
            continue  # half of the arc, or the other parts
        cos, sin = _drive(tree.arcs, arc, part, here, after)
        x, y = after[0], after[1]
        if compared:
            if outline_in_walls(world, car, x, y, cos, sin) > (limits.hits if touching else MOST_IN_WALLS):
                return False
        elif not is_clear(frontier, car, x, y, cos, sin, limits.nearest):
            return False
        if (compared or corners) and touches(limits.ends, car, x, y, cos, sin, limits.margin):
            return False  # three discs leave the corners out
    return True


@kernel
def is_clear(frontier: Record, car: Record, x: float, y: float, cos: float, sin: float, nearest: int) -> bool:
    """Return whether three discs on the axis of a car at a place keep clear of walls."""
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
def sorted_ends(world: Record, count: int) -> Ends:
    """Return the first ends of beams (n, 2) [m] by the squares in which they lie, for `touches`.

    Also the first of each square, numbered along y first, and of the one after the last; and where the squares begin.
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
def touches(ends: Ends, car: Record, x: float, y: float, cos: float, sin: float, margin: float) -> bool:
    """Return whether an end of a beam lies in the outline of a car at a place, wider by a margin [m].

    Only the ends in the squares under the outline are compared.
    """
    points, first, left, low = ends
    tail, nose, half = -car.rear_overhang - margin, car.length - car.rear_overhang + margin, 0.5 * car.width + margin
    middle, reach = 0.5 * (tail + nose), 0.5 * (nose - tail)
    across, along = abs(cos) * reach + abs(sin) * half + 1e-9, abs(sin) * reach + abs(cos) * half + 1e-9
    at_x, at_y = x + middle * cos - left, y + middle * sin - low
    low_j, high_j = max(_square(at_y - along), 0), _square(at_y + along)
    for i in range(max(_square(at_x - across), 0), _square(at_x + across) + 1):
        if high_j < low_j:
            break
        for k in range(first[i * _SQUARES + low_j], first[i * _SQUARES + high_j + 1]):
            dx, dy = points[k, 0] - x, points[k, 1] - y
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
def _drive(
    arcs: NDArray[np.float64], arc: _Arc, part: int, here: NDArray[np.float64], after: NDArray[np.float64]
) -> tuple[float, float]:
    """Write where a part of an arc ends: x, y, heading, curvature; return the cosine and the sine of that heading.

    Most nodes have the same arcs as the last node, which `arcs` keeps: length, end and heading of a car along x.
    """
    kept, direction = arcs[arc.share, part], arc.direction
    turned, cos, sin = arc.curvature * _PARTS[part] * arc.length, here[6], here[7]
    if kept[0] != arc.length:  # the length tells the speed, and so the curvature
        chord, half = _PARTS[part] * arc.length, 0.5 * turned
        kept[0], kept[3], kept[4] = arc.length, math.cos(turned), math.sin(turned)
        kept[1], kept[2] = chord * math.cos(half), chord * math.sin(half)
    ahead, aside, turn_cos, turn_sin = kept[1] * direction, kept[2], kept[3], kept[4] * direction
    after[0], after[1] = here[0] + cos * ahead - sin * aside, here[1] + sin * ahead + cos * aside
    after[2], after[3] = here[2] + turned * direction, arc.curvature
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
def _write(motion: Record, node: int, tree: _Tree) -> None:
    """Write the motion that leads to a node, cut off if it has too many points."""
    count, walk = 0, node
    while walk > 0:
        count, walk = count + 1, tree.parent[walk]
    motion.count = min(count, _POINTS)
    while node > 0:
        count -= 1
        if count < _POINTS:
            point = motion.points[count]
            for k in range(4):
                point[k] = tree.state[node, k]
            point[DIRECTION] = tree.direction[node]
        node = tree.parent[node]
