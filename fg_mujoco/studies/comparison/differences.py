"""How two controllers differ in the runs that both drove: on the same course, at the same speed, with the same seed.

What makes a course hard with a seed is hard for both. So the difference within such a pair of runs says more than that
of two averages does. Intervals are those of `studies.intervals`, at 95 %, of each difference by itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any

from ..intervals import paired_by_planner
from ..tables import csv_text, difference_texts, markdown_table
from .run import RunRow

ALL = "all"
"""What stands for all courses and speeds."""


@dataclass(frozen=True, kw_only=True)
class PairedDifference:
    """How a controller differs from another one, the reference: its figure minus the other's, run by run."""

    controller: str
    reference: str
    course: str  # or ALL
    max_speed_m_s: float | None  # None: all
    pairs: int  # of runs on the same course, at the same speed, with the same seed
    successes: int  # of the controller in these
    reference_successes: int
    success_difference: float  # of the shares, from -1 to 1
    success_difference_low: float  # ends of Newcombe's interval
    success_difference_high: float
    lap_pairs: int  # in which both succeeded
    best_lap_difference_s: float | None  # median over these
    best_lap_difference_low_s: float | None  # ends of the median's interval; None of fewer than six pairs
    best_lap_difference_high_s: float | None

    def as_dict(self) -> dict[str, Any]:
        """Return the figures, as JSON has them."""
        return asdict(self)


def paired_differences(rows: Sequence[RunRow]) -> tuple[PairedDifference, ...]:
    """Return the differences of each two controllers, over all courses and on each of several, in the order of rows."""
    outcomes = [
        (
            row.key.controller, (row.key.course, row.key.course_sha256, row.key.max_speed_m_s, row.key.seed),
            (row.key.course, row.key.max_speed_m_s), (row.figures.success, row.figures.best_lap_s),
        )
        for row in rows
    ]  # fmt: skip
    return tuple(
        PairedDifference(
            controller=controller, reference=reference, course=group[0] if group else ALL,
            max_speed_m_s=group[1] if group else None, pairs=found.pairs, successes=found.successes,
            reference_successes=found.reference_successes, success_difference=found.share,
            success_difference_low=found.share_low, success_difference_high=found.share_high, lap_pairs=found.values,
            best_lap_difference_s=found.value, best_lap_difference_low_s=found.value_low,
            best_lap_difference_high_s=found.value_high,
        )
        for controller, reference, group, found in paired_by_planner(outcomes)
    )  # fmt: skip


def differences_csv(differences: Sequence[PairedDifference]) -> str:
    """Return a CSV of a row a difference; what there is not is empty."""
    return csv_text([f.name for f in fields(PairedDifference)], (each.as_dict().values() for each in differences))


HEADER = (
    "controller", "minus", "pairs", "success", "95 % interval", "pairs with laps", "best lap [s]", "95 % interval [s]",
)  # fmt: skip
"""Of the table for people."""

LEGEND = (
    "Differences are within pairs of runs on the same course, at the same speed, with the same seed: of the share of "
    "successes in percentage points, with Newcombe's interval, and the median of those of the best laps where both "
    "succeeded, with its interval by order statistics, which needs six pairs. All intervals are at 95 %."
)
"""What stands below the table."""


def shown_differences(differences: Sequence[PairedDifference]) -> list[PairedDifference]:
    """Return the differences that the table for people has: from the first controller, over all courses."""
    return [each for each in differences if each.course == ALL and each.reference == differences[0].reference]


def difference_rows(differences: Sequence[PairedDifference]) -> list[tuple[str, ...]]:
    """Return a row a difference, as the table for people has it."""
    return [
        (
            each.controller, each.reference, str(each.pairs),
            *difference_texts(
                each.success_difference, each.success_difference_low, each.success_difference_high, scale=100.0
            ),
            str(each.lap_pairs),
            *difference_texts(
                each.best_lap_difference_s, each.best_lap_difference_low_s, each.best_lap_difference_high_s
            ),
        )
        for each in differences
    ]  # fmt: skip


def differences_markdown(differences: Sequence[PairedDifference]) -> str:
    """Return the table for people as Markdown, with its legend; nothing where there is one controller."""
    chosen = shown_differences(differences) if differences else []
    if not chosen:
        return ""
    return markdown_table(HEADER, difference_rows(chosen), ("controller", "minus")) + f"\n{LEGEND}\n"
