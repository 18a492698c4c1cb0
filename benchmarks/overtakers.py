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
import time
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from common import parser, report, table

from fg_mujoco.addons.arena.overtaking.duel import DuelSettings, alike_cars, pace
from fg_mujoco.addons.arena.overtaking.slower_opponents import Blocking, make_opponent
from fg_mujoco.addons.arena.race_control.race_control import RaceControl
from fg_mujoco.course.track import Track
from fg_mujoco.errors import ControllerError
from fg_mujoco.racing.entries import grid_starts
from fg_mujoco.racing.planners import ControllerChoice, make_controller
from fg_mujoco.racing.rules import RULES, Contact
from fg_mujoco.racing.setup import Setup
from fg_mujoco.simulation.engine import Engine
from fg_mujoco.simulation.planner_adapter import PlannersOfEach, adapt
from fg_mujoco.simulation.termination import END_REASONS

OPPONENTS = "reactive,centreline,blocking"
RATIOS = (0.3, 0.8)  # least and greatest share of the planner's pace
NAMES = ("planner", "opponent")


@dataclass(frozen=True, kw_only=True)
class Raced:
    """A race of two cars, to its end."""

    planner: str
    course: str
    opponent: str
    ratio: float  # of the opponent's speed to the planner's pace
    end: str  # of the planner's race, as in END_REASONS
    time_s: float
    passed: bool  # it led the other at the end of its race, or a lap ahead of that
    overtakes: int  # by the planner
    contacts: tuple[Contact, ...]
    decision_us: float  # median of a tick of the planner, processor time

    @property
    def own_faults(self) -> int:
        """How many touches were the planner's fault, alone or with the other."""
        return sum(contact.blames(NAMES[0]) for contact in self.contacts)


def drawn_ratio(course: str, opponent: str) -> float:
    """Return the opponent's share of the planner's pace, as course and opponent draw it."""
    return float(np.random.default_rng([*f"{course} {opponent}".encode()]).uniform(*RATIOS))


def race(planner: str, course: str, opponent: str, settings: DuelSettings, watch: Any = None) -> Raced:
    """Race, and return what happened; `watch`, if given, is called with the engine and the planner before each tick."""
    choice, ratio = ControllerChoice.of(planner), drawn_ratio(course, opponent)
    world = alike_cars(course, settings, 2)
    track = world.track
    assert isinstance(track, Track)
    try:
        alone = pace(course, choice, settings)
    except ControllerError:  # it does not finish alone: no share of its pace can be told
        return Raced(planner=planner, course=course, opponent=opponent, ratio=ratio, end="fails alone", time_s=0.0,
                     passed=False, overtakes=0, contacts=(), decision_us=0.0)  # fmt: skip
    context = settings.context(world)
    with tempfile.TemporaryDirectory() as folder:
        slower = make_opponent(opponent, track, alone, ratio, context, Path(folder))
    drives, taken = make_controller(choice.source, context, settings=dict(choice.settings)), []
    decide, opposes = adapt([drives]), adapt([slower])

    def timed(cars: Any) -> Any:
        began = time.thread_time()
        reasons = decide(cars)
        taken.append(time.thread_time() - began)
        return reasons

    timed.failures = decide.failures  # type: ignore[attr-defined]
    engine = Engine(world, laps=settings.laps)
    engine.planners = PlannersOfEach([(np.array([0]), timed), (np.array([1]), opposes)])  # type: ignore[list-item]
    engine.place(grid_starts(track, [each.parameters for each in world.cars], "behind"))
    control = RaceControl(engine, names=NAMES, rules=RULES["none"])
    timers = engine.monitor.timers
    while engine.running[0]:
        if isinstance(slower, Blocking):
            behind = float(timers["progress"][1] - timers["progress"][0])
            behind -= track.length * round(behind / track.length)
            slower.follower = (behind, float(timers["offset"][0]))
        if watch is not None:
            watch(engine, drives)
        engine.tick()
        control.after_tick()
    control.finish()
    return Raced(
        planner=planner, course=course, opponent=opponent, ratio=ratio, end=END_REASONS[engine.monitor.reasons[0]],
        time_s=engine.time(0), passed=bool(timers["progress"][0] > timers["progress"][1]),
        overtakes=sum(each.by == NAMES[0] for each in control.overtakes), contacts=tuple(control.contacts),
        decision_us=1e6 * float(np.median(taken)),
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
    settings = DuelSettings(
        base=Setup.of(laps=given.laps, max_speed=given.max_speed), slowest=RATIOS[0], fastest=RATIOS[1]
    )
    rows, figures = [], []
    header = ("planner, opponent", "races", "finished", "with own fault", "own faults", "touches", "ahead at the end",
              "overtakes", "decision [us]")  # fmt: skip
    for planner in given.planner.split(","):
        raced = []
        for course in courses_in(given.course):
            for opponent in given.opponents.split(","):
                each = race(planner, course, opponent, settings)
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
