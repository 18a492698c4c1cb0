"""No turn into what the car cannot stop before: a wished steering angle held to the paths that are free.

`stopping_paths.safe_speed` says that there is a way to stop; a planner that changes its mind may turn away from the
only one. So a wish is followed where, turning as it wishes for a moment and then straight on, the car could still stop,
or where a stop on the wished turn itself is free. Else the turn is reduced until it could, or, where no turn to that
side is free, the car keeps to the stopping path that is; and it brakes, for all these paths are those of a car that
does.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.kernels import kernel
from fg_mujoco.messages import FloatArray

from .friction_guard import GuardSettings, longitudinal_share
from .records import Record
from .stopping_paths import PRESENT, SPEEDS, TURNING, is_free, nearest, safe_speed

HELD = GuardSettings(most_left=0.6)
"""Of the guard of a car whose turns are held: it brakes and turns out at once, and braking unloads the rear tires."""

_SLACK = 0.2  # [m/s] a path is asked for from this much below the present speed: what a car that brakes lags behind
_TURN_SLACK = 0.4  # [m/s] the same for a stop on the wished turn, whose braking is planned with least
_ALIKE = 2  # shares of the grid: a turn that is so much less than wished counts as the wished one
_SLOWEST = 0.5  # [m/s] below it, any turn is allowed
_FIRMNESS = 2.0  # times the braking that a stop is planned with: as hard as the guard lets it


@kernel
def stay_in_sight(
    paths: Record,
    widened: FloatArray,
    scan: Record,
    odometry: Record,
    guard: Record,
    turns_held: bool,
    steering_angle: float,
    speed: float,
) -> tuple[float, float]:
    """Return the wish, steering angle [rad] and speed [m/s], held to what the car can stop within.

    Args:
      paths: of type PATHS.
      widened: readings (n,) [m], each widened by `paths.radius`.
      scan: of type SCAN.
      odometry: of type ODOMETRY.
      guard: of type GUARD.
      turns_held: whether the steering angle is held too, or the speed only.
      steering_angle: wished [rad], within the car's limit.
      speed: wished [m/s].
    """
    angle, now = odometry.steering_angle, odometry.speed
    in_sight, best = safe_speed(paths, widened, scan.angle_min, scan.angle_increment, now, angle)
    speed = min(speed, in_sight)
    if not turns_held or now <= _SLOWEST:
        return steering_angle, speed
    grip = paths.wheelbase * paths.lateral
    wished = now * now * math.tan(steering_angle) / grip
    share = _allowed_turn(paths, widened, scan, now, now * now * math.tan(angle) / grip, wished)
    if math.isnan(share):
        share = best if in_sight > 0.0 else wished
    if share == wished:
        return steering_angle, speed
    planned = paths.braking * longitudinal_share(abs(share))
    slower = now - _FIRMNESS * planned * guard.settings.speed_response
    return math.atan2(share * grip, now * now), min(speed, slower)


@kernel
def _allowed_turn(
    paths: Record, widened: FloatArray, scan: Record, now: float, present_share: float, wished: float
) -> float:
    """Return the share of the grip, nearest to the wished one, to turn with; NaN where no turn to that side is free."""
    side = 1 if wished > 0.0 else -1
    present, wanted = nearest(PRESENT, side * present_share), nearest(TURNING, abs(wished))
    for turning in range(max(wanted - _ALIKE, 0), len(TURNING)):
        if _free(paths.bearings, paths.distances, paths, widened, scan, side, present, now - _TURN_SLACK, turning):
            return wished
    for turning in range(wanted, -1, -1):
        if _free(paths.turn_bearings, paths.turn_distances, paths, widened, scan, side, present, now - _SLACK, turning):
            return wished if turning == wanted else float(side * TURNING[turning])
    return math.nan


@kernel
def _free(
    bearings: NDArray[np.float32],
    distances: NDArray[np.float32],
    paths: Record,
    widened: FloatArray,
    scan: Record,
    side: int,
    present: int,
    speed: float,
    turning: int,
) -> bool:
    """Return whether a path of one of the two tables is free, from the fastest speed of the grid up to `speed`."""
    fast = 0
    while fast < SPEEDS - 1 and paths.speeds[fast + 1] <= speed:
        fast += 1
    place = (present, fast, turning)
    return bool(is_free(widened, scan.angle_min, scan.angle_increment, side, bearings[place], distances[place]))
