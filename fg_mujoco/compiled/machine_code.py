"""Machine code of kernels from disk, called without numba: importing numba takes longer than a race of one lap.

    code = MachineCode.of(compiled)  # when a kernel has been compiled
    call, address = code.load(function)  # in another process

The other process has the same Python, numpy, numba, llvmlite and processor.

The code is numba's own, to the last bit, and so is what hands arrays over from Python: LLVM links both, and three
extension modules of numba, which are loaded by themselves, give it what it calls. `kinds` tells arguments of one type
from those of another, as numba does.
"""

from __future__ import annotations

import builtins
import ctypes
import importlib.util
import os
import pickle
import sys
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.machinery import EXTENSION_SUFFIXES, ExtensionFileLoader
from operator import attrgetter
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

OPTIONS = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}
"""Of numba, for all kernels."""

INLINED = {"inline": "always", **OPTIONS}
"""Of numba, for functions that are written out where kernels call them."""

LOADING = "fg_mujoco:kernel"
"""Event of numba's kind: a kernel is compiled, or loaded from disk, by numba."""

Kind = tuple[Any, ...]
"""What tells the type of an argument: equal only where numba's type is."""

_OWN_DATA = 4  # flag of an array that does not matter to numba's type of it
_IN_ROWS, _IN_COLUMNS = 1, 2  # flags of contiguous arrays; of both, as an array of one row has, numba sees the first
_LARGEST = 2**63  # an integer that is larger has another type
_of_numpy: Callable[[Any], Kind] = attrgetter("__class__", "dtype", "ndim", "flags.num")
_ARRAY = np.ndarray
_PLAIN: dict[type, Kind] = {each: (each,) for each in (bool, float, complex, type(None))}


def kinds(arguments: Sequence[Any]) -> list[Kind] | None:
    """Return the kinds of arguments; None where there is one that only numba knows the type of."""
    found = each_kind(arguments)
    return None if None in found else found  # type: ignore[return-value]


def each_kind(arguments: Sequence[Any]) -> list[Kind | None]:
    """Return the kind of each argument; None of one that only numba knows the type of."""
    return [
        _of_numpy(argument) if argument.__class__ is _ARRAY else _PLAIN.get(argument.__class__) or kind_of(argument)
        for argument in arguments
    ]


def kind_of(value: Any) -> Kind | None:
    """Return the kind of an argument; None: only numba knows its type."""
    of = type(value)
    if of is int:
        return (int,) if -_LARGEST <= value < _LARGEST else None
    if of in _PLAIN:
        return _PLAIN[of]
    if isinstance(value, tuple) and (of is tuple or hasattr(of, "_fields")):
        parts = [kind_of(part) for part in value]
        return None if None in parts else (of, *parts)
    return _of_numpy(value) if isinstance(value, (np.ndarray, np.generic)) else None


def omitted(value: Any) -> Kind | None:
    """Return the kind of an argument that is not given, whose default is a number."""
    return ("omitted", repr(value)) if isinstance(value, (bool, int, float, type(None))) else None


def text_of(found: Sequence[Kind] | None) -> str | None:
    """Return kinds as a text, the same in every process; None where one cannot be told so."""
    if found is None:
        return None
    texts = [_text(kind) for kind in found]
    return None if None in texts else ", ".join(map(str, texts))


def _text(kind: Kind) -> str | None:
    of = kind[0]
    if of == "omitted":
        return f"omitted {kind[1]}"
    name = f"{of.__module__}.{of.__qualname__}"
    if issubclass(of, tuple):
        texts = [_text(part) for part in kind[1:]]
        return None if None in texts else f"{name}{getattr(of, '_fields', '')}({', '.join(map(str, texts))})"
    if issubclass(of, np.generic) or of is np.ndarray:
        dtype, ndim, flags = kind[1:]
        ignored = _OWN_DATA | (_IN_COLUMNS if flags & _IN_ROWS else 0)
        return f"{name} {_dtype_text(dtype)} {ndim} {flags & ~ignored}"
    return None if issubclass(of, np.ndarray) else name


@cache
def _dtype_text(dtype: np.dtype[Any]) -> str:
    return repr(dtype)


@cache
def machine() -> tuple[object, ...]:
    """Return what machine code depends on besides its sources: versions, processor, and settings of numba's."""
    import llvmlite.binding as llvm

    settings = sorted((name, value) for name, value in os.environ.items() if name.startswith("NUMBA_"))
    return (
        (_numba_folder() / "_version.py").read_text(), np.__version__, sys.implementation.cache_tag, sys.version,
        llvm.llvm_version_info, llvm.get_process_triple(), llvm.get_host_cpu_name(),
        llvm.get_host_cpu_features().flatten(), settings,
    )  # fmt: skip


@dataclass(frozen=True)
class MachineCode:
    """A compiled kernel, as it is kept on disk.

    Attributes:
      object_code: machine code, in the format that the system links.
      entry: name in there of what Python calls.
      native: name in there of what other machine code calls.
      symbols: names of what the code needs from elsewhere.
      math: names of functions of mathematics that numba takes from C, and the code may need without saying so.
      own: environment of the kernel: name, module, constants.
      environments: of all that the kernel calls.
    """

    object_code: bytes
    entry: str
    native: str
    symbols: tuple[str, ...]
    math: tuple[str, ...]
    own: tuple[str, str, list[Any]]
    environments: tuple[tuple[str, str, list[Any]], ...]

    @classmethod
    def of(cls, compiled: Any) -> MachineCode:
        """Return the machine code of numba's compile result, just compiled."""
        from numba.core.intrinsics import INTR_MATH

        module, own = compiled.library._final_module, compiled.environment
        defined = (*module.functions, *module.global_variables)
        names = {each.name for each in defined if each.is_declaration and not each.name.startswith("llvm.")}
        environments = {own.env_name: own} | {each.env_name: each for each in compiled._find_referenced_environments()}
        return cls(
            object_code=compiled.library._get_compiled_object(),
            entry=compiled.fndesc.llvm_cpython_wrapper_name,
            native=compiled.fndesc.llvm_func_name,
            symbols=tuple(sorted(names)),
            math=tuple(INTR_MATH),
            own=_values(own),
            environments=tuple(_values(each) for name, each in environments.items() if name != own.env_name),
        )

    def load(self, function: Callable[..., Any]) -> tuple[Callable[..., Any], int]:
        """Return what Python is to call, with arguments of the kinds that the code is for, and the address of the code.

        The code is there as long as what Python calls is.

        Raises:
          LookupError: something that the code needs is not in this process.
        """
        import llvmlite.binding as llvm

        with _lock:
            numba = _runtime()
            for name in self.math:
                llvm.add_symbol(name, numba.helpers[name])
            for name in self.symbols:
                if not _is_there(name):
                    raise LookupError(name)
            engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), _target().create_target_machine())
            engine.add_object_file(llvm.ObjectFileRef.from_data(self.object_code))
            engine.finalize_object()
            entry, native = engine.get_function_address(self.entry), engine.get_function_address(self.native)
            if entry == 0:
                raise LookupError(self.entry)
            made = []
            for name, module, constants in (self.own, *self.environments):
                environment = numba.environment(vars(sys.modules.get(module, builtins)))
                environment.consts[:] = constants
                made.append(environment)
                address = engine.get_global_value_address(name)
                if address != 0:  # code that is never run may have been left out
                    ctypes.c_void_p.from_address(address).value = id(environment)
            doc = f"compiled {function.__qualname__!r}"
            home = sys.modules.get(function.__module__, builtins)
            call: Callable[..., Any] = numba.make_function(
                home, function.__name__, doc, entry, made[0], (engine, *made)
            )
            return call, native


def _values(environment: Any) -> tuple[str, str, list[Any]]:
    return environment.env_name, str(environment.globals.get("__name__")), list(environment.consts)


_lock = threading.RLock()


@dataclass(frozen=True)
class _Runtime:
    """What numba's extension modules hold that code needs."""

    helpers: dict[str, int]
    environment: Any
    make_function: Any


def _numba_folder() -> Path:
    """Return where numba is installed, without importing it."""
    found = importlib.util.find_spec("numba")
    if found is None or not found.submodule_search_locations:
        raise LookupError("numba")
    return Path(found.submodule_search_locations[0])


def _extension(name: str) -> ModuleType:
    """Return an extension module of numba's, loaded without the package."""
    if name in sys.modules:
        return sys.modules[name]
    *folders, last = name.split(".")[1:]
    folder = _numba_folder().joinpath(*folders)
    for suffix in EXTENSION_SUFFIXES:
        path = folder / f"{last}{suffix}"
        if path.is_file():
            loader = ExtensionFileLoader(name, str(path))
            spec = importlib.util.spec_from_file_location(name, path, loader=loader)
            assert spec is not None
            module = importlib.util.module_from_spec(spec)
            loader.exec_module(module)
            return module
    raise LookupError(name)


@cache
def _runtime() -> _Runtime:
    """Give LLVM the names that numba gives it, and return what is needed besides."""
    import llvmlite.binding as llvm

    helpers, functions = _extension("numba._helperlib"), _extension("numba._dynfunc")
    memory = _extension("numba.core.runtime._nrt_python")
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    for name, address in (helpers.c_helpers | functions.c_helpers).items():
        llvm.add_symbol(f"numba_{name}", address)
    for name, address in memory.c_helpers.items():
        llvm.add_symbol(name if name.startswith("_") else f"NRT_{name}", address)
    llvm.add_symbol("numba_unpickle", ctypes.cast(_unpickle, ctypes.c_void_p).value)  # numba's own imports numba
    llvm.add_symbol("_Py_NoneStruct", id(None))
    for name, value in vars(builtins).items():
        if isinstance(value, type) and issubclass(value, BaseException):
            llvm.add_symbol(f"PyExc_{name}", id(value))
    return _Runtime(helpers.c_helpers, functions.Environment, functions.make_function)


@ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.c_void_p, ctypes.c_int, ctypes.c_void_p)  # type: ignore[untyped-decorator]
def _unpickle(address: int, length: int, digest: int) -> Any:
    """Return an object that code holds pickled: the same one each time."""
    key = address, ctypes.string_at(digest, _DIGEST)
    if key not in _unpickled:
        _unpickled[key] = pickle.loads(ctypes.string_at(address, length))
    return _unpickled[key]


_DIGEST = 20  # bytes of SHA-1
_unpickled: dict[tuple[int, bytes], Any] = {}


@cache
def _target() -> Any:
    import llvmlite.binding as llvm

    return llvm.Target.from_triple(llvm.get_process_triple())


@cache
def _is_there(name: str) -> bool:
    """Return whether a name can be linked: LLVM ends the process where one cannot."""
    import llvmlite.binding as llvm

    return bool(llvm.address_of_symbol(name)) or hasattr(ctypes.pythonapi, name)
