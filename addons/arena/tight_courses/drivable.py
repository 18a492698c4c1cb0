"""Decides whether a car can drive a lap by a search over its forward motions.

    poses = drivable_lap(track)    # (n, 3), or None where there is no way

The search is over the states of hybrid A*, but depth first (Dolgov et al. 2010). From the start pose the car drives
arcs of length `STEP`, each with one of five curvatures up to full lock. Of all free poses in one cell of position and
heading the first is kept. A pose is free if the footprint, grown by a margin all round, touches no wall. A way that
falls back along the centreline by 0.8 m is given up, so that the car drives neither in circles nor the wrong way round.
A lap is found when the progress reaches the length of the track.

A way that is returned is a proof. A search that ends without one has tried every cell: it may miss a way that needs
poses finer than the cells.
"""

from __future__ import annotations

import numpy as np

from fg_mujoco.course.course import outline
from fg_mujoco.course.track import Track
from fg_mujoco.messages import FloatArray
from fg_mujoco.native import core

MARGIN: float = core.DRIVABLE_MARGIN  # [m] all round the footprint
STEP: float = core.DRIVABLE_STEP  # [m] that the rear axle drives between two poses


def drivable_lap(track: Track) -> FloatArray | None:
    """Return poses of a lap that `f1tenth` can drive forward, from the start of a track and over its line again.

    Returns:
      x [m], y [m] of the rear axle and heading [rad], every `STEP`, shape (n, 3); None where no lap was found.
    """
    walls = np.concatenate([outline(edge) for edge in track.edges])
    poses = core.drivable_lap(walls, np.array(track.start_pose()), track.table, track.length)
    return poses if len(poses) else None
