"""Records of a rollout's worlds, and the rows of scans that policies are trained on.

    record = Record.of("scans:10")            # every tenth beam, counted from the one straight ahead to both sides
    layout = ScanLayout.of(car.lidar.beams, record.step)
    rows = np.zeros(400, layout.dtype)        # one row a tick
    layout.distances(rows["ranges"])          # [m] as environments observe them

A row has what the planner was given in a tick, and what it commanded. Ranges are whole numbers of `unit`, a
millimetre, in 16 bits: half the size of 32-bit floats, with an error of at most 0.5 mm, where the LiDAR's own is
40 mm.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arguments import explain_class
from ..errors import SettingsError, accepted_names
from ..lidar.beams import Beams
from ..messages import ODOMETRY, FloatArray, read_only, shown
from ..simulation.engine import Engine
from ..simulation.telemetry import GREATEST_COMMAND, column_index

RECORDS = ("summary", "telemetry", "states", "scans")
_SCANS = "scans"

TOO_CLOSE, FAILED, NO_RETURN = 0, 65534, 65535
"""Codes among recorded ranges: -inf, NaN and +inf of a LaserScan."""

_LEAST, _MOST = 1, FAILED - 1
_MILLIMETRE = 0.001  # [m]
_COLUMNS = {"progress": column_index("progress_m"), "offset": column_index("offset_m")}


@dataclass(frozen=True)
class Record:
    """Choice of what is recorded in each world.

    Raises:
      SettingsError: `of` was given something else than a name of RECORDS, or "scans:STEP".
    """

    what: str
    step: int = 1  # of scans: every how many-th beam

    @classmethod
    def of(cls, text: object) -> Record:
        """Return what a text names, such as "summary" or "scans:10"."""
        what, colon, step = text.partition(":") if isinstance(text, str) else ("", "", "")
        if what not in RECORDS or (colon and (what != _SCANS or not step.isdecimal() or int(step) < 1)):
            others = ", or scans:STEP, every how many-th beam, as in scans:10"
            raise SettingsError(f"record is {shown(text)}; {accepted_names(text, RECORDS, others)}")
        return cls(what, int(step) if colon else 1)

    @property
    def has_scans(self) -> bool:
        """Whether scans are recorded."""
        return self.what == _SCANS

    def __str__(self) -> str:
        return self.what if self.step == 1 else f"{self.what}:{self.step}"


@explain_class
@dataclass(frozen=True, kw_only=True)
class ScanLayout:
    """The layout of recorded scans: which beams they have, and how distances are kept."""

    step: int  # every how many-th beam is kept
    first: int  # index of the rightmost kept beam among the LiDAR's
    beams: int  # that are kept
    angle_min: float  # [rad] bearing of the rightmost kept beam
    angle_increment: float  # [rad] from one kept beam to the next
    range_max: float  # [m]
    unit: float  # [m] of the whole numbers in which ranges are kept
    period: float  # [s] from one scan to the next

    @classmethod
    def of(cls, beams: Beams, step: int) -> ScanLayout:
        """Return the layout of every `step`-th beam of a LiDAR, the one straight ahead among them."""
        first = len(beams.bearings) // 2 % step
        return cls(
            step=step, first=first, beams=len(beams.bearings[first::step]),
            angle_min=beams.angle_min + first * beams.angle_increment, angle_increment=step * beams.angle_increment,
            range_max=beams.range_max, unit=max(_MILLIMETRE, beams.range_max / _MOST), period=beams.period,
        )  # fmt: skip

    @classmethod
    def read(cls, described: Mapping[str, Any]) -> ScanLayout:
        """Return the layout that `described` describes."""
        return cls(**described)

    def described(self) -> dict[str, Any]:
        """Return the layout as it can stand in JSON."""
        return asdict(self)

    @property
    def bearings(self) -> FloatArray:
        """Bearings of the kept beams from straight ahead, left positive. Shape (beams,) [rad]."""
        return read_only(self.angle_min + self.angle_increment * np.arange(self.beams))

    @property
    def dtype(self) -> np.dtype[Any]:
        """Type of a row: odometry and scan of the planner, its command, and its position on the course."""
        odometry = [
            (name, np.float64 if name == "stamp" else np.float32, ODOMETRY[name].shape) for name in ODOMETRY.names or ()
        ]
        command = [
            ("command", np.float32, (2,)),  # steering angle [rad] and speed [m/s]
            ("progress", np.float32),  # [m] along the course, of the telemetry
            ("offset", np.float32),  # [m] left of its centreline
        ]
        return np.dtype([*odometry, *command, ("ranges", np.uint16, (self.beams,))])

    def counts(self, ranges: FloatArray) -> NDArray[np.uint16]:
        """Return ranges as in LaserScan [m] as whole numbers of `unit`."""
        with np.errstate(invalid="ignore"):
            counts = np.clip(np.rint(ranges / self.unit), _LEAST, _MOST).astype(np.uint16)  # no number becomes any
        odd = ~np.isfinite(ranges)
        if odd.any():
            values = ranges[odd]
            counts[odd] = np.where(np.isnan(values), FAILED, np.where(values > 0.0, NO_RETURN, TOO_CLOSE))
        return counts

    def distances(self, counts: NDArray[np.uint16]) -> NDArray[np.float32]:
        """Return recorded ranges as environments observe them [m]: no return is range_max; too close or failed is 0."""
        distances = counts * np.float32(self.unit)
        distances[counts == NO_RETURN] = self.range_max
        distances[counts == FAILED] = 0.0
        return distances


class ScanRecorder:
    """Records car 0 of each world of an engine, tick by tick."""

    def __init__(self, layout: ScanLayout, worlds: int) -> None:
        self._layout, self._dtype, self._worlds = layout, layout.dtype, worlds
        self._ticks: deque[tuple[NDArray[np.intp], NDArray[np.void]]] = deque()  # worlds, and their rows

    def add(self, engine: Engine, driven: NDArray[np.bool_]) -> None:
        """Record the tick that was driven, of the worlds whose car 0 was, (n,)."""
        worlds = np.flatnonzero(driven)
        cars = worlds * engine.cars_per_world
        rows, odometry, layout = np.empty(len(cars), self._dtype), engine.odometry[cars], self._layout
        with np.errstate(over="ignore", invalid="ignore"):
            for name in ODOMETRY.names or ():
                rows[name] = odometry[name]
            rows["command"] = np.clip(engine.commands[cars], -GREATEST_COMMAND, GREATEST_COMMAND)
            for name, column in _COLUMNS.items():
                rows[name] = engine.telemetry[cars, column]
        rows["ranges"] = layout.counts(engine.ranges[cars, layout.first :: layout.step])
        self._ticks.append((worlds, rows))

    def rows(self) -> list[NDArray[np.void]]:
        """Return the rows of each world, and forget them."""
        count = np.zeros(self._worlds, np.int64)
        for worlds, _ in self._ticks:
            count[worlds] += 1
        whole = np.empty(count.sum(), self._dtype)
        ends = np.cumsum(count)
        at = ends - count
        while self._ticks:
            worlds, rows = self._ticks.popleft()
            whole[at[worlds]] = rows
            at[worlds] += 1
        return np.split(whole, ends[:-1])
