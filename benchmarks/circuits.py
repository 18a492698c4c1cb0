"""Races a controller on every circuit and prints lap times, sliding and speed: the table of the README.

    python benchmarks/circuits.py [--laps 5] [--seeds 20] [--data ../shared/data] [--workers 2]

The real circuits are read from `--data` where that folder is; the published lap times are those of the survey
"Unifying F1TENTH Autonomous Racing" (its benchmark notebooks: standing start, 8 m/s limit, mu 1.0489).
"""

from __future__ import annotations

import argparse
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

import fg_mujoco as fg

PUBLISHED = {  # [s] follow-the-gap on LiDAR alone, optimised raceline with a map
    "aut": (19.10, 16.79),
    "esp": (45.78, 35.92),
    "gbr": (39.34, 31.24),
    "mco": (34.99, 28.08),
}


def real_circuits(data: Path) -> list[str]:
    return [str(path) for folder in ("maps", "circuits") for path in sorted((data / folder).glob("*_centerline.csv"))]


def row(track: str, laps: int, controller: str) -> str:
    race = fg.race(track, controller, laps=laps)
    name = race.track.removesuffix("_centerline")
    first = race.lap_times_s[0] if race.lap_times_s else float("nan")
    best = min(race.lap_times_s, default=float("nan"))
    published = PUBLISHED.get(name)
    against = f"{published[0]:.2f} | {first / published[1] - 1.0:+.1%}" if published else " | "
    return (
        f"| {name} | {race.laps_completed}/{laps} | {race.collisions} | {first:.2f} | {best:.2f} | {against} "
        f"| {race.max_slide_m_s:.3f} | {race.mean_speed_m_s:.2f} | {race.realtime_factor:.0f} |"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--controller", default="gap_finder")
    parser.add_argument("--laps", type=int, default=5)
    parser.add_argument("--seeds", type=int, default=20, help="how many random circuits")
    parser.add_argument("--data", type=Path, default=Path(__file__).parents[1] / "../shared/data")
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    tracks = [*fg.track_names(), *real_circuits(options.data), *(f"random:{seed}" for seed in range(options.seeds))]
    print(
        "| circuit | laps | crashes | first lap [s] | best [s] | published follow-the-gap [s] | first lap to raceline"
        " | greatest slide [m/s] | mean speed [m/s] | times real time |"
    )
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    with ProcessPoolExecutor(options.workers) as pool:
        for line in pool.map(partial(row, laps=options.laps, controller=options.controller), tracks):
            print(line, flush=True)


if __name__ == "__main__":
    main()
