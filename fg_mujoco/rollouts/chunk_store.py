"""Stores of a rollout's finished chunks: in memory, or in a folder that a later call can go on with.

    manifest.json     the settings and versions that made it; a folder of any others is refused
    tracks.npz        the courses, bit for bit
    chunks/K.npz      the worlds of chunk K and their lap times: one that is there is complete
    chunks/K.*.npy    telemetry, states and ctrl, or scans of its worlds, one world after the other, if recorded
    worlds.csv        one row a world, when all are driven
    summary.json      the figures; a folder that has it is finished

Each chunk has a checksum of its arrays, its number, and the settings and versions of the rollout. One that is damaged,
or that was copied over another, is driven again by the same rollout, with a warning. Whoever reads it refuses it.
"""

from __future__ import annotations

import hashlib
import json
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..course.course import Course
from ..course.files import file_sha256
from ..course.writing import write_file
from ..errors import RunFolderError
from ..messages import require_whole
from ..simulation.course_loading import reload_course
from .job import Arrays
from .store import WRITABLE, StudyFolder, as_json, blame, sealed, unsealed, warn_damaged

TRACES = ("telemetry", "states", "ctrl", "scans")
"""Arrays of a chunk that are long, and are read only where they are asked for."""

_SEAL = "sha256"  # of a chunk, among its arrays
_MANIFEST, _TRACKS, _CHUNKS, _WORLDS, _SUMMARY = "manifest.json", "tracks.npz", "chunks", "worlds.csv", "summary.json"


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


class FolderStore(StudyFolder):
    """Keeps them in a folder; `TemporaryFolderStore` in one that is gone with it."""

    def __init__(self, folder: str | Path) -> None:
        super().__init__(folder, title="rollout", command="rollout")
        self._belongs: tuple[Any, ...] = ()  # what the chunks belong to
        self._checked: set[int] = set()  # chunks that this process wrote, or has compared with their checksums

    def open(  # type: ignore[override]
        self, settings: Mapping[str, Any], versions: Mapping[str, str], chunk: int, tracks: Sequence[Course]
    ) -> int:
        """Make the folder, or make sure that one which is there is of the same rollout; return worlds in its chunks.

        Args:
          settings: of the rollout, as JSON has them.
          versions: that drive it.
          chunk: worlds in a chunk, of a new folder.
          tracks: the courses.

        Raises:
          RunFolderError: it holds something else, or cannot be written.
        """
        numbers = _numbers(tracks)
        others = {"chunk": chunk, "tracks_sha256": _sha256(numbers)}
        manifest = super().open(settings, versions, others=others)
        with blame(self.folder, self.accepted):
            (self.folder / _CHUNKS).mkdir(exist_ok=True)
            self._keep_tracks(manifest, numbers)
        return int(manifest["chunk"])

    def manifest(self, *, checked: bool = True) -> dict[str, Any]:
        """See StudyFolder."""
        manifest = super().manifest(checked=checked)
        with self.blame(self.folder / _MANIFEST):
            require_whole("chunk", manifest["chunk"], 1)
        self._belongs = self.digest, manifest["chunk"]
        return manifest

    def _keep_tracks(self, manifest: dict[str, Any], numbers: Arrays) -> None:
        """Write the courses, unless they are there; warn where they are damaged."""
        path = self.folder / _TRACKS
        if path.exists():
            try:
                self._read_tracks(manifest)
                return
            except RunFolderError as error:
                warn_damaged(error)
        _write_arrays(path, numbers)

    def _read_tracks(self, manifest: dict[str, Any]) -> Arrays:
        path = self.folder / _TRACKS
        with self.blame(path), np.load(path, allow_pickle=False) as file:
            arrays = dict(file)
            if manifest["tracks_sha256"] != _sha256(arrays):
                raise ValueError("its sha256 is another")
            return arrays

    def tracks(self) -> tuple[Course, ...]:
        """Return the courses.

        Raises:
          RunFolderError: the file is missing or damaged.
          TrackError: a course of a user's own class is not to be had any more.
        """
        manifest = self.manifest()
        arrays = self._read_tracks(manifest)
        with self.blame(self.folder / _TRACKS):
            names = [track["name"] for track in manifest["settings"]["tracks"]]
            numbers: list[dict[str, NDArray[Any]]] = [{} for _ in names]
            for key, array in arrays.items():
                number, _, name = key.partition("_")
                numbers[int(number)][name] = array
            return tuple(reload_course(*course) for course in zip(names, numbers, strict=True))

    def numbers(self) -> set[int]:
        """Return the numbers of the chunks that are kept; one that is damaged is not, and is warned of."""
        kept = set()
        for number in self.written():
            try:
                self.read(number)
                kept.add(number)
            except RunFolderError as error:
                warn_damaged(error)
        return kept

    def written(self) -> list[int]:
        """Return the numbers of the chunks that are there, damaged or not."""
        return sorted(int(path.stem) for path in (self.folder / _CHUNKS).glob("*.npz") if path.stem.isdigit())

    def add(self, number: int, arrays: Arrays) -> None:
        """Keep a chunk: the file that says that it is complete comes last.

        Raises:
          RunFolderError: it cannot be written.
        """
        with blame(self.folder, WRITABLE):
            for name in TRACES:
                if name in arrays:
                    _write_array(self._path(number, name), arrays[name])
            short = {name: array for name, array in arrays.items() if name not in TRACES}
            _write_arrays(self._path(number), short | {_SEAL: np.array(_sha256(arrays, *self._belongs, number))})
            self._checked.add(number)

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
            seal = arrays.pop(_SEAL, None)
            if number not in self._checked and seal != _sha256(arrays, *self._belongs, number):
                raise ValueError("its sha256 is that of other contents, or of another place")
            self._checked.add(number)
            return arrays

    @property
    def finished(self) -> bool:
        """Whether all worlds are driven, and the summary and the table are there as they were written."""
        if not (self.folder / _SUMMARY).exists():
            return False
        path = self.folder / _WORLDS
        try:
            known = self._read_summary()["worlds_sha256"]
            with self.blame(path):
                if file_sha256(path) != known:
                    raise ValueError("its sha256 is another")
        except RunFolderError as error:
            warn_damaged(error)
            return False
        return True

    def finish(self, summary: dict[str, Any], worlds: str) -> None:
        """Write the table of all worlds and, last, the summary.

        Args:
          summary: the figures.
          worlds: the table.

        Raises:
          RunFolderError: it cannot be written.
        """
        with blame(self.folder, WRITABLE):
            write_file(self.folder / _WORLDS, worlds.encode())
            figures = json.loads(_json(summary)) | {"worlds_sha256": hashlib.sha256(worlds.encode()).hexdigest()}
            write_file(self.folder / _SUMMARY, _json(sealed(figures, *self._belongs)))

    def summary(self) -> dict[str, Any]:
        """Return the figures of a finished folder.

        Raises:
          RunFolderError: they are missing or damaged.
        """
        self.manifest()
        return self._read_summary()

    def _read_summary(self) -> dict[str, Any]:
        path = self.folder / _SUMMARY
        with blame(path, "a finished folder; the same command finishes it"):
            return unsealed(json.loads(path.read_text(encoding="utf-8")), *self._belongs)

    def _path(self, number: int, name: str | None = None) -> Path:
        return self.folder / _CHUNKS / (f"{number:06}.npz" if name is None else f"{number:06}.{name}.npy")


class TemporaryFolderStore(FolderStore):
    """Keeps them among temporary files, until nobody needs it any more."""

    def __init__(self) -> None:
        self._temporary = tempfile.TemporaryDirectory(prefix="fg_mujoco-rollout-")
        super().__init__(self._temporary.name)
        (self.folder / _CHUNKS).mkdir()


ChunkStore: TypeAlias = MemoryStore | FolderStore
"""Keeps what chunks leave, by their numbers."""


def _numbers(tracks: Sequence[Course]) -> Arrays:
    return {f"{i}_{name}": array for i, track in enumerate(tracks) for name, array in track.definition.items()}


def _sha256(arrays: Arrays, *belongs: Any) -> str:
    """Return the SHA-256 of arrays, their names and kinds, and of what they belong to."""
    found = hashlib.sha256(json.dumps(belongs).encode())
    for name, array in sorted(arrays.items()):
        found.update(f"\n{name} {np.lib.format.dtype_to_descr(array.dtype)} {array.shape}\n".encode())
        found.update(np.ascontiguousarray(array).reshape(-1).view(np.uint8).data)
    return found.hexdigest()


def _json(values: dict[str, Any]) -> bytes:
    return (as_json(values) + "\n").encode()


def _write_array(path: Path, array: NDArray[Any]) -> None:
    write_file(path, lambda file: np.save(file, array))


def _write_arrays(path: Path, arrays: Arrays) -> None:
    write_file(path, lambda file: np.savez(file, **arrays))  # type: ignore[arg-type]
