"""Recovery: a car that stands although its frontier is known, or without one, reverses along its path and tries again.

The LiDAR does not see behind the car, but the car can go back where it has come from: along the path of the local map,
by pure pursuit. The car then tries again, no faster than it reversed, so that it turns more sharply than at first. Each
attempt reverses farther than the one before. After the last attempt the car stays where it is: that is a dead end.
After `come_on` of driving forward beyond where it stood the attempts are reset. If the car does not move when it is
commanded to reverse, the attempt ends.

Limits: obstacles behind the car are not seen. A car that was placed before a wall has no path to reverse along.

The work is done in native/controllers/safety/recovery.cpp.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fg_mujoco.native import core, record

from ..control.planner_settings import POSITIVE, Settings, setting, setting_of_car


@dataclass(frozen=True, kw_only=True)
class RecoverySettings(Settings):
    """When a car reverses, how far and how fast.

    Raises:
      SettingsError: a value that is not a positive number.
    """

    patience: float = setting(2.5, "s", "the car stands before the first attempt; an obstacle may move on", POSITIVE)
    patience_known: float = setting(0.8, "s", "the same if a frontier is known and nothing moves, and later", POSITIVE)
    distance: float = setting_of_car(
        1.5, "m", "of the first attempt; twice as far the second time, and so on", POSITIVE
    )
    speed: float = setting_of_car(1.5, "m/s", "back, and on again", POSITIVE)
    tries: int = setting(3, "", "attempts", POSITIVE)
    come_on: float = setting_of_car(2.0, "m", "forward from where it stood: then the attempts are reset", POSITIVE)
    reach: float = setting_of_car(0.3, "m", "from the rear axle to the point of the path that it steers for", POSITIVE)


RECOVERY = record(
    "Recovery",
    [
        ("stood", np.float64),  # [s]
        ("stood_at", np.float64),  # [m] along the path, when an attempt last began
        ("back", np.float64),  # [m] still to be reversed
        ("tried", np.int64),
    ],
)
"""Type of what is kept from tick to tick; zero at the beginning."""

reverses, angle_back = core.reverses, core.angle_back
