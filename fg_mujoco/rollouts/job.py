"""The work of a rollout: worlds by number, cut into chunks, each chunk driven on its own wherever there is a core.

World i depends on its seed and on its track, `tracks[i % len(tracks)]`, and on nothing else: not on how many worlds
there are, nor on the chunk. The worlds of a chunk are of one track, because those can be stepped together.
"""

from __future__ import annotations

import hashlib
import math
import platform
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..course.course import Course, Sites, laps_to_drive
from ..course.definitions import course_sha256
from ..course.files import kept_folder
from ..course.obstacles import Obstacle, described_obstacles
from ..errors import ControllerError, SettingsError
from ..messages import require_whole
from ..native import core
from ..package_files import package_files
from ..racing.entries import check_starts
from ..racing.opponents import Opponents, entry_of
from ..racing.planner_origin import Files, by_name, planner_files
from ..racing.planners import Value, build_controller, code_of, find_controller
from ..racing.randomization import OF_ENVIRONMENTS, Randomization
from ..racing.setup import require_decision_limit
from ..simulation.physics import STATE
from ..simulation.settings import DriveSettings, Scenario, require_laps, require_time_limit
from ..simulation.telemetry import TELEMETRY
from ..vehicle.changes import CarChanges
from .drive_worlds import WorldResults, drive_worlds, result_dtype, undriven_world
from .recording import Record, ScanLayout

TICK = 0.025  # [s] a period of the LiDAR, for estimates of what a rollout will take and has done

Arrays = dict[str, NDArray[Any]]
"""Results of a driven chunk, by name: "worlds" (n,) of `RolloutJob.world_dtype` and "lap_times_s" (n, k); if recorded
"ticks" (n,) and, of all its worlds one after the other, "telemetry" (ticks, len(TELEMETRY)); and "states", all states
in one row, with "state_size" (n,) and "ctrl" (ticks, 2) of each car; or "ticks" and "scans" (ticks,) of a
ScanLayout."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RolloutJob:
    """Worlds to be driven.

    Raises:
      SettingsError: when made, laps, duration, chunk or record that are not what is accepted.
    """

    tracks: tuple[Course, ...]
    controller: str  # as `drive_worlds` takes it
    seed: int | None  # that the seeds were drawn from; None: they were given
    seeds: NDArray[np.int64]  # (n,) of the worlds
    randomization: Randomization
    laps: int | None
    time_limit: float | None  # [s]
    record: str
    chunk: int  # worlds in one, at most
    base: DriveSettings = field(default_factory=DriveSettings)  # what is the same in all worlds
    decision_limit: float | None = None  # [s] of wall time for a decision; None: any
    obstacles: tuple[tuple[Obstacle, ...], ...] = ()  # on each track, in all worlds; none where they are drawn
    opponents: Opponents = field(default_factory=Opponents)  # that car 0 of each world races against
    files: Files = field(default_factory=dict)  # that the planners of car 0 read; none before `checked`
    values: tuple[dict[str, Value], ...] = ()  # of each world, in place of draws from its seed; none: these are drawn

    def __post_init__(self) -> None:
        require_laps(self.laps)
        require_whole("chunk", self.chunk, 1)
        require_time_limit(self)
        require_decision_limit(self)
        if self.laps is None and self.time_limit is None:
            raise SettingsError("neither laps nor time_limit is given; accepted: either or both")
        if any(self.obstacles) and self.randomization.most_obstacles:
            raise SettingsError("obstacles is given for all worlds and in randomize; accepted: one of them")
        Record.of(self.record)

    @kept_folder()
    def checked(self) -> RolloutJob:
        """Refuse what cannot be driven, before anything is; return the job with the files that its planners read.

        Raises:
          TrackError: a course that the car does not fit, or that no walls can be put round.
          ControllerError: a controller that cannot be built, with its settings at any end of their ranges too.
          SettingsError: no course, more laps than one has, a start that is not on it, or more obstacles than one has
            room for.
        """
        if not self.tracks:
            raise SettingsError("no track is given; accepted: one or more")
        self.randomization.require_usable("a rollout", OF_ENVIRONMENTS, "only environments draw it")
        self.randomization.check_base(self.base)
        car = self.base.car.parameters
        for track in self.tracks:
            track.check_car(car)
            laps_to_drive(track, self.laps)  # refuses more than a scene has
            self._check_starts(track)
        for track, sites in zip(self.tracks, self._sites, strict=True):
            wanted = self.randomization.most_obstacles
            if sites is not None and wanted > sites.most:
                raise SettingsError(f"randomize obstacles={wanted} on {track.name!r}; accepted: at most {sites.most}")
        if not isinstance(self.controller, str):
            raise ControllerError(
                f"controller {type(self.controller).__name__} is an object; accepted: a name or "
                "path/to/file.py:ClassName, for each world to have one of its own"
            )
        found, files = find_controller(self.controller), Files()
        context = self.base.context(car, self.tracks[0].map_line)
        for extreme in ({}, *self.randomization.planner_extremes):
            settings = {**self.base.planner_settings, **extreme}
            planner = build_controller(found, self.controller, context, settings)
            files |= planner_files(planner, settings)
        return replace(self, files=files, opponents=self._checked_opponents())

    @cached_property
    def chunks(self) -> tuple[NDArray[np.int64], ...]:
        """Numbers of the worlds of each chunk."""
        every = len(self.tracks)
        by_track = [np.arange(first, len(self.seeds), every) for first in range(every)]
        return tuple(own[i : i + self.chunk] for own in by_track for i in range(0, len(own), self.chunk))

    @cached_property
    def places(self) -> NDArray[np.int64]:
        """Chunk of each world, and its index there. Shape (n, 2)."""
        places = np.empty((len(self.seeds), 2), np.int64)
        for number, worlds in enumerate(self.chunks):
            places[worlds, 0], places[worlds, 1] = number, np.arange(len(worlds))
        return places

    @cached_property
    def world_dtype(self) -> np.dtype[Any]:
        """Type of a world's row: its number, that of its track, the drawn values and the results."""
        result = result_dtype(among=bool(self.opponents.entries))
        return np.dtype([("world", np.int64), ("track", np.int64), *self.randomization.dtypes(), *result.descr])

    def scenario(self, world: int, values: dict[str, Value] | None = None) -> Scenario:
        """Return world number `world`; `values` are those that were drawn for it, if they are known."""
        track, seed = world % len(self.tracks), int(self.seeds[world])
        values = self._drawn([world])[0] if values is None else values
        scenario = self.randomization.scenario(self.tracks[track], seed, values, self._sites[track], self.base)
        placed = self.obstacles[track] if self.obstacles else ()
        return replace(scenario, obstacles=placed) if placed else scenario

    def drive(
        self,
        number: int,
        *,
        controller: str | None = None,
        stop: Callable[[], bool] | None = None,
        watch: Callable[[float], None] | None = None,
        worlds: Sequence[int] | None = None,
    ) -> Arrays:
        """Drive a chunk in the calling thread and return what it leaves.

        Args:
          number: of the chunk.
          controller: where it is on this machine; None: where the job says.
          stop: as `drive_worlds` takes it; what an ended chunk leaves is not to be kept.
          watch: as `drive_worlds` takes it.
          worlds: of the chunk, those that are to be driven; None: all.
        """
        numbers = self.chunks[number].tolist() if worlds is None else list(worlds)
        drawn = self._drawn(numbers)
        results = drive_worlds(
            [self.scenario(*world) for world in zip(numbers, drawn, strict=True)],
            controller or self.controller,
            laps=self.laps,
            time_limit=self.time_limit,
            record=self.record,
            decision_limit=self.decision_limit,
            opponents=self.opponents,
            stop=stop,
            watch=watch,
        )
        return self._arrays(numbers, drawn, results)

    def undriven(self, world: int, reason: str) -> Arrays:
        """Return the result of a world that could not be driven, which ended for a reason of END_REASONS."""
        among = bool(self.opponents.entries)
        results = undriven_world(int(self.seeds[world]), reason, self.record, among=among)
        return self._arrays([world], self._drawn([world]), results)

    def _drawn(self, numbers: Sequence[int]) -> list[dict[str, Value]]:
        """Return the parameters that are drawn for some worlds."""
        if self.values:
            return [self.values[number] for number in numbers]
        return [self.randomization.draw(int(self.seeds[number])) for number in numbers]

    def _arrays(self, numbers: Sequence[int], drawn: Sequence[dict[str, Value]], results: WorldResults) -> Arrays:
        worlds = np.empty(len(numbers), self.world_dtype)
        worlds["world"], worlds["track"] = numbers, np.asarray(numbers) % len(self.tracks)
        for name in self.randomization.ranges:
            worlds[name] = [values[name] for values in drawn]
        for name in results.rows.dtype.names or ():
            worlds[name] = results.rows[name]
        traces = _traces(results, Record.of(self.record), len(self.opponents.names), self.scan_layout)
        return {"worlds": worlds, "lap_times_s": results.lap_times_s} | traces

    def trace_bytes(self) -> int:
        """Return the greatest size of what is recorded of one world [bytes]."""
        if self.record == "summary":
            return 0
        longest = max(track.longest_race(self.laps or 1) for track in self.tracks)
        limit = self.time_limit if self.time_limit is not None else longest
        ticks = int(limit / TICK + 1)
        if self.scan_layout is not None:
            return ticks * self.scan_layout.dtype.itemsize
        states = sum(_state_size(car) + 2 for car in (self.base, *self.opponents.entries))
        row = len(TELEMETRY) + (states if self.record == "states" else 0)
        return ticks * row * 8

    @cached_property
    def scan_layout(self) -> ScanLayout | None:
        """The layout of recorded scans; None: none are recorded."""
        record = Record.of(self.record)
        return ScanLayout.of(self.base.car.lidar.beams, record.step) if record.has_scans else None

    def settings(self) -> dict[str, Any]:
        """Return all that the results depend on, but for the versions, as it can stand in JSON."""
        return {
            "tracks": [{"name": track.name, "sha256": course_sha256(track)} for track in self.tracks],
            "controller": Path(self.controller).name,
            "controller_sha256": _sha256(text) if (text := self.controller_text) is not None else None,
            **({"controller_files": by_name(self.files)} if self.files else {}),
            "n": len(self.seeds),
            "seed": self.seed,
            "seeds_sha256": _sha256(np.ascontiguousarray(self.seeds, "<i8").tobytes()),
            "randomize": self.randomization.texts(),
            **({"values_sha256": _sha256(repr(self.values).encode())} if self.values else {}),
            "laps": self.laps,
            "duration": self.time_limit,
            "decision_limit": self.decision_limit,
            "record": str(Record.of(self.record)),
            **({"scan": self.scan_layout.described()} if self.scan_layout is not None else {}),
            "drive": self.base.described(),
            **({"obstacles": [described_obstacles(own) for own in self.obstacles]} if any(self.obstacles) else {}),
            **self.opponents.described(),
        }

    @cached_property
    def controller_text(self) -> bytes | None:
        """The file of a user's controller; None for a bundled one."""
        return code_of(self.controller)

    @cached_property
    def _sites(self) -> tuple[Sites | None, ...]:
        wanted = self.randomization.most_obstacles > 0
        return tuple(track.obstacle_sites(self.base.car.parameters) if wanted else None for track in self.tracks)

    def _checked_opponents(self) -> Opponents:
        """Refuse opponents that cannot be loaded, or that do not fit where they start in any of the worlds."""
        checked = self.opponents
        if not checked.entries:
            return checked
        for track in self.tracks:
            checked = self.opponents.checked(track)
        starts = any(name.startswith("start_") for name in self.randomization.ranges)
        drawn = starts or "obstacles" in self.randomization.ranges
        for world in range(len(self.seeds) if drawn else min(len(self.seeds), len(self.tracks))):
            scenario = self.scenario(world)
            course = self.tracks[world % len(self.tracks)]
            try:
                self.opponents.line_up(course, entry_of(scenario, self.controller), scenario.obstacles, drawn=starts)
            except SettingsError as error:
                raise SettingsError(f"world {world}, seed {scenario.seed}: {error}" if drawn else str(error)) from error
        return checked

    def _check_starts(self, course: Course) -> None:
        """Refuse starts that are not on an open course, and one of all worlds at which the car cannot stand.

        Round a closed course progress may be any number. A car that cannot stand where a start was drawn has crashed.
        """
        if not any(name.startswith("start_") for name in self.randomization.ranges):
            check_starts(course, [self.base.start], [self.base.car.parameters], [""])
        starts = self.randomization.ranges.get("start_s")
        for start in () if starts is None or course.closed else starts.extremes:
            if not 0.0 <= float(start) < course.length:
                raise SettingsError(
                    f"randomize start_s={starts} on {course.name!r}; accepted: from 0 to less than its length, "
                    f"{course.length:.2f} m"
                )


@lru_cache(maxsize=1)
def versions() -> dict[str, str]:
    """Return package versions and a hash of all sources: a change means that results may differ."""
    sources = hashlib.sha256()
    for path, source in package_files(".py", ".xml", ".toml", ".json"):
        text = source.read_bytes()
        sources.update(f"{path} {len(text)}\n".encode() + text)
    return {
        "fg_mujoco_version": version("fg-mujoco"),
        "mujoco_version": mujoco.__version__,
        "numpy_version": np.__version__,
        "native_sources_sha256": core.SOURCES,
        "sources_sha256": sources.hexdigest(),
        "platform": f"{platform.system()}-{platform.machine()}",
    }


def joined(parts: Sequence[Arrays]) -> Arrays:
    """Join the results of a chunk's parts in world order."""
    most = max(part["lap_times_s"].shape[1] for part in parts)
    laps = [
        np.pad(part["lap_times_s"], ((0, 0), (0, most - part["lap_times_s"].shape[1])), constant_values=math.nan)
        for part in parts
    ]
    whole = {name: np.concatenate([part[name] for part in parts]) for name in parts[0] if name != "lap_times_s"}
    return whole | {"lap_times_s": np.concatenate(laps)}


def _traces(results: WorldResults, record: Record, cars: int, layout: ScanLayout | None) -> Arrays:
    if record.what == "summary":
        return {}
    if layout is not None:
        scans = [rows if len(rows) else np.empty(0, layout.dtype) for rows in results.scans]
        return {"ticks": np.array([len(rows) for rows in scans], np.int64), "scans": np.concatenate(scans)}
    arrays: Arrays = {
        "ticks": np.array([len(rows) for rows in results.telemetry], np.int64),
        "telemetry": np.concatenate([rows.reshape(-1, len(TELEMETRY)) for rows in results.telemetry]),
    }
    if record.what == "states":
        arrays["state_size"] = np.array([rows.shape[1] for rows in results.states], np.int64)
        arrays["states"] = np.concatenate([rows.ravel() for rows in results.states])
        arrays["ctrl"] = np.concatenate([rows.reshape(-1, 2 * cars) for rows in results.ctrl])
    return arrays


def _state_size(base: DriveSettings) -> int:
    """Return the length of the state of a car, as one has whose commands are delayed, which is the longest."""
    delayed = base.car.compile(changes=CarChanges(command_delay=0.0))
    return int(mujoco.mj_stateSize(delayed, STATE))


def _sha256(*texts: bytes) -> str:
    digest = hashlib.sha256()
    for text in texts:
        digest.update(text)
    return digest.hexdigest()
