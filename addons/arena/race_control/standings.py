"""Who led whom during a race of several cars, tick by tick: positions, and gaps to the leader.

found = standings((run.telemetry, *run.others), run.summary["cars"])
found.positions[:, -1], found.gaps_s[1]
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.messages import FloatArray
from fg_mujoco.simulation.telemetry import TELEMETRY

_TIME, _PROGRESS = TELEMETRY.index("time_s"), TELEMETRY.index("progress_m")
_AHEAD_OF_ALL = 1e9  # [m] beyond any progress: a car that has finished is ahead of those that have not


@dataclass(frozen=True, kw_only=True, eq=False)
class Standings:
    """Arrays have a row a car and a column a tick, and are of its start."""

    time: FloatArray  # (ticks,) [s]
    progress: FloatArray  # (cars, ticks) [m]
    positions: NDArray[np.intp]  # (cars, ticks) from 1: by progress; who has finished keeps the place of the result
    gaps_s: FloatArray  # (cars, ticks) [s] since the leader of that tick was where the car is; NaN where he never was,
    # and for a car whose race is over


def standings(telemetries: Sequence[FloatArray], rows: Sequence[Mapping[str, Any]]) -> Standings:
    """Return the standings of a race.

    Args:
      telemetries: of each car, (ticks, len(TELEMETRY)).
      rows: of each car, as in `cars` of the summary.
    """
    time = telemetries[0][:, _TIME]
    progress = np.array([telemetry[:, _PROGRESS] for telemetry in telemetries])
    over = np.array([time >= float(row.get("end_time_s", np.inf)) for row in rows])
    finished = over & np.array([[bool(row["finished"])] for row in rows])
    keys = np.where(finished, _AHEAD_OF_ALL - np.array([[float(row["position"])] for row in rows]), progress)
    order = np.argsort(-keys, axis=0, kind="stable")
    positions = np.empty(order.shape, np.intp)
    np.put_along_axis(positions, order, np.arange(1, len(rows) + 1)[:, np.newaxis], axis=0)
    gaps = np.full(progress.shape, np.nan)
    for leader in np.unique(order[0]) if len(time) else ():
        reached = np.maximum.accumulate(progress[leader])
        new = np.concatenate(([True], np.diff(reached) > 0.0))
        led = order[0] == leader
        gaps[:, led] = time[led] - np.interp(progress[:, led], reached[new], time[new], left=np.nan, right=np.nan)
        gaps[leader, led] = 0.0
    gaps[over] = np.nan
    return Standings(time=time, progress=progress, positions=positions, gaps_s=gaps)
