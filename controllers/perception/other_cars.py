"""Other cars in the scan: which small things there move, where they are, and how fast.

A car that races others carries a box of 12 x 12 cm at the height of the LiDAR. In a scan it is a short run of beams
that end nearer than those to both sides, or to one side where a wheel of the same car is to the other. Such runs are
followed from scan to scan in a frame that stands still, by dead reckoning: position and velocity by an alpha-beta
filter. One that has moved by `_MOVED` at `_LEAST_SPEED` or faster is a car, and stays one when it stops, as long as it
is followed. All else stands, as walls do.

Source: P. Kalata, The Tracking Index: A Generalized Parameter for alpha-beta and alpha-beta-gamma Target Trackers, IEEE
Transactions on Aerospace and Electronic Systems, 1984, for the filter; its gains at first are those of a least-squares
line through all sightings.

Limits: a car that is partly hidden, or nearer to a wall behind it than `_EDGE`, may be taken for the wall. One that
is hidden or behind the LiDAR's field of view is taken to go on as it did, for `_FORGOTTEN`.
"""

from __future__ import annotations

import math

import numpy as np

from fg_mujoco.kernels import kernel
from fg_mujoco.messages import FloatArray

from ..control.planner_settings import Record
from ..control.steering import saturate
from .scan_geometry import bearing_of, period_of

MOST_CARS = 6
BEHIND = 0.06  # [m] from the middle of what is seen of a box to its own middle

_FARTHEST = 9.0  # [m] at which runs of beams are looked at
_EDGE = 0.12  # [m] by which a run ends nearer than the neighbouring beams
WIDEST = 0.25  # [m] from end to end of a run
_LEAST_WIDTH = 0.085  # [m] the same: a wheel, which is seen when the planner's car pitches, is less wide
_NEXT = 0.45  # [m] by which the neighbour of a run may be nearer: another part of the same car
_GATE = 0.35  # [m] from where a thing is expected to where it is seen
_LEAST_AGE = 5  # sightings
_LEAST_SPEED = 0.5  # [m/s]
_MOVED = 0.2  # [m]
_FORGOTTEN = 0.8  # [s]
_FORGOTTEN_IN_VIEW = 0.1  # [s] the same, of one that would be seen there
_NEAR, _FORGOTTEN_NEAR = 1.2, 0.4  # [m] and [s]: of a car that is nearer, parts are seen, and its box may be missed
_RIM = 0.25  # [rad] from the end of the view: a car that is expected there may still be behind it
_SLOWING = 0.93  # of its speed, in each tick
_PART = 0.5  # [m] from the middle of a car: what is found there is a part of it
_ALPHA, _BETA = 0.5, 0.13  # least gains
_JUMP = 0.05  # [m] from where it is expected: what is further counts as this far
_TURNING = 0.12  # gain of the turn rate
_STEADY = 8  # sightings after which it is known where a thing goes
_FASTEST_TURN = 3.0  # [rad/s]
_FOUND = 16  # runs of a scan that are kept

CAR_SEEN = np.dtype(
    [
        ("age", np.int64),  # sightings; 0: there is none
        ("x", np.float64),  # [m] middle of its box, where the planner's car began
        ("y", np.float64),  # [m]
        ("vx", np.float64),  # [m/s]
        ("vy", np.float64),  # [m/s]
        ("heading", np.float64),  # [rad] in which it last moved
        ("turn_rate", np.float64),  # [rad/s] of its heading
        ("first_x", np.float64),  # [m] where it was first seen
        ("first_y", np.float64),  # [m]
        ("unseen", np.float64),  # [s]
        ("moves", np.bool_),  # it has moved
    ]
)
OTHER_CARS = np.dtype(
    [
        ("x", np.float64),  # [m] of the LiDAR, by dead reckoning from where it began
        ("y", np.float64),  # [m]
        ("heading", np.float64),  # [rad]
        ("cars", CAR_SEEN, (MOST_CARS,)),
    ]
)
"""Type of what is kept from tick to tick; zero at the beginning."""


@kernel
def watch_cars(memory: Record, scan: Record, ranges: FloatArray, odometry: Record, lidar_offset: float) -> bool:
    """Follow what is in a scan, and say whether there is a car.

    Args:
      memory: of type OTHER_CARS, written to.
      scan: of type SCAN.
      ranges: readings (n,) [m], without NaN or inf.
      odometry: of type ODOMETRY.
      lidar_offset: of the LiDAR ahead of the rear axle [m].
    """
    period = period_of(scan)
    way, turn = odometry.speed * period, odometry.angular_velocity[2] * period
    if not abs(way) + abs(turn) < 10.0:  # it is no odometry
        for car in memory.cars:
            car.age = 0
        return False
    x = memory.x - lidar_offset * math.cos(memory.heading) + way * math.cos(memory.heading + 0.5 * turn)
    y = memory.y - lidar_offset * math.sin(memory.heading) + way * math.sin(memory.heading + 0.5 * turn)
    memory.heading += turn
    memory.x, memory.y = x + lidar_offset * math.cos(memory.heading), y + lidar_offset * math.sin(memory.heading)
    found = np.empty((_FOUND, 2))
    count = find_boxes(scan, ranges, found)
    cos, sin = math.cos(memory.heading), math.sin(memory.heading)
    for k in range(count):
        ahead, left = found[k]
        found[k, 0], found[k, 1] = memory.x + cos * ahead - sin * left, memory.y + sin * ahead + cos * left
    any_moves = False
    for moves in (True, False):  # cars first: what is seen near one is a part of it
        for car in memory.cars:
            if car.age > 0 and car.moves == moves:
                _follow(memory, car, found, count, period, scan, ranges)
                any_moves = any_moves or (car.moves and car.age > 0)
    for k in range(count):
        if not math.isnan(found[k, 0]):
            _begin(memory.cars, found[k, 0], found[k, 1])
    return any_moves


@kernel
def find_boxes(scan: Record, ranges: FloatArray, found: FloatArray) -> int:
    """Write where the middles of what may be boxes are, ahead and left of the LiDAR [m]; return how many."""
    count, first, before = 0, 0, -math.inf  # the run that has not ended, and the step that it began with
    for beam in range(1, len(ranges)):
        step = ranges[beam] - ranges[beam - 1]
        if abs(step) <= _EDGE:
            continue
        last = beam - 1
        width = (last - first + 1) * scan.angle_increment * 0.5 * (ranges[first] + ranges[last])
        stands_out = first > 0 and before < _NEXT and step > -_NEXT and (before < 0.0 or step > 0.0)
        if stands_out and ranges[first] < _FARTHEST and _LEAST_WIDTH < width < WIDEST and count < len(found):
            bearing, distance = bearing_of(scan, 0.5 * (first + last)), ranges[(first + last) // 2] + BEHIND
            found[count, 0], found[count, 1] = distance * math.cos(bearing), distance * math.sin(bearing)
            count += 1
        first, before = beam, step
    return count


@kernel
def _follow(
    memory: Record, car: Record, found: FloatArray, count: int, period: float, scan: Record, ranges: FloatArray
) -> None:
    """Take a thing on by one tick, and to the nearest of `found` [m]; what it may have is taken from there."""
    car.x += car.vx * period
    car.y += car.vy * period
    nearest, least = -1, _GATE
    for k in range(count):
        apart = math.hypot(found[k, 0] - car.x, found[k, 1] - car.y)
        if apart < least:
            nearest, least = k, apart
    if nearest < 0:
        car.unseen += period
        patience = _FORGOTTEN if car.moves else _FORGOTTEN_IN_VIEW
        if car.moves and _is_in_view(memory, car, scan, ranges):
            if abs(bearing_to(memory, car)) > min(-scan.angle_min, bearing_of(scan, len(ranges) - 1)) - _RIM:
                car.x -= car.vx * period  # it has not come into view yet, and so is slower
                car.y -= car.vy * period
                car.vx *= _SLOWING
                car.vy *= _SLOWING
            else:
                near = math.hypot(car.x - memory.x, car.y - memory.y) < _NEAR
                patience = _FORGOTTEN_NEAR if near else _FORGOTTEN_IN_VIEW
        if car.unseen > patience:
            car.age = 0
        return
    car.age += 1
    car.unseen = 0.0
    sightings = car.age
    alpha = max(2.0 * (2.0 * sightings - 1.0) / (sightings * (sightings + 1.0)), _ALPHA)
    beta = max(6.0 / (sightings * (sightings + 1.0)), _BETA)
    dx, dy = found[nearest, 0] - car.x, found[nearest, 1] - car.y
    found[nearest, 0] = math.nan
    if sightings > _STEADY and least > _JUMP:  # another part of it is seen
        dx, dy = dx * _JUMP / least, dy * _JUMP / least
    car.x += alpha * dx
    car.y += alpha * dy
    car.vx += beta * dx / period
    car.vy += beta * dy / period
    speed = math.hypot(car.vx, car.vy)
    if speed > _LEAST_SPEED:
        heading = math.atan2(car.vy, car.vx)
        turn = heading - car.heading
        turn -= 2.0 * math.pi * round(turn / (2.0 * math.pi))
        if sightings > _STEADY:
            car.turn_rate += _TURNING * (saturate(turn / period, _FASTEST_TURN) - car.turn_rate)
        car.heading = heading
        way = math.hypot(car.x - car.first_x, car.y - car.first_y)
        car.moves = car.moves or (sightings >= _LEAST_AGE and way > _MOVED)
    if car.moves:
        for k in range(count):
            if math.hypot(found[k, 0] - car.x, found[k, 1] - car.y) < _PART:
                found[k, 0] = math.nan
        for other in memory.cars:
            apart = math.hypot(other.x - car.x, other.y - car.y)
            if other.age > 0 and other.age < car.age and apart < _PART:
                other.age = 0


@kernel
def bearing_to(memory: Record, car: Record) -> float:
    """Return the bearing of a car [rad]."""
    bearing = math.atan2(car.y - memory.y, car.x - memory.x) - memory.heading
    return float(bearing - 2.0 * math.pi * round(bearing / (2.0 * math.pi)))


@kernel
def _is_in_view(memory: Record, car: Record, scan: Record, ranges: FloatArray) -> bool:
    """Return whether a car would be seen where it is expected: a beam ends beyond it."""
    place = round((bearing_to(memory, car) - scan.angle_min) / scan.angle_increment)
    if not 0 <= place < len(ranges):
        return False
    return bool(ranges[int(place)] > math.hypot(car.x - memory.x, car.y - memory.y))


@kernel
def _begin(cars: Record, x: float, y: float) -> None:
    """Follow a thing at a place [m] that is new, if there is room for one."""
    for car in cars:
        if car.age == 0:
            car.age = 1
            car.x, car.y, car.first_x, car.first_y = x, y, x, y
            car.vx = car.vy = car.heading = car.turn_rate = car.unseen = 0.0
            car.moves = False
            return
