"""Known line: a line of little curvature through the ground of the first lap, and how fast it can be driven.

    shape_line(line, lap, scan, beams, limiter)  # in every tick after the lap is closed, until the line is ready
    place = follow_line(line, lap, scan, ranges, limiter, odometry, reference)  # AWAY, NEAR or ON

1. Shaping. The line begins as the path of the first lap. In each of several rounds its points are spread evenly, and
   the room to both sides of each is read off the recorded ends of beams. The points are then moved sideways within that
   room so that the sum of the squared second differences is least. This quadratic program is solved by successive
   over-relaxation with projection. The first rounds have few points, so that the whole line moves.
2. Joining. NEAR the line the car is led towards a point of it further on, with all the protections of the planner.
3. Following. ON the line the car steers along it (control.tracking). Its speed is the greatest from which the tires
   hold the car through what comes: cornering, turning the wheels, and braking before with what cornering leaves. Known
   ground counts as free although it is not in sight, so neither the speed law of sight nor the safety filter applies.
4. Something new. Where a beam ends on the line, the car brakes to stop before it. Near to it, the planner drives again.

Sources: F. Braghin et al., Race driver model, Computers & Structures 86, 2008, for the line of least curvature;
A. Heilmeier et al., Minimum curvature trajectory planning and control for an autonomous race car, Vehicle System
Dynamics 58(10), 2020, for the rounds; C. Cryer, The Solution of a Quadratic Programming Problem Using Systematic
Overrelaxation, SIAM Journal on Control 9, 1971, for the relaxation.

Limits: what stands on the line behind a corner, and was not there in the first lap, is seen late: the car comes faster
than it could stop within what it sees. Second differences reward a shorter line, so hairpins are driven at their inner
wall. A line that is sharper somewhere than 1.25 times the curvature at full lock is not followed at all.
"""

from __future__ import annotations

import math

import numpy as np

from fg_mujoco.kernels import kernel
from fg_mujoco.messages import FloatArray

from ..control.planner_settings import Record
from ..control.steering import arc_through, late_by, saturate
from ..control.tracking import CURVATURE, HEADING, X, Y, errors, next_place, steer_within
from ..perception.lap_map import FAR, LAP_MAP, PLACES, tell_sides, wall_points
from ..perception.scan_geometry import nearest_place, sees
from .friction_limiter import longitudinal_share

RADIUS = 4  # column of the line after those of control.tracking: the greatest speed squared over `lateral` [m]
DEMAND = 5  # column: the acceleration that the tires hold while the car brakes, over the speed squared [1/m]

_APART = (4, 4, 4, 2, 2, 1, 1)  # spacing of the points in each round, in places
_MOVES = (1.0, 0.8, 0.6, 0.4, 0.3, 0.2, 0.15)  # [m] at most to each side in each round
_SWEEPS = 500  # of a round
_RELAXED = 1.7  # over-relaxation
_SMOOTHED = 6  # times that the path is smoothed before the first round
_MARGIN = 0.16  # [m] between the car's outline and walls
_BEHIND, _AHEAD = 6, 10  # places whose beams are read for the room at a point
_THROUGH = 0.6  # [m] by which the line may lead through a wall, before its points are moved
_PLACES_A_TICK = 12  # whose beams are told to be to the left or right in a tick
_POINTS_A_TICK = 12  # whose room is read in a tick
_MOVES_A_TICK = 30_000  # of points
_POINTS = 64  # that the car looks ahead
_LATERAL_USE = 0.9  # share of the limiter's cornering acceleration
_NEAR_LOCK = 0.8  # share of the curvature at full lock from which on the car is slower, as it hardly can correct
_SLOWER = 0.5  # share by which the squared speed is less at full lock
_TOO_SHARP = 1.25  # share of the curvature at full lock: a line that is sharper somewhere is not followed
_TURNING_USE = 0.53  # share of the limiter's steering rate; in the mean of a tick the servo turns with .59 of it
_BRAKING_USE = 0.7  # share of the limiter's braking
_CORRECTION_USE = 0.9  # share of the limiter's cornering acceleration for coming back to the line
_LOOKAHEAD = 0.15  # [s] for which the speed is read ahead
_NEAR = (1.5, 0.7)  # [m] to the side of the line and [rad] from it, within which the car is led to it
# within which the car begins to follow the line: [m] to its side, [rad] from it, share of the cornering acceleration
# from its curvature, and [m/s] above its speed
_JOINS = (0.15, 0.2, 0.3, 0.5)
_LENGTH, _LENGTH_TIME = 0.35, 0.15  # [m] and [s]: over which the distance from the line falls
_REACH, _REACH_TIME = 0.8, 0.3  # [m] and [s] to the point of the line to which the car is led
_ON_IT = 0.06  # [m] to the side of the line from which on the car is slower,
_SLOWER_OFF = 1.5  # [1/m] by this share for each metre
_LEAVES = 0.6  # [m] to the side of the line, beyond which the car no longer follows it
_CLEAR = 0.05  # [m] to each side of the car, within which the end of a beam on the line is something new
_BEAMS_A_POINT = 24  # that are looked at for each point, at most
_STOPS_BEFORE = 1.0  # [m] between the rear axle and something new at which the car stands
_PLANNER_DRIVES = 5.0  # [m] after something new was within twice that

AWAY, NEAR, ON = range(3)
"""Where the car is: the planner drives, the car is led to the line, or it follows the line."""

KNOWN_LINE = np.dtype(
    [
        ("round", np.int64),
        # 0: on which side walls are is to be told; points are 1: to be spread, 2: to get their room, 3: to be moved
        ("shape", np.int64),
        ("done", np.int64),  # places, points or sweeps
        ("ready", np.bool_),
        ("follows", np.bool_),  # the reference is that of the line
        ("next", np.int64),  # index of the point that is next
        ("until", np.float64),  # `driven` until which the planner drives
        ("count", np.int64),  # of points
        ("spacing", np.float64),  # [m]
        ("base", np.float64, (PLACES, 2)),  # [m] points before they are moved
        ("normal", np.float64, (PLACES, 2)),  # to the left of each
        ("aside", np.float64, (PLACES, 3)),  # [m] to the left: how far each is moved, at least and at most
        ("points", np.float64, (PLACES, 6)),  # x, y [m], heading [rad], curvature [1/m], RADIUS and DEMAND
    ]
)
"""Type of a line, and of what is kept of it from tick to tick; zero at the beginning."""

REMEMBERED = np.dtype([("lap", LAP_MAP), ("line", KNOWN_LINE)])
"""Type of all that is remembered of the first lap."""


@kernel
def shape_line(line: Record, lap: Record, scan: Record, beams: int, limiter: Record) -> None:
    """Do a tick's part of the shaping.

    Args:
      line: of type KNOWN_LINE, written to.
      lap: of type LAP_MAP, closed.
      scan: of type SCAN.
      beams: of a scan.
      limiter: of type LIMITER.
    """
    if line.shape == 0:
        for _ in range(_PLACES_A_TICK):
            if line.done < lap.count:
                tell_sides(lap, line.done, scan, beams, limiter.car.lidar_offset)
                line.done += 1
        if line.done == lap.count:
            line.shape = 1
    elif line.shape == 1:
        _spread(line, lap)
    elif line.shape == 2:
        for _ in range(_POINTS_A_TICK):
            if line.done < line.count:
                _read_room(line, lap, scan, beams, limiter.car)
                line.done += 1
        if line.done == line.count:
            line.shape, line.done = 3, 0
    else:
        for _ in range(max(1, _MOVES_A_TICK // line.count)):
            if line.done < _SWEEPS:
                _sweep(line)
                line.done += 1
        if line.done == _SWEEPS:
            line.shape, line.round = 1, line.round + 1
            for k in range(line.count):
                line.base[k, 0] += line.aside[k, 0] * line.normal[k, 0]
                line.base[k, 1] += line.aside[k, 0] * line.normal[k, 1]
            if line.round == len(_APART):
                _finish(line, limiter)


@kernel
def _spread(line: Record, lap: Record) -> None:
    """Spread the points of the line evenly for a round."""
    if line.round == 0:
        line.count = lap.count
        for k in range(lap.count):
            line.base[k, 0], line.base[k, 1] = lap.places[k, 0], lap.places[k, 1]
        for _ in range(_SMOOTHED):
            for column in range(2):
                _smooth(line.base[: line.count], column)
    _spread_evenly(line, lap.count // _APART[line.round])
    for k in range(line.count):
        before, after = line.base[k - 1 if k > 0 else line.count - 1], line.base[(k + 1) % line.count]
        dx, dy = after[0] - before[0], after[1] - before[1]
        apart = max(math.hypot(dx, dy), 1e-9)
        line.normal[k, 0], line.normal[k, 1] = -dy / apart, dx / apart
        line.aside[k, 0] = 0.0
    line.shape, line.done, line.next = 2, 0, 0


@kernel
def _smooth(points: FloatArray, column: int) -> None:
    """Move a column of each point of a closed line by half of the way to the middle of its neighbours."""
    count = len(points)
    first, before = points[0, column], points[count - 1, column]
    for k in range(count):
        here = points[k, column]
        after = points[k + 1, column] if k + 1 < count else first
        points[k, column] = 0.5 * here + 0.25 * (before + after)
        before = here


@kernel
def _spread_evenly(line: Record, count: int) -> None:
    """Replace the points of the closed line by so many that are evenly apart along it."""
    old = line.base[: line.count].copy()
    along = np.empty(line.count + 1)
    along[0] = 0.0
    for k in range(line.count):
        after = old[(k + 1) % line.count]
        along[k + 1] = along[k] + math.hypot(after[0] - old[k, 0], after[1] - old[k, 1])
    piece = 0
    line.spacing = along[line.count] / count
    for k in range(count):
        place = k * line.spacing
        while piece + 1 < line.count and along[piece + 1] <= place:
            piece += 1
        share = (place - along[piece]) / max(along[piece + 1] - along[piece], 1e-9)
        after = old[(piece + 1) % line.count]
        line.base[k, 0] = old[piece, 0] + share * (after[0] - old[piece, 0])
        line.base[k, 1] = old[piece, 1] + share * (after[1] - old[piece, 1])
    line.count = count


@kernel
def _read_room(line: Record, lap: Record, scan: Record, beams: int, car: Record) -> None:
    """Read the room to both sides of the next point off the ends of the beams from the places round it."""
    k = line.done
    x, y, normal_x, normal_y = line.base[k, 0], line.base[k, 1], line.normal[k, 0], line.normal[k, 1]
    best, least = line.next, math.inf  # of the places, which are as many to the metre as the points
    for aside in range(-2 * _AHEAD, 2 * _AHEAD + 1):
        place = (line.next + aside) % lap.count
        apart = math.hypot(lap.places[place, 0] - x, lap.places[place, 1] - y)
        if apart < least:
            best, least = place, apart
    line.next = best
    most = _MOVES[line.round]
    right, left, half = -most, most, 0.5 * car.width + _MARGIN
    tail, nose = -car.rear_overhang - _MARGIN, car.length - car.rear_overhang + _MARGIN
    for aside in range(-_BEHIND, _AHEAD + 1):
        place = (best + aside) % lap.count
        ends = wall_points(lap, place, scan, beams, car.lidar_offset)
        for beam in range(len(ends)):
            dx, dy = ends[beam, 0] - x, ends[beam, 1] - y
            if tail < normal_y * dx - normal_x * dy < nose:  # nor is NaN
                to_left = normal_x * dx + normal_y * dy
                if lap.to_left[place, beam] > 0 and to_left > -_THROUGH:
                    left = min(left, to_left - half)
                elif lap.to_left[place, beam] < 0 and to_left < _THROUGH:
                    right = max(right, to_left + half)
    if left < right:
        left = right = 0.5 * (left + right)
    line.aside[k, 1], line.aside[k, 2] = right, left


@kernel
def _sweep(line: Record) -> None:
    """Move each point once towards where the sum of the squared second differences is least, within its room."""
    count, aside = line.count, line.aside
    base, normal = line.base, line.normal
    for k in range(count):
        gradient = 0.0
        for other in range(-2, 3):
            at = k + other
            at += count if at < 0 else -count if at >= count else 0
            weight = 6.0 if other == 0 else -4.0 if abs(other) == 1 else 1.0
            x, y = base[at, 0] + aside[at, 0] * normal[at, 0], base[at, 1] + aside[at, 0] * normal[at, 1]
            gradient += weight * (x * normal[k, 0] + y * normal[k, 1])
        aside[k, 0] = min(max(aside[k, 0] - _RELAXED / 6.0 * gradient, aside[k, 1]), aside[k, 2])


@kernel
def _finish(line: Record, limiter: Record) -> None:
    """Write the points of the finished line."""
    count, points = line.count, line.points
    _spread_evenly(line, count)
    for k in range(count):
        before, here, after = line.base[(k - 1) % count], line.base[k], line.base[(k + 1) % count]
        dx, dy = after[0] - before[0], after[1] - before[1]
        points[k, X], points[k, Y], points[k, HEADING] = here[0], here[1], math.atan2(dy, dx)
        bend = (here[0] - before[0]) * (after[1] - here[1]) - (here[1] - before[1]) * (after[0] - here[0])
        points[k, CURVATURE] = bend / (line.spacing * line.spacing * 0.5 * math.hypot(dx, dy))
    _smooth(points[:count], CURVATURE)
    share, lag, car = _TURNING_USE * limiter.settings.turn_in_use, limiter.yaw_lag, limiter.car
    tightest = math.tan(car.max_steering_angle) / car.wheelbase
    rear_lag = car.yaw_inertia / (car.mass * car.front_axle_distance)
    for k in range(count):
        bend = points[k, CURVATURE]
        change = (points[(k + 1) % count, CURVATURE] - points[k - 1 if k > 0 else count - 1, CURVATURE])
        change /= 2.0 * line.spacing
        inwards, bend, change = bend * change > 0.0, abs(bend), abs(change)
        most = max(bend / _LATERAL_USE, lag * change / (share * limiter.settings.most_left))
        if inwards:  # the limiter turns the wheels in with a share of what cornering leaves
            most = max(most, lag * change / share + bend)
        near_lock = min(max((bend / tightest - _NEAR_LOCK) / (1.0 - _NEAR_LOCK), 0.0), 1.0)
        points[k, RADIUS] = (1.0 - _SLOWER * near_lock) / max(most, 1e-3)
        points[k, DEMAND] = bend + (lag if inwards else 2.0 * rear_lag) * change
        if bend > _TOO_SHARP * tightest:
            line.until = math.inf  # the car would leave the line: the planner drives
    line.ready, line.next = True, 0


@kernel
def forget_line(line: Record) -> None:
    """Begin to shape anew."""
    line.round, line.shape, line.done, line.ready, line.follows, line.until = 0, 0, 0, False, False, 0.0


@kernel
def follow_line(
    line: Record,
    lap: Record,
    scan: Record,
    ranges: FloatArray,
    limiter: Record,
    odometry: Record,
    reference: Record,
) -> int:
    """Write the reference that keeps the car on the line, or leads it there; return whether it is AWAY, NEAR or ON.

    AWAY, the reference is left as it is. NEAR, the speed is that of the reference, too.

    Args:
      line: of type KNOWN_LINE, ready; written to.
      lap: of type LAP_MAP, closed.
      scan: of type SCAN.
      ranges: readings (n,) [m], without NaN or inf.
      limiter: of type LIMITER.
      odometry: of type ODOMETRY.
      reference: of type REFERENCE, written to.
    """
    now, car = odometry.speed, limiter.car
    if lap.driven < line.until or not (sees(scan, ranges) and math.isfinite(now)):
        line.follows = False
        return AWAY
    if not line.follows:
        line.next = _nearest(line.points[: line.count], lap.x, lap.y)
    window = ahead_on(line)
    point = next_place(window, 0, lap.x, lap.y, lap.heading)
    line.next = (line.next + point) % line.count
    _, aside, turned = errors(window[point], lap.x, lap.y, lap.heading)
    if abs(aside) > _NEAR[0] or abs(turned) > _NEAR[1]:
        line.follows = False
        return AWAY
    free = free_on(window[point:], line.spacing, lap, scan, ranges, car)
    if free < 2.0 * _STOPS_BEFORE:
        line.follows, line.until = False, lap.driven + _PLANNER_DRIVES
        return AWAY
    speed = speed_on(window[point:], line.spacing, limiter, now)
    length = _LENGTH + _LENGTH_TIME * max(now, 0.0)
    steering = steer_within(window, point, lap.x, lap.y, lap.heading, now, car.wheelbase, late_by(car), length)
    wanted = abs(math.tan(steering)) / car.wheelbase
    held = limiter.lateral / max(now * now, 0.5)
    if not line.follows:
        bend = math.tan(odometry.steering_angle) / car.wheelbase
        off = abs(bend - window[point, CURVATURE])
        near = abs(aside) < _JOINS[0] and abs(turned) < _JOINS[1] and off < _JOINS[2] * held
        line.follows = near and now < speed + _JOINS[3]
    elif abs(aside) > _LEAVES:
        line.follows = False
    if not line.follows:  # towards a point further on: to lead the car there needs no sharp turns
        target = window[min(point + int((_REACH + _REACH_TIME * max(now, 0.0)) / line.spacing), _POINTS - 1)]
        dx, dy = target[X] - lap.x, target[Y] - lap.y
        cos, sin = math.cos(lap.heading), math.sin(lap.heading)
        steering = arc_through(cos * dx + sin * dy, cos * dy - sin * dx, car.wheelbase)
    elif abs(aside) > _JOINS[0]:
        speed = min(speed, math.sqrt(_CORRECTION_USE * limiter.lateral / max(wanted, 1e-3)))
    speed *= 1.0 - _SLOWER_OFF * min(max(abs(aside) - _ON_IT, 0.0), _LEAVES)
    speed = min(speed, math.sqrt(2.0 * _BRAKING_USE * limiter.braking * (free - _STOPS_BEFORE)))
    most = max(abs(window[point, CURVATURE]), _CORRECTION_USE * held)
    reference.steering_angle = saturate(steering, math.atan(car.wheelbase * most))
    reference.speed = min(reference.speed, speed) if not line.follows else speed
    dx, dy = window[point, X] - lap.x, window[point, Y] - lap.y
    cos, sin = math.cos(lap.heading), math.sin(lap.heading)
    reference.bearing = math.atan2(cos * dy - sin * dx, cos * dx + sin * dy)
    reference.distance = math.hypot(dx, dy)
    return ON if line.follows else NEAR


@kernel
def free_on(
    points: FloatArray, spacing: float, lap: Record, scan: Record, ranges: FloatArray, car: Record
) -> float:
    """Return how far ahead the first beam ends on the line [m], where no wall was; inf: none does.

    The line is that of `points` (n, 6); the other arguments are as of `follow_line`.
    """
    cos, sin = math.cos(lap.heading), math.sin(lap.heading)
    reach = 0.5 * car.width + _CLEAR
    for k in range(len(points)):
        dx, dy = points[k, X] - lap.x, points[k, Y] - lap.y
        ahead, left = cos * dx + sin * dy - car.lidar_offset, cos * dy - sin * dx
        distance = math.hypot(ahead, left)
        if ahead < 2.0 * reach or distance > FAR:
            continue
        middle = nearest_place(scan.angle_min, scan.angle_increment, ahead, left)
        half = reach / (distance * scan.angle_increment)
        step = max(2.0 * half / _BEAMS_A_POINT, 1.0)
        beam = max(middle - half, 0.0)
        while beam <= min(middle + half, len(ranges) - 1.0):
            bearing = scan.angle_min + scan.angle_increment * int(beam)
            off = ranges[int(beam)] - distance
            across = distance * (bearing - scan.angle_min - scan.angle_increment * middle)
            if off * off + across * across < reach * reach:
                return k * spacing
            beam += step
    return math.inf


@kernel
def ahead_on(line: Record) -> FloatArray:
    """Return the points of the line from the next one on (_POINTS, 6)."""
    window = np.empty((_POINTS, 6))
    for k in range(_POINTS):
        window[k] = line.points[(line.next + k) % line.count]
    return window


@kernel
def _nearest(points: FloatArray, x: float, y: float) -> int:
    """Return the index of the point that is nearest to a place [m]."""
    best, least = 0, math.inf
    for k in range(len(points)):
        dx, dy = points[k, X] - x, points[k, Y] - y
        if dx * dx + dy * dy < least:
            best, least = k, dx * dx + dy * dy
    return best


@kernel
def speed_on(points: FloatArray, spacing: float, limiter: Record, now: float) -> float:
    """Return the greatest speed [m/s] from which the tires hold the car through all that comes."""
    grip, braking = limiter.mu * limiter.car.gravity, _BRAKING_USE * limiter.braking
    ahead = min(int(_LOOKAHEAD * max(now, 0.0) / spacing + 0.5), len(points) - 1)
    square, best = math.inf, math.inf
    for k in range(len(points) - 1, -1, -1):
        corner = limiter.lateral * points[k, RADIUS]
        if square < corner:
            used = square * points[min(k + 1, len(points) - 1), DEMAND] / grip
            square += 2.0 * braking * longitudinal_share(used, limiter.braking_exponent) * spacing
        square = min(square, corner)
        if k == ahead or k == 0:
            best = min(best, square)
    return math.sqrt(best)
