"""How fast `fg_mujoco.f110` steps beside f1tenth_gym's own simulator: both drive a lap of one map, in turns.

    python benchmarks/f1tenth_gym.py --gym PATH --map MAP.yaml [--speed 3] [--rounds 5] [--json FILE]

PATH is your own checkout of f1tenth_gym v0.2, its main branch. Only its simulator is imported, which needs numba,
scipy, pillow and PyYAML, but neither gym nor pyglet. The map's image must have the name of its YAML file.

f1tenth_gym and `fg_mujoco.f110` advance one car by 10 ms a step and measure 1080 noisy beams after each; `Simulation`
advances it by 25 ms and measures 1081. One pure pursuit planner follows the map's centreline in all three. They take
turns of one simulated second on one core, and only the time inside `step` counts: a ratio is the median over the turns.
After each lap, `race` drives one by gap_finder, and its times real time counts the planner too: its ratio is the median
over the laps.
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
TURN = 1.0  # [s], simulated
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
      period: of a step [s].
      reset: places the car and returns its first observation.
      step: takes an action (1, 2) and returns an observation.
    """

    def __init__(
        self, name: str, period: float, reset: Callable[[Any], Observation], step: Callable[[Any], Observation]
    ) -> None:
        self.name, self.period, self._reset, self._step = name, period, reset, step

    def begin(self, planner: WaypointFollower) -> None:
        """Place the car at the first waypoint."""
        self._planner, self._observation = planner, self._reset(planner.start)

    def turn(self) -> float:
        """Drive for a turn and return the time spent in its steps [s]."""
        spent = 0.0
        for _ in range(round(TURN / self.period)):
            action = self._planner.plan(self._observation)
            started = time.perf_counter()
            self._observation = self._step(action)
            spent += time.perf_counter() - started
        if np.any(self._observation["collisions"]):
            raise SystemExit(f"{self.name} has hit a wall; accepted: a --speed at which none does")
        return spent


def theirs(checkout: Path, map_file: Path, extension: str) -> Driven:
    """Return f1tenth_gym's simulator as it ships: its own integrator and beams."""
    if not (file := checkout / PACKAGE / "base_classes.py").is_file():
        raise SystemExit(f"--gym: no file {file}; accepted: a checkout of f1tenth_gym v0.2")
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

    return Driven("f1tenth_gym", STEP, reset, simulator.step)


def ours(map_file: Path, extension: str) -> Driven:
    """Return this simulator behind f1tenth_gym's interface."""
    env = f110.make(map=str(map_file.with_suffix("")), map_ext=extension, params=PARAMETERS, timestep=STEP)
    return Driven("fg_mujoco.f110", STEP, lambda pose: env.reset(pose)[0], lambda action: env.step(action)[0])


def ours_at_25_ms(map_file: Path) -> Driven:
    """Return this simulator as it is stepped by hand, started at the map's own start."""
    simulation = fg.Simulation(fg.World(str(map_file)))

    def observation(sensed: tuple[fg.LaserScan, fg.Odometry]) -> Observation:
        x, y, heading = sensed[1].pose.tolist()
        return {"poses_x": [x], "poses_y": [y], "poses_theta": [heading], "collisions": simulation.crashed}

    def step(action: Any) -> Observation:
        ((steering_angle, speed),) = action.tolist()
        return observation(simulation.step(fg.DriveCommand(steering_angle=steering_angle, speed=speed)))

    return Driven("fg_mujoco.Simulation", simulation.period, lambda pose: observation(simulation.reset()), step)


def measure(checkout: Path, map_file: Path, *, speed: float, rounds: int) -> dict[str, Any]:
    """Return the figures of the benchmark."""
    lines = map_file.read_text(encoding="utf-8").splitlines()
    extension = Path(next(line for line in lines if line.startswith("image:")).strip()).suffix
    course = fg.load_track(str(map_file))
    planner = WaypointFollower(course.centreline, speed)
    ways = [theirs(checkout, map_file, extension), ours(map_file, extension), ours_at_25_ms(map_file)]
    fg.race(str(map_file), laps=1, time_limit=1.0)
    for way in ways:  # kernels are read from disk
        way.begin(planner)
        way.turn()
    turns = math.ceil(course.length / (speed * TURN))
    times = np.empty((rounds, len(ways), turns))  # [s] a simulated second
    races = np.empty(rounds)
    for k in range(rounds):
        for way in ways:
            way.begin(planner)
        for turn in range(turns):
            for row, way in enumerate(ways):
                times[k, row, turn] = way.turn() / TURN
        races[k] = fg.race(str(map_file), laps=1).realtime_factor
    figures = {
        way.name: {
            "us_per_step": 1e6 * way.period * float(np.median(times[:, row])),
            "us_per_step_least": 1e6 * way.period * float(times[:, row].min()),
            "realtime_factor": 1.0 / float(np.median(times[:, row])),
            "ratio": float(np.median(times[:, 0] / times[:, row])),
        }
        for row, way in enumerate(ways)
    }
    race = {"realtime_factor": float(np.median(races)), "ratio": float(np.median(races * times[:, 0].mean(axis=1)))}
    return {"map": map_file.stem, "speed_m_s": speed, "turns": rounds * turns, "ways": figures, "race": race}


def main() -> None:
    """Print the table."""
    arguments = parser(__doc__)
    arguments.add_argument("--gym", type=Path, required=True, metavar="PATH", help="a checkout of f1tenth_gym v0.2")
    arguments.add_argument("--map", type=Path, required=True, metavar="FILE", help="map_server YAML of a closed course")
    arguments.add_argument("--speed", type=float, default=3.0, help="of both cars [m/s], default 3")
    arguments.add_argument("--rounds", type=int, default=5, help="of one lap each, default 5")
    options = arguments.parse_args()
    stay_on_cores(1)
    figures = measure(options.gym.resolve(), options.map.resolve(), speed=options.speed, rounds=options.rounds)
    rows = [
        (name, *(f"{way[key]:.0f}" for key in ("us_per_step", "us_per_step_least", "realtime_factor")), way["ratio"])
        for name, way in figures["ways"].items()
    ]
    race = figures["race"]
    rows.append(("race, planner included", "", "", f"{race['realtime_factor']:.0f}", race["ratio"]))
    text = f"{figures['map']} at {options.speed:g} m/s, one car, one core, {figures['turns']} turns each\n\n" + table(
        ("", "us per step, median", "least", "times real time", "times f1tenth_gym's"), rows
    )
    report(figures, text, options.json)


if __name__ == "__main__":
    main()
