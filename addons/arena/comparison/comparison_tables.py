"""The tables of a comparison: of its runs, and of its cells. A cell is a controller on a course, over all seeds.

Each call writes all of them again, with the runs that it asked for:

    runs.csv          a row a run
    table.csv         a row for each controller on each course at each speed, over all seeds
    differences.csv   a row for each two controllers on each course, over the runs that both drove
    table.md          both, as Markdown; of the differences those from the first controller, over all courses
    table.png         the table, as a picture; traces/COURSE.png: the driven lines (pictures)

Lap times are of the successful runs alone, and it is said of how many. Intervals are those of `arena.intervals`.
"""

from __future__ import annotations

import statistics
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from fg_mujoco.pictures.pages.table import Table
from fg_mujoco.racing.opponents import FIRST
from fg_mujoco.rollouts.rollout_result import wilson

from ..grid_study import GridCell
from ..intervals import ALL, Differences, per_cent, quantile, quartiles, varied
from .run import RunFigures, RunRow

DIFFERENCES = Differences(
    outcome=lambda row: (
        row.key.controller, (row.key.course, row.key.course_sha256, row.key.max_speed_m_s, row.key.seed),
        (row.key.course, row.key.max_speed_m_s), (row.figures.success, row.figures.best_lap_s),
    ),
    names=(
        "controller", "reference", "course", "max_speed_m_s", "pairs", "successes", "reference_successes",
        "success_difference", "success_difference_low", "success_difference_high", "lap_pairs",
        "best_lap_difference_s", "best_lap_difference_low_s", "best_lap_difference_high_s",
    ),
    everything=(ALL, None),
    header=("controller", "minus", "pairs", "success", "95 % interval", "pairs with laps", "best lap [s]",
            "95 % interval [s]"),
    legend=(
        "Differences are within pairs of runs on the same course, at the same speed, with the same seed: of the share "
        "of successes in percentage points, with Newcombe's interval, and the median of those of the best laps where "
        "both succeeded, with its interval by order statistics, which needs six pairs. All intervals are at 95 %."
    ),
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class CellAmong:
    """How a controller fared among its opponents on a course, over all seeds of which there is such a figure."""

    wins: int
    mean_position: float | None
    overtakes: int
    overtaken: int
    contacts: int
    contacts_at_fault: int


@dataclass(frozen=True, kw_only=True)
class Cell(GridCell):
    """How a controller fared on a course, over all seeds. None: no run has such a figure."""

    controller: str
    course: str
    max_speed_m_s: float
    runs: int
    successes: int  # finished, and touched nothing
    end_reasons: str  # "8 finished, 2 crash"
    laps_completed: int
    laps_requested: int
    best_lap_s: float | None  # median over the successes of each one's best
    mean_lap_s: float | None  # mean over the successes of each one's mean
    collisions: int
    slide_time_fraction: float | None  # mean
    max_slide_m_s: float | None  # greatest of any run
    least_clearance_m: float | None  # least of any run
    wrong_way_time_s: float | None  # of all runs together
    success_low: float | None = None  # ends of Wilson's interval of the share of successes, at 95 %; None: all runs
    success_high: float | None = None  # are alike
    runs_with_laps: int = 0  # successes that lap times are of
    best_lap_q25_s: float | None = None  # quartiles of each one's best; None: all are alike
    best_lap_q75_s: float | None = None
    mean_lap_std_s: float | None = None  # standard deviation of each one's mean; None: all are alike
    among: CellAmong | None = None  # None: there were no opponents

    def as_dict(self) -> dict[str, Any]:
        """Return all figures in one, as JSON has them."""
        own = super().as_dict()
        among = own.pop("among")
        return own | (among or {})

    @property
    def success_share(self) -> float:
        """From 0 to 1."""
        return self.successes / self.runs


def make_cells(rows: Sequence[RunRow]) -> tuple[Cell, ...]:
    """Return the cells of some rows, in the order in which they first occur."""
    groups: dict[tuple[str, str, float], list[RunRow]] = {}
    for row in rows:
        key = row.key
        groups.setdefault((key.controller, key.course, key.max_speed_m_s), []).append(row)
    raced = any(row.among is not None for row in rows)
    return tuple(
        _cell(*place, [row.figures for row in own], _among(own) if raced else None) for place, own in groups.items()
    )


def _among(rows: Sequence[RunRow]) -> CellAmong:
    found = [row.among for row in rows if row.among is not None]
    return CellAmong(
        wins=sum(among.winner == FIRST for among in found),
        mean_position=_of(statistics.fmean, (among.position for among in found)),
        overtakes=sum(among.overtakes for among in found),
        overtaken=sum(among.overtaken for among in found),
        contacts=sum(among.contacts for among in found),
        contacts_at_fault=sum(among.contacts_at_fault for among in found),
    )


def _cell(controller: str, course: str, max_speed: float, runs: Sequence[RunFigures], among: CellAmong | None) -> Cell:
    reasons = Counter(run.end_reason for run in runs)
    successes = sum(run.success for run in runs)
    best, mean = (
        [lap for run in runs if run.success and (lap := getattr(run, name)) is not None]
        for name in ("best_lap_s", "mean_lap_s")
    )
    low, high = wilson(successes, len(runs)) if varied(run.trajectory_sha256 for run in runs) else (None, None)
    quarters = [quantile(best, share) if varied(best) else None for share in (0.25, 0.75)]
    return Cell(
        controller=controller,
        course=course,
        max_speed_m_s=max_speed,
        runs=len(runs),
        successes=successes,
        end_reasons=", ".join(f"{count} {reason}" for reason, count in sorted(reasons.items())),
        laps_completed=sum(run.laps_completed for run in runs),
        laps_requested=sum(run.laps_requested for run in runs),
        best_lap_s=_of(statistics.median, best),
        mean_lap_s=_of(statistics.fmean, mean),
        collisions=sum(run.collisions for run in runs),
        slide_time_fraction=_of(statistics.fmean, (run.slide_time_fraction for run in runs)),
        max_slide_m_s=_of(max, (run.max_slide_m_s for run in runs)),
        least_clearance_m=_of(min, (run.least_clearance_m for run in runs)),
        wrong_way_time_s=_of(sum, (run.wrong_way_time_s for run in runs)),
        success_low=low,
        success_high=high,
        runs_with_laps=len(best),
        best_lap_q25_s=quarters[0],
        best_lap_q75_s=quarters[1],
        mean_lap_std_s=statistics.stdev(mean) if varied(mean) else None,
        among=among,
    )


HEADER = (
    "controller", "course", "success", "95 % interval", "laps", "best lap [s]", "quartiles [s]", "mean lap [s]",
    "of runs", "not finished", "collisions", "sliding", "least clearance [m]", "wrong way [s]",
)  # fmt: skip
"""Of the table for people."""

AMONG_HEADER = ("won", "mean position", "overtakes", "overtaken", "contacts", "at fault")
"""Of its last columns, where there are opponents."""


def cells_table(cells: Sequence[Cell]) -> Table:
    """Return the table for people: a row a cell."""
    raced = any(cell.among is not None for cell in cells)
    return Table(
        header=HEADER + (AMONG_HEADER if raced else ()),
        rows=[
            (
                cell.controller, course_title(cell, cells), f"{cell.successes}/{cell.runs}",
                per_cent(cell.success_low, cell.success_high), f"{cell.laps_completed}/{cell.laps_requested}",
                _text(cell.best_lap_s, ".2f"), quartiles(cell.best_lap_q25_s, cell.best_lap_q75_s),
                _text(cell.mean_lap_s, ".2f"), cell.runs_with_laps, _not_finished(cell.end_reasons), cell.collisions,
                None if cell.slide_time_fraction is None else f"{100.0 * cell.slide_time_fraction:.1f} %",
                _text(cell.least_clearance_m, ".3f"), _text(cell.wrong_way_time_s, ".1f"), *among_columns(cell),
            )
            for cell in cells
        ],
        left=("controller", "course", "not finished"),
        legend=(
            "A success has finished and touched nothing but other cars; the interval of its share is Wilson's at 95 %. "
            'Lap times are of the successes alone, "of runs" says of how many: the median of their best laps with its '
            "quartiles, and the mean of their mean laps. Of one run, or of runs that are alike, there is no interval."
        ),
    )  # fmt: skip


def among_columns(cell: Cell) -> tuple[object, ...]:
    """Return the last columns of a cell in the table for people, none where there are no opponents."""
    among = cell.among
    if among is None:
        return ()
    counts = (among.overtakes, among.overtaken, among.contacts, among.contacts_at_fault)
    return (f"{among.wins}/{cell.runs}", _text(among.mean_position, ".2f"), *counts)


def course_title(cell: Cell, cells: Iterable[Cell]) -> str:
    """Return what the course of a cell is called among others: with the speed, where there are several."""
    name = cell.course.removeprefix("scene:")
    several = any(other.max_speed_m_s != cell.max_speed_m_s for other in cells)
    return f"{name}, {cell.max_speed_m_s:g} m/s" if several else name


def _of(figure: Callable[[list[float]], float], values: Iterable[float | None]) -> float | None:
    given = [value for value in values if value is not None]
    return figure(given) if given else None


def _text(value: float | None, form: str) -> str | None:
    return None if value is None else f"{value:{form}}"


def _not_finished(end_reasons: str) -> str | None:
    others = [part.replace("_", " ") for part in end_reasons.split(", ") if not part.endswith(" finished")]
    return ", ".join(others) or None
