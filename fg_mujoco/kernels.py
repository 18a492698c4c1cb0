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
import gc
import hashlib
import linecache
import os
import pickle
import re
import stat
import sys
import tempfile
import threading
import time
import uuid
from collections.abc import Callable, Iterator
from functools import cache, partial
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, cast
from weakref import WeakSet

import numba
import numpy as np
from llvmlite.binding import parse_bitcode
from llvmlite.ir import Function, FunctionType, IRBuilder, VoidType
from numba.core import event, types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, CompilerBase, CompileResult, DefaultPassBuilder, compile_result
from numba.core.compiler_lock import global_compiler_lock
from numba.core.errors import ForceLiteralArg
from numba.core.registry import CPUDispatcher
from numba.core.serialize import dumps
from numba.core.sigutils import normalize_signature
from numba.extending import intrinsic

if TYPE_CHECKING:
    from importlib.abc import Traversable

_F = TypeVar("_F", bound=Callable[..., Any])

_PACKAGE = "fg_mujoco"
_ELSEWHERE = ("controllers", "models", "tracks")  # packages of ours that are top-level folders in the repository
_ANNOUNCED = "FG_MUJOCO_COMPILING"  # environment variable: set once somebody has said that kernels are being compiled
_COMPILERS = (numba.__version__, np.__version__, sys.implementation.cache_tag)
_OPTIONS = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}
_LOADING = f"{_PACKAGE}:kernel"  # event of numba's kind: a kernel is compiled, or loaded from disk
_COMPILING = (_LOADING, "numba:compile")
_functions: WeakSet[Callable[..., Any]] = WeakSet()  # of which kernels are made


def kernel(function: _F) -> _F:
    """Compile a function of numbers and arrays, at its first call; division by zero gives inf or NaN, as in numpy."""
    if numba.config.DISABLE_JIT:
        return function
    return cast(_F, _Kernel(function, None, {"nopython": True, "boundscheck": None, **_OPTIONS}))


def inlined(function: _F) -> _F:
    """Write a function out wherever kernels call it, for what is called in their inner loops."""
    return cast(_F, numba.njit(inline="always", **_OPTIONS)(function))


def c_function(function: Any, *arguments: Any) -> Any:
    """Return what gives kernels the address of a function in C that calls a kernel, for libraries that call back.

    Args:
      function: the kernel, which returns nothing.
      arguments: numba's types of its arguments: integers, of the size that the library passes.
    """

    def address(typing: Any) -> Any:
        kind = typing.resolve_value_type(function)
        kind.get_call_type(typing, arguments, {})

        def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
            compiled = kind.dispatcher.overloads[arguments]
            context.active_code_library.add_linking_library(compiled.library)
            values = [context.get_value_type(argument) for argument in arguments]
            name = f"{compiled.fndesc.mangled_name}.in_c"
            made = Function(builder.module, FunctionType(VoidType(), values), name)
            made.linkage = "internal"
            inside = IRBuilder(made.append_basic_block())
            called = context.declare_function(builder.module, compiled.fndesc)
            context.call_conv.call_function(inside, called, types.none, arguments, list(made.args))
            inside.ret_void()
            return builder.ptrtoint(made, context.get_value_type(types.int64))

        return types.int64(), generate

    return intrinsic(address)


class _Kernel(CPUDispatcher):  # type: ignore[misc]
    """A kernel as Python calls it, and functions of others that numba compiles. Kernels call its `_Part`."""

    def __init__(self, function: Any, variables: Any = None, options: Any = None, pipeline: Any = Compiler) -> None:
        super().__init__(function, variables, options, pipeline)
        self._cache = _KernelCache(function)
        self._part: _Part | None = None
        _functions.add(function)

    @property
    def _numba_type_(self) -> Any:
        with global_compiler_lock:
            compiling = [frame.func_id.func for frame in self.typingctx.callstack._stack]
            by_another = not compiling or compiling[-1] not in _functions
            if by_another or (self._compiling_counter and self.py_func in compiling):  # the second: it calls itself
                return self._type
            if self._part is None:
                self._part = _Part(self.py_func, None, dict(self.targetoptions))
                self._part.kernel = self
            return self._part._type

    def compile(self, signature: Any) -> Any:
        """Compile for a signature, or load from disk, and return what Python is to call."""
        with event.trigger_event(_LOADING):  # until all that was made for it is collected, which may take a second
            return self._made(signature)

    def _made(self, signature: Any) -> Any:
        collecting = gc.isenabled()
        gc.disable()  # most of what is made here stays: to look through it again and again would take a second
        try:
            return _with_room(partial(super().compile, signature))
        finally:
            if collecting:
                gc.enable()
                gc.collect(0)  # now, and not while the kernel runs

    def add_overload(self, compiled: Any) -> None:
        """Let Python call what was compiled or loaded for a signature."""
        environments = compiled.referenced_envs or tuple(compiled._find_referenced_environments())
        for environment in environments:  # its parts' own: `raise` and `print` take their values from there
            compiled.codegen.set_env(environment.env_name, environment)
        super().add_overload(compiled._replace(referenced_envs=environments))


class CompileTime(event.Listener):  # type: ignore[misc]
    """Measures for how long this thread compiles kernels, or anything else by numba, or loads kernels from disk.

        with CompileTime() as compile_time:
            ...
        compile_time.seconds

    Attributes:
      running: whether it does so now.
    """

    def __init__(self) -> None:
        self.running = False
        self._depth, self._done, self._began = 0, 0.0, 0.0
        self._thread = threading.get_ident()

    def __enter__(self) -> CompileTime:
        for kind in _COMPILING:
            event.register(kind, self)
        return self

    def __exit__(self, *exception: object) -> None:
        for kind in _COMPILING:
            event.unregister(kind, self)

    @property
    def seconds(self) -> float:
        """Time taken up to now [s]."""
        return self._done + (time.perf_counter() - self._began if self.running else 0.0)

    def on_start(self, _: Any) -> None:
        """Note that something begins to be compiled; kernels compile each other."""
        if threading.get_ident() == self._thread:
            if self._depth == 0:
                self._began, self.running = time.perf_counter(), True
            self._depth += 1

    def on_end(self, _: Any) -> None:
        """Note that it is compiled, or that compiling it failed."""
        if threading.get_ident() == self._thread:
            self._depth -= 1
            if self._depth == 0:
                self._done, self.running = self.seconds, False


def _with_room(function: Callable[[], Any]) -> Any:
    """Call a function, with room for the frames of all that it calls: see below."""
    return function()


# CPython keeps frames in chunks of 16 KiB, which it takes from the system and gives back again at each call that is the
# first in one. Compiling calls so much so deep that this alone costs two seconds. A frame that is made out to be large
# gets a chunk of 1 MiB, and shares it with the frames above it.
_with_room.__code__ = _with_room.__code__.replace(co_stacksize=70_000)


@contextlib.contextmanager
def _blas_unseen() -> Iterator[None]:
    """Let numba load its parts without SciPy, which it imports only to see that it is there.

    That takes as long as all the rest. Functions of linear algebra still look for it when they are compiled.
    """
    import numba.np.linalg as linalg

    seen, linalg.ensure_blas = linalg.ensure_blas, lambda: None
    try:
        yield
    finally:
        linalg.ensure_blas = seen


def _calls_in_turn(library: Any) -> bool:
    """Say whether functions in there call each other in turn: that is done by addresses."""
    prefix = library.codegen._rtlinker.PREFIX
    return any(variable.name.startswith(prefix) for variable in library._final_module.global_variables)


class _Part(CPUDispatcher):  # type: ignore[misc]
    """A kernel as other kernels call it: linked into each of them.

    Nothing is optimised here, no machine code is made, nor what Python would need to call it, which together take as
    long as all else.
    """

    def __init__(self, function: Any, variables: Any = None, options: Any = None, pipeline: Any = None) -> None:
        super().__init__(function, variables, options, pipeline or _PartCompiler)
        self._cache = _PartCache(function)
        self.kernel: _Kernel | None = None

    def add_overload(self, compiled: Any) -> None:
        """Let other kernels find what was compiled for a signature."""
        args = tuple(compiled.signature.args)
        if self.kernel is not None and _calls_in_turn(compiled.library):  # which takes machine code of its own
            self.kernel.compile(args)
            compiled = self.kernel.overloads[args]
        else:
            compiled = compiled._replace(entry_point=object())  # a name for it: there is no entry point
            self.targetctx.insert_user_function(compiled.entry_point, compiled.fndesc, [compiled.library])
        self.overloads[args] = compiled

    def compile(self, signature: Any) -> None:
        """Compile for a signature, as numba's dispatchers do, but without timers of every call of LLVM."""
        args, return_type = normalize_signature(signature)
        with global_compiler_lock, self._compiling_counter:
            if tuple(args) in self.overloads:
                return
            compiled = self._cache.load_overload(signature, self.targetctx)
            if compiled is not None:
                self.add_overload(compiled)
                return
            details = {"dispatcher": self, "args": args, "return_type": return_type}
            with event.trigger_event("numba:compile", details):
                try:
                    compiled = self._compiler.compile(args, return_type)
                except ForceLiteralArg as error:  # it says which arguments have to be constants
                    fold = self._compiler.fold_argument_types
                    raise error.bind_fold_arguments(lambda *given: fold(*given)[1]) from None
                self.add_overload(compiled)
            self._cache.save_overload(signature, compiled)


class _PartCompiler(CompilerBase):  # type: ignore[misc]
    """Numba's passes for one kernel, up to LLVM's code that can be linked into another."""

    def define_pipelines(self) -> list[Any]:
        """Return the passes."""
        state = self.state
        state.library = _PartLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.flags.no_compile = state.flags.no_cpython_wrapper = True
        return [DefaultPassBuilder.define_nopython_pipeline(state)]


class _PartLibrary(JITCodeLibrary):  # type: ignore[misc]
    """LLVM's code of one kernel, for linking alone."""

    def _optimize_functions(self, module: Any) -> None:
        module.data_layout = self._codegen._data_layout
        for function in module.functions:
            if not function.is_declaration:  # most are, and numba takes its time for each
                passes, builder = self._codegen._function_pass_manager()
                passes.run(function, builder)

    def _optimize_final_module(self) -> None:
        """Leave it to the kernel that Python calls, in which all its parts are optimised together."""

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True


@cache
def cache_folder() -> Path:
    """Return the folder of compiled kernels: in $XDG_CACHE_HOME or ~/.cache, else a new temporary one.

    Its files are run, so a folder that another user owns or may write to is not used.
    """
    return own_folder("kernels", "compiled kernels are not kept there") or Path(tempfile.mkdtemp(prefix="fg_mujoco-"))


def own_folder(name: str, otherwise: str) -> Path | None:
    """Return a folder in $XDG_CACHE_HOME or ~/.cache, made if it is new, that only this user may write to.

    Args:
      name: of the folder, in that of this package.
      otherwise: what follows where others may write to it, which is said on stderr.

    Returns:
      None where others may, or it cannot be made.
    """
    try:
        parent = Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser() / _PACKAGE
        folder = parent / name
        parent.parent.mkdir(parents=True, exist_ok=True)
        for path in (parent, folder):
            path.mkdir(mode=0o700, exist_ok=True)
        unsafe = [path for path in (parent, folder) if _open_to_others(path)]
        if not unsafe:
            return folder
        _say(f"other users may write to {unsafe[0]}: {otherwise}")
    except (OSError, RuntimeError):  # it cannot be made, or there is no home
        pass
    return None


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
        with contextlib.suppress(Exception):  # whatever is wrong with it, compiling helps
            kept = self._file(signature, target.codegen()).read_bytes()
            digest, payload = kept[:32], kept[32:]
            if hashlib.sha256(payload).digest() == digest:
                with _blas_unseen():
                    target.refresh()
                return self._unpack(target, pickle.loads(payload))
        return None

    def save_overload(self, signature: Any, compiled: Any) -> None:
        """Keep what was compiled, unless it holds addresses of this process, or cannot be written."""
        of_this_process = compiled.lifted or compiled.library.has_dynamic_globals or _calls_in_turn(compiled.library)
        if of_this_process or any(isinstance(argument, types.Dispatcher) for argument in compiled.signature.args):
            return
        with contextlib.suppress(OSError, pickle.PicklingError, TypeError):
            file = self._file(signature, compiled.library.codegen)
            payload = dumps(self._pack(compiled))
            unfinished = file.with_name(f"{file.name}.{uuid.uuid4().hex}")
            try:
                unfinished.write_bytes(hashlib.sha256(payload).digest() + payload)
                unfinished.replace(file)
            except OSError:
                unfinished.unlink(missing_ok=True)

    def _pack(self, compiled: Any) -> Any:
        return compiled._reduce()

    def _unpack(self, target: Any, packed: Any) -> Any:
        return CompileResult._rebuild(target, *packed)

    def _file(self, signature: Any, codegen: Any) -> Path:
        """Return the file of a signature.

        Raises:
          OSError: the function has no source.
        """
        key = type(self).__name__, _COMPILERS, codegen.magic_tuple(), _identity(self._function), str(signature)
        digest = hashlib.sha256(repr(key).encode()).hexdigest()
        return cache_folder() / f"{self._function.__qualname__.rpartition('.')[2]}-{digest[:32]}"

    def enable(self) -> None:
        """Nothing to do: it always is."""

    def disable(self) -> None:
        """Nothing to do: it never is."""

    def flush(self) -> None:
        """Nothing to do: files of old sources are not read."""


class _PartCache(_KernelCache):
    """The files of one kernel as other kernels call it."""

    def _pack(self, compiled: Any) -> Any:
        bitcode = compiled.library._get_module_for_linking().as_bitcode()
        compiled.fndesc.typemap = compiled.fndesc.calltypes = None
        environments = tuple(compiled._find_referenced_environments())
        return compiled.library.name, bitcode, compiled.fndesc, compiled.environment, compiled.signature, environments

    def _unpack(self, target: Any, packed: Any) -> Any:
        name, bitcode, fndesc, environment, signature, environments = packed
        library = _PartLibrary(target.codegen(), name)
        library._final_module = parse_bitcode(bitcode)
        library._finalized = True
        return compile_result(
            target_context=target, typing_context=target.typing_context, library=library, fndesc=fndesc,
            environment=environment, signature=signature, referenced_envs=environments, objectmode=False, lifted=(),
            reload_init=(),
        )  # fmt: skip


def _identity(function: Callable[..., Any]) -> tuple[str, ...]:
    """Return what tells a function from all others: its sources, its place in there, and what it is a closure over."""
    code = function.__code__
    values = [cell.cell_contents for cell in function.__closure__ or ()]
    closure = [repr(_identity(value.py_func)) if hasattr(value, "py_func") else dumps(value).hex() for value in values]
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


class _Announcer(event.Listener):  # type: ignore[misc]
    """Says on stderr that kernels are being compiled: once, in the first of a family of processes that does so."""

    def on_start(self, event: Any) -> None:
        if _ANNOUNCED not in os.environ and isinstance(event.data["dispatcher"], (_Kernel, _Part)):
            os.environ[_ANNOUNCED] = "announced"  # processes that this one starts say nothing
            _say("compiling kernels, once; this takes about 10 s")

    def on_end(self, event: Any) -> None:
        """Nothing to say."""


event.register("numba:compile", _Announcer())
