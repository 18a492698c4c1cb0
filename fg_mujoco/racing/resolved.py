"""A setup, resolved once into what is raced: the ground, the compiled world, and each car's entry and start.

    raced = Resolved.of(Setup.of("oval", laps=2))
    raced.ground.course, raced.laps, raced.world, raced.starts

A race, the live view and a lab drive what `Resolved.of` returns. Rollouts, environments and studies compile worlds of
their own on a Ground.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .. import from_addons
from ..course.course import Course, laps_to_drive, wall_outlines
from ..course.moving_obstacles import MovingObstacle
from ..course.obstacles import Obstacle
from ..messages import CarParameters, Controller, FloatArray
from ..simulation.course_loading import load_track
from ..simulation.engine import Engine
from ..simulation.settings import Start
from ..simulation.world import World
from .entries import Entry, check_starts, entry_planner, grid_starts
from .setup import Setup


@dataclass(frozen=True)
class Ground:
    """A course with what moves there, and the obstacles that were put on it besides its own."""

    course: Course
    boxes: tuple[Obstacle, ...] = ()

    @classmethod
    def of(
        cls,
        track: Course | str | Path,
        *,
        car: CarParameters,
        obstacles: Sequence[Obstacle] | int = (),
        obstacle_seed: int = 0,
        moving: str | Sequence[MovingObstacle] = "",
        start: float = 0.0,
        cars: int = 1,
    ) -> Ground:
        """Return the ground of settings, which are those of a Setup.

        Args:
          track: as `load_track` takes it; a scene is made for the car.
          car: that is to get past everything.
          obstacles: to be put there, or how many boxes at random places.
          obstacle_seed: of the random places, and of `moving`.
          moving: what moves there.
          start: progress of the first car's start [m].
          cars: how many start there, one behind the other.

        Raises:
          TrackError: there is no such course, or it cannot be read.
          SettingsError: the course has too little room for the obstacles, or nothing can move on it.
        """
        course, placed = load_track(track, car=car), () if isinstance(obstacles, int) else tuple(obstacles)
        if moving:
            course = from_addons.with_moving(
                course, moving, obstacle_seed, car=car, start=start, cars=cars, obstacles=placed
            )
        if isinstance(obstacles, int) and obstacles != 0:
            from ..course.random_obstacles import random_boxes

            placed = random_boxes(course, obstacles, obstacle_seed, car=car, start=start)
        return cls(course, placed)

    @property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """All solids that stand there, besides the walls."""
        return (*self.course.obstacles, *self.boxes)

    def least_clearance(self, times: FloatArray, poses: FloatArray, car: CarParameters) -> float:
        """Return the least distance of a car's footprint to all walls and obstacles [m].

        Args:
          times: (n,) [s].
          poses: of the rear axle at these times, x [m], y [m], heading [rad]. Shape (n, 3).
          car: whose footprint it is.
        """
        from ..course.clearance import least_clearance
        from ..course.course import outline

        shapes = (*wall_outlines(self.course), *(obstacle.corners() for obstacle in self.obstacles))
        nearest = [least_clearance(poses, np.concatenate([outline(shape) for shape in shapes]), car)]
        for obstacle in self.course.moving:
            shape = np.array([obstacle.corners(time) for time in times.tolist()])
            nearest.append(least_clearance(poses, outline(shape), car))
        return min(nearest)


def ground_of(setup: Setup, track: Course | str | None = None) -> Ground:
    """Return the ground of a setup, made for car 0; errors as of `Ground.of`.

    Args:
      setup: whose ground it is.
      track: in place of the setup's; None: the setup's.
    """
    first = setup.first
    return Ground.of(
        setup.track if track is None else track, car=first.car.parameters, obstacles=setup.obstacles,
        obstacle_seed=setup.obstacle_seed, moving=setup.moving, start=(first.start or Start()).s,
        cars=len(setup.entries),
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True, eq=False)
class Resolved:
    """A setup with its course, world and cars made."""

    setup: Setup
    ground: Ground
    laps: int
    world: World  # of all cars
    entries: tuple[Entry, ...]  # each with its name
    starts: tuple[Start, ...]  # of the cars: their own, or their places on the grid

    @classmethod
    def of(cls, setup: Setup) -> Resolved:
        """Return what a setup says.

        Raises:
          TrackError: a course that cannot be read, or is narrower than a car.
          SettingsError: more laps than the course has, or obstacles that do not fit there.
          ModelError: cars that cannot be in one world.
        """
        ground, entries = ground_of(setup), setup.named
        others = [entry.world_car() for entry in entries[1:]]
        laps = laps_to_drive(ground.course, setup.laps)
        world = setup.drive_settings.world(
            ground.course, lidar=setup.lidar, obstacles=ground.boxes, others=others, keep=True
        )
        places = grid_starts(ground.course, [car.parameters for car in world.cars], setup.grid)
        starts = tuple(entry.start or place for entry, place in zip(entries, places, strict=True))
        return cls(setup=setup, ground=ground, laps=laps, world=world, entries=entries, starts=starts)

    @property
    def names(self) -> list[str]:
        """Names of the cars."""
        return [str(entry.name) for entry in self.entries]

    def check_starts(self) -> None:
        """Refuse starts at which a car does not fit; errors as of `entries.check_starts`."""
        names = self.names if len(self.entries) > 1 else [""]
        cars = [car.parameters for car in self.world.cars]
        check_starts(self.ground.course, self.starts, cars, names, self.ground.boxes)

    def build_planners(self) -> list[Controller]:
        """Return a planner for each car, ready for a race.

        Raises:
          ControllerError: one cannot be built; the message says whose it is.
        """
        planners = []
        for entry, car in zip(self.entries, self.world.cars, strict=True):
            alone, line = len(self.entries) == 1, self.ground.course.map_line
            planners.append(entry_planner(entry, car=car.parameters, map_line=line, alone=alone))
        return planners

    def place(self, engine: Engine) -> None:
        """Place the cars of an engine of the world at their starts; errors as of `Engine.place`."""
        engine.place(
            self.starts, effects=[entry.effects for entry in self.entries], seeds=[e.seed for e in self.entries],
            odometry_drifts=[entry.odometry_drift for entry in self.entries],
            sensors=[entry.sensed for entry in self.entries],
        )  # fmt: skip
