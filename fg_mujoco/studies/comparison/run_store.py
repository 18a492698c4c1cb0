"""The folder of a comparison. It keeps the finished runs, and a later call drives the others.

    manifest.json     the settings that all runs have in common, and the versions; a folder of any others is refused
    runs.jsonl        a line a run, added when it is finished
    poses/RUN.npy     pose of the rear axle in that run, x [m], y [m], heading [rad], (n, 3) float32
    runs.csv          and the rest: see tables; written when all runs asked for are there

A run whose line or poses are damaged is driven again, with a warning.
"""

from __future__ import annotations

import hashlib
import io
from pathlib import Path
from typing import Any

import numpy as np

from ...course.writing import write_file
from ...messages import FloatArray
from ..store import WRITABLE, Rows, StudyFolder, blame
from .run import RunKey, RunRow


class ComparisonFolder(StudyFolder):
    """Keeps the rows and traces of runs.

    Args:
      folder: the path.

    Attributes:
      runs: rows that are there, by their keys; once they are read.
    """

    runs: Rows[RunKey, RunRow]

    def __init__(self, folder: str | Path) -> None:
        super().__init__(folder, title="comparison", command="compare")

    def read(self, *, repair: bool) -> None:
        """Read the rows of a folder that is open, and compare each with its checksum and each trace with its own.

        Args:
          repair: whether to warn of damaged runs, and drop them, or to raise an error.

        Raises:
          RunFolderError: it cannot be read or written, or a run in it is damaged.
        """
        self.runs = self.rows("runs.jsonl", self._read_run, repair=repair)

    def add(self, row: RunRow, trace: FloatArray) -> None:
        """Keep a run: its line, which says that it is finished, comes last.

        Raises:
          RunFolderError: it cannot be written.
        """
        content = io.BytesIO()
        np.save(content, trace.astype(np.float32))
        path = self._poses(row.key)
        with blame(self.folder, WRITABLE):
            path.parent.mkdir(exist_ok=True)
            write_file(path, content.getvalue())
        self.runs.add(row.key, row, row.as_dict() | {"poses_sha256": _sha256(content.getvalue())})

    def trace(self, key: RunKey) -> FloatArray:
        """Return where the rear axle was: x [m], y [m], heading [rad], (n, 3).

        Raises:
          RunFolderError: the file is missing or damaged.
        """
        with self.blame(self._poses(key)):
            return np.asarray(np.load(self._poses(key), allow_pickle=False), np.float64)

    def _poses(self, key: RunKey) -> Path:
        return self.folder / "poses" / f"{key.sha256[:24]}.npy"

    def _read_run(self, values: dict[str, Any]) -> tuple[RunKey, RunRow]:
        row, path = RunRow.of(values), self._poses(RunRow.of(values).key)
        with self.blame(path):
            content = path.read_bytes()
            if values.get("poses_sha256", _sha256(content)) != _sha256(content):  # older versions have none
                raise ValueError("its sha256 is another")
        return row.key, row


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
