"""What benchmarks/f1tenth_gym.py makes of a checkout: here a stand-in whose step takes a known time."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from map_oracles import draw_map, ring

SCRIPT = Path(__file__).parents[3] / "benchmarks" / "f1tenth_gym.py"
if not SCRIPT.exists():
    pytest.skip("not a checkout of the repository", allow_module_level=True)

STAND_IN = """
import math
import time

import numpy as np


class Simulator:
    def __init__(self, params, num_agents, seed, time_step):
        self.agents, self.time_step = num_agents, time_step
        self.wheelbase = params["lf"] + params["lr"]

    def set_map(self, map_path, map_ext):
        assert map_path.endswith(".yaml") and map_ext == ".png"

    def reset(self, poses):
        assert poses.shape == (self.agents, 3)
        self.poses = poses.copy()

    def step(self, control_inputs):
        began = time.perf_counter()
        for pose, (steering, speed) in zip(self.poses, control_inputs, strict=True):
            pose += self.time_step * speed * np.array(
                (math.cos(pose[2]), math.sin(pose[2]), math.tan(steering) / self.wheelbase)
            )
        time.sleep(max(1e-3 - (time.perf_counter() - began), 0.0))
        names = ("poses_x", "poses_y", "poses_theta")
        seen = dict(zip(names, self.poses.T.tolist(), strict=True))
        outside = (np.abs(self.poses[:, :2]) > 20.0).any(axis=1)
        return seen | {"collisions": outside, "scans": [np.full(1080, 2.0)] * self.agents}
"""


def run(*options):
    return subprocess.run([sys.executable, str(SCRIPT), *map(str, options)], capture_output=True, text=True)


def checkout(tmp_path):
    """Write a map and a stand-in for a checkout, and return the options that name them."""
    draw_map(tmp_path, ring())
    package = tmp_path / "checkout" / "gym" / "f110_gym" / "envs"
    package.mkdir(parents=True)
    for folder in (package, package.parent):  # neither is run, for they import gym and pyglet
        (folder / "__init__.py").write_text("raise ImportError", encoding="utf-8")
    (package / "base_classes.py").write_text(STAND_IN, encoding="utf-8")
    return "--gym", tmp_path / "checkout", "--map", tmp_path / "drawn.yaml"


def test_both_simulators_drive_a_lap_in_turns(tmp_path):
    figures = tmp_path / "figures.json"
    done = run(*checkout(tmp_path), "--rounds", 1, "--json", figures)
    assert done.returncode == 0, done.stderr
    assert "times real time" in done.stdout
    measured = json.loads(figures.read_text(encoding="utf-8"))
    assert measured["turns"] == 10  # 29 m at 3 m/s, 1 s a turn
    theirs, *ours = measured["ways"].values()
    assert theirs["us_per_step_least"] >= 1000.0
    assert theirs["ratio"] == 1.0
    for way, period in zip((theirs, *ours), (0.01, 0.01, 0.025), strict=True):
        assert way["realtime_factor"] == pytest.approx(1e6 * period / way["us_per_step"])
    for way in (*ours, measured["race"]):
        assert way["ratio"] == pytest.approx(way["realtime_factor"] / theirs["realtime_factor"], rel=0.5)
