"""The page of an identification: the tires' curves over what the drive measured, and the yaw rate that was held back.

Its plots are bokeh's, and it loads nothing.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fg_mujoco.display import Html, element, html
from fg_mujoco.messages import FloatArray
from fg_mujoco.pictures.pages.bokeh_plots import ALERT, CAR, LAW, embed, mark, new_plot, put_legend_above, require_bokeh
from fg_mujoco.pictures.pages.page import boxes, names_and_values, note, write_page
from fg_mujoco.pictures.pages.table import Table

from .fit import force_points
from .identification import Estimate, Identification, held_back

if TYPE_CHECKING:
    from bokeh.plotting import figure as Figure  # noqa: N812 - a class, whatever its name

_MOST_POINTS = 4000  # of a drive that are drawn, of each axle
_WIDEST = 0.6  # [rad] of slip angles that are drawn
_SMOOTHED = 8  # nodes of 6.25 ms over which the points are averaged
_EVERY_THIRD = "Every third stretch of 1 s was kept from the fit."
_BODY = """<h1>{title}</h1><p class="note">Identified from {names}.</p>
{figures}
<h2>Lateral force over load</h2>
<p class="note">Points: by inverse dynamics from the smoothed motion, averaged over 50 ms.
Line: the fit by output error, with its 95 % band. Dashed: slip angles that the drive exceeds for 1 % of its time.</p>
<div class="halves"><div><h3>Front axle</h3>{front}</div><div><h3>Rear axle</h3>{rear}</div></div>
<h2>Yaw rate of what was not used</h2>
<p class="note">{unused} There the model is simulated from the commands and the
measured speed, from the state at the start of the stretch that fits best.</p>
{yaw_rates}
<h2>Parameters</h2>{parameters}
<h2>Not told by the drives</h2>{untold}
<h2>Sources</h2>{sources}"""


def write_identification_report(found: Identification, path: str | Path) -> Path:
    """Write the page of an identification and return its path; MissingExtraError: no bokeh; RunFolderError."""
    require_bokeh()
    plots = {f"axle_{axle}": _axle_plot(found, axle) for axle in (0, 1)}
    plots |= {f"yaw_{index}": _yaw_plot(found, index) for index in range(len(found.others))}
    script, places = embed(plots)
    names = [drive.name for drive in found.drives]
    title = f"Tires of {found.drives[0].vehicle}"
    figures = [(_figure(axle.stiffness), f"{name} stiffness [1/rad]") for name, axle in found.axles]
    figures += [(_figure(axle.peak), f"{name} peak [-]") for name, axle in found.axles if not found.linear]
    figures.append((_figure(found.lateness.times(1e3)), "steering lag and delay [ms]"))
    relative = 100.0 * found.validation.yaw_rate_relative
    body = html(
        _BODY,
        title=title,
        names=", ".join(names),
        figures=boxes([*figures, (f"{relative:.2g} %", "rms of the yaw rate, not used")]),
        front=places["axle_0"],
        rear=places["axle_1"],
        yaw_rates=[
            [note(name), element("div", places[f"yaw_{i}"], class_="plots")]
            for i, (name, _) in enumerate(found.of_each)
        ],
        parameters=_parameters(found),
        unused="These drives were held out of the fit." if found.hold_out else _EVERY_THIRD,
        untold=names_and_values([*found.untold.items(), *([("the fit", found.fit.stopped)] * bool(found.fit.stopped))]),
        sources=_sources(found),
    )
    return write_page(path, title, body, plots=script)


def _axle_plot(found: Identification, axle: int) -> Figure:
    points = [force_points(problem, found.fit.parameters) for problem in found.problems]
    slips, used = (np.concatenate([_averaged(part[which][axle]) for part in points]) for which in (0, 1))
    shown = np.abs(slips) <= _WIDEST
    slips, used = slips[shown], used[shown]
    thin = max(1, len(slips) // _MOST_POINTS)
    reach = float(np.clip(1.15 * np.abs(slips).max(initial=0.05), 0.05, _WIDEST))
    grid = np.linspace(-reach, reach, 241)
    fitted, half = found.curve(axle, grid)
    high = 1.2 * float(max(np.abs(fitted).max(), np.percentile(np.abs(used), 99.5)))
    plot = new_plot(
        width=560, height=380, x_range=(-reach, reach), y_range=(-high, high), x_axis_label="slip angle [rad]",
        y_axis_label="lateral force / load [-]",
    )  # fmt: skip
    plot.scatter(slips[::thin].astype(np.float32), used[::thin].astype(np.float32), size=4, color=LAW, alpha=0.45,
                 line_color=None, legend_label="measured")  # fmt: skip
    plot.varea(grid, fitted - half, fitted + half, color=CAR, alpha=0.25, legend_label="95 % band")
    plot.line(grid, fitted, color=CAR, line_width=2.5, legend_label="fit")
    reached = (found.front, found.rear)[axle].reached
    mark(plot, (-reached, reached), line_dash="dashed")
    put_legend_above(plot)
    return plot


def _yaw_plot(found: Identification, index: int) -> Figure:
    time, simulated, measured = held_back(found.others[index], found.fit.parameters, found.fit.noise)
    # a gap between two stretches is no line
    gaps = np.flatnonzero(np.diff(time) > 0.5) + 1
    time, simulated, measured = (np.insert(values, gaps, np.nan) for values in (time, simulated, measured))
    plot = new_plot(along=True, width=1160, height=300, x_axis_label="time [s]", y_axis_label="yaw rate [rad/s]")
    plot.line(time, measured, color=LAW, line_width=4, alpha=0.55, legend_label="measured")
    plot.line(time, simulated, color=CAR, line_width=1.5, legend_label="simulated")
    plot.line(time, simulated - measured, color=ALERT, line_width=1, legend_label="difference")
    put_legend_above(plot)
    return plot


def _averaged(values: FloatArray) -> FloatArray:
    """Return the means of every _SMOOTHED values."""
    whole = len(values) // _SMOOTHED * _SMOOTHED
    return np.asarray(values[:whole].reshape(-1, _SMOOTHED).mean(axis=1))


def _figure(estimate: Estimate) -> str:
    return f"{estimate.value:.4g}" + (f" ± {estimate.half:.2g}" if np.isfinite(estimate.half) else "")


def _parameters(found: Identification) -> Html:
    rows: list[tuple[str, Estimate, str]] = []
    for name, axle in found.axles:
        rows.append((f"{name} stiffness B C D", axle.stiffness, "1/rad"))
        if not found.linear:
            units = (("B", "1/rad"), ("C", "-"), ("D", "-"), ("E", "-"))
            rows += [(f"{name} {letter}", getattr(axle, letter), unit) for letter, unit in units]
            rows.append((f"{name} peak, at {axle.peak_slip:.3g} rad", axle.peak, "-"))
    rows += [
        ("steering gain", found.steering_gain, "-"), ("steering offset", found.steering_offset, "rad"),
        ("steering lag, first order", found.steering_lag, "s"), ("steering delay", found.steering_delay, "s"),
        ("steering limit", found.steering_limit, "rad"), ("yaw inertia over the vehicle's", found.inertia_ratio, "-"),
        ("bias of the gyro", found.gyro_bias, "rad/s"), ("gain of the accelerometer", found.lateral_gain, "-"),
        ("delay of the pose after the gyro", found.pose_delay, "s"),
    ]  # fmt: skip
    if np.isfinite(found.relaxation_length.value):
        rows.append(("relaxation length of the tires", found.relaxation_length, "m"))
    return Table(
        header=("parameter", "value", "half of the 95 % interval", "unit"),
        rows=[
            *(
                (name, f"{each.value:.5g}", f"{each.half:.2g}" if np.isfinite(each.half) else "at the bound", unit)
                for name, each, unit in rows
            ),
            *((name, *text.split(" +- ", 1)[:1], text.split(" +- ", 1)[-1], "") for name, text in found.speed_lines()),
        ],
    ).html()


def _sources(found: Identification) -> Html:
    car = found.drives[0].car
    rows = [(drive.name, f"{drive.end - drive.start:.4g} s, sha256 {drive.sha256}") for drive in found.drives]
    rows += [
        ("car", f"{found.drives[0].vehicle}: {car.mass:.4g} kg, {car.yaw_inertia:.4g} kg m², centre of gravity "
         f"{car.front_axle_distance:.4g} m behind the front axle and {car.rear_axle_distance:.4g} m ahead of the rear "
         f"one, {car.center_of_gravity_height:.4g} m over the ground"),
        ("steering", "commands" if found.drives[0].commanded else "measured angles"),
        ("inverse dynamics alone", f"yaw rate on held-out data: within "
         f"{100.0 * found.inverse_validation.yaw_rate_relative:.3g} % rms"),
    ]  # fmt: skip
    return names_and_values(rows)
