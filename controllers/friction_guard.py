"""The friction law held in transients: a wish in, out comes the nearest command that no tire slides under.

The law v = sqrt(g mu b / tan|d|) is a statement about a steady circle. A tick needs it read in five ways; k is the
path's curvature tan(d) / b at the rear axle, and a = mu g what the tires can hold:

1. speed for the wished steering: v <= sqrt(b a / tan|d|);
2. steering at the present speed: |d| <= atan(b a / v^2). Steering turns faster than the car slows, so this is what
   binds at a corner's entry; then the steering waits and part of the grip is kept for braking;
3. turning in: to spin the car up in yaw the front tires carry m lr / b (v^2 k + c v dk/dt), with
   c = (Izz + m lr^2) / (m lr), some .245 m; turning the wheels in may take a share of what v^2 k leaves;
4. braking and accelerating: open differentials give every wheel the same torque, and load moves off the rear axle
   in braking, off the front axle in accelerating, so the lighter axle lets go first, straight ahead at
   g (l / b) / (h / b + 1 / (2 mu)), l = lf in braking and lr in accelerating. In a corner the lighter inner wheel
   goes before: (1 - ay / a)^0.7 of that is what this car's tires were measured to hold on steady circles, for mu .6
   and 1.0489, and ^0.8 is what is used, because turning in and braking at once is no steady circle;
5. load takes the suspension's time to move: braking and accelerating grow over it, and may fall at once.

Sources: 1 is of the notes of the field's gap_finder_base; 3 and 4 are Newton and Euler for the rigid single-track
car and moments about its axles; the exponent is a fit, which tests/test_friction_guard.py holds against the car.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fg_mujoco.messages import CarParameters, DriveCommand, FloatArray, Odometry

from .speed import friction_speed, friction_steering
from .steering import saturate


def longitudinal_share(lateral_use: ArrayLike) -> FloatArray:
    """Return the share of straight-line braking and accelerating that is left at a share of the lateral grip.

    Any shape; 1 straight ahead, 0 at the limit. Source: measured, see 4 above.
    """
    return np.power(1.0 - np.clip(lateral_use, 0.0, 1.0), 0.8)


@dataclass(frozen=True, kw_only=True)
class GuardSettings:
    """Which shares of the tires' grip may be used, and how fast."""

    lateral_use: float = 0.95  # of mu g, in cornering
    lateral_use_in_braking: float = 0.9  # of the above, when the car is too fast for the wished steering
    least_lateral_use: float = 0.5  # of the above, when it is too fast by `overspeed` for what it sees
    overspeed: float = 0.7  # [m/s]
    turn_in_use: float = 0.5  # of what cornering leaves, for turning the wheels in
    braking_use: float = 0.92  # of the greatest braking that locks no axle
    accelerating_use: float = 0.88  # of the greatest accelerating that spins none
    load_transfer_time: float = 0.2  # [s] a period of the car's pitching on its springs
    speed_response: float = 0.05  # [s] a wished speed is approached at (wish - speed) / this
    steering_response: float = 0.022  # [s] the servo turns at most at (command - angle) / this: e / 100 rad/s


class FrictionGuard:
    """Turns a wished steering angle and speed into a command that the tires can follow.

    Args:
      car: parameters of the car.
      mu: friction coefficient that the planner believes in.
      settings: shares of the grip.

    Attributes:
      lateral: acceleration that may be used in cornering [m/s^2].
      braking: greatest deceleration straight ahead [m/s^2].
      accelerating: greatest acceleration straight ahead [m/s^2].
      yaw_lag: distance c over which the path's curvature follows the steering at the limit [m].
    """

    def __init__(self, car: CarParameters, mu: float, settings: GuardSettings | None = None) -> None:
        self.settings = settings or GuardSettings()
        self._car = car
        self._mu = mu
        b, h = car.wheelbase, car.center_of_gravity_height
        lever = car.gravity / (h / b + 0.5 / mu) / b
        self.lateral = self.settings.lateral_use * mu * car.gravity
        self.braking = self.settings.braking_use * lever * car.front_axle_distance
        self.accelerating = self.settings.accelerating_use * lever * car.rear_axle_distance
        self.yaw_lag = car.rear_axle_distance + car.yaw_inertia / (car.mass * car.rear_axle_distance)
        self.reset()

    def reset(self) -> None:
        """Forget the last command."""
        self._acceleration = 0.0

    def __call__(self, steering_angle: float, speed: float, odometry: Odometry, period: float) -> DriveCommand:
        """Return the command nearest to the wish that the tires hold.

        Args:
          steering_angle: wished [rad].
          speed: wished [m/s], what the scan allows.
          odometry: present motion.
          period: until the next command [s].
        """
        angle, now = odometry.steering_angle, abs(odometry.speed)
        mu = self._mu * self.settings.lateral_use
        wished = min(speed, friction_speed(steering_angle, mu, self._car.wheelbase, self._car.gravity))
        target = saturate(steering_angle, self._steering_limit(wished, speed, now))
        step = self._steering_rate(angle, now, target - angle) * self.settings.steering_response
        command = angle + saturate(target - angle, step)
        left = self._longitudinal_share(angle, command, now)
        self._acceleration = self._approach(wished - odometry.speed, left, period)
        return DriveCommand(
            steering_angle=command,
            speed=odometry.speed + self._acceleration * self._car.speed_time_constant,
        )

    def _steering_limit(self, wished: float, speed: float, now: float) -> float:
        """Return the greatest steering angle [rad] for now: less while the car has to slow down.

        Args:
          wished: speed by the scan and by the wished steering [m/s].
          speed: by the scan alone [m/s].
          now: present [m/s].
        """
        car, settings = self._car, self.settings
        mu = self._mu * settings.lateral_use
        too_fast = min(max((now - speed) / settings.overspeed, 0.0), 1.0)
        use = 1.0 - too_fast * (1.0 - settings.least_lateral_use)
        if now > wished:
            use = min(use, settings.lateral_use_in_braking)
        return min(friction_steering(now, mu * use, car.wheelbase, car.gravity), car.max_steering_angle)

    def _steering_rate(self, angle: float, now: float, turn: float) -> float:
        """Return the greatest steering rate [rad/s] in the direction of `turn` that the front tires can carry."""
        cornering = now * now * math.tan(angle) / self._car.wheelbase
        unused = max(self.lateral - math.copysign(cornering, turn * cornering), 0.0)
        curvature_rate = self.settings.turn_in_use * unused / (self.yaw_lag * max(now, 1e-3))
        return min(curvature_rate * self._car.wheelbase * math.cos(angle) ** 2, self._car.max_steering_rate)

    def _longitudinal_share(self, angle: float, command: float, now: float) -> float:
        """Return the share of straight-line braking and accelerating that cornering leaves."""
        curvature = math.tan(angle) / self._car.wheelbase
        next_curvature = math.tan(command) / self._car.wheelbase
        turning = self.yaw_lag * now * (next_curvature - curvature) / self.settings.steering_response
        lateral = max(now * now * abs(next_curvature), now * now * abs(curvature), abs(now * now * curvature + turning))
        return float(longitudinal_share(lateral / (self._mu * self._car.gravity)))

    def _approach(self, missing_speed: float, share: float, period: float) -> float:
        """Return the acceleration [m/s^2] to take up `missing_speed` [m/s] with."""
        growth = period / self.settings.load_transfer_time
        wished = missing_speed / self.settings.speed_response
        lowest = max(-self.braking * share, min(self._acceleration, 0.0) - self.braking * growth)
        highest = min(self.accelerating * share, max(self._acceleration, 0.0) + self.accelerating * growth)
        return min(max(wished, lowest), highest)
