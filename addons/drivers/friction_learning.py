"""Friction learned while driving, from how much wheels slip that carry different loads.

An open differential gives all wheels the same torque, so each tire pulls with the same force F. The lighter axle slips
more for it. The speeds of the wheels say how much more, at any acceleration, long before a tire lets go:

    mean speed of the front wheels - that of the rear wheels, where they would roll
        = V (slip of the front tires - slip of the rear tires)
          + c1 V + c2 V (load moved to the front axle) + c3 (yaw rate) (steering angle)

The slip of a tire is read backwards off its curve at the share of the friction that its force uses. This is the slip
slope of Gustafsson (Automatica 33(6), 1997) and of Mueller, Uchanski and Hedrick (J. Dyn. Sys. Meas. Control 125,
2003), with the other axle in the place of the undriven wheels. c1 to c3 are unknown: wheels of unequal radius, tires
that are pressed flatter, a steering gain. c1 also takes up what the speeds have in common, such as a drift.

1. A bank of friction coefficients, 6 % apart. For each the sums of a least-squares fit of c1 to c3 are kept, with
   exponential forgetting. What a fit leaves is the likelihood of its friction, of which a mean and a standard deviation
   follow.
2. A bound. The friction that is used begins at `start`, whatever the planner is told. It is at most a standard
   deviation below the mean, and at most `step` above the force over load that a tire has held. It rises by at most
   `rise` a second, and falls at once.
3. A trip. Wheels that turn faster or slower than this friction explains are sliding. The used friction then falls to
   what the sliding tires hold, what was learned is forgotten, and what is learned then is held below a ceiling, which
   rises slowly.
4. Gain and offset of the steering, by least squares, from yaw rate over speed. They are corrected for where they are
   farther from 1 and 0 than the geometry of the car leaves in doubt.

Limits: the shape of the curve is that of the car's parameters, as identified on some floor, and only its scale is
learned. So stiffness and peak are taken to fall together on a slippery floor, as they do in this simulator; a real
tire's stiffness falls less, and then only 2 and 3 keep the car from sliding. Tires without such parameters are taken
to be those of the set `coulomb`. Tires whose slip does not depend on their load (`contact`), and cars without four
wheel speeds and an accelerometer, tell nothing: they are driven at `start`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.controllers.control.planner_settings import (
    FROM_ZERO,
    POSITIVE,
    SHARE,
    Record,
    Settings,
    record_type,
    record_values,
    setting,
)
from fg_mujoco.controllers.control.slip import slip_angle, slip_row
from fg_mujoco.controllers.control.stages import Stage
from fg_mujoco.controllers.control.steering import saturate
from fg_mujoco.controllers.perception.scan_geometry import period_of
from fg_mujoco.messages import CarParameters, FloatArray

if TYPE_CHECKING:
    from fg_mujoco.controllers.control.planner import Planner

_RATIO = 1.06  # of neighbours in the bank
_BELOW = 5  # of the bank lie below the start
_BANK = 30
_USED = 25  # of the bank may be used: more friction than that is no floor's
_POINTS = 64  # of the curves
_WIDEST = 2.0  # [-] use of the friction that the curves reach to: what is above 1 has not happened
_MOST_USE = 0.97  # [-] of an axle's peak, from which on its curve is continued steeply
_STEEPNESS = 20.0  # [-] of that, over the curve's mean slope up to there
_LEAST_LOAD = 0.05  # [-] of a tire over the car's weight: lighter ones are not asked
_UNKNOWNS = 3
_LINEAR = 0.6  # of the used friction, up to which understeer is taken to grow with the lateral acceleration
_MOST_GAIN = 0.4  # of a steering gain from 1: others are not believed
_MOST_OFFSET = 0.1  # [rad]


@dataclass(frozen=True, kw_only=True)
class FrictionLearningSettings(Settings):
    """How friction is learned, and how far it is trusted.

    Raises:
      SettingsError: a value that its field does not accept.
    """

    start: float = setting(0.4, "", "friction coefficient that is used before anything is known", POSITIVE)
    step: float = setting(0.5, "", "used at most this share above the force over load that a tire has held", POSITIVE)
    rise: float = setting(0.2, "1/s", "greatest rise of the used friction, as a share of it", POSITIVE)
    deviations: float = setting(1.0, "", "standard deviations below the mean", FROM_ZERO)
    least_deviation: float = setting(0.03, "", "of the mean: what the model itself is wrong by", FROM_ZERO)
    memory: float = setting(15.0, "s", "of driving, after which what was seen counts as 1 / e", POSITIVE)
    stiffness: float = setting(120.0, "1/rad", "of tires whose car says none: force over friction and load", POSITIVE)
    relaxation_length: float = setting(0.045, "m", "of tires whose car says none", FROM_ZERO)
    age: float = setting(0.0025, "s", "of the accelerometer's reading: half a physics step", FROM_ZERO)
    load_lag: float = setting(0.006, "s", "of what acceleration moves of the loads, behind it: the springs", FROM_ZERO)
    damping_ratio: float = setting(0.3, "", "of a wheel's spin on its tire: that of rubber and foam", FROM_ZERO)
    resolution: float = setting(3e-4, "m/s", "of wheel speeds: no fit is taken for better", POSITIVE)
    independent: float = setting(12.0, "", "readings in a row that say as much as one", POSITIVE)
    least_speed: float = setting(1.5, "m/s", "slower, nothing is learned", POSITIVE)
    most_steering: float = setting(0.3, "rad", "beyond it nothing is learned", POSITIVE)
    sliding: float = setting(0.02, "m/s", "of wheels that is not explained: the least that counts as sliding", POSITIVE)
    unexplained: float = setting(1.0, "", "added to it: this share of the greatest slip that is explained", POSITIVE)
    ticks: float = setting(2.0, "", "in a row, that wheels slide", POSITIVE)
    deviations_sliding: float = setting(8.0, "", "standard deviations of what is not explained, that do", POSITIVE)
    known: float = setting(2.0, "s", "of learning, before which only ten times `sliding` counts", FROM_ZERO)
    kept: float = setting(0.95, "", "share of the friction of sliding tires, used then", SHARE)
    least_kept: float = setting(0.7, "", "share of what was used, that is used then at least", SHARE)
    fall: float = setting(0.1, "1/s", "of the used friction while they slide on, or tell nothing", FROM_ZERO)
    pause: float = setting(1.0, "s", "after the tires slid, in which nothing is learned", FROM_ZERO)
    steering_deviation: float = setting(0.06, "", "of the steering gain from 1: less is left alone", FROM_ZERO)
    offset_deviation: float = setting(0.006, "rad", "of the steering, likewise", FROM_ZERO)
    steering_known: float = setting(5.0, "s", "of learning, before which the steering is left alone", FROM_ZERO)
    ceiling_rise: float = setting(0.003, "1/s", "of the ceiling after the tires slid, as a share of it", FROM_ZERO)


LEARNING = np.dtype(
    [
        ("settings", record_type(FrictionLearningSettings)),
        ("mus", np.float64, (_BANK,)),
        ("front_slip", np.float64, (_POINTS,)),  # [-] by the use of the friction, from 0 to _WIDEST
        ("rear_slip", np.float64, (_POINTS,)),
        ("compliance", np.float64),  # [-] mean slip of both axles by use, at none
        ("relaxation_length", np.float64),  # [m]
        ("damping_time", np.float64),  # [s] at friction 1: a tire's damping over its stiffness
    ]
)
"""Type of what `learn` reads of a planner."""

LEARNED = np.dtype(
    [
        ("begun", np.bool_),
        ("mu", np.float64),  # that is used
        ("level", np.int64),  # of the bank: the greatest that is not above it
        ("stops", np.int64),  # of the bank: the least that is not below it
        ("mean", np.float64),  # of the learned friction, and its standard deviation; 0: nothing is learned yet
        ("deviation", np.float64),
        ("weight", np.float64),  # readings, the older ones for less
        ("squares", np.float64, (_UNKNOWNS, _UNKNOWNS)),  # sums of the fits
        ("products", np.float64, (_BANK, _UNKNOWNS)),
        ("rests", np.float64, (_BANK,)),
        ("turning", np.float64, (2, 3)),  # of each axle: sums of yaw rate^2, of it times what is left, of that squared
        ("steering_weight", np.float64),  # readings, the older ones for less
        ("steering_squares", np.float64, (_UNKNOWNS, _UNKNOWNS)),  # sums of the fit of the steering
        ("steering_products", np.float64, (_UNKNOWNS,)),
        ("gain", np.float64),  # of the steering that is corrected for, less 1
        ("offset", np.float64),  # [rad] likewise
        ("use", np.float64),  # [-] greatest force of a tire over its load, in the mean of the last tenth of a second
        ("held", np.float64),  # [-] greatest of that
        ("ceiling", np.float64),  # [-] after the tires slid; 0: there is none
        ("unexplained", np.int64),  # ticks in a row in which wheels slid
        ("pause", np.float64),  # [s] that is left of it
        ("slides", np.int64),  # how often they slid
    ]
)
"""Type of what is kept from tick to tick; zero at the beginning."""

_HELD_TIME = 0.1  # [s] of the mean use


def levels(settings: FrictionLearningSettings | None = None) -> FloatArray:
    """Return the friction coefficients of the bank that may be used, the least first."""
    return _bank(settings or FrictionLearningSettings())[:_USED]


def _bank(settings: FrictionLearningSettings) -> FloatArray:
    return settings.start * _RATIO ** (np.arange(_BANK, dtype=np.float64) - _BELOW)


def learning_row(car: CarParameters, settings: FrictionLearningSettings | None = None) -> NDArray[np.void]:
    """Return a row of type LEARNING, shape (1,), of a planner that learns."""
    settings = settings or FrictionLearningSettings()
    row = np.zeros(1, LEARNING)
    row["settings"], row["mus"] = record_values(settings), _bank(settings)
    slip = slip_row(car, car.gravity)[0]
    least = min(car.front_peak, car.rear_peak)
    uses = np.linspace(0.0, _WIDEST, _POINTS)
    for axle in ("front", "rear"):
        if slip["needs_slip_angle"] and math.isfinite(least):
            row[f"{axle}_slip"] = [_slip_at(slip[axle], use * least) for use in uses.tolist()]
        elif slip["needs_slip_angle"]:  # linear: the friction that is told is the set's, and there is no peak
            row[f"{axle}_slip"] = uses / float(slip[axle]["B"])
        else:
            beyond = np.maximum(uses - 1.0, 0.0)
            row[f"{axle}_slip"] = (uses + (_STEEPNESS - 1.0) * beyond) / settings.stiffness
    row["compliance"] = 0.5 * (row["front_slip"][:, 1] + row["rear_slip"][:, 1]) / uses[1]
    row["relaxation_length"] = car.relaxation_length if slip["needs_slip_angle"] else settings.relaxation_length
    load = 0.25 * car.mass * car.gravity
    stiffness = load / (row["compliance"] * row["relaxation_length"])  # [N/m] of a tire, at friction 1
    row["damping_time"] = 2.0 * settings.damping_ratio * np.sqrt(car.wheel_inertia / stiffness) / car.wheel_radius
    return row


def _slip_at(axle: Record, force: float) -> float:
    """Return the slip at which an axle has a force over its load, continued steeply behind most of its peak."""
    most = _MOST_USE * float(axle["D"])
    greatest = float(slip_angle(axle, most))
    if force <= most:
        return float(slip_angle(axle, force))
    return greatest * (1.0 + _STEEPNESS * (force - most) / most)


@kernel
def learn(learning: Record, learned: Record, car: Record, odometry: Record, period: float) -> None:
    """Take what the car's sensors say into what is learned, once in every tick.

    Args:
      learning: of type LEARNING.
      learned: of type LEARNED, written to.
      car: of type CAR.
      odometry: of type ODOMETRY.
      period: since the last tick [s].
    """
    settings = learning.settings
    if not learned.begun:
        learned.begun, learned.mu, learned.level, learned.stops = True, settings.start, _BELOW, _BELOW
    learned.pause = max(learned.pause - period, 0.0)
    learned.ceiling *= 1.0 + settings.ceiling_rise * period
    total = odometry.speed + odometry.steering_angle + odometry.angular_velocity[2]
    for wheel in range(4):
        total += odometry.wheel_speeds[wheel]
    forward, left = odometry.linear_acceleration[0] / car.gravity, odometry.linear_acceleration[1] / car.gravity
    if not math.isfinite(total + forward + left):
        return
    share = min(period / _HELD_TIME, 1.0)
    use = 0.0
    if odometry.speed > settings.least_speed and abs(odometry.steering_angle) < settings.most_steering:
        use = _compare(learning, learned, car, odometry, forward, left, period)
        _learn_steering(learning, learned, car, odometry, left, period)
    learned.use += share * (use - learned.use)
    if learned.pause == 0.0:
        learned.held = max(learned.held, learned.use)
    _bound(learning, learned, period)


@kernel
def _compare(
    learning: Record, learned: Record, car: Record, odometry: Record, forward: float, left: float, period: float
) -> float:
    """Compare the speeds of the wheels with those by every friction of the bank, and see whether wheels slide.

    `forward` and `left` are the acceleration over g. Returned is the greatest force of a tire over its load.
    """
    settings = learning.settings
    speeds, yaw_rate, angle = odometry.wheel_speeds, odometry.angular_velocity[2], odometry.steering_angle
    half, slope = 0.5 * yaw_rate * car.track_width, math.tan(angle)
    lever = 0.5 * car.track_width / car.wheelbase
    rear = 0.5 * (speeds[2] + speeds[3])
    rolling, loads, at_rest, moved = np.empty(4), np.empty(4), np.empty(4), np.empty(4)  # [m/s], of the car's weight
    sines = np.zeros(4)
    on_front, on_rear = 0.5 * car.rear_axle_distance / car.wheelbase, 0.5 * car.front_axle_distance / car.wheelbase
    spins = 4.0 * car.wheel_inertia / (car.mass * car.wheel_radius)  # [m] what turns the wheels faster, pitches the car
    along = 0.5 * (car.center_of_gravity_height + spins) / car.wheelbase * forward
    along *= 1.0 + settings.load_lag / car.speed_time_constant  # of an acceleration that falls over this time
    across = car.center_of_gravity_height / car.track_width * left
    for wheel in range(4):
        side = 1.0 if wheel % 2 == 1 else -1.0  # the right wheels are the odd ones
        at_rest[wheel] = on_front if wheel < 2 else on_rear
        moved[wheel] = -along if wheel < 2 else along
        loads[wheel] = max(at_rest[wheel] + 2.0 * side * across * at_rest[wheel] + moved[wheel], _LEAST_LOAD)
        rolling[wheel] = rear + side * half
        if wheel < 2:
            turned = math.atan2(slope, 1.0 + side * lever * slope)
            sines[wheel] = math.sin(turned)
            rolling[wheel] = rolling[wheel] * math.cos(turned) + car.wheelbase * yaw_rate * sines[wheel]
    force = 0.25 * (forward + 2.0 * on_front * left * math.sin(angle))  # of a tire, over the car's weight
    regressors = np.empty(_UNKNOWNS)
    regressors[0], regressors[2] = odometry.speed, yaw_rate * angle
    pressed = rolling * (loads - at_rest)
    regressors[1] = _between_axles(pressed)
    excess = np.empty(4)
    for wheel in range(4):
        excess[wheel] = speeds[wheel] - rolling[wheel]
    seen = _between_axles(excess)

    slips = np.empty(4)
    _slip_speeds(learning, car, odometry.speed, rolling, loads, moved, sines, force, left, learned.mu, slips)
    use: float = math.hypot(force / loads.min(), left)
    if _slides(learning, learned, regressors, seen, excess, slips, pressed, yaw_rate, max(use, learned.use), period):
        return use
    if learned.pause > 0.0:
        return use
    forget = math.exp(-period / settings.memory)
    learned.weight = learned.weight * forget + 1.0
    for i in range(_UNKNOWNS):
        for j in range(_UNKNOWNS):
            learned.squares[i, j] = learned.squares[i, j] * forget + regressors[i] * regressors[j]
    for level in range(_BANK):
        mu = learning.mus[level]
        _slip_speeds(learning, car, odometry.speed, rolling, loads, moved, sines, force, left, mu, slips)
        rest = seen - _between_axles(slips)
        for i in range(_UNKNOWNS):
            learned.products[level, i] = learned.products[level, i] * forget + regressors[i] * rest
        learned.rests[level] = learned.rests[level] * forget + rest * rest
    _weigh(learning, learned)
    return use


@kernel
def _learn_steering(
    learning: Record, learned: Record, car: Record, odometry: Record, left: float, period: float
) -> None:
    """Fit gain and offset of the steering: curvature times wheelbase = offset + gain tan(angle) + understeer.

    Understeer grows with the lateral acceleration, `left` over g. The curvature is the yaw rate over the speed, which
    a drift of both does not change.
    """
    settings, squares, products = learning.settings, learned.steering_squares, learned.steering_products
    if abs(left) > _LINEAR * learned.mu or learned.pause > 0.0:
        return
    regressors = np.empty(_UNKNOWNS)
    regressors[0], regressors[1], regressors[2] = 1.0, math.tan(odometry.steering_angle), left
    turned = car.wheelbase * odometry.angular_velocity[2] / odometry.speed
    forget = math.exp(-period / settings.memory)
    learned.steering_weight = learned.steering_weight * forget + 1.0
    for i in range(_UNKNOWNS):
        for j in range(_UNKNOWNS):
            squares[i, j] = squares[i, j] * forget + regressors[i] * regressors[j]
        products[i] = products[i] * forget + regressors[i] * turned
    learned.gain = learned.offset = 0.0
    if learned.steering_weight * period > settings.steering_known:
        _solve(squares, products, regressors)
        gain = regressors[1] - 1.0
        if abs(gain) > settings.steering_deviation and abs(gain) < _MOST_GAIN:
            learned.gain = gain
        offset = math.atan(regressors[0])
        if abs(offset) > settings.offset_deviation and abs(offset) < _MOST_OFFSET:
            learned.offset = offset


@kernel
def true_steering(learned: Record, angle: float) -> float:
    """Return the steering angle [rad] of a car that says another."""
    return math.atan((1.0 + learned.gain) * math.tan(angle) + math.tan(learned.offset))


@kernel
def commanded_steering(learned: Record, angle: float) -> float:
    """Return the steering angle [rad] to command, so that the true one becomes `angle`."""
    return math.atan((math.tan(angle) - math.tan(learned.offset)) / (1.0 + learned.gain))


@kernel
def _between_axles(values: FloatArray) -> float:
    """Return the mean of the front wheels less that of the rear wheels."""
    return float(0.5 * (values[0] + values[1] - values[2] - values[3]))


@kernel
def _slip_speeds(
    learning: Record,
    car: Record,
    speed: float,
    rolling: FloatArray,
    loads: FloatArray,
    moved: FloatArray,
    sines: FloatArray,
    force: float,
    left: float,
    mu: float,
    slips: FloatArray,
) -> None:
    """Write by how much each wheel turns faster than it would roll [m/s], at a friction.

    The motor's servo lets the force fall over its time constant between two commands, and with it the part of the load
    that acceleration has moved, `moved`. The slip of a tire whose force over load falls is less, by its relaxation
    length: falling force lowers it on all wheels, and the load that comes back lowers it most on the lighter axle. A
    tire's damping, which takes a part of the force, works the other way. The wheels of soft tires turn faster for the
    same force, so that the servo takes longer.
    """
    lasting = car.speed_time_constant + speed * learning.compliance / (car.gravity * mu)
    fallen = (learning.settings.age + learning.relaxation_length / speed - learning.damping_time / mu) / lasting
    sideways = math.copysign(_slip_of(learning.rear_slip, abs(left) / mu), left) * speed
    for wheel in range(4):
        along = force / loads[wheel]
        used = math.hypot(along, left)
        slip = _slip_of(learning.front_slip if wheel < 2 else learning.rear_slip, used / mu)
        falling = max(1.0 - fallen * (1.0 - moved[wheel] / loads[wheel]), 0.0)
        slips[wheel] = falling * rolling[wheel] * slip * along / max(used, 1e-9) - sideways * sines[wheel]


@kernel
def _slip_of(curve: FloatArray, use: float) -> float:
    """Return the slip of a curve at a use of the friction, which may lie beyond its end."""
    place = use * (_POINTS - 1) / _WIDEST
    at = min(int(place), _POINTS - 2)
    return float(curve[at] + (place - at) * (curve[at + 1] - curve[at]))


@kernel
def _slides(
    learning: Record,
    learned: Record,
    regressors: FloatArray,
    seen: float,
    excess: FloatArray,
    slips: FloatArray,
    pressed: FloatArray,
    yaw_rate: float,
    use: float,
    period: float,
) -> bool:
    """Return whether wheels turn as the used friction does not explain; if they go on, what was learned is forgotten.

    `use` is the greatest force of a tire over its load: of tires that slide, their friction.
    """
    settings = learning.settings
    known = learned.weight * period > settings.known
    unknowns, load_gain = np.zeros(_UNKNOWNS), 0.0
    deviation = 0.0
    if known:
        _solve(learned.squares, learned.products[learned.level], unknowns)
        deviation = math.sqrt(_left(learned, unknowns, learned.level) / learned.weight)
        load_gain = unknowns[1]
    greatest = 0.0  # [m/s] of the slips that are explained
    for wheel in range(4):
        greatest = max(greatest, abs(slips[wheel]))
    least = (settings.sliding if known else 10.0 * settings.sliding) + settings.unexplained * greatest
    rest = seen - _between_axles(slips)
    for i in range(_UNKNOWNS):
        rest -= unknowns[i] * regressors[i]
    sliding = abs(rest) > max(least, settings.deviations_sliding * deviation)
    forget = math.exp(-period / settings.memory)
    for axle in range(2):
        right, sums = 2 * axle + 1, learned.turning[axle]
        between = excess[right] - excess[right - 1] - slips[right] + slips[right - 1]
        between -= load_gain * (pressed[right] - pressed[right - 1])
        gain = sums[1] / max(sums[0], 1e-9) if known else 0.0
        spread = math.sqrt(max(sums[2] - gain * sums[1], 0.0) / max(learned.weight, 1.0)) if known else 0.0
        limit = max(least, settings.deviations_sliding * spread)
        sliding = sliding or abs(between - gain * yaw_rate) > limit
        sums[0] = sums[0] * forget + yaw_rate * yaw_rate
        sums[1] = sums[1] * forget + yaw_rate * between
        sums[2] = sums[2] * forget + between * between
    learned.unexplained = learned.unexplained + 1 if sliding else 0
    if not sliding or (learned.pause == 0.0 and learned.unexplained < settings.ticks):
        return bool(sliding)
    mu = learned.mu
    if learned.pause == 0.0:
        learned.slides += 1
        learned.mu = min(max(settings.kept * use, settings.least_kept * mu), settings.kept * mu)
    else:
        learned.mu = mu * (1.0 - settings.fall * period)
    learned.mu = max(learned.mu, min(learning.mus[0], mu))
    learned.ceiling, learned.held = learned.mu, learned.mu / (1.0 + settings.step)
    learned.pause = settings.pause
    learned.weight = learned.mean = learned.deviation = 0.0
    learned.squares[:], learned.products[:], learned.rests[:], learned.turning[:] = 0.0, 0.0, 0.0, 0.0
    return True


@kernel
def _weigh(learning: Record, learned: Record) -> None:
    """Work out mean and standard deviation of the friction by what each friction of the bank leaves unexplained."""
    settings = learning.settings
    unknowns, left = np.empty(_UNKNOWNS), np.empty(_BANK)
    for level in range(_BANK):
        _solve(learned.squares, learned.products[level], unknowns)
        left[level] = _left(learned, unknowns, level) + learned.weight * settings.resolution**2
    least = left.min()
    total, first, second = 0.0, 0.0, 0.0
    for level in range(_BANK):
        mu = learning.mus[level]
        likelihood = (left[level] / least) ** (-0.5 * learned.weight / settings.independent)
        total += likelihood
        first += likelihood * mu
        second += likelihood * mu * mu
    learned.mean = first / total
    learned.deviation = math.sqrt(max(second / total - learned.mean**2, (settings.least_deviation * learned.mean) ** 2))


@kernel
def _left(learned: Record, unknowns: FloatArray, level: int) -> float:
    """Return the sum of squares that the fit of a level leaves."""
    left = learned.rests[level]
    for i in range(_UNKNOWNS):
        left -= unknowns[i] * learned.products[level, i]
    return float(max(left, 0.0))


@kernel
def _solve(squares: FloatArray, products: FloatArray, unknowns: FloatArray) -> None:
    """Write the unknowns of a least-squares fit from its sums: Cramer's rule, for three."""
    a, b, c = squares[0, 0] + 1e-9, squares[0, 1], squares[0, 2]
    d, e, f = squares[1, 1] + 1e-9, squares[1, 2], squares[2, 2] + 1e-9
    m0, m1, m2 = d * f - e * e, c * e - b * f, b * e - c * d
    determinant = a * m0 + b * m1 + c * m2
    if not determinant > 0.0:
        unknowns[:] = 0.0
        return
    x, y, z = products[0], products[1], products[2]
    unknowns[0] = (m0 * x + m1 * y + m2 * z) / determinant
    unknowns[1] = (m1 * x + (a * f - c * c) * y + (b * c - a * e) * z) / determinant
    unknowns[2] = (m2 * x + (b * c - a * e) * y + (a * d - b * b) * z) / determinant


@kernel
def _bound(learning: Record, learned: Record, period: float) -> None:
    """Move the used friction towards what is learned, within its bounds."""
    settings = learning.settings
    if learned.mean > 0.0:
        doubt = settings.deviations * learned.deviation
        seen = learned.mu if learned.ceiling > 0.0 else settings.start  # kept while nothing is known that is against it
        wanted = max(learned.mean - doubt, min(seen, learned.mean + doubt))
        wanted = min(wanted, max((1.0 + settings.step) * learned.held, settings.start))
        if learned.ceiling > 0.0:
            wanted = min(wanted, learned.ceiling)
        if learned.mean > learning.mus[_USED]:  # tires that show no slip tell nothing
            wanted = min(wanted, max(learned.mu * (1.0 - settings.fall * period), settings.start))
        learned.mu = min(wanted, learned.mu * (1.0 + settings.rise * period))
    learned.mu = min(max(learned.mu, learning.mus[0]), learning.mus[_USED - 1])
    level = 0
    while level < _USED - 1 and learning.mus[level + 1] <= learned.mu:
        level += 1
    learned.level = level
    learned.stops = level if learning.mus[level] >= learned.mu else min(level + 1, _USED - 1)


@kernel
def use_friction(limiter: Record, row: Record, mu: float) -> None:
    """Write the limiter of a friction from that of the level below it.

    Args:
      limiter: of type LIMITER, written to; it has the values of `row` but for those that depend on friction.
      row: of type LIMITER, of the level.
      mu: that is used.
    """
    car, share = row.car, mu / row.mu
    height = car.center_of_gravity_height / car.wheelbase
    gained = (height + 0.5 / row.mu) / (height + 0.5 / mu)
    limiter.mu, limiter.lateral = mu, row.lateral * share
    limiter.braking, limiter.accelerating = row.braking * gained, row.accelerating * gained


_LEARNS = np.dtype([("learning", LEARNING), ("learned", LEARNED)])


@kernel
def _learn(  # type: ignore[no-untyped-def]
    geometry, ranges, ranges_without_cars, ranges_without_movers, tick, lines, trajectories, stage_state, command
):
    """Learn from the odometry, and let the planner use the friction and the true steering angle.

    Arguments are as in control.stages.
    """
    driver, learned = tick.driver, stage_state.learned
    learn(stage_state.learning, learned, driver.car, tick.odometry, period_of(geometry))
    row = trajectories[driver.trajectories + learned.level].limiter
    driver.limiter = row
    held = trajectories[driver.trajectories + learned.stops].limiter.mu  # less than the level's where a wheel lifts
    use_friction(driver.limiter, row, min(learned.mu, held))
    driver.stops = learned.stops
    tick.odometry.steering_angle = true_steering(learned, tick.odometry.steering_angle)


@kernel
def _correct(  # type: ignore[no-untyped-def]
    geometry, ranges, ranges_without_cars, ranges_without_movers, tick, lines, trajectories, stage_state, command
):
    """Correct the command for the error of the steering; arguments as in control.stages."""
    command[0] = saturate(commanded_steering(stage_state.learned, command[0]), tick.driver.car.max_steering_angle)


def _first(planner: Planner) -> NDArray[np.void]:
    """Return what a planner begins with, of type _LEARNS."""
    row = np.zeros(1, _LEARNS)
    row["learning"] = learning_row(planner.car)
    return row


LEARN = Stage(
    text="the planner does not know the friction: it starts at 0.4 and learns it", needs=("limiter",),
    needs_friction=True, before_guidance=_learn, after_driving=_correct, state_type=_LEARNS, first=_first,
    frictions=tuple(levels().tolist()),
)  # fmt: skip
"""The stage `learn`: the planner is not told the friction."""
