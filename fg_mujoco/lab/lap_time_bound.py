"""How fast a lap of a given line could be: the quasi-steady-state lower bound, by a forward and a backward pass.

At each place of the line the forces balance as if the motion were steady there: what cornering leaves of the friction
circle, up to what the actuator gives, brakes or accelerates the car. The fastest such motion is the least of what
corners allow, of what can be gained up to a place, and of what can be lost from there on (Brayshaw and Harrison, "A
quasi steady state approach to race car lap simulation", Proc. IMechE D 219, 2005). No car with these forces laps the
line in less time. `PointMass` is one mass on one friction circle, as a car is whose axles are tied by a shaft.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Protocol

import numpy as np

from ..course.polyline import spline
from ..errors import SettingsError
from ..messages import CarParameters, FloatArray, require

_SPACING = 0.02  # [m] of the points of a smoothed line: the bound is then 8e-4 of itself less than it is at none
_EXACT = 1e-13  # of a squared speed: how far a step is bisected
_GREATEST_PASS = 40  # bisections of the smoothing: the frequency is then exact to 1e-10 of itself


@dataclass(frozen=True, kw_only=True, eq=False)
class Line:
    """A closed line, at points in order."""

    points: FloatArray  # (n, 2) [m]
    curvature: FloatArray  # (n,) [1/m] left positive
    steps: FloatArray  # (n,) [m] from each point to the next, along the line

    @property
    def length(self) -> float:
        """Length of the whole line [m]."""
        return float(self.steps.sum())


class Limits(Protocol):
    """Limits of a car's speed on a line."""

    @property
    def max_speed(self) -> float:
        """Anywhere [m/s]."""

    def corner_speed(self, curvature: float) -> float:
        """Return the greatest speed at a curvature [1/m] [m/s]."""

    def acceleration(self, curvature: float, squared_speed: float) -> float:
        """Return the greatest acceleration at a curvature [1/m] and a speed squared [m^2/s^2] [m/s^2]."""

    def braking(self, curvature: float, squared_speed: float) -> float:
        """Return the greatest deceleration, likewise; positive."""


@dataclass(frozen=True, kw_only=True)
class PointMass:
    """One mass on one friction circle, pushed by the car's actuator; SettingsError: a number that is not positive."""

    mu: float  # [-]
    car: CarParameters
    max_speed: float  # [m/s]

    def __post_init__(self) -> None:
        require(self, lambda value: 0.0 < value < math.inf, "a positive number", ("mu", "max_speed"), SettingsError)

    def corner_speed(self, curvature: float) -> float:
        """Return sqrt(mu g R)."""
        return math.sqrt(self.mu * self.car.gravity / max(abs(curvature), 1e-12))

    def acceleration(self, curvature: float, squared_speed: float) -> float:
        """Return what is left of the friction circle, or what the motor gives: its power limits it at speed."""
        return min(self._left(curvature, squared_speed), motor_acceleration(self.car, squared_speed))

    def braking(self, curvature: float, squared_speed: float) -> float:
        """Return what is left of the friction circle, or what the motor gives; no power is needed for that."""
        return min(self._left(curvature, squared_speed), self.car.max_acceleration)

    def _left(self, curvature: float, squared_speed: float) -> float:
        grip = self.mu * self.car.gravity
        return math.sqrt(max(grip * grip - (curvature * squared_speed) ** 2, 0.0))


def motor_acceleration(car: CarParameters, squared_speed: float) -> float:
    """Return the acceleration that the motor gives at a speed squared [m^2/s^2] [m/s^2]."""
    if squared_speed <= car.power_limit_speed**2:
        return car.max_acceleration
    return car.max_acceleration * car.power_limit_speed / math.sqrt(squared_speed)


def fastest_speeds(line: Line, limits: Limits) -> FloatArray:
    """Return the speed at each point of the line in the fastest quasi-steady lap. Shape (n,) [m/s].

    A step gains or loses 2 a ds of the speed squared, with the acceleration a at the end that the pass goes to: coarse
    steps err to the side of a shorter lap. Both passes begin at the slowest corner, at the corner's speed.
    """
    corner = np.array([limits.corner_speed(curvature) for curvature in line.curvature.tolist()])
    squared = np.minimum(corner, limits.max_speed) ** 2
    slowest = int(squared.argmin())
    ahead = np.roll(squared, -slowest)
    curvature, steps = np.roll(line.curvature, -slowest).tolist(), np.roll(line.steps, -slowest).tolist()
    speeds = [*ahead.tolist(), float(ahead[0])]
    curvature.append(curvature[0])
    for i in range(len(steps)):
        gain = partial(limits.acceleration, curvature[i + 1])
        speeds[i + 1] = _reached(speeds[i], speeds[i + 1], gain, 2.0 * steps[i])
    for i in range(len(steps) - 1, -1, -1):
        loss = partial(limits.braking, curvature[i])
        speeds[i] = _reached(speeds[i + 1], speeds[i], loss, 2.0 * steps[i])
    return np.roll(np.sqrt(speeds[:-1]), slowest)


def _reached(start: float, limit: float, acceleration: Callable[[float], float], twice_the_step: float) -> float:
    """Return, by bisection, the greatest squared speed up to `limit` that is at most start + 2 a ds [m^2/s^2]."""
    low, high = start, min(limit, start + acceleration(start) * twice_the_step)
    if high <= start + acceleration(high) * twice_the_step:
        return high
    while high - low > _EXACT * high:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if middle <= start + acceleration(middle) * twice_the_step else (low, middle)
    return low


def lap_time(line: Line, speeds: FloatArray) -> float:
    """Return how long a lap takes at speeds (n,) [m/s], at even acceleration in each step [s]."""
    return float(np.asarray(2.0 * line.steps / (speeds + np.roll(speeds, -1))).sum())


def smooth_line(points: FloatArray, tolerance: float, spacing: float = _SPACING) -> Line:
    """Return the smoothest closed line that stays within `tolerance` [m] of a row of points (n, 2) [m].

    It is compared with the closed cubic spline of the points. The periodic smoothing spline of the fifth degree is a
    low-pass filter on even points, 1 / (1 + (k / k0)^6) (Wahba, "Spline models for observational data", 1990, section
    2.1), whose k0 is found by bisection; derivatives are exact. SettingsError: a tolerance that is not positive.
    """
    if not 0.0 < tolerance < math.inf:
        raise SettingsError(f"tolerance is {tolerance!r} m; accepted: a positive number")
    (even,) = spline(points, spacing)
    count = len(even)
    length = float(np.hypot(*(np.roll(even, -1, axis=0) - even).T).sum())
    waves = 2.0 * np.pi * np.fft.rfftfreq(count, d=length / count)[:, np.newaxis]  # [rad/m]
    exact = np.fft.rfft(even, axis=0)

    def filtered(cutoff: float) -> FloatArray:
        return np.asarray(exact / (1.0 + (waves / cutoff) ** 6))

    def deviation(cutoff: float) -> float:
        return float(np.hypot(*(np.fft.irfft(filtered(cutoff), n=count, axis=0) - even).T).max())

    low, high = 2.0 * np.pi / length, np.pi * count / length  # one wave a lap, and the finest there is
    for _ in range(_GREATEST_PASS):
        middle = math.sqrt(low * high)
        low, high = (low, middle) if deviation(middle) <= tolerance else (middle, high)
    transform = filtered(high)
    place, first, second = (
        np.fft.irfft(transform * (1j * waves) ** order, n=count, axis=0) for order in range(3)
    )  # fmt: skip
    pace = np.hypot(*first.T)
    curvature = (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / pace**3
    steps = 0.5 * (pace + np.roll(pace, -1)) * (length / count)
    return Line(points=place, curvature=curvature, steps=steps)
