"""The skidpad: up to which speed a car holds its circle, and what ends it.

Measured, at one steady speed after another, are those at which a tire slides, a wheel leaves the ground, and the path
differs from the steered arc by 5 %, and the curvature that is left at the law's speed; beside each stands that of a
rigid car (`limits`). The law is safe where its speed is below all three.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..errors import ModelError
from ..pictures.pages import figure_kit as style
from ..pictures.pages.figure_kit import column
from ..vehicle.tire_slip import NO_PEAK
from ..vehicle.tires import CONTACT, Tires, tire_names
from ..vehicle.vehicle import Vehicle
from .experiment import ONE_SET, TOLD, Cell, Experiment, LabSettings, Row, Section, number, share_of
from .limits import HIGH, LEAVES, LOW, SteadyLimits
from .steady_circle import CircleReading, NeverError, SteadyCircle, UnreachableError

if TYPE_CHECKING:
    import matplotlib.figure

_CAUSES = {"slides": "grip", "lifts": "load transfer", "leaves_arc": "understeer", "tied": "drive line"}
"""What ends a circle, by the beginning of its columns: a tire slides, a wheel lifts, the path leaves its arc."""
_TIED = math.sqrt(0.5)  # of the speed at which a car with open differentials ends: below, ties have most of the 5 %
_WORDS = {"slides": ("sliding", "o"), "lifts": ("lifting a wheel", "^"), "leaves_arc": ("leaving the arc", "s")}
"""The same in words, with its marker in figures."""
_OF_SETS = {
    "slides_over_law": "a tire slides", "leaves_arc_over_law": "the path leaves the arc by 5 %",
    "curvature_at_law": "curvature at the law's speed",
}  # fmt: skip
_RIGID = "_of_rigid_car"  # how the columns end that stand beside those of what was measured
_UNTIED = "_of_untied_car"  # the same with open differentials: where what ties the wheels of the car has no part


class Skidpad:
    """See the module."""

    name = "skidpad"
    title = "Steady circles: up to where the law is safe, and why not beyond"
    uses: tuple[str, ...] = ("law", "steering", *ONE_SET)

    def cells(self, settings: LabSettings) -> list[Cell]:
        """One for each friction and steering angle; a turn to the right is its mirror image."""
        return [{"mu": mu, "steering": angle} for mu in settings.frictions for angle in settings.angles]

    def measure(self, cell: Cell, settings: LabSettings) -> list[Row]:
        """Find the speeds of a circle at which something ends, and those of a rigid car."""
        circle = settings.circle(cell["mu"], cell["steering"])
        found = {name: first_speed(circle, happens) for name, happens in _EVENTS.items()}
        if "tips over" in found["lifts"][1] and circle.readings:  # from the last speed at which it settled
            found["lifts"] = circle.readings[-1].asked * circle.law, found["lifts"][1]
        law, greatest = law_speed(circle, settings), HIGH * circle.law
        rigid, untied = (
            SteadyLimits.of(circle.ground, circle.mu, circle.steering, untied=each) for each in (False, True)
        )
        row: Row = {
            "mu": cell["mu"], "steering_rad": cell["steering"], "law_mu": circle.mu, "law_speed_m_s": law,
        }  # fmt: skip
        if not settings.tires.slides:
            found["slides"] = math.nan, NO_PEAK
        for name, (speed, _) in found.items():
            row |= {f"{name}_over_law": _over(speed, law), f"{name}_over_law{_RIGID}": _over(getattr(rigid, name), law)}
        row |= {"curvature_at_law": _curvature(circle, law), f"curvature_at_law{_RIGID}": rigid.curvature_at(law)}
        known = {name: speed for name, (speed, _) in found.items() if speed < math.inf}
        holds = not known
        first = cause = min(known, key=lambda name: known[name], default="")
        if first == "slides" and rigid.lifts < rigid.slides:
            cause = "lifts"  # a wheel that carries next to nothing spins, and open differentials then drive none
        elif not holds and known[first] < _TIED * untied.ends:
            cause = "tied"
        return [
            row
            | {
                "safe": holds or known[first] >= law,
                "ends_by": "" if holds else _CAUSES[cause],
                f"ends_over_law{_UNTIED}": _over(untied.ends, law), "looked_at_over_law": _over(greatest, law),
                "up_to_m_s": greatest if holds else known[first],
                "reason": "; ".join(f"{name}: {why}" for name, (_, why) in found.items() if why),
            }
        ]

    def section(self, rows: list[Row], settings: LabSettings) -> Section:
        """Say on how many circles the law is safe, and what ends them."""
        unsafe = [row for row in rows if not row["safe"]]
        first = [f"The law {settings.law!r} is safe on {share_of(rows, 'safe')} circles{_holding(rows)}."]
        for cause in dict.fromkeys(str(row["ends_by"]) for row in unsafe):
            own = [row for row in unsafe if row["ends_by"] == cause]
            over = style.span(column(own, "up_to_m_s") / column(own, "law_speed_m_s"), ".2f")
            first.append(f"On {len(own)} it ends at {over} of its speed: {cause}.")
        key = (
            f"Speeds over the law's at which a tire slides, a wheel lifts, and the path leaves the steered arc by "
            f"{100 * LEAVES:g} %, each beside that of a rigid car; curvature at the law's speed. Never: not up to "
            f"{HIGH:g} of sqrt(g mu b / tan d)."
        )
        told = f"Open: a rigid car with open differentials. {TOLD}"
        return Section(
            sentences=(" ".join(first), _beside_rigid_car(rows), key, told),
            columns={
                "mu": "mu", "told": "law_mu", "steering": "steering_rad", "law m/s": "law_speed_m_s",
                "slides": "slides_over_law",
                "(rigid)": f"slides_over_law{_RIGID}", "lifts": "lifts_over_law",
                "(rigid) ": f"lifts_over_law{_RIGID}", "leaves arc": "leaves_arc_over_law",
                "(rigid)  ": f"leaves_arc_over_law{_RIGID}", "curvature": "curvature_at_law",
                "(rigid)   ": f"curvature_at_law{_RIGID}", "safe": "safe", "ends by": "ends_by",
                "(open)": f"ends_over_law{_UNTIED}",
            },
            draw=lambda figure: _draw(figure, rows),
        )  # fmt: skip


class Sets(Skidpad):
    """The skidpad on every bundled set of tires, each at its own friction."""

    name = "sets"
    title = "Every set of tires: how fast a circle ends, and what the path keeps of the steered arc"
    uses = ("law", "steering")

    def cells(self, settings: LabSettings) -> list[Cell]:
        """One for each set and steering angle, without `contact` on a car that cannot stand on it."""
        names = [name for name in tire_names() if name != CONTACT or _takes_contact(settings.entry.car)]
        return [{"tires": name, "steering": angle} for name in names for angle in settings.angles]

    def measure(self, cell: Cell, settings: LabSettings) -> list[Row]:
        """Measure a circle on that set."""
        own = replace(settings, entry=replace(settings.entry, tires=cell["tires"]), mus=None)
        rows = super().measure({"mu": own.frictions[0], "steering": cell["steering"]}, own)
        return [{"tires": cell["tires"], **row} for row in rows]

    def section(self, rows: list[Row], settings: LabSettings) -> Section:
        """Put the angles of a set in one row."""
        printed = []
        for name in dict.fromkeys(str(row["tires"]) for row in rows):
            own = [row for row in rows if row["tires"] == name]
            text = {each: ", ".join(_short(number(row, each)) for row in own) for each in _OF_SETS}
            printed.append({"tires": name, "mu": own[0]["law_mu"], "safe": share_of(own, "safe"), **text})
        angles = ", ".join(f"{angle:g}" for angle in settings.angles)
        return Section(
            sentences=(f"At steering angles of {angles} rad; speeds over the law's, curvatures over the arc's.",),
            columns={"tires": "tires", "mu": "mu", **{words: name for name, words in _OF_SETS.items()}, "safe": "safe"},
            printed=tuple(printed),
            draw=lambda figure: _draw_sets(figure, rows),
            height=1.2 + 0.25 * len(printed),
        )  # fmt: skip


EXPERIMENT: Experiment = Skidpad()
SETS: Experiment = Sets()

_EVENTS: dict[str, Callable[[CircleReading], bool]] = {
    "slides": lambda reading: bool(reading.sliding.any()),
    "lifts": lambda reading: reading.lifts,
    "leaves_arc": lambda reading: reading.lost or abs(reading.curvature - 1.0) > LEAVES,
}


def _takes_contact(vehicle: Vehicle) -> bool:
    """Return whether a vehicle can stand on MuJoCo's own contacts."""
    try:
        vehicle.spec(tires=Tires.load(CONTACT))
    except ModelError:
        return False
    return True


def first_speed(
    circle: SteadyCircle, happens: Callable[[CircleReading], bool], low: float = LOW
) -> tuple[float, str]:
    """Return the speed at which something first happens [m/s]; infinite: never; NaN: not known, and why."""
    try:
        before, after = circle.bisect(happens, low=low, high=HIGH)
    except NeverError:
        return math.inf, ""
    except UnreachableError as error:
        early = circle.readings and happens(circle.readings[0])
        return (low * circle.law if early else math.nan), str(error)
    return 0.5 * (before.asked + after.asked) * circle.law, ""


def law_speed(circle: SteadyCircle, settings: LabSettings) -> float:
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


def _holding(rows: list[Row]) -> str:
    """Say up to which share of the law's speed the tires of all circles hold."""
    held = np.minimum(column(rows, "slides_over_law"), column(rows, "looked_at_over_law"))  # NaN stays
    return "" if np.isnan(held).all() else f", and no tire slides up to {np.nanmin(held):.2f} of its speed"


def _beside_rigid_car(rows: list[Row]) -> str:
    """Say how far the measured speeds are from those of a rigid car."""
    parts = []
    for name, (words, _) in _WORDS.items():
        measured, rigid = column(rows, f"{name}_over_law"), column(rows, f"{name}_over_law{_RIGID}")
        both = np.isfinite(measured) & np.isfinite(rigid)
        if both.any():
            parts.append(f"{words} {style.span(measured[both] / rigid[both], '.2f')}")
    return f"Measured over that of a rigid car: {', '.join(parts)}." if parts else "No limit was reached."


def _short(value: float) -> str:
    return "-" if math.isnan(value) else "never" if math.isinf(value) else f"{value:.2f}"


def _draw(figure: matplotlib.figure.Figure, rows: list[Row]) -> None:
    left, right = figure.subplots(1, 2)
    for index, mu in enumerate(dict.fromkeys(number(row, "mu") for row in rows)):
        own = [row for row in rows if number(row, "mu") == mu]
        angles, colour = column(own, "steering_rad"), style.COLOURS[index % len(style.COLOURS)]
        shown = [(left, f"{name}_over_law", marker) for name, (_, marker) in _WORDS.items()]
        for axes, name, marker in (*shown, (right, "curvature_at_law", "D")):
            style.theory(axes, angles, column(own, name + _RIGID), colour=colour)
            style.measured(axes, angles, column(own, name), colour=colour, marker=marker)
        style.measured(left, [], [], f"mu {mu:.3g}", colour=colour, marker="D")
    for words, marker in _WORDS.values():
        style.measured(left, [], [], words, colour="0.25", marker=marker)
    style.theory(left, [], [], "lines: a rigid car")
    for axes, label in ((left, "speed over the law's [-]"), (right, "curvature at the law's speed [-]")):
        axes.axhline(1.0, color="0.6", linewidth=0.8)
        style.finish(axes, "steering angle [rad]", label, legend=False)
    style.few_ticks(left, right)
    figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize="small")


def _draw_sets(figure: matplotlib.figure.Figure, rows: list[Row]) -> None:
    """Draw a line for each set, and on it a point for each steering angle; what never happens is at the right end."""
    panels, names = figure.subplots(1, 3, sharey=True), list(dict.fromkeys(str(row["tires"]) for row in rows))
    for index, angle in enumerate(dict.fromkeys(number(row, "steering_rad") for row in rows)):
        own = [row for row in rows if number(row, "steering_rad") == angle]
        at, colour = [names.index(str(row["tires"])) for row in own], style.COLOURS[index % len(style.COLOURS)]
        for axes, name in zip(panels, _OF_SETS, strict=True):
            values = np.minimum(column(own, name), HIGH)  # NaN stays
            style.measured(axes, values, at, f"{angle:g} rad", colour=colour, fillstyle="none", clip_on=False)
    label = f"speed over the law's, looked at up to {HIGH:g} [-]"
    for axes, (name, title) in zip(panels, _OF_SETS.items(), strict=True):
        axes.axvline(1.0, color="0.6", linewidth=0.8)
        axes.set(yticks=range(len(names)), yticklabels=names, ylim=(len(names) - 0.5, -0.5), xlim=(0.0, HIGH))
        axes.set_title(title, fontsize="medium")
        style.finish(axes, "[-]" if name.startswith("curvature") else label, "", legend=False)
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=6, fontsize="small")
