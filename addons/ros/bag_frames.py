"""The frames of a bag: where one is in another, by the transforms that were heard.

A frame may hang on several others at once, as a LiDAR does where the particle filter of F1TENTH says where it is on the
map and the car says where it is on the car. The shortest way from one frame to the other counts. Names are compared
without the leading slash of ROS 1.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from itertools import pairwise
from typing import Any

import numpy as np

from fg_mujoco.messages import FloatArray

BASES = ("base_link", "base_footprint", "chassis", "base")
"""Names of a car's own frame, the first the best; a namespace may stand before them."""
WORLDS = ("map", "odom", "world", "earth", "odom_combined", "optitrack", "vicon")
"""Names of frames that a car moves in."""


def plain(name: str) -> str:
    """Return a frame's name without the leading slash that tf of ROS 1 wrote."""
    return name.lstrip("/")


def is_world(name: str) -> bool:
    """Return whether a frame is one that cars move in, by its name."""
    return plain(name).rsplit("/", 1)[-1] in WORLDS


_OPTICAL = np.array(((0.0, 0.0, 1.0), (-1.0, 0.0, 0.0), (0.0, -1.0, 0.0)))
"""Axes of an optical frame on a camera that looks ahead: x to the right, y down, z ahead. Source: REP 103."""


class FrameTree:
    """Transforms between frames, the last of each."""

    def __init__(self) -> None:
        self._links: dict[str, dict[str, FloatArray]] = {}  # of each frame, its neighbours as seen in it

    def __bool__(self) -> bool:
        return bool(self._links)

    def hear(self, message: Any) -> None:
        """Take the transforms of a tf2_msgs/TFMessage."""
        for entry in message.transforms:
            parent, child = plain(entry.header.frame_id), plain(entry.child_frame_id)
            moved = matrix(entry.transform.translation, entry.transform.rotation)
            if parent != child and np.isfinite(moved).all():
                self._links.setdefault(parent, {})[child] = moved
                self._links.setdefault(child, {})[parent] = inverse(moved)

    def find(self, frame: str, within: str, avoid: Collection[str] = ()) -> FloatArray | None:
        """Return a frame as seen in another, shape (4, 4); None: no transforms lead from one to the other."""
        way = self.way(within, lambda name: name == plain(frame), avoid)
        if way is None:
            return None
        found = np.eye(4)
        for step, following in pairwise(way):
            found = found @ self._links[step][following]
        return found

    def way(self, start: str, is_goal: Any, avoid: Collection[str] = ()) -> list[str] | None:
        """Return the frames of the shortest way from one to one that is a goal; None: there is no way."""
        ways = [[plain(start)]]
        seen = {plain(start)}
        while ways:
            way = ways.pop(0)
            if is_goal(way[-1]):
                return way
            for name in self._links.get(way[-1], {}):
                if name not in seen and name not in avoid:
                    seen.add(name)
                    ways.append([*way, name])
        return None

    def base_of(self, frame: str, stated: str = "") -> str | None:
        """Return the car's own frame that a sensor's frame hangs on, else that of the odometry, `stated`, or None."""
        worlds = {name for name in self._links if is_world(name)}
        for base in BASES:
            way = self.way(frame, lambda name, base=base: name.rsplit("/", 1)[-1] == base, worlds)
            if way is not None:
                return way[-1]
        way = self.way(frame, lambda name: name == plain(stated), worlds) if stated else None
        return None if way is None else way[-1]


def axes_of(frames: FrameTree, sensor: str) -> FloatArray:
    """Return the axes of a sensor's frame on the car, (3, 3), a column each; without transforms, by its name."""
    base = frames.base_of(sensor)
    found = None if base is None else frames.find(sensor, base, WORLDS)
    if found is not None:
        return found[:3, :3]
    return _OPTICAL if plain(sensor).endswith("optical_frame") else np.eye(3)


def matrix(translation: Any, quaternion: Any) -> FloatArray:
    """Return a transform of geometry_msgs, shape (4, 4)."""
    found = np.eye(4)
    found[:3, :3] = rotation(quaternion)
    found[:3, 3] = translation.x, translation.y, translation.z
    return found


def planar(x: float, y: float, heading: float) -> FloatArray:
    """Return a pose on the ground, shape (4, 4)."""
    found = np.eye(4)
    found[:2, :2] = (math.cos(heading), -math.sin(heading)), (math.sin(heading), math.cos(heading))
    found[:2, 3] = x, y
    return found


def inverse(transform: FloatArray) -> FloatArray:
    """Return the inverse of a transform (4, 4)."""
    found = np.eye(4)
    found[:3, :3] = transform[:3, :3].T
    found[:3, 3] = -transform[:3, :3].T @ transform[:3, 3]
    return found


def flat(transform: FloatArray) -> FloatArray:
    """Return x [m], y [m] and heading [rad] of a transform (4, 4)."""
    return np.array((transform[0, 3], transform[1, 3], math.atan2(transform[1, 0], transform[0, 0])))


def rotation(quaternion: Any) -> FloatArray:
    """Return the rotation of a geometry_msgs/Quaternion, shape (3, 3); one of zeros, which nobody filled, is none."""
    length = math.hypot(quaternion.x, quaternion.y, quaternion.z, quaternion.w)
    if length == 0.0:
        return np.eye(3)
    x, y, z, w = np.array((quaternion.x, quaternion.y, quaternion.z, quaternion.w)) / length
    return np.array(
        (
            (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
            (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
            (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
        )
    )
