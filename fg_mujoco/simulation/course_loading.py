"""Courses for the car that drives them: whatever is not said of a car is that of the default vehicle."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TypeVar, overload

from ..course.course import Course, require_course
from ..course.formats import load_course
from ..errors import TrackError
from ..messages import CarParameters, FloatArray
from ..vehicle.vehicle import Vehicle

AnyCourse = TypeVar("AnyCourse", bound=Course)


def default_car() -> CarParameters:
    """Return the parameters of the default vehicle."""
    return Vehicle.load().parameters


@overload
def load_track(source: str | Path, *, car: CarParameters | None = None) -> Course: ...
@overload
def load_track(source: AnyCourse, *, car: CarParameters | None = None) -> AnyCourse: ...
@overload
def load_track(source: Course | str | Path, *, car: CarParameters | None = None) -> Course: ...
def load_track(source: Course | str | Path, *, car: CarParameters | None = None) -> Course:
    """Load a course: a circuit or a scene.

    Args:
      source: a bundled name, `random:SEED`, `random:SEED:tight`, `scene:NAME`, `scene:NAME:SEED`,
        `open_ground:SECONDS`, a path to a centreline `.csv` or to a map's `.yaml` (map_track.load_map);
        or a course, which is returned.
      car: that a scene is made for; None: the default vehicle.

    Raises:
      TrackError: an unknown name, a file that cannot be read, or an object that is no course.
    """
    if isinstance(source, (str, Path)):
        return load_course(source, car or default_car())
    require_course(source, "the track")
    return source


def reload_course(name: str, definition: Mapping[str, FloatArray]) -> Course:
    """Return the course that was written down; TrackError: one of a user's class that is another one now."""
    from ..course.definitions import course_of, course_sha256, definition_sha256

    try:
        return course_of(name, definition)
    except TrackError:
        found = load_track(name)
        if course_sha256(found) != definition_sha256(definition):
            raise TrackError(f"course {name!r} is not the one that was driven; accepted: the same numbers") from None
        return found
