"""The friction limiter: closed forms, a bicycle driven by any references, what was measured on the car, the car."""

import math
from dataclasses import replace
from functools import cache
from itertools import pairwise

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import fg_mujoco as fg
from car_worlds import flat_world, forward, step
from cases import each
from fg_mujoco.controllers.control.planner_settings import for_car
from fg_mujoco.controllers.control.speed import friction_steering, lifting_share
from fg_mujoco.controllers.safety.friction_limiter import (
    EVASIVE,
    FrictionLimiter,
    FrictionLimiterSettings,
    evasive,
    longitudinal_share,
)
from fg_mujoco.lab.lab_ground import LabGround
from fg_mujoco.messages import DriveCommand
from fg_mujoco.racing.race import race
from fg_mujoco.vehicle.car import Car
from fg_mujoco.vehicle.tire_forces import TireForces
from fg_mujoco.vehicle.tire_slip import SLIDING_SPEED, TireSlipMeter, slides_above
from fg_mujoco.vehicle.tires import Tires
from scan_worlds import CAR, MU, odometry_of

VEHICLE = fg.Vehicle.load()  # on its own tires: ideal ones slide in tight bends, because axles of a shaft roll alike
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


DRIVES = {
    "shaft": {}, "open centre": {"shaft": False}, "rear": {"shaft": False, "drives_front": False}, "locked": {
    "front_lock": 1.0, "rear_lock": 1.0}, "front": {"shaft": False, "drives_rear": False}, "limited": {
    "front_lock": 0.3, "rear_lock": 0.3},
}  # fmt: skip


def four_wheels(car, mu, use, braking, along):
    """Whether four wheels hold an acceleration along at a share of mu g across: loads by moments, friction circles.

    An axle's lateral force is by moments, too, that of a wheel in proportion to its load; both axles roll alike.
    """
    h, b, w, g = car.center_of_gravity_height, car.wheelbase, car.track_width, car.gravity
    pitched, aside = (along if braking else -along) * h / b, use * mu * h / w
    axles = []  # what each axle holds along, over the mass
    for at_rest, moved, lock in (
        (g * car.rear_axle_distance / b, pitched, car.front_lock),
        (g * car.front_axle_distance / b, -pitched, car.rear_lock),
    ):
        load = max(at_rest + moved, 1e-9)
        inner, outer = (
            math.sqrt(max((mu * wheel) ** 2 - (use * mu * at_rest / load * wheel) ** 2, 0.0))
            for wheel in (max(0.5 * load - at_rest * aside, 0.0), 0.5 * load + at_rest * aside)
        )
        axles.append(inner + min(outer, inner * (1.0 + lock) / (1.0 - lock) if lock < 1.0 else math.inf))
    if car.shaft:
        return along <= sum(axles)
    driven = [held for held, drives in zip(axles, (car.drives_front, car.drives_rear), strict=True) if drives]
    return along / len(driven) <= min(driven)


def held_by_four_wheels(car, mu, use, direction):
    """The greatest acceleration of `four_wheels` [m/s^2], by halving."""
    low, high = 0.0, 20.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        held = four_wheels(car, mu, use, direction == "brake", middle)
        low, high = (middle, high) if held else (low, middle)
    return low


@each("drive", DRIVES)
@each("mu", [0.4, 0.8])
def test_what_cornering_leaves_is_what_four_wheels_hold(drive, mu):
    car = replace(CAR, max_acceleration=30.0, **DRIVES[drive])
    limiter = FrictionLimiter(car, mu, EVERY_BIT)
    for use in (0.0, 0.3, 0.6, 0.9, 0.99):
        for most, direction in ((limiter.braking, "brake"), (limiter.accelerating, "accelerate")):
            found = most * longitudinal_share(limiter.record[0], use, direction == "brake")
            held = held_by_four_wheels(car, mu, use, direction)
            assert found == pytest.approx(held, rel=0.0, abs=1e-4), (use, direction)  # between 257 entries


@each("mu", [0.6, 0.9])
def test_straight_ahead_it_brakes_and_accelerates_with_all_that_the_tires_hold(mu):
    limiter = FrictionLimiter(CAR, mu, EVERY_BIT)
    assert settled(limiter, 0.0, 0.0, 6.0)[1] == pytest.approx(-mu * GRAVITY, rel=1e-4)
    limiter.reset()
    assert settled(limiter, 0.0, 20.0, 1.0)[1] == pytest.approx(mu * GRAVITY, rel=1e-4)
    assert FrictionLimiter(CAR, 1.5, EVERY_BIT).braking == CAR.max_acceleration  # the motor's


SOFT, STIFF = (4.0, 0.33, 0.72), (21.0, 0.1, 0.8)  # cornering stiffness [1/rad], slip of the peak, peak


@cache
def curve(stiffness, peak_slip, peak):
    """D sin(C atan(B s)) with its peak where it is to be: C by search."""
    shapes = np.linspace(1.0, 3.0, 2_000_001)[1:]
    shape = shapes[np.argmin(np.abs(np.tan(0.5 * np.pi / shapes) * shapes * peak / stiffness - peak_slip))]
    return lambda slip: peak * math.sin(shape * math.atan(stiffness / (shape * peak) * slip))


@each("direction", ["brake", "accelerate"])
@each("height", [0.02, HEIGHT, 0.12])
@each("front, rear", [(SOFT, STIFF), (STIFF, SOFT)])
def test_with_a_shaft_an_axle_has_what_its_curve_gives_at_the_slip_of_the_others_peak(front, rear, height, direction):
    tires = {
        f"{name}_{part}": value
        for name, axle in (("front", front), ("rear", rear))
        for part, value in zip(("cornering_stiffness", "peak_slip", "peak"), axle, strict=True)
    }
    car = replace(CAR, max_acceleration=30.0, shaft=True, center_of_gravity_height=height, **tires)
    limiter = FrictionLimiter(car, 0.72, EVERY_BIT)
    at_front, at_rear = (curve(*axle)(min(front[1], rear[1])) for axle in (front, rear))
    along = 0.0  # [m/s^2] what both axles hold with the loads of this, until it is the same
    for _ in range(100):
        moved = along * height / WHEELBASE * (1.0 if direction == "brake" else -1.0)
        along = at_front * (GRAVITY * REAR / WHEELBASE + moved) + at_rear * (GRAVITY * FRONT / WHEELBASE - moved)
    assert (limiter.braking if direction == "brake" else limiter.accelerating) == pytest.approx(along, rel=1e-4)


def test_what_slows_the_wheels_by_itself_brakes_by_the_tires_too():
    car, without = replace(CAR, rolling_resistance=0.2, rolling_damping=0.25), FrictionLimiter(CAR, MU)
    for speed, wanted in ((1.0, 0.0), (4.0, 0.0), (4.0, 4.0), (1.0, 8.0)):
        command, _ = settled(FrictionLimiter(car, MU), 0.0, wanted, speed)
        slowed = command.speed - CAR.speed_time_constant * (0.2 + 0.25 * speed)  # what the wheels come to with drag
        assert slowed == pytest.approx(settled(without, 0.0, wanted, speed)[0].speed, rel=1e-4)
    ipz = fg.Vehicle.load("ipz").parameters
    assert ipz.rolling_damping == pytest.approx(0.238, abs=0.01)  # [1/s] as identified


def test_a_car_that_is_to_stand_does_not_creep_on():
    """Its motor overcomes no more than rolling takes, in proportion to the turning of a wheel below 1 rad/s."""
    car = fg.Vehicle.load("f1tenth").parameters
    for speed in (0.002, 0.01, 0.03):
        limiter = FrictionLimiter(car, 0.94)
        command = limiter(0.0, 0.0, odometry_of(speed), 0.025)
        taken = car.rolling_resistance * min(speed / car.wheel_radius, 1.0)
        assert (command.speed - speed) / car.speed_time_constant - taken < -0.5 * speed / 0.05


def slide_of_stop(vehicle, speed, angle, believes=1.0):
    """Slide [m/s] in a stop by the limiter, straight or out of a steady curve."""
    ground = LabGround(vehicle=vehicle)
    limiter = FrictionLimiter(vehicle.parameters, believes * vehicle.nominal_mu)
    ground.place(speed)
    if angle:
        ground.run([DriveCommand(steering_angle=angle, speed=speed)] * 60)
    trace = ground.drive(lambda odometry: limiter(angle, 0.0, odometry, PERIOD), 2.5)
    assert trace.speed[-1] < 0.05
    return np.nanmax(trace.slip.sliding_speed)


@each("name", ["f1tenth", "ipz", "nuc2"])
def test_no_tire_passes_its_peak_in_a_stop_by_the_limiter(name):
    vehicle = fg.Vehicle.load(name)
    for speed in (3.0, 5.0, 8.0):
        assert slide_of_stop(vehicle, speed, 0.0) == 0.0, speed
    for angle in (0.1, 0.2, 0.3):  # at half of the grip
        speed = math.sqrt(0.5 * vehicle.nominal_mu * GRAVITY * vehicle.parameters.wheelbase / math.tan(angle))
        assert slide_of_stop(vehicle, speed, angle) == 0.0, angle


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


def test_on_a_slippery_floor_less_load_moves_and_an_evading_car_turns_in_more():
    for mu in (0.3, 0.5, 0.66, 0.8, 0.95, MU, 1.3):
        turn_in = evasive(EVASIVE, CAR, mu).turn_in_use
        if mu >= MU:  # where the share was found, to the bit, and no less on more friction
            assert turn_in == EVASIVE.turn_in_use
        else:
            assert turn_in == pytest.approx(EVASIVE.turn_in_use * inner_rear_load(mu) / inner_rear_load(MU))


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
def test_whatever_is_asked_the_tires_hold_what_cornering_takes_and_the_rest_is_for_braking(references, speed, mu):
    held = [(angle, asked) for angle, asked, ticks in references for _ in range(ticks)]
    for v, curvature, rate, acceleration in drive_bicycle(FrictionLimiter(CAR, mu), held, speed):
        assert abs(v * v * curvature + YAW_LAG * v * rate) <= mu * GRAVITY
        use = v * v * abs(curvature) / (mu * GRAVITY)
        assert four_wheels(CAR, mu, use, acceleration < 0.0, abs(acceleration)), (use, acceleration)


@each("direction", ["brake", "accelerate"])
@each("mu", [0.6, MU])
@each("speed", [2.0, 4.0, 7.0])
def test_it_never_asks_for_more_than_four_wheels_hold(mu, direction, speed):
    limiter = FrictionLimiter(CAR, mu)
    granted = []
    for use in np.linspace(0.0, 0.95, 39):
        angle = math.atan(use * mu * GRAVITY * WHEELBASE / speed**2)
        if angle > CAR.max_steering_angle:
            break
        limiter.reset()
        _, acceleration = settled(limiter, angle, 0.0 if direction == "brake" else 20.0, speed)
        granted.append(abs(acceleration))
        assert granted[-1] <= held_by_four_wheels(CAR, mu, use, direction), f"at {use:.3f} of mu g"
    assert all(after <= before for before, after in pairwise(granted))
    assert granted[0] > 0.85 * held_by_four_wheels(CAR, mu, 0.0, direction)  # and it is not timid


# -- the car


def greatest_slide(speed, reference, limiter):
    """Slide [m/s] of the car at `speed` given a step of the steering reference, through the limiter or straight."""
    model, data, car = flat_world(tires=VEHICLE.tires)
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


@each("speed", [5.0, 7.0])
def test_a_step_of_the_steering_reference_slides_no_tire_and_does_without_the_limiter(speed):
    limiter = FrictionLimiter(VEHICLE.parameters, VEHICLE.nominal_mu)
    slide, data = greatest_slide(speed, -CAR.max_steering_angle, limiter)
    assert slide <= slides_above(VEHICLE.tires.model)
    heading = 2.0 * math.atan2(data.qpos[6], data.qpos[3])
    assert heading < -0.5  # it did turn
    assert greatest_slide(speed, -CAR.max_steering_angle, None)[0] > 2.0 * SLIDING_SPEED


def test_a_limiter_that_believes_in_half_as_much_grip_again_slides():
    assert slide_of_stop(VEHICLE, 5.0, 0.0) == 0.0 and slide_of_stop(VEHICLE, 5.0, 0.0, 1.5) > SLIDING_SPEED


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
    model, data, car = flat_world(tires=VEHICLE.tires)
    meter, limiter = TireSlipMeter(model), FrictionLimiter(VEHICLE.parameters, VEHICLE.nominal_mu)
    car.set_pose(data, 0.0, 0.0, 0.0)
    for angle, speed in references:
        car.apply(data, limiter(angle, speed, car.odometry(data), PERIOD))
        for _ in range(round(PERIOD / model.opt.timestep)):
            step(model, data)
            meter.record(data)
    assert np.nanmax(meter.read().sliding_speed) <= slides_above(VEHICLE.tires.model)


@each("height", [0.105, 0.12, 0.14])  # it slid by .06 m/s, and rolled over at .12 m and .14 m
def test_a_tall_car_laps_without_a_slide_and_is_warned_of(height):
    with pytest.warns(UserWarning, match=f"center_of_gravity_height is {height:g} m: at full lock a wheel lifts"):
        car = race(track="oval", laps=1, cog_height=height).cars[0]
    assert car.finished and car.max_slide_m_s <= slides_above(VEHICLE.tires.model)


@each("name", fg.vehicle_names())
@each("tires", [None, "coulomb"])
def test_a_stop_in_a_bend_at_half_of_the_grip_does_not_spin_the_car(name, tires):
    """Neither through the limiter nor as the speed servo stops by itself, whose wheels lock."""
    vehicle = fg.Vehicle.load(name)
    vehicle = vehicle if tires is None else replace(vehicle, tires=Tires.load(tires))
    for limiter in (FrictionLimiter(vehicle.parameters, vehicle.nominal_mu), None):
        model = vehicle.compile()
        data, car, forces, angle = mujoco.MjData(model), Car(model), TireForces(model), 0.15
        lateral = 0.5 * vehicle.nominal_mu * GRAVITY
        speed = math.sqrt(lateral * car.parameters.wheelbase / math.tan(angle))
        forces.begin(data)
        car.write_pose(data, 0.0, 0.0, 0.0, speed)
        data.ctrl[:] = angle, speed
        forces.run(data, *np.empty((2, 300, 0)))
        begun, rates = data.qvel[5], []
        for _ in range(40 if name == "autodrive" else 28):  # .7 s, and 1 s of the one on the softest tires along
            odometry = car.odometry(data)
            command = DriveCommand(steering_angle=angle, speed=0.0)
            car.apply(data, limiter(angle, 0.0, odometry, PERIOD) if limiter else command)
            forces.run(data, *np.empty((2, 5, 0)))
            rates.append(data.qvel[5])
        assert car.ground_speed(data) < 0.1
        assert min(rates) > -0.3 and max(rates) < 1.1 * begun  # [rad/s]
