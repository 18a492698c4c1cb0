"""The signals of a drive that a car recorded in a bag, and the identification of its tires from them.

| what | type of message | topic, where there are several |
| --- | --- | --- |
| steering | AckermannDriveStamped; else the VESC's commands; else JointState of the joint "steering" | /drive |
| wheel speed | JointState of the rear wheels' joints; else the twist of an Odometry; else the VESC's motor | /odom |
| yaw rate | sensor_msgs/Imu with a gyro; else the twist of an Odometry | /imu |
| acceleration | sensor_msgs/Imu, taken to be in the centre of gravity | /imu |
| pose | geometry_msgs/PoseStamped or PoseWithCovarianceStamped; else the pose of an Odometry | /odom |

Times are those of the messages' headers, or of the recorder where a header has none.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fg_mujoco.addons.ros.bag_messages import (
    DRIVE,
    IMU,
    JOINTS,
    MOTOR,
    ODOMETRY,
    POSE,
    POSE_WITH_COVARIANCE,
    STEERING_JOINT,
    WHEEL_JOINTS,
    stamp_of,
)
from fg_mujoco.addons.ros.bag_reader import POSES, Clock, measured, pose_of
from fg_mujoco.addons.ros.bag_recording import Recording, Topic
from fg_mujoco.addons.ros.composed_topics import SPEED_TO_ERPM
from fg_mujoco.course.files import file_sha256
from fg_mujoco.errors import BagError, SettingsError
from fg_mujoco.messages import CarParameters
from fg_mujoco.racing.run_folder import read_run
from fg_mujoco.vehicle.vehicle import DEFAULT_VEHICLE, Vehicle

from .drives.channels import Channel
from .drives.drive_checks import check_drive
from .drives.drive_columns import DriveColumns
from .drives.drive_recording import RecordedDrive
from .drives.reading import kind_of, refuse_for_kind
from .drives.reading import read_drive as recorded_drive
from .identification.drive_log import Drive
from .identification.fit import require_scipy
from .identification.identification import BUDGET, Identification, identify_drives

ACCEPTED = (
    f"steering by {DRIVE} or {JOINTS}, wheel speed by {JOINTS}, {ODOMETRY} or {MOTOR}, yaw rate by {IMU} or {ODOMETRY}"
    f", and accelerations by {IMU} or poses by {POSE}, {POSE_WITH_COVARIANCE} or {ODOMETRY}"
)
_KINDS = (DRIVE, JOINTS, ODOMETRY, MOTOR)
_OPTIONS = {DRIVE: "--drive-topic", IMU: "--imu-topic", ODOMETRY: "--odom-topic"}
_NEEDED = {
    "steering": ("drive", "angle"), "wheel speed": ("wheels", "speed", "motor"), "yaw rate": ("gyro", "turn"),
    "acceleration or pose": ("acceleration", "pose"),
}  # fmt: skip
_REAR = WHEEL_JOINTS[2:]


def identify(
    *sources: str | Path,
    vehicle: str | Path | Vehicle | None = None,
    linear: bool = False,
    single_track: bool = False,
    columns: DriveColumns | Mapping[str, Any] | str | Path | None = None,
    pose_topic: str | None = None,
    drive_topic: str | None = None,
    imu_topic: str | None = None,
    odometry_topic: str | None = None,
    hold_out: Sequence[str | Path] = (),
    budget: float = BUDGET,
    watch: Callable[[str], None] | None = None,
) -> Identification:
    """Return the tires and the steering of a car, identified from drives that it recorded.

    `sources` are run folders, CSV files with `columns` as of `read_drive`, or ROS bags, whose topics are the usual or
    only ones where they are None. Mass, inertia and lengths are those of `vehicle`; None: of the runs' own car, or
    `f1tenth`. `linear` finds of each axle the stiffness alone, which a gentle drive determines, and `single_track`
    leaves out the load on the outer tires, what driving takes of the grip, and the relaxation length. Nothing is fitted
    to `hold_out`; without, every third second is held back. After the `budget` [s] the best so far is returned. `watch`
    is told the progress in words.
    Raises MissingExtraError: the extra `ros`; RunFolderError, BagError: a source that cannot be read, or a bag that
    lacks a channel; SettingsError: a drive that is too short, drives of several cars, or ones that do not excite what
    is to be found.
    """
    require_scipy()
    topics = {
        "pose_topic": pose_topic, "drive_topic": drive_topic, "imu_topic": imu_topic, "odometry_topic": odometry_topic
    }  # fmt: skip
    drives: tuple[list[Drive], list[Drive]] = ([], [])
    for count, source in enumerate((*sources, *hold_out), start=1):
        if watch is not None:
            watch(f"reading drive {count}/{len(sources) + len(hold_out)}")
        drives[count > len(sources)].extend(read_drives(source, vehicle=vehicle, columns=columns, **topics))
    return identify_drives(
        drives[0], hold_out=drives[1], linear=linear, single_track=single_track, budget=budget, watch=watch
    )


def read_drives(
    source: str | Path,
    *,
    vehicle: str | Path | Vehicle | None = None,
    columns: DriveColumns | Mapping[str, Any] | str | Path | None = None,
    **topics: str | None,
) -> list[Drive]:
    """Return the parts of the drive of a run folder, a CSV file or a bag; arguments and errors as in `identify`."""
    path = Path(source)
    assumed = Vehicle.load(vehicle or DEFAULT_VEHICLE)
    if kind_of(path) == "run":
        refuse_for_kind(path, "run", columns, topics)
        return [Drive.of_run(read_run(path), None if vehicle is None else assumed.parameters)]
    parts = recorded_drive(path, columns=columns, vehicle=assumed, **topics).parts()
    found, refused = [], []
    for part in parts:
        try:
            found.append(Drive.of_recorded(part, assumed.parameters, assumed.name))
        except SettingsError as error:  # the car stands in it
            refused.append(error)
    if not found:
        raise refused[0]
    return found


def read_bag_drive(
    path: Path,
    *,
    vehicle: str | Path | Vehicle | None = None,
    pose_topic: str | None = None,
    drive_topic: str | None = None,
    imu_topic: str | None = None,
    odometry_topic: str | None = None,
) -> RecordedDrive:
    """Return the drive of a bag; arguments and errors as of `drives.reading.read_drive`, which calls this."""
    wanted = {DRIVE: drive_topic, IMU: imu_topic, ODOMETRY: odometry_topic}
    car = Vehicle.load(vehicle or DEFAULT_VEHICLE).parameters
    with Recording(path) as bag, bag.blame():
        channels = _channels(bag, car, pose_topic, wanted)
        checked = {name: channels[name] for name in ("speed", "yaw_rate", "steering", "commanded", "pose")}
        files = sorted(path.iterdir()) if path.is_dir() else [path]  # of a folder in the order of their names
        return RecordedDrive(
            name=str(path), sha256=file_sha256(*files), layout="bag", beams=None, checks=check_drive(**checked),
            **channels,
        )  # fmt: skip


def _channels(
    bag: Recording, car: CarParameters, pose_topic: str | None, wanted: dict[str, str | None]
) -> dict[str, Any]:
    """Return the channels of a bag by the names that Drive has."""
    topics = {
        kind: bag.choose((kind,), wanted=wanted.get(kind), option=_OPTIONS.get(kind)) for kind in _KINDS
    }
    imus, mounting = bag.choose_imus(wanted=wanted[IMU], option=_OPTIONS[IMU]), bag.mounting_frames()
    poses = _pose_topic(bag, pose_topic, topics[ODOMETRY])
    rows: dict[str, list[tuple[Any, ...]]] = {
        name: [] for name in ("drive", "angle", "wheels", "speed", "motor", "gyro", "turn", "acceleration", "pose")
    }
    clocks: dict[Topic, Clock] = {}
    for heard in bag.messages({topic for topic in (*topics.values(), *imus, poses) if topic is not None}):
        kind, message = heard.topic[0], heard.message
        stamp = stamp_of(message)
        # [ns] a float of the seconds since 1970 would be too coarse
        time = stamp + clocks.setdefault(heard.topic, Clock()).shift(stamp, heard)[0]
        if heard.topic == poses:
            rows["pose"].append((time, *pose_of(message)))
        if kind == IMU:
            values = measured(heard, imus, mounting)
            rows["gyro"] += [(time, values[name][2]) for name in values if name == "angular_velocity"]
            rows["acceleration"] += [(time, *values[name][:2]) for name in values if name == "linear_acceleration"]
        if heard.topic != topics.get(kind):
            continue
        if kind == DRIVE:
            rows["drive"].append((time, message.drive.steering_angle, message.drive.speed))
        elif kind == ODOMETRY:
            rows["speed"].append((time, message.twist.twist.linear.x))
            rows["turn"].append((time, message.twist.twist.angular.z))
        elif kind == MOTOR:
            rows["motor"].append((time, message.state.speed / SPEED_TO_ERPM))
        elif kind == JOINTS:
            angle = _joints(message, (STEERING_JOINT,), message.position)
            rows["angle"] += [] if angle is None else [(time, *angle)]
            turning = _joints(message, _REAR, message.velocity)
            rows["wheels"] += [] if turning is None else [(time, car.wheel_radius * sum(turning) / len(turning))]
    # a sensor that failed says NaN
    rows = {name: [row for row in values if not any(map(math.isnan, row[1:]))] for name, values in rows.items()}
    for what, names in _NEEDED.items():
        if not any(len(rows[name]) > 1 for name in names):
            raise BagError(f"{bag.path}: has no {what}: it has {bag.held()}; accepted: {ACCEPTED}")
    first = min(values[0][0] for values in rows.values() if values)

    def channel(name: str, *names: str, columns: slice = slice(None)) -> Channel | None:
        found = next((rows[each] for each in names if len(rows[each]) > 1), None)
        if found is None:
            return None
        stamps, order = np.unique([row[0] - first for row in found], return_index=True)  # sorted, each once
        values = np.array([found[index][1:] for index in order], np.float64)[:, columns]
        return Channel(name=f"{bag.path}: {name}", time=stamps / 1e9, values=values)

    for (_, name), clock in clocks.items():
        for back, after in clock.set_back[:1]:
            bag.warn(f"the stamps on {name} go back by {back:.3g} s after {after:.1f} s; time goes on there")
    return {
        "steering": channel("steering", "drive", "angle", columns=slice(0, 1)),
        "speed_command": channel("speed command", "drive", columns=slice(1, 2)),
        "commanded": len(rows["drive"]) > 1,
        "speed": channel("wheel speed", "wheels", "speed", "motor"),
        "yaw_rate": channel("yaw rate", "gyro", "turn"),
        "acceleration": channel("acceleration", "acceleration"),
        "pose": channel("pose", "pose"),
    }


def _pose_topic(bag: Recording, wanted: str | None, odometry: Topic | None) -> Topic | None:
    """Return the topic of the poses, where there are any."""
    if wanted is not None:
        return bag.choose((*POSES, ODOMETRY), wanted=wanted)
    return bag.choose(POSES, option="--pose-topic", sparse=False) or odometry


def _joints(message: Any, names: Iterable[str], values: Any) -> list[float] | None:
    there = list(message.name)
    if any(name not in there or there.index(name) >= len(values) for name in names):
        return None
    return [float(values[there.index(name)]) for name in names]
