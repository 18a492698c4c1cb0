"""Pictures of tracks and races, as PNG files. They need matplotlib, of the extra `plot`.

track_picture(load_track("oval"), "oval.png")
trace_picture(race("oval"), "trace.png")
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import from_addons
from ..course.course import Course, describe_course
from ..messages import CarParameters, FloatArray
from ..racing import run_folder
from ..racing.result import RaceResult
from ..simulation.cars import car_colour_hex
from ..simulation.telemetry import TELEMETRY
from ..vehicle.car import WHEELS
from ..vehicle.tire_slip import NO_PEAK, SLIDING_SPEED, slides_above, sliding_rule, sliding_text
from .course_drawing import draw_course, draw_line, draw_obstacles, extent
from .pages.figure_kit import ALERT, WIDTH, Target, limit, picture, require_matplotlib, stacked

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MAP_HEIGHT = (1.6, 4.9)  # [in] least and greatest
_PANEL_HEIGHT = 0.9  # [in] of each panel over time
_TIRE_HEIGHT = 0.56  # [in] of a tire's panel over the lap
_BELOW, _BETWEEN = 0.6, 0.1  # [in] below axes: with the name of the axis and a title below that, and without
_TITLE_LINE = 0.17  # [in] of a title
_TITLE_LETTERS = 95  # of a line of it
_LEFT, _LABELS = 0.7, 0.41  # [in] where axes begin, and how far left of that the names of their quantities end
_LEGEND_EDGE = 0.88  # of the width; right of it are colour bar and legends
_MAX_LAP_LABELS = 12
_LONGEST_NAME = 18  # of a car in a legend
_LONGEST_LINE = 11  # letters that have room right of _LEGEND_EDGE
_LONGEST_TITLE = 80  # letters of a line
_ENTRY, _LETTER = 0.5, 0.062  # [in] of a legend: line and gap of an entry, and a letter of its name
_LEGEND_LINE = 0.17  # [in]
_PLACES = 160  # on a lap, of each of which the greatest utilisation is drawn
_TIRE_COLOURS = ("#0072b2", "#56b4e9", "#d55e00", "#e69f00")  # Okabe and Ito; front blue, rear orange
_COMMAND: Any = {"color": "0.55", "linewidth": 0.8}


def track_picture(track: Course, path: Target) -> None:
    """Draw a course from above: walls, line, start, direction, goal and obstacles; raise MissingExtraError, OSError."""
    with picture(path, WIDTH, _map_height(track) + 0.6) as figure:
        axes = figure.add_subplot()
        draw_course(axes, track)
        draw_line(axes, track)
        draw_obstacles(axes, track.obstacles, track.moving)
        axes.set_title("\n".join(wrap(describe_course(track), _TITLE_LETTERS)))


def trace_picture(result: RaceResult, path: Target) -> None:
    """Draw a race: the line coloured by speed; speed, steering and sliding over time; the tires' friction over the lap.

    Of the friction utilisation a panel for each tire shows all laps over the place on the lap, the greatest of them,
    and in red where the tire slid. Moving obstacles are drawn where they were at the end. A cross marks where a car
    turned that went the wrong way, or where it crashed.

    Of several cars the picture has the lines of all, each in its colour, with a cross where two touched, their speeds,
    their gaps to the leader and their positions over time.

    Raises:
      MissingExtraError, OSError: matplotlib is not installed; the file cannot be written.
    """
    if len(result.cars) > 1:
        _trace_of_several(result, path)
        return
    column = {name: result.car.telemetry[:, index] for index, name in enumerate(TELEMETRY)}
    driven = np.column_stack((column["x_m"], column["y_m"]))
    with _panels(result, path, _headline(result), driven, right=_LEGEND_EDGE * WIDTH, tires=len(WHEELS)) as drawn:
        figure, axes, panels, tires = drawn
        line = _draw_line(axes, column["x_m"], column["y_m"], column["speed_m_s"])
        scale = axes.inset_axes((1.015, 0.05, 0.02, 0.9))
        figure.colorbar(line, cax=scale, label="speed [m/s]")
        for text, marked in (
            ("turned here", result.car.wrong_way),
            ("crashed here", result.car.crash),
            ("rolled over here", result.car.rollover),
        ):
            if marked is not None:
                axes.plot(marked.x_m, marked.y_m, "x", color=ALERT, markersize=9.0, markeredgewidth=2.0)
                place, right = (marked.x_m, marked.y_m), marked.x_m > sum(axes.get_xlim()) / 2.0
                offset, side = ((-8.0, 6.0), "right") if right else ((8.0, 6.0), "left")  # where the picture has room
                axes.annotate(text, place, offset, textcoords="offset points", color=ALERT, ha=side)
        _draw_panels(panels, column, result.car.tires_model, result.world.parameters)
        _mark_laps(panels, result.car.lap_times_s)
        end = max(result.sim_time_s, 1e-3)
        panels[-1].set_xlim(-0.005 * end, end)  # what happens at once must not hide behind the axis
        _draw_tires(tires, column, result.world.track, result.car.tires_model)


@contextmanager
def _panels(
    result: RaceResult, path: Target, title: str, *lines: FloatArray, right: float, tires: int = 0, below: float = 0.0
) -> Iterator[tuple[Figure, Axes, list[Axes], list[Axes]]]:
    """Yield the picture of a race with its map, three panels over time, and panels of tires, all of given sizes."""
    course, titles = result.world.track, wrap(title, _LONGEST_TITLE)
    heights = [_map_height(course, *lines), *(3 * [_PANEL_HEIGHT]), *(tires * [_TIRE_HEIGHT])]
    rooms = [_BELOW, _BETWEEN, _BETWEEN, _BELOW, *(tires * [_BETWEEN])]
    rooms[-1] = 0.42 + below
    above = 0.16 + _TITLE_LINE * len(titles)
    with picture(path, WIDTH, sum(heights) + sum(rooms) + above, layout=None) as figure:
        axes, *panels = stacked(figure, heights, rooms, _LEFT, right)
        draw_course(axes, course, *lines)
        draw_obstacles(axes, result.world.obstacles, result.world.moving, result.sim_time_s)
        axes.set_title("\n".join(titles))
        for group in (panels[:3], panels[3:]):
            for panel in group:
                panel.sharex(group[0]) if panel is not group[0] else None
                panel.grid(False, axis="x")
                panel.tick_params(labelbottom=panel is group[-1])
                panel.yaxis.set_label_coords(-_LABELS / (right - _LEFT), 0.5)
        panels[2].set_xlabel("time [s]")
        yield figure, axes, panels[:3], panels[3:]


def _trace_of_several(result: RaceResult, path: Target) -> None:
    """Draw a race of several cars; arguments as of `trace_picture`."""
    cars = result.cars
    found = from_addons.standings([car.telemetry for car in cars], [car.row() for car in cars])
    ends = [max(int(np.searchsorted(found.time, car.end_time_s - 1e-9)), 1) for car in cars]
    lines = [np.column_stack((car.column("x_m"), car.column("y_m")))[:end] for car, end in zip(cars, ends, strict=True)]
    names = [car.name if len(car.name) <= _LONGEST_NAME else f"{car.name[: _LONGEST_NAME - 1]}…" for car in cars]
    entries = [f"{car.position}. {name}" for car, name in zip(cars, names, strict=True)]
    count = len(cars) + bool(result.contacts)
    columns = max(1, min(count, int(WIDTH / (_ENTRY + _LETTER * max(map(len, entries))))))
    below = 0.1 + _LEGEND_LINE * math.ceil(count / columns)
    title = _headline_of_several(result)
    with _panels(result, path, title, *lines, right=WIDTH - 0.12, below=below) as (figure, axes, panels, _):
        for index in sorted(range(len(cars)), key=lambda index: cars[index].position):
            car, end, colour = cars[index], ends[index], car_colour_hex(index)
            axes.plot(*lines[index].T, color=colour, linewidth=1.2, label=entries[index])
            time = found.time[:end]
            panels[0].plot(time, car.column("speed_m_s")[:end], color=colour)
            panels[1].plot(time, found.gaps_s[index, :end], color=colour)
            panels[2].plot(time, found.positions[index, :end], color=colour, drawstyle="steps-post", linewidth=1.4)
        for contact in result.contacts:
            axes.plot(contact.x_m, contact.y_m, "x", color=ALERT, markersize=6.0, markeredgewidth=1.4)
            for panel in panels:
                panel.axvline(contact.time_s, color=ALERT, linewidth=0.7, linestyle=":")
        if result.contacts:
            axes.plot([], [], "x", color=ALERT, markersize=6.0, label="contact")
        figure.legend(loc="lower center", ncols=columns)
        panels[0].set_ylabel("speed [m/s]")
        panels[1].set_ylabel("gap to leader [s]")
        panels[2].set(ylabel="position", ylim=(len(cars) + 0.4, 0.6), yticks=range(1, len(cars) + 1))
        panels[1].set_ylim(max(1.05 * float(np.nanmax(found.gaps_s, initial=0.0)), 0.1), 0.0)  # the leader is on top
        panels[2].set_xlim(0.0, max(result.sim_time_s, 1e-3))


def _headline_of_several(result: RaceResult) -> str:
    time = sum(next((car.lap_times_s for car in result.cars if car.name == result.winner), ()))
    won = "nobody finished" if result.winner is None else f"{result.winner} won in {time:.2f} s"
    counts = ", ".join(
        f"{count} {what}{'' if count == 1 else 's'}"
        for count, what in ((len(result.overtakes), "overtake"), (len(result.contacts), "contact"))
    )
    return f"{result.track}, {len(result.cars)} cars, {result.laps_requested} laps: {won}; {counts}"


def _headline(result: RaceResult) -> str:
    car = result.car
    laps = f"{car.laps_completed} of {result.laps_requested} laps"
    if not result.laps_requested:
        laps = f"{result.sim_time_s:.1f} s"
    best = f", best {min(car.lap_times_s):.2f} s" if car.lap_times_s else ""
    end = "" if car.finished else f", ended by {car.end_reason}"
    return f"{result.track}, {car.controller}: {laps}{best}{end}; greatest sliding {sliding_text(car.max_slide_m_s, 3)}"


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
    if np.isnan([column[f"slide_{wheel}_m_s"] for wheel in WHEELS]).all():
        sliding.text(0.5, 0.5, NO_PEAK, transform=sliding.transAxes, ha="center", va="center", fontsize=8.0)
    limit(sliding, slides_above(model), "limit")
    sliding.set_ylabel("sliding\n[m/s]")
    sliding.set_ylim(0.0, max(1.2 * SLIDING_SPEED, 1.05 * sliding.dataLim.y1))
    for panel in (speed, sliding):
        panel.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=7.0, handlelength=1.2)


def _draw_tires(panels: list[Axes], column: dict[str, FloatArray], track: Course, model: str) -> None:
    """Draw each tire's friction utilisation over the place on the lap, or the time on a course without end."""
    from matplotlib.patches import StepPatch

    outline: Any = {"baseline": None, "fill": False, "linewidth": 1.0}
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
        use = column[f"friction_utilisation_{wheel}"]
        panel.plot(np.insert(place, begins, np.nan), np.insert(use, begins, np.nan), color="0.65", linewidth=0.5)
        greatest = np.full(cells, -np.inf)
        np.maximum.at(greatest, cell, np.nan_to_num(use, nan=-np.inf))
        greatest[np.isneginf(greatest)] = np.nan  # nobody was there, or the tire was off the ground
        # by `stairs` matplotlib would look for their limits, which are known, for a third of the time of the picture
        panel.add_artist(StepPatch(greatest, edges, edgecolor=colour, **outline))
        panel.add_artist(StepPatch(greatest, edges, facecolor=colour, alpha=0.15, linewidth=0.0))
        slid = column[f"slide_{wheel}_m_s"] > slides_above(model)
        panel.plot(place[slid], np.full(slid.sum(), 1.12), "|", color=ALERT, markersize=5.0, markeredgewidth=1.2)
        limit(panel, 1.0)
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
        Line2D([], [], color="0.25", linewidth=0.8, linestyle=(0, (4, 2)), label="limit"),
        Line2D([], [], color=ALERT, marker="|", linestyle="", markersize=6.0, markeredgewidth=1.2,
               label="\n".join(("slides,", *wrap(rule, _LONGEST_LINE)))),
    ]  # fmt: skip
    panel.legend(handles=shown, loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=7.0, handlelength=1.2)


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
    return float(np.clip(WIDTH * 0.85 * height / width, least, greatest))


def write_run(
    result: RaceResult,
    folder: str | Path,
    *,
    picture: bool = True,
    add: Callable[[Path], Any] | None = None,
) -> Path:
    """Write a run folder, new or empty, with its picture, and return its path. A failure leaves nothing behind.

    `add` adds files to the run, as its report; it is called with the path of a folder that has all others.

    Raises:
      RunFolderError, MissingExtraError: the folder cannot be written; there is no matplotlib for a picture.
    """
    if picture:
        require_matplotlib()
    return run_folder.write_run(result, folder, draw=trace_picture if picture else None, add=add)
