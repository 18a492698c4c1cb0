"""The worlds under an environment: cars that are placed, driven for a tick, and sensed, each in its own time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..messages import FloatArray
from ..simulation.engine import Engine
from ..simulation.settings import Start
from ..simulation.telemetry import TELEMETRY
from .settings import EnvironmentSettings

Mask = NDArray[np.bool_]

_SLIDING_STEPS = TELEMETRY.index("sliding_steps")


class Worlds:
    """Worlds of one engine whose episodes begin anew one by one, while the others go on.

    Arrays are overwritten by the next call; (n,) is one for each world.

    Args:
      settings: of the environment.
      count: how many worlds, n.
      threads: that drive them.
      engine: of the worlds; None: a new one.

    Attributes:
      engine: as given, or the new one.
      world: the World that they share.
      period: of a tick [s].
      monitor: of the episodes: laps, which run, and why they ended.
      crashed: whether the chassis has touched anything since the beginning, (n,).
      sliding: share of the last tick's physics steps in which any tire slid, (n,).
      ranges: last sensed, (n, beams) [m] as in LaserScan.
      odometry: last sensed, (n,) of ODOMETRY.
    """

    def __init__(
        self, settings: EnvironmentSettings, count: int = 1, threads: int = 1, engine: Engine | None = None
    ) -> None:
        self.engine = engine or settings.make_engine(count, threads)
        self.world, self.period, self.monitor = self.engine.world, self.engine.period, self.engine.monitor
        self.crashed, self.ranges, self.odometry = self.engine.crashed, self.engine.ranges, self.engine.odometry
        self._effects = settings.effects
        self.sliding = np.zeros(count)

    @property
    def times(self) -> FloatArray:
        """Simulated since the beginning of each episode. Shape (n,) [s]."""
        return self.engine.times

    def begin(self, which: Mask, starts: Sequence[Start], seeds: Sequence[int]) -> None:
        """Place the cars of the worlds `which` (n,); one start and one seed of the LiDAR's noise for each of them."""
        self.engine.place(starts, which, effects=[self._effects] * len(starts), seeds=seeds)
        self.sliding[which] = 0.0

    def drive(self, commands: FloatArray) -> None:
        """Hold the commands (n, 2) [rad, m/s] for a tick in the worlds that run, and judge their races."""
        self.engine.commands[:] = commands
        self.engine.drive()
        self.judge()

    def judge(self) -> None:
        """Judge the races after a tick that the engine was driven for."""
        np.divide(
            self.engine.telemetry[:, _SLIDING_STEPS], self.engine.substeps, out=self.sliding, where=self.monitor.running
        )
        self.engine.judge()

    def sense(self, which: Mask) -> None:
        """Take the scans and odometry of the worlds `which` (n,); once for each moment."""
        self.engine.sense(which)

    def state(self, i: int) -> FloatArray:
        """Return the complete state of world i (mjSTATE_INTEGRATION), a copy."""
        return self.engine.state(i).copy()

    def close(self) -> None:
        """Let go of threads."""
        self.engine.close()
