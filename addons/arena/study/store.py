"""The folder of a study, from which a later call goes on, and what drives the runs that are missing there.

    manifest.json     the settings that all runs have in common, and the versions; a folder of any others is refused
    runs.jsonl        a line a run, added when it is finished
    runs.csv          a row a run
    table.csv         the table, see `tables`
    table.md          the same for people
    table.html        the same as a page, with where planners drove

The table is of the runs that the last call asked for. A run whose line is damaged is driven again, with a warning.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from fg_mujoco.arguments import Suggesting, explain_class
from fg_mujoco.course.files import kept_folder
from fg_mujoco.course.writing import write_file
from fg_mujoco.display import Shown, brief, escaped, paragraph, quoted
from fg_mujoco.messages import require_whole
from fg_mujoco.pictures.pages.table import Table
from fg_mujoco.rollouts.job import versions
from fg_mujoco.rollouts.store import WRITABLE, StudyFolder, blame, claimed
from fg_mujoco.rollouts.workers import time_left, work_through

from ..runs.run import Run, RunRow
from .page import write_study_page
from .suite import Suite
from .tables import ALL, Cell, cells_of, table_of

RUNS, PAGE = "runs.jsonl", "table.html"


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


@explain_class
@dataclass(frozen=True, kw_only=True, repr=False)
class Study(Shown):
    """The results of a study."""

    suite: Suite
    rows: tuple[RunRow, ...]  # a run each, in the order of the study
    cells: tuple[Cell, ...]  # the table: what each row is of, and its figures
    folder: Path
    runs_driven: int  # by this call
    wall_time_s: float

    @property
    def failed(self) -> bool:
        """Whether a run could not be driven."""
        return any(row.trajectory_sha256 is None for row in self.rows)

    @property
    def head(self) -> str:
        """The first line of all that is shown: the suite and the assists of its planners."""
        assists = ", ".join(dict.fromkeys(str(row.place["assist"]) for row in self.rows))
        version = f" {self.suite.version}, {self.suite.sha256[:12]}" if self.suite.sha256 else ""
        return f"{self.suite.name}{version}: {len(self.rows)} runs, assist {assists}"

    def passed(self, cell: Cell) -> bool:
        """Return whether a planner has passed the lab, by the last cell of its checks."""
        return bool(cell["points"] >= self.suite.passing)

    @property
    def sums(self) -> tuple[Cell, ...]:
        """Of a lab: the last cell of each planner, with all its points."""
        return tuple(cell for cell in self.cells if cell.get("check") == ALL)

    def __repr__(self) -> str:
        planners = len({row.planner for row in self.rows})
        return brief(self, f"{len(self.rows)} runs of {planners} planners", f"in {quoted(self.folder)}")

    def _repr_html_(self) -> str:
        return escaped([paragraph(f"{self.head}; in {self.folder}"), self.table().notebook()])

    def table(self) -> Table:
        """Return the table for people."""
        return table_of(self.cells)

    def markdown(self) -> str:
        """Return the first line, and the table with its legend."""
        return f"{self.head}\n\n{self.table().markdown()}"

    def summary(self) -> dict[str, Any]:
        """Return the figures, as JSON has them."""
        own = {"runs": len(self.rows), "runs_driven": self.runs_driven, "wall_time_s": self.wall_time_s}
        return {"suite": self.suite.name, "version": self.suite.version} | own | {"table": list(self.cells)}

    def texts(self) -> dict[str, str]:
        """Return the runs and the table as they are in the folder, by the names of their files."""
        lines = [row.line for row in self.rows]
        names = [name for name in dict.fromkeys(name for line in lines for name in line)
                 if any(line.get(name) is not None for line in lines)]  # fmt: skip
        return {
            "runs.csv": Table.of(lines, names).csv(), "table.csv": Table.of(self.cells).csv(),
            "table.md": self.markdown(),
        }  # fmt: skip


def drive_study(
    suite: Suite,
    runs: Sequence[Run],
    out: str | Path,
    settings: Mapping[str, Any],
    *,
    workers: int | None,
    watch: Callable[[StudyProgress], None] | None,
    page: bool = True,
) -> Study:
    """Drive the runs that are missing in a folder, write the table, and return the results.

    A run in which a planner fails, or ends its worker process, is a row that says so; the others go on. Ctrl-C raises
    KeyboardInterrupt once the workers have stopped; the same call goes on with the runs that are missing.

    Args:
      suite: that is driven.
      runs: of the whole study, in its order.
      out: folder: a new or empty one, or one of a study with the same settings.
      settings: that all runs have in common, as JSON has them; a folder of any others is refused.
      workers: processes; None: as many as there are cores; one: no other than this.
      watch: called several times a second.
      page: whether to write the page.

    Raises:
      RunFolderError: the folder is of another study, in use, or cannot be written.
      EngineError: a worker process could not be started.
    """
    require_whole("workers", workers, 1, optional=True)
    folder = StudyFolder(out, title="study", command="study")
    with claimed(folder):
        folder.open(settings, versions())
        kept = folder.rows(RUNS, lambda values: ((row := RunRow.of(values)).key, row))
        missing = [run for run in runs if run.key not in kept]

        def keep(run: Run, row: RunRow) -> None:
            kept.add(row.key, row, asdict(row))
            if not row.checks and row.car.end_reason == "worker_died":
                warnings.warn(f"{run}: {row.car.message}", UserWarning, stacklevel=2)

        def tell(driven: int, elapsed: float) -> None:
            if watch is not None:
                found = len(runs) - len(missing)
                watch(StudyProgress(runs=len(runs), runs_found=found, runs_driven=driven, wall_time_s=elapsed))

        taken = work_through(_drive, missing, keep, workers=workers, watch=tell, died=_died)
        keys = [run.key for run in runs]
        rows = tuple(kept[key] for key in keys)
        results = Study(
            suite=suite, rows=rows, cells=cells_of(rows), folder=folder.folder, runs_driven=len(missing),
            wall_time_s=taken,
        )  # fmt: skip
        kept.sort(keys)
        with blame(folder.folder, WRITABLE):
            for name, text in results.texts().items():
                write_file(folder.folder / name, text.encode())
            if page:
                write_study_page(results.head, results.table(), rows, folder.folder / PAGE)
        return results


@kept_folder()
def _drive(run: Run) -> RunRow:
    return run.drive()


def _died(run: Run, how: str) -> RunRow:
    return run.died(how)
