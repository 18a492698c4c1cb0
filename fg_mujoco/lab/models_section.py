"""The section of the experiment `models`: sentences, figures and expectations from its rows."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ..pictures.pages.figure_kit import COLOURS, column, finish, measured, theory
from ..vehicle.single_track import SingleTrack
from .experiment import Figure, Row, Section, Tables

if TYPE_CHECKING:
    import matplotlib.axes
    import matplotlib.figure

AGREE = 0.02
"""[-] How far yaw rates may differ where slip is small."""
SMALL_ANGLE = 0.3
"""[rad] Up to here the model, in which a steering angle is its own tangent, is asked to agree."""

_HALF = math.sqrt(0.5) + 1e-3  # k at which a circle takes half of the friction
_TWICE = math.sqrt(2.0)  # and twice
_SIDEWAYS = "lateral_acceleration_over_mu_g"


def models_section(tables: Tables, gym: SingleTrack) -> Section:
    """Write the section; `gym` is the model that the 2D gyms drive, on our car's friction."""
    circles = [row for row in tables["circles"] if not row["reason"]]
    manoeuvres = tables["manoeuvres"]
    below = [row for row in circles if _number(row, "k") < _HALF and _number(row, "steering_rad") <= SMALL_ANGLE]
    stiff = max(abs(_ratio(row, "stiff_yaw_rate_rad_s") - 1.0) for row in below)
    driven = [row for row in manoeuvres if _number(row, "k") < _HALF]
    transient = max(_number(row, "stiff_difference") for row in driven)
    ratios = [_ratio(row, "gym_yaw_rate_rad_s") - 1.0 for row in below]
    closed = max(abs(_number(row, "gym_yaw_rate_rad_s") / _steady(gym, row) - 1.0) for row in circles)
    steerings = sorted({_number(row, "steering_rad") for row in below})
    twice = [row for row in circles if abs(_number(row, "k") - _TWICE) < 0.01]
    fast = [row for row in circles if abs(_number(row, "k") - 2.0) < 0.01]
    agreeing = ", ".join(f"{agreeing_share(gym, steering):.2f} at {steering:g} rad" for steering in steerings)
    sentences = [
        "Below half of the limit's lateral acceleration our car turns as the linear-tire model does with tires that "
        f"creep as ours: yaw rates within {_percent(stiff)} on circles of up to {SMALL_ANGLE:g} rad, most of it tan d, "
        f"which the model takes for d; and within {_percent(transient)} (root mean square) through {_listed(driven)}.",
        f"With the 2D gyms' own stiffnesses, {gym.front_stiffness:g} and {gym.rear_stiffness:g} per rad, the model "
        f"understeers there: its yaw rate is {_percent(-max(ratios))} to {_percent(-min(ratios))} below ours, and "
        f"within {_percent(closed, 2)} that of the closed form v d / (b + K v²). Understeer alone takes "
        f"{_percent(AGREE, 0)} at these shares of the limit's lateral acceleration: {agreeing}.",
        f"Where a circle asks for twice the friction that there is (k = 1.41), our car keeps {_span(twice, '')} of the "
        f"kinematic curvature, where Coulomb's law leaves 1/k² = 0.50; the gyms' keeps {_span(twice, 'gym_')}, at "
        f"{_span(twice, 'gym_', _SIDEWAYS)} times mu g.",
    ]
    if fast:
        sentences.append(
            f"At twice the law's speed (k = 2) it is {_span(fast, '')} for ours, where 0.25 is left, and "
            f"{_span(fast, 'gym_')} for theirs, at {_span(fast, 'gym_', _SIDEWAYS)} times mu g."
        )
    expected = (
        ("yaw rate to the oracle's, tires as stiff as ours, circles below half of the limit", "within 2 %",
         f"within {_percent(stiff)}"),
        ("the same, through manoeuvres (root mean square)", "within 2 %", f"within {_percent(transient)}"),
        ("the same, with the 2D gyms' stiffnesses", "within 2 %",
         f"{_percent(min(ratios))} to {_percent(max(ratios))}: they understeer, as their closed form says"),
        ("curvature over kinematic at twice the limit's acceleration, ours", "0.50", _span(twice, "")),
        ("the same, 2D gyms", "goes on cornering", _span(twice, "gym_")),
    )  # fmt: skip
    return Section(
        sentences=tuple(sentences),
        figures=(
            Figure(
                name="circles", height=3.2, draw=lambda figure: _draw_circles(figure, circles, gym),
                caption="Curvature of a settled circle over the kinematic one, against the speed over the law's. Our "
                "car leaves the kinematic circle at k = 1 and follows 1/k², whatever the steering angle; a linear "
                "tire never lets go (closed form).",
            ),
            Figure(
                name="small_slip", height=3.2, draw=lambda figure: _draw_small_slip(figure, circles, gym),
                caption="Yaw rate of the linear-tire model over our car's, below the limit: with the 2D gyms' "
                "stiffnesses (full markers, and their closed form) and with tires that creep as ours (open markers).",
            ),
            Figure(
                name="manoeuvres", height=5.2, draw=lambda figure: _draw_manoeuvres(figure, tables["traces"]),
                caption="Yaw rates over the time, at the same measured steering angles and speeds: below half of the "
                "limit, and at the fastest.",
            ),
            Figure(
                name="paths", height=3.2, draw=lambda figure: _draw_paths(figure, tables["traces"]),
                caption="The ways of the centres of gravity at the fastest, at the same measured steering angles and "
                "speeds; our car's every 0.1 s.",
            ),
        ),
        columns={
            "circles": (
                "steering_rad", "k", "speed_m_s", "yaw_rate_rad_s", "gym_yaw_rate_rad_s", "stiff_yaw_rate_rad_s",
                "curvature_over_kinematic", "gym_curvature_over_kinematic", "gym_lateral_acceleration_over_mu_g",
                "slide_m_s", "reason",
            ),
            "manoeuvres": (
                "manoeuvre", "k", "speed_m_s", "yaw_rate_rad_s", "gym_yaw_rate_rad_s", "gym_difference",
                "stiff_difference", "slide_m_s",
            ),
        },
        expected=expected,
    )  # fmt: skip


def gym_curvature(gym: SingleTrack, steering: float, k: float) -> float:
    """Return the closed form of the model's settled curvature over the kinematic one, d / tan d / (1 + K v^2 / b).

    With v = k sqrt(g mu b / tan d), K v^2 / b is (1 / C_Sf - 1 / C_Sr) k^2 / tan d.
    """
    softer = 1.0 / gym.front_stiffness - 1.0 / gym.rear_stiffness
    return steering / math.tan(steering) / (1.0 + softer * k**2 / math.tan(steering))


def agreeing_share(gym: SingleTrack, steering: float) -> float:
    """Return the share of the limit's lateral acceleration up to which understeer alone stays within AGREE."""
    softer = 1.0 / gym.front_stiffness - 1.0 / gym.rear_stiffness
    return min(1.0, (1.0 / (1.0 - AGREE) - 1.0) * math.tan(steering) / softer)


def _draw_circles(figure: matplotlib.figure.Figure, rows: list[Row], gym: SingleTrack) -> None:
    axes = figure.add_subplot()
    ks = np.linspace(0.05, 2.05, 200)
    theory(axes, ks, np.minimum(1.0, ks**-2.0), "Coulomb: 1 up to k = 1, then 1/k²")
    for steering, colour in _colours(rows):
        own = [row for row in rows if row["steering_rad"] == steering]
        axes.plot(ks, [gym_curvature(gym, steering, k) for k in ks], color=colour, linestyle=(0, (4, 2)),
                  label=f"linear tires, {steering:g} rad")  # fmt: skip
        measured(
            axes, column(own, "k"), column(own, "curvature_over_kinematic"), f"ours, {steering:g} rad", colour=colour
        )
    axes.set_ylim(0.0, 1.08)
    finish(axes, "k: speed over the law's [-]", "curvature over kinematic [-]", legend=False)
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))


def _draw_small_slip(figure: matplotlib.figure.Figure, rows: list[Row], gym: SingleTrack) -> None:
    axes = figure.add_subplot()
    ks = np.linspace(0.05, 1.0, 100)
    axes.axhspan(1.0 - AGREE, 1.0 + AGREE, color="0.93", zorder=0.5)
    axes.axvline(math.sqrt(0.5), color="0.25", linewidth=0.8, linestyle=":")
    axes.text(math.sqrt(0.5), 0.66, " half of the limit", fontsize=7.0)
    for steering, colour in _colours(rows):
        own = [row for row in rows if row["steering_rad"] == steering and _number(row, "k") <= 1.0]
        # the centre of gravity's circle is wider than the rear axle's, by which k is told
        wider = math.hypot(1.0, gym.car.rear_axle_distance * math.tan(steering) / gym.wheelbase)
        theory(axes, ks, [gym_curvature(gym, steering, k * wider) * wider for k in ks], colour=colour)
        ratios = [_ratio(row, "gym_yaw_rate_rad_s") for row in own]
        measured(axes, column(own, "k"), ratios, f"2D gyms, {steering:g} rad", colour=colour)
        ratios = [_ratio(row, "stiff_yaw_rate_rad_s") for row in own]
        measured(axes, column(own, "k"), ratios, f"as stiff as ours, {steering:g} rad", colour=colour, fillstyle="none")
    finish(axes, "k: speed over the law's [-]", "yaw rate over our car's [-]", legend=False)
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))


def _draw_manoeuvres(figure: matplotlib.figure.Figure, rows: list[Row]) -> None:
    names = list(dict.fromkeys(str(row["manoeuvre"]) for row in rows))
    ks = _two_speeds(rows)
    panels = figure.subplots(len(names), len(ks), sharex=True, squeeze=False)
    for name, line in zip(names, panels, strict=True):
        for k, axes in zip(ks, line, strict=True):
            own = [row for row in rows if row["manoeuvre"] == name and row["k"] == k]
            time = column(own, "time_s")
            theory(axes, time, column(own, "gym_yaw_rate_rad_s"), "2D gyms", colour=COLOURS[1])
            theory(axes, time, column(own, "stiff_yaw_rate_rad_s"), "as stiff as ours", colour="0.25")
            measured(axes, time, column(own, "yaw_rate_rad_s"), "our car", markersize=1.8)
            axes.set_title(f"{name}, k = {k:.3g}")
            finish(
                axes, "time [s]" if name == names[-1] else "", "yaw rate [rad/s]" if k == ks[0] else "", legend=False
            )
    panels[0][0].legend()


def _draw_paths(figure: matplotlib.figure.Figure, rows: list[Row]) -> None:
    names = list(dict.fromkeys(str(row["manoeuvre"]) for row in rows))
    k = _two_speeds(rows)[-1]
    for axes, name in zip(np.atleast_1d(figure.subplots(1, len(names))), names, strict=True):
        own = [row for row in rows if row["manoeuvre"] == name and row["k"] == k]
        theory(axes, column(own, "gym_x_m"), column(own, "gym_y_m"), "2D gyms", colour=COLOURS[1])
        measured(axes, column(own[::4], "x_m"), column(own[::4], "y_m"), "our car", markersize=2.5)
        axes.set_title(f"{name}, k = {k:.3g}")
        axes.set_aspect("equal", adjustable="datalim")
        finish(axes, "x [m]", "y [m]" if name == names[0] else "", legend=name == names[0])


def _two_speeds(rows: list[Row]) -> list[float]:
    """Return the fastest k below half of the limit, and the fastest of all."""
    ks = sorted({_number(row, "k") for row in rows})
    return [max(k for k in ks if k < _HALF), ks[-1]]


def _colours(rows: list[Row]) -> list[tuple[float, str]]:
    return list(zip(sorted({_number(row, "steering_rad") for row in rows}), COLOURS, strict=False))


def _steady(gym: SingleTrack, row: Row) -> float:
    return gym.steady_yaw_rate(_number(row, "steering_rad"), _number(row, "speed_m_s"))


def _ratio(row: Row, name: str) -> float:
    return _number(row, name) / _number(row, "yaw_rate_rad_s")


def _span(rows: list[Row], prefix: str, name: str = "curvature_over_kinematic") -> str:
    values = [_number(row, f"{prefix}{name}") for row in rows]
    low, high = f"{min(values):.2f}", f"{max(values):.2f}"
    return low if low == high else f"{low} to {high}"


def _percent(share: float, digits: int = 1) -> str:
    return f"{100.0 * share:.{digits}f} %"


def _listed(rows: list[Row]) -> str:
    names = list(dict.fromkeys(str(row["manoeuvre"]) for row in rows))
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def _number(row: Row, name: str) -> float:
    value = row[name]
    return math.nan if value is None else float(value)
