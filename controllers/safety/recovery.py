"""Backing out: a car that stands where no way leads on goes back the way it came, and tries again, slowly.

The LiDAR does not see what is behind the car. But where it has come it can go back: the places of the rear axle are
kept, some metres of them, by dead reckoning, and followed backwards by pure pursuit. From there it tries once more, no
faster than it went back, so that it turns more sharply than when it first came; each time it goes back farther. When it
has tried often enough it stays where it is: that is a dead end. Once it has come on by a good way, it has forgotten. If
it does not move when it should go back, it lets it be.

Limits: what has come up behind the car meanwhile is not seen; a car that was put before a wall has no way back.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np

from fg_mujoco.errors import SettingsError
from fg_mujoco.kernels import kernel
from fg_mujoco.messages import require

from ..control.records import Record
from ..control.steering import arc_through

_POINTS = 96
_SPACING = 0.05  # [m] of the points of the trail, or what a tick makes of it
_REACH = 0.3  # [m] how far behind the rear axle is what it steers for


@dataclass(frozen=True, kw_only=True)
class BackingSettings:
    """When a car backs out, how far and how fast.

    Raises:
      SettingsError: a value that is not a positive number.
    """

    patience: float = 2.5  # [s] it stands before, the first time: what is in its way may move on
    patience_again: float = 0.25  # [s] when it has tried already
    distance: float = 1.5  # [m] the first time; twice as far the second time, and so on
    speed: float = 1.5  # [m/s] back, and on again
    tries: int = 3
    come_on: float = 2.0  # [m] beyond where it stood, along its way: then the tries are forgotten

    def __post_init__(self) -> None:
        positive = tuple(f.name for f in fields(self))
        require(self, lambda value: 0.0 < value < math.inf, "a positive number", positive, SettingsError)


TRAIL = np.dtype(
    [
        ("x", np.float64),  # [m] where the rear axle is, by dead reckoning from where it began
        ("y", np.float64),  # [m]
        ("heading", np.float64),  # [rad]
        ("points", np.float64, (_POINTS, 2)),  # [m] a ring: where it has been
        ("newest", np.int64),  # place of the last of them
        ("known", np.int64),  # how many of them there are
        ("on", np.float64),  # [m] that it is ahead of where it last stood, along its way
        ("stood", np.float64),  # [s]
        ("back", np.float64),  # [m] still to be backed
        ("tried", np.int64),
    ]
)
"""What is kept of the way behind; zero in the beginning."""


@kernel
def follow(trail: Record, settings: Record, speed: float, yaw_rate: float, period: float) -> None:
    """Note how far the car has come in the last tick.

    Args:
      trail: of type TRAIL, written to.
      settings: fields of BackingSettings.
      speed: present [m/s].
      yaw_rate: present [rad/s].
      period: of the tick [s].
    """
    way, turn = speed * period, yaw_rate * period
    if not math.isfinite(way + turn):  # whatever that was, where the car is now is not known
        trail.known = 0
        return
    trail.x += way * math.cos(trail.heading + 0.5 * turn)
    trail.y += way * math.sin(trail.heading + 0.5 * turn)
    trail.heading += turn
    if way > 0.0 and (trail.known == 0 or _distance(trail) >= _SPACING):
        trail.newest = (trail.newest + 1) % _POINTS
        trail.points[trail.newest, 0], trail.points[trail.newest, 1] = trail.x, trail.y
        trail.known = min(trail.known + 1, _POINTS)
    trail.back -= max(-way, 0.0)
    trail.on += way
    if trail.on > settings.come_on:
        trail.tried = 0


@kernel
def backs(trail: Record, settings: Record, stands: bool, found: bool, period: float) -> bool:
    """Say whether the car is to go back now, to where `angle_back` steers.

    Args:
      trail: of type TRAIL, written to.
      settings: fields of BackingSettings.
      stands: it does not move.
      found: there is a way on.
      period: of the tick [s].
    """
    backing = trail.back > 0.0
    trail.stood = trail.stood + period if stands and (backing or not found) else 0.0
    patience = settings.patience if trail.tried == 0 or backing else settings.patience_again
    if trail.stood + 0.5 * period >= patience:
        trail.back, trail.stood = 0.0, 0.0  # where it was going back, something is behind it
        if not backing and trail.tried < settings.tries:
            trail.tried += 1
            trail.back, trail.on = settings.distance * trail.tried, 0.0
    if trail.back <= 0.0:
        return False
    while trail.known > 0 and _distance(trail) < _REACH:
        trail.newest = (trail.newest - 1) % _POINTS
        trail.known -= 1
    if trail.known == 0:
        trail.back = 0.0
    return bool(trail.back > 0.0)


@kernel
def angle_back(trail: Record, wheelbase: float) -> float:
    """Return the steering angle [rad] on which the rear axle comes back to the newest point."""
    x, y = trail.points[trail.newest, 0] - trail.x, trail.points[trail.newest, 1] - trail.y
    cos, sin = math.cos(trail.heading), math.sin(trail.heading)
    return arc_through(cos * x + sin * y, cos * y - sin * x, wheelbase)


@kernel
def _distance(trail: Record) -> float:
    """Return how far the newest point is from the rear axle [m]."""
    x, y = trail.points[trail.newest, 0] - trail.x, trail.points[trail.newest, 1] - trail.y
    return math.hypot(x, y)
