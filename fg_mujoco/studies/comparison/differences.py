"""How two controllers differ in the runs that both drove: on the same course, at the same speed, with the same seed.

What makes a course hard with a seed is hard for both. So the difference within such a pair of runs says more than that
of two averages does. Intervals are those of `studies.intervals`, at 95 %, of each difference by itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from itertools import combinations
from typing import Any

from ..intervals import Outcome, paired
from ..tables import csv_text, difference_texts, markdown_table
from .run import RunFigures, RunKey, RunRow

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
    by_controller: dict[str, dict[Any, RunRow]] = {}
    for row in rows:
        by_controller.setdefault(row.key.controller, {})[_place(row.key)] = row
    found = []
    for reference, controller in combinations(by_controller, 2):
        ours, theirs = by_controller[controller], by_controller[reference]
        groups: dict[tuple[str, float | None], list[tuple[RunFigures, RunFigures]]] = {}
        for place, other in theirs.items():
            if place in ours:
                pair = (ours[place].figures, other.figures)
                groups.setdefault((ALL, None), []).append(pair)
                groups.setdefault((other.key.course, other.key.max_speed_m_s), []).append(pair)
        for (course, speed), pairs in groups.items():
            if course == ALL or len(groups) > 2:
                found.append(_difference(controller, reference, course, speed, pairs))
    return tuple(found)


def _place(key: RunKey) -> tuple[Any, ...]:
    return key.course, key.course_sha256, key.max_speed_m_s, key.seed


def _difference(
    controller: str,
    reference: str,
    course: str,
    speed: float | None,
    pairs: Sequence[tuple[RunFigures, RunFigures]],
) -> PairedDifference:
    found = paired([_outcome(ours) for ours, _ in pairs], [_outcome(theirs) for _, theirs in pairs])
    return PairedDifference(
        controller=controller, reference=reference, course=course, max_speed_m_s=speed, pairs=found.pairs,
        successes=found.successes, reference_successes=found.reference_successes, success_difference=found.share,
        success_difference_low=found.share_low, success_difference_high=found.share_high, lap_pairs=found.values,
        best_lap_difference_s=found.value, best_lap_difference_low_s=found.value_low,
        best_lap_difference_high_s=found.value_high,
    )  # fmt: skip


def _outcome(run: RunFigures) -> Outcome:
    return run.success, run.best_lap_s


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
