"""Planners that start behind a slower car and race it to the end: who finishes, touches, overtakes, and is at fault.

    python benchmarks/overtakers.py [--planner overtaker,...] [--course 100:120] [--opponents reactive,centreline,...]
        [--laps 3] [--max-speed 8] [--touches] [--json FILE]

Courses are random circuits, FIRST:END, of which every third is tight (`random:102:tight`), or names. The opponents are
those of `fg-mujoco overtake`: at each place no faster than a share of the planner's own pace there, .3 to .8 as the
course draws it, the same for all planners. Both stand on the grid `behind`. A race goes on after a touch, until the
planner's car has driven its laps or can go on no longer. Race control says who is at fault. `--touches` prints a line
for each touch. On tight courses many opponents that follow a line crash by themselves, and then stand in the way.
"""

from __future__ import annotations

import tempfile
from dataclasses import astuple, dataclass, replace
from pathlib import Path

import numpy as np
from common import parser, report, table

from fg_mujoco.addons.arena.runs.duels import alone, closed_track, opponent_entry, pace
from fg_mujoco.addons.arena.runs.slower_cars import make_opponent
from fg_mujoco.errors import ControllerError
from fg_mujoco.racing.race import RaceProgress, race_setup
from fg_mujoco.racing.rules import Contact
from fg_mujoco.racing.setup import Setup

OPPONENTS = "reactive,centreline,blocking"
RATIOS = (0.3, 0.8)  # least and greatest share of the planner's pace
PLANNER = "planner"


@dataclass(frozen=True, kw_only=True)
class Raced:
    """A race of two cars, to the end of the planner's."""

    planner: str
    course: str
    opponent: str
    ratio: float  # of the opponent's speed to the planner's pace
    end: str  # of the planner's race, as in END_REASONS
    time_s: float
    passed: bool  # it led the other at the end of its race, or a lap ahead of that
    overtakes: int  # by the planner
    contacts: tuple[Contact, ...]
    decision_us: float  # median of the planner's decisions, wall time

    @property
    def own_faults(self) -> int:
        """How many touches were the planner's fault, alone or with the other."""
        return sum(contact.blames(PLANNER) for contact in self.contacts)


def drawn_ratio(course: str, opponent: str) -> float:
    """Return the opponent's share of the planner's pace, as course and opponent draw it."""
    return float(np.random.default_rng([*f"{course} {opponent}".encode()]).uniform(*RATIOS))


def until_the_planner_is_done(progress: RaceProgress) -> None:
    """End a race, by an interrupt as of Ctrl-C, when that of its first car is over."""
    if not progress.running[0]:
        raise KeyboardInterrupt


def race(planner: str, course: str, opponent: str, base: Setup) -> Raced:
    """Race, and return what happened."""
    setup, ratio = base.replace(track=course, controller=planner), drawn_ratio(course, opponent)
    track, first = closed_track(setup), setup.first
    told = {"planner": planner, "course": course, "opponent": opponent, "ratio": ratio}
    try:
        own = pace(alone(setup))
    except ControllerError:  # it does not finish alone: no share of its pace can be told
        return Raced(**told, end="fails alone", time_s=0.0, passed=False, overtakes=0, contacts=(), decision_us=0.0)
    context = first.context(first.car.parameters, track.map_line)
    with tempfile.TemporaryDirectory() as folder:
        slower = make_opponent(opponent, track, own, ratio, context, Path(folder))
        entries = (replace(first, name=PLANNER), opponent_entry(first, slower, None))
        result = race_setup(replace(setup, entries=entries, grid="behind"), watch=until_the_planner_is_done)
    car, other = result.cars
    return Raced(
        **told, end=car.end_reason, time_s=car.end_time_s, contacts=result.contacts,
        passed=bool(car.column("progress_m")[-1] > other.column("progress_m")[-1]),
        overtakes=sum(each.by == PLANNER for each in result.overtakes),
        decision_us=1e6 * (car.decision_times.median_s or 0.0),
    )  # fmt: skip


def courses_in(text: str) -> list[str]:
    """Return the names of courses: FIRST:END of random circuits, every third of them tight, or names with commas."""
    first, _, end = text.partition(":")
    if not (first.isdigit() and end.isdigit()):
        return text.split(",")
    return [f"random:{seed}" + (":tight" if seed % 3 == 0 else "") for seed in range(int(first), int(end))]


def summary(name: str, races: list[Raced]) -> tuple[object, ...]:
    """Return a row of the table."""
    count = len(races)
    return (
        name, count, f"{sum(each.end == 'finished' for each in races) / count:.1%}",
        f"{sum(each.own_faults > 0 for each in races) / count:.1%}", sum(each.own_faults for each in races),
        sum(len(each.contacts) for each in races), f"{sum(each.passed for each in races) / count:.1%}",
        sum(each.overtakes for each in races), f"{float(np.median([each.decision_us for each in races])):.0f}",
    )  # fmt: skip


def main() -> None:
    """Race all, and print a table for each planner."""
    options = parser(__doc__)
    options.add_argument("--planner", default="overtaker", metavar="LIST")
    options.add_argument("--course", default="100:120", metavar="FIRST:END|LIST")
    options.add_argument("--opponents", default=OPPONENTS, metavar="LIST")
    options.add_argument("--laps", default=3, type=int)
    options.add_argument("--max-speed", default=8.0, type=float)
    options.add_argument("--touches", action="store_true", help="print each touch, and each race that is not finished")
    given = options.parse_args()
    base = Setup.of(laps=given.laps, max_speed=given.max_speed)
    rows, figures = [], []
    header = ("planner, opponent", "races", "finished", "with own fault", "own faults", "touches", "ahead at the end",
              "overtakes", "decision [us]")  # fmt: skip
    for planner in given.planner.split(","):
        raced = []
        for course in courses_in(given.course):
            for opponent in given.opponents.split(","):
                each = race(planner, course, opponent, base)
                raced.append(each)
                figures.append(dict(zip(Raced.__dataclass_fields__, astuple(each), strict=True)))
                if given.touches:
                    _print_touches(each)
        for opponent in given.opponents.split(","):
            rows.append(summary(f"{planner}, {opponent}", [each for each in raced if each.opponent == opponent]))
        tight = [each for each in raced if each.course.endswith("tight")]
        if tight:
            rows.append(summary(f"{planner}, on tight courses", tight))
        rows.append(summary(f"{planner}, all", raced))
    report({"races": figures}, table(header, rows), given.json)


def _print_touches(each: Raced) -> None:
    """Print a line for each touch of a race, and one if it was not finished."""
    where = f"{each.planner} {each.course} {each.opponent} {each.ratio:.2f}"
    if each.end != "finished":
        print(f"{where}: {each.end} after {each.time_s:.1f} s", flush=True)
    for contact in each.contacts:
        print(
            f"{where}: {contact.time_s:.2f} s, {contact.closing_speed_m_s:.2f} m/s, {contact.at_fault}: "
            f"{contact.reason}", flush=True,
        )  # fmt: skip


if __name__ == "__main__":
    main()
