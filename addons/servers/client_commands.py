"""Commands and poses in messages that clients of a live race publish."""

from __future__ import annotations

import math
from typing import Any

from fg_mujoco.addons.ros.bag_messages import DRIVE, heading_of
from fg_mujoco.addons.ros.node_host.drive_topics import steering_of_twist
from fg_mujoco.messages import DriveCommand, shown

ACKERMANN, TWIST = "ackermann_msgs/msg/AckermannDrive", "geometry_msgs/msg/Twist"
TWIST_STAMPED = "geometry_msgs/msg/TwistStamped"

HELD = 0.5
"""[s] of wall time for which a command is held, unless another comes: as joysticks do on a car."""


def command_of(kind: str, message: Any, wheelbase: float) -> DriveCommand:
    """Return the command of a message of a type above, at a wheelbase [m]; raises where it has no finite numbers."""
    if kind in (TWIST, TWIST_STAMPED):
        twist = message if kind == TWIST else message.twist
        speed, turning = _number(twist.linear.x), _number(twist.angular.z)
        return DriveCommand(steering_angle=steering_of_twist(speed, turning, wheelbase), speed=speed)
    drive = message.drive if kind == DRIVE else message
    return DriveCommand(steering_angle=_number(drive.steering_angle), speed=_number(drive.speed))


def _number(value: Any) -> float:
    if isinstance(value, (bool, str)):
        raise TypeError(f"{shown(value)} is no number")
    return float(value)


def pose_of(message: Any) -> tuple[float, float, float]:
    """Return position [m] and heading [rad] of a PoseWithCovarianceStamped; errors as of `command_of`."""
    pose = message.pose.pose
    found = float(pose.position.x), float(pose.position.y), heading_of(pose.orientation)
    if not all(map(math.isfinite, found)):
        raise ValueError(f"the pose {found}")
    return found
