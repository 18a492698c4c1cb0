"""The last step to a command: one that the tires can follow, and whose speed the car reaches.

1. The friction limiter turns the reference into a command that the tires can follow (friction_limiter).
2. The wheels are turned by the slip angles that soft tires need more, and roll faster or slower than the ground (slip).
3. The speed is corrected for the error of the odometry. The friction limiter asks for an acceleration a by commanding
   the speed v + (a + drag) tau, tau the time constant of the speed servo. Odometry that reads 5 % too much, as with
   worn tires, adds 0.05 v / tau that nobody asked for: 4 m/s^2 at 8 m/s. The error is measured while driving: in each
   tick the measured speed moves by the share 1 - exp(-period / tau) of the way to the command less drag tau. Errors
   within 1 % are left alone: a car whose odometry is right measures as much. On the remembered line, which needs most
   of the braking, the whole error is corrected.
"""

from __future__ import annotations

import math

import numpy as np

from fg_mujoco.compiled.kernels import kernel

from ..perception.scan_geometry import period_of
from ..safety.friction_limiter import held_on_circle, limited
from .planner_settings import Record
from .reasons import GRIP, LOCK, TRANSIENTS, log_step
from .reasons import SPEEDOMETER as BY_SPEEDOMETER
from .slip import drag, steered
from .speed import share_of_way
from .steering import saturate

_LEAST_SPEED = 1.0  # [m/s] of a command that is measured by
_MOST_USE = 0.9  # of what the motor can do: its limits show above it
_GAIN = 0.1  # of a measurement
_MOST = 0.15  # error of one
LEFT_ALONE = 0.01
"""Error of the measured speed, as a share, that is left alone."""

SPEEDOMETER = np.dtype(
    [
        ("command", np.float64),  # [m/s] that was last given; 0: none
        ("speed", np.float64),  # [m/s] that was measured then
        ("error", np.float64),  # of the measured speed, as a share of the motor's
    ]
)
"""Type of what is kept from tick to tick; zero at the beginning."""


@kernel
def read_speedometer(memory: Record, speed: float, car: Record, period: float) -> None:
    """Take a measured speed into the memory, in every tick.

    Args:
      memory: of type SPEEDOMETER, written to.
      speed: measured [m/s].
      car: of type CAR_RECORD.
      period: since the last command [s].
    """
    asked = (memory.command * (1.0 + memory.error) - memory.speed) / car.speed_time_constant
    most = _MOST_USE * car.max_acceleration * min(car.power_limit_speed / max(abs(memory.speed), 1e-3), 1.0)
    if _LEAST_SPEED < memory.command < car.max_speed and abs(asked) < most and math.isfinite(speed):
        share = share_of_way(period, car.speed_time_constant)
        given = memory.speed + (speed - memory.speed) / share + car.speed_time_constant * drag(car, memory.speed)
        memory.error += _GAIN * (saturate(given / memory.command - 1.0, _MOST) - memory.error)
    memory.command, memory.speed = 0.0, speed


@kernel
def command_speed(
    memory: Record, speed: float, car: Record, max_speed: float, period: float, left_alone: float
) -> float:
    """Return the speed to command so that the measured one becomes `speed` [m/s], and keep it.

    Forward, the measured speed stays within 0 and the greatest one until the next command, as it would by the command
    of `speed` itself on a car without an error.

    Args:
      memory: of type SPEEDOMETER, written to.
      speed: by the limiter [m/s].
      car: of type CAR_RECORD.
      max_speed: of the planner [m/s].
      period: until the next command [s].
      left_alone: share of an error that is not corrected.
    """
    command, now = speed, memory.speed
    if speed > 0.0:
        share = share_of_way(period, car.speed_time_constant)
        lowest, highest = now - max(now, 0.0) / share, now + max(max_speed - now, 0.0) / share
        command = speed / (1.0 + memory.error - saturate(memory.error, left_alone))
        command = max(min(command, max(highest, speed)), min(lowest, speed))
    memory.command = command
    return command


@kernel
def apply_limits(tick: Record, steering_angle: float, speed: float, least_use: float) -> tuple[float, float]:
    """Return the command nearest to a reference that the friction limiter allows; `tick` is of type TICK."""
    return apply_limits_of(tick.driver.limiter, tick, steering_angle, speed, least_use, LEFT_ALONE)


@kernel
def apply_limits_of(
    limiter: Record, tick: Record, steering_angle: float, speed: float, least_use: float, left_alone: float
) -> tuple[float, float]:
    """Return the command nearest to a reference that a friction limiter allows; `left_alone` as of `command_speed`."""
    car, memory, angle, now = tick.driver.car, tick.memory, tick.odometry.steering_angle, tick.odometry.speed
    period, reasons = period_of(tick.geometry), memory.reasons
    log_step(reasons, LOCK, saturate(steering_angle, car.max_steering_angle), speed)
    target, allowed = held_on_circle(limiter, steering_angle, speed, abs(now), least_use)
    log_step(reasons, GRIP, target, allowed)
    steering, speed = limited(limiter, memory.limiter, (steering_angle, speed), least_use, (angle, now), period, False)
    log_step(reasons, TRANSIENTS, steering, speed)
    if limiter.slip.needs_slip_angle:
        steering = steered(limiter.slip, car, steering, now)
    command = command_speed(memory.speedometer, speed, car, tick.driver.max_speed, period, left_alone)
    command += memory.velocity_frame.excess  # 0 of tires that are not soft
    log_step(reasons, BY_SPEEDOMETER, steering, command)
    return steering, command
