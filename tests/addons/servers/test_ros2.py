"""The node of ROS 2 on DDS: peers in C++ on Fast DDS and in Python on cyclonedds, QoS, garbage, and bad input."""

import os
import re
import shutil
import signal
import socket
import subprocess
import threading
import time
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.addons.look.live.live_session import LiveSession
from fg_mujoco.cli.main import main
from fg_mujoco.errors import SettingsError
from fg_mujoco.lidar.point_cloud import POINT
from fg_mujoco.messages import DriveCommand

pytest.importorskip("rosbags")
pytest.importorskip("cyclonedds")
from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import array, bounded_str, float32, int32, sequence, uint8, uint32
from cyclonedds.pub import DataWriter, Publisher
from cyclonedds.sub import DataReader, Subscriber
from cyclonedds.topic import Topic
from cyclonedds.util import duration

from fg_mujoco.addons.ros.bag_messages import CLOUD, GRID, ODOMETRY, POSE, TRANSFORMS, from_cdr, stamp_of, type_store
from fg_mujoco.addons.servers.ros2 import server
from fg_mujoco.addons.servers.ros2.dds_types import cdr_of, dds_type
from fg_mujoco.addons.servers.ros2.server import Ros2Server

DOMAIN = 1 + os.getpid() % 90  # another in each worker
_FULL = DOMAIN + 100
_PATIENCE = 30.0  # [s]
_OFFSET, _PRIME = 14695981039346656037, 1099511628211  # of FNV-1a


@dataclass
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    sec: int32
    nanosec: uint32


@dataclass
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    stamp: Time
    frame_id: str


@dataclass
class LaserScan(IdlStruct, typename="sensor_msgs::msg::dds_::LaserScan_"):
    header: Header
    angle_min: float32
    angle_max: float32
    angle_increment: float32
    time_increment: float32
    scan_time: float32
    range_min: float32
    range_max: float32
    ranges: sequence[float32]
    intensities: sequence[float32]


@dataclass
class AckermannDrive(IdlStruct, typename="ackermann_msgs::msg::dds_::AckermannDrive_"):
    steering_angle: float32
    steering_angle_velocity: float32
    speed: float32
    acceleration: float32
    jerk: float32


@dataclass
class AckermannDriveStamped(IdlStruct, typename="ackermann_msgs::msg::dds_::AckermannDriveStamped_"):
    header: Header
    drive: AckermannDrive


@dataclass
class Data(IdlStruct, typename="std_msgs::msg::dds_::Bool_"):
    data: bool


@dataclass
class Empty(IdlStruct, typename="std_msgs::msg::dds_::Empty_"):
    structure_needs_at_least_one_member: uint8


@dataclass
class Gid(IdlStruct, typename="rmw_dds_common::msg::dds_::Gid_"):
    data: array[uint8, 24]


@dataclass
class NodeEntitiesInfo(IdlStruct, typename="rmw_dds_common::msg::dds_::NodeEntitiesInfo_"):
    node_namespace: bounded_str[256]
    node_name: bounded_str[256]
    reader_gid_seq: sequence[Gid]
    writer_gid_seq: sequence[Gid]


@dataclass
class ParticipantEntitiesInfo(IdlStruct, typename="rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_"):
    gid: Gid
    node_entities_info_seq: sequence[NodeEntitiesInfo]


_RELIABLE, _LOSSY = Policy.Reliability.Reliable(duration(seconds=1)), Policy.Reliability.BestEffort


class Peer:
    """A node on cyclonedds, its types written by hand."""

    def __init__(self):
        self._participant = DomainParticipant(DOMAIN)

    def reader(self, topic, kind, *policies):
        qos = Qos(Policy.History.KeepLast(10), *(policies or (_LOSSY,)))
        return DataReader(self._participant, Topic(self._participant, topic, kind), qos=qos)

    def writer(self, topic, kind, reliability=_RELIABLE):
        return DataWriter(self._participant, Topic(self._participant, topic, kind), qos=Qos(reliability))

    def in_partition(self, of, topic, kind):
        """Return a reader or writer, DataReader or DataWriter, in a partition."""
        within = {DataReader: Subscriber, DataWriter: Publisher}[of]
        group = within(self._participant, qos=Qos(Policy.Partition(["lab"])))
        return of(group, Topic(self._participant, topic, kind))


def newest(reader):
    """Return the next sample of a reader."""
    found = reader.take_one(timeout=duration(seconds=_PATIENCE))
    assert found is not None
    return found


def until(condition):
    end = time.monotonic() + _PATIENCE
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


def drive(speed, angle=0.0):
    return AckermannDriveStamped(Header(Time(0, 0), ""), AckermannDrive(angle, 0.0, speed, 0.0, 0.0))


@contextmanager
def served(step_on_drive=True, setup=None, **options):
    """Yield a session and what its server, which runs, has logged."""
    session, logged = LiveSession(setup or fg.Setup.of("oval")), []
    session.hold(DriveCommand(steering_angle=0.0, speed=0.0))
    serving = Ros2Server(session, step_on_drive=step_on_drive, domain=DOMAIN, log=logged.append, **options)
    thread = threading.Thread(target=serving.run)
    thread.start()
    try:
        yield session, logged
    finally:
        serving.close()
        thread.join()


def steer(ranges):
    """Return a command along the middle of the course, as fast_dds_peer.cpp computes it."""
    left = right = 0.0
    for reach in ranges[700:860]:
        left += min(reach, 4.0)
    for reach in ranges[220:380]:
        right += min(reach, 4.0)
    return float(np.float32(min(max(0.6 * (left - right) / 160.0, -0.4), 0.4)))


def positions(ticks):
    """Return where the car is at the beginning of each tick of a race that `steer` drives."""

    def planner(scan, odometry):
        ranges = scan.ranges.astype(np.float32).astype(float).tolist()
        return DriveCommand(steering_angle=steer(ranges), speed=2.5)

    result = fg.race("oval", controller=planner, laps=100, time_limit=ticks * 0.025)
    assert len(result.ctrl) == ticks
    return np.column_stack((result.car.column("x_m"), result.car.column("y_m"))).astype("<f8")


@pytest.fixture(scope="module")
def fast_dds_peer(tmp_path_factory):
    """Return a function that starts the node in C++."""
    if shutil.which("g++") is None or not Path("/usr/include/fastdds").is_dir():
        pytest.skip("Fast DDS is not here: apt-get install g++ libfastrtps-dev")
    program = tmp_path_factory.mktemp("fast_dds") / "peer"
    source = Path(__file__).parent / "fast_dds_peer.cpp"
    subprocess.run(["g++", "-std=c++17", "-O1", "-w", source, "-o", program, "-lfastrtps", "-lfastcdr"], check=True)

    def run(commands, *options):
        return subprocess.Popen([program, str(DOMAIN), str(commands), *options], stdout=subprocess.PIPE, text=True)

    return run


def seen_by(peer):
    """Return what a peer in C++ prints at its end."""
    out, _ = peer.communicate(timeout=120)
    assert peer.returncode == 0, out
    return dict(line.split(" ", 1) for line in out.splitlines())


def test_2000_ticks_with_fast_dds_have_the_bits_of_a_race_twice(fast_dds_peer):
    hashed = _OFFSET
    for byte in positions(2000).tobytes():
        hashed = (hashed ^ byte) * _PRIME % 2**64
    for _ in range(2):
        with served() as (session, logged):
            seen = seen_by(fast_dds_peer(2000))
            assert (seen["sent"], seen["poses"], seen["hash"]) == ("2000", "2000", str(hashed))
            assert seen["early"] == "0"  # scans that come before the odometry of their tick
            assert seen["node"] == "/ fg_mujoco" and int(seen["map"]) > 10_000 and seen["mounts"] == "4"
            assert session.laps.laps_completed == 2 and [line[:5] for line in logged] == ["lap 1", "lap 2"]


def test_fast_dds_peers_that_sleep_die_send_garbage_or_ask_for_too_much_leave_the_race(fast_dds_peer):
    with served() as (session, logged):
        peers = [fast_dds_peer(10**6, "reliable")]
        until(lambda: session.simulation.time > 1.0)
        peers[0].send_signal(signal.SIGSTOP)  # in the middle: it reads no more, and does not leave
        for options in ((), ("garbage",), ("best_effort",), ("deadline",)):
            assert seen_by(fast_dds_peer(150, *options))["sent"] == "150"
        peers[0].kill()
        peers[0].communicate()
        assert seen_by(fast_dds_peer(20))["sent"] == "20"
        assert not session.simulation.crashed
    assert any("/imu has a reader whose QoS cannot match, its deadline" in line for line in logged)


def test_a_peer_on_cyclonedds_drives_with_the_bits_of_a_race():
    found = []
    with served() as (session, _):
        for _ in range(2):  # one goes, and another comes
            peer = Peer()
            commands, scans = peer.writer("rt/drive", AckermannDriveStamped), peer.reader("rt/scan", LaserScan)
            for _ in range(50):
                scan = newest(scans)
                assert len(scan.ranges) == 1081 and scan.header.frame_id == "laser"
                found.append(session.simulation.pose[:2])
                commands.write(drive(2.5, steer(scan.ranges)))
            newest(scans)
    assert np.array_equal(found, positions(100))


def test_in_real_time_nodes_see_the_node_and_the_race_and_the_car_stops_when_they_go():
    types = {"/reset": "std_msgs/Empty"}
    with served(step_on_drive=False, namespace="/car_1", distribution="humble", types=types) as (session, _):
        peer = Peer()
        late = Policy.Durability.TransientLocal
        node = newest(peer.reader("ros_discovery_info", ParticipantEntitiesInfo, _RELIABLE, late))
        (info,) = node.node_entities_info_seq
        assert (info.node_namespace, info.node_name) == ("/car_1", "fg_mujoco")
        assert len(info.writer_gid_seq) > 20 and len(info.reader_gid_seq) > 8
        scans = peer.reader("rt/car_1/scan", LaserScan, _RELIABLE, late)
        collision = peer.reader("rt/car_1/ego_racecar/collision", Data)
        commands = peer.writer("rt/car_1/drive", AckermannDriveStamped, _LOSSY)  # it is asked for reliable ones
        until(lambda: commands.write(drive(2.0)) or session.simulation.engine.commands[0, 1] == 2.0)
        assert len(newest(scans).ranges) == 1081 and newest(collision).data is False
        until(lambda: session.simulation.engine.commands[0, 1] == 0.0)
        pause = peer.writer("rt/car_1/pause_sim", Data)
        until(lambda: pause.write(Data(True)) or session.paused)
        until(lambda: pause.write(Data(False)) or not session.paused)
        moved = session.simulation.pose
        peer.writer("rt/car_1/reset", Empty).write(Empty(0))  # a late node's first sample may come before it is known
        reset = peer.writer("rt/car_1/reset", Empty)
        until(lambda: reset.write(Empty(0)) or session.simulation.pose != moved)
        until(lambda: session.simulation.time < 1.0)


def test_points_of_a_mid360_come_as_its_driver_sends_them():
    with served(step_on_drive=False, setup=fg.Setup.of("oval", lidar="mid360")):
        peer = Peer()
        late = _RELIABLE, Policy.Durability.TransientLocal
        mounts = from_cdr(newest(peer.reader("rt/tf_static", dds_type(TRANSFORMS), *late)).content, TRANSFORMS)
        clouds = peer.reader("rt/livox/lidar", dds_type(CLOUD), _RELIABLE)
        first, second = (from_cdr(newest(clouds).content, CLOUD) for _ in range(2))
    assert "livox_frame" in {each.child_frame_id for each in mounts.transforms}
    points, later = (np.frombuffer(cloud.data.tobytes(), POINT) for cloud in (first, second))
    assert first.point_step == 26 and [field.name for field in first.fields] == list(POINT.names)
    assert later["timestamp"][0] - points["timestamp"][0] == pytest.approx(1e8, abs=1e3)
    assert points["timestamp"][0] == pytest.approx(stamp_of(first), abs=1e3)
    assert (points["intensity"] > 0.0).mean() > 0.1 and not np.array_equal(points["x"], later["x"])


def test_two_simulators_need_two_namespaces_or_domains():
    kind, newer = "rmw_dds_common/msg/ParticipantEntitiesInfo", "jazzy"
    with served(distribution=newer):
        with pytest.raises(SettingsError, match=r"/scan on domain .* has a publisher.*--domain N.*--namespace"):
            Ros2Server(LiveSession(fg.Setup.of("oval")), domain=DOMAIN)
        with served(namespace="other", distribution=newer) as (session, _):
            peer = Peer()
            late = _RELIABLE, Policy.Durability.TransientLocal
            graph = peer.reader("ros_discovery_info", dds_type(kind, newer), *late)
            told = [type_store(newer).deserialize_cdr(newest(graph).content, kind) for _ in range(2)]
            assert {each.node_entities_info_seq[0].node_namespace for each in told} == {"/", "/other"}
            assert all(len(each.gid.data) == 16 for each in told)
            commands = peer.writer("rt/other/drive", AckermannDriveStamped)
            newest(peer.reader("rt/other/scan", LaserScan))
            commands.write(drive(1.0))
            until(lambda: session.simulation.time > 0.0)


def test_who_comes_and_cannot_match_or_publishes_the_same_is_told(monkeypatch):
    monkeypatch.setattr(server, "_ALONE", 0.0)
    with served() as (_, logged):
        until(lambda: logged)
        assert re.search(r"no node has come to domain .*RMW_IMPLEMENTATION=.*rmw_zenoh_cpp.*--host", logged.pop())
        peer, kind = Peer(), dds_type("nav_msgs/msg/Odometry")
        poses = peer.reader("rt/pf/pose/odom", kind)
        newest(peer.reader("rt/scan", LaserScan))
        newest(poses)
        assert not logged
        number = dds_type("std_msgs/msg/Float64")
        for come, said in (
            (
                lambda: peer.writer("rt/commands/motor/speed", number),
                r"no topic of commands has .*Stamped on /drive; .* /commands/motor/speed \(std_msgs/msg/Float64\)",
            ),
            (lambda: peer.writer("rt/drive", Data), "/drive has a publisher of std_msgs/msg/Bool; accepted: .*Stamped"),
            (lambda: peer.writer("rt/scan", LaserScan), "/scan on domain .* has a publisher, another simulator"),
            (lambda: peer.writer("rt/odom", kind), "/odom has a publisher, too, and .*; accepted: one publisher"),
            (lambda: peer.writer("rt/pf/pose/odom", kind), "/pf/pose/odom has a publisher, to which it is left"),
            (lambda: peer.reader("rt/imu", LaserScan), "/imu has a reader of sensor_msgs/msg/LaserScan; .*/Imu"),
            (
                lambda: peer.reader("rt/gt_pose", dds_type(POSE), Policy.Ownership.Exclusive),
                "/gt_pose has a reader whose QoS cannot match, its ownership; accepted",
            ),
            (
                lambda: peer.reader("rt/map", dds_type(GRID), Policy.DataRepresentation(False, True)),
                "/map has a reader whose QoS cannot match, its data representation; accepted",
            ),
            (
                lambda: [peer.writer(topic, AckermannDriveStamped) for topic in ("rt/drive", "rt/ackermann_cmd")],
                "each command of 2 publishers, on /ackermann_cmd, /drive, is a tick; accepted: one",
            ),
            (lambda: peer.in_partition(DataReader, "rt/clock", Data), "/clock has a reader in the partition 'lab'"),
            (lambda: peer.in_partition(DataWriter, "rt/drive", Data), "/drive has a publisher in the partition 'lab'"),
        ):
            here = come()
            until(lambda: logged)
            assert re.search(said, logged[0]) and len(logged) == 1, logged
            logged.clear()
            del here
        until(lambda: poses.get_subscription_matched_status().current_count == 0)


def test_a_topic_of_commands_of_another_name_is_read_while_it_is_the_only_one_of_its_type():
    with served() as (session, logged):
        peer = Peer()  # only publishes
        commands = peer.writer("rt/vesc_cmd", AckermannDriveStamped)
        _ = peer.writer("rt/my/twist", dds_type("geometry_msgs/msg/Twist"))
        until(lambda: len(logged) == 2)
        assert re.search(r"^/my/twist has a publisher of \S+/Twist, which is not read; accepted: /drive, or", logged[0])
        assert re.search(r"^/vesc_cmd is the only topic of \S+Stamped that has .* taken for /drive", logged[1])
        until(lambda: commands.get_matched_subscriptions())
        commands.write(drive(2.0))
        until(lambda: session.simulation.time == pytest.approx(0.025))
        _ = peer.writer("rt/drive", AckermannDriveStamped)  # a multiplexer's
        until(lambda: len(logged) == 3 and not commands.get_matched_subscriptions())
        assert re.search(r"^/vesc_cmd has a publisher of \S+Stamped, which is not read; accepted: /drive", logged[2])


def test_noise_on_its_ports_is_dropped():
    rng = np.random.default_rng(1)
    with served() as (session, _):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as noise:
            for port in range(7400 + 250 * DOMAIN, 7400 + 250 * DOMAIN + 30):
                for length in (0, 3, 20, 300, 1400):
                    begin = b"RTPS\x02\x03" if length > 20 else b""
                    noise.sendto(begin + rng.bytes(length), ("127.0.0.1", port))
        peer = Peer()
        scans = peer.reader("rt/scan", LaserScan)
        newest(scans)
        commands = peer.writer("rt/drive", AckermannDriveStamped, _LOSSY)  # its first command would be lost
        newest(scans)
        commands.write(drive(float("nan")))  # is no command, and no tick
        commands.write(drive(1.0))
        newest(scans)
        assert session.simulation.time == pytest.approx(0.025)


def test_several_cars_are_driven_by_the_topics_of_f1tenth_gym_ros():
    setup = fg.Setup.of("oval", opponents=["gap_finder"] * 2)
    peer = Peer()  # is there before, and has commands of the other type
    _ = peer.writer("rt/reset", Data)
    commands, second = peer.writer("rt/drive", AckermannDrive), peer.writer("rt/opp_drive", AckermannDriveStamped)
    with served(setup=setup) as (session, logged):
        scans, frames = peer.reader("rt/opp_scan", LaserScan), peer.reader("rt/tf", dds_type(TRANSFORMS))
        assert newest(scans).header.frame_id == "opp_racecar/laser"
        moved = from_cdr(newest(frames).content, TRANSFORMS).transforms
        assert [(each.header.frame_id, each.child_frame_id) for each in moved] == [
            ("odom", "base_link"), ("map", "ego_racecar/base_link"), ("map", "opp_racecar/base_link"),
            ("map", "opp_racecar2/base_link"),
        ]  # fmt: skip
        at = moved[2].transform.translation
        assert (at.x, at.y) == pytest.approx(session.simulation.engine.free_joint(1)[0][:2])
        for topic, car in (("odom", "ego_racecar"), ("opp_odom", "opp_racecar"), ("opp_odom2", "opp_racecar2")):
            found = from_cdr(newest(peer.reader(f"rt/ego_racecar/{topic}", dds_type(ODOMETRY))).content, ODOMETRY)
            assert (found.header.frame_id, found.child_frame_id) == ("map", f"{car}/base_link")
        until(lambda: second.get_matched_subscriptions() and commands.get_matched_subscriptions())
        for _ in range(20):  # a reader that has not found its writer yet misses what is written
            second.write(drive(0.0))
            commands.write(AckermannDrive(0.0, 0.0, 1.0, 0.0, 0.0))
            newest(scans)
        assert session.simulation.engine.commands[1, 1] == 0.0 and session.simulation.engine.commands[0, 1] == 1.0
    assert logged == ["/reset has a publisher of std_msgs/msg/Bool; accepted: std_msgs/msg/Empty"]


def test_every_type_that_is_known_can_be_said_on_dds_and_numbers_are_copied_whole():
    kinds = [kind for kind in type_store().fielddefs if "/msg/" in kind]
    assert len(kinds) > 100 and all(dds_type(kind) for kind in kinds)
    message = type_store().types["std_msgs/msg/Float32"](data=1.0)
    assert cdr_of(message, "std_msgs/msg/Float32") == bytes.fromhex("000100000000803f")


@each(
    ("settings", "said"),
    [
        ({"domain": 999}, "domain is 999; accepted: a whole number from 0 to 232"),
        ({"namespace": "a-b"}, "namespace is 'a-b'; accepted: names of letters"),
        ({"domain": _FULL}, f"domain {_FULL} .* on 127.0.0.1: Failed to find a free participant index .*--domain"),
        ({"host": "192.0.2.77"}, "on 192.0.2.77: 192.0.2.77: does not match an available interface; accepted"),
        ({"host": ""}, "host is ''; accepted: the address of a machine"),
        ({"host": "0.0.0.0"}, "host is '0.0.0.0'; accepted"),
        ({"peers": ["<x>\n"]}, r"peer is '<x>\\n'; accepted: the address of a machine"),
        ({"peers": ["nowhere.invalid"]}, "peer is 'nowhere.invalid'; accepted"),
        ({"peers": ["10.1.2.3"]}, "peer is '10.1.2.3', which is not reached from host 127.0.0.1; accepted: --host"),
        ({"distribution": "humbel"}, "distribution is 'humbel'; accepted: foxy, .*, jazzy, kilted"),
        ({"types": {"/drive": "sensor_msgs/msg/Scan"}}, "type 'sensor_msgs/msg/Scan' is not known; accepted: acker"),
        ({"types": {"/drive": "sensor_msgs/LaserScan"}}, "type of /drive is sensor_msgs/msg/LaserScan; accepted"),
        ({"types": {"/reset": "std_msgs/Bool"}}, "type of /reset is std_msgs/msg/Bool; accepted: std_msgs/msg/Empty;"),
        ({"types": {"/scan": "std_msgs/msg/Bool"}}, "type of /scan, which is not read; accepted: .*/cmd_vel.*yours"),
        ({"types": {"/goal_pose": "geometry_msgs/msg/PoseStamped"}}, "type of /goal_pose, which is not read"),
    ],
)
def test_bad_settings_say_what_is_accepted(settings, said, monkeypatch, capfd):
    monkeypatch.setenv("CYCLONEDDS_URI", "")  # counts as none
    with ExitStack() as taken:
        for port in range(7400 + 250 * _FULL, 7400 + 250 * (_FULL + 1)):
            taken.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)).bind(("0.0.0.0", port))
        with pytest.raises(SettingsError, match=said):
            Ros2Server(LiveSession(fg.Setup.of("oval")), **settings)
    assert capfd.readouterr().err == ""  # of Cyclone DDS


@each(
    ("options", "said"),
    [
        (["--controller", "gap_finder", "--step-on-drive"], "--controller drives until a command comes, .*; accepted"),
        (["--type", "drive"], "--type is 'drive'; accepted: TOPIC=TYPE"),
        (["--peer", "nowhere.invalid"], "--peer is 'nowhere.invalid'; accepted"),
    ],
)
def test_the_command_line_refuses_in_one_line(options, said, capfd):
    assert main(["serve", "ros2", *options]) == 2
    assert re.fullmatch(f"fg-mujoco: {said}.*\n", capfd.readouterr().err)
