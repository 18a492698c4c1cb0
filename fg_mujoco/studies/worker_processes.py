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
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from pathlib import Path
from typing import Any, TypeVar

from ..errors import EngineError
from ..simulation.planner_failure import one_line

_PULSE = 0.1  # [s] between two looks at how far it is

_Item = TypeVar("_Item")
_Answer = TypeVar("_Answer")
_READY = "ready"  # what a worker says before it takes an item


@dataclass(frozen=True)
class _Failure:
    """What a function raised, in one line."""

    said: str


@dataclass(eq=False)
class _Worker:
    """A worker process, and the item that it has or is to get."""

    process: SpawnProcess
    item: Any
    ready: bool = False


def usable_cores() -> int:
    """Return how many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def work_off(
    function: Callable[[_Item], _Answer],
    items: Sequence[_Item],
    *,
    workers: int,
    pulse: Callable[[], None],
    died: Callable[[_Item, str], _Answer] | None = None,
) -> Generator[tuple[_Item, _Answer], None, None]:
    """Yield each item with what the function makes of it, in the order in which they are done.

    Closing the generator ends the work under way.

    Args:
      function: a function of a module, which a worker process finds by its name.
      items: what it takes, one at a time; an error names an item as `str` does.
      workers: number of processes; with one, and without `died`, this process does the work.
      pulse: called several times a second.
      died: answers an item whose worker died, with how it ended in words; another worker goes on with the next item.
        None: this is an error.

    Raises:
      EngineError: the function raised an error, a worker could not start, or one died.
    """
    count = min(workers, len(items))
    if count <= 1 and died is None:
        for item in items:
            pulse()
            yield item, _answer(item, _call(function, item))
        return
    waiting = iter(items)
    crew: dict[Connection, _Worker] = {}
    try:
        for _, item in zip(range(count), waiting, strict=False):
            _start(function, item, crew)
        while crew:
            ready = wait(list(crew), timeout=_PULSE)
            for ours in [connection for connection in crew if connection in ready]:
                worker = crew[ours]
                item, alive = worker.item, True
                try:
                    received = ours.recv()
                    if not worker.ready:
                        worker.ready = True
                        ours.send(item)
                        continue
                except (EOFError, OSError):
                    alive = False
                    del crew[ours]
                    ours.close()
                    worker.process.join()
                    how = f"the worker ended {_ending(worker.process.exitcode)}"
                    if not worker.ready:
                        script = "a script that calls this under `if __name__ == '__main__':`"
                        raise EngineError(f"{item}: {how} before it began; accepted: {script}") from None
                    if died is None:
                        raise EngineError(f"{item}: {how}") from None
                    answer = died(item, how)
                else:
                    answer = _answer(item, received)
                following = next(waiting, None)
                if following is not None and alive:
                    worker.item = following
                    with suppress(OSError):  # it died meanwhile, which is told when it is heard
                        ours.send(following)
                elif following is not None:
                    _start(function, following, crew)
                elif alive:
                    del crew[ours]
                    ours.close()  # which ends the worker
                    worker.process.join()
                yield item, answer
            pulse()
    finally:
        for worker in crew.values():
            worker.process.terminate()
        for ours, worker in crew.items():
            worker.process.join()
            ours.close()


def _ending(exit_code: int | None) -> str:
    """Return how a process ended, in words."""
    if exit_code is not None and exit_code < 0:
        with suppress(ValueError):
            return f"by {signal.Signals(-exit_code).name}"
    return f"with exit code {exit_code}"


def _call(function: Callable[[Any], Any], item: Any) -> Any:
    try:
        return function(item)
    except Exception as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        return _Failure(f"{one_line(error)} ({Path(place.filename).name}, line {place.lineno})")


def _answer(item: Any, answer: Any) -> Any:
    if isinstance(answer, _Failure):
        raise EngineError(f"{item}: {answer.said}")
    return answer


def _start(function: Callable[[Any], Any], item: Any, crew: dict[Connection, _Worker]) -> None:
    """Let another worker join the crew, which is to get an item first."""
    context = multiprocessing.get_context("spawn")  # a fork of a process with threads may hang
    ours, theirs = context.Pipe()
    process = context.Process(target=_work, args=(function, theirs), daemon=True)
    with _ctrl_c_ignored():  # the worker inherits it: Ctrl-C is for the process that asked for it
        process.start()
    theirs.close()
    crew[ours] = _Worker(process, item)


def _work(function: Callable[[Any], Any], items: Connection) -> None:
    """Do one item after the other, in a worker."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    sys.stdout = sys.stderr  # what is printed on the way is not our output
    items.send(_READY)
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
