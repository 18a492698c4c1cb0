"""Does items of work wherever they can be started, and yields each result when it is there.

    for run, row in work_off(Run.drive, runs, workers=8, pulse=progress):
        folder.add(row)

An item is started by a function that returns a `concurrent.futures.Future`; `completed` keeps as many under way as
there is room for. `work_off` starts them in processes, because planners written in Python would wait for each other in
threads; `rollout.local` in threads, and the add-on learn on Ray. Only the calling process writes files.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from multiprocessing.context import SpawnContext, SpawnProcess
from pathlib import Path
from typing import Any, TypeVar

from ..errors import EngineError, SettingsError
from ..simulation.planner_failure import one_line

PULSE = 0.1  # [s] between two looks at how far it is

_Item = TypeVar("_Item")
_Answer = TypeVar("_Answer")


def time_left(runs: int, found: int, driven: int, elapsed: float) -> float | None:
    """Return the expected time for what is missing of some work [s]; None before the first is finished.

    Args:
      runs: of all the work.
      found: finished by an earlier call.
      driven: finished by this one.
      elapsed: what those took [s].
    """
    return (runs - found - driven) * elapsed / driven if driven else None


def usable_cores() -> int:
    """Return the number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def work_through(
    function: Callable[[_Item], _Answer],
    items: Sequence[_Item],
    keep: Callable[[_Item, _Answer], None],
    *,
    workers: int | None,
    watch: Callable[[int, float], None],
    died: Callable[[_Item, str], _Answer] | None = None,
) -> float:
    """Do all items, keep each answer when it is there, and return how long it took [s].

    Args:
      function: as of `work_off`.
      items: as of `work_off`.
      keep: takes an item and its answer.
      workers: number of processes; None: as many as there are cores; one: no other than this.
      watch: called several times a second with the number of items that are done, and the time since the start [s].
      died: as of `work_off`, of workers that are other processes.

    Raises:
      SettingsError, EngineError: as `work_off`.
    """
    started, done = time.perf_counter(), 0

    def pulse() -> None:
        watch(done, time.perf_counter() - started)

    died = None if workers == 1 else died
    with closing(work_off(function, items, workers=workers or usable_cores(), pulse=pulse, died=died)) as answers:
        for item, answer in answers:
            keep(item, answer)
            done += 1
            pulse()
    return time.perf_counter() - started


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
      SettingsError: the function raised one.
      EngineError: it raised another error, a worker could not start, or one died.
    """
    count = min(workers, len(items))
    if count <= 1 and died is None:
        for item in items:
            pulse()
            yield item, _answer(item, _call(function, item))
        return
    crew: list[_Worker] = []

    def start(item: _Item) -> Future[Any]:
        free = next((worker for worker in crew if worker.free), None)
        if free is None:
            crew.append(free := _Worker())
        return free.start(function, item)

    def look() -> None:
        for worker in crew:
            worker.bury()
        pulse()

    try:
        for item, future in completed(start, items, room=lambda: count, pulse=look):
            try:
                answer = _answer(item, future.result())
            except BrokenProcessPool:
                began, how = next(worker for worker in crew if worker.future is future).ending()
                if not began:
                    script = "a script that calls this under `if __name__ == '__main__':`"
                    raise EngineError(f"{item}: {how} before it began; accepted: {script}") from None
                if died is None:
                    raise EngineError(f"{item}: {how}") from None
                answer = died(item, how)
            yield item, answer
    finally:
        for worker in crew:
            worker.end()
        for worker in crew:
            worker.pool.shutdown()
            worker.bury()


def completed(
    start: Callable[[_Item], Future[_Answer]],
    items: Sequence[_Item],
    *,
    room: Callable[[], int],
    pulse: Callable[[], None],
) -> Iterator[tuple[_Item, Future[_Answer]]]:
    """Yield each item with its future when that is done.

    Args:
      start: starts an item.
      items: to be started, in this order.
      room: how many may be under way.
      pulse: called several times a second.
    """
    waiting, running = deque(items), dict[Future[_Answer], _Item]()
    finished: list[tuple[_Item, Future[_Answer]]] = []
    while waiting or running or finished:
        while waiting and len(running) < room():  # no worker waits until the caller has kept what is finished
            item = waiting.popleft()
            running[start(item)] = item
        yield from finished
        wait(running, timeout=PULSE, return_when=FIRST_COMPLETED)
        pulse()
        finished = [(running.pop(future), future) for future in list(running) if future.done()]
        finished.sort(key=lambda each: each[1].exception() is not None)  # an error loses nothing that is finished


class _Context(SpawnContext):
    """Starts a process as `spawn` does, because a fork of a process with threads may hang, and remembers it."""

    process: SpawnProcess

    def Process(self, *args: Any, **settings: Any) -> SpawnProcess:  # type: ignore[override]  # noqa: N802
        self.process = SpawnProcess(*args, daemon=True, **settings)
        return self.process


class _Worker:
    """A worker process: a pool of one, as all processes of a larger pool end when one of them dies."""

    def __init__(self) -> None:
        self.future: Future[Any] = Future()  # of its item
        self._context = _Context()
        self.pool = ProcessPoolExecutor(1, self._context, initializer=_begin)
        with _ctrl_c_ignored():  # the worker inherits it: Ctrl-C is for the process that asked for it
            self._began = self.pool.submit(os.getpid)

    @property
    def free(self) -> bool:
        """Whether it can take an item."""
        return self.future.done() and not isinstance(self.future.exception(), BrokenProcessPool)

    def start(self, function: Callable[[Any], Any], item: Any) -> Future[Any]:
        """Let it do an item once it has begun: a large one that nobody reads would block Python 3.10 for good."""
        self.future = future = Future[Any]()

        def give(began: Future[int]) -> None:
            try:
                began.result()
                self.pool.submit(_work, function, item).add_done_callback(answer)
            except Exception as error:
                future.set_exception(error)

        def answer(done: Future[Any]) -> None:
            error = done.exception()
            future.set_result(done.result()) if error is None else future.set_exception(error)

        self._began.add_done_callback(give)
        return future

    def ending(self) -> tuple[bool, str]:
        """Return whether it had begun before it died, and how it ended, in words."""
        self.pool.shutdown()
        return self._began.exception() is None, how_ended(self._context.process.exitcode)

    def bury(self) -> None:
        """If it has ended, end what a planner has forked in it, too: that would hold its pipes open."""
        process = self._context.process
        if process.exitcode is not None and process.pid is not None and hasattr(os, "killpg"):
            with suppress(OSError):
                os.killpg(process.pid, signal.SIGKILL)

    def end(self) -> None:
        """End it with its work; `pool.shutdown` then waits until it has ended."""
        if not self.future.done():
            self._context.process.terminate()


def how_ended(code: int | None) -> str:
    """Return how a worker process ended that has an exit code, in words."""
    if code is not None and code < 0:
        with suppress(ValueError):
            return f"the worker ended by {signal.Signals(-code).name}"
    return f"the worker ended with exit code {code}"


@dataclass(frozen=True)
class _Failure:
    """The error that a function raised, in one line."""

    said: str
    refused: bool  # whether it is of what the user gave


def _call(function: Callable[[Any], Any], item: Any) -> Any:
    try:
        return function(item)
    except SettingsError as error:
        return _Failure(str(error), refused=True)
    except Exception as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        return _Failure(f"{one_line(error)} ({Path(place.filename).name}, line {place.lineno})", refused=False)


def _answer(item: Any, answer: Any) -> Any:
    if isinstance(answer, _Failure):
        if answer.refused:
            raise SettingsError(answer.said)
        raise EngineError(f"{item}: {answer.said}")
    return answer


def _begin() -> None:
    """Begin a worker process, which ends when the process that started it is killed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(os, "setsid"):
        os.setsid()  # a group of its own, with all that it forks
    sys.stdout = sys.stderr  # what is printed on the way is not our output
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os.kill(os.getpid(), signal.SIGKILL)  # a planner that is deciding cannot hold it up


def _work(function: Callable[[Any], Any], item: Any) -> Any:
    """Do an item, in a worker process."""
    try:
        return _call(function, item)
    except SystemExit as error:  # ends the worker, not the process that waits for it
        os._exit(error.code if isinstance(error.code, int) else 1)


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
