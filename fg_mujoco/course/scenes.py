"""Scenes by name. A scene is made from a seed and for a car: the same name, seed and car give the same scene.

    scene = load_scene("scene:cylinder_field:3", car)

The bundled scenes are of the add-on arena. A distribution adds scenes of its own by entry points of the group
`fg_mujoco.scenes`. In its pyproject.toml:

    [project.entry-points."fg_mujoco.scenes"]
    my_scene = "my_package.my_module:my_scene"

`my_scene(name, seed, car)` returns a Scene, or any other course, and its docstring says in one line what the scene is.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from importlib.metadata import EntryPoint

from ..errors import TrackError, accepted_names
from ..messages import CarParameters
from ..registry import Registry, added, package_of
from .course import Course, require_course

PREFIX = "scene:"

WIDEST_CAR = 0.6
"""[m] Width of the widest car that the bundled scenes have room for."""

SceneMaker = Callable[[str, int, CarParameters], Course]
"""Makes a scene of a name, `scene:NAME:SEED`, from the seed and for the car."""

SCENES: Registry[SceneMaker] = Registry("scene", TrackError, "fg_mujoco.scenes", added("SCENES"))


def scene_names() -> tuple[str, ...]:
    """Return the names of the bundled scenes and then of those of other distributions, without prefix and seed.

    Raises:
      TrackError: two scenes of one name, or a name that cannot stand in `scene:NAME:SEED`.
    """
    found: dict[str, str] = dict.fromkeys(SCENES, "a bundled scene")
    for point in SCENES.entry_points():
        scene, name = _said(point), point.name
        if not re.fullmatch(r"\w+", name):
            raise TrackError(f"{scene}: the name is {name!r}; accepted: letters, digits and underscores")
        if name in found:
            raise TrackError(f"{scene} has the name of {found[name]}; accepted: a name of its own")
        found[name] = scene
    return tuple(found)


def describe_scene(name: str) -> str:
    """Return the description of a scene, in one line; of another distribution, with the distribution."""
    origin = "" if name in SCENES else f" ({package_of(SCENES.entry_point(name))})"
    first_line = " ".join((SCENES.find(name).__doc__ or "").split("\n\n")[0].split())
    return f"{PREFIX}{name}: {first_line}{origin}"


def load_scene(name: str, car: CarParameters) -> Course:
    """Return the scene of a name, `scene:NAME:SEED`, or `scene:NAME`, which has seed 0, made for a car.

    Raises:
      TrackError: an unknown name, a seed that is no whole number from 0, a car that the bundled scenes have no room
        for, or a maker of another distribution that fails or returns no course of this name.
    """
    kind, colon, seed = name.removeprefix(PREFIX).partition(":")
    if kind not in SCENES and kind not in scene_names():
        raise TrackError(
            f"unknown scene {name!r}; {accepted_names(kind, scene_names(), ', as scene:NAME or scene:NAME:SEED')}"
        )
    if colon and not re.fullmatch("[0-9]{1,18}", seed):
        raise TrackError(
            f"{name!r} has no seed; accepted: scene:NAME:SEED with SEED a whole number from 0, as {PREFIX}{kind}:7"
        )
    number = int(seed or 0)
    full_name = f"{PREFIX}{kind}:{number}"
    if kind in SCENES:
        if car.width > WIDEST_CAR:
            raise TrackError(f"{name!r} for a car {car.width:.2f} m wide; accepted: at most {WIDEST_CAR} m")
        return SCENES.find(kind)(full_name, number, car)
    return _make_registered(kind, full_name, number, car)


def _said(point: EntryPoint) -> str:
    return f"scene {point.name!r} of {package_of(point)}, {point.value}"


def _make_registered(kind: str, name: str, seed: int, car: CarParameters) -> Course:
    """Return a scene of another distribution."""
    scene, make = _said(SCENES.entry_point(kind)), SCENES.find(kind)
    if not callable(make):
        raise TrackError(f"{scene} is a {type(make).__name__}; accepted: a function (name, seed, car) -> Scene")
    try:
        course = make(name, seed, car)
    except TrackError:
        raise
    except Exception as error:
        raise TrackError(f"{scene} cannot be made: {type(error).__name__}: {error}") from error
    require_course(course, scene)
    if course.name != name:
        raise TrackError(f"{scene} is named {course.name!r}; accepted: {name!r}, the name that it is given")
    return course
