"""The folder of the lab: cells that are finished stay there, and a later call goes on with the others.

    lab.json                the settings and versions that made it; a folder of any others is refused
    cells/NAME.jsonl        a line a cell of that experiment, with its rows, added when it is finished
    NAME_TABLE.csv          and the rest: see lab_report; written when all cells asked for are there

A line that was torn by a crash is dropped, and its cell is measured again. So is one whose checksum is not that of its
contents, with a warning. NaN is written as Python's json does.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from ...course.writing import write_file
from ...errors import RunFolderError
from ..folders import add_line, blame, digest, sealed, unsealed, warn_damaged
from .experiment import Cell, Tables

SCHEMA = 1
"""Of the folder; any other is refused."""

_MANIFEST, _CELLS = "lab.json", "cells"
ACCEPTED = "a new or empty folder, or one of the lab with the same settings and sources"
"""Folders that the lab writes to."""


class LabFolder:
    """Keeps the rows of cells.

    Args:
      folder: the path.

    Attributes:
      folder: the path.
      versions: that made the rows.
    """

    def __init__(self, folder: str | Path) -> None:
        self.folder = Path(folder)
        self.versions: dict[str, str] = {}
        self._digest = ""  # of settings and versions

    def open(self, settings: Mapping[str, Any], versions: Mapping[str, str], *, any_versions: bool = False) -> None:
        """Make the folder, or make sure that one which is there is of the same lab.

        Args:
          settings: of the lab, as JSON has them.
          versions: that measure it.
          any_versions: whether to take a folder that other versions made; its rows stay theirs.

        Raises:
          RunFolderError: it holds something else, or cannot be read or written.
        """
        with blame(self.folder, ACCEPTED):
            path = self.folder / _MANIFEST
            if path.exists():
                theirs = json.loads(path.read_text(encoding="utf-8"))
                if not isinstance(theirs, dict) or theirs.get("schema") != SCHEMA:
                    raise ValueError(f"{_MANIFEST} is no JSON object with schema {SCHEMA}")
                self._require_same(theirs["settings"], settings)
                if not any_versions:
                    self._require_same(theirs["versions"], versions)
                self.versions = theirs["versions"]
                self._digest = digest(theirs["settings"], self.versions)
                return
            if self.folder.exists() and any(self.folder.iterdir()):
                raise RunFolderError(f"{self.folder}: is not empty; accepted: {ACCEPTED}")
            self.folder.mkdir(parents=True, exist_ok=True)
            self.versions = dict(versions)
            self._digest = digest(json.loads(json.dumps(settings)), self.versions)
            manifest = {"schema": SCHEMA, "settings": dict(settings), "versions": self.versions}
            replace_text(path, json.dumps(manifest, indent=2) + "\n")

    def read(self, experiment: str) -> dict[str, Tables]:
        """Return the rows of the finished cells of an experiment, by `cell_key`; lines that are damaged are dropped.

        Raises:
          RunFolderError: the file cannot be read or written.
        """
        path = self._path(experiment)
        if not path.exists():
            return {}
        with blame(path, "as `friction` wrote it"):
            content = path.read_bytes()
            whole, _, _ = content.rpartition(b"\n")
            found: dict[str, Tables] = {}
            kept = []
            for number, line in enumerate(whole.split(b"\n") if whole else (), start=1):
                try:
                    row = unsealed(json.loads(line), experiment, self._digest)
                    found[cell_key(row["cell"])] = row["tables"]
                except (ValueError, KeyError) as error:
                    warn_damaged(f"{path}, line {number}", error)
                else:
                    kept.append(line + b"\n")
            if b"".join(kept) != content:
                write_file(path, b"".join(kept))
            return found

    def add(self, experiment: str, cell: Cell, tables: Tables) -> None:
        """Keep the rows of a cell.

        Raises:
          RunFolderError: they cannot be written.
        """
        path = self._path(experiment)
        with blame(path, "a folder that can be written"):
            path.parent.mkdir(exist_ok=True)
            add_line(path, self._line(experiment, cell, tables))

    def sort(self, experiment: str, cells: Iterable[tuple[Cell, Tables]]) -> None:
        """Put the lines in the order of the cells, so that equal experiments are equal files.

        Raises:
          RunFolderError: they cannot be written.
        """
        path = self._path(experiment)
        with blame(path, "a folder that can be written"):
            path.parent.mkdir(exist_ok=True)
            write_file(path, b"".join(self._line(experiment, cell, tables) for cell, tables in cells))

    def _line(self, experiment: str, cell: Cell, tables: Tables) -> bytes:
        row = {"cell": cell, "tables": as_read(tables)}
        return (_text(sealed(row, experiment, self._digest)) + "\n").encode()

    def _path(self, experiment: str) -> Path:
        return self.folder / _CELLS / f"{experiment}.jsonl"

    def _require_same(self, theirs: Mapping[str, Any], ours: Mapping[str, Any]) -> None:
        for name in {**ours, **theirs}:
            there, here = (json.loads(json.dumps(values.get(name))) for values in (theirs, ours))  # tuples are lists
            if there != here:
                raise RunFolderError(
                    f"{self.folder}: was made with other settings or sources: {name} is {json.dumps(there)} there and "
                    f"{json.dumps(here)} here; accepted: the same, or a new or empty folder"
                )


def cell_key(cell: Cell) -> str:
    """Return what a cell is known by."""
    return json.dumps(cell, sort_keys=True)


def as_read(tables: Tables) -> Tables:
    """Return rows as they are read from a file: plain Python's numbers."""
    plain: Tables = json.loads(_text(tables))
    return plain


def replace_text(path: Path, text: str) -> None:
    """Write a text file in one piece, in the place of one that may be there."""
    write_file(path, text.encode())


def _text(value: Any) -> str:
    return json.dumps(value, default=lambda number: number.item())  # numpy's
