"""The course from above, and the driven line on it in the colour of its speed, friction utilisation or sliding."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fg_mujoco.messages import FloatArray
from fg_mujoco.pictures.pages.bokeh_plots import ALERT, OBSTACLE, WALL, new_plot, put_legend_above, speed_palette
from fg_mujoco.racing.crash import Crash, Rollover
from fg_mujoco.simulation.cars import car_colour_hex
from fg_mujoco.simulation.termination import WrongWay
from fg_mujoco.vehicle.tire_slip import SLIDING_SPEED

from .laps_and_slides import SlideEvent
from .recorded import MapShapes

if TYPE_CHECKING:
    from bokeh.models import ColumnDataSource
    from bokeh.plotting import figure as Figure  # noqa: N812 - a class, whatever its name

_MARGIN = 0.5  # [m] round the walls
_HEIGHT = (260, 560)  # [px] least and greatest
_WIDTH = 900  # [px] about what the page gives it


def map_plot(
    shapes: MapShapes,
    columns: dict[str, FloatArray],
    events: tuple[SlideEvent, ...],
    cursor: ColumnDataSource,
    wrong_way: WrongWay | None = None,
    crash: Crash | Rollover | None = None,
    others: Sequence[tuple[int, FloatArray]] = (),
    contacts: Sequence[Mapping[str, Any]] = (),
) -> Figure:
    """Return the map. Its line is of one piece a tick, and `report.js` switches the field that colours it.

    Marked are where sliding began, where the car turned the wrong way, hit something or rolled over, and contacts of
    cars. `others` have number and line (k, 2) [m] of the other cars.
    """
    from bokeh.models import ColorBar, ColumnDataSource, HoverTool, LinearColorMapper

    (left, bottom), (right, top) = _extent(shapes, columns)
    height = int(np.clip(_WIDTH * (top - bottom) / (right - left), *_HEIGHT)) + 30
    plot = new_plot(
        to_scale=True, height=height, sizing_mode="stretch_width", match_aspect=True, x_axis_label="x [m]",
        y_axis_label="y [m]", toolbar_location="above", name="map",
    )  # fmt: skip
    drawn = []
    for outlines, colour in ((shapes.walls, WALL), (shapes.obstacles, OBSTACLE), (shapes.moving, ALERT)):
        if outlines:
            sides = [[np.round(outline[:, axis], 3).tolist() for outline in outlines] for axis in (0, 1)]
            drawn.append(plot.patches(*sides, fill_color=colour, line_color=colour, line_width=1))

    pieces = {
        name: np.asarray(columns[column][:-1], dtype=np.float32)
        for name, column in (
            ("time_s", "time_s"), ("x0", "x_m"), ("y0", "y_m"), ("speed_m_s", "speed_m_s"),
            ("friction_utilisation", "friction_utilisation"), ("slide_m_s", "slide_m_s"), ("lap", "lap"),
            ("progress_m", "progress_m"),
        )
    }  # fmt: skip
    pieces["x1"], pieces["y1"] = (np.asarray(columns[name][1:], dtype=np.float32) for name in ("x_m", "y_m"))
    mapper = LinearColorMapper(
        palette=speed_palette(),
        low=0.0,
        high=max(1.0, float(np.abs(columns["speed_m_s"]).max(initial=0.0))),
        name="mapper",
    )
    for index, way in others:
        plot.line(
            np.asarray(way[:, 0], np.float32), np.asarray(way[:, 1], np.float32), line_color=car_colour_hex(index),
            line_width=1.6, legend_label=f"car {index}",
        )  # fmt: skip
    line = plot.segment(
        "x0", "y0", "x1", "y1", source=ColumnDataSource(data=pieces, name="pieces"), line_width=3.5, line_cap="round",
        line_color={"field": "speed_m_s", "transform": mapper}, name="line",
    )  # fmt: skip
    for axis_range in (plot.x_range, plot.y_range):  # they fit what stands still: the cursor moves nothing
        axis_range.update(renderers=[*drawn, line], range_padding=0.04)
    scale = ColorBar(
        color_mapper=mapper, title="speed [m/s]", width=10, padding=6, name="scale", background_fill_color=None,
        title_text_font_style="normal", title_text_font_size="13px",
    )  # fmt: skip
    plot.add_layout(scale, "right")
    if events:
        plot.scatter(
            [event.x for event in events], [event.y for event in events], marker="circle_x", size=9, fill_color=None,
            line_color=ALERT, line_width=1.5, name="slides", visible=False,
        )  # fmt: skip
    for name, marked in (("wrong_way", wrong_way), ("crash", crash)):
        if marked is not None:
            plot.scatter([marked.x_m], [marked.y_m], marker="x", size=18, line_color=ALERT, line_width=4, name=name)
    if contacts:
        plot.scatter(
            [contact["x_m"] for contact in contacts], [contact["y_m"] for contact in contacts], marker="x", size=12,
            line_color=ALERT, line_width=2.5, legend_label="contact",
        )  # fmt: skip
    if others:
        put_legend_above(plot)
    plot.scatter("x_m", "y_m", source=cursor, size=13, fill_color="white", line_color="black", line_width=2.5)
    plot.add_tools(
        HoverTool(
            renderers=[line], line_policy="nearest",
            tooltips=[("time", "@time_s{0.00} s"), ("lap, progress", "@lap, @progress_m{0.0} m"),
                      ("speed", "@speed_m_s{0.00} m/s"), ("friction utilisation", "@friction_utilisation{0.00}"),
                      ("sliding", "@slide_m_s{0.000} m/s")],
        )
    )  # fmt: skip
    return plot


def colour_scales(columns: dict[str, FloatArray]) -> dict[str, tuple[str, float]]:
    """Return what the line can be coloured by: name of a column -> title and upper end of its scale."""
    return {
        "speed_m_s": ("speed [m/s]", max(1.0, float(np.abs(columns["speed_m_s"]).max(initial=0.0)))),
        "friction_utilisation": ("friction utilisation [-]", 1.0),
        "slide_m_s": ("sliding [m/s]", max(2.0 * SLIDING_SPEED, float(columns["slide_m_s"].max(initial=0.0)))),
    }


def _extent(shapes: MapShapes, columns: dict[str, FloatArray]) -> list[list[float]]:
    """Return least and greatest x and y of what is drawn [m]."""
    points = [np.column_stack((columns["x_m"], columns["y_m"]))]
    if shapes.walls or shapes.obstacles:
        points.append(shapes.bounds)
    both = np.concatenate(points)
    low, high = (both.min(axis=0), both.max(axis=0)) if len(both) else (np.zeros(2), np.ones(2))
    return [(low - _MARGIN).tolist(), (high + _MARGIN).tolist()]
