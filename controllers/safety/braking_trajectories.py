"""Braking trajectories: how fast the car may go so that it can still stop within what the scan shows.

For a grid of speeds and of shares of the grip used for turning, the trajectory of a car that turns with that share
and brakes with what cornering leaves is computed once. With each scan the trajectories are looked up: one is free
when each of its points is nearer than the reading in its direction, in a scan whose readings are widened by a disc
that covers the car's front. The fastest speed with a free trajectory is safe.

A stop is planned with less than half of the cornering acceleration a, although the tires can brake harder: at a blind
corner the car must be able to turn as well as to stop. Braking with a / 2 takes v^2 / a, which is the radius of the
circle on which the car can turn aside at that speed when the corner opens.

The work is done in native/controllers/safety/braking_trajectories.cpp.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.kept import kept
from fg_mujoco.messages import CarParameters, FloatArray
from fg_mujoco.native import core, record

from ..control.planner_settings import (
    FROM_ZERO,
    POSITIVE,
    SHARE,
    Settings,
    for_car,
    record_type,
    record_values,
    setting,
    setting_of_car,
)
from .friction_limiter import FrictionLimiter, FrictionLimiterSettings

_SPEEDS, _MOST_SPEEDS = 48, 128
_SPEED_STEP = 0.16  # [m/s] greatest between two speeds, as long as there are no more than the most
_GRID = (8, _MOST_SPEEDS, 7, 24)  # shares of the grip in use, speeds, shares of the grip to turn with, points


@dataclass(frozen=True, kw_only=True)
class BrakingSettings(Settings):
    """Inputs of a planned stop.

    Raises:
      SettingsError: a share that is not above 0 and at most 1; a time or a length that is negative or not finite; a
        speed that is not positive.
    """

    braking_share: float = setting(
        0.43, "", "share of the cornering acceleration: a half, less a margin for turning in", SHARE
    )
    reaction: float = setting(0.045, "s", "a tick and the servo's lag", FROM_ZERO)
    margin: float = setting_of_car(0.55, "m", "ahead of the bumper at a stop: what turning in takes", FROM_ZERO)
    clearance: float = setting_of_car(0.02, "m", "round the car's front", FROM_ZERO)
    least_speed: float = setting_of_car(0.5, "m/s", "slowest speed that is looked at", POSITIVE)


TRAJECTORIES = record(
    "Trajectories",
    [
        ("radius", np.float64),  # [m] of the disc that covers the car's front
        ("lateral", np.float64),  # [m/s^2] that may be used in cornering
        ("wheelbase", np.float64),  # [m]
        ("count", np.int64),  # of the speeds that are looked at
        ("speeds", np.float64, (_MOST_SPEEDS,)),  # [m/s] slowest first, and behind the last of them 0
        # of the disc's centre along the trajectories that turn left, as the LiDAR sees it from where the car is now
        ("bearings", np.float32, _GRID),  # [rad]
        ("distances", np.float32, _GRID),  # [m]
    ],
)
"""Type of the table of all braking trajectories of a car: one megabyte and a half."""


class BrakingTrajectories:
    """The fastest speed from which the car can stop in sight.

    Args:
      car: parameters of the car.
      limiter: what the tires hold.
      max_speed: fastest speed of interest [m/s].
      settings: what a stop is planned with.

    Attributes:
      radius: by which readings are to be widened [m].
      speeds: the speeds that are looked at [m/s].
      record: the table, shape (1,), of type TRAJECTORIES, read-only. Objects made with equal arguments share it.
    """

    def __init__(
        self, car: CarParameters, limiter: FrictionLimiter, max_speed: float, settings: BrakingSettings | None = None
    ) -> None:
        self.settings = for_car(settings or BrakingSettings(), car)
        self.record = _table(car, limiter.mu, limiter.settings, max_speed, self.settings)
        self.radius = float(self.record["radius"][0])
        self.speeds: FloatArray = self.record["speeds"][0, : int(self.record["count"][0])]

    def safe_speed(
        self, widened: FloatArray, angle_min: float, angle_increment: float, speed: float, steering_angle: float
    ) -> float:
        """Return the greatest speed [m/s] with a free braking trajectory, 0 where there is none.

        Args:
          widened: readings (n,) [m], each widened by `radius`.
          angle_min: bearing of the first [rad].
          angle_increment: between them [rad].
          speed: present [m/s].
          steering_angle: present [rad].
        """
        return core.safe_speed(self.record[0], widened, angle_min, angle_increment, speed, steering_angle)


@lru_cache(maxsize=8)
def _table(
    car: CarParameters,
    mu: float,
    limiter_settings: FrictionLimiterSettings,
    max_speed: float,
    settings: BrakingSettings,
) -> NDArray[np.void]:
    """Return the table of one car, shape (1,), of type TRAJECTORIES, read-only."""
    limiter = FrictionLimiter(car, mu, limiter_settings)
    table = np.zeros(1, TRAJECTORIES)
    # a disc over the car's front corners, its centre a quarter of the width behind the bumper
    table["radius"] = math.hypot(0.5 * car.width, 0.25 * car.width) + settings.clearance
    table["lateral"], table["wheelbase"] = limiter.lateral, car.wheelbase
    top = max(min(max_speed, car.max_speed), settings.least_speed)
    steps = math.ceil((top - settings.least_speed) / _SPEED_STEP)
    table["count"] = count = min(max(steps + 1, _SPEEDS), _MOST_SPEEDS)
    table["speeds"][0, :count] = np.linspace(settings.least_speed, top, count)
    row = np.array([record_values(settings)], record_type(BrakingSettings, native=True))
    given = limiter.record[0], row[0], table["speeds"][0, :count]
    key = (core.SOURCES, *(each.tobytes() for each in given))
    table["bearings"], table["distances"] = kept(
        "trajectories", key, lambda: _all_trajectories(given), lambda made: made[0].shape == _GRID
    )
    table.flags.writeable = False
    return table


def _all_trajectories(given: tuple[Any, Any, FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Return bearings [rad] and distances [m] of the points of all braking trajectories that turn left. Shape _GRID."""
    bearings, distances = np.zeros(_GRID), np.zeros(_GRID)
    core.all_trajectories(*given, bearings.ravel(), distances.ravel())
    return bearings, distances
