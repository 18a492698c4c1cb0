"""Reference steering of manoeuvres: steps, ramps and sines over time; a slalom and a lane change over ground.

All have the same greatest curvature, so that the law's speed is the same in all. Each begins with half a second
straight ahead, the car rolling at its reference speed.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from fg_mujoco.controllers.control.steering import pursue, saturate

from ..messages import CarParameters, FloatArray, Odometry

CURVATURE = 0.55
"""[1/m] Greatest of the reference: circles of 1.8 m."""

_STRAIGHT = 0.5  # [s] before anything happens
_LOOKAHEAD = 0.8  # [m] along x, to the point of the path that is steered for


@dataclass(frozen=True, kw_only=True)
class Manoeuvre:
    """A manoeuvre, the car starting from the origin along x.

    Attributes:
      name: of the manoeuvre.
      steering: reference steering angle [rad], as a function of the car's motion.
      seconds: that it lasts, or at most [s].
      path: y over x that is to be followed [m]; None: steering over time is all there is.
      end: x at which it ends [m].
    """

    name: str
    steering: Callable[[Odometry, CarParameters], float]
    seconds: float
    path: Callable[[float], float] | None = None
    end: float = math.inf

    def ended(self, odometry: Odometry) -> bool:
        """Return whether the car is past the end, or turned away from its path."""
        return float(odometry.pose[0]) >= self.end or self.lost(odometry.pose[2])

    def lost(self, heading: float) -> bool:
        """Return whether a car heads away from where its path leads [rad]; False where there is no path."""
        return self.path is not None and math.cos(heading) < 0.0

    def off_path(self, position: FloatArray) -> float | None:
        """Return how far from the path a car was at most [m], along y; None where there is no path.

        Args:
          position: of the rear axle (n, 2) [m].
        """
        if self.path is None:
            return None
        return max(abs(float(y) - self.path(float(x))) for x, y in position)


def _over_time(name: str, shape: Callable[[float], float], seconds: float) -> Manoeuvre:
    """Return a manoeuvre that steers by `shape` of the time [s], -1 to 1, of the angle of CURVATURE."""

    def steering(odometry: Odometry, car: CarParameters) -> float:
        time = odometry.stamp - _STRAIGHT
        return math.atan(car.wheelbase * CURVATURE) * shape(time) if time >= 0.0 else 0.0

    return Manoeuvre(name=name, steering=steering, seconds=seconds)


def _over_ground(name: str, path: Callable[[float], float], end: float) -> Manoeuvre:
    """Return a manoeuvre that follows y = `path`(x) by pure pursuit, up to x = `end` [m]."""

    def steering(odometry: Odometry, car: CarParameters) -> float:
        x, y, heading = odometry.pose.tolist()
        ahead, aside = _LOOKAHEAD, path(x + _LOOKAHEAD) - y
        bearing = math.atan2(aside, ahead) - heading
        reference = pursue(bearing, math.hypot(ahead, aside), 0.0, car.wheelbase)
        held: float = saturate(reference, car.max_steering_angle)
        return held

    return Manoeuvre(name=name, steering=steering, seconds=30.0, path=path, end=end)


def _swing(x: float, start: float, wavelength: float, share: float) -> float:
    """Return 0 up to `start`, then 1 - cos over `share` of a wavelength, whose greatest curvature is CURVATURE [m]."""
    phase = 2.0 * math.pi * min(max(x - start, 0.0) / wavelength, share)
    return CURVATURE * (wavelength / (2.0 * math.pi)) ** 2 * (1.0 - math.cos(phase))


MANOEUVRES = {
    manoeuvre.name: manoeuvre
    for manoeuvre in (
        _over_time("step", lambda time: 1.0, 3.0),
        _over_time("ramp", lambda time: min(time, 1.0), 3.5),
        _over_time("sine", lambda time: math.sin(2.0 * math.pi * 0.7 * time), 5.0),
        _over_ground("slalom", lambda x: _swing(x, 3.0, 6.0, 3.0), 22.0),
        _over_ground("lane change", lambda x: _swing(x, 3.0, 6.0, 0.5), 9.0),
    )
}
"""By name."""
