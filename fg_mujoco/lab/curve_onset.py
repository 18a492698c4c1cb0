"""Closed forms of the law for tires with a curve: a single-track car on a steady circle, each axle two tires.

An axle under the load W, of which the share t has moved from the inner to the outer tire, has the greatest side force
W p f with its curve's peak p and the factor of its load sensitivity s,

    f = (W / 2 F0)^-s ((1 + t)^(1 - s) + (1 - t)^(1 - s)) / 2

On a circle of constant speed both axles need the same force over load A = a / g, the front one 1 / cos d of it. This
gives their slip angles a_f and a_r, and with them c, the curvature of the rear axle's path over tan d / b,

    c = (tan(d - a_f) + tan a_r) cos a_r / tan d,   k^2 = (A / mu) / c

So k is the law's with the grip that is used in place of mu, on the circle that is driven in place of that of the
steering angle. The first axle passes its peak where A reaches it. Before it, k may have a greatest value, the critical
speed, beyond which an oversteering car spins. Where an understeering car runs so wide that c falls to 0 first, steering
by d brings its tires to their peak at no speed.

Not in it: the drive that holds the speed against the drag of the slip angles. It moves load to the rear axle, and adds
a slip ratio to the light inner wheels.
"""

from __future__ import annotations

import math

import numpy as np

from ..messages import CarParameters, FloatArray
from ..vehicle.tires import AxleTires, Law, Tires
from .rigid_car import tire_loads

_GRIPS = 1000  # values of A up to the peak
_SLIPS = 2000  # values of a curve's slip angle up to its peak
_WIDE = 1e-3  # [rad] steering of a circle so wide that no load moves along the car


def axle_factor(axle: AxleTires, load: float, moved: float) -> float:
    """Return an axle's greatest side force over its load and its curve's peak [-].

    Args:
      axle: its tires.
      load: of both tires [N].
      moved: share of the load that has moved from the inner to the outer tire, 0 to 1.
    """
    power = 1.0 - axle.load_sensitivity
    shared: float = 0.5 * ((1.0 + moved) ** power + (1.0 - moved) ** power)
    return axle.load_factor(0.5 * load) * shared


def curve_onset(tires: Tires, mu: float, steering: float, car: CarParameters) -> float:
    """Return the k at which the first axle passes its peak, or at which the car spins [-]; inf: at no speed.

    Args:
      tires: with a peak.
      mu: the least peak, which planners are told [-].
      steering: angle [rad].
      car: parameters; where its centre of gravity is on the ground, no load moves.
    """
    assert tires.least_peak is not None
    steering, scale = abs(steering), mu / tires.least_peak
    needs = (1.0 / math.cos(steering), 1.0)
    limit = min(
        _greatest(axle, place, car, scale * axle.lateral.peak / need)
        for place, (axle, need) in enumerate(zip(tires.axles, needs, strict=True))
    )
    grips = np.linspace(0.0, limit, _GRIPS + 1)[1:]
    front, rear = (
        _slip_angles(axle.lateral, need * grips / (scale * _factors(axle, place, car, grips)))
        for place, (axle, need) in enumerate(zip(tires.axles, needs, strict=True))
    )
    curvature = (np.tan(steering - front) + np.tan(rear)) * np.cos(rear) / math.tan(steering)
    if (curvature <= 0.0).any():
        return math.inf
    return math.sqrt(float((grips / mu / curvature).max()))


def _factors(axle: AxleTires, place: int, car: CarParameters, grips: FloatArray) -> FloatArray:
    """Return the factor of an axle, 0 the front one, at some A."""
    loads = [tire_loads(1.0, float(grip), _WIDE, car)[2 * place : 2 * place + 2] for grip in grips]
    return np.array([axle_factor(axle, float(of.sum()), float((of[1] - of[0]) / of.sum())) for of in loads])


def _greatest(axle: AxleTires, place: int, car: CarParameters, peak: float) -> float:
    """Return the A at which an axle, whose curve reaches `peak`, has used it up."""
    low, high = 0.0, 2.0 * peak
    while high - low > 1e-9:
        middle = 0.5 * (low + high)
        holds = middle < peak * float(_factors(axle, place, car, np.array([middle]))[0])
        low, high = (middle, high) if holds else (low, middle)
    return low


def _slip_angles(curve: Law, forces: FloatArray) -> FloatArray:
    """Return the slip angles, up to the peak's, at which a curve has some forces over the load."""
    slips = np.linspace(0.0, curve.peak_slip, _SLIPS + 1)
    found: FloatArray = np.interp(forces, [curve.force(float(slip)) for slip in slips], slips)
    return found
