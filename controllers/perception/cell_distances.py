"""Distances over the free cells of the local map: from one cell by steps, and to some cells by ways of least cost.

    count, edges = flood(world, bits, distance, queue, edge, impassable)
    dijkstra(bits, distance, distance_to_goal, goal, free, impassable)

A cell is one number, its column and row in the ring. Bits of cells are those of cell_marks.

Source: E. Dijkstra, A Note on Two Problems in Connexion with Graphs, Numerische Mathematik 1, 1959, with a ring of
buckets (R. Dial, Algorithm 360, CACM 12, 1969).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.compiled.kernels import kernel

from ..control.planner_settings import Record
from .cell_marks import NEAR_WALL, OPEN, UNSEEN, WAY_BACK, WITHIN_4, WITHIN_6
from .local_map import EDGE, PER_METRE, RING, SIZE

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
) -> tuple[int, int]:
    """Spread distances [cells] from the first cell of the queue; return how many cells were reached.

    Steps to four neighbours and to eight take turns, which makes circles octagons. No step leaves the window: the cells
    around it are unknown.

    Args:
      world: of type LOCAL_MAP.
      bits: of each cell.
      distance: of each cell, FAR but for the first of the queue; written to.
      queue: cells in the order in which they are reached, written to.
      edge: those of them that share a side with a cell that nobody has seen, in the same order; written to.
      impassable: bits of cells that are reached in the first _FREE_START steps only.

    Returns:
      How many cells there are in the queue, and in `edge`.
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
    return count, edges


@kernel
def dijkstra(
    bits: NDArray[np.uint8],
    distance: NDArray[np.uint16],
    distance_to_goal: NDArray[np.uint16],
    goal: NDArray[np.uint16],
    free: int,
    impassable: int,
) -> None:
    """Write the way to go [UNIT] from all free cells to the nearest cell of `goal`.

    Args:
      bits: of each cell.
      distance: of each cell, FAR; written to.
      distance_to_goal: (BLOCKS, BLOCKS) the least of the cells of each block, FAR; written to.
      goal: cells.
      free: how many cells are free.
      impassable: bits of cells that are no way, besides WAY_BACK.
    """
    heads = np.full(_BUCKETS, -1, np.int32)  # of the lists of cells that wait, by their way to go modulo _BUCKETS
    room = 2 * free + len(goal) + 8  # a cell is come upon once over a side and once over a corner, at most
    cells, links = np.empty(room, np.uint16), np.empty(room, np.int32)
    straight, diagonal = _costs(10, WAY_BACK | impassable), _costs(14, WAY_BACK | impassable)
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
def _costs(length: int, impassable: int) -> NDArray[np.int64]:
    """Return the costs of a step onto a cell by its bits [UNIT]: up to 4.5 times its length near a wall."""
    costs = np.full(256, FAR)
    for bits in range(256):
        if bits & (OPEN | impassable) == OPEN:
            cost = length
            if bits & WITHIN_6 != 0:
                cost += cost // 2
            if bits & WITHIN_4 != 0:
                cost += cost // 2
            costs[bits] = 2 * cost if bits & NEAR_WALL != 0 else cost
    return costs
