"""A course and its definition: all numbers that make it what it is, their hash, and the course made of them again."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..errors import TrackError
from ..messages import FloatArray
from .course import ISLAND, Course
from .moving_obstacles import MovingObstacle
from .obstacles import solids_of
from .track import MapTrack, Track

_TRACK = ("centreline", "width_right", "width_left")
_WALLS = ("wall_right", "wall_left")
_SCENE = ("way", "rules", "walls", "obstacles", "moving")


def course_sha256(course: Course) -> str:
    """Return the hash of all that makes a course what it is."""
    return definition_sha256(course.definition)


def definition_sha256(definition: Mapping[str, FloatArray]) -> str:
    """Return the hash of the numbers of a definition, in their order."""
    digest = hashlib.sha256()
    for numbers in definition.values():
        digest.update(np.ascontiguousarray(numbers, "<f8").tobytes())
    return digest.hexdigest()


def course_of(name: str, definition: Mapping[str, FloatArray]) -> Course:
    """Return the course whose `definition` this is; raise TrackError for that of a class of another package."""
    from .scene import Scene

    islands = sorted((key for key in definition if key.startswith(ISLAND)), key=lambda key: int(key[len(ISLAND) :]))
    names = tuple(key for key in definition if key not in islands)
    moving = tuple(map(MovingObstacle.of, definition.get("moving", ())))
    dressed: dict[str, Any] = {}
    if "built" in definition or "kinds" in definition:
        from .built_walls import Walls
    if "built" in definition:
        dressed["built"] = Walls.of(definition["built"])
    if "relief" in definition:
        from .ground import Relief

        dressed["relief"] = Relief.of(definition)
    shared = ("relief", "heights") if "rules" in names else ("moving", "built", "relief", "heights", "kinds", "marks")
    names = tuple(key for key in names if key not in shared)
    lines: dict[str, Any] = {key: definition[key] for key in names} | dressed
    if names == _TRACK:
        return Track(name=name, moving=moving, **lines)
    if names == _TRACK + _WALLS:
        outlines = tuple(definition[key] for key in islands)
        if "marks" in definition:
            lines |= {"kinds": tuple(map(Walls.of, definition["kinds"])), "marks": definition["marks"]}
        return MapTrack(name=name, moving=moving, outlines=outlines, **lines)
    if names == _SCENE:
        start, goal, time_limit, goal_is_to_stop = definition["rules"].tolist()
        return Scene(
            name=name, way=definition["way"], start=start, goal=goal, time_limit=time_limit,
            goal_is_to_stop=bool(goal_is_to_stop), walls=solids_of(definition["walls"]),
            obstacles=solids_of(definition["obstacles"]), moving=moving, **dressed,
        )  # fmt: skip
    if names == ("seconds",):
        from .open_ground import OpenGround

        return OpenGround(seconds=float(definition["seconds"][0]), name=name, **dressed)
    raise TrackError(f"course {name!r} is made of {', '.join(definition)}; accepted: the parts of a Track or a Scene")
