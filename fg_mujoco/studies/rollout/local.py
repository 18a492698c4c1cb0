"""Drives the chunks of a rollout in threads of this process. The engine leaves the GIL free most of the time."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Generator, Sequence

from ..worker_processes import usable_cores
from .job import TICK, Arrays, RolloutJob

PULSE = 0.1  # [s] between two looks at how far it is


def drive_in_threads(
    job: RolloutJob, chunks: Sequence[int], *, workers: int | None, pulse: Callable[[float], None]
) -> Generator[tuple[int, Arrays], None, None]:
    """Drive some chunks of a rollout and yield each, with its number, when it is finished.

    A generator that is closed ends the chunks that are being driven, and forgets them.

    Args:
      job: the rollout.
      chunks: their numbers.
      workers: threads; None: as many as this process has cores.
      pulse: told every PULSE how many world-seconds the chunks that are being driven have behind them, about.
    """
    crew = _Crew(job, chunks)
    threads = [
        threading.Thread(target=crew.work, name=f"rollout-{i}", daemon=True)  # so that a second Ctrl-C ends it all
        for i in range(min(workers or usable_cores(), len(chunks)))
    ]
    try:
        for thread in threads:
            thread.start()
        for _ in chunks:
            number, finished = crew.next_finished(pulse)
            if isinstance(finished, BaseException):
                raise finished
            yield number, finished
    finally:
        crew.stopped.set()
        for thread in threads:
            if thread.ident is not None:
                thread.join()


class _Crew:
    """What the threads share: which chunk is next, how far each is, and what is finished."""

    def __init__(self, job: RolloutJob, chunks: Sequence[int]) -> None:
        self._job = job
        self._todo: queue.SimpleQueue[int] = queue.SimpleQueue()
        for number in chunks:
            self._todo.put(number)
        self._finished: queue.SimpleQueue[tuple[int, Arrays | BaseException]] = queue.SimpleQueue()
        self._driven: dict[int, float] = {}  # [s] of each chunk that is being driven
        self.stopped = threading.Event()

    def work(self) -> None:
        """Drive one chunk after the other."""
        while not self.stopped.is_set():
            try:
                number = self._todo.get_nowait()
            except queue.Empty:
                return
            try:
                arrays = self._job.drive(number, stop=self.stopped.is_set, watch=self._watch(number))
            except BaseException as error:
                self._finished.put((number, error))
                return
            if not self.stopped.is_set():
                self._finished.put((number, arrays))

    def next_finished(self, pulse: Callable[[float], None]) -> tuple[int, Arrays | BaseException]:
        """Wait for a chunk, or what was raised when it was driven."""
        while True:
            try:
                number, finished = self._finished.get(timeout=PULSE)
            except queue.Empty:
                pulse(sum(list(self._driven.values())))
                continue
            self._driven.pop(number, None)
            return number, finished

    def _watch(self, number: int) -> Callable[[int, int], None]:
        self._driven[number] = 0.0

        def watch(ticks: int, worlds: int) -> None:
            self._driven[number] += worlds * TICK

        return watch
