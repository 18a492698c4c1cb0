"""Boxes that move. Each is a mocap body: the LiDAR sees it, the car can hit it, and nothing stops it.

    leader = MovingObstacle(length=0.5, width=0.3, start=(4.0, 0.0), end=(30.0, 0.0), speed=1.5)
    leader.corners(time=2.0)

The position of an obstacle is a closed form of the time. Its motion is kept in the model as custom numerics, so that
the MJCF alone says it: a race, a batch and a replay move it to the same bits. It is moved before every physics step
and once more at the end of a tick, to its position at the simulation's time, so that contacts and scans meet it
without delay. A contact takes it for standing still, as MuJoCo does with mocap bodies; a contact ends the race.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any

import mujoco
import numpy as np

from ..arguments import explain_class
from ..display import brief
from ..errors import ArgumentError, SettingsError, accepted_names
from ..messages import FloatArray, require, shown
from .obstacles import Box
from .track_mesh import WALL_HEIGHT

PREFIX = "moving_"
"""Of the names of the bodies, geoms, meshes and custom numerics of moving obstacles."""

KINDS_THAT_MOVE = ("box", "crossing", "pedestrian")
"""What can be drawn at random places of a track: the add-on arena does."""

_MOST = 32  # of a course
_WORD = re.compile(r"\s*([^:,]*?)\s*(?::\s*([^,]*?)\s*)?")


def _is_place(value: Any) -> bool:
    try:
        return len(value) == 2 and all(map(math.isfinite, value))
    except TypeError:
        return False


@explain_class
@dataclass(frozen=True, kw_only=True, repr=False)
class MovingObstacle:
    """An upright box that keeps its heading and moves from one point to another at a constant speed.

    It then stays there, or goes back and forth.

    Raises:
      SettingsError: a size or speed that is not positive, a number that is not finite, or two ends that are one.
    """

    length: float  # [m] along its heading
    width: float  # [m]
    start: tuple[float, float]  # [m] its centre, world frame
    end: tuple[float, float]  # [m]
    speed: float  # [m/s]
    back_and_forth: bool = False
    headway: float = 0.0  # [m] of its way behind it at time 0, there and back twice its length; below 0 it waits first
    heading: float = 0.0  # [rad]
    height: float = WALL_HEIGHT  # [m]

    def __post_init__(self) -> None:
        sizes = ("length", "width", "height", "speed")
        require(self, lambda value: 0.0 < value < math.inf, "a positive number", sizes, SettingsError)
        require(self, math.isfinite, "a finite number", ("headway", "heading"), SettingsError)
        for name, is_right, accepted in (
            ("start", _is_place, "x and y [m]"), ("end", _is_place, "x and y [m]"),
            ("back_and_forth", lambda value: isinstance(value, bool), "True, False"),
        ):  # fmt: skip
            if not is_right(getattr(self, name)):
                raise SettingsError(f"MovingObstacle.{name} is {getattr(self, name)!r}; accepted: {accepted}")
        if self.way == 0.0:
            raise SettingsError(f"MovingObstacle starts and ends at {self.start!r}; accepted: two different points")

    def __repr__(self) -> str:
        (x, y), (end_x, end_y) = self.start, self.end
        way = f"from ({x:.2f}, {y:.2f}) m to ({end_x:.2f}, {end_y:.2f}) m at {self.speed:.2f} m/s"
        return brief(self, f"{self.length:.2f} x {self.width:.2f} m", way, *["back and forth"] * self.back_and_forth)

    @property
    def way(self) -> float:
        """Distance from start to end [m]."""
        return math.dist(self.start, self.end)

    def position(self, time: float) -> tuple[float, float]:
        """Return x and y of its centre [m] at a time [s]."""
        gone = max(self.headway + self.speed * time, 0.0)
        gone = self.way - abs(gone % (2.0 * self.way) - self.way) if self.back_and_forth else min(gone, self.way)
        share = gone / self.way
        (x, y), (end_x, end_y) = self.start, self.end
        return x + share * (end_x - x), y + share * (end_y - y)

    def box(self, time: float) -> Box:
        """Return the Box that it is at a time [s]."""
        x, y = self.position(time)
        return Box(x=x, y=y, length=self.length, width=self.width, height=self.height, heading=self.heading)

    def corners(self, time: float) -> FloatArray:
        """Footprint at a time [s], counterclockwise. Shape (4, 2) [m]."""
        return self.box(time).corners()

    def numbers(self) -> tuple[float, ...]:
        """Return all that it is in one row, as its model keeps it."""
        values = (getattr(self, field.name) for field in fields(self))
        return tuple(float(v) for value in values for v in (value if isinstance(value, tuple) else (value,)))

    @classmethod
    def of(cls, numbers: Any) -> MovingObstacle:
        """Return the moving obstacle of `numbers`."""
        length, width, x, y, end_x, end_y, speed, back_and_forth, headway, heading, height = map(float, numbers)
        return cls(
            length=length, width=width, start=(x, y), end=(end_x, end_y), speed=speed,
            back_and_forth=bool(back_and_forth), headway=headway, heading=heading, height=height,
        )  # fmt: skip


def motion_table(obstacles: Sequence[MovingObstacle]) -> FloatArray:
    """Return the rows of moving obstacles for the native core. Shape (k, 8), read-only."""
    table = np.array(
        [(*o.start, *o.end, o.speed, float(o.back_and_forth), o.headway, o.way) for o in obstacles], np.float64
    ).reshape(-1, 8)
    table.flags.writeable = False
    return table


def moving_obstacles(model: Any) -> tuple[MovingObstacle, ...]:
    """Return those of a compiled model, by mocap id: what moves, with the digits that MJCF text keeps."""
    names = [
        mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, body) for body in np.flatnonzero(model.body_mocapid >= 0)
    ]
    return tuple(MovingObstacle.of(model.numeric(name).data) for name in names)


def place_moving(obstacles: Sequence[MovingObstacle], data: Any) -> None:
    """Put moving obstacles, by mocap id, where they are at `data.time`; body poses want mj_kinematics after."""
    for row, obstacle in zip(data.mocap_pos, obstacles, strict=True):
        row[0], row[1] = obstacle.position(data.time)


def moving_or_text(value: Any) -> str | tuple[MovingObstacle, ...]:
    """Return things that move as a setting keeps them: MovingObstacles, or kinds with numbers, "pedestrian:2,box".

    Raises:
      SettingsError: an unknown kind, a number that is not whole, more than 32, or something else.
    """
    if value is None or isinstance(value, str):
        counts = kinds_that_move(value or "")
        return ",".join(kind if count == 1 else f"{kind}:{count}" for kind, count in counts)
    kinds = f"a text of {', '.join(KINDS_THAT_MOVE)}, such as 'pedestrian:2,crossing'"
    accepted = f"accepted: {kinds}, or a sequence of MovingObstacle"
    if isinstance(value, Mapping) or not isinstance(value, Iterable):
        raise SettingsError(f"moving is {shown(value)}; {accepted}")
    found = []
    for place, each in enumerate(value):
        moving: Any = each
        if isinstance(each, Mapping):
            try:
                points = {name: tuple(each[name]) for name in ("start", "end") if name in each}
                moving = MovingObstacle(**{**each, **points})
            except (ArgumentError, SettingsError, TypeError) as error:
                raise SettingsError(f"moving[{place}]: {error}") from error
        if not isinstance(moving, MovingObstacle):
            raise SettingsError(f"moving[{place}] is {shown(each)}; {accepted}")
        found.append(moving)
    return tuple(found) or ""


def described_moving(moving: str | Sequence[MovingObstacle]) -> Any:
    """Return things that move as they can stand in JSON and TOML; `moving_or_text` reads them back."""
    if isinstance(moving, str):
        return moving
    return [asdict(each) | {"start": list(each.start), "end": list(each.end)} for each in moving]


def kinds_that_move(text: str) -> list[tuple[str, int]]:
    """Return kinds and their numbers of a text, each kind once."""
    counts: dict[str, int] = {}
    for word in text.split(",") if text.strip() else ():
        found = _WORD.fullmatch(word)
        kind, number = found.groups() if found else (word.strip(), None)
        if kind not in KINDS_THAT_MOVE:
            raise SettingsError(f"moving is {text!r} with {kind!r}; {accepted_names(kind, KINDS_THAT_MOVE)}")
        if number is not None and not (number.isascii() and number.isdecimal() and 0 < int(number[:9]) <= _MOST):
            said = f"moving is {text!r} with {word.strip()!r}"
            raise SettingsError(f"{said}; accepted: {kind}, or {kind}:N with N from 1 to {_MOST}")
        counts[kind] = counts.get(kind, 0) + int(number or 1)
    if sum(counts.values()) > _MOST:
        raise SettingsError(f"moving is {text!r}, {sum(counts.values())} things; accepted: at most {_MOST}")
    return list(counts.items())
