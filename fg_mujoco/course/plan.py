"""A course from above as SVG, for notebooks and `show()`: it needs no extra. `pictures.plots` makes PNG pictures."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from ..display import Drawing, paragraph
from ..messages import FloatArray
from .course import Course, describe_course, wall_outlines
from .moving_obstacles import MovingObstacle
from .obstacles import Obstacle

_MARGIN = 0.5  # [m] round the walls
_FLOOR, _WALL, _EDGE, _OBSTACLE, _LINE = "#f2f2f2", "#777777", "#404040", "#d9732b", "#8c8c8c"


def plan(
    course: Course,
    *,
    obstacles: Iterable[Obstacle] | None = None,
    moving: Iterable[MovingObstacle] | None = None,
    time: float = 0.0,
    line: bool = True,
    around: FloatArray | None = None,
) -> Drawing:
    """Return a drawing of a course: walls, line, start with its direction, goal, obstacles, and a scale in metres.

    Args:
      course: what is drawn.
      obstacles: that stand there; None: the course's own.
      moving: obstacles that move; None: the course's own.
      time: at which these are drawn [s].
      line: whether the line of the course is drawn.
      around: points (n, 2) that the drawing has room for, besides the course [m]; None: the course alone.
    """
    outlines = wall_outlines(course)
    points = np.concatenate((course.bounds, *outlines, *([] if around is None else [around])))
    drawing = Drawing(points.min(axis=0) - _MARGIN, points.max(axis=0) + _MARGIN)
    if course.edges:
        drawing.area(course.edges[:2], _FLOOR, _EDGE)
    solid = course.edges[2:] if course.edges else outlines
    for outline in solid:
        drawing.area([outline], _WALL, _EDGE)
    if line and math.isfinite(course.length):
        drawing.line(course.map_line.points, _LINE, width=0.8, closed=course.closed, dashes="6 4")
    for obstacle in course.obstacles if obstacles is None else obstacles:
        drawing.area([obstacle.corners()], _OBSTACLE, _OBSTACLE)
    for mover in course.moving if moving is None else moving:
        drawing.line([mover.start, mover.end], _OBSTACLE, width=0.8, dashes="3 3")
        drawing.area([mover.corners(time)], _OBSTACLE, "black")
    for ends in course.ground_lines:
        drawing.line(ends, "black", width=1.8)
    x, y, heading = course.start_pose()
    drawing.arrow((x, y), heading, "black")
    drawing.scale()
    return drawing


def course_html(course: Course) -> str:
    """Return a course for notebooks, as HTML: its description and its plan."""
    said = describe_course(course)
    return paragraph(said) + plan(course).svg(said)
