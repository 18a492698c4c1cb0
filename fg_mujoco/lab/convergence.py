"""Convergence: how the results depend on the timestep, on the tires' short steps, and on the solver and the contact.

One setting of the car is changed at a time. Measured are, on a circle of dry ground, where the tires let go, how fast a
holding tire creeps at 0.95 of the law's speed, and how a tire slides at 1.03 and 1.1; and a lap of the oval. On our own
tires these are the timestep, and in how many short steps a physics step of the car moves the tires (`tire_forces`). The
rest is of MuJoCo's contacts.

A planner that reacts to its scans drives no two laps alike: at one timestep, a start moved by a millimetre changes a
flying lap by .1 % in the standard deviation and by up to .6 %. So a lap is the mean over several starts.

`impedance` varies the cause of a sliding tire's hops. MuJoCo's elliptic friction cones are convex: a contact point that
slides at v is also pushed up, by mu s v, where s is the rate [1/s] at which solreffriction slows it down. Against that
stands what the contact needs to carry the load N, N w (1 - d) / d, with d its impedance and w the inverse mass. So a
tire lifts from v = N w (1 - d) / (d mu s) on, at the load of a standing tire some 30 mm/s above its
creep at d = .8, 120 at .5, at any timestep; at a large one it then hops. d is changed here with all that hangs on it,
so that stiffness and creep stay as they are.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from ..errors import ModelError
from ..messages import FloatArray
from ..pictures.pages import figure_kit as style
from ..pictures.pages.figure_kit import column
from ..simulation.settings import Start
from ..simulation.world import World
from ..vehicle.car import WHEELS, car_parameters, element_id
from ..vehicle.tire_forces import steps_within, tire_rows
from ..vehicle.tire_slip import SLIDING_SPEED, slides_above
from ..vehicle.tires import CONTACT, CONTACT_TIMESTEP, DEFAULT_TIRES, Tires
from ..vehicle.vehicle import Vehicle
from .experiment import Cell, Experiment, Figure, LabSettings, Row, Section, Tables
from .lab_ground import Engine
from .lab_laps import drive_laps
from .rigid_car import creep
from .steady_circle import CircleReading, SteadyCircle, UnreachableError

if TYPE_CHECKING:
    import matplotlib.figure

STEERING = 0.1  # [rad] of the circle
CREEPING, SLIDING, FAST = 0.95, 1.03, 1.1  # of the law's speed
EXACT = 0.00025  # [s] the timestep that others are compared with
TIMESTEPS = (0.005, 0.0025, 0.002, 0.001, 0.0005, EXACT)  # [s]
OWN_GROUPS: dict[str, tuple[Any, ...]] = {"timestep": TIMESTEPS, "short steps": (64, 1, 2, 3, 4, 6, 8, 16)}
"""Settings of our own tires that are varied one at a time, and their values."""

GROUPS: dict[str, tuple[Any, ...]] = {
    "timestep": TIMESTEPS,
    "impratio": (1.0, 10.0, 20.0, 40.0, 100.0),
    "solver": ("Newton", "CG"),
    "cone": ("elliptic", "pyramidal"),
    "iterations": (5, 10, 100),
    "tolerance": (1e-4, 1e-8, 1e-12),
    "impedance": (0.5, 0.4, 0.6, 0.7, 0.8),
}
"""Those of MuJoCo's contacts."""

_OWN_QUICK = {"timestep": (0.005, 0.0005), "short steps": (64, 4)}
_QUICK = {"timestep": (0.005, 0.0005), "impratio": (1.0, 40.0)}
_LAPS = 2  # of the oval; the second is told, a flying one
_STARTS = (-0.002, -0.001, 0.0, 0.001, 0.002)  # [m] offsets from the line, of which a lap is the mean
_CIRCLE = ("k_grip", "k_slides", "creep_m_s", "slide_m_s", "airborne_share", "fast_slide_m_s")
_LAP = ("lap_s", "lap_spread_s", "lap_slide_m_s")


class Convergence:
    """See the module."""

    name = "convergence"
    title = "Convergence: timestep, solver and contact"

    def cells(self, settings: LabSettings) -> list[Cell]:
        """One for each value of each setting."""
        own, contact = (_OWN_QUICK, _QUICK) if settings.quick else (OWN_GROUPS, GROUPS)
        return [
            {"tires": tires, "setting": setting, "value": value}
            for tires, groups in ((DEFAULT_TIRES, own), (CONTACT, contact))
            for setting, values in groups.items()
            for value in values
        ]

    def measure(self, cell: Cell) -> Tables:
        """Drive a circle and a lap with one setting changed."""
        told: Row = {"tires": cell["tires"], "setting": cell["setting"], "value": str(cell["value"])}
        row: Row = {**told, **_circle(cell), **_lap(cell)}
        reasons = [str(row.pop(name)) for name in ("why_no_k", "why_no_lap")]
        return {"settings": [{**row, "reason": "; ".join(reason for reason in reasons if reason)}]}

    def section(self, tables: Tables) -> Section:
        """Say which results change, and why the timestep is as it is."""
        own, rows = ([row for row in tables["settings"] if row["tires"] == tires] for tires in (DEFAULT_TIRES, CONTACT))
        return Section(
            sentences=(*_own_sentences(own), *_sentences(rows)),
            figures=(
                _timestep_figure(DEFAULT_TIRES, own, ""),
                _timestep_figure(CONTACT, rows, f"_{CONTACT}"),
                Figure(
                    name="impratio",
                    caption=f"Tires {CONTACT}. Creep of a holding tire at {CREEPING:g} of the law's speed; line: the "
                    "closed form. At 1 tires give way before their friction is used up.",
                    draw=lambda figure: _draw_impratio(figure, _of(rows, "impratio")),
                    height=2.6,
                ),
            ),
            columns={"settings": ("tires", "setting", "value", *_CIRCLE, *_LAP, "reason")},
            expected=(*_expected(DEFAULT_TIRES, own), *_expected(CONTACT, rows)),
        )


EXPERIMENT: Experiment = Convergence()


def _timestep_figure(tires: str, rows: list[Row], ending: str) -> Figure:
    return Figure(
        name=f"timestep{ending}",
        caption=f"Tires {tires}. What moves with the timestep, the rightmost the car's own. Grey: 1 % about the law; "
        "the axis of the lap spans 2 % of it; broken: where tires count as sliding.",
        draw=lambda figure: _draw_timestep(figure, tires, _of(rows, "timestep")),
    )


def soften(model: mujoco.MjModel, impedance: float, prefix: str = "") -> None:
    """Change the impedance d of the tires' contacts, and what keeps their stiffness, their creep and their slowing.

    The stiffness is 1 / ((time constant * damping ratio)^2 (1 - d)) over the inverse mass; the creep goes with
    solreffriction / d and with (1 - d) / d / impratio (MuJoCo documentation, "Computation").
    """
    pairs = [element_id(model, mujoco.mjtObj.mjOBJ_PAIR, f"{prefix}{wheel}_tire") for wheel in WHEELS]
    before = float(model.pair_solimp[pairs[0], 0])
    softer = (1.0 - impedance) / impedance / ((1.0 - before) / before)
    model.pair_solimp[pairs, :2] = impedance
    model.pair_solreffriction[pairs, 1] *= impedance / before
    model.pair_solref[pairs, 1] *= math.sqrt((1.0 - before) / (1.0 - impedance))
    model.opt.impratio *= softer


def _change(model: mujoco.MjModel, cell: Cell, prefix: str = "") -> None:
    """Change the setting of a cell in a compiled model; `short steps` are none of it."""
    if cell["setting"] == "short steps":
        return
    if cell["setting"] == "impedance":
        soften(model, cell["value"], prefix)
    else:
        Engine(**{cell["setting"]: cell["value"]}).apply(model)


def _circle(cell: Cell) -> Row:
    circle = SteadyCircle(Vehicle.load().nominal_mu, STEERING, Engine(), Tires.load(cell["tires"]))
    _change(circle.ground.model, cell)
    if cell["setting"] == "short steps":
        circle.ground.forces.steps = cell["value"]
    row: Row = {"creep_closed_form_m_s": creep(CREEPING, circle.mu, STEERING, circle.car, circle.ground.model)}
    reasons = []

    def tell(names: tuple[str, ...], numbers: Callable[[], tuple[float, ...]]) -> None:
        try:
            row.update(zip(names, numbers(), strict=True))
        except UnreachableError as error:
            row.update(dict.fromkeys(names, math.nan))
            reasons.append(f"{', '.join(names)}: {error}")

    def k(happens: Callable[[CircleReading], bool]) -> tuple[float]:
        before, after = circle.bisect(happens, width=0.001)
        return (0.5 * (before.k + after.k),)

    tell(("creep_m_s",), lambda: (circle.at(CREEPING).slide,))
    tell(("k_grip",), lambda: k(lambda reading: bool(reading.lets_go)))
    tell(("k_slides",), lambda: k(lambda reading: bool(reading.sliding.any())))
    tell(("slide_m_s", "airborne_share"), lambda: (circle.at(SLIDING).slide, circle.at(SLIDING).airborne))
    tell(("fast_slide_m_s",), lambda: (circle.at(FAST).slide,))
    return {**row, "why_no_k": "; ".join(reasons)}


def _lap(cell: Cell) -> Row:
    """Return the means over some starts of a flying lap and of its greatest slide, and the lap's standard deviation."""
    nothing: Row = dict.fromkeys(_LAP, math.nan)
    if cell["setting"] == "short steps":
        return {**nothing, "why_no_lap": "lap_s: a race has its own number of short steps"}
    times, slides = [], []
    for offset in _STARTS:
        world = World("oval", tires=cell["tires"])
        _change(world.model, cell, world.car.prefix)
        try:
            laps = drive_laps(world, laps=_LAPS, start=Start(offset=offset))
        except ModelError as error:
            return {**nothing, "why_no_lap": f"lap_s: {error}"}
        if len(laps.lap_times_s) < _LAPS:
            return {**nothing, "why_no_lap": f"lap_s: ended by {laps.end_reason}"}
        times.append(laps.lap_times_s[-1])
        slides.append(laps.max_slide_m_s)
    mean, spread, slide = float(np.mean(times)), float(np.std(times, ddof=1)), float(np.mean(slides))
    return {"lap_s": mean, "lap_spread_s": spread, "lap_slide_m_s": slide, "why_no_lap": ""}


def _of(rows: list[Row], setting: str) -> list[Row]:
    return [row for row in rows if row["setting"] == setting]


def _values(rows: list[Row]) -> FloatArray:
    return np.array([float(str(row["value"])) for row in rows])


def _moves(rows: list[Row], name: str) -> float:
    """Return by how much a column moves over some rows."""
    return float(np.ptp(column(rows, name)[np.isfinite(column(rows, name))]))


def _own_sentences(rows: list[Row]) -> tuple[str, ...]:
    """Return what is said of our own tires."""
    steps, short = _of(rows, "timestep"), _of(rows, "short steps")
    own, finest, lap = steps[0], steps[-1], column(steps, "lap_s")
    k, slide, fast = (column(steps, name) for name in ("k_slides", "slide_m_s", "fast_slide_m_s"))
    model = Vehicle.load().compile()
    used = steps_within(model, tire_rows(model), model.opt.timestep)
    text = [
        f"On {DEFAULT_TIRES} the car's own {own['value']} s is right where tires slide, too: from there to "
        f"{finest['value']} s they let go within {_moves(steps, 'k_grip'):.4f} of one k and slide within "
        f"{float(np.nanmax(k) - np.nanmin(k)):.4f}; at {SLIDING:g} and {FAST:g} of the law's speed they slide at "
        f"{slide[0]:.3f} and {fast[0]:.3f} m/s, where {finest['value']} s has {slide[-1]:.3f} and {fast[-1]:.3f}. "
        f"A lap of the oval changes by {100 * abs(lap[0] / lap[-1] - 1):.2f} %, as a mean of {len(_STARTS)} starts; "
        f"one lap has a standard deviation of {100 * column(steps, 'lap_spread_s')[0] / lap[0]:.2f} % by its start."
    ]
    if len(short) > 1:
        most = short[0]
        said = "; ".join(
            f"{row['value']}: k {float(row['k_slides'] or 0.0) - float(most['k_slides'] or 0.0):+.4f}, "
            f"{1e3 * (float(row['fast_slide_m_s'] or 0.0) - float(most['fast_slide_m_s'] or 0.0)):+.1f} mm/s"
            for row in short[1:]
        )
        text.append(
            f"A physics step of {own['value']} s moves the tires by {used} short ones. By number of them, the k at "
            f"which tires slide and how fast they do at {FAST:g}, against {most['value']} short steps: {said}."
        )
    return tuple(text)


def _sentences(rows: list[Row]) -> tuple[str, ...]:
    """Return what is said of MuJoCo's contacts."""
    steps = _of(rows, "timestep")
    own, finest = steps[0], steps[-1]
    lap, lap_slide = column(steps, "lap_s"), 1e3 * column(steps, "lap_slide_m_s")
    creeps, slides, airborne = (column(steps, name) for name in ("creep_m_s", "slide_m_s", "airborne_share"))
    ratios = [row for row in _of(rows, "impratio") if float(str(row["value"])) > 1.0]
    by_ratio = 1e3 * column(ratios, "creep_m_s")
    closed = 1e3 * column(ratios, "creep_closed_form_m_s")
    text = [
        f"On {CONTACT}, while tires hold, the car's own {own['value']} s is enough: from there to {finest['value']} s "
        f"the tires let go within {_moves(steps, 'k_grip'):.3f} of one k and creep within "
        f"{1e3 * np.ptp(creeps):.2f} mm/s, a lap of the oval changes by "
        f"{100 * abs(lap[0] / lap[-1] - 1):.2f} %, its greatest slide by {abs(lap_slide[0] - lap_slide[-1]):.0f} mm/s.",
        f"Where tires slide, it matters a little: at {SLIDING:g} of the law's speed one is off the ground for "
        f"{100 * airborne[0]:.0f} % of the time, and slides at up to {slides[0]:.2f} m/s, where {finest['value']} s "
        f"has {100 * airborne[-1]:.0f} % and {slides[-1]:.2f} m/s. What slides on {CONTACT} in this lab is driven at "
        f"{1e3 * CONTACT_TIMESTEP:g} ms.",
        f"Creep falls with impratio, from {by_ratio[0]:.1f} mm/s at {ratios[0]['value']} to {by_ratio[-1]:.1f} at "
        f"{ratios[-1]['value']}, as the closed form says to {100 * np.abs(by_ratio / closed - 1).max():.1f} %: what is "
        "left there is solreffriction's.",
    ]
    others = [row for row in rows if row["setting"] in ("solver", "iterations", "tolerance")]
    if others:
        text.append(
            f"Solver, iterations from 5 on and tolerance move k by {_moves(others, 'k_grip'):.3f} and the lap by "
            f"{1e3 * _moves(others, 'lap_s'):.0f} ms. With pyramidal cones tires do not hold at all."
        )
    soft = _of(rows, "impedance")
    if soft:
        text.append(
            f"With an impedance of {soft[-1]['value']} for {soft[0]['value']}, stiffness and creep as they are, tires "
            f"that slide would hop at the car's own timestep: at {SLIDING:g} at up to {soft[-1]['slide_m_s']:.2f} m/s, "
            f"not {soft[0]['slide_m_s']:.2f}, at {FAST:g} at {soft[-1]['fast_slide_m_s']:.2f}, not "
            f"{soft[0]['fast_slide_m_s']:.2f}."
        )
    return tuple(text)


def _expected(tires: str, rows: list[Row]) -> tuple[tuple[str, str, str], ...]:
    steps = _of(rows, "timestep")
    laps = column(steps, "lap_s")
    return (
        (
            f"{tires}: k where they let go, over all timesteps",
            "moves by less than 0.01",
            f"{_moves(steps, 'k_grip'):.3f}",
        ),
        ("creep at 0.95, over all timesteps", "the same", f"within {1e3 * _moves(steps, 'creep_m_s'):.2f} mm/s"),
        ("lap of the oval, own timestep over the finest", "1", f"{laps[0] / laps[-1]:.4f}"),
    )


def _draw_timestep(figure: matplotlib.figure.Figure, tires: str, rows: list[Row]) -> None:
    panels = figure.subplots(2, 2, sharex=True)
    timestep = 1e3 * _values(rows)
    drawn: tuple[tuple[str, str, tuple[tuple[str, str], ...]], ...] = (
        ("k [-]", "", (("k_grip", "tires let go"), ("k_slides", f"above {slides_above(tires)} m/s"))),
        ("sliding [m/s]", "log", (("creep_m_s", f"at {CREEPING:g}"), ("slide_m_s", f"at {SLIDING:g}"))),
        ("lap of the oval [s]", "", (("lap_s", ""),)),
        ("time with a tire off\nthe ground [-]", "", (("airborne_share", f"at {SLIDING:g}"),)),
    )
    for place, (axes, (label, scale, lines)) in enumerate(zip(panels.flat, drawn, strict=True)):
        for (name, what), colour in zip(lines, style.COLOURS, strict=False):
            values = column(rows, name)
            known = np.isfinite(values)
            style.measured(axes, timestep[known], values[known], what, colour=colour, linestyle="-", linewidth=0.6)
        axes.set_xscale("log")
        if scale:
            axes.set_yscale(scale)
            style.limit(axes, slides_above(tires))
        style.finish(axes, "timestep [ms]" if place > 1 else "", label)
    panels[0, 0].axhspan(0.99, 1.01, color="0.93", zorder=0.5)
    panels[0, 0].set_ylim(0.98, 1.02)
    lap = float(np.nanmean(column(rows, "lap_s")))
    panels[1, 0].set_ylim(0.99 * lap, 1.01 * lap)
    panels[0, 0].set_xticks(timestep, [f"{value:g}" for value in timestep])
    panels[0, 0].minorticks_off()


def _draw_impratio(figure: matplotlib.figure.Figure, rows: list[Row]) -> None:
    axes = figure.add_subplot()
    model = Vehicle.load().spec(tires=Tires.load(CONTACT)).compile()
    car = car_parameters(model)
    ratios = np.geomspace(_values(rows)[0], _values(rows)[-1], 60)
    closed = []
    for ratio in ratios:
        model.opt.impratio = ratio
        closed.append(creep(CREEPING, Vehicle.load().nominal_mu, STEERING, car, model))
    style.theory(axes, ratios, closed, "closed form")
    style.measured(axes, _values(rows), column(rows, "creep_m_s"), "measured")
    style.limit(axes, SLIDING_SPEED, "counts as sliding")
    axes.set_xscale("log")
    style.finish(axes, "impratio [-]", "creep [m/s]")
