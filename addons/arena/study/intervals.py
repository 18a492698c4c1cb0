"""Intervals at 95 % of what studies count and measure, and how two planners differ in the runs that both drove.

What makes a course hard with a seed is hard for both planners. So the difference within such a pair of runs says more
than that of two averages does. `Differences` has the records and the table of them.

`shares.wilson` is the interval of a share.

`share_difference`, of the difference of two shares of the same runs: R. Newcombe, Improved confidence intervals for the
difference between binomial proportions based on paired data, Statistics in Medicine 17, 1998, method 10.

`median_interval`, of a median, whatever the distribution of the values is: W. Thompson, On confidence ranges for the
median and other expectation distributions for populations of unknown distribution form, Annals of Mathematical
Statistics 7, 1936.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Hashable, Iterable, Iterator, Sequence
from dataclasses import astuple, dataclass
from itertools import combinations
from typing import TYPE_CHECKING, Any

from fg_mujoco.pictures.pages.table import Table
from fg_mujoco.rollouts.shares import wilson

if TYPE_CHECKING:
    from ..runs.run import RunRow

_TAIL = 40  # one part in so many, on either side: 2.5 %


def varied(runs: Iterable[Hashable]) -> bool:
    """Return whether two runs are unlike. Of a single one, or of copies of one, intervals and quartiles say nothing."""
    return len(set(runs)) > 1


def share_difference(pairs: Sequence[tuple[bool, bool]]) -> tuple[float, float, float]:
    """Return the share of the first of some pairs minus that of the second, and its interval at 95 %.

    Args:
      pairs: of each run, whether the one and whether the other succeeded; of none the difference is NaN.
    """
    count = len(pairs)
    if count == 0:
        return math.nan, -1.0, 1.0
    both, first, second = (pairs.count(each) for each in ((True, True), (True, False), (False, True)))
    neither = count - both - first - second
    share, other = (both + first) / count, (both + second) / count
    (low, high), (other_low, other_high) = wilson(both + first, count), wilson(both + second, count)
    product = (both + first) * (second + neither) * (both + second) * (first + neither)
    excess: float = both * neither - first * second
    if excess > 0:  # corrected for continuity
        excess = max(excess - count / 2.0, 0.0)
    phi = excess / math.sqrt(product) if product else 0.0
    below = (share - low) ** 2 - 2.0 * phi * (share - low) * (other_high - other) + (other_high - other) ** 2
    above = (high - share) ** 2 - 2.0 * phi * (high - share) * (other - other_low) + (other - other_low) ** 2
    difference = (first - second) / count
    return difference, difference - math.sqrt(max(below, 0.0)), difference + math.sqrt(max(above, 0.0))


def median_interval(values: Sequence[float]) -> tuple[float, float] | None:
    """Return the interval of the median of some values at 95 % or a little more; None of fewer than six.

    Its ends are the values of which as many lie below the one as above the other: with n values the k-th and the one
    before the last k - 1, for the greatest k at which fewer than k of n tosses of a coin are heads in 2.5 % at most.
    """
    order, count = sorted(values), len(values)
    place, ways = 0, 0  # of the 2^n ways in which the tosses may fall
    while place < count and (ways := ways + math.comb(count, place)) * _TAIL <= 2**count:
        place += 1
    return (order[place - 1], order[count - place]) if place else None


Outcome = tuple[bool, float | None]
"""Of a run: whether it succeeded, and a figure of those that did, such as its best lap."""


@dataclass(frozen=True, kw_only=True)
class Paired:
    """How one planner differs from another one, the reference, in the same runs: its figure minus the other's."""

    pairs: int
    successes: int
    reference_successes: int
    share: float  # of the successes; NaN of no pairs
    share_low: float | None  # None where all pairs are alike
    share_high: float | None
    values: int  # pairs in which both succeeded and have a figure
    value: float | None  # median of its differences over these
    value_low: float | None  # None of fewer than six, or where all pairs are alike
    value_high: float | None


def paired(outcomes: Sequence[Outcome], reference: Sequence[Outcome]) -> Paired:
    """Return the differences of the outcomes of two planners, run by run, with their intervals."""
    succeeded = [(ours, theirs) for (ours, _), (theirs, _) in zip(outcomes, reference, strict=True)]
    varies = varied(zip(outcomes, reference, strict=True))
    share, *ends = share_difference(succeeded)
    share_low, share_high = ends if varies else (None, None)
    values = [
        value - other
        for (ours, value), (theirs, other) in zip(outcomes, reference, strict=True)
        if ours and theirs and value is not None and other is not None
    ]
    low, high = (median_interval(values) if varies else None) or (None, None)
    return Paired(
        pairs=len(succeeded), successes=sum(ours for ours, _ in succeeded),
        reference_successes=sum(theirs for _, theirs in succeeded), share=share, share_low=share_low,
        share_high=share_high, values=len(values), value=statistics.median(values) if values else None,
        value_low=low, value_high=high,
    )  # fmt: skip


def paired_by_planner(
    outcomes: Iterable[tuple[str, Hashable, Any, Outcome]],
) -> Iterator[tuple[str, str, Any, Paired]]:
    """Yield how each two planners differ in the runs that both drove: over all, and in each of several groups.

    Args:
      outcomes: of each run its planner, what tells it from the planner's others, its group, and its outcome.

    Yields:
      The planner, the reference, the group (None: all runs), and their differences.
    """
    by_planner: dict[str, dict[Hashable, tuple[Any, Outcome]]] = {}
    for planner, place, group, outcome in outcomes:
        by_planner.setdefault(planner, {})[place] = group, outcome
    for reference, planner in combinations(by_planner, 2):
        ours, theirs = by_planner[planner], by_planner[reference]
        groups: dict[Any, list[tuple[Outcome, Outcome]]] = {}
        for place, (group, other) in theirs.items():
            for each in (None, group) if place in ours else ():
                groups.setdefault(each, []).append((ours[place][1], other))
        for group, pairs in groups.items():
            if group is None or len(groups) > 2:
                yield planner, reference, group, paired([own for own, _ in pairs], [other for _, other in pairs])


ALL = "all"
"""What stands for all courses, or all opponents."""

PAIRED = ("pairs", "successes", "reference_successes", "difference", "difference_low", "difference_high")


@dataclass(frozen=True, kw_only=True)
class Differences:
    """How two planners differ, each the planner's figure minus the reference's, in the runs that both drove."""

    by: tuple[str, ...]  # names of what groups of runs are of
    value: str  # figure of the runs that succeeded
    title: str  # of it in the table
    success: str  # what a success is called

    def of(self, rows: Iterable[RunRow]) -> tuple[dict[str, Any], ...]:
        """Return the differences of each two planners, over all runs and in each of several groups."""
        outcomes = [
            (row.car.planner, tuple(value for name, value in row.place.items() if name != "planner"),
             tuple(row.place.get(name) for name in self.by),
             (row.car.success, row.lines()[0].get(self.value)))
            for row in rows
        ]  # fmt: skip
        ends = ("pairs", "difference", "difference_low", "difference_high")
        names = ("planner", "reference", *self.by, *PAIRED, *(f"{self.value}_{end}" for end in ends))
        return tuple(
            dict(zip(names, (planner, reference, *(group or (ALL,) * len(self.by)), *astuple(found)), strict=True))
            for planner, reference, group, found in paired_by_planner(outcomes)
        )

    def table(self, found: Sequence[dict[str, Any]]) -> Table | None:
        """Return the differences from the first planner over all runs, for people; None where there is one planner."""
        rows = []
        for each in found:
            if each["reference"] == found[0]["reference"] and all(each[name] == ALL for name in self.by):
                points = (each[name] and 100.0 * each[name] for name in PAIRED[3:])
                value, low, high = (each[f"{self.value}_{end}"] for end in PAIRED[3:])
                rows.append(
                    (each["planner"], each["reference"], each["pairs"], *_signed("+.0f", *points),
                     each[f"{self.value}_pairs"], *_signed("+.2f", value, low, high))
                )  # fmt: skip
        header = (
            "planner", "compared with", "pairs", self.success, "95 % interval", f"pairs, {self.title}", self.title,
            "95 % interval, of the same",
        )  # fmt: skip
        legend = (
            "Each pair is two runs in the same conditions. Share of successes: difference in percentage points, with "
            f"Newcombe's interval at 95 %. {self.title}: median difference over the pairs in which both succeeded, "
            "with the interval of order statistics at 95 %, from six pairs on."
        )
        return Table(header=header, rows=rows, left=header[:2], legend=legend) if rows else None


def _signed(form: str, value: float | None, low: float | None, high: float | None) -> tuple[str | None, str | None]:
    """Return a difference and the ends of its interval as texts, with their signs."""
    ends = None if low is None or high is None else f"{low:{form}} to {high:{form}}"
    return None if value is None else f"{value:{form}}", ends
