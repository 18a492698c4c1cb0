"""Circuits round a patch of cells whose lanes lie back to back: between two lanes stands only a thin barrier.

    track = circuit("comb", patch("#.#.#", "#####"), columns=[1.5] * 5, rows=[1.4, 3.0])

The circuit is the outline of the patch. Where a cell lies between two of its stretches, the cell is divided between
them: each lane reaches to half of the cell, less half of the barrier. So a finger of the patch that is one cell thick
becomes a thin barrier with a hairpin round its end, and so does a gap one cell thick between two fingers.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..messages import FloatArray
from .generator import place_at_origin
from .polyline import cross, step_lengths, steps, subdivide, turns
from .track import Track

Cell = tuple[int, int]

SPACING = 0.1  # [m] between the points of the centreline
_DIGITS = 5  # decimals of coordinates and widths [0.01 mm]: points lie as near as 2 cm, and have a heading
_RAMP = 1.4  # [m] before and behind boxes in which the centreline turns to what they leave, at most
_EDGE = 0.01  # [m] between a corner of a box and the points of the centreline before and behind it
_LEFT_OF = {(1, 0): (0, 0), (0, 1): (-1, 0), (-1, 0): (-1, -1), (0, -1): (0, -1)}  # cell to the left of a side
_RIGHT_OF = {(1, 0): (0, -1), (0, 1): (0, 0), (-1, 0): (-1, 0), (0, -1): (-1, -1)}


def patch(*rows: str) -> frozenset[Cell]:
    """Return the cells (column, row) of a drawing: `#` for a cell of the patch; the last row is the lowest."""
    return frozenset((i, j) for j, row in enumerate(reversed(rows)) for i, mark in enumerate(row) if mark == "#")


@dataclass(frozen=True, kw_only=True)
class Outline:
    """The outline of a patch, counterclockwise: its corners, and the room beside each side.

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
    following: dict[Cell, Cell] = {}
    sides = 0
    for i, j in cells:
        loop = ((i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1))
        for k, (di, dj) in enumerate(((0, -1), (1, 0), (0, 1), (-1, 0))):
            if (i + di, j + dj) not in cells:
                following[loop[k]] = loop[(k + 1) % 4]
                sides += 1
    path = [min(following)]
    while following[path[-1]] != path[0]:
        path.append(following[path[-1]])
    if len(path) != sides:
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
        beside = [half((i + di, j + dj), ahead[0] != 0) for di, dj in (_LEFT_OF[ahead], _RIGHT_OF[ahead])]
        if ahead == before:
            rooms[-1] = [min(pair) for pair in zip(rooms[-1], beside, strict=True)]
        else:
            corners.append((float(x[i]), float(y[j])))
            rooms.append(beside)
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

    def track(self, name: str) -> Track:
        """Return the track, from its first point, which is at the origin, along x.

        Raises:
          TrackError: stretches that run over each other.
        """
        numbers = place_at_origin(self.line), self.right, self.left
        line, right, left = (np.round(values, _DIGITS) for values in numbers)
        return Track(name=name, centreline=line, width_right=right, width_left=left)


@dataclass(frozen=True, kw_only=True)
class Block:
    """A box that stands against a wall of a straight.

    Attributes:
      side: number of the corner of the outline at which the side with the straight begins.
      start: from the beginning of the straight to the box [m].
      length: of the box along the straight [m].
      depth: from the wall to the face of the box [m].
      left: whether it stands against the left wall.
    """

    side: int
    start: float
    length: float
    depth: float
    left: bool


def lane(
    around: Outline, *, radii: FloatArray, right: FloatArray, left: FloatArray, squareness: FloatArray,
    blocks: Sequence[Block] = (),
) -> Lane:  # fmt: skip
    """Return the lane along an outline, from the middle of its longest straight without boxes.

    Args:
      around: the outline.
      radii: of the centreline at each corner. Shape (n,) [m].
      right: from the centreline to the right wall, of the side that begins at each corner. Shape (n,) [m].
      left: to the left wall.
      squareness: of the outer wall at each corner, from 0, the largest arc, to 1, a square corner. Shape (n,).
      blocks: boxes on straights, in the order in which the lane meets them. The centreline runs through the middle of
        what each of them leaves.

    Raises:
      ValueError: a box that is not on its straight.
    """
    corners = around.corners
    after = steps(corners) / step_lengths(corners)[:, None]
    turned = np.sign(turns(corners))
    straights = straight_lengths(around, radii)
    for block in blocks:
        if not 0.0 < block.start < block.start + block.length < straights[block.side]:
            raise ValueError(f"{block} on a straight of {straights[block.side]:.2f} m; accepted: within it")
    start = int(np.argmax(np.where(np.isin(np.arange(len(corners)), [block.side for block in blocks]), 0.0, straights)))
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
        standing = [block for block in blocks if block.side == c]
        if standing:
            along, offset, wide_right, wide_left = _straight_with(standing, straights[c], right[c], left[c])
            aside = np.array([-after[c, 1], after[c, 0]])
            line = arc[-1] + np.outer(along, after[c]) + np.outer(offset, aside)
            pieces.append(np.column_stack((line, wide_right, wide_left)))
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


def _straight_with(blocks: Sequence[Block], length: float, right: float, left: float) -> tuple[FloatArray, ...]:
    """Return the centreline of a straight of that length [m] with boxes, and its widths.

    Returns:
      Places along the straight, offsets to its left, and widths to the right and the left wall, shape (n,) [m] each.
    """
    knots = [(max(0.0, blocks[0].start - _RAMP), 0.0)]
    faces = {True: [(-1.0, left)], False: [(-1.0, -right)]}
    for block in blocks:
        wall = left if block.left else -right
        face = wall - block.depth if block.left else wall + block.depth
        end = block.start + block.length
        middle = 0.5 * (face - right) if block.left else 0.5 * (face + left)
        knots += [(block.start, middle), (end, middle)]
        faces[block.left] += [(block.start, wall), (block.start, face), (end, face), (end, wall)]
    knots.append((min(length, blocks[-1].start + blocks[-1].length + _RAMP), 0.0))
    walls = [np.array([*faces[side], (length + 1.0, faces[side][0][1])]) for side in (False, True)]
    fine = np.linspace(0.0, length, 1 + math.ceil(length / 0.005))
    offset, slope = _weave(fine, knots)
    places = [np.linspace(0.0, length, 1 + math.ceil(length / (0.5 * SPACING)))[1:-1]]
    for x, y in np.concatenate([wall[1:-1] for wall in walls]):  # just before and behind each corner of a box
        beyond = x - fine + (y - offset) * slope > 0.0
        squarely = fine[1:][beyond[:-1] & ~beyond[1:]]
        places += [squarely - _EDGE, squarely + _EDGE]
    along = np.unique(np.clip(np.concatenate(places), _EDGE, length - _EDGE))
    along = along[np.diff(along, append=length) > 0.5 * _EDGE]
    offset, slope = _weave(along, knots)
    across = np.column_stack((-slope, np.ones(len(along)))) / np.hypot(1.0, slope)[:, None]
    points = np.column_stack((along, offset))
    return along, offset, _distance_to(walls[0], points, -across), _distance_to(walls[1], points, across)


def _weave(along: FloatArray, knots: Sequence[tuple[float, float]]) -> tuple[FloatArray, FloatArray]:
    """Return offset and slope of a line that goes from knot to knot in cosine waves. Shape (n,) each."""
    x, y = np.array(knots).T
    k = np.clip(np.searchsorted(x, along, side="right") - 1, 0, len(x) - 2)
    run, rise = x[k + 1] - x[k], y[k + 1] - y[k]
    angle = math.pi * np.clip((along - x[k]) / run, 0.0, 1.0)
    return y[k] + 0.5 * rise * (1.0 - np.cos(angle)), 0.5 * math.pi * rise / run * np.sin(angle)


def _distance_to(wall: FloatArray, points: FloatArray, directions: FloatArray) -> FloatArray:
    """Return the distance from each point along its direction to an open wall (m, 2). Shape (n,) [m]."""
    ahead = np.diff(wall, axis=0)
    away = wall[:-1] - points[:, None]
    scale = cross(directions[:, None], ahead)
    with np.errstate(divide="ignore", invalid="ignore"):
        distance, share = cross(away, ahead) / scale, cross(away, directions[:, None]) / scale
    hit = (scale != 0.0) & (share >= 0.0) & (share <= 1.0) & (distance > 0.0)
    return np.asarray(np.where(hit, distance, math.inf).min(axis=1))


def straight_lengths(around: Outline, radii: FloatArray) -> FloatArray:
    """Return how long each side is between the arcs at its ends. Shape (n,) [m]."""
    return np.asarray(step_lengths(around.corners) - radii - np.roll(radii, -1))


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
