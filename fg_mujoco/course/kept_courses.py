"""Keeps what is made of a course in a folder of the user's own, so that the next race finds it there.

A map takes half a second to read, and its walls a fifth to become a model. An entry is named by a hash of what it was
made from, and of the sources that made it. One that is damaged, or cannot be written, is made again.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib.util
import os
import pickle
import warnings
from collections.abc import Callable
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import TypeVar, cast

import numpy as np

from ..compiled.kernel_files import own_folder, read_kept, walk, write_kept
from .course import Course
from .files import noting_files, state_of

_Made = TypeVar("_Made")

MOST_BYTES = 256 * 2**20
"""Of the folder; a large map and its model are 4 MB. The entries that were not used for longest are dropped."""

_SOURCES = ("course", "simulation/world.py", "simulation/cars.py", "vehicle/bodywork.py")
_VERSIONS = {"numpy": "version.py", "scipy": "version.py", "PIL": "_version.py"}  # files of packages that read maps


def kept(kind: str, key: tuple[object, ...], make: Callable[[], _Made], holds: Callable[[_Made], bool]) -> _Made:
    """Return what is kept under a key, or what `make` returns, which is kept.

    Args:
      kind: of the entry, the beginning of its file's name.
      key: texts and numbers: all that the result depends on, besides the sources of courses.
      make: returns what can be pickled; where it raises, nothing is kept.
      holds: returns whether what is kept may be used, and what was made may be kept.
    """
    folder = _folder()
    if folder is None:
        return make()
    digest = hashlib.sha256(repr((key, _versions(), _sources())).encode()).hexdigest()
    file = folder / f"{kind}-{digest[:32]}"
    found = read_kept(file)
    with contextlib.suppress(Exception):  # whatever is wrong with it, making it helps
        if found is not None and holds(found):
            with contextlib.suppress(OSError):
                os.utime(file)  # it was used
            return cast(_Made, found)
    made = make()
    if holds(made):
        write_kept(file, pickle.dumps(made))
        _drop_oldest(folder)
    return made


def kept_course(name: str, load: Callable[[str], Course]) -> Course:
    """Return what `load` makes of a name that begins with a path; it warns as when it was first read.

    A kept course is used as long as all files that were read, or looked for, are what they were.
    """

    def make() -> tuple[bytes, dict[str, str], list[str]]:
        with noting_files() as noted, warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            course = load(name)
        return pickle.dumps(course), noted, [str(each.message) for each in caught if each.category is UserWarning]

    def holds(made: tuple[bytes, dict[str, str], list[str]]) -> bool:
        return bool(made[1]) and all(state_of(path) == state for path, state in made[1].items())

    pickled, _, said = kept("course", (name, os.path.abspath(name)), make, holds)
    for text in said:
        warnings.warn(text, stacklevel=3)
    course: Course = pickle.loads(pickled)
    for value in vars(course).values():
        for array in value if isinstance(value, tuple) else (value,):
            if isinstance(array, np.ndarray):
                array.flags.writeable = False
    return course


@cache
def _folder() -> Path | None:
    return own_folder("courses", "courses are not kept there")


@cache
def _sources() -> str:
    """Return a hash of the sources that make courses and their models."""
    digest = hashlib.sha256()
    for name in _SOURCES:
        entry = files("fg_mujoco").joinpath(name)
        for path, file in sorted({name: entry}.items() if entry.is_file() else walk(entry, name, (".py",))):
            digest.update(path.encode() + file.read_bytes())
    return digest.hexdigest()


def _versions() -> list[str]:
    """Return what says the versions of the packages that read maps; nothing of one that is not there."""
    found = []
    for package, file in _VERSIONS.items():
        spec = importlib.util.find_spec(package)
        found.append("" if spec is None or spec.origin is None else Path(spec.origin).with_name(file).read_text())
    return found


def _drop_oldest(folder: Path) -> None:
    """Drop the entries that were not used for longest, as long as all have more than MOST_BYTES."""
    with contextlib.suppress(OSError):  # another process may be dropping them, too
        entries = sorted((path.stat().st_mtime, path.stat().st_size, path) for path in folder.iterdir())
        total = sum(size for _, size, _ in entries)
        for _, size, path in entries:
            if total <= MOST_BYTES:
                return
            path.unlink()
            total -= size
