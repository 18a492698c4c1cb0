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
them with a car of four wheels and with the simulated car.
"""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass, replace

import numpy as np

from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.errors import SettingsError
from fg_mujoco.messages import CarParameters, DriveCommand, FloatArray, Odometry, require

from ..control.planner_settings import (
    CAR_RECORD,
    POSITIVE,
    SHARE,
    Record,
    Settings,
    for_car,
    record_type,
    record_values,
    setting,
    setting_of_car,
)
from ..control.slip import SLIP, at_least_peak, drag, fastest_on, held_on_arc, slip_row, stable_braking, tightest_arc
from ..control.speed import friction_speed, friction_steering, lifting_share, share_of_way
from ..control.steering import saturate

_SLOWEST_GROWTH = 0.7  # [-] of braking, see 5 above: slower, and stops get longer than the car sees
_SLOW = 0.6  # [m/s] a faster car brakes as its stops are planned
_LEAST_STABLE = 0.2  # share of braking, whatever the critical speed: a car that does not brake is no slower
_FOUND_AT = 1.0489  # friction coefficient at which the shares for evading were found
_LOAD_KEPT = 0.476  # least share that the inner rear wheel of the cars for which they were found keeps, see `evasive`
_ROLLS = 1.0  # [rad/s] of a wheel, as in vehicle.tire_forces: below it rolling takes in proportion to its turning
_MOST_MOVED = 0.95  # [-] of the load of an inner wheel
_MOST_HELD = 4.0  # [-] acceleration over g that is looked at
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


LIMITER = np.dtype(
    [
        ("settings", record_type(FrictionLimiterSettings)),
        ("car", CAR_RECORD),
        ("mu", np.float64),  # that cornering may use, see 7 above
        ("lateral", np.float64),  # [m/s^2] these six: see FrictionLimiter
        ("braking", np.float64),  # [m/s^2]
        ("accelerating", np.float64),  # [m/s^2]
        ("yaw_lag", np.float64),  # [m]
        ("shares", np.float64, (2, _SHARES)),  # of braking, accelerating: see `longitudinal_share`
        ("slip", SLIP),  # angles that the tires need
    ]
)
"""Type of the row that `limited` reads."""

LIMITER_MEMORY = np.dtype(
    [
        ("acceleration", np.float64),  # [m/s^2] that was last commanded
        ("lateral_use", np.float64),  # share of the lateral grip that was used then
        ("curvature", np.float64),  # [1/m] of the path that the car is on; of tires that need slip angles, see slip
    ]
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
    _find_held(axles, float(mu), float(moved), soft, car.shaft, found)
    return found * car.gravity


@kernel
def _find_held(axles: FloatArray, mu: float, moved: float, soft: bool, shaft: bool, found: FloatArray) -> None:
    """Write the acceleration over g at each share; `axles` are the numbers of `_held`, of front and rear."""
    levers, pitch, peaks, forces, locks, driven = axles[0], axles[1], axles[2], axles[3], axles[4], axles[5]
    for index in range(_SHARES):
        use = 1.0 - (index / (_SHARES - 1)) ** 2
        low, high = 0.0, _MOST_HELD
        for _ in range(40):
            middle = 0.5 * (low + high)
            least, together, weakest = 1.0, 0.0, math.inf
            for axle in range(2):
                load = max(levers[axle] + pitch[axle] * middle, 1e-9)
                used = use * levers[axle] / load
                inner = min(max(1.0 - moved * used, 0.0) / max(1.0 - locks[axle], 1e-9), 1.0)
                kept = inner * math.sqrt(1.0 - min(used * mu / peaks[axle], 1.0) ** 2)
                least = min(least, kept)
                together += forces[axle] * load * (1.0 if soft else kept)
                if driven[axle] > 0.0:
                    weakest = min(weakest, (driven[0] + driven[1]) * peaks[axle] * load * kept)
            held = weakest
            if shaft:
                held = together * least if soft else together
            if middle <= held:
                low = middle
            else:
                high = middle
        found[index] = low


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


@kernel
def longitudinal_share(limiter: Record, lateral_use: float, braking: bool) -> float:
    """Return the share of straight-line braking or accelerating that is left at a share of the lateral grip, see 4.

    It is 1 straight ahead and 0 at the limit. `limiter` is of type LIMITER.
    """
    position = math.sqrt(1.0 - min(max(lateral_use, 0.0), 1.0)) * (_SHARES - 1)
    at, shares = min(int(position), _SHARES - 2), limiter.shares[0] if braking else limiter.shares[1]
    return float(shares[at] + (position - at) * (shares[at + 1] - shares[at]))


@kernel
def stable_share(limiter: Record, share: float, lateral_use: float, speed: float) -> float:
    """Return a share of braking, or what is stable of it, see `stable_braking`; a fifth of it at least."""
    stable = stable_braking(limiter.slip, lateral_use, speed) * limiter.car.gravity / limiter.braking
    return float(min(share, max(stable, _LEAST_STABLE * share)))


@kernel
def limited(
    limiter: Record,
    memory: Record,
    reference: tuple[float, float],
    least_lateral_use: float,
    present: tuple[float, float],
    period: float,
    planned: bool,
) -> tuple[float, float]:
    """Return the command nearest to the reference that the tires hold: steering angle [rad] and speed [m/s].

    Where the present motion is not finite, or its forces are not, that is 0 and 0, and the memory is reset.

    Args:
      limiter: of type LIMITER.
      memory: of type LIMITER_MEMORY, written to.
      reference: steering angle [rad] and speed [m/s], which the scan allows.
      least_lateral_use: share of the grip for cornering when the car is far too fast, see FrictionLimiterSettings.
      present: steering angle [rad] and speed [m/s].
      period: until the next command [s].
      planned: whether the command is one of a stop that is only planned, without 6 and what the last tick leaves.
    """
    angle_now, speed_now = present
    car, now = limiter.car, abs(speed_now)
    target, allowed = held_on_circle(limiter, reference[0], reference[1], now, least_lateral_use)
    if limiter.slip.needs_slip_angle:
        target = _held_on_path(limiter, memory.curvature, target, angle_now, now)
    slope = math.tan(angle_now)
    step = _steering_rate(limiter, slope, now, target - angle_now) * limiter.settings.steering_response
    command = angle_now + saturate(target - angle_now, step)
    acceleration = _approach(limiter, memory, allowed - speed_now, slope, math.tan(command), speed_now, period, planned)
    # the servo's acceleration falls while the command is held: the mean over the period is what was asked for
    reached = speed_now + acceleration * period / share_of_way(period, car.speed_time_constant)
    if not planned:
        overcome = car.speed_time_constant * drag(car, speed_now)
        if allowed <= 0.0:  # a car that is to stand does not creep on
            overcome *= min(now / (_ROLLS * car.wheel_radius), 1.0)
        reached += overcome
    if not math.isfinite(command + reached):
        memory.acceleration = memory.lateral_use = 0.0
        return 0.0, 0.0
    memory.acceleration = acceleration
    return command, reached


@kernel
def held_on_circle(
    limiter: Record, steering_angle: float, speed: float, now: float, least_lateral_use: float
) -> tuple[float, float]:
    """Return the steering angle [rad] and the speed [m/s] that limits 1 and 2 leave of a reference.

    `now` is the present speed without its sign [m/s]; the other arguments are as of `limited`.
    """
    car, mu = limiter.car, limiter.mu * limiter.settings.lateral_use
    allowed = speed
    if not speed <= 0.0:
        allowed = min(speed, friction_speed(steering_angle, mu, car.wheelbase, car.gravity))
    limit = _steering_limit(limiter, allowed, speed, now, least_lateral_use)
    if limiter.slip.needs_slip_angle:
        if not speed <= 0.0:
            angle, least = saturate(steering_angle, car.max_steering_angle), limiter.slip.least_speed
            allowed = min(allowed, fastest_on(limiter.slip, angle, least))
        limit = min(limit, tightest_arc(limiter.slip, now))
    return saturate(steering_angle, limit), allowed


@kernel
def _held_on_path(limiter: Record, curvature: float, target: float, angle_now: float, now: float) -> float:
    """Return a steering angle [rad] with which the path is no tighter than 1 allows, although the car turns in more.

    The path has a curvature [1/m] now. Where it is tighter than the arc of the wheels, the rear axle needs a greater
    slip angle than the one in front: that much less of an arc is left to them.
    """
    car = limiter.car
    more = math.atan(car.wheelbase * curvature) - angle_now
    if not (more * curvature > 0.0 and curvature * target > 0.0):
        return target
    most = friction_steering(now, limiter.mu * limiter.settings.lateral_use, car.wheelbase, car.gravity)
    return saturate(target, max(most - abs(more), 0.0))


@kernel
def _steering_limit(limiter: Record, allowed: float, speed: float, now: float, least_lateral_use: float) -> float:
    """Return the greatest steering angle [rad] for now, which is smaller while the car has to slow down.

    Args:
      limiter: of type LIMITER.
      allowed: speed by the scan and by the reference steering angle [m/s].
      speed: by the scan alone [m/s].
      now: present [m/s].
      least_lateral_use: the share when the car is too fast by `overspeed`.
    """
    car, settings = limiter.car, limiter.settings
    too_fast = min(max((now - speed) / settings.overspeed, 0.0), 1.0)
    use = 1.0 - too_fast * (1.0 - least_lateral_use)
    if now > allowed:
        use = min(use, settings.lateral_use_in_braking)
    mu = limiter.mu * settings.lateral_use * use
    return float(min(friction_steering(now, mu, car.wheelbase, car.gravity), car.max_steering_angle))


@kernel
def _steering_rate(limiter: Record, slope: float, now: float, turn: float) -> float:
    """Return the greatest steering rate [rad/s] in the direction of `turn` that the front tires can carry.

    `slope` is the tangent of the present steering angle.
    """
    cornering = now * now * slope / limiter.car.wheelbase
    unused = max(limiter.lateral - math.copysign(cornering, turn * cornering), 0.0)
    unused = min(unused, limiter.settings.most_left * limiter.lateral)
    curvature_rate = limiter.settings.turn_in_use * unused / (limiter.yaw_lag * max(now, 1e-3))
    return float(min(curvature_rate * limiter.car.wheelbase / (1.0 + slope * slope), limiter.car.max_steering_rate))


@kernel
def _approach(
    limiter: Record,
    memory: Record,
    missing_speed: float,
    slope: float,
    next_slope: float,
    speed_now: float,
    period: float,
    planned: bool,
) -> float:
    """Return the acceleration [m/s^2] with which to take up `missing_speed` [m/s], after that of the last tick.

    The slopes are the tangents of the steering angle, now and as commanded; `memory.lateral_use` is written to.
    """
    car, settings = limiter.car, limiter.settings
    growth, grip = period / settings.load_transfer_time, limiter.mu * car.gravity
    reference, braking = missing_speed / settings.speed_response, missing_speed < 0.0
    cornering = speed_now * speed_now * slope / car.wheelbase
    turning = speed_now * (next_slope - slope) / car.wheelbase / settings.steering_response  # [1/s^2] v dk/dt
    front = cornering + limiter.yaw_lag * turning  # turning in takes more of the front tires
    used = max(abs(cornering), abs(speed_now * speed_now * next_slope / car.wheelbase), abs(front))
    most = limiter.accelerating
    if braking:
        # Turning out takes more of the rear tires: twice as much by the slides measured in braking, in which the rear
        # tires slide first. Accelerating loads them.
        rear_lag = car.yaw_inertia / (car.mass * car.front_axle_distance)
        used = max(used, abs(cornering - 2.0 * rear_lag * turning))
        most = -limiter.braking
    used /= grip
    if limiter.slip.needs_slip_angle:
        used = max(used, abs(speed_now * speed_now * memory.curvature) / grip)
    if not planned:
        estimate = most * max(1.0 - used, 0.0)
        if abs(reference) < abs(estimate):
            estimate = reference
        moved = abs(front + car.rear_axle_distance * estimate * slope / car.wheelbase) / grip
        if reference * speed_now >= 0.0 or abs(speed_now) < _SLOW:
            used = max(used, moved, memory.lateral_use)
        memory.lateral_use = moved
    share = longitudinal_share(limiter, used, braking)
    brakes = reference * speed_now < 0.0
    if limiter.slip.needs_slip_angle and (car.shaft or not brakes):
        use, lateral = settings.accelerating_use, min(used, 1.0) * limiter.mu
        held = car.gravity * held_on_arc(limiter.slip, car, math.atan(slope), lateral, braking, brakes, use)
        if brakes:
            share = min(share, held * math.sqrt(max(1.0 - used * used, 0.0)) / abs(most))
        else:
            most = math.copysign(min(abs(most), held), most)
    before = memory.acceleration
    if braking:
        if limiter.slip.needs_slip_angle:
            share = stable_share(limiter, share, used, abs(speed_now))
        grown = min(before, 0.0) + most * max(share, _SLOWEST_GROWTH) * growth
        return float(max(reference, min(most * share, -drag(car, speed_now)), grown))
    return float(min(reference, most * share, max(before, 0.0) + most * growth))


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
        reference = float(steering_angle), float(speed)  # a whole number would compile the kernel anew
        command = limited(self.record[0], self._memory[0], reference, least, (float(angle), float(now)), period, False)
        return DriveCommand(steering_angle=command[0], speed=command[1])
