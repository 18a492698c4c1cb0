"""The 2D gyms' single-track model as published, and what our car does beside it."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import fg_mujoco as fg
from car_worlds import flat_world
from fg_mujoco.lab.steady_circle import SteadyCircle
from fg_mujoco.vehicle.single_track import FRONT_STIFFNESS, REAR_STIFFNESS, SLOWEST, SingleTrack
from fg_mujoco.vehicle.tires import Tires

CAR = flat_world()[2]
GYM = SingleTrack(car=CAR.parameters, mu=CAR.mu)
MU_G = CAR.mu * CAR.parameters.gravity


def settled_yaw_rate(model, steering, speed):
    held = np.ones(4000)
    return model.follow(steering * held, speed * held, timestep=0.001).yaw_rate[-1]


def law(steering):
    return math.sqrt(MU_G * CAR.parameters.wheelbase / math.tan(steering))


@given(
    x6=st.floats(-6.0, 6.0), x7=st.floats(-0.5, 0.5), x3=st.floats(-0.42, 0.42), x4=st.floats(0.5, 20.0),
    u2=st.floats(-9.5, 9.5), mu=st.floats(0.2, 1.3),
)  # fmt: skip
def test_rates_are_the_published_equations(x6, x7, x3, x4, u2, mu):
    """Althoff et al., vehicle models, single-track: multiplied out there, by axles here."""
    model = SingleTrack(car=CAR.parameters, mu=mu)
    own = model.car
    m, i, h, g = own.mass, own.yaw_inertia, own.center_of_gravity_height, own.gravity
    lf, lr, csf, csr = own.front_axle_distance, own.rear_axle_distance, FRONT_STIFFNESS, REAR_STIFFNESS
    front, rear = csf * (g * lr - u2 * h), csr * (g * lf + u2 * h)
    yaw = (
        mu
        * m
        / (i * (lr + lf))
        * (lf * front * x3 + (lr * rear - lf * front) * x7 - (lf**2 * front + lr**2 * rear) * x6 / x4)
    )
    slip = mu / (x4 * (lr + lf)) * (front * x3 - (rear + front) * x7 + (rear * lr - front * lf) * x6 / x4) - x6
    assert model.rates(x6, x7, x3, x4, u2) == pytest.approx((yaw, slip), rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("steering", [0.05, 0.4])
@pytest.mark.parametrize("k", [0.3, 1.0, 2.0])
def test_a_held_circle_is_the_closed_form_of_understeer(steering, k):
    speed = k * law(steering)
    gradient = (1.0 / FRONT_STIFFNESS - 1.0 / REAR_STIFFNESS) / MU_G
    assert gradient > 0.0
    expected = speed * steering / (CAR.parameters.wheelbase + gradient * speed**2)
    assert settled_yaw_rate(GYM, steering, speed) == pytest.approx(expected, rel=1e-6)
    assert GYM.steady_yaw_rate(steering, speed) == pytest.approx(expected, rel=1e-12)


def test_its_place_runs_on_the_circle_of_its_yaw_rate():
    held = np.ones(8001)
    motion = GYM.follow(0.2 * held, 2.0 * held, timestep=0.001)
    settled = slice(2000, None)
    radius = 2.0 / motion.yaw_rate[-1]
    course = motion.heading + motion.slip_angle
    centre = np.array([motion.x - radius * np.sin(course), motion.y + radius * np.cos(course)])[:, settled]
    assert np.ptp(centre, axis=1) == pytest.approx([0.0, 0.0], abs=1e-6)
    # the rear tires need a slip angle that grows with the speed; without it the centre of gravity points outward
    rear = motion.slip_angle[-1] - CAR.parameters.rear_axle_distance / radius
    assert rear == pytest.approx(-(2.0**2) / radius / (MU_G * REAR_STIFFNESS), rel=1e-5)


def test_its_integration_converges_as_a_method_of_the_fourth_order():
    def end(timestep):
        time = np.arange(0.0, 1.0 + 0.5 * timestep, timestep)
        # linear between the steps, so that all timesteps drive the same
        steering = np.interp(time, [0.0, 0.2, 0.6, 1.0], [0.0, 0.2, -0.1, 0.1])
        return GYM.follow(steering, np.full_like(time, 3.0), timestep=timestep).y[-1]

    exact, errors = end(0.00125), []
    for timestep in (0.02, 0.01, 0.005):
        errors.append(abs(end(timestep) - exact))
    assert errors[0] < 1e-3
    assert errors[0] / errors[1] > 10.0 and errors[1] / errors[2] > 10.0


@pytest.mark.parametrize("speed", [0.0, 0.5 * SLOWEST, -1.0, math.nan])
def test_a_speed_at_which_the_published_model_is_another_is_refused(speed):
    with pytest.raises(fg.SettingsError, match=r"speed is .*; accepted: 0.1 m/s and above"):
        GYM.follow(np.zeros(3), np.array([1.0, speed, 1.0]), timestep=0.001)


@pytest.mark.slow
def test_our_car_turns_as_the_linear_model_does_below_half_of_the_limit():
    """With the stiffness of the contacts' creep: .1 % at .05 rad, 1.7 % at .3, where tan d is 3.1 % above d."""
    own, lr = CAR.parameters, CAR.parameters.rear_axle_distance
    for steering, margin in ((0.05, 0.003), (0.2, 0.01), (0.3, 0.02)):
        circle = SteadyCircle(CAR.mu, steering, tires=Tires())
        pair = circle.ground.model.pair("front_left_tire").id
        rate = -circle.ground.model.pair_solreffriction[pair, 1] / circle.ground.model.pair_solimp[pair, 0]  # [1/s]
        for k in (0.3, 0.7):
            reading = circle.at(k)
            yaw_rate = reading.curvature * math.tan(steering) / own.wheelbase * reading.speed
            speed = math.hypot(reading.speed, yaw_rate * lr)  # of the centre of gravity
            stiffness = float(rate) * speed / MU_G
            model = SingleTrack(car=own, mu=CAR.mu, front_stiffness=stiffness, rear_stiffness=stiffness)
            assert model.steady_yaw_rate(steering, speed) == pytest.approx(yaw_rate, rel=margin)
