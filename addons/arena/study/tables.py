"""Groups of runs, and what is said of each: the cells of a table.

    cells = cells_of(lines, [("planner", "course"), ("planner",)], lambda runs: count("successes", runs, "success"))

Lines are those of `RunRow.lines`: what a run is of and its figures by name. A cell has what its runs are of, ALL where
they are of several, and what a function says of them. Intervals are at 95 %, and None where all runs are alike.
"""

from __future__ import annotations

import statistics
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from fg_mujoco.pictures.pages.table import Table
from fg_mujoco.rollouts.shares import wilson

from ..runs.run import RunRow
from .intervals import ALL, varied

_SEEDS = ("seed", "obstacle_seed")  # what runs of a cell differ in

Line = Mapping[str, Any]
Cell = dict[str, Any]
Column = Callable[[Cell], object]


def cells_of(
    lines: Sequence[Line], groupings: Iterable[Sequence[str]], figures: Callable[[Sequence[Line]], Cell]
) -> tuple[Cell, ...]:
    """Return the cells of some lines: for each grouping those that have the same values of its names."""
    groupings = list(groupings)
    names = list(dict.fromkeys(name for grouping in groupings for name in grouping))
    cells = []
    for grouping in groupings:
        found: dict[tuple[Any, ...], list[Line]] = {}
        for line in lines:
            found.setdefault(tuple(line.get(name) if name in grouping else ALL for name in names), []).append(line)
        cells += [dict(zip(names, values, strict=True)) | figures(own) for values, own in found.items()]
    return tuple(cells)


def conditions(rows: Sequence[RunRow], *, always: Sequence[str] = (), but: Sequence[str] = ()) -> list[str]:
    """Return the names of what runs differ in, besides planner, seeds and `but`; `always` are among them."""
    names = dict.fromkeys(name for row in rows for name in row.place if name not in ("planner", *_SEEDS, *but))
    return [name for name in names if name in always or varied(row.place.get(name) for row in rows)]


def values_of(lines: Iterable[Line], name: str) -> list[Any]:
    """Return the values of a figure that are there."""
    return [value for line in lines if (value := line.get(name)) is not None]


def of(figure: Callable[[list[Any]], Any], lines: Iterable[Line], name: str) -> Any:
    """Return a figure of the values that are there, as their sum; None: there are none."""
    values = values_of(lines, name)
    return figure(values) if values else None


def count(name: str, lines: Sequence[Line], holds: Callable[[Line], bool]) -> Cell:
    """Return of how many lines something holds, and the ends of Wilson's interval of their share."""
    number = sum(map(holds, lines))
    alike = not varied(line.get("trajectory_sha256") for line in lines)
    low, high = (None, None) if alike else wilson(number, len(lines))
    return {name: number, f"{name}_low": low, f"{name}_high": high}


def spread(name: str, lines: Sequence[Line], figure: str) -> Cell:
    """Return the median of a figure, of how many lines it is, and its quartiles; these are None of figures alike."""
    values = [value for value in values_of(lines, figure) if np.isfinite(value)]
    low, high = np.quantile(values, (0.25, 0.75)).tolist() if varied(values) else (None, None)
    median = statistics.median(values) if values else None
    return {name: median, f"{name}_of": len(values), f"{name}_q25": low, f"{name}_q75": high}


def ends(lines: Iterable[Line]) -> str:
    """Return how runs ended, as "2 crash, 8 finished"."""
    reasons = Counter(str(line["end_reason"]) for line in lines)
    return ", ".join(f"{number} {reason}" for reason, number in sorted(reasons.items()))


# columns of tables for people


def share_of(name: str) -> Column:
    """Return a column "8/10": of how many runs something holds."""
    return lambda cell: f"{cell[name]}/{cell['runs']}"


def interval(name: str, scale: float = 100.0, form: str = ".0f", unit: str = " %") -> Callable[[Cell], str | None]:
    """Return a column "52 to 97 %": the ends of an interval."""
    return _between(f"{name}_low", f"{name}_high", scale, form, unit)


def quartiles(name: str) -> Column:
    """Return a column of two quartiles."""
    return _between(f"{name}_q25", f"{name}_q75", 1.0, ".2f", "")


def _between(low: str, high: str, scale: float, form: str, unit: str) -> Callable[[Cell], str | None]:
    def text(cell: Cell) -> str | None:
        if cell[low] is None or cell[high] is None:
            return None
        return f"{scale * cell[low]:{form}} to {scale * cell[high]:{form}}{unit}"

    return text


def fixed(name: str, form: str = ".2f", scale: float = 1.0, unit: str = "") -> Column:
    """Return a column of a figure with so many digits."""
    return lambda cell: None if cell[name] is None else f"{scale * cell[name]:{form}}{unit}"


def plain(name: str) -> Column:
    """Return a column of a figure as it is."""
    return lambda cell: cell[name]


def table_of(
    cells: Sequence[Cell], places: Sequence[str], columns: Sequence[tuple[str, Column]], legend: str = ""
) -> Table:
    """Return a table for people: a row a cell, what it is of and then the columns that have a value in any row."""
    rows = [[None if cell[name] is None else str(cell[name]) for name in places] for cell in cells]
    values = [[column(cell) for _, column in columns] for cell in cells]
    kept = [place for place in range(len(columns)) if any(row[place] not in (None, "") for row in values)]
    return Table(
        header=[*(name.replace("_", " ") for name in places), *(columns[place][0] for place in kept)],
        rows=[[*row, *(own[place] for place in kept)] for row, own in zip(rows, values, strict=True)],
        left=[*(name.replace("_", " ") for name in places), "not finished", "why it failed"], legend=legend,
    )  # fmt: skip
