"""Files in the folders of studies: whatever goes wrong is said in one line, and what is damaged is found.

A row has the SHA-256 of its contents and of what it belongs to: the settings of its study, and its place there. So a
row that was copied from another study, or over another one, is found, too.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from ..course.writing import claimed_folder, write_file
from ..errors import RunFolderError

_SEAL = "sha256"


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


@contextmanager
def claimed(folder: str | Path | None, accepted: str) -> Iterator[None]:
    """Be the only process that writes to a folder, which is made if it is new; None: to nothing.

    Raises:
      RunFolderError: it cannot be made, or another process writes to it.
    """
    with ExitStack() as stack:
        if folder is not None:
            with blame(Path(folder), accepted):
                stack.enter_context(claimed_folder(folder))
        yield


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
    """Return a row of `sealed` without its checksum; rows of older versions have none.

    Raises:
      ValueError: it is another than was written, or belongs elsewhere.
    """
    if not isinstance(row, dict):
        raise ValueError("no JSON object")
    values = {name: value for name, value in row.items() if name != _SEAL}
    if _SEAL in row and row[_SEAL] != digest(values, *belongs):
        raise ValueError("its sha256 is that of other contents, or of another place")
    return values


def sealed_line(row: Mapping[str, Any], *belongs: Any) -> bytes:
    """Return a row with its checksum as a line of JSON."""
    return (json.dumps(sealed(row, *belongs)) + "\n").encode()


def add_line(path: Path, line: bytes) -> None:
    """Add a line to a file, and wait until it is on the disk.

    Raises:
      OSError: it cannot be written.
    """
    with path.open("ab") as file:
        file.write(line)
        file.flush()
        os.fsync(file.fileno())


def write_in_order(path: Path, lines: Mapping[Any, bytes], keys: Sequence[Any]) -> None:
    """Write the lines of a file in the order of `keys`, which have a `sha256`, those of others behind them.

    So equal rows are equal files.

    Raises:
      OSError: it cannot be written.
    """
    first = {key: place for place, key in enumerate(keys)}
    order = sorted(lines, key=lambda key: (first.get(key, len(first)), key.sha256))
    write_file(path, b"".join(lines[key] for key in order))


def read_lines(path: Path, read: Callable[[bytes, Path], None], *, repair: bool) -> None:
    """Read the rows of a file that `add_line` wrote; of those that are damaged, raise an error, or warn and drop them.

    Args:
      path: of the file; one that is not there has no rows.
      read: takes a line, and what it is called in messages; raises RunFolderError for one that is damaged.
      repair: drop the damaged ones from the file, and what a crash has torn.

    Raises:
      RunFolderError: one is damaged, and is not to be dropped.
    """
    if not path.exists():
        return
    content = path.read_bytes()
    whole, _, _ = content.rpartition(b"\n")
    kept = []
    for number, line in enumerate(whole.split(b"\n") if whole else (), start=1):
        try:
            read(line, Path(f"{path}, line {number}"))
        except RunFolderError as error:
            if not repair:
                raise
            warn_damaged(str(error).partition(": ")[0], error)
        else:
            kept.append(line + b"\n")
    if repair and b"".join(kept) != content:
        write_file(path, b"".join(kept))


def warn_damaged(path: Path | str, error: Exception) -> None:
    """Warn of a part of a folder that is taken as not there, so that the study makes it again."""
    said = " ".join(str(error).removeprefix(f"{path}: ").partition("; accepted: ")[0].split())
    warnings.warn(f"{path}: is damaged, and made again: {said}", stacklevel=2)


def as_json(values: dict[str, Any]) -> str:
    """Return JSON in which NaN and infinity are null."""
    return json.dumps(_without_nan(values), indent=2, allow_nan=False)


def _without_nan(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_nan(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_without_nan(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
