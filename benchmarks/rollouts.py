"""How many world-seconds a second `rollout` drives, by worlds and threads, and what a world costs in memory.

    python benchmarks/rollouts.py [--track oval] [--time-limit 2] [--most 4096] [--json FILE]

gap_finder, 1081 beams at 40 Hz, physics and slip meter, each world with a friction of its own. The baseline is the same
worlds raced one after the other by `race`, a single world of the batch at a time.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import time
from typing import Any

import numpy as np
from common import parser, report, stay_on_cores, table

import fg_mujoco as fg

RANDOMIZE = {"mu": "0.9:1.2"}
THREADS = (1, 2)


def drive(track: str, n: int, workers: int, duration: float) -> float:
    """Return world-seconds per second."""
    start = time.perf_counter()
    result = fg.rollout(track, n=n, time_limit=duration, workers=workers, randomize=RANDOMIZE)
    return float(result["sim_time_s"].sum()) / (time.perf_counter() - start)


def race_alone(track: str, duration: float, count: int = 4) -> float:
    """Return the same for worlds raced one by one, worlds built anew as a script would."""
    start = time.perf_counter()
    simulated = sum(fg.race(track, laps=100, time_limit=duration, seed=seed).sim_time_s for seed in range(count))
    return simulated / (time.perf_counter() - start)


def memory(track: str, few: int = 64, many: int = 1088) -> float:
    """Return how much a world adds to the memory of a process whose batch has them all at once [MB]."""
    code = (
        "import resource, sys, fg_mujoco as fg\n"
        "count = int(sys.argv[1])\n"
        f"fg.rollout({track!r}, n=count, executor=fg.Executor(chunk=count), time_limit=0.2, workers=1,"
        f" randomize={RANDOMIZE!r})\n"
        "print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)"
    )
    used = [
        float(subprocess.run([sys.executable, "-c", code, str(n)], check=True, capture_output=True, text=True).stdout)
        for n in (few, many)
    ]
    return (used[1] - used[0]) / (many - few)


def measure(track: str, duration: float, most: int) -> dict[str, Any]:
    """Return the figures of the benchmark."""
    counts = [4**k for k in range(7) if 4**k <= most]
    rates: dict[str, dict[int, float]] = {f"{t} thread{'s'[: t > 1]}": {} for t in THREADS}
    drive(track, 2, 2, 0.2)  # what is loaded once
    for n in counts:
        repeats = 5 if n <= 64 else 3 if n <= 256 else 1
        taken: dict[str, list[float]] = {name: [] for name in rates}
        for _ in range(repeats):
            for name, threads in zip(rates, THREADS, strict=True):
                taken[name].append(drive(track, n, threads, duration))
        for name, values in taken.items():
            rates[name][n] = float(np.median(values))
    return {
        "track": track,
        "duration_s": duration,
        "world_seconds_per_second": rates,
        "raced_alone": race_alone(track, duration),
        "memory_per_world_mb": memory(track),
        "peak_memory_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }


def main() -> None:
    """Print the tables."""
    arguments = parser(__doc__)
    arguments.add_argument("--track", default="oval")
    arguments.add_argument("--time-limit", type=float, default=2.0, help="of each world [s]")
    arguments.add_argument("--most", type=int, default=4096, help="worlds")
    options = arguments.parse_args()
    stay_on_cores(2)
    figures = measure(options.track, options.time_limit, options.most)
    one, two = figures["world_seconds_per_second"].values()
    alone = figures["raced_alone"]
    rows = [(n, f"{one[n]:.0f}", f"{two[n]:.0f}", f"{two[n] / one[n]:.2f}", f"{one[n] / alone:.1f}") for n in one]
    text = (
        f"{options.track}, {options.time_limit:g} s each, gap_finder, 1081 beams; world-seconds per second\n\n"
        + table(("worlds", "1 thread", "2 threads", "2 to 1", "1 thread to raced alone"), rows)
        + f"\n\nRaced one by one: {alone:.0f}. A world adds {figures['memory_per_world_mb']:.2f} MB to a batch."
    )
    report(json.loads(json.dumps(figures)), text, options.json)


if __name__ == "__main__":
    main()
