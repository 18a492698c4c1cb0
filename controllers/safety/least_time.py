"""Least time: moves the points of a closed line, each along its normal, so that a lap takes less time.

    weight = quicken(places, normals, aside, weight, limiter, cornering_use, braking_use, max_speed)  # one move of all

1. The lap is that of the fastest speeds that a friction limiter allows, by one pass along the line and one against it.
   Going through both passes backwards gives the derivative of the lap time by the place of each point.
2. The move is least for that derivative and a multiple of the squared change of curvature, within the room of each
   point: a quadratic program on the ring of points (control.band_program).
3. The move, or a half or a quarter of it, is made where the lap gets shorter. The multiple grows where none is made,
   and where only a part is; else it falls.

Sources: those of the add-on drivers' line_optimizer, whose method this is, for a planner that does a part in each tick.

Limits: the line found is the best near the one that it began with. How fast wheels can be turned is not considered.
"""

from __future__ import annotations

import math

import numpy as np

from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.messages import FloatArray

from ..control.band_program import least_on_ring_into
from ..control.planner_settings import Record
from ..control.slip import lock_arc
from .friction_limiter import longitudinal_share

_ENTRIES = 33  # of the tables of what cornering leaves
_SMOOTHED = 3  # times that the derivative by the curvature is averaged over neighbours: .3 m for points .25 m apart
_LEAST_ROOM = 1e-3  # [m] to either side
_REGULAR = 1e-6
_LOCK_PRICE = 1.0  # [s m] of the squared curvature beyond
_LOCK_USE = 0.85  # share of the curvature at full lock without a price: the car corrects with the rest
_PRICE_OUTSIDE = 0.5  # [s/m] of the point that is furthest outside of its room
_MOST_MOVED = 0.3  # [m] of a point in a move
_WEAKEST, _STRONGEST = 1e-3, 1e6  # multiple of the squared change of curvature


@kernel
def quicken(
    places: FloatArray,
    normals: FloatArray,
    aside: FloatArray,
    weight: float,
    limiter: Record,
    cornering_use: float,
    braking_use: float,
    max_speed: float,
) -> float:
    """Move all points once where that makes the lap shorter, and return the multiple for the next move.

    Args:
      places: of the points of a closed line (n, 2) [m], about evenly apart, n at least 6.
      normals: to the left of each (n, 2).
      aside: how far to the left each is moved, at least and at most (n, 3) [m]; the first is written to.
      weight: multiple of the squared change of curvature.
      limiter: of type LIMITER.
      cornering_use: share of its cornering acceleration.
      braking_use: share of its braking.
      max_speed: [m/s].
    """
    n, car = len(places), limiter.car
    lateral, grip = cornering_use * limiter.lateral, limiter.mu * car.gravity
    accelerating, braking = np.empty(_ENTRIES), np.empty(_ENTRIES)
    for k in range(_ENTRIES):
        used = lateral * k / (_ENTRIES - 1.0) / grip
        accelerating[k] = limiter.accelerating * longitudinal_share(limiter, used, False)
        braking[k] = braking_use * limiter.braking * longitudinal_share(limiter, used, True)
    power = car.max_acceleration * car.power_limit_speed
    lock = _LOCK_USE * math.tan(lock_arc(limiter.slip, car)) / car.wheelbase
    bends, to, on, mean = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    speeds, by_bend, by_step = np.empty(n), np.empty(n), np.empty(n)
    here = aside[:, 0].copy()
    _measure(places, normals, here, bends, to, on)
    now = _PRICE_OUTSIDE * _outside(here, aside) + fastest_lap(
        bends, on, lateral, accelerating, braking, power, max_speed, lock, _LOCK_PRICE, speeds, by_bend, by_step
    )
    for k in range(n):
        mean[k] = 0.5 * (to[k] + on[k])
        by_bend[k] /= mean[k]
    for _ in range(_SMOOTHED):
        average(by_bend)
    # how each curvature grows by a move of the point before it, of its own, and of the next
    rows = np.empty((3, n))
    for k in range(n):
        rows[0, k], rows[2, k] = 1.0 / (to[k] * mean[k]), 1.0 / (on[k] * mean[k])
        rows[1, k] = bends[k] * bends[k] - rows[0, k] - rows[2, k]
    bands, gradient = np.empty((3, n)), np.empty(n)
    for k in range(n):
        before, after = k - 1 if k > 0 else n - 1, (k + 1) % n
        gradient[k] = (
            rows[0, after] * by_bend[after] * mean[after]
            + rows[1, k] * by_bend[k] * mean[k]
            + rows[2, before] * by_bend[before] * mean[before]
            - 0.5 * bends[k] * (by_step[k] * on[k] + by_step[before] * on[before])
        )
        bands[0, k] = _REGULAR + weight * (
            rows[0, after] ** 2 * mean[after] + rows[1, k] ** 2 * mean[k] + rows[2, before] ** 2 * mean[before]
        )
        bands[1, k] = weight * (rows[1, k] * rows[2, k] * mean[k] + rows[0, after] * rows[1, after] * mean[after])
        bands[2, k] = weight * rows[0, after] * rows[2, after] * mean[after]
    moved = _move(bands, gradient, here, aside)
    share, there = 1.0, np.empty(n)
    for _ in range(3):
        for k in range(n):
            there[k] = here[k] + share * moved[k]
        _measure(places, normals, there, bends, to, on)
        then = _PRICE_OUTSIDE * _outside(there, aside) + fastest_lap(
            bends, on, lateral, accelerating, braking, power, max_speed, lock, _LOCK_PRICE, speeds, by_bend, by_step
        )
        if then < now:
            aside[:, 0] = there
            return max((0.75 if share == 1.0 else 1.3) * weight, _WEAKEST)
        share *= 0.5
    return min(3.0 * weight, _STRONGEST)


@kernel
def _move(bands: FloatArray, gradient: FloatArray, here: FloatArray, aside: FloatArray) -> FloatArray:
    """Return how far each point moves (n,) [m]: the least of the quadratic function, within the room of each.

    Args:
      bands: of the matrix, as of `solve_ring`, (3, n).
      gradient: (n,).
      here: how far each has moved (n,) [m].
      aside: as of `quicken`.
    """
    n = len(gradient)
    low, high, moved = np.empty(n), np.empty(n), np.empty(n)
    for k in range(n):
        low[k] = min(max(aside[k, 1] - here[k], -_MOST_MOVED), _MOST_MOVED)
        high[k] = max(min(aside[k, 2] - here[k], _MOST_MOVED), low[k])
        if high[k] < low[k] + 2.0 * _LEAST_ROOM:
            middle = 0.5 * (low[k] + high[k])
            low[k], high[k] = middle - _LEAST_ROOM, middle + _LEAST_ROOM
    if not least_on_ring_into(bands, gradient, low, high, moved):
        moved[:] = 0.0
    return moved


@kernel
def _measure(
    places: FloatArray, normals: FloatArray, moved: FloatArray, bends: FloatArray, to: FloatArray, on: FloatArray
) -> None:
    """Write the curvatures [1/m] of a line that is moved, and the steps to each point and from it [m]; all (n,)."""
    n = len(places)
    x, y = np.empty(n), np.empty(n)
    for k in range(n):
        x[k], y[k] = places[k, 0] + moved[k] * normals[k, 0], places[k, 1] + moved[k] * normals[k, 1]
    for k in range(n):
        before, after = k - 1 if k > 0 else n - 1, (k + 1) % n
        to_x, to_y, on_x, on_y = x[k] - x[before], y[k] - y[before], x[after] - x[k], y[after] - y[k]
        to[k], on[k] = max(math.hypot(to_x, to_y), 1e-9), max(math.hypot(on_x, on_y), 1e-9)
        chord = max(math.hypot(to_x + on_x, to_y + on_y), 1e-9)
        bends[k] = 2.0 * (to_x * on_y - to_y * on_x) / (to[k] * on[k] * chord)
        if bends[k] == 0.0:
            bends[k] = 1e-12  # the derivative of the speed in a corner divides by it


@kernel
def average(values: FloatArray) -> None:
    """Move each value (n,) of a ring by half of the way to the middle of its neighbours; `values` is written to."""
    count = len(values)
    first, before = values[0], values[count - 1]
    for k in range(count):
        here = values[k]
        after = values[k + 1] if k + 1 < count else first
        values[k] = 0.5 * here + 0.25 * (before + after)
        before = here


@kernel
def _outside(moved: FloatArray, aside: FloatArray) -> float:
    """Return how far the point that is furthest outside of its room is outside [m]."""
    furthest = 0.0
    for k in range(len(moved)):
        furthest = max(furthest, aside[k, 1] - moved[k], moved[k] - aside[k, 2])
    return furthest


@kernel
def _left(table: FloatArray, lateral: float, most: float) -> tuple[float, float]:
    """Return what a table has at a lateral acceleration [m/s^2], and its slope; beyond the last entry 0."""
    position = lateral / most * (len(table) - 1)
    at = int(position)
    if at >= len(table) - 1:
        return 0.0, 0.0
    slope = table[at + 1] - table[at]
    return table[at] + (position - at) * slope, slope * (len(table) - 1) / most


@kernel
def fastest_lap(
    bends: FloatArray,
    steps: FloatArray,
    most: float,
    accelerating: FloatArray,
    braking: FloatArray,
    power: float,
    max_speed: float,
    lock: float,
    lock_price: float,
    speeds: FloatArray,
    by_bend: FloatArray,
    by_step: FloatArray,
) -> float:
    """Return the time of a lap [s] and the price of curvature beyond the lock, and write speeds and derivatives.

    Args:
      bends: curvatures (n,) [1/m].
      steps: from each point to the next (n,) [m].
      most: of Grip, like the next four.
      accelerating, braking, power, max_speed: of Grip.
      lock: greatest curvature without a price [1/m].
      lock_price: of the squared curvature beyond [s m].
      speeds: (n,) [m/s], written to.
      by_bend: derivative by each curvature (n,) [s m], written to.
      by_step: derivative by each step (n,) [s/m], written to.
    """
    n = len(bends)
    squared, limit = np.empty(n), np.empty(n)
    gained, lost = np.zeros(n, np.bool_), np.zeros(n, np.bool_)
    slowest = 0
    for i in range(n):
        limit[i] = squared[i] = min(max_speed * max_speed, most / max(abs(bends[i]), 1e-9))
        if limit[i] < limit[slowest]:
            slowest = i
    for j in range(n - 1):
        i = (slowest + j) % n
        ahead = (i + 1) % n
        push = _left(accelerating, abs(bends[i]) * squared[i], most)[0]
        reached = squared[i] + 2.0 * steps[i] * min(push, power / math.sqrt(squared[i]))
        if reached < squared[ahead]:
            squared[ahead], gained[ahead] = reached, True
    forward = squared.copy()
    for j in range(n - 1):
        ahead = (slowest - j) % n
        i = (ahead - 1) % n
        reached = squared[ahead] + 2.0 * steps[i] * _left(braking, abs(bends[ahead]) * squared[ahead], most)[0]
        if reached < squared[i]:
            squared[i], lost[i] = reached, True
    time = 0.0
    by_square = np.zeros(n)
    for i in range(n):
        ahead = (i + 1) % n
        here, there = math.sqrt(squared[i]), math.sqrt(squared[ahead])
        speeds[i], by_bend[i], by_step[i] = here, 0.0, 2.0 / (here + there)
        time += by_step[i] * steps[i]
        by_square[i] -= steps[i] / (here + there) ** 2 / here
        by_square[ahead] -= steps[i] / (here + there) ** 2 / there
    for j in range(n - 2, -1, -1):  # the passes, backwards
        ahead = (slowest - j) % n
        i = (ahead - 1) % n
        if lost[i]:
            left, slope = _left(braking, abs(bends[ahead]) * squared[ahead], most)
            twice = 2.0 * steps[i] * by_square[i]
            by_square[ahead] += by_square[i] + twice * slope * abs(bends[ahead])
            by_bend[ahead] += twice * slope * math.copysign(squared[ahead], bends[ahead])
            by_step[i] += 2.0 * left * by_square[i]
            by_square[i] = 0.0
    for j in range(n - 2, -1, -1):
        i = (slowest + j) % n
        ahead = (i + 1) % n
        if gained[ahead]:
            push, slope = _left(accelerating, abs(bends[i]) * forward[i], most)
            motor = power / math.sqrt(forward[i])
            twice = 2.0 * steps[i] * by_square[ahead]
            if motor < push:
                by_square[i] += by_square[ahead] - 0.5 * twice * motor / forward[i]
                push = motor
            else:
                by_square[i] += by_square[ahead] + twice * slope * abs(bends[i])
                by_bend[i] += twice * slope * math.copysign(forward[i], bends[i])
            by_step[i] += 2.0 * push * by_square[ahead]
            by_square[ahead] = 0.0
    for i in range(n):
        if limit[i] < max_speed * max_speed:
            by_bend[i] -= by_square[i] * limit[i] / bends[i]
        beyond = abs(bends[i]) - lock
        if beyond > 0.0:
            time += lock_price * beyond * beyond * steps[i]
            by_bend[i] += 2.0 * lock_price * math.copysign(beyond, bends[i]) * steps[i]
    return time
