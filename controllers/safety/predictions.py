"""Predicted paths of moving targets: where they may be when the car is there, and in the car's simulated stops.

A target is a disc that goes on along the line of its velocity. At a time t it is somewhere between two places on this
line: as far as it comes if it holds its speed, and where it is if it begins to brake now. Both grow apart by the
uncertainty of its speed. Where the line meets what stands, or where the target was seen to turn back, it stays there or
turns back at the same speed. One that was seen to turn at both ends goes to and fro between them.

The beams that end on targets are lengthened to what is next to them (`foresee`, `separate`): the planner, guidance, the
speed laws and the stops of the safety filter have a scan of what stands. These stops are compared with each target at
the time when the car is there, and near a target the car drives by a plan in time (plan_in_time). Without a target that
moves the scan is that of the LiDAR, to the last bit.

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
from ..control.slip import velocity_angle
from ..perception.scan_geometry import nearest_beam, sees
from ..perception.targets import MOST_TARGETS, TARGETS, track_targets

MOST_CARS = 6
"""Cars that a planner follows by rules of its own."""

MOST_ROWS = MOST_TARGETS + 3 * MOST_CARS
"""Predictions: targets, and for each car that a planner follows by rules of its own three discs."""

MOST_LATE = 16
"""Ticks from which on scans are too late to be compared with."""

# columns of a prediction
X, Y, COS, SIN, SPEED, RADIUS, TO_WALL, BRAKING, SPREAD, CURVATURE, FROM_WALL, TURNS = range(12)

_COLUMNS = 12

_BRAKING = 6.0  # [m/s^2] of a target that drives in the car's direction
_SLOWING = 0.3  # [1/s] share of its speed that a target which crosses loses in a second
_MARGIN = 0.06  # [m] round a target
_LEAST_RADIUS = 0.1  # [m]
_FARTHEST_WALL = 4.0  # [m] along its line, to which what stands there is looked for
_ALONG = 0.1  # [m] between the places where that is done
_ON_LINE = 0.3  # [m] from a target's line, at which a place where it turned lies on it
_SIGMAS, _MOST_SPREAD = 2.0, 0.1  # of a target's speed, and [m/s]
_SLOWS, _MOST_SLOWING = 0.3, 1.0  # [1/s] of its speed, and [m/s^2]: by how much one may become slower
_DRIVES, _LENGTH = 1.5, 0.4  # [m/s] ahead: it is a car, and [m] of it are ahead of what is seen
SEEN = 0.15  # [s] after which it is known that one has turned, and .1 m of what it goes until then
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
        # stands [m], braking [m/s^2], uncertainty of the speed [m/s], curvature of its path [1/m], way back to what
        # stands [m], and at how many ends of its way it was seen to turn
        ("rows", np.float64, (MOST_ROWS, _COLUMNS)),
    ]
)
"""Type of what is kept from tick to tick; zero at the beginning."""


@kernel
def foresee(
    geometry: Record,
    seen: FloatArray,
    ranges_without_movers: FloatArray,
    odometry: Record,
    driver: Record,
    memory: Record,
) -> bool:
    """Predict and separate the targets; return whether one moves. Without one neither scan is written to."""
    moves = predict(geometry, seen, odometry, driver, memory)
    if moves:
        separate(geometry, seen, ranges_without_movers, memory)
    return moves


@kernel
def predict(geometry: Record, ranges: FloatArray, odometry: Record, driver: Record, memory: Record) -> bool:
    """Track the targets in a scan and predict those that move; return whether there is one.

    Args:
      geometry: of type SCAN_GEOMETRY.
      ranges: readings (n,) [m], without NaN or inf.
      odometry: of type ODOMETRY.
      driver: of type driving.DRIVER; with `prediction` off nothing is tracked.
      memory: of type PREDICTIONS, written to.
    """
    return track(geometry, ranges, odometry, driver, memory) and write_predictions(memory)


@kernel
def track(geometry: Record, ranges: FloatArray, odometry: Record, driver: Record, memory: Record) -> bool:
    """Track the targets in a scan; return whether one moves. Arguments as of `predict`."""
    memory.count = memory.cars = 0
    if not (driver.prediction and sees(geometry, ranges)):
        return False
    _keep_odometry(memory, odometry, driver.late)
    then = memory.odometry
    angle = velocity_angle(driver.limiter.slip, driver.car, then.speed, then.angular_velocity[2])
    return track_targets(memory.targets, geometry, ranges, then, driver.car.lidar_offset, angle) > 0


@kernel
def _keep_odometry(memory: Record, odometry: Record, late: int) -> None:
    """Write the odometry of `late` ticks ago, when the scan was measured: by a newer one standing things move."""
    column = memory.tick % MOST_LATE
    memory.speeds[column], memory.yaw_rates[column] = odometry.speed, odometry.angular_velocity[2]
    then = max(memory.tick - late, 0) % MOST_LATE
    memory.tick += 1
    memory.odometry.speed, memory.odometry.angular_velocity[2] = memory.speeds[then], memory.yaw_rates[then]


@kernel
def position_of(seen: Record, target: Record) -> tuple[float, float]:
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
            row[X], row[Y] = position_of(seen, target)
            speed = math.hypot(target.vx, target.vy)
            row[SPEED], row[RADIUS] = speed, max(target.size, _LEAST_RADIUS) + _MARGIN
            row[COS], row[SIN] = 1.0, 0.0
            if speed > 0.0:
                course_x, course_y = _course(target, speed)
                row[COS], row[SIN] = cos * course_x + sin * course_y, cos * course_y - sin * course_x
            row[BRAKING] = _BRAKING * row[COS] * row[COS] + _SLOWING * speed
            row[SPREAD], row[CURVATURE] = math.sqrt(target.p_speed), 0.0
    return bool(memory.count > 0)


@kernel
def _course(target: Record, speed: float) -> tuple[float, float]:
    """Return the direction in which a target goes: along the line through the two places where it turned, if it did."""
    x, y, a, b = target.vx / speed, target.vy / speed, target.turned[0], target.turned[1]
    way = math.copysign(math.hypot(a[0] - b[0], a[1] - b[1]), (a[0] - b[0]) * x + (a[1] - b[1]) * y)
    if target.turns >= 2 and abs(way) > _ON_LINE and abs((a[0] - b[0]) * y - (a[1] - b[1]) * x) < 0.5 * abs(way):
        return (a[0] - b[0]) / way, (a[1] - b[1]) / way
    return x, y


@kernel
def separate(geometry: Record, seen: FloatArray, ranges_without_movers: FloatArray, memory: Record) -> None:
    """Take the targets out of a scan, copy it, and write how far each of them can go on and back.

    Args:
      geometry: of type SCAN_GEOMETRY.
      seen: readings (n,) [m], written to.
      ranges_without_movers: (n,) [m], written to: the same.
      memory: of type PREDICTIONS, written to.
    """
    hide_targets(memory.targets, seen)
    for beam in range(len(seen)):
        ranges_without_movers[beam] = seen[beam]
    k = 0
    for target in memory.targets.targets:
        if target.age > 0 and target.moves:
            memory.rows[k, TO_WALL] = _way_to_wall(geometry, ranges_without_movers, memory.rows[k], 1.0)
            memory.rows[k, FROM_WALL] = _way_to_wall(geometry, ranges_without_movers, memory.rows[k], -1.0)
            _end_where_it_turned(memory.targets, target, memory.rows[k])
            k += 1


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
def occupied(row: FloatArray, time: float, bold: float) -> tuple[float, float]:
    """Return the same interval as the plan in time counts on: what crosses slows by little, and turns at walls.

    `bold`: from 0 to 1, as the car has waited.
    """
    known = row[TURNS] >= 2.0
    speed, spread = row[SPEED], (1.0 - 0.5 * bold if known else _SIGMAS) * min(row[SPREAD], _MOST_SPREAD)
    slower = 0.0 if known else 0.5 * min(_SLOWS * speed, _MOST_SLOWING) * time * time
    near, far = max((speed - spread) * time - slower, -spread * time), (speed + spread) * time
    if _drives(row):
        return min(near, row[TO_WALL]) - 0.1, min(far, row[TO_WALL]) + _LENGTH
    if known and math.isfinite(row[FROM_WALL] + row[TO_WALL]):
        return _to_and_fro(near, far, row)
    if far > row[TO_WALL]:
        near = min(near, 2.0 * row[TO_WALL] - far)
        far = max(row[TO_WALL], near)
    return near, far


@kernel
def _to_and_fro(near: float, far: float, row: FloatArray) -> tuple[float, float]:
    """Return an interval of ways [m] as an interval of places of a target that turns at both ends of its line."""
    back, length = row[FROM_WALL], max(row[FROM_WALL] + row[TO_WALL], 1e-3)
    turns, more = math.floor((near + back) / length), math.floor((far + back) / length)
    if more - turns >= 2.0:
        return -back, row[TO_WALL]
    forth, first, last = turns % 2.0 == 0.0, near + back - turns * length, far + back - more * length
    if more > turns:  # it turns in between
        return (min(first, length - last) - back, length - back) if forth else (-back, max(length - first, last) - back)
    return (first - back, last - back) if forth else (length - last - back, length - first - back)


@kernel
def _drives(row: FloatArray) -> bool:
    """Return whether a target drives ahead as a car does, which follows the walls, and does not turn back."""
    return bool(row[SPEED] * row[COS] > _DRIVES)


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
      rows: predictions (k, 12).
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
    """Return the predictions (k, 12) in a frame that is turned to the left by an angle [rad] round the LiDAR."""
    rows: FloatArray = memory.rows[: memory.count].copy()
    if angle != 0.0:
        cos, sin = math.cos(angle), math.sin(angle)
        for k in range(len(rows)):
            for column in (X, COS):
                ahead, left = rows[k, column], rows[k, column + 1]
                rows[k, column], rows[k, column + 1] = cos * ahead + sin * left, cos * left - sin * ahead
    return rows


@kernel
def _way_to_wall(geometry: Record, ranges_without_movers: FloatArray, row: FloatArray, sign: float) -> float:
    """Return how far a target can go before its rim touches a standing thing [m]; inf: there is none.

    It goes on along its line where `sign` is 1, and back where it is -1.
    """
    for step in range(int(_FARTHEST_WALL / _ALONG) + 1):
        way = row[RADIUS] - _MARGIN + step * _ALONG
        ahead, left = row[X] + sign * way * row[COS], row[Y] + sign * way * row[SIN]
        beam = nearest_beam(geometry.angle_min, geometry.angle_increment, ahead, left)
        if not 0.0 <= beam < len(ranges_without_movers):
            return math.inf
        if ranges_without_movers[int(beam)] < math.hypot(ahead, left):
            return max(step - 1, 0) * _ALONG
    return math.inf


@kernel
def _end_where_it_turned(seen: Record, target: Record, row: FloatArray) -> None:
    """Shorten the ways of a target to where it was seen to turn back, and write at how many ends it was."""
    cos, sin = math.cos(seen.heading), math.sin(seen.heading)
    row[TURNS] = 0.0
    for index in range(min(target.turns, 2)):
        dx, dy = target.turned[index, 0] - seen.x, target.turned[index, 1] - seen.y
        ahead, left = cos * dx + sin * dy - row[X], cos * dy - sin * dx - row[Y]
        along, across = row[COS] * ahead + row[SIN] * left, row[COS] * left - row[SIN] * ahead
        if abs(across) < _ON_LINE:
            row[TURNS] += 1.0
            behind = along < 0.0 if abs(along) > _ON_LINE else index == (target.turns - 1) % 2
            end = FROM_WALL if behind else TO_WALL
            row[end] = max(-along if behind else along, 0.0)
