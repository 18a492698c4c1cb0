"""The ground of a run: a course that is made or loaded, and the boxes that are put on it with a seed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from fg_mujoco.course.clearance import least_clearance, outline
from fg_mujoco.course.course import Course, wall_outlines
from fg_mujoco.course.definitions import course_sha256
from fg_mujoco.course.obstacles import Obstacle
from fg_mujoco.course.random_obstacles import random_boxes
from fg_mujoco.course.scenes.catalogue import PREFIX
from fg_mujoco.errors import SettingsError
from fg_mujoco.messages import CarParameters, FloatArray
from fg_mujoco.simulation.course_loading import default_car, load_track


@dataclass(frozen=True)
class Ground:
    """A course, and the boxes that were put on it besides the course's own obstacles."""

    course: Course
    boxes: tuple[Obstacle, ...] = ()

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
        shapes = (*wall_outlines(self.course), *(obstacle.corners() for obstacle in self.obstacles))
        nearest = [least_clearance(poses, np.concatenate([outline(shape) for shape in shapes]), car)]
        for obstacle in self.course.moving:
            shape = np.array([obstacle.corners(time) for time in times.tolist()])
            nearest.append(least_clearance(poses, outline(shape), car))
        return min(nearest)


def course_ground(
    course: str,
    seed: int | None,
    obstacles: int = 0,
    *,
    car: CarParameters | None = None,
    moved: Callable[[Course], Course] = lambda course: course,
) -> Ground:
    """Return the ground of a run.

    Args:
      course: a track as `load_track` takes it, or `scene:NAME`.
      seed: of the scene, or of the boxes on a track.
      obstacles: boxes on a track; a scene has its own obstacles.
      car: that they are made for; None: the default vehicle.
      moved: puts what moves on the course.

    Raises:
      TrackError, SettingsError: a course that cannot be loaded, or more boxes than it has room for.
    """
    car = car or default_car()
    if course.startswith(PREFIX):
        return Ground(moved(_load(_seeded(course, seed), car)))
    track = moved(_load(course, car))
    return Ground(track, random_boxes(track, obstacles, seed or 0, car=car))


def check_course(course: str, obstacles: int, *, car: CarParameters) -> None:
    """Refuse a course that the car cannot drive.

    Raises:
      TrackError, SettingsError: as `course_ground`; or the course is too narrow, or no walls can be put round it.
    """
    found = _load(_seeded(course, 0), car)
    found.check_car(car)
    if course.startswith(PREFIX) or obstacles == 0:
        return
    most = found.obstacle_sites(car).most
    if obstacles > most:
        raise SettingsError(f"{obstacles} obstacles on track {found.name!r}; accepted: at most {most}")


def course_name(course: str) -> str:
    """Return the name of a course in tables: of a file without its folder."""
    return Path(course).stem if course.endswith(".csv") else course


def ground_sha256(course: str, seed: int | None, *, car: CarParameters) -> str:
    """Return the hash of all numbers that make a course with a seed, for this car, what it is."""
    return course_sha256(_load(_seeded(course, seed), car))


def laps_of(course: Course, laps: int) -> int:
    """Return how many laps are driven where `laps` are asked for: a scene is driven once."""
    return laps if course.most_laps is None else min(laps, course.most_laps)


def _seeded(course: str, seed: int | None) -> str:
    """Return the name of a course with its seed, if it takes one."""
    return f"{course}:{seed or 0}" if course.startswith(PREFIX) else course


@lru_cache(maxsize=128)
def _load(name: str, car: CarParameters) -> Course:
    return load_track(name, car=car)
