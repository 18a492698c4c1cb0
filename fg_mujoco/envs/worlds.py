"""The worlds under an environment: cars that are placed, driven for a tick, and sensed, each in its own time.

`OneWorld` is a Simulation; `environment_batch.ManyWorlds` steps many in C threads. Both give the same bits.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..course.lap_timer import first_seen, fresh_timers
from ..lidar.effects import LidarEffects, ScanPipeline
from ..messages import ODOMETRY, FloatArray
from ..simulation.scenario import Start
from ..simulation.simulation import Simulation
from ..simulation.termination import Referee
from ..simulation.world import World
from ..vehicle.motion import CarArray, read_odometry
from ..vehicle.tire_slip import greatest_slip
from .settings import EnvironmentSettings

Mask = NDArray[np.bool_]


class EpisodeReferee(Referee):
    """A referee whose races begin anew, each for itself. None runs before its first beginning."""

    def begin(self, which: Mask, times: FloatArray, qpos: FloatArray, qvel: FloatArray, crashed: Mask) -> None:
        """Begin the races `which` (n,) where their cars are now; the other arguments are those of `judge`."""
        first = int(self._cars["free_qpos"][0])
        timers = fresh_timers(int(which.sum()))
        first_seen(timers, self._track, qpos[which, first : first + 2])
        self.timers[which] = timers
        self.lap_times[which] = self._standing_since[which] = math.nan
        others, self.running = self.running & ~which, which.copy()  # a timer is told of a moment only once
        self.judge(times, qpos, qvel, np.zeros_like(which), crashed)
        self.running |= others


class Worlds(Protocol):
    """What an environment wants of its worlds. Arrays are overwritten by the next call; (n,) is one for each world."""

    world: World  # what they share
    period: float  # [s] of a tick
    referee: EpisodeReferee  # laps, which worlds run, and why they ended
    times: FloatArray  # (n,) [s] since the beginning
    crashed: Mask  # (n,) whether the chassis has touched anything since
    sliding: FloatArray  # (n,) share of the last tick's physics steps in which any tire slid
    ranges: FloatArray  # (n, beams) [m] as in LaserScan, last sensed
    odometry: NDArray[np.void]  # (n,) of ODOMETRY, last sensed

    def begin(self, which: Mask, starts: Sequence[Start], seeds: Sequence[int]) -> None:
        """Place the cars of the worlds `which` (n,); one start and one seed of the LiDAR's noise for each of them."""

    def drive(self, commands: FloatArray) -> None:
        """Hold the commands (n, 2) [rad, m/s] for a tick in the worlds that run, and judge their races."""

    def sense(self, which: Mask) -> None:
        """Take the scans and odometry of the worlds `which` (n,); once for each moment."""

    def state(self, i: int) -> FloatArray:
        """Return the complete state of world i (mjSTATE_INTEGRATION), as Simulation.state."""

    def close(self) -> None:
        """Let go of threads."""


def make_referee(worlds: Worlds, settings: EnvironmentSettings, cars: CarArray, qpos: FloatArray) -> EpisodeReferee:
    """Return the referee of some worlds whose cars (n,) of CAR are at `qpos` (n, nq)."""
    course = worlds.world.track
    referee = EpisodeReferee(
        course,
        cars,
        laps=settings.laps,
        time_limit=settings.time_limit or course.longest_race(settings.laps),
        period=worlds.period,
        qpos=qpos,
    )
    referee.running[:] = False
    return referee


class OneWorld:
    """A single world, in the calling thread.

    Args:
      settings: of the environment.
      simulation: of the world; None: a new one.

    Attributes:
      simulation: the Simulation.
      And those of `Worlds`.
    """

    def __init__(self, settings: EnvironmentSettings, simulation: Simulation | None = None) -> None:
        self.simulation = simulation or Simulation(settings.make_world())
        self.world, self.period = self.simulation.world, self.simulation.period
        self._effects = settings.effects
        self._pipeline: ScanPipeline | None = None
        self.times, self.sliding = np.zeros(1), np.zeros(1)
        self.crashed, self._unstable = np.zeros(1, np.bool_), np.zeros(1, np.bool_)
        self.ranges = np.empty((1, len(self.simulation.lidar.beams.bearings)))
        self.odometry = np.zeros(1, ODOMETRY)
        self._greatest = np.empty(8)
        data = self.simulation.data
        self._qpos, self._qvel = data.qpos[np.newaxis], data.qvel[np.newaxis]  # views of the state
        self.referee = make_referee(self, settings, self.world.car.constants, self._qpos)

    def begin(self, which: Mask, starts: Sequence[Start], seeds: Sequence[int]) -> None:
        """Place the car."""
        simulation = self.simulation
        simulation.reset(**vars(starts[0]))
        if self._effects != LidarEffects():
            self._pipeline = ScanPipeline(simulation.lidar, self._effects, np.random.default_rng(seeds[0]))
        self.times[0], self.crashed[0], self.sliding[0] = simulation.time, simulation.crashed, 0.0
        self.referee.begin(which, self.times, self._qpos, self._qvel, self.crashed)

    def drive(self, commands: FloatArray) -> None:
        """Hold the command for a tick, and judge the race."""
        self.simulation.drive(*commands[0].tolist())
        self.judge()

    def judge(self) -> None:
        """Judge the race after a tick that the simulation was driven for."""
        simulation = self.simulation
        self.sliding[0] = greatest_slip(simulation.slip_values, self._greatest) / simulation.substeps
        self.times[0], self.crashed[0], self._unstable[0] = (
            simulation.data.time, simulation.crashed, simulation.unstable,
        )  # fmt: skip
        self.referee.judge(self.times, self._qpos, self._qvel, self._unstable, self.crashed)

    def sense(self, which: Mask) -> None:
        """Take the scan and odometry."""
        simulation = self.simulation
        data = simulation.data
        read_odometry(
            data.time, data.qpos, data.qvel, data.sensordata, self.world.car.constants, self.odometry
        )  # fmt: skip
        self.ranges[0] = simulation.lidar.ranges(data) if self._pipeline is None else self._pipeline.scan(data).ranges

    def state(self, i: int) -> FloatArray:
        """Return the complete state."""
        return self.simulation.state

    def close(self) -> None:
        """Nothing to let go of."""
