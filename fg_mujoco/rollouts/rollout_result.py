"""The result of a rollout: one row a world, and the way back to any of its worlds."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import from_addons
from ..arguments import explain_class
from ..course.course import Course
from ..course.obstacles import as_obstacles
from ..course.writing import write_file
from ..display import Shown, brief, paragraph, quoted, table
from ..errors import SettingsError, accepted_names
from ..messages import FloatArray, require_whole
from ..pictures.pages.table import Table
from ..racing.entries import Entry
from ..racing.opponents import AMONG_CARS, FIRST, Opponents, entry_of
from ..racing.randomization import Randomization
from ..racing.setup import Setup
from ..simulation.settings import GREATEST_LAPS, DriveSettings
from ..vehicle.tire_slip import sliding_text
from .chunk_store import ChunkStore, FolderStore
from .drive_worlds import laps_within
from .job import Arrays, RolloutJob
from .shares import Shares, wilson
from .store import blame

_WORLDS_SHOWN = 10  # in a notebook

_RECORDED = {"telemetry": "telemetry or states", "states": "states", "ctrl": "states"}  # in which rollouts each is

QUANTILES = (0.0, 0.05, 0.25, 0.5, 0.75, 0.95, 1.0)
"""Of lap times and sliding, in a summary."""


@explain_class
@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class RolloutResult(Shown):
    """The result of a rollout. Arrays are read-only; `result["mu"]` is the column of `worlds` of that name.

    A column is a number `world`, that of its track `track`, a randomised parameter, or a field of
    `world_batch.RESULT`, and with opponents of `world_batch.AMONG`.
    """

    worlds: NDArray[np.void]  # (n,) rows, in the order of the worlds' numbers
    lap_times_s: FloatArray = field(repr=False)  # (n, k), NaN where fewer laps were driven
    tracks: tuple[Course, ...]
    randomization: Randomization
    base: DriveSettings = field(repr=False)  # what is the same in all worlds
    controller: str  # of car 0; of a folder that was read, without the path of its file
    opponents: Opponents = field(repr=False)  # that car 0 of each world raced against
    settings: dict[str, Any] = field(repr=False)  # all that the results depend on, but for the versions
    chunks: ChunkStore = field(repr=False)
    places: NDArray[np.int64] = field(repr=False)  # (n, 2) of each world, its chunk and its place in there
    worlds_driven: int  # by this call; the others were found in the folder
    world_seconds_driven: float  # [s] simulated by this call
    wall_time_s: float  # of this call

    def __repr__(self) -> str:
        return brief(self, self._headline())

    def _repr_html_(self) -> str:
        at = self.names.index("track")
        rows = [[_shown(v) for v in row] for row in self.worlds[:_WORLDS_SHOWN].tolist()]
        for row, found in zip(rows, self.worlds["track"].tolist(), strict=False):
            row[at] = self.tracks[found].name
        count = f"The first {len(rows)} of {len(self)} worlds:" if len(rows) < len(self) else "All worlds:"
        figures = [(name, str(value)) for name, value in self._figures()]
        return table((), figures) + paragraph(count) + table(self.names, rows)

    def _headline(self) -> str:
        tracks = quoted(self.tracks[0].name) if len(self.tracks) == 1 else f"{len(self.tracks)} tracks"
        return f"{len(self)} worlds on {tracks}: " + "; ".join(f"{name} {value}" for name, value in self._figures()[1:])

    def _meant(self, name: str) -> str | None:
        return "setup" if name in ("scenario", "entries") else super()._meant(name)

    def _figures(self) -> list[tuple[str, str]]:
        """Return the figures for people, by name."""
        ends = Counter(self["end_reason"].tolist()).most_common()
        first_laps = [
            (f"median first lap{f', {track.name}' if len(self.tracks) > 1 else ''}", laps[~np.isnan(laps)])
            for number, track in enumerate(self.tracks)
            for laps in (self["first_lap_s"][self["track"] == number],)
        ]
        slid = 0.0 if self.base.tire_set.slides else math.nan  # the least that can be said
        won = [("won", f"{100.0 * self._among()['wins']:.0f} %")] if self.opponents.entries else []
        return [
            ("worlds", str(len(self))),
            ("ends", ", ".join(f"{count} {reason}" for reason, count in ends)),
            *won,
            *((name, f"{np.median(laps):.2f} s of {len(laps)}" if len(laps) else "none") for name, laps in first_laps),
            ("greatest sliding", sliding_text(np.fmax.reduce(self["max_slide_m_s"], initial=slid), 3)),
            ("simulated", f"{self['sim_time_s'].sum():.1f} s"),
        ]

    def __len__(self) -> int:
        return len(self.worlds)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns."""
        return self.worlds.dtype.names or ()

    def __getitem__(self, name: str) -> NDArray[Any]:
        """Return a column. Shape (n,).

        Raises:
          SettingsError: there is none of that name.
        """
        if name not in self.names:
            raise SettingsError(f"no column {name!r}; {accepted_names(name, self.names)}")
        return self.worlds[name]

    def setup(self, world: int) -> Setup:
        """Return the setup of a world: `race` gives the same, bit for bit.

        Raises:
          SettingsError: there is no such world.
        """
        row, settings = self._row(world), self.settings
        course = self.tracks[row["track"]]
        given = self.randomization.ranges if "values_sha256" in settings else ()
        values = {name: row[name].item() for name in given} or None
        scenario = self.randomization.scenario(course, int(row["seed"]), values, base=self.base)
        placed = settings.get("obstacles")
        obstacles = as_obstacles(placed[row["track"]]) if placed else scenario.obstacles
        entries: tuple[Entry, ...] = (entry_of(scenario, self.controller),)
        if self.opponents.entries:
            entries = self.opponents.line_up(course, entries[0], obstacles)
        limit = settings.get("duration")
        return Setup(
            track=course, entries=entries, obstacles=obstacles, patches=scenario.patches, time_limit=limit,
            laps=min(laps_within(course, settings.get("laps"), limit or 0.0), GREATEST_LAPS), grid=self.opponents.grid,
            decision_limit=settings.get("decision_limit"),
        )  # fmt: skip

    def telemetry(self, world: int) -> FloatArray:
        """Return the telemetry of car 0 of a world, read where it is kept. Shape (ticks, len(TELEMETRY)).

        Raises:
          SettingsError: there is no such world, or it was not recorded.
        """
        return self._trace(world, "telemetry")

    def states(self, world: int) -> FloatArray:
        """Return the states of a world, as in RaceResult. Shape (ticks + 1, k); errors as `telemetry`."""
        return self._trace(world, "states")

    def ctrl(self, world: int) -> FloatArray:
        """Return the controls of a world's actuators, as in RaceResult. Shape (ticks, 2), errors as `telemetry`."""
        return self._trace(world, "ctrl")

    def dataset(self) -> Any:
        """Return the recorded scans, odometry and commands, world by world.

        Raises:
          SettingsError: none were recorded.
        """
        if "scan" not in self.settings:
            raise SettingsError("no scans were recorded; accepted: a rollout with record='scans'")
        return from_addons.Dataset.of(self.chunks, sorted(set(self.places[:, 0].tolist())), self.settings)

    def by(self, name: str, ranges: int = 8) -> Shares:
        """Return the shares of worlds that finished, crashed and slid, in even ranges of a column such as "mu".

        Raises:
          SettingsError: no column of that name, or one that is not of numbers; no whole number of ranges.
        """
        require_whole("ranges", ranges, 1)
        values = self[name]
        if values.dtype.kind not in "fiu" or not np.isfinite(values).all():
            numbers = [each for each in self.names if self.worlds.dtype[each].kind in "fiu"]
            raise SettingsError(f"column {name!r} has no numbers; {accepted_names(name, numbers)}")
        slid = self["slide_time_fraction"] if self.base.tire_set.slides else None
        return Shares.of(name, values.astype(np.float64), self["end_reason"].tolist(), slid, ranges)

    def summary(self) -> dict[str, Any]:
        """Return the figures, as they can stand in JSON."""
        count = len(self)
        return {
            **self.settings,
            "finished": float(np.mean(self["end_reason"] == "finished")),
            "finished_count": self._finished,
            "finished_interval": list(wilson(self._finished, count)),
            "end_reasons": dict(Counter(self["end_reason"].tolist()).most_common()),
            "lap_times": [
                {
                    "track": track.name,
                    "worlds": int(np.sum(self["track"] == number)),
                    **{name: _quantiles(self[name][self["track"] == number]) for name in ("first_lap_s", "best_lap_s")},
                }
                for number, track in enumerate(self.tracks)
            ],
            "max_slide_m_s": _quantiles(self["max_slide_m_s"]),
            "slide_time_fraction": _quantiles(self["slide_time_fraction"]),
            "collisions_per_world": float(self["collisions"].sum()) / count,
            **self._among(),
            "world_seconds": float(self["sim_time_s"].sum()),
            "worlds_driven": self.worlds_driven,
            "world_seconds_driven": self.world_seconds_driven,
            "wall_time_s": self.wall_time_s,
            "world_seconds_per_second": self.rate,
        }

    @property
    def _finished(self) -> int:
        return int(np.sum(self["end_reason"] == "finished"))

    def _among(self) -> dict[str, Any]:
        """Return the figures of car 0 among its opponents, as they can stand in JSON; none where it has none."""
        if not self.opponents.entries:
            return {}
        driven = self["position"] > 0  # a world that was not driven has no positions
        return {
            "wins": float(np.mean(self["winner"] == FIRST)),
            "mean_position": float(self["position"][driven].mean()) if driven.any() else None,
            **{f"{name}_per_world": float(self[name].mean()) for name in AMONG_CARS[1:-1]},
        }

    @property
    def rate(self) -> float:
        """World-seconds per second of this call; NaN where it found all worlds driven."""
        return self.world_seconds_driven / self.wall_time_s if self.worlds_driven else math.nan

    def to_csv(self, path: str | Path) -> None:
        """Write one row a world: the shortest text that gives each number back, nothing for NaN, tracks by name.

        Raises:
          RunFolderError: the file cannot be written.
        """
        path = Path(path)
        with blame(path, "a file that can be written"):
            write_file(path, self.as_csv().encode())

    def as_csv(self) -> str:
        """Return the table that `to_csv` writes."""
        tracks = [track.name for track in self.tracks]
        at = self.names.index("track")
        rows = [(*map(_cell, row[:at]), tracks[row[at]], *map(_cell, row[at + 1 :])) for row in self.worlds.tolist()]
        return Table(header=self.names, rows=rows).csv()

    def _row(self, world: int) -> Any:
        if not isinstance(world, (int, np.integer)) or not 0 <= world < len(self):
            raise SettingsError(f"no world {world!r}; accepted: 0 to {len(self) - 1}")
        return self.worlds[world]

    def _trace(self, world: int, name: str) -> NDArray[Any]:
        chunk, place = self.places[self._row(world)["world"]].tolist()
        arrays = self.chunks.read(chunk)
        if name not in arrays:
            raise SettingsError(f"{name} was not recorded; accepted: a rollout that records {_RECORDED[name]}")
        rows = arrays["ticks"] + (name == "states")
        ends = np.cumsum(rows)
        if name != "states":
            trace = np.array(arrays[name][ends[place] - rows[place] : ends[place]])
        else:  # those of a world may be longer than those of another
            sizes = arrays["state_size"]
            ends = np.cumsum(rows * sizes)
            flat = arrays[name][ends[place] - rows[place] * sizes[place] : ends[place]]
            trace = np.array(flat).reshape(rows[place], sizes[place])
        trace.flags.writeable = False
        return trace


def gather(
    job: RolloutJob, chunks: ChunkStore, *, worlds_driven: int, world_seconds_driven: float, wall_time_s: float
) -> RolloutResult:
    """Return the result of a rollout of which all chunks are kept."""
    return RolloutResult(
        **_table([short(chunks.read(number)) for number in range(len(job.chunks))]),
        tracks=job.tracks,
        randomization=job.randomization,
        base=job.base,
        controller=job.controller,
        opponents=job.opponents,
        settings=job.settings(),
        chunks=chunks,
        places=job.places,
        worlds_driven=worlds_driven,
        world_seconds_driven=world_seconds_driven,
        wall_time_s=wall_time_s,
    )


def read_rollout(folder: str | Path) -> RolloutResult:
    """Read a finished folder of a rollout.

    Raises:
      RunFolderError: it is not one, is not finished, or a file in it is missing or damaged.
    """
    store = FolderStore(folder)
    manifest, summary = store.manifest(), store.summary()
    settings = manifest["settings"]
    every = len(settings["tracks"])  # as the job has it, each chunk is of one of them
    worlds = (len(range(first, settings["n"], every)) for first in range(every))
    chunks = range(sum(-(-count // manifest["chunk"]) for count in worlds))
    kept = {number: short(store.read(number)) for number in chunks}
    table = _table(list(kept.values()))
    places = np.empty((len(table["worlds"]), 2), np.int64)
    for number, arrays in kept.items():
        places[arrays["worlds"]["world"]] = [(number, place) for place in range(len(arrays["worlds"]))]
    return RolloutResult(
        **table,
        tracks=store.tracks(),
        randomization=Randomization.of(settings["randomize"]),
        base=DriveSettings.of(settings.get("drive", {})),
        controller=settings["controller"],
        opponents=Opponents.read(settings),
        settings=settings,
        chunks=store,
        places=places,
        worlds_driven=summary["worlds_driven"],
        world_seconds_driven=summary["world_seconds_driven"],
        wall_time_s=summary["wall_time_s"],
    )


def short(arrays: Arrays) -> Arrays:
    """Return the arrays of a chunk that are its table, so that what was recorded need not stay in memory."""
    return {name: arrays[name] for name in ("worlds", "lap_times_s")}


def _table(kept: list[Arrays]) -> dict[str, NDArray[Any]]:
    """Return the worlds of all chunks in the order of their numbers, and their lap times."""
    worlds = np.concatenate([arrays["worlds"] for arrays in kept])
    laps = np.full((len(worlds), max(arrays["lap_times_s"].shape[1] for arrays in kept)), np.nan)
    first = 0
    for arrays in kept:
        times = arrays["lap_times_s"]
        laps[first : first + len(times), : times.shape[1]] = times
        first += len(times)
    order = np.argsort(worlds["world"])
    table = {"worlds": worlds[order], "lap_times_s": laps[order]}
    for array in table.values():
        array.flags.writeable = False
    return table


def _quantiles(values: FloatArray) -> dict[str, float] | None:
    """Return the quantiles of those that are not NaN, by name, and how many these are; None where all are NaN."""
    known = values[~np.isnan(values)]
    if len(known) == 0:
        return None
    found = {f"q{100 * q:g}": float(v) for q, v in zip(QUANTILES, np.quantile(known, QUANTILES), strict=True)}
    return found | {"count": len(known)}


def _shown(value: Any) -> str:
    if isinstance(value, float):
        return "" if math.isnan(value) else f"{value:.4g}"
    return str(value)


def _cell(value: Any) -> str:
    if isinstance(value, float):
        return "" if value != value else repr(value).removesuffix(".0")
    return str(value)
