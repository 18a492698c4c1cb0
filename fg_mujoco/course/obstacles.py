"""Solids that stand on a course. Each is one convex solid for rays and contacts alike: what is seen is what is hit."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, astuple, dataclass, fields
from typing import Any

import numpy as np

from .. import portable
from ..arguments import explain_class
from ..display import brief
from ..errors import ArgumentError, SettingsError, accepted_names
from ..messages import FloatArray, require, require_whole, shown
from .track_mesh import WALL_HEIGHT

_CYLINDER_SIDES = 24
_FURTHEST = 1e6  # [m] from the world's origin, as of a track
_LARGEST = 1e3  # [m] of any side
_NEAR = f"a finite number up to {_FURTHEST:g} on either side of 0"
_LENGTH = f"a positive length in metres up to {_LARGEST:g}"


@explain_class
@dataclass(frozen=True, kw_only=True)
class Box:
    """An upright box standing on the ground.

    Raises:
      SettingsError: a size that is not positive, or a position that is not finite.
    """

    x: float  # [m] centre, world frame
    y: float  # [m]
    length: float  # [m] along its heading
    width: float  # [m]
    height: float = WALL_HEIGHT  # [m]
    heading: float = 0.0  # [rad]

    def __post_init__(self) -> None:
        require(self, _is_near, _NEAR, ("x", "y"), SettingsError)
        require(self, math.isfinite, "a finite number", ("heading",), SettingsError)
        require(self, _is_length, _LENGTH, ("length", "width", "height"), SettingsError)

    def corners(self) -> FloatArray:
        """Footprint, counterclockwise. Shape (4, 2) [m]."""
        half = 0.5 * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * (self.length, self.width)
        cos, sin = math.cos(self.heading), math.sin(self.heading)
        turned: FloatArray = half @ np.array([[cos, sin], [-sin, cos]])
        return np.add(turned, (self.x, self.y))


@explain_class
@dataclass(frozen=True, kw_only=True)
class Cylinder:
    """An upright cylinder standing on the ground, as a prism of 24 sides inscribed in it.

    Raises:
      SettingsError: a size that is not positive, or a position that is not finite.
    """

    x: float  # [m] centre, world frame
    y: float  # [m]
    radius: float  # [m]
    height: float = WALL_HEIGHT  # [m]

    def __post_init__(self) -> None:
        require(self, _is_near, _NEAR, ("x", "y"), SettingsError)
        require(self, _is_length, _LENGTH, ("radius", "height"), SettingsError)

    def corners(self) -> FloatArray:
        """Footprint, counterclockwise. Shape (24, 2) [m]."""
        angles = np.arange(_CYLINDER_SIDES) * (2.0 * math.pi / _CYLINDER_SIDES)
        around = np.column_stack((portable.cos(angles), portable.sin(angles)))
        return np.array((self.x, self.y)) + self.radius * around


@explain_class
@dataclass(frozen=True, kw_only=True, repr=False)
class Prism:
    """An upright solid of any convex footprint standing on the ground.

    Raises:
      SettingsError: fewer than three corners, one that is not finite, corners that are not counterclockwise round a
        convex footprint; a height that is not positive.
    """

    footprint: tuple[tuple[float, float], ...]  # [m] corners, counterclockwise, world frame
    height: float = WALL_HEIGHT  # [m]

    def __post_init__(self) -> None:
        require(self, _is_length, _LENGTH, ("height",), SettingsError)
        if not _is_convex(self.footprint):
            raise SettingsError(
                f"Prism.footprint is {self.footprint!r}; accepted: three or more (x, y) [m], counterclockwise, convex"
            )
        object.__setattr__(self, "footprint", tuple(map(tuple, self.footprint)))  # a list could be written to

    def __repr__(self) -> str:
        x, y = self.corners().mean(axis=0)
        return brief(self, f"{len(self.footprint)} corners round ({x:.2f}, {y:.2f}) m", f"height {self.height:g} m")

    def corners(self) -> FloatArray:
        """Footprint, counterclockwise. Shape (n, 2) [m]."""
        return np.array(self.footprint)


class Pipe(Prism):
    """A piece of a pipe that lies on the ground; `height` is its diameter.

    Its footprint has four corners: the first side is where it is nearest to the road, at half its height.
    """

    SIDES = 12  # of its section, whose corners are on the circle

    @classmethod
    def section(cls) -> tuple[FloatArray, FloatArray]:
        """Return the corners of the section, from the nearest one upwards: shares of the width and of the height."""
        angles = np.arange(cls.SIDES) * (2.0 * math.pi / cls.SIDES)
        return 0.5 - 0.5 * portable.cos(angles), 0.5 + 0.5 * portable.sin(angles)

    def vertices(self) -> FloatArray:
        """Return the corners of its sections at both ends, (2 SIDES, 3) [m]."""
        (near_start, near_end, far_end, far_start), (across, above) = self.corners(), self.section()
        rings = [near + across[:, None] * (far - near) for near, far in ((near_start, far_start), (near_end, far_end))]
        return np.column_stack((np.concatenate(rings), np.tile(self.height * above, 2)))


Obstacle = Box | Cylinder | Prism
"""An obstacle that stands on a course."""

KINDS: dict[str, Any] = {"box": Box, "cylinder": Cylinder, "prism": Prism}
"""Name of a kind of obstacle in a file -> its class."""


def described_obstacles(obstacles: Sequence[Obstacle]) -> list[dict[str, Any]]:
    """Return obstacles as they can stand in JSON and TOML; `as_obstacles` reads them back."""
    return [{"kind": type(each).__name__.lower(), **asdict(each)} for each in obstacles]


def obstacles_or_count(value: Any) -> tuple[Obstacle, ...] | int:
    """Return obstacles, or how many boxes there are to be; raise SettingsError for neither."""
    if isinstance(value, int) and not isinstance(value, bool):
        require_whole("obstacles", value, 0)
        return value
    if isinstance(value, (str, Mapping)) or not isinstance(value, Iterable):
        said = f"obstacles is {shown(value)}"
        raise SettingsError(f"{said}; accepted: a whole number from 0, or a sequence of Box, Cylinder and Prism")
    return as_obstacles(value)


def as_obstacles(values: Iterable[Obstacle | Mapping[str, Any]]) -> tuple[Obstacle, ...]:
    """Return obstacles; a mapping has the `kind` of one and its fields; raise SettingsError."""
    found: list[Obstacle] = []
    for place, value in enumerate(values):
        solid: Any = value
        if isinstance(value, Mapping):
            own = dict(value)
            kind = own.pop("kind", "box")
            if kind not in KINDS:
                raise SettingsError(f"obstacles[{place}].kind is {shown(kind)}; {accepted_names(kind, KINDS)}")
            try:
                solid = KINDS[kind](**own)
            except (ArgumentError, SettingsError) as error:
                raise SettingsError(f"obstacles[{place}]: {error}") from error
        if not isinstance(solid, tuple(KINDS.values())):
            raise SettingsError(f"obstacles[{place}] is {shown(value)}; accepted: Box, Cylinder, Prism")
        found.append(solid)  # type: ignore[arg-type]
    return tuple(found)


def require_obstacles(obstacles: Any) -> None:
    """Raise SettingsError unless this is a sequence of obstacles."""
    accepted = "accepted: a sequence of Box, Cylinder or Prism, such as [Box(x=3.0, y=0.0, length=0.3, width=0.3)]"
    if isinstance(obstacles, str) or not isinstance(obstacles, Iterable):
        raise SettingsError(f"obstacles is {shown(obstacles)}; {accepted}; a race takes their number, too")
    for index, each in enumerate(obstacles):
        if isinstance(each, type) or not callable(getattr(each, "corners", None)):
            raise SettingsError(f"obstacles[{index}] is {shown(each)}; {accepted}")


_KINDS: tuple[Any, ...] = tuple(KINDS.values())


def solids_numbers(solids: tuple[Obstacle, ...]) -> FloatArray:
    """Return all that makes solids what they are in one row, which `solids_of` reads back. Shape (n,).

    Of each solid the row has: its place in (Box, Cylinder, Prism), how many numbers follow, and these: of a Box and a
    Cylinder its fields, of a Prism its height and x, y of its corners.
    """
    row: list[float] = []
    for solid in solids:
        if isinstance(solid, Prism):
            numbers = [solid.height, *(value for corner in solid.footprint for value in corner)]
        else:
            numbers = list(astuple(solid))
        row += [_KINDS.index(type(solid)), len(numbers), *numbers]
    return np.array(row, dtype=np.float64)


def solids_of(numbers: FloatArray) -> tuple[Obstacle, ...]:
    """Return the solids of a row of `solids_numbers`; raise IndexError, ValueError or SettingsError for another row."""
    row = [float(number) for number in numbers]
    solids: list[Obstacle] = []
    place = 0
    while place < len(row):
        kind, count = _KINDS[int(row[place])], int(row[place + 1])
        values = row[place + 2 : place + 2 + count]
        place += 2 + count
        if kind is Prism:
            corners = tuple(zip(values[1::2], values[2::2], strict=True))
            solids.append(Prism(footprint=corners, height=values[0]))
        else:
            solids.append(kind(**dict(zip((each.name for each in fields(kind)), values, strict=True))))
    return tuple(solids)


def _is_near(value: float) -> bool:
    return abs(value) <= _FURTHEST


def _is_length(value: float) -> bool:
    return 0.0 < value <= _LARGEST


def _is_convex(corners: Any) -> bool:
    """Return whether corners (n, 2) are a convex polygon, counterclockwise. In Python: a track has hundreds."""
    try:
        points = [(float(x), float(y)) for x, y in corners]
    except (TypeError, ValueError):
        return False
    if len(points) < 3 or not all(_is_near(x) and _is_near(y) for x, y in points):
        return False
    around = zip(points[-2:] + points[:-2], points[-1:] + points[:-1], points, strict=True)
    turned = 0.0  # once round is 2 pi
    for (x0, y0), (x1, y1), (x2, y2) in around:
        into_x, into_y, out_x, out_y = x1 - x0, y1 - y0, x2 - x1, y2 - y1
        turn = math.atan2(into_x * out_y - into_y * out_x, into_x * out_x + into_y * out_y)
        if turn < 0.0:
            return False
        turned += turn
    return turned <= 3.0 * math.pi
