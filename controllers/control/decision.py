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
6. `safety_filter`: a reference after which the car could not stop is replaced by one after which it can.
7. `recovery`: a car that stands without a frontier reverses along its path.
8. `limiter`: the friction limiter turns the result into a command that the tires can follow (friction_limiter).

A planner that assumes no friction limit, mu = inf, has only the laws of the mean range and of the distance ahead.
"""

from __future__ import annotations

import math

from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.messages import FloatArray

from ..perception.scan_filters import widen_all
from ..perception.scan_geometry import beams_between, period_of
from ..safety.braking_trajectories import safe_speed
from ..safety.guidance import guide, keep_stop, path_ahead, stop_ahead
from ..safety.plan_in_time import BACKING_SPEED, BACKS_OFF, DRIVES, is_among, plan_in_time
from ..safety.predictions import X, Y, foresee, turned
from ..safety.recovery import angle_along_history, extend_history, reverses
from ..safety.safety_filter import least_cornering, safe_steering
from .holding import hold, read_speedometer
from .planner_settings import Record
from .reasons import (
    AFTER_RECOVERY,
    AHEAD,
    LAST_PLAN,
    LAW,
    LOCK,
    MAXIMUM,
    MEAN_RANGE,
    MOVES,
    NO_PLAN,
    NO_REFERENCE,
    PLAN_IN_TIME,
    PLANNER,
    RECOVERY,
    SAFETY_FILTER,
    SIGHT,
    forget_reasons,
    note,
)
from .reasons import GUIDANCE as GUIDED
from .slip import held_arc, late_on_path, see_from_course
from .speed import distance_ahead_speed, friction_speed
from .stages import Stage
from .steering import late_by, saturate
from .tracking import steer_along

_ONWARDS = 3.0  # [m/s] with which the car may go on among targets where its reference is slower
_NO_MOVES = 2.0  # [m] from a target the car does not turn in moves
_BRAKES_FIRST = 0.25  # share of the grip for cornering with which a car brakes harder than with the limiter's own
_BESIDE = 0.06  # [rad] of steering from the reference, within which a direction is driven as fast as the reference
_AHEAD = math.radians(2.0)  # to either side: beams that count as straight ahead


@kernel
def predict(  # type: ignore[no-untyped-def]
    scan, valid, guiding, clear, driven, lines, trajectories, own, command
):
    """Track what moves, and take it out of the scan; arguments as in stages."""
    foresee(scan, valid, clear, driven.odometry, driven.driver, driven.memory.predictions)


@kernel
def begin(  # type: ignore[no-untyped-def]
    scan, valid, guiding, clear, driven, lines, trajectories, own, command
):
    """Begin a decision: its reasons, the car as seen from its course, and its speedometer; arguments as in stages."""
    driver, reference, memory, odometry = driven.driver, driven.reference, driven.memory, driven.odometry
    reasons, slip, course, scan = memory.reasons, driver.limiter.slip, memory.course, driven.scan
    forget_reasons(reasons)
    if slip.soft:
        memory.limiter.curvature = see_from_course(slip, driver.car, scan, odometry, course)
        driven.scan, driven.odometry = course.scan, course.odometry
        reference.bearing -= course.angle
    note(reasons, MAXIMUM, math.nan, driver.max_speed)
    note(reasons, PLANNER, reference.steering_angle, reference.own_speed)
    if reference.plan > 0:
        note(reasons, LAST_PLAN if reference.plan == 1 else NO_PLAN, reference.steering_angle, reference.own_speed)
    if driver.mean_range:
        note(reasons, MEAN_RANGE, reference.steering_angle, reference.speed)
    if driver.held:
        read_speedometer(memory.speedometer, odometry.speed, driver.car, period_of(scan))


@kernel
def guide_reference(  # type: ignore[no-untyped-def]
    scan, valid, guiding, clear, driven, lines, trajectories, own, command
):
    """Replace a reference that does not lead on, and decide while the car turns in moves; arguments as in stages."""
    driver, reference, memory, odometry = driven.driver, driven.reference, driven.memory, driven.odometry
    scan, turning = driven.scan, memory.guidance.turning
    if memory.predictions.count > 0:
        turning.slow = 0  # what is in the way moves on
        for row in memory.predictions.rows[: memory.predictions.count]:
            if math.hypot(row[X], row[Y]) < _NO_MOVES:
                turning.active = False
    own_reference = (reference.steering_angle, reference.speed, reference.bearing, reference.distance)
    guide(scan, guiding, odometry, driver.limiter, driver.guidance_settings, memory.guidance, reference)
    if reference.places > 0:
        reference.steering_angle, reference.speed, reference.bearing, reference.distance = own_reference
    note(memory.reasons, GUIDED, reference.steering_angle, reference.speed)
    if turning.active and reference.places == 0:
        note(memory.reasons, MOVES, turning.steering_angle, turning.speed)
        extend_path(scan, odometry, driver, memory)
        least = driver.limiter.settings.least_lateral_use
        command[0], command[1] = hold(scan, odometry, driver, memory, turning.steering_angle, turning.speed, least)
        driven.decided = True


@kernel
def drive(  # type: ignore[no-untyped-def]
    scan, valid, guiding, clear, driven, lines, trajectories, own, command
):
    """Write the reference as the command, as far as the wheels can be turned; arguments as in stages."""
    if driven.decided:
        return
    if _sees_no_way(driven):
        _stand(driven, command)
    else:
        _steer(driven, _by_laws(valid, driven), command)


@kernel
def drive_held(  # type: ignore[no-untyped-def]
    scan, valid, guiding, clear, driven, lines, trajectories, own, command
):
    """Write the command nearest to the reference that the friction limiter allows; arguments as in stages."""
    if not _is_decided(driven, command):
        _follow(driven, _by_laws(valid, driven), command)


@kernel
def drive_in_sight(  # type: ignore[no-untyped-def]
    scan, valid, guiding, clear, driven, lines, trajectories, own, command
):
    """Write the command of a car that can stop within what it sees; arguments as in stages."""
    if _is_decided(driven, command):
        return
    reference, table = driven.reference, trajectories[driven.driver.trajectories + driven.driver.stops]
    widened = widen_all(valid, driven.scan.angle_increment, table.radius)
    speed = min(_by_laws(valid, driven), _in_sight(driven, widened, table))
    note(driven.memory.reasons, SIGHT, reference.steering_angle, speed)
    _follow(driven, speed, command)


@kernel
def drive_filtered(  # type: ignore[no-untyped-def]
    scan, valid, guiding, clear, driven, lines, trajectories, own, command
):
    """Write the command for a reference that passes the safety filter, or for one that does; arguments as in stages."""
    if _is_decided(driven, command):
        return
    scan, odometry, reference, driver, memory = (
        driven.scan, driven.odometry, driven.reference, driven.driver, driven.memory
    )  # fmt: skip
    speed = _by_laws(valid, driven)
    table = trajectories[driver.trajectories + driver.stops]
    predictions = turned(memory.predictions, memory.course.angle if driver.limiter.slip.soft else 0.0)
    surroundings = clear if len(predictions) > 0 else valid
    widened = widen_all(surroundings, scan.angle_increment, table.radius)
    extend_path(scan, odometry, driver, memory)
    command[0], command[1] = _drive_filtered(
        scan, widened, odometry, driver, memory, reference.steering_angle, speed, _in_sight(driven, widened, table),
        predictions, table.radius, reference.lane[: reference.places], reference.bearing, reference.distance,
    )  # fmt: skip


@kernel
def _is_decided(driven: Record, command: FloatArray) -> bool:
    """Return whether there is a command: another stage has decided, or the car brakes, as there is no way."""
    if driven.decided:
        return True
    if not _sees_no_way(driven):
        return False
    if driven.driver.held:
        command[0], command[1] = _brake(driven.scan, driven.odometry, driven.driver, driven.memory)
    else:
        _stand(driven, command)
    return True


@kernel
def _follow(driven: Record, speed: float, command: FloatArray) -> None:
    """Write the command that follows the reference at a speed [m/s], as far as the car has a friction limiter."""
    driver = driven.driver
    if driver.held:
        steering_angle, least = driven.reference.steering_angle, driver.limiter.settings.least_lateral_use
        command[0], command[1] = hold(
            driven.scan, driven.odometry, driver, driven.memory, steering_angle, speed, least
        )  # fmt: skip
    else:
        _steer(driven, speed, command)


@kernel
def _steer(driven: Record, speed: float, command: FloatArray) -> None:
    """Write the reference's steering angle, as far as the wheels can be turned, and a speed [m/s] as the command."""
    command[0] = saturate(driven.reference.steering_angle, driven.driver.car.max_steering_angle)
    command[1] = speed
    note(driven.memory.reasons, LOCK, command[0], speed)


@kernel
def _stand(driven: Record, command: FloatArray) -> None:
    """Write the command of a car without a friction limiter that sees no way: it stops."""
    note(driven.memory.reasons, NO_REFERENCE, 0.0, 0.0)
    command[0] = command[1] = 0.0


@kernel
def _sees_no_way(driven: Record) -> bool:
    """Return whether there is no reference, or no odometry: the car brakes."""
    reference, odometry = driven.reference, driven.odometry
    return math.isnan(reference.steering_angle) or not math.isfinite(odometry.speed + odometry.steering_angle)


@kernel
def _in_sight(driven: Record, widened: FloatArray, table: Record) -> float:
    """Return the speed [m/s] from which the car stops within what it sees."""
    scan, odometry = driven.scan, driven.odometry
    # A stop from v on friction mu is one from v sqrt(r) on r mu, but for what the car drives until it reacts: less from
    # a slower speed, and so the stops are those of as much friction or more.
    faster = math.sqrt(driven.driver.limiter.lateral / table.lateral)
    speed: float = safe_speed(
        table, widened, scan.angle_min, scan.angle_increment, odometry.speed / faster, odometry.steering_angle
    )
    return faster * speed


@kernel
def _by_laws(valid: FloatArray, driven: Record) -> float:
    """Return the reference's speed [m/s] by the laws of the distance ahead and of friction, as far as they apply."""
    driver, reference, reasons = driven.driver, driven.reference, driven.memory.reasons
    speed: float = min(reference.speed, reference.limit)
    if driver.distance_ahead:
        speed = min(speed, _speed_by_what_is_ahead(driven.scan, valid, driver))
        note(reasons, AHEAD, reference.steering_angle, speed)
    if driver.friction_law:
        car = driver.car
        steering = saturate(reference.steering_angle, car.max_steering_angle)
        speed = min(speed, friction_speed(steering, driver.limiter.mu, car.wheelbase, car.gravity))
        note(reasons, LAW, steering, speed)
    return speed


@kernel
def _speed_by_what_is_ahead(scan: Record, valid: FloatArray, driver: Record) -> float:
    """Return the speed [m/s] by the law of the distance straight ahead; inf where the scan does not look ahead."""
    first, end = beams_between(scan, len(valid), -_AHEAD, _AHEAD)
    ahead = math.inf
    for beam in range(first, end):
        ahead = min(ahead, valid[beam])
    settings = driver.settings
    return distance_ahead_speed(ahead, settings.safe_distance, settings.full_speed_distance, driver.max_speed)


@kernel
def _drive_filtered(
    scan: Record,
    widened: FloatArray,
    odometry: Record,
    driver: Record,
    memory: Record,
    steering_angle: float,
    speed: float,
    in_sight: float,
    predictions: FloatArray,
    radius: float,
    lane: FloatArray,
    bearing: float,
    distance: float,
) -> tuple[float, float]:
    """Return the command for a reference that passes the safety filter, or for the direction that the filter chooses.

    On a motion that it follows the car brakes as long as it can stop there: a car that leaves the motion before a
    hairpin does not get round. A direction next to the reference's is driven as fast, if the car can stop there, too.
    In another one it brakes, but not below the crawl speed as long as a direction is free. Where none is free it
    brakes: on a motion that it follows it stays on that motion, else it takes the direction that the filter chooses.
    Before that, it brakes along the motion on which it could last stop, if it still can there. Where it stands and no
    direction is free it reverses, and tries again. Near what moves it drives by a plan in time.

    Args:
      scan: of type SCAN.
      widened: readings (n,) [m], widened by the disc over the car's front.
      odometry: of type ODOMETRY.
      driver: of type DRIVER.
      memory: of type DRIVING_MEMORY, written to.
      steering_angle: of the reference [rad].
      speed: of the reference, by the speed laws [m/s].
      in_sight: from which the car stops within what it sees [m/s].
      predictions: of targets that move (k, 12), see safety.predictions.
      radius: of the disc over the car's front [m].
      lane: motion (m, 4) on which the car stays beside another one; m may be 0.
      bearing: of the reference's goal [rad].
      distance: of that goal [m].
    """
    angle, now, car = odometry.steering_angle, odometry.speed, driver.car
    limiter, settings, history, period = driver.limiter, driver.filter_settings, memory.history, period_of(scan)
    reference = saturate(steering_angle, car.max_steering_angle)
    if history.tried > 0:
        speed = min(speed, driver.recovery_settings.speed)
        note(memory.reasons, AFTER_RECOVERY, steering_angle, speed)
    guidance = memory.guidance
    keeps = len(lane) > 0
    knows_speed, path = guidance.knows_speed and not keeps, path_ahead(guidance)
    if keeps:
        path = lane.copy()
    reference_speed = speed if knows_speed else min(speed, max(in_sight, settings.crawl_speed))
    if not knows_speed:
        note(memory.reasons, SIGHT, steering_angle, reference_speed)
    among = memory.predictions.cars > 0
    if not among and is_among(predictions):
        may_back_off = driver.recovery and abs(now) < 1.2 and now < 0.3 and history.known > 0
        seen, onwards = memory.predictions.targets, max(reference_speed, min(_ONWARDS, driver.max_speed))
        pose = (float(seen.x), float(seen.y), seen.heading + (memory.course.angle if limiter.slip.soft else 0.0))
        what, planned, planned_speed = plan_in_time(
            limiter, memory.limiter, settings, memory.plan, pose, widened, scan.angle_min, scan.angle_increment,
            bearing, distance, onwards, angle, now, period, predictions, radius, guidance.way, may_back_off,
        )  # fmt: skip
        memory.kept = False
        if what == BACKS_OFF:
            history.stood = 0.0
            back = saturate(angle_along_history(history, car.wheelbase), car.max_steering_angle)
            note(memory.reasons, PLAN_IN_TIME, back, -BACKING_SPEED)
            return hold(scan, odometry, driver, memory, back, -BACKING_SPEED, 1.0)
        if what == DRIVES:
            history.back = 0.0  # an attempt to reverse is over
            note(memory.reasons, PLAN_IN_TIME, planned, planned_speed)
            return hold(scan, odometry, driver, memory, planned, planned_speed, 1.0)
        predictions, reference_speed = predictions[:0], 0.0
    safe, use, found = safe_steering(
        limiter, memory.limiter, settings, widened, scan.angle_min, scan.angle_increment, reference, reference_speed,
        angle, now, period, path, memory.kept, predictions, radius, guidance.way,
    )  # fmt: skip
    memory.kept = found and safe == reference
    if memory.kept and guidance.follows and not keeps:
        keep_stop(guidance)
    if among and not memory.kept:
        without, use_without, _ = safe_steering(
            limiter, memory.limiter, settings, widened, scan.angle_min, scan.angle_increment, reference, 0.0,
            angle, now, period, path, True, predictions[:0], radius, guidance.way,
        )  # fmt: skip
        if without == reference:
            note(memory.reasons, SAFETY_FILTER, steering_angle, 0.0)
            if keeps:
                use_without = 1.0  # beside another car it has to follow the course
            else:
                least = least_cornering(
                    limiter, memory.limiter, settings, widened, scan.angle_min, scan.angle_increment, reference, angle,
                    now, period, path, settings.margin_aside, _BRAKES_FIRST, predictions, radius, guidance.way,
                )  # fmt: skip
                use_without = least if least >= 0.0 else use_without
            return hold(scan, odometry, driver, memory, steering_angle, 0.0, use_without)
    stands = abs(now) < settings.standing_speed
    leads_on, waits = found and not guidance.stuck, memory.predictions.count > 0 or not guidance.way.found
    if driver.recovery and reverses(history, driver.recovery_settings, stands, leads_on, waits, period):
        back = saturate(angle_along_history(history, car.wheelbase), car.max_steering_angle)
        note(memory.reasons, RECOVERY, back, -driver.recovery_settings.speed)
        return hold(scan, odometry, driver, memory, back, -driver.recovery_settings.speed, use)
    if not found:
        last = stop_ahead(guidance)
        if not stands and len(last) > 0 and len(predictions) == 0:
            for margin in (settings.margin_kept * settings.margin_aside, 0.0):
                use_last = least_cornering(
                    limiter, memory.limiter, settings, widened, scan.angle_min, scan.angle_increment, reference, angle,
                    now, period, last, margin, 1.0, predictions, radius, guidance.way,
                )  # fmt: skip
                if use_last >= 0.0:
                    late, path_late = late_by(car), late_on_path(limiter.slip, car, now)
                    on_last = steer_along(last, 0, 0.0, 0.0, 0.0, now, car.wheelbase, late, path_late)
                    note(memory.reasons, SAFETY_FILTER, on_last, 0.0)
                    return hold(scan, odometry, driver, memory, on_last, 0.0, use_last)
        speed = 0.0 if now > settings.crawl_speed or len(predictions) > 0 else min(speed, in_sight)
        if guidance.follows and not keeps:  # it is free, as far as its search could tell
            note(memory.reasons, SAFETY_FILTER, steering_angle, speed)
            return hold(scan, odometry, driver, memory, steering_angle, speed, 1.0)
        note(memory.reasons, SAFETY_FILTER, safe, speed)
        return hold(scan, odometry, driver, memory, safe, speed, use)
    if safe != reference and guidance.follows and not keeps and len(predictions) == 0:
        on_motion = least_cornering(
            limiter, memory.limiter, settings, widened, scan.angle_min, scan.angle_increment, reference, angle, now,
            period, path, settings.margin_aside, _BRAKES_FIRST, predictions, radius, guidance.way,
        )  # fmt: skip
        if on_motion >= 0.0:
            note(memory.reasons, SAFETY_FILTER, steering_angle, 0.0)
            return hold(scan, odometry, driver, memory, steering_angle, 0.0, on_motion)
    if 0.0 < abs(safe - reference) < _BESIDE and len(path) == 0 and len(predictions) == 0:
        beside, use_beside, _ = safe_steering(
            limiter, memory.limiter, settings, widened, scan.angle_min, scan.angle_increment, safe, reference_speed,
            angle, now, period, path, True, predictions, radius, guidance.way,
        )  # fmt: skip
        if beside == safe:
            note(memory.reasons, SAFETY_FILTER, safe, reference_speed)
            return hold(scan, odometry, driver, memory, safe, reference_speed, use_beside)
    if safe != reference:
        note(memory.reasons, SAFETY_FILTER, safe, min(speed, settings.crawl_speed))
        return hold(scan, odometry, driver, memory, safe, min(speed, settings.crawl_speed), use)
    note(memory.reasons, SAFETY_FILTER, steering_angle, reference_speed)
    return hold(scan, odometry, driver, memory, steering_angle, reference_speed, use)


@kernel
def _brake(scan: Record, odometry: Record, driver: Record, memory: Record) -> tuple[float, float]:
    """Return the command of the hardest stop that the tires hold on the present path; without odometry 0 and 0."""
    extend_path(scan, odometry, driver, memory)
    note(memory.reasons, NO_REFERENCE, odometry.steering_angle, 0.0)
    least, slip = driver.limiter.settings.least_lateral_use, driver.limiter.slip
    held = held_arc(slip, driver.car, odometry.steering_angle, memory.limiter.curvature)
    return hold(scan, odometry, driver, memory, held, 0.0, least)


@kernel
def extend_path(scan: Record, odometry: Record, driver: Record, memory: Record) -> None:
    """Add the motion of the last tick to the path history; to be called once in every tick."""
    if driver.recovery:
        yaw_rate = odometry.angular_velocity[2]
        extend_history(memory.history, driver.recovery_settings, odometry.speed, yaw_rate, period_of(scan))


MEAN_RANGE_STAGE = Stage(text="speed law: slower where the mean range towards the goal is short")
DISTANCE_AHEAD_STAGE = Stage(text="speed law: slower where the distance straight ahead is short")
FRICTION_LAW_STAGE = Stage(
    text="speed law: v = sqrt(g mu b / tan|d|) of the steering angle, and nothing besides", needs_friction=True
)
PREDICTION_STAGE = Stage(
    text="tracks what moves, and keeps out of where it may be", needs=("safety_filter",), needs_friction=True,
    before_reference=predict,
)  # fmt: skip
GUIDANCE_STAGE = Stage(
    text="closes the way back, and leads the car round where the planner turns back", needs=("limiter",),
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
