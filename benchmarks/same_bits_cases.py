"""Collects what `same_bits.py` compares: runs its cases in the fg_mujoco of this interpreter, and writes a JSON file.

    python benchmarks/same_bits_cases.py OUT.json [--quick] [--only GROUP ...] [--within CHECKOUT] [--label TEXT]

`same_bits.py` runs this file by its path under the interpreter of each checkout, in an empty folder. The file must
therefore work in checkouts from before and after a refactoring. It uses names of `fg_mujoco` itself. Where a name or a
place may change, the tables below list the spellings, and the first one that exists is used.

A case returns facts: numbers and words in the clear where a reader wants them, a digest of the bits of each array.
"""

from __future__ import annotations

import argparse
import csv
import hashlib
import importlib
import importlib.util
import inspect
import json
import pkgutil
import platform
import runpy
import subprocess
import sys
import tempfile
import time
import warnings
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

import fg_mujoco as fg

SPELLINGS = {  # of a setting: the first one that a signature has is used
    "changes": ("changes", "car_changes", "vehicle_changes", "overrides", "car"),
    "start": ("start", "begin"),
    "time_limit": ("duration", "time_limit"),
    "center_of_gravity_height": ("center_of_gravity_height", "cog_height"),
}
CLASSES = {  # of a setting that is given as a mapping: the first one that fg_mujoco has is made of it
    "effects": ("LidarEffects",),
    "changes": ("CarChanges", "VehicleChanges", "CarOverrides", "VehicleOverrides"),
    "start": ("Start",),
}
HAS_SETUP = hasattr(fg, "Setup")  # settings are spelled alike at every function
TRACKS = ("chicanes", "fast", "hairpins", "l_corridor", "oval", "tight")
PLANNERS = (
    "disparity_extender", "disparity_selection", "follow_the_gap", "gap_finder", "pure_pursuit", "threshold_gap",
    "wall_follow", "weighted_gap", "widest_gap",
)  # fmt: skip
SCENES = ("crossing_box:5", "slow_leader:2", "cylinder_field:3", "wrong_side_chicane:4", "dead_end:5")
FIGURES = (  # of the summary of a race
    "end_reason", "lap_times_s", "laps_completed", "finished", "collisions", "sim_time_s", "max_slide_m_s",
    "slide_time_fraction", "mean_speed_m_s", "max_speed_m_s",
)  # fmt: skip
TICKS = 40  # in a second
WALL_TIMES = ("wall_time", "realtime", "per_second")  # parts of the names of columns that differ from run to run
OWN_PLANNER = """
from fg_mujoco.messages import DriveCommand


class RoomierSide:
    def __init__(self, max_speed=8.0):
        self.speed = min(max_speed, 2.0)

    def reset(self):
        pass

    def __call__(self, scan, odometry):
        ranges = scan.ranges.clip(0.0, 6.0)
        half = len(ranges) // 2
        room = ranges[half:].mean() - ranges[:half].mean()
        return DriveCommand(steering_angle=min(max(0.25 * room, -0.4), 0.4), speed=self.speed)
"""

Facts = dict[str, Any]


@dataclass(frozen=True, kw_only=True)
class Case:
    """Something to run in both checkouts."""

    name: str  # GROUP/...
    run: Callable[[], Facts]
    quick: bool = False  # whether --quick has it

    @property
    def group(self) -> str:
        """The first part of the name."""
        return self.name.partition("/")[0]


# Races


def call(function: Callable[..., Any], *arguments: Any, **settings: Any) -> Any:
    """Call a function or class of fg_mujoco, with each setting under the spelling that its signature has."""
    known = inspect.signature(function).parameters
    given = {}
    for name, value in settings.items():
        if name in CLASSES and isinstance(value, dict):
            kind = next(getattr(fg, kind) for kind in CLASSES[name] if hasattr(fg, kind))
            value = call(kind, **value)
        given[next((s for s in SPELLINGS.get(name, ()) if s in known), name)] = value
    return function(*arguments, **given)


def race(track: Any, planner: Any = "gap_finder", **settings: Any) -> Facts:
    return race_facts(call(fg.race, track, planner, **settings))


def race_facts(result: Any) -> Facts:
    summary, car = result.summary(), getattr(result, "car", result)
    return {
        "trajectory_sha256": result.trajectory_sha256,
        "states_by_second": [
            zlib.crc32(np.ascontiguousarray(result.states[first : first + TICKS], "<f8"))
            for first in range(0, len(result.states), TICKS)
        ],
        **{name: summary[name] for name in FIGURES if name in summary},
        "telemetry": {name: digest(car.column(name)) for name in fg.TELEMETRY},
    }


def circuits() -> Iterator[Case]:
    """One lap by each planner on each bundled circuit."""
    for track in TRACKS:
        for planner in PLANNERS:
            quick = track == "oval" or planner == "gap_finder"
            yield Case(name=f"circuits/{track}/{planner}", run=partial(race, track, planner, laps=1), quick=quick)


def scenes() -> Iterator[Case]:
    """Five scenes, two of them with moving obstacles."""
    for scene in SCENES:
        for planner in ("gap_finder", "disparity_extender"):
            run = partial(race, f"scene:{scene}", planner)
            yield Case(name=f"scenes/{scene}/{planner}", run=run, quick=planner == "gap_finder")


def random_tracks() -> Iterator[Case]:
    """Ten random tracks."""
    for seed in range(1, 11):
        run = partial(race, f"random:{seed}", PLANNERS[seed % len(PLANNERS)], laps=1)
        yield Case(name=f"random/{seed}", run=run, quick=seed <= 2)


def lidar() -> Iterator[Case]:
    """What a LiDAR does to a scan, one effect after the other and all together; and the other back end."""
    every = {"range_noise_std": 0.02, "dropout_probability": 0.05, "latency": 0.03, "motion_distortion": True}
    for name, value in every.items():
        run = partial(race, "hairpins", laps=1, seed=3, effects={name: value})
        yield Case(name=f"lidar/{name}", run=run, quick=name == "latency")
    yield Case(name="lidar/no_return", run=partial(race, "fast", laps=1, effects={"no_return": "range_max"}))
    for track in ("oval", "scene:crossing_box:6"):
        run = partial(race, track, "follow_the_gap", laps=1, seed=4, effects=every)
        yield Case(name=f"lidar/all/{track}", run=run, quick=track == "oval")
    yield Case(name="lidar/rangefinder", run=partial(race, "l_corridor", laps=1, lidar="rangefinder"))


def cars() -> Iterator[Case]:
    """Cars that differ from the bundled one, tires that slide, and whatever else a race can be given."""
    changes = {
        "mass": {"mass": 4.6},
        "cog_height": {"center_of_gravity_height": 0.09},
        "gains": {"steering_gain": 0.8, "speed_gain": 1.2},
        "command_delay": {"command_delay": 0.03},
        "mu": {"mu": 0.8},
        "all": {
            "mass": 3.2, "center_of_gravity_height": 0.06, "steering_gain": 1.1, "speed_gain": 0.9,
            "command_delay": 0.02, "mu": 0.9,
        },
    }  # fmt: skip
    for name, values in changes.items():
        run = partial(race, "fast", laps=1, changes=values)
        yield Case(name=f"cars/changes/{name}", run=run, quick=name == "all")
    for name, settings in {
        "known": {"mu": 0.6, "planner_mu": 0.6},
        "believed": {"mu": 0.6, "planner_mu": 1.0489},
        "slides": {"mu": 0.5, "planner_mu": float("inf"), "max_speed": 12.0},
    }.items():
        yield Case(name=f"cars/mu/{name}", run=partial(race, "oval", laps=1, **settings), quick=name == "slides")
    yield Case(name="cars/obstacles", run=partial(race, "tight", laps=2, obstacles=4, obstacle_seed=5), quick=True)
    yield Case(name="cars/given_obstacles", run=given_obstacles)
    start = {"s": 12.0, "offset": 0.2, "heading": 0.15, "speed": 3.0}
    yield Case(name="cars/start", run=partial(race, "hairpins", "widest_gap", laps=1, start=start), quick=True)
    yield Case(name="cars/laps", run=partial(race, "oval", "pure_pursuit", laps=4))
    yield Case(name="cars/time_limit", run=partial(race, "fast", time_limit=4.0))
    settings = {"lookahead": 8.0, "clearance": 0.25}
    yield Case(name="cars/planner_settings", run=partial(race, "chicanes", laps=1, planner_settings=settings))
    yield Case(name="cars/own_planner/file", run=partial(own_planner, by_name=True))
    yield Case(name="cars/own_planner/object", run=partial(own_planner, by_name=False), quick=True)
    yield Case(name="cars/map", run=on_map)


def given_obstacles() -> Facts:
    placed = [fg.load_track("oval").start_pose(s, offset)[:2] for s, offset in ((10.0, 0.5), (20.0, -0.5))]
    box = fg.Box(x=placed[0][0], y=placed[0][1], length=0.5, width=0.3, heading=0.4)
    return race("oval", laps=1, obstacles=(box, fg.Cylinder(x=placed[1][0], y=placed[1][1], radius=0.15)))


def own_planner(*, by_name: bool) -> Facts:
    path = new_folder() / "own_planner.py"
    path.write_text(OWN_PLANNER, encoding="utf-8")
    planner = f"{path}:RoomierSide" if by_name else runpy.run_path(str(path))["RoomierSide"]()
    return race("oval", planner, laps=1, time_limit=40.0)


def on_map() -> Facts:
    path = new_folder() / "oval.yaml"
    fg.export_track(fg.load_track("oval"), path)
    return race(str(path), laps=1)


# Many worlds


def rollouts() -> Iterator[Case]:
    """Two rollouts of 64 worlds, and one by the command."""
    first = {
        "mu": (0.6, 1.2), "mass": (3.0, 4.5), "start_s": (0.0, 30.0), "start_offset": (-0.2, 0.2),
        "start_speed": (0.0, 2.0), "lidar_noise": (0.0, 0.03), "planner.lookahead": [8.0, 10.0],
        "planner.clearance": (0.1, 0.2),
    }  # fmt: skip
    second = {
        "cog_height": (0.06, 0.09), "steering_gain": (0.8, 1.2), "speed_gain": (0.8, 1.2),
        "command_delay": (0.0, 0.05), "lidar_dropout": (0.0, 0.1), "start_heading": (-0.2, 0.2),
        "planner_mu": (0.7, 1.2), "max_speed": [5.0, 8.0], "obstacles": "0:3",
    }  # fmt: skip
    run = partial(rollout, "oval", "gap_finder", n=64, seed=1, randomize=first, time_limit=10.0, workers=1)
    yield Case(name="rollouts/mu_mass_start_noise_planner", run=run, quick=True)
    tracks = ["hairpins", "random:3"]
    chunks: dict[str, Any] = {"executor": fg.Executor(chunk=10)} if HAS_SETUP else {"chunk": 10}
    run = partial(
        rollout, tracks, "disparity_extender", n=64, seed=2, randomize=second, time_limit=8.0, workers=2, **chunks
    )
    yield Case(name="rollouts/car_lidar_obstacles_two_tracks", run=run)
    options = ["--track", "tight", "--n", "12", "--laps", "1", "--randomize", "mu=0.7:1.1", "--workers", "1"]
    yield Case(name="rollouts/command", run=partial(command, "rollout", *options))


def rollout(tracks: Any, planner: str, **settings: Any) -> Facts:
    result = call(fg.rollout, tracks, planner, record="states", **settings)
    worlds = range(len(result))
    telemetry = np.concatenate([result.telemetry(world) for world in worlds])
    return {
        "states": [digest(result.states(world)) for world in worlds],
        "ctrl": [digest(result.ctrl(world)) for world in worlds],
        "columns": {name: digest(result[name]) for name in result.names},
        "lap_times_s": digest(result.lap_times_s),
        "telemetry": {name: digest(values) for name, values in zip(fg.TELEMETRY, telemetry.T, strict=True)},
    }


# Environments, and the simulation that is stepped by hand


def environments() -> Iterator[Case]:
    """Twenty episodes by Gymnasium, six by dm_env, two of f1tenth_gym's interface, and `Simulation` by hand."""
    for name, settings in {
        "oval": {"track": "oval", "beam_step": 10},
        "noise_obstacles": {
            "track": "hairpins", "obstacles": 5, "time_limit": 15.0, "speed_range": (0.0, 4.0),
            "normalised_actions": True, "effects": {"range_noise_std": 0.02, "latency": 0.03},
        },
    }.items():  # fmt: skip
        run = partial(gymnasium_episodes, settings, 5)
        yield Case(name=f"environments/gymnasium/{name}", run=run, quick=name == "noise_obstacles")
    for name, settings in {
        "next_step": {"track": "tight", "obstacles": 5, "time_limit": 12.0, "autoreset_mode": "NextStep"},
        "same_step": {
            "track": "scene:slow_leader:1", "beam_step": 20, "autoreset_mode": "SameStep",
            "effects": {"range_noise_std": 0.01, "dropout_probability": 0.02},
        },
    }.items():  # fmt: skip
        run = partial(vector_episodes, settings, 5)
        yield Case(name=f"environments/vector/{name}", run=run, quick=name == "next_step")
    for task, settings in {
        "race": {"track": "oval", "time_limit": 8.0},
        "time_trial": {"track": "tight", "time_limit": 8.0, "flat_observation": True},
        "obstacles": {"track": "fast", "time_limit": 8.0, "effects": {"range_noise_std": 0.02}},
    }.items():
        run = partial(dm_env_episodes, task, settings, 2)
        yield Case(name=f"environments/dm_env/{task}", run=run, quick=task == "race")
    yield Case(name="environments/f110", run=f110_episodes, quick=True)
    yield Case(name="environments/simulation", run=by_hand, quick=True)


class Record:
    """Digests of values that come one after the other, by name."""

    def __init__(self) -> None:
        self._digests: dict[str, Any] = {}

    def add(self, name: str, value: Any) -> None:
        """Add a value, or those of a mapping."""
        if isinstance(value, dict):
            for key, part in value.items():
                self.add(f"{name} {key}", part)
        else:
            self._digests.setdefault(name, hashlib.sha256()).update(as_bytes(value))

    def facts(self) -> Facts:
        """Return what was added, by name."""
        return {name: made.hexdigest()[:16] for name, made in self._digests.items()}


def steer(scan: Any, rng: np.random.Generator) -> Any:
    """Return actions (..., 2) [rad, m/s] for scans (..., beams) [m]: to where there is more room, with some noise."""
    near = np.minimum(np.asarray(scan, np.float64), 6.0)
    half = near.shape[-1] // 2
    room = near[..., half:].mean(axis=-1) - near[..., :half].mean(axis=-1)
    noise = rng.normal(size=(2, *room.shape))
    return np.stack((0.25 * room + 0.05 * noise[0], 2.5 + 0.5 * noise[1]), axis=-1).astype(np.float32)


def gymnasium_episodes(settings: Facts, count: int) -> Facts:
    import gymnasium

    env = gymnasium.make(gymnasium_id(), disable_env_checker=True, **settings)
    facts, rng = {}, np.random.default_rng(7)
    for episode in range(count):
        record, steps, over, reward = Record(), 0, False, 0.0
        observation, info = env.reset(seed=11) if episode == 0 else env.reset()
        record.add("first observation", observation)
        while not over and steps < 2000:
            observation, reward, terminated, truncated, info = env.step(steer(observation["scan"], rng))
            for name, value in {
                "observation": observation, "reward": reward, "terminated": terminated, "truncated": truncated,
                "info": info,
            }.items():  # fmt: skip
                record.add(name, value)
            over, steps = terminated or truncated, steps + 1
        facts[f"episode {episode}"] = {"steps": steps, "end_reason": info.get("end_reason"), **record.facts()}
    env.close()
    return facts


def vector_episodes(settings: Facts, count: int) -> Facts:
    import gymnasium

    envs = gymnasium.make_vec(gymnasium_id(), num_envs=4, **settings)
    record, ends, rng = Record(), [], np.random.default_rng(8)
    observations, infos = envs.reset(seed=12)
    record.add("first observations", observations)
    steps = 0
    while len(ends) < count and steps < 4000:
        observations, rewards, terminated, truncated, infos = envs.step(steer(observations["scan"], rng))
        for name, value in {
            "observations": observations, "rewards": rewards, "terminated": terminated, "truncated": truncated,
            "infos": infos,
        }.items():  # fmt: skip
            record.add(name, value)
        steps += 1
        ends += [[steps, world] for world in np.flatnonzero(terminated | truncated).tolist()]
    envs.close()
    return {"steps": steps, "ends": ends, **record.facts()}


def dm_env_episodes(task: str, settings: Facts, count: int) -> Facts:
    env = in_module("load", "task", "environment", ".envs")(task=task, seed=5, **settings)
    facts, rng = {}, np.random.default_rng(9)
    for episode in range(count):
        record, steps, step = Record(), 0, env.reset()
        while not step.last() and steps < 1000:
            seen = dict(step.observation)
            scan = seen["scan"] if "scan" in seen else seen["observations"]  # of a flat one it is the most
            step = env.step(steer(scan, rng))
            for name, value in {
                "observation": dict(step.observation), "reward": step.reward, "discount": step.discount
            }.items():  # fmt: skip
                record.add(name, value)
            steps += 1
        facts[f"episode {episode}"] = {"steps": steps, **record.facts()}
    return facts


def f110_episodes() -> Facts:
    env = in_module("make", "name", "f110", "gym2d")("f110_gym:f110-v0", map="oval", num_agents=1)
    facts, rng = {}, np.random.default_rng(10)
    for episode, y in enumerate((0.0, 0.2)):
        record, steps = Record(), 0
        observation, reward, done, info = env.reset(np.array([[0.0, y, 0.0]]))
        while not done and steps < 600:
            observation, reward, done, info = env.step(steer(observation["scans"], rng).astype(np.float64))
            for name, value in {"observation": observation, "reward": reward, "done": done, "info": info}.items():
                record.add(name, value)
            steps += 1
        facts[f"episode {episode}"] = {"steps": steps, **record.facts()}
    return facts


def by_hand() -> Facts:
    """Steps a `Simulation` with a LiDAR that has noise and is late, round moving obstacles too."""
    facts = {}
    for track in ("tight", "scene:crossing_box:2"):
        effects = fg.LidarEffects(range_noise_std=0.01, latency=0.05)
        simulation, record = fg.Simulation(fg.World(track), effects=effects, seed=6), Record()
        scan, odometry = simulation.reset()
        for tick in range(160):
            command = fg.DriveCommand(steering_angle=0.2 * float(np.sin(0.1 * tick)), speed=0.02 * tick)
            scan, odometry = simulation.step(command)
            record.add("scan", {"stamp": scan.stamp, "ranges": scan.ranges})
            for name in ("stamp", "speed", "steering_angle", "angular_velocity", "linear_acceleration", "pose"):
                record.add(f"odometry {name}", getattr(odometry, name))
            record.add("state", simulation.state)
            record.add("slip", simulation.slip.values[:4])  # older checkouts have no more
            record.add("crashed", simulation.crashed)
        facts[track] = record.facts()
    return facts


def gymnasium_id() -> str:
    """Return the environment's id, once the module that registers it is imported, wherever that lies."""
    import gymnasium

    for _ in modules("gym", ".envs"):
        ids = [name for name in gymnasium.registry if name.startswith("fg_mujoco/F1Tenth")]
        if ids:
            return str(ids[0])
    raise LookupError("no module of fg_mujoco registers a Gymnasium environment fg_mujoco/F1Tenth...")


def in_module(name: str, parameter: str, *places: str) -> Callable[..., Any]:
    """Return the function of a name, with a parameter of a name, of a module whose own name has one of `places`."""
    for module in modules(*places):
        function = getattr(module, name, None)
        if inspect.isfunction(function) and parameter in inspect.signature(function).parameters:
            return function
    raise LookupError(f"no function {name} with a parameter {parameter} in the modules {', '.join(places)}")


def modules(*places: str) -> Iterator[Any]:
    """Import one after the other the modules of fg_mujoco and its add-ons whose names have one of `places`."""
    addons = importlib.util.find_spec("fg_mujoco.addons")
    walks = [(fg.__path__, "fg_mujoco.")]
    walks += [(addons.submodule_search_locations, "fg_mujoco.addons.")] if addons is not None else []
    for found in (each for paths, prefix in walks for each in pkgutil.walk_packages(paths, prefix)):
        if any(place in found.name for place in places):
            try:
                yield importlib.import_module(found.name)
            except (ImportError, fg.MissingExtraError):  # of an extra that is not installed
                continue


# What is on disk, and the command


def folders() -> Iterator[Case]:
    """Run folders: written and replayed, by functions and by commands; and a comparison."""
    yield Case(name="folders/replay/circuit", run=partial(replay, "oval"), quick=True)
    yield Case(name="folders/replay/moving", run=partial(replay, "scene:crossing_box:1"), quick=True)
    delayed = {"command_delay": 0.03, "mass": 4.0}
    yield Case(name="folders/replay/changed_car", run=partial(replay, "oval", changes=delayed))
    options = ["--track", "oval", "--laps", "1", "--obstacles", "2", "--lidar-noise", "0.01", "--lidar-latency", "0.03"]
    yield Case(name="folders/command", run=partial(command, "race", *options), quick=True)
    yield Case(name="folders/comparison", run=comparison)


def replay(track: str, **settings: Any) -> Facts:
    folder = new_folder() / "run"
    fg.write_run(call(fg.race, track, laps=1, **settings), folder, picture=False)
    run, report = fg.read_run(folder), fg.replay(folder)
    arrays = {name: digest(getattr(run, name)) for name in ("time", "states", "ctrl")}
    return {"identical": report.identical, "ticks": report.ticks, "trajectory_sha256": report.trajectory_sha256} | {
        "arrays": arrays,
        "csv": csv_facts(folder),
    }


def comparison() -> Facts:
    """Runs a few of the runs of `compare`."""
    folder = new_folder() / "comparison"
    axes: dict[str, Any] = {"tracks": ["oval"], "scenes": ["dead_end", "slow_leader"], "seeds": (0, 1)}
    if HAS_SETUP:
        axes = {"track": ["oval", "scene:dead_end", "scene:slow_leader"], "seed": (0, 1)}
    if "pictures" in inspect.signature(fg.compare).parameters:
        axes["pictures"] = False
    found = fg.compare(
        ["gap_finder", "wall_follow[lookahead=8]"], **axes, laps=1, obstacles=2, lidar_noise=0.01, workers=1,
        out=folder, assist="full",
    )  # fmt: skip
    return {"trajectories": [row.trajectory_sha256 for row in found.rows]}


def command(*arguments: str) -> Facts:
    """Run the command `fg-mujoco` and return the facts of the CSVs in the folder that it writes."""
    folder = new_folder() / "out"
    done = subprocess.run(
        [sys.executable, "-m", "fg_mujoco", *arguments, "--out", str(folder)], capture_output=True, text=True
    )
    if done.returncode:
        raise RuntimeError(f"fg-mujoco {' '.join(arguments)} returned {done.returncode}: {done.stderr.strip()[-300:]}")
    return {"csv": csv_facts(folder)}


def friction() -> Iterator[Case]:
    """A few cells of the friction lab."""
    for name, some in {"skidpad": "--steering=0.1", "step": "--steering=0.1", "braking": "--steering=0.1",
                       "mismatch": "--planner-mu=0.5", "laps": "--track=oval"}.items():  # fmt: skip
        run = partial(command, "friction", name, some, "--workers", "1")
        yield Case(name=f"friction/{name}", run=run, quick=name == "braking")


def csv_facts(folder: Path) -> Facts:
    """Return a digest of each column of each CSV in a folder."""
    facts: Facts = {}
    for path in sorted(folder.rglob("*.csv")):
        with path.open(encoding="utf-8", newline="") as file:
            header, *rows = csv.reader(file)
        facts[path.relative_to(folder).as_posix()] = {
            name: digest(np.array([row[column] for row in rows]))
            for column, name in enumerate(header)
            if not any(part in name for part in WALL_TIMES)
        }
    return facts


# Collecting


def as_bytes(values: Any) -> bytes:
    """Return the bits of an array with its type and shape; of words and objects their text."""
    array = np.asarray(values)
    if array.dtype.kind in "OUS":
        return repr(array.tolist()).encode()
    return f"{array.dtype.str}{array.shape}".encode() + np.ascontiguousarray(array).tobytes()


def digest(values: Any) -> str:
    """Return 16 hexadecimal digits of the SHA-256 of an array."""
    return hashlib.sha256(as_bytes(values)).hexdigest()[:16]


def new_folder() -> Path:
    """Return a new folder in the working folder."""
    return Path(tempfile.mkdtemp(dir=".")).resolve()


def all_cases() -> list[Case]:
    """Return the cases of all groups, in their order."""
    groups = (circuits, scenes, random_tracks, lidar, cars, rollouts, environments, folders, friction)
    return [case for group in groups for case in group()]


def made_with() -> dict[str, Any]:
    """Return what else the bits depend on."""
    made: dict[str, Any] = {"machine": platform.machine(), "cpu": cpu(), "python": platform.python_version()}
    for name in ("mujoco", "numpy", "gymnasium", "dm-control"):
        try:
            made[name] = version(name)
        except PackageNotFoundError:
            made[name] = None
    return made | {"cases_sha256": hashlib.sha256(Path(__file__).read_bytes()).hexdigest()[:16]}


def cpu() -> str:
    """Return the name of the processor, where the system tells it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), "")


def commit(checkout: Path) -> str:
    """Return the commit of a checkout, "-dirty" behind it where files differ; "" where there is none."""
    asked = ["git", "-C", str(checkout), "describe", "--always", "--dirty", "--exclude=*"]
    try:
        return subprocess.run(asked, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return ""


def collect(cases: list[Case], label: str) -> dict[str, Any]:
    """Run the cases and return their facts; progress is shown on a terminal."""
    checkout, terminal = Path(fg.__file__).resolve().parents[1], sys.stderr.isatty()
    facts: dict[str, Facts] = {}
    seconds: dict[str, float] = {}
    for number, case in enumerate(cases):
        if terminal:
            print(f"\r\x1b[K{label} {number}/{len(cases)} {case.name}", end="", file=sys.stderr, flush=True)
        started = time.perf_counter()
        try:
            facts[case.name] = case.run()
        except Exception as error:  # the other cases still say something
            facts[case.name] = {"error": " ".join(f"{type(error).__name__}: {error}".split())}
        seconds[case.group] = round(seconds.get(case.group, 0.0) + time.perf_counter() - started, 1)
    if terminal:
        print("\r\x1b[K", end="", file=sys.stderr, flush=True)
    return {
        "checkout": str(checkout),
        "commit": commit(checkout),
        "made_with": made_with(),
        "seconds": seconds,
        "cases": facts,
    }


def main() -> None:
    """Collect, and write the file."""
    cases = all_cases()
    groups = list(dict.fromkeys(case.group for case in cases))
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("out", type=Path, metavar="OUT.json")
    parser.add_argument("--quick", action="store_true", help="the cases that take seconds")
    parser.add_argument("--only", action="append", metavar="GROUP", help="this group; may be repeated")
    parser.add_argument("--within", type=Path, metavar="CHECKOUT", help="refuse an fg_mujoco from anywhere else")
    parser.add_argument("--label", default="", help="what the progress line begins with")
    options = parser.parse_args()
    imported = Path(fg.__file__).resolve()
    if options.within is not None and options.within.resolve() not in imported.parents:
        sys.exit(f"{sys.executable} imports {imported}; accepted: an interpreter that imports {options.within}")
    chosen = [case for case in cases if (case.quick or not options.quick) and case.group in (options.only or groups)]
    warnings.simplefilter("ignore")  # of dm_control on a machine without a display
    options.out.write_text(json.dumps(collect(chosen, options.label), indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
