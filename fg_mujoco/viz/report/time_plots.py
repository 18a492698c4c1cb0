"""Speed and its limit, steering, friction utilisation and sliding, over the distance driven or over time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...messages import FloatArray
from ...vehicle.car import WHEELS
from ...vehicle.tire_slip import SLIDING_SPEED, slides_above
from .plot_style import ALERT, CAR, COMMAND, LAW, TIRE_COLOURS, new_figure, put_legend_above

if TYPE_CHECKING:
    from bokeh.models import ColumnDataSource, UIElement
    from bokeh.plotting import figure as Figure  # noqa: N812 - a class, whatever its name

_HEIGHT = 185  # [px]


def time_plots(
    ticks: ColumnDataSource, columns: dict[str, FloatArray], lap_times: tuple[float, ...], model: str
) -> UIElement:
    """Return the plots, one below the other, with one axis; `report.js` switches it from distance to time.

    Args:
      ticks: source of all columns.
      columns: of `tick_columns`.
      lap_times: of the laps that were completed [s]; their ends are marked.
      model: of the tires.
    """
    from bokeh.layouts import gridplot
    from bokeh.models import Range1d

    end = float(columns["distance_m"][-1]) if len(columns["distance_m"]) else 1.0
    across = Range1d(0.0, max(end, 1e-3), bounds="auto", name="across")
    top = max(1.0, 1.15 * float(np.abs(columns["speed_m_s"]).max(initial=0.0)))
    lowest = min(0.0, 1.1 * float(columns["speed_m_s"].min(initial=0.0)))
    turn = max(0.05, 1.1 * float(np.abs(columns["steering_angle_rad"]).max(initial=0.0)))
    slide = max(1.4 * SLIDING_SPEED, 1.05 * float(columns["slide_m_s"].max(initial=0.0)))
    use = max(1.1, 1.05 * float(columns["friction_use"].max(initial=0.0)))

    speed = _panel("speed [m/s]", across, (lowest, top))
    _line(speed, ticks, "limit_speed_m_s", LAW, "the law's limit, √(g μ b / tan|steering|)", dashed=True)
    _line(speed, ticks, "command_speed_m_s", COMMAND, "commanded")
    _line(speed, ticks, "speed_m_s", CAR, "car", width=2.0)
    steering = _panel("steering [rad]", across, (-turn, turn))
    _line(steering, ticks, "command_steering_rad", COMMAND, "commanded")
    _line(steering, ticks, "steering_angle_rad", CAR, "car", width=2.0)
    friction = _panel("friction utilisation [-]", across, (0.0, use))
    sliding = _panel("sliding [m/s]", across, (0.0, slide))
    for wheel, colour in zip(WHEELS, TIRE_COLOURS, strict=True):
        _line(friction, ticks, f"friction_use_{wheel}", colour, wheel.replace("_", " "))
        _line(sliding, ticks, f"slide_{wheel}_m_s", colour, wheel.replace("_", " "))
    _mark_height(friction, 1.0)
    _mark_height(sliding, slides_above(model))

    panels = [speed, steering, friction, sliding]
    ends = np.cumsum(lap_times)
    for panel in panels:
        _mark_laps(panel, ends, np.interp(ends, columns["time_s"], columns["distance_m"]) if len(ends) else ends)
        put_legend_above(panel)
    for panel in panels[:-1]:
        panel.xaxis.visible = False
    panels[-1].xaxis.axis_label = "distance driven [m]"
    panels[-1].xaxis.name = "axis_across"
    panels[-1].height += 45
    return gridplot([[panel] for panel in panels], toolbar_location="right", sizing_mode="stretch_width",
                    merge_tools=True, toolbar_options={"logo": None})  # fmt: skip


def _panel(title: str, across: object, height: tuple[float, float]) -> Figure:
    from bokeh.models import BoxZoomTool, HoverTool, Span

    plot = new_figure(
        height=_HEIGHT, sizing_mode="stretch_width", x_range=across, y_range=height, y_axis_label=title,
        tools="xpan,xwheel_zoom,reset,save", active_scroll=None, min_border_left=64, min_border_right=8,
        name="over_time",
    )  # fmt: skip
    zoom = BoxZoomTool(dimensions="width")
    plot.add_tools(zoom)
    plot.toolbar.active_drag = zoom
    plot.add_layout(
        Span(location=0.0, dimension="height", line_color=COMMAND, line_width=1, visible=False, name="cursor")
    )
    plot.add_tools(HoverTool(mode="vline", line_policy="nearest", renderers=[], tooltips=[]))
    return plot


def _line(
    plot: Figure,
    ticks: ColumnDataSource,
    column: str,
    colour: str,
    label: str,
    *,
    dashed: bool = False,
    width: float = 1.3,
) -> None:
    """Draw a column; the plot's tooltip, which hangs on the line that was drawn last, tells its value."""
    from bokeh.models import HoverTool

    renderer = plot.line(
        "distance_m", column, source=ticks, line_color=colour, line_width=width, legend_label=label,
        line_dash=[6, 3] if dashed else [], line_join="round", name="across",
    )  # fmt: skip
    hover = plot.select_one(HoverTool)
    hover.renderers = [renderer]
    hover.tooltips = [*hover.tooltips, (label.partition(",")[0], f"@{column}{{0.000}}")]


def _mark_height(plot: Figure, height: float) -> None:
    from bokeh.models import Span

    plot.add_layout(Span(location=height, dimension="width", line_color=ALERT, line_dash=[5, 4], line_width=1))


def _mark_laps(plot: Figure, times: FloatArray, distances: FloatArray) -> None:
    """Mark where laps end, over time and over distance: `report.js` chooses."""
    from bokeh.models import Span

    for time, distance in zip(times.tolist(), distances.tolist(), strict=True):
        plot.add_layout(
            Span(
                location=distance, dimension="height", line_color=COMMAND, line_dash=[2, 3], line_width=1,
                name="lap_end", tags=[distance, time],
            )
        )  # fmt: skip
