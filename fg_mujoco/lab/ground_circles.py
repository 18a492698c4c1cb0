"""Circles on ground that is not level: up to where a law of the plane is safe on banks, crests and rough roads.

The car is steered to stay on the circle of a steering angle, of radius r about the origin. By the balance of a rigid
car, whose tires together push with mu times their load at most, it is as fast as (`closed_form`):

- on a cone, whose outside is higher by b: mu N cos b + N sin b = m v^2 / r and N cos b - mu N sin b = m g, so
  v^2 = g r (mu + tan b) / (1 - mu tan b);
- on top of a crest of radius R along the path: N = m (g - v^2 / R), so v^2 = mu g / (1 / r + mu / R); a sag has - R;
- on a rough road there is none: what the load of an axle falls below for 1 % of the time is put beside it.

Measured are the speeds at which a tire slides, and from which the car is off its circle by 5 % of the radius. It comes
out of a crest before it is off, and so may be faster there.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..course.ground import ROUGHNESS, Ground, Relief, rough_heights
from ..errors import SettingsError
from ..messages import DriveCommand
from ..pictures.pages import figure_kit as style
from ..pictures.pages.figure_kit import column
from ..vehicle.tire_slip import NO_PEAK
from .experiment import ONE_SET, TOLD, Cell, Experiment, LabSettings, Row, Section, number
from .lab_ground import Trace
from .limits import LEAVES
from .skidpad import first_speed, law_speed
from .steady_circle import PERIOD, CircleReading, SteadyCircle, UnreachableError

if TYPE_CHECKING:
    import matplotlib.figure

GROUNDS = (*(("bank", each) for each in (-10, -5, 0, 5, 10, 15, 20)), ("crest", 16), ("crest", 8), ("crest", -16),
            ("crest", -8), *(("roughness", each) for each in ROUGHNESS if each))  # fmt: skip
"""What is driven on: a bank [deg], a crest by its radius [m], of a sag negative, a class of roughness."""

_STEERINGS = (0.1,)  # [rad] unless a setting names others
_LOW, _LOADED = 0.3, 0.6  # of sqrt(g mu r): what is looked at from, and at what loads are compared
_BESIDE, _CELL, _WAVE = 2.0, 0.05, 5.0  # [m] of ground outside the circle; between heights; of a crest and a sag
_BANDWIDTH, _NEAREST = 4.0, 1.5  # [rad/s], [1/m] of the steering: soft tires take some tenths of a second
_RARE = 0.01  # of the time
_NUMBERS = (
    "law_speed_m_s", "closed_form_over_law", "slides_over_law", "leaves_over_law", "law_over_slides",
    "load_over_closed_form", "load_variation", "rare_load_root",
)  # fmt: skip
_HEADS = (
    "ground", "mu", "steering", "law m/s", "closed form", "slides", "leaves", "law over slides", "load", "varies",
    "root",
)  # fmt: skip


class Lap(NamedTuple):
    """What is kept of a lap on the circle."""

    off: float  # [-] greatest distance from the circle over its radius
    least: float  # [-] load of all wheels over the weight
    most: float
    variation: float  # [-] of the load of an axle: standard deviation over the mean, of the one with more
    rare: float  # [-] load of an axle over its mean, below which it is for 1 % of the time, likewise


class GroundCircle(SteadyCircle):
    """A car that is steered along a circle about the origin; a reading is of a lap, and `laps` has more of it, by k."""

    def __init__(self, mu: float, steering: float, settings: LabSettings, kind: str, value: float | str) -> None:
        entry = settings.entry
        self.radius = entry.car.parameters.wheelbase / math.tan(abs(steering))
        surface = surface_of(kind, value, self.radius)
        super().__init__(mu, abs(steering), None, settings.tires, entry.car, entry.changes, surface)
        self.laps: dict[float, Lap] = {}
        self._offsets: list[float] = []

    def _place(self, speed: float) -> None:
        self.ground.place(speed, -self.radius)

    def _window(self, speed: float) -> float:
        return PERIOD * math.ceil(2.0 * math.pi * self.radius / speed / PERIOD)

    def _drive(self, command: float) -> DriveCommand:
        """Turn the steering on by what is missing to the place, the course and the curvature of the circle."""
        data, lock = self.ground.data, self.car.max_steering_angle
        (x, y), (vx, vy), speed = data.qpos[:2], data.qvel[:2], max(math.hypot(*data.qvel[:2]), 0.1)
        odometry = self.ground.car.odometry(data)
        off, pole = math.hypot(x, y) - self.radius, min(_NEAREST, _BANDWIDTH / speed)
        self._offsets.append(abs(off) / self.radius)
        aside = math.cos(math.atan2(y, x) - math.atan2(vy, vx))
        rate = pole**3 * off + 6.0 * pole**2 * aside + 6.0 * pole * (1.0 / self.radius - odometry.yaw_rate / speed)
        angle = odometry.steering_angle + PERIOD * speed * self.car.wheelbase * rate
        return DriveCommand(steering_angle=max(-lock, min(lock, angle)), speed=command)

    def _read(self, whole: Trace, k: float) -> CircleReading:
        window = self._window(k * self.law)
        loads = np.nan_to_num(whole.last(window).slip.normal_force)
        axles, weight = loads.reshape(-1, 2, 2).sum(axis=2), self.car.mass * self.car.gravity
        mean, together = axles.mean(axis=0), loads.sum(axis=1) / weight
        self.laps[k] = Lap(
            off=max(self._offsets[-round(window / PERIOD) :]), least=float(together.min()), most=float(together.max()),
            variation=float((axles.std(axis=0) / mean).max()),
            rare=float((np.quantile(axles, _RARE, axis=0) / mean).min()),
        )  # fmt: skip
        return super()._read(whole, k)


def surface_of(kind: str, value: float | str, radius: float) -> Ground:
    """Return a ground about a circle of a radius [m]: what `GROUNDS` says it is."""
    nodes = np.arange(-radius - _BESIDE, radius + _BESIDE + _CELL, _CELL)
    x, y = np.meshgrid(nodes, nodes)
    if kind == "roughness":
        places = np.column_stack((x.ravel(), y.ravel()))
        heights = rough_heights(places, Relief(roughness=str(value))).reshape(x.shape)
    elif kind == "crest":
        waves = max(round(2.0 * math.pi * radius / _WAVE), 1)
        inside = np.minimum(np.hypot(x, y) / (0.5 * radius), 1.0)  # where all waves meet
        heights = inside * radius**2 / (waves**2 * float(value)) * np.cos(waves * np.arctan2(x, -y))
    else:
        heights = math.tan(math.radians(float(value))) * (np.hypot(x, y) - radius)
    return Ground(heights=heights, corner=(float(nodes[0]), float(nodes[0])), cell=_CELL)


def closed_form(kind: str, value: float | str, mu: float, radius: float) -> float:
    """Return the greatest speed over sqrt(g mu r) [-], see the module; infinite: none; NaN: not known."""
    if kind == "roughness":
        return math.nan
    slope = math.tan(math.radians(float(value))) if kind == "bank" else 0.0
    left = 1.0 - mu * slope if kind == "bank" else 1.0 + mu * radius / float(value)
    return math.sqrt((1.0 + slope / mu) / left) if left > 0.0 else math.inf


def load_factor(kind: str, value: float | str, pull: float, radius: float) -> float:
    """Return the load over the weight [-] by the same, at v^2 / g r = `pull`: on a bank, on top of a crest."""
    if kind == "bank":
        return math.cos(math.radians(float(value))) + pull * math.sin(math.radians(float(value)))
    return math.nan if kind == "roughness" else 1.0 - pull * radius / float(value)


class GroundCircles:
    """See the module."""

    name = "ground"
    title = "Banks, crests and rough roads: where a law of the plane is unsafe, and by how much"
    uses: tuple[str, ...] = ("law", "steering", *ONE_SET)

    def cells(self, settings: LabSettings) -> list[Cell]:
        """One for each friction, steering angle and ground; a turn to the right is its mirror image."""
        angles = settings.steerings or _STEERINGS
        return [
            {"mu": mu, "steering": angle, "ground": kind, "value": value}
            for mu in settings.frictions for angle in angles for kind, value in GROUNDS
        ]  # fmt: skip

    def measure(self, cell: Cell, settings: LabSettings) -> list[Row]:
        """Find the speeds at which a tire slides and the car leaves its circle, and the loads before."""
        kind, value = cell["ground"], cell["value"]
        sag = kind == "crest" and value < 0
        row: Row = {
            "mu": cell["mu"], "steering_rad": cell["steering"], "ground": f"sag {-value}" if sag else f"{kind} {value}",
            "kind": kind, "bank_deg": value if kind == "bank" else math.nan, "safe": False,
        }  # fmt: skip
        try:
            circle = GroundCircle(settings.told(cell["mu"]), cell["steering"], settings, kind, value)
            before = circle.at(_LOADED)
        except (SettingsError, UnreachableError) as error:  # tires that cannot stand there, or cannot stay
            return [row | dict.fromkeys(_NUMBERS, math.nan) | {"reason": str(error)}]
        lap, pull = circle.laps[before.asked], circle.mu * before.k**2
        never = (math.nan, "the crests beside it end the circle")
        found = {
            name: never if sag else first_speed(circle, happens, _LOW)
            for name, happens in {
                "slides": lambda reading: bool(reading.sliding.any()),
                "leaves": lambda reading: reading.lost or circle.laps[reading.asked].off > LEAVES,
            }.items()
        }
        if not settings.tires.slides:
            found["slides"] = math.nan, NO_PEAK
        law, form = law_speed(circle, settings), closed_form(kind, value, circle.mu, circle.radius)
        load = (lap.most if sag else lap.least) / load_factor(kind, value, pull, circle.radius)
        speeds = [form * circle.law, *(speed for speed, _ in found.values())]
        over = [speed / law for speed in speeds]
        numbers = (law, *over, law / speeds[1], load, lap.variation, math.sqrt(max(lap.rare, 0.0)))
        reason = "; ".join(f"{name}: {why}" for name, (_, why) in found.items() if why)
        row |= dict(zip(_NUMBERS, numbers, strict=True))
        return [row | {"safe": not any(speed < 1.0 for speed in over[1:]), "reason": reason}]

    def section(self, rows: list[Row], settings: LabSettings) -> Section:
        """Say how far the law is unsafe, and how near the closed forms are."""
        over = column(rows, "leaves_over_law") / column(rows, "closed_form_over_law")
        steady = np.array([row["kind"] == "bank" for row in rows])
        first = (
            f"On banks the car leaves its circle at {style.span(over[steady], '.2f')} of the closed form's speed, on "
            f"all of the grounds at {style.span(column(rows, 'leaves_over_law'), '.2f')} of the law's."
        )
        if np.isnan(column(rows, "law_speed_m_s")).all():
            first = f"Nothing was driven: {rows[0]['reason']}."
        key = (
            "Banks [deg], radii of crests and sags [m]. Speeds over the law's: of the closed form, at which a tire "
            f"slides, and from which the car is off its circle by {100 * LEAVES:g} % of the radius."
        )
        loads = (
            f"Load: at {_LOADED:g} of sqrt(g mu r), over the closed form's. Varies: an axle's load, standard deviation "
            "over mean; root: of what it is below for 1 % of the time."
        )
        return Section(
            sentences=(first, key, loads, TOLD),
            columns=dict(zip(_HEADS, ("ground", "mu", "steering_rad", *_NUMBERS), strict=True)),
            draw=lambda figure: _draw(figure, rows),
        )


EXPERIMENT: Experiment = GroundCircles()


def _draw(figure: matplotlib.figure.Figure, rows: list[Row]) -> None:
    left, right = figure.subplots(1, 2, sharey=True)
    others = list(dict.fromkeys(str(row["ground"]) for row in rows if row["kind"] != "bank"))
    circles = list(dict.fromkeys((number(row, "mu"), number(row, "steering_rad")) for row in rows))
    for index, (mu, angle) in enumerate(circles):
        colour = style.COLOURS[index % len(style.COLOURS)]
        own = [row for row in rows if (row["mu"], row["steering_rad"]) == (mu, angle)]
        banks = sorted((row for row in own if row["kind"] == "bank"), key=lambda row: number(row, "bank_deg"))
        rest = [row for row in own if row["kind"] != "bank"]
        degrees, at = column(banks, "bank_deg"), np.array([others.index(str(row["ground"])) for row in rest])
        style.theory(left, degrees, column(banks, "closed_form_over_law"), colour=colour)
        for axes, place, chosen in ((left, degrees, banks), (right, at, rest)):
            label = f"mu {mu:.3g}, {angle:g} rad" if axes is left else ""
            style.measured(axes, place, column(chosen, "leaves_over_law"), label, colour=colour, marker="s")
            style.measured(axes, place, column(chosen, "slides_over_law"), colour=colour, fillstyle="none")
        for place, row in zip(at.tolist(), rest, strict=True):
            form = np.full(2, number(row, "closed_form_over_law"))
            style.theory(right, np.array([place - 0.3, place + 0.3]), form, colour=colour)
    style.theory(left, [], [], "lines: the closed form")
    style.measured(left, [], [], "a tire slides", colour="0.25", fillstyle="none")
    style.measured(left, [], [], "leaves the circle", colour="0.25", marker="s")
    for axes, label in ((left, "bank [deg]"), (right, "")):
        axes.axhline(1.0, color="0.6", linewidth=0.8)
        style.finish(axes, label, "speed over the law's [-]" if axes is left else "", legend=axes is left)
    right.set_xticks(range(len(others)), others, rotation=45, ha="right")
