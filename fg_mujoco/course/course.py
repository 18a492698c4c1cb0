"""What can be raced: a line with a start, a goal or a lap, and how long a race of it may last.

`Track` is a closed one, raced for laps; `Scene` an open one, raced once, from its start to its goal.
"""

from __future__ import annotations

from typing import Protocol

from numpy.typing import ArrayLike

from ..errors import SettingsError
from ..messages import FloatArray, MapLine

USUAL_LAPS = 5
SLOWEST_RACE = 0.5  # [m/s] the default time limit is what a car as slow as this needs


class Course(Protocol):
    """What timing and judging a race want of its line. Progress is measured along it."""

    @property
    def name(self) -> str:
        """As `load_track` takes it, for what is bundled or made from a seed."""

    @property
    def length(self) -> float:
        """Of a lap; of an open line from the start to the goal [m]."""

    @property
    def modulus(self) -> float:
        """What progress on the line is counted modulo [m]: its length; on an open line so much that nothing wraps."""

    @property
    def origin(self) -> float | None:
        """Where on the line the progress of a race is counted from [m]; None: from where the car is first seen."""

    @property
    def most_laps(self) -> int | None:
        """How many laps a race may have; None: any number."""

    @property
    def stop_time(self) -> float:
        """How long the car has to stand behind the goal for the race to be finished [s]; 0: passing it is enough."""

    @property
    def table(self) -> FloatArray:
        """What `track.follow` searches: s, x, y, dx, dy, length^2 of each segment. Shape (6, k)."""

    @property
    def map_line(self) -> MapLine:
        """What a planner with a map is told."""

    @property
    def bounds(self) -> FloatArray:
        """Least and greatest x and y of what is to be looked at. Shape (2, 2) [m]."""

    def project(self, points: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Progress on the line and offset, left positive, of points (k, 2) [m]. Shape (k,) [m] each."""

    def start_pose(self, s: float = 0.0, offset: float = 0.0) -> tuple[float, float, float]:
        """Pose `s` [m] from the start along the line and `offset` [m] to its left: x [m], y [m], heading [rad]."""

    def longest_race(self, laps: int) -> float:
        """Return how long a race may last, unless it is told otherwise [s]."""


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
