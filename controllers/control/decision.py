"""From a reference command to a safe one: speed laws, guidance, sight, safety filter, recovery, friction limiter.

A planner gives a reference: a steering angle, a greatest speed, and the bearing it looks towards. What happens then is
the same for all planners, as far as they have the stages (assist), each of which is named here:

1. `mean_range`: the law of the mean range towards the goal lowers the speed (speed).
2. `prediction`: what moves is tracked (predictions); near it 6 is a plan in time, or what keeps out of where it may be.
3. `guidance`: a reference that leads into a pocket, or back, is replaced by one that leads on. While guidance turns the
   car in several moves, only 8 applies.
4. `distance_ahead`, `friction_law`: the speed is lowered by the distance straight ahead, and to v = sqrt(g mu b /
   tan|d|) of the reference's steering angle (speed).
5. `sight`: the speed is lowered to one from which the car stops within what it sees (braking_trajectories), unless a
   motion through the local map says how fast the car may go.
6. `safety_filter`: of all that is proposed, the first after which the car can stop is driven (safety.judge).
7. `recovery`: a car that stands without a frontier reverses along its path.
8. `limiter`: the friction limiter turns the result into a command that the tires can follow (friction_limiter).

A planner that assumes no friction limit, mu = inf, has only the laws of the mean range and of the distance ahead.
"""

from __future__ import annotations

import math

import numpy as np

from fg_mujoco.compiled.kernels import inlined, kernel
from fg_mujoco.messages import FloatArray

from ..perception.frontiers import only_move
from ..perception.scan_filters import widen_all
from ..perception.scan_geometry import beams_between, period_of, sees
from ..safety.braking_trajectories import safe_speed
from ..safety.guidance import (
    MOTION_LEADS,
    NOBODY_LEADS,
    PLANNER_LEADS,
    TURN_LEADS,
    Seen,
    follow_frontier,
    keep_stop,
    path_ahead,
    stop_ahead,
)
from ..safety.judge import Wanted, judge, judge_own, take
from ..safety.line_following import on_line
from ..safety.plan_in_time import BACKING_SPEED, BACKS_OFF, DRIVES, is_among, plan_in_time
from ..safety.predictions import foresee, turned
from ..safety.recovery import angle_back, reverses
from ..safety.rollout import Situation, without_movers
from .actuation import apply_limits, apply_limits_of, read_speedometer
from .planner_settings import Record
from .reasons import (
    AFTER_RECOVERY,
    AHEAD,
    DECIDED,
    LAST_PLAN,
    LAW,
    LOCK,
    MAXIMUM,
    MEAN_RANGE,
    MOTION,
    MOVES,
    NO_JUDGE,
    NO_PLAN,
    NO_POINTS,
    NO_REFERENCE,
    NOT_FINITE,
    ON_LINE,
    PLAN_IN_TIME,
    PLANNER,
    RECOVERY,
    REFERENCE,
    REVERSES,
    SAFETY_FILTER,
    SIGHT,
    STOP,
    TOO_MANY,
    TOO_SHARP,
    forget_reasons,
    log_left_out,
    log_step,
)
from .reasons import GUIDANCE as GUIDED
from .slip import held_arc, to_velocity_frame
from .speed import distance_ahead_speed, friction_speed
from .stages import Stage, Tick
from .steering import saturate
from .tracking import CURVATURE

_ONWARDS = 3.0  # [m/s] with which the car may go on among targets where its reference is slower
_MOST_OWN = 8  # motions of stages of the user's that are simulated in a tick
_COLUMNS = CURVATURE + 1  # of a motion
_AHEAD = math.radians(2.0)  # to either side: beams that count as straight ahead


@kernel
def predict(tick: Tick) -> None:
    """Track what moves, and take it out of the scan."""
    ranges, without_movers = tick.ranges, tick.ranges_without_movers
    foresee(tick.geometry, ranges, without_movers, tick.odometry, tick.driver, tick.memory.predictions)


@kernel
def begin(tick: Tick) -> None:
    """Begin a decision: its reasons, the velocity frame, and the speedometer."""
    driver, reference, memory, odometry = tick.driver, tick.reference, tick.memory, tick.odometry
    reasons, slip, frame, geometry = memory.reasons, driver.limiter.slip, memory.velocity_frame, tick.geometry
    forget_reasons(reasons, memory.judge.proposals)
    memory.judge.line.contact, memory.judge.own = math.inf, 0
    if slip.needs_slip_angle:
        command = memory.speedometer.command * (1.0 + memory.speedometer.error)
        command += frame.excess if command != 0.0 else 0.0
        memory.limiter.curvature = to_velocity_frame(slip, driver.car, geometry, odometry, command, frame)
        tick.record.geometry, tick.record.odometry = frame.geometry, frame.odometry
        reference.bearing -= frame.angle
    log_step(reasons, MAXIMUM, math.nan, driver.max_speed)
    log_step(reasons, PLANNER, reference.steering_angle, reference.own_speed)
    if reference.plan > 0:
        log_step(reasons, LAST_PLAN if reference.plan == 1 else NO_PLAN, reference.steering_angle, reference.own_speed)
    if driver.mean_range:
        log_step(reasons, MEAN_RANGE, reference.steering_angle, reference.speed)
    if driver.has_limiter:
        read_speedometer(memory.speedometer, tick.odometry.speed, driver.car, period_of(geometry))
    if driver.recovery and not driver.guidance and sees(geometry, tick.ranges):  # guidance keeps the path itself
        only_move(geometry, tick.ranges, odometry, memory.guidance.frontier)


@kernel
def guide_reference(tick: Tick) -> None:
    """Replace a reference that does not lead on, and decide while the car turns in moves."""
    driver, reference, memory, odometry = tick.driver, tick.reference, tick.memory, tick.odometry
    geometry, turning = tick.geometry, memory.guidance.turning
    if memory.predictions.count > 0:
        turning.slow = 0.0  # what is in the way moves on
    ranges, settings = tick.ranges_without_cars, driver.guidance_settings
    if memory.judge.best.why == ON_LINE and memory.predictions.count == 0:
        only_move(geometry, ranges, odometry, memory.guidance.frontier)
        memory.lead, memory.knows_speed, memory.guidance.follows = PLANNER_LEADS, False, False
        return
    lead = follow_frontier(Seen(geometry, ranges, odometry, driver.limiter, settings, reference), memory.guidance)
    memory.lead, memory.knows_speed = lead.who, lead.knows_speed
    on_lane = reference.lane_points > 0
    if lead.who == PLANNER_LEADS and not on_lane:
        reference.speed = min(reference.speed, lead.speed)
    elif lead.who != TURN_LEADS and not on_lane:
        reference.steering_angle, reference.speed = lead.steering_angle, lead.speed
        reference.bearing, reference.distance = lead.bearing, lead.distance
    log_step(memory.reasons, GUIDED, reference.steering_angle, reference.speed)
    if lead.who == TURN_LEADS and not on_lane:
        log_step(memory.reasons, MOVES, lead.steering_angle, lead.speed)
        least = driver.limiter.settings.least_lateral_use
        tick.command[0], tick.command[1] = apply_limits(tick.record, lead.steering_angle, lead.speed, least)
        tick.record.decided = True


@kernel
def drive(tick: Tick) -> None:
    """Write the reference as the command, as far as the wheels can be turned."""
    if tick.record.decided:
        return
    if _sees_no_way(tick):
        _stand(tick)
    else:
        _steer(tick, _by_laws(tick))


@kernel
def drive_held(tick: Tick) -> None:
    """Write the command nearest to the reference that the friction limiter allows."""
    if not _is_decided(tick):
        _follow(tick, _by_laws(tick))


@kernel
def drive_in_sight(tick: Tick) -> None:
    """Write the command of a car that can stop within what it sees."""
    if _is_decided(tick):
        return
    widened = widen_all(tick.ranges, tick.geometry.angle_increment, tick.trajectories.radius)
    speed = min(_by_laws(tick), _in_sight(tick, widened))
    log_step(tick.memory.reasons, SIGHT, tick.reference.steering_angle, speed)
    _follow(tick, speed)


@kernel
def drive_filtered(tick: Tick) -> None:
    """Write the command of the proposal that the judge takes, or of the plan in time."""
    if _is_decided(tick):
        return
    driver, memory, guidance, reference = tick.driver, tick.memory, tick.memory.guidance, tick.reference
    speed, steering = _by_laws(tick), saturate(reference.steering_angle, driver.car.max_steering_angle)
    here = look_round(tick, False)
    if memory.recovery.tried > 0:
        speed = min(speed, driver.recovery_settings.speed)
        log_step(memory.reasons, AFTER_RECOVERY, steering, speed)
    guided, path, in_sight = memory.lead == MOTION_LEADS, path_ahead(guidance), _in_sight(tick, here.widened)
    if reference.lane_points > 0:
        guided, path = False, reference.lane[: reference.lane_points].copy()
    if reference.lane_points > 0 or not memory.knows_speed:
        speed = min(speed, max(in_sight, here.settings.crawl_speed))
        log_step(memory.reasons, SIGHT, steering, speed)
    best, cars = memory.judge.best, memory.predictions.cars > 0
    if not cars and is_among(here.movers):
        if _plans_in_time(here, tick, speed, best):
            _actuate(tick, PLAN_IN_TIME, best)
            return
        here, speed = without_movers(here), 0.0
    wanted = Wanted(steering, speed, path, guided, stop_ahead(guidance), memory.judge.passed)
    judge(here, wanted, memory.judge)
    found = best.contact == 0.0
    if not found and memory.judge.line.contact < math.inf:
        take(best, memory.judge.line)
    memory.judge.passed = found and best.why <= STOP
    if found and best.why == REFERENCE and guided:
        keep_stop(guidance)
    if driver.recovery and _recovers(here, tick, found, best):
        _actuate(tick, RECOVERY, best)
        return
    elif not found and best.why != ON_LINE:
        slow = here.speed <= here.settings.crawl_speed and len(here.movers) == 0
        best.speed = min(speed, in_sight) if slow else 0.0
    if best.why in (REFERENCE, STOP, MOTION):
        best.steering_angle = reference.steering_angle  # beyond the lock, the limiter slows the car for it
    if best.why == ON_LINE:
        drive_line(tick, best)
    else:
        _actuate(tick, SAFETY_FILTER, best)


@kernel
def propose(tick: Tick, path: FloatArray, speed: float) -> bool:
    """Propose a motion to the judge in place of the planner's; return whether the car drives it: it can stop on it.

    A stage calls it at `after_guidance`. What no car can follow is left out, and so is more than eight in a tick;
    `reasons()` says so.

    Args:
      tick: of one world; its command is written to.
      path: motion (n, 4) in the frame of the rear axle, from where it is on: x, y [m], heading [rad], curvature [1/m].
      speed: that is commanded [m/s]; the friction limiter slows the car for bends.
    """
    memory, fault = tick.memory, _fault_in(tick, path, speed)
    if fault >= 0:
        log_left_out(memory.judge.proposals, fault)
        return False
    memory.judge.own += 1
    speed = min(speed, tick.reference.limit, tick.driver.max_speed)
    if not judge_own(look_round(tick, False), np.ascontiguousarray(path), speed, memory.judge):
        return False
    _actuate(tick, SAFETY_FILTER, memory.judge.best)
    tick.record.decided = True
    return True


@kernel
def _fault_in(tick: Tick, path: FloatArray, speed: float) -> int:
    """Return why a motion is left out, as in `reasons`; -1: it is not."""
    odometry, car = tick.odometry, tick.driver.car
    if not (tick.driver.safety_filter and sees(tick.geometry, tick.ranges)):
        return NO_JUDGE
    if not math.isfinite(odometry.speed + odometry.steering_angle):
        return NO_JUDGE
    if tick.record.decided:
        return DECIDED
    if tick.memory.judge.own >= _MOST_OWN:
        return TOO_MANY
    if path.shape[0] == 0 or path.shape[1] != _COLUMNS:
        return NO_POINTS
    if not math.isfinite(speed) or not np.isfinite(path).all():
        return NOT_FINITE
    if speed < 0.0:
        return REVERSES
    most = 1.001 * math.tan(car.max_steering_angle) / car.wheelbase
    return TOO_SHARP if np.abs(path[:, CURVATURE]).max() > most else -1


@inlined
def look_round(tick: Tick, known: bool) -> Situation:
    """Return the situation in which proposals are judged."""
    driver, memory, odometry, table = tick.driver, tick.memory, tick.odometry, tick.trajectories
    angle = memory.velocity_frame.angle if driver.limiter.slip.needs_slip_angle else 0.0
    movers = turned(memory.predictions, angle)
    ranges = tick.ranges_without_movers if len(movers) > 0 else tick.ranges
    widened = widen_all(ranges, tick.geometry.angle_increment, table.radius)
    return Situation(
        driver.limiter, memory.limiter, driver.judge_settings, tick.geometry, ranges, widened, float(table.radius),
        movers, memory.guidance.frontier, float(odometry.steering_angle), float(odometry.speed),
        period_of(tick.geometry), known,
    )  # fmt: skip


@kernel
def _actuate(tick: Tick, step: int, best: Record) -> None:
    """Write the command of the best proposal."""
    log_step(tick.memory.reasons, step, best.steering_angle, best.speed)
    tick.command[0], tick.command[1] = apply_limits(tick.record, best.steering_angle, best.speed, best.use)


@kernel
def drive_line(tick: Tick, best: Record) -> None:
    """Write the command on the remembered line, where the limiter turns the wheels faster."""
    limiter, settings = tick.driver.limiter, tick.driver.limiter.settings
    own = settings.turn_in_use, settings.lateral_use_in_braking
    settings.turn_in_use, settings.lateral_use_in_braking = on_line(limiter)
    tick.command[0], tick.command[1] = apply_limits_of(
        limiter, tick.record, best.steering_angle, best.speed, best.use, 0.0
    )
    settings.turn_in_use, settings.lateral_use_in_braking = own


@kernel
def _recovers(here: Situation, tick: Tick, found: bool, best: Record) -> bool:
    """Write how the car reverses along its path, if it does; `found`: there is a proposal that meets nothing."""
    driver, memory = tick.driver, tick.memory
    stands, waits = abs(here.speed) < here.settings.standing_speed, memory.predictions.count > 0
    waits |= not memory.guidance.frontier.found
    leads_on = found and memory.lead != NOBODY_LEADS
    settings, world = driver.recovery_settings, memory.guidance.frontier.map
    back, recovery = angle_back(world, settings, driver.car), memory.recovery
    if not reverses(recovery, settings, world, here.speed, stands, leads_on, waits, here.period) or math.isnan(back):
        recovery.back = 0.0
        return False
    best.steering_angle, best.speed = back, -settings.speed
    return True


@kernel
def _plans_in_time(here: Situation, tick: Tick, speed: float, best: Record) -> bool:
    """Write what the plan in time drives, or how it backs off; return whether it does either."""
    driver, memory, guidance, reference = tick.driver, tick.memory, tick.memory.guidance, tick.reference
    now = here.speed
    seen, back = memory.predictions.targets, angle_back(guidance.frontier.map, driver.recovery_settings, driver.car)
    heading = seen.heading + (memory.velocity_frame.angle if driver.limiter.slip.needs_slip_angle else 0.0)
    may_back_off = driver.recovery and abs(now) < 1.2 and now < 0.3 and not math.isnan(back)
    goal, onwards = (reference.bearing, reference.distance), max(speed, min(_ONWARDS, driver.max_speed))
    what, angle, planned = plan_in_time(
        here, memory.plan, (float(seen.x), float(seen.y), heading), goal, onwards, may_back_off
    )  # fmt: skip
    memory.judge.passed, best.use = False, 1.0
    if what == BACKS_OFF:
        memory.recovery.stood = 0.0
        best.steering_angle, best.speed = back, -BACKING_SPEED
    elif what == DRIVES:
        memory.recovery.back = 0.0  # an attempt to reverse is over
        best.steering_angle, best.speed = angle, planned
    return bool(what in (DRIVES, BACKS_OFF))


@kernel
def _is_decided(tick: Tick) -> bool:
    """Return whether there is a command: another stage has decided, or the car brakes, as there is no way."""
    if tick.record.decided:
        return True
    if not _sees_no_way(tick):
        return False
    if tick.driver.has_limiter:
        tick.command[0], tick.command[1] = _brake(tick.record)
    else:
        _stand(tick)
    return True


@kernel
def _follow(tick: Tick, speed: float) -> None:
    """Write the command that follows the reference at a speed [m/s], as far as the car has a friction limiter."""
    if tick.driver.has_limiter:
        steering_angle, least = tick.reference.steering_angle, tick.driver.limiter.settings.least_lateral_use
        tick.command[0], tick.command[1] = apply_limits(tick.record, steering_angle, speed, least)
    else:
        _steer(tick, speed)


@kernel
def _steer(tick: Tick, speed: float) -> None:
    """Write the reference's steering angle, as far as the wheels can be turned, and a speed [m/s] as the command."""
    tick.command[0] = saturate(tick.reference.steering_angle, tick.driver.car.max_steering_angle)
    tick.command[1] = speed
    log_step(tick.memory.reasons, LOCK, tick.command[0], speed)


@kernel
def _stand(tick: Tick) -> None:
    """Write the command of a car without a friction limiter that sees no way: it stops."""
    log_step(tick.memory.reasons, NO_REFERENCE, 0.0, 0.0)
    tick.command[0] = tick.command[1] = 0.0


@kernel
def _sees_no_way(tick: Tick) -> bool:
    """Return whether there is no reference, or no odometry: the car brakes."""
    reference, odometry = tick.reference, tick.odometry
    return math.isnan(reference.steering_angle) or not math.isfinite(odometry.speed + odometry.steering_angle)


@kernel
def _in_sight(tick: Tick, widened: FloatArray) -> float:
    """Return the speed [m/s] from which the car stops within what it sees."""
    first, increment, odometry = tick.geometry.angle_min, tick.geometry.angle_increment, tick.odometry
    speed: float = safe_speed(tick.trajectories, widened, first, increment, odometry.speed, odometry.steering_angle)
    return speed


@kernel
def _by_laws(tick: Tick) -> float:
    """Return the reference's speed [m/s] by the laws of the distance ahead and of friction, as far as they apply."""
    driver, reference, reasons = tick.driver, tick.reference, tick.memory.reasons
    speed: float = min(reference.speed, reference.limit)
    if driver.distance_ahead:
        speed = min(speed, _speed_by_what_is_ahead(tick.geometry, tick.ranges, driver))
        log_step(reasons, AHEAD, reference.steering_angle, speed)
    if driver.friction_law:
        car = driver.car
        steering = saturate(reference.steering_angle, car.max_steering_angle)
        speed = min(speed, friction_speed(steering, driver.limiter.mu, car.wheelbase, car.gravity))
        log_step(reasons, LAW, steering, speed)
    return speed


@kernel
def _speed_by_what_is_ahead(geometry: Record, ranges: FloatArray, driver: Record) -> float:
    """Return the speed [m/s] by the law of the distance straight ahead; inf where the scan does not look ahead."""
    first, end = beams_between(geometry, len(ranges), -_AHEAD, _AHEAD)
    ahead = math.inf
    for beam in range(first, end):
        ahead = min(ahead, ranges[beam])
    settings = driver.settings
    return distance_ahead_speed(ahead, settings.safe_distance, settings.full_speed_distance, driver.max_speed)


@kernel
def _brake(tick: Record) -> tuple[float, float]:
    """Return the command of the hardest stop that the tires hold on the present path; without odometry 0 and 0."""
    limiter, angle = tick.driver.limiter, tick.odometry.steering_angle
    log_step(tick.memory.reasons, NO_REFERENCE, angle, 0.0)
    held = held_arc(limiter.slip, tick.driver.car, angle, tick.memory.limiter.curvature)
    return apply_limits(tick, held, 0.0, limiter.settings.least_lateral_use)


MEAN_RANGE_STAGE = Stage(text="speed law: slower where the mean range towards the goal is short")
DISTANCE_AHEAD_STAGE = Stage(text="speed law: slower where the distance straight ahead is short")
FRICTION_LAW_STAGE = Stage(text="speed law: v = sqrt(g mu b / tan|d|) of the steering angle only", needs_friction=True)
PREDICTION_STAGE = Stage(
    text="tracks moving things, and avoids where they may be", needs=("safety_filter",), needs_friction=True,
    before_reference=predict,
)  # fmt: skip
GUIDANCE_STAGE = Stage(
    text="closes the way back; leads the car on if the planner would turn back", needs=("limiter",),
    needs_friction=True, guide=guide_reference,
)  # fmt: skip
SIGHT_STAGE = Stage(
    text="the car stops within what the scan shows", needs_friction=True, drive=drive_in_sight,
)  # fmt: skip
SAFETY_FILTER_STAGE = Stage(
    text="replaces a reference after which the car could not stop", needs=("sight", "limiter"), needs_friction=True,
    drive=drive_filtered,
)  # fmt: skip
RECOVERY_STAGE = Stage(
    text="a car that stands without a frontier reverses and tries again", needs=("safety_filter",), needs_friction=True
)
LIMITER_STAGE = Stage(
    text="the command is one that the tires can follow without sliding", needs_friction=True, drive=drive_held
)
