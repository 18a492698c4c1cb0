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

Where there is no frontier, as in a dead end, it is no faster than it can stop ahead of what it sees. Where it has
stood there for 4 s it forgets its path, which on a course as short as its memory may have been wrong.

Limits: as of frontiers and motion_search. Without a friction limit nothing says how sharply the car can turn, and
guidance is off.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

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
    least_distance_towards,
    look_again,
    search_frontier,
)
from ..perception.local_map import SIGHT, WALL_IN_1, WALL_IN_2, forget, move
from ..perception.scan_geometry import beams_between, bearing_of, looks_ahead, period_of, sees
from .motion_search import MOST_LOCK, MOTION, Query, is_clear, search_motion
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


PLANNER_LEADS, MOTION_LEADS, NOBODY_LEADS, TURN_LEADS = range(4)
"""Who leads the car on: its planner; a motion; nobody, as none is found, and it brakes; a turn in moves."""


class Lead(NamedTuple):
    """What guidance proposes in place of a planner's reference."""

    who: int  # see PLANNER_LEADS
    steering_angle: float  # [rad] of the motion or turn; NaN: the planner's
    bearing: float  # [rad] of the next point of the motion; NaN: the planner's, or none
    distance: float  # [m] of that point
    speed: float  # [m/s] greatest; of a turn the speed itself, negative in reverse
    knows_speed: bool  # the speed is that of a motion, which is free farther than is in sight


class Seen(NamedTuple):
    """What guidance sees in a tick."""

    geometry: Record  # of type SCAN_GEOMETRY
    ranges: FloatArray  # (n,) [m], without NaN or inf
    odometry: Record  # of type ODOMETRY
    limiter: Record  # of type LIMITER
    settings: Record  # fields of GuidanceSettings
    reference: Record  # the planner's, of type REFERENCE


class _Place(NamedTuple):
    """Where the LiDAR is, and how the way to go changes around it."""

    x: float  # [m]
    y: float  # [m]
    to_go: float  # [m]
    gain: float  # [m] by which the best beam shortens the way to go
    reach: float  # [m] along that beam
    bearing: float  # [rad] of that beam


@kernel
def follow_frontier(seen: Seen, memory: Record) -> Lead:
    """Return who leads the car on in this tick, and how. Without a scan that looks ahead the planner does.

    `memory` is of type GUIDANCE, written to.
    """
    geometry, ranges, odometry, limiter, settings, reference = seen
    frontier, turning = memory.frontier, memory.turning
    speed, yaw_rate = odometry.speed, odometry.angular_velocity[2]
    looks = sees(geometry, ranges) and looks_ahead(geometry, len(ranges))
    if not looks:
        move(frontier.map, speed, yaw_rate, period_of(geometry))
    if not (looks and math.isfinite(speed + math.tan(odometry.steering_angle) + yaw_rate)):
        memory.follows = turning.active = False
        return _planner_leads(math.inf, False)
    led = memory.follows or turning.active or memory.careful
    offset = limiter.car.lidar_offset
    search_frontier(geometry, ranges, odometry, offset, frontier, settings.every, settings.every_plain, led)
    turn_in_moves(frontier, limiter, turning, odometry.steering_angle, speed, period_of(geometry))
    if turning.active:
        memory.careful = True
        return Lead(TURN_LEADS, turning.steering_angle, math.nan, math.nan, turning.speed, False)
    x = frontier.map.x + offset * math.cos(frontier.map.heading)
    y = frontier.map.y + offset * math.sin(frontier.map.heading)
    to_go = distance_to_goal_around(frontier, x, y) if frontier.found else math.inf
    if not math.isfinite(to_go):
        memory.follows = False
        return _planner_leads(_speed_without_frontier(seen, memory), False)
    memory.lost = 0
    around_edge = _speed_around_edge(seen, frontier, x, y)
    most = around_edge if memory.careful else math.inf
    tight = frontier.hidden and to_go < settings.tight_distance
    if not tight and _leads_on_as_before(memory, reference):
        return _planner_leads(min(most, memory.speed), math.isfinite(memory.speed))
    place = _look_around(seen, frontier, x, y, to_go)
    bend = _bend_ahead(memory, limiter.car)
    if _planner_leads_on(seen, memory, place, bend, tight, most):
        memory.follows = False
        memory.led_on, memory.bearing = frontier.ticks, reference.bearing
        memory.steering_angle = reference.steering_angle
        return _planner_leads(min(most, memory.speed), math.isfinite(memory.speed))
    return _follow_motion(seen, memory, place, bend, around_edge)


@kernel
def _planner_leads(speed: float, knows_speed: bool) -> Lead:
    """Return that the planner leads on, no faster than a speed [m/s]."""
    return Lead(PLANNER_LEADS, math.nan, math.nan, math.nan, speed, knows_speed)


@kernel
def _leads_on_as_before(memory: Record, reference: Record) -> bool:
    """Return whether the planner led on in the tick before by this reference."""
    frontier = memory.frontier
    turned = abs(reference.steering_angle - memory.steering_angle) + abs(reference.bearing - memory.bearing)
    return bool(frontier.ticks == memory.led_on + 1 and frontier.searched != frontier.ticks and turned < _AS_BEFORE)


@kernel
def _planner_leads_on(
    seen: Seen, memory: Record, place: _Place, bend: float, tight: bool, most: float
) -> bool:
    """Return whether the planner's own reference leads on, and write the speed that a simulated motion gave.

    `bend`: see `_bend_ahead`; `tight`: the frontier is hidden and nearby; `most`: speed that is allowed [m/s].
    """
    geometry, ranges, odometry, limiter, settings, reference = seen
    memory.speed = math.inf
    if math.isnan(reference.bearing) or math.isnan(reference.steering_angle):
        return False
    frontier, car, speed = memory.frontier, limiter.car, odometry.speed
    beam = int(min(max(round((reference.bearing - geometry.angle_min) / geometry.angle_increment), 0), len(ranges) - 1))
    heading = frontier.map.heading + reference.bearing
    least, _ = least_distance_towards(frontier, place.x, place.y, math.cos(heading), math.sin(heading), ranges[beam])
    gain = place.to_go - least
    if gain >= settings.as_good * place.gain and gain > -0.5 and not (bend > _BENDS or tight):
        return True
    if (memory.careful and bend > _BENDS_SHARPLY) or not gain > settings.worth_simulating * place.gain:
        return False
    curved = 0.8 * limiter.lateral / max(speed * speed, 0.5)
    present = math.tan(odometry.steering_angle) / car.wheelbase
    wanted = saturate(math.tan(saturate(reference.steering_angle, car.max_steering_angle)) / car.wheelbase, curved)
    memory.narrow = False
    look_again(geometry, ranges, car.lidar_offset, frontier, settings.every)  # else it drives into walls not marked
    query = Query(
        0.5 * (present + wanted), speed, settings.viable_time, 1.0, MOST_LOCK, settings.horizon + 0.1 * speed * speed,
        WALL_IN_2, False, _NODES,
    )  # fmt: skip
    if not search_motion(frontier, limiter, memory.trial, query):
        return False
    if speed < settings.trusted_speed:
        memory.speed = min(_speed_on(seen, memory, memory.trial, 0), min(reference.speed, most))
    return True


@kernel
def _follow_motion(seen: Seen, memory: Record, place: _Place, bend: float, around_edge: float) -> Lead:
    """Return what keeps the car on a motion, which is searched for anew; or that there is none, and it brakes.

    `bend` as of `_planner_leads_on`; `around_edge`: speed from which the car can turn behind a hidden frontier [m/s].
    """
    geometry, ranges, odometry, limiter, settings, _ = seen
    look_again(geometry, ranges, limiter.car.lidar_offset, memory.frontier, settings.every)
    if not _renew_motion(seen, memory):
        memory.follows = not math.isnan(bend)
    if memory.follows:
        steering_angle, bearing, distance = _steer(seen, memory.frontier.map, memory.motion, memory.progress)
        speed = min(_speed_on(seen, memory, memory.motion, memory.progress), around_edge)
        return Lead(MOTION_LEADS, steering_angle, bearing, distance, speed, True)
    if memory.trial.count > 0:
        steering_angle, bearing, distance = _steer(seen, memory.frontier.map, memory.trial, 0)
        return Lead(NOBODY_LEADS, steering_angle, bearing, distance, 0.0, False)
    return Lead(NOBODY_LEADS, odometry.steering_angle, place.bearing, place.reach, 0.0, False)


@kernel
def _look_around(seen: Seen, frontier: Record, x: float, y: float, to_go: float) -> _Place:
    """Return the place of the LiDAR [m], whose way to go is known, with the beam that shortens it most."""
    geometry, ranges, heading = seen.geometry, seen.ranges, frontier.map.heading
    gain, at, best = -math.inf, 0.0, 0
    turn_cos, turn_sin = math.cos(geometry.angle_increment * _BEAMS), math.sin(geometry.angle_increment * _BEAMS)
    cos, sin = math.cos(heading + geometry.angle_min), math.sin(heading + geometry.angle_min)
    for beam in range(0, len(ranges), _BEAMS):
        least, reach = least_distance_towards(frontier, x, y, cos, sin, ranges[beam])
        if to_go - least > gain:
            gain, at, best = to_go - least, reach, beam
        cos, sin = cos * turn_cos - sin * turn_sin, sin * turn_cos + cos * turn_sin
    return _Place(x, y, to_go, gain, at, bearing_of(geometry, best))


@kernel
def _renew_motion(seen: Seen, memory: Record) -> bool:
    """Search for a motion in every second tick, or in each while the car has none; return whether one was found."""
    if memory.follows and memory.frontier.ticks % 2 == 1:
        return False
    limiter, settings, speed, trial = seen.limiter, seen.settings, seen.odometry.speed, memory.trial
    present, lag = math.tan(seen.odometry.steering_angle) / limiter.car.wheelbase, LAG + late_by(limiter.car)
    horizon, narrow = settings.horizon + 0.1 * speed * speed, False
    query = Query(present, speed, lag, settings.grip, settings.lock, horizon, WALL_IN_2, False, _NODES)
    found = search_motion(memory.frontier, limiter, trial, query)
    if not found:
        query = Query(present, speed, lag, 1.0, MOST_LOCK, horizon, WALL_IN_2, False, _NODES)
        found = search_motion(memory.frontier, limiter, trial, query)
    if not found and speed < 2.0:
        query = Query(present, speed, lag, 1.0, MOST_LOCK, 2.0, WALL_IN_1, False, _NODES)
        found = narrow = search_motion(memory.frontier, limiter, trial, query)
    if found:
        memory.motion.count = trial.count
        memory.motion.points[:] = trial.points
        memory.follows, memory.progress, memory.narrow = True, 0, narrow
    return found


@kernel
def _bend_ahead(memory: Record, car: Record) -> float:
    """Return the greatest curvature of what is left of the motion, as a share of that at full lock.

    NaN: there is no motion, it is not free, or the car is not on it.
    """
    world, motion = memory.frontier.map, memory.motion
    if not memory.follows:
        return math.nan
    memory.progress = next_point(motion.points[: motion.count], memory.progress, world.x, world.y, world.heading)
    _, aside, angle = errors(motion.points[memory.progress], world.x, world.y, world.heading)
    if memory.progress + 2 >= motion.count or abs(aside) > _ON_MOTION[0] or abs(angle) > _ON_MOTION[1]:
        return math.nan
    most = 0.0
    for k in range(memory.progress, motion.count):
        x, y, heading = motion.points[k, X], motion.points[k, Y], motion.points[k, HEADING]
        if not is_clear(memory.frontier, car, x, y, math.cos(heading), math.sin(heading), WALL_IN_1):
            return math.nan
        most = max(most, abs(motion.points[k, CURVATURE]))
    return float(most * car.wheelbase / math.tan(car.max_steering_angle))


@kernel
def _steer(seen: Seen, world: Record, motion: Record, first: int) -> tuple[float, float, float]:
    """Return the steering angle [rad] that keeps the car on a motion, and bearing [rad] and distance [m] of a point."""
    points, car, speed = motion.points[: motion.count], seen.limiter.car, seen.odometry.speed
    late, path_late = late_by(car), late_on_path(seen.limiter.slip, car, speed)
    pose = (world.x, world.y, world.heading)
    steering_angle = steer_along(points, first, pose, speed, car.wheelbase, late, path_late)
    dx, dy = points[first, X] - world.x, points[first, Y] - world.y
    cos, sin = math.cos(world.heading), math.sin(world.heading)
    return steering_angle, math.atan2(cos * dy - sin * dx, cos * dx + sin * dy), math.hypot(dx, dy)


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
def _speed_on(seen: Seen, memory: Record, motion: Record, first: int) -> float:
    """Return the speed [m/s] from which the car slows in time for a motion's curves, and stops at its end."""
    limiter, settings, speed = seen.limiter, seen.settings, seen.odometry.speed
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
def _speed_around_edge(seen: Seen, frontier: Record, x: float, y: float) -> float:
    """Return the speed [m/s] from which the car can turn at full lock behind a hidden frontier; inf: it is not hidden.
    """
    limiter, settings = seen.limiter, seen.settings
    if not frontier.hidden:
        return math.inf
    away = math.hypot(frontier.x - x, frontier.y - y)
    tightest = math.tan(lock_arc(limiter.slip, limiter.car)) / limiter.car.wheelbase
    turning = settings.grip * limiter.lateral / tightest
    return math.sqrt(turning + 2.0 * settings.hidden_braking * limiter.braking * away)


@kernel
def _speed_without_frontier(seen: Seen, memory: Record) -> float:
    """Return the speed [m/s] of a car whose way to go is not known, and forget its path once it has stood for long."""
    settings = seen.settings
    memory.lost = memory.lost + 1 if not memory.frontier.found else 0
    stops = memory.lost > settings.lost_after
    if memory.lost > settings.start_again_after and abs(seen.odometry.speed) < 0.1:
        memory.lost = 0
        forget(memory.frontier.map)  # the path or the map may be wrong
    return speed_to_stop(seen.geometry, seen.ranges, seen.limiter, settings) if stops else math.inf


@kernel
def speed_to_stop(geometry: Record, ranges: FloatArray, limiter: Record, settings: Record) -> float:
    """Return the speed [m/s] from which the car stops ahead of what is in front of it."""
    first, end = beams_between(geometry, len(ranges), -_AHEAD, _AHEAD)
    ahead = SIGHT
    for beam in range(first, end):
        ahead = min(ahead, ranges[beam])
    to_bumper = limiter.car.length - limiter.car.rear_overhang - limiter.car.lidar_offset
    room = max(ahead - to_bumper - settings.stop_margin, 0.0)
    return math.sqrt(2.0 * settings.profile_braking * limiter.braking * room)
