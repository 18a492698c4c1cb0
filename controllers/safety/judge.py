"""The judge: of all that is proposed for the next tick, the first proposal after which the car can stop is driven.

Proposals are judged in the order of WHY. Each is simulated (rollout) with several shares of the grip for cornering. The
first that stops without meeting anything wins; where none does, the one that meets something slowest, and of those that
are as slow the first. So a planner's reference is followed as long as the car could still stop afterwards, and everything
below it in the list is there for when it could not:

reference    what the planner, guidance or another stage wants, at its speed: towards a goal, or along a motion
stop         the same, but braking: the stop of the last tick, with half of the margins
beside       next to the reference, at its speed
motion       along the motion of guidance, braking
aside        in other directions, no faster than the crawl speed: those with the longest view first
last stop    along the motion on which the car could last stop
as it is     braking with the wheels as they stand: to steer to and fro between directions as bad takes from braking
back         a car that stands, and has no direction that is free, reverses along its path (recovery)

Among things that move a plan in time comes before all of these.

Sources: D. Fox, W. Burgard and S. Thrun, The Dynamic Window Approach to Collision Avoidance, IEEE Robotics & Automation
Magazine 4(1), 1997, for directions and shares of grip; S. Petti and T. Fraichard, Safe Motion Planning in Dynamic
Environments, IEEE/RSJ IROS 2005, for the stop of the last tick.
"""

from __future__ import annotations

import math

import numpy as np

from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.messages import FloatArray

from ..control.actuation import apply_limits
from ..control.decision import _by_laws, _in_sight, _is_decided, extend_path_history
from ..control.planner_settings import Record
from ..control.reasons import AFTER_RECOVERY, PLAN_IN_TIME, RECOVERY, SAFETY_FILTER, SIGHT, log_step
from ..control.slip import held_arc, late_on_path, path_lag
from ..control.stages import Stage
from ..control.steering import late_by, pursue, saturate
from ..control.tracking import steer_along
from ..perception.scan_filters import widen_all
from ..perception.scan_geometry import period_of
from .guidance import keep_stop, path_ahead, stop_ahead
from .plan_in_time import BACKING_SPEED, BACKS_OFF, DRIVES, is_among, plan_in_time
from .predictions import turned
from .recovery import angle_along_history, reverses
from .rollout import Plan, Situation, reading, simulate
from .safety_filter import bearing_of_arc

REFERENCE, STOP, BESIDE, MOTION, ASIDE, LAST_STOP, AS_IT_IS = range(7)

_USES = np.array([0.5, 1.0, 0.75, 0.25])  # shares of the grip for cornering, in this order: the limiter's own first
_BRAKING = np.array([0.0, 0.25, 0.5, 0.75, 1.0])  # in this order where the car corners as little as it can
_BRAKES_FIRST = np.array([0.0, 0.25])
_ANY = np.array([1.0])
_BESIDE = 0.06  # [rad]
_WIDEST = 1.8  # [rad] to either side; directions further back are not simulated
_ONWARDS = 3.0  # [m/s] with which the car may go on among targets where its reference is slower

BEST = np.dtype(
    [
        ("why", np.int64),
        ("steering_angle", np.float64),  # [rad] of the command
        ("speed", np.float64),  # [m/s]
        ("use", np.float64),  # share of the grip for cornering
        ("contact", np.float64),  # [m/s] at which the car meets something; 0: it stops; inf: nothing was simulated
        ("time", np.float64),  # [s] until then
    ]
)


@kernel
def consider(here: Situation, why: int, steering_angle: float, plan: Plan, uses: FloatArray, best: Record) -> bool:
    """Simulate a proposal, keep it if it meets something slower than the best so far, and return whether that is free.
    """
    for use in uses:
        if best.contact == 0.0:
            break
        contact, time = simulate(here, plan, use)
        if contact < best.contact:
            best.why, best.steering_angle, best.speed, best.use = why, steering_angle, plan.speed, use
            best.contact, best.time = contact, time
    return bool(best.contact == 0.0)


@kernel
def towards(here: Situation, steering_angle: float, speed: float, margin: float) -> Plan:
    """Return the plan of an arc: towards the end of the view in its direction."""
    settings = here.settings
    bearing = _bearing_of(here, steering_angle)
    return Plan(bearing, max(reading(here, bearing), settings.nearest_goal), np.empty((0, 4)), speed, 1, margin)


@kernel
def along(here: Situation, path: FloatArray, speed: float, margin: float) -> Plan:
    """Return the plan of a motion (m, 4) in the frame of the rear axle."""
    return Plan(0.0, 0.0, path, speed, 1, margin)


@kernel
def _bearing_of(here: Situation, steering_angle: float) -> float:
    """Return the bearing [rad] of a goal on the arc of a steering angle [rad]."""
    car, settings = here.limiter.car, here.settings
    pursuit = settings.pursuit_distance + path_lag(here.limiter.slip, max(here.speed, settings.crawl_speed))
    return bearing_of_arc(steering_angle, pursuit, car.lidar_offset, car.wheelbase)


@kernel
def look_aside(here: Situation, reference: float, speed: float, best: Record) -> bool:
    """Consider the directions to both sides of a reference [rad], those with the longest view first."""
    settings, car = here.settings, here.limiter.car
    pursuit = settings.pursuit_distance + path_lag(here.limiter.slip, max(here.speed, settings.crawl_speed))
    middle = _bearing_of(here, reference)
    each_side = math.floor(settings.fan / settings.fan_step + 1e-6)
    views = np.empty(2 * each_side)  # [m]: to the left of the reference, and to the right
    for number in range(2 * each_side):
        bearing = middle + _offset(number, settings.fan_step)
        views[number] = 0.0 if abs(bearing) > _WIDEST else max(reading(here, bearing), settings.nearest_goal)
    for _ in range(2 * each_side):
        number = int(np.argmax(views))
        if views[number] <= 0.0:
            break
        bearing = middle + _offset(number, settings.fan_step)
        plan = Plan(bearing, views[number], np.empty((0, 4)), speed, 1, settings.margin_aside)
        steering_angle = pursue(bearing, pursuit, car.lidar_offset, car.wheelbase)
        if consider(here, ASIDE, steering_angle, plan, _USES, best):
            return True
        views[number] = 0.0
    return False


@kernel
def _offset(number: int, step: float) -> float:
    """Return the angle between a direction and the reference [rad]: a step left, a step right, two left, ..."""
    return float(step * (number // 2 + 1) * (1.0 if number % 2 == 0 else -1.0))


@kernel
def judge(
    here: Situation, steering_angle: float, speed: float, path: FloatArray, motion: bool, last: FloatArray,
    passed: bool, best: Record,
) -> None:  # fmt: skip
    """Write the best of all proposals for a reference.

    Args:
      here: the situation.
      steering_angle: of the reference [rad].
      speed: of the reference [m/s].
      path: motion (m, 4) that the reference leads along; m may be 0.
      motion: whether that is one of guidance.
      last: motion (m, 4) along which the car could last stop; m may be 0.
      passed: whether the reference passed in the last tick.
      best: of type BEST, written to.
    """
    settings, car = here.settings, here.limiter.car
    margin = settings.margin if len(path) == 0 else settings.margin_aside
    kept = settings.margin_kept * margin if passed else margin
    best.contact, crawl = math.inf, min(speed, settings.crawl_speed)
    plan = along(here, path, speed, kept) if len(path) > 0 else towards(here, steering_angle, speed, kept)
    if consider(here, REFERENCE, steering_angle, plan, _USES, best):
        return
    if passed and here.speed > settings.crawl_speed:
        stop = Plan(plan.bearing, plan.distance, plan.path, 0.0, 1, kept)
        if consider(here, STOP, steering_angle, stop, _BRAKING, best):
            return
    if motion and consider(
        here, MOTION, steering_angle, along(here, path, 0.0, settings.margin_aside), _BRAKES_FIRST, best
    ):
        return
    if look_aside(here, steering_angle, crawl, best):
        beside = best.steering_angle
        if len(path) == 0 and abs(beside - steering_angle) < _BESIDE:
            best.contact = math.inf
            plan = towards(here, beside, speed, settings.margin_kept * settings.margin)
            if not consider(here, BESIDE, beside, plan, _USES, best):
                best.why, best.steering_angle, best.speed, best.contact = ASIDE, beside, crawl, 0.0
        return
    if len(last) > 1 and here.speed > settings.standing_speed:
        late, path_late = late_by(car), late_on_path(here.limiter.slip, car, here.speed)
        on_last = steer_along(last, 0, 0.0, 0.0, 0.0, here.speed, car.wheelbase, late, path_late)
        for margin in (settings.margin_kept * settings.margin_aside, 0.0):
            if consider(here, LAST_STOP, on_last, along(here, last, 0.0, margin), _BRAKING, best):
                return
    held = held_arc(here.limiter.slip, car, here.angle, here.memory.curvature)
    as_it_is = towards(here, here.angle, crawl, settings.margin_aside)
    distance = max(as_it_is.distance, settings.pursuit_distance)
    as_it_is = Plan(as_it_is.bearing, distance, as_it_is.path, crawl, 1, settings.margin_aside)
    consider(here, AS_IT_IS, held, as_it_is, _USES, best)


@kernel
def drive_judged(  # type: ignore[no-untyped-def]
    geometry, ranges, ranges_without_cars, ranges_without_movers, tick, lines, trajectories, stage_state, command
):
    """Write the command of the proposal that wins; arguments as in stages."""
    if _is_decided(tick, command):
        return
    driver, memory, reference, odometry = tick.driver, tick.memory, tick.reference, tick.odometry
    speed = _by_laws(ranges, tick)
    table, settings, guidance = trajectories[driver.trajectories], driver.filter_settings, memory.guidance
    angle = memory.velocity_frame.angle if driver.limiter.slip.needs_slip_angle else 0.0
    movers = turned(memory.predictions, angle)
    widened = widen_all(
        ranges_without_movers if len(movers) > 0 else ranges, tick.geometry.angle_increment, table.radius
    )
    extend_path_history(tick.geometry, odometry, driver, memory)
    here = Situation(
        driver.limiter, memory.limiter, settings, tick.geometry, widened, table.radius, movers, guidance.frontier,
        odometry.steering_angle, odometry.speed, period_of(tick.geometry),
    )  # fmt: skip
    steering = saturate(reference.steering_angle, driver.car.max_steering_angle)
    if memory.history.tried > 0:
        speed = min(speed, driver.recovery_settings.speed)
        log_step(memory.reasons, AFTER_RECOVERY, steering, speed)
    path, lane = path_ahead(guidance), reference.lane[: reference.lane_points]
    keeps = len(lane) > 0
    if keeps:
        path = lane.copy()
    in_sight = _in_sight(tick, widened, table)
    if keeps or not guidance.knows_speed:
        speed = min(speed, max(in_sight, settings.crawl_speed))
        log_step(memory.reasons, SIGHT, steering, speed)
    best = np.zeros(1, BEST)[0]
    if memory.predictions.cars == 0 and is_among(movers):
        if _plans_in_time(here, tick, speed, best):
            command[0], command[1] = _actuate(tick, PLAN_IN_TIME, best)
            return
        here = Situation(
            here.limiter, here.memory, settings, here.geometry, widened, here.radius, movers[:0], here.ground,
            here.angle, here.speed, here.period,
        )  # fmt: skip
        speed = 0.0
    motion = guidance.follows and not keeps
    judge(here, steering, speed, path, motion, stop_ahead(guidance), memory.passed_filter, best)
    memory.passed_filter = best.contact == 0.0 and best.why <= STOP
    if best.contact == 0.0 and best.why == REFERENCE and motion:
        keep_stop(guidance)
    if memory.predictions.cars > 0 and not memory.passed_filter:
        _leave_out_cars(here, steering, path, keeps, best)
    if driver.recovery and _recovers(here, tick, best):
        command[0], command[1] = _actuate(tick, RECOVERY, best)
        return
    if best.contact > 0.0:
        best.speed = 0.0 if here.speed > settings.crawl_speed or len(movers) > 0 else min(speed, in_sight)
        if motion:
            best.steering_angle, best.use = reference.steering_angle, 1.0
    command[0], command[1] = _actuate(tick, SAFETY_FILTER, best)


@kernel
def _actuate(tick: Record, why: int, best: Record) -> tuple[float, float]:
    """Return the command of the best proposal."""
    log_step(tick.memory.reasons, why, best.steering_angle, best.speed)
    return apply_limits(
        tick.geometry, tick.odometry, tick.driver, tick.memory, best.steering_angle, best.speed, best.use
    )


@kernel
def _leave_out_cars(here: Situation, steering_angle: float, path: FloatArray, keeps: bool, best: Record) -> None:
    """Brake on the way of the reference where only another car is in it, and corner as far as walls make it."""
    alone = Situation(
        here.limiter, here.memory, here.settings, here.geometry, here.widened, here.radius, here.movers[:0],
        here.ground, here.angle, here.speed, here.period,
    )  # fmt: skip
    margin = here.settings.margin_kept * (here.settings.margin if len(path) == 0 else here.settings.margin_aside)
    plan = along(here, path, 0.0, margin) if len(path) > 0 else towards(here, steering_angle, 0.0, margin)
    found = np.zeros(1, BEST)[0]
    found.contact = math.inf
    if consider(alone, STOP, steering_angle, plan, _BRAKES_FIRST, found) or consider(
        alone, STOP, steering_angle, plan, _USES, found
    ):
        best.why, best.steering_angle, best.speed, best.use = STOP, steering_angle, 0.0, 1.0 if keeps else found.use
        best.contact = 0.0


@kernel
def _recovers(here: Situation, tick: Record, best: Record) -> bool:
    """Write how the car reverses along its path, if it does."""
    driver, memory = tick.driver, tick.memory
    stands = abs(here.speed) < here.settings.standing_speed
    leads_on = best.contact == 0.0 and not memory.guidance.stuck
    waits = memory.predictions.count > 0 or not memory.guidance.frontier.found
    if not reverses(memory.history, driver.recovery_settings, stands, leads_on, waits, here.period):
        return False
    angle = angle_along_history(memory.history, driver.car.wheelbase)
    best.steering_angle, best.speed = (
        saturate(angle, driver.car.max_steering_angle),
        -driver.recovery_settings.speed,
    )
    return True


@kernel
def _plans_in_time(here: Situation, tick: Record, speed: float, best: Record) -> bool:
    """Write what the plan in time drives, or how it backs off; return whether it does either."""
    driver, memory, reference, car = tick.driver, tick.memory, tick.reference, tick.driver.car
    history, seen, now = memory.history, memory.predictions.targets, here.speed
    angle = memory.velocity_frame.angle if driver.limiter.slip.needs_slip_angle else 0.0
    may_back_off = driver.recovery and abs(now) < 1.2 and now < 0.3 and history.known > 0
    onwards = max(speed, min(_ONWARDS, driver.max_speed))
    pose = (float(seen.x), float(seen.y), float(seen.heading + angle))
    what, planned, planned_speed = plan_in_time(
        here.limiter, here.memory, here.settings, memory.plan, pose, here.widened, here.geometry.angle_min,
        here.geometry.angle_increment, reference.bearing, reference.distance, onwards, here.angle, now, here.period,
        here.movers, here.radius, here.ground, may_back_off,
    )  # fmt: skip
    memory.passed_filter = False
    best.use = 1.0
    if what == BACKS_OFF:
        history.stood = 0.0
        back = saturate(angle_along_history(history, car.wheelbase), car.max_steering_angle)
        best.steering_angle, best.speed = back, -BACKING_SPEED
    elif what == DRIVES:
        history.back = 0.0  # an attempt to reverse is over
        best.steering_angle, best.speed = planned, planned_speed
    return bool(what == BACKS_OFF or what == DRIVES)


JUDGE_STAGE = Stage(
    text="of all proposals, drives the first after which the car can stop", needs=("sight", "limiter"),
    needs_friction=True, drive=drive_judged,
)  # fmt: skip
