"""The ground of a run: a course that is made or loaded, and the boxes that are put on it with a seed."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

from fg_mujoco.course.course import Course
from fg_mujoco.course.definitions import course_sha256
from fg_mujoco.course.obstacles import Obstacle
from fg_mujoco.course.scenes import PREFIX
from fg_mujoco.errors import SettingsError
from fg_mujoco.messages import CarParameters
from fg_mujoco.racing.resolved import Ground
from fg_mujoco.simulation.course_loading import default_car, load_track


def course_ground(
    course: str,
    seed: int | None,
    obstacles: Sequence[Obstacle] | int = 0,
    *,
    car: CarParameters | None = None,
    **placed: Any,
) -> Ground:
    """Return the ground of a run.

    Args:
      course: a track as `load_track` takes it, or `scene:NAME`.
      seed: of the scene, or of the boxes on a track.
      obstacles: those on a track, or how many boxes; a scene has its own and no boxes.
      car: that they are made for; None: the default vehicle.
      placed: `moving`, `start` and `cars`, as `Ground.of` takes them.

    Raises:
      TrackError, SettingsError: a course that cannot be loaded, or more boxes than it has room for.
    """
    car = car or default_car()
    if course.startswith(PREFIX) and isinstance(obstacles, int):
        obstacles = 0
    track = _load(_seeded(course, seed), car)
    return Ground.of(track, car=car, obstacles=obstacles, obstacle_seed=seed or 0, **placed)


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
