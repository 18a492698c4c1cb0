"""Races a planner on the line of its first lap, and compares its laps from the third on with two scales.

    python benchmarks/remembered.py [--track six,maps,random:0:20] [--mu 1.0489,0.66] [--controller gap_finder]
        [--data ../shared/data] [--json FILE]

Five laps at 8 m/s. The laps from the third on are compared with those of gap_finder without `remember`, in the mean,
and with two bounds of lab.lap_time_bound by the grip of the car with two tracks: that of the planner's own line, and
that of the raceline of least time on the true map (0.1 m to the walls). The share of the own line's bound in the
other's says what the line costs; what is left is speed and steering. `six` are the bundled circuits, and `maps` those
of race_maps/.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from common import parser, report, table

import fg_mujoco as fg
from fg_mujoco.addons.drivers.racelines.grip import double_track_grip
from fg_mujoco.addons.drivers.racelines.raceline import GripLimits, make_raceline
from fg_mujoco.controllers.control.planner import Planner
from fg_mujoco.controllers.safety.known_line import line_of
from fg_mujoco.errors import FgMujocoError
from fg_mujoco.lab.lap_time_bound import fastest_speeds, lap_time, smooth_line
from fg_mujoco.racing.resolved import Resolved
from fg_mujoco.racing.setup import Setup

SIX = ("oval", "l_corridor", "hairpins", "chicanes", "fast", "tight")
SETTINGS = {"levine_slam": "[close=1.5]"}  # what a map needs that cannot be driven as it is
LAPS, FIRST = 5, 2  # laps, and the index of the first that counts
MOST_OF_BOUND, MOST_OF_GAP_FINDER = 1.12, 0.88  # asked for
TOLERANCE = 0.002  # [m] of the smoothed line
HEADER = (
    "course", "mu", "end", "crashes", "slide [m/s]", "laps 3 to 5 [s]", "of gap_finder", "of own bound",
    "of raceline's bound", "own bound of raceline's",
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Row:
    """How the planner raced; NaN: there is no such figure."""

    course: str
    mu: float
    end: str
    crashes: int
    slide: float  # [m/s] greatest
    laps: list[float]  # [s]
    mean: float  # [s] of the laps that count
    of_gap_finder: float
    of_own_bound: float
    of_raceline_bound: float
    own_of_raceline: float

    def cells(self) -> tuple[object, ...]:
        """Return what the table shows, in the order of HEADER."""
        shares = (self.of_gap_finder, self.of_own_bound, self.of_raceline_bound, self.own_of_raceline)
        return (
            self.course, f"{self.mu:g}", self.end.replace("_", " "), str(self.crashes), f"{self.slide:.4f}",
            f"{self.mean:.2f}", *(f"{share:.3f}" for share in shares),
        )  # fmt: skip


def drive(name: str, course: str, mu: float, controller: str) -> Row:
    """Race the planner and gap_finder on a course, and return how the laps compare."""
    setup = Setup.of(course, mu=mu, controller=controller, laps=LAPS)
    planner = Resolved.of(setup).build_planners()[0]
    car = fg.race(course, planner, laps=LAPS, mu=mu).car
    other = fg.race(course, "gap_finder[assist=full-remember]", laps=LAPS, mu=mu).car
    own = raceline = math.nan
    remembers = isinstance(planner, Planner) and "remember" in planner.stages
    line = line_of(planner) if remembers else np.empty((0, 2))
    if len(line):
        smooth = smooth_line(line, TOLERANCE)
        own = lap_time(smooth, fastest_speeds(smooth, GripLimits(grip=double_track_grip(setup.first))))
    try:
        raceline = make_raceline(setup).lap_time
    except FgMujocoError as error:
        print(f"{name}: {error}", flush=True)
    mean, of_other = (float(np.mean(each.lap_times_s[FIRST:] or [math.nan])) for each in (car, other))
    return Row(
        course=name, mu=mu, end=car.end_reason, crashes=car.collisions_wall, slide=car.max_slide_m_s,
        laps=list(car.lap_times_s), mean=mean, of_gap_finder=mean / of_other, of_own_bound=mean / own,
        of_raceline_bound=mean / raceline, own_of_raceline=own / raceline,
    )  # fmt: skip


def courses(kind: str, data: Path) -> list[tuple[str, str]]:
    """Return the names of courses, and what `load_track` takes."""
    if kind == "six":
        return [(name, name) for name in SIX]
    if kind == "maps":
        maps = sorted((data / "race_maps").glob("*.yaml"))
        return [(path.stem, f"{path}{SETTINGS.get(path.stem, '')}") for path in maps]
    if kind.startswith("random:") and kind.count(":") == 2:
        first, end = (int(number) for number in kind.split(":")[1:])
        return [(f"random:{seed}",) * 2 for seed in range(first, end)]
    return [(kind, kind)]


def summary(rows: Sequence[Row]) -> str:
    """Return how many rows reach what was asked for, and the medians."""
    count = len(rows)
    said = [f"{sum(row.end == 'finished' and row.crashes == 0 for row in rows)} of {count} finished without a crash"]
    said.append(f"greatest slide {max(row.slide for row in rows):.4f} m/s")
    for name, text, most in (
        ("of_gap_finder", "gap_finder's laps", MOST_OF_GAP_FINDER),
        ("of_own_bound", "the own line's bound", MOST_OF_BOUND),
        ("of_raceline_bound", "the raceline's bound", MOST_OF_BOUND),
    ):  # fmt: skip
        shares = np.array([getattr(row, name) for row in rows])
        reached = f"{np.sum(shares <= most)} of {count} at most {most:g}"
        said.append(f"of {text} {np.nanmedian(shares):.3f} in the median, {np.nanmax(shares):.3f} at most, {reached}")
    return "; ".join(said) + "."


def main() -> None:
    command = parser(__doc__)
    add = command.add_argument
    add("--track", default="six,maps,random:0:20", metavar="NAME,...", help="six, maps, random:FIRST:END, or a course")
    add("--mu", default="1.0489,0.66", metavar="MU,...", help="of the floor, and told to the planners")
    add("--controller", default="gap_finder", help="as `race --controller` takes it")
    add("--data", type=Path, default=Path(__file__).parents[1] / "../shared/data", help="folder that has race_maps/")
    options = command.parse_args()
    warnings.simplefilter("ignore")  # of keys in a map's file that are not map_server's
    chosen = [each for kind in options.track.split(",") for each in courses(kind, options.data)]
    rows = [
        drive(name, course, mu, options.controller)
        for mu in map(float, options.mu.split(","))
        for name, course in chosen
    ]
    by_mu = [[row for row in rows if row.mu == mu] for mu in dict.fromkeys(row.mu for row in rows)]
    text = "\n".join(f"mu {each[0].mu:g}: {summary(each)}" for each in by_mu)
    found = table(HEADER, [row.cells() for row in rows])
    report({"races": [asdict(row) for row in rows]}, f"{found}\n\n{text}", options.json)


if __name__ == "__main__":
    main()
