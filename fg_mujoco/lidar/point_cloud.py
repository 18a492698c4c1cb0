"""The points of a Livox MID-360: a pattern that does not repeat, cast in bursts from where the LiDAR is at each.

Four lines measure in turn, 5 us apart, and turn 50 times a second. A line goes up and down over the field of view in
6473 of its steps, a turn has 1000: so a direction comes again after 129 s. The four are a quarter of that way apart,
and four turns go .618 of it, the golden ratio's share, which fills the gaps between arcs most evenly. The pattern of a
real one has another form, with the same rates, field of view and number of lines.

A burst of 500 points, 2.5 ms, is measured at one moment, in its middle: the car moves on from burst to burst.
"""

from __future__ import annotations

import math
from functools import lru_cache
from importlib.resources import files
from typing import Any, NamedTuple
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from .. import portable
from ..arguments import Uncopied
from ..errors import ModelError
from ..messages import FloatArray, read_only
from ..native import core
from .body_poses import Mount
from .cloud_scene import CloudScene
from .lidar import lidar_mount

LINES, COLUMNS, BURSTS = 4, 125, 40
"""Lines; steps of each in a burst; bursts in a frame."""

POINTS = LINES * COLUMNS * BURSTS
"""Of a frame."""

FRAME = 0.1
"""[s] of a frame, and from one to the next."""

CYCLE = 6473
"""Steps of a line from one lowest elevation to the next."""

POINT = np.dtype(
    {
        "names": ["x", "y", "z", "intensity", "tag", "line", "timestamp"],
        "formats": ["<f4", "<f4", "<f4", "<f4", "u1", "u1", "<f8"],
        "offsets": [0, 4, 8, 12, 16, 17, 18],
        "itemsize": 26,
    }
)
"""A point as livox_ros_driver2 has it: [m], 0 to 255, returns, line from 0, [ns] (src/comm/comm.h)."""

_SECTORS, _ROOM = 8, 128  # as in native/lidar/point_cloud.hpp


class Sheet(NamedTuple):
    """What models/livox_mid360.xml says."""

    mount: FloatArray  # (3,) [m] from the vehicle's LiDAR, in its axes
    elevations: FloatArray  # (2,) [deg]
    range_min: float  # [m]
    ranges: FloatArray  # (4,) as of CloudScene
    range_noise_std: float  # [m]
    angle_noise_std: float  # [deg]
    intensity: float

    @classmethod
    @lru_cache
    def load(cls) -> Sheet:
        """Return it."""
        text = (files("fg_mujoco.models") / "livox_mid360.xml").read_text("utf-8")
        data = {str(each.get("name")): str(each.get("data")) for each in ElementTree.fromstring(text).iter("numeric")}
        found = [read_only(np.array(data[name].split(), np.float64)) for name in cls._fields]
        return cls._make(values if len(values) > 1 else float(values[0]) for values in found)


@lru_cache
def _pattern() -> Any:
    """Return the directions of all points for the native core."""
    steps = np.minimum(np.arange(_ROOM), COLUMNS - 1)
    columns = (steps + np.arange(LINES)[:, None] / LINES - 0.5 * COLUMNS) * (math.tau / (_SECTORS * COLUMNS))
    low, high = np.radians(Sheet.load().elevations)
    phases = np.arange(CYCLE + _ROOM) % CYCLE + 0.25  # so that no elevation on the way down is one on the way up
    way = 1.0 - np.abs(2.0 * phases / CYCLE - 1.0)
    elevations = low + (high - low) * way
    return core.Pattern(
        np.concatenate((portable.cos(columns), portable.sin(columns))),
        np.stack((portable.tan(elevations), 1.0 / portable.cos(elevations))), CYCLE, Sheet.load().range_min,
    )  # fmt: skip


@lru_cache(maxsize=16)
def _scene(model: Any) -> CloudScene:
    """Return the surfaces of a model, once for all its cars."""
    own = Sheet.load()
    return CloudScene(model, own.ranges, own.intensity)


class PointCaster(Uncopied):
    """Casts the points of a MID-360 on the car whose LiDAR a compiled model holds under a prefix.

    Raises:
      ModelError: no LiDAR on the body of a free joint, or as of CloudScene.
    """

    def __init__(self, model: Any, prefix: str) -> None:
        mount = lidar_mount(model, prefix)
        if mount is None:
            raise ModelError(f"the LiDAR {prefix!r} is on no body of a free joint, as a MID-360's must be")
        self.mount = mount_of(mount)
        joint = int(np.flatnonzero(model.jnt_qposadr == mount.qpos_address)[0])
        self._tree = int(model.body_rootid[model.jnt_bodyid[joint]])
        self._scene = _scene(model)

    def cast(
        self, before: FloatArray, after: FloatArray, shares: FloatArray, times: FloatArray, first: int,
        out: FloatArray | None = None,
    ) -> FloatArray:  # fmt: skip
        """Return the points of bursts (b, 500, 4): x, y, z [m] in the LiDAR's frame, intensity; zeros: no return.

        Args:
          before, after: qpos of the world, between which all moves evenly.
          shares, times: (b,) where between them each burst is measured, and when [s] since the start.
          first: number of the first burst.
          out: to write them to; None: a new array.
        """
        placed = np.zeros((len(shares), len(self._scene.moving), 3))
        for row, time in zip(placed, times.tolist(), strict=True):
            for each, obstacle in zip(row, self._scene.moving, strict=True):
                each[:2] = obstacle.position(time)
        out = np.empty((len(shares), LINES * COLUMNS, 4)) if out is None else out
        core.cast_bursts(
            self._scene.native, _pattern(), self.mount.qpos_address, self.mount.offset_position,
            self.mount.offset_rotation, self._tree, self._scene.links, before, after, shares, placed, first, out,
        )  # fmt: skip
        return out


def mount_of(lidar: Mount) -> Mount:
    """Return the mount of a MID-360 above a vehicle's LiDAR."""
    place = lidar.offset_position + lidar.offset_rotation @ Sheet.load().mount
    return lidar._replace(offset_position=place)


def point_cloud(values: FloatArray, end: float) -> NDArray[np.void]:
    """Return the points of a frame as POINT rows.

    Args:
      values: (POINTS, 4) or as many numbers in a row: x, y, z [m], intensity.
      end: of the frame [ns]; the time of a point is that of its burst.
    """
    points = np.zeros(POINTS, POINT)
    for name, column in zip("xyz", np.reshape(values, (POINTS, 4)).T[:3], strict=True):
        points[name] = column
    points["intensity"] = np.reshape(values, (POINTS, 4))[:, 3]
    points["line"] = np.arange(POINTS) % LINES
    burst = np.arange(POINTS) // (LINES * COLUMNS)
    points["timestamp"] = end + 1e9 * FRAME * ((burst + 0.5) / BURSTS - 1.0)
    return points
