"""The line that a car drove in a lap, closed, and how fast it went on it."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..course.polyline import step_lengths
from ..errors import SettingsError
from ..messages import CarParameters, FloatArray
from ..racing.result import CarResult


@dataclass(frozen=True, kw_only=True, eq=False)
class DrivenLap:
    """A lap of the car's centre of gravity, the first point after the start line."""

    points: FloatArray  # (n, 2) [m] at each tick; closed, the first not repeated
    speeds: FloatArray  # (n,) [m/s] there
    gap: float  # [m] across, between the line's beginning and its end, before it was closed

    def speed_at(self, count: int) -> FloatArray:
        """Return the speed at `count` even parts of the line's length. Shape (count,) [m/s]."""
        at = np.concatenate(([0.0], np.cumsum(step_lengths(self.points))))
        speeds = np.append(self.speeds, self.speeds[0])
        return np.asarray(np.interp(np.arange(count) / count, at / at[-1], speeds))


def best_flying_lap(laps: CarResult) -> int:
    """Return the number of the fastest lap, except the first, from a standing start; SettingsError: one lap."""
    if len(laps.lap_times_s) < 2:
        raise SettingsError(f"{len(laps.lap_times_s)} laps were completed; accepted: 2 or more, for a flying one")
    return 2 + int(np.argmin(laps.lap_times_s[1:]))


def driven_lap(laps: CarResult, lap: int, car: CarParameters) -> DrivenLap:
    """Return a lap, from 2 on, as a closed line: the millimetres between its ends are spread over the lap."""
    heading = laps.column("heading_rad")
    ahead = np.stack((np.cos(heading), np.sin(heading)))
    points = (np.stack((laps.column("x_m"), laps.column("y_m"))) + car.rear_axle_distance * ahead).T
    # while the tires hold, the rear axle goes straight ahead, and the CoG turns about it
    forward, sideways = laps.column("speed_m_s"), car.rear_axle_distance * laps.column("yaw_rate_rad_s")
    speeds = np.hypot(forward, sideways)
    rows = np.flatnonzero(laps.column("lap") == lap)
    before = points[rows[0] - 2 : rows[0] + 1]  # across the start line, a lap ago
    last = points[rows[-1]]
    feet = [_foot(last, start, end) for start, end in pairwise(before)]
    foot = min(feet, key=lambda foot: float(np.hypot(*(last - foot))))
    gap = last - foot
    share = np.linspace(0.0, 1.0, len(rows))[:, np.newaxis]
    return DrivenLap(points=points[rows] - share * gap, speeds=speeds[rows], gap=float(np.hypot(*gap)))


def _foot(point: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    """Return the place of a segment that is nearest to a point. Shape (2,) [m]."""
    along = end - start
    share = float(np.clip((point - start) @ along / (along @ along), 0.0, 1.0))
    return np.asarray(start + share * along)
