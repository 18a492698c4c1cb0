"""What a planner learns of the friction: made-up sensors with a known answer, the bounds, the trip, and races."""

import math
from dataclasses import astuple

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.addons.drivers.friction_learning import (
    LEARNED,
    FrictionLearningSettings,
    commanded_steering,
    learn,
    learning_row,
    true_steering,
)
from fg_mujoco.controllers.control.planner_settings import CAR as CAR_ROW
from fg_mujoco.controllers.gap_finder import GapFinder
from fg_mujoco.messages import ODOMETRY
from scan_worlds import CAR, MU, corridor, odometry_of

PERIOD, AGE, LOAD_LAG = 0.025, 0.0025, 0.006  # [s]
STIFFNESS = 120.0  # [1/rad] of the set coulomb


def over_load(force, at_side, moved, lasting, later):
    """Force over load of a tire, a time after the accelerometer's reading [s]; both fall, the load later."""
    return force * math.exp(-later / lasting) / (at_side + moved * math.exp((LOAD_LAG - later) / lasting))


def pull_and_brake(mu, seconds, *, noise=0.0, drift=0.0, gain=1.0, offset=0.0, slipping=0.0, seed=0):
    """Odometry of a car of four wheels on Coulomb tires that pulls, brakes and turns, worked out wheel by wheel.

    Its wheels are pressed flatter by their load. Their bristles are bent by force over load and roll on: slip is what
    they are bent by, and how fast that changes over the speed, while force and moved load fall over the motor's time
    constant. The damping of the bristles takes a part of the force. The load is LOAD_LAG late, the accelerometer's
    reading AGE old.
    """
    stiffness = mu * STIFFNESS * CAR.mass * CAR.gravity / 4.0 / 0.045  # [N/m] of a tire
    damping = 0.6 * math.sqrt(stiffness / mu * CAR.wheel_inertia / CAR.wheel_radius**2)  # [N s/m] at any friction
    rng = np.random.default_rng(seed)
    rows = np.zeros(int(seconds / PERIOD), ODOMETRY)
    pitch = CAR.center_of_gravity_height + 4.0 * CAR.wheel_inertia / (CAR.mass * CAR.wheel_radius)
    for row, time in zip(rows, np.arange(len(rows)) * PERIOD, strict=True):
        speed = 4.0 + 1.5 * math.sin(0.7 * time)
        forward = 0.4 * mu * math.sin(2.3 * time)  # over g
        left = 0.3 * mu * math.sin(0.9 * time)
        angle = math.atan(left * CAR.wheelbase * CAR.gravity / speed**2)
        yaw_rate = speed * math.tan(angle) / CAR.wheelbase
        tan = math.tan(angle)
        speeds = []
        for wheel in range(4):
            side, front = (1.0 if wheel % 2 else -1.0), wheel < 2
            share = (CAR.rear_axle_distance if front else CAR.front_axle_distance) / CAR.wheelbase / 2.0
            at_side = share + 2.0 * side * CAR.center_of_gravity_height / CAR.track_width * left * share
            moved = (-0.5 if front else 0.5) * pitch / CAR.wheelbase * forward
            load = at_side + moved
            rolling = speed + side * 0.5 * CAR.track_width * yaw_rate
            sideways = -left / (mu * STIFFNESS) * speed
            if front:
                turned = math.atan2(tan, 1.0 + side * 0.5 * CAR.track_width / CAR.wheelbase * tan)
                rolling = rolling * math.cos(turned) + (CAR.wheelbase * yaw_rate + sideways) * math.sin(turned)
            force = 0.25 * (forward + CAR.rear_axle_distance / CAR.wheelbase * left * math.sin(angle))
            lasting = CAR.speed_time_constant + speed / (mu * STIFFNESS * CAR.gravity)
            bent, later = (over_load(force, at_side, moved, lasting,
                                     age) / (mu * STIFFNESS) for age in (AGE, AGE + 1e-6))  # fmt: skip
            change = (later - bent) / 1e-6
            slip = bent - damping / stiffness * change + 0.045 / speed * change
            speeds.append(rolling * (1.0 + slip) + 0.03 * rolling * (load - share) + (slipping if wheel == 2 else 0.0))
        row["wheel_speeds"] = (np.array(speeds) + noise * rng.standard_normal(4)) * (1.0 + drift)
        row["speed"], row["angular_velocity"][2] = np.mean(row["wheel_speeds"]), yaw_rate * (1.0 + drift)
        row["linear_acceleration"][:2] = forward * CAR.gravity, left * CAR.gravity
        row["steering_angle"] = math.atan((math.tan(angle) - math.tan(offset)) / gain)
    return rows


def learned_from(rows, car=CAR, learned=None, **settings):
    """What is learned from odometry, row by row, a row of LEARNED."""
    learned = np.zeros(1, LEARNED) if learned is None else learned
    learning, row = learning_row(car, FrictionLearningSettings(**settings)), np.array([astuple(car)], CAR_ROW)
    for odometry in rows:
        learn(learning[0], learned[0], row[0], odometry, PERIOD)
    return learned[0]


@each("mu", [0.4, 0.55, 0.8, 1.1])
def test_the_friction_of_made_up_wheels_is_found(mu):
    """Within 3 % of the truth; used is that less what the model may be wrong by, or the start, if that is within it."""
    learned = learned_from(pull_and_brake(mu, 20.0))
    assert learned["mean"] == pytest.approx(mu, rel=0.03)
    assert learned["slides"] == 0
    assert learned["mu"] <= max(learned["mean"], FrictionLearningSettings().start)


def test_wheel_speeds_with_noise_leave_the_friction_uncertain_and_so_the_car_slow():
    """2 cm/s of noise hides slips of some mm/s: the standard deviation says so, and less is used."""
    clear, noisy = (learned_from(pull_and_brake(1.0, 15.0, noise=noise)) for noise in (0.0, 0.02))
    assert noisy["deviation"] > 3.0 * clear["deviation"]
    assert noisy["mu"] < 0.9 * clear["mu"]


def test_nothing_is_used_beyond_a_step_above_what_the_tires_have_held():
    """The bound that trips: sensors that say mu 1.1, of tires that never had to hold as much."""
    rows = pull_and_brake(1.1, 20.0)
    held = learned_from(rows, step=0.05)
    assert held["mean"] == pytest.approx(1.1, rel=0.03)
    assert held["mu"] == pytest.approx(1.05 * held["held"], rel=1e-9)
    assert held["mu"] < 0.95 * learned_from(rows)["mu"]


def test_a_wheel_that_spins_trips_once_and_what_is_used_falls():
    """A rear wheel turns .6 m/s too fast for .2 s: one slide, less friction at once, and a ceiling that holds it."""
    before = learned_from(pull_and_brake(0.8, 20.0))
    memory = np.array([before.copy()], LEARNED)
    used = float(memory[0]["mu"])
    after = learned_from(pull_and_brake(0.8, 0.2, slipping=0.6), learned=memory)
    assert after["slides"] == 1
    assert 0.5 * used <= after["mu"] <= 0.95 * used
    ceiling = float(after["ceiling"])
    later = learned_from(pull_and_brake(0.8, 15.0), learned=memory)
    assert later["slides"] == 1
    assert later["mu"] <= ceiling * 1.05


@each("gain, offset", [(0.85, 0.0), (1.2, 0.0), (1.0, 0.03), (0.88, -0.02)])
def test_gain_and_offset_of_the_steering_are_found_and_taken_back(gain, offset):
    learned = learned_from(pull_and_brake(0.8, 20.0, gain=gain, offset=offset))
    assert 1.0 + learned["gain"] == pytest.approx(gain, abs=0.01)
    assert learned["offset"] == pytest.approx(offset, abs=0.003)
    assert commanded_steering(learned, true_steering(learned, 0.1)) == pytest.approx(0.1)


def test_the_planner_starts_slippery_whatever_it_is_told():
    """Its limiter, at the first scan, is that of mu .4; without `learn` it is that of what it is told."""
    for learns, expected in ((True, 0.4), (False, MU)):
        planner = GapFinder(CAR, MU, 8.0, assist="full+learn" if learns else "full")
        planner(corridor(1.0, 1.0), odometry_of(3.0))
        found = planner._alone._ticks["driver"][0]["limiter"]
        assert found["mu"] == pytest.approx(expected)
        assert found["lateral"] == pytest.approx(0.95 * expected * CAR.gravity)


@each("tires, mu", [("coulomb", 0.6), ("forzaeth_nuc6", 0.9)])
def test_a_race_that_is_not_told_the_friction_has_no_slide_and_is_near_the_told_one(tires, mu):
    """Two laps of a track with tight bends: lap 2 within 8 %, and no tire past its peak."""
    names = ("gap_finder", "gap_finder[assist=full+learn]")
    told, learns = (fg.race("tight", name, laps=2, mu=mu, tires=tires).car for name in names)
    assert learns.end_reason == "finished"
    assert learns.max_slide_m_s < 0.01
    assert learns.lap_times_s[1] < 1.08 * told.lap_times_s[1]
    assert learns.lap_times_s[0] > 1.02 * told.lap_times_s[0]  # it has not been told
