"""Open ground, level or with heights, endless and empty, for manoeuvres. There are no walls, no laps and no goal.

    result = race(OpenGround(seconds=10.0), my_planner)

Progress is counted along x and the offset along y, from the origin. The race is finished when its time is over.
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
from ..messages import CarParameters, FloatArray, MapLine, read_only, require
from .course import OnRelief, Sites
from .moving_obstacles import MovingObstacle
from .obstacles import Obstacle
from .track_mesh import Surface

if TYPE_CHECKING:
    from .ground import Relief

_REACH = 50_000.0  # [m] that its line goes to either side of the origin: 40 minutes at 20 m/s
_HALF_LINE = 0.3  # [m] to either side of the origin, of the line on the ground where the car starts
_AROUND = 2.0  # [m] round the origin, at least, in pictures


@explain_class
@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class OpenGround(OnRelief, Shown):
    """Open ground that is driven on for some time.

    Raises:
      SettingsError: a time that is not positive.
    """

    seconds: float  # that a race lasts
    name: str = "open_ground"
    relief: Relief | None = None  # what its ground has, with heights; None: it is level

    def __post_init__(self) -> None:
        if self.relief is not None and self.relief.heights is None:
            raise SettingsError("OpenGround.relief has no heights, on ground without end; accepted: with heights")
        require(self, lambda value: 0.0 < value < math.inf, "a positive number", ("seconds",), SettingsError)

    def __repr__(self) -> str:
        return brief(self, quoted(self.name), self.description)

    closed = False
    length = math.inf
    """Without end: no laps are counted, and the race is finished when its time is over."""
    modulus = 4.0 * _REACH
    origin = _REACH
    most_laps = 0
    stop_time = 0.0
    walls: tuple[Obstacle, ...] = ()
    obstacles: tuple[Obstacle, ...] = ()
    moving: tuple[MovingObstacle, ...] = ()
    edges: tuple[FloatArray, ...] = ()
    map_line = MapLine(points=np.array([[-_REACH, 0.0], [_REACH, 0.0]]), closed=False)
    table = read_only(np.array([[0.0], [-_REACH], [0.0], [2.0 * _REACH], [0.0], [4.0 * _REACH**2]]))
    ground_lines = read_only(np.array([[[0.0, _HALF_LINE], [0.0, -_HALF_LINE]]]))

    @cached_property
    def bounds(self) -> FloatArray:
        """Least and greatest x and y round the origin, and of the heights. Shape (2, 2) [m], read-only."""
        around = np.array([[-_AROUND, -_AROUND], [_AROUND, _AROUND]])
        (low, high), own = around, around if self.relief is None else self.relief.own.bounds
        return read_only(np.stack((np.minimum(low, own[0]), np.maximum(high, own[1]))))

    @property
    def description(self) -> str:
        """Its time limit, in words."""
        return f"no walls, {self.seconds:g} s"

    @property
    def definition(self) -> dict[str, FloatArray]:
        """The time, and the heights where it has them."""
        return {"seconds": np.array([self.seconds])} | ({} if self.relief is None else self.relief.definition)

    def longest_race(self, laps: int) -> float:
        """Return the time limit on it [s]."""
        return self.seconds

    def wall_surface(self) -> Surface | None:
        """There is none."""
        return None

    def check_car(self, car: CarParameters) -> None:
        """Any car can drive there."""

    def obstacle_sites(self, car: CarParameters) -> Sites:
        """Raise SettingsError: there are no lanes that boxes could leave free."""
        raise SettingsError(f"random obstacles on {self.name!r}; accepted: on a track")

    def draw_start(
        self, rng: np.random.Generator, car: CarParameters, obstacles: tuple[Obstacle, ...] = ()
    ) -> tuple[float, float, float]:
        """Return the origin, which is not random: 0 m, 0 m, 0 rad."""
        return 0.0, 0.0, 0.0

    def start_pose(self, s: float = 0.0, offset: float = 0.0) -> tuple[float, float, float]:
        """Return x = `s` [m], y = `offset` [m] and heading 0 rad."""
        return float(s), float(offset), 0.0

    def project(self, points: ArrayLike, near: float | ArrayLike | None = None) -> tuple[FloatArray, FloatArray]:
        """Return x, counted from the line's first point, and y of points (k, 2). Shape (k,) [m] each."""
        points = np.asarray(points, dtype=np.float64).reshape(-1, 2)
        return points[:, 0] + _REACH, points[:, 1].copy()
