"""The fastest closed line between the walls of a map: of least curvature, or of least lap time.

Each point of the line may move along its normal within the room that walls and obstacles leave the car's rectangle and
a margin. controllers.safety.line_optimizer moves the points; this module finds their room, in
native/addons/drivers/map_raceline.cpp.

Limits: the line found is the best near the one of least curvature. Another side of an obstacle is not tried.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.controllers.safety.friction_limiter import FrictionLimiter
from fg_mujoco.controllers.safety.line_optimizer import (
    FLATTENED,
    STEPS,
    Grip,
    begin_step,
    fastest_lap,
    improve,
    limited_grip,
    measure,
    normals_of,
    spread,
)
from fg_mujoco.errors import SettingsError
from fg_mujoco.messages import CarParameters, FloatArray, MapLine
from fg_mujoco.native import core

from .line_profile import ROOM, Y

Objective = Literal["time", "curvature"]

SPACING = 0.2  # [m] of the points of a line
_WALL_SPACING = 0.05  # [m] of the points of walls
_CELL: float = core.WALL_CELL  # [m] of the grid in which walls are looked up
_THROUGH = 0.05  # [m] by which a wall may lie on the wrong side of the line, and still be that wall
_THROUGH_OBSTACLE = 1.5  # [m] the same for obstacles, through which the first line leads
_LEAST_MARGIN = 0.5  # share of a planner's margin to the walls that it leaves when it is off its line
_MORE_ROUNDS = 18  # of least curvature, where that is the objective


@dataclass(frozen=True, kw_only=True, eq=False)
class Walls:
    """Points of walls and obstacles, sorted by the cells of a grid."""

    points: FloatArray  # (m, 2) [m]
    sides: FloatArray  # (m, 2): 1 to the left of the line, -1 to the right; how far it may lie on the other side [m]
    origin: FloatArray  # (2,) [m] of the grid
    starts: NDArray[np.int64]  # (columns, rows + 1): index of each cell's first point

    @classmethod
    def of(
        cls,
        left: Iterable[FloatArray],
        right: Iterable[FloatArray],
        left_obstacles: Iterable[FloatArray] = (),
        right_obstacles: Iterable[FloatArray] = (),
    ) -> Walls:
        """Return walls of closed outlines (k, 2) [m]: those to the left of the line, and those to its right."""
        kinds = [(left, 1.0, _THROUGH), (right, -1.0, _THROUGH)]
        kinds += [(left_obstacles, 1.0, _THROUGH_OBSTACLE), (right_obstacles, -1.0, _THROUGH_OBSTACLE)]
        points, sides = [], []
        for outlines, side, through in kinds:
            for outline in outlines:
                dense = _divided(outline, _WALL_SPACING)
                points.append(dense)
                sides.append(np.tile([side, through], (len(dense), 1)))
        if not points:
            raise SettingsError("a line without walls beside it; accepted: a circuit whose walls are known")
        every, side_of = np.concatenate(points), np.concatenate(sides)
        origin = every.min(axis=0)
        cells = np.floor((every - origin) / _CELL).astype(np.int64)
        columns, rows = (cells.max(axis=0) + 1).tolist()
        index = cells[:, 0] * rows + cells[:, 1]
        order = np.argsort(index, kind="stable")
        starts = np.searchsorted(index[order], np.arange(columns)[:, None] * rows + np.arange(rows + 1))
        return cls(points=every[order], sides=side_of[order], origin=origin, starts=starts.astype(np.int64))


def walls_beside(line: FloatArray, outlines: Iterable[FloatArray]) -> Walls:
    """Return closed outlines (k, 2) [m] as walls of a closed line (n, 2) [m], each on the side where most of it lies.

    One that lies on both sides stands on the line, as islands do, and is passed on the other side. Or SettingsError.
    """
    ahead = np.roll(line, -1, axis=0) - np.roll(line, 1, axis=0)
    kinds: list[list[FloatArray]] = [[], [], [], []]
    for outline in outlines:
        points = _divided(outline, _CELL)
        nearest = [int(np.argmin((line[:, 0] - x) ** 2 + (line[:, 1] - y) ** 2)) for x, y in points.tolist()]
        away = points - line[nearest]
        leftwards = ahead[nearest, 0] * away[:, 1] - ahead[nearest, 1] * away[:, 0] > 0.0
        share = float(leftwards.mean())
        kinds[(0 if share in (0.0, 1.0) else 2) + (share < 0.5)].append(outline)
    return Walls.of(*kinds)


@dataclass(frozen=True, kw_only=True, eq=False)
class OptimizedLine:
    """A closed line, and how fast a lap of it is by the grip that it was made for."""

    points: FloatArray  # (n, 2) [m] of the rear axle, evenly apart, in driving order
    speeds: FloatArray  # (n,) [m/s]
    lap_time: float  # [s]


def optimize_line(
    start: FloatArray, walls: Walls, car: CarParameters, grip: Grip, *, margin: float, objective: Objective = "time"
) -> OptimizedLine:
    """Return the fastest line near a closed line (n, 2) [m] that leads between the walls, with a margin to them [m].

    `start` is in driving order, the first point not repeated, between the walls; it may lead through obstacles.
    `objective` is `time`, or `curvature` for the least integral of the squared curvature. Raises SettingsError: the
    solver does not converge.
    """
    line, step, weight, more = _even(start), 0, 1.0, _MORE_ROUNDS if objective == "curvature" else 0
    while step < (FLATTENED if more else STEPS):
        line, most = begin_step(line, step, SPACING)
        normals = normals_of(line)
        step, weight = improve(line, normals, room(line, normals, walls, car, margin, most), step, weight, grip)
        if step == FLATTENED and more > 1:
            step, more = step - 1, more - 1
    line = spread(line, len(line))
    bends, to, on, speeds = np.empty((4, len(line)))
    measure(line, bends, to, on)
    time = fastest_lap(bends, on, grip._replace(lock=math.inf), speeds, to, to)
    if not math.isfinite(time + weight):
        raise SettingsError(
            f"the solver of the line of least {objective} does not converge; accepted: more room, a smaller margin"
        )
    return OptimizedLine(points=line, speeds=speeds, lap_time=time)


def room_beside(line: FloatArray, walls: Walls, car: CarParameters, margin: float, most: float) -> FloatArray:
    """Return how far a car, `margin` [m] from the walls, may be to the right (negative) and left, (n, 2) [m]."""
    low, high = room(line, normals_of(line), walls, car, margin, most)
    middle = np.clip(0.5 * (low + high), -most, most)
    return np.column_stack((np.minimum(low, middle), np.maximum(high, middle)))


def _divided(outline: FloatArray, spacing: float) -> FloatArray:
    """Return points at most `spacing` [m] apart along a closed outline."""
    ahead = np.roll(outline, -1, axis=0) - outline
    parts = np.maximum(np.ceil(np.hypot(*ahead.T) / spacing), 1.0).astype(int)
    first = np.repeat(np.arange(len(outline)), parts)
    share = (np.arange(len(first)) - np.repeat(np.cumsum(parts) - parts, parts)) / parts[first]
    return np.asarray(outline[first] + share[:, None] * ahead[first])


def _even(points: FloatArray) -> FloatArray:
    """Return a closed row of points (n, 2) [m] at even steps, its corners rounded over some of them."""
    loop = np.vstack((points, points[:1]))
    along = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(loop, axis=0).T))))
    count = max(8, round(along[-1] / SPACING))
    places = np.arange(count) * along[-1] / count
    even = np.column_stack([np.interp(places, along, column) for column in loop.T])
    for _ in range(2):
        even = 0.5 * even + 0.25 * (np.roll(even, 1, axis=0) + np.roll(even, -1, axis=0))
    return even


def room(
    line: FloatArray, normals: FloatArray, walls: Walls, car: CarParameters, margin: float, most: float
) -> tuple[FloatArray, FloatArray]:
    """Return how far each point may move along its normal, from and to, within `most`, (n,) [m]."""
    low, high = np.empty(len(line)), np.empty(len(line))
    outline = 0.5 * car.width + margin, car.rear_overhang + margin, car.length - car.rear_overhang + margin
    core.find_room(line, normals, (walls.points, walls.sides, walls.origin, walls.starts), outline, most, low, high)
    return low, high


@lru_cache(maxsize=8)
def raceline(map_line: MapLine, car: CarParameters, mu: float, max_speed: float, settings: Any) -> FloatArray:
    """Return the line of least lap time between the walls of a map, by what its profile may use of the tires. (n, 2).

    Raises SettingsError: a line that is open, without walls or friction limits; a solver that does not converge.
    """
    if not (map_line.closed and map_line.walls and math.isfinite(mu)):
        raise SettingsError("line is 'raceline'; accepted: on a circuit whose walls are known, with friction limits")
    uses = settings.cornering_use, settings.braking_use, settings.braking_use
    grip = limited_grip(FrictionLimiter(car, mu).record[0], max_speed, uses, math.inf)
    walls = walls_beside(map_line.points, map_line.walls)
    return optimize_line(map_line.points, walls, car, grip, margin=settings.margin).points


def room_on_map(table: FloatArray, map_line: MapLine, car: CarParameters, margin: float) -> FloatArray:
    """Return the room beside a planner's line to the right (negative) and to the left, (n, 2) [m], less some margin."""
    walls, line = walls_beside(map_line.points, map_line.walls), table[:, : Y + 1].copy()
    return room_beside(line, walls, car, _LEAST_MARGIN * margin, ROOM)
