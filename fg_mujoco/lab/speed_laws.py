"""Speed laws: plain functions from a steering angle to the greatest speed, the user's own among them.

    def law(steering_angle, odometry, car, mu):
        return math.sqrt(9.81 * mu * car.wheelbase / max(math.tan(abs(steering_angle)), 1e-9))

    law = load_law("my_law.py:law")  # or a name: friction, field, limiter
    law(0.1, odometry, car, 0.7)     # [m/s]; infinite: no limit

A law gets the steering angle [rad], an Odometry, CarParameters and the friction coefficient that it is to assume.
Other packages register theirs as entry points of the group `fg_mujoco.speed_laws`.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache
from numbers import Real
from pathlib import Path
from typing import Any, TypeAlias

from fg_mujoco.controllers.control.speed import friction_speed
from fg_mujoco.controllers.safety.friction_limiter import FrictionLimiter, held_on_circle

from ..course.files import file_sha256, kept_folder
from ..errors import SettingsError, is_of_planner
from ..messages import CarParameters, Odometry, shown
from ..racing.planners import import_file
from ..registry import Registry
from ..simulation.planner_failure import error_text, one_line

Law: TypeAlias = Callable[[float, Odometry, CarParameters, float], float]

ACCEPTED = "a function law(steering_angle, odometry, car, mu) that returns a speed [m/s]"
_ANSWERS = "one number from 0 on [m/s]; inf: no limit"


def friction(steering_angle: float, odometry: Odometry, car: CarParameters, mu: float) -> float:
    """Return sqrt(g mu b / tan|d|): of a kinematic car, whose tires have the friction of a point on its circle."""
    speed: float = friction_speed(steering_angle, mu, car.wheelbase, car.gravity)
    return speed


def field_steps(steering_angle: float, odometry: Odometry, car: CarParameters, mu: float) -> float:
    """Return 1.5, 1.0 or 0.5 m/s: up to 10 degrees, up to 20, and beyond.

    Source: the F1TENTH course, lab 3, "Wall Following" (README.md of github.com/f1tenth/f1tenth_lab3_template).
    """
    degrees = math.degrees(abs(steering_angle))
    return 1.5 if degrees <= 10.0 else 1.0 if degrees <= 20.0 else 0.5


def limiter(steering_angle: float, odometry: Odometry, car: CarParameters, mu: float) -> float:
    """Return the speed that the planners' friction limiter leaves on a steady circle."""
    _, speed = held_on_circle(_limiter(car, mu).record[0], steering_angle, car.max_speed, 0.0, 1.0)
    return float(speed)


@lru_cache(maxsize=64)
def _limiter(car: CarParameters, mu: float) -> FrictionLimiter:
    return FrictionLimiter(car, mu)


DEFAULT_LAW = "friction"

LAWS: Registry[Law] = Registry(
    "speed law", SettingsError, "fg_mujoco.speed_laws",
    {DEFAULT_LAW: friction, "field": field_steps, "limiter": limiter},
)  # fmt: skip
"""Speed laws by name: the law of kinematics, the steps of the field's course, and that of our friction limiter."""


@dataclass(frozen=True)
class SpeedLaw:
    """A speed law whose answers are checked. A call returns the greatest speed [m/s].

    Raises:
      SettingsError: no function of the four arguments; in a call: it raises, or its answer is no speed.
    """

    name: str  # as the command line takes it
    function: Law = field(repr=False)

    def __post_init__(self) -> None:
        try:
            inspect.signature(self.function).bind(*("steering_angle", "odometry", "car", "mu"))
        except (TypeError, ValueError):
            kind = "class" if isinstance(self.function, type) else type(self.function).__name__
            takes = f"takes {inspect.signature(self.function)}" if callable(self.function) else f"is a {kind}"
            raise SettingsError(f"speed law {self.name!r} {takes}; accepted: {ACCEPTED}") from None

    @kept_folder()
    def __call__(self, steering_angle: float, odometry: Odometry, car: CarParameters, mu: float) -> float:
        """Return the law's speed [m/s]."""
        at = f"speed law {self.name!r} at {steering_angle:g} rad, {odometry.speed:.3g} m/s and mu {mu:g}"
        try:
            answer: Any = self.function(steering_angle, odometry, car, mu)
            speed = float(answer) if isinstance(answer, Real) and not isinstance(answer, bool) else math.nan
        except BaseException as error:
            if not is_of_planner(error):
                raise
            file = inspect.getsourcefile(inspect.unwrap(self.function))
            said = one_line(error) if file is None else error_text(error, file)
            raise SettingsError(f"{at} raises {said}; accepted: {_ANSWERS}") from error
        if not speed >= 0.0:
            raise SettingsError(f"{at} answers {shown(answer)}; accepted: {_ANSWERS}")
        return speed


@kept_folder()
def load_law(source: str) -> SpeedLaw:
    """Return a speed law: a name of LAWS or of an entry point, or a function in a file, as FILE.py:NAME.

    Raises:
      SettingsError: an unknown name, no such function, or one of other arguments.
      ControllerError: the file does not import.
    """
    path, _, name = source.rpartition(":")
    if source.endswith(".py"):
        path, name = source, "law"
    if not path.endswith(".py"):
        return SpeedLaw(source, LAWS.find(source, ", or path/to/file.py:NAME"))
    if not Path(path).is_file():
        raise SettingsError(f"law is {source!r}, and there is no file {path}; accepted: {ACCEPTED}")
    module = import_file(Path(path), f"speed law {source!r}")
    if not hasattr(module, name):
        own = [each for each, value in vars(module).items() if inspect.isfunction(value)]
        listed = ", ".join(f"{path}:{each}" for each in own) or ACCEPTED
        raise SettingsError(f"speed law {source!r}: the file has no {name!r}; accepted: {listed}")
    return SpeedLaw(source, getattr(module, name))


def law_sha256(source: str) -> str | None:
    """Return the SHA-256 of the file of a law; None of one with a name."""
    path = source if source.endswith(".py") else source.rpartition(":")[0]
    return file_sha256(Path(path)) if path.endswith(".py") else None
