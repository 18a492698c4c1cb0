"""What the plots of a report share: colours that read on light and on dark, frames, tools and the source of the ticks.

The plots are bokeh's. They are laid out here and drawn by its JavaScript in the browser; `report.js` gives them the
colours of the page and moves their cursors together.
"""

from __future__ import annotations

import importlib.util
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import missing_extra
from ...messages import FloatArray

if TYPE_CHECKING:
    from bokeh.models import ColumnDataSource
    from bokeh.plotting import figure as Figure  # noqa: N812 - a class, whatever its name


CAR, LAW, COMMAND, ALERT = "#2f7ed8", "#e07b00", "#8a8f98", "#e0314b"
TIRE_COLOURS = ("#0a84c6", "#59b4e0", "#d55e00", "#e69f00")  # front blue, rear orange; after Okabe and Ito
WALL, OBSTACLE = "#8a8f98", "#d9732b"


def speed_palette() -> tuple[str, ...]:
    """Return the colours of a scale: viridis without its darkest, which would be lost on a dark page."""
    from bokeh.palettes import Viridis256

    return tuple(Viridis256[52:])


def require_bokeh() -> None:
    """Make sure that reports can be made.

    Raises:
      MissingExtraError: bokeh is not installed; the message has the command that installs it.
    """
    if importlib.util.find_spec("bokeh") is None:
        raise missing_extra("report pages need Bokeh", "report")


def tick_source(columns: dict[str, FloatArray]) -> ColumnDataSource:
    """Return the source that all plots draw the ticks from, as 32-bit numbers: enough to look at."""
    from bokeh.models import ColumnDataSource

    return ColumnDataSource(
        data={name: np.asarray(values, dtype=np.float32) for name, values in columns.items()}, name="ticks"
    )


def cursor_source() -> ColumnDataSource:
    """Return the source of the dots that mark the cursor's tick; empty until there is one."""
    from bokeh.models import ColumnDataSource

    names = ("x_m", "y_m", "acceleration_left_m_s2", "acceleration_ahead_m_s2")
    return ColumnDataSource(data={name: [] for name in names}, name="cursor_source")


def new_figure(**settings: Any) -> Figure:
    """Return an empty plot on nothing, so that the page's colour is its own."""
    from bokeh.plotting import figure

    plot = figure(
        background_fill_color=None, border_fill_color=None, outline_line_color=None, output_backend="canvas", **settings
    )
    plot.toolbar.logo = None
    plot.grid.grid_line_alpha = 0.35
    plot.axis.axis_label_text_font_style = "normal"
    plot.axis.minor_tick_line_color = None
    return plot


def put_legend_above(plot: Figure) -> None:
    """Move the legend over the plot, in a row; a click on an entry hides its line."""
    legend = plot.legend[0]
    legend.update(
        orientation="horizontal", click_policy="hide", border_line_color=None, background_fill_color=None, padding=0,
        spacing=12, margin=0, label_text_font_size="12px", glyph_width=16, name="legend",
    )  # fmt: skip
    plot.add_layout(legend, "above")
