"""A LiDAR as its MJCF describes it: the body that carries it, and the beams that leave it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from .. import portable
from ..arguments import explain_class
from ..course.files import read_text
from ..course.mjcf import MOST_MJCF, checked_mjcf, show_as_drawn
from ..display import brief
from ..errors import ModelError, SettingsError, accepted_names
from ..kept import kept
from ..messages import FloatArray, LaserScan, ScanGeometry, read_only

DEFAULT_LIDAR = "hokuyo_ust10lx.xml"
"""A file of models/: the LiDAR of a vehicle that names none."""
MOST_BEAMS = 100_000
"""Of a scan; the finest LiDARs that spin have some 30,000."""
NO_RETURN_READINGS = ("inf", "range_max")

_FILE = "file"  # the name of the text by which a model says which LiDAR it holds
_BEAMS = "beams"  # the name of the frame that holds the sites of the beams
_TEXT_ROUNDING = 1e-5  # MJCF text keeps six digits: 2.5e-6 rad of a beam's direction


@explain_class
@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
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
    level: bool = False  # whether they do not tilt with the car

    def __post_init__(self) -> None:
        for name in ("directions", "origins", "bearings"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    def __repr__(self) -> str:
        least, most = math.degrees(self.angle_min), math.degrees(self.angle_max)
        beams = f"{len(self.bearings)} from {least:.1f} to {most:.1f} deg"
        return brief(self, beams, f"{self.range_min:g} to {self.range_max:g} m", f"every {self.period:g} s")

    def readings(self, distances: FloatArray) -> FloatArray:
        """Return the readings of the LiDAR at `distances` (n,) [m]: +inf from `range_max` on, -inf below `range_min`.

        Source: REP 117.
        """
        readings = np.where(distances < self.range_max, distances, math.inf)
        readings[distances < self.range_min] = -math.inf
        return readings

    @cached_property
    def in_plane(self) -> FloatArray:
        """Cosine and sine of each beam's bearing, for a scanline: one array for all worlds. Shape (2, n), read-only."""
        return read_only(np.ascontiguousarray(self.directions[:, :2].T))

    @cached_property
    def geometry(self) -> ScanGeometry:
        """The constant part of all scans along these beams."""
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
            raise SettingsError(f"no_return is {no_return!r}; {accepted_names(no_return, NO_RETURN_READINGS)}")
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


@dataclass(frozen=True, kw_only=True)
class LidarModel:
    """A LiDAR, as its MJCF, the text of a file of models/ or another path, describes it; `load` makes and checks one.

    The MJCF has one body in the world, with a frame `beams` that holds the site of each beam, rightmost first; a
    rangefinder on each site, whose `cutoff` is the greatest range [m] and whose `interval` is the time between two
    sweeps [s]; and a number `range_min` [m]. A number `level` of 1, as a simulator's LiDAR may have it, keeps its
    beams level while the car rolls and pitches.
    """

    file: str
    text: str = field(repr=False)

    @classmethod
    def load(cls, file: str = DEFAULT_LIDAR) -> LidarModel:
        """Return a LiDAR of a file of models/, or the path of another, checked once for each file.

        Raises:
          ModelError: a file that cannot be read, or that is not the MJCF of a LiDAR.
        """
        return _bundled(file) if Path(file).name == file else _read(file, Path(file))

    @property
    def body(self) -> str:
        """Name of its body, whose origin the beams leave: x ahead, y left, z up."""
        name: str = self._without_sensors.worldbody.bodies[0].name
        return name

    @cached_property
    def beams(self) -> Beams:
        """Its beams, read off the compiled model."""
        model = self._model
        directions = np.empty((model.nsensor, 3))
        for direction, site in zip(directions, model.sensor_objid, strict=True):
            mujoco.mju_rotVecQuat(direction, np.array([0.0, 0.0, 1.0]), model.site_quat[site])
        bearings = portable.arctan2(directions[:, 1], directions[:, 0])
        increment = float(bearings[-1] - bearings[0]) / (model.nsensor - 1)
        period = float(model.sensor_interval[0, 0])
        return Beams(
            directions=directions,
            origins=model.site_pos[model.sensor_objid],
            bearings=bearings,
            angle_min=float(bearings[0]),
            angle_max=float(bearings[-1]),
            angle_increment=increment,
            range_min=_number(model, "range_min", 0.0),
            range_max=float(model.sensor_cutoff[0]),
            period=period,
            time_increment=period * increment / math.tau,  # the mirror turns once in a period
            level=_number(model, "level", 0.0) == 1.0,
        )

    def spec(self, *, sensors: bool = True) -> Any:
        """Return it as a new mujoco.MjSpec, to attach to a car. The spec names this file, for `lidar_of`.

        Args:
          sensors: with MuJoCo's sensors and their sites, as `rangefinder` needs. `raycast` needs none, and 1081 sites
            cost 100 us a physics step.
        """
        spec = (self._parsed if sensors else self._without_sensors).copy()
        spec.add_text(name=_FILE, data=self.file)
        return spec

    def restore(self, model: Any, sites: Any) -> None:
        """Give the sites of its beams in a model that went through MJCF text the digits that the text dropped.

        Raises:
          ModelError: they are elsewhere.
        """
        for name in ("site_pos", "site_quat"):
            present, exact = getattr(model, name), getattr(self._model, name)[self._model.sensor_objid]
            if np.abs(present[sites] - exact).max() > _TEXT_ROUNDING:
                raise ModelError(f"{name} of the rangefinders is not that of LiDAR file {self.file}")
            present[sites] = exact

    def _take(self, kept: Any) -> bool:
        """Take over what MuJoCo has made of this text before, and say whether it is that."""
        try:
            model, text = kept
            if not isinstance(model, mujoco.MjModel):
                return False
            vars(self)["_without_sensors"] = mujoco.MjSpec.from_string(text)
            vars(self)["_model"] = model
        except (TypeError, ValueError):
            return False
        return True

    @cached_property
    def _parsed(self) -> Any:
        return show_as_drawn(mujoco.MjSpec.from_string(checked_mjcf(self.text).text))

    @cached_property
    def _without_sensors(self) -> Any:
        """Without them, once for all worlds: to take out 1081 of them takes 12 ms."""
        spec = self._parsed.copy()
        spec.delete(spec.frame(_BEAMS))  # the sensors go with their sites
        return spec

    @cached_property
    def _model(self) -> Any:
        return self._parsed.copy().compile()

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle without the caches."""
        return _as_it_was, (self.file, self.text)


def lidar_of(model: Any, prefix: str = "") -> LidarModel:
    """Return the LiDAR that a compiled model holds under a prefix, or the default one; ModelError: no such file."""
    text = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_TEXT, prefix + _FILE)
    if text < 0:
        return LidarModel.load()
    start, size = int(model.text_adr[text]), int(model.text_size[text])
    return LidarModel.load(bytes(model.text_data[start : start + size - 1]).decode())


def lidar_body(model: Any, prefix: str = "") -> int:
    """Return the id of the body of the LiDAR that a compiled model holds under a prefix; ModelError: it holds none."""
    name = prefix + lidar_of(model, prefix).body
    body: int = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name)
    if body < 0:
        raise ModelError(f"the model has no body {name!r}; accepted: a model with a LiDAR under this prefix")
    return body


def _as_it_was(file: str, text: str) -> LidarModel:
    return LidarModel(file=file, text=text)


@lru_cache(maxsize=32)
def _bundled(file: str) -> LidarModel:
    with as_file(files("fg_mujoco.models") / file) as path:
        return _read(file, path)


def _read(file: str, source: Path) -> LidarModel:
    try:
        return _checked(file, read_text(source, MOST_MJCF))
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "it is not UTF-8 text"
        raise ModelError(f"LiDAR file {file}: {reason}; accepted: {DEFAULT_LIDAR}, or a path") from error


@lru_cache(maxsize=32)
def _checked(file: str, text: str) -> LidarModel:
    """Return the LiDAR of an MJCF text that keeps what is asked of one."""
    lidar, where = LidarModel(file=file, text=text), f"LiDAR file {file}"
    key = (text, mujoco.__version__, Path(__file__).read_bytes())  # a thousand beams take MuJoCo a tenth of a second
    kept("lidar", key, lambda: _made(lidar, where), lidar._take)
    return lidar


def _made(lidar: LidarModel, where: str) -> tuple[Any, str]:
    """Return what MuJoCo makes of a LiDAR that keeps what is asked of one: its model, and its MJCF without sensors."""
    try:
        spec, model = lidar._parsed, lidar._model
    except ValueError as error:
        raise ModelError(f"{where}: {' '.join(str(error).split())}; accepted: the MJCF of a LiDAR") from error
    if len(spec.worldbody.bodies) != 1 or spec.frame(_BEAMS) is None:
        raise ModelError(
            f"{where} has {len(spec.worldbody.bodies)} bodies in the world and "
            f"{'a' if spec.frame(_BEAMS) else 'no'} frame {_BEAMS!r}; accepted: one body, with the beams in that frame"
        )
    rangefinder = mujoco.mjtSensor.mjSENS_RANGEFINDER
    if model.nsensor < 2 or (model.sensor_type != rangefinder).any():
        raise ModelError(f"{where} has {model.nsensor} sensors; accepted: two rangefinders or more, and no others")
    if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, "range_min") < 0:
        raise ModelError(f"{where} has no numeric named 'range_min'; accepted: the least range [m]")
    beams = lidar.beams
    if not (0.0 <= beams.range_min < beams.range_max and beams.period > 0.0 and beams.angle_increment > 0.0):
        raise ModelError(
            f"{where}: range_min {beams.range_min} m, cutoff {beams.range_max} m, interval {beams.period} s, "
            f"{beams.angle_increment} rad between beams; accepted: 0 <= range_min < cutoff, an interval above 0, "
            "the rightmost beam first"
        )
    return model, lidar._without_sensors.to_xml()


def _number(model: Any, name: str, otherwise: float) -> float:
    """Return a numeric of a model, or what counts where there is none."""
    found = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, name)
    return otherwise if found < 0 else float(model.numeric_data[model.numeric_adr[found]])
