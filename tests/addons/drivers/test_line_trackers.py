"""Trackers of a line: closed forms, the regulator against Riccati's equation, and a car that joins a line."""

import math
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from scipy.linalg import solve_continuous_are
from test_pure_pursuit import CAR, OPEN, at, circle, driven, pursuer

import fg_mujoco as fg
from cases import each
from fg_mujoco.addons.drivers.line_trackers import lqr_feedback
from fg_mujoco.controllers.control.slip import steady_arc, steered
from fg_mujoco.controllers.safety.friction_limiter import FrictionLimiter
from fg_mujoco.messages import MapLine


@each("length", [0.3, 0.8, 2.0])
def test_the_regulator_solves_riccatis_equation(length):
    a, b = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [1.0]])
    gain = b.T @ solve_continuous_are(a, b, np.diag([length**-4, 0.0]), np.eye(1))
    for aside, angle in ((0.1, 0.0), (0.0, 0.2), (-0.3, 0.1)):
        assert lqr_feedback(aside, angle, length) == pytest.approx(-(gain @ [aside, angle])[0], rel=1e-9)


def test_stanleys_law_on_a_straight_line():
    line = MapLine(points=np.array([[0.0, 0.0], [30.0, 0.0]]), closed=False)
    command = pursuer(line, mu=math.inf, tracker="stanley")(OPEN, at(5.0, 0.1, -0.05, 2.0))
    front = 0.1 - CAR.wheelbase * math.sin(0.05)
    assert command.steering_angle == pytest.approx(0.05 - math.atan(2.5 * front / 2.0), rel=1e-9)


@each("direction, tracker", product((1, -1), ("stanley", "lqr", "map", "mpc")))
def test_on_a_circle_it_stays(direction, tracker):
    trace = driven(pursuer(circle(2.0, direction), tracker=tracker), (2.0, 0.0, direction * math.pi / 2), 300)
    assert np.abs(np.hypot(trace[:, 0], trace[:, 1]) - 2.0).max() < 0.06


@each("offset, tracker", product((0.3, -1.5), ("stanley", "lqr", "map", "mpc")))
def test_it_joins_a_straight_line_and_stays_on_it(offset, tracker):
    line = MapLine(points=np.array([[0.0, 0.0], [100.0, 0.0]]), closed=False)
    trace = driven(pursuer(line, max_speed=4.0, tracker=tracker), (0.0, offset, 0.5), 500)
    settled = trace[trace[:, 0] > 38.0]
    assert len(settled) > 10 and np.abs(settled[:, 1]).max() < 0.02


@each("stiffnesses", [(4.7, 5.5), (5.5, 4.7)])
@each("speed, curvature", [(2.0, 0.3), (5.0, -0.1), (5.0, 0.2)])
def test_the_look_up_steers_the_single_track_car_along_a_steady_curve(speed, curvature, stiffnesses):
    front, rear = stiffnesses
    car = replace(CAR, front_cornering_stiffness=front, rear_cornering_stiffness=rear, front_peak=1.0, rear_peak=1.0,
                  relaxation_length=0.01)  # fmt: skip
    limiter = FrictionLimiter(car, 1.0).record[0]
    slip, row = limiter["slip"], limiter["car"]
    arc = math.atan(car.wheelbase * curvature)
    steering = steered(slip, row, steady_arc(slip, row, arc, speed), speed)
    if front > rear:
        assert steering == arc
        return
    gradient = (1.0 / front - 1.0 / rear) / car.gravity  # of a car on linear axles, at mu 1
    assert steering / (car.wheelbase + gradient * speed**2) == pytest.approx(curvature, rel=0.01)


def test_map_laps_on_tires_that_need_slip_angles():
    planner = "pure_pursuit[line=raceline,margin=0.2,tracker=map]"
    car = fg.race("hairpins", planner, laps=1, tires="f1tenth_gym").car
    assert car.end_reason == "finished" and car.max_slide_m_s < 0.01
