"""Names that NumPy had when many planners were written and has no longer, and which version to install for them."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import numpy as np

BEFORE_1_24: dict[str, Any] = {
    "float": float, "int": int, "bool": bool, "object": object, "str": str, "complex": complex,
}  # fmt: skip
"""Removed in NumPy 1.24, each with what it was."""


def _in1d(ar1: Any, ar2: Any, assume_unique: bool = False, invert: bool = False, **kind: Any) -> Any:
    return np.isin(np.ravel(ar1), ar2, assume_unique=assume_unique, invert=invert, **kind)


def _asfarray(a: Any, dtype: Any = np.float64) -> Any:
    return np.asarray(a, dtype if np.issubdtype(dtype, np.inexact) else np.float64)


_trapezoid: Callable[..., Any] = getattr(np, "trapezoid", None) or np.trapz  # type: ignore[attr-defined]

BEFORE_2: dict[str, Any] = {
    "NaN": np.nan, "NAN": np.nan, "Inf": np.inf, "infty": np.inf, "Infinity": np.inf, "PINF": np.inf, "NINF": -np.inf,
    "float_": np.float64, "complex_": np.complex128, "string_": np.bytes_, "unicode_": np.str_, "mat": np.asmatrix,
    "product": np.prod, "cumproduct": np.cumprod, "alltrue": np.all, "sometrue": np.any, "round_": np.round,
    "row_stack": np.vstack, "in1d": _in1d, "asfarray": _asfarray, "trapz": _trapezoid,
    "find_common_type": lambda array_types, scalar_types: np.result_type(*array_types, *scalar_types),
}  # fmt: skip
"""Removed in NumPy 2 or one of its minor versions, each with what stands for it."""

OLD_NAMES = re.compile(
    rb"\b(?:np|numpy)\.(?:" + "|".join([*BEFORE_1_24, *BEFORE_2]).encode() + rb")\b"
    rb"|\bfrom\s+numpy\s+import\b[^\n]*\b(?:" + "|".join(BEFORE_2).encode() + rb")\b"
)
"""Finds the use of such a name in the text of a file."""

_LACKS = re.compile(
    r"(?:module 'numpy[\w.]*' has no attribute '(\w+)'|cannot import name '(\w+)' from 'numpy[\w.]*'"
    r"|`np\.(\w+)` was removed)"
)
_COMPILED = re.compile(r"numpy\.core\.multiarray failed to import|compiled using NumPy 1|_ARRAY_API not found")
_ONE_ELEMENT = "only 0-dimensional arrays can be converted to Python scalars"


def one_element_advice() -> str:
    """Return what is said of an array of one element that is to be a number."""
    return (
        f"; NumPy {np.__version__} is installed, and an array of one element is no number from NumPy 2.4 on: write "
        "value.item(), or install an older one: pip install 'numpy<2.4'"
    )


def advice(error: BaseException, said: str) -> str:
    """Return the NumPy version to install for an error that a newer one causes; empty for any other error."""
    kind = type(error)  # its `__class__` is the planner's to answer
    if issubclass(kind, (TypeError, ValueError)):
        cause = error.__cause__ if issubclass(kind, ValueError) else error  # of a value put into an array
        return one_element_advice() if type(cause) is TypeError and _ONE_ELEMENT in str(cause) else ""
    if not issubclass(kind, (AttributeError, ImportError)):
        return ""
    install = f"; NumPy {np.__version__} is installed, install an older one: pip install 'numpy<2'"
    if _COMPILED.search(said):
        return install
    found = _LACKS.search(said)
    name = next((each for each in found.groups() if each), "") if found else ""
    if name in BEFORE_1_24:
        return (
            f"; NumPy {np.__version__} is installed, and np.{name} went with NumPy 1.24, which is older than fg-mujoco "
            f"needs: write {name} in its place; elsewhere: pip install 'numpy<1.24'"
        )
    return install if name in BEFORE_2 or "NumPy 2.0" in said else ""
