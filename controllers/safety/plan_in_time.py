"""The plan in time: among things that move, motions of the car are judged by where everything is when.

A stop is no safe end where something will come by, and a way that is blocked now may be free when the car is there. So
near a target motions of some 3 s are tried, and the best one is driven for one tick:

1. Paths: towards the reference's goal, as the wheels stand, towards the place of the last plan, and through places
   across the way at the distance of the nearest target, of which every third is tried in each tick. The wheels turn on
   them as fast as the friction limiter lets them; walls end them.
2. Profiles: on each path the car goes on, creeps or waits for some time, and then brakes to a stop.
3. At each time a target is within an interval of its line, which ends where it is expected to turn: at a wall, or where
   it was seen to turn back twice. A motion is free if it touches none of them, and ends where none comes by: a stop in
   the lane of something that crosses is no end. Motions that only use up the margins come next, then those that touch
   something latest and slowest. What is not known to turn elsewhere may turn back now: motions are worth less that
   would then touch it, the less so the longer the car has waited.
4. A car that has waited for 3 s and more takes less of the margins of what is known to turn.
5. Of free motions the one wins that comes farthest in 2 s, with room beside targets and without turning the wheels to
   and fro. As it is chosen from few, the car has to be able to stop before what stands after the next tick, by the
   simulated stops of the safety filter. If no motion passes, the car brakes as that filter does.
6. Where no motion is free, and the car stands and is out of the way behind itself, it backs off, by 1 m at most; so it
   does where it stands before a wall, and nothing comes by behind.

Near a target the car goes at most _PASSING, and faster farther away: what turns is known some .2 s later. What drives
ahead as fast as a car does is one, and may not turn back.

Sources: D. Fox, W. Burgard and S. Thrun, The Dynamic Window Approach to Collision Avoidance, IEEE Robotics & Automation
Magazine 4(1), 1997, for sampled motions; K. Kant and S. Zucker, Toward Efficient Trajectory Planning: The Path-Velocity
Decomposition, International Journal of Robotics Research 5(3), 1986, for paths first and profiles then; S. Petti and
T. Fraichard, Safe Motion Planning in Dynamic Environments, IEEE/RSJ IROS 2005, for ends that stay free.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from fg_mujoco.compiled.kernels import inlined, kernel
from fg_mujoco.messages import FloatArray

from ..control.planner_settings import Record
from ..control.slip import lock_arc
from ..control.speed import share_of_way
from ..control.steering import arc_through, bearing_of_arc
from .predictions import COS, FROM_WALL, RADIUS, SEEN, SIN, SPEED, TO_WALL, TURNS, X, Y, occupied
from .rollout import FREE, Plan, Situation, among_standing, reading_towards, simulate

NO_PLAN, DRIVES, BACKS_OFF = range(3)
"""What a plan says: no motion passed, a steering angle and a speed, or that the car backs off."""

BACKING_SPEED = 1.0  # [m/s]

NEAR, FAR, TURNED = range(3)
"""Columns of spans."""

_NEAR, _BEHIND = 8.0, 1.0  # [m] to targets ahead, and in any direction, among which the car plans
_STEP, _STEPS = 0.1, 40  # [s] of a motion
_POINT, _POINTS = 0.15, 56  # [m] between points of a path
_SCORED = 2.0  # [s] in which the way counts
_PLACES, _ASIDE = 19, 0.15  # across the way, [m] between them
_PARTS, _PARTS_AMONG_MANY = 3, 4  # ticks in which all of them are tried; the second among three targets and more
_PATHS = _PLACES + 2
_FARTHEST, _NEAREST = 4.0, 1.0  # [m] to these places
_LOOKS = 1.3  # [m] to the point on the way to a place for which the car steers
_ARRIVED = 0.5  # [m]
_MARGIN, _WIDENED = 0.02, 0.02  # [m] besides those of targets, and round the car
_USED = 0.08  # [m] of all margins that a motion may use up where none is free
_BOLD_AFTER, _BOLD = 3.0, 0.06  # [s] of waiting, and of that again until margins of what is known are less by [m]
_PASSING = 3.0  # [m/s] past a target, and faster past one that drives ahead
_SLOWING = 0.5  # of the greatest braking, on the way to a target
_LANE, _CROSSES = 0.3, 0.7  # [m] beside the lane of one that crosses; greatest cosine of its course
_WAIT, _WAITS = 4, 3  # steps for which a car that has stopped should not be met, so many times
_GOES_ON, _KEPT = 4.0, 0.3  # worth [m] of 1 m of room, and of the last plan
_PASSED, _ROOM, _ROOM_WAITING = 2.0, 0.6, 0.1  # [m] of way from which on a motion passes; room that counts
_STEERS, _GOES_ASIDE = 3.0, 0.2  # [m/rad], [-]: cost of turning the wheels, and of a place's way aside
_TOUCHES, _TIGHT, _PER_METRE = -1000.0, -20.0, 100.0  # score of motions that touch, or use up margins
_MAY_TURN, _SOON = 5.0, 10  # worth [m] that nothing is touched that turns back at once, in so many steps
_FREE = -10.0  # a motion with a better score is free
_TRIED, _STOP_MARGINS = 8, (0.1, 0.05)  # motions whose stops are simulated, [m] with these margins
_MOST_TURN = 0.03  # [rad] that the wheels turn in a tick
_BACK, _BACKING_STEPS = 0.8, 15  # [m] backwards that are looked at
_WALLED, _WAITS_BEFORE_WALL = 3, 2.0  # points of the longest free path, with less of which a wall is ahead, and [s]
_FARTHEST_BACK, _DROVE = 1.0, 0.5  # [m] that the car backs off until it drives again, and [m/s] at which it does

# share of the onward speed and its time [s], twice; then the car brakes
_PROFILES = (
    (0.0, 0.0, 0.0, 0.0), (1.0, 0.4, 0.0, 0.0), (1.0, 0.8, 0.0, 0.0), (1.0, 1.2, 0.0, 0.0), (1.0, 1.8, 0.0, 0.0),
    (0.5, 0.6, 0.0, 0.0), (0.5, 1.2, 0.0, 0.0), (0.15, 0.5, 0.0, 0.0),
    (0.0, 0.3, 1.0, 0.8), (0.0, 0.6, 1.0, 0.8), (0.5, 0.5, 1.0, 0.8), (0.2, 1.0, 1.0, 0.8),
)  # fmt: skip

PLAN_IN_TIME = np.dtype(
    [
        ("tick", np.int64),
        ("kept", np.int64),  # tick of the last plan, through this place in the frame of the targets:
        ("x", np.float64),  # [m]
        ("y", np.float64),  # [m]
        ("waited", np.float64),  # [s] for which the car has been slow
        ("backed", np.float64),  # [m] that it has backed off since it last drove
    ]
)
"""Type of what is kept from tick to tick; zero at the beginning."""


@kernel
def is_among(rows: FloatArray) -> bool:
    """Return whether a target is so near that the car plans in time; `rows` are predictions (k, 12)."""
    for k in range(len(rows)):
        away = math.hypot(rows[k, X], rows[k, Y])
        if away < _BEHIND or (away < _NEAR and rows[k, X] > 0.0):
            return True
    return False


class Among(NamedTuple):
    """What the motions of a tick have in common."""

    here: Situation
    goal: tuple[float, float]  # ahead of the LiDAR and to its left [m]
    onwards: float  # [m/s] at which the car would go on
    room: float  # [m] of way to where the car may only pass
    servo: float  # share of the limiter's rate of turning with which the wheels turn
    spans: FloatArray  # of targets (m, k, 3) [m], see `_spans`
    reaches: FloatArray  # of targets (k,) [m], see `_reaches`
    may_turn: float  # worth [m] that a motion touches nothing that turns back at once


@kernel
def plan_in_time(
    here: Situation,
    plan: Record,
    pose: tuple[float, float, float],
    goal: tuple[float, float],
    onwards: float,
    may_back_off: bool,
) -> tuple[int, float, float]:
    """Return what to do, DRIVES and so on, and the steering angle [rad] and the speed [m/s] of a car that drives.

    Args:
      here: the situation.
      plan: of type PLAN_IN_TIME, written to.
      pose: x, y [m] and heading [rad] of the LiDAR in the frame of the targets.
      goal: bearing of the reference's goal from the LiDAR [rad], and its distance [m].
      onwards: speed at which the car would go on [m/s].
      may_back_off: whether the car stands, and may reverse.
    """
    rows, speed, parts = here.movers, here.speed, _PARTS if len(here.movers) < 3 else _PARTS_AMONG_MANY
    plan.tick += 1
    plan.waited = plan.waited + here.period if speed < 1.0 else 0.0
    if speed > _DROVE:
        plan.backed = 0.0
    bold = min(max(plan.waited - _BOLD_AFTER, 0.0) / _BOLD_AFTER, 1.0)
    among, far = _look_among(here, goal, onwards, bold)
    scores, places = np.full((_PATHS + 1, len(_PROFILES)), -math.inf), np.empty((_PATHS + 1, 2))
    path, longest = np.zeros((_POINTS, 6)), 0
    for number in range(_PATHS + 1):
        if 0 < number < _PLACES and (number + plan.tick) % parts != 0:
            continue
        found, x, y, aside = _place(among, plan, pose, goal[0], far, number)
        if not found:
            continue
        places[number, 0], places[number, 1] = x, y
        cost = _STEERS * abs(_steering_to(here.limiter.car, x, y) - here.angle) + _GOES_ASIDE * aside
        free = _lay(among, x, y, path)
        longest = max(longest, free)
        _judge(among, path, free, cost, scores[number])
        if number == _PATHS:
            scores[number] += _KEPT
    walled = longest < _WALLED and plan.waited > _WAITS_BEFORE_WALL
    may_back_off = may_back_off and plan.backed < _FARTHEST_BACK and (walled or np.max(scores) < _FREE)
    if may_back_off and _is_out_of_the_way_behind(here.limiter.car, rows, among.reaches, walled):
        plan.backed += max(-speed, 0.0) * here.period
        return BACKS_OFF, 0.0, 0.0
    return _choose(among, plan, pose, goal, scores, places)


@inlined
def _look_among(here: Situation, goal: tuple[float, float], onwards: float, bold: float) -> tuple[Among, float]:
    """Return what the motions have in common, and the distance [m] of the places across the way."""
    far, passing, rows, limiter = _FARTHEST, math.inf, here.movers, here.limiter
    for k in range(len(rows)):
        if rows[k, X] > -0.2:
            far = min(far, math.hypot(rows[k, X], rows[k, Y]))
            passing = min(passing, _PASSING + max(rows[k, SPEED] * rows[k, COS], 0.0))
    far = max(far, _NEAREST)
    room = far - _NEAREST + (passing * passing - _PASSING * _PASSING) / (2.0 * _SLOWING * limiter.braking)
    response, towards = limiter.settings.steering_response, (goal[1] * math.cos(goal[0]), goal[1] * math.sin(goal[0]))
    servo = share_of_way(here.period, response) * response / here.period  # in the mean of a tick
    spans, reaches, may_turn = _spans(rows, bold), _reaches(limiter.car, rows, bold), _MAY_TURN * (1.0 - bold)
    return Among(here, towards, onwards, room, servo, spans, reaches, may_turn), far


@kernel
def _place(
    among: Among, plan: Record, pose: tuple[float, float, float], bearing: float, far: float, number: int
) -> tuple[bool, float, float, float]:
    """Return whether a path leads through a place, where that is ahead and left [m], and how far aside [m]."""
    here, car = among.here, among.here.limiter.car
    if number == 0:
        return True, among.goal[0], among.goal[1], 0.0
    if number < _PLACES:
        aside = (number // 2) * _ASIDE * (1.0 if number % 2 == 0 else -1.0)
        towards = bearing + math.atan(aside / far)
        cos, sin = math.cos(towards), math.sin(towards)
        reach = min(far, reading_towards(here, cos, sin) - 0.1)
        return reach >= _ARRIVED, reach * cos, reach * sin, abs(math.atan(aside / far) * far)
    if number == _PLACES:
        return True, 1.2, 0.5 * math.tan(here.angle) / car.wheelbase * (1.2 + car.lidar_offset) ** 2, 0.0
    dx, dy, cos, sin = plan.x - pose[0], plan.y - pose[1], math.cos(pose[2]), math.sin(pose[2])
    x, y = cos * dx + sin * dy, cos * dy - sin * dx
    return plan.kept == plan.tick - 1 and x >= 0.4, x, y, 0.0


@kernel
def _choose(
    among: Among, plan: Record, pose: tuple[float, float, float], goal: tuple[float, float], scores: FloatArray,
    places: FloatArray,
) -> tuple[int, float, float]:  # fmt: skip
    """Return the best of the motions after whose next tick the car can stop before what stands."""
    here, cap = among.here, _cap(among.here.limiter, among.room)
    for margin in _STOP_MARGINS:
        left = scores.copy()
        for _ in range(_TRIED):
            best = int(np.argmax(left))
            number, k = best // len(_PROFILES), best % len(_PROFILES)
            if left[number, k] == -math.inf:
                break
            x, y, first = places[number, 0], places[number, 1], _first_speed(k, among.onwards, cap)
            if _can_stop(here, goal, x, y, first, margin):
                plan.kept, cos, sin = plan.tick, math.cos(pose[2]), math.sin(pose[2])
                plan.x, plan.y = pose[0] + cos * x - sin * y, pose[1] + sin * x + cos * y
                return DRIVES, _steering_to(here.limiter.car, x, y), first
            for other in range(len(_PROFILES)):  # their next command is the same
                if _first_speed(other, among.onwards, cap) == first:
                    left[number, other] = -math.inf
    return NO_PLAN, 0.0, 0.0


@kernel
def _first_speed(profile: int, onwards: float, cap: float) -> float:
    """Return the speed [m/s] with which a profile begins."""
    share, time = _PROFILES[profile][0], _PROFILES[profile][1]
    return min(share * onwards, cap) if time > 0.0 else 0.0


@kernel
def _steering_to(car: Record, x: float, y: float) -> float:
    """Return the steering angle [rad] towards a place in the frame of the LiDAR [m], by a point on the way to it."""
    nearer = min(1.0, _LOOKS / math.hypot(x + car.lidar_offset, y))
    return float(arc_through(nearer * (x + car.lidar_offset), nearer * y, car.wheelbase))


@kernel
def _cap(limiter: Record, room: float) -> float:
    """Return the greatest speed [m/s] at a way [m] ahead of where the car may only pass."""
    return math.sqrt(_PASSING * _PASSING + 2.0 * _SLOWING * limiter.braking * max(room, 0.0))


@kernel
def _reaches(car: Record, rows: FloatArray, bold: float) -> FloatArray:
    """Return for each target (k,) how near its middle a disc of the car may come [m]; one that is nearer may leave.

    `bold` is as of `occupied`.
    """
    reaches, front = np.empty(len(rows)), car.length - car.rear_overhang - 0.25 * car.width - car.lidar_offset
    for k in range(len(rows)):
        now = math.inf
        for offset in (front, 0.0, -car.lidar_offset):
            now = min(now, math.hypot(rows[k, X] - offset, rows[k, Y]))
        reach = 0.5 * car.width + _WIDENED + _MARGIN + rows[k, RADIUS]
        if rows[k, TURNS] >= 2.0:
            reach -= _BOLD * bold
        reaches[k] = max(min(reach, now - 0.02), 0.7 * reach)
    return reaches


@kernel
def _spans(rows: FloatArray, bold: float) -> FloatArray:
    """Return for each step and target (m, k, 3) the interval on its line [m], and its near end if it turns back now."""
    spans = np.empty((_STEPS + _WAIT * _WAITS + 1, len(rows), 3))
    for step in range(len(spans)):
        for k in range(len(rows)):
            near, far = occupied(rows[k], step * _STEP, bold)
            spans[step, k, NEAR], spans[step, k, FAR], spans[step, k, TURNED] = near, far, near
            if rows[k, TURNS] < 2.0 and step <= _SOON:
                back = rows[k, SPEED] * step * _STEP
                spans[step, k, TURNED] = min(near, -min(back, rows[k, FROM_WALL]) if rows[k, TURNS] > 0.0 else -back)
    return spans


@kernel
def _lay(among: Among, to_x: float, to_y: float, path: FloatArray) -> int:
    """Write the path of the rear axle through a place [m] and on to the goal; return how many of its points are free.

    `path` is (n, 6): x, y [m], cosine and sine of the heading, curvature [1/m], and the share of the lateral grip that
    turning the wheels takes.
    """
    here, limiter, car, speed = among.here, among.here.limiter, among.here.limiter.car, among.here.speed
    lock = math.tan(lock_arc(limiter.slip, car)) / car.wheelbase
    x, y, heading, curvature = -car.lidar_offset, 0.0, 0.0, math.tan(here.angle) / car.wheelbase
    cos, sin, last = 1.0, 0.0, False
    for point in range(len(path)):
        path[point, 0], path[point, 1], path[point, 2], path[point, 3], path[point, 4] = x, y, cos, sin, curvature
        if point > 0 and not _is_free(here, x, y, cos, sin):
            return point
        ahead, left = cos * (to_x - x) + sin * (to_y - y), cos * (to_y - y) - sin * (to_x - x)
        if ahead < _ARRIVED and not last:
            last = True
            to_x, to_y = among.goal
            ahead, left = cos * (to_x - x) + sin * (to_y - y), cos * (to_y - y) - sin * (to_x - x)
        if ahead < _ARRIVED:
            ahead, left = 1.0, 0.0
        nearer = min(1.0, _LOOKS / math.sqrt(ahead * ahead + left * left))
        wanted = 2.0 * left / ((ahead * ahead + left * left) * nearer)
        most = min(lock, 0.9 * limiter.lateral / max(speed * speed, 0.1))
        change, time = max(min(wanted, most), -most) - curvature, _POINT / max(speed, 0.7)
        cornering = speed * speed * curvature
        unused = max(limiter.lateral - math.copysign(cornering, change * cornering), 0.0)
        unused = min(unused, limiter.settings.most_left * limiter.lateral)
        rate = limiter.settings.turn_in_use * unused / (limiter.yaw_lag * max(speed, 0.5))
        rate = among.servo * min(rate, car.max_steering_rate / car.wheelbase)
        change = max(min(change, rate * time), -rate * time)
        path[point, 5] = limiter.yaw_lag * speed * abs(change) / (time * limiter.lateral)
        curvature += change
        aim = min(among.onwards, _cap(limiter, among.room - point * _POINT))
        speed = max(min(aim, speed + 0.8 * limiter.accelerating * time), speed - 0.7 * limiter.braking * time)
        x += _POINT * math.cos(heading + 0.5 * curvature * _POINT)
        y += _POINT * math.sin(heading + 0.5 * curvature * _POINT)
        heading += curvature * _POINT
        cos, sin = math.cos(heading), math.sin(heading)
    return 2 * len(path)


@kernel
def _is_free(here: Situation, x: float, y: float, cos: float, sin: float) -> bool:
    """Return whether the car's discs keep clear of what stands, at a place in the frame of the LiDAR."""
    car = here.limiter.car
    front = car.length - car.rear_overhang - 0.25 * car.width
    for offset in (front, car.lidar_offset, 0.0):
        at_x, at_y, more = x + offset * cos, y + offset * sin, 0.0
        if offset == front:
            more = 0.25 * car.width + _MARGIN
        if offset == front or at_x > 0.0:
            beyond = reading_towards(here, at_x, at_y)
            if not beyond > math.sqrt(at_x * at_x + at_y * at_y) + more:
                return False
    return True


@kernel
def _judge(among: Among, path: FloatArray, free: int, cost: float, scores: FloatArray) -> None:
    """Write the scores (p,) [m] of all profiles on a path; `free` is how many of its points are, `cost` its own [m]."""
    for k in range(len(_PROFILES)):
        gap, way = _try(among, path, free, _PROFILES[k], NEAR)
        scores[k] = gap
        if gap >= 0.0:
            scores[k] = way - cost + _GOES_ON * min(gap, _ROOM if way > _PASSED else _ROOM_WAITING)
            if _try(among, path, free, _PROFILES[k], TURNED)[0] < -_USED:
                scores[k] -= among.may_turn
        elif gap > 0.1 * _TOUCHES:
            scores[k] = way - cost + _PER_METRE * gap + _TIGHT


@kernel
def _try(
    among: Among, path: FloatArray, free: int, profile: tuple[float, float, float, float], near: int
) -> tuple[float, float]:
    """Return the room beside targets [m] and the way in _SCORED [m].

    Instead of the first, of a motion that touches something: _TOUCHES and more, the later and the slower it does.

    Args:
      among: what motions have in common.
      path: (n, 6), as of `_lay`.
      free: how many of its points are.
      profile: one of _PROFILES.
      near: NEAR, or TURNED for targets that turn back now.
    """
    limiter, speed, room = among.here.limiter, among.here.speed, among.room
    way, scored, gap = 0.0, 0.0, _ROOM
    slows = min(max(-among.here.memory.acceleration, 0.0), limiter.braking)
    for step in range(1, (_SOON if near == TURNED else _STEPS) + 1):
        time, point = step * _STEP, min(int(way / _POINT), len(path) - 2)
        share = max(1.0 - speed * speed * abs(path[point, 4]) / limiter.lateral - path[point, 5], 0.1)
        aim = 0.0
        if time - 0.5 * _STEP < profile[1]:
            aim = profile[0] * among.onwards
        elif time - 0.5 * _STEP < profile[1] + profile[3]:
            aim = profile[2] * among.onwards
        aim = min(aim, _cap(limiter, room - way))
        slows = min(slows + 3.0 * limiter.braking * _STEP, 0.9 * share * limiter.braking) if aim < speed else 0.0
        after = max(min(aim, speed + 0.8 * share * limiter.accelerating * _STEP), speed - slows * _STEP)
        way += 0.5 * (speed + after) * _STEP
        speed = after
        if time <= _SCORED:
            scored = way
        part = way / _POINT
        if part > len(path) - 2:
            break
        touched = _TOUCHES + time - 0.5 * speed
        if part + 0.5 > free:
            return touched, scored
        point = int(part)
        x = path[point, 0] + (part - point) * (path[point + 1, 0] - path[point, 0])
        y = path[point, 1] + (part - point) * (path[point + 1, 1] - path[point, 1])
        gap = _room_beside(among, step, (x, y, path[point, 2], path[point, 3]), gap, near)
        if gap < -_USED:
            return touched, scored
        if speed < 0.05 and not (profile[2] > 0.0 and time < profile[1] + profile[3]):
            met = _is_met(among, step, (x, y, path[point, 2], path[point, 3]), near)
            return (gap, scored) if met == math.inf else (_TOUCHES + time + met, scored)
    return gap, scored


@kernel
def _room_beside(among: Among, step: int, pose: tuple[float, float, float, float], gap: float, end: int) -> float:
    """Return the least room [m] beside targets at a step, at most `gap`; `pose` is x, y, cosine and sine."""
    x, y, cos, sin = pose
    car, rows = among.here.limiter.car, among.here.movers
    front = car.length - car.rear_overhang - 0.25 * car.width
    for k in range(len(rows)):
        row, reach, near, far = rows[k], among.reaches[k], among.spans[step, k, end], among.spans[step, k, FAR]
        along, across = row[COS] * (x - row[X]) + row[SIN] * (y - row[Y]), row[COS] * (y - row[Y])
        across -= row[SIN] * (x - row[X])
        on, aside = row[COS] * cos + row[SIN] * sin, row[COS] * sin - row[SIN] * cos
        if abs(across) > reach + _ROOM + front * abs(aside):  # none of the car's discs is near its line,
            continue
        if along + front + reach + _ROOM < near or along - front - reach - _ROOM > far:  # or near the target
            continue
        for offset in (front, car.lidar_offset, 0.0):
            apart = _apart(near, far, along + offset * on, across + offset * aside)
            if apart < (reach + gap) * (reach + gap):
                gap = math.sqrt(apart) - reach
    return gap


@kernel
def _is_met(among: Among, step: int, pose: tuple[float, float, float, float], end: int) -> float:
    """Return when a car that has stopped at a step is met [s], 0 in the lane of what crosses; inf: it is not."""
    x, y, cos, sin = pose
    car, rows = among.here.limiter.car, among.here.movers
    for k in range(len(rows)):
        row, reach = rows[k], among.reaches[k]
        along, across = row[COS] * (x - row[X]) + row[SIN] * (y - row[Y]), row[COS] * (y - row[Y])
        across -= row[SIN] * (x - row[X])
        on, aside = row[COS] * cos + row[SIN] * sin, row[COS] * sin - row[SIN] * cos
        lane = reach + (_LANE if abs(row[COS]) < _CROSSES else 0.0)
        for offset in (car.length - car.rear_overhang - 0.25 * car.width, car.lidar_offset, 0.0):
            at, off = along + offset * on, across + offset * aside
            if abs(off) < lane and -row[FROM_WALL] - 0.2 < at < row[TO_WALL] + 0.2:
                return 0.0
            for wait in range(1, _WAITS + 1):
                later = among.spans[step + _WAIT * wait, k]
                if _apart(later[end], later[FAR], at, off) < reach * reach:
                    return 0.1 * wait
    return math.inf


@kernel
def _apart(near: float, far: float, along: float, across: float) -> float:
    """Return the square of the distance [m^2] of a place from an interval on a target's line."""
    off = max(max(near - along, along - far), 0.0)
    return off * off + across * across


@kernel
def _is_out_of_the_way_behind(car: Record, rows: FloatArray, reaches: FloatArray, walled: bool) -> bool:
    """Return whether a car that reverses keeps away from what would touch it where it stands; `walled`: or from all."""
    front = car.length - car.rear_overhang - 0.25 * car.width - car.lidar_offset
    stands = backs = 0.0
    for step in range(1, _BACKING_STEPS + 1):
        back = min(max(step * _STEP - SEEN, 0.0), 1.0) * _BACK
        for k in range(len(rows)):
            row = rows[k]
            near, far = occupied(row, step * _STEP, 0.0)
            for offset in (front, 0.0, -car.lidar_offset):
                dx, dy = offset - row[X], -row[Y]
                along, across = row[COS] * dx + row[SIN] * dy, row[COS] * dy - row[SIN] * dx
                stands = min(stands, math.sqrt(_apart(near, far, along, across)) - reaches[k])
                along, across = along - back * row[COS], across + back * row[SIN]
                backs = min(backs, math.sqrt(_apart(near, far, along, across)) - reaches[k])
    return backs > max(stands + 0.02, -_USED) or (walled and backs == 0.0)


@kernel
def _can_stop(here: Situation, goal: tuple[float, float], x: float, y: float, first: float, margin: float) -> bool:
    """Return whether the car can stop before what stands, after a tick towards a place x, y at a speed `first` [m/s].

    It stops towards the goal, towards that place, or as its wheels then stand. `margin` is ahead of the bumper [m].
    """
    car, settings, nowhere = here.limiter.car, here.settings, np.empty((0, 4))
    angle = here.angle + max(min(0.7 * (_steering_to(car, x, y) - here.angle), _MOST_TURN), -_MOST_TURN)
    along = bearing_of_arc(angle, settings.pursuit_distance, car.lidar_offset, car.wheelbase)
    view = reading_towards(here, math.cos(along), math.sin(along))
    alone = among_standing(here, angle)
    for way in (goal, (math.atan2(y, x), math.hypot(x, y)), (along, max(view, _ARRIVED))):
        for use in (1.0, 0.5):
            if simulate(alone, Plan(way[0], way[1], nowhere, first, margin), use, here.speed).what == FREE:
                return True
    return False
