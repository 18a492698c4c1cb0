"""Distinct numbers, and distinct rows of numbers, in their order.

As `numpy.unique`, which imports all of `numpy.ma` to look for masks: that takes as long as making a track.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def distinct(numbers: NDArray[Any]) -> NDArray[Any]:
    """Return the numbers of an array, each once."""
    ordered = np.sort(numbers, axis=None)
    return ordered[_first(ordered[:, None])]


def distinct_rows(rows: NDArray[Any]) -> tuple[NDArray[Any], NDArray[np.intp], NDArray[np.intp]]:
    """Return the rows of an array (n, k), each once: (m, k); for each of the n which it is; and of the m how often."""
    order = np.lexsort(rows.T[::-1])
    ordered = rows[order]
    first = _first(ordered)
    which = np.empty(len(rows), np.intp)
    which[order] = np.cumsum(first) - 1
    return ordered[first], which, np.bincount(which, minlength=np.count_nonzero(first))


def _first(ordered: NDArray[Any]) -> NDArray[np.bool_]:
    """Say which rows differ from the one before."""
    first = np.ones(len(ordered), bool)
    first[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
    return first
