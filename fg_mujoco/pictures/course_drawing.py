"""Courses from above, as `plots` draws them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from ..course.course import Course, wall_outlines
from ..course.moving_obstacles import MovingObstacle
from ..course.obstacles import Obstacle
from ..course.polyline import enclosed_area
from ..messages import FloatArray

if TYPE_CHECKING:
    from collections.abc import Iterable

    from matplotlib.axes import Axes

_MARGIN = 0.5  # [m] round the walls
_WALL_COLOUR, _OBSTACLE_COLOUR = "0.45", "#d9732b"
_LINE: dict[str, Any] = {"color": "0.55", "linewidth": 0.6, "linestyle": (0, (6, 4))}
_START_LINE: dict[str, Any] = {"color": "black", "linewidth": 1.6, "solid_capstyle": "butt"}


def extent(course: Course, *lines: FloatArray) -> FloatArray:
    """Return the least and greatest x and y of the picture of a course and lines (n, 2). Shape (2, 2) [m]."""
    hall = [solid.corners() for solid in getattr(course, "hall", ())]
    points = np.concatenate((course.bounds, *wall_outlines(course), *hall, *lines))
    return np.stack((points.min(axis=0) - _MARGIN, points.max(axis=0) + _MARGIN))


def draw_course(axes: Axes, course: Course, *lines: FloatArray) -> None:
    """Draw ground, walls, start line, an arrow ahead, and goal line of a course, with room for `lines` (n, 2) [m]."""
    (left, bottom), (right, top) = extent(course, *lines)
    axes.set(xlim=(left, right), ylim=(bottom, top), aspect="equal", xlabel="x [m]", ylabel="y [m]")
    axes.grid(False)
    axes.spines[:].set_visible(True)
    ground, built = getattr(course, "ground", None), getattr(course, "built", None)
    if ground is not None:
        _shade(axes, ground)
    if course.edges:
        _draw_floor(axes, course.edges, "0.95" if ground is None else "none")
        if built is not None:
            _draw_solids(axes, (*course.walls, *getattr(course, "hall", ())), _WALL_COLOUR)
    else:
        _draw_solids(axes, course.walls, _WALL_COLOUR)
    for line in course.ground_lines:
        axes.plot(*line.T, **_START_LINE)
    _draw_start(axes, course, 0.06 * max(right - left, top - bottom))


def draw_line(axes: Axes, course: Course) -> None:
    """Draw the line of a course."""
    if not math.isfinite(course.length):
        return
    points = course.map_line.points
    axes.plot(*(closed(points) if course.closed else points).T, **_LINE)


def draw_obstacles(
    axes: Axes, obstacles: Iterable[Obstacle], moving: Iterable[MovingObstacle], time: float = 0.0
) -> None:
    """Draw obstacles that stand, and obstacles that move: their paths, and where they are at a time [s]."""
    _draw_solids(axes, obstacles, _OBSTACLE_COLOUR)
    for obstacle in moving:
        style = "<|-|>" if obstacle.back_and_forth else "-|>"
        axes.annotate(
            "", xy=obstacle.end, xytext=obstacle.start,
            arrowprops={"arrowstyle": style, "color": _OBSTACLE_COLOUR, "linewidth": 0.8, "linestyle": "--",
                        "shrinkA": 0.0, "shrinkB": 0.0},
        )  # fmt: skip
        axes.fill(*obstacle.corners(time).T, facecolor=_OBSTACLE_COLOUR, edgecolor="black", linewidth=0.6, alpha=0.8)


def closed(points: FloatArray) -> FloatArray:
    """Return the points with the first repeated at the end."""
    return np.concatenate((points, points[:1]))


def _draw_solids(axes: Axes, solids: Iterable[Obstacle], colour: str) -> None:
    for solid in solids:
        axes.fill(*solid.corners().T, facecolor=colour, edgecolor=colour, linewidth=0.4)


def _shade(axes: Axes, ground: Any) -> None:
    """Draw a ground as the sun in the north-west shades it, five times as high as it is."""
    from matplotlib.colors import LightSource

    (rows, columns), (x, y) = ground.heights.shape, ground.corner
    shade = LightSource(azdeg=315.0, altdeg=45.0).hillshade(ground.heights, 5.0, ground.cell, ground.cell)
    limits = axes.get_xlim(), axes.get_ylim()
    half = 0.5 * ground.cell
    place = (x - half, x + ground.cell * columns - half, y - half, y + ground.cell * rows - half)
    axes.imshow(shade, extent=place, origin="lower", cmap="gray", vmin=-0.4, vmax=1.1, zorder=0.5)
    axes.set(xlim=limits[0], ylim=limits[1])


def _draw_floor(axes: Axes, edges: tuple[FloatArray, ...], colour: str) -> None:
    """Draw the free floor between a left and a right edge, and the islands in it."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path as Outline

    left, right = (edge if enclosed_area(edge) > 0.0 else edge[::-1] for edge in edges[:2])
    walls = [closed(left), closed(right[::-1])]  # against each other: a ring, not two discs
    floor = Outline.make_compound_path(*(Outline(wall, closed=True) for wall in walls))
    axes.add_patch(PathPatch(floor, facecolor=colour, edgecolor="0.25", linewidth=0.8))
    for island in edges[2:]:
        axes.fill(*island.T, facecolor=_WALL_COLOUR, edgecolor="0.25", linewidth=0.8)


def _draw_start(axes: Axes, course: Course, size: float) -> None:
    """Draw an arrow of this size [m] where a course starts: beside a closed one, in an open one at the start itself."""
    x, y, heading = course.start_pose()
    ahead = np.array([math.cos(heading), math.sin(heading)])
    tail = np.array([x, y])
    if course.closed:  # the arrow hides nothing there
        left, right = course.ground_lines[0]
        tail = left + 0.35 * size * (left - right) / math.dist(left, right)
    axes.annotate(
        "", xy=tuple(tail + size * ahead), xytext=tuple(tail), annotation_clip=False,
        arrowprops={"arrowstyle": "-|>", "color": "black", "linewidth": 1.0, "shrinkA": 0.0, "shrinkB": 0.0},
    )  # fmt: skip
