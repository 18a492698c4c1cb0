"""The one table of a study: its cells, each of some runs, as programs have them and as people read them.

Lines are those of `RunRow.line`: what a run is of, and its figures by name. A cell is of the runs of a planner with an
assist, on a course, in one condition, which differ in what is drawn alone; below these there is one of all runs of a
group, and one of all. Those of several courses have no lap times and no times lost: their median would mix tracks.
Intervals are at 95 %, and None where all runs are alike. Of a lab a cell is a check of a planner, and one is its sum.
"""

from __future__ import annotations

import statistics
from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from fg_mujoco.pictures.pages.table import Table
from fg_mujoco.racing.entries import BOTH
from fg_mujoco.rollouts.shares import wilson

from ..runs.duels import SAFE
from ..runs.run import FAILURES, Checked, RunRow

ALL = "all"
"""What stands for all courses, and all conditions."""

_DRAWN = ("seed", "obstacle_seed", "start_m", "drive")  # what runs of a cell differ in
_ALWAYS = ("planner", "assist", "course")

Line = Mapping[str, Any]
Cell = dict[str, Any]
Column = Callable[[Cell], object]


def cells_of(rows: Sequence[RunRow]) -> tuple[Cell, ...]:
    """Return the cells of some rows, of which each planner's last ones are of all its runs."""
    if any(row.checks for row in rows):
        return tuple(_cells_of_checks(rows))
    lines, names = [row.line for row in rows], conditions(rows)
    cells = [dict(zip(names, values, strict=True)) | _figures(own) for values, own in _grouped(lines, names)]
    sums: list[Cell] = []
    for keys in (["planner", "assist", "group"], ["planner", "assist"]):
        if keys[-1] not in names:
            continue
        for values, own in _grouped(lines, keys):
            if len({tuple(line.get(name) for name in names) for line in own}) > 1:
                of = dict.fromkeys(names, ALL) | dict(zip(keys, values, strict=True))
                sums.append(of | _figures(own, several=True))
    sums.sort(key=lambda cell: (cell["assist"], cell.get("group", ALL) == ALL, cell.get("group", ""), -_merit(cell)))
    return (*cells, *sums)


def conditions(rows: Sequence[RunRow]) -> list[str]:
    """Return the names of what cells are of: planner, assist, course, and what else runs differ in but the seeds."""
    names = dict.fromkeys((*_ALWAYS[:2], *(name for row in rows for name in row.place if name not in _DRAWN)))
    return [name for name in names if name in _ALWAYS or varied(row.place.get(name) for row in rows)]


def _grouped(lines: Sequence[Line], names: Sequence[str]) -> list[tuple[tuple[Any, ...], list[Line]]]:
    found: dict[tuple[Any, ...], list[Line]] = {}
    for line in lines:
        found.setdefault(tuple(line.get(name) for name in names), []).append(line)
    return list(found.items())


def _figures(runs: Sequence[Line], *, several: bool = False) -> Cell:
    """Return how a planner fared in some runs, `several`: on several courses; lap times are of the successes alone."""
    won = [run for run in runs if run["success"] and not several]
    ended = Counter(str(run.get("outcome") or run["end_reason"]) for run in runs)
    found = {
        "runs": len(runs), **_count("successes", runs, lambda run: run["success"]),
        "score": _score(runs), "completion": _of(statistics.fmean, runs, "completion"),
        "laps_completed": sum(run["laps_completed"] for run in runs),
        "laps_requested": sum(run["laps_requested"] for run in runs), **_spread("best_lap_s", won),
        "mean_lap_s": _of(statistics.fmean, won, "mean_lap_s"),
        "ends": ", ".join(f"{number} {reason}" for reason, number in sorted(ended.items())),
        "collisions": sum(run["collisions"] for run in runs),
        "slide_time_fraction": _of(statistics.fmean, runs, "slide_time_fraction"),
        "max_slide_m_s": _of(max, runs, "max_slide_m_s"), "least_clearance_m": _of(min, runs, "least_clearance_m"),
        "wrong_way_time_s": _of(sum, runs, "wrong_way_time_s"),
        "mean_position": _of(statistics.fmean, runs, "position"),
        **{name: _of(sum, runs, name) for name in ("overtakes", "overtaken", "contacts", "at_fault")},
    }  # fmt: skip
    if all("outcome" in run for run in runs):  # duels
        blamed = sum(run.get("to_blame") in ("planner", BOTH) for run in runs)
        found |= {**_count("safe", runs, lambda run: run["outcome"] in SAFE), "to_blame": blamed}
        found |= _spread("time_lost_s", won)
    return found


def _score(runs: Sequence[Line]) -> float | None:
    """Return the mean score of runs, of several groups the mean of theirs; None: they have none."""
    if any(run["score"] is None for run in runs):
        return None
    groups = _grouped(runs, ["group"])
    return statistics.fmean(statistics.fmean(run["score"] for run in own) for _, own in groups)


def _merit(cell: Cell) -> float:
    return float(cell["successes"] / cell["runs"] if cell["score"] is None else cell["score"])


def _cells_of_checks(rows: Sequence[RunRow]) -> Iterable[Cell]:
    """Yield a cell for each check of a planner, and one of all; why it failed is what was measured there."""
    found: dict[tuple[Any, ...], list[RunRow]] = {}
    for row in rows:
        found.setdefault((row.planner, row.place["assist"]), []).append(row)
    for (planner, assist), own in found.items():
        checks: list[Checked] = sorted((each for row in own for each in row.checks), key=lambda check: check.number)
        of = {"planner": planner, "assist": assist}
        for check in checks:
            told = {name: getattr(check, name) for name in ("asked", "measured", "passed", "points", "of")}
            yield of | {"check": check.name} | told
        sums = {name: sum(getattr(check, name) for check in checks) for name in ("points", "of")}
        failed = dict.fromkeys(row.car.message for row in own if row.car.end_reason in FAILURES)
        why = "; ".join(filter(None, failed)) or None
        yield of | {"check": ALL, "asked": None, "measured": why, "passed": None} | sums


def varied(runs: Iterable[Hashable]) -> bool:
    """Return whether two runs are unlike. Of a single one, or of copies of one, intervals and quartiles say nothing."""
    return len(set(runs)) > 1


def _of(figure: Callable[[list[Any]], Any], lines: Iterable[Line], name: str) -> Any:
    """Return a figure of the values that are there, as their sum; None: there are none."""
    values = [value for line in lines if (value := line.get(name)) is not None]
    return figure(values) if values else None


def _count(name: str, lines: Sequence[Line], holds: Callable[[Line], bool]) -> Cell:
    """Return of how many lines something holds, and the ends of Wilson's interval of their share."""
    number = sum(map(holds, lines))
    alike = not varied(line.get("trajectory_sha256") for line in lines)
    low, high = (None, None) if alike else wilson(number, len(lines))
    return {name: number, f"{name}_low": low, f"{name}_high": high}


def _spread(name: str, lines: Sequence[Line]) -> Cell:
    """Return the median of a figure, of how many lines it is, and its quartiles; these are None of figures alike."""
    values = [value for line in lines if (value := line.get(name)) is not None and np.isfinite(value)]
    low, high = np.quantile(values, (0.25, 0.75)).tolist() if varied(values) else (None, None)
    median = statistics.median(values) if values else None
    return {name: median, f"{name}_of": len(values), f"{name}_q25": low, f"{name}_q75": high}


# for people


def _fixed(name: str, form: str = ".2f", scale: float = 1.0, unit: str = "") -> Column:
    return lambda cell: None if cell.get(name) is None else f"{scale * cell[name]:{form}}{unit}"


def _share(name: str) -> Column:
    return lambda cell: f"{cell[name]}/{cell['runs']}" if name in cell else None


def _between(name: str, ends: tuple[str, str], scale: float, form: str, unit: str) -> Column:
    def text(cell: Cell) -> str | None:
        low, high = (cell.get(f"{name}_{end}") for end in ends)
        return None if low is None or high is None else f"{scale * low:{form}} to {scale * high:{form}}{unit}"

    return text


def _percent(name: str) -> Column:
    return _between(name, ("low", "high"), 100.0, ".0f", " %")


def _quartiles(name: str) -> Column:
    return _between(name, ("q25", "q75"), 1.0, ".2f", "")


def _plain(name: str) -> Column:
    return lambda cell: cell.get(name)


_COLUMNS: Mapping[str, Column] = {
    "score [%]": _fixed("score", ".1f"), "success": _share("successes"), "95 % interval": _percent("successes"),
    "safe": _share("safe"), "95 % interval, safe": _percent("safe"), "to blame": _plain("to_blame"),
    "laps": lambda cell: None if "safe" in cell else f"{cell['laps_completed']}/{cell['laps_requested']}",
    "best lap [s]": _fixed("best_lap_s"), "quartiles [s]": _quartiles("best_lap_s"),
    "mean lap [s]": _fixed("mean_lap_s"),
    "of runs": lambda cell: cell["best_lap_s_of"] or None,
    "time lost [s]": _fixed("time_lost_s"), "quartiles of it [s]": _quartiles("time_lost_s"),
    "ends": lambda cell: cell["ends"] if cell["successes"] < cell["runs"] else None,
    "collisions": _plain("collisions"), "sliding": _fixed("slide_time_fraction", ".1f", 100.0, " %"),
    "least clearance [m]": _fixed("least_clearance_m", ".3f"), "wrong way [s]": _fixed("wrong_way_time_s", ".1f"),
    "mean position": _fixed("mean_position", ".1f"), "overtakes": _plain("overtakes"), "overtaken": _plain("overtaken"),
    "contacts": _plain("contacts"), "at fault": _plain("at_fault"),
}  # fmt: skip
_LEGEND = (
    "A success has finished and touched nothing but other cars, or in a duel has overtaken without a touch; the "
    "interval of its share is Wilson's at 95 %. Lap times are of the successes on one course, whose number is \"of "
    'runs": the median of their best laps with its quartiles, and the mean of their mean laps. An interval is given '
    "only where runs differ."
)
_SCORED = (
    " A score is the share of the way that was driven without a touch, times the raceline's lap over the car's own; of "
    "several groups it is the mean of theirs."
)


def table_of(cells: Sequence[Cell]) -> Table:
    """Return the table of some cells for people: what each is of, and the columns that have a value in any row."""
    if cells and "check" in cells[0]:
        checks = [[*list(cell.values())[:6], f"{cell['points']:g} of {cell['of']:g}"] for cell in cells]
        header = ("planner", "assist", "check", "asked", "measured", "passed", "points")
        return Table(header=header, rows=checks, left=header[:5])
    places = list(cells[0])[: list(cells[0]).index("runs")] if cells else []
    words = [name.replace("_", " ") for name in places]
    rows = [[None if cell[name] is None else str(cell[name]) for name in places] for cell in cells]
    values = [[column(cell) for column in _COLUMNS.values()] for cell in cells]
    kept = [place for place in range(len(_COLUMNS)) if any(row[place] not in (None, "") for row in values)]
    scored = any(cell["score"] is not None for cell in cells)
    return Table(
        header=[*words, *(list(_COLUMNS)[place] for place in kept)],
        rows=[[*row, *(own[place] for place in kept)] for row, own in zip(rows, values, strict=True)],
        left=[*words, "ends"], legend=_LEGEND + (_SCORED if scored else ""),
    )  # fmt: skip
