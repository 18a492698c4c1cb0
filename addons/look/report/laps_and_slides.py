"""The laps of a race with the times of their sectors, and when, where and which tire slid.

Sectors are three parts of a lap of equal length, by progress. A slide is a stretch of ticks, as `tire_slip` says.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from fg_mujoco.messages import FloatArray
from fg_mujoco.vehicle.car import WHEELS
from fg_mujoco.vehicle.tire_slip import slides_above
from fg_mujoco.vehicle.tires import CONTACT

SECTORS = 3


@dataclass(frozen=True, kw_only=True)
class Lap:
    """One lap, or the beginning of one that was not completed."""

    number: int  # from 1
    time: float | None  # [s]; None: not completed
    sectors: tuple[float | None, ...]  # [s] each; None: not completed
    top_speed: float  # [m/s]
    mean_speed: float  # [m/s] over time
    friction_utilisation: float  # greatest of any tire [-]
    sliding_share: float  # of its physics steps


def lap_length(time: FloatArray, progress: FloatArray, lap_times: tuple[float, ...]) -> float | None:
    """Return the length of a lap as the lap timer had it [m], the progress at the end of the first, or None.

    `time` [s] and `progress` [m] are of the starts of the ticks (n,). A race that ends with its only lap ends a moment
    after the last tick began: up to there the progress goes on as in the tick before.
    """
    if not lap_times or len(time) < 2:
        return None
    return float(_progress_at(lap_times[0], time, progress))


def lap_table(
    columns: dict[str, FloatArray], lap_times: tuple[float, ...], length: float | None, *, end: float | None
) -> tuple[Lap, ...]:
    """Return the laps of a race, last the one not completed, which ends at `end` [s]; no sectors without a length."""
    time, progress = columns["time_s"], columns["progress_m"]
    bounds = [0.0, *np.cumsum(lap_times).tolist()]
    if end is not None:
        bounds.append(end)
    laps = []
    for number, (start, finish) in enumerate(pairwise(bounds), start=1):
        complete = number <= len(lap_times)
        ticks = (time >= start) & (time < finish)
        if not ticks.any():
            continue
        sectors = _sectors(time, progress, length, number, start, finish if complete else None)
        speed = np.abs(columns["speed_m_s"][ticks])
        steps = float(columns["steps"][ticks].sum())
        laps.append(
            Lap(
                number=number,
                time=lap_times[number - 1] if complete else None,
                sectors=sectors,
                top_speed=float(speed.max()),
                mean_speed=float(speed.mean()),
                friction_utilisation=float(columns["friction_utilisation"][ticks].max()),
                sliding_share=float(columns["sliding_steps"][ticks].sum()) / steps,
            )
        )
    return tuple(laps)


def _sectors(
    time: FloatArray, progress: FloatArray, length: float | None, number: int, start: float, finish: float | None
) -> tuple[float | None, ...]:
    """Return the times between the lines of a lap [s]; None from the first line on that was not reached."""
    if length is None:
        return (None,) * SECTORS
    lines = [start]
    for sector in range(1, SECTORS):
        reached = _first_time(time, progress, (number - 1 + sector / SECTORS) * length)
        if reached is None:
            break
        lines.append(reached)
    if finish is not None and len(lines) == SECTORS:
        lines.append(finish)
    times: list[float] = np.diff(lines).tolist()
    return (*times, *[None] * (SECTORS - len(times)))


def _first_time(time: FloatArray, progress: FloatArray, line: float) -> float | None:
    """Return when the progress first reaches a line [s], between two ticks as if at a steady speed; None: never."""
    reached = np.flatnonzero(progress >= line)
    if not len(reached):
        return None
    after = int(reached[0])
    if after == 0:
        return float(time[0])
    share = (line - progress[after - 1]) / (progress[after] - progress[after - 1])
    return float(time[after - 1] + share * (time[after] - time[after - 1]))


def _progress_at(moment: float, time: FloatArray, progress: FloatArray) -> float:
    i = min(max(int(np.searchsorted(time, moment, side="right")) - 1, 0), len(time) - 2)
    slope = (progress[i + 1] - progress[i]) / (time[i + 1] - time[i])
    return float(progress[i] + slope * (moment - time[i]))


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
    """Return all sliding of a race, in order, with progress within the lap, or the race where no length is known."""
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
