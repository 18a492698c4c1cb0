"""Targets that drive on and on: environments of f1tenth_gym, the live view and its server, races of several cars."""

from __future__ import annotations

import atexit
import contextlib
import http.client
import shutil
import socket
import threading
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.random import Generator
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect
from websockets.sync.server import ServerConnection, serve
from websockets.typing import Subprotocol

import fg_mujoco as fg
from fg_mujoco.addons import gym2d as f110
from fg_mujoco.addons.gym2d.new_api import F110Env as NewEnv
from fg_mujoco.addons.look.live.browser import LiveView
from fg_mujoco.addons.look.live.live_session import LiveSession
from fg_mujoco.addons.servers.foxglove_server import FoxgloveServer
from fg_mujoco.addons.servers.rosbridge.server import RosbridgeServer
from fg_mujoco.racing.run_folder import write_run
from fg_mujoco.racing.setup import Setup
from forging import without_checksums

from .course_targets import ring
from .folder_targets import any_json_file, changed_arrays, read
from .mutations import NUMBERS, mutated, mutated_binary, one_of
from .target import SHORT, Attempt, Target, as_text, command, ignore_refusal

VALUES: tuple[Any, ...] = (
    None, True, 0, 1, -1, 3, 10**9, 10**400, 0.5, -0.5, 1e-300, 1e308, float("nan"), float("inf"), "", "a", "\0",
    "a" * 5000, "/dev/zero", "../x", "/", b"a", [], [1], [[]], (0.0, 1.0), {}, {"a": 1}, {1: None}, object(),
    np.zeros(2), np.zeros((2, 3)),
    np.array("a"), np.float32("nan"), np.int64(2), 1j, range(3), int, lambda *_: None, iter(()),
)  # fmt: skip
"""Values of every kind, in the place of any other."""


# -- environments of f1tenth_gym

_OLD = ("map", "map_ext", "params", "num_agents", "timestep", "ego_idx", "seed", "integrator", "model", "lidar_dist",
        "num_beams", "fov", "vehicle", "tires", "maps", "render_mode", "unknown")  # fmt: skip
_NEW = ("map", "map_ext", "scale", "params", "num_agents", "timestep", "ego_idx", "seed", "integrator", "model",
        "lidar_dist", "num_beams", "fov", "control_input", "observation_config", "reset_config", "max_laps",
        "unknown")  # fmt: skip
_PARAMS = ("mu", "C_Sf", "lf", "lr", "h", "m", "I", "s_min", "s_max", "sv_max", "v_switch", "a_max", "v_min", "v_max",
           "width", "length")  # fmt: skip


def _odd_settings(names: tuple[str, ...], rng: Generator) -> dict[str, Any]:
    """Return settings of a small environment on the ring, mostly with one or two that are odd."""
    settings: dict[str, Any] = {"map": one_of(rng, ("map", "ring.csv", "oval")), "num_beams": 60}
    settings["num_agents"] = int(one_of(rng, (1, 1, 2)))
    for _ in range(int(one_of(rng, (0, 1, 1, 2)))):
        settings[one_of(rng, names)] = one_of(rng, VALUES)
    if rng.random() < 0.2:
        settings["params"] = {one_of(rng, _PARAMS): one_of(rng, VALUES)}
    return settings


def _odd_rows(count: int, width: int, rng: Generator) -> Any:
    """Return poses or actions, or something else in their place."""
    if rng.random() < 0.3:
        return one_of(rng, VALUES)
    rows = rng.normal(0.0, 1.0, (count, width))
    if rng.random() < 0.4:
        rows[rng.random(rows.shape) < 0.5] = one_of(rng, (np.nan, np.inf, -np.inf, 1e308, 1e9, -1e9, 5e-324))
    return rows if rng.random() < 0.8 else rows.tolist()


def _f110(samples: Path, here: Path, rng: Generator) -> Attempt:
    for name in ("map.yaml", "map.png", "ring.csv"):
        shutil.copy(samples / name, here)
    old = rng.random() < 0.5
    settings = _odd_settings(_OLD if old else _NEW, rng)

    def drive() -> None:
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


def _live_session(samples: Path, here: Path, rng: Generator) -> Attempt:
    settings: dict[str, Any] = {"controller": one_of(rng, ("gap_finder", "follow_the_gap", "pure_pursuit"))}
    if rng.random() < 0.3:
        names = ("track", "controller", "obstacles", "max_speed", "mu", "seed", "start", "grid", "opponents", "effects")
        settings[one_of(rng, names)] = one_of(rng, VALUES)

    def play() -> None:
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


_REQUEST = (
    b"GET / HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n"
    b"Origin: http://127.0.0.1:{port}\r\nSec-WebSocket-Version: 13\r\n"
    b"Sec-WebSocket-Protocol: viser-v1.1.1\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
)


@cache
def _server() -> int:
    """Start a live view, once for a process, and return its port."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = int(probe.getsockname()[1])
    view = LiveView(LiveSession(), port=port)
    threading.Thread(target=view.run, daemon=True).start()
    atexit.register(view.close)
    return port


def _frame(payload: bytes, rng: Generator, opcodes: tuple[int, ...] = (2, 2, 2, 1, 0, 8, 9, 15)) -> bytes:
    """Return a frame of a WebSocket, as a browser masks it; sometimes one that says of itself what is not so."""
    opcode = int(one_of(rng, opcodes))
    mask = rng.bytes(4)
    masked = bytes(byte ^ mask[i % 4] for i, byte in enumerate(payload))
    length = len(payload) if rng.random() < 0.9 else int(rng.integers(126))
    size = bytes([0x80 | length]) if length < 126 else b"\xfe" + length.to_bytes(2, "big")
    return bytes([0x80 | opcode]) + size + mask + masked


def _live_server(samples: Path, here: Path, rng: Generator) -> Attempt:
    port = _server()
    head = _REQUEST.replace(b"{port}", str(port).encode())
    if rng.random() < 0.6:
        head = mutated(head, rng)
    message = b"\x82\xa4type\xbaGuiUpdateMessage\xa7updates\x81\xa5value\xc3"  # as msgpack has it
    frames = b"".join(
        _frame(mutated_binary(message, rng)[:60_000], rng) for _ in range(int(rng.integers(1, 4)))
    )  # fmt: skip

    def talk() -> int:
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

_CALL = b'{"op": "call_service", "id": "a", "service": "/rosapi/topic_type", "args": {"topic": "/scan"}}'
_TO_ROSBRIDGE = (
    b'{"op": "subscribe", "id": "s", "topic": "/scan", "type": "sensor_msgs/LaserScan", "throttle_rate": 50}',
    b'{"op": "advertise", "topic": "/goal", "type": "geometry_msgs/PointStamped", "latch": true}', _CALL,
    b'{"op": "publish", "topic": "/goal", "msg": {"header": {"stamp": {"secs": 3}}, "point": {"x": 1}}}',
    b'{"op": "publish", "topic": "/drive", "msg": {"drive": {"speed": 1.5, "steering_angle": -0.1}}}',
    b'{"op": "publish", "topic": "/initialpose", "msg": {"pose": {"pose": {"position": {"x": 1.0}}}}}',
    b'{"op": "advertise_service", "service": "/twice", "type": "std_srvs/SetBool"}',
    b'{"op": "call_service", "id": 7, "service": "/twice", "args": {"data": true}}',
)  # fmt: skip
_TO_FOXGLOVE = (
    b'{"op": "advertise", "channels": [{"id": 1, "topic": "/drive", "encoding": "json", "schemaName": ""}]}',
    b'{"op": "setParameters", "parameters": [{"name": "max_speed", "value": 3.5}], "id": "b"}',
    b'{"op": "getParameters", "parameterNames": ["mu"], "id": "a"}',
    b'\x01\x01\0\0\0{"drive": {"speed": 1.5, "steering_angle": -0.1}}',
)  # fmt: skip
_FROM_DEVKIT = (
    b'0{"sid":"a","upgrades":[],"pingInterval":25000,"pingTimeout":20000}', b"40", b"2", b"3",
    b'42["Bridge",{"V1 Throttle":"0.1","V1 Steering":"0.0","Reset":"False"}]',
)  # fmt: skip


@cache
def _racing(kind: str) -> Any:
    """Start a server, once for a process."""
    server: Any = {"rosbridge": RosbridgeServer, "foxglove": FoxgloveServer}[kind](LiveSession(), port=0, log=print)
    threading.Thread(target=server.run, daemon=True).start()
    atexit.register(server.close)
    return server


def _peer(kind: str, texts: tuple[bytes, ...], protocol: str, rng: Generator) -> Attempt:
    """Return an attempt to talk nonsense to a server, which serves others all the same."""
    port = _racing(kind).port
    head = _REQUEST.replace(b"{port}", str(port).encode()).replace(b"viser-v1.1.1", protocol.encode())
    if rng.random() < 0.2:
        head = mutated(head, rng)
    said = [mutated(text, rng)[:60_000] if rng.random() < 0.7 else text for text in rng.permutation(texts).tolist()]
    frames = b"".join(_frame(text, rng, (1, 1, 1, 1, 2, 0, 8, 9, 15)) for text in said)

    def talk() -> int:
        with socket.create_connection(("127.0.0.1", port), timeout=5.0) as peer, contextlib.suppress(OSError):
            peer.settimeout(0.2)
            peer.sendall(head)
            peer.recv(4096)
            peer.sendall(frames)
            peer.recv(4096)
        with connect(f"ws://127.0.0.1:{port}", subprotocols=[Subprotocol(protocol)], proxy=None) as peer:
            if kind == "rosbridge":
                peer.send(_CALL.decode())
            assert peer.recv(timeout=8.0)
        return 0

    return talk


def _servers(samples: Path, here: Path, rng: Generator) -> Attempt:
    kind = one_of(rng, ("rosbridge", "foxglove", "autodrive"))
    if kind == "rosbridge":
        return _peer(kind, _TO_ROSBRIDGE, "rosbridge", rng)
    if kind == "foxglove":
        return _peer(kind, _TO_FOXGLOVE, "foxglove.sdk.v1", rng)
    greeting = [mutated(text, rng) if rng.random() < 0.3 else text for text in _FROM_DEVKIT[:2]]
    answers = [mutated(one_of(rng, _FROM_DEVKIT), rng) if rng.random() < 0.5 else _FROM_DEVKIT[-1] for _ in range(5)]
    as_they_are = rng.random() < 0.1

    def answer(connection: ServerConnection) -> None:
        with contextlib.suppress(ConnectionClosed, OSError):
            for text in (*greeting, *answers):
                if as_they_are:
                    connection.socket.sendall(text)
                else:
                    connection.send(as_text(text).encode("utf-8", errors="replace").decode())
            while connection.recv():
                connection.send(_FROM_DEVKIT[-1].decode())

    def race() -> object:
        with serve(answer, "127.0.0.1", 0) as server:
            threading.Thread(target=server.serve_forever, daemon=True).start()
            address = f"127.0.0.1:{server.socket.getsockname()[1]}"
            try:
                return command("serve", "autodrive", "--devkit", address, "--patience", 0.2, "--time-limit", 0.1)()
            finally:
                server.shutdown()

    return race


# -- several cars

_OPPONENTS = (
    "gap_finder", "follow_the_gap[point=deepest]", "pure_pursuit[line=ring.csv]", "planner.py:Planner", "wall_follow",
)  # fmt: skip


def _several_cars(samples: Path, here: Path, rng: Generator) -> Attempt:
    for name in ("map.yaml", "map.png", "ring.csv"):
        shutil.copy(samples / name, here)
    (here / "planner.py").write_bytes(mutated(_PLANNER, rng) if rng.random() < 0.5 else _PLANNER)
    arguments: list[Any] = ["--track", one_of(rng, ("oval", "oval", "ring.csv", "map.yaml", "scene:u_turn_trap:3"))]
    for _ in range(int(rng.integers(1, 4))):
        opponent = one_of(rng, _OPPONENTS)
        arguments.append(f"--opponents={as_text(mutated(opponent.encode(), rng)) if rng.random() < 0.5 else opponent}")
    if rng.random() < 0.5:
        arguments.append(f"--opponent-max-speed={one_of(rng, (*NUMBERS, '3', '3'))}")
    if rng.random() < 0.4:
        arguments.append(f"--grid={one_of(rng, ('staggered', 'side_by_side', 'none', ''))}")
    if rng.random() < 0.4:
        arguments.append(f"--rules={one_of(rng, ('none', 'roboracer_2026', 'x', ''))}")
    return command("race", *arguments, *SHORT, "--json")


_PLANNER = b"""
import fg_mujoco as fg

class Planner:
    def reset(self):
        pass
    def __call__(self, scan, odometry):
        return fg.DriveCommand(steering_angle=0.05, speed=1.0)
"""


def _race_of_several(samples: Path) -> None:
    entries = [fg.Entry(), fg.Entry(controller="follow_the_gap"), fg.Entry(controller="wall_follow")]
    result = fg.race("oval", entries=entries, laps=1, time_limit=0.2)
    without_checksums(write_run(result, samples / "run"))


def _several_cars_folder(samples: Path, here: Path, rng: Generator) -> Attempt:
    shutil.copytree(samples / "run", here / "run")
    names = ("summary.json", "states.npz", "telemetry_car_1.csv", "telemetry_car_2.csv", "scene.xml")
    name = one_of(rng, ("summary.json", *names))
    path = here / "run" / name
    if name == "summary.json":
        any_json_file(path, rng)
    elif name == "states.npz":
        changed_arrays(path, rng)
    elif rng.random() < 0.05:
        path.unlink()
    else:
        path.write_bytes(mutated(path.read_bytes(), rng))
    return read(here, rng)


TARGETS = {
    "f110": Target(attempt=_f110, prepare=ring),
    "live_session": Target(attempt=_live_session),
    "live_server": Target(attempt=_live_server),
    "servers": Target(attempt=_servers),
    "several_cars": Target(attempt=_several_cars, prepare=ring),
    "several_cars_folder": Target(attempt=_several_cars_folder, prepare=_race_of_several),
}
