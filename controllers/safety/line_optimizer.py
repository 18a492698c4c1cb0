"""The fastest closed line within a band: of least curvature, or of least lap time.

    step, weight = 0, 0.0
    while step < STEPS:
        line, most = begin_step(line, step, spacing)                       # points evenly apart
        normals = normals_of(line)
        low, high = ...                                                    # room to move along them [m], within `most`
        step, weight = improve(line, normals, (low, high), step, weight, grip)    # one move of all points

Who calls this knows the room beside the line: of the map's walls, or of the walls that the LiDAR saw in the first lap.

1. Least curvature is a quadratic program on the ring of points (control.band_program), as second differences of the
   places are linear in the moves. As steps count as unchanged, this rewards a shorter line, too. The first steps have
   few points, so that the whole line moves.
2. Least time: the lap is that of the fastest speeds that the grip allows, by one pass along the line and one against
   it. Going through both passes backwards gives the derivative of the lap time by all curvatures and steps. A move is
   least for it and a multiple of the squared change of curvature. The move, or a half or a quarter of it, is made where
   the lap gets shorter. The multiple grows where none is made, and where only a part is; else it falls.
3. Where the wheels turn in or out, tires hold less: this counts as a greater curvature.

Sources: A. Heilmeier et al., Minimum curvature trajectory planning and control for an autonomous race car, Vehicle
System Dynamics 58(10), 2020; D. Brayshaw and M. Harrison, A quasi steady state approach to race car lap simulation,
Proc. IMechE D 219, 2005, for the lap time; the sequence of quadratic programs is that of Levenberg and Marquardt.

Limits: the line found is the best near the one that it began with.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.messages import FloatArray

from ..control.band_program import least_on_ring
from ..control.planner_settings import Record
from ..control.slip import lock_arc
from .friction_limiter import longitudinal_share

_ENTRIES = 65  # of the tables of what cornering leaves
_SMOOTHED = 3  # times that the derivative by the curvature is averaged over neighbours: .3 m for points .25 m apart
_LEAST_ROOM = 1e-3  # [m] to either side
_REGULAR = 1e-6
_LOCK_USE = 0.85  # share of the curvature at full lock without a price: the car corrects with the rest
_LOCK_PRICE = 4.0  # [s m] of the squared curvature beyond
_PRICE_OUTSIDE = 0.5  # [s/m] of the point that is furthest outside of its room
_WEAKEST, _STRONGEST = 1e-3, 1e6  # multiple of the squared change of curvature
_FINE = 8  # pieces of a step, by which a curve is measured

# steps of least curvature: how far apart the points are, in spacings of the line, and how far each may move [m]
_FLATTENED = ((4, 1.0), (4, 0.8), (4, 0.6), (2, 0.4), (2, 0.3), (1, 0.2), (1, 0.15))
_MOST_MOVED = 0.3  # [m] of a point in a step of least time
_ROUND = 8  # steps of least time, after which the points are spread evenly again

FLATTENED = len(_FLATTENED)
"""Steps of least curvature, which are the first ones."""

STEPS = FLATTENED + 4 * _ROUND
"""Steps until a line is finished."""


class Grip(NamedTuple):
    """What tires, motor and steering give: greatest acceleration and braking by lateral acceleration, and top speed."""

    lateral: float  # [m/s^2] greatest
    accelerating: FloatArray  # (k,) [m/s^2] at k lateral accelerations, evenly from 0 to `lateral`
    braking: FloatArray  # (k,) [m/s^2] positive
    power: float  # [m^2/s^3] of the motor over the mass, that accelerates
    max_speed: float  # [m/s]
    lock: float  # [1/m] greatest curvature without a price
    use: float  # share of the cornering acceleration that `lateral` is
    turning: float  # [m] times the change of curvature is what turning in takes of the grip; 0: nothing,
    turning_out: float  # and the same for turning out


@kernel
def limited_grip(limiter: Record, max_speed: float, uses: tuple[float, float, float], turning_use: float) -> Grip:
    """Return shares of what a friction limiter, of type LIMITER, allows up to a speed [m/s].

    `uses` are those of cornering, braking and accelerating. `turning_use` is that of what cornering leaves for turning
    the wheels; inf: they turn at once.
    """
    cornering_use, braking_use, accelerating_use = uses
    car, lateral = limiter.car, cornering_use * limiter.lateral
    accelerating, braking = np.empty(_ENTRIES), np.empty(_ENTRIES)
    for k in range(_ENTRIES):
        used = lateral * k / (_ENTRIES - 1.0) / (limiter.mu * car.gravity)
        accelerating[k] = accelerating_use * limiter.accelerating * longitudinal_share(limiter, used, False)
        braking[k] = braking_use * limiter.braking * longitudinal_share(limiter, used, True)
    lock = _LOCK_USE * math.tan(lock_arc(limiter.slip, car)) / car.wheelbase
    power = car.max_acceleration * car.power_limit_speed
    turning = limiter.yaw_lag / turning_use
    turning_out = turning / limiter.settings.most_left
    return Grip(lateral, accelerating, braking, power, max_speed, lock, cornering_use, turning, turning_out)


@kernel
def normals_of(line: FloatArray) -> FloatArray:
    """Return the directions to the left of the points of a closed line (n, 2). Shape (n, 2)."""
    n = len(line)
    normals = np.empty((n, 2))
    for k in range(n):
        before, after = line[k - 1 if k > 0 else n - 1], line[(k + 1) % n]
        dx, dy = after[0] - before[0], after[1] - before[1]
        apart = max(math.hypot(dx, dy), 1e-9)
        normals[k, 0], normals[k, 1] = -dy / apart, dx / apart
    return normals


@kernel
def measure(line: FloatArray, bends: FloatArray, to: FloatArray, on: FloatArray) -> None:
    """Write the curvatures [1/m] of a closed line (n, 2), and the steps to each point and from it [m]; all (n,)."""
    n = len(line)
    for k in range(n):
        before, here, after = line[k - 1 if k > 0 else n - 1], line[k], line[(k + 1) % n]
        to_x, to_y, on_x, on_y = here[0] - before[0], here[1] - before[1], after[0] - here[0], after[1] - here[1]
        to[k], on[k] = max(math.hypot(to_x, to_y), 1e-9), max(math.hypot(on_x, on_y), 1e-9)
        chord = max(math.hypot(to_x + on_x, to_y + on_y), 1e-9)
        bends[k] = 2.0 * (to_x * on_y - to_y * on_x) / (to[k] * on[k] * chord)


@kernel
def begin_step(line: FloatArray, step: int, spacing: float) -> tuple[FloatArray, float]:
    """Return the points for a step, evenly apart where a round begins, and how far each may move then [m].

    `spacing` [m] is that of the finished line.
    """
    apart, most = _FLATTENED[step] if step < FLATTENED else (1, _MOST_MOVED)
    if step < FLATTENED or (step - FLATTENED) % _ROUND == 0:
        line = spread(line, max(round(length_of(line) / (apart * spacing)), 8))
    return line, most


@kernel
def improve(
    line: FloatArray, normals: FloatArray, room: tuple[FloatArray, FloatArray], step: int, weight: float, grip: Grip
) -> tuple[int, float]:
    """Move all points of a closed line once, and return the next step and its weight; NaN: there is no such line.

    Args:
      line: (n, 2) [m], about evenly apart, n at least 6; written to.
      normals: to the left of each (n, 2).
      room: how far each may move along its normal, from and to, two arrays (n,) [m]; written to, where there is none.
      step: of STEPS.
      weight: multiple of the squared change of curvature, in a step of least time.
      grip: of the car.
    """
    n, low, high = len(line), room[0], room[1]
    bends, to, on, mean, moved = np.empty(n), np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    measure(line, bends, to, on)
    for k in range(n):
        mean[k] = 0.5 * (to[k] + on[k])
    outside = _outside(0.0, moved, low, high)
    for k in range(n):
        if high[k] < low[k] + 2.0 * _LEAST_ROOM:
            middle = 0.5 * (low[k] + high[k])
            low[k], high[k] = middle - _LEAST_ROOM, middle + _LEAST_ROOM
    if step < FLATTENED:
        rows = _bending(bends, to, on, -1.0)
        if not least_on_ring(_squares(rows, mean, 1.0), _transposed(rows, mean * bends), low, high, moved):
            return STEPS, math.nan
        for k in range(n):
            line[k] += moved[k] * normals[k]
        return step + 1, 1.0
    by_bend, by_step, rows = np.empty(n), np.empty(n), _bending(bends, to, on, 1.0)
    now = _PRICE_OUTSIDE * outside + fastest_lap(bends, on, grip, np.empty(n), by_bend, by_step)
    gradient = _by_move(rows, mean, bends, on, by_bend, by_step)
    share, there = 1.0, np.empty((n, 2))
    if not least_on_ring(_squares(rows, mean, weight), gradient, low, high, moved):
        share = 0.0
        if not math.isfinite(now):
            return STEPS, math.nan
    goes_on = (step + 1 - FLATTENED) % _ROUND > 0
    while share > 0.2:
        for k in range(n):
            there[k] = line[k] + share * moved[k] * normals[k]
        measure(there, bends, to, on)
        then = _PRICE_OUTSIDE * _outside(share, moved, low, high)
        if then + fastest_lap(bends, on, grip, np.empty(n), by_bend, by_step) < now:
            line[:] = there
            return step + 1, max((0.75 if share == 1.0 else 1.3) * weight, _WEAKEST) if goes_on else 1.0
        share *= 0.5
    if 3.0 * weight > _STRONGEST:  # no move makes the lap shorter: on to the next round
        return FLATTENED + ((step - FLATTENED) // _ROUND + 1) * _ROUND, 1.0
    return step + 1, 3.0 * weight if goes_on else 1.0


@kernel
def _outside(share: float, moved: FloatArray, low: FloatArray, high: FloatArray) -> float:
    """Return how far the point that is furthest outside of its room is outside after a share of its move [m]."""
    furthest = 0.0
    for k in range(len(moved)):
        way = share * moved[k] if share > 0.0 else 0.0
        furthest = max(furthest, low[k] - way, way - high[k])
    return furthest


@kernel
def _by_move(
    rows: FloatArray, mean: FloatArray, bends: FloatArray, on: FloatArray, by_bend: FloatArray, by_step: FloatArray
) -> FloatArray:
    """Return the derivative of the lap time by the move of each point (n,) [s/m]; `by_bend` is written to."""
    by_bend /= mean
    for _ in range(_SMOOTHED):
        average(by_bend)
    gradient = _transposed(rows, by_bend * mean)
    for k in range(len(gradient)):
        before = k - 1 if k > 0 else len(gradient) - 1
        gradient[k] -= 0.5 * bends[k] * (by_step[k] * on[k] + by_step[before] * on[before])
    return gradient


@kernel
def _bending(bends: FloatArray, to: FloatArray, on: FloatArray, turning: float) -> FloatArray:
    """Return how each curvature grows by a move of the point before, of its own and of the next (3, n) [1/m^2].

    `turning` is 1; -1 where steps count as unchanged.
    """
    n = len(bends)
    rows = np.empty((3, n))
    for k in range(n):
        mean = 0.5 * (to[k] + on[k])
        rows[0, k], rows[2, k] = 1.0 / (to[k] * mean), 1.0 / (on[k] * mean)
        rows[1, k] = turning * bends[k] * bends[k] - rows[0, k] - rows[2, k]
    return rows


@kernel
def _squares(rows: FloatArray, mean: FloatArray, weight: float) -> FloatArray:
    """Return the bands (3, n) of a multiple of the squares of rows, integrated over steps."""
    n = len(mean)
    bands = np.empty((3, n))
    for k in range(n):
        before, after = k - 1 if k > 0 else n - 1, (k + 1) % n
        own, first, last = rows[1, k] * mean[k], rows[0, after] * mean[after], rows[2, before] * mean[before]
        bands[0, k] = _REGULAR + weight * (rows[0, after] * first + rows[1, k] * own + rows[2, before] * last)
        bands[1, k] = weight * (own * rows[2, k] + first * rows[1, after])
        bands[2, k] = weight * first * rows[2, after]
    return bands


@kernel
def _transposed(rows: FloatArray, values: FloatArray) -> FloatArray:
    """Return by how much the sum of rows times values (n,) changes for a move of each point (n,)."""
    n = len(values)
    changes = np.empty(n)
    for k in range(n):
        before, after = k - 1 if k > 0 else n - 1, (k + 1) % n
        changes[k] = rows[0, after] * values[after] + rows[1, k] * values[k] + rows[2, before] * values[before]
    return changes


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
def spread(line: FloatArray, count: int) -> FloatArray:
    """Return so many points at even steps on the closed curve through points (n, 2); the first stays. (count, 2).

    The points have to be about evenly apart. The curve is a cubic between two, with the slopes of the parabolas through
    five points.
    """
    n = len(line)
    along, fine = np.zeros(n * _FINE + 1), np.empty((n * _FINE + 1, 2))
    for k in range(n):
        ends = line[k], line[(k + 1) % n]
        slopes = _slope(line, k), _slope(line, (k + 1) % n)
        for part in range(_FINE):
            share = part / _FINE
            rest = 1.0 - share
            for axis in range(2):
                fine[k * _FINE + part, axis] = rest * rest * (
                    (1.0 + 2.0 * share) * ends[0][axis] + share * slopes[0][axis]
                ) + share * share * ((1.0 + 2.0 * rest) * ends[1][axis] - rest * slopes[1][axis])
    fine[-1] = line[0]
    for k in range(n * _FINE):
        along[k + 1] = along[k] + math.hypot(fine[k + 1, 0] - fine[k, 0], fine[k + 1, 1] - fine[k, 1])
    points, piece = np.empty((count, 2)), 0
    for k in range(count):
        way = along[-1] * k / count
        while piece + 2 < len(along) and along[piece + 1] <= way:
            piece += 1
        share = (way - along[piece]) / max(along[piece + 1] - along[piece], 1e-12)
        points[k] = fine[piece] + share * (fine[piece + 1] - fine[piece])
    return points


@kernel
def _slope(line: FloatArray, k: int) -> tuple[float, float]:
    """Return how the place on a closed line (n, 2) changes from point to point."""
    n = len(line)
    first, before, after, last = line[(k - 2) % n], line[(k - 1) % n], line[(k + 1) % n], line[(k + 2) % n]
    return (
        (8.0 * (after[0] - before[0]) - last[0] + first[0]) / 12.0,
        (8.0 * (after[1] - before[1]) - last[1] + first[1]) / 12.0,
    )


@kernel
def length_of(line: FloatArray) -> float:
    """Return the length of a closed row of points (n, 2) [m]."""
    length = 0.0
    for k in range(len(line)):
        before = line[k - 1 if k > 0 else len(line) - 1]
        length += math.hypot(line[k, 0] - before[0], line[k, 1] - before[1])
    return length


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
    bends: FloatArray, steps: FloatArray, grip: Grip, speeds: FloatArray, by_bend: FloatArray, by_step: FloatArray
) -> float:
    """Return the time of a lap [s] and the price of curvature beyond the lock, and write speeds and derivatives.

    Args:
      bends: curvatures (n,) [1/m].
      steps: from each point to the next (n,) [m].
      grip: of the car.
      speeds: (n,) [m/s], written to.
      by_bend: derivative by each curvature (n,) [s m], written to.
      by_step: derivative by each step (n,) [s/m], written to.
    """
    n = len(bends)
    squared, gained, lost = np.empty((3, n)), np.zeros(n, np.bool_), np.zeros(n, np.bool_)
    own, by_demand = np.empty((2, n)), np.empty(n)
    demands = _demands(bends, steps, grip, own)
    slowest = _drive(demands, steps, grip, squared, gained, lost)
    time, by_square = 0.0, np.zeros(n)
    for i in range(n):
        ahead = (i + 1) % n
        here, there = math.sqrt(squared[2, i]), math.sqrt(squared[2, ahead])
        speeds[i], by_demand[i], by_step[i] = here, 0.0, 2.0 / (here + there)
        time += by_step[i] * steps[i]
        by_square[i] -= steps[i] / (here + there) ** 2 / here
        by_square[ahead] -= steps[i] / (here + there) ** 2 / there
    for j in range(n - 2, -1, -1):  # the passes, backwards
        ahead = (slowest - j) % n
        i = (ahead - 1) % n
        if lost[i]:
            left, slope = _left(grip.braking, demands[ahead] * squared[2, ahead], grip.lateral)
            twice = 2.0 * steps[i] * by_square[i]
            by_square[ahead] += by_square[i] + twice * slope * demands[ahead]
            by_demand[ahead] += twice * slope * squared[2, ahead]
            by_step[i] += 2.0 * left * by_square[i]
            by_square[i] = 0.0
    for j in range(n - 2, -1, -1):
        i = (slowest + j) % n
        ahead = (i + 1) % n
        if gained[ahead]:
            before = squared[1, i]
            push, slope = _left(grip.accelerating, demands[i] * before, grip.lateral)
            motor, twice = grip.power / math.sqrt(before), 2.0 * steps[i] * by_square[ahead]
            if motor < push:
                by_square[i] += by_square[ahead] - 0.5 * twice * motor / before
                push = motor
            else:
                by_square[i] += by_square[ahead] + twice * slope * demands[i]
                by_demand[i] += twice * slope * before
            by_step[i] += 2.0 * push * by_square[ahead]
            by_square[ahead] = 0.0
    for i in range(n):
        if squared[0, i] < grip.max_speed * grip.max_speed:
            by_demand[i] -= by_square[i] * squared[0, i] / demands[i]
    _by_bends(by_demand, own, steps, by_bend)
    return time + _beyond_lock(bends, steps, grip.lock, by_bend)


@kernel
def _beyond_lock(bends: FloatArray, steps: FloatArray, lock: float, by_bend: FloatArray) -> float:
    """Return the price of curvature beyond the lock [s], and add its derivatives."""
    price = 0.0
    for i in range(len(bends)):
        beyond = abs(bends[i]) - lock
        if beyond > 0.0:
            price += _LOCK_PRICE * beyond * beyond * steps[i]
            by_bend[i] += 2.0 * _LOCK_PRICE * math.copysign(beyond, bends[i]) * steps[i]
    return price


@kernel
def _demands(bends: FloatArray, steps: FloatArray, grip: Grip, own: FloatArray) -> FloatArray:
    """Return the lateral acceleration over the speed squared that the tires hold at each point (n,) [1/m].

    That is the curvature, and where the wheels turn in or out, what this takes. Write to `own` (2, n) its derivatives
    by the curvature of the point, averaged as `average` does, and by how this changes to the neighbours.
    """
    n, smooth = len(bends), bends.copy()
    average(smooth)
    demands = np.empty(n)
    for k in range(n):
        before, after = k - 1 if k > 0 else n - 1, (k + 1) % n
        bend, change = abs(smooth[k]), (smooth[after] - smooth[before]) / (steps[before] + steps[k])
        sign = math.copysign(1.0, smooth[k])
        inwards, turned = smooth[k] * change > 0.0, math.copysign(1.0, change)
        demands[k], own[0, k], own[1, k] = max(bend, 1e-12), sign, 0.0
        turning = grip.use * (grip.turning if inwards else grip.turning_out)
        most = turning * abs(change) + (grip.use * bend if inwards else 0.0)
        if most > demands[k]:
            demands[k], own[0, k], own[1, k] = most, grip.use * sign if inwards else 0.0, turning * turned
    return demands


@kernel
def _by_bends(by_demand: FloatArray, own: FloatArray, steps: FloatArray, by_bend: FloatArray) -> None:
    """Write the derivative by each curvature (n,), of that by what the tires hold; `own` as of `_demands`."""
    n = len(by_demand)
    for k in range(n):
        by_bend[k] = by_demand[k] * own[0, k]
    for k in range(n):
        before, after = k - 1 if k > 0 else n - 1, (k + 1) % n
        by_change = by_demand[k] * own[1, k] / (steps[before] + steps[k])
        by_bend[after] += by_change
        by_bend[before] -= by_change
    average(by_bend)


@kernel
def _drive(
    demands: FloatArray,
    steps: FloatArray,
    grip: Grip,
    squared: FloatArray,
    gained: NDArray[np.bool_],
    lost: NDArray[np.bool_],
) -> int:
    """Write the fastest speeds squared, and which come of the point before and behind; return the slowest point.

    `squared` (3, n) [m^2/s^2] are the limits in the corners, those after the pass along the line, and after both.
    """
    n, slowest = len(demands), 0
    limit, forward, both = squared[0], squared[1], squared[2]
    for i in range(n):
        limit[i] = forward[i] = min(grip.max_speed * grip.max_speed, grip.lateral / demands[i])
        if limit[i] < limit[slowest]:
            slowest = i
    for j in range(n - 1):
        i = (slowest + j) % n
        ahead = (i + 1) % n
        push = _left(grip.accelerating, demands[i] * forward[i], grip.lateral)[0]
        reached = forward[i] + 2.0 * steps[i] * min(push, grip.power / math.sqrt(forward[i]))
        if reached < forward[ahead]:
            forward[ahead], gained[ahead] = reached, True
    both[:] = forward
    for j in range(n - 1):
        ahead = (slowest - j) % n
        i = (ahead - 1) % n
        reached = both[ahead] + 2.0 * steps[i] * _left(grip.braking, demands[ahead] * both[ahead], grip.lateral)[0]
        if reached < both[i]:
            both[i], lost[i] = reached, True
    return slowest
