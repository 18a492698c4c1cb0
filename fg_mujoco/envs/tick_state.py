"""The state of the cars after a tick: what reward terms, end conditions and observations are functions of.

    def off_line(state: TickState) -> NDArray[np.bool_]:
        return np.abs(state.offset) > 1.0

All arrays have one row for each car and are read-only views, which the next tick overwrites. They are the true state
of the simulation: a car does not know most of them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from ..arguments import Suggesting
from ..course.clearance import clearances
from ..course.course import outline, wall_outlines
from ..messages import CarParameters, FloatArray
from ..native import core
from ..native_arrays import ArrayTable
from ..simulation.engine import Engine
from ..simulation.termination import END_REASONS
from ..simulation.world import World

Mask = NDArray[np.bool_]
Whole = NDArray[np.int64]

_FINISHED = END_REASONS.index("finished")


class Ground:
    """The course of a world, and what stands and moves on it, from above."""

    def __init__(self, world: World) -> None:
        self._course, self._solids = world.track, (*world.track.obstacles, *world.obstacles)

    def heading_errors(self, poses: FloatArray, places: FloatArray) -> FloatArray:
        """Return the angles (n,) [rad] from the course at `places` (n,) [m] to headings of `poses` (n, 3), left +."""
        errors = np.empty(len(poses))
        core.heading_errors(np.ascontiguousarray(poses), np.ascontiguousarray(places), self._course.table, errors)
        return errors

    def curvatures(self, places: FloatArray, ahead: Sequence[float]) -> FloatArray:
        """Return by how much the course turns over distances ahead [m], less than pi. Shape (n, distances) [1/m]."""
        still = np.zeros((len(places), 3))
        now, found = self.heading_errors(still, places), np.empty((len(places), len(ahead)))
        for column, distance in enumerate(ahead):
            turned = now - self.heading_errors(still, np.mod(places + distance, self._course.modulus))
            found[:, column] = (turned - 2.0 * math.pi * np.round(turned / (2.0 * math.pi))) / distance
        return found

    def distances(self, times: FloatArray, poses: FloatArray, car: CarParameters) -> FloatArray:
        """Return how far footprints at `poses` (n, 3) are from what stands, or moves at `times` (n,) [s], (n,) [m]."""
        poses = np.array(poses)
        found = clearances(poses, self._sides, car)
        for obstacle in self._course.moving:
            corners = np.array([obstacle.corners(time) for time in times.tolist()])
            found = np.minimum(found, clearances(poses, outline(corners), car))
        return found

    @cached_property
    def _sides(self) -> FloatArray:
        """The sides of what stands. Shape (k, 4) [m]."""
        shapes = [*wall_outlines(self._course), *(solid.corners() for solid in self._solids)]
        return np.concatenate([outline(shape) for shape in shapes]) if shapes else np.empty((0, 4))


class GroundOfEach(Ground):
    """The grounds of cars whose worlds differ, and may become others."""

    def __init__(self, engine: Engine, rows: slice) -> None:
        self._engine, self._rows = engine, np.arange(len(engine.commands))[rows]
        self._grounds: WeakKeyDictionary[World, Ground] = WeakKeyDictionary()

    def heading_errors(self, poses: FloatArray, places: FloatArray) -> FloatArray:
        """See Ground."""
        errors = np.empty(len(poses))
        for ground, cars in self._each():
            errors[cars] = ground.heading_errors(poses[cars], places[cars])
        return errors

    def curvatures(self, places: FloatArray, ahead: Sequence[float]) -> FloatArray:
        """See Ground."""
        found = np.empty((len(places), len(ahead)))
        for ground, cars in self._each():
            found[cars] = ground.curvatures(places[cars], ahead)
        return found

    def distances(self, times: FloatArray, poses: FloatArray, car: CarParameters) -> FloatArray:
        """See Ground."""
        distances = np.empty(len(poses))
        for ground, cars in self._each():
            distances[cars] = ground.distances(times[cars], poses[cars], car)
        return distances

    def _each(self) -> Iterator[tuple[Ground, list[int]]]:
        """Yield each ground, and which of the cars are on it."""
        cars_on: dict[World, list[int]] = {}
        for car, row in enumerate(self._rows.tolist()):
            cars_on.setdefault(self._engine.world_of(row // self._engine.cars_per_world), []).append(car)
        for world, cars in cars_on.items():
            if world not in self._grounds:
                self._grounds[world] = Ground(world)
            yield self._grounds[world], cars


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Snapshot(Suggesting):
    """Poses and states of n cars at one moment."""

    ground: Ground  # of their world
    car: CarParameters  # of these cars, which are alike
    time: FloatArray  # (n,) [s] since the episode began
    progress: FloatArray  # (n,) [m] along the course since the start, backward negative
    place: FloatArray  # (n,) [m] along the course from its first point
    offset: FloatArray  # (n,) [m] of the rear axle from the line of the course, left positive: the cross-track error
    laps: Whole  # (n,) completed
    pose: FloatArray  # (n, 3) x [m], y [m], heading [rad] of the rear axle in the world
    velocity: FloatArray  # (n, 3) of the rear axle ahead [m/s] and to the left [m/s]; yaw rate [rad/s]
    command: FloatArray  # (n, 2) that was held in the tick: steering angle [rad], speed [m/s]; 0 before the first tick
    action: FloatArray  # (n, 2) last one of the policy, from -1 to 1 within its bounds; 0 before the first
    slip_speed: FloatArray  # (n,) [m/s] of the axles across their wheels at the start of the tick, the mean of both
    sliding: FloatArray  # (n,) share of the tick in which a tire slid, from 0 to 1
    crashed: Mask  # (n,) whether the chassis has touched a wall or an obstacle
    rolled_over: Mask  # (n,) whether the car lies on its side or its roof
    finished: Mask  # (n,) whether the last lap is completed
    touches: Whole  # (n,) how often the car has touched another car
    position: Whole  # (n,) among the cars of the world, 1 in front
    lead: FloatArray  # (n,) [m] on the foremost other car along the course, negative behind it; inf: there is no other
    mu: FloatArray  # (n,) coefficient of friction of the floor, besides patches

    @property
    def speed(self) -> FloatArray:
        """True speed of the rear axle along the heading, forward positive. Shape (n,) [m/s]."""
        return self.velocity[:, 0]

    @property
    def lateral_speed(self) -> FloatArray:
        """True speed of the rear axle to the left. Shape (n,) [m/s]."""
        return self.velocity[:, 1]

    @property
    def yaw_rate(self) -> FloatArray:
        """True yaw rate, left positive. Shape (n,) [rad/s]."""
        return self.velocity[:, 2]

    @property
    def heading_error(self) -> FloatArray:
        """Angle from the direction of the course to the heading, left positive, within pi. Shape (n,) [rad]."""
        return self.ground.heading_errors(self.pose, self.place)

    @property
    def curvature(self) -> FloatArray:
        """Mean curvature of the course over the next 1, 2 and 4 m, left positive. Shape (n, 3) [1/m]."""
        return self.ground.curvatures(self.place, (1.0, 2.0, 4.0))

    @property
    def wall_distance(self) -> FloatArray:
        """Distance from the car's footprint to the nearest wall or obstacle, 0 where they touch. Shape (n,) [m].

        Other cars do not count.
        """
        return self.ground.distances(self.time, self.pose, self.car)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class TickState(Snapshot):
    """States of n cars after a tick and before it."""

    before: Snapshot  # at the beginning of the tick; before the first tick of an episode the same as now
    period: float  # of a tick [s]


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class SensedState(TickState):
    """The same, and what the cars' sensors read now: for observations."""

    ranges: FloatArray  # (n, beams) [m] as in LaserScan, rightmost beam first
    odometry: NDArray[np.void]  # (n,) of ODOMETRY: wheel speed, steering angle, gyro, accelerometer


class TickStates:
    """Keeps the states of an engine's cars, from tick to tick."""

    def __init__(self, engine: Engine, *, apart: bool = False) -> None:
        self._engine, count = engine, len(engine.commands)
        self._common = None if apart else Ground(engine.world)
        (self._now, self._all_now), (self._before, self._all_before) = _fresh(count), _fresh(count)
        self._driven = np.zeros(count, np.bool_)
        self.actions = np.zeros((count, 2))  # of policies, as in Snapshot
        world = engine.world
        wheelbases = [car.parameters.wheelbase for car in world.cars]
        self._wheelbases = np.tile(wheelbases, count // len(world.cars))
        self._table = ArrayTable(_NAMES, {name: self._now[name] for name in _JUDGED} | {
            "timers": engine.monitor.timers, "commands": engine.commands, "actions": self.actions,
            "telemetry": engine.telemetry, "crashes": engine.crashed, "reasons": engine.monitor.reasons,
            "statistics": engine.statistics, "wheelbases": self._wheelbases,
        })  # fmt: skip

    def of(self, rows: slice, car: CarParameters) -> TickState:
        """Return the state of some cars, which are alike; it stays up to date."""
        ground = self._common or GroundOfEach(self._engine, rows)
        before = Snapshot(ground=ground, car=car, **_views(self._before, rows))
        return TickState(ground=ground, car=car, before=before, period=self._engine.period, **_views(self._now, rows))

    def sensed(self, state: TickState, rows: slice) -> SensedState:
        """Return the state of some cars with what their sensors read; it stays up to date."""
        own = {f.name: getattr(state, f.name) for f in fields(state)}
        return SensedState(**own, **_views({"ranges": self._engine.ranges, "odometry": self._engine.odometry}, rows))

    def begin(self, which: Mask) -> None:
        """Read the states of the cars `which` (r,), whose episodes begin."""
        self._driven[:] = which
        self._read_motions()
        self.judge()
        self._now["mu"][which] = self._engine.mu[which].max(axis=1)
        if self._common is None:
            for row in np.flatnonzero(which).tolist():
                i, car = divmod(row, self._engine.cars_per_world)
                self._wheelbases[row] = self._engine.world_of(i).cars[car].parameters.wheelbase
        for name in ("command", "action", "sliding", "slip_speed"):
            self._now[name][which] = 0.0
        self._now["mu"][which] = self._engine.frictions[which]
        for name, values in self._now.items():
            self._before[name][which] = values[which]

    def drive(self, driven: Mask) -> None:
        """Read where the cars `driven` (r,) are after a tick, before those that finish are taken off the course."""
        self._all_before[:] = self._all_now
        self._driven[:] = driven
        self._read_motions()
        core.note_slips(self._table.address, self._driven)

    def judge(self) -> None:
        """Read what the race monitor says of the cars that were driven."""
        engine = self._engine
        core.note_judged(self._table.address, self._driven, engine.substeps)
        if engine.cars_per_world > 1:
            np.copyto(self._now["position"], positions(engine), where=self._driven)
            np.copyto(self._now["lead"], leads(engine), where=self._driven)

    def _read_motions(self) -> None:
        self._engine.read_motions(self._driven, self._now["pose"], self._now["velocity"])


def _views(arrays: Mapping[str, NDArray[Any]], rows: slice) -> dict[str, Any]:
    """Return views of some rows of arrays, by name, that cannot be written to."""
    found = {name: values[rows] for name, values in arrays.items()}
    for values in found.values():
        values.flags.writeable = False
    return found


def positions(engine: Engine) -> Whole:
    """Return each car's position in its world, 1 in front; who finished sooner is before the others. Shape (r,)."""
    monitor = engine.monitor
    finished_at = np.where(monitor.reasons == _FINISHED, monitor.timers["lap_start"], np.inf)
    each = finished_at.reshape(-1, engine.cars_per_world)
    own, others = each[:, :, np.newaxis], each[:, np.newaxis, :]
    ahead = (others < own) | ((others == own) & (_gaps(engine) < 0.0))
    found: Whole = 1 + np.count_nonzero(ahead, axis=2).ravel()
    return found


def leads(engine: Engine) -> FloatArray:
    """Return how far each car is ahead of the foremost other car of its world, negative behind it. Shape (r,) [m]."""
    others = ~np.eye(engine.cars_per_world, dtype=np.bool_)
    found: FloatArray = np.min(_gaps(engine), axis=2, where=others, initial=np.inf).ravel()
    return found


def _gaps(engine: Engine) -> FloatArray:
    """Return how far each car is ahead of each car of its world along the course. Shape (n, m, m) [m]."""
    progress = engine.monitor.timers["progress"].reshape(-1, engine.cars_per_world)
    with np.errstate(invalid="ignore"):  # of two cars that take no part
        gaps: FloatArray = progress[:, :, np.newaxis] - progress[:, np.newaxis, :]
    return gaps


def _fresh(count: int) -> tuple[dict[str, NDArray[Any]], NDArray[np.float64]]:
    """Return the arrays of a Snapshot of so many cars, by name, as they are of a car that is alone; and all as one."""
    widths = {"pose": 3, "velocity": 3, "command": 2, "action": 2}
    kinds: dict[str, Any] = {"laps": np.int64, "touches": np.int64, "position": np.int64}
    kinds |= dict.fromkeys(("crashed", "rolled_over", "finished"), np.bool_)
    names = [f.name for f in fields(Snapshot) if f.name not in ("ground", "car")]
    together = np.zeros((sum(widths.get(name, 1) for name in names), count))
    arrays, first = {}, 0
    for name in names:
        end = first + widths.get(name, 1)
        flat, first = together[first:end].reshape(-1).view(kinds.get(name, np.float64)), end
        arrays[name] = flat.reshape(count, -1) if name in widths else flat[:count]
    arrays["position"][:], arrays["lead"][:] = 1, math.inf
    return arrays, together


_JUDGED = (
    "time", "progress", "place", "offset", "laps", "command", "action", "slip_speed", "sliding", "crashed",
    "rolled_over", "finished", "touches",
)  # fmt: skip
_NAMES = (*_JUDGED, "timers", "commands", "actions", "telemetry", "crashes", "reasons", "statistics", "wheelbases")
