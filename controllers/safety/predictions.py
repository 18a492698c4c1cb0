"""Predicted paths of moving targets: where they may be when the car is there, and in the car's simulated stops.

A target is a disc that goes on along the line of its velocity. At a time t it is somewhere between two places on this
line: as far as it comes if it holds its speed, and where it is if it begins to brake now. Both grow apart by the
uncertainty of its speed. Where the line meets what stands, the target stays there or turns back at the same speed.

From these the scans are made that a planner decides by (`foresee`, `separate`):

clear   the beams that end on targets are lengthened to what is next to them. The safety filter simulates its stops in
        this scan, and compares each place of the stop with each target at the time when the car is there. The speed by
        sight is of this scan, too.
seen    the same, with each target drawn where it may be when the car could be as far away. The planner, guidance and
        the other speed laws have this scan: they go past a target on the side where it will not be, or wait.

Without a target that moves both are the LiDAR's scan, to the last bit.

Source: for the two ends of the interval, S. Shalev-Shwartz, S. Shammah and A. Shashua, On a Formal Model of Safe and
Scalable Self-driving Cars, arXiv 1708.06374; for stops among moving things, D. Fox, W. Burgard and S. Thrun, as in
safety_filter.

Limits: targets do not turn, except back. One that speeds up comes sooner than predicted.
"""

from __future__ import annotations

import math

import numpy as np

from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.messages import ODOMETRY, FloatArray

from ..control.planner_settings import Record
from ..control.slip import course_angle
from ..perception.scan_geometry import nearest_place, sees
from ..perception.targets import MOST_TARGETS, TARGETS, track_targets

MOST_CARS = 6
"""Cars that a planner follows by rules of its own."""

MOST_ROWS = MOST_TARGETS + 3 * MOST_CARS
"""Predictions: targets, and for each car that a planner follows by rules of its own three discs."""

MOST_LATE = 16
"""Ticks from which on scans are too late to be compared with."""

X, Y, COS, SIN, SPEED, RADIUS, TO_WALL, BRAKING, SPREAD, CURVATURE = range(10)  # columns of a prediction

_BRAKING = 6.0  # [m/s^2] of a target that drives in the car's direction
_SLOWING = 0.3  # [1/s] share of its speed that a target which crosses loses in a second
_MARGIN = 0.06  # [m] round a target
_LEAST_RADIUS = 0.1  # [m]
_FARTHEST_WALL = 4.0  # [m] along its line, to which what stands there is looked for
_ALONG = 0.1  # [m] between the places where that is done
_HORIZON, _STEPS = 2.4, 24  # [s] for which targets are drawn, in so many steps
_FASTER = 3.0  # [m/s^2] by which the car may gain speed on its way to a target
_SLOWLY = 0.8  # [m/s^2] the same, at least
_SLOWER = 0.65  # of its speed, with which it may come there
WAIT, WAITS = 0.4, 4  # [s] for which a car that has stopped should not be met, in so many steps

PREDICTIONS = np.dtype(
    [
        ("targets", TARGETS),
        ("odometry", ODOMETRY),  # of the time of the scan
        ("speeds", np.float64, (MOST_LATE,)),  # [m/s] of the last ticks
        ("yaw_rates", np.float64, (MOST_LATE,)),  # [rad/s]
        ("tick", np.int64),
        ("count", np.int64),
        ("cars", np.int64),  # how many of them, at the end, are of cars that a planner follows by its own rules
        # middle, ahead and left of the LiDAR [m], cosine and sine of its course, speed [m/s], radius [m], way to what
        # stands [m], braking [m/s^2], uncertainty of the speed [m/s] and curvature of its path [1/m]
        ("rows", np.float64, (MOST_ROWS, 10)),
    ]
)
"""Type of what is kept from tick to tick; zero at the beginning."""


@kernel
def foresee(
    scan: Record, seen: FloatArray, clear: FloatArray, odometry: Record, driver: Record, memory: Record
) -> bool:
    """Predict and separate the targets; return whether one moves. Without one neither scan is written to."""
    moves = predict(scan, seen, odometry, driver, memory)
    if moves:
        separate(scan, seen, clear, odometry.speed, memory)
    return moves


@kernel
def predict(scan: Record, ranges: FloatArray, odometry: Record, driver: Record, memory: Record) -> bool:
    """Track the targets in a scan and predict those that move; return whether there is one.

    Args:
      scan: of type SCAN.
      ranges: readings (n,) [m], without NaN or inf.
      odometry: of type ODOMETRY.
      driver: of type driving.DRIVER; with `prediction` off nothing is tracked.
      memory: of type PREDICTIONS, written to.
    """
    return track(scan, ranges, odometry, driver, memory) and write_predictions(memory)


@kernel
def track(scan: Record, ranges: FloatArray, odometry: Record, driver: Record, memory: Record) -> bool:
    """Track the targets in a scan; return whether one moves. Arguments as of `predict`."""
    memory.count = memory.cars = 0
    if not (driver.prediction and sees(scan, ranges)):
        return False
    _keep_odometry(memory, odometry, driver.late)
    then = memory.odometry
    course = course_angle(driver.limiter.slip, driver.car, then.speed, then.angular_velocity[2])
    return track_targets(memory.targets, scan, ranges, then, driver.car.lidar_offset, course) > 0


@kernel
def _keep_odometry(memory: Record, odometry: Record, late: int) -> None:
    """Write the odometry of `late` ticks ago, when the scan was measured: by a newer one standing things move."""
    place = memory.tick % MOST_LATE
    memory.speeds[place], memory.yaw_rates[place] = odometry.speed, odometry.angular_velocity[2]
    then = max(memory.tick - late, 0) % MOST_LATE
    memory.tick += 1
    memory.odometry.speed, memory.odometry.angular_velocity[2] = memory.speeds[then], memory.yaw_rates[then]


@kernel
def place_of(seen: Record, target: Record) -> tuple[float, float]:
    """Return how far the middle of a target is ahead of the LiDAR and to its left [m]; `seen` is of type TARGETS."""
    cos, sin = math.cos(seen.heading), math.sin(seen.heading)
    dx = 0.5 * (target.ends[0, 0] + target.ends[1, 0]) - seen.x
    dy = 0.5 * (target.ends[0, 1] + target.ends[1, 1]) - seen.y
    return cos * dx + sin * dy, cos * dy - sin * dx


@kernel
def write_predictions(memory: Record) -> bool:
    """Predict the targets that move; return whether there is one. `memory` is of type PREDICTIONS, written to."""
    memory.count, seen = 0, memory.targets
    cos, sin = math.cos(seen.heading), math.sin(seen.heading)
    for target in seen.targets:
        if target.age > 0 and target.moves:
            row = memory.rows[memory.count]
            memory.count += 1
            row[X], row[Y] = place_of(seen, target)
            speed = math.hypot(target.vx, target.vy)
            row[SPEED], row[RADIUS] = speed, max(target.size, _LEAST_RADIUS) + _MARGIN
            row[COS], row[SIN] = 1.0, 0.0
            if speed > 0.0:
                row[COS] = (cos * target.vx + sin * target.vy) / speed
                row[SIN] = (cos * target.vy - sin * target.vx) / speed
            row[BRAKING] = _BRAKING * row[COS] * row[COS] + _SLOWING * speed
            row[SPREAD], row[CURVATURE] = math.sqrt(target.p_speed), 0.0
    return bool(memory.count > 0)


@kernel
def separate(scan: Record, seen: FloatArray, clear: FloatArray, speed: float, memory: Record) -> None:
    """Write the scan without targets, and draw them where they may be when the car could be there.

    Args:
      scan: of type SCAN.
      seen: readings (n,) [m], written to.
      clear: (n,) [m], written to.
      speed: of the car [m/s].
      memory: of type PREDICTIONS; the ways to what stands are written to.
    """
    hide_targets(memory.targets, seen)
    for beam in range(len(seen)):
        clear[beam] = seen[beam]
    for k in range(memory.count):
        memory.rows[k, TO_WALL] = _way_to_wall(scan, clear, memory.rows[k])
    for k in range(memory.count):
        _draw(scan, seen, memory.rows[k], max(speed, 0.0))


@kernel
def hide_targets(targets: Record, ranges: FloatArray) -> None:
    """Take moving targets out of a scan (n,) [m]: their beams get the nearer of the ranges beside them."""
    for target in targets.targets:
        if target.age == 0 or not target.moves or target.unseen > 0.0:
            continue
        beyond = math.inf
        if target.own[0] and target.first > 0:
            beyond = ranges[target.first - 1]
        if target.own[1] and target.end < len(ranges):
            beyond = min(beyond, ranges[target.end])
        if not math.isfinite(beyond):
            continue
        for beam in range(target.first, target.end):
            if ranges[beam] > 0.9 * target.distance:  # not on something that was drawn before it
                ranges[beam] = max(ranges[beam], beyond)


@kernel
def interval(row: FloatArray, time: float) -> tuple[float, float]:
    """Return the interval of its line in which a target may be at a time [s]: ways from where it is now [m]."""
    speed, braking = row[SPEED], max(row[BRAKING], 1e-6)
    far = (speed + row[SPREAD]) * time
    stops = min(time, speed / braking)
    near = (speed - 0.5 * braking * stops) * stops - row[SPREAD] * time
    if far > row[TO_WALL]:
        near = min(near, 2.0 * row[TO_WALL] - far)
        far = max(row[TO_WALL], near)
    return near, far


@kernel
def along_arc(along: float, across: float, curvature: float) -> tuple[float, float]:
    """Return a place along and across an arc that begins in the direction of `along` [m]; curvature [1/m], not 0."""
    turned, off = curvature * along, 1.0 - curvature * across
    beyond = 2.0 * across - curvature * (along * along + across * across)
    return math.atan2(turned, off) / curvature, beyond / (1.0 + math.hypot(turned, off))


@kernel
def meets(rows: FloatArray, ahead: float, left: float, radius: float, time: float) -> bool:
    """Return whether a disc at a place [m] could touch a target at a time [s].

    Args:
      rows: predictions (k, 10).
      ahead: of where the LiDAR is now.
      left: the same.
      radius: [m].
      time: from now on.
    """
    for k in range(len(rows)):
        row = rows[k]
        dx, dy = ahead - row[X], left - row[Y]
        along, across = row[COS] * dx + row[SIN] * dy, row[COS] * dy - row[SIN] * dx
        if row[CURVATURE] != 0.0:
            along, across = along_arc(along, across, row[CURVATURE])
        reach = radius + row[RADIUS]
        if abs(across) < reach:
            near, far = interval(row, time)
            off = max(max(near - along, along - far), 0.0)
            if off * off + across * across < reach * reach:
                return True
    return False


@kernel
def turned(memory: Record, angle: float) -> FloatArray:
    """Return the predictions (k, 10) in a frame that is turned to the left by an angle [rad] round the LiDAR."""
    rows: FloatArray = memory.rows[: memory.count].copy()
    if angle != 0.0:
        cos, sin = math.cos(angle), math.sin(angle)
        for k in range(len(rows)):
            for place in (X, COS):
                ahead, left = rows[k, place], rows[k, place + 1]
                rows[k, place], rows[k, place + 1] = cos * ahead + sin * left, cos * left - sin * ahead
    return rows


@kernel
def _way_to_wall(scan: Record, clear: FloatArray, row: FloatArray) -> float:
    """Return how far a target can go along its line before its rim touches a standing thing [m]; inf: there is none."""
    for step in range(int(_FARTHEST_WALL / _ALONG) + 1):
        way = row[RADIUS] - _MARGIN + step * _ALONG
        ahead, left = row[X] + way * row[COS], row[Y] + way * row[SIN]
        beam = nearest_place(scan.angle_min, scan.angle_increment, ahead, left)
        if not 0.0 <= beam < len(clear):
            return math.inf
        if clear[int(beam)] < math.hypot(ahead, left):
            return max(step - 1, 0) * _ALONG
    return math.inf


@kernel
def _draw(scan: Record, ranges: FloatArray, row: FloatArray, speed: float) -> None:
    """Draw a target into a scan (n,) [m] at all places where a car of this speed [m/s] could meet it."""
    radius = row[RADIUS]
    for step in range(_STEPS + 1):
        time = step * _HORIZON / _STEPS
        soonest = speed * time + 0.5 * _FASTER * time * time
        latest = _SLOWER * speed * time + 0.5 * _SLOWLY * time * time
        near, far = interval(row, time)
        places = int((far - near) / radius) + 1
        for place in range(places + 1):
            way = near + (far - near) * place / places
            ahead, left = row[X] + way * row[COS], row[Y] + way * row[SIN]
            distance = math.hypot(ahead, left)
            if latest - radius <= distance <= soonest + 2.0 * radius:
                draw_disc(scan, ranges, ahead, left, radius)


@kernel
def draw_disc(scan: Record, ranges: FloatArray, ahead: float, left: float, radius: float) -> None:
    """Draw a disc into a scan (n,) [m], by its radius and its place ahead and to the left of the LiDAR [m]."""
    far, bearing = math.hypot(ahead, left), math.atan2(left, ahead)
    half = math.asin(min(radius / max(far, 1.0001 * radius), 1.0))
    first = math.ceil((bearing - half - scan.angle_min) / scan.angle_increment)
    end = math.floor((bearing + half - scan.angle_min) / scan.angle_increment) + 1
    for beam in range(max(first, 0), min(end, len(ranges))):
        away = scan.angle_min + scan.angle_increment * beam - bearing
        side = far * math.sin(away)
        near = far * math.cos(away) - math.sqrt(max(radius * radius - side * side, 0.0))
        ranges[beam] = min(ranges[beam], max(near, 0.02))
