"""Bags for the tests: messages as a robot's driver would fill them, and files of them by a library of their own."""

import math
import warnings
from pathlib import Path

import numpy as np

from fg_mujoco.addons.ros.bag_messages import type_store
from fg_mujoco.addons.ros.bag_reader import ScanBag
from fg_mujoco.vehicle.vehicle import Vehicle

CAR = Vehicle.load().parameters
SECOND = 1_000_000_000
EPOCH = 1_700_000_000 * SECOND


def read(path, *told, **options):
    """Return what a bag delivers, of which is told what has these texts, and nothing if there is none."""
    with warnings.catch_warnings(record=True) as warned, ScanBag(path, CAR, **options) as bag:
        warnings.simplefilter("always")
        found = list(bag)
    assert bool(told) == bool(warned)
    assert all(any(text in str(one.message) for one in warned) for text in told), [str(one.message) for one in warned]
    return found


def make(kind, **values):
    return type_store().types[kind](**values)


def header(time, frame):
    stamp = make("builtin_interfaces/msg/Time", sec=time // SECOND, nanosec=time % SECOND)
    return make("std_msgs/msg/Header", stamp=stamp, frame_id=frame)


def robot_scan(ranges, *, first=-2.0, step=0.1, time=0, frame="laser", **others):
    """A sensor_msgs/LaserScan; float32 in the file, whatever it is here."""
    values = {"angle_min": first, "angle_max": first + step * (len(ranges) - 1), "angle_increment": step,
              "time_increment": 0.0, "scan_time": 0.1, "range_min": 0.1, "range_max": 12.0}  # fmt: skip
    return make("sensor_msgs/msg/LaserScan", header=header(time, frame), ranges=np.asarray(ranges, np.float32),
                intensities=np.empty(0, np.float32), **(values | others))  # fmt: skip


def vector(x=0.0, y=0.0, z=0.0):
    return make("geometry_msgs/msg/Vector3", x=float(x), y=float(y), z=float(z))


def rotation(yaw=0.0, roll=0.0):
    """Roll, then yaw."""
    (s, c), (sr, cr) = ((math.sin(0.5 * angle), math.cos(0.5 * angle)) for angle in (yaw, roll))
    return make("geometry_msgs/msg/Quaternion", x=c * sr, y=s * sr, z=s * cr, w=c * cr)


def robot_odometry(time, *, x=0.0, y=0.0, yaw=0.0, speed=0.0, yaw_rate=0.0, frame="odom"):
    point = make("geometry_msgs/msg/Point", x=x, y=y, z=0.0)
    pose = make("geometry_msgs/msg/Pose", position=point, orientation=rotation(yaw))
    twist = make("geometry_msgs/msg/Twist", linear=vector(speed), angular=vector(z=yaw_rate))
    return make("nav_msgs/msg/Odometry", header=header(time, frame), child_frame_id="base_link",
                pose=make("geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=np.zeros(36)),
                twist=make("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=np.zeros(36)))  # fmt: skip


def robot_imu(time, turning, accelerating, yaw=0.0):
    """Of angular velocity and linear acceleration (3,)."""
    zeros = np.zeros(9)
    return make("sensor_msgs/msg/Imu", header=header(time, "imu"), orientation=rotation(yaw),
                orientation_covariance=zeros, angular_velocity=vector(*turning), angular_velocity_covariance=zeros,
                linear_acceleration=vector(*accelerating), linear_acceleration_covariance=zeros)  # fmt: skip


def transforms(time, *links):
    """A tf2_msgs/TFMessage of (parent, child, translation, rotation)."""

    def stamped(parent, child, translation, turned):
        by = make("geometry_msgs/msg/Transform", translation=translation, rotation=turned)
        return make(f"{by.__msgtype__}Stamped", header=header(time, parent), child_frame_id=child, transform=by)

    return make("tf2_msgs/msg/TFMessage", transforms=[stamped(*link) for link in links])


def write_bag(folder, entries, *, storage="MCAP", compression=None):
    """Write (topic, time [ns], message) by rosbags' own writer, as a folder with metadata.yaml, and return it.

    They are in the file in their order here. `compression`: FILE or MESSAGE.
    """
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

    store, connections = type_store(), {}
    writer = Writer(Path(folder), version=9, storage_plugin=StoragePlugin[storage])
    if compression:
        writer.set_compression(CompressionMode[compression], CompressionFormat.ZSTD)
    with writer:
        for topic, time, message in entries:
            kind = message.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(connections[topic], time, store.serialize_cdr(message, kind))
    return Path(folder)


def decoded(path):
    """Return (log time, message) by topic of an MCAP, as the MCAP organisation's ROS 2 support reads them."""
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    found = {}
    with open(path, "rb") as file:
        for _, channel, raw, message in make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages():
            found.setdefault(channel.topic, []).append((raw.log_time, message))
    return found
