"""Where a steady circle ends for a rigid car: what the lab puts beside the speeds that it measures.

A car runs on a circle at a speed. Unknown are the slip angle of its rear axle, the curvature of its path, the slip
ratios of its wheels, and the forces of its drive line; as many balances say what they are:

- the tires push the car as its mass on its circle and its drag need it, and do not turn it. Load moves to the outer
  wheels, by the height of the centre of gravity, by the wheels as gyroscopes, and because the car leans, and to the
  front axle by the backward part of the acceleration;
- a wheel gets from the drive line what its tire, its rolling resistance and the damping of its joint take;
- a shaft or a locked axle makes spins alike, and a clutch holds them as far as its torque goes (`drive_line`).

Where there is no solution any more the car spins. What it lacks is all that is not steady, and that it pitches and
leans on its springs, but for the load that moves.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fg_mujoco.controllers.control.speed import friction_speed

from ..messages import CarParameters, FloatArray
from ..vehicle.tire_rows import gear_row
from ..vehicle.tire_slip import BRISTLES_SLIDE
from ..vehicle.tires import tires_of
from .lab_ground import LabGround

LEAVES = 0.05
"""[-] Of the curvature of the steered arc: a path that differs by more has left it."""

LOW, HIGH = 0.1, 1.6
"""[-] Of the kinematic law's speed: what is looked at."""

_STRIDE, _LEAST_STRIDE = 0.025, 2e-4  # of that speed: from one solution to the next
_TURN = 0.02  # [rad] of steering, from one solution to the next on the way to the first
_JUMP = 0.3  # of the curvature: two solutions that are farther apart do not belong together
_ROUNDS, _LEAST_SHARE, _EXACT = 40, 1e-3, 1e-9  # of Newton's method; residuals are over the weight
_STEP = 1e-7  # of its finite differences
_SLIPS = 1e-3  # [-] slip between two wheels at which a clutch has nearly all of its torque
_LEAST_LOAD = 1e-3  # of the weight, which a wheel that has lifted keeps


@dataclass(frozen=True, kw_only=True, eq=False)
class SteadyLimits:
    """A rigid car on steady circles of one steering angle. Speeds are those of the rear axle [m/s].

    A limit not met up to HIGH is infinite. NaN for the model `contact`, and `slides` for tires without a peak.
    """

    speed: FloatArray  # (n,) rising
    curvature: FloatArray  # (n,) [-] of the path over that of the steered arc
    slides: float  # a tire slides, as the slip meter says, or the car spins
    lifts: float  # a wheel has no load left
    leaves_arc: float  # the path differs from the steered arc by LEAVES, or the car spins

    @classmethod
    def of(cls, ground: LabGround, mu: float, steering: float, *, untied: bool = False) -> SteadyLimits:
        """Return the limits of a car at a steering angle [rad]; `mu` is what the kinematic law is told [-].

        `untied`: of the same car with open differentials only, whose wheels turn freely beside each other.
        """
        parameters = ground.car.parameters
        law = friction_speed(steering, mu, parameters.wheelbase, parameters.gravity)
        car = _RigidCar(ground, abs(steering), untied) if len(ground.forces.rows) else None
        now = None if car is None else car.begin(LOW * law)
        if car is None or now is None:
            nothing = np.full(1, math.nan)
            return cls(speed=nothing, curvature=nothing, slides=math.nan, lifts=math.nan, leaves_arc=math.nan)
        share, stride, change, found = LOW, _STRIDE, np.zeros_like(now), [car.told(now, LOW * law)]
        while share < HIGH and stride > _LEAST_STRIDE:
            after = min(share + stride, HIGH)
            ahead = car.solve(now + change * (after - share), after * law)
            if ahead is None or abs(ahead[1] - now[1]) > _JUMP * max(now[1], LOW):
                stride *= 0.5
                continue
            share, now, change = after, ahead, (ahead - now) / (after - share)
            stride = min(2.0 * stride, _STRIDE)
            found.append(car.told(now, share * law))
        speed, curvature, sliding, least_load = np.array(found).T
        spins = math.inf if share >= HIGH else float(speed[-1])
        away = np.abs(curvature - 1.0) - LEAVES
        return cls(
            speed=speed, curvature=curvature, slides=min(_first(speed, sliding), spins) if car.has_peak else math.nan,
            lifts=_first(speed, -least_load), leaves_arc=min(_first(speed, away), spins),
        )  # fmt: skip

    @property
    def ends(self) -> float:
        """The least of the three; NaN: none is known."""
        known = [each for each in (self.slides, self.lifts, self.leaves_arc) if not math.isnan(each)]
        return min(known, default=math.nan)

    def curvature_at(self, speed: float) -> float:
        """Return the curvature at a speed [m/s] over that of the steered arc [-]; NaN of one beyond the last."""
        return math.nan if speed > self.speed[-1] else float(np.interp(speed, self.speed, self.curvature))


def _first(speed: FloatArray, margin: FloatArray) -> float:
    """Return the speed from which on a margin is positive, straight between two; infinite: it never is."""
    over = np.flatnonzero(margin > 0.0)
    if not len(over):
        return math.inf
    ends = slice(max(int(over[0]) - 1, 0), int(over[0]) + 1)
    return float(np.interp(0.0, margin[ends], speed[ends]))


class _Wheels(NamedTuple):
    """What the wheels do, (4,) in the order of WHEELS, and the centre of gravity, (2,) forward and to the left."""

    along: FloatArray  # [N] force of the tire along its heading
    across: FloatArray  # [N] to its left
    load: FloatArray  # [N] negative: the wheel would lift
    surface: FloatArray  # [m/s] of the tire
    size: FloatArray  # [-] of the slip over that of the peak
    slip_speed: FloatArray  # [m/s]
    velocity: FloatArray
    acceleration: FloatArray


class _RigidCar:
    """A car in equilibrium on a circle to the left: see the module."""

    def __init__(self, ground: LabGround, steering: float, untied: bool) -> None:
        car, model = ground.car.parameters, ground.model
        self._car, self._tires, self._mu, self._steering = car, ground.forces.rows, ground.forces.mu, steering
        self._laws = [axle for axle in tires_of(model).axles for _ in range(2)]
        self.has_peak = bool(self._tires["slides"].all())
        self._weight = car.mass * car.gravity
        self._x = np.repeat([car.front_axle_distance, -car.rear_axle_distance], 2)
        self._y = 0.5 * car.track_width * np.array([1.0, -1.0, 1.0, -1.0])
        springs = [model.jnt_stiffness[model.dof_jntid[tire["chain"][: tire["own_links"]]]] for tire in self._tires]
        gives = [(1.0 / own[own > 0.0]).sum() for own in springs] + 1.0 / self._tires["vertical_stiffness"]
        self._roll = self._y / gives  # [N] of the load of each, for a lean of 1 rad
        gear = gear_row(model)[0]
        lanes = 1 if untied else int(gear["lanes"])
        share = gear["share"][:, :lanes]
        self._share = share / np.abs(share).max(axis=0)  # of each force of the drive line, in those on the wheels
        self._ties, self._preload, self._ramp = (gear[name][1:lanes] for name in ("give", "preload", "ramp"))
        self._drag, self._damping = float(gear["drag"]), (not untied) * model.dof_damping[gear["spin_dof"]]
        self._steer(steering)

    def _steer(self, angle: float) -> None:
        self._arc = math.tan(angle) / self._car.wheelbase
        turned = np.arctan(self._car.wheelbase / (1.0 / self._arc - self._y[:2]))  # Ackermann
        self._cos, self._sin = np.cos([*turned, 0.0, 0.0]), np.sin([*turned, 0.0, 0.0])

    def begin(self, speed: float) -> FloatArray | None:
        """Return the unknowns at a low speed [m/s], by steering from straight ahead; None: there is no solution."""
        found: FloatArray | None = np.array([0.0, 1.0, *np.zeros(4 + self._share.shape[1])])
        turns = math.ceil(self._steering / _TURN)
        for angle in np.linspace(0.0, self._steering, turns + 1)[1:].tolist():
            self._steer(angle)
            found = None if found is None else self.solve(found, speed)
        return found

    def told(self, unknown: FloatArray, speed: float) -> tuple[float, float, float, float]:
        """Return speed, curvature, by how much a tire slides, negative: it does not, and the least load [N]."""
        wheels = self._wheels(unknown, speed)
        beyond = wheels.slip_speed * (1.0 - 1.0 / np.maximum(wheels.size, 1.0)) - BRISTLES_SLIDE
        sliding = np.where(self._tires["holds"] > 0, beyond, wheels.size - 1.0)
        return speed, float(unknown[1]), float(sliding.max()), float(wheels.load.min())

    def solve(self, guess: FloatArray, speed: float) -> FloatArray | None:
        """Return the unknowns at a speed [m/s] near a guess; None: there is no solution."""
        found, residual = guess, self._balance(guess, speed)
        for _ in range(_ROUNDS):
            error = np.abs(residual).max()
            if error < _EXACT:
                return found
            moved = [self._balance(found + step, speed) for step in _STEP * np.eye(len(found))]
            slopes = (np.array(moved).T - residual[:, np.newaxis]) / _STEP
            if not np.isfinite(slopes).all() or abs(np.linalg.det(slopes)) < 1e-300:
                return None
            way, share = np.linalg.solve(slopes, -residual), 1.0
            while np.abs(residual := self._balance(found + share * way, speed)).max() > (1.0 - 0.1 * share) * error:
                share *= 0.5
                if share < _LEAST_SHARE:
                    return None
            found = found + share * way
        return None

    def _wheels(self, unknown: FloatArray, speed: float) -> _Wheels:
        car, tires, slip = self._car, self._tires, unknown[2:6]
        yaw_rate = unknown[1] * self._arc * speed
        vx, vy = speed * math.cos(unknown[0]), speed * math.sin(unknown[0]) + yaw_rate * car.rear_axle_distance
        ax, ay = -yaw_rate * vy, yaw_rate * vx
        u, v = vx - yaw_rate * self._y, vy + yaw_rate * self._x
        forward, left = u * self._cos + v * self._sin, v * self._cos - u * self._sin
        load = self._loads(ax + self._drag * vx / car.mass, ay)
        held = np.maximum(load, _LEAST_LOAD * self._weight)
        shares = np.column_stack((slip, -np.arctan(left / forward))) / tires["peak_slip"]
        size = np.hypot(*shares.T) + 1e-12
        within = np.where(tires["holds"] > 0, np.minimum(size, 1.0), size)[:, np.newaxis] * tires["peak_slip"]
        sensed = [law.load_factor(each) for law, each in zip(self._laws, held.tolist(), strict=True)]
        grip = held * np.array(sensed) * self._mu / tires["peak"][:, 1]
        pulls = [law.longitudinal.force(ratio) for law, ratio in zip(self._laws, within[:, 0].tolist(), strict=True)]
        pushes = [law.lateral.force(angle) for law, angle in zip(self._laws, within[:, 1].tolist(), strict=True)]
        along, across = (grip / size * shares.T) * np.array([pulls, pushes])
        return _Wheels(
            along=along, across=across, load=load, surface=forward * (1.0 + slip), size=size,
            slip_speed=np.hypot(slip * forward, left), velocity=np.array([vx, vy]), acceleration=np.array([ax, ay]),
        )  # fmt: skip

    def _loads(self, ax: float, ay: float) -> FloatArray:
        """Return the load of each wheel [N]; negative of one that would lift."""
        car, height = self._car, self._car.center_of_gravity_height
        lever = np.repeat([car.rear_axle_distance, car.front_axle_distance], 2)
        pitch = np.repeat([-ax * height, ax * height], 2)
        gyroscopes = 4.0 * car.wheel_inertia / (car.mass * car.wheel_radius)
        stiffness = float(self._roll @ self._y)  # [N m/rad]
        lean = car.mass * ay * (height + gyroscopes) / (stiffness - self._weight * height)
        loads: FloatArray = 0.5 * car.mass * (car.gravity * lever + pitch) / car.wheelbase - self._roll * lean
        return loads

    def _balance(self, unknown: FloatArray, speed: float) -> FloatArray:
        """Return what is missing to each balance, over the weight, or over the speed."""
        car, wheels, forces = self._car, self._wheels(unknown, speed), unknown[6:] * self._weight
        pull = wheels.along * self._cos - wheels.across * self._sin
        push = wheels.along * self._sin + wheels.across * self._cos
        held = np.maximum(wheels.load, _LEAST_LOAD * self._weight)
        radius = self._tires["radius"] - 0.5 * held / self._tires["vertical_stiffness"]
        driven = self._share @ forces * car.wheel_radius / radius
        taken = wheels.along + self._tires["rolling_resistance"] * held + self._damping * wheels.surface / radius**2
        needed = car.mass * wheels.acceleration + self._drag * wheels.velocity
        body = pull.sum() - needed[0], push.sum() - needed[1], (self._x * push - self._y * pull).sum() / car.wheelbase
        ends = []
        for lane, tie in enumerate(self._ties, start=1):
            own = self._share[:, lane]
            rate = float(own @ (wheels.surface / radius)) * car.wheel_radius / speed
            if tie < 0.0:
                through = abs(float(driven[own != 0.0].sum()))
                most = 0.5 * (self._preload[lane - 1] / car.wheel_radius + self._ramp[lane - 1] * through)
                rate = (forces[lane] + most * math.tanh(rate / _SLIPS)) / self._weight
            ends.append(rate)
        return np.array([*(np.array([*body, *(taken - driven)]) / self._weight), *ends])


def stopping_distance(speed: float, mu: float, car: CarParameters) -> float:
    """Return the way of a stop [m] with mu g, or with the motor's greatest acceleration if that is less."""
    return speed**2 / (2.0 * min(mu * car.gravity, car.max_acceleration))
