"""One simulation of the car along a proposal: the friction limiter, the servos and the slip of soft tires in the loop.

    here = Situation(...)
    met = simulate(here, plan, use, speed)  # of a Plan, with a share of the grip for cornering

A plan commands its speed for a tick, and then brakes to a stop; along a path that says how fast the car drives, it goes
on to its end. It steers along a path, or to a goal. The car meets something where one of its discs comes near what
stands (the widened scan, and ground of the local map that a corner hides) or near where something that moves may be at
that time: `occupied`, which all proposals share. Of ground that the car knows, only ends of beams count: the widened
scan has a wall beside the way in it.

These stops are as hard as the tires hold. Limits: braking does not turn the simulated car in. What the scan does not
show counts as free.

Sources: D. Fox, W. Burgard and S. Thrun, The Dynamic Window Approach to Collision Avoidance, IEEE Robotics & Automation
Magazine 4(1), 1997, for simulated stops; S. Petti and T. Fraichard, Safe Motion Planning in Dynamic Environments,
IEEE/RSJ IROS 2005, for ends that stay free.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from fg_mujoco.compiled.kernels import inlined, kernel
from fg_mujoco.messages import FloatArray

from ..control.planner_settings import Record
from ..control.slip import late_on_path, path_lag
from ..control.speed import share_of_way
from ..control.steering import arc_through, late_by
from ..control.tracking import SPEED, next_point, steer_along
from ..perception.local_map import FREE as FREE_GROUND
from ..perception.local_map import KIND, NEARNESS, PER_METRE, RING, in_window
from ..perception.scan_geometry import nearest_beam
from .friction_limiter import limited
from .predictions import WAIT, WAITS, meets

_FINE_TICKS = 8  # later ones are simulated two at a time
_TICKS = 64  # of the longest stop: 3 s
_BEAMS = 16  # to each side of a disc on known ground, that are looked at
_LONGER = 1.02  # [-] way of a stop over that of wheels that do not slip; tires that brake slip by up to 1 %


class Situation(NamedTuple):
    """What a proposal is judged by: the car, and all that may be in its way."""

    limiter: Record  # of type LIMITER
    memory: Record  # of type LIMITER_MEMORY, unchanged after a simulation
    settings: Record  # fields of JudgeSettings
    geometry: Record  # of type SCAN_GEOMETRY
    ranges: FloatArray  # readings (n,) [m]
    widened: FloatArray  # the same, each widened by a disc over the car's front
    radius: float  # [m] of that disc
    movers: FloatArray  # (k, 12) predictions of what moves, which is not in the scan
    ground: Record  # of type FRONTIER_SEARCH
    angle: float  # [rad] present steering angle
    speed: float  # [m/s] present
    period: float  # [s] of a tick
    known: bool  # whether what the scan hides counts as free: the car has driven there


@inlined
def without_movers(here: Situation) -> Situation:
    """Return the situation without what moves."""
    return among_standing(here, here.angle)


@inlined
def among_standing(here: Situation, angle: float) -> Situation:
    """Return the situation without what moves, of a car whose wheels stand at an angle [rad]."""
    return Situation(
        here.limiter, here.memory, here.settings, here.geometry, here.ranges, here.widened, here.radius,
        here.movers[:0], here.ground, angle, here.speed, here.period, here.known,
    )  # fmt: skip


FREE, STANDS, MOVES = range(3)
"""What a car meets: nothing, something that stands, or something that moves."""


class Met(NamedTuple):
    """What a simulated car meets on its way to a stop."""

    speed: float  # [m/s] then; 0: it meets nothing
    time: float  # [s] until then, or until it stands
    what: int  # FREE, STANDS or MOVES


class Plan(NamedTuple):
    """How a proposal is followed: the frame is that of the rear axle; `path` has no points where it leads to a goal."""

    bearing: float  # [rad] of the goal from the LiDAR
    distance: float  # [m] of that goal
    path: FloatArray  # (m, 4) motion, as in control.tracking, or (m, 5) with the speeds at which the car goes on
    speed: float  # [m/s] that is commanded for a tick, before the car brakes
    margin: float  # [m] ahead of the bumper


@kernel
def simulate(here: Situation, plan: Plan, use: float, speed: float) -> Met:
    """Return what a car of a speed [m/s] meets on its way to a stop, with a share of the grip for cornering."""
    limiter, memory, period = here.limiter, here.memory, here.period
    car, kept = limiter.car, (memory.acceleration, memory.curvature)
    turned = share_of_way(period, limiter.settings.steering_response)  # part of a command that a tick carries out
    slowed = share_of_way(period, car.speed_time_constant)
    slowed_twice, standing = share_of_way(2.0 * period, car.speed_time_constant), here.settings.standing_speed
    x, y, heading, angle = 0.0, 0.0, 0.0, here.angle
    time, index, met = 0.0, 0, Met(0.0, 0.0, FREE)
    for tick in range(_TICKS):
        ticks = 1.0 if tick < _FINE_TICKS else 2.0
        reference, index = _steer(here, plan, index, x, y, heading, angle, speed)
        aim = plan.speed if tick == 0 else 0.0
        if plan.path.shape[1] > SPEED:  # it goes on
            if index + 1 == len(plan.path):
                break
            aim = min(plan.speed, plan.path[index, SPEED])
        command = limited(limiter, memory, (reference, aim), use, (angle, speed), ticks * period, True)
        next_angle = angle + ticks * turned * (command[0] - angle)
        next_speed = speed + (slowed if tick < _FINE_TICKS else slowed_twice) * (command[1] - speed)
        way = _LONGER * 0.5 * (speed + next_speed) * ticks * period
        curvature = math.tan(0.5 * (angle + next_angle)) / car.wheelbase
        if limiter.slip.needs_slip_angle:
            follow = 1.0 - math.exp(-way / path_lag(limiter.slip, 0.5 * (speed + next_speed)))
            memory.curvature += (curvature - memory.curvature) * follow
            curvature = memory.curvature
        x += way * math.cos(heading + 0.5 * curvature * way)
        y += way * math.sin(heading + 0.5 * curvature * way)
        heading += curvature * way
        angle, speed, time = next_angle, next_speed, time + ticks * period
        what = occupied(here, plan, (x, y, heading), time, speed < standing)
        met = Met(max(speed, standing) if what != FREE else 0.0, time, what)
        if what != FREE or speed < standing:
            break
    memory.acceleration, memory.curvature = kept
    return met


@inlined
def _steer(
    here: Situation, plan: Plan, index: int, x: float, y: float, heading: float, angle: float, speed: float
) -> tuple[float, int]:
    """Return the steering angle [rad] along a plan from a place, and the index of the path's next point."""
    car, slip, settings = here.limiter.car, here.limiter.slip, here.settings
    if len(plan.path) > 0:
        index = next_point(plan.path, index, x, y, heading)
        late, path_late = late_by(car), late_on_path(slip, car, speed)
        return steer_along(plan.path, index, (x, y, heading), speed, car.wheelbase, late, path_late), index
    lidar, cos, sin = car.lidar_offset, math.cos(heading), math.sin(heading)
    goal_x, goal_y = lidar + plan.distance * math.cos(plan.bearing) - x, plan.distance * math.sin(plan.bearing) - y
    ahead, left = cos * goal_x + sin * goal_y - lidar, cos * goal_y - sin * goal_x
    distance = math.sqrt(ahead * ahead + left * left)
    if distance <= settings.arrived:
        return angle, index
    nearer = min(1.0, (settings.pursuit_distance + path_lag(slip, speed)) / distance)
    return arc_through(lidar + nearer * ahead, nearer * left, car.wheelbase), index


@inlined
def occupied(here: Situation, plan: Plan, pose: tuple[float, float, float], time: float, stands: bool) -> int:
    """Return what a car meets whose rear axle is at a pose x [m], y [m], heading [rad] at a time [s].

    What has to stay clear: the disc over the car's front, its centre a quarter of the width behind the bumper, and the
    plan's margin ahead of it; and discs of the same size round the LiDAR and the rear axle, which cut the corner, once
    they are ahead of where the LiDAR is now. Along a path, ground that the local map has free counts as free where a
    corner hides it. On known ground all that is hidden does, and only ends of beams within the bare car's discs count.
    Where the car `stands`, nothing that moves may come by for a while.
    """
    car, x, y, cos, sin = here.limiter.car, pose[0], pose[1], math.cos(pose[2]), math.sin(pose[2])
    lidar, front = car.lidar_offset, car.length - car.rear_overhang - 0.25 * car.width
    for offset in (front, 0.0, lidar):
        ahead, left = x + offset * cos - lidar, y + offset * sin
        if offset == front or ahead > 0.0:
            # widening does not shorten a reading, so what is in front of the disc has to stay clear, too
            more = 0.25 * car.width + plan.margin if offset == front else 0.0
            away, seen = math.sqrt(ahead * ahead + left * left), reading_towards(here, ahead, left)
            if here.known:
                if not seen > away + more and _ends_in(here, ahead, left, away):
                    return STANDS
            elif not seen > away + more:
                hidden = len(plan.path) > 0 and away > seen + here.radius  # what stands there is before it
                if not (hidden and _was_seen(here, pose, offset) and _was_seen(here, pose, offset + more)):
                    return STANDS
    if len(here.movers) > 0:
        apart = here.radius + here.settings.margin_aside
        for offset in (0.0, lidar, front):
            for wait in range(WAITS + 1 if stands else 1):
                if meets(here.movers, x + offset * cos - lidar, y + offset * sin, apart, time + WAIT * wait):
                    return MOVES
    return FREE


@kernel
def _ends_in(here: Situation, ahead: float, left: float, away: float) -> bool:
    """Return whether a beam ends in the disc of the bare car round a place in the frame of the LiDAR, `away` [m]."""
    increment, width = here.geometry.angle_increment, here.limiter.car.width
    radius = math.hypot(0.5 * width, 0.25 * width)  # it covers the corners of the front
    middle, half = nearest_beam(here.geometry.angle_min, increment, ahead, left), math.inf
    if away > radius:
        half = math.asin(radius / away) / increment
    step = max(int(half / _BEAMS), 1) if away > radius else 1
    for beam in range(int(max(middle - half, 0.0)), int(min(middle + half, len(here.ranges) - 1.0)) + 1, step):
        end, off = here.ranges[beam], (beam - middle) * increment
        if end - away < radius and end * end + away * away - 2.0 * end * away * math.cos(off) < radius * radius:
            return True
    return False


@kernel
def _was_seen(here: Situation, pose: tuple[float, float, float], ahead: float) -> bool:
    """Return whether the ground at a place ahead of a rear axle is free on the local map, .4 m and more from walls."""
    world = here.ground.map
    x, y = pose[0] + ahead * math.cos(pose[2]), pose[1] + ahead * math.sin(pose[2])
    cos, sin = math.cos(world.heading), math.sin(world.heading)
    i = math.floor((world.x + cos * x - sin * y) * PER_METRE)
    j = math.floor((world.y + sin * x + cos * y) * PER_METRE)
    return bool(in_window(world, i, j) and world.cells[i & RING, j & RING] & (KIND | NEARNESS) == FREE_GROUND)


@inlined
def reading_towards(here: Situation, ahead: float, left: float) -> float:
    """Return the widened reading [m] in the direction of a point [m] in the frame of the LiDAR."""
    index = nearest_beam(here.geometry.angle_min, here.geometry.angle_increment, ahead, left)
    return float(here.widened[int(min(len(here.widened) - 1.0, max(0.0, index)))])


@kernel
def reading(here: Situation, bearing: float) -> float:
    """Return the widened reading [m] at a bearing [rad]."""
    index = np.rint((bearing - here.geometry.angle_min) / here.geometry.angle_increment)
    return float(here.widened[int(min(len(here.widened) - 1.0, max(0.0, index)))])
