"""The folder of a comparison. It keeps the finished runs, and a later call drives the others.

    manifest.json     the settings that all runs have in common, and the versions; a folder of any others is refused
    runs.jsonl        a line a run, added when it is finished
    poses/RUN.npy     pose of the rear axle in that run, x [m], y [m], heading [rad], (n, 3) float32
    runs.csv          and the rest: see tables; written when all runs asked for are there

A line that was torn by a crash is dropped, and its run is driven again. So is one whose checksum is not that of its
contents and of its trace, with a warning.
"""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...course.writing import write_file
from ...errors import RunFolderError
from ...messages import FloatArray
from ..folders import add_line, blame, digest, read_lines, sealed_line, unsealed, write_in_order
from .run import RunKey, RunRow

SCHEMA = 1
"""Of the folder; any other is refused."""

ACCEPTED = "a new or empty folder, or one of the same comparison"
"""Folders that a comparison writes to."""

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
        self._poses_sha256: dict[RunKey, str] = {}
        self._digest = ""  # of settings and versions

    def open(self, settings: Mapping[str, Any], versions: Mapping[str, str]) -> None:
        """Make the folder, or read one that is there and was made with the same settings and versions.

        Lines of runs that are damaged are dropped.

        Raises:
          RunFolderError: it holds something else, or cannot be read or written.
        """
        with blame(self.folder, ACCEPTED):
            path = self.folder / _MANIFEST
            self._digest = digest(dict(settings), dict(versions))
            manifest = {"schema": SCHEMA, "settings": dict(settings), "versions": dict(versions)}
            if path.exists():
                self._require_same(json.loads(path.read_text(encoding="utf-8")), manifest)
                self._read(repair=True)
                return
            if self.folder.exists() and any(self.folder.iterdir()):
                raise RunFolderError(f"{self.folder}: is not empty; accepted: {ACCEPTED}")
            self.folder.mkdir(parents=True, exist_ok=True)
            write_file(path, (json.dumps(manifest, indent=2) + "\n").encode())

    def read(self, settings: Mapping[str, Any], versions: Mapping[str, str]) -> None:
        """Read a folder, and leave it as it is.

        Args:
          settings: as its manifest has them.
          versions: as its manifest has them.

        Raises:
          RunFolderError: it cannot be read, or a run in it is damaged.
        """
        self._digest = digest(dict(settings), dict(versions))
        self._read(repair=False)

    def add(self, row: RunRow, trace: FloatArray) -> None:
        """Keep a run: its line, which says that it is finished, comes last.

        Raises:
          RunFolderError: it cannot be written.
        """
        with blame(self.folder, "a folder that can be written"):
            path = self._poses(row.key)
            path.parent.mkdir(exist_ok=True)
            content = io.BytesIO()
            np.save(content, trace.astype(np.float32))
            write_file(path, content.getvalue())
            self._poses_sha256[row.key] = _sha256(content.getvalue())
            add_line(self.folder / _RUNS, self._line(row))
            self.rows[row.key] = row

    def sort(self, keys: Sequence[RunKey]) -> None:
        """Put the lines in the order of `keys`, those of other runs behind them, so that equal runs are equal files.

        Raises:
          RunFolderError: it cannot be written.
        """
        lines = {key: self._line(row) for key, row in self.rows.items()}
        with blame(self.folder, "a folder that can be written"):
            write_in_order(self.folder / _RUNS, lines, keys)

    def trace(self, key: RunKey) -> FloatArray:
        """Return where the rear axle was: x [m], y [m], heading [rad], (n, 3).

        Raises:
          RunFolderError: the file is missing or damaged.
        """
        with blame(self._poses(key), "as `compare` wrote it"):
            return np.asarray(np.load(self._poses(key), allow_pickle=False), np.float64)

    def _poses(self, key: RunKey) -> Path:
        return self.folder / _POSES / f"{key.sha256[:24]}.npy"

    def _line(self, row: RunRow) -> bytes:
        belongs = {"poses_sha256": self._poses_sha256[row.key]} if row.key in self._poses_sha256 else {}
        return sealed_line(row.as_dict() | belongs, self._digest)

    def _read(self, *, repair: bool) -> None:
        """Read the rows; of those that are damaged, raise an error, or warn and drop them."""

        def read(line: bytes, where: Path) -> None:
            with blame(where, "a line that `compare` wrote"):
                values = unsealed(json.loads(line), self._digest)
                row = RunRow.of(values)
            self._read_poses(row.key, values.get("poses_sha256"))
            self.rows[row.key] = row

        read_lines(self.folder / _RUNS, read, repair=repair)

    def _read_poses(self, key: RunKey, sha256: str | None) -> None:
        """Make sure that a trace is there as it was written; None: by a version that had no checksums."""
        path = self._poses(key)
        with blame(path, "as `compare` wrote it"):
            if sha256 is None:
                path.stat()
            elif _sha256(path.read_bytes()) != sha256:
                raise ValueError("its sha256 is another")
            else:
                self._poses_sha256[key] = sha256

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


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
