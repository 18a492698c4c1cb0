"""Targets of vehicles, settings files, the command line, bags, environments and the live view."""

from __future__ import annotations

import re
import shutil
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.random import Generator

import fg_mujoco as fg
from bag_worlds import SECOND, robot_odometry, robot_scan, write_bag
from fg_mujoco.addons.look.live.handshake import is_own
from fg_mujoco.cli.main import main
from fg_mujoco.envs.gym_environment import F1TenthEnv
from fg_mujoco.pictures.rendering.scenery import compile_scenery

from .folder_targets import run
from .mutations import NUMBERS, WORDS, mutated, mutated_binary, one_of
from .target import SHORT, Attempt, Target, as_text, command, ignore_refusal

# -- vehicles

ELEMENTS = (
    "include", "mesh", "texture", "hfield", "skin", "model", "attach", "replicate", "composite", "flexcomp", "plugin",
    "extension", "option", "size", "compiler", "flag", "default", "body", "joint", "freejoint", "geom", "site",
    "camera", "light", "frame", "inertial", "pair", "exclude", "weld", "connect", "fixed", "spatial", "position",
    "velocity", "general", "muscle", "dcmotor", "rangefinder", "contact", "user", "clock", "tactile", "numeric", "text",
    "tuple", "key", "worldbody", "asset", "sensor", "actuator", "tendon", "custom", "keyframe", "mujoco", "robot",
    "statistic", "visual", "lengthrange", "flex",
)  # fmt: skip
ATTRIBUTES = (
    "file", "fileright", "fileup", "meshdir", "texturedir", "assetdir", "builtin", "count", "name", "class", "type",
    "size", "mass", "damping", "stiffness", "range", "pos", "quat", "euler", "axis", "margin", "gap", "solref",
    "solimp", "friction", "condim", "contype", "conaffinity", "nrow", "ncol", "width", "height", "timestep",
    "iterations", "ls_iterations", "tolerance", "integrator", "solver", "cone", "jacobian", "gravity", "wind",
    "density", "viscosity", "impratio", "memory", "njmax", "nconmax", "nstack", "nuserdata", "nkey", "nuser_body",
    "nsample", "interval", "delay", "num", "dim", "data", "reduce", "kp", "kv", "gear", "ctrlrange", "forcerange",
    "armature", "springref", "springdamper", "coef", "polycoef", "site", "joint", "geom", "body1", "geom1", "mesh",
    "vertex", "face", "material", "texture", "plugin", "mocap", "sleep", "override", "eulerseq", "settotalmass",
    "boundmass", "balanceinertia", "inertiafromgeom", "fusestatic", "discardvisual", "childclass", "gravcomp",
    "actuatorfrcrange", "frictionloss", "fluidshape", "surfacevel", "adhesion", "maxhullvert", "inertia", "qpos",
)  # fmt: skip
HEADS = (
    b"<!DOCTYPE a>", b"<?xml version='1.0' encoding='utf-16'?>", b"<?a b?>", b"\xef\xbb\xbf", b"<!-- -->",
    b"<!DOCTYPE a [<!ENTITY b 'c'>]>",
)  # fmt: skip
_TAG = re.compile(rb"<(?!/|!|\?)[a-z]+[^<>]*>")


def _marked_up(text: bytes, rng: Generator) -> bytes:
    """Return an MJCF text with elements and attributes that it did not have, or in other places."""
    for _ in range(int(one_of(rng, (1, 1, 2)))):
        tags = list(_TAG.finditer(text))
        if not tags:
            return text
        tag = one_of(rng, tags)
        value = one_of(rng, (*NUMBERS[:34], *WORDS, "1 1 1", "0 0 0", "/etc/passwd", "a.png"))
        value = value.replace("&", "").replace("<", "").replace('"', "")
        attribute = f' {one_of(rng, ATTRIBUTES)}="{value}"'.encode("utf-8", "surrogatepass")
        change = int(rng.integers(6))
        if change < 2:  # one more attribute
            place = tag.end() - (2 if tag[0].endswith(b"/>") else 1)
            text = text[:place] + attribute + text[place:]
        elif change == 2:  # one more element
            text = text[: tag.start()] + f"<{one_of(rng, ELEMENTS)}".encode() + attribute + b"/>" + text[tag.start() :]
        elif change == 3:  # the same many times
            copy = tag[0] if tag[0].endswith(b"/>") else b""
            text = text[: tag.start()] + copy * int(one_of(rng, (1, 10, 3000))) + text[tag.start() :]
        elif change == 4:  # elsewhere
            other = one_of(rng, tags)
            text = text[: other.start()] + (tag[0] if tag[0].endswith(b"/>") else b"") + text[other.start() :]
        else:  # before everything
            text = one_of(rng, HEADS) + text
    return text


def _hostile_mjcf(text: bytes, rng: Generator) -> bytes:
    return _marked_up(text, rng) if rng.random() < 0.6 else mutated(text, rng)


def _vehicle(samples: Path, here: Path, rng: Generator) -> Attempt:
    text = files("fg_mujoco.models").joinpath(one_of(rng, ("f1tenth.xml", "nuc2.xml"))).read_bytes()
    (here / "car.xml").write_bytes(_hostile_mjcf(text, rng))
    return command(*one_of(rng, (("vehicles", "car.xml"), ("race", "--vehicle", "car.xml", *SHORT))))


def _vehicle_files(samples: Path, here: Path, rng: Generator) -> Attempt:
    """A vehicle whose LiDAR, look, mesh or tires are changed, or named by another path."""
    models = files("fg_mujoco.models")
    contents = {
        "car.xml": models.joinpath("f1tenth.xml").read_bytes()
        .replace(b'"hokuyo_ust10lx.xml"', b'"eye.xml"')
        .replace(b'"f1tenth_look.xml"', b'"look.xml"')
        .replace(b"</custom>", b'<text name="tires" data="tires.toml"/></custom>'),
        "eye.xml": models.joinpath("hokuyo_ust10lx.xml").read_bytes(),
        "look.xml": models.joinpath("f1tenth_look.xml").read_bytes(),
        "tires.toml": models.joinpath("tires", "forzaeth_nuc2.toml").read_bytes(),
        "assets/tub.obj": models.joinpath("assets", "tub.obj").read_bytes(),
    }  # fmt: skip
    for name in ("eye.xml", "look.xml", "tires.toml"):
        if rng.random() < 0.1:
            paths = ("../car.xml", "/etc/passwd", "/dev/zero", "assets", "", "none", f"./{name}", f"~/{name}")
            path = one_of(rng, paths)
            contents["car.xml"] = contents["car.xml"].replace(f'"{name}"'.encode(), f'"{path}"'.encode())
    changed = one_of(rng, ("eye.xml", "look.xml", "look.xml", "tires.toml", "assets/tub.obj"))
    change = _hostile_mjcf if changed.endswith(".xml") else mutated
    contents[changed] = change(contents[changed], rng)
    shutil.copytree(str(models.joinpath("assets")), here / "assets")
    for name, content in contents.items():
        (here / name).write_bytes(content)

    def draw() -> None:
        world = fg.World("oval", str(here / "car.xml"))
        compile_scenery(world.xml)

    return ignore_refusal(draw)


SETTINGS = """track = "oval"
controller = "gap_finder[lookahead=6]"
laps = 2
mu = 0.8
planner-mu = "off"
max-speed = 3.5
lidar-noise = 0.01
motion-distortion = true
obstacles = 2
seed = 3
"""
SETTINGS_OF_SEVERAL = """track = "oval"
laps = 2
obstacles = [{kind = "box", x = 8.0, y = 0.3, length = 0.3, width = 0.3}]
patches = [{x = 1.0, y = 0.0, length = 3.0, width = 1.0, mu = 0.4}]
grid = "side_by_side"

[[entries]]
controller = "gap_finder"
planner_settings = {lookahead = 6}
effects = {range_noise_std = 0.01, motion_distortion = true}

[[entries]]
controller = "wall_follow"
mu = 0.8
planner_mu = "off"
start = {s = 3.0, offset = 0.1}
changes = {mass = 4.0}
"""


def _settings_file(samples: Path, here: Path, rng: Generator) -> Attempt:
    (here / "race.toml").write_bytes(mutated(one_of(rng, (SETTINGS, SETTINGS_OF_SEVERAL)).encode(), rng))
    return command("race", "--config", "race.toml", *SHORT)


def _command_line(samples: Path, here: Path, rng: Generator) -> Attempt:
    shutil.copytree(samples / "run", here / "run")
    name = one_of(rng, list(COMMANDS))
    arguments = [name, *COMMANDS[name]]
    options = OPTIONS[name]
    for _ in range(int(rng.integers(1, 4))):
        option = one_of(rng, options)
        value = one_of(rng, (*NUMBERS, *WORDS))
        arguments += (
            [option] if rng.random() < 0.1 else [f"{option}={value}"] if rng.random() < 0.8 else [option, value]
        )
    if rng.random() < 0.2:
        arguments[int(rng.integers(len(arguments)))] = one_of(rng, WORDS)
    return command(*arguments)


COMMANDS = {
    "race": SHORT,
    "replay": ("run",),
    "vehicles": (),
    "controllers": (),
    "rollout": ("--n", "2", "--time-limit", "0.05", "--workers", "1"),
    "export": ("run",),
    "replay-scans": ("run",),
    "report": ("run", "--no-clip"),
    "track": ("list",),
}
OPTIONS = {
    "race": (
        "--track", "--controller", "--laps", "--obstacles", "--obstacle-seed", "--vehicle", "--mu", "--planner-mu",
        "--max-speed",
        "--lidar", "--lidar-noise", "--lidar-dropout", "--lidar-latency", "--odometry-drift", "--seed", "--config",
        "--decision-limit",
    ),
    "replay": ("--json", "--trust", "--x"),
    "vehicles": ("--json", "--x"),
    "controllers": ("--json", "--x"),
    "rollout": ("--track", "--controller", "--seed", "--randomize", "--vehicle", "--mu", "--max-speed", "--record",
    "--executor", "--chunk"),
    "export": ("--format", "--out"),
    "replay-scans": ("--controller", "--out", "--scan-topic", "--vehicle", "--planner-mu", "--track"),
    "report": ("--out", "--clip", "--x"),
    "track": ("--json", "--x"),
}  # fmt: skip


# -- bags


def _bags(samples: Path) -> None:
    entries = []
    for i in range(5):
        time = SECOND + i * SECOND // 10
        entries.append(("/scan", time, robot_scan([1.0 + 0.1 * i] * 41, time=time)))
        entries.append(("/odom", time + 1, robot_odometry(time, x=0.1 * i, speed=1.0)))
    for storage in ("MCAP", "SQLITE3"):
        write_bag(samples / storage.lower(), entries, storage=storage)
    main(["bag", str(samples / "mcap"), "--map", str(samples / "map.yaml")])  # compiles what draws maps


def _bag(samples: Path, here: Path, rng: Generator) -> Attempt:
    name = one_of(rng, ("mcap", "sqlite3"))
    shutil.copytree(samples / name, here / "bag")
    path = one_of(rng, sorted((here / "bag").iterdir()))
    content = path.read_bytes()
    path.write_bytes(mutated(content, rng) if path.suffix == ".yaml" else mutated_binary(content, rng))
    return _read_bag("bag" if rng.random() < 0.7 else path, rng)


def _read_bag(bag: object, rng: Generator) -> Attempt:
    """Return a command that reads a bag: a planner over it, what it holds, a map of it, or a run folder."""
    way = rng.random()
    if way < 0.5:
        return command("replay-scans", bag, "--out", "commands.csv")
    if way < 0.7:
        return command("bag", bag)
    make_map = command("bag", bag, "--map", "map.yaml")
    return lambda: make_map() and 1  # a refusal stands behind the table of the topics, and maybe the map


def _messages(samples: Path, here: Path, rng: Generator) -> Attempt:
    odd = (0.0, -1.0, np.nan, np.inf, -np.inf, 1e30, 1e-30, 0.1, 6.3)
    entries = []
    for i in range(4):
        usual = SECOND * (i + 1)
        time = usual if rng.random() < 0.8 else int(one_of(rng, (0, i, SECOND - i, 2**31 * SECOND - 1)))
        ranges = rng.uniform(0.0, 5.0, int(41 if rng.random() < 0.9 else one_of(rng, (0, 1, 2, 40, 1081))))
        ranges[rng.random(len(ranges)) < 0.3] = one_of(rng, odd)
        names = ("angle_min", "angle_max", "angle_increment", "time_increment", "scan_time", "range_min", "range_max")
        values = {name: float(one_of(rng, odd)) for name in names if rng.random() < 0.02}
        entries.append(("/scan", usual, robot_scan(ranges, time=time, **values)))
        pose = {name: float(one_of(rng, odd)) for name in ("x", "y", "yaw", "speed") if rng.random() < 0.1}
        if not np.isfinite(pose.get("yaw", 0.0)):
            del pose["yaw"]
        entries.append(("/odom", usual + 1, robot_odometry(time, **pose)))
    write_bag(here / "bag", entries)
    return _read_bag("bag", rng)


# -- drives


def drives(samples: Path) -> None:
    time = np.arange(0.0, 7.0, 0.02)
    speed, steering = 2.5 + np.sin(time), 0.3 * np.sin(2.0 * time)
    yaw_rate = speed * np.tan(steering) / 0.33
    yaw = np.cumsum(yaw_rate) * 0.02
    places = [np.cumsum(speed * turn) * 0.02 for turn in (np.cos(yaw), np.sin(yaw))]
    columns = {"t": time, "v": speed, "r": yaw_rate, "d": steering, "x": places[0], "y": places[1], "yaw": yaw}
    columns |= {f"beam_{number}": np.full(len(time), 3.0) for number in (300, 540, 780)}
    rows = [",".join(f"{value:.5g}" for value in row) for row in zip(*columns.values(), strict=True)]
    (samples / "drive.csv").write_text("# by hand, 50 Hz\n" + "\n".join([",".join(columns), *rows]) + "\n")
    names = {"time": "t", "speed": "v", "yaw_rate": "r", "steering": "d", "x": "x", "y": "y"}
    (samples / "columns.toml").write_text(
        "".join(f'{name} = "{column}"\n' for name, column in names.items())
        + 'yaw = {column = "yaw", unit = "rad", scale = 1.0, offset = 0.0, delay = 0.0}\npose_ahead = 0.0\n'
        + 'beams = {columns = "beam_{}", count = 1081, field_of_view = 270.0, nothing = 65.0, unit = "m"}\n'
    )


def _drive(samples: Path, here: Path, rng: Generator) -> Attempt:
    changed = one_of(rng, ("drive.csv", "drive.csv", "columns.toml"))
    for name in ("drive.csv", "columns.toml"):
        content = (samples / name).read_bytes()
        (here / name).write_bytes(mutated(content, rng) if name == changed else content)
    ways: tuple[tuple[str, ...], ...] = (
        ("bag",), ("bag",), ("validate",), ("validate", "--mu", "0.7"), ("replay-scans", "--out", "commands.csv"),
        ("identify", "--out", "tires.toml", "--budget", "1"),
    )  # fmt: skip
    name, *options = one_of(rng, ways)
    return command(name, "drive.csv", "--columns", "columns.toml", *options)


# -- Python's targets


def _environment(samples: Path, here: Path, rng: Generator) -> Attempt:
    values: tuple[Any, ...] = (
        None, 0, 1, [], [0.0, 1.0], [np.nan, 1.0], [1e308, -1e308], [np.inf, 0], "ab", b"", {}, [[0.0, 1.0]],
        [1j, 0], np.zeros(2),
        np.zeros(3), object(), ["a", "b"], [None, None], np.array([0.1, 2.0], np.float32), True, 10**400,
        (0, 10**400), slice(0, 2),
    )  # fmt: skip
    keys = (
        "track",
        "mu",
        "max_steps",
        "vehicle",
        "reward",
        "action",
        "controller",
        "seed",
        "max_speed",
        "start",
        "time_limit",
    )
    settings = {one_of(rng, keys): one_of(rng, values)} if rng.random() < 0.4 else {}

    def steps() -> None:
        env = F1TenthEnv(**settings)
        try:
            env.reset(seed=int(rng.integers(100)))
            for _ in range(3):
                env.step(one_of(rng, values))  # type: ignore[arg-type]
        finally:
            env.close()

    return ignore_refusal(steps)


def _live_view(samples: Path, here: Path, rng: Generator) -> Attempt:
    own = ("localhost:8080", "127.0.0.1:8080", "[::1]:8080")
    host = one_of(rng, own)
    hosts = [as_text(mutated(one_of(rng, own).encode(), rng)) for _ in range(int(rng.integers(0, 3)))]
    origins = [as_text(mutated(f"http://{host}".encode(), rng)) for _ in range(int(rng.integers(0, 3)))]

    def check() -> int:
        if is_own(hosts, origins, frozenset({"0.0.0.0", "robot"})) and origins:
            assert (len(hosts) == 1 and origins == [f"http://{hosts[0]}"]) or origins[
                0
            ].lower() == f"http://{hosts[0].lower()}"
        assert not is_own([host], ["http://evil.example"], frozenset())
        assert is_own([host], [f"http://{host}"], frozenset())
        return 0

    return check


TARGETS = {
    "vehicle": Target(attempt=_vehicle),
    "vehicle_files": Target(attempt=_vehicle_files),
    "settings_file": Target(attempt=_settings_file),
    "command_line": Target(attempt=_command_line, prepare=run),
    "bag": Target(attempt=_bag, prepare=_bags),
    "bag_messages": Target(attempt=_messages, prepare=_bags),
    "drive": Target(attempt=_drive, prepare=drives),
    "environment": Target(attempt=_environment),
    "live_view": Target(attempt=_live_view),
}
