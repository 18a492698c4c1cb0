"""Targets of planners: their names and settings, their files, their lines, and the scans that they are told."""

import json
import shutil

import numpy as np

import fg_mujoco as fg
from fg_mujoco.addons.look.debug import debug_page
from fg_mujoco.addons.look.debug.decisions import Witness
from fg_mujoco.addons.ros.node_host.graph import Graph
from fg_mujoco.addons.ros.node_host.launch_files import launched
from fg_mujoco.addons.ros.node_host.program import read_program
from fg_mujoco.racing.planners import bundled_names, make_controller

from .file_targets import race, ring
from .mutations import VALUES, mutated, one_of
from .target import Target, as_text, command, ignore_refusal

PLANNERS = ("gap_finder[lookahead=6]", "follow_the_gap[point=deepest,assist=limiter]", "pure_pursuit[line=ring.csv]",
            "wall_follow", "disparity_extender[assist=safe]", "weighted_gap", "threshold_gap", "planner.py:Planner",
            "planner.py:Planner[gain=.5]")  # fmt: skip

PLANNER = b"""
import fg_mujoco as fg

class Planner:
    def __init__(self, gain: float = 1.0):
        self.gain = gain
    def reset(self):
        pass
    def __call__(self, scan, odometry):
        return fg.DriveCommand(steering_angle=0.05 * self.gain, speed=1.0)
"""


def _planner_settings(samples, here, rng):
    (here / "planner.py").write_bytes(PLANNER)
    shutil.copy(samples / "ring.csv", here)
    return command(*race(f"--controller={as_text(mutated(one_of(rng, PLANNERS).encode(), rng))}"))


ANSWERS = ("None", "0", "1", "True", "'a'", "b''", "[]", "()", "(0.0, 1.0)", "[0.1, 1.0, 2.0]", "{}", "float('nan')",
           "float('inf')", "-1e308", "10**400", "object()", "lambda *a: None", "scan", "odometry", "scan.ranges",
           "scan.ranges[:0]", "scan.ranges * 1j", "np.zeros(2)", "np.float32(1)", "np.array(['a', 'b'])",
           "np.array(None)", "np.ma.masked", "type", "Ellipsis", "iter([0, 0])", "(i for i in ())",
           "fg.DriveCommand(steering_angle=0.1, speed=1.0)", "fg.DriveCommand(steering_angle=9.0, speed=99.0)", "Odd()",
           "Odd", "1/0", "np.ctypeslib.as_array", "print('fg-mujoco: warning' + 'x' * 4000)",
           "__import__('warnings').warn('x' * 999)", "exec('raise Odd()')", "[][0]", "sys.exit(0)", "sys.exit('bye')",
           "exec('raise GeneratorExit')", "exec('raise StopIteration')", "exec('raise MemoryError')",
           "sys.setrecursionlimit(60)", "(lambda f: f(f))(lambda f: f(f))", "next(iter(()))", "forged(float('nan'))",
           "forged('a')", "forged(None)")  # fmt: skip
"""What planners give back, or do."""

HOSTILE_PLANNER = """
import sys
import numpy as np
import fg_mujoco as fg

scan = odometry = None

class Odd(BaseException):
    def __str__(self): raise RuntimeError("no text")
    __repr__ = __str__
    def __float__(self): raise Odd
    __getattr__ = __float__

def forged(value):
    command = object.__new__(fg.DriveCommand)
    object.__setattr__(command, "steering_angle", value)
    object.__setattr__(command, "speed", value)
    return command

class Planner:
    name = {name}
    stage = {stage}
    def __init__(self, {parameter}): self.state = {init}
    def reset(self): {reset}
    def __call__(self, scan, odometry):
        return {call}
"""


def _planner_file(samples, here, rng):
    values = {"call": one_of(rng, ANSWERS), "name": "'a'", "stage": "1", "parameter": "*arguments, **others",
              "init": "0", "reset": "pass"}  # fmt: skip
    part = one_of(rng, ("call", "call", "call", "name", "stage", "init", "reset", "parameter"))
    values[part] = (one_of(rng, ANSWERS) if part != "parameter" else one_of(rng,
                        ("car", "mu", "x=1", "*a", "car, mu, y", "x=[]")))  # fmt: skip
    text = HOSTILE_PLANNER.format(**values).encode()
    (here / "planner.py").write_bytes(mutated(text, rng) if rng.random() < 0.2 and b"sys." not in text else text)
    return command(*race("--controller=planner.py:Planner"))


def hostile_scan(rng, stamp):
    """Return a scan of any number of beams, with anything in it."""
    count = int(one_of(rng, (1, 2, 3, 10, 101, 1081)))
    ranges = rng.uniform(0.05, 12.0, count)
    for value in (np.nan, np.inf, -np.inf, 0.0, -1.0, 1e308, 5e-324):
        ranges[rng.random(count) < one_of(rng, (0.0, 0.0, 0.1, 1.0))] = value
    span = float(one_of(rng, (4.7, 6.28, 1.0, 1e-6)))
    return fg.LaserScan(ranges=ranges, angle_min=-0.5 * span, angle_increment=span / max(1, count - 1),
                        angle_max=0.5 * span, range_min=0.06, range_max=12.0, stamp=stamp)  # fmt: skip


def _scans(samples, here, rng):
    name = one_of(rng, [name for name in bundled_names() if name != "pure_pursuit"])
    planner = make_controller(name, car=fg.Vehicle.load("f1tenth").parameters, mu=0.9, max_speed=5.0)
    numbers = rng.choice([0.0, 0.0, 1.0, -5.0, 1e9, 3.0], size=15)

    def drive():
        planner.reset()
        for step in range(3):
            odometry = fg.Odometry(stamp=0.025 * step, speed=numbers[0], steering_angle=0.1 * numbers[1],
                                   angular_velocity=numbers[2:5], linear_acceleration=numbers[5:8],
                                   wheel_speeds=numbers[8:12], pose=numbers[12:])  # fmt: skip
            command = planner(hostile_scan(rng, odometry.stamp), odometry)
            assert np.isfinite([command.steering_angle, command.speed]).all()
        return 0

    return drive


LAUNCH = """
import os, yaml
from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, GroupAction, IncludeLaunchDescription, OpaqueFunction
from launch.conditions import IfCondition
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution, PythonExpression
from launch_ros.actions import Node, PushRosNamespace, SetParameter

def later(context, factor=2):
    return [Node(package="car", executable="drive", parameters=[{"a": factor * [1]}])]

def generate_launch_description():
    share = get_package_share_directory("car")
    nodes = []
    for i, name in enumerate(["a", "b"] * 2):
        if i % 2 == 0:
            ros = ["--ros-args", "-p", "b:=1"]
            nodes += [Node(package="car", executable="drive", name=f"{name}_{i:02d}", arguments=ros)]
    values = yaml.safe_load(open(os.path.join(share, "car.yaml"), "r"))["car"]["ros__parameters"]
    return LaunchDescription([
        DeclareLaunchArgument("fast", default_value="true", choices=["true", "false"]),
        GroupAction([PushRosNamespace("ns"), SetParameter(name="c", value=values["speed"] * 2.0), *nodes],
                    condition=IfCondition(PythonExpression(["'", LaunchConfiguration("fast"), "' == 'true'"]))),
        IncludeLaunchDescription(PythonLaunchDescriptionSource(PathJoinSubstitution([share, "inner.launch.py"])),
                                 launch_arguments={"fast": "1"}.items()),
        OpaqueFunction(function=later, args=[3]),
    ])
"""
PARTS = ("None", "[]", "()", "{}", "''", "'a' * 9999999", "range(10**9)", "open('/dev/zero')",
         "LaunchConfiguration('x')", "Node()", "later()", "lambda: 0", "[i for i in 5]", "'%9999d' % 1",
         "'{:>{}}'.format(1, 9)", "10**9", "f'{1:>9}'", "PythonExpression(['1+'])", "GroupAction(1)",
         "OpaqueFunction()", "IfCondition()", "SetParameter()", "print(*[1])")  # fmt: skip
"""What takes the place of a line's end in a launch file."""


def _launch_file(samples, here, rng):
    (here / "package.xml").write_text("<package><name>car</name></package>")
    (here / "setup.py").write_text('"drive = node:main"')
    (here / "node.py").write_text("def main(): pass")
    (here / "car.yaml").write_text("car: {ros__parameters: {speed: 1.0}}")
    (here / "inner.launch.py").write_text("def generate_launch_description():\n    return []\n")
    lines = LAUNCH.splitlines(keepends=True)
    if rng.random() < 0.7:
        at = int(rng.integers(len(lines)))
        line = lines[at].rstrip("\n")
        cut = int(rng.integers(len(line) + 1))
        lines[at] = line[:cut] + one_of(rng, PARTS) + (line[cut:] if rng.random() < 0.5 else "") + "\n"
    text = "".join(lines).encode()
    (here / "car.launch.py").write_bytes(text if rng.random() < 0.5 else mutated(text, rng))
    return ignore_refusal(lambda: read_program("ros:car.launch.py"))


ENTITIES = {
    "car.launch.xml": """<launch><arg name="v" default="1.0"/><let name="n" value="$(var v)$(dirname)"/>
<group scoped="true" unless="$(equals $(var v) 2)"><push_ros_namespace namespace="a"/>
<node pkg="car" exec="drive" args="'a b' $(var v)"><param name="a" value="[$(var v), 2.0]"/><param name="b"><param
 name="c" value="1, 2" value-sep=", " type="list_of_float"/></param>
<remap from="x" to="/y"/><env name="E" value="$(optenv Z)"/>
<param from="$(find-pkg-share car)/car.yaml"/></node></group><include file="$(dirname)/inner.launch.py"/></launch>""",
    "car.launch.yaml": """launch:
- arg: {name: v, default: '1.0', choice: [{value: '1.0'}, {value: '2'}]}
- group: {scoped: false, if: $(or true false), children: [{set_parameter: {name: a, value: [1, 2]}}]}
- node: {pkg: car, exec: drive, name: $(anon d), param: [{name: b, value: $(var v)}, {from: car.yaml}]}
- include: {file: $(dirname)/inner.launch.py, arg: [{name: w, value: $(if $(not 0) 'a b' "c")}]}
""",
}


def _launch_entities(samples, here, rng):
    name = one_of(rng, list(ENTITIES))
    (here / "package.xml").write_text("<package><name>car</name></package>")
    (here / "drive.py").write_text("pass")
    (here / "car.yaml").write_text("car: {ros__parameters: {speed: 1.0}}")
    (here / "inner.launch.py").write_text("def generate_launch_description():\n    return []\n")
    (here / name).write_bytes(mutated(ENTITIES[name].encode(), rng))
    return ignore_refusal(lambda: launched(here / name, {}, "fuzz", Graph(10.0)))


class OddArray:
    """Cannot be read, nor written."""

    def __array__(self, *arguments, **settings):
        raise MemoryError

    def __repr__(self):
        raise RuntimeError("no\ntext")


SHOWN = (*VALUES, [(0.0, 1.0)] * 3, np.zeros((3, 2)), np.zeros((0, 2)), np.zeros((2, 2, 2)), np.full((4, 2), np.nan),
         np.full((9, 2), 1e308), np.ma.masked, np.array(None), np.zeros((5000, 2)), [[1], [1, 2]],
         np.datetime64("2020"), OddArray(), np.float16(1e4), np.zeros(1081, np.int8), iter((0.0, 1.0)))  # fmt: skip
NAMES = ("a", "b", "<b>&\n", "", "x" * 61, 3, None, OddArray(), np.str_("c"), "\0", "°/ä", "\ud800")
WAYS = (None, None, "points", "line", "polygon", "dots", 3, [], OddArray(), np.zeros(2))
PLACES = ("laser", "laser", "base_link", "map", "odom", 3, [], OddArray())


def _shown_values(samples, here, rng):
    """What a planner shows, with anything in it, on the page, in the live view and in a bag."""
    car = fg.Vehicle.load("f1tenth").parameters
    chosen = [tuple(one_of(rng, each) for each in (NAMES, SHOWN, WAYS, PLACES)) for _ in range(12)]
    scan = hostile_scan(rng, 0.025)
    chosen += [("scan", scan.ranges, None, "laser")]
    pose = rng.choice([0.0, 1.0, -5.0, np.nan], size=3)
    odometry = fg.Odometry(stamp=0.025, speed=0.0, steering_angle=0.0, angular_velocity=np.zeros(3),
                           linear_acceleration=np.zeros(3), wheel_speeds=np.zeros(4), pose=pose)  # fmt: skip

    class Planner:
        def reset(self): ...

        def __call__(self, scan, odometry):
            for name, value, draw, frame in chosen:
                fg.show(name, value, draw=draw, frame=frame)
            return fg.STOP

    def look():
        witness = Witness(Planner(), car)
        answer = witness.decide(scan, odometry, None)
        assert answer == fg.STOP and all("\n" not in remark for remark in witness.remarks)
        json.dumps(debug_page._decision(witness.look(0, scan, odometry, answer, answer), 1e-3, []), allow_nan=False)
        values = witness._values
        for sketch in values.sketches(scan, odometry.pose, car.lidar_offset):
            assert np.isfinite(sketch.points).all()
        return 0

    return look


TARGETS = {"launch_file": Target(attempt=_launch_file), "launch_entities": Target(attempt=_launch_entities),
           "shown_values": Target(attempt=_shown_values),
           "planner_settings": Target(attempt=_planner_settings, prepare=ring),
           "planner_file": Target(attempt=_planner_file), "scans": Target(attempt=_scans)}  # fmt: skip
