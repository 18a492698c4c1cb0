"""An experiment of the friction lab: cells of work, the rows that they yield, and a section of the report.

A cell is some seconds of work on one core. It is described completely in JSON, so that any process can measure it, and
it is not measured again if its rows are on disk.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

from ..errors import SettingsError
from ..messages import require_whole, shown
from ..pictures.pages.figure_kit import render
from ..vehicle.changes import GREATEST_MU
from ..vehicle.tires import CONTACT, IDEAL_TIRES

if TYPE_CHECKING:
    import matplotlib.figure

ON_CIRCLES = "skidpad"
"""The experiment that takes frictions and steering angles."""

LAW_TIRES = (IDEAL_TIRES, CONTACT)
"""The sets of tires that the law itself is measured on: ours, and MuJoCo's contacts, which were not made for it. Each
is driven at a timestep at which it is right when it slides."""

Cell: TypeAlias = dict[str, Any]
"""One unit of work: names to JSON values."""

Row: TypeAlias = dict[str, "float | int | str | bool | None"]
"""One line of a CSV: names, with their units, to values. NaN where there is no number, and then `reason` says why."""

Tables: TypeAlias = dict[str, list[Row]]
"""Rows by the names of their tables."""


@dataclass(frozen=True, kw_only=True)
class LabSettings:
    """Settings that all experiments share.

    Raises:
      SettingsError: a friction or steering angle that no cell can be measured at.
    """

    quick: bool = False  # a sub-grid only, for tests and a first look
    seed: int = 0  # of whatever is drawn
    mus: tuple[float, ...] | None = None  # [-] of the tires, in ON_CIRCLES; None: the experiment's own
    steerings: tuple[float, ...] | None = None  # [rad] in ON_CIRCLES; None: the experiment's own

    def __post_init__(self) -> None:
        require_whole("seed", self.seed, 0)
        if not isinstance(self.quick, bool):
            raise SettingsError(f"quick is {shown(self.quick)}; accepted: True or False")
        for name, values in (("mu", self.mus), ("steering", self.steerings)):
            numbers = isinstance(values, (tuple, list)) and all(isinstance(each, (int, float)) for each in values)
            if values is not None and (not numbers or not values or len(set(values)) < len(values)):
                raise SettingsError(f"{name} is {shown(values)}; accepted: one number or more, each once")
        for mu in self.mus or ():
            if not 0.0 < mu <= GREATEST_MU:
                raise SettingsError(
                    f"mu is {mu!r}; accepted: friction coefficients of the tires above 0, up to {GREATEST_MU:g}"
                )
        for steering in self.steerings or ():
            if not 0.0 < steering <= _lock():
                why = ", at which the law's speed is infinite" if steering == 0.0 else ""
                raise SettingsError(
                    f"steering is {steering!r}{why}; "
                    f"accepted: angles above 0, up to the car's lock of {_lock():g} rad; "
                    "each is measured to the left and to the right"
                )


@lru_cache(maxsize=1)
def _lock() -> float:
    """Return the greatest steering angle of the car [rad]."""
    from ..vehicle.vehicle import Vehicle

    return Vehicle.load().parameters.max_steering_angle


@dataclass(frozen=True, kw_only=True)
class Figure:
    """A figure of the report. `draw` gets an empty matplotlib figure, whose style and size are the lab's."""

    name: str  # of the file, without experiment and ending
    caption: str
    draw: Callable[[matplotlib.figure.Figure], None]
    height: float = 3.4  # [in]; all are as wide as the page

    def render(self, kind: str = "svg") -> bytes:
        """Draw the figure as a file of that kind."""
        return render(self.draw, self.height, kind)


@dataclass(frozen=True, kw_only=True)
class Section:
    """The section of an experiment in the report, the result first."""

    sentences: tuple[str, ...]  # with the measured numbers
    figures: tuple[Figure, ...] = ()
    columns: dict[str, tuple[str, ...]] = field(default_factory=dict)  # of each table that the report shows
    expected: tuple[tuple[str, str, str], ...] = ()  # what, asked, measured


class Experiment(Protocol):
    """An experiment of the lab."""

    name: str  # on the command line, and of its files
    title: str  # of its section

    def cells(self, settings: LabSettings) -> list[Cell]:
        """Return the whole work, in order; the same for the same settings."""

    def measure(self, cell: Cell) -> Tables:
        """Measure one cell, in any process: the same cell, the same rows."""

    def section(self, tables: Tables) -> Section:
        """Write the section from the rows of all cells, in the order of the cells."""


def no_number(reason: str, *names: str) -> Row:
    """Return NaN for each of `names`, and the reason: for a cell that cannot be measured."""
    return {**dict.fromkeys(names, math.nan), "reason": reason}
