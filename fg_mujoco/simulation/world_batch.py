"""Worlds that share a compiled model and are driven by one thread: a part of an engine.

A WorldBatch has the states of its worlds, and views of the rows of its cars in the engine's arrays. An engine of one
kind of world and one thread has one; worlds with models of their own are a batch each.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..course.lap_timer import first_seen, fresh_timers
from ..course.moving_obstacles import motion_table, moving_obstacles, place_moving
from ..course.standing import off_course
from ..lidar.body_poses import Mount, make_links
from ..lidar.lidar import Lidar, RaycastLidar, lidar_mount
from ..messages import ODOMETRY, FloatArray
from ..native import core
from ..native_arrays import ArrayTable
from ..vehicle.bodywork import fit_timestep
from ..vehicle.car import WHEELS, Car
from ..vehicle.changes import CarChanges, change_worlds, restore_worlds
from ..vehicle.friction_patches import patch_table, wheel_positions
from ..vehicle.motion import CAR
from ..vehicle.tire_rows import USERDATA, gear_row, steps_within, take_over
from ..vehicle.tire_slip import QUANTITIES, TireSlipMeter
from ..vehicle.vehicle import Vehicle
from . import compiled_tick
from .cars import lidar_prefix, touch_places, tree_of
from .clear_ground import ClearGround, find_clear_ground
from .compiled_tick import AXLES, CHASSIS_CONTACT, FIRST_TIRE, LEVEL, MOUNT, SCRATCH, TIRES, TREE, Floor, Inertia, Sizes
from .physics import STATE, Batch, StateLayout
from .planner_adapter import Calls
from .settings import Start
from .telemetry import STATISTICS, TELEMETRY
from .termination import RaceMonitor
from .world import World

if TYPE_CHECKING:
    from .cars_alone import CarsAlone

Mask = NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True, eq=False)
class CarArrays:
    """Scans, odometry and progress of r cars, one row a car."""

    constants: NDArray[np.void]  # (r,) of CAR
    mu: FloatArray  # (r, 4) of the tires
    odometry: NDArray[np.void]  # (r,) of ODOMETRY, last sensed
    ranges: FloatArray  # (r, beams) [m] as in LaserScan, last sensed
    optics: FloatArray  # (r, 2) LidarEffects.optics of their LiDARs
    commands: FloatArray  # (r, 2) [rad, m/s]
    crashed: Mask  # (r,) whether the chassis has touched anything but a car since the car was placed
    touched_at: FloatArray  # (r, m) when it last touched each car of its world [s]; -inf: not since it was placed; in
    # the place of itself, when race control has put it back from a wall
    failed: Mask  # (r,) whether the planner or the engine failed
    telemetry: FloatArray  # (r, len(TELEMETRY)) of the last tick
    statistics: NDArray[np.void]  # (r,) of STATISTICS, since the car was placed

    @classmethod
    def of(cls, count: int, beams: int, cars_per_world: int = 1) -> CarArrays:
        """Return the arrays of so many cars, whose LiDARs have so many beams."""
        return cls(
            constants=np.zeros(count, CAR),
            mu=np.zeros((count, len(WHEELS))),
            odometry=np.zeros(count, ODOMETRY),
            ranges=np.zeros((count, beams)),
            optics=np.zeros((count, 2)),
            commands=np.zeros((count, 2)),
            crashed=np.zeros(count, np.bool_),
            touched_at=np.full((count, cars_per_world), -np.inf),
            failed=np.zeros(count, np.bool_),
            telemetry=np.full((count, len(TELEMETRY)), np.nan),
            statistics=np.zeros(count, STATISTICS),
        )

    def part(self, rows: slice) -> CarArrays:
        """Return views of some rows."""
        return CarArrays(**{name: values[rows] for name, values in vars(self).items()})


@dataclass
class _Kept:
    """What batches of one World keep for when a car is placed or changed; for one thread."""

    data: mujoco.MjData | None = None  # of the World's model
    plain_cars: dict[Vehicle, mujoco.MjModel] = field(default_factory=dict)  # each vehicle as it is, compiled


class WorldBatch:
    """Worlds that share a compiled model.

    Args:
      period: of a tick [s].
      time_limit: of simulated time [s]; None: that of the course.
      own_model: step `world.model` itself, so that changes to it take effect; else a copy.
      room: for how many states there is to be room, for `another`; at least for those of these worlds.
      alone: the cars of the world, which are stepped in the world's place where they touch nothing; None: never.

    Attributes:
      rows, cars: of their cars among the engine's, r of them, and the Car of each.
      layout, physics, all_physics: of a state; the Batch of their states, and that which these are a part of.
      slip: what the tires of the car that was driven last did, (QUANTITIES, substeps, 4), as TireSlip.values.
      clear: where the cars touch nothing.
    """

    def __init__(
        self,
        world: World,
        worlds: slice,
        cars_per_world: int,
        arrays: CarArrays,
        monitor: RaceMonitor,
        *,
        substeps: int,
        period: float,
        time_limit: float | None,
        own_model: bool,
        room: int = 1,
        alone: CarsAlone | None = None,
    ) -> None:
        model, count = world.model, worlds.stop - worlds.start
        self.world = world
        self.layout = StateLayout.of(model)
        self._own_model = own_model
        fit_timestep(model)
        if not own_model:
            model = copy(model)
        taken_over = [take_over(model, car.prefix) for car in world.cars]
        self._on_own_tires = any(taken_over)
        self._model = model
        self.all_physics = Batch(model, max(count, room), substeps)
        self.physics = self.all_physics.part(0, count)
        if own_model:
            self.physics.set_models([model] * count)
        self.cars = list(world.cars) * count
        self.slip = np.full((QUANTITIES, substeps, len(WHEELS)), np.nan)
        self._cars_per_world = cars_per_world
        self._lidars: dict[int, Lidar] = {}
        self._kept = _Kept()
        meters = [TireSlipMeter(model, car.prefix) for car in world.cars]
        self._plain_mu = np.tile([meter.mu for meter in meters], (count, 1))
        self._plain_constants = np.tile(np.concatenate([car.constants for car in world.cars]), count)
        self._take_rows(worlds, arrays, monitor)
        self._chassis_contacts = np.array([car.chassis_contact for car in world.cars])
        self._touch_places = touch_places(model, cars_per_world)
        self._pairs = np.array([meter.pairs for meter in meters], np.int32)
        self._tire_rows = np.concatenate([meter.rows for meter in meters])
        self._tire_states = np.zeros((count, substeps, USERDATA * len(self._tire_rows)))
        self._car_places = self._make_car_places(meters)
        self._gears = np.concatenate([self._gear_of(car, meter) for car, meter in zip(world.cars, meters, strict=True)])
        self._ids = np.empty(count, np.int32)
        self.floor = self._make_floor(substeps)
        self._motions, self._moving = motion_table(world.moving), moving_obstacles(model)
        self.clear = self._find_clear_ground()
        self._alone = alone if all(taken_over) and self.clear.distances.size else None
        self._table = self._make_table(period, time_limit)
        self._note_copies()

    def _take_rows(self, worlds: slice, arrays: CarArrays, monitor: RaceMonitor) -> None:
        """Have the rows of some of the engine's worlds, and write to them what does not change while they race."""
        self.worlds = worlds
        self.rows = slice(worlds.start * self._cars_per_world, worlds.stop * self._cars_per_world)
        self._arrays, self._monitor = arrays.part(self.rows), monitor.part(self.rows)
        self._arrays.mu[:], self._arrays.constants[:] = self._plain_mu, self._plain_constants

    def move(self, worlds: slice, arrays: CarArrays, monitor: RaceMonitor) -> None:
        """Be as many other worlds of the engine, whose cars are still to be placed."""
        self._take_rows(worlds, arrays, monitor)
        for name, values in self._engine_arrays().items():
            self._table.put(name, values)

    def another(self, physics: Batch, worlds: slice, arrays: CarArrays, monitor: RaceMonitor) -> WorldBatch:
        """Return a batch of as many other worlds that are the same; all but states is shared, for the one thread."""
        new = copy(self)
        new.physics, new.cars = physics, list(self.world.cars) * (worlds.stop - worlds.start)
        new._take_rows(worlds, arrays, monitor)
        new._ids, new._tire_states = self._ids.copy(), np.zeros_like(self._tire_states)
        new._table = self._table.with_others(new._engine_arrays() | new._physics_arrays() | {
            "places": compiled_tick.whole_places(self._cars_per_world, physics, monitor.laps, self.layout),
        })  # fmt: skip
        new._note_copies()
        return new

    def _note_copies(self) -> None:
        """Put into the table what the cars alone have of these states, see CarsAlone."""
        if self._alone is not None:
            self._table.put("alone", self._alone.addresses)
            self._table.put("copies", self._alone.copies(self.physics))

    def _physics_arrays(self) -> dict[str, Any]:
        """Return the arrays of the states of these worlds, by the names that the compiled tick has for them."""
        physics = self.physics
        return {
            "states": physics.states, "sensors": physics.sensors, "records": physics.records,
            "status": physics.status, "warnings": physics.warnings, "ids": self._ids,
            "state_numbers": self._ids.copy(), "tire_states": self._tire_states,
        }  # fmt: skip

    def _engine_arrays(self) -> dict[str, Any]:
        """Return the arrays of the engine that the compiled tick reads and writes, the rows of these worlds."""
        arrays, monitor = dict(vars(self._arrays)), self._monitor
        arrays["cars"] = arrays.pop("constants")
        names = ("running", "reasons", "timers", "lap_times", "standing_since")
        return arrays | {name: getattr(monitor, name) for name in names}

    def _make_car_places(self, meters: Sequence[TireSlipMeter]) -> NDArray[np.int64]:
        """Return the places of each car's parts in its model, see compiled_tick.TREE."""
        places = np.full((len(meters), 7), -1, np.int64)
        first = 0
        for place, meter, car in zip(places, meters, self.world.cars, strict=True):
            place[TIRES], place[AXLES], place[CHASSIS_CONTACT] = meter.readings.start, meter.axles, car.chassis_contact
            if len(meter.rows):
                place[FIRST_TIRE], first = first, first + len(meter.rows)
        if self.drawn is not None:
            places[:, MOUNT] = [mount.qpos_address for mount in self._mounts]
            places[:, LEVEL] = [mount.level for mount in self._mounts]
            if len(meters) > 1:
                places[:, TREE] = [tree_of(self.world.model, car.prefix) for car in self.world.cars]
        return places

    @cached_property
    def _mounts(self) -> list[Mount]:
        """Mount of the LiDAR on each car."""
        found = [self.drawn.mount] if self.drawn is not None else []
        for index in range(1, self._cars_per_world):
            found.append(lidar_mount(self.world.model, lidar_prefix(index)))
        return [mount for mount in found if mount is not None]

    def _make_floor(self, substeps: int) -> Floor:
        """Return the patches of the worlds, and room for what the tires have on them."""
        model = self.world.model
        patches = patch_table(model)
        wheels = np.concatenate([wheel_positions(model, car.prefix) for car in self.world.cars])
        room = len(self.cars) if len(patches) else 0
        return Floor(patches, wheels, np.zeros((substeps, room, len(WHEELS))), self._pairs.ravel())

    def _sizes(self) -> Sizes:
        """Return the sizes of the model, and whether any car has tires of ours."""
        model = self.world.model
        return Sizes(
            model.nq, model.nv, model.nsensordata, model.nuserdata, model.npair, int(self._on_own_tires)
        )  # fmt: skip

    def _pieces(self) -> FloatArray:
        """Return the pieces of walls that cars can push."""
        if mujoco.mj_name2id(self.world.model, mujoco.mjtObj.mjOBJ_BODY, "piece_0") < 0:
            return np.zeros((0, 5))
        from .pieces import piece_table

        return piece_table(self.world.model)

    def _gear_of(self, car: Car, meter: TireSlipMeter) -> NDArray[np.void]:
        """Return the steering and drive of a car, (1,) of GEAR."""
        gear = gear_row(self._model, car.prefix).copy()
        if not len(meter.rows):
            return gear
        gear["first_tire"] = gear["userdata"] // USERDATA
        gear["tire_steps"] = steps_within(self._model, meter.rows, float(self._model.opt.timestep))
        return gear

    def _make_table(self, period: float, time_limit: float | None) -> ArrayTable:
        """Return all arrays as the one argument of the compiled tick."""
        physics, drawn, course = self.physics, self.drawn, self.world.track
        model, moving, inertia = self.world.model, len(self._motions), Inertia.of(self.world.model)
        arrays: dict[str, Any] = {
            "places": compiled_tick.whole_places(self._cars_per_world, physics, self._monitor.laps, self.layout),
            "times": compiled_tick.course_numbers(
                float(model.opt.timestep), course, self._monitor.laps, time_limit, period
            ),
            **self._physics_arrays(), "slip": self.slip, "tires": self._tire_rows, "patches": self.floor.patches,
            "wheels": self.floor.wheels, "floor_mu": self.floor.mu, "pairs": self.floor.pairs,
            "car_places": self._car_places, "touch_places": self._touch_places,
            "sizes": np.array(self._sizes(), np.int64), "span": np.zeros(4, np.int64), "gears": self._gears,
            "row_counts": inertia.row_counts, "row_starts": inertia.row_starts, "inertia_columns": inertia.columns,
            "scratch": np.zeros(SCRATCH), "pieces": self._pieces(), **self.clear._asdict(), "motions": self._motions,
            **self._engine_arrays(),
        }  # fmt: skip
        if course is not None:
            arrays["table"] = np.ascontiguousarray(course.table)
        if drawn is not None:
            scene = drawn.scene if self._cars_per_world == 1 else self.world.all_seen
            arrays |= scene.arrays._asdict() | scene.scratch()._asdict()
            arrays["offset_positions"] = np.array([mount.offset_position for mount in self._mounts])
            arrays["offset_rotations"] = np.array([mount.offset_rotation for mount in self._mounts])
            arrays["links"] = make_links(model, scene.moving[moving:])
        return ArrayTable(compiled_tick.NAMES, arrays if self._alone is None else self._alone.share(arrays))

    def _find_clear_ground(self) -> ClearGround:
        """Return the clear ground of cars; empty for a model that its owner may change."""
        nothing = np.zeros((0, 0)), np.zeros(2)
        grid = nothing if self._own_model else self.world.distances
        return find_clear_ground(grid, self.world.model, [car.prefix for car in self.world.cars])

    @cached_property
    def drawn(self) -> RaycastLidar | None:
        """The LiDAR whose scans `sense` draws; None: they are measured in Python, by `lidar`."""
        lidar = self.world.lidar
        return lidar if isinstance(lidar, RaycastLidar) and lidar.mount is not None else None

    def lidar(self, car: int) -> Lidar:
        """Return the LiDAR of a car of these worlds, without effects, which measures in data of the world's model."""
        if car not in self._lidars:
            self._lidars[car] = self.world.make_lidar(car)
        return self._lidars[car]

    def change(self, changes: Sequence[CarChanges]) -> None:
        """Change each car, (r,); one whose parameters no planner can tell from the plain one's is that one."""
        for car, vehicle in enumerate(self.world.vehicles):
            own = changes[car :: self._cars_per_world]
            if any(change != CarChanges() for change in own):
                if vehicle not in self._kept.plain_cars:
                    self._kept.plain_cars[vehicle] = vehicle.compile()
                change_worlds(self.physics, own, self._kept.plain_cars[vehicle], self.world.cars[car].prefix)
        for row, change in enumerate(changes):
            i, car = divmod(row, self._cars_per_world)
            if change.mu is not None:
                self._arrays.mu[row] = self.physics.expand("pair_friction")[i, self._pairs[car], 0]
            if replace(change, mu=None) != CarChanges():
                with self.physics.as_model(i) as model:
                    self.cars[row] = Car(model, self.world.cars[car].prefix)
                self._arrays.constants[row] = self.cars[row].constants[0]
        self._note_copies()

    def change_anew(self, changes: Sequence[CarChanges]) -> None:
        """Change each car, (r,), as `change`, after the last changes were taken back."""
        restore_worlds(self.physics)
        self._arrays.mu[:], self._arrays.constants[:] = self._plain_mu, self._plain_constants
        self.cars = list(self.world.cars) * (self.worlds.stop - self.worlds.start)
        self.change(changes)

    def place(self, which: Mask, starts: Sequence[Start | None]) -> None:
        """Place the cars `which` (r,), whole worlds, at their starts (r,), and begin their races."""
        ids = np.flatnonzero(which[:: self._cars_per_world]).astype(np.int32)
        if len(ids) == 0:
            return
        physics, model, arrays = self.physics, self.world.model, self._arrays
        physics.reset(ids)  # warnings and all else that no state holds
        if self._kept.data is None:
            self._kept.data = mujoco.MjData(model)
        data, outside = self._kept.data, np.zeros(len(which), np.bool_)
        placed: dict[tuple[int, ...], int] = {}  # a world of these very starts
        for i in ids.tolist():
            first, m = i * self._cars_per_world, self._cars_per_world
            same = placed.setdefault(tuple(map(id, starts[first : first + m])), i)
            if same != i:
                physics.states[i], outside[first : first + m] = physics.states[same], outside[same * m : (same + 1) * m]
                continue
            mujoco.mj_resetData(model, data)
            place_moving(self._moving, data)
            for row, car in enumerate(self.world.cars, start=first):
                start = starts[row] or Start()
                x, y, along = self.world.track.start_pose(start.s, start.offset)
                if start.offset != 0.0:
                    outside[row] = off_course(self.world.track, (x, y), self.world.track.start_pose(start.s))
                car.write_pose(data, x, y, along + start.heading, start.speed)
            data.eq_active[:] = self._model.eq_active0
            mujoco.mj_getState(model, data, physics.states[i], int(STATE))
        self._forward(ids)
        arrays.crashed[which] = (self._touch_walls() | outside)[which]  # who starts beyond the walls touches none
        arrays.touched_at[which] = -np.inf
        arrays.failed[which] = False
        arrays.statistics[which], arrays.telemetry[which] = np.zeros(1, STATISTICS), np.nan
        self._begin(which)

    def put(self, i: int, car: int, start: Start) -> None:
        """Put one car of world i of them at a start, and leave the others as they are."""
        x, y, along = self.world.track.start_pose(start.s, start.offset)
        self._write_pose(i, car, x, y, along + start.heading, start.speed)
        row = i * self._cars_per_world + car
        timer, (place, _) = self._monitor.timers[row], self.world.track.project(np.array([[x, y]]))
        modulus = self.world.track.modulus
        timer["progress"] += (float(place[0]) - timer["place"] + 0.5 * modulus) % modulus - 0.5 * modulus
        timer["place"] = float(place[0])
        timer["furthest"] = timer["passed"] = timer["mark"] = timer["progress"]
        timer["last_progress_time"] = self.physics.states[i, self.layout.time]
        self._arrays.touched_at[row] = -np.inf

    def take_off(self, i: int, car: int) -> None:
        """Put one car of world i of them where no LiDAR on the course sees it, standing."""
        x, y = self.world.track.bounds[1] + 2.0 * self.world.lidar.beams.range_max
        self._write_pose(i, car, float(x) + 2.0 * car, float(y), 0.0, 0.0)

    def _write_pose(self, i: int, car: int, x: float, y: float, heading: float, speed: float) -> None:
        """Write where one car of world i of them is, at rest on its springs, and leave the others as they are."""
        model, state = self.world.model, self.physics.states[i]
        data = mujoco.MjData(model)
        mujoco.mj_setState(model, data, state, int(STATE))
        controls = data.ctrl.copy()
        self.world.cars[car].write_pose(data, x, y, heading, speed)
        data.ctrl[:] = controls  # those of the tick that was driven, which are recorded
        first = int(self._car_places[car, FIRST_TIRE])
        if first >= 0:
            data.userdata[USERDATA * first : USERDATA * (first + len(WHEELS))] = 0.0
        mujoco.mj_getState(model, data, state, int(STATE))
        kept = state.copy()
        self._forward(np.array([i], np.int32))
        state[:] = kept  # a forward pass leaves another start for the solver

    def _touch_walls(self) -> Mask:
        """Say which cars touch anything but a car now. Shape (r,)."""
        sensors = self.physics.sensors
        contacts = sensors[:, self._chassis_contacts]
        for car, others in enumerate(self._touch_places):
            contacts[:, car] -= sensors[:, np.delete(others, car)].sum(axis=1)
        touched: Mask = (contacts > 0.0).ravel()
        return touched

    def _begin(self, which: Mask) -> None:
        """Begin the races of the cars `which` (r,) where they are now."""
        monitor, course = self._monitor, self.world.track
        others = monitor.running & ~which
        monitor.running[:] = which  # a timer gets each moment only once
        if course is not None:
            rows = np.flatnonzero(which)
            first = self.layout.qpos[0] + self._arrays.constants["free_qpos"][rows]
            states = self.physics.states[rows // self._cars_per_world]
            timers = fresh_timers(len(rows))
            at = np.arange(len(rows))
            first_seen(timers, course, np.column_stack((states[at, first], states[at, first + 1])))
            self._line_up(timers, rows)
            monitor.timers[rows] = timers
            monitor.lap_times[rows] = monitor.standing_since[rows] = np.nan
            self.judge()
        monitor.running |= others

    def _line_up(self, timers: NDArray[np.void], rows: NDArray[np.int64]) -> None:
        """Count the progress of the cars of each world from where its car 0 starts, as from the start line."""
        course, m = self.world.track, self._cars_per_world
        if m == 1 or course.origin is not None:
            return
        modulus = course.modulus
        pole = timers["place"][np.searchsorted(rows, rows // m * m)]
        timers["progress"] = (timers["place"] - pole + 0.5 * modulus) % modulus - 0.5 * modulus
        timers["mark"] = timers["progress"]

    def read(self, i: int, data: mujoco.MjData) -> None:
        """Write world i of them into a mujoco.MjData of its model, poses current."""
        model = self.world.model
        if self._alone is None:
            self.physics.read(i, data)
            mujoco.mj_kinematics(model, data)  # a step leaves poses one timestep behind the state
        else:
            mujoco.mj_setState(model, data, self.physics.states[i], int(STATE))
            mujoco.mj_fwdPosition(model, data)

    def go_on_from(self, other: WorldBatch, places: slice) -> None:
        """Take over the states of worlds of another batch."""
        self.physics.states[:] = other.physics.states[places]
        self.physics.sensors[:] = other.physics.sensors[places]
        self.physics.warnings[:] = other.physics.warnings[places]

    def load(self, i: int, state: FloatArray, *, timed: bool) -> None:
        """Put world i of them into a recorded state (k,), its sensors up to date; begin its races if `timed`."""
        self.physics.states[i] = state
        self._forward(np.array([i], np.int32))
        self.physics.states[i] = state  # a forward pass leaves another start for the solver
        if timed:
            which = np.arange(len(self._arrays.crashed)) // self._cars_per_world == i
            self._arrays.crashed[which] = self._touch_walls()[which]
            self._arrays.touched_at[which] = -np.inf
            self._begin(which)

    @property
    def table_address(self) -> int:
        """Address of the table of all arrays, for what goes through several batches."""
        return self._table.address

    @property
    def ticks_at_once(self) -> bool:
        """Whether `tick` can drive these worlds."""
        return self.drawn is not None and self.world.track is not None and self._cars_per_world == 1

    def tick(self, calls: Calls, limit: float, kept: ArrayTable, took: FloatArray, waiting: Mask) -> tuple[int, int]:
        """Sense, decide, drive and judge, several times in one compiled call, see `ticks` in _native.pyi."""
        return core.ticks(self._table.address, calls, limit, kept.address, took, waiting)

    def judge(self) -> None:
        """Time the laps of the cars that race and end what is over."""
        core.judge_all(np.array([self._table.address]))

    @property
    def driven(self) -> NDArray[np.int32]:
        """Whether each of the worlds has a car that races."""
        running = self._monitor.running.reshape(-1, self._cars_per_world)
        return np.flatnonzero(running.any(axis=1)).astype(np.int32)

    def hold(self, ids: NDArray[np.int32], controls: FloatArray | None) -> None:
        """Begin a tick of single steps in the worlds `ids`: hold the commands, or recorded controls (worlds, k)."""
        self._ids[: len(ids)] = ids
        if controls is not None:
            self.physics.states[:, slice(*self.layout.ctrl)] = controls
            return
        core.hold(self._table.address, len(ids))

    def step(self, ids: NDArray[np.int32], step: int) -> None:
        """Do one physics step of a tick in the worlds `ids`."""
        self._ids[: len(ids)] = ids
        self._do_steps(len(ids), step, advance=True)

    def _forward(self, ids: NDArray[np.int32]) -> None:
        """Work out everything of the worlds `ids` where they are now, sensors and tires' forces too."""
        self.physics.forward(ids)
        if self._on_own_tires:
            self._ids[: len(ids)] = ids
            self._do_steps(len(ids), 0, advance=False)

    def _do_steps(self, count: int, step: int, *, advance: bool) -> None:
        core.step(self._table.address, count, step, step + 1, advance)

    def book(self, ids: NDArray[np.int32]) -> None:
        """End a tick of single steps in the worlds `ids`: write what tires and chassis did."""
        self._ids[: len(ids)] = ids
        core.book(self._table.address, len(ids))
