"""The server of rosbridge: exchanges of roslibpy and roslibjs, races in lockstep, and peers that misbehave."""

import json
import math
import socket
import threading
import time
from contextlib import contextmanager

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.addons.look.live.live_session import LiveSession
from fg_mujoco.errors import MessageError
from fg_mujoco.messages import DriveCommand

pytest.importorskip("rosbags")
from websockets.sync.client import connect

from fg_mujoco.addons.ros.bag_messages import drive_message, scan_message
from fg_mujoco.addons.servers.rosbridge.client import Outbox, Subscription
from fg_mujoco.addons.servers.rosbridge.json_messages import from_json, to_json
from fg_mujoco.addons.servers.rosbridge.server import RosbridgeServer

DRIVE, SCAN = "ackermann_msgs/msg/AckermannDriveStamped", "sensor_msgs/msg/LaserScan"
PLACE = "geometry_msgs/msg/PoseWithCovarianceStamped"
_PATIENCE = 30.0  # [s]


class Peer:
    """A client of rosbridge, written from the protocol."""

    def __init__(self, server, **options):
        self._socket = connect(server.url, max_size=1 << 26, proxy=None, ping_interval=None, **options).__enter__()
        self._called = 0

    def send(self, **operation):
        self._socket.send(json.dumps(operation))

    def send_raw(self, content):
        self._socket.send(content)

    def receive(self, op, **wanted):
        """Return the next operation of a kind, with these values; others are passed over."""
        until = time.monotonic() + _PATIENCE
        while True:
            found = json.loads(self._socket.recv(timeout=max(until - time.monotonic(), 0.0)))
            if found["op"] == op and wanted.items() <= found.items():
                return found

    def call(self, service, **args):
        self._called += 1
        self.send(op="call_service", id=f"call:{self._called}", service=service, args=args)
        return self.receive("service_response", id=f"call:{self._called}")

    def drive(self, speed, steering_angle=0.0):
        self.send(op="publish", topic="/drive", msg={"drive": {"speed": speed, "steering_angle": steering_angle}})

    def drop(self):
        """Go without a word."""
        self._socket.socket.shutdown(socket.SHUT_RDWR)


@contextmanager
def served(track="oval", step_on_drive=True, **options):
    """Yield a session and its server, which runs."""
    session = LiveSession(fg.Setup.of(track))
    session.hold(fg.DriveCommand(steering_angle=0.0, speed=0.0))
    with RosbridgeServer(session, port=0, step_on_drive=step_on_drive, **options) as server:
        thread = threading.Thread(target=server.run)
        thread.start()
        try:
            yield session, server
        finally:
            server.close()
            thread.join()


@pytest.fixture(scope="module")
def shared():
    with served() as (session, server):
        yield session, server, Peer(server)


def steer(ranges):
    """Return a command along the middle of the course, its numbers of 32 bits, as a message has them."""
    near = [4.0 if each is None else min(each, 4.0) for each in ranges]
    angle = 0.6 * (sum(near[700:860]) - sum(near[220:380])) / 160.0
    return float(np.float32(min(max(angle, -0.4), 0.4))), 2.5


def ranges_of(scan):
    """Return the ranges of a scan as JSON has them."""
    return [each if math.isfinite(each) else None for each in scan.ranges.astype(np.float32).astype(float).tolist()]


def in_process(scan, odometry):
    angle, speed = steer(ranges_of(scan))
    return DriveCommand(steering_angle=angle, speed=speed)


@each("of", ["roslibpy", "roslibjs"])
def test_an_exchange_as_the_libraries_have_it(of, shared):
    """The texts are those that roslibpy 2.1.0 and roslibjs 2.1.0 have sent."""
    session, _, peer = shared
    before = session.simulation.time
    at, compression = ("msg/", "cbor") if of == "roslibjs" else ("", "none")
    peer.send(op="subscribe", id="subscribe:/scan:1", type=f"sensor_msgs/{at}LaserScan", topic="/scan",
              compression=compression, throttle_rate=0, queue_length=0)  # fmt: skip
    first = peer.receive("publish", topic="/scan")["msg"]
    assert first["ranges"] == ranges_of(session.scan) and len(first["ranges"]) == 1081
    assert list(first) == ["header", "angle_min", "angle_max", "angle_increment", "time_increment", "scan_time",
                           "range_min", "range_max", "ranges", "intensities"]  # fmt: skip
    assert set(first["header"]["stamp"]) == {"sec", "nanosec"} and first["header"]["frame_id"] == "laser"
    peer.send(op="advertise", id="advertise:/drive:2", type=f"ackermann_msgs/{at}AckermannDriveStamped",
              topic="/drive", latch=False, queue_size=100)  # fmt: skip
    drive = {"steering_angle": 0.0034925924241542817, "speed": 2 if of == "roslibjs" else 2.0}
    peer.send(op="publish", id="publish:/drive:3", topic="/drive", msg={"drive": drive}, latch=False)
    assert peer.receive("publish", topic="/scan")["msg"]["ranges"] == ranges_of(session.scan) != first["ranges"]
    assert session.simulation.time == pytest.approx(before + 0.025)
    assert session.simulation.engine.commands[0].tolist() == [float(np.float32(0.0034925924241542817)), 2.0]
    peer.send(op="unsubscribe", id="subscribe:/scan:1", topic="/scan")
    topics = peer.call("/rosapi/topics")
    assert topics["result"] is True
    kinds = dict(zip(topics["values"]["topics"], topics["values"]["types"], strict=True))
    assert kinds["/scan"] == SCAN and kinds["/drive"] == DRIVE and "/ego_racecar/odom" in kinds
    assert peer.call("/rosapi/topic_type", topic="/odom")["values"] == {"type": "nav_msgs/msg/Odometry"}
    assert "/reset" in peer.call("/rosapi/services")["values"]["services"]
    seconds = peer.call("/rosapi/get_time")["values"]["time"]
    assert seconds["sec"] + seconds["nanosec"] / 1e9 == pytest.approx(1e9 + session.simulation.time)
    details = peer.call("/rosapi/message_details", type="geometry_msgs/Twist")["values"]["typedefs"]
    assert [each["type"] for each in details] == ["geometry_msgs/Twist", "geometry_msgs/Vector3"]
    raw = peer.call("/rosapi/topics_and_raw_types")["values"]
    text = raw["typedefs_full_text"][raw["topics"].index("/drive")]
    assert "float32 speed" in text and "MSG: ackermann_msgs/AckermannDrive" in text


def test_200_ticks_in_lockstep_have_the_bits_of_the_same_planner_in_a_race():
    drives = []
    for _ in range(2):
        with served() as (session, server):
            peer, poses = Peer(server), []
            for topic in ("/odom", "/scan"):
                peer.send(op="subscribe", topic=topic)
            for _ in range(200):
                position = peer.receive("publish", topic="/odom")["msg"]["pose"]["pose"]["position"]
                poses.append((position["x"], position["y"]))  # of the moment of the scan that follows
                angle, speed = steer(peer.receive("publish", topic="/scan")["msg"]["ranges"])
                peer.drive(speed, angle)
            peer.receive("publish", topic="/scan")
            drives.append((session.simulation.state.tobytes(), poses))
    assert drives[0] == drives[1]
    result = fg.race("oval", controller=in_process, laps=100, time_limit=200 * 0.025)
    assert len(result.ctrl) == 200 and result.car.column("x_m")[-1] > 5.0
    assert drives[0][1] == list(zip(result.car.column("x_m"), result.car.column("y_m"), strict=True))


def narrow_peer(server):
    """Return a peer that holds little of what it has not read."""
    narrow = socket.create_connection(("127.0.0.1", server.port))
    narrow.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 65536)
    return Peer(server, sock=narrow, max_queue=1)


def test_a_peer_that_reads_slowly_loses_the_oldest_messages_and_nobody_waits_for_it():
    with served() as (_, server):
        slow, asleep, quick = narrow_peer(server), narrow_peer(server), Peer(server)
        quick.send(op="advertise", topic="/big", type="std_msgs/String")
        for peer in (slow, asleep):  # the other never reads again, and the server ends all the same
            peer.send(op="subscribe", topic="/big", type="std_msgs/String")
            peer.call("/rosapi/get_time")
        for number in range(60):
            quick.send(op="publish", topic="/big", msg={"data": f"{number} " + "x" * 200_000})
        assert quick.call("/step")["result"] is True  # it was not kept waiting
        numbers, said = [], []
        while not numbers or numbers[-1] < 59:
            found = json.loads(slow._socket.recv(timeout=_PATIENCE))
            if found["op"] == "publish":
                numbers.append(int(found["msg"]["data"].split()[0]))
            else:
                said.append(found)
        assert numbers == sorted(numbers) and numbers[-10:] == list(range(50, 60)) and len(numbers) < 60
        assert said[0]["level"] == "warning" and "messages on /big were lost" in said[0]["msg"]


def test_a_peer_that_is_dropped_leaves_the_others_and_the_car_stops():
    with served(step_on_drive=False) as (session, server):
        driver, other = Peer(server), Peer(server)
        other.send(op="subscribe", topic="/scan")
        driver.drive(2.0)
        for _ in range(2):
            other.receive("publish", topic="/scan")
        driver.drop()
        until = time.monotonic() + _PATIENCE
        while session.simulation.engine.commands[0, 1] == 0.0:  # until it has come
            assert time.monotonic() < until
        while session.simulation.engine.commands[0, 1] != 0.0:
            assert time.monotonic() < until
            other.receive("publish", topic="/scan")
        assert session.simulation.time > 0.5
        assert other.call("/rosapi/subscribers", topic="/scan")["values"]["subscribers"] == ["/rosbridge_websocket"]


_GARBAGE = [("{", "is no JSON"),
    ("[" * 100_000, "is no JSON"),
    ("[1]", "is no operation; accepted: an object with the field op"),
    (b"\x00\x01", "2 bytes were sent; accepted: a text"),
    ('{"op": "publsh"}', "op is 'publsh'; accepted: advertise"),
    ('{"op": "subscribe", "id": [1], "topic": "/scan"}', "id is [1]; accepted: a text of at most"),
    ('{"op": "publish", "topic": 3}', "topic is 3; accepted: a name"),
    ('{"op": "publish", "topic": "/scan", "msg": {}}', "/scan is published by the race; accepted: /drive"),
    ('{"op": "publish", "topic": "/drive"}', "a message on /drive: msg is None; accepted: an object of"),
    ('{"op": "publish", "topic": "/drive", "msg": {"drive": {"speed": NaN}}}', "drive.speed is nan; accepted: a"),
    ('{"op": "publish", "topic": "/initialpose", "msg": {"pose": {"pose": {"position": {"x": 1e300}}}}}', "accepted"),
    ('{"op": "advertise", "topic": "/drive", "type": "std_msgs/String"}', "type of /drive is std_msgs/msg/String"),
    ('{"op": "subscribe", "topic": "/scn"}', "/scn is not known; accepted: "),
    ('{"op": "subscribe", "topic": "/' + "a" * 255 + '", "type": "std_msgs/String"}', "a name of at most 255 letters"),
    ('{"op": "subscribe", "topic": "/scan", "id": "' + "a" * 300 + '"}', "id is 'aaa"),
    ('{"op": "publish", "topic": "/drive", "msg": ' + "[" * 900 + "]" * 900 + "}", "accepted: an object of"),
    ('{"op": "set_level", "level": "loud"}', "level is 'loud'; accepted: info, warning, error, none"),
    ('{"op": "advertise_service", "service": "/a"}', "op is 'advertise_service'; accepted: advertise")]  # fmt: skip


@each("text, said", _GARBAGE)
def test_what_cannot_be_used_is_said_and_the_connection_lives_on(text, said, shared):
    session, _, peer = shared
    before = session.simulation.time, session.simulation.pose
    peer.send_raw(text)
    status = peer.receive("status")
    assert status["level"] == "error" and said in status["msg"], status["msg"]
    assert (session.simulation.time, session.simulation.pose) == before
    assert peer.call("/rosapi/get_time")["result"] is True


def test_services_place_and_pause_the_car(shared):
    session, _, peer = shared
    assert peer.call("/step")["result"] is True and session.simulation.time > 0.0
    assert peer.call("/reset")["values"] == {"success": True, "message": ""}
    assert session.simulation.time == 0.0
    assert peer.call("/pause")["values"]["message"] == "paused"
    peer.drive(1.0)
    assert "the race is paused: call /pause" in peer.receive("status", level="error")["msg"]
    assert peer.call("/step")["result"] is True and session.simulation.time == pytest.approx(0.025) and session.paused
    assert peer.call("/pause")["values"]["message"] == ""
    x, y, heading = session.world.track.start_pose(12.0, 0.2)
    pose = {"position": {"x": x, "y": y}, "orientation": {"z": math.sin(heading / 2), "w": math.cos(heading / 2)}}
    peer.send(op="publish", topic="/initialpose", msg={"pose": {"pose": pose}})
    grid = peer.call("/map_server/map")["values"]["map"]
    assert session.simulation.pose == pytest.approx((x, y, heading), abs=0.02)
    assert len(grid["data"]) == grid["info"]["width"] * grid["info"]["height"]
    refused = peer.call("/resett")
    assert refused["result"] is False and "did you mean '/reset'?" in refused["values"]


def test_a_client_that_has_gone_leaves_nothing():
    with served() as (_, server):
        one, other = Peer(server), Peer(server)
        one.send(op="advertise", topic="/goal", type="std_msgs/String", latch=True)
        one.send(op="publish", topic="/goal", msg={"data": "there"})
        one.send(op="subscribe", topic="/goal")
        assert one.receive("publish")["msg"]["data"] == "there"
        one.drop()
        until = time.monotonic() + _PATIENCE
        while "/goal" in other.call("/rosapi/topics")["values"]["topics"]:
            assert time.monotonic() < until
        other.send(op="subscribe", topic="/goal", type="std_msgs/String")
        other.send(op="call_service", service="/rosapi/get_time")
        assert json.loads(other._socket.recv(timeout=_PATIENCE))["op"] == "service_response"


def test_topics_and_subscriptions_of_a_client_have_a_greatest_number():
    with served() as (_, server):
        peer = Peer(server)
        for number in range(1001):
            peer.send(op="subscribe", topic="/scan", id=number, throttle_rate=1000)
            peer.send(op="advertise", topic=f"/{number}", type="std_msgs/String")
        said = [peer.receive("status")["msg"] for _ in range(2)]
        assert said == [f"1000 {what} are there; accepted: no more of a client" for what in ("subscriptions to /scan",
                            "topics")]  # fmt: skip


def test_texts_that_wait_for_a_client_have_a_greatest_length():
    outbox, large = Outbox(lambda: None), "x" * (1 << 24)
    assert [outbox.put("/a", large, 1000) for _ in range(7)] == [0, 0, 0, 0, 1, 1, 1]
    assert outbox.put("/b", large, 1) == 1 and outbox.put("/b", "newest", 1) == 1
    found = [outbox.take() for _ in range(4)]
    assert found == [large, large, large, "newest"] and outbox.take() is None and not outbox._waiting
    held = Subscription("/scan", throttles={None: 1.0}, depths={None: 1000}, sent=0.0)
    assert [held.due("x" * (1 << 20), 0.1) for _ in range(7)] == [None] * 7 and len(held.waiting) == 4


def test_a_message_is_as_rosbridge_has_it():
    scan = LiveSession(fg.Setup.of("oval")).scan
    found = to_json(scan_message(scan), SCAN)
    assert found["range_max"] == float(np.float32(scan.range_max)) and found["ranges"] == ranges_of(scan)
    image = from_json({"data": "AAEC", "step": 3}, "sensor_msgs/msg/Image", now=1_500_000_000)
    assert image.data == [0, 1, 2]
    written = to_json(image, "sensor_msgs/msg/Image")
    assert written["data"] == "AAEC" and written["header"]["stamp"] == {"sec": 1, "nanosec": 500_000_000}
    odd = drive_message(DriveCommand(steering_angle=0.1, speed=1.0), 0)
    odd.drive.speed, odd.drive.jerk = math.nan, math.inf
    assert to_json(odd, DRIVE)["drive"] == {"steering_angle": 0.10000000149011612, "steering_angle_velocity": 0.0,
                                            "speed": None, "acceleration": 0.0, "jerk": None}  # fmt: skip
    assert from_json({}, PLACE, now=0).pose.pose.orientation.w == 1.0  # as ROS 2 has it
    with pytest.raises(MessageError, match=r"data\[1\] is 300; accepted: a whole number from -128 to 127"):
        from_json({"data": [0, 300]}, "nav_msgs/msg/OccupancyGrid", now=0)


def test_throttled_messages_are_left_out_or_wait_in_the_queue():
    times = [0.025 * tick for tick in range(9)]
    plain, queued = Subscription("/scan"), Subscription("/scan")
    plain.throttles, plain.depths = {None: 0.05, "b": 0.2}, {None: 0, "b": 0}
    queued.throttles, queued.depths = {None: 0.05}, {None: 2}
    assert [plain.due(str(k), t) for k, t in enumerate(times) if k % 2 == 0] == ["0", "2", "4", "6", "8"]
    assert [queued.due(str(k), t) for k, t in enumerate(times)] == ["0", None, "1", None, "3", None, "5", None, "7"]
    assert plain.due("again", 0.0) == "again"  # a race that was reset
