"""The engine: n worlds of m cars, stepped together in lockstep.

    engine = Engine(World("oval"), 64, laps=1)
    engine.place([Start(s=0.5 * i) for i in range(64)])
    while engine.running.any():
        engine.tick()  # sense, decide, drive, judge; in one compiled call where planners are compiled, at the same bits

Arrays have one row a car: the m cars of world 0, then those of world 1. A race is an engine of one world; rollouts and
environments are engines of many. Each world's result is the same, bit for bit, whatever the others are.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..arguments import Uncopied
from ..display import brief
from ..errors import ModelError, SettingsError, is_of_planner
from ..lidar.beams import Beams
from ..lidar.effects import LidarEffects
from ..lidar.lidar import Lidar
from ..messages import NO_READINGS, FloatArray, LaserScan, Reading
from ..native import core
from ..vehicle.car import Car
from ..vehicle.changes import CarChanges
from ..vehicle.motion import ground_speed, point_motion
from .compiled_tick import NO_NUMBERS, NOTHING_KEPT
from .physics import whole_steps
from .planner_adapter import BatchPlanners, Calls, Clock, Keeper, OtherCar, Planners, Reasons, Surroundings, up_of
from .settings import Start
from .slots import Share, Slots, ends_of_shares, parts_of, share_of, shared_out
from .termination import END_REASONS, RaceMonitor
from .world import World
from .world_batch import CarArrays, Mask, WorldBatch

if TYPE_CHECKING:
    from ..vehicle.sensors import Sensor
    from .cars_alone import CarsAlone
    from .sensing import Sensing

Hook = Callable[["Engine", NDArray[np.int64]], None]
"""Called with the engine and the worlds that are being stepped."""

_FINISHED = END_REASONS.index("finished")
_NO_EFFECTS = LidarEffects()
_WORLDS_A_THREAD = 4  # fewer are driven sooner than a thread is woken


class Engine(Uncopied):
    """n worlds of m cars.

    Args:
      world: that all share, or one for each world, with the same LiDAR. Worlds that are the same object and stand next
        to each other are driven together.
      changes: what differs in each car, (r,); None: nothing.
      time_limit: of simulated time [s]; None: that of the course.
      period: of a tick [s]; None: the LiDAR's.
      own_model: step `world.model` itself, so that changes to it take effect; else a copy.

    Attributes:
      count, cars_per_world: n and m; r is n m.
      period, substeps: time that a tick takes [s], and its physics steps.
      odometry, ranges, commands, mu, crashed, touched_at, failed, telemetry, statistics: of the cars, as in CarArrays.
      room: for how many worlds a model is compiled that `rebuild_worlds` puts in places; each thread has its own.
      no_messages: whether the ranges of a car are all that is read of its scans, so that they are not in `scans`, from
        when it is placed on, (r,); False unless somebody says so.
      monitor: RaceMonitor of the races.
      shares: of the worlds, for what does more than one of the five verbs in a call.
      planners: whose `decide` is called; None: somebody else writes the commands.
      before_substep, after_substep: hooks around each physics step. What the first write to `state` is stepped from.

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
        self._arrays = arrays = CarArrays.of(cars, len(self.beams.bearings), self.cars_per_world)
        self.monitor = RaceMonitor(cars, laps)
        self._ends_of_shares = ends_of_shares(self.count, threads)
        self._slots = Slots()
        self.room = 1
        batches = []
        for part in parts_of(worlds, self._ends_of_shares):
            first, several = worlds[part.start], part.stop - part.start > 1
            share = share_of(part, self._ends_of_shares)
            alone = self._slots.cars_alone(share, first) if several and not own_model else None
            batches.append(self._batch(first, part, alone=alone))
        self._take_batches(batches)
        self._changes = None if changes is None else list(changes)
        if changes is not None:
            for batch in batches:
                batch.change(changes[batch.rows])
        self._pool = ThreadPoolExecutor(threads - 1) if threads > 1 and self.count >= 2 * _WORLDS_A_THREAD else None
        self.odometry, self.ranges, self.commands, self.mu = arrays.odometry, arrays.ranges, arrays.commands, arrays.mu
        self.crashed, self.failed, self.running = arrays.crashed, arrays.failed, self.monitor.running
        self.telemetry, self.statistics, self.touched_at = arrays.telemetry, arrays.statistics, arrays.touched_at
        self.planners: Planners | None = None
        self.before_substep: list[Hook] = []
        self.after_substep: list[Hook] = []
        self.no_messages = np.zeros(cars, np.bool_)
        self._sensing: Sensing | None = None
        self._driven, self._waiting = np.zeros(cars, np.bool_), np.zeros(cars, np.bool_)
        self._calls: Calls | None = None

    def __repr__(self) -> str:
        return brief(self, f"{self.count} worlds", f"tick {self.period:g} s of {self.substeps} steps", repr(self.world))

    def _batch(self, world: World, worlds: slice, room: int = 1, alone: CarsAlone | None = None) -> WorldBatch:
        """Return the batch of some consecutive worlds; raise ModelError or SettingsError as the class says."""
        if world.lidar.beams.geometry != self.beams.geometry and world.lidar.beams is not self.beams:
            raise SettingsError("the worlds of an engine have different LiDARs; accepted: the same beams in all")
        if len(world.cars) != self.cars_per_world:
            numbers = f"{self.cars_per_world} and {len(world.cars)}"
            raise SettingsError(f"the worlds of an engine have {numbers} cars; accepted: the same number in all")
        if whole_steps(self.period, world.model.opt.timestep) != self.substeps:
            raise ModelError(f"timestep is {world.model.opt.timestep} s; accepted: the same in all worlds of an engine")
        return WorldBatch(
            world, worlds, self.cars_per_world, self._arrays, self.monitor, substeps=self.substeps, period=self.period,
            time_limit=self._time_limit, own_model=self._own_model, room=room, alone=alone,
        )  # fmt: skip

    def _take_batches(self, batches: Sequence[WorldBatch]) -> None:
        """Have these batches, in the order of their worlds, and share them out to the threads."""
        self._batches = list(batches)
        self._batch_of = [batch for batch in batches for _ in range(batch.worlds.start, batch.worlds.stop)]
        self._called: Planners | None = None  # whose calls the next are
        self.shares = shared_out(batches, self._ends_of_shares)
        self._drawn = all(batch.drawn is not None for batch in batches)

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
        for share in self.shares:
            core.read_times(share.tables, share.firsts, times)
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

    @property
    def scans(self) -> dict[int, LaserScan]:
        """The scans of the cars whose LiDAR has effects, last sensed, by row."""
        return {} if self._sensing is None else self._sensing.scans

    def readings(self, row: int) -> Mapping[str, Reading]:
        """Return what the sensors of a car have delivered up to when it last sensed, by their names."""
        return NO_READINGS if self._sensing is None else self._sensing.readings(row)

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
        for share in self.shares:
            core.read_motions_all(share.tables, share.firsts, which, poses, velocities)

    def surroundings(self, row: int) -> Surroundings:
        """Return the surroundings of a car: its world, all cars, whether it touches something, and its tilt."""
        i, own = divmod(row, self.cars_per_world)
        qpos, qvel, cars = self.qpos(i), self.qvel(i), []
        for other in range(row - own, row - own + self.cars_per_world):
            car = self._arrays.constants[other : other + 1]
            x, y, heading, speed, _, yaw_rate = point_motion(qpos, qvel, 0.0, car)
            cars.append(OtherCar(pose=(x, y, heading), speed=speed, yaw_rate=yaw_rate))
        pose = cars.pop(own).pose
        contact = bool(self.crashed[row] or self.touched_at[row].max() >= self.time(i))
        turn = int(self._arrays.constants[row]["free_qpos"]) + 3
        up = up_of(qpos[turn : turn + 4])
        return Surroundings(world=self.world_of(i), pose=pose, others=tuple(cars), contact=contact, up=up)

    def slip(self, i: int = 0) -> FloatArray:
        """Return the slip of the last car driven with world i, as TireSlip.values (QUANTITIES, substeps, 4). Live."""
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
        """Return what world 0's tires have on the floor in each step of a tick (substeps, 4), or (1, 4)."""
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

    def rebuild_worlds(self, worlds: Mapping[int, World]) -> None:
        """Put other worlds in the places of some, by their numbers. Their cars are to be placed before they go on.

        Raises:
          ModelError, SettingsError: another timestep, or another LiDAR.
        """
        batches: list[WorldBatch] = []
        for batch in self._batches:
            first, end = batch.worlds.start, batch.worlds.stop
            if not any(i in worlds for i in range(first, end)):
                batches.append(batch)
                continue
            self._slots.leave(batch)
            cuts = sorted({first, end} | {cut for i in range(first, end) if i in worlds for cut in (i, i + 1)})
            for part in map(slice, cuts, cuts[1:]):
                if part.start in worlds:
                    share, world = share_of(part, self._ends_of_shares), worlds[part.start]
                    new = self._slots.take(self._batch, share, world, part, self._arrays, self.monitor, self.room)
                else:
                    new = self._batch(batch.world, part)
                if self._changes is not None:
                    new.change(self._changes[new.rows])
                if part.start not in worlds:  # these go on where they are
                    new.go_on_from(batch, slice(part.start - first, part.stop - first))
                batches.append(new)
        self._take_batches(batches)
        for i in worlds:
            self.running[i * self.cars_per_world : (i + 1) * self.cars_per_world] = False
            if self._sensing is not None:
                self._sensing.forget(i)

    def forget(self, worlds: Sequence[World]) -> None:
        """Keep nothing of worlds that are to be driven no more, which would make it quicker to drive them again."""
        self._slots.forget(worlds)

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
          which: (r,) the cars, whole worlds; None: all.
          effects: what the LiDAR of each does to a scan; None: nothing.
          seeds: of the LiDAR's noise of each, and of its sensors'; needed with effects or sensors.
          odometry_drifts: relative error of the speeds and the yaw rate in the odometry of each; None: there is none.

        Raises:
          SettingsError: a sensor's rate that is not one in a whole number of physics steps.
        """
        chosen = np.ones(len(self.commands), np.bool_) if which is None else which
        start_of: list[Start | None] = [None] * len(chosen)
        for place, (row, start) in enumerate(zip(np.flatnonzero(chosen).tolist(), starts, strict=True)):
            start_of[row] = start
            self._begin_sensing(
                row, None if effects is None else effects[place], () if sensors is None else sensors[place],
                0 if seeds is None else seeds[place], 0.0 if odometry_drifts is None else odometry_drifts[place],
                messages=not self.no_messages[row],
            )  # fmt: skip
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
        """Go on in world i from a recorded state (k,), complete, as `state` returns it.

        Args:
          i: of the world.
          state: as `state` returns it.
          effects: as in `place`, of all cars alike, or one for each.
          seed: in the same way.
          odometry_drift: in the same way.
          sensors: of each car, besides LiDAR and odometry; nothing: none.
          timed: begin the races of its cars there, with their laps and why they end; else they race without end.
        """
        batch, place = self._place_of(i)
        batch.load(place, state, timed=timed)
        rows = range(i * self.cars_per_world, (i + 1) * self.cars_per_world)
        for k, row in enumerate(rows):
            own = effects[k] if isinstance(effects, Sequence) else effects
            number = seed[k] if isinstance(seed, Sequence) else seed
            drift = odometry_drift[k] if isinstance(odometry_drift, Sequence) else odometry_drift
            self._begin_sensing(row, own, sensors[k] if sensors else (), number, drift, messages=True)
            self.running[row] = self.running[row] or not timed

    def _begin_sensing(
        self, row: int, effects: LidarEffects | None, sensors: Sequence[Sensor], seed: int, drift: float, *,
        messages: bool,
    ) -> None:  # fmt: skip
        """Begin anew what a car measures in Python, see `Sensing.begin`."""
        if self._sensing is None and ((effects is not None and effects != _NO_EFFECTS) or sensors or drift):
            self._sense_in_python()
        if self._sensing is not None:
            self._sensing.begin(row, effects, sensors, seed, drift, messages=messages)

    def _sense_in_python(self) -> Sensing:
        from .sensing import Sensing  # imported where a car measures more than the compiled scan and odometry

        self._sensing = Sensing(self, self._arrays)
        return self._sensing

    def sense(self, which: Mask | None = None) -> None:
        """Take the scans and odometry of cars, (r,); None: of all that race. Once for each moment: noise is drawn."""
        chosen = self.running if which is None else which
        if which is None and self.cars_per_world > 1 and not self.running.all():  # who stands there has telemetry, too
            others = np.repeat(self.running.reshape(self.count, -1).any(axis=1), self.cars_per_world) & ~chosen
            if others.any():
                self.share_out(lambda share: core.read_all(share.tables, share.firsts, others))
        self.share_out(lambda share: core.sense_all(share.tables, share.firsts, chosen))
        if self._sensing is None and not self._drawn:
            self._sense_in_python()
        if self._sensing is not None:
            self._sensing.sense(chosen)

    def read_odometry(self, which: Mask) -> None:
        """Take the odometry of cars, (r,), and what begins their rows of telemetry, without their scans."""
        self.share_out(lambda share: core.read_all(share.tables, share.firsts, which))

    @property
    def compiled(self) -> bool:
        """Whether compiled code alone does all of `sense`, `drive` and `judge`, with worlds of one car."""
        hooks = self.before_substep or self.after_substep
        return self._drawn and self._sensing is None and not hooks and self.cars_per_world == 1

    def decide(self) -> None:
        """Write the planners' commands of the cars that race; a car whose planner fails no longer races.

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
        in_steps = self._sensing is not None and self._sensing.in_steps
        if self.before_substep or self.after_substep or in_steps or controls is not None:
            for batch in self._batches:
                self._drive_in_steps(batch, controls)
        else:
            self.share_out(lambda share: core.drive_all(share.tables))
        if self.failed.any():
            self.monitor.end(self.failed & self.running, "failed")

    def judge(self) -> None:
        """Time the laps of the cars that race and end what is over.

        Of several cars, one that has finished is taken off the course, so that it is in nobody's way.
        """
        raced = self.running.copy() if self.cars_per_world > 1 else None
        for share in self.shares:
            core.judge_all(share.tables)
        if raced is not None and np.count_nonzero(self.running) < np.count_nonzero(raced):
            for row in map(int, np.flatnonzero(raced & ~self.running & (self.monitor.reasons == _FINISHED))):
                batch, place = self._place_of(row // self.cars_per_world)
                batch.take_off(place, row % self.cars_per_world)

    def tick(self, *, clock: Clock | None = None, history: Keeper | None = None, most: int = 1) -> Mask:
        """Sense, decide, drive and judge; return which cars were driven, (r,).

        That is one compiled call for worlds of one car, where planners are compiled and there are no hooks, no effects
        of the LiDAR, no sensors and no drift of the odometry, which happen in Python.

        Args:
          clock: called with the time of each decision; where it raises, the cars stay as they are.
          history: keeps the ticks of world 0, once its cars are driven.
          most: ticks that each world does in a compiled call, unless it ends before; without one it does one.
        """
        calls = self._compiled_calls()
        if calls is None:
            self.sense()
            if clock is None:
                self.decide()
            else:
                clock.time(self.decide)
        elif self._tick_at_once(calls, clock, history, most):
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
        if self.before_substep or self.after_substep or (self._sensing is not None and self._sensing.active):
            return None
        if self._called is not self.planners:
            self._called, self._calls, batch = self.planners, None, self._batches[0]
            if isinstance(self.planners, BatchPlanners) and len(self._batches) == 1 and batch.ticks_at_once:
                self._calls = self.planners.compiled_calls(self)
        return self._calls

    def _tick_at_once(self, calls: Calls, clock: Clock | None, history: Keeper | None, most: int) -> bool:
        """Do up to `most` ticks in one compiled call; False: planners failed in the only one, whose rest is left."""
        planners = self.planners
        assert isinstance(planners, BatchPlanners)
        self._driven[:] = self.running
        kept = NOTHING_KEPT if history is None else history.room(most)
        limit, took = math.inf if clock is None else clock.limit, np.zeros(most)
        try:
            how, count = self._batches[0].tick(calls, limit, kept, took, self._waiting)
        except BaseException as error:
            self.running |= self._waiting
            self._waiting[:] = False
            if not is_of_planner(error):
                raise
            failed_at = int(took.argmin())  # the only one below 0
            took[failed_at] += time.perf_counter()
            _note(clock, took[: failed_at + 1])
            self._end(planners.failed(error, self))
            return False
        _note(clock, took[:count])
        if how == NO_NUMBERS:
            reasons = planners.refused(self)
            self._end(reasons)
            self._driven[reasons > 0] = False
        return how != NO_NUMBERS or most > 1

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
        """End the threads."""
        if self._pool is not None:
            self._pool.shutdown()
            self._pool = None

    def _place_of(self, i: int) -> tuple[WorldBatch, int]:
        """Return the batch that has world i, and its place there."""
        batch = self._batch_of[i]
        return batch, i - batch.worlds.start

    def _drive_in_steps(self, batch: WorldBatch, controls: FloatArray | None) -> None:
        """Drive a batch as its `drive` does, one physics step after the other, hooks in between."""
        ids = batch.driven
        worlds = ids.astype(np.int64) + batch.worlds.start
        batch.hold(ids, None if controls is None else controls[batch.worlds])
        stepped = np.zeros(self.count, np.bool_)
        stepped[worlds] = True
        for step in range(self.substeps):
            for hook in self.before_substep:
                hook(self, worlds)
            batch.step(ids, step)
            for hook in self.after_substep:
                hook(self, worlds)
            if self._sensing is not None:
                self._sensing.follow(stepped, last=step == self.substeps - 1)
        batch.book(ids)

    def share_out(self, work: Callable[[Share], None]) -> None:
        """Do some work on each share of the worlds, each in a thread; the native core runs without the GIL."""
        if self._pool is None:
            for share in self.shares:
                work(share)
        else:
            begun = [self._pool.submit(work, share) for share in self.shares[1:]]
            work(self.shares[0])
            for each in begun:
                each.result()


def _note(clock: Clock | None, seconds: FloatArray) -> None:
    """Tell a clock how long decisions took."""
    if clock is not None:
        for each in seconds.tolist():
            clock.note(each)
