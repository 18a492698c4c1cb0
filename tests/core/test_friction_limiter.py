"""The friction limiter: closed forms, a bicycle driven by any references, what was measured on the car, the car."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from car_worlds import flat_world, forward, step
from cases import each
from fg_mujoco.controllers.control.planner_settings import for_car
from fg_mujoco.controllers.control.speed import friction_steering, lifting_share
from fg_mujoco.controllers.safety.friction_limiter import (
    FrictionLimiter,
    FrictionLimiterSettings,
    braking_exponent,
    cornering_exponent,
    evasive,
)
from fg_mujoco.controllers.safety.safety_filter import EVASIVE
from fg_mujoco.messages import DriveCommand
from fg_mujoco.racing.race import race
from fg_mujoco.vehicle.tire_slip import SLIDING_SPEED, TireSlipMeter, slides_above
from scan_worlds import CAR, MU, odometry_of

TIRES = ("coulomb", "contact")  # the default, and MuJoCo's own contacts
PERIOD = 0.025  # [s] of the LiDAR
GRAVITY, WHEELBASE, HEIGHT, FRONT, REAR, MASS, INERTIA = 9.81, 0.3302, 0.074, 0.15875, 0.17145, 3.74, 0.04712
TRACK = 0.236  # [m] width
YAW_LAG = REAR + INERTIA / (MASS * REAR)  # [m] .245: Newton and Euler, moments about the rear axle
DEFAULTS = for_car(FrictionLimiterSettings(), CAR)
STEERING_RESPONSE = 0.022  # [s] the servo of models/f1tenth.xml: e / 100 rad/s, 3.2 rad/s at most

EVERY_BIT = FrictionLimiterSettings(lateral_use=1.0, braking_use=1.0, accelerating_use=1.0)


def settled(limiter, steering_angle, speed, now, ticks=20):
    """The command after so many ticks of one and the same reference and odometry; its mean acceleration [m/s^2]."""
    for _ in range(ticks):
        command = limiter(steering_angle, speed, odometry_of(now, steering_angle), PERIOD)
    return command, (command.speed - now) * (1.0 - math.exp(-PERIOD / CAR.speed_time_constant)) / PERIOD


def drive_bicycle(limiter, references, speed=0.0, steering_angle=0.0, substeps=10):
    """A kinematic bicycle with the car's servos, driven through the limiter.

    Yields, at every substep, speed, curvature, the curvature's rate and the acceleration.
    """
    step = PERIOD / substeps
    for reference_angle, reference_speed in references:
        command = limiter(reference_angle, reference_speed, odometry_of(speed, steering_angle), PERIOD)
        for _ in range(substeps):
            # the solution over a substep of a first-order servo, its rate limited
            turn = (command.steering_angle - steering_angle) * (1.0 - math.exp(-step / STEERING_RESPONSE))
            turn = max(-3.2 * step, min(turn, 3.2 * step))
            acceleration = (command.speed - speed) / CAR.speed_time_constant
            acceleration = max(-CAR.max_acceleration, min(acceleration, CAR.max_acceleration))
            before = math.tan(steering_angle) / WHEELBASE
            steering_angle += turn
            curvature = math.tan(steering_angle) / WHEELBASE
            yield speed, curvature, (curvature - before) / step, acceleration
            speed += acceleration * step


# -- closed forms


@each("mu", [0.6, MU])
def test_straight_ahead_it_brakes_and_accelerates_with_what_the_lighter_axle_holds(mu):
    # braking at x the rear axle carries m (g lf - x h) / b and a driven wheel m x / 4: two of them hold m x / 2 when
    # m x / 2 = mu m (g lf - x h) / b, so x = g (lf / b) / (h / b + 1 / (2 mu)); accelerating, lr for lf
    def greatest(length):
        return GRAVITY * length / WHEELBASE / (HEIGHT / WHEELBASE + 1.0 / (2.0 * mu))

    limiter = FrictionLimiter(CAR, mu, EVERY_BIT)
    assert settled(limiter, 0.0, 0.0, 6.0)[1] == pytest.approx(-greatest(FRONT), rel=1e-4)
    limiter.reset()
    assert settled(limiter, 0.0, 20.0, 1.0)[1] == pytest.approx(greatest(REAR), rel=1e-4)


@each("speed", [2.0, 4.0, 7.0])
def test_at_one_speed_the_steering_settles_at_the_law_read_for_steering(speed):
    command = None
    angle = 0.0
    limiter = FrictionLimiter(CAR, MU)
    for _ in range(100):  # the servo follows; the speed is held at a reference that is not too fast for what is seen
        command = limiter(0.4, 20.0, odometry_of(speed, angle), PERIOD)
        angle = command.steering_angle
    limit = friction_steering(speed, MU * DEFAULTS.lateral_use, WHEELBASE, GRAVITY)
    if limit > 0.4:
        assert angle == pytest.approx(0.4)
    else:  # too fast for the reference: some of the grip is kept for braking
        share = DEFAULTS.lateral_use_in_braking
        expected = friction_steering(speed, MU * DEFAULTS.lateral_use * share, WHEELBASE, GRAVITY)
        assert angle == pytest.approx(expected, rel=1e-6)


@each("side", [1.0, -1.0])
def test_the_wheels_turn_in_with_a_share_of_the_unused_grip_and_turn_out_with_more(side):
    # v^2 k + c v dk/dt = a: turning in adds to what cornering takes, turning out takes away from it
    speed, angle, share = 5.0, 0.06, DEFAULTS.turn_in_use
    lateral = DEFAULTS.lateral_use * MU * GRAVITY
    cornering = speed**2 * math.tan(angle) / WHEELBASE
    for reference, unused in ((0.4, lateral - cornering), (-0.4, lateral + cornering)):
        rate = share * unused / (YAW_LAG * speed) * WHEELBASE * math.cos(angle) ** 2
        command = FrictionLimiter(CAR, MU)(side * reference, 20.0, odometry_of(speed, side * angle), PERIOD)
        turned = math.copysign(min(rate, 3.2), reference) * DEFAULTS.steering_response
        assert command.steering_angle == pytest.approx(side * (angle + turned), rel=1e-4)


def test_braking_and_accelerating_grow_over_the_load_transfer_time_and_fall_at_once():
    share = PERIOD / DEFAULTS.load_transfer_time
    limiter = FrictionLimiter(CAR, MU)
    for sign, greatest, reference in ((1.0, limiter.accelerating, 20.0), (-1.0, limiter.braking, 0.0)):
        limiter.reset()
        for tick in range(1, 12):
            command, acceleration = settled(limiter, 0.0, reference, 5.0, ticks=1)
            assert acceleration == pytest.approx(sign * greatest * min(tick * share, 1.0))
        command, acceleration = settled(limiter, 0.0, 5.0, 5.0, ticks=1)
        assert acceleration == 0.0
        assert command.speed == 5.0


def inner_rear_load(mu):
    """The share of its load that the inner rear wheel keeps at half of the grip across, and at EVASIVE's braking."""
    braking = EVASIVE.braking_use * GRAVITY * FRONT / (HEIGHT + WHEELBASE / (2.0 * mu))  # the rear axle just holds
    rear_axle = (GRAVITY * FRONT - braking * HEIGHT) / WHEELBASE  # [N] of each kg of the car, moments about the front
    inner_wheel = rear_axle * (0.5 - 0.5 * mu * HEIGHT / TRACK)  # moments about the outer wheel
    return inner_wheel / (0.5 * GRAVITY * FRONT / WHEELBASE)


def test_on_a_slippery_floor_less_load_moves_and_more_is_left_for_braking_and_turning_at_once():
    mus = (0.3, 0.5, 0.66, 0.8, 0.95, MU, 1.3)
    for mu in mus:
        exponent, turn_in = braking_exponent(CAR, mu), evasive(EVASIVE, CAR, mu).turn_in_use
        if mu >= MU:  # where the shares were found, to the bit, and no less on more friction
            assert (exponent, turn_in) == (cornering_exponent(CAR), EVASIVE.turn_in_use)
            continue
        assert turn_in == pytest.approx(EVASIVE.turn_in_use * inner_rear_load(mu) / inner_rear_load(MU))
        # (1/2)^p is what half of the grip in cornering leaves of the inner wheel's force, to the power that p has at MU
        left = math.sqrt(0.75) * (1.0 - HEIGHT / TRACK * mu / MU)
        power = 0.9 / -math.log2(math.sqrt(0.75) * (1.0 - HEIGHT / TRACK))
        assert exponent == pytest.approx(max(-power * math.log2(left), 0.7))
    exponents = [braking_exponent(CAR, mu) for mu in mus]
    assert exponents == sorted(exponents) and exponents[0] == 0.7  # as on steady circles


def test_a_car_that_would_lift_a_wheel_corners_below_that_and_others_by_the_friction():
    for height, mu in ((HEIGHT, 0.6), (HEIGHT, MU), (0.089, MU), (0.12, 0.7)):
        limiter = FrictionLimiter(replace(CAR, center_of_gravity_height=height), mu)
        assert limiter.record["mu"][0] == mu and limiter.lateral == limiter.settings.lateral_use * mu * GRAVITY
    for height in (0.09, 0.12, 0.16):
        limiter = FrictionLimiter(replace(CAR, center_of_gravity_height=height), MU)
        share = lifting_share(limiter.car, CAR.max_steering_angle)
        assert limiter.record["mu"][0] == share < MU
        assert limiter.lateral == limiter.settings.lateral_use * share * GRAVITY
        assert evasive(EVASIVE, limiter.car, MU).turn_in_use < EVASIVE.turn_in_use


# -- a bicycle driven by any references


held_references = st.lists(
    st.tuples(st.floats(-0.7, 0.7), st.floats(0.0, 9.0), st.integers(1, 12)), min_size=1, max_size=12
)


@pytest.mark.slow
@settings(max_examples=300, deadline=None)
@given(held_references, st.floats(0.0, 8.0), st.sampled_from([0.3, 0.6, MU]))
def test_whatever_is_asked_the_lateral_demand_stays_within_the_grip(references, speed, mu):
    held = [(angle, asked) for angle, asked, ticks in references for _ in range(ticks)]
    demands = [
        abs(v * v * curvature + YAW_LAG * v * rate) / (mu * GRAVITY)
        for v, curvature, rate, _ in drive_bicycle(FrictionLimiter(CAR, mu), held, speed)
    ]
    assert max(demands) <= 1.0


@pytest.mark.slow
@settings(max_examples=300, deadline=None)
@given(held_references, st.floats(0.0, 8.0), st.sampled_from([0.6, MU]))
def test_whatever_is_asked_braking_and_accelerating_stay_within_what_cornering_leaves(references, speed, mu):
    held = [(angle, asked) for angle, asked, ticks in references for _ in range(ticks)]
    for v, curvature, _, acceleration in drive_bicycle(FrictionLimiter(CAR, mu), held, speed):
        use = v * v * abs(curvature) / (mu * GRAVITY)
        assert -measured_limit(mu, "brake", use) <= acceleration <= measured_limit(mu, "accelerate", use)


# -- what the car was measured to hold

# The greatest |ax| [m/s^2] before any tire slid at more than .05 m/s, on a circle of 8 m at the given share of mu g:
# speed ramped to ax over .1 s and held for .15 s while the steering kept ay; engine as in models/f1tenth.xml, 2.5 ms.
USES = (0.0, 0.25, 0.5, 0.7, 0.8, 0.9, 0.95)
MEASURED = {
    (MU, "brake"): (6.60, 5.39, 4.10, 3.01, 2.38, 1.45, 0.82),
    (MU, "accelerate"): (7.11, 5.90, 4.61, 3.55, 2.77, 1.72, 1.09),
    (0.6, "brake"): (4.41, 3.95, 3.40, 2.66, 2.07, 1.33, 0.78),
    (0.6, "accelerate"): (4.77, 4.30, 3.79, 3.01, 2.46, 1.72, 1.29),
}


def measured_limit(mu, direction, use):
    return np.interp(use, (*USES, 1.0), (*MEASURED[mu, direction], 0.0))


@each("direction", ["brake", "accelerate"])
@each("mu", [0.6, MU])
@each("speed", [2.0, 4.0, 7.0])
def test_it_never_asks_for_more_than_the_car_was_measured_to_hold(mu, direction, speed):
    limiter = FrictionLimiter(CAR, mu)
    granted = []
    for use in np.linspace(0.0, 0.95, 39):
        angle = math.atan(use * mu * GRAVITY * WHEELBASE / speed**2)
        if angle > CAR.max_steering_angle:
            break
        limiter.reset()
        _, acceleration = settled(limiter, angle, 0.0 if direction == "brake" else 20.0, speed)
        granted.append(abs(acceleration))
        assert granted[-1] <= measured_limit(mu, direction, use), f"at {use:.3f} of mu g"
    assert all(after <= before for before, after in pairwise(granted))
    assert granted[0] > 0.85 * measured_limit(mu, direction, 0.0)  # and it is not timid


# -- the car


def greatest_slide(speed, reference, limiter, tires):
    """Slide [m/s] of the car at `speed` given a step of the steering reference, through the limiter or straight."""
    model, data, car = flat_world(tires=tires)
    meter = TireSlipMeter(model)
    car.set_pose(data, 0.0, 0.0, 0.0, speed)
    for _ in range(40):
        command = DriveCommand(steering_angle=reference, speed=speed)
        if limiter is not None:
            command = limiter(reference, speed, car.odometry(data), PERIOD)
        car.apply(data, command)
        for _ in range(round(PERIOD / model.opt.timestep)):
            step(model, data)
            meter.record(data)
        forward(model, data)
    return np.nanmax(meter.read().sliding_speed), data


@each("tires", TIRES)
@each("speed", [3.0, 5.0, 7.0])
def test_a_step_of_the_steering_reference_slides_no_tire_and_does_without_the_limiter(speed, tires):
    slide, data = greatest_slide(speed, -CAR.max_steering_angle, FrictionLimiter(CAR, MU), tires)
    assert slide < slides_above(tires)
    heading = 2.0 * math.atan2(data.qpos[6], data.qpos[3])
    assert heading < -0.5  # it did turn
    assert greatest_slide(speed, -CAR.max_steering_angle, None, tires)[0] > 2.0 * SLIDING_SPEED


@each("tires", TIRES)
def test_a_limiter_that_believes_in_half_as_much_grip_again_slides(tires):
    assert greatest_slide(5.0, CAR.max_steering_angle, FrictionLimiter(CAR, 1.5 * MU), tires)[0] > SLIDING_SPEED


def any_references(seed, ticks=400):
    """References at low speed as planners give them: held for a while, the steering angle with jitter or without."""
    rng = np.random.default_rng(seed)
    angles, jitter, speeds = [], [], []
    while len(angles) < ticks:
        count = int(rng.integers(3, 25))
        angles += [rng.choice([0.0, rng.uniform(-0.42, 0.42), 0.4189, -0.4189])] * count
        jitter += [rng.choice([0.0, 0.0, 0.05, 0.1])] * count
    while len(speeds) < ticks:
        speeds += [rng.choice([0.0, 2.5, rng.uniform(0.0, 2.5), -0.8])] * int(rng.integers(6, 50))
    shaken = np.array(angles) + np.array(jitter) * rng.uniform(-1.0, 1.0, len(angles))
    return list(zip(np.clip(shaken[:ticks], -0.4189, 0.4189).tolist(), speeds, strict=False))


@each(
    "references",
    [[(0.4189, -0.8)] * 50 + [(0.4189, 2.5)] * 30, *map(any_references, (0, 1, 3))],
    ids=["back and on at full lock", "0", "1", "3"],
)
def test_at_low_speed_no_tire_slides_with_the_wheels_turned(references):
    model, data, car = flat_world(tires="coulomb")
    meter, limiter = TireSlipMeter(model), FrictionLimiter(CAR, MU)
    car.set_pose(data, 0.0, 0.0, 0.0)
    for angle, speed in references:
        car.apply(data, limiter(angle, speed, car.odometry(data), PERIOD))
        for _ in range(round(PERIOD / model.opt.timestep)):
            step(model, data)
            meter.record(data)
    assert np.nanmax(meter.read().sliding_speed) < slides_above("coulomb")


@each("height", [0.105, 0.12, 0.14])  # it slid by .06 m/s, and rolled over at .12 m and .14 m
def test_a_tall_car_laps_without_a_slide_and_is_warned_of(height):
    with pytest.warns(UserWarning, match=f"center_of_gravity_height is {height:g} m: at full lock a wheel lifts"):
        car = race(track="oval", laps=1, cog_height=height).cars[0]
    assert car.finished and car.max_slide_m_s < slides_above("coulomb")
