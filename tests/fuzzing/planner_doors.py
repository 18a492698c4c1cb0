"""Doors of planners: their names and settings, their files, their lines, and the scans that they are told."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
from numpy.random import Generator

import fg_mujoco as fg
from fg_mujoco.racing.planner_loading import bundled_names, make_controller

from .course_doors import ring
from .door import SHORT, Attempt, Door, as_text, command
from .mutations import mutated, one_of

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
    return command("race", f"--controller={as_text(mutated(one_of(rng, PLANNERS).encode(), rng))}", *SHORT)


VALUES = (
    "None", "0", "1", "True", "'a'", "b''", "[]", "()", "(0.0, 1.0)", "[0.1, 1.0, 2.0]", "{}", "float('nan')",
    "float('inf')", "-1e308",
    "10**400", "object()", "lambda *a: None", "scan", "odometry", "scan.ranges", "scan.ranges[:0]",
    "scan.ranges * 1j", "np.zeros(2)",
    "np.float32(1)", "np.array(['a', 'b'])", "np.array(None)", "np.ma.masked", "type", "Ellipsis", "iter([0, 0])",
    "(i for i in ())",
    "fg.DriveCommand(steering_angle=0.1, speed=1.0)", "fg.DriveCommand(steering_angle=9.0, speed=99.0)", "Odd()",
    "Odd", "1/0",
    "np.ctypeslib.as_array", "print('fg-mujoco: warning' + 'x' * 4000)",
    "__import__('warnings').warn('x' * 999)", "exec('raise Odd()')",
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


def hostile_scan(rng: Generator, stamp: float) -> fg.LaserScan:
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
        angle_max=0.5 * span,
        range_min=0.06,
        range_max=12.0,
        stamp=stamp,
    )


def _scans(samples: Path, here: Path, rng: Generator) -> Attempt:
    name = one_of(rng, [name for name in bundled_names() if name != "pure_pursuit"])
    planner = make_controller(name, car=fg.Vehicle.load("f1tenth").parameters, mu=0.9, max_speed=5.0)
    numbers = rng.choice([0.0, 0.0, 1.0, -5.0, 1e9, 3.0], size=15)

    def drive() -> int:
        planner.reset()
        for step in range(3):
            odometry = fg.Odometry(
                stamp=0.025 * step,
                speed=numbers[0],
                steering_angle=0.1 * numbers[1],
                angular_velocity=numbers[2:5],
                linear_acceleration=numbers[5:8],
                wheel_speeds=numbers[8:12],
                pose=numbers[12:],
            )
            command = planner(hostile_scan(rng, odometry.stamp), odometry)
            assert np.isfinite([command.steering_angle, command.speed]).all()
        return 0

    return drive


DOORS = {
    "planner_settings": Door(attempt=_planner_settings, prepare=ring),
    "planner_file": Door(attempt=_planner_file),
    "raceline": Door(attempt=_raceline, prepare=ring),
    "scans": Door(attempt=_scans),
}
