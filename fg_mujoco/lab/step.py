"""Steering steps: what a law that holds on steady circles leaves to the moment of turning in.

A car comes straight ahead, and is steered to an angle as fast as its servo turns. Two speeds are found by bisection:
`turn_in`, where the set point stays and a tire slides, as turning the car takes lateral force besides the circle's; and
`approach`, where the law slows the car from then on, too late by the way of the servo, which is faster than the car.
Beside them stands the speed at which a tire slides on the steady circle of the same angle, of a rigid car (`limits`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from ..messages import DriveCommand, Odometry
from ..pictures.pages import figure_kit as style
from ..pictures.pages.figure_kit import column
from ..vehicle.tire_slip import NO_PEAK
from .experiment import ONE_SET, TOLD, Cell, Experiment, LabSettings, Row, Section, number
from .lab_ground import LabGround
from .limits import SteadyLimits

if TYPE_CHECKING:
    import matplotlib.figure

_STRAIGHT, _TURNING = 0.3, 1.2  # [s] ahead at first, and steered
_LOW, _HIGH = 0.2, 3.0  # of the law's speed: what is looked at
_WIDTH = 0.005  # of it: to which a speed is found

_Law: TypeAlias = Callable[[Odometry], float] | None


class Step:
    """See the module."""

    name = "step"
    title = "Steering steps: turning in, and a law that slows the car when it steers"
    uses = ("law", "steering", *ONE_SET)

    def cells(self, settings: LabSettings) -> list[Cell]:
        """One for each friction and steering angle."""
        return [{"mu": mu, "steering": angle} for mu in settings.frictions for angle in settings.angles]

    def measure(self, cell: Cell, settings: LabSettings) -> list[Row]:
        """Find both speeds, and that of the steady circle."""
        mu, steering = cell["mu"], cell["steering"]
        ground, told = settings.ground(mu), settings.told(mu)
        car = ground.car.parameters

        def law(odometry: Odometry) -> float:
            return min(settings.speed_law(steering, odometry, car, told), car.max_speed)

        ground.place(0.0)
        speed = law(ground.car.odometry(ground.data))
        row: Row = {"mu": mu, "steering_rad": steering, "law_mu": told, "law_speed_m_s": speed}
        reason = "" if settings.tires.slides else NO_PEAK
        for name, slowed in (("turn_in", None), ("approach", law)):
            value = math.nan if reason or not speed > 0.0 else _first_slide(ground, steering, speed, slowed)
            row |= {f"{name}_over_law": value}
        steady = SteadyLimits.of(ground, told, steering).slides
        row |= {"circle_over_law_of_rigid_car": steady / speed if speed > 0.0 else math.nan}
        return [row | {"safe": not number(row, "turn_in_over_law") < 1.0, "reason": reason}]

    def section(self, rows: list[Row], settings: LabSettings) -> Section:
        """Say at which shares of the law's speed a step slides."""
        known = style.span(column(rows, "turn_in_over_law"), ".2f")
        first = f"A step slides a tire from {known} of the law's speed on."
        if not np.isfinite(column(rows, "turn_in_over_law")).any():
            first = f"No step slides a tire up to {_HIGH:g} of the law's speed." if settings.tires.slides else NO_PEAK
        second = (
            f"With the law {settings.law!r} in command, a car that comes straight ahead slides from "
            f"{style.span(column(rows, 'approach_over_law'), '.2f')} of the law's speed on."
        )
        return Section(
            sentences=(first, second, TOLD),
            columns={
                "mu": "mu", "told": "law_mu", "steering": "steering_rad", "law m/s": "law_speed_m_s",
                "turn in at": "turn_in_over_law", "approach at": "approach_over_law",
                "steady circle (rigid)": "circle_over_law_of_rigid_car", "safe": "safe",
            },
            draw=lambda figure: _draw(figure, rows),
        )  # fmt: skip


EXPERIMENT: Experiment = Step()


def _first_slide(ground: LabGround, steering: float, law_speed: float, law: _Law) -> float:
    """Return the speed over the law's from which on a step slides a tire; infinite: not up to what is looked at."""
    top = min(_HIGH, ground.car.parameters.max_speed / law_speed)
    if not _slides(ground, steering, top * law_speed, law):
        return math.inf
    low, high = 0.0, top
    while high - low > _WIDTH:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if _slides(ground, steering, middle * law_speed, law) else (middle, high)
    return 0.5 * (low + high)


def _slides(ground: LabGround, steering: float, speed: float, law: _Law) -> bool:
    """Return whether a tire slides in a step at a speed [m/s], which a law limits from then on."""
    ground.place(speed)
    ground.drive(lambda odometry: DriveCommand(steering_angle=0.0, speed=speed), _STRAIGHT)

    def driver(odometry: Odometry) -> DriveCommand:
        return DriveCommand(steering_angle=steering, speed=speed if law is None else min(speed, law(odometry)))

    return bool(ground.drive(driver, _TURNING).slip.slides.any())


def _draw(figure: matplotlib.figure.Figure, rows: list[Row]) -> None:
    titles = {"turn_in": "speed kept", "approach": "slowed by the law"}
    for axes, (name, title) in zip(figure.subplots(1, 2, sharey=True), titles.items(), strict=True):
        axes.axhline(1.0, color="0.6", linewidth=0.8)
        for index, mu in enumerate(dict.fromkeys(number(row, "mu") for row in rows)):
            own = [row for row in rows if number(row, "mu") == mu]
            colour, angles = style.COLOURS[index % len(style.COLOURS)], column(own, "steering_rad")
            circle = column(own, "circle_over_law_of_rigid_car")
            style.theory(axes, angles, np.where(np.isfinite(circle), circle, np.nan), colour=colour)
            style.measured(axes, angles, column(own, f"{name}_over_law"), f"mu {mu:.3g}", colour=colour)
        style.theory(axes, [], [], "lines: the steady circle of a rigid car")
        style.few_ticks(axes)
        axes.set_title(title, fontsize="medium")
        label = "speed over the law's at which a tire slides [-]" if name == "turn_in" else ""
        style.finish(axes, "steering angle [rad]", label, legend=name == "turn_in")
