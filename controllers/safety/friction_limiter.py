"""The friction limiter: the command nearest to a reference command that the tires can follow without sliding.

The friction law v = sqrt(g mu b / tan|d|) describes a steady circle. A moving car needs more than that. In each tick
the limiter applies seven limits; k is the curvature tan(d) / b of the path at the rear axle, and a = mu g the
acceleration that the tires can hold:

1. Speed at the commanded steering angle: v <= sqrt(b a / tan|d|).
2. Steering angle at the present speed: |d| <= atan(b a / v^2). Steering turns faster than the car slows, so this limit
   is the active one at a corner's entry. The steering then waits, and part of the grip is kept for braking.
3. Steering rate: to change the car's yaw rate the front tires carry m lr / b (v^2 k + c v dk/dt), with
   c = (Izz + m lr^2) / (m lr), about .245 m. Turning the wheels may use a share of what v^2 k leaves.
4. Braking and accelerating: a shaft gives both axles one slip ratio. The one whose peak lies at the least slip passes
   it first; the other one then has only what its curve gives at this slip. With the forces over load f of the front
   axle and r of the rear one, straight ahead the car brakes with g (lr f + lf r) / (b - h (f - r)) and accelerates with
   + h, mu g of stiff tires. Where an axle has a fixed share p of the force, 1/2 of an open centre and 1 of the only
   one that is driven, it slides at mu g l / (p b + mu h) if load moves off it and at mu g l / (p b - mu h) if load
   moves onto it, with mu its peak and l = lf of the rear axle and lr of the front axle. In a corner that takes a share
   u of mu g, an inner wheel carries the share 1 - 2 (h / w) mu u of its load, w the track width, and the outer wheel of
   an open axle pulls no more than the inner one; a limited axle has 1 / (1 - ramp) times that, at most what both hold.
   An axle's own cornering leaves sqrt(1 - u^2) of its grip. In both, u is over the axle's load as a share of that at
   rest: braking takes load off the rear axle, which has to hold its part of the corner and of the roll all the same. Of
   soft tires on a shaft the axle that is nearest to its peak counts.
   A shaft makes both axles roll alike, though the front wheels' way is 1 / cos d of the rear ones': at .4 rad the tires
   slip by 4 % of the speed. Tires whose peak is at a smaller slip, as that of the ideal ones, slide then.
   Friction of gears and of rolling brakes by the tires, too: the motor drives with that much more and brakes with less.
5. Load moves in the time that the suspension takes: braking and accelerating grow over that time, and may fall at once.
   With a shaft what one axle loses the other one gains, but a wheel swings on its tire, and a step of the force would
   overshoot. In a corner braking grows slower by the share that is left, down to .7 of that: where a car ends to turn
   in and brakes harder at once, the light inner rear wheel slides first. For the same reason the use of the front tires
   in the last tick counts, too, in accelerating and as 6.
6. Sideways pull of steered wheels: a car that speeds up or brakes by x with its wheels turned yaws faster or slower by
   x k. The front tires' pull by sin(d) gives most of the lateral force of that, but it moves load to one side as a
   lateral acceleration lr x k does. This counts where k is great and v^2 k is not: at full lock from standing. It is
   added to the v^2 k + c v dk/dt of 3, and the share that it leaves is that of steady circles. From .6 m/s on the
   car brakes without it, as its stops are planned.
7. Lifting wheels: a car that corners with more than `lifting_share` of g lifts the inner rear wheel. Its axle, if open,
   then pulls nothing; the other one of a shaft still does, until its inner wheel lifts a little later, and the car
   rolls over. So in 1 to 6, mu of cornering is the least of the friction and that share at full lock.

Sources: 1 is in the notes of the field's gap_finder_base. 3 and 4 are Newton's and Euler's laws for the rigid single-
track car, and moments about its axles and wheels; 7 is those of a car with two tracks. The test of this module compares
them with a car of four wheels and with the simulated car. The work is done in
native/controllers/safety/friction_limiter.cpp.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass, replace

import numpy as np

from fg_mujoco.errors import SettingsError
from fg_mujoco.messages import CarParameters, DriveCommand, FloatArray, Odometry, require
from fg_mujoco.native import core, record

from ..control.planner_settings import (
    CAR_RECORD,
    POSITIVE,
    SHARE,
    Settings,
    for_car,
    record_type,
    record_values,
    setting,
    setting_of_car,
)
from ..control.slip import SLIP, at_least_peak, slip_row
from ..control.speed import lifting_share

_FOUND_AT = 1.0489  # friction coefficient at which the shares for evading were found
_LOAD_KEPT = 0.476  # least share that the inner rear wheel of the cars for which they were found keeps, see `evasive`
_MOST_MOVED = 0.95  # [-] of the load of an inner wheel
_SHARES = 257  # of a table over what cornering leaves


@dataclass(frozen=True, kw_only=True)
class FrictionLimiterSettings(Settings):
    """Shares of the tires' grip that may be used, and how fast they may build up.

    Raises:
      SettingsError: a share that is not above 0 and at most 1; a time or a speed that is not a positive number.
    """

    lateral_use: float = setting(0.95, "", "share of mu g, in cornering", SHARE)
    lateral_use_in_braking: float = setting(
        0.9, "", "share of lateral_use while the car is too fast for the reference steering angle", SHARE
    )
    least_lateral_use: float = setting(0.5, "", "share of lateral_use while the car is too fast by `overspeed`", SHARE)
    overspeed: float = setting_of_car(0.7, "m/s", "see least_lateral_use", POSITIVE)
    turn_in_use: float = setting(0.5, "", "share of what cornering leaves, for turning the wheels in or out", SHARE)
    most_left: float = setting(
        2.0, "", "what cornering leaves counts as at most this share of mu g; 2 is all that there can be", POSITIVE
    )
    # a servo begins a tick with 1.13 times the mean of its force: no more than 1 / 1.13 of a limit may be asked for
    braking_use: float = setting(0.865, "", "share of the greatest braking that locks no axle", SHARE)
    accelerating_use: float = setting(0.865, "", "share of the greatest accelerating that spins no wheel", SHARE)
    load_transfer_time: float = setting(
        0.25, "s", "in which the car pitches to within 4 % of where it stays, on its springs", POSITIVE
    )
    speed_response: float = setting(
        0.05, "s", "a reference speed is approached at (reference - speed) / speed_response", POSITIVE
    )
    steering_response: float = setting_of_car(
        0.022, "s", "the servo turns at (command - angle) / steering_response: 1.1 of lag and delay", POSITIVE
    )


LIMITER = record(
    "Limiter",
    [
        ("settings", record_type(FrictionLimiterSettings, native=True)),
        ("car", CAR_RECORD),
        ("mu", np.float64),  # that cornering may use, see 7 above
        ("lateral", np.float64),  # [m/s^2] these six: see FrictionLimiter
        ("braking", np.float64),  # [m/s^2]
        ("accelerating", np.float64),  # [m/s^2]
        ("yaw_lag", np.float64),  # [m]
        ("level", np.float64, (4,)),  # mu, lateral, braking, accelerating on level ground, see FELT_GROUND
        ("shares", np.float64, (2, _SHARES)),  # of braking, accelerating: see `longitudinal_share`
        ("slip", SLIP),  # angles that the tires need
    ],
)
"""Type of the row that `limited` reads."""

FELT_GROUND = record(
    "FeltGround",
    [
        ("load", np.float64),  # [-] more than the weight, over it
        ("bank", np.float64),  # [-] acceleration to the left over g that the ground gives
        ("twist", np.float64),  # [rad/m] roll along the way
    ],
)
"""Type of what the stage `imu` keeps; zero: the ground is level.

The accelerometer reads what the tires give: upwards the load over the mass, and to the left less than v times the yaw
rate by what gravity gives on a bank. So the mu of cornering is mu load + bank, and braking and accelerating change with
the load. Where a bank begins the road is twisted, and the car rolls along the way: one rear wheel carries less, by 8
times its load for each rad/m (f1tenth, by its springs: 3.6 at rest, 6.5 while it brakes). Readings pass a filter of the
time constant .05 s. Stops that are planned from a table (braking_trajectories) are those of level ground.
"""

LIMITER_MEMORY = record(
    "LimiterMemory",
    [
        ("acceleration", np.float64),  # [m/s^2] that was last commanded
        ("lateral_use", np.float64),  # share of the lateral grip that was used then
        ("curvature", np.float64),  # [1/m] of the path that the car is on; of tires that need slip angles, see slip
    ],
)
"""Type of what a limiter keeps from one tick to the next; zero at the beginning."""


def _held(car: CarParameters, mu: float, moved: float, slip: np.void, braking: bool) -> FloatArray:
    """Return what 4 leaves [m/s^2], shape (_SHARES,): at the shares 1 - t^2 of the lateral grip, t from 0 to 1."""
    soft = bool(slip["needs_slip_angle"])
    peaks = (float(slip["front"]["D"]), float(slip["rear"]["D"])) if soft else (float(mu), float(mu))
    forces = at_least_peak(slip) if soft and car.shaft else peaks
    levers = car.rear_axle_distance / car.wheelbase, car.front_axle_distance / car.wheelbase  # the loads at rest
    pitch = (1 if braking else -1) * car.center_of_gravity_height / car.wheelbase
    axles = np.array([levers, (pitch, -pitch), peaks, forces, (car.front_lock, car.rear_lock),
                      (car.drives_front, car.drives_rear)])  # fmt: skip
    found = np.zeros(_SHARES)
    core.find_held(axles, float(mu), float(moved), soft, car.shaft, found)
    return found * car.gravity


EVASIVE = FrictionLimiterSettings(most_left=0.6, turn_in_use=0.45)
"""Settings of the limiter of a car that evades: it brakes and turns out at once, and braking unloads the rear tires.

At a friction of 1.0489; for other floors see `evasive`.
"""


def evasive(settings: FrictionLimiterSettings, car: CarParameters, mu: float) -> FrictionLimiterSettings:
    """Return the settings of a car that evades, which were found at a friction of 1.0489, for a floor of friction `mu`.

    It brakes and turns at once, which relieves the inner rear wheel. The wheels are turned in with a share of the grip
    that is in proportion to the load which this wheel keeps, and so a taller car turns them in with a smaller one. On
    floors of more friction the share is not lowered.
    """
    held = min(mu, _FOUND_AT, lifting_share(car, car.max_steering_angle))
    more = _inner_rear_load(settings, car, held) / max(_inner_rear_load(settings, car, _FOUND_AT), _LOAD_KEPT)
    return replace(settings, turn_in_use=min(settings.turn_in_use * more, 1.0))


def _inner_rear_load(settings: FrictionLimiterSettings, car: CarParameters, mu: float) -> float:
    """Return the share of its load at rest that the inner rear wheel keeps.

    The car corners with half of the grip, and brakes as hard as it may straight ahead.
    """
    height = car.center_of_gravity_height / car.wheelbase
    in_cornering = 1.0 - min(mu * car.center_of_gravity_height / car.track_width, 0.95)
    return in_cornering * (1.0 - settings.braking_use * height / (height + 0.5 / mu))


longitudinal_share = core.longitudinal_share
"""Return the share of straight-line braking or accelerating that is left at a share of the lateral grip, see 4.

It is 1 straight ahead and 0 at the limit. `limiter` is of type LIMITER.
"""


limited = core.limited
"""Return the command nearest to the reference that the tires hold: steering angle [rad] and speed [m/s].

Where the present motion is not finite, or its forces are not, that is 0 and 0, and the memory is reset.

It takes, in this order:
  limiter: of type LIMITER.
  memory: of type LIMITER_MEMORY, written to.
  reference: steering angle [rad] and speed [m/s], which the scan allows.
  least_lateral_use: share of the grip for cornering when the car is far too fast, see FrictionLimiterSettings.
  present: steering angle [rad] and speed [m/s].
  period: until the next command [s].
  planned: whether the command is one of a stop that is only planned, without 6 and what the last tick leaves.
"""

held_on_circle = core.held_on_circle
"""Return the steering angle [rad] and the speed [m/s] that limits 1 and 2 leave of a reference.

`now` is the present speed without its sign [m/s]; the other arguments are as of `limited`.
"""


class FrictionLimiter:
    """Turns a reference steering angle and speed into a command that the tires can follow: `limited`, for one car.

    Args:
      car: parameters of the car.
      mu: friction coefficient that the planner assumes.
      settings: shares of the grip.

    Attributes:
      lateral: acceleration that may be used in cornering [m/s^2], of `mu` or of 7.
      braking: greatest deceleration straight ahead [m/s^2], of the tires or the motor.
      accelerating: greatest acceleration straight ahead [m/s^2], likewise.
      yaw_lag: distance c over which the path's curvature follows the steering at the limit [m].
      record: the row that `limited` reads, shape (1,), of type LIMITER.

    Raises:
      SettingsError: a friction coefficient that is not a positive number.
    """

    def __init__(self, car: CarParameters, mu: float, settings: FrictionLimiterSettings | None = None) -> None:
        self.car = car
        self.mu = mu
        self.settings = for_car(settings or FrictionLimiterSettings(), car)
        require(self, POSITIVE.holds, POSITIVE.text, ("mu",), SettingsError)
        held = min(mu, lifting_share(car, car.max_steering_angle))
        self.lateral = self.settings.lateral_use * held * car.gravity
        slip = slip_row(car, mu, self.lateral)
        moved = min(2.0 * held * car.center_of_gravity_height / car.track_width, _MOST_MOVED)
        left = np.array([_held(car, mu, moved, slip[0], braking) for braking in (True, False)])
        braking, accelerating = left[:, -1].tolist()
        self.braking = min(self.settings.braking_use * braking, car.max_acceleration)
        self.accelerating = min(self.settings.accelerating_use * accelerating, car.max_acceleration)
        self.yaw_lag = car.rear_axle_distance + car.yaw_inertia / (car.mass * car.rear_axle_distance)
        self.record = np.zeros(1, LIMITER)
        self.record["settings"], self.record["car"] = record_values(self.settings), astuple(car)
        self.record["mu"], self.record["shares"] = held, left / left[:, -1:]
        for name in ("lateral", "braking", "accelerating", "yaw_lag"):
            self.record[name] = getattr(self, name)
        self.record["level"] = held, self.lateral, self.braking, self.accelerating
        self.record["slip"] = slip
        self._memory = np.zeros(1, LIMITER_MEMORY)

    def reset(self) -> None:
        """Forget the last command."""
        self._memory.fill(0)

    def __call__(self, steering_angle: float, speed: float, odometry: Odometry, period: float) -> DriveCommand:
        """Return the command nearest to the reference that the tires hold.

        Args:
          steering_angle: of the reference [rad].
          speed: of the reference [m/s], which the scan allows.
          odometry: present motion.
          period: until the next command [s].
        """
        angle, now = odometry.steering_angle, odometry.speed
        least = self.settings.least_lateral_use
        command = limited(self.record, self._memory, (steering_angle, speed), least, (angle, now), period, False)
        return DriveCommand(steering_angle=command[0], speed=command[1])
