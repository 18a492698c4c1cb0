"""Stops, straight ahead and on a circle at half of the grip: by the motor alone, and with the friction limiter."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from fg_mujoco.controllers.safety.friction_limiter import FrictionLimiter

from ..messages import DriveCommand, Odometry
from ..pictures.pages import figure_kit as style
from ..pictures.pages.figure_kit import column
from .experiment import ONE_SET, Cell, Experiment, LabSettings, Row, Section, number
from .lab_ground import TICK, LabGround
from .limits import stopping_distance
from .steady_circle import UnreachableError

if TYPE_CHECKING:
    import matplotlib.figure

_SPEEDS = (2.0, 4.0, 6.0, 8.0)  # [m/s] that stops straight ahead begin at
_GRIP = 0.5  # of the lateral grip: what cornering takes when a stop on a circle begins
_STANDING = 0.05  # [m/s]
_LONGEST = 20.0  # [s]
_ASIDE = math.radians(45.0)  # farther than this from its heading, a car's rear axle has spun
_HOWS = ("motor", "limiter")


class Braking:
    """See the module."""

    name = "braking"
    title = "Stops straight ahead, and on a circle at half of the grip"
    uses = ("steering", *ONE_SET)

    def cells(self, settings: LabSettings) -> list[Cell]:
        """One for each friction and speed straight ahead, and for each friction and steering angle."""
        fastest = settings.entry.car.parameters.max_speed
        straight: list[Cell] = [{"steering": 0.0, "speed": speed} for speed in _SPEEDS if speed <= fastest]
        circles: list[Cell] = [{"steering": angle, "speed": None} for angle in settings.angles]
        return [{"mu": mu, **cell} for mu in settings.frictions for cell in (*straight, *circles)]

    def measure(self, cell: Cell, settings: LabSettings) -> list[Row]:
        """Stop in both ways."""
        return [self._stop(cell, settings, how) for how in _HOWS]

    def section(self, rows: list[Row], settings: LabSettings) -> Section:
        """Say how long the stops are, and whether wheels ran backwards or the car spun."""
        straight = [row for row in rows if row["steering_rad"] == 0.0]
        sentences = []
        for how in _HOWS:
            own, every = [[row for row in each if row["how"] == how] for each in (straight, rows)]
            spun = sum(bool(row["spun"]) for row in every)
            back = -float(np.nanmin(column(every, "least_wheel_speed_m_s")))
            turned = f"a wheel turns backwards by {back:.2f} m/s" if back > _STANDING else "no wheel turns backwards"
            sentences.append(
                f"By {how} a stop straight ahead takes {style.span(column(own, 'over_closed_form'), '.2f')} of "
                f"v²/(2 mu g); {spun} of {len(every)} stops spin the car, and {turned}."
            )
        return Section(
            sentences=tuple(sentences),
            columns={
                "mu": "mu", "steering": "steering_rad", "from m/s": "speed_m_s", "by": "how", "way m": "distance_m",
                "v²/(2 mu g)": "closed_form_m", "ratio": "over_closed_form", "least wheel m/s": "least_wheel_speed_m_s",
                "slid s": "sliding_s", "spun": "spun",
            },
            draw=lambda figure: _draw(figure, rows),
        )  # fmt: skip

    def _stop(self, cell: Cell, settings: LabSettings, how: str) -> Row:
        mu, steering, row = cell["mu"], cell["steering"], {"mu": cell["mu"], "steering_rad": cell["steering"]}
        told, reason = settings.told(mu), ""
        if steering:
            circle = settings.circle(mu, steering)
            ground = circle.ground
            try:
                circle.at(math.sqrt(_GRIP))
            except UnreachableError as error:
                reason = f"the circle: {error}"
        else:
            ground = settings.ground(mu)
            ground.place(cell["speed"])
        numbers = ("speed_m_s", "distance_m", "closed_form_m", "over_closed_form", "least_wheel_speed_m_s", "sliding_s")
        if reason:
            return row | {"how": how, **dict.fromkeys(numbers, math.nan), "spun": False, "reason": reason}
        begun = ground.car.odometry(ground.data)
        trace = ground.drive(_driver(ground, told, how, steering), _LONGEST, until=lambda o: _stands(ground))
        aside = np.arctan2(trace.velocity[:, 1], trace.velocity[:, 0]) - trace.heading
        spun = bool((np.cos(aside[trace.speed > 0.5]) < math.cos(_ASIDE)).any())
        way = float(trace.speed.sum()) * trace.timestep
        form = stopping_distance(begun.speed, told, ground.car.parameters)
        values = (begun.speed, way, form, way / form, float(trace.wheel_speeds.min()))
        slid = float(trace.slip.slides.any(axis=1).sum()) * trace.timestep if settings.tires.slides else math.nan
        return row | {"how": how, **dict(zip(numbers, (*values, slid), strict=True)), "spun": spun, "reason": ""}


EXPERIMENT: Experiment = Braking()


def _driver(ground: LabGround, mu: float, how: str, steering: float):  # type: ignore[no-untyped-def]
    """Return what decides in a stop."""
    limiter = FrictionLimiter(ground.car.parameters, mu)

    def drive(odometry: Odometry) -> DriveCommand:
        if how == "limiter":
            held: DriveCommand = limiter(steering, 0.0, odometry, TICK)
            return held
        return DriveCommand(steering_angle=steering, speed=0.0)

    return drive


def _stands(ground: LabGround) -> bool:
    return abs(ground.car.ground_speed(ground.data)) < _STANDING


def _draw(figure: matplotlib.figure.Figure, rows: list[Row]) -> None:
    left, right = figure.subplots(1, 2, sharey=True)
    for axes, name, label in ((left, "speed_m_s", "speed [m/s]"), (right, "steering_rad", "steering angle [rad]")):
        axes.axhline(1.0, color="0.6", linewidth=0.8)
        own = [row for row in rows if (row["steering_rad"] == 0.0) == (axes is left)]
        for index, mu in enumerate(dict.fromkeys(number(row, "mu") for row in rows)):
            for how, filled in zip(_HOWS, ("none", "full"), strict=True):
                found = [row for row in own if row["how"] == how and row["mu"] == mu]
                style.measured(
                    axes, column(found, name), column(found, "over_closed_form"), f"{how}, mu {mu:.3g}",
                    colour=style.COLOURS[index % len(style.COLOURS)], fillstyle=filled,
                )  # fmt: skip
        style.few_ticks(axes)
        axes.set_title("straight ahead" if axes is left else "on a circle", fontsize="medium")
        style.finish(axes, label, "way over v²/(2 mu g) [-]" if axes is left else "", legend=axes is left)
