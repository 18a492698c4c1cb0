"""The law on tires of real cars: at which k the first of them passes its peak, and what margin a planner needs.

The law v = sqrt(g mu b / tan d) has the peak that a planner is told, `Tires.least_peak`, for its mu. A tire with a
curve slides when it is past its peak (`tire_slip`). Measured are, for each set of tires:

- `circles`: the k at which the first tire passes its peak, in the skidpad's circles, over mu and load sensitivity. It
  is sqrt(grip / curvature): of the grip that the car uses then, over mu, and of the curvature that it drives then, over
  that of its steering angle. `curve_onset` has a closed form of it;
- `transients`: the greatest k at which none does, in the lab's manoeuvres and in steps to the skidpad's angles, the
  speed held; and whether the friction limiter keeps all below their peak;
- `bridge`: `coulomb` at the car's own timestep beside MuJoCo's `contact` at one at which that is right, by the same
  measure: an axle uses 99 % of its friction;
- `timestep`: the first, at 5 ms and at .25 ms.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from fg_mujoco.controllers.safety.friction_limiter import FrictionLimiterSettings

from ..messages import CarParameters, Odometry
from ..pictures.pages import figure_kit as style
from ..pictures.pages.figure_kit import column
from ..vehicle.tires import CONTACT, Tires, tire_names
from ..vehicle.vehicle import DEFAULT_VEHICLE, Vehicle
from .curve_onset import curve_onset
from .experiment import Cell, Experiment, Figure, LabSettings, Row, Section, Tables
from .lab_ground import Engine, LabGround
from .reference_steering import MANOEUVRES, Manoeuvre
from .skidpad import STEERINGS
from .steady_circle import CircleReading, SteadyCircle, UnreachableError, greatest_peak
from .transient import drive

if TYPE_CHECKING:
    import matplotlib.figure

MUS = (0.4, 0.7, 1.0)  # beside the set's own
LOAD_SENSITIVITIES = (0.0, 0.18)
"""Beside the set's own. .18 is that of a racing tire: its side force over load falls from 1.10 to .97 where the load
doubles (Milliken and Milliken, Race Car Vehicle Dynamics, figure 2.9). SlipX has .15 for a car of this scale."""
OWN_VEHICLES = {"nuc2": "forzaeth_nuc2"}  # bundled cars on which a bundled set was identified
LOW, HIGH = 0.4, 3.0  # k between which the first tire is sought
_QUICK_TIRES, _QUICK_STEERINGS, _QUICK_MANOEUVRES = ("forzaeth_nuc2", "coulomb"), (0.1, 0.3), ("step",)
_WIDTH = 0.002  # of a bisection, in k
_FINE_WIDTH = 0.0005  # of one that is compared
_EXACT = 0.00025  # [s] the timestep that the car's own is compared with
_STRIDE, _MANOEUVRE_WIDTH, _MANOEUVRE_HIGH = 0.1, 0.01, 2.0  # in k, of manoeuvres
_LIMITED_KS = (1.1, 1.5)  # of the reference speed, under the friction limiter
_LIMITED_SHARES = (1.0, 0.95, 0.9, 0.85, 0.8, 0.75, 0.7, 0.6, 0.5, 0.4)  # of mu, that it is told
_STRAIGHT, _STEP_SECONDS = 0.5, 3.0  # [s] as in the lab's step
_BRIDGE, _BRIDGE_MUS = "coulomb", (0.6, 1.0489)
_BRIDGE_SHARE = 0.99  # of an axle's friction: that of the peak of `coulomb`, which has no falling branch
_NO_PEAK = "linear tires have no peak"
_CAR_TIMESTEP = Engine(timestep=None)  # 5 ms, of the MJCF
_STEP = "step to {:g} rad"


class TireLaw:
    """See the module."""

    name = "tire_law"
    title = "The law on tires of real cars"

    def cells(self, settings: LabSettings) -> list[Cell]:
        """One for each circle, manoeuvre, and comparison."""
        named = settings.tires or (_QUICK_TIRES if settings.quick else tuple(n for n in tire_names() if n != CONTACT))
        sets = [Tires.load(name) for name in named]
        steerings = settings.steerings or (_QUICK_STEERINGS if settings.quick else STEERINGS)
        mus: tuple[float | None, ...] = settings.mus or ((None,) if settings.quick else (None, *MUS))
        manoeuvres = _QUICK_MANOEUVRES if settings.quick else tuple(MANOEUVRES)
        curved = [tires for tires in sets if tires.slides]
        cells: list[Cell] = []

        def circles(vehicle: str, tires: Tires, sensitivity: float | None, mu: float | None) -> None:
            cells.extend(
                {"part": "circles", "vehicle": vehicle, "tires": tires.described(), "load_sensitivity": sensitivity,
                 "mu": mu, "steering": steering} for steering in steerings
            )  # fmt: skip

        for tires in sets:
            for mu in mus if tires.slides else mus[:1]:
                circles(DEFAULT_VEHICLE, tires, None, mu)
            for vehicle in [vehicle for vehicle, own in OWN_VEHICLES.items() if own == tires.name]:
                circles(vehicle, tires, None, mus[0])
        for tires, sensitivity in product(curved, LOAD_SENSITIVITIES):
            if any(axle.load_sensitivity != sensitivity for axle in tires.axles):
                circles(DEFAULT_VEHICLE, tires, sensitivity, mus[0])
        names = (*manoeuvres, *(_STEP.format(steering) for steering in steerings))
        for tires, name in product(curved, names):
            angle = None if name in MANOEUVRES else steerings[names.index(name) - len(manoeuvres)]
            cells.append(
                {"part": "transients", "tires": tires.described(), "mu": mus[0], "manoeuvre": name, "steering": angle}
            )
        cells += [
            {"part": "timestep", "tires": tires.described(), "mu": mus[0], "steering": steerings[-1]}
            for tires in curved
        ]
        if _BRIDGE in named:
            cells += [{"part": "bridge", "mu": mu, "steering": angle} for mu, angle in product(_BRIDGE_MUS, steerings)]
        return cells

    def measure(self, cell: Cell) -> Tables:
        """Measure a circle, a manoeuvre, or a comparison."""
        parts: dict[str, Callable[[Cell], Row]] = {
            "circles": _circle_row, "transients": _transient_row, "timestep": _timestep_row, "bridge": _bridge_row
        }  # fmt: skip
        return {cell["part"]: [parts[cell["part"]](cell)]}

    def section(self, tables: Tables) -> Section:
        """Say how far the law holds, and what margin it takes."""
        circles = tables["circles"]
        return Section(
            sentences=_sentences(tables),
            figures=(
                Figure(
                    name="k",
                    caption="Left: k at which the first tire passes its peak, each set at its own peak; lines: the "
                    "closed form of a single-track car, which drives without drag. An arrow: no tire does up to "
                    f"k {HIGH:g} or the car's greatest speed. Right: the curvature that the car drives at the law's "
                    "speed, k 1, over that of its steering angle; a car that is past its peak there has none.",
                    draw=lambda figure: _draw_k(figure, circles),
                    height=3.9,
                ),
                Figure(
                    name="margin",
                    caption="The greatest k at which no tire passes its peak, in each circle and manoeuvre. Grey: "
                    "what the friction limiter uses of the grip.",
                    draw=lambda figure: _draw_margin(figure, tables),
                    height=3.4,
                ),
            ),
            columns={
                "circles": (
                    "vehicle", "tires", "mu", "load_sensitivity", "steering_rad", "k_peak", "k_closed_form",
                    "first_tire", "grip", "curvature_ratio", "slip_angle_front_rad", "slip_angle_rear_rad",
                    "curvature_at_law", "reason",
                ),
                "transients": (
                    "tires", "mu", "manoeuvre", "k_peak", "first_tire", "limited_slide_share", "limited_mu_share",
                    "reason",
                ),
                "bridge": (
                    "mu", "steering_rad", "k_axle_contact", "k_axle_coulomb", "path_k_axle_contact",
                    "path_k_axle_coulomb", "k_slides_contact", "k_slides_coulomb",
                ),
                "timestep": ("tires", "mu", "steering_rad", "k_own", "k_exact", "reason"),
            },
            expected=_expected(tables),
        )  # fmt: skip


EXPERIMENT: Experiment = TireLaw()


def _tires(cell: Cell) -> Tires:
    """Return the tires of a cell, with its load sensitivity, and its vehicle's friction where they give none."""
    friction = Vehicle.load(cell.get("vehicle", DEFAULT_VEHICLE)).nominal_mu
    tires = Tires.load(cell["tires"]).on(friction)
    sensitivity = cell.get("load_sensitivity")
    if sensitivity is None or not tires.slides:
        return tires
    front, rear = (replace(axle, load_sensitivity=sensitivity) for axle in tires.axles)
    return replace(tires, front=front, rear=rear)


def _told(cell: Cell, tires: Tires) -> float:
    """Return the mu of a cell: what a planner is told."""
    assert tires.least_peak is not None
    return float(tires.least_peak if cell["mu"] is None else cell["mu"])


def passes_peak(reading: CircleReading) -> bool:
    """Return whether some tire slides."""
    return bool(reading.sliding.any())


def _circle_row(cell: Cell) -> Row:
    tires = _tires(cell)
    mu, steering = _told(cell, tires), cell["steering"]
    row: Row = {
        "vehicle": cell["vehicle"],
        "tires": tires.name,
        "mu": mu,
        "own_mu": cell["mu"] is None,
        "load_sensitivity": max(axle.load_sensitivity for axle in tires.axles),
        "own_load_sensitivity": cell["load_sensitivity"] is None,
        "steering_rad": steering,
    }
    numbers = ("k_peak", "k_closed_form", "k_reached", "grip", "curvature_ratio", "slip_angle_front_rad",
               "slip_angle_rear_rad", "curvature_at_law", "lightest_load_N")  # fmt: skip
    nothing: Row = {**dict.fromkeys(numbers, math.nan), "first_tire": ""}
    if not tires.slides:
        return {**row, **nothing, "reason": _NO_PEAK}
    circle = SteadyCircle(mu, steering, _CAR_TIMESTEP, tires, cell["vehicle"])
    row = {**row, **nothing, "k_closed_form": curve_onset(tires, mu, steering, circle.car), "reason": ""}
    try:
        at_law = circle.at(1.0)
        row["curvature_at_law"] = math.nan if passes_peak(at_law) else at_law.curvature
    except UnreachableError:
        pass
    try:
        before, after = circle.bisect(passes_peak, low=LOW, high=HIGH, width=_WIDTH)
    except UnreachableError as error:
        held = circle.fastest
        return {**row, "k_reached": held.k if held else math.nan, "reason": str(error)}
    angles = before.slip_angles
    return {
        **row,
        "k_peak": before.k,
        "k_reached": before.k,
        "first_tire": _place(after.first_tire, steering),
        "grip": before.acceleration / (mu * circle.car.gravity),
        "curvature_ratio": before.curvature,
        "slip_angle_front_rad": float(angles[:2].mean()),
        "slip_angle_rear_rad": float(angles[2:].mean()),
        "lightest_load_N": float(before.loads.min()),
    }


def _place(wheel: str, steering: float) -> str:
    """Return a wheel's name by its side of the turn: "rear inner"."""
    axle, _, side = wheel.partition("_")
    return f"{axle} {'inner' if (side == 'left') == (steering > 0.0) else 'outer'}"


def _plan(cell: Cell) -> Manoeuvre:
    """Return the manoeuvre of a cell: one of the lab's, or a step to its steering angle."""
    if cell["steering"] is None:
        return MANOEUVRES[cell["manoeuvre"]]

    def steering(odometry: Odometry, car: CarParameters) -> float:
        return float(cell["steering"]) if odometry.stamp >= _STRAIGHT else 0.0

    return Manoeuvre(name=cell["manoeuvre"], steering=steering, seconds=_STEP_SECONDS)


def _transient_row(cell: Cell) -> Row:
    tires, plan = _tires(cell), _plan(cell)
    mu = _told(cell, tires)
    ground = LabGround(greatest_peak(tires, mu), _CAR_TIMESTEP, tires)
    angle = cell["steering"]
    first = {0.0: ""}

    def slides(k: float) -> bool:
        trace, _ = drive(ground, plan, mu, k, "none", angle)
        sliding = np.argwhere(trace.slip.slides)
        if len(sliding):
            tire = ("front left", "front right", "rear left", "rear right")[sliding[0, 1]]
            first[k] = f"{tire} at {sliding[0, 0] * trace.timestep:.2f} s"
        return bool(len(sliding))

    low, high = 0.0, LOW
    while not slides(high) and high < _MANOEUVRE_HIGH:
        low, high = high, high + _STRIDE
    reached = high >= _MANOEUVRE_HIGH and high not in first
    while not reached and high - low > _MANOEUVRE_WIDTH:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if slides(middle) else (middle, high)
    slide_shares = [_limited_slides(ground, plan, mu, share, angle) for share in _LIMITED_SHARES[:1]]
    while slide_shares[-1] > 0.0 and len(slide_shares) < len(_LIMITED_SHARES):
        slide_shares.append(_limited_slides(ground, plan, mu, _LIMITED_SHARES[len(slide_shares)], angle))
    return {
        "tires": tires.name,
        "mu": mu,
        "manoeuvre": cell["manoeuvre"],
        "k_peak": math.nan if reached else low,
        "first_tire": "" if reached else first[high],
        "limited_slide_share": slide_shares[0],
        "limited_mu_share": math.nan if slide_shares[-1] > 0.0 else _LIMITED_SHARES[len(slide_shares) - 1],
        "reason": f"no tire passes its peak up to k {_MANOEUVRE_HIGH:g}" if reached else "",
    }


def _limited_slides(ground: LabGround, plan: Manoeuvre, mu: float, share: float, angle: float | None) -> float:
    """Return for which share of the time a tire slides under a friction limiter that is told `share` of mu."""
    found = 0.0
    for k in _LIMITED_KS:
        trace, _ = drive(ground, plan, share * mu, k / math.sqrt(share), "guard", angle)
        found = max(found, float(trace.slip.slides.any(axis=1).mean()))
    return found


def _timestep_row(cell: Cell) -> Row:
    tires = _tires(cell)
    mu = _told(cell, tires)
    row: Row = {
        "tires": tires.name, "mu": mu, "steering_rad": cell["steering"], "k_own": math.nan, "k_exact": math.nan,
        "reason": "",
    }  # fmt: skip
    try:
        for name, engine in (("k_own", _CAR_TIMESTEP), ("k_exact", Engine(timestep=_EXACT))):
            circle = SteadyCircle(mu, cell["steering"], engine, tires)
            if name == "k_own":
                row[name] = near = circle.bisect(passes_peak, low=LOW, high=HIGH, width=_FINE_WIDTH)[0].k
            else:
                row[name] = circle.bisect(passes_peak, low=near - 0.02, high=near + 0.1, width=_FINE_WIDTH)[0].k
    except UnreachableError as error:
        row["reason"] = str(error)
    return row


def _bridge_row(cell: Cell) -> Row:
    row: Row = {"mu": cell["mu"], "steering_rad": cell["steering"]}
    for name in (CONTACT, _BRIDGE):
        circle = SteadyCircle(cell["mu"], cell["steering"], tires=Tires.load(name))
        for what, happens in (("axle", _uses_its_friction), ("slides", passes_peak)):
            try:
                before, after = circle.bisect(happens, width=_FINE_WIDTH)
            except UnreachableError:
                row[f"k_{what}_{name}"] = row[f"path_k_{what}_{name}"] = math.nan
                continue
            row[f"k_{what}_{name}"] = k = 0.5 * (before.k + after.k)
            row[f"path_k_{what}_{name}"] = k * math.sqrt(before.curvature)
    return row


def _uses_its_friction(reading: CircleReading) -> bool:
    """Return whether an axle uses _BRIDGE_SHARE of its friction."""
    return max(reading.axle_use) > _BRIDGE_SHARE


def _own(circles: list[Row], vehicle: str = DEFAULT_VEHICLE) -> list[Row]:
    """Return the circles of a vehicle on tires as they are published."""
    return [row for row in circles if row["vehicle"] == vehicle and row["own_mu"] and row["own_load_sensitivity"]]


def _of(rows: list[Row], tires: str) -> list[Row]:
    return [row for row in rows if row["tires"] == tires]


def _names(rows: list[Row]) -> list[str]:
    return list(dict.fromkeys(str(row["tires"]) for row in rows))


def _least(rows: list[Row], name: str = "k_peak") -> float:
    """Return the least number of a column; inf: it has none."""
    values = column(rows, name)
    return float(np.nanmin(values)) if np.isfinite(values).any() else math.inf


def _span(rows: list[Row], name: str) -> str:
    values = column(rows, name)
    values = values[np.isfinite(values)]
    return f"{values.min():.3f} to {values.max():.3f}" if len(values) else "none"


def _curved(circles: list[Row]) -> list[Row]:
    return [row for row in circles if row["reason"] != _NO_PEAK]


def _percent(rows: list[Row], reference: str, other: str) -> str:
    """Return the greatest distance of a column from another, in percent of that."""
    shares = np.abs(column(rows, other) / column(rows, reference) - 1.0)
    return f"{100.0 * float(np.nanmax(shares)):.2f} %" if np.isfinite(shares).any() else "none"


def _sentences(tables: Tables) -> tuple[str, ...]:
    circles, transients = _curved(tables["circles"]), tables.get("transients", [])
    own, text = _own(circles), []
    passed = [row for row in own if math.isfinite(float(row["k_peak"] or 0.0))]
    never = [row for row in own if row not in passed]
    if passed:
        worst = min(passed, key=lambda row: float(row["k_peak"] or 0.0))
        text.append(
            f"On steady circles the first tire passes its peak at {_span(passed, 'k_peak')} of the law's speed, the "
            f"first at {worst['tires']} and {worst['steering_rad']:g} rad; on {len(never)} of {len(own)} circles none "
            f"does up to k {HIGH:g}, or the greatest speed, because the car runs wide."
        )
        text.append(
            f"The grip that the car uses then is {_span(passed, 'grip')} of mu, and the curvature that it drives "
            f"{_span(passed, 'curvature_ratio')} of that of its steering angle: k is the root of their ratio. On the "
            "circle that is driven the law would hold at "
            f"{_least(passed, 'grip') ** 0.5:.3f} to {float(np.nanmax(column(passed, 'grip'))) ** 0.5:.3f}."
        )
        places = [str(row["first_tire"]) for row in passed]
        counts = ", ".join(f"{place} {places.count(place)}" for place in sorted(set(places)))
        text.append(f"The first tire: {counts}.")
    for name in _names(own):
        least = {
            "circles": _least(_of(own, name)),
            "all circles, with other mu and load sensitivity": _least(_of(circles, name)),
            "manoeuvres": _least(_of(transients, name)),
        }
        said = "; ".join(f"{what} {'none' if math.isinf(k) else f'{k:.3f}'}" for what, k in least.items())
        share = _least(_of(transients, name), "limited_mu_share")
        told = "" if share == 1.0 else f", told {share:g} mu,"
        limited = "" if math.isinf(share) else f" The friction limiter{told} keeps all tires below it in manoeuvres."
        text.append(f"Least k of {name}: {said}.{limited}")
    linear = [row for row in tables["circles"] if row not in circles]
    text += [f"{name} is linear: it has no peak, and never slides." for name in _names(linear)]
    return tuple(text)


def _expected(tables: Tables) -> tuple[tuple[str, str, str], ...]:
    own, transients = _own(_curved(tables["circles"])), tables.get("transients", [])
    bridge, steps = tables.get("bridge", []), tables.get("timestep", [])
    limited = [row for row in transients if float(row["limited_slide_share"] or 0.0) > 0.0]
    lines = [("k at which the first tire passes its peak", "1", _span(own, "k_peak"))]
    if transients:
        lines += [
            ("least k without a tire past its peak in manoeuvres", "-", _span(transients, "k_peak")),
            ("manoeuvres in which a tire is past its peak under the friction limiter", "none",
             f"{len(limited)} of {len(transients)}"),
        ]  # fmt: skip
    if bridge:
        of_k, of_path = (
            _percent(bridge, f"{kind}_contact", f"{kind}_coulomb") for kind in ("k_axle", "path_k_axle")
        )  # fmt: skip
        lines += [
            ("coulomb to contact, k at which an axle uses 99 % of its friction", "within 1 %", of_k),
            ("the same, k on the circle that is driven", "within 1 %", of_path),
        ]
    if steps:
        moved = _percent(steps, "k_exact", "k_own")
        lines.append(("k of the first tire past its peak, 5 ms to .25 ms", "within 0.2 %", moved))
    return tuple(lines)


def _draw_k(figure: matplotlib.figure.Figure, circles: list[Row]) -> None:
    left, right = figure.subplots(1, 2)
    own = _own(_curved(circles))
    for place, name in enumerate(_names(own)):
        rows, colour = _of(own, name), style.COLOURS[place % len(style.COLOURS)]
        steering, k = column(rows, "steering_rad"), column(rows, "k_peak")
        closed = np.clip(column(rows, "k_closed_form"), None, 2.0 * HIGH)
        left.plot(steering, closed, color=colour, linewidth=0.7)
        style.measured(left, steering, k, name, colour=colour)
        reached = np.where(np.isnan(k), np.clip(column(rows, "k_reached"), None, HIGH), np.nan)
        shift = 0.003 * (place - 3)  # [rad] so that arrows of several sets are told apart
        left.plot(steering + shift, reached, linestyle="none", marker=r"$\uparrow$", color=colour, markersize=8.0)
        style.measured(
            right, steering, column(rows, "curvature_at_law"), name, colour=colour, linestyle="-", linewidth=0.7
        )
    for axes in (left, right):
        axes.axhline(1.0, color="0.6", linewidth=0.8, zorder=0.5)
    left.set_yscale("log")
    left.set_ylim(0.78, 3.5)
    ticks = (0.8, 0.9, 1.0, 1.2, 1.5, 2.0, 3.0)
    left.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
    left.minorticks_off()
    style.finish(left, "steering [rad]", "k of the first tire past its peak [-]", legend=False)
    style.finish(right, "steering [rad]", "curvature at k 1, over tan(d)/b [-]", legend=False)
    figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=4)


def _draw_margin(figure: matplotlib.figure.Figure, tables: Tables) -> None:
    axes = figure.add_subplot()
    circles, transients = _curved(tables["circles"]), tables.get("transients", [])
    names = _names(circles)
    own = _own(circles)
    for place, name in enumerate(names):
        others = [row for row in _of(circles, name) if row not in own]
        for shift, rows, label, colour in (
            (0.2, _of(own, name), "circles, as published", style.COLOURS[0]),
            (0.0, others, "circles, other mu, load sensitivity and vehicle", style.COLOURS[5]),
            (-0.2, _of(transients, name), "manoeuvres, the speed held", style.COLOURS[1]),
        ):
            k = column(rows, "k_peak")
            style.measured(axes, k, np.full(len(k), -place + shift), "" if place else label, colour=colour)
        if not np.isfinite([_least(_of(rows, name)) for rows in (circles, transients)]).any():
            axes.text(
                1.05, -place, f"none: up to k {HIGH:g} in circles, {_MANOEUVRE_HIGH:g} in manoeuvres", va="center"
            )
    limit = math.sqrt(FrictionLimiterSettings().lateral_use)
    axes.axvspan(0.0, limit, color="0.94", zorder=0.2)
    axes.axvline(1.0, color="0.6", linewidth=0.8, zorder=0.5)
    axes.set_xscale("log")
    axes.set_xlim(0.65, HIGH)
    ticks = (0.7, 0.8, 0.9, 1.0, 1.2, 1.5, 2.0, 3.0)
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.minorticks_off()
    axes.set_yticks([-place for place in range(len(names))], names)
    style.finish(axes, "greatest k without a tire past its peak [-]", "", legend=False)
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=3)
