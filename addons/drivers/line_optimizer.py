"""The fastest closed line between walls: of least curvature, or of least lap time.

The line is points that are evenly apart. Each may move along its normal, within the room that walls and obstacles leave
the car's rectangle and a margin. Least curvature is a quadratic program on the ring of points (band_program), as second
differences of the places are linear in the moves; it is solved again on the line that it gave. As steps count as
unchanged, this rewards a shorter line, too. Least time: the lap is that of the fastest speeds, by a pass along the line
and one against it. Going through both backwards gives the derivative of the lap time by all curvatures and steps. Each
move is least for it and a multiple of the squared change of curvature, which grows where a move brought nothing.
Sources: A. Heilmeier et al., Minimum curvature trajectory planning and control for an autonomous race car, Vehicle
System Dynamics 58(10), 2020; D. Brayshaw and M. Harrison, A quasi steady state approach to race car lap simulation,
Proc. IMechE D 219, 2005, for the lap time; the sequence of quadratic programs is that of Levenberg and Marquardt.
Limits: the line found is the best near the one of least curvature. Another side of an obstacle is not tried.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.controllers.control.band_program import least_on_ring
from fg_mujoco.controllers.safety.friction_limiter import FrictionLimiter, longitudinal_share
from fg_mujoco.controllers.safety.least_time import fastest_lap
from fg_mujoco.errors import SettingsError
from fg_mujoco.messages import CarParameters, FloatArray, MapLine

from .line_profile import ROOM, Y

Objective = Literal["time", "curvature"]

SPACING = 0.2  # [m] of the points of a line that is shaped
_WALL_SPACING = 0.05  # [m] of the points of walls
_ENTRIES = 65  # of a grip's tables
_CELL = 0.5  # [m] of the grid in which walls are looked up
_THROUGH = 0.05  # [m] by which a wall may lie on the wrong side of the line, and still be that wall
_THROUGH_OBSTACLE = 1.5  # [m] the same for obstacles, through which the first line leads
_LEAST_ROOM = 1e-3  # [m]
_FIRST_MOVE, _MOST_MOVED = 0.8, 0.3  # [m] of a point: in a round of least curvature, and of least time
_ROUNDS = 25  # of least curvature
_FEWER_ROUNDS = 6  # before the least time
_SETTLED = 0.01  # [m] greatest move of a point after which a line is the one of least curvature
_MOVES = 160  # of least time
_MEMORY, _GAIN = 12, 1e-4  # least time ends where so many moves gain less than this share
_RESAMPLED = 5  # moves after which the points are spread evenly again
_SMOOTHING = 0.3  # [m] standard deviation by which the derivative is smoothed
_WEAKEST, _STRONGEST = 1e-3, 1e6  # weight of the squared change of curvature
_REGULAR = 1e-6
_LOCK_USE = 0.95  # share of the curvature at full lock that the line may have
_LOCK_PRICE = 0.05  # [s m] of the squared curvature beyond
_PRICE_OUTSIDE = 0.5  # [s/m] of the deepest place of the car outside of its room
_LEAST_MARGIN = 0.5  # share of a planner's margin to the walls that it leaves when it is off its line
_FINE = 8  # points in a step, by which a curve is measured


@dataclass(frozen=True, kw_only=True, eq=False)
class Grip:
    """What the tires and the motor give: greatest acceleration and braking by lateral acceleration, and top speed."""

    lateral: float  # [m/s^2] greatest
    accelerating: FloatArray  # (k,) [m/s^2] at k lateral accelerations, evenly from 0 to `lateral`
    braking: FloatArray  # (k,) [m/s^2] positive
    power: float  # [m^2/s^3] of the motor over the mass, that accelerates
    max_speed: float  # [m/s]


def limited_grip(limiter: FrictionLimiter, max_speed: float, cornering_use: float, braking_use: float) -> Grip:
    """Return shares of what a friction limiter allows, up to a speed [m/s], as a grip; arguments as of `line_table`."""
    car, lateral = limiter.car, cornering_use * limiter.lateral
    used = np.linspace(0.0, lateral, _ENTRIES) / (limiter.record["mu"][0] * car.gravity)
    shares = [[longitudinal_share(limiter.record[0], use, way) for use in used.tolist()] for way in (False, True)]
    accelerating, braking = braking_use * np.array(shares)
    return Grip(
        lateral=lateral, accelerating=limiter.accelerating * accelerating, braking=limiter.braking * braking,
        power=car.max_acceleration * car.power_limit_speed, max_speed=max_speed,
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True, eq=False)
class Walls:
    """Points of walls and obstacles, sorted by the cells of a grid."""

    points: FloatArray  # (m, 2) [m]
    sides: FloatArray  # (m, 2): 1 to the left of the line, -1 to the right; how far it may lie on the other side [m]
    origin: FloatArray  # (2,) [m] of the grid
    starts: NDArray[np.int64]  # (columns, rows + 1): index of each cell's first point

    @classmethod
    def of(
        cls,
        left: Iterable[FloatArray],
        right: Iterable[FloatArray],
        left_obstacles: Iterable[FloatArray] = (),
        right_obstacles: Iterable[FloatArray] = (),
    ) -> Walls:
        """Return walls of closed outlines (k, 2) [m]: those to the left of the line, and those to its right."""
        kinds = [(left, 1.0, _THROUGH), (right, -1.0, _THROUGH)]
        kinds += [(left_obstacles, 1.0, _THROUGH_OBSTACLE), (right_obstacles, -1.0, _THROUGH_OBSTACLE)]
        points, sides = [], []
        for outlines, side, through in kinds:
            for outline in outlines:
                dense = _divided(outline, _WALL_SPACING)
                points.append(dense)
                sides.append(np.tile([side, through], (len(dense), 1)))
        if not points:
            raise SettingsError("a line without walls beside it; accepted: a circuit whose walls are known")
        every, side_of = np.concatenate(points), np.concatenate(sides)
        origin = every.min(axis=0)
        cells = np.floor((every - origin) / _CELL).astype(np.int64)
        columns, rows = (cells.max(axis=0) + 1).tolist()
        index = cells[:, 0] * rows + cells[:, 1]
        order = np.argsort(index, kind="stable")
        starts = np.searchsorted(index[order], np.arange(columns)[:, None] * rows + np.arange(rows + 1))
        return cls(points=every[order], sides=side_of[order], origin=origin, starts=starts.astype(np.int64))


def walls_beside(line: FloatArray, outlines: Iterable[FloatArray]) -> Walls:
    """Return closed outlines (k, 2) [m] as walls of a closed line (n, 2) [m], each on the side where most of it lies.

    One that lies on both sides stands on the line, as islands do, and is passed on the other side. Or SettingsError.
    """
    ahead = np.roll(line, -1, axis=0) - np.roll(line, 1, axis=0)
    kinds: list[list[FloatArray]] = [[], [], [], []]
    for outline in outlines:
        points = _divided(outline, _CELL)
        nearest = [int(np.argmin((line[:, 0] - x) ** 2 + (line[:, 1] - y) ** 2)) for x, y in points.tolist()]
        away = points - line[nearest]
        leftwards = ahead[nearest, 0] * away[:, 1] - ahead[nearest, 1] * away[:, 0] > 0.0
        share = float(leftwards.mean())
        kinds[(0 if share in (0.0, 1.0) else 2) + (share < 0.5)].append(outline)
    return Walls.of(*kinds)


@dataclass(frozen=True, kw_only=True, eq=False)
class OptimizedLine:
    """A closed line, and how fast a lap of it is by the grip that it was made for."""

    points: FloatArray  # (n, 2) [m] of the rear axle, evenly apart, in driving order
    speeds: FloatArray  # (n,) [m/s]
    lap_time: float  # [s]


def optimize_line(
    start: FloatArray, walls: Walls, car: CarParameters, grip: Grip, *, margin: float, objective: Objective = "time"
) -> OptimizedLine:
    """Return the fastest line near a closed line (n, 2) [m] that leads between the walls, with a margin to them [m].

    `start` is in driving order, the first point not repeated, between the walls; it may lead through obstacles.
    `objective` is `time`, or `curvature` for the least integral of the squared curvature. Raises SettingsError: the
    solver does not converge.
    """
    line = _least_curvature(start, walls, car, margin, _ROUNDS if objective == "curvature" else _FEWER_ROUNDS)
    if objective == "time":
        line = _least_time(line, walls, car, grip, margin)
    count = len(line)
    speeds, unused = np.empty(count), np.empty(count)
    _, bends, before, _ = _geometry(line)
    time = fastest_lap(bends, np.roll(before, -1), *_numbers(grip), math.inf, 0.0, speeds, unused, unused)
    if not math.isfinite(time):
        raise _not_converged(objective)
    return OptimizedLine(points=line, speeds=speeds, lap_time=time)


def room_beside(line: FloatArray, walls: Walls, car: CarParameters, margin: float, most: float) -> FloatArray:
    """Return how far a car, `margin` [m] from the walls, may be to the right (negative) and left, (n, 2) [m]."""
    return np.column_stack(room(line, _geometry(line)[0], walls, car, margin, most))


def _not_converged(objective: str) -> SettingsError:
    return SettingsError(
        f"the solver of the line of least {objective} does not converge; accepted: more room, a smaller margin"
    )


def spread(points: FloatArray, spacing: float) -> FloatArray:
    """Return a closed curve through points (n, 2) [m], at even steps near `spacing` [m]; the first point stays.

    The points have to be about evenly apart. The curve has the tangents of parabolas through three points each.
    """
    slopes = (
        8.0 * (np.roll(points, -1, 0) - np.roll(points, 1, 0)) - np.roll(points, -2, 0) + np.roll(points, 2, 0)
    ) / 12.0

    def at(places: FloatArray) -> FloatArray:
        i = np.floor(places).astype(int) % len(points)
        share = (places - np.floor(places))[:, None]
        j, rest = (i + 1) % len(points), 1.0 - share
        ends = rest * rest * (1.0 + 2.0 * share) * points[i] + share * share * (3.0 - 2.0 * share) * points[j]
        return np.asarray(ends + rest * share * (rest * slopes[i] - share * slopes[j]))

    places = np.arange(_FINE * len(points) + 1) / _FINE
    along = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(at(places), axis=0).T))))
    count = max(8, round(along[-1] / spacing))
    return at(np.interp(np.arange(count) * along[-1] / count, along, places))


def _divided(outline: FloatArray, spacing: float) -> FloatArray:
    """Return points at most `spacing` [m] apart along a closed outline."""
    ahead = np.roll(outline, -1, axis=0) - outline
    parts = np.maximum(np.ceil(np.hypot(*ahead.T) / spacing), 1.0).astype(int)
    first = np.repeat(np.arange(len(outline)), parts)
    share = (np.arange(len(first)) - np.repeat(np.cumsum(parts) - parts, parts)) / parts[first]
    return np.asarray(outline[first] + share[:, None] * ahead[first])


def _geometry(line: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return the normals (n, 2) to the left, the curvatures [1/m], and the steps to each point and from it (n,) [m]."""
    before, after = line - np.roll(line, 1, axis=0), np.roll(line, -1, axis=0) - line
    chord, to, on = before + after, np.hypot(*before.T), np.hypot(*after.T)
    apart = np.hypot(*chord.T)
    bends = 2.0 * (before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]) / (to * on * apart)
    return np.column_stack((-chord[:, 1], chord[:, 0])) / apart[:, None], bends, to, on


def _bending(to: FloatArray, on: FloatArray, turning: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return how much each second difference grows by a move of the point before, of its own, and of the next."""
    mean = 0.5 * (to + on)
    return 1.0 / (to * mean), turning - 1.0 / (to * mean) - 1.0 / (on * mean), 1.0 / (on * mean)


def _squares(rows: tuple[FloatArray, FloatArray, FloatArray], weights: FloatArray) -> FloatArray:
    """Return the bands of the sum of the weighted squares of rows, (3, n)."""
    before, own, after = rows
    diagonal = np.roll(before * before * weights, -1) + own * own * weights + np.roll(after * after * weights, 1)
    first = own * after * weights + np.roll(before * own * weights, -1)
    return np.stack((diagonal, first, np.roll(before * after * weights, -1)))


def _transposed(rows: tuple[FloatArray, FloatArray, FloatArray], values: FloatArray) -> FloatArray:
    """Return what the rows' sum with values changes by for a move of each point."""
    return np.asarray(np.roll(rows[0] * values, -1) + rows[1] * values + np.roll(rows[2] * values, 1))


def _least_curvature(start: FloatArray, walls: Walls, car: CarParameters, margin: float, rounds: int) -> FloatArray:
    """Return the line of least curvature, after at most so many rounds."""
    line = spread(_even(start), SPACING)
    for _ in range(rounds):
        normals, bends, to, on = _geometry(line)
        low, high = room(line, normals, walls, car, margin, _FIRST_MOVE)
        rows, weights = _bending(to, on, -(bends**2)), 0.5 * (to + on)
        bands = _squares(rows, weights)
        bands[0] += _REGULAR
        moved = least_on_ring(bands, _transposed(rows, weights * bends), low, high)
        if moved is None:
            raise _not_converged("curvature")
        line = spread(line + moved[:, None] * normals, SPACING)
        if np.abs(moved).max() < _SETTLED:
            break
    return line


def _even(points: FloatArray) -> FloatArray:
    """Return a closed row of points (n, 2) [m] at even steps, its corners rounded over some of them."""
    loop = np.vstack((points, points[:1]))
    along = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(loop, axis=0).T))))
    count = max(8, round(along[-1] / SPACING))
    places = np.arange(count) * along[-1] / count
    even = np.column_stack([np.interp(places, along, column) for column in loop.T])
    for _ in range(2):
        even = 0.5 * even + 0.25 * (np.roll(even, 1, axis=0) + np.roll(even, -1, axis=0))
    return even


def _least_time(line: FloatArray, walls: Walls, car: CarParameters, grip: Grip, margin: float) -> FloatArray:
    """Return the line of least lap time near a line."""
    lock = _LOCK_USE * math.tan(car.max_steering_angle) / car.wheelbase
    weight, times, best = 1.0, [], (math.inf, line)
    for number in range(_MOVES):
        normals, bends, to, on = _geometry(line)
        by_bend, by_step, speeds = np.empty(len(line)), np.empty(len(line)), np.empty(len(line))
        time = fastest_lap(bends, on, *_numbers(grip), lock, _LOCK_PRICE, speeds, by_bend, by_step)
        if not math.isfinite(time):
            raise _not_converged("time")
        low, high = room(line, normals, walls, car, margin, _MOST_MOVED)
        outside = _PRICE_OUTSIDE * max(float(low.max()), float(-high.min()), 0.0)
        if time + outside < best[0]:
            best = time + outside, line
        times.append(best[0])
        if weight > _STRONGEST or (number > _MEMORY and times[-1 - _MEMORY] - best[0] < _GAIN * best[0]):
            break
        mean = 0.5 * (to + on)
        rows, smoothed = _bending(to, on, bends**2), _smoothed(by_bend / mean, float(mean.mean())) * mean
        gradient = _transposed(rows, smoothed) - 0.5 * bends * (by_step * on + np.roll(by_step * on, 1))
        bands = weight * _squares(rows, mean)
        bands[0] += _REGULAR
        moved = least_on_ring(bands, gradient, low, high)
        share, taken = 1.0, False
        while moved is not None and share > 0.2 and not taken:
            moves = line + share * moved[:, None] * normals
            _, bent, _, stepped = _geometry(moves)
            after = fastest_lap(bent, stepped, *_numbers(grip), lock, _LOCK_PRICE, speeds, by_bend, by_step)
            taken = after < time + outside
            share *= 0.5
        weight *= 3.0 if not taken else 1.3 if share < 0.5 else 0.75
        weight = max(weight, _WEAKEST)
        if taken:
            line = moves
        if not taken or number % _RESAMPLED == _RESAMPLED - 1:
            line = spread(line, SPACING)
    return spread(best[1], SPACING)


def _smoothed(values: FloatArray, spacing: float) -> FloatArray:
    """Return values round a ring, averaged over a Gaussian of _SMOOTHING."""
    waves = np.fft.rfftfreq(len(values), d=spacing)
    kept = np.exp(-2.0 * (np.pi * _SMOOTHING * waves) ** 2)
    return np.asarray(np.fft.irfft(np.fft.rfft(values) * kept, n=len(values)))


def _numbers(grip: Grip) -> tuple[float, FloatArray, FloatArray, float, float]:
    return grip.lateral, grip.accelerating, grip.braking, grip.power, grip.max_speed


def room(
    line: FloatArray, normals: FloatArray, walls: Walls, car: CarParameters, margin: float, most: float
) -> tuple[FloatArray, FloatArray]:
    """Return how far each point may move along its normal, from and to, within `most`, (n,) [m]; if not, the middle."""
    low, high = np.empty(len(line)), np.empty(len(line))
    half, tail, nose = 0.5 * car.width + margin, car.rear_overhang + margin, car.length - car.rear_overhang + margin
    _room(line, normals, walls.points, walls.sides, walls.origin, walls.starts, half, tail, nose, most, low, high)
    tight = low > high - 2.0 * _LEAST_ROOM
    middle = np.clip(0.5 * (low + high), -most, most)
    return np.where(tight, middle - _LEAST_ROOM, low), np.where(tight, middle + _LEAST_ROOM, high)


@kernel
def _room(
    line: FloatArray,
    normals: FloatArray,
    points: FloatArray,
    sides: FloatArray,
    origin: FloatArray,
    starts: NDArray[np.int64],
    half: float,
    tail: float,
    nose: float,
    most: float,
    low: FloatArray,
    high: FloatArray,
) -> None:
    """Write the room of each point: between the wall points beside the car's rectangle, from its tail to its nose."""
    columns, rows = starts.shape[0], starts.shape[1] - 1
    reach = math.hypot(max(tail, nose), half + most)
    for i in range(len(line)):
        x, y, across_x, across_y = line[i, 0], line[i, 1], normals[i, 0], normals[i, 1]
        low[i], high[i] = -most, most
        first, last = int((x - reach - origin[0]) / _CELL), int((x + reach - origin[0]) / _CELL)
        bottom, top = int((y - reach - origin[1]) / _CELL), int((y + reach - origin[1]) / _CELL)
        bottom, top = max(bottom, 0), min(top, rows - 1)
        for column in range(max(first, 0), min(last, columns - 1) + 1):
            if bottom > top:
                break
            for k in range(starts[column, bottom], starts[column, top + 1]):
                dx, dy = points[k, 0] - x, points[k, 1] - y
                ahead, aside = across_y * dx - across_x * dy, across_x * dx + across_y * dy
                if -tail < ahead < nose:
                    if sides[k, 0] > 0.0 and aside > -sides[k, 1]:
                        high[i] = min(high[i], aside - half)
                    elif sides[k, 0] < 0.0 and aside < sides[k, 1]:
                        low[i] = max(low[i], aside + half)


@lru_cache(maxsize=8)
def raceline(map_line: MapLine, car: CarParameters, mu: float, max_speed: float, settings: Any) -> FloatArray:
    """Return the line of least lap time between the walls of a map, by what its profile may use of the tires. (n, 2).

    Raises SettingsError: a line that is open, without walls or friction limits; a solver that does not converge.
    """
    if not (map_line.closed and map_line.walls and math.isfinite(mu)):
        raise SettingsError("line is 'raceline'; accepted: on a circuit whose walls are known, with friction limits")
    grip = limited_grip(FrictionLimiter(car, mu), max_speed, settings.cornering_use, settings.braking_use)
    walls = walls_beside(map_line.points, map_line.walls)
    return optimize_line(map_line.points, walls, car, grip, margin=settings.margin).points


def room_on_map(table: FloatArray, map_line: MapLine, car: CarParameters, margin: float) -> FloatArray:
    """Return the room beside a planner's line to the right (negative) and to the left, (n, 2) [m], less some margin."""
    walls, line = walls_beside(map_line.points, map_line.walls), table[:, : Y + 1].copy()
    return room_beside(line, walls, car, _LEAST_MARGIN * margin, ROOM)
