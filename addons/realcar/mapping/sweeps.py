"""The scans of a drive in their order, each with where the LiDAR was."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from fg_mujoco.messages import FloatArray, LaserScan


@dataclass(frozen=True, kw_only=True, eq=False)
class Sweeps:
    """Scans in their order, with the pose of the LiDAR at each.

    Attributes:
      scans: with bearings of the car.
      times: of the last beam of each [s], from the first scan of the bag on.
      poses: of the LiDAR, turned as the car is: x [m], y [m], heading [rad]. Shape (n, 3).
      offset: of the LiDAR from base_link, to the front and to the left [m].
      source: where the poses are from, in words.
      drifts: whether the poses drift.
      track: times [s] and poses, shape (m, 4), of which `poses` are interpolated.
      left_out: how many scans of the bag are not among these, by the reason.
    """

    scans: list[LaserScan]
    times: FloatArray
    poses: FloatArray
    offset: tuple[float, float]
    source: str
    drifts: bool
    track: FloatArray
    left_out: Mapping[str, int] = field(default_factory=dict)

    def beam_poses(self, index: int, corrected: FloatArray | None = None) -> FloatArray:
        """Return the pose of the LiDAR at each beam of a scan, shape (beams, 3).

        Args:
          index: of the scan.
          corrected: its pose (3,), in place of that of the source, whose motion within the scan counts all the same.
        """
        scan, pose = self.scans[index], self.poses[index]
        count, delay = len(scan.ranges), scan.time_increment
        anchor = pose if corrected is None else corrected
        if delay == 0.0:
            return np.tile(anchor, (count, 1))
        beams = np.arange(count)
        before = delay * (count - 1 - beams) if delay > 0.0 else -delay * beams  # [s] before the last beam
        found = interpolated(self.track, self.times[index] - before)
        if corrected is None:
            return found
        turn = corrected[2] - pose[2]
        c, s = math.cos(turn), math.sin(turn)
        x, y = found[:, 0] - pose[0], found[:, 1] - pose[1]
        moved = (anchor[0] + c * x - s * y, anchor[1] + s * x + c * y, found[:, 2] + turn)
        return np.column_stack(moved)


def interpolated(track: FloatArray, times: FloatArray) -> FloatArray:
    """Return poses (n, 3) at times of a track (m, 4) of times and poses; before its first and after its last, those."""
    return np.column_stack([np.interp(times, track[:, 0], track[:, column]) for column in (1, 2, 3)])
