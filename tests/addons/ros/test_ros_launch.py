"""Launch files of ROS 2 in Python, and workspaces of several packages: what they start and leave out."""

import re
from pathlib import Path

import pytest

from cases import each
from fg_mujoco.addons.ros.node_host.program import read_program
from fg_mujoco.errors import ControllerError
from fg_mujoco.racing.planner_origin import source_code
from ros_planners import commands, make

DRIVE = """
import sys
import rclpy
from rclpy.node import Node
from sensor_msgs.msg import LaserScan
from ackermann_msgs.msg import AckermannDriveStamped
from my_lib.numbers import gain

class Drive(Node):
    def __init__(self):
        super().__init__("driver")
        self.declare_parameter("speed", 1.0)
        self.declare_parameter("back", False)
        self.declare_parameter("limits.top", 9.0)
        self.publisher = self.create_publisher(AckermannDriveStamped, "out", 1)
        self.create_subscription(LaserScan, "scan", self.take, 1)

    def take(self, message):
        out = AckermannDriveStamped()
        speed = min(self.get_parameter("speed").value * gain(), self.get_parameter("limits.top").value)
        out.drive.speed = -speed if self.get_parameter("back").value else speed
        out.drive.steering_angle = 0.01 * len(sys.argv[1:])
        self.publisher.publish(out)

def start(args=None):
    rclpy.init(args=args)
    rclpy.spin(Drive())
"""
HEAD = """
import os
import xacro
import yaml
from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import (DeclareLaunchArgument, GroupAction, IncludeLaunchDescription, OpaqueFunction, TimerAction,
                            SetLaunchConfiguration)
from launch.conditions import IfCondition, LaunchConfigurationEquals, UnlessCondition
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution, PythonExpression, TextSubstitution
from launch_ros.actions import Node, PushRosNamespace, SetParameter
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

def drive(**more):
    return Node(**{"package": "my_car", "executable": "drive", "remappings": [("out", "/drive")], **more})

def generate_launch_description():
"""
BOARD = """import rclpy
from ackermann_msgs.msg import AckermannDriveStamped
rclpy.init()
node = rclpy.create_node('board')
"""


DRIVE_XML = '<node pkg="my_car" exec="drive" name="driver"><remap from="out" to="/drive"/>{}</node>'
DRIVE_YAML = "node: {{pkg: my_car, exec: drive, name: driver, remap: [{{from: out, to: /drive}}]{}}}"


@pytest.fixture
def workspace(tmp_path):
    """Write a workspace of two packages, and return what writes a launch file and names it."""
    car, lib = tmp_path / "src" / "my_car", tmp_path / "src" / "tools" / "my_lib"
    for package in (car, lib):
        (package / package.name).mkdir(parents=True)
        (package / "package.xml").write_text(f"<package><name>{package.name}</name></package>")
        (package / package.name / "__init__.py").touch()
    (car / "launch").mkdir()
    (car / "config").mkdir()
    (car / "setup.py").write_text('setup(entry_points={"console_scripts": ["drive = my_car.drive_node:start"]})')
    (car / "my_car" / "drive_node.py").write_text(DRIVE)
    (lib / "my_lib" / "numbers.py").write_text("from .more import HALF\n\ndef gain():\n    return 2 * HALF\n")
    (lib / "my_lib" / "more.py").write_text("HALF = 0.5\n")
    (car / "config" / "car.yaml").write_text("driver:\n  ros__parameters: {speed: 1.5, limits: {top: 4.0}, other: 3}\n")
    (car / "launch" / "inner.launch.py").write_text(
        HEAD
        + """
    return LaunchDescription([
        DeclareLaunchArgument("fast", default_value="1.25"),
        drive(parameters=[{"speed": LaunchConfiguration("fast")}]),
    ])
"""
    )

    def write(body, name="race.launch.py"):
        path = car / "launch" / name
        indented = "".join(f"    {line}\n" for line in body.splitlines())
        path.write_text(HEAD + indented if name.endswith(".py") else body)
        return f"ros:{path}"

    return write


def speeds(source, count=2, **settings):
    """Return the speed of the last command, and its steering angle in hundredths: the number of arguments."""
    speed, angle = commands(make(source, **settings), count)[-1]
    return speed, round(100 * angle)


@each("body, speed",
    [("return LaunchDescription([drive(parameters=[{'speed': 2.5}])])", 2.5),
     ("ld = LaunchDescription()\nld.add_action(drive(parameters=[{'speed': 3}]))\nreturn ld", 3.0),
     ("share = get_package_share_directory('my_car')\n"
      "return LaunchDescription([drive(name='driver', parameters=[os.path.join(share, 'config', 'car.yaml')])])", 1.5),
     ("file = PathJoinSubstitution([FindPackageShare('my_car'), 'config', 'car.yaml'])\n"
      "return LaunchDescription([drive(name='driver', parameters=[file, {'speed': 30.0}])])", 4.0),
     ("path = os.path.join(os.path.dirname(__file__), 'inner.launch.py')\n"
      "return LaunchDescription([IncludeLaunchDescription(PythonLaunchDescriptionSource([path]))])", 1.25),
     ("back = LaunchConfiguration('back')\nreturn LaunchDescription([\n"
      "    DeclareLaunchArgument('back', default_value='true'),\n"
      "    drive(parameters=[{'back': ParameterValue(back, value_type=bool)}], condition=IfCondition(back)),\n"
      "    drive(package='nothing', condition=UnlessCondition(back))])", -1.0),
     ("mode = LaunchConfiguration('mode')\nreturn LaunchDescription([\n"
      "    DeclareLaunchArgument('mode', default_value='slow'),\n"
      "    drive(parameters=[{'speed': 4.0}], condition=LaunchConfigurationEquals('mode', 'fast')),\n"
      "    drive(parameters=[{'speed': 0.5}],\n"
      "          condition=IfCondition(PythonExpression([\"'\", mode, \"' == 'slow'\"])))])", 0.5),
     ("def later(context, factor):\n" "    speed = float(LaunchConfiguration('v').perform(context)) * factor\n"
      "    return [drive(parameters=[{'speed': speed}])]\n"
      "return LaunchDescription([DeclareLaunchArgument('v', default_value='1.5'),\n"
      "    OpaqueFunction(function=later, args=[2.0])])", 3.0),
     ("nodes = []\nfor i, speed in enumerate([1.0, 2.0]):\n    if i > 0:\n"
      "        nodes += [drive(parameters=[{'speed': speed + 0.25}], name=f'driver_{i}')]\n"
      "return LaunchDescription([TimerAction(period=1.0, actions=[GroupAction([SetParameter('limits.top', 2.0),\n"
      "    *nodes])])])", 2.0),
     ("return LaunchDescription([GroupAction([PushRosNamespace('car'),\n"
      "    drive(remappings=[('out', TextSubstitution(text='/drive')), ('/car/scan', '/scan')])])])", 1.0)])
def test_a_launch_file_in_python_starts_its_nodes(body, speed, workspace):
    assert speeds(workspace(body))[0] == speed


def xml(*entities):
    return "".join(f"{each}\n" for each in ("<launch>", *entities, "</launch>"))


@each("name, text, speed",
    [("a.launch.xml", xml('<arg name="v" default="2.5"/>',
                          DRIVE_XML.format('<param name="speed" value="$(var v)"/>')), 2.5),
     ("a.xml", xml(DRIVE_XML.format('<param name="limits"><param name="top" value="0.5"/></param>')), 0.5),
     ("a.launch.xml", xml(DRIVE_XML.format('<param from="$(find-pkg-share my_car)/config/car.yaml" '
                                           'allow_substs="true"/>')), 1.5),
     ("a.launch.xml", xml(DRIVE_XML.format('<param from="$(dirname)/../config/car.yaml"/>'
                                           '<param name="speed" value="30." type="float"/>')), 4.0),
     ("a.launch.xml", xml('<let name="m" value="fast"/>', '<group if="$(eval &quot;\'$(var m)\' == \'fast\'&quot;)">',
                          '<set_parameter name="speed" value="3.0"/>', DRIVE_XML.format(""), "</group>",
                          '<node pkg="gone" exec="x" unless="$(equals $(var m) fast)"/>'), 3.0),
     ("a.launch.xml", xml('<group><let name="v" value="9."/><push-ros-namespace namespace="car"/></group>',
                          '<arg name="v" default="0.75"/>', '<include file="$(dirname)/inner.launch.py">',
                          '<arg name="fast" value="$(var v)"/></include>'), 0.75),
     ("a.launch.xml", xml('<set_env name="BACK" value="true"/>', DRIVE_XML.format(
         '<param name="back" value="$(env BACK false)"/><env name="GAIN" value="$(optenv NONE 2.0)"/>')), -2.0),
     ("a.launch.xml", xml(DRIVE_XML.format("").replace(" name", ' args="$(dirname) \'b c\'" ros_args="-p speed:=2.0" '
                                                       "name")), 2.0),
     ("a.launch.yaml", "launch:\n- arg: {name: v, default: '2.5'}\n- "
                       + DRIVE_YAML.format(", param: [{name: speed, value: $(var v)}]"), 2.5),
     ("a.yaml", "launch:\n  - group:\n    - set_parameter: {name: speed, value: 3.0}\n    - "
                + DRIVE_YAML.format(", param: [{from: $(find-pkg-share my_car)/config/car.yaml}]"), 3.0),
     ("a.launch.yml", "launch:\n- group: {scoped: false, if: 'true', children: [{let: {name: b, value: 'true'}}]}\n- "
                      + DRIVE_YAML.format(", param: [{name: back, value: $(var b)}, {name: speed, value: 2.0}]"), -2.0),
     ("b.yaml", "launch:\n- include: {file: $(dirname)/inner.launch.py, arg: [{name: fast, value: '0.5'}]}", 0.5)])
def test_a_launch_file_in_xml_or_yaml_starts_what_one_in_python_does(name, text, speed, workspace):
    source = workspace(text, name)
    node = Path(source.removeprefix("ros:")).parents[1] / "my_car" / "drive_node.py"
    text = DRIVE.replace("gain(),", "gain() * float(os.environ.get('GAIN', 1)),")
    node.write_text(text.replace("import sys", "import os\nimport sys"))
    path = Path(source.removeprefix("ros:"))
    outer = workspace(f"source = AnyLaunchDescriptionSource({str(path)!r})\n"
                      "return LaunchDescription([IncludeLaunchDescription(source)])")
    head = Path(outer.removeprefix("ros:"))
    head.write_text(head.read_text().replace("import PythonLaunch", "import AnyLaunchDescriptionSource, PythonLaunch"))
    assert speeds(source)[0] == speeds(outer)[0] == speed


@each("text, said",
      [(xml('<arg name="v"/>', DRIVE_XML.format("")), r"'v' has no default \(.*a.launch.xml, line 2\); .*launch.v="),
       (xml(DRIVE_XML.format('<parm name="speed"/>')), r"node has 'parm'; accepted: param, .*xml, line 2\)"),
       (xml('<node pkg="my_car" exe="drive"/>'), r"node has 'exe'; accepted: .*exec.* line 2\)"),
       (xml(DRIVE_XML.format('<param name="speed" value="2" type="double"/>')), r"type is 'double'; accepted: .*float"),
       (xml("<nod/>"), r"the entity 'nod' is not known; accepted: .*node.* line 2\)"),
       (xml(DRIVE_XML.format('<param name="speed" value="$(arg v)"/>')), r"\$\(arg\) is not known; accepted: .*line 2"),
       (xml(DRIVE_XML.format('<param name="speed" value="$(var v"/>')), r"a substitution without its end.*line 2\)"),
       (xml(DRIVE_XML.format('<param name="speed" value="$(var w)"/>')), r"argument 'w' is not declared \(.*line 2\)"),
       (xml(DRIVE_XML.format("").replace("<node", '<node if="maybe"')), r"a condition is 'maybe' \(.*line 2\)"),
       (xml('<let name="v"/>'), r"let has no 'value'; accepted: name, value, if.* \(.*line 2\)"),
       (xml("<executable cmd='ls'/>"), r"starts no node .*left out are executable \(.*line 2\)"),
       (xml(DRIVE_XML.format('<param from="$(dirname)/a.launch.xml" allow_substs="1"/>')), r"has substitutions .*2"),
       ("<launch><node></launch>", r"mismatched tag: line 1"),
       ("<robot><launch/></robot>", r"begins with 'robot'; accepted: launch")])
def test_what_a_launch_file_in_xml_fails_of_is_named_with_its_line(text, said, workspace):
    with pytest.raises(ControllerError, match=said):
        speeds(workspace(text, "a.launch.xml"))


@each("place, cmake",
      [("nodes/deep/wheels.py", "install(PROGRAMS\n  nodes/deep/wheels.py\n  DESTINATION lib/${PROJECT_NAME})"),
       ("nodes/drive.py", "install(PROGRAMS nodes/drive.py DESTINATION lib/my_car RENAME wheels)"),
       ("a/wheels", 'set(ALL "${CMAKE_CURRENT_SOURCE_DIR}/a/wheels")\ninstall(PROGRAMS ${ALL} DESTINATION lib/x)'),
       ("my_car/a/wheels.py", "install(PROGRAMS ${PROJECT_NAME}/a/wheels.py DESTINATION lib/${PROJECT_NAME})"),
       ("b/wheels.py", "install(DIRECTORY b/ DESTINATION lib/${PROJECT_NAME})  # not a/wheels.py")])
def test_an_executable_is_the_file_that_cmake_installs_from_any_folder(place, cmake, workspace):
    source = workspace("return LaunchDescription([drive(executable='wheels')])")
    package = Path(source.removeprefix("ros:")).parents[1]
    (package / "CMakeLists.txt").write_text(cmake)
    (package / place).parent.mkdir(parents=True, exist_ok=True)
    (package / place).write_text(f"#!/usr/bin/env python3\n{DRIVE.replace('1.0)', '2.25)')}\nstart()\n")
    assert speeds(source)[0] == 2.25
    (package / "CMakeLists.txt").write_text(f"add_executable(wheels src/wheels.cpp)\n{cmake}")
    with pytest.raises(ControllerError, match="wheels of my_car, of which there is no Python file"):
        speeds(source)
    (package / place).unlink()


def test_launch_arguments_are_given_in_brackets_and_checked(workspace):
    source = workspace("return LaunchDescription([DeclareLaunchArgument('v', default_value='2.0'),\n"
        "    DeclareLaunchArgument('side', default_value='left', choices=['left', 'right']),\n"
        "    drive(parameters=[{'speed': LaunchConfiguration('v')}],\n"
        "          arguments=['one', '--ros-args', '--log-level', 'info', '-p', 'back:=true', '--', 'two'])])")
    assert speeds(source) == (-2.0, 2)
    assert speeds(source, **{"launch.v": 3})[0] == -3.0
    assert speeds(source, speed=1.5)[0] == -1.5
    with pytest.raises(ControllerError, match=r"has no launch argument 'w'; accepted: side, v"):
        speeds(source, **{"launch.w": 3})
    with pytest.raises(ControllerError, match=r"launch.side is 'up' \(.*line 21\); accepted: left, right"):
        speeds(source, **{"launch.side": "up"})
    with pytest.raises(ControllerError, match="no launch argument 'v'; accepted: with a launch file of ROS 2"):
        speeds(f"ros:{Path(__file__).parent / 'ros_nodes' / 'wall_follow.py'}", **{"launch.v": 1})


def test_nodes_that_are_not_here_are_left_out_with_a_warning(workspace):
    source = workspace(
        "return LaunchDescription([drive(), Node(package='rviz2', executable='rviz2', arguments=[xacro.process()]),\n"
        "    Node(package='f1tenth_gym_ros', executable='gym_bridge'), Node(package='my_car', executable='wheels'),\n"
        "    IncludeLaunchDescription(PythonLaunchDescriptionSource(get_package_share_directory('nav2') + '/a.py'))])"
    )
    with pytest.warns(UserWarning) as caught:
        assert speeds(source)[0] == 1.0
    said = next(str(each.message) for each in caught if "left out are" in str(each.message))
    assert re.search(r"rviz2 of rviz2, whose package is not here \(.*race.launch.py, line 20\)", said)
    assert "gym_bridge of f1tenth_gym_ros, which this simulator replaces" in said
    assert "wheels of my_car, of which there is no Python file" in said
    assert "package 'nav2' is not here" in said


@each("first", [True, False])
@each("fails, said",
      [("import no_such_module\nno_such_module.show()", r"No module named 'no_such_module' \(.*board, line 2\)"),
       (f"{BOARD}node.create_publisher(AckermannDriveStamped, '/nav', 1)\nopen('/dev/none')", "FileNotFoundError"),
       ("print 'python 2'", "it is Python 2"),
       (f"{BOARD}node.create_timer(0.04, lambda: 1 / 0)\nrclpy.spin(node)", "division by zero")])  # fmt: skip
def test_a_node_that_fails_and_that_no_other_needs_ends_alone_with_a_warning(fails, said, first, workspace):
    nodes = ["Node(package='my_car', executable='board')", "drive()"]
    source = workspace(f"return LaunchDescription([{', '.join(nodes if first else nodes[::-1])}])")
    board = Path(source.removeprefix("ros:")).parents[1] / "scripts" / "board"
    board.parent.mkdir(exist_ok=True)
    board.write_text(f"#!/usr/bin/env python3\n{fails}\n")
    with pytest.warns(UserWarning, match=rf"{said}.*; the other nodes drive on"):
        assert speeds(source, 4)[0] == 1.0


def test_nodes_that_all_fail_or_a_driver_that_fails_in_the_race_are_refused(workspace):
    source = workspace("return LaunchDescription([drive(), Node(package='my_car', executable='board')])")
    car = Path(source.removeprefix("ros:")).parents[1]
    (car / "scripts").mkdir()
    (car / "scripts" / "board").write_text("#!/usr/bin/env python3\nimport rclpy\nrclpy.init()\nopen('/dev/none')\n")
    node = car / "my_car" / "drive_node.py"
    text = node.read_text()
    node.write_text(text.replace("out = Ack", "out = 1 / 0 and Ack"))
    with (pytest.warns(UserWarning, match="drive on"),
          pytest.raises(Exception, match=r"division by zero \(.*drive_node")):  # fmt: skip
        speeds(source)
    node.write_text(text.replace("def __init__(self):", "def __init__(self):\n        1 / 0"))
    with pytest.warns(UserWarning, match="drive on"), pytest.raises(ControllerError, match="FileNotFoundError"):
        speeds(source)


@each("body, said",
      [("return LaunchDescription([drive(parameters=[{'speed': guess()}])])", r"'guess' is not .*, line 20\)"),
       ("n = xacro.process('a').toxml()\nreturn LaunchDescription([drive(executable=n)])", "'xacro' .*, line 17"),
       ("if xacro.process('a'):\n    pass\nreturn LaunchDescription([drive()])", r"named 'xacro'.*, line 20\)"),
       ("while True:\n    pass", r"not come back within 0.5 s .*, line (20|21)\)"),
       ("return LaunchDescription([drive(condition=IfCondition('maybe'))])", r"a condition is 'maybe' .*, line 17\)"),
       ("return LaunchDescription([drive(condition=IfCondition(LaunchConfiguration('x')))])", "'x' is not declared"),
       ("return LaunchDescription([DeclareLaunchArgument('x'), drive()])", r"'x' has no default .*\[launch.x=VALUE\]"),
       ("return LaunchDescription([])", "starts no node that is here; accepted: nodes in Python"),
       ("return LaunchDescription([drive(package='gone')])", "no node .*left out are drive of gone, whose package"),
       ("return LaunchDescription([drive(remappings=['out'])])", r"a remapping is 'out' .*accepted: \(from, to\)"),
       ("x = PythonExpression('1 / 0')\nreturn [drive(name=x)]", r"ZeroDivisionError: .* \(.*, line 20\)"),
       ("def f():\n    return f()\nf()\nreturn LaunchDescription([drive()])", "has failed: RecursionError"),
       ("return LaunchDescription([Node(package='my_' + 'lib', executable='tool')])", "starts .*tool, of a package")])
def test_what_a_launch_file_fails_of_is_named_with_its_line(body, said, workspace):
    source = workspace(body)
    scripts = Path(source.removeprefix("ros:")).parents[2] / "tools" / "my_lib" / "scripts"
    scripts.mkdir(exist_ok=True)
    (scripts / "tool").write_text("#!/usr/bin/env python3\n")
    node = scripts.parents[2] / "my_car" / "my_car" / "drive_node.py"
    node.write_text(node.read_text().replace("from my_lib.numbers import gain", "gain = float"))
    with pytest.raises(ControllerError, match=said):
        speeds(source, **{"host.wall_limit": 0.5})


def test_a_launch_file_is_executed_when_its_planner_is_built_and_not_before(workspace, tmp_path):
    mark = tmp_path / "executed"
    source = workspace(f"open({str(mark)!r}, 'w').write('x')\nreturn LaunchDescription([drive()])")
    assert read_program(source).text
    assert not mark.exists()
    assert speeds(source)[0] == 1.0
    assert mark.exists()


def test_a_launch_file_is_a_program_with_classes_loops_and_modules_of_its_own(workspace):
    body = """
from my_car.launch_tools import Speed, one
import launch.substitutions, launch_ros
while one() < 1:
    pass
try:
    nodes = [xacro.node(), IncludeLaunchDescription(os.path.join(get_package_share_directory("gone"), "a.py"))]
except KeyError:
    nodes = []
file = os.path.join(get_package_share_directory("gone"), "config", "car.yaml")  # is found here
speed = yaml.safe_load(open(file))["driver"]["ros__parameters"]["speed"]
nodes.append(launch_ros.actions.Node(package="my_car", executable="drive", remappings=[("out", "/drive")],
    parameters=[{"speed": Speed(speed).value + int(launch.substitutions.TextSubstitution(text="1").perform(None))}]))
return LaunchDescription(nodes)
"""
    source = workspace(body.strip())
    (Path(source.removeprefix("ros:")).parents[1] / "my_car" / "launch_tools.py").write_text(
        "def one():\n    return 1\nclass Speed:\n    def __init__(self, value):\n        self.value = value\n"
    )
    with pytest.warns(UserWarning) as caught:
        assert speeds(source)[0] == 2.5
    said = " ".join(str(each.message) for each in caught)
    assert ("car.yaml is taken" in said and "No module named 'xacro'" in said
            and "package 'gone' is not here/a.py" in said)  # fmt: skip


def test_the_hash_of_a_launch_file_covers_what_it_may_start(workspace):
    source = workspace("return LaunchDescription([drive(condition=IfCondition('true'))])")
    helpers = Path(source.removeprefix("ros:")).parents[2] / "others" / "helpers"  # of a package of another name
    helpers.mkdir(parents=True)
    (helpers.parent / "package.xml").write_text("<package><name>team_tools</name></package>")
    (helpers / "__init__.py").write_text("LIMIT = 7\n")
    lib = helpers.parents[1] / "tools" / "my_lib" / "my_lib" / "more.py"
    lib.write_text(lib.read_text() + "from helpers import LIMIT\n")
    text = source_code(type(make(source)))
    for part in ("def start(args=None)", "HALF = 0.5", "return 2 * HALF", "LIMIT = 7", "generate_launch_description"):
        assert part.encode() in text
