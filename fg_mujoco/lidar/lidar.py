"""The LiDAR: the beams of models/hokuyo_ust10lx.xml, and two back ends that measure along them.

    lidar = make_lidar("raycast", model)
    mujoco.mj_forward(model, data)
    scan = lidar.beams.to_scan(lidar.ranges(data), stamp=data.time)

`rangefinder` reads MuJoCo's own sensors, `raycast` draws the scan as a picture (fan_caster.py): the same beams through
the same world in 3D, the same distances to float64 rounding, some 80 times as fast (benchmarks/lidar_backends.py).

`rangefinder` reads the body poses of `data`, so mj_kinematics (or mj_forward, which has it) must have run at the
present state; mj_step leaves them a step behind. `raycast` needs that only for what hangs on hinges and slides: the
poses of free and mocap bodies, and of what is fixed to them, as a LiDAR to its car, it reads off the state itself.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from importlib.resources import files
from typing import Any, Protocol

import mujoco
import numpy as np

from ..errors import ModelError, SettingsError
from ..kernels import kernel
from ..messages import FloatArray, LaserScan, ScanGeometry, read_only
from .body_poses import BodyPoses, PoseArrays, StateArrays, read_poses, state_arrays
from .embree_rays import RayScene
from .scanline import scan
from .visible_surfaces import Fan, FanScene, Scratch, is_fan

LIDAR_BODY = "hokuyo"
LIDAR_BACKENDS = ("raycast", "rangefinder")
NO_RETURN_READINGS = ("inf", "range_max")

_TEXT_ROUNDING = 1e-5  # MJCF text keeps six digits: 2.5e-6 rad of a beam's direction


@dataclass(frozen=True, kw_only=True, eq=False)
class Beams:
    """The beams of a LiDAR, rightmost first, in the frame of its body: x ahead, y left, z up. Arrays are read-only."""

    directions: FloatArray  # (n, 3) unit vectors
    origins: FloatArray  # (n, 3) [m]
    bearings: FloatArray  # (n,) [rad] from straight ahead, left positive
    angle_min: float  # [rad]
    angle_max: float  # [rad]
    angle_increment: float  # [rad]
    range_min: float  # [m]
    range_max: float  # [m]
    period: float  # [s] from one sweep to the next
    time_increment: float  # [s] from one beam to the next

    def __post_init__(self) -> None:
        for name in ("directions", "origins", "bearings"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    def readings(self, distances: FloatArray) -> FloatArray:
        """Return what the LiDAR reads at `distances` (n,) [m]: +inf from `range_max` on, -inf below `range_min`.

        Source: REP 117.
        """
        readings = np.where(distances < self.range_max, distances, math.inf)
        readings[distances < self.range_min] = -math.inf
        return readings

    @cached_property
    def geometry(self) -> ScanGeometry:
        """What all scans along these beams have in common."""
        return ScanGeometry(
            angle_min=self.angle_min,
            angle_max=self.angle_max,
            angle_increment=self.angle_increment,
            range_min=self.range_min,
            range_max=self.range_max,
            scan_time=self.period,
            bearings=self.to_scan(np.zeros(len(self.bearings)), 0.0).bearings,
        )

    def to_scan(self, ranges: FloatArray, stamp: float, *, no_return: str = "inf", swept: bool = False) -> LaserScan:
        """Return the scan message of one sweep.

        Args:
          ranges: readings (n,) [m].
          stamp: time of the last beam [s].
          no_return: what a beam without a return reads, "inf" or "range_max".
          swept: the beams were taken one after the other, not all at `stamp`.

        Raises:
          SettingsError: an unknown `no_return`.
        """
        if no_return not in NO_RETURN_READINGS:
            raise SettingsError(f"no_return is {no_return!r}; accepted: {', '.join(NO_RETURN_READINGS)}")
        if no_return == "range_max":
            ranges = np.where(ranges == math.inf, self.range_max, ranges)
        return LaserScan(
            stamp=stamp,
            angle_min=self.angle_min,
            angle_max=self.angle_max,
            angle_increment=self.angle_increment,
            range_min=self.range_min,
            range_max=self.range_max,
            ranges=ranges,
            time_increment=self.time_increment if swept else 0.0,
            scan_time=self.period,
            no_return=math.inf if no_return == "inf" else self.range_max,
        )


class Lidar(Protocol):
    """What both back ends are."""

    @property
    def beams(self) -> Beams:
        """The beams it measures along."""

    def ranges(self, data: Any) -> FloatArray:
        """Return the readings at the present state of `data`, all beams at once, as in LaserScan. Shape (n,) [m]."""


def lidar_spec(*, sensors: bool = True) -> Any:
    """Return the LiDAR as a mujoco.MjSpec to attach to a car.

    Args:
      sensors: with MuJoCo's sensors and their sites, as `rangefinder` needs. `raycast` needs none, and 1081 sites
        cost 100 us a physics step.
    """
    spec = _parsed_spec().copy()
    if not sensors:
        spec.delete(spec.frame("beams"))  # the sensors go with their sites
    return spec


@lru_cache(maxsize=1)
def _parsed_spec() -> Any:
    return mujoco.MjSpec.from_string(files("fg_mujoco.models").joinpath("hokuyo_ust10lx.xml").read_text("utf-8"))


@lru_cache(maxsize=1)
def _lidar_model() -> Any:
    return lidar_spec().compile()


@lru_cache(maxsize=1)
def load_beams() -> Beams:
    """Return the beams of models/hokuyo_ust10lx.xml, read off the compiled model."""
    model = _lidar_model()
    directions = np.empty((model.nsensor, 3))
    for direction, site in zip(directions, model.sensor_objid, strict=True):
        mujoco.mju_rotVecQuat(direction, np.array([0.0, 0.0, 1.0]), model.site_quat[site])
    bearings = np.arctan2(directions[:, 1], directions[:, 0])
    increment = float(bearings[-1] - bearings[0]) / (model.nsensor - 1)
    period = float(model.sensor_interval[0, 0])
    return Beams(
        directions=directions,
        origins=model.site_pos[model.sensor_objid],
        bearings=bearings,
        angle_min=float(bearings[0]),
        angle_max=float(bearings[-1]),
        angle_increment=increment,
        range_min=float(model.numeric("range_min").data[0]),
        range_max=float(model.sensor_cutoff[0]),
        period=period,
        time_increment=period * increment / math.tau,  # the mirror turns once in a period
    )


class RangefinderLidar:
    """MuJoCo's own rangefinder sensors. The model must have them: `lidar_spec(sensors=True)`.

    The sensors fire by themselves every 25 ms of simulated time, give or take a step (the engine compares rounded
    sums of timesteps). `ranges` has them fire at the present state whatever their phase, and leaves the phase, and so
    the simulation's state, as it was.

    Raises:
      ModelError: no LiDAR under this prefix, or not with the beams of models/hokuyo_ust10lx.xml.
    """

    def __init__(self, model: Any, prefix: str = "") -> None:
        self.beams = load_beams()
        self._model = model
        body = _lidar_body(model, prefix)
        rangefinders = np.flatnonzero(model.sensor_type == mujoco.mjtSensor.mjSENS_RANGEFINDER)
        sensors = rangefinders[model.site_bodyid[model.sensor_objid[rangefinders]] == body]
        if len(sensors) != len(self.beams.bearings):
            raise ModelError(
                f"body {prefix + LIDAR_BODY!r} has {len(sensors)} rangefinders; accepted: {len(self.beams.bearings)}, "
                "as lidar_spec(sensors=True) attaches them"
            )
        _restore_beams(model, model.sensor_objid[sensors])
        self._readings = model.sensor_adr[sensors]
        self._last_fired = model.sensor_historyadr[sensors]  # a sensor's history starts with the time it last fired

    def ranges(self, data: Any) -> FloatArray:
        """Return the readings at the present state of `data`, all beams at once. Shape (n,) [m]."""
        last_fired = data.history[self._last_fired]
        data.history[self._last_fired] = -math.inf
        mujoco.mj_sensorPos(self._model, data)
        data.history[self._last_fired] = last_fired
        distances = data.sensordata[self._readings]
        distances[distances < 0.0] = math.inf  # MuJoCo says -1 where there is nothing
        return self.beams.readings(distances)


class RaycastLidar:
    """The visible geoms of the model, except those of the car that carries the LiDAR, drawn into the beams.

    That takes beams that leave one point in one plane, as those of models/hokuyo_ust10lx.xml. Any others, and the
    beams of a LiDAR that moves during its sweep, are cast as single rays by Embree. The sites and sensors of the
    rangefinders need not be in the model: `lidar_spec(sensors=False)`. One object serves one thread.

    Attributes:
      beams: the Beams.
      model: the compiled mujoco.MjModel.
      body: id of the LiDAR's body.
      mount: how the LiDAR is fixed to the body of a free joint; None where it is not.

    Raises:
      ModelError: no LiDAR under this prefix, or a visible geom that is neither mesh, box nor plane.
    """

    def __init__(self, model: Any, prefix: str = "") -> None:
        self.beams = load_beams()
        self.model = model
        self.body = _lidar_body(model, prefix)
        self.scene = FanScene(model, self.beams, self.body)
        self._poses = BodyPoses(model, (self.body, *self.scene.moving))
        self.mount = self._poses.mount(0)
        self._is_fan = is_fan(self.beams)
        self._fan, self._scratch = tuple(self.scene.arrays), tuple(self.scene.scratch())

    def ranges(self, data: Any) -> FloatArray:
        """Return the readings at the present state of `data`, all beams at once. Shape (n,) [m]."""
        if self._is_fan:
            readings = np.empty(len(self.beams.bearings))
            _scan_state(self._fan, self._poses.arrays, state_arrays(data), self._scratch, readings)
            return readings
        self._poses.read(data)
        position, to_body = self._poses.positions[0], self._poses.rotations[0].T
        return self.cast(data, position + self.beams.origins @ to_body, self.beams.directions @ to_body)

    def cast(self, data: Any, origins: FloatArray, directions: FloatArray) -> FloatArray:
        """Return the readings along any rays. Shape (n,) [m].

        Args:
          data: where the moving geoms are.
          origins: (n, 3) [m], world frame.
          directions: (n, 3) unit vectors, world frame.
        """
        return self.beams.readings(self._rays.distances(data, origins, directions))

    @cached_property
    def _rays(self) -> RayScene:
        return RayScene(self.model, carrier=self.body, reach=self.beams.range_max)


@kernel
def _scan_state(
    fan: tuple[Any, ...], poses: PoseArrays, state: StateArrays, scratch: tuple[Any, ...], out: FloatArray
) -> None:
    """Write the readings at a state. Plain tuples: numba takes named ones over from Python at twice the cost."""
    read_poses(poses, state)
    positions, rotations = poses[3], poses[4]
    scan(Fan(*fan), positions[0], rotations[0], positions[1:], rotations[1:], Scratch(*scratch), out)


def make_lidar(backend: str, model: Any, prefix: str = "") -> Lidar:
    """Return the LiDAR on body `prefix` + "hokuyo" of a compiled model, measured by "raycast" or "rangefinder".

    Raises:
      SettingsError: an unknown back end.
      ModelError: a model that the back end cannot work on.
    """
    if backend == "raycast":
        return RaycastLidar(model, prefix)
    if backend == "rangefinder":
        return RangefinderLidar(model, prefix)
    raise SettingsError(f"LiDAR back end {backend!r}; accepted: {', '.join(LIDAR_BACKENDS)}")


def _lidar_body(model: Any, prefix: str) -> int:
    body: int = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, prefix + LIDAR_BODY)
    if body < 0:
        raise ModelError(f"the model has no body {prefix + LIDAR_BODY!r}; attach lidar_spec() to it with that prefix")
    return body


def _restore_beams(model: Any, sites: Any) -> None:
    """Give the sites of a model that went through MJCF text the digits that the text dropped."""
    lidar = _lidar_model()
    for name in ("site_pos", "site_quat"):
        present, exact = getattr(model, name), getattr(lidar, name)[lidar.sensor_objid]
        if np.abs(present[sites] - exact).max() > _TEXT_ROUNDING:
            raise ModelError(f"{name} of the rangefinders is not that of models/hokuyo_ust10lx.xml")
        present[sites] = exact
