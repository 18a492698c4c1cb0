"""Messages of what the car senses, under the names of f1tenth_gym_ros and f1tenth_system.

Only those are made that a node listens to. Frames are `map`, `odom`, `base_link` and `laser`, and those of
f1tenth_gym_ros, `ego_racecar/base_link` and `ego_racecar/laser`, which lie on them.
"""

from __future__ import annotations

import array
import math
from collections.abc import Iterator
from functools import lru_cache
from typing import Any

import numpy as np

from ...messages import CarParameters, LaserScan, Odometry
from ..bag_messages import BASE_FRAME, IMU_FRAME, LASER_FRAME, MAP_FRAME, ODOM_FRAME, nanoseconds
from .graph import BEGIN, Graph
from .messages import ROS1, made, message_class
from .rospy_times import NANOSECONDS, RosTime
from .transform_modules import matrix

TOPICS: dict[str, tuple[str, str]] = {
    "/clock": ("rosgraph_msgs/msg/Clock", "clock"),
    "/tf": ("tf2_msgs/msg/TFMessage", "transforms"),
    "/imu": ("sensor_msgs/msg/Imu", "imu"),
    "/imu/data": ("sensor_msgs/msg/Imu", "imu"),
    "/sensors/imu/raw": ("sensor_msgs/msg/Imu", "imu"),
    "/odom": ("nav_msgs/msg/Odometry", "odometry"),
    "/ego_racecar/odom": ("nav_msgs/msg/Odometry", "odometry"),
    "/vesc/odom": ("nav_msgs/msg/Odometry", "odometry"),
    "/pf/pose/odom": ("nav_msgs/msg/Odometry", "odometry"),
    "/pf/viz/inferred_pose": ("geometry_msgs/msg/PoseStamped", "pose"),
    "/gt_pose": ("geometry_msgs/msg/PoseStamped", "pose"),
    "/scan": ("sensor_msgs/msg/LaserScan", "scan"),
}
"""What is published each tick, in this order: type, and the method that makes it."""

_EGO = "ego_racecar/"
_UPRIGHT = (0.0, 0.0, 0.0, 1.0)


class Sensing:
    """Makes the messages of one planner's nodes.

    Args:
      graph: who listens.
      flavour: of the messages.
      car: whose LiDAR is ahead of the rear axle.
    """

    def __init__(self, graph: Graph, flavour: int, car: CarParameters) -> None:
        self._graph, self._flavour = graph, flavour
        self._pose = np.zeros(3)  # by dead reckoning, where there is no map
        self._before: float | None = None
        mount = matrix((car.lidar_offset, 0.0, 0.0), _UPRIGHT)
        for child, parent, found in (
            (LASER_FRAME, BASE_FRAME, mount), (_EGO + LASER_FRAME, _EGO + BASE_FRAME, mount),
            (ODOM_FRAME, MAP_FRAME, np.eye(4)),
        ):  # fmt: skip
            graph.transforms[child] = parent, found

    def messages(self, scan: LaserScan, odometry: Odometry) -> Iterator[tuple[str, Any]]:
        """Make the messages of one tick, in the order of TOPICS, and take the pose as the newest transform."""
        self._scan, self._odometry = scan, odometry
        self._move()
        x, y, heading = self._pose.tolist()
        self._at = x, y, math.sin(heading / 2), math.cos(heading / 2)
        found = matrix((x, y, 0.0), (0.0, 0.0, self._at[2], self._at[3]))
        self._graph.transforms[BASE_FRAME] = ODOM_FRAME, found
        self._graph.transforms[_EGO + BASE_FRAME] = MAP_FRAME, found
        made_already: dict[str, Any] = {}
        for topic, (_, maker) in TOPICS.items():
            if self._graph.listens(topic):
                if maker not in made_already:
                    made_already[maker] = getattr(self, f"_make_{maker}")()
                yield topic, made_already[maker] if maker == "scan" else made_already[maker].__deepcopy__({})

    def _move(self) -> None:
        """Take the pose that the planner is told, or reckon it from speed and yaw rate."""
        told, stamp = self._odometry.pose, self._odometry.stamp
        if not np.isnan(told).any():
            self._pose = told
        elif self._before is not None:
            x, y, heading = self._pose.tolist()
            passed, speed = stamp - self._before, self._odometry.speed
            turned = self._odometry.yaw_rate * passed
            along = heading + turned / 2
            self._pose = np.array(
                (x + speed * passed * math.cos(along), y + speed * passed * math.sin(along), heading + turned)
            )
        self._before = stamp

    def _make_scan(self) -> Any:
        scan = self._scan
        numbers = array.array("f")
        numbers.frombytes(scan.ranges.astype(np.float32).tobytes())
        first = scan.stamp - scan.time_increment * max(0, len(scan.ranges) - 1)
        names = ("angle_min", "angle_max", "angle_increment", "time_increment", "scan_time", "range_min", "range_max")
        return made(
            self._kind("sensor_msgs/msg/LaserScan"),
            header=self._header(first, LASER_FRAME),
            ranges=tuple(numbers) if self._flavour == ROS1 else numbers,
            **{name: _single(getattr(scan, name)) for name in names},
        )

    def _make_odometry(self) -> Any:
        twist = made(
            self._kind("geometry_msgs/msg/Twist"), linear=self._vector((self._odometry.speed, 0.0, 0.0)),
            angular=self._vector((0.0, 0.0, self._odometry.yaw_rate)),
        )  # fmt: skip
        return made(
            self._kind("nav_msgs/msg/Odometry"),
            header=self._header(self._odometry.stamp, ODOM_FRAME),
            child_frame_id=BASE_FRAME,
            pose=made(self._kind("geometry_msgs/msg/PoseWithCovariance"), pose=self._make_plain_pose()),
            twist=made(self._kind("geometry_msgs/msg/TwistWithCovariance"), twist=twist),
        )

    def _make_pose(self) -> Any:
        return made(
            self._kind("geometry_msgs/msg/PoseStamped"), header=self._header(self._odometry.stamp, MAP_FRAME),
            pose=self._make_plain_pose(),
        )  # fmt: skip

    def _make_plain_pose(self) -> Any:
        x, y, qz, qw = self._at
        return made(
            self._kind("geometry_msgs/msg/Pose"),
            position=made(self._kind("geometry_msgs/msg/Point"), x=x, y=y, z=0.0),
            orientation=made(self._kind("geometry_msgs/msg/Quaternion"), x=0.0, y=0.0, z=qz, w=qw),
        )

    def _make_imu(self) -> Any:
        message = made(
            self._kind("sensor_msgs/msg/Imu"), header=self._header(self._odometry.stamp, IMU_FRAME),
            angular_velocity=self._vector(self._odometry.angular_velocity),
            linear_acceleration=self._vector(self._odometry.linear_acceleration),
        )  # fmt: skip
        message.orientation_covariance[0] = -1.0  # there is no estimate
        return message

    def _make_clock(self) -> Any:
        return made(self._kind("rosgraph_msgs/msg/Clock"), clock=self._time(self._odometry.stamp))

    def _make_transforms(self) -> Any:
        x, y, qz, qw = self._at
        quaternion = self._kind("geometry_msgs/msg/Quaternion")
        moved = made(
            self._kind("geometry_msgs/msg/Transform"), translation=self._vector((x, y, 0.0)),
            rotation=made(quaternion, x=0.0, y=0.0, z=qz, w=qw),
        )  # fmt: skip
        stamped = self._kind("geometry_msgs/msg/TransformStamped")
        return made(
            self._kind("tf2_msgs/msg/TFMessage"),
            transforms=[
                made(stamped, header=self._header(self._odometry.stamp, parent), child_frame_id=child,
                     transform=moved.__deepcopy__({}))
                for parent, child in ((ODOM_FRAME, BASE_FRAME), (MAP_FRAME, _EGO + BASE_FRAME))
            ],
        )  # fmt: skip

    def _kind(self, name: str) -> Any:
        return message_class(name, self._flavour)

    def _header(self, stamp: float, frame: str) -> Any:
        return made(self._kind("std_msgs/msg/Header"), stamp=self._time(stamp), frame_id=frame)

    def _time(self, stamp: float) -> Any:
        time = BEGIN + nanoseconds(stamp)
        if self._flavour == ROS1:
            return RosTime.from_nanoseconds(time)
        sec, nanosec = divmod(time, NANOSECONDS)
        return made(self._kind("builtin_interfaces/msg/Time"), sec=sec, nanosec=nanosec)

    def _vector(self, values: Any) -> Any:
        x, y, z = map(float, values)
        return made(self._kind("geometry_msgs/msg/Vector3"), x=x, y=y, z=z)


@lru_cache(maxsize=64)
def _single(value: float) -> float:
    """Return a number as a field of 32 bits has it."""
    return float(np.float32(value))
