"""Whose turn it is in a worker process, for when it dies: the planner that was building or deciding then has ended it.

with Turn(path, limit=1.0) as turn:
    race_setup(setup, turn=turn)

read_turn(path)  # in another process: 1, where the planner of car 1 has ended that one
"""

from __future__ import annotations

import mmap
import multiprocessing
import signal
from contextlib import suppress
from pathlib import Path

_LAST_RESORT = 60.0  # [s] of processor time beyond the limit: first decisions compile kernels


class Turn:
    """Writes to a file whose planner works, where it is read after it has ended the process.

    In a worker process it also sets a last resort for planners that no signal interrupts, as an endless loop in C: the
    process ends by SIGVTALRM after a minute of processor time.

    Args:
      path: of the file; empty: it is written nowhere.
      limit: of a decision [s].

    Attributes:
      car: whose turn it is; None: nobody's yet.
    """

    def __init__(self, path: str, limit: float | None) -> None:
        self.car: int | None = None
        self._path, self._shared = path, None if not path else _shared_byte(path)
        in_worker = multiprocessing.parent_process() is not None and hasattr(signal, "setitimer")
        self._longest = limit + _LAST_RESORT if limit is not None and in_worker else 0.0

    def __enter__(self) -> Turn:
        return self

    def __call__(self, car: int) -> None:
        """Say that it is the turn of a car's planner."""
        self.car = car
        if self._shared is not None:
            self._shared[0] = car + 1
        if self._longest:
            signal.setitimer(signal.ITIMER_VIRTUAL, self._longest)

    def __exit__(self, *exception: object) -> None:
        if self._longest:
            signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        if self._shared is not None:
            self._shared.close()
            Path(self._path).unlink(missing_ok=True)


def _shared_byte(path: str) -> mmap.mmap:
    with open(path, "w+b") as file:
        file.write(b"\0")
        file.flush()
        return mmap.mmap(file.fileno(), 1)


def stuck(how: str, limit: float | None) -> str | None:
    """Return what is said of a planner whose process ended by the last resort of a Turn; None: it ended otherwise."""
    if limit is None or "SIGVTALRM" not in how:
        return None
    return f"no command within {limit:g} s, and nothing interrupted it"


def read_turn(path: str) -> int | None:
    """Return the car whose planner worked when its process ended, by the file of its Turn; None: it is not known."""
    content = b""
    with suppress(OSError):
        content = Path(path).read_bytes()
        Path(path).unlink(missing_ok=True)
    return content[0] - 1 if content and content[0] else None
