"""The g-g diagram: the car's acceleration ahead and to the left in every tick, in the circle of mu g.

Source: Rice, "Measuring car-driver interaction with the g-g diagram", SAE 730018, 1973.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...messages import FloatArray
from .plot_style import ALERT, COMMAND, new_figure, speed_palette

if TYPE_CHECKING:
    from bokeh.models import ColumnDataSource
    from bokeh.plotting import figure as Figure  # noqa: N812 - a class, whatever its name


def gg_plot(ticks: ColumnDataSource, columns: dict[str, FloatArray], grip: float, cursor: ColumnDataSource) -> Figure:
    """Return the diagram.

    Args:
      ticks: source of all columns.
      columns: of `tick_columns`.
      grip: mu g [m/s^2].
      cursor: source of the dot at the cursor.
    """
    from bokeh.models import BoxZoomTool, HoverTool
    from bokeh.transform import linear_cmap

    ahead, left = columns["acceleration_ahead_m_s2"], columns["acceleration_left_m_s2"]
    # a car that crashes stops within a tick: what is far outside of the circle is left out of the picture
    reach = 1.12 * min(max(grip, float(np.hypot(ahead, left).max(initial=0.0))), 1.6 * grip)
    plot = new_figure(
        frame_width=330, frame_height=330, toolbar_location="above",
        x_range=(reach, -reach), y_range=(-reach, reach),  # left is left
        x_axis_label="acceleration to the left [m/s²]", y_axis_label="acceleration ahead [m/s²]",
        tools="pan,wheel_zoom,reset,save", active_scroll=None, name="gg",
    )  # fmt: skip
    zoom = BoxZoomTool(match_aspect=True)
    plot.add_tools(zoom)
    plot.toolbar.active_drag = zoom
    angle = np.linspace(0.0, 2.0 * np.pi, 181)
    for share, dash in ((0.5, [4, 4]), (1.0, [])):
        plot.line(share * grip * np.cos(angle), share * grip * np.sin(angle), line_dash=dash, line_width=1.5,
                  line_color=ALERT if share == 1.0 else COMMAND)  # fmt: skip
    top = max(1.0, float(np.abs(columns["speed_m_s"]).max(initial=0.0)))
    dots = plot.scatter(
        "acceleration_left_m_s2", "acceleration_ahead_m_s2", source=ticks, size=4, line_color=None, fill_alpha=0.75,
        fill_color=linear_cmap("speed_m_s", speed_palette(), 0.0, top),
    )  # fmt: skip
    plot.scatter("acceleration_left_m_s2", "acceleration_ahead_m_s2", source=cursor, size=13, fill_color="white",
                 line_color="black", line_width=2.5)  # fmt: skip
    plot.add_tools(
        HoverTool(
            renderers=[dots],
            tooltips=[("time", "@time_s{0.00} s"), ("ahead", "@acceleration_ahead_m_s2{0.0} m/s²"),
                      ("left", "@acceleration_left_m_s2{0.0} m/s²"), ("speed", "@speed_m_s{0.00} m/s")],
        )
    )  # fmt: skip
    return plot
