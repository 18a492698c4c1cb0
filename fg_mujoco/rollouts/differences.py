"""How two planners differ in the runs that both drove: the records and the table of a study.

What makes a course hard with a seed is hard for both. So the difference within such a pair of runs says more than that
of two averages does. Intervals are those of `intervals`, at 95 %, of each difference by itself.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import astuple, dataclass
from typing import Any

from ..pictures.pages.table import Table
from .intervals import Outcome, paired_by_planner

ALL = "all"
"""What stands for all courses, or all opponents."""


@dataclass(frozen=True, kw_only=True)
class Differences:
    """What a study calls the differences of two planners, each the planner's figure minus the reference's."""

    outcome: Callable[[Any], tuple[str, Hashable, Any, Outcome]]
    """Returns of a row its planner, what tells it from the planner's others, its group, and its outcome."""

    names: tuple[str, ...]  # of the planner, the reference, what runs are grouped by, and the figures of `Paired`
    everything: tuple[str | None, ...]  # what the group of all runs is called
    header: tuple[str, ...]  # of the table for people
    legend: str

    def of(self, rows: Iterable[Any]) -> tuple[dict[str, Any], ...]:
        """Return the differences of each two planners, over all runs and in each of several groups."""
        return tuple(
            dict(zip(self.names, (planner, reference, *(group or self.everything), *astuple(found)), strict=True))
            for planner, reference, group, found in paired_by_planner(map(self.outcome, rows))
        )

    def csv(self, found: Iterable[dict[str, Any]]) -> str:
        """Return all differences as CSV."""
        return Table.of(found, self.names).csv()

    def table(self, found: Sequence[dict[str, Any]]) -> Table | None:
        """Return the differences from the first planner over all runs, for people; None where there is one planner."""
        rows = []
        for each in found:
            planner, reference, *group, pairs, _, _, share, low, high, values, value, least, most = each.values()
            if tuple(group) == self.everything and reference == found[0][self.names[1]]:
                points = _signed("+.0f", *(None if end is None else 100.0 * end for end in (share, low, high)))
                rows.append((planner, reference, pairs, *points, values, *_signed("+.2f", value, least, most)))
        return Table(header=self.header, rows=rows, left=self.header[:2], legend=self.legend) if rows else None


def _signed(form: str, value: float | None, low: float | None, high: float | None) -> tuple[str | None, str | None]:
    """Return a difference and the ends of its interval as texts, with their signs."""
    ends = None if low is None or high is None else f"{low:{form}} to {high:{form}}"
    return None if value is None else f"{value:{form}}", ends
