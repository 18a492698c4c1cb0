"""Keeps courses that were read from files: a map takes half a second, and its walls a fifth to become a model."""

from __future__ import annotations

import hashlib
import importlib.util
import os
import pickle
import warnings
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from importlib.resources import files
from pathlib import Path

import numpy as np

from ..errors import Note
from ..kept import kept
from ..package_files import walk
from ..registry import ADDONS
from .course import Course
from .files import noting_files, state_of

_SOURCES = ("course", "simulation/world.py", "simulation/cars.py", "vehicle/bodywork.py")
_VERSIONS = {"numpy": "version.py", "scipy": "version.py", "skimage": "__init__.py", "PIL": "_version.py"}
"""Packages that read maps, and the file of each that has its version."""

_Read = tuple[bytes, dict[str, str], list[tuple[str, bool]]]
"""A course, pickled; the states of the files by path; the warnings, and whether each is a note."""


def kept_course(name: str, load: Callable[[str], Course]) -> Course:
    """Return what `load` makes of a name that begins with a path; it warns as when it was first read.

    A kept course is used as long as all files that were read, or looked for, are what they were.
    """

    def make() -> _Read:
        with noting_files() as noted, warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            course = load(name)
        said = [(str(each.message), each.category is Note) for each in caught if each.category in (UserWarning, Note)]
        return pickle.dumps(course), noted, said

    def holds(made: _Read) -> bool:
        return bool(made[1]) and all(state_of(path) == state for path, state in made[1].items())

    try:
        path = os.path.abspath(name)
    except OSError:  # the folder that this process is in is gone
        return load(name)
    pickled, _, said = kept("course", (load.__name__, name, path, sources_of_courses()), make, holds)
    for text, is_note in said:
        warnings.warn(text, Note if is_note else UserWarning, stacklevel=3)
    course: Course = pickle.loads(pickled)
    for value in vars(course).values():
        for array in value if isinstance(value, tuple) else (value,):
            if isinstance(array, np.ndarray):
                array.flags.writeable = False
    return course


def sources_of_courses() -> tuple[str, ...]:
    """Return what courses and their models depend on besides what is read: sources and versions."""
    return _sources(), *map(_version, _VERSIONS)


@cache
def _sources() -> str:
    digest = hashlib.sha256()
    entries = {name: files("fg_mujoco").joinpath(name) for name in _SOURCES}
    with suppress(ModuleNotFoundError):  # of an installation without add-ons
        entries["formats"] = files(ADDONS).joinpath("formats")
    for name, entry in entries.items():
        for path, file in sorted({name: entry}.items() if entry.is_file() else walk(entry, name, (".py",))):
            digest.update(path.encode() + file.read_bytes())
    return digest.hexdigest()


def _version(package: str) -> str:
    """Return what says the version of a package; nothing where it is not there."""
    spec = importlib.util.find_spec(package)
    return "" if spec is None or spec.origin is None else Path(spec.origin).with_name(_VERSIONS[package]).read_text()
