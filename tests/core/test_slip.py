"""Slip angles: what a planner is told of its tires, and how it steers for them."""

import math
from dataclasses import replace

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.controllers.control.slip import (
    arc_angle,
    ground_speed,
    held_arc,
    held_on_arc,
    lock_arc,
    slip_angle,
    slip_row,
    stable_braking,
    steered,
    tightest_arc,
)
from fg_mujoco.controllers.control.stages import Stage
from fg_mujoco.controllers.gap_finder import GapFinder
from fg_mujoco.controllers.safety.friction_limiter import FrictionLimiter, held_on_circle
from fg_mujoco.lab.lab_ground import LabGround
from fg_mujoco.messages import DriveCommand
from fg_mujoco.vehicle.tires import AxleTires, Coulomb, Tires, tire_names
from fg_mujoco.vehicle.vehicle import Vehicle
from scan_worlds import CAR, scan_of
from vehicle_worlds import with_drive_line

BLIND = scan_of(np.zeros(1081))
SOFT = replace(CAR, **Tires.load("forzaeth_nuc6").for_planners())


@each("tires", ["forzaeth_nuc6", "forzaeth_nuc5"])  # the second ones lead less again where the rear axle slides first
@each("speed", [0.5, 2.0, 4.0, 6.0])
@each("share", [-0.9, 0.1, 0.6])
def test_the_arc_of_the_steering_angle_for_an_arc_is_this_arc(tires, speed, share):
    car = replace(CAR, **Tires.load(tires).for_planners())
    limiter = FrictionLimiter(car, min(car.front_peak, car.rear_peak)).record[0]
    angle = share * tightest_arc(limiter["slip"], speed)
    steering = steered(limiter["slip"], limiter["car"], angle, speed)
    assert abs(steering) > abs(angle)  # its front axle needs more slip angle than the one behind
    assert arc_angle(limiter["slip"], limiter["car"], steering, speed) == pytest.approx(angle, abs=1e-5)


@each("tires", [name for name in tire_names() if name not in ("coulomb", "contact")])  # a shaft lets stiff ones slide
@each("controller", ["gap_finder", "disparity_extender"])
def test_a_corridor_that_soft_tires_crashed_in_is_lapped_on_every_set_and_no_tire_slides(tires, controller):
    car = fg.race("l_corridor", controller, laps=1, tires=tires, mu=1.0489).car
    assert car.finished and car.collisions_wall == 0
    assert car.slide_time_fraction == 0.0 or math.isnan(car.slide_time_fraction)


def test_a_car_at_full_lock_runs_on_the_arc_that_its_wound_up_shaft_leaves():
    ground = LabGround()
    slip, car = (FrictionLimiter(ground.car.parameters, 0.94).record[0][name] for name in ("slip", "car"))
    ground.place(0.5)
    turned = ground.run([DriveCommand(steering_angle=0.4189, speed=0.5)] * 80)
    arc = math.tan(lock_arc(slip, car)) / car["wheelbase"]
    assert turned.yaw_rate[-1] / turned.speed[-1] == pytest.approx(arc, rel=0.02)
    assert arc < 0.96 * math.tan(0.4189) / car["wheelbase"]


@each("speed, steering", [(2.0, 0.3), (3.0, -0.15), (5.0, 0.1)])
def test_a_yaw_rate_computed_from_the_steering_becomes_that_of_the_arc_and_a_gyros_stays(speed, steering):
    ground, heard, told = LabGround(), [], []
    listen = Stage(text="", before_reference=lambda tick: heard.append(float(tick.odometry.angular_velocity[2])))
    listening = type("Listening", (GapFinder,), {"own_stages": lambda self: {"listen": listen}})
    planner = listening(ground.car.parameters, 0.94)
    ground.place(speed)
    ground.drive(lambda odometry: told.append(odometry) or DriveCommand(steering_angle=steering, speed=speed), 4.0)
    of_gyro = told[-1]
    computed = of_gyro.speed * math.tan(of_gyro.steering_angle) / planner.car.wheelbase
    assert abs(computed) > 1.1 * abs(of_gyro.yaw_rate)
    for yaw_rate in (computed, of_gyro.yaw_rate):
        planner(BLIND, replace(of_gyro, angular_velocity=np.array([0.0, 0.0, yaw_rate])))
    assert heard == [pytest.approx(of_gyro.yaw_rate, rel=0.03), of_gyro.yaw_rate]


@each("name, speed, sign", [("f1tenth", 0.0, 1.0), ("f1tenth", 0.0, -1.0), ("slipx_reference", 1.2, -1.0)])
def test_tires_drive_and_brake_at_full_lock_up_to_their_share_of_the_peak(name, speed, sign):
    ground = LabGround(tires=Tires.load(name).on(1.0489))
    limiter, brakes = FrictionLimiter(ground.car.parameters, Vehicle.load().reliable_mu(Tires.load(name))), speed > 0.0
    slip, car, lateral = limiter.record[0]["slip"], limiter.record[0]["car"], 0.13 * speed**2
    ground.place(speed)
    ground.run([DriveCommand(steering_angle=0.42, speed=speed)] * 20)
    held = held_on_arc(slip, car, 0.4, lateral, sign < 0.0, brakes, 0.865) * 9.81
    driver = lambda odometry: DriveCommand(steering_angle=0.42, speed=odometry.speed + sign * held * 0.1)  # noqa: E731
    trace = ground.drive(driver, 0.3, 0.005)
    use = trace.slip.friction_utilisation[-20:, slice(0, 2) if brakes else slice(2, 4)].mean()
    assert use == pytest.approx(0.865, abs=0.08) and not trace.slip.slides.any()


def circled(tires, radius):
    """A car on a steady circle at .95 of the speed that its planner drives on it, and its planner.

    Stiff tires have an open centre: the wheels of a shaft's axles differ by more than what takes them to their peaks.
    """
    vehicle = Vehicle.load()
    if not tires.for_planners():
        vehicle = replace(vehicle, text=with_drive_line(vehicle.text, centre="open"))
    ground = LabGround(tires=tires, vehicle=vehicle)
    car = ground.car.parameters
    planner = GapFinder(car, Vehicle.load().reliable_mu(tires))
    limiter, angle = planner.driver["limiter"][0], math.atan(car.wheelbase / radius)
    speed = 0.95 * min(held_on_circle(limiter, angle, 8.0, 0.0, 1.0)[1], 8.0)
    wheels = steered(limiter["slip"], limiter["car"], angle, speed) if limiter["slip"]["needs_slip_angle"] else angle
    ground.place(speed)
    shares = np.minimum(np.arange(60) / 30.0, 1.0)
    turned = ground.run(DriveCommand(steering_angle=share * wheels, speed=speed) for share in shares.tolist())
    assert not turned.slip.slides.any() and turned.yaw_rate[-1] * radius > 0.4 * turned.speed[-1]
    return ground, planner


@each("tires", tire_names())
def test_a_planner_that_sees_nothing_any_more_stops_in_a_bend_and_no_tire_slides(tires):
    ground, planner = circled(Tires.load(tires), 7.0)
    stop = ground.drive(lambda odometry: planner(BLIND, odometry), 6.0, until=lambda odometry: odometry.speed < 0.05)
    assert stop.speed[-1] < 0.2
    assert not stop.slip.slides.any()


def test_the_wheels_are_turned_out_by_as_much_as_the_car_turns_in_by_itself():
    limiter = FrictionLimiter(SOFT, 0.877).record[0]
    slip, car, arc = limiter["slip"], limiter["car"], math.tan(0.1) / SOFT.wheelbase
    assert held_arc(slip, car, 0.1, arc) == held_arc(slip, car, 0.1, 0.5 * arc) == 0.1  # as steered, or still less
    assert held_arc(slip, car, 0.1, 1.5 * arc) == pytest.approx(math.atan(0.5 * math.tan(0.1)))
    assert held_arc(slip, car, -0.1, -1.5 * arc) == -held_arc(slip, car, 0.1, 1.5 * arc)
    assert held_arc(slip, car, 0.0, arc) < 0.0  # steered against it
    assert held_arc(slip_row(CAR, 1.0, 9.0)[0], car, 0.1, 1.5 * arc) == 0.1


def test_planners_are_told_of_bristles_below_20_per_rad_and_read_their_force_back():
    def bristles(stiffness):
        lateral = Coulomb(D=0.9, stiffness=stiffness)
        axle = AxleTires(lateral=lateral, longitudinal=lateral, relaxation_length=0.045)
        return Tires(model="coulomb", front=axle, rear=axle)

    assert bristles(20.0).for_planners() == {} == Tires.load("coulomb").for_planners()
    tires = bristles(12.0)
    for floor in (0.9, 0.6):  # whose friction scales the force at each angle
        slip = slip_row(replace(CAR, **tires.for_planners()), floor, 8.0)[0]
        for angle in (0.01, 0.04, 0.07):
            force = floor / 0.9 * tires.axles[0].lateral.force(angle)
            assert slip_angle(slip["front"], force) == pytest.approx(angle)


@each("pull, start, near", [(-6.0, 6.0, 0.015), (-3.0, 6.0, 0.015), (2.0, 3.0, 0.015), (-9.0, 1.5, 0.07)])
def test_the_speed_over_the_ground_is_told_of_wheels_that_brake_and_drive(pull, start, near):
    ground = LabGround(tires=Tires.load("f1tenth_gym"))
    car = ground.car.parameters
    limiter, lag = FrictionLimiter(car, 1.0489).record[0], car.speed_time_constant
    ground.place(start)
    command = 0.0
    for _ in range(16):
        rolling = ground.car.odometry(ground.data).speed
        command = rolling + pull * lag
        trace = ground.hold(DriveCommand(steering_angle=0.0, speed=command), 0.005)
    rolling, moving = ground.car.odometry(ground.data).speed, trace.speed[-1]
    assert abs(rolling / moving - 1.0) > 0.03
    told = ground_speed(limiter["slip"], limiter["car"], rolling, 0.0, command)
    assert told == pytest.approx(moving, rel=near)
    assert ground_speed(limiter["slip"], limiter["car"], -rolling, 0.0, -command) == -told
    assert ground_speed(limiter["slip"], limiter["car"], rolling, 0.0, 0.0) == rolling  # no command is known


def tangent(axle, lateral, braking):
    """Force of an axle over its load for each rad, with the slip ratio as it is: by differences, along the slip."""
    size = math.hypot(lateral, braking)
    total = slip_angle(axle, size)
    ratio, angle = total * braking / size, total * lateral / size

    def force(angle):  # `slip_angle` read back
        total, low, high = math.hypot(ratio, angle), 0.0, 0.97 * axle["D"]
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if slip_angle(axle, middle) < total else (low, middle)
        return low * angle / total

    return (force(angle + 1e-5) - force(angle - 1e-5)) / 2e-5


@each("tires", ["forzaeth_nuc2", "slipx_reference", "f1tenth_gym"])
@each("use", [0.1, 0.5, 0.7])
def test_braking_is_held_where_the_single_track_model_becomes_unstable(tires, use):
    """Oracle: the determinant of the linear single-track model with the axles' tangents, which changes its sign."""
    car, speed, mu = replace(CAR, **Tires.load(tires).for_planners()), 7.0, 0.9
    slip = slip_row(car, mu, 8.0)[0]
    lf, lr, h, g = car.front_axle_distance, car.rear_axle_distance, car.center_of_gravity_height, car.gravity
    lateral = use * slip["most"]

    def determinant(braking):
        stiff = []
        for axle, static, load in (("front", lr, 1.0 + h / lr * braking), ("rear", lf, 1.0 - h / lf * braking)):
            stiff.append(g * static / car.wheelbase * load * tangent(slip[axle], lateral / load, braking))
        front, rear = stiff  # over the mass [m/s^2 / rad]
        heavy = car.mass / car.yaw_inertia
        unequal, both = lr * rear - lf * front, lf**2 * front + lr**2 * rear
        across = [-(front + rear) / speed, unequal / speed - speed]
        return np.linalg.det([across, [heavy * unequal / speed, -heavy * both / speed]])

    held = stable_braking(slip, use, speed)
    assert determinant(0.9 * held) > 0.0 > determinant(1.15 * held)
