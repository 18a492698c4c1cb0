"""Parts that scenes are built of: rooms with walls round them, ways with rounded corners, and mirror images.

All lengths are in metres. A way begins along +x. A scene with a turn is made for a turn to the left, and mirrored for a
turn to the right.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from fg_mujoco.course.moving_obstacles import MovingObstacle
from fg_mujoco.course.obstacles import Box, Obstacle, Prism
from fg_mujoco.course.polyline import step_lengths, steps, turns
from fg_mujoco.course.scene import Scene
from fg_mujoco.messages import FloatArray

WALL = 0.1  # [m] thickness
CORNER_RADIUS = 0.8  # [m] of a way; the default vehicle turns on 0.742 m
_ARC_STEP = math.radians(5.0)


def walls_round(room: ArrayLike) -> tuple[Box, ...]:
    """Return walls along the sides of a room, outside of it: one box a side, closed at the corners.

    Args:
      room: corners, counterclockwise. Shape (n, 2) [m].
    """
    room = np.asarray(room, float)
    ahead = steps(room) / step_lengths(room)[:, None]
    # At a corner of the room the walls meet in a mitre. At one that juts into it they overlap by themselves; where that
    # is sharp their square ends would stand out into the room, behind each other, and are cut off.
    turn = turns(room)
    reach = np.maximum(np.tan(0.5 * turn), 0.0) * WALL
    sharp = turn < -0.5 * math.pi
    reach[sharp] = WALL / np.tan(turn[sharp] + math.pi) * -1.0
    start, end = room - reach[:, None] * ahead, np.roll(room, -1, axis=0) + np.roll(reach, -1)[:, None] * ahead
    middle = 0.5 * (start + end) + 0.5 * WALL * np.column_stack((ahead[:, 1], -ahead[:, 0]))
    return tuple(
        Box(x=x, y=y, length=math.dist(a, b), width=WALL, heading=math.atan2(dy, dx))
        for (x, y), (dx, dy), a, b in zip(middle.tolist(), ahead.tolist(), start.tolist(), end.tolist(), strict=True)
    )


def block(low: tuple[float, float], high: tuple[float, float]) -> Box:
    """Return the box between two opposite corners [m], along the axes."""
    (x0, y0), (x1, y1) = low, high
    return Box(x=0.5 * (x0 + x1), y=0.5 * (y0 + y1), length=x1 - x0, width=y1 - y0)


def corridor(begin: float, end: float, width: float) -> FloatArray:
    """Return a straight room along x, from `begin` to `end` [m]. Shape (4, 2) [m]."""
    half = 0.5 * width
    return np.array([[begin, -half], [end, -half], [end, half], [begin, half]])


def rounded_way(corners: ArrayLike, radius: float = CORNER_RADIUS) -> FloatArray:
    """Return an open line through `corners` (n, 2) [m] with an arc of `radius` [m] at each but the first and last.

    The legs must have room for the arcs. Shape (m, 2) [m].
    """
    corners = np.asarray(corners, float)
    points = [corners[:1]]
    for before, corner, after in zip(corners[:-2], corners[1:-1], corners[2:], strict=True):
        into, out = (corner - before) / math.dist(before, corner), (after - corner) / math.dist(corner, after)
        turn = math.atan2(into[0] * out[1] - into[1] * out[0], float(into @ out))
        first = corner - radius * math.tan(0.5 * abs(turn)) * into
        side = math.copysign(1.0, turn)
        left = np.array([-into[1], into[0]])
        angles = np.linspace(0.0, abs(turn), max(math.ceil(abs(turn) / _ARC_STEP), 1) + 1)[:, None]
        points.append(first + radius * (np.sin(angles) * into + side * (1.0 - np.cos(angles)) * left))
    return np.concatenate((*points, corners[-1:]))


def mirrored(scene: Scene) -> Scene:
    """Return the mirror image of a scene: left is right."""
    return replace(
        scene,
        way=scene.way * (1.0, -1.0),
        walls=tuple(map(_mirrored, scene.walls)),
        obstacles=tuple(map(_mirrored, scene.obstacles)),
        moving=tuple(map(_mirrored_moving, scene.moving)),
    )


def _mirrored(solid: Obstacle) -> Obstacle:
    if isinstance(solid, Prism):
        return replace(solid, footprint=tuple((x, -y) for x, y in reversed(solid.footprint)))
    return replace(solid, y=-solid.y, heading=-solid.heading) if isinstance(solid, Box) else replace(solid, y=-solid.y)


def _mirrored_moving(moving: MovingObstacle) -> MovingObstacle:
    (x, y), (end_x, end_y) = moving.start, moving.end
    return replace(moving, start=(x, -y), end=(end_x, -end_y), heading=-moving.heading)
