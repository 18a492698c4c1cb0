"""Scenes that are about the width of gaps, in widths of the car."""

from __future__ import annotations

import math

import numpy as np

from fg_mujoco.course.course import SLOWEST_RACE
from fg_mujoco.course.obstacles import Box, Cylinder
from fg_mujoco.course.scene import Scene
from fg_mujoco.errors import TrackError
from fg_mujoco.messages import CarParameters, FloatArray

from .corridors import BEHIND, BEYOND, WAY_BEHIND, WIDTH, straight
from .parts import block, mirrored, walls_round

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
