"""When, where and which tire slid: stretches of ticks in which it slid, as `tire_slip` says."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...messages import FloatArray
from ...vehicle.car import WHEELS
from ...vehicle.tire_slip import slides_above
from ...vehicle.tires import CONTACT


@dataclass(frozen=True, kw_only=True)
class SlideEvent:
    """One tire sliding, from one tick to another."""

    tire: str  # a name in WHEELS
    start: float  # [s] of its first tick's start
    end: float  # [s] of its last tick's end
    lap: int
    progress: float  # [m] within the lap where it is known, at the start
    x: float  # [m] of the car at the start
    y: float  # [m]
    speed: float  # [m/s] of the car at the start
    greatest: float  # [m/s] that the contact point moved over the ground


def slide_events(
    columns: dict[str, FloatArray], length: float | None, period: float = 0.025, model: str = CONTACT
) -> tuple[SlideEvent, ...]:
    """Return all sliding of a race, in the order in which it began.

    Args:
      columns: of `tick_columns`.
      length: of a lap [m]; None: progress is counted from the start of the race.
      period: of a tick [s].
      model: of the tires.
    """
    time, progress, lap = columns["time_s"], columns["progress_m"], columns["lap"]
    events = []
    for tire in WHEELS:
        slide = columns[f"slide_{tire}_m_s"]
        for first, end in _runs(slide > slides_above(model)):
            events.append(
                SlideEvent(
                    tire=tire,
                    start=float(time[first]),
                    end=float(time[end - 1]) + period,
                    lap=int(lap[first]),
                    progress=float(progress[first]) - (0.0 if length is None else (int(lap[first]) - 1) * length),
                    x=float(columns["x_m"][first]),
                    y=float(columns["y_m"][first]),
                    speed=float(columns["speed_m_s"][first]),
                    greatest=float(np.nanmax(slide[first:end])),
                )
            )
    return tuple(sorted(events, key=lambda event: (event.start, WHEELS.index(event.tire))))


def _runs(holds: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> list[tuple[int, int]]:
    """Return first and end of each stretch of True."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], holds, [False])).astype(np.int8)))
    return [(int(first), int(end)) for first, end in edges.reshape(-1, 2)]
