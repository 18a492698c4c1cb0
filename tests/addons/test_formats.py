"""Every format that is read: a file that is right, with changes in it, is used or refused in a line.

Changes are what programs, disks, editors and people make. Never is there another exception than those of this package,
a hang, memory without bound, or, where something is refused, more than a line or anything written. Hypothesis draws the
same changes in every run, and others in `make fuzz`.
"""

import atexit
import contextlib
import faulthandler
import functools
import json
import os
import re
import resource
import shutil
import signal
import sys
from dataclasses import dataclass, fields
from importlib.resources import files
from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

import fg_mujoco as fg
from bag_worlds import SECOND, robot_odometry, robot_scan, write_bag
from cases import each
from comparison_worlds import recorded_here
from fg_mujoco.addons import gym2d as f110
from fg_mujoco.addons.learn.policy_files import save_policy
from fg_mujoco.addons.learn.training_settings import TrainingSettings
from fg_mujoco.addons.look.debug.decisions import Witness
from fg_mujoco.addons.look.live.live_session import LiveSession
from fg_mujoco.addons.ros.bag_messages import drive_message, to_cdr
from fg_mujoco.addons.ros.node_host.graph import Graph, NodeBlockedError
from fg_mujoco.addons.ros.node_host.launch_files import launched
from fg_mujoco.addons.ros.node_host.program import read_program
from fg_mujoco.addons.servers.foxglove_server import ACCEPTED, FoxgloveServer
from fg_mujoco.addons.servers.ros2.server import Ros2Server, _taken
from fg_mujoco.cli.main import main
from fg_mujoco.course.documents import read_toml, toml_text
from fg_mujoco.envs.environment_settings import EnvironmentSettings
from fg_mujoco.envs.gym_environment import F1TenthEnv
from fg_mujoco.pictures.rendering.scenery import compile_scenery
from fg_mujoco.racing.run_folder import write_run
from fg_mujoco.simulation.settings import known_settings
from forging import without_checksums
from refusals import contents
from small_policies import FLAT, PARTS, interface_of, network_for

LONGEST, MOST = 10, 1_500_000_000
"""[s] of processor time, of which the clock may show six times as much, and [bytes] of the use of one file."""
MODELS = files("fg_mujoco.models")

# -- changes


NUMBERS = ("0", "-1", "0.5", "1e-300", "5e-324", "1e5", "1e9", "1e12", "1e308", "1e309", "nan", "-inf", "NaN",
           "2147483648", "9223372036854775808", "9" * 400, "1" + "0" * 5000, "0x10", "1_000", "١٢", "1,5", "1e", "--1",
           "", " ", "true", "null")  # fmt: skip
WORDS = ("", " ", "\0", "\x1b[2J", "\ud7ff", "é", "‮", "a" * 300, "a" * 5000, "../../etc/passwd", "/dev/zero",
         "/dev/stdin", "~", "%s%n", "{}", "{0.__class__}", "$(id)", "<script>a</script>", "'\"", "\\", "#", "--",
         "=", ":", "[", "]", "[[", "a=b", "\n", "\r\n", "\t", "None", "__init__", ";", "[a=1]", "[a=]")  # fmt: skip
EXTREMES = (b"\0" * 8, b"\xff" * 4, b"\xff" * 8, b"\xff\xff\xff\x7f", b"\0\0\0\0\0\0\xf0\x7f", b"\1")
NUMBER = re.compile(rb"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
BINARY = {".png", ".pgm", ".mcap", ".db3", ".npy", ".npz", ".onnx"}


def bytes_changed(content, rng):
    """Return bytes with a part of them cut out, repeated, or in the place of another."""
    start = rng.randint(0, len(content))
    end = min(len(content), start + rng.choice((0, 1, rng.randint(0, 64), len(content))))
    part = content[start:end]
    repeated = part * min(rng.choice((2, 100, 10_000)), 10**6 // max(1, len(part)) + 1)
    put = rng.choice((b"", repeated, rng.randbytes(min(len(part), 64)), *EXTREMES))
    return content[:start] + put[: 10**6] + content[end:]


def text_changed(content, rng, words=WORDS):
    """Return a text with another number, another word, or lines in another order."""
    change = rng.randint(0, 4)
    lines = content.splitlines(keepends=True)
    if change < 2 and (found := list(NUMBER.finditer(content))):
        number = rng.choice(found)
        nudged = f"{float(number[0]) * rng.uniform(0.5, 2.0):.6g}" if len(number[0]) < 30 else "1"
        return content[: number.start()] + rng.choice((nudged, *NUMBERS)).encode() + content[number.end() :]
    if change == 2 and len(lines) > 1:
        first, last = sorted((rng.randrange(len(lines)), rng.randrange(len(lines))))
        part = lines[first : last + 1]
        return b"".join((*lines[:first], *rng.choice(([], part * 2, part[::-1], part[:1] * 1000)), *lines[last + 1 :]))
    start = rng.randint(0, len(content))
    word = rng.choice(words).encode(errors="surrogatepass")
    return content[:start] + word + content[start + rng.choice((0, 0, rng.randint(0, 16))) :]


def mutated(content, rng, words=WORDS, *, binary=False):
    """Return a file with one change to three."""
    for _ in range(rng.choice((1, 1, 2, 3))):
        as_bytes = binary or rng.random() < 0.3
        content = bytes_changed(content, rng) if as_bytes else text_changed(content, rng, words)
    return content


def value_changed(value, rng):
    """Return a value of a document with one of its leaves or branches in another place, of another kind, or lost."""
    if isinstance(value, dict) and value and rng.random() < 0.85:
        key = rng.choice(list(value))
        if rng.random() < 0.15:
            return {name: each for name, each in value.items() if name != key}
        return {**value, key: value_changed(value[key], rng)}
    if isinstance(value, list) and value and rng.random() < 0.7:
        place = rng.randrange(len(value))
        return [*value[:place], value_changed(value[place], rng), *value[place + 1 :]]
    deep = 1
    for _ in range(200):
        deep = [deep]
    others = (True, 0, -1, 1e308, float("inf"), 10**12, 2**63, 10**400, "", *WORDS[:12], [], {}, [1], [[1]], deep,
              {"a": 1}, [[]] * 9999, 0.5)  # fmt: skip
    return rng.choice(others)


def arrays_changed(path, rng):
    """Change one of the arrays of a file."""
    with np.load(path) as file:
        arrays = dict(file)
    name = rng.choice(list(arrays))
    array = np.atleast_1d(arrays[name])
    first, second = (array.flat[rng.randrange(max(1, array.size))] for _ in range(2))
    arrays[name] = rng.choice((
        lambda: array[:-1], lambda: array[:0], lambda: array.T, lambda: array.reshape(-1), lambda: np.zeros(()),
        lambda: array.astype(str), lambda: array.astype(np.complex64), lambda: array.astype(np.float16),
        lambda: np.where(array == first, np.nan, array), lambda: np.where(array == first, 1e300, array),
        lambda: np.where(array == first, second, array), lambda: array[::-1], lambda: np.zeros((0, *array.shape)),
        lambda: np.tile(array, (2,) * max(1, array.ndim)), lambda: np.zeros(3_000_000),
    ))()  # fmt: skip
    if rng.random() < 0.2:
        del arrays[name]
    np.savez_compressed(path, **arrays)


SCHEMA = re.findall(r"^\s*(?:(\w+) \(.\))?(.*)$", mujoco.mj_printSchema(False, False), re.MULTILINE)
ELEMENTS = ("include", "attach", "robot", *sorted({element for element, _ in SCHEMA if element}))
ATTRIBUTES = ("file", *sorted({word for _, words in SCHEMA for word in words.split() if word.isidentifier()}))


def mjcf_changed(text, rng):
    """Return an MJCF text with an element or an attribute that it did not have, or with one in another place."""
    tags = list(re.finditer(rb"<(?!/|!|\?)[a-z]+[^<>]*>", text))
    tag = rng.choice(tags)
    alone = tag[0] if tag[0].endswith(b"/>") else b""
    value = re.sub('[&<"\0\x1b]', "", rng.choice((*NUMBERS, *WORDS, "1 1 1", "0 0 0", "a.png")))
    attribute = f' {rng.choice(ATTRIBUTES)}="{value}"'.encode("utf-8", "surrogatepass")
    heads = (b"<!DOCTYPE a>", b"<?xml version='1.0' encoding='utf-16'?>", b"<?a b?>", b"\xef\xbb\xbf",
             b"<!DOCTYPE a [<!ENTITY b 'c'>]>")  # fmt: skip
    at, put = rng.choice((
        (tag.end() - (2 if alone else 1), attribute), (tag.end() - (2 if alone else 1), attribute),
        (tag.start(), f"<{rng.choice(ELEMENTS)}".encode() + attribute + b"/>"),
        (tag.start(), alone * rng.choice((1, 10, 3000))), (rng.choice(tags).start(), alone), (0, rng.choice(heads)),
    ))  # fmt: skip
    return text[:at] + put + text[at:]


def change(path, rng, words=WORDS):
    """Change a file as its ending says: its text or bytes, or what is in it."""
    content, inside = path.read_bytes(), rng.random() < 0.65
    if inside and path.suffix == ".json":
        path.write_text(json.dumps(value_changed(json.loads(content), rng)))
    elif inside and path.suffix == ".toml" and path.name != "race.toml":
        changed = value_changed(dict(read_toml(str(path)).values), rng)
        path.write_bytes(toml_text(changed if isinstance(changed, dict) else {}).encode(errors="surrogateescape"))
    elif inside and path.suffix == ".npz":
        arrays_changed(path, rng)
    elif inside and path.suffix == ".xml" and b"<mujoco" in content:
        path.write_bytes(mjcf_changed(content, rng))
    elif path.suffix == ".onnx":
        import onnx

        model = onnx.load(path)
        kept = json.loads(model.metadata_props[0].value)
        kept["interface"] = value_changed(kept["interface"], rng)
        model.metadata_props[0].value = json.dumps(kept)
        onnx.save(model, path)
    else:
        path.write_bytes(mutated(content, rng, words, binary=path.suffix in BINARY))


# -- the judge


@contextlib.contextmanager
def limits(seconds=LONGEST, memory=MOST):
    """Raise where more time goes by or more memory is taken; who hangs in C is ended, with its traceback."""

    passed = []

    def late(*_):
        passed.append(seconds)
        raise AssertionError(f"more than {seconds:g} s")

    before, now = resource.getrlimit(resource.RLIMIT_AS), Path("/proc/self/statm").read_text().split()[0]
    resource.setrlimit(resource.RLIMIT_AS, (int(now) * resource.getpagesize() + memory, before[1]))
    handlers = {one: signal.signal(one, late) for one in (signal.SIGPROF, signal.SIGALRM)}
    signal.setitimer(signal.ITIMER_PROF, seconds)
    signal.setitimer(signal.ITIMER_REAL, 6.0 * seconds)
    faulthandler.dump_traceback_later(12.0 * seconds, exit=True)
    try:
        yield
    finally:
        faulthandler.cancel_dump_traceback_later()
        for timer in (signal.ITIMER_PROF, signal.ITIMER_REAL):
            signal.setitimer(timer, 0.0)
        for one, handler in handlers.items():
            signal.signal(one, handler)
        resource.setrlimit(resource.RLIMIT_AS, before)
    assert not passed, "a limit passed, and what it raised was kept"


def judge(use, here, capfd, **most):
    """Use a file: a call of Python's that may raise errors of this package, or the arguments of a command."""
    before = contents(here)
    capfd.readouterr()
    with limits(**most):
        try:
            code = main([*map(str, use)]) if isinstance(use, tuple) else (use(), 0)[1]
        except SystemExit as end:
            code = end.code
        except fg.FgMujocoError:
            assert not isinstance(use, tuple)
            code = 0
    out, err = capfd.readouterr()
    assert code in (0, 1, 2) and "Traceback (most" not in out + err, (code, (out + err)[-300:])
    if code == 2:
        lines = [line for line in err.splitlines() if not line.startswith("fg-mujoco: warning")]
        assert len(lines) == 1 and lines[0].startswith("fg-mujoco") and out == "" and len(err) < 5000, out + err
        assert contents(here) == before, err


# -- courses


def race(*words):
    return ("race", *words, "--time-limit", "0.03")


def ring(place):
    """Write a round map as PNG and PGM, their YAML, its centreline in the forms that teams have, and a planner."""
    from PIL import Image

    y, x = np.mgrid[:90, :90] - 44.5
    picture = Image.fromarray(np.where(np.abs(np.hypot(x, y) - 30.0) < 9.0, 254, 0).astype(np.uint8))
    for name, image in (("map", "map.png"), ("gray", "gray.pgm")):
        picture.save(place / image)
        more = "resolution: 0.1\norigin: [-4.5, -4.5, 0.0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
        (place / f"{name}.yaml").write_text(f"image: {image}\n{more}")
    angle = np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False)
    points = np.column_stack([3.0 * np.cos(angle), 3.0 * np.sin(angle), np.full(60, 0.9), np.full(60, 0.9)])
    names = ("x_m", "y_m", "w_tr_right_m", "w_tr_left_m")
    np.savetxt(place / "ring.csv", points, "%.4f", ",", header=", ".join(names))
    np.savetxt(place / "semicolons.csv", 100.0 * points[:, [2, 0, 1]], "%.2f", "; ", header="width [cm]; x_cm; y_cm")
    rows = [dict(zip(names, row, strict=True)) for row in points.tolist()]
    (place / "rows.json").write_text(json.dumps({"centreline": {"wpnts": rows}, "other": rows}))
    (place / "columns.json").write_text(json.dumps(dict(zip(names, points.T.tolist(), strict=True))))
    np.save(place / "line.npy", points)
    (place / "track.yaml").write_text("centreline: ring.csv\nclosed: true\nsurface: wood\n")
    (place / "planner.py").write_bytes(PLANNER)


HEADS = ("x_m", "y_m", "x_ref", "center_x_m", "X [m]", "y_cm", "w_right [cm]", "d_right", "width", "vx_mps",
         "speed [km/h]", "psi_rad", "theta", "s_m", "qx")  # fmt: skip

PLANNER = b"""
import fg_mujoco as fg

class Planner:
    name, stage = "a", 1
    def __init__(self, gain: float = 1.0):
        self.gain = gain
    def reset(self):
        pass
    def __call__(self, scan, odometry):
        return fg.DriveCommand(steering_angle=0.05 * self.gain, speed=1.0)
"""
ANSWERS = ("None", "(0.0, 1.0)", "float('nan')", "10**400", "scan", "scan.ranges * 1j", "lambda *a: None", "1/0", "car",
           "*", "exec('raise GeneratorExit')", "__import__('sys').exit(0)", "next(iter(()))", "x=[]")  # fmt: skip
NAMES = (
    "--track=oval", "--track=random:3", "--track=random:3:tight", "--track=scene:u_turn_trap:3", "--track=maze",
    "--track=ring.csv[width=2]", "--track=map.yaml[close=.3,loop=1]", "--controller=gap_finder[lookahead=6]",
    "--controller=follow_the_gap[point=deepest,assist=limiter]", "--controller=pure_pursuit[line=ring.csv]",
    "--controller=disparity_extender[assist=safe]", "--controller=planner.py:Planner[gain=.5]",
    "--opponents=pure_pursuit[line=ring.csv]", "--opponents=planner.py:Planner", "--grid=side_by_side", "--mu=0.8",
    "--laps=2", "--obstacles=2", "--seed=3", "--vehicle=nuc2", "--planner-mu=off", "--max-speed=3", "--rules=none",
    "--lidar-noise=0.1", "--lidar-dropout=0.1", "--lidar-latency=0.1", "--odometry-drift=0.1", "--decision-limit=1",
    "--pose=rate=10,drift=0.1", "--sensors=imu", "--floor=ipz8", "--assist=full", "--moving=box:1",
)  # fmt: skip


def names(place, rng):
    """Options of a race, some of which are changed."""
    chosen = rng.sample(NAMES, rng.choice((1, 1, 2)))
    chosen = [mutated(name.encode(), rng).decode(errors="surrogateescape") for name in chosen]
    return race(*(name for name in chosen if name.startswith("--")), "--json")


# -- folders

READERS = (("replay", "run"), ("export", "run", "--out", "run.mcap"), race("--config", "run"),
           ("report", "run", "--no-clip"))  # fmt: skip
ROLLOUT = ("rollout", "--n", "3", "--time-limit", "0.05", "--chunk", "1", "--workers", "1", "--record", "states")
COMPARE = ("compare", "--controller", "gap_finder", "--track", "oval", "--seed", "0:1", "--laps", "1", "--time-limit",
           "0.05", "--workers", "1", "--out", "study")  # fmt: skip


def run(place):
    """Write a run whose files have no checksums: what is read is checked for itself."""
    without_checksums(write_run(fg.race("oval", laps=1, time_limit=0.2), place / "run"))


def run_of_several(place):
    entries = [fg.Entry(), fg.Entry(controller="follow_the_gap"), fg.Entry(controller="wall_follow")]
    without_checksums(write_run(fg.race("oval", entries=entries, laps=1, time_limit=0.2), place / "run"))


# -- vehicles

_PARTS = {"eye.xml": "hokuyo_ust10lx.xml", "look.xml": "f1tenth_look.xml", "tires.toml": "tires/forzaeth_nuc2.toml"}


def vehicles(place):
    """Write two vehicles, one with a LiDAR, a look, a mesh and tires of its own; and parameters as others have them."""
    shutil.copytree(str(MODELS.joinpath("assets")), place / "assets")
    (place / "nuc.xml").write_bytes(MODELS.joinpath("nuc2.xml").read_bytes())
    car = MODELS.joinpath("f1tenth.xml").read_text("utf-8")
    car = car.replace("</custom>", '<text name="tires" data="tires.toml"/></custom>')
    for name, source in _PARTS.items():
        (place / name).write_bytes(MODELS.joinpath(source).read_bytes())
        car = car.replace(f'"{source}"', f'"{name}"')
    (place / "car.xml").write_text(car, "utf-8")


_CARS = {
    "gym.yaml": {"mu": 0.8, "C_Sf": 4.9, "C_Sr": 5.2, "lf": 0.16, "lr": 0.17, "m": 3.6, "I": 0.05, "s_max": 0.41},
    "vesc.yaml": {"speed_to_erpm_gain": 4614.0, "steering_angle_to_servo_gain": -1.2, "servo_min": 0.15,
                  "steering_angle_to_servo_offset": 0.53, "servo_max": 0.85, "speed_max": 23250, "wheelbase": 0.32},
    "forza.json": {"C_Pf": [4.8, 2.16, 0.65, 0.37], "C_Pr": [20.0, 1.5, 0.62, 0.0], "l_f": 0.162, "m": 3.54},
    "slipx.yaml": {"nominal_load": 8.6, "linear": {"c_alpha": 60}, "mu_y0": 1.1, "mf_lite": {"C": 1.68}, "m": 3},
}  # fmt: skip
_WHEEL = (
    '<link name="{0}{1}"/><joint type="continuous"><parent link="a"/><child link="{0}{1}"/><origin xyz="{0} {1} 0"/>'
    "</joint>"
)
_URDF = (
    '<robot><link name="a"><inertial><mass value="3"/><origin xyz="0.15 0 0"/><inertia izz="0.04"/></inertial></link>'
    + "".join(_WHEEL.format(x, y) for x in (0, 0.32) for y in (-0.1, 0.1)) + "</robot>"
)  # fmt: skip


def cars(place):
    for name, values in _CARS.items():
        (place / name).write_text(json.dumps(values, indent=1))
    (place / "car.urdf").write_text(_URDF)


# -- settings, suites, labs, trainings, policies

SETTINGS = """track = "oval"
laps = 2
seed = 3
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
max_speed = 3.5
start = {s = 3.0, offset = 0.1}
changes = {mass = 4.0}
"""
DOCUMENTS = {
    "training": {"steps": 128, "worlds": 2, "seed": 0, "checkpoints": 1,
                 "environment": {"track": "oval", "observation": "beams:5,speed,normalised,flat", "privileged": "mu",
                                 "time_limit": 1.0, "laps": 1, "opponents": ["gap_finder"], "speed_range": [0.5, 8.0],
                                 "builds": 1, "randomize": {"mu": "0.5:1.1"}, "rewards": {"preset": "race"}},
                 "ppo": {"net": [4], "n_steps": 32, "minibatches": 2, "n_epochs": 1}},
    "lab": {"name": "a lab", "track": "oval", "laps": 1, "time_limit": 0.05, "passing": 10, "obstacles": 1,
            "checks": [{"check": "finishes", "points": 10},
                       {"check": "no_crash", "points": 5.5, "least_progress_m": 0.1, "mu": 0.9},
                       {"check": "follows_wall", "side": "left", "distance_m": 1.0, "within_m": 0.2, "name": "wall"}]},
    "suite": {"time_limit": 0.1, "name": "duels", "version": 1, "assists": ["none"],
              "groups": [{"name": "a", "track": ["oval"], "starts": 1, "opponent": ["right"], "speed": [0.5],
                          "headway": 3.0, "offset": 0.0},
                         {"name": "b", "track": "hairpins", "starts": [1.0], "opponent": "left", "speed": 0.8}]},
    "columns": {"time": {"column": "t", "unit": "s", "scale": "measured"}, "speed": {"column": "v", "scale": 1.01},
                "yaw_rate": {"column": "r", "unit": "rad/s", "delay": 0.02}, "steering": "d", "x": "x", "y": "y",
                "steering_is": "command", "yaw": {"column": "yaw", "unit": "rad"}, "pose_ahead": 0.0,
                "beams": {"columns": "beam_{}", "count": 1081, "field_of_view": 270.0, "nothing": 65.5}},
}  # fmt: skip


def document(name):
    """Return what writes a document, as TOML."""
    return lambda place: (place / f"{name}.toml").write_text(toml_text(DOCUMENTS[name]))


def read_training(path):
    return TrainingSettings(**known_settings(read_toml(path.name).values, TrainingSettings, "a training"))


def policies(place):
    residual = PARTS | {"observation": "speed,beams:54,planner_command", "residual": {"planner": "gap_finder"}}
    for name, told in {"flat": FLAT, "parts": PARTS, "residual": residual}.items():
        interface = interface_of(**told)
        save_policy(network_for(interface), place / f"{name}.onnx", interface, trained={"steps": 3})


# -- bags, drives and messages


def bags(place):
    entries = []
    for i in range(5):
        time = SECOND + i * SECOND // 10
        entries.append(("/scan", time, robot_scan([1.0 + 0.1 * i] * 41, time=time)))
        entries.append(("/odom", time + 1, robot_odometry(time, x=0.1 * i, speed=1.0)))
    for storage in ("MCAP", "SQLITE3"):
        write_bag(place / storage.lower(), entries, storage=storage)


def read_bag(path, rng):
    bag = path.parent if rng.random() < 0.7 and path.suffix else path
    return rng.choice((("replay-scans", bag, "--out", "commands.csv"), ("bag", bag)))


def odd_messages(place, rng):
    """A bag whose messages have numbers of any kind, and times that go back."""
    odd = (0.0, -1.0, np.nan, np.inf, -np.inf, 1e30, 1e-30, 0.1, 6.3)
    entries = []
    for i in range(4):
        usual = SECOND * (i + 1)
        time = usual if rng.random() < 0.8 else rng.choice((0, i, SECOND - i, 2**31 * SECOND - 1))
        ranges = [rng.choice((1.0, 2.0, 3.0, rng.choice(odd))) for _ in range(rng.choice((41, 41, 41, 0, 1, 2, 40)))]
        parts = ("angle_min", "angle_max", "angle_increment", "time_increment", "scan_time", "range_min", "range_max")
        values = {name: rng.choice(odd) for name in parts if rng.random() < 0.05}
        entries.append(("/scan", usual, robot_scan(ranges, time=time, **values)))
        pose = {name: rng.choice(odd) for name in ("x", "y", "speed") if rng.random() < 0.1}
        entries.append(("/odom", usual + 1, robot_odometry(time, **pose)))
    return read_bag(write_bag(place / "odd", entries), rng)


def drives(place):
    time = np.arange(0.0, 7.0, 0.02)
    speed, steering = 2.5 + np.sin(time), 0.3 * np.sin(2.0 * time)
    yaw_rate = speed * np.tan(steering) / 0.33
    yaw = np.cumsum(yaw_rate) * 0.02
    x, y = (np.cumsum(speed * turn) * 0.02 for turn in (np.cos(yaw), np.sin(yaw)))
    columns = {"t": time, "v": speed, "r": yaw_rate, "d": steering, "x": x, "y": y, "yaw": yaw}
    columns |= {f"beam_{number}": np.full(len(time), 3.0) for number in (300, 540, 780)}
    rows = [",".join(f"{value:.5g}" for value in row) for row in zip(*columns.values(), strict=True)]
    (place / "drive.csv").write_text("# by hand, 50 Hz\n" + "\n".join([",".join(columns), *rows]) + "\n")
    document("columns")(place)


def of_drive(name, *words):
    return (name, "drive.csv", "--columns", "columns.toml", *words)


DRIVE = to_cdr(drive_message(fg.DriveCommand(steering_angle=0.1, speed=1.0), 0))


@functools.cache
def servers():
    """A server for Foxglove and a node of ROS 2, once for all tries."""
    found = FoxgloveServer(LiveSession(), port=0, log=print)
    ros = Ros2Server(LiveSession(), domain=150 + os.getpid() % 80, host="127.0.0.1")
    atexit.register(found.close)
    atexit.register(ros.close)
    return found, ros


def peers(place, rng):
    """What peers on Foxglove and ROS 2 send: bytes that are none, and numbers of any kind, and the race goes on."""
    foxglove, ros = servers()
    said = [mutated(rng.choice((DRIVE, b"\0\1\0\0" + bytes(400), b"\0\1\0\0\1")), rng, binary=True) for _ in range(5)]
    said += [DRIVE[:-8] + np.float32(rng.choice((1e-40, -1e30, np.nan, np.inf))).tobytes() * 2 for _ in range(2)]
    text = json.dumps({"drive": {"speed": 1.5, "steering_angle": -0.1}, "pose": {"pose": {"position": {"x": 1}}}})
    kinds = _taken({}, ())

    def use():
        for content in said:
            with contextlib.suppress(fg.FgMujocoError):
                foxglove.take(rng.choice([*ACCEPTED, "/nothing"]), "cdr", content)
            with contextlib.suppress(fg.FgMujocoError):
                foxglove.take(rng.choice([*ACCEPTED]), "json", mutated(text.encode(), rng))
            with contextlib.suppress(fg.FgMujocoError):
                foxglove.set_parameter(rng.choice(("mu", "max_speed", "driver", "")), rng.choice((*NUMBERS, [], 1e9)))
            topic = rng.choice([*kinds])
            ros._take(topic, kinds[topic], content)
        foxglove.tick()
        ros._race.tick()

    return use


# -- values of any kind in the place of settings, actions and what is shown


class Unreadable:
    """Cannot be read, nor written."""

    def __array__(self, *arguments, **given):
        raise MemoryError

    def __repr__(self):
        raise RuntimeError("no\ntext")


VALUES = (None, True, 0, -1, 3, 10**400, 0.5, 1e-300, 1e308, np.nan, np.inf, "", "a", "a" * 5000, "/dev/zero", b"a", [],
          [[]], [np.nan, 1.0], [[0.0, 1.0]], [1j, 0], ["a", "b"], (0, 10**400), {}, {"a": 1}, {1: None}, object(),
          np.zeros(2), np.zeros((2, 3)), np.full((4, 2), np.nan), np.array("a"), np.float32("nan"), np.int64(2),
          np.datetime64("2020"), range(3), int, lambda *_: None, iter(()), slice(0, 2))  # fmt: skip
OF_THE_GYM = ("map", "map_ext", "params", "num_agents", "timestep", "ego_idx", "seed", "integrator", "model",
              "num_beams", "lidar_dist", "fov", "vehicle", "tires", "unknown")  # fmt: skip
KNOBS = ("mu", "planner_mu", "max_speed", "planner.lookahead", "planner.x", "", "planner.", "seed")


def environment(setting, some):
    name = setting((None, *(field.name for field in fields(EnvironmentSettings))))
    env = F1TenthEnv(**({} if name is None else {name: some()}))
    env.reset(seed=1)
    env.step(some())


def gym(setting, some):
    given = {"map": "oval", "num_agents": 1, "num_beams": 60, setting(OF_THE_GYM): some()}
    env = f110.make("f110_gym:f110-v0", **given)
    env.reset(some())
    env.step(some())


def session(setting, some):
    live = LiveSession(fg.Setup.of())
    for _ in range(3):
        live.change(setting(KNOBS), some())
        live.tick()
    assert "\n" not in live.message and np.isfinite(live.simulation.state).all()


def shown(setting, some):
    def planner(scan, odometry):
        for _ in range(6):
            way, frame = setting((None, "points", "line", 3)), setting(("laser", "map", []))
            fg.show(some(), setting((*VALUES, Unreadable())), draw=way, frame=frame)
        return fg.STOP

    simulation = fg.Simulation(fg.World("oval"))
    witness = Witness(planner, simulation.world.parameters)
    assert witness.decide(*simulation.reset(), None) == fg.STOP
    assert all("\n" not in remark for remark in witness.remarks)


def values(place, rng):
    door = rng.choice((environment, gym, session, shown))
    return lambda: door(rng.choice, lambda: rng.choice(VALUES))


# -- launch files

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
CODE = ("None", "[]", "{}", "'a' * 9999999", "range(10**9)", "open('/dev/zero')", "LaunchConfiguration('x')", "Node()",
        "later()", "lambda: 0", "[i for i in 5]", "'%9999d' % 1", "'{:>{}}'.format(1, 9)", "10**9", "f'{1:>9}'",
        "PythonExpression(['1+'])", "GroupAction(1)", "OpaqueFunction()", "IfCondition()", "print(*[1])")  # fmt: skip
"""What is put into a launch file."""


def launch(place):
    (place / "package.xml").write_text("<package><name>car</name></package>")
    (place / "setup.py").write_text('"drive = node:main"')
    (place / "node.py").write_text("def main(): pass")
    (place / "car.yaml").write_text("car: {ros__parameters: {speed: 1.0}}")
    (place / "inner.launch.py").write_text("def generate_launch_description():\n    return []\n")
    for name, text in {"car.launch.py": LAUNCH, **ENTITIES}.items():
        (place / name).write_text(text)


def launched_file(path, rng):
    if path.suffix == ".py":
        return lambda: read_program(f"ros:{path.name}")

    def use():
        with contextlib.suppress(NodeBlockedError):  # there is too much to do at once, for the machine as it is
            launched(path, {}, "formats", Graph(5.0))

    return use


# -- all


@dataclass(frozen=True)
class Format:
    """What writes files that are right, which of them are changed, how they are used, and words to put into them."""

    write: object
    changed: tuple
    uses: tuple  # the arguments of a command, or what returns these or a call, of the file and the generator
    words: tuple = WORDS
    tries: int = 12  # and twenty times as many in `make fuzz`
    lost: float = 0.0  # share of the tries in which the file is lost, or another is in its place

    def use(self, place, rng):
        """Change a file of a folder, and return how it is used."""
        if not self.changed:
            return self.uses[0](place, rng)
        found = sorted(path for name in self.changed for path in place.glob(name) if path.is_file())
        path, other = rng.choice(found), rng.choice(found)
        if rng.random() >= self.lost:
            change(path, rng, self.words)
        elif path != other:
            shutil.copy(other, path)
        else:
            path.unlink()
        way = rng.choice(self.uses)
        return way(path, rng) if callable(way) else way


def converted(path, rng):
    more = rng.choice(((), ("--raceline",), ("--line", "centreline")))
    return ("track", "convert", f"{path.name}{rng.choice(('', '[width=1]', '[scale=2]'))}", "out.csv", *more)


STUDY = ("study/**/*.[!p]*",)  # all but the pictures
FORMATS = {
    "track": Format(ring, ("ring.csv",), (*(race(f"--track=ring.csv{w}") for w in ("", "[width=2]",
                    "[direction=clockwise]")), race("--track=oval", "--controller=pure_pursuit[line=ring.csv]")),
                    (*WORDS, *HEADS)),
    "lines": Format(ring, ("*.csv", "*.json", "line.npy", "track.yaml"), (converted,), (*WORDS, *HEADS),
                    tries=100),
    "map": Format(ring, ("map.yaml",),
                  tuple(race(f"--track=map.yaml{way}") for way in ("", "[close=.3]", "[border=wall]"))),
    "image": Format(ring, ("map.png", "gray.pgm"), (lambda path, rng: race(f"--track={path.stem}.yaml"),), tries=30),
    "names": Format(ring, (), (names,)),
    "planner": Format(ring, ("planner.py",), (race("--controller=planner.py:Planner"),), ANSWERS),
    "run": Format(run, ("run/summary.json", "run/scene.xml"), READERS),
    "states": Format(run, ("run/states.npz", "run/telemetry.csv"), READERS),
    "run of several": Format(run_of_several,
                             ("run/summary.json", "run/s*", "run/telemetry_car_*.csv"), READERS, lost=0.1),
    "rollout": Format(lambda place: main([*ROLLOUT, "--out", str(place / "study"), "--json"]), STUDY,
                      ((*ROLLOUT, "--out", "study"),), lost=0.25),
    "comparison": Format(lambda place: main([*COMPARE[:-1], str(place / "study")]), STUDY, (COMPARE,), lost=0.25),
    "vehicle": Format(vehicles, ("car.xml", "nuc.xml"), (lambda path, rng: rng.choice((("vehicles", path.name),
                      race(f"--vehicle={path.name}"))),), tries=40),
    "parts": Format(vehicles, (*_PARTS, "assets/tub.obj"),
                    (lambda path, rng: lambda: compile_scenery(fg.World("oval", "car.xml").xml),)),
    "car": Format(cars, ("*",), (lambda path, rng: ("car", path.name, "--out", "car"),)),
    "settings": Format(lambda place: (place / "race.toml").write_text(SETTINGS), ("race.toml",),
                       (race("--config", "race.toml"),), tries=80),
    "training": Format(document("training"), ("*.toml",), (lambda path, rng: lambda: read_training(path),)),
    "lab": Format(document("lab"), ("*.toml",), (("study", "lab.toml", "wall_follow", "--workers", "1"),)),
    "suite": Format(document("suite"), ("*.toml",),
                    (("study", "suite.toml", "gap_finder", "--out", "suite", "--workers", "1"),)),
    "columns": Format(drives, ("*.toml",), (of_drive("validate"), of_drive("bag"))),
    "drive": Format(drives, ("drive.csv",), (of_drive("bag"), of_drive("validate", "--mu", "0.7"),
                    of_drive("replay-scans", "--out", "commands.csv"),
                    of_drive("identify", "--out", "tires.toml", "--budget", "0.5"))),
    "policy": Format(policies, ("*.onnx",), (lambda path, rng: race("--controller", path.name),)),
    "bag": Format(bags, ("mcap/*", "sqlite3/*"), (read_bag,)), "messages": Format(bags, (), (odd_messages,)),
    "peers": Format(lambda place: None, (), (peers,)),
    "values": Format(lambda place: None, (), (values,), tries=40),
    "launch file": Format(launch, ("car.launch.py",), (launched_file,), (*CODE, *WORDS), tries=80),
    "launch entities": Format(launch, ("car.launch.xml", "car.launch.yaml"), (launched_file,), tries=80),
}  # fmt: skip


@pytest.fixture(scope="module", autouse=True)
def compiled():
    """Kernels are compiled before time is counted: on empty caches that alone takes some 10 s."""
    fg.race("oval", "gap_finder", time_limit=0.03)


@pytest.fixture(scope="module")
def right(tmp_path_factory):
    """The folder of a format with its files as they are right."""

    @functools.cache
    def written(name):
        folder = tmp_path_factory.mktemp("right")
        FORMATS[name].write(folder)
        return folder

    return written


@pytest.mark.hypothesis
@each("name", FORMATS)
def test_a_file_that_was_changed_is_used_or_refused_in_a_line(name, right, tmp_path, monkeypatch, capfd):
    here, tries = tmp_path / "here", FORMATS[name].tries * settings().max_examples // 50

    @settings(max_examples=tries, phases=[Phase.generate], suppress_health_check=list(HealthCheck))
    @given(rng=st.randoms(use_true_random=False))
    def attempt(rng):
        shutil.rmtree(here, ignore_errors=True)
        shutil.copytree(right(name), here)
        monkeypatch.chdir(here)
        judge(FORMATS[name].use(here, rng), here, capfd)

    # the limits are those of this process, where planners of labs are driven as well
    monkeypatch.setattr("fg_mujoco.addons.arena.runs.graded_drive.record", recorded_here)
    attempt()


def hangs():
    while True:
        pass


FAULTS = {
    "raises": lambda here: {}["nothing"], "hangs": lambda here: hangs(),
    "takes memory": lambda here: np.ones(60_000_000), "ends with another code": lambda here: sys.exit(3),
    "has a traceback": lambda here: print("Traceback (most recent call last)"),
    "refuses in two lines": lambda here: os.write(2, b"fg-mujoco: no\nno\n") and sys.exit(2),
    "refuses and writes": lambda here: (here / "x").write_text("x") and os.write(2, b"fg-mujoco: no\n") and sys.exit(2),
}  # fmt: skip


@each("fault", FAULTS)
def test_a_use_that_is_wrong_is_found(fault, tmp_path, capfd):
    with pytest.raises((AssertionError, KeyError, MemoryError)):
        judge(lambda: FAULTS[fault](tmp_path), tmp_path, capfd, seconds=0.3, memory=400_000_000)
