"""Two back ends that measure along the beams of a LiDAR that is part of a compiled model.

`rangefinder` reads MuJoCo's own sensors, `raycast` draws the scan by a z-buffer (scanline.py): the same beams through
the same world in 3D, the same distances to float64 rounding, some 80 times as fast.

`rangefinder` reads the body poses of `data`, so mj_kinematics (or mj_forward, which has it) must have run at the
present state; mj_step leaves them a step behind. `raycast` needs that only for what hangs on hinges and slides: the
poses of free and mocap bodies, and of what is fixed to them, as a LiDAR to its car, it reads off the state itself.
"""

from __future__ import annotations

import math
from typing import Any, Protocol

import mujoco
import numpy as np

from .. import portable
from ..arguments import Uncopied, explain_class
from ..display import brief
from ..errors import ModelError, SettingsError, accepted_names
from ..messages import FloatArray
from ..native import core
from .beams import Beams, lidar_body, lidar_of
from .body_poses import BodyPoses, Mount, state_arrays
from .visible_surfaces import ScanlineScene, is_scanline

LIDAR_BACKENDS = ("raycast", "rangefinder")
MID360 = "mid360"
"""In place of a back end: `raycast`, and the sensor of this name on car 0."""
LIDARS = (*LIDAR_BACKENDS, MID360)
"""What a race's `lidar` accepts."""


class Lidar(Protocol):
    """Base class of both back ends."""

    @property
    def beams(self) -> Beams:
        """The beams it measures along."""

    def ranges(self, data: Any) -> FloatArray:
        """Return the readings at the present state of `data`, all beams at once, as in LaserScan. Shape (n,) [m]."""


@explain_class
class RangefinderLidar:
    """MuJoCo's own rangefinder sensors. The model must have them: `LidarModel.spec(sensors=True)`.

    The sensors fire by themselves every 25 ms of simulated time. `ranges` has them fire at the present state whatever
    their phase, and leaves the phase, and so the simulation's state, as it was.

    Raises:
      ModelError: no LiDAR under this prefix, not with the beams of its file, or one that stays level.
    """

    def __init__(self, model: Any, prefix: str = "") -> None:
        lidar = lidar_of(model, prefix)
        self.beams = lidar.beams
        self._model = model
        if self.beams.level:
            raise ModelError(f"LiDAR file {lidar.file} stays level, which rangefinders do not; accepted: raycast")
        body = lidar_body(model, prefix)
        rangefinders = np.flatnonzero(model.sensor_type == mujoco.mjtSensor.mjSENS_RANGEFINDER)
        sensors = rangefinders[model.site_bodyid[model.sensor_objid[rangefinders]] == body]
        if len(sensors) != len(self.beams.bearings):
            raise ModelError(
                f"body {prefix + lidar.body!r} has {len(sensors)} rangefinders; accepted: {len(self.beams.bearings)}, "
                "as LidarModel.spec(sensors=True) has them"
            )
        lidar.restore(model, model.sensor_objid[sensors])
        self._readings = model.sensor_adr[sensors]
        self._last_fired = model.sensor_historyadr[sensors]  # a sensor's history starts with the time it last fired

    def __repr__(self) -> str:
        return brief(self, repr(self.beams))

    def ranges(self, data: Any) -> FloatArray:
        """Return the readings at the present state of `data`, all beams at once. Shape (n,) [m]."""
        last_fired = data.history[self._last_fired]
        data.history[self._last_fired] = -math.inf
        mujoco.mj_sensorPos(self._model, data)
        data.history[self._last_fired] = last_fired
        distances = data.sensordata[self._readings]
        distances[distances < 0.0] = math.inf  # MuJoCo says -1 where there is nothing
        return self.beams.readings(distances)


@explain_class
class RaycastLidar(Uncopied):
    """The visible geoms of the model, except those of the car that carries the LiDAR, drawn into a scanline.

    The sites and sensors of the rangefinders need not be in the model: `LidarModel.spec(sensors=False)`. One object
    serves one thread.

    Args:
      prefix: of the LiDAR's names in the model.
      beams: to measure along instead of those of the LiDAR's file.

    Attributes:
      body, mount: id of the LiDAR's body, and how it is fixed to the body of a free joint; None where it is not.
      scene: what its beams can meet, prepared for the scanline z-buffer.
      poses: of the LiDAR's body, and after it of the bodies that move.
      optics: what it makes of what it meets, LidarEffects.optics; none of it at first.

    Raises:
      ModelError: no LiDAR under this prefix, beams that do not leave one point in one plane, or a visible geom of a
        kind that cannot be seen, as a height field.
    """

    def __init__(self, model: Any, prefix: str = "", *, beams: Beams | None = None) -> None:
        self.beams = lidar_of(model, prefix).beams if beams is None else beams
        self.model = model
        self.body = lidar_body(model, prefix)
        if not is_scanline(self.beams):
            said = f"the LiDAR {prefix + lidar_of(model, prefix).body!r} has beams that 'raycast' does not draw"
            raise ModelError(f"{said}; accepted: of one point and plane, evenly spaced, 1e-4 to 1 rad apart")
        self.scene = ScanlineScene(model, self.beams, self.body)
        self.poses = BodyPoses(model, (self.body, *self.scene.moving), level=self.beams.level)
        self.mount = self.poses.mount(0)
        self.optics = np.zeros(2)
        self._scene, self._scratch = core.Scene(*self.scene.arrays), core.Scratch(*self.scene.scratch())

    def __repr__(self) -> str:
        return brief(self, repr(self.beams))

    def ranges(self, data: Any) -> FloatArray:
        """Return the readings at the present state of `data`, all beams at once. Shape (n,) [m]."""
        readings = np.empty(len(self.beams.bearings))
        core.scan_state(self._scene, self._scratch, self.poses.native, *state_arrays(data), self.optics, readings)
        return readings

    def ranges_along(self, bearings: FloatArray, positions: FloatArray, rotations: FloatArray) -> FloatArray:
        """Return readings at even bearings (n,) [rad], bodies at positions (m, 3) [m] and rotations (m, 3, 3)."""
        readings = np.empty(len(bearings))
        step = (bearings[-1] - bearings[0]) / max(len(bearings) - 1, 1)
        limits = np.array((bearings[0], step or self.beams.angle_increment, self.beams.range_min, self.beams.range_max))
        scene = self._scene.along(np.stack((portable.cos(bearings), portable.sin(bearings))), limits)
        core.scan_poses(scene, self._scratch, positions, rotations, self.optics, readings)
        return readings


def lidar_mount(model: Any, prefix: str = "") -> Mount | None:
    """Return the mount of a compiled model's LiDAR of a prefix on the body of a free joint; None where it has none."""
    level = lidar_of(model, prefix).beams.level
    return BodyPoses(model, (lidar_body(model, prefix),), level=level).mount(0)


def make_lidar(backend: str, model: Any, prefix: str = "") -> Lidar:
    """Return the LiDAR that a compiled model holds under a prefix, measured by "raycast" or "rangefinder".

    Raises:
      SettingsError: an unknown back end.
      ModelError: a model that the back end cannot work on.
    """
    if backend == "raycast":
        return RaycastLidar(model, prefix)
    if backend == "rangefinder":
        return RangefinderLidar(model, prefix)
    raise SettingsError(f"lidar is {backend!r}; {accepted_names(backend, LIDAR_BACKENDS)}")
