"""The judge: of all that is proposed for the next tick, the first proposal after which the car can stop is driven.

Each proposal is simulated (rollout) with several shares of the grip for cornering, in the order of WHY. The first that
meets nothing wins. Where each meets something, the one that does so slowest wins, and the first of those that are as
slow. So a planner's reference is driven as long as the car could stop afterwards, and all below it is there for when it
could not:

of a stage    a motion of a stage of the user's (decision.propose)
line          the remembered line (lap_raceline)
reference     what the planner or guidance wants, at its speed: along an arc, or along a motion
stop          the same, braking: the stop of the last tick, which needs half of the margins
aside         in another direction, no faster than the crawl speed; those with the longest view first
beside        the same next to the reference's, at the speed of the reference
motion        braking along the motion of guidance: a car that leaves it before a hairpin does not get round
last stop     braking along the motion on which the car could last stop
as it stands  braking with the wheels as they are: to steer to and fro between directions as bad takes from braking

The nearest direction to the reference often ends in the corner between a box and a wall; the one with the longest view
does not. Stops in other directions have a margin besides, so that they are not lost at once.

Sources: D. Fox, W. Burgard and S. Thrun, The Dynamic Window Approach to Collision Avoidance, IEEE Robotics & Automation
Magazine 4(1), 1997, for directions and shares of grip; S. Petti and T. Fraichard, Safe Motion Planning in Dynamic
Environments, IEEE/RSJ IROS 2005, for the stop of the last tick.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.messages import FloatArray

from ..control.planner_settings import FROM_ZERO, POSITIVE, SHARE, Record, Settings, setting, setting_of_car
from ..control.reasons import (
    AS_IT_STANDS,
    ASIDE,
    BESIDE,
    LAST_STOP,
    MOTION,
    OWN,
    PROPOSALS,
    REFERENCE,
    STOP,
    log_proposal,
)
from ..control.slip import held_arc, late_on_path, path_lag
from ..control.steering import bearing_of_arc, late_by, pursue
from ..control.tracking import steer_along
from .rollout import FREE, Plan, Situation, reading, simulate

_USES = np.array([0.5, 1.0, 0.75, 0.25])  # shares of the grip for cornering, in this order: the limiter's own first
_BRAKING = np.append(_USES, 0.0)  # the same of a stop: a car that brakes straight on loses the bend that it is in
_BRAKES_FIRST = np.array([0.0, 0.25])
_BESIDE = 0.06  # [rad] of steering from the reference, within which a direction is driven as fast as the reference
_WIDEST = 1.8  # [rad] to either side; directions further back are not simulated

BEST = np.dtype(
    [
        ("why", np.int64),
        ("steering_angle", np.float64),  # [rad] of the command
        ("speed", np.float64),  # [m/s]
        ("use", np.float64),  # share of the grip for cornering
        ("contact", np.float64),  # [m/s] at which the car meets something; 0: nothing; inf: none was simulated
    ]
)
"""Type of the best proposal."""

JUDGE = np.dtype(
    [
        ("passed", np.bool_),  # whether the reference passed in the last tick
        ("best", BEST),  # of this tick
        ("second", BEST),  # that it is compared with; kernels keep no record but in a memory
        ("line", BEST),  # on the remembered line, or beside it
        ("own", np.int64),  # how many motions stages of the user's proposed in this tick
        ("proposals", *PROPOSALS),  # of the last decision; written, and never read
    ]
)
"""Type of what the judge keeps from tick to tick; zero at the beginning."""


@dataclass(frozen=True, kw_only=True)
class JudgeSettings(Settings):
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


class Wanted(NamedTuple):
    """What the planner or guidance wants, and what the judge needs besides."""

    steering_angle: float  # [rad]
    speed: float  # [m/s]
    path: FloatArray  # motion (m, 4) in the frame of the rear axle, along which it leads; m may be 0
    guided: bool  # whether that is a motion of guidance
    last_stop: FloatArray  # motion (m, 4) along which the car could last stop; m may be 0
    passed: bool  # whether the reference passed in the last tick


@kernel
def judge(here: Situation, wanted: Wanted, memory: Record) -> None:
    """Write the best of all proposals to `memory`, of type JUDGE."""
    proposals, best = memory.proposals, memory.best
    settings, path, angle = here.settings, wanted.path, wanted.steering_angle
    margin = settings.margin if len(path) == 0 else settings.margin_aside
    if wanted.passed:
        margin *= settings.margin_kept
    best.contact = math.inf
    if consider(here, REFERENCE, angle, _plan(here, angle, path, wanted.speed, margin), _USES, proposals, best):
        return
    if wanted.passed and here.speed > settings.crawl_speed:
        stop = _plan(here, angle, path, 0.0, margin)
        if consider(here, STOP, angle, stop, _BRAKING, proposals, best):
            return
    if _look_aside(here, wanted, proposals, best):
        _stay_near(here, wanted, proposals, best, memory.second)
        return
    if len(wanted.last_stop) > 0 and here.speed > settings.standing_speed:
        on_it = _steering_on(here, wanted.last_stop)
        for margin in (settings.margin_kept * settings.margin_aside, 0.0):
            last = _plan(here, on_it, wanted.last_stop, 0.0, margin)
            if consider(here, LAST_STOP, on_it, last, _BRAKING, proposals, best):
                return
    if wanted.guided:  # it is free, as far as its search could tell
        best.why, best.steering_angle, best.use = REFERENCE, angle, 1.0


@kernel
def judge_own(here: Situation, path: FloatArray, speed: float, memory: Record) -> bool:
    """Take a motion that a stage of the user's proposed, if the car can stop on it; `memory` is of type JUDGE."""
    found, angle = memory.second, _steering_on(here, path)
    found.contact = math.inf
    plan = Plan(0.0, 0.0, path, speed, here.settings.margin_aside)
    if consider(here, OWN, angle, plan, _USES, memory.proposals, found):
        take(memory.best, found)
        return True
    return False


@kernel
def _steering_on(here: Situation, path: FloatArray) -> float:
    """Return the steering angle [rad] that keeps the car on a motion from here."""
    car, slip = here.limiter.car, here.limiter.slip
    late, path_late = late_by(car), late_on_path(slip, car, here.speed)
    return float(steer_along(path, 0, (0.0, 0.0, 0.0), here.speed, car.wheelbase, late, path_late))


@kernel
def take(best: Record, found: Record) -> None:
    """Take another proposal for the best one."""
    best.why, best.steering_angle, best.speed = found.why, found.steering_angle, found.speed
    best.use, best.contact = found.use, found.contact


@kernel
def consider(
    here: Situation, why: int, steering_angle: float, plan: Plan, uses: FloatArray, proposals: FloatArray, best: Record
) -> bool:
    """Simulate a proposal, keep it if it is better than the best one, and return whether it meets nothing."""
    for use in uses:
        met = simulate(here, plan, use, max(here.speed, here.settings.crawl_speed))
        log_proposal(proposals, why, steering_angle, plan.speed, met)
        if met.speed < best.contact:
            best.why, best.steering_angle, best.speed = why, steering_angle, plan.speed
            best.use, best.contact = use, met.speed
        if met.what == FREE:
            return True
    return False


@kernel
def _plan(here: Situation, steering_angle: float, path: FloatArray, speed: float, margin: float) -> Plan:
    """Return the plan along a path, or without one towards the end of the view on an arc."""
    bearing = _bearing_of(here, steering_angle)
    return Plan(bearing, max(reading(here, bearing), here.settings.nearest_goal), path, speed, margin)


@kernel
def _reach(here: Situation) -> float:
    """Return the distance [m] of the goal by which a steering angle is read as a bearing."""
    speed = max(here.speed, here.settings.crawl_speed)
    return float(here.settings.pursuit_distance + path_lag(here.limiter.slip, speed))


@kernel
def _bearing_of(here: Situation, steering_angle: float) -> float:
    """Return the bearing [rad] of a goal on the arc of a steering angle [rad]."""
    car = here.limiter.car
    return bearing_of_arc(steering_angle, _reach(here), car.lidar_offset, car.wheelbase)


@kernel
def _look_aside(here: Situation, wanted: Wanted, proposals: FloatArray, best: Record) -> bool:
    """Consider the directions to both sides of the reference, and the one in which the wheels stand."""
    settings, car, nowhere = here.settings, here.limiter.car, np.empty((0, 4))
    middle, speed = _bearing_of(here, wanted.steering_angle), min(wanted.speed, settings.crawl_speed)
    count = 2 * math.floor(settings.fan / settings.fan_step + 1e-6)
    bearings, views = np.empty(count), np.empty(count)  # [rad] a step left, a step right, two left, ...; [m]
    for number in range(count):
        bearings[number] = middle + settings.fan_step * (number // 2 + 1) * (1.0 if number % 2 == 0 else -1.0)
        views[number] = max(reading(here, bearings[number]), settings.nearest_goal)
        if abs(bearings[number]) > _WIDEST:
            views[number] = 0.0
    for _ in range(count):
        number = int(np.argmax(views))
        if not views[number] > 0.0:
            break
        plan = Plan(bearings[number], views[number], nowhere, speed, settings.margin_aside)
        angle = pursue(bearings[number], _reach(here), car.lidar_offset, car.wheelbase)
        if consider(here, ASIDE, angle, plan, _USES, proposals, best):
            return True
        views[number] = 0.0
    held, bearing = held_arc(here.limiter.slip, car, here.angle, here.memory.curvature), _bearing_of(here, here.angle)
    plan = Plan(bearing, max(reading(here, bearing), settings.pursuit_distance), nowhere, speed, settings.margin_aside)
    return consider(here, AS_IT_STANDS, held, plan, _USES, proposals, best)


@kernel
def _stay_near(here: Situation, wanted: Wanted, proposals: FloatArray, best: Record, found: Record) -> None:
    """Take what is nearer to the reference than a direction aside, if it meets nothing, too."""
    settings = here.settings
    found.contact = math.inf
    if wanted.guided:
        plan = _plan(here, wanted.steering_angle, wanted.path, 0.0, settings.margin_aside)
        consider(here, MOTION, wanted.steering_angle, plan, _BRAKES_FIRST, proposals, found)
    elif len(wanted.path) == 0 and abs(best.steering_angle - wanted.steering_angle) < _BESIDE:
        plan = _plan(here, best.steering_angle, wanted.path, wanted.speed, settings.margin_kept * settings.margin)
        consider(here, BESIDE, best.steering_angle, plan, _USES, proposals, found)
    if found.contact == 0.0:
        take(best, found)
