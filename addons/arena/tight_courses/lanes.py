"""Circuits round a patch of cells whose lanes lie back to back: between two lanes stands only a thin barrier.

    around = outline(patch("#.#.#", "#####"), columns=[1.5] * 5, rows=[1.4, 3.0])
    track = lane(around, radii=..., right=..., left=..., squareness=...).track("comb")

The circuit is the outline of the patch. Where a cell lies between two of its stretches, the cell is divided between
them: each lane reaches to half of the cell, less half of the barrier. So a finger of the patch that is one cell thick
becomes a thin barrier with a hairpin round its end, and so does a gap one cell thick between two fingers.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.course.polyline import step_lengths, steps, subdivide, turns
from fg_mujoco.course.track import Track
from fg_mujoco.messages import FloatArray

from ..random_courses.generator import SIDES, Cell, place_at_origin, walk_round

SPACING = 0.1  # [m] between the points of the centreline
_DIGITS = 5  # decimals of coordinates and widths [0.01 mm]: along boxes points are 2 cm apart
_STRAIGHT = 3.0  # [m] radius over which a lane counts as straight
_LEFT_OF = {(1, 0): (0, 0), (0, 1): (-1, 0), (-1, 0): (-1, -1), (0, -1): (0, -1)}  # cell to the left of a side
_RIGHT_OF = {(1, 0): (0, -1), (0, 1): (0, 0), (-1, 0): (-1, 0), (0, -1): (-1, -1)}


def patch(*rows: str) -> frozenset[Cell]:
    """Return the cells (column, row) of a drawing: `#` for a cell of the patch; the last row is the lowest."""
    return frozenset((i, j) for j, row in enumerate(reversed(rows)) for i, mark in enumerate(row) if mark == "#")


@dataclass(frozen=True, kw_only=True)
class Outline:
    """The outline of a patch, counterclockwise: its corners, and the room along each side.

    Attributes:
      corners: shape (n, 2) [m].
      room_left: half of the cell to the left of the side that begins at each corner, where that is thinnest. (n,) [m]
      room_right: the same to the right, inf where there is no cell. (n,) [m]
    """

    corners: FloatArray
    room_left: FloatArray
    room_right: FloatArray


def outline(
    cells: frozenset[Cell], columns: Sequence[float] | FloatArray, rows: Sequence[float] | FloatArray
) -> Outline:
    """Return the outline of a patch on a grid of columns and rows of these widths [m].

    Raises:
      ValueError: a patch with a hole or with cells that touch only by a corner.
    """
    path = walk_round(cells)
    if len(path) != sum((i + di, j + dj) not in cells for i, j in cells for di, dj in SIDES):
        raise ValueError("the patch has a hole, or cells that touch only by a corner")
    x, y = (np.concatenate(([0.0], np.cumsum(sizes))) for sizes in (columns, rows))

    def half(cell: Cell, horizontal: bool) -> float:
        sizes, place = (rows, cell[1]) if horizontal else (columns, cell[0])
        return 0.5 * sizes[place] if 0 <= place < len(sizes) else math.inf

    corners: list[tuple[float, float]] = []
    rooms: list[list[float]] = []
    before = None
    first = next(k for k in range(len(path)) if _direction(path, k) != _direction(path, k - 1))
    for k in range(first, first + len(path)):
        i, j = path[k % len(path)]
        ahead = _direction(path, k)
        sides = [half((i + di, j + dj), ahead[0] != 0) for di, dj in (_LEFT_OF[ahead], _RIGHT_OF[ahead])]
        if ahead == before:
            rooms[-1] = [min(pair) for pair in zip(rooms[-1], sides, strict=True)]
        else:
            corners.append((float(x[i]), float(y[j])))
            rooms.append(sides)
        before = ahead
    left, right = np.array(rooms).T
    return Outline(corners=np.array(corners), room_left=left, room_right=right)


def _direction(path: list[Cell], k: int) -> Cell:
    (i, j), (next_i, next_j) = path[k % len(path)], path[(k + 1) % len(path)]
    return next_i - i, next_j - j


@dataclass(frozen=True, kw_only=True)
class Lane:
    """A closed line and its widths to either side. Shapes (n, 2), (n,) and (n,) [m]."""

    line: FloatArray
    right: FloatArray
    left: FloatArray

    def reverse(self) -> Lane:
        """Return the lane driven the other way."""
        return Lane(line=self.line[::-1], right=self.left[::-1], left=self.right[::-1])

    def bend(self, gradient: FloatArray, wave: FloatArray, phase: FloatArray) -> Lane:
        """Return the lane in a plane bent by a wave in x and one in y: x + a sin(k y + p), y + b sin(l x + q).

        Args:
          gradient: greatest slopes a k and b l, shape (2,).
          wave: wave numbers k and l [1/m], shape (2,).
          phase: p and q [rad], shape (2,).
        """
        angle = wave * self.line[:, ::-1] + phase
        line = self.line + gradient / wave * np.sin(angle)
        slope = gradient * np.cos(angle)  # the derivatives of x by y and of y by x
        ahead = np.roll(self.line, -1, axis=0) - np.roll(self.line, 1, axis=0)
        ahead /= np.hypot(*ahead.T)[:, None]
        stretched = np.hypot(*(ahead + slope * ahead[:, ::-1]).T)
        across = (1.0 - slope[:, 0] * slope[:, 1]) / stretched  # areas grow as the determinant does
        return Lane(line=line, right=self.right * across, left=self.left * across)

    @property
    def arc_length(self) -> FloatArray:
        """Progress at each point, 0 at the first. Shape (n,) [m]."""
        lengths = step_lengths(self.line)
        return np.asarray(np.cumsum(lengths) - lengths)

    def straights(self) -> list[tuple[float, float]]:
        """Return the beginnings and ends of the straights [m]; the one that the start is on is left out."""
        lengths = step_lengths(self.line)
        bends = self.arc_length[np.abs(turns(self.line)) > 0.5 * (lengths + np.roll(lengths, 1)) / _STRAIGHT].tolist()
        return [(first, last) for first, last in itertools.pairwise(bends) if last - first > 3.0 * SPACING]

    def track(self, name: str) -> Track:
        """Return the track, from its first point, which is at the origin, along x.

        Raises:
          TrackError: stretches that run over each other.
        """
        numbers = place_at_origin(self.line), self.right, self.left
        line, right, left = (np.round(values, _DIGITS) for values in numbers)
        return Track(name=name, centreline=line, width_right=right, width_left=left)


def lane(around: Outline, *, radii: FloatArray, right: FloatArray, left: FloatArray, squareness: FloatArray) -> Lane:
    """Return the lane along an outline, from the middle of its longest straight.

    Args:
      around: the outline.
      radii: of the centreline at each corner. Shape (n,) [m].
      right: from the centreline to the right wall, of the side that begins at each corner. Shape (n,) [m].
      left: to the left wall.
      squareness: of the outer wall at each corner, from 0, the largest arc, to 1, a square corner. Shape (n,).
    """
    corners = around.corners
    after = steps(corners) / step_lengths(corners)[:, None]
    turned = np.sign(turns(corners))
    start = int(np.argmax(step_lengths(corners) - radii - np.roll(radii, -1)))
    pieces = []
    for k in range(start + 1, start + 1 + len(corners)):  # the start is at the very end, or the very beginning
        c, b = k % len(corners), (k - 1) % len(corners)
        outer = right if turned[c] > 0.0 else left
        vertex = math.atan2(radii[c] + outer[c], radii[c] + outer[b])  # where a square corner of the outer wall is
        count = 1 + max(2, math.ceil(0.5 * math.pi * radii[c] / SPACING))
        angle = np.union1d(np.linspace(0.0, 0.5 * math.pi, count), vertex)
        arc = np.outer(np.sin(angle), after[b]) - np.outer(np.cos(angle), after[c])
        arc = corners[c] + radii[c] * (after[c] - after[b] + arc)
        wide_outer = _outer_wall(angle, radii[c] + outer[b], radii[c] + outer[c], squareness[c]) - radii[c]
        inner = left if turned[c] > 0.0 else right
        wide_inner = inner[b] + angle / (0.5 * math.pi) * (inner[c] - inner[b])
        wide_right, wide_left = (wide_outer, wide_inner) if turned[c] > 0.0 else (wide_inner, wide_outer)
        pieces.append(np.column_stack((arc, wide_right, wide_left)))
    middle = 0.5 * (pieces[-1][-1, :2] + pieces[0][0, :2])
    rows = np.vstack((np.append(middle, (right[start], left[start])), *pieces))
    rows = rows[step_lengths(rows[:, :2]) > 1e-9]
    line, wide_right, wide_left = subdivide(rows[:, :2], SPACING, rows[:, 2], rows[:, 3])
    return Lane(line=line, right=wide_right, left=wide_left)


def _outer_wall(angle: FloatArray, before: float, after: float, squareness: float) -> FloatArray:
    """Return the distance from the middle of a corner's arc to the outer wall: two straights and an arc between them.

    Args:
      angle: of the rays, from square to the wall before the corner to square to that behind it. Shape (n,) [rad].
      before: from the middle to the wall before the corner [m].
      after: to that behind it [m].
      squareness: 0: the arc is as large as there is room for; 1: there is none.
    """
    cos, sin = np.cos(angle), np.sin(angle)
    straight = before * after / np.maximum(after * cos, before * sin)  # the nearer of before / cos and after / sin
    radius = (1.0 - squareness) * min(before, after)
    x, y = before - radius, after - radius  # the middle of the arc of the wall
    ahead = x * cos + y * sin
    arc = ahead + np.sqrt(np.maximum(ahead * ahead - x * x - y * y + radius * radius, 0.0))
    return np.where((straight * cos > x) & (straight * sin > y), arc, straight)


def hairpins(around: Outline) -> NDArray[np.bool_]:
    """Return for each side whether the outline turns the same way at both of its ends. Shape (n,)."""
    turned = np.sign(turns(around.corners))
    return np.asarray(turned == np.roll(turned, -1))


def corner_radii(around: Outline, wanted: FloatArray, hairpin: float) -> FloatArray:
    """Return the radius at each corner: as wanted where there is room, half circles round hairpins. Shape (n,) [m].

    Args:
      around: the outline.
      wanted: radii, shape (n,) [m].
      hairpin: greatest distance from lane to lane of what is a hairpin [m].
    """
    lengths = step_lengths(around.corners)
    room = 0.5 * np.minimum(lengths, np.roll(lengths, 1))
    tip = hairpins(around) & (lengths <= hairpin)
    return np.minimum(np.where(tip | np.roll(tip, 1), room, wanted), room)
