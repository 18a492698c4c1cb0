"""Cells of the local map: which are free or unknown and how near walls are, and distances over the free ones.

    free = mark_cells(world, bits)
    bits[i & RING, j & RING] & AT_WALL  # whether a wall is within one cell
    edges = flood(world, bits, distance, queue, edge, impassable)
    dijkstra(bits, distance, distance_to_goal, goal, free)

For distances a cell is one number: its column in the ring times SIZE, and its row.

Source: E. Dijkstra, A Note on Two Problems in Connexion with Graphs, Numerische Mathematik 1, 1959, with a ring of
buckets (R. Dial, Algorithm 360, CACM 12, 1969).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.compiled.kernels import kernel

from ..control.planner_settings import Record
from .local_map import EDGE, FREE, KIND, NEARNESS, PER_METRE, RING, SIZE, UNKNOWN, WALL

NEAR_WALL, WAY_BACK, AT_WALL, OPEN, UNSEEN, WITHIN_6, WITHIN_4 = 1, 2, 4, 16, 32, 64, 128
"""Bits of a cell: a wall is within two cells; closed by `frontiers`; a wall is within one cell; free; unknown; a wall
is in the square of six cells to each side, and in that of four."""

_MARGIN = 8  # columns next to the known ones, in which their walls count
FAR = 65535
"""Distance of a cell to which no way is known."""
UNIT = 0.01
"""[m] of the distances of `dijkstra`; those of `flood` are in cells."""
LAST = SIZE * SIZE - 1
"""The greatest number of a cell."""
BLOCKS = SIZE // 2
"""Blocks of two by two cells to a side: of each of them one distance to the goal is kept."""

_FREE_START = 4  # cells from the car that may be near a wall
_BUCKETS = 64  # above the greatest cost of a step; a power of two, so that `cost & _BUCKET` is the bucket of a cost
_BUCKET = _BUCKETS - 1


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

    The bits: 1, a wall; 2, within a cell; 4, within two; WITHIN_4; WITHIN_6.
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
        near = walls[j + 6] | one << np.uint8(1) | two << np.uint8(2)
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
    """Add NEAR_WALL and AT_WALL to the bits of a column, c, with its neighbours: see _mark_column."""
    for j in range(SIZE):
        near = (a[j] | e[j]) >> np.uint8(1) | (b[j] | c[j] | d[j]) >> np.uint8(2)
        touching = c[j] >> np.uint8(1) | b[j] | d[j]
        one = np.uint8(1)
        bits[j] |= (near & one) | (touching & one) << np.uint8(2)


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


@kernel
def cell_at(x: float, y: float) -> int:
    """Return the cell at a place [m]."""
    return (math.floor(x * PER_METRE) & RING) * SIZE | math.floor(y * PER_METRE) & RING


@kernel
def indices_of(world: Record, cell: int) -> tuple[int, int]:
    """Return the column and the row of a cell of the window."""
    half = SIZE // 2
    i = world.column + (((cell // SIZE) - world.column + half) & RING) - half
    return i, world.row + (((cell & RING) - world.row + half) & RING) - half


@kernel
def neighbours(cell: int) -> tuple[int, int, int, int]:
    """Return the cells that share a side with a cell."""
    column, row = cell & ~RING, cell & RING
    right, left, up, down = (column + SIZE) & LAST, (column - SIZE) & LAST, (row + 1) & RING, (row - 1) & RING
    return right | row, left | row, column | up, column | down


@kernel
def _diagonal_neighbours(cell: int) -> tuple[int, int, int, int]:
    """Return the cells that share a corner with a cell, and no side."""
    column, row = cell & ~RING, cell & RING
    right, left, up, down = (column + SIZE) & LAST, (column - SIZE) & LAST, (row + 1) & RING, (row - 1) & RING
    return right | up, right | down, left | up, left | down


@kernel
def flood(
    world: Record,
    bits: NDArray[np.uint8],
    distance: NDArray[np.uint16],
    queue: NDArray[np.uint16],
    edge: NDArray[np.uint16],
    impassable: int,
) -> int:
    """Spread distances [cells] from the first cell of the queue, whose distance is 0; that of all others is FAR.

    Steps to four neighbours and to eight take turns, which makes circles octagons. No step leaves the window: the cells
    around it are unknown.

    Args:
      world: of type LOCAL_MAP.
      bits: of each cell.
      distance: of each cell; written to.
      queue: cells in the order in which they are reached, written to.
      edge: those of them that share a side with a cell that nobody has seen, in the same order; written to.
      impassable: bits of cells that are reached in the first _FREE_START steps only.

    Returns:
      How many cells there are in `edge`.
    """
    first, count, edges, level = 0, 1, 0, 0
    while first < count:
        end = count
        looked_at = np.uint8(OPEN | WAY_BACK | (impassable if level >= _FREE_START else 0))
        for index in range(first, end):
            unseen = np.uint8(0)
            for cell in neighbours(queue[index]):
                unseen |= bits[cell]
                if bits[cell] & looked_at == OPEN and distance[cell] == FAR:
                    distance[cell] = level + 1
                    queue[count] = cell
                    count += 1
            if level % 2 == 1:
                for cell in _diagonal_neighbours(queue[index]):
                    if bits[cell] & looked_at == OPEN and distance[cell] == FAR:
                        distance[cell] = level + 1
                        queue[count] = cell
                        count += 1
            if unseen & UNSEEN != 0:
                i, j = indices_of(world, queue[index])
                if abs(i - world.column) < EDGE and abs(j - world.row) < EDGE:
                    edge[edges] = queue[index]
                    edges += 1
        first = end
        level += 1
    return edges


@kernel
def dijkstra(
    bits: NDArray[np.uint8],
    distance: NDArray[np.uint16],
    distance_to_goal: NDArray[np.uint16],
    goal: NDArray[np.uint16],
    free: int,
) -> None:
    """Write the way to go [UNIT] from all free cells to the nearest cell of `goal`.

    Args:
      bits: of each cell.
      distance: of each cell, FAR; written to.
      distance_to_goal: (BLOCKS, BLOCKS) the least of the cells of each block, FAR; written to.
      goal: cells.
      free: how many cells are free.
    """
    heads = np.full(_BUCKETS, -1, np.int32)  # of the lists of cells that wait, by their way to go modulo _BUCKETS
    room = 2 * free + len(goal) + 8  # a cell is come upon once over a side and once over a corner, at most
    cells, links = np.empty(room, np.uint16), np.empty(room, np.int32)
    straight, diagonal = _costs(10), _costs(14)
    made, one = np.uintp(0), np.uintp(1)
    for cell in goal:
        distance[cell] = 0
        cells[made], links[made] = cell, heads[0]
        heads[0] = made
        made += one
    level, empty = 0, 0
    while empty < _BUCKETS and made <= np.uintp(room - 8):
        entry = heads[level & _BUCKET]
        if entry < 0:
            level, empty = level + 1, empty + 1
            continue
        empty = 0
        heads[level & _BUCKET] = links[entry]
        if distance[cells[entry]] != level:
            continue  # it was reached by a shorter way meanwhile
        column, row = cells[entry] // (2 * SIZE), (cells[entry] & RING) // 2
        if distance_to_goal[column, row] == FAR:  # the nearest cells come first
            distance_to_goal[column, row] = level
        for cell in neighbours(cells[entry]):
            cost = level + straight[bits[cell]]
            if cost < distance[cell]:
                distance[cell] = cost
                cells[made], links[made] = cell, heads[cost & _BUCKET]
                heads[cost & _BUCKET] = made
                made += one
        for cell in _diagonal_neighbours(cells[entry]):
            cost = level + diagonal[bits[cell]]
            if cost < distance[cell]:
                distance[cell] = cost
                cells[made], links[made] = cell, heads[cost & _BUCKET]
                heads[cost & _BUCKET] = made
                made += one


@kernel
def _costs(length: int) -> NDArray[np.int64]:
    """Return the costs of a step onto a cell by its bits [UNIT]: up to 4.5 times its length near a wall."""
    costs = np.full(256, FAR)
    for bits in range(256):
        if bits & (OPEN | WAY_BACK | AT_WALL) == OPEN:
            cost = length
            if bits & WITHIN_6 != 0:
                cost += cost // 2
            if bits & WITHIN_4 != 0:
                cost += cost // 2
            costs[bits] = 2 * cost if bits & NEAR_WALL != 0 else cost
    return costs
