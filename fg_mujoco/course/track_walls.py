"""The inner faces of a track's walls, from its centreline and widths: two closed polylines that do not cross.

The corridor is the area that the widths sweep, square to the line. Its edge differs from an offset of the line in two
places:

- In a corner tighter than the corridor is wide, the inner offset folds over itself. The part that lies in the corridor
  of another part of the line is cut off where the two arms of the fold meet.
- Where two stretches of the circuit run so close that their corridors would overlap, they share the room in proportion
  to their widths, with a wall of `SHARED_WALL` between them. A wall is moved where it would stand in the corridor of
  the other stretch, or nearer to it than that.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .. import portable
from ..errors import TrackError
from ..messages import FloatArray, read_only
from .polyline import (
    IndexArray,
    cross,
    crossings,
    distance_to_segment,
    enclosed_area,
    meeting_point,
    nearby,
    runs,
    segments,
    self_crossings,
    simplify,
    step_lengths,
    steps,
    subdivide,
    turns,
)

BoolArray = NDArray[np.bool_]

SHARED_WALL = 0.05  # [m] left between two stretches that share the room between them
WALL_TOLERANCE = 0.005  # [m] how far a wall may stray from the edge of the corridor, to be of fewer pieces; a
# UST-10LX measures to 40 mm (Hokuyo data sheet)
STRETCH_WIDTHS = 3.0  # two places are different stretches when farther apart along the line than this many times
# the sum of their half widths; nearer ones are one corner, which needs no wall between its arms

_SAMPLING = 0.25  # [m] at most, between the points of the line that walls are offset from
_TOUCH = 1e-6  # [m] a point this near to the edge of a corridor is on it
MAX_TURN = np.deg2rad(120.0)  # at one point of the line: sharper ones turn back on themselves


def wall_lines(centreline: FloatArray, right: FloatArray, left: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Inner faces of the right and the left wall of a closed line, with distances (n,) to the right and the left [m].

    Closed polylines in driving order, (k, 2) and (m, 2) [m], read-only, within `WALL_TOLERANCE` of the corridor's edge.

    Raises:
      TrackError: a corner so tight and a corridor so wide that there is no room for a wall inside.
    """
    line, right, left = subdivide(centreline, _SAMPLING, right, left)
    mirror = np.array([1.0, -1.0])  # the right side is the left side of the mirrored line
    return (
        read_only(_left_wall(line * mirror, right, "right") * mirror),
        read_only(_left_wall(line, left, "left")),
    )


def shared_widths(
    centreline: FloatArray, right: FloatArray, left: FloatArray, *, all_round: bool = False
) -> tuple[FloatArray, FloatArray]:
    """Widths to the right and the left (n,) [m], less what stretches that run side by side take from each other.

    With `all_round` the widths count in all directions, and not only square to the line. Raises TrackError for a
    stretch whose wall would lie beyond the centreline of another.
    """
    pairs = _stretch_pairs(centreline, np.maximum(right, left))
    return _share(centreline, right, -1.0, pairs, all_round), _share(centreline, left, 1.0, pairs, all_round)


def _stretch_pairs(line: FloatArray, widths: FloatArray) -> tuple[IndexArray, IndexArray]:
    """Points i and segments j of other stretches that are near enough for their corridors to meet."""
    i, j = nearby(np.stack((line, line), axis=1), segments(line), 2.0 * float(widths.max()) + SHARED_WALL)
    lengths = step_lengths(line)
    at = np.cumsum(lengths) - lengths
    to_ends = np.abs(at[i] - [at[j], (at + lengths)[j]])
    apart = np.minimum(to_ends, lengths.sum() - to_ends).min(axis=0)
    other = apart > STRETCH_WIDTHS * (widths[i] + widths[j])
    return i[other], j[other]


def _share(
    line: FloatArray, widths: FloatArray, side: float, pairs: tuple[IndexArray, IndexArray], all_round: bool
) -> FloatArray:
    i, j = pairs
    start, end = line[j], np.roll(line, -1, axis=0)[j]
    heading = np.roll(line, -1, axis=0)[i] - np.roll(line, 1, axis=0)[i]
    facing = side * cross(heading, 0.5 * (start + end) - line[i]) > 0.0
    i, j, start, end = i[facing], j[facing], start[facing], end[facing]
    distance = distance_to_segment(line[i], start, end)
    reached = np.flatnonzero(distance <= widths[i])
    if len(reached):
        worst = reached[np.argmin(distance[reached])]
        (x, y), name = line[i[worst]], "left" if side > 0.0 else "right"
        raise TrackError(
            f"the track runs over itself: at ({x:.2f}, {y:.2f}), point {i[worst]}, its {name} wall would be "
            f"{widths[i[worst]]:.2f} m away, but the centreline comes by again, at point {j[worst]}, at "
            f"{distance[worst]:.2f} m; accepted: stretches that run at least their widths apart"
        )
    share = (distance - SHARED_WALL) / (widths[i] + np.maximum(widths[j], np.roll(widths, -1)[j]))
    if not all_round:
        mirrored = line * (1.0, side)
        wall, half_turn = _offset(mirrored, widths)
        share[~_covered(wall[i], j, mirrored, widths, half_turn, SHARED_WALL)] = 1.0
    narrowed = widths.copy()
    np.minimum.at(narrowed, i, widths[i] * share)
    return narrowed


def _offset(line: FloatArray, widths: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return points (n, 2) to the left of a line, a width away from both segments at each, and half its turns (n,)."""
    half_turn = 0.5 * turns(line)
    heading = portable.arctan2(*steps(line).T[::-1]) - half_turn  # of the bisector at each point
    mitre = np.column_stack((-portable.sin(heading), portable.cos(heading))) / portable.cos(half_turn)[:, None]
    return line + widths[:, None] * mitre, half_turn


def _left_wall(line: FloatArray, widths: FloatArray, name: str) -> FloatArray:
    wall, half_turn = _offset(line, widths)
    wall = _cut_off(wall, *runs(_in_corridor(wall, line, widths, half_turn)))
    folds = True
    while folds and len(wall) >= 3:  # what jumps of the widths leave: folds outside of every corridor
        wall = wall[step_lengths(wall) > _TOUCH]
        i, j = self_crossings(wall)
        back_and_forth = _zigzags(turns(wall))
        folds = len(i) > 0 or bool(back_and_forth.any())
        wall = _cut_off(wall, *_shorter_loops(i, j, len(wall))) if len(i) else wall[~back_and_forth]
    turned_over = enclosed_area(wall) * enclosed_area(line) <= 0.0
    if len(wall) < 3 or turned_over or len(crossings(segments(wall), segments(line))[0]):
        raise TrackError(
            f"there is no room for the {name} wall: the track's corners are tighter than its corridor is wide; "
            f"accepted: a loop wider than its corridor"
        )
    _, fewer = simplify(wall, WALL_TOLERANCE)
    return wall if len(self_crossings(fewer)[0]) else fewer


def _in_corridor(wall: FloatArray, line: FloatArray, widths: FloatArray, half_turn: FloatArray) -> BoolArray:
    """Return which points of the left wall, one for each of the line, are in the corridor of another part of it."""
    i, j = nearby(np.stack((wall, wall), axis=1), segments(line), 2.0 * float(widths.max()))
    neighbour = (i == j) | (i == (j + 1) % len(line))
    i, j = i[~neighbour], j[~neighbour]
    inside = np.zeros(len(wall), dtype=bool)
    inside[i[_covered(wall[i], j, line, widths, half_turn, -_TOUCH)]] = True
    i, j = crossings(np.stack((line, wall), axis=1), segments(line))  # of a corridor wider than two arms are apart
    inside[i[(i != j) & (i != (j + 1) % len(line))]] = True
    return inside


def _covered(
    points: FloatArray, j: IndexArray, line: FloatArray, widths: FloatArray, half_turn: FloatArray, beyond: float
) -> BoolArray:
    """Return whether points (k, 2) are in the left corridors of segments j (k,), `beyond` [m] wider. Shape (k,)."""
    lengths = step_lengths(line)
    ahead = steps(line)[j] / lengths[j, None]
    along = np.sum((points - line[j]) * ahead, axis=1)
    aside = cross(ahead, points - line[j])
    share = np.clip(along / lengths[j], 0.0, 1.0)
    edge = (1.0 - share) * widths[j] + share * np.roll(widths, -1)[j]
    lean = np.maximum(-portable.tan(half_turn), 0.0)
    between = (along >= -lean[j] * aside) & (along <= lengths[j] + np.roll(lean, -1)[j] * aside)
    return np.asarray(between & (aside > 0.0) & (aside < edge + beyond))


def _zigzags(turn: FloatArray) -> BoolArray:
    """Mark the points at which a line turns back and those at which it turns forth again next. Shape (n,)."""
    back = np.where(np.abs(turn) > MAX_TURN, np.sign(turn), 0.0)
    first = back * np.roll(back, -1) < 0.0
    return np.asarray(first | np.roll(first, 1))


def _shorter_loops(i: IndexArray, j: IndexArray, count: int) -> tuple[IndexArray, IndexArray]:
    """First point and size of the shorter loop, a fold, that each crossing of segments i < j makes."""
    forward = j - i <= count // 2
    return (np.where(forward, i, j) + 1) % count, np.where(forward, j - i, count - j + i)


def _cut_off(wall: FloatArray, first: IndexArray, size: IndexArray) -> FloatArray:
    """Take out runs of points, the longest first; where the arms that led in and out cross, put their corner."""
    count = len(wall)
    gone = np.zeros(count, dtype=bool)
    corners, arms = wall.copy(), segments(wall)
    for k in np.argsort(-size, kind="stable"):
        run = (first[k] + np.arange(size[k])) % count
        if gone[run].any():
            continue  # it went with a longer one
        gone[run] = True
        corner = meeting_point(arms[first[k] - 1], arms[run[-1]]) if size[k] > 1 else None
        if corner is not None:
            corners[first[k]], gone[first[k]] = corner, False
    return corners[~gone]
