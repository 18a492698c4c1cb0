"""Nodes of ROS as planners: those of the folder ros_nodes, unedited, on the oval; and what each mistake is told."""

import array
import copy
import gc
import math
import random
import re
import shutil
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.addons.ros.node_host.message_classes import message_class
from fg_mujoco.addons.ros.node_host.transform_modules import (
    euler_from_quaternion,
    quaternion_from_euler,
    quaternion_matrix,
    quaternion_multiply,
)
from fg_mujoco.cli.main import main
from fg_mujoco.errors import ControllerError
from fg_mujoco.racing import planners
from fg_mujoco.racing.planner_origin import source_code
from ros_planners import ODOMETRY, commands, make, speeds
from scan_worlds import CAR

NODES = Path(__file__).parent / "ros_nodes"
HEAD = """
import rclpy
import time
from rclpy.node import Node
from sensor_msgs.msg import LaserScan
from ackermann_msgs.msg import AckermannDriveStamped


class Mine(Node):
    def __init__(self):
        super().__init__("mine")
        self.create_subscription(LaserScan, "/scan", self.callback, 10)
"""
PUBLISHER = '        self.publisher = self.create_publisher(AckermannDriveStamped, "/drive", 10)\n'
DRIVES = """
    def drive(self, speed):
        message = AckermannDriveStamped()
        message.drive.speed = float(speed)
        self.publisher.publish(message)
"""


@pytest.fixture
def node(tmp_path):
    """Write a node whose `callback` has a body, and return what names it."""

    def write(body, more="", head=HEAD + PUBLISHER, name="Mine"):
        path = tmp_path / "mine.py"
        indented = "".join(f"        {line}\n" for line in body.splitlines())
        path.write_text(f"{head}{more}\n    def callback(self, message):\n{indented}{DRIVES}")
        return f"ros:{path}:{name}"

    return write


@pytest.mark.slow
@each("source, speed",
      [("follow_the_gap.py:ReactiveFollowGap", 3.0), ("follow_the_gap.py", 3.0), ("wall_follow.py", 2.0),
       ("pure_pursuit/pure_pursuit/pure_pursuit_node.py", 3.0)])  # fmt: skip
def test_a_node_of_a_course_laps_the_oval_unedited(source, speed):
    result = fg.race("oval", f"ros:{NODES / source}", laps=1)
    assert result.car.end_reason == "finished"
    assert result.car.max_speed_m_s == pytest.approx(speed, abs=0.1)


def test_the_safety_node_brakes_before_the_wall():
    result = fg.race("oval", f"ros:{NODES / 'safety_node.py'}:SafetyNode", laps=1, time_limit=12.0)
    assert (result.car.end_reason, result.car.crash) == ("time_limit", None)
    assert result.car.max_speed_m_s == pytest.approx(2.0, abs=0.1)
    assert result.ctrl[-1, 1] == 0.0


@pytest.mark.slow
def test_two_races_have_the_same_bits_and_the_second_forgets_the_first():
    source = f"ros:{NODES / 'wall_follow.py'}"
    one, other = (fg.race("oval", source, laps=1) for _ in range(2))
    assert one.trajectory_sha256 == other.trajectory_sha256
    planner = make(source)
    first = commands(planner, 20)
    planner.reset()
    assert commands(planner, 20) == first


def test_nothing_of_ros_is_left_in_sys_modules(node):
    before = set(sys.modules)
    commands(make(f"ros:{NODES / 'wall_follow.py'}"), 2)
    commands(make(node("self.drive(1)")), 2)
    left = {name.partition(".")[0] for name in set(sys.modules) - before}
    assert not left & {"rclpy", "sensor_msgs", "ackermann_msgs", "tf2_ros"}


def test_the_car_stands_before_the_first_command_and_holds_the_last(node):
    planner = make(node("self.count = getattr(self, 'count', 0) + 1\nif self.count in (3, 5): self.drive(self.count)"))
    assert speeds(planner, 7) == [0.0, 0.0, 3.0, 3.0, 5.0, 5.0, 5.0]


def test_no_command_is_faster_than_the_race_allows_and_all_are_of_32_bits(node):
    assert speeds(make(node("self.drive(9)")), 1) == [5.0]
    assert speeds(make(node("self.drive(0.1)")), 1) == [float(np.float32(0.1))]


def test_a_node_hears_the_points_of_a_mid360(node):
    subscribed = '        self.create_subscription(PointCloud2, "/livox/lidar", self.points, 10)\n'
    head = HEAD.replace("import LaserScan", "import LaserScan, PointCloud2") + PUBLISHER + subscribed
    more = """
    def points(self, cloud):
        from sensor_msgs_py.point_cloud2 import read_points
        self.drive(float((read_points(cloud)["line"] == 3).sum()) / 5000.0)
"""
    source = node("pass", more, head)
    with_it, without = (fg.race("oval", source, laps=1, time_limit=0.3, lidar=kind) for kind in ("mid360", "raycast"))
    assert with_it.ctrl[:, 1].tolist() == [0.0] * 4 + [1.0] * 8 and not without.ctrl[:, 1].any()


def test_timers_come_at_their_simulated_times_between_the_ticks(node):
    head = HEAD + PUBLISHER + "        self.create_timer(0.01, self.timer)\n        self.times = []\n"
    more = """
    def timer(self):
        self.times.append(self.get_clock().now().nanoseconds)
        first = self.times[0]
        assert [t - first for t in self.times] == [10_000_000 * i for i in range(len(self.times))]
        self.drive(len(self.times) / 10)
"""
    # made 1 ms before the first tick: at 0.025 s two calls were due, at 0.05 s all five
    assert speeds(make(node("pass", more, head)), 4) == pytest.approx([0.0, 0.2, 0.5, 0.7], abs=1e-6)


def test_time_arithmetic_and_stamps_are_simulated(node):
    body = """
from rclpy.duration import Duration
from rclpy.time import Time
now, stamp = self.get_clock().now(), Time.from_msg(message.header.stamp)
assert now - Duration(seconds=1) < now and (now - stamp).nanoseconds < 25_000_000
assert abs(time.time() - now.nanoseconds / 1e9) < 1e-3 and time.time() < time.time()
self.drive((now - getattr(self, 'begin', now)).nanoseconds / 1e9)
self.begin = getattr(self, 'begin', now)
"""
    assert speeds(make(node(body)), 3) == pytest.approx([0.0, 0.025, 0.05], abs=1e-6)


def test_a_callback_that_sleeps_sleeps_in_simulated_time(node):
    began = time.perf_counter()
    # told at 0, it sleeps until 0.06 s; the commands of what it was told meanwhile come after that
    assert speeds(make(node("time.sleep(0.06)\nself.drive(2)")), 5) == [0.0, 0.0, 0.0, 2.0, 2.0]
    assert time.perf_counter() - began < 60.0


def test_nodes_in_the_ways_that_people_write_them(tmp_path):
    package = tmp_path / "pkg" / "pkg"
    package.mkdir(parents=True)
    (tmp_path / "pkg" / "package.xml").write_text("<package><name>pkg</name></package>")
    (package / "__init__.py").write_text("")
    (package / "consts.py").write_text("SPEED = 1.5\n")
    (package / "polling.py").write_text(
        """
import threading
import time
from dataclasses import dataclass

import message_filters
import rclpy
from ackermann_msgs.msg import AckermannDriveStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan

from pkg import consts
from . import consts as same
from .consts import SPEED


@dataclass
class Last:
    time: float = 0.0
    speed: float = 0.0


def main():
    assert same is consts
    rclpy.init()
    node, last = rclpy.create_node("polling"), Last()

    def callback(scan, odometry):
        now = time.time()
        last.time, last.speed = now, SPEED + 0.0 / (now - last.time)

    inputs = [message_filters.Subscriber(node, LaserScan, "scan"), message_filters.Subscriber(node, Odometry, "odom")]
    both = message_filters.ApproximateTimeSynchronizer(inputs, 10, 0.1)
    both.registerCallback(callback)
    publisher = node.create_publisher(AckermannDriveStamped, "drive", 1)

    def publish():
        rate = node.create_rate(100)
        while rclpy.ok():
            message = AckermannDriveStamped()
            message.drive.speed = last.speed
            publisher.publish(message)
            rate.sleep()

    threading.Thread(target=publish, daemon=True).start()
    while rclpy.ok():
        rclpy.spin_once(node, timeout_sec=0)
"""
    )
    assert speeds(make(f"ros:{package / 'polling.py'}"), 4) == [0.0, 1.5, 1.5, 1.5]


def test_parameters_are_declared_given_and_refused(node, tmp_path):
    head = HEAD + PUBLISHER + "        self.declare_parameter('speed', 1.5)\n"
    source = node("self.drive(self.get_parameter('speed').value)", head=head)
    assert speeds(make(source), 1) == [1.5]
    assert speeds(make(source, speed=2), 1) == [2.0]
    file = tmp_path / "config.yaml"
    file.write_text("mine:\n  ros__parameters:\n    speed: 2.5\n")
    assert speeds(make(source, **{"host.params": str(file)}), 1) == [2.5]
    with pytest.raises(ControllerError, match=r"has no parameter 'sped'; accepted: speed; did you mean 'speed'\?"):
        make(source, sped=2)
    with pytest.raises(ControllerError, match=r"parameter 'speed' of node 'mine' is 'fast'; .*mine.py, line 14"):
        make(source, speed="fast")


def test_topics_are_remapped(node):
    source = node("self.drive(1)", head=HEAD.replace("/scan", "/my_scan") + PUBLISHER.replace("/drive", "/nav"))
    listens = '        self.create_subscription(LaserScan, "/no_scan", self.callback, 10)\n'
    two = HEAD.replace("/scan", "/my_scan") + listens + PUBLISHER
    with pytest.warns(UserWarning,
        match=r"/my_scan has no publisher here, and is taken for /scan; node 'mine' listens \(.*mine.py, line 12\)"):
        assert speeds(make(source), 2) == [1.0, 1.0]
    with pytest.warns(UserWarning, match=r"/no_scan has no publisher here; node 'mine' listens \(.*mine.py, line 13\)"):
        assert speeds(make(node("self.drive(1)", head=two)), 2) == [0.0, 0.0]
    assert speeds(make(source, **{"remap./my_scan": "/scan"}), 2) == [1.0, 1.0]
    wrong = node("self.drive(1)", head=HEAD.replace("LaserScan", "Imu") + PUBLISHER)
    with pytest.warns(UserWarning, match=r"/scan is sensor_msgs/msg/LaserScan here; node 'mine' listens for Imu"):
        speeds(make(wrong), 1)


_ODOMETRY_ON = """        from nav_msgs.msg import Odometry
        self.create_subscription(Odometry, "{}", self.odom, 1)
"""
_TELLS_ODOMETRY = """
    def odom(self, message):
        self.drive(message.twist.twist.linear.x)
"""


@each("more", [_ODOMETRY_ON.format("/opp2/odom"), _ODOMETRY_ON.format("/a/odom") + _ODOMETRY_ON.format("/b/odom")])
def test_a_topic_that_may_be_something_else_stays_silent(more, node):
    source = node("pass", _TELLS_ODOMETRY, HEAD + PUBLISHER + more)
    with pytest.warns(UserWarning, match=r"/odom has no publisher here; node 'mine' listens"):
        assert speeds(make(source), 2) == [0.0, 0.0]


def test_poses_and_transforms_are_those_of_the_car(node):
    head = HEAD + PUBLISHER + "        from nav_msgs.msg import Odometry\n        import tf2_ros\n"
    head += "        self.create_subscription(Odometry, '/ego_racecar/odom', self.odom, 1)\n"
    head += "        self.buffer = tf2_ros.Buffer()\n"
    more = """
    def odom(self, message):
        self.pose = message.pose.pose.position
        self.speed = message.twist.twist.linear.x
"""
    body = """
laser = self.buffer.lookup_transform("map", "ego_racecar/laser", rclpy.time.Time()).transform
assert (self.pose.x, self.pose.y, self.speed) == (3.0, 4.0, 1.0)
assert abs(laser.translation.x - 3.0) < 1e-9 and abs(laser.rotation.z - 0.5 ** 0.5) < 1e-9
self.drive(laser.translation.y)
"""
    planner = make(node("if not hasattr(self, 'pose'): return\n" + body, more, head))
    found = commands(planner, 2, replace(ODOMETRY, pose=np.array((3.0, 4.0, math.pi / 2))))
    assert found[1][0] == pytest.approx(4.0 + CAR.lidar_offset, abs=1e-6)  # a scan comes before the pose of its tick


def test_messages_of_ones_own_package_are_read(node, tmp_path):
    (tmp_path / "race_msgs" / "msg").mkdir(parents=True)
    (tmp_path / "race_msgs" / "msg"
     / "Goal.msg").write_text("uint8 LEFT=3\nstd_msgs/Header header\nfloat64 gain 2.5  # default\nfloat32[] values\n")
    body = "from race_msgs.msg import Goal\ngoal = Goal(values=[1.0])\nself.drive(goal.gain + len(goal.values))"
    assert speeds(make(node(body)), 1) == [3.5]


def test_messages_beside_a_node_are_those_of_its_package_and_hide_no_module(node, tmp_path):
    (tmp_path / "Gain.msg").write_text("float32 gain 1.5\n")
    body = "import collections, math\nfrom race.msg import Gain\nfrom collections import deque\n"
    assert speeds(make(node(body + "self.drive(Gain(gain=1.5).gain + math.floor(1.2))")), 1) == [2.5]


@each("start",
      ["from car import run\nrun()",
       "import os, sys\nsys.path.insert(0, os.path.dirname(__file__) + '/lib')\nfrom car_again import run\nrun()",
       "import importlib\nif __name__ == '__main__':\n    importlib.import_module('car').run()",
       "import runpy\ntry:\n    runpy.run_path(__file__[:-8] + 'spun.py')\nexcept ImportError:\n    pass"])
def test_a_program_starts_a_node_of_its_own_modules_however_it_imports_them(start, node, tmp_path):
    (tmp_path / "lib").mkdir(exist_ok=True)
    text = Path(node("self.drive(1)").removeprefix("ros:").removesuffix(":Mine")).read_text()
    for name, code in {"start.py": start, "car.py": "\ndef run():\n    import spun\n",
                       "lib/car_again.py": "from car import run\n",
                       "spun.py": f"{text}rclpy.init()\nrclpy.spin(Mine())\n"}.items():  # fmt: skip
        (tmp_path / name).write_text(code)
    assert speeds(make(f"ros:{tmp_path / 'start.py'}"), 1) == [1.0]


@each("above", ["libs/deep", "../other/libs/deep"])
def test_messages_of_a_package_deep_in_the_workspace_are_read(above, node, tmp_path, monkeypatch):
    monkeypatch.setattr("fg_mujoco.addons.ros.node_host.workspace._MOST_FOLDERS", 10**6)  # as pytest has many
    package = tmp_path / above / "race_msgs"
    (package / "msg").mkdir(parents=True)
    (package / "package.xml").write_text("<package><name>race_msgs</name></package>")
    (tmp_path / "package.xml").write_text("<package><name>mine</name></package>")
    (package / "msg" / "Goal.msg").write_text("float64 gain\n")
    assert speeds(make(node("from race_msgs.msg import Goal\nself.drive(Goal(gain=1.5).gain)")), 1) == [1.5]
    shutil.rmtree(package)


@each("module", ["car.py", "car/__init__.py"])
def test_a_package_has_its_messages_and_the_module_beside_the_node_of_its_name(module, node, tmp_path):
    for path, text in {"package.xml": "<package><name>car</name></package>", "msg/Goal.msg": "float64 gain\n",
                       module: "def gain():\n    return 0.5\n"}.items():  # fmt: skip
        (tmp_path / path).parent.mkdir(exist_ok=True)
        (tmp_path / path).write_text(text)
    body = "from car import gain\nimport car\nimport car.msg\nfrom car.msg import Goal\n"
    body += "self.drive(car.msg.Goal(gain=1.0).gain + Goal().gain + car.gain() + gain())"
    assert speeds(make(node(body)), 1) == [2.0]
    (tmp_path / module).unlink()


def test_two_nodes_of_a_launch_file_talk_and_drive(tmp_path):
    (tmp_path / "thinker.py").write_text(
        """
import rclpy
from rclpy.node import Node
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Float32

def main():
    rclpy.init()
    node = Node("thinker")
    node.declare_parameter("speed", 1.0)
    publisher = node.create_publisher(Float32, "wish", 1)
    speed = node.get_parameter("speed").value
    node.create_subscription(LaserScan, "scan", lambda m: publisher.publish(Float32(data=speed)), 1)
    rclpy.spin(node)
"""
    )
    (tmp_path / "driver.py").write_text(
        """
import rclpy
from rclpy.node import Node
from ackermann_msgs.msg import AckermannDriveStamped
from std_msgs.msg import Float32


class Driver(Node):
    def __init__(self):
        super().__init__("driver")
        self.publisher = self.create_publisher(AckermannDriveStamped, "/drive", 1)
        self.create_subscription(Float32, "/speed", self.callback, 1)

    def callback(self, message):
        out = AckermannDriveStamped()
        out.drive.speed = message.data
        self.publisher.publish(out)
"""
    )
    launch = tmp_path / "launch.yaml"
    launch.write_text("nodes:\n- {file: driver.py, class: Driver, remap: {/speed: /wish}}\n"
                      "- {file: thinker.py, parameters: {speed: 2.0}}\n")  # fmt: skip
    source = f"ros:{launch}"
    assert speeds(make(source), 2) == [2.0, 2.0]
    text = source_code(type(make(source)))
    assert all(part in text for part in (launch.read_bytes(), (tmp_path / "driver.py").read_bytes()))
    (tmp_path / "driver.py").write_text((tmp_path / "driver.py").read_text().replace("message.data", "message.dat"))
    with pytest.raises(Exception, match=r"std_msgs/Float32 has no field 'dat'; .*driver.py, line 16\)"):
        speeds(make(source), 1)
    launch.write_text("nodes:\n- {file: driver.py, clas: Driver}\n")
    with pytest.raises(ControllerError, match=r"launch.yaml, node 1 has 'clas'; .* did you mean 'class'\?"):
        make(source)


@each("head, said",
    [(HEAD, r"node 'Mine' publishes on no drive topic; accepted: AckermannDriveStamped on /drive; .*mine.py, line 9\)"),
     (HEAD + PUBLISHER.replace("/drive", "/a") + PUBLISHER.replace("/drive", "/b"),
      r"node 'Mine' has 2 drive topics, /a and /b .*mine.py, line 14\)"),
     (HEAD.replace("LaserScan\n", "LaserScam\n", 1), r"sensor_msgs.msg has no 'LaserScam' .*mine.py, line 5\)"),
     ("import rospy\nrospy.init_node('mine')\n" + HEAD, r"'rospy' is gone; instead: a node of .*mine.py, line 1\)"),
     ("import cv_bridge_2\ncv_bridge_2.A()\n" + HEAD, r"No module named 'cv_bridge_2' .*mine.py, line 1\)"),
     (HEAD.replace("Node):", "object):"), r"object.__init__\(\) takes .*mine.py, line 11\)"),
     (HEAD + "        self.create_publisher(AckermannDriveStamped, '/drive')\n", r"'qos_profile' .*mine.py, line 13\)"),
     (HEAD + "        print 'hello'\n", r"Missing parentheses .*mine.py, line 13\); it is Python 2")])  # fmt: skip
def test_a_node_that_cannot_drive_is_refused_in_one_line(head, said, node, capsys):
    assert main(["race", "--controller", node("pass", head=head)]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert re.search(said, error), error


@each("body, said, line",
      [("AckermannDriveStamped().speed = 1.0",
        "has no field 'speed'; accepted: header, drive; did you mean drive.speed?", 16),
       ("AckermannDriveStamped().drive.speed = 1",
        "AckermannDrive.speed is 1 of type int; accepted by rclpy: of type float", 16),
       ("message.range", "sensor_msgs/LaserScan has no field 'range'", 16),
       ("self.publisher.publish(message)", "publish of a LaserScan on /drive; accepted: a AckermannDriveStamped", 16),
       ("self.get_parameter('gain')", "node 'mine' has declared no parameter 'gain'", 16),
       ("rclpy.spinn(self)", "rclpy has no 'spinn' here, where no ROS is installed", 16)])  # fmt: skip
def test_a_mistake_in_a_callback_is_told_with_its_line(body, said, line, node):
    with pytest.warns(UserWarning) as warned:
        failure = fg.race("oval", node(body), laps=1).car.planner_failure
    assert said in str(warned[-1].message) and said in str(failure)
    assert failure.line == line
    assert failure.file.endswith("mine.py")


def test_a_node_that_never_publishes_is_named_with_the_line_of_its_publisher(node):
    said = r"node 'Mine' has published nothing on /drive within 5 s \(.*mine.py, line 13\)"
    with pytest.warns(UserWarning, match=said):
        assert fg.race("oval", node("pass"), laps=1).car.end_reason == "planner_failed"


@pytest.mark.slow
def test_a_node_that_blocks_is_named_with_its_line_and_its_thread_ends(node):
    planner = make(node("while True:\n    x = 1"), **{"host.wall_limit": 1.0})
    with pytest.raises(Exception, match=r"'Mine' has not come back within 1 s of wall time \(.*mine.py, line 1[67]\)"):
        commands(planner, 1)
    del planner
    gc.collect()
    for thread in [one for one in threading.enumerate() if one.name == "ros:Mine"]:
        thread.join(10.0)
        assert not thread.is_alive()


def test_a_run_keeps_the_node_and_its_hash(node, tmp_path, capsys, without_pictures):
    source, folder = node("self.drive(1)"), tmp_path / "run"
    assert main(["race", "--controller", source, "--time-limit", "1", "--out", str(folder)]) == 1
    path = Path(source.removeprefix("ros:").rpartition(":")[0])
    assert (folder / "controller.py").read_bytes() == path.read_bytes()
    assert main(["replay", str(folder)]) == 0
    assert main(["debug", str(folder)]) == 0
    assert f"accepted: --controller {source}" in capsys.readouterr().err
    path.unlink()
    assert main(["debug", str(folder), "--controller", f"ros:{folder / 'controller.py'}:Mine"]) == 0  # the copy
    assert "without the planner's work" not in capsys.readouterr().err
    assert main(["race", "--config", str(folder)]) == 2


def test_the_hash_of_a_node_covers_the_modules_of_its_own(tmp_path, capsys, without_pictures):
    path, module, folder = tmp_path / "mine.py", tmp_path / "tools" / "speeds.py", tmp_path / "run"
    module.parent.mkdir()
    module.write_text("SPEED = 1.0\n")
    callback = "    def callback(self, message):\n        self.drive(SPEED)\n"
    path.write_text(f"from tools.speeds import SPEED\n{HEAD}{PUBLISHER}\n{callback}{DRIVES}")
    source = f"ros:{path}:Mine"
    assert module.read_bytes() in source_code(type(make(source)))
    assert main(["race", "--controller", source, "--time-limit", "0.5", "--out", str(folder)]) == 1
    assert main(["debug", str(folder), "--controller", source, "--out", str(tmp_path / "a.html")]) == 0
    assert "without the planner's work" not in capsys.readouterr().err
    module.write_text("SPEED = 2.0\n")
    hashed = planners.ControllerChoice.of(source).sha256
    module.write_text("SPEED = 1.0\n")
    assert planners.ControllerChoice.of(source).sha256 != hashed


def test_unseeded_random_numbers_are_the_same_in_each_race_and_nobody_elses(node):
    body = """
import random
import numpy as np
import numpy.random as npr
from numpy.random import uniform
from random import choice
draws = (random.random(), np.random.rand(), npr.normal(), uniform(), choice(range(9)), np.random.default_rng().random(),
         random.Random().random(), np.random.RandomState().rand())
self.drive(1.0 + sum(draws) / 100 + float(np.float64(0.0)))
"""
    source = node(body)
    one, other = make(source), make(source)
    first = speeds(one, 4)
    assert len(set(first)) == 4
    np.random.rand()
    assert speeds(other, 4) == first
    one.reset()
    assert speeds(one, 4) == first
    for draw in ("np.random.seed(5) or np.random.rand()", "np.random.RandomState(5).rand()"):
        seeded = node(f"import numpy as np\nself.drive({draw})")
        assert speeds(make(seeded), 1) == [float(np.float32(np.random.RandomState(5).rand()))]
    seeded = node("import random\nself.drive(random.Random(5).random())")
    assert speeds(make(seeded), 1) == [float(np.float32(random.Random(5).random()))]


@each("read",
      ["open(os.path.join('/home/me/ws', 'src', name + '.csv')).read()",
       "open(file=f'src/{name}.csv', mode='r').read()", "np.loadtxt(os.path.abspath('src') + '/' + name + '.csv')",
       "np.genfromtxt(Path('~') / 'ws' / 'src' / f'{name}.csv')"])  # fmt: skip
def test_a_file_of_data_at_a_path_that_is_put_together_is_found_when_it_is_read(read, node, tmp_path):
    (tmp_path / "src").mkdir(exist_ok=True)
    (tmp_path / "src" / "levine.csv").write_text("1.5\n")
    head = f"import os\nfrom pathlib import Path\nimport numpy as np\n{HEAD}{PUBLISHER}"
    source = node("self.drive(self.speed)",
                  head=head + f"        name = 'levine'\n        self.speed = float({read})\n")  # fmt: skip
    with pytest.warns(UserWarning, match=r"levine.csv is not there; .*/src/levine.csv is taken \(.*mine.py, line 18\)"):
        assert speeds(make(source), 1) == [1.5]


def test_locks_events_and_threads_wait_in_simulated_time(node):
    head = (HEAD + PUBLISHER
            + "        import threading\n        self.lock, self.event = threading.Lock(), threading.Event()\n")
    head += "        threading.Thread(target=self.other, daemon=True).start()\n        self.value = 0.0\n"
    more = """
    def other(self):
        while rclpy.ok():
            with self.lock:
                time.sleep(0.03)
                self.value += 1.0
            self.event.set()
            time.sleep(0.02)
"""
    body = "with self.lock:\n    self.drive(self.value)\nself.event.wait(timeout=0.01)"
    assert speeds(make(node(body, more, head)), 6)[-1] >= 2.0


def test_messages_have_the_fields_defaults_and_types_of_their_definitions():
    from rosbags.typesys import Stores, get_typestore

    for name, (constants, fields) in get_typestore(Stores.ROS2_HUMBLE).fielddefs.items():
        kind = message_class(name)
        message = kind()
        wanted = [field for field, _ in fields if field != "structure_needs_at_least_one_member"]
        assert list(kind._makers) == wanted
        assert all(getattr(kind, constant) == value for constant, _, value in constants)
        assert copy.deepcopy(message) == message
    assert message_class("geometry_msgs/msg/Quaternion")().w == 1.0
    scan = message_class("sensor_msgs/msg/LaserScan")(ranges=[1.0, math.inf])
    assert scan.ranges == array.array("f", (1.0, math.inf))
    with pytest.raises(AssertionError, match=r"an array of NumPy has .tolist\(\)"):
        scan.ranges = np.ones(3)


def test_euler_angles_and_quaternions_are_each_others_inverse():
    for angles in ((0.1, -0.2, 3.0), (0.0, 0.0, -1.5), (-3.0, 1.2, 0.4)):
        assert euler_from_quaternion(quaternion_from_euler(*angles)) == pytest.approx(angles, abs=1e-12)
    assert quaternion_from_euler(0.0, 0.0, math.pi / 2) == pytest.approx((0.0, 0.0, 0.5**0.5, 0.5**0.5))
    one, two = quaternion_from_euler(0.3, -0.5, 1.0), quaternion_from_euler(-1.0, 0.2, 0.4)
    product = quaternion_matrix(one) @ quaternion_matrix(two)
    np.testing.assert_allclose(quaternion_matrix(quaternion_multiply(one, two)), product, atol=1e-12)
