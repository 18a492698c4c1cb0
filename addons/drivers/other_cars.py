"""Other cars in the scan: which small things there move, where they are, and how fast.

A car that races others carries a box of 12 x 12 cm at the height of the LiDAR: a short run of beams that end nearer
than those to both sides, or to one side where a wheel of the same car is to the other. Noise cuts such runs out of
walls, too, where neighbouring beams end about `_EDGE` apart. So the noise of the beams is estimated in each scan, and a
run counts only if neither neighbour lies on the straight line through it, within that noise. Runs are followed by dead
reckoning: position and velocity by an alpha-beta filter. One that has moved by `_MOVED` at `_LEAST_SPEED` or faster,
beyond what noise makes of it, is a car, and stays one when it stops, as long as it is followed. A planner that is told
the odometry of the other cars follows these instead (`follow_told`), also where a car stands.
Source: P. Kalata, The Tracking Index: A Generalized Parameter for alpha-beta and alpha-beta-gamma Target Trackers, IEEE
Transactions on Aerospace and Electronic Systems, 1984, for the filter; its gains at first are those of a least-squares
line through all sightings.
Limits: a car that is partly hidden, or nearer to a wall behind it than `_EDGE`, may be taken for the wall. One that is
hidden or behind the LiDAR's field of view is taken to go on as it did, for `_FORGOTTEN`.
"""

from __future__ import annotations

import math

import numpy as np

from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.controllers.control.planner_settings import Record
from fg_mujoco.controllers.control.steering import saturate
from fg_mujoco.controllers.perception.scan_filters import noise_of
from fg_mujoco.controllers.perception.scan_geometry import bearing_of, period_of
from fg_mujoco.controllers.safety.predictions import MOST_CARS
from fg_mujoco.messages import MOST_OTHERS, OF_OTHER_CAR, FloatArray, Reading, columns_of_others

NEAREST = 0.02  # [m] that a beam counts as long, at least
BEHIND = 0.06  # [m] from the middle of what is seen of a box to its own middle

_FARTHEST = 9.0  # [m] at which runs of beams are looked at
_EDGE = 0.12  # [m] by which a run ends nearer than the neighbouring beams, at least
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
_OLDEST = 0.5  # [s] of odometry that was told
_REACHED = 0.4  # [m] from the middle of a car: a beam that ends there ends on it
_FOUND = 16  # runs of a scan that are kept
_LEAST_NOISE = 0.005  # [m] standard deviation of a range
_CUT, _CERTAIN = 4.0, 5.0  # standard deviations: of a run's end, and of an edge there
_FASTER, _FARTHER = 3.0, 6.0  # the same: of the speed and of the way of what moves

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
TOLD = np.dtype(
    [
        ("stamp", np.float64),  # [s] of the odometry; 0: none has been told
        ("cars", np.float64, (MOST_OTHERS, len(OF_OTHER_CAR))),  # as OtherCars measures them, NaN: there is none
        ("follows", np.bool_),  # they are followed now
        ("places", np.int64, (MOST_OTHERS,)),  # of each in `cars` of OTHER_CARS, from 1; 0: it has none
        ("unseen", np.float64, (MOST_OTHERS,)),  # [s]
    ]
)
"""Type of what a planner is told of other cars, and where it keeps each; zero at the beginning."""
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
def watch_cars(memory: Record, geometry: Record, ranges: FloatArray, odometry: Record, lidar_offset: float) -> bool:
    """Follow what is in a scan, and say whether there is a car; `memory`, OTHER_CARS, is written to.

    `ranges` (n,) [m] are without NaN or inf; the LiDAR is `lidar_offset` [m] ahead of the rear axle.
    """
    period = period_of(geometry)
    if not _move(memory, odometry, period, lidar_offset):
        return False
    found = np.empty((_FOUND, 2))
    noise = noise_of(ranges, geometry.range_max)
    count = find_boxes(geometry, ranges, max(noise, _LEAST_NOISE), found)
    cos, sin = math.cos(memory.heading), math.sin(memory.heading)
    for k in range(count):
        ahead, left = found[k]
        found[k, 0], found[k, 1] = memory.x + cos * ahead - sin * left, memory.y + sin * ahead + cos * left
    any_moves = False
    for moves in (True, False):  # cars first: what is seen near one is a part of it
        for car in memory.cars:
            if car.age > 0 and car.moves == moves:
                _follow(memory, car, found, count, noise, period, geometry, ranges)
                any_moves = any_moves or (car.moves and car.age > 0)
    for k in range(count):
        if not math.isnan(found[k, 0]):
            _begin(memory.cars, found[k, 0], found[k, 1])
    return any_moves


@kernel
def _move(memory: Record, odometry: Record, period: float, lidar_offset: float) -> bool:
    """Go on by dead reckoning; return False, and forget all cars, where it is no odometry."""
    way, turn = odometry.speed * period, odometry.angular_velocity[2] * period
    if not abs(way) + abs(turn) < 10.0:
        _forget(memory)
        return False
    x = memory.x - lidar_offset * math.cos(memory.heading) + way * math.cos(memory.heading + 0.5 * turn)
    y = memory.y - lidar_offset * math.sin(memory.heading) + way * math.sin(memory.heading + 0.5 * turn)
    memory.heading += turn
    memory.x, memory.y = x + lidar_offset * math.cos(memory.heading), y + lidar_offset * math.sin(memory.heading)
    return True


def read_told(told: Record, reading: Reading) -> None:
    """Keep what the sensor `opponents` has delivered; `told` of type TOLD is written to. Another one's is left out."""
    count = len(reading.values) // len(OF_OTHER_CAR)
    if 0 < count <= MOST_OTHERS and reading.columns == columns_of_others(count):
        told["stamp"] = reading.stamp
        told["cars"][:] = math.nan
        told["cars"][:count] = reading.values.reshape(count, -1)


@kernel
def is_told(told: Record, odometry: Record) -> bool:
    """Return whether the odometry of the others is known, and not too old; and where the planner's own car is."""
    age, own = odometry.stamp - told.stamp, odometry.pose[0] + odometry.pose[1] + odometry.pose[2]
    return bool(told.stamp > 0.0 and 0.0 <= age < _OLDEST and math.isfinite(own))


@kernel
def follow_told(
    memory: Record, told: Record, geometry: Record, ranges: FloatArray, odometry: Record, car: Record
) -> bool:
    """Have the cars that were told of as those that are followed, and say whether there is one.

    They are where they go from where they were, when that was measured, at a constant speed and turn rate. One counts
    if a beam reaches it, and for _FORGOTTEN after; beside or behind, where no beam goes, for as long as it is near.
    `ranges` (n,) [m] are without NaN or inf, the odometry has a pose on the map; the others have the parameters of
    `car`.
    """
    period, age = period_of(geometry), odometry.stamp - told.stamp
    if not _move(memory, odometry, period, car.lidar_offset):
        told.follows = False
        return False
    if not told.follows:
        _forget(memory)
        told.places[:] = 0
        told.follows = True
    own_x, own_y, own_heading = odometry.pose[0], odometry.pose[1], odometry.pose[2]
    cos, sin, to_middle = math.cos(own_heading), math.sin(own_heading), 0.5 * car.length - car.rear_overhang
    any_there = False
    for k in range(MOST_OTHERS):
        x, y, heading, speed, yaw_rate = told.cars[k]
        way, turn = speed * age, yaw_rate * age
        dx = x + way * math.cos(heading + 0.5 * turn) + to_middle * math.cos(heading + turn) - own_x
        dy = y + way * math.sin(heading + 0.5 * turn) + to_middle * math.sin(heading + turn) - own_y
        ahead, left = cos * dx + sin * dy - car.lidar_offset, cos * dy - sin * dx
        far, bearing = math.hypot(ahead, left), math.atan2(left, ahead)
        in_sight = far < _FARTHEST and _ends_beyond(geometry, ranges, bearing, far - _REACHED)
        told.unseen[k] = 0.0 if in_sight else told.unseen[k] + period
        near = far < _NEAR and not _ends_beyond(geometry, ranges, bearing, -math.inf)
        place = told.places[k] - 1
        stays = told.unseen[k] == 0.0 or (place >= 0 and (told.unseen[k] <= _FORGOTTEN or near))
        if not (stays and math.isfinite(ahead + left + speed + yaw_rate)):
            if place >= 0:
                memory.cars[place].age = 0
            told.places[k] = 0
            continue
        if place < 0:
            place = _free_place(memory)
            if place < 0:
                continue
            told.places[k] = place + 1
        other, towards = memory.cars[place], heading + turn - own_heading + memory.heading
        other.age, other.moves, other.unseen = _STEADY + 1, True, 0.0
        other.x = memory.x + math.cos(memory.heading) * ahead - math.sin(memory.heading) * left
        other.y = memory.y + math.sin(memory.heading) * ahead + math.cos(memory.heading) * left
        other.first_x, other.first_y = other.x, other.y
        other.vx, other.vy = speed * math.cos(towards), speed * math.sin(towards)
        other.heading, other.turn_rate = towards, yaw_rate
        any_there = True
    return any_there


@kernel
def _forget(memory: Record) -> None:
    """Forget all cars."""
    for car in memory.cars:
        car.age = 0


@kernel
def _free_place(memory: Record) -> int:
    """Return a place for one more car; -1: there is none."""
    for index in range(MOST_CARS):
        if memory.cars[index].age == 0:
            return index
    return -1


@kernel
def find_boxes(geometry: Record, ranges: FloatArray, noise: float, found: FloatArray) -> int:
    """Write where the middles of what may be boxes are, ahead and left of the LiDAR (k, 2) [m]; return how many.

    `ranges` (n,) [m] are without NaN or inf, `noise` [m] is their standard deviation.
    """
    edge = max(_EDGE, _CUT * math.sqrt(2.0) * noise)
    count, first, before = 0, 0, -math.inf  # the run that has not ended, and the step that it began with
    for beam in range(1, len(ranges)):
        step = ranges[beam] - ranges[beam - 1]
        if abs(step) <= edge:
            continue
        last = beam - 1
        width = (last - first + 1) * geometry.angle_increment * 0.5 * (ranges[first] + ranges[last])
        stands_out = first > 0 and before < _NEXT and step > -_NEXT and (before < 0.0 or step > 0.0)
        is_box = stands_out and ranges[first] < _FARTHEST and _LEAST_WIDTH < width < WIDEST and count < len(found)
        if is_box and _ends_at_edges(ranges, first, last, noise):
            bearing, distance = bearing_of(geometry, 0.5 * (first + last)), ranges[(first + last) // 2] + BEHIND
            found[count, 0], found[count, 1] = distance * math.cos(bearing), distance * math.sin(bearing)
            count += 1
        first, before = beam, step
    return count


@kernel
def _ends_at_edges(ranges: FloatArray, first: int, last: int, noise: float) -> bool:
    """Return whether neither neighbour of a run of beams ends on the straight line through the run.

    Where a wall is seen at a small angle, noise cuts short runs off it, which go along with the car. The line is that
    of least squares; of a single beam, the one that is as steep as that through its neighbours.
    """
    count, mean, slope = last - first + 1, 0.0, 0.0  # of 1 / range
    off = 0.5 * (count + 1)
    spread = count * (count * count - 1) / 12.0 if count > 1 else 2.0  # sum of squared distances [beams^2]
    for beam in range(first, last + 1):
        mean += 1.0 / max(ranges[beam], NEAREST) / count
        slope += (beam - 0.5 * (first + last)) / max(ranges[beam], NEAREST) / spread
    if count == 1:
        slope = (1.0 / max(ranges[last + 1], NEAREST) - 1.0 / max(ranges[first - 1], NEAREST)) / spread
    of_line = (1.0 / count + off * off / spread) * mean**4
    for side in (-1, 1):
        inverse = 1.0 / max(ranges[last + 1 if side > 0 else first - 1], NEAREST)
        apart = inverse - mean - side * off * slope
        if apart * apart < _CERTAIN * _CERTAIN * noise * noise * (of_line + inverse**4):
            return False
    return True


@kernel
def _follow(
    memory: Record, car: Record, found: FloatArray, count: int, noise: float, period: float, geometry: Record,
    ranges: FloatArray,
) -> None:  # fmt: skip
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
        far, bearing = math.hypot(car.x - memory.x, car.y - memory.y), bearing_to(memory, car)
        if car.moves and _ends_beyond(geometry, ranges, bearing, far):  # it would be seen
            if abs(bearing) > min(-geometry.angle_min, bearing_of(geometry, len(ranges) - 1)) - _RIM:
                car.x -= car.vx * period  # it has not come into view yet, and so is slower
                car.y -= car.vy * period
                car.vx *= _SLOWING
                car.vy *= _SLOWING
            else:
                patience = _FORGOTTEN_NEAR if far < _NEAR else _FORGOTTEN_IN_VIEW
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
        of_speed = noise / period * beta * math.sqrt(2.0 / (alpha * (4.0 - 2.0 * alpha - beta)))  # noise of it
        surely = speed > _LEAST_SPEED + _FASTER * of_speed and way > max(_MOVED, _FARTHER * noise)
        car.moves = car.moves or (sightings >= _LEAST_AGE and surely)
    if car.moves:
        for k in range(count):
            if math.hypot(found[k, 0] - car.x, found[k, 1] - car.y) < _PART:
                found[k, 0] = math.nan
        for other in memory.cars:
            apart = math.hypot(other.x - car.x, other.y - car.y)
            if other.age > 0 and other.age < car.age and apart < _PART:
                other.age = 0


@kernel
def seen_from(memory: Record, x: float, y: float) -> tuple[float, float]:
    """Return the distances of a place ahead of the LiDAR and to its left [m]."""
    cos, sin = math.cos(memory.heading), math.sin(memory.heading)
    dx, dy = x - memory.x, y - memory.y
    return cos * dx + sin * dy, cos * dy - sin * dx


@kernel
def bearing_to(memory: Record, car: Record) -> float:
    """Return the bearing of a car [rad]."""
    bearing = math.atan2(car.y - memory.y, car.x - memory.x) - memory.heading
    return float(bearing - 2.0 * math.pi * round(bearing / (2.0 * math.pi)))


@kernel
def _ends_beyond(geometry: Record, ranges: FloatArray, bearing: float, distance: float) -> bool:
    """Return whether there is a beam at a bearing [rad], and it ends beyond a distance [m]."""
    place = round((bearing - geometry.angle_min) / geometry.angle_increment)
    if not 0 <= place < len(ranges):
        return False
    return bool(ranges[int(place)] > distance)


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
