"""Times the laps of the cars of some worlds, and says when each race is over and why."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .car_motion import CarArray, planar_pose
from .kernels import kernel
from .lap_timer import fresh_timers, time_lap
from .messages import FloatArray
from .race_rules import end_reason
from .track import Track

Mask = NDArray[np.bool_]


class Referee:
    """Judges the races of n cars on one track, each in a world of its own.

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
        self, track: Track, cars: CarArray, *, laps: int, time_limit: float, period: float, qpos: FloatArray
    ) -> None:
        self._track, self._cars, self._laps = track, cars, laps
        self._last_time = time_limit - 0.5 * period
        self.running = np.ones(len(cars), np.bool_)
        self.reasons = np.zeros(len(cars), np.int64)
        self.lap_times = np.full((len(cars), laps), math.nan)
        self.timers = fresh_timers(len(cars))
        first = int(cars["free_qpos"][0])
        self.timers["place"] = track.project(qpos[:, first : first + 2])[0]

    def judge(self, times: FloatArray, qpos: FloatArray, unstable: Mask, crashed: Mask) -> None:
        """Take the cars that run where they are now, time [s] (n,) and `qpos` (n, nq), and end what is over."""
        judge_worlds(
            self.running, self.reasons, times, qpos, self._cars, unstable, crashed, self.timers, self.lap_times,
            self._track.table, self._track.length, self._laps, self._last_time,
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
    cars: CarArray,
    unstable: Mask,
    crashed: Mask,
    timers: NDArray[np.void],
    lap_times: FloatArray,
    table: FloatArray,
    length: float,
    laps: int,
    last_time: float,
) -> None:
    """Time the laps of each world that runs, and end those that are over, with the number of their reason."""
    for i in range(len(running)):
        if running[i]:
            x, y, _ = planar_pose(qpos[i], cars[i : i + 1])
            time_lap(timers, i, lap_times, times[i], x, y, table, length)
            reason = end_reason(
                unstable[i], crashed[i], timers[i].laps_completed, laps, times[i], timers[i].last_progress_time,
                last_time,
            )  # fmt: skip
            reasons[i] = reason
            running[i] = reason == 0
