"""Recovery: a car that stands although its frontier is known, or without one, reverses along its path and tries again.

The LiDAR does not see behind the car, but the car can go back where it has come from: along the path of the local map,
by pure pursuit. The car then tries again, no faster than it reversed, so that it turns more sharply than at first. Each
attempt reverses farther than the one before. After the last attempt the car stays where it is: that is a dead end.
After `come_on` of driving forward beyond where it stood the attempts are reset. If the car does not move when it is
commanded to reverse, the attempt ends.

Limits: obstacles behind the car are not seen. A car that was placed before a wall has no path to reverse along.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fg_mujoco.compiled.kernels import kernel

from ..control.planner_settings import POSITIVE, Record, Settings, setting, setting_of_car
from ..control.steering import arc_through, saturate
from ..perception.local_map import PATH


@dataclass(frozen=True, kw_only=True)
class RecoverySettings(Settings):
    """When a car reverses, how far and how fast.

    Raises:
      SettingsError: a value that is not a positive number.
    """

    patience: float = setting(
        2.5, "s", "the car stands before the first attempt; an obstacle may move on", POSITIVE
    )
    patience_known: float = setting(0.8, "s", "the same if a frontier is known and nothing moves, and later", POSITIVE)
    distance: float = setting_of_car(
        1.5, "m", "of the first attempt; twice as far the second time, and so on", POSITIVE
    )
    speed: float = setting_of_car(1.5, "m/s", "back, and on again", POSITIVE)
    tries: int = setting(3, "", "attempts", POSITIVE)
    come_on: float = setting_of_car(2.0, "m", "forward from where it stood: then the attempts are reset", POSITIVE)
    reach: float = setting_of_car(0.3, "m", "from the rear axle to the point of the path that it steers for", POSITIVE)


RECOVERY = np.dtype(
    [
        ("stood", np.float64),  # [s]
        ("stood_at", np.float64),  # [m] along the path, when an attempt last began
        ("back", np.float64),  # [m] still to be reversed
        ("tried", np.int64),
    ]
)
"""Type of what is kept from tick to tick; zero at the beginning."""


@kernel
def reverses(
    memory: Record, settings: Record, world: Record, speed: float, stands: bool, found: bool, waits: bool, period: float
) -> bool:
    """Return whether the car is to reverse now, with the steering angle of `angle_back`.

    Args:
      memory: of type RECOVERY, written to.
      settings: fields of RecoverySettings.
      world: of type LOCAL_MAP.
      speed: present [m/s].
      stands: the car does not move.
      found: there is a way to a frontier.
      waits: no frontier is known, or something moves.
      period: of the tick [s].
    """
    reversing = memory.back > 0.0
    memory.back -= max(-speed * period, 0.0)
    if world.along > memory.stood_at + settings.come_on:
        memory.tried = 0
    memory.stood = memory.stood + period if stands and (reversing or not found) else 0.0
    waits = reversing or (waits and memory.tried == 0)
    if memory.stood + 0.5 * period >= (settings.patience if waits else settings.patience_known):
        memory.back, memory.stood = 0.0, 0.0  # if it was reversing, something behind it holds it
        if not reversing and memory.tried < settings.tries:
            memory.tried += 1
            memory.back, memory.stood_at = settings.distance * memory.tried, world.along
    return bool(memory.back > 0.0)


@kernel
def angle_back(world: Record, settings: Record, car: Record) -> float:
    """Return the steering angle [rad] back along the path of a local map; NaN: it is no longer than the reach."""
    cos, sin = math.cos(world.heading), math.sin(world.heading)
    for back in range(world.known):
        point = world.path[(world.newest - back) % PATH]
        x, y = point[0] - world.x, point[1] - world.y
        if math.hypot(x, y) >= settings.reach:
            angle = arc_through(cos * x + sin * y, cos * y - sin * x, car.wheelbase)
            return saturate(angle, car.max_steering_angle)
    return math.nan
