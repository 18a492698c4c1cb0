"""Compiled functions: loops over beams, tires and worlds, written in Python and compiled by numba.

    @kernel
    def nearest(ranges): ...

A kernel runs without the GIL and never reorders arithmetic (no fastmath), so that it gives the same bits for one world
and for a thousand, in any thread. Compiled kernels are kept on disk, a file for each kernel and signature. The name of
a file holds a hash of the sources that the kernel depends on: its own module, and every module of this package that
this one imports, directly or not. An edit of a planner compiles that planner anew, and not the ray caster.
"""

from __future__ import annotations

import contextlib
import hashlib
import linecache
import os
import pickle
import re
import stat
import sys
import tempfile
import uuid
from collections.abc import Callable, Iterator
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numba
import numpy as np
from numba.core import event
from numba.core.compiler import CompileResult
from numba.core.serialize import dumps as _untyped_dumps

if TYPE_CHECKING:
    from importlib.abc import Traversable

_F = TypeVar("_F", bound=Callable[..., Any])

_PACKAGE = "fg_mujoco"
_ELSEWHERE = ("controllers", "models", "tracks")  # packages of ours that are top-level folders in the repository
_ANNOUNCED = "FG_MUJOCO_COMPILING"  # environment variable: set once somebody has said that kernels are being compiled
_dumps: Callable[[Any], bytes] = _untyped_dumps  # as pickle.dumps, of what numba has in it
_rebuild: Callable[..., Any] = CompileResult._rebuild
_COMPILERS = (numba.__version__, np.__version__, sys.implementation.cache_tag)


def kernel(function: _F) -> _F:
    """Compile a function of numbers and arrays, at its first call; division by zero gives inf or NaN, as in numpy."""
    compiled: Any = numba.njit(nogil=True, error_model="numpy")(function)
    if hasattr(compiled, "_cache"):  # with NUMBA_DISABLE_JIT it is the function
        compiled._cache = _KernelCache(function)
    return cast(_F, compiled)


@cache
def cache_folder() -> Path:
    """Return the folder of compiled kernels: in $XDG_CACHE_HOME or ~/.cache, else a new temporary one.

    Its files are run, so a folder that another user owns or may write to is not used.
    """
    try:
        parent = Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser() / _PACKAGE
        folder = parent / "kernels"
        parent.parent.mkdir(parents=True, exist_ok=True)
        for path in (parent, folder):
            path.mkdir(mode=0o700, exist_ok=True)
        unsafe = [path for path in (parent, folder) if _open_to_others(path)]
        if not unsafe:
            return folder
        _say(f"other users may write to {unsafe[0]}: compiled kernels are not kept there")
    except (OSError, RuntimeError):  # it cannot be made, or there is no home
        pass
    return Path(tempfile.mkdtemp(prefix="fg_mujoco-"))


def _open_to_others(folder: Path) -> bool:
    """Say whether a folder is another user's, or group or others may write to it."""
    status = folder.stat()
    return hasattr(os, "geteuid") and (
        status.st_uid != os.geteuid() or bool(status.st_mode & (stat.S_IWGRP | stat.S_IWOTH))
    )


def _say(line: str) -> None:
    """Write a line to stderr, if there is one and it is open."""
    if sys.stderr is not None:
        with contextlib.suppress(OSError, ValueError):
            print(f"fg_mujoco: {line}", file=sys.stderr, flush=True)


class _KernelCache:
    """The files of one kernel, in the place of numba's own cache (numba.core.caching._Cache).

    A file that is missing, damaged or unreadable is compiled anew, and where none can be written, none is.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function

    @property
    def cache_path(self) -> str:
        """The folder, for numba's statistics."""
        return str(cache_folder())

    def load_overload(self, signature: Any, target: Any) -> Any:
        """Return what was compiled for a signature; None where it is not there, or damaged."""
        target.refresh()
        try:
            kept = self._file(signature, target.codegen()).read_bytes()
            digest, payload = kept[:32], kept[32:]
            if hashlib.sha256(payload).digest() == digest:
                return _rebuild(target, *pickle.loads(payload))
        except Exception:  # whatever is wrong with it, compiling helps
            pass
        return None

    def save_overload(self, signature: Any, compiled: Any) -> None:
        """Keep what was compiled, unless it holds addresses of this process, or cannot be written."""
        if compiled.lifted or compiled.library.has_dynamic_globals:
            return
        with contextlib.suppress(OSError, pickle.PicklingError, TypeError):
            file = self._file(signature, compiled.library.codegen)
            payload = _dumps(compiled._reduce())
            unfinished = file.with_name(f"{file.name}.{uuid.uuid4().hex}")
            try:
                unfinished.write_bytes(hashlib.sha256(payload).digest() + payload)
                unfinished.replace(file)
            except OSError:
                unfinished.unlink(missing_ok=True)

    def _file(self, signature: Any, codegen: Any) -> Path:
        """Return the file of a signature.

        Raises:
          OSError: the function has no source.
        """
        key = _COMPILERS, codegen.magic_tuple(), _identity(self._function), str(signature)
        digest = hashlib.sha256(repr(key).encode()).hexdigest()
        return cache_folder() / f"{self._function.__qualname__.rpartition('.')[2]}-{digest[:32]}"

    def enable(self) -> None:
        """Nothing to do: it always is."""

    def disable(self) -> None:
        """Nothing to do: it never is."""

    def flush(self) -> None:
        """Nothing to do: files of old sources are not read."""


def _identity(function: Callable[..., Any]) -> tuple[str, ...]:
    """Return what tells a function from all others: its sources, its place in there, and what it is a closure over."""
    code = function.__code__
    values = [cell.cell_contents for cell in function.__closure__ or ()]
    closure = [repr(_identity(value.py_func)) if hasattr(value, "py_func") else _dumps(value).hex() for value in values]
    return source_digest(function), str(code.co_firstlineno), code.co_code.hex(), *closure


def source_digest(function: Callable[..., Any]) -> str:
    """Return a hash of all sources that a function depends on: its file, and what of this package that imports.

    Raises:
      OSError: the function has no source.
    """
    if function.__module__ in _modules():
        return _digest_of(function.__module__)
    # A user's file: its own text, and what it imports of ours. Its imports from elsewhere are not looked at.
    text = "".join(linecache.getlines(function.__code__.co_filename)).encode()
    if not text:
        raise OSError(f"{function.__qualname__} has no source")
    imported = sorted(_imports_in(text, ""))
    return hashlib.sha256(text + "".join(_digest_of(module) for module in imported).encode()).hexdigest()


def package_files(*suffixes: str) -> Iterator[tuple[str, Traversable]]:
    """Yield the files of this package with these suffixes, and their paths in it ("controllers/gaps.py"), in order.

    The paths are the same in a checkout, where some folders lie beside fg_mujoco/, and where it is installed.
    """
    found = dict(_walk(files(_PACKAGE), "", suffixes, skip=_ELSEWHERE))
    for folder in _ELSEWHERE:
        found |= _walk(files(f"{_PACKAGE}.{folder}"), f"{folder}/", suffixes)
    yield from sorted(found.items())


def _walk(
    folder: Traversable, path: str, suffixes: tuple[str, ...], skip: tuple[str, ...] = ()
) -> Iterator[tuple[str, Traversable]]:
    for entry in folder.iterdir():
        if entry.name.endswith(suffixes):
            yield path + entry.name, entry
        elif "." not in entry.name and entry.name not in ("__pycache__", *skip) and entry.is_dir():
            yield from _walk(entry, f"{path}{entry.name}/", suffixes)


@cache
def _modules() -> dict[str, tuple[str, Traversable]]:
    """Return the package of each module of ours, by the module's name, and its file."""
    modules = {}
    for path, file in package_files(".py"):
        name = f"{_PACKAGE}/{path}"[: -len(".py")].replace("/", ".")
        package = name.rpartition(".")[0]
        modules[package if name.endswith(".__init__") else name] = package, file
    return modules


@cache
def _digest_of(module: str) -> str:
    """Return a hash of the sources of a module of ours and of all modules of ours that it imports, directly or not."""
    found, waiting = {module}, [module]
    while waiting:
        new = _read(waiting.pop())[1] - found
        found |= new
        waiting += new
    digest = hashlib.sha256()
    for name in sorted(found):
        digest.update(f"{name} {_read(name)[0]}\n".encode())
    return digest.hexdigest()


@cache
def _read(module: str) -> tuple[str, frozenset[str]]:
    """Return the hash of a module's own source, and which modules of ours it imports."""
    package, file = _modules()[module]
    text = file.read_bytes()
    return hashlib.sha256(text).hexdigest(), frozenset(_imports_in(text, package))


_IMPORT = re.compile(r"^[ \t]*(?:from[ \t]+([.\w]+)[ \t]+import[ \t]+(\([^)]*\)|.*)|import[ \t]+(.*))", re.MULTILINE)


def _imports_in(text: bytes, package: str) -> set[str]:
    """Return the modules of ours that a text imports anywhere: found as text, which is quick, rather too many than few.

    `from package import name` depends on the module of that name, or else on the package's __init__.py.
    """
    modules, found = _modules(), set()
    for source, names, plain in _IMPORT.findall(text.decode(errors="replace")):
        if plain:
            found |= set(re.findall(r"[.\w]+", plain)) & modules.keys()
            continue
        above = len(source) - len(source.lstrip("."))
        parts = package.split(".")[: package.count(".") + 2 - above] if above else []
        start = ".".join([*parts, source[above:]]).strip(".")
        for name in re.findall(r"\w+", names):
            found |= {f"{start}.{name}" if f"{start}.{name}" in modules else start} & modules.keys()
    return found


class _Announcer(event.Listener):
    """Says on stderr that kernels are being compiled: once, in the first of a family of processes that does so."""

    def on_start(self, event: Any) -> None:
        if _ANNOUNCED not in os.environ and isinstance(getattr(event.data["dispatcher"], "_cache", None), _KernelCache):
            os.environ[_ANNOUNCED] = "announced"  # processes that this one starts say nothing
            _say("compiling kernels, once; this takes up to 15 s")

    def on_end(self, event: Any) -> None:
        """Nothing to say."""


event.register("numba:compile", _Announcer())  # type: ignore[no-untyped-call]
