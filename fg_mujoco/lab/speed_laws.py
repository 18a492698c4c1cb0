"""Four ways to use the friction law: from a reference steering angle and speed to a command.

    hold = LAWS["limiter"](car, mu=0.7)
    command = hold(steering_angle, speed, odometry)

none       the reference as it is
one way    limits the speed by the reference steering angle: v <= sqrt(g mu b / tan|d|)
both ways  also limits the steering angle by the present speed: |d| <= atan(g mu b / v^2)
limiter    the whole friction limiter, controllers/safety/friction_limiter.py

The last three use the friction limiter's share of the tires' friction. They differ only in how they use the law.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

from fg_mujoco.controllers.control.speed import friction_speed, friction_steering
from fg_mujoco.controllers.control.steering import saturate
from fg_mujoco.controllers.safety.friction_limiter import FrictionLimiter, FrictionLimiterSettings

from ..messages import CarParameters, DriveCommand, Odometry
from .lab_ground import TICK

Law: TypeAlias = Callable[[float, float, Odometry], DriveCommand]
"""From a reference steering angle [rad] and speed [m/s], and the present motion, to a command."""


def _none(car: CarParameters, mu: float) -> Law:
    return lambda steering, speed, odometry: DriveCommand(steering_angle=steering, speed=speed)


def _one_way(car: CarParameters, mu: float) -> Law:
    grip = mu * FrictionLimiterSettings().lateral_use

    def hold(steering: float, speed: float, odometry: Odometry) -> DriveCommand:
        limit = friction_speed(steering, grip, car.wheelbase, car.gravity)
        return DriveCommand(steering_angle=steering, speed=min(speed, limit))

    return hold


def _both_ways(car: CarParameters, mu: float) -> Law:
    grip = mu * FrictionLimiterSettings().lateral_use
    by_steering = _one_way(car, mu)

    def hold(steering: float, speed: float, odometry: Odometry) -> DriveCommand:
        limit = friction_steering(odometry.speed, grip, car.wheelbase, car.gravity)
        slower = by_steering(steering, speed, odometry).speed
        return DriveCommand(steering_angle=saturate(steering, limit), speed=slower)

    return hold


def _limiter(car: CarParameters, mu: float) -> Law:
    limiter = FrictionLimiter(car, mu)
    return lambda steering, speed, odometry: limiter(steering, speed, odometry, TICK)


LAWS: dict[str, Callable[[CarParameters, float], Law]] = {
    "none": _none,
    "one way": _one_way,
    "both ways": _both_ways,
    "limiter": _limiter,
}
"""By name: makes a law for a car and the friction coefficient that it assumes."""
