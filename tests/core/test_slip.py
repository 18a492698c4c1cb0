"""Slip angles: what a planner is told of its tires, and how it steers for them."""

import math
from dataclasses import replace

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.controllers.control.slip import arc_angle, held_arc, slip_angle, slip_row, steered
from fg_mujoco.controllers.gap_finder import GapFinder
from fg_mujoco.controllers.safety.friction_limiter import FrictionLimiter, held_on_circle
from fg_mujoco.lab.lab_ground import LabGround
from fg_mujoco.messages import DriveCommand
from fg_mujoco.vehicle.tires import AxleTires, Coulomb, Tires, tire_names
from fg_mujoco.vehicle.vehicle import Vehicle
from scan_worlds import CAR, scan_of

BLIND = scan_of(np.zeros(1081))
SOFT = replace(CAR, **Tires.load("forzaeth_nuc6").for_planners())


@each("speed", [0.5, 2.0, 4.0])
@each("angle", [-0.1, 0.02, 0.15])
def test_the_arc_of_the_steering_angle_for_an_arc_is_this_arc(speed, angle):
    limiter = FrictionLimiter(SOFT, 0.877).record[0]
    steering = steered(limiter["slip"], limiter["car"], angle, speed)
    assert abs(steering) > abs(angle)  # its front axle needs more slip angle than the one behind
    if abs(steering) < SOFT.max_steering_angle:
        assert arc_angle(limiter["slip"], limiter["car"], steering, speed) == pytest.approx(angle, abs=1e-5)


def test_a_corridor_that_an_understeering_car_crashed_in_is_lapped():
    result = fg.race("l_corridor", laps=1, tires="forzaeth_nuc6")
    assert result.car.finished and result.car.max_slide_m_s == 0.0
    assert result.world.parameters.front_peak == pytest.approx(0.877, abs=1e-3)


def circled(tires, radius):
    """A car on a steady circle at .95 of the speed that its planner drives on it, and its planner."""
    ground = LabGround(tires=tires)
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
    assert held_arc(slip_row(CAR, 9.0)[0], car, 0.1, 1.5 * arc) == 0.1


def test_planners_are_told_of_bristles_below_20_per_rad_and_read_their_force_back():
    def bristles(stiffness):
        lateral = Coulomb(D=0.9, stiffness=stiffness)
        axle = AxleTires(lateral=lateral, longitudinal=lateral, relaxation_length=0.045)
        return Tires(model="coulomb", front=axle, rear=axle)

    assert bristles(20.0).for_planners() == {} == Tires.load("coulomb").for_planners()
    tires = bristles(12.0)
    slip = slip_row(replace(CAR, **tires.for_planners()), 8.0)[0]
    for angle in (0.01, 0.04, 0.07):
        assert slip_angle(slip["front"], tires.axles[0].lateral.force(angle)) == pytest.approx(angle)
