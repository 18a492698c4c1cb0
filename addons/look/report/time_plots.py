"""The plots of a report over the drive, and the g-g diagram: acceleration ahead and to the left, in the circle of mu g.

The g-g diagram is after Rice, "Measuring car-driver interaction with the g-g diagram", SAE 730018, 1973.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fg_mujoco.messages import FloatArray
from fg_mujoco.pictures.pages.bokeh_plots import (
    ALERT,
    CAR,
    COMMAND,
    LAW,
    TIRE_COLOURS,
    mark,
    new_panel,
    new_plot,
    put_legend_above,
    speed_palette,
    stacked,
)
from fg_mujoco.vehicle.car import WHEELS
from fg_mujoco.vehicle.tire_slip import SLIDING_SPEED, slides_above

if TYPE_CHECKING:
    from bokeh.models import ColumnDataSource, UIElement
    from bokeh.plotting import figure as Figure  # noqa: N812 - a class, whatever its name

_HEIGHT = 185  # [px]


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


def time_plots(
    ticks: ColumnDataSource, columns: dict[str, FloatArray], lap_times: tuple[float, ...], model: str
) -> UIElement:
    """Return the plots, one below the other, with one axis; `report.js` switches it from distance to time."""
    from bokeh.models import Range1d

    end = float(columns["distance_m"][-1]) if len(columns["distance_m"]) else 1.0
    across = Range1d(0.0, max(end, 1e-3), bounds="auto", name="across")
    top = max(1.0, 1.15 * float(np.abs(columns["speed_m_s"]).max(initial=0.0)))
    lowest = min(0.0, 1.1 * float(columns["speed_m_s"].min(initial=0.0)))
    turn = max(0.05, 1.1 * float(np.abs(columns["steering_angle_rad"]).max(initial=0.0)))
    slide = max(1.4 * SLIDING_SPEED, 1.05 * float(columns["slide_m_s"].max(initial=0.0)))
    use = max(1.1, 1.05 * float(columns["friction_utilisation"].max(initial=0.0)))

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
        _line(friction, ticks, f"friction_utilisation_{wheel}", colour, wheel.replace("_", " "))
        _line(sliding, ticks, f"slide_{wheel}_m_s", colour, wheel.replace("_", " "))
    mark(friction, [1.0], "width", ALERT)
    mark(sliding, [slides_above(model)], "width", ALERT)

    panels = [speed, steering, friction, sliding]
    if "ground_m" in columns:
        loads = [f"load_{wheel}_N" for wheel in WHEELS]
        lowest, highest = (float(bound) for bound in (columns["ground_m"].min(), columns["ground_m"].max()))
        height = _panel("ground [m]", across, (lowest - 0.05, highest + 0.05))
        _line(height, ticks, "ground_m", CAR, "height of the ground under the rear axle", width=2.0)
        load = _panel("load [N]", across, (0.0, max(1.0, 1.05 * max(float(columns[name].max()) for name in loads))))
        for wheel, colour in zip(WHEELS, TIRE_COLOURS, strict=True):
            _line(load, ticks, f"load_{wheel}_N", colour, wheel.replace("_", " "))
        panels += [height, load]
    ends = np.cumsum(lap_times)
    distances = np.interp(ends, columns["time_s"], columns["distance_m"]) if len(ends) else ends
    for panel in panels:
        for distance, time in zip(distances.tolist(), ends.tolist(), strict=True):  # `report.js` chooses
            mark(panel, [distance], line_dash=[2, 3], name="lap_end", tags=[distance, time])
        put_legend_above(panel)
    panels[-1].xaxis.name = "axis_across"
    return stacked(panels, "distance driven [m]")


def _panel(title: str, across: object, height: tuple[float, float]) -> Figure:
    from bokeh.models import HoverTool

    plot = new_panel(title, across, height, _HEIGHT, name="over_time")
    mark(plot, [0.0], line_dash=[], visible=False, name="cursor")
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


def gg_plot(ticks: ColumnDataSource, columns: dict[str, FloatArray], grip: float, cursor: ColumnDataSource) -> Figure:
    """Return the diagram of the columns of `tick_columns`, with a circle at the grip, mu g [m/s^2]."""
    from bokeh.models import HoverTool
    from bokeh.transform import linear_cmap

    ahead, left = columns["acceleration_ahead_m_s2"], columns["acceleration_left_m_s2"]
    # a car that crashes stops within a tick: what is far outside of the circle is left out of the picture
    reach = 1.12 * min(max(grip, float(np.hypot(ahead, left).max(initial=0.0))), 1.6 * grip)
    plot = new_plot(
        to_scale=True, frame_width=330, frame_height=330, toolbar_location="above",
        x_range=(reach, -reach), y_range=(-reach, reach),  # left is left
        x_axis_label="acceleration to the left [m/s²]", y_axis_label="acceleration ahead [m/s²]", name="gg",
    )  # fmt: skip
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
