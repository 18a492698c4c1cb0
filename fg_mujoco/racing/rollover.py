"""The record of a rollover: where, when and at what speed. It is read off the telemetry's last row."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..messages import FloatArray
from ..simulation.telemetry import TELEMETRY

_LAP, _X, _VX, _TIME = (TELEMETRY.index(name) for name in ("lap", "x_m", "vx_m_s", "time_s"))


@dataclass(frozen=True, kw_only=True)
class Rollover:
    """The last tick of a car that has rolled over: at its end the car lies on its side or its roof.

    The text is for people: "at (3.10, -0.02) m, in lap 1, t = 2.60 s, 4.1 m/s".
    """

    time_s: float
    x_m: float  # of the rear axle
    y_m: float
    speed_m_s: float  # of the rear axle over the ground; NaN in telemetry without it
    lap: int  # from 1

    @classmethod
    def of(cls, end_reason: object, telemetry: FloatArray) -> Rollover | None:
        """Return the rollover in which a race ended; None: it ended otherwise, or before its first tick.

        Args:
          end_reason: of END_REASONS.
          telemetry: (ticks, len(TELEMETRY)).
        """
        if end_reason != "rolled_over" or len(telemetry) == 0:
            return None
        row = telemetry[-1]
        return cls(
            time_s=float(row[_TIME]), x_m=float(row[_X]), y_m=float(row[_X + 1]), lap=int(row[_LAP]),
            speed_m_s=math.hypot(row[_VX], row[_VX + 1]),
        )  # fmt: skip

    def __str__(self) -> str:
        place = f"at ({self.x_m:.2f}, {self.y_m:.2f}) m, in lap {self.lap}"
        return f"{place}, t = {self.time_s:.2f} s, {self.speed_m_s:.1f} m/s"
