"""Differences of two planners in the duels that both drove: the same start, opponent, distance and ratio of speeds.

Intervals are those of `studies.intervals`, at 95 %, of each difference by itself.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, astuple, dataclass, fields
from typing import Any

from ..intervals import Outcome, paired_by_planner
from ..tables import csv_text, difference_texts, markdown_table
from .duel import DuelFigures, DuelRow
from .tables import ALL


@dataclass(frozen=True, kw_only=True)
class DuelDifference:
    """Difference of a planner from another one, the reference: its figure minus the other's, duel by duel."""

    planner: str
    reference: str
    track: str  # or ALL
    pairs: int  # of duels on the same track, behind the same opponent, with the same seed
    overtaken: int  # by the planner in these
    reference_overtaken: int
    share_difference: float  # of the overtakes, from -1 to 1
    share_difference_low: float  # ends of Newcombe's interval
    share_difference_high: float
    time_pairs: int  # in which both overtook
    time_lost_difference_s: float | None  # median over these
    time_lost_difference_low_s: float | None  # ends of the median's interval; None of fewer than six pairs
    time_lost_difference_high_s: float | None

    def as_dict(self) -> dict[str, Any]:
        """Return the figures, as JSON has them."""
        return asdict(self)


def paired_differences(rows: Sequence[DuelRow]) -> tuple[DuelDifference, ...]:
    """Return the differences of each two planners, over all tracks and on each of several, in the order of rows."""
    outcomes = [
        (row.key.planner, (row.key.track, row.key.opponent, row.key.seed), row.key.track, _outcome(row.figures))
        for row in rows
    ]
    return tuple(
        DuelDifference(
            planner=planner, reference=reference, track=track or ALL, pairs=found.pairs, overtaken=found.successes,
            reference_overtaken=found.reference_successes, share_difference=found.share,
            share_difference_low=found.share_low, share_difference_high=found.share_high, time_pairs=found.values,
            time_lost_difference_s=found.value, time_lost_difference_low_s=found.value_low,
            time_lost_difference_high_s=found.value_high,
        )
        for planner, reference, track, found in paired_by_planner(outcomes)
    )  # fmt: skip


def _outcome(duel: DuelFigures) -> Outcome:
    lost = duel.time_lost_s
    return duel.outcome == "overtaken", lost if lost is not None and math.isfinite(lost) else None


def differences_csv(differences: Sequence[DuelDifference]) -> str:
    """Return a CSV of a row a difference; what there is not is empty."""
    return csv_text([field.name for field in fields(DuelDifference)], (astuple(each) for each in differences))


HEADER = (
    "planner", "minus", "pairs", "overtaken", "95 % interval", "pairs with times", "time lost [s]", "95 % interval [s]",
)  # fmt: skip
"""Of the table for people."""

LEGEND = (
    "Differences are within pairs of duels on the same track, behind the same opponent, with the same seed: of the "
    "share of overtakes in percentage points, with Newcombe's interval, and the median of those of the times lost "
    "where both overtook, with its interval by order statistics, which needs six pairs. All intervals are at 95 %."
)
"""What stands below the table."""


def difference_rows(differences: Sequence[DuelDifference]) -> list[tuple[str, ...]]:
    """Return the rows of the table for people: each other planner minus the first one, over all tracks."""
    return [
        (
            each.planner, each.reference, str(each.pairs),
            *difference_texts(
                each.share_difference, each.share_difference_low, each.share_difference_high, scale=100.0
            ),
            str(each.time_pairs),
            *difference_texts(
                each.time_lost_difference_s, each.time_lost_difference_low_s, each.time_lost_difference_high_s
            ),
        )
        for each in differences
        if each.track == ALL and each.reference == differences[0].reference
    ]  # fmt: skip


def differences_markdown(differences: Sequence[DuelDifference]) -> str:
    """Return the table for people as Markdown, with its legend; nothing where there is one planner."""
    if not differences:
        return ""
    return markdown_table(HEADER, difference_rows(differences), ("planner", "minus")) + f"\n{LEGEND}\n"
