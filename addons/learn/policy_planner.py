"""A trained policy as a planner: what the engine builds of `policy.onnx`, `policy.zip` or a folder with a policy.onnx.

    fg-mujoco race --controller policy.onnx

The planner gives the commands that the policy gives in the environment, bit for bit: both make observations and
commands by the policy's interface. A speed above the planner's `max_speed` is reduced to it, with a warning. Before a
race, a car is refused whose LiDAR has other beams or another period than the policy was trained with. A single scan
with other beams, as of a bag, is converted: a beam that it does not have reads 0 in the observation, as a failed one.
"""

from __future__ import annotations

import math
import sys
import warnings
import zlib
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any, ClassVar

import numpy as np

from fg_mujoco.errors import ControllerError, SettingsError
from fg_mujoco.messages import STOP, DriveCommand, FloatArray, LaserScan, Odometry, ScanGeometry
from fg_mujoco.racing.planners import READ, PlannerScheme, file_in
from fg_mujoco.simulation.planner_failure import one_line

from .policy_files import Policy, policy_of, read_content
from .policy_shapes import ACTION_SIZE, FLAT, Values, observed_shapes

_ZEROS = np.zeros(3)
_AT_REST = Odometry(
    stamp=0.0, speed=0.0, steering_angle=0.0, angular_velocity=_ZEROS, linear_acceleration=_ZEROS,
    wheel_speeds=np.zeros(4),
)  # fmt: skip
_SAME_ANGLE = 1e-3  # [rad] by which beams may differ that are taken for the same
_SAME_PERIOD = 1e-6  # [s]


class PolicyPlanner:
    """A policy as a planner; `find_policy` makes a class of it for each file.

    Args:
      max_speed: fastest that is commanded, whatever the policy asks for [m/s].
      period: from one scan to the next [s].
      lidar: of the car; None: it is not known.

    Attributes:
      max_speed: as given.

    Raises:
      ControllerError: the LiDAR has other beams or another period than the policy was trained with, or the policy
        observes what a car does not sense.
    """

    policy: ClassVar[Policy]
    sensors: ClassVar[tuple[str, ...]] = ()
    files = ()  # its own is the one that names it

    def __init__(self, max_speed: float, period: float, lidar: ScanGeometry | None = None) -> None:
        interface = self.policy.interface
        _require_same(interface, period, lidar)
        try:
            self._driver = interface.driver()
        except SettingsError as error:
            raise ControllerError(str(error)) from error
        beams = interface.beams
        fastest = interface.speed_range[1]
        if fastest > max_speed:
            warnings.warn(
                f"policy {self.policy.path} was trained with speeds up to {fastest:g} m/s; max_speed reduces them to "
                f"{max_speed:g} m/s",
                stacklevel=2,
            )
        self.max_speed, self._bearings = max_speed, beams.bearings
        self._increment = (beams.angle_max - beams.angle_min) / max(beams.count - 1, 1)
        self._try_once()

    def reset(self) -> None:
        """Forget everything seen so far."""
        self._driver.reset()

    def _try_once(self) -> None:
        """Ask the policy for an action, so that it is loaded, and a network that fails does so before a race."""
        parts = {name: np.zeros(shape, np.float32) for name, shape in observed_shapes(self.policy.interface).items()}
        try:
            action = self._act(parts.get(FLAT, parts))
        except Exception as error:
            said = f"policy {self.policy.path}: its network fails: {one_line(error)}"
            raise ControllerError(f"{said}; accepted: one that takes its observation") from error
        if action.shape != (ACTION_SIZE,):
            said = f"policy {self.policy.path}: its network returns the shape {action.shape}"
            raise ControllerError(f"{said}; accepted: an action ({ACTION_SIZE},)")
        if not self.sensors:
            self(self._scan(np.zeros(len(self._bearings))), _AT_REST)
            self.reset()

    def __call__(self, scan: LaserScan, odometry: Odometry) -> DriveCommand:
        """Return the policy's command; STOP for a scan without any of its beams."""
        fitted = self._fitted(scan)
        if fitted is None:
            return STOP
        command = self._driver.drive(self._act, fitted, _finite(odometry))
        speed = max(-self.max_speed, min(self.max_speed, command.speed))
        return DriveCommand(steering_angle=command.steering_angle, speed=speed)

    def _act(self, observation: Any) -> Values:
        """Return the action, with 0 in the place of what is no number."""
        action = np.asarray(self.policy.act(observation), np.float32)
        return np.where(np.isnan(action), np.float32(0.0), action)

    def _fitted(self, scan: LaserScan) -> LaserScan | None:
        """Return the scan along the beams of the interface; None: it has none of them."""
        bearings, count = self._bearings, len(scan.ranges)
        if count == len(bearings):
            last = scan.angle_min + scan.angle_increment * (count - 1)
            if abs(scan.angle_min - bearings[0]) < _SAME_ANGLE and abs(last - bearings[-1]) < _SAME_ANGLE:
                return scan
        if count == 0:
            return None
        ranges = np.full(len(bearings), math.nan)
        with np.errstate(all="ignore"):
            places = np.zeros(len(bearings))
            if count > 1:
                places = np.rint((bearings - scan.angle_min) / scan.angle_increment)
            known = (places >= 0) & (places < count)
            places = np.where(known, places, 0).astype(np.int64)
            apart = np.abs(scan.bearings[places] - bearings)
            known &= apart <= max(0.5 * abs(scan.angle_increment), 0.5 * self._increment) + _SAME_ANGLE
        if not known.any():
            return None
        ranges[known] = scan.ranges[places[known]]
        return self._scan(ranges, scan.stamp)

    def _scan(self, ranges: FloatArray, stamp: float = 0.0) -> LaserScan:
        """Return a scan along the beams of the interface."""
        return LaserScan(
            stamp=stamp, angle_min=float(self._bearings[0]), angle_max=float(self._bearings[-1]),
            angle_increment=self._increment, range_min=0.0, range_max=self.policy.interface.beams.range_max,
            ranges=ranges,
        )  # fmt: skip


def _require_same(interface: Any, period: float, lidar: ScanGeometry | None) -> None:
    """Refuse a LiDAR with other beams or another period than the policy was trained with.

    Raises:
      ControllerError: it is another; both are named.
    """
    beams = interface.beams
    if abs(period - interface.period) > _SAME_PERIOD:
        raise ControllerError(
            f"the policy was trained with a scan every {interface.period:g} s, the car's LiDAR has one every "
            f"{period:g} s; accepted: the same"
        )
    if lidar is None:
        return
    ends = (lidar.angle_min, beams.angle_min), (lidar.angle_max, beams.angle_max)
    if len(lidar.bearings) != beams.count or any(abs(one - other) > _SAME_ANGLE for one, other in ends):
        trained = _beams(beams.count, beams.angle_min, beams.angle_max)
        found = _beams(len(lidar.bearings), lidar.angle_min, lidar.angle_max)
        raise ControllerError(f"the policy was trained with {trained}, the car's LiDAR has {found}; accepted: the same")


def _beams(count: int, least: float, most: float) -> str:
    return f"{count} beams from {math.degrees(least):.1f} to {math.degrees(most):.1f} deg"


def _finite(odometry: Odometry) -> Odometry:
    """Return the odometry with 0 in the place of what is no finite number."""
    if math.isfinite(odometry.speed + odometry.steering_angle + _sum(odometry)):
        return odometry
    speed, steering_angle = _zeroed(np.array((odometry.speed, odometry.steering_angle))).tolist()
    vectors: dict[str, Any] = {name: _zeroed(getattr(odometry, name)) for name in _VECTORS}
    return replace(odometry, speed=speed, steering_angle=steering_angle, **vectors)


_VECTORS = ("angular_velocity", "linear_acceleration", "wheel_speeds")


def _sum(odometry: Odometry) -> float:
    return float(sum(getattr(odometry, name).sum() for name in _VECTORS))


def _zeroed(values: FloatArray) -> FloatArray:
    return np.where(np.isfinite(values), values, 0.0)


def find_policy(source: str) -> type[PolicyPlanner]:
    """Return the class of planners of a policy file, or of the folder that has a policy.onnx.

    Raises:
      ControllerError: it cannot be read, or is no policy file.
      MissingExtraError: the file needs an extra that is not installed.
    """
    path = _path(source)
    policy = policy_of(path, read_content(path))
    module = ModuleType(f"fg_mujoco_policy_{path.stem}_{zlib.crc32(str(path).encode()):08x}")
    module.__file__ = str(path)
    vars(module)[READ] = policy.content
    sys.modules[module.__name__] = module  # where `planner_origin.source_code` finds what was read
    sensors = tuple(sensor.name for sensor in policy.interface.sensors)
    said = f"A trained policy: {policy.interface.observation} -> {policy.interface.action}."
    members = {"policy": policy, "sensors": sensors, "__module__": module.__name__, "__doc__": said}
    return type("PolicyPlanner", (PolicyPlanner,), members)


def _path(source: str) -> Path:
    path = file_in(source)
    assert path is not None
    return path


def policy_bytes(source: str) -> bytes:
    """Return the contents of a policy's file.

    Raises:
      ControllerError: it cannot be read.
    """
    return read_content(_path(source))


POLICIES = PlannerScheme(find=find_policy, code=policy_bytes)
"""Planners that are the path of a policy file."""
