"""Scenes at a corner: the way turns, ends, or is hard to see. They turn to the left, or mirrored to the right."""

from __future__ import annotations

import math

import numpy as np

from fg_mujoco.course.course import SLOWEST_RACE
from fg_mujoco.course.scene import Scene
from fg_mujoco.messages import CarParameters

from .corridors import BEHIND, BEYOND, WAY_BEHIND, WIDTH
from .parts import corridor, mirrored, rounded_way, walls_round

DEAD_END_WIDTH = 1.6  # [m] too narrow for the default vehicle to turn round in, which needs 1.9 m
_TRAP_VISIBLE = 1.2  # [m] of the way behind the corner's inner edge, before it bends out of sight
_TRAP_BEHIND = 6.0  # [m] of the road behind the start, which is what is seen for the longest
_TRAP_RUN_OFF, _TRAP_BULGE = 0.5, 1.5  # [m] of the room beyond the corner: ahead, and to the outside
_AFTER = 6.0  # [m] from a corner to the goal


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
