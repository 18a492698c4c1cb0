"""Keeps how the cars of a world moved in the last second, and makes incidents of it for `fault.judge`.

recent = RecentMotion(engine)
engine.tick()
recent.keep()
verdict = judge(recent.incident((0, 1), step=2))
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np
from numpy.typing import NDArray

from fg_mujoco import portable
from fg_mujoco.messages import CarParameters, FloatArray
from fg_mujoco.simulation.cars import footprint
from fg_mujoco.simulation.engine import Engine
from fg_mujoco.simulation.telemetry import TELEMETRY
from fg_mujoco.simulation.world import OBSTACLE_PREFIX

from .fault import BRAKED_BY, BRAKING, LOOK_BACK, Approach, Incident

_COLUMNS = tuple(TELEMETRY.index(name) for name in ("x_m", "y_m", "heading_rad", "vx_m_s", "vy_m_s", "yaw_rate_rad_s"))
_TIME, _KEPT = TELEMETRY.index("time_s"), 1 + max(*_COLUMNS, TELEMETRY.index("time_s"))
_STEP = 0.5  # [m] over which the course's direction is compared
_BEND_BEHIND, _BEND_AHEAD = 2.0, 3.0  # [m] a line through a bend begins before it and ends behind it
_BENDS = 0.15  # [1/m] curvature from which the course bends
_SLOWS = 0.3  # of what friction allows: lateral acceleration from which a bend is something to brake for
_ASIDE = 1.0  # [m] to the side within which an obstacle is something to brake for
_FURTHEST = 30.0  # [m] ahead that is looked for something to brake for
_LEAST_SCALE, _GREATEST_SCALE = 0.25, 4.0


@dataclass(frozen=True, kw_only=True)
class _Placed:
    """A car's middles on the course. Arrays have a value a sample, (k,)."""

    along: FloatArray  # [m] on the course's line
    across: FloatArray  # [m] to its left
    heading: FloatArray  # [rad] from its direction
    speeds: FloatArray  # [m/s] at the start of each tick, (k - 1,)


class RecentMotion:
    """The last second of the cars of a world.

    Args:
      engine: with its cars placed.
      world: its number in the engine, whose world has a course.
    """

    def __init__(self, engine: Engine, world: int = 0) -> None:
        count = engine.cars_per_world
        self._engine, self._world = engine, world
        self._rows = slice(world * count, (world + 1) * count)
        self._telemetry = engine.telemetry[self._rows, :_KEPT]  # live
        self._ticks = 1 + round(LOOK_BACK / engine.period)
        self._kept = np.empty((self._ticks, count, _KEPT))
        self._last = -1
        self._placed = np.zeros(count, np.int64)  # tick in which each was last placed
        self._cars = engine.cars[self._rows]

    def keep(self) -> None:
        """Keep the state of the cars at the start of the tick that was driven."""
        self._last += 1
        self._kept[self._last % self._ticks] = self._telemetry

    def forget(self, car: int) -> None:
        """Forget how a car moved until now, because it is put elsewhere."""
        self._placed[car] = self._last + 1

    def incident(self, pair: tuple[int, int], step: int, pushed: tuple[bool, bool] = (False, False)) -> Incident:
        """Return the incident of two cars that first touched in a physics step of the last tick.

        Args:
          pair: numbers of the cars.
          step: of the tick, from 0.
          pushed: whether each was pushed here by another car.
        """
        built = self._engine.world_of(self._world)
        first = max(self._last - self._ticks + 1, 0, *(int(self._placed[car]) for car in pair))
        ticks = np.arange(first, self._last + 1) % self._ticks
        time = self._kept[ticks, 0, _TIME]
        lasted = step * float(built.model.opt.timestep)
        time = np.append(time, time[-1] + lasted)
        placed = {car: self._on_course(car, ticks, lasted) for car in pair}
        braked = {car: bool(placed[car].speeds.max() - placed[car].speeds[-1] >= 0.5 * BRAKED_BY) for car in pair}
        if any(braked.values()):  # else nobody asks whether there was something to brake for
            cars = range(self._engine.cars_per_world)
            placed |= {car: self._on_course(car, ticks, lasted) for car in cars if car not in pair}
        wrap = built.track.modulus
        at = float(placed[pair[0]].along[-1])
        along = {number: (car.along - at + 0.5 * wrap) % wrap - 0.5 * wrap for number, car in placed.items()}
        middle, offset = (
            0.5 * float(values[0] + values[1])
            for values in ([along[car][-1] for car in pair], [placed[car].across[-1] for car in pair])
        )
        bend = float(self._curvatures(at + middle - 0.5 * _STEP, at + middle)[0])
        scale = min(max(1.0 - bend * offset, _LEAST_SCALE), _GREATEST_SCALE)  # of a way beside the line
        scaled = {car: scale * each for car, each in along.items()}
        normal = self._normal(pair, lasted)
        course = float(self._directions(np.array([at + middle]))[0])
        approaches = []
        for car, was_pushed in zip(pair, pushed, strict=True):
            own, parameters = placed[car], self._car(car)
            approaches.append(
                Approach(
                    length=parameters.length, width=parameters.width, along=scaled[car], across=own.across,
                    heading=own.heading, grip=self._grip(car), pushed=was_pushed,
                    cause=not braked[car] or self._has_cause(car, scaled, placed, at, scale),
                )
            )  # fmt: skip
        bends = np.abs(self._curvatures(at + middle - _BEND_BEHIND, at + middle + _BEND_AHEAD))
        return Incident(
            time=time, cars=(approaches[0], approaches[1]), bend=bool(bends.max() >= _BENDS),
            normal=(
                float(normal @ (math.cos(course), math.sin(course))),
                float(normal @ (-math.sin(course), math.cos(course))),
            ),
        )  # fmt: skip

    def closing_speed(self, pair: tuple[int, int], step: int, place: tuple[float, float]) -> float:
        """Return how fast two cars came together at the start of the tick, at a place [m], along the normal [m/s]."""
        normal = self._normal(pair, step * float(self._engine.world_of(self._world).model.opt.timestep))
        speeds = []
        for car in pair:
            x, y, heading, vx, vy, yaw_rate = self._now(car)
            cos, sin = math.cos(heading), math.sin(heading)
            velocity = np.array([vx * cos - vy * sin, vx * sin + vy * cos])
            velocity += yaw_rate * np.array([y - place[1], place[0] - x])
            speeds.append(float(velocity @ normal))
        return speeds[0] - speeds[1]

    def between(self, pair: tuple[int, int]) -> FloatArray:
        """Return the place half-way between the rear axles of two cars when the last tick began. Shape (2,) [m]."""
        return np.asarray(0.5 * (self._now(pair[0]) + self._now(pair[1]))[:2])

    def _now(self, car: int) -> FloatArray:
        """Return x, y, heading, vx, vy and yaw rate of a car's rear axle at the start of the last tick."""
        return np.asarray(self._kept[self._last % self._ticks, car, _COLUMNS])

    def _pose(self, car: int, lasted: float) -> FloatArray:
        """Return the pose of a car's rear axle so long after the last tick began, at its velocity then. Shape (3,)."""
        x, y, heading, vx, vy, yaw_rate = self._now(car)
        half = heading + 0.5 * yaw_rate * lasted
        cos, sin = math.cos(half), math.sin(half)
        return np.array([
            x + lasted * (vx * cos - vy * sin), y + lasted * (vx * sin + vy * cos), heading + lasted * yaw_rate
        ])  # fmt: skip

    def _car(self, car: int) -> CarParameters:
        return self._cars[car].parameters

    def _grip(self, car: int) -> float:
        return self._cars[car].mu * self._cars[car].parameters.gravity

    @cached_property
    def _obstacles(self) -> FloatArray:
        """Where obstacles stand, from the model of the world, which a replay has, too. Shape (k, 2) [m]."""
        model = self._engine.world_of(self._world).model
        names = [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_GEOM, geom) or "" for geom in range(model.ngeom)]
        found = [model.geom_pos[geom][:2] for geom, name in enumerate(names) if name.startswith(OBSTACLE_PREFIX)]
        return np.array(found).reshape(-1, 2)

    def _normal(self, pair: tuple[int, int], lasted: float) -> FloatArray:
        """Return the direction from the first to the second of two cars in which they overlap least. Shape (2,)."""
        poses = [self._pose(car, lasted) for car in pair]
        shapes = [footprint(pose, self._car(car)) for pose, car in zip(poses, pair, strict=True)]
        return contact_normal(shapes[0], shapes[1])

    def _on_course(self, car: int, ticks: NDArray[np.int64], lasted: float) -> _Placed:
        """Return where the middle of a car's chassis was in some ticks, and so long after the last of them."""
        course, parameters = self._engine.world_of(self._world).track, self._car(car)
        poses = np.vstack((self._kept[ticks, car][:, _COLUMNS[:3]], self._pose(car, lasted)))
        ahead = 0.5 * parameters.length - parameters.rear_overhang
        points = poses[:, :2] + ahead * np.column_stack((portable.cos(poses[:, 2]), portable.sin(poses[:, 2])))
        along, across = np.empty(len(points)), np.empty(len(points))
        near = float(self._engine.monitor.timers["place"][self._rows][car])
        for i in range(len(points) - 1, -1, -1):  # each is near the one after it
            found = course.project(points[i : i + 1], near=near)
            along[i], across[i] = near, _ = float(found[0][0]), float(found[1][0])
        turned = poses[:, 2] - self._directions(along)
        speeds = np.abs(self._kept[ticks, car, _COLUMNS[3]])
        heading = np.remainder(turned + math.pi, 2.0 * math.pi) - math.pi
        return _Placed(along=along, across=across, heading=heading, speeds=speeds)

    @cached_property
    def _line(self) -> tuple[FloatArray, FloatArray]:
        """The middles of the segments of the course's line, by progress [m], and their directions, unwrapped [rad]."""
        starts, _, _, dx, dy, squared = self._engine.world_of(self._world).track.table[:6]  # without sections of bends
        return starts + 0.5 * np.sqrt(squared), np.unwrap(portable.arctan2(dy, dx))

    def _directions(self, s: FloatArray) -> FloatArray:
        """Return the direction of the course at places on its line [rad]: evenly from one segment to the next."""
        course = self._engine.world_of(self._world).track
        return np.interp(np.mod(s, course.modulus) if course.closed else s, *self._line)

    def _curvatures(self, first: float, last: float) -> FloatArray:
        """Return the curvature of the course between two places on its line [1/m]."""
        turned = np.diff(self._directions(np.arange(first, last + _STEP, _STEP)))
        return np.asarray((np.remainder(turned + math.pi, 2.0 * math.pi) - math.pi) / _STEP)

    def _has_cause(
        self, car: int, along: Mapping[int, FloatArray], placed: Mapping[int, _Placed], at: float, scale: float
    ) -> bool:
        """Return whether a car had something to brake for within its stopping distance."""
        built, grip = self._engine.world_of(self._world), self._grip(car)
        if built.moving:
            return True
        speed = float(placed[car].speeds.max())
        reach = min(speed**2 / (2.0 * BRAKING * grip) + self._car(car).length, _FURTHEST)
        first, last = float(along[car].min()), float(along[car].max()) + reach
        bends = self._curvatures(at + first / scale, at + last / scale)
        if np.abs(bends).max() * speed**2 >= _SLOWS * grip:
            return True
        for other, own in placed.items():
            ahead = along[other] > along[car]
            aside = np.abs(own.across - placed[car].across)
            width = 0.5 * (self._car(car).width + self._car(other).width)
            if other != car and np.any(ahead & (along[other] - along[car] < reach) & (aside < width)):
                return True
        if len(self._obstacles):
            s, offset = built.track.project(self._obstacles)
            wrap = built.track.modulus
            there = scale * ((s - at + 0.5 * wrap) % wrap - 0.5 * wrap)
            aside = np.abs(offset - placed[car].across[-1])
            return bool(np.any((there > first) & (there < last) & (aside < _ASIDE)))
        return False


def contact_normal(first: FloatArray, second: FloatArray) -> FloatArray:
    """Return the direction from one convex shape to another along which they overlap least, a unit vector (2,).

    Args:
      first: corners of the shape from above, one after the other (k, 2) [m].
      second: of the other.
    """
    best, found = -math.inf, np.zeros(2)
    for shape in (first, second):
        sides = np.roll(shape, -1, axis=0) - shape
        for side in sides / np.hypot(sides[:, 0], sides[:, 1])[:, np.newaxis]:
            axis = np.array([side[1], -side[0]])
            axis *= math.copysign(1.0, float((second.mean(axis=0) - first.mean(axis=0)) @ axis))
            apart = float((second @ axis).min() - (first @ axis).max())
            if apart > best + 1e-12:
                best, found = apart, axis
    return found
