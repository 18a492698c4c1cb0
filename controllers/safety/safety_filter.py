"""A way out: before the car follows a wish, it makes sure that it could still stop on that way.

The speed is that of some free stopping path (stopping_paths), while the steering goes to the goal; where both lead the
same way, as in a corner, that is safe. Where the goal jumps, as when a corner opens beside a box, it is not: the car
leaves the only free path for a goal that it cannot reach at its speed. So each wish is tried: the car is driven in
thought towards it, by the very guard that drives it (friction_guard): for a tick as is wished, since until the next
scan it will have done so, and then braking to a stop. If it would touch something, it brakes at once: to the sides of
the wish ways are tried as well, and of those on which it stops the one with the longest view is taken; the nearest to
the wish often ends in the corner between a box and a wall. If there is none, the car brakes on the way with the least
speed at the touch, which the margins often make a stop.

Each way is tried with several shares of the grip for cornering: braking first and turning late, or the reverse.

These stops are as hard as the tires hold, those that limit the speed are far softer. So on a track without obstacles
the wish nearly always stands.

Limits: the car in thought has no slip and what is around it stands still; what the scan does not show is free.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fg_mujoco.errors import SettingsError
from fg_mujoco.kernels import kernel
from fg_mujoco.messages import FloatArray, require

from ..control.records import Record
from ..control.steering import pursue
from .friction_limiter import GuardSettings, guarded

SWERVING = GuardSettings(most_left=0.6, turn_in_use=0.45)
"""Of the guard of a car that swerves: it brakes and turns out at once, and braking unloads the rear tires."""

_LATERAL_USES = (0.5, 1.0, 0.75, 0.25)  # tried in this order: the guard's own first
_FINE_TICKS = 8  # those after them are taken two at a time
_TICKS = 64  # of the longest stop: 3 s
_STANDING = 0.05  # [m/s]
_PURSUIT = 1.0  # [m] a wished steering angle is read as the arc to a point at this distance from the LiDAR
_ARRIVED = 0.2  # [m] nearer to its goal than this, the car in thought keeps its wheels as they are
_LEAST_GOAL = 0.5  # [m] goals are no nearer
_WIDEST = 1.8  # [rad] to either side; ways further back are not tried


@dataclass(frozen=True, kw_only=True)
class EscapeSettings:
    """What a stop in thought has to keep clear, and where it is tried.

    Raises:
      SettingsError: a length or angle that is negative or not finite; a step or speed that is not a positive number.
    """

    margin: float = 0.05  # [m] ahead of the bumper, on the way that is wished
    margin_aside: float = 0.08  # [m] on another way: it is not left at once when the car brakes a little less
    fan: float = math.radians(90.0)  # [rad] ways to either side of the wish
    fan_step: float = math.radians(5.0)  # [rad] between them
    crawl_speed: float = 0.5  # [m/s] with a way out the car goes at least so fast: it does not come to stand for good

    def __post_init__(self) -> None:
        from_zero, positive = ("margin", "margin_aside", "fan"), ("fan_step", "crawl_speed")
        require(self, lambda value: 0.0 <= value < math.inf, "a number from 0", from_zero, SettingsError)
        require(self, lambda value: 0.0 < value < math.inf, "a positive number", positive, SettingsError)


@kernel
def way_out(
    guard: Record,
    memory: Record,
    settings: Record,
    widened: FloatArray,
    angle_min: float,
    angle_increment: float,
    steering_angle: float,
    wished_speed: float,
    angle_now: float,
    speed_now: float,
    period: float,
) -> tuple[float, float, bool]:
    """Return a steering angle [rad] with which the car can stop, the share of grip for cornering, and if there is one.

    That is the wish itself, to the bit, if the car can stop on its way. If there is none: that of the least speed left.

    Args:
      guard: of type GUARD.
      memory: of type GUARD_MEMORY, as it was afterwards.
      settings: fields of EscapeSettings.
      widened: readings (n,) [m], each widened by the disc that covers the car's front.
      angle_min: bearing of the first [rad].
      angle_increment: between them [rad].
      steering_angle: wished [rad], within the car's limit.
      wished_speed: what the car is told next on the way that is wished [m/s]; on others it brakes.
      angle_now: present steering angle [rad].
      speed_now: present speed [m/s].
      period: between commands [s].
    """
    car, speed = guard.car, max(speed_now, settings.crawl_speed)
    wish = bearing_of_arc(steering_angle, _PURSUIT, car.lidar_offset, car.wheelbase)
    each_side = math.floor(settings.fan / settings.fan_step + 1e-6)
    views = np.empty(2 * each_side + 1)  # [m] of the ways; even ones to the right of the wish, which is number 0
    for number in range(len(views)):
        bearing = wish + _aside(number, settings.fan_step)
        views[number] = max(reading(widened, angle_min, angle_increment, bearing), _LEAST_GOAL)
        if abs(bearing) > _WIDEST:
            views[number] = 0.0
    number, least, best, best_use = 0, math.inf, wish, guard.settings.least_lateral_use
    while least > 0.0 and views[number] > 0.0:
        bearing = wish + _aside(number, settings.fan_step)
        goal = (bearing, views[number])
        margin = settings.margin if number == 0 else settings.margin_aside
        at_first = wished_speed if number == 0 else 0.0
        for use in _LATERAL_USES:
            last = memory.acceleration
            left = speed_at_touch(
                guard, memory, widened, angle_min, angle_increment, goal, use, margin, at_first, angle_now, speed,
                period,
            )  # fmt: skip
            memory.acceleration = last
            if left == 0.0 and number == 0:
                return steering_angle, use, True
            if left < least:
                least, best, best_use = left, bearing, use
            if left == 0.0:
                break
        views[number] = 0.0
        number = int(np.argmax(views))
    return pursue(best, _PURSUIT, car.lidar_offset, car.wheelbase), best_use, least == 0.0


@kernel
def _aside(number: int, step: float) -> float:
    """Return by how much a way lies beside the wish [rad]: 0, then a step to the left, to the right, two, and so on."""
    offset = step * ((number + 1) // 2)
    return float(offset if number % 2 == 1 else -offset)


@kernel
def speed_at_touch(
    guard: Record,
    memory: Record,
    widened: FloatArray,
    angle_min: float,
    angle_increment: float,
    goal: tuple[float, float],
    lateral_use: float,
    margin: float,
    at_first: float,
    angle: float,
    speed: float,
    period: float,
) -> float:
    """Return the speed [m/s] with which the car touches something when it brakes on its way to a goal; 0: it stops.

    What is kept clear: the disc over the car's front, its centre a quarter of the width behind the bumper, and by
    `margin`; and discs as large round the LiDAR and the rear axle, which cut the corner, once they are ahead of where
    the LiDAR is now.

    Args:
      guard: of type GUARD.
      memory: of type GUARD_MEMORY, written to.
      widened: readings (n,) [m], each widened by that disc.
      angle_min: bearing of the first [rad].
      angle_increment: between them [rad].
      goal: bearing [rad] and distance [m] from where the LiDAR is now.
      lateral_use: share of the grip for cornering.
      margin: [m].
      at_first: speed that it is told for a tick, before it brakes [m/s].
      angle: present steering angle [rad].
      speed: present [m/s].
      period: of a tick [s].
    """
    car, (bearing, distance) = guard.car, goal
    lidar = car.lidar_offset
    front = car.length - car.rear_overhang - 0.25 * car.width  # ahead of the rear axle, as the LiDAR
    to_bumper = 0.25 * car.width  # a widened reading is as long as before, so this is to be kept too
    goal_x, goal_y = lidar + distance * math.cos(bearing), distance * math.sin(bearing)
    turned = 1.0 - math.exp(-period / guard.settings.steering_response)  # part of a command that a tick carries out
    slowed = 1.0 - math.exp(-period / car.speed_time_constant)
    x, y, heading = 0.0, 0.0, 0.0  # of the rear axle
    for tick in range(_TICKS):
        ticks = 1.0 if tick < _FINE_TICKS else 2.0
        wish = angle
        if distance > _ARRIVED:
            wish = pursue(bearing, min(distance, _PURSUIT), lidar, car.wheelbase)
        told = at_first if tick == 0 else 0.0
        command = guarded(guard, memory, wish, told, lateral_use, angle, speed, ticks * period)
        next_angle = angle + ticks * turned * (command[0] - angle)
        next_speed = speed + ticks * slowed * (command[1] - speed)
        way = 0.5 * (speed + next_speed) * ticks * period
        curvature = math.tan(0.5 * (angle + next_angle)) / car.wheelbase
        x += way * math.cos(heading + 0.5 * curvature * way)
        y += way * math.sin(heading + 0.5 * curvature * way)
        heading += curvature * way
        angle, speed = next_angle, next_speed
        cos, sin = math.cos(heading), math.sin(heading)
        ahead, left = x + front * cos - lidar, y + front * sin
        beyond = reading(widened, angle_min, angle_increment, math.atan2(left, ahead))
        if not beyond > math.hypot(ahead, left) + to_bumper + margin:
            return max(speed, _STANDING)
        for place in (0.0, lidar):
            ahead, left = x + place * cos - lidar, y + place * sin
            if ahead > 0.0:
                beyond = reading(widened, angle_min, angle_increment, math.atan2(left, ahead))
                if not beyond > math.hypot(ahead, left):
                    return max(speed, _STANDING)
        if speed < _STANDING:
            return 0.0
        ahead = cos * (goal_x - x) + sin * (goal_y - y) - lidar
        left = cos * (goal_y - y) - sin * (goal_x - x)
        bearing, distance = math.atan2(left, ahead), math.hypot(ahead, left)
    return 0.0


@kernel
def reading(ranges: FloatArray, angle_min: float, angle_increment: float, bearing: float) -> float:
    """Return the one of `ranges` (n,) [m] that is nearest to a bearing [rad]."""
    place = np.rint((bearing - angle_min) / angle_increment)
    return float(ranges[int(min(len(ranges) - 1.0, max(0.0, place)))])


@kernel
def bearing_of_arc(steering_angle: float, distance: float, lidar_offset: float, wheelbase: float) -> float:
    """Return where the LiDAR sees the point at `distance` [m] on the arc of a steering angle [rad]: `pursue` backwards.

    Of an arc that does not reach so far: where it comes nearest to it.
    """
    curvature = math.tan(steering_angle) / wheelbase
    # curvature = 2 y / (x^2 + y^2), with x = o + d cos(bearing) and y = d sin(bearing), o the LiDAR's offset
    sine = curvature * (lidar_offset**2 + distance**2) / (2.0 * distance * math.hypot(1.0, curvature * lidar_offset))
    return math.atan(curvature * lidar_offset) + math.asin(min(1.0, max(-1.0, sine)))
