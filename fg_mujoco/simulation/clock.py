"""The clock of time.perf_counter, for kernels."""

from __future__ import annotations

import ctypes
import time
from typing import Any

from ..compiled.kernels import kernel, numbas

_WITH_ROOM, _PLAIN = "PyTime_PerfCounterRaw", "_PyTime_GetPerfCounter"  # since Python 3.13, and before

HAS_CLOCK = hasattr(ctypes.pythonapi, _WITH_ROOM) or hasattr(ctypes.pythonapi, _PLAIN)
"""Whether kernels can read the clock."""


@numbas(time.perf_counter_ns)
def _nanoseconds() -> Any:
    """Return the function that reads the clock [ns]."""
    from llvmlite.ir import FunctionType, IntType
    from numba.core import cgutils
    from numba.extending import intrinsic
    from numba.types import int64

    def nanoseconds(typing: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            number, status = IntType(64), IntType(32)
            if not hasattr(ctypes.pythonapi, _WITH_ROOM):
                plain = cgutils.get_or_insert_function(builder.module, FunctionType(number, ()), _PLAIN)
                return builder.call(plain, ())
            room = cgutils.alloca_once(builder, number)
            kind = FunctionType(status, (number.as_pointer(),))
            builder.call(cgutils.get_or_insert_function(builder.module, kind, _WITH_ROOM), (room,))
            return builder.load(room)

        return int64(), generate

    return intrinsic(nanoseconds)


@kernel
def seconds() -> float:
    """Return the time of the clock [s]."""
    now: float = 1e-9 * _nanoseconds()
    return now
