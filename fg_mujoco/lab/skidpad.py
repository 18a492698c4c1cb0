"""The skidpad: at which speeds the tires let go on a circle, and how the circle widens beyond.

Constant steering, the speed brought slowly to k times the law's sqrt(g mu b / tan d). By bisection, two ks:

- `k_grip`: the tires let go, whatever they creep: an axle has used up its friction, forces over loads, or a light wheel
  spins;
- `k_slides`: a tire slides, by the threshold of its set, which is the same for all grounds (`tire_slip`).

All is measured on our own tires and on MuJoCo's contacts (LAW_TIRES). Both ks have a closed form in `rigid_car`. Beyond
them the curvature falls as 1 / k^2, as Coulomb's law has it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import cycle
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from fg_mujoco.controllers.control.speed import lifting_share

from ..pictures.pages import figure_kit as style
from ..pictures.pages.figure_kit import column
from ..vehicle.car import WHEELS, car_parameters
from ..vehicle.tire_slip import slides_above
from ..vehicle.tires import IDEAL_TIRES, Tires
from ..vehicle.vehicle import Vehicle
from .experiment import LAW_TIRES, Cell, Experiment, Figure, LabSettings, Row, Section, Tables
from .rigid_car import grip_onset, onset, sliding_onset, tire_loads
from .steady_circle import CircleReading, SteadyCircle, UnreachableError

if TYPE_CHECKING:
    import matplotlib.figure

MUS = (0.3, 0.5, 0.7, 0.9, 1.0489, 1.3)
STEERINGS = (0.05, 0.1, 0.2, 0.3, 0.4)  # [rad]
CURVATURE_KS = (0.9, 0.95, 1.0, 1.05, 1.1, 1.15, 1.2, 1.25, 1.3)
_QUICK_MUS, _QUICK_STEERINGS, _QUICK_KS = (0.5, 1.0489), (0.1, 0.4), (0.95, 1.1, 1.2)
_WIDTH = 0.002  # of a bisection, in k
_WIDE = 0.2  # [rad] up to which the law, a point's, is asked to hold within 1 %
_LOADS = tuple(f"load_{wheel}_N" for wheel in WHEELS)

_Bracket: TypeAlias = tuple[CircleReading, CircleReading]


class Skidpad:
    """See the module."""

    name = "skidpad"
    title = "Steady circles: where the tires slide"

    def cells(self, settings: LabSettings) -> list[Cell]:
        """One for each set of tires, friction, steering and side."""
        mus = settings.mus or (_QUICK_MUS if settings.quick else MUS)
        steerings = settings.steerings or (_QUICK_STEERINGS if settings.quick else STEERINGS)
        ks = list(_QUICK_KS if settings.quick else CURVATURE_KS)
        angles = [side * abs(steering) for steering in steerings for side in (1, -1)]
        return [
            {"tires": tires, "mu": mu, "steering": angle, "ks": ks}
            for tires in LAW_TIRES
            for mu in mus
            for angle in angles
        ]

    def measure(self, cell: Cell) -> Tables:
        """Find both ks of a circle, and the curvature at each of the cell's."""
        circle = SteadyCircle(cell["mu"], cell["steering"], tires=Tires.load(cell["tires"]))
        return {"onset": [_onset_row(circle)], "curvature": [_curvature_row(circle, k) for k in cell["ks"]]}

    def section(self, tables: Tables) -> Section:
        """Say where the tires let go, and draw it beside the closed forms."""
        parts = [
            (tires, _on(tables["onset"], tires), _on(tables["curvature"], tires))
            for tires in dict.fromkeys(str(row["tires"]) for row in tables["onset"])
        ]
        return Section(
            sentences=tuple(sentence for part in parts for sentence in _sentences(*part)),
            figures=tuple(figure for part in parts for figure in _figures(*part)),
            columns={
                "onset": (
                    "tires", "mu", "steering_rad", "law_speed_m_s", "k_grip", "k_grip_closed_form", "lets_go",
                    "k_slides", "k_slides_closed_form", "k_lifts_closed_form", "first_tire",
                    "lightest_tire", "lightest_load_N", "reason",
                )
            },
            expected=tuple(line for part in parts for line in _expected(*part)),
        )  # fmt: skip


EXPERIMENT: Experiment = Skidpad()


def _on(rows: list[Row], tires: str) -> list[Row]:
    return [row for row in rows if row["tires"] == tires]


def _figures(tires: str, onsets: list[Row], curvatures: list[Row]) -> tuple[Figure, ...]:
    """Return the figures of a set of tires."""
    ending = "" if tires == IDEAL_TIRES else f"_{tires}"
    return (
        Figure(
            name=f"k{ending}",
            caption=f"Tires {tires}. Left: k at which the tires let go, and 1 % about the law. Right: k at which a "
            f"tire slides, above {slides_above(tires)} m/s. Lines: the closed form, a rigid car on four wheels, with "
            "the creep of MuJoCo's contact. Points: turns to the left and to the right.",
            draw=lambda figure: _draw_k(figure, tires, onsets),
        ),
        Figure(
            name=f"curvature{ending}",
            caption=f"Tires {tires}. Curvature over that of the steering angle. Left: against k, and 1/k² as a line. "
            "Right: times k², with 5 % about 1; broken lines: the closed form's k, squared, on each circle.",
            draw=lambda figure: _draw_curvature(figure, curvatures),
        ),
        Figure(
            name=f"loads{ending}",
            caption=f"Tires {tires}. What the tires carry where they let go. Lines: a rigid car; that the body rolls "
            "on its springs, and that wheels are gyroscopes, moves a little more.",
            draw=lambda figure: _draw_loads(figure, onsets),
        ),
    )


def _bracket(circle: SteadyCircle, happens: Callable[[CircleReading], bool]) -> tuple[_Bracket | None, str]:
    """Return the readings before and after something happens, or the reason why there are none."""
    try:
        return circle.bisect(happens, width=_WIDTH), ""
    except UnreachableError as error:
        return None, str(error)


def _middle(bracket: _Bracket | None) -> float:
    return 0.5 * (bracket[0].k + bracket[1].k) if bracket else math.nan


def _onset_row(circle: SteadyCircle) -> Row:
    mu, steering, car = circle.mu, circle.steering, circle.car
    grip, why_no_grip = _bracket(circle, lambda reading: bool(reading.lets_go))
    slides, why_no_slide = _bracket(circle, lambda reading: bool(reading.sliding.any()))
    loads = grip[0].loads if grip else np.full(len(WHEELS), math.nan)
    reasons = [f"{name}: {why}" for name, why in (("k_grip", why_no_grip), ("k_slides", why_no_slide)) if why]
    return {
        "tires": circle.tires.name,
        "mu": mu,
        "steering_rad": steering,
        "law_speed_m_s": circle.law,
        "k_grip": _middle(grip),
        "k_grip_closed_form": grip_onset(mu, steering, car, circle.ground.model),
        "lets_go": grip[1].lets_go if grip else "",
        "k_slides": _middle(slides),
        "k_slides_closed_form": sliding_onset(mu, steering, car, circle.ground.model),
        "k_lifts_closed_form": math.sqrt(lifting_share(car, steering) / mu),
        "first_tire": slides[1].fastest_tire if slides else "",
        "lightest_tire": WHEELS[int(loads.argmin())] if grip else "",
        "lightest_load_N": float(loads.min()),
        **dict(zip(_LOADS, loads.tolist(), strict=True)),
        "reason": "; ".join(reasons),
    }


def _curvature_row(circle: SteadyCircle, k: float) -> Row:
    row: Row = {"tires": circle.tires.name, "mu": circle.mu, "steering_rad": circle.steering, "k_asked": k}
    nothing: Row = dict.fromkeys(("k", "curvature_ratio", "closed_form", "slide_m_s", "airborne_share"), math.nan)
    try:
        reading = circle.at(k)
    except UnreachableError as error:
        return {**row, **nothing, "reason": str(error)}
    if reading.lost:
        return {**row, **nothing, "reason": f"{reading.why_lost} at {reading.speed:.2f} m/s"}
    limit = onset(circle.mu, circle.steering, circle.car)
    return {
        **row,
        "k": reading.k,
        "curvature_ratio": reading.curvature,
        "closed_form": min(1.0, (limit / reading.k) ** 2),
        "slide_m_s": reading.slide,
        "airborne_share": reading.airborne,
        "reason": "",
    }


def _worst(rows: list[Row], value: str, target: str | float) -> tuple[float, Row]:
    """Return the greatest distance of a column from another, or from a number, and the row of it."""
    aim = column(rows, target) if isinstance(target, str) else target
    distances = np.abs(column(rows, value) - aim)
    if np.isnan(distances).all():
        return math.nan, rows[0]
    worst = int(np.nanargmax(distances))
    return float(distances[worst]), rows[worst]


def _cell(row: Row) -> str:
    return f"mu {row['mu']:g} and {row['steering_rad']:+g} rad"


def _span(rows: list[Row], name: str) -> str:
    return style.span(column(rows, name))


def _wide(rows: list[Row]) -> list[Row]:
    return [row for row in rows if abs(float(row["steering_rad"] or 0.0)) <= _WIDE]


def _sentences(tires: str, onsets: list[Row], curvatures: list[Row]) -> tuple[str, ...]:
    off, worst = _worst(onsets, "k_grip", 1.0)
    form, form_worst = _worst(_gripping(onsets), "k_grip", "k_grip_closed_form")
    slide_off, slide_worst = _worst(onsets, "k_slides", 1.0)
    slide_form, _ = _worst(onsets, "k_slides", "k_slides_closed_form")
    beyond = [row for row in curvatures if column([row], "closed_form")[0] < 1.0]
    curvature_form = np.nanmax(np.abs(column(beyond, "curvature_ratio") / column(beyond, "closed_form") - 1.0))
    silent = [row for row in onsets if row["reason"]]
    lightest = min(onsets, key=lambda row: float(np.nan_to_num(column([row], "lightest_load_N")[0], nan=math.inf)))
    return (
        f"On {tires}, up to {_WIDE:g} rad the tires let go at {_span(_wide(onsets), 'k_grip')} of the law's speed; on "
        f"all circles at {_span(onsets, 'k_grip')}, the farthest from 1 at {_cell(worst)}, {100 * off:.1f} % off.",
        "That is no fault of the tires: a rigid car on four wheels, whose centre of gravity runs wider than its rear "
        "axle and whose outer front wheel is turned in less, lets go there too, to within "
        f"{100 * form:.1f} % (farthest at {_cell(form_worst)}).{_spinning(onsets)}",
        f"By the threshold of {slides_above(tires)} m/s, which is the same for all grounds, sliding begins at "
        f"{_span(onsets, 'k_slides')}, farthest from 1 at {_cell(slide_worst)}, {100 * slide_off:.1f} % off: on "
        "slippery ground a car runs wide slowly, and at mu 1.3 MuJoCo's contacts creep as fast while they hold. With "
        f"both in it the closed form is right to {100 * slide_form:.1f} %.",
        f"Beyond, the curvature falls as 1/k², to within {100 * curvature_form:.1f} % from the closed form's k on.",
        "Load transfer alone moves nothing while no wheel lifts: under Coulomb's law the outer tire gains what the "
        f"inner one loses. A rigid car lifts one at a k of {_span(onsets, 'k_lifts_closed_form')}. The "
        f"lightest wheel at the limit is the {str(lightest['lightest_tire']).replace('_', ' ')} one, with "
        f"{lightest['lightest_load_N']:.1f} N at {_cell(lightest)}.",
        *(f"No number for {_cell(row)}: {row['reason']}." for row in silent),
    )


def _gripping(onsets: list[Row]) -> list[Row]:
    """Return the rows in which an axle lets go, and no single wheel."""
    return [row for row in onsets if "spins" not in str(row["lets_go"])]


def _spinning(onsets: list[Row]) -> str:
    spinning = [row for row in onsets if "spins" in str(row["lets_go"])]
    if not spinning:
        return ""
    off, _ = _worst(spinning, "k_grip", "k_grip_closed_form")
    return (
        f" At {', '.join(_cell(row) for row in spinning)} the inner rear wheel, with "
        f"{column(spinning, 'lightest_load_N').max():.1f} N on it or less, spins {100 * off:.1f} % before at most."
    )


def _expected(tires: str, onsets: list[Row], curvatures: list[Row]) -> tuple[tuple[str, str, str], ...]:
    off, worst = _worst(onsets, "k_grip", 1.0)
    slide_off, slide_worst = _worst(onsets, "k_slides", 1.0)
    form, _ = _worst(_gripping(onsets), "k_grip", "k_grip_closed_form")
    beyond = [row for row in curvatures if column([row], "closed_form")[0] < 1.0]
    wide = column(beyond, "curvature_ratio") * column(beyond, "k") ** 2
    return (
        (f"{tires}: k at which the tires let go, to {_WIDE:g} rad", "0.99 to 1.01", _span(_wide(onsets), "k_grip")),
        ("the same on all circles, worst cell", "within 1 %", f"{100 * off:.1f} % at {_cell(worst)}"),
        ("the same where no wheel spins, against a rigid car on four wheels", "-", f"within {100 * form:.1f} %"),
        (
            f"k at which a tire slides, above {slides_above(tires)} m/s, worst cell",
            "within 1 %",
            f"{100 * slide_off:.1f} % at {_cell(slide_worst)}",
        ),
        ("curvature beyond the limit, times k²", "within 5 %", style.span(wide)),
    )


def _of(rows: list[Row], name: str, value: float, *, either_side: bool = False) -> list[Row]:
    """Return the rows with a value in a column; with that angle, to either side."""
    values = column(rows, name)
    values = np.abs(values) if either_side else values
    return [row for row, found in zip(rows, values, strict=True) if found == value]


def _different(rows: list[Row], name: str) -> list[float]:
    values: list[float] = np.unique(np.abs(column(rows, name))).tolist()
    return values


def _draw_k(figure: matplotlib.figure.Figure, tires: str, onsets: list[Row]) -> None:
    left, right = figure.subplots(1, 2)
    model = Vehicle.load().spec(tires=Tires.load(tires)).compile()
    car = car_parameters(model)
    angles = np.linspace(0.02, max(0.41, *_different(onsets, "steering_rad")), 60)
    for axes in (left, right):
        axes.axhspan(0.99, 1.01, color="0.93", zorder=0.5)
    for mu, colour in zip(_different(onsets, "mu"), cycle(style.COLOURS)):
        rows = _of(onsets, "mu", mu)
        steering = np.abs(column(rows, "steering_rad"))
        for axes, name, closed in (
            (left, "k_grip", [grip_onset(mu, angle, car, model) for angle in angles]),
            (right, "k_slides", [sliding_onset(mu, angle, car, model) for angle in angles]),
        ):
            style.theory(axes, angles, closed, colour=colour)
            style.measured(axes, steering, column(rows, name), f"mu {mu:g}", colour=colour)
    style.finish(left, "steering [rad]", "k where the axle is used up [-]")
    style.finish(right, "steering [rad]", "k where a tire slides [-]", legend=False)


def _draw_curvature(figure: matplotlib.figure.Figure, curvatures: list[Row]) -> None:
    left, right = figure.subplots(1, 2)
    known = [row for row in curvatures if not row["reason"]]
    ks = np.linspace(column(known, "k").min() - 0.01, column(known, "k").max() + 0.01, 200)
    style.theory(left, ks, np.minimum(1.0, ks**-2), "1/k²")
    right.axhspan(0.95, 1.05, color="0.93", zorder=0.5)
    style.theory(right, ks, np.minimum(1.0, ks**2), "1/k²")
    car = Vehicle.load().parameters
    for angle, colour in zip(_different(known, "steering_rad"), cycle(style.COLOURS)):
        rows = _of(known, "steering_rad", angle, either_side=True)
        k, ratio = column(rows, "k"), column(rows, "curvature_ratio")
        style.measured(left, k, ratio, f"{angle:g} rad", colour=colour, markersize=2.5)
        style.measured(right, k, ratio * k**2, f"{angle:g} rad", colour=colour, markersize=2.5)
        k0 = float(np.mean([onset(mu, angle, car) for mu in _different(rows, "mu")]))
        right.plot(ks[ks > k0], 0.0 * ks[ks > k0] + k0**2, color=colour, linewidth=0.8, linestyle=(0, (4, 2)))
    right.set_ylim(0.88, 1.06)
    style.finish(left, "k = speed / law's speed [-]", "curvature over tan(d)/b [-]")
    style.finish(right, "k = speed / law's speed [-]", "curvature over tan(d)/b, times k² [-]", legend=False)


def _draw_loads(figure: matplotlib.figure.Figure, onsets: list[Row]) -> None:
    angles = _different(onsets, "steering_rad")
    drawn = (angles[0], angles[-1])
    car = Vehicle.load().parameters
    mus = np.linspace(0.1, max(_different(onsets, "mu")), 60)
    for axes, angle in zip(figure.subplots(1, 2, sharey=True), drawn, strict=True):
        rows = [row for row in onsets if row["steering_rad"] == angle]
        lines = np.array([tire_loads(onset(mu, angle, car), mu, angle, car) for mu in mus])
        for tire, colour in zip(range(len(WHEELS)), style.COLOURS, strict=False):
            label = WHEELS[tire].replace("_left", ", inner").replace("_right", ", outer")
            style.theory(axes, mus, lines[:, tire], colour=colour)
            style.measured(axes, column(rows, "mu"), column(rows, _LOADS[tire]), label, colour=colour)
        axes.set_title(f"{angle:g} rad to the left", fontsize="medium")
        style.finish(axes, "mu [-]", "load [N]" if angle == drawn[0] else "", legend=angle == drawn[0])
