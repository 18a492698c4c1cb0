"""Laps by progress along the centreline, with direction: reversing subtracts.

    timer = LapTimer(track)
    timer.update(time, position)   # every tick
    timer.laps_completed, timer.lap_times

The line is where the car is first seen.
"""

from __future__ import annotations

import math

from numpy.typing import ArrayLike

from .track import Track

STANDSTILL = 0.1  # [m] progress below this is standing still: a car that pushes against a wall still creeps


class LapTimer:
    """Times the laps of one car, from where it is first seen.

    A lap is complete when the progress reaches a whole number of lengths for the first time, so that reversing over
    the line and coming back counts nothing twice. The time of crossing is interpolated between updates.

    Attributes:
      progress: driven along the centreline since the first update, backward negative [m].
      offset: from the centreline, left positive [m].
      lap_times: of the laps completed [s].
      last_progress_time: when the greatest progress last grew by `STANDSTILL` [s]; NaN before the first update.
    """

    def __init__(self, track: Track) -> None:
        self._track = track
        self.reset()

    def reset(self) -> None:
        """Forget the car; the next update is its start."""
        self.progress = 0.0
        self.offset = math.nan
        self.lap_times: tuple[float, ...] = ()
        self.last_progress_time = math.nan
        self._time = math.nan
        self._lap_start = math.nan
        self._place: float | None = None  # [m] where on the line the car was last
        self._mark = 0.0  # [m] greatest progress at `last_progress_time`

    @property
    def laps_completed(self) -> int:
        """Number of laps completed."""
        return len(self.lap_times)

    def update(self, time: float, position: ArrayLike) -> int:
        """Take the car's position at a time, and answer the number of laps completed.

        Args:
          time: not before that of the last update [s].
          position: of the car, x and y [m]; at most half a lap from the last one along the line.
        """
        s, offset = self._track.project(position, near=self._place)
        place, self.offset = float(s[0]), float(offset[0])
        if self._place is None:
            self._lap_start = self.last_progress_time = time
        else:
            self._advance(time, math.remainder(place - self._place, self._track.length))
        self._place, self._time = place, time
        return self.laps_completed

    def _advance(self, time: float, distance: float) -> None:
        before, self.progress = self.progress, self.progress + distance
        line = (self.laps_completed + 1) * self._track.length
        while self.progress >= line:
            crossed = self._time + (time - self._time) * (line - before) / distance
            self.lap_times = (*self.lap_times, crossed - self._lap_start)
            self._lap_start = crossed
            line += self._track.length
        if self.progress >= self._mark + STANDSTILL:
            self._mark, self.last_progress_time = self.progress, time
