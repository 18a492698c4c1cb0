"""Keeps what takes long to make in a folder of the user's own, so that the next process finds it there.

    table = kept("table", (version, numbers.tobytes()), lambda: make(numbers), lambda table: len(table) > 0)

An entry is named by a hash of what it depends on. One that is damaged, or cannot be written, is made again.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import pickle
import stat
import sys
import uuid
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

_Made = TypeVar("_Made")

MOST_BYTES = 256 * 2**20
"""Of the folder; a large map and its model are 4 MB. The entries that were not used for longest are dropped."""


def kept(kind: str, key: tuple[object, ...] | None, make: Callable[[], _Made], holds: Callable[[_Made], bool]) -> _Made:
    """Return what is kept under a key, or what `make` returns, which is kept.

    Args:
      kind: of the entry, the beginning of its file's name.
      key: texts, bytes and numbers: all that the result depends on, sources and versions too; None: it is not known.
      make: returns what can be pickled; where it raises, nothing is kept.
      holds: returns whether what is kept may be used, and what was made may be kept.
    """
    folder = _folder()
    if folder is None or key is None:
        return make()
    digest = hashlib.sha256(repr(key).encode()).hexdigest()
    file = folder / f"{kind}-{digest[:32]}"
    found = _read(file)
    with contextlib.suppress(Exception):  # whatever is wrong with it, making it helps
        if found is not None and holds(found):
            with contextlib.suppress(OSError):
                os.utime(file)  # it was used
            return cast(_Made, found)
    made = make()
    if holds(made):
        _write(file, pickle.dumps(made))
        _drop_oldest(folder)
    return made


@cache
def _folder() -> Path | None:
    """Return the folder, in $XDG_CACHE_HOME or ~/.cache: made if it is new, and only this user may write to it.

    A variable that is not absolute is ignored, as the XDG Base Directory Specification asks: it would be in whatever
    folder is present. None where others may write to it, which is said on stderr, or it cannot be made or written to.
    """
    try:
        given = os.environ.get("XDG_CACHE_HOME", "")
        base = given if os.path.isabs(given) else os.path.expanduser("~/.cache")
        if not os.path.isabs(base):  # there is no home, or it is relative
            return None
        parent = Path(base, "fg_mujoco")
        folder = parent / "kept"
        parent.parent.mkdir(parents=True, exist_ok=True)
        for path in (parent, folder):
            path.mkdir(mode=0o700, exist_ok=True)
        unsafe = [path for path in (parent, folder) if _open_to_others(path)]
        if not unsafe:
            return folder if os.access(folder, os.W_OK) else None
        if sys.stderr is not None:
            said = f"fg_mujoco: other users may write to {unsafe[0]}: courses and models are not kept there"
            with contextlib.suppress(OSError, ValueError):  # stderr is closed
                print(said, file=sys.stderr, flush=True)
    except OSError:  # it cannot be made
        pass
    return None


def _open_to_others(folder: Path) -> bool:
    """Return whether a folder is another user's, or group or others may write to it."""
    status = folder.stat()
    return hasattr(os, "geteuid") and (
        status.st_uid != os.geteuid() or bool(status.st_mode & (stat.S_IWGRP | stat.S_IWOTH))
    )


def _read(file: Path) -> Any:
    """Return what is kept in a file; None where it is not there, or damaged."""
    with contextlib.suppress(Exception):  # whatever is wrong with it, making it helps
        if not file.is_file():  # as a FIFO or a device, which has no end
            return None
        kept = file.read_bytes()
        digest, payload = kept[:32], kept[32:]
        if hashlib.sha256(payload).digest() == digest:
            return pickle.loads(payload)
    return None


def _write(file: Path, payload: bytes) -> None:
    """Keep something pickled in a file, if one can be written there."""
    unfinished = file.with_name(f"{file.name}.{uuid.uuid4().hex}")
    with contextlib.suppress(OSError):
        try:
            unfinished.write_bytes(hashlib.sha256(payload).digest() + payload)
            unfinished.replace(file)
        finally:  # also after Ctrl-C
            unfinished.unlink(missing_ok=True)


def _drop_oldest(folder: Path) -> None:
    """Drop the entries that were not used for longest, as long as all have more than MOST_BYTES."""
    entries = []
    for path in folder.iterdir():
        with contextlib.suppress(OSError):  # another process may be dropping them, too
            status = path.lstat()
            if stat.S_ISREG(status.st_mode):
                entries.append((status.st_mtime, status.st_size, path))
    total = sum(size for _, size, _ in entries)
    for _, size, path in sorted(entries):
        if total <= MOST_BYTES:
            return
        with contextlib.suppress(OSError):
            path.unlink()
        total -= size
