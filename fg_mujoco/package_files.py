"""The files of this package, in a checkout, where some folders lie beside fg_mujoco/, and where it is installed."""

from __future__ import annotations

from collections.abc import Iterator
from importlib.resources import files
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from importlib.abc import Traversable

_PACKAGE = "fg_mujoco"
_ELSEWHERE = ("addons", "controllers", "models", "tracks")  # top-level folders of ours in the repository


def package_files(*suffixes: str) -> Iterator[tuple[str, Traversable]]:
    """Yield the files of this package with these suffixes, and their paths in it ("controllers/gaps.py"), in order."""
    found = dict(walk(files(_PACKAGE), "", suffixes, skip=_ELSEWHERE))
    for folder in _ELSEWHERE:
        found |= walk(files(f"{_PACKAGE}.{folder}"), f"{folder}/", suffixes)
    yield from sorted(found.items())


def walk(
    folder: Traversable, path: str, suffixes: tuple[str, ...], skip: tuple[str, ...] = ()
) -> Iterator[tuple[str, Traversable]]:
    """Yield the files of a folder with these suffixes, and their paths behind `path`."""
    for entry in folder.iterdir():
        if entry.name.endswith(suffixes):
            yield path + entry.name, entry
        elif "." not in entry.name and entry.name not in ("__pycache__", *skip) and entry.is_dir():
            yield from walk(entry, f"{path}{entry.name}/", suffixes)
