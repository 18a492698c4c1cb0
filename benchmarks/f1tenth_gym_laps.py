"""Lap times of the same planner in f1tenth_gym's own simulator and in `fg_mujoco.addons.gym2d`.

    python benchmarks/f1tenth_gym_laps.py --gym PATH --map MAP.yaml [--map MAP.yaml ...] [--json FILE]

PATH is your own checkout of f1tenth_gym 0.2.1, its main branch. Two planners drive each map, and none knows where it
drives. Pure pursuit follows the map's centreline by the law of the gym's own example, with its lookahead of 0.82 m: at
constant speeds, and by a speed profile that corners with a given lateral acceleration and gathers and loses speed with
5 m/s^2. A wall follower balances what a few beams to the left and to the right measure.

Times are of the second lap, which begins rolling, by progress along the centreline. Our `gym2d` drives with its
default tires, contacts that let go, and with the linear ones of the gym's single-track model.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from common import parser, report, stay_on_cores, table
from f1tenth_gym import STEP, WHEELBASE, Driven, Observation, WaypointFollower, image_extension, ours, theirs

import fg_mujoco as fg
from fg_mujoco.course.track import follow

LOOKAHEAD = 0.82461887897713965  # [m] of the gym's example
WALLS_SPEED = 2.0  # [m/s]
GREATEST_SPEED, BRAKING = 8.0, 5.0  # [m/s], [m/s^2] of the profiles
LONGEST = 300.0  # [s]
MU, GRAVITY = 1.0489, 9.81

Planner = Callable[[Observation], Any]


def pure_pursuit(line: Any, speeds: Any) -> Planner:
    """Return the law of the gym's example, along a closed line with a speed for each point."""
    spans = np.roll(line, -1, axis=0) - line
    squares = (spans**2).sum(axis=1)

    def plan(observation: Observation) -> Any:
        x, y, heading = (float(observation[name][0]) for name in ("poses_x", "poses_y", "poses_theta"))
        here = np.array((x, y))
        shares = np.clip(((here - line) * spans).sum(axis=1) / squares, 0.0, 1.0)
        nearest = int(np.argmin(((line + shares[:, np.newaxis] * spans - here) ** 2).sum(axis=1)))
        distances = np.roll(np.hypot(*(line - here).T), -nearest)
        goal_x, goal_y = line[(nearest + max(1, int(np.argmax(distances >= LOOKAHEAD)))) % len(line)]
        left = math.cos(heading) * (goal_y - y) - math.sin(heading) * (goal_x - x)
        return np.array([[math.atan(WHEELBASE * 2.0 * left / LOOKAHEAD**2), speeds[nearest]]])

    return plan


def wall_follower(observation: Observation) -> Any:
    """Return the command that balances the walls to the left and to the right, 60 degrees off the heading."""
    ranges = observation["scans"][0]
    increment = 4.7 / (len(ranges) - 1)

    def gap(bearing: float) -> float:
        middle = round((bearing + 2.35) / increment)
        return min(float(np.mean(ranges[middle - 10 : middle + 11])), 6.0)

    left, right = gap(math.pi / 3.0), gap(-math.pi / 3.0)
    angle = 0.8 * (left - right) / (left + right)
    return np.array([[min(max(angle, -0.4189), 0.4189), WALLS_SPEED]])


def curvature(line: Any) -> Any:
    """Return the curvature of a closed line at each point, smoothed over 0.6 m [1/m]."""
    spacing = np.hypot(*(np.roll(line, -1, axis=0) - line).T)
    width = max(1, round(0.6 / float(np.median(spacing))))
    kernel = np.ones(width) / width
    smooth = np.array([np.convolve(np.r_[v[-width:], v, v[:width]], kernel, "same")[width:-width] for v in line.T]).T
    along = np.roll(smooth, -1, axis=0) - np.roll(smooth, 1, axis=0)
    headings = np.arctan2(along[:, 1], along[:, 0])
    turned = np.angle(np.exp(1j * (np.roll(headings, -1) - np.roll(headings, 1))))
    return np.abs(turned) / np.hypot(*along.T)


def profile(line: Any, lateral: float) -> Any:
    """Return speeds along a closed line that corner with `lateral` [m/s^2]."""
    spacing = np.hypot(*(np.roll(line, -1, axis=0) - line).T)
    speeds = np.minimum(GREATEST_SPEED, np.sqrt(lateral / np.maximum(curvature(line), 1e-6)))
    for _ in range(2):
        for i in reversed(range(len(line))):
            after = speeds[(i + 1) % len(line)]
            speeds[i] = min(speeds[i], math.sqrt(after**2 + 2.0 * BRAKING * spacing[i]))
        for i in range(len(line)):
            speeds[i] = min(speeds[i], math.sqrt(speeds[i - 1] ** 2 + 2.0 * BRAKING * spacing[i - 1]))
    return speeds


def second_lap(course: Any, way: Driven, planner: Planner) -> float | str:
    """Return the time of the second lap [s], or where it ended."""
    observed = way.reset(WaypointFollower(course.centreline, 1.0).starts(1))
    place, progress, first = float(course.project(course.centreline[:1])[0][0]), 0.0, math.nan
    for step in range(round(LONGEST / STEP)):
        observed = way.step(planner(observed))
        now, _ = follow(observed["poses_x"][0], observed["poses_y"][0], place, course.table, course.modulus)
        gone, place = math.remainder(now - place, course.length), now
        for laps in (1, 2):
            if progress < laps * course.length <= progress + gone:
                passed = STEP * (step + 1 - (progress + gone - laps * course.length) / gone)
                if laps == 2:
                    return passed - first
                first = passed
        progress += gone
        if np.any(observed["collisions"]):
            return f"crash at {progress:.0f} m"
    return f"no lap in {LONGEST:g} s"


def measure(checkout: Path, map_file: Path, speeds: list[float], laterals: list[float]) -> list[dict[str, Any]]:
    """Return the lap times of each planner on a map."""
    extension = image_extension(map_file)
    course = fg.load_track(str(map_file))
    line = course.centreline
    bends = curvature(line)
    ways = {
        "f1tenth_gym": theirs(checkout, map_file, extension),
        "default": ours(map_file, extension),
        "linear": ours(map_file, extension, tires="f1tenth_gym"),
    }
    driven: list[tuple[str, Planner, float]] = [
        (f"pure pursuit, {speed:g} m/s", pure_pursuit(line, np.full(len(line), speed)), speed**2 * float(bends.max()))
        for speed in speeds
    ]
    for lateral in laterals:
        planned = profile(line, lateral)
        most = float((planned**2 * bends).max())
        driven.append((f"pure pursuit, bends at {lateral:g} m/s^2", pure_pursuit(line, planned), most))
    driven.append((f"wall follower, {WALLS_SPEED:g} m/s", wall_follower, WALLS_SPEED**2 * float(bends.max())))
    return [
        {"map": map_file.stem, "planner": name, "share_of_limit": most / (MU * GRAVITY)}
        | {key: second_lap(course, way, planner) for key, way in ways.items()}
        for name, planner, most in driven
    ]


def beside(time: float | str, reference: float | str) -> str:
    """Return a lap time and its difference from another."""
    if isinstance(time, str):
        return time
    return f"{time:.3f}" if isinstance(reference, str) else f"{time:.3f} ({100.0 * (time / reference - 1.0):+.2f} %)"


def main() -> None:
    """Print the table."""
    arguments = parser(__doc__)
    arguments.add_argument("--gym", type=Path, required=True, metavar="PATH", help="a checkout of f1tenth_gym 0.2.1")
    arguments.add_argument(
        "--map", type=Path, required=True, action="append", metavar="FILE", help="of a closed course"
    )
    arguments.add_argument("--speeds", type=float, nargs="+", default=[3.0, 4.0, 5.0], help="[m/s], default 3 4 5")
    arguments.add_argument("--laterals", type=float, nargs="+", default=[5.0, 8.0, 12.0], help="[m/s^2], 5 8 12")
    options = arguments.parse_args()
    stay_on_cores(1)
    figures = [
        row
        for map_file in options.map
        for row in measure(options.gym.resolve(), map_file.resolve(), options.speeds, options.laterals)
    ]
    rows = [
        (
            row["map"], row["planner"], f"{row['share_of_limit']:.2f}", beside(row["f1tenth_gym"], ""),
            beside(row["default"], row["f1tenth_gym"]), beside(row["linear"], row["f1tenth_gym"]),
        )
        for row in figures
    ]  # fmt: skip
    heads = ("map", "planner", "of mu g", "f1tenth_gym [s]", "f110, default tires", "f110, tires f1tenth_gym")
    report({"laps": figures}, "Second laps\n\n" + table(heads, rows), options.json)


if __name__ == "__main__":
    main()
