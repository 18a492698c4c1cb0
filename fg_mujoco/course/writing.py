"""Files and folders that commands write: each appears whole and in its place, or not at all.

    write_file("oval.csv", b"...")

A file is written aside, in the same folder, under a name that nobody can predict. It is moved into its place when all
of it is on the disk. Whoever writes holds a lock on what is written (flock), which ends with the process, however that
ends. So files of a killed process differ from those that another is still writing, and the next write into the folder
removes it.
"""

from __future__ import annotations

import json
import os
import re
import secrets
import shutil
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import IO, Any

from ..errors import FgMujocoError, RunFolderError
from .files import require_regular

try:
    import fcntl
except ImportError:  # a system without flock, on which nothing that is left over is removed
    fcntl = None  # type: ignore[assignment]

_ASIDE = re.compile(r"\.fg_mujoco-[0-9a-f]{16}\.partial")
_MOVES = ".moves.json"  # in a folder aside: the files to be moved, by name, and their inodes

Content = bytes | Callable[[IO[bytes]], Any]
"""Of a file: its bytes, or a function that writes them to a file."""


def write_file(path: str | Path, content: Content) -> None:
    """Write a file in one piece, in the place of one that may be there.

    Raises:
      OSError: it cannot be written; what was there is there, and nothing else.
    """
    write_files({Path(path): content})


def write_files(contents: Mapping[Path, Content]) -> None:
    """Write several files, each in one piece: all, or none. Raises what `write_file` raises."""
    with ExitStack() as stack:
        for path, content in contents.items():
            with stack.enter_context(staged_file(path)).open("wb") as file:
                file.write(content) if isinstance(content, bytes) else content(file)
                file.flush()
                os.fsync(file.fileno())  # what does not fit on the disk is refused before any is moved


@contextmanager
def writing(path: str | Path, accepted: str = "a file in a folder that can be") -> Iterator[None]:
    """Raise RunFolderError in the place of the OSError of a file or folder that cannot be written."""
    try:
        yield
    except FgMujocoError:  # some are errors of the system, too
        raise
    except OSError as error:
        reason = error.strerror or str(error)
        raise RunFolderError(f"{path}: cannot be written: {reason}; accepted: {accepted}") from error


@contextmanager
def staged_file(path: str | Path) -> Iterator[Path]:
    """Yield an empty file to write to; in the end it is moved to `path`, or removed if there was an error.

    Raises:
      OSError: `path` is a folder or a device, or cannot be written.
    """
    with suppress(FileNotFoundError):
        require_regular(path)
    path = Path(os.path.realpath(path))  # a link stays one
    sweep(path.parent)
    aside, descriptor = _create(path.parent, folder=False)
    try:
        yield aside
        os.fsync(descriptor)
        os.replace(aside, path)
    finally:
        with suppress(OSError):
            aside.unlink()
        os.close(descriptor)
    _wait_for_disk(path.parent)


def require_writable(path: str | Path) -> None:
    """Raise OSError for a file that cannot be written; everything stays as it was."""
    with suppress(FileNotFoundError):
        require_regular(path)
    aside, descriptor = _create(Path(path).parent, folder=False)
    os.close(descriptor)
    aside.unlink()


@contextmanager
def claimed_folder(folder: str | Path) -> Iterator[Path]:
    """Make a folder, if it is new, and be the only process that writes to it; one that stays empty is removed again.

    Raises:
      OSError: it cannot be made, or another process has claimed it; `strerror` says it.
    """
    folder = Path(folder)
    created = [path for path in (folder, *folder.parents) if not path.exists()]
    descriptor = _claim(folder)
    try:
        sweep(folder)
        yield folder
    finally:
        for path in created:
            with suppress(OSError):
                path.rmdir()
        os.close(descriptor)


@contextmanager
def staged_folder(folder: Path, last: str) -> Iterator[Path]:
    """Yield a new folder to write files to; in the end they are moved into `folder`, which this process has claimed.

    Files of the same names are replaced; `last` is moved last: where it is, all are. After an error none are.
    """
    aside, descriptor = _create(folder, folder=True)
    try:
        yield aside
        names = sorted((path.name for path in aside.iterdir()), key=lambda name: (name == last, name))
        moves = {name: (aside / name).stat().st_ino for name in names}
        write_file(aside / _MOVES, json.dumps(moves).encode())  # tells whoever removes what a kill leaves
        for name in names:
            _wait_for_disk(aside / name, strict=True)
        for name in names:
            os.replace(aside / name, folder / name)
    except FgMujocoError as error:  # of a file aside, which is named by its place
        error.args = (str(error).replace(str(aside), str(folder)), *error.args[1:])
        raise
    finally:
        _remove_folder(aside)
        os.close(descriptor)
    _wait_for_disk(folder)


@contextmanager
def temporary_folder(what: str) -> Iterator[Path]:
    """Yield a folder that is removed in the end; errors that name a file in it name `what` in its place."""
    with tempfile.TemporaryDirectory() as folder:
        try:
            yield Path(folder)
        except FgMujocoError as error:
            said = re.sub(rf"{re.escape(folder)}[^\s:;,]*", f"{what}, in {Path(folder).parent}", str(error))
            error.args = (said, *error.args[1:])
            raise


def sweep(folder: Path) -> None:
    """Remove what killed processes left in a folder."""
    with suppress(OSError):
        for path in [path for path in folder.iterdir() if _ASIDE.fullmatch(path.name)]:
            with suppress(OSError):
                _remove_left(path)


def _remove_left(path: Path) -> None:
    """Remove a file or folder aside, unless the process that writes it lives."""
    descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOFOLLOW", 0))
    try:
        if _lock(descriptor) and _is_at(path, descriptor):
            _remove_folder(path) if path.is_dir() else path.unlink()
    finally:
        os.close(descriptor)


def _remove_folder(aside: Path) -> None:
    """Remove a folder aside, and what was moved out of it, unless all was."""
    with suppress(OSError, ValueError):
        moves: dict[str, int] = json.loads((aside / _MOVES).read_bytes())
        if any((aside / name).exists() for name in moves):
            for moved in (aside.parent / name for name in moves if not (aside / name).exists()):
                if moved.stat().st_ino == moves[moved.name]:
                    moved.unlink()
    shutil.rmtree(aside, ignore_errors=True)


def _create(parent: Path, *, folder: bool) -> tuple[Path, int]:
    """Make a file or folder aside; return its path and the descriptor that holds its lock."""
    while True:
        path = parent / f".fg_mujoco-{secrets.token_hex(8)}.partial"
        if folder:
            path.mkdir()
        try:
            descriptor = os.open(path, os.O_RDONLY if folder else os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o666)
        except FileNotFoundError:
            if not folder:
                raise
            continue  # another process took it for one that was left
        _lock(descriptor, wait=True)
        if _is_at(path, descriptor):
            return path, descriptor
        os.close(descriptor)


def _claim(folder: Path) -> int:
    """Make a folder if it is new; return the descriptor that holds its lock."""
    while True:
        folder.mkdir(parents=True, exist_ok=True)
        try:
            descriptor = os.open(folder, os.O_RDONLY)
        except FileNotFoundError:
            continue  # another process made it, and removed it as it stayed empty
        locked = _lock(descriptor)
        if locked is None or (locked and _is_at(folder, descriptor)):
            return descriptor
        os.close(descriptor)
        if not locked:
            raise BlockingIOError(0, "another process is writing to it", str(folder))


def _lock(descriptor: int, *, wait: bool = False) -> bool | None:
    """Lock what is open; False: another holds the lock; None: there are no locks here, as on some network drives."""
    if fcntl is None:
        return None
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    except BlockingIOError:
        return False
    except OSError:
        return None
    return True


def _is_at(path: Path, descriptor: int) -> bool:
    """Return whether what is open is still at a path."""
    try:
        return os.path.samestat(os.stat(path), os.fstat(descriptor))
    except FileNotFoundError:
        return False


def _wait_for_disk(path: Path, *, strict: bool = False) -> None:
    """Wait until a file, or the names in a folder, are on the disk; some file systems cannot say it of a folder."""
    try:
        descriptor = os.open(path, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
    except OSError:
        if strict:
            raise
