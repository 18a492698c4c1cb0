"""How fast `fg_mujoco.addons.gym2d` steps beside f1tenth_gym's own simulator: both drive a lap of one map, in turns.

    python benchmarks/f1tenth_gym.py --gym PATH --map MAP.yaml [--agents 2] [--timestep 0.02] [--json FILE]

PATH is your own checkout of f1tenth_gym 0.2.1, its main branch. Only its simulator is imported, which needs numba,
scipy, pillow and PyYAML, but neither gym nor pyglet. The map's image must have the name of its YAML file.

f1tenth_gym and our `gym2d` advance one car by 10 ms a step and measure 1080 noisy beams after each; `Simulation`
advances it by 25 ms and measures 1081. One pure pursuit planner follows the map's centreline in all three. They take
turns of one simulated second on one core, and only the time inside `step` counts: a ratio is the median over the turns.
After each lap, `race` drives one by gap_finder, and its times real time counts the planner too: its ratio is the median
over the laps. With `--agents` several cars follow each other in both, and only these two are compared; so they are with
another `--timestep`, of which the gym makes one step of its integrator and our `gym2d` one physics step for each
5 ms.
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
from fg_mujoco.addons import gym2d as f110

STEP = 0.01  # [s] unless another is asked for
GAP = 2.5  # [m] from car to car
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

    def starts(self, agents: int) -> Any:
        """Return poses at the first waypoint and behind it, x, y, heading, shape (agents, 3)."""
        along = np.hypot(*np.diff(self._waypoints, axis=0).T).cumsum()
        first = [0, *(-int(np.searchsorted(along, GAP * agent)) for agent in range(1, agents))]
        pairs = [(self._waypoints[i], self._waypoints[i + 1]) for i in first]
        return np.array([[*here, math.atan2(*(there - here)[::-1])] for here, there in pairs])

    def plan(self, observation: Observation) -> Any:
        """Return steering angle and speed of each car, shape (agents, 2)."""
        poses = zip(*(observation[name] for name in ("poses_x", "poses_y", "poses_theta")), strict=True)
        return np.array([self._command(*pose) for pose in poses])

    def _command(self, x: float, y: float, heading: float) -> tuple[float, float]:
        nearest = int(np.argmin(np.hypot(*(self._waypoints - (x, y)).T)))
        goal_x, goal_y = self._waypoints[(nearest + self._ahead) % len(self._waypoints)]
        left = math.cos(heading) * (goal_y - y) - math.sin(heading) * (goal_x - x)
        curvature = 2.0 * left / ((goal_x - x) ** 2 + (goal_y - y) ** 2)
        return math.atan(WHEELBASE * curvature), self._speed


class Driven:
    """A simulator and the planner that drives it.

    Args:
      name: to be printed.
      period: of a step [s].
      reset: places the car and returns its first observation.
      step: takes an action (agents, 2) and returns an observation.
      agents: how many cars.
    """

    def __init__(
        self, name: str, period: float, reset: Callable[[Any], Observation], step: Callable[[Any], Observation],
        agents: int = 1,
    ) -> None:  # fmt: skip
        self.name, self.period, self.reset, self.step, self._agents = name, period, reset, step, agents

    def begin(self, planner: WaypointFollower) -> None:
        """Place the cars at the first waypoint and behind it."""
        self._planner, self._observation = planner, self.reset(planner.starts(self._agents))

    def turn(self) -> float:
        """Drive for a turn and return the time spent in its steps [s]."""
        spent = 0.0
        for _ in range(round(TURN / self.period)):
            action = self._planner.plan(self._observation)
            started = time.perf_counter()
            self._observation = self.step(action)
            spent += time.perf_counter() - started
        if np.any(self._observation["collisions"]):
            raise SystemExit(f"{self.name} has hit a wall; accepted: a --speed at which none does")
        return spent


def theirs(
    checkout: Path, map_file: Path, extension: str, *, agents: int = 1, timestep: float = STEP, integrator: str = "RK4"
) -> Driven:
    """Return f1tenth_gym's simulator with its own beams."""
    if not (file := checkout / PACKAGE / "base_classes.py").is_file():
        raise SystemExit(f"--gym: no file {file}; accepted: a checkout of f1tenth_gym 0.2.1")
    for name, folder in (("f110_gym", PACKAGE.parent), ("f110_gym.envs", PACKAGE)):
        package = types.ModuleType(name)  # in the place of its own, which imports gym and pyglet
        package.__path__ = [str(checkout / folder)]
        sys.modules[name] = package
    classes = importlib.import_module("f110_gym.envs.base_classes")
    settings = {} if integrator == "RK4" else {"integrator": getattr(classes.Integrator, integrator)}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it says which integrator it takes
        simulator = classes.Simulator(PARAMETERS, agents, 12345, time_step=timestep, **settings)
    simulator.set_map(str(map_file), extension)

    def reset(pose: Any) -> Observation:
        simulator.reset(pose)
        return dict(simulator.step(np.zeros((agents, 2))))

    return Driven("f1tenth_gym", timestep, reset, simulator.step, agents)


def ours(
    map_file: Path, extension: str, *, agents: int = 1, timestep: float = STEP, tires: str | None = None
) -> Driven:
    """Return this simulator behind f1tenth_gym's interface."""
    env = f110.make(
        map=str(map_file.with_suffix("")), map_ext=extension, params=PARAMETERS, timestep=timestep, num_agents=agents,
        tires=tires,
    )  # fmt: skip
    name = "fg_mujoco.addons.gym2d" if tires is None else f"fg_mujoco.addons.gym2d, tires {tires}"
    return Driven(name, timestep, lambda pose: env.reset(pose)[0], lambda action: env.step(action)[0], agents)


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


def image_extension(map_file: Path) -> str:
    """Return the extension of a map's image."""
    lines = map_file.read_text(encoding="utf-8").splitlines()
    return Path(next(line for line in lines if line.startswith("image:")).strip()).suffix


def measure(
    checkout: Path, map_file: Path, *, speed: float, rounds: int, agents: int = 1, timestep: float = STEP,
    integrator: str = "RK4",
) -> dict[str, Any]:  # fmt: skip
    """Return the figures of the benchmark."""
    extension = image_extension(map_file)
    course = fg.load_track(str(map_file))
    planner = WaypointFollower(course.centreline, speed)
    both = {"agents": agents, "timestep": timestep}
    ways = [theirs(checkout, map_file, extension, integrator=integrator, **both), ours(map_file, extension, **both)]
    plain = agents == 1 and timestep == STEP
    if plain:
        ways.append(ours_at_25_ms(map_file))
        fg.race(str(map_file), laps=1, time_limit=1.0)
    for way in ways:  # what is loaded once
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
        if plain:
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
    result = {"map": map_file.stem, "speed_m_s": speed, "turns": rounds * turns, "ways": figures}
    if plain:
        ratio = float(np.median(races * times[:, 0].mean(axis=1)))
        result["race"] = {"realtime_factor": float(np.median(races)), "ratio": ratio}
    return result


def main() -> None:
    """Print the table."""
    arguments = parser(__doc__)
    arguments.add_argument("--gym", type=Path, required=True, metavar="PATH", help="a checkout of f1tenth_gym 0.2.1")
    arguments.add_argument("--map", type=Path, required=True, metavar="FILE", help="map_server YAML of a closed course")
    arguments.add_argument("--speed", type=float, default=3.0, help="of both cars [m/s], default 3")
    arguments.add_argument("--rounds", type=int, default=5, help="of one lap each, default 5")
    arguments.add_argument("--agents", type=int, default=1, help="cars in both, default 1")
    arguments.add_argument("--timestep", type=float, default=STEP, help="of a step in both [s], default 0.01")
    arguments.add_argument("--integrator", choices=("RK4", "Euler"), default="RK4", help="of f1tenth_gym, default RK4")
    options = arguments.parse_args()
    stay_on_cores(1)
    figures = measure(
        options.gym.resolve(), options.map.resolve(), speed=options.speed, rounds=options.rounds,
        agents=options.agents, timestep=options.timestep, integrator=options.integrator,
    )  # fmt: skip
    rows = [
        (name, *(f"{way[key]:.0f}" for key in ("us_per_step", "us_per_step_least", "realtime_factor")), way["ratio"])
        for name, way in figures["ways"].items()
    ]
    if race := figures.get("race"):
        rows.append(("race, planner included", "", "", f"{race['realtime_factor']:.0f}", race["ratio"]))
    cars = "one car" if options.agents == 1 else f"{options.agents} cars"
    title = f"{figures['map']} at {options.speed:g} m/s, {cars}, one core, {figures['turns']} turns each\n\n"
    text = title + table(("", "us per step, median", "least", "times real time", "times f1tenth_gym's"), rows)
    report(figures, text, options.json)


if __name__ == "__main__":
    main()
