"""Parameters are read as rcl reads them: values, lists, names of nodes with wildcards, and arguments of ROS."""

import math
from pathlib import Path

import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.addons.ros.node_host.ros_parameters import rcl_value, rcl_yaml, read_parameters, read_ros_arguments
from fg_mujoco.errors import ControllerError
from ros_planners import make, node2, speeds

VALUES = {
    "1e3": 1000.0, ".5": 0.5, "5.": 5.0, "-3e-1": -0.3, "08": 8.0, "1": 1, "+2": 2, "-0": 0, "0x1F": 31, "010": 8,
    "y": True, "Off": False, "N": False, "inf": math.inf, "-.INF": -math.inf, "1e400": "1e400", "~": "~",
    "null": "null", "12:30": "12:30", "1_000": "1_000", "2020-01-01": "2020-01-01", "0b11": "0b11",
    "9223372036854775808": 9223372036854775808.0, "truE": "truE", "1.5m": "1.5m",
}  # fmt: skip
FILE = """
/**:
  ros__parameters: {speed: 1, gains: [1.0, .5], frames: {base: '08'}}
gap:
  ros__parameters:
    speed: 2e0
/car_1/**:
  ros__parameters: {speed: 4.0}
team:
  gap:
    ros__parameters: {speed: 5.0}
/*/wall:
  ros__parameters: {speed: 6.0}
"""


@each("text, value", VALUES.items())
def test_a_value_is_that_of_rcl(text, value):
    found = rcl_value(text)
    assert (found, type(found)) == (value, type(value))
    assert rcl_yaml(f"a: {text}") == {"a": value} and rcl_yaml(f"a: '{text}'") == {"a": text}
    assert math.isnan(rcl_value(".nan")) and rcl_yaml("on: {no: 1}") == {"on": {"no": 1}}


@each("node, speed", [("gap", 2.0), ("other", 1), ("car_1/gap", 4.0), ("car_1/a/b", 4.0), ("team/gap", 5.0),
                      ("team/wall", 6.0), ("wall", 1), ("a/team/gap", 1)])  # fmt: skip
def test_the_parameters_of_a_node_are_those_under_its_name_and_under_patterns(node, speed):
    found = read_parameters(Path("p.yaml"), FILE.encode(), node, "node")
    assert found == {"speed": speed, "gains": [1.0, 0.5], "frames.base": "08"}


def test_patterns_that_match_in_many_ways_take_no_time():
    text = "/**" * 200 + "/wall:\n  ros__parameters: {speed: 1.0}"
    assert read_parameters(Path("p.yaml"), text.encode(), "a/b/wall", "node") == {"speed": 1.0}


@each("text, message", [
    ("/**:\n  ros__parameters: {a: [1, 2.5]}", "line 2: a list of float and int, which rcl refuses"),
    ("/**:\n  ros__parameters:\n    a:\n", "line 3: no value"),
    ("[1]", "is no file of parameters"),
    ("speed: 2\nteam: {gain: 1.5}", "is no file of parameters; accepted: NODE: {ros__parameters: {NAME: VALUE}}"),
])  # fmt: skip
def test_a_file_that_rcl_refuses_is_refused_in_a_line(text, message):
    with pytest.raises(ControllerError, match=message) as refused:
        read_parameters(Path("p.yaml"), text.encode(), "gap", "node")
    assert "\n" not in str(refused.value)


def test_arguments_of_ros_are_read_and_the_others_left():
    given = "car_1 --ros-args -p speed:=2e0 -p gap:gain:=.5 -p wall:gain:=3 -r /scan:=/front -r __node:=mine "
    given += "-r __ns:=/car --params-file p.yaml --log-level debug --param list:=[1,2] -- --fast"
    found = read_ros_arguments(given.split(), "gap", "node")
    assert found.plain == ("car_1", "--fast") and found.parameters == {"speed": 2.0, "gain": 0.5, "list": [1, 2]}
    assert (found.remap, found.name, found.namespace, found.files) == (
        {"/scan": "/front"}, "mine", "/car", (Path("p.yaml"),))  # fmt: skip
    for wrong, message in (("-p speed=2", "accepted: NAME:=VALUE"), ("--params-file", "has no value"),
                           ("-p a:=[1,2.5]", "a list of float and int")):  # fmt: skip
        with pytest.raises(ControllerError, match=message):
            read_ros_arguments(["--ros-args", *wrong.split()], None, "node")


def test_arguments_reach_a_node_from_the_setting_and_from_a_launch_file(tmp_path):
    init = "import argparse, sys\nname, speed = sys.argv[1:]\nparser = argparse.ArgumentParser()\n"
    init += "for each in ('name', 'speed'): parser.add_argument(each)\nassert parser.parse_args().speed == speed\n"
    source = node2(tmp_path, "self.drive(self.speed)", init + "self.speed = float(speed) if name == 'car 1' else 0.0")
    launch = "nodes: [{file: mine.py, class: Mine, args: [car 1, 2.5]}]"
    (tmp_path / "launch.yaml").write_text(launch)
    assert speeds(make(source, **{"host.args": "'car 1' 1.5"}), 1) == [1.5]
    assert speeds(make(f"ros:{tmp_path / 'launch.yaml'}"), 1) == [2.5]
    with pytest.raises(ControllerError, match=r"host.args: args are \"'car\"; accepted: words"):
        make(source, **{"host.args": "'car"})
    (tmp_path / "launch.yaml").write_text(launch.replace("[car 1, 2.5]", "{a: 1}"))
    with pytest.raises(ControllerError, match=r"args are \{'a': 1\}; accepted: words, such as car_1 --fast"):
        make(f"ros:{tmp_path / 'launch.yaml'}")


def test_a_node_that_names_itself_gets_the_parameters_of_its_name(tmp_path):
    planner = node2(tmp_path, "self.drive(self.get_parameter('speed').value)", "self.declare_parameter('speed', 0.5)")
    name = next(line.split('"')[1] for line in Path(planner[4:].partition(":")[0]).read_text().splitlines()
                if "super().__init__(" in line)  # fmt: skip
    params = tmp_path / "p.yaml"
    params.write_text("".join(f"{node}:\n  ros__parameters: {{speed: {speed}}}\n" for node, speed in (
        ("other", 3.0), (name, "1e0"))))  # fmt: skip
    args = "--ros-args -p speed:=1.5 -r __node:=other --params-file"
    (tmp_path / "launch.yaml").write_text(f"nodes: [{{file: mine.py, class: Mine, args: '{args} {params}'}}]")
    for source, speed in ((f"{planner}[host.params={params}]", 1.0), (f"{planner}[host.params={params},speed=2]", 2.0),
                          (f"ros:{tmp_path / 'launch.yaml'}", 1.5)):  # fmt: skip
        result = fg.race("oval", source, time_limit=1.0)
        assert result.car.max_speed_m_s == pytest.approx(speed, abs=0.05)


@each("given, found", [("[3, 1]", 3.0), ("[2.0]", 2.0), ("[]", None), ("[a, b]", "type of its default"),
                       ("[true]", "type of its default"), ("3.0", "type of its default")])  # fmt: skip
def test_a_list_is_of_the_type_of_its_default(tmp_path, given, found):
    (tmp_path / "p.yaml").write_text(f"/**:\n  ros__parameters: {{gains: {given}}}\n")
    first = "(self.get_parameter('gains').get_parameter_value().double_array_value or [1.0])[0]"
    planner = node2(tmp_path, f"self.drive({first})", "self.declare_parameter('gains', [1.0, 2.0])")
    source = f"{planner}[host.params={tmp_path / 'p.yaml'}]"
    if isinstance(found, str):
        with pytest.raises(ControllerError, match=found):
            fg.race("oval", source, time_limit=0.1)
    else:
        assert fg.race("oval", source, time_limit=1.0).car.max_speed_m_s == pytest.approx(found or 1.0, abs=0.05)


RANGED = """from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor
ranges = [FloatingPointRange(from_value=0.0, to_value=3.0)]
self.declare_parameter('speed', 2.0, ParameterDescriptor(floating_point_range=ranges))
tried = [self.set_parameters([rclpy.Parameter('speed', value=value)])[0].successful for value in ('x', 9.0, True, 1)]
assert tried == [False, False, False, True] and self.get_parameter('speed').value == 1.0
"""


def test_a_parameter_stays_within_its_type_and_range(tmp_path):
    planner = node2(tmp_path, "self.drive(self.get_parameter('speed').value)", RANGED)
    assert fg.race("oval", planner, time_limit=1.0).car.max_speed_m_s == pytest.approx(1.0, abs=0.05)
    with pytest.raises(ControllerError, match=r"'speed' of node 'mine' is 5\.0; accepted: from 0 to 3"):
        fg.race("oval", f"{planner}[speed=5.0]", time_limit=0.1)
