"""How well moving targets are tracked: errors of the velocity, delay, targets that do not move, and time of a scan.

    python benchmarks/moving_targets.py [--seed 1000:1020] [--track oval,hairpins,...] [--pass 1000:1040] [--json FILE]

Scans and odometry are recorded while gap_finder drives `crossing_box` and a lap of each course, and tracked again with
noise of the ranges and with odometry that errs by a share. Truth is where the box is. Velocities count while the box is
more than a metre ahead, at least 0.25 m from where it turns back, and has been known for 0.1 s.

`--pass` also drives past other things that move, with predictions and without: two legs at 1 to 2 m/s that go back and
forth or cross once, a box that comes towards the car, one that comes out of cover, and two boxes that cross.
"""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np
from common import parser, report, stay_on_cores, table

import fg_mujoco as fg
from fg_mujoco.addons.arena.bundled_scenes import straight
from fg_mujoco.addons.arena.random_courses.moving import pedestrian
from fg_mujoco.controllers.gap_finder import GapFinder
from fg_mujoco.controllers.perception.scan_geometry import geometry_record
from fg_mujoco.controllers.perception.targets import TARGETS, track_targets
from fg_mujoco.course.moving_obstacles import MovingObstacle
from fg_mujoco.course.obstacles import Box
from fg_mujoco.messages import ODOMETRY
from fg_mujoco.vehicle.vehicle import Vehicle

CAR = Vehicle.load().parameters
COURSES = (
    "oval,l_corridor,hairpins,chicanes,fast,tight,spiral,serpentine,u_turns,random:1000:tight,scene:cylinder_field:1000"
)
ERRORS = ((0.0, 0.0), (0.02, 0.0), (0.02, 0.03), (0.02, 0.05))
"""Noise of the ranges [m] and share by which the odometry errs."""
NEAR = 0.6  # [m] from the box: a target there is the box


class Recorder:
    """Drives as gap_finder, and keeps what it is shown."""

    def __init__(self) -> None:
        self.planner = GapFinder(CAR, 1.0489, 8.0)
        self.log: list[tuple[Any, Any]] = []

    def reset(self) -> None:
        self.planner.reset()

    def __call__(self, scan: Any, odometry: Any) -> Any:
        self.log.append((scan, odometry))
        return self.planner(scan, odometry)


def tracked(log: list[tuple[Any, Any]], noise: float, drift: float) -> tuple[Any, Any, float]:
    """Return for each tick how many targets move, and what the first eight are; and the time of a scan [us]."""
    rng = np.random.default_rng(7)
    ranges = np.array([np.clip(np.nan_to_num(scan.ranges, posinf=30.0), 0.0, 30.0) for scan, _ in log])
    ranges = np.clip(ranges + rng.normal(0.0, noise, ranges.shape), 0.0, 30.0)
    odometry = np.zeros(len(log), ODOMETRY)
    odometry["speed"] = [(1.0 + drift) * each.speed for _, each in log]
    odometry["angular_velocity"][:, 2] = [(1.0 + drift) * each.yaw_rate for _, each in log]
    moves, places = np.zeros(len(log), np.int64), np.empty((len(log), 8, 4))
    memory, geometry, duration = np.zeros(1, TARGETS)[0], geometry_record(log[0][0])[0], 0.0
    places[:] = math.nan
    for tick in range(len(log)):
        began = time.process_time()
        moves[tick] = track_targets(memory, geometry, ranges[tick], odometry[tick], CAR.lidar_offset, 0.0)
        duration += time.process_time() - began
        targets = memory["targets"]
        first = targets[(targets["age"] > 0) & targets["moves"]][:8]
        places[tick, : len(first), :2] = first["ends"].mean(axis=1)
        places[tick, : len(first), 2], places[tick, : len(first), 3] = first["vx"], first["vy"]
    return moves, places, 1e6 * duration / len(log)


def box_errors(scene: str, log: list[tuple[Any, Any]], places: Any) -> tuple[list[Any], float]:
    """Return the errors of the velocity [m/s], ahead and aside, and when the box was first known [s]."""
    (box,) = fg.load_track(scene).moving
    errors, known, ahead = [], math.nan, CAR.lidar_offset
    for (_, odometry), rows in zip(log, places, strict=True):
        (x, y), (_, later) = box.position(odometry.stamp), box.position(odometry.stamp + 1e-3)
        ahead += 0.025 * odometry.speed
        away = np.hypot(rows[:, 0] + CAR.lidar_offset - x, rows[:, 1] - y)
        if not (away < NEAR).any():
            continue
        known = odometry.stamp if math.isnan(known) else known
        row = rows[np.nanargmin(away)]
        if x - ahead > 1.0 and abs(y) < 0.6 and odometry.stamp > known + 0.1:
            errors.append((row[2], row[3] - (later - y) / 1e-3))
    return errors, known


def back_and_forth(rng: Any, x: float, reach: float) -> MovingObstacle:
    """Return a box that crosses at 0.5 to 1.2 m/s, up to `reach` [m] to either side."""
    return MovingObstacle(
        length=0.3, width=0.4, start=(x, -reach), end=(x, reach), speed=float(rng.uniform(0.5, 1.2)),
        back_and_forth=True, headway=float(rng.uniform(0.0, 4.0 * reach)),
    )  # fmt: skip


def legs(rng: Any, start: float, end: float, **way: Any) -> list[MovingObstacle]:
    """Return two legs of a pedestrian who crosses from one y [m] to another at 1 to 2 m/s."""
    x, speed = float(rng.uniform(8.0, 12.0)), float(rng.uniform(1.0, 2.0))
    return pedestrian((x, start), (x, end), speed, **way)


def passing_scene(kind: str, seed: int) -> Any:
    """Return a corridor in which things of a kind move."""
    rng, standing, width, length = np.random.default_rng(seed), [], 2.6, 18.0
    side = 1.0 if rng.random() < 0.5 else -1.0
    if kind == "two legs, back and forth":
        moving = legs(rng, -1.0, 1.0, back_and_forth=True, headway=float(rng.uniform(0.0, 4.0)))
    elif kind == "two legs, once":
        moving = legs(rng, -3.0 * side, side)
    elif kind == "towards the car":
        y, length = float(rng.uniform(-0.5, 0.5)), 20.0
        moving = [MovingObstacle(length=0.5, width=0.3, start=(19.0, y), end=(2.0, -y), speed=float(rng.uniform(1, 2)))]
    elif kind == "out of cover":
        x, width = float(rng.uniform(8.0, 12.0)), 3.0
        standing = [Box(x=x - 0.6, y=1.15 * side, length=0.4, width=0.7)]
        moving = [back_and_forth(rng, x, 1.25)]
    else:
        width, length = 3.0, 20.0
        moving = [back_and_forth(rng, x, 1.25) for x in (8.0, float(rng.uniform(11.0, 14.0)))]
    return straight(f"{kind} {seed}", length, tuple(standing), moving=tuple(moving), width=width)


KINDS = ("two legs, back and forth", "two legs, once", "towards the car", "out of cover", "two boxes")


def passed(seeds: range) -> list[tuple[Any, ...]]:
    """Return a row for each kind and speed: races finished without predictions and with them."""
    return [
        (
            kind,
            f"{speed:g}",
            *(
                sum(
                    fg.race(passing_scene(kind, seed), planner, max_speed=speed).car.finished for seed in seeds
                )
                for planner in ("gap_finder[assist=full-prediction]", "gap_finder")
            ),
            len(seeds),
        )
        for kind in KINDS
        for speed in (8.0, 4.0)
    ]


def main() -> None:
    """Record, track, and print two tables."""
    options = parser(__doc__)
    options.add_argument("--seed", default="1000:1020", metavar="FIRST:END")
    options.add_argument("--track", default=COURSES, metavar="LIST")
    options.add_argument("--pass", default="", metavar="FIRST:END", dest="passing", help="seeds of other scenes")
    given = options.parse_args()
    stay_on_cores()
    first, end = map(int, given.seed.split(":"))
    scenes, courses = [f"scene:crossing_box:{seed}" for seed in range(first, end)], given.track.split(",")
    logs = {}
    for course in (*scenes, *courses):
        logs[course] = Recorder()
        fg.race(course, logs[course], laps=1)
    boxes, standing, figures = [], [], {}
    for noise, drift in ERRORS:
        errors, delays = [], []
        for scene in scenes:
            _, places, _ = tracked(logs[scene].log, noise, drift)
            found, known = box_errors(scene, logs[scene].log, places)
            errors += found
            delays.append(known)
        ahead, aside = np.sqrt(np.mean(np.square(errors), axis=0)).tolist()
        boxes.append((f"{noise:g} m, {drift:.0%}", f"{ahead:.2f}", f"{aside:.2f}", f"{np.nanmedian(delays):.2f}",
                      f"{np.nanmax(delays):.2f}", int(np.isnan(delays).sum())))  # fmt: skip
        figures[f"{noise:g} {drift:g}"] = {"ahead_m_s": ahead, "aside_m_s": aside, "delays_s": delays}
    for course in courses:
        row = [course]
        for noise, drift in ERRORS:
            moves, _, duration = tracked(logs[course].log, noise, drift)
            row.append(str(int((np.diff(moves, prepend=0) > 0).sum())))
        standing.append((*row, f"{duration:.1f}"))
    head = ("noise, odometry", "rms ahead [m/s]", "rms aside [m/s]", "known after [s], median", "longest", "never")
    names = (f"{noise:g} m, {drift:.0%}" for noise, drift in ERRORS)
    text = table(head, boxes) + "\n\nTargets that seem to move where all stands:\n\n"
    text += table(("course", *names, "a scan [us]"), standing)
    if given.passing:
        rows = passed(range(*map(int, given.passing.split(":"))))
        figures["passed"] = rows
        text += "\n\n" + table(("what moves", "speed [m/s]", "without", "with prediction", "of"), rows)
    report(figures, text, given.json)


if __name__ == "__main__":
    main()
