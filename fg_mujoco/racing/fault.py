"""Assigns the fault for a contact of two cars by a fixed rule."""

from __future__ import annotations

import math

import numpy as np

from ..messages import CarParameters, FloatArray
from ..simulation.telemetry import TELEMETRY

ALIKE = 0.1
"""[m/s] by less than which two cars came nearer alike."""

_X, _Y, _HEADING, _YAW_RATE = (TELEMETRY.index(name) for name in ("x_m", "y_m", "heading_rad", "yaw_rate_rad_s"))
_VX, _VY = (TELEMETRY.index(name) for name in ("vx_m_s", "vy_m_s"))


def approach(
    first: FloatArray, second: FloatArray, parameters: tuple[CarParameters, CarParameters], *, lead: float
) -> tuple[int, float]:
    """Return the car at fault for a contact, 0 the first or 1 the second, and the speed of approach [m/s].

    At fault is the car that came nearer faster, along the line between the middles of both chassis; where both came
    nearer alike, the one behind. So it is the car behind that runs into one ahead, the one that comes over into one
    beside it, and the one that reverses into one that stands.

    Args:
      first: a car's row of telemetry of the tick in which they first touch, (len(TELEMETRY),).
      second: the other's.
      parameters: of both cars.
      lead: how far the first is ahead along the course [m]; negative: behind.
    """
    (own, own_velocity), (other, other_velocity) = map(_middle, (first, second), parameters)
    apart = other - own
    towards = apart / max(float(np.hypot(*apart)), 1e-9)
    nearer = (float(own_velocity @ towards), float(-other_velocity @ towards))  # of each towards the other [m/s]
    alike = abs(nearer[0] - nearer[1]) <= ALIKE
    first_is = lead < 0.0 if alike else nearer[0] > nearer[1]
    return 0 if first_is else 1, nearer[0] + nearer[1]


def _middle(row: FloatArray, car: CarParameters) -> tuple[FloatArray, FloatArray]:
    """Return position [m] and velocity [m/s] of the middle of a car's chassis at the start of a tick, (2,) each."""
    ahead = 0.5 * car.length - car.rear_overhang  # of base_link
    cos, sin = math.cos(row[_HEADING]), math.sin(row[_HEADING])
    vx, vy = row[_VX], row[_VY] + row[_YAW_RATE] * ahead
    return row[[_X, _Y]] + ahead * np.array([cos, sin]), np.array([vx * cos - vy * sin, vx * sin + vy * cos])
