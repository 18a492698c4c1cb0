"""Scenes in a straight corridor along x, from the start at x = 0."""

from __future__ import annotations

import numpy as np

from fg_mujoco.course.course import SLOWEST_RACE
from fg_mujoco.course.moving_obstacles import MovingObstacle
from fg_mujoco.course.obstacles import Box, Obstacle
from fg_mujoco.course.scene import Scene
from fg_mujoco.messages import CarParameters

from .parts import block, corridor, walls_round

WIDTH = 2.2  # [m] of a corridor, as on RoboRacer tracks
BEHIND = 3.0  # [m] of the corridor behind the start
WAY_BEHIND = 2.5  # [m] of the way behind the start
BEYOND = 6.0  # [m] beyond the goal: more than the slides' 5 m that a gap is deep
_SIDES = (0.2, 0.5)  # [m] length and width of a box are between
SPARSE_GAP, DENSE_GAP = 2.5, 2.0  # least way past a box, in widths of the car


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
