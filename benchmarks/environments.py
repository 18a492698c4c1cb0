"""How fast the environments step, beside the loops that they are made of.

    python benchmarks/environments.py [--track oval] [--worlds 16 256] [--rounds 3] [--json FILE]

All drive the commands of the same lap by gap_finder, 1081 beams at 40 Hz, in one thread; the vector environment once
more in two. The baseline is the engine itself: sense, drive and judge, without planners. All take turns of some ticks.
The overhead is the median over the turns of the ratio of the CPU times, which a shared machine disturbs less than the
times.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
from common import parser, report, stay_on_cores, table

import fg_mujoco as fg
from fg_mujoco.envs.dm_environment import load
from fg_mujoco.envs.gym_environment import ID, F1TenthEnv
from fg_mujoco.envs.gym_vector import F1TenthVectorEnv
from fg_mujoco.simulation.engine import Engine

TICKS = 20  # of a turn
Tick = Callable[[int], object]


def single(env: Any, commands: Any) -> Tick:
    """Return the same of an environment of one world."""
    actions = list(commands)

    def tick(i: int) -> object:
        if i == 0:
            env.reset()
        return env.step(actions[i])

    return tick


def engine(track: str, commands: Any, count: int) -> Tick:
    """Return what makes tick i of the engine, the commands given; tick 0 begins anew."""
    core = Engine(fg.World(track), count, time_limit=1000.0)
    starts = [fg.Start()] * count

    def tick(i: int) -> object:
        if i == 0:
            core.place(starts)
        core.sense()
        core.commands[:] = commands[i]
        core.drive()
        return core.judge()

    return tick


def vector(track: str, commands: Any, count: int, threads: int = 1) -> Tick:
    """Return the same of the vector environment."""
    envs = F1TenthVectorEnv(count, track=track, start="line", threads=threads)
    actions = np.repeat(commands[:, np.newaxis], count, axis=1)

    def tick(i: int) -> object:
        if i == 0:
            envs.reset()
        return envs.step(actions[i])

    return tick


def compare(ways: dict[str, Tick], ticks: int, rounds: int, worlds: int) -> dict[str, Any]:
    """Return, of each way, world-steps per second and the overhead over the first, in CPU time."""
    wall: dict[str, list[float]] = {name: [] for name in ways}
    cpu: dict[str, list[float]] = {name: [] for name in ways}
    for _ in range(rounds):
        for tick in ways.values():
            tick(0)
        for first in range(1, ticks - TICKS, TICKS):
            for name, tick in ways.items():
                started, busy = time.perf_counter(), time.process_time()
                for i in range(first, first + TICKS):
                    tick(i)
                cpu[name].append(time.process_time() - busy)
                wall[name].append(time.perf_counter() - started)
    core = next(iter(ways))
    return {
        name: {
            "steps_per_second": worlds * TICKS / float(np.median(wall[name])),
            "steps_per_cpu_second": worlds * TICKS / float(np.median(cpu[name])),
            "overhead": float(np.median(np.array(cpu[name]) / np.array(cpu[core]))) - 1.0,
        }
        for name in ways
    }


def measure(track: str, counts: list[int], rounds: int) -> dict[str, Any]:
    """Return the figures of the benchmark."""
    race = fg.race(track, laps=1)
    commands = np.column_stack((race.car.column("command_steering_rad"), race.car.column("command_speed_m_s")))[:-1]
    settings = {"track": track, "start": "line"}
    ways = {
        "Engine": engine(track, commands, 1),
        "F1TenthEnv": single(F1TenthEnv(**settings), commands),
        "gymnasium.make": single(gymnasium.make(ID, **settings), commands),
        "dm_env": single(load(track, laps=1), commands),
        "F1TenthVectorEnv": vector(track, commands, 1),
    }
    figures: dict[str, Any] = {"track": track, "one": compare(ways, len(commands), rounds, 1), "many": {}}
    for count in counts:
        ways = {
            "Engine": engine(track, commands, count),
            "F1TenthVectorEnv": vector(track, commands, count),
            "in two threads": vector(track, commands, count, 2),
        }
        figures["many"][count] = compare(ways, len(commands), max(rounds // (1 + count // 64), 1), count)
    return figures


def main() -> None:
    """Print the tables."""
    arguments = parser(__doc__)
    arguments.add_argument("--track", default="oval")
    arguments.add_argument("--worlds", type=int, nargs="*", default=[16, 256])
    arguments.add_argument("--rounds", type=int, default=3)
    options = arguments.parse_args()
    stay_on_cores(2)
    figures = measure(options.track, options.worlds, options.rounds)
    rows = [(1, *row) for row in figures["one"].items()]
    rows += [(count, *row) for count, ways in figures["many"].items() for row in ways.items()]
    cells = [(n, name, f"{r['steps_per_cpu_second']:.0f}", f"{r['overhead']:+.0%}") for n, name, r in rows]
    text = f"{options.track}, 1081 beams; steps of all worlds together\n\n" + table(
        ("worlds", "what", "steps per second of CPU", "CPU time over the core loop's"), cells
    )
    report(figures, text, options.json)


if __name__ == "__main__":
    main()
