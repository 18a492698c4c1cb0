"""The steering of a drive: how the angle of the front wheels follows the commands.

The angle follows gain * command + offset, late by a delay, with a first-order lag and the servo's rate.
"""

from __future__ import annotations

import math

import numpy as np

from fg_mujoco.compiled.kernels import inlined, kernel
from fg_mujoco.messages import FloatArray

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
        _follow(self._knots + delay, targets, gain * self._slopes, self._time, lag, self._rate, out)
        return out


@kernel
def _follow(
    knots: FloatArray, targets: FloatArray, slopes: FloatArray, time: FloatArray, lag: float, rate: float,
    out: FloatArray,
) -> None:  # fmt: skip
    """Write the angle at each time, exact whenever the targets change: between two knots each has a constant slope."""
    piece, now = max(np.searchsorted(knots, time[0], "right") - 1, 0), time[0]
    angle = targets[piece] + slopes[piece] * (now - knots[piece])
    for i in range(len(time)):
        while now < time[i]:
            until = time[i]
            if piece + 1 < len(knots):
                until = min(until, knots[piece + 1])
            target = targets[piece] + slopes[piece] * (now - knots[piece])
            angle = _turned(angle, target, slopes[piece], lag, rate, until - now)
            now = until
            if piece + 1 < len(knots) and now >= knots[piece + 1]:
                piece += 1
        out[i] = angle


@inlined
def _turned(angle: float, target: float, slope: float, lag: float, rate: float, seconds: float) -> float:
    """Return the angle after some time; a servo with a greatest rate has a target that stays."""
    left, away = seconds, target - angle
    if slope == 0.0 and abs(away) > rate * lag:
        turning = min(left, (abs(away) - rate * lag) / rate)
        angle += math.copysign(rate * turning, away)
        left -= turning
    if lag == 0.0:
        return target + slope * seconds if left > 0.0 else angle
    end = target + slope * (seconds - lag)
    return end + (angle - target + slope * lag) * math.exp(-left / lag)
