"""Reads the scans that a car recorded, each with the odometry that was known when the scan arrived.

Messages are taken in the order in which they were received. The odometry that a planner gets has

- speed: Odometry.twist; else from pose to pose, of PoseStamped, PoseWithCovarianceStamped or the transforms from odom
  or map to the car; else the motor's of the VESC; else the last drive command's; else 0
- steering angle: JointState of the joint "steering"; else the last drive command's; else 0
- angular velocity: an Imu with a gyro; else as the speed, from the twist or from pose to pose; else that
  of the speed and the steering angle by the wheelbase
- linear acceleration: an Imu with an accelerometer; else gravity alone
- wheel speeds: JointState of the joints "front_left_wheel" and so on; else the speed
- pose: PoseStamped or PoseWithCovarianceStamped on the map; else Odometry.pose, where its frame is map or the bag has
  the transform from there; else the transforms from map to the car; else NaN

The LiDAR's mount is that of the transforms from base_link to the scan's frame; without them, level and straight ahead.
Times that a planner gets never go back: where a clock was set back, they go on.
"""

from __future__ import annotations

import math
import warnings
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from fg_mujoco.errors import BagError
from fg_mujoco.messages import CarParameters, FloatArray, LaserScan, Odometry

from .bag_frames import FrameTree, axes_of, flat, is_world, plain, planar
from .bag_messages import (
    DRIVE,
    IMU,
    JOINTS,
    MAP_FRAME,
    MOTOR,
    ODOMETRY,
    POSE,
    POSE_WITH_COVARIANCE,
    SCAN,
    STEERING_JOINT,
    TRANSFORMS,
    WHEEL_JOINTS,
    heading_of,
    measures,
    stamp_of,
)
from .bag_recording import FIRST_TRANSFORMS, Heard, Recording, Topic
from .bag_scans import Mount, beyond, disagreement, mount_of, to_scan
from .composed_topics import SPEED_TO_ERPM

POSES = (POSE, POSE_WITH_COVARIANCE)

_FIRST_TWISTS = 400  # of Odometry, that are read ahead for whether it has speeds at all
_MOVED = 0.2  # [m] within which a car has not moved
_MEASURED_OVER = 80_000_000  # [ns] from pose to pose, for a speed
_UNSTAMPED = 1_000_000_000  # [ns] at which a stamp of 0 is none; a simulation's clock begins there
_STALE = 0.5  # [s] of odometry
_GAP = 0.5  # [s] without scans, and
_GAP_PERIODS = 5.0  # as many of their periods
_TWICE = 5_000_000  # [ns] within which the same scan is there twice, and not sent again
_TOLD = 3  # of the same fault


@dataclass(frozen=True, kw_only=True, eq=False)
class Delivery:
    """A scan, and the odometry that was known when it arrived."""

    received: int  # [ns] logged by the recorder
    measured: int  # [ns] the stamp in its header
    scan: LaserScan
    odometry: Odometry


class ScanBag:
    """A bag with scans, to be read once, in a `with` statement; a topic that is None is the usual or only one.

    Wheels and gravity of the odometry are those of `car`. `topics` are those that are read, by type of message, `scans`
    their number, and `speed` what the speed is, in words.
    Raises MissingExtraError: the extra `ros`; BagError: on entry, a bag that cannot be read, without scans, or with
    several topics to choose from; while read, a message that cannot be.
    """

    def __init__(
        self,
        path: str | Path,
        car: CarParameters,
        *,
        scan_topic: str | None = None,
        odometry_topic: str | None = None,
        drive_topic: str | None = None,
    ) -> None:
        self.path = Path(path)
        self.recording = Recording(path)
        self.topics: dict[str, str] = {}
        self.scans = 0
        self.speed = ""
        self._car = car
        self._wanted = scan_topic, odometry_topic, drive_topic

    def __enter__(self) -> ScanBag:
        self.recording.__enter__()
        try:
            self._choose_topics()
        except BaseException:
            self.recording.__exit__(None, None, None)
            raise
        return self

    def __exit__(self, *error: object) -> None:
        self.recording.__exit__(*error)

    def __iter__(self) -> Iterator[Delivery]:
        """Yield the scans in the order in which they were received."""
        known = _Known(self._car, self.recording.mounting_frames(), self._odometry, self._has_twist, self._imus)
        faults = ScanFaults(self.recording)
        wanted = {*self.topics.items(), *(imu for imu in self._imus if imu)} | self.recording.transform_topics
        clock = Clock()
        refused = False
        try:
            with self.recording.blame():
                for _, group in groupby(self.recording.messages(wanted), key=lambda heard: heard.time):
                    entries = list(group)
                    # at one time, first what the car measured, then the scans, then what it answered to them
                    for heard in entries:
                        if heard.topic[0] not in (SCAN, DRIVE):
                            known.hear(heard)
                    for heard in entries:
                        if heard.topic[0] == SCAN and faults.accepts(heard):
                            yield self._delivery(heard, known, clock, again=faults.again)
                            faults.note_age(known.age(heard.time))
                    for heard in entries:
                        if heard.topic[0] == DRIVE:
                            known.hear(heard)
        except BagError:
            refused = True  # which is said alone
            raise
        finally:
            if not refused:
                faults.warn(clock)

    def _delivery(self, heard: Heard, known: _Known, clock: Clock, *, again: bool) -> Delivery:
        measured = stamp_of(heard.message)
        shift, period = clock.shift(measured, heard, again=again)
        scan = to_scan(heard.message, known.mount(heard.message.header.frame_id), period=period)
        if shift:
            scan = replace(scan, stamp=scan.stamp + shift / 1e9)
        return Delivery(received=heard.received, measured=measured, scan=scan, odometry=known.odometry(scan.stamp))

    def _choose_topics(self) -> None:
        bag, (scans, odometry, drive) = self.recording, self._wanted
        scan = bag.choose((SCAN,), wanted=scans, option="--scan-topic")
        if scan is None:
            raise BagError(f"{self.path}: holds no scans; accepted: a bag with {SCAN}; it has {bag.held()}")
        if odometry is not None:
            self._odometry = bag.choose((ODOMETRY, *POSES, MOTOR), wanted=odometry, option="--odom-topic")
        else:
            self._odometry = bag.choose((ODOMETRY,), option="--odom-topic")
        found = [scan, self._odometry, bag.choose((DRIVE,), wanted=drive, option="--drive-topic")]
        self._imus = bag.choose_imus()
        found += [*self._imus[::-1], bag.choose((JOINTS,))]
        if self._odometry is None or self._odometry[0] not in POSES:
            found.append(bag.choose(POSES, sparse=False))
        if self._odometry is None:
            found.append(bag.choose((MOTOR,)))
            self._odometry = next((topic for topic in found if topic and topic[0] in (*POSES, MOTOR)), None)
        self.topics = dict(topic for topic in found if topic is not None)
        self.scans = bag.counts[scan]
        self._has_twist = self._odometry is not None and self._odometry[0] == ODOMETRY and self._reads_twist()
        self.speed = self._speed()

    def _reads_twist(self) -> bool:
        """Return whether the Odometry has speeds; a localisation's often has none, while its pose moves."""
        moved = []
        assert self._odometry is not None
        for heard in self.recording.messages({self._odometry}, most=_FIRST_TWISTS):
            twist, position = heard.message.twist.twist, heard.message.pose.pose.position
            if twist.linear.x or twist.linear.y or twist.angular.z:
                return True
            moved.append((position.x, position.y))
        if not moved or np.hypot(*np.ptp(moved, axis=0)) < _MOVED:
            return True
        self.recording.warn(f"{self._odometry[1]} has no speeds; they are taken from its poses")
        return False

    def _speed(self) -> str:
        if self._odometry is not None:
            kind, topic = self._odometry
            if kind == MOTOR:
                return f"that of the motor on {topic}, {SPEED_TO_ERPM:g} turns a minute for 1 m/s"
            return f"{'the twist' if self._has_twist else 'that from pose to pose'} on {topic}"
        if any(_moves(topic, self.recording) for topic in self.recording.transform_topics):
            return "that of the transforms to the car"
        return f"that commanded on {self.topics[DRIVE]}" if DRIVE in self.topics else "taken to be 0"


def _moves(topic: Topic, bag: Recording) -> bool:
    """Return whether a topic of transforms has one from a frame of the world."""
    heard = bag.messages({topic}, most=FIRST_TRANSFORMS)
    return any(
        is_world(entry.header.frame_id) and not is_world(entry.child_frame_id)
        for each in heard
        for entry in each.message.transforms
    )


class Clock:
    """Makes the stamps of one topic grow, as a planner expects them to."""

    def __init__(self) -> None:
        self._last: tuple[int, int] | None = None  # the stamp before [ns], and the recorder's time
        self._offset, self._period = 0, 25_000_000
        self.unstamped = 0
        self.set_back: list[tuple[float, float]] = []  # by how much and after how long [s]
        self._first = 0

    def shift(self, stamp: int, heard: Heard, *, again: bool = False) -> tuple[int, float]:
        """Return the offset to add to a stamp [ns], and the time since the one before [s]; `again`: it is sent anew."""
        stated = stamp
        if stated == 0 and heard.received > _UNSTAMPED:
            self.unstamped += 1
            stated = heard.received
        if self._last is None:
            self._first = heard.time
        else:
            step, passed = stated - self._last[0], heard.time - self._last[1]
            if step <= 0 and not again:
                self._offset += (passed if passed > 0 else self._period) - step
                if step < 0:
                    self.set_back.append((-step / 1e9, (heard.time - self._first) / 1e9))
            elif step > 0:
                self._period = step
        self._last = stated, heard.time
        return stated + self._offset - stamp, self._period / 1e9


class ScanFaults:
    """Faults of a bag's scans that do not prevent reading them; each is reported once, at the end."""

    def __init__(self, bag: Recording) -> None:
        self._bag = bag
        self._count = self._doubled = 0
        self.again = False
        self._last: Any = None
        self._time = self._first = 0
        self._period = 0.0
        self._gaps: list[tuple[float, float]] = []
        self._beams: list[tuple[int, int]] = []
        self._off, self._beyond, self._oldest = 0.0, 0, 0.0
        self._limit = 0.0
        self._stale = 0

    def accepts(self, heard: Heard) -> bool:
        """Take a scan; say whether it is another one than the last."""
        message, last = heard.message, self._last
        self.again = (
            last is not None
            and stamp_of(message) == stamp_of(last)
            and np.array_equal(message.ranges, last.ranges, equal_nan=True)
        )
        if self.again and heard.time - self._time < _TWICE:
            self._doubled += 1
            return False
        if last is not None:
            passed = (heard.time - self._time) / 1e9
            if passed > _GAP and self._period and passed > _GAP_PERIODS * self._period:
                self._gaps.append((passed, (self._time - self._first) / 1e9))
            elif passed > 0.0:
                self._period = passed
        else:
            self._first = heard.time
        self._count += 1
        if not self._beams or self._beams[-1][0] != len(message.ranges):
            self._beams.append((len(message.ranges), self._count))
        self._off = max(self._off, disagreement(message))
        if beyond(message) > 0.05:
            self._beyond, self._limit = self._beyond + 1, float(message.range_max)
        self._last, self._time = message, heard.time
        return True

    def note_age(self, seconds: float) -> None:
        """Take how old the odometry is at a scan."""
        if seconds > _STALE:
            self._stale, self._oldest = self._stale + 1, max(self._oldest, seconds)

    def warn(self, clock: Clock) -> None:
        """Say what there was, each in a line."""
        of = f"of {self._count} scans"
        said = []
        if clock.unstamped:
            said.append(f"{clock.unstamped} {of} without a stamp; the time at which they were recorded is taken")
        for back, after in clock.set_back[:_TOLD]:
            said.append(f"the scans' stamps go back by {back:.3g} s after {after:.1f} s; time goes on there")
        if len(clock.set_back) > _TOLD:
            said.append(f"the scans' stamps go back {len(clock.set_back) - _TOLD} more times")
        if self._doubled:
            said.append(f"{self._doubled} {of} recorded twice; one of each is taken")
        said += [f"no scans for {gap:.1f} s after {after:.1f} s" for gap, after in self._gaps[:_TOLD]]
        if len(self._gaps) > _TOLD:
            said.append(f"no scans in {len(self._gaps) - _TOLD} more gaps")
        if len(self._beams) > 1:
            (first, _), (other, number) = self._beams[:2]
            said.append(f"scans have {first} beams, and {other} from number {number} on; each is read")
        if self._off > 1.5:
            said.append(f"angle_max is {self._off:.3g} beams off; angle_min, angle_increment and the beams count")
        if self._beyond:
            limit = f"range_max, {self._limit:g} m"
            said.append(f"{self._beyond} {of} see far beyond {limit}; that is read as nothing there")
        if self._stale:
            said.append(f"odometry more than {_STALE} s old at {self._stale} {of}, at most {self._oldest:.1f} s")
        for each in said:
            warnings.warn(f"{self._bag.path}: {each}", stacklevel=2)


class _Known:
    """The last messages received."""

    def __init__(
        self, car: CarParameters, mounting: FrameTree, odometry: Topic | None, has_twist: bool,
        imus: tuple[Topic | None, Topic | None],
    ) -> None:  # fmt: skip
        self._car = car
        self._imus = imus
        self._measured: dict[str, FloatArray] = {}  # of an IMU, (3,)
        self._joints: dict[tuple[str, str], float] = {}  # the last of each joint and quantity
        self._last: dict[str, Any] = {}
        self._mounting, self._frames = mounting, FrameTree()
        self._mounts: dict[str, Mount] = {}
        self._odometry, self._has_twist = odometry, has_twist
        self._motion = Motion()
        self._clock, self._shift = Clock(), 0
        self._time: int | None = None
        self._world = ""  # frame that the transforms to the car begin at
        self._sensor = ""  # frame of the scans

    def hear(self, heard: Heard) -> None:
        kind, message = heard.topic[0], heard.message
        if kind == TRANSFORMS:
            self._frames.hear(message)
            if self._odometry is None:
                self._follow_transforms(heard.time)
            return
        if kind == IMU:
            self._measured |= measured(heard, self._imus, self._mounting)
            return
        if kind == JOINTS:
            for quantity in ("position", "velocity"):
                for name, value in zip(message.name, getattr(message, quantity), strict=False):
                    if math.isfinite(value):
                        self._joints[name, quantity] = float(value)
            return
        if heard.topic == self._odometry:
            if kind in (ODOMETRY, *POSES):
                pose = pose_of(message)
                if not np.isfinite(pose).all():
                    return
                if not self._has_twist:
                    self._motion.add(heard.time, pose)
            self._shift = self._clock.shift(stamp_of(message), heard)[0]
            self._time = heard.time
        self._last[kind] = message

    def age(self, time: int) -> float:
        """Return the age of the odometry [s]; 0 before the first."""
        return (time - self._time) / 1e9 if self._time is not None else 0.0

    def mount(self, name: str) -> Mount:
        """Return the mount of the LiDAR of a frame on the car."""
        self._sensor = name
        if name not in self._mounts:
            odometry = self._last.get(ODOMETRY)
            self._mounts[name] = mount_of(self._mounting, name, odometry.child_frame_id if odometry is not None else "")
        return self._mounts[name]

    def odometry(self, stamp: float) -> Odometry:
        """Return the odometry of the last messages received."""
        odometry, drive = self._last.get(ODOMETRY), self._last.get(DRIVE)
        twist = odometry.twist.twist if odometry is not None and self._has_twist else None
        speed, yaw_rate = self._motion.rates() if self._motion else (0.0, math.nan)
        if twist is not None:
            speed = twist.linear.x
        elif not self._motion:
            motor = self._last.get(MOTOR) if self._odometry is not None and self._odometry[0] == MOTOR else None
            if motor is not None:
                speed = motor.state.speed / SPEED_TO_ERPM
            elif drive is not None:
                speed = drive.drive.speed
        steering = self._joints.get((STEERING_JOINT, "position"))
        if steering is None:
            steering = drive.drive.steering_angle if drive is not None else 0.0
        turning = [self._joints.get((wheel, "velocity")) for wheel in WHEEL_JOINTS]
        if twist is not None:
            yaw_rate = twist.angular.z
        if not math.isfinite(yaw_rate):
            yaw_rate = speed * math.tan(min(max(steering, -1.5), 1.5)) / self._car.wheelbase
        source = self._last.get(self._odometry[0]) if self._odometry is not None else None
        return Odometry(
            stamp=(stamp_of(source) + self._shift) / 1e9 if source is not None else stamp,
            speed=float(speed),
            steering_angle=float(steering),
            angular_velocity=self._measured.get("angular_velocity", np.array((0.0, 0.0, float(yaw_rate)))),
            linear_acceleration=self._measured.get("linear_acceleration", np.array((0.0, 0.0, self._car.gravity))),
            wheel_speeds=(
                np.full(4, float(speed)) if None in turning else np.array(turning, np.float64) * self._car.wheel_radius
            ),
            pose=self._pose(odometry),
        )

    def _follow_transforms(self, time: int) -> None:
        """Take where the transforms have the car, where nothing else says how fast it is."""
        base = self._frames.base_of(self._sensor) or self._mounting.base_of(self._sensor)
        if base is None:
            return
        for world in [self._world] if self._world else ("odom", "odom_combined", MAP_FRAME, "world"):
            found = self._frames.find(base, world)
            if found is not None:
                self._world = world
                self._motion.add(time, flat(found))
                self._time = time
                return

    def _pose(self, odometry: Any) -> FloatArray:
        """Return the pose of base_link on the map: x [m], y [m], heading [rad]."""
        nowhere = np.full(3, math.nan)
        found = next((self._last[kind] for kind in POSES if kind in self._last), odometry)
        if found is not None:
            frame, pose = plain(found.header.frame_id), pose_of(found)
            if frame == MAP_FRAME:
                return pose
            found = self._frames.find(frame, MAP_FRAME)
            return nowhere if found is None else flat(found @ planar(*pose))
        base = self._mounting.base_of(self._sensor) if self._frames else None
        found = None if base is None else self._frames.find(base, MAP_FRAME)
        return nowhere if found is None else flat(found)


class Motion:
    """Speed of a car, from the difference of its poses."""

    def __init__(self) -> None:
        self._poses: deque[tuple[int, FloatArray]] = deque()

    def __bool__(self) -> bool:
        return len(self._poses) > 1

    def add(self, time: int, pose: FloatArray) -> None:
        """Take a pose: x [m], y [m], heading [rad], at a time [ns]."""
        if self._poses:
            passed = time - self._poses[-1][0]
            if passed <= 0 or (passed < _MEASURED_OVER and np.array_equal(pose, self._poses[-1][1])):
                return
        self._poses.append((time, pose))
        while len(self._poses) > 2 and time - self._poses[1][0] >= _MEASURED_OVER:
            self._poses.popleft()

    def rates(self) -> tuple[float, float]:
        """Return the speed along the car [m/s], and its yaw rate [rad/s]."""
        (begin, before), (end, now) = self._poses[0], self._poses[-1]
        seconds = (end - begin) / 1e9
        turned = math.remainder(now[2] - before[2], math.tau)
        along = before[2] + 0.5 * turned
        ahead = (now[0] - before[0]) * math.cos(along) + (now[1] - before[1]) * math.sin(along)
        return float(ahead) / seconds, turned / seconds


def measured(heard: Heard, imus: tuple[Topic | None, Topic | None], mounting: FrameTree) -> dict[str, FloatArray]:
    """Return what an Imu's topics are read for of its quantities [rad/s], [m/s^2], (3,), along the car's axes."""
    axes, found = axes_of(mounting, heard.message.header.frame_id), {}
    for quantity, topic in zip(("angular_velocity", "linear_acceleration"), imus, strict=True):
        vector = getattr(heard.message, quantity)
        values = np.array((vector.x, vector.y, vector.z), np.float64)
        if heard.topic == topic and measures(heard.message, quantity) and np.isfinite(values).all():
            found[quantity] = axes @ values
    return found


def pose_of(message: Any) -> FloatArray:
    """Return x [m], y [m] and heading [rad] of an Odometry, a PoseStamped or a PoseWithCovarianceStamped."""
    pose = message.pose.pose if hasattr(message.pose, "pose") else message.pose
    return np.array((pose.position.x, pose.position.y, heading_of(pose.orientation)))
