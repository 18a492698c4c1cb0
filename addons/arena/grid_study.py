"""A study of a grid: each value of each axis with each of the others is a run, driven until none is missing.

A study has a key, figures and a row of its runs, the run itself with `drive` and `died`, and a `Study` of its results:

    folder = GridFolder(out, DuelRow.of, title="overtaking study", command="overtake", file="duels.jsonl")
    study = drive_grid(Overtaking, duels, folder, settings.manifest(), workers=None, watch=None, draw=picture)

A new study is a module here, and a function of `commands`; the table of the add-ons lists its command.

The folder has, besides what `store` says of it:

    RUNS.csv          a row a run
    table.csv         a row a cell, which is a group of runs
    differences.csv   a row for each two planners in each group of runs that both drove
    table.md          both tables, as Markdown
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, astuple, dataclass, fields
from hashlib import sha256
from pathlib import Path
from typing import Any, ClassVar, Generic, Protocol, TypeVar, get_type_hints

from fg_mujoco.arguments import Suggesting, explain_class
from fg_mujoco.course.writing import write_file
from fg_mujoco.display import Shown, brief, escaped, paragraph, quoted
from fg_mujoco.errors import ControllerError, SettingsError
from fg_mujoco.pictures.pages.table import Table
from fg_mujoco.rollouts.job import versions
from fg_mujoco.rollouts.store import WRITABLE, Rows, StudyFolder, blame, claimed, of_kind
from fg_mujoco.rollouts.workers import time_left, work_through
from fg_mujoco.simulation.planner_failure import one_line, without_exit

from .intervals import Differences

_Figures = TypeVar("_Figures")
_GridRow = TypeVar("_GridRow", bound="GridRow")
_Row = TypeVar("_Row", bound="GridRow")
_Cell = TypeVar("_Cell", bound="GridCell")
_Study = TypeVar("_Study", bound="Study[Any, Any]")


def as_axis(value: Any) -> list[Any]:
    """Return the values of an axis: one, or a sequence of them."""
    return [value] if isinstance(value, str) or not isinstance(value, Iterable) else list(value)


def require_axes(axes: Iterable[tuple[str, Sequence[Any]]]) -> None:
    """Refuse an axis, a name and its values, that is empty or has a value twice.

    Raises:
      SettingsError: one is.
    """
    for name, values in axes:
        twice = next((value for i, value in enumerate(values) if value in values[:i]), None)
        if not values or twice is not None:
            said = f"no {name} is given" if not values else f"{name} {twice} is given twice"
            raise SettingsError(f"{said}; accepted: one or more, each once")


@explain_class
@dataclass(frozen=True, kw_only=True)
class StudyProgress(Suggesting):
    """Progress of a comparison or an overtaking study, for `watch`."""

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


@dataclass(frozen=True)
class GridKey:
    """Base of the keys of runs: all that tells a run from the others of its study.

    The last field is the SHA-256 of the files that the planner reads; None: it reads none.
    """

    @property
    def sha256(self) -> str:
        """Names the run; that of a planner which reads no files as in versions that did not ask for them."""
        values = astuple(self)
        return sha256(repr(values if values[-1] is not None else values[:-1]).encode()).hexdigest()


@dataclass(frozen=True)
class GridRow:
    """Base of rows: a run and its figures, one line of RUNS.jsonl, one row of RUNS.csv."""

    key: Any
    figures: Any

    def as_dict(self) -> dict[str, Any]:
        """Return key and figures in one, as JSON has them."""
        return asdict(self.key) | asdict(self.figures)

    @classmethod
    def of(cls: type[_GridRow], values: Mapping[str, Any]) -> _GridRow:
        """Return the row that `as_dict` made the values of; errors as `of_kind`."""
        kinds = get_type_hints(cls)
        return cls(of_kind(kinds["key"], values), of_kind(kinds["figures"], values))


def figures_of(kind: type[_Figures], **given: Any) -> _Figures:
    """Return figures of which only some are there; the others are None."""
    return kind(**dict.fromkeys(field.name for field in fields(kind)) | given)  # type: ignore[arg-type]


def why_failed(error: Exception) -> str:
    """Return the message of a run that failed with an error, in one line."""
    return " ".join(str(error).split()) if isinstance(error, ControllerError) else one_line(error)


class GridRun(Protocol):
    """A run to be driven. It travels to a worker process."""

    @property
    def key(self) -> Any:
        """Of its row."""

    def drive(self) -> Any:
        """Drive it, and return what the folder is to keep."""

    def died(self, how: str) -> Any:
        """Return the same of a run whose worker process ended, with its end in words."""


@dataclass(frozen=True)
class GridCell:
    """Base of cells: how a group of runs went."""

    def as_dict(self) -> dict[str, Any]:
        """Return its figures, as JSON has them."""
        return asdict(self)


class GridFolder(StudyFolder):
    """Keeps the rows of the finished runs of a grid.

    Args:
      folder: the path.
      row: makes a row of the values of a line.
      title: what the study is called in messages.
      command: that writes it.
      file: name of the file of the rows.

    Attributes:
      runs: rows that are there, by their keys; once they are read.
    """

    runs: Rows[Any, Any]

    def __init__(
        self, folder: str | Path, row: Callable[[Mapping[str, Any]], GridRow], *, title: str, command: str, file: str
    ) -> None:
        super().__init__(folder, title=title, command=command)
        self._row, self._file = row, file

    def read(self, *, repair: bool) -> None:
        """Read the rows of a folder that is open, and compare each with its checksum.

        Args:
          repair: whether to warn of damaged runs, and drop them, or to raise an error.

        Raises:
          RunFolderError: it cannot be read or written, or a run in it is damaged.
        """
        self.runs = self.rows(self._file, self._read_row, repair=repair)

    def keep(self, run: Any, answer: Any) -> None:
        """Keep what a run returned, here its row.

        Raises:
          RunFolderError: it cannot be written.
        """
        self.runs.add(run.key, answer, answer.as_dict())

    def _read_row(self, values: dict[str, Any]) -> tuple[Any, Any]:
        row = self._row(values)
        return row.key, row


@dataclass(frozen=True, kw_only=True, repr=False)
class Study(Shown, Generic[_Row, _Cell]):
    """The results of a grid of runs. A study has its own class of this base.

    Attributes:
      noun: what its runs are called.
      paired: its differences of planners; None: each of its runs has several planners, which are compared in it.
    """

    noun: ClassVar[str] = "runs"
    paired: ClassVar[Differences | None] = None

    rows: tuple[_Row, ...]  # a run each, in the order of the grid
    cells: tuple[_Cell, ...]  # a group of runs each
    folder: Path
    runs_driven: int  # by this call
    wall_time_s: float

    @staticmethod
    def make_cells(rows: Sequence[Any]) -> tuple[Any, ...]:
        """Return the cells of some rows."""
        raise NotImplementedError

    @property
    def differences(self) -> tuple[dict[str, Any], ...]:
        """Differences of each two planners in the runs that both drove, by the names in differences.csv."""
        return () if self.paired is None else self.paired.of(self.rows)

    def _summed_up(self) -> str:
        """Return the results in a few words, for the repr."""
        raise NotImplementedError

    def _table(self, *, chosen: bool) -> Table:
        """Return the table for people, of all cells or of those that are chosen for the page."""
        raise NotImplementedError

    def __repr__(self) -> str:
        said = f"{len(self.rows)} {self.noun}, {self._summed_up()}"
        return brief(self, said, f"in {quoted(self.folder)}")

    def _repr_html_(self) -> str:
        below = paragraph(f"{len(self.rows)} {self.noun} in {self.folder}")
        return escaped([*(each.notebook() for each in self._tables(chosen=False)), below])

    def _tables(self, *, chosen: bool) -> list[Table]:
        paired = None if self.paired is None else self.paired.table(self.differences)
        return [each for each in (self._table(chosen=chosen), paired) if each]

    def markdown(self) -> str:
        """Return the table, and that of the differences from the first planner, each with its legend."""
        return "\n".join(each.markdown() for each in self._tables(chosen=True))

    def summary(self) -> dict[str, Any]:
        """Return the figures, as JSON has them."""
        return {
            self.noun: len(self.rows),
            f"{self.noun}_driven": self.runs_driven,
            "wall_time_s": self.wall_time_s,
            "table": [cell.as_dict() for cell in self.cells],
        } | ({} if self.paired is None else {"differences": list(self.differences)})

    def write_tables(self) -> None:
        """Write the tables to the folder, in place of those of an earlier call."""
        for name, text in self.texts().items():
            write_file(self.folder / name, text.encode())

    def texts(self) -> dict[str, str]:
        """Return the tables as they are in the folder, by the names of their files."""
        paired = {} if self.paired is None else {"differences.csv": self.paired.csv(self.differences)}
        return {
            f"{self.noun}.csv": Table.of(row.as_dict() for row in self.rows).csv(),
            "table.csv": Table.of(cell.as_dict() for cell in self.cells).csv(),
            "table.md": self.markdown(),
        } | paired


def drive_grid(
    study: type[_Study],
    runs: Sequence[GridRun],
    folder: GridFolder,
    settings: Mapping[str, Any],
    *,
    workers: int | None,
    watch: Callable[[StudyProgress], None] | None,
    draw: Callable[[_Study], None],
) -> _Study:
    """Drive the runs that are missing in a folder, write the tables and pictures, and return the results.

    Args:
      study: class of the results.
      runs: of the whole grid, in its order.
      folder: that they are kept in.
      settings: that all runs have in common, as JSON has them; a folder of any others is refused.
      workers: processes; None: as many as there are cores; one: no other than this.
      watch: called several times a second.
      draw: writes the pictures to the folder.

    Raises:
      RunFolderError: the folder is of another study, in use, or cannot be written.
      EngineError: a worker process could not be started.
    """
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
            rows=rows, cells=study.make_cells(rows), folder=folder.folder, runs_driven=len(missing), wall_time_s=taken
        )  # fmt: skip
        folder.runs.sort(keys)
        with blame(folder.folder, WRITABLE):
            results.write_tables()
            draw(results)
        return results


@without_exit()
def _drive(run: GridRun) -> Any:
    return run.drive()


def _died(run: GridRun, how: str) -> Any:
    return run.died(how)
