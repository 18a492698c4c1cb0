"""Circuits round a patch of cells whose lanes lie back to back: between two lanes stands only a thin barrier.

    around = outline(patch("#.#.#", "#####"), columns=[1.5] * 5, rows=[1.4, 3.0])
    track = lane(around, radii=..., right=..., left=..., squareness=...).track("comb")

The circuit is the outline of the patch. Where a cell lies between two of its stretches, the cell is divided between
them: each lane reaches to half of the cell, less half of the barrier. So a finger of the patch that is one cell thick
becomes a thin barrier with a hairpin round its end, and so does a gap one cell thick between two fingers.

`with_boxes` puts boxes against the walls of a lane. The walls with their boxes are drawn first, then the line through
the middle of what each box leaves, and then the distances from that line to the walls are measured. Just before and
just behind each corner of a box the line has a point, so that the corner is sharp.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fg_mujoco import portable
from fg_mujoco.course.polyline import cross, step_lengths, steps, subdivide, turns
from fg_mujoco.course.track import Track
from fg_mujoco.messages import FloatArray

from ..random_courses.generator import SIDES, Cell, place_at_origin, walk_round

SPACING = 0.1  # [m] between the points of the centreline
_RAMP = 1.4  # [m] at most, in which the line turns from the middle of the lane to what a box leaves
_EDGE = 0.01  # [m] from the place at a corner of a box to the points of the line before and behind it
_FINE = 0.005  # [m] of the places at which such a place is looked for
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
        line = self.line + gradient / wave * portable.sin(angle)
        slope = gradient * portable.cos(angle)  # the derivatives of x by y and of y by x
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
        arc = np.outer(portable.sin(angle), after[b]) - np.outer(portable.cos(angle), after[c])
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
    cos, sin = portable.cos(angle), portable.sin(angle)
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


@dataclass(frozen=True, kw_only=True)
class Block:
    """A box that stands against a wall of a straight."""

    start: float  # [m] from the beginning of the straight to the box
    length: float  # [m] along the straight
    depth: float  # [m] from the wall to the face of the box
    left: bool  # whether it stands against the left wall

    @property
    def end(self) -> float:
        """From the beginning of the straight to the end of the box [m]."""
        return self.start + self.length


def with_boxes(lane: Lane, start: float, end: float, blocks: Sequence[Block]) -> Lane:
    """Return the lane with boxes on a straight.

    Args:
      lane: the lane.
      start: where the straight begins [m], not over the start of the lane (Lane.straights).
      end: where it ends [m].
      blocks: one or more, in the order in which the lane meets them.

    Raises:
      ValueError: a box that is not on the straight.
    """
    length = end - start
    for block in blocks:
        if not 0.0 < block.start < block.end < length:
            raise ValueError(f"{block} on a straight of {length:.2f} m; accepted: within it")
    straight = _Straight(lane, start)
    right_wall, left_wall = (straight.wall(blocks, left, length) for left in (False, True))
    knots = [(max(0.0, blocks[0].start - _RAMP), 0.0)]
    for block in blocks:
        free = straight.offset(block.start, True) + straight.offset(block.start, False)
        middle = 0.5 * (float(free) + (-block.depth if block.left else block.depth))
        knots += [(block.start, middle), (block.end, middle)]
    knots.append((min(length, blocks[-1].end + _RAMP), 0.0))

    fine = np.linspace(0.0, length, 1 + math.ceil(length / _FINE))
    line = straight.points(fine, _weave(fine, knots))
    places = [np.arange(0.5 * SPACING, length, 0.5 * SPACING)]
    for corner in np.concatenate([straight.box(block) for block in blocks]):
        is_ahead = np.sum((corner - line[:-1]) * np.diff(line, axis=0), axis=1) > 0.0
        corners = fine[1:-1][is_ahead[:-1] & ~is_ahead[1:]]
        places += [corners - _EDGE, corners + _EDGE]
    along = np.unique(np.clip(np.concatenate(places), _EDGE, length - _EDGE))
    along = along[np.diff(along, append=length) > 0.5 * _EDGE]
    line = straight.points(along, _weave(along, knots))

    before, behind = lane.arc_length <= start, lane.arc_length >= end
    heading = portable.arctan2(*np.diff(np.vstack((lane.line[before][-1], line, lane.line[behind][0])), axis=0).T[::-1])
    turn = np.diff(heading)
    heading = heading[:-1] + 0.5 * portable.arctan2(portable.sin(turn), portable.cos(turn))  # as `Track.headings`
    aside = np.column_stack((-portable.sin(heading), portable.cos(heading)))
    right, left = _distances(line, -aside, right_wall), _distances(line, aside, left_wall)
    return Lane(
        line=np.concatenate((lane.line[before], line, lane.line[behind])),
        right=np.concatenate((lane.right[before], right, lane.right[behind])),
        left=np.concatenate((lane.left[before], left, lane.left[behind])),
    )


class _Straight:
    """Points to the side of a straight of a lane: places along it are counted from its beginning."""

    def __init__(self, lane: Lane, start: float) -> None:
        self._lane = lane
        self._at = lane.arc_length - start
        ahead = np.roll(lane.line, -1, axis=0) - np.roll(lane.line, 1, axis=0)
        self._left = np.column_stack((-ahead[:, 1], ahead[:, 0])) / np.hypot(*ahead.T)[:, None]

    def points(self, along: FloatArray, offset: FloatArray) -> FloatArray:
        """Return the points at places along the lane and offsets to its left, (n,) [m] each. Shape (n, 2) [m]."""
        x, y, left_x, left_y = (np.interp(along, self._at, v) for v in (*self._lane.line.T, *self._left.T))
        return np.column_stack((x + offset * left_x, y + offset * left_y))

    def offset(self, along: FloatArray | float, left: bool) -> FloatArray:
        """Return the offset of the left or the right wall, left positive, shape as `along` [m]."""
        return np.asarray(np.interp(along, self._at, self._lane.left if left else -self._lane.right))

    def box(self, block: Block) -> FloatArray:
        """Return a box's corners in driving order: at the wall, twice at its face, at the wall. Shape (4, 2) [m]."""
        along = np.array((block.start, block.start, block.end, block.end))
        depth = block.depth * np.array((0.0, 1.0, 1.0, 0.0))
        return self.points(along, self.offset(along, block.left) + (-depth if block.left else depth))

    def wall(self, blocks: Sequence[Block], left: bool, length: float) -> FloatArray:
        """Return the left or the right wall with its boxes, in driving order, from 1 m before to 1 m behind. (m, 2)"""
        own = [block for block in blocks if block.left == left]
        begins, ends = [0.0, *(block.end for block in own)], [*(block.start for block in own), length]
        pieces = []
        for k, (begin, end) in enumerate(zip(begins, ends, strict=True)):
            along = np.linspace(begin, end, 2 + int((end - begin) / SPACING))
            pieces.append(self.points(along, self.offset(along, left)))
            if k < len(own):
                pieces.append(self.box(own[k])[1:3])
        wall = np.concatenate(pieces)
        first, last = wall[0] - wall[1], wall[-1] - wall[-2]
        return np.vstack((wall[0] + first / np.hypot(*first), wall, wall[-1] + last / np.hypot(*last)))


def _weave(along: FloatArray, knots: Sequence[tuple[float, float]]) -> FloatArray:
    """Return the offset of a line that goes from knot to knot in cosine waves. Shape (n,) [m]."""
    x, y = np.array(knots).T
    k = np.clip(np.searchsorted(x, along, side="right") - 1, 0, len(x) - 2)
    share = np.clip((along - x[k]) / (x[k + 1] - x[k]), 0.0, 1.0)
    return np.asarray(y[k] + 0.5 * (y[k + 1] - y[k]) * (1.0 - portable.cos(math.pi * share)))


def _distances(points: FloatArray, directions: FloatArray, wall: FloatArray) -> FloatArray:
    """Return the distance from each point (n, 2) along its direction to an open wall (m, 2). Shape (n,) [m]."""
    ahead = np.diff(wall, axis=0)
    away = wall[:-1] - points[:, None]
    scale = cross(directions[:, None], ahead)
    with np.errstate(divide="ignore", invalid="ignore"):
        distance, share = cross(away, ahead) / scale, cross(away, directions[:, None]) / scale
    hit = (scale != 0.0) & (share >= 0.0) & (share <= 1.0) & (distance > 0.0)
    return np.asarray(np.where(hit, distance, math.inf).min(axis=1))
