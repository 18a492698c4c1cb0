"""The maps that scripts of f1tenth_gym name: files, tracks of a folder that the user names, and our own courses.

The gym comes with `vegas`, `berlin`, `skirk` and `levine`, and fetches tracks such as `Spielberg`. Here they are looked
for in a folder: `maps=` of `make` and of `install`, `--maps` of the command, or the variable FG_MUJOCO_MAPS.

The gym drives on any image. A map in which no course is found, or whose walls have a hole, is driven here as ground
among its walls; laps then count as they do there, by coming back to the start.
"""

from __future__ import annotations

import os
import tempfile
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from fg_mujoco.course.course import Course
from fg_mujoco.course.files import is_file, read_text
from fg_mujoco.course.maps.map_server import OccupancyMap, plain_yaml, read_map_file
from fg_mujoco.course.maps.map_track import is_map, read_map
from fg_mujoco.course.maps.walls import outlines, trace
from fg_mujoco.course.mjcf import inside
from fg_mujoco.course.obstacles import Prism
from fg_mujoco.course.open_ground import OpenGround
from fg_mujoco.course.polyline import enclosed_area
from fg_mujoco.course.scene import BEHIND, BEYOND, Scene
from fg_mujoco.course.track import Track
from fg_mujoco.course.track_mesh import wall_footprints
from fg_mujoco.errors import MissingExtraError, SettingsError, TrackError, nearest
from fg_mujoco.messages import CarParameters
from fg_mujoco.simulation.course_loading import load_track

FOLDER = "FG_MUJOCO_MAPS"
"""Environment variable: the folder of maps that scripts ask for by name."""

_PATTERNS = ("{0}/{0}_map.yaml", "{0}_map.yaml", "{0}.yaml", "{0}/{0}.yaml", "maps/{0}.yaml", "maps/{0}/{0}_map.yaml")
_IMAGES = (".png", ".pgm")
_LEAST_GROUND = 1.0  # [m^2] of free ground that walls are put round, where no course is found
_FOREVER = 1e6  # [s]
_BLANK = "_blank"  # of the gym's tracks that are without walls, as Spielberg_blank


def find_map(
    name: str,
    extension: str | None,
    *,
    folder: str | Path | None = None,
    scale: float = 1.0,
    car: CarParameters,
) -> tuple[Course, Path | None]:
    """Return the course of a map, larger by `scale`, and its YAML; None: a course of this package.

    `name` is the path of a map_server YAML with or without `.yaml`, a track in the folder, or what `load_track` takes;
    `extension` is of the map's image, as `.png`; None: the image that the YAML names.
    Raises TrackError: no such map, or one that cannot be read.
    """
    if is_map(name) and not name.endswith((".yaml", ".yml")):  # with settings in brackets
        return _larger(load_track(name, car=car), scale), None
    path = find_file(name, folder)
    walled = find_file(name.removesuffix(_BLANK), folder) if path is None and name.endswith(_BLANK) else None
    if walled is not None:
        warnings.warn(f"map {name!r} is not there; open ground with the lines of {walled} is", stacklevel=3)
        return load_track(OpenGround(seconds=_FOREVER)), walled
    if path is None:
        if extension is not None and _is_path(name):
            raise TrackError(f"{_with_yaml(name)}: no such file; accepted: a map_server .yaml")
        return _larger(_course_of_name(name, folder, car), scale), None
    image = path.with_suffix(extension if extension.startswith(".") else f".{extension}") if extension else None
    if image is not None and not is_file(image):
        image = None
    if image is None:
        image = _image_beside(path)
    if scale != 1.0:
        return _scaled(path, image, scale, car), path
    return _read(path, image, car), path


def find_file(name: str, folder: str | Path | None = None) -> Path | None:
    """Return the YAML of a map: its path with or without `.yaml`, or in the folder its name, the last of a path."""
    for path in (Path(_with_yaml(name)), Path(name)):
        if path.suffix in (".yaml", ".yml") and is_file(path):
            return path
    chosen = folder or os.environ.get(FOLDER)
    if chosen is None:
        return None
    missing, name = name, Path(name).name.removesuffix(".yaml").removesuffix("_map") if _is_path(name) else name
    for pattern in _PATTERNS:
        for spelling in dict.fromkeys((name, name.replace(" ", ""), name.lower(), name.capitalize())):
            path = Path(chosen).expanduser() / pattern.format(spelling)
            if is_file(path):
                if missing != name:  # the map of another machine, as of a checkout of the gym
                    warnings.warn(f"map {missing!r} is not there; {path} is, in the folder of maps", stacklevel=3)
                return path
    return None


def _with_yaml(name: str) -> str:
    return name if name.endswith((".yaml", ".yml")) else f"{name}.yaml"


def _is_path(name: str) -> bool:
    return "/" in name or name.endswith((".yaml", ".yml"))


def _course_of_name(name: str, folder: str | Path | None, car: CarParameters) -> Course:
    """Return a course of this package; where there is none of the name, say where maps are looked for."""
    try:
        return load_track(name, car=car)
    except TrackError as error:
        chosen = folder or os.environ.get(FOLDER)
        if _is_path(name):
            raise TrackError(f"{_with_yaml(name)}: no such file; accepted: a map_server .yaml, or {error}") from error
        if chosen is None:
            where = f"name the folder that has {name}.yaml or {name}/{name}_map.yaml"
            raise TrackError(f"map {name!r}: {error}; to have the gym's own maps, {where}: {FOLDER}=FOLDER") from error
        names = sorted(
            path.name.removesuffix(".yaml").removesuffix("_map") for path in Path(chosen).expanduser().glob("**/*.yaml")
        )
        near = nearest(name, names)
        meant = f"; did you mean {near!r}?" if near else ""
        raise TrackError(
            f"map {name!r}: there is neither {name}.yaml nor {name}/{name}_map.yaml in {chosen}, the folder of maps "
            f"({FOLDER}), and {error}{meant}"
        ) from error


def _image_beside(path: Path) -> Path | None:
    """Return the image of the YAML's name where the one that it names is missing, as the gym reads it; else None."""
    try:
        named = plain_yaml(read_text(path, 2**20))["image"]
        missing = not is_file(path.parent / named)
    except Exception:  # the reader of the map says what is wrong
        return None
    found = [path.with_suffix(suffix) for suffix in _IMAGES if is_file(path.with_suffix(suffix))]
    return found[0] if missing and found else None


def _larger(course: Course, scale: float) -> Course:
    """Return a course that is larger by a factor about the world's origin."""
    if scale == 1.0:
        return course
    if type(course) is not Track or course.moving:
        raise SettingsError(f"scale is {scale!r} of {course.name!r}; accepted: 1, or a circuit or the YAML of a map")
    return Track(
        name=course.name, centreline=scale * course.centreline, width_right=scale * course.width_right,
        width_left=scale * course.width_left,
    )  # fmt: skip


def _scaled(path: Path, image: Path | None, scale: float, car: CarParameters) -> Course:
    """Return the course of a map that is larger by a factor about the world's origin."""
    if not 0.01 <= scale <= 100.0:
        raise SettingsError(f"scale is {scale!r}; accepted: 0.01 to 100")
    keys = plain_yaml(read_text(path, 2**20))
    x, y, yaw = keys["origin"]
    keys |= {"resolution": scale * keys["resolution"], "origin": [scale * x, scale * y, yaw]}
    image = image or inside(path.parent, str(keys["image"]))
    if image is None:
        named = str(keys["image"])[:60]
        raise TrackError(f"{path}: image {named!r} is outside of its folder; accepted: a file inside it")
    with tempfile.TemporaryDirectory() as folder:
        larger = Path(folder, path.name)
        larger.write_text("".join(f"{key}: {value}\n" for key, value in keys.items()), encoding="utf-8")
        return _read(larger, image, car)


def _read(path: Path, image: Path | None, car: CarParameters) -> Course:
    """Return the course of a map, or the ground among its walls where there is none that the car can drive."""
    try:
        course = read_map(path, image=image)
        course.check_car(car)
        return course
    except MissingExtraError:
        raise
    except TrackError as error:
        occupancy = read_map_file(path, image=image)  # what cannot be read is refused here
        warnings.warn(f"{error}; driven as ground among walls, laps count at the start", stacklevel=2)
        return ground_among_walls(occupancy)


def ground_among_walls(occupancy: OccupancyMap) -> Scene:
    """Return the free ground of a map with walls round it and its border; TrackError: no free ground."""
    from scipy.ndimage import distance_transform_edt

    free = occupancy.with_walled_border().free
    least = _LEAST_GROUND / occupancy.resolution**2
    edges = outlines(free)
    grounds = [edge for edge in edges if enclosed_area(edge) >= least]
    if not grounds:
        raise TrackError(f"{occupancy.path}: no free ground of {_LEAST_GROUND:g} m^2; accepted: a map of a course")
    holes = [edge for edge in edges if enclosed_area(edge) < 0.0]
    walls = [occupancy.to_world(trace(edge))[::-1] for edge in (*grounds, *holes)]
    row, column = np.unravel_index(int(np.argmax(distance_transform_edt(free))), free.shape)
    x, y = occupancy.to_world((column + 0.5, row + 0.5))  # furthest from all walls: the car starts there
    way = np.array([(x - BEHIND, y), (x + 1.0 + BEYOND, y)])
    # a pixel thick, because the free ground beyond a wall has a wall of its own there
    feet: list[Any] = [foot for wall in walls for foot in wall_footprints(wall, occupancy.resolution)]
    return Scene(
        name=occupancy.path.stem, way=way, start=BEHIND, goal=BEHIND + 1.0, time_limit=_FOREVER,
        walls=tuple(Prism(footprint=tuple(map(tuple, foot))) for foot in feet),
    )  # fmt: skip
