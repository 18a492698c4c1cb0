"""Files in the folders of studies: each is written in one piece, and whatever goes wrong is said in one line."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

from ..errors import RunFolderError


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


def write_file(path: Path, write: Callable[[IO[bytes]], Any]) -> None:
    """Write a file aside, wait until it is on the disk, and move it into its place."""
    aside = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        with aside.open("wb") as file:
            write(file)
            file.flush()
            os.fsync(file.fileno())
        aside.replace(path)
    finally:
        aside.unlink(missing_ok=True)


def replace_file(path: Path, text: bytes) -> None:
    """Write a file in one piece, in the place of one that may be there."""
    write_file(path, lambda file: file.write(text))


def as_json(values: dict[str, Any]) -> str:
    """Return JSON in which NaN and infinity are null."""
    return json.dumps(_without_nan(values), indent=2, allow_nan=False)


def _without_nan(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_nan(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_without_nan(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
