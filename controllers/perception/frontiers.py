"""Selects the frontier to drive to, and computes each free cell's distance to it.

    free = mark_cells(world, bits)
    bits[i & RING, j & RING] & WAY_BACK  # whether the cell is closed
    dijkstra(bits, distance, distance_to_goal, goal, free)

1. The path driven is closed like a wall, across the corridor, over its last 15 m.
2. From the car, distances spread over the free ground of the local map. Where they reach ground that nobody has
   seen is a frontier. The frontier that is far and wide is selected. A pocket that was seen to its end has none.
3. Where there is no frontier, the car may go round a course as short as its memory: then the goal is the far side
   of the closed path, which the car reaches from behind. Else it is in a pocket, and the end of its path is opened
   again, 2, 4 and 6 m of it.
4. From the frontier, distances spread back over the free ground. Ground near a wall counts as longer, so that the
   shortest way goes round the end of a barrier on a circle and not along it. Of each block of two by two cells the
   least distance is kept.

Cells are marked first: which are free or unknown, and how near walls are. For distances a cell is one number: its
column in the ring times SIZE, and its row.

Sources: B. Yamauchi, A Frontier-Based Approach for Autonomous Exploration, IEEE CIRA 1997; E. Dijkstra, A Note on Two
Problems in Connexion with Graphs, Numerische Mathematik 1, 1959, with a ring of buckets (R. Dial, Algorithm 360, CACM
12, 1969).

Limits: a wide opening into a pocket whose end the car does not see yet is taken for a frontier.

The work is done in native/controllers/perception/frontiers.cpp and cells.cpp.
"""

from __future__ import annotations

import numpy as np

from fg_mujoco.native import core, record

from .local_map import LOCAL_MAP, SIZE

WAY_BACK = 2
"""Bit of a cell that is closed by `search_frontier`; the others are in native/controllers/perception/cells.hpp."""
FAR = 65535
"""Distance of a cell to which no way is known."""
BLOCKS = SIZE // 2
"""Blocks of two by two cells to a side: of each of them one distance to the goal is kept."""

mark_cells, cell_at, dijkstra = core.mark_cells, core.cell_at, core.dijkstra


FRONTIER_SEARCH = record(
    "FrontierSearch",
    [
        ("map", LOCAL_MAP),
        ("ticks", np.int64),
        ("entered", np.int64),  # tick in which a scan was last entered,
        ("entered_driven", np.float64),  # [m] how far the car had driven then,
        ("entered_heading", np.float64),  # [rad] and its heading
        ("searched", np.int64),  # tick of the last search,
        ("searched_driven", np.float64),  # [m] and how far the car had driven then
        ("marked", np.int64),  # tick in which walls were last marked
        ("found", np.bool_),
        ("hidden", np.bool_),  # the frontier is nearer than the sight, so something hides what is behind it
        ("x", np.float64),  # [m] of the middle of the frontier
        ("y", np.float64),
        # [0.01 m] of blocks of two by two cells, by half the column and the row in the ring; FAR: not known
        ("distance_to_goal", np.uint16, (BLOCKS, BLOCKS)),
        ("nodes", np.int64),  # of all searches for a motion in this tick
    ],
)
"""Type of the memory; zero at the beginning."""

search_frontier = core.search_frontier
