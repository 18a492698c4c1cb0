"""Times the laps of the cars of some worlds, and says when each race is over and why."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..course.course import Course
from ..course.lap_timer import first_seen, fresh_timers, time_lap
from ..kernels import kernel
from ..messages import FloatArray
from ..vehicle.motion import CarArray, planar_pose

Mask = NDArray[np.bool_]

NO_PROGRESS_LIMIT = 10.0  # [s] a race ends when the car has not come further for this long
STANDING_SPEED = 0.05  # [m/s] a car slower than this stands still, where the goal is to stop

END_REASONS = ("", "unstable", "crash", "finished", "no_progress", "time_limit", "interrupted", "failed")
"""By number; the first is that of a race that goes on. "unstable": MuJoCo warned of a bad state. "failed": in a batch,
the planner or the engine raised, which in a race of one car is an exception."""

_UNSTABLE, _CRASH, _FINISHED, _NO_PROGRESS, _TIME_LIMIT = range(1, 6)


class Referee:
    """Judges the races of n cars on one course, each in a world of its own.

    Args:
      track: of all of them.
      cars: (n,) of CAR.
      laps: to be driven.
      time_limit: of simulated time [s].
      period: of a tick [s].
      qpos: (n, nq) at the start.

    Attributes:
      running: which races go on, (n,).
      reasons: numbers in END_REASONS, (n,).
      timers: of the laps, (n,) of LAP_TIMER.
      lap_times: [s], NaN where not driven, (n, laps).
    """

    def __init__(
        self, track: Course, cars: CarArray, *, laps: int, time_limit: float, period: float, qpos: FloatArray
    ) -> None:
        self._track, self._cars, self._laps = track, cars, laps
        self._last_time = time_limit - 0.5 * period
        self.running = np.ones(len(cars), np.bool_)
        self.reasons = np.zeros(len(cars), np.int64)
        self.lap_times = np.full((len(cars), laps), math.nan)
        self.timers = fresh_timers(len(cars))
        first = int(cars["free_qpos"][0])
        first_seen(self.timers, track, qpos[:, first : first + 2])
        self._standing_since = np.full(len(cars), math.nan)

    def judge(self, times: FloatArray, qpos: FloatArray, qvel: FloatArray, unstable: Mask, crashed: Mask) -> None:
        """Take the cars that run where they are now and end what is over.

        Args:
          times: (n,) [s].
          qpos: (n, nq).
          qvel: (n, nv).
          unstable: whether MuJoCo warned of a bad state, (n,).
          crashed: whether the chassis has touched anything, (n,).
        """
        track = self._track
        judge_worlds(
            self.running, self.reasons, times, qpos, qvel, self._cars, unstable, crashed, self.timers, self.lap_times,
            self._standing_since, track.table, track.length, track.modulus, track.stop_time, self._laps,
            self._last_time,
        )  # fmt: skip

    def end(self, which: Mask, reason: int) -> None:
        """End some races, (n,), for another reason, a number in END_REASONS."""
        self.reasons[which], self.running[which] = reason, False


@kernel
def judge_worlds(
    running: Mask,
    reasons: NDArray[np.int64],
    times: FloatArray,
    qpos: FloatArray,
    qvel: FloatArray,
    cars: CarArray,
    unstable: Mask,
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
    """Time the laps of each world that runs, and end those that are over, with the number of their reason."""
    for i in range(len(running)):
        if running[i]:
            x, y, _ = planar_pose(qpos[i], cars[i : i + 1])
            time_lap(timers, i, lap_times, times[i], x, y, table, length, modulus)
            done = timers[i].laps_completed
            if stop_time > 0.0:  # the goal counts once the car has stood behind it
                dof = cars[i].free_dof
                stands = math.hypot(qvel[i, dof], qvel[i, dof + 1]) < STANDING_SPEED and timers[i].progress >= length
                if not stands:
                    standing_since[i] = math.nan
                elif math.isnan(standing_since[i]):
                    standing_since[i] = times[i]
                if not times[i] - standing_since[i] >= stop_time:  # nor is NaN
                    done = 0
            reason = end_reason(
                unstable[i], crashed[i], done, laps, times[i], timers[i].last_progress_time, last_time
            )  # fmt: skip
            reasons[i] = reason
            running[i] = reason == 0


@kernel
def end_reason(
    unstable: bool,
    crashed: bool,
    laps_completed: int,
    laps: int,
    time: float,
    last_progress_time: float,
    last_time: float,
) -> int:
    """Return the number in END_REASONS of why a race is over, 0 while it goes on.

    `last_time` [s] is half a tick before the time limit, because times are sums of many ticks.
    """
    if unstable:
        return _UNSTABLE
    if crashed:
        return _CRASH
    if laps_completed >= laps:
        return _FINISHED
    if time - last_progress_time >= NO_PROGRESS_LIMIT:
        return _NO_PROGRESS
    if time >= last_time:
        return _TIME_LIMIT
    return 0
