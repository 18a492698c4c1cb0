"""The doors: each writes inputs that are right once, and for each try changes them and gives what is done with them.

An attempt is a call without arguments. It returns an exit code, or, of Python's doors, 0; any error that it raises is a
finding. It runs in a folder that is empty but for what the try has put there.
"""

from __future__ import annotations

import contextlib
import io
import json
import shutil
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.random import Generator

import fg_mujoco as fg
from fg_mujoco.cli.main import main
from fg_mujoco.errors import FgMujocoError
from fg_mujoco.racing.planner_loading import bundled_names
from fg_mujoco.vehicle.vehicle import Vehicle

from .mutations import NUMBERS, WORDS, mutated, mutated_binary, one_of

Attempt = Callable[[], object]

SHORT = ("--time-limit", "0.03")
"""Of a race whose drive does not matter."""

QUICK = ("--n", "3", "--duration", "0.05", "--chunk", "1", "--workers", "1")
COMPARED = ("--controllers", "gap_finder", "--tracks", "oval", "--seeds", "0:2", "--laps", "1", "--time-limit", "0.05")


@dataclass(frozen=True, kw_only=True)
class Door:
    """A way in.

    Attributes:
      attempt: takes the folder of samples, the present folder and the generator; puts a changed input there.
      prepare: writes the samples.
    """

    attempt: Callable[[Path, Path, Generator], Attempt]
    prepare: Callable[[Path], None] = lambda samples: None


def command(*arguments: object) -> Attempt:
    """Return a call of the command line."""
    return lambda: main([str(argument) for argument in arguments])


def _ignore_refusal(call: Callable[[], object]) -> Attempt:
    """Return a call of Python's, which may raise errors of this package only."""

    def attempt() -> int:
        with contextlib.suppress(FgMujocoError):
            call()
        return 0

    return attempt


# -- courses


def _ring(samples: Path) -> None:
    """Write a round map as PNG and PGM, its YAML, and a centreline."""
    from PIL import Image

    y, x = np.mgrid[:90, :90] - 44.5
    free = np.abs(np.hypot(x, y) - 30.0) < 9.0
    picture = Image.fromarray(np.where(free, 254, 0).astype(np.uint8))
    picture.save(samples / "map.png")
    picture.save(samples / "map.pgm")
    settings = {"image": "map.png", "resolution": 0.1, "origin": [-4.5, -4.5, 0.0], "negate": 0}
    settings |= {"occupied_thresh": 0.65, "free_thresh": 0.196}
    (samples / "map.yaml").write_text("".join(f"{key}: {value}\n" for key, value in settings.items()))
    angle = np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False)
    points = np.column_stack([3.0 * np.cos(angle), 3.0 * np.sin(angle), np.full(60, 0.9), np.full(60, 0.9)])
    rows = "\n".join(",".join(f"{value:.4f}" for value in row) for row in points)
    (samples / "ring.csv").write_text("# x_m, y_m, w_tr_right_m, w_tr_left_m\n" + rows + "\n")


def _track_csv(samples: Path, here: Path, rng: Generator) -> Attempt:
    (here / "ring.csv").write_bytes(mutated((samples / "ring.csv").read_bytes(), rng))
    return command(
        "race", "--track", one_of(rng, ("ring.csv", "ring.csv[width=2]", "ring.csv[direction=clockwise]")), *SHORT
    )


def _map_yaml(samples: Path, here: Path, rng: Generator) -> Attempt:
    shutil.copy(samples / "map.png", here)
    (here / "map.yaml").write_bytes(mutated((samples / "map.yaml").read_bytes(), rng))
    return command("race", "--track", one_of(rng, ("map.yaml", "map.yaml[close=0.3]", "map.yaml[border=wall]")), *SHORT)


def _map_image(samples: Path, here: Path, rng: Generator) -> Attempt:
    name = one_of(rng, ("map.png", "map.pgm"))
    (here / "map.yaml").write_text((samples / "map.yaml").read_text().replace("map.png", name))
    (here / name).write_bytes(mutated_binary((samples / name).read_bytes(), rng))
    return command("race", "--track", "map.yaml", *SHORT)


TRACKS = (
    "oval",
    "random:3",
    "random:3:tight",
    "scene:u_turn_trap:3",
    "ring.csv[width=2]",
    "map.yaml[close=.3,loop=1]",
    "maze",
)


def _track_name(samples: Path, here: Path, rng: Generator) -> Attempt:
    for name in ("map.yaml", "map.png", "ring.csv"):
        shutil.copy(samples / name, here)
    name = _as_text(mutated(one_of(rng, TRACKS).encode(), rng))
    options = ("--obstacles", one_of(rng, (*NUMBERS, "2"))) if rng.random() < 0.3 else ()
    return command("race", f"--track={name}", *(f"{option}" for option in options), *SHORT)


# -- planners


PLANNERS = (
    "gap_finder[lookahead=6]", "follow_the_gap[point=deepest,speed_law=friction]", "pure_pursuit[line=ring.csv]",
    "wall_follow",
    "disparity_extender[guidance=false]", "weighted_gap", "threshold_gap", "planner.py:Planner",
    "planner.py:Planner[gain=.5]",
)  # fmt: skip

PLANNER = """
import fg_mujoco as fg

class Planner:
    def __init__(self, gain: float = 1.0):
        self.gain = gain
    def reset(self):
        pass
    def __call__(self, scan, odometry):
        return fg.DriveCommand(steering_angle=0.05 * self.gain, speed=1.0)
"""


def _planner_settings(samples: Path, here: Path, rng: Generator) -> Attempt:
    (here / "planner.py").write_text(PLANNER)
    shutil.copy(samples / "ring.csv", here)
    return command("race", f"--controller={_as_text(mutated(one_of(rng, PLANNERS).encode(), rng))}", *SHORT)


VALUES = (
    "None", "0", "1", "True", "'a'", "b''", "[]", "()", "(0.0, 1.0)", "[0.1, 1.0, 2.0]", "{}", "float('nan')",
    "float('inf')", "-1e308",
    "10**400", "object()", "lambda *a: None", "scan", "odometry", "scan.ranges", "scan.ranges[:0]",
    "scan.ranges * 1j", "np.zeros(2)",
    "np.float32(1)", "np.array(['a', 'b'])", "np.array(None)", "np.ma.masked", "type", "Ellipsis", "iter([0, 0])",
    "(i for i in ())",
    "fg.DriveCommand(steering_angle=0.1, speed=1.0)", "fg.DriveCommand(steering_angle=9.0, speed=99.0)", "Odd()",
    "Odd", "1/0",
    "np.ctypeslib.as_array", "print('x' * 10000)", "__import__('warnings').warn('x' * 999)", "exec('raise Odd()')",
    "[][0]",
    "sys.exit(0)", "sys.exit('bye')", "exec('raise GeneratorExit')", "exec('raise StopIteration')",
    "exec('raise MemoryError')",
    "sys.setrecursionlimit(60)", "(lambda f: f(f))(lambda f: f(f))", "next(iter(()))", "forged(float('nan'))",
    "forged('a')", "forged(None)",
)  # fmt: skip
"""What planners give back, or do."""

HOSTILE_PLANNER = """
import sys
import numpy as np
import fg_mujoco as fg

scan = odometry = None

class Odd(BaseException):
    def __str__(self): raise RuntimeError("no text")
    __repr__ = __str__
    def __float__(self): raise Odd
    __getattr__ = __float__

def forged(value):
    command = object.__new__(fg.DriveCommand)
    object.__setattr__(command, "steering_angle", value)
    object.__setattr__(command, "speed", value)
    return command

class Planner:
    name = {name}
    stage = {stage}
    def __init__(self, {parameter}): self.state = {init}
    def reset(self): {reset}
    def __call__(self, scan, odometry):
        return {call}
"""


def _planner_file(samples: Path, here: Path, rng: Generator) -> Attempt:
    values = {
        "call": one_of(rng, VALUES),
        "name": "'a'",
        "stage": "1",
        "parameter": "*arguments, **others",
        "init": "0",
        "reset": "pass",
    }
    part = one_of(rng, ("call", "call", "call", "name", "stage", "init", "reset", "parameter"))
    values[part] = (
        one_of(rng, VALUES) if part != "parameter" else one_of(rng, ("car", "mu", "x=1", "*a", "car, mu, y", "x=[]"))
    )
    text = HOSTILE_PLANNER.format(**values).encode()
    (here / "planner.py").write_bytes(mutated(text, rng) if rng.random() < 0.2 and b"sys." not in text else text)
    return command("race", "--controller=planner.py:Planner", *SHORT)


def _raceline(samples: Path, here: Path, rng: Generator) -> Attempt:
    (here / "line.csv").write_bytes(mutated((samples / "ring.csv").read_bytes(), rng))
    shutil.copy(samples / "ring.csv", here)
    return command("race", "--track", "ring.csv", "--controller", "pure_pursuit[line=line.csv]", *SHORT)


def hostile_scan(rng: Generator) -> fg.LaserScan:
    """Return a scan of any number of beams, with anything in it."""
    count = int(one_of(rng, (1, 2, 3, 10, 101, 1081)))
    ranges = rng.uniform(0.05, 12.0, count)
    for value in (np.nan, np.inf, -np.inf, 0.0, -1.0, 1e308, 5e-324):
        ranges[rng.random(count) < one_of(rng, (0.0, 0.0, 0.1, 1.0))] = value
    span = float(one_of(rng, (4.7, 6.28, 1.0, 1e-6)))
    return fg.LaserScan(
        ranges=ranges,
        angle_min=-0.5 * span,
        angle_increment=span / max(1, count - 1),
        range_min=0.06,
        range_max=12.0,
        time=0.0,
    )


def _scans(samples: Path, here: Path, rng: Generator) -> Attempt:
    name = one_of(rng, [name for name in bundled_names() if name != "pure_pursuit"])
    planner = fg.make_controller(name, car=Vehicle.load("f1tenth").parameters, mu=0.9)
    numbers = [float(one_of(rng, (0.0, 1.0, -5.0, 1e9, 3.0))) for _ in range(5)]

    def drive() -> int:
        planner.reset()
        for step in range(3):
            pose = dict(zip(("x", "y", "yaw", "speed", "yaw_rate"), numbers, strict=True))
            command = planner(hostile_scan(rng), fg.Odometry(time=0.025 * step, **pose))
            assert np.isfinite([command.steering_angle, command.speed]).all()
        return 0

    return drive


# -- cars and settings


def _vehicle(samples: Path, here: Path, rng: Generator) -> Attempt:
    text = files("fg_mujoco.models").joinpath(one_of(rng, ("f1tenth.xml", "nuc2.xml"))).read_bytes()
    (here / "car.xml").write_bytes(mutated(text, rng))
    return command(*one_of(rng, (("vehicles", "car.xml"), ("race", "--vehicle", "car.xml", *SHORT))))


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


def _settings_file(samples: Path, here: Path, rng: Generator) -> Attempt:
    (here / "race.toml").write_bytes(mutated(SETTINGS.encode(), rng))
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
    "rollout": ("--n", "2", "--duration", "0.05", "--workers", "1"),
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
    "--engine", "--chunk"),
    "export": ("--format", "--out"),
    "replay-scans": ("--controller", "--out", "--scan-topic", "--vehicle", "--planner-mu", "--track"),
    "report": ("--out", "--clip", "--x"),
    "track": ("--json", "--x"),
}  # fmt: skip


# -- folders of results


def _run(samples: Path) -> None:
    result = fg.race("oval", laps=1, time_limit=0.2)
    settings = {"track": "oval", "controller": "gap_finder", "laps": 1, "time_limit": 0.2}
    from fg_mujoco.racing.run_folder import write_run

    write_run(result, samples / "run", settings=settings)


def _read(here: Path, rng: Generator) -> Attempt:
    readers = (
        ("replay", "run"), ("export", "run", "--out", "run.mcap"), ("race", "--config", "run", *SHORT),
        ("report", "run", "--no-clip"),
    )  # fmt: skip
    return command(*one_of(rng, (*readers[:3], readers[0], *readers)))


def _run_file(name: str) -> Callable[[Path, Path, Generator], Attempt]:
    def attempt(samples: Path, here: Path, rng: Generator) -> Attempt:
        shutil.copytree(samples / "run", here / "run")
        path = here / "run" / name
        path.write_bytes(mutated(path.read_bytes(), rng))
        return _read(here, rng)

    return attempt


def _any_json(value: Any, rng: Generator) -> Any:
    """Return a JSON value with one of its leaves or branches replaced."""
    if isinstance(value, dict) and value and rng.random() < 0.85:
        key = one_of(rng, list(value))
        return {**value, key: _any_json(value[key], rng)}
    if isinstance(value, list) and value and rng.random() < 0.7:
        place = int(rng.integers(len(value)))
        return [*value[:place], _any_json(value[place], rng), *value[place + 1 :]]
    deep: Any = 1
    for _ in range(200):
        deep = [deep]
    return one_of(
        rng,
        (None, True, 0, -1, 10**30, 1e308, "", *WORDS[:12], [], {}, [1], {"a": 1}, deep, [[]] * 9999, "x" * 9999, 0.5),
    )


def _summary(samples: Path, here: Path, rng: Generator) -> Attempt:
    shutil.copytree(samples / "run", here / "run")
    path = here / "run" / "summary.json"
    if rng.random() < 0.3:
        path.write_bytes(mutated(path.read_bytes(), rng))
    else:
        path.write_text(json.dumps(_any_json(json.loads(path.read_text()), rng)), encoding="utf-8")
    return _read(here, rng)


def _arrays(path: Path, rng: Generator) -> None:
    """Change a file of arrays: its bytes, or one of its arrays."""
    if rng.random() < 0.3:
        path.write_bytes(mutated_binary(path.read_bytes(), rng))
        return
    with np.load(path) as file:
        arrays = dict(file)
    name = one_of(rng, list(arrays))
    array = np.atleast_1d(arrays[name])
    first, second = (array.flat[int(rng.integers(max(1, array.size)))] if array.size else 0 for _ in range(2))
    changes: tuple[Callable[[], Any], ...] = (
        lambda: array[:-1], lambda: array[:0], lambda: array.T, lambda: array.reshape(-1), lambda: np.zeros(()),
        lambda: array.astype(str),
        lambda: array.astype(np.complex64), lambda: array.astype(np.float16),
        lambda: np.where(array == first, np.nan, array),
        lambda: np.where(array == first, 1e300, array), lambda: np.where(array == first, second, array),
        lambda: array[::-1],
        lambda: np.zeros((0, *array.shape)), lambda: np.tile(array, (2,) * max(1, array.ndim)),
        lambda: np.zeros(3_000_000),
    )  # fmt: skip
    with np.errstate(all="ignore"), contextlib.suppress(TypeError, ValueError):
        arrays[name] = one_of(rng, changes)()
    if rng.random() < 0.1:
        del arrays[name]
    if rng.random() < 0.05:
        arrays["more"] = np.zeros(3)
    np.savez_compressed(path, **arrays)
    if rng.random() < 0.1:  # a member that says of itself what is not so
        header = io.BytesIO()
        np.lib.format.write_array_header_1_0(header, {"descr": "<f8", "fortran_order": False, "shape": (10**12,)})
        with zipfile.ZipFile(path, "a") as file:
            file.writestr(f"{name}.npy", header.getvalue())


def _states(samples: Path, here: Path, rng: Generator) -> Attempt:
    shutil.copytree(samples / "run", here / "run")
    _arrays(here / "run" / "states.npz", rng)
    return _read(here, rng)


def _study(samples: Path, here: Path, rng: Generator, again: tuple[str, ...]) -> Attempt:
    """Change one file of a study's folder, or lose it, or put another in its place; then do the study again."""
    shutil.copytree(samples / "study", here / "study")
    parts = sorted(path for path in (here / "study").rglob("*") if path.is_file() and path.suffix != ".png")
    path = one_of(rng, parts)
    change = rng.random()
    if change < 0.1:
        path.unlink()
    elif change < 0.25:
        shutil.copy(one_of(rng, parts), path.parent / "copied")
        (path.parent / "copied").replace(path)
    elif path.suffix in (".npz",):
        _arrays(path, rng)
    elif path.suffix in (".npy",):
        path.write_bytes(mutated_binary(path.read_bytes(), rng))
    else:
        path.write_bytes(mutated(path.read_bytes(), rng))
    return command(*again, "--out", "study")


def _rollout(samples: Path) -> None:
    main(["rollout", *QUICK, "--record", "states", "--out", str(samples / "study"), "--json"])


def _rollout_folder(samples: Path, here: Path, rng: Generator) -> Attempt:
    return _study(samples, here, rng, ("rollout", *QUICK, "--record", "states"))


def _comparison(samples: Path) -> None:
    main(["compare", *COMPARED, "--workers", "1", "--out", str(samples / "study")])


def _comparison_folder(samples: Path, here: Path, rng: Generator) -> Attempt:
    return _study(samples, here, rng, ("compare", *COMPARED, "--workers", "1"))


# -- bags


def _bags(samples: Path) -> None:
    from bag_worlds import SECOND, robot_odometry, robot_scan, write_bag

    entries = []
    for i in range(5):
        time = SECOND + i * SECOND // 10
        entries.append(("/scan", time, robot_scan([1.0 + 0.1 * i] * 41, time=time)))
        entries.append(("/odom", time + 1, robot_odometry(time, x=0.1 * i, speed=1.0)))
    for storage in ("MCAP", "SQLITE3"):
        write_bag(samples / storage.lower(), entries, storage=storage)


def _bag(samples: Path, here: Path, rng: Generator) -> Attempt:
    name = one_of(rng, ("mcap", "sqlite3"))
    shutil.copytree(samples / name, here / "bag")
    path = one_of(rng, sorted((here / "bag").iterdir()))
    content = path.read_bytes()
    path.write_bytes(mutated(content, rng) if path.suffix == ".yaml" else mutated_binary(content, rng))
    return command("replay-scans", "bag" if rng.random() < 0.7 else path, "--out", "commands.csv")


def _messages(samples: Path, here: Path, rng: Generator) -> Attempt:
    from bag_worlds import SECOND, robot_odometry, robot_scan, write_bag

    odd = (0.0, -1.0, np.nan, np.inf, -np.inf, 1e30, 1e-30, 0.1, 6.3)
    entries = []
    for i in range(4):
        usual = SECOND * (i + 1)
        time = usual if rng.random() < 0.8 else int(one_of(rng, (0, i, SECOND - i, 2**31 * SECOND - 1)))
        ranges = rng.uniform(0.0, 12.0, int(41 if rng.random() < 0.9 else one_of(rng, (0, 1, 2, 40, 1081))))
        ranges[rng.random(len(ranges)) < 0.3] = one_of(rng, odd)
        names = ("angle_min", "angle_max", "angle_increment", "time_increment", "scan_time", "range_min", "range_max")
        values = {name: float(one_of(rng, odd)) for name in names if rng.random() < 0.02}
        entries.append(("/scan", usual, robot_scan(ranges, time=time, **values)))
        pose = {name: float(one_of(rng, odd)) for name in ("x", "y", "yaw", "speed") if rng.random() < 0.1}
        if not np.isfinite(pose.get("yaw", 0.0)):
            del pose["yaw"]
        entries.append(("/odom", usual + 1, robot_odometry(time, **pose)))
    write_bag(here / "bag", entries)
    return command("replay-scans", "bag", "--out", "commands.csv")


# -- Python's doors


def _environment(samples: Path, here: Path, rng: Generator) -> Attempt:
    from fg_mujoco.envs.gym_environment import F1TenthEnv

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

    return _ignore_refusal(steps)


def _live_view(samples: Path, here: Path, rng: Generator) -> Attempt:
    from fg_mujoco.viz.live.handshake import is_own

    own = ("localhost:8080", "127.0.0.1:8080", "[::1]:8080")
    host = one_of(rng, own)
    hosts = [_as_text(mutated(one_of(rng, own).encode(), rng)) for _ in range(int(rng.integers(0, 3)))]
    origins = [_as_text(mutated(f"http://{host}".encode(), rng)) for _ in range(int(rng.integers(0, 3)))]

    def check() -> int:
        if is_own(hosts, origins, frozenset({"0.0.0.0", "robot"})) and origins:
            assert (len(hosts) == 1 and origins == [f"http://{hosts[0]}"]) or origins[
                0
            ].lower() == f"http://{hosts[0].lower()}"
        assert not is_own([host], ["http://evil.example"], frozenset())
        assert is_own([host], [f"http://{host}"], frozenset())
        return 0

    return check


def _as_text(content: bytes) -> str:
    return content.decode("utf-8", errors="surrogateescape")


DOORS = {
    "track_csv": Door(attempt=_track_csv, prepare=_ring),
    "map_yaml": Door(attempt=_map_yaml, prepare=_ring),
    "map_image": Door(attempt=_map_image, prepare=_ring),
    "track_name": Door(attempt=_track_name, prepare=_ring),
    "planner_settings": Door(attempt=_planner_settings, prepare=_ring),
    "planner_file": Door(attempt=_planner_file),
    "raceline": Door(attempt=_raceline, prepare=_ring),
    "scans": Door(attempt=_scans),
    "vehicle": Door(attempt=_vehicle),
    "settings_file": Door(attempt=_settings_file),
    "command_line": Door(attempt=_command_line, prepare=_run),
    "run_summary": Door(attempt=_summary, prepare=_run),
    "run_states": Door(attempt=_states, prepare=_run),
    "run_telemetry": Door(attempt=_run_file("telemetry.csv"), prepare=_run),
    "run_scene": Door(attempt=_run_file("scene.xml"), prepare=_run),
    "rollout_folder": Door(attempt=_rollout_folder, prepare=_rollout),
    "comparison_folder": Door(attempt=_comparison_folder, prepare=_comparison),
    "bag": Door(attempt=_bag, prepare=_bags),
    "bag_messages": Door(attempt=_messages),
    "environment": Door(attempt=_environment),
    "live_view": Door(attempt=_live_view),
}
"""Every way in, by its name."""
