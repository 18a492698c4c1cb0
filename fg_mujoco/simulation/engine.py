"""The engine: n worlds of m cars, stepped together in lockstep.

    engine = Engine(World("oval"), 64, laps=1)
    engine.place([Start(s=0.5 * i) for i in range(64)])
    while engine.running.any():
        engine.sense()
        engine.decide()
        engine.drive()
        engine.judge()

`engine.tick()` does the four, in one compiled call where planners are compiled, at the same bits.

Arrays have one row a car: the m cars of world 0, then those of world 1. A race is an engine of one world; rollouts and
environments are engines of many. Each world's result is the same, bit for bit, whatever the others are.
"""

from __future__ import annotations

import math
import time
from bisect import bisect_left
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..arguments import Uncopied
from ..compiled.array_table import Table
from ..display import brief
from ..errors import ModelError, SettingsError
from ..lidar.beams import Beams
from ..lidar.effects import LidarEffects
from ..lidar.lidar import Lidar
from ..messages import NO_READINGS, FloatArray, LaserScan, Reading, Readings
from ..vehicle.car import Car
from ..vehicle.changes import CarChanges
from ..vehicle.motion import drift_odometry, ground_speed, point_motion
from .cars import car_prefix
from .compiled_tick import DRIVEN, NO_NUMBERS, NOTHING_KEPT, drive_all, judge_all, read_all, read_times, sense_all
from .physics import span_of
from .planner_adapter import BatchPlanners, Calls, OtherCar, Planners, Reasons, Surroundings
from .planner_failure import is_of_planner
from .settings import Start
from .termination import END_REASONS, RaceMonitor
from .world import World
from .world_batch import CarArrays, Mask, WorldBatch

if TYPE_CHECKING:  # imported where a car or a world has them
    from ..lidar.scan_pipeline import EffectsOfRows, ScanPipeline
    from ..vehicle.sensors import CarState, Sampler, Sensor
    from .cars_alone import CarsAlone
    from .slots import Slots

Hook = Callable[["Engine", NDArray[np.int64]], None]
"""Called with the engine and the worlds that are being stepped."""

_FINISHED = END_REASONS.index("finished")
_WORLDS_A_THREAD = 4  # fewer are driven sooner than a thread is woken


class Clock(Protocol):
    """Times decisions."""

    limit: float  # of a decision [s]; inf: none

    def time(self, decide: Callable[[], None]) -> None:
        """Call what decides, and note how long it took."""

    def note(self, seconds: float) -> None:
        """Note how long a decision took; raise where that is longer than the limit."""


class Keeper(Protocol):
    """Keeps ticks."""

    def append(self) -> None:
        """Keep the tick that was driven."""

    def room(self) -> Table:
        """Return a table of compiled_tick.KEPT with room for another tick."""


class Engine(Uncopied):
    """n worlds of m cars.

    Args:
      world: that all share, or one for each world, with the same LiDAR. Worlds that are the same object and stand next
        to each other are driven together.
      count: how many worlds, n; as many as there are, where each has its own.
      changes: what differs in each car, (r,); None: nothing.
      laps: to be driven.
      time_limit: of simulated time [s]; None: that of the course.
      period: of a tick [s]; None: the LiDAR's.
      threads: that drive the worlds.
      own_model: step `world.model` itself, so that changes to it take effect; else a copy.

    Attributes:
      beams: of the LiDARs.
      count: how many worlds, n.
      cars_per_world: m.
      period: time that a tick takes [s].
      substeps: physics steps of a tick.
      odometry, ranges, commands, mu, crashed, touched_at, failed, telemetry, statistics: of the cars, as in CarArrays;
        r is n m.
      scans: of the cars whose LiDAR has effects, last sensed, by row.
      room: for how many worlds a model is compiled that `rebuild_worlds` puts in places; each thread has its own.
      no_messages: whether the ranges of a car are all that is read of its scans, so that they are not in `scans`, from
        when it is placed on, (r,); False unless somebody says so.
      monitor: RaceMonitor of the races.
      planners: whose `decide` is called; None: somebody else writes the commands.
      before_substep: hooks that act before each physics step. What they write to `state` is stepped from.
      after_substep: hooks that act after each.

    Raises:
      ModelError: a timestep that does not divide the period.
      SettingsError: worlds with different LiDARs.
    """

    def __init__(
        self,
        world: World | Sequence[World],
        count: int = 1,
        *,
        changes: Sequence[CarChanges] | None = None,
        laps: int = 1,
        time_limit: float | None = None,
        period: float | None = None,
        threads: int = 1,
        own_model: bool = False,
    ) -> None:
        worlds = [world] * count if isinstance(world, World) else list(world)
        self.count, self.cars_per_world = len(worlds), len(worlds[0].cars)
        self.beams: Beams = worlds[0].lidar.beams
        self.period = self.beams.period if period is None else period
        self.substeps = whole_steps(self.period, worlds[0].model.opt.timestep)
        self._time_limit, self._own_model = time_limit, own_model
        cars = self.count * self.cars_per_world
        self._arrays, self.monitor = (
            CarArrays.of(cars, len(self.beams.bearings), self.cars_per_world),
            RaceMonitor(cars, laps),
        )
        self._ends_of_shares = _ends_of_shares(self.count, threads)
        self._slots: dict[tuple[int, World], Slots] = {}  # of each share
        self._in_slots: set[WorldBatch] = set()
        self._alone: dict[tuple[int, str], CarsAlone] = {}  # of each share, by their text
        self.room = 1
        batches = [self._batch(worlds[part.start], part) for part in _parts(worlds, self._ends_of_shares)]
        self._take_batches(batches)
        self._changes = None if changes is None else list(changes)
        for batch in self._batches:
            self._change(batch)
        self._pool = ThreadPoolExecutor(threads) if threads > 1 and self.count >= 2 * _WORLDS_A_THREAD else None

        arrays = self._arrays
        self.odometry, self.ranges, self.commands, self.mu = arrays.odometry, arrays.ranges, arrays.commands, arrays.mu
        self.crashed, self.failed, self.running = arrays.crashed, arrays.failed, self.monitor.running
        self.telemetry, self.statistics, self.touched_at = arrays.telemetry, arrays.statistics, arrays.touched_at
        self.scans: dict[int, LaserScan] = {}
        self.planners: Planners | None = None
        self.before_substep: list[Hook] = []
        self.after_substep: list[Hook] = []
        self.no_messages = np.zeros(cars, np.bool_)
        self._pipelines: dict[int, ScanPipeline] = {}
        self._row_effects: EffectsOfRows | None = None
        self._samplers: dict[int, list[Sampler]] = {}
        self._odometry_drift = np.zeros(cars)
        self._drifts = False
        self._data: dict[int, mujoco.MjData] = {}
        self._driven = np.zeros(cars, np.bool_)
        self._calls: Calls | None = None

    def __repr__(self) -> str:
        return brief(self, f"{self.count} worlds", f"tick {self.period:g} s of {self.substeps} steps", repr(self.world))

    def _batch(self, world: World, worlds: slice, room: int = 1, alone: CarsAlone | None = None) -> WorldBatch:
        """Return the batch of some consecutive worlds, see WorldBatch.

        Raises:
          ModelError, SettingsError: another timestep, or another LiDAR.
        """
        if world.lidar.beams.geometry != self.beams.geometry and world.lidar.beams is not self.beams:
            raise SettingsError("the worlds of an engine have different LiDARs; accepted: the same beams in all")
        if len(world.cars) != self.cars_per_world:
            numbers = f"{self.cars_per_world} and {len(world.cars)}"
            raise SettingsError(f"the worlds of an engine have {numbers} cars; accepted: the same number in all")
        if whole_steps(self.period, world.model.opt.timestep) != self.substeps:
            raise ModelError(f"timestep is {world.model.opt.timestep} s; accepted: the same in all worlds of an engine")
        return WorldBatch(
            world, worlds, self.cars_per_world, self._arrays, self.monitor, substeps=self.substeps, period=self.period,
            time_limit=self._time_limit, own_model=self._own_model, room=room,
            alone=alone,
        )  # fmt: skip

    def _take_batches(self, batches: Sequence[WorldBatch]) -> None:
        """Have these batches, in the order of their worlds, and share them out to the threads."""
        self._batches = list(batches)
        self._batch_of = [batch for batch in batches for _ in range(batch.worlds.start, batch.worlds.stop)]
        self._called: Planners | None = None  # whose calls the next are
        shares: list[list[WorldBatch]] = [[] for _ in self._ends_of_shares]
        for batch in batches:
            shares[self._share_of(batch.worlds)].append(batch)
        for share in shares:  # those of one World follow each other, so that what they share is in the cache then
            share.sort(key=lambda batch: id(batch.world))
        self._shares = [
            Share(
                np.array([batch.table_address for batch in share], np.int64),
                np.array([batch.rows.start for batch in share], np.int64),
            )
            for share in shares
        ]

    def _change(self, batch: WorldBatch) -> None:
        if self._changes is not None:
            batch.change(self._changes[batch.rows])

    @property
    def world(self) -> World:
        """The first world, and where all share one, that one."""
        return self._batches[0].world

    def world_of(self, i: int) -> World:
        """Return world i."""
        return self._place_of(i)[0].world

    @property
    def cars(self) -> list[Car]:
        """The car of each row."""
        return [car for batch in self._batches for car in batch.cars]

    @property
    def lidar(self) -> Lidar:
        """The LiDAR of world 0, which measures without effects, in data of its model."""
        return self._batches[0].lidar(0)

    @property
    def times(self) -> FloatArray:
        """Simulated in each world since its cars were placed, a copy. Shape (n,) [s]."""
        times = np.empty(self.count)
        for share in self._shares:
            read_times(share.tables, share.firsts, times)
        return times

    def time(self, i: int) -> float:
        """Return the time simulated in world i since its cars were placed [s]."""
        batch, place = self._place_of(i)
        return float(batch.physics.states[place, batch.layout.time])

    def unstable(self, i: int) -> bool:
        """Return whether MuJoCo has met a bad state in world i since it was placed, and so reset it by itself."""
        batch, place = self._place_of(i)
        return batch.physics.has_warned(place)

    def state(self, i: int) -> FloatArray:
        """Return the complete state of world i (mjSTATE_INTEGRATION). Live: what is written there is driven from."""
        batch, place = self._place_of(i)
        row: FloatArray = batch.physics.states[place]
        return row

    def qpos(self, i: int) -> FloatArray:
        """Return the positions of world i, (nq,) as in mujoco.MjData. Live."""
        first, end = self._place_of(i)[0].layout.qpos
        return self.state(i)[first:end]

    def qvel(self, i: int) -> FloatArray:
        """Return the velocities of world i, (nv,) as in mujoco.MjData. Live."""
        first, end = self._place_of(i)[0].layout.qvel
        return self.state(i)[first:end]

    def ctrl(self, i: int) -> FloatArray:
        """Return the controls of world i's actuators. Live."""
        first, end = self._place_of(i)[0].layout.ctrl
        return self.state(i)[first:end]

    def part_of_state(self, i: int, part: mujoco.mjtState) -> FloatArray:
        """Return a part of the state of world i, such as mujoco.mjtState.mjSTATE_QFRC_APPLIED. Live."""
        first, end = span_of(self.world_of(i).model, part)
        return self.state(i)[first:end]

    def free_joint(self, row: int) -> tuple[FloatArray, FloatArray]:
        """Return position and quaternion (7,) of a car's base_link [m], and its velocity (2,) [m/s], in the world."""
        i, car = row // self.cars_per_world, self._arrays.constants[row]
        qpos, qvel = int(car["free_qpos"]), int(car["free_dof"])
        return self.qpos(i)[qpos : qpos + 7].copy(), self.qvel(i)[qvel : qvel + 2].copy()

    def speed(self, row: int) -> float:
        """Return the true speed of a car along its heading [m/s], forward positive."""
        i = row // self.cars_per_world
        return ground_speed(self.qpos(i), self.qvel(i), self._arrays.constants[row : row + 1])

    def read_motions(self, which: Mask, poses: FloatArray, velocities: FloatArray) -> None:
        """Write the true poses (r, 3) and velocities (r, 3) of the cars `which` (r,), see `motion.read_motions`."""
        for batch in self._batches:
            batch.read_motions(which[batch.rows], poses[batch.rows], velocities[batch.rows])

    def surroundings(self, row: int) -> Surroundings:
        """Return the surroundings of a car: its world, and the poses of its other cars."""
        i, own = divmod(row, self.cars_per_world)
        qpos, qvel, others = self.qpos(i), self.qvel(i), []
        for other in range(row - own, row - own + self.cars_per_world):
            if other != row:
                car = self._arrays.constants[other : other + 1]
                x, y, heading, speed, _, yaw_rate = point_motion(qpos, qvel, 0.0, car)
                others.append(OtherCar(pose=(x, y, heading), speed=speed, yaw_rate=yaw_rate))
        return Surroundings(world=self.world_of(i), others=tuple(others))

    def slip(self, i: int = 0) -> FloatArray:
        """Return the tire slip of the car that was driven last in the batch of world i, as TireSlip.values. Live.

        Shape (QUANTITIES, substeps, 4).
        """
        return self._place_of(i)[0].slip

    def records(self, i: int = 0) -> FloatArray:
        """Return the sensors of world i in each physics step of its last tick, (substeps, nsensordata). Live."""
        batch, place = self._place_of(i)
        found: FloatArray = batch.physics.records[place]
        return found

    def put(self, row: int, start: Start) -> None:
        """Put one car at a start, standing or rolling, while its world goes on.

        Its progress goes back or on by as much, and what it has driven stays counted.
        """
        batch, place = self._place_of(row // self.cars_per_world)
        batch.put(place, row % self.cars_per_world, start)

    def take_off(self, row: int) -> None:
        """Take a car off the course, where nobody sees it, for the race that begins: it is behind all others."""
        batch, place = self._place_of(row // self.cars_per_world)
        batch.take_off(place, row % self.cars_per_world)
        self.monitor.running[row], self.monitor.timers["progress"][row] = False, -math.inf

    def floor_friction(self) -> FloatArray:
        """Return the friction of each tire of world 0 in each step of the last tick, on the floor under it [-].

        It is a copy of shape (substeps, 4); without patches (1, 4).
        """
        floor = self._batches[0].floor
        return floor.mu[:, 0].copy() if floor.mu.size else self._arrays.mu[:1].copy()

    @property
    def frictions(self) -> FloatArray:
        """Coefficient of friction of each car's tires, their mean, on the floor besides patches. Shape (r,)."""
        found: FloatArray = self._arrays.mu.mean(axis=1)
        return found

    def read(self, i: int, data: mujoco.MjData) -> None:
        """Write world i into a mujoco.MjData of its model, poses current."""
        batch, place = self._place_of(i)
        batch.read(place, data)

    def rebuild(self, i: int, world: World) -> None:
        """Put another world in the place of world i. Its cars are to be placed before it goes on.

        Raises:
          ModelError, SettingsError: another timestep, or another LiDAR.
        """
        self.rebuild_worlds({i: world})

    def rebuild_worlds(self, worlds: Mapping[int, World]) -> None:
        """Put other worlds in the places of some worlds, by their numbers, as `rebuild`.

        Raises:
          ModelError, SettingsError: another timestep, or another LiDAR.
        """
        batches: list[WorldBatch] = []
        for batch in self._batches:
            first, end = batch.worlds.start, batch.worlds.stop
            if not any(i in worlds for i in range(first, end)):
                batches.append(batch)
                continue
            if batch in self._in_slots:
                self._in_slots.remove(batch)
                if (slots := self._slots.get((self._share_of(batch.worlds), batch.world))) is not None:
                    slots.leave(batch)
            cuts = sorted({first, end} | {cut for i in range(first, end) if i in worlds for cut in (i, i + 1)})
            for part in map(slice, cuts, cuts[1:]):
                new = self._fresh(worlds[part.start], part) if part.start in worlds else self._batch(batch.world, part)
                self._change(new)
                if part.start not in worlds:  # these go on where they are
                    new.go_on_from(batch, slice(part.start - first, part.stop - first))
                batches.append(new)
        self._take_batches(batches)
        for i in worlds:
            self.running[i * self.cars_per_world : (i + 1) * self.cars_per_world] = False
            self._data.pop(i, None)

    def _fresh(self, world: World, place: slice) -> WorldBatch:
        """Return a batch of one world; those of the same World share its model."""
        share = self._share_of(place)
        if (share, world) not in self._slots:
            from .slots import Slots

            alone = self._cars_alone(share, world)
            self._slots[share, world] = Slots(partial(self._batch, world, alone=alone), self.room)
        batch = self._slots[share, world].take(place, self._arrays, self.monitor)
        self._in_slots.add(batch)
        return batch

    def _cars_alone(self, share: int, world: World) -> CarsAlone | None:
        """Return the cars of a world alone, for the thread of a share; None where no ground is known to be clear."""
        if not world.distances[0].size:
            return None
        key = share, world.xml_of_cars
        if key not in self._alone:
            from .cars_alone import CarsAlone

            self._alone[key] = CarsAlone(world.xml_of_cars, world.cars)
        return self._alone[key]

    def _share_of(self, worlds: slice) -> int:
        """Return the number of the share that some worlds are in."""
        return bisect_left(self._ends_of_shares, worlds.stop)

    def forget(self, worlds: Sequence[World]) -> None:
        """Keep nothing of worlds that are to be driven no more, which would make it quicker to drive them again."""
        for key in [key for key in self._slots if key[1] in worlds]:
            del self._slots[key]

    def change(self, i: int, changes: Sequence[CarChanges]) -> None:
        """Change the cars of world i, (m,), in the place of what was changed before; they are then to be placed.

        Raises:
          SettingsError: a world that is driven together with others.
        """
        batch = self._batch_of[i]
        if batch.worlds.stop - batch.worlds.start > 1:
            raise SettingsError(f"world {i} shares its model with others; accepted: one that was rebuilt")
        batch.change_anew(changes)

    def place(
        self,
        starts: Sequence[Start],
        which: Mask | None = None,
        *,
        effects: Sequence[LidarEffects] | None = None,
        seeds: Sequence[int] | None = None,
        odometry_drifts: Sequence[float] | None = None,
        sensors: Sequence[Sequence[Sensor]] | None = None,
    ) -> None:
        """Place cars at their starts and begin their races.

        Args:
          starts: one for each of the cars.
          which: (r,) the cars, whole worlds; None: all.
          effects: what the LiDAR of each does to a scan; None: nothing.
          seeds: of the LiDAR's noise of each, and of its sensors'; needed with effects or sensors.
          odometry_drifts: relative error of the speeds and the yaw rate in the odometry of each; None: there is none.
          sensors: of each, besides LiDAR and odometry; None: none.

        Raises:
          SettingsError: a sensor's rate that is not one in a whole number of physics steps.
        """
        chosen = np.ones(len(self.commands), np.bool_) if which is None else which
        start_of: list[Start | None] = [None] * len(chosen)
        for place, (row, start) in enumerate(zip(np.flatnonzero(chosen).tolist(), starts, strict=True)):
            start_of[row] = start
            self._sense_plainly(row)
            if effects is not None and effects[place] != LidarEffects():
                assert seeds is not None
                if self.no_messages[row] and not effects[place].motion_distortion:
                    self._effects_of_rows().begin(row, effects[place], seeds[place])
                else:
                    self._pipelines[row] = self._pipeline(row, effects[place], seeds[place])
            if sensors is not None and sensors[place]:
                assert seeds is not None
                self._samplers[row] = self._make_samplers(row, sensors[place], seeds[place])
        self._drift(chosen, 0.0 if odometry_drifts is None else odometry_drifts)
        worlds = np.flatnonzero(chosen[:: self.cars_per_world]).tolist()
        for batch in dict.fromkeys(self._batch_of[i] for i in worlds):
            batch.place(chosen[batch.rows], start_of[batch.rows])

    def load(
        self,
        state: FloatArray,
        i: int = 0,
        *,
        effects: LidarEffects | Sequence[LidarEffects] | None = None,
        seed: int | Sequence[int] = 0,
        odometry_drift: float | Sequence[float] = 0.0,
        sensors: Sequence[Sequence[Sensor]] = (),
        timed: bool = False,
    ) -> None:
        """Go on in world i from a recorded state (k,).

        Args:
          state: complete, as `state` returns it.
          i: the world.
          effects: what its LiDARs do to a scan, all alike, or one for each car; None: nothing.
          seed: of their noise, likewise.
          odometry_drift: relative error of the speeds and the yaw rate in their odometry, likewise.
          sensors: of each car, besides LiDAR and odometry; nothing: none.
          timed: begin the races of its cars there, with their laps and why they end; else they race without end.
        """
        batch, place = self._place_of(i)
        batch.load(place, state, timed=timed)
        rows = range(i * self.cars_per_world, (i + 1) * self.cars_per_world)
        self._drift(rows, odometry_drift)
        effects_of = effects if isinstance(effects, Sequence) else [effects] * len(rows)
        seed_of = seed if isinstance(seed, Sequence) else [seed] * len(rows)
        sensors_of = sensors or [()] * len(rows)
        for row, own, number, sensing in zip(rows, effects_of, seed_of, sensors_of, strict=True):
            self._sense_plainly(row)
            if sensing:
                self._samplers[row] = self._make_samplers(row, sensing, number)
            if own is not None and own != LidarEffects():
                self._pipelines[row] = self._pipeline(row, own, number)
            self.running[row] = self.running[row] or not timed

    def sense(self, which: Mask | None = None) -> None:
        """Take the scans and odometry of cars, (r,); None: of all that race. Once for each moment: noise is drawn."""
        chosen = self.running if which is None else which
        if which is None and self.cars_per_world > 1 and not self.running.all():  # who stands there has telemetry, too
            others = np.repeat(self.running.reshape(self.count, -1).any(axis=1), self.cars_per_world) & ~chosen
            if others.any():
                self._share(lambda share: read_all(share.tables, share.firsts, others))
        self._share(lambda share: sense_all(share.tables, share.firsts, chosen))
        if self._drifts:
            drifted = self.odometry[chosen]
            drift_odometry(drifted, 1.0 + self._odometry_drift[chosen])
            self.odometry[chosen] = drifted
        for batch in self._batches:
            if batch.drawn is None:
                for row in (np.flatnonzero(chosen[batch.rows]) + batch.rows.start).tolist():
                    lidar = batch.lidar(row % self.cars_per_world)
                    self.ranges[row] = lidar.ranges(self._data_of(row // self.cars_per_world))
        if self._samplers:
            self._measure(np.flatnonzero(chosen), deliver=True)
        if self._row_effects:
            self._row_effects.apply(chosen, self.ranges)
        if self._pipelines:
            self.scans = {
                row: pipeline.scan(self._data_of(row // self.cars_per_world, pipeline))
                for row, pipeline in self._pipelines.items()
                if chosen[row]
            }
            for row, scan in self.scans.items():
                self.ranges[row] = scan.ranges

    def read_odometry(self, which: Mask) -> None:
        """Take the odometry of cars, (r,), and what begins their rows of telemetry, without their scans."""
        self._share(lambda share: read_all(share.tables, share.firsts, which))

    def decide(self) -> None:
        """Have the planners command the cars that race; those whose planner fails race no longer.

        In a world that goes on such a car brakes and stands there, as one that has crashed does.
        """
        assert self.planners is not None
        reasons = self.planners(self)
        if reasons is not None:
            self._end(reasons)
        if self.cars_per_world > 1:  # a car that nobody drives brakes, wheels as they are
            self.commands[~self.running, 1] = 0.0

    def drive(self, *, controls: FloatArray | None = None) -> None:
        """Hold the commands for a tick in the worlds whose cars race.

        Args:
          controls: of the actuators, as recorded, (n, controls), instead of the commands; None: the commands are held.
        """
        if self.before_substep or self.after_substep or self._in_steps or controls is not None:
            for batch in self._batches:
                self._drive_in_steps(batch, controls)
        else:
            self._share(lambda share: drive_all(share.tables))
        if self.failed.any():
            self.monitor.end(self.failed & self.running, "failed")

    def judge(self) -> None:
        """Time the laps of the cars that race and end what is over.

        Of several cars, one that has finished is taken off the course, so that it is in nobody's way.
        """
        raced = self.running.copy() if self.cars_per_world > 1 else None
        for share in self._shares:
            judge_all(share.tables)
        if raced is not None and np.count_nonzero(self.running) < np.count_nonzero(raced):
            for row in map(int, np.flatnonzero(raced & ~self.running & (self.monitor.reasons == _FINISHED))):
                batch, place = self._place_of(row // self.cars_per_world)
                batch.take_off(place, row % self.cars_per_world)

    def tick(self, *, clock: Clock | None = None, history: Keeper | None = None) -> Mask:
        """Sense, decide, drive and judge; return which cars were driven, (r,).

        That is one compiled call for worlds of one car, where the planners are compiled and there are no hooks, no
        effects of the LiDAR, no sensors and no drift of the odometry, which happen in Python.

        Args:
          clock: called with the time of the decision; where it raises, the cars stay as they are.
          history: keeps the tick of world 0, once its cars are driven.
        """
        calls = self._compiled_calls()
        if calls is None:
            self.sense()
            if clock is None:
                self.decide()
            else:
                clock.time(self.decide)
        elif self._tick_at_once(calls, clock, history):
            return self._driven
        driven = self.running.copy()
        if not driven.any():  # no planner is left
            return driven
        self.drive()
        if history is not None:
            history.append()
        self.judge()
        return driven

    def _compiled_calls(self) -> Calls | None:
        """Return the calls that decide in a tick of one compiled call; None where it takes more."""
        if self.before_substep or self.after_substep or self._samplers or self._drifts:
            return None
        if self._pipelines or self._row_effects:
            return None
        if self._called is not self.planners:
            self._called, self._calls, batch = self.planners, None, self._batches[0]
            if isinstance(self.planners, BatchPlanners) and len(self._batches) == 1 and batch.ticks_at_once:
                self._calls = self.planners.compiled_calls(self)
        return self._calls

    def _tick_at_once(self, calls: Calls, clock: Clock | None, history: Keeper | None) -> bool:
        """Do a tick in one compiled call; return False where the planners have failed and the rest is still to be done.

        What `clock` raises, and planners that have failed, leave the cars as they are.
        """
        planners = self.planners
        assert isinstance(planners, BatchPlanners)
        self._driven[:] = self.running
        kept = NOTHING_KEPT if history is None else history.room()
        began = time.perf_counter()
        try:
            how, took = self._batches[0].tick(calls, math.inf if clock is None else clock.limit, kept)
        except BaseException as error:
            if not is_of_planner(error):
                raise
            if clock is not None:
                clock.note(time.perf_counter() - began)
            self._end(planners.failed(error, self))
            return False
        if clock is not None:
            clock.note(took)
        if how == NO_NUMBERS:
            self._end(planners.refused(self))
        return how == DRIVEN

    def _end(self, reasons: Reasons) -> None:
        """End the races of the cars whose planner has failed."""
        for reason in set(reasons[reasons > 0].tolist()):
            ended = reasons == reason
            self.failed |= ended
            self.monitor.end(ended, END_REASONS[reason])

    def interrupt(self) -> None:
        """End the races that still run."""
        self.monitor.end(self.running.copy(), "interrupted")

    def close(self) -> None:
        """Let go of the threads."""
        if self._pool is not None:
            self._pool.shutdown()
            self._pool = None

    def _drift(self, rows: Any, drift: float | Sequence[float]) -> None:
        """Let the odometry of some rows err by a share of what is measured."""
        self._odometry_drift[rows] = drift
        self._drifts = bool(self._odometry_drift.any())

    def _place_of(self, i: int) -> tuple[WorldBatch, int]:
        """Return the batch that has world i, and its place there."""
        batch = self._batch_of[i]
        return batch, i - batch.worlds.start

    def _sense_plainly(self, row: int) -> None:
        """Take the effects of its LiDAR and its sensors off a car."""
        self._pipelines.pop(row, None)
        self._samplers.pop(row, None)
        if self._row_effects is not None:
            self._row_effects.end(row)

    def _effects_of_rows(self) -> EffectsOfRows:
        if self._row_effects is None:
            from ..lidar.scan_pipeline import EffectsOfRows

            self._row_effects = EffectsOfRows(self.beams, len(self.commands))
        return self._row_effects

    def _pipeline(self, row: int, effects: LidarEffects, seed: int) -> ScanPipeline:
        i, car = divmod(row, self.cars_per_world)
        distorted = self._place_of(i)[0].lidar(car) if effects.motion_distortion else None
        from ..lidar.scan_pipeline import ScanPipeline

        return ScanPipeline(
            distorted or RangesRow(self.beams, self.ranges[row]), effects, np.random.default_rng(seed)
        )  # fmt: skip

    def _data_of(self, i: int, pipeline: ScanPipeline | None = None) -> Any:
        """Return the data that a LiDAR in Python measures in, of world i; a pipeline without bodies needs its time."""
        if pipeline is not None and not pipeline.needs_every_step:
            return SimpleNamespace(time=self.time(i))
        if i not in self._data:
            self._data[i] = mujoco.MjData(self.world_of(i).model)
        self.read(i, self._data[i])
        return self._data[i]

    @property
    def _in_steps(self) -> bool:
        """Whether any LiDAR moves during its sweep, or any sensor measures within a tick."""
        return any(pipeline.needs_every_step for pipeline in self._pipelines.values()) or any(
            sampler.steps % self.substeps for samplers in self._samplers.values() for sampler in samplers
        )

    def readings(self, row: int) -> Mapping[str, Reading]:
        """Return what the sensors of a car have delivered up to when it last sensed, by their names."""
        samplers = self._samplers.get(row)
        if samplers is None:
            return NO_READINGS
        return Readings((sampler.sensor.name, sampler.reading) for sampler in samplers)

    def car_state(self, row: int) -> CarState:
        """Return what can be measured on a car now. Live."""
        from ..vehicle.sensors import CarState

        i, car = divmod(row, self.cars_per_world)
        batch, place = self._place_of(i)
        cars = self._arrays.constants[row - car : row - car + self.cars_per_world]
        return CarState(
            time=self.time(i), qpos=self.qpos(i), qvel=self.qvel(i), sensordata=batch.physics.sensors[place],
            ranges=self.ranges[row], constants=cars[car : car + 1], others=np.delete(cars, car),
            odometry_drift=float(self._odometry_drift[row]), model=batch.world.model, prefix=car_prefix(car),
        )  # fmt: skip

    def _make_samplers(self, row: int, sensors: Sequence[Sensor], seed: int) -> list[Sampler]:
        """Return what measures with the sensors of a car."""
        from ..vehicle.sensors import Sampler

        timestep, beams = self.world_of(row // self.cars_per_world).model.opt.timestep, len(self.beams.bearings)
        return [
            Sampler(sensor, seed, steps=sensor.steps(timestep, self.substeps), size=sensor.size(beams))
            for sensor in sensors
        ]

    def _measure(self, rows: NDArray[np.int64], *, deliver: bool) -> None:
        """Have the sensors of some cars measure where it is time to, and deliver what is old enough."""
        for row in rows.tolist():
            samplers = self._samplers.get(row, ())
            state = self.car_state(row) if samplers else None
            for sampler in samplers:
                assert state is not None
                sampler.measure(round(state.time / state.model.opt.timestep), state)
                if deliver:
                    sampler.deliver(state.time)

    def _drive_in_steps(self, batch: WorldBatch, controls: FloatArray | None) -> None:
        """Drive a batch as its `drive` does, one physics step after the other, hooks in between."""
        ids = batch.driven
        worlds = ids.astype(np.int64) + batch.worlds.start
        batch.hold(ids, None if controls is None else controls[batch.worlds])
        swept = [
            (row, pipeline)
            for row, pipeline in self._pipelines.items()
            if pipeline.needs_every_step and row // self.cars_per_world in worlds
        ]
        stepped = np.zeros(self.count, np.bool_)
        stepped[worlds] = True
        for step in range(self.substeps):
            for hook in self.before_substep:
                hook(self, worlds)
            batch.step(ids, step)
            for hook in self.after_substep:
                hook(self, worlds)
            for row, pipeline in swept:
                pipeline.record(self._data_of(row // self.cars_per_world, pipeline))
            if self._samplers and step < self.substeps - 1:  # at the end of a tick when the car senses
                self._measure(np.flatnonzero(self.running & np.repeat(stepped, self.cars_per_world)), deliver=False)
        batch.book(ids)

    def _share(self, work: Callable[[Share], None]) -> None:
        """Do some work on each share of the batches, each in a thread; kernels run without the GIL."""
        if self._pool is None:
            for share in self._shares:
                work(share)
        else:
            list(self._pool.map(work, self._shares))


class Share(NamedTuple):
    """The batches that one thread drives."""

    tables: NDArray[np.int64]  # addresses of their tables
    firsts: NDArray[np.int64]  # first row of the cars of each


def _ends_of_shares(count: int, threads: int) -> list[int]:
    """Return the ends of equal shares of the worlds, one for each thread."""
    shares = min(threads, count)
    return [count * k // shares for k in range(1, shares + 1)]


def _parts(worlds: Sequence[World], shares: Sequence[int]) -> list[slice]:
    """Split the worlds into runs of equal models that end where a share ends."""
    count = len(worlds)
    ends = set(shares) | {i for i in range(1, count) if worlds[i] is not worlds[i - 1]}
    return [slice(first, end) for first, end in zip([0, *sorted(ends)], sorted(ends), strict=False)]


class RangesRow:
    """A car's row of ranges, as the LiDAR that its ScanPipeline measures with."""

    def __init__(self, beams: Beams, row: FloatArray) -> None:
        self.beams = beams
        self._row = row

    def ranges(self, data: Any) -> FloatArray:
        """Return a copy of the row [m]. Shape (beams,)."""
        return self._row.copy()


def whole_steps(period: float, timestep: float) -> int:
    """Return the number of physics steps in one period.

    Raises:
      ModelError: not a whole number of them.
    """
    steps = round(period / timestep)
    if steps < 1 or abs(steps * timestep - period) > 1e-9:
        raise ModelError(f"timestep is {timestep} s; accepted: a whole fraction of the LiDAR's period of {period} s")
    return steps
