"""Drives the runs of a comparison in processes of their own: in threads, planners written in Python would wait.

The calling process alone writes; a worker gets a run, and answers its row and trace.
"""

from __future__ import annotations

import multiprocessing
import signal
import sys
import threading
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess

from .comparison_run import Run, RunRow
from .errors import EngineError
from .messages import FloatArray

_PULSE = 0.1  # [s] between two looks at how far it is

Finished = tuple[RunRow, FloatArray]


def drive_runs(runs: Sequence[Run], *, workers: int, pulse: Callable[[], None]) -> Generator[Finished, None, None]:
    """Drive runs and yield each when it is finished. A generator that is closed ends those that are being driven.

    Args:
      runs: to be driven.
      workers: processes; one: this one.
      pulse: called several times a second.

    Raises:
      EngineError: a worker died.
    """
    count = min(workers, len(runs))
    if count <= 1:
        for run in runs:
            pulse()
            yield run.drive()
        return
    waiting = iter(runs)
    crew: dict[Connection, tuple[SpawnProcess, Run]] = {}
    try:
        with _ctrl_c_ignored():  # workers inherit it: Ctrl-C is for the process that asked for them
            for _, run in zip(range(count), waiting, strict=False):
                ours, process = _start()
                crew[ours] = process, run
        for ours, (_, run) in crew.items():
            ours.send(run)
        while crew:
            ready = wait(list(crew), timeout=_PULSE)
            for ours in [connection for connection in crew if connection in ready]:
                process, run = crew[ours]
                try:
                    finished: Finished = ours.recv()
                except EOFError:
                    process.join()
                    raise EngineError(
                        f"the worker that drove {run.key.controller} on {run.key.course}, seed {run.key.seed}, ended "
                        f"with exit code {process.exitcode}; finished runs are kept"
                    ) from None
                following = next(waiting, None)
                if following is not None:
                    ours.send(following)
                    crew[ours] = process, following
                else:
                    del crew[ours]
                    ours.close()  # which ends the worker
                    process.join()
                yield finished
            pulse()
    finally:
        for process, _ in crew.values():
            process.terminate()
        for ours, (process, _) in crew.items():
            process.join()
            ours.close()


def _start() -> tuple[Connection, SpawnProcess]:
    context = multiprocessing.get_context("spawn")  # a fork of a process with threads may hang
    ours, theirs = context.Pipe()
    process = context.Process(target=_work, args=(theirs,), daemon=True)
    process.start()
    theirs.close()
    return ours, process


def _work(runs: Connection) -> None:
    """Drive one run after the other, in a worker."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    sys.stdout = sys.stderr  # what a planner prints is not our output
    while True:
        try:
            run: Run = runs.recv()
        except EOFError:
            return
        runs.send(run.drive())


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
