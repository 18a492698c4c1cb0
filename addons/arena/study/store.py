"""The folder of a study, from which a later call goes on, and what drives the runs that are missing there.

    manifest.json     the settings that all runs have in common, and the versions; a folder of any others is refused
    runs.jsonl        a line a run, added when it is finished
    runs.csv          a row for each planner of each run
    table.csv         a row a cell, which is a group of runs
    differences.csv   a row for each two planners in each group of runs that both drove
    table.md          the tables, as Markdown

The tables are of the runs that the last call asked for. A run whose line is damaged is driven again, with a warning.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, ClassVar, TypeVar

from fg_mujoco.arguments import Suggesting, explain_class
from fg_mujoco.course.writing import write_file
from fg_mujoco.display import Shown, brief, escaped, paragraph, quoted
from fg_mujoco.messages import require_whole
from fg_mujoco.pictures.pages.table import Table
from fg_mujoco.rollouts.job import versions
from fg_mujoco.rollouts.store import WRITABLE, Rows, StudyFolder, blame, claimed
from fg_mujoco.rollouts.workers import time_left, work_through
from fg_mujoco.simulation.planner_failure import without_exit

from ..runs.run import Run, RunRow
from .intervals import Differences
from .suite import Suite
from .tables import Cell

RUNS = "runs.jsonl"
_Study = TypeVar("_Study", bound="Study")


@explain_class
@dataclass(frozen=True, kw_only=True)
class StudyProgress(Suggesting):
    """Progress of a study, for `watch`."""

    runs: int
    runs_found: int  # in the folder, driven by an earlier call
    runs_driven: int  # by this call
    wall_time_s: float

    @property
    def remaining_s(self) -> float | None:
        """Expected time to the end [s]; None before the first run is finished."""
        return time_left(self.runs, self.runs_found, self.runs_driven, self.wall_time_s)

    def counts(self) -> tuple[int, int, float | None]:
        """Return how many runs there are by now, how many there will be, and the time to the end [s]."""
        return self.runs_found + self.runs_driven, self.runs, self.remaining_s


@dataclass(frozen=True, kw_only=True, repr=False)
class Study(Shown):
    """The results of a study. Each kind of study has its own class of this base.

    Attributes:
      differences_of: how two planners differ in runs that both drove; None: each run has several planners.
    """

    differences_of: ClassVar[Differences | None] = None

    suite: Suite | None  # None: its folder was read
    rows: tuple[RunRow, ...]  # a run each, in the order of the study
    cells: tuple[Cell, ...]  # a group of runs each: what it is of, and its figures
    folder: Path
    runs_driven: int  # by this call
    wall_time_s: float

    @staticmethod
    def make_cells(rows: Sequence[RunRow]) -> tuple[Cell, ...]:
        """Return the cells of some rows."""
        raise NotImplementedError

    def _tables(self) -> list[Table]:
        """Return the tables for people."""
        raise NotImplementedError

    @property
    def lines(self) -> list[dict[str, Any]]:
        """What the tables are made of: for each planner of each run what it is of, and its figures."""
        return lines_of(self.rows)

    @property
    def differences(self) -> tuple[dict[str, Any], ...]:
        """Differences of each two planners in the runs that both drove, by the names in differences.csv."""
        return () if self.differences_of is None else self.differences_of.of(self.rows)

    @property
    def failed(self) -> bool:
        """Whether a run could not be driven."""
        return any(row.trajectory_sha256 is None for row in self.rows)

    def __repr__(self) -> str:
        planners = len({car.planner for row in self.rows for car in row.cars})
        return brief(self, f"{len(self.rows)} runs of {planners} planners", f"in {quoted(self.folder)}")

    def _repr_html_(self) -> str:
        below = paragraph(f"{len(self.rows)} runs in {self.folder}")
        return escaped([*(each.notebook() for each in self.tables()), below])

    def tables(self) -> list[Table]:
        """Return the tables for people, the last of which is that of the differences from the first planner."""
        paired = None if self.differences_of is None else self.differences_of.table(self.differences)
        return [*self._tables(), *([paired] if paired else [])]

    def markdown(self) -> str:
        """Return the tables, each with its legend."""
        return "\n".join(each.markdown() for each in self.tables())

    def summary(self) -> dict[str, Any]:
        """Return the figures, as JSON has them."""
        own = {"runs": len(self.rows), "runs_driven": self.runs_driven, "wall_time_s": self.wall_time_s}
        return own | {"table": list(self.cells), "differences": list(self.differences)}

    def texts(self) -> dict[str, str]:
        """Return the tables as they are in the folder, by the names of their files."""
        lines = self.lines
        names = [name for name in dict.fromkeys(name for line in lines for name in line)
                 if any(line.get(name) is not None for line in lines)]  # fmt: skip
        paired = {"differences.csv": Table.of(self.differences).csv()} if self.differences else {}
        return {
            "runs.csv": Table.of(lines, names).csv(), "table.csv": Table.of(self.cells).csv(),
            "table.md": self.markdown(),
        } | paired  # fmt: skip

    def draw(self, runs: Sequence[Run]) -> None:
        """Write the pictures and pages of the study to its folder."""


def lines_of(rows: Sequence[RunRow]) -> list[dict[str, Any]]:
    """Return the lines of some rows."""
    return [line for row in rows for line in row.lines()]


class RunsFolder(StudyFolder):
    """Keeps the rows of the finished runs.

    Args:
      folder: the path.
      command: that writes it.

    Attributes:
      runs: rows that are there, by their keys; once they are read.
    """

    runs: Rows[str, RunRow]

    def __init__(self, folder: str | Path, command: str = "study") -> None:
        super().__init__(folder, title=command, command=command)

    def read(self, *, repair: bool) -> None:
        """Read the rows of a folder that is open, and compare each with its checksum.

        Args:
          repair: whether to warn of damaged runs, and drop them, or to raise an error.

        Raises:
          RunFolderError: it cannot be read or written, or a run in it is damaged.
        """
        self.runs = self.rows(RUNS, lambda values: ((row := RunRow.of(values)).key, row), repair=repair)

    def keep(self, run: Run, row: RunRow) -> None:
        """Keep the row of a run.

        Raises:
          RunFolderError: it cannot be written.
        """
        self.runs.add(row.key, row, asdict(row))
        if not row.checks and any(car.end_reason == "worker_died" for car in row.cars):
            warnings.warn(f"{run}: {row.message}", UserWarning, stacklevel=2)


def drive_study(
    study: type[_Study],
    suite: Suite,
    runs: Sequence[Run],
    out: str | Path,
    settings: Mapping[str, Any],
    *,
    command: str,
    workers: int | None,
    watch: Callable[[StudyProgress], None] | None,
) -> _Study:
    """Drive the runs that are missing in a folder, write the tables and pictures, and return the results.

    A run in which a planner fails, or ends its worker process, is a row that says so; the others go on. Ctrl-C raises
    KeyboardInterrupt once the workers have stopped; the same call goes on with the runs that are missing.

    Args:
      study: class of the results.
      suite: that is driven.
      runs: of the whole study, in its order.
      out: folder: a new or empty one, or one of a study with the same settings.
      settings: that all runs have in common, as JSON has them; a folder of any others is refused.
      command: that writes such folders.
      workers: processes; None: as many as there are cores; one: no other than this.
      watch: called several times a second.

    Raises:
      RunFolderError: the folder is of another study, in use, or cannot be written.
      EngineError: a worker process could not be started.
    """
    require_whole("workers", workers, 1, optional=True)
    folder = RunsFolder(out, command)
    with claimed(folder):
        folder.open(settings, versions())
        folder.read(repair=True)
        missing = [run for run in runs if run.key not in folder.runs]

        def tell(driven: int, elapsed: float) -> None:
            if watch is not None:
                found = len(runs) - len(missing)
                watch(StudyProgress(runs=len(runs), runs_found=found, runs_driven=driven, wall_time_s=elapsed))

        taken = work_through(_drive, missing, folder.keep, workers=workers, watch=tell, died=_died)
        keys = [run.key for run in runs]
        rows = tuple(folder.runs[key] for key in keys)
        results = study(
            suite=suite, rows=rows, cells=study.make_cells(rows), folder=folder.folder, runs_driven=len(missing),
            wall_time_s=taken,
        )  # fmt: skip
        folder.runs.sort(keys)
        with blame(folder.folder, WRITABLE):
            for name, text in results.texts().items():
                write_file(folder.folder / name, text.encode())
            results.draw(runs)
        return results


@without_exit()
def _drive(run: Run) -> RunRow:
    return run.drive()


def _died(run: Run, how: str) -> RunRow:
    return run.died(how)
