"""Plots that can be zoomed, in one style: colours that read on light and on dark, frames, tools and legends.

They are bokeh's: laid out here, and drawn by its JavaScript in the browser, in the colours of the page by `page.js`.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from ...display import Html
from ...errors import missing_extra

if TYPE_CHECKING:
    from bokeh.models import UIElement
    from bokeh.plotting import figure as Figure  # noqa: N812 - a class, whatever its name

CAR, LAW, COMMAND, ALERT = "#2f7ed8", "#e07b00", "#8a8f98", "#e0314b"
TIRE_COLOURS = ("#0a84c6", "#59b4e0", "#d55e00", "#e69f00")  # front blue, rear orange; after Okabe and Ito
WALL, OBSTACLE = "#8a8f98", "#d9732b"

_AXIS_HEIGHT = 45  # [px] of the one axis below stacked plots


def require_bokeh() -> None:
    """Raise MissingExtraError, with the command that installs it, if there is no bokeh."""
    if importlib.util.find_spec("bokeh") is None:
        raise missing_extra("report pages need Bokeh", "report")


def library() -> str:
    """Return bokeh's JavaScript."""
    from bokeh.resources import Resources

    return "\n".join(Resources(mode="inline", components=["bokeh"], log_level="error").js_raw)


def embed(plots: Mapping[str, UIElement]) -> tuple[str, dict[str, Html]]:
    """Return the JavaScript that draws some plots on a page, and for each the element in which it does."""
    from bokeh.embed import components

    script, places = components(plots, wrap_script=False)
    return script, {name: Html(place) for name, place in places.items()}


def speed_palette() -> tuple[str, ...]:
    """Return the colours of a scale: viridis without its darkest, which would be lost on a dark page."""
    from bokeh.palettes import Viridis256

    return tuple(Viridis256[52:])


def new_plot(*, along: bool = False, to_scale: bool = False, **settings: Any) -> Figure:
    """Return an empty plot on nothing, so that the page's colour is its own; `settings` are of bokeh's `figure`.

    With `along` it is moved and zoomed along its horizontal axis alone; with `to_scale` both axes keep the same scale.
    """
    from bokeh.models import BoxZoomTool
    from bokeh.plotting import figure

    plot = figure(
        background_fill_color=None, border_fill_color=None, outline_line_color=None, output_backend="canvas",
        tools="xpan,xwheel_zoom,reset,save" if along else "pan,wheel_zoom,reset,save", active_scroll=None, **settings,
    )  # fmt: skip
    zoom = BoxZoomTool(dimensions="width" if along else "both", match_aspect=to_scale)
    plot.add_tools(zoom)
    plot.toolbar.update(logo=None, active_drag=zoom)
    plot.grid.grid_line_alpha = 0.35
    plot.axis.axis_label_text_font_style = "normal"
    plot.axis.minor_tick_line_color = None
    return plot


def new_panel(title: str, across: object, height: tuple[float, float], pixels: int, **settings: Any) -> Figure:
    """Return an empty plot of those that `stacked` puts below each other, with one horizontal axis."""
    return new_plot(
        along=True, height=pixels, sizing_mode="stretch_width", x_range=across, y_range=height, y_axis_label=title,
        min_border_left=64, min_border_right=8, **settings,
    )  # fmt: skip


def stacked(panels: Sequence[Figure], label: str) -> UIElement:
    """Return panels below each other, with one set of tools, and this label below the last."""
    from bokeh.layouts import gridplot

    for panel in panels[:-1]:
        panel.xaxis.visible = False
    panels[-1].xaxis.axis_label = label
    panels[-1].height += _AXIS_HEIGHT
    return gridplot([[panel] for panel in panels], toolbar_location="right", sizing_mode="stretch_width",
                    merge_tools=True, toolbar_options={"logo": None})  # fmt: skip


def mark(plot: Figure, places: Iterable[float], side: str = "height", colour: str = COMMAND, **settings: Any) -> None:
    """Draw dashed lines at places: of the horizontal axis ("height") or of the vertical one ("width")."""
    from bokeh.models import Span

    for place in places:
        style = {"line_color": colour, "line_dash": [5, 4], "line_width": 1, **settings}
        plot.add_layout(Span(location=place, dimension=side, **style))


def put_legend_above(plot: Figure) -> None:
    """Move the legend over the plot, in a row; a click on an entry hides its line."""
    legend = plot.legend[0]
    legend.update(
        orientation="horizontal", click_policy="hide", border_line_color=None, background_fill_color=None, padding=0,
        spacing=12, margin=0, label_text_font_size="12px", glyph_width=16, name="legend",
    )  # fmt: skip
    plot.add_layout(legend, "above")
