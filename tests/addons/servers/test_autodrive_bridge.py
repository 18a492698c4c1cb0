"""The bridge to DevKits of AutoDRIVE: packets by hand, races in lockstep and in real time, and peers that misbehave."""

import base64
import contextlib
import gzip
import hashlib
import itertools
import json
import math
import socket
import threading
import time
from urllib.parse import parse_qs, urlsplit

import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection
from websockets.sync.server import serve

import fg_mujoco as fg
from cases import each
from fg_mujoco.addons.servers.autodrive import devkit as devkit_module
from fg_mujoco.addons.servers.autodrive.devkit import WHEEL_RADIUS, BlankCamera, DevKit
from fg_mujoco.addons.servers.autodrive.packets import LapTimes, packet, read_answer
from fg_mujoco.cli.main import main
from fg_mujoco.errors import MessageError
from fg_mujoco.messages import LaserScan, Odometry
from refusals import refused

pytest.importorskip("PIL")

SILENT, GONE = "silent", "gone"
PING, PATIENCE = 0.2, 1.5  # [s] between pings, and without a sign of life until the client is dropped


class DevKitServer:
    """What it was sent, and what it is asked for.

    Args:
      answer: makes, of the number of a packet from 0 and the packet, the data of the answer, SILENT, GONE, or a list of
        several answers and the time [s] after which each is sent. A KeyError is one of the DevKit's handler, which
        python-socketio survives.
      revision: of Engine.IO that it speaks; another is refused.
    """

    def __init__(self, answer, revision):
        self.packets = []
        self._answer, self._revision = answer, revision

    def refuse(self, connection, request):
        """Answer as python-engineio does: one of revision 4 refuses other clients, one of revision 3 refuses nobody."""
        if self._revision == 3:
            return None
        asked = parse_qs(urlsplit(request.path).query).get("EIO")
        return None if asked == [str(self._revision)] else connection.respond(400, "unsupported version")

    def talk(self, connection):
        """Shake hands, and answer each packet."""
        interval = int(1000 * PING)
        connection.send(f'0{{"sid":"a","upgrades":[],"pingInterval":{interval},"pingTimeout":20000}}')
        if self._revision == 4:
            assert connection.recv() == "40"
            connection.send('40{"sid":"b"}')
        else:
            connection.send("40")
        connection.send('42["Other",{"not":"for us"}]')
        connection.send("42" + "[" * 50_000)
        alive = pinged = time.monotonic()
        try:
            while time.monotonic() - alive < PATIENCE:
                if self._revision == 4 and time.monotonic() - pinged > PING:
                    connection.send("2")
                    pinged = time.monotonic()
                try:
                    message = str(connection.recv(timeout=PING))
                except TimeoutError:
                    continue
                if message == ("2" if self._revision == 3 else "3"):
                    alive = time.monotonic()
                if message == "2":
                    connection.send("3")
                if message.startswith("42") and not self._take(connection, message):
                    return
        except ConnectionClosed:
            pass

    def _take(self, connection, message):
        """Answer a packet; return whether the connection stays."""
        event, packet = json.loads(message[2:])
        assert event == "Bridge"
        self.packets.append(packet)
        try:
            answer = self._answer(len(self.packets) - 1, packet)
        except KeyError:
            return True
        for delay, part in answer if isinstance(answer, list) else [(0.0, answer)]:
            if part not in (SILENT, GONE):
                arguments = connection, "42" + json.dumps(["Bridge", part])
                threading.Timer(delay, _send, arguments).start() if delay else _send(*arguments)
        return answer != GONE


def _send(connection, text):
    with contextlib.suppress(ConnectionClosed):
        connection.send(text)


@contextlib.contextmanager
def devkit_server(answer, revision=3):
    """Run a DevKit, and yield its address and itself."""
    kit = DevKitServer(answer, revision)
    with serve(kit.talk, "127.0.0.1", 0, process_request=kit.refuse, compression=None, max_size=1 << 22) as server:
        thread = threading.Thread(target=server.serve_forever, daemon=True)
        thread.start()
        yield f"127.0.0.1:{server.socket.getsockname()[1]}", kit
        server.shutdown()
        thread.join()


def commands(throttle=0.1, steering=0.0, **more):
    """Return an answer as DevKits write it."""
    return {"V1 Throttle": f"{throttle:.3f}", "V1 Steering": f"{steering:.3f}", **more}


def classic(number, packet):
    """Drive as steer_by_sides, from a packet as AutoDRIVE's own DevKits read it."""
    ticks, angles = ([float(each) for each in packet[f"V1 Encoder {name}"].split()] for name in ("Ticks", "Angles"))
    assert np.array(ticks) == pytest.approx(np.array(angles) / math.tau * 1920, abs=1.1)
    ranges = packet["V1 LIDAR Range Array"].split()
    assert len(ranges) == len(packet["V1 LIDAR Intensity Array"].split()) == 1081
    text = base64.b64encode(gzip.compress("\n".join(ranges).encode())).decode()
    return steer_by_sides(number, {"V1 LIDAR Range Array": text})


QUARTER = math.radians(0.25)
_NESTED = json.loads("[" * 900 + "]" * 900)
_LAPS = LapTimes(count=2, time=3.25, last=14.1, best=13.9)


def a_scan(ranges=None):
    """Return a scan of the LiDAR that the bridge has, and of one beam more; beam k reads 1 m + k mm."""
    if ranges is None:
        ranges = 1.0 + 0.001 * np.arange(1081)
    return LaserScan(angle_min=math.radians(-135.0), angle_max=math.radians(135.0), angle_increment=QUARTER,
                     range_min=0.02, range_max=30.0, ranges=ranges, stamp=0.0)  # fmt: skip


def an_odometry(**changed):
    values = {"stamp": 0.0, "speed": 2.0, "steering_angle": 0.2618, "angular_velocity": np.array((0.0, 0.1, 0.5)),
              "linear_acceleration": np.array((0.4, 0.2, 9.81)), "wheel_speeds": np.full(4, 2.0),
              "pose": np.array((1.5, -2.0, math.pi / 2.0))}  # fmt: skip
    return Odometry(**(values | changed))


def told(scan=None, odometry=None, **changed):
    values = {"throttle": 0.25, "encoders": np.array((1.0, 2.0)), "laps": _LAPS, "collisions": 3, "image": "x"}
    return packet(scan or a_scan(), odometry or an_odometry(), **(values | changed))


def ranges_of(text):
    """Return the ranges as DevKits read them."""
    return np.array(gzip.decompress(base64.b64decode(text)).decode().split("\n"), dtype=float)


def steer_by_sides(number, packet):
    """Drive along the middle of the course at 2.5 m/s."""
    ranges = np.minimum(ranges_of(packet["V1 LIDAR Range Array"]), 4.0)
    steering = min(max(0.3 * (ranges[700:860].mean() - ranges[220:380].mean()), -0.4), 0.4)
    return commands(0.1, steering / 0.5236)


def raced(answer, revision=3, *, wait=0.0, patience=devkit_module.PATIENCE, **settings):
    """Race a DevKit on the oval in lockstep; return the result and the kit."""
    with devkit_server(answer, revision) as (address, kit), DevKit(address, BlankCamera(), patience=patience) as devkit:
        time.sleep(wait)
        return fg.race("oval", controller=devkit, **{"laps": 1} | settings), kit


def test_a_connection_is_opened_as_a_context_which_websockets_17_asks_for(monkeypatch):
    entered = []
    monkeypatch.setattr(ClientConnection, "__enter__", lambda self: entered.append(self) or self)
    with devkit_server(lambda number, packet: commands(0.0, 0.0)) as (address, _), DevKit(address, BlankCamera()):
        assert len(entered) == 1


def test_a_packet_has_what_the_simulator_tells_in_its_units():
    values = told()
    assert values["V1 Position"] == "1.5000 -2.0000 0.0000"
    assert values["V1 Orientation Quaternion"] == "0.0000 0.0000 0.7071 0.7071"
    assert values["V1 Angular Velocity"] == "0.0000 0.1000 0.5000"
    assert values["V1 Linear Acceleration"] == "0.4000 0.2000 9.8100"
    assert values["V1 Encoder Angles"] == "1.0000 2.0000"
    assert (values["V1 Throttle"], values["V1 Steering"], values["V1 Speed"]) == ("0.2500", "0.5000", "2.0000")
    assert (values["V1 Lap Count"], values["V1 Lap Time"], values["V1 Collisions"]) == ("2", "3.2500", "3")
    assert (values["V1 Last Lap Time"], values["V1 Best Lap Time"]) == ("14.1000", "13.9000")
    assert values["V1 LIDAR Scan Rate"] == "40.0000"
    assert all(isinstance(value, str) for value in values.values())
    assert set(told(vehicle=2)) == {key.replace("V1", "V2") for key in values}


def test_the_beams_of_a_packet_are_1081_from_the_right_and_inf_where_the_simulator_sees_nothing():
    assert ranges_of(told()["V1 LIDAR Range Array"]).tolist() == pytest.approx((1.0 + 0.001 * np.arange(1081)).tolist())
    ranges = np.full(1081, 5.0)
    ranges[:6] = math.nan, 0.05, 0.06, 10.0, 10.01, -math.inf
    read = ranges_of(told(a_scan(ranges))["V1 LIDAR Range Array"])
    assert read[:7].tolist() == [math.inf, math.inf, 0.06, 10.0, math.inf, math.inf, 5.0]


def test_full_throttle_and_steering_are_the_simulators_greatest():
    command = read_answer({"V1 Throttle": "0.5", "V1 Steering": "-1.000", "Reset": "False"}).command
    assert (command.speed, command.steering_angle) == (12.625, -0.5236)
    clipped = read_answer({"V1 Throttle": 7, "V1 Steering": -3.0})
    assert (clipped.throttle, clipped.steering, clipped.reset) == (1.0, -1.0, False)
    assert read_answer({"V1 Throttle": "0", "V1 Steering": "0", "Reset": "True"}).reset


@each("answer, said",
      [(None, "the DevKit has answered None; accepted: a dictionary of commands"),
       (["V1 Throttle"], "the DevKit has answered ['V1 Throttle']; accepted: a dictionary"),
       ({"V1 Throttle": "0.1"}, "the DevKit has answered no 'V1 Steering'; accepted: a number from -1 to 1"),
       ({"V1 Throttle": "fast", "V1 Steering": "0"}, "'V1 Throttle' 'fast'; accepted: a number"),
       ({"V1 Throttle": "nan", "V1 Steering": "0"}, "'V1 Throttle' 'nan'; accepted: a number"),
       ({"V1 Throttle": "0", "V1 Steering": "1e999"}, "'V1 Steering' '1e999'; accepted: a number"),
       ({"V1 Throttle": None, "V1 Steering": "0"}, "'V1 Throttle' None; accepted: a number"),
       ({"V1 Throttle": 10**400, "V1 Steering": "0"}, "; accepted: a number"),
       ({"V1 Throttle": _NESTED, "V1 Steering": "0"}, "; accepted: a number")])  # fmt: skip
def test_an_answer_without_commands_is_refused(answer, said):
    with pytest.raises(MessageError) as refused:
        read_answer(answer)
    assert said in str(refused.value)


def test_a_lap_in_lockstep_has_the_same_bits_twice():
    """In both revisions of the protocol, which carry the same; half a second of the second lap, whose time is anew."""
    settings = {"laps": 2, "time_limit": 23.7, "rules": "autodrive_2026", "vehicle": "autodrive"}
    (one, _), (result, kit) = (raced(steer_by_sides, revision, **settings) for revision in (3, 4))
    assert 2 * len(kit.packets) == len(result.ctrl) > 900 and one.trajectory_sha256 == result.trajectory_sha256
    (lap,), time = result.car.lap_times_s, result.car.column("time_s")[::2]
    assert time[-1] > lap + 0.2 and result.car.collisions_wall == 0
    times = [float(packet["V1 Lap Time"]) for packet in kit.packets]
    assert times == pytest.approx(np.where(time < lap, time, time - lap).tolist(), abs=1e-4)
    up = [float(packet["V1 Linear Acceleration"].split()[2]) for packet in kit.packets]
    assert np.median(up) == pytest.approx(0.0, abs=0.1)
    rolled = np.array([float(packet["V1 Encoder Angles"].split()[0]) for packet in kit.packets[-2:]])
    speed = float(kit.packets[-1]["V1 Speed"])
    assert (rolled[1] - rolled[0]) * WHEEL_RADIUS == pytest.approx(0.05 * speed, rel=0.05)


@each("fifth, said", [(SILENT, "an exception has ended its handler"), (GONE, "the DevKit has gone"),
                      ({"V1 Throttle": "full"}, "has answered 'V1 Throttle'")])  # fmt: skip
def test_a_devkit_that_fails_ends_the_race_of_its_car_and_what_was_driven_is_kept(fifth, said):
    with pytest.warns(UserWarning, match="DevKit failed"):
        result, _ = raced(lambda number, packet: fifth if number == 5 else commands(), patience=0.3)
    assert result.car.end_reason == "planner_failed" and said in str(result.car.planner_failure)
    assert len(result.ctrl) == 10


@each("revision", [3, 4])
def test_a_devkit_stays_while_the_race_pauses(revision):
    """Kernels are compiled, or a run folder is written."""
    result, kit = raced(lambda number, packet: commands(), revision, wait=2.0 * PATIENCE, time_limit=0.2)
    assert result.car.end_reason == "time_limit" and len(kit.packets) == 4


@each("delays", [(0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.02)])
def test_of_several_answers_the_last_counts_and_none_to_an_earlier_packet(delays, monkeypatch):
    monkeypatch.setattr(devkit_module, "_SETTLE", 0.6)  # on a busy machine an answer takes longer than it is given
    result, _ = raced(lambda number, _: [(delay, commands(0.001 * number)) for delay in delays], time_limit=0.5)
    commanded = np.rint(result.car.column("command_speed_m_s") / 0.02525).astype(int)
    assert commanded.tolist() == [0] * 4 + [k // 2 for k in range(16)]  # each acts two frames after its packet


def test_a_devkit_drives_the_leagues_car_whose_acceleration_is_that_of_its_velocity():
    """At rest 0 0 0; a command shows in the third packet after; wheels that are locked do not turn."""
    result, kit = raced(lambda number, _: commands(0.2 if number < 20 else 0.0), time_limit=1.4, vehicle="autodrive")
    told = {key: np.array([[float(number) for number in packet[f"V1 {key}"].split()] for packet in kit.packets])
            for key in ("Speed", "Encoder Angles", "Linear Acceleration")}  # fmt: skip
    assert (np.abs(told["Speed"][:3]) < 0.01).all() and told["Speed"][3] == pytest.approx(5.05, rel=0.01)
    assert np.abs(told["Linear Acceleration"][:3]).max() < 0.1
    vx, time = result.car.column("vx_m_s"), result.car.column("time_s")
    for at in (8, 12, 26):  # speeding up, and braking, when the car leans on its springs
        tick = 2 * at
        change = (vx[tick + 1] - vx[tick - 1]) / (time[tick + 1] - time[tick - 1])
        assert told["Linear Acceleration"][at, 0] == pytest.approx(change, rel=0.05)
        assert abs(told["Linear Acceleration"][at, 2]) < 0.3
    turned = np.diff(told["Encoder Angles"], axis=0) * WHEEL_RADIUS
    assert turned[3:21] == pytest.approx(0.05 * 5.05, rel=0.01) and (np.abs(turned[23:]) < 1e-3).all()


def test_answers_that_come_at_any_time_are_refused_in_lockstep():
    """The first packet gets one answer, and each later one another besides, as if it were to the packet before."""
    with pytest.warns(UserWarning, match="DevKit failed"):
        result, _ = raced(lambda number, packet: [(0.0, commands())] * min(number + 1, 2), time_limit=5.0)
    assert "accepted: one answer to each packet, or --real-time" in str(result.car.planner_failure)


def test_a_classic_devkit_gets_ticks_intensities_and_ranges_as_text():
    usual, _ = raced(steer_by_sides, patience=0.5, time_limit=1.0)
    with pytest.warns(UserWarning, match="classic"):
        told, _ = raced(classic, patience=0.5, time_limit=1.0)
    assert told.trajectory_sha256 == usual.trajectory_sha256


@pytest.mark.usefixtures("without_pictures")
def test_the_command_begins_anew_where_the_devkit_asks_for_it(tmp_path, capsys):
    resets = [5]

    def answer(number, packet):
        return commands(0.1, 0.0, Reset=str(number in resets))

    with devkit_server(answer, 4) as (address, kit):
        out = str(tmp_path / "served")
        options = ["--devkit", address, "--laps", "1", "--time-limit", "0.5", "--out", out]
        assert main(["serve", "autodrive", *options]) == 1
    printed = capsys.readouterr().out
    assert f"written to        {out}/1" in printed and f"written to        {out}/2" in printed
    assert [packet["V1 Lap Time"] for packet in kit.packets[4:8]] == ["0.2000", "0.2500", "0.0000", "0.0500"]
    assert fg.read_run(f"{out}/1").summary["end_reason"] == "interrupted"
    assert fg.read_run(f"{out}/2").summary["rules"] == "autodrive_2026"


@pytest.mark.usefixtures("without_pictures")
@each("resets, races", [(lambda number: True, 2), (lambda number: number % 2 == 0, 3)])
def test_a_devkit_that_always_asks_for_a_reset_makes_few_folders(resets, races, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("fg_mujoco.addons.servers.commands._MOST_RACES", 3)
    out = tmp_path / "served"
    with devkit_server(lambda number, packet: commands(Reset=str(resets(number)))) as (address, _):
        code = main(["serve", "autodrive", "--devkit", address, "--time-limit", "0.2", "--out", str(out)])
    assert len(list(out.iterdir())) == races
    assert (code == 2) == ("has asked for a reset 3 times" in capsys.readouterr().err) == (races == 3)


@each("said",
      [b"0" + b"[" * 40, b"0" + b"[" * 50_000, b"0" + b"9" * 5000, b"0{}41", b'0{"pingInterval": []}', b"\xff\xfe", b"",
       b'0{"pingInterval": 1e999}', b'0{"pingInterval": 0}', b'0{"pingInterval": -1}', b"3", b"44"])  # fmt: skip
def test_a_handshake_that_is_none_is_refused_in_one_line(said, here, capsys):
    """The bytes come as a text of WebSocket, and as they are."""
    frame = (b"\x81" + (bytes([len(said)]) if len(said) < 126 else b"\x7e" + len(said).to_bytes(2, "big"))) + said
    for told in (frame, said):
        with socket.create_server(("127.0.0.1", 0)) as listening:
            threading.Thread(target=_talk_nonsense, args=(listening, told), daemon=True).start()
            address = f"127.0.0.1:{listening.getsockname()[1]}"
            refused(here, capsys, "serve", "autodrive", "--devkit", address)


def _talk_nonsense(listening, told):
    with contextlib.suppress(OSError):
        while True:
            with listening.accept()[0] as peer:
                request = peer.recv(65536)
                key = request.partition(b"Sec-WebSocket-Key: ")[2].partition(b"\r\n")[0]
                accept = base64.b64encode(hashlib.sha1(key + b"258EAFA5-E914-47DA-95CA-C5AB0DC85B11").digest())
                head = b"HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
                peer.sendall((head + b"Sec-WebSocket-Accept: " + accept + b"\r\n\r\n") * (told[:1] == b"\x81") + told)


def test_collisions_are_told_and_the_car_goes_on_from_a_checkpoint():
    with devkit_server(lambda number, packet: commands(0.15)) as (address, kit):
        assert main(["serve", "autodrive", "--devkit", address, "--laps", "1", "--time-limit", "8"]) == 1
    told_collisions = [int(packet["V1 Collisions"]) for packet in kit.packets]
    assert told_collisions[0] == 0 and told_collisions[-1] >= 1
    assert all(b - a in (0, 1) for a, b in itertools.pairwise(told_collisions))
