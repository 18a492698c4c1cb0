"""Compiled functions: loops over beams, tires and worlds, written in Python and compiled by numba.

    @kernel
    def nearest(ranges): ...

A kernel runs without the GIL and never reorders arithmetic (no fastmath), so that it gives the same bits for one world
and for a thousand, in any thread. What numba compiles is kept on disk, in a folder whose name holds a hash of
the sources of all kernels: numba by itself would not notice that a kernel called from another file has changed.
"""

from __future__ import annotations

import hashlib
import os
import sys
import tempfile
from collections.abc import Callable
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from numba.core import event

_F = TypeVar("_F", bound=Callable[..., Any])
_FOLDERS = ("fg_mujoco", "fg_mujoco.controllers")


def kernel(function: _F) -> _F:
    """Compile a function of numbers and arrays, at its first call; division by zero gives inf or NaN, as in numpy."""
    config: Any = numba.config
    before = config.CACHE_DIR
    config.CACHE_DIR = str(cache_folder())  # read while decorating; other users of numba keep their own
    try:
        compiled = numba.njit(cache=True, nogil=True, error_model="numpy")(function)
    finally:
        config.CACHE_DIR = before
    _Announcer.ours.add(compiled)
    return cast(_F, compiled)


@lru_cache(maxsize=1)
def cache_folder() -> Path:
    """Return the folder that keeps compiled kernels: in $XDG_CACHE_HOME or ~/.cache, else a new temporary one."""
    digest = hashlib.sha256()
    for package in _FOLDERS:
        folder = Path(str(files(package)))
        for source in sorted(folder.rglob("*.py")):
            text = source.read_bytes()
            if b"@kernel" in text:
                digest.update(source.relative_to(folder).as_posix().encode() + text)
    name = f"kernels-{digest.hexdigest()[:16]}"
    try:
        folder = Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser() / "fg_mujoco" / name
        folder.mkdir(parents=True, exist_ok=True)
        if os.access(folder, os.W_OK):
            return folder
    except (OSError, RuntimeError):  # it cannot be made, or there is no home
        pass
    # a new one: what lies in a folder that others may write to is not to be run
    return Path(tempfile.mkdtemp(prefix="fg_mujoco-"))


class _Announcer(event.Listener):
    """Says once, on a terminal, that kernels are being compiled, and when that is done."""

    ours: set[Any] = set()  # noqa: RUF012

    def __init__(self) -> None:
        self._said = False

    def on_start(self, event: Any) -> None:
        if not self._said and event.data.get("dispatcher") in self.ours and sys.stderr.isatty():
            self._said = True
            print("fg_mujoco: compiling, once; this takes some seconds", file=sys.stderr, flush=True)

    def on_end(self, event: Any) -> None:
        """Nothing to say."""


event.register("numba:compile", _Announcer())  # type: ignore[no-untyped-call]
