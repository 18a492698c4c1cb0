"""Among other cars: which to keep behind, which to pass and on which side, and how fast.

A car ahead is followed, at a distance at which the car could stop behind it should it brake, until there is
`room_to_pass` beside it, more for each m/s, along the way that it drives meanwhile, as far as the course is seen
(corridor). A pass is given up where there is less than `room_to_go_on`, unless the cars are beside each other already,
where they are not after 5 s, and where they come nearer to each other than a margin. Next to another car the planner's
car keeps its lane. It closes in on a car ahead only while it is clear of it sidewise.
Source of the distance: S. Shalev-Shwartz, S. Shammah and A. Shashua, On a Formal Model of Safe and Scalable
Self-driving Cars, arXiv 1708.06374, where it is called the safe longitudinal distance.
"""

from __future__ import annotations

import math

import numpy as np

from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.controllers.control.planner_settings import Record
from fg_mujoco.controllers.control.slip import late_on_path
from fg_mujoco.controllers.control.steering import late_by, saturate
from fg_mujoco.controllers.control.tracking import steer_along
from fg_mujoco.controllers.perception.scan_geometry import period_of
from fg_mujoco.controllers.safety import predictions as rows
from fg_mujoco.controllers.safety.predictions import MOST_CARS
from fg_mujoco.messages import FloatArray

from .corridor import HEADING, LEFT, MOST_POINTS, RIGHT, STEP, X, Y, ground_points, walk
from .other_cars import OTHER_CARS, TOLD, seen_from

FOLLOWS, PASSES, DROPS_BACK = 0, 1, 2

_PLACES = 15  # of a walk: 3.5 m
_BRAKING_TIME = 0.1  # [s] until the car brakes after another
STANDING, STANDS_FOR = 0.35, 2.0  # [m/s] and [s] of a car that may stand for good, and is an obstacle
_PASSED_BY = 0.4  # [m] from bumper to bumper behind the car, up to which another matters
_PREDICTED = 0.8  # [s] for which the curvature of the other car's way is its mean
_LEAST_SIGHT, _SIGHT = 0.9, 0.25  # [m] and [s] of the way at its speed: how far ahead a lane is followed
_STEP, _LEAST_LANE = 0.2, 3  # [m] between places of the motion, and the fewest of them
_GRIP, _SLOWING = 0.8, 0.4  # shares of the grip for cornering on the motion, and for braking before
_LONGEST = 5.0  # [s] of a pass before the car is beside the other one
_HELD = 0.85  # of its speed is left when another car begins to brake before the planner's car has passed
_SPREAD = 0.15  # [m/s] uncertainty of its speed

PASSING = np.dtype(
    [
        ("what", np.int64),  # FOLLOWS, PASSES or DROPS_BACK
        ("side", np.int64),  # on which it passes: 1 to the left, -1 to the right
        ("along", np.float64),  # [m] by which the middle of the other car is ahead of that of the planner's car
        ("across", np.float64),  # [m] by which the planner's car is to its left
        ("speed", np.float64),  # [m/s] of the other car in the direction of both
        ("stood", np.float64),  # [s] for which the other car has stood
        ("waits", np.float64),  # [s] before the next pass begins
        ("lasts", np.float64),  # [s] for which it passes and is still behind
        ("places", np.int64),  # of its way
        ("way", np.float64, (_PLACES, 5)),  # on which it is expected, see corridor.walk
    ]
)
RACING = np.dtype([("seen", OTHER_CARS), ("told", TOLD), ("met", np.bool_), ("passing", PASSING, (MOST_CARS,))])
"""Type of what a planner among other cars keeps from tick to tick; zero at the beginning."""


@kernel
def choose(memory: Record, geometry: Record, without: FloatArray, car: Record, settings: Record) -> float:
    """Decide for each car in sight whether to follow or to pass it; return the greatest speed [m/s], inf: any.

    `without` (n,) [m] are readings without cars; the others have the parameters of `car`.
    """
    points, limit = np.empty((MOST_POINTS, 2)), math.inf
    count = ground_points(geometry, without, points)
    seen, to_middle = memory.seen, car.lidar_offset - (0.5 * car.length - car.rear_overhang)
    for k in range(MOST_CARS):
        other, passing = seen.cars[k], memory.passing[k]
        slow = other.age > 0 and math.hypot(other.vx, other.vy) < STANDING
        passing.stood = passing.stood + period_of(geometry) if slow else 0.0
        if other.age == 0 or not other.moves or passing.stood > STANDS_FOR:
            passing.what = FOLLOWS
            passing.places = 0
            passing.waits = 0.0
            continue
        x, y = seen_from(seen, other.x, other.y)
        heading = other.heading - seen.heading
        heading -= 2.0 * math.pi * round(heading / (2.0 * math.pi))
        passing.places = walk(points, count, x, y, heading, passing.way)
        if other.unseen > 0.0 and passing.places > 2:  # it follows the course
            towards, fast = seen.heading + passing.way[1, HEADING], math.hypot(other.vx, other.vy)
            other.vx, other.vy, other.heading = fast * math.cos(towards), fast * math.sin(towards), towards
        between = 0.5 * heading  # a car that has turned into the next corner is ahead
        dx = x + to_middle
        passing.along = math.cos(between) * dx + math.sin(between) * y
        passing.across = math.sin(between) * dx - math.cos(between) * y
        passing.speed = max(math.hypot(other.vx, other.vy) * math.cos(between), 0.0)
        gap = math.hypot(dx, y) - car.length
        passing.waits = max(passing.waits - period_of(geometry), 0.0)
        still_behind = passing.what == PASSES and passing.along > car.length
        passing.lasts = passing.lasts + period_of(geometry) if still_behind else 0.0
        _choose_one(passing, gap, car, settings)
        limit = min(limit, _speed_beside(passing, gap, car, settings))
    return limit


@kernel
def _choose_one(passing: Record, gap: float, car: Record, settings: Record) -> None:
    """Decide what to do about a car."""
    along, across = passing.along, passing.across
    if along < -car.length - _PASSED_BY:
        passing.what = FOLLOWS
        return
    is_beside = abs(along) < car.length
    if passing.what == FOLLOWS and is_beside and abs(across) > car.width:
        passing.what, passing.side = PASSES, 1 if across > 0.0 else -1
    meanwhile = passing.speed * max(along + car.length, 0.0) / settings.closing
    rooms = _rooms(passing, min(meanwhile, (_PLACES - 1) * STEP), car)
    if passing.what != FOLLOWS and is_beside and abs(across) > 0.5 * car.width:
        passing.side = 1 if across > 0.0 else -1
    need = settings.room_to_pass + settings.room_by_speed * passing.speed
    if passing.what == FOLLOWS:
        side = 0 if rooms[0] + (0.1 if across > 0.0 else 0.0) >= rooms[1] + (0.1 if across < 0.0 else 0.0) else 1
        if gap < settings.look_at and rooms[side] >= need and passing.waits == 0.0:
            passing.what, passing.side = PASSES, 1 - 2 * side
        return
    if passing.what == PASSES:
        room = rooms[0] if passing.side > 0 else rooms[1]
        least = settings.room_to_go_on
        too_near = is_beside and abs(across) < car.width + settings.car_margin and along > 0.0
        too_long = passing.lasts > _LONGEST  # on the other side there may be more room
        if (along > 0.5 * car.length and room < least) or too_near or too_long:
            passing.what, passing.waits = DROPS_BACK, settings.patience
    if passing.what == DROPS_BACK and along > 1.1 * car.length:
        passing.what = FOLLOWS


@kernel
def _rooms(passing: Record, way: float, car: Record) -> tuple[float, float]:
    """Return the least room to the left and to the right of the other car on its way [m]; 0: it is not seen so far."""
    last = math.ceil(way / STEP)
    if last >= passing.places:
        return 0.0, 0.0
    left = right = math.inf
    for k in range(last + 1):
        left, right = min(left, passing.way[k, LEFT]), min(right, passing.way[k, RIGHT])
    return left - 0.5 * car.width, right - 0.5 * car.width


@kernel
def _speed_beside(passing: Record, gap: float, car: Record, settings: Record) -> float:
    """Return the greatest speed next to a car, or behind it [m/s]."""
    if passing.along < -0.5 * car.length:
        return math.inf
    clear = settings.clear + settings.clear_by_speed * passing.speed
    if passing.what == PASSES and abs(passing.across) > car.width + clear:
        if passing.along < car.length:
            return float(passing.speed + settings.closing)
        room = max(gap - settings.behind, 0.0)
        return float(_HELD * passing.speed + max(settings.closing, math.sqrt(2.0 * settings.slowing * room)))
    if passing.what == DROPS_BACK:
        gap = passing.along - car.length
    elif passing.along < 0.0:
        return math.inf
    slowed = settings.slowing * _BRAKING_TIME
    stop = settings.slowing / settings.braking * passing.speed * passing.speed
    square = slowed * slowed + 2.0 * settings.slowing * (gap - settings.behind) + stop
    return float(max(math.sqrt(max(square, 0.0)) - slowed, 0.0))


@kernel
def predict_cars(memory: Record, car: Record, braking: float, predictions: Record) -> None:
    """Add the cars ahead or beside, braking by [m/s^2], to the predictions: three discs each, along the course."""
    for k in range(MOST_CARS):
        other, passing = memory.seen.cars[k], memory.passing[k]
        if passing.places == 0 or passing.along < -0.25 * car.length:
            continue
        speed = math.hypot(other.vx, other.vy)
        last = min(passing.places - 1, max(int(_PREDICTED * speed / STEP), 2))
        curvature = 0.0
        if last > 0:
            curvature = (passing.way[last, HEADING] - passing.way[0, HEADING]) / (last * STEP)
        reach = 0.5 * car.length - 0.5 * car.width
        heading = passing.way[0, HEADING]
        for index in range(-1, 2):
            row = predictions.rows[predictions.count]
            predictions.count += 1
            predictions.cars += 1
            row[rows.X] = passing.way[0, X] + index * reach * math.cos(heading)
            row[rows.Y] = passing.way[0, Y] + index * reach * math.sin(heading)
            row[rows.COS], row[rows.SIN] = math.cos(heading), math.sin(heading)
            row[rows.SPEED], row[rows.RADIUS] = speed, 0.5 * car.width
            row[rows.TO_WALL], row[rows.BRAKING] = math.inf, braking
            row[rows.SPREAD] = _SPREAD if speed > STANDING else 0.0
            row[rows.CURVATURE] = curvature


@kernel
def pose_on(passing: Record, way: float) -> tuple[float, float, float]:
    """Return where a car is when it has come so far on its way [m]: place [m] and heading [rad]."""
    first = min(int(way / STEP), passing.places - 1)
    row, beyond = passing.way[first], way - first * STEP
    return row[X] + beyond * math.cos(row[HEADING]), row[Y] + beyond * math.sin(row[HEADING]), row[HEADING]


@kernel
def take_lane(memory: Record, own_speed: float, driver: Record, settings: Record, reference: Record) -> None:
    """Write the reference beside the nearest car that is passed, if there is one: a motion, its steering and its speed.

    The lane is the way of the other car, moved aside: as far as the wall there allows, at least to the middle of the
    room, and no farther than `aside` from side to side. The motion leads to it by pure pursuit, with a share of the
    grip.
    """
    nearest, least, car, limiter = -1, math.inf, driver.car, driver.limiter
    for k in range(MOST_CARS):
        passing = memory.passing[k]
        if passing.places > 0 and passing.what != FOLLOWS and abs(passing.along) < least:
            nearest, least = k, abs(passing.along)
    if nearest < 0:
        return
    passing = memory.passing[nearest]
    widest = max(settings.aside + 0.5 * car.width, abs(passing.across) - 0.5 * car.width)
    points = np.empty((_PLACES, 2))  # of the lane, in the frame of the rear axle
    for k in range(passing.places):
        row = passing.way[k]
        room = (row[LEFT] if passing.side > 0 else row[RIGHT]) - 0.5 * car.width
        away = max(0.5 * room, room - settings.beside_wall - 0.5 * car.width)
        off = passing.side * (0.5 * car.width + min(away, widest))
        points[k, 0] = row[X] - off * math.sin(row[HEADING]) + car.lidar_offset
        points[k, 1] = row[Y] + off * math.cos(row[HEADING])
    sharpest = math.tan(car.max_steering_angle) / car.wheelbase
    if driver.has_limiter:
        sharpest = min(sharpest, _GRIP * limiter.lateral / max(own_speed * own_speed, 0.01))
    sight = max(_LEAST_SIGHT, _SIGHT * own_speed)
    x, y, heading, first, count, square = 0.0, 0.0, 0.0, 0, 0, math.inf
    while count < len(reference.lane):
        cos, sin, ahead, left = math.cos(heading), math.sin(heading), 0.0, 0.0
        while first < passing.places:
            dx, dy = points[first, 0] - x, points[first, 1] - y
            ahead, left = cos * dx + sin * dy, cos * dy - sin * dx
            if ahead > 0.0 and ahead * ahead + left * left >= sight * sight:
                break
            first += 1
        if first == passing.places:
            break
        wanted = 2.0 * left / (ahead * ahead + left * left)
        curvature = saturate(wanted, sharpest)
        x += _STEP * math.cos(heading + 0.5 * curvature * _STEP)
        y += _STEP * math.sin(heading + 0.5 * curvature * _STEP)
        heading += curvature * _STEP
        if driver.has_limiter and wanted != 0.0:
            before = 2.0 * _SLOWING * limiter.braking * count * _STEP
            square = min(square, _GRIP * limiter.lateral / abs(wanted) + before)
        row = reference.lane[count]
        row[0], row[1], row[2], row[3] = x, y, heading, curvature
        count += 1
    if count < _LEAST_LANE:
        return
    reference.lane_points = count
    path_late = late_on_path(limiter.slip, car, own_speed)
    reference.steering_angle = steer_along(
        reference.lane[:count], 0, (0.0, 0.0, 0.0), own_speed, car.wheelbase, late_by(car), path_late
    )
    reference.bearing = math.atan2(reference.lane[count - 1, 1], reference.lane[count - 1, 0] - car.lidar_offset)
    reference.distance = math.hypot(reference.lane[count - 1, 1], reference.lane[count - 1, 0] - car.lidar_offset)
    reference.speed = min(math.sqrt(square), driver.max_speed)
