"""Drives the chunks of a rollout on this machine: in threads of this process, or in processes of their own.

The engine leaves the GIL free most of the time, so threads are as fast. A planner can end a process without ending the
rollout: where a worker dies, the worlds of its chunk are driven again one by one. The worlds whose worker dies then too
end as "worker_died"; the bits of the others are those that they have anywhere.
"""

from __future__ import annotations

import pickle
import threading
import warnings
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Future
from contextlib import closing
from dataclasses import dataclass
from functools import lru_cache

from .job import Arrays, RolloutJob, joined
from .workers import completed, usable_cores, work_off


def drive_in_threads(
    job: RolloutJob, chunks: Sequence[int], *, workers: int | None, pulse: Callable[[float], None]
) -> Generator[tuple[int, Arrays], None, None]:
    """Drive some chunks of a rollout and yield each, with its number, when it is finished.

    A generator that is closed ends the chunks that are being driven, and forgets them.

    Args:
      job: the rollout.
      chunks: their numbers.
      workers: threads; None: as many as this process has cores.
      pulse: called several times a second with the world-seconds of the chunks under way.
    """
    stopped, driven = threading.Event(), dict.fromkeys(chunks, 0.0)  # [s] of chunks that are not finished

    running: list[threading.Thread] = []

    def drive(number: int, future: Future[Arrays]) -> None:
        def watch(seconds: float) -> None:
            driven[number] += seconds

        try:
            future.set_result(job.drive(number, stop=stopped.is_set, watch=watch))
        except BaseException as error:
            future.set_exception(error)

    def start(number: int) -> Future[Arrays]:
        future: Future[Arrays] = Future()
        thread = threading.Thread(target=drive, args=(number, future), daemon=True)  # so that a second Ctrl-C ends it
        running.append(thread)
        thread.start()
        return future

    count = workers or usable_cores()
    try:
        for number, future in completed(
            start, chunks, room=lambda: count, pulse=lambda: pulse(sum(list(driven.values())))
        ):
            del driven[number]
            yield number, future.result()
    finally:
        stopped.set()
        for thread in running:
            thread.join()


def drive_in_processes(
    job: RolloutJob, chunks: Sequence[int], *, workers: int | None, pulse: Callable[[float], None]
) -> Generator[tuple[int, Arrays], None, None]:
    """Do as `drive_in_threads`, in processes, whose chunks do not say how far they are: `pulse` gets 0.

    Raises:
      EngineError: a worker could not be started, or the engine raised.
    """
    count, pickled, lost = workers or usable_cores(), pickle.dumps(job), list[int]()

    def driven(parts: Sequence[_Part]) -> Generator[tuple[_Part, Arrays | None], None, None]:
        return work_off(_Part.drive, parts, workers=count, pulse=lambda: pulse(0.0), died=_Part.died)

    with closing(driven([_Part(pickled, number, None) for number in chunks])) as finished:
        for part, arrays in finished:
            if arrays is None:
                lost.append(part.chunk)
            else:
                yield part.chunk, arrays
    for number in lost:
        worlds = job.chunks[number].tolist()
        with closing(driven([_Part(pickled, number, world) for world in worlds])) as finished:
            alone = {part.world: arrays for part, arrays in finished if arrays is not None}
        yield number, joined([alone[world] for world in worlds])


@dataclass(frozen=True, eq=False)
class _Part:
    """A chunk, or one world of it. It travels to a worker process."""

    pickled: bytes  # the rollout
    chunk: int
    world: int | None  # None: all of the chunk

    @property
    def job(self) -> RolloutJob:
        """The rollout: in a worker one object for all parts, so that worlds are built once."""
        return _unpickled(self.pickled)

    def __str__(self) -> str:
        if self.world is None:
            return f"chunk {self.chunk}"
        return f"world {self.world}, seed {self.job.seeds[self.world]}"

    def drive(self) -> Arrays | None:
        return self.job.drive(self.chunk, worlds=None if self.world is None else [self.world])

    def died(self, how: str) -> Arrays | None:
        """Return the rest of the work when the worker dies; None: not known yet."""
        if self.world is None:
            return None
        warnings.warn(f"{self}: {how}", UserWarning, stacklevel=2)
        return self.job.undriven(self.world, "worker_died")


@lru_cache(maxsize=1)
def _unpickled(job: bytes) -> RolloutJob:
    found: RolloutJob = pickle.loads(job)
    return found
