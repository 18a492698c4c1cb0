"""The folder of a comparison. It keeps the finished runs, and a later call drives the others.

    manifest.json     the settings that all runs have in common, and the versions; a folder of any others is refused
    runs.jsonl        a line a run, added when it is finished
    poses/RUN.npy     pose of the rear axle in that run, x [m], y [m], heading [rad], (n, 3) float32
    runs.csv          and the rest: see tables; written when all runs asked for are there

A line that was torn by a crash is dropped, and its run is driven again.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import RunFolderError
from ...messages import FloatArray
from ..folders import blame, replace_file
from .run import RunKey, RunRow

SCHEMA = 1
"""Of the folder; any other is refused."""

_MANIFEST, _RUNS, _POSES = "manifest.json", "runs.jsonl", "poses"


class ComparisonFolder:
    """Keeps the rows and traces of runs.

    Args:
      folder: the path.

    Attributes:
      folder: the path.
      rows: that are there, by their keys.
    """

    def __init__(self, folder: str | Path) -> None:
        self.folder = Path(folder)
        self.rows: dict[RunKey, RunRow] = {}

    def open(self, settings: Mapping[str, Any], versions: Mapping[str, str]) -> None:
        """Make the folder, or read one that is there and was made with the same settings and versions.

        Raises:
          RunFolderError: it holds something else, or cannot be read or written.
        """
        accepted = "a new or empty folder, or one of the same comparison"
        with blame(self.folder, accepted):
            path = self.folder / _MANIFEST
            manifest = {"schema": SCHEMA, "settings": dict(settings), "versions": dict(versions)}
            if path.exists():
                self._require_same(json.loads(path.read_text(encoding="utf-8")), manifest)
                self._read()
                return
            if self.folder.exists() and any(self.folder.iterdir()):
                raise RunFolderError(f"{self.folder}: is not empty; accepted: {accepted}")
            self.folder.mkdir(parents=True, exist_ok=True)
            replace_file(path, (json.dumps(manifest, indent=2) + "\n").encode())

    def add(self, row: RunRow, trace: FloatArray) -> None:
        """Keep a run: its line, which says that it is finished, comes last.

        Raises:
          RunFolderError: it cannot be written.
        """
        with blame(self.folder, "a folder that can be written"):
            path = self._poses(row.key)
            path.parent.mkdir(exist_ok=True)
            np.save(path, trace.astype(np.float32))
            with (self.folder / _RUNS).open("ab") as file:
                file.write(_line(row))
                file.flush()
                os.fsync(file.fileno())
            self.rows[row.key] = row

    def sort(self, keys: Sequence[RunKey]) -> None:
        """Put the lines in the order of `keys`, those of other runs behind them, so that equal runs are equal files.

        Raises:
          RunFolderError: it cannot be written.
        """
        first = {key: place for place, key in enumerate(keys)}
        order = sorted(self.rows, key=lambda key: (first.get(key, len(first)), key.sha256))
        with blame(self.folder, "a folder that can be written"):
            replace_file(self.folder / _RUNS, b"".join(_line(self.rows[key]) for key in order))

    def trace(self, key: RunKey) -> FloatArray:
        """Return where the rear axle was: x [m], y [m], heading [rad], (n, 3).

        Raises:
          RunFolderError: the file is missing or damaged.
        """
        with blame(self._poses(key), "as `compare` wrote it"):
            return np.asarray(np.load(self._poses(key), allow_pickle=False), np.float64)

    def _poses(self, key: RunKey) -> Path:
        return self.folder / _POSES / f"{key.sha256[:24]}.npy"

    def _read(self) -> None:
        path = self.folder / _RUNS
        if not path.exists():
            return
        whole, _, torn = path.read_bytes().rpartition(b"\n")
        for number, line in enumerate(whole.splitlines(), start=1):
            with blame(Path(f"{path}, line {number}"), "a line that `compare` wrote"):
                row = RunRow.of(json.loads(line))
            if self._poses(row.key).exists():
                self.rows[row.key] = row
        if torn:
            os.truncate(path, len(whole) + 1 if whole else 0)

    def _require_same(self, theirs: Any, ours: dict[str, Any]) -> None:
        if not isinstance(theirs, dict) or theirs.get("schema") != SCHEMA:
            raise ValueError(f"{_MANIFEST} is no JSON object with schema {SCHEMA}")
        for part in ("settings", "versions"):
            for name in {**ours[part], **theirs[part]}:
                there, here = theirs[part].get(name), ours[part].get(name)
                if there != here:
                    raise RunFolderError(
                        f"{self.folder}: holds another comparison: {name} is {json.dumps(there)} there and "
                        f"{json.dumps(here)} here; accepted: the same, or a new or empty folder"
                    )


def _line(row: RunRow) -> bytes:
    return (json.dumps(row.as_dict()) + "\n").encode()
