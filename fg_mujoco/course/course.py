"""A course: a line with a start, the walls and obstacles along it, and the rules of a race on it.

`Track` is a closed course, raced for laps. `Scene` is an open one, raced once from its start to its goal. Any other
object that has the members of `Course` can be raced, too: nothing in the package asks for the class of a course.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import ArrayLike

from ..errors import SettingsError, TrackError
from ..messages import CarParameters, FloatArray, MapLine, shown
from .moving_obstacles import MovingObstacle
from .obstacles import Box, Obstacle
from .track_mesh import Surface

if TYPE_CHECKING:
    from .ground import Ground, Relief

USUAL_LAPS = 5
SLOWEST_RACE = 0.5  # [m/s] the default time limit is what a car as slow as this needs


ISLAND = "island_"
"""Of the names of a map's inner outlines in its definition, which are numbered."""

CLEAR_AHEAD, CLEAR_BEHIND = 4.0, 2.0
"""[m] of a start, in which no obstacle is put at random."""


class Sites(Protocol):
    """The places on a course where random boxes may stand."""

    @property
    def most(self) -> int:
        """Number of boxes that there is room for, wherever the start is."""

    def place(self, count: int, start: float, rng: np.random.Generator) -> tuple[Box, ...]:
        """Return so many boxes for a car that starts at progress `start` [m]."""


class Course(Protocol):
    """All that the simulation, the races and the pictures ask of a course. Progress is measured along its line."""

    def __hash__(self) -> int:
        """Of the object: what is worked out of a course is kept for it. Dataclasses have none unless `eq=False`."""

    # What it is

    @property
    def name(self) -> str:
        """As `load_track` takes it, for what is bundled or made from a seed."""

    @property
    def description(self) -> str:
        """Its dimensions, in one line for people."""

    @property
    def definition(self) -> Mapping[str, FloatArray]:
        """All numbers that make it what it is, by name. Two courses with the same numbers are the same course."""

    # Its line

    @property
    def closed(self) -> bool:
        """Whether the line is a loop that is driven for laps. An open line is driven once, from a start to a goal."""

    @property
    def length(self) -> float:
        """Length of a lap; of an open line from the start to the goal [m]; inf: no goal, the race lasts its time."""

    @property
    def modulus(self) -> float:
        """Period of progress [m]: the length of a lap; on an open line so much that nothing wraps."""

    @property
    def table(self) -> FloatArray:
        """Segments that `projection.follow` searches: s, x, y, dx, dy, length^2 of each. Shape (6, k).

        Shape (10, k) where bends have sections, as `projection.with_sections` returns them.
        """

    @property
    def map_line(self) -> MapLine:
        """The line for planners with a map."""

    @property
    def bounds(self) -> FloatArray:
        """Least and greatest x and y of what is to be looked at. Shape (2, 2) [m]."""

    def project(self, points: ArrayLike, near: float | ArrayLike | None = None) -> tuple[FloatArray, FloatArray]:
        """Return progress and offset, left positive, of points (k, 2) [m]. Shape (k,) [m] each.

        `near` is the progress that each point had shortly before [m]; None: the whole line is searched.
        """

    def start_pose(self, s: float = 0.0, offset: float = 0.0) -> tuple[float, float, float]:
        """Return x [m], y [m], heading [rad] at `s` [m] from the start along the line, `offset` [m] to its left."""

    # The rules of a race on it

    @property
    def origin(self) -> float | None:
        """Place on the line from which the progress of a race is counted [m]; None: from the car's first place."""

    @property
    def most_laps(self) -> int | None:
        """Greatest number of laps of a race; None: any number; 0: there are none."""

    @property
    def stop_time(self) -> float:
        """Time for which the car has to stand behind the goal to finish [s]; 0: passing it is enough."""

    def longest_race(self, laps: int) -> float:
        """Return the time limit of a race that is given none [s]."""

    # What stands and moves there

    @property
    def walls(self) -> tuple[Obstacle, ...]:
        """The convex solids that the walls are made of."""

    def wall_surface(self) -> Surface | None:
        """Return one mesh of the walls, which is seen in place of `walls`; None: the solids themselves are seen."""

    @property
    def edges(self) -> tuple[FloatArray, ...]:
        """Edges of the free floor from above, closed lines (k, 2) [m]: the left and the right one, then the islands.

        Empty where the course runs between no two such lines.
        """

    @property
    def ground_lines(self) -> FloatArray:
        """The start line and, on an open course, the goal line, each from its left end to its right. (k, 2, 2) [m]."""

    @property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """Solids that stand on the course, besides the walls."""

    @property
    def moving(self) -> tuple[MovingObstacle, ...]:
        """Obstacles that move."""

    # Who may drive there, and from where

    def check_car(self, car: CarParameters) -> None:
        """Raise TrackError where the course cannot be driven by such a car, or cannot be given walls."""

    def draw_start(
        self, rng: np.random.Generator, car: CarParameters, obstacles: tuple[Obstacle, ...] = ()
    ) -> tuple[float, float, float]:
        """Return a random standing start, clear of the `obstacles` that were put there.

        Returns:
          Progress [m], offset [m] to the left, and heading [rad] from that of the line.

        Raises:
          SettingsError: there is no room for one.
        """

    def obstacle_sites(self, car: CarParameters) -> Sites:
        """Return the places where random boxes may stand that leave such a car a way past each.

        Raises:
          SettingsError: the course takes no random boxes.
        """


class OnRelief:
    """A course that says what its ground has."""

    relief: Relief | None

    @cached_property
    def ground(self) -> Ground | None:
        """The surface that it lies on, which goes on beyond its edge as there; None: level ground."""
        if self.relief is None:
            return None
        from .ground import make_ground

        return make_ground(self)


MEMBERS = tuple(name for name in Course.__dict__ if not name.startswith("_"))
"""Names of all that an object needs to be a course."""


def require_course(found: object, where: str) -> None:
    """Raise TrackError for an object from `where` that lacks a member of `Course`."""
    missing = [name for name in MEMBERS if not hasattr(type(found), name) and not hasattr(found, name)]
    if isinstance(found, (list, tuple, set)):
        raise TrackError(
            f"{where} is {shown(found)}; accepted: one course; for several at once: `track` of fg_mujoco.rollout and "
            "fg_mujoco.compare, or an environment for each"
        )
    if len(missing) > len(MEMBERS) // 2:
        raise TrackError(
            f"{where} is {shown(found)}; accepted: a name such as 'oval', the path of a file, or an fg_mujoco.Course"
        )
    if missing:
        raise TrackError(
            f"{where} is a {type(found).__name__} without {', '.join(missing)}; accepted: a Track, a Scene, or an "
            "object with all members of fg_mujoco.Course"
        )
    if type(found).__hash__ is None:
        raise TrackError(f"{where} is a {type(found).__name__} without hash; accepted: a dataclass with eq=False")


def outline(points: FloatArray) -> FloatArray:
    """Return the sides of closed polygons, (..., n, 2) [m], each from one point to the next. Shape (..., n, 4) [m]."""
    return np.concatenate((points, np.roll(points, -1, axis=-2)), axis=-1)


def wall_outlines(course: Course) -> list[FloatArray]:
    """Return the walls from above, closed lines (k, 2) [m]: the course's edges, or the footprints of its walls."""
    return list(course.edges) or [wall.corners() for wall in course.walls]


def describe_course(course: Course) -> str:
    """Return the name and the size of a course in one line."""
    return f"{course.name}: {course.description}"


def default_time_limit(laps: int, length: float) -> float:
    """Return the time limit of a race of so many laps of a track of that length [m], in s."""
    return laps * length / SLOWEST_RACE


def laps_to_drive(course: Course, laps: int | None) -> int:
    """Return the number of laps; None gives the course's default.

    Raises:
      SettingsError: more than the course has.
    """
    most = course.most_laps
    if laps is None:
        return USUAL_LAPS if most is None else min(USUAL_LAPS, most)
    if most is not None and laps > most:
        why = "goes from a start to a goal" if most else "has no laps"
        raise SettingsError(f"laps is {laps!r} on {course.name!r}, which {why}; accepted: {most or None}")
    return laps
