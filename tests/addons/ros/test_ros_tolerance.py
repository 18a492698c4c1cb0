"""What nodes may do here, as in ROS: a single NaN, NumPy's scalars, brakes, private names, nodes that fail or end."""

import math
import re
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cases import each
from fg_mujoco.addons.ros.node_host.graph import NodeError
from fg_mujoco.errors import ControllerError
from ros_planners import ODOMETRY, ROS2, commands, make, node2, speeds, write

# Commands that are no numbers


@each("bad", ["float('nan')", "2.0, float('nan')", "2.0, float('inf')", "2.0, 1e300"])
def test_one_command_that_is_no_number_holds_the_last_with_a_warning(bad, tmp_path):
    planner = make(node2(tmp_path, f"self.drive({bad}) if self.calls == 3 else self.drive(1.0 + self.calls / 10, 0.1)"))
    with pytest.warns(UserWarning,
                      match=r"has published \w+ .* on /drive \(.*mine.py, line 16\).*last command is held"):
        found = commands(planner, 4)
    assert found[2] == found[1] == pytest.approx((1.2, 0.1), abs=1e-6)
    assert found[3][0] == pytest.approx(1.4, abs=1e-6)


def test_ten_commands_in_a_row_that_are_no_numbers_fail(tmp_path):
    planner = make(node2(tmp_path, "self.drive(float('nan') if self.calls > 1 else 1.0)"))
    with pytest.warns(UserWarning, match="the last command is held"):
        assert speeds(planner, 10) == [1.0] * 10
    with pytest.raises(NodeError, match=r"has published speed nan on /drive .*, 10 times in a row; accepted"):
        commands(planner, 12)


# Nodes that fail, and nodes that end


BROKEN = """
import rclpy
from rclpy.node import Node
rclpy.init()
node = Node("broken")
open("/a/folder/that/is/not/here")
node.declare_parameter("line", "")
"""


@each("entry", ["parameters: {line: a.csv}", "params_file: params.yaml", "args: --ros-args -p line:=a.csv"])
def test_parameters_of_a_node_that_has_failed_at_its_start_refuse_no_race(entry, tmp_path):
    write(tmp_path, BROKEN, "broken.py")
    write(tmp_path, "/**: {ros__parameters: {line: a.csv}}", "params.yaml")
    node2(tmp_path, "self.drive(1.5)")
    launch = f"nodes: [{{file: broken.py, name: broken, {entry}}}, {{file: mine.py, class: Mine}}]"
    source = write(tmp_path, launch, "launch.yaml")
    with pytest.warns(UserWarning, match=r"'broken' has failed: FileNotFoundError.*line 6\); the other nodes drive on"):
        assert speeds(make(source, line="b.csv"), 2) == [1.5, 1.5]
    with (pytest.warns(UserWarning, match="has failed"),
          pytest.raises(ControllerError, match=r"launch.yaml has no parameter 'lime'; accepted")):  # fmt: skip
        make(source, lime="b.csv")


@each("ends", ["rclpy.shutdown()", "raise SystemExit", "raise KeyboardInterrupt"])
def test_a_node_that_ends_by_itself_has_ended_and_the_car_stops(ends, tmp_path):
    text = node2(tmp_path, f"self.drive(1.5)\nif self.calls == 3: {ends}", head=f"import rclpy\n{ROS2}")
    source = write(tmp_path, Path(text[4:-5]).read_text() + "rclpy.init()\nrclpy.spin(Mine())\n", "ends.py")
    planner = make(source)
    with pytest.warns(UserWarning, match=r"node 'ends' has ended, t = 0.050 s; the car stops") as caught:
        assert speeds(planner, 6) == [1.5, 1.5, 0.0, 0.0, 0.0, 0.0]
    assert len(caught) == 1
    planner.reset()
    with pytest.warns(UserWarning, match="the car stops"):
        assert speeds(planner, 3) == [1.5, 1.5, 0.0]


# Scalars of NumPy in messages


def test_scalars_of_numpy_are_taken_with_one_warning(tmp_path):
    body = """
self.drive(np.float32(1.5), np.array(0.25))
assert Int32(data=np.int64(3)).data == 3 and Bool(data=np.bool_(True)).data is True
assert list(Float32MultiArray(data=[np.float32(1.0), 2.0]).data) == [1.0, 2.0]
"""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        assert commands(make(node2(tmp_path, body)), 3)[-1] == (1.5, 0.25)
    said = [str(each.message) for each in caught if "scalar of NumPy" in str(each.message)]
    assert len(said) == 1
    assert re.search(r"AckermannDrive.speed is .*1.5.* of type float32, .*mine.py, line \d+\); it is taken here",
                     said[0])  # fmt: skip


# Brakes


@each("topic", ["/brake_bool", "/emergency_brake"])
def test_a_switch_of_a_brake_overrides_the_drive_topic_from_true_to_false(topic, tmp_path):
    source = node2(tmp_path, "self.drive(2.0, 0.2)\nself.brake.publish(Bool(data=3 <= self.calls < 6))",
                   f"self.brake = self.create_publisher(Bool, '{topic}', 1)")  # fmt: skip
    found = commands(make(source), 7)
    assert [speed for speed, _ in found] == [2.0, 2.0, 0.0, 0.0, 0.0, 2.0, 2.0]
    assert {round(angle, 6) for _, angle in found} == {0.2}


def test_a_command_on_brake_overrides_the_drive_topic_for_a_fifth_of_a_second(tmp_path):
    source = node2(tmp_path, "self.drive(2.0)\nif self.calls == 3: self.brake.publish(AckermannDriveStamped())",
                   "self.brake = self.create_publisher(AckermannDriveStamped, '/brake', 1)")  # fmt: skip
    assert speeds(make(source), 12) == [2.0] * 2 + [0.0] * 8 + [2.0] * 2


# The order of a tick, poses of any name, names that rclpy keeps for itself


def test_scans_are_delivered_before_odometry_and_poses(tmp_path):
    init = "kinds = {'/odom': Odometry, '/gt_pose': PoseStamped, '/amcl_pose': PoseWithCovarianceStamped}\n"
    init += "for topic, kind in kinds.items():\n"
    init += "    self.create_subscription(kind, topic, lambda m: self.order.append(type(m).__name__), 1)"
    body = "told = ['Odometry', 'PoseStamped', 'PoseWithCovarianceStamped'] if self.calls > 1 else []\n"
    body += "assert self.order == told, self.order\n"
    body += "self.order.clear()\nself.drive(1.0)"
    assert speeds(make(node2(tmp_path, body, init)), 3) == [1.0] * 3


@each("topic", ["/my_localization", "/pf/estimate", "/pf/viz/inferred_pose", "/odom"])
def test_poses_with_covariance_come_on_a_topic_of_any_name(topic, tmp_path):
    init = f"self.create_subscription(PoseWithCovarianceStamped, '{topic}', self.pose, 1)\n"
    init += "self.create_subscription(PoseWithCovarianceStamped, '/initialpose', lambda m: 1 / 0, 1)"
    more = "\n    def pose(self, message):\n        self.drive(message.pose.pose.position.x)\n"
    planner = make(node2(tmp_path, "pass", init, more))
    with pytest.warns(UserWarning, match=rf"{topic} (has no publisher|is \S+) here, and is taken for /amcl_pose"):
        assert commands(planner, 1, replace(ODOMETRY, pose=np.array((3.0, 4.0, math.pi / 2))))[0][0] == 3.0


# Points and images


def test_messages_of_sensors_are_converted_as_their_packages_do(tmp_path):
    body = """
import numpy as np
from sensor_msgs_py import point_cloud2 as pc2
from control_msgs.msg import JointControllerState, JointTrajectoryControllerState
from cv_bridge import CvBridge
from geometry_msgs.msg import TransformStamped
from laser_geometry import LaserProjection
from std_msgs.msg import Header
from tf2_sensor_msgs.tf2_sensor_msgs import do_transform_cloud
ranges = np.array(message.ranges)
cloud = LaserProjection().projectLaser(message, range_cutoff=2.0)
points = list(pc2.read_points(cloud, field_names=("x", "y", "index")))
assert len(points) == np.count_nonzero(ranges < 2.0) and [each.name for each in cloud.fields][:3] == ["x", "y", "z"]
assert all(abs(np.hypot(x, y) - ranges[i]) < 1e-5 for x, y, i in points)
assert all(abs(np.arctan2(y, x) - message.angle_min - message.angle_increment * i) < 1e-5 for x, y, i in points)
made = pc2.create_cloud_xyz32(Header(), [(1.0, 2.0, 3.0), (np.nan, 5.0, 6.0)])
assert (made.width, made.point_step, len(list(pc2.read_points(made, skip_nans=True)))) == (2, 12, 1)
by = TransformStamped()
by.transform.translation.x, by.transform.rotation.z, by.transform.rotation.w = 1.0, 1.0, 0.0  # half a turn
assert pc2.read_points_list(do_transform_cloud(made, by))[0] == (0.0, -2.0, 3.0)
image, bridge = np.arange(24, dtype=np.uint8).reshape(2, 4, 3), CvBridge()
sent = bridge.cv2_to_imgmsg(image, "bgr8")
assert (sent.height, sent.width, sent.step) == (2, 4, 12) and np.array_equal(bridge.imgmsg_to_cv2(sent), image)
assert np.array_equal(bridge.imgmsg_to_cv2(sent, "rgb8"), image[..., ::-1])
assert bridge.cv2_to_imgmsg(np.ones((2, 2), np.float32)).encoding == "32FC1"
assert JointControllerState().set_point == 0.0 and JointTrajectoryControllerState().desired.positions is not None
self.drive(1.0)
"""
    assert speeds(make(node2(tmp_path, body)), 2) == [1.0, 1.0]


# Lifecycle nodes

LIFECYCLE = """
import rclpy
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from ackermann_msgs.msg import AckermannDriveStamped
from sensor_msgs.msg import LaserScan

class Mine(LifecycleNode):
    def __init__(self):
        super().__init__("mine")
        self.declare_parameter("speed", 1.5)

    def on_configure(self, state: LifecycleState):
        self.publisher = self.create_lifecycle_publisher(AckermannDriveStamped, "/drive", 1)
        self.create_subscription(LaserScan, "/scan", self.callback, 1)
        self.publisher.publish(AckermannDriveStamped())  # is not heard
        return TransitionCallbackReturn.SUCCESS

    def on_activate(self, state):
        assert state.label == "inactive" and not self.publisher.is_activated
        return super().on_activate(state)

    def callback(self, message):
        out = AckermannDriveStamped()
        out.drive.speed = self.get_parameter("speed").value
        self.publisher.publish(out)

def main():
    rclpy.init()
    rclpy.spin(Mine())
"""


def test_a_lifecycle_node_is_configured_and_activated_when_it_is_spun(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(LIFECYCLE)
    assert speeds(make(f"ros:{path}", speed=2.0), 2) == [2.0, 2.0]
    path.write_text(LIFECYCLE.replace("return super().on_activate(state)", "return TransitionCallbackReturn.FAILURE"))
    with pytest.raises(Exception, match="lifecycle node 'mine' does not activate: on_activate has not"):
        make(f"ros:{path}")


# The beams of f1tenth_gym_ros


def test_a_node_for_1080_beams_is_told_of_the_setting_and_drives_with_it(tmp_path):
    source = node2(tmp_path, "self.drive(float((np.array(message.ranges) + np.ones(1080))[540]))")
    told = pytest.warns(UserWarning, match=r"written for the 1080 beams of f1tenth_gym_ros.*\[host.beams=1080\]")
    with told, pytest.raises(ValueError, match="1081"):
        commands(make(source), 1)
    assert speeds(make(source, **{"host.beams": 1080}), 1)[0] > 1.0
    body = "angles = message.angle_min + message.angle_increment * np.arange(len(message.ranges))\n"
    wall = node2(tmp_path, body + "self.drive(float(np.array(message.ranges)[np.argmin(abs(angles - np.pi / 2))]))")
    assert speeds(make(wall, **{"host.beams": 720}), 1)[0] == pytest.approx(speeds(make(wall), 1)[0], abs=1e-3)
    with pytest.raises(Exception, match=r"host\.beams is 1; accepted: a whole number from 2"):
        make(source, **{"host.beams": 1})
