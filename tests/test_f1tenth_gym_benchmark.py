"""What benchmarks/f1tenth_gym.py makes of a checkout: here a stand-in whose step takes a known time."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from map_oracles import draw_map, ring

SCRIPT = Path(__file__).parent.parent / "benchmarks" / "f1tenth_gym.py"
if not SCRIPT.exists():
    pytest.skip("not a checkout of the repository", allow_module_level=True)

STAND_IN = """
import math
import time

import numpy as np


class Simulator:
    def __init__(self, params, num_agents, seed, time_step):
        assert num_agents == 1 and time_step == 0.01
        self.wheelbase = params["lf"] + params["lr"]

    def set_map(self, map_path, map_ext):
        assert map_path.endswith(".yaml") and map_ext == ".png"

    def reset(self, poses):
        self.x, self.y, self.heading = poses[0]

    def step(self, control_inputs):
        began = time.perf_counter()
        steering, speed = control_inputs[0]
        self.x += 0.01 * speed * math.cos(self.heading)
        self.y += 0.01 * speed * math.sin(self.heading)
        self.heading += 0.01 * speed * math.tan(steering) / self.wheelbase
        while time.perf_counter() - began < 1e-3:
            pass
        pose = {"poses_x": [self.x], "poses_y": [self.y], "poses_theta": [self.heading]}
        return pose | {"collisions": np.zeros(1)}
"""


def run(*options):
    return subprocess.run([sys.executable, str(SCRIPT), *map(str, options)], capture_output=True, text=True)


def test_both_simulators_drive_a_lap_in_turns(tmp_path):
    draw_map(tmp_path, ring())
    package = tmp_path / "checkout" / "gym" / "f110_gym" / "envs"
    package.mkdir(parents=True)
    for folder in (package, package.parent):  # neither is run, for they import gym and pyglet
        (folder / "__init__.py").write_text("raise ImportError", encoding="utf-8")
    (package / "base_classes.py").write_text(STAND_IN, encoding="utf-8")
    figures = tmp_path / "figures.json"
    done = run("--gym", tmp_path / "checkout", "--map", tmp_path / "drawn.yaml", "--rounds", 1, "--json", figures)
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


def test_a_folder_without_the_simulator_is_refused(tmp_path):
    draw_map(tmp_path, ring())
    done = run("--gym", tmp_path, "--map", tmp_path / "drawn.yaml")
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1
    assert "base_classes.py; accepted: a checkout of f1tenth_gym v1.0" in done.stderr
