"""From a reference command to a safe one: guidance, speed laws, safety filter, recovery, friction limiter.

A planner gives a reference: a steering angle, a greatest speed, and the bearing it looks towards. What happens then is
the same for all planners:

1. The law of the mean range towards the goal lowers the speed (speed).
2. Guidance replaces a reference that leads into a pocket, or back, by one that leads on (guidance). While it turns the
   car in several moves, only 6 applies.
3. The speed is lowered by the distance straight ahead (speed), and to one from which the car stops within what it sees
   (braking_trajectories), unless a motion through the local map says how fast the car may go.
4. The safety filter replaces a reference after which the car could not stop by one after which it can (safety_filter).
5. A car that stands without a frontier reverses along its path (recovery).
6. The friction limiter turns the result into a command that the tires can follow (friction_limiter).

Optional stages (stages) may change the reference before 2, or decide in place of 3 to 6.

The settings `speed_law`, `guidance`, `safety_filter` and `recovery` choose which of these apply. A planner that assumes
no friction limit, mu = inf, has only the laws of the mean range and of the distance straight ahead.
"""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass, fields
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.errors import SettingsError
from fg_mujoco.messages import ODOMETRY, CarParameters, FloatArray, require

from ..perception.scan_filters import widen_all
from ..perception.scan_geometry import SCAN, beams_between, period_of
from ..safety.braking_trajectories import safe_speed
from ..safety.friction_limiter import LIMITER, LIMITER_MEMORY, FrictionLimiter, held_on_circle, limited
from ..safety.guidance import GUIDANCE, GuidanceSettings, guide, path_ahead
from ..safety.predictions import MOST_LATE, PREDICTIONS, foresee, turned
from ..safety.recovery import PATH_HISTORY, RecoverySettings, angle_along_history, extend_history, reverses
from ..safety.safety_filter import SafetyFilterSettings, least_cornering, passing_steering, safe_steering
from .planner_settings import (
    CAR,
    FROM_ZERO,
    POSITIVE,
    Accepted,
    Record,
    Settings,
    for_car,
    record_type,
    record_values,
    setting,
    setting_of_car,
)
from .reasons import (
    AFTER_RECOVERY,
    AHEAD,
    GRIP,
    LAST_PLAN,
    LOCK,
    MAXIMUM,
    MEAN_RANGE,
    MOVES,
    NO_PLAN,
    NO_REFERENCE,
    PLANNER,
    REASONS,
    RECOVERY,
    SAFETY_FILTER,
    SIGHT,
    TRANSIENTS,
    forget_reasons,
    note,
)
from .reasons import (
    GUIDANCE as GUIDED,
)
from .reasons import (
    SPEEDOMETER as BY_SPEEDOMETER,
)
from .slip import COURSE, held_arc, see_from_course, steered
from .speed import forward_distance_speed, range_ratio_speed
from .speedometer import LEFT_ALONE, SPEEDOMETER, command_speed, read_speedometer
from .steering import pursue, saturate

_ONWARDS = 3.0  # [m/s] with which the car may go on past a target where its reference is slower
_AHEAD = math.radians(2.0)  # to either side: beams that count as straight ahead

SpeedLaw = Literal["minimum", "forward_distance", "range_ratio", "friction", "stopping"]


@dataclass(frozen=True, kw_only=True)
class DrivingSettings(Settings):
    """Parameters that every planner has, with its own defaults: how it drives to a goal.

    Raises:
      SettingsError: an unknown law; a length or gain that is not a positive number; an angle or distance below 0; a
        full-speed distance that is not above the safe one.
    """


    speed_law: SpeedLaw = setting("minimum", text="which speed laws apply")  # noqa: RUF009
    safety_filter: bool = setting(
        True, text="with speed_law minimum: a reference after which the car could not stop is replaced"
    )
    recovery: bool = setting(
        True, text="with safety_filter: a car that stands without a frontier reverses and tries again"
    )
    guidance: bool = setting(
        True,
        text="with speed_law minimum: the way back is closed, and the car is led round where the planner turns back",
    )
    prediction: bool = setting(
        True, text="with safety_filter: what moves is tracked, and the car keeps out of where it may be"
    )
    remember: bool = setting(
        False, text="with guidance: from the second lap on the car follows a line through the ground of the first"
    )
    learn: bool = setting(False, text="the planner is not told the friction: it starts at 0.4 and learns it")
    safe_distance: float = setting_of_car(
        0.2, "m", "forward_distance: nearer ahead of the LiDAR than this, the car stops", FROM_ZERO
    )
    full_speed_distance: float = setting(
        1.5, "m", "forward_distance: full speed beyond it. Where this law is the only one, 5 m are safe at 8 m/s"
    )
    lookahead: float = setting(10.0, "m", "range_ratio: what lies beyond counts as no farther", POSITIVE)
    range_ratio_gain: float = setting(3.0, "", "range_ratio: full speed at a mean range of lookahead / gain", POSITIVE)
    front_width: float = setting(
        math.radians(20.0), "rad", "range_ratio: around the goal, for the mean range", FROM_ZERO
    )
    pursuit_distance: float = setting_of_car(
        1.0, "m", "the arc leads through the point this far along the goal's direction", POSITIVE
    )
    pursuit_time: float = setting(0.0, "s", "the same point is at least the way of this time ahead", FROM_ZERO)

    def __post_init__(self) -> None:
        super().__post_init__()
        safe = 0.0 if self.safe_distance is None else self.safe_distance
        longer = Accepted(f"a number above safe_distance, {safe}", lambda value: safe < value < math.inf)
        require(self, longer.holds, longer.text, ("full_speed_distance",), SettingsError)


DRIVER = np.dtype(
    [
        ("car", CAR),
        ("max_speed", np.float64),  # [m/s]
        ("forward_distance", np.bool_),  # which of the speed laws apply
        ("range_ratio", np.bool_),
        ("friction", np.bool_),
        ("stopping", np.bool_),
        ("safety_filter", np.bool_),
        ("recovery", np.bool_),
        ("guidance", np.bool_),
        ("prediction", np.bool_),
        ("late", np.int64),  # ticks by which scans are older than the odometry
        ("settings", record_type(DrivingSettings)),
        ("limiter", LIMITER),
        ("filter_settings", record_type(SafetyFilterSettings)),
        ("recovery_settings", record_type(RecoverySettings)),
        ("guidance_settings", record_type(GuidanceSettings)),
        ("trajectories", np.int64),  # which table of braking trajectories is its own: the first,
        ("stops", np.int64),  # and how many tables behind it is that of its friction now
        ("line_first", np.int64),  # which points of the lines through the map are its own: the first,
        ("line_end", np.int64),  # and the one behind the last
    ]
)
"""Type of what the kernels here read of a planner."""

DRIVING_MEMORY = np.dtype(
    [
        ("limiter", LIMITER_MEMORY),
        ("history", PATH_HISTORY),
        ("guidance", GUIDANCE),
        ("speedometer", SPEEDOMETER),
        ("course", COURSE),
        ("predictions", PREDICTIONS),
        ("kept", np.bool_),  # whether the reference passed the safety filter
        ("reasons", *REASONS),  # of the last decision; written, and never read
    ]
)
"""Type of what they keep of its car from tick to tick; zero at the beginning."""

MOST_LANE = 20
"""Greatest number of places of a lane beside another car."""

REFERENCE = np.dtype(
    [
        ("steering_angle", np.float64),  # [rad]; NaN: there is no reference, and the car brakes
        ("speed", np.float64),  # [m/s] greatest
        ("bearing", np.float64),  # [rad] of the goal; NaN: there is none
        ("distance", np.float64),  # [m] of the goal from the LiDAR; of one on a line, from the rear axle
        ("point", np.int64),  # of the planner's line through the map, which is nearest to the rear axle
        ("off_line", np.float64),  # [m] of the rear axle from there
        ("own_speed", np.float64),  # [m/s] before any speed law
        ("plan", np.int64),  # of the tracker mpc, by which it is: 0 this tick's, 1 the last one, 2 none: the car brakes
        ("limit", np.float64),  # [m/s] greatest, whatever guidance makes of the rest; inf: none
        ("lane", np.float64, (MOST_LANE, 4)),  # motion beside another car, which guidance leaves, as in `tracking`
        ("places", np.int64),  # of the lane; 0: there is none
    ]
)
"""Type of the reference of a planner for one scan."""


def driver_record(
    car: CarParameters, max_speed: float, limiter: FrictionLimiter | None, settings: DrivingSettings, late: int = 0
) -> NDArray[np.void]:
    """Return a row of type DRIVER, shape (1,).

    Args:
      car: that is driven.
      max_speed: fastest that it may command [m/s].
      limiter: None: of a planner that assumes no friction limit.
      settings: of the planner.
      late: ticks by which scans are older than the odometry; too many, and nothing is predicted.
    """
    law = settings.speed_law
    row = np.zeros(1, DRIVER)
    row["filter_settings"] = record_values(for_car(SafetyFilterSettings(), car))
    row["guidance_settings"] = record_values(for_car(GuidanceSettings(), car))
    row["recovery_settings"] = record_values(for_car(RecoverySettings(), car))
    driving = {field.name: getattr(settings, field.name) for field in fields(DrivingSettings)}
    row["settings"] = record_values(for_car(DrivingSettings(**driving), car))
    row["car"], row["max_speed"], row["late"] = astuple(car), max_speed, late
    for name in ("forward_distance", "range_ratio"):
        row[name] = law in (name, "minimum")
    if limiter is not None:
        row["friction"], row["stopping"] = law in ("friction", "minimum"), law in ("stopping", "minimum")
        row["safety_filter"] = settings.safety_filter and law == "minimum"
        row["recovery"] = settings.recovery and row["safety_filter"]
        row["guidance"] = settings.guidance and law == "minimum"
        row["prediction"] = settings.prediction and row["safety_filter"] and late < MOST_LATE
        row["limiter"] = limiter.record
    return row


DRIVEN = np.dtype(
    [
        ("driver", DRIVER),
        ("scan", SCAN),  # this tick's scan and odometry; from guidance on, of tires that need slip angles, as seen
        ("odometry", ODOMETRY),  # from the course, see slip
        ("reference", REFERENCE),
        ("memory", DRIVING_MEMORY),
        ("decided", np.bool_),  # there is a command for this tick
    ]
)
"""Type of all that the stages read and keep of one world."""


@kernel
def refer_to_goal(
    scan: Record,
    filtered: FloatArray,
    odometry: Record,
    driver: Record,
    bearing: float,
    distance: float,
    reference: Record,
) -> None:
    """Write the reference that leads along an arc to a goal.

    Args:
      scan: of type SCAN.
      filtered: readings as the planner left them (n,) [m], for the mean range towards the goal.
      odometry: of type ODOMETRY.
      driver: of type DRIVER.
      bearing: of the goal [rad]; NaN: there is none.
      distance: of the goal from the LiDAR [m].
      reference: of type REFERENCE, written to.
    """
    settings, car = driver.settings, driver.car
    reach = min(distance, max(settings.pursuit_distance, settings.pursuit_time * odometry.speed))
    steering_angle = pursue(bearing, reach, car.lidar_offset, car.wheelbase)
    refer(scan, filtered, driver, steering_angle, driver.max_speed, bearing, distance, reference)


@kernel
def refer(
    scan: Record,
    filtered: FloatArray,
    driver: Record,
    steering_angle: float,
    speed: float,
    bearing: float,
    distance: float,
    reference: Record,
) -> None:
    """Write a reference, no faster than by the law of the mean range; arguments as in `refer_to_goal` and REFERENCE."""
    reference.steering_angle, reference.bearing, reference.distance = steering_angle, bearing, distance
    reference.speed = reference.own_speed = min(speed, driver.max_speed)
    reference.limit, reference.places, reference.plan = math.inf, 0, 0
    if math.isnan(bearing):
        reference.steering_angle = math.nan
    elif driver.range_ratio:
        settings = driver.settings
        goal = round((bearing - scan.angle_min) / scan.angle_increment)
        half = round(0.5 * settings.front_width / scan.angle_increment)
        front = filtered[max(goal - half, 0) : max(goal + half + 1, 0)]
        by_mean = range_ratio_speed(front, settings.lookahead, settings.range_ratio_gain, driver.max_speed)
        reference.speed = min(reference.speed, by_mean)


@kernel
def predict(
    scan: Record,
    valid: FloatArray,
    guiding: FloatArray,
    clear: FloatArray,
    driven: Record,
    lines: FloatArray,
    trajectories: NDArray[np.void],
    own: Record,
    command: FloatArray,
) -> None:
    """Track what moves, and draw it into the scan where it may be; arguments as in stages."""
    foresee(scan, valid, clear, driven.odometry, driven.driver, driven.memory.predictions)


@kernel
def guide_reference(
    scan: Record,
    valid: FloatArray,
    guiding: FloatArray,
    clear: FloatArray,
    driven: Record,
    lines: FloatArray,
    trajectories: NDArray[np.void],
    own: Record,
    command: FloatArray,
) -> None:
    """Replace a reference that does not lead on, and decide while the car turns in moves; arguments as in stages."""
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
    if driver.range_ratio:
        note(reasons, MEAN_RANGE, reference.steering_angle, reference.speed)
    if driver.friction:
        read_speedometer(memory.speedometer, odometry.speed, driver.car, period_of(scan))
    if not driver.guidance:
        return
    turning = memory.guidance.turning
    if memory.predictions.count > 0:
        turning.slow = 0  # what is in the way moves on
    own_reference = (reference.steering_angle, reference.speed, reference.bearing, reference.distance)
    guide(scan, guiding, odometry, driver.limiter, driver.guidance_settings, memory.guidance, reference)
    if reference.places > 0:
        reference.steering_angle, reference.speed, reference.bearing, reference.distance = own_reference
    note(reasons, GUIDED, reference.steering_angle, reference.speed)
    if turning.active and reference.places == 0:
        note(reasons, MOVES, turning.steering_angle, turning.speed)
        extend_path(scan, odometry, driver, memory)
        least = driver.limiter.settings.least_lateral_use
        command[0], command[1] = _hold(scan, odometry, driver, memory, turning.steering_angle, turning.speed, least)
        driven.decided = True


@kernel
def drive(
    scan: Record,
    valid: FloatArray,
    guiding: FloatArray,
    clear: FloatArray,
    driven: Record,
    lines: FloatArray,
    trajectories: NDArray[np.void],
    own: Record,
    command: FloatArray,
) -> None:
    """Write the command for a reference, unless another stage has; arguments as in stages.

    Without a reference, and without odometry, the car brakes.
    """
    if not driven.decided:
        command[0], command[1] = _drive(driven.scan, valid, clear, driven.odometry, driven, trajectories)


@kernel
def _drive(
    scan: Record,
    valid: FloatArray,
    clear: FloatArray,
    odometry: Record,
    driven: Record,
    trajectories: NDArray[np.void],
) -> tuple[float, float]:
    """Return the command for a reference: steering angle [rad] and speed [m/s]; arguments as in stages."""
    driver, reference, memory = driven.driver, driven.reference, driven.memory
    reasons, slip, course = memory.reasons, driver.limiter.slip, memory.course
    if math.isnan(reference.steering_angle) or not math.isfinite(odometry.speed + odometry.steering_angle):
        return _brake(scan, odometry, driver, memory)
    speed = min(reference.speed, reference.limit)
    if driver.forward_distance:
        speed = min(speed, _speed_by_what_is_ahead(scan, valid, driver))
        note(reasons, AHEAD, reference.steering_angle, speed)
    if driver.stopping:
        table = trajectories[driver.trajectories + driver.stops]
        predictions = turned(memory.predictions, course.angle if slip.soft else 0.0)
        surroundings = clear if len(predictions) > 0 else valid
        widened = widen_all(surroundings, scan.angle_increment, table.radius)
        extend_path(scan, odometry, driver, memory)
        # A stop from v on friction mu is one from v sqrt(r) on r mu, but for what the car drives until it reacts: less
        # from a slower speed, and so the stops are those of as much friction or more.
        faster = math.sqrt(driver.limiter.lateral / table.lateral)
        in_sight = faster * safe_speed(
            table, widened, scan.angle_min, scan.angle_increment, odometry.speed / faster, odometry.steering_angle
        )
        if driver.safety_filter:
            return _drive_filtered(
                scan, widened, odometry, driver, memory, reference.steering_angle, speed, in_sight, predictions,
                table.radius, reference.lane[: reference.places],
            )  # fmt: skip
        speed = min(speed, in_sight)
        note(reasons, SIGHT, reference.steering_angle, speed)
    if not driver.friction:
        within = saturate(reference.steering_angle, driver.car.max_steering_angle)
        note(reasons, LOCK, within, speed)
        return within, speed
    least_use = driver.limiter.settings.least_lateral_use
    return _hold(scan, odometry, driver, memory, reference.steering_angle, speed, least_use)


@kernel
def _speed_by_what_is_ahead(scan: Record, valid: FloatArray, driver: Record) -> float:
    """Return the speed [m/s] by the law of the distance straight ahead; inf where the scan does not look ahead."""
    first, end = beams_between(scan, len(valid), -_AHEAD, _AHEAD)
    ahead = math.inf
    for beam in range(first, end):
        ahead = min(ahead, valid[beam])
    settings = driver.settings
    return forward_distance_speed(ahead, settings.safe_distance, settings.full_speed_distance, driver.max_speed)


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
) -> tuple[float, float]:
    """Return the command for a reference that passes the safety filter, or for the direction that the filter chooses.

    In another direction than the reference's the car brakes, but not below the crawl speed as long as a direction is
    free. Where none is free it brakes: on a motion that it follows it stays on that motion, else it takes the direction
    that the filter chooses. Where it stands and no direction is free it reverses, and tries again.

    Args:
      scan: of type SCAN.
      widened: readings (n,) [m], widened by the disc over the car's front.
      odometry: of type ODOMETRY.
      driver: of type DRIVER.
      memory: of type DRIVING_MEMORY, written to.
      steering_angle: of the reference [rad].
      speed: of the reference, by the speed laws [m/s].
      in_sight: from which the car stops within what it sees [m/s].
      predictions: of targets that move (k, 10), see safety.predictions.
      radius: of the disc over the car's front [m].
      lane: motion (m, 4) on which the car stays beside another one; m may be 0.
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
    safe, use, found = safe_steering(
        limiter, memory.limiter, settings, widened, scan.angle_min, scan.angle_increment, reference, reference_speed,
        angle, now, period, path, memory.kept, predictions, radius,
    )  # fmt: skip
    memory.kept = found and safe == reference
    among = memory.predictions.cars > 0
    if among and not memory.kept:
        without, use_without, _ = safe_steering(
            limiter, memory.limiter, settings, widened, scan.angle_min, scan.angle_increment, reference, 0.0,
            angle, now, period, path, True, predictions[:0], radius,
        )  # fmt: skip
        if without == reference:
            note(memory.reasons, SAFETY_FILTER, steering_angle, 0.0)
            if keeps:
                use_without = 1.0  # beside another car it has to follow the course
            else:
                use_without = least_cornering(
                    limiter, memory.limiter, settings, widened, scan.angle_min, scan.angle_increment, reference, angle,
                    now, period, path, use_without, predictions, radius,
                )  # fmt: skip
            return _hold(scan, odometry, driver, memory, steering_angle, 0.0, use_without)
    if len(predictions) > 0 and not memory.kept and not among:
        onwards = max(reference_speed, min(_ONWARDS, driver.max_speed))
        past, use_past, passes = passing_steering(
            limiter, memory.limiter, settings, widened, scan.angle_min, scan.angle_increment, reference,
            onwards, angle, now, period, path, predictions, radius,
        )  # fmt: skip
        if passes:
            note(memory.reasons, SAFETY_FILTER, past, onwards)
            return _hold(scan, odometry, driver, memory, past, onwards, use_past)
    stands = abs(now) < settings.standing_speed
    if driver.recovery and reverses(history, driver.recovery_settings, stands, found and not guidance.stuck, period):
        back = saturate(angle_along_history(history, car.wheelbase), car.max_steering_angle)
        note(memory.reasons, RECOVERY, back, -driver.recovery_settings.speed)
        return _hold(scan, odometry, driver, memory, back, -driver.recovery_settings.speed, use)
    if not found:
        speed = 0.0 if now > settings.crawl_speed or len(predictions) > 0 else min(speed, in_sight)
        if guidance.follows and not keeps:  # it is free, as far as its search could tell
            note(memory.reasons, SAFETY_FILTER, steering_angle, speed)
            return _hold(scan, odometry, driver, memory, steering_angle, speed, 1.0)
        note(memory.reasons, SAFETY_FILTER, safe, speed)
        return _hold(scan, odometry, driver, memory, safe, speed, use)
    if safe != reference:
        note(memory.reasons, SAFETY_FILTER, safe, min(speed, settings.crawl_speed))
        return _hold(scan, odometry, driver, memory, safe, min(speed, settings.crawl_speed), use)
    note(memory.reasons, SAFETY_FILTER, steering_angle, reference_speed)
    return _hold(scan, odometry, driver, memory, steering_angle, reference_speed, use)


@kernel
def _brake(scan: Record, odometry: Record, driver: Record, memory: Record) -> tuple[float, float]:
    """Return the command to stop as hard as the tires hold, on the car's present way; arguments as in `drive`.

    Without the friction law, and without odometry, that is 0 and 0.
    """
    extend_path(scan, odometry, driver, memory)
    note(memory.reasons, NO_REFERENCE, odometry.steering_angle if driver.friction else 0.0, 0.0)
    if not driver.friction:
        return 0.0, 0.0
    least, slip = driver.limiter.settings.least_lateral_use, driver.limiter.slip
    held = held_arc(slip, driver.car, odometry.steering_angle, memory.limiter.curvature)
    return _hold(scan, odometry, driver, memory, held, 0.0, least)


@kernel
def extend_path(scan: Record, odometry: Record, driver: Record, memory: Record) -> None:
    """Add the last tick to the path history, in every tick, whatever is commanded."""
    if driver.recovery:
        yaw_rate = odometry.angular_velocity[2]
        extend_history(memory.history, driver.recovery_settings, odometry.speed, yaw_rate, period_of(scan))


@kernel
def _hold(
    scan: Record,
    odometry: Record,
    driver: Record,
    memory: Record,
    steering_angle: float,
    speed: float,
    least_use: float,
) -> tuple[float, float]:
    """Return the command nearest to a reference that the friction limiter allows."""
    return hold_by(driver.limiter, scan, odometry, driver, memory, steering_angle, speed, least_use, LEFT_ALONE)


@kernel
def hold_by(
    limiter: Record,
    scan: Record,
    odometry: Record,
    driver: Record,
    memory: Record,
    steering_angle: float,
    speed: float,
    least_use: float,
    left_alone: float,
) -> tuple[float, float]:
    """Return the command nearest to a reference that a friction limiter allows; `left_alone` as of `command_speed`."""
    angle, now = odometry.steering_angle, odometry.speed
    period, reasons = period_of(scan), memory.reasons
    note(reasons, LOCK, saturate(steering_angle, driver.car.max_steering_angle), speed)
    target, allowed = held_on_circle(limiter, steering_angle, speed, abs(now), least_use)
    note(reasons, GRIP, target, allowed)
    steering, speed = limited(limiter, memory.limiter, steering_angle, speed, least_use, angle, now, period, False)
    note(reasons, TRANSIENTS, steering, speed)
    if limiter.slip.soft:
        steering = steered(limiter.slip, driver.car, steering, now)
    command = command_speed(memory.speedometer, speed, driver.car, driver.max_speed, period, left_alone)
    note(reasons, BY_SPEEDOMETER, steering, command)
    return steering, command
