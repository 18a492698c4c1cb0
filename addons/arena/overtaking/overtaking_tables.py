"""The report of an overtaking study: CSV, Markdown, and a picture.

    duels.csv         a row a duel
    table.csv         a row for each planner and opponent on each track, and over all tracks
    table.md          the same over all tracks, and by track, as Markdown; and the differences over all tracks
    differences.csv   a row for each two planners on each track, over the duels that both drove
    table.png         the share of overtakes by the ratio of the speeds, for each opponent, with its interval

Intervals are those of `arena.intervals`, at 95 %. Times lost are of the overtakes alone: their median, its quartiles,
and how many they are.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from fg_mujoco.pictures.pages.figure_kit import COLOURS, picture
from fg_mujoco.pictures.pages.table import Table
from fg_mujoco.racing.entries import BOTH
from fg_mujoco.rollouts.rollout_result import wilson

from ..grid_study import GridCell
from ..intervals import ALL, Differences, Outcome, quantile, quartiles
from .duel import DuelFigures, DuelRow

DIFFERENCES = Differences(
    outcome=lambda row: (
        row.key.planner, (row.key.track, row.key.opponent, row.key.seed), (row.key.track,), _outcome(row.figures)
    ),
    names=(
        "planner", "reference", "track", "pairs", "overtaken", "reference_overtaken", "share_difference",
        "share_difference_low", "share_difference_high", "time_pairs", "time_lost_difference_s",
        "time_lost_difference_low_s", "time_lost_difference_high_s",
    ),
    everything=(ALL,),
    header=("planner", "minus", "pairs", "overtaken", "95 % interval", "pairs with times", "time lost [s]",
            "95 % interval [s]"),
    legend=(
        "Differences are within pairs of duels on the same track, behind the same opponent, with the same seed: of the "
        "share of overtakes in percentage points, with Newcombe's interval, and the median of those of the times lost "
        "where both overtook, with its interval by order statistics, which needs six pairs. All intervals are at 95 %."
    ),
)  # fmt: skip

_BANDS = 5  # of ratios in the picture


@dataclass(frozen=True, kw_only=True)
class DuelCell(GridCell):
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
    touches_planner: int  # that the planner is to blame for, alone or with the opponent
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
    to_blame = sum(duel.to_blame in ("planner", BOTH) for duel in duels)
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


def _outcome(duel: DuelFigures) -> Outcome:
    lost = duel.time_lost_s
    return duel.outcome == "overtaken", lost if lost is not None and math.isfinite(lost) else None


def cells_table(cells: Sequence[DuelCell]) -> Table:
    """Return the table for people: a row a cell."""
    return Table(
        header=(
            "planner", "track", "opponent", "duels", "overtaken", "95 % interval", "behind", "touches", "to blame for",
            "otherwise ended", "median time lost [s]", "quartiles [s]", "of overtakes", "median decision [us]",
        ),
        rows=[
            (
                cell.planner, cell.track, cell.opponent, cell.duels, f"{100.0 * cell.share:.1f} %",
                f"{100.0 * cell.low:.1f} to {100.0 * cell.high:.1f}", cell.behind, cell.touches,
                f"{cell.touches_planner} ({100.0 * cell.touches_planner / cell.duels:.1f} %)", cell.others,
                None if cell.time_lost_s is None else f"{cell.time_lost_s:.2f}",
                quartiles(cell.time_lost_q25_s, cell.time_lost_q75_s), cell.time_lost_count,
                None if cell.decision_median_s is None else f"{1e6 * cell.decision_median_s:.0f}",
            )
            for cell in cells
        ],
        left=("planner", "track", "opponent"),
        legend=(
            "The interval is Wilson's at 95 %, of the share of duels that end with an overtake without a touch. Times "
            'lost are of these overtakes alone, "of overtakes" says of how many: their median with its quartiles. '
            "Decisions are the median of each duel's median."
        ),
    )  # fmt: skip


def chosen_cells(cells: Sequence[DuelCell]) -> list[DuelCell]:
    """Return the cells of each planner against each opponent on all tracks, and then against all on each track."""
    over_all = [cell for cell in cells if cell.track == ALL]
    return over_all + [cell for cell in cells if cell.track != ALL and cell.opponent == ALL]


def ratio_picture(rows: Sequence[DuelRow], slowest: float, fastest: float, path: Path) -> None:
    """Draw the share of overtakes by the ratio of the speeds: a panel a planner, a line an opponent.

    Raises:
      MissingExtraError: matplotlib is not installed.
      OSError: the file cannot be written.
    """
    planners = list(dict.fromkeys(row.key.planner for row in rows))
    opponents = list(dict.fromkeys(row.key.opponent for row in rows))
    with picture(path, 3.6 * len(planners), 2.8) as figure:
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
                        x, shares, yerr=(below, above), label=opponent, color=COLOURS[place % len(COLOURS)],
                        marker="o", markersize=3.0, capsize=1.5, elinewidth=0.6,
                    )  # fmt: skip
            axes.set(title=planner, xlabel="speed of the opponent over the planner's own", ylim=(0.0, 1.03))
        panels[0].set_ylabel("overtaken within two laps, no touch")
        panels[0].legend(loc="lower left")
