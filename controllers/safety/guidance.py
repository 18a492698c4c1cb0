"""Guidance: leads a planner that would drive into a pocket, or back, to the frontier.

A gap planner goes where the scan shows most room. In a hairpin that is the pocket at its end, and then the way back.
Guidance knows the frontier (perception.frontiers), and lets the planner drive as long as it is in reach:

1. Where the planner's goal leads on about as well as any beam, and nothing hides the frontier nearby, the planner
   drives.
2. Else its reference is simulated for `viable_time`. While a motion of the car leads on from there (motion_search),
   the planner still drives. What 1 and 2 found holds for one more tick, unless its reference turns meanwhile, or the
   frontier is hidden and nearby.
3. Else the car follows a motion from where it is now (control.tracking), which is searched for anew in every second
   tick, and kept while it is free and none is found. Its speed is that of its curvature, with braking before it. In
   a sharp bend a careful car (4) stays on its motions until the bend is over.
4. Where there is no motion, the car brakes. Where it has been slow for .35 s, it turns in several moves, forward
   and in reverse (turning). From then on it is careful: it comes to the edge of what it sees no faster than that it
   could turn there at full lock.

On a lap as short as its memory (frontiers) the planner has found its way once: there it drives as long as its goal
leads on at all, and a car that is slow does not turn in moves.

Where there is no frontier, as in a dead end, it is no faster than it can stop ahead of what it sees. Where it has
stood there for 4 s it forgets its path, which on a course as short as its memory may have been wrong.

Limits: as of frontiers and motion_search. Without a friction limit nothing says how sharply the car can turn, and
guidance is off.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.messages import FloatArray

from ..control.planner_settings import FROM_ZERO, POSITIVE, SHARE, Record, Settings, setting, setting_of_car
from ..control.slip import fastest_on, late_on_path, lock_arc
from ..control.steering import late_by, saturate
from ..control.tracking import CURVATURE, HEADING, LAG, X, Y, errors, next_point, steer_along
from ..perception.frontiers import (
    FRONTIER_SEARCH,
    distance_to_goal_around,
    least_distance_along,
    least_distance_towards,
    look_again,
    search_frontier,
)
from ..perception.local_map import SIGHT, WALL_IN_1, WALL_IN_2, forget, move
from ..perception.scan_geometry import beams_between, bearing_of, looks_ahead, period_of, sees
from .motion_search import MOST_LOCK, MOST_NODES, MOTION, is_clear, search_motion
from .turning import TURNING, turn_in_moves

_BEAMS = 16  # every so many are compared with the planner's goal
_BENDS = 0.37  # of the curvature at full lock, from which on the planner's goal alone does not end a motion
_BENDS_SHARPLY = 0.75  # the same, from which on its simulated reference does not end a motion of a careful car
_NODES = 2000  # of a search while the car drives
_AHEAD = math.radians(15.0)  # to either side: obstacles that a car without a frontier stops ahead of
_AS_BEFORE = 0.1  # [rad] by which a planner's reference has turned since it was last looked at
_ON_MOTION = (0.15, 0.4)  # [m] to the side of a motion and [rad] from its heading, within which the car is on it


@dataclass(frozen=True, kw_only=True)
class GuidanceSettings(Settings):
    """When the planner drives, and how fast a motion is driven.

    Raises:
      SettingsError: a share that is not above 0 and at most 1; another value that is negative or not finite.
    """

    every: int = setting(4, "", "ticks between two searches for the frontier, at least", POSITIVE)
    every_plain: int = setting(16, "", "the same, at most", POSITIVE)
    as_good: float = setting(0.6, "", "of the best beam's gain of way: the planner's goal leads on", SHARE)
    worth_simulating: float = setting(0.3, "", "of the best beam's gain: its reference is simulated", SHARE)
    tight_distance: float = setting_of_car(4.5, "m", "way to go to a hidden frontier that counts as nearby", POSITIVE)
    viable_time: float = setting(0.4, "s", "for which the planner's reference is simulated", POSITIVE)
    lock: float = setting(0.87, "", "of the curvature at full lock, for motions; the rest keeps the car on them", SHARE)
    grip: float = setting(0.85, "", "of the cornering acceleration, for motions", SHARE)
    profile_grip: float = setting(0.76, "", "of the cornering acceleration, for the speed on a motion", SHARE)
    profile_braking: float = setting(0.4, "", "of the greatest braking, ahead of a motion's curve", SHARE)
    stop_braking: float = setting(0.52, "", "of the greatest braking, ahead of a motion's end", SHARE)
    hidden_braking: float = setting(0.7, "", "of the greatest braking, ahead of a hidden frontier", SHARE)
    horizon: float = setting_of_car(3.0, "m", "of a motion, and .1 s^2/m v^2 more", POSITIVE)
    narrow_speed: float = setting_of_car(1.0, "m/s", "in gaps that are hardly wider than the car", POSITIVE)
    trusted_speed: float = setting_of_car(3.5, "m/s", "below it a simulated motion gives the speed", POSITIVE)
    lost_after: int = setting(
        12, "", "ticks without a frontier, after which the car stops ahead of what it sees", POSITIVE
    )
    start_again_after: int = setting(30, "", "ticks, after which a car that stands forgets its path", POSITIVE)
    stop_margin: float = setting_of_car(0.3, "m", "ahead of the bumper, where there is no frontier", FROM_ZERO)


GUIDANCE = np.dtype(
    [
        ("frontier", FRONTIER_SEARCH),
        ("motion", MOTION),  # that the car follows
        ("trial", MOTION),  # that was last searched for
        ("stop", MOTION),  # along which the safety filter last found a stop; without points: none yet
        ("stop_progress", np.int64),  # index of its point that is next
        ("follows", np.bool_),  # there is a motion to follow
        ("progress", np.int64),  # index of the motion's point that is next
        ("narrow", np.bool_),  # the motion leads through a gap that is hardly wider than the car
        ("knows_speed", np.bool_),  # the reference's speed is that of a motion, which is free farther than is in sight
        ("stuck", np.bool_),  # there is no motion
        ("led_on", np.int64),  # tick in which the planner was last found to lead on, by this reference:
        ("steering_angle", np.float64),  # [rad]
        ("bearing", np.float64),  # [rad]
        ("speed", np.float64),  # [m/s] that a simulated motion gave; inf: none did
        ("lost", np.int64),  # ticks without a frontier
        ("careful", np.bool_),  # the car has had to turn in several moves: there are bends tighter than they look
        ("turning", TURNING),
    ]
)
"""Type of what guidance keeps of its car from tick to tick; zero at the beginning."""


@kernel
def follow_frontier(
    geometry: Record,
    ranges: FloatArray,
    odometry: Record,
    limiter: Record,
    settings: Record,
    memory: Record,
    reference: Record,
) -> None:
    """Replace a planner's reference that does not lead on. Without a scan that looks ahead the reference stays.

    Args:
      geometry: of type SCAN_GEOMETRY.
      ranges: readings (n,) [m], without NaN or inf.
      odometry: of type ODOMETRY.
      limiter: of type LIMITER.
      settings: fields of GuidanceSettings.
      memory: of type GUIDANCE, written to.
      reference: of type REFERENCE, written to.
    """
    car, frontier = limiter.car, memory.frontier
    speed, present = odometry.speed, math.tan(odometry.steering_angle) / car.wheelbase
    memory.knows_speed = memory.stuck = False
    looks = sees(geometry, ranges) and looks_ahead(geometry, len(ranges))
    if not looks:
        move(frontier.map, speed, odometry.angular_velocity[2], period_of(geometry))
    if not (looks and math.isfinite(speed + present + odometry.angular_velocity[2])):
        memory.follows = memory.turning.active = False
        return
    led = memory.follows or memory.turning.active or memory.careful
    search_frontier(geometry, ranges, odometry, car.lidar_offset, frontier, settings.every, settings.every_plain, led)
    if memory.turning.active or not frontier.on_lap:  # a car that creeps on a lap that it has driven gets through
        turn_in_moves(frontier, limiter, memory.turning, odometry.steering_angle, speed)
    if memory.turning.active:
        memory.careful = True
        return
    x = frontier.map.x + car.lidar_offset * math.cos(frontier.map.heading)
    y = frontier.map.y + car.lidar_offset * math.sin(frontier.map.heading)
    here = distance_to_goal_around(frontier, x, y) if frontier.found else math.inf
    if not math.isfinite(here):
        memory.follows = False
        memory.lost = memory.lost + 1 if not frontier.found else 0
        if memory.lost > settings.lost_after:
            reference.speed = min(reference.speed, _speed_to_stop(geometry, ranges, limiter, settings))
        if memory.lost > settings.start_again_after and abs(speed) < 0.1:
            memory.lost = 0
            forget(frontier.map)  # the path or the map may be wrong
        return
    memory.lost = 0
    to_edge = math.hypot(frontier.edge_x - x, frontier.edge_y - y)
    around_edge = _speed_to_frontier(limiter, settings, to_edge) if frontier.hidden else math.inf
    if memory.careful:
        reference.speed = min(reference.speed, around_edge)
    tight = frontier.hidden and here < settings.tight_distance
    if not tight and _leads_on_as_before(memory, reference):
        return
    gain, at, bearing = _best_beam(geometry, ranges, frontier, x, y, here)
    bend = _bend(memory, car) if memory.follows and _is_on_motion(memory, car) else math.nan
    if _planner_drives(geometry, ranges, odometry, limiter, settings, memory, reference, x, y, here, gain, bend, tight):
        memory.led_on, memory.bearing = frontier.ticks, reference.bearing
        memory.steering_angle = reference.steering_angle
        memory.speed = reference.speed if memory.knows_speed else math.inf
        return
    look_again(geometry, ranges, car.lidar_offset, frontier, settings.every)
    if not _renew_motion(limiter, settings, memory, present, speed):
        memory.follows = not math.isnan(bend)
    memory.knows_speed, memory.stuck = memory.follows, not memory.follows
    followed = memory.motion if memory.follows else memory.trial
    if followed.count > 0:
        _follow(memory, followed, memory.progress if memory.follows else 0, limiter, speed, reference)
    else:
        reference.steering_angle = odometry.steering_angle
        reference.bearing, reference.distance = bearing, at
    reference.speed = 0.0
    if memory.follows:
        on_motion = _speed_on(memory, memory.motion, memory.progress, limiter, settings, speed)
        reference.speed = min(on_motion, around_edge)


@kernel
def _leads_on_as_before(memory: Record, reference: Record) -> bool:
    """Return whether the planner led on in the tick before by this reference, whose speed is then limited as it was."""
    frontier = memory.frontier
    turned = abs(reference.steering_angle - memory.steering_angle) + abs(reference.bearing - memory.bearing)
    if frontier.ticks != memory.led_on + 1 or frontier.searched == frontier.ticks or not turned < _AS_BEFORE:
        return False
    memory.knows_speed = math.isfinite(memory.speed)
    reference.speed = min(reference.speed, memory.speed)
    return True


@kernel
def _planner_drives(
    geometry: Record,
    ranges: FloatArray,
    odometry: Record,
    limiter: Record,
    settings: Record,
    memory: Record,
    reference: Record,
    x: float,
    y: float,
    here: float,
    best_gain: float,
    bend: float,
    tight: bool,
) -> bool:
    """Return whether the planner's own reference leads on; arguments as of `guide`, and as of `_best_beam`.

    `bend` is that of the motion that the car is on, see `_bend`; NaN: it is on none. `tight`: the frontier is hidden
    and nearby.
    """
    if math.isnan(reference.bearing) or math.isnan(reference.steering_angle):
        return False
    frontier, car, speed = memory.frontier, limiter.car, odometry.speed
    beam = int(min(max(round((reference.bearing - geometry.angle_min) / geometry.angle_increment), 0), len(ranges) - 1))
    least, _ = least_distance_along(frontier, x, y, frontier.map.heading + reference.bearing, ranges[beam])
    gain = here - least
    as_good = 0.0 if frontier.on_lap else settings.as_good * best_gain  # there the planner has found its way once
    if gain >= as_good and gain > -0.5 and not (bend > _BENDS or tight):
        memory.follows = False
        return True
    if (memory.careful and bend > _BENDS_SHARPLY) or not gain > settings.worth_simulating * best_gain:
        return False
    most = 0.8 * limiter.lateral / max(speed * speed, 0.5)
    present = math.tan(odometry.steering_angle) / car.wheelbase
    wanted = saturate(math.tan(saturate(reference.steering_angle, car.max_steering_angle)) / car.wheelbase, most)
    memory.narrow = False
    look_again(
        geometry, ranges, car.lidar_offset, frontier, settings.every
    )  # walls that are not marked would be driven into
    if not search_motion(
        frontier, limiter, memory.trial, 0.5 * (present + wanted), speed, settings.viable_time, 1.0, MOST_LOCK,
        settings.horizon + 0.1 * speed * speed, WALL_IN_2, False, min(_NODES, MOST_NODES - frontier.nodes),
    ):  # fmt: skip
        return False
    memory.follows = False
    if speed < settings.trusted_speed:
        memory.knows_speed = True
        reference.speed = min(reference.speed, _speed_on(memory, memory.trial, 0, limiter, settings, speed))
    return True


@kernel
def _best_beam(
    geometry: Record, ranges: FloatArray, frontier: Record, x: float, y: float, here: float
) -> tuple[float, float, float]:
    """Return by how much the best beam shortens the way to go [m], how far along it that is [m], and its bearing."""
    gain, at, best = -math.inf, 0.0, 0
    turn_cos, turn_sin = math.cos(geometry.angle_increment * _BEAMS), math.sin(geometry.angle_increment * _BEAMS)
    cos, sin = math.cos(frontier.map.heading + geometry.angle_min), math.sin(frontier.map.heading + geometry.angle_min)
    for beam in range(0, len(ranges), _BEAMS):
        least, reach = least_distance_towards(frontier, x, y, cos, sin, ranges[beam])
        if here - least > gain:
            gain, at, best = here - least, reach, beam
        cos, sin = cos * turn_cos - sin * turn_sin, sin * turn_cos + cos * turn_sin
    return gain, at, bearing_of(geometry, best)


@kernel
def _renew_motion(limiter: Record, settings: Record, memory: Record, present: float, speed: float) -> bool:
    """Search for a motion in every second tick, or in each while the car has none; return whether one was found."""
    if memory.follows and memory.frontier.ticks % 2 == 1:
        return False
    frontier, trial, horizon = memory.frontier, memory.trial, settings.horizon + 0.1 * speed * speed
    found, narrow, lag = False, False, LAG + late_by(limiter.car)
    for grip, lock in ((settings.grip, settings.lock), (1.0, MOST_LOCK)):
        if not found:
            nodes = min(_NODES, MOST_NODES - frontier.nodes)
            found = search_motion(
                frontier, limiter, trial, present, speed, lag, grip, lock, horizon, WALL_IN_2, False, nodes
            )
    if not found and speed < 2.0:
        narrow = True
        nodes = min(_NODES, MOST_NODES - frontier.nodes)
        found = search_motion(
            frontier, limiter, trial, present, speed, lag, 1.0, MOST_LOCK, 2.0, WALL_IN_1, False, nodes
        )
    if found:
        memory.motion.count = trial.count
        memory.motion.points[:] = trial.points
        memory.follows, memory.progress, memory.narrow = True, 0, narrow
    return found


@kernel
def _is_on_motion(memory: Record, car: Record) -> bool:
    """Return whether what is left of the motion is free, and the car on it."""
    world, motion = memory.frontier.map, memory.motion
    points = motion.points[: motion.count]
    memory.progress = next_point(points, memory.progress, world.x, world.y, world.heading)
    if memory.progress + 2 >= motion.count:
        return False
    _, aside, angle = errors(points[memory.progress], world.x, world.y, world.heading)
    if abs(aside) > _ON_MOTION[0] or abs(angle) > _ON_MOTION[1]:
        return False
    for k in range(memory.progress, motion.count):
        point = motion.points[k]
        if not is_clear(memory.frontier, car, point[X], point[Y], point[HEADING], WALL_IN_1):
            return False
    return True


@kernel
def _bend(memory: Record, car: Record) -> float:
    """Return the greatest curvature of what is left of the motion, as a share of that at full lock."""
    most = 0.0
    for k in range(memory.progress, memory.motion.count):
        most = max(most, abs(memory.motion.points[k, CURVATURE]))
    return float(most * car.wheelbase / math.tan(car.max_steering_angle))


@kernel
def _follow(memory: Record, motion: Record, first: int, limiter: Record, speed: float, reference: Record) -> None:
    """Write the reference that keeps the car on a motion."""
    world, points, car = memory.frontier.map, motion.points[: motion.count], limiter.car
    late, path_late = late_by(car), late_on_path(limiter.slip, car, speed)
    reference.steering_angle = steer_along(
        points, first, world.x, world.y, world.heading, speed, car.wheelbase, late, path_late
    )
    dx, dy = points[first, X] - world.x, points[first, Y] - world.y
    cos, sin = math.cos(world.heading), math.sin(world.heading)
    reference.bearing = math.atan2(cos * dy - sin * dx, cos * dx + sin * dy)
    reference.distance = math.hypot(dx, dy)


@kernel
def path_ahead(memory: Record) -> FloatArray:
    """Return the points (m, 4) of the motion that the car follows, in the frame of its rear axle; or none."""
    if not memory.follows:
        return np.empty((0, 4))
    return _in_frame_of_car(memory.frontier.map, memory.motion, memory.progress)


@kernel
def keep_stop(memory: Record) -> None:
    """Keep the motion that the car follows as one along which it can stop."""
    memory.stop.count, memory.stop_progress = memory.motion.count, memory.progress
    memory.stop.points[:] = memory.motion.points


@kernel
def stop_ahead(memory: Record) -> FloatArray:
    """Return the points (m, 4) of the motion along which the car could last stop, as `path_ahead` does."""
    world, motion = memory.frontier.map, memory.stop
    if motion.count > 0:
        points = motion.points[: motion.count]
        memory.stop_progress = next_point(points, memory.stop_progress, world.x, world.y, world.heading)
    return _in_frame_of_car(world, motion, memory.stop_progress)


@kernel
def _in_frame_of_car(world: Record, motion: Record, first: int) -> FloatArray:
    """Return the points (m, 4) of a motion from a place on; no points if there is only one left."""
    if first + 1 >= motion.count:
        return np.empty((0, 4))
    cos, sin = math.cos(world.heading), math.sin(world.heading)
    path = np.empty((motion.count - first, 4))
    for k in range(len(path)):
        point = motion.points[first + k]
        dx, dy = point[X] - world.x, point[Y] - world.y
        path[k, X], path[k, Y] = cos * dx + sin * dy, cos * dy - sin * dx
        path[k, HEADING], path[k, CURVATURE] = point[HEADING] - world.heading, point[CURVATURE]
    return path


def motion_ahead(memory: Record) -> FloatArray:
    """Return the rest of a motion, or of a turn in moves, in the frame of the rear axle.

    Args:
      memory: of type GUIDANCE.

    Returns:
      (m, 2) [m]; no points where the planner drives.
    """
    turning, world = memory["turning"], memory["frontier"]["map"]
    motion, first = memory["motion"], int(memory["progress"])
    if turning["active"]:
        motion, first = turning["motion"], int(turning["next_point"])
    elif not memory["follows"]:
        return np.empty((0, 2))
    points = motion["points"][first : int(motion["count"]), [X, Y]] - (world["x"], world["y"])
    cos, sin = math.cos(world["heading"]), math.sin(world["heading"])
    ahead: FloatArray = points @ np.array([[cos, -sin], [sin, cos]])
    return ahead


@kernel
def _speed_on(memory: Record, motion: Record, first: int, limiter: Record, settings: Record, speed: float) -> float:
    """Return the speed [m/s] from which the car slows in time for a motion's curves, and stops at its end."""
    lateral, braking = settings.profile_grip * limiter.lateral, settings.profile_braking * limiter.braking
    square, along, tightest = math.inf, 0.0, 0.0
    x, y = memory.frontier.map.x, memory.frontier.map.y
    for k in range(first, motion.count):
        curvature = abs(motion.points[k, CURVATURE])
        if curvature > 0.0:
            there = lateral / curvature
            if limiter.slip.needs_slip_angle and curvature > tightest:
                arc = math.atan(curvature * limiter.car.wheelbase)
                there = min(there, fastest_on(limiter.slip, arc, settings.narrow_speed) ** 2)
                tightest = curvature
            square = min(square, there + 2.0 * braking * max(along - 0.15 * speed, 0.0))
        along += math.hypot(motion.points[k, X] - x, motion.points[k, Y] - y)
        x, y = motion.points[k, X], motion.points[k, Y]
    square = min(square, 2.0 * settings.stop_braking * limiter.braking * (along + 0.3))
    return min(math.sqrt(square), settings.narrow_speed) if memory.narrow else math.sqrt(square)


@kernel
def _speed_to_frontier(limiter: Record, settings: Record, way_to_go: float) -> float:
    """Return the speed [m/s] from which the car can turn at full lock behind a hidden frontier."""
    tightest = math.tan(lock_arc(limiter.slip, limiter.car)) / limiter.car.wheelbase
    turning = settings.grip * limiter.lateral / tightest
    return math.sqrt(turning + 2.0 * settings.hidden_braking * limiter.braking * way_to_go)


@kernel
def _speed_to_stop(geometry: Record, ranges: FloatArray, limiter: Record, settings: Record) -> float:
    """Return the speed [m/s] from which the car stops ahead of what is in front of it."""
    first, end = beams_between(geometry, len(ranges), -_AHEAD, _AHEAD)
    ahead = SIGHT
    for beam in range(first, end):
        ahead = min(ahead, ranges[beam])
    to_bumper = limiter.car.length - limiter.car.rear_overhang - limiter.car.lidar_offset
    room = max(ahead - to_bumper - settings.stop_margin, 0.0)
    return math.sqrt(2.0 * settings.profile_braking * limiter.braking * room)
