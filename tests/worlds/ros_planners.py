"""Nodes of ROS as planners in a corridor: their texts, what writes them, and what they command."""

from dataclasses import replace

from fg_mujoco.racing.planners import make_controller
from scan_worlds import CAR, corridor, odometry_of

SCAN, ODOMETRY = corridor(1.0, 1.0, 5.0), odometry_of(1.0)
ROS2 = """
import numpy as np
import rclpy
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from ackermann_msgs.msg import AckermannDriveStamped
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from nav_msgs.msg import MapMetaData, OccupancyGrid, Odometry
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Bool, Float32, Float32MultiArray, Int32

class Mine(Node):
    def __init__(self):
        super().__init__("mine")
        self.calls, self.order, self.got = 0, [], {}
        self.publisher = self.create_publisher(AckermannDriveStamped, "/drive", 10)
        self.create_subscription(LaserScan, "/scan", self.callback, 10)
"""
DRIVES = """
    def drive(self, speed, angle=0.0):
        message = AckermannDriveStamped()
        message.drive.speed, message.drive.steering_angle = speed, angle
        self.publisher.publish(message)
"""


def write(folder, text, name="mine.py"):
    """Write a file, and return what names it as a node."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / name).write_text(text)
    return f"ros:{folder / name}"


def indented(text, by):
    return "".join(f"{' ' * by}{line}\n" for line in text.splitlines())


def node2(folder, body, init="", more="", head=ROS2, name="mine.py"):
    """Write a node of ROS 2 whose callback of scans has a body, and return what names it."""
    callback = f"\n    def callback(self, message):\n{indented('self.calls += 1' + chr(10) + body, 8)}"
    return write(folder, f"{head}{indented(init, 8)}{more}{callback}{DRIVES}", name) + ":Mine"


def make(source, **settings):
    return make_controller(source, car=CAR, mu=1.0, max_speed=5.0, settings=settings)


def commands(planner, count, odometry=ODOMETRY):
    """Return the commands to scans 25 ms apart, as (speed, steering angle)."""
    found = [planner(replace(SCAN, stamp=0.025 * i), replace(odometry, stamp=0.025 * i)) for i in range(count)]
    return [(command.speed, command.steering_angle) for command in found]


def speeds(planner, count):
    return [speed for speed, _ in commands(planner, count)]
