"""Names the files of compiled kernels: by a hash of all that the machine code depends on.

That is the code of the kernel and of all functions that it calls; the values of the globals and closures that these
read; the types of the arguments; the modules that compile; and versions, processor and settings. Comments, docstrings
and files without kernels do not count. Names that a function reads as attributes are looked up as globals, too: a
kernel is rather compiled once too often than once too seldom.
"""

from __future__ import annotations

import hashlib
import linecache
import marshal
import os
import pickle
from collections.abc import Callable, Iterator
from enum import Enum
from functools import cache
from importlib.resources import files
from opcode import opmap
from pathlib import Path
from types import CellType, CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np

from .kernel_files import cache_folder

_COMPILING = ("kernels.py", "compiling.py", "machine_code.py", "kernel_files.py", "kernel_keys.py")
_VERSIONED = ("numba", "numpy", "llvmlite", "math", "typing", "builtins")  # a key has their versions, or Python's
_RAISE = opmap["RAISE_VARARGS"]
_PLAIN = (type(None), bool, int, float, complex, str, bytes)


def kernel_file(function: Callable[..., Any], *key: object) -> Path:
    """Return the file of a kernel, compiled for what `key` says.

    Raises:
      OSError: the function has no source.
    """
    digest = hashlib.sha256(repr((*key, identity(function))).encode()).hexdigest()
    return cache_folder() / f"{function.__qualname__.rpartition('.')[2]}-{digest[:32]}"


def identity(function: Callable[..., Any]) -> str:
    """Return a hash of what the machine code of a function depends on, besides the types of its arguments.

    Raises:
      OSError: the function has no source.
    """
    if not (os.path.isfile(function.__code__.co_filename) or linecache.getlines(function.__code__.co_filename)):
        raise OSError(f"{function.__qualname__} has no source")
    digest = hashlib.sha256(_compiler())
    for text in _Reached(function).texts():
        digest.update(f"{text}\n".encode())
    return digest.hexdigest()


@cache
def _compiler() -> bytes:
    """Return the sources of the modules that compile kernels."""
    return b"".join(files(__package__).joinpath(name).read_bytes() for name in _COMPILING)


class _Reached:
    """The functions that a function calls, directly or not, numbered in the order in which they are found."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._functions: list[Any] = [function]
        self._numbers = {id(function): 0}

    def texts(self) -> Iterator[str]:
        """Yield texts for each function: equal only where numba makes the same of it."""
        for function in self._functions:  # it grows
            code, names = _read(function.__code__)
            yield f"{function.__module__} {function.__qualname__} {code}"
            cells = tuple(cell.cell_contents for cell in function.__closure__ or () if cell != CellType())
            defaults = function.__defaults__, *sorted((function.__kwdefaults__ or {}).items())
            yield self._text((cells, defaults), names)
            for name in names:
                if name in function.__globals__:
                    yield f"{name}: {self._text(function.__globals__[name], names)}"

    def _text(self, value: Any, names: tuple[str, ...]) -> str:
        """Return a text for a value that a function reads; `names` are all that it reads, also as attributes."""
        of = type(value)
        function = getattr(value, "py_func", None) or getattr(value, "made_by", value)
        if isinstance(function, FunctionType):  # of a kernel; that which makes something of numba's; or a plain one
            text = f"{of.__qualname__} {getattr(value, '__dict__', {}).get('targetoptions', '')}"
            if _has_version(function.__module__):
                return f"{text} {function.__module__}.{function.__qualname__}"
            number = self._numbers.setdefault(id(function), len(self._functions))
            if number == len(self._functions):
                self._functions.append(function)
            return f"{text} {number}"
        if isinstance(value, ModuleType):
            read = [] if _has_version(value.__name__) else [each for each in names if each in vars(value)]
            return f"{value.__name__} {[self._text(vars(value)[each], names) for each in read]}"
        if isinstance(value, type):
            members = [(name, repr(each.value)) for name, each in getattr(value, "__members__", {}).items()]
            fields = getattr(value, "_fields", ()), getattr(value, "_field_defaults", ())
            return f"{value.__module__}.{value.__qualname__} {fields} {members}"
        if isinstance(value, Enum):
            return f"{self._text(of, names)} {value.name}"
        if isinstance(value, np.dtype):
            return f"{value!r} {value.itemsize} {value.isalignedstruct}"
        if isinstance(value, (np.ndarray, np.generic)) and not value.dtype.hasobject:
            layout = (value.shape, value.strides, value.flags.num) if isinstance(value, np.ndarray) else of
            return f"{self._text(value.dtype, names)} {layout} {hashlib.sha256(value.tobytes()).hexdigest()}"
        if isinstance(value, (tuple, list)):
            return f"{self._text(of, names)} {[self._text(part, names) for part in value]}"
        if of in _PLAIN:
            return f"{of.__name__} {value!r}"
        try:
            return f"{of.__qualname__} {pickle.dumps(value)!r}"
        except Exception:  # nothing that numba could read
            return of.__qualname__


def _has_version(module: str | None) -> bool:
    return str(module).partition(".")[0] in _VERSIONED


@cache
def _read(code: CodeType) -> tuple[str, tuple[str, ...]]:
    """Return a hash of some code, wherever its file lies, and all names in it: of globals and attributes.

    Docstrings do not count, and lines only where the code raises: its traceback names them.
    """
    inner = [_read(constant) for constant in code.co_consts if isinstance(constant, CodeType)]
    constants = [constant for constant in code.co_consts if not isinstance(constant, CodeType)]
    if constants and isinstance(constants[0], str) and not code.co_name.startswith("<"):
        constants[0] = "docstring"
    bare = code.replace(co_filename="", co_consts=tuple(constants))
    if _RAISE not in code.co_code[::2]:
        bare = bare.replace(co_firstlineno=1, co_linetable=b"")
    text = "".join(text for text, _ in inner)
    digest = hashlib.sha256(marshal.dumps(bare, 2) + text.encode()).hexdigest()  # 2: the same for equal code
    return digest, tuple(dict.fromkeys([*code.co_names, *(name for _, names in inner for name in names)]))
