"""The folder of an overtaking study. It keeps the finished duels, and a later call drives the others.

    manifest.json     the settings that all duels have in common, and the versions; a folder of any others is refused
    duels.jsonl       a line a duel, added when it is finished
    duels.csv         and the rest: see tables; written when all duels asked for are there

A line that was torn by a crash, or whose checksum is not that of its contents, is dropped with a warning, and its duel
is driven again.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ...course.writing import write_file
from ...errors import RunFolderError
from ..folders import add_line, blame, digest, read_lines, sealed_line, unsealed, write_in_order
from .duel import DuelKey, DuelRow

SCHEMA = 1
"""Of the folder; any other is refused."""

ACCEPTED = "a new or empty folder, or one of the same overtaking study"
"""Folders that a study writes to."""

_MANIFEST, _DUELS = "manifest.json", "duels.jsonl"


class DuelFolder:
    """Keeps the rows of duels.

    Args:
      folder: the path.

    Attributes:
      folder: the path.
      rows: that are there, by their keys.
    """

    def __init__(self, folder: str | Path) -> None:
        self.folder = Path(folder)
        self.rows: dict[DuelKey, DuelRow] = {}
        self._digest = ""  # of settings and versions

    def open(self, settings: Mapping[str, Any], versions: Mapping[str, str]) -> None:
        """Make the folder, or read one that is there and was made with the same settings and versions.

        Raises:
          RunFolderError: it holds something else, or cannot be read or written.
        """
        with blame(self.folder, ACCEPTED):
            path = self.folder / _MANIFEST
            manifest = {"schema": SCHEMA, "settings": dict(settings), "versions": dict(versions)}
            self._digest = digest(manifest)
            if path.exists():
                theirs = json.loads(path.read_text(encoding="utf-8"))
                if theirs != json.loads(json.dumps(manifest)):
                    said = "holds a study of other settings or versions"
                    raise RunFolderError(f"{self.folder}: {said}; accepted: {ACCEPTED}")
                self._read()
                return
            if self.folder.exists() and any(self.folder.iterdir()):
                raise RunFolderError(f"{self.folder}: is not empty; accepted: {ACCEPTED}")
            self.folder.mkdir(parents=True, exist_ok=True)
            write_file(path, (json.dumps(manifest, indent=2) + "\n").encode())

    def add(self, row: DuelRow) -> None:
        """Keep a duel.

        Raises:
          RunFolderError: it cannot be written.
        """
        with blame(self.folder, "a folder that can be written"):
            add_line(self.folder / _DUELS, self._line(row))
            self.rows[row.key] = row

    def sort(self, keys: Sequence[DuelKey]) -> None:
        """Put the lines in the order of `keys`, those of other duels behind them.

        Raises:
          RunFolderError: it cannot be written.
        """
        lines = {key: self._line(row) for key, row in self.rows.items()}
        with blame(self.folder, "a folder that can be written"):
            write_in_order(self.folder / _DUELS, lines, keys)

    def _line(self, row: DuelRow) -> bytes:
        return sealed_line(row.as_dict(), self._digest)

    def _read(self) -> None:
        """Read the rows; warn of those that are damaged, and drop them."""

        def read(line: bytes, where: Path) -> None:
            with blame(where, "a line that `overtake` wrote"):
                row = DuelRow.of(unsealed(json.loads(line), self._digest))
            self.rows[row.key] = row

        read_lines(self.folder / _DUELS, read, repair=True)
