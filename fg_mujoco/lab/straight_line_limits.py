"""Closed forms of braking and accelerating straight ahead, of a car with one motor and open differentials."""

from __future__ import annotations

import math

from fg_mujoco.controllers.safety.friction_limiter import FrictionLimiter

from ..messages import CarParameters
from ..vehicle.car import WHEELS
from ..vehicle.vehicle import Vehicle
from .lab_ground import TICK


def even_torque_limit(mu: float, car: CarParameters, direction: int, spin_inertia: float = 0.0) -> float:
    """Return the greatest acceleration straight ahead with the same torque on all wheels [m/s^2].

    Moments about the heavier axle: the lighter one carries m (g l - a h') / b and passes on m a / 2. Wheels that spin
    up push the nose up, and down in braking: h' = h + 4 I / (m r).

    Args:
      mu: friction coefficient [-].
      car: parameters.
      direction: -1 braking (the rear axle is lighter), 1 accelerating.
      spin_inertia: I, of a wheel [kg m^2]; 0 for wheels that keep their speed.
    """
    lever = car.front_axle_distance if direction < 0 else car.rear_axle_distance
    height = car.center_of_gravity_height + 4.0 * spin_inertia / (car.mass * car.wheel_radius)
    return car.gravity * lever / car.wheelbase / (height / car.wheelbase + 0.5 / mu)


def held_share(car: CarParameters, speed: float = 0.0, slope: float = math.inf) -> float:
    """Return the share of an asked acceleration that the car has on average, its set point held for a tick [-].

    The servo, of time constant t, catches up with the set point in the tick T: t / T (1 - exp(-T / t)). A tire slips by
    a ratio that goes with its force, so that the wheels of a car at the speed v take up a part c = v / (t g slope) of
    what is asked at once, and give it back as the force falls. With t' = t (1 + c) and e = exp(-T / t') this makes
    t / T (1 - e) / (1 - e c / (1 + c)).

    Args:
      car: parameters.
      speed: of the car [m/s].
      slope: force over load for each unit of slip ratio [-]; infinite: tires that do not slip.
    """
    lag = car.speed_time_constant
    taken = speed / (lag * car.gravity * slope)
    left = math.exp(-TICK / (lag * (1.0 + taken)))
    return lag / TICK * (1.0 - left) / (1.0 - left * taken / (1.0 + taken))


def stopping_distance(speed: float, mu: float, car: CarParameters, how: str, slope: float = math.inf) -> float:
    """Return the closed form of a stop [m].

    held: mu g. full: twice the rear axle's friction. limiter: the friction limiter's braking, the mean over each
    tick, of which tires that slip leave less (`held_share`, at two thirds of the speed: the mean over the way). It
    grows over the load's transfer time, of which one tick is there at once.

    Args:
      speed: at its beginning [m/s].
      mu: friction coefficient [-].
      car: parameters.
      how: "held", "full" or "limiter".
      slope: of `held_share`.
    """
    if how == "held":
        return speed**2 / (2.0 * mu * car.gravity)
    if how == "full":
        return speed**2 / (2.0 * even_torque_limit(mu, car, -1))
    limiter = FrictionLimiter(car, mu)
    braking = limiter.braking * held_share(car, speed / 1.5, slope) / held_share(car)
    growing = limiter.settings.load_transfer_time - TICK
    distance: float = speed**2 / (2.0 * braking) + 0.5 * speed * growing - braking * growing**2 / 24.0
    return distance


def wheel_inertia() -> float:
    """Return the spin inertia of a wheel [kg m^2], off the compiled model."""
    model = Vehicle.load().compile()
    return float(model.body_inertia[model.body(f"{WHEELS[0]}_wheel").id, 1])
