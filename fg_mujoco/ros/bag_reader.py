"""Reads the scans that a car recorded, each with the odometry that was known when the scan arrived.

    with ScanBag("drive.mcap") as bag:
        for delivery in bag:
            command = planner(delivery.scan, delivery.odometry)

A bag is an `.mcap` or `.db3` file, or the folder of one, as `ros2 bag record` writes it, or a `.bag` of ROS 1.
Messages are taken in the order in which they were received. The odometry that a planner gets has

- speed: Odometry.twist; else the last drive command's; else 0
- steering angle: JointState of the joint "steering"; else the last drive command's; else 0
- angular velocity: Imu; else Odometry.twist; else 0
- linear acceleration: Imu; else gravity alone
- wheel speeds: JointState of the joints "front_left_wheel" and so on; else the speed
- pose: Odometry.pose, where its frame is map or the bag has the transform from there; else NaN

The LiDAR's mount is that of the transforms from base_link to the scan's frame; without them, level and straight ahead.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from ..errors import BagError, FgMujocoError
from ..messages import CarParameters, FloatArray, LaserScan, Odometry
from .bag_messages import (
    BASE_FRAME,
    DRIVE,
    IMU,
    JOINTS,
    MAP_FRAME,
    ODOMETRY,
    SCAN,
    STEERING_JOINT,
    TRANSFORMS,
    WHEEL_JOINTS,
    heading_of,
    require_ros_extra,
    stamp_of,
    type_store,
)
from .bag_scans import Mount, to_scan

_USUAL = {SCAN: "/scan", ODOMETRY: "/odom", IMU: "/imu", JOINTS: "/joint_states", DRIVE: "/drive"}
_DEEPEST = 32  # frames between base_link and the LiDAR's; more are a ring


@dataclass(frozen=True, kw_only=True, eq=False)
class Delivery:
    """A scan, and the odometry that was known when it arrived."""

    received: int  # [ns] logged by the recorder
    measured: int  # [ns] the stamp in its header
    scan: LaserScan
    odometry: Odometry


class ScanBag:
    """A bag with scans, to be read once, in a `with` statement.

    Args:
      path: of the file or folder.
      car: whose wheels and gravity the odometry is of.
      scan_topic: of the scans; None: /scan, or the only one there is.
      odometry_topic: of the odometry; None: /odom, or the only one there is.

    Attributes:
      topics: the topic that is read, by type of message; without the types that the bag lacks.
      scans: how many there are.

    Raises:
      MissingExtraError: the extra `ros` is not installed.
      BagError: on entry, a bag that cannot be read, without scans, or with several topics to choose from; while read,
        a message that cannot be.
    """

    def __init__(
        self,
        path: str | Path,
        car: CarParameters,
        *,
        scan_topic: str | None = None,
        odometry_topic: str | None = None,
    ) -> None:
        require_ros_extra()
        self.path = Path(path)
        self.topics: dict[str, str] = {}
        self.scans = 0
        self._car = car
        self._wanted = {SCAN: scan_topic, ODOMETRY: odometry_topic}
        self._options = {SCAN: "--scan-topic", ODOMETRY: "--odom-topic"}

    def __enter__(self) -> ScanBag:
        from rosbags.highlevel import AnyReader

        with self._blame():
            self._reader = AnyReader([self.path], default_typestore=type_store())
            self._reader.open()
        try:
            self._choose_topics()
        except BaseException:
            self._reader.close()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._reader.close()

    def __iter__(self) -> Iterator[Delivery]:
        """Yield the scans in the order in which they were received."""
        known = _Known(self._car)
        with self._blame():
            for _, _, message in self._messages(lambda c: c.msgtype == TRANSFORMS and c.topic.endswith("tf_static")):
                known.hear(TRANSFORMS, message)
        chosen = self.topics.items()
        wanted = self._messages(lambda c: c.msgtype == TRANSFORMS or (c.msgtype, c.topic) in chosen)
        previous: int | None = None
        with self._blame():
            for received, group in groupby(wanted, key=lambda entry: entry[1]):
                entries = [(kind, message) for kind, _, message in group]
                # at one time, first what the car measured, then the scans, then what it answered to them
                for kind, message in entries:
                    if kind not in (SCAN, DRIVE):
                        known.hear(kind, message)
                for message in [message for kind, message in entries if kind == SCAN]:
                    measured = stamp_of(message)
                    period = (measured - previous) / 1e9 if previous is not None and measured > previous else 0.025
                    scan = to_scan(message, known.mount(message.header.frame_id), period=period)
                    yield Delivery(received=received, measured=measured, scan=scan, odometry=known.odometry(scan.stamp))
                    previous = measured
                for kind, message in entries:
                    if kind == DRIVE:
                        known.hear(kind, message)

    def _messages(self, wanted: Any) -> Iterator[tuple[str, int, Any]]:
        """Yield (type, received [ns], message) of the connections that are wanted."""
        connections = [connection for connection in self._reader.connections if wanted(connection)]
        if connections:  # none would mean all
            for connection, received, data in self._reader.messages(connections):
                yield connection.msgtype, received, self._reader.deserialize(data, connection.msgtype)

    def _choose_topics(self) -> None:
        for kind, usual in _USUAL.items():
            there = sorted({c.topic for c in self._reader.connections if c.msgtype == kind and c.msgcount})
            wanted = self._wanted.get(kind)
            if wanted is not None and wanted not in there:
                raise BagError(f"{self.path}: has no {kind} on {wanted}; accepted: {', '.join(there) or self._held()}")
            if wanted is not None or usual in there:
                self.topics[kind] = wanted or usual
            elif len(there) == 1:
                self.topics[kind] = there[0]
            elif there and kind in self._options:
                raise BagError(
                    f"{self.path}: has {kind} on {', '.join(there)}; accepted: one, by {self._options[kind]}"
                )
        if SCAN not in self.topics:
            raise BagError(f"{self.path}: holds no scans; accepted: a bag with {SCAN}; it has {self._held()}")
        scans = [c for c in self._reader.connections if (c.msgtype, c.topic) == (SCAN, self.topics[SCAN])]
        self.scans = sum(connection.msgcount for connection in scans)

    def _held(self) -> str:
        held = sorted({f"{c.topic} ({c.msgtype})" for c in self._reader.connections if c.msgcount})
        return ", ".join(held) or "no messages"

    @contextmanager
    def _blame(self) -> Iterator[None]:
        """Turn whatever reading the bag raises into one line that names it."""
        try:
            yield
        except FgMujocoError as error:
            if isinstance(error, BagError):
                raise BagError(f"{self.path}: {error}") from error
            raise
        except Exception as error:
            reason = " ".join(f"{type(error).__name__}: {error}".split())
            raise BagError(
                f"{self.path}: cannot be read: {reason}; accepted: an .mcap or .db3 file, or a bag's folder"
            ) from error


class _Known:
    """The last messages received."""

    def __init__(self, car: CarParameters) -> None:
        self._car = car
        self._last: dict[str, Any] = {}
        self._parents: dict[str, tuple[str, Any]] = {}  # of each frame: its parent, and the transform from there
        self._mounts: dict[str, Mount] = {}

    def hear(self, kind: str, message: Any) -> None:
        if kind != TRANSFORMS:
            self._last[kind] = message
            return
        for entry in message.transforms:
            self._parents[_frame(entry.child_frame_id)] = _frame(entry.header.frame_id), entry.transform
        self._mounts.clear()

    def mount(self, name: str) -> Mount:
        """Return how the LiDAR of a frame sits on the car."""
        if name not in self._mounts:
            rotation, frame = np.eye(3), _frame(name)
            for _ in range(_DEEPEST):
                if frame == BASE_FRAME or frame not in self._parents:
                    break
                frame, transform = self._parents[frame]
                rotation = _rotation(transform.rotation) @ rotation
            self._mounts[name] = Mount.of(rotation, name) if frame == BASE_FRAME else Mount()
        return self._mounts[name]

    def odometry(self, stamp: float) -> Odometry:
        """Return the odometry of the last messages received."""
        odometry, imu, drive = (self._last.get(kind) for kind in (ODOMETRY, IMU, DRIVE))
        twist = odometry.twist.twist if odometry is not None else None
        speed = twist.linear.x if twist is not None else drive.drive.speed if drive is not None else 0.0
        steering = self._joint(STEERING_JOINT, "position")
        if steering is None:
            steering = drive.drive.steering_angle if drive is not None else 0.0
        turning = [self._joint(wheel, "velocity") for wheel in WHEEL_JOINTS]
        turned = imu.angular_velocity if imu is not None else twist.angular if twist is not None else None
        return Odometry(
            stamp=stamp_of(odometry) / 1e9 if odometry is not None else stamp,
            speed=float(speed),
            steering_angle=float(steering),
            angular_velocity=_vector(turned) if turned is not None else np.zeros(3),
            linear_acceleration=(
                _vector(imu.linear_acceleration) if imu is not None else np.array((0.0, 0.0, self._car.gravity))
            ),
            wheel_speeds=(
                np.full(4, float(speed)) if None in turning else np.array(turning, np.float64) * self._car.wheel_radius
            ),
            pose=self._pose(odometry),
        )

    def _joint(self, name: str, quantity: str) -> float | None:
        """Return a joint's position [rad] or velocity [rad/s], None where it is not said."""
        joints = self._last.get(JOINTS)
        if joints is None or name not in joints.name:
            return None
        values, index = getattr(joints, quantity), list(joints.name).index(name)
        return float(values[index]) if index < len(values) else None

    def _pose(self, odometry: Any) -> FloatArray:
        """Return where base_link is on the map: x [m], y [m], heading [rad]."""
        nowhere = np.full(3, math.nan)
        if odometry is None:
            return nowhere
        position, heading = odometry.pose.pose.position, heading_of(odometry.pose.pose.orientation)
        frame = _frame(odometry.header.frame_id)
        if frame == MAP_FRAME:
            return np.array((position.x, position.y, heading))
        parent, transform = self._parents.get(frame, ("", None))
        if parent != MAP_FRAME or transform is None:
            return nowhere
        turn, origin = heading_of(transform.rotation), transform.translation
        x = origin.x + math.cos(turn) * position.x - math.sin(turn) * position.y
        y = origin.y + math.sin(turn) * position.x + math.cos(turn) * position.y
        return np.array((x, y, math.remainder(heading + turn, math.tau) if turn else heading))


def _frame(name: str) -> str:
    return name.lstrip("/")  # as tf of ROS 1 wrote it


def _vector(vector: Any) -> FloatArray:
    return np.array((vector.x, vector.y, vector.z), np.float64)


def _rotation(quaternion: Any) -> FloatArray:
    """Return the rotation of a geometry_msgs/Quaternion, shape (3, 3)."""
    x, y, z, w = np.array((quaternion.x, quaternion.y, quaternion.z, quaternion.w)) / math.hypot(
        quaternion.x, quaternion.y, quaternion.z, quaternion.w
    )
    return np.array(
        (
            (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
            (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
            (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
        )
    )
