"""Closed forms of where a speed law ends: grip, wheel lift, understeer, turning in, and the steering's rate.

    steady = SteadyLimits.of(car, tires, mu=0.7, steering=0.1)
    steady.grip, steady.leaves_arc, steady.curvature_at(3.0)

A rigid car on four wheels runs on a steady circle, by Newton and by its tires' law. At a lateral acceleration a of the
rear axle, on a circle of curvature k:

- the centre of gravity, lr ahead of the rear axle, needs m a (lr k - sin s_r) pointing backwards besides m a cos s_r
  across. The tires push across their own heading, and all four drive alike with what the front ones hold back. Where a
  shaft ties the axles, the front wheels, whose way is longer, are held back by the rear ones besides;
- load moves to the outer wheels by a h / w and, by the backward part, to the front axle; the outer front tire carries
  more and holds its side back; a tire that carries more has less force over its load, by its load sensitivity;
- each axle has the slip angle of its force over its load, s_f and s_r, and the path of the rear axle the curvature
  (tan(d - s_f) + tan s_r) cos s_r / b.

So each a has a speed, v^2 = a / k, and all steady limits are read off one curve.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fg_mujoco.controllers.control.speed import friction_speed, lifting_share

from ..messages import CarParameters, FloatArray
from ..vehicle.tires import AxleTires, Tires

LEAVES = 0.05
"""[-] Of the curvature of the steered arc: a path that differs by more has left it."""

_POINTS = 600  # of the curve
_MOST = 2.0  # [-] greatest lateral acceleration over g, of tires without a peak
_SLIPS = 2000  # of the table of an axle's slip angles
_GREATEST_SLIP = 0.5  # [rad] of that table, of tires without a peak


@dataclass(frozen=True, kw_only=True, eq=False)
class SteadyLimits:
    """A rigid car on steady circles of one steering angle. Speeds are those of the rear axle [m/s].

    A limit that the car does not meet is infinite, and NaN where its tires have nothing to tell it by.
    """

    speed: FloatArray  # (n,) rising
    curvature: FloatArray  # (n,) [-] of the path over that of the steered arc
    front_slip: FloatArray  # (n,) [rad] slip angle of the front axle
    grip: float  # an axle is at its tires' peak; NaN: they have none
    spins: float  # the car turns in by itself: the speed of the curve does not rise any more
    lifts: float  # a wheel has no load left
    leaves_arc: float  # the path differs from the steered arc by LEAVES

    @classmethod
    def of(cls, car: CarParameters, tires: Tires, mu: float, steering: float) -> SteadyLimits:
        """Return the limits of a car at a steering angle [rad]; `mu` is the friction, or the greatest peak, as set."""
        steering = abs(steering)
        front, rear = (_Axle(axle, tires, mu) for axle in _axles(tires))
        peaks = [axle.peak for axle in (front, rear) if math.isfinite(axle.peak)]
        lateral = np.linspace(0.0, 1.1 * max(peaks, default=_MOST / 1.1), _POINTS)[1:]
        wound = 0.0  # [N] by which a shaft holds the front axle back
        slips, uses, curvature = np.zeros((2, len(lateral))), np.zeros((2, len(lateral))), np.ones(len(lateral))
        for at, share in enumerate(lateral.tolist()):
            motion = float(curvature[max(at - 1, 0)]), float(slips[1, max(at - 1, 0)])
            loads = tire_loads(share, steering, car, *motion)
            front_force, rear_force, drive = axle_forces(share, steering, car, *motion, wound=wound)
            slip, ratio, front_slope = front.slips(front_force, 0.5 * drive - wound, loads[:2])
            rear_slip, rear_ratio, rear_slope = rear.slips(rear_force, 0.5 * drive + wound, loads[2:])
            steered, ahead = math.tan(steering), math.tan(steering - slip)
            if car.shaft:
                longer = math.cos(slip) * math.cos(rear_slip) / math.cos(steering - slip) - 1.0
                wound = 0.5 * (wound + longer / (1.0 / front_slope + 1.0 / rear_slope))
            curvature[at] = max((ahead + math.tan(rear_slip)) * math.cos(rear_slip) / steered, 1e-3)
            slips[:, at] = slip, rear_slip
            inside = 0.5 * car.track_width * steered / car.wheelbase  # the inner wheels are this much slower
            bent = 1.0 - inside * float(curvature[at])
            turned = math.atan(steered / (1.0 - inside)) - math.atan(ahead / bent)
            uses[0, at] = front.use(turned, ratio, front_force, loads[:2])
            uses[1, at] = rear.use(math.atan(math.tan(rear_slip) / bent), rear_ratio, rear_force, loads[2:])
        speed = np.sqrt(lateral * car.gravity * car.wheelbase / (curvature * math.tan(steering)))
        ends = np.flatnonzero(uses.max(axis=0) >= 1.0)
        turns = np.flatnonzero(np.diff(speed) <= 0.0)
        end, turn = (int(found[0]) if len(found) else len(speed) - 1 for found in (ends, turns))
        last = min(end, turn) + 1
        away = np.flatnonzero(np.abs(curvature[:last] - 1.0) > LEAVES)
        grip = math.nan if not peaks else float(speed[end]) if len(ends) and end <= turn else math.inf
        left = float(speed[away[0]]) if len(away) else math.inf
        spins = float(speed[turn]) if len(turns) and turn < end else math.inf
        if not len(away) and grip < math.inf:  # sliding, the curvature falls with the square of the speed
            left = grip * math.sqrt(float(curvature[end]) / (1.0 - LEAVES))
        lift = friction_speed(steering, lifting_share(car, steering), car.wheelbase, car.gravity)
        at_lift = float(np.interp(lift, speed[:last], curvature[:last]))
        return cls(
            speed=speed[:last], curvature=curvature[:last], front_slip=slips[0, :last], grip=grip, spins=spins,
            lifts=lift / math.sqrt(at_lift), leaves_arc=min(left, spins),
        )  # fmt: skip

    def curvature_at(self, speed: float) -> float:
        """Return the curvature at a speed [m/s] over that of the steered arc [-]; NaN of a car that spins before."""
        if speed > self.speed[-1]:  # sliding, with the same lateral acceleration
            return float(self.curvature[-1] * (self.speed[-1] / speed) ** 2) if self.grip < math.inf else math.nan
        return float(np.interp(speed, self.speed, self.curvature))


class _Axle:
    """The slip angle of an axle by its force over its load, up to its tires' peak."""

    def __init__(self, axle: AxleTires | None, tires: Tires, mu: float) -> None:
        self._tires, self.peak = axle, mu
        if axle is not None:
            scale = 1.0 if tires.peak is None else mu / tires.peak
            self.peak = scale * axle.lateral.peak if axle.lateral.has_peak else math.inf
            greatest = axle.lateral.peak_slip if axle.lateral.has_peak else _GREATEST_SLIP
            self._slips = np.linspace(0.0, greatest, _SLIPS)
            self._forces = scale * np.array([axle.lateral.force(slip) for slip in self._slips.tolist()])

    def over_load(self, force: float, loads: FloatArray) -> float:
        """Return a force [N] over the load of the axle, and over what its tires' load sensitivity leaves."""
        tires, own = self._tires, [load for load in loads.tolist() if load > 0.0]
        weighted = math.fsum(load * (1.0 if tires is None else tires.load_factor(load)) for load in own)
        return force / weighted

    def slips(self, across: float, along: float, loads: FloatArray) -> tuple[float, float, float]:
        """Return the slip angle [rad] of the axle, the slip ratio of its lighter tire [-], and its force over slip [N].

        Both tires drive alike.
        """
        force = math.hypot(across, along)
        if self._tires is None:  # MuJoCo's contacts creep, but hold without a slip angle
            return 0.0, 0.0, 1e-9
        size = float(np.interp(self.over_load(force, loads), self._forces, self._slips))
        light = 0.5 * float(loads.sum()) / max(float(loads.min()), 1e-9)
        held = min(force, force * self.peak / max(self.over_load(force, loads), 1e-9))
        return across / force * size, along / force * size * light, max(held / max(size, 1e-9), 1e-9)

    def use(self, angle: float, ratio: float, force: float, loads: FloatArray) -> float:
        """Return the slip of a tire over that of its peak, or the axle's force over its peak, which is greater.

        A tire of bristles that is bent to its end does not slide by more than `BRISTLES_SLIDE` while the axle holds.
        """
        used = self.over_load(force, loads) / self.peak
        if self._tires is None or self._tires.lateral.holds:
            return used
        return max(math.hypot(angle, ratio) / float(self._slips[-1]), used)


def _axles(tires: Tires) -> tuple[AxleTires | None, AxleTires | None]:
    return (None, None) if tires.is_contact else tires.axles


def tire_loads(
    lateral: float, steering: float, car: CarParameters, curvature: float = 1.0, rear_slip: float = 0.0
) -> FloatArray:
    """Return the loads of a rigid car's tires on a steady circle, in the order of WHEELS. Shape (4,) [N].

    Moments about the axles and about the middle of the car, both axles rolling alike. 0 where a wheel would lift; what
    is left to the other one is then wrong by as much.

    Args:
      lateral: acceleration of the rear axle over g [-].
      steering: angle, left positive [rad].
      car: parameters.
      curvature: of the path over that of the steered arc [-].
      rear_slip: slip angle of the rear axle, without sign [rad].
    """
    across = lateral * car.gravity * math.cos(rear_slip)
    backwards = -lateral * car.gravity * _along(steering, car, curvature, rear_slip)
    levers = np.array([car.rear_axle_distance, car.front_axle_distance])
    pitch = backwards * car.center_of_gravity_height * np.array([1.0, -1.0])
    axles = car.mass * (car.gravity * levers + pitch) / car.wheelbase
    height = car.center_of_gravity_height + 4.0 * car.wheel_inertia / (car.mass * car.wheel_radius)  # gyroscopes, too
    moved = math.copysign(car.mass * across * height / car.track_width, steering)
    loads: FloatArray = np.maximum(np.column_stack((axles - moved, axles + moved)).ravel() / 2.0, 0.0)
    return loads


def _along(steering: float, car: CarParameters, curvature: float, rear_slip: float) -> float:
    """Return the forward acceleration of the centre of gravity over the rear axle's lateral one [-]."""
    steered = math.tan(abs(steering)) / car.wheelbase
    return math.sin(rear_slip) - curvature * steered * car.rear_axle_distance


def axle_forces(
    lateral: float, steering: float, car: CarParameters, curvature: float = 1.0, rear_slip: float = 0.0,
    *, wound: float = 0.0,
) -> tuple[float, float, float]:
    """Return the forces of the front and the rear axle across their wheels' heading, and what all wheels drive [N].

    Arguments are those of `tire_loads`; `wound` [N] is what the front axle is held back by, and the rear one driven.
    """  # fmt: skip
    steering = abs(steering)
    loads = tire_loads(lateral, steering, car, curvature, rear_slip)
    radius, half = car.wheelbase / math.tan(steering), 0.5 * car.track_width
    angles = np.arctan(car.wheelbase / (radius - np.array([half, -half])))  # Ackermann
    share = loads[:2] / loads[:2].sum()  # of each front tire in the force of its axle
    sin, cos = np.sin(angles), np.cos(angles)
    aside = np.array([half, -half])
    moment = car.front_axle_distance * cos + aside * sin  # about the centre of gravity, of a force across; and along
    turned = car.front_axle_distance * sin - aside * cos
    drive = 0.25  # of a wheel
    balance = np.array([
        [-share @ sin, 0.0, drive * (cos.sum() + 2.0)],
        [share @ cos, 1.0, drive * sin.sum()],
        [share @ moment, -car.rear_axle_distance, drive * turned.sum()],
    ])  # fmt: skip
    weight = car.mass * car.gravity * lateral
    along = _along(steering, car, curvature, rear_slip)
    needed = np.array([weight * along, weight * math.cos(rear_slip), 0.0])
    needed += 0.5 * wound * np.array([cos.sum() - 2.0, sin.sum(), turned.sum()])
    front, rear, drives = np.linalg.solve(balance, needed).tolist()
    return front, rear, drives


def turn_in_limit(steady: SteadyLimits, car: CarParameters, tires: Tires, mu: float, steering: float) -> float:
    """Return the speed [m/s] up to which a step to a steering angle [rad] leaves the front tires below their peak.

    While the servo turns at its rate w for T = d / w, the front slip angle grows by w and is taken back by the lateral
    acceleration of the front axle, with the time v / (g S (lr / b) (1 + m lf^2 / Izz)), S the slope of the tires. So
    it passes that of the steady circle by w t (1 - exp(-T / t)). Infinite: no such speed below those of `steady`; NaN:
    tires without a peak or a slip angle.
    """
    front = _axles(tires)[0]
    if front is None or not front.lateral.has_peak:
        return math.nan
    slope = front.lateral.slope * (1.0 if tires.peak is None else mu / tires.peak)
    turned = 1.0 + car.mass * car.front_axle_distance**2 / car.yaw_inertia
    times = steady.speed / (car.gravity * slope * car.rear_axle_distance / car.wheelbase * turned)
    rate = car.max_steering_rate
    slips = steady.front_slip + rate * times * (1.0 - np.exp(-abs(steering) / rate / times))
    over = np.flatnonzero(slips >= front.lateral.peak_slip)
    return float(steady.speed[over[0]]) if len(over) else math.inf


def approach_limit(car: CarParameters, mu: float, steering: float, speed: float) -> float:
    """Return the speed [m/s] from which a car has braked to `speed` [m/s] when a step of its steering [rad] is there.

    The law slows the car when it steers, not before: it has the time that the servo turns.
    """
    return speed + min(car.max_acceleration, mu * car.gravity) * abs(steering) / car.max_steering_rate


def stopping_distance(speed: float, mu: float, car: CarParameters) -> float:
    """Return the way of a stop [m] with mu g, or with the motor's greatest acceleration if that is less."""
    return speed**2 / (2.0 * min(mu * car.gravity, car.max_acceleration))

