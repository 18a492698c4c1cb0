"""Markers, paths and poses that nodes publish: as drawings for the live view and the debug page.

Markers are kept as RViz keeps them: by topic, namespace and id, until they are deleted or their lifetime is over.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fg_mujoco.messages import FloatArray, Sketch

from ..bag_messages import MAP_FRAME
from .graph import NANOSECONDS, Graph
from .transform_modules import TransformException, lookup, matrix

_ADD, _DELETE_ALL = 0, 3  # visualization_msgs/Marker.action; 2 is DELETE
_ARROW, _LINE_STRIP, _LINE_LIST, _TRIANGLES = 0, 4, 5, 11  # .type
_OWN = (60, 200, 90)  # colour of what has none, as of the planner's goal
_POINT, _LINE = 0.12, 0.03  # [m] size of what has none
_NO_ROTATION = (0.0, 0.0, 0.0, 1.0)

_SHAPES = {
    "visualization_msgs/Marker", "visualization_msgs/MarkerArray", "nav_msgs/Path", "geometry_msgs/PoseArray",
    "geometry_msgs/PointStamped", "geometry_msgs/PoseStamped",
}  # fmt: skip


class Drawings:
    """The markers, paths and poses that nodes publish, in the frames of their graph."""

    def __init__(self, graph: Graph) -> None:
        self._graph = graph
        self._kept: dict[tuple[Any, ...], tuple[Sketch, int | None]] = {}  # with the time [ns] at which it is over

    def take(self, topic: str, message: Any, time: int) -> None:
        """Take what has been published at a time [ns]."""
        kind = getattr(message, "_type", "")
        if kind not in _SHAPES:
            return
        if kind == "visualization_msgs/MarkerArray":
            for marker in message.markers:
                self._take_marker(topic, marker, time)
        elif kind == "visualization_msgs/Marker":
            self._take_marker(topic, message, time)
        else:
            poses = message.poses if "poses" in message._makers else [message]
            points = np.array([_place(pose) for pose in poses]).reshape(-1, 3)
            joined = kind == "nav_msgs/Path" and len(points) > 1
            self._keep((topic,), message.header.frame_id, _pieces(points) if joined else points, _OWN,
                       _LINE if joined else _POINT, None)  # fmt: skip

    def now(self) -> list[Sketch]:
        """Return the drawings of now."""
        return [sketch for sketch, over in self._kept.values() if over is None or over > self._graph.now]

    def _take_marker(self, topic: str, marker: Any, time: int) -> None:
        key = topic, marker.ns, marker.id
        if marker.action != _ADD:
            gone = [each for each in self._kept if each == key or (marker.action == _DELETE_ALL and each[0] == topic)]
            for each in gone:
                del self._kept[each]
            return
        pose, scale, colour = marker.pose, marker.scale, marker.color
        o = pose.orientation
        turn = (o.x, o.y, o.z, o.w) if any((o.x, o.y, o.z, o.w)) else _NO_ROTATION
        own = matrix((pose.position.x, pose.position.y, pose.position.z), turn)
        points: FloatArray = np.array([(point.x, point.y, point.z) for point in marker.points]).reshape(-1, 3)
        size = float(scale.x)
        if marker.type == _ARROW:
            if len(points) < 2:
                points = np.array([(0.0, 0.0, 0.0), (scale.x, 0.0, 0.0)])
                size = float(scale.y)
            points = _pieces(points[:2])
        elif marker.type == _LINE_STRIP:
            points = _pieces(points)
        elif marker.type == _LINE_LIST:
            points = points[: len(points) // 2 * 2].reshape(-1, 2, 3)
        elif marker.type == _TRIANGLES:
            corners = points[: len(points) // 3 * 3].reshape(-1, 3, 3)
            points = np.stack((corners, np.roll(corners, 1, axis=1)), axis=2).reshape(-1, 2, 3)
        elif not len(points):
            points = np.zeros((1, 3))
        rgb = marker.colors[0] if marker.colors and not colour.a else colour
        red, green, blue = (int(np.clip(round(255 * part), 0, 255)) for part in (rgb.r, rgb.g, rgb.b))
        lasts = marker.lifetime
        nanoseconds = lasts.sec * NANOSECONDS + lasts.nanosec
        least = _LINE if points.ndim == 3 else _POINT
        self._keep(key, marker.header.frame_id, _moved(own, points), (red, green, blue), size or least,
                   time + nanoseconds if nanoseconds > 0 else None)  # fmt: skip

    def _keep(
        self,
        key: tuple[Any, ...],
        frame: str,
        points: FloatArray,
        colour: tuple[int, int, int],
        size: float,
        over: int | None,
    ) -> None:
        self._kept.pop(key, None)
        if not points.size or not np.isfinite(points).all():
            return
        if frame.strip("/") not in ("", MAP_FRAME):
            try:
                points = _moved(lookup(self._graph, MAP_FRAME, frame), points)
            except TransformException:
                return
        self._kept[key] = Sketch(points=points, colour=colour, size=size, name=key[0]), over


def _place(found: Any) -> tuple[float, float, float]:
    """Return the position of a Pose, PoseStamped or PointStamped."""
    while "pose" in found._makers:
        found = found.pose
    point = found.position if "position" in found._makers else found.point
    return point.x, point.y, point.z


def _pieces(points: FloatArray) -> FloatArray:
    """Return the pieces (k - 1, 2, 3) of a line through points (k, 3)."""
    return np.stack((points[:-1], points[1:]), axis=1)


def _moved(by: FloatArray, points: FloatArray) -> FloatArray:
    return np.asarray(points @ by[:3, :3].T + by[:3, 3])
