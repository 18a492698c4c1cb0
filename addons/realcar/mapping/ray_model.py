"""Occupancy of a grid by scans from known poses: what a beam went through is free, where it ended is occupied.

    grid = LogOdds.around(poses, reach=15.0, resolution=0.05)
    grid.add(beam_poses, bearings, ranges)
    grid.cells()

Each cell has log odds, and each scan adds to a cell once: a hit where a beam ended in it, else a miss where one went
through. So a wall that beams pass at a small angle stays closed. Beams that saw nothing, or nothing nearer than the
reach, count up to the reach or not at all: what a LiDAR does not see may be black or glass.

Sources: H. Moravec, A. Elfes, ICRA 1985; S. Thrun, W. Burgard, D. Fox, Probabilistic Robotics, 2005, chapter 9; hits
before misses as in Cartographer (W. Hess et al., ICRA 2016).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.course.maps.map_server import FREE, OCCUPIED, UNKNOWN
from fg_mujoco.errors import BagError
from fg_mujoco.messages import FloatArray

HIT, MISS = math.log(0.7 / 0.3), math.log(0.4 / 0.6)
_LEAST, _GREATEST = -4.0, 4.0  # of log odds
_FREE_BELOW, _OCCUPIED_ABOVE = -0.3, 0.1
_MOST_CELLS = 4000**2


@dataclass(kw_only=True, eq=False)
class LogOdds:
    """Log odds of cells, row 0 below."""

    odds: FloatArray  # (rows, columns)
    resolution: float  # [m]
    origin: FloatArray  # (2,) [m] lower left corner of the first cell
    reach: float  # [m]
    _seen: NDArray[np.int64] = field(init=False)  # of each cell, the last scan that hit it, or minus that which missed
    _scans: int = 0

    def __post_init__(self) -> None:
        self._seen = np.zeros(self.odds.shape, np.int64)

    @classmethod
    def around(cls, poses: FloatArray, *, reach: float, resolution: float) -> LogOdds:
        """Return an empty grid round poses (n, 3) of a LiDAR that sees up to `reach` [m].

        Raises:
          BagError: it would have more than 16 million cells.
        """
        low = np.floor((poses[:, :2].min(axis=0) - reach) / resolution) - 2
        columns, rows = (np.ceil((poses[:, :2].max(axis=0) + reach) / resolution) + 2 - low).astype(int).tolist()
        if columns * rows > _MOST_CELLS:
            size = f"{columns * resolution:.0f} m by {rows * resolution:.0f} m"
            raise BagError(f"the map would be of {size} at {resolution} m; accepted: {_MOST_CELLS} cells at most")
        return cls(odds=np.zeros((rows, columns)), resolution=resolution, origin=low * resolution, reach=reach)

    def add(self, poses: FloatArray, bearings: FloatArray, ranges: FloatArray) -> None:
        """Add a scan.

        Args:
          poses: of the LiDAR at each beam, x [m], y [m], heading [rad]. Shape (n, 3).
          bearings: of the beams [rad]. Shape (n,).
          ranges: as REP 117 has them [m]. Shape (n,).
        """
        self._scans += 1
        _add_scan(self.odds, self._seen, self._scans, self.origin, self.resolution, self.reach, poses, bearings, ranges)

    def cells(self) -> NDArray[np.int8]:
        """Return FREE, OCCUPIED or UNKNOWN of each cell."""
        cells = np.full(self.odds.shape, UNKNOWN, np.int8)
        cells[self.odds < _FREE_BELOW] = FREE
        cells[self.odds > _OCCUPIED_ABOVE] = OCCUPIED
        return cells


@kernel
def _add_scan(
    odds: FloatArray,
    seen: NDArray[np.int64],
    scan: int,
    origin: FloatArray,
    resolution: float,
    reach: float,
    poses: FloatArray,
    bearings: FloatArray,
    ranges: FloatArray,
) -> None:
    rows, columns = odds.shape
    for i in range(len(ranges)):
        if ranges[i] > 0.0 and ranges[i] <= reach:  # of NaN and -inf neither
            angle = poses[i, 2] + bearings[i]
            column = math.floor((poses[i, 0] + ranges[i] * math.cos(angle) - origin[0]) / resolution)
            row = math.floor((poses[i, 1] + ranges[i] * math.sin(angle) - origin[1]) / resolution)
            if 0 <= row < rows and 0 <= column < columns and seen[row, column] != scan:
                seen[row, column] = scan
                odds[row, column] = min(odds[row, column] + HIT, _GREATEST)
    for i in range(len(ranges)):
        if not (ranges[i] > 0.0 and ranges[i] < math.inf):
            continue
        angle = poses[i, 2] + bearings[i]
        length = min(ranges[i], reach) / resolution
        x, y = (poses[i, 0] - origin[0]) / resolution, (poses[i, 1] - origin[1]) / resolution
        ahead_x, ahead_y = math.cos(angle), math.sin(angle)
        row, column = math.floor(y), math.floor(x)
        step_row, step_column = (1 if ahead_y > 0.0 else -1), (1 if ahead_x > 0.0 else -1)
        per_row = 1.0 / abs(ahead_y) if ahead_y != 0.0 else math.inf
        per_column = 1.0 / abs(ahead_x) if ahead_x != 0.0 else math.inf
        to_row = ((row + 1 - y) if step_row > 0 else (y - row)) * per_row if ahead_y != 0.0 else math.inf
        to_column = ((column + 1 - x) if step_column > 0 else (x - column)) * per_column if ahead_x != 0.0 else math.inf
        at = 0.0
        while at < length:
            following = min(to_row, to_column)
            if following >= length and ranges[i] <= reach:
                break  # the cell in which it ended
            if 0 <= row < rows and 0 <= column < columns and seen[row, column] != scan and seen[row, column] != -scan:
                seen[row, column] = -scan
                odds[row, column] = max(odds[row, column] + MISS, _LEAST)
            at = following
            if to_row < to_column:
                to_row += per_row
                row += step_row
            else:
                to_column += per_column
                column += step_column
