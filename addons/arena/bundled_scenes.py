"""The bundled scenes, each a function of a name, a seed and a car; `fg_mujoco.course.scenes` finds them by name.

Lengths are in metres. A way begins along +x, from the start at x = 0. A scene with a turn is made for a turn to the
left, and mirrored for a turn to the right.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from fg_mujoco import portable
from fg_mujoco.course.course import SLOWEST_RACE
from fg_mujoco.course.moving_obstacles import MovingObstacle
from fg_mujoco.course.obstacles import Box, Cylinder, Obstacle, Prism
from fg_mujoco.course.polyline import step_lengths, steps, turns
from fg_mujoco.course.scene import Scene
from fg_mujoco.errors import TrackError
from fg_mujoco.messages import CarParameters, FloatArray

WALL = 0.1  # [m] thickness
CORNER_RADIUS = 0.8  # [m] of a way; the default vehicle turns on 0.742 m
_ARC_STEP = math.radians(5.0)
WIDTH = 2.2  # [m] of a corridor, as on RoboRacer tracks
BEHIND = 3.0  # [m] of the corridor behind the start
WAY_BEHIND = 2.5  # [m] of the way behind the start
BEYOND = 6.0  # [m] beyond the goal: more than the slides' 5 m that a gap is deep
_SIDES = (0.2, 0.5)  # [m] length and width of a box are between
SPARSE_GAP, DENSE_GAP = 2.5, 2.0  # least way past a box, in widths of the car
FIELD_WIDTH = 5.0  # [m] of the field of cylinders
FIELD_GAPS = (1.5, 4.0)  # widths of the car: between a cylinder and the nearest, and to the walls, at least the first
WAY_THROUGH = 2.2  # widths of the car: a disc of this diameter gets through the field

LANE, DOOR = 2.0, 2.3  # widths of the car: the chicane's narrow way straight on, and its wide one
DOOR_BEARING = math.radians(130.0)  # of the wide way, from the narrow one
_SECOND = (0.7, 0.5)  # [m] length and width of what stands between them
_LANE_ON = 1.5  # [m] that the narrow way is narrow for, so that it looks small besides
_ROOM = 4.5  # [m] width of the room behind the lane, without the lane

_RADII = (0.08, 0.2)  # [m] of cylinders
_DARTS, _DRAWS = 150, 100
_CELL = 0.05  # [m] of the grid that a way is searched on
DEAD_END_WIDTH = 1.6  # [m] too narrow for the default vehicle to turn round in, which needs 1.9 m
_TRAP_VISIBLE = 1.2  # [m] of the way behind the corner's inner edge, before it bends out of sight
_TRAP_BEHIND = 6.0  # [m] of the road behind the start, which is what is seen for the longest
_TRAP_RUN_OFF, _TRAP_BULGE = 0.5, 1.5  # [m] of the room beyond the corner: ahead, and to the outside
_AFTER = 6.0  # [m] from a corner to the goal


# parts: rooms with walls round them, ways with rounded corners, mirror images


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
    reach = np.maximum(portable.tan(0.5 * turn), 0.0) * WALL
    sharp = turn < -0.5 * math.pi
    reach[sharp] = WALL / portable.tan(turn[sharp] + math.pi) * -1.0
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
        points.append(first + radius * (portable.sin(angles) * into + side * (1.0 - portable.cos(angles)) * left))
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


# in a straight corridor


def straight(
    name: str, length: float, obstacles: tuple[Obstacle, ...] = (), *, width: float = WIDTH, **settings: object
) -> Scene:
    """Return a scene whose goal is `length` [m] from the start, down a straight corridor."""
    way = np.array([[-WAY_BEHIND, 0.0], [length + 4.0, 0.0]])
    return Scene(
        name=name, way=way, start=WAY_BEHIND, goal=WAY_BEHIND + length, obstacles=obstacles,
        walls=walls_round(corridor(-BEHIND, length + BEYOND, width)),
        **{"time_limit": length / SLOWEST_RACE} | settings,  # type: ignore[arg-type]
    )  # fmt: skip


def corridor_sparse(name: str, seed: int, car: CarParameters) -> Scene:
    """A corridor with a box every 4 to 5 m, on the left or the right, which leaves 2.5 car widths or more."""
    rng = np.random.default_rng(seed)
    stations = 4.0 + np.cumsum(rng.uniform(4.0, 5.0, 5)) - 4.0
    boxes = []
    for x in stations.tolist():
        length, width = rng.uniform(*_SIDES, 2).tolist()
        gap = SPARSE_GAP * car.width
        way = gap + rng.random() * (WIDTH - width - gap)  # on one side; the rest on the other
        y = 0.5 * WIDTH - way - 0.5 * width
        boxes.append(Box(x=x, y=y * rng.choice((-1.0, 1.0)).item(), length=length, width=width))
    return straight(name, 25.0, tuple(boxes))


def crossing_box(name: str, seed: int, car: CarParameters) -> Scene:
    """A corridor that a box crosses, back and forth; when it is in the way depends on the seed."""
    rng = np.random.default_rng(seed)
    x, speed = float(rng.uniform(8.0, 12.0)), float(rng.uniform(0.5, 1.2))
    reach = 0.5 * WIDTH - 0.25  # of its middle
    box = MovingObstacle(
        length=0.3, width=0.4, start=(x, -reach), end=(x, reach), speed=speed, back_and_forth=True,
        headway=float(rng.uniform(0.0, 4.0 * reach)),
    )  # fmt: skip
    return straight(name, 18.0, moving=(box,))


def slow_leader(name: str, seed: int, car: CarParameters) -> Scene:
    """A corridor that a box drives down ahead of the car, at 1 to 2 m/s, which leaves 2 car widths or more."""
    rng = np.random.default_rng(seed)
    y, speed = float(rng.uniform(-0.3, 0.3)), float(rng.uniform(1.0, 2.0))
    box = MovingObstacle(length=0.5, width=0.3, start=(4.0, y), end=(30.0 + 4.5, y), speed=speed)
    return straight(name, 30.0, moving=(box,))


def corridor_dense(name: str, seed: int, car: CarParameters) -> Scene:
    """A corridor with boxes on both sides every 2.2 to 2.8 m, 2 to 3 car widths between them."""
    rng = np.random.default_rng(seed)
    boxes: list[Box] = []
    middle = 0.0  # of the way between the boxes
    for x in (3.0 + np.arange(8) * 2.5 + rng.uniform(-0.15, 0.15, 8)).tolist():
        gap = rng.uniform(DENSE_GAP, 3.0) * car.width
        room = 0.5 * (WIDTH - gap) - _SIDES[0]
        middle = float(np.clip(middle + rng.uniform(-0.8, 0.8), -room, room))
        for low, high in ((-0.5 * WIDTH, middle - 0.5 * gap), (middle + 0.5 * gap, 0.5 * WIDTH)):
            length = rng.uniform(*_SIDES)
            boxes.append(block((x - 0.5 * length, low), (x + 0.5 * length, high)))
    return straight(name, 25.0, tuple(boxes))


# about the width of gaps, in widths of the car


def narrow_gap_120(name: str, seed: int, car: CarParameters) -> Scene:
    """A corridor with a wall across, and in it, anywhere, a gap of 1.2 car widths."""
    return _narrow_gap(name, seed, 1.2 * car.width)


def narrow_gap_150(name: str, seed: int, car: CarParameters) -> Scene:
    """A corridor with a wall across, and in it, anywhere, a gap of 1.5 car widths."""
    return _narrow_gap(name, seed, 1.5 * car.width)


def narrow_gap_200(name: str, seed: int, car: CarParameters) -> Scene:
    """A corridor with a wall across, and in it, anywhere, a gap of 2 car widths."""
    return _narrow_gap(name, seed, 2.0 * car.width)


def _narrow_gap(name: str, seed: int, gap: float) -> Scene:
    rng = np.random.default_rng(seed)
    half, thickness, x = 0.5 * WIDTH, 0.2, 8.0
    y = float(rng.uniform(-1.0, 1.0)) * (half - 0.5 * gap - 0.15)
    sides = (block((x, -half), (x + thickness, y - 0.5 * gap)), block((x, y + 0.5 * gap), (x + thickness, half)))
    return straight(name, 14.0, sides)


def cylinder_field(name: str, seed: int, car: CarParameters) -> Scene:
    """A field of cylinders, each 1.5 to 4 car widths from the nearest one, 1.5 or more from the walls."""
    rng = np.random.default_rng(seed)
    for _ in range(_DRAWS):
        found = _scattered(rng, (3.0, 11.0), 0.5 * FIELD_WIDTH, car)
        gaps = [least for i in range(len(found)) if (least := _least_gap(found[i], np.delete(found, i, axis=0)))]
        if max(gaps) <= FIELD_GAPS[1] * car.width and _passable(found, 14.0, car):
            cylinders = tuple(Cylinder(x=x, y=y, radius=radius) for x, y, radius in found.tolist())
            return straight(name, 14.0, cylinders, width=FIELD_WIDTH)
    raise TrackError(f"{name!r}: no field of cylinders with a way through in {_DRAWS} draws; accepted: another seed")


def wrong_side_chicane(name: str, seed: int, car: CarParameters) -> Scene:
    """Out of a lane the wider opening takes a turn tighter than the car can make; the narrower one is straight on."""
    rng = np.random.default_rng(seed)
    half, end = 0.5 * LANE * car.width, float(rng.uniform(5.5, 7.5))  # of the lane, on whose axis is the way
    back = np.array([math.cos(DOOR_BEARING), math.sin(DOOR_BEARING)])  # the direction of the wider opening
    second = np.array([end + DOOR * car.width / back[1], half])  # corner of what stands between the two openings
    middle = second + 0.5 * (_SECOND[0] * back + _SECOND[1] * np.array([back[1], -back[0]]))
    x = float(second[0])
    between = (
        Box(x=float(middle[0]), y=float(middle[1]), length=_SECOND[0], width=_SECOND[1], heading=DOOR_BEARING),
        block((x, half), (x + _LANE_ON, half + 0.3)),
    )
    length, shoulder = x + 5.0, np.array([end, half]) + _ROOM / back[1] * back
    room = [
        (-BEHIND, -half), (length + BEYOND, -half), (length + BEYOND, shoulder[1]), shoulder, (end, half),
        (-BEHIND, half),
    ]  # fmt: skip
    tip = block((end - 0.2, half), (end, half + 0.02))  # of the corner between lane and room, which is cut off
    scene = Scene(
        name=name, way=np.array([[-WAY_BEHIND, 0.0], [length + 4.0, 0.0]]), start=WAY_BEHIND, goal=WAY_BEHIND + length,
        walls=(*walls_round(room), tip), obstacles=between, time_limit=length / SLOWEST_RACE,
    )  # fmt: skip
    return mirrored(scene) if rng.random() < 0.5 else scene


def _scattered(rng: np.random.Generator, along: tuple[float, float], half: float, car: CarParameters) -> FloatArray:
    """Return cylinders at random places, at least the least gap apart. Shape (n, 3): x, y, radius [m]."""
    least, most = (widths * car.width for widths in FIELD_GAPS)
    darts = rng.uniform(size=(_DARTS, 4))
    radii = _RADII[0] + darts[:, 2] * (_RADII[1] - _RADII[0])
    x = along[0] + darts[:, 0] * (along[1] - along[0])
    y = (2.0 * darts[:, 1] - 1.0) * (half - least - radii)
    kept = np.empty((0, 3))
    for dart, wanted in zip(np.column_stack((x, y, radii)), darts[:, 3], strict=True):
        if _least_gap(dart, kept) >= least + wanted * (most - least):  # gaps of all widths, not the least ones only
            kept = np.vstack((kept, dart))
    return kept


def _least_gap(cylinder: FloatArray, others: FloatArray) -> float:
    """Return the distance from one cylinder to the nearest of others (n, 3) [m]."""
    apart = np.hypot(*(others[:, :2] - cylinder[:2]).T) - others[:, 2] - cylinder[2]
    return float(apart.min(initial=math.inf))


def _passable(cylinders: FloatArray, length: float, car: CarParameters) -> bool:
    """Return whether a disc of the diameter WAY_THROUGH gets from the start to beyond `length` [m], on a grid."""
    radius, half = 0.5 * WAY_THROUGH * car.width, 0.5 * FIELD_WIDTH
    x, y = np.arange(0.0, length + _CELL, _CELL), np.arange(-half, half + _CELL, _CELL)
    across = np.hypot(x[:, None, None] - cylinders[:, 0], y[:, None] - cylinders[:, 1]) - cylinders[:, 2]
    free = (across.min(axis=2) > radius) & (np.abs(y) < half - radius)
    reached = np.zeros_like(free)
    reached[0, len(y) // 2] = free[0, len(y) // 2]
    count = 0
    while count != (count := int(reached.sum())):
        for axis, step in ((0, 1), (0, -1), (1, 1), (1, -1)):
            reached |= np.roll(reached, step, axis) & free  # no cell on the edge is free at both ends
    return bool(reached[-1].any())


# at a corner: the way turns, ends, or is hard to see


def square_corner(name: str, seed: int, car: CarParameters) -> Scene:
    """A corridor with a corner of 90 degrees, to the left or the right."""
    rng = np.random.default_rng(seed)
    x, half = float(rng.uniform(6.0, 10.0)), 0.5 * WIDTH  # of the corner
    end = _AFTER + BEYOND
    room = [(-BEHIND, -half), (x + half, -half), (x + half, end), (x - half, end), (x - half, half), (-BEHIND, half)]
    way = rounded_way([(-WAY_BEHIND, 0.0), (x, 0.0), (x, end - 2.0)])
    scene = _on(name, way, x + _AFTER, room)
    return mirrored(scene) if rng.random() < 0.5 else scene


def dead_end(name: str, seed: int, car: CarParameters) -> Scene:
    """A corridor that ends in a wall and is too narrow to turn round in; the goal is to stop before it."""
    end = float(np.random.default_rng(seed).uniform(10.0, 18.0))
    way = np.array([[-WAY_BEHIND, 0.0], [end, 0.0]])
    room = corridor(-BEHIND, end, DEAD_END_WIDTH)
    return _on(name, way, end - 3.0, room, goal_is_to_stop=True)


def u_turn_trap(name: str, seed: int, car: CarParameters) -> Scene:
    """A corner of 135 degrees with room to run out of it: from there the road back looks longer than the way on."""
    rng = np.random.default_rng(seed)
    x = float(rng.uniform(7.0, 10.0))  # of the inner edge of the corner
    half = 0.5 * WIDTH
    on, out = np.array([-1.0, 1.0]) / math.sqrt(2.0), np.array([1.0, 1.0]) / math.sqrt(2.0)
    edge = np.array([x, half])
    bend = edge + _TRAP_VISIBLE * on  # from there on the way leads along `out`, after it has led along `on`
    far = edge + WIDTH * out  # where the outer wall of the way is, across from the edge
    mouth = far - on * (far[1] - half) / on[1]
    end = mouth[0] + _TRAP_RUN_OFF
    room = [
        (-_TRAP_BEHIND, -half), (x, -half), (x + _TRAP_BULGE, -half - _TRAP_BULGE), (end, -half - _TRAP_BULGE),
        (end, half), mouth,
        bend + WIDTH * out, bend + 12.0 * out, bend + 12.0 * out + WIDTH * on, bend + WIDTH * on, edge,
        (-_TRAP_BEHIND, half),
    ]  # fmt: skip
    centre = edge + 0.5 * WIDTH * out
    corner = centre - on * centre[1] / on[1]  # of the way, on the axis of the road in
    turn = bend + 0.5 * WIDTH * (out + on)
    way = rounded_way([(-WAY_BEHIND, 0.0), corner, turn, turn + 10.0 * out])
    goal = float(np.hypot(*np.diff(way, axis=0).T).sum()) - 10.0 - WAY_BEHIND + 4.0
    scene = _on(name, way, goal, room)
    return mirrored(scene) if rng.random() < 0.5 else scene


def _on(name: str, way: np.ndarray, length: float, room: object, *, goal_is_to_stop: bool = False) -> Scene:
    return Scene(
        name=name, way=way, start=WAY_BEHIND, goal=WAY_BEHIND + length, walls=walls_round(room),  # type: ignore[arg-type]
        time_limit=length / SLOWEST_RACE, goal_is_to_stop=goal_is_to_stop,
    )  # fmt: skip
