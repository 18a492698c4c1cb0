"""Where the finished chunks of a rollout are kept: in memory, or in a folder that a later call can go on with.

    manifest.json     the settings and versions that made it; a folder of any others is refused
    tracks.npz        the courses, bit for bit
    chunks/K.npz      the worlds of chunk K and their lap times: one that is there is complete
    chunks/K.*.npy    telemetry, states and ctrl of its worlds, one world after the other, if recorded
    worlds.csv        one row a world, when all are driven
    summary.json      the figures; a folder that has it is finished

Each file is written aside and moved into its place.
"""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ...course.course import Course
from ...errors import RunFolderError
from ...simulation.course_loading import reload_course
from ..folders import as_json, blame, write_file
from .job import Arrays

SCHEMA = 1
"""Of the folder; a reader refuses any other."""

TRACES = ("telemetry", "states", "ctrl")
"""Arrays of a chunk that are long, and are read only where they are asked for."""

_MANIFEST, _TRACKS, _CHUNKS, _WORLDS, _SUMMARY = "manifest.json", "tracks.npz", "chunks", "worlds.csv", "summary.json"


class ChunkStore(Protocol):
    """Keeps what chunks leave, by their numbers."""

    def numbers(self) -> set[int]:
        """Return the numbers of the chunks that are kept."""

    def add(self, number: int, arrays: Arrays) -> None:
        """Keep a chunk."""

    def read(self, number: int) -> Arrays:
        """Return the arrays of a chunk; those of TRACES may still be on disk."""


class MemoryStore:
    """Keeps them in memory."""

    def __init__(self) -> None:
        self._chunks: dict[int, Arrays] = {}

    def numbers(self) -> set[int]:
        """Return the numbers of the chunks that are kept."""
        return set(self._chunks)

    def add(self, number: int, arrays: Arrays) -> None:
        """Keep a chunk."""
        self._chunks[number] = arrays

    def read(self, number: int) -> Arrays:
        """Return the arrays of a chunk."""
        return self._chunks[number]


class FolderStore:
    """Keeps them in a folder; `TemporaryFolderStore` in one that is gone with it.

    Attributes:
      folder: the path.
    """

    def __init__(self, folder: str | Path) -> None:
        self.folder = Path(folder)

    def open(self, settings: dict[str, Any], versions: dict[str, str], chunk: int, tracks: Sequence[Course]) -> int:
        """Make the folder, or make sure that one which is there is of the same rollout.

        Args:
          settings: of the rollout, as JSON has them.
          versions: that drive it.
          chunk: worlds in a chunk, of a new folder.
          tracks: the courses.

        Returns:
          Worlds in a chunk of this folder.

        Raises:
          RunFolderError: it holds something else, or cannot be written.
        """
        with blame(self.folder, "a new or empty folder, or one of the same rollout"):
            if (self.folder / _MANIFEST).exists():
                manifest = self.manifest()
                self._require_same(manifest["settings"], settings)
                self._require_same(manifest["versions"], versions)
                return int(manifest["chunk"])
            if self.folder.exists() and any(self.folder.iterdir()):
                raise RunFolderError(
                    f"{self.folder}: is not empty; accepted: a new or empty folder, or one of the same rollout"
                )
            (self.folder / _CHUNKS).mkdir(parents=True, exist_ok=True)
            numbers = {
                f"{i}_{name}": array for i, track in enumerate(tracks) for name, array in track.definition.items()
            }
            _write_arrays(self.folder / _TRACKS, numbers)
            digest = hashlib.sha256(json.dumps([settings, versions], sort_keys=True).encode()).hexdigest()
            manifest = {"schema": SCHEMA, "settings": settings, "versions": versions, "chunk": chunk, "sha256": digest}
            write_file(self.folder / _MANIFEST, lambda file: file.write(_json(manifest)))
            return chunk

    def manifest(self) -> dict[str, Any]:
        """Return what the folder was made with.

        Raises:
          RunFolderError: it was not made by a rollout.
        """
        path = self.folder / _MANIFEST
        if not path.is_file():
            raise RunFolderError(f"{self.folder}: has no {_MANIFEST}; accepted: a folder that `rollout --out` wrote")
        with blame(path, "as `rollout --out` wrote it"):
            manifest = json.loads(path.read_text(encoding="utf-8"))
            if not isinstance(manifest, dict) or manifest.get("schema") != SCHEMA:
                raise ValueError(f"no JSON object with schema {SCHEMA}")
            return manifest

    def tracks(self) -> tuple[Course, ...]:
        """Return the courses.

        Raises:
          RunFolderError: the file is missing or damaged.
          TrackError: a course of a user's own class is not to be had any more.
        """
        names = [track["name"] for track in self.manifest()["settings"]["tracks"]]
        path = self.folder / _TRACKS
        with blame(path, "as `rollout --out` wrote it"), np.load(path, allow_pickle=False) as arrays:
            numbers: list[dict[str, NDArray[Any]]] = [{} for _ in names]
            for key in arrays.files:
                number, _, name = key.partition("_")
                numbers[int(number)][name] = arrays[key]
            return tuple(reload_course(*course) for course in zip(names, numbers, strict=True))

    def numbers(self) -> set[int]:
        """Return the numbers of the chunks that are kept."""
        return {int(path.stem) for path in (self.folder / _CHUNKS).glob("*.npz") if path.stem.isdigit()}

    def add(self, number: int, arrays: Arrays) -> None:
        """Keep a chunk: the file that says that it is complete comes last.

        Raises:
          RunFolderError: it cannot be written.
        """
        with blame(self.folder, "a folder that can be written"):
            for name in TRACES:
                if name in arrays:
                    _write_array(self._path(number, name), arrays[name])
            _write_arrays(self._path(number), {name: array for name, array in arrays.items() if name not in TRACES})

    def read(self, number: int) -> Arrays:
        """Return the arrays of a chunk, those of TRACES mapped from disk.

        Raises:
          RunFolderError: a file is missing or damaged.
        """
        path = self._path(number)
        with blame(path, "as `rollout --out` wrote it; without it, the same command drives its worlds again"):
            with np.load(path, allow_pickle=False) as file:
                arrays = dict(file)
            for name in TRACES:
                if self._path(number, name).exists():
                    arrays[name] = np.load(self._path(number, name), mmap_mode="r", allow_pickle=False)
            return arrays

    @property
    def finished(self) -> bool:
        """Whether all worlds are driven and the summary is written."""
        return (self.folder / _SUMMARY).exists()

    def finish(self, summary: dict[str, Any], write_worlds: Callable[[Path], None]) -> None:
        """Write the table of all worlds and, last, the summary.

        Args:
          summary: the figures.
          write_worlds: writes the table to a path.

        Raises:
          RunFolderError: it cannot be written.
        """
        with blame(self.folder, "a folder that can be written"):
            aside = self.folder / f".{_WORLDS}.{os.getpid()}"
            write_worlds(aside)
            aside.replace(self.folder / _WORLDS)
            write_file(self.folder / _SUMMARY, lambda file: file.write(_json(summary)))

    def summary(self) -> dict[str, Any]:
        """Return the figures of a finished folder.

        Raises:
          RunFolderError: they are missing or damaged.
        """
        with blame(self.folder / _SUMMARY, "a finished folder; the same command finishes it"):
            summary: dict[str, Any] = json.loads((self.folder / _SUMMARY).read_text(encoding="utf-8"))
            return summary

    def _path(self, number: int, name: str | None = None) -> Path:
        return self.folder / _CHUNKS / (f"{number:06}.npz" if name is None else f"{number:06}.{name}.npy")

    def _require_same(self, theirs: dict[str, Any], ours: dict[str, Any]) -> None:
        for name in (*ours, *theirs):
            there, here = theirs.get(name), ours.get(name)
            if there != here:
                raise RunFolderError(
                    f"{self.folder}: holds another rollout: {name} is {_short(there)} there and {_short(here)} here; "
                    "accepted: the same settings, or a new or empty folder"
                )


class TemporaryFolderStore(FolderStore):
    """Keeps them among temporary files, until nobody needs it any more."""

    def __init__(self) -> None:
        self._temporary = tempfile.TemporaryDirectory(prefix="fg_mujoco-rollout-")
        super().__init__(self._temporary.name)
        (self.folder / _CHUNKS).mkdir()


def _json(values: dict[str, Any]) -> bytes:
    return (as_json(values) + "\n").encode()


def _write_array(path: Path, array: NDArray[Any]) -> None:
    write_file(path, lambda file: np.save(file, array))


def _write_arrays(path: Path, arrays: Arrays) -> None:
    write_file(path, lambda file: np.savez(file, **arrays))  # type: ignore[arg-type]


def _short(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= 60 else text[:57] + "..."
