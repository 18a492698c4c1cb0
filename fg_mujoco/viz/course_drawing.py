"""Tracks and scenes from above, as `plots` draws them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from ..course.moving_obstacles import MovingObstacle
from ..course.obstacles import Obstacle
from ..course.scene import Scene
from ..course.track import Track
from ..messages import FloatArray

if TYPE_CHECKING:
    from collections.abc import Iterable

    from matplotlib.axes import Axes

_MARGIN = 0.5  # [m] round the walls
_WALL_COLOUR, _OBSTACLE_COLOUR = "0.45", "#d9732b"
_LINE: dict[str, Any] = {"color": "0.55", "linewidth": 0.6, "linestyle": (0, (6, 4))}
_START_LINE: dict[str, Any] = {"color": "black", "linewidth": 1.6, "solid_capstyle": "butt"}
_GOAL_HALF_WIDTH = 0.3  # [m] of the line that is drawn where a scene's start and goal are


def describe_course(course: Track | Scene) -> str:
    """Return name and size of a track or scene in one line."""
    if isinstance(course, Scene):
        goal = "to a stop" if course.goal_is_to_stop else "to the goal"
        moving = f", {len(course.moving)} moving" if course.moving else ""
        return (
            f"{course.name}: {course.length:.1f} m {goal}, {len(course.obstacles)} obstacles{moving}, "
            f"time limit {course.time_limit:.0f} s"
        )
    width = course.corridor_left + course.corridor_right
    widths = " to ".join(sorted({f"{width.min():.2f}", f"{width.max():.2f}"}, key=float))
    radius = 1.0 / max(float(np.abs(course.curvature).max()), 1e-9)
    return f"{course.name}: {course.length:.1f} m long, {widths} m wide, tightest radius {radius:.2f} m"


def extent(course: Track | Scene) -> FloatArray:
    """Return least and greatest x and y of the picture of a course. Shape (2, 2) [m]."""
    bounds = course.bounds
    if isinstance(course, Track):
        walls = np.concatenate((course.left_wall, course.right_wall))
        bounds = np.stack((walls.min(axis=0), walls.max(axis=0)))
    return np.asarray(bounds + np.array([[-_MARGIN], [_MARGIN]]))


def draw_course(axes: Axes, course: Track | Scene) -> None:
    """Draw the walls, the start line and an arrow in the direction of driving; of a scene its goal line too."""
    (left, bottom), (right, top) = extent(course)
    axes.set(xlim=(left, right), ylim=(bottom, top), aspect="equal", xlabel="x [m]", ylabel="y [m]")
    if isinstance(course, Scene):
        _draw_solids(axes, course.walls, _WALL_COLOUR)
        for s in (0.0, course.length):
            axes.plot(*course.position(s, (-_GOAL_HALF_WIDTH, _GOAL_HALF_WIDTH)).T, **_START_LINE)
    else:
        _draw_corridor(axes, course)
    _draw_start(axes, course, 0.06 * max(right - left, top - bottom))


def draw_line(axes: Axes, course: Track | Scene) -> None:
    """Draw the centreline, or the way of a scene."""
    points = course.way if isinstance(course, Scene) else closed(course.centreline)
    axes.plot(*points.T, **_LINE)


def draw_obstacles(
    axes: Axes, obstacles: Iterable[Obstacle], moving: Iterable[MovingObstacle], time: float = 0.0
) -> None:
    """Draw what stands about, and what moves: its path, and where it is at a time [s]."""
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


def _draw_corridor(axes: Axes, track: Track) -> None:
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path as Outline

    walls = [closed(track.left_wall), closed(track.right_wall[::-1])]  # against each other: a ring, not two discs
    corridor = Outline.make_compound_path(*(Outline(wall, closed=True) for wall in walls))
    axes.add_patch(PathPatch(corridor, facecolor="0.95", edgecolor="0.25", linewidth=0.8))
    for island in track.islands:
        axes.fill(*island.T, facecolor=_WALL_COLOUR, edgecolor="0.25", linewidth=0.8)


def _draw_start(axes: Axes, course: Track | Scene, size: float) -> None:
    """Draw the start line of a track, and beside the start an arrow of this size [m]."""
    x, y, heading = course.start_pose()
    ahead, aside = np.array([math.cos(heading), math.sin(heading)]), np.array([-math.sin(heading), math.cos(heading)])
    tail = np.array([x, y])  # in a scene at the start itself
    if isinstance(course, Track):
        ends = tail + np.outer((course.corridor_left[0], -course.corridor_right[0]), aside)
        axes.plot(*ends.T, **_START_LINE)
        tail = ends[0] + 0.35 * size * aside  # beside the corridor, where it hides nothing
    axes.annotate(
        "", xy=tuple(tail + size * ahead), xytext=tuple(tail), annotation_clip=False,
        arrowprops={"arrowstyle": "-|>", "color": "black", "linewidth": 1.0, "shrinkA": 0.0, "shrinkB": 0.0},
    )  # fmt: skip
