"""Many arrays as one argument: a table of their addresses and shapes.

    table = ArrayTable(("commands", "running"), {"commands": commands, "running": running})
    core.drive_all(np.array([table.address]))

The native core makes views of the arrays again, which costs nothing; to take fifty arrays over from Python takes longer
than what is done with them. Arrays must be contiguous, and the table keeps them alive.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .arguments import Uncopied

Row = NDArray[np.int64]
"""Of a table: an array's address, and its length along up to three axes. Shape (4,)."""

Table = NDArray[np.int64]
"""One row an array. Shape (n, 4)."""


class ArrayTable(Uncopied):
    """A table of arrays.

    Args:
      names: of all arrays that are looked for; the place in it is the row in the table.
      arrays: by name. One that is missing is empty.

    Attributes:
      rows: the table, (names, 4).
      address: of the table.

    Raises:
      ValueError: an array that is not contiguous.
    """

    def __init__(self, names: tuple[str, ...], arrays: Mapping[str, NDArray[Any]]) -> None:
        self._names, self._arrays = names, dict[str, NDArray[Any]]()
        self.rows: Table = np.zeros((len(names), 4), np.int64)
        self.address = self.rows.ctypes.data
        for name in names:
            if name in arrays:
                self.put(name, arrays[name])

    def with_others(self, arrays: Mapping[str, NDArray[Any]]) -> ArrayTable:
        """Return a table of the same arrays but for some, by name."""
        return ArrayTable(self._names, {**self._arrays, **arrays})

    def put(self, name: str, array: NDArray[Any]) -> None:
        """Put an array in the place of another one.

        Raises:
          ValueError: it is not contiguous.
        """
        if not array.flags.c_contiguous:
            raise ValueError(f"array {name!r} is not contiguous; accepted: rows side by side")
        row = self.rows[self._names.index(name)]
        row[0], row[1 : 1 + array.ndim] = array.ctypes.data, array.shape
        self._arrays[name] = array
