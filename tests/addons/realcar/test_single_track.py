"""The linear single-track model as published, and what our car does beside it; numbers of vehicles by fitting."""

import math
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import fg_mujoco as fg
from car_worlds import flat_world
from cases import each
from fg_mujoco.addons.realcar.fitting import fit
from fg_mujoco.addons.realcar.single_track import FRONT_STIFFNESS, REAR_STIFFNESS, linear_rates
from fg_mujoco.lab.steady_circle import SteadyCircle
from fg_mujoco.vehicle.bodywork import add_hull
from fg_mujoco.vehicle.tires import Tires
from vehicle_worlds import load

CAR = flat_world()[2]
OWN = CAR.parameters
MU_G = CAR.mu * OWN.gravity


def rates(*state, mu=CAR.mu, front=FRONT_STIFFNESS, rear=REAR_STIFFNESS):
    return linear_rates(*state, mu, front, rear, OWN.front_axle_distance, OWN.rear_axle_distance,
                        OWN.center_of_gravity_height, OWN.mass, OWN.yaw_inertia, OWN.gravity)  # fmt: skip


def settled(steering, speed, front=FRONT_STIFFNESS, rear=REAR_STIFFNESS):
    """The yaw rate at which nothing changes: the rates are linear in yaw rate and slip angle."""
    at = [np.array(rates(*state, steering, speed, 0.0, front=front, rear=rear)) for state in ((0, 0), (1, 0), (0, 1))]
    return np.linalg.solve(np.column_stack((at[1] - at[0], at[2] - at[0])), -at[0])[0]


@given(x6=st.floats(-6.0, 6.0), x7=st.floats(-0.5, 0.5), x3=st.floats(-0.42, 0.42), x4=st.floats(0.5, 20.0),
       u2=st.floats(-9.5, 9.5), mu=st.floats(0.2, 1.3))  # fmt: skip
def test_rates_are_the_published_equations(x6, x7, x3, x4, u2, mu):
    """Althoff et al., vehicle models, single-track: multiplied out there, by axles here."""
    own = OWN
    m, i, h, g = own.mass, own.yaw_inertia, own.center_of_gravity_height, own.gravity
    lf, lr, csf, csr = own.front_axle_distance, own.rear_axle_distance, FRONT_STIFFNESS, REAR_STIFFNESS
    front, rear = csf * (g * lr - u2 * h), csr * (g * lf + u2 * h)
    turning = lf * front * x3 + (lr * rear - lf * front) * x7 - (lf**2 * front + lr**2 * rear) * x6 / x4
    yaw = mu * m / (i * (lr + lf)) * turning
    slip = mu / (x4 * (lr + lf)) * (front * x3 - (rear + front) * x7 + (rear * lr - front * lf) * x6 / x4) - x6
    assert rates(x6, x7, x3, x4, u2, mu=mu) == pytest.approx((yaw, slip), rel=1e-9, abs=1e-9)


@each("k, steering", product((0.3, 1.0, 2.0), (0.05, 0.4)))
def test_a_held_circle_is_the_closed_form_of_understeer(k, steering):
    speed = k * math.sqrt(MU_G * OWN.wheelbase / math.tan(steering))
    gradient = (1.0 / FRONT_STIFFNESS - 1.0 / REAR_STIFFNESS) / MU_G
    assert settled(steering, speed) == pytest.approx(speed * steering / (OWN.wheelbase + gradient * speed**2), rel=1e-6)
    assert settled(steering, speed, 3.0, 3.0) == pytest.approx(speed * steering / OWN.wheelbase, rel=1e-6)


def test_braking_loads_the_front_axle_and_turns_the_car_in():
    braking, rolling, driving = (rates(0.0, 0.0, 0.1, 3.0, acceleration)[0] for acceleration in (-5.0, 0.0, 5.0))
    assert braking > rolling > driving


@pytest.mark.slow
def test_our_car_turns_as_the_linear_model_does_below_half_of_the_limit():
    """With the stiffness of the contacts' creep: .1 % at .05 rad, 1.7 % at .3, where tan d is 3.1 % above d."""
    own, lr = OWN, OWN.rear_axle_distance
    for steering, margin in ((0.05, 0.003), (0.2, 0.01), (0.3, 0.02)):
        circle = SteadyCircle(CAR.mu, steering, tires=Tires())
        pair = circle.ground.model.pair("front_left_tire").id
        rate = -circle.ground.model.pair_solreffriction[pair, 1] / circle.ground.model.pair_solimp[pair, 0]  # [1/s]
        for k in (0.3, 0.7):
            reading = circle.at(k)
            yaw_rate = reading.curvature * math.tan(steering) / own.wheelbase * reading.speed
            speed = math.hypot(reading.speed, yaw_rate * lr)  # of the centre of gravity
            stiffness = float(rate) * speed / MU_G
            assert settled(steering, speed, stiffness, stiffness) == pytest.approx(yaw_rate, rel=margin)


@each("name", (*fg.vehicle_names(), "made"))
def test_its_numbers_are_those_that_fitting_gives(name):
    """Of what a compiled model has; so that no number is left behind when another is changed."""
    vehicle = load(name)
    spec, limits = vehicle.spec(), vehicle.parameters
    fit(
        spec,
        mass=limits.mass,
        center_of_gravity=(limits.rear_axle_distance, limits.center_of_gravity_height),
        yaw_inertia=limits.yaw_inertia,
    )
    fitted, model = add_hull(spec).compile(), vehicle.compile()
    for array in ("body_mass", "body_ipos", "body_inertia", "body_pos", "geom_size", "site_pos", "qpos_spring",
                  "eq_data", "actuator_gainprm", "actuator_biasprm", "actuator_forcerange"):  # fmt: skip
        rounding = 4e-5 if array == "eq_data" else 3e-6
        assert getattr(model, array) == pytest.approx(getattr(fitted, array), rel=1e-4, abs=rounding), array
