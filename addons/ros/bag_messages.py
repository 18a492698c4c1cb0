"""ROS 2 messages of scans, odometry and commands, without ROS: their types, and how they are made.

Types and CDR are those of the package rosbags. Frames are as in REP 105: `map`, `odom`, `base_link` (rear axle), and
`laser` and `imu` where they are mounted; axes and units as in REP 103. Unknown values are as each message defines
them: a covariance of zeros, -1 in front where there is no estimate at all (sensor_msgs/Imu), an empty array.
"""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.errors import BagError, missing_extra
from fg_mujoco.lidar.point_cloud import point_cloud
from fg_mujoco.messages import DriveCommand, FloatArray, LaserScan, Odometry, Reading
from fg_mujoco.simulation.telemetry import recorded_command

SCAN, ODOMETRY = "sensor_msgs/msg/LaserScan", "nav_msgs/msg/Odometry"
IMU, JOINTS = "sensor_msgs/msg/Imu", "sensor_msgs/msg/JointState"
CLOUD, CLOUD_TOPIC = "sensor_msgs/msg/PointCloud2", "/livox/lidar"
DRIVE, TRANSFORMS = "ackermann_msgs/msg/AckermannDriveStamped", "tf2_msgs/msg/TFMessage"
CLOCK = "rosgraph_msgs/msg/Clock"
GRID, READING = "nav_msgs/msg/OccupancyGrid", "fg_mujoco_msgs/msg/Reading"
NUMBER, NUMBER_32 = "std_msgs/msg/Float64", "std_msgs/msg/Float32"
POSE, POSE_WITH_COVARIANCE = "geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/PoseWithCovarianceStamped"
MOTOR = "vesc_msgs/msg/VescStateStamped"
DRIVE_TOPICS = (
    "/drive", "/ego_racecar/drive", "/nav", "/vesc/low_level/ackermann_cmd_mux/input/navigation",
    "/vesc/ackermann_cmd_mux/input/navigation", "/vesc/high_level/ackermann_cmd_mux/input/nav_0", "/ackermann_cmd",
)  # fmt: skip
"""Topics of commands of f1tenth_system, f1tenth_gym_ros, f1tenth_simulator and the MIT racecar, the first before the
next."""
USUAL = {
    SCAN: ("/scan",), DRIVE: DRIVE_TOPICS, JOINTS: ("/joint_states",), MOTOR: ("/sensors/core", "/vesc/sensors/core"),
    IMU: ("/imu", "/imu/data", "/sensors/imu/raw"),
    ODOMETRY: ("/odom", "/ego_racecar/odom", "/vesc/odom", "/pf/pose/odom"),
}  # fmt: skip
"""Type -> the topics that nodes get and publish, the first before the next."""

MAP_FRAME, ODOM_FRAME, BASE_FRAME, LASER_FRAME, IMU_FRAME = "map", "odom", "base_link", "laser", "imu"
STEERING_JOINT = "steering"
WHEEL_JOINTS = ("front_left_wheel", "front_right_wheel", "rear_left_wheel", "rear_right_wheel")

_OTHERS = {  # our own, and those of the package ackermann_msgs, which no release of ROS has in its core
    READING: "std_msgs/Header header\nstring[] names\nfloat64[] values\n",
    DRIVE: "std_msgs/Header header\nackermann_msgs/AckermannDrive drive\n",
    "ackermann_msgs/msg/AckermannDrive": (
        "float32 steering_angle\nfloat32 steering_angle_velocity\nfloat32 speed\nfloat32 acceleration\nfloat32 jerk\n"
    ),
}
_NANOSECONDS = 1_000_000_000
_ENCODINGS = {
    bytes((0, number)): name
    for name, numbers in {"PL_CDR": (2, 3), "XCDR2": (*range(6, 12), *range(16, 22))}.items()
    for number in numbers
}
"""First bytes of a message -> its encoding. Source: DDS-XTypes 1.3, tables 60 and 39, which disagree."""


_FAULTS = ("NONE", "OVER_VOLTAGE", "UNDER_VOLTAGE", "DRV8302", "ABS_OVER_CURRENT", "OVER_TEMP_FET", "OVER_TEMP_MOTOR")
_VESC_FIELDS = (
    "float64", ("temp_fet temp_motor current_motor current_input avg_id avg_iq duty_cycle speed voltage_input "
    "charge_drawn charge_regen energy_drawn energy_regen"), "int32", "displacement distance_traveled fault_code",
    "float64", "pid_pos_now", "int32", "controller_id",
    "float64", "ntc_temp_mos1 ntc_temp_mos2 ntc_temp_mos3 avg_vd avg_vq",
)  # fmt: skip
"""Fields of a VescState: types, each with the names that have it. Source: the VESC's driver in f1tenth_system."""


def _vesc_definitions() -> dict[str, str]:
    """Return the definitions of the messages of the VESC's driver in ROS 2."""
    lines = [f"int32 FAULT_CODE_{name}={number}" for number, name in enumerate(_FAULTS)]
    for kind, names in zip(_VESC_FIELDS[::2], _VESC_FIELDS[1::2], strict=True):
        lines += [f"{kind} {name}" for name in names.split()]
    return {
        "vesc_msgs/msg/VescStateStamped": "std_msgs/Header header\nvesc_msgs/VescState state\n",
        "vesc_msgs/msg/VescState": "\n".join(lines) + "\n",
        "vesc_msgs/msg/VescImuStamped": "std_msgs/Header header\nvesc_msgs/VescImu imu\n",
        "vesc_msgs/msg/VescImu": (
            "geometry_msgs/Vector3 ypr\ngeometry_msgs/Vector3 linear_acceleration\n"
            "geometry_msgs/Vector3 angular_velocity\ngeometry_msgs/Vector3 compass\n"
            "geometry_msgs/Quaternion orientation\n"
        ),
    }


def require_ros_extra() -> None:
    """Make sure that bags can be read and written; MissingExtraError: a part of the extra `ros` is not installed."""
    if any(importlib.util.find_spec(name) is None for name in ("mcap", "rosbags", "scipy")):
        raise missing_extra("ROS bags need mcap, rosbags and SciPy", "ros")


@lru_cache(maxsize=4)
def type_store(distribution: str = "") -> Any:
    """Return the types of a distribution of ROS 2, those of Humble by default; MissingExtraError: the extra `ros`."""
    require_ros_extra()
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(getattr(Stores, f"ROS2_{distribution.upper()}", Stores.ROS2_HUMBLE))
    for name, text in (_OTHERS | _vesc_definitions()).items():
        store.register(get_types_from_msg(text, name))
    return store


def definition(kind: str) -> str:
    """Return the definition of a type and of its parts, as `ros2 bag` stores it with the messages."""
    text: str = type_store().generate_msgdef(kind, ros_version=2)[0]
    return text


def to_cdr(message: Any) -> bytes:
    """Return a message as a robot would send it: little-endian CDR."""
    return bytes(type_store().serialize_cdr(message, message.__msgtype__))


def from_cdr(content: bytes, kind: str, store: Any = None) -> Any:
    """Return the message of a type that CDR has, without padding behind it; BagError: another encoding than XCDR1."""
    encoding = _ENCODINGS.get(bytes(content[:2]))
    if encoding is not None:
        raise BagError(f"{kind} is written in {encoding}; accepted: XCDR1, as ROS 2 writes it")
    store = store or type_store()
    for padding in (0, 4):  # rosbags itself leaves out three
        try:
            return store.deserialize_cdr(content[: len(content) - padding], kind)
        except Exception as error:  # one of its own, of which the type says nothing
            if "size mismatch" not in str(error):
                raise
    return store.deserialize_cdr(content[:-8], kind)


def nanoseconds(seconds: float) -> int:
    """Return a time in whole nanoseconds."""
    return round(seconds * _NANOSECONDS)


def stamp_of(message: Any) -> int:
    """Return the time in a message's header [ns]."""
    return int(message.header.stamp.sec) * _NANOSECONDS + int(message.header.stamp.nanosec)


def measures(imu: Any, quantity: str) -> bool:
    """Return whether a sensor_msgs/Imu measures a quantity; else its covariance begins with -1, as it is defined."""
    return float(getattr(imu, f"{quantity}_covariance")[0]) != -1.0


def scan_message(scan: LaserScan, frame: str = LASER_FRAME) -> Any:
    """Return sensor_msgs/LaserScan. Its stamp is that of the first beam, ours that of the last."""
    first = scan.stamp - scan.time_increment * (len(scan.ranges) - 1)
    return _make(
        SCAN,
        header=_header(nanoseconds(first), frame),
        angle_min=scan.angle_min,
        angle_max=scan.angle_max,
        angle_increment=scan.angle_increment,
        time_increment=scan.time_increment,
        scan_time=scan.scan_time,
        range_min=scan.range_min,
        range_max=scan.range_max,
        ranges=scan.ranges.astype(np.float32),
        intensities=np.empty(0, np.float32),
    )


def odometry_message(
    odometry: Odometry,
    position: FloatArray,
    quaternion: FloatArray,
    lateral_speed: float,
    *,
    frame: str = ODOM_FRAME,
    child: str = BASE_FRAME,
) -> Any:
    """Return nav_msgs/Odometry: the true pose, the wheels' mean speed, and the gyro's turning rate.

    Position (3,) [m] and quaternion (4,) wxyz are of base_link in the world, `lateral_speed` [m/s] is over the ground,
    left positive; the pose is in `frame`, and `child` is the car's.
    """
    unknown = np.zeros(36)
    twist = _make("geometry_msgs/msg/Twist", linear=_vector((odometry.speed, lateral_speed, 0.0)),
                  angular=_vector(odometry.angular_velocity))  # fmt: skip
    return _make(
        ODOMETRY,
        header=_header(nanoseconds(odometry.stamp), frame),
        child_frame_id=child,
        pose=_make("geometry_msgs/msg/PoseWithCovariance", pose=_pose(position, quaternion), covariance=unknown),
        twist=_make("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=unknown),
    )


def as_imu_tells(odometry: Odometry) -> Odometry:
    """Return an odometry whose stamp, gyro and accelerometer are those of the car's sensor `imu`, if it has one."""
    told = odometry.readings.get("imu")
    if told is None or not told.received or len(told.values) != 6:
        return odometry
    gyro, accelerometer = told.values[:3], told.values[3:]
    return replace(odometry, stamp=told.stamp, angular_velocity=gyro, linear_acceleration=accelerometer)


def imu_message(odometry: Odometry, frame: str = IMU_FRAME) -> Any:
    """Return sensor_msgs/Imu: gyro and accelerometer, and no orientation, which they do not measure."""
    odometry = as_imu_tells(odometry)
    none = np.zeros(9)
    none[0] = -1.0
    return _make(
        IMU,
        header=_header(nanoseconds(odometry.stamp), frame),
        orientation=_quaternion((1.0, 0.0, 0.0, 0.0)),
        orientation_covariance=none,
        angular_velocity=_vector(odometry.angular_velocity),
        angular_velocity_covariance=np.zeros(9),
        linear_acceleration=_vector(odometry.linear_acceleration),
        linear_acceleration_covariance=np.zeros(9),
    )


def joints_message(odometry: Odometry, wheel_radius: float, frame: str = BASE_FRAME) -> Any:
    """Return sensor_msgs/JointState: the steering angle [rad], and how fast each wheel turns [rad/s]."""
    turning = odometry.wheel_speeds / wheel_radius
    nan = np.full(len(WHEEL_JOINTS), math.nan)
    return _make(
        JOINTS,
        header=_header(nanoseconds(odometry.stamp), frame),
        name=[STEERING_JOINT, *WHEEL_JOINTS],
        position=np.concatenate(([odometry.steering_angle], nan)),
        velocity=np.concatenate(([math.nan], turning)),
        effort=np.empty(0),
    )


def reading_messages(reading: Reading, frame: str) -> list[Any]:
    """Return READING messages of all that a sensor delivered since the last tick, each stamped when it was measured."""
    return [
        _make(READING, header=_header(nanoseconds(stamp), frame), names=list(reading.columns), values=values)
        for stamp, values in zip(reading.stamps.tolist(), reading.samples, strict=True)
    ]


def cloud_parts(values: FloatArray, end: int) -> tuple[int, list[dict[str, Any]], dict[str, Any]]:
    """Return the time of the first point [ns], and fields and other values of a PointCloud2 as livox_ros_driver2's.

    Args:
      values: of a reading of a Mid360.
      end: of the frame [ns].
    """
    points = point_cloud(values, float(end))
    kinds = {"<f4": 7, "|u1": 2, "<f8": 8}  # of sensor_msgs/PointField
    fields = [
        {"name": name, "offset": int(offset), "datatype": kinds[kind.str], "count": 1}
        for name, (kind, offset, *_) in (points.dtype.fields or {}).items()
    ]
    return int(points["timestamp"][0]), fields, {
        "height": 1, "width": len(points), "point_step": points.itemsize, "row_step": points.nbytes,
        "is_bigendian": False, "is_dense": True, "data": np.frombuffer(points.tobytes(), np.uint8),
    }  # fmt: skip


def cloud_messages(reading: Reading, frame: str) -> list[Any]:
    """Return sensor_msgs/PointCloud2 of all frames that a Mid360 delivered since the last tick."""
    messages = []
    for stamp, values in zip(reading.stamps.tolist(), reading.samples, strict=True):
        first, fields, parts = cloud_parts(values, nanoseconds(stamp))
        made = [_make("sensor_msgs/msg/PointField", **field) for field in fields]
        messages.append(_make(CLOUD, header=_header(first, frame), fields=made, **parts))
    return messages


def drive_message(command: DriveCommand, time: int, frame: str = BASE_FRAME) -> Any:
    """Return ackermann_msgs/AckermannDriveStamped at `time` [ns], with the telemetry's 32 bits; its rates are 0."""
    command = recorded_command(command)
    drive = _make(
        "ackermann_msgs/msg/AckermannDrive", steering_angle=command.steering_angle, steering_angle_velocity=0.0,
        speed=command.speed, acceleration=0.0, jerk=0.0,
    )  # fmt: skip
    return _make(DRIVE, header=_header(time, frame), drive=drive)


def transform_message(time: int, transforms: Sequence[tuple[str, str, FloatArray, FloatArray]]) -> Any:
    """Return tf2_msgs/TFMessage, at `time` [ns], of (parent frame, child frame, position (3,) [m], quaternion wxyz)."""
    return _make(
        TRANSFORMS,
        transforms=[
            _make(
                "geometry_msgs/msg/TransformStamped",
                header=_header(time, parent),
                child_frame_id=child,
                transform=_make(
                    "geometry_msgs/msg/Transform", translation=_vector(position), rotation=_quaternion(quaternion)
                ),
            )
            for parent, child, position, quaternion in transforms
        ],
    )


def grid_message(time: int, cells: NDArray[np.int8], resolution: float, origin: FloatArray) -> Any:
    """Return nav_msgs/OccupancyGrid of cells (rows, columns), row 0 below: 0 free, 100 occupied, -1 unknown.

    `time` is in [ns], and `origin` (2,) [m] the lower left corner of the first cell in the map frame.
    """
    rows, columns = cells.shape
    info = _make(
        "nav_msgs/msg/MapMetaData",
        map_load_time=_time(time),
        resolution=resolution,
        width=columns,
        height=rows,
        origin=_pose(np.append(origin, 0.0), np.array((1.0, 0.0, 0.0, 0.0))),
    )
    return _make(GRID, header=_header(time, MAP_FRAME), info=info, data=cells.astype(np.int8).ravel())


def clock_message(time: int) -> Any:
    """Return rosgraph_msgs/Clock at `time` [ns]."""
    return _make(CLOCK, clock=_time(time))


def heading_of(quaternion: Any) -> float:
    """Return the heading [rad] of a geometry_msgs/Quaternion."""
    x, y, z, w = quaternion.x, quaternion.y, quaternion.z, quaternion.w
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def _make(kind: str, **values: Any) -> Any:
    return type_store().types[kind](**values)


def _time(time: int) -> Any:
    sec, nanosec = divmod(time, _NANOSECONDS)
    return _make("builtin_interfaces/msg/Time", sec=sec, nanosec=nanosec)


def _header(time: int, frame: str) -> Any:
    return _make("std_msgs/msg/Header", stamp=_time(time), frame_id=frame)


def _vector(values: Any) -> Any:
    x, y, z = map(float, values)
    return _make("geometry_msgs/msg/Vector3", x=x, y=y, z=z)


def _quaternion(wxyz: Any) -> Any:
    w, x, y, z = map(float, wxyz)
    return _make("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w)


def _pose(position: FloatArray, quaternion: FloatArray) -> Any:
    x, y, z = map(float, position)
    return _make(
        "geometry_msgs/msg/Pose", position=_make("geometry_msgs/msg/Point", x=x, y=y, z=z),
        orientation=_quaternion(quaternion),
    )  # fmt: skip
