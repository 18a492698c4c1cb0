"""Braking and the friction circle against closed forms."""

import math

import numpy as np
import pytest

from cases import each
from fg_mujoco.lab.braking import EXPERIMENT, GRIPPY
from fg_mujoco.lab.experiment import LAW_TIRES
from fg_mujoco.lab.straight_line_limits import even_torque_limit, held_share
from fg_mujoco.vehicle.tire_slip import slides_above
from fg_mujoco.vehicle.vehicle import Vehicle

CAR = Vehicle.load().parameters


def stops(tires, mu, speed):
    rows = EXPERIMENT.measure({"tires": tires, "part": "stop", "mu": mu, "speed": speed})["stops"]
    return {row["how"]: row for row in rows}


# Measured: held .997 and .999 of v^2/(2 mu g); at full brake 1.001 and .978 of the closed form; limited 1.000.
@each("tires", LAW_TIRES)
@each(("mu", "speed"), [(1.0489, 8.0), (0.6, 8.0)])
def test_stops_are_as_long_as_the_closed_forms(mu, speed, tires):
    rows = stops(tires, mu, speed)
    assert rows["held"]["distance_m"] == pytest.approx(speed**2 / (2 * mu * 9.81), rel=0.01)
    assert rows["full"]["distance_m"] == pytest.approx(rows["full"]["closed_form_m"], rel=0.035)
    assert rows["limiter"]["distance_m"] == pytest.approx(rows["limiter"]["closed_form_m"], rel=0.005)
    assert rows["limiter"]["slide_m_s"] < 0.1 * slides_above(tires)
    assert rows["held"]["distance_m"] < rows["full"]["distance_m"] < rows["limiter"]["distance_m"]


@each("tires", LAW_TIRES)
def test_full_throttle_is_the_motors_limit_where_the_ground_holds(tires):
    rows = EXPERIMENT.measure({"tires": tires, "part": "throttle", "mu": GRIPPY})["throttle"]
    slow = [row for row in rows if row["speed_m_s"] < 0.95 * CAR.power_limit_speed]
    fast = [row for row in rows if row["speed_m_s"] > 1.1 * CAR.power_limit_speed]
    assert len(slow) > 3 and len(fast) > 10
    for row in slow:
        assert row["acceleration_m_s2"] == pytest.approx(9.51, rel=0.003)
    for row in fast:
        assert row["acceleration_m_s2"] == pytest.approx(9.51 * 7.319 / row["speed_m_s"], rel=0.005)


def test_tires_that_slip_leave_less_of_an_acceleration_and_none_of_it_to_a_car_that_stands():
    """Oracle: the servo and the slip of its wheels, integrated over ticks until they repeat."""
    speed, slope, lag = 8.0, 60.0, CAR.speed_time_constant
    wheel, car, shares = 0.0, 0.0, []
    for _ in range(80):
        target, start = wheel - lag, car  # asks for 1 m/s^2 less
        for _ in range(2500):
            # the wheels are slower than the car by speed times force / (slope g)
            force = (car - target) / lag / (1.0 + speed / (lag * CAR.gravity * slope))
            car -= 1e-5 * force
        wheel = car - speed * force / (CAR.gravity * slope)
        shares.append((start - car) / 0.025)
    assert held_share(CAR, speed, slope) == pytest.approx(shares[-1], rel=1e-3)
    assert held_share(CAR, 0.0, slope) == held_share(CAR) == pytest.approx(held_share(CAR, speed), rel=1e-12)


def test_even_torque_limit_balances_the_light_axle():
    for mu, direction in ((1.0489, -1), (0.6, 1)):
        a = even_torque_limit(mu, CAR, direction)
        lever = CAR.front_axle_distance if direction < 0 else CAR.rear_axle_distance
        load = CAR.mass * (CAR.gravity * lever - a * CAR.center_of_gravity_height) / CAR.wheelbase
        assert 0.5 * CAR.mass * a == pytest.approx(mu * load)


@each("tires", LAW_TIRES)
@each(("mu", "share"), [(1.0489, 0.6), (0.6, 0.9)])
def test_tires_stay_in_their_circle_and_the_guard_in_what_holds(mu, share, tires):
    tables = EXPERIMENT.measure({"tires": tires, "part": "split", "mu": mu, "share": share})
    for row in tables["splits"]:
        assert row["reason"] == ""
        # reached, and not passed; on bristles forces and loads are means over short steps
        assert 1.0 - (1e-6 if tires == "contact" else 1e-4) < row["greatest_use"] < 1.0 + 1e-6
        assert abs(row["limiter_share"]) < 0.95 * abs(row["longitudinal_share"])  # measured: .90 at the nearest
        assert row["use_of_car"] < 1.02
    car = np.array([(row["along_g"], row["across_g"]) for row in tables["gg"]])
    assert np.hypot(*car.T).max() < 1.05 * mu  # loads bounce when tires slide
    columns = [
        name.removeprefix("along_") for name in tables["gg"][0] if name.startswith("along_") and name != "along_g"
    ]
    for tire in columns:
        use = np.array([math.hypot(row[f"along_{tire}"], row[f"across_{tire}"]) for row in tables["gg"]])
        assert np.nanmax(use) < mu * (1 + 1e-6)
    assert len(columns) == 4 and len(car) > 20
