"""Boxes at random places of a track that leave the car a way past each of them.

A box stands along the track where the track is wide enough and nearly straight. It leaves a gap of GAP_IN_WIDTHS car
widths between itself and one of the walls. The next box is at least SPACING further on, and none is near the start.
"""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np

from ..errors import SettingsError
from ..messages import CarParameters, FloatArray, require_whole
from .course import CLEAR_AHEAD, CLEAR_BEHIND, Course
from .obstacles import Box
from .polyline import turns

GAP_IN_WIDTHS = 2.5
"""Least width of the way past a box, in widths of the car."""

SPACING = 3.0  # [m] least, along the centreline, from the middle of one box to that of the next

_STRAIGHT, _BEND = 1.0, 0.7  # [m] to either side of a box, and [rad] that the track turns there at most
_SIDES = (0.2, 0.5)  # [m] length and width of a box are between
_STEP = 0.1  # [m] of the stations along the line at which the track's width is looked at


class Corridor(Course, Protocol):
    """A course whose room beside its line is known, as that of a track."""

    @property
    def centreline(self) -> FloatArray:
        """Closed, the first point not repeated. Shape (n, 2) [m]."""

    @property
    def arc_length(self) -> FloatArray:
        """Progress at each point. Shape (n,) [m]."""

    @property
    def corridor_right(self) -> FloatArray:
        """Free room to the right of each point. Shape (n,) [m]."""

    @property
    def corridor_left(self) -> FloatArray:
        """Free room to the left of each point. Shape (n,) [m]."""


class ObstacleSites:
    """The places on a track where boxes may stand that a car is to get past: none is where something moves."""

    def __init__(self, track: Corridor, car: CarParameters) -> None:
        self._track = track
        self.gap = GAP_IN_WIDTHS * car.width  # [m] least, of the way past a box
        lap = np.union1d(np.linspace(0.0, track.length, math.ceil(track.length / _STEP) + 1)[:-1], track.arc_length)
        edges = np.append(lap, track.length)  # the width is linear between two of them
        wide = self._widths(edges).sum(axis=0) >= self.gap + _SIDES[0]
        fits = wide & (_turned(track, edges + _STRAIGHT) - _turned(track, edges - _STRAIGHT) <= _BEND)
        for each in track.moving:
            ends = track.project(np.array([each.start, each.end]))[0]
            apart = np.abs((edges - ends[:, np.newaxis] + 0.5 * track.length) % track.length - 0.5 * track.length)
            fits &= apart.min(axis=0) > SPACING
        usable = np.diff(edges) * (fits[:-1] & fits[1:])
        # two laps, so that one lap from any start is a slice
        self._edges = np.concatenate((lap, edges + track.length))
        self._usable = np.concatenate(([0.0], np.cumsum(np.tile(usable, 2))))  # [m] up to each edge
        room = float(usable.sum()) - CLEAR_AHEAD - CLEAR_BEHIND
        self.most = 0 if room < 0.0 else 1 + int(room / SPACING)  # boxes, wherever the start is

    def place(self, count: int, start: float, rng: np.random.Generator) -> tuple[Box, ...]:
        """Return so many boxes for a car that starts at progress `start` [m], as it meets them; raise SettingsError."""
        if count > self.most:
            raise SettingsError(f"{count} obstacles on track {self._track.name!r}; accepted: at most {self.most}")
        if count == 0:
            return ()
        length = self._track.length
        start %= length
        # of the usable length between the clear stretches, which leave at least what `most` counts with
        first, last = np.interp((start + CLEAR_AHEAD, start + length - CLEAR_BEHIND), self._edges, self._usable)
        free = max(float(last - first) - (count - 1) * SPACING, 0.0)
        along = first + np.sort(rng.random(count)) * free + SPACING * np.arange(count)
        stations = np.interp(along, self._usable, self._edges) % length
        lengths, widths = rng.uniform(*_SIDES, (2, count))
        right, left = self._widths(stations)
        widths = np.minimum(widths, right + left - self.gap)
        way = self.gap + rng.random(count) * (right + left - widths - self.gap)  # on one side; the rest on the other
        on_the_left = rng.random(count) < 0.5
        offsets = np.where(on_the_left, left - way - 0.5 * widths, way + 0.5 * widths - right)
        boxes = []
        for s, offset, side, width in zip(*(a.tolist() for a in (stations, offsets, lengths, widths)), strict=True):
            x, y, heading = self._track.start_pose(s, offset)
            boxes.append(Box(x=x, y=y, length=side, width=width, heading=heading))
        return tuple(boxes)

    def station(self, start: float, rng: np.random.Generator, *, behind: float = CLEAR_BEHIND) -> float | None:
        """Return the progress of one random place, clear of the start by `behind` [m]; None: there is none."""
        length = self._track.length
        start %= length
        first, last = np.interp((start + CLEAR_AHEAD, start + length - behind), self._edges, self._usable)
        if not last > first:
            return None
        return float(np.interp(rng.uniform(first, last), self._usable, self._edges)) % length

    def widths(self, s: float) -> tuple[float, float]:
        """Return the free room to the right and to the left of the centreline [m] at a progress [m]."""
        right, left = self._widths(np.array([s]))[:, 0].tolist()
        return right, left

    def _widths(self, s: FloatArray) -> FloatArray:
        """Distances from the centreline to the right and the left wall at progress `s` (n,) [m]. Shape (2, n) [m]."""
        track = self._track
        widths = (track.corridor_right, track.corridor_left)
        return np.array([np.interp(s, track.arc_length, width, period=track.length) for width in widths])


def random_boxes(course: Course, count: int, seed: int, *, car: CarParameters, start: float = 0.0) -> tuple[Box, ...]:
    """Return so many boxes at random places, clear of a start at progress `start` [m]; raise SettingsError."""
    require_whole("obstacles", count, 0)
    require_whole("obstacle_seed", seed, 0)
    return () if count == 0 else course.obstacle_sites(car).place(count, start, np.random.default_rng(seed))


def _turned(track: Corridor, s: FloatArray) -> FloatArray:
    """Return by how much the line has turned, left and right alike, from the start to progress `s` (n,) [m] [rad]."""
    sums = np.concatenate(([0.0], np.cumsum(np.abs(turns(track.centreline)))))
    laps, along = np.divmod(s, track.length)
    return np.asarray(laps * sums[-1] + sums[np.searchsorted(track.arc_length, along, side="right")])
