"""Runs experiments of the friction lab, cell by cell in worker processes, and writes the report.

    result = run_lab(["skidpad", "laps"], out="runs/friction")
    print(result.text())

Finished cells are in the folder at once, and the same call goes on where one was interrupted. A folder may be filled
by several calls, an experiment each: the report is of all that are complete in it.

    lab.json                the settings and versions that made it; a folder of any others is refused
    cells/NAME.jsonl        a line a cell of that experiment, with its rows, added when it is finished; NaN as by Python
    NAME_TABLE.csv          and the rest: see lab_report; written when all cells asked for are there
"""

from __future__ import annotations

import hashlib
import importlib
import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from importlib.resources import files
from pathlib import Path
from typing import NamedTuple

from ..errors import SettingsError, accepted_names
from ..messages import require_whole
from ..pictures.pages.figure_kit import require_matplotlib
from ..rollouts.job import versions
from ..rollouts.store import Rows, StudyFolder, claimed
from ..rollouts.workers import time_left, work_through
from .experiment import Cell, Experiment, LabSettings, Section, Tables
from .lab_report import Chapter, expected_table, write_report

_HERE = "fg_mujoco.lab"
EXPERIMENTS: dict[str, str] = {
    "skidpad": f"{_HERE}.skidpad",
    "transient": f"{_HERE}.transient",
    "braking": f"{_HERE}.braking",
    "mismatch": f"{_HERE}.mismatch",
    "patches": f"{_HERE}.patches",
    "laps": f"{_HERE}.laps",
}
"""The modules of the experiments by their names, in the order of the report; each has an `EXPERIMENT`."""


class Task(NamedTuple):
    """A cell to be measured, as it goes to a worker."""

    name: str  # of the experiment
    module: str
    cell: Cell

    def __str__(self) -> str:
        return f"{self.name}, cell {cell_key(self.cell)}"


def measure(task: Task) -> Tables:
    """Measure a cell: what a worker does."""
    experiment: Experiment = importlib.import_module(task.module).EXPERIMENT
    plain: Tables = json.loads(json.dumps(experiment.measure(task.cell), default=lambda number: number.item()))
    return plain  # as they are read from a file: numpy's numbers are Python's


def cell_key(cell: Cell) -> str:
    """Return what a cell is known by."""
    return json.dumps(cell, sort_keys=True)


@dataclass(frozen=True, kw_only=True)
class LabProgress:
    """How far a run of the lab is."""

    cells: int  # asked for
    cells_found: int  # of an earlier call
    cells_measured: int  # by this call
    wall_time_s: float

    @property
    def remaining_s(self) -> float | None:
        """Time to the end [s], if cells go on as those so far; None before the first."""
        return time_left(self.cells, self.cells_found, self.cells_measured, self.wall_time_s)


@dataclass(frozen=True, kw_only=True)
class LabResult:
    """The results of the lab."""

    chapters: tuple[Chapter, ...]  # of the experiments asked for
    folder: Path | None
    cells: int
    cells_measured: int  # by this call
    wall_time_s: float

    def text(self) -> str:
        """Return the sentences of each experiment and the table of what was expected."""
        parts = ["\n".join([f"{chapter.title}", *chapter.section.sentences]) for chapter in self.chapters]
        table = expected_table(self.chapters)
        return "\n\n".join([*parts, table.markdown().rstrip()] if table.rows else parts)


def load_experiment(name: str) -> Experiment:
    """Return an experiment by its name.

    Raises:
      SettingsError: there is none.
    """
    if name not in EXPERIMENTS:
        raise SettingsError(f"unknown experiment {name!r}; {accepted_names(name, EXPERIMENTS)}")
    experiment: Experiment = importlib.import_module(EXPERIMENTS[name]).EXPERIMENT
    return experiment


def run_lab(
    names: Sequence[str],
    *,
    out: str | Path | None = None,
    workers: int | None = None,
    settings: LabSettings | None = None,
    pictures: bool = True,
    redraw: bool = False,
    watch: Callable[[LabProgress], None] | None = None,
) -> LabResult:
    """Measure what is missing of some experiments, and write the report.

    Args:
      names: of the experiments; each once.
      out: a new or empty folder, or one of the lab with the same settings and sources; None: nothing is written.
      workers: processes; None: as many as there are cores; one: no other than this.
      settings: that all experiments share.
      pictures: whether the report has figures.
      redraw: measure nothing: write the report anew from the cells of `out`, whatever sources measured them.
      watch: called several times a second.

    Raises:
      SettingsError, RunFolderError: what cannot be measured or written; nothing has run then.
      MissingExtraError: no matplotlib for the pictures.
      EngineError: a cell failed, or a worker process died; finished cells are kept.
    """
    require_whole("workers", workers, 1, optional=True)
    settings = settings or LabSettings()
    if redraw and out is None:
        raise SettingsError("redraw without a folder; accepted: the folder of an earlier run")
    if pictures and out is not None:
        require_matplotlib()
    plan = {name: load_experiment(name).cells(settings) for name in dict.fromkeys(names)}
    folder = StudyFolder(out, title="lab", command="friction", manifest="lab.json") if out is not None else None
    with claimed(folder):
        found: dict[str, dict[str, Tables]] = {name: {} for name in plan}
        kept: dict[str, Rows[str, Tables]] = {}
        if folder is not None:
            folder.open(asdict(settings), lab_versions(), any_versions=redraw)
            kept = {name: _cells(folder, name) for name in plan}
            found |= kept
        missing = [
            Task(name, EXPERIMENTS[name], cell)
            for name, cells in plan.items()
            for cell in cells
            if cell_key(cell) not in found[name]
        ]
        if folder is not None and redraw and missing:
            accepted = "a folder with all cells, or no redraw"
            raise SettingsError(f"{folder.folder}: {missing[0]} is missing; accepted: {accepted}")
        count = sum(map(len, plan.values()))

        def keep(task: Task, tables: Tables) -> None:
            key = cell_key(task.cell)
            if folder is not None:
                kept[task.name].add(key, tables, {"cell": task.cell, "tables": tables})
            found[task.name][key] = tables

        def tell(measured: int, elapsed: float) -> None:
            if watch is not None:
                there = count - len(missing)
                watch(LabProgress(cells=count, cells_found=there, cells_measured=measured, wall_time_s=elapsed))

        taken = work_through(measure, missing, keep, workers=workers, watch=tell)
        chapters = tuple(_chapter(name, cells, found[name]) for name, cells in plan.items())
        if folder is not None:
            for name, cells in () if redraw else plan.items():
                kept[name].sort([cell_key(cell) for cell in cells])
            others = _complete_others(folder, plan, settings)
            order = list(EXPERIMENTS)
            everything = sorted((*chapters, *others), key=lambda chapter: order.index(chapter.name))
            write_report(folder.folder, everything, asdict(settings), _made_with(folder), pictures=pictures)
        return LabResult(
            chapters=chapters, folder=folder.folder if folder else None, cells=count, cells_measured=len(missing),
            wall_time_s=taken,
        )  # fmt: skip


def lab_versions() -> dict[str, str]:
    """Return what the rows depend on, to the last bit: versions, and a hash of the lab's sources and the tracks."""
    sources = hashlib.sha256()
    for package, ending in ((_HERE, ".py"), ("fg_mujoco.tracks", ".csv")):
        for source in sorted(files(package).iterdir(), key=lambda entry: entry.name):
            if source.name.endswith(ending):
                sources.update(source.name.encode() + source.read_bytes())
    return {**versions(), "lab_sha256": sources.hexdigest()}


def _cells(folder: StudyFolder, experiment: str) -> Rows[str, Tables]:
    """Return the rows of the finished cells of an experiment, by `cell_key`."""
    return folder.rows(f"cells/{experiment}.jsonl", lambda row: (cell_key(row["cell"]), row["tables"]), experiment)


def _made_with(folder: StudyFolder) -> dict[str, str]:
    """Return the versions that measured, and which sources wrote the report, if they are others."""
    ours = lab_versions()
    return folder.versions | ({} if ours == folder.versions else {"redrawn_by_lab_sha256": ours["lab_sha256"]})


def _chapter(name: str, cells: Sequence[Cell], found: dict[str, Tables]) -> Chapter:
    """Write the chapter of an experiment from the rows of its cells."""
    tables: Tables = {}
    for cell in cells:
        for table, rows in found[cell_key(cell)].items():
            tables.setdefault(table, []).extend(rows)
    experiment = load_experiment(name)
    section: Section = experiment.section(tables)
    return Chapter(name=name, title=experiment.title, section=section, tables=tables)


def _complete_others(folder: StudyFolder, plan: dict[str, list[Cell]], settings: LabSettings) -> list[Chapter]:
    """Return the chapters of experiments that earlier calls completed in this folder."""
    chapters = []
    for name in EXPERIMENTS:
        found = {} if name in plan else _cells(folder, name)
        if found:
            cells = load_experiment(name).cells(settings)
            if all(cell_key(cell) in found for cell in cells):
                chapters.append(_chapter(name, cells, found))
    return chapters
