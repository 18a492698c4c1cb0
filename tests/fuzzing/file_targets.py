"""Targets that are files: courses, folders of runs and studies, vehicles, settings, bags, drives, and documents."""

import json
import os
import pickle
import re
import shutil
from importlib.resources import files
from unittest.mock import patch

import mujoco
import numpy as np

import fg_mujoco as fg
from bag_worlds import SECOND, robot_odometry, robot_scan, write_bag
from fg_mujoco.addons.learn.policy_files import save_policy
from fg_mujoco.addons.learn.training_settings import TrainingSettings
from fg_mujoco.cli.main import main
from fg_mujoco.compiled import kept as keeping
from fg_mujoco.compiled.kernel_files import write_kept
from fg_mujoco.course.documents import read_toml, toml_text
from fg_mujoco.pictures.rendering.scenery import compile_scenery
from fg_mujoco.racing.run_folder import write_run
from fg_mujoco.simulation.settings import known_settings
from forging import without_checksums
from small_policies import FLAT, PARTS, interface_of, network_for

from .mutations import NUMBERS, WORDS, any_json, mutated, mutated_binary, one_of
from .target import SHORT, Target, as_text, command, ignore_refusal, of_files

# -- courses


def race(*words):
    return ("race", *words, *SHORT)


def ring(samples):
    """Write a round map as PNG and PGM, their YAML, a centreline, and the same as a line."""
    from PIL import Image

    y, x = np.mgrid[:90, :90] - 44.5
    picture = Image.fromarray(np.where(np.abs(np.hypot(x, y) - 30.0) < 9.0, 254, 0).astype(np.uint8))
    settings = {"resolution": 0.1, "origin": [-4.5, -4.5, 0.0], "negate": 0, "occupied_thresh": 0.65,
                "free_thresh": 0.196}  # fmt: skip
    for name, image in (("map", "map.png"), ("gray", "gray.pgm")):
        picture.save(samples / image)
        text = "".join(f"{key}: {value}\n" for key, value in {"image": image, **settings}.items())
        (samples / f"{name}.yaml").write_text(text)
    angle = np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False)
    points = np.column_stack([3.0 * np.cos(angle), 3.0 * np.sin(angle), np.full(60, 0.9), np.full(60, 0.9)])
    for name in ("ring.csv", "line.csv"):
        np.savetxt(samples / name, points, "%.4f", ",", header="x_m, y_m, w_tr_right_m, w_tr_left_m")


TRACKS = ("oval", "random:3", "random:3:tight", "scene:u_turn_trap:3", "ring.csv[width=2]",
          "map.yaml[close=.3,loop=1]", "maze")  # fmt: skip


def _track_name(samples, here, rng):
    shutil.copytree(samples, here, dirs_exist_ok=True)
    name = as_text(mutated(one_of(rng, TRACKS).encode(), rng))
    boxes = ("--obstacles", one_of(rng, (*NUMBERS, "2"))) if rng.random() < 0.3 else ()
    return command(*race(f"--track={name}", *boxes))


_HEADS = {"x": ("x", "x_m", "x_ref", "center_x_m", "x_cm", "X [m]"),
    "y": ("y", "y_m", "y_ref", "center_y_m", "y_cm", "Y [m]"),
    "right": ("w_tr_right_m", "width_right", "d_right", "w_right [cm]"), "left": ("w_tr_left_m", "width_left", "left"),
    "width": ("width", "track_width"), "v": ("vx_mps", "speed [km/h]", "v"), "yaw": ("psi_rad", "yaw", "theta"),
    "other": ("s_m", "index", "kappa_radpm", "z", "qx", "")}  # fmt: skip


def _field_course(samples, here, rng):
    """A course or a line as teams have them: some of these columns, in any order, with any separator and unit."""
    kinds = [str(kind) for kind in rng.permutation(list(_HEADS))[: int(rng.integers(2, 9))]]
    kinds = kinds if rng.random() < 0.2 else list(dict.fromkeys(("x", "y", *kinds)))
    angle = np.linspace(0.0, 2.0 * np.pi * one_of(rng, (1.0, 1.0, 1.0, 0.5)), int(one_of(rng, (60, 60, 400, 3))))
    scale = float(one_of(rng, (1.0, 1.0, 1.0, 100.0, 1000.0, 1e-3)))
    values = {"x": 9.0 * np.cos(angle), "y": 9.0 * np.sin(angle), "yaw": angle, "v": 3.0 + np.sin(angle)}
    columns = [values.get(kind, np.full(len(angle), 1.0)) * (1.0 if kind == "yaw" else scale) for kind in kinds]
    between = one_of(rng, (",", ", ", ";", "\t", " "))
    head = between.join(one_of(rng, _HEADS[kind]) for kind in kinds)
    rows = [between.join(f"{value:.5g}" for value in row) for row in np.column_stack(columns)]
    text = "\n".join([one_of(rng, (head, f"# {head}", "")), *rows]).encode()
    name = one_of(rng, ("course.csv", "course.csv", "course.txt", "course.json", "course.npy", "course.stl"))
    (here / name).write_bytes(mutated(text, rng) if rng.random() < 0.3 else text)
    ways = (("--track", name), ("--track", f"{name}[width=2]"), ("--controller", f"pure_pursuit[line={name}]"))
    return command(*race(*one_of(rng, ways)))


def lines(samples):
    """Write a line as CSV, JSON of rows and of columns, NumPy's array, and a track.yaml."""
    ring(samples)
    points = np.loadtxt(samples / "ring.csv", delimiter=",")
    names = ("x_m", "y_m", "w_tr_right_m", "w_tr_left_m")
    rows = [dict(zip(names, row, strict=True)) for row in points.tolist()]
    (samples / "rows.json").write_text(json.dumps({"centreline": {"wpnts": rows}, "other": rows}))
    (samples / "columns.json").write_text(json.dumps(dict(zip(names, points.T.tolist(), strict=True))))
    np.save(samples / "line.npy", points)
    (samples / "track.yaml").write_text("centreline: ring.csv\nclosed: true\nsurface: wood\n")


def _converted(path, rng):
    more = one_of(rng, ((), (), ("--raceline",), ("--line", "centreline")))
    settings = one_of(rng, ("", "", "[width=1]", "[scale=2]"))
    return command("track", "convert", f"{path.name}{settings}", "out.csv", *more)


def _kept(samples, here, rng):
    """A course whose kept entry is damaged, lost, or that of another is read as it was."""
    shutil.copytree(samples, here, dirs_exist_ok=True)
    damage = one_of(rng, ("mutated", "mutated", "pickled", "pickled", "folder", "link"))
    value = one_of(rng, (None, (), (1, 2), (b"", {}, []), (b"x", {}, []), [], {}, "x"))
    name = "ring.csv[width=1]"

    def attempt():
        with patch.dict(os.environ, XDG_CACHE_HOME=str(here / "cache")):
            keeping._folder.cache_clear()
            try:
                first = fg.load_track(name)
                for entry in (here / "cache/fg_mujoco/kept").iterdir():
                    content = entry.read_bytes()
                    entry.unlink()
                    if damage == "folder":
                        (entry / "x").mkdir(parents=True)
                    elif damage == "link":
                        entry.symlink_to(one_of(rng, ("/dev/zero", "nothing", "../kept")))
                    elif damage == "pickled":
                        write_kept(entry, pickle.dumps(value))
                    else:
                        entry.write_bytes(mutated_binary(content, rng))
                assert np.array_equal(fg.load_track(name).centreline, first.centreline)
            finally:
                keeping._folder.cache_clear()
        return 0

    return attempt


# -- folders of a race, a rollout and a comparison, as others send them or disks damage them

READERS = (*3 * [("replay", "run")], *2 * [("export", "run", "--out", "run.mcap")], *2 * [race("--config", "run")],
           ("report", "run", "--no-clip"))  # fmt: skip
ROLLOUT = ("rollout", "--n", "3", "--time-limit", "0.05", "--chunk", "1", "--workers", "1", "--record", "states")
COMPARE = ("compare", "--controller", "gap_finder", "--track", "oval", "--seed", "0:1", "--laps", "1", "--time-limit",
           "0.05", "--workers", "1", "--out", "study")  # fmt: skip
STUDY = ("study/**/*.[!p]*",)  # all but the pictures


def run(samples):
    """Write a run whose files have no checksums: what is read is checked for itself."""
    without_checksums(write_run(fg.race("oval", laps=1, time_limit=0.2), samples / "run"))


def _race_of_several(samples):
    entries = [fg.Entry(), fg.Entry(controller="follow_the_gap"), fg.Entry(controller="wall_follow")]
    without_checksums(write_run(fg.race("oval", entries=entries, laps=1, time_limit=0.2), samples / "run"))


# -- vehicles

_TAG = re.compile(rb"<(?!/|!|\?)[a-z]+[^<>]*>")
_SCHEMA = re.findall(r"^\s*(?:(\w+) \(.\))?(.*)$", mujoco.mj_printSchema(False, False), re.MULTILINE)
ELEMENTS = ("include", "attach", "robot", *sorted({element for element, _ in _SCHEMA if element}))
ATTRIBUTES = ("file", *sorted({word for _, words in _SCHEMA for word in words.split() if word.isidentifier()}))
HEADS = (b"<!DOCTYPE a>", b"<?xml version='1.0' encoding='utf-16'?>", b"<?a b?>", b"\xef\xbb\xbf", b"<!-- -->",
         b"<!DOCTYPE a [<!ENTITY b 'c'>]>")  # fmt: skip


def _marked_up(text, rng):
    """Return an MJCF text with elements and attributes that it did not have, or in other places."""
    for _ in range(int(one_of(rng, (1, 1, 2)))):
        tags = list(_TAG.finditer(text))
        if not tags:
            return text
        tag, other = one_of(rng, tags), one_of(rng, tags)
        alone = tag[0] if tag[0].endswith(b"/>") else b""
        value = one_of(rng, (*NUMBERS[:34], *WORDS, "1 1 1", "0 0 0", "/etc/passwd", "a.png"))
        value = value.replace("&", "").replace("<", "").replace('"', "")
        attribute = f' {one_of(rng, ATTRIBUTES)}="{value}"'.encode("utf-8", "surrogatepass")
        at, put = one_of(rng, (
            (tag.end() - (2 if alone else 1), attribute), (tag.end() - (2 if alone else 1), attribute),
            (tag.start(), f"<{one_of(rng, ELEMENTS)}".encode() + attribute + b"/>"),
            (tag.start(), alone * int(one_of(rng, (1, 10, 3000)))), (other.start(), alone), (0, one_of(rng, HEADS)),
        ))  # fmt: skip
        text = text[:at] + put + text[at:]
    return text


def _hostile_mjcf(text, rng):
    return _marked_up(text, rng) if rng.random() < 0.6 else mutated(text, rng)


def _vehicle(samples, here, rng):
    text = files("fg_mujoco.models").joinpath(one_of(rng, ("f1tenth.xml", "nuc2.xml"))).read_bytes()
    (here / "car.xml").write_bytes(_hostile_mjcf(text, rng))
    return command(*one_of(rng, (("vehicles", "car.xml"), race("--vehicle", "car.xml"))))


def _vehicle_files(samples, here, rng):
    """A vehicle whose LiDAR, look, mesh or tires are changed, or named by another path."""
    models = files("fg_mujoco.models")
    parts = {"eye.xml": "hokuyo_ust10lx.xml", "look.xml": "f1tenth_look.xml", "tires.toml": "tires/forzaeth_nuc2.toml"}
    shutil.copytree(str(models.joinpath("assets")), here / "assets")
    car = models.joinpath("f1tenth.xml").read_text("utf-8")
    car = car.replace("</custom>", '<text name="tires" data="tires.toml"/></custom>')
    for name, source in parts.items():
        (here / name).write_bytes(models.joinpath(source).read_bytes())
        paths = ("../car.xml", "/etc/passwd", "/dev/zero", "assets", "", "none", f"./{name}", f"~/{name}")
        car = car.replace(f'"{source}"', f'"{name}"')
        car = car.replace(f'"{name}"', f'"{one_of(rng, paths)}"') if rng.random() < 0.1 else car
    (here / "car.xml").write_text(car, "utf-8")
    path = here / one_of(rng, (*parts, "look.xml", "assets/tub.obj"))
    path.write_bytes((_hostile_mjcf if path.suffix == ".xml" else mutated)(path.read_bytes(), rng))
    return ignore_refusal(lambda: compile_scenery(fg.World("oval", str(here / "car.xml")).xml))


_WHEEL = (
    '<link name="{0}{1}"/><joint type="continuous"><parent link="a"/><child link="{0}{1}"/><origin xyz="{0} {1} 0"/>'
    "</joint>"
)
_CARS = {
    "gym.yaml": {"mu": 0.8, "C_Sf": 4.9, "C_Sr": 5.2, "lf": 0.16, "lr": 0.17, "m": 3.6, "I": 0.05, "s_max": 0.41},
    "vesc.yaml": {"speed_to_erpm_gain": 4614.0, "steering_angle_to_servo_gain": -1.2, "servo_min": 0.15,
                  "steering_angle_to_servo_offset": 0.53, "servo_max": 0.85, "speed_max": 23250, "wheelbase": 0.32},
    "forza.json": {"C_Pf": [4.8, 2.16, 0.65, 0.37], "C_Pr": [20.0, 1.5, 0.62, 0.0], "l_f": 0.162, "m": 3.54},
    "slipx.yaml": {"nominal_load": 8.6, "linear": {"c_alpha": 60}, "mu_y0": 1.1, "mf_lite": {"C": 1.68}, "m": 3},
}  # fmt: skip
_URDF = (
    '<robot><link name="a"><inertial><mass value="3"/><origin xyz="0.15 0 0"/><inertia izz="0.04"/></inertial></link>'
    + "".join(_WHEEL.format(x, y) for x in (0, 0.32) for y in (-0.1, 0.1)) + "</robot>"
)  # fmt: skip


def _cars(samples):
    for name, values in _CARS.items():
        (samples / name).write_text(json.dumps(values, indent=1))
    (samples / "car.urdf").write_text(_URDF)


# -- settings files and the command line

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


def _settings_file(samples, here, rng):
    (here / "race.toml").write_bytes(mutated(one_of(rng, (SETTINGS, SETTINGS_OF_SEVERAL)).encode(), rng))
    return command(*race("--config", "race.toml"))


COMMANDS = {
    race(): "track controller laps obstacles obstacle-seed vehicle mu planner-mu max-speed lidar lidar-noise "
            "lidar-dropout lidar-latency odometry-drift seed config decision-limit",
    ("replay", "run"): "json controller x",
    ("vehicles",): "json x", ("controllers",): "json x", ("track", "list"): "json x",
    ("rollout", "--n", "2", "--time-limit", "0.05", "--workers", "1"):
        "track controller seed randomize vehicle mu max-speed record executor chunk",
    ("export", "run"): "format out", ("report", "run", "--no-clip"): "out clip x",
    ("replay-scans", "run"): "controller out scan-topic vehicle planner-mu track",
}  # fmt: skip
"""Commands, and options of theirs; x is none."""


def _command_line(samples, here, rng):
    shutil.copytree(samples / "run", here / "run")
    arguments, options = one_of(rng, list(COMMANDS.items()))
    arguments = list(arguments)
    for _ in range(int(rng.integers(1, 4))):
        option, value, way = f"--{one_of(rng, options.split())}", one_of(rng, (*NUMBERS, *WORDS)), rng.random()
        arguments += [option] if way < 0.1 else [f"{option}={value}"] if way < 0.8 else [option, value]
    if rng.random() < 0.2:
        arguments[int(rng.integers(len(arguments)))] = one_of(rng, WORDS)
    return command(*arguments)


# -- bags and drives


def _bags(samples):
    entries = []
    for i in range(5):
        time = SECOND + i * SECOND // 10
        entries.append(("/scan", time, robot_scan([1.0 + 0.1 * i] * 41, time=time)))
        entries.append(("/odom", time + 1, robot_odometry(time, x=0.1 * i, speed=1.0)))
    for storage in ("MCAP", "SQLITE3"):
        write_bag(samples / storage.lower(), entries, storage=storage)


def _read_bag(path, rng):
    """Return a command that reads a bag: a planner over it, or what it holds."""
    bag = path.parent if rng.random() < 0.7 and path.suffix else path
    return one_of(rng, (command("replay-scans", bag, "--out", "commands.csv"), command("bag", bag)))


def _messages(samples, here, rng):
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
    return _read_bag(write_bag(here / "bag", entries), rng)


def drives(samples):
    time = np.arange(0.0, 7.0, 0.02)
    speed, steering = 2.5 + np.sin(time), 0.3 * np.sin(2.0 * time)
    yaw_rate = speed * np.tan(steering) / 0.33
    yaw = np.cumsum(yaw_rate) * 0.02
    x, y = (np.cumsum(speed * turn) * 0.02 for turn in (np.cos(yaw), np.sin(yaw)))
    columns = {"t": time, "v": speed, "r": yaw_rate, "d": steering, "x": x, "y": y, "yaw": yaw}
    columns |= {f"beam_{number}": np.full(len(time), 3.0) for number in (300, 540, 780)}
    rows = [",".join(f"{value:.5g}" for value in row) for row in zip(*columns.values(), strict=True)]
    (samples / "drive.csv").write_text("# by hand, 50 Hz\n" + "\n".join([",".join(columns), *rows]) + "\n")
    names = {"time": "t", "speed": "v", "yaw_rate": "r", "steering": "d", "x": "x", "y": "y"}
    (samples / "columns.toml").write_text(
        "".join(f'{name} = "{column}"\n' for name, column in names.items())
        + 'yaw = {column = "yaw", unit = "rad", scale = 1.0, offset = 0.0, delay = 0.0}\npose_ahead = 0.0\n'
        + 'beams = {columns = "beam_{}", count = 1081, field_of_view = 270.0, nothing = 65.0, unit = "m"}\n'
    )


def of_drive(name, *words):
    return (name, "drive.csv", "--columns", "columns.toml", *words)


# -- documents in JSON and TOML: changed at one of their leaves or branches, or in their text


def _policies(samples):
    residual = PARTS | {"observation": "speed,beams:54,planner_command", "residual": {"planner": "gap_finder"}}
    for name, settings in {"flat": FLAT, "parts": PARTS, "residual": residual}.items():
        interface = interface_of(**settings)
        save_policy(network_for(interface), samples / f"{name}.onnx", interface, trained={"steps": 3})


def _policy(samples, here, rng):
    import onnx

    model = onnx.load(samples / one_of(rng, ("flat.onnx", "parts.onnx", "residual.onnx")))
    content = json.loads(model.metadata_props[0].value)
    model.metadata_props[0].value = json.dumps(content | {"interface": any_json(content["interface"], rng)})
    onnx.save(model, here / "policy.onnx")
    return command(*race("--controller", "policy.onnx"))


_TRAINING = {"steps": 128, "worlds": 2, "seed": 0, "checkpoints": 1,
             "environment": {"track": "oval", "observation": "beams:5,speed,normalised,flat", "privileged": "mu",
                             "time_limit": 1.0, "laps": 1, "opponents": ["gap_finder"], "speed_range": [0.5, 8.0],
                             "builds": 1, "randomize": {"mu": "0.5:1.1"}, "rewards": {"preset": "race"}},
             "ppo": {"net": [4], "n_steps": 32, "minibatches": 2, "n_epochs": 1}}  # fmt: skip
_LAB = {"name": "a lab", "track": "oval", "laps": 1, "time_limit": 0.05, "passing": 10, "obstacles": 1,
        "checks": [{"check": "finishes", "points": 10},
            {"check": "no_crash", "points": 5.5, "least_progress_m": 0.1, "mu": 0.9},
            {"check": "follows_wall", "side": "left", "distance_m": 1.0, "within_m": 0.2, "points": 2, "name": "wall"}]}
_SUITE = {"time_limit": 0.1, "name": "duels", "version": 1, "assists": ["none"],
          "groups": [{"name": "a", "track": ["oval"], "starts": 1, "opponent": ["right"], "speed": [0.5],
                      "headway": 3.0, "offset": 0.0},
              {"name": "b", "track": "hairpins", "starts": [1.0], "opponent": "left", "speed": 0.8, "mu": [0.8, 0.9]}]}
_COLUMNS = {"time": {"column": "t", "unit": "s", "scale": "measured"}, "speed": {"column": "v", "scale": 1.01},
            "yaw_rate": {"column": "r", "unit": "rad/s", "delay": 0.02}, "steering": "d", "steering_is": "command",
            "x": "x", "y": "y", "yaw": {"column": "yaw", "unit": "rad"}, "pose_ahead": 0.0,
            "beams": {"columns": "beam_{}", "count": 1081, "field_of_view": 270.0, "nothing": 65.5}}  # fmt: skip


def of_document(document, use, **more):
    """Return a target of a document in TOML of which one value is changed, or lost, or its text."""

    def attempt(samples, here, rng):
        key, changed = one_of(rng, list(document)), dict(document)
        if rng.random() < 0.1:
            del changed[key]
        else:
            changed[key] = any_json(document[key], rng)
        content = toml_text(changed).encode(errors="surrogateescape")
        (here / "document.toml").write_bytes(mutated(content, rng) if rng.random() < 0.3 else content)
        return use(samples)

    return Target(attempt=attempt, **more)


def _read_training():
    return TrainingSettings(**known_settings(read_toml("document.toml").values, TrainingSettings, "a training"))


TARGETS = {"field_course": Target(attempt=_field_course),
    "track_csv": of_files(ring, ["ring.csv"], race("--track=ring.csv"), race("--track=ring.csv"),
                          race("--track=ring.csv[width=2]"), race("--track=ring.csv[direction=clockwise]")),
    "map_yaml": of_files(ring, ["map.yaml"],
                         *(race(f"--track=map.yaml{w}") for w in ("", "[close=0.3]", "[border=wall]"))),
    "map_image": of_files(ring, ["map.png", "gray.pgm"], lambda path, rng: command(*race(f"--track={path.stem}.yaml"))),
    "track_name": Target(attempt=_track_name, prepare=ring),
    "raceline": of_files(ring, ["line.csv"], race("--track=ring.csv", "--controller=pure_pursuit[line=line.csv]")),
    "run_summary": of_files(run, ["run/summary.json"], *READERS),
    "run_states": of_files(run, ["run/states.npz"], *READERS),
    "run_telemetry": of_files(run, ["run/telemetry.csv"], *READERS),
    "run_scene": of_files(run, ["run/scene.xml"], *READERS),
    "several_cars_folder": of_files(_race_of_several, ["run/summary.json", "run/s*", "run/telemetry_car_*.csv"],
                                    *READERS, lost=0.03),
    "rollout_folder": of_files(lambda samples: main([*ROLLOUT, "--out", str(samples / "study"), "--json"]), STUDY,
                               (*ROLLOUT, "--out", "study"), lost=0.25),
    "comparison_folder": of_files(lambda samples: main([*COMPARE[:-1], str(samples / "study")]), STUDY, COMPARE,
                                  lost=0.25), "vehicle": Target(attempt=_vehicle),
    "vehicle_files": Target(attempt=_vehicle_files), "settings_file": Target(attempt=_settings_file),
    "command_line": Target(attempt=_command_line, prepare=run),
    "car_files": of_files(_cars, ["*"], lambda path, rng: command("car", path.name, "--out", "car")),
    "lines": of_files(lines, ["*.csv", "*.json", "*.json", "line.npy", "track.yaml"], _converted),
    "kept": Target(attempt=_kept, prepare=ring), "bag": of_files(_bags, ["mcap/*", "sqlite3/*"], _read_bag),
    "bag_messages": Target(attempt=_messages, prepare=_bags),
    "drive": of_files(drives, ["drive.csv", "drive.csv", "columns.toml"], of_drive("bag"), of_drive("bag"),
        of_drive("validate"), of_drive("validate", "--mu", "0.7"), of_drive("replay-scans", "--out", "commands.csv"),
        of_drive("identify", "--out", "tires.toml", "--budget", "1")),
    "policy": Target(attempt=_policy, prepare=_policies),
    "training": of_document(_TRAINING, lambda samples: ignore_refusal(_read_training)),
    "lab": of_document(_LAB, lambda samples: command("study", "document.toml", "wall_follow", "--workers", "1")),
    "suite": of_document(_SUITE,
        lambda samples: command("study", "document.toml", "gap_finder", "--out", "suite", "--workers", "1")),
    "columns": of_document(_COLUMNS,
        lambda samples: command("validate", samples / "drive.csv", "--columns", "document.toml"), prepare=drives)}
