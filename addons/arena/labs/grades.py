"""The points of planners, and their tables."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from fg_mujoco.pictures.pages.table import Table

from ..grid_study import GridCell


@dataclass(frozen=True, kw_only=True)
class Checked:
    """A check of a planner."""

    number: int  # in the lab, from 0
    name: str
    asked: str
    measured: str
    passed: bool
    of: float  # points that there are

    @property
    def points(self) -> float:
        """That the planner has for it."""
        return self.of if self.passed else 0.0


@dataclass(frozen=True, kw_only=True)
class Grade(GridCell):
    """The points of a planner."""

    planner: str
    points: float
    of: float
    passed: int  # checks
    reason: str | None  # why it failed, where it did
    checks: tuple[Checked, ...]

    def as_dict(self) -> dict[str, Any]:
        """Return it as a row of the table: the points of each check by its name."""
        own = {name: getattr(self, name) for name in ("planner", "points", "of", "passed", "reason")}
        return own | {each.name: each.points for each in self.checks}


def grades_table(grades: Sequence[Grade]) -> Table:
    """Return a row for each planner: its points, in all and of each check."""
    names = [each.name for each in grades[0].checks]
    return Table(
        header=("planner", "points", *names, "why it failed"),
        rows=[
            (
                each.planner, f"{each.points:g} of {each.of:g}", *(f"{check.points:g}" for check in each.checks),
                each.reason,
            )
            for each in grades
        ],
        left=("planner", "why it failed"),
    )  # fmt: skip


def checks_table(grade: Grade) -> Table:
    """Return a row for each check of a planner."""
    rows = [
        (each.name, each.asked, each.measured, "yes" if each.passed else "no", f"{each.points:g} of {each.of:g}")
        for each in grade.checks
    ]
    rows.append((grade.planner, "", "", "", f"{grade.points:g} of {grade.of:g}"))
    return Table(
        header=("check", "asked", "measured", "passed", "points"), rows=rows,
        left=("check", "asked", "measured", "passed"),
    )  # fmt: skip
