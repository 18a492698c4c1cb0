"""Tight circuits from a seed, as F1TENTH races are built: narrow lanes back to back and hairpins round thin barriers.

    track = generate_tight_track(7)    # or load_track("random:7:tight")

The generator draws a patch of cells: a bent bar, a comb, a spiral, or a tree that grows at random. The circuit is the
outline of the patch (`lanes`). Corners are round or square, on some of the straights boxes stand as a chicane, and the
plane is bent a little. Every circuit has a hairpin of 180 degrees round a thin barrier. A lap of it can be driven
forward by the bundled car `f1tenth`, with 5 cm of room all round: a search over its motions finds one (`drivable`). A
circuit that breaks these limits, or of which the search finds no lap, is drawn again. The same seed gives the same
numbers.
"""

from __future__ import annotations

import math

import numpy as np

from fg_mujoco import portable
from fg_mujoco.course.polyline import step_lengths, turns
from fg_mujoco.course.track import Track
from fg_mujoco.errors import TrackError
from fg_mujoco.messages import FloatArray

from ..random_courses.generator import SIDES, Cell, can_join
from .drivable import drivable_lap
from .lanes import SPACING, Block, Lane, Outline, corner_radii, hairpins, lane, outline, with_boxes

_ATTEMPTS = 300  # draws before giving up; the first few keep the limits below
_MAX_RADIUS = 1.6  # [m] of the centreline in a corner that has room for more
_MAX_BEND = 0.08  # greatest gradient of the displacement that bends the plane
_CHICANES = 0.5  # share of the straights with room for boxes that have some
_CHICANE = 2.2  # [m] of a straight with one box; each further one needs as much more as the box and the way to it
_APART = (1.1, 1.8)  # [m] from the end of one box to the beginning of the next
_BLOCK = (0.2, 0.6)  # [m] length of a box
_THICK = (1.8, 5.0)  # [m] of a row or column that no two lanes share

LENGTH = (15.0, 60.0)  # [m] of every tight circuit
WIDTH = (1.0, 1.8)  # [m] of the lane: at least 1 m by the rules of 2026; square corners of the outer wall leave more
GAP = (0.6, 0.9)  # [m] that a box leaves; the car is 0.31 m wide
MIN_RADIUS = 0.45  # [m] of the centreline
BARRIER = (0.08, 0.15)  # [m] thickness of the barrier between two lanes, before the plane is bent


def generate_tight_track(seed: int | np.random.Generator, *, name: str | None = None) -> Track:
    """Draw a tight circuit, driven from the middle of its longest straight, which starts at the origin along x.

    Args:
      seed: a seed from 0, or the generator to draw from.
      name: of the track; `random:SEED:tight` if None.

    Raises:
      TrackError: no circuit was found.
    """
    rng = seed if isinstance(seed, np.random.Generator) else np.random.default_rng(seed)
    name = name or ("random:tight" if isinstance(seed, np.random.Generator) else f"random:{seed}:tight")
    for _ in range(_ATTEMPTS):
        track = _draw(rng, name)
        if track is not None and drivable_lap(track) is not None:
            return track
    raise TrackError(f"{name}: no circuit found in {_ATTEMPTS} draws; accepted: another seed")


def _draw(rng: np.random.Generator, name: str) -> Track | None:
    cells = _KINDS[rng.integers(len(_KINDS))](rng)
    barrier = rng.uniform(*BARRIER)
    columns, rows = (_sizes(rng, cells, axis, barrier) for axis in (0, 1))
    around = outline(cells, columns, rows)
    count = len(around.corners)
    radii = _radii(rng, around)
    right, left = (
        np.where(
            room - 0.5 * barrier < 0.5 * WIDTH[1],
            room - 0.5 * barrier,
            0.5 * rng.uniform(*WIDTH, count),
        )
        for room in (around.room_right, around.room_left)
    )
    if not _has_hairpin(around, left):
        return None
    squareness = rng.choice((0.0, 0.5, 1.0), count)
    drawn = lane(around, radii=radii, right=right, left=left, squareness=squareness)
    extent = float(np.ptp(drawn.line, axis=0).max())
    wave = 2.0 * math.pi / (extent * rng.uniform(1.5, 2.5, 2))
    drawn = drawn.bend(rng.uniform(0.0, _MAX_BEND, 2), wave, rng.uniform(0.0, 2.0 * math.pi, 2))
    if rng.random() < 0.5:
        drawn = drawn.reverse()
    drawn = _chicanes(rng, drawn)
    try:
        track = drawn.track(name)
        kept = LENGTH[0] <= track.length <= LENGTH[1]
        kept = kept and float(np.abs(track.curvature).max()) <= 1.0 / MIN_RADIUS
        kept = kept and np.array_equal(track.corridor_right, track.width_right)
        kept = kept and np.array_equal(track.corridor_left, track.width_left)
        return track if kept and len(track.left_wall) > 0 else None
    except TrackError:
        return None


def _sizes(rng: np.random.Generator, cells: frozenset[Cell], axis: int, barrier: float) -> list[float]:
    """Return the width of each column (axis 0) or row (axis 1) [m]: thin where two lanes share it."""
    sizes = []
    for place in range(1 + max(cell[axis] for cell in cells)):
        thin = barrier + rng.uniform(*WIDTH)
        thick = rng.uniform(*_THICK)
        sizes.append(thin if _is_shared(cells, axis, place) or rng.random() < 0.3 else thick)
    return sizes


def _is_shared(cells: frozenset[Cell], axis: int, place: int) -> bool:
    """Tell whether a column or row is all that divides two lanes: it has a cell, or a gap, that is one thick."""
    for other in {cell[1 - axis] for cell in cells}:
        across = {cell[axis] for cell in cells if cell[1 - axis] == other}
        neighbours = (place - 1 in across, place + 1 in across)
        if (place in across and neighbours == (False, False)) or (place not in across and neighbours == (True, True)):
            return True
    return False


def _radii(rng: np.random.Generator, around: Outline) -> FloatArray:
    """Return the radius at each corner: half circles round hairpins, at random from the least elsewhere [m]."""
    lengths = step_lengths(around.corners)
    room = 0.5 * np.minimum(lengths, np.roll(lengths, 1))
    least = MIN_RADIUS * (1.0 + 2.0 * _MAX_BEND)
    drawn = rng.uniform(least, np.clip(room, least, _MAX_RADIUS))
    return corner_radii(around, drawn, WIDTH[1] + BARRIER[1] + 1e-9)


def _chicanes(rng: np.random.Generator, drawn: Lane) -> Lane:
    """Return the lane with boxes on some of its straights: against one wall and then the other."""
    for begin, end in reversed(drawn.straights()):  # those before keep their places
        room = end - begin - _CHICANE
        wanted, on_left, count = rng.random() < _CHICANES, bool(rng.random() < 0.5), int(rng.integers(1, 4))
        if room < 0.0 or not wanted:
            continue
        apart = rng.uniform(*_APART)
        lengths = rng.uniform(*_BLOCK, min(count, 1 + int(room / (apart + _BLOCK[1]))))
        near = np.abs(drawn.arc_length - 0.5 * (begin + end)) < 0.5 * room + SPACING
        width = float((drawn.right + drawn.left)[near].min())
        depths = width - rng.uniform(*GAP, len(lengths))
        if depths.min() < _BLOCK[0]:
            continue
        start, blocks = 0.5 * (end - begin - lengths.sum() - (len(lengths) - 1) * apart), []
        for length, depth in zip(lengths.tolist(), depths.tolist(), strict=True):
            blocks.append(Block(start=start, length=length, depth=depth, left=on_left))
            start += length + apart
            on_left = not on_left
        drawn = with_boxes(drawn, begin, end, blocks)
    return drawn


def _has_hairpin(around: Outline, left: FloatArray) -> bool:
    """Tell whether a barrier no thicker than BARRIER ends in a hairpin, between lanes on both of its sides."""
    lengths = step_lengths(around.corners)
    thickness = lengths - np.roll(left, 1) - np.roll(left, -1)
    return bool(np.any(hairpins(around) & (turns(around.corners) > 0.0) & (thickness < BARRIER[1] + 1e-9)))


def _bar(rng: np.random.Generator) -> frozenset[Cell]:
    """A bar of two to six cells that bends."""
    return _grow(rng, int(rng.integers(2, 7)), 6.0, only_at_end=True)


def _tree(rng: np.random.Generator) -> frozenset[Cell]:
    """Five to fourteen cells that grow in fingers."""
    return _grow(rng, int(rng.integers(5, 15)), rng.uniform(2.0, 6.0))


def _comb(rng: np.random.Generator) -> frozenset[Cell]:
    """A back of cells with two to four teeth on one side or on both."""
    teeth, high, flipped = int(rng.integers(2, 5)), rng.integers(1, 3, 4), rng.random() < 0.5
    cells = {(i, 0) for i in range(2 * teeth - 1)}
    for tooth in range(teeth):
        cells |= {(2 * tooth, j + 1) for j in range(int(high[tooth]))}
        if rng.random() < 0.2:
            cells.add((2 * tooth, -1))
    return _at_zero({(j, i) for i, j in cells} if flipped else cells)


def _spiral(rng: np.random.Generator) -> frozenset[Cell]:
    """A bar that winds inward, with a lane between its windings."""
    long, i, j = int(rng.integers(4, 7)), 0, 0
    cells, mirrored = {(0, 0)}, rng.random() < 0.5
    legs = [long, int(rng.integers(2, 5)), long, 2, long - 2][: int(rng.integers(3, 6))]
    if len(legs) > 3:
        legs[1] = 4
    for leg, (di, dj) in zip(legs, ((1, 0), (0, 1), (-1, 0), (0, -1), (1, 0)), strict=False):
        for _ in range(leg):
            i, j = i + di, j + dj
            cells.add((i, j))
    return _at_zero({(b, a) for a, b in cells} if mirrored else cells)


_KINDS = (_bar, _comb, _spiral, _tree)


def _grow(rng: np.random.Generator, count: int, fingers: float, *, only_at_end: bool = False) -> frozenset[Cell]:
    """Return so many cells, grown one by one without holes; the more `fingers`, the fewer neighbours a new cell has."""
    cells: list[Cell] = [(0, 0)]
    while len(cells) < count:
        bases = cells[-1:] if only_at_end else cells
        near = sorted({(i + di, j + dj) for i, j in bases for di, dj in SIDES} - set(cells))
        free = [cell for cell in near if can_join(cell, cells)]
        if not free:
            break
        touching = np.array([sum((i + di, j + dj) in cells for di, dj in SIDES) for i, j in free])
        weight = portable.exp(-fingers * (touching - 1.0))
        cells.append(free[rng.choice(len(free), p=weight / weight.sum())])
    return _at_zero(set(cells))


def _at_zero(cells: set[Cell]) -> frozenset[Cell]:
    low_i, low_j = min(i for i, _ in cells), min(j for _, j in cells)
    return frozenset((i - low_i, j - low_j) for i, j in cells)
