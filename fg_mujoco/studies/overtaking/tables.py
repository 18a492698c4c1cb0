"""The report of an overtaking study: CSV, Markdown, and a picture.

    duels.csv         a row a duel
    table.csv         a row for each planner and opponent on each track, and over all tracks
    table.md          the same over all tracks, and by track, as Markdown; and the differences over all tracks
    differences.csv   a row for each two planners on each track, over the duels that both drove: see `differences`
    table.png         the share of overtakes by the ratio of the speeds, for each opponent, with its interval

Intervals are those of `studies.intervals`, at 95 %. Times lost are of the overtakes alone: their median, its quartiles,
and how many they are.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterable, Sequence
from dataclasses import astuple, dataclass, fields
from pathlib import Path
from typing import Any

from ...viz.plots import require_matplotlib, save_figure
from ..intervals import wilson
from ..tables import csv_text, markdown_table, quantile, quartiles
from .duel import DuelFigures, DuelKey, DuelRow

ALL = "all"
"""What stands for all tracks, or all opponents."""

_BANDS = 5  # of ratios in the picture
_DPI = 150
_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "black")


@dataclass(frozen=True, kw_only=True)
class DuelCell:
    """How a planner fared against an opponent on a track, over all seeds. None: no duel has such a figure."""

    planner: str
    track: str  # or ALL
    opponent: str  # or ALL
    duels: int
    overtaken: int  # without a touch
    low: float  # share, lower end of its interval
    high: float
    behind: int
    touches: int
    touches_planner: int  # that the planner is to blame for
    touches_planner_low: float  # share of all duels, lower end of its interval
    touches_planner_high: float
    others: int  # walls, races that ended otherwise, and duels that failed
    time_lost_s: float | None  # median of the overtakes whose time lost is known
    time_s: float | None  # median of the overtakes, from the start
    decision_median_s: float | None  # median of the medians
    decision_longest_s: float | None
    time_lost_count: int  # overtakes whose time lost is known
    time_lost_q25_s: float | None  # their quartiles
    time_lost_q75_s: float | None

    @property
    def share(self) -> float:
        """Of the overtakes, from 0 to 1."""
        return self.overtaken / self.duels


def make_cells(rows: Sequence[DuelRow]) -> tuple[DuelCell, ...]:
    """Return the cells of some rows: each track, then all; each opponent, then all."""
    planners = list(dict.fromkeys(row.key.planner for row in rows))
    tracks = [*dict.fromkeys(row.key.track for row in rows), ALL]
    opponents = [*dict.fromkeys(row.key.opponent for row in rows), ALL]
    cells = []
    for planner in planners:
        for track in tracks:
            for opponent in opponents:
                duels = [
                    row.figures
                    for row in rows
                    if row.key.planner == planner
                    and track in (ALL, row.key.track)
                    and opponent in (ALL, row.key.opponent)
                ]
                if duels:
                    cells.append(_cell(planner, track, opponent, duels))
    return tuple(cells)


def _cell(planner: str, track: str, opponent: str, duels: Sequence[DuelFigures]) -> DuelCell:
    outcomes = [duel.outcome for duel in duels]
    overtaken, touches = outcomes.count("overtaken"), outcomes.count("touch")
    to_blame = sum(duel.to_blame == "planner" for duel in duels)
    low, high = wilson(overtaken, len(duels))
    blame_low, blame_high = wilson(to_blame, len(duels))
    won = [duel for duel in duels if duel.outcome == "overtaken"]
    lost = [duel.time_lost_s for duel in won if duel.time_lost_s is not None and math.isfinite(duel.time_lost_s)]
    return DuelCell(
        planner=planner, track=track, opponent=opponent, duels=len(duels), overtaken=overtaken, low=low, high=high,
        behind=outcomes.count("behind"), touches=touches, touches_planner=to_blame, touches_planner_low=blame_low,
        touches_planner_high=blame_high, others=len(duels) - overtaken - touches - outcomes.count("behind"),
        time_lost_s=_median(duel.time_lost_s for duel in won), time_s=_median(duel.time_s for duel in won),
        decision_median_s=_median(duel.decision_median_s for duel in duels),
        decision_longest_s=max((d.decision_longest_s for d in duels if d.decision_longest_s is not None), default=None),
        time_lost_count=len(lost), time_lost_q25_s=quantile(lost, 0.25), time_lost_q75_s=quantile(lost, 0.75),
    )  # fmt: skip


def _median(values: Iterable[float | None]) -> float | None:
    given = [value for value in values if value is not None and math.isfinite(value)]
    return statistics.median(given) if given else None


def duels_csv(rows: Sequence[DuelRow]) -> str:
    """Return a CSV of a row a duel; what there is not is empty."""
    names = [field.name for kind in (DuelKey, DuelFigures) for field in fields(kind)]
    return csv_text(names, (row.as_dict().values() for row in rows))


def cells_csv(cells: Sequence[DuelCell]) -> str:
    """Return a CSV of a row a cell; what there is not is empty."""
    return csv_text([field.name for field in fields(DuelCell)], (astuple(cell) for cell in cells))


HEADER = (
    "planner", "track", "opponent", "duels", "overtaken", "95 % interval", "behind", "touches", "to blame for",
    "otherwise ended", "median time lost [s]", "quartiles [s]", "of overtakes", "median decision [us]",
)  # fmt: skip
"""Of the table for people."""

LEGEND = (
    "The interval is Wilson's at 95 %, of the share of duels that end with an overtake without a touch. Times lost are "
    'of these overtakes alone, "of overtakes" says of how many: their median with its quartiles. Decisions are the '
    "median of each duel's median."
)
"""What stands below the table."""


def table_rows(cells: Sequence[DuelCell]) -> list[tuple[str, ...]]:
    """Return a row a cell, as the table for people has it."""
    return [
        (
            cell.planner, cell.track, cell.opponent, str(cell.duels), f"{100.0 * cell.share:.1f} %",
            f"{100.0 * cell.low:.1f} to {100.0 * cell.high:.1f}", str(cell.behind), str(cell.touches),
            f"{cell.touches_planner} ({100.0 * cell.touches_planner / cell.duels:.1f} %)", str(cell.others),
            "-" if cell.time_lost_s is None else f"{cell.time_lost_s:.2f}",
            quartiles(cell.time_lost_q25_s, cell.time_lost_q75_s), str(cell.time_lost_count),
            "-" if cell.decision_median_s is None else f"{1e6 * cell.decision_median_s:.0f}",
        )
        for cell in cells
    ]  # fmt: skip


def markdown(cells: Sequence[DuelCell]) -> str:
    """Return a Markdown table: of each planner against each opponent on all tracks, and against all on each track."""
    chosen = [cell for cell in cells if cell.track == ALL] + [
        cell for cell in cells if cell.track != ALL and cell.opponent == ALL
    ]
    return markdown_table(HEADER, table_rows(chosen), ("planner", "track", "opponent"))


def ratio_picture(rows: Sequence[DuelRow], slowest: float, fastest: float, path: Path) -> None:
    """Draw the share of overtakes by the ratio of the speeds: a panel a planner, a line an opponent.

    Raises:
      MissingExtraError: matplotlib is not installed.
      OSError: the file cannot be written.
    """
    require_matplotlib()
    import matplotlib as mpl
    from matplotlib.figure import Figure

    planners = list(dict.fromkeys(row.key.planner for row in rows))
    opponents = list(dict.fromkeys(row.key.opponent for row in rows))
    style: Any = {"font.size": 8.0, "axes.linewidth": 0.6, "lines.linewidth": 1.0, "legend.frameon": False}
    with mpl.rc_context(style):
        figure = Figure(figsize=(3.6 * len(planners), 2.8), layout="constrained")
        panels = figure.subplots(1, len(planners), squeeze=False, sharey=True)[0]
        width = max(fastest - slowest, 1e-6) / _BANDS
        for axes, planner in zip(panels, planners, strict=True):
            for place, opponent in enumerate(opponents):
                points = []
                for band in range(_BANDS):
                    first = slowest + band * width
                    duels = [
                        row.figures.outcome == "overtaken"
                        for row in rows
                        if (row.key.planner, row.key.opponent) == (planner, opponent)
                        and row.figures.ratio is not None
                        and min(int((row.figures.ratio - slowest) / width), _BANDS - 1) == band
                    ]
                    if duels:
                        share = sum(duels) / len(duels)
                        low, high = wilson(sum(duels), len(duels))
                        aside = first + width * (0.5 + 0.08 * (place - 0.5 * (len(opponents) - 1)))
                        points.append((aside, share, share - low, high - share))
                if points:
                    x, shares, below, above = zip(*points, strict=True)
                    axes.errorbar(
                        x, shares, yerr=(below, above), label=opponent, color=_COLOURS[place % len(_COLOURS)],
                        marker="o", markersize=3.0, capsize=1.5, elinewidth=0.6,
                    )  # fmt: skip
            axes.set(title=planner, xlabel="speed of the opponent over the planner's own", ylim=(0.0, 1.03))
        panels[0].set_ylabel("overtaken within two laps, no touch")
        panels[0].legend(loc="lower left")
        save_figure(figure, path, _DPI)
