"""Many worlds, each drawn from its own seed, driven by a controller on all cores or on a cluster.

    result = rollout("oval", n=1024, randomize={"mu": (0.6, 1.2)}, laps=1)
    print(result["mu"], result["first_lap_s"], result.summary()["end_reasons"])
    alone = result.scenario(17)  # the same world, to be driven by `race`

A world's result is the same, bit for bit, whatever n, the chunk, the number of workers and the engine are.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...arguments import explain_class
from ...course.course import Course
from ...errors import SettingsError, accepted_names
from ...lidar.effects import LidarEffects
from ...messages import require_whole
from ...racing.entries import Entry
from ...racing.opponents import Opponents, entry_of
from ...racing.planner_choice import split_controller
from ...simulation.course_loading import load_track
from ...simulation.settings import FASTEST, DriveSettings, Start
from ...vehicle.changes import CarChanges
from ...vehicle.friction_patches import Patch
from ...vehicle.tires import Tires
from ...vehicle.vehicle import DEFAULT_VEHICLE, Vehicle
from ..run_grid import time_left
from ..store import claimed
from ..workers import usable_cores
from .chunk_store import ChunkStore, FolderStore, MemoryStore, TemporaryFolderStore
from .job import RolloutJob, versions
from .local import drive_in_processes, drive_in_threads
from .randomization import Randomization, world_seeds
from .ray_cluster import drive_on_ray, require_ray
from .rollout_result import RolloutResult, gather

ENGINES = ("local", "processes", "ray")
DEFAULT_WORLDS = 1024
DEFAULT_CHUNK = 64
DEFAULT_MEMORY_BUDGET = 2**30  # [bytes]


@explain_class
@dataclass(frozen=True, kw_only=True)
class RolloutProgress:
    """What a rollout tells whoever watches it."""

    worlds: int
    worlds_found: int  # in the folder, driven by an earlier call
    worlds_driven: int  # by this call
    world_seconds: float  # [s] simulated by this call, about
    wall_time_s: float

    @property
    def rate(self) -> float:
        """World-seconds per second."""
        return self.world_seconds / self.wall_time_s if self.wall_time_s > 0.0 else 0.0

    @property
    def remaining_s(self) -> float | None:
        """What it will still take, if it goes on like this [s]; None before the first chunk is finished."""
        return time_left(self.worlds, self.worlds_found, self.worlds_driven, self.wall_time_s)


def rollout(
    tracks: Course | str | Sequence[Course | str],
    controller: str = "gap_finder",
    *,
    n: int | None = None,
    seed: int = 0,
    seeds: Sequence[int] | NDArray[np.integer] | None = None,
    randomize: Mapping[str, Any] | None = None,
    vehicle: Vehicle | str | Path = DEFAULT_VEHICLE,
    tires: Tires | str | Path | None = None,
    mu: float | None = None,
    changes: CarChanges | None = None,
    planner_mu: float | None = None,
    max_speed: float = FASTEST,
    planner_settings: Mapping[str, Any] | None = None,
    start: Start | None = None,
    patches: Sequence[Patch] = (),
    effects: LidarEffects | None = None,
    odometry_drift: float = 0.0,
    laps: int | None = None,
    duration: float | None = None,
    decision_limit: float | None = None,
    opponents: Sequence[Entry | str] = (),
    grid: str = "staggered",
    workers: int | None = None,
    record: str = "summary",
    out: str | Path | None = None,
    memory_budget: int = DEFAULT_MEMORY_BUDGET,
    chunk: int = DEFAULT_CHUNK,
    engine: str = "local",
    watch: Callable[[RolloutProgress], None] | None = None,
) -> RolloutResult:
    """Drive many worlds and return how they went.

    A world that crashes, or in which the planner or the engine fails, ends with its reason; the others go on. Ctrl-C
    raises KeyboardInterrupt once the workers have stopped; finished chunks are then in `out`, and the same call goes on
    with the others.

    Args:
      tracks: one or more, as `load_track` takes them; world i drives `tracks[i % len(tracks)]`.
      controller: a bundled name or `path/to/file.py:ClassName`, with settings in brackets where wanted, as
        `gap_finder[lookahead=8]`; each world gets a controller of its own.
      n: how many worlds; None: as many as `seeds`, else 1024.
      seed: the seeds of the worlds are drawn from it, each by its number only.
      seeds: the seeds of the worlds themselves, instead.
      randomize: parameters that differ from world to world: names of `randomization.PARAMETERS`, or `planner.SETTING`,
        and for each `(low, high)`, a list of values, one value for all, or any of these as text: "0.6:1.2", "1|2|3".
      vehicle: of all worlds, and so the next ten, as in `race`; none of them may be randomised as well.
      tires: a bundled set, the path of a TOML file, or Tires; None: the vehicle's.
      mu: friction coefficient of the tires, or the greatest peak of those with a curve.
      changes: what else differs from the vehicle's MJCF.
      planner_mu: friction coefficient that the planners assume; None: that of the tires as they are set, not as
        `randomize` draws them; inf: no limits.
      max_speed: fastest that a planner may command [m/s].
      planner_settings: settings of the planners that differ from their own.
      start: where and how the cars start; with opponents, car 0 counts from its place on the grid.
      patches: of the floor, on which the tires have another friction.
      effects: what the LiDAR does to a scan.
      odometry_drift: relative error of the speeds and the yaw rate that the planners are told.
      laps: to be driven; None: one, or as many as fit the duration.
      duration: of simulated time at most [s]; None: what a car of 0.5 m/s needs for the laps.
      decision_limit: of wall time that a planner may take for one decision [s]; None: any. A world whose planner
        takes longer ends as "decision_limit". Threads look at it when the planner has answered; the engine "processes"
        interrupts it, as `race` does.
      opponents: that car 0 of each world races against: entries as of `race`, or names of planners, each in a car
        that is set as car 0's. All settings before are car 0's, and so is what is randomised; with `start_s` the whole
        grid moves. The results are car 0's too, with how it fared among the others. A world goes on until each of its
        cars has finished or cannot go on.
      grid: "staggered" or "side_by_side": where opponents without a start of their own stand, behind car 0.
      workers: threads or processes, or with Ray cores; None: as many as there are.
      record: "summary", "telemetry" (each tick of each world too) or "states" (and its state and controls).
      out: a new or empty folder, or one of the same rollout, which is then finished.
      memory_budget: what telemetry and states may take; what might take more goes to disk: to `out`, else to a
        temporary folder that is gone with the result [bytes].
      chunk: worlds that a worker drives together, at most; a folder that is gone on with keeps its own.
      engine: "local", in threads of this process; "processes", each of which a planner can end with no harm but to its
        own world, which ends as "worker_died"; or "ray". A script that calls it with "processes" needs
        `if __name__ == "__main__":`.
      watch: called several times a second, and after each chunk.

    Raises:
      SettingsError, TrackError, ControllerError, RunFolderError: what cannot be driven; nothing has run then.
      MissingExtraError, EngineError: no Ray, or no cluster that can be worked with.
    """
    if engine not in ENGINES:
        raise SettingsError(f"engine is {engine!r}; {accepted_names(engine, ENGINES)}")
    if engine == "ray":
        require_ray()
    require_whole("workers", workers, 1, optional=True)
    require_whole("memory_budget", memory_budget, 0)
    several = isinstance(tracks, Sequence) and not isinstance(tracks, str)
    source, own = split_controller(controller, planner_settings)
    base = DriveSettings(
        vehicle=vehicle, tires=tires, mu=mu, changes=changes or CarChanges(), planner_mu=planner_mu,
        patches=patches, max_speed=max_speed, planner_settings=own, start=start or Start(),
        effects=effects or LidarEffects(), odometry_drift=odometry_drift,
    )  # fmt: skip
    car = base.car.parameters
    job = RolloutJob(
        base=base,
        tracks=tuple(load_track(track, car=car) for track in (tracks if several else [tracks])),  # type: ignore[arg-type,union-attr]
        controller=source,  # type: ignore[arg-type]  # an object is refused by `check`
        seed=seed if seeds is None else None,
        seeds=_seeds(n, seed, seeds),
        randomization=Randomization.of(randomize),
        laps=1 if laps is None and duration is None else laps,
        duration=duration,
        decision_limit=decision_limit,
        record=record,
        chunk=chunk,
        opponents=_opponents(opponents, base, controller, grid),
    )
    if engine == "ray" and any(":" in str(entry.controller) for entry in job.opponents.entries):
        raise SettingsError("engine is 'ray' with an opponent of a file; accepted: bundled ones, or another engine")
    job = job.checked()
    cores = workers or usable_cores()
    trace = job.trace_bytes()
    # no worker is to be idle, and what is being driven is to fit the budget too
    fitting = max(memory_budget // (cores * trace), 1) if trace else chunk
    job = replace(job, chunk=min(chunk, -(-len(job.seeds) // cores), fitting))
    if out is not None:
        folder = FolderStore(out)
        with claimed(folder):
            job = replace(job, chunk=folder.open(job.settings(), versions(), job.chunk, job.tracks))
            result = _drive(job, folder, engine, workers, watch)
            if not folder.finished:
                folder.finish(result.summary(), result.as_csv())
        return result
    fits = trace * len(job.seeds) <= memory_budget
    return _drive(job, MemoryStore() if fits else TemporaryFolderStore(), engine, workers, watch)


def _opponents(opponents: Sequence[Entry | str], base: DriveSettings, controller: str, grid: str) -> Opponents:
    first = entry_of(base, controller) if opponents else Entry()
    return Opponents.of(opponents, first=first, grid=grid)


def _drive(
    job: RolloutJob,
    store: ChunkStore,
    engine: str,
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
        drive = {"local": drive_in_threads, "processes": drive_in_processes, "ray": drive_on_ray}[engine]
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
        raise SettingsError("seeds are not what is accepted: one row of whole numbers from 0, below 2^63")
    if n is not None and n != len(given):
        raise SettingsError(f"n is {n} and there are {len(given)} seeds; accepted: one of them, or as many")
    return given.astype(np.int64)
