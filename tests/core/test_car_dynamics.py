"""The car drives as closed forms say: Ackermann geometry, servo rates, traction limits, steady circles."""

import math

import mujoco
import numpy as np
import pytest

from car_worlds import flat_world as flat_world_of
from car_worlds import forward, run, step
from fg_mujoco.course.open_ground import OpenGround
from fg_mujoco.messages import DriveCommand
from fg_mujoco.simulation.engine import Engine
from fg_mujoco.simulation.settings import Start
from fg_mujoco.simulation.world import World
from fg_mujoco.vehicle.car import WHEELS
from fg_mujoco.vehicle.changes import CarChanges
from fg_mujoco.vehicle.fitting import tire_stiffness
from fg_mujoco.vehicle.motion import ground_speed
from fg_mujoco.vehicle.tire_slip import BRISTLES_SLIDE, SLIDING_SPEED, TireSlipMeter, slides_above

TIRES = ("coulomb", "contact")  # the default, and MuJoCo's own contacts
SPIN_INERTIA = 1.7e-4  # [kg m^2] of a wheel, as in models/f1tenth.xml


@pytest.fixture(autouse=True, params=TIRES)
def tires(request, monkeypatch):
    """All tests are of the car on the default tires, and on MuJoCo's contacts."""
    monkeypatch.setitem(ON, "tires", request.param)
    return request.param


ON = {"tires": "coulomb"}


def flat_world(**settings):
    return flat_world_of(**ON, **settings)


def touched(model, data):
    """Where the tires touch the ground, halfway into what they give: under the lowest points of ellipsoids. (4, 3)."""
    if ON["tires"] == "contact":
        return data.contact.pos
    points = []
    for wheel in WHEELS:
        tire, turn = data.geom(f"{wheel}_tire"), data.geom(f"{wheel}_tire").xmat.reshape(3, 3)
        squares = turn @ np.diag(model.geom(f"{wheel}_tire").size ** 2) @ turn.T
        points.append(tire.xpos - squares[:, 2] / math.sqrt(squares[2, 2]))
    return np.array(points) * (1.0, 1.0, 0.5)


def kinematic_speed_limit(mu, radius):
    """The law sqrt(g mu b / tan|d|): b / tan|d| is the radius at the rear axle."""
    return math.sqrt(9.81 * mu * radius)


def ackermann_errors(data, parameters):
    """|knuckle - exact| of both knuckles [rad]: cot(outer) - cot(inner) = track width / wheelbase."""
    steering = data.joint("steering").qpos[0]
    half = 0.5 * parameters.track_width / parameters.wheelbase
    left, right = (math.atan(math.tan(steering) / (1.0 - side * half * math.tan(steering))) for side in (1, -1))
    return abs(data.joint("front_left_kingpin").qpos[0] - left), abs(data.joint("front_right_kingpin").qpos[0] - right)


def drive_circle(mu, radius, fraction, seconds=10.0, timestep=None):
    """Bring the rear axle to `fraction` of the speed limit on a circle.

    Returns (data, car, slip, radius) at the end, the latter two of the last part: the mean radius at the rear axle.
    """
    model, data, car = flat_world(mu=mu, timestep=timestep)
    meter = TireSlipMeter(model)
    target = fraction * kinematic_speed_limit(mu, radius)
    steering = math.atan(car.parameters.wheelbase / radius)
    car.set_pose(data, 0.0, 0.0, 0.0, 0.6 * target)
    timestep = model.opt.timestep
    command = 0.6 * target
    motion = []
    for index in range(round(seconds / timestep)):
        # gently, at 0.6 m/s^2; the servo holds the mean of all wheels, of which the front ones go faster
        command += math.copysign(0.6 * timestep, target - math.hypot(*data.qvel[:2]))
        steering_angle = steering * min(1.0, data.time / 0.3)
        car.apply(data, DriveCommand(steering_angle=steering_angle, speed=command))
        step(model, data)
        if index * timestep > 0.8 * seconds:
            meter.record(data)
            motion.append((math.hypot(*data.qvel[:2]), data.qvel[5]))
    speed, yaw_rate = np.mean(motion, axis=0)
    return data, car, meter.read(), speed / yaw_rate


def largest_even_torque_acceleration(parameters, mu, light_axle_lever, gravity=9.81):
    """Largest |a| at which the light axle still holds, all wheels driven or braked alike. Scalar [m/s^2].

    The light axle carries M (g c - a h') / L and passes on M a / 2, so that a = g c / L / (h' / L + 1 / (2 mu)), with
    c the distance of the CoG from the other axle, and h' = h + 4 I / (M r): wheels that spin up push the car's nose.
    """
    lever = parameters.center_of_gravity_height + 4 * SPIN_INERTIA / (parameters.mass * parameters.wheel_radius)
    base = parameters.wheelbase
    return gravity * light_axle_lever / base / (lever / base + 1.0 / (2.0 * mu))


def test_tires_give_under_the_car_as_springs_of_the_closed_form_do():
    model, data, car = flat_world()
    run(model, data, 2.0)
    forward(model, data)
    limits = car.parameters
    stiffness = tire_stiffness(model) if ON["tires"] == "contact" else np.full(4, 11.7e3)  # models/tires/coulomb.toml
    give = model.geom("front_left_tire").size[0] - np.array([data.body(f"{wheel}_wheel").xpos[2] for wheel in WHEELS])
    front, rear = (0.5 * limits.mass * 9.81 * lever / limits.wheelbase
                   for lever in (limits.rear_axle_distance, limits.front_axle_distance))  # fmt: skip
    assert give == pytest.approx(np.array([front, front, rear, rear]) / stiffness, rel=1e-3)
    assert give.mean() == pytest.approx(0.785e-3, rel=0.005)  # as models/f1tenth.xml says, and
    assert stiffness == pytest.approx([11.7e3] * 4, rel=0.01)


def drive_open_loop(timestep, steering, speed, seconds=6.0):
    """Drive as functions of the time say, at the LiDAR's rate; return (places (n, 2), end, greatest slide)."""
    model, data, car = flat_world(timestep=timestep)
    meter, places = TireSlipMeter(model), []
    car.set_pose(data, 0.0, 0.0, 0.0, speed(0.0))
    for tick in range(round(seconds / 0.025)):
        car.apply(data, DriveCommand(steering_angle=steering(0.025 * tick), speed=speed(0.025 * tick)))
        for _ in range(round(0.025 / timestep)):
            step(model, data)
            meter.record(data)
        places.append(data.qpos[:2].copy())
    end = np.array([*car.pose(data), car.ground_speed(data)])
    return np.array(places), end, np.nanmax(meter.read().sliding_speed)


MANOEUVRES = {  # steering [rad] and speed [m/s] over the time [s], and how far off 5 ms may be [m]
    "bends": (lambda time: 0.2 * math.sin(0.8 * time) ** 3, lambda time: 3.0 - math.sin(0.8 * time), 0.04),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", MANOEUVRES)
def test_places_converge_as_the_timestep_shrinks(name):
    """Oracle: a timestep of 0.25 ms, from which a method of the first order is off by timestep - 0.25 ms.

    Tires of bristles do not creep, and their steps are of the second order: bends are off by .28 mm at 5 ms, and most
    of that, .19, is of the short steps of the tires, which are no longer at 5 ms than at .5 ms.

    Of contacts, measured at 5, 2.5 and 1 ms: bends, 16.6 m, are off by 35.5, 16.8 and 5.6 mm at most. The greatest
    slide, 41.8 mm/s, stays within 0.1 mm/s; at 5 ms the heading ends 12.5 mrad off, and the speed 5.3 mm/s.
    """
    steering, speed, tolerance = MANOEUVRES[name]
    exact, exact_end, exact_slide = drive_open_loop(0.00025, steering, speed)
    creeps = ON["tires"] == "contact"
    assert 0.02 < exact_slide < SLIDING_SPEED if creeps else exact_slide < BRISTLES_SLIDE
    timesteps, errors = np.array([0.005, 0.0025, 0.001]), []
    assert timesteps[0] == flat_world()[0].opt.timestep
    for timestep in timesteps:
        places, end, slide = drive_open_loop(timestep, steering, speed)
        errors.append(np.hypot(*(places - exact).T).max())
        assert slide == pytest.approx(exact_slide, abs=2e-4 if creeps else 1.5e-3)
        assert end == pytest.approx(exact_end, abs=0.015 if creeps else 0.0035)
    if not creeps:
        assert errors[0] == max(errors) < 0.001
        return
    assert errors[0] < tolerance
    assert errors == pytest.approx(errors[0] * (timesteps - 0.00025) / (0.005 - 0.00025), rel=0.05)


def test_ackermann_is_exact_over_the_whole_range_standing():
    model, data, car = flat_world()
    worst = 0.0
    for steering in np.linspace(-0.4189, 0.4189, 41):
        data.ctrl[0] = steering
        run(model, data, 0.3)
        assert data.joint("steering").qpos[0] == pytest.approx(steering, abs=2e-4)
        worst = max(worst, *ackermann_errors(data, car.parameters))
    assert math.degrees(worst) < 0.02


@pytest.mark.parametrize(
    ("speed", "start", "end", "holds"),
    [(0.0, -0.4189, 0.4189, True), (4.0, -0.15, 0.15, True), (8.0, -0.1, 0.1, False)],
)
def test_steering_turns_at_its_rate_standing_and_at_speed(speed, start, end, holds):
    model, data, car = flat_world()
    car.set_pose(data, 0, 0, 0, speed)
    data.ctrl[0] = start
    run(model, data, 1.0)
    data.ctrl[0] = end
    rates = []
    while abs(data.joint("steering").qpos[0] - end) > 1e-3:
        step(model, data)
        rates.append(data.joint("steering").qvel[0])
        assert len(rates) * model.opt.timestep < 1.0
    assert max(rates) == pytest.approx(car.parameters.max_steering_rate, rel=0.02)
    # the rate limit's time plus the servo's own lag, twice its time constant of 10 ms
    assert len(rates) * model.opt.timestep == pytest.approx((end - start) / 3.2, abs=0.06)
    run(model, data, 0.3)
    reached = []
    for _ in range(round(1.0 / model.opt.timestep)):
        step(model, data)
        reached.append(data.joint("steering").qpos[0])
    # turning wheels are gyroscopes, and sliding tires hop a little: the servo is shaken, by 1.3e-3 rad at most
    assert np.mean(reached) == pytest.approx(end, abs=2e-4)
    assert reached == pytest.approx([end] * len(reached), abs=2e-4 if holds else 2e-3)


@pytest.mark.parametrize(("period", "delay"), [(0.01, 0.0), (0.025, 0.0), (0.1, 0.0), (0.025, 0.02)])
def test_full_throttle_gives_the_motors_power_at_every_speed(period, delay, tires):
    """Oracle: v dv/dt = 9.51 * 7.319, whatever the rate of the commands, and their delay."""
    world = World(OpenGround(seconds=60.0), mu=2.0, tires=tires, changes=CarChanges(command_delay=delay))
    engine = Engine(world, period=period)
    engine.place([Start(speed=7.5)])
    speeds = []
    while not speeds or speeds[-1] < 19.2:
        for _ in range(round(0.1 / period)):
            engine.commands[:] = 0.0, 20.0
            engine.drive()
        speeds.append(ground_speed(engine.qpos(0), engine.qvel(0), world.car.constants))
    power = np.diff(np.square(speeds)) / 0.2 / (9.51 * 7.319)
    assert speeds[0] < 8.5
    assert power.min() > 0.98
    assert power.max() < 1.003  # of contacts: it is that at a step's start


def test_braking_keeps_the_full_force_above_the_power_limit():
    model, data, car = flat_world(mu=3.0)
    car.set_pose(data, 0, 0, 0, 14.0)
    run(model, data, 0.3)
    before = car.ground_speed(data)
    car.apply(data, DriveCommand(steering_angle=0.0, speed=0.0))
    run(model, data, 0.3)
    assert (before - car.ground_speed(data)) / 0.3 == pytest.approx(car.parameters.max_acceleration, rel=0.02)


@pytest.mark.parametrize("mu", [1.0489, 0.6])
@pytest.mark.parametrize("direction", [-1, 1])
def test_light_axle_lets_go_at_the_closed_form(mu, direction, tires):
    """Braking lightens the rear axle (c = lf), accelerating the front axle (c = lr)."""
    model, _, car = flat_world(mu=mu)
    parameters = car.parameters
    lever = parameters.front_axle_distance if direction < 0 else parameters.rear_axle_distance
    limit = largest_even_torque_acceleration(parameters, mu, lever)
    light, heavy = (slice(2, 4), slice(0, 2)) if direction < 0 else (slice(0, 2), slice(2, 4))
    sliding = {}
    for fraction in (0.99, 1.05):
        data, meter = mujoco.MjData(model), TireSlipMeter(model)
        car.set_pose(data, 0, 0, 0, 7.0 if direction < 0 else 1.0)
        speeds = []
        while data.time < 0.3:  # ramped over 0.1 s, as springs and load transfer need
            asked = direction * fraction * limit * min(1.0, data.time / 0.1)
            data.ctrl[1] = car.odometry(data).speed + asked * parameters.speed_time_constant
            step(model, data)
            meter.record(data)
            speeds.append(data.qvel[0])
        slip = meter.read()
        sliding[fraction] = np.nanmax(slip.sliding_speed, axis=0)
        if fraction < 1.0:  # the tires then use of their friction what the car does of the limit
            reached = direction * (speeds[-1] - speeds[-11]) / (10 * model.opt.timestep) / limit
            # implicit integration softens the servo, and its mean over a step, as tires of ours have it, a little more
            assert reached == pytest.approx(fraction, rel=0.015 if tires == "contact" else 0.025)
            assert slip.friction_utilisation[-1, light] == pytest.approx(reached, rel=0.015)
    assert sliding[0.99].max() < SLIDING_SPEED / 10
    assert sliding[1.05][light].min() > 2 * SLIDING_SPEED
    assert sliding[1.05][heavy].max() < SLIDING_SPEED


# Measured onset: 0.99 to 1.00 of the law. On a tight circle it comes 2% early: the CoG's own circle is wider than the
# rear axle's, and the steered tires pull backwards. On a wide one, on slippery ground, a car that is 3% too fast runs
# wide at 17 mm/s, and creeps at 25: not yet SLIDING_SPEED (the closed form is tested below).
@pytest.mark.slow
@pytest.mark.parametrize(
    ("mu", "radius", "holds", "slides"),
    [
        *((mu, 0.8, 0.96, 1.0) for mu in (1.0489, 0.6)),
        *((mu, radius, 0.97, 1.03) for mu in (1.0489, 0.6) for radius in (1.5, 3.0)),
        (1.0489, 8.0, 0.97, 1.03),
        (0.6, 8.0, 0.97, 1.05),
    ],
)
def test_steady_circle_holds_up_to_the_speed_law_and_slides_beyond(mu, radius, holds, slides, tires):
    _, car, slip, driven = drive_circle(mu, radius, holds)
    assert np.isfinite(slip.sliding_speed).all() and slip.sliding_speed.max() < slides_above(tires)
    if tires == "contact":
        kinematic = radius
    else:  # the bristles bend, by up to half a degree: the axles go that much aside of where their wheels point
        base, (front, rear) = car.parameters.wheelbase, slip.slip_angle.mean(axis=0).reshape(2, 2).mean(axis=1)
        turned = math.tan(math.atan(base / radius) - front) + math.tan(rear)
        kinematic = base / math.cos(rear) / turned
        assert kinematic == pytest.approx(radius, rel=0.01)
    assert driven == pytest.approx(kinematic, rel=3e-3)
    assert np.nanmax(drive_circle(mu, radius, slides)[2].sliding_speed) > slides_above(tires)


@pytest.mark.slow
@pytest.mark.parametrize(("mu", "fraction"), [(0.6, 1.02), (0.4, 1.05)])
def test_front_tires_run_wide_as_fast_as_the_closed_form_says(mu, fraction):
    """Beyond the limit the circle is k^2 times as wide, and the front tires cross it, above what all creep.

    At 1 ms, because tires that slide do so a little faster at 5 ms.
    """
    radius = 8.0
    _, car, slip, driven = drive_circle(mu, radius, fraction, timestep=0.001)
    front, rear = slip.sliding_speed[:, :2], slip.sliding_speed[:, 2:]
    assert np.isfinite(slip.sliding_speed).all() and slip.friction_utilisation.min() > 0.99
    assert driven / radius == pytest.approx(fraction**2, rel=3e-3)
    angle = math.atan(car.parameters.wheelbase / radius)  # of the front tires to their way: what widens the circle
    wide = fraction * kinematic_speed_limit(mu, radius) * math.sin(angle) * (1.0 - fraction**-2)
    assert (front - rear).mean() == pytest.approx(wide, abs=1e-3)


@pytest.mark.parametrize("speed", [-3.0, 2.0, 15.0])
def test_wheel_speed_odometry_is_the_true_speed_when_rolling(speed):
    """Under the car's weight the contact lies a rolling radius below the axle; the axles' loads differ by 8%."""
    model, data, car = flat_world()
    car.set_pose(data, 0, 0, 0, speed)
    run(model, data, 1.0)
    assert car.odometry(data).speed == pytest.approx(car.ground_speed(data), rel=1e-4)
    assert car.odometry(data).wheel_speeds == pytest.approx([speed] * 4, rel=5e-4)


def test_suspension_carries_load_to_the_outer_and_front_wheels():
    """Load moved from left to right: (M (a h + g y) + 4 I omega yaw_rate) / track width.

    h and y: where the CoG is above and beside the points that the tires touch; the body rolls. Wheels are gyroscopes.
    """
    data, car, slip, _ = drive_circle(1.0489, 8.0, 0.7)
    limits = car.parameters
    forward(data.model, data)
    front_left, front_right, rear_left, rear_right = slip.normal_force[-1]
    speed, yaw_rate = np.hypot(*data.qvel[:2]), data.qvel[5]
    cos, sin = math.cos(car.pose(data)[2]), math.sin(car.pose(data)[2])
    outward = data.subtree_com[data.model.body("base_link").id] - touched(data.model, data).mean(axis=0)
    aside, above = sin * outward[0] - cos * outward[1], outward[2]  # to the right, which is outside
    roll_moment = limits.mass * (speed * yaw_rate * above + 9.81 * aside)
    gyroscopes = 4 * SPIN_INERTIA * speed / limits.wheel_radius * yaw_rate
    moved = 0.5 * ((front_right + rear_right) - (front_left + rear_left))
    assert sum(slip.normal_force[-1]) == pytest.approx(limits.mass * 9.81, rel=1e-3)
    assert moved == pytest.approx((roll_moment + gyroscopes) / limits.track_width, rel=5e-3)
    assert above == pytest.approx(limits.center_of_gravity_height, rel=0.01) and aside > 0.0
    stroke = [data.joint(f"{wheel}_suspension").qpos[0] for wheel in WHEELS]
    assert stroke[1] > 0.001 > -0.001 > stroke[0] and stroke[3] > 0.001 > -0.001 > stroke[2]
