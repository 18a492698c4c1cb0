"""The channels of a drive: what one sensor measured, or what was commanded, each at its own times."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fg_mujoco.display import brief
from fg_mujoco.errors import SettingsError
from fg_mujoco.messages import FloatArray, read_only

PAUSE = 1.0
"""[s] without a measurement of the speed or the yaw rate, beyond which the motion is not known, and a drive is cut."""

LONGEST_PAUSE = 7.0 * 86400.0
"""[s] of a drive's clock, beyond which it was set anew and no pause was made."""

SHORTEST = 5.0
"""[s] A drive that moved for less is refused, and a part that lasts less is left out."""

MOST = {
    "time": 1e10, "steering": 10.0, "speed": 100.0, "speed_command": 100.0, "yaw_rate": 1e3, "acceleration": 1e4,
    "acceleration_command": 1e4, "place": 1e8, "yaw": 1e6,
}  # fmt: skip
"""In SI units, of what sensors measure and cars are commanded: a greater number is a fault."""

LONGEST, PART = 300.0, 30.0
"""[s] of a drive that is taken as a whole; of a longer one, as much in parts of PART."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Channel:
    """What one sensor measured, or what was commanded, read-only; SettingsError: not increasing, or not finite."""

    name: str
    time: FloatArray  # (n,) [s]
    values: FloatArray  # (n, k)

    def __post_init__(self) -> None:
        for name in ("time", "values"):
            object.__setattr__(self, name, read_only(getattr(self, name)))
        if self.values.ndim != 2 or len(self.time) != len(self.values):
            raise SettingsError(f"{self.name}: {len(self.time)} times of {self.values.shape}; accepted: a row each")
        if not (np.isfinite(self.time).all() and np.isfinite(self.values).all()):
            raise SettingsError(f"{self.name}: a time or value is not finite; accepted: finite numbers")
        back = np.flatnonzero(np.diff(self.time) <= 0.0)
        if len(back):
            before, after = self.time[back[0] : back[0] + 2]
            raise SettingsError(
                f"{self.name}: its times do not increase: {after:.9g} s follows {before:.9g} s; accepted: measurements "
                "in their order"
            )

    def __repr__(self) -> str:
        return brief(self, self.name, f"{len(self.time)} measurements")

    def at(self, times: FloatArray) -> FloatArray:
        """Return the values at some times (m,), linear between two measurements. Shape (m, k)."""
        return np.column_stack([np.interp(times, self.time, column) for column in self.values.T])

    def held(self, times: FloatArray) -> FloatArray:
        """Return the last values up to some times (m,), as of commands that hold. Shape (m, k)."""
        places = np.searchsorted(self.time, times, side="right") - 1
        found: FloatArray = self.values[np.maximum(places, 0)]
        return found

    def require_bounded(self, *most: float) -> None:
        """Raise SettingsError, with the time, where times or values are not below what is measured."""
        for values, greatest in zip((self.time, *self.values.T), (MOST["time"], *most), strict=True):
            bad = np.flatnonzero(np.abs(values) > greatest)
            if len(bad):
                raise SettingsError(
                    f"{self.name}: is {values[bad[0]]:.6g} at {self.time[bad[0]]:.9g} s; accepted: {-greatest:g} to "
                    f"{greatest:g}"
                )

    def between(self, begin: float, end: float) -> Channel | None:
        """Return what was measured from one time to another; None: nothing, or only once."""
        rows = slice(*np.searchsorted(self.time, (begin, np.nextafter(end, np.inf))))
        if len(self.time[rows]) < 2:
            return None
        return Channel(name=self.name, time=self.time[rows], values=self.values[rows])


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Beams:
    """The LiDAR's beams that were recorded, all or some of each scan; its arrays are read-only."""

    time: FloatArray  # (n,) [s], increasing
    ranges: FloatArray  # (n, b) [m]; inf: nothing was seen, NaN: the beam failed
    bearings: FloatArray  # (b,) [rad] to the left of straight ahead, increasing

    def __post_init__(self) -> None:
        for name in ("time", "ranges", "bearings"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    def __repr__(self) -> str:
        return brief(self, f"{len(self.time)} scans of {len(self.bearings)} beams")


class Measured:
    """What was measured in a drive: its channels, and the time that all sensors measured."""

    speed: Channel
    yaw_rate: Channel
    acceleration: Channel | None
    pose: Channel | None

    @property
    def start(self) -> float:
        """The time from which on all of its sensors measure [s]."""
        return max(float(channel.time[0]) for channel in self._needed)

    @property
    def end(self) -> float:
        """The time until which all of its sensors measure [s]."""
        return min(float(channel.time[-1]) for channel in self._needed)

    @property
    def pauses(self) -> list[tuple[float, float]]:
        """From when to when the speed or the yaw rate was not measured, for more than PAUSE, in their order [s]."""
        gaps: list[tuple[float, float]] = []
        for channel in (self.speed, self.yaw_rate):
            rows = np.flatnonzero(np.diff(channel.time) > PAUSE)
            gaps += zip(channel.time[rows].tolist(), channel.time[rows + 1].tolist(), strict=True)
        found: list[tuple[float, float]] = []
        for last, first in sorted(gaps):
            if first <= self.start or last >= self.end:
                continue
            if found and last <= found[-1][1]:
                last, first = found[-1][0], max(first, found.pop()[1])
            found.append((last, first))
        return found

    @property
    def _needed(self) -> list[Channel]:
        """The channels that a drive is cut to. Commands hold until the next one, and may be sparse."""
        always = [self.speed, self.yaw_rate]
        return always + [channel for channel in (self.acceleration, self.pose) if channel is not None]
