"""What one scan costs: Embree (`raycast`) against MuJoCo's sensors (`rangefinder`) and its mj_multiRay.

    python benchmarks/lidar_backends.py [--track oval] [--scans 300] [--json]

All in one world, from the same poses, one after the other, in one process; medians.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from collections.abc import Callable

import mujoco
import numpy as np

from fg_mujoco.lidar import LIDAR_BACKENDS, RaycastLidar
from fg_mujoco.world import World


def measure(track: str, scans: int) -> dict[str, float]:
    """Return the median time of a scan by each way [us]."""
    worlds = {backend: World(track, lidar=backend) for backend in LIDAR_BACKENDS}
    data = {backend: mujoco.MjData(world.model) for backend, world in worlds.items()}
    lidars = {backend: world.make_lidar() for backend, world in worlds.items()}
    cast = lidars["raycast"]
    assert isinstance(cast, RaycastLidar)
    count = len(cast.beams.bearings)
    geoms, distances = np.zeros(count, np.int32), np.zeros(count)

    def multi_ray() -> None:
        state = data["raycast"]
        directions = cast.beams.directions @ state.xmat[cast.body].reshape(3, 3).T
        mujoco.mj_multiRay(
            cast.model, state, state.xpos[cast.body], directions.ravel(), None, True, cast.body, geoms, distances, None,
            count, cast.beams.range_max,
        )  # fmt: skip

    ways: dict[str, Callable[[], object]] = {
        "raycast": lambda: cast.ranges(data["raycast"]),
        "rangefinder": lambda: lidars["rangefinder"].ranges(data["rangefinder"]),
        "mj_multiRay": multi_ray,
    }
    times: dict[str, list[float]] = {way: [] for way in ways}
    rng = np.random.default_rng(0)
    circuit = worlds["raycast"].track
    for _ in range(scans):
        x, y, heading = circuit.start_pose(rng.uniform(0.0, circuit.length))
        heading += rng.uniform(-math.pi, math.pi)
        for backend, world in worlds.items():
            world.car.set_pose(data[backend], x, y, heading)
            mujoco.mj_kinematics(world.model, data[backend])
        for way, scan in ways.items():
            start = time.perf_counter()
            scan()
            times[way].append(1e6 * (time.perf_counter() - start))
    return {way: float(np.median(taken)) for way, taken in times.items()}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--track", default="oval")
    parser.add_argument("--scans", type=int, default=300)
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args()
    medians = measure(args.track, args.scans)
    if args.json:
        print(json.dumps({"track": args.track, "scans": args.scans, "us_per_scan": medians}))
        return
    print(f"One scan of 1081 beams on {args.track}, median of {args.scans}, mujoco {mujoco.__version__}\n")
    print("| | us | ns a ray | times raycast |\n| --- | ---: | ---: | ---: |")
    for way, median in medians.items():
        print(f"| {way} | {median:.0f} | {1e3 * median / 1081:.0f} | {median / medians['raycast']:.2f} |")


if __name__ == "__main__":
    main()
