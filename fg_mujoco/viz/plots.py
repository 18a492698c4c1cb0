"""Pictures of tracks and races, as PNG files. They need matplotlib, of the extra `plot`.

track_picture(load_track("oval"), "oval.png")
trace_picture(race("oval"), "trace.png")
"""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Callable
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from ..course.course import Course, describe_course
from ..course.writing import write_file
from ..errors import missing_extra
from ..messages import CarParameters, FloatArray
from ..racing import run_folder
from ..racing.result import RaceResult
from ..racing.standings import standings
from ..simulation.cars import car_colour_hex
from ..simulation.telemetry import TELEMETRY
from ..vehicle.car import WHEELS
from ..vehicle.tire_slip import SLIDING_SPEED, slides_above, sliding_rule
from .course_drawing import draw_course, draw_line, draw_obstacles, extent

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


_WIDTH = 7.2  # [in] two columns of a paper
_MAP_HEIGHT = (2.2, 5.5)  # [in] least and greatest
_PANEL_HEIGHT = 1.15  # [in] of each panel over time
_TIRE_HEIGHT = 0.72  # [in] of a tire's panel over the lap
_LEGEND_EDGE = 0.88  # of the width; right of it are colour bar and legends
_DPI = 150
_MAX_LAP_LABELS = 12
_LONGEST_NAME = 18  # of a car in a legend
_LONGEST_LINE = 11  # letters that have room right of _LEGEND_EDGE
_LONGEST_TITLE = 80  # letters of a line
_ENTRY, _LETTER = 0.5, 0.062  # [in] of a legend: line and gap of an entry, and a letter of its name
_PLACES = 160  # on a lap, of each of which the greatest utilisation is drawn
_STYLE: Any = {"font.size": 8.0, "axes.linewidth": 0.6, "lines.linewidth": 0.9, "legend.frameon": False}
_TIRE_COLOURS = ("#0072b2", "#56b4e9", "#d55e00", "#e69f00")  # Okabe and Ito; front blue, rear orange
_LIMIT: Any = {"color": "0.2", "linewidth": 0.8, "linestyle": (0, (4, 2))}
_ALERT = "#d00000"
_COMMAND: Any = {"color": "0.55", "linewidth": 0.8}


def require_matplotlib() -> None:
    """Make sure that pictures can be made.

    Raises:
      MissingExtraError: matplotlib is not installed; the message has the command that installs it.
    """
    if importlib.util.find_spec("matplotlib") is None:
        raise missing_extra("pictures need matplotlib", "plot")


def track_picture(track: Course, path: str | Path | BinaryIO) -> None:
    """Draw a course from above: its walls, line, start, direction, goal and obstacles.

    Raises:
      MissingExtraError: matplotlib is not installed.
      OSError: the file cannot be written.
    """
    require_matplotlib()
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(_WIDTH, _map_height(track)), layout="constrained")
        axes = figure.add_subplot()
        draw_course(axes, track)
        draw_line(axes, track)
        draw_obstacles(axes, track.obstacles, track.moving)
        axes.set_title(describe_course(track))
        save_figure(figure, path)


def trace_picture(result: RaceResult, path: str | Path | BinaryIO) -> None:
    """Draw a race: the line coloured by speed; speed, steering and sliding over time; the tires' friction over the lap.

    Of the friction utilisation a panel for each tire shows all laps over the place on the lap, the greatest of them,
    and in red where the tire slid.

    Moving obstacles are drawn where they were at the end. A cross marks where a car turned that went the wrong way,
    or where it crashed.

    Of several cars the picture has the lines of all, each in its colour, with a cross where two touched, their speeds,
    their gaps to the leader and their positions over time.

    Raises:
      MissingExtraError: matplotlib is not installed.
      OSError: the file cannot be written.
    """
    require_matplotlib()
    if len(result.cars) > 1:
        _trace_of_several(result, path)
        return
    import matplotlib as mpl
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    column = {name: result.car.telemetry[:, index] for index, name in enumerate(TELEMETRY)}
    driven = np.column_stack((column["x_m"], column["y_m"]))
    map_height = _map_height(result.world.track, driven)
    with mpl.rc_context(_STYLE):
        layout = ConstrainedLayoutEngine(rect=(0.0, 0.0, _LEGEND_EDGE, 1.0))
        heights = (map_height, *(3 * [_PANEL_HEIGHT]), *(len(WHEELS) * [_TIRE_HEIGHT]))
        figure = Figure(figsize=(_WIDTH, sum(heights)), layout=layout)
        grid = figure.add_gridspec(len(heights), 1, height_ratios=heights)
        axes = figure.add_subplot(grid[0])
        draw_course(axes, result.world.track, driven)
        draw_obstacles(axes, result.world.obstacles, result.world.moving, result.sim_time_s)
        line = _draw_line(axes, column["x_m"], column["y_m"], column["speed_m_s"])
        scale = axes.inset_axes((1.015, 0.05, 0.02, 0.9))
        scale.set_in_layout(False)
        figure.colorbar(line, cax=scale, label="speed [m/s]")
        for text, marked in (
            ("turned here", result.car.wrong_way),
            ("crashed here", result.car.crash),
            ("rolled over here", result.car.rollover),
        ):
            if marked is not None:
                axes.plot(marked.x_m, marked.y_m, "x", color=_ALERT, markersize=9.0, markeredgewidth=2.0)
                place, right = (marked.x_m, marked.y_m), marked.x_m > sum(axes.get_xlim()) / 2.0
                offset, side = ((-8.0, 6.0), "right") if right else ((8.0, 6.0), "left")  # where the picture has room
                axes.annotate(text, place, offset, textcoords="offset points", color=_ALERT, ha=side)
        axes.set_title("\n".join(wrap(_headline(result), _LONGEST_TITLE)))

        panels = [figure.add_subplot(grid[1])]
        panels += [figure.add_subplot(grid[row], sharex=panels[0]) for row in (2, 3)]
        _draw_panels(panels, column, result.car.tires_model, result.world.parameters)
        _mark_laps(panels, result.car.lap_times_s)
        panels[-1].set_xlabel("time [s]")
        end = max(result.sim_time_s, 1e-3)
        panels[-1].set_xlim(-0.005 * end, end)  # what happens at once must not hide behind the axis
        tires = [figure.add_subplot(grid[4])]
        tires += [figure.add_subplot(grid[row], sharex=tires[0]) for row in (5, 6, 7)]
        _draw_tires(tires, column, result.world.track, result.car.tires_model)
        for panel in (*panels, *tires):
            panel.grid(axis="y", color="0.9", linewidth=0.5)
            panel.spines[["top", "right"]].set_visible(False)
            panel.tick_params(labelbottom=panel in (panels[-1], tires[-1]))
        figure.align_ylabels([*panels, *tires])
        save_figure(figure, path)


def _trace_of_several(result: RaceResult, path: str | Path | BinaryIO) -> None:
    """Draw a race of several cars; arguments as of `trace_picture`."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    cars, course = result.cars, result.world.track
    found = standings([car.telemetry for car in cars], [car.row() for car in cars])
    ends = [max(int(np.searchsorted(found.time, car.end_time_s - 1e-9)), 1) for car in cars]
    lines = [np.column_stack((car.column("x_m"), car.column("y_m")))[:end] for car, end in zip(cars, ends, strict=True)]
    heights = (_map_height(course, *lines), *(3 * [_PANEL_HEIGHT]))
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(_WIDTH, sum(heights)), layout="constrained")
        grid = figure.add_gridspec(len(heights), 1, height_ratios=heights)
        axes = figure.add_subplot(grid[0])
        draw_course(axes, course, *lines)
        draw_obstacles(axes, result.world.obstacles, result.world.moving, result.sim_time_s)
        panels = [figure.add_subplot(grid[1])]
        panels += [figure.add_subplot(grid[row], sharex=panels[0]) for row in (2, 3)]
        for index in sorted(range(len(cars)), key=lambda index: cars[index].position):
            car, end, colour = cars[index], ends[index], car_colour_hex(index)
            name = car.name if len(car.name) <= _LONGEST_NAME else f"{car.name[: _LONGEST_NAME - 1]}…"
            axes.plot(*lines[index].T, color=colour, linewidth=1.2, label=f"{car.position}. {name}")
            time = found.time[:end]
            panels[0].plot(time, car.column("speed_m_s")[:end], color=colour)
            panels[1].plot(time, found.gaps_s[index, :end], color=colour)
            panels[2].plot(time, found.positions[index, :end], color=colour, drawstyle="steps-post", linewidth=1.4)
        for contact in result.contacts:
            axes.plot(contact.x_m, contact.y_m, "x", color=_ALERT, markersize=6.0, markeredgewidth=1.4)
            for panel in panels:
                panel.axvline(contact.time_s, color=_ALERT, linewidth=0.7, linestyle=":")
        if result.contacts:
            axes.plot([], [], "x", color=_ALERT, label="contact")
        entries = axes.get_legend_handles_labels()
        longest = max(map(len, entries[1]))
        columns = max(1, min(len(entries[1]), int(_WIDTH / (_ENTRY + _LETTER * longest))))
        figure.legend(*entries, loc="outside lower center", ncols=columns)
        axes.set_title("\n".join(wrap(_headline_of_several(result), _LONGEST_TITLE)))
        panels[0].set_ylabel("speed [m/s]")
        panels[1].set_ylabel("gap to leader [s]")
        panels[2].set(ylabel="position", ylim=(len(cars) + 0.4, 0.6), yticks=range(1, len(cars) + 1))
        panels[1].set_ylim(max(1.05 * float(np.nanmax(found.gaps_s, initial=0.0)), 0.1), 0.0)  # the leader is on top
        panels[2].set_xlabel("time [s]")
        panels[2].set_xlim(0.0, max(result.sim_time_s, 1e-3))
        for panel in panels:
            panel.grid(axis="y", color="0.9", linewidth=0.5)
            panel.spines[["top", "right"]].set_visible(False)
            panel.tick_params(labelbottom=panel is panels[-1])
        figure.align_ylabels(panels)
        save_figure(figure, path)


def _headline_of_several(result: RaceResult) -> str:
    won = "nobody finished" if result.winner is None else f"{result.winner} won in {_winning_time(result):.2f} s"
    counts = ", ".join(
        f"{count} {what}{'' if count == 1 else 's'}"
        for count, what in ((len(result.overtakes), "overtake"), (len(result.contacts), "contact"))
    )
    return f"{result.track}, {len(result.cars)} cars, {result.laps_requested} laps: {won}; {counts}"


def _winning_time(result: RaceResult) -> float:
    return sum(next(car for car in result.cars if car.name == result.winner).lap_times_s)


def _headline(result: RaceResult) -> str:
    car = result.car
    laps = f"{car.laps_completed} of {result.laps_requested} laps"
    if not result.laps_requested:
        laps = f"{result.sim_time_s:.1f} s"
    best = f", best {min(car.lap_times_s):.2f} s" if car.lap_times_s else ""
    end = "" if car.finished else f", ended by {car.end_reason}"
    return f"{result.track}, {car.controller}: {laps}{best}{end}; greatest sliding {car.max_slide_m_s:.3f} m/s"


def _draw_panels(panels: list[Axes], column: dict[str, FloatArray], model: str, car: CarParameters) -> None:
    """Draw speed, steering and sliding over time; commands as the car holds them, within its limits."""
    speed, steering, sliding = panels
    time, lock = column["time_s"], car.max_steering_angle
    speed.plot(time, np.clip(column["command_speed_m_s"], car.min_speed, car.max_speed), **_COMMAND, label="command")
    speed.plot(time, column["speed_m_s"], color="black", label="car")
    speed.set_ylabel("speed\n[m/s]")
    low, high = speed.get_ylim()
    if low > 0.0:  # a drive at one speed: not its millimetres per second
        speed.set_ylim(0.0, 1.05 * high)
    steering.plot(time, np.clip(column["command_steering_rad"], -lock, lock), **_COMMAND)
    steering.plot(time, column["steering_angle_rad"], color="black")
    steering.set_ylabel("steering\n[rad]")
    for wheel, colour in zip(WHEELS, _TIRE_COLOURS, strict=True):
        label = wheel.replace("_", " ")
        sliding.plot(time, column[f"slide_{wheel}_m_s"], color=colour, linewidth=0.6, label=label)
    sliding.axhline(slides_above(model), **_LIMIT, label="limit")
    sliding.set_ylabel("sliding\n[m/s]")
    sliding.set_ylim(0.0, max(1.2 * SLIDING_SPEED, 1.05 * sliding.dataLim.y1))
    for panel in (speed, sliding):
        legend = panel.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=7.0, handlelength=1.2)
        legend.set_in_layout(False)


def _draw_tires(panels: list[Axes], column: dict[str, FloatArray], track: Course, model: str) -> None:
    """Draw each tire's friction utilisation over the place on the lap: every lap, the greatest, and where it slid.

    On a course without end it is drawn over time.
    """
    endless = not math.isfinite(track.length)
    place, laps = column["time_s" if endless else "progress_m"], column["lap"]
    length = float(place.max(initial=1e-3)) if endless else track.length
    if track.closed:
        place = place % length
    begins = np.flatnonzero((np.diff(laps) != 0.0) | (np.abs(np.diff(place)) > 0.5 * length)) + 1
    cells = max(min(_PLACES, len(place) // 2), 1) if endless else _PLACES  # none is without a tick
    edges = np.linspace(place.min(initial=0.0), place.max(initial=length), cells + 1)
    cell = np.clip(np.searchsorted(edges, place, side="right") - 1, 0, cells - 1)
    for panel, wheel, colour in zip(panels, WHEELS, _TIRE_COLOURS, strict=True):
        use = column[f"friction_use_{wheel}"]
        panel.plot(np.insert(place, begins, np.nan), np.insert(use, begins, np.nan), color="0.65", linewidth=0.5)
        greatest = np.full(cells, -np.inf)
        np.maximum.at(greatest, cell, np.nan_to_num(use, nan=-np.inf))
        greatest[np.isneginf(greatest)] = np.nan  # nobody was there, or the tire was off the ground
        panel.stairs(greatest, edges, color=colour, linewidth=1.0, baseline=None)
        panel.stairs(greatest, edges, color=colour, alpha=0.15, fill=True)
        slid = column[f"slide_{wheel}_m_s"] > slides_above(model)
        panel.plot(place[slid], np.full(slid.sum(), 1.12), "|", color=_ALERT, markersize=5.0, markeredgewidth=1.2)
        panel.axhline(1.0, **_LIMIT)
        panel.set_ylim(0.0, 1.2)
        panel.set_yticks((0.0, 0.5, 1.0))
        panel.set_ylabel(wheel.replace("_", "\n"))
    panels[0].set_title("friction utilisation [-] of each tire", fontsize="medium", loc="left")
    where = "time [s]" if endless else "place on the lap [m]" if track.closed else "place on the course [m]"
    panels[-1].set_xlabel(where)
    panels[0].set_xlim(edges[0], edges[-1])
    _explain_tires(panels[0], model, laps=not endless)


def _explain_tires(panel: Axes, model: str, *, laps: bool) -> None:
    """Put a legend beside the panels of the tires, in no tire's colour."""
    from matplotlib.lines import Line2D

    rule = sliding_rule(model).replace(" m/s", "\N{NO-BREAK SPACE}m/s")
    shown = [
        Line2D([], [], color="0.65", linewidth=0.5, label="each lap" if laps else "each tick"),
        Line2D([], [], color=_TIRE_COLOURS[0], linewidth=1.0, label="greatest of\nall laps" if laps else "greatest"),
        Line2D([], [], label="limit", **_LIMIT),
        Line2D([], [], color=_ALERT, marker="|", linestyle="", markeredgewidth=1.2,
               label="\n".join(("slides,", *wrap(rule, _LONGEST_LINE)))),
    ]  # fmt: skip
    legend = panel.legend(handles=shown, loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=7.0, handlelength=1.2)
    legend.set_in_layout(False)


def _draw_line(axes: Axes, x: FloatArray, y: FloatArray, speed: FloatArray) -> Any:
    """Draw where the rear axle went, each piece in the colour of its speed."""
    from matplotlib.collections import LineCollection

    points = np.column_stack((x, y))
    line = LineCollection(
        list(np.stack((points[:-1], points[1:]), axis=1)), array=speed[:-1], cmap="viridis", linewidth=1.4,
        capstyle="round",
    )  # fmt: skip
    line.set_clim(0.0, max(float(speed.max(initial=0.0)), 1.0))
    return axes.add_collection(line)


def _mark_laps(panels: list[Axes], lap_times: tuple[float, ...]) -> None:
    """Mark where each lap ends, and write its number over the first panel."""
    for lap, (time, end) in enumerate(zip(lap_times, np.cumsum(lap_times), strict=True), start=1):
        for panel in panels:
            panel.axvline(end, color="0.6", linewidth=0.6, linestyle=":")
        if len(lap_times) <= _MAX_LAP_LABELS:
            above = panels[0].get_xaxis_transform()
            panels[0].text(end - 0.5 * time, 1.02, f"lap {lap}", transform=above, ha="center", va="bottom")


def _map_height(track: Course, *lines: FloatArray) -> float:
    """Return the height of the map of a track and lines (n, 2) on it [in] for which it fills the width."""
    width, height = np.ptp(extent(track, *lines), axis=0)
    least, greatest = _MAP_HEIGHT
    return float(np.clip(_WIDTH * 0.85 * height / width + 0.6, least, greatest))


def save_figure(figure: Figure, path: str | Path | BinaryIO, dpi: float = _DPI) -> None:
    """Write a figure as PNG: a file in one piece, or to a file that is open. The same figure is the same file."""

    def write(file: Any) -> None:
        figure.savefig(file, format="png", dpi=dpi, metadata={"Software": None})

    write_file(path, write) if isinstance(path, (str, Path)) else write(path)


def write_run(
    result: RaceResult,
    folder: str | Path,
    *,
    picture: bool = True,
    add: Callable[[Path], Any] | None = None,
) -> Path:
    """Write a run folder, with its picture, and return its path. A failure leaves nothing behind.

    Args:
      result: of the race.
      folder: new or empty.
      picture: with trace.png.
      add: adds files to the run, as its report; called with the path of a folder that has all others.

    Raises:
      RunFolderError: the folder is a file, is not empty, or cannot be written.
      MissingExtraError: a picture is wanted, and matplotlib is not installed.
    """
    if picture:
        require_matplotlib()
    return run_folder.write_run(result, folder, draw=trace_picture if picture else None, add=add)
