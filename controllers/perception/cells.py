"""Cells of the local map: which are free or unknown and how near walls are, and distances over the free ones.

    free = mark_cells(world, bits)
    bits[i & RING, j & RING] & WAY_BACK  # whether the cell is closed
    dijkstra(bits, distance, distance_to_goal, goal, free)

For distances a cell is one number: its column in the ring times SIZE, and its row.

Source: E. Dijkstra, A Note on Two Problems in Connexion with Graphs, Numerische Mathematik 1, 1959, with a ring of
buckets (R. Dial, Algorithm 360, CACM 12, 1969).

The work is done in native/controllers/perception/cells.cpp.
"""

from __future__ import annotations

from fg_mujoco.native import core

from .local_map import SIZE

WAY_BACK = 2
"""Bit of a cell that is closed by `frontiers`; the others are in native/controllers/perception/cells.hpp."""
FAR = 65535
"""Distance of a cell to which no way is known."""
BLOCKS = SIZE // 2
"""Blocks of two by two cells to a side: of each of them one distance to the goal is kept."""

mark_cells, cell_at, dijkstra = core.mark_cells, core.cell_at, core.dijkstra
