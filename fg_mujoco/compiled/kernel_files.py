"""Keeps compiled kernels in a folder of the user's own, named by `kernel_keys`, and lists the package's sources."""

from __future__ import annotations

import atexit
import contextlib
import hashlib
import os
import pickle
import shutil
import stat
import sys
import tempfile
import threading
import time
import uuid
from collections.abc import Iterator
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

if TYPE_CHECKING:
    from importlib.abc import Traversable

_PACKAGE = "fg_mujoco"
_TEMPORARY = f"{_PACKAGE}-{os.getuid() if hasattr(os, 'getuid') else 'user'}"
_LOCKS = "locks"
_LONG = 3.0  # [s] of compiling from which on a terminal is told at the end how long it took
_ELSEWHERE = ("addons", "controllers", "models", "tracks")  # top-level folders of ours in the repository


@cache
def cache_folder() -> Path:
    """Return the folder of compiled kernels: in $XDG_CACHE_HOME or ~/.cache, else in the user's temporary folder.

    Its files are run, so a folder that another user owns or may write to is not used. Where none is left, it is a new
    one that is removed when this process ends.
    """
    name, otherwise = "kernels", "compiled kernels are not kept there"
    folder = own_folder(name, otherwise) or own_folder(name, otherwise, Path(tempfile.gettempdir(), _TEMPORARY))
    if folder is None:
        folder = Path(tempfile.mkdtemp(prefix="fg_mujoco-"))
        atexit.register(_remove, folder, os.getpid())
    return folder


def _remove(folder: Path, maker: int) -> None:
    """Remove a folder in the process that made it, not in its forks."""
    if os.getpid() == maker:
        shutil.rmtree(folder, ignore_errors=True)


def own_folder(name: str, otherwise: str = "", parent: Path | None = None) -> Path | None:
    """Return a folder, made if it is new, that only this user may write to.

    Args:
      name: of the folder.
      otherwise: what follows where others may write to it, which is said on stderr; nothing: it is not said.
      parent: of the folder, for which the same holds; None: fg_mujoco in $XDG_CACHE_HOME or ~/.cache. One that is not
        absolute is ignored, as the XDG Base Directory Specification asks: it would be in whatever folder is present.

    Returns:
      None where others may, or it cannot be made or written to.
    """
    try:
        if parent is None:
            given = os.environ.get("XDG_CACHE_HOME", "")
            base = given if os.path.isabs(given) else os.path.expanduser("~/.cache")
            if not os.path.isabs(base):  # there is no home, or it is relative
                return None
            parent = Path(base, _PACKAGE)
        folder = parent / name
        parent.parent.mkdir(parents=True, exist_ok=True)
        for path in (parent, folder):
            path.mkdir(mode=0o700, exist_ok=True)
        unsafe = [path for path in (parent, folder) if _open_to_others(path)]
        if not unsafe:
            return folder if os.access(folder, os.W_OK) else None
        if otherwise:
            say(f"other users may write to {unsafe[0]}: {otherwise}")
    except OSError:  # it cannot be made
        pass
    return None


def _open_to_others(folder: Path) -> bool:
    """Return whether a folder is another user's, or group or others may write to it."""
    status = folder.stat()
    return hasattr(os, "geteuid") and (
        status.st_uid != os.geteuid() or bool(status.st_mode & (stat.S_IWGRP | stat.S_IWOTH))
    )


class CompileLine:
    """The line on a terminal that names the kernel that is being compiled; in a pipe nothing is written.

    Only the first process of a family that compiles writes it: those that it starts inherit ANNOUNCED.

    Attributes:
      text: what is being compiled now, for who else writes lines over each other; empty: nothing.
    """

    ANNOUNCED = "FG_MUJOCO_COMPILING"
    """Environment variable: set once a process compiles, to its number; another text keeps all quiet."""

    def __init__(self) -> None:
        self.text = ""
        self._count, self._seconds, self._began, self._depth = 0, 0.0, 0.0, 0
        self._counting = threading.Lock()  # of threads that compile at the same time

    def name(self, kernel: str) -> bool:
        """Show the name of a kernel that is compiled from now on; return whether it is the first of the family."""
        own, owner = str(os.getpid()), os.environ.get(self.ANNOUNCED)
        os.environ.setdefault(self.ANNOUNCED, own)
        if owner not in (None, own):
            return False
        if not self._count:
            atexit.register(self._sum_up)
        if not self.text:
            self._began = time.perf_counter()
        self._count += 1
        taken = self._seconds + time.perf_counter() - self._began
        self.text = f"compiling kernels, which are kept for later: number {self._count}, {kernel}, {taken:.0f} s so far"
        _write(f"\r\x1b[K{self.text}")
        return owner is None

    @contextlib.contextmanager
    def cleared(self) -> Iterator[None]:
        """Take the line away once all is compiled that was begun in here."""
        with self._counting:
            self._depth += 1
        try:
            yield
        finally:
            with self._counting:
                self._depth -= 1
            if self.text and not self._depth:
                self._seconds, self.text = self._seconds + time.perf_counter() - self._began, ""
                _write("\r\x1b[K")

    def _sum_up(self) -> None:
        if self._seconds >= _LONG and _is_terminal():
            say(f"compiled {self._count} kernels in {self._seconds:.0f} s, once: they are kept in {cache_folder()}")


compile_line = CompileLine()
"""Of this process."""


def say(line: str) -> None:
    """Write a line to stderr, if there is one and it is open."""
    if sys.stderr is not None:
        with contextlib.suppress(OSError, ValueError):
            print(f"fg_mujoco: {line}", file=sys.stderr, flush=True)


def _is_terminal() -> bool:
    """Return whether stderr is one."""
    try:
        return sys.stderr is not None and sys.stderr.isatty()
    except ValueError:  # it is closed
        return False


def _write(text: str) -> None:
    """Write to stderr, if it is a terminal."""
    if not _is_terminal():
        return
    with contextlib.suppress(OSError, ValueError):
        sys.stderr.write(text)
        sys.stderr.flush()


def read_kept(file: Path) -> Any:
    """Return what is kept in a file; None where it is not there, or damaged."""
    with contextlib.suppress(Exception):  # whatever is wrong with it, compiling helps
        if not file.is_file():  # as a FIFO or a device, which has no end
            return None
        kept = file.read_bytes()
        digest, payload = kept[:32], kept[32:]
        if hashlib.sha256(payload).digest() == digest:
            return pickle.loads(payload)
    return None


def write_kept(file: Path, payload: bytes) -> None:
    """Keep something pickled in a file, if one can be written there."""
    unfinished = file.with_name(f"{file.name}.{uuid.uuid4().hex}")
    with contextlib.suppress(OSError):
        try:
            unfinished.write_bytes(hashlib.sha256(payload).digest() + payload)
            unfinished.replace(file)
        finally:  # also after Ctrl-C
            unfinished.unlink(missing_ok=True)


@contextlib.contextmanager
def made_once(file: Path, patience: float = 300.0) -> Iterator[None]:
    """Make a file inside this: other processes that want to make the same one wait, and find it there.

    A lock of the system ends with its process, and is of a byte of one file, at a place that is the kernel's. Nobody
    waits where the file is there, where the folder has no locks, or for longer than `patience` [s].
    """
    place, end = int(file.name[-15:], 16), time.monotonic() + patience
    try:
        lock = None if fcntl is None or file.exists() else _lock_file(file.parent)
    except OSError:
        lock = None
    held = False
    while lock is not None and not held and time.monotonic() < end:
        try:
            fcntl.lockf(lock, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, place)
            held = True
        except (BlockingIOError, PermissionError):
            time.sleep(0.02)
        except OSError:  # a file system without locks
            break
    try:
        yield
    finally:
        if lock is not None and held:
            fcntl.lockf(lock, fcntl.LOCK_UN, 1, place)


@cache
def _lock_file(folder: Path) -> int:
    """Return a descriptor of the file that has the locks of a folder, open until the process ends.

    Were it closed, all locks of this process on the file would end.
    """
    return os.open(folder / _LOCKS, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)


def package_files(*suffixes: str) -> Iterator[tuple[str, Traversable]]:
    """Yield the files of this package with these suffixes, and their paths in it ("controllers/gaps.py"), in order.

    The paths are the same in a checkout, where some folders lie beside fg_mujoco/, and where it is installed.
    """
    found = dict(walk(files(_PACKAGE), "", suffixes, skip=_ELSEWHERE))
    for folder in _ELSEWHERE:
        found |= walk(files(f"{_PACKAGE}.{folder}"), f"{folder}/", suffixes)
    yield from sorted(found.items())


def walk(
    folder: Traversable, path: str, suffixes: tuple[str, ...], skip: tuple[str, ...] = ()
) -> Iterator[tuple[str, Traversable]]:
    """Yield the files of a folder with these suffixes, and their paths behind `path`."""
    for entry in folder.iterdir():
        if entry.name.endswith(suffixes):
            yield path + entry.name, entry
        elif "." not in entry.name and entry.name not in ("__pycache__", *skip) and entry.is_dir():
            yield from walk(entry, f"{path}{entry.name}/", suffixes)
