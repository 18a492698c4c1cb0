"""The one style of the lab's figures: theory is a line, what was measured are points.

axes = figure.add_subplot()
theory(axes, speed, limit, "mu g")
measured(axes, speed, acceleration, "mu 0.5", colour=COLOURS[0])
finish(axes, "speed [m/s]", "acceleration [m/s²]")
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

if TYPE_CHECKING:
    import matplotlib.axes

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000")
"""Of Okabe and Ito: told apart by the colour-blind too."""
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
"""In the order of COLOURS: told apart in grey too."""

WIDTH = 7.2  # [in] two columns of a paper

STYLE: Any = {
    "font.size": 8.0,
    "axes.linewidth": 0.6,
    "axes.axisbelow": True,
    "axes.grid": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "grid.color": "0.9",
    "grid.linewidth": 0.5,
    "legend.frameon": False,
    "lines.linewidth": 1.0,
    "lines.markersize": 3.5,
    "svg.hashsalt": "fg_mujoco",  # the same rows, the same file
}
"""What matplotlib is set to while a figure is drawn."""


def theory(axes: matplotlib.axes.Axes, x: ArrayLike, y: ArrayLike, label: str = "", *, colour: str = "0.25") -> None:
    """Draw a closed form as a line."""
    axes.plot(x, y, color=colour, linewidth=1.1, label=label or None, zorder=1.5)


def measured(
    axes: matplotlib.axes.Axes, x: ArrayLike, y: ArrayLike, label: str = "", *, colour: str = COLOURS[0], **style: Any
) -> None:
    """Draw measurements as points, each colour with a marker of its own."""
    marker = MARKERS[COLOURS.index(colour)] if colour in COLOURS else MARKERS[0]
    axes.plot(x, y, **{"linestyle": "none", "marker": marker, "color": colour, "label": label or None, **style})


def limit(axes: matplotlib.axes.Axes, y: float, label: str = "") -> None:
    """Draw a threshold as a broken line across."""
    axes.axhline(y, color="0.25", linewidth=0.8, linestyle=(0, (4, 2)), label=label or None, zorder=1.5)


def finish(axes: matplotlib.axes.Axes, x_label: str, y_label: str, *, legend: bool = True) -> None:
    """Name the axes, with their units, and add the legend if there is anything in it."""
    axes.set_xlabel(x_label)
    axes.set_ylabel(y_label)
    if legend and axes.get_legend_handles_labels()[1]:
        axes.legend()


def column(rows: Sequence[dict[str, Any]], name: str) -> Any:
    """Return a column of a table as numbers, NaN where there is none. Shape (n,)."""
    return np.array([np.nan if row.get(name) is None else row[name] for row in rows], dtype=np.float64)
