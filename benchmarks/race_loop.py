"""How fast the closed loop is: 1081 beams at 40 Hz, gap_finder, physics and slip meter, one world on one core.

    python benchmarks/race_loop.py [--track oval] [--laps 5] [--json FILE]

Three races in turn: as `fg-mujoco race` drives, on MuJoCo's own rangefinders, and the plain way, on them without the
sleep flag, so that static geoms are placed anew in every step. Where a tick's time goes comes from one more race with
clocks around its parts; what they cost themselves is in the sum.
"""

from __future__ import annotations

import importlib
import time
from collections.abc import Callable
from contextlib import ExitStack
from typing import Any
from unittest.mock import patch

import mujoco
import numpy as np
from common import parser, report, stay_on_cores, table

import fg_mujoco as fg
from fg_mujoco.racing.race import RaceProgress, race_setup
from fg_mujoco.simulation.engine import Engine
from fg_mujoco.simulation.physics import STATE
from fg_mujoco.simulation.world import World

PARTS = ("sense", "decide", "drive", "judge")
"""The verbs of the engine that a tick consists of. `drive` has the physics and the slip meter; the rest is the loop."""


class Clocks:
    """Time spent in each part, less that in the parts that it calls; one row a tick."""

    def __init__(self) -> None:
        self.rows: list[dict[str, float]] = []
        self._spent = dict.fromkeys((*PARTS, "Python"), 0.0)
        self._running = "Python"
        self._since = time.perf_counter()

    def switch(self, part: str) -> str:
        """Stop the clock that runs, start that of `part`, and return which one ran."""
        before, now = self._running, time.perf_counter()
        self._spent[before] += now - self._since
        self._running, self._since = part, now
        return before

    def end_tick(self, _: RaceProgress) -> None:
        self.switch(self._running)
        self.rows.append(self._spent)
        self._spent = dict.fromkeys(self._spent, 0.0)

    def around(self, part: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """Return `function` with the clock of `part` around it."""

        def timed(*args: Any, **kwargs: Any) -> Any:
            before = self.switch(part)
            try:
                return function(*args, **kwargs)
            finally:
                self.switch(before)

        return timed


def time_parts(track: str, laps: int) -> dict[str, float]:
    """Return the median time of each part, and of the whole tick, in a race [us]."""
    clocks = Clocks()
    with ExitStack() as patches:
        for part in PARTS:
            patches.enter_context(patch.object(Engine, part, clocks.around(part, getattr(Engine, part))))
        race_setup(fg.Setup(track=track, laps=laps), watch=clocks.end_tick, each_tick=True)
    rows = np.array([list(row.values()) for row in clocks.rows[1:]])  # the first has the preparations in it
    medians = [*np.median(rows, axis=0), np.median(rows.sum(axis=1))]
    return {name: 1e6 * float(value) for name, value in zip((*PARTS, "Python", "tick"), medians, strict=True)}


def physics_alone(result: fg.RaceResult) -> float:
    """Return the median time of a tick's steps and nothing else, from the states of a race [us]."""
    model = result.world.model
    data, steps = mujoco.MjData(model), round(0.025 / model.opt.timestep)
    times = []
    for state, ctrl in zip(result.states[:-1], result.ctrl, strict=True):
        mujoco.mj_setState(model, data, state, STATE)
        data.ctrl[:] = ctrl
        start = time.perf_counter()
        mujoco.mj_step(model, data, steps)
        times.append(1e6 * (time.perf_counter() - start))
    return float(np.median(times))


def without_sleep(model: Any) -> Any:
    """Switch the sleep flag of a model off, in place."""
    model.opt.enableflags &= ~int(mujoco.mjtEnableBit.mjENBL_SLEEP)
    return model


def plain_race(track: str, laps: int) -> fg.RaceResult:
    """Race on rangefinders, static geoms awake."""

    class Awake(World):
        def __init__(self, *args: Any, **kwargs: Any) -> None:
            super().__init__(*args, **kwargs)
            without_sleep(self.model)

    with patch.object(importlib.import_module("fg_mujoco.simulation.settings"), "World", Awake):
        return fg.race(track, laps=laps, lidar="rangefinder")


def measure(track: str, laps: int, repeats: int = 9) -> dict[str, Any]:
    """Return the figures of the benchmark."""
    ways: dict[str, Callable[[], fg.RaceResult]] = {
        "fg_mujoco": lambda: fg.race(track, laps=laps),
        "rangefinder sensors": lambda: fg.race(track, laps=1, lidar="rangefinder"),
        "rangefinder sensors, no sleep flag": lambda: plain_race(track, 1),
    }
    fg.race(track, laps=1)  # what is loaded once
    factors: dict[str, list[float]] = {name: [] for name in ways}
    for _ in range(repeats):
        for name, run in ways.items():
            factors[name].append(run().realtime_factor)
    return {
        "track": track,
        "laps": laps,
        "realtime_factor": {name: float(np.median(values)) for name, values in factors.items()},
        "realtime_factor_best": {name: max(values) for name, values in factors.items()},
        "us_per_tick": time_parts(track, laps),
        "physics_alone_us_per_tick": physics_alone(ways["fg_mujoco"]()),
    }


def main() -> None:
    """Print the tables."""
    arguments = parser(__doc__)
    arguments.add_argument("--track", default="oval")
    arguments.add_argument("--laps", type=int, default=5)
    options = arguments.parse_args()
    stay_on_cores(1)
    figures = measure(options.track, options.laps)
    factors, parts = figures["realtime_factor"], figures["us_per_tick"]
    baseline = list(factors.values())[-1]
    best = figures["realtime_factor_best"]
    rows = [(name, f"{value:.1f}", f"{best[name]:.1f}", f"{value / baseline:.1f}") for name, value in factors.items()]
    text = (
        f"{options.laps} laps of {options.track}, one world, one core, 1081 beams at 40 Hz\n\n"
        + table(("", "times real time, median", "best", "times the plain way"), rows)
        + "\n\nWhere a tick of 25 ms goes, medians\n\n"
        + table(("", "us", "share"), [(n, f"{us:.1f}", f"{us / parts['tick']:.0%}") for n, us in parts.items()])
        + f"\n\nThe physics steps of a tick alone: {figures['physics_alone_us_per_tick']:.1f} us"
    )
    report(figures, text, options.json)


if __name__ == "__main__":
    main()
