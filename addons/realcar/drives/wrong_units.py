"""Recognises columns in another unit than is said, or of another sign: degrees, km/h, milliseconds, ticks."""

from __future__ import annotations

import math

import numpy as np

from fg_mujoco.messages import FloatArray

from .channels import PAUSE

_GREATEST_STEERING = 1.05  # [rad] no car of this kind steers further than 60 degrees
_GREATEST_DEGREES = 60.0
_GREATEST_SPEED = 30.0  # [m/s]
_GREATEST_YAW_RATE = 25.0  # [rad/s] a car that spins four times a second
_LONGEST_PERIOD = 0.6  # [s] of the median row
_SHORTEST_PERIOD = 5e-5  # [s]
_NEAR = 0.2  # of the logarithm of a ratio, by which a unit is recognised
_FEWEST = 20  # rows
_TO_THE_RIGHT = "it looks positive to the right, which needs a scale of -1: here left is positive"
_OPPOSITE = -0.5  # cosine between two columns that should turn alike, below which one of them has the other sign


def wrong_unit(name: str, values: FloatArray) -> str | None:
    """Return what is wrong with the numbers of a column alone, and the unit that they look like; None: nothing."""
    values = values[np.isfinite(values)]
    if not len(values):
        return None
    size = float(np.percentile(np.abs(values), 99.0))
    if name == "time":
        period = float(np.median(np.diff(values))) if len(values) > 1 else 0.02
        if period > _LONGEST_PERIOD:
            unit = "ms" if period < 1e3 else "us" if period < 5e5 else "ns"
            return f"a row every {period:g} s; it looks like {unit}"
        return f"a row every {period:g} s; it looks like h or min" if 0.0 < period < _SHORTEST_PERIOD else None
    if name == "steering" and size > _GREATEST_STEERING:
        unit = "deg" if size <= _GREATEST_DEGREES else "ticks of a servo, which need a scale and an offset"
        return f"reaches {size:.3g} rad; it looks like {unit}"
    if name in ("speed", "speed_command") and size > _GREATEST_SPEED:
        unit = "km/h" if size < 4.0 * _GREATEST_SPEED else "ticks or ERPM, which need a scale"
        return f"reaches {size:.3g} m/s; it looks like {unit}"
    if name == "yaw_rate" and size > _GREATEST_YAW_RATE:
        return f"reaches {size:.3g} rad/s; it looks like deg/s"
    if name == "yaw":
        jumps = np.abs(np.diff(values))
        jumps = jumps[jumps > 50.0]
        if len(jumps) and abs(float(np.median(jumps)) - 360.0) < 40.0:
            return f"jumps by {float(np.median(jumps)):.3g} rad; it looks like deg"
    return None


def disagreement(
    time: FloatArray, speed: FloatArray, yaw_rate: FloatArray, steering: FloatArray, pose: FloatArray | None
) -> tuple[str, str] | None:
    """Return which column disagrees with the others by a unit or a sign, and what it looks like; None: they agree.

    Time [s], speed [m/s], yaw rate [rad/s] and steering [rad] are (n,), the pose (n, 3) [m, m, rad].
    """
    rows = np.isfinite(time + speed + yaw_rate + steering)
    if pose is not None:
        rows &= np.isfinite(pose).all(axis=1)
    if np.count_nonzero(rows) < _FEWEST:
        return None
    time, speed, yaw_rate, steering = time[rows], speed[rows], yaw_rate[rows], steering[rows]
    goes_on = np.diff(time) <= PAUSE
    seconds = np.where(goes_on, np.diff(time), 0.0)
    if pose is not None:
        x, y, yaw = pose[rows].T
        steps = np.where(goes_on, np.hypot(np.diff(x), np.diff(y)), 0.0)
        driven = float(np.abs(speed[:-1]) @ seconds)
        if float(steps.sum()) > 1.0 and driven > 0.0:
            ratio = driven / float(steps.sum())
            for unit, factor in (("km/h", 3.6), ("mm/s", 1e3), ("cm/s", 1e2)):
                if abs(math.log(ratio / factor)) < _NEAR:
                    return "speed", f"is {ratio:.3g} times that of the poses; it looks like {unit}"
            if abs(math.log(ratio * 1e3)) < _NEAR:
                return "x", f"moves {1.0 / ratio:.3g} times as far as the speed says; it looks like mm"
        signed = np.where(goes_on, np.diff(np.unwrap(yaw)), 0.0)
        turns = np.abs(signed)
        steady = turns < 1.0
        turned, by_gyro = float(turns[steady].sum()), float(np.abs(yaw_rate[:-1]) @ seconds)
        if turned > 1.0 and by_gyro > 0.0 and abs(math.log(by_gyro / turned / (180.0 / math.pi))) < _NEAR:
            return "yaw_rate", f"is {by_gyro / turned:.3g} times that of the poses; it looks like deg/s"
        if turned > 1.0 and _cosine(signed[steady], (yaw_rate[:-1] * seconds)[steady]) < _OPPOSITE:
            return "yaw_rate", f"turns the other way than the poses; {_TO_THE_RIGHT}"
    moving = (np.abs(speed) > 1.0) & (np.abs(yaw_rate) > 0.1)
    if np.count_nonzero(moving) < _FEWEST:
        return None
    slope = float(np.median(np.abs(np.tan(np.clip(steering[moving], -1.3, 1.3)) * speed[moving] / yaw_rate[moving])))
    degrees = float(np.median(np.abs(steering[moving] * speed[moving] / yaw_rate[moving])))
    if degrees > 8.0 and np.percentile(np.abs(steering), 99.0) > 0.6:  # [m] of a wheelbase of 1:10: 0.2 to 0.6
        return "steering", f"says a wheelbase of {degrees:.3g} m; it looks like deg"
    if slope < 0.02:
        return "yaw_rate", f"says a wheelbase of {slope:.2g} m; it looks like deg/s"
    if _cosine(steering[moving] * speed[moving], yaw_rate[moving]) < _OPPOSITE:
        return "steering", f"turns the other way than the yaw rate; {_TO_THE_RIGHT}"
    return None


def _cosine(first: FloatArray, second: FloatArray) -> float:
    """Return the cosine of the angle between two signals; 0 where one of them is nothing."""
    size = math.sqrt(float(first @ first) * float(second @ second))
    return float(first @ second) / size if size > 0.0 else 0.0
