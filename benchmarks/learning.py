"""Laps of a planner that is not told the friction, beside those of one that is, and a floor that becomes slippery.

    python benchmarks/learning.py
    python benchmarks/learning.py --maps
    python benchmarks/learning.py --tires forzaeth_nuc7 --mu 0.5,0.9 --track oval,tight --laps 3
    python benchmarks/learning.py --step

The first prints a row for each race: its end, its greatest slide, and the ratio of its laps to those that are told. The
last lets the floor have .7 of its friction from one tick to the next, and says how far and how long the tires slide.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from race_maps import SETTINGS

import fg_mujoco as fg
from fg_mujoco.controllers.gap_finder import GapFinder

DATA = Path(__file__).resolve().parents[2] / "shared" / "data"
BUNDLED = ("oval", "l_corridor", "hairpins", "chicanes", "fast", "tight", "random:0", "random:1")
OTHERS = ("circuits/Spielberg_map.yaml", "race_maps/rca2.yaml", "race_maps/icra2022.yaml", "race_maps/jfr_v6.yaml")
MAPS = ("f", "fisica", "hangar", "ipz33", "jfr_v5", "lausitzring1", "levine_slam", "milan1", "track_1")
MUS = (0.4, 0.6, 0.8, 1.1)
ASKED = 1.08  # of the told planner's lap, from lap 2 on
SLIDES = 0.01  # [m/s] a tire slides above it
STEP = 0.7
STEP_TIMES = (30.0, 31.0, 32.0)  # [s] after which the floor is slippery
AFTER = 20.0  # [s] that are driven on it


def circuits() -> list[str]:
    """Return twelve circuits, those of the shared data where there are any."""
    return [*BUNDLED, *(str(DATA / name) for name in OTHERS if (DATA / name).exists())]


def other_maps() -> list[str]:
    """Return the race maps of the shared data that are not among the twelve circuits."""
    paths = {name: DATA / "race_maps" / f"{name}.yaml" for name in MAPS}
    return [f"{path}{SETTINGS.get(name, '')}" for name, path in paths.items() if path.exists()]


def compare(tracks: list[str], tires: str, mus: list[float], laps: int, keywords: dict[str, Any]) -> None:
    """Race told and learning, and print a row for each pair and a summary."""
    ratios, slides, unfinished = [], [], []
    print("circuit          mu   greatest slide [m/s]  end of the race        laps over those of the told planner")
    print("                       told    learning")
    for track in tracks:
        for mu in mus:
            told, learning = (
                fg.race(track, name, laps=laps, mu=mu, tires=tires, **keywords).car
                for name in ("gap_finder", "gap_finder[assist=full+learn]")
            )
            both = min(len(told.lap_times_s), len(learning.lap_times_s))
            over = np.array(learning.lap_times_s[:both]) / np.array(told.lap_times_s[:both])
            ratios.extend(over[1:].tolist())
            slides.append(learning.max_slide_m_s)
            if learning.end_reason != "finished":
                unfinished.append((Path(track).stem, mu, told.end_reason, learning.end_reason))
            ends = f"{told.end_reason}, {learning.end_reason}"
            greatest = f"{told.max_slide_m_s:6.3f}  {learning.max_slide_m_s:6.3f}"
            each_lap = " ".join(f"{ratio:.3f}" for ratio in over)
            print(f"{Path(track).stem:15} {mu:4.2f}  {greatest}      {ends:22} {each_lap}", flush=True)
    within = sum(ratio <= ASKED for ratio in ratios)
    print(f"from lap 2 on: {within} of {len(ratios)} laps within {ASKED:g}, median {np.median(ratios):.3f}, ", end="")
    print(f"greatest {max(ratios):.3f}; {sum(s > SLIDES for s in slides)} of {len(slides)} races with a slide")
    for each in unfinished:
        print("not finished:", *each)


def step(tracks: list[str], tires: str, mus: list[float]) -> None:
    """Drive on a floor that loses friction in mid-race, told of the first friction and learning; print what slides."""
    print("circuit          mu     planner    touched  greatest slide [m/s]  sliding [s]  found out after [s]  mu used")
    for track in tracks:
        for mu in mus:
            for learns in (False, True):
                for time in STEP_TIMES:
                    print(_stepped(track, tires, mu, learns, time), flush=True)


def _stepped(track: str, tires: str, mu: float, learns: bool, time: float) -> str:
    patch = fg.Patch(x=0.0, y=0.0, length=1e4, width=1e4, mu=mu)
    world = fg.World(fg.load_track(track), mu=mu, tires=fg.Tires.load(tires), patches=(patch,))
    car = world.car
    planner = GapFinder(car.parameters, mu, 8.0, assist="full+learn" if learns else "full")
    simulation = fg.Simulation(world)
    scan, odometry = simulation.reset()
    floor = simulation.engine._batches[0].floor
    greatest, sliding, found, touched = 0.0, 0.0, float("nan"), "no"
    for tick in range(int((time + AFTER) / simulation.period)):
        since = tick * simulation.period - time
        if since >= 0.0:
            floor.patches[:, 6] = STEP * mu
        scan, odometry = simulation.step(planner(scan, odometry))
        if since >= 0.0:
            slide = float(np.nanmax(simulation.slip.sliding_speed))
            greatest, sliding = max(greatest, slide), sliding + simulation.period * (slide > SLIDES)
            if learns and np.isnan(found) and planner.kept("learn")["learned"]["mu"] < 1.05 * STEP * mu:
                found = since
        if simulation.crashed:
            touched = f"{since:.1f} s"
            break
    used = planner.kept("learn")["learned"]["mu"] if learns else mu
    name = "learning" if learns else "told"
    slid = f"{touched:8} {greatest:20.3f} {sliding:12.2f}"
    return f"{Path(track).stem:15} {mu:4.2f}   {name:10} {slid} {found:20.2f} {used:8.3f}"


def main() -> None:
    """Run one of the two."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--track", help="one or several, with commas; default: twelve circuits")
    parser.add_argument("--maps", action="store_true", help="the race maps that are not among the twelve circuits")
    parser.add_argument("--tires", default="coulomb")
    parser.add_argument("--mu", default=",".join(map(str, MUS)))
    parser.add_argument("--laps", type=int, default=5)
    parser.add_argument("--odometry-drift", type=float, default=0.0)
    parser.add_argument("--lidar-noise", type=float, default=0.0)
    parser.add_argument("--speed-gain", type=float, default=1.0)
    parser.add_argument("--steering-gain", type=float, default=1.0)
    parser.add_argument("--step", action="store_true", help="a floor that becomes slippery in mid-race")
    options = parser.parse_args()
    tracks = options.track.split(",") if options.track else other_maps() if options.maps else circuits()
    mus = [float(text) for text in options.mu.split(",")]
    if options.step:
        step(tracks, options.tires, mus)
        return
    names = ("odometry_drift", "lidar_noise", "speed_gain", "steering_gain")
    compare(tracks, options.tires, mus, options.laps, {name: getattr(options, name) for name in names})


if __name__ == "__main__":
    main()
