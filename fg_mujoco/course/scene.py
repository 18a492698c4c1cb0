"""A scene: a way from a start to a goal among walls and obstacles, some of which may move.

    scene = load_track("scene:narrow_gap_150:7")
    result = race(scene, "gap_finder")

A scene can be raced wherever a track can, once. The race is finished when the car passes the goal. Where the goal is to
stop, the race is finished when the car has stood still behind the goal for STOP_TIME. The scenes that have a name are
made in `scenes`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import explain_class
from ..display import Shown, brief, quoted
from ..errors import SettingsError
from ..messages import CarParameters, FloatArray, MapLine, read_only
from .course import OnRelief, Sites
from .moving_obstacles import MovingObstacle
from .obstacles import Obstacle, solids_numbers
from .polyline import cross, segments
from .projection import project_near, with_sections
from .track_mesh import Surface

if TYPE_CHECKING:
    from .ground import Relief

BEHIND, BEYOND = 2.0, 3.0  # [m] least, of the way behind the start and beyond the goal
STOP_TIME = 2.0  # [s] that the car has to stand still where the goal is to stop
_WIDEST = 3.0  # [m] from the way to a wall that is looked for at a bend
_HALF_LINE = 0.3  # [m] to either side of the way, of the lines on the ground at the start and the goal


@explain_class
@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Scene(OnRelief, Shown):
    """A way to be driven once, among solids. Progress on the way is counted from its first point.

    Raises:
      SettingsError: a way of less than two points, with one twice in a row or not finite; a start or goal without
        BEHIND and BEYOND of way around them; a time limit that is not positive.
    """

    name: str
    way: FloatArray  # (n, 2) [m] open
    start: float  # [m] progress
    goal: float  # [m] progress
    walls: tuple[Obstacle, ...]
    obstacles: tuple[Obstacle, ...] = ()
    moving: tuple[MovingObstacle, ...] = ()
    time_limit: float  # [s] of simulated time
    goal_is_to_stop: bool = False  # behind the goal, without touching anything
    relief: Relief | None = None  # what its ground has; None: it is level

    def __post_init__(self) -> None:
        way = read_only(self.way)
        if way.ndim != 2 or way.shape[1] != 2 or len(way) < 2 or not np.isfinite(way).all():
            raise SettingsError(
                f"scene {self.name!r} has a way of shape {way.shape}; accepted: (n, 2), n from 2, finite"
            )
        object.__setattr__(self, "way", way)
        if not np.all(self._steps[1] > 0.0):
            raise SettingsError(
                f"a point of the way of scene {self.name!r} repeats the one before; accepted: each once"
            )
        slack = 1e-9  # of sums
        if not BEHIND - slack <= self.start < self.goal <= self.way_length - BEYOND + slack:
            raise SettingsError(
                f"scene {self.name!r} starts at {self.start:.2f} m and has its goal at {self.goal:.2f} m of a way of "
                f"{self.way_length:.2f} m; accepted: in this order, {BEHIND} m behind the start, {BEYOND} m beyond the "
                "goal"
            )
        if not 0.0 < self.time_limit < math.inf:
            raise SettingsError(
                f"scene {self.name!r} has time limit {self.time_limit!r} s; accepted: a positive number"
            )

    def __repr__(self) -> str:
        return brief(self, quoted(self.name), self.description)

    closed = False
    most_laps = 1
    edges = ()  # solids, and no corridor

    @property
    def description(self) -> str:
        """Length, kind of goal, obstacles and time limit."""
        goal = "to a stop" if self.goal_is_to_stop else "to the goal"
        moving = f", {len(self.moving)} moving" if self.moving else ""
        return (
            f"{self.length:.1f} m {goal}, {len(self.obstacles)} obstacles{moving}, time limit {self.time_limit:.0f} s"
        )

    @property
    def definition(self) -> dict[str, FloatArray]:
        """All that makes it what it is: the way, the rules, the solids and what moves."""
        return {
            "way": self.way,
            "rules": np.array([self.start, self.goal, self.time_limit, self.goal_is_to_stop], np.float64),
            "walls": solids_numbers(self.walls),
            "obstacles": solids_numbers(self.obstacles),
            "moving": np.array([moving.numbers() for moving in self.moving], np.float64),
        } | ({} if self.relief is None else self.relief.definition)

    @property
    def length(self) -> float:
        """Distance from the start to the goal [m]."""
        return self.goal - self.start

    @property
    def way_length(self) -> float:
        """Length of the whole way [m]."""
        return float(self._steps[1].sum())

    @property
    def modulus(self) -> float:
        """More than twice the way, so that progress never wraps [m]."""
        return 4.0 * self.way_length

    @property
    def origin(self) -> float | None:
        """Progress of a race is counted from the start [m]."""
        return self.start

    @property
    def stop_time(self) -> float:
        """Time for which the car has to stand still behind the goal [s]."""
        return STOP_TIME if self.goal_is_to_stop else 0.0

    def longest_race(self, laps: int) -> float:
        """Return the scene's time limit [s]."""
        return self.time_limit

    def wall_surface(self) -> Surface | None:
        """The walls are seen as the solids that they are."""
        return None

    @property
    def ground_lines(self) -> FloatArray:
        """The start line and the goal line, from left to right. Shape (2, 2, 2) [m]."""
        return self.position(np.array([[0.0], [self.length]]), (_HALF_LINE, -_HALF_LINE))

    def check_car(self, car: CarParameters) -> None:
        """A scene may be as narrow as it likes."""

    def obstacle_sites(self, car: CarParameters) -> Sites:
        """Raise SettingsError: a scene has its own obstacles."""
        raise SettingsError(f"random obstacles on {self.name!r}, which has its own; accepted: on a track")

    def draw_start(
        self, rng: np.random.Generator, car: CarParameters, obstacles: tuple[Obstacle, ...] = ()
    ) -> tuple[float, float, float]:
        """Return the start of the scene, which is not random: 0 m, 0 m, 0 rad."""
        return 0.0, 0.0, 0.0

    @cached_property
    def bounds(self) -> FloatArray:
        """Least and greatest x and y of the walls, obstacles and the way. Shape (2, 2) [m], read-only."""
        points = np.concatenate([self.way, *(solid.corners() for solid in (*self.walls, *self.obstacles))])
        return read_only(np.stack((points.min(axis=0), points.max(axis=0))))

    @cached_property
    def map_line(self) -> MapLine:
        """The way and the walls for planners with a map."""
        return MapLine(points=self.way, closed=False, walls=tuple(wall.corners() for wall in self.walls))

    @cached_property
    def arc_length(self) -> FloatArray:
        """Progress at each point of the way. Shape (n,) [m], read-only."""
        return read_only(np.concatenate(([0.0], np.cumsum(self._steps[1]))))

    @cached_property
    def table(self) -> FloatArray:
        """Segments of the way that `follow` searches, read-only."""
        ahead, lengths = self._steps
        way = np.vstack((self.arc_length[:-1], self.way[:-1].T, ahead.T, lengths * lengths))
        return read_only(np.ascontiguousarray(with_sections(way, None, self._wall_sides, _WIDEST)))

    def _wall_sides(self) -> tuple[FloatArray, FloatArray]:
        """Return the segments of the walls on the left of the way and on its right. Shapes (k, 2, 2) [m]."""
        sides = np.concatenate([segments(wall.corners()) for wall in self.walls] or [np.empty((0, 2, 2))])
        middles = sides.mean(axis=1)
        segment = np.searchsorted(self.arc_length[1:-1], self._nearest(middles), side="right")
        on_left = cross(self._steps[0][segment], middles - self.way[segment]) > 0.0
        return sides[on_left], sides[~on_left]

    def position(self, s: ArrayLike, offset: ArrayLike = 0.0) -> FloatArray:
        """Points `s` [m] from the start along the way, `offset` [m] to its left; beyond its ends it goes straight on.

        Args and result broadcast: shapes (...) -> (..., 2) [m].
        """
        s, offset = np.broadcast_arrays(np.asarray(s, float) + self.start, np.asarray(offset, float))
        ahead, lengths = self._steps
        i = np.clip(np.searchsorted(self.arc_length, s, side="right") - 1, 0, len(lengths) - 1)
        along = (ahead / lengths[:, None])[i]
        left = np.stack((-along[..., 1], along[..., 0]), axis=-1)
        return np.asarray(self.way[i] + (s - self.arc_length[i])[..., None] * along + offset[..., None] * left)

    def start_pose(self, s: float = 0.0, offset: float = 0.0) -> tuple[float, float, float]:
        """Pose `s` [m] from the start along the way, `offset` [m] to its left: x [m], y [m], heading [rad]."""
        x, y = self.position(s, offset)
        ahead, lengths = self._steps
        i = np.clip(np.searchsorted(self.arc_length, s + self.start, side="right") - 1, 0, len(lengths) - 1)
        return float(x), float(y), math.atan2(ahead[i, 1], ahead[i, 0])

    def project(self, points: ArrayLike, near: float | ArrayLike | None = None) -> tuple[FloatArray, FloatArray]:
        """Progress on the way, counted from its first point, and offset of points (k, 2). Shape (k,) [m] each.

        `near` is the progress that each point had shortly before, a number or shape (k,) [m]; as in `Track.project`.
        """
        points = np.asarray(points, dtype=np.float64).reshape(-1, 2)
        return project_near(points, self._nearest(points) if near is None else near, self.table, self.modulus)

    def _nearest(self, points: FloatArray) -> FloatArray:
        """Progress of the nearest place of the whole way. Shape (k,) [m]."""
        ahead, lengths = self._steps
        away = points[:, None] - self.way[:-1]
        share = np.clip(np.sum(away * ahead, axis=2) / (lengths * lengths), 0.0, 1.0)
        best = np.argmin(np.sum((away - share[..., None] * ahead) ** 2, axis=2), axis=1)
        return np.asarray(self.arc_length[best] + share[np.arange(len(points)), best] * lengths[best])

    @cached_property
    def _steps(self) -> tuple[FloatArray, FloatArray]:
        """From each point of the way to the next (n - 1, 2), and how far that is (n - 1,) [m]."""
        ahead = np.diff(self.way, axis=0)
        return ahead, np.asarray(np.hypot(*ahead.T))
