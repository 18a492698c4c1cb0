"""Targets that drive on and on: environments of f1tenth_gym, the live view and its server, races of several cars."""

import atexit
import contextlib
import http.client
import os
import shutil
import socket
import threading
import time
from functools import cache

import numpy as np
from cyclonedds.core import DDSException
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect
from websockets.sync.server import serve

from fg_mujoco.addons import gym2d as f110
from fg_mujoco.addons.gym2d.new_api import F110Env as NewEnv
from fg_mujoco.addons.look.live.browser import LiveView
from fg_mujoco.addons.look.live.handshake import is_own
from fg_mujoco.addons.look.live.live_session import LiveSession
from fg_mujoco.addons.ros.bag_messages import drive_message, to_cdr
from fg_mujoco.addons.servers.foxglove_server import FoxgloveServer
from fg_mujoco.envs.gym_environment import F1TenthEnv
from fg_mujoco.messages import DriveCommand
from fg_mujoco.racing.setup import Setup

from .file_targets import race, ring
from .mutations import NUMBERS, VALUES, mutated, mutated_binary, one_of
from .planner_targets import PLANNER
from .target import Target, as_text, command, ignore_refusal

# -- our own environments

_KEYS = ("track", "mu", "max_steps", "vehicle", "reward", "action", "controller", "seed", "max_speed", "start",
         "time_limit")  # fmt: skip


def _environment(samples, here, rng):
    settings = {one_of(rng, _KEYS): one_of(rng, VALUES)} if rng.random() < 0.4 else {}

    def steps():
        env = F1TenthEnv(**settings)
        try:
            env.reset(seed=int(rng.integers(100)))
            for _ in range(3):
                env.step(one_of(rng, VALUES))
        finally:
            env.close()

    return ignore_refusal(steps)


# -- environments of f1tenth_gym

_OLD = ("map", "map_ext", "params", "num_agents", "timestep", "ego_idx", "seed", "integrator", "model", "lidar_dist",
        "num_beams", "fov", "vehicle", "tires", "maps", "render_mode", "unknown")  # fmt: skip
_NEW = ("map", "map_ext", "scale", "params", "num_agents", "timestep", "ego_idx", "seed", "integrator", "model",
        "lidar_dist", "num_beams", "fov", "control_input", "observation_config", "reset_config", "max_laps", "unknown")
_PARAMS = ("mu", "C_Sf", "lf", "lr", "h", "m", "I", "s_min", "s_max", "sv_max", "v_switch", "a_max", "v_min", "v_max",
           "width", "length")  # fmt: skip


def _odd_settings(names, rng):
    """Return settings of a small environment on the ring, mostly with one or two that are odd."""
    settings = {"map": one_of(rng, ("map", "ring.csv", "oval")), "num_beams": 60}
    settings["num_agents"] = int(one_of(rng, (1, 1, 2)))
    for _ in range(int(one_of(rng, (0, 1, 1, 2)))):
        settings[one_of(rng, names)] = one_of(rng, VALUES)
    if rng.random() < 0.2:
        settings["params"] = {one_of(rng, _PARAMS): one_of(rng, VALUES)}
    return settings


def _odd_rows(count, width, rng):
    """Return poses or actions, or something else in their place."""
    if rng.random() < 0.3:
        return one_of(rng, VALUES)
    rows = rng.normal(0.0, 1.0, (count, width))
    if rng.random() < 0.4:
        rows[rng.random(rows.shape) < 0.5] = one_of(rng, (np.nan, np.inf, -np.inf, 1e308, 1e9, -1e9, 5e-324))
    return rows if rng.random() < 0.8 else rows.tolist()


def _f110(samples, here, rng):
    shutil.copytree(samples, here, dirs_exist_ok=True)
    old = rng.random() < 0.5
    settings = _odd_settings(_OLD if old else _NEW, rng)

    def drive():
        if old:
            env = f110.make("f110_gym:f110-v0", **settings)
        else:
            env = NewEnv(config=settings if rng.random() < 0.9 else one_of(rng, VALUES))
        try:
            agents = env.num_agents
            poses = None if rng.random() < 0.5 else _odd_rows(agents, 3, rng)
            if old:
                env.reset(poses)
            else:
                env.reset(options=None if poses is None else {"poses": poses})
            for _ in range(3):
                env.step(_odd_rows(agents, 2, rng))
            if rng.random() < 0.2:
                env.update_params({one_of(rng, _PARAMS): one_of(rng, VALUES)})
                env.reset()
        finally:
            env.close()

    return ignore_refusal(drive)


# -- the live view

_KNOBS = ("mu", "planner_mu", "max_speed", "planner.lookahead", "planner.guidance", "planner.x", "", "planner.", "seed")


def _live_session(samples, here, rng):
    settings = {"controller": one_of(rng, ("gap_finder", "follow_the_gap", "pure_pursuit"))}
    if rng.random() < 0.3:
        names = ("track", "controller", "obstacles", "max_speed", "mu", "seed", "start", "grid", "opponents", "effects")
        settings[one_of(rng, names)] = one_of(rng, VALUES)

    def play():
        session = LiveSession(Setup.of(**settings))
        for _ in range(6):
            what = int(rng.integers(5))
            if what == 0:
                session.change(one_of(rng, _KNOBS), one_of(rng, VALUES))
            elif what == 1:
                session.key(one_of(rng, ("faster", "slower", "left", "right", "stop")))
            elif what == 2:
                session.reset()
            elif what == 3:
                session.paused, session.by_hand = bool(rng.random() < 0.3), bool(rng.random() < 0.5)
            session.tick()
            session.goal(), session.drawings(), session.trace, session.scan_points(7)
            assert "\n" not in session.message
            assert np.isfinite(session.simulation.state).all()

    return ignore_refusal(play)


def _live_view(samples, here, rng):
    own = ("localhost:8080", "127.0.0.1:8080", "[::1]:8080")
    host = one_of(rng, own)
    hosts = [as_text(mutated(one_of(rng, own).encode(), rng)) for _ in range(int(rng.integers(0, 3)))]
    origins = [as_text(mutated(f"http://{host}".encode(), rng)) for _ in range(int(rng.integers(0, 3)))]

    def check():
        if is_own(hosts, origins, frozenset({"0.0.0.0", "robot"})) and origins:
            assert len(hosts) == 1 and {origin.lower() for origin in origins} == {f"http://{hosts[0].lower()}"}
        assert not is_own([host], ["http://evil.example"], frozenset())
        assert is_own([host], [f"http://{host}"], frozenset())
        return 0

    return check


_REQUEST = (b"GET / HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n"
            b"Origin: http://127.0.0.1:{port}\r\nSec-WebSocket-Version: 13\r\n"
            b"Sec-WebSocket-Protocol: viser-v1.1.1\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n")  # fmt: skip


@cache
def _server():
    """Start a live view, once for a process, and return its port."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = int(probe.getsockname()[1])
    view = LiveView(LiveSession(), port=port)
    threading.Thread(target=view.run, daemon=True).start()
    atexit.register(view.close)
    return port


def _frame(payload, rng, opcodes=(2, 2, 2, 1, 0, 8, 9, 15)):
    """Return a frame of a WebSocket, as a browser masks it; sometimes one that says of itself what is not so."""
    opcode = int(one_of(rng, opcodes))
    mask = rng.bytes(4)
    masked = bytes(byte ^ mask[i % 4] for i, byte in enumerate(payload))
    length = len(payload) if rng.random() < 0.9 else int(rng.integers(126))
    size = bytes([0x80 | length]) if length < 126 else b"\xfe" + length.to_bytes(2, "big")
    return bytes([0x80 | opcode]) + size + mask + masked


def _live_server(samples, here, rng):
    port = _server()
    head = _REQUEST.replace(b"{port}", str(port).encode())
    if rng.random() < 0.6:
        head = mutated(head, rng)
    message = b"\x82\xa4type\xbaGuiUpdateMessage\xa7updates\x81\xa5value\xc3"  # as msgpack has it
    frames = b"".join(_frame(mutated_binary(message, rng)[:60_000], rng) for _ in range(int(rng.integers(1, 4))))

    def talk():
        with socket.create_connection(("127.0.0.1", port), timeout=5.0) as peer:
            peer.settimeout(0.05)
            try:
                peer.sendall(head)
                peer.recv(4096)
                peer.sendall(frames)
                peer.recv(4096)
            except OSError:  # it hung up, or had nothing to say
                pass
        connection = http.client.HTTPConnection("127.0.0.1", port, timeout=8.0)
        connection.request("GET", "/")
        assert connection.getresponse().status == 200
        connection.close()
        return 0

    return talk


# -- servers of races

_TO_FOXGLOVE = (
    b'{"op": "advertise", "channels": [{"id": 1, "topic": "/drive", "encoding": "json", "schemaName": ""}]}',
    b'{"op": "setParameters", "parameters": [{"name": "max_speed", "value": 3.5}], "id": "b"}',
    b'{"op": "getParameters", "parameterNames": ["mu"], "id": "a"}',
    b'\x01\x01\0\0\0{"drive": {"speed": 1.5, "steering_angle": -0.1}}',
)  # fmt: skip
_FROM_DEVKIT = (b'0{"sid":"a","upgrades":[],"pingInterval":25000,"pingTimeout":20000}', b"40", b"2", b"3",
                b'42["Bridge",{"V1 Throttle":"0.1","V1 Steering":"0.0","Reset":"False"}]')  # fmt: skip


@cache
def _racing():
    """Start a server, once for a process."""
    server = FoxgloveServer(LiveSession(), port=0, log=print)
    threading.Thread(target=server.run, daemon=True).start()
    atexit.register(server.close)
    return server


def _peer(rng):
    """Return an attempt to talk nonsense to a server, which serves others all the same."""
    port, protocol = _racing().port, "foxglove.sdk.v1"
    head = _REQUEST.replace(b"{port}", str(port).encode()).replace(b"viser-v1.1.1", protocol.encode())
    if rng.random() < 0.2:
        head = mutated(head, rng)
    texts = rng.permutation(_TO_FOXGLOVE).tolist()
    said = [mutated(text, rng)[:60_000] if rng.random() < 0.7 else text for text in texts]
    frames = b"".join(_frame(text, rng, (1, 1, 1, 1, 2, 0, 8, 9, 15)) for text in said)

    def talk():
        with socket.create_connection(("127.0.0.1", port), timeout=5.0) as peer, contextlib.suppress(OSError):
            peer.settimeout(0.2)
            peer.sendall(head)
            peer.recv(4096)
            peer.sendall(frames)
            peer.recv(4096)
        with connect(f"ws://127.0.0.1:{port}", subprotocols=[protocol], proxy=None) as peer:
            assert peer.recv(timeout=8.0)
        return 0

    return talk


def _servers(samples, here, rng):
    if rng.random() < 0.5:
        return _peer(rng)
    greeting = [mutated(text, rng) if rng.random() < 0.3 else text for text in _FROM_DEVKIT[:2]]
    answers = [mutated(one_of(rng, _FROM_DEVKIT), rng) if rng.random() < 0.5 else _FROM_DEVKIT[-1] for _ in range(5)]
    as_they_are = rng.random() < 0.1

    def answer(connection):
        with contextlib.suppress(ConnectionClosed, OSError):
            for text in (*greeting, *answers):
                if as_they_are:
                    connection.socket.sendall(text)
                else:
                    connection.send(as_text(text).encode("utf-8", errors="replace").decode())
            while connection.recv():
                connection.send(_FROM_DEVKIT[-1].decode())

    def race():
        with serve(answer, "127.0.0.1", 0) as server:
            threading.Thread(target=server.serve_forever, daemon=True).start()
            address = f"127.0.0.1:{server.socket.getsockname()[1]}"
            try:
                return command("serve", "autodrive", "--devkit", address, "--patience", 0.2, "--time-limit", 0.1)()
            finally:
                server.shutdown()

    return race


@cache
def _ros2():
    """Start a node of ROS 2, once for a process, with a peer that offers all that it reads."""
    from fg_mujoco.addons.servers.ros2.participant import Participant
    from fg_mujoco.addons.servers.ros2.server import Ros2Server, _taken

    domain, kinds = 150 + os.getpid() % 80, _taken({}, ())
    server = Ros2Server(LiveSession(), domain=domain, host="127.0.0.1")
    peer = Participant("peer", domain=domain, host="127.0.0.1")
    for topic, kind in kinds.items():
        peer.offer(topic, kind)
    return server, peer, kinds


def _ros2_peer(samples, here, rng):
    """A peer on DDS whose numbers are of any kind, and bytes that are no messages: the race goes on."""
    told = to_cdr(drive_message(DriveCommand(steering_angle=0.1, speed=1.0), 0))
    contents = [mutated_binary(one_of(rng, (told, b"\0\1\0\0" + bytes(400), b"\0\1\0\0\1")), rng) for _ in range(5)]
    floats = [rng.choice([0.0, 1e-40, -1e30, np.nan, np.inf, 1.0], 5).astype("<f4").tobytes() for _ in range(2)]

    def say():
        server, peer, kinds = _ros2()
        for content in (*contents, *(told[: -len(each)] + each for each in floats)):
            topic = one_of(rng, list(kinds))
            with contextlib.suppress(DDSException):  # it does not send what is not of the type
                peer.write(topic, content)
            server._take(topic, kinds[topic], content)
        server._participant.wait(0.01)
        for topic, kind, content in server._participant.take():
            server._take(topic, kind, content)
        server._look(time.monotonic())
        server._race.tick()
        return 0

    return say


# -- several cars

_OPPONENTS = ("gap_finder", "follow_the_gap[point=deepest]", "pure_pursuit[line=ring.csv]", "planner.py:Planner",
              "wall_follow")  # fmt: skip


def _several_cars(samples, here, rng):
    shutil.copytree(samples, here, dirs_exist_ok=True)
    (here / "planner.py").write_bytes(mutated(PLANNER, rng) if rng.random() < 0.5 else PLANNER)
    arguments = ["--track", one_of(rng, ("oval", "oval", "ring.csv", "map.yaml", "scene:u_turn_trap:3"))]
    for _ in range(int(rng.integers(1, 4))):
        opponent = one_of(rng, _OPPONENTS)
        arguments.append(f"--opponents={as_text(mutated(opponent.encode(), rng)) if rng.random() < 0.5 else opponent}")
    if rng.random() < 0.5:
        arguments.append(f"--opponent-max-speed={one_of(rng, (*NUMBERS, '3', '3'))}")
    if rng.random() < 0.4:
        arguments.append(f"--grid={one_of(rng, ('staggered', 'side_by_side', 'none', ''))}")
    if rng.random() < 0.4:
        arguments.append(f"--rules={one_of(rng, ('none', 'roboracer_2026', 'x', ''))}")
    return command(*race(*arguments, "--json"))


TARGETS = {"f110": Target(attempt=_f110, prepare=ring), "live_session": Target(attempt=_live_session),
           "live_server": Target(attempt=_live_server), "servers": Target(attempt=_servers),
           "ros2": Target(attempt=_ros2_peer, prepare=lambda samples: _ros2()),
           "several_cars": Target(attempt=_several_cars, prepare=ring), "environment": Target(attempt=_environment),
           "live_view": Target(attempt=_live_view)}  # fmt: skip
