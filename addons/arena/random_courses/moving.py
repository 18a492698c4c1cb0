"""Things that move at random places of a track: boxes, boxes that cross, and pedestrians.

    track = with_moving(load_track("oval"), "pedestrian:2,crossing", 7, car=car)
    track.moving[0].position(time=3.0)

A `box` goes to and fro along the lap or aside, and leaves a way of GAP_IN_WIDTHS car widths past it. A `crossing` is a
box that goes back and forth from wall to wall. A `pedestrian` is two legs that cross from wall to wall at 1 to 2 m/s,
back and forth or once. Who crosses once starts when a car of 2 to 6 m/s would pass in its first lap. Nothing comes
nearer than MARGIN to a wall. Where they move the track is wide enough and nearly straight, as for `random_boxes`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from fg_mujoco.course.course import CLEAR_BEHIND, Course, outline, wall_outlines
from fg_mujoco.course.moving_obstacles import KINDS_THAT_MOVE, MovingObstacle, kinds_that_move
from fg_mujoco.course.obstacles import Obstacle
from fg_mujoco.course.random_obstacles import SPACING, ObstacleSites
from fg_mujoco.course.track import Track
from fg_mujoco.errors import SettingsError
from fg_mujoco.messages import CarParameters, shown
from fg_mujoco.native import core

MARGIN = 0.05  # [m] least, from anything that moves to a wall

_TRIES = 500  # for each
_BOX = (0.2, 0.5)  # [m] length and width of a box are between
_BOX_SPEED = (0.5, 1.2)  # [m/s] as of the scene crossing_box
_ALONG = (1.0, 2.0)  # [m] that a box goes along the lap
_LEAST_WAY = 0.2  # [m] that a box goes aside
_CROSSING = (0.3, 0.4)  # [m] length and width, as of the scene crossing_box
_LEG, _STRIDE = 0.12, (0.12, 0.2)  # [m] side of a leg; from one to the other, along the course and across
_WALKING = (1.0, 2.0)  # [m/s]
_COMES = (2.0, 6.0)  # [m/s] mean speed of the car that meets a pedestrian who crosses once
_ON_GRID = 0.8  # [m] that each further car stands behind the start


def with_moving(
    course: Course,
    moving: str | Sequence[MovingObstacle],
    seed: int = 0,
    *,
    car: CarParameters,
    start: float = 0.0,
    cars: int = 1,
    obstacles: Sequence[Obstacle] = (),
) -> Course:
    """Return a track on which things move, besides those that move there already: the same for the same arguments.

    Args:
      course: a track; with nothing that is to move, any course, which is returned.
      moving: what moves, as `moving_or_text` returns it.
      seed: of places, sizes and speeds, where `moving` is a text.
      car: that is to get past each.
      start: progress of the first car's start [m].
      cars: how many start there, one behind the other.
      obstacles: that stand on the track at given places; nothing moves near them.

    Raises:
      SettingsError: a course that is no track, or more than it has room for.
    """
    if not moving:
        return course
    what = moving if isinstance(moving, str) else tuple(moving)
    return _with_moving(course, what, seed, car, start, cars, tuple(obstacles))


@lru_cache(maxsize=32)  # so that the walls of a course are worked out once, and its world is written once
def _with_moving(
    course: Course, moving: Any, seed: int, car: CarParameters, start: float, cars: int, obstacles: tuple[Obstacle, ...]
) -> Course:
    if not isinstance(course, Track):
        raise SettingsError(f"moving is {shown(moving)} on {course.name!r}; accepted: on a track")
    if isinstance(moving, str):
        moving = _Places(course, car, start, CLEAR_BEHIND + (cars - 1) * _ON_GRID, obstacles).draw(moving, seed)
    return replace(course, moving=(*course.moving, *moving))


class _Places:
    """The places of a track where things may move."""

    def __init__(
        self, track: Track, car: CarParameters, start: float, behind: float, obstacles: tuple[Obstacle, ...]
    ) -> None:
        self._track, self._start, self._behind = track, start, behind
        self._sites = ObstacleSites(track, car)
        self._walls = np.concatenate([outline(line) for line in wall_outlines(track)])
        middles = np.array([obstacle.corners().mean(axis=0) for obstacle in obstacles]).reshape(-1, 2)
        self._taken = track.project(middles)[0].tolist()

    def draw(self, text: str, seed: int) -> list[MovingObstacle]:
        """Return what moves, in the order of the text."""
        found: list[MovingObstacle] = []
        for kind, count in kinds_that_move(text):
            for number in range(count):
                # each has its own stream, so that one more leaves what others are like
                found += self._one(kind, np.random.default_rng((seed, 1, KINDS_THAT_MOVE.index(kind), number)), text)
        return found

    def _one(self, kind: str, rng: np.random.Generator, text: str) -> list[MovingObstacle]:
        track = self._track
        for _ in range(_TRIES):
            s = self._sites.station(self._start, rng, behind=self._behind)
            if s is None:
                break
            if any(abs(math.remainder(s - other, track.length)) < 2.0 * SPACING for other in self._taken):
                continue
            right, left = self._sites.widths(s)
            site = _Site(track, s, right - MARGIN, left - MARGIN, self._sites.gap, self._start)
            drawn: list[MovingObstacle] = _DRAWN[kind](site, rng)
            if drawn and all(self._clear(each) for each in drawn):
                self._taken.append(s)
                return drawn
        raise SettingsError(f"moving is {text!r} on track {track.name!r}, which has no room for it; accepted: fewer")

    def _clear(self, moving: MovingObstacle) -> bool:
        """Return whether all ground that it moves over is at least MARGIN from the walls, less a rounding."""
        (x, y), (end_x, end_y) = moving.start, moving.end
        cos, sin = math.cos(moving.heading), math.sin(moving.heading)
        along, across = abs((end_x - x) * cos + (end_y - y) * sin), abs((end_y - y) * cos - (end_x - x) * sin)
        middle = np.array([[0.5 * (x + end_x), 0.5 * (y + end_y), moving.heading]])
        half_length, half_width = 0.5 * (moving.length + along), 0.5 * (moving.width + across)
        return core.least_clearance(middle, self._walls[np.newaxis], 0.0, half_length, half_width) > 0.8 * MARGIN


class _Site:
    """A place of a track, with the free room to its right and left [m], and the way that is to be left past a box."""

    def __init__(self, track: Track, s: float, right: float, left: float, gap: float, start: float) -> None:
        self.right, self.left, self.gap = right, left, gap
        self.ahead = (s - start) % track.length  # [m] of the start
        self._x, self._y, self.heading = track.start_pose(s)

    def at(self, along: float, offset: float) -> tuple[float, float]:
        """Return the point so far along the course, and to the left [m]."""
        cos, sin = math.cos(self.heading), math.sin(self.heading)
        return self._x + along * cos - offset * sin, self._y + along * sin + offset * cos


def _box(site: _Site, rng: np.random.Generator) -> list[MovingObstacle]:
    """Return a box that goes to and fro, beside a way of `site.gap`."""
    length, width = rng.uniform(*_BOX, 2).tolist()
    speed = float(rng.uniform(*_BOX_SPEED))
    phase, aside, on_the_left = rng.random(3).tolist()
    room = site.right + site.left + MARGIN - site.gap  # its strip, at one wall
    along = float(rng.uniform(*_ALONG))
    if room < width:
        return []
    if aside < 0.5 and room >= width + _LEAST_WAY:
        way, offsets = room - width, (0.5 * width, room - 0.5 * width)
        ends = (0.0, 0.0)
    else:
        way, near = along, 0.5 * width + float(rng.random()) * (room - width)
        ends, offsets = (-0.5 * way, 0.5 * way), (near, near)
    sides = [site.left - each if on_the_left < 0.5 else each - site.right for each in offsets]
    start, end = (site.at(*each) for each in zip(ends, sides, strict=True))
    return [
        MovingObstacle(
            length=length, width=width, start=start, end=end, speed=speed, back_and_forth=True,
            headway=2.0 * way * phase, heading=site.heading,
        )
    ]  # fmt: skip


def _crossing(site: _Site, rng: np.random.Generator) -> list[MovingObstacle]:
    """Return a box that goes back and forth from wall to wall."""
    length, width = _CROSSING
    way = site.right + site.left - width
    if way < site.gap:
        return []
    return [
        MovingObstacle(
            length=length, width=width, start=site.at(0.0, 0.5 * width - site.right),
            end=site.at(0.0, site.left - 0.5 * width), speed=float(rng.uniform(*_BOX_SPEED)), back_and_forth=True,
            headway=2.0 * way * float(rng.random()), heading=site.heading,
        )
    ]  # fmt: skip


def _pedestrian(site: _Site, rng: np.random.Generator) -> list[MovingObstacle]:
    """Return the two legs of one who crosses from wall to wall."""
    speed, comes = float(rng.uniform(*_WALKING)), float(rng.uniform(*_COMES))
    back_and_forth, from_left, phase = rng.random(3).tolist()
    across = _STRIDE[1]
    way = site.right + site.left - across - _LEG
    if way < site.gap:
        return []
    offsets = [0.5 * _LEG - site.right, site.left - across - 0.5 * _LEG]  # of the right leg
    first, last = reversed(offsets) if from_left < 0.5 else offsets
    twice = back_and_forth < 0.5
    return pedestrian(
        site.at(0.0, first), site.at(0.0, last), speed, heading=site.heading, back_and_forth=twice,
        headway=2.0 * way * phase if twice else -speed * site.ahead / comes,
    )  # fmt: skip


def pedestrian(
    start: tuple[float, float], end: tuple[float, float], speed: float, *, heading: float = 0.0, **motion: Any
) -> list[MovingObstacle]:
    """Return the two legs of a pedestrian, of whom the first leg goes from `start` to `end` [m] at `speed` [m/s].

    Args:
      start: of the first leg's middle.
      end: likewise.
      speed: of walking.
      heading: of the course that is crossed [rad]; the second leg is ahead, and to the left.
      motion: `back_and_forth` and `headway` of both legs, as MovingObstacle has them.
    """
    cos, sin = math.cos(heading), math.sin(heading)
    legs = []
    for along, across in ((0.0, 0.0), _STRIDE):
        x, y = along * cos - across * sin, along * sin + across * cos
        first, last = ((point[0] + x, point[1] + y) for point in (start, end))
        leg = MovingObstacle(length=_LEG, width=_LEG, start=first, end=last, speed=speed, heading=heading, **motion)
        legs.append(leg)
    return legs


_DRAWN: dict[str, Any] = {"box": _box, "crossing": _crossing, "pedestrian": _pedestrian}
"""Name of a kind of thing that moves -> the function that draws one at a site, or nothing where it does not fit."""
