"""A course from its name: a bundled circuit, a seed, a scene, a centreline CSV or a map."""

from __future__ import annotations

import re
from functools import lru_cache
from importlib import resources
from pathlib import Path

from ..errors import TrackError, accepted_names, nearest
from ..messages import CarParameters
from .centreline_csv import is_centreline, load_centreline, read_centreline
from .course import Course
from .files import LONGEST_NAME, is_file
from .generator import generate_track
from .maps.map_track import is_map, load_map
from .scenes.catalogue import PREFIX, load_scene, scene_names
from .tight import generate_tight_track

TIGHT = "tight"
"""Kind of the random circuits that are built as races are: `random:SEED:tight`."""


def track_names() -> tuple[str, ...]:
    """Return the names of the bundled circuits, sorted."""
    files = resources.files("fg_mujoco.tracks").iterdir()
    return tuple(sorted(file.name.removesuffix(".csv") for file in files if file.name.endswith(".csv")))


def load_course(name_or_path: str | Path, car: CarParameters) -> Course:
    """Load a course.

    Args:
      name_or_path: a bundled name, `random:SEED`, `random:SEED:tight`, `scene:NAME`, `scene:NAME:SEED`, or a path to a
        centreline `.csv` or to a map's `.yaml`, with settings in brackets where wanted
        (centreline_csv.load_centreline, map_track.load_map).
      car: that a scene is made for: its gaps are measured in widths of the car.

    Raises:
      TrackError: an unknown name, or a file that cannot be read.
    """
    name = str(name_or_path)
    if len(name) > LONGEST_NAME:
        raise TrackError(f"track {name[:60]!r}... has {len(name)} characters; accepted: {LONGEST_NAME} at most")
    if name in track_names():
        return _bundled(name)
    kind, _, rest = name.partition(":")
    if kind == "random":
        return _random(name, rest)
    if kind == "scene":
        return load_scene(name, car)
    if is_map(name):
        return load_map(name)
    if is_centreline(name) or is_file(name):
        return load_centreline(name)
    others = ", random:SEED, random:SEED:tight, scene:NAME:SEED, or a path to a centreline .csv or a map .yaml"
    besides = [*([f"random:{rest}"] if rest else []), *(f"{PREFIX}{scene}" for scene in scene_names())]
    raise TrackError(f"unknown track {name!r}; {accepted_names(name, track_names(), others, besides=besides)}")


@lru_cache(maxsize=32)  # a course is immutable, and what is worked out of it is kept in it
def _bundled(name: str) -> Course:
    with resources.as_file(resources.files("fg_mujoco.tracks") / f"{name}.csv") as path:
        return read_centreline(path)


def _random(name: str, rest: str) -> Course:
    seed, colon, kind = rest.partition(":")
    forms = "random:SEED or random:SEED:tight, with SEED an integer from 0, as random:7"
    if not re.fullmatch("[0-9]{1,18}", seed):
        raise TrackError(f"{name!r} has no seed; accepted: {forms}")
    if colon and kind != TIGHT:
        close = f"; did you mean 'random:{seed}:{TIGHT}'?" if nearest(kind, [TIGHT]) else ""
        raise TrackError(f"{name!r} asks for a random circuit of kind {kind!r}; accepted: {forms}{close}")
    return _drawn(int(seed), tight=bool(colon))


@lru_cache(maxsize=32)
def _drawn(seed: int, *, tight: bool) -> Course:
    return generate_tight_track(seed) if tight else generate_track(seed)
