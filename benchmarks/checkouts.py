"""How fast a checkout is against another one, in turns: races, rollouts and environments.

    python benchmarks/checkouts.py BEFORE AFTER [--python-before P] [--python-after P] [--rounds 5] [--json FILE]

Each checkout is run by its own interpreter, `.venv/bin/python` in it unless another is given, on one core, before and
after by turns. The least time of a tick, or of a call, over all rounds counts: on a machine that is shared, what others
do only ever adds to a time. Rollouts in two threads are on two cores.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

from common import parser, report, table

CODE = """
import json, os, sys, time
import numpy as np
import fg_mujoco as fg
cores = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else []

def stay(count):
    if cores:
        os.sched_setaffinity(0, set(cores[-count:]))

def tick_times(repeats):
    best = None
    for _ in range(repeats):
        stamps = []
        fg.race("oval", laps=2, watch=lambda progress: stamps.append(time.perf_counter()))
        taken = np.diff(stamps)
        best = taken if best is None else np.minimum(best, taken)
    return float(best.mean())

def call(n, workers, duration):
    start = time.perf_counter()
    limit = {"time_limit" if hasattr(fg, "Setup") else "duration": duration}
    result = fg.rollout("oval", n=n, workers=workers, randomize={"mu": "0.9:1.2"}, **limit)
    return (time.perf_counter() - start) / float(result["sim_time_s"].sum())

def steps(env, action, reset):
    env.reset(seed=0)
    best = 1e9
    for _ in range(6):
        env.reset(seed=0)
        start = time.perf_counter()
        for _ in range(40):
            env.step(action)
        best = min(best, (time.perf_counter() - start) / 40)
    return best

stay(1)
fg.race("oval", laps=1), call(2, 1, 0.2)
figures = {"race, a tick": tick_times(4)}
for n, repeats in ((1, 6), (4, 4), (16, 2)):
    figures[f"rollout of {n} worlds of 2 s, a world-second"] = min(call(n, 1, 2.0) for _ in range(repeats))
try:
    from fg_mujoco.envs.gym_environment import F1TenthEnv
    from fg_mujoco.envs.gym_vector import F1TenthVectorEnv
except ImportError:
    from fg_mujoco.gym_environment import F1TenthEnv
    from fg_mujoco.gym_vector import F1TenthVectorEnv
action = np.array([0.02, 2.0], np.float32)
figures["Gymnasium, a step"] = steps(F1TenthEnv(start="line"), action, None)
for n in (1, 16):
    env = F1TenthVectorEnv(n, start="line", threads=1)
    figures[f"vector environment of {n}, a step"] = steps(env, np.tile(action, (n, 1)), None)
stay(2)
for workers in (1, 2):
    figures[f"rollout of 256 worlds of {WORLD_SECONDS} s, {workers} threads"] = call(256, workers, WORLD_SECONDS)
print(json.dumps(figures))
"""


def run(checkout: Path, python: str | None, seconds: float) -> dict[str, float]:
    """Return the least times that a checkout takes [s]."""
    code = CODE.replace("WORLD_SECONDS", str(seconds))
    command = [python or str(checkout / ".venv/bin/python"), "-c", code]
    done = subprocess.run(command, check=True, capture_output=True, text=True, cwd=checkout)
    figures: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    return figures


def main() -> None:
    """Print the table."""
    arguments = parser(__doc__)
    arguments.add_argument("before", type=Path)
    arguments.add_argument("after", type=Path)
    arguments.add_argument("--python-before")
    arguments.add_argument("--python-after")
    arguments.add_argument("--rounds", type=int, default=5)
    arguments.add_argument("--seconds", type=float, default=9.0, help="of each of the 256 worlds")
    options = arguments.parse_args()
    sides = {"before": (options.before, options.python_before), "after": (options.after, options.python_after)}
    least: dict[str, dict[str, float]] = {side: {} for side in sides}
    for number in range(options.rounds):
        for side, (checkout, python) in sides.items():
            print(f"round {number + 1} of {options.rounds}: {side}", file=sys.stderr)
            for name, taken in run(checkout.resolve(), python, options.seconds).items():
                least[side][name] = min(taken, least[side].get(name, taken))
    before, after = least.values()
    rows = [
        (name, f"{1e6 * before[name]:.1f}", f"{1e6 * after[name]:.1f}", f"{before[name] / after[name]:.2f}")
        for name in before
    ]
    report(least, table(("", "before [us]", "after [us]", "times as fast"), rows), options.json)


if __name__ == "__main__":
    main()
