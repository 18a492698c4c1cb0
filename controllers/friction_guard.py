"""The friction law held in transients: a wish in, a command that keeps every tire below sliding out.

The law v = sqrt(g mu b / tan|d|) is one statement about a steady circle, read here in every way that a tick needs:

1. steering at the present speed: |d| <= atan(b a / v^2), with a the lateral acceleration that may be used;
2. speed at the wished steering: v <= sqrt(b a / tan|d|);
3. steering rate: turning in also has to spin the car up in yaw. With both axles holding, the front tires carry
   m lr/b (v^2 k + c v dk/dt), where k = tan(d)/b is the path's curvature at the rear axle and
   c = (Izz + m lr^2) / (m lr); the term may use only what v^2 k leaves of the same a;
4. braking and accelerating: within what cornering leaves of the friction circle,
   |ax| <= ax_max sqrt(1 - (ay / a)^2).

ax_max is less than mu g. Open differentials give each wheel the same torque, and load moves to the front in
braking and to the rear in accelerating, so the lighter axle's tires let go first, at
ax_max = g (l / b) / (h / b + 1 / (2 mu)), with l = lf in braking, lr in accelerating.

Sources: the steady law is that of the field's gap_finder_base notes; 3 and 4 follow from the rigid single-track
car (Newton and Euler about the rear axle) and the load transfer of the half car.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from fg_mujoco.messages import CarParameters, DriveCommand, Odometry

from .speed import GRAVITY, friction_speed, friction_steering
from .steering import saturate


@dataclass(frozen=True, kw_only=True)
class GuardSettings:
    """How much of the friction that the planner believes in the guard lets it use."""

    lateral_use: float = 0.92  # of mu g, in cornering
    braking_use: float = 0.9  # of the greatest braking without a sliding axle
    accelerating_use: float = 0.8  # of the greatest accelerating without one
    lateral_use_in_braking: float = 0.8  # of the above, where the speed is still too high for the wished steering
    over_scale: float = 0.5
    turn_in_use: float = 0.8
    brake_couple: float = 0.0
    lateral_min: float = 0.5
    load_transfer_time: float = 0.15  # [s] in which braking and accelerating may grow to their limit
    speed_response: float = 0.05  # [s] a wished speed is approached as (wish - speed) / this
    servo_lead: float = 0.025  # [s] the steering servo turns at (command - angle) / this


class FrictionGuard:
    """Turns a wished steering angle and speed into a command that the tires can follow.

    Args:
      car: parameters of the car.
      mu: friction coefficient that the planner believes in; inf switches the guard off.
      settings: shares of the friction to use.
    """

    def __init__(self, car: CarParameters, mu: float, settings: GuardSettings | None = None) -> None:
        self._settings = settings or GuardSettings()
        self._car = car
        self._mu = mu * self._settings.lateral_use
        self._grip = mu * GRAVITY
        b, h = car.wheelbase, car.center_of_gravity_height
        self.max_braking = self._settings.braking_use * GRAVITY * (car.front_axle_distance / b) / (h / b + 0.5 / mu)
        self.max_accelerating = self._settings.accelerating_use * GRAVITY * (car.rear_axle_distance / b) / (h / b + 0.5 / mu)
        moment = car.mass * car.rear_axle_distance
        self._yaw_lag = (car.yaw_inertia + moment * car.rear_axle_distance) / moment  # c [m]
        self.reset()

    def reset(self) -> None:
        self._acceleration = 0.0

    def __call__(self, steering_angle: float, speed: float, odometry: Odometry) -> DriveCommand:
        """Return the command nearest to the wish that the tires hold until the next tick."""
        car, settings = self._car, self._settings
        now = abs(odometry.speed)
        angle = odometry.steering_angle
        target_speed = min(speed, friction_speed(steering_angle, self._mu, car.wheelbase))
        share = settings.lateral_use_in_braking if target_speed < now else 1.0
        over = min(max((now - speed) / settings.over_scale, 0.0), 1.0)
        share = min(share, 1.0 - over * (1 - settings.lateral_min))
        limit = min(friction_steering(now, self._mu * share, car.wheelbase), car.max_steering_angle)
        target = saturate(steering_angle, limit)
        step = self._steering_rate(odometry, math.copysign(1.0, target - angle))
        turn = saturate(target - angle, step * settings.servo_lead)
        command = angle + turn

        curv = math.tan(command) / car.wheelbase
        curv0 = math.tan(angle) / car.wheelbase
        rate = (curv - curv0) / settings.servo_lead
        front = abs(now * now * curv0 + self._yaw_lag * now * rate)
        lateral = max(now * now * max(abs(curv), abs(curv0)), front)
        left = max(0.0, 1.0 - lateral / self._grip) ** 0.7
        wished = (target_speed - odometry.speed) / settings.speed_response
        grow = 0.025 / settings.load_transfer_time
        lowest = max(-self.max_braking * left, min(self._acceleration, 0.0) - self.max_braking * grow)
        highest = min(self.max_accelerating * left, max(self._acceleration, 0.0) + self.max_accelerating * grow)
        self._acceleration = min(max(wished, lowest), highest)
        return DriveCommand(
            steering_angle=command, speed=odometry.speed + self._acceleration * car.speed_time_constant
        )

    def _steering_rate(self, odometry: Odometry, side: float) -> float:
        """Return the greatest steering rate [rad/s] towards `side` (+-1) that the front tires can carry."""
        now = abs(odometry.speed)
        angle = odometry.steering_angle
        unused = self._mu * GRAVITY - side * now * now * math.tan(angle) / self._car.wheelbase
        curvature_rate = self._settings.turn_in_use * (1 - self._settings.brake_couple * abs(self._acceleration) / self.max_braking) * max(unused, 0.0) / (self._yaw_lag * max(now, 1e-3))
        return min(curvature_rate * self._car.wheelbase * math.cos(angle) ** 2, self._car.max_steering_rate)
