"""Files that users name, and that others may have made: only regular ones of a bounded size are read.

A FIFO or a device would be read for ever, and a name can be too long for the system or contain NUL.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import stat
import sys
import threading
from collections.abc import Iterator, Sequence
from contextvars import ContextVar
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import SettingsError

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

MOST_BYTES = 64 * 2**20
"""Of a file that is read whole as text."""

LONGEST_NAME = 8192
"""Of a track or a controller with its settings [characters]: a path has 4096 at most."""

PICTURES = (".png", ".pgm", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".gif", ".webp")
"""Suffixes of pictures."""

_FOREIGN = {
    (".json", ".geojson"): "JSON, as other stacks write waypoints and parameters",
    (".npy", ".npz"): "an array of NumPy",
    (".stl", ".obj", ".dae", ".ply", ".glb", ".gltf"): "a mesh, which has no line and no masses",
    (".urdf", ".xacro"): "a URDF, of ROS",
    (".sdf", ".world"): "a model or a world of Gazebo",
    (".pcd", ".las"): "a cloud of points",
    (".bag", ".db3", ".mcap"): "a bag of ROS",
    (".pbstream", ".posegraph", ".data"): "the state of a SLAM, which saves a map as YAML and image",
    PICTURES: "a picture",
}


def foreign_kind(path: str | Path) -> str | None:
    """Return what a file is by its suffix, in words, where it is neither a course's nor a vehicle's."""
    suffix = Path(path).suffix.lower()
    return next((kind for suffixes, kind in _FOREIGN.items() if suffix in suffixes), None)


_noted: ContextVar[dict[str, object] | None] = ContextVar("_noted", default=None)


@contextlib.contextmanager
def noting_files() -> Iterator[dict[str, str]]:
    """Note what `require_regular` is asked about inside this.

    The dictionary gets, at the end, the `state_of` each file by its path; nothing where one has changed meanwhile.
    """
    found: dict[str, str] = {}
    noted: dict[str, object] = {}
    token = _noted.set(noted)
    try:
        yield found
    finally:
        _noted.reset(token)
    states = {path: state_of(path) for path in noted}
    found |= states if all(_status(path) == noted[path] for path in noted) else {}


def state_of(path: str | Path) -> str:
    """Return the hash of a regular file; nothing where there is none that can be read."""
    try:
        require_regular(path)
        return file_sha256(path)
    except OSError:
        return ""


def _status(path: str | Path) -> object:
    try:
        status = os.stat(path)
    except (OSError, ValueError):
        return None
    return status.st_ino, status.st_mode, status.st_size, status.st_mtime_ns


def require_regular(path: str | Path) -> None:
    """Raise OSError, whose `strerror` says why, unless a file can be read to its end: no folder, FIFO or device."""
    if (noted := _noted.get()) is not None:
        noted[str(path)] = _status(path)
    try:
        mode = os.stat(path).st_mode
    except ValueError as error:  # NUL
        raise OSError(0, "a name with a NUL character", str(path)) from error
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(0, "is a folder", str(path))
    if not stat.S_ISREG(mode):
        raise OSError(0, "is a FIFO or a device, not a regular file", str(path))


def read_bytes(path: str | Path, most: int = MOST_BYTES) -> bytes:
    """Return the contents of a regular file of at most `most` bytes; raise OSError, as `require_regular`."""
    require_regular(path)
    with open(path, "rb") as file:
        content = file.read(most + 1)
    if len(content) > most:
        raise OSError(0, f"has more than {most} bytes", str(path))
    return content


def read_text(path: str | Path, most: int = MOST_BYTES) -> str:
    """Return the text of a regular file in UTF-8, without the signature that Windows editors put first.

    Raises:
      OSError, UnicodeDecodeError: as `read_bytes`; it is not UTF-8.
    """
    return read_bytes(path, most).decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")


def read_setting(path: str | Path, said: str, accepted: str, most: int = MOST_BYTES) -> str:
    """Return the text of a file of at most `most` bytes that a setting names.

    Raises:
      SettingsError: it cannot be read, for a reason of `read_text`; it has `said`, and what is `accepted`.
    """
    try:
        return read_text(path, most)
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "it is not UTF-8 text"
        raise SettingsError(f"{said}: {reason}; accepted: {accepted}") from error


def read_arrays(path: str | Path, names: Sequence[str], most: int) -> dict[str, Any]:
    """Return the arrays of a file of `numpy.savez_compressed` with these and no others; pickled objects are not read.

    Raises:
      OSError, ValueError, EOFError, zipfile.BadZipFile: no such file, other arrays, or more than `most` bytes in all.
    """
    require_regular(path)
    with np.load(path, allow_pickle=False) as file:
        if set(file.files) != set(names):
            raise ValueError(f"it has not the arrays {', '.join(names)} and no others")
        if sum(member.file_size for member in file.zip.infolist()) > most:
            raise ValueError(f"its arrays have more than {most} bytes")
        return {name: file[name] for name in names}


def parse_toml(text: str) -> dict[str, Any]:
    """Return the content of a TOML text as it stands, unlike `documents`; raise ValueError, RecursionError."""
    return tomllib.loads(text)


def file_sha256(*paths: str | Path) -> str:
    """Return the hash of a file, or of several one after the other, without holding them in memory; raise OSError."""
    digest = hashlib.sha256()
    for path in paths:
        with open(path, "rb") as file:
            while part := file.read(2**20):
                digest.update(part)
    return digest.hexdigest()


def is_file(path: str | Path) -> bool:
    """Return whether there is a regular file; there is none of a name that the system does not take."""
    try:
        require_regular(path)
    except OSError:
        return False
    return True


def is_folder(path: str | Path) -> bool:
    """Return whether there is a folder; there is none of a name that the system does not take."""
    try:
        return Path(path).is_dir()
    except (OSError, ValueError):
        return False


@contextlib.contextmanager
def kept_folder() -> Iterator[None]:
    """Make the current folder in the end again what it was, where a planner has changed it: paths are from there."""
    folder = _current_folder()
    try:
        yield
    finally:
        if folder is not None and _current_folder() != folder:
            with contextlib.suppress(OSError):
                os.chdir(folder)


def _current_folder() -> str | None:
    """Return the current folder; None: another thread may change it, or it is not there any more."""
    if threading.current_thread() is not threading.main_thread():
        return None
    try:
        return os.getcwd()
    except OSError:
        return None
