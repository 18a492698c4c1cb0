"""Race monitor: times the laps of the cars of some worlds, and says when each race is over and why.

native/simulation/termination.cpp judges.
"""

from __future__ import annotations

import math
from copy import copy
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..course.lap_timer import fresh_timers

Mask = NDArray[np.bool_]

WRONG_WAY_LIMIT = 5.0
"""[m] A race ends when the car has come back this far from its greatest progress.

A stretch with sections, as `course.projection` has them in tight bends, counts once the car has left it: both arms of
the bend are one wide place there, and a car that crosses it to and fro has not turned back.
"""

END_REASONS = (
    "", "unstable", "crash", "finished", "wrong_way", "no_progress", "time_limit", "interrupted", "failed",
    "planner_failed", "decision_limit", "worker_died", "disqualified", "rolled_over",
)  # fmt: skip
"""By number; the first is that of a race that goes on. "unstable": MuJoCo warned of a bad state. "wrong_way": the car
came back by WRONG_WAY_LIMIT from its greatest progress, reversing or with its nose against the course. "failed": in a
batch, the engine raised. "planner_failed": the planner did, or answered something else than a command.
"decision_limit": the planner took longer for a decision than it was allowed, or never answered. "worker_died": of a
world whose planner ended the process that drove it. "disqualified": by race control, after too many warnings.
"rolled_over": the car is tilted by more than motion.ROLLED_OVER, on its side or its roof."""



@dataclass(frozen=True, kw_only=True)
class WrongWay:
    """Place where a car that went the wrong way turned: where its progress was greatest first. Fields as in the JSON.

    Its text is for people: "turned at (3.10, -0.02) m, 12.3 m into lap 1, t = 4.10 s"; of one that went back without
    turning round, "reversed from".
    """

    time_s: float
    x_m: float
    y_m: float
    lap: int  # from 1
    s_m: float  # progress in that lap
    speed_m_s: float  # mean from there on along its own heading; negative: it reversed

    @classmethod
    def of(cls, timer: Any, length: float, laps: int, speed: float) -> WrongWay:
        """Return the place where a car turned, by its row of LAP_TIMER, a lap's length [m] and the laps of the race."""
        done = min(int(timer["laps_completed"]), laps - 1)
        return cls(
            time_s=float(timer["furthest_time"]), x_m=float(timer["furthest_x"]), y_m=float(timer["furthest_y"]),
            lap=done + 1, s_m=float(timer["furthest"]) - done * length, speed_m_s=speed,
        )  # fmt: skip

    def __str__(self) -> str:
        place = f"({self.x_m:.2f}, {self.y_m:.2f}) m"
        how = "reversed from" if self.speed_m_s < 0.0 else "turned at"
        return f"{how} {place}, {self.s_m:.1f} m into lap {self.lap}, t = {self.time_s:.2f} s"


class RaceMonitor:
    """The races of r cars: laps, which go on, and why the others ended. None runs before its car is placed.

    Attributes:
      laps: to be driven.
      running, reasons: which races go on, and numbers in END_REASONS, (r,).
      timers: of the laps, (r,) of LAP_TIMER.
      lap_times: [s], NaN where not driven, (r, laps).
      standing_since: when each car has come to stand behind the goal, NaN while it has not, (r,) [s].
    """

    def __init__(self, count: int, laps: int) -> None:
        self.laps = laps
        self.running = np.zeros(count, np.bool_)
        self.reasons = np.zeros(count, np.int64)
        self.lap_times = np.full((count, laps), math.nan)
        self.timers = fresh_timers(count)
        self.standing_since = np.full(count, math.nan)

    def part(self, rows: slice) -> RaceMonitor:
        """Return the monitor of some of the cars: views."""
        monitor = copy(self)
        for name in ("running", "reasons", "lap_times", "timers", "standing_since"):
            setattr(monitor, name, getattr(self, name)[rows])
        return monitor

    def end(self, which: Mask, reason: str) -> None:
        """End the races of some cars, (r,), for another reason, one of END_REASONS."""
        self.reasons[which], self.running[which] = END_REASONS.index(reason), False
