"""What one decision costs: each bundled planner, called with messages and in batches, against follow-the-gap in numpy.

    python benchmarks/planners.py [--track oval] [--rounds 40] [--json FILE]

All decide about the same 256 scans of a lap, on one core, in one process; the ways take turns, and medians count.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from operator import attrgetter

import numpy as np
from common import interleaved, parser, report, stay_on_cores, table

import fg_mujoco as fg
from fg_mujoco.messages import ODOMETRY, DriveCommand, LaserScan, Odometry, ScanGeometry
from fg_mujoco.racing.planners import controller_names, make_controller
from fg_mujoco.vehicle.vehicle import Vehicle

BASELINE = "numpy follow-the-gap"
DECISIONS = 256  # a round
SIZES = (1, 16, 256)  # worlds in a batch


class FollowTheGap:
    """The baseline: a bubble round the nearest point, the widest gap, its farthest point, all in plain numpy."""

    def reset(self) -> None:
        """There is nothing to forget."""

    def __call__(self, scan: LaserScan, odometry: Odometry) -> DriveCommand:
        ranges = np.clip(np.nan_to_num(scan.ranges, nan=0.0, posinf=scan.range_max), 0.0, 10.0)
        ranges[np.abs(scan.bearings) > 0.5 * np.pi] = 0.0
        nearest = int(np.argmin(np.where(ranges > 0.0, ranges, np.inf)))
        width = int(np.ceil(0.3 / (scan.angle_increment * max(ranges[nearest], 0.1))))
        ranges[max(nearest - width, 0) : nearest + width + 1] = 0.0
        edges = np.flatnonzero(np.diff(np.concatenate(([False], ranges > 1.0, [False])).astype(np.int8)))
        if len(edges) == 0:
            return DriveCommand(steering_angle=0.0, speed=0.0)
        first, end = edges.reshape(-1, 2)[np.argmax(edges[1::2] - edges[::2])]
        goal = int(first + np.argmax(ranges[first:end]))
        angle = float(np.clip(scan.bearings[goal], -0.4189, 0.4189))
        return DriveCommand(steering_angle=angle, speed=float(min(6.0, 0.6 * ranges[goal])))


class Recorder:
    """The gap finder, with a record of what it sees."""

    def __init__(self, planner: fg.Controller) -> None:
        self.planner = planner
        self.seen: list[tuple[LaserScan, Odometry]] = []

    def reset(self) -> None:
        self.planner.reset()

    def __call__(self, scan: LaserScan, odometry: Odometry) -> DriveCommand:
        self.seen.append((scan, odometry))
        return self.planner(scan, odometry)


def make(name: str, track: str) -> fg.Controller:
    car, line = Vehicle.load().parameters, fg.load_track(track).map_line
    return make_controller(name, car=car, mu=Vehicle.load().nominal_mu, max_speed=8.0, map_line=line)


def ways_of(
    name: str, track: str, planner: fg.Controller, seen: list[tuple[LaserScan, Odometry]]
) -> dict[str, Callable[[], None]]:
    """Return what decides about all that was seen: the planner alone, and in batches where its class offers them."""

    def alone() -> None:
        for scan, odometry in seen:
            planner(scan, odometry)

    ways: dict[str, Callable[[], None]] = {"alone": alone}
    make_batch = getattr(type(planner), "batch", None)
    if make_batch is None:
        return ways
    scan = seen[0][0]
    geometry = ScanGeometry(**{field.name: getattr(scan, field.name) for field in fields(ScanGeometry)})
    ranges = np.array([scan.ranges for scan, _ in seen])
    motion = attrgetter(*ODOMETRY.names or ())
    rows = np.array([motion(odometry) for _, odometry in seen], ODOMETRY)
    for size in SIZES:
        batch = make_batch([make(name, track) for _ in range(size)])
        running, commands = np.ones(size, np.bool_), np.zeros((size, 2))

        def together(batch=batch, size=size, running=running, commands=commands) -> None:  # type: ignore[no-untyped-def]
            for first in range(0, len(seen), size):
                batch(geometry, ranges[first : first + size], rows[first : first + size], running, commands)

        ways[f"batch of {size}"] = together
    return ways


def measure(track: str, rounds: int) -> dict[str, dict[str, float]]:
    """Return the median time of a decision [us], for each planner and way of asking it."""
    recorder = Recorder(make("gap_finder", track))
    fg.race(track, recorder, laps=1)
    picks = np.linspace(0, len(recorder.seen) - 1, DECISIONS).astype(int)
    seen = [recorder.seen[pick] for pick in picks]
    planners: dict[str, fg.Controller] = {BASELINE: FollowTheGap()}
    planners.update({name: make(name, track) for name in controller_names()})
    all_ways = {name: ways_of(name, track, planner, seen) for name, planner in planners.items()}
    flat = {f"{name}/{way}": decide for name, ways in all_ways.items() for way, decide in ways.items()}
    for decide in flat.values():  # compiles
        decide()
    medians = interleaved(flat, rounds)
    return {
        name: {way: round(medians[f"{name}/{way}"] / DECISIONS, 2) for way in ways} for name, ways in all_ways.items()
    }


def main() -> None:
    """Print the table."""
    options = parser(__doc__)
    options.add_argument("--track", default="oval")
    options.add_argument("--rounds", type=int, default=40)
    args = options.parse_args()
    stay_on_cores(1)
    medians = measure(args.track, args.rounds)
    columns = ("alone", f"batch of {SIZES[-1]}")  # the JSON has the other sizes, too
    rows = [
        (name, *(taken.get(column, "") for column in columns), taken["alone"] / medians[BASELINE]["alone"])
        for name, taken in medians.items()
    ]
    title = f"One decision about 1081 beams on {args.track} [us], medians of {args.rounds} rounds of {DECISIONS}\n\n"
    report(
        {"track": args.track, "us_per_decision": medians},
        title + table(("", *columns, "times the baseline"), rows),
        args.json,
    )


if __name__ == "__main__":
    main()
