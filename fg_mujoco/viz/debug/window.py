"""A window of a run's decisions, as the page and the picture take it."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

from ...display import brief, quoted
from ...messages import FloatArray
from ..report.recorded import RecordedRun
from .decisions import Decision


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Window:
    """Some decisions in a row, and what they are shown with."""

    run: RecordedRun = field(repr=False)
    decisions: tuple[Decision, ...] = field(repr=False)  # in order
    at: int  # place among them of the one that was asked for
    notes: tuple[str, ...]  # what is missing or differs, a sentence each
    walls: list[FloatArray] = field(repr=False)  # outlines near the window, each (k, 2) [m], world frame
    moving: list[list[FloatArray]] = field(repr=False)  # outlines of what moves, in each decision

    def __repr__(self) -> str:
        first, last = self.decisions[0].time, self.decisions[-1].time
        span = f"{len(self.decisions)} decisions, {first:.3f} to {last:.3f} s"
        return brief(self, quoted(self.run.source), span, f"at {self.chosen.time:.3f} s")

    @property
    def chosen(self) -> Decision:
        """The decision that was asked for."""
        return self.decisions[self.at]

    @property
    def laws(self) -> list[str]:
        """Name of the step that holds the speed, in each decision."""
        return [_law(decision) for decision in self.decisions]

    @property
    def stretches(self) -> list[tuple[int, int, str]]:
        """Where one step holds the speed: the first decision, the one behind the last, and the step's name."""
        laws = self.laws
        changes = [0, *(i for i in range(1, len(laws)) if laws[i] != laws[i - 1]), len(laws)]
        return [(first, end, laws[first]) for first, end in pairwise(changes)]


def _law(decision: Decision) -> str:
    step = decision.speed_step
    return "the planner failed" if decision.failure else "not known" if step is None else step.name
