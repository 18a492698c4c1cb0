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
from dataclasses import astuple, dataclass, fields

import numpy as np

from fg_mujoco.errors import SettingsError
from fg_mujoco.kernels import kernel
from fg_mujoco.messages import CarParameters, DriveCommand, Odometry, require

from ..control.records import CAR, Record, record_type
from ..control.speed import friction_speed, friction_steering
from ..control.steering import saturate


@dataclass(frozen=True, kw_only=True)
class GuardSettings:
    """Which shares of the tires' grip may be used, and how fast.

    Raises:
      SettingsError: a share that is not above 0 and at most 1; a time or a speed that is not a positive number.
    """

    lateral_use: float = 0.95  # of mu g, in cornering
    lateral_use_in_braking: float = 0.9  # of the above, when the car is too fast for the wished steering
    least_lateral_use: float = 0.5  # of lateral_use, when it is too fast by `overspeed` for what it sees
    overspeed: float = 0.7  # [m/s]
    turn_in_use: float = 0.5  # of what cornering leaves, for turning the wheels in, or out
    most_left: float = 2.0  # of mu g, that counts as left for it at most; all that there can be
    braking_use: float = 0.92  # of the greatest braking that locks no axle
    accelerating_use: float = 0.88  # of the greatest accelerating that spins none
    load_transfer_time: float = 0.2  # [s] a period of the car's pitching on its springs
    speed_response: float = 0.05  # [s] a wished speed is approached at (wish - speed) / this
    steering_response: float = 0.022  # [s] the servo turns at most at (command - angle) / this: e / 100 rad/s

    def __post_init__(self) -> None:
        shares = tuple(f.name for f in fields(self) if "_use" in f.name)
        others = tuple(f.name for f in fields(self) if "_use" not in f.name)
        require(self, lambda value: 0.0 < value <= 1.0, "a share above 0, at most 1", shares, SettingsError)
        require(self, lambda value: 0.0 < value < math.inf, "a positive number", others, SettingsError)


GUARD = np.dtype(
    [
        ("settings", record_type(GuardSettings)),
        ("car", CAR),
        ("mu", np.float64),
        ("lateral", np.float64),  # [m/s^2] these four: see FrictionGuard
        ("braking", np.float64),  # [m/s^2]
        ("accelerating", np.float64),  # [m/s^2]
        ("yaw_lag", np.float64),  # [m]
    ]
)
"""What `guarded` is told of a guard."""

GUARD_MEMORY = np.dtype([("acceleration", np.float64)])  # [m/s^2] that was last commanded
"""What a guard keeps from one tick to the next; zero in the beginning."""


@kernel
def longitudinal_share(lateral_use: float) -> float:
    """Return the share of straight-line braking and accelerating that is left at a share of the lateral grip.

    1 straight ahead, 0 at the limit. Source: measured, see 4 above.
    """
    return float((1.0 - min(max(lateral_use, 0.0), 1.0)) ** 0.8)


@kernel
def guarded(
    guard: Record,
    memory: Record,
    steering_angle: float,
    speed: float,
    least_lateral_use: float,
    angle_now: float,
    speed_now: float,
    period: float,
) -> tuple[float, float]:
    """Return the command nearest to the wish that the tires hold: steering angle [rad] and speed [m/s].

    Where the present motion is no motion (NaN, inf, or such that its forces are), that is 0 and 0, and a fresh start.

    Args:
      guard: of type GUARD.
      memory: of type GUARD_MEMORY, written to.
      steering_angle: wished [rad].
      speed: wished [m/s], what the scan allows.
      least_lateral_use: the share of the grip for cornering when the car is far too fast, see GuardSettings.
      angle_now: present steering angle [rad].
      speed_now: present speed [m/s].
      period: until the next command [s].
    """
    car, mu, now = guard.car, guard.mu * guard.settings.lateral_use, abs(speed_now)
    wished = min(speed, friction_speed(steering_angle, mu, car.wheelbase, car.gravity))
    target = saturate(steering_angle, _steering_limit(guard, wished, speed, now, least_lateral_use))
    step = _steering_rate(guard, angle_now, now, target - angle_now) * guard.settings.steering_response
    command = angle_now + saturate(target - angle_now, step)
    braking, accelerating = _shares_left(guard, angle_now, command, now)
    acceleration = _approach(guard, memory.acceleration, wished - speed_now, braking, accelerating, period)
    reached = speed_now + acceleration * car.speed_time_constant
    if not math.isfinite(command + reached):
        memory.acceleration = 0.0
        return 0.0, 0.0
    memory.acceleration = acceleration
    return command, reached


@kernel
def _steering_limit(guard: Record, wished: float, speed: float, now: float, least_lateral_use: float) -> float:
    """Return the greatest steering angle [rad] for now: less while the car has to slow down.

    Args:
      guard: of type GUARD.
      wished: speed by the scan and by the wished steering [m/s].
      speed: by the scan alone [m/s].
      now: present [m/s].
      least_lateral_use: the share when it is too fast by `overspeed`.
    """
    car, settings = guard.car, guard.settings
    too_fast = min(max((now - speed) / settings.overspeed, 0.0), 1.0)
    use = 1.0 - too_fast * (1.0 - least_lateral_use)
    if now > wished:
        use = min(use, settings.lateral_use_in_braking)
    mu = guard.mu * settings.lateral_use * use
    return float(min(friction_steering(now, mu, car.wheelbase, car.gravity), car.max_steering_angle))


@kernel
def _steering_rate(guard: Record, angle: float, now: float, turn: float) -> float:
    """Return the greatest steering rate [rad/s] in the direction of `turn` that the front tires can carry."""
    cornering = now * now * math.tan(angle) / guard.car.wheelbase
    unused = max(guard.lateral - math.copysign(cornering, turn * cornering), 0.0)
    unused = min(unused, guard.settings.most_left * guard.lateral)
    curvature_rate = guard.settings.turn_in_use * unused / (guard.yaw_lag * max(now, 1e-3))
    return float(min(curvature_rate * guard.car.wheelbase * math.cos(angle) ** 2, guard.car.max_steering_rate))


@kernel
def _shares_left(guard: Record, angle: float, command: float, now: float) -> tuple[float, float]:
    """Return the shares of straight-line braking and of straight-line accelerating that cornering leaves."""
    cornering = now * now * math.tan(angle) / guard.car.wheelbase
    next_cornering = now * now * math.tan(command) / guard.car.wheelbase
    curvature_rate = (math.tan(command) - math.tan(angle)) / guard.car.wheelbase / guard.settings.steering_response
    front = abs(cornering + guard.yaw_lag * now * curvature_rate)  # turning in takes more of the front tires
    rear_lag = guard.car.yaw_inertia / (guard.car.mass * guard.car.front_axle_distance)
    # and turning out more of the rear ones: twice as much by the slides measured in braking, in which they are the ones
    # that let go first; accelerating loads them
    rear = abs(cornering - 2.0 * rear_lag * now * curvature_rate)
    most = guard.mu * guard.car.gravity
    used = max(abs(cornering), abs(next_cornering), front)
    return longitudinal_share(max(used, rear) / most), longitudinal_share(used / most)


@kernel
def _approach(
    guard: Record, last: float, missing_speed: float, braking: float, accelerating: float, period: float
) -> float:
    """Return the acceleration [m/s^2] to take up `missing_speed` [m/s] with, after that of the last tick.

    `braking` and `accelerating` are the shares of those straight ahead that cornering leaves.
    """
    growth = period / guard.settings.load_transfer_time
    wished = missing_speed / guard.settings.speed_response
    lowest = max(-guard.braking * braking, min(last, 0.0) - guard.braking * growth)
    highest = min(guard.accelerating * accelerating, max(last, 0.0) + guard.accelerating * growth)
    return float(min(max(wished, lowest), highest))


class FrictionGuard:
    """Turns a wished steering angle and speed into a command that the tires can follow: `guarded`, for one car.

    Args:
      car: parameters of the car.
      mu: friction coefficient that the planner believes in.
      settings: shares of the grip.

    Attributes:
      lateral: acceleration that may be used in cornering [m/s^2].
      braking: greatest deceleration straight ahead [m/s^2].
      accelerating: greatest acceleration straight ahead [m/s^2].
      yaw_lag: distance c over which the path's curvature follows the steering at the limit [m].
      record: what `guarded` is told of it, shape (1,), of type GUARD.

    Raises:
      SettingsError: a friction coefficient that is not a positive number.
    """

    def __init__(self, car: CarParameters, mu: float, settings: GuardSettings | None = None) -> None:
        self.car = car
        self.mu = mu
        self.settings = settings or GuardSettings()
        require(self, lambda value: 0.0 < value < math.inf, "a positive number", ("mu",), SettingsError)
        b, h = car.wheelbase, car.center_of_gravity_height
        lever = car.gravity / (h / b + 0.5 / mu) / b
        self.lateral = self.settings.lateral_use * mu * car.gravity
        self.braking = self.settings.braking_use * lever * car.front_axle_distance
        self.accelerating = self.settings.accelerating_use * lever * car.rear_axle_distance
        self.yaw_lag = car.rear_axle_distance + car.yaw_inertia / (car.mass * car.rear_axle_distance)
        self.record = np.zeros(1, GUARD)
        self.record["settings"], self.record["car"] = astuple(self.settings), astuple(car)
        for name in ("mu", "lateral", "braking", "accelerating", "yaw_lag"):
            self.record[name] = getattr(self, name)
        self._memory = np.zeros(1, GUARD_MEMORY)

    def reset(self) -> None:
        """Forget the last command."""
        self._memory.fill(0)

    def __call__(self, steering_angle: float, speed: float, odometry: Odometry, period: float) -> DriveCommand:
        """Return the command nearest to the wish that the tires hold.

        Args:
          steering_angle: wished [rad].
          speed: wished [m/s], what the scan allows.
          odometry: present motion.
          period: until the next command [s].
        """
        angle, now = odometry.steering_angle, odometry.speed
        least = self.settings.least_lateral_use
        command = guarded(self.record[0], self._memory[0], steering_angle, speed, least, angle, now, period)
        return DriveCommand(steering_angle=command[0], speed=command[1])
