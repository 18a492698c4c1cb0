"""Braking trajectories: how fast the car may go so that it can still stop within what the scan shows.

For a grid of speeds and of shares of the grip used for turning, the trajectory of a car that turns with that share
and brakes with what cornering leaves is computed once. With each scan the trajectories are looked up: one is free
when each of its points is nearer than the reading in its direction, in a scan whose readings are widened by a disc
that covers the car's front. The fastest speed with a free trajectory is safe.

A stop is planned with less than half of the cornering acceleration a, although the tires can brake harder: at a blind
corner the car must be able to turn as well as to stop. Braking with a / 2 takes v^2 / a, which is the radius of the
circle on which the car can turn aside at that speed when the corner opens.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.compiled.kept import kept, made_by
from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.messages import CarParameters, FloatArray

from ..control.planner_settings import (
    FROM_ZERO,
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
from ..control.slip import lock_arc, path_lag
from .friction_limiter import FrictionLimiter, FrictionLimiterSettings, longitudinal_share, stable_share

_TURNING = np.array([0.0, 0.15, 0.3, 0.45, 0.6, 0.7, 0.8])  # shares of the cornering grip to turn aside with
_PRESENT = np.array([-0.75, -0.5, -0.25, 0.0, 0.25, 0.5, 0.75, 1.0])  # shares in use when the scan is taken
_SPEEDS, _MOST_SPEEDS = 48, 128
_SPEED_STEP = 0.16  # [m/s] greatest between two speeds, as long as there are no more than the most
_POINTS = 24
_STEP = 0.01  # [s] of the integration
_LONGEST_STOP = 2000  # steps
_GRID = (len(_PRESENT), _MOST_SPEEDS, len(_TURNING), _POINTS)


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


TRAJECTORIES = np.dtype(
    [
        ("radius", np.float64),  # [m] of the disc that covers the car's front
        ("lateral", np.float64),  # [m/s^2] that may be used in cornering
        ("wheelbase", np.float64),  # [m]
        ("count", np.int64),  # of the speeds that are looked at
        ("speeds", np.float64, (_MOST_SPEEDS,)),  # [m/s] slowest first, and behind the last of them 0
        # of the disc's centre along the trajectories that turn left, as the LiDAR sees it from where the car is now
        ("bearings", np.float32, _GRID),  # [rad]
        ("distances", np.float32, _GRID),  # [m]
    ]
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
        """Return the greatest speed [m/s] with a free trajectory; for the arguments see the kernel `safe_speed`."""
        return safe_speed(self.record[0], widened, angle_min, angle_increment, speed, steering_angle)


@kernel
def safe_speed(
    trajectories: Record,
    widened: FloatArray,
    angle_min: float,
    angle_increment: float,
    speed: float,
    steering_angle: float,
) -> float:
    """Return the greatest speed [m/s] with a free braking trajectory, 0 where there is none.

    Args:
      trajectories: of type TRAJECTORIES.
      widened: readings (n,) [m], each widened by `trajectories.radius`.
      angle_min: bearing of the first [rad].
      angle_increment: between them [rad].
      speed: present [m/s].
      steering_angle: present [rad].
    """
    share = speed * speed * math.tan(steering_angle) / (trajectories.wheelbase * trajectories.lateral)
    if len(widened) == 0:
        return 0.0
    to_left, to_right = _nearest(_PRESENT, share), _nearest(_PRESENT, -share)
    for fast in range(trajectories.count - 1, -1, -1):
        for side in (1, -1):
            present = to_left if side == 1 else to_right
            for turning in range(len(_TURNING)):
                bearings = trajectories.bearings[present, fast, turning]
                distances = trajectories.distances[present, fast, turning]
                if _is_free(widened, angle_min, angle_increment, side, bearings, distances):
                    return float(trajectories.speeds[fast])
    return 0.0


@kernel
def _is_free(
    widened: FloatArray,
    angle_min: float,
    angle_increment: float,
    side: int,
    bearings: NDArray[np.float32],
    distances: NDArray[np.float32],
) -> bool:
    """Return whether each point of a trajectory to `side` (1 left, -1 right) is nearer than the reading there."""
    for point in range(_POINTS - 1, -1, -1):  # the far ones first: those are the ones that fail
        index = np.rint((side * bearings[point] - angle_min) / angle_increment)
        beam = int(min(len(widened) - 1.0, max(0.0, index)))
        if not widened[beam] > distances[point]:
            return False
    return True


@kernel
def _nearest(grid: FloatArray, value: float) -> int:
    """Return the index in `grid` of what is nearest to `value`."""
    best = 0
    for index in range(1, len(grid)):
        if abs(grid[index] - value) < abs(grid[best] - value):
            best = index
    return best


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
    row = np.array([record_values(settings)], record_type(BrakingSettings))
    given = limiter.record[0], row[0], table["speeds"][0, :count]
    key = made_by(_all_trajectories, *(each.tobytes() for each in given))
    table["bearings"], table["distances"] = kept(
        "trajectories", key, lambda: _all_trajectories(*given), lambda made: made[0].shape == _GRID
    )
    table.flags.writeable = False
    return table


@kernel
def _all_trajectories(limiter: Record, settings: Record, speeds: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return bearings [rad] and distances [m] of the points of all braking trajectories that turn left. Shape _GRID."""
    bearings, distances = np.zeros(_GRID), np.zeros(_GRID)
    trace = np.empty((_LONGEST_STOP + 1, 4))
    for present in range(len(_PRESENT)):
        for fast in range(len(speeds)):
            for turning in range(len(_TURNING)):
                steps = _stop(limiter, settings, speeds[fast], _PRESENT[present], _TURNING[turning], trace)
                index = (present, fast, turning)
                _spread_points(limiter.car, settings, trace[: steps + 1], bearings[index], distances[index])
    return bearings, distances


@kernel
def _stop(limiter: Record, settings: Record, speed: float, present: float, turning: float, trace: FloatArray) -> int:
    """Write x [m], y [m], heading [rad] and way [m] of the rear axle at each step of a stop; return how many steps.

    The car starts at `speed` [m/s] with the share `present` of the cornering grip in use and turns to the share
    `turning` once it has reacted.
    """
    tightest = math.tan(lock_arc(limiter.slip, limiter.car)) / limiter.car.wheelbase
    braking = min(settings.braking_share * limiter.lateral, limiter.braking)
    curvature = min(max(present * limiter.lateral / speed**2, -tightest), tightest)
    x, y, heading, way = 0.0, 0.0, 0.0, 0.0
    trace[0, 0], trace[0, 1], trace[0, 2], trace[0, 3] = x, y, heading, way
    for step in range(_LONGEST_STOP):
        if step * _STEP >= settings.reaction:
            wanted = min(turning * limiter.lateral / max(speed, 0.1) ** 2, tightest)
            lag = limiter.yaw_lag
            if limiter.slip.needs_slip_angle:
                lag += path_lag(limiter.slip, speed)
            curvature += (wanted - curvature) * (1.0 - math.exp(-speed * _STEP / lag))
            used = min(abs(curvature) * speed**2 / limiter.lateral, 0.999)  # below 1, or it never stops
            held = braking * longitudinal_share(limiter, used, True)
            if limiter.slip.needs_slip_angle:
                held = min(held, stable_share(limiter, 1.0, used, speed) * limiter.braking)
            speed = max(speed - held * _STEP, 0.0)
        distance = speed * _STEP
        heading += curvature * distance
        x += distance * math.cos(heading)
        y += distance * math.sin(heading)
        way += distance
        trace[step + 1, 0], trace[step + 1, 1], trace[step + 1, 2], trace[step + 1, 3] = x, y, heading, way
        if speed == 0.0:
            return step + 1
    return _LONGEST_STOP


@kernel
def _spread_points(
    car: Record, settings: Record, trace: FloatArray, bearings: FloatArray, distances: FloatArray
) -> None:
    """Write where the LiDAR sees the disc over the car's front at points evenly spread over a stop and its margin.

    Args:
      car: of type CAR_RECORD.
      settings: fields of BrakingSettings.
      trace: of the rear axle, (steps, 4), see `_stop`.
      bearings: (points,) [rad], written to.
      distances: (points,) [m], written to.
    """
    disc = car.length - car.rear_overhang - 0.25 * car.width  # ahead of the rear axle
    margin = settings.margin + 0.25 * car.width
    way = trace[-1, 3]
    step = 0
    for point in range(_POINTS):
        along = point * (way + margin) / (_POINTS - 1)
        while step < len(trace) - 2 and trace[step + 1, 3] <= along:
            step += 1
        before, after = trace[step], trace[step + 1]
        part = min((along - before[3]) / (after[3] - before[3]), 1.0) if after[3] > before[3] else 1.0
        x = before[0] + part * (after[0] - before[0])
        y = before[1] + part * (after[1] - before[1])
        heading = before[2] + part * (after[2] - before[2])
        ahead = disc + max(along - way, 0.0)  # the margin is straight on from where the car stops
        x += ahead * math.cos(heading) - car.lidar_offset
        y += ahead * math.sin(heading)
        bearings[point], distances[point] = math.atan2(y, x), math.hypot(x, y)
