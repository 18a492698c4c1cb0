"""Race monitor: times the laps of the cars of some worlds, and says when each race is over and why."""

from __future__ import annotations

import math
from copy import copy
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..compiled.kernels import kernel
from ..course.lap_timer import fresh_timers, time_lap
from ..messages import FloatArray
from ..vehicle.motion import CarArray, is_rolled_over, planar_pose
from .physics import BAD_WARNINGS, StateLayout

Mask = NDArray[np.bool_]

WRONG_WAY_LIMIT = 5.0
"""[m] A race ends when the car has come back this far from its greatest progress.

A stretch with sections, as `course.projection` has them in tight bends, counts once the car has left it: both arms of
the bend are one wide place there, and a car that crosses it to and fro has not turned back.
"""
NO_PROGRESS_LIMIT = 10.0  # [s] a race ends when the car has not come further for this long
STANDING_SPEED = 0.05  # [m/s] a car slower than this stands still, where the goal is to stop

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

_FIRST_BAD, _END_OF_BAD = BAD_WARNINGS.start, BAD_WARNINGS.stop
_UNSTABLE, _CRASH, _FINISHED, _WRONG_WAY, _NO_PROGRESS, _TIME_LIMIT = range(1, 7)
_ROLLED_OVER = END_REASONS.index("rolled_over")


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


@kernel
def judge_cars(
    running: Mask,
    reasons: NDArray[np.int64],
    cars_per_world: int,
    states: FloatArray,
    layout: StateLayout,
    cars: CarArray,
    warnings: NDArray[np.int32],
    crashed: Mask,
    timers: NDArray[np.void],
    lap_times: FloatArray,
    standing_since: FloatArray,
    table: FloatArray,
    length: float,
    modulus: float,
    stop_time: float,
    laps: int,
    last_time: float,
) -> None:
    """Time the laps of each car that runs, and end the races that are over, with the number of their reason."""
    for row in range(len(running)):
        if not running[row]:
            continue
        world = row // cars_per_world
        time = states[world, layout.time]
        qpos = states[world, layout.qpos[0] : layout.qpos[1]]
        x, y, _ = planar_pose(qpos, cars[row : row + 1])
        time_lap(timers, row, lap_times, time, x, y, table, length, modulus)
        done = timers[row].laps_completed
        if stop_time > 0.0:  # the goal counts once the car has stood behind it
            dof = layout.qvel[0] + cars[row].free_dof
            speed = math.hypot(states[world, dof], states[world, dof + 1])
            if not (speed < STANDING_SPEED and timers[row].progress >= length):
                standing_since[row] = math.nan
            elif math.isnan(standing_since[row]):
                standing_since[row] = time
            if not time - standing_since[row] >= stop_time:  # nor is NaN
                done = 0
        unstable = False
        for kind in range(_FIRST_BAD, _END_OF_BAD, 2):
            unstable = unstable or warnings[world, kind] > 0
        back = timers[row].passed - timers[row].progress
        since = timers[row].last_progress_time
        rolled_over = is_rolled_over(qpos, cars[row : row + 1])
        if length < math.inf:
            reason = end_reason(unstable, crashed[row], rolled_over, done, laps, back, time, since, last_time)
        else:
            reason = end_of_endless(unstable, crashed[row], rolled_over, time, last_time)
        reasons[row] = reason
        running[row] = reason == 0


@kernel
def end_reason(
    unstable: bool,
    crashed: bool,
    rolled_over: bool,
    laps_completed: int,
    laps: int,
    back: float,
    time: float,
    last_progress_time: float,
    last_time: float,
) -> int:
    """Return the number in END_REASONS of why a race is over, 0: it goes on; `last_time` [s] is half a tick early."""
    if unstable:
        return _UNSTABLE
    if crashed:
        return _CRASH
    if rolled_over:
        return _ROLLED_OVER
    if laps_completed >= laps:
        return _FINISHED
    if back >= WRONG_WAY_LIMIT:
        return _WRONG_WAY
    if time - last_progress_time >= NO_PROGRESS_LIMIT:
        return _NO_PROGRESS
    if time >= last_time:
        return _TIME_LIMIT
    return 0


@kernel
def end_of_endless(unstable: bool, crashed: bool, rolled_over: bool, time: float, last_time: float) -> int:
    """Return the same on a course without end, where a car may stand or turn, and is finished when its time is over."""
    if unstable:
        return _UNSTABLE
    if crashed:
        return _CRASH
    if rolled_over:
        return _ROLLED_OVER
    return _FINISHED if time >= last_time else 0
