"""Kernels that Python runs, with the bits of compiled ones: for debuggers, with NUMBA_DISABLE_JIT=1.

A kernel keeps its file and lines, so that breakpoints hold. What Python and numba do differently is replaced in its
syntax tree, or where its arguments are taken over:

- `/`, `//` and `%` by zero give inf, NaN, or 0 for whole numbers; `**` with a whole number multiplies.
- `math` gives inf or NaN where Python raises, and C's `hypot`; `int`, `round`, `math.floor` and `math.ceil` of what is
  beyond 64 bits, or NaN, give the least 64-bit number, as x86 processors do.
- Numbers that are read from arrays become Python's, or 64-bit ones, so that narrow whole numbers do not overflow.
- Records, in arrays or alone, have their fields as attributes.

Whole numbers do not overflow at 64 bits here. An index out of bounds raises IndexError, where compiled code reads on.
"""

from __future__ import annotations

import ast
import copy
import ctypes
import inspect
import linecache
import math
from collections.abc import Callable
from functools import cache, wraps
from types import CellType, CodeType, FunctionType, SimpleNamespace
from typing import Any

import numpy as np

_LEAST = -(2**63)


def interpreted(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return what Python runs in the place of a compiled kernel."""
    runs: list[Callable[..., Any]] = []  # made at the first call, when all globals of its module are there

    @wraps(function)
    def kernel(*arguments: Any, **named: Any) -> Any:
        if not runs:
            runs.append(_as_compiled(function))
        given = {name: taken_over(value) for name, value in named.items()}
        with np.errstate(all="ignore"):
            return taken_over(runs[0](*map(taken_over, arguments), **given))

    def address(*arguments: Any) -> int:
        """Return the number by which `call_at` finds this kernel."""
        _called_by_number[id(kernel)] = kernel
        return id(kernel)

    made: Any = kernel
    made.py_func, made.address = function, address
    return kernel


_called_by_number: dict[int, Callable[..., Any]] = {}


def call_at(number: int, argument: int) -> None:
    """Call the kernel that has told this number as its address."""
    _called_by_number[number](argument)


class Record(np.void):  # type: ignore[misc]
    """One record of a structured array; its fields are attributes, whatever numpy's own attributes are called."""

    def __getattribute__(self, name: str) -> Any:
        fields = np.void.__getattribute__(self, "dtype").fields
        return taken_over(self[name]) if name in fields else np.void.__getattribute__(self, name)

    def __setattr__(self, name: str, value: Any) -> None:
        self[name] = value


@cache
def _of_records(dtype: np.dtype[Any]) -> np.dtype[Any]:
    return np.dtype((Record, dtype))


_NUMBERS: dict[type, Callable[[Any], Any]] = {
    np.float64: float, np.bool_: bool,
    **dict.fromkeys((np.int8, np.int16, np.int32, np.int64), int),
    **dict.fromkeys((np.uint8, np.uint16, np.uint32), np.int64),  # an unsigned array takes a negative one of these
}  # fmt: skip


def taken_over(value: Any) -> Any:
    """Return a value as kernels see it: the same memory, with records in it, and Python's numbers."""
    of = value.__class__
    if of in _NUMBERS:
        return _NUMBERS[of](value)
    if of is np.ndarray or of is np.void:
        plain = value.dtype.names is not None and value.dtype.type is np.void
        return value.view(_of_records(value.dtype)) if plain else value
    if isinstance(value, tuple):
        parts = [taken_over(part) for part in value]
        return tuple(parts) if of is tuple else of(*parts)
    return value


def _read(value: Any) -> Any:
    """Return what was read from an array, or a tuple, as kernels see it."""
    number = _NUMBERS.get(value.__class__)
    return value if number is None else number(value)


def _divided(a: Any, b: Any) -> Any:
    try:
        return a / b
    except ZeroDivisionError:
        a = float(a)
        return math.nan if a == 0.0 or math.isnan(a) else math.copysign(math.inf, a) * math.copysign(1.0, b)


def _floor_divided(a: Any, b: Any) -> Any:
    try:
        return a // b
    except ZeroDivisionError:
        return _divided(a, b) if isinstance(a, float) or isinstance(b, float) else 0


def _rest(a: Any, b: Any) -> Any:
    try:
        return a % b
    except ZeroDivisionError:
        return math.nan if isinstance(a, float) or isinstance(b, float) else 0


def _power(a: Any, b: Any) -> Any:
    """Return a power, by products in the order of numba's where the exponent is a whole number."""
    if not isinstance(b, (int, np.integer)):
        return _MATH.pow(a, b)
    power, factor, left = 1, a, abs(int(b))
    while left:
        if left & 1:
            power = power * factor
        factor, left = factor * factor, left >> 1
    return 1.0 / power if b < 0 else power


def _whole(of: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Return a function that makes whole numbers of 64 bits, also of what is none."""

    def whole(value: Any) -> Any:
        try:
            number = of(value)
        except (ValueError, OverflowError):
            return _LEAST
        return number if _LEAST <= number < -_LEAST else _LEAST

    return whole


def _without_errors(name: str) -> Callable[..., Any]:
    """Return a function of `math` that gives what C's gives where Python raises."""
    of_python = getattr(math, name)
    of_numpy = getattr(np, "power" if name == "pow" else name, None)

    def function(*arguments: Any) -> Any:
        try:
            return of_python(*arguments)
        except (ValueError, OverflowError):
            return math.nan if of_numpy is None else float(of_numpy(*map(np.float64, arguments)))

    return function


def _hypot(x: Any, y: Any) -> float:
    return float(np.hypot(x, y))  # C's; that of Python rounds otherwise


_MATH: Any = SimpleNamespace(
    **vars(math)
    | {name: _without_errors(name) for name in (
        "acos", "acosh", "asin", "atanh", "cos", "cosh", "exp", "expm1", "fmod", "log", "log10", "log1p", "log2", "pow",
        "sin", "sinh", "sqrt", "tan",
    )}
    | {"floor": _whole(math.floor), "ceil": _whole(math.ceil), "trunc": _whole(math.trunc), "hypot": _hypot}
)  # fmt: skip

_OPERATIONS = {ast.Div: "_divided", ast.FloorDiv: "_floor_divided", ast.Mod: "_rest", ast.Pow: "_power"}
_HELPERS = {each.__name__: each for each in (_read, _divided, _floor_divided, _rest, _power)}
_IN_KERNELS = {"int": _whole(int), "round": _whole(round)}  # in the place of builtins


class _Replaced(ast.NodeTransformer):
    """Puts calls of the functions above in the place of what Python does otherwise."""

    def visit_BinOp(self, node: ast.BinOp) -> ast.AST:
        """Replace a division, rest or power."""
        self.generic_visit(node)
        name = _OPERATIONS.get(type(node.op))
        return node if name is None else _call(name, node, node.left, node.right)

    def visit_AugAssign(self, node: ast.AugAssign) -> ast.AST:
        """Replace `x /= y` and its kin; in arrays the numbers are numpy's, which do as compiled code does."""
        self.generic_visit(node)
        name = _OPERATIONS.get(type(node.op))
        if name is None or isinstance(node.target, ast.Subscript):
            return node
        read: Any = ast.parse(ast.unparse(node.target), mode="eval").body
        value = _call(name, node, read, node.value)
        return ast.copy_location(ast.Assign(targets=[node.target], value=value), node)

    def visit_Subscript(self, node: ast.Subscript) -> ast.AST:
        """Replace what is read from an array."""
        self.generic_visit(node)
        return _call("_read", node, node) if isinstance(node.ctx, ast.Load) else node

    def visit_AnnAssign(self, node: ast.AnnAssign) -> ast.AST:
        """Leave the annotation as it is."""
        if node.value is not None:
            node.value = self.visit(node.value)
        return node


def _call(name: str, at: ast.AST, *arguments: ast.expr) -> ast.Call:
    function = ast.Name(id=name, ctx=ast.Load())
    call = ast.copy_location(ast.Call(func=function, args=list(arguments), keywords=[]), at)
    ast.copy_location(function, at)
    return call


@cache
def _functions_in(file: str) -> dict[tuple[str, int], ast.FunctionDef]:
    """Return the functions in a file, by their names and the lines that they begin at."""
    tree = ast.parse("".join(linecache.getlines(file)))
    found = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
    return {(node.name, min([node.lineno, *(each.lineno for each in node.decorator_list)])): node for node in found}


def _as_compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function that gives what the compiled one gives; without its source, the function itself."""
    code, scope = function.__code__, function.__globals__
    node = _functions_in(code.co_filename).get((code.co_name, code.co_firstlineno))
    if node is None:
        return function
    helpers: dict[str, Any] = _HELPERS | {name: each for name, each in _IN_KERNELS.items() if name not in scope}
    if scope.get("math") is math:
        helpers["math"] = _MATH
    cells = dict(zip(code.co_freevars, function.__closure__ or (), strict=True))
    cells = {name: CellType(value) for name, value in helpers.items()} | cells
    body = [_Replaced().visit(each) for each in copy.deepcopy(node.body)]
    inner = ast.FunctionDef(
        name=node.name, args=_without_defaults(node.args), body=body, decorator_list=[], returns=None
    )
    names = [ast.arg(arg=name) for name in cells]
    outer = ast.FunctionDef(
        name="_", body=[ast.copy_location(inner, node)], decorator_list=[], returns=None,
        args=ast.arguments(posonlyargs=[], args=names, kwonlyargs=[], kw_defaults=[], defaults=[]),
    )  # fmt: skip
    module = ast.fix_missing_locations(ast.Module(body=[ast.copy_location(outer, node)], type_ignores=[]))
    made: Any = _code_in(_code_in(compile(module, code.co_filename, "exec", dont_inherit=True), "_"), node.name)
    run = FunctionType(
        made, scope, function.__name__, function.__defaults__, tuple(cells[name] for name in made.co_freevars)
    )
    run.__kwdefaults__, run.__qualname__ = function.__kwdefaults__, function.__qualname__
    return run


def _without_defaults(arguments: ast.arguments) -> ast.arguments:
    names = [[ast.copy_location(ast.arg(arg=each.arg), each) for each in part] for part in (
        arguments.posonlyargs, arguments.args, arguments.kwonlyargs,
    )]  # fmt: skip
    return ast.arguments(
        posonlyargs=names[0], args=names[1], kwonlyargs=names[2], kw_defaults=[None] * len(names[2]), defaults=[],
        vararg=arguments.vararg and ast.arg(arg=arguments.vararg.arg),
        kwarg=arguments.kwarg and ast.arg(arg=arguments.kwarg.arg),
    )  # fmt: skip


def _code_in(code: CodeType, name: str) -> CodeType:
    return next(each for each in code.co_consts if inspect.iscode(each) and each.co_name == name)


# What lies at addresses, and functions of C.


def array_at(address: int, shape: tuple[int, ...], dtype: Any) -> Any:
    """Return the array at an address."""
    kind = np.dtype(dtype)
    size = math.prod(shape) * kind.itemsize
    if size == 0:
        return taken_over(np.empty(shape, kind))
    buffer = (ctypes.c_char * size).from_address(address)
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
    """Return what gives the address of a function in C that calls a kernel, see `kernels.c_function`."""

    def call(*given: int) -> None:
        try:
            if not _raised:
                function(*given)
        except BaseException as error:
            _raised.append(error)

    made = ctypes.CFUNCTYPE(None, *(_TYPES_IN_C[name] for name in arguments))(call)
    return lambda: ctypes.cast(made, ctypes.c_void_p).value or 0


def of_library(library: str, name: str, result: str, arguments: tuple[str, ...]) -> Callable[..., Any]:
    """Return a function of a library of C; what a kernel raises that it calls is raised once it has returned."""
    function = getattr(ctypes.CDLL(library), name)
    function.restype, function.argtypes = _TYPES_IN_C[result], [_TYPES_IN_C[each] for each in arguments]

    def call(*given: Any) -> Any:
        answer = function(*given)
        if _raised:
            raise _raised.pop()
        return answer

    return call
