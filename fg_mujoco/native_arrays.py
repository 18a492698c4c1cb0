"""Arrays as the native core takes them: many as one argument, and rows of structured arrays as objects of Python.

    table = ArrayTable(("commands", "running"), {"commands": commands, "running": running})
    core.drive_all(np.array([table.address]))

The native core makes views of the arrays of a table again, which costs nothing; to take fifty arrays over from Python
takes longer than what is done with them. Arrays must be contiguous, and the table keeps them alive.

    memory = views(np.zeros(1, np.dtype([("point", np.int64), ("places", np.float64, (4, 2))])))[0]
    memory.point = 3
    memory.places[0, 1]

Fields of such an object are attributes, and reading one takes a tenth of numpy's time. It is a view: it reads and
writes the array, which it keeps alive. The native core takes it for the record that it is. A field of numbers along
axes is an array of numpy; a field that the type does not have is an AttributeError.
"""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from functools import cache
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


def views(rows: NDArray[np.void]) -> list[Any]:
    """Return the rows of a contiguous structured array (n,) as objects that view them."""
    return list((_structure(rows.dtype) * len(rows)).from_buffer(rows.data)) if len(rows) else []


@cache
def _structure(dtype: np.dtype[Any]) -> type[ctypes.Structure]:
    """Return the structure of ctypes with the fields of a type, at the same offsets."""
    fields: list[tuple[str, Any]] = []
    members: dict[str, Any] = {"__slots__": (), "_pack_": 1, "_layout_": "ms"}
    end = 0
    for name, (kind, offset, *_) in sorted((dtype.fields or {}).items(), key=lambda each: each[1][1]):
        if offset > end:
            fields.append((f"_padding_{end}", ctypes.c_char * (offset - end)))
        base, shape = kind.subdtype or (kind, ())
        kept = name
        if shape and base.names is None:
            kept = f"_{name}"
            members[name] = _array(kept)
        fields.append((kept, _place(base, shape)))
        end = offset + kind.itemsize
    if dtype.itemsize > end:
        fields.append((f"_padding_{end}", ctypes.c_char * (dtype.itemsize - end)))
    return type("Record", (ctypes.Structure,), members | {"_fields_": fields})


def _place(base: np.dtype[Any], shape: tuple[int, ...]) -> Any:
    """Return the type in ctypes of a field."""
    of: Any = np.ctypeslib.as_ctypes_type(base) if base.names is None else _structure(base)
    for length in reversed(shape):
        of = of * length
    return of


def _array(kept: str) -> property:
    """Return the property that is the array of numpy in a field."""

    def read(record: Any) -> Any:
        return np.asarray(getattr(record, kept))

    def write(record: Any, values: Any) -> None:
        np.asarray(getattr(record, kept))[...] = values

    return property(read, write)
