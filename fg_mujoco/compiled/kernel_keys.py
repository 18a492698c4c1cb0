"""The name of a kernel's file: a hash of all that its machine code depends on, and of nothing else.

These are the kernel's bytecode, the values of the globals and closures that it reads, the same of all kernels that it
calls, the types of its arguments, the modules that compile it, versions, processor and settings. Docstrings, comments,
and what else stands in a module, do not matter. Line numbers do only where a kernel raises: its traceback names them.

A value that this module cannot tell from others by itself counts by the text of the file that reads it, and of all that
this file imports (`kernel_files.source_digest`): rather compiled once too often than once too seldom.
"""

from __future__ import annotations

import builtins
import enum
import hashlib
import linecache
import os
import pickle
import re
import sys
from collections.abc import Callable, Iterator
from functools import cache
from importlib.resources import files
from opcode import opmap
from pathlib import Path
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np

from .kernel_files import cache_folder, source_digest

_COMPILING = ("kernels.py", "compiling.py", "machine_code.py", "kernel_files.py", "kernel_keys.py")
_LOAD_GLOBAL, _IMPORT, _EXTENDED, _RAISE = (
    opmap[name] for name in ("LOAD_GLOBAL", "IMPORT_NAME", "EXTENDED_ARG", "RAISE_VARARGS")
)
_LOAD_CONSTANT = b"".join(re.escape(bytes([opmap[name]])) for name in ("LOAD_CONST", "RETURN_CONST") if name in opmap)
_READS_FIRST = re.compile(b"(?:..)*?[%s]\\0" % _LOAD_CONSTANT, re.DOTALL)  # bytecode that reads its first constant
_PLAIN = (type(None), bool, int, float, complex, str, bytes, type(Ellipsis))
_VERSIONED = ("numba", "numpy", "llvmlite", "math")  # a key has their versions, or Python's


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
    digest = hashlib.sha256(_compiler().encode())
    for text in _Reached(function).texts():
        digest.update(f"{text}\n".encode())
    return digest.hexdigest()


@cache
def _compiler() -> str:
    """Return a hash of the modules that compile kernels."""
    package = files(__package__)
    return hashlib.sha256(b"".join(package.joinpath(name).read_bytes() for name in _COMPILING)).hexdigest()


class _Reached:
    """The functions that a function calls, directly or not, numbered in the order in which they are found."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._functions: list[Any] = [function]
        self._numbers = {id(function): 0}

    def texts(self) -> Iterator[str]:
        """Yield a text for each function: equal only where numba makes the same of it."""
        for function in self._functions:  # it grows
            own, names, attributes, imports = _read_off(function.__code__, function.__code__.co_filename)
            yield f"{function.__module__} {function.__qualname__} {own}"
            if imports and function.__module__ != f"{__package__}.kernels":
                yield source_digest(function)
            yield self._text(function, function.__defaults__, attributes)
            yield self._text(function, sorted((function.__kwdefaults__ or {}).items()), attributes)
            for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
                try:
                    yield f"{name}: {self._text(function, cell.cell_contents, attributes)}"
                except ValueError:
                    yield f"{name} is empty"
            for name in names:
                if name in function.__globals__:
                    yield f"{name}: {self._text(function, function.__globals__[name], attributes)}"
                else:
                    yield f"{name} is {'of Python' if hasattr(builtins, name) else 'missing'}"

    def _number(self, function: Any) -> str:
        if id(function) not in self._numbers:
            self._numbers[id(function)] = len(self._functions)
            self._functions.append(function)
        return f"function {self._numbers[id(function)]}"

    def _text(self, reader: Any, value: Any, attributes: frozenset[str]) -> str:
        """Return a text for a value that a function reads: equal only where numba makes the same of it.

        Args:
          reader: the function.
          value: read.
          attributes: names of all attributes that the function reads, of anything.
        """
        of = type(value)
        name = f"{of.__module__}.{of.__qualname__}"
        if of in _PLAIN:
            return f"{name} {value!r}"
        if isinstance(value, ModuleType):
            return self._of_module(reader, value, attributes, set())
        if isinstance(getattr(value, "py_func", None), FunctionType):  # a kernel, or a function that numba compiles
            return f"{name} {vars(value).get('targetoptions', '')} {self._number(value.py_func)}"
        if isinstance(getattr(value, "made_by", None), FunctionType):  # something of numba's, for kernels
            return f"{name} {self._number(value.made_by)}"
        if isinstance(value, (FunctionType, BuiltinFunctionType, np.ufunc)):
            if isinstance(value, FunctionType) and not _has_version(value.__module__):
                return self._number(value)
            return f"{name} {getattr(value, '__module__', '')}.{value.__name__}"
        if isinstance(value, np.dtype):
            return f"dtype {value!r} {value.itemsize} {value.isalignedstruct}"
        if isinstance(value, (np.ndarray, np.generic)) and not value.dtype.hasobject:
            bits = hashlib.sha256(value.tobytes()).hexdigest()
            layout = (value.shape, value.strides, value.flags.num) if of is np.ndarray else ""
            return f"{name} {self._text(reader, value.dtype, attributes)} {layout} {bits}"
        if isinstance(value, enum.Enum):
            return f"{self._text(reader, of, attributes)} {value.name}"
        if isinstance(value, (tuple, list)) and (of in (tuple, list) or hasattr(of, "_fields")):
            parts = [self._text(reader, part, attributes) for part in value]
            return f"{name}{getattr(of, '_fields', '')}({', '.join(parts)})"
        if isinstance(value, CodeType):
            return str(_read_off(value, value.co_filename)[0])
        if isinstance(value, type):
            return self._of_class(reader, value, attributes)
        return _of_source(reader, value)

    def _of_module(self, reader: Any, module: ModuleType, attributes: frozenset[str], seen: set[str]) -> str:
        """Return a text for a module: what the function may read there."""
        texts = [f"module {module.__name__}"]
        if not _has_version(module.__name__) and module.__name__ not in seen:
            seen.add(module.__name__)
            for name in sorted(attributes & vars(module).keys()):
                value = vars(module)[name]
                if isinstance(value, ModuleType):
                    texts.append(f"{name}: {self._of_module(reader, value, attributes, seen)}")
                else:
                    texts.append(f"{name}: {self._text(reader, value, attributes)}")
        return " ".join(texts)

    def _of_class(self, reader: Any, of: Any, attributes: frozenset[str]) -> str:
        """Return a text for a class: of named tuples, numbers and errors that a kernel makes, or an enumeration."""
        name = f"class {of.__module__}.{of.__qualname__}"
        if hasattr(of, "_fields") and issubclass(of, tuple):
            defaults = self._text(reader, sorted(of._field_defaults.items()), attributes)
            return f"{name} {of._fields} {defaults}"
        if issubclass(of, enum.Enum):
            members = [(each.name, each.value) for each in of.__members__.values()]
            return f"{name} {self._text(reader, members, attributes)}"
        if issubclass(of, (np.generic, BaseException)) or of.__module__ == "builtins" or _has_version(of.__module__):
            return name
        return _of_source(reader, of)


def _of_source(reader: Any, value: Any) -> str:
    """Return a text for any other value that a function reads: its own, and of all that may have made it."""
    try:
        text = pickle.dumps(value).hex()
    except Exception:  # such as a class within a function: it is in the same file
        text = f"{type(value).__module__}.{type(value).__qualname__}"
    return f"{text} {source_digest(reader)}"


def _has_version(module: str | None) -> bool:
    return str(module).partition(".")[0] in _VERSIONED


@cache
def _read_off(code: CodeType, file: str) -> tuple[str, tuple[str, ...], frozenset[str], bool]:
    """Return a hash of some bytecode, the globals that it reads, the names of all attributes, and whether it imports.

    Imports of what has a version do not count.

    Args:
      code: of a function.
      file: that it is in: code is equal in others, too.
    """
    operations = code.co_code[::2]
    documented = bool(code.co_consts) and isinstance(code.co_consts[0], str) and not _READS_FIRST.match(code.co_code)
    constants: list[str] = ["documented"] if documented else []
    names, attributes = list(_named_by(_LOAD_GLOBAL, code)), set(code.co_names)
    imports = any(not _has_version(name) for name in _named_by(_IMPORT, code))
    for constant in code.co_consts[documented:]:
        if isinstance(constant, CodeType):
            inner, inner_names, inner_attributes, inner_imports = _read_off(constant, file)
            constants.append(inner)
            names += inner_names
            attributes |= inner_attributes
            imports = imports or inner_imports
        else:
            constants.append(f"{type(constant).__name__} {_constant(constant)}")
    lines = (Path(file).name, code.co_firstlineno, _lines(code)) if _RAISE in operations else ()
    counts = code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount, code.co_flags
    variables = code.co_varnames, code.co_freevars, code.co_cellvars, code.co_names
    table = getattr(code, "co_exceptiontable", b"")
    text = repr((code.co_name, code.co_code, constants, counts, variables, table, lines))
    digest = hashlib.sha256(text.encode()).hexdigest()
    return digest, tuple(dict.fromkeys(names)), frozenset(attributes), imports


def _constant(value: Any) -> str:
    """Return a text for a constant: sets are the same in any order, and tell 1 from 1.0."""
    return repr(sorted(map(repr, value))) if isinstance(value, frozenset) else repr(value)


def _lines(code: CodeType) -> bytes:
    return getattr(code, "co_linetable", b"")


def _named_by(operation: int, code: CodeType) -> Iterator[str]:
    """Yield the names that an operation has in some bytecode: globals that are read, or modules that are imported."""
    operations, arguments = code.co_code[::2], code.co_code[1::2]
    place = operations.find(operation)
    while place >= 0:
        number, shift, before = arguments[place], 8, place - 1
        while before >= 0 and operations[before] == _EXTENDED:
            number, shift, before = number | arguments[before] << shift, shift + 8, before - 1
        if operation == _LOAD_GLOBAL and sys.version_info >= (3, 11):
            number >>= 1  # the lowest bit says something else since then
        if number < len(code.co_names):
            yield code.co_names[number]
        place = operations.find(operation, place + 1)
