"""What a run of a comparison is driven on: a track or a scene, and what stands and moves there with a seed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from ...course.clearance import least_clearance, outline
from ...course.formats import load_track
from ...course.obstacles import Obstacle
from ...course.random_obstacles import ObstacleSites, random_boxes
from ...course.scene import Scene
from ...course.scenes.catalogue import PREFIX
from ...course.track import Track
from ...errors import SettingsError
from ...messages import CarParameters, FloatArray
from ...vehicle.vehicle import Vehicle
from ..rollout.job import track_sha256


@dataclass(frozen=True)
class Ground:
    """A course, and the obstacles that were put on it; a scene has its own besides."""

    course: Track | Scene
    obstacles: tuple[Obstacle, ...] = ()

    @property
    def walls(self) -> list[FloatArray]:
        """Outlines of the walls, closed without repeating a point. Shape (k, 2) [m] each."""
        if isinstance(self.course, Scene):
            return [wall.corners() for wall in self.course.walls]
        return [self.course.left_wall, self.course.right_wall, *self.course.islands]

    @property
    def standing(self) -> list[FloatArray]:
        """Footprints of the obstacles that stand, as `walls`."""
        own = self.course.obstacles if isinstance(self.course, Scene) else ()
        return [obstacle.corners() for obstacle in (*own, *self.obstacles)]

    def moving(self, times: FloatArray) -> list[FloatArray]:
        """Footprints of the obstacles that move, at times (n,) [s]. Shape (n, 4, 2) [m] each."""
        own = self.course.moving if isinstance(self.course, Scene) else ()
        return [np.array([obstacle.corners(time) for time in times.tolist()]) for obstacle in own]

    def least_clearance(self, times: FloatArray, poses: FloatArray, car: CarParameters) -> float:
        """Return the least distance of a car's footprint to all of these [m].

        Args:
          times: (n,) [s].
          poses: of the rear axle at these times, x [m], y [m], heading [rad]. Shape (n, 3).
          car: whose footprint it is.
        """
        standing = np.concatenate([outline(shape) for shape in (*self.walls, *self.standing)])
        moving = [least_clearance(poses, outline(shape), car) for shape in self.moving(times)]
        return min((least_clearance(poses, standing, car), *moving))


def course_ground(course: str, seed: int | None, obstacles: int = 0) -> Ground:
    """Return what is driven on.

    Args:
      course: a track as `load_track` takes it, or `scene:NAME`.
      seed: of the scene, or of the obstacles on a track.
      obstacles: boxes on a track; a scene has its own.

    Raises:
      TrackError, SettingsError: a course that cannot be loaded, or more obstacles than it has room for.
    """
    if course.startswith(PREFIX):
        return Ground(_load(f"{course}:{seed}"))
    track = _load(course)
    return Ground(track, random_boxes(track, obstacles, seed or 0))


def check_course(course: str, obstacles: int) -> None:
    """Refuse a course that no car can drive.

    Raises:
      TrackError, SettingsError: as `course_ground`; or it is too narrow, or no walls can be put round it.
    """
    found = _load(f"{course}:0" if course.startswith(PREFIX) else course)
    if isinstance(found, Track):
        load_track(found, minimum_width=Vehicle.load().parameters.width)
        _ = found.left_wall  # refuses corners without room for a wall
        if obstacles > 0 and obstacles > (most := ObstacleSites(found).most):
            raise SettingsError(f"{obstacles} obstacles on track {found.name!r}; accepted: at most {most}")


def course_name(course: str) -> str:
    """Return what a course is called in tables: a file without its folder."""
    return Path(course).stem if course.endswith(".csv") else course


def course_sha256(course: str) -> str | None:
    """Return the hash of a track's line and widths; None for a scene, which the sources alone make."""
    track = None if course.startswith(PREFIX) else _load(course)
    return track_sha256(track) if isinstance(track, Track) else None


def laps_of(course: Track | Scene, laps: int) -> int:
    """Return how many laps are driven where `laps` are asked for: a scene is driven once."""
    return laps if course.most_laps is None else min(laps, course.most_laps)


@lru_cache(maxsize=16)
def _load(source: str) -> Track | Scene:
    return load_track(source)
