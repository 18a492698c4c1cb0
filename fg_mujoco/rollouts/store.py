"""The folder of a study: finished parts stay there, and a later call works on those that are missing only.

    manifest.json     settings and versions that made it; a folder of any others is refused
    ROWS.jsonl        one line per finished part, added when it is finished

Each line has the SHA-256 of its contents and of what it belongs to: the settings and versions of its study, and its
place there. A line that was torn by a crash is dropped. One that was edited, or copied from another study or over
another line, is dropped with a warning. The parts of both are worked on again.

A study is a list of parts, which travel to worker processes, a function that works on one, and tables of the rows.
Parts that are more than a row are arrays, see `chunk_store`.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import fields
from pathlib import Path
from typing import Any, TypeVar, get_args, get_type_hints

from ..course.writing import claimed_folder, write_file
from ..errors import RunFolderError
from ..simulation.planner_adapter import short

SCHEMA = 1
"""Of the folder; any other is refused."""

WRITABLE = "a folder that can be written"
_SEAL = "sha256"

_Key = TypeVar("_Key")
_Row = TypeVar("_Row")


class StudyFolder:
    """The folder of a study.

    Args:
      folder: the path.
      title: what the study is called in messages.
      command: that writes it.
      manifest: name of the file that says what made it.

    Attributes:
      folder: the path.
      accepted: folders that the study writes to.
      digest: SHA-256 of its settings and versions.
    """

    def __init__(self, folder: str | Path, *, title: str, command: str, manifest: str = "manifest.json") -> None:
        self.folder = Path(folder)
        self.accepted = f"a new or empty folder, or one of the same {title}"
        self.digest = ""
        self._title, self._command, self._manifest = title, command, manifest

    def open(
        self, settings: Mapping[str, Any], versions: Mapping[str, str], *, others: Mapping[str, Any] | None = None
    ) -> dict[str, Any]:
        """Make the folder, or make sure that one which is there is of the same study; return its manifest.

        Args:
          settings: of the study, as JSON has them.
          versions: that work on it.
          others: what else the manifest of a new folder has.

        Raises:
          RunFolderError: it holds something else, or cannot be read or written.
        """
        with blame(self.folder, self.accepted):
            path = self.folder / self._manifest
            if path.exists():
                manifest = self.manifest(checked=False)
                self._require_same(manifest["versions"], versions)  # first: on them depends which settings there are
                self._require_same(manifest["settings"], settings)
                return manifest
            if self.folder.exists() and any(self.folder.iterdir()):
                raise RunFolderError(f"{self.folder}: is not empty; accepted: {self.accepted}")
            self.folder.mkdir(parents=True, exist_ok=True)
            manifest = {"schema": SCHEMA, "settings": dict(settings), "versions": dict(versions), **(others or {})}
            manifest[_SEAL] = digest(settings, versions)
            write_file(path, (json.dumps(manifest, indent=2) + "\n").encode())
            return self.manifest()

    def manifest(self, *, checked: bool = True) -> dict[str, Any]:
        """Return the settings and versions that made the folder.

        Args:
          checked: whether to compare it with its checksum.

        Raises:
          RunFolderError: it was not made by this study, or is damaged.
        """
        path = self.folder / self._manifest
        if not path.is_file():
            wrote = f"a folder that `{self._command} --out` wrote"
            raise RunFolderError(f"{self.folder}: has no {path.name}; accepted: {wrote}")
        with self.blame(path):
            manifest = json.loads(path.read_text(encoding="utf-8"))
            if not isinstance(manifest, dict) or manifest.get("schema") != SCHEMA:
                raise ValueError(f"no JSON object with schema {SCHEMA}")
            self.digest = digest(manifest["settings"], manifest["versions"])
            if checked and manifest[_SEAL] != self.digest:
                raise ValueError("its sha256 is that of other settings or versions")
            return manifest

    def rows(
        self, name: str, read: Callable[[dict[str, Any]], tuple[_Key, _Row]], *belongs: Any
    ) -> Rows[_Key, _Row]:
        """Return the finished rows of a file of this folder, which is open; damaged ones are dropped, with a warning.

        Args:
          name: of the file; one that is not there has no rows.
          read: makes a key and a row of a line's values; raises an error for those that are damaged.
          belongs: what the rows belong to besides the study.

        Raises:
          RunFolderError: it cannot be read or written.
        """
        rows: Rows[_Key, _Row] = Rows(self.folder / name, (*belongs, self.digest))
        with blame(rows.path, f"as `{self._command}` wrote it"):
            content = rows.path.read_bytes() if rows.path.exists() else b""
            kept = []
            for number, line in enumerate(content.split(b"\n")[:-1], start=1):
                try:
                    with blame(Path(f"{rows.path}, line {number}"), f"a line that `{self._command}` wrote"):
                        key, row = read(unsealed(json.loads(line), *rows.belongs))
                        rows[key], rows.lines[key] = row, line + b"\n"
                except RunFolderError as error:
                    warn_damaged(error)
                else:
                    kept.append(line + b"\n")
            if b"".join(kept) != content:
                write_file(rows.path, b"".join(kept))
            return rows

    def blame(self, path: Path) -> AbstractContextManager[None]:
        """Turn what a damaged file of this folder raises into one line that names it."""
        return blame(path, f"as `{self._command} --out` wrote it")

    def _require_same(self, theirs: Mapping[str, Any], ours: Mapping[str, Any]) -> None:
        ours = json.loads(json.dumps(dict(ours)))  # tuples are lists
        for name in {**ours, **theirs}:
            there, here = theirs.get(name), ours.get(name)
            if there != here:
                if isinstance(there, dict) and isinstance(here, dict):  # of many files those that are others
                    both = {key for key in there if key in here and there[key] == here[key]}
                    there, here = ({k: v for k, v in each.items() if k not in both} for each in (there, here))
                said = f"{name} is {_short(there)} there and {_short(here)} here"
                if name.endswith("_sha256"):
                    what = name.removesuffix("_sha256").replace("_", " ")
                    said = f"the contents of the {what} have changed since then"
                accepted = "accepted: the same settings, or a new or empty folder"
                raise RunFolderError(f"{self.folder}: holds another {self._title}: {said}; {accepted}")


class Rows(dict[_Key, _Row]):
    """The rows of the finished parts of a study, by their keys; `StudyFolder.rows` reads them.

    Attributes:
      path: of their file.
      belongs: what they belong to.
      lines: of the file, by their keys.
    """

    def __init__(self, path: Path, belongs: tuple[Any, ...]) -> None:
        super().__init__()
        self.path, self.belongs = path, belongs
        self.lines: dict[_Key, bytes] = {}

    def add(self, key: _Key, row: _Row, values: Mapping[str, Any]) -> None:
        """Keep a row, and wait until it is on the disk.

        Args:
          key: of the row.
          row: what there is of it in memory.
          values: its line in the file, as JSON has them.

        Raises:
          RunFolderError: it cannot be written.
        """
        line = (json.dumps(sealed(values, *self.belongs)) + "\n").encode()
        with blame(self.path, WRITABLE):
            self.path.parent.mkdir(exist_ok=True)
            with self.path.open("ab") as file:
                file.write(line)
                file.flush()
                os.fsync(file.fileno())
        self[key], self.lines[key] = row, line

    def sort(self, keys: Sequence[_Key]) -> None:
        """Put the lines in the order of `keys`, those of others behind them, so that equal studies are equal files.

        Raises:
          RunFolderError: they cannot be written.
        """
        first = {key: place for place, key in enumerate(keys)}
        order = sorted(self, key=lambda key: (first.get(key, len(first)), str(getattr(key, "sha256", key))))
        with blame(self.path, WRITABLE):
            self.path.parent.mkdir(exist_ok=True)
            write_file(self.path, b"".join(self.lines[key] for key in order))


@contextmanager
def claimed(folder: StudyFolder | None) -> Iterator[None]:
    """Be the only process that writes to a folder, which is made if it is new; None: to nothing.

    Raises:
      RunFolderError: it cannot be made, or another process writes to it.
    """
    with ExitStack() as stack:
        if folder is not None:
            with blame(folder.folder, folder.accepted):
                stack.enter_context(claimed_folder(folder.folder))
        yield


@contextmanager
def blame(path: Path, accepted: str) -> Iterator[None]:
    """Turn whatever a file or folder raises into one line that names it."""
    try:
        yield
    except RunFolderError:
        raise
    except Exception as error:
        reason = getattr(error, "strerror", None) or " ".join(f"{type(error).__name__}: {error}".split())
        raise RunFolderError(f"{path}: {reason}; accepted: {accepted}") from error


def warn_damaged(error: RunFolderError) -> None:
    """Warn of a part of a folder that is taken as not there, so that the study makes it again."""
    path, _, said = " ".join(str(error).partition("; accepted: ")[0].split()).partition(": ")
    warnings.warn(f"{path}: is damaged, and made again: {said}", stacklevel=2)


def of_kind(kind: type[_Row], values: Mapping[str, Any]) -> _Row:
    """Return a dataclass of some values by name.

    Raises:
      KeyError: a value is missing.
      TypeError: a value is of another kind than its field.
    """
    for name, hint in get_type_hints(kind).items():
        value, kinds = values[name], get_args(hint) or (hint,)
        accepted = (*kinds, int) if float in kinds else kinds
        if not isinstance(value, accepted) or (isinstance(value, bool) and bool not in kinds):
            raise TypeError(f"{name} is {short(value)}; accepted: {getattr(hint, '__name__', hint)}")
    return kind(**{field.name: values[field.name] for field in fields(kind)})  # type: ignore[arg-type]


def digest(*parts: Any) -> str:
    """Return the SHA-256 of what JSON can hold."""
    text = json.dumps(parts, sort_keys=True, default=lambda number: number.item())  # numpy's
    return hashlib.sha256(text.encode()).hexdigest()


def sealed(row: Mapping[str, Any], *belongs: Any) -> dict[str, Any]:
    """Return a row with its checksum.

    Args:
      row: what JSON can hold, by name.
      belongs: what it belongs to, which is not in the row.
    """
    return {**row, _SEAL: digest(row, *belongs)}


def unsealed(row: Any, *belongs: Any) -> dict[str, Any]:
    """Return a row of `sealed` without its checksum.

    Raises:
      ValueError: it is another than was written, or belongs elsewhere.
    """
    if not isinstance(row, dict):
        raise ValueError("no JSON object")
    values = {name: value for name, value in row.items() if name != _SEAL}
    if row.get(_SEAL) != digest(values, *belongs):
        raise ValueError("its sha256 is that of other contents, or of another place")
    return values


def as_json(values: dict[str, Any]) -> str:
    """Return JSON in which NaN and infinity are null."""
    return json.dumps(_without_nan(values), indent=2, allow_nan=False)


def _without_nan(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_nan(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_without_nan(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _short(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= 60 else text[:57] + "..."
