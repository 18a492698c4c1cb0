"""Laps, counted by progress along the centreline. Driving backward subtracts from the progress.

    timer = LapTimer(track)
    timer.update(time, position)   # every tick
    timer.laps_completed, timer.lap_times

The first lap begins where the car is first seen. A scene has one lap, which ends at the goal.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..arguments import explain_class
from ..display import brief
from ..messages import FloatArray
from ..native import core, record
from .course import Course

LAP_TIMER = record(
    "LapTimer",
    [
        ("place", np.float64),  # [m] where on the line the car was last; NaN before the first update
        ("progress", np.float64),  # [m] along the line from where the car was first seen, or from a scene's start
        ("offset", np.float64),  # [m] from the centreline, left positive
        ("time", np.float64),  # [s] of the last update
        ("lap_start", np.float64),  # [s]
        ("mark", np.float64),  # [m] greatest progress at `last_progress_time`
        ("last_progress_time", np.float64),  # [s] when the greatest progress last grew by 0.1 m
        ("laps_completed", np.int64),
        ("passed", np.float64),  # [m] greatest progress where the line has no sections; -inf before the first update
        ("furthest", np.float64),  # [m] greatest progress; -inf before the first update
        ("furthest_time", np.float64),  # [s] when and where the car first had it
        ("furthest_x", np.float64),  # [m]
        ("furthest_y", np.float64),  # [m]
    ],
)
"""Memory of a lap timer for one car."""


def fresh_timers(count: int) -> NDArray[np.void]:
    """Return the memory of lap timers that have not seen their cars yet. Shape (count,) of LAP_TIMER."""
    timers = np.zeros(count, LAP_TIMER)
    for name in ("place", "offset", "time", "lap_start", "last_progress_time"):
        timers[name] = math.nan
    timers["passed"] = timers["furthest"] = -math.inf
    return timers


def first_seen(timers: NDArray[np.void], course: Course, positions: FloatArray) -> None:
    """Write to timers (n,) of LAP_TIMER where their cars are at their start, positions (n, 2) [m]."""
    timers["place"] = course.project(positions)[0]
    if course.origin is not None:
        timers["progress"] = timers["place"] - course.origin


@explain_class
class LapTimer:
    """Times the laps of one car, from where it is first seen.

    A lap is complete when the progress reaches a whole number of lengths for the first time, so that reversing over
    the line and coming back counts nothing twice. The time of crossing is interpolated between updates.

    Attributes:
      memory: what it remembers, (1,) of LAP_TIMER.
    """

    def __init__(self, track: Course) -> None:
        self._track = track
        self.reset()

    def __repr__(self) -> str:
        return brief(self, f"{self.laps_completed} laps completed", f"progress {self.progress:.2f} m")

    def reset(self) -> None:
        """Forget the car; the next update is its start."""
        self.memory = fresh_timers(1)
        self._laps_completed = self.memory["laps_completed"]  # views, quicker to read
        self._last_progress_time = self.memory["last_progress_time"]
        self._lap_times = np.empty((1, 8))
        self._seen = False

    @property
    def progress(self) -> float:
        """Driven along the centreline since the first update, backward negative [m]."""
        return float(self.memory["progress"][0])

    @property
    def offset(self) -> float:
        """Distance from the centreline, left positive [m]; NaN before the first update."""
        return float(self.memory["offset"][0])

    @property
    def last_progress_time(self) -> float:
        """When the greatest progress last grew by 0.1 m [s]; NaN before the first update."""
        return float(self._last_progress_time.item(0))

    @property
    def laps_completed(self) -> int:
        """Number of laps completed."""
        return int(self._laps_completed.item(0))

    @property
    def lap_times(self) -> tuple[float, ...]:
        """Times of the laps completed [s]."""
        return tuple(self._lap_times[0, : self.laps_completed].tolist())

    def update(self, time: float, position: Sequence[float]) -> int:
        """Take the car's position, x and y [m], at a time [s] after the last, and return the number of laps completed.

        The car is at most half a lap from the last position along the line.
        """
        x, y = position
        laps = self.laps_completed
        if not self._seen:
            first_seen(self.memory, self._track, np.array([[x, y]]))
            self._seen = True
        if laps >= self._lap_times.shape[1] - 1:
            self._lap_times = np.concatenate((self._lap_times, np.empty_like(self._lap_times)), axis=1)
        track = self._track
        core.time_lap(self.memory, 0, self._lap_times, time, x, y, track.table, track.length, track.modulus)
        return self.laps_completed
