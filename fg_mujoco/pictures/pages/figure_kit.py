"""Pictures by matplotlib, of the extra `plot`, in one style. In studies theory is a line, and measurements are points.

with picture("picture.png", WIDTH, 3.4) as figure:
    axes = figure.add_subplot()
    theory(axes, speed, limit, "mu g")
    measured(axes, speed, acceleration, "mu 0.5", colour=COLOURS[0])
    finish(axes, "speed [m/s]", "acceleration [m/s²]")
"""

from __future__ import annotations

import importlib.util
import io
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from ...course.writing import write_file
from ...errors import missing_extra

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Layout: TypeAlias = Literal["constrained"] | None
Target: TypeAlias = "str | Path | BinaryIO"
"""Where a picture is written: a file in one piece, or a file that is open."""

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000")
"""Of Okabe and Ito: told apart by the colour-blind too."""
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
"""In the order of COLOURS: told apart in grey too."""
ALERT = "#d00000"

WIDTH = 7.2  # [in] two columns of a paper
DPI = 150

_STYLE: Any = {
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
_UNDATED: dict[str, Any] = {"svg": {"Date": None}, "png": {"Software": None}, "pdf": {"CreationDate": None}}


def require_matplotlib() -> None:
    """Raise MissingExtraError, with the command that installs it, if there is no matplotlib."""
    if importlib.util.find_spec("matplotlib") is None:
        raise missing_extra("pictures need matplotlib", "plot")


@contextmanager
def picture(path: Target, width: float, height: float, layout: Layout = "constrained") -> Iterator[Figure]:
    """Yield an empty figure of a size [in], and write it as PNG at the end. A `$` in its texts is a `$`.

    Raises:
      MissingExtraError, OSError: matplotlib is not installed; the file cannot be written.
    """
    require_matplotlib()
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context({**_STYLE, "text.parse_math": False}):
        figure = Figure(figsize=(width, height), layout=layout, dpi=DPI)
        yield figure
        save_figure(figure, path)


def save_figure(figure: Figure, path: Target) -> None:
    """Write a figure as PNG: it is laid out and drawn once. The same figure is the same file."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    canvas: Any = FigureCanvasAgg(figure)

    def write(file: Any) -> None:
        canvas.print_png(file, metadata={"Software": None})  # `savefig` would draw it twice

    write_file(path, write) if isinstance(path, (str, Path)) else write(path)


def render(draw: Callable[[Figure], None], height: float, kind: str = "svg") -> bytes:
    """Draw a figure, as wide as a page, as a file of that kind: the same rows, the same bytes."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(WIDTH, height), layout="constrained")
        draw(figure)
        file = io.BytesIO()
        figure.savefig(file, format=kind, dpi=DPI, metadata=_UNDATED[kind])
    return file.getvalue()


def stacked(figure: Figure, heights: Sequence[float], below: Sequence[float], left: float, right: float) -> list[Axes]:
    """Return axes below each other in a figure without a layout, left to right, with room below each, all [in]."""
    width, height = figure.get_size_inches()
    bottoms = [sum(heights[place + 1 :]) + sum(below[place:]) for place in range(len(heights))]
    return [
        figure.add_axes((left / width, bottom / height, (right - left) / width, own / height))
        for bottom, own in zip(bottoms, heights, strict=True)
    ]


def theory(axes: Axes, x: ArrayLike, y: ArrayLike, label: str = "", *, colour: str = "0.25") -> None:
    """Draw a closed form as a line."""
    axes.plot(x, y, color=colour, linewidth=1.1, label=label or None, zorder=1.5)


def measured(
    axes: Axes, x: ArrayLike, y: ArrayLike, label: str = "", *, colour: str = COLOURS[0], **style: Any
) -> None:
    """Draw measurements as points, each colour with a marker of its own."""
    marker = MARKERS[COLOURS.index(colour)] if colour in COLOURS else MARKERS[0]
    axes.plot(x, y, **{"linestyle": "none", "marker": marker, "color": colour, "label": label or None, **style})


def limit(axes: Axes, y: float, label: str = "") -> None:
    """Draw a threshold as a broken line across."""
    axes.axhline(y, color="0.25", linewidth=0.8, linestyle=(0, (4, 2)), label=label or None, zorder=1.5)


def few_ticks(*panels: Axes) -> None:
    """Leave so few ticks on the horizontal axes that their numbers stand apart."""
    for axes in panels:
        axes.locator_params(axis="x", nbins=5)


def finish(axes: Axes, x_label: str, y_label: str, *, legend: bool = True) -> None:
    """Name the axes, with their units, and add the legend if there is anything in it."""
    axes.set(xlabel=x_label, ylabel=y_label)
    if legend and axes.get_legend_handles_labels()[1]:
        axes.legend()


def column(rows: Sequence[dict[str, Any]], name: str) -> Any:
    """Return a column of a table as numbers, NaN where there is none. Shape (n,)."""
    return np.array([np.nan if row.get(name) is None else row[name] for row in rows], dtype=np.float64)


def span(values: ArrayLike, form: str = ".3f") -> str:
    """Return the least and the greatest of some values that are numbers, as text; one, where both read alike."""
    known = np.asarray(values, np.float64)
    known = known[np.isfinite(known)]
    ends = dict.fromkeys(f"{end:{form}}" for end in (known.min(), known.max())) if len(known) else ("no number",)
    return " to ".join(ends)
