"""Lap raceline: a line of short lap time through the ground of the first lap, and the speeds along it.

    shape_line(line, lap, geometry, beams, limiter, max_speed)  # in every tick until the line is ready
    state = follow_line(line, lap, geometry, ranges, limiter, odometry, reference)  # AWAY, NEAR or ON

1. Shaping. The line begins as the path of the first lap. In each of several rounds its points are spread evenly, and
   the room to both sides of each is read off the recorded ends of beams. The points are then moved sideways within that
   room so that the sum of the squared second differences is least. This quadratic program is solved by successive
   over-relaxation with projection. The first rounds have few points, so that the whole line moves. In the last rounds
   the points are moved so that the lap takes less time (least_time).
2. Trial. On tires that need slip angles, the line is followed only if the car's own simulated lap holds (lap_trial).
3. Joining. NEAR the line the car is led towards a point of it further on, with all the protections of the planner.
4. Following. ON the line the car steers along it (line_following). The limiter turns the wheels faster there, and
   braking takes nothing of the cornering. Known ground counts as free although it is not in sight, so neither the speed
   law of sight nor the safety filter applies.
5. Something new. Where a beam ends on the line, the car brakes to stop before it. Near to it, the planner drives again.

Sources: F. Braghin et al., Race driver model, Computers & Structures 86, 2008, for the line of least curvature;
A. Heilmeier et al., Minimum curvature trajectory planning and control for an autonomous race car, Vehicle System
Dynamics 58(10), 2020, for the rounds; C. Cryer, The Solution of a Quadratic Programming Problem Using Systematic
Overrelaxation, SIAM Journal on Control 9, 1971, for the relaxation.

Limits: what stands on the line behind a corner, and was not there in the first lap, is seen late: the car comes faster
than it could stop within what it sees. So from when a moving target has been seen on, the planner drives. A line that
is sharper somewhere than 1.08 times the curvature at full lock is not followed at all.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.messages import FloatArray

from ..control.actuation import apply_limits_of
from ..control.decision import extend_path_history
from ..control.planner_settings import Record
from ..control.reasons import REMEMBERED_LINE, log_step
from ..control.slip import lock_arc
from ..control.stages import Stage, Tick
from ..control.steering import arc_through, saturate
from ..control.tracking import CURVATURE, HEADING, X, Y, next_point
from ..perception.lap_map import LAP_MAP, PLACES, TOO_FAR, beam_directions, see_lap, tell_sides
from ..perception.scan_geometry import nearest_beam, period_of, sees
from .friction_limiter import LIMITER
from .lap_trial import HOLDS, TRIAL, TRYING, try_lap
from .least_time import average, quicken
from .line_following import (
    DEMAND,
    LEAVES,
    OFF,
    RADIUS,
    ahead_on,
    curvature_at,
    position_on,
    reference_on,
    speed_on,
    uses_on,
)

if TYPE_CHECKING:
    from ..control.planner import Planner

_APART = (4, 4, 4, 2, 2, 1, 1, 1, 1, 1, 1)  # spacing of the points in each round, in places
_MOVES = (1.0, 0.8, 0.6, 0.4, 0.3, 0.2, 0.15, 0.4, 0.3, 0.2, 0.2)  # [m] at most to each side in each round
_SHORTER = 7  # first of the rounds in which the lap gets shorter
_TIMES = 16  # moves in such a round
_SWEEPS = 500  # of a round
_RELAXED = 1.7  # over-relaxation
_SMOOTHED = 6  # times that the path is smoothed before the first round
_MARGIN = 0.16  # [m] between the car's outline and walls
_BEHIND, _AHEAD = 6, 10  # places whose beams are read for the room at a point
_THROUGH = 0.6  # [m] by which the line may lead through a wall, before its points are moved
_PLACES_A_TICK = 12  # whose beams are told to be to the left or right in a tick
_POINTS_A_TICK = 48  # whose room is read in a tick
_MOVES_A_TICK = 30_000  # of points
_NEAR_LOCK = 0.8  # share of the curvature at full lock from which on the car is slower, as it hardly can correct
_SLOWER = 0.5  # share by which the squared speed is less at full lock
_CUSP = 1.6  # spacings from the point before to the one after, below which the line turns back at a point
_TOO_SHARP = 1.08  # share of the curvature at full lock: a line that is sharper somewhere is not followed
_TURNS_FASTER = 1.35  # times the share of the grip for turning the wheels, on the line
_TURNING_USE = 0.58  # share of the limiter's steering rate; in the mean of a tick the servo turns with .59 of it
_NEAR = (1.5, 0.7)  # [m] to the side of the line and [rad] from it, within which the car is led to it
# within which the car begins to follow the line: [m] to its side, [rad] from it, share of the cornering acceleration
# from its curvature, and [m/s] above its speed
_JOINS = (OFF, 0.2, 0.3, 0.0)
_REACH, _REACH_TIME = 0.8, 0.3  # [m] and [s] to the point of the line to which the car is led
_CLEAR = 0.05  # [m] to each side of the car, within which the end of a beam on the line is something new
_BEAMS_A_POINT = 24  # that are looked at for each point, at most
_STOPS_BEFORE = 1.0  # [m] between the rear axle and something new at which the car stands
_LINE_USE = 1.0  # share of the grip for cornering on the line, when the car is too fast
_PLANNER_DRIVES = 5.0  # [m] after something new was within twice that

AWAY, NEAR, ON = range(3)
"""Where the car is: the planner drives, the car is led to the line, or it follows the line."""

LINE = np.dtype(
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
        ("weight", np.float64),  # of the change of curvature, see least_time
        ("aside", np.float64, (PLACES, 3)),  # [m] to the left: how far each is moved, at least and at most
        ("limiter", LIMITER),  # of a car on the line
        ("trial", TRIAL),  # of a lap on it, on soft tires
        ("points", np.float64, (PLACES, 6)),  # x, y [m], heading [rad], curvature [1/m], RADIUS and DEMAND
    ]
)
"""Type of a line, and of what is kept of it from tick to tick; zero at the beginning."""

REMEMBERED = np.dtype([("lap", LAP_MAP), ("line", LINE), ("among_targets", np.bool_)])
"""Type of all that is remembered of the first lap."""


@kernel
def shape_line(line: Record, lap: Record, geometry: Record, beams: int, limiter: Record, max_speed: float) -> None:
    """Do a tick's part of the shaping.

    Args:
      line: of type LINE, written to.
      lap: of type LAP_MAP, closed.
      geometry: of type SCAN_GEOMETRY.
      beams: of a scan.
      limiter: of type LIMITER.
      max_speed: [m/s].
    """
    _limit(line, limiter)
    if line.shape == 0:
        for _ in range(_PLACES_A_TICK):
            if line.done < lap.count:
                tell_sides(lap, line.done, geometry, beams, limiter.car.lidar_offset)
                line.done += 1
        if line.done == lap.count:
            line.shape = 1
    elif line.shape == 1:
        _spread(line, lap)
    elif line.shape == 2:
        directions = beam_directions(geometry, beams)
        for _ in range(_POINTS_A_TICK):
            if line.done < line.count:
                _read_room(line, lap, directions, limiter.car)
                line.done += 1
        if line.done == line.count:
            line.shape, line.done = 3, 0
    elif line.round < _SHORTER:
        for _ in range(max(1, _MOVES_A_TICK // line.count)):
            if line.done < _SWEEPS:
                _sweep(line)
                line.done += 1
        if line.done == _SWEEPS:
            _end_round(line)
    else:
        places, normals, aside = line.base[: line.count], line.normal[: line.count], line.aside[: line.count]
        lateral_use, braking_use = uses_on(limiter)
        line.weight = quicken(places, normals, aside, line.weight, line.limiter, lateral_use, braking_use, max_speed)
        line.done += 1
        if line.done == _TIMES:
            _end_round(line)


@kernel
def _end_round(line: Record) -> None:
    """Put the points where they have been moved to. After the last round the line is finished."""
    line.shape, line.round, line.weight = 1, line.round + 1, 1.0
    for k in range(line.count):
        line.base[k, 0] += line.aside[k, 0] * line.normal[k, 0]
        line.base[k, 1] += line.aside[k, 0] * line.normal[k, 1]
    if line.round == len(_APART):
        _finish(line, line.limiter)


@kernel
def _spread(line: Record, lap: Record) -> None:
    """Spread the points of the line evenly for a round."""
    if line.round == 0:
        line.count = lap.count
        for k in range(lap.count):
            line.base[k, 0], line.base[k, 1] = lap.places[k, 0], lap.places[k, 1]
        for _ in range(_SMOOTHED):
            for column in range(2):
                average(line.base[: line.count, column])
    _spread_evenly(line, lap.count // _APART[line.round])
    for k in range(line.count):
        before, after = line.base[k - 1 if k > 0 else line.count - 1], line.base[(k + 1) % line.count]
        dx, dy = after[0] - before[0], after[1] - before[1]
        apart = max(math.hypot(dx, dy), 1e-9)
        line.normal[k, 0], line.normal[k, 1] = -dy / apart, dx / apart
        line.aside[k, 0] = 0.0
    line.shape, line.done, line.next = 2, 0, 0


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
        distance = k * line.spacing
        while piece + 1 < line.count and along[piece + 1] <= distance:
            piece += 1
        share = (distance - along[piece]) / max(along[piece + 1] - along[piece], 1e-9)
        after = old[(piece + 1) % line.count]
        line.base[k, 0] = old[piece, 0] + share * (after[0] - old[piece, 0])
        line.base[k, 1] = old[piece, 1] + share * (after[1] - old[piece, 1])
    line.count = count


@kernel
def _read_room(line: Record, lap: Record, directions: FloatArray, car: Record) -> None:
    """Read the room to both sides of the next point off the ends of the beams from the places round it.

    `directions` are those of the beams that are kept, see `beam_directions`.
    """
    k = line.done
    x, y, normal_x, normal_y = line.base[k, 0], line.base[k, 1], line.normal[k, 0], line.normal[k, 1]
    best, least = line.next, math.inf  # of the places, which are as many to the metre as the points
    for aside in range(-2 * _AHEAD, 2 * _AHEAD + 1):
        index = (line.next + aside) % lap.count
        apart = math.hypot(lap.places[index, 0] - x, lap.places[index, 1] - y)
        if apart < least:
            best, least = index, apart
    line.next = best
    most = _MOVES[line.round]
    right, left, half = -most, most, 0.5 * car.width + _MARGIN
    tail, nose = -car.rear_overhang - _MARGIN, car.length - car.rear_overhang + _MARGIN
    for aside in range(-_BEHIND, _AHEAD + 1):
        index = (best + aside) % lap.count
        cos, sin = math.cos(lap.places[index, 2]), math.sin(lap.places[index, 2])
        from_x = lap.places[index, 0] + car.lidar_offset * cos - x
        from_y = lap.places[index, 1] + car.lidar_offset * sin - y
        # the lidar and the beam's direction, along the line's normal and across it
        cross, along = normal_y * from_x - normal_x * from_y, normal_x * from_x + normal_y * from_y
        turned_cos, turned_sin = normal_x * cos + normal_y * sin, normal_y * cos - normal_x * sin
        for beam in range(len(directions)):
            distance, forward, sideways = lap.ranges[index, beam], directions[beam, 0], directions[beam, 1]
            if distance < TOO_FAR and tail < cross + distance * (turned_sin * forward - turned_cos * sideways) < nose:
                to_left = along + distance * (turned_cos * forward + turned_sin * sideways)
                if lap.to_left[index, beam] > 0 and to_left > -_THROUGH:
                    left = min(left, to_left - half)
                elif lap.to_left[index, beam] < 0 and to_left < _THROUGH:
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
        if math.hypot(dx, dy) < _CUSP * line.spacing:
            line.until = math.inf  # the line goes to and fro, where the car turned in moves: the planner drives
    average(points[:count, CURVATURE])
    lateral_use, _ = uses_on(limiter)
    share, lag, car = _TURNING_USE * limiter.settings.turn_in_use, limiter.yaw_lag, limiter.car
    tightest = math.tan(lock_arc(limiter.slip, car)) / car.wheelbase
    rear_lag = car.yaw_inertia / (car.mass * car.front_axle_distance)
    for k in range(count):
        bend = points[k, CURVATURE]
        change = points[(k + 1) % count, CURVATURE] - points[k - 1 if k > 0 else count - 1, CURVATURE]
        change /= 2.0 * line.spacing
        inwards, bend, change = bend * change > 0.0, abs(bend), abs(change)
        most = max(bend / lateral_use, lag * change / (share * limiter.settings.most_left))
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
    line.trial.begun, line.trial.state = False, TRYING


@kernel
def follow_line(
    line: Record,
    lap: Record,
    geometry: Record,
    ranges: FloatArray,
    limiter: Record,
    odometry: Record,
    reference: Record,
) -> int:
    """Write the reference that keeps the car on the line, or leads it there; return whether it is AWAY, NEAR or ON.

    AWAY, the reference is left as it is. NEAR, the speed is that of the reference, too.

    Args:
      line: of type LINE, ready; written to.
      lap: of type LAP_MAP, closed.
      geometry: of type SCAN_GEOMETRY.
      ranges: readings (n,) [m], without NaN or inf.
      limiter: of type LIMITER.
      odometry: of type ODOMETRY.
      reference: of type REFERENCE, written to.
    """
    _limit(line, limiter)
    limiter = line.limiter
    now, car = odometry.speed, limiter.car
    if lap.driven < line.until or not (sees(geometry, ranges) and math.isfinite(now)):
        line.follows = False
        return AWAY
    if not line.follows:
        line.next = _nearest(line.points[: line.count], lap.x, lap.y)
    window, spacing = ahead_on(line.points[: line.count], line.next), line.spacing
    point = next_point(window, 1, lap.x, lap.y, lap.heading)
    line.next = (line.next + point - 1) % line.count
    along, aside, turned = position_on(window, point, spacing, lap.x, lap.y, lap.heading)
    if abs(aside) > _NEAR[0] or abs(turned) > _NEAR[1]:
        line.follows = False
        return AWAY
    free = free_on(window[point:], spacing, lap, geometry, ranges, car)
    if free < 2.0 * _STOPS_BEFORE:
        line.follows, line.until = False, lap.driven + _PLANNER_DRIVES
        return AWAY
    if not line.follows:
        held = limiter.lateral / max(now * now, 0.5)
        off = abs(math.tan(odometry.steering_angle) / car.wheelbase - curvature_at(window, along))
        near = abs(aside) < _JOINS[0] and abs(turned) < _JOINS[1] and off < _JOINS[2] * held
        line.follows = near and now < speed_on(window, along, spacing, limiter, now) + _JOINS[3]
    elif abs(aside) > LEAVES:
        line.follows = False
    steering, speed, most = reference_on(window, along, aside, turned, spacing, limiter, now, line.follows)
    if not line.follows:  # towards a point further on: to lead the car there needs no sharp turns
        target = window[min(point + int((_REACH + _REACH_TIME * max(now, 0.0)) / spacing), len(window) - 1)]
        dx, dy = target[X] - lap.x, target[Y] - lap.y
        cos, sin = math.cos(lap.heading), math.sin(lap.heading)
        ahead, left = cos * dx + sin * dy, cos * dy - sin * dx
        if not _sees_way(ahead, left, geometry, ranges, car):  # a wall is between, as on the inside of a hairpin
            return AWAY
        steering = saturate(arc_through(ahead, left, car.wheelbase), most)
    speed = min(speed, math.sqrt(2.0 * uses_on(limiter)[1] * limiter.braking * (free - _STOPS_BEFORE)))
    reference.steering_angle = steering
    reference.speed = min(reference.speed, speed) if not line.follows else speed
    dx, dy = window[point, X] - lap.x, window[point, Y] - lap.y
    cos, sin = math.cos(lap.heading), math.sin(lap.heading)
    reference.bearing = math.atan2(cos * dy - sin * dx, cos * dx + sin * dy)
    reference.distance = math.hypot(dx, dy)
    return ON if line.follows else NEAR


@kernel
def _limit(line: Record, limiter: Record) -> None:
    """Write the limiter of a car on the line: a wheel turns faster, and braking leaves it the whole cornering.

    Tires that need slip angles keep the limiter that they have.
    """
    line.limiter = limiter
    if limiter.slip.needs_slip_angle:
        return
    settings = line.limiter.settings
    settings.turn_in_use = min(_TURNS_FASTER * limiter.settings.turn_in_use, 1.0)
    settings.lateral_use_in_braking = 1.0


@kernel
def free_on(
    points: FloatArray, spacing: float, lap: Record, geometry: Record, ranges: FloatArray, car: Record
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
        if ahead < 2.0 * reach or distance > TOO_FAR:
            continue
        middle = nearest_beam(geometry.angle_min, geometry.angle_increment, ahead, left)
        half = reach / (distance * geometry.angle_increment)
        step = max(2.0 * half / _BEAMS_A_POINT, 1.0)
        beam = max(middle - half, 0.0)
        while beam <= min(middle + half, len(ranges) - 1.0):
            bearing = geometry.angle_min + geometry.angle_increment * int(beam)
            off = ranges[int(beam)] - distance
            across = distance * (bearing - geometry.angle_min - geometry.angle_increment * middle)
            if off * off + across * across < reach * reach:
                return k * spacing
            beam += step
    return math.inf


@kernel
def _sees_way(ahead: float, left: float, geometry: Record, ranges: FloatArray, car: Record) -> bool:
    """Return whether no beam ends where the car's width leads straight from the rear axle to a place [m]."""
    distance, reach = math.hypot(ahead, left), 0.5 * car.width + _CLEAR
    for beam in range(len(ranges)):
        bearing = geometry.angle_min + geometry.angle_increment * beam
        x, y = car.lidar_offset + ranges[beam] * math.cos(bearing), ranges[beam] * math.sin(bearing)
        if 0.0 < x * ahead + y * left < distance * distance and abs(x * left - y * ahead) < reach * distance:
            return False
    return True


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
def _remember(tick: Tick) -> None:
    """Record the lap, and decide while the car is on its line."""
    driver, memory, reference, state = tick.driver, tick.memory, tick.reference, tick.state
    geometry, odometry = tick.geometry, tick.odometry
    state.among_targets |= memory.predictions.count > 0
    if state.among_targets:
        return
    see_lap(state.lap, geometry, tick.ranges_without_cars, odometry, driver.car.lidar_offset)
    if not tick.record.decided and _is_on_line(tick):
        extend_path_history(tick.record)
        speed, steering = min(reference.speed, reference.limit, driver.max_speed), reference.steering_angle
        limited = apply_limits_of(state.line.limiter, tick.record, steering, speed, _LINE_USE, 0.0)
        tick.command[0], tick.command[1] = limited
        tick.record.decided = True


@kernel
def _is_on_line(tick: Tick) -> bool:
    """Return whether the car is on its line, and write the reference that follows it.

    Until the line is ready, a tick's part of the work on it is done.
    """
    geometry, ranges, driver, memory = tick.geometry, tick.ranges, tick.driver, tick.memory
    lap, line, reference = tick.state.lap, tick.state.line, tick.reference
    if not lap.closed:
        forget_line(line)
        return False
    if not line.ready:
        shape_line(line, lap, geometry, len(ranges), driver.limiter, driver.max_speed)
        return False
    if driver.limiter.slip.needs_slip_angle and line.trial.state != HOLDS:
        if line.trial.state == TRYING and line.until < math.inf:
            _limit(line, driver.limiter)
            directions, period = beam_directions(geometry, len(ranges)), period_of(geometry)
            points = line.points[: line.count]
            try_lap(line.trial, points, line.spacing, lap, directions, line.limiter, driver.max_speed, period)
        return False
    if memory.guidance.follows and not line.follows:
        return False
    state = follow_line(line, lap, geometry, ranges, driver.limiter, tick.odometry, reference)
    if state != AWAY:
        log_step(memory.reasons, REMEMBERED_LINE, reference.steering_angle, reference.speed)
    return state == ON


REMEMBER = Stage(
    text="from the second lap on the car follows a line through the ground of the first", needs=("guidance",),
    needs_friction=True, after_guidance=_remember, state_type=REMEMBERED,
)  # fmt: skip
"""The stage `remember`: from the second lap on the car follows a line through the ground of the first."""


def line_of(planner: Planner) -> FloatArray:
    """Return the closed line of a planner that remembers, in the frame in which its first lap began.

    Shape (n, 2) [m]; no points while there is no line.
    """
    line = planner.stage_state("remember")["line"]
    return np.array(line["points"][: line["count"] if line["ready"] else 0, :2])
