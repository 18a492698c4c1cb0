"""The points of a Livox MID-360: a pattern that does not repeat, cast in bursts from where the LiDAR is at each.

Four lines measure in turn, 5 us apart, and turn 50 times a second. A line goes up and down over the field of view in
6473 of its steps, a turn has 1000: so a direction comes again after 129 s. The four are a quarter of that way apart,
and four turns go .618 of it, the golden ratio's share, which fills the gaps between arcs most evenly. The pattern of a
real one has another form, with the same rates, field of view and number of lines.

A burst of 500 points, 2.5 ms, is measured at one moment, in its middle: the car moves on from burst to burst.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from importlib.resources import files
from typing import Any, NamedTuple
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from .. import portable
from ..arguments import Uncopied
from ..course.moving_obstacles import moving_obstacles
from ..errors import ModelError
from ..messages import FloatArray, read_only
from ..native import core
from .body_poses import Mount, make_links
from .clusters import make_vertex_clusters
from .lidar import lidar_mount
from .visible_surfaces import assembled, surfaces_of

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
    ranges: FloatArray  # (4,) share of light that a surface reflects, and how far it is seen [m], of two
    range_noise_std: float  # [m]
    angle_noise_std: float  # [deg]
    intensity: float  # of a surface that reflects all light

    @classmethod
    @lru_cache
    def load(cls) -> Sheet:
        """Return it."""
        text = (files("fg_mujoco.models") / "livox_mid360.xml").read_text("utf-8")
        data = {str(each.get("name")): str(each.get("data")) for each in ElementTree.fromstring(text).iter("numeric")}
        found = [read_only(np.array(data[name].split(), np.float64)) for name in cls._fields]
        return cls._make(values if len(values) > 1 else float(values[0]) for values in found)


@lru_cache
def _pattern() -> tuple[FloatArray, FloatArray]:
    """Return cosines and sines of all bearings (2, 512), then tangents and secants of a line's elevations, by step."""
    steps = np.minimum(np.arange(_ROOM), COLUMNS - 1)
    bearings = (steps + np.arange(LINES)[:, None] / LINES - 0.5 * COLUMNS).ravel() * (math.tau / (_SECTORS * COLUMNS))
    low, high = np.radians(Sheet.load().elevations)
    phases = np.arange(CYCLE + _ROOM) % CYCLE + 0.25  # so that no elevation on the way down is one on the way up
    way = 1.0 - np.abs(2.0 * phases / CYCLE - 1.0)
    elevations = low + (high - low) * way
    cosines, tangents = portable.cos(bearings), portable.tan(elevations)
    return np.stack((cosines, portable.sin(bearings))), np.stack((tangents, 1.0 / portable.cos(elevations)))


class _Scene(NamedTuple):
    """The visible surfaces of a model, all cars included, once for all its cars."""

    native: Any
    materials: FloatArray  # (m, 2) as of materials_of
    moving: Sequence[Any]  # the moving obstacles, whose bodies are the first that move
    links: Any  # those that the poses of the other bodies that move follow from, as LINK

    @classmethod
    @lru_cache(maxsize=16)
    def of(cls, model: Any) -> _Scene:
        """Return that of a model."""
        which, materials = materials_of(model)
        surfaces, moving = surfaces_of(model, None, which), moving_obstacles(model)
        limits = (0.0, 1.0, Sheet.load().range_min, float(materials[:, 1].max()))  # the first two are those of a scan
        arrays = assembled(model, surfaces, make_vertex_clusters, _pattern()[0], limits)
        links = make_links(model, tuple(part.body for part in surfaces[1 + len(moving) :]))
        return cls(core.Scene(*arrays), materials, moving, links)


class PointCaster(Uncopied):
    """Casts the points of a MID-360 on the car whose LiDAR a compiled model holds under a prefix.

    Raises:
      ModelError: no LiDAR on the body of a free joint, or a visible geom of a kind that cannot be seen.
    """

    def __init__(self, model: Any, prefix: str) -> None:
        mount = lidar_mount(model, prefix)
        if mount is None:
            raise ModelError(f"the LiDAR {prefix!r} is on no body of a free joint, as a MID-360's must be")
        self.mount = mount_of(mount)
        joint = int(np.flatnonzero(model.jnt_qposadr == mount.qpos_address)[0])
        self._tree = int(model.body_rootid[model.jnt_bodyid[joint]])
        self._scene = _Scene.of(model)

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
            self._scene.native, _pattern()[1], self._scene.materials, self.mount.qpos_address,
            self.mount.offset_position, self.mount.offset_rotation, self._tree, self._scene.links, before, after,
            shares, placed, first, out,
        )  # fmt: skip
        return out


def materials_of(model: Any) -> tuple[FloatArray, FloatArray]:
    """Return the material of each geom (geoms,), and of each material intensity of a return and reach [m] (m, 2).

    The reach is a power of the share of light that it reflects, through those of the data sheet.
    """
    sheet = Sheet.load()
    shares, which = np.unique(np.round(_reflected(model), 3), return_inverse=True)
    dark, near, bright, far = sheet.ranges.tolist()
    power = math.log(far / near) / math.log(bright / dark)
    reach = [far * math.pow(share / bright, power) for share in shares.tolist()]
    return which.astype(np.float64), np.column_stack((sheet.intensity * shares, reach))


def _reflected(model: Any) -> FloatArray:
    """Return the share of light that each geom reflects (geoms,): the mean of its colours, or of its texture's."""
    colours = model.geom_rgba[:, :3].astype(np.float64)
    for geom in np.flatnonzero(model.geom_matid >= 0):
        material = model.geom_matid[geom]
        colours[geom] = model.mat_rgba[material, :3]
        for texture in model.mat_texid[material][model.mat_texid[material] >= 0]:
            start = model.tex_adr[texture]
            size = model.tex_height[texture] * model.tex_width[texture] * model.tex_nchannel[texture]
            colours[geom] *= model.tex_data[start : start + size].mean() / 255.0
    shares: FloatArray = colours.mean(axis=1)
    return shares


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
    for name, column in zip(("x", "y", "z", "intensity"), np.reshape(values, (POINTS, 4)).T, strict=True):
        points[name] = column
    points["line"] = np.arange(POINTS) % LINES
    burst = np.arange(POINTS) // (LINES * COLUMNS)
    points["timestamp"] = end + 1e9 * FRAME * ((burst + 0.5) / BURSTS - 1.0)
    return points
