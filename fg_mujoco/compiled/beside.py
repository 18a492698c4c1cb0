"""Compiles some kernels in another process while this one compiles others: the first race begins in half the time.

    with beside(compile_planners, setup):
        ...  # the first kernel that has to be compiled here starts a process that calls compile_planners(setup)

The process calls the function for the kernels that it needs, which are kept on disk. Where this process needs one that
is being compiled there, it waits (kernel_files.made_once). Whatever goes wrong there, they are compiled here.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

_PROGRAM = (
    "import sys; sys.path[:] = eval(sys.stdin.buffer.readline()); import pickle; "
    "function, arguments = pickle.load(sys.stdin.buffer); function(*arguments)"
)
_waiting: list[tuple[Callable[..., Any], tuple[Any, ...]]] = []


@contextmanager
def beside(function: Callable[..., Any], *arguments: Any) -> Iterator[None]:
    """Have another process call a function once this process compiles a kernel, if it does so in here.

    Args:
      function: of a module; what it returns, writes and raises is lost.
      arguments: that can be pickled.
    """
    call = function, arguments
    _waiting.append(call)
    try:
        yield
    finally:
        with suppress(ValueError):
            _waiting.remove(call)


def begin() -> None:
    """Start what waits; called as the first kernel is compiled."""
    import pickle
    import subprocess
    import threading

    while _waiting and (os.cpu_count() or 1) > 1 and sys.executable:
        call = _waiting.pop()
        with suppress(Exception):
            asked = repr(sys.path).encode() + b"\n" + pickle.dumps(call)
            process = subprocess.Popen(
                [sys.executable, "-c", _PROGRAM], stdin=subprocess.PIPE, stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )  # fmt: skip
            threading.Thread(target=process.communicate, args=(asked,), name="compiling", daemon=True).start()
