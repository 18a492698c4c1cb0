"""How fast the car may go so that it can still stop within what the scan shows.

For a grid of speeds and of shares of the grip used for turning, the path of a car that turns with that share and
brakes with what cornering leaves is worked out once. A scan is then looked up: a path is free when each of its points
is nearer than the reading in its direction, in a scan whose readings are widened by a disc that covers the car's front.
The fastest speed with a free path is safe.

A stop is planned with less than half of the cornering acceleration a, although the tires brake harder, because at a
blind corner the car must be able to turn as well as to stop: braking with a / 2 takes v^2 / a, which is the radius of
the circle on which it can turn aside at that speed when the corner opens.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.messages import CarParameters, FloatArray

from .friction_guard import FrictionGuard, longitudinal_share

_TURNING = np.array([0.0, 0.15, 0.3, 0.45, 0.6, 0.7, 0.8])  # shares of the cornering grip to turn aside with
_PRESENT = np.array([-0.75, -0.5, -0.25, 0.0, 0.25, 0.5, 0.75, 1.0])  # shares in use when the scan is taken
_LEAST_SPEED = 0.5  # [m/s]
_SPEEDS = 48
_POINTS = 24
_STEP = 0.01  # [s] of the integration


@dataclass(frozen=True, kw_only=True)
class StoppingSettings:
    """What a stop is planned with."""

    braking_share: float = 0.43  # of the cornering acceleration: a half, and a margin for the turning in
    reaction: float = 0.045  # [s] a tick, and the servo's lag
    margin: float = 0.55  # [m] ahead of the bumper at a stop: what turning in takes
    clearance: float = 0.02  # [m] round the car's front


class StoppingPaths:
    """The fastest speed from which the car can stop in sight.

    Args:
      car: parameters of the car.
      guard: what the tires hold.
      max_speed: fastest speed of interest [m/s].
      settings: what a stop is planned with.
    """

    def __init__(
        self, car: CarParameters, guard: FrictionGuard, max_speed: float, settings: StoppingSettings | None = None
    ) -> None:
        self.settings = settings or StoppingSettings()
        # a disc over the car's front corners, its centre a quarter of the width behind the bumper
        self.radius = math.hypot(0.5 * car.width, 0.25 * car.width) + self.settings.clearance
        self._lateral = guard.lateral
        self._wheelbase = car.wheelbase
        self.speeds = np.linspace(_LEAST_SPEED, max(max_speed, _LEAST_SPEED), _SPEEDS)
        self._bearings, self._distances = _paths(car, guard, self.speeds, self.settings)
        self._beams = lru_cache(maxsize=4)(self._look_up)

    def safe_speed(
        self, widened: FloatArray, angle_min: float, angle_increment: float, speed: float, steering_angle: float
    ) -> float:
        """Return the greatest speed [m/s] with a free stopping path, 0 where there is none.

        Args:
          widened: readings (n,) [m], each widened by `radius`.
          angle_min: bearing of the first [rad].
          angle_increment: between them [rad].
          speed: present [m/s].
          steering_angle: present [rad].
        """
        share = speed * speed * math.tan(steering_angle) / (self._wheelbase * self._lateral)
        fastest = 0.0
        for side in (1, -1):
            present = int(np.argmin(np.abs(_PRESENT - side * share)))
            beams = self._beams(len(widened), angle_min, angle_increment, side)[present]
            free = (widened[beams] > self._distances[present]).all(axis=-1).any(axis=-1)
            fastest = max(fastest, float(np.max(self.speeds[free], initial=0.0)))
        return fastest

    def _look_up(self, count: int, angle_min: float, angle_increment: float, side: int) -> NDArray[np.intp]:
        """Return the beam nearest to each path point, for paths turning to `side`: 1 left, -1 right."""
        beams = np.round((side * self._bearings - angle_min) / angle_increment)
        return np.clip(beams, 0, count - 1).astype(np.intp)


def _paths(
    car: CarParameters, guard: FrictionGuard, speeds: FloatArray, settings: StoppingSettings
) -> tuple[FloatArray, FloatArray]:
    """Return bearings [rad] and distances [m] of the points of all stopping paths that turn left.

    They are those of the disc over the car's front, seen from the LiDAR now. Shape (present, speeds, turning, points).
    """
    present, start, turning = (grid.ravel() for grid in np.meshgrid(_PRESENT, speeds, _TURNING, indexing="ij"))
    tightest = math.tan(car.max_steering_angle) / car.wheelbase
    speed = start.copy()
    curvature = np.clip(present * guard.lateral / start**2, -tightest, tightest)
    x, y, heading, travelled = (np.zeros_like(start) for _ in range(4))
    trace = [(x, y, heading, travelled)]
    braking = min(settings.braking_share * guard.lateral, guard.braking)
    time = 0.0
    while np.any(speed > 0.0) and time < 20.0:
        if time >= settings.reaction:
            wanted = np.minimum(turning * guard.lateral / np.maximum(speed, 0.1) ** 2, tightest)
            curvature = curvature + (wanted - curvature) * (1.0 - np.exp(-speed * _STEP / guard.yaw_lag))
            used = np.minimum(np.abs(curvature) * speed**2 / guard.lateral, 0.999)  # below 1, or it never stops
            speed = np.maximum(speed - braking * longitudinal_share(used) * _STEP, 0.0)
        distance = speed * _STEP
        heading = heading + curvature * distance
        x, y = x + distance * np.cos(heading), y + distance * np.sin(heading)
        travelled = travelled + distance
        time += _STEP
        trace.append((x, y, heading, travelled))

    disc = car.length - car.rear_overhang - 0.25 * car.width  # ahead of the rear axle
    margin = settings.margin + 0.25 * car.width
    bearings, distances = np.empty((2, len(start), _POINTS))
    for path, (x, y, heading, travelled) in enumerate(np.moveaxis(np.array(trace), 2, 0).transpose(0, 2, 1)):
        along = np.linspace(0.0, travelled[-1] + margin, _POINTS)
        beyond = np.maximum(along - travelled[-1], 0.0)  # the margin, straight on from where the car stops
        ahead = disc + beyond
        direction = np.interp(along, travelled, heading)
        lidar_x = np.interp(along, travelled, x) + ahead * np.cos(direction) - car.lidar_offset
        lidar_y = np.interp(along, travelled, y) + ahead * np.sin(direction)
        bearings[path], distances[path] = np.arctan2(lidar_y, lidar_x), np.hypot(lidar_x, lidar_y)
    shape = (len(_PRESENT), len(speeds), len(_TURNING), _POINTS)
    return bearings.reshape(shape), distances.reshape(shape)
