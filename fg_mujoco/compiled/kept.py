"""Keeps what takes long to make in a folder of the user's own, so that the next process finds it there.

    table = kept("table", made_by(make, numbers.tobytes()), lambda: make(numbers), lambda table: len(table) > 0)

An entry is named by a hash of what it depends on. One that is damaged, or cannot be written, is made again.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import pickle
import stat
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

from .kernel_files import own_folder, read_kept, write_kept
from .kernel_keys import identity
from .machine_code import machine

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
    found = read_kept(file)
    with contextlib.suppress(Exception):  # whatever is wrong with it, making it helps
        if found is not None and holds(found):
            with contextlib.suppress(OSError):
                os.utime(file)  # it was used
            return cast(_Made, found)
    made = make()
    if holds(made):
        write_kept(file, pickle.dumps(made))
        _drop_oldest(folder)
    return made


def made_by(kernel: Any, *arguments: bytes) -> tuple[object, ...] | None:
    """Return the key of what a kernel makes of some arguments; None where Python runs it, or it has no source."""
    with contextlib.suppress(AttributeError, OSError):
        return identity(kernel.py_func), machine(), *arguments
    return None


@cache
def _folder() -> Path | None:
    return own_folder("kept")  # whoever compiles kernels says where others may write


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
