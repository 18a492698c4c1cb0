"""The page of a validation: overlays of recordings and model, and residuals over speed and steering.

Cross plots of steady states are laid out as ISO 19364:2016 describes for passenger cars: the simulation defines
boundaries, and the measurements are laid over them. Overlays over time are in the manner of ISO 22140:2021. The widths
of the bands are ours (BANDS): the tables of the standards are not public.
"""

from __future__ import annotations

from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fg_mujoco.display import element, html
from fg_mujoco.messages import FloatArray
from fg_mujoco.pictures.pages.bokeh_plots import (
    ALERT,
    CAR,
    LAW,
    embed,
    new_panel,
    new_plot,
    put_legend_above,
    require_bokeh,
    stacked,
)
from fg_mujoco.pictures.pages.page import boxes, names_and_values, note, scroll, write_page

from .agreement import UNITS, recorded_signals, signals_of
from .validation import COMMANDS, HELD, STEADY, Validation
from .windows import PERIOD

if TYPE_CHECKING:
    from bokeh.models import UIElement
    from bokeh.plotting import figure as Figure  # noqa: N812 - a class, whatever its name

BANDS = {"yaw rate": 0.08, "lateral acceleration": 0.03, "slip angle": 0.08}
"""Widths of the bands over steady states, of the model's value: goals of this project, which are no numbers of a
standard."""
_TRANSIENT = 0.12  # of the rms of a recorded signal: the band of overlays over time, likewise

_EVERY = 2  # periods between two points of a line
_MOST_POINTS = 3000  # of a scatter
_SHOWN = ("yaw rate", "lateral acceleration", "slip angle", "speed")
_BODY = """<h1>{title}</h1>
<p class="note">{what}</p>
{figures}
<h2>Agreement</h2>
<p class="note">Root mean square of the error, its share of the root mean square of what was recorded (of the position:
of the way that was driven), and the greatest error. Nothing is fitted here.</p>{table}
<h2>Steady states</h2>
<p class="note">Points: recorded, the mean of steady states that are alike. Line and band: the model at the same
steering and speed, with {bands}. The layout is that of ISO 19364:2016: simulated boundaries with measurements
over them. The widths are goals of this project and no numbers of the standard.</p>
<div class="halves">{steady}</div>{steady_table}
<h2>Residuals</h2>
<p class="note">Model less recording of windows of 1 s at the recorded speed, over speed and over steering.</p>
<div class="halves">{residuals}</div>
<h2>Overlays</h2>
<p class="note">Windows of {length} s at the recorded speed, each from its recorded state, in the manner of ISO
22140:2021. Band: {transient} % of the rms of the recording to either side, ours.</p>
{overlays}
<h2>Drives</h2>{drives}"""


def write_validation_page(found: Validation, path: str | Path) -> Path:
    """Write the page of a validation and return its path; MissingExtraError: no bokeh; RunFolderError."""
    require_bokeh()
    plots: dict[str, UIElement] = {}
    for signal in BANDS if found.steady else ():
        plots[f"steady {signal}"] = _steady_plot(found, signal)
    for signal in ("yaw rate", "lateral acceleration"):
        for over in ("speed", "steering"):
            plots[f"residual {signal} {over}"] = _residual_plot(found, signal, over)
    length = max(length for how, length in found.driven if how == HELD)
    windows, _ = found.driven[HELD, length]
    numbers = sorted({window.drive for window in windows})
    for number in numbers:
        plots[f"overlay {number}"] = _overlay(found, number, length)
    script, places = embed(plots)
    names = {name: element("div", element("h3", name.partition(" ")[2]), place) for name, place in places.items()}
    title = f"{found.model} against recorded drives"
    body = html(
        _BODY,
        title=title,
        what=f"{len(found.drives)} drives, friction {found.friction:.4g}.",
        figures=boxes(_figures(found)),
        table=scroll(found.table.html(), "whole"),
        bands=", ".join(f"{100.0 * width:.0f} % of the {signal}" for signal, width in BANDS.items()),
        steady=[names[name] for name in names if name.startswith("steady")],
        steady_table=scroll(found.steady_table.html(), "whole") if found.steady else None,
        residuals=[names[name] for name in names if name.startswith("residual")],
        length=f"{length:g}",
        transient=f"{100.0 * _TRANSIENT:.0f}",
        overlays=[
            [note(found.motions[number].drive.name), element("div", places[f"overlay {number}"], class_="plots")]
            for number in numbers
        ],
        drives=names_and_values(
            [*((drive.name, f"{drive.checks}; sha256 {drive.sha256}") for drive in found.drives),
             *(("", said) for said in (*found.unknown, *found.left_out))]
        ),
    )  # fmt: skip
    return write_page(path, title, body, plots=script)


def _figures(found: Validation) -> list[tuple[str, str]]:
    made = []
    for signal, how, length, name in (
        ("yaw rate", STEADY, 0.0, "yaw rate, steady states"), ("yaw rate", HELD, 1.0, "yaw rate, 1 s, recorded speed"),
        ("yaw rate", COMMANDS, 1.0, "yaw rate, 1 s, commands"), ("speed", COMMANDS, 1.0, "speed, 1 s, commands"),
    ):  # fmt: skip
        each = found.agreement(signal, how, length)
        if each is not None:
            made.append((f"{100.0 * each.share:.3g} %", name))
    recorded, model = found.plateau
    if recorded == recorded:
        made.append((f"{100.0 * (model / recorded - 1.0):+.3g} %", "greatest steady lateral acceleration"))
    return made


def _steady_plot(found: Validation, signal: str) -> Figure:
    """Return the cross plot of a signal over the lateral acceleration: a line of the model for each steering angle."""
    name, width = signal.replace(" ", "_"), BANDS[signal]
    across = "speed" if signal == "lateral acceleration" else "lateral acceleration"
    x_name = across.replace(" ", "_")
    plot = new_plot(
        width=560, height=360, x_axis_label=f"{across} [{UNITS[across]}]", y_axis_label=f"{signal} [{UNITS[signal]}]"
    )  # fmt: skip
    groups: dict[int, list[int]] = {}
    for place, each in enumerate(found.steady):
        groups.setdefault(round(each.steering / 0.02), []).append(place)
    for places in groups.values():
        rows = sorted((found.steady[place] for place in places), key=attrgetter(f"model_{x_name}"))
        x = np.array([getattr(each, f"model_{x_name}") for each in rows])
        y = np.array([getattr(each, f"model_{name}") for each in rows])
        plot.varea(x, y * (1.0 - width), y * (1.0 + width), color=CAR, alpha=0.25, legend_label="band")
        plot.line(x, y, color=CAR, line_width=2, legend_label="model")
        plot.scatter(x, y, color=CAR, size=4, legend_label="model")
    measured = [(getattr(each, x_name), getattr(each, name)) for each in found.steady]
    plot.scatter(*np.array(measured).T, color=LAW, size=8, legend_label="recorded")
    put_legend_above(plot)
    return plot


def _residual_plot(found: Validation, signal: str, over: str) -> Figure:
    windows, simulated = found.driven[HELD, min(length for how, length in found.driven if how == HELD)]
    values = signals_of(simulated, found.car.rear_axle_distance)[signal]
    xs, ys = [], []
    for row, window in zip(values, windows, strict=True):
        motion = found.motions[window.drive]
        part = slice(window.first + 1, window.first + window.count + 1)
        xs.append((motion.speed if over == "speed" else motion.steering)[part])
        ys.append(row[1 : window.count + 1] - recorded_signals(motion)[signal][part])
    x, y = np.concatenate(xs), np.concatenate(ys)
    thin = max(1, len(x) // _MOST_POINTS)
    limit = 1.2 * float(np.percentile(np.abs(y), 99.0))
    unit = "m/s" if over == "speed" else "rad"
    plot = new_plot(
        width=560, height=320, y_range=(-limit, limit), x_axis_label=f"{over} [{unit}]",
        y_axis_label=f"error of the {signal} [{UNITS[signal]}]",
    )  # fmt: skip
    plot.scatter(x[::thin].astype(np.float32), y[::thin].astype(np.float32), size=3, color=LAW, alpha=0.4,
                 line_color=None, legend_label="each 10 ms, some of them")  # fmt: skip
    centres, middles, low, high = _binned(x, y)
    plot.varea(centres, low, high, color=CAR, alpha=0.2, legend_label="half of them")
    plot.line(centres, middles, color=CAR, line_width=2.5, legend_label="median")
    put_legend_above(plot)
    return plot


def _binned(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return the middles of bins along x, and the median and the quartiles of y there."""
    edges = np.unique(np.quantile(x, np.linspace(0.0, 1.0, 13)))
    places = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, max(len(edges) - 2, 0))
    rows = []
    for place in np.unique(places):
        inside = places == place
        rows.append((float(x[inside].mean()), *np.quantile(y[inside], (0.5, 0.25, 0.75)).tolist()))
    centres, middles, low, high = np.array(rows).T
    return centres, middles, low, high


def _overlay(found: Validation, number: int, length: float) -> UIElement:
    """Return what a drive recorded over time, with the model's windows over it."""
    motion, (windows, simulated) = found.motions[number], found.driven[HELD, length]
    values, recorded = signals_of(simulated, found.car.rear_axle_distance), recorded_signals(motion)
    time, across, panels = motion.time[::_EVERY], None, []
    for signal in _SHOWN:
        known = recorded[signal]
        size = float(np.percentile(np.abs(known), 99.5)) * 1.35 + 1e-3
        if across is None:
            across = (float(time[0]), float(time[-1]))
        panel = new_panel(f"{signal} [{UNITS[signal]}]", across, (-size if signal != "speed" else 0.0, size), 170)
        across = panel.x_range
        half = _TRANSIENT * float(np.sqrt(np.mean(known**2)))
        y = known[::_EVERY].astype(np.float32)
        panel.varea(time, y - half, y + half, color=LAW, alpha=0.18)
        panel.line(time, y, color=LAW, line_width=2.5, alpha=0.7, legend_label="recorded")
        gap = np.array([np.nan])
        xs, ys, errors = [gap], [gap], [gap]
        for row, window in zip(values[signal], windows, strict=True):
            if window.drive == number:
                part = slice(window.first, window.first + window.count + 1, _EVERY)
                model = np.clip(row[: window.count + 1 : _EVERY], -3.0 * size, 3.0 * size).astype(np.float32)
                xs += [motion.time[part], gap]
                ys += [model, gap]
                errors += [model - known[part], gap]
        x = np.concatenate(xs)
        panel.line(x, np.concatenate(ys), color=CAR, line_width=1.5, legend_label="model")
        panel.line(x, np.concatenate(errors), color=ALERT, line_width=1, alpha=0.7, legend_label="error")
        put_legend_above(panel)
        panels.append(panel)
    return stacked(panels, f"time [s], windows of {length:g} s, a point every {1e3 * _EVERY * PERIOD:.0f} ms")
