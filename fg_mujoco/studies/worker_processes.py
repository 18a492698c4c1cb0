"""Does items of work in worker processes, and yields each result when it is there.

Processes are used because planners written in Python would wait for each other in threads. Only the calling process
writes files. A worker gets an item, and returns what a function makes of it.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from pathlib import Path
from typing import Any, TypeVar

from ..errors import EngineError

_PULSE = 0.1  # [s] between two looks at how far it is

_Item = TypeVar("_Item")
_Answer = TypeVar("_Answer")


@dataclass(frozen=True)
class _Failure:
    """What a function raised, in one line."""

    said: str


def usable_cores() -> int:
    """Return how many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def work_off(
    function: Callable[[_Item], _Answer], items: Sequence[_Item], *, workers: int, pulse: Callable[[], None]
) -> Generator[tuple[_Item, _Answer], None, None]:
    """Yield each item with what the function makes of it, in the order in which they are done.

    Closing the generator ends the work under way.

    Args:
      function: a function of a module, which a worker process finds by its name.
      items: what it takes, one at a time; an error names an item as `str` does.
      workers: number of processes; with one, this process does the work.
      pulse: called several times a second.

    Raises:
      EngineError: the function raised an error, or a worker died.
    """
    count = min(workers, len(items))
    if count <= 1:
        for item in items:
            pulse()
            yield item, _answer(item, _call(function, item))
        return
    waiting = iter(items)
    crew: dict[Connection, tuple[SpawnProcess, _Item]] = {}
    try:
        with _ctrl_c_ignored():  # workers inherit it: Ctrl-C is for the process that asked for them
            for _, item in zip(range(count), waiting, strict=False):
                ours, process = _start(function)
                crew[ours] = process, item
        for ours, (_, item) in crew.items():
            ours.send(item)
        while crew:
            ready = wait(list(crew), timeout=_PULSE)
            for ours in [connection for connection in crew if connection in ready]:
                process, item = crew[ours]
                try:
                    received = ours.recv()
                except EOFError:
                    process.join()
                    raise EngineError(f"{item}: the worker ended with exit code {process.exitcode}") from None
                answer: _Answer = _answer(item, received)
                following = next(waiting, None)
                if following is not None:
                    ours.send(following)
                    crew[ours] = process, following
                else:
                    del crew[ours]
                    ours.close()  # which ends the worker
                    process.join()
                yield item, answer
            pulse()
    finally:
        for process, _ in crew.values():
            process.terminate()
        for ours, (process, _) in crew.items():
            process.join()
            ours.close()


def _call(function: Callable[[Any], Any], item: Any) -> Any:
    try:
        return function(item)
    except Exception as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        said = " ".join(f"{type(error).__name__}: {error}".split())
        return _Failure(f"{said} ({Path(place.filename).name}, line {place.lineno})")


def _answer(item: Any, answer: Any) -> Any:
    if isinstance(answer, _Failure):
        raise EngineError(f"{item}: {answer.said}")
    return answer


def _start(function: Callable[[Any], Any]) -> tuple[Connection, SpawnProcess]:
    context = multiprocessing.get_context("spawn")  # a fork of a process with threads may hang
    ours, theirs = context.Pipe()
    process = context.Process(target=_work, args=(function, theirs), daemon=True)
    process.start()
    theirs.close()
    return ours, process


def _work(function: Callable[[Any], Any], items: Connection) -> None:
    """Do one item after the other, in a worker."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    sys.stdout = sys.stderr  # what is printed on the way is not our output
    while True:
        try:
            item = items.recv()
        except EOFError:
            return
        items.send(_call(function, item))


@contextmanager
def _ctrl_c_ignored() -> Iterator[None]:
    """Ignore Ctrl-C for a moment; only the main thread can."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
