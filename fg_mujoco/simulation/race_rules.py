"""When a race is over, and why."""

from __future__ import annotations

from ..course.course import Course
from ..errors import SettingsError
from ..kernels import kernel

NO_PROGRESS_LIMIT = 10.0  # [s] a race ends when the car has not come further for this long
USUAL_LAPS = 5
STANDING_SPEED = 0.05  # [m/s] a car slower than this stands still, where the goal is to stop
SLOWEST_RACE = 0.5  # [m/s] the default time limit is what a car as slow as this needs

END_REASONS = ("", "unstable", "crash", "finished", "no_progress", "time_limit", "interrupted", "failed")
"""By number; the first is that of a race that goes on. "unstable": MuJoCo warned of a bad state. "failed": in a batch,
the planner or the engine raised, which in a race of one car is an exception."""

_UNSTABLE, _CRASH, _FINISHED, _NO_PROGRESS, _TIME_LIMIT = range(1, 6)


def default_time_limit(laps: int, length: float) -> float:
    """Return how long a race of so many laps of a track of that length [m] may last [s]."""
    return laps * length / SLOWEST_RACE


def laps_to_drive(course: Course, laps: int | None) -> int:
    """Return how many laps a race has that wants so many; None: what is usual on the course.

    Raises:
      SettingsError: more than the course has.
    """
    most = course.most_laps
    if laps is None:
        return USUAL_LAPS if most is None else min(USUAL_LAPS, most)
    if most is not None and laps > most:
        raise SettingsError(f"laps is {laps!r} on {course.name!r}, which goes from a start to a goal; accepted: {most}")
    return laps


@kernel
def end_reason(
    unstable: bool,
    crashed: bool,
    laps_completed: int,
    laps: int,
    time: float,
    last_progress_time: float,
    last_time: float,
) -> int:
    """Return the number in END_REASONS of why a race is over, 0 while it goes on.

    `last_time` [s] is half a tick before the time limit, because times are sums of many ticks.
    """
    if unstable:
        return _UNSTABLE
    if crashed:
        return _CRASH
    if laps_completed >= laps:
        return _FINISHED
    if time - last_progress_time >= NO_PROGRESS_LIMIT:
        return _NO_PROGRESS
    if time >= last_time:
        return _TIME_LIMIT
    return 0
