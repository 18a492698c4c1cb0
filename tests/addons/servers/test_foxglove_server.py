"""The server for Foxglove: a client that is written from the protocol subscribes, publishes, sets and calls."""

import json
import math
import struct
import time
from contextlib import contextmanager

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.addons.look.live.live_session import LiveSession
from fg_mujoco.addons.ros.bag_messages import drive_message, from_cdr, heading_of, to_cdr
from fg_mujoco.addons.ros.bag_writer import TOPICS
from fg_mujoco.messages import DriveCommand

pytest.importorskip("foxglove")
pytest.importorskip("rosbags")
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from fg_mujoco.addons.servers.foxglove_server import FoxgloveServer

_PATIENCE = 20.0  # [s]


class Client:
    """A client of Foxglove's WebSocket protocol, version "foxglove.sdk.v1"."""

    def __init__(self, url):
        options = {"max_size": 1 << 26, "proxy": None, "ping_interval": None}
        self._socket = connect(url, subprotocols=["foxglove.sdk.v1"], **options).__enter__()
        self.channels, self.services, self.said, self.messages, self.answers = {}, {}, [], {}, {}
        self.wait_for(lambda: self.channels and self.services)

    def send(self, **operation):
        self._socket.send(json.dumps(operation))

    def subscribe(self, *topics):
        ids = [each["id"] for each in self.channels.values() if each["topic"] in topics]
        self.send(op="subscribe", subscriptions=[{"id": each, "channelId": each} for each in ids])

    def advertise(self, number, topic, encoding="json"):
        channel = {"id": number, "topic": topic, "encoding": encoding, "schemaName": "", "schema": ""}
        self.send(op="advertise", channels=[channel])

    def publish(self, number, content):
        content = content if isinstance(content, bytes) else json.dumps(content).encode()
        self._socket.send(struct.pack("<BI", 1, number) + content)

    def call(self, name):
        head = struct.pack("<BIII", 2, self.services[name], 7, 4)
        self._socket.send(head + b"json" + b"{}")

    def wait_for(self, holds):
        """Read until a condition holds."""
        until = time.monotonic() + _PATIENCE
        while not holds():
            assert time.monotonic() < until, self.said
            try:
                self._take(self._socket.recv(timeout=0.05))
            except TimeoutError:
                continue

    def _take(self, message):
        if isinstance(message, str):
            found = json.loads(message)
            if found["op"] == "advertise":
                self.channels.update({each["id"]: each for each in found["channels"]})
            elif found["op"] == "advertiseServices":
                self.services.update({each["name"]: each["id"] for each in found["services"]})
            elif found["op"] == "parameterValues":
                self.answers = {each["name"]: each["value"] for each in found["parameters"] if "value" in each}
            elif found["op"] == "status":
                self.said.append(found["message"])
        elif message[0] == 1:
            (number,) = struct.unpack("<I", message[1:5])
            self.messages.setdefault(self.channels[number]["topic"], []).append(message[13:])


@contextmanager
def served(track="oval", **options):
    """Yield a session, its server, which nobody runs, and a client."""
    session = LiveSession(fg.Setup.of(track))
    with FoxgloveServer(session, port=0, **options) as server:
        yield session, server, Client(server.url)


def test_topics_have_the_types_of_a_bag_and_messages_are_what_the_car_senses():
    with served() as (session, server, client):
        types = {each["topic"]: each["schemaName"] for each in client.channels.values()}
        assert TOPICS.items() <= types.items()
        assert types["/scene"] == "foxglove.SceneUpdate"
        client.subscribe("/scan", "/odom", "/car", "/map", "/scene")
        client.wait_for(lambda: server._asked)
        server.tick()
        client.wait_for(lambda: {"/scan", "/odom", "/car", "/map", "/scene"} <= set(client.messages))
        scan = from_cdr(client.messages["/scan"][-1], "sensor_msgs/msg/LaserScan")
        assert np.array_equal(scan.ranges, session.scan.ranges.astype(np.float32))
        odometry = from_cdr(client.messages["/odom"][-1], "nav_msgs/msg/Odometry")
        position = odometry.pose.pose.position
        assert (position.x, position.y) == pytest.approx(session.simulation.pose[:2], abs=1e-12)
        assert odometry.twist.twist.linear.x == session.odometry.speed
        numbers = json.loads(client.messages["/car"][-1])
        assert numbers["speed_m_s"] == session.simulation.speed and numbers["laps"] == 0
        session.hold(DriveCommand(steering_angle=0.3, speed=3.5))
        for _ in range(20):
            server.tick()
        client.wait_for(lambda: len(client.messages["/odom"]) >= 21)
        told = [from_cdr(each, "nav_msgs/msg/Odometry") for each in client.messages["/odom"][-3:]]
        before, after = (told[k].pose.pose.position for k in (0, 2))
        heading = heading_of(told[1].pose.pose.orientation)
        left = (after.y - before.y) * math.cos(heading) - (after.x - before.x) * math.sin(heading)
        assert told[1].twist.twist.linear.y == pytest.approx(left / 0.05, abs=0.005) and abs(left) > 4e-4


def test_each_command_is_one_tick_with_the_bits_of_a_simulation_stepped_by_hand():
    commands = [DriveCommand(steering_angle=round(0.01 * k, 3), speed=2.0) for k in range(20)]
    states = []
    for encoding in ("json", "cdr"):
        with served(step_on_drive=True) as (session, server, client):
            client.advertise(1, "/drive", encoding)
            for number, command in enumerate(commands, start=1):
                message = drive_message(command, 0)
                angle, speed = (float(np.float32(v)) for v in (message.drive.steering_angle, message.drive.speed))
                drive = {"steering_angle": angle, "speed": speed}
                client.publish(1, {"drive": drive} if encoding == "json" else to_cdr(message))
                assert server.step(_PATIENCE)
                assert session.simulation.time == pytest.approx(0.025 * number)
            states.append(session.simulation.state)
    simulation = fg.Simulation(fg.World("oval"))
    for command in commands:
        drive = drive_message(command, 0).drive
        angle, speed = (float(np.float32(value)) for value in (drive.steering_angle, drive.speed))
        simulation.step(DriveCommand(steering_angle=angle, speed=speed))
    assert states[0].tobytes() == states[1].tobytes() == simulation.state.tobytes()


def test_commands_that_come_at_once_are_a_tick_each_in_their_order_and_too_many_are_dropped_and_told():
    with served(step_on_drive=True) as (session, server, client):
        client.advertise(1, "/drive")
        for number in range(403):
            client.publish(1, {"drive": {"steering_angle": 0.001 * number, "speed": 1.0}})
        client.wait_for(lambda: sum("400 wait" in said for said in client.said) == 3)
        assert session.simulation.time == 0.0
        for number in range(3):
            assert server.step(_PATIENCE)
            assert session.simulation.time == pytest.approx(0.025 * (number + 1))
            assert session.simulation.engine.commands[0].tolist() == pytest.approx([0.001 * number, 1.0])
        assert server._waiting.qsize() == 397


def test_a_twist_is_the_angle_at_which_the_car_turns_at_that_rate():
    with served() as (session, server, client):
        client.advertise(1, "/cmd_vel")
        client.publish(1, {"linear": {"x": 2.0}, "angular": {"z": 1.5}})
        client.wait_for(lambda: session.held_from_outside)
        server.tick()
        angle, speed = session.simulation.engine.commands[0]
        assert speed == 2.0
        assert speed * math.tan(angle) / session.world.parameters.wheelbase == pytest.approx(1.5)
        server._commanded -= 60.0  # the client has been silent for a minute
        server.tick()
        assert session.simulation.engine.commands[0].tolist() == [0.0, 0.0]
        server.set_parameter("driver", "planner")
        server.tick()
        assert session.simulation.engine.commands[0, 1] > 0.0


def test_an_initial_pose_puts_the_car_there_and_one_in_a_wall_is_refused():
    with served("hairpins") as (session, _, client):
        x, y, heading = session.world.track.start_pose(12.0, 0.2)
        client.advertise(1, "/initialpose")

        def put(x, y, heading):
            orientation = {"z": math.sin(0.5 * heading), "w": math.cos(0.5 * heading)}
            client.publish(1, {"pose": {"pose": {"position": {"x": x, "y": y}, "orientation": orientation}}})
            client.wait_for(lambda: session._place_asked is not None)
            session.paused = True
            session._obey()

        put(x, y, heading + 0.3)
        found = session.simulation.pose
        assert found == pytest.approx((x, y, math.remainder(heading + 0.3, math.tau)), abs=0.02)
        put(500.0, 0.0, 0.0)
        assert "accepted" in session.message
        assert session.simulation.pose == pytest.approx(found)


def test_parameters_are_read_and_set_and_bad_values_are_said():
    with served() as (session, _, client):
        client.send(op="getParameters", parameterNames=[], id="a")
        client.wait_for(lambda: client.answers)
        assert client.answers["mu"] == pytest.approx(1.0489) and client.answers["driver"] == "planner"
        client.send(op="setParameters", parameters=[{"name": "max_speed", "value": 3.5}], id="b")
        client.wait_for(lambda: "max_speed" in session._wishes)
        session._obey()
        assert session.settings.max_speed == 3.5
        for name, value in (("nonsense", 1.0), ("driver", "nobody"), ("paused", 3)):
            client.send(op="setParameters", parameters=[{"name": name, "value": value}], id="c")
            client.wait_for(lambda name=name: any(name in said and "accepted" in said for said in client.said))


@each("topic, encoding, content, said",
      [("/nonsense", "json", b"{}", "nobody listens to /nonsense; accepted: /drive, /cmd_vel, /initialpose"),
       ("/drive", "json", b"{", "a message on /drive cannot be read as json"),
       ("/drive", "json", b"[1]", "a message on /drive cannot be read as json"),
       ("/drive", "cdr", b"\x00\x01", "a message on /drive cannot be read as cdr"),
       ("/drive", "protobuf", b"", "is encoded as 'protobuf'; accepted: json or cdr"),
       ("/drive", "json", b'{"drive": {"speed": NaN}}', "a message on /drive: "),
       ("/drive", "json", b'{"drive": {"speed": "fast"}}', "a message on /drive: "),
       ("/drive", "json", b'{"drive": {"speed": "2.0"}}', "'2.0' is no number"),
       ("/drive", "json", b'{"drive": {"speed": 1' + b"0" * 400 + b"}}", "a message on /drive: "),
       ("/cmd_vel", "json", b'{"linear": 3}', "a message on /cmd_vel: "),
       ("/initialpose", "json", b'{"pose": {"pose": {"position": {"x": Infinity}}}}', "a message on /initialpose: ")])
def test_a_message_that_cannot_be_used_is_said_and_the_race_goes_on(topic, encoding, content, said, shared_server):
    session, server, client = shared_server
    client.said.clear()
    client.advertise(1, topic, encoding)
    client.publish(1, content)
    client.wait_for(lambda: any(said in each for each in client.said))
    client.send(op="unadvertise", channelIds=[1])
    assert not session.held_from_outside
    server.tick()


@each("protocols", [["foxglove.websocket.v1"], ["else"], None])
def test_a_client_of_another_protocol_is_refused_and_the_terminal_says_which_versions_connect(protocols):
    lines = []
    with FoxgloveServer(LiveSession(fg.Setup.of("oval")), port=0, log=lines.append) as server:
        with pytest.raises(InvalidStatus):
            connect(server.url, subprotocols=protocols, proxy=None)
        until = time.monotonic() + _PATIENCE
        while not lines:
            assert time.monotonic() < until
            time.sleep(0.01)
        Client(server.url)
    (line,) = lines
    assert "127.0.0.1" in line and "accepted: the protocol foxglove.sdk.v1, which Foxglove since 2025" in line


@pytest.fixture(scope="module")
def shared_server():
    with served() as found:
        yield found
