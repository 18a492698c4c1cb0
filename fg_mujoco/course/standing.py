"""Decides where a car can stand: on the floor between the walls of a course, clear of them and of obstacles.

if off_course(course, (x, y), on_line) or stands_in_something(course, (x, y, heading), car):
    ...
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from ..messages import CarParameters, FloatArray
from .course import Course, outline, wall_outlines
from .obstacles import Obstacle
from .polyline import cross, is_inside


def off_course(course: Course, place: ArrayLike, on_line: ArrayLike, *, lane: bool = False) -> bool:
    """Return whether a place, x and y [m], is outside the walls, or within an island: no floor of the course.

    Args:
      course: with walls; without, nothing is off it.
      place: that is asked about.
      on_line: the nearest point of the course's line, x and y [m]. Where the course has no edges, but walls of solids,
        the place is off the course if a wall stands between the two.
      lane: whether the same holds on any course: then a place between the walls of another stretch is off it, too.
    """
    point, on = (np.asarray(each, np.float64)[:2] for each in (place, on_line))
    if len(course.edges) and not is_inside(point[np.newaxis], course.edges)[0]:
        return True
    return (lane or not course.edges) and _crosses(_sides(course), on, point)


def stands_in_something(
    course: Course, pose: ArrayLike, car: CarParameters, obstacles: Sequence[Obstacle] = ()
) -> bool:
    """Return whether a car at a pose touches a wall or an obstacle, or stands within one; moving ones as at 0 s.

    The pose is of the rear axle, x [m], y [m], heading [rad]. The obstacles stand there besides the course's own.
    """
    from .clearance import least_clearance

    solids = [solid.corners() for solid in (*course.obstacles, *obstacles)]
    solids += [moving.box(0.0).corners() for moving in course.moving]
    placed = np.asarray(pose, np.float64)[np.newaxis, :3]
    if any(is_inside(placed[:, :2], [solid])[0] for solid in solids):
        return True
    sides = np.concatenate([_sides(course), *map(outline, solids)])
    return bool(len(sides)) and least_clearance(placed, sides, car) <= 0.0


def _crosses(sides: FloatArray, start: FloatArray, end: FloatArray) -> bool:
    """Return whether the way between two points (2,) crosses any of some lines (n, 4) [m]."""
    one, other = sides[:, :2], sides[:, 2:]
    along, way = other - one, end - start
    apart = cross(along, start - one) * cross(along, end - one) < 0.0
    return bool((apart & (cross(way, one - start) * cross(way, other - start) < 0.0)).any())


@lru_cache(maxsize=8)
def _sides(course: Course) -> FloatArray:
    """Return the walls of a course from above, one line after the other. Shape (n, 4) [m]."""
    lines = wall_outlines(course)
    return np.concatenate([outline(line) for line in lines]) if lines else np.empty((0, 4))
