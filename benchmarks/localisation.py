"""How well a car is localised on a map: tracking, a start that is not known, laps on the pose, and what a scan costs.

    python benchmarks/localisation.py [--data ../shared/data] [--maps f,rca2] [--track oval,tight] [--starts 100]
        [--seed 1] [--noise 0.02] [--latency 0.025] [--odometry-drift 0.05] [--speed 8] [--only tracking,cost]
        [--json FILE]

The maps are those of race_maps/ in `--data`, which are not part of the repository; `--maps none` leaves them out. On
each course two laps are driven by pure_pursuit on the true pose, or, where that does not finish, by gap_finder, and all
that the planner was given is kept. The methods localise on that. Parts:

- tracking: with the start given, how far each pose is from the true one at the odometry's stamp;
- starts: the car is put down without being told where, at a random time of these drives; the pose after 3 s is right
  within 0.3 m and 10 degrees, wrong, or not known yet;
- laps: pure_pursuit, two laps, on the true pose and on those that are found;
- cost: processor time of a scan of 60 beams with 2000 particles, in all and for the likelihood alone, and of the
  likelihood in three other ways.
"""

from __future__ import annotations

import argparse
import math
import time
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from common import parser, report, stay_on_cores, table
from race_maps import SETTINGS, find_maps

import fg_mujoco as fg
from fg_mujoco.addons.drivers.localisation.distance_field import DistanceField, Distances, distance_at
from fg_mujoco.addons.drivers.localisation.localiser import Localiser, PoseSettings
from fg_mujoco.addons.drivers.localisation.particle_filter import ParticleFilter, costs_of
from fg_mujoco.addons.realcar.mapping.driven_map import Recorder
from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.messages import FloatArray, LaserScan, Odometry
from fg_mujoco.simulation.settings import DriveSettings

METHODS = ("particle_filter", "scan_matching")
PARTS = ("tracking", "starts", "laps", "cost")
CIRCUITS = "chicanes,fast,hairpins,l_corridor,oval,tight"
LAPS, LONGEST = 2, 120.0  # [s] of a drive
FOUND_WITHIN, RIGHT, RIGHT_TURN = 3.0, 0.3, 10.0  # [s], [m], [deg]
NEAR = 0.15  # [m]


def keywords(options: argparse.Namespace) -> dict[str, Any]:
    """Return the settings of all races."""
    effects = fg.LidarEffects(range_noise_std=options.noise, latency=options.latency)
    return {"effects": effects, "odometry_drift": options.odometry_drift, "max_speed": options.speed}


def drive(course: fg.Course, options: argparse.Namespace) -> tuple[str, list[tuple[LaserScan, Odometry]]]:
    """Return which planner drove, and what it was given in each tick."""
    best: tuple[str, list[tuple[LaserScan, Odometry]]] = ("", [])
    settings = DriveSettings(**keywords(options))
    for name in ("pure_pursuit", "gap_finder"):
        context = settings.context(settings.world(course).parameters, course.map_line)
        recorder = Recorder(fg.make_controller(name, context))
        result = fg.race(course, recorder, laps=LAPS, time_limit=LONGEST, **keywords(options))
        if len(recorder.given) > len(best[1]) or result.car.end_reason == "finished":
            best = name, recorder.given
        if result.car.end_reason == "finished":
            break
    return best


def localise(
    method: str, course: fg.Course, given: Sequence[tuple[LaserScan, Odometry]], seed: int, start: str
) -> tuple[FloatArray, FloatArray]:
    """Return the error of each pose (n, 2) [m], [deg], NaN where there was none, and the time it took (n,) [ms]."""
    found = Localiser.of(
        PoseSettings(pose=method, pose_start=start), course.map_line, fg.Vehicle.load().parameters, seed
    )  # fmt: skip
    errors, times = np.full((len(given), 2), math.nan), np.zeros(len(given))
    for tick, (scan, odometry) in enumerate(given):
        begin = time.thread_time()
        pose = found.locate(scan, odometry)
        times[tick] = 1e3 * (time.thread_time() - begin)
        x, y, heading = pose - odometry.pose
        if math.isfinite(heading):
            errors[tick] = math.hypot(x, y), abs(math.degrees(math.remainder(heading, math.tau)))
    return errors, times


def tracking(drives: dict[str, Any], options: argparse.Namespace) -> tuple[str, list[dict[str, Any]]]:
    """Return the table of tracking, and its figures."""
    rows: list[dict[str, Any]] = []
    for method in METHODS:
        every = []
        for name, (course, planner, given) in drives.items():
            errors, times = localise(method, course, given, options.seed, "given")
            every.append(errors)
            rows.append({"method": method, "course": name, "driven_by": planner, **figures_of(errors, times)})
        rows.append({"method": method, "course": "all", "driven_by": "", **figures_of(np.concatenate(every), None)})
    header = ("course", "method", "median [cm]", "95 % [cm]", "median [deg]", "95 % [deg]", "within 15 cm", "ms")
    cells = [
        (
            row["course"], row["method"], 100.0 * row["median_m"], 100.0 * row["most_m"], row["median_deg"],
            row["most_deg"], f"{100.0 * row['near']:.1f} %", row["median_ms"],
        )
        for row in rows
    ]  # fmt: skip
    return table(header, cells), rows


def figures_of(errors: FloatArray, times: FloatArray | None) -> dict[str, Any]:
    """Return the figures of a row; a pose that is not known is as far off as can be."""
    far = np.where(np.isfinite(errors), errors, math.inf)
    median, most = np.quantile(far, 0.5, axis=0, method="higher"), np.quantile(far, 0.95, axis=0, method="higher")
    return {
        "median_m": float(median[0]), "median_deg": float(median[1]), "most_m": float(most[0]),
        "most_deg": float(most[1]), "near": float(np.mean(far[:, 0] < NEAR)),
        "median_ms": "" if times is None else float(np.median(times)),
    }  # fmt: skip


def starts(drives: dict[str, Any], options: argparse.Namespace) -> tuple[str, list[dict[str, Any]]]:
    """Return the table of starts that are not known, and its figures."""
    ticks = round(FOUND_WITHIN / 0.025)
    rows: list[dict[str, Any]] = []
    names = list(drives)
    for method in METHODS:
        rng = np.random.default_rng(options.seed)
        for number in range(options.starts):
            name = names[number % len(names)]
            course, _, given = drives[name]
            begin = int(rng.integers(0, max(len(given) - ticks, 1)))
            errors, times = localise(method, course, given[begin : begin + ticks], number, "unknown")
            distance, turned = errors[-1]
            right = bool(distance < RIGHT and turned < RIGHT_TURN)
            said = "right" if right else "not yet" if math.isnan(distance) else "wrong"
            off = np.flatnonzero(~(errors[:, 0] < RIGHT))
            after = 0.025 * (off[-1] + 2 if len(off) else 1) if right else None
            rows.append(
                {"method": method, "course": name, "said": said, "after_s": after, "slowest_ms": float(times.max())}
            )  # fmt: skip
    header = ("course", "method", "right after 3 s", "wrong", "not yet", "found after, median [s]")
    cells = []
    for method in METHODS:
        for name in [*names, "all"]:
            of = [row for row in rows if row["method"] == method and name in (row["course"], "all")]
            counts = [sum(row["said"] == said for row in of) for said in ("right", "wrong", "not yet")]
            after = [row["after_s"] for row in of if row["after_s"] is not None]
            said = f"{counts[0]} of {len(of)}"
            cells.append((name, method, said, *counts[1:], float(np.median(after)) if after else "-"))
    return table(header, cells), rows


def laps(drives: dict[str, Any], options: argparse.Namespace) -> tuple[str, list[dict[str, Any]]]:
    """Return the table of laps on the pose, and its figures."""
    rows: list[dict[str, Any]] = []
    for name, (course, _, _) in drives.items():
        row: dict[str, Any] = {"course": name}
        for pose in ("truth", *METHODS):
            result = fg.race(
                course, f"pure_pursuit[pose={pose}]", laps=LAPS, seed=options.seed, time_limit=LONGEST,
                **keywords(options),
            )  # fmt: skip
            car = result.car
            clean = car.end_reason == "finished" and car.collisions_wall == 0
            row[pose] = {"clean": clean, "end": car.end_reason, "seconds": sum(car.lap_times_s) if clean else None}
        rows.append(row)
    cells: list[tuple[Any, ...]] = []
    for row in rows:
        truth = row["truth"]["seconds"]
        texts = [f"{truth:.2f} s" if truth else row["truth"]["end"]]
        for pose in METHODS:
            seconds = row[pose]["seconds"]
            texts.append(row[pose]["end"] if seconds is None else f"{seconds / truth:.4f}" if truth else "clean")
        cells.append((row["course"], *texts))
    clean = [f"{sum(row[pose]['clean'] for row in rows)} of {len(rows)} clean" for pose in ("truth", *METHODS)]
    return table(("course", "true pose, two laps", *METHODS), [*cells, ("all", *clean)]), rows


@kernel
def march(
    distances: Distances, column: float, row: float, ahead_x: float, ahead_y: float, resolution: float, reach: float
) -> float:
    """Return the range [m] of a ray from a place in nodes, by steps as long as the distance to the walls."""
    far = 0.0
    for _ in range(100):
        distance = distance_at(distances, column + far / resolution * ahead_x, row + far / resolution * ahead_y)
        far += distance
        if distance < 0.1 * resolution or far > reach:
            break
    return min(far, reach)


@kernel
def costs_by_marching(
    particles: FloatArray, distances: Distances, origin: FloatArray, resolution: float, offset: float,
    bearings: FloatArray, ranges: FloatArray, error: float, outlier: float, costs: FloatArray,
) -> None:  # fmt: skip
    """Write the costs of particles by the beam model, with ray marching on the distance field."""
    for k in range(len(particles)):
        x, y, heading = particles[k, 0], particles[k, 1], particles[k, 2]
        column = (x + offset * math.cos(heading) - origin[0]) / resolution
        row = (y + offset * math.sin(heading) - origin[1]) / resolution
        costs[k] = 0.0
        for beam in range(len(bearings)):
            ahead = heading + bearings[beam]
            found = march(distances, column, row, math.cos(ahead), math.sin(ahead), resolution, 30.0)
            squared = (found - ranges[beam]) ** 2
            costs[k] += squared / (2.0 * error * error + squared / outlier)


@kernel
def fill_ranges(distances: Distances, nodes: Any, resolution: float, ranges: Any) -> None:
    """Write the ranges (k, headings) [m] from nodes (k, 2), for the look-up table."""
    for k in range(len(nodes)):
        for turn in range(ranges.shape[1]):
            ahead = 2.0 * math.pi * turn / ranges.shape[1]
            column, row = float(nodes[k, 0]), float(nodes[k, 1])
            ranges[k, turn] = march(distances, column, row, math.cos(ahead), math.sin(ahead), resolution, 30.0)


@kernel
def costs_by_table(
    particles: FloatArray, places: Any, known: Any, origin: FloatArray, resolution: float, offset: float,
    bearings: FloatArray, ranges: FloatArray, error: float, outlier: float, costs: FloatArray,
) -> None:  # fmt: skip
    """Write the costs of particles by the beam model, with the ranges of a table of nodes and headings."""
    count = known.shape[1]
    for k in range(len(particles)):
        x, y, heading = particles[k, 0], particles[k, 1], particles[k, 2]
        column = round((x + offset * math.cos(heading) - origin[0]) / resolution)
        row = round((y + offset * math.sin(heading) - origin[1]) / resolution)
        at = places[min(max(row, 0), places.shape[0] - 1), min(max(column, 0), places.shape[1] - 1)]
        costs[k] = 0.0
        for beam in range(len(bearings)):
            turn = int((heading + bearings[beam]) / (2.0 * math.pi) * count + 0.5 + 4 * count) % count
            squared = (known[at, turn] - ranges[beam]) ** 2 if at >= 0 else 1e9
            costs[k] += squared / (2.0 * error * error + squared / outlier)


@kernel
def costs_by_nodes(
    particles: FloatArray, distances: Distances, origin: FloatArray, resolution: float, ends: Any, error: float,
    outlier: float, costs: FloatArray,
) -> None:  # fmt: skip
    """Write the costs of particles by the likelihood field, at the nodes that are nearest to the ends."""
    rows, columns = distances.shape
    for k in range(len(particles)):
        cos, sin = math.cos(particles[k, 2]) / resolution, math.sin(particles[k, 2]) / resolution
        x, y = (particles[k, 0] - origin[0]) / resolution + 0.5, (particles[k, 1] - origin[1]) / resolution + 0.5
        costs[k] = 0.0
        for beam in range(len(ends)):
            column = min(max(int(x + cos * ends[beam, 0] - sin * ends[beam, 1]), 0), columns - 1)
            row = min(max(int(y + sin * ends[beam, 0] + cos * ends[beam, 1]), 0), rows - 1)
            squared = distances[row, column] * distances[row, column]
            costs[k] += squared / (2.0 * error * error + squared / outlier)


def cost(drives: dict[str, Any], options: argparse.Namespace) -> tuple[str, list[dict[str, Any]]]:
    """Return the table of what a scan costs, and how well one scan tells the pose in each way."""
    rng, rows = np.random.default_rng(options.seed), []
    car = fg.Vehicle.load().parameters
    ways = ("likelihood field, interpolated", "likelihood field, nearest node", "ray marching", "table of ranges")
    spent: dict[str, list[float]] = {name: [] for name in ("whole scan", *ways)}
    off: dict[str, list[float]] = {name: [] for name in ways}
    built: list[float] = []
    for course, _, given in drives.values():
        field = DistanceField.of(course.map_line)
        filter_ = ParticleFilter(field, np.random.default_rng(1), 2000)
        column = np.argwhere(field.distances > 0.0)
        places = np.full(field.distances.shape, -1, np.int32)
        places[tuple(column.T)] = np.arange(len(column))
        known = np.empty((len(column), 180), np.float32)
        begin = time.thread_time()
        fill_ranges(field.distances, np.ascontiguousarray(column[:, ::-1]), field.resolution, known)
        built.append(time.thread_time() - begin)
        for _ in range(10):
            tick = int(rng.integers(40, len(given) - 2))
            truth = given[tick][1].pose
            scan = next(scan for scan, _ in given[tick:] if scan.stamp >= given[tick][1].stamp - 1e-9)
            beams = np.linspace(0, len(scan.ranges) - 1, 60).round().astype(int)
            beams = beams[np.isfinite(scan.ranges[beams])]
            ranges, bearings = np.asarray(scan.ranges)[beams], scan.bearings[beams]
            ends = np.column_stack((car.lidar_offset + ranges * np.cos(bearings), ranges * np.sin(bearings)))
            few, costs = ends.astype(np.float32), np.empty(2000)
            filter_.start(truth, (0.1, 0.05))
            particles, map_ = filter_.particles.copy(), (field.distances, field.origin, field.resolution)
            beam_model = (car.lidar_offset, bearings, ranges, 0.06, 4.0, costs)

            def whole(filter_: ParticleFilter = filter_, ends: FloatArray = ends) -> None:
                filter_.move(0.1, 0.02)
                filter_.see(ends)

            calls: dict[str, Callable[[], None]] = {
                ways[0]: lambda p=particles, m=map_, f=few, c=costs: costs_of(p, *m, f, 0.06, 4.0, c),
                ways[1]: lambda p=particles, m=map_, f=few, c=costs: costs_by_nodes(p, *m, f, 0.06, 4.0, c),
                ways[2]: lambda p=particles, m=map_, b=beam_model: costs_by_marching(p, *m, *b),
                ways[3]: lambda p=particles, m=map_, b=beam_model, t=(places, known): costs_by_table(p, *t, *m[1:], *b),
            }  # type: ignore[misc]
            spent["whole scan"].append(clocked(whole))
            for name, call in calls.items():
                call()
                spent[name].append(min(clocked(call) for _ in range(3)))
                weights = np.exp(costs.min() - costs)
                mean = weights @ particles[:, :2] / weights.sum()
                off[name].append(float(math.hypot(*(mean - truth[:2]))))
    for name, times in spent.items():
        rows.append({"what": name, "median_ms": float(np.median(times)), "most_ms": float(np.quantile(times, 0.95))})
        if name in off:
            rows[-1]["off_m"] = float(np.median(off[name]))
    rows[-1]["built_s"] = float(np.median(built))
    cells = []
    for row in rows:
        off_cm = 100.0 * row["off_m"] if "off_m" in row else "-"
        cells.append((row["what"], row["median_ms"], row["most_ms"], off_cm, row.get("built_s", "-")))
    header = ("2000 particles, 60 beams", "median [ms]", "95 % [ms]", "off by one scan, median [cm]", "built in [s]")
    return table(header, cells), rows


def clocked(call: Callable[[], None]) -> float:
    """Return the processor time of a call [ms]."""
    begin = time.thread_time()
    call()
    return 1e3 * (time.thread_time() - begin)


def main() -> None:
    """Drive, localise, and print the tables."""
    made = parser(__doc__)
    add = made.add_argument
    add("--data", type=Path, default=Path("../shared/data"))
    add("--maps", type=lambda text: text.split(","), default=None, metavar="NAMES")
    add("--track", default=CIRCUITS, metavar="NAMES")
    add("--starts", type=int, default=100)
    add("--seed", type=int, default=1)
    add("--noise", type=float, default=0.02, metavar="M")
    add("--latency", type=float, default=0.025, metavar="S")
    add("--odometry-drift", type=float, default=0.05)
    add("--speed", type=float, default=8.0, metavar="M/S")
    add("--only", default=",".join(PARTS), metavar="PARTS")
    options = made.parse_args()
    stay_on_cores()
    warnings.simplefilter("ignore")  # of keys in a map's file that are not map_server's
    found = [(path.stem, f"{path}{SETTINGS.get(path.stem, '')}") for path in find_maps(options.data, options.maps)]
    found += [(name, name) for name in options.track.split(",") if name]
    drives = {}
    for name, source in found:
        course = fg.load_track(source)
        drives[name] = (course, *drive(course, options))
    parts: dict[str, Any] = {"tracking": tracking, "starts": starts, "laps": laps, "cost": cost}
    texts, figures = [], {}
    for part in options.only.split(","):
        text, figures[part] = parts[part](drives, options)
        texts.append(f"{part}:\n\n{text}\n")
        print(texts[-1], flush=True)
    report(figures, "", options.json)


if __name__ == "__main__":
    main()
