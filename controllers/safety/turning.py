"""Turning in several moves: a slow car in a place that is tighter than its turning circle turns as in a parking lot.

Where the car has been slow for `_PATIENCE`, or for as long as the tires take to start it, and there is a frontier, a
motion is searched for that may reverse (motion_search). It is followed move by move: the car stops before it changes
its direction, turns its wheels, and drives on. A motion that is no longer free, or on which the car stands still for a
second, is given up. Where turns begin again and again at one place, as where two of them undo each other, recovery
backs the car instead.
"""

from __future__ import annotations

import math

import numpy as np

from fg_mujoco.compiled.kernels import kernel

from ..control.planner_settings import Record
from ..control.steering import arc_through, saturate
from ..control.tracking import CURVATURE, HEADING, X, Y
from ..perception.local_map import WALL_IN_1, WALL_IN_2
from .motion_search import (
    DIRECTION,
    MOST_IN_WALLS,
    MOST_LOCK,
    MOST_NODES,
    MOTION,
    Query,
    outline_in_walls,
    search_motion,
    sorted_ends,
    touches,
)

_SLOW = 0.7  # [m/s]
_PATIENCE = 0.35  # [s]
_APART = 1.0  # [m] along the path, of turns at different places
_MOST_BEGUN = 8  # turns at one place; then recovery has the car
_GIVE_UP = 1.0  # [s] without moving
_SPEED = 0.8  # [m/s]
_BRAKING = 1.5  # [m/s^2] before a change of direction
_REACH = 0.3  # [m] to the point that the car steers for
_HORIZON = 1.5  # [m] by which the way to go is shorter at the end
_GRIP = 0.85  # of the cornering acceleration; the search takes the car to be standing

TURNING = np.dtype(
    [
        ("active", np.bool_),
        ("slow", np.float64),  # [s] for which the car has been slow; while turning, for which it has stood
        ("failed", np.int64),  # times that no motion was found
        ("begun", np.int64),  # turns that began near a place of the path,
        ("begun_at", np.float64),  # [m] along it
        ("motion", MOTION),
        ("next_point", np.int64),  # index of the motion's point that is next
        ("in_walls", np.int64),  # points of the outline in cells of walls at the beginning
        ("steering_angle", np.float64),  # [rad] of the command
        ("speed", np.float64),  # [m/s] of the command, negative in reverse
    ]
)
"""Type of what is kept from tick to tick; zero at the beginning."""


@kernel
def turn_in_moves(
    frontier: Record, limiter: Record, memory: Record, steering_angle: float, speed: float, period: float
) -> None:
    """Begin, follow or end a turn in several moves. While it is active, its command is in the memory.

    Args:
      frontier: of type FRONTIER_SEARCH.
      limiter: of type LIMITER.
      memory: of type TURNING, written to.
      steering_angle: present [rad].
      speed: present [m/s].
      period: of a tick [s].
    """
    if not memory.active and not _begins(frontier, limiter, memory, steering_angle, speed, period):
        return
    car, world, motion = limiter.car, frontier.map, memory.motion
    cos, sin = math.cos(world.heading), math.sin(world.heading)
    while memory.next_point < motion.count:
        point = motion.points[memory.next_point]
        ahead = (cos * (point[X] - world.x) + sin * (point[Y] - world.y)) * point[DIRECTION]
        after = memory.next_point + 1
        last = after == motion.count or motion.points[after, DIRECTION] != point[DIRECTION]
        if ahead > (0.03 if last else 0.12):
            break
        memory.next_point += 1
    stands = memory.slow > _GIVE_UP + 0.5 * period
    if memory.next_point >= motion.count or stands or not _is_free(frontier, car, memory):
        memory.active, memory.slow = False, 0.0
        return
    memory.slow = memory.slow + period if abs(speed) < 0.05 else 0.0
    direction, left, target = motion.points[memory.next_point, DIRECTION], 0.0, -1
    x, y, end = world.x, world.y, memory.next_point
    while end < motion.count and motion.points[end, DIRECTION] == direction:
        left += math.hypot(motion.points[end, X] - x, motion.points[end, Y] - y)
        x, y = motion.points[end, X], motion.points[end, Y]
        if target < 0 and left >= _REACH:
            target = end
        end += 1
    point = motion.points[target if target >= 0 else end - 1]
    ahead = cos * (point[X] - world.x) + sin * (point[Y] - world.y)
    aside = cos * (point[Y] - world.y) - sin * (point[X] - world.x)
    angle = math.atan(motion.points[memory.next_point, CURVATURE] * car.wheelbase)
    if abs(ahead) > 0.15:
        angle = arc_through(ahead, aside, car.wheelbase)
    memory.steering_angle = saturate(angle, car.max_steering_angle)
    memory.speed = min(_SPEED, math.sqrt(2.0 * _BRAKING * left) + 0.1) * direction
    turns_wheels = abs(memory.steering_angle - steering_angle) > 0.05 and abs(speed) < 0.3
    if speed * direction < -0.1 or turns_wheels:
        memory.speed, memory.slow = 0.0, 0.0


@kernel
def _begins(
    frontier: Record, limiter: Record, memory: Record, steering_angle: float, speed: float, period: float
) -> bool:
    """Return whether the car begins to turn now."""
    memory.slow = memory.slow + period if abs(speed) < _SLOW else 0.0
    settings = limiter.settings
    start = _SLOW / limiter.accelerating + 0.5 * settings.load_transfer_time  # [s] of a standing start to _SLOW
    patience = max(_PATIENCE, start + period) + limiter.car.command_delay  # [s] until the car answers a command
    if memory.slow < patience - 0.5 * period or not frontier.found:
        return False
    car, world = limiter.car, frontier.map
    if memory.begun == 0 or abs(world.along - memory.begun_at) > _APART:
        memory.begun, memory.begun_at = 0, world.along
    if memory.begun >= _MOST_BEGUN:
        return False
    memory.slow = 0.0
    curvature = math.tan(steering_angle) / car.wheelbase
    cos, sin = math.cos(world.heading), math.sin(world.heading)
    for attempt in range(2):  # the second has what the first leaves of the nodes, so next time the other one begins
        nearest = WALL_IN_2 if (attempt + memory.failed) % 2 == 0 else WALL_IN_1
        query = Query(curvature, 0.0, 0.0, _GRIP, MOST_LOCK, _HORIZON, nearest, True, MOST_NODES)
        if search_motion(frontier, limiter, memory.motion, query):
            memory.active, memory.next_point = True, 0
            memory.begun += 1
            memory.in_walls = outline_in_walls(world, car, world.x, world.y, cos, sin)
            return True
    memory.failed += 1
    return False


@kernel
def _is_free(frontier: Record, car: Record, memory: Record) -> bool:
    """Return whether what is left of the motion is free."""
    world, most = frontier.map, max(memory.in_walls, MOST_IN_WALLS)
    ends = sorted_ends(world, world.ends_known)
    for k in range(memory.next_point, memory.motion.count):
        x, y, heading = memory.motion.points[k, X], memory.motion.points[k, Y], memory.motion.points[k, HEADING]
        cos, sin = math.cos(heading), math.sin(heading)
        if outline_in_walls(world, car, x, y, cos, sin) > most or touches(ends, car, x, y, cos, sin, 0.0):
            return False
    return True
