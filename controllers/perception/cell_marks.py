"""Marks the cells of the local map: which are free or unknown, and how near to a wall each is.

count = mark_cells(world, bits)
bits[i & RING, j & RING] & AT_WALL  # whether a wall is within one cell
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.compiled.kernels import kernel

from ..control.planner_settings import Record
from .local_map import EDGE, FREE, KIND, NEARNESS, RING, SIZE, UNKNOWN, WALL

NEAR_WALL, WAY_BACK, AT_WALL, HOLE, OPEN, UNSEEN, WITHIN_6, WITHIN_4 = 1, 2, 4, 8, 16, 32, 64, 128
"""Bits of a cell: a wall is within two cells; closed by `frontiers`; a wall is within one cell; the middle of a hole of
three cells; free; unknown; a wall is in the square of six cells to each side, and in that of four."""

_MARGIN = 8  # columns next to the known ones, in which their walls count


@kernel
def mark_cells(world: Record, bits: NDArray[np.uint8]) -> int:
    """Write the bits of all cells, without WAY_BACK, and the NEARNESS of the map's; return how many may be free.

    Only columns with something known in them are looked at. How near walls are is worked out within each column first.
    Then columns are joined, for the greater distances two and four at a time.
    """
    first, end = _known_columns(world)
    bits[:] = UNSEEN
    for i in range(world.column - EDGE, world.column + EDGE + 1):
        if not first - 2 <= i < end + 2:
            world.cells[i & RING, :] = UNKNOWN
    if first == end:
        return 0
    count = end - first + 2 * _MARGIN
    within = np.zeros((count, SIZE), np.uint8)  # bits as of _mark_column
    walls = np.empty(SIZE + 12, np.uint8)
    two, four = np.empty((count, SIZE), np.uint8), np.empty((count, SIZE), np.uint8)  # of this column and those after
    for k in range(_MARGIN, count - _MARGIN):
        _mark_column(world.cells[(first + k - _MARGIN) & RING], walls, within[k])
    for k in range(count - 1):
        _join(within[k], within[k + 1], two[k])
    for k in range(count - 3):
        _join(two[k], two[k + 2], four[k])
    for k in range(_MARGIN - 2, count - _MARGIN + 2):
        i = first + k - _MARGIN
        if abs(i - world.column) > EDGE:
            continue
        _mark_ground(world.cells[i & RING], bits[i & RING])
        _mark_near(within[k - 2], within[k - 1], within[k], within[k + 1], within[k + 2], bits[i & RING])
        _mark_far(two[k - 6], four[k - 4], four[k], within[k + 4], two[k + 5], bits[i & RING])
        _keep_nearness(bits[i & RING], world.cells[i & RING])
    return (end - first) * SIZE


@kernel
def _known_columns(world: Record) -> tuple[int, int]:
    """Return the first column in which a cell is known, and the one after the last; twice the same if none is."""
    first, end = world.column - EDGE, world.column + EDGE + 1
    while first < end and not _is_known(world.cells[first & RING]):
        first += 1
    while first < end and not _is_known(world.cells[(end - 1) & RING]):
        end -= 1
    return first, end


@kernel
def _is_known(cells: NDArray[np.uint8]) -> bool:
    """Return whether any of some cells is known."""
    known = np.uint8(0)
    for j in range(len(cells)):
        known |= cells[j] & np.uint8(KIND)
    return bool(known != UNKNOWN)


@kernel
def _mark_column(cells: NDArray[np.uint8], walls: NDArray[np.uint8], within: NDArray[np.uint8]) -> None:
    """Write how near the walls of a column are to its cells.

    The bits: 1, a wall; 2, within a cell; 4, within two; 8, walls two cells to both sides; WITHIN_4; WITHIN_6.
    """
    some = np.uint8(0)
    for j in range(SIZE):
        wall = np.uint8(cells[j] & np.uint8(KIND) == WALL)
        walls[j + 6] = wall
        some |= wall
    if some == 0:
        return
    for j in range(6):
        walls[j], walls[SIZE + 6 + j] = walls[SIZE + j], walls[6 + j]
    for j in range(SIZE):
        one = walls[j + 5] | walls[j + 6] | walls[j + 7]
        two = one | walls[j + 4] | walls[j + 8]
        four = two | walls[j + 2] | walls[j + 3] | walls[j + 9] | walls[j + 10]
        six = four | walls[j] | walls[j + 1] | walls[j + 11] | walls[j + 12]
        hole = walls[j + 4] & walls[j + 8]
        near = walls[j + 6] | one << np.uint8(1) | two << np.uint8(2) | hole << np.uint8(3)
        within[j] = near | six << np.uint8(6) | four << np.uint8(7)


@kernel
def _join(left: NDArray[np.uint8], right: NDArray[np.uint8], both: NDArray[np.uint8]) -> None:
    """Write the bits of two columns to a third; an expression of whole arrays takes fifty times as long."""
    for j in range(SIZE):
        both[j] = left[j] | right[j]


@kernel
def _mark_ground(cells: NDArray[np.uint8], bits: NDArray[np.uint8]) -> None:
    """Write OPEN or UNSEEN to the bits of a column, or none."""
    for j in range(SIZE):
        kind = cells[j] & np.uint8(KIND)
        bits[j] = np.uint8(kind == FREE) << np.uint8(4) | np.uint8(kind == UNKNOWN) << np.uint8(5)


@kernel
def _mark_near(
    a: NDArray[np.uint8],
    b: NDArray[np.uint8],
    c: NDArray[np.uint8],
    d: NDArray[np.uint8],
    e: NDArray[np.uint8],
    bits: NDArray[np.uint8],
) -> None:
    """Add NEAR_WALL, AT_WALL and HOLE to the bits of a column, c, with its neighbours: see _mark_column."""
    for j in range(SIZE):
        near = (a[j] | e[j]) >> np.uint8(1) | (b[j] | c[j] | d[j]) >> np.uint8(2)
        touching = c[j] >> np.uint8(1) | b[j] | d[j]
        hole = c[j] >> np.uint8(3) | (a[j] & e[j])
        one = np.uint8(1)
        bits[j] |= (near & one) | (touching & one) << np.uint8(2) | (hole & one) << np.uint8(3)


@kernel
def _mark_far(
    outer_left: NDArray[np.uint8],
    left: NDArray[np.uint8],
    right: NDArray[np.uint8],
    last: NDArray[np.uint8],
    outer_right: NDArray[np.uint8],
    bits: NDArray[np.uint8],
) -> None:
    """Add WITHIN_4 and WITHIN_6 to the bits of a column: by those within 4 columns, and the outer ones within 6."""
    for j in range(SIZE):
        far = (left[j] | right[j] | last[j]) & np.uint8(WITHIN_4 | WITHIN_6)
        bits[j] |= far | (outer_left[j] | outer_right[j]) & np.uint8(WITHIN_6)


@kernel
def _keep_nearness(bits: NDArray[np.uint8], cells: NDArray[np.uint8]) -> None:
    """Write how near walls are to the cells of a column, by its bits: a nearer one is within the greater distances."""
    for j in range(SIZE):
        one = np.uint8(1)
        level = (bits[j] >> np.uint8(7)) + (bits[j] & one) + ((bits[j] >> np.uint8(2)) & one)
        cells[j] = cells[j] & np.uint8(255 - NEARNESS) | level << np.uint8(2)
