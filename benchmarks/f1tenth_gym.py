"""How fast `fg_mujoco.f110` steps beside f1tenth_gym's own simulator: both drive a lap of one map, in turns.

    python benchmarks/f1tenth_gym.py --gym PATH --map MAP.yaml [--speed 3] [--rounds 5] [--json FILE]

PATH is your own checkout of f1tenth_gym v1.0, its main branch. Only its simulator is imported, which needs numba,
scipy, pillow and PyYAML, but neither gym nor pyglet. The map's image must have the name of its YAML file.

Both simulators advance one car by 10 ms a step and measure 1080 noisy beams after each step. One pure pursuit planner
follows the map's centreline in both. They take turns of 100 steps on one core, and only the time inside `step` counts:
the ratio is the median over the pairs of turns. After each lap, `race` drives one by gap_finder: 25 ms a tick, 1081
beams, and its factor counts the planner too. Its ratio is that of the times real time, the median over the laps.
"""

from __future__ import annotations

import importlib
import math
import sys
import time
import types
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from common import parser, report, stay_on_cores, table

import fg_mujoco as fg
from fg_mujoco import f110

STEP = 0.01  # [s]
TURN = 100  # steps
LOOKAHEAD, WHEELBASE = 0.9, 0.3302  # [m]
PACKAGE = Path("gym", "f110_gym", "envs")  # in a checkout
PARAMETERS = {
    "mu": 1.0489, "C_Sf": 4.718, "C_Sr": 5.4562, "lf": 0.15875, "lr": 0.17145, "h": 0.074, "m": 3.74, "I": 0.04712,
    "s_min": -0.4189, "s_max": 0.4189, "sv_min": -3.2, "sv_max": 3.2, "v_switch": 7.319, "a_max": 9.51, "v_min": -5.0,
    "v_max": 20.0, "width": 0.31, "length": 0.58,
}  # fmt: skip
"""Of the car of both: f1tenth_gym's defaults."""

Observation = dict[str, Any]


class WaypointFollower:
    """Pure pursuit at one speed along a closed line of waypoints.

    Args:
      waypoints: (n, 2) [m].
      speed: [m/s].
    """

    def __init__(self, waypoints: Any, speed: float) -> None:
        self._waypoints, self._speed = waypoints, speed
        spacing = float(np.median(np.hypot(*np.diff(waypoints, axis=0).T)))
        self._ahead = max(1, round(LOOKAHEAD / spacing))

    @property
    def start(self) -> Any:
        """The pose at the first waypoint, x, y, heading, shape (1, 3)."""
        (x, y), (next_x, next_y) = self._waypoints[:2]
        return np.array([[x, y, math.atan2(next_y - y, next_x - x)]])

    def plan(self, observation: Observation) -> Any:
        """Return steering angle and speed, shape (1, 2)."""
        x, y, heading = (observation[name][0] for name in ("poses_x", "poses_y", "poses_theta"))
        nearest = int(np.argmin(np.hypot(*(self._waypoints - (x, y)).T)))
        goal_x, goal_y = self._waypoints[(nearest + self._ahead) % len(self._waypoints)]
        left = math.cos(heading) * (goal_y - y) - math.sin(heading) * (goal_x - x)
        curvature = 2.0 * left / ((goal_x - x) ** 2 + (goal_y - y) ** 2)
        return np.array([[math.atan(WHEELBASE * curvature), self._speed]])


class Driven:
    """A simulator and the planner that drives it.

    Args:
      name: to be printed.
      reset: places the car and returns its first observation.
      step: takes an action (1, 2) and returns an observation.
    """

    def __init__(self, name: str, reset: Callable[[Any], Observation], step: Callable[[Any], Observation]) -> None:
        self.name, self._reset, self._step = name, reset, step

    def begin(self, planner: WaypointFollower) -> None:
        """Place the car at the first waypoint."""
        self._planner, self._observation = planner, self._reset(planner.start)

    def turn(self) -> float:
        """Drive some steps and return the time spent in them [s]."""
        spent = 0.0
        for _ in range(TURN):
            action = self._planner.plan(self._observation)
            started = time.perf_counter()
            self._observation = self._step(action)
            spent += time.perf_counter() - started
        if self._observation["collisions"].any():
            raise SystemExit(f"{self.name} has hit a wall; accepted: a --speed at which neither does")
        return spent


def theirs(checkout: Path, map_file: Path, extension: str) -> Driven:
    """Return f1tenth_gym's simulator as it ships: its own integrator and beams."""
    if not (file := checkout / PACKAGE / "base_classes.py").is_file():
        raise SystemExit(f"--gym: no file {file}; accepted: a checkout of f1tenth_gym v1.0")
    for name, folder in (("f110_gym", PACKAGE.parent), ("f110_gym.envs", PACKAGE)):
        package = types.ModuleType(name)  # in the place of its own, which imports gym and pyglet
        package.__path__ = [str(checkout / folder)]
        sys.modules[name] = package
    simulator_class = importlib.import_module("f110_gym.envs.base_classes").Simulator
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it says which integrator it takes
        simulator = simulator_class(PARAMETERS, 1, 12345, time_step=STEP)
    simulator.set_map(str(map_file), extension)

    def reset(pose: Any) -> Observation:
        simulator.reset(pose)
        return dict(simulator.step(np.zeros((1, 2))))

    return Driven("f1tenth_gym", reset, simulator.step)


def ours(map_file: Path, extension: str) -> Driven:
    """Return this simulator behind f1tenth_gym's interface."""
    env = f110.make(map=str(map_file.with_suffix("")), map_ext=extension, params=PARAMETERS, timestep=STEP)
    return Driven("fg_mujoco.f110", lambda pose: env.reset(pose)[0], lambda action: env.step(action)[0])


def measure(checkout: Path, map_file: Path, *, speed: float, rounds: int) -> dict[str, Any]:
    """Return the figures of the benchmark."""
    lines = map_file.read_text(encoding="utf-8").splitlines()
    extension = Path(next(line for line in lines if line.startswith("image:")).strip()).suffix
    course = fg.load_track(str(map_file))
    planner = WaypointFollower(course.centreline, speed)
    ways = [theirs(checkout, map_file, extension), ours(map_file, extension)]
    fg.race(str(map_file), laps=1, time_limit=1.0)
    for way in ways:  # kernels are read from disk
        way.begin(planner)
        way.turn()
    turns = math.ceil(course.length / (speed * STEP * TURN))
    times = np.empty((rounds, len(ways), turns))
    races = np.empty(rounds)
    for k in range(rounds):
        for way in ways:
            way.begin(planner)
        for turn in range(turns):
            for row, way in enumerate(ways):
                times[k, row, turn] = way.turn() / TURN
        races[k] = fg.race(str(map_file), laps=1).realtime_factor
    return {
        "map": map_file.stem,
        "speed_m_s": speed,
        "pairs": rounds * turns,
        "us_per_step": {way.name: 1e6 * float(np.median(times[:, row])) for row, way in enumerate(ways)},
        "us_per_step_least": {way.name: 1e6 * float(times[:, row].min()) for row, way in enumerate(ways)},
        "realtime_factor": {way.name: STEP / float(np.median(times[:, row])) for row, way in enumerate(ways)},
        "ratio": float(np.median(times[:, 0] / times[:, 1])),
        "race_realtime_factor": float(np.median(races)),
        "race_ratio": float(np.median(races * times[:, 0].mean(axis=1) / STEP)),
    }


def main() -> None:
    """Print the table."""
    arguments = parser(__doc__)
    arguments.add_argument("--gym", type=Path, required=True, metavar="PATH", help="a checkout of f1tenth_gym v1.0")
    arguments.add_argument("--map", type=Path, required=True, metavar="FILE", help="map_server YAML of a closed course")
    arguments.add_argument("--speed", type=float, default=3.0, help="of both cars [m/s], default 3")
    arguments.add_argument("--rounds", type=int, default=5, help="of one lap each, default 5")
    options = arguments.parse_args()
    stay_on_cores(1)
    figures = measure(options.gym.resolve(), options.map.resolve(), speed=options.speed, rounds=options.rounds)
    factors, least = figures["realtime_factor"], figures["us_per_step_least"]
    rows = [
        (name, f"{us:.0f}", f"{least[name]:.0f}", f"{factors[name]:.0f}") for name, us in figures["us_per_step"].items()
    ]
    text = (
        f"{figures['map']} at {options.speed:g} m/s, one car, one core, 1080 beams after each step of 10 ms\n\n"
        + table(("", "us per step, median", "least", "times real time"), rows)
        + f"\n\nf1tenth_gym's time over ours, median of {figures['pairs']} pairs of turns of {TURN} steps: "
        f"{figures['ratio']:.2f}\n\n`race` at 25 ms a tick, 1081 beams and planner: "
        f"{figures['race_realtime_factor']:.0f} times real time, {figures['race_ratio']:.2f} times f1tenth_gym's factor"
    )
    report(figures, text, options.json)


if __name__ == "__main__":
    main()
