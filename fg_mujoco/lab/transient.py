"""Transients: how well the law holds while steering and speed change, by how it is used.

A car comes straight ahead at k times the law's speed. The reference keeps this speed through a manoeuvre whose sharpest
bend is what the law allows at k = 1. The servo turns at its real rate. Used one way only, the law slows the car for a
bend that it is already in, because steering turns faster than the car slows. Used both ways, the steering waits for the
speed. The friction limiter ("limiter") also holds braking and turning in within what cornering leaves.
"""

from __future__ import annotations

import math
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from fg_mujoco.controllers.control.speed import friction_speed

from ..messages import DriveCommand, Odometry
from ..pictures.pages import figure_kit as style
from ..pictures.pages.figure_kit import column
from ..vehicle.tire_slip import slides_above
from ..vehicle.tires import IDEAL_TIRES, Tires
from .experiment import LAW_TIRES, Cell, Experiment, Figure, LabSettings, Row, Section, Tables
from .lab_ground import LabGround
from .reference_steering import CURVATURE, MANOEUVRES, Manoeuvre
from .speed_laws import LAWS
from .trace import Trace

if TYPE_CHECKING:
    import matplotlib.figure

MUS = (1.0489, 0.6)
KS = (0.7, 0.9, 1.0, 1.1, 1.5)  # of the law's speed: the reference
_QUICK_KS = (0.9, 1.1)
_QUICK_MANOEUVRES = ("step", "slalom")
_SHOWN = ("step", MUS[0], 1.1)  # manoeuvre, mu, k of the figure over time
_ASIDE = math.cos(math.radians(45.0))  # farther than this from its heading, a car's rear axle goes no way it steers
_EVERY = 10  # [steps] of a trace that is drawn


class Transient:
    """See the module."""

    name = "transient"
    title = "Transients: one way, both ways, and the whole friction limiter"

    def cells(self, settings: LabSettings) -> list[Cell]:
        """One for each set of tires, manoeuvre, friction and speed; a cell drives under every law."""
        names = _QUICK_MANOEUVRES if settings.quick else tuple(MANOEUVRES)
        mus, ks = (MUS[:1], _QUICK_KS) if settings.quick else (MUS, KS)
        return [
            {"tires": tires, "manoeuvre": name, "mu": mu, "k": k}
            for tires, name, mu, k in product(LAW_TIRES, names, mus, ks)
        ]

    def measure(self, cell: Cell) -> Tables:
        """Drive a manoeuvre under each of the laws."""
        tables: Tables = {"runs": [], "trace": []}
        ground = LabGround(cell["mu"], tires=Tires.load(cell["tires"]))
        for law in LAWS:
            trace, reference = drive(ground, cell["manoeuvre"], cell["mu"], cell["k"], law)
            tables["runs"].append({**cell, "law": law, **_figures(trace, reference, cell["manoeuvre"])})
            if (cell["manoeuvre"], cell["mu"], cell["k"]) == _SHOWN:
                tables["trace"] += [{"tires": cell["tires"], **row} for row in _samples(trace, law)]
        return tables

    def section(self, tables: Tables) -> Section:
        """Say which use of the law slides, and what time the others cost."""
        sets = list(dict.fromkeys(str(row["tires"]) for row in tables["runs"]))
        parts = [(tires, _on(tables["runs"], tires), _on(tables["trace"], tires)) for tires in sets]
        return Section(
            sentences=tuple(sentence for tires, runs, _ in parts for sentence in _sentences(tires, runs)),
            figures=tuple(figure for part in parts for figure in _pictures(*part)),
            columns={
                "runs": (
                    "tires", "manoeuvre", "mu", "k", "law", "sliding_share", "greatest_slide_m_s", "time_s",
                    "time_lost_s", "off_path_m", "reason",
                )
            },
            expected=tuple(line for tires, runs, _ in parts for line in _expected(tires, runs)),
        )  # fmt: skip


EXPERIMENT: Experiment = Transient()


def _on(rows: list[Row], tires: str) -> list[Row]:
    return [row for row in rows if row["tires"] == tires]


def _pictures(tires: str, runs: list[Row], samples: list[Row]) -> tuple[Figure, ...]:
    """Return the figures of a set of tires."""
    ending = "" if tires == IDEAL_TIRES else f"_{tires}"
    name, mu, k = _SHOWN
    return (
        Figure(
            name=f"sliding{ending}",
            caption=f"Tires {tires}. Share of the physics steps in which a tire slides, and the time lost against a "
            "car that keeps the reference speed, over that speed, k times the law's. A car that spins has no time.",
            draw=lambda figure: _draw_runs(figure, runs),
            height=1.2 + 1.5 * (1 + len({row["mu"] for row in runs})),
        ),
        Figure(
            name=f"time{ending}",
            caption=f"Tires {tires}. A {name} at {k:g} times the law's speed, mu {mu:g}, under each law. Dashed line: "
            "limit of sliding.",
            draw=lambda figure: _draw_time(figure, tires, samples),
            height=4.2,
        ),
    )


def drive(
    ground: LabGround, manoeuvre: str | Manoeuvre, mu: float, k: float, law: str, steering: float | None = None
) -> tuple[Trace, float]:
    """Drive a manoeuvre under a law, and return the trace and the reference speed [m/s]: k times the law's.

    Args:
      ground: of friction mu.
      manoeuvre: one of MANOEUVRES, or its name.
      mu: that the law assumes.
      k: reference speed over the law's.
      law: one of LAWS.
      steering: whose law's speed it is [rad]; None: that of CURVATURE.
    """
    plan = MANOEUVRES[manoeuvre] if isinstance(manoeuvre, str) else manoeuvre
    car = ground.car.parameters
    if steering is None:
        steering = math.atan(car.wheelbase * CURVATURE)
    hold = LAWS[law](car, mu)
    reference = k * friction_speed(steering, mu, car.wheelbase, car.gravity)

    def driver(odometry: Odometry) -> DriveCommand:
        return hold(plan.steering(odometry, car), reference, odometry)

    ground.place(reference)
    return ground.drive(driver, plan.seconds, until=plan.ended), reference


def _figures(trace: Trace, reference: float, manoeuvre: str) -> Row:
    time = len(trace.time) * trace.timestep
    distance = float(trace.speed.sum()) * trace.timestep
    aside = np.arctan2(trace.velocity[:, 1], trace.velocity[:, 0]) - trace.heading
    spun = bool((np.cos(aside) < _ASIDE).any()) or MANOEUVRES[manoeuvre].lost(trace.heading[-1])
    return {
        "wished_speed_m_s": reference,
        "sliding_share": float(trace.slip.slides.any(axis=1).mean()),
        "greatest_slide_m_s": float(np.nanmax(trace.slip.sliding_speed)),
        "time_s": time,
        "distance_m": distance,
        "time_lost_s": math.nan if spun else time - distance / reference,
        "least_speed_m_s": float(trace.speed.min()),
        "turned_rad": float(trace.heading[-1]),
        "off_path_m": MANOEUVRES[manoeuvre].off_path(trace.position),
        "spun": spun,
        "reason": "time_lost_s: the car spun" if spun else "",
    }


def _samples(trace: Trace, law: str) -> list[Row]:
    """Return what is drawn over time, of each `_EVERY` steps: the first, and the greatest slide of all."""
    slides = np.fmax.reduce(trace.slip.sliding_speed, axis=1)
    slides = np.fmax.reduce(slides[: len(slides) // _EVERY * _EVERY].reshape(-1, _EVERY), axis=1)
    motion = np.column_stack((trace.time, trace.steering_angle, trace.speed))[::_EVERY]
    names = ("time_s", "steering_rad", "speed_m_s", "slide_m_s")
    values = np.column_stack((motion[: len(slides)], slides))
    return [{"law": law, **dict(zip(names, row, strict=True))} for row in values.tolist()]


def _under(runs: list[Row], law: str) -> list[Row]:
    return [row for row in runs if row["law"] == law]


def _greatest(rows: list[Row], name: str) -> float:
    return float(np.nanmax(column(rows, name)))


def _sentences(tires: str, runs: list[Row]) -> tuple[str, ...]:
    limited, both, one = (_under(runs, law) for law in ("limiter", "both ways", "one way"))
    longest = 100.0 * _greatest(limited, "sliding_share")
    fastest = _greatest(limited, "greatest_slide_m_s")
    if longest == 0.0:
        first = (
            f"On {tires}, under the whole friction limiter no tire slides in any of {len(limited)} runs: "
            f"{fastest:.3f} m/s at most, where {slides_above(tires)} m/s count as sliding."
        )
    else:
        first = (
            f"On {tires}, under the whole friction limiter a tire slides for up to {longest:.1f} % of the time, "
            f"at {fastest:.3f} m/s."
        )
    return (
        first,
        f"With the law used one way tires slide in {_sliding(one)} runs, for {_share(one)} of the time; used both ways "
        f"in {_sliding(both)}, for {_share(both)}. The rest is due to braking, which locks the lighter rear axle, "
        f"and turning in: {_spun(one)} and {_spun(both)} of the cars spin, with the friction limiter {_spun(limited)}.",
        f"Against a car that keeps the reference speed the friction limiter loses {_lost(limited)} s; cars that "
        f"do not spin lose {_lost(both)} s with the law used both ways, {_lost(one)} s one way.",
    )


def _sliding(rows: list[Row]) -> str:
    return f"{int((column(rows, 'sliding_share') > 0.0).sum())} of {len(rows)}"


def _spun(rows: list[Row]) -> int:
    return sum(bool(row["spun"]) for row in rows)


def _share(rows: list[Row]) -> str:
    return f"up to {100.0 * _greatest(rows, 'sliding_share'):.0f} %"


def _lost(rows: list[Row]) -> str:
    return style.span(column(rows, "time_lost_s"), ".2f")


def _expected(tires: str, runs: list[Row]) -> tuple[tuple[str, str, str], ...]:
    asked_of = {"limiter": f"none, below {slides_above(tires)} m/s", "both ways": "-", "one way": "slides"}
    return tuple(
        (
            f"{tires}, {law}: longest share of time sliding, greatest slide",
            asked,
            f"{100 * _greatest(_under(runs, law), 'sliding_share'):.1f} %, "
            f"{_greatest(_under(runs, law), 'greatest_slide_m_s'):.3f} m/s",
        )
        for law, asked in asked_of.items()
    )


def _draw_runs(figure: matplotlib.figure.Figure, runs: list[Row]) -> None:
    names = list(dict.fromkeys(str(row["manoeuvre"]) for row in runs))
    mus = list(dict.fromkeys(column(runs, "mu").tolist()))
    rows = [(mu, "sliding_share", 100.0, f"mu {mu:g}\ntime sliding [%]") for mu in mus]
    rows.append((mus[0], "time_lost_s", 1.0, f"mu {mus[0]:g}\ntime lost [s]"))
    grid = figure.subplots(len(rows), len(names), sharex=True, sharey="row", squeeze=False)
    for (row, (mu, name, scale, label)), (place, manoeuvre) in product(enumerate(rows), enumerate(names)):
        axes = grid[row, place]
        for law, colour in zip(LAWS, style.COLOURS, strict=False):
            found = [run for run in _under(runs, law) if run["manoeuvre"] == manoeuvre and run["mu"] == mu]
            values = scale * column(found, name)
            style.measured(axes, column(found, "k"), values, law, colour=colour, linestyle="-", linewidth=0.6)
        if row == 0:
            axes.set_title(manoeuvre, fontsize="medium")
        style.finish(
            axes, "k of the reference [-]" if row == len(rows) - 1 else "", label if place == 0 else "", legend=False
        )
    figure.legend(*grid[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=len(LAWS))


def _draw_time(figure: matplotlib.figure.Figure, tires: str, samples: list[Row]) -> None:
    if not samples:
        return
    panels = figure.subplots(3, 1, sharex=True)
    for law, colour in zip(LAWS, style.COLOURS, strict=False):
        rows = _under(samples, law)
        for axes, name in zip(panels, ("steering_rad", "speed_m_s", "slide_m_s"), strict=True):
            axes.plot(column(rows, "time_s"), column(rows, name), color=colour, label=law)
    style.limit(panels[2], slides_above(tires))
    style.log_from_zero(panels[2], 1e-3)
    panels[2].set_xlim(0.4, 2.0)
    style.finish(panels[0], "", "steering [rad]")
    style.finish(panels[1], "", "speed [m/s]", legend=False)
    style.finish(panels[2], "time [s]", "greatest slide [m/s]", legend=False)
