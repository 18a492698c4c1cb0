"""Sines and the like for what a race is made of: the same bits on every processor.

NumPy's own differ in the last bit between processors with and without AVX-512. These are the functions of the native
core, native/core/transcendental.hpp. Names, arguments and shapes are NumPy's.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .native import core

__all__ = ["arccos", "arcsin", "arctan2", "cos", "exp", "hypot", "sin", "tan"]


def _of_arrays(function: Callable[..., None]) -> Callable[..., NDArray[np.float64]]:
    """Return a function of the native core for arrays of any shapes that fit together."""

    def evaluate(*values: ArrayLike) -> Any:
        arrays = np.broadcast_arrays(*(np.asarray(value, np.float64) for value in values))
        found = np.empty(arrays[0].shape)
        function(*(np.ascontiguousarray(array).ravel() for array in arrays), found.reshape(-1))
        return found[()]

    return evaluate


sin, cos, tan, exp = map(_of_arrays, (core.sin, core.cos, core.tan, core.exp))
arcsin, arccos = map(_of_arrays, (core.arcsin, core.arccos))
arctan2, hypot = map(_of_arrays, (core.arctan2, core.hypot))
