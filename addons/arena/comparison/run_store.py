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
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from fg_mujoco.course.writing import write_file
from fg_mujoco.messages import FloatArray
from fg_mujoco.rollouts.store import WRITABLE, Rows, blame

from ..grid_study import GridFolder
from .run import Run, RunKey, RunRow


class ComparisonFolder(GridFolder):
    """Keeps the rows and traces of runs.

    Args:
      folder: the path.

    Attributes:
      runs: rows that are there, by their keys; once they are read.
    """

    runs: Rows[RunKey, RunRow]

    def __init__(self, folder: str | Path) -> None:
        super().__init__(folder, RunRow.of, title="comparison", command="compare", file="runs.jsonl")

    def keep(self, run: Run, answer: tuple[RunRow, FloatArray]) -> None:
        """Keep the row and the trace of a run: its line, which says that it is finished, comes last.

        Raises:
          RunFolderError: it cannot be written.
        """
        row, trace = answer
        content = io.BytesIO()
        np.save(content, trace.astype(np.float32))
        path = self._poses(row.key)
        with blame(self.folder, WRITABLE):
            path.parent.mkdir(exist_ok=True)
            write_file(path, content.getvalue())
        self.runs.add(row.key, row, row.as_dict() | {"poses_sha256": _sha256(content.getvalue())})
        if row.figures.end_reason == "worker_died":
            warnings.warn(f"{run}: {row.figures.message}", UserWarning, stacklevel=2)

    def trace(self, key: RunKey) -> FloatArray:
        """Return where the rear axle was: x [m], y [m], heading [rad], (n, 3).

        Raises:
          RunFolderError: the file is missing or damaged.
        """
        with self.blame(self._poses(key)):
            return np.asarray(np.load(self._poses(key), allow_pickle=False), np.float64)

    def _poses(self, key: RunKey) -> Path:
        return self.folder / "poses" / f"{key.sha256[:24]}.npy"

    def _read_row(self, values: dict[str, Any]) -> tuple[RunKey, RunRow]:
        key, row = super()._read_row(values)
        path = self._poses(key)
        with self.blame(path):
            content = path.read_bytes()
            if values.get("poses_sha256", _sha256(content)) != _sha256(content):  # older versions have none
                raise ValueError("its sha256 is another")
        return key, row


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
