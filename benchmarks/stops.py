"""Stops of gap_finder in bends, begun by a scan without a single reading; from then on the planner is blind.

    python benchmarks/stops.py [--tires coulomb,forzaeth_nuc2] [--track oval,fast,hairpins,chicanes] [--every 0.4]
        [--json FILE]

Of each set of tires: stops begun at 1, 2, 4, 7 and 15 m of radius on open ground, at .7, .85 and .95 of the speed that
the planner drives on that circle; and stops begun in laps of circuits, every 0.4 s from 3 to 15 s. A row has how many
there were, in how many a tire slid, the greatest slide in m/s, and how many cars of the laps touched a wall.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from functools import partial

import numpy as np
from common import parser, report, table

import fg_mujoco as fg
from fg_mujoco.controllers.control.slip import steered
from fg_mujoco.controllers.gap_finder import GapFinder
from fg_mujoco.controllers.safety.friction_limiter import held_on_circle
from fg_mujoco.lab.lab_ground import LabGround
from fg_mujoco.messages import DriveCommand, LaserScan, Odometry
from fg_mujoco.vehicle.car import WHEELS
from fg_mujoco.vehicle.tires import Tires, tire_names
from fg_mujoco.vehicle.vehicle import Vehicle

RADII = (1.0, 2.0, 4.0, 7.0, 15.0)  # [m]
SHARES = (0.7, 0.85, 0.95)  # of the planner's speed on the circle
FIRST, LAST = 3.0, 15.0  # [s] stops in laps
BLIND = LaserScan(
    stamp=0.0, angle_min=-2.356, angle_max=2.356, angle_increment=2.0 * 2.356 / 1080, range_min=0.02, range_max=30.0,
    ranges=np.zeros(1081),
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Row:
    """The stops on a set of tires."""

    tires: str
    where: str
    stops: int
    slid: int
    greatest_slide_m_s: float
    touched: int


class BlindFrom:
    """gap_finder, whose scans have no readings from a time on."""

    def __init__(self, planner: GapFinder, time: float) -> None:
        self._planner, self._time = planner, time

    def reset(self) -> None:
        self._planner.reset()

    def __call__(self, scan: LaserScan, odometry: Odometry) -> DriveCommand:
        if odometry.stamp >= self._time:
            scan = replace(scan, ranges=np.zeros(len(scan.ranges)))
        return self._planner(scan, odometry)


def on_circles(tires: Tires) -> Iterator[tuple[bool, float, bool]]:
    """Yield of each stop whether a tire slid, the greatest slide [m/s], and that nothing was touched."""
    ground, mu = LabGround(tires=tires), Vehicle.load().reliable_mu(tires)
    car = ground.car.parameters
    for radius in RADII:
        for share in SHARES:
            planner, angle = GapFinder(car, mu), math.atan(car.wheelbase / radius)
            limiter = planner.driver["limiter"][0]
            speed = share * min(held_on_circle(limiter, angle, 8.0, 0.0, 1.0)[1], 8.0)
            slip = limiter["slip"]
            wheels = steered(slip, limiter["car"], angle, speed) if slip["needs_slip_angle"] else angle
            ground.place(speed)
            shares = np.minimum(np.arange(80) / 30.0, 1.0).tolist()
            ground.run(DriveCommand(steering_angle=turned * wheels, speed=speed) for turned in shares)
            stop = ground.drive(partial(planner, BLIND), 8.0, until=lambda odometry: odometry.speed < 0.05)
            yield bool(stop.slip.slides.any()), float(np.nanmax(stop.slip.sliding_speed)), False


def in_laps(tires: str, track: str, every: float) -> Iterator[tuple[bool, float, bool]]:
    """Yield the same of each stop begun in laps of a circuit; after the touch of a wall nothing counts."""
    car = fg.World(track, tires=tires).car.parameters
    mu = Vehicle.load().reliable_mu(Tires.load(tires))
    for time in np.arange(FIRST, LAST, every).tolist():
        planner = BlindFrom(GapFinder(car, mu), time)
        run = fg.race(track, planner, laps=100, tires=tires, time_limit=time + 4.0).car
        touched = run.end_reason == "crash"
        begun = run.column("time_s") >= time
        if touched:
            begun[-1] = False
        if begun.any():
            slides = np.max([run.column(f"slide_{wheel}_m_s")[begun] for wheel in WHEELS])
            yield bool(run.column("sliding_steps")[begun].any()), float(slides), touched


def row_of(tires: str, where: str, found: list[tuple[bool, float, bool]]) -> Row:
    """Return the row of some stops."""
    return Row(
        tires=tires, where=where, stops=len(found), slid=sum(slid for slid, _, _ in found),
        greatest_slide_m_s=round(max(slide for _, slide, _ in found), 3), touched=sum(each for _, _, each in found),
    )  # fmt: skip


def main() -> None:
    given = parser(__doc__)
    given.add_argument("--tires", default=",".join(tire_names()), help="sets, by commas; default: all")
    given.add_argument("--track", default="oval,fast,hairpins,chicanes", help="circuits, by commas")
    given.add_argument("--every", type=float, default=0.4, help="[s] between stops in laps")
    options = given.parse_args()
    rows = []
    for name in options.tires.split(","):
        laps = [each for track in options.track.split(",") for each in in_laps(name, track, options.every)]
        rows += [row_of(name, "circles", list(on_circles(Tires.load(name)))), row_of(name, "laps", laps)]
    found = [asdict(row) for row in rows]
    report({"stops": found}, table(list(found[0]), [list(row.values()) for row in found]), options.json)


if __name__ == "__main__":
    main()
