"""Many worlds, each drawn from its own seed, driven by a controller on all cores or on a cluster.

    result = rollout("oval", n=1024, randomize={"mu": (0.6, 1.2)}, laps=1)
    print(result["mu"], result["first_lap_s"], result.summary()["end_reasons"])
    alone = race(result.setup(17))  # the same world, bit for bit

A world's result is the same, bit for bit, whatever n, the chunk, the number of workers and the engine are.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .. import from_addons
from ..arguments import explain_class
from ..course.course import Course
from ..errors import SettingsError, accepted_names
from ..messages import require_whole
from ..racing.opponents import Opponents
from ..racing.planners import Value, split_controller
from ..racing.randomization import Randomization, world_seeds
from ..racing.resolved import ground_of
from ..racing.setup import OF_A_CAR, OF_A_COURSE, OF_A_DRIVER, Setup, SetupKeywords
from .chunk_store import ChunkStore, FolderStore, MemoryStore, TemporaryFolderStore
from .job import RolloutJob, versions
from .local import drive_in_processes, drive_in_threads
from .rollout_result import RolloutResult, gather
from .store import claimed
from .workers import time_left, usable_cores

if TYPE_CHECKING:
    from typing_extensions import Unpack


EXECUTORS = ("threads", "processes", "ray")
DEFAULT_WORLDS = 1024

_USABLE = (*OF_A_CAR, *OF_A_DRIVER, *OF_A_COURSE, "start", "seed", "laps", "time_limit", "grid", "decision_limit")


@explain_class
@dataclass(frozen=True, kw_only=True)
class Executor:
    """The place where worlds are driven, and the memory that this may take.

    Raises:
      SettingsError: an unknown kind, or numbers that are none.
    """

    kind: str = "threads"  # of this process; "processes", each of which a planner can end; or "ray", on a cluster
    chunk: int = 64  # worlds that a worker drives together, at most; a folder that is gone on with keeps its own
    memory_budget: int = 2**30  # [bytes] that telemetry, states or scans may take; what might take more goes to disk

    def __post_init__(self) -> None:
        if self.kind not in EXECUTORS:
            raise SettingsError(f"executor is {self.kind!r}; {accepted_names(self.kind, EXECUTORS)}")
        require_whole("chunk", self.chunk, 1)
        require_whole("memory_budget", self.memory_budget, 0)


@explain_class
@dataclass(frozen=True, kw_only=True)
class RolloutProgress:
    """Progress of a rollout, for `watch`."""

    worlds: int
    worlds_found: int  # in the folder, driven by an earlier call
    worlds_driven: int  # by this call
    world_seconds: float  # [s] simulated by this call; of chunks under way by threads only
    wall_time_s: float

    @property
    def rate(self) -> float:
        """World-seconds per second."""
        return self.world_seconds / self.wall_time_s if self.wall_time_s > 0.0 else 0.0

    @property
    def remaining_s(self) -> float | None:
        """Expected time to the end [s]; None before the first chunk is finished."""
        return time_left(self.worlds, self.worlds_found, self.worlds_driven, self.wall_time_s)


def rollout(
    track: Setup | Course | str | Sequence[Course | str],
    controller: str | None = None,
    *,
    n: int | None = None,
    seeds: Sequence[int] | NDArray[np.integer] | None = None,
    randomize: Mapping[str, Any] | None = None,
    record: str = "summary",
    out: str | Path | None = None,
    workers: int | None = None,
    executor: Executor | str = "threads",
    watch: Callable[[RolloutProgress], None] | None = None,
    **keywords: Unpack[SetupKeywords],
) -> RolloutResult:
    """Drive many worlds and return how they went.

    A world that crashes, or in which the planner or the engine fails, ends with its reason; the others go on. Ctrl-C
    raises KeyboardInterrupt once the workers have stopped; finished chunks are then in `out`, and the same call goes on
    with the others.

    Args:
      track: one or more, as `load_track` takes them; world i drives `track[i % len(track)]`. Or a whole Setup.
      controller: a bundled name or `path/to/file.py:ClassName`, with settings in brackets where wanted, as
        `gap_finder[lookahead=8]`; each world gets a controller of its own.
      n: how many worlds; None: as many as `seeds`, else 1024.
      seeds: the seeds of the worlds themselves; None: drawn from the setup's `seed`, each by its number only.
      randomize: parameters that differ from world to world: names of `randomization.PARAMETERS`, or `planner.SETTING`,
        and for each `(low, high)`, a list of values, one value for all, or any of these as text: "0.6:1.2", "1|2|3".
        A parameter that is drawn may not be set for all worlds as well.
      record: "summary", "telemetry" (each tick of each world too), "states" (and its state and controls), or "scans":
        of each tick the scan and odometry that the planner was given, and its command, see `read_dataset`; "scans:10"
        keeps every tenth beam.
      out: a new or empty folder, or one of the same rollout, which is then finished.
      workers: threads or processes, or with Ray cores; None: as many as there are.
      executor: "threads", "processes" or "ray", or an Executor, which says more. With "processes" a planner can end
        its process with no harm but to its own world, which ends as "worker_died"; a script that uses them needs
        `if __name__ == "__main__":`.
      watch: called several times a second, and after each chunk.
      keywords: of a Setup, see there. `laps` None is one, or as many as fit the `time_limit`. Planners are not told
        what `randomize` draws. `opponents` race against car 0 of each world, which the settings are about, with
        `start_s` the whole grid moves, and the results have how car 0 fared among them. A world goes on until each of
        its cars has finished or cannot go on. A planner that takes longer than `decision_limit` ends its world;
        threads look at it when the planner has answered, processes interrupt it.

    Raises:
      SettingsError, TrackError, ControllerError, RunFolderError: what cannot be driven; nothing has run then.
      MissingExtraError, EngineError: no Ray, or no cluster that can be worked with.
    """
    given: dict[str, Any] = dict(keywords) | ({} if controller is None else {"controller": controller})
    if isinstance(track, Setup):
        tracks, setup = None, Setup.of(track, caller="rollout", **given)
    else:
        tracks = list(track) if isinstance(track, Sequence) and not isinstance(track, str) else [track]
        setup = Setup.of(*tracks[:1], caller="rollout", **given)
    return rollout_setup(
        setup, tracks, n=n, seeds=seeds, randomize=randomize, record=record, out=out, workers=workers,
        executor=executor, watch=watch,
    )  # fmt: skip


def rollout_setup(
    setup: Setup,
    tracks: Sequence[Course | str] | None = None,
    *,
    n: int | None = None,
    seeds: Sequence[int] | NDArray[np.integer] | None = None,
    randomize: Mapping[str, Any] | None = None,
    record: str = "summary",
    out: str | Path | None = None,
    workers: int | None = None,
    executor: Executor | str = "threads",
    watch: Callable[[RolloutProgress], None] | None = None,
    values: Sequence[dict[str, Value]] = (),
) -> RolloutResult:
    """Drive many worlds of a setup, on several tracks in turn if they are given; else as `rollout`.

    `values` are those of each world, by the names of `randomize`, in place of draws from its seed.
    """
    how = executor if isinstance(executor, Executor) else Executor(kind=executor)
    if how.kind == "ray":
        from_addons.require_ray()
    require_whole("workers", workers, 1, optional=True)
    job = _job(setup, [setup.track] if tracks is None else tracks, n, seeds, randomize, record, how.chunk)
    job = replace(job, values=tuple(values))
    if how.kind == "ray" and any(":" in str(entry.controller) for entry in job.opponents.entries):
        raise SettingsError("executor is 'ray' with an opponent of a file; accepted: bundled ones, or another executor")
    job = job.checked()
    cores = workers or usable_cores()
    trace = job.trace_bytes()
    # no worker is to be idle, and what is being driven is to fit the budget too
    fitting = max(how.memory_budget // (cores * trace), 1) if trace else how.chunk
    job = replace(job, chunk=min(how.chunk, -(-len(job.seeds) // cores), fitting))
    if out is not None:
        folder = FolderStore(out)
        with claimed(folder):
            job = replace(job, chunk=folder.open(job.settings(), versions(), job.chunk, job.tracks))
            result = _drive(job, folder, how.kind, workers, watch)
            if not folder.finished:
                folder.finish(result.summary(), result.as_csv())
        return result
    fits = trace * len(job.seeds) <= how.memory_budget
    return _drive(job, MemoryStore() if fits else TemporaryFolderStore(), how.kind, workers, watch)


def _job(
    setup: Setup,
    tracks: Sequence[Course | str],
    n: int | None,
    seeds: Any,
    randomize: Mapping[str, Any] | None,
    record: str,
    chunk: int,
) -> RolloutJob:
    """Return the worlds to be driven; arguments and errors are those of `rollout`."""
    setup.require_usable("a rollout", *_USABLE)
    base = setup.drive_settings
    source, own = split_controller(setup.first.controller, base.planner_settings)
    grounds = [ground_of(setup, each) for each in tracks]
    return RolloutJob(
        base=replace(base, planner_settings=own, seed=0),
        tracks=tuple(ground.course for ground in grounds),
        controller=source,  # type: ignore[arg-type]  # an object is refused by `check`
        seed=setup.first.seed if seeds is None else None,
        seeds=_seeds(n, setup.first.seed, seeds),
        randomization=Randomization.of(randomize),
        laps=1 if setup.laps is None and setup.time_limit is None else setup.laps,
        time_limit=setup.time_limit,
        decision_limit=setup.decision_limit,
        record=record,
        chunk=chunk,
        obstacles=tuple(ground.boxes for ground in grounds),
        opponents=Opponents.of(setup),
    )


def _drive(
    job: RolloutJob,
    store: ChunkStore,
    kind: str,
    workers: int | None,
    watch: Callable[[RolloutProgress], None] | None,
) -> RolloutResult:
    """Drive the chunks that the store has not, and return how all worlds went."""
    started, driven, world_seconds, kept = time.perf_counter(), 0, 0.0, store.numbers()
    missing = [number for number in range(len(job.chunks)) if number not in kept]
    found = len(job.seeds) - sum(len(job.chunks[number]) for number in missing)

    def pulse(under_way: float) -> None:
        if watch is not None:
            progress = RolloutProgress(
                worlds=len(job.seeds), worlds_found=found, worlds_driven=driven,
                world_seconds=world_seconds + under_way, wall_time_s=time.perf_counter() - started,
            )  # fmt: skip
            watch(progress)

    if missing:
        own = {"threads": drive_in_threads, "processes": drive_in_processes}
        drive = from_addons.drive_on_ray if kind == "ray" else own[kind]
        with closing(drive(job, missing, workers=workers, pulse=pulse)) as finished:
            for number, arrays in finished:
                store.add(number, arrays)
                driven += len(arrays["worlds"])
                world_seconds += float(arrays["worlds"]["sim_time_s"].sum())
                pulse(0.0)
    return gather(
        job, store, worlds_driven=driven, world_seconds_driven=world_seconds, wall_time_s=time.perf_counter() - started
    )


def _seeds(n: int | None, seed: int, seeds: Any) -> NDArray[np.int64]:
    require_whole("n", n, 1, optional=True)
    require_whole("seed", seed, 0)
    if seeds is None:
        return world_seeds(seed, n or DEFAULT_WORLDS)
    given = np.asarray(seeds)
    if given.ndim != 1 or len(given) == 0 or given.dtype.kind not in "iu" or given.min() < 0 or given.max() >= 2**63:
        raise SettingsError("seeds are not valid; accepted: one row of whole numbers from 0, below 2^63")
    if n is not None and n != len(given):
        raise SettingsError(f"n is {n} and there are {len(given)} seeds; accepted: one of them, or as many")
    return given.astype(np.int64)
