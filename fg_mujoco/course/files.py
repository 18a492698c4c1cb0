"""Files that users name, and that others may have made: only regular ones of a bounded size are read.

A FIFO or a device would be read for ever, and a name can be too long for the system or contain NUL.
"""

from __future__ import annotations

import os
import stat
from pathlib import Path

MOST_BYTES = 64 * 2**20
"""Of a file that is read whole as text."""


LONGEST_NAME = 8192
"""Of a track or a controller with its settings [characters]: a path has 4096 at most."""


def require_regular(path: str | Path) -> None:
    """Make sure that a file is one to be read to its end.

    Raises:
      OSError: there is none, or it is a folder, a FIFO or a device; `strerror` says it.
    """
    try:
        mode = os.stat(path).st_mode
    except ValueError as error:  # NUL
        raise OSError(0, "a name with a NUL character", str(path)) from error
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(0, "is a folder", str(path))
    if not stat.S_ISREG(mode):
        raise OSError(0, "is a FIFO or a device, not a regular file", str(path))


def read_bytes(path: str | Path, most: int = MOST_BYTES) -> bytes:
    """Return the contents of a regular file.

    Raises:
      OSError: as `require_regular`, or the file has more than `most` bytes, or cannot be read; `strerror` says it.
    """
    require_regular(path)
    with open(path, "rb") as file:
        content = file.read(most + 1)
    if len(content) > most:
        raise OSError(0, f"has more than {most} bytes", str(path))
    return content


def read_text(path: str | Path, most: int = MOST_BYTES) -> str:
    """Return the text of a regular file in UTF-8, without the signature that Windows editors put first.

    Raises:
      OSError: as `read_bytes`.
      UnicodeDecodeError: it is not UTF-8.
    """
    return read_bytes(path, most).decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")


def is_file(path: str | Path) -> bool:
    """Say whether there is a regular file; there is none of a name that the system does not take."""
    try:
        require_regular(path)
    except OSError:
        return False
    return True


def is_folder(path: str | Path) -> bool:
    """Say whether there is a folder; there is none of a name that the system does not take."""
    try:
        return Path(path).is_dir()
    except (OSError, ValueError):
        return False
