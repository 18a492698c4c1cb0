"""Local map: what the scans of the last metres showed, on a grid that moves with the car, and the path behind it.

A scan shows what can be seen from one place. In a hairpin round a thin barrier the road ahead is hidden until the car
is in it, and what was seen a second ago is then behind the car. So the free ground and the walls of the last scans are
kept on a grid, by dead reckoning. Dead reckoning drifts: a cell is unknown again when the car has driven 16 to 18 m
since it was seen.

A scan is entered in two steps. The cells along its beams become free. Then the cells at the ends of its beams
become walls; ends of neighbouring beams that are close together are joined, because they lie apart where a beam
meets a wall at a small angle. The last observation counts, so that an obstacle that has moved on is forgotten when
its place is seen again.

The ends of beams close to the car are kept as they are, too: those of the last scan, and earlier ones beside and behind
the car, where no beam goes any more and a car that turns or reverses may touch a wall.

The path of the rear axle is kept with the room to its right and left, so that the way back can be closed (frontiers).

Source: H. Moravec and A. Elfes, High Resolution Maps from Wide Angle Sonar, IEEE ICRA 1985, for the grid. Its cells
have probabilities; these have three values.

The work is done in native/controllers/perception/local_map.cpp.
"""

from __future__ import annotations

import numpy as np

from fg_mujoco.native import core, record

SIZE = 256  # cells to a side; a power of two, so that `place & RING` is the place of a cell in the ring
RING = SIZE - 1
CELL = 0.1  # [m]
KIND, UNKNOWN, FREE, WALL = 3, 0, 1, 2
NEARNESS, WALL_IN_4, WALL_IN_2, WALL_IN_1 = 12, 4, 8, 12
"""Bits of a cell, see `mark_cells`: how near a wall was when they were last marked: within four cells, two or one."""

PATH = 160  # points of the path that are kept
RIGHT, LEFT, ALONG = range(3, 6)  # columns of the path, after x, y and heading; then its sine and cosine

LOCAL_MAP = record(
    "LocalMap",
    [
        ("begun", np.bool_),
        ("x", np.float64),  # [m] of the rear axle, by dead reckoning from where it began
        ("y", np.float64),  # [m]
        ("heading", np.float64),  # [rad]
        ("driven", np.float64),  # [m]
        ("along", np.float64),  # [m] along the path, of which pockets are cut off that the car has to leave again
        ("furthest", np.float64),  # [m] greatest `along`
        ("column", np.int64),  # of the cell of the rear axle
        ("row", np.int64),
        ("swept", np.int64),  # row that was last searched for old cells
        # by column and row in the ring; bits, from the lowest: 2 of KIND, 2 of NEARNESS, and 4 of when the cell was
        # seen: `driven` then, in 2 m modulo 16
        ("cells", np.uint8, (SIZE, SIZE)),
        # ring buffer: x, y [m], heading [rad], room to the right and left, along [m], sine and cosine of the heading
        ("path", np.float64, (PATH, 8)),
        ("newest", np.int64),  # index of the last point of the path
        ("known", np.int64),  # how many of them there are
        ("ends", np.float64, (720, 2)),  # [m] of beams that are close: the last scan's, after those it passed
        ("ends_known", np.int64),
    ],
)
"""Type of the memory; zero at the beginning."""

move, enter_scan = core.move, core.enter_scan
extend_path, cut_path, in_window = core.extend_path, core.cut_path, core.in_window
