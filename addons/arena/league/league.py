"""Drives a league: every group of planners on every track from every place of the grid, and writes the standings.

    found = league(["gap_finder", "overtaker", "my_planner.py:Mine"], track=["oval", "fast"], laps=3, out="runs/league")
    print(found.markdown())

Heats have two cars, unless `cars` says otherwise, and each group of planners drives as many heats on a track as it has
cars, so that each of them starts from each place once. A later call with the same folder drives only the heats that are
missing: also where planners or tracks are added. A script that calls it with several workers needs
`if __name__ == "__main__":`, as every script that starts processes does.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from fg_mujoco.arguments import explain_class
from fg_mujoco.course.course import Course
from fg_mujoco.course.definitions import course_sha256
from fg_mujoco.course.writing import write_file
from fg_mujoco.display import quoted
from fg_mujoco.errors import ControllerError, SettingsError
from fg_mujoco.messages import require_whole, shown
from fg_mujoco.pictures.pages.table import Table
from fg_mujoco.racing.entries import Entry, check_starts, grid_starts
from fg_mujoco.racing.planners import ControllerChoice
from fg_mujoco.racing.resolved import ground_of
from fg_mujoco.racing.rules import find_rules
from fg_mujoco.racing.setup import OF_A_CAR, OF_A_CONTEXT, Setup, StudyKeywords
from fg_mujoco.racing.trust import check_planner, files_sha256
from fg_mujoco.rollouts.store import digest
from fg_mujoco.simulation.cars import GREATEST_CARS
from fg_mujoco.simulation.course_loading import load_track
from fg_mujoco.simulation.settings import Start

from ..grid_study import GridFolder, Study, StudyProgress, as_axis, drive_grid, require_axes
from .heat import BETWEEN, Heat, HeatKey, HeatRow, LeagueSettings
from .league_page import write_league_page
from .league_tables import Standing, beaten_table, make_standings, standings_table

if TYPE_CHECKING:
    from typing_extensions import Unpack

DEFAULT_RULES = "roboracer_2026"
DEFAULT_TRACKS = ("oval", "fast", "hairpins")
DECISION_LIMIT = 1.0
"""[s] that a planner of a league may take for a decision unless it is told otherwise."""

PAGE = "league.html"
_LONGEST_LABEL = 60


@explain_class
class League(Study[HeatRow, Standing]):
    """How all heats went."""

    noun = "heats"
    make_cells = staticmethod(make_standings)

    def _summed_up(self) -> str:
        return f"{len(self.cells)} planners, first {', '.join(each.planner for each in self.cells if each.place == 1)}"

    def _table(self, *, chosen: bool) -> Table:
        return standings_table(self.cells)

    def _tables(self, *, chosen: bool) -> list[Table]:
        return [standings_table(self.cells), beaten_table(self.rows, self.cells)]

    def texts(self) -> dict[str, str]:
        """Return the tables as they are in the folder, by the names of their files."""
        cars = [
            {"heat": row.key.name, "track": row.key.track, "seed": row.key.seed} | vars(car)
            for row in self.rows for car in row.cars
        ]  # fmt: skip
        incidents = [
            {"heat": row.key.name, "track": row.key.track} | each.as_dict()
            for row in self.rows
            for each in row.incidents
        ]
        return super().texts() | {
            "results.csv": Table.of(cars).csv(), "incidents.csv": Table.of(incidents, _INCIDENTS).csv()
        }  # fmt: skip


_INCIDENTS = (
    "heat", "track", "time_s", "car", "other", "closing_speed_m_s", "displacement_m", "at_fault", "reason", "x_m", "y_m"
)  # fmt: skip


class LeagueFolder(GridFolder):
    """Keeps the rows of the finished heats, with those of their cars and their incidents."""

    def __init__(self, folder: str | Path) -> None:
        super().__init__(folder, HeatRow.of, title="league", command="league", file="heats.jsonl")

    def keep(self, run: Any, answer: HeatRow) -> None:
        """Keep the row of a heat.

        Raises:
          RunFolderError: it cannot be written.
        """
        self.runs.add(run.key, answer, answer.line())


_USABLE = (
    *OF_A_CAR, *OF_A_CONTEXT, "obstacles", "obstacle_seed", "moving", "patches", "laps", "time_limit", "lidar", "grid",
    "rules", "decision_limit",
)  # fmt: skip
"""Fields of a Setup that all heats have in common."""


def league(
    controller: Sequence[str | Entry] = (),
    *,
    track: str | Sequence[str] = DEFAULT_TRACKS,
    seed: int | Sequence[int] = 0,
    cars: int = 2,
    out: str | Path,
    workers: int | None = None,
    keep_runs: bool = False,
    setup: Setup | None = None,
    watch: Callable[[StudyProgress], None] | None = None,
    **keywords: Unpack[StudyKeywords],
) -> League:
    """Drive a league, and write its standings and its page to a folder.

    A heat in which a planner fails, takes too long, or ends its worker process, is lost by it, and the others go on.
    Ctrl-C raises KeyboardInterrupt once the workers have stopped; the same call goes on with the missing heats.

    Args:
      controller: two or more: planners as `race` takes their texts, or an Entry, with a vehicle and settings of its
        own; none: the entries of `setup`.
      track: one or more, as `load_track` takes them.
      seed: one or more: of what the cars' sensors draw. Where they draw nothing, each heat is driven once.
      cars: of a heat.
      out: a new or empty folder, or one of a league with the same settings.
      workers: processes; None: as many as there are cores; one: no other than this, which a planner can end.
      keep_runs: whether to write the run folder of each heat that is driven, to `runs` in `out`.
      setup: that all heats have in common.
      watch: called several times a second.
      keywords: of a Setup, see there, that change `setup`. Where none are given, `rules` of race control are
        "roboracer_2026", and `decision_limit` is 1 s.

    Raises:
      SettingsError, TrackError, ControllerError, RunFolderError: what cannot be driven; nothing has run then.
      EngineError: a worker process could not be started.
    """
    require_whole("workers", workers, 1, optional=True)
    grid, rules = keywords.pop("grid", None), keywords.pop("rules", None)
    base = Setup.of(setup, caller="league", **keywords)
    planned = [each if isinstance(each, Entry) else base.first.like(_text(each)) for each in as_axis(controller)]
    entries = _named(planned or (base.entries if len(base.entries) > 1 else ()))
    several = len(base.entries) > 1
    settings = LeagueSettings(
        base=replace(
            base, entries=(replace(base.first, name=None, controller="gap_finder", planner_settings={}),),
            grid="staggered", rules="none",
            decision_limit=DECISION_LIMIT if base.decision_limit is None else base.decision_limit,
        ),
        grid=grid or base.grid,
        rules=rules or (base.rules if several and base.rules != "none" else DEFAULT_RULES),
    )  # fmt: skip
    base.require_usable("a league", *_USABLE, *(("controller", "planner_settings", "seed", "name") if several else ()))
    find_rules(settings.rules)
    with TemporaryDirectory(prefix="fg_mujoco-league-") as marks:
        keep = str(Path(out) / "runs") if keep_runs else ""
        heats = plan_heats(entries, as_axis(track), as_axis(seed), cars, settings, marks=marks, keep=keep)
        folder = LeagueFolder(out)

        def write(found: League) -> None:
            (found.folder / "heats").mkdir(exist_ok=True)
            for stale in (found.folder / "heats").glob("*.toml"):
                stale.unlink()
            for heat in heats:
                write_file(found.folder / "heats" / f"{heat.key.name}.toml", heat.setup().toml.encode())
            write_league_page(found, heats, found.folder / PAGE)

        return drive_grid(League, heats, folder, settings.manifest(), workers=workers, watch=watch, draw=write)


def plan_heats(
    entries: Sequence[Entry],
    tracks: Sequence[str],
    seeds: Sequence[int],
    cars: int,
    settings: LeagueSettings,
    *,
    marks: str = "",
    keep: str = "",
) -> list[Heat]:
    """Return the heats of a league, in its order: track by track, group by group, and each of a group in front once.

    Args:
      entries: named.
      tracks: as `load_track` takes them.
      seeds: whole numbers.
      cars: of a heat.
      settings: that all heats have in common.
      marks: folder for files that say whose turn it is.
      keep: folder for run folders; empty: none are kept.

    Raises:
      SettingsError: too few entries or cars, a planner or track that is given twice, a seed that is not accepted, or
        cars that do not fit on the grid.
      TrackError, ControllerError: what cannot be loaded.
    """
    if len(entries) < 2:
        raise SettingsError(f"planners of a league: {len(entries)}; accepted: two or more")
    most = min(len(entries), GREATEST_CARS)
    if not isinstance(cars, int) or not 2 <= cars <= most:
        raise SettingsError(f"cars is {shown(cars)} for {len(entries)} planners; accepted: 2 to {most}")
    for seed in seeds:
        require_whole("seed", seed, 0)
    require_axes((("planner", [str(entry.name) for entry in entries]), ("track", tracks), ("seed", seeds)))
    courses = {track: load_track(track, car=entries[0].car.parameters) for track in tracks}
    hashes, files = _checked(entries, courses)
    drawn = seeds if any(_draws(entry) for entry in entries) else (None,)
    heats = []
    for track, course in courses.items():
        obstacles = ground_of(settings.base, course).boxes
        definition = course_sha256(course)
        for group in combinations(range(len(entries)), cars):
            for first in range(cars):
                numbers = group[first:] + group[:first]
                lined_up = tuple(entries[number] for number in numbers)
                names = [str(entry.name) for entry in lined_up]
                own = [entry.car.parameters for entry in lined_up]
                check_starts(course, grid_starts(course, own, settings.grid), own, names, obstacles)
                read = [files[number] for number in numbers if files[number]]
                heats += [
                    Heat(
                        key := HeatKey(
                            track, definition, BETWEEN.join(names), digest([hashes[number] for number in numbers]),
                            seed, digest(read) if read else None,
                        ),
                        lined_up, numbers, settings, f"{marks}/{key.sha256[:24]}" if marks else "", keep,
                    )
                    for seed in drawn
                ]  # fmt: skip
    return heats


def _checked(entries: Sequence[Entry], courses: dict[str, Course]) -> tuple[list[str], list[str | None]]:
    """Build each planner on each track once; return a hash of each entry with its code, and of the files it reads."""
    hashes, files = [], []
    for entry in entries:
        choice, read = ControllerChoice.of(str(entry.controller)), {}
        for course in courses.values():
            course.check_car(entry.car.parameters)
            read = check_planner(choice, course, entry)
        hashes.append(digest(Setup(entries=(entry,)).described(), choice.sha256))
        files.append(files_sha256(read))
    return hashes, files


def _text(controller: Any) -> str:
    if not isinstance(controller, str):
        raise SettingsError(
            f"a planner of the league is {shown(controller)}; accepted: a name, path/to/file.py:ClassName, or an Entry"
        )
    return controller


def _named(entries: Sequence[Entry]) -> tuple[Entry, ...]:
    """Return entries whose names are what their planners are called: files of one name by their whole paths."""
    short = [_label(entry) for entry in entries]
    whole = [entry.name or str(entry.controller)[-_LONGEST_LABEL:] for entry in entries]
    labels = [own if short.count(own) == 1 else longer for own, longer in zip(short, whole, strict=True)]
    return tuple(replace(entry, name=label, start=None) for entry, label in zip(entries, labels, strict=True))


def _label(entry: Entry) -> str:
    """Return what the planner of an entry is called if no other is called so.

    Raises:
      SettingsError, ControllerError: a start of its own, a name that cannot be, or an object.
    """
    if not isinstance(entry.controller, str):
        said = f"the planner of {shown(entry)} is an object"
        raise ControllerError(f"{said}; accepted: a name or path/to/file.py:ClassName, for each heat to have its own")
    if entry.start not in (None, Start()):
        raise SettingsError(f"start is {shown(entry.start)} of {entry.controller}; accepted: none, it is the grid's")
    label = entry.name or ControllerChoice.of(entry.controller).label[:_LONGEST_LABEL]
    if BETWEEN in label:
        raise SettingsError(f"a planner is called {quoted(label)}; accepted: a name without {BETWEEN.strip()!r}")
    return label


def _draws(entry: Entry) -> bool:
    """Return whether a car's sensors draw anything from a seed."""
    effects = entry.effects
    return (
        effects.range_noise_std > 0.0 or effects.dropout_probability > 0.0 or bool(entry.sensed)
        or effects.measured is not None
    )  # fmt: skip
