"""Nodes of ROS 1 as people write them: names of other simulators, the course's drive_param, arguments, .cfg files."""


import numpy as np
import pytest

import ros_planners
from cases import each
from fg_mujoco.addons.ros.node_host.graph import NodeError
from fg_mujoco.errors import ControllerError
from ros_planners import ROS1, write

LISTENS = 'rospy.Subscriber("/scan", LaserScan, lambda scan: {})\nrospy.spin()\n'


def commands(source, count=2, **settings):
    return ros_planners.commands(ros_planners.make(source, **settings), count)


def test_the_only_scan_and_the_only_odometry_of_another_name_are_taken(tmp_path):
    text = ROS1 + "from nav_msgs.msg import Odometry\nseen = []\n"
    text += 'rospy.Subscriber("/car_1/odom", Odometry, lambda odometry: seen.append(odometry.twist.twist.linear.x))\n'
    text += "take = lambda scan: seen and drive(seen[-1] + len(scan.ranges) / 1081)\n"
    text += 'rospy.Subscriber("/car_1/scan", LaserScan, take)\n'
    with pytest.warns(UserWarning,
        match=r"/car_1/scan has no publisher here, and is taken for /scan; node 'mine' listens \(.*line 18\)"):
        assert commands(write(tmp_path, text + "rospy.spin()\n"))[1][0] == 2.0


def test_a_callback_that_sleeps_is_not_called_again_before_it_has_come_back(tmp_path):
    text = ROS1 + "depths = []\ndef call(scan):\n    depths.append(len(depths))\n    drive(max(depths) + 1.0)\n"
    text += '    rospy.sleep(0.06)\n    depths.pop()\nrospy.Subscriber("/scan", LaserScan, call)\n'
    text += "def tick(event):\n    global ticks\n    ticks += 1\n    drive(3.0 if ticks > 8 else 1.0, ticks / 100)\n"
    text += "ticks = 0\nrospy.Timer(rospy.Duration(0.02), tick)\nrospy.spin()\n"
    found = commands(write(tmp_path, text), 10)
    assert {speed for speed, _ in found[:-2]} == {1.0}
    assert found[-1] == (3.0, pytest.approx(0.11))  # timers come while it sleeps


def test_messages_beside_a_node_are_those_of_its_package_and_hide_no_module(tmp_path):
    write(tmp_path, "float32 gain 1.5\n", "Gain.msg")
    text = ROS1 + "import collections, math\nfrom race.msg import Gain\nfrom collections import deque\n"
    assert (
        commands(write(tmp_path, text + LISTENS.format("drive(Gain(gain=1.5).gain + math.floor(1.2))")))[-1][0] == 2.5
    )


@each("start",
      ["from car import run\nrun()",
       "import os, sys\nsys.path.insert(0, os.path.dirname(__file__) + '/lib')\nfrom car_again import run\nrun()",
       "import importlib\nif __name__ == '__main__':\n    importlib.import_module('car').run()",
       "import runpy\ntry:\n    runpy.run_path(__file__.replace('start', 'mine'))\nexcept ImportError:\n    pass"])
def test_a_program_whose_first_file_names_no_ros_is_of_the_ros_that_it_imports(start, tmp_path):
    write(tmp_path, "\ndef run():\n    import mine\n", "car.py")
    write(tmp_path, ROS1 + LISTENS.format("drive(1.0)"))
    write(tmp_path / "lib", "from car import run\n", "car_again.py")
    assert commands(write(tmp_path, start, "start.py"))[-1][0] == 1.0


@each("value", ["'fast'", "[1.0]", "np.ones(2)", "np.ones(1)"])
def test_a_command_that_rospy_cannot_send_is_told_with_its_field(value, tmp_path):
    old = value == "np.ones(1)" and np.lib.NumpyVersion(np.__version__) < "2.4.0"
    source = write(tmp_path, ROS1 + "import numpy as np\n" + LISTENS.format(f"drive(1, {value})"))
    if old:
        assert commands(source)[-1][1] == 1.0
        return
    said = "accepted by rospy: a number" + (".*pip install 'numpy<2.4'" if value == "np.ones(1)" else "")
    with pytest.raises(NodeError, match=rf"its callback failed: .*AckermannDrive.steering_angle is .*{said}"):
        commands(source, 202)


def test_arguments_reach_a_node_from_the_setting_and_from_a_launch_file(tmp_path):
    text = ROS1 + "import argparse, sys\nassert sys.argv == rospy.myargv()\nname, speed = rospy.myargv()[1:]\n"
    text += (
        'parser = argparse.ArgumentParser()\nparser.add_argument("name")\nparser.add_argument("speed", type=float)\n'
    )
    text += "assert parser.parse_args().speed == float(speed)\n"
    source = write(tmp_path, text + LISTENS.format("drive(float(speed) if name == 'car 1' else 0.0)"))
    assert commands(source, **{"host.args": "'car 1' 1.5"})[-1][0] == 1.5
    launch = "nodes:\n  - file: mine.py\n    args: [car 1, 2.5]\n"
    assert commands(write(tmp_path, launch, "launch.yaml"))[-1][0] == 2.5
    with pytest.raises(ControllerError, match=r"args are \{'a': 1\}; accepted: words, such as car_1 --fast"):
        commands(write(tmp_path, launch.replace("[car 1, 2.5]", "{a: 1}"), "launch.yaml"))
    with pytest.raises(ControllerError, match=r"host.args: args are \"'car\"; accepted: words"):
        commands(source, **{"host.args": "'car"})


def test_a_file_whose_tabs_only_python_2_reads_is_read_as_it_does(tmp_path):
    body = "if scan.ranges:\n\t\tspeed = 1.0\n        \tspeed += 1.0\n        drive(speed)\n"
    text = ROS1 + f"def call(scan):\n\t{body}" + 'rospy.Subscriber("/scan", LaserScan, call)\nrospy.spin()\n'
    with pytest.warns(UserWarning, match=r"mine.py mixes tabs and spaces, and is read as Python 2 does"):
        assert commands(write(tmp_path, text))[-1][0] == 2.0


def test_parameters_of_a_cfg_file_are_its_defaults_or_those_given(tmp_path):
    write(tmp_path, "<package><name>wall</name></package>", "package.xml")
    cfg = """
from dynamic_reconfigure.parameter_generator_catkin import *
gen = ParameterGenerator()
gen.add("speed", double_t, 0, "of the car", 1, 0, 8)
gen.add_group("more").add("angle", double_t, 0, "of the wheels", default=-0.25)
gen.add("name", str_t, 0, "of the car")
exit(gen.generate("wall", "wall", "Wall"))
"""
    write(tmp_path / "cfg", cfg, "Wall.cfg")
    text = ROS1 + "from dynamic_reconfigure.server import Server\nfrom wall.cfg import WallConfig\n"
    text += 'def changed(config, level):\n    assert level == -1 and config.name == ""\n    return config\n'
    text += "server = Server(WallConfig, changed)\n" + LISTENS.format(
        "drive(server.config['speed'], server.config.angle)"
    )
    source = write(tmp_path / "scripts", text)
    assert commands(source)[-1] == (1.0, -0.25)
    assert commands(source, speed=2)[-1] == (2.0, -0.25)
    write(tmp_path / "cfg", cfg.replace("-0.25", "limit / 2"), "Wall.cfg")
    with pytest.raises(ControllerError,
                       match=r"the default of 'angle' is limit / 2 \(.*Wall.cfg, line 5\); accepted: a"):  # fmt: skip
        commands(source)


@each("line", ['print "started"', "try: pass\nexcept ValueError, error: pass", "mode = 0777"])
def test_python_2_is_refused_with_its_line(line, tmp_path):
    with pytest.raises(ControllerError, match=r"does not import: .* \(.*mine.py, line 1[45]\); it is Python 2$"):
        commands(write(tmp_path, ROS1 + line + "\n"))


def test_the_motor_turns_as_the_driver_of_ros_1_says_it_and_messages_are_counted(tmp_path):
    text = ROS1 + "from vesc_msgs.msg import VescStateStamped\nfrom sensor_msgs.msg import CameraInfo, Imu\ngot = {}\n"
    topics = {"VescStateStamped": "/vesc/sensors/core", "Imu": "/imu", "CameraInfo": "/camera/camera_info"}
    for kind, topic in topics.items():
        text += f"rospy.Subscriber({topic!r}, {kind}, lambda message: got.setdefault({kind!r}, []).append(message))\n"
    text += """
def take(scan):
    if len(got) < 3:
        return
    state, lens = got["VescStateStamped"][-1].state, got["CameraInfo"][-1]
    assert state.voltage_input > 12.0 and state.temperature_pcb > 20.0
    assert lens.P[0] == lens.P[5] == lens.K[0] > 0.0 == lens.P[3] and lens.P[10] == lens.R[0] == 1.0
    assert got["Imu"][-1].orientation.w == 1.0 and got["Imu"][-1].orientation_covariance[0] == -1.0
    counts = [message.header.seq for message in got["Imu"]]
    assert counts == list(range(counts[0], counts[0] + len(counts)))
    drive(-state.speed / 4614.0)
rospy.Subscriber("/scan", LaserScan, take)
rospy.spin()
"""
    assert commands(write(tmp_path, text), 5)[-1][0] == pytest.approx(1.0)
