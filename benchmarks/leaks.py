"""Whether memory, descriptors or threads grow with what is done again and again in one process.

    python benchmarks/leaks.py [--only NAME] [--share 1.0] [--warm 0.1] [--json FILE]

Each thing is done in a process of its own: first a share of its times to warm up, while caches fill. Memory
is what the process has in RAM (RSS), when the C library has handed back what is free: glibc keeps free memory in
pieces, up to twice of what is used, which looks like a leak and ends. Pictures need EGL or OSMesa and are left out
where there is neither.
"""

from __future__ import annotations

import contextlib
import ctypes
import gc
import json
import os
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from common import parser, report, table

MIB = 2**20


@dataclass(frozen=True, kw_only=True)
class Growth:
    """What grew from the end of the warm-up to the end."""

    calls: int  # after the warm-up
    warm_mib: float  # RSS after it
    end_mib: float
    descriptors: tuple[int, int]  # after the warm-up, at the end
    threads: tuple[int, int]

    @property
    def kib_per_call(self) -> float:
        """Memory that each call after the warm-up has left behind [KiB]."""
        return 1024.0 * (self.end_mib - self.warm_mib) / self.calls


def held() -> tuple[float, int, int]:
    """Return the memory of this process [MiB], its descriptors and its threads, without what is free."""
    gc.collect()
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)  # of glibc
    if trim is not None:
        trim(0)
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return (
        pages * os.sysconf("SC_PAGE_SIZE") / MIB,
        len(os.listdir("/proc/self/fd")),
        len(os.listdir("/proc/self/task")),
    )


def growth(call: Callable[[int], object], times: int, warm_share: float = 0.1) -> Growth:
    """Call something so often, with the number of the call, and return what grew after a first share of the calls."""
    warming = int(warm_share * times)
    for number in range(warming):
        call(number)
    warm = held()
    for number in range(warming, times):
        call(number)
    end = held()
    return Growth(
        calls=times - warming, warm_mib=warm[0], end_mib=end[0], descriptors=(warm[1], end[1]),
        threads=(warm[2], end[2]),
    )  # fmt: skip


@contextlib.contextmanager
def races() -> Iterator[Callable[[int], object]]:
    """Races of 1 s, on one track."""
    import fg_mujoco as fg

    yield lambda number: fg.race("oval", laps=1, time_limit=1.0)


@contextlib.contextmanager
def races_of_four() -> Iterator[Callable[[int], object]]:
    """Races of 2 s of four cars, on one track."""
    import fg_mujoco as fg

    names = ("gap_finder", "follow_the_gap", "wall_follow", "disparity_extender")
    entries = [fg.Entry(controller=name) for name in names]
    yield lambda number: fg.race("oval", entries=entries, laps=1, time_limit=2.0)


@contextlib.contextmanager
def other_races() -> Iterator[Callable[[int], object]]:
    """Races of 1 s, each on another track, with another friction and noise."""
    import fg_mujoco as fg

    noise = fg.LidarEffects(range_noise_std=0.01)
    yield lambda number: fg.race(
        f"random:{number}", laps=1, time_limit=1.0, mu=0.8 + 1e-3 * number, effects=noise, seed=number
    )


PLANNER = """
import fg_mujoco as fg

class Mine:
    def __init__(self, max_speed): self.speed = max_speed
    def reset(self): pass
    def __call__(self, scan, odometry):
        if odometry.stamp > 0.5: raise ValueError("enough")
        return fg.DriveCommand(steering_angle=0.0, speed=1.0)
"""


@contextlib.contextmanager
def failing_races() -> Iterator[Callable[[int], object]]:
    """Races of a planner in a file, which fails after 0.5 s."""
    import fg_mujoco as fg

    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "mine.py").write_text(PLANNER, encoding="utf-8")

        def call(number: int) -> None:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of the failure
                fg.race("oval", f"{folder}/mine.py:Mine", laps=1)

        yield call


@contextlib.contextmanager
def resets() -> Iterator[Callable[[int], object]]:
    """Resets of one Gymnasium environment, and a step after each."""
    from fg_mujoco.envs.gym_environment import F1TenthEnv

    environment = F1TenthEnv()
    action = environment.action_space.sample()

    def call(number: int) -> None:
        environment.reset(seed=number)
        environment.step(action)

    yield call
    environment.close()


@contextlib.contextmanager
def environments() -> Iterator[Callable[[int], object]]:
    """Vector environments of four worlds made, reset and closed."""
    from fg_mujoco.envs.gym_vector import F1TenthVectorEnv

    def call(number: int) -> None:
        environment = F1TenthVectorEnv(num_envs=4)
        environment.reset(seed=number)
        environment.close()

    yield call


@contextlib.contextmanager
def rollouts() -> Iterator[Callable[[int], object]]:
    """Rollouts of four worlds of 0.5 s in two threads."""
    import fg_mujoco as fg

    yield lambda number: fg.rollout("oval", n=4, seed=number, randomize={"mu": (0.6, 1.2)}, time_limit=0.5, workers=2)


@contextlib.contextmanager
def run_folders() -> Iterator[Callable[[int], object]]:
    """Run folders with their picture, of one race."""
    import fg_mujoco as fg

    result = fg.race("oval", laps=1, time_limit=1.0)
    with tempfile.TemporaryDirectory() as folder:
        yield lambda number: fg.write_run(result, f"{folder}/{number}")


@contextlib.contextmanager
def renderers() -> Iterator[Callable[[int], object]]:
    """Renderers of 640 x 480 pixels opened, used for one picture and closed."""
    import mujoco

    import fg_mujoco as fg
    from fg_mujoco.pictures.rendering import Renderer

    world = fg.World("oval")
    data = mujoco.MjData(world.model)
    mujoco.mj_forward(world.model, data)

    def call(number: int) -> None:
        with Renderer(world, size=(640, 480), quality="draft") as renderer:
            renderer.rgb(data)

    yield call


@contextlib.contextmanager
def forgotten_renderers() -> Iterator[Callable[[int], object]]:
    """Renderers opened, used for one picture and not closed, but given up."""
    import mujoco

    import fg_mujoco as fg
    from fg_mujoco.pictures.rendering import Renderer

    world = fg.World("oval")
    data = mujoco.MjData(world.model)
    mujoco.mj_forward(world.model, data)
    yield lambda number: Renderer(world, size=(640, 480), quality="draft").rgb(data)


WAYS: dict[str, tuple[Callable[[], contextlib.AbstractContextManager[Callable[[int], object]]], int]] = {
    "races": (races, 300),
    "races of four cars": (races_of_four, 100),
    "races on other tracks": (other_races, 100),
    "races that fail": (failing_races, 200),
    "resets": (resets, 2000),
    "vector environments": (environments, 100),
    "rollouts": (rollouts, 100),
    "run folders": (run_folders, 50),
    "renderers": (renderers, 200),
    "renderers not closed": (forgotten_renderers, 100),
}


def measure(name: str, share: float, warm_share: float) -> Growth:
    """Return what grew when one of WAYS was done a share of its times, the first of them to warm up."""
    way, times = WAYS[name]
    with way() as call:
        return growth(call, max(int(share * times), 10), warm_share)


def main() -> None:
    """Measure each of the ways in a process of its own, and print a table."""
    arguments = parser(__doc__)
    arguments.add_argument("--only", choices=WAYS, help="measure this in this process, and print it as JSON")
    arguments.add_argument("--share", type=float, default=1.0, help="of the times; default: 1")
    arguments.add_argument("--warm", type=float, default=0.1, help="share of these to warm up; default: 0.1")
    options = arguments.parse_args()
    if options.only is not None:
        print(json.dumps(asdict(measure(options.only, options.share, options.warm))))
        return
    found: dict[str, Any] = {}
    for name in WAYS:
        command = [sys.executable, __file__, "--only", name, "--share", str(options.share)]
        command += ["--warm", str(options.warm)]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode != 0:
            print(f"{name}: left out: {done.stderr.strip().splitlines()[-1]}", file=sys.stderr)
            continue
        found[name] = json.loads(done.stdout.splitlines()[-1])
    rows = [(name, Growth(**figures)) for name, figures in found.items()]
    header = (
        "what",
        "times",
        "RSS after the warm-up [MiB]",
        "at the end [MiB]",
        "growth [KiB per call]",
        "descriptors",
        "threads",
    )
    markdown = table(
        header,
        [
            (
                name, each.calls, f"{each.warm_mib:.1f}", f"{each.end_mib:.1f}", f"{each.kib_per_call:.1f}",
                " to ".join(map(str, each.descriptors)), " to ".join(map(str, each.threads)),
            )
            for name, each in rows
        ],
    )  # fmt: skip
    report(found, markdown, options.json)


if __name__ == "__main__":
    main()
