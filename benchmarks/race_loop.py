"""How fast the closed loop is: 1081 beams at 40 Hz, the planner, physics and slip meter, on one core.

    python benchmarks/race_loop.py [--track oval] [--laps 5] [--lidar raycast] [--json]

The real-time factor is that of a plain race, as `fg-mujoco race` reports it, beside that of the same race on MuJoCo's
own rangefinders. Where a tick's time goes comes from one more race, with clocks around its parts.
"""

from __future__ import annotations

import argparse
import importlib
import json
import os
import time
from collections.abc import Callable
from contextlib import ExitStack
from typing import Any
from unittest.mock import patch

import mujoco
import numpy as np

import fg_mujoco as fg
from fg_mujoco.lidar import LIDAR_BACKENDS
from fg_mujoco.lidar_effects import ScanPipeline

BASELINE = "rangefinder"
PARTS = {
    "physics": ((importlib.import_module("fg_mujoco.simulation"), "hold_controls"),),
    "LiDAR": ((ScanPipeline, "scan"),),
    "planner": ((importlib.import_module("fg_mujoco.race"), "plan"),),
    "slip meter": ((fg.TireSlipMeter, "record"), (fg.TireSlipMeter, "read")),
}
"""Whose functions make up a part. The rest is all else: odometry, lap timer, log, the loop itself."""


class Clocks:
    """Time spent in each part, less that in the parts that it calls; one row a tick."""

    def __init__(self) -> None:
        self.rows: list[dict[str, float]] = []
        self._spent = dict.fromkeys((*PARTS, "rest"), 0.0)
        self._running = "rest"
        self._since = time.perf_counter()

    def switch(self, part: str) -> str:
        """Stop the clock that runs, start that of `part`, and return which one ran."""
        before, now = self._running, time.perf_counter()
        self._spent[before] += now - self._since
        self._running, self._since = part, now
        return before

    def end_tick(self, _: fg.RaceProgress) -> None:
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


def time_parts(track: str, laps: int, lidar: str) -> dict[str, float]:
    """Return the median time of each part, and of the whole tick, in a race [us]."""
    clocks = Clocks()
    with ExitStack() as patches:
        for part, functions in PARTS.items():
            for owner, name in functions:
                patches.enter_context(patch.object(owner, name, clocks.around(part, getattr(owner, name))))
        fg.race(track, laps=laps, lidar=lidar, watch=clocks.end_tick)
    rows = np.array([list(row.values()) for row in clocks.rows[1:]])  # the first has the preparations in it
    medians = np.median(rows, axis=0)
    return dict(zip((*PARTS, "rest", "tick"), (1e6 * np.append(medians, np.median(rows.sum(axis=1)))), strict=True))


def measure(track: str, laps: int, lidar: str) -> dict[str, Any]:
    """Return the figures of the benchmark."""
    backends = dict.fromkeys((lidar, BASELINE))
    factors = {backend: fg.race(track, laps=laps, lidar=backend).realtime_factor for backend in backends}
    parts = {name: round(float(value), 1) for name, value in time_parts(track, laps, lidar).items()}
    return {"track": track, "laps": laps, "lidar": lidar, "realtime_factor": factors, "us_per_tick": parts}


def stay_on_one_core() -> None:
    """Pin the process to one core, where the system can."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--track", default="oval")
    parser.add_argument("--laps", type=int, default=5)
    parser.add_argument("--lidar", choices=LIDAR_BACKENDS, default="raycast")
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args()
    stay_on_one_core()
    figures = measure(args.track, args.laps, args.lidar)
    if args.json:
        print(json.dumps(figures))
        return
    factors, parts = figures["realtime_factor"], figures["us_per_tick"]
    print(f"{args.laps} laps of {args.track} on one core, 1081 beams at 40 Hz, mujoco {mujoco.__version__}\n")
    print("| LiDAR | real-time factor | times rangefinder |\n| --- | ---: | ---: |")
    for backend, factor in factors.items():
        print(f"| {backend} | {factor:.1f} | {factor / factors[BASELINE]:.2f} |")
    print(f"\nA tick with {args.lidar}, medians:\n\n| | us | share |\n| --- | ---: | ---: |")
    for name, median in parts.items():
        print(f"| {name} | {median:.0f} | {100 * median / parts['tick']:.0f}% |")


if __name__ == "__main__":
    main()
