"""Runs kernels in plain Python, so that a debugger can step through them: with NUMBA_DISABLE_JIT=1.

A kernel keeps its own code, so breakpoints hold. What it is given is changed where Python would stop and numba would
not: numbers are numpy's, for which a division by zero gives inf or NaN; functions of `math` are numpy's too; narrow
whole numbers in arrays are read as Python's; records have their fields as attributes.

The results are close to those of compiled kernels, but not the same to the last bit. An index out of bounds raises
IndexError; compiled code reads whatever lies there.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable
from functools import cache, wraps
from types import FunctionType, SimpleNamespace
from typing import Any

import numpy as np

_LEAST = -(2**63)  # what x86 processors make of a number that has no 64-bit integer
_NUMPYS = {
    "acos": "arccos", "acosh": "arccosh", "asin": "arcsin", "asinh": "arcsinh", "atan": "arctan", "atan2": "arctan2",
    "atanh": "arctanh", "pow": "power",
} | {name: name for name in (
    "copysign", "cos", "cosh", "exp", "expm1", "fmod", "hypot", "log", "log10", "log1p", "log2", "sin", "sinh", "sqrt",
    "tan", "tanh",
)}  # fmt: skip


def _whole(of: Callable[[Any], Any]) -> Callable[[Any], int]:
    """Return a function to whole numbers that gives the least one for NaN, inf and what is beyond 64 bits."""
    return lambda value: of(value) if _LEAST <= value < -_LEAST else _LEAST


_MATH = SimpleNamespace(
    **vars(math)
    | {name: getattr(np, numpys) for name, numpys in _NUMPYS.items()}
    | {"floor": _whole(math.floor), "ceil": _whole(math.ceil), "trunc": _whole(math.trunc)}
)
_REPLACED = {"math": _MATH, "int": _whole(int), "round": _whole(round)}


def interpreted(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return the function that Python runs in place of a compiled kernel."""

    @cache
    def run() -> Callable[..., Any]:  # made at the first call, when all globals of its module are there
        scope = {**_REPLACED, **function.__globals__}
        if scope["math"] is math:
            scope["math"] = _MATH
        made = FunctionType(
            function.__code__, scope, function.__name__, function.__defaults__, function.__closure__
        )
        made.__kwdefaults__ = function.__kwdefaults__
        return made

    @wraps(function)
    def kernel(*arguments: Any, **named: Any) -> Any:
        given = {name: taken_over(value) for name, value in named.items()}
        with np.errstate(all="ignore"):
            return taken_over(run()(*map(taken_over, arguments), **given))

    def address(*arguments: Any) -> int:
        """Return the number by which `call_at` finds this kernel."""
        _called_by_number[id(kernel)] = kernel
        return id(kernel)

    made: Any = kernel
    made.py_func, made.address = function, address
    return kernel


_called_by_number: dict[int, Callable[..., Any]] = {}


def call_at(number: int, argument: int) -> None:
    """Call the kernel whose `address` returned this number."""
    _called_by_number[number](argument)


class Record(np.void):  # type: ignore[misc]
    """One record of a structured array; its fields are attributes, whatever numpy's own attributes are called."""

    def __getattribute__(self, name: str) -> Any:
        fields = np.void.__getattribute__(self, "dtype").fields
        return taken_over(self[name]) if name in fields else np.void.__getattribute__(self, name)

    def __setattr__(self, name: str, value: Any) -> None:
        self[name] = value


class _Narrow(np.ndarray[Any, Any]):
    """An array of truth values or narrow whole numbers, which are read as Python's: those do not overflow."""

    def __getitem__(self, key: Any) -> Any:
        value = super().__getitem__(key)
        return value if isinstance(value, np.ndarray) else value.item()


@cache
def _of_records(dtype: np.dtype[Any]) -> np.dtype[Any]:
    return np.dtype((Record, dtype))


def taken_over(value: Any) -> Any:
    """Return a value as kernels see it: the same memory, numbers that may be divided by zero, records with fields."""
    of = value.__class__
    if of is float:
        return np.float64(value)
    if of is np.ndarray or of is np.void:
        kind = value.dtype
        if kind.names is not None:
            return value.view(_of_records(kind)) if kind.type is np.void else value
        return value.view(_Narrow) if kind.kind in "bui" and kind.itemsize < 8 else value
    if isinstance(value, tuple):
        parts = [taken_over(part) for part in value]
        return tuple(parts) if of is tuple else of(*parts)
    return value.item() if isinstance(value, (np.bool_, np.integer)) else value


# What lies at addresses, and functions of C.


def array_at(address: int, shape: tuple[int, ...], dtype: Any) -> Any:
    """Return the array at an address."""
    kind = np.dtype(dtype)
    if 0 in shape:
        return taken_over(np.empty(shape, kind))
    buffer = (ctypes.c_char * (math.prod(shape) * kind.itemsize)).from_address(address)
    return taken_over(np.frombuffer(buffer, kind).reshape(shape))


def word_at(address: int) -> int:
    """Return the address that lies at an address."""
    return ctypes.c_size_t.from_address(address).value


_TYPES_IN_C: dict[str, Any] = {
    "void": None, "int32": ctypes.c_int32, "int64": ctypes.c_int64, "uintp": ctypes.c_size_t,
    "float64": ctypes.c_double,
}  # fmt: skip

_raised: list[BaseException] = []
"""By kernels that C called: C cannot hand it on."""


def in_c(function: Callable[..., Any], arguments: tuple[str, ...]) -> Callable[[], int]:
    """Return a function that returns the address of a function in C, which calls a kernel: see `kernels.c_function`."""

    def call(*given: int) -> None:
        try:
            if not _raised:
                function(*given)
        except BaseException as error:
            _raised.append(error)

    made = ctypes.CFUNCTYPE(None, *(_TYPES_IN_C[name] for name in arguments))(call)
    return lambda: ctypes.cast(made, ctypes.c_void_p).value or 0


def of_library(library: str, name: str, result: str, arguments: tuple[str, ...]) -> Callable[..., Any]:
    """Return a function of a library of C; an error of a kernel that it calls is raised once it has returned."""
    function = getattr(ctypes.CDLL(library), name)
    function.restype, function.argtypes = _TYPES_IN_C[result], [_TYPES_IN_C[each] for each in arguments]

    def call(*given: Any) -> Any:
        answer = function(*given)
        if _raised:
            raise _raised.pop()
        return answer

    return call
