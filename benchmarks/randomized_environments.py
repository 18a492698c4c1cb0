"""What randomisation costs: vector environments that draw everything, beside the same that draw nothing.

    python benchmarks/randomized_environments.py [--worlds 16 256] [--beams 108 1081] [--threads 1] [--json FILE]

All drive straight on at 0.5 m/s, and take turns of some ticks. Those that draw nothing are on one random circuit each,
of four: their mean time counts. One of the baselines has the LiDAR's effects, delays, drift, obstacles and patches,
too, the same in all episodes. A share is the median over the turns of the ratio of the CPU times, which a shared
machine disturbs less than the times. A reset is one of a world whose build is there.
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

SAME: dict[str, Any] = {
    "effects": {"range_noise_std": 0.0125, "dropout_probability": 0.0125, "latency": 0.025},
    "changes": {"command_delay": 0.02}, "obstacles": 2,
    "patches": [{"x": 1.0, "y": 0.0, "length": 1.5, "width": 1.4, "mu": 0.5}],
}  # fmt: skip
"""As much as that on average, the same in each episode."""

BASELINES = 4  # circuits of those that draw nothing


def make(worlds: int, beams: int, threads: int, **settings: Any) -> F1TenthVectorEnv:
    """Return an environment that has begun."""
    step = max(1081 // beams, 1)
    envs = F1TenthVectorEnv(
        worlds, threads=threads, beam_step=step, autoreset_mode="Disabled", builds=BUILDS, **settings
    )
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
    ways: dict[str, list[F1TenthVectorEnv]] = {
        name: [make(worlds, beams, threads, track=f"random:{k}", **settings) for k in range(BASELINES)]
        for name, settings in (("nothing", {}), ("nothing, with all effects", SAME))
    }
    ways["mu and course"] = [make(worlds, beams, threads, track=["random:0:200"], randomize={"mu": (0.5, 1.1)})]
    make_all_builds(ways["mu and course"][0])
    began, memory = time.perf_counter(), memory_in_use()
    drawn = make(worlds, beams, threads, track=["random:0:200"], randomize=EVERYTHING)
    first = time.perf_counter() - began
    make_all_builds(drawn)
    builds = time.perf_counter() - began
    ways["everything"] = [drawn]
    for _ in range(20):
        drawn.reset()
    times: dict[str, list[float]] = {name: [] for name in ways}
    for k in range(rounds):
        for name, envs in ways.items():
            times[name].append(float(np.mean([seconds(each) for each in envs])) if k else np.nan)
    mask = np.zeros(worlds, np.bool_)
    busy = time.process_time()
    for k in range(RESETS):
        mask[:] = False
        mask[k % worlds] = True
        drawn.reset(options={"reset_mask": mask})
    reset = (time.process_time() - busy) / RESETS
    took = {name: np.array(each[1:]) for name, each in times.items()}
    figures = {
        "steps_per_cpu_second": worlds * TICKS / float(np.median(took["nothing"])),
        "share_of_mu_and_course": float(np.median(took["nothing"] / took["mu and course"])),
        "share_of_everything": float(np.median(took["nothing, with all effects"] / took["everything"])),
        "share_of_everything_without_effects": float(np.median(took["nothing"] / took["everything"])),
        "reset_ms": 1e3 * reset, "first_reset_s": first, "all_builds_s": builds, "memory_mb": memory_in_use() - memory,
    }  # fmt: skip
    for envs in ways.values():
        for each in envs:
            each.close()
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
        (name, f"{f['steps_per_cpu_second']:.0f}", f"{f['share_of_mu_and_course']:.0%}",
         f"{f['share_of_everything']:.0%}", f"{f['share_of_everything_without_effects']:.0%}", f"{f['reset_ms']:.1f}",
         f"{f['first_reset_s']:.1f}", f"{f['all_builds_s']:.1f}", f"{f['memory_mb']:.0f}")
        for name, f in figures.items()
    ]  # fmt: skip
    head = (
        "", "steps per CPU second, nothing drawn", "share: mu and course", "share: everything, of the same effects",
        "share: everything, of no effects", "reset [ms]", "first reset [s]", "all builds [s]", "memory [MB]",
    )  # fmt: skip
    report(figures, table(head, cells), options.json)


if __name__ == "__main__":
    main()
