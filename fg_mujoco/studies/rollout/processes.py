"""Drives the chunks of a rollout in processes of their own, which a planner can end without ending the rollout.

Where a worker dies, the worlds of its chunk are driven again one by one. The worlds whose worker dies then too end as
"worker_died"; the bits of the others are those that they have anywhere.
"""

from __future__ import annotations

import pickle
import warnings
from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import lru_cache

from ..worker_processes import usable_cores, work_off
from .job import Arrays, RolloutJob, joined


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
        """Return what is left when the worker dies; None: not known yet."""
        if self.world is None:
            return None
        warnings.warn(f"{self}: {how}", UserWarning, stacklevel=2)
        return self.job.undriven(self.world, "worker_died")


@lru_cache(maxsize=1)
def _unpickled(job: bytes) -> RolloutJob:
    found: RolloutJob = pickle.loads(job)
    return found


def drive_in_processes(
    job: RolloutJob, chunks: Sequence[int], *, workers: int | None, pulse: Callable[[float], None]
) -> Generator[tuple[int, Arrays], None, None]:
    """Drive some chunks of a rollout and yield each, with its number, when it is finished.

    A generator that is closed ends the chunks that are being driven, and forgets them.

    Args:
      job: the rollout.
      chunks: their numbers.
      workers: processes; None: as many as this process has cores.
      pulse: called every now and then, with 0: chunks that are being driven do not say how far they are.

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
        alone: dict[int | None, Arrays] = {}
        with closing(driven([_Part(pickled, number, world) for world in job.chunks[number].tolist()])) as finished:
            for part, arrays in finished:
                assert arrays is not None
                alone[part.world] = arrays
        yield number, joined([alone[world] for world in job.chunks[number].tolist()])
