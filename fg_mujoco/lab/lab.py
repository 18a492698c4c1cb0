"""Runs experiments of the friction lab, cell by cell in worker processes, and writes what they found.

Finished cells are in the folder at once, and the same call goes on where one was interrupted. A folder may be filled
by several calls, an experiment each: `lab.json` has the settings and versions that made it, `cells/NAME.jsonl` a line
a cell with its rows, NAME.csv a row a measurement, a missing value empty, NAME.svg and NAME.pdf its figure, and NAME.md
what is printed, with the command that makes it again.
"""

from __future__ import annotations

import hashlib
import importlib
import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import NamedTuple

from ..course.writing import write_file
from ..errors import SettingsError, accepted_names
from ..messages import require_whole
from ..pictures.pages.figure_kit import render, require_matplotlib
from ..pictures.pages.table import Table
from ..rollouts.job import versions
from ..rollouts.store import WRITABLE, Rows, StudyFolder, blame, claimed
from ..rollouts.workers import time_left, work_through
from .experiment import Cell, Experiment, LabSettings, Row, Section

_HERE = "fg_mujoco.lab"
EXPERIMENTS: dict[str, str] = {
    "skidpad": f"{_HERE}.skidpad:EXPERIMENT",
    "sets": f"{_HERE}.skidpad:SETS",
    "ground": f"{_HERE}.ground_circles:EXPERIMENT",
    "step": f"{_HERE}.step:EXPERIMENT",
    "braking": f"{_HERE}.braking:EXPERIMENT",
    "laps": f"{_HERE}.laps:LAPS",
    "mismatch": f"{_HERE}.laps:MISMATCH",
}
"""The experiments by their names, as "module:attribute", in the order of `all`."""


class Task(NamedTuple):
    """A cell to be measured, as it goes to a worker."""

    name: str  # of the experiment
    place: str  # of EXPERIMENTS
    cell: Cell
    settings: LabSettings

    def __str__(self) -> str:
        return f"{self.name}, cell {cell_key(self.cell)}"


def measure(task: Task) -> list[Row]:
    """Measure a cell: what a worker does."""
    rows = _imported(task.place).measure(task.cell, task.settings)
    plain: list[Row] = json.loads(json.dumps(rows, default=lambda number: number.item()))
    return plain  # as they are read from a file: numpy's numbers are Python's


def _imported(place: str) -> Experiment:
    module, _, attribute = place.partition(":")
    found: Experiment = getattr(importlib.import_module(module), attribute)
    return found


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
class Chapter:
    """What an experiment found."""

    name: str
    title: str
    section: Section
    rows: list[Row]

    def text(self, again: str = "") -> str:
        """Return its sentences and its table as Markdown, and the command that makes them again."""
        columns = self.section.columns
        rows = self.rows if self.section.printed is None else self.section.printed
        words = [head for head, name in columns.items() if any(isinstance(row.get(name), str) for row in rows)]
        cells = [[_cell(row.get(name)) for name in columns.values()] for row in rows]
        table = Table(header=[*columns], rows=cells, left=words).markdown() if columns else ""
        made = f"Made again by: {again}\n" if again else ""
        return "\n".join([f"## {self.title}\n", *self.section.sentences, "", table, made]).rstrip()


@dataclass(frozen=True, kw_only=True)
class LabResult:
    """The results of the lab."""

    chapters: tuple[Chapter, ...]  # of the experiments asked for
    folder: Path | None
    cells: int
    cells_measured: int  # by this call
    wall_time_s: float

    def text(self) -> str:
        """Return what each experiment found."""
        return "\n\n".join(chapter.text() for chapter in self.chapters)


def load_experiment(name: str) -> Experiment:
    """Return an experiment by its name; SettingsError: there is none."""
    if name not in EXPERIMENTS:
        raise SettingsError(f"unknown experiment {name!r}; {accepted_names(name, EXPERIMENTS)}")
    return _imported(EXPERIMENTS[name])


def run_lab(
    names: Sequence[str],
    *,
    out: str | Path | None = None,
    workers: int | None = None,
    settings: LabSettings | None = None,
    pictures: bool = True,
    again: str = "",
    watch: Callable[[LabProgress], None] | None = None,
) -> LabResult:
    """Measure what is missing of some experiments, and write what they found.

    Args:
      out: a new or empty folder, or one of the lab with the same settings and sources; None: nothing is written.
      workers: processes; None: as many as there are cores; one: no other than this.
      again: the command that makes the results again, which is written beside them.

    Raises:
      SettingsError, RunFolderError: what cannot be measured or written; nothing has run then, unless the law answers
        no speed in the course of a cell.
      MissingExtraError: no matplotlib for the pictures.
      EngineError: a cell failed, or a worker process died; finished cells are kept.
    """
    require_whole("workers", workers, 1, optional=True)
    settings = settings or LabSettings()
    if pictures and out is not None:
        require_matplotlib()
    plan = {name: load_experiment(name).cells(settings) for name in dict.fromkeys(names)}
    folder = StudyFolder(out, title="lab", command="friction", manifest="lab.json") if out is not None else None
    with claimed(folder):
        kept: dict[str, Rows[str, list[Row]]] = {}
        if folder is not None:
            folder.open(settings.described(), lab_versions())
            kept = {name: _cells(folder, name) for name in plan}
        found: dict[str, dict[str, list[Row]]] = {name: dict(kept.get(name, {})) for name in plan}
        missing = [
            Task(name, EXPERIMENTS[name], cell, settings)
            for name, cells in plan.items()
            for cell in cells
            if cell_key(cell) not in found[name]
        ]
        count = sum(map(len, plan.values()))

        def keep(task: Task, rows: list[Row]) -> None:
            key = cell_key(task.cell)
            if folder is not None:
                kept[task.name].add(key, rows, {"cell": task.cell, "rows": rows})
            found[task.name][key] = rows

        def tell(measured: int, elapsed: float) -> None:
            if watch is not None:
                there = count - len(missing)
                watch(LabProgress(cells=count, cells_found=there, cells_measured=measured, wall_time_s=elapsed))

        taken = work_through(measure, missing, keep, workers=workers, watch=tell)
        chapters = tuple(_chapter(name, cells, found[name], settings) for name, cells in plan.items())
        if folder is not None:
            for chapter in chapters:
                kept[chapter.name].sort([cell_key(cell) for cell in plan[chapter.name]])
                _write(folder.folder, chapter, again, pictures)
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


def _cells(folder: StudyFolder, experiment: str) -> Rows[str, list[Row]]:
    """Return the rows of the finished cells of an experiment, by `cell_key`."""
    return folder.rows(f"cells/{experiment}.jsonl", lambda row: (cell_key(row["cell"]), row["rows"]), experiment)


def _chapter(name: str, cells: Sequence[Cell], found: dict[str, list[Row]], settings: LabSettings) -> Chapter:
    rows = [row for cell in cells for row in found[cell_key(cell)]]
    experiment = load_experiment(name)
    return Chapter(name=name, title=experiment.title, section=experiment.section(rows, settings), rows=rows)


def _write(folder: Path, chapter: Chapter, again: str, pictures: bool) -> None:
    """Write table, text and figure of an experiment, in place of those of an earlier call."""
    with blame(folder, WRITABLE):
        write_file(folder / f"{chapter.name}.csv", Table.of(map(_known, chapter.rows)).csv().encode())
        write_file(folder / f"{chapter.name}.md", f"{chapter.text(again)}\n".encode())
        draw = chapter.section.draw
        if pictures and draw is not None:
            for kind in ("svg", "pdf"):
                write_file(folder / f"{chapter.name}.{kind}", render(draw, chapter.section.height, kind))


def _known(row: Row) -> Row:
    """Return a row in which no number is NaN."""
    return {name: None if isinstance(value, float) and math.isnan(value) else value for name, value in row.items()}


def _cell(value: object) -> object:
    """Return a value as the printed table has it."""
    if not isinstance(value, float):
        return value
    if not math.isfinite(value):
        return None if math.isnan(value) else "never"
    return f"{value:.3f}" if abs(value) < 10.0 else f"{value:.1f}"
