"""Boxes against the walls of a lane, and a centreline that weaves between them.

    lane = with_boxes(lane, start, end, [Block(start=1.1, length=0.4, depth=0.8, left=True)])

The walls of a track are given by widths square to its centreline. So the walls with their boxes are drawn first, then
the line through the middle of what each box leaves, and then the distances from that line to the walls are measured.
Just before and just behind each corner of a box the line has a point, so that the corner is sharp.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fg_mujoco.course.polyline import cross
from fg_mujoco.messages import FloatArray

from .lanes import SPACING, Lane

_RAMP = 1.4  # [m] at most, in which the line turns from the middle of the lane to what a box leaves
_EDGE = 0.01  # [m] from the place at a corner of a box to the points of the line before and behind it
_FINE = 0.005  # [m] of the places at which such a place is looked for


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
    heading = np.arctan2(*np.diff(np.vstack((lane.line[before][-1], line, lane.line[behind][0])), axis=0).T[::-1])
    turn = np.diff(heading)
    heading = heading[:-1] + 0.5 * np.arctan2(np.sin(turn), np.cos(turn))  # as `Track.headings`
    aside = np.column_stack((-np.sin(heading), np.cos(heading)))
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
    return np.asarray(y[k] + 0.5 * (y[k + 1] - y[k]) * (1.0 - np.cos(math.pi * share)))


def _distances(points: FloatArray, directions: FloatArray, wall: FloatArray) -> FloatArray:
    """Return the distance from each point (n, 2) along its direction to an open wall (m, 2). Shape (n,) [m]."""
    ahead = np.diff(wall, axis=0)
    away = wall[:-1] - points[:, None]
    scale = cross(directions[:, None], ahead)
    with np.errstate(divide="ignore", invalid="ignore"):
        distance, share = cross(away, ahead) / scale, cross(away, directions[:, None]) / scale
    hit = (scale != 0.0) & (share >= 0.0) & (share <= 1.0) & (distance > 0.0)
    return np.asarray(np.where(hit, distance, math.inf).min(axis=1))
