"""The grip of a car with two tracks on its tires: its g-g diagram, as what is left ahead and back in a corner.

    grip = double_track_grip(setup.first)

At an acceleration a forward and y to the left, each wheel has the load

    M (g c -+ a h / L) / 2 -+ M c y h / w

with c the axle's share of the weight, L the wheelbase, w the track width and h the height of the centre of gravity.
Open differentials give each wheel M a / 4; a shaft holds more, which is a reserve here. With what its ellipse leaves,
the tires of an axle together must reach
M c y. The greatest a at which both axles do, and no wheel slides by its drive alone, is found by bisection. A tire's
peak falls with its load as its set says.

Source: the double-track model in D. Brayshaw and M. Harrison, A quasi steady state approach to race car lap simulation,
Proc. IMechE D 219, 2005. Left out: the roll stiffness of each axle, which moves the load aside in other shares; air.
"""

from __future__ import annotations

import math

import numpy as np

from fg_mujoco.errors import SettingsError
from fg_mujoco.messages import CarParameters, FloatArray
from fg_mujoco.racing.entries import Entry
from fg_mujoco.vehicle.tires import Tires

from ..line_optimizer import Grip

_ENTRIES = 65  # of the tables
_HALVINGS = 50


def double_track_grip(entry: Entry) -> Grip:
    """Return what the car of an entry can do on its tires and floor, up to its greatest commanded speed.

    Raises:
      SettingsError: so much grip that the car would lift a wheel.
    """
    car, friction = entry.car.parameters, entry.tires_mu
    tires = entry.tire_set.on(friction)
    share = 1.0 if tires.peak is None else friction / tires.peak
    most = _greatest(lambda lateral: _holds(car, tires, friction, share, 0.0, lateral), 2.0 * friction * car.gravity)
    if not most > 0.0:
        raise SettingsError(f"mu is {friction!r}, with which the car holds no corner; accepted: more friction")
    laterals = np.linspace(0.0, most, _ENTRIES).tolist()
    tables = [
        np.array([_longitudinal(car, tires, friction, share, sign, lateral) for lateral in laterals])
        for sign in (1, -1)
    ]
    power = car.max_acceleration * min(car.power_limit_speed, 1e6)
    return Grip(
        lateral=most, accelerating=tables[0], braking=tables[1], power=power,
        max_speed=min(float(entry.max_speed), car.max_speed),
    )  # fmt: skip


def _longitudinal(car: CarParameters, tires: Tires, friction: float, share: float, sign: int, lateral: float) -> float:
    """Return the greatest acceleration ahead (sign 1) or back (-1) that is left at a lateral one [m/s^2]."""
    return _greatest(lambda a: _holds(car, tires, friction, share, sign * a, lateral), car.max_acceleration)


def _greatest(holds: object, most: float) -> float:
    """Return the greatest number up to `most` for which a function holds, which it does up to some number."""
    low, high = 0.0, most
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if holds(middle) else (low, middle)  # type: ignore[operator]
    return low


def _holds(car: CarParameters, tires: Tires, friction: float, share: float, ahead: float, lateral: float) -> bool:
    """Return whether the tires hold accelerations ahead and lateral [m/s^2]."""
    moved = ahead * car.center_of_gravity_height / car.wheelbase
    drive = 0.25 * car.mass * abs(ahead)
    for axle, (lever, sign) in enumerate(((car.rear_axle_distance, -1.0), (car.front_axle_distance, 1.0))):
        weight = lever / car.wheelbase
        middle = 0.5 * car.mass * (car.gravity * weight + sign * moved)
        aside = car.mass * weight * lateral * car.center_of_gravity_height / car.track_width
        total = 0.0
        for load in (middle - aside, middle + aside):
            if load < 0.0:
                return False
            along, across = _peaks(tires, axle, friction, share, load)
            if drive > along * load:
                return False
            total += across * load * math.sqrt(1.0 - (drive / max(along * load, 1e-9)) ** 2)
        if total < car.mass * weight * lateral:
            return False
    return True


def _peaks(tires: Tires, axle: int, friction: float, share: float, load: float) -> tuple[float, float]:
    """Return the greatest forces over the load along and across of a tire at a load [N]."""
    if tires.peak is None:
        return friction, friction
    own = tires.axles[axle]
    factor = share * own.load_factor(max(load, 1e-6))
    return factor * own.longitudinal.peak, factor * own.lateral.peak


def acceleration_left(grip: Grip, lateral: FloatArray, *, braking: bool) -> FloatArray:
    """Return the greatest acceleration ahead, or back, at lateral accelerations (n,) [m/s^2]; 0 beyond the greatest."""
    table = grip.braking if braking else grip.accelerating
    places = np.linspace(0.0, grip.lateral, len(table))
    return np.asarray(np.interp(np.abs(lateral), places, table, right=0.0))
