"""The skidpad: up to which speed a car holds its circle, and what ends it.

Constant steering, settled at one speed after another. Measured are the speeds at which a tire slides, at which a wheel
leaves the ground, and at which the path differs from the steered arc by 5 %, and the curvature that is left at the
law's speed. Beside each stands its closed form (`limits`). The law is safe where its speed is below all three.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..pictures.pages import figure_kit as style
from ..pictures.pages.figure_kit import column
from ..vehicle.tire_slip import NO_PEAK
from ..vehicle.tires import tire_names
from .experiment import ONE_SET, TOLD, Cell, Experiment, LabSettings, Row, Section, number, share_of
from .limits import LEAVES, SteadyLimits
from .steady_circle import CircleReading, NeverError, SteadyCircle, UnreachableError

if TYPE_CHECKING:
    import matplotlib.figure

_LOW, _HIGH = 0.1, 1.6  # of the kinematic law's speed: what is looked at
_CAUSES = {"slides": "grip", "lifts": "load transfer", "leaves_arc": "understeer"}
"""What ends a circle, by the beginning of its columns: a tire slides, a wheel lifts, the path leaves its arc."""


class Skidpad:
    """See the module."""

    name = "skidpad"
    title = "Steady circles: up to where the law is safe, and why not beyond"
    uses: tuple[str, ...] = ("law", "steering", *ONE_SET)

    def cells(self, settings: LabSettings) -> list[Cell]:
        """One for each friction and steering angle; a turn to the right is its mirror image."""
        return [{"mu": mu, "steering": angle} for mu in settings.frictions for angle in settings.angles]

    def measure(self, cell: Cell, settings: LabSettings) -> list[Row]:
        """Find the speeds of a circle at which something ends, and their closed forms."""
        circle = settings.circle(cell["mu"], cell["steering"])
        found = {name: _first(circle, happens) for name, happens in _EVENTS.items()}
        if "tips over" in found["lifts"][1] and circle.readings:  # from the last speed at which it settled
            found["lifts"] = circle.readings[-1].asked * circle.law, found["lifts"][1]
        law = _law_speed(circle, settings)
        limits = SteadyLimits.of(circle.car, settings.tires.on(cell["mu"]), cell["mu"], cell["steering"])
        forms = {"slides": min(limits.grip, limits.spins), "lifts": limits.lifts, "leaves_arc": limits.leaves_arc}
        row: Row = {
            "mu": cell["mu"], "steering_rad": cell["steering"], "law_mu": circle.mu, "law_speed_m_s": law,
        }  # fmt: skip
        if not settings.tires.slides:
            found["slides"], forms["slides"] = (math.nan, NO_PEAK), math.nan
        for name, (speed, _) in found.items():
            row |= {f"{name}_over_law": _over(speed, law), f"{name}_over_law_closed_form": _over(forms[name], law)}
        row |= {"curvature_at_law": _curvature(circle, law), "curvature_at_law_closed_form": limits.curvature_at(law)}
        known = {name: speed for name, (speed, _) in found.items() if speed < math.inf}
        first = cause = min(known, key=lambda name: known[name], default="")
        if first == "slides" and forms["lifts"] < forms["slides"]:
            cause = "lifts"  # a wheel that carries next to nothing spins, and open differentials then drive none
        holds = not known
        return [
            row
            | {
                "safe": holds or known[first] >= law,
                "ends_by": "" if holds else _CAUSES[cause],
                "up_to_m_s": _HIGH * circle.law if holds else known[first],
                "reason": "; ".join(f"{name}: {why}" for name, (_, why) in found.items() if why),
            }
        ]

    def section(self, rows: list[Row], settings: LabSettings) -> Section:
        """Say on how many circles the law is safe, and what ends them."""
        unsafe = [row for row in rows if not row["safe"]]
        first = [f"The law {settings.law!r} is safe on {share_of(rows, 'safe')} circles."]
        for cause in dict.fromkeys(str(row["ends_by"]) for row in unsafe):
            own = [row for row in unsafe if row["ends_by"] == cause]
            over = style.span(column(own, "up_to_m_s") / column(own, "law_speed_m_s"), ".2f")
            first.append(f"On {len(own)} {cause} ends it at {over} of its speed.")
        key = (
            f"Speeds over the law's at which a tire slides, a wheel lifts, and the path leaves the steered arc by "
            f"{100 * LEAVES:g} %, each beside its closed form; curvature at the law's speed. Never: not up to "
            f"{_HIGH:g} of sqrt(g mu b / tan d)."
        )
        return Section(
            sentences=(" ".join(first), _beside_closed_forms(rows), key, TOLD),
            columns={
                "mu": "mu", "told": "law_mu", "steering": "steering_rad", "law m/s": "law_speed_m_s",
                "slides": "slides_over_law",
                "(form)": "slides_over_law_closed_form", "lifts": "lifts_over_law",
                "(form) ": "lifts_over_law_closed_form", "leaves arc": "leaves_arc_over_law",
                "(form)  ": "leaves_arc_over_law_closed_form", "curvature": "curvature_at_law",
                "(form)   ": "curvature_at_law_closed_form", "safe": "safe", "ends by": "ends_by",
            },
            draw=lambda figure: _draw(figure, rows),
        )  # fmt: skip


class Sets(Skidpad):
    """The skidpad on every bundled set of tires, each at its own friction."""

    name = "sets"
    title = "Every set of tires: how fast a circle ends, and what the path keeps of the steered arc"
    uses = ("law", "steering")

    def cells(self, settings: LabSettings) -> list[Cell]:
        """One for each set and steering angle."""
        return [{"tires": name, "steering": angle} for name in tire_names() for angle in settings.angles]

    def measure(self, cell: Cell, settings: LabSettings) -> list[Row]:
        """Measure a circle on that set."""
        own = replace(settings, entry=replace(settings.entry, tires=cell["tires"]), mus=None)
        rows = super().measure({"mu": own.frictions[0], "steering": cell["steering"]}, own)
        return [{"tires": cell["tires"], **row} for row in rows]

    def section(self, rows: list[Row], settings: LabSettings) -> Section:
        """Put the angles of a set in one row."""
        quantities = ("slides_over_law", "leaves_arc_over_law", "curvature_at_law")
        printed = []
        for name in dict.fromkeys(str(row["tires"]) for row in rows):
            own = [row for row in rows if row["tires"] == name]
            text = {each: ", ".join(_short(number(row, each)) for row in own) for each in quantities}
            printed.append({"tires": name, "mu": own[0]["law_mu"], "safe": share_of(own, "safe"), **text})
        angles = ", ".join(f"{angle:g}" for angle in settings.angles)
        return Section(
            sentences=(f"At steering angles of {angles} rad; speeds over the law's, curvatures over the arc's.",),
            columns={"tires": "tires", "mu": "mu", "a tire slides": quantities[0],
                     "the path leaves the arc by 5 %": quantities[1], "curvature at the law's speed": quantities[2],
                     "safe": "safe"},
            printed=tuple(printed),
            draw=lambda figure: _draw(figure, rows, "tires"),
            height=4.5,
        )  # fmt: skip


EXPERIMENT: Experiment = Skidpad()
SETS: Experiment = Sets()

_EVENTS: dict[str, Callable[[CircleReading], bool]] = {
    "slides": lambda reading: bool(reading.sliding.any()),
    "lifts": lambda reading: reading.lifts,
    "leaves_arc": lambda reading: reading.lost or abs(reading.curvature - 1.0) > LEAVES,
}


def _first(circle: SteadyCircle, happens: Callable[[CircleReading], bool]) -> tuple[float, str]:
    """Return the speed at which something first happens [m/s]; infinite: never; NaN: not known, and why."""
    try:
        before, after = circle.bisect(happens, low=_LOW, high=_HIGH)
    except NeverError:
        return math.inf, ""
    except UnreachableError as error:
        early = circle.readings and happens(circle.readings[0])
        return (_LOW * circle.law if early else math.nan), str(error)
    return 0.5 * (before.asked + after.asked) * circle.law, ""


def _law_speed(circle: SteadyCircle, settings: LabSettings) -> float:
    """Return the speed [m/s] that the law asks for on the circle: where it answers the speed at which it is asked."""
    readings = [reading for reading in circle.readings if not reading.lost]
    speeds = np.array([reading.speed for reading in readings])
    law = np.array([
        settings.speed_law(circle.steering, reading.odometry, circle.car, circle.mu) for reading in readings
    ])  # fmt: skip
    law = np.minimum(law, circle.car.max_speed)
    over = np.flatnonzero(speeds >= law)
    if not len(over) or over[0] == 0:
        return float(law[-1] if not len(over) else law[0])
    at = int(over[0])
    return float(np.interp(0.0, (speeds - law)[at - 1 : at + 1], law[at - 1 : at + 1]))


def _over(speed: float, law: float) -> float:
    return speed / law if law > 0.0 else math.nan


def _curvature(circle: SteadyCircle, speed: float) -> float:
    """Return the curvature at a speed [m/s] over that of the steered arc; NaN: the car does not hold it."""
    if speed <= 0.0:
        return math.nan
    try:
        reading = circle.at(speed / circle.law)
    except UnreachableError:
        return math.nan
    spins = bool(reading.sliding.any()) and reading.curvature > 1.0 + LEAVES
    return math.nan if reading.lost or spins else reading.curvature


def _beside_closed_forms(rows: list[Row]) -> str:
    """Say how far the measured speeds are from their closed forms."""
    parts = []
    for name, words in (("slides", "sliding"), ("lifts", "lifting"), ("leaves_arc", "leaving the arc")):
        ratio = column(rows, f"{name}_over_law") / column(rows, f"{name}_over_law_closed_form")
        known = ratio[np.isfinite(ratio) & (ratio > 0.0)]
        if len(known):
            parts.append(f"{words} {style.span(known, '.2f')}")
    return f"Measured over the closed form: {', '.join(parts)}." if parts else "No limit was reached."


def _short(value: float) -> str:
    return "-" if math.isnan(value) else "never" if math.isinf(value) else f"{value:.2f}"


def _draw(figure: matplotlib.figure.Figure, rows: list[Row], by: str = "mu") -> None:
    left, right = figure.subplots(1, 2)
    left.axhline(1.0, color="0.6", linewidth=0.8)
    names = (("slides_over_law", "slides"), ("leaves_arc_over_law", "leaves the arc"), ("lifts_over_law", "lifts"))
    kinds = list(dict.fromkeys(row[by] for row in rows))
    looks = len(style.COLOURS)
    for index, kind in enumerate(kinds):
        colour, marker = style.COLOURS[index % looks], style.MARKERS[(index + index // looks) % looks]
        own = [row for row in rows if row[by] == kind]
        title = str(kind) if by == "tires" else f"mu {kind:.3g}"
        angles = column(own, "steering_rad")
        for (name, label), filled in zip(names, ("full", "none", "bottom"), strict=True):
            look: dict[str, Any] = {"fillstyle": filled, "marker": marker, "color": colour, "linestyle": "none"}
            values, form = column(own, name), column(own, f"{name}_closed_form")
            shown = np.where(np.isfinite(values), values, np.nan)
            left.plot(angles, shown, label=f"{title}, {label}" if np.isfinite(shown).any() else None, **look)
            left.plot(angles, np.where(form < _HIGH * 1.05, form, np.nan), color=colour, linewidth=0.8)
        right.plot(angles, column(own, "curvature_at_law_closed_form"), color=colour, linewidth=0.8)
        style.measured(right, angles, column(own, "curvature_at_law"), title, colour=colour, marker=marker)
    right.axhline(1.0, color="0.6", linewidth=0.8)
    style.theory(left, [], [], "lines: closed forms")
    style.few_ticks(left, right)
    style.finish(left, "steering angle [rad]", "speed over the law's [-]", legend=False)
    style.finish(right, "steering angle [rad]", "curvature at the law's speed [-]", legend=False)
    figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize="small")
