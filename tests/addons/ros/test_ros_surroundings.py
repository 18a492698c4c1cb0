"""What nodes of ROS are told beyond the LiDAR: the map, the other cars; and AutoDRIVE's topics, services, actions."""

import math
import warnings
from dataclasses import replace

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.addons.ros.node_host.sensing import STEERING, THROTTLE
from fg_mujoco.messages import Reading
from fg_mujoco.vehicle.sensors.bundled import Imu
from fg_mujoco.vehicle.sensors.vesc import Vesc
from ros_planners import ODOMETRY, ROS2, SCAN, commands, make, node2, speeds
from scan_worlds import CAR, odometry_of

METRE = 4614.0 / 2 / 60.0 * math.tau  # [rad/m] of the VESC's motor
FORCE = METRE * 60.0 / math.tau / 3500.0  # [N/A]

MAP = """
grid = self.got["map"]
cells = np.array(grid.data, dtype=np.int8).reshape(grid.info.height, grid.info.width)
at = self.got["odom"].pose.pose.position
column = int((at.x - grid.info.origin.position.x) / grid.info.resolution)
row = int((at.y - grid.info.origin.position.y) / grid.info.resolution)
assert grid.header.frame_id == "map" and cells[row, column] == 0, cells[row, column]
assert set(np.unique(cells)) == {-1, 0, 100}
# the first occupied cell to the left, square to the car's way, is where the LiDAR sees the wall
beam = int((np.pi / 2 - message.angle_min) / message.angle_increment + 0.5)
lidar = self.got["odom"].pose.pose.orientation
heading = 2 * np.arctan2(lidar.z, lidar.w)
x = at.x + 0.275 * np.cos(heading)
y = at.y + 0.275 * np.sin(heading)
seen = message.ranges[beam]
wall = [x - seen * np.sin(heading), y + seen * np.cos(heading)]
column, row = (int((w - o) / grid.info.resolution) for w, o in zip(
    wall, (grid.info.origin.position.x, grid.info.origin.position.y)))
assert (cells[row - 1:row + 2, column - 1:column + 2] == 100).any()
self.drive(1.0)
"""


def test_a_node_gets_the_map_once_with_the_walls_that_the_lidar_sees(tmp_path):
    init = """
latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
self.create_subscription(OccupancyGrid, "/map", self.take, latched)
self.create_subscription(MapMetaData, "/map_metadata", lambda m: self.got.update(info=m), latched)
self.create_subscription(Odometry, "/odom", lambda m: self.got.update(odom=m), 1)
self.taken = 0
"""
    more = """
    def take(self, message):
        self.taken += 1
        assert self.taken == 1
        self.got["map"] = message
"""
    body = "if 'odom' not in self.got: return\n" + MAP + "assert self.got['info'].width == grid.info.width\n"
    result = fg.race("oval", node2(tmp_path, body, init, more), laps=1, time_limit=1.0)
    assert result.car.max_speed_m_s == pytest.approx(1.0, abs=0.05)


def test_a_node_gets_the_odometry_of_the_other_car_and_that_of_an_opponent_its_own(tmp_path):
    """The other car stands where its own /odom says; both are the poses of the engine."""
    logs = [str(tmp_path / name) for name in ("log.txt", "opponent.txt")]
    writes = """
    def other(self, message):
        p, q = message.pose.pose.position, message.pose.pose.orientation
        print(message.header.stamp.sec, message.header.stamp.nanosec, p.x, p.y, q.z, message.twist.twist.linear.x,
              file=self.file, flush=True)
"""
    opens = 'self.create_subscription(Odometry, "/opp_racecar/odom", self.other, 1)\nself.file = open({!r}, "w")\n'
    ego = node2(tmp_path, "self.drive(1.5)", opens.format(logs[0]), writes)
    listens = 'self.create_subscription(Odometry, "/opp_racecar/opp_odom", lambda m: self.got.update(ego=m), 1)\n'
    head = ROS2.replace('"/drive"', '"/opp_drive"').replace('"/scan"', '"/opp_scan"')
    opponent = node2(tmp_path, "if 'ego' in self.got: self.drive(1.0)", listens + opens.format(logs[1]), writes, head,
                     "opponent.py")  # fmt: skip
    entries = [fg.Entry(controller=ego), fg.Entry(controller=opponent)]
    result = fg.race("oval", entries=entries, laps=1, time_limit=2.0)
    assert [round(car.max_speed_m_s, 1) for car in result.cars] == [1.5, 1.0]
    seen, own = map(np.loadtxt, logs)
    assert len(seen) == len(own) > 70
    np.testing.assert_allclose(seen[:, :5], own[:, :5], atol=1e-12)
    np.testing.assert_allclose(seen[40:, 5], own[40:, 5], atol=0.05)  # over ground; of the wheels


@pytest.mark.slow
def test_nodes_with_a_map_and_others_have_the_same_bits_alone_and_in_threads(tmp_path):
    body = "assert len(self.got['map'].data) > 1000\nself.drive(1.0 + message.ranges[540] / 100.0)"
    init = 'self.create_subscription(OccupancyGrid, "/map", lambda m: self.got.update(map=m), 1)'
    source = node2(tmp_path, body, init)
    alone = fg.rollout("oval", source, n=4, laps=1, time_limit=0.6)
    other = fg.rollout("oval", source, n=4, laps=1, time_limit=0.6, executor="processes", workers=1)
    assert (alone["max_speed_m_s"] > 0.5).all()
    for name in ("distance_m", "max_speed_m_s"):
        assert alone[name].tolist() == other[name].tolist()


VESC = """
if 'core' not in self.got: return
odom, pose, imu, core = (self.got[name] for name in ("odom", "pose", "imu", "core"))
assert (odom.pose.pose.position.x, odom.pose.pose.position.y, odom.twist.twist.linear.x) == (1.0, 2.0, 3.0)
assert abs(2 * np.arctan2(odom.pose.pose.orientation.z, odom.pose.pose.orientation.w) - 0.5) < 1e-12
assert odom.twist.twist.angular.z == 0.7 and (pose.pose.pose.position.x, pose.pose.pose.position.y) == (3.0, 4.0)
assert (imu.angular_velocity.z, imu.linear_acceleration.y, imu.header.stamp.nanosec) == (3.0, 5.0, 20_000_000)
state = core.state
assert (state.speed, state.voltage_input, state.duty_cycle) == (13842.0, 12.4, 0.16)
assert (state.current_motor, state.current_input, state.temp_motor) == (20.0, 3.0, 25.0)
there = self.buffer.lookup_transform("map", "base_link", Time()).transform.translation
assert abs(there.x - 3.0) + abs(there.y - 4.0) < 1e-9
own = self.buffer.lookup_transform("odom", "base_link", Time()).transform.translation
assert abs(own.x - 1.0) + abs(own.y - 2.0) < 1e-9
self.drive(1.0)
"""


def test_topics_are_those_of_the_cars_vesc_and_imu(tmp_path):
    imports = ("sensor_msgs.msg import Imu", "rclpy.time import Time", "vesc_msgs.msg import VescStateStamped",
               "tf2_ros import Buffer, TransformListener")  # fmt: skip
    head = "".join(f"from {each}\n" for each in imports) + ROS2
    topics = {"odom": ("Odometry", "/odom"), "pose": ("Odometry", "/pf/pose/odom"),
              "imu": ("Imu", "/sensors/imu/raw"), "core": ("VescStateStamped", "/sensors/core")}  # fmt: skip
    init = "self.buffer = Buffer()\nself.listener = TransformListener(self.buffer, self)\n"
    for name, (kind, topic) in topics.items():
        init += f'self.create_subscription({kind}, "{topic}", lambda m: self.got.update({name}=m), 1)\n'
    values = np.array((3.0, 0.2, 0.7, 1.0, 2.0, 0.5, 13842.0, 12.4, 0.16, 20.0, 3.0, 25.0))
    readings = {
        "vesc": Reading(stamp=0.02, values=values, columns=Vesc.columns),
        "imu": Reading(stamp=0.02, values=np.arange(1.0, 7.0), columns=Imu.columns),
    }
    told = {"speed": 3.0, "angular_velocity": np.array((0.0, 0.0, 0.7)), "pose": np.array((3.0, 4.0, 1.2))}
    planner = make(node2(tmp_path, VESC, init, head=head))
    odometry = replace(odometry_of(3.0), readings=readings, **told)
    assert commands(planner, 4, odometry)[-1][0] == 1.0


AUTODRIVE = """
import rclpy
from rclpy.node import Node
from geometry_msgs.msg import Point
from sensor_msgs.msg import Imu, LaserScan
from std_msgs.msg import Float32


class Mine(Node):
    def __init__(self):
        super().__init__("racer")
        self.got = {}
        for name, kind in (("ips", Point), ("imu", Imu), ("speed", Float32), ("steering", Float32)):
            self.create_subscription(kind, f"/autodrive/CAR/{name}", lambda m, name=name: self.got.update({name: m}), 1)
        self.create_subscription(LaserScan, "/autodrive/CAR/lidar", self.callback, 1)
        self.throttle = self.create_publisher(Float32, "/autodrive/CAR/throttle_command", 1)
        self.steering = self.create_publisher(Float32, "/autodrive/CAR/steering_command", 1)

    def callback(self, message):
        assert message.header.frame_id == "lidar" and round(message.range_max, 6) == 10.0
        assert message.ranges[0] == float("inf") and message.ranges[1] == 9.75
        assert abs(self.got["imu"].linear_acceleration.z) < 1e-9 and self.got["imu"].linear_acceleration.x == 0.5
        assert len(message.ranges) > 100 and (self.got["ips"].x, self.got["ips"].y) == (3.0, 4.0)
        assert abs(self.got["imu"].orientation.z - 0.5 ** 0.5) < 1e-9 and self.got["speed"].data == 1.0
        self.throttle.publish(Float32(data=0.1))
        self.steering.publish(Float32(data=0.25 + self.got["steering"].data))
"""


@each("asked, expected",
      [("at.position.x", 2.0 * math.sin(1.0)),
       ("at.position.y", 2.0 * (1.0 - math.cos(1.0))),
       ("2 * np.arctan2(at.orientation.z, at.orientation.w)", 1.0)])  # fmt: skip
def test_a_node_that_is_told_no_pose_gets_the_one_that_follows_from_speed_and_yaw_rate(asked, expected, tmp_path):
    """After 1 s at 2 m/s and 1 rad/s: on a circle of 2 m, a rad further."""
    init = 'self.create_subscription(Odometry, "/odom", lambda m: self.got.update(odom=m), 1)'
    body = f"if 'odom' not in self.got: return\nat = self.got['odom'].pose.pose\nself.drive(float({asked}))"
    planner = make(node2(tmp_path, body, init))
    turning = replace(odometry_of(2.0), angular_velocity=np.array((0.0, 0.0, 1.0)))
    # the scan of a tick is heard before its odometry
    assert commands(planner, 42, turning)[-1][0] == pytest.approx(expected, abs=1e-3)


@each("car", ["f1tenth_1", "roboracer_1"])
def test_a_node_of_autodrive_drives_by_throttle_and_steering(car, tmp_path):
    path = tmp_path / "racer.py"
    path.write_text(AUTODRIVE.replace("CAR", car))
    planner = make(f"ros:{path}:Mine")
    told = {"pose": np.array((3.0, 4.0, math.pi / 2)), "linear_acceleration": np.array((0.5, 0.0, CAR.gravity))}
    ranges = np.concatenate(((12.0, 9.75), SCAN.ranges[2:]))
    senses = [(replace(SCAN, stamp=t, ranges=ranges), replace(ODOMETRY, stamp=t, **told)) for t in (0.0, 0.025)]
    found = [(command.speed, command.steering_angle) for command in (planner(*each) for each in senses)]
    assert found[0][0] == pytest.approx(2.5, abs=0.03)  # as the league's simulator at a throttle of 0.1
    expected = [0.1 * THROTTLE, 0.25 * STEERING, 0.1 * THROTTLE, 0.5 * STEERING]
    assert np.ravel(found).tolist() == pytest.approx(expected, rel=1e-6)


MOTOR = """
self.motors = {name: self.create_publisher(Float64, f"/vesc/commands/motor/{name}", 1)
               for name in ("speed", "duty_cycle", "current", "brake")}
self.servo = self.create_publisher(Float64, "/vesc/commands/servo/position", 1)
"""


@each("body, expected",
      [("turn('duty_cycle', 0.1)", 1.26 * 3500.0 / 60.0 * math.tau / METRE),  # the turns of 1.26 V, of 12.6
       ("turn('speed', 4614.0)\nif self.calls > 4: turn('duty_cycle', 0.0)", 0.0),
       ("turn('current', 10.0)", 1.0 + 0.475 * 10.0 * FORCE / CAR.mass),
       ("turn('current', -10.0 if self.calls > 19 else 0.0)", 1.0 - 0.025 * 10.0 * FORCE / CAR.mass),
       ("turn('speed', 9228.0)\nif self.calls > 10: turn('brake', 10.0)", 1.0 - 0.225 * 10.0 * FORCE / CAR.mass),
       ("turn('brake', 80.0)", 0.0)])  # fmt: skip
def test_the_vescs_motor_is_driven_by_speed_duty_current_and_brake(body, expected, tmp_path):
    """After 20 ticks of a car at 1 m/s."""
    head = ROS2.replace("import Bool, ", "import Bool, Float64, ")
    head = head.replace('self.create_publisher(AckermannDriveStamped, "/drive", 10)', "None")
    turn = "def turn(name, value): self.motors[name].publish(Float64(data=value))\n"
    turn += "self.servo.publish(Float64(data=0.5304))\n"
    found = commands(make(node2(tmp_path, turn + body, MOTOR, head=head)), 20)
    assert found[-1] == (pytest.approx(expected, abs=1e-6), pytest.approx(0.0, abs=1e-9))


def test_a_motor_that_is_braked_beside_the_drive_topic_is_told_once(tmp_path):
    head = ROS2.replace("import Bool, ", "import Bool, Float64, ")
    body = "self.drive(1.0)\nself.motors['brake'].publish(Float64(data=9.0))"
    planner = make(node2(tmp_path, body, MOTOR, head=head))
    with pytest.warns(UserWarning, match=r"/vesc/commands/motor/brake .*which is not read: /drive drives") as caught:
        assert speeds(planner, 3) == [1.0] * 3
    assert len(caught) == 1


TEAM = """
import rclpy
from rclpy.action import ActionClient, ActionServer
from rclpy.executors import MultiThreadedExecutor
from rclpy.node import Node
from ackermann_msgs.msg import AckermannDriveStamped
from nav2_msgs.action import NavigateToPose
from std_srvs.srv import SetBool
from team.srv import Plan
"""
SERVER = """
class Server(Node):
    def __init__(self):
        super().__init__("server")
        self.create_service(Plan, "plan", self.plan)
        self.create_service(SetBool, "/enable", self.enable)
        self.actions = ActionServer(self, NavigateToPose, "go", self.go)
    def plan(self, request, response):
        response.speed, response.why = 2.0 * request.wish, "because"
        return response
    async def enable(self, request, response):
        response.success = request.data
        return response
    def go(self, handle):
        handle.publish_feedback(NavigateToPose.Feedback(left=1.0))
        handle.succeed()
        return NavigateToPose.Result(reached=handle.request.far)

def main():
    rclpy.init()
    rclpy.spin(Server())
"""
CLIENT = """
class Client(Node):
    def __init__(self):
        super().__init__("client")
        self.publisher = self.create_publisher(AckermannDriveStamped, "drive", 1)
        self.plan, self.enable = self.create_client(Plan, "plan"), self.create_client(SetBool, "enable")
        self.go = ActionClient(self, NavigateToPose, "go")
        assert self.plan.wait_for_service(timeout_sec=1.0) and self.go.wait_for_server(timeout_sec=1.0)
        assert not self.create_client(Plan, "nothing").wait_for_service(timeout_sec=0.01)
        future = self.plan.call_async(Plan.Request(wish=0.75))
        rclpy.spin_until_future_complete(self, future)
        assert future.result().why == "because"
        self.speed, self.left = future.result().speed, 0.0
        self.create_timer(0.02, self.timer)
    async def timer(self):
        assert (await self.enable.call_async(SetBool.Request(data=True))).success
        handle = await self.go.send_goal_async(NavigateToPose.Goal(far=3.0), feedback_callback=self.feedback)
        result = await handle.get_result_async()
        message = AckermannDriveStamped()
        message.drive.speed = self.speed + self.left + result.result.reached / 4.0
        self.publisher.publish(message)
    def feedback(self, message):
        self.left = message.feedback.left

def main():
    rclpy.init()
    executor = MultiThreadedExecutor()
    executor.add_node(Client())
    executor.spin()
"""


def test_nodes_answer_each_others_services_and_actions(tmp_path):
    (tmp_path / "srv").mkdir()
    for name, text in {"package.xml": "<package><name>team</name></package>", "server.py": TEAM + SERVER,
                       "client.py": TEAM + CLIENT, "srv/Plan.srv": "float64 wish\n---\nfloat64 speed\nstring why\n",
                       "launch.yaml": "nodes:\n- {file: client.py}\n- {file: server.py}\n"}.items():  # fmt: skip
        (tmp_path / name).write_text(text)
    assert speeds(make(f"ros:{tmp_path / 'launch.yaml'}"), 4)[-1] == 1.5 + 1.0 + 0.75


def test_a_node_that_waits_for_a_service_that_nobody_offers_is_told_which(tmp_path):
    source = node2(tmp_path, "self.drive(1.0)").removesuffix(":Mine")
    with open(source.removeprefix("ros:"), "a") as file:
        file.write("\nfrom std_srvs.srv import Trigger\nrclpy.init()\n")
        file.write("client = Mine().create_client(Trigger, 'ready')\nwhile not client.wait_for_service(1.0): pass\n")
    said = r"it waits for the service /ready, which nobody offers \(.*mine.py, line \d+\)"
    with pytest.raises(Exception, match=said):
        commands(make(source), 210)


def test_a_node_gets_laps_and_touches(tmp_path):
    """Two laps by the centreline; race control puts a car back that has touched the wall."""
    log = str(tmp_path / "log.txt")
    init = """
from std_msgs.msg import Bool, Float32, Int32
self.seen = {}
names = {"/ego_racecar/collision": Bool, "/ego_racecar/lap_time": Float32, "/lap_time": Float32,
         "/autodrive/roboracer_1/lap_count": Int32, "/autodrive/roboracer_1/collision_count": Int32,
         "/autodrive/roboracer_1/best_lap_time": Float32}
for name, kind in names.items():
    self.create_subscription(kind, name, lambda m, name=name: self.seen.setdefault(name, []).append(m.data), 1)
"""
    write = f"""
open({log!r}, "w").write(repr({{name: (values[0], values[-1], max(values)) for name, values in self.seen.items()}}))
"""
    steer = """
k = len(message.ranges) // 6
left, right = (sum(min(r, 5.0) for r in message.ranges[part]) / k for part in (slice(-2 * k, -k), slice(k, 2 * k)))
"""
    result = fg.race("oval", node2(tmp_path, write + steer + "self.drive(2.0, 0.3 * (left - right))", init), laps=2)
    told = eval((tmp_path / "log.txt").read_text())
    first, second = result.car.lap_times_s
    assert told["/autodrive/roboracer_1/lap_count"] == (0, 1, 1) and not told["/ego_racecar/collision"][2]
    assert told["/ego_racecar/lap_time"] == pytest.approx((0.0, first, first), abs=0.03)
    assert told["/autodrive/roboracer_1/best_lap_time"][1] == pytest.approx(first, abs=0.03)
    assert told["/lap_time"][1] == pytest.approx(second, abs=0.06)
    blind = node2(tmp_path, write + "self.drive(3.0)", init)
    result = fg.race("oval", blind, laps=1, time_limit=8.0, rules="autodrive_2026", opponents=["gap_finder"])
    told = eval((tmp_path / "log.txt").read_text())
    assert result.cars[0].collisions_wall == told["/autodrive/roboracer_1/collision_count"][2] >= 1
    assert told["/ego_racecar/collision"][2]


@pytest.mark.slow
def test_a_node_gets_pictures_of_what_is_ahead(tmp_path):
    init = """
from sensor_msgs.msg import CameraInfo, Image
self.create_subscription(Image, "/camera/color/image_raw", lambda m: self.got.update(image=m), 1)
self.create_subscription(CameraInfo, "/camera/color/camera_info", lambda m: self.got.update(lens=m), 1)
"""
    body = """
if "image" in self.got:
    image, lens = self.got["image"], self.got["lens"]
    assert (image.width, image.height, image.encoding, image.step) == (640, 360, "rgb8", 1920)
    pixels = np.frombuffer(bytes(image.data), np.uint8).reshape(360, 640, 3).astype(float)
    assert pixels[20].mean(axis=0)[2] > pixels[20].mean(axis=0)[0] + 20.0  # a blue sky over a grey floor
    assert np.ptp(pixels[200, :80].mean(axis=0)) < 20.0 and lens.width == 640 and 350.0 < lens.k[0] == lens.k[4] < 450.0
    self.drive(1.0)
"""
    assert fg.race("oval", node2(tmp_path, body, init), time_limit=0.3).car.max_speed_m_s > 0.2


@each("topic, kind, told", [("/autodrive/reset_command", "Bool", True), ("/reset", "Empty", True),
                            ("/autodrive/reset_command", "Bool", False)])  # fmt: skip
def test_a_node_that_asks_for_a_reset_is_told_that_there_is_none(topic, kind, told, tmp_path):
    init = f"""
from std_msgs.msg import {kind}
self.kind, self.reset = {kind}, self.create_publisher({kind}, {topic!r}, 1)
"""
    body = f"self.reset.publish(self.kind({f'data={told}' if kind == 'Bool' else ''}))\nself.drive(1.0)"
    planner = node2(tmp_path, body, init)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        assert fg.race("oval", planner, time_limit=0.3).car.max_speed_m_s > 0.2
    assert sum("a race has no reset" in str(each.message) for each in said) == told


def test_tf2s_buffer_knows_frames_waits_for_them_and_moves_messages(tmp_path):
    """A frame comes with the third scan; who waits for it gets it then, and a time limit ends in simulated time."""
    head = """
from geometry_msgs.msg import PointStamped, TransformStamped
from rclpy.duration import Duration
from rclpy.time import Time
import tf2_ros
"""
    init = """
self.buffer = tf2_ros.Buffer(cache_time=Duration(seconds=10), node=self)
self.listener, self.sender = tf2_ros.TransformListener(self.buffer, self), tf2_ros.TransformBroadcaster(self)
self.frame, self.point = TransformStamped(), PointStamped()
self.frame.header.frame_id, self.frame.child_frame_id, self.frame.transform.translation.x = "base_link", "mast", 0.5
self.point.header.frame_id, self.point.point.y = "mast", 0.25
self.future = self.buffer.wait_for_transform_async("base_link", "mast", Time())
assert "Frame laser exists with parent base_link.\\n" in self.buffer.all_frames_as_string()
assert "laser: \\n  parent: 'base_link'" in self.buffer.all_frames_as_yaml()
assert '"base_link" -> "laser"' in self.buffer._allFramesAsDot() and "map" in self.buffer._getFrameStrings()
self.buffer.clear()
tf2_ros.TransformRegistration().add(str, lambda text, found: text + found.child_frame_id)
"""
    body = """
b, none = self.buffer, Time()
if self.calls < 3:
    assert not b.can_transform("base_link", "mast", none) and not b._frameExists("mast") and not self.future.done()
    assert not b.can_transform_core("base_link", "mast", none)[0] and not b.can_transform_full(
        "base_link", none, "mast", none, "map")
    if self.calls == 2:
        began = self.get_clock().now()
        try:
            b.lookup_transform("base_link", "mast", none, timeout=Duration(seconds=0.06))
        except tf2_ros.LookupException as error:
            assert "mast" in str(error) and 0.06 <= (self.get_clock().now() - began).nanoseconds / 1e9 < 0.07
            self.drive(1.0)
else:
    self.sender.sendTransform(self.frame)
    assert self.future.done() and abs(self.future.result().transform.translation.x - 0.5) < 1e-9
    for found in (b.lookup_transform_core("base_link", "mast", none),
                  b.lookup_transform_full("base_link", none, "mast", none, "map", Duration(seconds=1.0))):
        assert abs(found.transform.translation.x - 0.5) < 1e-9 and found.child_frame_id == "mast"
    for found in (b.transform(self.point, "base_link"), b.transform_full(self.point, "base_link", none, "map")):
        assert abs(found.point.x - 0.5) + abs(found.point.y - 0.25) < 1e-9
    assert b.can_transform("base_link", "mast", none, return_debug_tuple=True) == (True, "")
    assert abs((b.get_latest_common_time("map", "mast") - self.get_clock().now()).nanoseconds) < 1e6
    async def later():
        return (await b.lookup_transform_async("base_link", "mast", none)).transform.translation.x
    async def both():
        self.drive(await later() + 1.0)
    try:
        both().send(None)
    except StopIteration:
        pass
"""
    assert speeds(make(node2(tmp_path, body, init, head=head + ROS2)), 6) == [0.0] * 4 + [1.5] * 2


def test_messages_are_dictionaries_yaml_and_csv_and_are_filled_from_dictionaries(tmp_path):
    """As rosidl_runtime_py of Humble writes and reads them."""
    body = """
from collections import OrderedDict
from geometry_msgs.msg import PoseArray
from rosidl_runtime_py import message_to_ordereddict, set_message_fields
from rosidl_runtime_py.convert import get_message_slot_types, message_to_csv, message_to_yaml
from rosidl_runtime_py.utilities import get_message
out = get_message("ackermann_msgs/msg/AckermannDriveStamped")()
now = set_message_fields(out, {"header": "auto", "drive": {"speed": 2, "jerk": 0.5}}, expand_header_auto=True)
now[0](self.get_clock().now().to_msg())
assert message_to_ordereddict(out)["drive"] == OrderedDict(
    steering_angle=0.0, steering_angle_velocity=0.0, speed=2.0, acceleration=0.0, jerk=0.5)
assert message_to_csv(out.drive) == "0.0,0.0,2.0,0.0,0.5" and list(get_message_slot_types(out)) == ["header", "drive"]
assert message_to_yaml(out.drive).splitlines()[2] == "speed: 2.0" and "sec: 10000" in message_to_yaml(out)
poses = PoseArray()
set_message_fields(poses, {"poses": [{"position": {"x": 1.0}}, {}]})
assert [each.position.x for each in poses.poses] == [1.0, 0.0]
short = message_to_ordereddict(message, truncate_length=2)["ranges"]
assert len(short) == 3 and short[-1] == "..." and isinstance(short[0], float)
assert message_to_ordereddict(message, no_arr=True)["ranges"] == "<sequence type: float, length: 1081>"
for wrong, kind in (({"sped": 1.0}, AttributeError), ("fast", TypeError), ({"speed": "fast"}, ValueError)):
    try:
        set_message_fields(out.drive, wrong)
    except kind:
        continue
    raise AssertionError(wrong)
self.publisher.publish(out)
"""
    assert speeds(make(node2(tmp_path, body)), 1) == [2.0]
