"""What randomisation costs: vector environments that draw everything, beside the same that draw nothing.

    python benchmarks/randomized_environments.py [--worlds 16 256] [--beams 108 1081] [--threads 1] [--json FILE]

Both drive straight on at 0.5 m/s, on random circuits, and take turns of some ticks. The share is the median over the
turns of the ratio of the CPU times, which a shared machine disturbs less than the times. A reset is one of a world
whose build is there; the first reset of all worlds waits for all builds.
"""

from __future__ import annotations

import resource
import time
from pathlib import Path
from typing import Any

import numpy as np
from common import parser, report, stay_on_cores, table

from fg_mujoco.envs.gym_vector import F1TenthVectorEnv

TICKS, RESETS, BUILDS = 10, 100, 64

EVERYTHING: dict[str, Any] = {
    "mu": (0.5, 1.1), "mass": (3.3, 4.2), "cog_height": (0.06, 0.09), "steering_gain": (0.8, 1.2),
    "speed_gain": (0.8, 1.2), "command_delay": (0.0, 0.04), "lidar_noise": (0.005, 0.02),
    "lidar_dropout": (0.005, 0.02), "lidar_latency": (0.0, 0.05), "odometry_drift": (-0.02, 0.02),
    "start_speed": (0.0, 1.0), "obstacles": (0, 3), "patches": (0, 2), "patch_mu": (0.3, 0.6),
}  # fmt: skip
"""All that can be drawn for a car that is alone, but for its vehicle and its tires."""

COURSES = {"track": "random:0"}, {"track": ["random:0:200"]}


def make(worlds: int, beams: int, threads: int, *, drawn: dict[str, Any]) -> F1TenthVectorEnv:
    """Return an environment that has begun."""
    step = max(1081 // beams, 1)
    envs = F1TenthVectorEnv(
        worlds, threads=threads, beam_step=step, autoreset_mode="Disabled", builds=BUILDS, randomize=drawn,
        **COURSES[bool(drawn)],
    )  # fmt: skip
    envs.reset(seed=1)
    return envs


def make_all_builds(envs: F1TenthVectorEnv) -> None:
    """Wait until each build is there, so that nothing is built while something is measured."""
    for number in range(BUILDS):
        envs._worlds._draws._builds.get(number)


def seconds(envs: F1TenthVectorEnv, ticks: int = TICKS) -> float:
    """Return the CPU time of some ticks."""
    actions = np.tile(np.array([0.0, 0.5], np.float32), (envs.num_envs, 1))
    envs.reset()
    began = time.process_time()
    for _ in range(ticks):
        envs.step(actions)
    return time.process_time() - began


def measure(worlds: int, beams: int, threads: int, rounds: int) -> dict[str, float]:
    """Return the figures of one size."""
    without, car = (make(worlds, beams, threads, drawn=drawn) for drawn in ({}, {"mu": (0.5, 1.1)}))
    began, busy, memory = time.perf_counter(), time.process_time(), memory_in_use()
    everything = make(worlds, beams, threads, drawn=EVERYTHING)
    first = time.perf_counter() - began, time.process_time() - busy
    for envs in (car, everything):
        make_all_builds(envs)
    builds = time.perf_counter() - began
    ways = {"without": without, "mu and course": car, "everything": everything}
    times: dict[str, list[float]] = {name: [] for name in ways}
    for _ in range(rounds):
        for name, envs in ways.items():
            times[name].append(seconds(envs))
    mask = np.zeros(worlds, np.bool_)
    began = time.process_time()
    for k in range(RESETS):
        mask[:] = False
        mask[k % worlds] = True
        everything.reset(options={"reset_mask": mask})
    reset = (time.process_time() - began) / RESETS
    took = np.array(times["without"])
    figures = {
        "steps_per_second_without": worlds * TICKS / float(np.median(took)),
        "share_of_mu_and_course": float(np.median(took / np.array(times["mu and course"]))),
        "share_of_everything": float(np.median(took / np.array(times["everything"]))),
        "reset_ms": 1e3 * reset, "first_reset_s": first[0], "first_reset_cpu_s": first[1],
        "all_builds_s": builds, "memory_mb": memory_in_use() - memory,
    }  # fmt: skip
    for envs in ways.values():
        envs.close()
    return figures


def memory_in_use() -> float:
    """Return the memory of this process [MB]."""
    pages = int(Path("/proc/self/statm").read_text(encoding="utf-8").split()[1])
    return pages * resource.getpagesize() / 2**20


def main() -> None:
    """Print the table."""
    arguments = parser(__doc__)
    arguments.add_argument("--worlds", type=int, nargs="*", default=[16, 256])
    arguments.add_argument("--beams", type=int, nargs="*", default=[108, 1081])
    arguments.add_argument("--threads", type=int, default=1)
    arguments.add_argument("--rounds", type=int, default=7)
    options = arguments.parse_args()
    stay_on_cores(2)
    figures = {
        f"{worlds} worlds, {beams} beams": measure(worlds, beams, options.threads, options.rounds)
        for worlds in options.worlds
        for beams in options.beams
    }
    cells = [
        (name, f"{f['steps_per_second_without']:.0f}", f"{f['share_of_mu_and_course']:.0%}",
         f"{f['share_of_everything']:.0%}", f"{f['reset_ms']:.1f}", f"{f['first_reset_s']:.1f}",
         f"{f['all_builds_s']:.1f}", f"{f['memory_mb']:.0f}")
        for name, f in figures.items()
    ]  # fmt: skip
    head = (
        "", "steps per CPU second, nothing drawn", "share: mu and course", "share: everything", "reset [ms]",
        "first reset [s]", "all builds [s]", "memory [MB]",
    )  # fmt: skip
    report(figures, table(head, cells), options.json)


if __name__ == "__main__":
    main()
