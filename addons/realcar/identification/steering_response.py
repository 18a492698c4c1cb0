"""The steering of a drive: how the angle of the front wheels follows the commands.

The angle follows gain * command + offset, late by a delay, with a first-order lag and the servo's rate.
"""

from __future__ import annotations

import math

import numpy as np

from fg_mujoco.messages import FloatArray
from fg_mujoco.native import core

from ..drives.channels import Channel


class Steering:
    """The steering of a drive: from commands, each held until the next one, to the angle of the front wheels.

    Commands are in [rad], `time` (n,) [s] is the grid's, `limit` [rad] what the front wheels reach, `rate` [rad/s] the
    servo's. Measured angles are not `held`, but linear in between.
    """

    def __init__(self, commands: Channel, time: FloatArray, *, limit: float, rate: float, held: bool) -> None:
        angles = commands.values[:, 0]
        steps = np.diff(commands.time)
        self._time, self._rate, self._limit = time, rate, limit if held else np.inf
        before = min(commands.time[0], time[0]) - 1.0  # [s]: the first one holds from long ago
        self._knots = np.concatenate(([before], commands.time))
        self._values = np.concatenate((angles[:1], angles))
        self._slopes = np.zeros(len(self._knots))
        if not held:
            self._slopes[1:-1] = np.diff(angles) / steps

    def angles(
        self, gain: float, offset: float, lag: float, delay: float, *, limit: float | None = None
    ) -> FloatArray:
        """Return the angle of the front wheels on the grid (n,) [rad]; `limit` in place of the own one [rad]."""
        limit = self._limit if limit is None or math.isinf(self._limit) else limit
        out = np.empty(len(self._time))
        targets = np.clip(gain * self._values + offset, -limit, limit)
        core.follow_targets((self._knots + delay, targets, gain * self._slopes), self._time, lag, self._rate, out)
        return out
