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

from ..course.lap_timer import LAP_TIMER
from ..kernels import kernel, numbas
from ..lidar.links import LINK
from ..messages import ODOMETRY
from ..vehicle.motion import CAR
from ..vehicle.tire_forces import GEAR, TIRE
from .telemetry import STATISTICS

Row = NDArray[np.int64]
"""Of a table: an array's address, and its length along up to three axes. Shape (4,)."""

Table = NDArray[np.int64]
"""One row an array. Shape (n, 4)."""


class ArrayTable:
    """A table of arrays.

    Args:
      names: of all arrays that the kernels look for; the place in it is the row in the table.
      arrays: by name. One that is missing is empty.

    Attributes:
      rows: the table, (names, 4).

    Raises:
      ValueError: an array that is not contiguous.
    """

    def __init__(self, names: tuple[str, ...], arrays: Mapping[str, NDArray[Any]]) -> None:
        self._arrays = dict(arrays)
        self.rows: Table = np.zeros((len(names), 4), np.int64)
        for row, name in zip(self.rows, names, strict=True):
            array = arrays.get(name)
            if array is None:
                continue
            if not array.flags.c_contiguous:
                raise ValueError(f"array {name!r} is not contiguous; accepted: rows side by side")
            row[0], row[1 : 1 + array.ndim] = array.ctypes.data, array.shape


@numbas
def carray() -> Any:
    """Return numba's function that makes an array of what lies at an address."""
    from numba import carray

    return carray


@numbas
def _pointer() -> Any:
    """Return what makes of an address what carray takes."""
    from numba import types
    from numba.core import cgutils
    from numba.extending import intrinsic

    def as_pointer(context: Any, address: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return builder.inttoptr(arguments[0], cgutils.voidptr_t)

        return types.voidptr(types.int64), generate

    return intrinsic(as_pointer)


@kernel
def table_at(address: int, count: int) -> Any:
    """Return the table of so many arrays that is at an address."""
    return carray(_pointer(address), (count, 4), np.int64)


@kernel
def numbers(row: Row) -> Any:
    """Return the array of a row: numbers along one axis."""
    return carray(_pointer(row[0]), (row[1],), np.float64)


@kernel
def matrix(row: Row) -> Any:
    """Return the array of a row: numbers along two axes."""
    return carray(_pointer(row[0]), (row[1], row[2]), np.float64)


@kernel
def cube(row: Row) -> Any:
    """Return the array of a row: numbers along three axes."""
    return carray(_pointer(row[0]), (row[1], row[2], row[3]), np.float64)


@kernel
def flags(row: Row) -> Any:
    """Return the array of a row: truth values."""
    return carray(_pointer(row[0]), (row[1],), np.bool_)


@kernel
def whole_numbers(row: Row) -> Any:
    """Return the array of a row: whole numbers."""
    return carray(_pointer(row[0]), (row[1],), np.int64)


@kernel
def whole_matrix(row: Row) -> Any:
    """Return the array of a row: whole numbers along two axes."""
    return carray(_pointer(row[0]), (row[1], row[2]), np.int64)


@kernel
def short_numbers(row: Row) -> Any:
    """Return the array of a row: 32-bit whole numbers."""
    return carray(_pointer(row[0]), (row[1],), np.int32)


@kernel
def short_matrix(row: Row) -> Any:
    """Return the array of a row: 32-bit whole numbers along two axes."""
    return carray(_pointer(row[0]), (row[1], row[2]), np.int32)


@kernel
def corner_numbers(row: Row) -> Any:
    """Return the array of a row: 16-bit whole numbers along two axes."""
    return carray(_pointer(row[0]), (row[1], row[2]), np.uint16)


@kernel
def car_rows(row: Row) -> Any:
    """Return the array of a row: of type CAR."""
    return carray(_pointer(row[0]), (row[1],), CAR)


@kernel
def link_rows(row: Row) -> Any:
    """Return the array of a row: of type LINK."""
    return carray(_pointer(row[0]), (row[1],), LINK)


@kernel
def tire_rows(row: Row) -> Any:
    """Return the array of a row: of type TIRE."""
    return carray(_pointer(row[0]), (row[1],), TIRE)


@kernel
def gear_rows(row: Row) -> Any:
    """Return the array of a row: of type GEAR."""
    return carray(_pointer(row[0]), (row[1],), GEAR)


@kernel
def timer_rows(row: Row) -> Any:
    """Return the array of a row: of type LAP_TIMER."""
    return carray(_pointer(row[0]), (row[1],), LAP_TIMER)


@kernel
def odometry_rows(row: Row) -> Any:
    """Return the array of a row: of type ODOMETRY."""
    return carray(_pointer(row[0]), (row[1],), ODOMETRY)


@kernel
def statistics_rows(row: Row) -> Any:
    """Return the array of a row: of type STATISTICS."""
    return carray(_pointer(row[0]), (row[1],), STATISTICS)
