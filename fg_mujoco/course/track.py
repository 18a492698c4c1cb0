"""A track: a closed centreline with a width to either side; progress s along it and lateral offset n of a point.

    track = load_track("oval")
    x, y, heading = track.start_pose()
    s, offset = track.project(np.array([[x, y]]))

All arrays are read-only; what is computed from the line is computed once.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from .. import portable
from ..arguments import explain_class
from ..display import Shown, brief, quoted
from ..errors import SettingsError, TrackError
from ..messages import CarParameters, FloatArray, MapLine, read_only, shown
from .course import CLEAR_AHEAD, CLEAR_BEHIND, ISLAND, OnRelief, Sites, default_time_limit
from .moving_obstacles import MovingObstacle
from .obstacles import Obstacle, Prism
from .polyline import MOST_POINTS, cross, segments, self_crossings, step_lengths, steps, subdivide, turns
from .projection import progress_by_sections, project_near, with_sections
from .track_mesh import Surface, joined, wall_feet, wall_surface

if TYPE_CHECKING:
    from .built_walls import WallPart, Walls
    from .ground import Relief

OFF_CENTRE = 0.5
"""Greatest offset of a random start, as a share of what the car has between the centreline and the nearer wall."""

HEADING = 0.2  # [rad] greatest, of a random start, from that of the centreline
_TRIES = 1000  # random starts that are drawn before there is said to be none

MIN_POINTS = 4  # three make a triangle, which tells nothing of a circuit
LONGEST = 30e3  # [m] of a line: the longest circuits there are, at their full size
MOST_OF_A_SQUARE = 20.0  # [m] of a line in a square metre: neighbouring lanes have 2 or 3
FURTHEST = 1e6  # [m] from the world's origin: numbers there are still true to 1e-9 m
WIDEST = 1e3  # [m] to either wall

_WALL_PIECES = 0.5  # [m] of walls on ground that is not level
_CHUNK = 256  # points projected at once against the whole line, to bound the memory


@explain_class
@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Track(OnRelief, Shown):
    """A circuit, driven in the order of its points.

    Raises:
      TrackError: when made, fewer than 4 points or more than MOST_POINTS, a number that is not finite, a coordinate
        beyond FURTHEST, a line longer than LONGEST, a width that is not positive or is above WIDEST, a point twice in
        a row, a line that turns back or crosses itself, or stretches that run over each other. When its walls are asked
        for, corners that leave no room for the inner one.
    """

    name: str
    centreline: FloatArray  # (n, 2) [m] closed, the first point not repeated
    width_right: FloatArray  # (n,) [m] from the centreline to the right wall
    width_left: FloatArray  # (n,) [m] to the left wall
    moving: tuple[MovingObstacle, ...] = ()  # that move there, as `with_moving` of the add-on arena puts them
    built: Walls | None = None  # how its walls are built; None: upright, without gaps
    relief: Relief | None = None  # what its ground has; None: it is level

    def __post_init__(self) -> None:
        for name, kind in (("built", "Walls"), ("relief", "Relief")):
            if getattr(self, name) is not None and type(getattr(self, name)).__name__ != kind:
                raise TrackError(f"Track.{name} is {shown(getattr(self, name))}; accepted: {kind}, or None")
        line = read_only(self.centreline)
        if line.ndim != 2 or line.shape[1] != 2 or len(line) < MIN_POINTS:
            raise TrackError(f"a centreline of shape {line.shape}; accepted: (n, 2) with at least {MIN_POINTS} points")
        object.__setattr__(self, "centreline", line)
        for side in ("width_right", "width_left"):
            width = read_only(getattr(self, side))
            if width.shape != (len(line),):
                raise TrackError(f"{side} has shape {width.shape}; accepted: ({len(line)},), one for each point")
            if not np.all((width > 0.0) & (width <= WIDEST)):
                bad = int(np.flatnonzero(~((width > 0.0) & (width <= WIDEST)))[0])
                raise TrackError(
                    f"{side} is {width[bad]} m at point {bad}; accepted: a positive number, at most {WIDEST:g} m"
                )
            object.__setattr__(self, side, width)
        _check_line(line)
        _ = self._corridor  # refuses stretches that run over each other

    def __repr__(self) -> str:
        return brief(self, quoted(self.name), self.description, f"{len(self.centreline)} points")

    @property
    def corridor_right(self) -> FloatArray:
        """To the right wall, less what another stretch that runs alongside takes. Shape (n,) [m], read-only."""
        return self._corridor[0]

    @property
    def corridor_left(self) -> FloatArray:
        """To the left wall, less what another stretch that runs alongside takes. Shape (n,) [m], read-only."""
        return self._corridor[1]

    @cached_property
    def length(self) -> float:
        """Length of one lap on the centreline [m]."""
        return float(self._lengths.sum())

    @cached_property
    def _lengths(self) -> FloatArray:
        """Length of each segment. Shape (n,) [m]."""
        return step_lengths(self.centreline)

    @cached_property
    def _directions(self) -> FloatArray:
        """Direction of each segment, of length 1. Shape (n, 2)."""
        return steps(self.centreline) / self._lengths[:, None]

    @cached_property
    def _room_round(self) -> tuple[FloatArray, ...]:
        """Progress round the lap and a point more at both ends, and the corridor to the right and to the left there."""
        ends = (self.arc_length[-1:] - self.length, self.arc_length, self.arc_length[:1] + self.length)
        return np.concatenate(ends), *(np.concatenate((side[-1:], side, side[:1])) for side in self._corridor)

    closed = True
    origin = None  # progress of a race is counted from where the car is first seen
    most_laps = None
    stop_time = 0.0
    obstacles = ()  # nothing stands on a track but its walls and islands

    @property
    def description(self) -> str:
        """Length, widths and tightest radius."""
        width = self.corridor_left + self.corridor_right
        widths = " to ".join(sorted({f"{width.min():.2f}", f"{width.max():.2f}"}, key=float))
        radius = 1.0 / max(float(np.abs(self.curvature).max()), 1e-9)
        moving = f", {len(self.moving)} moving" if self.moving else ""
        return f"{self.length:.1f} m long, {widths} m wide, tightest radius {radius:.2f} m{moving}"

    @property
    def modulus(self) -> float:
        """Period of progress: the length [m]."""
        return self.length

    def longest_race(self, laps: int) -> float:
        """Return the time limit of a race: the time that a car as slow as SLOWEST_RACE needs [s]."""
        return default_time_limit(laps, self.length)

    @cached_property
    def bounds(self) -> FloatArray:
        """Least and greatest x and y of the centreline. Shape (2, 2) [m], read-only."""
        return read_only(np.stack((self.centreline.min(axis=0), self.centreline.max(axis=0))))

    @cached_property
    def arc_length(self) -> FloatArray:
        """Progress at each point, 0 at the first. Shape (n,) [m], read-only."""
        return read_only(np.concatenate(([0.0], np.cumsum(self._lengths)[:-1])))

    @cached_property
    def headings(self) -> FloatArray:
        """Heading at each point: between those of its two segments. Shape (n,) [rad] in +-pi, read-only."""
        heading = portable.arctan2(*steps(self.centreline).T[::-1]) - 0.5 * turns(self.centreline)
        return read_only(portable.arctan2(portable.sin(heading), portable.cos(heading)))

    @cached_property
    def curvature(self) -> FloatArray:
        """Curvature at each point, left positive: turn over half the two segments. Shape (n,) [1/m], read-only."""
        return read_only(turns(self.centreline) / (0.5 * (self._lengths + np.roll(self._lengths, 1))))

    @cached_property
    def map_line(self) -> MapLine:
        """The line and the walls for planners with a map."""
        return MapLine(points=self.centreline, closed=True, walls=self.edges)

    @property
    def left_wall(self) -> FloatArray:
        """Inner face of the left wall, closed, in driving order from anywhere. Shape (m, 2) [m], read-only."""
        return self._walls[1]

    @property
    def right_wall(self) -> FloatArray:
        """Inner face of the right wall, closed, in driving order from anywhere. Shape (k, 2) [m], read-only."""
        return self._walls[0]

    @property
    def islands(self) -> tuple[FloatArray, ...]:
        """Outlines of what stands between the walls, counterclockwise; none where walls are those of the widths."""
        return ()

    @property
    def definition(self) -> dict[str, FloatArray]:
        """All that makes it what it is: line and widths, and what moves there."""
        moving = {"moving": np.array([each.numbers() for each in self.moving], np.float64)} if self.moving else {}
        built = {} if self.built is None else {"built": self.built.numbers}
        relief = {} if self.relief is None else self.relief.definition
        lines = {name: getattr(self, name) for name in ("centreline", "width_right", "width_left")}
        return lines | moving | built | relief

    @cached_property
    def walls(self) -> tuple[Obstacle, ...]:
        """The convex solids that the walls are made of: one for each segment of their inner faces."""
        if self.wall_parts:
            return tuple(solid for part in self.wall_parts for solid in part.solids())
        return tuple(Prism(footprint=corners) for corners in wall_feet(self._standing_edges).tolist())

    @cached_property
    def wall_parts(self) -> list[WallPart]:
        """The walls by how they are built; none where that is not said."""
        kinds = getattr(self, "kinds", ())  # of a map
        if self.built is None and not kinds:
            return []
        from .built_walls import Walls, wall_parts

        marks = getattr(self, "marks", None)
        return wall_parts(self.edges, self._standing_edges, (self.built or Walls(), *kinds), marks)

    @cached_property
    def hall(self) -> tuple[Obstacle, ...]:
        """The walls of the hall that the track is in, and what stands there; none without a hall."""
        if self.built is None:
            return ()
        from .built_walls import hall_solids

        return hall_solids(self.edges, self.built)

    def wall_surface(self) -> Surface | None:
        """Return one mesh of all walls, which is seen in place of the solids; each of `wall_parts` has its own."""
        if self.wall_parts:
            return joined(part.surface() for part in self.wall_parts)
        return wall_surface(self._standing_edges)

    @property
    def _standing_edges(self) -> tuple[FloatArray, ...]:
        """The edges, on ground that is not level in pieces that are short enough to follow it."""
        if self.ground is None or self.ground.flat:
            return self.edges
        return tuple(subdivide(edge, _WALL_PIECES)[0] for edge in self.edges)

    @property
    def edges(self) -> tuple[FloatArray, ...]:
        """Inner faces of the left wall and of the right one, then the islands. Shapes (k, 2) [m]."""
        return (self.left_wall, self.right_wall, *self.islands)

    @property
    def ground_lines(self) -> FloatArray:
        """The start line, from wall to wall. Shape (1, 2, 2) [m]."""
        x, y, heading = self.start_pose()
        aside = np.array([-math.sin(heading), math.cos(heading)])
        return (np.array([x, y]) + np.outer((self.corridor_left[0], -self.corridor_right[0]), aside))[np.newaxis]

    def check_car(self, car: CarParameters) -> None:
        """Raise TrackError for a track that is not wider than the car, or whose corners leave no room for walls."""
        width = self.corridor_right + self.corridor_left
        narrowest = int(np.argmin(width))
        if width[narrowest] <= car.width:
            x, y = self.centreline[narrowest]
            raise TrackError(
                f"track {self.name!r} is {width[narrowest]:.2f} m wide at ({x:.2f}, {y:.2f}), point {narrowest}; "
                f"accepted: wider than the car, {car.width:.2f} m"
            )
        _ = self.left_wall

    def obstacle_sites(self, car: CarParameters) -> Sites:
        """Return the places where random boxes may stand that leave such a car a way past each."""
        from .random_obstacles import ObstacleSites

        return ObstacleSites(self, car)

    def draw_start(
        self, rng: np.random.Generator, car: CarParameters, obstacles: tuple[Obstacle, ...] = ()
    ) -> tuple[float, float, float]:
        """Return a random standing start, as `Course.draw_start` says, near the centreline and along it.

        With obstacles it is where `random_boxes` would leave room for it: none is near, and nothing moves there.
        """
        points = [obstacle.corners().mean(axis=0) for obstacle in obstacles]
        points += [np.array(end) for each in self.moving for end in (each.start, each.end)]
        stations = self.project(np.array(points))[0] if points else np.zeros(0)
        for _ in range(_TRIES):
            s, across, turned = rng.uniform((0.0, -1.0, -1.0), (self.length, 1.0, 1.0)).tolist()
            ahead = (stations - s) % self.length
            if not len(ahead) or not np.any((ahead < CLEAR_AHEAD) | (ahead > self.length - CLEAR_BEHIND)):
                along, *sides = self._room_round
                room = min(float(np.interp(s % self.length, along, side)) for side in sides)
                room = max(room - 0.5 * math.hypot(car.width, car.length), 0.0)  # however the car is turned
                return s, OFF_CENTRE * room * across, HEADING * turned
        raise SettingsError(
            f"no start on {self.name!r} has {CLEAR_AHEAD} m ahead and {CLEAR_BEHIND} m behind it free of its "
            f"{len(obstacles) + len(self.moving)} obstacles; accepted: start 'line', or fewer"
        )

    @cached_property
    def _corridor(self) -> tuple[FloatArray, FloatArray]:
        from .track_walls import shared_widths  # of a race this is kept

        right, left = shared_widths(self.centreline, self.width_right, self.width_left)
        return read_only(right), read_only(left)

    @cached_property
    def _walls(self) -> tuple[FloatArray, FloatArray]:
        from .track_walls import wall_lines

        return wall_lines(self.centreline, self.corridor_right, self.corridor_left)

    def position(self, s: ArrayLike, offset: ArrayLike) -> FloatArray:
        """Point at progress `s` [m], any number of laps, and `offset` [m] to the left of the centreline.

        Args and result broadcast: shapes (...) -> (..., 2) [m]. The inverse of `project` where one segment is
        nearest; in the wedge outside a corner point, `project` answers the corner, and inside of a tight bend the place
        of a section.
        """
        s, offset = np.broadcast_arrays(np.asarray(s, float) % self.length, np.asarray(offset, float))
        i = np.searchsorted(self.arc_length, s, side="right") - 1
        ahead = self._directions[i]
        left = np.stack((-ahead[..., 1], ahead[..., 0]), axis=-1)
        return np.asarray(self.centreline[i] + (s - self.arc_length[i])[..., None] * ahead + offset[..., None] * left)

    def start_pose(self, s: float = 0.0, offset: float = 0.0) -> tuple[float, float, float]:
        """Pose at progress `s` [m], `offset` [m] to the left of the centreline, along it: x [m], y [m], heading [rad].

        The heading runs evenly from that of one point to that of the next.
        """
        s = float(s) % self.length
        i = bisect_right(self.arc_length, s) - 1
        (x, y), (ahead_x, ahead_y) = self.centreline[i].tolist(), self._directions[i].tolist()
        past = s - self.arc_length.item(i)
        heading, following = self.headings.item(i), self.headings.item((i + 1) % len(self.headings))
        turn = math.remainder(following - heading, 2.0 * math.pi)
        return (
            x + past * ahead_x - offset * ahead_y, y + past * ahead_y + offset * ahead_x,
            math.remainder(heading + past / self._lengths.item(i) * turn, 2.0 * math.pi),
        )  # fmt: skip

    def project(self, points: ArrayLike, near: float | ArrayLike | None = None) -> tuple[FloatArray, FloatArray]:
        """Progress and lateral offset of points: the nearest place of the centreline.

        On the inside of a bend that is tighter than the corridor is wide, progress is that of a section, as the module
        `projection` says.

        Args:
          points: shape (k, 2) [m].
          near: progress that each point had shortly before, a number or shape (k,) [m]. The search goes along the line
            from there, so that a stretch that runs close by is never taken for this one. Without it, a stretch in whose
            corridor the point lies is preferred to one whose centreline is merely nearer.

        Returns:
          s in [0, length), and the offset from the nearest place, left positive. Shape (k,) [m] each.
        """
        points = np.asarray(points, dtype=np.float64).reshape(-1, 2)
        if near is not None:
            return project_near(points, near, self.table, self.length)
        found = np.empty((2, len(points)))
        for k in range(0, len(points), _CHUNK):
            found[:, k : k + _CHUNK] = self._locate(points[k : k + _CHUNK])
        return progress_by_sections(points, found[0], found[1], self.table, self.length), found[1]

    def _locate(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Project (k, 2) points with no hint, against all segments."""
        ahead = steps(self.centreline)
        away = points[:, None] - self.centreline
        share = np.clip(np.sum(away * ahead, axis=2) / np.sum(ahead * ahead, axis=1), 0.0, 1.0)
        foot = away - share[..., None] * ahead
        distance = np.hypot(foot[..., 0], foot[..., 1])
        is_left = cross(ahead, away) >= 0.0
        width = np.where(is_left, self.corridor_left, self.corridor_right)
        next_width = np.where(is_left, np.roll(self.corridor_left, -1), np.roll(self.corridor_right, -1))
        outside = distance > (1.0 - share) * width + share * next_width
        everywhere_outside = outside.all(axis=1, keepdims=True)
        best = np.argmin(np.where(outside & ~everywhere_outside, np.inf, distance), axis=1)
        k = np.arange(len(points))
        s = self.arc_length[best] + share[k, best] * self._lengths[best]
        return s % self.length, np.where(is_left[k, best], 1.0, -1.0) * distance[k, best]

    @cached_property
    def table(self) -> FloatArray:
        """Segments that `follow` searches, read-only.

        From a lap before the line to two after, so that a window about any progress in [0, length) is one slice.
        """
        ahead = steps(self.centreline)
        lap = np.vstack((self.arc_length, self.centreline.T, ahead.T, np.sum(ahead * ahead, axis=1)))
        lap = with_sections(lap, self.length, lambda: list(map(segments, self.edges[:2])), np.maximum(*self._corridor))
        table = np.tile(lap, 3)
        table[0] += self.length * np.repeat((-1.0, 0.0, 1.0), lap.shape[1])
        return read_only(table)


@explain_class
@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class MapTrack(Track):
    """A circuit whose walls are given, and not those of its widths. The widths are the distances to the walls.

    Raises:
      TrackError: when made, what Track raises of its line and widths.
    """

    wall_right: FloatArray  # (k, 2) [m] closed, in driving order
    wall_left: FloatArray  # (m, 2) [m] closed, in driving order
    outlines: tuple[FloatArray, ...] = ()  # of what stands between the two, each closed and counterclockwise [m]
    kinds: tuple[Walls, ...] = ()  # of walls that the map's table has, besides `built`
    marks: FloatArray | None = None  # (k,) for each segment of all edges: 0 as `built`, 1 the first of `kinds`

    @property
    def islands(self) -> tuple[FloatArray, ...]:
        """Outlines of what stands between the walls, counterclockwise. Shapes (k, 2) [m], read-only."""
        return self.outlines

    @property
    def definition(self) -> dict[str, FloatArray]:
        """All that makes it what it is: line, widths, walls, islands, and how walls are built."""
        islands = {f"{ISLAND}{number}": outline for number, outline in enumerate(self.outlines)}
        own = {"wall_right": self.wall_right, "wall_left": self.wall_left} | islands
        if self.marks is not None:
            own |= {"kinds": np.array([each.numbers for each in self.kinds]), "marks": self.marks}
        return super().definition | own

    @cached_property
    def _corridor(self) -> tuple[FloatArray, FloatArray]:
        return self.width_right, self.width_left

    @cached_property
    def _walls(self) -> tuple[FloatArray, FloatArray]:
        return read_only(self.wall_right), read_only(self.wall_left)


def check_size(line: FloatArray) -> None:
    """Raise TrackError for a line (n, 2) of finite numbers [m] that is too much to work on, or too far away."""
    if len(line) > MOST_POINTS:
        raise TrackError(f"the centreline has {len(line)} points; accepted: {MOST_POINTS} at most")
    far = np.abs(line).max(axis=1) > FURTHEST
    if far.any():
        x, y = line[far][0]
        raise TrackError(
            f"the centreline is ({x:g}, {y:g}) at point {int(far.argmax())}; accepted: within {FURTHEST:g} m of the "
            "origin"
        )
    length = float(step_lengths(line).sum())
    if length > LONGEST:
        raise TrackError(f"the centreline is {length:g} m long; accepted: {LONGEST:g} m at most")
    (x, y), most = _densest_square(line)
    if most > MOST_OF_A_SQUARE:
        raise TrackError(
            f"the centreline has {most:.0f} m in the square metre at ({x:g}, {y:g}); accepted: {MOST_OF_A_SQUARE:g} m "
            "at most, a line that does not go to and fro"
        )


def _densest_square(line: FloatArray) -> tuple[tuple[float, float], float]:
    """Return the corner of the square metre that holds most of a closed line (n, 2), and how much [m]."""
    (pieces,) = subdivide(line, 0.5)  # none is longer than half a square's side
    squares, found = np.unique(np.floor(segments(pieces).mean(axis=1)), axis=0, return_inverse=True)
    held = np.bincount(found.ravel(), weights=step_lengths(pieces))
    densest = int(held.argmax())
    return (float(squares[densest, 0]), float(squares[densest, 1])), float(held[densest])


def _check_line(line: FloatArray) -> None:
    """Raise TrackError for a line that no corridor can follow."""
    if not np.isfinite(line).all():
        bad = int(np.flatnonzero(~np.isfinite(line).all(axis=1))[0])
        raise TrackError(f"the centreline is {tuple(line[bad].tolist())} at point {bad}; accepted: finite numbers")
    check_size(line)
    lengths = step_lengths(line)
    if not np.all(lengths > 0.0):
        bad = int(np.argmin(lengths))
        raise TrackError(f"point {(bad + 1) % len(line)} of the centreline repeats point {bad}; accepted: each once")
    i, j = self_crossings(line)
    if len(i):
        (x, y), first, second = line[i[0]], int(i[0]), int(j[0])
        raise TrackError(
            f"the centreline crosses itself near ({x:.2f}, {y:.2f}): between points {first} and {first + 1}, and again "
            f"between points {second} and {(second + 1) % len(line)}; accepted: a line that never crosses itself"
        )
    sharpest = int(np.argmax(np.abs(turns(line))))
    turn = math.degrees(turns(line)[sharpest])
    from .track_walls import MAX_TURN

    if abs(turn) > math.degrees(MAX_TURN):
        (x, y) = line[sharpest]
        raise TrackError(
            f"the centreline turns back by {turn:.0f} deg at point {sharpest}, ({x:.2f}, {y:.2f}); accepted: at most "
            f"{math.degrees(MAX_TURN):.0f} deg at one point"
        )
