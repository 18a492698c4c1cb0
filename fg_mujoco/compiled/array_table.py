"""Many arrays as one argument of a kernel.

    table = ArrayTable(states=states, cars=cars, crashed=crashed)
    sense(table.rows, which)

numba takes some 0.13 us over from Python for each array that a kernel is called with, and a tick needs fifty. A table
holds their addresses and shapes; a kernel makes the arrays from it again, which costs nothing. Arrays must be
contiguous, and the table keeps them alive.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arguments import Uncopied
from .interpreted import array_at
from .kernels import kernel, numbas

Row = NDArray[np.int64]
"""Of a table: an array's address, and its length along up to three axes. Shape (4,)."""

Table = NDArray[np.int64]
"""One row an array. Shape (n, 4)."""


class ArrayTable(Uncopied):
    """A table of arrays.

    Args:
      names: of all arrays that the kernels look for; the place in it is the row in the table.
      arrays: by name. One that is missing is empty.

    Attributes:
      rows: the table, (names, 4).
      address: of the table, for `table_at`.

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


@numbas(array_at)
def carray() -> Any:
    """Return numba's function that makes an array of what lies at an address."""
    from numba import carray

    return carray


@numbas(int)
def pointer() -> Any:
    """Return what makes of an address what carray takes."""
    from numba import types
    from numba.core import cgutils
    from numba.extending import intrinsic

    def aspointer(context: Any, address: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return builder.inttoptr(arguments[0], cgutils.voidptr_t)

        return types.voidptr(types.int64), generate

    return intrinsic(aspointer)


@kernel
def table_at(address: int, count: int) -> Any:
    """Return the table of so many arrays that is at an address."""
    return carray(pointer(address), (count, 4), np.int64)


@kernel
def numbers(row: Row) -> Any:
    """Return the array of a row: numbers along one axis."""
    return carray(pointer(row[0]), (row[1],), np.float64)


@kernel
def matrix(row: Row) -> Any:
    """Return the array of a row: numbers along two axes."""
    return carray(pointer(row[0]), (row[1], row[2]), np.float64)


@kernel
def cube(row: Row) -> Any:
    """Return the array of a row: numbers along three axes."""
    return carray(pointer(row[0]), (row[1], row[2], row[3]), np.float64)


@kernel
def flags(row: Row) -> Any:
    """Return the array of a row: truth values."""
    return carray(pointer(row[0]), (row[1],), np.bool_)


@kernel
def whole_numbers(row: Row) -> Any:
    """Return the array of a row: whole numbers."""
    return carray(pointer(row[0]), (row[1],), np.int64)


@kernel
def whole_matrix(row: Row) -> Any:
    """Return the array of a row: whole numbers along two axes."""
    return carray(pointer(row[0]), (row[1], row[2]), np.int64)


@kernel
def short_numbers(row: Row) -> Any:
    """Return the array of a row: 32-bit whole numbers."""
    return carray(pointer(row[0]), (row[1],), np.int32)


@kernel
def single_numbers(row: Row) -> Any:
    """Return the array of a row: numbers of single precision."""
    return carray(pointer(row[0]), (row[1],), np.float32)


@kernel
def short_matrix(row: Row) -> Any:
    """Return the array of a row: 32-bit whole numbers along two axes."""
    return carray(pointer(row[0]), (row[1], row[2]), np.int32)


@kernel
def rows(row: Row, kind: Any) -> Any:
    """Return the array of a row: of a type of records."""
    return carray(pointer(row[0]), (row[1],), kind)


def _unwritable(array: Any) -> Any:
    seen = array.view()
    seen.flags.writeable = False
    return seen


@numbas(_unwritable)
def read_only() -> Any:
    """Return what makes of an array one that cannot be written to."""
    from numba.extending import intrinsic

    def read_only(context: Any, array: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            context.nrt.incref(builder, signature.return_type, arguments[0])
            return arguments[0]

        return array.copy(readonly=True)(array), generate

    return intrinsic(read_only)
