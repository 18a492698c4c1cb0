"""A course from its name: a bundled circuit, a seed, a scene, a centreline CSV or a map.

The modules of a format are imported when a course of that format is first loaded.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from importlib import resources
from pathlib import Path
from typing import Any, cast

from .. import from_addons
from ..errors import SettingsError, TrackError, accepted_names, nearest
from ..messages import CarParameters
from ..registry import Registry
from .course import Course
from .files import LONGEST_NAME, PICTURES, foreign_kind, is_file
from .kept_courses import kept_course
from .track import Track

TIGHT = "tight"
"""Kind of the random circuits that are built as races are: `random:SEED:tight`."""


@dataclass(frozen=True, kw_only=True)
class CourseFormat:
    """A kind of texts that name courses."""

    accepts: Callable[[str], bool]  # whether a text is of this format
    load: Callable[[str, CarParameters], Course]  # returns the course that a text names; a scene is made for the car
    texts: str  # how its texts look, for messages; nothing where the names themselves are listed


def track_names() -> tuple[str, ...]:
    """Return the names of the bundled circuits, sorted."""
    files = resources.files("fg_mujoco.tracks").iterdir()
    return tuple(sorted(file.name.removesuffix(".csv") for file in files if file.name.endswith(".csv")))


def course_names() -> list[str]:
    """Return the names of the bundled circuits, and of the scenes as `scene:NAME`."""
    from .scenes import PREFIX, scene_names

    return [*track_names(), *(f"{PREFIX}{name}" for name in scene_names())]


def load_course(name_or_path: str | Path, car: CarParameters) -> Course:
    """Load a course.

    Args:
      name_or_path: a bundled name, `random:SEED`, `random:SEED:tight`, `scene:NAME`, `scene:NAME:SEED`, or a path to a
        centreline `.csv` or to a map's `.yaml`, or a text of a format that an installed package registers; with
        settings in brackets where wanted: of a file (centreline_csv.load_centreline, map_track.load_map), and of the
        walls of any circuit, and of the ground of any course (built_walls.SETTINGS, ground.SETTINGS).
      car: that a scene is made for: its gaps are measured in widths of the car.

    Raises:
      TrackError: an unknown name, a file that cannot be read, or settings that it does not take.
    """
    name = str(name_or_path)
    if len(name) > LONGEST_NAME:
        raise TrackError(f"track {name[:60]!r}... has {len(name)} characters; accepted: {LONGEST_NAME} at most")
    plain, texts = parted(name)
    if not texts:
        return _load(name, car)
    from . import built_walls, ground
    from .centreline_csv import read_settings

    own: dict[str, Any] = {}
    for field, room, make in (("built", built_walls, built_walls.walls_of), ("relief", ground, ground.relief_of)):
        told = [text for text in texts if text.partition("=")[0] in room.SETTINGS]
        settings = read_settings(name, ",".join(told), room.SETTINGS)
        try:
            own[field] = make(**settings) if told else None
        except SettingsError as error:
            raise TrackError(f"{name!r}: {error}") from error
    course: Any = _load(plain, car)
    if own["built"] is None and not isinstance(course, Track):
        del own["built"]
    if any(not hasattr(course, field) for field in own):
        said = f"{name!r} has settings of walls or ground"
        raise TrackError(f"{said}; accepted: those of walls of a circuit, those of ground of a circuit or scene")
    try:
        return cast(Course, replace(course, name=f"{course.name}[{','.join(texts)}]", **own))
    except SettingsError as error:
        raise TrackError(f"{name!r}: {error}") from error


def parted(name: str) -> tuple[str, list[str]]:
    """Return the name of a course without its settings of walls and ground, and these, each as SETTING=VALUE."""
    plain, bracket, settings = name.rpartition("[")
    if not bracket or not settings.endswith("]"):
        return name, []
    known, texts = _of_walls_and_ground(), settings[:-1].split(",")
    own = [text for text in texts if text.partition("=")[0] in known]
    others = [text for text in texts if text not in own]
    return plain + (f"[{','.join(others)}]" if others else ""), own


def _of_walls_and_ground() -> tuple[str, ...]:
    """Return the names of their settings."""
    from .built_walls import SETTINGS as OF_WALLS
    from .ground import SETTINGS as OF_GROUND

    return *OF_WALLS, *OF_GROUND


def _load(name: str, car: CarParameters) -> Course:
    """Return the course of a name without settings of walls; arguments and errors are those of `load_course`."""
    for each in _formats():
        if each.accepts(name):
            return each.load(name, car)
    if is_file(name):
        if (kind := foreign_kind(name)) is not None:
            raise TrackError(f"{name}: is {kind}; accepted: {_instead(Path(name))}")
        return _centreline(name)
    base, bracket, settings = name.partition("[")
    if bracket and base in track_names():
        key = settings.rstrip("]").partition("=")[0]
        raise TrackError(f"{name!r}: setting {key!r}; {accepted_names(key, _of_walls_and_ground())}, in brackets")
    *texts, last = (each.texts for each in _formats() if each.texts)
    rest, scenes = name.partition(":")[2], course_names()[len(track_names()) :]
    besides = [*([f"random:{rest}"] if rest else []), *scenes]
    others = f", {', '.join(texts)} or {last}"
    raise TrackError(f"unknown track {name!r}; {accepted_names(name, track_names(), others, besides=besides)}")


def _instead(path: Path) -> str:
    """Return what is accepted in the place of a file that is no course, and how it is made."""
    if path.suffix.lower() not in PICTURES:
        from .line_names import COLUMNS

        columns = ", ".join(COLUMNS)
        return f"a .csv of {columns}, or a map .yaml, as the page 'A map or track of your own' (howto/own_map) says"
    beside = next((each for each in (path.with_suffix(".yaml"), path.with_suffix(".yml")) if is_file(each)), None)
    if beside is not None:
        return f"the map that it belongs to, {beside}"
    return f"a map .yaml: fg-mujoco track from-image {path} --resolution METRES writes one, of so many metres a pixel"


def _formats() -> Iterator[CourseFormat]:
    """Yield the formats of this package and then those of others, which are looked for when none of ours fits."""
    yield from map(FORMATS.find, FORMATS)
    yield from map(FORMATS.find, FORMATS.names()[len(list(FORMATS)) :])


def _read_bundled(path: str) -> Course:
    from .centreline_csv import read_centreline

    return read_centreline(path)


@lru_cache(maxsize=32)  # a course is immutable, and what is worked out of it is kept in it
def _bundled(name: str) -> Course:
    with resources.as_file(resources.files("fg_mujoco.tracks") / f"{name}.csv") as path:
        return kept_course(str(path), _read_bundled)


def _random(name: str) -> Course:
    seed, colon, kind = name.removeprefix("random").removeprefix(":").partition(":")
    forms = "random:SEED or random:SEED:tight, with SEED an integer from 0, as random:7"
    if not re.fullmatch("[0-9]{1,18}", seed):
        raise TrackError(f"{name!r} has no seed; accepted: {forms}")
    if colon and kind != TIGHT:
        close = f"; did you mean 'random:{seed}:{TIGHT}'?" if nearest(kind, [TIGHT]) else ""
        raise TrackError(f"{name!r} asks for a random circuit of kind {kind!r}; accepted: {forms}{close}")
    return _drawn(int(seed), tight=bool(colon))


@lru_cache(maxsize=32)
def _drawn(seed: int, *, tight: bool) -> Course:
    return from_addons.generate_tight_track(seed) if tight else from_addons.generate_track(seed)


def _open(name: str, car: CarParameters) -> Course:
    from .open_ground import OpenGround

    try:
        return OpenGround(seconds=float(name.removeprefix("open_ground").removeprefix(":")))
    except ValueError as error:  # of SettingsError, too
        raise TrackError(f"track {name!r} has no time; accepted: open_ground:SECONDS, as open_ground:10") from error


def _scene(name: str, car: CarParameters) -> Course:
    from .scenes import load_scene

    return load_scene(name, car)


def _is_centreline(name: str) -> bool:
    from .centreline_csv import is_centreline

    return is_centreline(name)


def _centreline(name: str) -> Course:
    from .centreline_csv import load_centreline

    return kept_course(name, load_centreline)


def _is_map(name: str) -> bool:
    if ".y" not in name.lower():  # neither .yaml nor .yml
        return False
    from .maps.map_track import is_map

    return is_map(name)


def _map(name: str) -> Course:
    from .maps.map_track import load_map

    return kept_course(name, load_map)


FORMATS: Registry[CourseFormat] = Registry(
    "track format",
    TrackError,
    "fg_mujoco.track_formats",
    {
        "circuit": CourseFormat(
            accepts=lambda text: text in track_names(), load=lambda text, car: _bundled(text), texts=""
        ),
        "random": CourseFormat(
            accepts=lambda text: text.partition(":")[0] == "random",
            load=lambda text, car: _random(text),
            texts="random:SEED, random:SEED:tight",
        ),
        "scene": CourseFormat(
            accepts=lambda text: text.partition(":")[0] == "scene", load=_scene, texts="scene:NAME:SEED"
        ),
        "open ground": CourseFormat(
            accepts=lambda text: text.partition(":")[0] == "open_ground", load=_open, texts="open_ground:SECONDS"
        ),
        "centreline": CourseFormat(
            accepts=_is_centreline,
            load=lambda text, car: _centreline(text),
            texts="a path to a centreline .csv, .json or .npy",
        ),
        "map": CourseFormat(accepts=_is_map, load=lambda text, car: _map(text), texts="a map .yaml"),
    },
    CourseFormat,
)
"""Formats are asked in this order. What is a file and of none of them is read as a centreline."""
