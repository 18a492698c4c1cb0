"""Manoeuvres by name, driven open-loop: each is a table of commands, made from a few settings.

Each begins with `begin` seconds straight ahead at its speed. Angles to the left are positive. Where an ISO standard
describes the manoeuvre of a full-size car, the class names it; lengths and speeds are those of a car of scale 1:10.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import ClassVar, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from ..errors import SettingsError, accepted_names
from ..messages import CarParameters, FloatArray, require
from ..racing.planners import ControllerChoice, with_settings
from ..simulation.settings import known_settings
from .commands import SUFFIX, Commands

TICK = 0.025
"""[s] Commands are sampled once a tick, at the LiDAR's rate of 40 Hz, as a planner's are."""

Rows: TypeAlias = tuple[ArrayLike, ArrayLike, ArrayLike]
"""Times [s], steering angles [rad] and speeds [m/s] of a table of commands."""

AT_ONCE = 1e-6  # [s] in which a step is taken: times of ticks are sums of many steps
_RAMP = 1.0  # [s] in which a circle is steered into
_STOPPED = 0.5  # [s] that a braking car is given beyond the time of its calculated stop, which is doubled
_STRAIGHT = 1.0  # [s] straight ahead at the end of a sweep, a slalom and a lane change
_MOST_SECONDS = 600.0  # of a manoeuvre


@dataclass(frozen=True, kw_only=True)
class Manoeuvre:
    """A manoeuvre and its settings.

    Raises:
      SettingsError: a setting out of its range.
    """

    name: ClassVar[str]
    standard: ClassVar[str] = ""  # of ISO, where one fits

    speed: float = 3.0  # [m/s] at which it begins
    begin: float = 1.0  # [s] straight ahead, before anything happens

    def __post_init__(self) -> None:
        self._positive("speed", "begin")

    def __str__(self) -> str:
        plain = type(self)()
        changed = {f.name: getattr(self, f.name) for f in fields(self)}
        return with_settings(self.name, {k: value for k, value in changed.items() if value != getattr(plain, k)})

    def commands(self, car: CarParameters, mu: float) -> Commands:
        """Return its commands, for a car on tires of friction `mu` [-].

        Raises:
          SettingsError: the car cannot steer so far or go so fast, or it takes longer than ten minutes.
        """
        if self.speed > car.max_speed:
            raise self._refused("speed", f"up to the car's {car.max_speed:g} m/s")
        time, steering_angle, speed = (np.asarray(column, np.float64) for column in self._table(car, mu))
        greatest = float(np.abs(steering_angle).max())
        if greatest > car.max_steering_angle:
            raise SettingsError(
                f"{self} steers up to {greatest:.4g} rad; accepted: up to the car's {car.max_steering_angle:g} rad, "
                f"{self._to_steer_less}"
            )
        if not time[-1] <= _MOST_SECONDS:
            raise SettingsError(f"{self} lasts {time[-1]:.4g} s; accepted: up to {_MOST_SECONDS:g} s")
        return Commands(time=time, steering_angle=steering_angle, speed=speed, name=str(self))

    _to_steer_less: ClassVar[str] = "by a smaller angle"

    def _table(self, car: CarParameters, mu: float) -> Rows:
        """Return the rows of its commands."""
        raise NotImplementedError

    @property
    def _just_before(self) -> float:
        """Last time [s] before a step, of which the tick at `begin` is the first."""
        return max(self.begin - AT_ONCE, 0.5 * self.begin)

    def _positive(self, *names: str) -> None:
        require(self, lambda value: 0.0 < value < math.inf, "a positive number", names, SettingsError)

    def _angle(self, name: str) -> None:
        accepted = "an angle in radians other than 0, left positive"
        require(self, lambda value: value != 0.0 and math.isfinite(value), accepted, (name,), SettingsError)

    def _refused(self, name: str, accepted: str) -> SettingsError:
        return SettingsError(f"{type(self).__name__}.{name} is {getattr(self, name)!r}; accepted: {accepted}")

    def _sampled(self, seconds: float, shape: Callable[[FloatArray], FloatArray]) -> Rows:
        """Return a row a tick: `shape`, a function of the times [s] since its beginning, over so many seconds."""
        if not seconds <= _MOST_SECONDS:
            raise SettingsError(f"{self} lasts {seconds + self.begin:.4g} s; accepted: up to {_MOST_SECONDS:g} s")
        time = TICK * np.arange(math.ceil(seconds / TICK) + 2, dtype=np.float64)
        steering_angle = np.where(time <= seconds, shape(time), 0.0)
        whole = np.concatenate(([0.0], self.begin + time, [self.begin + time[-1] + _STRAIGHT]))
        return whole, np.concatenate(([0.0], steering_angle, [0.0])), np.full(len(whole), self.speed)


@dataclass(frozen=True, kw_only=True)
class StepSteer(Manoeuvre):
    """A step of the steering angle at constant speed, and how the yaw rate answers."""

    name = "step_steer"
    standard = "ISO 7401"

    angle: float = 0.1  # [rad]
    seconds: float = 3.0  # [s] that it is held

    def __post_init__(self) -> None:
        super().__post_init__()
        self._positive("seconds")
        self._angle("angle")

    def _table(self, car: CarParameters, mu: float) -> Rows:
        times = (0.0, self._just_before, self.begin, self.begin + self.seconds)
        return times, (0.0, 0.0, self.angle, self.angle), (self.speed,) * 4


@dataclass(frozen=True, kw_only=True)
class Circle(Manoeuvre):
    """A steady circle: the steering angle of the radius by geometry is held at constant speed."""

    name = "circle"
    standard = "ISO 4138"

    radius: float = 2.0  # [m] of the rear axle's circle, left positive, if no tire slipped
    turns: float = 2.0

    def __post_init__(self) -> None:
        super().__post_init__()
        self._positive("turns")
        accepted = "a radius in metres other than 0, left positive"
        require(self, lambda value: value != 0.0 and math.isfinite(value), accepted, ("radius",), SettingsError)

    _to_steer_less = "by a greater radius"

    def _table(self, car: CarParameters, mu: float) -> Rows:
        angle = math.atan(car.wheelbase / self.radius)
        turned = self.begin + _RAMP + 2.0 * math.pi * abs(self.radius) * self.turns / self.speed
        return (0.0, self.begin, self.begin + _RAMP, turned), (0.0, 0.0, angle, angle), (self.speed,) * 4


@dataclass(frozen=True, kw_only=True)
class RampSteer(Manoeuvre):
    """A steering angle that grows slowly at constant speed, through all lateral accelerations up to the limit."""

    name = "ramp_steer"
    standard = "ISO 4138"

    angle: float = 0.35  # [rad] at the end
    rate: float = 0.025  # [rad/s]

    def __post_init__(self) -> None:
        super().__post_init__()
        self._positive("rate")
        self._angle("angle")

    def _table(self, car: CarParameters, mu: float) -> Rows:
        return (0.0, self.begin, self.begin + abs(self.angle) / self.rate), (0.0, 0.0, self.angle), (self.speed,) * 3


@dataclass(frozen=True, kw_only=True)
class SineSweep(Manoeuvre):
    """A sine of the steering angle whose frequency grows exponentially, at constant speed."""

    name = "sine_sweep"
    standard = "ISO 7401"

    angle: float = 0.05  # [rad] amplitude
    low: float = 0.2  # [Hz] at the beginning
    high: float = 4.0  # [Hz] at the end
    seconds: float = 20.0  # [s] that it takes

    def __post_init__(self) -> None:
        super().__post_init__()
        self._positive("low", "high", "seconds")
        self._angle("angle")
        if not self.low < self.high <= 10.0:
            raise self._refused("high", f"a frequency above low, {self.low:g} Hz, up to 10 Hz: commands come at 40 Hz")

    def _table(self, car: CarParameters, mu: float) -> Rows:
        growth = math.log(self.high / self.low) / self.seconds  # [1/s]

        def sweep(time: FloatArray) -> FloatArray:
            return self.angle * np.sin(2.0 * math.pi * self.low / growth * np.expm1(growth * time))

        return self._sampled(self.seconds, sweep)


@dataclass(frozen=True, kw_only=True)
class Slalom(Manoeuvre):
    """A sine of the steering angle, half a period from gate to gate, at constant speed.

    The first and the last half period have half the amplitude, so that the car weaves about its direction.
    """

    name = "slalom"

    angle: float = 0.12  # [rad] amplitude
    spacing: float = 2.0  # [m] from gate to gate
    gates: int = 8

    def __post_init__(self) -> None:
        super().__post_init__()
        self._positive("spacing")
        self._angle("angle")
        if not isinstance(self.gates, int) or isinstance(self.gates, bool) or not 3 <= self.gates <= 1000:
            raise self._refused("gates", "a whole number from 3 to 1000")

    def _table(self, car: CarParameters, mu: float) -> Rows:
        half = self.spacing / self.speed  # [s] a period's

        def weave(time: FloatArray) -> FloatArray:
            gate = np.minimum(np.floor(time / half), self.gates - 1)
            amplitude = np.where((gate == 0) | (gate == self.gates - 1), 0.5, 1.0) * self.angle
            return np.asarray(amplitude * np.sin(math.pi * time / half))

        return self._sampled(self.gates * half, weave)


@dataclass(frozen=True, kw_only=True)
class GrowingSlalom(Manoeuvre):
    """A sine of the steering angle whose amplitude grows from zero, at constant speed and frequency.

    It passes through all slip angles to both sides, and the angle at which an axle lets go shows: for `identify`.
    """

    name = "growing_slalom"

    speed: float = 4.0
    angle: float = 0.4  # [rad] amplitude at the end
    frequency: float = 1.4  # [Hz]
    seconds: float = 5.0  # [s] that the amplitude grows

    def __post_init__(self) -> None:
        super().__post_init__()
        self._positive("frequency", "seconds")
        self._angle("angle")
        if not self.frequency <= 10.0:
            raise self._refused("frequency", "up to 10 Hz: commands come at 40 Hz")

    def _table(self, car: CarParameters, mu: float) -> Rows:
        def weave(time: FloatArray) -> FloatArray:
            return np.asarray(self.angle * time / self.seconds * np.sin(2.0 * math.pi * self.frequency * time))

        return self._sampled(self.seconds, weave)


@dataclass(frozen=True, kw_only=True)
class LaneChange(Manoeuvre):
    """A double lane change as steering over time: one sine to the other lane, straight on, one sine back.

    Lengths are those of ISO 3888-1 in 1:10: 3 m there, 2.5 m in the other lane, 2.5 m back, and lanes .35 m apart. The
    standard's driver steers by what is seen. Here the steering angles follow from the geometry, and are not corrected.
    """

    name = "lane_change"
    standard = "ISO 3888-1"

    speed: float = 4.0
    offset: float = 0.35  # [m] from lane to lane, left positive
    scale: float = 0.1  # of the standard's lengths

    def __post_init__(self) -> None:
        super().__post_init__()
        self._positive("scale")
        accepted = "a distance in metres other than 0, left positive"
        require(self, lambda value: value != 0.0 and math.isfinite(value), accepted, ("offset",), SettingsError)

    _to_steer_less = "by a smaller offset or a greater scale"

    def _table(self, car: CarParameters, mu: float) -> Rows:
        there, stay, back = 30.0 * self.scale, 25.0 * self.scale, 25.0 * self.scale  # [m]

        def steer(time: FloatArray) -> FloatArray:
            way = self.speed * time  # [m] since the beginning
            out = np.where(way < there, self._sine(way, there, car), 0.0)
            home = way - there - stay
            return np.asarray(out - np.where((home >= 0.0) & (home < back), self._sine(home, back, car), 0.0))

        return self._sampled((there + stay + back) / self.speed, steer)

    def _sine(self, way: FloatArray, length: float, car: CarParameters) -> FloatArray:
        """Return the steering angles that shift the rear axle by `offset` over a length [m]."""
        curvature = 2.0 * math.pi * self.offset / length**2  # [1/m] greatest, for small angles
        return np.asarray(np.arctan(car.wheelbase * curvature * np.sin(2.0 * math.pi * way / length)))


@dataclass(frozen=True, kw_only=True)
class Brake(Manoeuvre):
    """Braking to a stop, straight ahead."""

    name = "brake"
    standard = "ISO 21994"

    speed: float = 5.0
    deceleration: float = math.inf  # [m/s^2] at which the commanded speed falls; inf: it is 0 at once

    def __post_init__(self) -> None:
        super().__post_init__()
        accepted = "a positive number, or inf"
        require(self, lambda value: value > 0.0, accepted, ("deceleration",), SettingsError)

    def _table(self, car: CarParameters, mu: float) -> Rows:
        possible = min(mu * car.gravity, car.max_acceleration, self.deceleration)
        end = self.begin + 2.0 * self.speed / possible + _STOPPED
        falls = (self._just_before, self.begin)
        if math.isfinite(self.deceleration):
            falls = (self.begin, self.begin + self.speed / self.deceleration)
        return (0.0, *falls, end), (0.0,) * 4, (self.speed, self.speed, 0.0, 0.0)


MANOEUVRES: dict[str, type[Manoeuvre]] = {
    kind.name: kind for kind in (StepSteer, Slalom, GrowingSlalom, Circle, RampSteer, SineSweep, LaneChange, Brake)
}
"""By name."""


def find_manoeuvre(text: str, speed: float | None = None) -> Manoeuvre:
    """Return the manoeuvre of a name, with settings in brackets where wanted: `circle[radius=2,speed=3]`.

    Args:
      speed: in place of the manoeuvre's own [m/s]; None: its own.

    Raises:
      SettingsError: an unknown name or setting, a value out of its range, or a speed that is given twice.
    """
    choice = ControllerChoice.of(text, "manoeuvre")
    if choice.source not in MANOEUVRES:
        raise SettingsError(
            f"unknown manoeuvre {choice.source!r}; "
            f"{accepted_names(choice.source, MANOEUVRES, f', or the path of a {SUFFIX} file of commands')}"
        )
    kind = MANOEUVRES[choice.source]
    found = kind(**known_settings(dict(choice.settings), kind, f"manoeuvre {choice.source!r}"))
    if speed is None:
        return found
    if "speed" in dict(choice.settings):
        raise SettingsError(f"speed is {speed!r}, and in the brackets of {text!r} there is one; accepted: one of them")
    return replace(found, speed=speed)
