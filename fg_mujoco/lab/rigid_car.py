"""Closed forms of a rigid car on a steady circle, by Newton and Coulomb: where its tires let go, and how they slide.

The law v = sqrt(g mu b / tan d) is that of a point on the circle of the rear axle. A car on four wheels differs, at
R = b / tan d and ay = v^2 / R:

- its centre of gravity, lr ahead of the rear axle, needs ay lr / R pointing backwards besides ay across. Rolling
  tires push across their own heading, so that the front ones must give all of it: S_f sin d_f = m ay lr / R. (That no
  drive is needed is the balance of power: on a steady circle nothing gains speed, and what rolls loses none.)
- the outer front wheel, which carries the most, is turned in less than the middle one;
- the backward acceleration leans the car on its front axle.

All three are of second order in d, so that the law is exact on wide circles; at the car's lock the front axle lets go
2.5 to 3 % below it. How an axle's load is shared by its two tires does not count but through the wheels' angles: under
Coulomb's law what one tire loses the other gains.

    onset(mu=0.7, steering=0.4, car=parameters)  # 0.9725
"""

from __future__ import annotations

import math

import mujoco
import numpy as np

from fg_mujoco.controllers.control.speed import friction_speed

from ..messages import CarParameters, FloatArray
from ..vehicle.car import WHEELS, element_id
from ..vehicle.tire_slip import BRISTLES_SLIDE, SLIDING_SPEED
from ..vehicle.tires import tires_of


def tire_loads(k: float, mu: float, steering: float, car: CarParameters) -> FloatArray:
    """Return the loads of a rigid car's tires at `k` times the law's speed, in the order of WHEELS. Shape (4,) [N].

    Moments about the axles and about the middle of the car, both axles rolling alike. 0 where a wheel would lift; what
    is left to the other one is then wrong by as much.

    Args:
      k: speed of the rear axle over the law's [-].
      mu: friction coefficient [-].
      steering: angle, left positive [rad].
      car: parameters.
    """
    across = k * k * mu * car.gravity
    backwards = across * car.rear_axle_distance * math.tan(abs(steering)) / car.wheelbase
    levers = np.array([car.rear_axle_distance, car.front_axle_distance])
    pitch = backwards * car.center_of_gravity_height * np.array([1.0, -1.0])
    axles = car.mass * (car.gravity * levers + pitch) / car.wheelbase
    moved = math.copysign(car.mass * across * car.center_of_gravity_height / car.track_width, steering)
    loads: FloatArray = np.maximum(np.column_stack((axles - moved, axles + moved)).ravel() / 2.0, 0.0)
    return loads


def axle_use(k: float, mu: float, steering: float, car: CarParameters) -> tuple[float, float]:
    """Return the share of its friction that the front and the rear axle use, 1 at the limit; arguments as above."""
    steering = abs(steering)
    loads = tire_loads(k, mu, steering, car)
    radius, half = car.wheelbase / math.tan(steering), 0.5 * car.track_width
    across = k * k * mu * car.gravity
    angles = np.arctan(car.wheelbase / (radius - np.array([half, -half])))  # Ackermann
    front = loads[:2] / loads[:2].sum()  # share of the axle's force, at the limit that of its load
    backwards = car.mass * across * car.rear_axle_distance / radius
    front_force = backwards / float(front @ np.sin(angles))
    rear_force = car.mass * across - front_force * float(front @ np.cos(angles))
    return front_force / (mu * float(loads[:2].sum())), rear_force / (mu * float(loads[2:].sum()))


def onset(mu: float, steering: float, car: CarParameters) -> float:
    """Return the k at which the first axle of a rigid car has used up its friction [-]; arguments as above."""
    low, high = 0.5, 1.5
    while high - low > 1e-6:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if max(axle_use(middle, mu, steering, car)) < 1.0 else (low, middle)
    return 0.5 * (low + high)


def held_curvature(steering: float, model: mujoco.MjModel) -> float:
    """Return the curvature that a car drives at the end of its bristles, over that of its steering angle [-].

    Both axles then run at the slip angle of their peak; 1 on MuJoCo's contacts, which have none.

    Args:
      steering: angle [rad].
      model: of the car.
    """
    tires = tires_of(model)
    if tires.is_contact:
        return 1.0
    front, rear = (axle.lateral.peak_slip for axle in tires.axles)
    steering = abs(steering)
    return (math.tan(steering - front) + math.tan(rear)) * math.cos(rear) / math.tan(steering)


def grip_onset(mu: float, steering: float, car: CarParameters, model: mujoco.MjModel) -> float:
    """Return the k at which an axle lets go [-]: `onset`, on the wider circle that the bristles make of it."""
    return onset(mu, steering, car) / math.sqrt(held_curvature(steering, model))


def creep(k: float, mu: float, steering: float, car: CarParameters, model: mujoco.MjModel) -> float:
    """Return how fast the contact point of the most loaded tire creeps while it holds [m/s].

    MuJoCo's contact is regularised: it slows a contact point by c v, and lets it accelerate by r F. In a car that needs
    the acceleration a of its tires c v = a + r F, with r = (1 - d) / d / effective mass / impratio (MuJoCo
    documentation, "Computation", on friction constraints; the numbers are those of models/f1tenth.xml). Near the limit
    F is mu times the load. The bristles of the law `coulomb` hold without creep.
    """
    if not tires_of(model).is_contact:
        return 0.0
    pair = element_id(model, mujoco.mjtObj.mjOBJ_PAIR, f"{WHEELS[0]}_tire")
    wheel = element_id(model, mujoco.mjtObj.mjOBJ_BODY, f"{WHEELS[0]}_wheel")
    impedance = float(model.pair_solimp[pair, 1])
    slowing = -float(model.pair_solreffriction[pair, 1]) / impedance
    softness = (1.0 - impedance) / impedance * float(model.body_invweight0[wheel, 0]) / float(model.opt.impratio)
    force = mu * float(tire_loads(k, mu, steering, car).max())
    return k * k * (mu * car.gravity + softness * force) / slowing


def sliding_onset(mu: float, steering: float, car: CarParameters, model: mujoco.MjModel) -> float:
    """Return the k at which the front tires slide [-]: pass SLIDING_SPEED, or BRISTLES_SLIDE; arguments as in `creep`.

    Up to the onset k0 they creep. Beyond, the car's curvature stays (k0 / k)^2 of the one that its front wheels point
    along, and they cross their way at v sin d (1 - (k0 / k)^2), above what they creep. So this k is not `onset`: it
    lies below where creep alone passes SLIDING_SPEED, on grippy ground, and above on slippery ground, where the car
    has to run wide by what creep leaves of it.

    Bristles do not creep, and cross their way from `held_curvature` on. Those of the inner front wheel, which rolls
    slower than the middle of its axle by the yaw rate times half the track, take up as much less where both front
    wheels are at the end of their bristles.
    """
    limit = onset(mu, steering, car)
    law = friction_speed(steering, mu, car.wheelbase, car.gravity)
    front = tires_of(model).front
    threshold = SLIDING_SPEED if front is None else BRISTLES_SLIDE
    bent = 0.0 if front is None else front.lateral.peak_slip * 0.5 * car.track_width * math.tan(abs(steering))
    low, high = 0.5, 3.0
    while high - low > 1e-6:
        k = 0.5 * (low + high)
        wide = k * law * math.sin(abs(steering)) * max(held_curvature(steering, model) - (limit / k) ** 2, 0.0)
        held = creep(min(k, limit), mu, steering, car, model) + bent * k * law / car.wheelbase
        slides = held + wide > threshold
        low, high = (low, k) if slides else (k, high)
    return 0.5 * (low + high)
