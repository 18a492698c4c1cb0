"""Recovery: a car that stands without a frontier reverses along the path it came by, and tries again, slowly.

The LiDAR does not see behind the car, but the car can go back where it has come from. The positions of the rear axle
are kept by dead reckoning, for 4.8 m of path at most, and followed backwards by pure pursuit. The car then tries again,
no faster than it reversed, so that it turns more sharply than at first. Each attempt reverses farther than the one
before. After the last attempt the car stays where it is: that is a dead end. After `come_on` of driving forward beyond
where it stood the attempts are reset. If the car does not move when it is commanded to reverse, the attempt ends.

Limits: obstacles behind the car are not seen. A car that was placed before a wall has no path to reverse along.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fg_mujoco.compiled.kernels import kernel

from ..control.planner_settings import POSITIVE, Record, Settings, setting, setting_of_car
from ..control.steering import arc_through

_POINTS = 96  # of the path that are kept


@dataclass(frozen=True, kw_only=True)
class RecoverySettings(Settings):
    """When a car reverses, how far and how fast.

    Raises:
      SettingsError: a value that is not a positive number.
    """

    patience: float = setting(
        2.5, "s", "the car stands before the first attempt; an obstacle may move on", POSITIVE
    )
    patience_known: float = setting(0.8, "s", "the same if a frontier is known and nothing moves", POSITIVE)
    patience_again: float = setting(0.45, "s", "the same before later attempts", POSITIVE)
    distance: float = setting_of_car(
        1.5, "m", "of the first attempt; twice as far the second time, and so on", POSITIVE
    )
    speed: float = setting_of_car(1.5, "m/s", "back, and on again", POSITIVE)
    tries: int = setting(3, "", "attempts", POSITIVE)
    come_on: float = setting_of_car(2.0, "m", "forward from where it stood: then the attempts are reset", POSITIVE)
    spacing: float = setting_of_car(0.05, "m", "of the points of the path, or what a tick makes of it", POSITIVE)
    reach: float = setting_of_car(0.3, "m", "from the rear axle to the point of the path that it steers for", POSITIVE)


PATH_HISTORY = np.dtype(
    [
        ("x", np.float64),  # [m] of the rear axle, by dead reckoning from where it began
        ("y", np.float64),  # [m]
        ("heading", np.float64),  # [rad]
        ("points", np.float64, (_POINTS, 2)),  # [m] a ring buffer of positions of the rear axle
        ("newest", np.int64),  # index of the last of them
        ("known", np.int64),  # how many of them there are
        ("on", np.float64),  # [m] ahead of where the car last stood, along its path
        ("stood", np.float64),  # [s]
        ("back", np.float64),  # [m] still to be reversed
        ("tried", np.int64),
    ]
)
"""Type of what is kept of the path behind the car; zero at the beginning."""


@kernel
def extend_history(history: Record, settings: Record, speed: float, yaw_rate: float, period: float) -> None:
    """Add the motion of the last tick to the path history.

    Args:
      history: of type PATH_HISTORY, written to.
      settings: fields of RecoverySettings.
      speed: present [m/s].
      yaw_rate: present [rad/s].
      period: of the tick [s].
    """
    way, turn = speed * period, yaw_rate * period
    if not math.isfinite(way + turn):  # where the car is now is not known
        history.known = 0
        return
    history.x += way * math.cos(history.heading + 0.5 * turn)
    history.y += way * math.sin(history.heading + 0.5 * turn)
    history.heading += turn
    if way > 0.0 and (history.known == 0 or _distance(history) >= settings.spacing):
        history.newest = (history.newest + 1) % _POINTS
        history.points[history.newest, 0], history.points[history.newest, 1] = history.x, history.y
        history.known = min(history.known + 1, _POINTS)
    history.back -= max(-way, 0.0)
    history.on += way
    if history.on > settings.come_on:
        history.tried = 0


@kernel
def reverses(history: Record, settings: Record, stands: bool, found: bool, waits: bool, period: float) -> bool:
    """Return whether the car is to reverse now, with the steering angle of `angle_along_history`.

    Args:
      history: of type PATH_HISTORY, written to.
      settings: fields of RecoverySettings.
      stands: the car does not move.
      found: there is a way to a frontier.
      waits: no frontier is known, or something moves.
      period: of the tick [s].
    """
    reversing = history.back > 0.0
    history.stood = history.stood + period if stands and (reversing or not found) else 0.0
    patience = settings.patience if waits or reversing else settings.patience_known
    if history.tried > 0 and not reversing:
        patience = settings.patience_again
    if history.stood + 0.5 * period >= patience:
        history.back, history.stood = 0.0, 0.0  # if it was reversing, something behind it holds it
        if not reversing and history.tried < settings.tries:
            history.tried += 1
            history.back, history.on = settings.distance * history.tried, 0.0
    if history.back <= 0.0:
        return False
    while history.known > 0 and _distance(history) < settings.reach:
        history.newest = (history.newest - 1) % _POINTS
        history.known -= 1
    if history.known == 0:
        history.back = 0.0
    return bool(history.back > 0.0)


@kernel
def angle_along_history(history: Record, wheelbase: float) -> float:
    """Return the steering angle [rad] on which the rear axle reverses to the newest point of the path."""
    x, y = history.points[history.newest, 0] - history.x, history.points[history.newest, 1] - history.y
    cos, sin = math.cos(history.heading), math.sin(history.heading)
    return arc_through(cos * x + sin * y, cos * y - sin * x, wheelbase)


@kernel
def _distance(history: Record) -> float:
    """Return the distance of the newest point of the path from the rear axle [m]."""
    x, y = history.points[history.newest, 0] - history.x, history.points[history.newest, 1] - history.y
    return math.hypot(x, y)
