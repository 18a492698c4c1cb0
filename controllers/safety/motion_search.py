"""Motion search: arcs that lead a car of its turning circle and speed through the local map along the way on.

The way on (perception.way_on) is a way for a point. A car at speed can turn only so sharply, and has to slow down
first. So motions are put together from short arcs: each arc is turned at a share of what the tires hold at the
speed there, the steering changes by one share at a time, and the car brakes with what cornering leaves, down to the
speed at which full lock is held. The search goes on from the motion of the least length so far and way to go (A*;
P. Hart, N. Nilsson and B. Raphael, IEEE Transactions on Systems Science and Cybernetics 4(2), 1968), over places,
headings and directions (hybrid A*; D. Dolgov et al., Path Planning for Autonomous Vehicles in Unknown Semi-
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

from fg_mujoco.kernels import kernel

from ..control.settings import Record
from ..perception.local_map import FREE, PER_METRE, RING, SIZE, WALL, in_window
from ..perception.way_on import AT_WALL, FAR, UNIT, to_go_around, to_go_at
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
_CHECKS_AT_WALL = 5  # places on an arc near a wall where the outline is compared
MOST_LOCK = 0.97  # share of the curvature at full lock, where less leads nowhere
MOST_IN_WALLS = 7  # points of the outline that may lie in cells of walls, whose cells are thicker than they are

MOTION = np.dtype(
    [
        ("found", np.bool_),  # it leads to the horizon or to the way on
        ("count", np.int64),
        ("points", np.float64, (_POINTS, 5)),  # x, y [m], heading [rad], curvature [1/m] up to there, 1 or -1: reverse
    ]
)
"""Type of a motion: where the rear axle is after each arc."""


@kernel
def search_motion(
    way: Record,
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
      way: of type WAY_ON.
      limiter: of type LIMITER.
      motion: of type MOTION, written to.
      curvature: present [1/m].
      speed: present [m/s].
      lag: time for which the car drives on as it does [s].
      grip: share of the cornering acceleration that may be used.
      lock: share of the curvature at full lock that may be used.
      horizon: [m].
      nearest: which cells have to be clear of, NEAR_WALL or AT_WALL.
      reverses: the car may drive in reverse, too.
      most_nodes: after which the search ends.
    """
    car, world = limiter.car, way.map
    lateral = grip * limiter.lateral
    tightest = lock * math.tan(car.max_steering_angle) / car.wheelbase
    slowest = lateral / tightest  # [m^2/s^2] square of the speed at which full lock is held
    state = np.empty((most_nodes, 6))  # x, y, heading, curvature, square of the speed, length so far
    value = np.empty(most_nodes)
    share, direction = np.empty(most_nodes, np.int8), np.empty(most_nodes, np.int8)
    parent, heap = np.empty(most_nodes, np.int32), np.empty(most_nodes, np.int32)
    slots = 4096
    while slots < 2 * most_nodes:
        slots *= 2
    table = np.zeros(slots, np.int64)
    turned, driven = curvature * lag * max(speed, 0.0), lag * max(speed, 0.0)
    start = state[0]
    start[0] = world.x + driven * math.cos(world.heading + 0.5 * turned)
    start[1] = world.y + driven * math.sin(world.heading + 0.5 * turned)
    start[2], start[3], start[4], start[5] = world.heading + turned, curvature, max(speed, 0.0) ** 2, 0.0
    motion.found, motion.count = False, 0
    offset = car.lidar_offset
    whole = to_go_around(way, start[0] + offset * math.cos(start[2]), start[1] + offset * math.sin(start[2]))
    if not math.isfinite(whole):
        return False
    middle = _SHARES // 2
    most = min(tightest, lateral / max(start[4], 1e-3))
    share[0] = round(min(max(curvature / most, -1.0), 1.0) * middle) + middle
    direction[0], parent[0], value[0], heap[0] = 1, -1, whole, 0
    clear = is_clear(way, car, start[0], start[1], start[2], nearest)
    hits, margin = outline_in_walls(world, car, start[0], start[1], start[2]), _MARGIN
    while margin > 0.0 and touches(world, car, start[0], start[1], start[2], margin):
        margin -= 0.01
    count, waiting, best, least = 1, 1, 0, whole
    after = np.empty(6)
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
            used = (to_share - middle) / middle
            _advance(here, used * limit, 0.5 * to * length, after)
            if abs(after[2] + 0.5 * used * limit * to * length - start[2]) > _MOST_TURN:
                continue
            touching = not clear and here[5] < _TOUCHING_LENGTH
            close = math.hypot(after[0] - world.x, after[1] - world.y) < _EXACT
            exact, corners = close and nearest == AT_WALL, close and reverses  # three discs leave the corners out
            checks = _CHECKS_AT_WALL if touching or exact or corners else 2
            passes = True
            for check in range(checks):
                _advance(here, used * limit, to * length * (check + 1) / checks, after)
                passes = _passes(way, car, after, nearest, touching, exact, hits, margin)
                if not passes or (corners and touches(world, car, after[0], after[1], after[2], margin)):
                    passes = False
                    break
            if not passes:
                continue
            if to == -1 and not _tail_is_seen(world, car, after):
                continue
            cells = to_go_at(way, after[0] + offset * math.cos(after[2]), after[1] + offset * math.sin(after[2]))
            if cells == FAR and to == 1 and not touching and here[5] > _UNKNOWN_LENGTH:
                continue
            to_go = cells * UNIT if cells != FAR else rest + length
            if not _is_new(table, after, 2 if nearest == AT_WALL else 1, to):
                continue
            braking = _BRAKING * limiter.braking * longitudinal_share(min(grip, 0.97) * abs(used), limiter.exponent)
            after[4] = max(here[4] - 2.0 * braking * length, min(here[4], slowest))
            after[5] = here[5] + length * (1.5 - 0.5 * to + _TURN_COST * after[3] ** 2)
            after[5] += _STEER_COST * abs(to_share - share[node]) + _REVERSE_COST * (to != direction[node])
            state[count] = after
            share[count], direction[count], parent[count] = to_share, to, node
            value[count] = after[5] + to_go
            if to_go < least:
                best, least = count, to_go
            _push(heap, value, waiting, count)
            waiting += 1
            count += 1
    _write(motion, best, parent, state, direction)
    return bool(motion.found)


@kernel
def is_clear(way: Record, car: Record, x: float, y: float, heading: float, nearest: int) -> bool:
    """Say whether three discs on the axis of a car at a place keep clear of walls."""
    cos, sin = math.cos(heading), math.sin(heading)
    back, front = 0.5 * car.width - car.rear_overhang, car.length - car.rear_overhang - 0.5 * car.width
    for k in range(3):
        place = back + 0.5 * k * (front - back)
        i, j = math.floor((x + place * cos) * PER_METRE), math.floor((y + place * sin) * PER_METRE)
        if not in_window(way.map, i, j) or way.blocked[i & RING, j & RING] & nearest != 0:
            return False
    return True


@kernel
def outline_in_walls(world: Record, car: Record, x: float, y: float, heading: float) -> int:
    """Return how many of 14 points of the outline of a car at a place lie in cells of walls."""
    cos, sin = math.cos(heading), math.sin(heading)
    hits = 0
    for k in range(7):
        place = k * car.length / 6.0 - car.rear_overhang
        for side in (-0.5 * car.width, 0.5 * car.width):
            i = math.floor((x + place * cos - side * sin) * PER_METRE)
            j = math.floor((y + place * sin + side * cos) * PER_METRE)
            hits += world.cells[i & RING, j & RING] == WALL
    return hits


@kernel
def touches(world: Record, car: Record, x: float, y: float, heading: float, margin: float) -> bool:
    """Say whether an end of the last scan's beams lies in the outline of a car at a place, wider by a margin [m]."""
    cos, sin = math.cos(heading), math.sin(heading)
    tail, nose = -car.rear_overhang - margin, car.length - car.rear_overhang + margin
    for k in range(world.ends_known):
        dx, dy = world.ends[k, 0] - x, world.ends[k, 1] - y
        if tail < cos * dx + sin * dy < nose and abs(cos * dy - sin * dx) < 0.5 * car.width + margin:
            return True
    return False


@kernel
def _tail_is_seen(world: Record, car: Record, place: NDArray[np.float64]) -> bool:
    """Say whether the ground under a car's tail was seen: nothing else shows what is behind the car."""
    x, y = place[0] - car.rear_overhang * math.cos(place[2]), place[1] - car.rear_overhang * math.sin(place[2])
    i, j = math.floor(x * PER_METRE), math.floor(y * PER_METRE)
    return bool(in_window(world, i, j) and world.cells[i & RING, j & RING] == FREE)


@kernel
def _passes(
    way: Record,
    car: Record,
    place: NDArray[np.float64],
    nearest: int,
    touching: bool,
    exact: bool,
    hits: int,
    margin: float,
) -> bool:
    """Say whether the car may be at a place."""
    x, y, heading = place[0], place[1], place[2]
    if not (touching or exact):
        return is_clear(way, car, x, y, heading, nearest)
    if outline_in_walls(way.map, car, x, y, heading) > (hits if touching else MOST_IN_WALLS):
        return False
    return not touches(way.map, car, x, y, heading, margin)


@kernel
def _advance(place: NDArray[np.float64], curvature: float, length: float, after: NDArray[np.float64]) -> None:
    """Write where an arc of that length [m] leads, negative in reverse: x, y, heading and curvature."""
    middle = place[2] + 0.5 * curvature * length
    after[0], after[1] = place[0] + length * math.cos(middle), place[1] + length * math.sin(middle)
    after[2], after[3] = place[2] + curvature * length, curvature


@kernel
def _is_new(table: NDArray[np.int64], place: NDArray[np.float64], fine: int, direction: int) -> bool:
    """Say whether no motion has come to about this place yet, and remember that one has."""
    i, j = (
        math.floor(place[0] * PER_METRE * fine) & (fine * SIZE - 1),
        math.floor(place[1] * PER_METRE * fine) & (fine * SIZE - 1),
    )
    turn = int((place[2] % (2.0 * math.pi)) / (2.0 * math.pi) * _HEADINGS * fine) % (_HEADINGS * fine)
    key = ((i * SIZE * fine + j) * _HEADINGS * fine + turn) * 2 + (direction == 1) + 1
    slot = (key * 2654435761) & (len(table) - 1)
    while table[slot] != 0:
        if table[slot] == key:
            return False
        slot = (slot + 1) & (len(table) - 1)
    table[slot] = key
    return True


@kernel
def _push(heap: NDArray[np.int32], value: NDArray[np.float64], waiting: int, node: int) -> None:
    """Add a node to a heap of so many, the least value first."""
    place = waiting
    while place > 0 and value[heap[(place - 1) // 2]] > value[node]:
        heap[place] = heap[(place - 1) // 2]
        place = (place - 1) // 2
    heap[place] = node


@kernel
def _pop(heap: NDArray[np.int32], value: NDArray[np.float64], waiting: int) -> int:
    """Take the node of the least value from a heap of so many."""
    least, last, size, place = heap[0], heap[waiting - 1], waiting - 1, 0
    while 2 * place + 1 < size:
        child = 2 * place + 1
        if child + 1 < size and value[heap[child + 1]] < value[heap[child]]:
            child += 1
        if value[heap[child]] >= value[last]:
            break
        heap[place] = heap[child]
        place = child
    heap[place] = last
    return int(least)


@kernel
def _write(
    motion: Record,
    node: int,
    parent: NDArray[np.int32],
    state: NDArray[np.float64],
    direction: NDArray[np.int8],
) -> None:
    """Write the motion that leads to a node: its first points, if it has too many."""
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
