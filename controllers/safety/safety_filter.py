"""The safety filter: before the car follows a reference command, it checks that it could still stop afterwards.

The speed of the reference is that of some free braking trajectory (braking_trajectories), while the steering goes to
the goal. Where both lead the same way, as in a corner, that is safe. Where the goal jumps, as when a corner opens
next to a box, it is not: the car would leave the only free trajectory for a goal that it cannot reach at its speed.

So each reference command is simulated first: the car follows it for one tick, since the command holds until the
next scan, and then brakes to a stop, with the same friction limiter that drives the car. If the car would hit
something, it brakes at once, and directions to both sides of the reference are simulated as well. Of those in which
the car stops in time the one with the longest view is taken, because the nearest to the reference often ends in the
corner between a box and a wall. If there is none, the car brakes in the direction in which it would be slowest at
the contact; the margins often make that a stop. It keeps its steering angle if that is no worse: steering to and fro
between two directions that are as bad takes from braking at every scan. Each direction is simulated with several
shares of the grip for cornering, from braking first and turning late to the reverse. Where guidance leads the car, the
reference is the motion that it follows, and its stop is simulated along the motion, not towards a goal; ground that
the end of a barrier hides counts as free there if the local map has it free and away from walls. The last motion
along which a stop was found is kept: where no stop is found any more, because the motion was given up or is another
one, the car brakes along that one (S. Petti and T. Fraichard, Safe Motion Planning in Dynamic Environments, IEEE/RSJ
IROS 2005). This is a dynamic window (D. Fox, W. Burgard and S. Thrun, The Dynamic Window Approach to Collision
Avoidance, IEEE Robotics & Automation Magazine 4(1), 1997) over directions and shares of grip.

These stops are as hard as the tires hold, and those that limit the speed are far softer. On a track without obstacles
the reference is therefore rarely changed.

What moves is not in this scan, but compared with the simulated car at each time (predictions). Near it the car drives
by a plan in time instead.

Where tires need slip angles, the path of the simulated car follows its wheels late, and uses the grip as the path does.

Limits: braking does not turn the simulated car in. What the scan does not show counts as free.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.messages import FloatArray

from ..control.planner_settings import FROM_ZERO, POSITIVE, SHARE, Record, Settings, setting, setting_of_car
from ..control.slip import held_arc, late_on_path, path_lag
from ..control.speed import share_of_way
from ..control.steering import arc_through, late_by, pursue
from ..control.tracking import next_point, steer_along
from ..perception.local_map import FREE, KIND, NEARNESS, PER_METRE, RING, in_window
from ..perception.scan_geometry import nearest_beam
from .friction_limiter import FrictionLimiterSettings, limited
from .predictions import WAIT, WAITS, meets

EVASIVE = FrictionLimiterSettings(most_left=0.6, turn_in_use=0.45)
"""Settings of the limiter of a car that evades: it brakes and turns out at once, and braking unloads the rear tires.

At a friction of 1.0489; for other floors see `friction_limiter.evasive`.
"""

_LATERAL_USES = (0.5, 1.0, 0.75, 0.25)  # simulated in this order: the limiter's own first
_USES_WHEN_BRAKING = (0.0, 0.25, 0.5, 0.75, 1.0)  # in this order where the car corners as little as it can
_FINE_TICKS = 8  # later ones are simulated two at a time
_TICKS = 64  # of the longest stop: 3 s
_LONGER = 1.02  # [-] way of a stop over that of wheels that do not slip; tires that brake slip by up to 1 %
_WIDEST = 1.8  # [rad] to either side; directions further back are not simulated


@dataclass(frozen=True, kw_only=True)
class SafetyFilterSettings(Settings):
    """Clearances of simulated stops, and the directions in which stops are simulated.

    Raises:
      SettingsError: a margin or angle that is negative or not finite; a step, speed or distance that is not a positive
        number.
    """

    margin: float = setting_of_car(0.12, "m", "ahead of the bumper, in the direction of the reference", FROM_ZERO)
    margin_aside: float = setting_of_car(
        0.08, "m", "in other directions, which are then not lost at once when the car brakes a little less", FROM_ZERO
    )
    margin_kept: float = setting(
        0.5, "", "share of these for a reference that passed at the last scan: millimetres do not end a turn", SHARE
    )
    fan: float = setting(math.radians(90.0), "rad", "directions to either side of the reference", FROM_ZERO)
    fan_step: float = setting(math.radians(5.0), "rad", "between them", POSITIVE)
    crawl_speed: float = setting_of_car(
        0.5, "m/s", "slowest speed of a car with a free direction, so that it does not stand for good", POSITIVE
    )
    standing_speed: float = setting_of_car(0.05, "m/s", "a car that is slower counts as standing", POSITIVE)
    pursuit_distance: float = setting_of_car(
        1.0, "m", "a steering angle is read as the arc to a point at this distance from the LiDAR", POSITIVE
    )
    arrived: float = setting_of_car(
        0.2, "m", "nearer to its goal than this, the simulated car keeps its steering angle", FROM_ZERO
    )
    nearest_goal: float = setting_of_car(0.5, "m", "goals are no nearer", POSITIVE)


@kernel
def safe_steering(
    limiter: Record,
    memory: Record,
    settings: Record,
    widened: FloatArray,
    angle_min: float,
    angle_increment: float,
    steering_angle: float,
    reference_speed: float,
    angle_now: float,
    speed_now: float,
    period: float,
    path: FloatArray,
    kept: bool,
    predictions: FloatArray,
    radius: float,
    ground: Record,
) -> tuple[float, float, bool]:
    """Return a steering angle [rad] with which the car can stop, the share of grip for cornering, and if there is one.

    The angle is that of the reference, to the bit, if the car can stop after following it. If there is no angle with
    which it can stop: that of the least speed at the contact.

    Args:
      limiter: of type LIMITER.
      memory: of type LIMITER_MEMORY, unchanged afterwards.
      settings: fields of SafetyFilterSettings.
      widened: readings (n,) [m], each widened by the disc that covers the car's front.
      angle_min: bearing of the first [rad].
      angle_increment: between them [rad].
      steering_angle: of the reference [rad], within the car's limit.
      reference_speed: speed of the next command in the direction of the reference [m/s]; in others the car brakes.
      angle_now: present steering angle [rad].
      speed_now: present speed [m/s].
      period: between commands [s].
      path: motion (m, 4) that the reference leads along, in the frame of the rear axle; m may be 0.
      kept: whether the reference passed at the last scan.
      predictions: of targets that move (k, 12), see `predictions`; the scan is the one without them.
      radius: of the disc that covers the car's front [m].
      ground: of type FRONTIER_SEARCH, see `speed_at_contact`.
    """
    car, speed = limiter.car, max(speed_now, settings.crawl_speed)
    pursuit = settings.pursuit_distance + path_lag(limiter.slip, speed)
    reference = bearing_of_arc(steering_angle, pursuit, car.lidar_offset, car.wheelbase)
    each_side = math.floor(settings.fan / settings.fan_step + 1e-6)
    views = np.empty(2 * each_side + 1)  # [m] by direction; even ones to the right of the reference, which is number 0
    for number in range(len(views)):
        bearing = reference + _aside(number, settings.fan_step)
        views[number] = max(reading(widened, angle_min, angle_increment, bearing), settings.nearest_goal)
        if abs(bearing) > _WIDEST:
            views[number] = 0.0
    number, least, best, best_use = 0, math.inf, reference, limiter.settings.least_lateral_use
    while least > 0.0 and views[number] > 0.0:
        bearing = reference + _aside(number, settings.fan_step)
        goal = (bearing, views[number])
        margin = settings.margin if number == 0 and len(path) == 0 else settings.margin_aside
        if number == 0 and kept:
            margin *= settings.margin_kept
        at_first = reference_speed if number == 0 else min(reference_speed, settings.crawl_speed)
        for use in _LATERAL_USES:
            last = memory.acceleration, memory.curvature
            left = speed_at_contact(
                limiter, memory, settings, widened, angle_min, angle_increment, goal, use, margin, at_first, angle_now,
                speed, period, path if number == 0 else path[:0], predictions, radius, ground,
            )  # fmt: skip
            memory.acceleration, memory.curvature = last
            if left == 0.0 and number == 0:
                return steering_angle, use, True
            if left < least:
                least, best, best_use = left, bearing, use
            if left == 0.0:
                break
        views[number] = 0.0
        number = int(np.argmax(views))
    if least > 0.0:  # steering takes from braking, and at the next scan another direction may be the best
        bearing = bearing_of_arc(angle_now, pursuit, car.lidar_offset, car.wheelbase)
        goal = (bearing, max(reading(widened, angle_min, angle_increment, bearing), settings.pursuit_distance))
        last = memory.acceleration, memory.curvature
        left = speed_at_contact(
            limiter, memory, settings, widened, angle_min, angle_increment, goal, best_use, settings.margin_aside,
            min(reference_speed, settings.crawl_speed), angle_now, speed, period, path[:0], predictions, radius, ground,
        )  # fmt: skip
        memory.acceleration, memory.curvature = last
        if left <= least:
            return held_arc(limiter.slip, car, angle_now, memory.curvature), best_use, left == 0.0
    return pursue(best, pursuit, car.lidar_offset, car.wheelbase), best_use, least == 0.0


@kernel
def least_cornering(
    limiter: Record,
    memory: Record,
    settings: Record,
    widened: FloatArray,
    angle_min: float,
    angle_increment: float,
    steering_angle: float,
    angle_now: float,
    speed_now: float,
    period: float,
    path: FloatArray,
    margin: float,
    most: float,
    predictions: FloatArray,
    radius: float,
    ground: Record,
) -> float:
    """Return the least share of the grip for cornering with which the car stops in time before what stands; -1: none.

    A car that corners with half of the grip brakes with little more than half of what it could straight ahead: one of
    its rear tires slides first. Before another car it brakes, and corners only as far as walls make it.

    Args are those of `safe_steering`, and:

    Args:
      margin: ahead of the bumper [m].
      most: greatest share that is tried.
    """
    speed = max(speed_now, settings.crawl_speed)
    pursuit = settings.pursuit_distance + path_lag(limiter.slip, speed)
    bearing = bearing_of_arc(steering_angle, pursuit, limiter.car.lidar_offset, limiter.car.wheelbase)
    goal = (bearing, max(reading(widened, angle_min, angle_increment, bearing), settings.nearest_goal))
    for use in _USES_WHEN_BRAKING:
        if use > most:
            break
        last = memory.acceleration, memory.curvature
        left = speed_at_contact(
            limiter, memory, settings, widened, angle_min, angle_increment, goal, use, margin, 0.0, angle_now, speed,
            period, path, predictions[:0], radius, ground,
        )  # fmt: skip
        memory.acceleration, memory.curvature = last
        if left == 0.0:
            return float(use)
    return -1.0


@kernel
def _aside(number: int, step: float) -> float:
    """Return the angle between a direction and the reference [rad]: 0, a step left, a step right, two left, ..."""
    offset = step * ((number + 1) // 2)
    return float(offset if number % 2 == 1 else -offset)


@kernel
def speed_at_contact(
    limiter: Record,
    memory: Record,
    settings: Record,
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
    path: FloatArray,
    predictions: FloatArray,
    radius: float,
    ground: Record,
) -> float:
    """Return the speed [m/s] at which the simulated car, braking on its way to a goal, hits something; 0: it stops.

    What has to stay clear: the disc over the car's front, its centre a quarter of the width behind the bumper, and
    `margin` ahead of it; and discs of the same size round the LiDAR and the rear axle, which cut the corner, once they
    are ahead of where the LiDAR is now.

    Args:
      limiter: of type LIMITER.
      memory: of type LIMITER_MEMORY, written to.
      settings: fields of SafetyFilterSettings.
      widened: readings (n,) [m], each widened by that disc.
      angle_min: bearing of the first [rad].
      angle_increment: between them [rad].
      goal: bearing [rad] and distance [m] from where the LiDAR is now.
      lateral_use: share of the grip for cornering.
      margin: [m].
      at_first: speed that is commanded for one tick, before the car brakes [m/s].
      angle: present steering angle [rad].
      speed: present [m/s].
      period: of a tick [s].
      path: a motion (m, 4) to steer along instead of to the goal, in the frame of the rear axle; m may be 0.
      predictions: of targets that move (k, 12), which the same discs have to keep clear of, see `predictions`.
      radius: of these discs [m].
      ground: of type FRONTIER_SEARCH: along a path, ground that was seen free counts as free where a corner hides it.
    """
    car, (bearing, distance) = limiter.car, goal
    lidar, standing = car.lidar_offset, settings.standing_speed
    front = car.length - car.rear_overhang - 0.25 * car.width  # ahead of the rear axle, as the LiDAR
    to_bumper = 0.25 * car.width  # widening does not shorten a reading, so this has to stay clear too
    goal_ahead, goal_left = distance * math.cos(bearing), distance * math.sin(bearing)  # of where the LiDAR is
    goal_x, goal_y = lidar + goal_ahead, goal_left
    turned = share_of_way(period, limiter.settings.steering_response)  # part of a command that a tick carries out
    slowed = share_of_way(period, car.speed_time_constant)
    slowed_twice = share_of_way(2.0 * period, car.speed_time_constant)
    x, y, heading = 0.0, 0.0, 0.0  # of the rear axle
    index, soft = 0, limiter.slip.needs_slip_angle
    moving, time, apart = len(predictions) > 0, 0.0, radius + settings.margin_aside
    known = len(path) > 0
    for tick in range(_TICKS):
        ticks = 1.0 if tick < _FINE_TICKS else 2.0
        reference = angle
        if len(path) > 0:
            index = next_point(path, index, x, y, heading)
            late, path_late = late_by(car), late_on_path(limiter.slip, car, speed)
            reference = steer_along(path, index, x, y, heading, speed, car.wheelbase, late, path_late)
        elif distance > settings.arrived:
            nearer = min(1.0, (settings.pursuit_distance + path_lag(limiter.slip, speed)) / distance)
            reference = arc_through(lidar + nearer * goal_ahead, nearer * goal_left, car.wheelbase)
        reference_speed = at_first if tick == 0 else 0.0
        command = limited(
            limiter, memory, reference, reference_speed, lateral_use, angle, speed, ticks * period, True
        )
        next_angle = angle + ticks * turned * (command[0] - angle)
        next_speed = speed + (slowed if tick < _FINE_TICKS else slowed_twice) * (command[1] - speed)
        way = _LONGER * 0.5 * (speed + next_speed) * ticks * period
        curvature = math.tan(0.5 * (angle + next_angle)) / car.wheelbase
        if soft:
            follow = 1.0 - math.exp(-way / path_lag(limiter.slip, 0.5 * (speed + next_speed)))
            memory.curvature += (curvature - memory.curvature) * follow
            curvature = memory.curvature
        x += way * math.cos(heading + 0.5 * curvature * way)
        y += way * math.sin(heading + 0.5 * curvature * way)
        heading += curvature * way
        angle, speed = next_angle, next_speed
        cos, sin = math.cos(heading), math.sin(heading)
        ahead, left = x + front * cos - lidar, y + front * sin
        beyond = reading_towards(widened, angle_min, angle_increment, ahead, left)
        away, reach = math.sqrt(ahead * ahead + left * left), front + to_bumper + margin
        if not beyond > away + to_bumper + margin:
            hidden = known and away > beyond + radius  # what stands there is not in the way, but before it
            if not (hidden and _was_seen(ground, x, y, cos, sin, front) and _was_seen(ground, x, y, cos, sin, reach)):
                return float(max(speed, standing))
        for offset in (0.0, lidar):
            ahead, left = x + offset * cos - lidar, y + offset * sin
            if ahead > 0.0:
                beyond = reading_towards(widened, angle_min, angle_increment, ahead, left)
                away = math.sqrt(ahead * ahead + left * left)
                hidden = known and away > beyond + radius
                if not (beyond > away or (hidden and _was_seen(ground, x, y, cos, sin, offset))):
                    return float(max(speed, standing))
        if moving:
            time += ticks * period
            for offset in (0.0, lidar, front):
                ahead, left = x + offset * cos - lidar, y + offset * sin
                if meets(predictions, ahead, left, apart, time):
                    return float(max(speed, standing))
                if speed < standing:
                    for wait in range(1, WAITS + 1):
                        if meets(predictions, ahead, left, apart, time + WAIT * wait):
                            return float(standing)
        if speed < standing:
            return 0.0
        goal_ahead = cos * (goal_x - x) + sin * (goal_y - y) - lidar
        goal_left = cos * (goal_y - y) - sin * (goal_x - x)
        distance = math.sqrt(goal_ahead * goal_ahead + goal_left * goal_left)
    return 0.0


@kernel
def _was_seen(ground: Record, x: float, y: float, cos: float, sin: float, ahead: float) -> bool:
    """Return whether the ground at a place ahead of a rear axle is free on the local map, .4 m and more from walls.

    The rear axle is at x, y [m] in the frame of the car, with the cosine and sine of its heading.
    """
    world = ground.map
    x, y = x + ahead * cos, y + ahead * sin
    cos, sin = math.cos(world.heading), math.sin(world.heading)
    i = math.floor((world.x + cos * x - sin * y) * PER_METRE)
    j = math.floor((world.y + sin * x + cos * y) * PER_METRE)
    return bool(in_window(world, i, j) and world.cells[i & RING, j & RING] & (KIND | NEARNESS) == FREE)


@kernel
def reading_towards(ranges: FloatArray, angle_min: float, angle_increment: float, ahead: float, left: float) -> float:
    """Return the reading of `ranges` (n,) [m] in the direction of a point [m] in the frame of the LiDAR."""
    index = nearest_beam(angle_min, angle_increment, ahead, left)
    return float(ranges[int(min(len(ranges) - 1.0, max(0.0, index)))])


@kernel
def reading(ranges: FloatArray, angle_min: float, angle_increment: float, bearing: float) -> float:
    """Return the reading of `ranges` (n,) [m] at a bearing [rad]."""
    index = np.rint((bearing - angle_min) / angle_increment)
    return float(ranges[int(min(len(ranges) - 1.0, max(0.0, index)))])


@kernel
def bearing_of_arc(steering_angle: float, distance: float, lidar_offset: float, wheelbase: float) -> float:
    """Return the position, seen from the LiDAR, of the point at `distance` [m] on the arc of a steering angle [rad].

    This is the inverse of `pursue`. Of an arc that does not reach so far: where it comes nearest to it.
    """
    curvature = math.tan(steering_angle) / wheelbase
    # curvature = 2 y / (x^2 + y^2), with x = o + d cos(bearing) and y = d sin(bearing), o the LiDAR's offset
    sine = curvature * (lidar_offset**2 + distance**2) / (2.0 * distance * math.hypot(1.0, curvature * lidar_offset))
    return math.atan(curvature * lidar_offset) + math.asin(min(1.0, max(-1.0, sine)))
