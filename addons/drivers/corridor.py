"""The ground along which a course leads from a place that the LiDAR sees, and how much room is to both sides.

A walk goes on from a place in the direction of a heading by steps of `STEP`, and keeps its share of the width: a car
in the middle stays in the middle, one that is near to a wall stays near to it. It says where a car will go that follows
the course, which its turn rate does not say before a bend, and how wide the course is there. It ends where nothing is
seen.

What is hidden counts as wall: the jump from one beam to the next is filled with points.
"""

from __future__ import annotations

import math

from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.controllers.control.planner_settings import Record
from fg_mujoco.controllers.control.steering import saturate
from fg_mujoco.controllers.perception.scan_geometry import bearing_of
from fg_mujoco.messages import FloatArray

STEP = 0.25  # [m] of a walk
MOST_POINTS = 768
X, Y, HEADING, LEFT, RIGHT = range(5)  # columns of a walk

_EVERY = 4  # beams
_FARTHEST = 8.0  # [m]
_APART = 0.3  # [m] between the points of a jump
_REACH = 0.3  # [m] along a heading, to which points are to the side of a place
_WIDEST = 3.0  # [m] to a side; what is farther away counts as this far
_NARROWEST = 0.35  # [m] in all, where a walk ends
_CLEAR = 0.25  # [m] between a car's middle and a wall
_FOLLOWS = 0.6  # share of the turn towards its place across, which the heading of a walk takes in a step
_SLOPE = 0.6  # of a step: greatest motion across it


@kernel
def ground_points(geometry: Record, ranges: FloatArray, points: FloatArray) -> int:
    """Write where beams end, ahead and left of the LiDAR, and points between those apart, (k, 2) [m]; return how many.

    `ranges` (n,) [m] are without NaN or inf.
    """
    count, last_x, last_y = 0, math.nan, math.nan
    for beam in range(0, len(ranges), _EVERY):
        bearing, distance = bearing_of(geometry, beam), min(ranges[beam], _FARTHEST)
        x, y = distance * math.cos(bearing), distance * math.sin(bearing)
        jump = math.hypot(x - last_x, y - last_y)
        between = int(jump / _APART) if jump > _APART else 0
        for k in range(1, between + 1):
            if count < len(points):
                share = k / (between + 1.0)
                points[count, 0], points[count, 1] = last_x + share * (x - last_x), last_y + share * (y - last_y)
                count += 1
        if count < len(points):
            points[count, 0], points[count, 1] = x, y
            count += 1
        last_x, last_y = x, y
    return count


@kernel
def room_beside(points: FloatArray, count: int, x: float, y: float, heading: float) -> tuple[float, float]:
    """Return how far it is from a place [m] to what stands to the left and to the right of a heading [rad]."""
    cos, sin = math.cos(heading), math.sin(heading)
    left = right = _WIDEST
    for k in range(count):
        dx, dy = points[k, 0] - x, points[k, 1] - y
        if abs(cos * dx + sin * dy) < _REACH:
            across = cos * dy - sin * dx
            if across >= 0.0:
                left = min(left, across)
            else:
                right = min(right, -across)
    return left, right


@kernel
def walk(points: FloatArray, count: int, x: float, y: float, heading: float, path: FloatArray) -> int:
    """Write a walk from a place (x, y) [m] in the direction of a heading [rad] seen from the LiDAR; return its places.

    `path` (k, 5) gets place, heading, and the room to both sides [m]; the first row is where it begins.
    """
    left, right = room_beside(points, count, x, y, heading)
    share = left / max(left + right, 1e-6)
    path[0, X], path[0, Y], path[0, HEADING], path[0, LEFT], path[0, RIGHT] = x, y, heading, left, right
    for k in range(1, len(path)):
        x += STEP * math.cos(heading)
        y += STEP * math.sin(heading)
        left, right = room_beside(points, count, x, y, heading)
        if left + right < _NARROWEST:
            return k
        wide = left + right
        wanted = min(max(share * wide, min(_CLEAR, 0.5 * wide)), max(wide - _CLEAR, 0.5 * wide))
        across = saturate(left - wanted, _SLOPE * STEP)
        x -= across * math.sin(heading)
        y += across * math.cos(heading)
        heading += _FOLLOWS * math.atan(across / STEP)
        path[k, X], path[k, Y], path[k, HEADING] = x, y, heading
        path[k, LEFT], path[k, RIGHT] = left - across, right + across
    return len(path)
