"""Lines through a map and how fast they can be driven: what a planner with a map follows.

Lines are read as centrelines of courses are, by the names of their columns (fg_mujoco.course.line_file).
What is compiled is in native/addons/drivers/line_profile.cpp.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from fg_mujoco.controllers.safety.friction_limiter import FrictionLimiter
from fg_mujoco.course.line_file import read_line_file
from fg_mujoco.errors import SettingsError, TrackError
from fg_mujoco.messages import FloatArray
from fg_mujoco.native import core

SPACING = 0.1  # [m] of the points of a table, about
X, Y, SPEED, STEP, RIGHT, LEFT = range(6)
"""Columns of a table: the place [m], the speed there [m/s], how far it is to the next point [m] (0: the end), and how
far the car may be beside it, from (negative, to the right) and to [m]."""

ROOM: float = core.LINE_ROOM
"""[m] Greatest room to either side, and all that is known where there are no walls."""

_REPEATED = 1e-3  # [m] points nearer than this are one
_FURTHEST = 1e6  # [m], as of tracks
_LONGEST = 30_000.0  # [m], as of tracks


def read_line(path: str | Path) -> tuple[FloatArray, FloatArray]:
    """Return the points (n, 2) [m] of a file and the speeds there (n,) [m/s], inf where it has none; SettingsError."""
    try:
        file = read_line_file(path, course=False).note()
    except TrackError as error:
        raise SettingsError(f"line {error}") from error
    points, speeds = file.points, file.values.get("speed", np.full(len(file.points), math.inf))
    if len(points) < 2:
        raise SettingsError(f"line {path}: {len(points)} points; accepted: at least 2")
    length = float(np.hypot(*np.diff(points, axis=0).T).sum())
    if length > _LONGEST or np.abs(points).max() > _FURTHEST:
        raise SettingsError(
            f"line {path}: is {length:.0f} m long and up to {np.abs(points).max():.0f} m from the origin; accepted: "
            f"{_LONGEST:.0f} m and {_FURTHEST:.0e} m at most"
        )
    return points, speeds


def is_counterclockwise(points: FloatArray) -> bool:
    """Return whether a closed line (n, 2) is driven counterclockwise: by the sign of the area that it encloses."""
    x, y = (points - points[0]).T
    return bool(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y) > 0.0)


def line_table(
    points: FloatArray,
    speeds: FloatArray,
    *,
    closed: bool,
    limiter: FrictionLimiter | None,
    max_speed: float,
    curvature_span: float,
    cornering_use: float,
    braking_use: float,
) -> FloatArray:
    """Return a line for a planner: points about SPACING apart, with the speed at each. Shape (m, 6), columns as above.

    `points` (n, 2) [m] are in driving order, `speeds` (n,) [m/s] and `max_speed` [m/s] are greatest ones. The last
    point of a closed line leads to the first, and is dropped where it repeats it; else the car stops there.
    `curvature_span` [m] is to either side of a point, and the uses are shares of the limiter's cornering, and braking
    and accelerating. How far the car may be beside the line is ROOM. Raises SettingsError: a line without length.
    """
    if closed:
        points, speeds = np.vstack((points, points[:1])), np.append(speeds, speeds[0])
    steps = np.hypot(*np.diff(points, axis=0).T)
    kept = np.append(True, steps > _REPEATED)
    points, speeds, steps = points[kept], speeds[kept], steps[kept[1:]]
    length = float(steps.sum())
    if not length > 0.0:
        raise SettingsError(f"a line of length {length} m; accepted: points that are apart")
    along = np.concatenate(([0.0], np.cumsum(steps)))
    count = max(math.ceil(length / SPACING), 2)
    places = np.linspace(0.0, length, count + 1)[: count if closed else count + 1]
    table = np.zeros((len(places), 6))
    table[:, RIGHT], table[:, LEFT] = -ROOM, ROOM
    table[:, X], table[:, Y] = np.interp(places, along, points[:, 0]), np.interp(places, along, points[:, 1])
    table[:, STEP] = length / count
    if not closed:
        table[-1, STEP] = 0.0
    table[:, SPEED] = np.minimum(np.interp(places, along, np.minimum(speeds, max_speed)), max_speed)
    if limiter is not None:
        limit_speeds(table, curvature(table, curvature_span, closed), limiter.record[0], cornering_use, braking_use)
    return table


def curvature(table: FloatArray, span: float, closed: bool) -> FloatArray:
    """Return the curvature at each point: of the circle through it and those `span` [m] before and behind. (n,) [1/m].

    The span is that over which the car rounds off the line: at a square corner nobody drives the corner.
    """
    count = len(table)
    apart = max(min(round(span / table[0, STEP]), (count - 1) // 2), 1)
    here = np.arange(count)
    before, after = here - apart, here + apart
    if closed:
        before, after = before % count, after % count
    else:
        before, after = np.maximum(before, 0), np.minimum(after, count - 1)
    a, b, c = table[before, :2], table[:, :2], table[after, :2]
    u, v, w = b - a, c - b, c - a
    sides = np.hypot(*u.T) * np.hypot(*v.T) * np.hypot(*w.T)
    area = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    return np.asarray(np.divide(2.0 * area, sides, out=np.zeros(count), where=sides > 0.0))


limit_speeds = core.limit_speeds
"""Lower the speeds of a table to what the tires hold: cornering together with braking and accelerating.

By a pass against the driving direction and one along it, twice round a closed line; at the end of an open one the car
stands. Braking and accelerating have what cornering leaves (friction_limiter.longitudinal_share). Source: the field's
forward-backward solver, as in TUM's trajectory planning helpers (A. Heilmeier et al., 2019).

Args:
  table: (n, 6), written to.
  bend: curvature at each point (n,) [1/m].
  limiter: of type LIMITER.
  cornering_use: share of the cornering that it allows.
  braking_use: the same of braking, and of accelerating.
"""
